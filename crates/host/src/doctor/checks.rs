//! All lines, in the order in which they are printed.

use super::{Group, Level, Line, Look, Pc};
use super::{background, core, kernel, measure, memory, nic, power, rights};

const fn line(
    group: Group,
    level: Level,
    name: &'static str,
    wanted: &'static str,
    look: fn(&Pc<'_>) -> Option<Look>,
) -> Line {
    Line {
        name,
        group,
        level,
        wanted,
        look,
    }
}

use Group::{Background, Core, Kernel, Machine, Measured, Memory, Network, Power, Rights};
use Level::{Info, Must, Should};

#[rustfmt::skip]
pub static LINES: &[Line] = &[
    line(Kernel, Should, "PREEMPT_RT", "yes", kernel::preempt_rt),
    line(Kernel, Info, "preemption", "full", kernel::preemption),
    line(Kernel, Info, "kernel options", "for isolated real time", kernel::options),
    line(Kernel, Must, "timer resolution", "1 ns", kernel::timers),

    line(Machine, Should, "virtual machine", "no", kernel::virtual_machine),
    line(Machine, Should, "stolen time", "0 ms", kernel::steal),
    line(Machine, Should, "clock source", "tsc", kernel::clocksource),
    line(Machine, Should, "TSC", "constant_tsc, nonstop_tsc", kernel::tsc),
    line(Machine, Should, "SMI", "none while watched", kernel::smi),

    line(Core, Must, "core", "online, not the only one", core::core),
    line(Core, Should, "other control", "none on the core", core::other_control),
    line(Core, Should, "isolated", "the core", core::isolated),
    line(Core, Info, "nohz_full", "the core", core::nohz_full),
    line(Core, Should, "rcu_nocbs", "the core", core::rcu_nocbs),
    line(Core, Should, "SMT sibling", "none, or isolated", core::sibling),
    line(Core, Should, "interrupts", "none but the field bus's", core::interrupts),
    line(Core, Must, "irqbalance", "not running, or not there", core::irqbalance),

    line(Power, Should, "governor", "performance, or fixed", power::governor),
    line(Power, Should, "idle states", "2 us at most, or forbidden", power::idle_states),

    line(Rights, Should, "throttling", "90 % or more, or off", rights::throttling),
    line(Rights, Info, "fair server", "10 % or less", rights::fair_server),
    line(Rights, Must, "the core itself", "given", rights::take_core),
    line(Rights, Must, "SCHED_FIFO", "given", rights::fifo),
    line(Rights, Must, "locked memory", "given", rights::locked_memory),
    line(Rights, Must, "raw socket", "given", rights::raw_socket),

    line(Memory, Should, "huge pages", "never", memory::huge_pages),
    line(Memory, Should, "swap", "none, or vm.swappiness 1", memory::swap),
    line(Memory, Should, "same pages (KSM)", "off", memory::same_pages),
    line(Memory, Should, "NUMA balancing", "off", memory::numa_balancing),

    line(Network, Must, "interface", "one that is there", nic::interface),
    line(Network, Should, "link", "up", nic::link),
    line(Network, Should, "driver", "not on USB", nic::driver),
    line(Network, Should, "coalescing", "0 us, not adaptive", nic::coalescing),
    line(Network, Should, "offloads", "off", nic::offloads),
    line(Network, Should, "EEE", "off", nic::energy_efficient),
    line(Network, Info, "flow control", "off", nic::flow_control),
    line(Network, Info, "speed", "100 Mbit/s", nic::speed),
    line(Network, Should, "IP addresses", "none", nic::addresses),
    line(Network, Info, "queues", "1", nic::queues),
    line(Network, Should, "packet steering", "off", nic::packet_steering),
    line(Network, Should, "interrupt line", "its own, by message (MSI)", nic::interrupt_line),
    line(Network, Should, "interrupt thread", "FIFO 85 or more", nic::interrupt_thread),
    line(Network, Info, "PCIe link power", "performance", nic::link_power),
    line(Network, Info, "time stamps", "hardware", nic::time_stamps),
    line(Network, Info, "launch time", "yes", nic::launch_time),

    line(Background, Should, "lock-up watchdog", "off, or not on the core", background::watchdog),
    line(Background, Should, "NMI watchdog", "off", background::nmi_watchdog),
    line(Background, Should, "workqueues", "not on the core", background::workqueues),
    line(Background, Info, "kernel threads", "none that could go", background::kernel_threads),
    line(Background, Info, "timer migration", "off", background::timer_migration),
    line(Background, Info, "vm.stat_interval", "10 s or more", background::stat_interval),
    line(Background, Info, "RT group scheduling", "none, or time for ours", rights::group_scheduling),

    line(Measured, Should, "wake-up latency", "at most 50 us", measure::wake_up),
    line(Measured, Info, "gaps", "at most 50 us", measure::gaps),
];
