//! `[[hal.external]]`: components whose outputs another process writes.
//!
//! In:  pins with their types and safe values, the nets of the file.
//! Out: checked components: each pin once, each output with a safe value of its type.

use super::components::{of_type, wanted};
use super::net::{Net, PIN_RULE, is_pin};
use super::section::{Section, all_of, keys};
use hal_pins::{AnyValue, EXTERNAL_PINS_MAX, ExternalPin, Kind, Type};
use std::ops::RangeInclusive;

/// External components of a machine, at the most.
const COMPONENTS_MAX: usize = 16;
/// How long a process may say nothing, ms.
const HEARTBEAT_MS: RangeInclusive<u32> = 2..=60_000;
/// Pins that the control makes itself.
const OWN_PINS: [&str; 2] = ["alive", "losses"];

pub(super) const REACTIONS: [(&str, OnLoss); 3] = [
    ("journal", OnLoss::Journal),
    ("warn", OnLoss::Warn),
    ("stop", OnLoss::Stop),
];

keys! {
    /// `[[hal.external]]`; `before`: those above it.
    #[derive(Clone, Debug, PartialEq)]
    pub struct External(section, before: &[External], nets: &[Net]) {
        /// Name before the names of its pins.
        pub name: String =
            name(section, "the name of the component", |name| before.iter().any(|other| other.name == name)),
        /// How long its process may write nothing, ms.
        pub heartbeat_ms: u32 = section.integer("heartbeat_ms", HEARTBEAT_MS, 100),
        pub on_loss: OnLoss = section.word("on_loss", &REACTIONS, OnLoss::Warn),
        pub pins: Vec<ExternalPin> = {
            let tables = section.sections("pins");
            let fits = (1..=EXTERNAL_PINS_MAX).contains(&tables.len());
            if !fits {
                section.wrong("pins", format!("must be 1 to {EXTERNAL_PINS_MAX} pins"));
            }
            all_of(tables, |table, above| pin(table, above, name.as_deref(), nets)).filter(|_| fits)
        },
    }
}

/// What a process that writes no more does to the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnLoss {
    /// The journal tells it.
    Journal,
    /// The operator is warned.
    Warn,
    /// Alarm and controlled stop.
    Stop,
}

/// Reads them all; `None` where one is wrong.
pub(super) fn external(section: &mut Section<'_, '_>, nets: &[Net]) -> Option<Vec<External>> {
    let tables = section.sections("external");
    let fits = tables.len() <= COMPONENTS_MAX;
    if !fits {
        section.wrong("external", format!("must not be more than {COMPONENTS_MAX}"));
    }
    all_of(tables, |table, above| External::read(table, above, nets)).filter(|_| fits)
}

fn name(section: &mut Section<'_, '_>, what: &str, is_taken: impl Fn(&str) -> bool) -> Option<String> {
    let name = section.text("name", what)?;
    let rule = if !is_pin(name) || !name.starts_with(|first: char| first.is_ascii_lowercase()) {
        PIN_RULE
    } else if is_taken(name) {
        "is taken by one above"
    } else {
        return Some(name.to_owned());
    };
    section.refused("name", rule)
}

fn pin(
    section: &mut Section<'_, '_>,
    before: &[ExternalPin],
    component: Option<&str>,
    nets: &[Net],
) -> Option<ExternalPin> {
    let name = name(section, "the name of the pin, behind that of the component", |name| {
        before.iter().any(|other| other.name == name)
    });
    let name = match name {
        Some(own) if OWN_PINS.contains(&own.as_str()) => {
            section.refused("name", "is one that the control makes itself")
        }
        name => name,
    };
    let kind = section.word("direction", &[("in", Kind::Input), ("out", Kind::Output)], None);
    let types = Type::ALL.map(|value_type| (value_type.name(), value_type));
    let value_type = section.word("type", &types, None);
    let first = value(section, "first", value_type);
    let keeps = section.optional("safe").is_some_and(|item| item.is("last"));
    let safe = match keeps {
        true => Some(value_type.map(nothing)),
        false => value(section, "safe", value_type),
    };
    let (kind, value_type) = (kind?, value_type?);
    let value = match (kind, first?, safe?) {
        (Kind::Output, None, Some(safe)) => safe,
        (Kind::Output, _, None) => {
            return section.refused(
                "safe",
                format!(
                    "is missing: what it is while no process writes it, {}",
                    wanted(value_type)
                ),
            );
        }
        (Kind::Output, Some(_), _) => {
            return section.refused("first", "is of inputs; an output begins as `safe` says");
        }
        (Kind::Input | Kind::Net, _, Some(_)) => {
            return section.refused("safe", "is of outputs; an input begins as `first` says");
        }
        (Kind::Input | Kind::Net, first, None) => {
            let whole = component
                .zip(name.as_deref())
                .map(|(component, name)| format!("{component}.{name}"));
            let net = nets
                .iter()
                .find(|net| net.targets.iter().any(|target| Some(target) == whole.as_ref()));
            if let (Some(net), Some(_)) = (net, first) {
                let rule = format!("is written by net {:?}: a pin has one writer", net.name);
                return section.refused("first", rule);
            }
            first.unwrap_or_else(|| nothing(value_type))
        }
    };
    Some(ExternalPin {
        name: name?,
        kind,
        value,
        keeps,
    })
}

