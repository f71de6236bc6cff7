//! Commands of HAL files to components, their order, and nets.
//!
//! In:  commands; kinds of components; the control's own pins.
//! Out: the tables of a machine file; commands that could not be translated, each with its reason.

use super::read::Command;
use super::write::{self, Made, Wire};
use super::{KnownPin, OwnPins, Place, Refused, Translation};
use components::{CATALOGUE, DIFFERENCES, Difference, Direction, Kind, PinSpec, find};
use hal_pins::{AnyValue, Type};
use rt::pins::must_be_wired;
use std::collections::BTreeMap;

/// Modules whose work the control does itself.
const PARTS_OF_THE_CONTROL: [&str; 9] = [
    "motmod",
    "tpmod",
    "homemod",
    "trivkins",
    "gantrykins",
    "threads",
    "tp",
    "homecomp",
    "scope_rt",
];

/// Modules of kinematics, and `machine.kinematics` that does the same.
const KINEMATICS: [(&str, &str); 6] = [
    ("corexykins", "corexy"),
    ("xyzac-trt-kins", "table-table"),
    ("xyzbc-trt-kins", "table-table"),
    ("maxkins", "head-table"),
    ("scarakins", "scara"),
    ("lineardeltakins", "linear-delta"),
];

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

impl<'a> Translator<'a> {
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

    /// `loadrt MODULE count=N names=a,b key=value ..`
    fn load(&mut self, at: usize, command: &Command) {
        let Some(module) = command.words.get(1) else {
            return self.refuse(at, "no module is named");
        };
        if PARTS_OF_THE_CONTROL.contains(&module.as_str()) {
            return self.part_of_the_control(at, command);
        }
        if module.ends_with("kins") {
            return self.kinematics(at, module);
        }
        let Some(kind) = find(module) else {
            self.unknown.push(name_here(&module.replace("hal_", "")));
            let near = hal_pins::nearest(module, CATALOGUE.iter().map(|kind| kind.name));
            let hint = near.map_or(String::new(), |near| format!("; {near} is the nearest"));
            return self.refuse(at, format!("no component of this name here{hint}"));
        };
        let mut values: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for word in &command.words[2..] {
            if let Some((key, list)) = word.split_once('=') {
                values.insert(
                    key,
                    list.split(',')
                        .map(str::trim)
                        .filter(|value| !value.is_empty())
                        .collect(),
                );
            }
        }
        let own_words = ["count", "num_chan", "names", "debug"];
        let texts = values.remove("messages");
        let lists = values.iter().filter(|(key, _)| !own_words.contains(key));
        let longest = lists.map(|(_, list)| list.len()).max();
        let count = ["count", "num_chan"]
            .iter()
            .find_map(|key| values.get(key)?.first()?.parse::<usize>().ok());
        let names: Vec<String> = match values.get("names") {
            Some(names) => names.iter().map(|name| (*name).to_owned()).collect(),
            None => {
                let loaded = self
                    .instances
                    .iter()
                    .filter(|instance| instance.kind.name == kind.name)
                    .count();
                let first = match module_name(kind) {
                    &"enum" => values.get("enums"),
                    _ => None,
                };
                let count = count
                    .or(longest)
                    .unwrap_or(if ["pid", "encoder"].contains(module_name(kind)) {
                        3
                    } else {
                        1
                    });
                let is_encoder = |number: usize| {
                    let word = first.and_then(|enums| enums.get(number - loaded));
                    word.is_some_and(|word| word.starts_with(['E', 'e']))
                };
                (loaded..loaded + count.min(1000))
                    .map(|number| instance_name(kind, number, is_encoder(number)))
                    .collect()
            }
        };
        for (number, given) in names.into_iter().enumerate() {
            let (mut options, mut renamed, mut set) = (Vec::new(), Vec::new(), Vec::new());
            for (key, list) in &values {
                if own_words.contains(key) {
                    continue;
                }
                // A list that is too short holds for the others, too.
                let value = list.get(number).or(list.last()).copied().unwrap_or_default();
                match self::options(kind, key, value) {
                    Ok(known) => options.extend(known),
                    Err(why) => self.refuse(at, format!("{key}={value}: {why}")),
                }
                if (kind.name, *key) == ("enum", "enums") {
                    (renamed, set) = labels(value);
                }
            }
            if let Some(text) = texts.as_ref().and_then(|texts| texts.get(number)) {
                self.refuse(
                    at,
                    format!("{text:?} is to be a text of a program, for {given}.show: docs/logic.md"),
                );
            }
            let numbers: Vec<(String, i64)> = options.iter().map(|(key, number, _)| (key.clone(), *number)).collect();
            let mut made = match kind.make(&numbers) {
                Ok(made) => made,
                Err(error) => {
                    self.refuse(at, error.to_string());
                    continue;
                }
            };
            if self.instances.iter().any(|instance| instance.given == given) {
                self.refuse(at, format!("{given:?} is there already"));
                continue;
            }
            let is_taken = |name: &str| self.instances.iter().any(|instance| instance.made.name == name);
            let name = distinct(name_here(&given), is_taken);
            self.instances.push(Instance {
                given,
                renamed,
                made: Made {
                    name,
                    kind: kind.name,
                    options: options.into_iter().map(|(key, _, text)| (key, text)).collect(),
                    set,
                    after_motion: false,
                },
                pins: made.pins(),
                kind,
                place: command.place.clone(),
            });
        }
    }

