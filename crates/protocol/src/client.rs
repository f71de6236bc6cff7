//! The other end of the socket, for whoever may wait: requests one after the other, notifications between them.
//!
//! In:  a connection to a control. Out: answers and notifications with their types, or why there are none.

use crate::answers::{Fields, Status};
use crate::limits::PART_MAX;
use crate::method::{self, Method};
use crate::params::{self, Hex};
use crate::rpc::{Lines, Notification, Received, Requests, RpcError, given};
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, poll};
use nix::sys::socket::{MsgFlags, send};
use serde::de::DeserializeOwned;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::VecDeque;
use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::net::Shutdown;
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest wait for an answer: more than a node is given for an SDO.
const ANSWER_WAIT: Duration = Duration::from_secs(30);
/// The same where a program is checked first, which may take as long as it may be interpreted, and a little.
pub const CHECK_WAIT: Duration = Duration::from_secs(700);
/// Octets of the longest answer.
const ANSWER_MAX: usize = 64 << 20;
/// Octets that are read at once.
const CHUNK: usize = 16 << 10;
/// Between two looks whether someone still waits, ms: a signal does not end a read.
const SLICE_MS: u8 = 100;

/// Why a control gave no answer.
#[derive(Debug)]
pub enum ClientError {
    /// No control runs, or none of this name.
    NotRunning {
        /// The machine that was asked for.
        machine: Option<String>,
    },
    /// Several controls run.
    Several {
        /// Their names.
        machines: Vec<String>,
    },
    /// The socket failed.
    Io {
        /// Its path.
        path: PathBuf,
        /// How.
        cause: io::Error,
    },
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
                "several controls are running: choose one with --machine or ISOCNC_MACHINE: {}",
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
    /// An answer that is none.
    pub fn bad(what: impl Into<String>) -> ClientError {
        ClientError::BadAnswer { what: what.into() }
    }
}

/// An answer or a notification with its type.
///
/// # Errors
/// It lacks something, or is something else.
pub fn read<T: DeserializeOwned>(value: Value) -> Result<T, ClientError> {
    serde_json::from_value(value).map_err(|error| ClientError::bad(error.to_string()))
}

/// Asks for things and waits for nothing.
#[derive(Debug)]
pub struct Sender {
    stream: UnixStream,
    requests: Requests,
}

impl Sender {
    /// Asks for something.
    ///
    /// # Errors
    /// The control has gone, or does not read.
    pub fn send(&mut self, method: &str, params: &Value) -> io::Result<()> {
        let (_, line) = self.requests.untyped(method, params);
        let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
        match send(self.stream.as_raw_fd(), line.as_bytes(), flags)? {
            sent if sent == line.len() => Ok(()),
            // What follows would be part of this line.
            _ => self.stream.shutdown(Shutdown::Both),
        }
    }
}

/// Whether whoever asked has stopped waiting.
type GivenUp = Box<dyn Fn() -> bool + Send>;

/// A connection to a control.
pub struct Client {
    /// For messages.
    path: PathBuf,
    stream: UnixStream,
    lines: Lines,
    requests: Requests,
    /// Notifications that came before an answer.
    notifications: VecDeque<Notification>,
    patience: Option<Duration>,
    given_up: Option<GivenUp>,
}

impl fmt::Debug for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Client")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

impl Client {
    /// Over a connection; `path`: what it is called in messages.
    ///
    /// # Errors
    /// Of the system.
    pub fn new(stream: UnixStream, path: &Path) -> io::Result<Client> {
        stream.set_nonblocking(false)?;
        stream.set_write_timeout(Some(ANSWER_WAIT))?;
        Ok(Client {
            path: path.to_owned(),
            stream,
            lines: Lines::default(),
            requests: Requests::default(),
            notifications: VecDeque::new(),
            patience: None,
            given_up: None,
        })
    }

    /// Waits so long for every answer: without it, as long as the method may take.
    pub fn with_patience(self, patience: Duration) -> Client {
        Client {
            patience: Some(patience),
            ..self
        }
    }

    /// Calls a method and waits for its answer.
    ///
    /// # Errors
    /// The control has gone, refuses, or answers something else.
    pub fn ask<M: Method>(&mut self, params: &M::Params) -> Result<M::Answer, ClientError> {
        read(self.call(M::NAME, given(params))?)
    }

