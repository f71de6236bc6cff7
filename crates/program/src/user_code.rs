//! M100 to M199: a program of the PC, which part programs start and wait for.
//!
//! In:  the number of the code, P and Q; folders of the machine file.
//! Out: how it ended, in words where that is an error.
//!
//! It runs as the control's user with the rights of an ordinary thread: no capability (and no way to gain one), no right to
//! real-time priorities, off the core of real time, in a process group of its own. It is killed, with all of its group, when its
//! time is over and when nobody waits for it any more.

use config::UserCodes;
use nix::sys::resource::{Resource, setrlimit};
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use std::io::{ErrorKind, PipeReader, Read, pipe};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

/// Octets of the last line of its output that are told.
const LINE_MAX: usize = 200;
/// Reads of its output in one look, so that one that writes without end holds nobody up.
const READS_MAX: usize = 16;

/// The file of a code: the first one that may be started.
pub(super) fn file(codes: &UserCodes, number: u8) -> Option<PathBuf> {
    let is_program = |path: &Path| {
        let metadata = std::fs::metadata(path);
        metadata.is_ok_and(|metadata| metadata.is_file() && metadata.permissions().mode() & 0o111 != 0)
    };
    let mut paths = codes.directories.iter().map(|folder| folder.join(format!("M{number}")));
    paths.find(|path| codes.allowed && is_program(path))
}

/// A program that runs.
pub(super) struct UserCode {
    child: Child,
    output: PipeReader,
    last: LastLine,
    began: Instant,
    timeout_s: f64,
}

impl UserCode {
    /// Starts the program of a code.
    ///
    /// # Errors
    /// Why it cannot be started.
    pub(super) fn start(codes: &UserCodes, number: u8, p: f64, q: f64) -> Result<UserCode, String> {
        let path = file(codes, number).ok_or_else(|| format!("there is no program M{number} that may be started"))?;
        let failed = |error: std::io::Error| format!("{} cannot be started: {error}", path.display());
        let (output, input) = pipe().map_err(failed)?;
        let flags = nix::fcntl::FcntlArg::F_SETFL(nix::fcntl::OFlag::O_NONBLOCK);
        nix::fcntl::fcntl(&output, flags).map_err(|errno| failed(errno.into()))?;
        let mut command = Command::new(&path);
        command
            .args([p, q].map(|value| format!("{value:.6}")))
            .stdin(Stdio::null())
            .stdout(input.try_clone().map_err(failed)?)
            .stderr(input)
            .process_group(0);
        // SAFETY: between fork and exec only the system call `setrlimit` is made, which is safe there.
        unsafe {
            command.pre_exec(|| Ok(setrlimit(Resource::RLIMIT_RTPRIO, 0, 0)?));
        }
        let child = command.spawn().map_err(failed)?;
        Ok(UserCode {
            child,
            output,
            last: LastLine::default(),
            began: Instant::now(),
            timeout_s: codes.timeout_s,
        })
    }

    /// How it ended, once it has. To be asked every few milliseconds.
    pub(super) fn poll(&mut self) -> Option<Result<(), String>> {
        self.read();
        let ended = match self.child.try_wait() {
            Ok(None) if self.began.elapsed().as_secs_f64() < self.timeout_s => return None,
            Ok(None) => Err(format!("it took longer than {} s and was ended", self.timeout_s)),
            Ok(Some(status)) if status.success() => Ok(()),
            Ok(Some(status)) => Err(match status.code() {
                Some(code) => format!("it ended with exit code {code}"),
                None => format!("it was ended by {status}"),
            }),
            Err(error) => Err(format!("how it ended is not known: {error}")),
        };
        self.read();
        Some(ended.map_err(|what| {
            self.kill();
            match self.last.text() {
                Some(line) => format!("{what}; its last words: {line}"),
                None => what,
            }
        }))
    }

    fn read(&mut self) {
        let mut octets = [0; 4096];
        for _ in 0..READS_MAX {
            match self.output.read(&mut octets) {
                Ok(0) => return,
                Ok(count) => self.last.take(&octets[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return,
            }
        }
    }

    /// Ends it and all that it has started in its group.
    fn kill(&mut self) {
        // Until it is waited for, its number is nobody else's.
        if let Ok(None) = self.child.try_wait()
            && let Ok(pid) = i32::try_from(self.child.id())
        {
            let _ = killpg(Pid::from_raw(pid), Signal::SIGKILL);
            let _ = self.child.wait();
        }
    }
}

impl Drop for UserCode {
    fn drop(&mut self) {
        self.kill();
    }
}

/// The last line of an output that is not empty.
#[derive(Debug, Default)]
struct LastLine {
    /// What has come of the line under way, and the one before it.
    line: Vec<u8>,
    before: Vec<u8>,
}

impl LastLine {
    fn take(&mut self, octets: &[u8]) {
        for &octet in octets {
            match octet {
                b'\n' if self.line.iter().all(u8::is_ascii_whitespace) => self.line.clear(),
                b'\n' => self.before = std::mem::take(&mut self.line),
                _ if self.line.len() < LINE_MAX => self.line.push(octet),
                _ => {}
            }
        }
    }

    /// Letters that are none, and what could steer a terminal, are left out.
    fn text(&self) -> Option<String> {
        let is_empty = self.line.iter().all(u8::is_ascii_whitespace);
        let line = if is_empty { &self.before } else { &self.line };
        let text = String::from_utf8_lossy(line);
        let text: String = text.chars().filter(|letter| !letter.is_control()).collect();
        let text = text.trim();
        (!text.is_empty()).then(|| text.to_owned())
    }
}
