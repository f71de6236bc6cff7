//! The other end of the socket: a process that asks a running control.
//!
//! In:  the name of a machine, or none where only one control runs.
//! Out: answers, or why there are none.

use super::rpc::{RpcError, code, to_hex};
use super::socket;
use super::socket::find_in;
use super::uploads::PART_MAX;
use motion::cancel::Cancel;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, poll};
use nix::sys::socket::{MsgFlags, send};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::VecDeque;
use std::fmt;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::net::Shutdown;
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest wait for an answer: more than a node is given for an SDO.
const ANSWER_WAIT: Duration = Duration::from_secs(30);
/// The same where a program is checked first, which may take as long as it may be interpreted, and a little.
const CHECK_WAIT: Duration = Duration::from_secs(700);
/// Octets of the longest answer.
const ANSWER_MAX: u64 = 64 * 1024 * 1024;

/// Why a control gave no answer.
#[derive(Debug)]
pub enum ClientError {
    /// No control runs, or none of this name.
    NotRunning {
        /// The machine that was asked for.
        machine: Option<String>,
    },
    /// Several controls run.
    Several { machines: Vec<String> },
    /// The socket failed.
    Io { path: PathBuf, cause: io::Error },
    /// The answer is none.
    BadAnswer {
        /// What is wrong with it.
        what: String,
    },
    /// The control has refused.
    Refused(RpcError),
    /// Whoever asked does not wait any longer.
    GivenUp,
}

impl fmt::Display for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClientError::NotRunning { machine: None } => write!(
                f,
                "no control is running (or it runs as another user): start one with 'isocnc run' or 'isocnc demo'"
            ),
            ClientError::NotRunning { machine: Some(machine) } => {
                write!(
                    f,
                    "no control of machine \"{machine}\" is running (or it runs as another user)"
                )
            }
            ClientError::Several { machines } => write!(
                f,
                "several controls are running: choose one with --machine: {}",
                machines.join(", ")
            ),
            ClientError::Io { path, cause } if cause.kind() == ErrorKind::WouldBlock => {
                write!(f, "{}: no answer in time", path.display())
            }
            ClientError::Io { path, cause } => write!(f, "{}: {cause}", path.display()),
            ClientError::BadAnswer { what } => write!(f, "the control's answer cannot be understood: {what}"),
            ClientError::Refused(error) => error.fmt(f),
            ClientError::GivenUp => f.write_str("not waited for any longer"),
        }
    }
}

impl std::error::Error for ClientError {}

impl ClientError {
    /// Whether there is a control that takes no connection, or is not who it should be.
    fn is_mute(&self) -> bool {
        let ClientError::Io { cause, .. } = self else {
            return false;
        };
        matches!(cause.kind(), ErrorKind::TimedOut | ErrorKind::PermissionDenied)
    }
}

/// Asks for things and waits for nothing.
#[derive(Debug)]
pub struct Sender {
    stream: UnixStream,
    id: u64,
}

impl Sender {
    /// Asks for something.
    ///
    /// # Errors
    /// The control has gone, or does not read.
    pub fn send(&mut self, method: &str, params: &Value) -> io::Result<()> {
        self.id += 1;
        let request = json!({ "jsonrpc": "2.0", "id": self.id, "method": method, "params": params });
        let line = format!("{request}\n");
        let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
        match send(self.stream.as_raw_fd(), line.as_bytes(), flags)? {
            sent if sent == line.len() => Ok(()),
            // What follows would be part of this line.
            _ => self.stream.shutdown(Shutdown::Both),
        }
    }
}

/// A connection to a control.
#[derive(Debug)]
pub struct Client {
    path: PathBuf,
    stream: BufReader<UnixStream>,
    id: u64,
    /// Notifications that came before an answer.
    notifications: VecDeque<Value>,
    /// Longest wait for a message.
    wait: Duration,
    given_up: Option<Cancel>,
}

