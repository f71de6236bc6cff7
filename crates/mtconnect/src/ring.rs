//! Observations, each with its number, as many as there is room for; and how everything was at any of them.

use std::collections::VecDeque;
use std::time::Duration;

/// What was observed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Unavailable,
    Text(String),
    /// Keys and values.
    Set(Vec<(String, String)>),
    Condition(Condition),
}

/// A condition; several of an item may be active together, told apart by their code.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Condition {
    /// Nothing is wrong any more; with a code, this is not.
    Normal(Option<String>),
    Warning {
        code: String,
        text: String,
    },
    Fault {
        code: String,
        text: String,
    },
}

/// An observation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Observation {
    pub(crate) sequence: u64,
    /// Since 1970.
    pub(crate) time: Duration,
    pub(crate) item: usize,
    pub(crate) value: Value,
}

/// The latest of each item: one, but for conditions.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Latest(Vec<Vec<Observation>>);

impl Latest {
    fn put(&mut self, observation: &Observation) {
        let of_item = &mut self.0[observation.item];
        match &observation.value {
            Value::Condition(Condition::Normal(Some(code))) => {
                let before = of_item.len();
                of_item.retain(|known| known.value.code() != Some(code));
                let was_last = of_item.is_empty() && before > 0;
                if was_last {
                    let value = Value::Condition(Condition::Normal(None));
                    of_item.push(Observation {
                        value,
                        ..observation.clone()
                    });
                }
            }
            Value::Condition(Condition::Warning { code, .. } | Condition::Fault { code, .. }) => {
                // What says that there is none is over, and what it said before.
                of_item.retain(|known| known.value.code().is_some_and(|known| known != code));
                of_item.push(observation.clone());
            }
            Value::Unavailable | Value::Text(_) | Value::Set(_) | Value::Condition(Condition::Normal(None)) => {
                *of_item = vec![observation.clone()];
            }
        }
    }

    /// Of an item.
    pub(crate) fn of(&self, item: usize) -> &[Observation] {
        &self.0[item]
    }

    /// All of them, in the order of items.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Observation> {
        self.0.iter().flatten()
    }
}

impl Value {
    /// The code of an active condition.
    fn code(&self) -> Option<&String> {
        match self {
            Value::Condition(Condition::Warning { code, .. } | Condition::Fault { code, .. }) => Some(code),
            _ => None,
        }
    }
}

/// Observations.
#[derive(Debug)]
pub(crate) struct Ring {
    size: usize,
    kept: VecDeque<Observation>,
    next: u64,
    latest: Latest,
    /// How everything was before the first that is kept.
    before: Latest,
}

impl Ring {
    /// Room for so many, of these items, all of which are unavailable.
    pub(crate) fn new(size: usize, items: usize, time: Duration) -> Ring {
        let none = Latest(vec![Vec::new(); items]);
        let mut ring = Ring {
            size: size.max(1),
            kept: VecDeque::new(),
            next: 1,
            latest: none.clone(),
            before: none,
        };
        for item in 0..items {
            ring.put(item, Value::Unavailable, time);
        }
        ring
    }

    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Numbers of the first that is kept, and of the one that comes next.
    pub(crate) fn range(&self) -> (u64, u64) {
        (self.next - self.kept.len() as u64, self.next)
    }

    pub(crate) fn latest(&self) -> &Latest {
        &self.latest
    }

    /// Takes an observation whatever was before.
    pub(crate) fn put(&mut self, item: usize, value: Value, time: Duration) {
        let observation = Observation {
            sequence: self.next,
            time,
            item,
            value,
        };
        self.next += 1;
        self.latest.put(&observation);
        if self.kept.len() == self.size
            && let Some(first) = self.kept.pop_front()
        {
            self.before.put(&first);
        }
        self.kept.push_back(observation);
    }

    /// Takes it if it is another one than the last.
    pub(crate) fn see(&mut self, item: usize, value: Value, time: Duration) {
        let is_known = match (&value, self.latest.of(item)) {
            (Value::Condition(Condition::Normal(None)), [only]) => only.value == value,
            (Value::Condition(Condition::Normal(Some(code))), known) => {
                known.iter().all(|known| known.value.code() != Some(code))
            }
            (Value::Condition(_), known) => known.iter().any(|known| known.value == value),
            (_, known) => known.last().is_some_and(|known| known.value == value),
        };
        if !is_known {
            self.put(item, value, time);
        }
    }

