//! README.md and the pages that were once in it name only what exists: commands, options, files, sections of the machine file.

use isocnc::config::BusKind;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

const README: &str = concat!(
    include_str!("../README.md"),
    include_str!("../docs/bus.md"),
    include_str!("../docs/g-code.md"),
    include_str!("../docs/faults.md")
);

/// What stands between back-ticks on one line.
fn code_spans() -> Vec<&'static str> {
    let mut spans = Vec::new();
    for line in outside_blocks() {
        spans.extend(line.split('`').skip(1).step_by(2));
    }
    spans
}

/// Lines that are not in a fenced block.
fn outside_blocks() -> Vec<&'static str> {
    fenced(false)
}

fn fenced(wanted: bool) -> Vec<&'static str> {
    let mut inside = false;
    let mut lines = Vec::new();
    for line in README.lines() {
        if line.starts_with("```") {
            inside = !inside;
        } else if inside == wanted {
            lines.push(line);
        }
    }
    assert!(!inside, "a block without end");
    lines
}

/// Command lines that begin with this word, in blocks and in the text, without the word and without comments.
fn command_lines(program: &str) -> Vec<Vec<&'static str>> {
    let lines = fenced(true).into_iter().chain(code_spans());
    lines
        .filter_map(|line| line.split(" #").next()?.trim().strip_prefix(program)?.strip_prefix(' '))
        .map(|line| line.split_whitespace().collect())
        .collect()
}

/// Help text of a command of isocnc; fails if there is no such command.
fn help(command: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(command)
        .arg("--help")
        .output()
        .expect("isocnc");
    assert!(output.status.success(), "isocnc {command:?}: {output:?}");
    String::from_utf8(output.stdout).expect("text")
}

/// Fails unless a command line of isocnc is one: subcommands, options, files.
fn check_command_line(words: &[&str]) {
    let depth = match words {
        ["bus", "sdo", ..] => 3,
        ["hal" | "bus" | "logic" | "program" | "alarm" | "offset" | "tool", ..] | ["estop", "reset"] => 2,
        _ => 1,
    };
    let (command, rest) = words.split_at(depth.min(words.len()));
    let help = help(command);
    let usage = format!("isocnc {}", command.join(" "));
    assert!(help.contains(&usage), "{words:?}: {usage:?} is not in\n{help}");
    for word in rest {
        if word.starts_with("--") {
            assert!(help.contains(word), "{words:?}: no option {word} in\n{help}");
        } else if word.contains('/') {
            assert!(exists(word), "{words:?}: no {word}");
        }
    }
}

fn exists(path: &str) -> bool {
    // A page names what is beside it.
    let folders = ["", "docs"].map(|folder| Path::new(env!("CARGO_MANIFEST_DIR")).join(folder));
    folders.iter().any(|folder| folder.join(path).exists())
}

#[test]
fn it_opens_with_its_commands() {
    let block = fenced(true);
    let wanted = [
        "sudo apt install ./isocnc_*_amd64.deb && isocnc demo ",
        "cargo run --release -- demo ",
        "cargo run --release -- demo --panel ",
        "cargo test --workspace ",
    ];
    for (line, wanted) in block[..wanted.len()].iter().zip(wanted) {
        assert!(line.starts_with(wanted), "{line}");
    }
}

/// What isocnc is said to be in one sentence names every way to a motor that there is.
#[test]
fn one_sentence_about_isocnc_names_every_bus_and_step_pulses() {
    let architecture = include_str!("../ARCHITECTURE.md")
        .split("\n\n")
        .nth(1)
        .expect("a paragraph");
    let about = help(&[]);
    let about = about.lines().next().expect("a line");
    assert_eq!(about, env!("CARGO_PKG_DESCRIPTION"));
    for text in [about, architecture] {
        let text = text.to_lowercase();
        let buses = BusKind::WORDS.into_iter().filter(|(_, kind)| kind.has_interface());
        for word in buses.map(|(word, _)| word).chain(["pulses"]) {
            assert!(text.contains(word), "{word} is not in {text}");
        }
    }
}

#[test]
fn every_command_exists() {
    let mut seen = BTreeSet::new();
    for words in command_lines("isocnc") {
        check_command_line(&words);
        seen.insert(words[0]);
    }
    // Whatever else there is, is told.
    let help = help(&[]);
    let listed = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        // A description goes on below itself.
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help");
    assert_eq!(seen, listed.collect::<BTreeSet<_>>(), "README.md and `isocnc --help`");

    for words in command_lines("cargo") {
        match words[..] {
            ["run", "--release", "--", ..] => check_command_line(&words[3..]),
            // The checks run the tests and build the benches.
            ["test", "--workspace"] | ["bench"] | ["install", "--path", "."] => {}
            _ => panic!("cargo {words:?}: nobody knows whether it works"),
        }
    }
}

#[test]
fn every_option_of_the_text_exists() {
    let mut seen = 0;
    for span in code_spans() {
        // The script's own options are tested with the script.
        let Some(option) = span.strip_prefix("--").and_then(|rest| rest.split(' ').next()) else {
            continue;
        };
        let option = format!("--{option}");
        let known: [&[&str]; 12] = [
            &["stop"],
            &["program", "start"],
            &["demo"],
            &["init"],
            &["jitter"],
            &["run"],
            &["check"],
            &["plan"],
            &["interpret"],
            &["dda"],
            &["simulate"],
            &["bus", "trace"],
        ];
        assert!(known.iter().any(|command| help(command).contains(&option)), "{option}");
        seen += 1;
    }
    assert!(seen >= 4, "{seen} options");
}

#[test]
fn every_file_exists() {
    let mut seen = 0;
    let links = README.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    for path in links.chain(code_spans()) {
        // A heading of it is not looked for.
        let path = path.split('#').next().unwrap_or_default();
        // What begins with a slash is an address below the panel's.
        let is_path =
            path.contains('/') && !path.starts_with('/') && !path.contains(' ') && !path.contains("isocnc-out");
        if is_path || path.ends_with(".md") {
            assert!(exists(path), "{path}");
            seen += 1;
        }
    }
    assert!(seen >= 8, "{seen} files");
}

#[test]
fn every_section_of_the_machine_file_is_in_an_example() {
    let examples = [
        include_str!("../configs/mill3-demo.toml"),
        include_str!("../configs/gantry-demo.toml"),
        include_str!("../configs/cabinet2-demo.toml"),
        include_str!("../configs/io-only.toml"),
        include_str!("../configs/cell3-demo.toml"),
    ];
    let sections: Vec<&str> = code_spans().into_iter().filter(|span| span.starts_with('[')).collect();
    assert!(sections.len() >= 9, "{sections:?}");
    for section in sections {
        let mut lines = examples.iter().flat_map(|machine| machine.lines());
        assert!(lines.any(|line| line.trim() == section), "{section}");
    }
}
