//! `scripts/isolcpus.sh` on a tree that looks like a PC's `/proc` and `/sys`: what it writes, to the octet.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const STATE: &str = "run/isocnc/isolcpus.state";

/// A PC with four CPUs: path, content before, content after `apply --cpus 3`.
const SETTINGS: [(&str, &str, &str); 14] = [
    ("proc/irq/1/smp_affinity_list", "0-3", "0-2"),
    ("proc/irq/24/smp_affinity_list", "3", "0-2"),
    ("proc/irq/25/smp_affinity_list", "0-2", "0-2"),
    ("proc/irq/default_smp_affinity", "f", "7"),
    ("sys/devices/virtual/workqueue/cpumask", "0000000f", "7"),
    ("sys/devices/virtual/workqueue/writeback/cpumask", "f", "7"),
    (
        "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor",
        "powersave",
        "powersave",
    ),
    (
        "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor",
        "schedutil",
        "performance",
    ),
    ("sys/class/net/enp2s0/queues/rx-0/rps_cpus", "00000000,0000000c", "0"),
    ("sys/class/net/enp2s0/queues/rx-1/rps_cpus", "00000000", "00000000"),
    ("proc/sys/kernel/timer_migration", "1", "0"),
    ("proc/sys/kernel/watchdog", "1", "1"),
    ("proc/sys/kernel/watchdog_cpumask", "0-3", "0-2"),
    ("proc/sys/vm/stat_interval", "1", "10"),
];

struct Pc {
    root: tempfile::TempDir,
}

impl Pc {
    fn new() -> Pc {
        let pc = Pc {
            root: tempfile::tempdir().unwrap(),
        };
        pc.write("proc/cmdline", "BOOT_IMAGE=/vmlinuz quiet skew_tick=1\n");
        pc.write("sys/devices/system/cpu/online", "0-3\n");
        pc.write("sys/devices/system/cpu/isolated", "\n");
        for (path, before, _) in SETTINGS {
            pc.write(path, &format!("{before}\n"));
        }
        pc
    }

    fn path(&self, path: &str) -> PathBuf {
        self.root.path().join(path)
    }

