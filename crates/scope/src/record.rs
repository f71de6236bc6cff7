//! Which cycles make a record: around a trigger, or all of them.
//!
//! In:  cycles of a capture in their order. Out: the steps of records, each cycle at most once, on the time of its record.
//!
//! Before a trigger, as many cycles are kept as a record shows of that time; nothing else is.

use super::trigger::{Trigger, Watch};
use std::collections::VecDeque;

/// What follows a record, and what is done without a trigger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A record at each trigger; without one for as long as a record lasts, a record all the same.
    Auto,
    /// A record at each trigger.
    Normal,
    /// One record.
    Single,
    /// One that has no end, from now on.
    Roll,
}

impl Mode {
    /// All of them, and their names.
    pub const ALL: [(Mode, &'static str); 4] = [
        (Mode::Auto, "auto"),
        (Mode::Normal, "normal"),
        (Mode::Single, "single"),
        (Mode::Roll, "roll"),
    ];

    /// The mode of this name.
    pub fn from_name(name: &str) -> Option<Mode> {
        let named = Mode::ALL.iter().find(|(_, known)| *known == name);
        named.map(|(mode, _)| *mode)
    }
}

/// What is to be recorded.
#[derive(Clone, Debug)]
pub struct Plan {
    /// [`Mode::Roll`] and records without a trigger begin at once.
    pub mode: Mode,
    /// The trigger and the number of its channel.
    pub trigger: Option<(usize, Trigger)>,
    /// Length of a record, ns; `None`: no end.
    pub length_ns: Option<u64>,
    /// How much of it lies before the trigger, ns.
    pub before_ns: u64,
    /// Time of a cycle, ns.
    pub period_ns: u64,
}

/// Part of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step<'a> {
    /// The next record, counted from 1; its time 0 is the trigger, or its first cycle. `time_ns`: that moment on the clock of the cycle.
    Begins { number: u64, time_ns: u64, is_forced: bool },
    /// A cycle of it.
    Sample { time_ns: i64, words: &'a [u64] },
    /// That was its last one.
    Ends { number: u64 },
}

/// Makes records.
#[derive(Debug)]
pub struct Recorder {
    plan: Plan,
    watch: Option<Watch>,
    state: State,
    number: u64,
    /// Cycles that may lie before the trigger.
    kept: VecDeque<(u64, Box<[u64]>)>,
    kept_max: usize,
    /// Fires without a trigger from this date on.
    forced_ns: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Waiting,
    Recording { zero_ns: u64 },
    Done,
}

impl Recorder {
    pub fn new(plan: Plan) -> Recorder {
        let watch = match plan.mode {
            Mode::Roll => None,
            Mode::Auto | Mode::Normal | Mode::Single => plan.trigger.as_ref(),
        };
        let kept_max = match watch {
            // Where dates make no sense, it is still bounded.
            Some(_) => usize::try_from(plan.before_ns / plan.period_ns.max(1))
                .unwrap_or(usize::MAX)
                .saturating_add(1),
            None => 0,
        };
        Recorder {
            watch: watch.map(|(_, trigger)| Watch::new(trigger.clone())),
            kept: VecDeque::new(),
            kept_max,
            state: State::Waiting,
            number: 0,
            forced_ns: None,
            plan,
        }
    }

    /// Whether a record is under way.
    pub fn is_recording(&self) -> bool {
        matches!(self.state, State::Recording { .. })
    }

    /// Whether there will be no more.
    pub fn is_done(&self) -> bool {
        self.state == State::Done
    }

