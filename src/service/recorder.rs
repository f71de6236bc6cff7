//! What a program really did, cycle by cycle.
//!
//! In:  trace records of the cycle thread.
//! Out: samples of commanded and actual positions for the report; greatest following error of the whole run.

use crate::rt::shared::Trace;
use motion::canon::Axis;

/// Samples kept: 10 minutes at 1 ms with three axes take 34 MB. Later ones still count for the greatest values.
const SAMPLES_MAX: usize = 600_000;

/// One cycle of a program; positions in the machine, mm or degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSample {
    /// Commanded X, Y, Z.
    pub command: [f64; 3],
    /// Actual X, Y, Z.
    pub actual: [f64; 3],
    /// Whether the move is a rapid one.
    pub rapid: bool,
    /// Line of the program.
    pub line: u32,
}

/// Records of one run.
#[derive(Debug, Default)]
pub struct Recorder {
    samples: Vec<PathSample>,
    cycles: u64,
    starved_cycles: u64,
    following_error_max_mm: f64,
    following_error_line: u32,
    line: u32,
}

impl Recorder {
    /// Takes one cycle.
    pub fn add(&mut self, record: &Trace) {
        self.cycles += 1;
        self.starved_cycles += u64::from(record.starved);
        self.line = self.line.max(record.line);
        if record.following_error_mm > self.following_error_max_mm {
            self.following_error_max_mm = record.following_error_mm;
            self.following_error_line = record.line;
        }
        if self.samples.len() < SAMPLES_MAX {
            let xyz = |position: &motion::canon::Position| [Axis::X, Axis::Y, Axis::Z].map(|axis| position[axis]);
            self.samples.push(PathSample {
                command: xyz(&record.command),
                actual: xyz(&record.actual),
                rapid: record.rapid,
                line: record.line,
            });
        }
    }

    /// Kept samples, one per cycle from the start of the program on.
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

    /// Last line that was run.
    pub fn line(&self) -> u32 {
        self.line
    }

    /// Greatest following error of any joint, mm, and the program line of that cycle.
    pub fn following_error_max(&self) -> (f64, u32) {
        (self.following_error_max_mm, self.following_error_line)
    }
}
