//! `apply`, `undo` of it and `status`: the settings of the running kernel.

use super::pc::{Pc, STATE};
use std::fs;
use std::os::unix::fs::symlink;

/// A PC with four CPUs: kind in the record, path, content before, content after `apply --cpus 3`. In the order of apply.
const SETTINGS: [(&str, &str, &str, &str); 27] = [
    ("list", "proc/irq/1/smp_affinity_list", "0-3", "0-2"),
    ("list", "proc/irq/24/smp_affinity_list", "3", "0-2"),
    ("list", "proc/irq/25/smp_affinity_list", "0-2", "0-2"),
    ("mask", "proc/irq/default_smp_affinity", "f", "7"),
    (
        "mask",
        "sys/class/net/enp2s0/queues/rx-0/rps_cpus",
        "00000000,0000000c",
        "4",
    ),
    (
        "mask",
        "sys/class/net/enp2s0/queues/rx-1/rps_cpus",
        "00000000",
        "00000000",
    ),
    ("mask", "sys/devices/virtual/workqueue/cpumask", "0000000f", "7"),
    ("mask", "sys/devices/virtual/workqueue/writeback/cpumask", "f", "7"),
    ("text", "proc/sys/kernel/timer_migration", "1", "0"),
    ("list", "proc/sys/kernel/watchdog_cpumask", "0-3", "0-2"),
    ("least", "proc/sys/vm/stat_interval", "1", "10"),
    (
        "text",
        "sys/devices/system/cpu/cpu3/cpufreq/energy_performance_preference",
        "balance_power",
        "performance",
    ),
    (
        "text",
        "sys/devices/system/cpu/cpu3/cpufreq/scaling_min_freq",
        "800000",
        "4200000",
    ),
    (
        "text",
        "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor",
        "schedutil",
        "performance",
    ),
    ("text", "sys/kernel/mm/ksm/run", "1", "0"),
    ("text", "proc/sys/kernel/numa_balancing", "1", "0"),
    ("text", "proc/sys/vm/compaction_proactiveness", "20", "0"),
    // Nobody's: never written.
    ("", "proc/irq/9/smp_affinity_list", "0-3", "0-3"),
    ("", "proc/sys/kernel/watchdog", "1", "1"),
    ("", "proc/sys/kernel/sched_rt_runtime_us", "950000", "950000"),
    (
        "",
        "sys/kernel/debug/sched/fair_server/cpu3/runtime",
        "50000000",
        "50000000",
    ),
    (
        "",
        "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor",
        "powersave",
        "powersave",
    ),
    (
        "",
        "sys/devices/system/cpu/cpu3/cpufreq/scaling_max_freq",
        "4200000",
        "4200000",
    ),
    ("", "sys/devices/system/cpu/cpu3/cpuidle/state1/disable", "0", "0"),
    ("", "sys/devices/system/cpu/cpu3/cpuidle/state2/disable", "0", "0"),
    ("", "sys/devices/system/cpu/cpu3/cpuidle/state1/latency", "2", "2"),
    ("", "sys/devices/system/cpu/cpu3/cpuidle/state2/latency", "133", "133"),
];
/// Those of them that apply changes, and those that it finds as wanted.
const CHANGED: usize = 15;
const KEPT: usize = 2;

fn pc() -> Pc {
    let pc = Pc::new();
    for (_, path, before, _) in SETTINGS {
        pc.write(path, &format!("{before}\n"));
    }
    // No handler: it does not come.
    pc.write("sys/kernel/irq/9/actions", "\n");
    pc.write("sys/kernel/irq/24/actions", "nvme0q3\n");
    pc
}

fn assert_settings(pc: &Pc, after: bool) {
    for (_, path, old, new) in SETTINGS {
        let expected = if after { new } else { old };
        assert_eq!(pc.read(path), format!("{expected}\n"), "{path}");
    }
}

