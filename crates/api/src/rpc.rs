//! JSON-RPC 2.0, one message a line: what stands in a line, and the line that answers it.
//!
//! In:  octets of one line from a client, whatever they are.
//! Out: a [`Request`], or the error that goes back. Batches and parameters by position are refused by name.

use protocol::params::Hex;
use serde::Serialize;
use serde_json::{Map, Value, json};

pub use protocol::rpc::{RpcError, code};

/// What a client asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Comes back with the answer; `None`: a notification, which gets no answer.
    pub id: Option<Value>,
    pub method: String,
    pub params: Params,
}

/// Parameters by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Params(pub Map<String, Value>);

impl Params {
    /// Refuses what is not in the list.
    pub fn only(&self, known: &[&str]) -> Result<(), RpcError> {
        let Some(name) = self.0.keys().find(|name| !known.contains(&name.as_str())) else {
            return Ok(());
        };
        let known = match known {
            [] => "it takes none".to_owned(),
            known => format!("known are {}", known.join(", ")),
        };
        Err(invalid(format!("unknown parameter \"{name}\": {known}")))
    }

    /// A whole number within limits.
    pub fn number(&self, name: &str, least: u64, most: u64) -> Result<u64, RpcError> {
        let expected = || format!("parameter \"{name}\": expected a whole number from {least} to {most}");
        let value = self
            .0
            .get(name)
            .ok_or_else(|| invalid(format!("{}, it is missing", expected())))?;
        value
            .as_u64()
            .filter(|number| (least..=most).contains(number))
            .ok_or_else(|| invalid(format!("{}, got {value}", expected())))
    }

    /// Whether a parameter is given.
    pub fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// A number, if it is given.
    pub fn real(&self, name: &str) -> Result<Option<f64>, RpcError> {
        let Some(value) = self.0.get(name) else {
            return Ok(None);
        };
        let number = value.as_f64().filter(|number| number.is_finite());
        number
            .map(Some)
            .ok_or_else(|| invalid(format!("parameter \"{name}\": expected a number, got {value}")))
    }

    /// Whole numbers in a list; none where it is missing.
    ///
    /// # Errors
    /// It is no list of numbers within these limits.
    pub fn numbers(&self, name: &str, least: u64, most: u64) -> Result<Vec<u64>, RpcError> {
        let wrong = |got: &Value| {
            let what = format!("parameter \"{name}\": expected a list of numbers, {least} to {most}, got {got}");
            RpcError::new(code::INVALID_PARAMS, what)
        };
        match self.0.get(name) {
            None => Ok(Vec::new()),
            Some(list) => {
                let numbers = list.as_array().ok_or_else(|| wrong(list))?.iter();
                numbers
                    .map(|number| {
                        let found = number.as_u64().filter(|number| (least..=most).contains(number));
                        found.ok_or_else(|| wrong(number))
                    })
                    .collect()
            }
        }
    }

    /// A text, if it is given.
    pub fn text(&self, name: &str) -> Result<Option<&str>, RpcError> {
        let Some(value) = self.0.get(name) else {
            return Ok(None);
        };
        let text = value.as_str();
        text.map(Some)
            .ok_or_else(|| invalid(format!("parameter \"{name}\": expected a text, got {value}")))
    }

    /// Texts in a list.
    ///
    /// # Errors
    /// It is missing, is no list of texts, is empty, or has more than `most`.
    pub fn texts(&self, name: &str, most: usize) -> Result<Vec<String>, RpcError> {
        let expected = || format!("parameter \"{name}\": expected a list of 1 to {most} texts");
        let value = self
            .0
            .get(name)
            .ok_or_else(|| invalid(format!("{}, it is missing", expected())))?;
        let texts = value.as_array().filter(|list| (1..=most).contains(&list.len()));
        let texts = texts.and_then(|list| list.iter().map(|text| text.as_str().map(str::to_owned)).collect());
        texts.ok_or_else(|| invalid(format!("{}, got {value}", expected())))
    }

    /// Yes or no.
    pub fn flag(&self, name: &str) -> Result<bool, RpcError> {
        let expected = || format!("parameter \"{name}\": expected true or false");
        let value = self
            .0
            .get(name)
            .ok_or_else(|| invalid(format!("{}, it is missing", expected())))?;
        value
            .as_bool()
            .ok_or_else(|| invalid(format!("{}, got {value}", expected())))
    }

