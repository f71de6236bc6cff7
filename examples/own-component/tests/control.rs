//! The control that this crate builds knows its component.

use std::path::Path;
use std::process::{Command, Output};

const MACHINE: &str = include_str!("../machine.toml");

/// `check` of the machine with one line changed.
fn check(line: &str, changed: &str) -> Output {
    assert!(MACHINE.contains(line));
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("machine-{}.toml", changed.len()));
    std::fs::write(&file, MACHINE.replacen(line, changed, 1)).unwrap();
    Command::new(env!("CARGO_BIN_EXE_own-component")).arg("check").arg(&file).output().unwrap()
}

#[test]
fn a_machine_file_may_ask_for_it() {
    let good = check("", "");
    let said = String::from_utf8_lossy(&good.stdout).into_owned();
    assert!(good.status.success(), "{}", String::from_utf8_lossy(&good.stderr));
    assert!(said.contains("coolant-tank: tank, before motion"), "{said}");
    for (line, wrong, expected) in [
        ("type = \"tank\"", "type = \"tnak\"", "did you mean \"tank\"?"),
        ("low = 15.0", "lwo = 15.0", "did you mean \"low\"?"),
        ("low = 15.0", "low = true", "must be a number"),
        ("source = \"coolant-tank.valve\"", "source = \"coolant-tank.valv\"", "did you mean"),
    ] {
        let refused = check(line, wrong);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(!refused.status.success() && said.contains(expected), "{wrong}: {said}");
    }
}
