//! How far set-points lie from the programmed path, and whether they pass all of it.
//!
//! In:  set-points and the programmed pieces, each in their order, as they come.
//! Out: greatest distances.
//!
//! Set-points and path are matched in their order, neither ever going back, so that the greatest distance of all is as small as it
//! can be: the Fréchet distance with one side in steps (Alt and Godau 1995, for polygons). So a way back over the same line, a loop
//! and a neighbouring pass are told apart by their order alone. Both directions are followed: each set-point along the path, each
//! programmed point along the polygon of set-points. Linear in time; memory for what lies around the last set-point. Distances are
//! over all nine axes; a degree counts as a millimetre.

use std::collections::VecDeque;

use super::Programmed;
use super::smooth::round::{distance, nearest};
use crate::canon::{AXES, Position};
use crate::path::{PackedPiece, Piece, Shape};

/// Longest part of a piece that is one place in the order, mm: inside, points may come in any order.
const CELL_MM: f64 = 0.25;
/// Programmed points are so far apart at the most, mm.
const POINTS_MM: f64 = 10.0;
/// Set-points nearer than this, mm, are one side of their polygon where they are in line, by this cosine.
const SIDE_MM: f64 = 0.005;
const IN_LINE: f64 = 0.9999;
/// What rounding takes of an exact path, mm.
const ROUNDING_MM: f64 = 1e-9;
/// Parts of the track that are kept at the most.
const CELLS_MAX: usize = 1 << 16;

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

/// Compares `samples` with the programmed `path`; `tolerance_mm` says how far they may be off, which is how far is looked around.
pub fn deviation(samples: &[Position], path: &[Programmed], tolerance_mm: f64) -> Deviation {
    let mut judge = DeviationJudge::default();
    judge.allow(tolerance_mm);
    path.iter().for_each(|part| judge.push_path(&part.piece));
    samples.iter().for_each(|sample| judge.push_sample(sample));
    judge.finish()
}

/// Greatest distance of a set-point from the programmed path, as in [`Deviation::off_mm`], as both come.
///
/// The path has to be ahead of the set-points by as much as these may be off.
#[derive(Debug)]
pub struct OffPath {
    path: Follower,
    around_mm: f64,
}

impl OffPath {
    /// `tolerance_mm`: how far set-points may be off, which is how far is looked around.
    pub fn new(tolerance_mm: f64) -> OffPath {
        OffPath {
            path: Follower::default(),
            around_mm: around_mm(tolerance_mm),
        }
    }

    /// The programmed path goes on.
    pub fn push_path(&mut self, piece: PackedPiece) {
        self.path.push(piece);
    }

    /// The next set-point.
    pub fn push_sample(&mut self, sample: &Position) {
        self.path.follow(sample, self.around_mm);
    }

    /// Pieces of the path that set-points have left behind.
    pub fn passed(&self) -> u64 {
        self.path.first
    }

    /// Greatest distance so far, mm.
    pub fn off_mm(&self) -> f64 {
        self.path.off_mm
    }
}

/// How far is looked beyond the way that a point has gone.
fn around_mm(tolerance_mm: f64) -> f64 {
    4.0 * tolerance_mm + 1e-3
}

/// Judges a plan while it is run: takes path and set-points as they come, and keeps what it needs of them.
///
/// The path has to be ahead of the set-points by as much as these may be off.
#[derive(Debug, Default)]
pub struct DeviationJudge {
    path: Follower,
    length_mm: f64,
    polygon: Follower,
    /// The side of the polygon under way: set-points, and how far along the path each was found.
    side: [Option<(Position, f64)>; 2],
    /// How far along the path the polygon has come without it.
    polygon_mm: f64,
    /// Programmed points that set-points have not come to, and how far along the path each is.
    points: VecDeque<(f64, Position)>,
    tolerance_mm: f64,
}

impl DeviationJudge {
    /// So far may set-points be off from here on, mm. It only grows.
    pub fn allow(&mut self, tolerance_mm: f64) {
        self.tolerance_mm = self.tolerance_mm.max(tolerance_mm);
    }

    /// The programmed path goes on.
    pub fn push_path(&mut self, piece: &Piece) {
        let count = match piece.shape() {
            Shape::Line(_) => 1,
            // It turns by half a radian or so.
            Shape::Blend(_) => 4,
            Shape::Arc(arc) => (arc.sweep_rad() * 2.0).ceil() as usize,
        };
        let count = count.max((piece.length() / POINTS_MM).ceil() as usize);
        for k in usize::from(self.length_mm > 0.0)..=count {
            let s = piece.length() * k as f64 / count as f64;
            self.points.push_back((self.length_mm + s, piece.position(s)));
        }
        self.length_mm += piece.length();
        self.path.push(PackedPiece::from(piece));
    }

