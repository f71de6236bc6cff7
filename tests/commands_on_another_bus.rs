//! `check` and `demo` take a machine on the toy bus of tests as any other; `jitter` does so in `tests/jitter.rs`.

use crate::toy_machine;

use serde_json::Value;
use std::process::Output;
use tempfile::TempDir;

fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("toy.toml"), toy_machine::text()).expect("our folder");
    folder
}

/// What a command prints that is run in this folder and succeeds.
fn said(folder: &TempDir, arguments: &[&str]) -> String {
    let mut command = testing::command(env!("CARGO_BIN_EXE_isocnc"));
    let Output { status, stdout, stderr } = command
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the binary runs");
    assert!(status.success(), "{status}: {}", String::from_utf8_lossy(&stderr));
    String::from_utf8(stdout).expect("text")
}

#[test]
fn check_describes_a_machine_on_the_toy_bus() {
    let folder = folder();
    let text = said(&folder, &["check", "toy.toml"]);
    for expected in [
        "bus       toy on plk0\n",
        "frame to all devices and back",
        "left for computing",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    let json: Value = serde_json::from_str(&said(&folder, &["check", "toy.toml", "--json"])).expect("JSON");
    assert_eq!(
        (&json["bus"], &json["errors"]),
        (&"toy".into(), &Value::Array(Vec::new()))
    );
    assert_eq!(json["nodes"].as_array().map(Vec::len), Some(4));
}

#[test]
fn demo_runs_a_program_on_the_toy_bus() {
    let folder = folder();
    std::fs::write(folder.path().join("part.ngc"), "G21 G90 G94 G54\nG1 X2 F3000\nM2\n").expect("our folder");
    let json: Value = serde_json::from_str(&said(
        &folder,
        &[
            "demo",
            "--memory",
            "--machine",
            "toy.toml",
            "--program",
            "part.ngc",
            "--json",
        ],
    ))
    .expect("JSON");
    assert_eq!(json["result"], "completed", "{json:#}");
}

#[test]
fn a_word_that_is_no_bus_is_told_the_buses_of_products_only() {
    let folder = folder();
    let text = toy_machine::text().replacen("\"toy\"", "\"tog\"", 1);
    std::fs::write(folder.path().join("tog.toml"), text).expect("our folder");
    let output = testing::command(env!("CARGO_BIN_EXE_isocnc"))
        .args(["check", "tog.toml"])
        .current_dir(&folder)
        .output()
        .expect("the binary runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("\"ethercat-memory\"") && !said.contains("toy"), "{said}");
}