    fn write(&self, path: &str, content: &str) {
        let path = self.path(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    fn read(&self, path: &str) -> String {
        fs::read_to_string(self.path(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
    }

    /// Everything in the tree.
    fn files(&self) -> BTreeMap<PathBuf, String> {
        fn visit(folder: &Path, files: &mut BTreeMap<PathBuf, String>) {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    visit(&path, files);
                } else {
                    files.insert(path.clone(), fs::read_to_string(&path).unwrap());
                }
            }
        }
        let mut files = BTreeMap::new();
        visit(self.root.path(), &mut files);
        files
    }

    fn run(&self, arguments: &[&str]) -> Output {
        Command::new("bash")
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/isolcpus.sh"))
            .args(arguments)
            .arg("--root")
            .arg(self.root.path())
            .output()
            .expect("bash")
    }

    /// Runs a command that must succeed; its standard output.
    fn good(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        assert_eq!(text(&output.stderr), "", "{arguments:?}");
        text(&output.stdout)
    }

    /// Runs a command that must be refused; exit code and standard error.
    fn bad(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let before = self.files();
        let output = self.run(arguments);
        assert_eq!(self.files(), before, "{arguments:?} changed something");
        (output.status.code(), text(&output.stderr))
    }

    fn assert_settings(&self, after: bool) {
        for (path, old, new) in SETTINGS {
            let expected = if after { new } else { old };
            assert_eq!(self.read(path), format!("{expected}\n"), "{path}");
        }
    }
}

fn text(octets: &[u8]) -> String {
    String::from_utf8(octets.to_vec()).unwrap()
}

#[test]
fn apply_writes_and_undo_restores_every_file() {
    let pc = Pc::new();
    let before = pc.files();
    let said = pc.good(&["apply", "--cpus", "3"]);
    pc.assert_settings(true);
    assert!(
        said.contains("\n10 set, 2 as wanted before, 0 skipped, 0 failed\n"),
        "{said}"
    );

    // Only what was changed, in the order of the changes, with the old values.
    let expected: Vec<String> = SETTINGS
        .iter()
        .filter(|(path, old, new)| old != new && !path.ends_with("kernel/watchdog"))
        .map(|(path, old, _)| format!("/{path}\t{old}\n"))
        .collect();
    assert_eq!(pc.read(STATE), expected.concat());

    let said = pc.good(&["undo"]);
    assert_eq!(pc.files(), before);
    // In reverse order.
    let undone: Vec<&str> = said.lines().filter_map(|line| line.strip_prefix("set     ")).collect();
    let reversed: Vec<String> = expected
        .iter()
        .rev()
        .map(|line| line.trim_end().replace('\t', " = "))
        .collect();
    assert_eq!(undone, reversed);
    assert!(said.ends_with("10 put back, 0 failed\n"), "{said}");
    assert!(pc.good(&["undo"]).starts_with("nothing to undo"));
}

#[test]
fn a_second_apply_keeps_the_oldest_values() {
    let pc = Pc::new();
    pc.good(&["apply", "--cpus", "3"]);
    let state = pc.read(STATE);
    let said = pc.good(&["apply", "--cpus", "3"]);
    assert!(said.contains("0 set, 12 as wanted before"), "{said}");
    assert_eq!(pc.read(STATE), state);

    // Other CPUs: new values, one more interrupt is touched, the records of the others stay.
    pc.good(&["apply", "--cpus", "2-3"]);
    assert_eq!(pc.read("proc/irq/1/smp_affinity_list"), "0-1\n");
    assert_eq!(pc.read("proc/irq/default_smp_affinity"), "3\n");
    assert_eq!(pc.read(STATE), state + "/proc/irq/25/smp_affinity_list\t0-2\n");
    pc.good(&["undo"]);
    pc.assert_settings(false);
}

#[test]
fn dry_run_and_status_change_nothing() {
    let pc = Pc::new();
    let before = pc.files();
    let said = pc.good(&["apply", "--cpus", "3", "--dry-run"]);
    assert_eq!(said.matches("would write ").count(), 10, "{said}");
    assert!(
        said.contains("would write /proc/irq/24/smp_affinity_list = 0-2 (now 3)\n"),
        "{said}"
    );
    let said = pc.good(&["status", "--cpus", "3"]);
    assert!(
        said.starts_with("real-time CPUs     3\nhousekeeping CPUs  0-2\napplied            no\n"),
        "{said}"
    );
    assert_eq!(said.matches("\ndiffers ").count(), 10, "{said}");
    assert_eq!(said.matches("\nok ").count(), 2, "{said}");
    assert_eq!(pc.files(), before);
    assert!(!pc.path("run").exists());

    pc.good(&["apply", "--cpus", "3"]);
    let applied = pc.files();
    let said = pc.good(&["undo", "--dry-run"]);
    assert_eq!(said.matches("would write ").count(), 10, "{said}");
    let said = pc.good(&["status", "--cpus", "3"]);
    assert!(said.contains("applied            yes, 10 old values"), "{said}");
    assert_eq!(said.matches("\ndiffers ").count(), 0, "{said}");
    assert_eq!(pc.files(), applied);
}

#[test]
fn an_interrupt_that_cannot_be_moved_is_skipped_and_said() {
    let pc = Pc::new();
    // A file of the kernel that refuses this value with "invalid argument", as managed interrupts refuse theirs.
    fs::create_dir_all(pc.path("proc/irq/7")).unwrap();
    symlink("/proc/self/oom_score_adj", pc.path("proc/irq/7/smp_affinity_list")).unwrap();
    let said = pc.good(&["apply", "--cpus", "3"]);
    assert!(
        said.contains("skipped /proc/irq/7/smp_affinity_list: Invalid argument\n"),
        "{said}"
    );
    assert!(
        said.contains("10 set, 2 as wanted before, 1 skipped, 0 failed\n"),
        "{said}"
    );
    pc.assert_settings(true);
    assert!(!pc.read(STATE).contains("/proc/irq/7/"));
}

#[test]
fn an_interrupt_that_is_gone_does_not_hinder_undo() {
    let pc = Pc::new();
    pc.good(&["apply", "--cpus", "3"]);
    fs::remove_dir_all(pc.path("proc/irq/24")).unwrap();
    let said = pc.good(&["undo"]);
    assert!(said.contains("gone    /proc/irq/24/smp_affinity_list\n"), "{said}");
    assert_eq!(pc.read("proc/irq/1/smp_affinity_list"), "0-3\n");
    assert!(!pc.path(STATE).exists());
}

#[test]
fn the_lock_up_detector_is_switched_off_where_it_cannot_leave_a_cpu_out() {
    let pc = Pc::new();
    fs::remove_file(pc.path("proc/sys/kernel/watchdog_cpumask")).unwrap();
    pc.good(&["apply", "--cpus", "3"]);
    assert_eq!(pc.read("proc/sys/kernel/watchdog"), "0\n");
    pc.good(&["undo"]);
    assert_eq!(pc.read("proc/sys/kernel/watchdog"), "1\n");
}

#[test]
fn cpus_that_must_not_be_taken_are_refused() {
    let pc = Pc::new();
    for (cpus, force, code, reason) in [
        ("0-3", "--force", 1, "are all there are"),
        ("0", "", 1, "CPU 0 keeps time"),
        ("0,3", "", 1, "CPU 0 keeps time"),
        ("4", "", 1, "CPU 4 is not online"),
        ("3-2", "", 2, "--cpus 3-2"),
        ("three", "", 2, "--cpus three"),
        ("3,", "", 2, "--cpus 3,"),
    ] {
        let mut arguments = vec!["apply", "--cpus", cpus];
        arguments.extend((!force.is_empty()).then_some(force));
        let (exit, said) = pc.bad(&arguments);
        assert_eq!(exit, Some(code), "{cpus}: {said}");
        assert!(said.contains(reason), "{cpus}: {said}");
    }
    pc.good(&["apply", "--cpus", "0", "--force"]);
    assert_eq!(pc.read("proc/irq/1/smp_affinity_list"), "1-3\n");
    assert_eq!(pc.read("proc/irq/default_smp_affinity"), "e\n");
}

#[test]
fn wrong_usage_is_exit_code_2() {
    let pc = Pc::new();
    for arguments in [&[][..], &["start"], &["apply", "undo"], &["apply", "--cpu", "3"]] {
        let (exit, said) = pc.bad(arguments);
        assert_eq!(exit, Some(2), "{arguments:?}: {said}");
        assert!(said.contains("usage: isolcpus.sh status|apply|undo"), "{said}");
    }
}

#[test]
fn without_a_list_the_isolated_cpus_or_the_last_one() {
    let pc = Pc::new();
    assert!(pc.good(&["status"]).starts_with("real-time CPUs     3\n"));
    pc.write("sys/devices/system/cpu/isolated", "1-2\n");
    assert!(
        pc.good(&["status"])
            .starts_with("real-time CPUs     1-2\nhousekeeping CPUs  0,3\n")
    );
}

#[test]
fn masks_of_more_than_32_cpus_have_commas() {
    let pc = Pc::new();
    pc.write("sys/devices/system/cpu/online", "0-67\n");
    pc.good(&["apply", "--cpus", "33,67"]);
    assert_eq!(pc.read("proc/irq/default_smp_affinity"), "7,fffffffd,ffffffff\n");
    assert_eq!(pc.read("proc/irq/1/smp_affinity_list"), "0-32,34-66\n");
}

#[test]
fn the_kernel_command_line_is_recommended_and_what_is_missing_named() {
    let pc = Pc::new();
    let said = pc.good(&["status", "--cpus", "3"]);
    let line = "isolcpus=managed_irq,domain,3 nohz_full=3 rcu_nocbs=3 irqaffinity=0-2 skew_tick=1 nosoftlockup \
                nmi_watchdog=0 transparent_hugepage=never";
    assert!(
        said.contains(&format!("kernel command line, recommended:\n  {line}\n")),
        "{said}"
    );
    let missing = line.replace(" skew_tick=1", "");
    assert!(said.contains(&format!("missing now:\n  {missing}\n")), "{said}");
    assert!(
        said.contains("GRUB_CMDLINE_LINUX_DEFAULT in /etc/default/grub"),
        "{said}"
    );
    pc.write("proc/cmdline", &format!("quiet {line}\n"));
    assert!(
        pc.good(&["status", "--cpus", "3"])
            .ends_with("kernel command line: complete\n")
    );
}

#[test]
fn a_running_irqbalance_is_named() {
    let pc = Pc::new();
    assert!(!pc.good(&["status"]).contains("irqbalance"));
    pc.write("proc/412/comm", "irqbalance\n");
    assert!(pc.good(&["status"]).contains("warning: irqbalance runs"));
}