#[test]
fn apply_writes_and_undo_restores_everything() {
    let pc = pc();
    let before = pc.tree();
    let said = pc.good(&["apply", "--cpus", "3"]);
    assert_settings(&pc, true);
    let counts = format!("\n{CHANGED} set, {KEPT} as wanted before, 0 skipped, 0 failed\n");
    assert!(said.contains(&counts), "{said}");
    assert!(said.contains("take it back with: "), "{said}");

    // Only what was changed, in the order of the changes, with the old values.
    let expected: Vec<String> = SETTINGS
        .iter()
        .filter(|(kind, _, old, new)| !kind.is_empty() && old != new)
        .map(|(kind, path, old, _)| format!("{kind}\t/{path}\t{old}\n"))
        .collect();
    assert_eq!(pc.read(STATE), expected.concat());

    let said = pc.good(&["undo"]);
    assert_eq!(pc.tree(), before);
    // In reverse order.
    let undone: Vec<&str> = said.lines().filter_map(|line| line.strip_prefix("set     ")).collect();
    let reversed: Vec<String> = expected
        .iter()
        .rev()
        .map(|line| line.trim_end().split_once('\t').unwrap().1.replace('\t', " = "))
        .collect();
    assert_eq!(undone, reversed);
    assert!(said.contains(&format!("{CHANGED} put back, 0 failed\n")), "{said}");
    let said = pc.good(&["undo"]);
    assert!(said.contains("running kernel: nothing to undo"), "{said}");
    assert!(said.contains("next boot: nothing to undo"), "{said}");
    assert_eq!(pc.tree(), before);
}

#[test]
fn a_second_apply_keeps_the_oldest_values() {
    let pc = pc();
    let before = pc.tree();
    pc.good(&["apply", "--cpus", "3"]);
    let applied = pc.tree();
    let said = pc.good(&["apply", "--cpus", "3"]);
    let counts = format!("0 set, {} as wanted before", CHANGED + KEPT);
    assert!(said.starts_with(&counts), "{said}");
    assert_eq!(pc.tree(), applied);

    // Other CPUs: new values, two more interrupts are touched, the records of the others stay.
    let state = pc.read(STATE);
    pc.good(&["apply", "--cpus", "2-3"]);
    assert_eq!(pc.read("proc/irq/1/smp_affinity_list"), "0-1\n");
    assert_eq!(pc.read("proc/irq/default_smp_affinity"), "3\n");
    assert_eq!(pc.read(STATE), state + "list\t/proc/irq/25/smp_affinity_list\t0-2\n");
    pc.good(&["undo"]);
    assert_eq!(pc.tree(), before);
}

#[test]
fn an_apply_that_was_interrupted_is_undone_or_continued() {
    let pc = pc();
    let before = pc.tree();
    pc.good(&["apply", "--cpus", "3"]);
    let applied = pc.tree();
    let state = pc.read(STATE);
    // Interrupted after the record of the sixth change and before the change itself.
    let lines: Vec<&str> = state.lines().collect();
    for line in &lines[5..] {
        let field: Vec<&str> = line.split('\t').collect();
        pc.write(&field[1][1..], &format!("{}\n", field[2]));
    }
    pc.write(STATE, &format!("{}\n", lines[..6].join("\n")));
    let interrupted = pc.tree();
    pc.good(&["apply", "--cpus", "3"]);
    assert_eq!(pc.tree(), applied);
    assert_ne!(interrupted, applied);
    pc.good(&["undo"]);
    assert_eq!(pc.tree(), before);
}

#[test]
fn dry_run_and_status_change_nothing() {
    let pc = pc();
    let before = pc.tree();
    let said = pc.good(&["apply", "--cpus", "3", "--dry-run"]);
    assert_eq!(said.matches("would set ").count(), CHANGED, "{said}");
    assert!(
        said.contains("would set /proc/irq/24/smp_affinity_list = 0-2 (now 3)\n"),
        "{said}"
    );
    assert!(
        said.ends_with("15 to set, 2 as wanted; nothing was changed\n"),
        "{said}"
    );
    assert_eq!(pc.tree(), before);
    let (code, said) = pc.status(&["--cpus", "3"]);
    assert_eq!(code, Some(3));
    assert!(
        said.starts_with(
            "real-time CPUs     3\nhousekeeping CPUs  0-2\napplied            no\npersisted          no\n"
        ),
        "{said}"
    );
    assert_eq!(said.matches("\n  differs /").count(), CHANGED, "{said}");
    assert_eq!(said.matches("\n  ok      /").count(), KEPT, "{said}");
    assert!(
        said.contains("  differs /proc/sys/vm/stat_interval = 1, wanted 10: apply sets it\n"),
        "{said}"
    );

    pc.good(&["apply", "--cpus", "3"]);
    let applied = pc.tree();
    let said = pc.good(&["undo", "--dry-run"]);
    assert_eq!(said.matches("would set ").count(), CHANGED, "{said}");
    assert_eq!(pc.tree(), applied);
    let (_, said) = pc.status(&["--cpus", "3"]);
    assert!(said.contains("applied            yes, 15 old values"), "{said}");
    assert_eq!(said.matches("\n  differs ").count(), 0, "{said}");
}

