//! Buttons of the user: what pressing one orders.
//!
//! In:  `[[panel.button]]`, answers to its questions, the folder of programs. Out: an order as a client would give it.

use crate::orders::{Order, Source};
use crate::rpc::{RpcError, code};
use config::{Does, PanelButton, PanelQuestion};
use serde_json::{Map, Value, json};
use std::path::Path;

/// What pressing it orders.
///
/// # Errors
/// An answer is missing its question or lies outside of its range; there is no such program.
pub fn pressed(button: &PanelButton, answers: &Map<String, Value>, programs: Option<&Path>) -> Result<Order, RpcError> {
    let wrong = |field: &str, what: String| {
        let error = RpcError::new(code::INVALID_PARAMS, format!("parameter \"answers\": {what}"));
        Err(error.with_data(json!({ "field": field })))
    };
    let is_asked = |name: &str| button.questions.iter().any(|question| question.name == name);
    if let Some(other) = answers.keys().find(|name| !is_asked(name)) {
        return wrong(
            other,
            format!("button \"{}\" does not ask for \"{other}\"", button.name),
        );
    }
    let mut numbers = Vec::with_capacity(button.questions.len());
    for question in &button.questions {
        let PanelQuestion { name, default, .. } = question;
        let [min, max] = [question.min.unwrap_or(f64::MIN), question.max.unwrap_or(f64::MAX)];
        let number = match answers.get(name) {
            None => *default,
            Some(given) => match given.as_f64() {
                Some(number) if (min..=max).contains(&number) => number,
                _ => {
                    return wrong(
                        name,
                        format!("\"{name}\" must be a number{}, got {given}", range(question)),
                    );
                }
            },
        };
        numbers.push((format!("{{{name}}}"), number.to_string()));
    }
    match &button.does {
        Does::Program(name) => stored(programs, name).map(Order::Load),
        Does::Mdi(lines) => {
            let mut text = String::new();
            for line in lines {
                let line = (numbers.iter()).fold(line.clone(), |line, (place, number)| line.replace(place, number));
                text.push_str(&line);
                text.push('\n');
            }
            Ok(Order::Lines { text, wait: false })
        }
    }
}

/// The range of a question in words, after "a number".
fn range(question: &PanelQuestion) -> String {
    match (question.min, question.max) {
        (None, None) => String::new(),
        (Some(min), None) => format!(" from {min} on"),
        (None, Some(max)) => format!(" up to {max}"),
        (Some(min), Some(max)) => format!(" from {min} to {max}"),
    }
}

/// A program of the folder of programs.
///
/// # Errors
/// There is no folder, or no such file in it.
pub fn stored(folder: Option<&Path>, name: &str) -> Result<Source, RpcError> {
    let Some(folder) = folder else {
        let what = "this machine has no folder of programs: programs of [panel] or state_directory of the machine file name one";
        return Err(RpcError::new(code::REFUSED, what));
    };
    if !files::is_name(name) {
        let what = "parameter \"file\": expected the name of a file, without a folder and not beginning with a dot";
        return Err(RpcError::new(code::INVALID_PARAMS, what));
    }
    let path = folder.join(name);
    match std::fs::symlink_metadata(&path) {
        Ok(found) if found.is_file() => Ok(Source::File(path)),
        Ok(_) => Err(RpcError::new(
            code::REFUSED,
            format!("{name} is no file, and links are not followed here"),
        )),
        Err(cause) => Err(RpcError::new(code::REFUSED, format!("{name}: {cause}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dip() -> PanelButton {
        let question = |name: &str, default, min, max| PanelQuestion {
            name: name.into(),
            label: String::new(),
            default,
            min,
            max,
        };
        PanelButton {
            name: "dip".into(),
            label: "Dip".into(),
            ask: None,
            set_up: false,
            lamp: None,
            questions: vec![
                question("depth", 1.0, Some(0.5), Some(5.0)),
                question("feed", 1e-7, None, None),
            ],
            does: Does::Mdi(vec!["G1 Z-{depth} F{feed}".into(), "G0 Z{depth} ({other})".into()]),
        }
    }

    fn press(answers: Value) -> Result<Order, RpcError> {
        pressed(&dip(), answers.as_object().unwrap(), None)
    }

    #[test]
    fn answers_take_the_places_of_their_names_as_numbers_of_g_code() {
        let lines = |text: &str| Order::Lines {
            text: text.into(),
            wait: false,
        };
        // No exponent, which no line of G-code has.
        assert_eq!(press(json!({})), Ok(lines("G1 Z-1 F0.0000001\nG0 Z1 ({other})\n")));
        let answered = press(json!({ "depth": 2.5, "feed": 300 }));
        assert_eq!(answered, Ok(lines("G1 Z-2.5 F300\nG0 Z2.5 ({other})\n")));
    }

    #[test]
    fn what_no_answer_is_names_its_question() {
        for (answers, field, told) in [
            (json!({ "depth": 6 }), "depth", "must be a number from 0.5 to 5, got 6"),
            (
                json!({ "depth": "1" }),
                "depth",
                "must be a number from 0.5 to 5, got \"1\"",
            ),
            (json!({ "feed": null }), "feed", "must be a number, got null"),
            (json!({ "feed": 1, "x": 1 }), "x", "does not ask for \"x\""),
        ] {
            let error = press(answers).unwrap_err();
            assert!(error.message.text.contains(told), "{}", error.message);
            assert_eq!(error.data, Some(json!({ "field": field })));
        }
    }

    #[test]
    fn a_program_of_a_button_is_one_of_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.ngc"), "G0").unwrap();
        let press = |name: &str, programs| {
            let button = PanelButton {
                questions: Vec::new(),
                does: Does::Program(name.into()),
                ..dip()
            };
            pressed(&button, &Map::new(), programs)
        };
        let file = Source::File(folder.path().join("a.ngc"));
        assert_eq!(press("a.ngc", Some(folder.path())), Ok(Order::Load(file)));
        assert!(press("b.ngc", Some(folder.path())).is_err() && press("a.ngc", None).is_err());
    }
}
