//! What a user, or somebody who means harm, may name where a file is wanted: pipes, devices, folders, links, files of any length.
//!
//! Every command that reads a file is given each of them. It must say what it found, in time, and must not have read it.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use tempfile::TempDir;

/// Runs `isocnc ARGUMENTS` in a folder, with less memory than an endless file would fill.
fn isocnc(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = testing::command(env!("CARGO_BIN_EXE_isocnc"));
    testing::output(command.args(arguments).current_dir(folder).stdin(Stdio::null()))
}

/// A folder with a machine, a program, and all that is no file.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("m.toml"), include_str!("../configs/mill3-demo.toml")).expect("our folder");
    std::fs::write(path("good.ngc"), "G21\nM2\n").expect("our folder");
    nix::unistd::mkfifo(&path("pipe"), nix::sys::stat::Mode::S_IRWXU).expect("our folder");
    std::fs::create_dir(path("folder")).expect("our folder");
    std::os::unix::fs::symlink("/dev/zero", path("zeros")).expect("our folder");
    let huge = std::fs::File::create(path("huge")).expect("our folder");
    huge.set_len(1 << 42).expect("it takes no room");
    folder
}

const ODD: [(&str, &str); 4] = [
    ("pipe", "is a pipe, no file"),
    ("folder", "is a folder, no file"),
    ("zeros", "is a device, no file"),
    ("huge", "is 4398046511104 octets long"),
];

#[test]
fn every_command_says_what_it_was_given_instead_of_a_file() {
    let folder = folder();
    let in_machine = |key: &str, section: &str, name: &str| {
        let text = include_str!("../configs/mill3-demo.toml");
        let file = format!("{key}-{name}.toml");
        let text = match text.contains(&format!("\n[{section}]\n")) {
            true => text.replace(
                &format!("\n[{section}]\n"),
                &format!("\n[{section}]\n{key} = \"{name}\"\n"),
            ),
            false => format!("{text}\n[{section}]\n{key} = \"{name}\"\n"),
        };
        std::fs::write(folder.path().join(&file), text).expect("our folder");
        file
    };
    for (name, told) in ODD {
        let _ = std::fs::remove_file(folder.path().join("sub.ngc"));
        std::os::unix::fs::symlink(folder.path().join(name), folder.path().join("sub.ngc")).expect("our folder");
        std::fs::write(folder.path().join("call.ngc"), "o<sub> call\nM2\n").expect("our folder");
        let parameters = in_machine("parameter_file", "program", name);
        let tools = in_machine("table", "tools", name);
        let mut commands: Vec<Vec<&str>> = vec![
            vec!["plan", "m.toml", name],
            vec!["plan", name, "good.ngc"],
            vec!["run", "m.toml", name],
            vec!["run", name],
            vec!["check", name],
            vec!["interpret", "--check", "-m", name, "good.ngc"],
            vec!["interpret", "-t", name, "good.ngc"],
            vec!["interpret", "-v", name, "good.ngc"],
            vec!["demo", "--memory", "--program", name],
            vec!["demo", "--memory", "--machine", name],
            vec!["jitter", "--program", name],
            vec!["jitter", "--machine", name],
            vec!["bus", "trace", name],
            vec![
                "bus",
                "sdo",
                "--node",
                "1",
                "--interface",
                "lo",
                "--device",
                name,
                "list",
            ],
        ];
        // A huge file is read as it is run, and only what follows a call of it.
        if name != "huge" {
            commands.push(vec!["interpret", name]);
            commands.push(vec!["interpret", "call.ngc"]);
            commands.push(vec!["plan", &parameters, "good.ngc"]);
            commands.push(vec!["plan", &tools, "good.ngc"]);
        }
        for command in commands {
            let output = isocnc(folder.path(), &command);
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{command:?}: {said}");
            let is_no_file = told.contains("no file") && said.contains("is no file");
            assert!(said.contains(told) || is_no_file, "{command:?}: {said}");
        }
    }
}