#[test]
fn an_interrupt_that_cannot_be_moved_is_skipped_and_said() {
    let pc = pc();
    // A file of the kernel that refuses this value with "invalid argument", as managed interrupts refuse theirs.
    fs::create_dir_all(pc.path("proc/irq/7")).unwrap();
    symlink("/proc/self/oom_score_adj", pc.path("proc/irq/7/smp_affinity_list")).unwrap();
    let said = pc.good(&["apply", "--cpus", "3"]);
    assert!(
        said.contains("skipped /proc/irq/7/smp_affinity_list: Invalid argument\n"),
        "{said}"
    );
    assert!(
        said.contains("15 set, 2 as wanted before, 1 skipped, 0 failed\n"),
        "{said}"
    );
    assert_settings(&pc, true);
    assert!(!pc.read(STATE).contains("/proc/irq/7/"));
    // It does no harm where it comes on a housekeeping CPU; on the real-time CPU it does.
    pc.write("proc/irq/7/effective_affinity_list", "1\n");
    let (_, said) = pc.status(&["--cpus", "3"]);
    assert!(said.contains("\n  fixed   /proc/irq/7/smp_affinity_list"), "{said}");
    pc.write("proc/irq/7/effective_affinity_list", "3\n");
    let (_, said) = pc.status(&["--cpus", "3"]);
    assert!(said.contains("\n  differs /proc/irq/7/smp_affinity_list"), "{said}");
}

#[test]
fn an_interrupt_that_is_gone_does_not_hinder_undo() {
    let pc = pc();
    pc.good(&["apply", "--cpus", "3"]);
    fs::remove_dir_all(pc.path("proc/irq/24")).unwrap();
    let said = pc.good(&["undo"]);
    assert!(said.contains("gone    /proc/irq/24/smp_affinity_list\n"), "{said}");
    assert_eq!(pc.read("proc/irq/1/smp_affinity_list"), "0-3\n");
    assert!(!pc.exists(STATE));
}

#[test]
fn the_lock_up_detector_is_switched_off_where_it_cannot_leave_a_cpu_out() {
    let pc = pc();
    pc.remove("proc/sys/kernel/watchdog_cpumask");
    pc.good(&["apply", "--cpus", "3"]);
    assert_eq!(pc.read("proc/sys/kernel/watchdog"), "0\n");
    pc.good(&["undo"]);
    assert_eq!(pc.read("proc/sys/kernel/watchdog"), "1\n");
}

#[test]
fn throttling_and_idle_states_only_when_asked_for() {
    let pc = pc();
    let before = pc.tree();
    pc.good(&["apply", "--cpus", "3", "--no-throttling", "--no-deep-idle"]);
    assert_eq!(pc.read("proc/sys/kernel/sched_rt_runtime_us"), "-1\n");
    assert_eq!(pc.read("sys/kernel/debug/sched/fair_server/cpu3/runtime"), "0\n");
    // C1 takes 2 us to leave and stays.
    assert_eq!(pc.read("sys/devices/system/cpu/cpu3/cpuidle/state1/disable"), "0\n");
    assert_eq!(pc.read("sys/devices/system/cpu/cpu3/cpuidle/state2/disable"), "1\n");
    pc.good(&["undo"]);
    assert_eq!(pc.tree(), before);
}

#[test]
fn one_of_several_words_is_chosen_and_the_old_one_chosen_again() {
    // The kernel's file shows all words; here it keeps what was written.
    let pc = pc();
    let file = "sys/kernel/mm/transparent_hugepage/enabled";
    pc.write(file, "always [madvise] never\n");
    pc.good(&["apply", "--cpus", "3"]);
    assert_eq!(pc.read(file), "never\n");
    assert!(
        pc.read(STATE)
            .contains("choice\t/sys/kernel/mm/transparent_hugepage/enabled\tmadvise\n")
    );
    pc.good(&["undo"]);
    assert_eq!(pc.read(file), "madvise\n");
}

