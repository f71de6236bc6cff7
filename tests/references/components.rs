//! `docs/components.md`: all components with their options and pins, from their declarations.

use super::{check, code, head, row};
use components::{CATALOGUE, DIFFERENCES, Difference, Kind};
use hal_pins::AnyValue;

fn value(value: AnyValue) -> String {
    match value {
        AnyValue::Float(value) if value.abs() >= 1e6 => format!("{value:e}"),
        value => value.to_string(),
    }
}

fn section(kind: &Kind) -> String {
    // The text of a document comment begins each line with a space, and has them without line ends.
    let mut text = format!("### {}\n\n{}\n\n", kind.name, kind.doc.trim().replace("  ", " "));
    for option in kind.options {
        let values = match option.words {
            [] => format!("{} to {}", option.range[0], option.range[1]),
            words => words
                .iter()
                .map(|word| code(&format!("{word:?}")))
                .collect::<Vec<_>>()
                .join(", "),
        };
        let default = match usize::try_from(option.default).ok().and_then(|at| option.words.get(at)) {
            Some(word) => format!("{word:?}"),
            None => option.default.to_string(),
        };
        text += &format!(
            "Option `{}`: {}; {values}, default {default}.\n\n",
            option.name, option.doc
        );
    }
    text += &head(&["pin", "type", "at first", "meaning"]);
    let pins = kind.make(&[]).expect("no options").pins();
    let mut same: Option<(&str, AnyValue)> = None;
    for pin in &pins {
        // Of several alike one is told.
        if same == Some((pin.doc, pin.default)) && pin.name.contains(|digit: char| digit.is_ascii_digit()) {
            continue;
        }
        same = Some((pin.doc, pin.default));
        let alike = pins
            .iter()
            .filter(|other| other.doc == pin.doc && other.default == pin.default);
        let alike: Vec<&str> = alike.map(|pin| pin.name.as_str()).collect();
        let name = match alike[..] {
            [first, .., last] if first.len() == last.len() && alike.len() > 1 => {
                format!("{} to {}", code(first), code(last))
            }
            _ => code(&pin.name),
        };
        let kind = format!("{} {}", pin.direction.name(), pin.default.kind());
        text += &row(&[&name, &kind, &value(pin.default), pin.doc]);
    }
    text
}

fn difference(difference: &Difference) -> String {
    let list = |names: &[&str]| names.iter().map(|name| code(name)).collect::<Vec<_>>().join(", ");
    let kinds = difference.kinds.iter().map(|kind| format!("[{kind}](#{kind})"));
    let kinds: Vec<String> = kinds.collect();
    let Difference { pins, here, there, .. } = difference;
    let pins = if pins.is_empty() { "-".to_owned() } else { list(pins) };
    row(&[&kinds.join(", "), &pins, here, there])
}

/// The tables of what is otherwise than in LinuxCNC.
fn differences() -> String {
    let columns = head(&["component", "pins", "here", "in LinuxCNC"]);
    let rows = |is_fault: bool| -> String {
        let those = DIFFERENCES.iter().filter(|difference| difference.is_fault == is_fault);
        those.map(self::difference).collect()
    };
    format!(
        "## Differs from LinuxCNC\n\nIf a row names pins, `isocnc hal import` reports the difference.\n\n{columns}{}\n\
         Faults of LinuxCNC (2.9), contrary to its manual or of no use to anyone, that are not repeated here:\n\n{columns}{}",
        rows(false),
        rows(true)
    )
}

#[test]
fn the_components_with_their_pins() {
    check("docs/components.md", |_| {
        let mut sections: Vec<String> = CATALOGUE.iter().map(section).collect();
        sections.push(differences());
        sections.join("\n").trim_end().to_owned()
    });
}

#[test]
fn every_component_stands_once_in_the_table_by_purpose() {
    let page = std::fs::read_to_string(super::root("docs/components.md")).expect("the page");
    for kind in &CATALOGUE {
        let link = format!("[{0}](#{0})", kind.name);
        let (by_purpose, _) = page.split_once("## All of them").expect("the heading");
        assert_eq!(by_purpose.matches(&link).count(), 1, "{link}");
    }
}