impl Client {
    /// Connects to the control of a machine, or to the only one.
    ///
    /// # Errors
    /// None or several run.
    pub fn connect(machine: Option<&str>) -> Result<Client, ClientError> {
        Client::connect_in(&hal_pins::directories(), machine)
    }

    /// The controls that can be reached, by machine.
    pub fn all() -> Vec<(String, Client)> {
        Client::open_all(&hal_pins::directories())
    }

    fn open_all(directories: &[PathBuf]) -> Vec<(String, Client)> {
        // Those of dead processes, and of other users, do not answer.
        let opened = Client::try_all(directories, None).into_iter();
        opened.filter_map(|(name, opened)| Some((name, opened.ok()?))).collect()
    }

    fn try_all(directories: &[PathBuf], machine: Option<&str>) -> Vec<(String, Result<Client, ClientError>)> {
        let mut sockets = find_in(directories);
        sockets.retain(|(name, _)| machine.is_none_or(|machine| machine == name));
        let opened = sockets.into_iter().map(|(name, path)| {
            let opened = Client::open(&path);
            (name, opened.map_err(|cause| ClientError::Io { path, cause }))
        });
        opened.collect()
    }

    /// As [`connect`](Self::connect), for sockets in these folders.
    pub fn connect_in(directories: &[PathBuf], machine: Option<&str>) -> Result<Client, ClientError> {
        let (mut found, mut mute) = (Vec::new(), None);
        for (name, opened) in Client::try_all(directories, machine) {
            match opened {
                Ok(client) => found.push((name, client)),
                // Somebody is there.
                Err(error @ ClientError::Io { .. }) if error.is_mute() => mute = Some(error),
                Err(_) => {}
            }
        }
        match (found.len(), mute) {
            (0, Some(mute)) => Err(mute),
            (0, None) => Err(ClientError::NotRunning {
                machine: machine.map(str::to_owned),
            }),
            (1, _) => Ok(found.remove(0).1),
            (_, _) => Err(ClientError::Several {
                machines: found.into_iter().map(|(name, _)| name).collect(),
            }),
        }
    }

    fn open(path: &Path) -> io::Result<Client> {
        let stream = socket::connect(path)?;
        stream.set_read_timeout(Some(ANSWER_WAIT))?;
        stream.set_write_timeout(Some(ANSWER_WAIT))?;
        Ok(Client {
            path: path.to_owned(),
            stream: BufReader::new(stream),
            id: 0,
            notifications: VecDeque::new(),
            wait: ANSWER_WAIT,
            given_up: None,
        })
    }

    /// Calls a method and waits for its answer.
    ///
    /// # Errors
    /// The control has gone, refuses, or answers something else.
    pub fn call(&mut self, method: &str, params: Value) -> Result<Value, ClientError> {
        self.id += 1;
        self.wait = match method {
            "program.load" | "program.run" | "program.start" | "mdi" => CHECK_WAIT,
            _ => ANSWER_WAIT,
        };
        let request = json!({ "jsonrpc": "2.0", "id": self.id, "method": method, "params": params });
        let written = self.stream.get_mut().write_all(format!("{request}\n").as_bytes());
        written.map_err(|cause| self.broken(cause))?;
        loop {
            let message = self.message()?;
            match message.get("method") {
                Some(_) => self.notifications.push_back(message),
                None => return self.answer(message),
            }
        }
    }