#[test]
fn files_that_are_not_understood_are_skipped() {
    let pc = pc();
    for (path, content) in [
        ("sys/kernel/mm/transparent_hugepage/enabled", "no brackets\n"),
        ("sys/kernel/mm/ksm/run", ""),
        ("proc/sys/kernel/numa_balancing", "1\n2\n"),
        ("proc/sys/vm/compaction_proactiveness", "\u{1}\t\u{2}\n"),
    ] {
        pc.write(path, content);
    }
    let said = pc.good(&["apply", "--cpus", "3"]);
    assert!(
        said.contains("12 set, 2 as wanted before, 4 skipped, 0 failed"),
        "{said}"
    );
    assert_eq!(pc.read("proc/sys/kernel/numa_balancing"), "1\n2\n");
    assert_eq!(pc.read("sys/kernel/mm/ksm/run"), "");
    let (_, said) = pc.status(&["--cpus", "3"]);
    assert_eq!(said.matches("\n  unknown /").count(), 4, "{said}");
}

#[test]
fn a_record_that_is_not_ours_is_refused() {
    for line in [
        "text\t/etc/passwd\troot",
        "text\t/proc/../etc/passwd\troot",
        "list\t/proc/irq/1/smp_affinity_list",
        "service\tsshd\trunning",
        "nic\tenp2s0 -s speed\t10",
        "garbage \u{1}",
    ] {
        let pc = pc();
        pc.write(STATE, &format!("text\t/proc/sys/kernel/timer_migration\t1\n{line}\n"));
        for command in ["undo", "apply"] {
            let (code, said) = pc.bad(&[command]);
            assert_eq!(code, Some(1), "{line}");
            assert!(said.contains(", line 2 is not understood"), "{line}: {said}");
        }
    }
}

#[test]
fn without_a_list_the_isolated_cpus_or_the_last_one() {
    let pc = pc();
    assert!(pc.status(&[]).1.starts_with("real-time CPUs     3\n"));
    pc.write("sys/devices/system/cpu/isolated", "1-2\n");
    assert!(
        pc.status(&[])
            .1
            .starts_with("real-time CPUs     1-2\nhousekeeping CPUs  0,3\n")
    );
    // The sibling of a core shares all of it.
    pc.write("sys/devices/system/cpu/cpu1/topology/thread_siblings_list", "1,3\n");
    assert!(pc.status(&[]).1.contains("note: CPU 1 shares its core with CPU 3"));
}

#[test]
fn cpu_0_can_be_taken_by_force() {
    let pc = pc();
    pc.good(&["apply", "--cpus", "0", "--force"]);
    assert_eq!(pc.read("proc/irq/1/smp_affinity_list"), "1-3\n");
    assert_eq!(pc.read("proc/irq/default_smp_affinity"), "e\n");
}

#[test]
fn masks_of_more_than_64_cpus() {
    let pc = pc();
    pc.write("sys/devices/system/cpu/online", "0-127\n");
    let rps = "sys/class/net/enp2s0/queues/rx-0/rps_cpus";
    pc.write(rps, "80000000,00000008,ffffffff,00000003\n");
    let before = pc.tree();
    pc.good(&["apply", "--cpus", "33,67,120-127"]);
    assert_eq!(
        pc.read("proc/irq/default_smp_affinity"),
        "ffffff,fffffff7,fffffffd,ffffffff\n"
    );
    assert_eq!(pc.read("proc/irq/1/smp_affinity_list"), "0-32,34-66,68-119\n");
    assert_eq!(pc.read(rps), "fffffffd,00000003\n");
    pc.good(&["undo"]);
    assert_eq!(pc.tree(), before);
}

/// A kernel thread: parent 2, flags, CPUs.
fn kernel_thread(pc: &Pc, pid: u32, comm: &str, parent: u32, flags: u32, cpus: &str) {
    pc.write(
        &format!("proc/{pid}/stat"),
        &format!("{pid} ({comm}) S {parent} 0 0 0 -1 {flags} 0 0\n"),
    );
    pc.write(&format!("proc/{pid}/comm"), &format!("{comm}\n"));
    pc.write(
        &format!("proc/{pid}/status"),
        &format!("Name:\t{comm}\nCpus_allowed:\tf\nCpus_allowed_list:\t{cpus}\n"),
    );
}

