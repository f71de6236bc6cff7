//! `[[hal.component]]`: small functions between pins, in the order in which they run.
//!
//! In:  kinds with their pins and options (crate `components`), the nets of the file.
//! Out: checked components: kinds and options that there are, values of the types of their pins, each pin with one writer.

use super::document::Scalar;
use super::error::nearest;
use super::net::{Net, PIN_RULE, is_pin};
use super::section::Section;
use components::{Direction, Kind, PinSpec, find, kinds};
use hal_pins::{AnyValue, Type};

/// `[[hal.component]]`
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Name of the instance, before the names of its pins.
    pub name: String,
    /// Name of its kind in [`components::CATALOGUE`].
    pub kind: &'static str,
    /// When in the cycle it runs.
    pub place: Place,
    /// Options by their keys.
    pub options: Vec<(String, i64)>,
    /// Inputs with values of their own: name behind that of the instance, and the value.
    pub set: Vec<(String, AnyValue)>,
}

/// When in the cycle a component runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Behind the inputs of nodes, before orders and interpolation.
    BeforeMotion,
    /// Behind the set-points, before the outputs of nodes.
    AfterMotion,
}

/// Reads them all; `None` where one is wrong.
pub(super) fn components(section: &mut Section<'_, '_>, nets: &[Net]) -> Option<Vec<Component>> {
    let mut names = Vec::new();
    section.tables("component", |table, _| component(table, &mut names, nets))
}

fn component(section: &mut Section<'_, '_>, names: &mut Vec<String>, nets: &[Net]) -> Option<Component> {
    let name = name(section, names);
    let kind = kind(section);
    let places = [
        ("before-motion", Place::BeforeMotion),
        ("after-motion", Place::AfterMotion),
    ];
    let place = section.word("place", &places, Place::BeforeMotion);
    let options = section.section("options");
    let set = section.section("set");
    let (kind, options) = (kind?, self::options(options?, kind?));
    let pins = kind.make(options.as_ref()?).ok()?.pins();
    let set = values(set?, &pins, name.as_deref(), nets);
    Some(Component {
        name: name?,
        kind: kind.name,
        place: place?,
        options: options?,
        set: set?,
    })
}

/// A name that none of those above has; then it is one of them.
fn name(section: &mut Section<'_, '_>, names: &mut Vec<String>) -> Option<String> {
    let name = section.text("name", "the name of the instance")?;
    let rule = if !is_pin(name) || !name.starts_with(|first: char| first.is_ascii_lowercase()) {
        PIN_RULE
    } else if names.iter().any(|above| above == name) {
        "is taken by a component above"
    } else {
        names.push(name.to_owned());
        return Some(name.to_owned());
    };
    section.refused("name", rule)
}

fn kind(section: &mut Section<'_, '_>) -> Option<&'static Kind> {
    let name = section.text("type", "what kind of component it is")?;
    let kind = find(name);
    if kind.is_none() {
        let near = nearest(name, kinds().map(|kind| kind.name));
        let hint = near.map_or(String::new(), |near| format!("; did you mean {near:?}?"));
        let rule = format!("is no component: docs/components.md has them all{hint}");
        section.wrong("type", rule);
    }
    kind
}

/// Options as numbers; a word stands for its place in the list of words.
fn options(mut section: Section<'_, '_>, kind: &Kind) -> Option<Vec<(String, i64)>> {
    section.each(|section, name| {
        let spec = kind.options.iter().find(|spec| spec.name == name);
        let words = spec.map(|spec| spec.words);
        let value = match (section.any_scalar(name)?, words.unwrap_or_default()) {
            (Scalar::Integer(value), []) => Some(value),
            (Scalar::Word(word), words) => {
                let at = words.iter().position(|known| *known == word);
                at.and_then(|at| i64::try_from(at).ok())
            }
            _ => None,
        };
        // Whatever its value: there may be no such option.
        let option = (name.to_owned(), value.unwrap_or(0));
        let error = kind
            .make(std::slice::from_ref(&option))
            .err()
            .map(|error| error.to_string());
        match (value, words) {
            (None, Some([])) => section.refused(name, "must be an integer"),
            (None, Some(words)) => section.refused(name, format!("must be {}", quoted(words))),
            (None, None) => section.refused(name, error.unwrap_or_default()),
            (Some(_), _) => match error {
                Some(error) => section.refused(name, error),
                None => Some(option),
            },
        }
    })
}

fn quoted(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("{word:?}")).collect();
    quoted.join(" or ")
}

/// Values of inputs that nothing else writes.
fn values(
    mut section: Section<'_, '_>,
    pins: &[PinSpec],
    instance: Option<&str>,
    nets: &[Net],
) -> Option<Vec<(String, AnyValue)>> {
    section.each(|section, name| {
        let pin = pins.iter().find(|pin| pin.name == name);
        let whole = instance.map(|instance| format!("{instance}.{name}"));
        let is_target = |net: &&Net| net.targets.iter().any(|target| Some(target) == whole.as_ref());
        let value = section.any_scalar(name);
        let rule = match (pin, nets.iter().find(is_target)) {
            (None, _) => {
                let near = nearest(name, pins.iter().map(|pin| pin.name.as_str()));
                let hint = near.map_or(String::new(), |near| format!("; did you mean {near:?}?"));
                format!("is no pin of this component{hint}")
            }
            (Some(pin), _) if pin.direction == Direction::Out => "is an output, which the component writes".to_owned(),
            (Some(_), Some(net)) => format!("is written by net {:?}: a pin has one writer", net.name),
            (Some(pin), None) => {
                let kind = pin.default.kind();
                match of_type(value?, kind) {
                    Some(value) => return Some((name.to_owned(), value)),
                    None => format!("must be {}", wanted(kind)),
                }
            }
        };
        section.refused(name, rule)
    })
}

/// The value as one of the type of a pin.
pub(super) fn of_type(value: Scalar, kind: Type) -> Option<AnyValue> {
    Some(match (kind, value) {
        (Type::Bit, Scalar::Flag(value)) => AnyValue::Bit(value),
        (Type::S32, Scalar::Integer(value)) => AnyValue::S32(value.try_into().ok()?),
        (Type::U32, Scalar::Integer(value)) => AnyValue::U32(value.try_into().ok()?),
        (Type::S64, Scalar::Integer(value)) => AnyValue::S64(value),
        (Type::U64, Scalar::Integer(value)) => AnyValue::U64(value.try_into().ok()?),
        (Type::Float, Scalar::Integer(value)) => AnyValue::Float(value as f64),
        (Type::Float, Scalar::Number(value)) => AnyValue::Float(value),
        (
            Type::Bit | Type::S32 | Type::U32 | Type::S64 | Type::U64 | Type::Float,
            Scalar::Flag(_) | Scalar::Integer(_) | Scalar::Number(_) | Scalar::Word(_),
        ) => return None,
    })
}

pub(super) fn wanted(kind: Type) -> &'static str {
    match kind {
        Type::Bit => "true or false",
        Type::S32 => "an integer from -2147483648 to 2147483647",
        Type::U32 => "an integer from 0 to 4294967295",
        Type::S64 | Type::U64 => "an integer",
        Type::Float => "a number",
    }
}
