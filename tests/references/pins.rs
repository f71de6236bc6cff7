//! `docs/pins.md`: the pins, from those that the machines that ship have.

use super::{check, code, head, root, row};
use hal_pins::{Hal, Kind};
use isocnc::config::StepPortKind;
use isocnc::rt::pins::{Pins, capacity};
use isocnc::rt::steps::StepDrives;
use isocnc::{bus, config};
use std::collections::BTreeMap;

/// The name with letters instead of the numbers of a machine: `joint.N.homed`, `io.ID.in-NN`, `motion.digital-in-NN`.
fn general(name: &str) -> String {
    let mut parts: Vec<&str> = name.split('.').collect();
    match parts[0] {
        "joint" | "cia402" | "pid" => parts[1] = "N",
        "stepgen" if parts.len() == 3 => parts[1] = "N",
        "io" | "plk" if parts.len() == 3 => parts[1] = "ID",
        "axis" => parts[1] = "L",
        "halui" if parts[1] == "axis" && parts.len() == 4 => parts[2] = "L",
        _ => {}
    }
    let name = parts.join(".");
    match name.rsplit_once('-') {
        Some((start, number))
            if (name.starts_with("io.") || name.starts_with("motion.")) && number.parse::<u32>().is_ok() =>
        {
            format!("{start}-NN")
        }
        _ => name,
    }
}

/// The name with `NAME` instead of that of a channel, and digits instead of those of an object.
fn without_channel(config: &config::Config, name: &str) -> String {
    for node in &config.bus.nodes {
        for channel in &node.channels {
            let start = format!("io.{}.{}", node.id, channel.name);
            match name.strip_prefix(&start) {
                Some(rest) if rest.is_empty() || rest.starts_with(['.', '-']) => return format!("io.ID.NAME{rest}"),
                _ => {}
            }
        }
    }
    match name.split_once(".object-") {
        Some((start, _)) if start.starts_with("io.") => "io.ID.object-XXXX-XX".to_owned(),
        _ => name.to_owned(),
    }
}

/// The same machine with pins for step pulses; `None`: it has none.
fn with_pulses_by_pins(config: &config::Config) -> Option<config::Config> {
    let mut config = config.clone();
    config.steps.as_mut()?.port = StepPortKind::Pins;
    Some(config)
}

/// Type and kind by the general name.
fn pins() -> BTreeMap<String, (&'static str, Kind)> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut found = BTreeMap::new();
    let files = super::machine_file::shipped();
    let configs = files
        .iter()
        .map(|file| config::read(file).unwrap_or_else(|errors| panic!("{errors}")));
    for config in configs
        .flat_map(|config| [with_pulses_by_pins(&config), Some(config)])
        .flatten()
    {
        let directories = [folder.path().to_owned()];
        let mut hal = Hal::create_in(&directories, &config.name, capacity(&config)).expect("memory for pins");
        Pins::new(&mut hal, &config, &bus::plan(&config), &StepDrives::new(&config)).expect("pins");
        let of_component = |pin: &str| {
            let components = config.components.iter().map(|component| format!("{}.", component.name));
            // Of programs in Structured Text, which docs/logic.md describes.
            let logics = config.logics.iter().map(|task| format!("logic.{}.", task.name));
            // Of other processes, which docs/external-components.md describes.
            let external = config.external.iter().map(|external| format!("{}.", external.name));
            let mut names = components.chain(logics).chain(external);
            names.any(|name| pin.starts_with(&name))
        };
        let is_own = |pin: &hal_pins::PinInfo| pin.kind != Kind::Net && !of_component(&pin.name);
        for pin in hal.list().into_iter().filter(is_own) {
            let what = (pin.value_type().name(), pin.kind);
            let name = general(&without_channel(&config, &pin.name));
            // What these are, their channel says, or their object.
            if name == "io.ID.NAME" || name.starts_with("io.ID.object-") || name == "io.ID.NAME-raw" {
                found.insert(name, ("depends", Kind::Net));
                continue;
            }
            let other = found.insert(name, what);
            // A counter of turns comes from components, or from the control where it reads the encoder itself.
            let same = other.is_none_or(|other| other == what) || pin.name.starts_with("spindle.0.");
            assert!(same, "{} is not the same on all machines", pin.name);
        }
    }
    found
}

#[test]
fn the_pins_of_the_machines_that_ship() {
    check("docs/pins.md", |by_hand| {
        let mut table = head(&["pin", "type", "written by", "meaning"]);
        for (name, (kind, direction)) in pins() {
            let writer = match (direction, &*name) {
                (_, "spindle.0.revs" | "spindle.0.indexed") => "component, or the control with `[spindle.encoder]`",
                (Kind::Output, _) => "the control",
                (Kind::Net, _) => "an input: the control; an output: a net, or `isocnc hal set`",
                _ => "a net, or `isocnc hal set`",
            };
            let name = code(&name);
            table += &row(&[&name, kind, writer, by_hand.cell("", &name)]);
        }
        table
    });
    assert!(root("docs/pins.md").exists());
}