    /// The same of a method that is known by its name only.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub fn call(&mut self, method: &str, params: Value) -> Result<Value, ClientError> {
        let (id, line) = self.requests.untyped(method, &params);
        let written = self.stream.write_all(line.as_bytes());
        written.map_err(|cause| self.broken(cause))?;
        let wait = match method {
            "program.load" | "program.run" | "program.start" | "mdi" => CHECK_WAIT,
            _ => ANSWER_WAIT,
        };
        let until = Instant::now() + self.patience.unwrap_or(wait);
        loop {
            match self.message_until(until)? {
                None => return Err(self.broken(ErrorKind::WouldBlock.into())),
                Some(Received::Notification(notification)) => self.notifications.push_back(notification),
                Some(Received::Answer { result: Err(error), .. }) => return Err(ClientError::Refused(error)),
                Some(Received::Answer { id: of, .. }) if of != Some(id) => {
                    return Err(ClientError::bad("it belongs to another request"));
                }
                Some(Received::Answer { result: Ok(result), .. }) => return Ok(result),
            }
        }
    }

    /// Sends a program in parts; gives the number of the upload.
    ///
    /// # Errors
    /// As [`ask`](Self::ask); the program cannot be read.
    pub fn upload(&mut self, name: &str, mut program: impl Read, octets: u64) -> Result<u64, ClientError> {
        let name = name.to_owned();
        let begun = self.ask::<method::UploadBegin>(&params::UploadBegin { name, octets })?;
        let upload = begun.upload;
        let mut part = vec![0; begun.part_octets.clamp(1, PART_MAX)];
        let (mut at, mut sum) = (0, Sha256::new());
        loop {
            let count = program.read(&mut part).map_err(|cause| self.broken(cause))?;
            if count == 0 {
                break;
            }
            let value = Hex(part[..count].to_vec());
            self.ask::<method::UploadAppend>(&params::UploadAppend { upload, at, value })?;
            sum.update(&part[..count]);
            at += count as u64;
        }
        let sha256 = Hex(sum.finalize().to_vec());
        self.ask::<method::UploadCommit>(&params::UploadCommit { upload, sha256 })?;
        Ok(upload)
    }

    /// The next notification of a control that was subscribed to; waits for it.
    ///
    /// # Errors
    /// The control has gone, or says nothing.
    pub fn notification(&mut self) -> Result<Notification, ClientError> {
        let until = Instant::now() + self.patience.unwrap_or(ANSWER_WAIT);
        match self.notification_until(until)? {
            Some(notification) => Ok(notification),
            None => Err(self.broken(ErrorKind::WouldBlock.into())),
        }
    }

    /// The next notification, if one comes until then.
    ///
    /// # Errors
    /// The control has gone.
    pub fn notification_until(&mut self, until: Instant) -> Result<Option<Notification>, ClientError> {
        if let Some(notification) = self.notifications.pop_front() {
            return Ok(Some(notification));
        }
        loop {
            match self.message_until(until)? {
                Some(Received::Notification(notification)) => return Ok(Some(notification)),
                // Of a request that is not waited for.
                Some(Received::Answer { .. }) => {}
                None => return Ok(None),
            }
        }
    }

    /// The next message, whatever it is; waits for it.
    ///
    /// # Errors
    /// The control has gone, or says nothing.
    pub fn message(&mut self) -> Result<Received, ClientError> {
        let until = Instant::now() + self.patience.unwrap_or(ANSWER_WAIT);
        let message = self.message_until(until)?;
        message.ok_or_else(|| self.broken(ErrorKind::WouldBlock.into()))
    }

    fn message_until(&mut self, until: Instant) -> Result<Option<Received>, ClientError> {
        loop {
            if let Some(line) = self.lines.next_line() {
                return Received::parse(&line).map(Some).map_err(ClientError::bad);
            }
            if self.lines.waiting() > ANSWER_MAX {
                return Err(ClientError::bad("it is a line without an end"));
            }
            if !self.is_readable(until)? {
                return Ok(None);
            }
            let mut chunk = [0; CHUNK];
            match self.stream.read(&mut chunk) {
                Ok(0) => return Err(ClientError::bad("the control has closed the connection")),
                Ok(count) => self.lines.push(&chunk[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(cause) => return Err(self.broken(cause)),
            }
        }
    }

    /// Waits until there is something to read; false: nothing has come until then.
    fn is_readable(&self, until: Instant) -> Result<bool, ClientError> {
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let slice_ms = left.as_micros().div_ceil(1000).min(u128::from(SLICE_MS)) as u8;
            let mut fd = [PollFd::new(self.stream.as_fd(), PollFlags::POLLIN)];
            match poll(&mut fd, slice_ms) {
                Ok(0) | Err(Errno::EINTR) => {}
                // What is wrong with it, the read says.
                Ok(_) | Err(_) => return Ok(true),
            }
            if self.given_up.as_ref().is_some_and(|given_up| given_up()) {
                return Err(ClientError::GivenUp);
            }
            if left.is_zero() {
                return Ok(false);
            }
        }
    }

    /// Answers are not waited for any longer once this is so; what was asked is withdrawn as the connection ends.
    pub fn wait_unless(&mut self, given_up: Option<GivenUp>) {
        self.given_up = given_up;
    }

    /// A way to ask next to a thread that reads [`message`](Self::message)s.
    ///
    /// # Errors
    /// The system refuses.
    pub fn sender(&self) -> Result<Sender, ClientError> {
        let stream = self.stream.try_clone();
        Ok(Sender {
            stream: stream.map_err(|cause| self.broken(cause))?,
            requests: self.requests.clone(),
        })
    }

    fn broken(&self, cause: io::Error) -> ClientError {
        ClientError::Io {
            path: self.path.clone(),
            cause,
        }
    }
}

