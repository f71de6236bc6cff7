//! Arcs that follow a curve.
//!
//! In:  a curve and how far arcs may leave it.
//! Out: arcs and lines, each of which goes on in the direction in which the one before ended, where the curve does.
//!
//! A piece of the curve is replaced by two arcs that have its ends and its directions there; where they leave it too
//! far, it is halved. The kind of biarc is the usual one: with `t0`, `t1` unit tangents, `v` the way from start to end,
//! both arms `d` long, the joint lies halfway between `start + d t0` and `end - d t1`, and `d` solves
//! `v·v - 2 d v·(t0 + t1) + 2 d² (t0·t1 - 1) = 0`.

use super::super::circle::{self, Arc};
use super::curve::Curve;

/// An arc, or a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) start: [f64; 2],
    pub(super) end: [f64; 2],
    /// `None`: a line.
    pub(super) arc: Option<Arc>,
}

impl Piece {
    pub(super) fn length_mm(&self) -> f64 {
        self.arc.map_or_else(
            || length(minus(self.end, self.start)),
            |arc| circle::length_mm(arc, self.start, self.end),
        )
    }
}

/// A span is halved so often at most: a cusp has no arcs that follow it, and is reached as near as makes no difference.
const HALVINGS_MAX: u32 = 14;
/// Places of a piece at which its distance from the curve is looked at.
const SAMPLES_PER_PIECE: u32 = 9;
/// An arc that leaves its chord by less than this is a line, mm.
const FLAT_MM: f64 = 1e-7;
/// A curve shorter than this is a line, mm.
const SHORT_MM: f64 = 1e-6;

/// Most pieces of a curve: a hundred for each of the most control points.
pub(super) const PIECES_MAX: usize = 1_000_000;

/// The whole curve in pieces; more than [`PIECES_MAX`] if it cannot be followed.
pub(super) fn pieces(curve: &Curve, tolerance_mm: f64) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for span in 0..curve.spans() {
        let from = span as f64;
        // Two halves at least, so that a turn by half a circle or more is never one biarc.
        for (from, to) in [(from, from + 0.5), (from + 0.5, from + 1.0)] {
            follow(curve, from, to, tolerance_mm, HALVINGS_MAX, &mut pieces);
        }
    }
    pieces
}

/// Adds pieces that follow the curve between two parameters.
fn follow(curve: &Curve, from: f64, to: f64, tolerance_mm: f64, halvings: u32, pieces: &mut Vec<Piece>) {
    if pieces.len() > PIECES_MAX {
        return;
    }
    let (start, end) = (curve.point(from), curve.point(to));
    let middle = (from + to) / 2.0;
    let size = length(minus(end, start)).max(length(minus(curve.point(middle), start)));
    if size > SHORT_MM && halvings > 0 {
        let found = curve
            .direction(from)
            .zip(curve.direction(to))
            .and_then(|(leaves, arrives)| biarc(start, leaves, end, arrives));
        match found {
            Some(two) if deviation_mm(curve, from, to, &two) <= tolerance_mm => pieces.extend(two),
            Some(_) | None => {
                follow(curve, from, middle, tolerance_mm, halvings - 1, pieces);
                follow(curve, middle, to, tolerance_mm, halvings - 1, pieces);
            }
        }
    } else if start != end {
        pieces.push(Piece { start, end, arc: None });
    }
}

/// Two arcs from a point and direction to another; `None`: they would turn by half a circle or more.
fn biarc(start: [f64; 2], leaves: [f64; 2], end: [f64; 2], arrives: [f64; 2]) -> Option<[Piece; 2]> {
    let way = minus(end, start);
    let along = dot(way, [leaves[0] + arrives[0], leaves[1] + arrives[1]]);
    let quadratic = 2.0 * (1.0 - dot(leaves, arrives));
    let square = dot(way, way);
    // quadratic d² + 2 along d - square = 0, the root above 0, in the form that loses no digits.
    let root = (along * along + quadratic * square).sqrt();
    let arm = square / (along + root);
    if !(arm.is_finite() && arm > 0.0 && along > 0.0) {
        return None;
    }
    let middle = [0, 1].map(|axis| (start[axis] + end[axis] + arm * (leaves[axis] - arrives[axis])) / 2.0);
    let second = arc_from(end, arrives.map(|part| -part), middle)?;
    Some([
        Piece {
            start,
            end: middle,
            arc: arc_from(start, leaves, middle)?,
        },
        Piece {
            start: middle,
            end,
            arc: second.map(|arc| Arc {
                turns: -arc.turns,
                ..arc
            }),
        },
    ])
}

/// The arc from a point in a direction to another point: `Some(None)`: a line; `None`: half a circle or more.
fn arc_from(start: [f64; 2], leaves: [f64; 2], end: [f64; 2]) -> Option<Option<Arc>> {
    let chord = minus(end, start);
    if dot(chord, leaves) <= 0.0 {
        return None;
    }
    let normal = [-leaves[1], leaves[0]];
    let across = dot(chord, normal);
    if across.abs() < 4.0 * FLAT_MM {
        return Some(None);
    }
    // The centre lies on the normal at the start, as far from the end: r = chord² / (2 chord·normal).
    let radius = dot(chord, chord) / (2.0 * across);
    Some(Some(Arc {
        centre_mm: [start[0] + radius * normal[0], start[1] + radius * normal[1]],
        turns: if radius > 0.0 { 1 } else { -1 },
    }))
}

/// Greatest distance of the curve from two pieces, at [`SAMPLES_PER_PIECE`] places.
fn deviation_mm(curve: &Curve, from: f64, to: f64, two: &[Piece; 2]) -> f64 {
    (1..=SAMPLES_PER_PIECE)
        .map(|sample| {
            let share = f64::from(sample) / f64::from(SAMPLES_PER_PIECE + 1);
            let point = curve.point(from + share * (to - from));
            two.iter()
                .map(|piece| distance_mm(piece, point))
                .fold(f64::MAX, f64::min)
        })
        .fold(0.0, f64::max)
}

/// Distance of a point from a piece; from one of its ends where it lies beside all of it.
pub(super) fn distance_mm(piece: &Piece, point: [f64; 2]) -> f64 {
    let ends = length(minus(point, piece.start)).min(length(minus(point, piece.end)));
    let chord = minus(piece.end, piece.start);
    let from_start = minus(point, piece.start);
    match piece.arc {
        None => {
            let share = dot(from_start, chord) / dot(chord, chord);
            if (0.0..=1.0).contains(&share) {
                cross(chord, from_start).abs() / length(chord)
            } else {
                ends
            }
        }
        Some(arc) => {
            // Less than half a circle: within it lies what is between the two radii.
            let [start, end, point] = [piece.start, piece.end, point].map(|place| minus(place, arc.centre_mm));
            let side = f64::from(arc.turns);
            let within = side * cross(start, point) >= 0.0 && side * cross(point, end) >= 0.0;
            if within && dot(point, [start[0] + end[0], start[1] + end[1]]) >= 0.0 {
                (length(point) - length(start)).abs()
            } else {
                ends
            }
        }
    }
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn length(vector: [f64; 2]) -> f64 {
    libm::hypot(vector[0], vector[1])
}
