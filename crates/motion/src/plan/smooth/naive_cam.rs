//! The naive-CAM detector: straight moves in line become one.
//!
//! In:  moves. Out: moves; several straight ones at the same feed, none of whose ends is farther from the line between
//! the first and the last point than allowed, are one.
//!
//! It is asked for by Q of G64, and Q0 switches it off. What is spent here is left out of what may be rounded later, so that
//! both together stay within P. Where the program does not name Q, it is P; but smooth curves need many exact points, so that
//! no more than a hundredth of P is spent then: on moves that are in line up to the rounding of their numbers. Shorter curves of
//! moves are the compressor's. A Q below P is taken at its word, but for the half of P that is left to corners; one above P is
//! as none, as nothing may be farther off than P.
//!
//! On an exact path, moves of which a cycle would pass many become one where they are exactly in line: the way to rest from
//! full speed would be more of them than fit into the ring.

use super::round::distance;
use crate::canon::{AXES, Position};
use crate::path::{Piece, Shape};
use crate::plan::Settings;
use crate::plan::program::{Corner, Move};
use crate::plan::travel::inside;

/// Moves that become one, at most.
const JOINED_MOVES_MAX: usize = 64;
/// Part of a cycle: moves that take less become one on an exact path, until it takes a cycle.
const SHORT_PART: f64 = 1.0 / 12.0;
/// What rounding takes of moves that are exactly in line, mm.
const ROUNDING_MM: f64 = 1e-10;
/// Parts of P that may be used: where Q is below it, and where it is not.
const SHARES: [f64; 2] = [0.5, 0.01];

/// Holds back straight moves as long as the next may be in line.
#[derive(Debug, Default)]
pub(super) struct NaiveCam {
    /// What the moves held back are so far.
    merged: Option<Box<Move>>,
    /// Their ends, but for the last.
    between: Vec<Position>,
}

impl NaiveCam {
    pub(super) fn push(&mut self, mut part: Box<Move>, settings: &Settings, out: &mut Vec<Box<Move>>) {
        let allowed = match part.corner {
            Corner::Round(tolerance) => {
                let share = SHARES[usize::from(part.naive_cam_mm >= tolerance)];
                part.naive_cam_mm.min(share * tolerance)
            }
            Corner::Exact if part.piece.length() < SHORT_PART * settings.cycle_s * part.feed => ROUNDING_MM,
            Corner::Exact | Corner::Stop => 0.0,
        };
        if allowed <= 0.0 || part.rapid || !matches!(part.piece.shape(), Shape::Line(_)) {
            self.flush(out);
            out.push(part);
            return;
        }
        if let Corner::Round(tolerance) = &mut part.corner {
            *tolerance -= allowed;
        }
        if let Some(before) = self.merged.take() {
            let middle = before.piece.position(before.piece.length());
            self.between.push(middle);
            let alike = before.feed == part.feed
                && before.corner == part.corner
                && before.enables == part.enables
                && before.auxiliary == part.auxiliary;
            let fits = before.corner != Corner::Exact || before.piece.length() < settings.cycle_s * part.feed;
            let same = alike && fits && self.between.len() < JOINED_MOVES_MAX;
            if same && let Some(line) = self.joined(&before.piece, &part.piece, allowed, settings) {
                part.piece = line;
                self.merged = Some(part);
                return;
            }
            self.between.clear();
            out.push(before);
        }
        self.merged = Some(part);
    }

    pub(super) fn flush(&mut self, out: &mut Vec<Box<Move>>) {
        self.between.clear();
        out.extend(self.merged.take());
    }

    /// The line that takes the place of both, if all between is near it.
    fn joined(&self, first: &Piece, second: &Piece, allowed: f64, settings: &Settings) -> Option<Piece> {
        let (start, end) = (first.position(0.0), second.position(second.length()));
        // Nearly all moves end here.
        if first.group() != second.group() || !are_in_line(&self.between, [&start.0, &end.0], allowed) {
            return None;
        }
        let mut line = Piece::line(start, end)?;
        line.set_frame(*second.frame());
        (line.group() == first.group() && inside(&line, settings)).then_some(line)
    }
}

/// Whether `points` follow each other along the line between two places and are no farther from it than `allowed`.
fn are_in_line(points: &[Position], [start, end]: [&[f64; AXES]; 2], allowed: f64) -> bool {
    let along: [f64; AXES] = core::array::from_fn(|axis| end[axis] - start[axis]);
    let square: f64 = along.iter().map(|x| x * x).sum();
    let mut last = 0.0;
    points.iter().all(|point| {
        let part = (0..AXES)
            .map(|axis| (point.0[axis] - start[axis]) * along[axis])
            .sum::<f64>()
            / square;
        let foot: [f64; AXES] = core::array::from_fn(|axis| start[axis] + part * along[axis]);
        let forward = part > last && part < 1.0;
        last = part;
        forward && distance(&point.0, &foot) <= allowed
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn merged(points: &[[f64; 2]], q: f64) -> Vec<(u32, f64)> {
        let at = |p: &[f64; 2]| Position::xyz(p[0], p[1], 0.0);
        let (mut stage, mut out) = (NaiveCam::default(), Vec::new());
        let settings = Settings::new([None; AXES], 1e-3);
        for (k, pair) in points.windows(2).enumerate() {
            let part = Move {
                piece: Piece::line(at(&pair[0]), at(&pair[1])).unwrap(),
                feed: if pair[1][0] > 100.0 { 5.0 } else { 10.0 },
                line: k as u32 + 1,
                rapid: false,
                enables: crate::element::Enables::default(),
                auxiliary: crate::element::Auxiliary::INITIAL,
                modes: 0,
                corner: Corner::Round(0.1),
                naive_cam_mm: q,
            };
            stage.push(Box::new(part), &settings, &mut out);
        }
        stage.flush(&mut out);
        out.iter().map(|part| (part.line, part.piece.length())).collect()
    }

    #[test]
    fn moves_in_line_become_one_and_q0_leaves_them() {
        let points = [
            [0.0, 0.0],
            [1.0, 0.0005],
            [2.0, 0.0],
            [4.0, 0.0],
            [4.0, 3.0],
            [4.0, 5.0],
        ];
        assert_eq!(merged(&points, 0.1), [(3, 4.0), (5, 5.0)]);
        assert_eq!(merged(&points, 0.0).len(), 5);
        // Farther off than Q, though not than the share of P.
        assert_eq!(
            merged(&points, 0.0001).iter().map(|part| part.0).collect::<Vec<_>>(),
            [1, 2, 3, 5]
        );
        // The share of P bounds Q where Q is P, and so was not named.
        let bent = [[0.0, 0.0], [1.0, 0.003], [2.0, 0.0]];
        assert_eq!(merged(&bent, 0.1).len(), 2);
        assert_eq!(merged(&bent, 3.0).len(), 2);
        assert_eq!(merged(&bent, 0.004), [(2, 2.0)]);
        assert_eq!(merged(&bent, 0.002).len(), 2);
        // Half of P is left to corners.
        assert_eq!(merged(&[[0.0, 0.0], [1.0, 0.06], [2.0, 0.0]], 0.09).len(), 2);
    }

    #[test]
    fn another_feed_or_a_way_back_is_another_move() {
        assert_eq!(
            merged(&[[98.0, 0.0], [100.0, 0.0], [102.0, 0.0], [104.0, 0.0]], 0.1).len(),
            2
        );
        assert_eq!(merged(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]], 0.1).len(), 2);
    }
}
