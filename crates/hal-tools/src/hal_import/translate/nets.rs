//! `net` and what else links pins: signals to nets of a machine file.
//!
//! In:  pins of signals. Out: nets with one source each, with conversions between types; those that stop the machine.

use super::{Instance, Signal, Translator, distinct, in_place_of, name_here};
use crate::hal_import::KnownPin;
use crate::hal_import::write::{Made, Wire};
use components::{Kind, find};
use rt::pins::must_be_wired;

impl Translator<'_> {
    pub(super) fn link(&mut self, signal: &str, pin: &str, at: usize) {
        let pin = self.pin_here(pin);
        self.tell_difference(&pin, at);
        let pins = &mut self.signal(signal).pins;
        if !pins.iter().any(|(known, _)| *known == pin) {
            pins.push((pin, at));
        }
    }

    pub(super) fn signal(&mut self, name: &str) -> &mut Signal {
        if !self.signals.contains_key(name) {
            self.order.push(name.to_owned());
        }
        self.signals.entry(name.to_owned()).or_default()
    }

    /// Nets, with what is wrong with them; values of signals that nothing writes go to the pins that read them.
    pub(super) fn wires(&mut self) -> Vec<Wire> {
        let mut wires: Vec<Wire> = Vec::new();
        let mut linked: Vec<String> = Vec::new();
        for given in self.order.clone() {
            let Some(signal) = self.signals.remove(&given) else {
                continue;
            };
            let name = distinct(name_here(&given), |name| wires.iter().any(|wire| wire.name == name));
            let mut wire = Wire {
                given: (name != name_here(&given)).then_some(given),
                name: name.clone(),
                ..Wire::default()
            };
            let mut source: Option<(String, KnownPin)> = None;
            let mut targets = Vec::new();
            let mut converted: Vec<(&'static Kind, Vec<String>)> = Vec::new();
            for (pin, at) in &signal.pins {
                if linked.contains(pin) {
                    self.refuse(*at, format!("{pin} is on a net already"));
                    continue;
                }
                linked.push(pin.clone());
                match self.known(pin) {
                    Err(why) => {
                        wire.missing.push(pin.clone());
                        self.refuse(*at, why);
                    }
                    Ok(known) if !known.is_output => targets.push((pin.clone(), known, *at)),
                    Ok(known) if source.is_none() => source = Some((pin.clone(), known)),
                    Ok(_) => {
                        let why = in_place_of(pin).map_or(String::new(), |instead| format!(": {instead}"));
                        self.refuse(*at, format!("{pin} would be a second writer of {name}{why}"));
                    }
                }
            }
            match (&source, &signal.value) {
                (None, Some((value, at))) => {
                    for (pin, ..) in &targets {
                        let (pin, value) = (pin.clone(), value.clone());
                        self.set(&pin, &value, *at);
                    }
                    continue;
                }
                (Some(_), Some((_, at))) => self.refuse(*at, "the signal has a writer"),
                (_, None) => {}
            }
            for (pin, known, at) in targets {
                match &source {
                    Some((from, KnownPin { value_type, .. })) if *value_type != known.value_type => {
                        let (is, wants) = (value_type.name(), known.value_type.name());
                        let Some(kind) = find(&format!("conv_{is}_{wants}")) else {
                            self.refuse(
                                at,
                                format!("{from} is {is}, {pin} is {wants} here: nothing converts that"),
                            );
                            continue;
                        };
                        match converted.iter_mut().find(|(known, _)| known.name == kind.name) {
                            Some((_, targets)) => targets.push(pin),
                            None => converted.push((kind, vec![pin])),
                        }
                    }
                    _ => wire.targets.push(pin),
                }
            }
            let converted = converted.into_iter().filter_map(|(kind, targets)| {
                let (from, _) = source.as_ref()?;
                let made = self.insert_conversion(&name, kind, from, &targets[0], signal.pins[0].1)?;
                wire.targets.push(format!("{made}.in"));
                Some((format!("{made}.out"), targets))
            });
            let converted: Vec<(String, Vec<String>)> = converted.collect();
            wire.source = source.map(|(pin, _)| pin);
            // Where a pin is known that nothing would write, the reason has been told with the others of the net.
            if wire.source.is_none() && wire.missing.is_empty() && !wire.targets.is_empty() {
                let at = signal.pins[0].1;
                self.refuse(at, format!("nothing writes {name} here"));
            }
            // What a net writes has no value of its own.
            if wire.source.is_some() {
                for target in wire
                    .targets
                    .iter()
                    .chain(converted.iter().flat_map(|(_, targets)| targets))
                {
                    if let Some((at, _)) = self.of_instance(target) {
                        let made = &mut self.instances[at].made;
                        let start = made.name.len() + 1;
                        made.set.retain(|(pin, _)| *pin != target[start..]);
                    }
                }
            }
            wires.push(wire);
            for (source, targets) in converted {
                let name = distinct(name.clone(), |name| wires.iter().any(|wire| wire.name == name));
                wires.push(Wire {
                    name,
                    source: Some(source),
                    targets,
                    ..Wire::default()
                });
            }
        }
        wires
    }

    /// A component between two pins whose types are others here, so that it runs between what writes and what reads; its name.
    fn insert_conversion(&mut self, net: &str, kind: &'static Kind, from: &str, to: &str, at: usize) -> Option<String> {
        let pins = kind.make(&[]).ok()?.pins();
        let is_taken = |name: &str| self.instances.iter().any(|instance| instance.made.name == name);
        let name = distinct(format!("{net}-{}", name_here(kind.name)), is_taken);
        let (place, after_motion) = match (self.of_instance(from), self.of_instance(to)) {
            (Some((source, _)), _) => (source + 1, self.instances[source].made.after_motion),
            (None, Some((target, _))) => (target, self.instances[target].made.after_motion),
            // What a node, a program or a process tells is there before motion, what the control shows behind it.
            (None, None) => (
                0,
                !["io.", "cia402.", "logic."].iter().any(|start| from.starts_with(start)),
            ),
        };
        let made = Made {
            name: name.clone(),
            kind: kind.name,
            after_motion,
            ..Made::default()
        };
        let instance = Instance {
            given: name.clone(),
            renamed: Vec::new(),
            made,
            pins,
            kind,
            place: self.commands[at].place.clone(),
        };
        self.instances.insert(place, instance);
        Some(name)
    }

    /// A net to all inputs that must be wired and that stand in commands which could not be read.
    pub(super) fn unread(&self, unread: usize, wires: &[Wire]) -> Option<Wire> {
        let mut targets: Vec<String> = Vec::new();
        let words = self.refused[..unread]
            .iter()
            .flat_map(|refused| refused.text.split_whitespace());
        for pin in words.map(name_here) {
            let is_known = must_be_wired(&pin) && self.own.get(&pin, self.exactly).is_some();
            if is_known && !wires.iter().any(|wire| wire.targets.contains(&pin)) && !targets.contains(&pin) {
                targets.push(pin);
            }
        }
        let is_taken = |name: &str| wires.iter().any(|wire| wire.name == name);
        (!targets.is_empty()).then(|| Wire {
            name: distinct("unread".to_owned(), is_taken),
            targets,
            ..Wire::default()
        })
    }

    /// Nets without a source on which something hangs that must be wired, through components as well, stop the machine until
    /// somebody has completed them.
    pub(super) fn stop_unwired(&self, wires: &mut [Wire]) {
        for at in 0..wires.len() {
            if wires[at].source.is_none() {
                let mut seen = Vec::new();
                wires[at].stops = wires[at]
                    .targets
                    .iter()
                    .any(|pin| self.must_be_wired(pin, wires, &mut seen));
            }
        }
    }

    fn must_be_wired(&self, pin: &str, wires: &[Wire], seen: &mut Vec<usize>) -> bool {
        let Some((at, _)) = self.of_instance(pin) else {
            return must_be_wired(pin);
        };
        if seen.contains(&at) {
            return false;
        }
        seen.push(at);
        let of_it = |source: &String| self.of_instance(source).is_some_and(|(of, _)| of == at);
        let mut targets = wires
            .iter()
            .filter(|wire| wire.source.as_ref().is_some_and(of_it))
            .flat_map(|wire| &wire.targets);
        targets.any(|target| self.must_be_wired(target, wires, seen))
    }
}
