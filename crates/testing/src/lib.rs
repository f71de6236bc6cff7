//! Processes that tests start: with the usual signals, and never without an end.
//!
//! In:  commands and running processes. Out: how they ended; a panic that says which did not, and what it had printed.

use nix::sys::signal::{SigHandler, Signal, signal};
use std::ffi::OsStr;
use std::io::Read;
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Output};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Longest that a process of a test may take to end, however busy the PC is.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A command of a program whose Ctrl-C and Ctrl-\ are not ignored: a shell starts what runs in its background with both ignored,
/// and processes inherit that.
pub fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    usual_signals(&mut command);
    command
}

/// The same of a command that is there.
pub fn usual_signals(command: &mut Command) {
    let usual = || {
        for ignored in [Signal::SIGINT, Signal::SIGQUIT] {
            // SAFETY: no handler is put in, and nothing else is done between fork and exec.
            unsafe { signal(ignored, SigHandler::SigDfl)? };
        }
        Ok(())
    };
    // SAFETY: the closure makes system calls only.
    unsafe { command.pre_exec(usual) };
}

/// How a process ends that is to end by itself.
///
/// # Panics
/// If it has not ended after [`PATIENCE`]; it is killed then, and what it had printed is told.
pub fn end(process: &mut Child) -> ExitStatus {
    let give_up = Instant::now() + PATIENCE;
    loop {
        if let Some(status) = process.try_wait().expect("a process of ours") {
            return status;
        }
        if Instant::now() > give_up {
            let words = std::fs::read(format!("/proc/{}/cmdline", process.id())).unwrap_or_default();
            let words = String::from_utf8_lossy(&words).replace('\0', " ");
            let _ = process.kill();
            let (out, err) = (said(process.stdout.take()), said(process.stderr.take()));
            panic!("after {PATIENCE:?} this has not ended: {words}\nit printed: {out}\nand as errors: {err}");
        }
        sleep(Duration::from_millis(5));
    }
}

/// The same of one that nobody reads meanwhile: its output as a whole, which may be longer than a pipe.
///
/// # Panics
/// As [`end`].
pub fn output(command: &mut Command) -> Output {
    use std::process::Stdio;
    let mut process = (command.stdout(Stdio::piped()).stderr(Stdio::piped()))
        .spawn()
        .expect("the program can be started");
    let readers = [
        process
            .stdout
            .take()
            .map(|pipe| std::thread::spawn(move || whole(pipe))),
        process
            .stderr
            .take()
            .map(|pipe| std::thread::spawn(move || whole(pipe))),
    ];
    let status = end(&mut process);
    let [stdout, stderr] = readers.map(|reader| reader.and_then(|reader| reader.join().ok()).unwrap_or_default());
    Output { status, stdout, stderr }
}

fn whole(mut pipe: impl Read) -> Vec<u8> {
    let mut octets = Vec::new();
    let _ = pipe.read_to_end(&mut octets);
    octets
}

/// What is in a pipe now.
fn said(pipe: Option<impl Read + AsFd>) -> String {
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    let Some(mut pipe) = pipe else {
        return "(read by the test)".into();
    };
    let mut octets = Vec::new();
    let mut part = [0; 4096];
    let is_ready = |pipe: &dyn AsFd| {
        let mut fd = [PollFd::new(pipe.as_fd(), PollFlags::POLLIN)];
        poll(&mut fd, PollTimeout::ZERO).is_ok_and(|ready| ready > 0)
    };
    while is_ready(&pipe) {
        match pipe.read(&mut part) {
            Ok(count) if count > 0 => octets.extend_from_slice(&part[..count]),
            _ => break,
        }
    }
    String::from_utf8_lossy(&octets).into_owned()
}
