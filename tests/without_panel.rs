//! A program that was built without the panel says so: `cargo test --no-default-features --test process without_panel`.

#![cfg(not(feature = "panel"))]

use std::process::Command;

const REFUSED: &str = "this isocnc was built without the panel: cargo build --features panel";

/// Runs this machine file; its exit code and what it says.
fn run(machine: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("machine.toml");
    std::fs::write(&file, machine).expect("our folder");
    let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("run")
        .arg(file)
        .args(arguments)
        .output()
        .expect("it runs");
    (
        output.status.code(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

#[test]
fn a_panel_that_is_asked_for_is_refused_in_words() {
    let machine = include_str!("../configs/mill3-demo.toml").replacen("kind = \"powerlink\"", "kind = \"memory\"", 1);
    for (machine, arguments) in [
        (machine.clone(), &["--panel"][..]),
        (machine.clone(), &["--panel", "127.0.0.1:0"]),
        (format!("{machine}\n[panel]\n"), &[]),
    ] {
        let (code, said) = run(&machine, arguments);
        assert!(
            code == Some(1) && said.contains(REFUSED),
            "{arguments:?}: {code:?} {said}"
        );
    }
}