    /// Motion and threads, whose periods are told where they are not the cycle.
    fn part_of_the_control(&mut self, at: usize, command: &Command) {
        let value = |key: &str| {
            let mut words = command.words[2..].iter().filter_map(|word| word.split_once('='));
            words.find(|(name, _)| *name == key).map(|(_, value)| value)
        };
        let cycle_ns = self.own.cycle_ns;
        match command.words[1].as_str() {
            "threads" => {
                for number in 1..=3 {
                    let period = value(&format!("period{number}")).and_then(|period| period.parse().ok());
                    if let (Some(name), Some(period_ns)) = (value(&format!("name{number}")), period) {
                        self.threads.insert(name.to_owned(), period_ns);
                    }
                }
            }
            "motmod" => {
                let period_ns = value("servo_period_nsec").and_then(|period| period.parse().ok());
                if let Some(period_ns) = period_ns.filter(|period_ns| *period_ns != cycle_ns) {
                    return self.refuse(at, other_period(period_ns, cycle_ns));
                }
            }
            _ => {}
        }
        self.needless += 1;
    }

    fn kinematics(&mut self, at: usize, module: &str) {
        let family = KINEMATICS
            .iter()
            .find(|(known, _)| *known == module)
            .map(|(_, family)| *family);
        match family {
            Some(family) if self.exactly && family == self.own.kinematics => self.needless += 1,
            Some(family) => self.refuse(
                at,
                format!("machine.kinematics = {family:?} does the same, its measures are keys of [kinematics]"),
            ),
            None => self.refuse(
                at,
                "there are no such kinematics here: docs/machine-file.md has those that there are",
            ),
        }
    }