    /// The next set-point.
    pub fn push_sample(&mut self, sample: &Position) {
        let around_mm = around_mm(self.tolerance_mm);
        self.path.follow(sample, around_mm);
        self.push_corner(sample);
        // Set-points are so far beyond it that they come no nearer.
        let behind_mm = 4.0 * around_mm + CELL_MM;
        while self
            .points
            .front()
            .is_some_and(|(at, _)| at + behind_mm < self.polygon_mm)
        {
            self.pass_point();
        }
    }

    /// Pieces of the path that set-points have left behind.
    pub fn passed(&self) -> u64 {
        self.path.first
    }

    /// What was found, once all has come.
    pub fn finish(mut self) -> Deviation {
        if let [Some((from, _)), Some((to, _))] = self.side {
            self.polygon.push_line(from, to);
        }
        while !self.points.is_empty() {
            self.pass_point();
        }
        Deviation {
            off_mm: self.path.off_mm,
            missed_mm: self.polygon.off_mm,
            reached_mm: self.path.reached_mm,
            length_mm: self.length_mm,
        }
    }

    /// The polygon goes on: set-points that follow closely and in line are one side of it.
    fn push_corner(&mut self, sample: &Position) {
        let next = Some((*sample, self.path.passed_mm));
        let [Some((from, _)), Some((to, reached_mm))] = self.side else {
            self.side = [self.side[0].or(next), self.side[0].and(next)];
            return;
        };
        let (length, step) = (distance(&to.0, &from.0), distance(&sample.0, &to.0));
        let along: f64 = (0..AXES).map(|i| (to.0[i] - from.0[i]) * (sample.0[i] - to.0[i])).sum();
        let in_line = along >= IN_LINE * length * step;
        if length + step > SIDE_MM || !in_line {
            self.polygon.push_line(from, to);
            self.polygon_mm = reached_mm;
            self.side[0] = Some((to, reached_mm));
        }
        self.side[1] = next;
    }

    fn pass_point(&mut self) {
        if let Some((_, point)) = self.points.pop_front() {
            self.polygon.follow(&point, around_mm(self.tolerance_mm));
        }
    }
}

/// A part of the track, and the least greatest distance of all points so far with the last of them here.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Number of its piece; stretch of it, mm.
    piece: u64,
    from: f64,
    to: f64,
    /// Of the track, at the beginning of the piece.
    begin_mm: f64,
    off_mm: f64,
}

/// Follows points along a track.
#[derive(Debug, Default)]
struct Follower {
    /// Of the cells; number of the first.
    pieces: VecDeque<Piece>,
    first: u64,
    /// Those that come behind them.
    ahead: VecDeque<PackedPiece>,
    cells: VecDeque<Cell>,
    /// Where the next cell begins: piece, place in it, and length of the track before the piece.
    next: (u64, f64, f64),
    last: Option<Position>,
    off_mm: f64,
    /// Where the last point may be at the nearest and at the farthest, along the track.
    passed_mm: f64,
    reached_mm: f64,
}

impl Follower {
    fn push(&mut self, piece: PackedPiece) {
        self.ahead.push_back(piece);
    }

    fn push_line(&mut self, from: Position, to: Position) {
        // Set-points of a machine that stands make none.
        self.ahead.extend(Piece::line(from, to).as_ref().map(PackedPiece::from));
    }

