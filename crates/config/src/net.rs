//! `[[hal.net]]`: what leads from pin to pin. Whether the pins exist is found out when the pins do.

use super::section::{Section, keys};

pub(super) const PIN_RULE: &str =
    "must be a name of lower-case letters, digits, dashes and dots, like \"joint.0.f-error\"";

/// Whether a text has the form of a pin's or signal's name.
pub(super) fn is_pin(text: &str) -> bool {
    text.len() <= 63
        && text.split('.').all(|level| {
            level.starts_with(|first: char| first.is_ascii_lowercase() || first.is_ascii_digit())
                && level
                    .bytes()
                    .all(|octet| octet.is_ascii_lowercase() || octet.is_ascii_digit() || octet == b'-')
        })
}

keys! {
    /// `[[hal.net]]`; `before`: those above it.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Net(section, before: &[Net]) {
        /// Name of the signal.
        pub name: String = section.pin("name", "the name of the signal"),
        /// Pin that writes it, or [`Net::UNWIRED`].
        pub source: String = section.pin("source", "the pin that writes the signal"),
        /// Pins that read it.
        pub targets: Vec<String> = targets(section, source.as_deref(), before),
    }
    rules {
        if name.as_ref().is_some_and(|name| before.iter().any(|net| net.name == *name)) {
            return section.refused("name", "is taken by a net above");
        }
    }
}

impl Net {
    /// In place of a source that is not known yet. What hangs on such a net stops the machine.
    pub const UNWIRED: &str = "unwired";

    /// Whether its source is still to come.
    pub fn is_unwired(&self) -> bool {
        self.source == Net::UNWIRED
    }
}

impl Section<'_, '_> {
    /// The name of a pin or signal; missing is an error that says `what` it is.
    fn pin(&mut self, key: &'static str, what: &str) -> Option<String> {
        let text = self.text(key, what)?;
        if !is_pin(text) {
            return self.refused(key, PIN_RULE);
        }
        Some(text.to_owned())
    }
}

fn targets(section: &mut Section<'_, '_>, source: Option<&str>, before: &[Net]) -> Option<Vec<String>> {
    let path = section.key("targets");
    let item = section.required("targets", "the pins that read the signal")?;
    if item.items(&path)?.is_empty() {
        return section.refused("targets", "must name at least one pin");
    }
    let mut targets: Vec<String> = Vec::new();
    item.list(&path, |item, path| {
        let target = item.text(path)?;
        let above = before.iter().flat_map(|net| &net.targets);
        let rule = if !is_pin(target) {
            PIN_RULE
        } else if source == Some(target) {
            "cannot read itself"
        } else if targets.iter().chain(above).any(|other| other == target) {
            "is written by a net already: a pin has one writer"
        } else {
            targets.push(target.to_owned());
            return Some(());
        };
        item.refused(path, rule)
    })?;
    Some(targets)
}