/// The status of a control as a subscriber knows it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Followed {
    fields: Fields,
    status: Status,
}

impl Followed {
    /// As it was told as a whole.
    pub fn new(status: Status) -> Followed {
        let fields = match serde_json::to_value(&status) {
            Ok(Value::Object(fields)) => fields,
            // It is plain data.
            Ok(_) | Err(_) => Fields::new(),
        };
        Followed { fields, status }
    }

    /// As it is with these changes.
    ///
    /// # Errors
    /// They make it no status: nothing has changed then.
    pub fn change(&mut self, changed: Fields) -> Result<(), ClientError> {
        let mut fields = self.fields.clone();
        fields.extend(changed);
        self.status = read(Value::Object(fields.clone()))?;
        self.fields = fields;
        Ok(())
    }

    /// How everything is.
    pub fn status(&self) -> &Status {
        &self.status
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rpc::code;
    use serde_json::json;
    use std::io::{BufRead, BufReader};

    /// Answers each line with these ones.
    fn control(answers: Vec<&'static str>) -> Client {
        let (near, far) = UnixStream::pair().unwrap();
        std::thread::spawn(move || {
            let mut lines = BufReader::new(far.try_clone().unwrap());
            let mut far = far;
            for answer in answers {
                lines.read_line(&mut String::new()).unwrap();
                far.write_all(answer.as_bytes()).unwrap();
            }
        });
        Client::new(near, Path::new("test")).unwrap()
    }

    #[test]
    fn answers_come_with_their_types_and_notifications_between_them_are_kept() {
        let mut client = control(vec![
            "{\"method\":\"state\",\"params\":{\"changed\":{\"line\":7}}}\n{\"id\":1,\"result\":{\"text\":\"x 1\"}}\n",
            "{\"id\":2,\"error\":{\"code\":-32000,\"message\":\"not homed\"}}\n",
            "{\"id\":3,\"result\":{}}\n",
            "{\"id\":3,\"result\":{}}\n",
        ]);
        let none = params::NoParams {};
        assert_eq!(client.ask::<method::Metrics>(&none).unwrap().text, "x 1");
        let told = client.notification().unwrap();
        assert_eq!(
            (told.method.as_str(), told.params),
            ("state", json!({ "changed": { "line": 7 } }))
        );
        match client.ask::<method::Home>(&params::Home::default()) {
            Err(ClientError::Refused(error)) => assert_eq!(error, RpcError::new(code::REFUSED, "not homed")),
            other => panic!("{other:?}"),
        }
        let bad = client.ask::<method::Metrics>(&none).unwrap_err().to_string();
        assert_eq!(bad, "the control's answer cannot be understood: missing field `text`");
        let bad = client.ask::<method::Ping>(&none).unwrap_err().to_string();
        assert!(bad.ends_with("it belongs to another request"), "{bad}");
        let gone = client.ask::<method::Ping>(&none).unwrap_err();
        assert!(
            matches!(gone, ClientError::BadAnswer { .. } | ClientError::Io { .. }),
            "{gone}"
        );
    }

    #[test]
    fn a_control_that_says_nothing_is_waited_for_until_then_or_until_no_one_waits() {
        let (near, _far) = UnixStream::pair().unwrap();
        let mut client = Client::new(near, Path::new("test")).unwrap();
        assert_eq!(client.notification_until(Instant::now()).unwrap(), None);
        client.wait_unless(Some(Box::new(|| true)));
        assert!(matches!(client.call("ping", json!({})), Err(ClientError::GivenUp)));
        client.wait_unless(None);
        let mut client = client.with_patience(Duration::ZERO);
        let late = client.call("ping", json!({})).unwrap_err().to_string();
        assert_eq!(late, "test: no answer in time");
    }

    #[test]
    fn changes_on_changes_give_the_status() {
        let mut followed = Followed::new(Status::default());
        let fields = |value: Value| value.as_object().cloned().unwrap();
        followed
            .change(fields(json!({ "line": 7, "alarm": { "text": "x" } })))
            .unwrap();
        followed.change(fields(json!({ "alarm": null }))).unwrap();
        assert_eq!((followed.status().line, &followed.status().alarm), (7, &None));
        assert!(followed.change(fields(json!({ "line": "seven" }))).is_err());
        assert_eq!(followed.status().line, 7);
    }
}