    fn signal(&mut self, name: &str) -> &mut Signal {
        if !self.signals.contains_key(name) {
            self.order.push(name.to_owned());
        }
        self.signals.entry(name.to_owned()).or_default()
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

    fn link(&mut self, signal: &str, pin: &str, at: usize) {
        let pin = self.pin_here(pin);
        self.tell_difference(&pin, at);
        let pins = &mut self.signal(signal).pins;
        if !pins.iter().any(|(known, _)| *known == pin) {
            pins.push((pin, at));
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

    fn add_function(&mut self, function: &str, thread: &str, position: Option<&&str>, at: usize) {
        let function = self.pin_here(function);
        let is_motion = ["motion-command-handler", "motion-controller"].contains(&function.as_str());
        if !is_motion && self.of_function(&function).is_empty() {
            return self.refuse(at, self.no_function(&function));
        }
        match self.threads.get(thread) {
            Some(period_ns) if *period_ns != self.own.cycle_ns => {
                let (there, here) = (period_text(*period_ns), period_text(self.own.cycle_ns));
                self.refuse(
                    at,
                    format!("{thread} runs every {there}, here it runs once a cycle of {here}: convert what counts its calls"),
                );
            }
            None if thread.starts_with("base") || thread.starts_with("fast") => {
                self.refuse(at, format!("there is no {thread}: it runs once a cycle"));
            }
            _ => {}
        }
        if is_motion {
            self.needless += 1;
        }
        let count = self.functions.len();
        let index = match position.and_then(|position| position.parse::<i64>().ok()) {
            Some(place @ 1..) => (usize::try_from(place).unwrap_or(count) - 1).min(count),
            Some(place @ ..=-1) => (count + 1).saturating_sub(usize::try_from(-place).unwrap_or(0)),
            Some(0) | None => count,
        };
        self.functions.insert(index, (function, at));
    }

    /// Instances that a function updates: `and2.0`, `pid.0.do-pid-calcs`, or `encoder.update-counters` for all of a kind.
    fn of_function(&self, function: &str) -> Vec<usize> {
        let all = self.instances.iter().enumerate();
        all.filter(|(_, instance)| functions(instance).iter().any(|known| known == function))
            .map(|(at, _)| at)
            .collect()
    }

    /// Why there is no such function.
    fn no_function(&self, function: &str) -> String {
        let module = function.split('.').next().unwrap_or_default();
        let is_of = |instance: &Instance| instance.made.name == module || name_here(instance.kind.name) == module;
        if !self.instances.iter().any(is_of) && find(module).is_none() {
            return "a function of a module that was not translated".to_owned();
        }
        let known: Vec<String> = self.instances.iter().flat_map(functions).collect();
        let near = hal_pins::nearest(function, known.iter().map(String::as_str));
        let hint = near.map_or(String::new(), |near| format!("; {near} is the nearest"));
        format!("no loadrt makes a function {function}{hint}")
    }

    /// Puts the instances in the order of their functions; those behind the motion controller run after motion.
    fn place_functions(&mut self) {
        let motion = self
            .functions
            .iter()
            .position(|(function, _)| function == "motion-controller");
        let mut order: Vec<(usize, bool)> = Vec::new();
        let mut again = Vec::new();
        for (number, (function, at)) in self.functions.iter().enumerate() {
            let after = motion.is_some_and(|motion| number > motion);
            for instance in self.of_function(function) {
                match order.iter().find(|(known, _)| *known == instance) {
                    None => order.push((instance, after)),
                    Some((_, before)) if *before != after => again.push(*at),
                    Some(_) => {}
                }
            }
        }
        for at in again {
            self.refuse(
                at,
                "all functions of a component run in one call here, where the first one stands",
            );
        }
        let mut instances: Vec<Option<Instance>> = std::mem::take(&mut self.instances).into_iter().map(Some).collect();
        for (at, after) in order {
            let Some(mut instance) = instances[at].take() else {
                continue;
            };
            instance.made.after_motion = after;
            self.instances.push(instance);
        }
        for instance in instances.into_iter().flatten() {
            let name = instance.made.name.clone();
            let place = instance.place.clone();
            self.instances.push(instance);
            self.refused.push(Refused {
                place,
                text: name,
                why: "no addf adds it to a thread: put it where it is to run; it stands last".to_owned(),
            });
        }
    }

    /// Nets, with what is wrong with them; values of signals that nothing writes go to the pins that read them.
    fn wires(&mut self) -> Vec<Wire> {
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
    fn unread(&self, unread: usize, wires: &[Wire]) -> Option<Wire> {
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
    fn stop_unwired(&self, wires: &mut [Wire]) {
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
        ["halui", "machine", "on" | "off"] => "`isocnc on`, `isocnc off`, or a client of the control socket",
        ["halui", "program", "pause"] => "motion.feed-hold holds, halui.program.resume goes on",
        ["halui", "abort"] => "halui.program.stop",
        _ => return None,
    })
}

/// Functions that update an instance, by their names there: most kinds have one of the instance's own name, some one for all instances.
fn functions(instance: &Instance) -> Vec<String> {
    let Instance { made, kind, .. } = instance;
    let own = |names: &[&str]| -> Vec<String> { names.iter().map(|name| format!("{}.{name}", made.name)).collect() };
    let of_all = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
    match kind.name {
        "pid" => own(&["do-pid-calcs"]),
        "siggen" => own(&["update"]),
        "gantry" => own(&["read", "write"]),
        "encoder" => of_all(&["encoder.update-counters", "encoder.capture-position"]),
        "counter" => of_all(&["counter.update-counters", "counter.capture-position"]),
        "watchdog" => of_all(&["watchdog.process", "watchdog.set-timeouts"]),
        "sim_encoder" => of_all(&["sim-encoder.make-pulses", "sim-encoder.update-speed"]),
        "weighted_sum" => of_all(&["process-wsums"]),
        _ => vec![made.name.clone()],
    }
}

/// The module's name, for a look-up.
fn module_name(kind: &'static Kind) -> &'static &'static str {
    &kind.name
}

/// How LinuxCNC calls an instance that has no name of its own.
fn instance_name(kind: &Kind, number: usize, is_encoder: bool) -> String {
    match kind.name {
        "charge_pump" | "watchdog" => name_here(kind.name),
        "mux_generic" => format!("mux-gen.{number:02}"),
        "enum" if is_encoder => format!("enum-encode.{number:02}"),
        "enum" => format!("enum-decode.{number:02}"),
        "weighted_sum" => format!("wsum.{number}"),
        name => format!("{}.{number}", name_here(name)),
    }
}

/// Options by a word of `loadrt`: for each its key here, its number, and how it is written.
fn options(kind: &Kind, key: &str, value: &str) -> Result<Vec<(String, i64, String)>, String> {
    let parts = match (kind.name, key) {
        // Letters of two types, and the number of values: `fs12`.
        ("mux_generic", "config") => {
            let size: String = value.chars().filter(char::is_ascii_digit).collect();
            let types = value.chars().filter(|c| !c.is_ascii_digit());
            let types: Option<Vec<&str>> = types
                .map(|letter| {
                    let types = ["bit", "float", "s32", "u32"];
                    types
                        .into_iter()
                        .find(|name| name.starts_with(letter.to_ascii_lowercase()))
                })
                .collect();
            let (input, output) = match types.as_deref() {
                Some([both]) => (*both, *both),
                Some([input, output]) => (*input, *output),
                _ => return Err("is no number with one or two of the letters b, f, s, u".to_owned()),
            };
            vec![
                ("size", size),
                ("input", input.to_owned()),
                ("output", output.to_owned()),
            ]
        }
        // `D` or `E`, and labels; an empty one leaves out its number.
        ("enum", "enums") => {
            let mode = match value.split(';').next().unwrap_or_default().chars().next() {
                Some('D' | 'd') => "decode",
                Some('E' | 'e') => "encode",
                _ => return Err("begins with neither D; nor E;".to_owned()),
            };
            vec![
                ("mode", mode.to_owned()),
                ("size", (labels(value).0.len() / 2).to_string()),
            ]
        }
        _ => vec![(key, value.to_owned())],
    };
    parts.iter().map(|(key, value)| option(kind, key, value)).collect()
}

/// Pins of an `enum` by their labels, as they are called there and here; and numbers that are not those of their places.
fn labels(value: &str) -> (Pairs, Pairs) {
    let end = match value.starts_with(['E', 'e']) {
        true => "in",
        false => "out",
    };
    let numbered = value.split(';').skip(1).enumerate();
    let labels: Vec<(usize, &str)> = numbered.filter(|(_, label)| !label.is_empty()).collect();
    let mut renamed = Vec::new();
    for (place, (_, label)) in labels.iter().enumerate() {
        renamed.push((format!("{label}-{end}"), format!("{end}-{place:02}")));
        renamed.push((format!("{label}-val"), format!("val-{place:02}")));
    }
    let places = labels.iter().enumerate();
    let set = places.filter(|(place, (number, _))| place != number);
    let set = set.map(|(place, (number, _))| (format!("val-{place:02}"), number.to_string()));
    (renamed, set.collect())
}

/// An option by its key: its key here, its number, and how it is written.
fn option(kind: &Kind, key: &str, value: &str) -> Result<(String, i64, String), String> {
    let name = match (kind.name, key) {
        ("weighted_sum", "wsum_sizes") | ("multiswitch", "cfg") => "personality",
        _ => key,
    };
    let Some(spec) = kind.options.iter().find(|spec| spec.name == name) else {
        return Err("is no option here".to_owned());
    };
    if !spec.words.is_empty() {
        let at = spec.words.iter().position(|word| *word == value);
        let number = at.and_then(|at| i64::try_from(at).ok());
        return number
            .map(|number| (name.to_owned(), number, format!("{value:?}")))
            .ok_or_else(|| format!("must be one of {}", spec.words.join(", ")));
    }
    let number = match value.strip_prefix("0x") {
        Some(digits) => i64::from_str_radix(digits, 16).ok(),
        None => value.parse().ok(),
    };
    // Of LinuxCNC's personality of `logic` the upper octet chooses outputs; all are there here.
    let number = number.map(|number| if kind.name == "logic" { number & 0xFF } else { number });
    let [least, most] = spec.range;
    number
        .filter(|number| (least..=most).contains(number))
        .map(|number| (name.to_owned(), number, number.to_string()))
        .ok_or_else(|| format!("must be {least} to {most}"))
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
