//! Moves that are tiny against the tolerance: runs of them become straight moves.
//!
//! In:  moves.
//! Out: moves; where tiny lines turn sharply, as the stairs of numbers with few digits do, or are arcs, there are lines from the
//! beginning of one move to the end of another, from which nothing between is farther than a part of the tolerance. What they
//! take of it is left out of what may be rounded later.
//!
//! Lines that turn gently are the compressor's. At a sharp corner of a tiny move there is no room for any speed, nor is there
//! in an arc with a radius of micrometres.

use super::round::{distance, turning};
use crate::canon::{AXES, Position};
use crate::path::{Group, NO_MOVE, Piece, Shape};
use crate::plan::Settings;
use crate::plan::program::{Corner, Move};
use crate::plan::travel::inside;

/// Moves that become one, at most.
const JOINED_MOVES_MAX: usize = 64;
/// Part of the tolerance that a line may be off.
const SHARE: f64 = 0.4;
/// Turning from which on a corner is sharp, radians.
pub(super) const SHARP: f64 = 1.2;

/// Holds back moves as long as the next may belong to the same line, and what came before them.
#[derive(Debug, Default)]
pub(super) struct Steps {
    before: Option<Run>,
    run: Option<Run>,
}

/// Moves that are one line so far; or any one, as it is.
#[derive(Debug)]
struct Run {
    /// The line, once it is of more than one move.
    line: Option<Box<Piece>>,
    /// The last of them.
    last: Box<Move>,
    /// Places on the way: their ends, but for the last, and the middle of arcs.
    between: Vec<Position>,
    /// How far the line is off.
    off: f64,
}

impl Steps {
    pub(super) fn push(&mut self, mut part: Box<Move>, settings: &Settings, out: &mut Vec<Box<Move>>) {
        if let Some(run) = &mut self.run
            && let Some(corner) = run.takes(&part, settings)
        {
            part.corner = corner;
            run.last = part;
            return;
        }
        self.settle(out);
        self.run = Some(Run {
            line: None,
            last: part,
            between: Vec::new(),
            off: 0.0,
        });
    }

    pub(super) fn flush(&mut self, out: &mut Vec<Box<Move>>) {
        self.settle(out);
        self.settle(out);
    }

    /// The run under way is over, and the one before it is let go.
    fn settle(&mut self, out: &mut Vec<Box<Move>>) {
        let run = self.run.take();
        let off = run.as_ref().map_or(0.0, |run| run.off);
        out.extend(self.before.take().map(|before| before.let_go(off)));
        self.before = run;
    }
}

impl Run {
    /// What lines on either side of a corner are off is not left for rounding it; `off`: of the next one.
    fn let_go(self, off: f64) -> Box<Move> {
        let off = off.max(self.off);
        let mut part = self.last;
        part.corner = match part.corner {
            Corner::Round(tolerance) if tolerance > off => Corner::Round(tolerance - off),
            Corner::Round(_) => Corner::Exact,
            corner @ (Corner::Exact | Corner::Stop) => corner,
        };
        if let Some(line) = self.line {
            part.piece = *line;
        }
        part
    }

    /// Takes the next move if it is tiny and belongs to the same line, with this corner at its end; the caller makes it the last.
    fn takes(&mut self, part: &Move, settings: &Settings) -> Option<Corner> {
        let (last, next) = (&self.last.piece, &part.piece);
        let (Corner::Round(tolerance), Corner::Round(its)) = (self.last.corner, part.corner) else {
            return None;
        };
        let tolerance = tolerance.min(its);
        // Nearly all moves end here.
        if next.length() >= tolerance || part.rapid || self.last.rapid || self.between.len() + 2 > JOINED_MOVES_MAX {
            return None;
        }
        let group = last.group();
        let alike =
            self.last.feed == part.feed && self.last.enables == part.enables && self.last.auxiliary == part.auxiliary;
        if !alike || group != next.group() || group == Group::Rotary {
            return None;
        }
        let [bent, next_bent] = [last, next].map(|piece| !matches!(piece.shape(), Shape::Line(_)));
        let tiny = |piece: &Piece| piece.length() < tolerance;
        if (bent && self.between.is_empty() && !tiny(last)) || is_blend(last) || is_blend(next) {
            return None;
        }
        let gentle = !bent && !next_bent && turning(group, &last.jet(0.0), &next.jet(0.0)) < SHARP;
        if self.between.is_empty() && gentle {
            return None;
        }
        let start = self.line.as_deref().unwrap_or(last).position(0.0);
        // There and back is two moves.
        let line = Piece::line(start, next.position(next.length())).filter(|line| line.length() >= NO_MOVE)?;
        let before = self.between.len();
        if bent && self.between.is_empty() {
            self.between.push(last.position(0.5 * last.length()));
        }
        self.between.push(last.position(last.length()));
        if next_bent {
            self.between.push(next.position(0.5 * next.length()));
        }
        let line = line.in_frame(*next.frame());
        let off = off_line(&line, &self.between);
        if line.group() == group && off <= SHARE * tolerance && inside(&line, settings) {
            (self.line, self.off) = (Some(Box::new(line)), off);
            return Some(Corner::Round(tolerance));
        }
        self.between.truncate(before);
        None
    }
}

fn is_blend(piece: &Piece) -> bool {
    matches!(piece.shape(), Shape::Blend(_))
}

/// How far places that follow each other are off a line: away from it, or back along it.
fn off_line(line: &Piece, places: &[Position]) -> f64 {
    let (start, end) = (line.position(0.0).0, line.position(line.length()).0);
    let direction: [f64; AXES] = core::array::from_fn(|axis| end[axis] - start[axis]);
    let square: f64 = direction.iter().map(|x| x * x).sum();
    let (mut off, mut furthest) = (0.0f64, 0.0f64);
    for place in places {
        let along: f64 = (0..AXES)
            .map(|axis| (place.0[axis] - start[axis]) * direction[axis])
            .sum();
        let part = along / square;
        furthest = furthest.max(part);
        let foot: [f64; AXES] = core::array::from_fn(|axis| start[axis] + part.clamp(0.0, 1.0) * direction[axis]);
        off = off
            .max(distance(&place.0, &foot))
            .max((furthest - part) * square.sqrt());
    }
    off
}
