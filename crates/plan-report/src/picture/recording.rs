//! What a picture needs of a program that is run down, in memory that does not grow with its length.
//!
//! In:  every cycle that is run, and what it asks of the joints.
//! Out: places of the path, thinned out where they are many; the least and the greatest value of each stretch of time; marks.

use crate::joints::{Joints, NAMES, ORDERS};
use crate::judge::Cycle;
use config::Config;
use motion::canon::Axis;
use motion::element::Action;
use motion::rt::{Sample, SampleState};
use serde::Serialize;
use serde_json::value::RawValue;

/// Places of the path that are kept at the most; an even number.
const PLACES_MAX: usize = 1 << 16;
/// Stretches of time that are kept at the most: some for each pixel; an even number.
const STRETCHES_MAX: usize = 1 << 12;
/// Marks that are kept at the most; the picture shows fewer.
const MARKS_MAX: usize = 1 << 12;

/// Something that happens at rest.
#[derive(Clone, Debug)]
pub(crate) struct Mark {
    pub(super) cycle: u64,
    pub(super) what: Event,
}

/// What happens there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Event {
    Dwell,
    /// To this tool.
    ToolChange(u32),
    /// M0, M1.
    Stop,
}

/// The least and the greatest value of a stretch of time, and the cycles in which they were.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extremes {
    pub(super) least: (u64, f64),
    pub(super) greatest: (u64, f64),
}

impl Extremes {
    pub(super) fn with(self, other: Extremes) -> Extremes {
        Extremes {
            least: if other.least.1 < self.least.1 {
                other.least
            } else {
                self.least
            },
            greatest: if other.greatest.1 > self.greatest.1 {
                other.greatest
            } else {
                self.greatest
            },
        }
    }
}

/// A value over time.
#[derive(Clone, Debug)]
pub(super) struct Stretches {
    /// Cycles of a stretch.
    cycles: u64,
    all: Vec<Option<Extremes>>,
}

impl Stretches {
    fn new() -> Stretches {
        Stretches {
            cycles: 1,
            all: Vec::new(),
        }
    }

    fn push(&mut self, cycle: u64, value: f64) {
        while cycle / self.cycles >= STRETCHES_MAX as u64 {
            self.cycles *= 2;
            let pairs = self.all.chunks(2).map(|pair| match *pair {
                [Some(first), Some(second)] => Some(first.with(second)),
                [first, second] => first.or(second),
                [last] => last,
                _ => None,
            });
            self.all = pairs.collect();
        }
        let place = (cycle / self.cycles) as usize;
        if place >= self.all.len() {
            self.all.resize(place + 1, None);
        }
        let own = Extremes {
            least: (cycle, value),
            greatest: (cycle, value),
        };
        let all = &mut self.all[place];
        *all = Some(all.map_or(own, |all| all.with(own)));
    }

    /// First cycle of each stretch in which there is something, and its extremes.
    pub(super) fn iter(&self) -> impl Iterator<Item = (u64, Extremes)> {
        let numbered = (0_u64..).zip(&self.all);
        numbered.filter_map(|(number, extremes)| Some((number * self.cycles, (*extremes)?)))
    }
}

/// What is kept.
pub(crate) struct Recording {
    /// Cycles in motion: all of them, or one of two, of four and so on.
    pub(super) moving: Vec<Cycle>,
    every: u64,
    moved: u64,
    pub(super) marks: Vec<Mark>,
    dwelling: bool,
    /// By joint and order.
    pub(super) values: Vec<[Stretches; ORDERS]>,
}

impl Recording {
    pub(crate) fn new(config: &Config) -> Recording {
        Recording {
            moving: Vec::new(),
            every: 1,
            moved: 0,
            marks: Vec::new(),
            dwelling: false,
            values: vec![std::array::from_fn(|_| Stretches::new()); config.joints.len()],
        }
    }