    /// Octets as hexadecimal digits: `"10270000"`.
    pub fn octets(&self, name: &str, most: usize) -> Result<Vec<u8>, RpcError> {
        let expected = || format!("parameter \"{name}\": expected up to {most} octets as pairs of hexadecimal digits");
        let value = self
            .0
            .get(name)
            .ok_or_else(|| invalid(format!("{}, it is missing", expected())))?;
        value
            .as_str()
            .and_then(from_hex)
            .filter(|octets| octets.len() <= most)
            .ok_or_else(|| invalid(format!("{}, got {value}", expected())))
    }
}

fn invalid(message: String) -> RpcError {
    RpcError::new(code::INVALID_PARAMS, message)
}

/// Reads pairs of hexadecimal digits; `None` for anything else.
pub fn from_hex(text: &str) -> Option<Vec<u8>> {
    Hex::parse(text).map(|octets| octets.0)
}

/// Octets as Base64 (RFC 4648, with padding).
pub fn to_base64(octets: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(octets.len().div_ceil(3) * 4);
    for group in octets.chunks(3) {
        let bits = (0..3).fold(0, |bits, at| bits << 8 | u32::from(group.get(at).copied().unwrap_or(0)));
        for digit in 0..4 {
            text.push(match digit <= group.len() {
                true => char::from(DIGITS[(bits >> (18 - 6 * digit) & 63) as usize]),
                false => '=',
            });
        }
    }
    text
}

/// Octets as pairs of hexadecimal digits.
pub fn to_hex(octets: &[u8]) -> String {
    octets.iter().map(|octet| format!("{octet:02x}")).collect()
}

/// Reads one line.
///
/// # Errors
/// The id to answer to (null where none can be read) and what is wrong.
pub fn parse(line: &[u8]) -> Result<Request, (Value, RpcError)> {
    let value: Value = serde_json::from_slice(line)
        .map_err(|error| (Value::Null, RpcError::new(code::PARSE, format!("no JSON: {error}"))))?;
    let mut object = match value {
        Value::Object(object) => object,
        Value::Array(_) => {
            let what = "a batch is not served: one request a line";
            return Err((Value::Null, RpcError::new(code::INVALID_REQUEST, what)));
        }
        _ => {
            let what = "expected an object with \"jsonrpc\", \"method\" and \"id\"";
            return Err((Value::Null, RpcError::new(code::INVALID_REQUEST, what)));
        }
    };
    let id = object.remove("id");
    let refuse = |id: &Option<Value>, what: &str| {
        let id = match id {
            Some(id) if is_id(id) => id.clone(),
            _ => Value::Null,
        };
        Err((id, RpcError::new(code::INVALID_REQUEST, what)))
    };
    if id.as_ref().is_some_and(|id| !is_id(id)) {
        return refuse(&id, "\"id\": expected a number, a text or null");
    }
    if object.get("jsonrpc") != Some(&json!("2.0")) {
        return refuse(&id, "\"jsonrpc\": expected \"2.0\"");
    }
    let Some(Value::String(method)) = object.remove("method") else {
        return refuse(&id, "\"method\": expected the name of a method");
    };
    let params = match object.remove("params") {
        None => Map::new(),
        Some(Value::Object(params)) => params,
        Some(_) => {
            let what = invalid("\"params\": expected an object, parameters go by name".into());
            return Err((id.unwrap_or(Value::Null), what));
        }
    };
    Ok(Request {
        id,
        method,
        params: Params(params),
    })
}

fn is_id(id: &Value) -> bool {
    matches!(id, Value::Number(_) | Value::String(_) | Value::Null)
}

/// The line that answers a request, with its end.
pub fn answer(id: &Value, result: Result<Value, RpcError>) -> String {
    let message = match result {
        Ok(result) => json!({ "jsonrpc": "2.0", "id": id, "result": result }),
        Err(error) => json!({ "jsonrpc": "2.0", "id": id, "error": error.to_json() }),
    };
    format!("{message}\n")
}