    /// Records that have begun.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Takes the next cycle; `value`: of the trigger's channel. Its record gets it, and what was kept before it.
    pub fn take(&mut self, time_ns: u64, words: &[u64], value: f64, mut step: impl FnMut(Step<'_>)) {
        // Between records, too: what rises while one is under way is no edge behind it.
        let fires = self.watch.as_mut().is_none_or(|watch| watch.fires(value));
        if self.state == State::Waiting {
            let length_ns = self.plan.length_ns.unwrap_or(0);
            let forced_ns = *self.forced_ns.get_or_insert(time_ns.saturating_add(length_ns));
            let is_forced = !fires && self.plan.mode == Mode::Auto && time_ns >= forced_ns;
            if fires || is_forced {
                self.number += 1;
                self.state = State::Recording { zero_ns: time_ns };
                step(Step::Begins {
                    number: self.number,
                    time_ns,
                    is_forced,
                });
                for (at_ns, words) in self.kept.drain(..) {
                    let before_ns = time_ns.saturating_sub(at_ns);
                    if before_ns <= self.plan.before_ns {
                        step(Step::Sample {
                            time_ns: -i64::try_from(before_ns).unwrap_or(i64::MAX),
                            words: &words,
                        });
                    }
                }
            } else if self.kept_max > 1 {
                self.keep(time_ns, words);
            }
        }
        if let State::Recording { zero_ns } = self.state {
            let since_ns = time_ns.saturating_sub(zero_ns);
            step(Step::Sample {
                time_ns: i64::try_from(since_ns).unwrap_or(i64::MAX),
                words,
            });
            let behind_ns = |length_ns: u64| length_ns.saturating_sub(self.plan.before_ns);
            // The next cycle would lie behind its end.
            let is_over = |length_ns| since_ns.saturating_add(self.plan.period_ns) >= behind_ns(length_ns);
            if self.plan.length_ns.is_some_and(is_over) && self.plan.mode != Mode::Roll {
                step(Step::Ends { number: self.number });
                let goes_on = matches!(self.plan.mode, Mode::Auto | Mode::Normal) && self.watch.is_some();
                self.state = if goes_on { State::Waiting } else { State::Done };
                self.forced_ns = None;
            }
        }
    }

    fn keep(&mut self, time_ns: u64, words: &[u64]) {
        let mut place: Box<[u64]> = match self.kept.len() >= self.kept_max {
            true => self.kept.pop_front().map_or_else(Box::default, |(_, words)| words),
            false => Box::default(),
        };
        if place.len() == words.len() {
            place.copy_from_slice(words);
        } else {
            place = words.into();
        }
        self.kept.push_back((time_ns, place));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Records of a run: dates relative to the trigger with the values, and whether it came to its end.
    fn records(plan: Plan, values: &[f64]) -> Vec<(Vec<(i64, f64)>, bool)> {
        let mut recorder = Recorder::new(plan);
        let mut records: Vec<(Vec<(i64, f64)>, bool)> = Vec::new();
        for (cycle, value) in values.iter().enumerate() {
            recorder.take(1000 + cycle as u64, &[value.to_bits()], *value, |step| match step {
                Step::Begins { number, .. } => {
                    records.push((Vec::new(), false));
                    assert_eq!(number as usize, records.len());
                }
                Step::Sample { time_ns, words } => {
                    let record = records.last_mut().expect("it has begun");
                    record.0.push((time_ns, f64::from_bits(words[0])));
                }
                Step::Ends { number } => records[number as usize - 1].1 = true,
            });
            if recorder.is_done() {
                break;
            }
        }
        records
    }

    fn plan(mode: Mode, trigger: Option<&str>, length: Option<u64>, before: u64) -> Plan {
        Plan {
            mode,
            trigger: trigger.map(|text| (0, Trigger::parse(text).unwrap())),
            length_ns: length,
            before_ns: before,
            period_ns: 1,
        }
    }

    #[test]
    fn a_record_lies_around_its_trigger() {
        let values: Vec<f64> = (0..20).map(f64::from).collect();
        let one = records(plan(Mode::Single, Some("a>9.5"), Some(5), 2), &values);
        let expected = vec![(-2, 8.0), (-1, 9.0), (0, 10.0), (1, 11.0), (2, 12.0)];
        assert_eq!(one, [(expected, true)]);
        // Too early for all that could lie before it.
        let early = records(plan(Mode::Single, Some("a>0.5"), Some(8), 4), &values);
        assert_eq!(early[0].0.first(), Some(&(-1, 0.0)));
        assert_eq!(early[0].0.last(), Some(&(3, 4.0)));
        // All of it before.
        let all = records(plan(Mode::Single, Some("a>9.5"), Some(3), 3), &values);
        assert_eq!(all[0].0, [(-3, 7.0), (-2, 8.0), (-1, 9.0), (0, 10.0)]);
    }

    #[test]
    fn modes_go_on_or_do_not() {
        let square: Vec<f64> = (0..40).map(|cycle| f64::from(cycle / 5 % 2)).collect();
        let begun = |mode, trigger, length| records(plan(mode, trigger, length, 0), &square);
        assert_eq!(begun(Mode::Normal, Some("a"), Some(4)).len(), 4);
        assert_eq!(begun(Mode::Single, Some("a"), Some(4)).len(), 1);
        assert_eq!(begun(Mode::Normal, Some("a>5"), Some(4)).len(), 0);
        // Without a trigger, after as long as a record lasts.
        let auto = begun(Mode::Auto, Some("a>5"), Some(4));
        assert_eq!(auto.iter().filter(|(_, whole)| *whole).count(), 5, "{auto:?}");
        let roll = begun(Mode::Roll, Some("a>5"), Some(4));
        assert_eq!((roll.len(), roll[0].0.len(), roll[0].1), (1, 40, false));
        let now = begun(Mode::Single, None, Some(7));
        assert_eq!((now.len(), now[0].0.len(), now[0].1), (1, 7, true));
        assert_eq!(begun(Mode::Single, None, None)[0].0.len(), 40);
    }

    proptest! {
        /// A single record holds the cycles around the first trigger, each once, and no other.
        #[test]
        fn a_record_is_what_the_model_cuts_out(
            values in prop::collection::vec((-3i32..4).prop_map(f64::from), 1..120), length in 1u64..30, share in 0u64..101,
        ) {
            let before = length * share / 100;
            let found = records(plan(Mode::Single, Some("some.pin>1"), Some(length), before), &values);
            let trigger = (1..values.len()).find(|at| values[*at] > 1.0 && values[at - 1] <= 1.0);
            let expected: Vec<Vec<(i64, f64)>> = trigger.into_iter().map(|trigger| {
                let from = trigger.saturating_sub(before as usize);
                let to = (trigger + ((length - before) as usize).max(1)).min(values.len());
                (from..to).map(|at| (at as i64 - trigger as i64, values[at])).collect()
            }).collect();
            let found: Vec<Vec<(i64, f64)>> = found.into_iter().map(|(record, _)| record).collect();
            prop_assert_eq!(found, expected);
        }

        /// Whatever dates are claimed, no more is kept than was asked for.
        #[test]
        fn memory_is_bounded_by_the_plan(dates in prop::collection::vec(any::<u64>(), 0..300), before in 0u64..50) {
            let mut recorder = Recorder::new(plan(Mode::Normal, Some("a>5"), Some(60), before));
            for date in dates {
                recorder.take(date, &[0], 0.0, |_| ());
                prop_assert!(recorder.kept.len() as u64 <= before + 1);
            }
        }
    }
}
