//! How far a machine is from its programmed path, judged while it runs.
//!
//! In:  the programmed path, ahead of the machine; samples of the cycle thread.
//! Out: the greatest distances.
//!
//! Memory is bounded, as it is locked: of path and samples, what lies around the machine is kept. Samples wait as long as the path
//! is not known, which is while a probing move is under way, and where there are more of them than a turn of the operator's loop
//! has time for. Where too many wait, each is the further one off of two of them.

use super::recorder::halve;
use super::report::Deviation;
use motion::canon::Position;
use motion::plan::deviation::OffPath;
use plot::PathSample;
use program::path::PathNews;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Receiver;

/// How far the actual path may leave the programmed one and still be found on it, mm.
const AROUND_MM: f64 = 0.5;
/// Samples that wait at the most: 0.9 MB. An even number.
const WAITING_MAX: usize = 16_384;
/// Samples that are judged in a turn of the operator's loop.
const JUDGED_PER_TURN: usize = 64;

/// Follows a machine along its path.
#[derive(Debug)]
pub(super) struct PathJudge {
    news: Receiver<PathNews>,
    /// Pieces of the path that are needed no more.
    passed: Arc<AtomicU64>,
    command: OffPath,
    actual: OffPath,
    tolerance_mm: f64,
    waiting: VecDeque<PathSample>,
    probing: bool,
    /// Whether there was a path, and a sample that was judged.
    has_path: bool,
    has_judged: bool,
}

impl PathJudge {
    /// Of a program that allows its moves to be off by so much at the most.
    pub(super) fn new(news: Receiver<PathNews>, tolerance_mm: f64) -> PathJudge {
        PathJudge {
            news,
            passed: Arc::default(),
            command: OffPath::new(tolerance_mm),
            actual: OffPath::new(AROUND_MM),
            tolerance_mm,
            waiting: VecDeque::new(),
            probing: false,
            has_path: false,
            has_judged: false,
        }
    }

    /// Counts the pieces of the path that are needed no more.
    pub(super) fn passed(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.passed)
    }

    /// Takes a sample.
    pub(super) fn add(&mut self, sample: PathSample) {
        if self.waiting.len() == WAITING_MAX {
            halve(self.waiting.make_contiguous());
            self.waiting.truncate(WAITING_MAX / 2);
        }
        self.waiting.push_back(sample);
    }

    /// Judges a part of what waits. To be called behind the last [`PathJudge::add`]: the path of a sample is told before the sample.
    pub(super) fn judge(&mut self) {
        self.judge_at_most(JUDGED_PER_TURN);
    }

    /// Judges all that waits: no more path comes.
    pub(super) fn finish(&mut self) {
        self.judge_at_most(usize::MAX);
    }

    fn judge_at_most(&mut self, samples: usize) {
        for news in self.news.try_iter() {
            match news {
                PathNews::Way(piece) => {
                    self.has_path = true;
                    self.command.push_path(piece.clone());
                    self.actual.push_path(piece);
                }
                PathNews::Probing => self.probing = true,
                PathNews::Probed => self.probing = false,
            }
        }
        if self.probing {
            return;
        }
        let count = samples.min(self.waiting.len());
        for PathSample { command, actual, .. } in self.waiting.drain(..count) {
            let position = |[x, y, z]: [f64; 3]| Position::xyz(x, y, z);
            self.command.push_sample(&position(command));
            self.actual.push_sample(&position(actual));
            self.has_judged = true;
        }
        let passed = self.command.passed().min(self.actual.passed());
        self.passed.store(passed, Ordering::Relaxed);
    }

    /// Greatest distances so far; `None` without a path or samples.
    pub(super) fn deviation(&self) -> Option<Deviation> {
        (self.has_path && self.has_judged).then(|| Deviation {
            command_max_mm: self.command.off_mm(),
            actual_max_mm: self.actual.off_mm(),
            tolerance_mm: self.tolerance_mm,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::path::{PackedPiece, Piece};
    use std::sync::mpsc::{Sender, channel};

    fn judge() -> (Sender<PathNews>, PathJudge) {
        let (to, news) = channel();
        (to, PathJudge::new(news, 0.01))
    }

    fn tell_line(to: &Sender<PathNews>, from: f64, end: f64) {
        let at = |x: f64| Position::xyz(x, 0.0, 0.0);
        let line = Piece::line(at(from), at(end)).unwrap();
        to.send(PathNews::Way(PackedPiece::from(&line))).unwrap();
    }

    fn sample(x: f64, off_mm: f64) -> PathSample {
        PathSample {
            command: [x, 0.0, 0.0],
            actual: [x, off_mm, 0.0],
            rapid: false,
            line: 1,
        }
    }

    #[test]
    fn samples_of_a_probing_move_wait_until_its_end_is_known() {
        let (to, mut judge) = judge();
        assert!(judge.deviation().is_none());
        tell_line(&to, 0.0, 1.0);
        to.send(PathNews::Probing).unwrap();
        for k in 0..=100 {
            judge.add(sample(f64::from(k) * 0.05, 0.002));
            judge.judge();
        }
        assert!(judge.deviation().is_none());
        // It went 4 of 10 mm, and back from there.
        tell_line(&to, 1.0, 5.0);
        to.send(PathNews::Probed).unwrap();
        tell_line(&to, 5.0, 0.0);
        for k in 0..=100 {
            judge.add(sample(5.0 - f64::from(k) * 0.05, 0.004));
            judge.judge();
        }
        judge.finish();
        let found = judge.deviation().unwrap();
        assert!(found.command_max_mm < 1e-9, "{found:?}");
        assert!((found.actual_max_mm - 0.004).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn however_long_it_takes_memory_is_bounded_and_what_is_furthest_off_is_judged() {
        let (to, mut judge) = judge();
        to.send(PathNews::Probing).unwrap();
        let samples = 10 * WAITING_MAX;
        for k in 0..samples {
            judge.add(sample(k as f64 * 1e-4, if k == samples / 3 { 0.03 } else { 0.001 }));
            assert!(judge.waiting.len() <= WAITING_MAX);
        }
        tell_line(&to, 0.0, samples as f64 * 1e-4);
        to.send(PathNews::Probed).unwrap();
        judge.finish();
        let found = judge.deviation().unwrap();
        assert!((found.actual_max_mm - 0.03).abs() < 1e-9, "{found:?}");
        // What lies behind the samples is forgotten.
        let pieces = 10_000_u32;
        for k in 0..pieces {
            let from = samples as f64 * 1e-4 + f64::from(k) * 0.1;
            tell_line(&to, from, from + 0.1);
            judge.add(sample(from + 0.1, 0.0));
            judge.judge();
        }
        assert!(judge.passed().load(Ordering::Relaxed) > u64::from(pieces) - 100);
    }
}
