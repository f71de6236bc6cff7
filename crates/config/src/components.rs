//! `[[hal.component]]`: small functions between pins, in the order in which they run.
//!
//! In:  kinds with their pins and options (crate `components`), the nets of the file.
//! Out: checked components: kinds and options that there are, values of the types of their pins, each pin with one writer.

use super::document::{Scalar, Section};
use super::error::nearest;
use super::types::{Component, Net, Place};
use super::{PIN_RULE, is_pin};
use components::{Direction, Kind, PinSpec, find, kinds};
use hal_pins::{AnyValue, Type};

/// Reads them all; `None` where one is wrong.
pub(super) fn components(section: &mut Section<'_, '_>, nets: &[Net]) -> Option<Vec<Component>> {
    let mut components: Vec<Component> = Vec::new();
    let mut names = Vec::new();
    let mut complete = true;
    for mut table in section.sections("component") {
        match component(&mut table, &mut names, nets) {
            Some(component) => components.push(component),
            None => complete = false,
        }
        table.done();
    }
    complete.then_some(components)
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
    let name = section
        .required("name", "the name of the instance")?
        .text(&section.key("name"))?;
    let rule = if !is_pin(name) || !name.starts_with(|first: char| first.is_ascii_lowercase()) {
        PIN_RULE
    } else if names.iter().any(|above| above == name) {
        "is taken by a component above"
    } else {
        names.push(name.to_owned());
        return Some(name.to_owned());
    };
    section.wrong("name", rule);
    None
}

fn kind(section: &mut Section<'_, '_>) -> Option<&'static Kind> {
    let name = section
        .required("type", "what kind of component it is")?
        .text(&section.key("type"))?;
    let kind = find(name);
    if kind.is_none() {
        let near = nearest(name, kinds().map(|kind| kind.name));
        let hint = near.map_or(String::new(), |near| format!("; did you mean {near:?}?"));
        section.wrong(
            "type",
            format!("is no component: docs/components.md has them all{hint}"),
        );
    }
    kind
}

/// Options as numbers; a word stands for its place in the list of words.
fn options(mut section: Section<'_, '_>, kind: &Kind) -> Option<Vec<(String, i64)>> {
    let mut options = Vec::new();
    let mut complete = true;
    for name in section.names() {
        let words = kind
            .options
            .iter()
            .find(|spec| spec.name == name)
            .map(|spec| spec.words);
        let value = match (section.any_scalar(&name), words.unwrap_or_default()) {
            (Some(Scalar::Integer(value)), []) => Some(value),
            (Some(Scalar::Word(word)), words) if !words.is_empty() => {
                let at = words.iter().position(|known| *known == word);
                at.and_then(|at| i64::try_from(at).ok())
            }
            (None, _) => {
                complete = false;
                continue;
            }
            _ => None,
        };
        let Some(value) = value else {
            let rule = match words {
                Some([]) => "must be an integer".to_owned(),
                Some(words) => format!("must be {}", quoted(words)),
                // Whatever its value: there is no such option.
                None => kind
                    .make(&[(name.clone(), 0)])
                    .err()
                    .map(|error| error.to_string())
                    .unwrap_or_default(),
            };
            section.wrong(&name, rule);
            complete = false;
            continue;
        };
        let option = [(name.clone(), value)];
        if let Err(error) = kind.make(&option) {
            section.wrong(&name, error.to_string());
            complete = false;
        }
        options.extend(option);
    }
    complete.then_some(options)
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
    let mut values = Vec::new();
    let mut complete = true;
    for name in section.names() {
        let pin = pins.iter().find(|pin| pin.name == name);
        let whole = instance.map(|instance| format!("{instance}.{name}"));
        let net = nets
            .iter()
            .find(|net| net.targets.iter().any(|target| Some(target) == whole.as_ref()));
        let value = section.any_scalar(&name);
        let rule = match (pin, net) {
            (None, _) => {
                let near = nearest(&name, pins.iter().map(|pin| pin.name.as_str()));
                let hint = near.map_or(String::new(), |near| format!("; did you mean {near:?}?"));
                format!("is no pin of this component{hint}")
            }
            (
                Some(PinSpec {
                    direction: Direction::Out,
                    ..
                }),
                _,
            ) => "is an output, which the component writes".to_owned(),
            (Some(_), Some(net)) => format!("is written by net {:?}: a pin has one writer", net.name),
            (Some(pin), None) => {
                let kind = pin.default.kind();
                match value.clone().map(|value| of_type(value, kind)) {
                    Some(Some(value)) => {
                        values.push((name, value));
                        continue;
                    }
                    Some(None) => format!("must be {}", wanted(kind)),
                    None => {
                        complete = false;
                        continue;
                    }
                }
            }
        };
        section.wrong(&name, rule);
        complete = false;
    }
    complete.then_some(values)
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