/// What turns a terminal's title, screen or order of letters round, in every place in which a file has text.
#[test]
fn nothing_that_a_file_says_steers_a_terminal() {
    let machine = include_str!("../configs/mill3-demo.toml");
    let mut shown = 0;
    for (poison, seen) in [
        ("\x1b]0;owned\x07", "\\u001b]0;owned\\u0007"),
        ("\u{9b}2J", "\\u009b2J"),
        ("\u{202e}cgn", "\\u202ecgn"),
        ("\rgood\x08", "\\u000dgood\\u0008"),
        ("\x1b[8m", "\\u001b[8m"),
    ] {
        let folder = folder();
        let write = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).expect("our folder");
            name.to_owned()
        };
        let program = write(
            &format!("part{poison}.ngc"),
            &format!("(a {poison} remark)\n(MSG,says {poison})\nG1 X1 F{poison}1\nM2\n"),
        );
        let good = write(
            &format!("good{poison}.ngc"),
            &format!(
                "; {poison}\n(MSG,says {poison})\n(PRINT,says {poison})\n(DEBUG,says {poison})\nG21\nG4 P100\nM2\n"
            ),
        );
        let words = write(
            "words.ngc",
            &format!("{poison}\nO<{poison}> call\n#<{poison}>=1\nM{poison}3\n"),
        );
        let toml = write("p.toml", &machine.replace("name = \"", &format!("name = \"{poison}")));
        let escaped: String = poison
            .chars()
            .map(|letter| format!("\\u{:04X}", u32::from(letter)))
            .collect();
        let escaped = write("e.toml", &machine.replace("name = \"", &format!("name = \"{escaped}")));
        let key = write("k.toml", &format!("{machine}\n[{}]\nx = 1\n", "\"owned\u{9b}\""));
        let tools = write("t.tbl", &format!("T1 P1 Z1 D2 ; {poison}\nT{poison} P2\nX{poison}\n"));
        let hal = write(
            "m.hal",
            &format!("loadrt {poison}\nnet {poison} a.{poison} => b\naddf {poison} servo-thread\nsetp {poison} 1\n"),
        );
        let st = write(
            "l.st",
            &format!("PROGRAM {poison}\nVAR x{poison} : BOOL; END_VAR\nx := '{poison}'; (* {poison} *)\nEND_PROGRAM\n"),
        );
        let csv = write("l.csv", &format!("t_ms,{poison}\n0,{poison}\n"));
        let device = write(
            "d.xml",
            &format!("<EtherCATInfo><Vendor><Name>{poison}</Name></Vendor>{poison}</EtherCATInfo>"),
        );
        let trace = write("t.pcap", poison);
        let commands: Vec<Vec<&str>> = vec![
            vec!["check", &toml],
            vec!["check", &escaped],
            vec!["check", &key],
            vec!["check", &program],
            vec!["plan", "m.toml", &program],
            vec!["plan", "m.toml", &good],
            vec!["plan", "m.toml", &words],
            vec!["run", "m.toml", &program],
            vec!["run", &escaped, &words],
            vec!["demo", "--memory", "--program", &program],
            vec!["interpret", &program],
            vec!["interpret", &good],
            vec!["interpret", "-t", &tools, &good],
            vec!["interpret", "-v", &tools, &good],
            vec!["interpret", "--check", "-m", &escaped, &words],
            vec!["interpret", "--continue-after-error", &words],
            vec!["hal", "import", &hal],
            vec!["hal", "graph", "--file", &escaped],
            vec!["logic", "check", &st],
            vec!["logic", "run", &st, "--inputs", &csv],
            vec!["bus", "trace", &trace],
            vec!["bus", "check", &escaped],
            vec![
                "bus",
                "sdo",
                "--node",
                "1",
                "--interface",
                "lo",
                "--device",
                &device,
                "list",
            ],
            vec!["status", poison],
            vec![poison],
            vec!["bus", "scan", "--interface", poison],
            vec!["--socket", poison, "status"],
        ];
        for command in commands {
            for json in [false, true] {
                let mut command = command.clone();
                if json {
                    command.push("--json");
                }
                let output = isocnc(folder.path(), &command);
                for said in [&output.stdout, &output.stderr] {
                    let said = String::from_utf8_lossy(said);
                    let steers = |letter: char| {
                        letter.is_control() && letter != '\n' && letter != '\t' || "\u{202e}\u{2066}".contains(letter)
                    };
                    assert!(!said.contains(steers), "{command:?}: {said:?}");
                    shown += usize::from(said.contains(seen));
                }
            }
        }
    }
    assert!(shown > 50, "the commands show what they were given: {shown}");
}

