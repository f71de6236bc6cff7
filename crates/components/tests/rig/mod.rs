//! A component on the bench: pins by name, no shared memory.
#![allow(dead_code, reason = "each test file uses a part of it")]

use components::{Component, Direction, PinSpec, Slot, find};
use hal_pins::{AnyValue, Type};

/// The period of the tests, s.
pub(crate) const T: f64 = 0.001;

/// One instance.
pub(crate) struct Rig {
    component: Box<dyn Component>,
    /// All pins, inputs first.
    pub(crate) pins: Vec<PinSpec>,
    /// Values of the pins.
    values: Vec<AnyValue>,
    /// What was set: a net reaches it.
    is_set: Vec<bool>,
    inputs: usize,
}

impl Rig {
    pub(crate) fn new(kind: &str, options: &[(&str, i64)]) -> Rig {
        let options: Vec<_> = options.iter().map(|(key, value)| ((*key).to_owned(), *value)).collect();
        let kind = find(kind).unwrap_or_else(|| panic!("no component {kind}"));
        let mut component = kind.make(&options).unwrap();
        let pins = component.pins();
        let values = pins.iter().map(|pin| pin.default).collect();
        let is_set = vec![false; pins.len()];
        let inputs = pins.iter().filter(|pin| pin.direction == Direction::In).count();
        Rig {
            component,
            pins,
            values,
            is_set,
            inputs,
        }
    }

    fn index(&self, name: &str) -> usize {
        let found = self.pins.iter().position(|pin| pin.name == name);
        found.unwrap_or_else(|| panic!("no pin {name}"))
    }

    pub(crate) fn inputs(&self) -> &[PinSpec] {
        &self.pins[..self.inputs]
    }

    pub(crate) fn set_at(&mut self, index: usize, value: AnyValue) {
        assert_eq!(value.kind(), self.values[index].kind(), "{}", self.pins[index].name);
        self.values[index] = value;
        self.is_set[index] = true;
    }

    pub(crate) fn set(&mut self, name: &str, value: impl Into<AnyValue>) {
        self.set_at(self.index(name), value.into());
    }

    pub(crate) fn update(&mut self, period_s: f64) {
        let mut at = 0;
        let (values, is_set) = (&mut self.values, &self.is_set);
        self.component.visit(Direction::In, &mut |pin| {
            match (pin.slot, values[at]) {
                (Slot::Bit(to), AnyValue::Bit(value)) => *to = value,
                (Slot::S32(to), AnyValue::S32(value)) => *to = value,
                (Slot::U32(to), AnyValue::U32(value)) => *to = value,
                (Slot::Float(to), AnyValue::Float(value)) => *to = value,
                (Slot::OnNet(to), AnyValue::Float(value)) => *to = is_set[at].then_some(value),
                other => panic!("{other:?}"),
            }
            at += 1;
        });
        self.component.update(period_s);
        self.component.visit(Direction::Out, &mut |pin| {
            values[at] = pin.slot.value();
            at += 1;
        });
    }

    pub(crate) fn get(&self, name: &str) -> AnyValue {
        self.values[self.index(name)]
    }

    pub(crate) fn bit(&self, name: &str) -> bool {
        match self.get(name) {
            AnyValue::Bit(value) => value,
            other => panic!("{name} is {other:?}"),
        }
    }

    /// Any number, as a float.
    pub(crate) fn number(&self, name: &str) -> f64 {
        match self.get(name) {
            AnyValue::Float(value) => value,
            AnyValue::S32(value) => value.into(),
            AnyValue::U32(value) => value.into(),
            other => panic!("{name} is {other:?}"),
        }
    }

    pub(crate) fn outputs(&self) -> &[AnyValue] {
        &self.values[self.inputs..]
    }
}

/// Text as a value of a type; bits are 0 and 1.
pub(crate) fn value(kind: Type, text: &str) -> AnyValue {
    match (kind, text) {
        (Type::Float, "nan") => AnyValue::Float(f64::NAN),
        _ => AnyValue::parse(kind, text).unwrap(),
    }
}

/// Runs a component call by call as a table says: a pin a line, a call a column; `>` before those that are expected. A line with
/// one value holds for all calls. `-`: anything.
pub(crate) fn table(kind: &str, options: &[(&str, i64)], period_s: f64, text: &str) {
    let mut rig = Rig::new(kind, options);
    let lines: Vec<(bool, &str, Vec<&str>)> = text
        .lines()
        .filter(|line| !line.trim().is_empty())
        .map(|line| {
            let line = line.trim();
            let (expected, line) = match line.strip_prefix('>') {
                Some(line) => (true, line),
                None => (false, line),
            };
            let mut words = line.split_whitespace();
            (expected, words.next().unwrap(), words.collect())
        })
        .collect();
    let calls = lines.iter().map(|(.., values)| values.len()).max().unwrap();
    for call in 0..calls {
        for (expected, name, values) in &lines {
            assert!(values.len() == 1 || values.len() == calls, "{kind} {name}: {values:?}");
            if !expected {
                let pin = rig.index(name);
                let text = values[call.min(values.len() - 1)];
                rig.set_at(pin, value(rig.pins[pin].default.kind(), text));
            }
        }
        rig.update(period_s);
        for (expected, name, values) in &lines {
            let text = values[call.min(values.len() - 1)];
            if *expected && text != "-" {
                let is = rig.get(name);
                let wanted = value(is.kind(), text);
                let same = match (is, wanted) {
                    (AnyValue::Float(is), AnyValue::Float(wanted)) => {
                        (is - wanted).abs() <= 1e-9 * (1.0 + wanted.abs()) || is.is_nan() && wanted.is_nan()
                    }
                    (is, wanted) => is == wanted,
                };
                assert!(same, "{kind}, call {call}: {name} is {is:?}, expected {text}");
            }
        }
    }
}