    fn follow(&mut self, point: &Position, around_mm: f64) {
        if self.pieces.is_empty() && self.ahead.is_empty() {
            return;
        }
        let step_mm = self.last.map_or(0.0, |last| distance(&point.0, &last.0));
        let begins = self.last.replace(*point).is_none();
        // The least of all cells up to here: from any of them the way leads on.
        let mut before = if begins { 0.0 } else { f64::INFINITY };
        let mut best = f64::INFINITY;
        let mut found_mm = self.reached_mm;
        let ahead_mm = 2.0 * step_mm + around_mm;
        let mut index = 0;
        loop {
            let is_new = index == self.cells.len();
            if is_new {
                // As long as cells are near, what follows them may be meant.
                let far = |next: (u64, f64, f64)| next.2 + next.1 > found_mm + ahead_mm;
                if far(self.next) || !self.add_cell() {
                    break;
                }
            }
            let Some(cell) = self.cells.get(index).copied() else {
                break;
            };
            let Some(piece) = self.pieces.get((cell.piece - self.first) as usize) else {
                break;
            };
            let (off, s) = nearest(piece, &point.0, cell.from, cell.to, 0.5 * (cell.from + cell.to));
            before = before.min(cell.off_mm);
            let off_mm = off.max(before);
            self.cells[index].off_mm = off_mm;
            // Never from farther back than where the last point was: near places behind it may be of another pass.
            if off_mm <= best || off <= around_mm {
                found_mm = found_mm.max(cell.begin_mm + s);
            }
            best = best.min(off_mm);
            index += 1;
        }
        self.off_mm = self.off_mm.max(best);
        // A way back over the same line is as near.
        let at_best = |cell: &&Cell| cell.off_mm <= best + ROUNDING_MM;
        let place = |cell: &Cell| {
            let piece = self.pieces.get((cell.piece - self.first) as usize)?;
            let (_, s) = nearest(piece, &point.0, cell.from, cell.to, 0.5 * (cell.from + cell.to));
            Some(cell.begin_mm + s)
        };
        let passed_mm = self.cells.iter().find(at_best).and_then(place);
        let reached_mm = self.cells.iter().rev().find(at_best).and_then(place);
        self.passed_mm = passed_mm.unwrap_or(self.passed_mm);
        self.reached_mm = reached_mm.unwrap_or(self.reached_mm);
        self.forget(2.0 * best + around_mm);
    }

    /// The next part of the track; false: there is none yet.
    fn add_cell(&mut self) -> bool {
        let (piece, from, begin_mm) = self.next;
        if piece == self.first + self.pieces.len() as u64 {
            self.pieces.extend(self.ahead.pop_front().map(Piece::from));
        }
        let Some(own) = self.pieces.get((piece - self.first) as usize) else {
            return false;
        };
        let length = own.length();
        // Where an arc comes around again, it is another place.
        let cell_mm = match own.shape() {
            Shape::Arc(arc) => CELL_MM.min(length / arc.sweep_rad().ceil()),
            Shape::Line(_) | Shape::Blend(_) => CELL_MM,
        };
        // No sliver is left behind it.
        let to = if length - from > 1.5 * cell_mm {
            from + cell_mm
        } else {
            length
        };
        self.cells.push_back(Cell {
            piece,
            from,
            to,
            begin_mm,
            off_mm: f64::INFINITY,
        });
        self.next = if to == length {
            (piece + 1, 0.0, begin_mm + length)
        } else {
            (piece, to, begin_mm)
        };
        true
    }