/// Links of a user into files of root, in the folder where root lets a program write: each of these wrote through them.
#[test]
fn links_of_another_user_are_never_written_through() {
    if !nix::unistd::geteuid().is_root() {
        eprintln!("skipped: links of another user can only be made as root");
        return;
    }
    const STRANGER: u32 = 54321;
    let folder = folder();
    let strange = folder.path().join("strange");
    let precious = folder.path().join("precious");
    std::fs::create_dir(&strange).expect("our folder");
    std::os::unix::fs::chown(&strange, Some(STRANGER), None).expect("as root");
    std::fs::write(&precious, "precious").expect("our folder");
    let link = |name: &str| -> PathBuf {
        let link = strange.join(name);
        let _ = std::fs::remove_file(&link);
        std::os::unix::fs::symlink(&precious, &link).expect("our folder");
        std::os::unix::fs::lchown(&link, Some(STRANGER), None).expect("as root");
        link
    };
    let names = [
        "run.json",
        "toolpath.svg",
        "soc-period.svg",
        "soc-period.json",
        "machine.toml",
        "samples.csv",
        "path.txt",
        "smoothed.csv",
        "plan.svg",
        "left.var",
        "log.txt",
        "net.cdc",
    ];
    for name in names {
        link(name);
    }
    std::fs::write(
        folder.path().join("log.ngc"),
        "(LOGOPEN,strange/log.txt)\n(LOG,owned)\nM2\n",
    )
    .expect("our folder");
    let plan = [
        "plan",
        "m.toml",
        "good.ngc",
        "--samples",
        "strange/samples.csv",
        "--path",
        "strange/path.txt",
        "--smoothed",
        "strange/smoothed.csv",
        "--svg",
        "strange/plan.svg",
    ];
    let commands: [&[&str]; 4] = [
        &plan,
        &[
            "interpret",
            "log.ngc",
            "--write-logs",
            "--write-var",
            "strange/left.var",
        ],
        &["check", "m.toml", "--cdc", "strange/net.cdc"],
        // The folder is made ready, then the program is refused: nothing has to run.
        &["demo", "--memory", "--program", "good.ngc", "--out", "strange"],
    ];
    for command in commands {
        let output = isocnc(folder.path(), command);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(
            std::fs::read(&precious).expect("it is there"),
            b"precious",
            "{command:?}: {said}"
        );
        assert!(output.status.success(), "{command:?}: {said}");
    }
    for name in names {
        match strange.join(name).symlink_metadata() {
            // Removed before the run, and not made by this one.
            Err(_) => assert!(
                name.starts_with("soc-period") || name == "toolpath.svg",
                "{name} is missing"
            ),
            Ok(metadata) => assert!(metadata.is_file() && metadata.uid() == 0, "{name} is no file of ours"),
        }
    }
    // Nothing is left beside them.
    let hidden = |entry: std::io::Result<std::fs::DirEntry>| {
        entry
            .expect("our folder")
            .file_name()
            .to_string_lossy()
            .starts_with('.')
    };
    assert!(!std::fs::read_dir(&strange).expect("our folder").any(hidden));
}
