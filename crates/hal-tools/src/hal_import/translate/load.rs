//! `loadrt`: modules to instances of components.
//!
//! In:  the words of a command. Out: instances with their options and names; parts of the control and kinematics are there already.

use super::{Instance, Pairs, Translator, distinct, name_here, other_period};
use crate::hal_import::read::Command;
use crate::hal_import::write::Made;
use components::{CATALOGUE, Kind, find};
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

/// Words of `loadrt` that are of no kind of component alone.
const OWN_WORDS: [&str; 4] = ["count", "num_chan", "names", "debug"];

/// Values of the words of a `loadrt`, by their keys.
type Values<'c> = BTreeMap<&'c str, Vec<&'c str>>;

impl Translator<'_> {
    /// `loadrt MODULE count=N names=a,b key=value ..`
    pub(super) fn load(&mut self, at: usize, command: &Command) {
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
        let mut values = Values::new();
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
        let texts = values.remove("messages");
        let names = self.names(kind, &values);
        for (number, given) in names.into_iter().enumerate() {
            let (mut options, mut renamed, mut set) = (Vec::new(), Vec::new(), Vec::new());
            for (key, list) in &values {
                if OWN_WORDS.contains(key) {
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

    /// Names of the instances there: those that the words give, or numbered ones.
    fn names(&self, kind: &'static Kind, values: &Values<'_>) -> Vec<String> {
        if let Some(names) = values.get("names") {
            return names.iter().map(|name| (*name).to_owned()).collect();
        }
        let lists = values.iter().filter(|(key, _)| !OWN_WORDS.contains(key));
        let longest = lists.map(|(_, list)| list.len()).max();
        let count = ["count", "num_chan"]
            .iter()
            .find_map(|key| values.get(key)?.first()?.parse::<usize>().ok());
        let usual = if ["pid", "encoder"].contains(&kind.name) { 3 } else { 1 };
        let count = count.or(longest).unwrap_or(usual);
        let same = self.instances.iter().filter(|instance| instance.kind.name == kind.name);
        let loaded = same.count();
        let enums = values.get("enums").filter(|_| kind.name == "enum");
        let is_encoder = |number: usize| {
            let word = enums.and_then(|enums| enums.get(number - loaded));
            word.is_some_and(|word| word.starts_with(['E', 'e']))
        };
        (loaded..loaded + count.min(1000))
            .map(|number| instance_name(kind, number, is_encoder(number)))
            .collect()
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
