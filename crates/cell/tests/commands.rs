//! The program as somebody uses it who does things wrong, twice, and while the supervisor does not answer.

use nix::mount::{MsFlags, mount};
use nix::sched::{CloneFlags, unshare};
use nix::sys::signal::{Signal, kill};
use nix::sys::stat::Mode;
use nix::unistd::{Pid, mkfifo};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn command(folder: &Path, words: &[&str]) -> Command {
    let mut command = testing::command(env!("CARGO_BIN_EXE_isocnc-cell"));
    // Cargo sets it for tests; the program is to do so itself.
    command.current_dir(folder).args(words).env_remove("ZENOH_RUNTIME");
    command
}

fn run(folder: &Path, words: &[&str]) -> Output {
    command(folder, words).output().unwrap()
}

/// A supervisor in the folder `state`, which listens, with its log in the file `log`.
struct Supervisor(Child);

impl Supervisor {
    fn begin(folder: &Path) -> Supervisor {
        assert!(run(folder, &["ca", "init", "--dir", "ca"]).status.success());
        let port = std::net::TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let listen = port.to_string();
        let mut child = command(folder, &["run", "--dir", "state", "--ca", "ca", "--listen", &listen])
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(folder.join("log")).unwrap())
            // Whoever runs this test may not want any colours.
            .env_remove("NO_COLOR")
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        assert!(line.starts_with("listening at"), "{line}");
        Supervisor(child)
    }

    fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.0.id() as i32), signal).unwrap();
    }
}

impl Drop for Supervisor {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn whatever_is_wrong_is_said_in_words_and_as_json() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let _supervisor = Supervisor::begin(folder);
    let file = |name: &str, content: &[u8]| std::fs::write(folder.join(name), content).unwrap();
    file("p.ngc", b"G0 X1\n");
    file("a b.ngc", b"");
    file("no-text.toml", &[0xff; 9]);
    file("wrong.toml", "[[configuration]]\naxs = 1\n".repeat(20_000).as_bytes());
    std::fs::create_dir(folder.join("folder")).unwrap();
    std::fs::File::create(folder.join("long.ngc"))
        .unwrap()
        .set_len(200 << 20)
        .unwrap();
    mkfifo(&folder.join("pipe"), Mode::S_IRWXU).unwrap();
    let state = ["--dir", "state"];
    for (words, why) in [
        (&["machines"][..], "--dir <STATE>"),
        (&["machines", "--dir", "nowhere"], "no supervisor runs in nowhere"),
        (&["machines", "--dir", "p.ngc"], "Not a directory"),
        (&["machines", "--dir", ""], "a value is required"),
        (&["machines", "--class", "x", state[0], state[1]], "NAME=CLASS"),
        (
            &["machines", "--forget", "x", state[0], state[1]],
            "there is no machine \"x\"",
        ),
        (&["upload", "x", "nothing", state[0], state[1]], "nothing: No such file"),
        (&["upload", "x", "folder", state[0], state[1]], "is a folder"),
        (&["upload", "x", "..", state[0], state[1]], "is a folder"),
        (&["upload", "x", "pipe", state[0], state[1]], "is a pipe"),
        (&["upload", "x", "/dev/zero", state[0], state[1]], "is a device"),
        (
            &["upload", "x", "long.ngc", state[0], state[1]],
            "209715200 octets long",
        ),
        (&["upload", "x", "a b.ngc", state[0], state[1]], "cannot name a program"),
        (&["upload", "../x", "p.ngc", state[0], state[1]], "there is no machine"),
        (
            &["run-program", "", "../p.ngc", state[0], state[1]],
            "there is no machine",
        ),
        (&["mdi", "x", "G0 X0", state[0], state[1]], "there is no machine"),
        (&["hold", "x", state[0], state[1]], "there is no machine"),
        (&["stop", "x", state[0], state[1]], "there is no machine"),
        (&["journal", "x", state[0], state[1]], "there is no machine"),
        (&["journal", "x", "--since", "-1", state[0], state[1]], "-1"),
        (&["queue"], "--dir STATE"),
        (&["queue", "cancel", "7", state[0], state[1]], "there is no order 7"),
        (&["queue", "resume", "x", state[0], state[1]], "the number of an order"),
        (
            &["queue", "add", "p.ngc", "--count", "0", state[0], state[1]],
            "0 is not in 1..=100000",
        ),
        (
            &[
                "queue", "add", "p.ngc", "--count", "1", "--axes", "Q", state[0], state[1],
            ],
            "'Q' is no axis",
        ),
        (
            &[
                "queue", "add", "p.ngc", "--count", "1", "--tools", "x", state[0], state[1],
            ],
            "numbers of tools",
        ),
        (&["plan", "nothing"], "nothing: No such file"),
        (&["plan", "folder"], "is a folder"),
        (&["plan", "/dev/zero"], "is a device"),
        (&["plan", "no-text.toml"], "must be UTF-8"),
        (&["plan", "wrong.toml"], "line 2"),
        (&["ca", "list", "--dir", "nowhere"], "there is no authority"),
        (&["dance"], "unrecognized subcommand"),
    ] {
        let output = run(folder, words);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(
            !output.status.success() && output.stdout.is_empty() && said.contains(why),
            "{words:?}: {said}"
        );
        let output = run(folder, &[words, &["--json"]].concat());
        let said: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{words:?}: {error}"));
        let rule = said["errors"][0]["rule"].as_str().unwrap();
        assert!(
            !output.status.success() && output.stderr.is_empty() && rule.contains(why),
            "{words:?}: {rule}"
        );
    }
    for (words, said) in [
        (&["machines"][..], "no machine has spoken yet"),
        (&["queue"], "no orders yet"),
        (&["queue", "add", "p.ngc", "--count", "2"], "order 1\n"),
        (&["queue", "add", "p.ngc", "--count", "2"], "order 2\n"),
        (&["queue", "cancel", "1"], "order 1 is cancelled"),
        (&["queue"], "order 2 p.ngc 0 of 2 parts"),
    ] {
        let output = run(folder, &[words, &state].concat());
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success() && text.contains(said), "{words:?}: {text}");
    }
    let output = run(
        folder,
        &[
            "run",
            "--dir",
            "other",
            "--ca",
            "ca",
            "--listen",
            "127.0.0.1:1",
            "--name",
            "\u{fc}",
        ],
    );
    assert!(
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("expected a name or an address")
    );
}