/// The line of a message that nobody asked for, with its end.
pub fn notification(method: &str, params: &impl Serialize) -> String {
    format!("{}\n", json!({ "jsonrpc": "2.0", "method": method, "params": params }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_rfc_4648() {
        let told = ["", "f", "fo", "foo", "foob", "fooba", "foobar"].map(|text| to_base64(text.as_bytes()));
        assert_eq!(told, ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"]);
        assert_eq!(to_base64(&[0xFB, 0xEF, 0xBE, 0xFF]), "++++/w==");
    }
    use proptest::prelude::*;

    #[test]
    fn requests_and_notifications() {
        let request = parse(br#"{"jsonrpc":"2.0","id":7,"method":"status"}"#).unwrap();
        assert_eq!((request.id, request.method.as_str()), (Some(json!(7)), "status"));
        assert!(request.params.0.is_empty());
        let request = parse(br#"{"jsonrpc":"2.0","method":"bus.sdo_read","params":{"node":3}}"#).unwrap();
        assert_eq!(request.id, None);
        assert_eq!(request.params.number("node", 1, 239), Ok(3));
    }

    #[test]
    fn what_is_no_request_says_why() {
        for (line, id, code, message) in [
            (
                "",
                json!(null),
                code::PARSE,
                "no JSON: EOF while parsing a value at line 1 column 0",
            ),
            (
                "{",
                json!(null),
                code::PARSE,
                "no JSON: EOF while parsing an object at line 1 column 1",
            ),
            (
                "[]",
                json!(null),
                code::INVALID_REQUEST,
                "a batch is not served: one request a line",
            ),
            (
                "3",
                json!(null),
                code::INVALID_REQUEST,
                "expected an object with \"jsonrpc\", \"method\" and \"id\"",
            ),
            (
                r#"{"id":4,"method":"x"}"#,
                json!(4),
                code::INVALID_REQUEST,
                "\"jsonrpc\": expected \"2.0\"",
            ),
            (
                r#"{"jsonrpc":"2.0","id":[1],"method":"x"}"#,
                json!(null),
                code::INVALID_REQUEST,
                "\"id\": expected a number, a text or null",
            ),
            (
                r#"{"jsonrpc":"2.0","id":"a","method":5}"#,
                json!("a"),
                code::INVALID_REQUEST,
                "\"method\": expected the name of a method",
            ),
            (
                r#"{"jsonrpc":"2.0","id":5,"method":"x","params":[1]}"#,
                json!(5),
                code::INVALID_PARAMS,
                "\"params\": expected an object, parameters go by name",
            ),
        ] {
            assert_eq!(
                parse(line.as_bytes()),
                Err((id, RpcError::new(code, message))),
                "{line}"
            );
        }
        assert_eq!(parse(b"\xFF").unwrap_err().1.code, code::PARSE);
    }

    #[test]
    fn parameters_say_what_was_expected() {
        let params = |text: &str| Params(serde_json::from_str(text).unwrap());
        let message = |result: Result<u64, RpcError>| result.unwrap_err().message.text;
        let expected = "parameter \"node\": expected a whole number from 1 to 239";
        assert_eq!(
            message(params("{}").number("node", 1, 239)),
            format!("{expected}, it is missing")
        );
        for value in ["0", "240", "-1", "1.5", "\"3\"", "null"] {
            let params = params(&format!("{{\"node\":{value}}}"));
            assert_eq!(
                message(params.number("node", 1, 239)),
                format!("{expected}, got {value}")
            );
        }
        assert_eq!(params(r#"{"v":"0aFF"}"#).octets("v", 2), Ok(vec![0x0A, 0xFF]));
        assert_eq!(params(r#"{"v":""}"#).octets("v", 2), Ok(vec![]));
        for value in ["\"0\"", "\"0g\"", "\"000102\"", "5", "\"é\""] {
            assert!(params(&format!("{{\"v\":{value}}}")).octets("v", 2).is_err(), "{value}");
        }
        assert_eq!(
            params(r#"{"nod":1}"#)
                .only(&["node", "index"])
                .unwrap_err()
                .message
                .text,
            "unknown parameter \"nod\": known are node, index"
        );
        assert!(params("{}").only(&[]).is_ok());
    }

    #[test]
    fn answers_are_one_line() {
        let line = answer(&json!(1), Ok(json!({ "text": "two\nlines" })));
        assert_eq!(
            line,
            "{\"id\":1,\"jsonrpc\":\"2.0\",\"result\":{\"text\":\"two\\nlines\"}}\n"
        );
        let line = answer(&Value::Null, Err(RpcError::new(code::PARSE, "no JSON")));
        assert_eq!(
            line,
            "{\"error\":{\"code\":-32700,\"message\":\"no JSON\"},\"id\":null,\"jsonrpc\":\"2.0\"}\n"
        );
    }

    proptest! {
        #[test]
        fn no_line_panics(line in prop::collection::vec(any::<u8>(), 0..200), text in "[\\[\\]{}:,\"a-z0-9.]{0,60}") {
            let _ = parse(&line);
            let _ = parse(text.as_bytes());
            let _ = from_hex(&text);
        }

        #[test]
        fn octets_lead_there_and_back(octets in prop::collection::vec(any::<u8>(), 0..40)) {
            prop_assert_eq!(from_hex(&to_hex(&octets)), Some(octets));
        }
    }
}
