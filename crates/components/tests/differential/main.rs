//! Every component that LinuxCNC has, too, beside LinuxCNC's own function: the same inputs, the same outputs, call by call.
//!
//! `ISOCNC_HALRUN` names the program that `scripts/halrun-oracle.sh` makes; without it the tests say so and end. For each component and
//! set of options there are `ISOCNC_DIFFERENTIAL_CASES` cases (2 if it is not set) of `ISOCNC_DIFFERENTIAL_ROWS` rows (500), from the seed
//! `ISOCNC_DIFFERENTIAL_SEED`. Ordinary inputs may not differ; inputs at the edges of their types only in components that
//! `components::DIFFERENCES` names.

mod oracle;
use crate::rig;
mod subjects;

use components::{CATALOGUE, DIFFERENCES};
use hal_pins::{AnyValue, Type};
use oracle::Theirs;
use rig::{Rig, T};
use std::collections::BTreeMap;
use std::env;
use subjects::Of::{From, Often, Set};
use subjects::{SUBJECTS, Subject};

/// Components that LinuxCNC's package of Debian 12 has no function for.
const NOT_PACKAGED: [&str; 11] = [
    "bitmerge",
    "blink",
    "enum",
    "hand_wheel",
    "led_dim",
    // It shows its text itself.
    "message",
    "momentary2nist",
    "probe_filter",
    "safety_latch",
    "thermal_compensation",
    // Of the same name, but what is described today came later.
    "toggle2nist",
];

/// Random numbers (xorshift64*).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// Evenly from 0 to below 1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn one<V: Copy>(&mut self, values: &[V]) -> V {
        values[self.next() as usize % values.len()]
    }

    /// At the edge of a type.
    fn edge(&mut self, kind: Type) -> AnyValue {
        const FLOATS: [f64; 12] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.5,
            1e-13,
            1e9,
            -3e9,
            1e20,
            1e300,
            f64::INFINITY,
            f64::NAN,
        ];
        match kind {
            Type::Bit => AnyValue::Bit(self.next() & 1 != 0),
            Type::S32 => AnyValue::S32(self.one(&[i32::MIN, -1, 0, 1, i32::MAX - 1, i32::MAX])),
            Type::U32 => AnyValue::U32(self.one(&[0, 1, i32::MAX as u32, 1 << 31, u32::MAX])),
            _ => AnyValue::Float(self.one(&FLOATS)),
        }
    }
}

fn typed(kind: Type, number: f64) -> AnyValue {
    match kind {
        Type::Bit => AnyValue::Bit(number >= 0.5),
        Type::S32 => AnyValue::S32(number.round() as i32),
        Type::U32 => AnyValue::U32(number.round().abs() as u32),
        _ => AnyValue::Float(number),
    }
}

/// A case: what was put on the inputs, and what ours made of it.
struct Case {
    rig: Rig,
    inputs: Vec<Vec<AnyValue>>,
    outputs: Vec<Vec<AnyValue>>,
}

impl Case {
    fn new(subject: &Subject, seed: u64, rows: usize, edges: bool) -> Case {
        let mut random = Random(seed | 1);
        let mut rig = Rig::new(subject.kind, subject.options);
        let names: Vec<String> = rig.inputs().iter().map(|pin| pin.name.clone()).collect();
        let of = |pin: usize| {
            let found = subject.values.iter().find(|(name, _)| *name == names[pin]);
            found.map(|(_, of)| *of)
        };
        let mut values: Vec<AnyValue> = rig.inputs().iter().map(|pin| pin.default).collect();
        for (pin, value) in values.iter_mut().enumerate() {
            match (of(pin), *value) {
                (Some(Set(choices)), _) => *value = typed(value.kind(), random.one(choices)),
                (Some(From(low, high)), AnyValue::Float(first)) if !(low..=high).contains(&first) => {
                    *value = AnyValue::Float(low);
                }
                _ => {}
            }
        }
        let (mut inputs, mut outputs, mut state) = (Vec::new(), Vec::new(), 0.0);
        for row in 0..rows {
            for (pin, value) in values.iter_mut().enumerate() {
                let keeps = match of(pin) {
                    Some(Often(change)) => 1.0 - change,
                    Some(Set(_)) => 1.0,
                    _ => 0.6,
                };
                // The first call makes no edge here: it finds what is at rest.
                if row == 0 || random.unit() < keeps {
                    continue;
                }
                let (low, high) = match of(pin) {
                    Some(From(low, high)) => (low, high),
                    _ => (-10.0, 10.0),
                };
                let number = low + (high - low) * random.unit();
                *value = match value.kind() {
                    kind if edges && random.unit() < 0.3 => random.edge(kind),
                    Type::Bit => AnyValue::Bit(random.next() & 1 != 0),
                    // Coarse, so that equal values and edges are met.
                    Type::Float if !matches!(of(pin), Some(From(..))) => AnyValue::Float((number * 4.0).round() / 4.0),
                    kind => typed(kind, number),
                };
            }
            if let Some(machine) = subject.machine {
                machine(&mut state, &rig, &mut values);
            }
            for (pin, value) in values.iter().enumerate() {
                if !subject.off_net.contains(&names[pin].as_str()) {
                    rig.set_at(pin, *value);
                }
            }
            rig.update(T);
            inputs.push(values.clone());
            outputs.push(rig.outputs().to_vec());
        }
        Case { rig, inputs, outputs }
    }

