//! The control as the link sees it: one of its clients.
//!
//! In:  a connection to it: JSON-RPC 2.0, one message a line. Out: answers, and its state as it is now.

use serde_json::{Map, Value, json};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

/// Longest wait for an answer: that of the check of a long program.
const ANSWER_WAIT: Duration = Duration::from_secs(700);
/// Longest line of the control, octets.
const LINE_MAX: usize = 16 << 20;

/// Why the control did not do something; in its words.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// It refused, or said what is wrong.
    #[error("{0}")]
    ByControl(String),
    /// It is there no more.
    #[error("the control has ended: {0}")]
    Gone(String),
}

/// A control, as one of its clients.
pub trait Control: Send {
    /// The result of a method.
    ///
    /// # Errors
    /// It was refused, or the control has ended.
    fn ask(&mut self, method: &str, params: Value) -> Result<Value, Refused>;

    /// Waits until the state has changed, so long at the most; gives the state, as `status` has it.
    ///
    /// # Errors
    /// The control has ended.
    fn wait(&mut self, longest: Duration) -> Result<&Map<String, Value>, Refused>;
}

/// A client over a connection.
#[derive(Debug)]
pub struct Client {
    stream: UnixStream,
    read: Vec<u8>,
    /// Octets of `read` that hold no end of a line.
    looked: usize,
    last_id: u64,
    state: Map<String, Value>,
    is_changed: bool,
}

impl Client {
    /// Takes up a connection, and subscribes to the state where that is wanted.
    ///
    /// # Errors
    /// The control has ended.
    pub fn new(stream: UnixStream, subscribe: bool) -> Result<Client, Refused> {
        let mut client = Client {
            stream,
            read: Vec::new(),
            looked: 0,
            last_id: 0,
            state: Map::new(),
            is_changed: true,
        };
        client.stream.set_nonblocking(false).map_err(gone)?;
        if subscribe {
            let mut answer = client.ask("subscribe", json!({ "rate_hz": 1 }))?;
            if let Value::Object(state) = answer["state"].take() {
                client.state = state;
            }
        }
        Ok(client)
    }

    /// The next message, until then.
    fn message(&mut self, until: Instant) -> Result<Option<Value>, Refused> {
        loop {
            if let Some(end) = self.read[self.looked..].iter().position(|octet| *octet == b'\n') {
                let end = self.looked + end;
                let line: Vec<u8> = self.read.drain(..=end).collect();
                self.looked = 0;
                return serde_json::from_slice(&line).map(Some).map_err(gone);
            }
            self.looked = self.read.len();
            if self.read.len() > LINE_MAX {
                return Err(gone("it sends a line without an end"));
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.stream.set_read_timeout(Some(left)).map_err(gone)?;
            let mut chunk = [0; 16 << 10];
            match self.stream.read(&mut chunk) {
                Ok(0) => return Err(gone("the connection is closed")),
                Ok(count) => self.read.extend_from_slice(&chunk[..count]),
                Err(error) if is_time_up(&error) => {}
                Err(error) => return Err(gone(error)),
            }
        }
    }

    fn note(&mut self, mut notification: Value) {
        if notification["method"] != "state" {
            return;
        }
        if let Value::Object(changed) = notification["params"]["changed"].take() {
            self.state.extend(changed);
            self.is_changed = true;
        }
    }
}

impl Control for Client {
    fn ask(&mut self, method: &str, params: Value) -> Result<Value, Refused> {
        self.last_id += 1;
        let id = self.last_id;
        let request = json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params });
        self.stream.write_all(format!("{request}\n").as_bytes()).map_err(gone)?;
        let until = Instant::now() + ANSWER_WAIT;
        loop {
            let Some(mut message) = self.message(until)? else {
                return Err(gone(format!("no answer to {method}")));
            };
            if message["id"] != id {
                self.note(message);
                continue;
            }
            let Some(error) = message.get("error") else {
                return Ok(message["result"].take());
            };
            let text = error["message"].as_str().unwrap_or("refused without a word");
            return Err(Refused::ByControl(text.to_owned()));
        }
    }

    fn wait(&mut self, longest: Duration) -> Result<&Map<String, Value>, Refused> {
        let until = Instant::now() + longest;
        while !self.is_changed {
            match self.message(until)? {
                Some(message) => self.note(message),
                None => break,
            }
        }
        self.is_changed = false;
        Ok(&self.state)
    }
}

fn gone(cause: impl ToString) -> Refused {
    Refused::Gone(cause.to_string())
}

fn is_time_up(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};

    /// Answers each line with these ones.
    fn control(answers: Vec<&'static str>) -> UnixStream {
        let (near, far) = UnixStream::pair().unwrap();
        std::thread::spawn(move || {
            let mut lines = BufReader::new(far.try_clone().unwrap());
            let mut far = far;
            for answer in answers {
                lines.read_line(&mut String::new()).unwrap();
                far.write_all(answer.as_bytes()).unwrap();
            }
        });
        near
    }

    #[test]
    fn notifications_between_answers_change_the_state() {
        let stream = control(vec![
            "{\"id\":1,\"result\":{\"state\":{\"state\":\"ready\",\"line\":1}}}\n",
            "{\"method\":\"state\",\"params\":{\"changed\":{\"line\":7}}}\n{\"id\":2,\"result\":3}\n",
            "{\"id\":3,\"error\":{\"code\":-32000,\"message\":\"not homed\"}}\n",
        ]);
        let mut client = Client::new(stream, true).unwrap();
        assert_eq!(client.wait(Duration::ZERO).unwrap()["line"], 1);
        assert_eq!(client.ask("x", json!({})), Ok(json!(3)));
        let state = client.wait(Duration::from_secs(60)).unwrap();
        assert_eq!((&state["line"], &state["state"]), (&json!(7), &json!("ready")));
        assert_eq!(client.ask("y", json!({})), Err(Refused::ByControl("not homed".into())));
        assert!(matches!(client.ask("z", json!({})), Err(Refused::Gone(_))));
    }
}
