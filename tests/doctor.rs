//! `isocnc doctor` on the PC that the tests run on, whatever that is.

use serde_json::Value as Json;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
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
    let wanted = isocnc::host::doctor::LINES
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

#[test]
fn rights_are_granted_to_the_program_that_runs_and_the_script_is_where_it_is_said_to_be() {
    let folder = tempfile::tempdir().expect("a folder");
    // Installed: no source tree above it.
    let installed = folder.path().join("isocnc");
    std::fs::copy(env!("CARGO_BIN_EXE_isocnc"), &installed).expect("our folder");
    std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o755)).expect("our folder");
    let fixes = |program: &Path, user: Option<u32>| -> Vec<String> {
        let mut command = Command::new(program);
        command.args(["doctor", "--no-tests", "--json"]).current_dir("/");
        if let Some(id) = user {
            command.uid(id).gid(id);
        }
        let output = command.output().expect("the binary runs");
        let json: Json = serde_json::from_slice(&output.stdout).expect("JSON");
        let lines = json["lines"].as_array().expect("lines").iter();
        lines
            .filter_map(|line| Some(line["fix"].as_str()?.to_owned()))
            .collect()
    };
    let root = nix::unistd::geteuid().is_root();
    let fixes_installed = fixes(&installed, root.then_some(65_534));
    for fix in &fixes_installed {
        assert!(!fix.contains("command -v") && !fix.contains("sudo scripts/"), "{fix}");
        if fix.contains("setcap") {
            assert!(fix.ends_with(installed.to_str().expect("text")), "{fix}");
        }
    }
    let (tree, built) = (
        Path::new(env!("CARGO_MANIFEST_DIR")),
        Path::new(env!("CARGO_BIN_EXE_isocnc")),
    );
    // Built elsewhere, it has no source tree above it either.
    let here = match built.starts_with(tree) {
        true => tree.join("scripts/isolcpus.sh"),
        false => Path::new("./isolcpus.sh").to_owned(),
    };
    for fix in fixes(built, None) {
        let named = fix.split(' ').find(|word| word.ends_with("isolcpus.sh"));
        assert!(named.is_none_or(|path| Path::new(path) == here), "{fix}");
    }
}