    fn input(&self, row: usize, name: &str) -> Option<AnyValue> {
        let at = self.rig.inputs().iter().position(|pin| pin.name == name)?;
        Some(self.inputs[row][at])
    }

    fn output(&self, row: usize, name: &str) -> Option<AnyValue> {
        let outputs = &self.rig.pins[self.rig.inputs().len()..];
        let at = outputs.iter().position(|pin| pin.name == name)?;
        Some(self.outputs[row][at])
    }

    /// The rows as the oracle reads them. What is there and not here has its first value, and so has what no net reaches.
    fn octets(&self, theirs: &[Theirs], off_net: &[&str]) -> Vec<u8> {
        let mut octets = Vec::new();
        for row in 0..self.inputs.len() {
            octets.extend(((T * 1e9).round() as i64).to_ne_bytes());
            for pin in theirs.iter().filter(|pin| pin.is_input) {
                let put = self
                    .input(row, &pin.name)
                    .filter(|_| !off_net.contains(&pin.name.as_str()));
                octets.extend(oracle::octets(put.unwrap_or(pin.default)));
            }
        }
        octets
    }

    /// Inputs of the rows up to this one.
    fn shown(&self, row: usize) -> String {
        let rows = &self.inputs[row.saturating_sub(4)..=row];
        let mut text = String::new();
        for (at, pin) in self.rig.inputs().iter().enumerate() {
            let values: Vec<String> = rows.iter().map(|row| row[at].to_string()).collect();
            text += &format!("      {} {}\n", pin.name, values.join(" "));
        }
        text
    }
}

fn same(ours: AnyValue, theirs: AnyValue, tolerance: f64) -> bool {
    match (ours, theirs) {
        (AnyValue::Float(a), AnyValue::Float(b)) => {
            a == b || (a - b).abs() <= tolerance * (1.0 + b.abs()) || a.is_nan() && b.is_nan()
        }
        (a, b) => a == b,
    }
}

/// Outputs that differ in a case, each with the first row, both values and the inputs there.
fn differences(oracle: &str, subject: &Subject, seed: u64, rows: usize, edges: bool) -> BTreeMap<String, String> {
    // LinuxCNC's pi has eight digits there, and twelve in `biquad`.
    let tolerance = if subject.kind == "siggen" { 1e-6 } else { 1e-9 };
    let (theirs, _) = oracle::run(oracle, subject, &[]);
    let case = Case::new(subject, seed, rows, edges);
    let (answered, cells) = oracle::run(oracle, subject, &case.octets(&theirs, subject.off_net));
    if answered.is_empty() {
        return BTreeMap::from([("all".to_owned(), "LinuxCNC's crashes".to_owned())]);
    }
    let outputs: Vec<&Theirs> = theirs.iter().filter(|pin| pin.is_output).collect();
    assert_eq!(cells.len(), rows * outputs.len() * 8, "{}", subject.kind);
    let mut found = BTreeMap::new();
    for (row, cells) in cells.chunks(outputs.len() * 8).enumerate() {
        for (pin, cell) in outputs.iter().zip(cells.chunks(8)) {
            let theirs = pin.value(cell);
            // What LinuxCNC clears in `index-enable` is `indexed` here.
            let (ours, theirs) = match (pin.name.as_str(), case.output(row, "indexed")) {
                ("index-enable", Some(indexed)) => {
                    let asked = case.input(row, "index-enable") == Some(AnyValue::Bit(true));
                    (Some(indexed), AnyValue::Bit(asked && theirs == AnyValue::Bit(false)))
                }
                (name, _) => (case.output(row, name), theirs),
            };
            let Some(ours) = ours.filter(|ours| !same(*ours, theirs, tolerance)) else {
                continue;
            };
            found
                .entry(pin.name.clone())
                .or_insert_with(|| format!("row {row}: ours {ours:?}, LinuxCNC's {theirs:?}\n{}", case.shown(row)));
        }
    }
    found
}