    pub(crate) fn push(&mut self, sample: &Sample, cycle: &Cycle, joints: &Joints) {
        let what = match (sample.state, sample.action) {
            (_, Some(Action::ChangeTool { tool })) => Some(Event::ToolChange(tool)),
            (_, Some(Action::ProgramStop | Action::OptionalStop)) => Some(Event::Stop),
            (SampleState::Dwelling, _) => Some(Event::Dwell),
            (_, _) => None,
        };
        // A wait is marked where it begins.
        let goes_on = what == Some(Event::Dwell) && self.dwelling;
        self.dwelling = what == Some(Event::Dwell);
        if let Some(what) = what.filter(|_| !goes_on && self.marks.len() < MARKS_MAX) {
            self.marks.push(Mark {
                cycle: cycle.number,
                what,
            });
        }
        if cycle.moving {
            if self.moving.len() == PLACES_MAX {
                let mut place = 0;
                self.moving.retain(|_| {
                    place += 1;
                    place % 2 == 1
                });
                self.every *= 2;
            }
            if self.moved.is_multiple_of(self.every) {
                self.moving.push(*cycle);
            }
            self.moved += 1;
        }
        self.rest(cycle.number, joints);
    }

    /// A cycle behind the end of the program.
    pub(crate) fn rest(&mut self, number: u64, joints: &Joints) {
        for (values, joint) in self.values.iter_mut().zip(&joints.all) {
            for (stretches, difference) in values.iter_mut().zip(joint.differences) {
                stretches.push(number, difference);
            }
        }
    }
}

/// Places and stretches that are handed on as numbers, at the most.
const NUMBERS_MAX: usize = 1000;

/// What a picture shows, as numbers.
#[derive(Debug, Serialize)]
pub(crate) struct Numbers {
    /// X, Y, Z of the machine, mm; speed, mm/s; line; 1 for a rapid move; s after the start.
    path: Vec<Box<RawValue>>,
    strips: Vec<Strip>,
}

/// A value of a joint over time.
#[derive(Debug, Serialize)]
struct Strip {
    joint: usize,
    what: &'static str,
    limit: f64,
    /// Beginning of a stretch of time, s; least and greatest value in it.
    rows: Vec<Box<RawValue>>,
}

/// Numbers in one line of the text, which would have one for each of them.
fn row(numbers: &[f64]) -> Option<Box<RawValue>> {
    let short: Vec<f64> = numbers.iter().map(|number| (number * 1e6).round() / 1e6).collect();
    serde_json::value::to_raw_value(&short).ok()
}

impl Recording {
    pub(crate) fn numbers(&self, joints: &Joints, cycle_s: f64) -> Numbers {
        let every = self.moving.len().div_ceil(NUMBERS_MAX).max(1);
        let ends = self.moving.last().into_iter();
        let path = self.moving.iter().step_by(every).chain(ends).filter_map(|cycle| {
            let [x, y, z] = [Axis::X, Axis::Y, Axis::Z].map(|axis| cycle.position[axis]);
            let time_s = cycle.number as f64 * cycle_s;
            row(&[
                x,
                y,
                z,
                cycle.speed_mm_s,
                f64::from(cycle.line),
                f64::from(u8::from(cycle.rapid)),
                time_s,
            ])
        });
        let strips = self
            .values
            .iter()
            .zip(&joints.all)
            .enumerate()
            .flat_map(|(index, (orders, joint))| {
                (0..ORDERS).map(move |order| {
                    let all: Vec<(u64, Extremes)> = orders[order].iter().collect();
                    let together = all.chunks(all.len().div_ceil(NUMBERS_MAX).max(1));
                    let rows = together.filter_map(|some| {
                        let extremes = some.iter().map(|(_, extremes)| *extremes).reduce(Extremes::with)?;
                        row(&[some[0].0 as f64 * cycle_s, extremes.least.1, extremes.greatest.1])
                    });
                    Strip {
                        joint: index,
                        what: NAMES[order],
                        limit: joint.limits[order],
                        rows: rows.collect(),
                    }
                })
            });
        Numbers {
            path: path.collect(),
            strips: strips.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_peak_is_lost_however_long_it_takes() {
        let mut stretches = Stretches::new();
        let cycles = 10 * STRETCHES_MAX as u64;
        for cycle in 0..cycles {
            let value = match cycle {
                777 => 5.0,
                30_000 => -6.0,
                _ => 0.0,
            };
            stretches.push(cycle, value);
        }
        assert!(stretches.all.len() <= STRETCHES_MAX);
        let all = stretches
            .iter()
            .map(|(_, extremes)| extremes)
            .reduce(Extremes::with)
            .unwrap();
        assert_eq!((all.greatest, all.least), ((777, 5.0), (30_000, -6.0)));
        let begins: Vec<u64> = stretches.iter().map(|(cycle, _)| cycle).collect();
        assert!(begins.windows(2).all(|pair| pair[1] - pair[0] == stretches.cycles));
    }
}