#[test]
fn kernel_threads_that_may_be_moved_are_moved() {
    const KERNEL_THREAD: u32 = 0x0020_0000;
    const NO_SETAFFINITY: u32 = 0x0400_0000;
    let pc = pc();
    pc.tool(
        "taskset",
        r#"[ "$1" = -pc ] && sed -i "s/^Cpus_allowed_list:.*/Cpus_allowed_list:\t$2/" "proc/$3/status""#,
    );
    kernel_thread(&pc, 14, "rcu (odd) name", 2, KERNEL_THREAD, "0-3");
    kernel_thread(&pc, 15, "kswapd0", 2, KERNEL_THREAD, "0-2");
    kernel_thread(&pc, 16, "ksoftirqd/3", 2, KERNEL_THREAD | NO_SETAFFINITY, "3");
    kernel_thread(&pc, 17, "irq/24-nvme", 2, KERNEL_THREAD, "3");
    kernel_thread(&pc, 18, "bash", 1, 0, "0-3");
    pc.write("proc/19/comm", "vanished\n");
    let before = pc.tree();
    let said = pc.good(&["apply", "--cpus", "3"]);
    assert_eq!(said.matches("kernel thread").count(), 1, "{said}");
    assert!(
        said.contains("set     kernel thread rcu (odd) name (pid 14) = 0-2 (was 0-3)\n"),
        "{said}"
    );
    assert!(pc.read("proc/14/status").ends_with("Cpus_allowed_list:\t0-2\n"));
    pc.good(&["undo"]);
    assert_eq!(pc.tree(), before);

    // The number of a thread that has ended may be another's now.
    pc.good(&["apply", "--cpus", "3"]);
    kernel_thread(&pc, 14, "sshd", 1, 0, "0-3");
    let said = pc.good(&["undo"]);
    assert!(
        said.contains("gone    kernel thread rcu (odd) name (pid 14)\n"),
        "{said}"
    );
}

#[test]
fn irqbalance_is_stopped_and_started_again_unless_it_leaves_the_cpus_alone() {
    let pc = pc();
    pc.tool(
        "systemctl",
        r#"case "$*" in
        "stop irqbalance.service") mv proc/412 stopped ;;
        "start irqbalance.service") mv stopped proc/412 ;;
        *) exit 1 ;;
        esac"#,
    );
    pc.write("proc/412/comm", "irqbalance\n");
    let before = pc.tree();
    let said = pc.good(&["apply", "--cpus", "3"]);
    assert!(
        said.starts_with("set     service irqbalance = stopped (was running)\n"),
        "{said}"
    );
    assert!(!pc.exists("proc/412"));
    pc.good(&["undo"]);
    assert_eq!(pc.tree(), before);

    // Its own ban of these CPUs, or their isolation since boot, is enough.
    for (environ, isolated, wanted) in [
        (
            "HOME=/\0IRQBALANCE_BANNED_CPULIST=2-3\0",
            "",
            "ok      service irqbalance = running",
        ),
        ("IRQBALANCE_BANNED_CPULIST=2\0", "3", "differs service irqbalance"),
        ("HOME=/\0", "3", "ok      service irqbalance = running"),
        ("HOME=/\0", "2", "differs service irqbalance"),
    ] {
        pc.write("proc/412/environ", environ);
        pc.write("sys/devices/system/cpu/isolated", &format!("{isolated}\n"));
        let (_, said) = pc.status(&["--cpus", "3"]);
        assert!(said.contains(wanted), "{environ:?} {isolated}: {said}");
    }
    // But not where the interface's interrupts are to stay with the real-time thread.
    pc.write("proc/412/environ", "IRQBALANCE_BANNED_CPULIST=3\0");
    let (_, said) = pc.status(&["--cpus", "3", "--interface", "enp2s0"]);
    assert!(said.contains("differs service irqbalance"), "{said}");
    let (_, said) = pc.status(&["--cpus", "3", "--interface", "enp2s0", "--nic-irq", "housekeeping"]);
    assert!(said.contains("ok      service irqbalance"), "{said}");
}
