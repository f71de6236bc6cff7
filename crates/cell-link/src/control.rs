//! The control as the link sees it: one of its clients.
//!
//! In:  a connection to it. Out: answers, and its state as it is now.

use protocol::client::{CHECK_WAIT, Followed};
use protocol::rpc::{Notification, given};
use protocol::{ClientError, Method, StateChange, Status, method, params};
use serde_json::Value;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

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

impl From<ClientError> for Refused {
    fn from(error: ClientError) -> Refused {
        match error {
            ClientError::Refused(refused) => Refused::ByControl(refused.message.text),
            error => Refused::Gone(error.to_string()),
        }
    }
}

/// A control, as one of its clients.
pub trait Control: Send {
    /// The result of a method.
    ///
    /// # Errors
    /// It was refused, or the control has ended.
    fn call(&mut self, method: &str, params: Value) -> Result<Value, Refused>;

    /// Waits until the state has changed, so long at the most; gives the state.
    ///
    /// # Errors
    /// The control has ended.
    fn wait(&mut self, longest: Duration) -> Result<&Status, Refused>;
}

impl dyn Control + '_ {
    /// The answer of a method, with its type.
    ///
    /// # Errors
    /// It was refused, or the control has ended or answers something else.
    pub fn ask<M: Method>(&mut self, params: &M::Params) -> Result<M::Answer, Refused> {
        let answer = self.call(M::NAME, given(params))?;
        Ok(protocol::client::read(answer)?)
    }
}

/// A client over a connection.
#[derive(Debug)]
pub struct Client {
    control: protocol::Client,
    state: Followed,
    is_changed: bool,
}

impl Client {
    /// Takes up a connection, and subscribes to the state where that is wanted.
    ///
    /// # Errors
    /// The control has ended.
    pub fn new(stream: UnixStream, subscribe: bool) -> Result<Client, Refused> {
        let control = protocol::Client::new(stream, Path::new("the control"));
        let mut control = control
            .map_err(|cause| Refused::Gone(cause.to_string()))?
            // Any method may wait for the check of a long program.
            .with_patience(CHECK_WAIT);
        let mut state = Followed::default();
        if subscribe {
            let once_a_second = params::Subscribe { rate_hz: Some(1) };
            state = Followed::new(control.ask::<method::Subscribe>(&once_a_second)?.state);
        }
        Ok(Client {
            control,
            state,
            is_changed: true,
        })
    }

    fn note(&mut self, notification: Notification) -> Result<(), Refused> {
        if notification.method == "state" {
            let change: StateChange = protocol::client::read(notification.params)?;
            self.state.change(change.changed)?;
            self.is_changed = true;
        }
        Ok(())
    }
}

impl Control for Client {
    fn call(&mut self, method: &str, params: Value) -> Result<Value, Refused> {
        Ok(self.control.call(method, params)?)
    }

    fn wait(&mut self, longest: Duration) -> Result<&Status, Refused> {
        let until = Instant::now() + longest;
        loop {
            let until = if self.is_changed { Instant::now() } else { until };
            match self.control.notification_until(until)? {
                Some(notification) => self.note(notification)?,
                None => break,
            }
        }
        self.is_changed = false;
        Ok(self.state.status())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::io::{BufRead, BufReader, Write};

    /// Answers each line with these ones.
    fn control(answers: Vec<String>) -> UnixStream {
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
        let state = Status {
            state: protocol::State::Ready,
            line: 1,
            ..Status::default()
        };
        let change = json!({ "monotonic_s": 1.5, "unix_s": 1e9, "changed": { "line": 7 } });
        let stream = control(vec![
            format!(
                "{}\n",
                json!({ "id": 1, "result": { "monotonic_s": 1.0, "unix_s": 1e9, "state": state } })
            ),
            format!(
                "{}\n{{\"id\":2,\"result\":3}}\n",
                json!({ "method": "state", "params": change })
            ),
            "{\"id\":3,\"error\":{\"code\":-32000,\"message\":\"not homed\"}}\n".into(),
        ]);
        let mut client = Client::new(stream, true).unwrap();
        assert_eq!(client.wait(Duration::ZERO).unwrap().line, 1);
        assert_eq!(client.call("x", json!({})), Ok(json!(3)));
        let state = client.wait(Duration::from_secs(60)).unwrap();
        assert_eq!((state.line, state.state), (7, protocol::State::Ready));
        assert_eq!(client.call("y", json!({})), Err(Refused::ByControl("not homed".into())));
        assert!(matches!(client.call("z", json!({})), Err(Refused::Gone(_))));
    }
}
