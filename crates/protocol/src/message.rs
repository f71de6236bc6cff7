//! What the control says to people: a code, its values, and the English sentence that is made of them.
//!
//! In:  a code, a sentence in English with the names of its values, and these, at one place: [`message!`](crate::message!).
//! Out: what travels, and what a terminal prints. Whoever speaks another language has a table of sentences by code.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Number;
use std::collections::BTreeMap;
use std::fmt;

/// What the control says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Message {
    /// Stays the same from version to version, like `fault.node_lost`; `text`: there is nothing but the sentence.
    #[serde(default = "plain")]
    pub code: String,
    /// Values of the sentence, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub params: BTreeMap<String, Param>,
    /// The sentence, in English.
    pub text: String,
}

/// A value of a sentence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Param {
    /// A number.
    Number(#[schemars(with = "f64")] Number),
    /// A name, or a number as it is to be written.
    Text(String),
    /// A sentence, or a part of one.
    Message(Message),
}

/// Code of a sentence that has none.
const PLAIN: &str = "text";

/// Code of a sentence that has none.
pub(crate) fn plain() -> String {
    PLAIN.to_owned()
}

/// A message as its sentence, in files that have no more: `#[serde(with = "protocol::message::as_text")]`.
pub mod as_text {
    use super::Message;
    use serde::{Deserialize, Deserializer, Serializer};

    /// Writes the sentence.
    ///
    /// # Errors
    /// Of the serializer.
    pub fn serialize<S: Serializer>(message: &Message, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&message.text)
    }

    /// Reads a sentence.
    ///
    /// # Errors
    /// It is none.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Message, D::Error> {
        String::deserialize(deserializer).map(Message::from)
    }
}

/// A message: its code, its English in the form of [`format!`], and all values that it has, by name.
///
/// ```
/// let message = protocol::message!("fault.line", "line {line}: {what}", line = 7, what = "lost");
/// assert_eq!(message.text, "line 7: lost");
/// assert_eq!(message.params["line"], protocol::Param::from(7));
/// ```
#[macro_export]
macro_rules! message {
    ($code:literal, $english:literal $(, $name:ident = $value:expr)* $(,)?) => {{
        $(let $name = $value;)*
        $crate::Message {
            code: ::std::string::String::from($code),
            text: ::std::format_args!($english $(, $name = $name)*).to_string(),
            params: ::std::collections::BTreeMap::from([
                $((::std::string::String::from(::std::stringify!($name)), $crate::Param::from($name))),*
            ]),
        }
    }};
}

impl Message {
    /// A message whose sentence is made elsewhere, with the values that it has.
    pub fn new<const N: usize>(code: &str, text: impl fmt::Display, params: [(&str, Param); N]) -> Message {
        Message {
            code: code.to_owned(),
            params: params.map(|(name, value)| (name.to_owned(), value)).into(),
            text: text.to_string(),
        }
    }

    /// Whether it is more than a sentence.
    pub fn is_coded(&self) -> bool {
        self.code != PLAIN
    }

    /// Those that it contains, and itself.
    pub fn each(&self, look: &mut impl FnMut(&Message)) {
        look(self);
        for param in self.params.values() {
            if let Param::Message(inner) = param {
                inner.each(look);
            }
        }
    }
}

impl Default for Message {
    fn default() -> Message {
        Message::from(String::new())
    }
}

impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.text)
    }
}

impl From<String> for Message {
    /// A sentence without a code.
    fn from(text: String) -> Message {
        Message {
            code: plain(),
            params: BTreeMap::new(),
            text,
        }
    }
}

impl From<&str> for Message {
    /// A sentence without a code.
    fn from(text: &str) -> Message {
        Message::from(text.to_owned())
    }
}

impl From<Message> for Param {
    /// A sentence without a code is its text.
    fn from(message: Message) -> Param {
        match message.is_coded() {
            true => Param::Message(message),
            false => Param::Text(message.text),
        }
    }
}

impl From<String> for Param {
    fn from(text: String) -> Param {
        Param::Text(text)
    }
}

impl From<&str> for Param {
    fn from(text: &str) -> Param {
        Param::Text(text.to_owned())
    }
}

impl From<&String> for Param {
    fn from(text: &String) -> Param {
        Param::Text(text.clone())
    }
}

impl From<f64> for Param {
    /// What is no number for JSON is its text.
    fn from(number: f64) -> Param {
        Number::from_f64(number).map_or_else(|| Param::Text(number.to_string()), Param::Number)
    }
}

macro_rules! from_integers {
    ($($of:ty)+) => {$(
        impl From<$of> for Param {
            fn from(number: $of) -> Param {
                Param::Number(number.into())
            }
        }
    )+};
}

from_integers! { u8 u16 u32 u64 usize i32 i64 }

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_message_travels_with_its_values_and_those_of_what_it_contains() {
        let error = message!("fault.following_error", "following error {error:.3} mm", error = 0.5);
        let whole = message!("fault.at", "{place}: {what}", place = "x-drive", what = error);
        assert_eq!(whole.text, "x-drive: following error 0.500 mm");
        let travels = json!({
            "code": "fault.at",
            "params": {
                "place": "x-drive",
                "what": {
                    "code": "fault.following_error",
                    "params": { "error": 0.5 },
                    "text": "following error 0.500 mm",
                },
            },
            "text": "x-drive: following error 0.500 mm",
        });
        assert_eq!(json!(whole), travels);
        assert_eq!(serde_json::from_value::<Message>(travels).unwrap(), whole);
    }

    /// As in the journals of an older control.
    #[test]
    fn a_sentence_without_a_code_is_a_message() {
        let message: Message = serde_json::from_value(json!({ "text": "lost" })).unwrap();
        assert_eq!(message, Message::from("lost"));
        assert_eq!(json!(message), json!({ "code": "text", "text": "lost" }));
        assert_eq!(Param::from(message), Param::from("lost"));
        assert_eq!(Param::from(f64::INFINITY), Param::from("inf"));
    }
}
