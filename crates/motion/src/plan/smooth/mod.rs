//! Smoothing: moves to a path on which speed can be carried.
//!
//! In:  moves, in program order.
//! Out: stretches that follow each other, most of them with continuous direction and curvature; halts where the machine
//! must come to rest.
//!
//! ```text
//! naive_cam  straight moves in line -> one                    (only with Q of G64)
//! steps      runs of tiny moves that turn sharply -> lines within the tolerance
//! compress   runs of short straight moves -> few quintics     (fit: least squares, bspline: basis and system)
//! min_jerk_blend  lines and arcs that meet tangentially or nearly so -> short curves    (only for the optimal planner)
//! corners    what is left of moves, and the blends between    (round: one corner; overlap: shapes to be passed slowly)
//! ```
//!
//! No stage makes a piece that leaves travel or reach ([`inside`](super::travel::inside)).

// Several arrays are walked at once, over the axes in use.
#[allow(clippy::needless_range_loop)]
mod bspline;
#[allow(clippy::needless_range_loop)]
mod compress;
mod corners;
#[allow(clippy::needless_range_loop)]
mod fit;
#[allow(clippy::needless_range_loop)]
mod min_jerk_blend;
mod naive_cam;
mod overlap;
pub(super) mod round;
mod steps;

use compress::Compressor;
use corners::Corners;
use min_jerk_blend::MinJerkBlend;
use naive_cam::NaiveCam;
use steps::Steps;

use crate::element::{Auxiliary, Enables, Span};
use crate::path::Piece;
use crate::plan::limits::Bounds;
use crate::plan::program::Move;
use crate::plan::{PlannerKind, Settings};

/// A piece of path with all that bounds its speed besides geometry.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    pub(super) piece: Piece,
    /// Of its geometry, where they were needed to make it.
    pub(super) bounds: Option<Box<Bounds>>,
    pub(super) feed: f64,
    pub(super) line: u32,
    pub(super) rapid: bool,
    /// Whether it is part of a rounded corner between a rapid move and one at feed: what limits either of them limits it.
    pub(super) seam: bool,
    pub(super) enables: Enables,
    pub(super) auxiliary: Auxiliary,
    pub(super) modes: u32,
}

impl Stretch {
    /// Motion along it, at rest at its beginning as long as nothing else is said.
    pub(super) fn span(&self) -> Span {
        Span {
            piece: self.piece,
            s0: 0.0,
            v0: 0.0,
            a0: 0.0,
            jerk: 0.0,
            gradient: 0.0,
            duration_s: 0.0,
            line: self.line,
            rapid: self.rapid,
            enables: self.enables,
            auxiliary: self.auxiliary,
            modes: self.modes,
        }
    }
}

/// A rounded corner between a rapid move and one at feed.
#[derive(Clone, Debug)]
pub(super) struct Seam {
    /// It changes from one move to the other in its middle.
    pub(super) rounded: [Box<Stretch>; 2],
    /// What it takes of the moves: the way over the corner itself, at which the machine comes to rest.
    pub(super) exact: [Box<Stretch>; 2],
}

/// What comes out.
#[derive(Clone, Debug)]
pub(super) enum Passed {
    Stretch(Box<Stretch>),
    /// Only for the optimal planner. Before a move that an override of 0 holds, the machine waits at the corner itself.
    Seam(Seam),
    /// Rest before what follows.
    Stop,
}

/// A move, and how much of its beginning and of its end a rounded corner may use.
#[derive(Clone, Debug)]
struct Leg {
    part: Box<Move>,
    room: [f64; 2],
    /// Length of the move of which this is a part: speed may change over it.
    whole: f64,
}

/// The whole stage.
#[derive(Debug, Default)]
pub(super) struct Smoother {
    naive_cam: NaiveCam,
    steps: Steps,
    compressor: Compressor,
    min_jerk_blend: MinJerkBlend,
    corners: Corners,
    moves: Vec<Box<Move>>,
    stepped: Vec<Box<Move>>,
    legs: Vec<Leg>,
    blended: Vec<Leg>,
}

impl Smoother {
    /// Takes the next move.
    pub(super) fn push(&mut self, part: Box<Move>, settings: &Settings, out: &mut Vec<Passed>) {
        self.naive_cam.push(part, settings, &mut self.moves);
        self.pass(settings, out);
    }

    /// Nothing follows: the last move ends where it is programmed to end.
    pub(super) fn flush(&mut self, settings: &Settings, out: &mut Vec<Passed>) {
        self.naive_cam.flush(&mut self.moves);
        self.pass(settings, out);
        self.steps.flush(&mut self.stepped);
        self.compress(settings, out);
        self.compressor.flush(settings, &mut self.legs);
        self.round(settings, out);
        self.min_jerk_blend.flush(settings, &mut self.blended);
        for leg in self.blended.drain(..) {
            self.corners.push(leg, settings, out);
        }
        self.corners.flush(out);
    }

    fn pass(&mut self, settings: &Settings, out: &mut Vec<Passed>) {
        for part in self.moves.drain(..) {
            self.steps.push(part, settings, &mut self.stepped);
        }
        self.compress(settings, out);
    }

    fn compress(&mut self, settings: &Settings, out: &mut Vec<Passed>) {
        for part in self.stepped.drain(..) {
            self.compressor.push(part, settings, &mut self.legs);
        }
        self.round(settings, out);
    }

    fn round(&mut self, settings: &Settings, out: &mut Vec<Passed>) {
        match settings.planner_kind {
            PlannerKind::Optimal => {
                for leg in self.legs.drain(..) {
                    self.min_jerk_blend.push(leg, settings, &mut self.blended);
                }
            }
            // One speed for every piece: many short ones are no gain.
            PlannerKind::Classic => self.blended.append(&mut self.legs),
        }
        for leg in self.blended.drain(..) {
            self.corners.push(leg, settings, out);
        }
    }
}

#[cfg(test)]
mod tests;
