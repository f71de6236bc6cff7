//! JSON-RPC 2.0, one message a line, as clients write and read it.
//!
//! In:  a request; octets of a line of the control. Out: its line; a [`Received`], or why the line is none.

use crate::{Message, Method};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::fmt;

/// Error codes of JSON-RPC 2.0, and our own above them.
pub mod code {
    /// The line is not JSON.
    pub const PARSE: i32 = -32700;
    /// The JSON is not a request.
    pub const INVALID_REQUEST: i32 = -32600;
    /// No such method.
    pub const METHOD_NOT_FOUND: i32 = -32601;
    /// Parameters that the method does not take.
    pub const INVALID_PARAMS: i32 = -32602;
    /// What was asked for cannot be done now.
    pub const REFUSED: i32 = -32000;
    /// A node does not answer, or cannot be asked now.
    pub const NODE: i32 = -32001;
    /// A node has refused it, with an abort code.
    pub const NODE_ABORT: i32 = -32002;
    /// A node does not have the object.
    pub const NODE_NO_OBJECT: i32 = -32003;
    /// Another client has control; who, is in the data.
    pub const NO_CONTROL: i32 = -32004;
    /// The control cannot read this file, which its client may be able to.
    pub const UNREADABLE: i32 = -32005;
    /// The client has not the role for it; which one, is in the data.
    pub const NOT_ALLOWED: i32 = -32006;
}

/// What the control answers instead of what was asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct RpcError {
    /// See [`code`].
    pub code: i32,
    /// What is wrong, and what was expected. Its code and its values travel in the data.
    pub message: Box<Message>,
    /// More of it, for programs.
    pub data: Option<Value>,
}

impl RpcError {
    /// An error with its text.
    pub fn new(code: i32, message: impl Into<Message>) -> RpcError {
        RpcError {
            code,
            message: Box::new(message.into()),
            data: None,
        }
    }

    /// As it travels: code and values of the message are members of the data.
    pub fn to_json(&self) -> Value {
        let mut error = json!({ "code": self.code, "message": self.message.text });
        let mut data = match &self.data {
            Some(Value::Object(data)) => data.clone(),
            Some(_) | None => Map::new(),
        };
        if self.message.is_coded() {
            data.insert("code".into(), json!(self.message.code));
            if !self.message.params.is_empty() {
                data.insert("params".into(), json!(self.message.params));
            }
        }
        if !data.is_empty() {
            error["data"] = Value::Object(data);
        }
        error
    }

    /// What has travelled.
    fn read(error: &mut Value) -> RpcError {
        let number = error["code"].as_i64().and_then(|code| i32::try_from(code).ok());
        let mut message = Message::from(error["message"].as_str().unwrap_or("no reason given"));
        let mut data = match error["data"].take() {
            Value::Object(data) => data,
            _ => Map::new(),
        };
        if let Some(Value::String(code)) = data.remove("code") {
            message.code = code;
            // Those of a newer control may be others.
            let params = data.remove("params").map(serde_json::from_value);
            message.params = params.and_then(Result::ok).unwrap_or_default();
        }
        RpcError {
            code: number.unwrap_or(code::REFUSED),
            message: Box::new(message),
            data: Some(Value::Object(data)).filter(|data| *data != json!({})),
        }
    }

    /// The same with more of it, for programs: members of an object.
    pub fn with_data(self, data: Value) -> RpcError {
        RpcError {
            data: Some(data),
            ..self
        }
    }
}

impl From<Message> for RpcError {
    /// It cannot be done now.
    fn from(why: Message) -> RpcError {
        RpcError::new(code::REFUSED, why)
    }
}

impl From<String> for RpcError {
    /// It cannot be done now.
    fn from(why: String) -> RpcError {
        RpcError::new(code::REFUSED, why)
    }
}

impl fmt::Display for RpcError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message.text)
    }
}

impl std::error::Error for RpcError {}

/// Numbers requests of one connection.
#[derive(Clone, Debug, Default)]
pub struct Requests {
    last: u64,
}

impl Requests {
    /// A request as a line with its end, and the number that its answer has.
    pub fn line<M: Method>(&mut self, params: &M::Params) -> (u64, String) {
        self.untyped(M::NAME, &given(params))
    }

    /// The same for a method that is known by its name only.
    pub fn untyped(&mut self, method: &str, params: &Value) -> (u64, String) {
        self.last += 1;
        let request = json!({ "jsonrpc": "2.0", "id": self.last, "method": method, "params": params });
        (self.last, format!("{request}\n"))
    }
}

/// Parameters as they travel: those that there are.
pub fn given<P: Serialize>(params: &P) -> Value {
    let mut fields = match serde_json::to_value(params) {
        Ok(Value::Object(fields)) => fields,
        // All of them are plain data.
        Ok(_) | Err(_) => Map::new(),
    };
    fields.retain(|_, value| !value.is_null());
    Value::Object(fields)
}

