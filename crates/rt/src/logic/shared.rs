//! What crosses the border between the cycle thread, the thread of a program and ordinary threads: atomics only.
//!
//! Cells of inputs belong to the cycle thread while no scan is asked for, those of outputs to the program's while one is:
//! `requested` and `done` hand both over.

use logic::{Fault, Wrong};
use machine::faults::LogicError;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU32, AtomicU64, fence};

/// No text of a program.
pub(super) const NO_TEXT: u64 = u64::MAX;
/// A reader gives up after so many looks that a scan has spoiled.
const LOOKS_MAX: usize = 1000;

/// Between the cycle and a program.
pub(super) struct Exchange {
    /// Scans asked for, and done.
    pub(super) requested: AtomicU64,
    pub(super) done: AtomicU64,
    /// Of the scan that is asked for.
    pub(super) time_ns: AtomicI64,
    pub(super) may_replace: AtomicBool,
    pub(super) stands: AtomicBool,
    pub(super) begins_anew: AtomicBool,
    /// As pins have them, in the order of the interface.
    pub(super) inputs: Box<[AtomicU64]>,
    pub(super) outputs: Box<[AtomicU64]>,
    /// One more than the place of what went wrong in [`Wrong::ALL`]; 0: nothing did. Its line and column.
    wrong: AtomicU32,
    line: AtomicU32,
    column: AtomicU32,
    /// Scans so far; what the last one took, and the longest.
    pub(super) scans: AtomicU64,
    pub(super) scan_ns: AtomicI64,
    pub(super) scan_max_ns: AtomicI64,
    pub(super) overflows: AtomicU64,
    pub(super) overruns: AtomicU64,
}

impl Exchange {
    pub(super) fn new(inputs: usize, outputs: usize) -> Exchange {
        let cells = |count: usize| (0..count).map(|_| AtomicU64::new(0)).collect();
        Exchange {
            requested: AtomicU64::new(0),
            done: AtomicU64::new(0),
            time_ns: AtomicI64::new(0),
            may_replace: AtomicBool::new(false),
            stands: AtomicBool::new(false),
            begins_anew: AtomicBool::new(false),
            inputs: cells(inputs),
            outputs: cells(outputs),
            wrong: AtomicU32::new(0),
            line: AtomicU32::new(0),
            column: AtomicU32::new(0),
            scans: AtomicU64::new(0),
            scan_ns: AtomicI64::new(0),
            scan_max_ns: AtomicI64::new(0),
            overflows: AtomicU64::new(0),
            overruns: AtomicU64::new(0),
        }
    }

    /// What has gone wrong in the scan. RT.
    pub(super) fn set_error(&self, fault: Option<Fault>) {
        let number = fault.and_then(|fault| Wrong::ALL.iter().position(|wrong| *wrong == fault.wrong));
        self.wrong.store(number.map_or(0, |number| number as u32 + 1), Relaxed);
        if let Some(fault) = fault {
            self.line.store(fault.line, Relaxed);
            self.column.store(fault.column, Relaxed);
        }
    }

    /// The same from the other side. RT.
    pub(super) fn error(&self) -> Option<LogicError> {
        let number = self.wrong.load(Relaxed).checked_sub(1)?;
        Some(LogicError {
            wrong: *Wrong::ALL.get(number as usize)?,
            line: self.line.load(Relaxed),
            column: self.column.load(Relaxed),
            goes_on: false,
        })
    }
}

/// All values of a program as they were behind one scan. The program's thread writes and never waits; a reader looks again
/// where a scan came in between.
pub(super) struct Image {
    /// Odd while it is being written.
    version: AtomicU64,
    time_ns: AtomicI64,
    values: Box<[AtomicI64]>,
}

impl Image {
    pub(super) fn new(values: &[i64]) -> Image {
        Image {
            version: AtomicU64::new(0),
            time_ns: AtomicI64::new(0),
            values: values.iter().map(|value| AtomicI64::new(*value)).collect(),
        }
    }

    /// RT.
    pub(super) fn show(&self, time_ns: i64, values: &[i64]) {
        let version = self.version.load(Relaxed);
        self.version.store(version + 1, Relaxed);
        fence(Release);
        self.time_ns.store(time_ns, Relaxed);
        for (cell, value) in self.values.iter().zip(values) {
            cell.store(*value, Relaxed);
        }
        self.version.store(version + 2, Release);
    }

    /// Time of a scan and the values behind it; `None`: scans came too fast to be looked at.
    pub(super) fn look(&self) -> Option<(i64, Vec<i64>)> {
        for _ in 0..LOOKS_MAX {
            let before = self.version.load(Acquire);
            let time_ns = self.time_ns.load(Relaxed);
            let values = self.values.iter().map(|cell| cell.load(Relaxed)).collect();
            fence(Acquire);
            if before.is_multiple_of(2) && self.version.load(SeqCst) == before {
                return Some((time_ns, values));
            }
            std::thread::yield_now();
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn a_look_sees_the_values_of_one_scan() {
        let image = Arc::new(Image::new(&[0; 64]));
        let stop = Arc::new(AtomicBool::new(false));
        let writer = std::thread::spawn({
            let (image, stop) = (image.clone(), stop.clone());
            move || {
                let mut scan = 0;
                while !stop.load(Relaxed) {
                    scan += 1;
                    image.show(scan, &[scan; 64]);
                    if scan % 16 == 0 {
                        std::thread::yield_now();
                    }
                }
                scan
            }
        });
        let mut seen = 0;
        while seen < 2000 {
            if let Some((time_ns, values)) = image.look() {
                assert!(values.iter().all(|value| *value == time_ns), "{time_ns}: {values:?}");
                // Before the writer has begun there is nothing to be spoiled.
                seen += u32::from(time_ns > 0);
            }
        }
        stop.store(true, Relaxed);
        assert!(writer.join().unwrap() > 0);
    }
}