    /// Sends a program in parts; gives the number of the upload, for "program.load" and "program.run".
    ///
    /// # Errors
    /// As [`call`](Self::call); the program cannot be read.
    pub fn upload(&mut self, name: &str, mut program: impl Read, octets: u64) -> Result<Value, ClientError> {
        let begun = self.call("program.upload.begin", json!({ "name": name, "octets": octets }))?;
        let upload = &begun["upload"];
        let mut part = vec![0; begun["part_octets"].as_u64().map_or(PART_MAX, |octets| octets as usize)];
        let (mut at, mut sum) = (0, Sha256::new());
        loop {
            let count = program.read(&mut part).map_err(|cause| self.broken(cause))?;
            if count == 0 {
                break;
            }
            let value = to_hex(&part[..count]);
            self.call(
                "program.upload.append",
                json!({ "upload": upload, "at": at, "value": value }),
            )?;
            sum.update(&part[..count]);
            at += count as u64;
        }
        let sha256 = to_hex(&sum.finalize());
        self.call("program.upload.commit", json!({ "upload": upload, "sha256": sha256 }))?;
        Ok(upload.clone())
    }

    /// The next notification of a control that was subscribed to; waits for it.
    ///
    /// # Errors
    /// The control has gone, or tells nothing.
    pub fn notification(&mut self) -> Result<Value, ClientError> {
        match self.notifications.pop_front() {
            Some(message) => Ok(message),
            None => self.message(),
        }
    }

    fn broken(&self, cause: io::Error) -> ClientError {
        ClientError::Io {
            path: self.path.clone(),
            cause,
        }
    }

    /// The next message, whatever it is; waits for it.
    ///
    /// # Errors
    /// The control has gone, or tells nothing.
    pub fn message(&mut self) -> Result<Value, ClientError> {
        self.await_message()?;
        let mut line = String::new();
        let read = (&mut self.stream).take(ANSWER_MAX).read_line(&mut line);
        read.map_err(|cause| self.broken(cause))?;
        let bad = |what: String| Err(ClientError::BadAnswer { what });
        if line.is_empty() {
            return bad("the control has closed the connection".into());
        }
        serde_json::from_str(&line).or_else(|error| bad(error.to_string()))
    }

    /// Until there is something to read, in slices: a signal does not end a read.
    fn await_message(&self) -> Result<(), ClientError> {
        const SLICE_MS: u8 = 100;
        let give_up = Instant::now() + self.wait;
        while self.stream.buffer().is_empty() {
            let mut fd = [PollFd::new(self.stream.get_ref().as_fd(), PollFlags::POLLIN)];
            match poll(&mut fd, SLICE_MS) {
                Ok(0) | Err(Errno::EINTR) => {}
                // What is wrong with it, the read tells.
                Ok(_) | Err(_) => break,
            }
            if self.given_up.as_ref().is_some_and(Cancel::is_cancelled) {
                return Err(ClientError::GivenUp);
            }
            if Instant::now() >= give_up {
                return Err(self.broken(ErrorKind::WouldBlock.into()));
            }
        }
        Ok(())
    }

    /// Answers are not waited for any longer once this is cancelled; what was asked is withdrawn as the connection ends.
    pub fn wait_until(&mut self, given_up: Option<Cancel>) {
        self.given_up = given_up;
    }

    /// A way to ask beside a thread that reads [`message`](Self::message)s.
    ///
    /// # Errors
    /// The system refuses.
    pub fn sender(&self) -> Result<Sender, ClientError> {
        let stream = self.stream.get_ref().try_clone();
        Ok(Sender {
            stream: stream.map_err(|cause| self.broken(cause))?,
            id: self.id,
        })
    }

    fn answer(&self, mut answer: Value) -> Result<Value, ClientError> {
        let bad = |what: &str| Err(ClientError::BadAnswer { what: what.into() });
        if let Some(error) = answer.get("error") {
            let number = error["code"].as_i64().and_then(|code| i32::try_from(code).ok());
            let message = error["message"].as_str().unwrap_or("no reason given");
            let told = RpcError::new(number.unwrap_or(code::REFUSED), message);
            let data = error.get("data").cloned();
            return Err(ClientError::Refused(RpcError { data, ..told }));
        }
        if answer["id"].as_u64() != Some(self.id) {
            return bad("it belongs to another request");
        }
        match answer.get_mut("result") {
            Some(result) => Ok(result.take()),
            None => bad("it has no result"),
        }
    }
}