/// A value of the type of the pin; `Some(None)`: it is left out.
fn value(section: &mut Section<'_, '_>, key: &'static str, value_type: Option<Type>) -> Option<Option<AnyValue>> {
    if section.optional(key).is_none() {
        return Some(None);
    }
    let (scalar, value_type) = (section.any_scalar(key)?, value_type?);
    let value = of_type(scalar, value_type);
    if value.is_none() {
        section.wrong(key, format!("must be {}", wanted(value_type)));
    }
    value.map(Some)
}

fn nothing(value_type: Type) -> AnyValue {
    match value_type {
        Type::Bit => AnyValue::Bit(false),
        Type::S32 => AnyValue::S32(0),
        Type::U32 => AnyValue::U32(0),
        Type::S64 => AnyValue::S64(0),
        Type::U64 => AnyValue::U64(0),
        Type::Float => AnyValue::Float(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::behind_demo;

    fn read(text: &str) -> Result<Vec<External>, Vec<String>> {
        behind_demo(text, |config| config.external)
    }

    #[test]
    fn components_are_read_with_pins_of_every_type() {
        let read = read(
            "[[hal.external]]\nname = \"panel.0\"\nheartbeat_ms = 50\non_loss = \"stop\"\npins = [\n\
             { name = \"ask\", direction = \"in\", type = \"s64\", first = -5 },\n\
             { name = \"go\", direction = \"in\", type = \"bit\" },\n\
             { name = \"level\", direction = \"out\", type = \"float\", safe = 1 },\n]\n\
             [[hal.external]]\nname = \"lamp\"\npins = [{ name = \"on\", direction = \"out\", type = \"bit\", safe = true }]\n",
        )
        .unwrap();
        let found: Vec<_> = read
            .iter()
            .map(|of| (of.name.as_str(), of.heartbeat_ms, of.on_loss))
            .collect();
        assert_eq!(found, [("panel.0", 50, OnLoss::Stop), ("lamp", 100, OnLoss::Warn)]);
        let pins: Vec<_> = read[0]
            .pins
            .iter()
            .map(|pin| (pin.name.as_str(), pin.kind, pin.value))
            .collect();
        assert_eq!(
            pins,
            [
                ("ask", Kind::Input, AnyValue::S64(-5)),
                ("go", Kind::Input, AnyValue::Bit(false)),
                ("level", Kind::Output, AnyValue::Float(1.0))
            ]
        );
    }

    #[test]
    fn every_mistake_is_told_at_its_place() {
        let refused = read(
            "[[hal.external]]\nname = \"Vfd\"\nheartbeat_ms = 1\non_loss = \"alarm\"\npins = [\n\
             { name = \"alive\", direction = \"out\", type = \"bit\", safe = true },\n\
             { name = \"a\", direction = \"io\", type = \"byte\" },\n\
             { name = \"b\", direction = \"out\", type = \"bit\" },\n\
             { name = \"c\", direction = \"out\", type = \"u32\", safe = -1 },\n\
             { name = \"c\", direction = \"in\", type = \"u32\", safe = 1 },\n\
             { name = \"d\", direction = \"in\", type = \"u32\", default = 1 },\n]\n\
             [[hal.external]]\nname = \"p\"\npins = []\n\
             [[hal.external]]\nname = \"q\"\npins = [{ name = \"x\", direction = \"in\", type = \"float\", first = 2 }]\n\
             [[hal.net]]\nname = \"to-q\"\nsource = \"axis.x.pos-cmd\"\ntargets = [\"q.x\"]\n",
        )
        .unwrap_err();
        let expected = [
            "2:8: hal.external[0].name = \"Vfd\": must be a name of lower-case letters, digits, dashes and dots, like \"joint.0.f-error\"",
            "3:16: hal.external[0].heartbeat_ms = 1: must be an integer from 2 to 60000",
            "4:11: hal.external[0].on_loss = \"alarm\": must be \"journal\" or \"warn\" or \"stop\"",
            "6:10: hal.external[0].pins[0].name = \"alive\": is one that the control makes itself",
            "7:27: hal.external[0].pins[1].direction = \"io\": must be \"in\" or \"out\"",
            "7:40: hal.external[0].pins[1].type = \"byte\": must be \"bit\" or \"s32\" or \"u32\" or \"s64\" or \"u64\" or \"float\"",
            "8:1: hal.external[0].pins[2].safe: is missing: what it is while no process writes it, true or false",
            "9:55: hal.external[0].pins[3].safe = -1: must be an integer from 0 to 4294967295",
            "10:54: hal.external[0].pins[4].safe = 1: is of outputs; an input begins as `first` says",
            "11:47: hal.external[0].pins[5].default: unknown key",
            "15:8: hal.external[1].pins = []: must be 1 to 256 pins",
            "18:65: hal.external[2].pins[0].first = 2: is written by net \"to-q\": a pin has one writer",
        ];
        for (refused, expected) in refused.iter().zip(expected) {
            assert!(refused.starts_with(expected), "{refused}\n{expected}");
        }
        assert_eq!(refused.len(), expected.len(), "{refused:#?}");
    }
}