/// What the control says.
#[derive(Clone, Debug, PartialEq)]
pub enum Received {
    /// To a request.
    Answer {
        /// Its number; `None`: the control could not read it.
        id: Option<u64>,
        /// What it came to.
        result: Result<Value, RpcError>,
    },
    /// To a subscriber.
    Notification(Notification),
}

/// What the control says without being asked.
#[derive(Clone, Debug, PartialEq)]
pub struct Notification {
    /// What it is about: `state`, `scope`.
    pub method: String,
    /// A [`StateChange`](crate::StateChange), a [`ScopePart`](crate::ScopePart).
    pub params: Value,
}

impl Received {
    /// Reads a line of the control.
    ///
    /// # Errors
    /// It is none; in words.
    pub fn parse(line: &[u8]) -> Result<Received, String> {
        let mut message: Value = serde_json::from_slice(line).map_err(|error| error.to_string())?;
        if let Some(method) = message.get("method") {
            let method = method.as_str().unwrap_or_default().to_owned();
            let params = message["params"].take();
            return Ok(Received::Notification(Notification { method, params }));
        }
        let id = message["id"].as_u64();
        let result = match message.get_mut("error") {
            Some(error) => Err(RpcError::read(error)),
            None => match message.get_mut("result") {
                Some(result) => Ok(result.take()),
                None => return Err("it has no result".into()),
            },
        };
        Ok(Received::Answer { id, result })
    }
}

/// Octets that come in any pieces, as lines.
#[derive(Debug, Default)]
pub struct Lines {
    octets: Vec<u8>,
    /// Octets that hold no end of a line.
    looked: usize,
}

impl Lines {
    /// Takes in what has come.
    pub fn push(&mut self, octets: &[u8]) {
        self.octets.extend_from_slice(octets);
    }

    /// Octets that wait for the end of their line.
    pub fn waiting(&self) -> usize {
        self.octets.len()
    }

    /// The next line, if a whole one has come.
    pub fn next_line(&mut self) -> Option<Vec<u8>> {
        match self.octets[self.looked..].iter().position(|octet| *octet == b'\n') {
            Some(end) => {
                let end = std::mem::take(&mut self.looked) + end;
                Some(self.octets.drain(..=end).collect())
            }
            None => {
                self.looked = self.octets.len();
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{method, params};
    use proptest::prelude::*;

    #[test]
    fn a_request_is_one_line_with_what_is_given() {
        let mut requests = Requests::default();
        let begin = params::ProgramStart {
            from_line: Some(7),
            ..Default::default()
        };
        let (id, line) = requests.line::<method::ProgramStart>(&begin);
        assert_eq!(id, 1);
        assert_eq!(
            line,
            "{\"id\":1,\"jsonrpc\":\"2.0\",\"method\":\"program.start\",\"params\":{\"from_line\":7}}\n"
        );
        assert_eq!(requests.line::<method::Ping>(&params::NoParams {}).0, 2);
    }

    #[test]
    fn what_the_control_says_is_an_answer_or_a_notification() {
        let read = |line: &str| Received::parse(line.as_bytes());
        let done = Received::Answer {
            id: Some(3),
            result: Ok(json!({})),
        };
        assert_eq!(read("{\"id\":3,\"result\":{}}\n"), Ok(done));
        let told = read("{\"id\":null,\"error\":{\"code\":-32004,\"message\":\"no\",\"data\":{\"holder\":\"x\"}}}");
        let error = RpcError::new(code::NO_CONTROL, "no").with_data(json!({ "holder": "x" }));
        assert_eq!(
            told,
            Ok(Received::Answer {
                id: None,
                result: Err(error)
            })
        );
        let state = Received::Notification(Notification {
            method: "state".into(),
            params: json!({ "changed": { "line": 7 } }),
        });
        assert_eq!(
            read("{\"method\":\"state\",\"params\":{\"changed\":{\"line\":7}}}"),
            Ok(state)
        );
        assert_eq!(read("{\"id\":3}"), Err("it has no result".into()));
        assert!(read("{").is_err());
    }

    proptest! {
        #[test]
        fn lines_come_out_whole_in_any_pieces(text in "[a-z\n]{0,60}", at in prop::collection::vec(0..60_usize, 0..5)) {
            let mut lines = Lines::default();
            let mut cuts: Vec<usize> = at.into_iter().filter(|at| *at < text.len()).chain([0, text.len()]).collect();
            cuts.sort_unstable();
            let mut all = Vec::new();
            for part in cuts.windows(2) {
                lines.push(&text.as_bytes()[part[0]..part[1]]);
                while let Some(line) = lines.next_line() {
                    all.extend(line);
                }
            }
            let whole = text.rfind('\n').map_or(0, |end| end + 1);
            prop_assert_eq!(&all[..], &text.as_bytes()[..whole]);
            prop_assert_eq!(lines.waiting(), text.len() - whole);
            let _ = Received::parse(text.as_bytes());
        }
    }
}