    /// From this number on, in their order.
    pub(crate) fn from(&self, sequence: u64) -> impl Iterator<Item = &Observation> {
        let (first, _) = self.range();
        let skipped = sequence.saturating_sub(first);
        self.kept
            .range(usize::try_from(skipped).map_or(self.kept.len(), |at| at.min(self.kept.len()))..)
    }

    /// How everything was at this number, which is kept.
    pub(crate) fn at(&self, sequence: u64) -> Latest {
        let mut latest = self.before.clone();
        for observation in self.kept.iter().take_while(|known| known.sequence <= sequence) {
            latest.put(observation);
        }
        latest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NOW: Duration = Duration::ZERO;

    fn text(text: &str) -> Value {
        Value::Text(text.to_owned())
    }

    fn fault(code: &str) -> Value {
        Value::Condition(Condition::Fault {
            code: code.into(),
            text: String::new(),
        })
    }

    fn normal(code: Option<&str>) -> Value {
        Value::Condition(Condition::Normal(code.map(str::to_owned)))
    }

    #[test]
    fn numbers_go_on_and_what_is_the_same_is_no_observation() {
        let mut ring = Ring::new(4, 2, NOW);
        assert_eq!(ring.range(), (1, 3));
        ring.see(0, text("a"), NOW);
        ring.see(0, text("a"), NOW);
        assert_eq!(ring.range(), (1, 4));
        for value in ["b", "c", "d"] {
            ring.see(0, text(value), NOW);
        }
        assert_eq!(ring.range(), (3, 7));
        let from: Vec<u64> = ring.from(5).map(|known| known.sequence).collect();
        assert_eq!(from, [5, 6]);
        assert_eq!(ring.from(7).count(), 0);
        assert_eq!(ring.at(4).of(0)[0].value, text("b"));
        assert_eq!(
            ring.at(4).of(1)[0].value,
            Value::Unavailable,
            "of before the first that is kept"
        );
    }

    #[test]
    fn conditions_are_active_together_and_cleared_one_by_one() {
        let mut ring = Ring::new(100, 1, NOW);
        let codes = |ring: &Ring| -> Vec<String> {
            let of_item = ring.latest().of(0).iter();
            of_item
                .map(|known| known.value.code().cloned().unwrap_or_else(|| "normal".into()))
                .collect()
        };
        ring.see(0, normal(None), NOW);
        ring.see(0, fault("A"), NOW);
        ring.see(0, fault("B"), NOW);
        ring.see(0, fault("A"), NOW);
        assert_eq!(codes(&ring), ["A", "B"]);
        ring.see(0, normal(Some("A")), NOW);
        assert_eq!(codes(&ring), ["B"]);
        ring.see(0, normal(Some("B")), NOW);
        assert_eq!(codes(&ring), ["normal"]);
        ring.see(0, fault("A"), NOW);
        ring.see(0, fault("B"), NOW);
        ring.see(0, normal(None), NOW);
        assert_eq!(codes(&ring), ["normal"]);
    }

    proptest! {
        /// Whoever has followed all observations knows what `current` tells, at any number that is kept.
        #[test]
        fn how_it_was_is_what_a_follower_knows(
            seen in prop::collection::vec((0..4_usize, 0..6_u8), 0..120),
            size in 1..40_usize,
        ) {
            let mut ring = Ring::new(size, 4, NOW);
            let mut follower = Latest(vec![Vec::new(); 4]);
            let mut known: Vec<Latest> = Vec::new();
            let mut told = 1;
            let mut follow = |ring: &Ring, known: &mut Vec<Latest>| {
                for observation in ring.from(told) {
                    assert_eq!(observation.sequence, told);
                    follower.put(observation);
                    known.push(follower.clone());
                    told += 1;
                }
            };
            if size >= 4 {
                follow(&ring, &mut known);
                for (item, what) in seen {
                    let value = match (item, what) {
                        (3, 0) => normal(None),
                        (3, 1) => normal(Some("A")),
                        (3, 2) => fault("A"),
                        (3, 3) => fault("B"),
                        (_, what) => text(&what.to_string()),
                    };
                    ring.see(item, value, NOW);
                    follow(&ring, &mut known);
                }
                let (first, next) = ring.range();
                prop_assert!(next - first <= size as u64);
                for sequence in first..next {
                    prop_assert_eq!(&ring.at(sequence), &known[sequence as usize - 1]);
                }
                prop_assert_eq!(&ring.at(next), ring.latest());
            }
        }
    }
}
