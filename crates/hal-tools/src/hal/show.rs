//! `isocnc hal show`: everything that is known of pins and nets.

use api::methods as wire;
use hal_pins::{Kind, PinInfo};
use serde_json::{Value, json};
use std::fmt::Write;

/// What a pin is connected with.
struct Around<'a> {
    writer: Option<&'a str>,
    readers: Vec<&'a str>,
    aliases: Vec<&'a str>,
}

impl<'a> Around<'a> {
    fn of(pin: &'a PinInfo, all: &'a [PinInfo]) -> Around<'a> {
        // An alias stands for its pin.
        let name = pin.alias_of.as_deref().unwrap_or(&pin.name);
        let net = match pin.kind {
            Kind::Net => Some(name),
            Kind::Input | Kind::Output => pin.net.as_deref(),
        };
        let on_net = |other: &&PinInfo| net.is_some() && other.net.as_deref() == net && other.alias_of.is_none();
        let readers = all.iter().filter(|other| other.kind == Kind::Input).filter(on_net);
        let writer = match pin.kind {
            Kind::Output => Some(name),
            Kind::Input | Kind::Net => pin.source.as_deref(),
        };
        let aliases = all
            .iter()
            .filter(|other| other.alias_of.as_deref() == Some(name) && other.name != pin.name);
        Around {
            writer,
            readers: readers.map(|other| other.name.as_str()).collect(),
            aliases: aliases.map(|other| other.name.as_str()).collect(),
        }
    }
}

/// A few lines of text.
pub(super) fn text(pin: &PinInfo, all: &[PinInfo]) -> String {
    let around = Around::of(pin, all);
    let mut text = format!("{}\n", pin.name);
    let mut line = |what: &str, is: &str| {
        if !is.is_empty() {
            // Writing to a text does not fail.
            let _ = writeln!(text, "  {what:<10} {is}");
        }
    };
    line("type", pin.value_type().name());
    line("direction", pin.kind.short());
    line("value", &super::with_unit(pin));
    line(
        "unit",
        if pin.unit.is_empty() {
            "none is known"
        } else {
            &pin.unit
        },
    );
    line("alias of", pin.alias_of.as_deref().unwrap_or_default());
    line("aliases", &around.aliases.join(", "));
    line("net", pin.net.as_deref().unwrap_or_default());
    line(
        "writer",
        match (pin.kind, around.writer) {
            (Kind::Output, _) => "its component, or the control itself",
            (_, Some(writer)) => writer,
            (_, None) => "none: isocnc hal set changes it",
        },
    );
    match (pin.kind, around.readers.is_empty()) {
        (Kind::Input, true) => line("readers", "its component, or the control itself"),
        (_, true) => line("readers", "no net leads from it"),
        (_, false) => line("readers", &around.readers.join(", ")),
    }
    text
}

/// The same as JSON.
pub(super) fn json(pin: &PinInfo, all: &[PinInfo]) -> Value {
    let around = Around::of(pin, all);
    let mut value = json!(wire::pin(pin));
    value["writer"] = json!(around.writer);
    value["readers"] = json!(around.readers);
    value["aliases"] = json!(around.aliases);
    value
}
