//! The cycles of one joint, cut into moves.
//!
//! In:  samples of the recorder. Out: a [`Record`] without gaps.

use anyhow::ensure;
use operator::recorder::JointSample;
use rt::shared::JointTrace;
use std::ops::Range;

/// A command that has rested so long has come to its end, s.
const REST_S: f64 = 0.03;
/// A command moves where it changes by more than this in a cycle, mm.
const MOVES_MM: f64 = 1e-9;

/// Cycles of one joint, one after the other.
#[derive(Clone, Debug)]
pub struct Record {
    pub cycle_s: f64,
    lines: Vec<u32>,
    pub cycles: Vec<JointTrace>,
}

/// A motion of the command from rest to rest, and the rest behind it.
#[derive(Clone, Debug, PartialEq)]
pub struct Move {
    /// Line of the program.
    pub line: u32,
    /// Cycles in which the command moves; the one before the first has the place from which it sets out.
    pub motion: Range<usize>,
    /// First cycle of the next move, or the end.
    pub end: usize,
}

impl Record {
    /// # Errors
    /// Nothing was recorded, or some cycles are missing.
    pub fn new(samples: &[JointSample], cycle_s: f64) -> anyhow::Result<Record> {
        let missing: u64 = samples.windows(2).map(|pair| pair[1].cycle - pair[0].cycle - 1).sum();
        ensure!(!samples.is_empty(), "the program has moved nothing");
        ensure!(
            missing == 0,
            "{missing} cycles were not recorded, as this PC had no time for them: try again"
        );
        Ok(Record {
            cycle_s,
            lines: samples.iter().map(|sample| sample.line).collect(),
            cycles: samples.iter().map(|sample| sample.joint).collect(),
        })
    }

    /// All moves, in their order.
    pub fn moves(&self) -> Vec<Move> {
        let rest = (REST_S / self.cycle_s).ceil() as usize;
        let mut moves: Vec<Move> = Vec::new();
        for at in 1..self.cycles.len() {
            let changes = self.cycles[at].command_mm - self.cycles[at - 1].command_mm;
            if changes.abs() <= MOVES_MM {
                continue;
            }
            match moves.last_mut() {
                Some(last) if at - last.motion.end < rest => last.motion.end = at + 1,
                _ => {
                    if let Some(last) = moves.last_mut() {
                        last.end = at;
                    }
                    moves.push(Move {
                        line: self.lines[at],
                        motion: at..at + 1,
                        end: self.cycles.len(),
                    });
                }
            }
        }
        moves
    }

    /// Place from which a move sets out, mm.
    pub fn from_mm(&self, of: &Move) -> f64 {
        self.cycles[of.motion.start - 1].command_mm
    }

    /// Place to which a move goes, mm.
    pub fn to_mm(&self, of: &Move) -> f64 {
        self.cycles[of.motion.end - 1].command_mm
    }

    /// Velocity of the command in a cycle, mm/s.
    pub fn velocity_mm_s(&self, at: usize) -> f64 {
        match at {
            0 => 0.0,
            _ => (self.cycles[at].command_mm - self.cycles[at - 1].command_mm) / self.cycle_s,
        }
    }

    /// Acceleration of the command in a cycle, mm/s².
    pub fn acceleration_mm_s2(&self, at: usize) -> f64 {
        match at {
            0 => 0.0,
            _ => (self.velocity_mm_s(at) - self.velocity_mm_s(at - 1)) / self.cycle_s,
        }
    }

    /// Velocity that was measured around a cycle, mm/s.
    pub fn measured_mm_s(&self, at: usize) -> f64 {
        let before = at.saturating_sub(1);
        let behind = (at + 1).min(self.cycles.len() - 1);
        (self.cycles[behind].actual_mm - self.cycles[before].actual_mm)
            / ((behind - before).max(1) as f64 * self.cycle_s)
    }

    /// Whether the position loop is closed by the control.
    pub fn has_output(&self) -> bool {
        self.cycles.iter().all(|cycle| !cycle.output.is_nan())
    }

    /// Whether the drive tells of its torque.
    pub fn has_torque(&self) -> bool {
        self.cycles.iter().all(|cycle| !cycle.torque.is_nan())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A record of commands alone.
    pub(in crate::analysis) fn commanded(commands_mm: impl IntoIterator<Item = f64>) -> Record {
        let samples: Vec<JointSample> = (0..)
            .zip(commands_mm)
            .map(|(cycle, command_mm)| JointSample {
                cycle,
                line: 7,
                joint: JointTrace {
                    command_mm,
                    actual_mm: command_mm,
                    fresh: true,
                    ..JointTrace::NONE
                },
            })
            .collect();
        Record::new(&samples, 0.001).unwrap()
    }

    #[test]
    fn moves_are_parted_by_rests() {
        let ramp = |from: f64, to: f64| (1..=100).map(move |step| from + (to - from) * f64::from(step) / 100.0);
        let rest = |at: f64| std::iter::repeat_n(at, 50);
        let there = rest(0.0).chain(ramp(0.0, 1.0)).chain(rest(1.0));
        let record = commanded(there.chain(ramp(1.0, -1.0)).chain(rest(-1.0)));
        let moves = record.moves();
        let ends: Vec<_> = moves.iter().map(|it| (it.motion.clone(), it.end)).collect();
        assert_eq!(ends, [(50..150, 200), (200..300, 350)]);
        assert_eq!((record.from_mm(&moves[1]), record.to_mm(&moves[1])), (1.0, -1.0));
        assert!((record.velocity_mm_s(210) + 20.0).abs() < 1e-9);
    }

    #[test]
    fn cycles_that_are_missing_are_told() {
        let sample = |cycle| JointSample {
            cycle,
            line: 1,
            joint: JointTrace::NONE,
        };
        let error = Record::new(&[sample(1), sample(2), sample(5)], 0.001).unwrap_err();
        assert!(error.to_string().starts_with("2 cycles were not recorded"), "{error}");
        assert!(Record::new(&[], 0.001).is_err());
    }
}
