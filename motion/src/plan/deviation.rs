//! How far set-points lie from the programmed path, and whether they pass all of it.
//!
//! In:  set-points and the programmed pieces, both in order. Out: greatest distances.
//!
//! Both are walked in order, each step bounded, so that a neighbouring pass of the tool path is never taken for the one
//! that is due: of all places that are near enough the first one counts, so that no loop is passed over because it ends
//! where it began. Linear in time. Distances are over all nine axes; a degree counts as a millimetre.

use super::Programmed;
use super::smooth::round::{distance, nearest};
use crate::canon::Position;
use crate::path::{Piece, Shape};

/// What rounding takes of an exact path.
const ROUNDING_MM: f64 = 1e-9;
/// What the straight way between two set-points takes of a curve, in most cases.
const SAGITTA_MM: f64 = 1e-4;

/// Greatest distances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Of a set-point from the path, mm.
    pub off_mm: f64,
    /// Of a programmed point from the polygon of set-points, mm.
    pub missed_mm: f64,
    /// Path length at which the last set-point was found; close to the whole length.
    pub reached_mm: f64,
    /// Length of the whole path.
    pub length_mm: f64,
}

/// Compares `samples` with the programmed `path`; `tolerance_mm` says how far it may be off, which is how far the walk
/// looks around.
pub fn deviation(samples: &[Position], path: &[Programmed], tolerance_mm: f64) -> Deviation {
    let (off_mm, reached_mm) = off(samples.iter().copied(), path, tolerance_mm);
    let around = around_mm(tolerance_mm);
    let steps: Vec<Piece> = samples
        .windows(2)
        .filter_map(|pair| Piece::line(pair[0], pair[1]))
        .collect();
    let pieces = path.iter().map(|part| &part.piece);
    let points = pieces.clone().flat_map(|piece| {
        let count = match piece.shape() {
            Shape::Line(_) => 1,
            // It turns by half a radian or so.
            Shape::Blend(_) => 4,
            Shape::Arc(arc) => (arc.sweep_rad() * 2.0).ceil() as usize,
        };
        (0..=count).map(move |k| piece.position(piece.length() * k as f64 / count as f64))
    });
    let stride = steps.iter().map(Piece::length).fold(0.0, f64::max);
    let missed_mm = if steps.is_empty() {
        0.0
    } else {
        walk(
            points,
            &steps,
            |step| step,
            around + 2.0 * stride,
            tolerance_mm,
            SAGITTA_MM,
        )
        .0
    };
    Deviation {
        off_mm,
        missed_mm,
        reached_mm,
        length_mm: pieces.map(Piece::length).sum(),
    }
}

/// Greatest distance of a set-point from the programmed path, mm, as in [`Deviation::off_mm`], in memory that does not grow with
/// the number of set-points.
pub fn off_mm(samples: impl Iterator<Item = Position>, path: &[Programmed], tolerance_mm: f64) -> f64 {
    off(samples, path, tolerance_mm).0
}

/// Greatest distance of a set-point, and the length up to which the path was passed.
fn off(samples: impl Iterator<Item = Position>, path: &[Programmed], tolerance_mm: f64) -> (f64, f64) {
    walk(
        samples,
        path,
        |part| &part.piece,
        around_mm(tolerance_mm),
        tolerance_mm,
        ROUNDING_MM,
    )
}

/// How far ahead a point is looked for.
fn around_mm(tolerance_mm: f64) -> f64 {
    4.0 * tolerance_mm + 1e-3
}

