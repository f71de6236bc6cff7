//! Completion scripts and pages of the manual, as a user makes them.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Output};

fn isocnc(args: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_isocnc")).args(args).output();
    output.expect("isocnc")
}

/// Words of all commands, from what `help` lists of each.
fn commands(words: &[String], found: &mut BTreeSet<String>) {
    let args: Vec<&str> = words.iter().map(String::as_str).chain(["--help"]).collect();
    let help = String::from_utf8(isocnc(&args).stdout).expect("text");
    found.insert([&["isocnc".to_owned()], words].concat().join("-"));
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    for line in listed
        .take_while(|line| !line.is_empty())
        .filter(|line| !line.starts_with("   "))
    {
        let name = line.split_whitespace().next().expect("a name");
        if name != "help" {
            commands(&[words, &[name.to_owned()]].concat(), found);
        }
    }
}

#[test]
fn every_command_has_one_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let pages = folder.path().join("new/man1");
    let output = isocnc(&["man", pages.to_str().expect("text")]);
    assert!(output.status.success(), "{output:?}");
    let mut wanted = BTreeSet::new();
    commands(&[], &mut wanted);
    assert!(wanted.len() > 40 && wanted.contains("isocnc-bus-sdo-get"), "{wanted:?}");
    let mut made = BTreeSet::new();
    for entry in std::fs::read_dir(&pages).expect("the folder") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_stem()
            .and_then(|stem| stem.to_str())
            .expect("a name")
            .to_owned();
        let text = std::fs::read_to_string(&path).expect("a page");
        assert!(text.contains(&format!(".TH {name} 1 ")), "{name}: {text}");
        assert!(text.contains(".SH SYNOPSIS"), "{name}: {text}");
        made.insert(name);
    }
    assert_eq!(made, wanted);
}

#[test]
fn a_folder_that_cannot_be_made_is_told() {
    let output = isocnc(&["man", "/dev/null/man1"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(
        String::from_utf8_lossy(&output.stderr).contains("/dev/null/man1"),
        "{output:?}"
    );
}

/// Whether a shell takes a script; `None` where there is no such shell.
fn parses(shell: &str, script: &Path) -> Option<Output> {
    let flag = if shell == "fish" { "--no-execute" } else { "-n" };
    Command::new(shell).arg(flag).arg(script).output().ok()
}

#[test]
fn every_shell_takes_its_completion_script() {
    let folder = tempfile::tempdir().expect("a folder");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = isocnc(&["completions", shell]);
        assert!(output.status.success(), "{shell}: {output:?}");
        let text = String::from_utf8(output.stdout).expect("text");
        for word in ["single-block", "sdo", "--capture"] {
            // fish names an option without its dashes.
            assert!(text.contains(word.trim_start_matches('-')), "{shell}: no {word}");
        }
        let script = folder.path().join(shell);
        std::fs::write(&script, text).expect("written");
        let checked = matches!(shell, "bash" | "zsh" | "fish")
            .then(|| parses(shell, &script))
            .flatten();
        match checked {
            Some(checked) => assert!(
                checked.status.success() && checked.stderr.is_empty(),
                "{shell}: {checked:?}"
            ),
            None => println!("{shell} is not here: its script is not read"),
        }
    }
}