fn number(name: &str, default: u64) -> u64 {
    env::var(name).map_or(default, |text| {
        text.parse().unwrap_or_else(|_| panic!("{name}: {text}"))
    })
}

/// The program to compare with; without one the test says so and ends.
fn oracle() -> Option<String> {
    let named = env::var("ISOCNC_HALRUN").ok();
    if named.is_none() {
        eprintln!("skipped: ISOCNC_HALRUN does not name the program that scripts/halrun-oracle.sh makes");
    }
    named
}

/// Runs all cases; outputs that differ where they may not, shown with the first case of each.
fn unexpected(edges: bool, is_free: impl Fn(&Subject, &str) -> bool) -> Vec<String> {
    let Some(oracle) = oracle() else {
        return Vec::new();
    };
    let cases = number("ISOCNC_DIFFERENTIAL_CASES", 2);
    let rows = usize::try_from(number("ISOCNC_DIFFERENTIAL_ROWS", 500)).unwrap();
    let seed = number("ISOCNC_DIFFERENTIAL_SEED", 1);
    let mut told = Vec::new();
    for subject in SUBJECTS {
        let mut first: BTreeMap<String, (u64, String)> = BTreeMap::new();
        for case in 0..cases {
            let seed = seed.wrapping_mul(1_000_003).wrapping_add(case * 7919 + 12345);
            for (pin, text) in differences(&oracle, subject, seed, rows, edges) {
                first.entry(pin).or_insert((0, text)).0 += 1;
            }
        }
        first.retain(|pin, _| !is_free(subject, pin));
        for (pin, (count, text)) in first {
            let Subject {
                kind, options, words, ..
            } = subject;
            told.push(format!(
                "{kind} {options:?} {words:?}: {pin} in {count} of {cases} cases, {text}"
            ));
        }
    }
    let compared = SUBJECTS.len() as u64 * cases;
    eprintln!(
        "{compared} cases of {rows} rows compared, {} outputs differ",
        told.len()
    );
    told
}

#[test]
fn ordinary_inputs_give_what_linuxcnc_s_functions_give() {
    let told = unexpected(false, |subject, pin| subject.free.contains(&pin));
    assert!(told.is_empty(), "{}", told.join("\n"));
}

#[test]
fn inputs_at_the_edges_differ_only_where_the_table_says_so() {
    let told = unexpected(true, |subject, _| {
        DIFFERENCES
            .iter()
            .any(|difference| difference.kinds.contains(&subject.kind))
    });
    assert!(told.is_empty(), "{}", told.join("\n"));
}

#[test]
fn first_values_are_linuxcnc_s() {
    let Some(oracle) = oracle() else { return };
    for subject in SUBJECTS {
        let (theirs, _) = oracle::run(&oracle, subject, &[]);
        let rig = Rig::new(subject.kind, subject.options);
        for pin in rig.inputs() {
            if let Some(theirs) = theirs.iter().find(|theirs| theirs.name == pin.name) {
                assert_eq!(pin.default, theirs.default, "{} {}", subject.kind, pin.name);
            }
        }
    }
}

#[test]
fn every_component_is_compared_or_not_packaged() {
    for kind in &CATALOGUE {
        let is_compared = SUBJECTS.iter().any(|subject| subject.kind == kind.name);
        assert_ne!(is_compared, NOT_PACKAGED.contains(&kind.name), "{}", kind.name);
    }
    for subject in SUBJECTS {
        let is_told = DIFFERENCES
            .iter()
            .any(|difference| difference.kinds.contains(&subject.kind));
        assert!(
            subject.free.is_empty() || is_told,
            "{} is not in the table",
            subject.kind
        );
    }
}
