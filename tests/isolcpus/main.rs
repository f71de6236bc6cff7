//! `scripts/isolcpus.sh` on a tree that looks like a PC's, with tools that act on that tree: what it writes, to the octet.

mod boot;
mod interface;
mod pc;
mod runtime;

use pc::{Pc, script};
use std::process::Command;

#[test]
fn wrong_usage_is_exit_code_2() {
    let pc = Pc::new();
    for (arguments, reason) in [
        (&[][..], "which command"),
        (&["start"], "unknown argument start"),
        (&["apply", "undo"], "one command"),
        (&["apply", "--cpu", "3"], "unknown argument --cpu"),
        (&["persist", "--loader", "lilo"], "--loader lilo"),
        (&["persist", "--parameter", "a b"], "--parameter a b"),
        (&["persist", "--parameter", "x=$(reboot)"], "--parameter x="),
        (&["apply", "--interface", "../lo"], "--interface ../lo"),
        (&["apply", "--nic-irq", "all"], "--nic-irq all"),
    ] {
        let (exit, said) = pc.bad(arguments);
        assert_eq!(exit, Some(2), "{arguments:?}: {said}");
        assert!(said.contains(reason), "{arguments:?}: {said}");
        assert!(
            said.contains("usage: isolcpus.sh status|apply|persist|undo"),
            "{arguments:?}: {said}"
        );
    }
}

#[test]
fn cpus_that_must_not_be_taken_are_refused() {
    let pc = Pc::new();
    for (cpus, force, code, reason) in [
        ("0-3", "--force", 1, "are all there are"),
        ("0", "", 1, "CPU 0 keeps time"),
        ("0,3", "", 1, "CPU 0 keeps time"),
        ("4", "", 1, "CPU 4 is not online (online: 0-3)"),
        ("3-2", "", 2, "--cpus 3-2"),
        ("three", "", 2, "--cpus three"),
        ("3,", "", 2, "--cpus 3,"),
        ("99999", "", 2, "--cpus 99999"),
    ] {
        for command in ["apply", "persist", "status"] {
            let mut arguments = vec![command, "--cpus", cpus];
            arguments.extend((!force.is_empty()).then_some(force));
            let (exit, said) = pc.bad(&arguments);
            assert_eq!(exit, Some(code), "{arguments:?}: {said}");
            assert!(said.contains(reason), "{arguments:?}: {said}");
        }
    }
}

#[test]
fn a_kernel_file_that_is_garbage_is_named() {
    let pc = Pc::new();
    pc.write("sys/devices/system/cpu/online", "none\n");
    let (exit, said) = pc.bad(&["apply"]);
    assert_eq!(exit, Some(1));
    assert!(said.contains("cpu/online is not understood: none"), "{said}");
}

#[test]
fn the_script_is_clean_in_the_eyes_of_shellcheck() {
    let Ok(output) = Command::new("shellcheck")
        .args(["-x", "-a", "-P", "SCRIPTDIR", script()])
        .output()
    else {
        println!("skipped: shellcheck is not installed");
        return;
    };
    assert!(output.status.success(), "{}", pc::text(&output.stdout));
}
