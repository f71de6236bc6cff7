//! Components and nets as the text of a machine file.

use config::Net;
use std::fmt::Write as _;

/// A component.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Made {
    pub(super) name: String,
    pub(super) kind: &'static str,
    /// Keys and values, as they are written.
    pub(super) options: Vec<(String, String)>,
    pub(super) set: Vec<(String, String)>,
    pub(super) after_motion: bool,
}

/// A net, or what is known of one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Wire {
    pub(super) name: String,
    /// The signal, where its name could not be kept.
    pub(super) given: Option<String>,
    pub(super) source: Option<String>,
    pub(super) targets: Vec<String>,
    /// Pins of the signal that there are none of here.
    pub(super) missing: Vec<String>,
    /// Without a source it has to keep the machine from moving.
    pub(super) stops: bool,
}

/// The tables. A net without source or target is a comment, to be completed by hand; one that must not be forgotten is unwired.
pub(super) fn toml(made: &[&Made], wires: &[Wire]) -> String {
    let mut text = String::new();
    for component in made {
        let Made { name, kind, .. } = component;
        let _ = writeln!(text, "[[hal.component]]\nname = {name:?}\ntype = {kind:?}");
        if component.after_motion {
            text += "place = \"after-motion\"\n";
        }
        for (key, values) in [("options", &component.options), ("set", &component.set)] {
            if !values.is_empty() {
                let _ = writeln!(text, "{key} = {{ {} }}", inline(values));
            }
        }
        text += "\n";
    }
    for wire in wires {
        let source = wire.source.as_deref();
        if source.is_none() && wire.targets.is_empty() && wire.missing.is_empty() {
            continue;
        }
        let source = source.or_else(|| wire.stops.then_some(Net::UNWIRED));
        let is_whole = source.is_some() && !wire.targets.is_empty();
        let start = if is_whole { "" } else { "# " };
        if !wire.missing.is_empty() {
            let _ = writeln!(text, "# not here: {}", wire.missing.join(", "));
        }
        if let Some(given) = &wire.given {
            let _ = writeln!(text, "# in HAL: {given}");
        }
        let name = &wire.name;
        let source = source.unwrap_or_default();
        let targets: Vec<String> = wire.targets.iter().map(|pin| format!("{pin:?}")).collect();
        let _ = writeln!(
            text,
            "{start}[[hal.net]]\n{start}name = {name:?}\n{start}source = {source:?}"
        );
        let _ = writeln!(text, "{start}targets = [{}]\n", targets.join(", "));
    }
    text
}

fn inline(values: &[(String, String)]) -> String {
    let quoted = |key: &str| match key.contains('.') {
        true => format!("{key:?}"),
        false => key.to_owned(),
    };
    let values: Vec<String> = values
        .iter()
        .map(|(key, value)| format!("{} = {value}", quoted(key)))
        .collect();
    values.join(", ")
}
