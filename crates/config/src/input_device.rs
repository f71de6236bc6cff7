//! `[[hal.input]]`: game pads, pendants, keyboards and hand wheels that the kernel knows as input devices.
//!
//! In:  the name of the device and the codes that are wanted. Out: the device, and the external component that its pins are.

use super::external::{External, OnLoss, REACTIONS};
use super::net::{PIN_RULE, is_pin};
use super::section::{Section, keys};
use hal_pins::{AnyValue, EXTERNAL_PINS_MAX, ExternalPin, Kind};

/// Input devices of a machine, at the most.
const DEVICES_MAX: usize = 8;
/// How long the control's own thread may be late with what a device says, ms.
const HEARTBEAT_MS: u32 = 250;
/// Pins that are no code of a device.
const CONNECTED: &str = "connected";

keys! {
    /// `[[hal.input]]`; `taken`: names of components that have pins of their own.
    #[derive(Clone, Debug, PartialEq)]
    pub struct InputDevice(section, above: &[InputDevice], external: &[External]) {
        /// Name before the names of its pins.
        pub name: String = name(section, above, external),
        /// The beginning of a path of a device (`/dev/input/..`), or a part of its name.
        pub device: String = match section.text("device", "a part of the name of the device, or its path: isocnc input lists them") {
            Some("") => section.refused("device", "must not be empty"),
            device => device.map(str::to_owned),
        },
        /// What of it becomes a pin: `btn-..` and `key-..` bits, `abs-..` sticks, `rel-..` wheels.
        pub codes: Vec<String> = codes(section),
        /// Nobody else hears it: a pad that types into a console as well would surprise.
        pub exclusive: bool = section.flag("exclusive", true),
        pub on_loss: OnLoss = section.word("on_loss", &REACTIONS, OnLoss::Warn),
    }
}

impl InputDevice {
    /// Its pins.
    fn external(&self) -> External {
        let output = |name: &str, value: AnyValue, keeps| ExternalPin {
            name: name.to_owned(),
            kind: Kind::Output,
            value,
            keeps,
        };
        let pins = self.codes.iter().map(|code| match &code[..4] {
            "abs-" => output(code, AnyValue::Float(0.0), false),
            // A count that fell to 0 would turn the wheel back.
            "rel-" => output(code, AnyValue::S32(0), true),
            _ => output(code, AnyValue::Bit(false), false),
        });
        External {
            name: self.name.clone(),
            heartbeat_ms: HEARTBEAT_MS,
            on_loss: self.on_loss,
            pins: pins.chain([output(CONNECTED, AnyValue::Bit(false), false)]).collect(),
        }
    }
}

/// Reads them all; their pins are further ones of `external`.
pub(super) fn inputs(section: &mut Section<'_, '_>, external: &mut Vec<External>) -> Option<Vec<InputDevice>> {
    let inputs = section.tables("input", |table, above| InputDevice::read(table, above, external))?;
    if inputs.len() > DEVICES_MAX {
        return section.refused("input", format!("must not be more than {DEVICES_MAX}"));
    }
    external.extend(inputs.iter().map(InputDevice::external));
    Some(inputs)
}

fn name(section: &mut Section<'_, '_>, above: &[InputDevice], external: &[External]) -> Option<String> {
    let name = section.text("name", "the name before those of its pins")?;
    let is_taken = above.iter().any(|other| other.name == name) || external.iter().any(|other| other.name == name);
    match () {
        () if !is_pin(name) => section.refused("name", PIN_RULE),
        () if is_taken => section.refused("name", "is taken by one above"),
        () => Some(name.to_owned()),
    }
}

fn codes(section: &mut Section<'_, '_>) -> Option<Vec<String>> {
    let path = section.key("codes");
    let item = section.required("codes", "what becomes a pin: isocnc input DEVICE lists it")?;
    let given = item.items(&path)?.len();
    if !(1..EXTERNAL_PINS_MAX).contains(&given) {
        return section.refused("codes", format!("must be 1 to {} codes", EXTERNAL_PINS_MAX - 1));
    }
    let mut codes: Vec<String> = Vec::new();
    item.list(&path, |item, path| {
        let code = item.text(path)?;
        let is_one = ["btn-", "key-", "abs-", "rel-"]
            .iter()
            .any(|kind| code.starts_with(kind))
            && is_pin(code);
        if !is_one {
            return item.refused(
                path,
                "must be a code like \"btn-south\", \"key-f1\", \"abs-x\" or \"rel-wheel\"",
            );
        }
        if codes.iter().any(|above| above == code) {
            return item.refused(path, "stands above already");
        }
        codes.push(code.to_owned());
        Some(())
    })?;
    Some(codes)
}

#[cfg(test)]
mod tests {
    use crate::{OnLoss, parse};
    use std::path::Path;

    const DEMO: &str = include_str!("../../../configs/mill3-demo.toml");

    fn read(tables: &str) -> Result<crate::Config, String> {
        parse(&format!("{DEMO}\n{tables}"), Path::new("m.toml")).map_err(|errors| errors.to_string())
    }

    #[test]
    fn a_device_is_an_external_component_whose_wheels_keep_their_counts() {
        let text =
            "[[hal.input]]\nname = \"pad\"\ndevice = \"Gamepad\"\ncodes = [\"btn-south\", \"abs-x\", \"rel-wheel\"]";
        let config = read(text).unwrap();
        assert_eq!(
            (config.inputs[0].exclusive, config.inputs[0].on_loss),
            (true, OnLoss::Warn)
        );
        let external = config.external.last().unwrap();
        let pins: Vec<_> = external.pins.iter().map(|pin| (pin.name.as_str(), pin.keeps)).collect();
        let expected = [
            ("btn-south", false),
            ("abs-x", false),
            ("rel-wheel", true),
            ("connected", false),
        ];
        assert_eq!((external.name.as_str(), &pins[..]), ("pad", &expected[..]));
    }

    #[test]
    fn what_no_device_is_is_told_at_its_key() {
        let device = |name: &str, rest: &str| format!("[[hal.input]]\nname = \"{name}\"\n{rest}\n");
        let good = "device = \"x\"\ncodes = [\"btn-a\"]";
        for (tables, told) in [
            (device("pad", "device = \"x\""), "hal.input[0].codes: is missing"),
            (device("pad", "codes = [\"btn-a\"]"), "hal.input[0].device: is missing"),
            (device("pad", "device = \"x\"\ncodes = []"), "must be 1 to 255 codes"),
            (
                device("pad", "device = \"x\"\ncodes = [\"south\"]"),
                "must be a code like",
            ),
            (
                device("pad", "device = \"x\"\ncodes = [\"btn-a\", \"btn-a\"]"),
                "stands above already",
            ),
            (device("Pad", good), "hal.input[0].name"),
            (device("pad", good) + &device("pad", good), "is taken by one above"),
            (
                device("pad", &format!("{good}\non_loss = \"off\"")),
                "hal.input[0].on_loss",
            ),
        ] {
            let errors = read(&tables).unwrap_err();
            assert!(errors.contains(told), "{told}: {errors}");
        }
    }
}
