//! Errors that a command ends with, for people and for programs.
//!
//! In:  errors that know their place in a file, or any other. Out: text, or JSON in one shape for all commands: `file` (or
//! null) and `errors`, objects with `rule` and, where it is known, `line`, `column` and what else belongs to them.

use api::client::ClientError;
use api::rpc::code;
use config::ConfigErrors;
use machine::tables::TablesError;
use program::ProgramErrors;
use serde_json::{Value, json};
use std::fmt;

/// Something is wrong with what the command was given.
#[derive(Debug)]
pub struct Refusal {
    pub text: String,
    pub json: Value,
    pub code: u8,
}

impl Refusal {
    /// With its own form for programs, of the one shape.
    pub fn new(text: impl Into<String>, json: Value) -> Refusal {
        Refusal {
            text: text.into(),
            json,
            code: 1,
        }
    }

    /// Something wrong with a file that has no place in it, told in words only.
    pub fn of_file(file: &str, errors: impl fmt::Display) -> Refusal {
        let text = errors.to_string();
        let json = json!({ "file": file, "errors": [{ "rule": text.trim_end() }] });
        Refusal::new(text, json)
    }

    /// Errors of a program.
    pub fn of_program(name: &str, errors: &ProgramErrors) -> Refusal {
        Refusal::new(errors.to_string(), json!({ "file": name, "errors": errors.to_json() }))
    }

    /// Wrong usage that only a look at several options shows.
    pub fn usage(text: impl fmt::Display) -> Refusal {
        let text = text.to_string();
        let json = Refusal::json_of_text(&text);
        Refusal::new(text, json).wrong_usage()
    }

    /// The exit code that an error ends a command with.
    pub fn code_of(error: &anyhow::Error) -> u8 {
        let is_usage = |error: &ClientError| matches!(error, ClientError::Refused(refused) if refused.code == code::INVALID_PARAMS);
        match (error.downcast_ref::<Refusal>(), error.downcast_ref::<ClientError>()) {
            (Some(refusal), _) => refusal.code,
            (None, Some(error)) if is_usage(error) => 2,
            (None, _) => 1,
        }
    }

    /// The same before anything moved.
    #[must_use]
    pub fn nothing_moved(mut self) -> Refusal {
        self.text = format!("{}\n\nnothing was moved", self.text.trim_end());
        self
    }

    /// The same as wrong usage.
    #[must_use]
    pub fn wrong_usage(self) -> Refusal {
        Refusal { code: 2, ..self }
    }

    /// An error as JSON.
    pub fn json_of(error: &anyhow::Error) -> Value {
        match error.downcast_ref::<Refusal>() {
            Some(refusal) => refusal.json.clone(),
            None => Refusal::json_of_text(&format!("{error:#}")),
        }
    }

    /// A sentence as an error without a file.
    pub fn json_of_text(text: &str) -> Value {
        json!({ "file": null, "errors": [{ "rule": text.trim_end() }] })
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text.trim_end())
    }
}

impl std::error::Error for Refusal {}

impl From<TablesError> for Refusal {
    fn from(error: TablesError) -> Refusal {
        let errors = error.errors.iter().map(|(place, rule)| {
            let [line, column] = place.map_or([None; 2], |place| place.map(Some));
            json!({ "line": line, "column": column, "rule": rule })
        });
        let errors: Vec<Value> = errors.collect();
        Refusal::new(error.to_string(), json!({ "file": error.file, "errors": errors }))
    }
}

impl From<ConfigErrors> for Refusal {
    fn from(errors: ConfigErrors) -> Refusal {
        Refusal::new(errors.to_string(), errors.to_json())
    }
}
