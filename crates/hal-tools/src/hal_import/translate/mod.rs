//! Commands of HAL files to components, their order, and nets.
//!
//! In:  commands; kinds of components; the control's own pins.
//! Out: the tables of a machine file; commands that could not be translated, each with its reason.

mod functions;
mod load;
mod nets;

use super::read::Command;
use super::write::{self, Made};
use super::{KnownPin, OwnPins, Place, Refused, Translation};
use components::{DIFFERENCES, Difference, Direction, Kind, PinSpec};
use hal_pins::{AnyValue, Type};
use std::collections::BTreeMap;

/// Commands without effect on what the machine does then.
const NEEDLESS: [&str; 17] = [
    "start", "stop", "lock", "unlock", "getp", "gets", "ptype", "stype", "list", "show", "status", "save", "debug",
    "help", "print", "waitusr", "echo",
];

/// Pins by their names there and here, or with their values.
type Pairs = Vec<(String, String)>;

/// An instance of a component, as far as commands have said.
struct Instance {
    /// Its name there.
    given: String,
    /// Names of its pins there, where a word of `loadrt` gave them, and here.
    renamed: Pairs,
    made: Made,
    pins: Vec<PinSpec>,
    kind: &'static Kind,
    place: Place,
}

/// A signal.
#[derive(Default)]
struct Signal {
    /// Pins as they are called here, each with its command.
    pins: Vec<(String, usize)>,
    /// Value that `sets` gives.
    value: Option<(String, usize)>,
}

struct Translator<'a> {
    commands: &'a [Command],
    own: &'a OwnPins,
    exactly: bool,
    instances: Vec<Instance>,
    /// Names of modules that are not translated: their pins need no more words.
    unknown: Vec<String>,
    /// By their names there: case and all characters count.
    signals: BTreeMap<String, Signal>,
    /// Signals in the order in which they came.
    order: Vec<String>,
    /// Periods of threads, ns.
    threads: BTreeMap<String, u64>,
    /// Functions of the list of the cycle: name, command.
    functions: Vec<(String, usize)>,
    refused: Vec<Refused>,
    /// Pins that mean something else here, each told once.
    otherwise: Vec<(String, String)>,
    needless: usize,
}

pub(super) fn translate(commands: &[Command], own: &OwnPins, exactly: bool, refused: Vec<Refused>) -> Translation {
    let mut translator = Translator {
        commands,
        own,
        exactly,
        instances: Vec::new(),
        unknown: Vec::new(),
        signals: BTreeMap::new(),
        order: Vec::new(),
        threads: BTreeMap::new(),
        functions: Vec::new(),
        refused,
        otherwise: Vec::new(),
        needless: 0,
    };
    let unread = translator.refused.len();
    // As LinuxCNC's two passes: what is loaded anywhere is there for all commands.
    for (at, command) in commands.iter().enumerate() {
        if command.words[0] == "loadrt" {
            translator.load(at, command);
        }
    }
    for (at, command) in commands.iter().enumerate() {
        translator.take(at, command);
    }
    translator.place_functions();
    let mut wires = translator.wires();
    wires.extend(translator.unread(unread, &wires));
    translator.stop_unwired(&mut wires);
    let made: Vec<&Made> = translator.instances.iter().map(|instance| &instance.made).collect();
    let toml = write::toml(&made, &wires);
    let mut refused = translator.refused;
    refused.sort_by(|a, b| a.place.cmp(&b.place));
    let mut places: Vec<&Place> = refused[..].iter().map(|refused| &refused.place).collect();
    places.dedup();
    let not_translated = places.len() - unread;
    Translation {
        toml,
        translated: commands.len() - translator.needless - not_translated.min(commands.len() - translator.needless),
        needless: translator.needless,
        refused,
        notes: translator.otherwise.into_iter().map(|(_, note)| note).collect(),
    }
}

/// What a pin of a component means here and in LinuxCNC, where that is not the same.
fn difference(kind: &str, pin: &str) -> Option<&'static Difference> {
    DIFFERENCES
        .iter()
        .find(|difference| difference.kinds.contains(&kind) && difference.pins.contains(&pin))
}

/// The name, or with a number behind it that nothing has yet: names that differ there may not become one here.
fn distinct(name: String, is_taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2..).map(|number| format!("{name}-{number}"));
    let mut names = std::iter::once(name.clone()).chain(numbered);
    names.find(|name| !is_taken(name)).unwrap_or(name)
}

/// A period in words.
fn period_text(period_ns: u64) -> String {
    format!("{} ms", period_ns as f64 / 1e6)
}

/// The levels of a name, as they are here: lower case, dashes.
fn levels_here(name: &str) -> String {
    let legal = |c: char| match c.to_ascii_lowercase() {
        c @ ('a'..='z' | '0'..='9' | '.') => c,
        _ => '-',
    };
    let levels: String = name.chars().map(legal).collect();
    let levels = levels
        .split('.')
        .map(|level| level.trim_matches('-'))
        .filter(|level| !level.is_empty());
    levels.collect::<Vec<_>>().join(".")
}