/// Greatest distance of `points` from `path`, and the length up to which the path is near the last of them.
///
/// A point is looked for from where the one before was found up to `around` beyond the way since then. Pieces within the
/// tolerance and `slack` of it that follow each other are one place. One that is within the tolerance itself ends the search;
/// behind one that is not, a better one is looked for close by.
fn walk<P>(
    points: impl Iterator<Item = Position>,
    path: &[P],
    piece: impl Fn(&P) -> &Piece,
    around: f64,
    tolerance: f64,
    slack: f64,
) -> (f64, f64) {
    let near = tolerance + slack;
    let mut starts = vec![0.0];
    starts.extend(path.iter().scan(0.0, |sum, part| {
        *sum += piece(part).length();
        Some(*sum)
    }));
    let (mut worst, mut reached, mut left, mut first) = (0.0f64, 0.0f64, 0.0f64, 0);
    let mut before: Option<Position> = None;
    for point in points {
        let step = before.map_or(0.0, |before| distance(&point.0, &before.0));
        before = Some(point);
        let (low, mut high) = (reached, reached + 2.0 * step + around);
        while first + 1 < path.len() && starts[first + 1] < low {
            first += 1;
        }
        // The best place, where the run of near pieces with it begins, and where the run under way does.
        let (mut best, mut entered, mut run) = ((f64::INFINITY, reached), None, None);
        for (i, piece) in path.iter().map(&piece).enumerate().skip(first) {
            if starts[i] > high {
                break;
            }
            let from = (low - starts[i]).clamp(0.0, piece.length());
            let to = (high - starts[i]).clamp(from, piece.length());
            let mut of_piece = (f64::INFINITY, from);
            for guess in [from, 0.5 * (from + to), to] {
                let (off, s) = nearest(piece, &point.0, from, to, guess);
                if off < of_piece.0 {
                    of_piece = (off, s);
                }
                if matches!(piece.shape(), Shape::Line(_)) || of_piece.0 <= near {
                    break;
                }
            }
            let place = (of_piece.0, starts[i] + of_piece.1);
            if place.0 <= near {
                run = run.or(Some(place.1));
                left = left.max(place.1);
            } else if best.0 <= tolerance {
                break;
            } else if run.take().is_some() {
                high = high.min(starts[i] + 4.0 * tolerance);
            }
            if place.0 < best.0 {
                (best, entered) = (place, run);
            }
        }
        if best.0.is_finite() {
            worst = worst.max(best.0);
            reached = reached.max(entered.unwrap_or(best.1));
        }
    }
    (worst, reached.max(left))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(points: &[[f64; 2]]) -> Vec<Programmed> {
        let at = |p: &[f64; 2]| Position::xyz(p[0], p[1], 0.0);
        points
            .windows(2)
            .map(|pair| Programmed {
                piece: Piece::line(at(&pair[0]), at(&pair[1])).unwrap(),
                feed: 1.0,
                line: 1,
                rapid: false,
            })
            .collect()
    }

    #[test]
    fn a_cut_corner_is_off_and_missed() {
        let path = path(&[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]);
        let trace: Vec<_> = (0..=100)
            .map(|k| f64::from(k) * 0.1)
            .map(|t| if t < 9.0 { (t, 0.0) } else { (9.0 + (t - 9.0), t - 9.0) })
            .chain((11..=100).map(|k| (10.0, f64::from(k) * 0.1)))
            .map(|(x, y)| Position::xyz(x, y, 0.0))
            .collect();
        let found = deviation(&trace, &path, 1.0);
        // The chord from (9, 0) to (10, 1) is sqrt(1/2) from the corner and 1/2 from the legs.
        assert!((found.off_mm - 0.5).abs() < 1e-9, "{found:?}");
        assert!((found.missed_mm - 0.5f64.sqrt()).abs() < 1e-9, "{found:?}");
        assert!((found.reached_mm - 20.0).abs() < 1e-9 && found.length_mm == 20.0);
    }

    #[test]
    fn the_neighbouring_pass_is_not_the_one_that_is_due() {
        let path = path(&[[0.0, 0.0], [30.0, 0.0], [30.0, 0.005], [0.0, 0.005]]);
        let trace: Vec<_> = (0..=300).map(|k| Position::xyz(f64::from(k) * 0.1, 0.0, 0.0)).collect();
        let found = deviation(&trace, &path, 0.001);
        assert!(found.length_mm - found.reached_mm > 29.9, "{found:?}");
    }

    #[test]
    fn a_place_that_is_hardly_near_enough_does_not_hide_the_right_one() {
        // The trace passes the corner of the path at a little more than the tolerance, turns away, and comes back to it.
        let path = path(&[[0.0, 0.0], [5.0, 0.0], [5.0, 5.0]]);
        let trace: Vec<_> = [
            [0.0, 0.0],
            [4.98995, 0.0],
            [4.98, -0.008],
            [4.98, 0.008],
            [5.0, 0.008],
            [5.0, 5.0],
        ]
        .iter()
        .map(|point| Position::xyz(point[0], point[1], 0.0))
        .collect();
        let found = deviation(&trace, &path, 0.01);
        assert!(found.missed_mm < 0.0099, "{found:?}");
    }

    #[test]
    fn a_loop_that_ends_where_it_began_is_not_passed_over() {
        // A square of 0.2 mm on a line; the trace goes around it in steps that are as long as its sides, and so far beyond.
        let around = [
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 0.2],
            [4.8, 0.2],
            [4.8, 0.01],
            [5.0, 0.01],
            [9.0, 0.01],
        ];
        let trace = |points: &[[f64; 2]]| -> Vec<Position> {
            points
                .iter()
                .map(|point| Position::xyz(point[0], point[1], 0.0))
                .collect()
        };
        let found = deviation(&trace(&around), &path(&around), 0.02);
        assert!(found.off_mm < 1e-12 && found.missed_mm < 1e-12, "{found:?}");
        assert!((found.length_mm - found.reached_mm).abs() < 1e-9, "{found:?}");
        let without = [around[0], around[1], around[6]];
        let found = deviation(&trace(&without), &path(&around), 0.02);
        assert!((found.missed_mm - 0.2 * 2.0f64.sqrt()).abs() < 0.02, "{found:?}");
    }
}