#[test]
fn who_asks_a_supervisor_that_was_stopped_is_told_and_can_leave() {
    let folder = tempfile::tempdir().unwrap();
    let supervisor = Supervisor::begin(folder.path());
    supervisor.signal(Signal::SIGSTOP);
    let mut asks = command(folder.path(), &["machines", "--dir", "state", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(asks.stderr.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    assert!(line.starts_with("no answer yet; Ctrl-C ends the waiting"), "{line}");
    kill(Pid::from_raw(asks.id() as i32), Signal::SIGINT).unwrap();
    assert_eq!(testing::end(&mut asks).signal(), Some(Signal::SIGINT as i32));
    let mut said = String::new();
    asks.stdout.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(said, "");
    supervisor.signal(Signal::SIGCONT);
    assert!(run(folder.path(), &["machines", "--dir", "state"]).status.success());
}

#[test]
fn the_log_in_a_file_has_no_colours() {
    let folder = tempfile::tempdir().unwrap();
    let _supervisor = Supervisor::begin(folder.path());
    let issued = run(folder.path(), &["ca", "issue", "mill", "--dir", "ca"]);
    assert!(issued.status.success());
    let give_up = Instant::now() + testing::PATIENCE;
    let log = loop {
        let log = std::fs::read_to_string(folder.path().join("log")).unwrap();
        if log.ends_with("the list of certificates has changed: all controls connect anew\n") {
            break log;
        }
        assert!(Instant::now() < give_up, "{log:?}");
        std::thread::sleep(Duration::from_millis(20));
    };
    assert!(log.contains(" INFO cell::serve: ") && !log.contains('\x1b'), "{log:?}");
}

#[test]
fn an_authority_on_a_full_disk_is_made_once_there_is_room() {
    if !nix::unistd::geteuid().is_root() {
        println!("SKIPPED: only root can make a small disk");
        return;
    }
    unshare(CloneFlags::CLONE_NEWNS).unwrap();
    let none = None::<&str>;
    mount(none, "/", none, MsFlags::MS_REC | MsFlags::MS_PRIVATE, none).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    mount(
        none,
        folder,
        Some("tmpfs"),
        MsFlags::empty(),
        Some("size=256k,mode=700"),
    )
    .unwrap();
    let filler = folder.join("filler");
    let fill = || {
        let mut file = std::fs::File::create(&filler).unwrap();
        while file.write_all(&[0; 4096]).is_ok() {}
    };
    let words = [
        &["ca", "init", "--dir", "ca"][..],
        &["ca", "issue", "mill", "--dir", "ca"],
    ];
    for words in words {
        fill();
        // Twice, for the first try must not be in the way of the second.
        for _ in 0..2 {
            let output = run(folder, words);
            let said = String::from_utf8(output.stderr).unwrap();
            assert!(
                !output.status.success() && said.contains("No space left"),
                "{words:?}: {said}"
            );
        }
        std::fs::remove_file(&filler).unwrap();
        let output = run(folder, words);
        assert!(
            output.status.success(),
            "{words:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    let key = std::fs::read_to_string(folder.join("ca/mill.key")).unwrap();
    // A key that is there stays whole where there is no room for the next one.
    fill();
    assert!(!run(folder, words[1]).status.success());
    assert_eq!(std::fs::read_to_string(folder.join("ca/mill.key")).unwrap(), key);
}