/// A name as names are here: lower case, dashes, a letter first.
pub(super) fn name_here(name: &str) -> String {
    let name = levels_here(name);
    match name.chars().next() {
        Some('a'..='z') => name,
        Some(_) => format!("n-{name}"),
        None => "n".to_owned(),
    }
}

impl Translator<'_> {
    fn refuse(&mut self, at: usize, why: impl Into<String>) {
        let Command { place, text, .. } = &self.commands[at];
        self.refused.push(Refused {
            place: place.clone(),
            text: text.clone(),
            why: why.into(),
        });
    }

    fn take(&mut self, at: usize, command: &Command) {
        let words: Vec<&str> = command.words.iter().map(String::as_str).collect();
        match words[..] {
            ["loadrt", ..] => {}
            ["net", signal, ref pins @ ..] => {
                for pin in pins {
                    self.link(signal, pin, at);
                }
            }
            ["newsig", ..] => self.needless += 1,
            ["linkps", pin, signal] | ["linksp", signal, pin] => self.link(signal, pin, at),
            ["unlinkp", pin] => {
                let pin = self.pin_here(pin);
                for signal in self.signals.values_mut() {
                    signal.pins.retain(|(linked, _)| *linked != pin);
                }
            }
            ["delsig", signal] => drop(self.signals.remove(signal)),
            ["linkpp", first, second] => {
                self.link(first, first, at);
                self.link(first, second, at);
            }
            ["setp", pin, value] => self.set(pin, value, at),
            ["sets", signal, value] => {
                self.signal(signal).value = Some((value.to_owned(), at));
            }
            ["addf", function, thread, ref position @ ..] => self.add_function(function, thread, position.first(), at),
            ["loadusr", ..] => self.refuse(at, "programs beside the control are not started by it"),
            [command, ..] if NEEDLESS.contains(&command) => self.needless += 1,
            [
                "net" | "setp" | "sets" | "addf" | "linkps" | "linksp" | "linkpp" | "unlinkp" | "delsig",
                ..,
            ] => self.refuse(at, "words are missing or too many"),
            _ => self.refuse(at, "has nothing like it in a machine file"),
        }
    }

    /// A pin or function by its name there. Where names of components differ by no more than case or dashes, the exact one counts.
    fn pin_here(&self, name: &str) -> String {
        let of = |prefix: &str| {
            let rest = name.strip_prefix(prefix)?;
            (rest.is_empty() || rest.starts_with('.')).then(|| rest.to_owned())
        };
        let exact = self
            .instances
            .iter()
            .filter_map(|instance| Some((instance, of(&instance.given)?)));
        match exact.max_by_key(|(instance, _)| instance.given.len()) {
            Some((instance, rest)) if rest.len() > 1 => {
                let renamed = instance.renamed.iter().find(|(there, _)| *there == rest[1..]);
                let pin = renamed.map_or_else(|| levels_here(&rest[1..]), |(_, here)| here.clone());
                format!("{}.{pin}", instance.made.name)
            }
            Some((instance, _)) => instance.made.name.clone(),
            None => name_here(name),
        }
    }

    /// Tells what a pin means here, where it is something else.
    fn tell_difference(&mut self, pin: &str, at: usize) {
        let Some((instance, Some(spec))) = self.of_instance(pin) else {
            return;
        };
        let Some(Difference { here, there, .. }) = difference(self.instances[instance].kind.name, &spec.name) else {
            return;
        };
        if !self.otherwise.iter().any(|(told, _)| told == pin) {
            let place = &self.commands[at].place;
            let note = format!("{place}: {pin} is otherwise here: {here}; in LinuxCNC: {there}");
            self.otherwise.push((pin.to_owned(), note));
        }
    }

    /// The instance that a pin belongs to, and the pin as it is declared.
    fn of_instance(&self, pin: &str) -> Option<(usize, Option<&PinSpec>)> {
        let at = self.instances.iter().position(|instance| {
            let rest = pin.strip_prefix(instance.made.name.as_str());
            rest.is_some_and(|rest| rest.starts_with('.'))
        })?;
        let instance = &self.instances[at];
        let name = &pin[instance.made.name.len() + 1..];
        Some((at, instance.pins.iter().find(|pin| pin.name == name)))
    }

    /// What is known of a pin, or why nothing is.
    fn known(&self, pin: &str) -> Result<KnownPin, String> {
        match self.of_instance(pin) {
            Some((_, Some(spec))) => Ok(KnownPin {
                is_output: spec.direction == Direction::Out,
                value_type: spec.default.kind(),
            }),
            Some((at, None)) => {
                let Instance { made, pins, .. } = &self.instances[at];
                let name = &pin[made.name.len() + 1..];
                if let Some(Difference { here, .. }) = difference(made.kind, name) {
                    return Err(format!("{} has no pin {name} here: {here}", made.kind));
                }
                let near = hal_pins::nearest(name, pins.iter().map(|pin| pin.name.as_str()));
                let hint = near.map_or(String::new(), |near| format!("; {near} is the nearest"));
                Err(format!("{} has no pin {name} here{hint}", made.kind))
            }
            None => self.own.get(pin, self.exactly).ok_or_else(|| {
                let first = pin.split(['.', '-']).next().unwrap_or_default();
                let is_unknown = self
                    .unknown
                    .iter()
                    .any(|module| module.starts_with(first) || pin.starts_with(module.as_str()));
                let near = self.own.nearest(pin).filter(|_| !is_unknown);
                let hint = near.map_or(String::new(), |near| format!("; {near} is the nearest"));
                match is_unknown {
                    true => format!("{pin} is a pin of a module that was not translated"),
                    false => match in_place_of(pin) {
                        Some(instead) => format!("no pin {pin} here: {instead}"),
                        None => format!("no pin {pin} here{hint}"),
                    },
                }
            }),
        }
    }

    fn set(&mut self, pin: &str, value: &str, at: usize) {
        let pin = self.pin_here(pin);
        self.tell_difference(&pin, at);
        match (self.of_instance(&pin), self.known(&pin)) {
            (_, Err(why)) => self.refuse(at, why),
            (_, Ok(KnownPin { is_output: true, .. })) => self.refuse(at, "is an output, which the component writes"),
            (None, Ok(_)) => self.refuse(
                at,
                format!("the control's own: `isocnc hal set {pin} {value}` while it runs"),
            ),
            (Some((instance, _)), Ok(known)) => match number(known.value_type, value) {
                Some(value) => {
                    let made = &mut self.instances[instance].made;
                    let name = pin[made.name.len() + 1..].to_owned();
                    made.set.retain(|(before, _)| *before != name);
                    made.set.push((name, value));
                }
                None => self.refuse(at, format!("{value:?} is no {}", known.value_type)),
            },
        }
    }
}

