//! What is told of the programmed path while a program runs.
//!
//! In:  the program thread, as it reads the program.
//! Out: to whoever judges the machine by it.

use motion::path::PackedPiece;
use motion::plan::Programmed;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, mpsc};

/// Pieces of the programmed path that whoever judges set-points by it may have before them, and final motion ahead of the machine, s,
/// from which on no more is read than that: all of them lie in memory.
const PATH_AHEAD: u64 = 20_000;
const PATH_AHEAD_S: f64 = 0.5;

/// How the programmed path goes on.
#[derive(Clone, Debug)]
pub enum PathNews {
    /// Along this piece, machine coordinates, before corners are rounded.
    Way(PackedPiece),
    /// By a probing move: where it ends, and what comes behind it, is told once it is over.
    Probing,
    /// The probing move is over, and told as far as it went.
    Probed,
}

/// The programmed path on its way to whoever judges by it.
#[derive(Default)]
pub(super) struct ProgrammedPath {
    /// What nobody has been told yet.
    parts: Vec<Programmed>,
    /// Who is told; `None`: what is there is taken.
    told: Option<mpsc::Sender<PathNews>>,
    /// What is told behind the path of the next part.
    behind: Option<PathNews>,
    /// Pieces that have been told, and how many of them set-points have left behind.
    count: u64,
    passed: Option<Arc<AtomicU64>>,
}

impl ProgrammedPath {
    /// From now on this one is told of it.
    pub(super) fn tell(&mut self, to: mpsc::Sender<PathNews>) {
        self.told = Some(to);
    }

    /// `passed` counts the pieces that are behind set-points: no more than need be is to be before them.
    pub(super) fn keep_near(&mut self, passed: Arc<AtomicU64>) {
        self.passed = Some(passed);
    }

    /// Whether more is before the set-points than need be; `ahead_s`: final motion ahead of the machine, s.
    pub(super) fn is_far_ahead(&self, ahead_s: impl FnOnce() -> Option<f64>) -> bool {
        let Some(passed) = &self.passed else { return false };
        self.count - passed.load(Ordering::Relaxed) > PATH_AHEAD && ahead_s() > Some(PATH_AHEAD_S)
    }

    /// It goes on along this.
    pub(super) fn push(&mut self, part: Programmed) {
        self.parts.push(part);
    }

    /// This is told behind the path of the next part.
    pub(super) fn tell_behind(&mut self, news: PathNews) {
        self.behind = Some(news);
    }

    /// Tells how it goes on.
    pub(super) fn tell_part(&mut self) {
        let behind = self.behind.take();
        self.send(behind);
    }

    /// The same, and this behind it.
    pub(super) fn tell_news(&mut self, news: PathNews) {
        self.send(Some(news));
    }

    fn send(&mut self, news: Option<PathNews>) {
        let Some(told) = &self.told else { return };
        self.count += self.parts.len() as u64;
        let ways = self.parts.drain(..);
        let ways = ways.map(|part| PathNews::Way(PackedPiece::from(&part.piece)));
        // Who does not listen any more does not want to know.
        ways.chain(news).for_each(|news| drop(told.send(news)));
    }

    /// What nobody has been told.
    pub(super) fn take(&mut self) -> std::vec::Drain<'_, Programmed> {
        self.count += self.parts.len() as u64;
        self.parts.drain(..)
    }
}
