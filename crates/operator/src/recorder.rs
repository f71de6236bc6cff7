//! What a program really did, cycle by cycle.
//!
//! In:  trace records of the cycle thread.
//! Out: samples of commanded and actual positions for the report; greatest following error of the whole run, and greatest distance
//! from the programmed path.
//!
//! Memory is bounded, as it is locked: a longer run has a sample for two cycles, or four, and so on.

use super::path_judge::PathJudge;
use super::report::Deviation;
use motion::canon::Axis;
use plot::PathSample;
use rt::shared::{JointTrace, Trace};

/// Samples kept: 3.7 MB. An even number.
const SAMPLES_MAX: usize = 65_536;

/// Cycles of one joint that are kept: a quarter of an hour, 70 MB, only where somebody asks.
pub const JOINT_SAMPLES_MAX: usize = 1_000_000;

/// One cycle of one joint, and the line of the program that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSample {
    pub cycle: u64,
    pub line: u32,
    pub joint: JointTrace,
}

/// Records of one run.
#[derive(Debug, Default)]
pub struct Recorder {
    samples: Vec<PathSample>,
    /// A sample stands for two to this power of cycles.
    halvings: u32,
    /// Cycles that the last one stands for.
    cycles_of_last: u64,
    cycles: u64,
    starved_cycles: u64,
    following_error_max_mm: f64,
    following_error_line: u32,
    line: u32,
    last_line: u32,
    judge: Option<PathJudge>,
    /// Cycles of one joint; `None`: nobody asked for them.
    joint: Option<Vec<JointSample>>,
}

impl Recorder {
    /// Takes one cycle.
    pub fn add(&mut self, record: &Trace) {
        self.cycles += 1;
        self.starved_cycles += u64::from(record.starved);
        self.line = self.line.max(record.line);
        if record.line > 0 {
            self.last_line = record.line;
        }
        if record.following_error_mm > self.following_error_max_mm {
            self.following_error_max_mm = record.following_error_mm;
            self.following_error_line = record.line;
        }
        if let Some(joint) = self.joint.as_mut().filter(|joint| joint.len() < JOINT_SAMPLES_MAX) {
            joint.push(JointSample {
                cycle: record.cycle,
                line: record.line,
                joint: record.joint,
            });
        }
        let xyz = |position: &motion::canon::Position| [Axis::X, Axis::Y, Axis::Z].map(|axis| position[axis]);
        let sample = PathSample {
            command: xyz(&record.command),
            actual: xyz(&record.actual),
            rapid: record.rapid,
            line: record.line,
        };
        if let Some(judge) = &mut self.judge {
            judge.add(sample);
        }
        match self.samples.last_mut() {
            Some(last) if self.cycles_of_last < 1 << self.halvings => {
                *last = last.further_off(sample);
                self.cycles_of_last += 1;
            }
            _ => {
                if self.samples.len() == SAMPLES_MAX {
                    self.halve();
                }
                self.samples.push(sample);
                self.cycles_of_last = 1;
            }
        }
    }

    /// From now on each cycle of the traced joint is kept.
    pub fn keep_joint(&mut self) {
        self.joint.get_or_insert_default();
    }

    /// Cycles of the traced joint, since they are kept; a quarter of an hour at the most.
    pub fn joint_samples(&self) -> &[JointSample] {
        self.joint.as_deref().unwrap_or_default()
    }

    /// Makes one sample of two.
    fn halve(&mut self) {
        halve(&mut self.samples);
        self.samples.truncate(SAMPLES_MAX / 2);
        self.halvings += 1;
    }

    /// From now on samples are judged by the path that this one knows.
    pub(super) fn judge_with(&mut self, judge: PathJudge) {
        self.judge = Some(judge);
    }

    /// Judges samples that wait for it: a part of them, or all, where no more path comes.
    pub(super) fn judge(&mut self, all: bool) {
        match &mut self.judge {
            Some(judge) if all => judge.finish(),
            Some(judge) => judge.judge(),
            None => {}
        }
    }

    /// Greatest distances from the programmed path; `None` where no path was judged.
    pub fn deviation(&self) -> Option<Deviation> {
        self.judge.as_ref()?.deviation()
    }

    /// Kept samples, from the start of the program on: one a cycle, or of as many cycles as a sample stands for the one in
    /// which the actual position was furthest from the commanded one.
    pub fn samples(&self) -> &[PathSample] {
        &self.samples
    }

    /// Cycles in which the machine stood because its plan came late.
    pub fn starved_cycles(&self) -> u64 {
        self.starved_cycles
    }

    /// Cycles of the program, kept or not.
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// Last line that was run: the one furthest down.
    pub fn line(&self) -> u32 {
        self.line
    }

    /// Line that was run last, which may be one of a loop or a subroutine.
    pub fn last_line(&self) -> u32 {
        self.last_line
    }

    /// Greatest following error of any joint, mm, and the program line of that cycle.
    pub fn following_error_max(&self) -> (f64, u32) {
        (self.following_error_max_mm, self.following_error_line)
    }
}

/// Puts one sample for each pair into the first half: the further one off.
pub(super) fn halve(samples: &mut [PathSample]) {
    for pair in 0..samples.len() / 2 {
        samples[pair] = samples[2 * pair].further_off(samples[2 * pair + 1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::canon::Position;

    #[test]
    fn a_run_of_any_length_takes_the_same_memory_and_keeps_what_was_furthest_off() {
        let mut recorder = Recorder::default();
        let cycles = 5 * SAMPLES_MAX as u64 + 3;
        for cycle in 0..cycles {
            let off_mm = if cycle % 1001 == 1000 { 0.5 } else { 0.01 };
            recorder.add(&Trace {
                cycle,
                command: Position::xyz(cycle as f64, 0.0, 0.0),
                actual: Position::xyz(cycle as f64, off_mm, 0.0),
                line: 1,
                rapid: false,
                following_error_mm: off_mm,
                starved: false,
                joint: JointTrace::NONE,
            });
            if cycle + 1 == SAMPLES_MAX as u64 {
                let each = recorder.samples().iter().map(|sample| sample.command[0] as u64);
                assert!(each.eq(0..SAMPLES_MAX as u64), "one a cycle");
            }
        }
        // Eight cycles a sample, and three in the last one.
        assert_eq!(recorder.samples().len(), (cycles as usize).div_ceil(8));
        assert!(recorder.samples().len() <= SAMPLES_MAX && recorder.cycles() == cycles);
        assert!(recorder.samples().is_sorted_by(|a, b| a.command[0] < b.command[0]));
        let far = recorder.samples().iter().filter(|sample| sample.actual[1] == 0.5);
        assert!(
            far.map(|sample| sample.command[0] as u64)
                .eq((1000..cycles).step_by(1001))
        );
    }
}
