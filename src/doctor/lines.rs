//! All lines, in the order in which they are printed.

use super::{Group, Level, Line, Look, Pc};
use super::{background, kernel};

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

use Group::{Background, Kernel, Machine};
use Level::{Info, Must, Should};

/// All lines.
#[rustfmt::skip]
pub static LINES: &[Line] = &[
    line(Kernel, Should, "PREEMPT_RT", "yes", kernel::preempt_rt),
    line(Kernel, Info, "preemption", "full", kernel::preemption),
    line(Kernel, Info, "kernel options", "timers, isolation, nohz, nocb", kernel::options),
    line(Kernel, Must, "timer resolution", "1 ns", kernel::timers),

    line(Machine, Should, "virtual machine", "no", kernel::virtual_machine),
    line(Machine, Should, "stolen time", "0 ms", kernel::steal),
    line(Machine, Should, "clock source", "tsc", kernel::clocksource),
    line(Machine, Should, "TSC", "constant_tsc, nonstop_tsc", kernel::tsc),

    line(Background, Should, "lock-up watchdog", "off, or not on the core", background::watchdog),
    line(Background, Should, "NMI watchdog", "off", background::nmi_watchdog),
    line(Background, Should, "workqueues", "not on the core", background::workqueues),
    line(Background, Info, "timer migration", "off", background::timer_migration),
    line(Background, Info, "vm.stat_interval", "10 s or more", background::stat_interval),
];