/// A servo thread of another period than the cycle.
pub(super) fn other_period(period_ns: u64, cycle_ns: u64) -> String {
    format!(
        "the servo thread runs every {}, the cycle here is {}: write cycle_us = {} in [machine], or convert what counts its calls",
        period_text(period_ns),
        period_text(cycle_ns),
        period_ns / 1000
    )
}

/// What does here what a pin of LinuxCNC's does.
fn in_place_of(pin: &str) -> Option<&'static str> {
    const OF_USER_INTERFACES: [&str; 10] = [
        "pyvcp",
        "gladevcp",
        "gmoccapy",
        "gscreen",
        "qtvcp",
        "qtdragon",
        "touchy",
        "axisui",
        "axisremote",
        "vismach",
    ];
    let levels: Vec<&str> = pin.split('.').collect();
    Some(match levels[..] {
        [first, ..] if OF_USER_INTERFACES.contains(&first) => "it is of a user interface",
        ["hal-manualtoolchange", ..] => "`isocnc tool-changed` or the panel says that the tool is in",
        ["joint", _, "motor-pos-fb"] => "the control reads the position of a drive itself",
        ["joint", _, "amp-enable-out"] => "the control switches drives on itself; amp-enabled tells that one is on",
        ["joint", _, "amp-fault-in"] => "the control hears itself what is wrong with a drive",
        ["joint", _, "index-enable"] => "drives look for their index themselves",
        ["spindle", _, "revs" | "index-enable"] => {
            "[spindle.encoder] of the machine file with source = \"pins\" makes spindle.0.revs and spindle.0.indexed"
        }
        ["spindle", _, "speed-in"] => "the control measures it by [spindle.encoder]",
        ["iocontrol", _, "lube" | "lube-level"] => "lubrication is a program, as configs/logic/lubrication.st",
        ["axis", _, pin] if pin.starts_with("eoffset") => "there are no external offsets",
        ["halui", pin] if pin.starts_with("mdi-command-") => "`isocnc mdi`, or a client of the control socket",
        ["halui", "abort"] => "halui.program.stop",
        _ => return None,
    })
}

/// A value as a machine file has it.
fn number(kind: Type, text: &str) -> Option<String> {
    let text = text.to_ascii_lowercase();
    let value = match (kind, text.as_str()) {
        (Type::Bit, "true" | "yes" | "on") => AnyValue::Bit(true),
        (Type::Bit, "false" | "no" | "off") => AnyValue::Bit(false),
        (Type::Bit, other) => AnyValue::Bit(other.parse::<f64>().ok()? != 0.0),
        (Type::Float, text) => AnyValue::parse(Type::Float, text).ok()?,
        // Whole numbers are sometimes written with a point.
        (kind, text) => AnyValue::parse(kind, text.strip_suffix(".0").unwrap_or(text)).ok()?,
    };
    Some(match value {
        AnyValue::Bit(value) => value.to_string(),
        AnyValue::Float(value) => format!("{value:?}"),
        other => other.to_string(),
    })
}
