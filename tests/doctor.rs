//! `isocnc doctor` on the PC that the tests run on, whatever that is.

use serde_json::Value as Json;
use std::process::{Command, Output};

fn doctor(args: &[&str]) -> Output {
    let doctor = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("doctor")
        .args(args)
        .output();
    doctor.expect("the program starts")
}

fn code(args: &[&str]) -> i32 {
    doctor(args).status.code().expect("it ends by itself")
}

#[test]
fn it_tells_every_line_and_its_exit_code_tells_of_musts() {
    let output = doctor(&["--no-tests", "--json", "--cpu", "0", "--interface", "lo"]);
    let json: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    let lines = json["lines"].as_array().expect("lines");
    let names: Vec<&str> = lines
        .iter()
        .map(|line| line["name"].as_str().expect("a name"))
        .collect();
    let measured = ["wake-up latency", "gaps"];
    let wanted = isocnc::doctor::LINES
        .iter()
        .map(|line| line.name)
        .filter(|name| !measured.contains(name));
    assert_eq!(names, wanted.collect::<Vec<_>>());
    let is_missing_must = |line: &&Json| line["level"] == "must" && line["state"] == "missing";
    let musts = lines.iter().filter(is_missing_must).count();
    assert_eq!(json["missing"]["must"], musts);
    assert_eq!(output.status.code(), Some(i32::from(musts > 0)));
}

#[test]
fn a_core_that_there_is_not_is_a_missing_must() {
    let output = doctor(&["--cpu", "8191", "--seconds", "0.1"]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(
        text.contains("MISS core                core 8191 is not online"),
        "{text}"
    );
    assert!(text.contains("?    wake-up latency"), "{text}");
}

#[test]
fn wrong_usage_is_told_apart() {
    for wrong in [
        &["--cpu", "x"][..],
        &["--seconds", "0"],
        &["--seconds", "1", "--no-tests"],
        &["--interface", "a/b"],
        &["/nowhere/machine.toml"],
        &["Cargo.toml"],
    ] {
        assert_eq!(code(wrong), 2, "{wrong:?}");
    }
}

#[test]
fn core_and_interface_are_those_of_the_machine_file() {
    let output = doctor(&["configs/mill3-powerlink.toml", "--no-tests", "--json"]);
    let json: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    let lines = json["lines"].as_array().expect("lines");
    let interface = lines
        .iter()
        .find(|line| line["name"] == "interface")
        .expect("the line of the interface");
    let config = isocnc::config::read(std::path::Path::new("configs/mill3-powerlink.toml")).expect("a good file");
    let found = interface["found"].as_str().expect("text");
    assert!(found.starts_with(&config.bus.interface), "{found}");
}
