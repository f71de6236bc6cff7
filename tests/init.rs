//! `isocnc init` as a user runs it.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Output, Stdio};

fn isocnc(args: &[&str], file: &Path) -> Output {
    let mut command = testing::command(env!("CARGO_BIN_EXE_isocnc"));
    command.arg(args[0]).arg(file).args(&args[1..]).stdin(Stdio::null());
    command.output().expect("isocnc")
}

#[test]
fn without_a_terminal_options_are_enough_and_check_takes_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("mill.toml");
    let output = isocnc(&["init", "--interface", "eth7", "--axes", "XYZA", "--io", "20"], &file);
    assert!(output.status.success(), "{output:?}");
    let checked = isocnc(&["check"], &file);
    assert!(checked.status.success(), "{checked:?}");
    let text = std::fs::read_to_string(&file).expect("the file");
    assert!(
        text.lines().filter(|line| line.contains(" # ")).count() > 10,
        "hardly a comment:\n{text}"
    );
}

#[test]
fn a_file_that_is_there_is_only_replaced_when_forced() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("mill.toml");
    std::fs::write(&file, "mine").expect("written");
    let refused = isocnc(&["init", "--interface", "eth7", "--yes"], &file);
    assert_eq!(refused.status.code(), Some(1), "{refused:?}");
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("--force"),
        "{refused:?}"
    );
    assert_eq!(std::fs::read_to_string(&file).expect("the file"), "mine");
    let forced = isocnc(&["init", "--interface", "eth7", "--force"], &file);
    assert!(forced.status.success(), "{forced:?}");
    assert!(isocnc(&["check"], &file).status.success());
}

#[test]
fn what_makes_no_machine_leaves_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("mill.toml");
    for (options, code) in [
        (&["init", "--yes"][..], 2),
        (&["init", "--interface", "a/b"], 2),
        (&["init", "--interface", "e", "--drives", "1,1,2"], 2),
        (&["init", "--interface", "e", "--name", "1st"], 2),
        (&["init", "--interface", "e", "--axes", "XQ"], 2),
        (&["init", "--scan", "nowhere0"], 1),
    ] {
        let output = isocnc(options, &file);
        assert_eq!(output.status.code(), Some(code), "{options:?}: {output:?}");
        assert!(!output.stderr.is_empty(), "{options:?}");
    }
    let left = std::fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(left, 0);
}

#[test]
fn an_interrupt_in_the_midst_of_the_questions_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let line = format!(
        "{} init {}/mill.toml",
        env!("CARGO_BIN_EXE_isocnc"),
        folder.path().display()
    );
    // `script` gives it a terminal, whose interrupt character is Ctrl-C.
    let mut command = testing::command("script");
    command
        .args(["-qec", &line, "/dev/null"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped());
    let Ok(mut child) = command.spawn() else {
        return println!("there is no `script` here: no terminal to be had");
    };
    let mut input = child.stdin.take().expect("a pipe");
    let mut output = BufReader::new(child.stdout.take().expect("a pipe"));
    let mut said = Vec::new();
    output.read_until(b':', &mut said).expect("a question");
    assert!(
        String::from_utf8_lossy(&said).contains("Name of the machine [mill]"),
        "{said:?}"
    );
    input.write_all(b"\x03").expect("a terminal");
    let status = testing::end(&mut child);
    assert!(!status.success(), "{status:?}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
}