    /// Nothing leads on from the first cells that would not be worse than others, or they are too many.
    fn forget(&mut self, most_mm: f64) {
        while self.cells.len() > 1
            && self
                .cells
                .front()
                .is_some_and(|cell| cell.off_mm > most_mm || self.cells.len() > CELLS_MAX)
        {
            self.cells.pop_front();
        }
        let first = self.cells.front().map_or(self.first, |cell| cell.piece);
        while self.first < first {
            self.pieces.pop_front();
            self.first += 1;
        }
    }
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
        // In their order, its points are at the least so far from the line without it.
        assert!((0.2..0.23).contains(&found.missed_mm), "{found:?}");
    }

    fn programmed(piece: Piece) -> Programmed {
        Programmed {
            piece,
            feed: 1.0,
            line: 1,
            rapid: false,
        }
    }

    /// Set-points on the path itself, at most so far apart.
    fn along(path: &[Programmed], step: f64) -> Vec<Position> {
        let on = |piece: &Piece| {
            let count = (piece.length() / step).ceil();
            let place = piece.length() / count;
            let piece = *piece;
            (1..=count as u32).map(move |k| piece.position(f64::from(k) * place))
        };
        let first = path[0].piece.position(0.0);
        std::iter::once(first)
            .chain(path.iter().flat_map(|part| on(&part.piece)))
            .collect()
    }

    fn arc(from: [f64; 2], to: [f64; 2], centre: [f64; 2], sweep_rad: f64) -> Programmed {
        programmed(
            Piece::arc(&crate::path::Circle {
                start: Position::xyz(from[0], from[1], 0.0),
                end: Position::xyz(to[0], to[1], 0.0),
                centre_mm: [centre[0], centre[1], 0.0],
                normal: [0.0, 0.0, 1.0],
                sweep_rad,
            })
            .unwrap(),
        )
    }

    #[test]
    fn who_stays_on_the_path_is_followed_to_its_end() {
        use std::f64::consts::{PI, TAU};
        // Outward: three turns of 5 mm each, one arc each; by half turns.
        let spiral: Vec<_> = (0..3)
            .map(|k| {
                let r = 2.0 + 5.0 * f64::from(k);
                arc([r, 0.0], [r + 5.0, 0.0], [0.0, 0.0], TAU)
            })
            .collect();
        let halves: Vec<_> = (0..8)
            .map(|k| {
                let r = 2.0 + 2.0 * f64::from(k);
                let side = if k % 2 == 0 { 1.0 } else { -1.0 };
                arc([side * r, 0.0], [-side * (r + 2.0), 0.0], [0.0, 0.0], PI)
            })
            .collect();
        let inward: Vec<_> = (0..3)
            .map(|k| {
                let r = 20.0 - 5.0 * f64::from(k);
                arc([r, 0.0], [r - 5.0, 0.0], [0.0, 0.0], TAU)
            })
            .collect();
        // Neighbouring turns are nearer than the tolerance.
        let tight: Vec<_> = (1..100)
            .map(|k| {
                let r = 0.01 * f64::from(k);
                let side = if k % 2 == 0 { 1.0 } else { -1.0 };
                arc([side * r, 0.0], [-side * (r + 0.01), 0.0], [0.0, 0.0], PI)
            })
            .collect();
        // Arcs of 5 um, of half turns, on a line.
        let tiny: Vec<_> = (0..400)
            .map(|k| {
                let x = 0.01 * f64::from(k);
                let sweep = if k % 2 == 0 { PI } else { -PI };
                arc([x, 0.0], [x + 0.01, 0.0], [x + 0.005, 0.0], sweep)
            })
            .collect();
        let pecks: Vec<_> = (1..20)
            .flat_map(|k| {
                let z = -0.5 * f64::from(k);
                let at = |x: f64, z: f64| Position::xyz(x, 0.0, z);
                [
                    Piece::line(at(1.0, 2.0), at(1.0, z)),
                    Piece::line(at(1.0, z), at(1.0, 2.0)),
                ]
            })
            .flatten()
            .map(programmed)
            .collect();
        // So slowly that a millimetre has thousands of set-points.
        let corner = [[0.0, 0.0], [12.0, 0.0], [12.0, 12.0]].map(|[x, y]| Position::xyz(x, y, 0.0));
        let slow: Vec<_> = corner
            .windows(2)
            .filter_map(|ends| Piece::line(ends[0], ends[1]))
            .map(programmed)
            .collect();
        let found = deviation(&along(&slow, 0.0002), &slow, 0.01);
        assert!(found.off_mm < 1e-9 && found.missed_mm < 1e-9, "{found:?}");
        assert!((found.length_mm - found.reached_mm).abs() < 1e-9, "{found:?}");
        // All around, and a little more.
        let around = [arc(
            [0.05, 0.0],
            [0.05 * 0.01f64.cos(), 0.05 * 0.01f64.sin()],
            [0.0, 0.0],
            TAU + 0.01,
        )];
        let found = deviation(&along(&around, 0.001), &around, 0.0);
        assert!(
            found.off_mm < 1e-9 && (found.length_mm - found.reached_mm).abs() < 1e-9,
            "{found:?}"
        );
        // Places far apart on it.
        let found = deviation(&along(&slow, 3.0), &slow, 0.01);
        assert!(found.off_mm < 1e-9 && found.missed_mm < 1e-9, "{found:?}");
        let found = deviation(&along(&pecks, 0.625), &pecks, 0.01);
        assert!(found.off_mm < 1e-9 && found.missed_mm < 1e-9, "{found:?}");
        for (name, path) in [
            ("spiral", spiral),
            ("halves", halves),
            ("inward", inward),
            ("tight", tight),
            ("tiny", tiny),
            ("pecks", pecks),
        ] {
            for step in [0.003, 0.05, 0.1] {
                for tolerance in [0.0, 0.01, 0.05] {
                    let found = deviation(&along(&path, step), &path, tolerance);
                    // Chords are off small arcs by much of their radius.
                    let missed_mm = 0.5 * step;
                    let told = format!("{name}, steps of {step}, tolerance {tolerance}: {found:?}");
                    assert!(found.off_mm < 1e-9 && found.missed_mm <= missed_mm, "{told}");
                    assert!((found.length_mm - found.reached_mm).abs() < 1e-6, "{told}");
                }
            }
        }
    }
}
