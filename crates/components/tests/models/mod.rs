//! Every component against a simple model, with random inputs.
//!
//! A model says what the outputs are by what the inputs are, or have been, in other words than the component: a definition, a
//! sum over all that was, a search.

mod arithmetic;
mod convert;
mod counting;
mod filters;
mod keys;
mod limits;
mod logic;
mod machine;
mod pid;
mod select;
mod spindle;
mod timing;

use crate::rig::{Rig, T};
use hal_pins::{AnyValue, Type};
use proptest::test_runner::{Config, TestRunner};

const CALLS: usize = 120;

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
}

/// Runs a component with random inputs: a pin named in `ranges` within its range, numbers within ±10, others small. A pin keeps its
/// value for a few calls. `check` sees the rig after each call, and keeps what it needs to remember.
fn model<S: Default>(kind: &str, options: &[(&str, i64)], ranges: &[(&str, f64, f64)], check: impl Fn(&mut S, &Rig)) {
    let mut runner = TestRunner::new(Config {
        cases: 48,
        failure_persistence: None,
        ..Config::default()
    });
    let run = runner.run(&proptest::prelude::any::<u64>(), |seed| {
        let mut random = Random(seed | 1);
        let mut rig = Rig::new(kind, options);
        let mut state = S::default();
        for call in 0..CALLS {
            for pin in 0..rig.inputs().len() {
                // What counts on a net alone stays off it.
                if rig.pins[pin].name.ends_with("-deriv") {
                    continue;
                }
                let keeps = random.unit() < 0.6;
                let range = ranges.iter().find(|(name, ..)| *name == rig.pins[pin].name);
                // A range of one value is a setting: from the first call on.
                if keeps && !(call == 0 && range.is_some()) {
                    continue;
                }
                let (low, high) = range.map_or((-10.0, 10.0), |(_, low, high)| (*low, *high));
                let number = low + (high - low) * random.unit();
                let value = match rig.pins[pin].default.kind() {
                    Type::Bit if range.is_some() => AnyValue::Bit(number >= 0.5),
                    Type::Bit => AnyValue::Bit(random.next() & 1 != 0),
                    Type::S32 => AnyValue::S32(number.round() as i32),
                    Type::U32 => AnyValue::U32(number.round().abs() as u32),
                    // Coarse, so that equal values and edges are met.
                    _ if range.is_none() => AnyValue::Float((number * 4.0).round() / 4.0),
                    _ => AnyValue::Float(number),
                };
                rig.set_at(pin, value);
            }
            rig.update(T);
            check(&mut state, &rig);
        }
        Ok(())
    });
    if let Err(error) = run {
        panic!("{kind}: {error}");
    }
}

/// One whose outputs depend on the inputs of the same call only.
fn stateless(kind: &str, options: &[(&str, i64)], check: impl Fn(&Rig)) {
    model::<()>(kind, options, &[], |_, rig| check(rig));
}

#[track_caller]
fn about(is: f64, expected: f64) {
    assert!(
        (is - expected).abs() <= 1e-9 * (1.0 + expected.abs()),
        "{is}, expected {expected}"
    );
}

fn pins(rig: &Rig, count: usize, name: impl Fn(usize) -> String) -> Vec<f64> {
    (0..count)
        .map(|at| match rig.get(&name(at)) {
            AnyValue::Bit(value) => f64::from(u8::from(value)),
            _ => rig.number(&name(at)),
        })
        .collect()
}

/// The bits as a number, by its digits.
fn place(bits: &[f64]) -> usize {
    let digits: String = bits
        .iter()
        .rev()
        .map(|bit| if *bit > 0.0 { '1' } else { '0' })
        .collect();
    usize::from_str_radix(&digits, 2).unwrap()
}

/// Calls since a bit was something else, and what it was in the call before.
#[derive(Default)]
struct Past {
    seen: Vec<bool>,
}

impl Past {
    fn push(&mut self, now: bool) {
        self.seen.push(now);
    }
    fn before(&self) -> Option<bool> {
        self.seen.iter().rev().nth(1).copied()
    }
    fn now(&self) -> bool {
        *self.seen.last().unwrap()
    }
    fn rose(&self) -> bool {
        self.now() && self.before() == Some(false)
    }
    fn fell(&self) -> bool {
        !self.now() && self.before() == Some(true)
    }
    /// Calls in a row, this one included, that it has been what it is.
    fn lasts(&self) -> usize {
        self.seen.iter().rev().take_while(|was| **was == self.now()).count()
    }
}
