//! The panel itself as a client of the control: what it asks for pages that are no WebSocket.

use crate::serve::Panel;
use crate::{Guest, Role};
use serde_json::{Value, json};
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::time::timeout;

/// Longest wait for an answer: that of the check of a long program.
const WAIT: Duration = Duration::from_secs(700);

/// A connection with one request at a time.
pub(crate) struct Asker {
    answers: BufReader<OwnedReadHalf>,
    requests: OwnedWriteHalf,
}

impl Asker {
    /// As a client that may do this.
    pub(crate) fn new(panel: &Panel, role: Role, name: &str) -> Result<Asker, String> {
        let guest = Guest {
            role,
            name: name.to_owned(),
        };
        let connected = panel.control.connect(&guest).and_then(|stream| {
            stream.set_nonblocking(true)?;
            UnixStream::from_std(stream)
        });
        let (answers, requests) = connected.map_err(|cause| cause.to_string())?.into_split();
        Ok(Asker {
            answers: BufReader::new(answers),
            requests,
        })
    }

    /// The result of a method.
    ///
    /// # Errors
    /// It was refused, in the words of the control; or the control has ended.
    pub(crate) async fn ask(&mut self, method: &str, params: Value) -> Result<Value, String> {
        let ended = || "the control is ending, or serves too many".to_owned();
        let request = json!({ "jsonrpc": "2.0", "id": 1, "method": method, "params": params });
        let line = format!("{request}\n");
        let asked = async {
            self.requests.write_all(line.as_bytes()).await.ok()?;
            let mut answer = Vec::new();
            self.answers.read_until(b'\n', &mut answer).await.ok()?;
            serde_json::from_slice::<Value>(&answer).ok()
        };
        let answer = timeout(WAIT, asked).await.ok().flatten();
        let mut answer = answer.ok_or_else(ended)?;
        match answer.get("error").and_then(|error| error.get("message")) {
            Some(message) => Err(message.as_str().unwrap_or_default().to_owned()),
            None => Ok(answer["result"].take()),
        }
    }
}
