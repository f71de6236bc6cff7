//! A profile: from the moves of a subroutine to segments along which can be cut.
//!
//! In:  moves with rounded or cut corners, `[Z, X]`, mm.
//! Out: segments in a frame in which the tool comes from greater `q` (depth) and works towards smaller `p` (along),
//!      none of them turning back.

use super::segment::{Point, SAME_MM, Segment, cross, length, minus};
use crate::error::TurningError;
use crate::execute::circle::Arc;
use motion::canon::Source;

/// What a corner becomes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Corner {
    /// A: an arc of this radius, mm.
    Round(f64),
    /// C: a line between the points at which such an arc would begin and end.
    Cut(f64),
}

/// A move of the profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Move {
    pub(super) segment: Segment,
    /// What becomes of its end.
    pub(super) corner: Option<Corner>,
    pub(super) source: Source,
}

/// A symmetry of the plane that makes all profiles alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    /// `p` is X and `q` is Z; else `p` is Z and `q` is X.
    along_x: bool,
    signs: [f64; 2],
}

impl Frame {
    /// In which the profile goes to smaller `p` and greater `q`: from its first corner to its end.
    fn new(moves: &[Move], along_x: bool) -> Frame {
        let first = moves.first().map_or([0.0; 2], |one| one.segment.end);
        let last = moves.last().map_or([0.0; 2], |one| one.segment.end);
        let plain = Frame {
            along_x,
            signs: [1.0, if along_x { -1.0 } else { 1.0 }],
        };
        let way = minus(plain.point(last), plain.point(first));
        let sign = |flip: bool| if flip { -1.0 } else { 1.0 };
        Frame {
            along_x,
            signs: [plain.signs[0] * sign(way[0] > 0.0), plain.signs[1] * sign(way[1] < 0.0)],
        }
    }

    fn point(&self, [z, x]: Point) -> Point {
        let [p, q] = if self.along_x { [x, z] } else { [z, x] };
        [p * self.signs[0], q * self.signs[1]]
    }

    /// A shift as the frame has it.
    pub(super) fn vector(&self, way: Point) -> Point {
        self.point(way)
    }

    /// `[Z, X]` of a point in the frame.
    pub(super) fn back(&self, [p, q]: Point) -> Point {
        let [p, q] = [p * self.signs[0], q * self.signs[1]];
        if self.along_x { [q, p] } else { [p, q] }
    }

    /// The same of an arc's direction, there as back.
    pub(super) fn turns(&self, turns: i32) -> i32 {
        let mirrored = (self.signs[0] * self.signs[1] < 0.0) != self.along_x;
        if mirrored { -turns } else { turns }
    }

    fn segment(&self, segment: Segment) -> Segment {
        Segment {
            start: self.point(segment.start),
            end: self.point(segment.end),
            arc: segment.arc.map(|arc| Arc {
                centre_mm: self.point(arc.centre_mm),
                turns: self.turns(arc.turns),
            }),
            ..segment
        }
    }

    fn axis(&self) -> char {
        if self.along_x { 'X' } else { 'Z' }
    }
}

/// The profile in its frame: the way to its start first. Corners are made.
pub(super) fn normal(moves: &[Move], along_x: bool, unit_mm: f64) -> Result<(Frame, Vec<Segment>), TurningError> {
    let frame = Frame::new(moves, along_x);
    let made = with_corners(moves, unit_mm)?;
    let mut segments: Vec<Segment> = made.into_iter().map(|segment| frame.segment(segment)).collect();
    // A start behind the profile's first point is no way back: the tool comes from beside it.
    if let Some(first) = segments.first_mut()
        && first.end[0] > first.start[0]
    {
        first.start[0] = first.end[0];
    }
    if let Some(back) = segments.iter().find(|segment| turns_back(segment)) {
        let (axis, line) = (frame.axis(), line_of(moves, back));
        return Err(TurningError::NotMonotonic { axis, line });
    }
    Ok((frame, segments))
}

/// How far a profile may go back, mm: as LinuxCNC's.
const BACK_MM: f64 = 1e-3;

fn turns_back(segment: &Segment) -> bool {
    let back = segment.end[0] - segment.start[0];
    match segment.arc {
        None => back > BACK_MM,
        Some(arc) => {
            // Towards smaller p a circle is run on its upper half counter-clockwise, on its lower half clockwise.
            let side = f64::from(arc.turns);
            let height = |point: Point| side * (point[1] - arc.centre_mm[1]);
            height(segment.start) < -BACK_MM || height(segment.end) < -BACK_MM || back > -BACK_MM
        }
    }
}

/// The line of the move that a segment is of.
fn line_of(moves: &[Move], segment: &Segment) -> u32 {
    let of = (segment.of as usize).checked_sub(1).and_then(|index| moves.get(index));
    of.map_or(0, |of| of.source.line)
}

/// The segments with corners rounded and cut, each with its move. A corner at the end of the profile has no effect.
fn with_corners(moves: &[Move], unit_mm: f64) -> Result<Vec<Segment>, TurningError> {
    let mut made: Vec<Segment> = Vec::with_capacity(moves.len());
    let mut corner: Option<Corner> = None;
    for (of, one) in (1..).zip(moves) {
        let mut next = Segment { of, ..one.segment };
        if let Some(before) = made.last_mut()
            && let Some(corner) = corner
        {
            let (line, of) = (line_of(moves, before), before.of);
            let (what, size_mm) = match corner {
                Corner::Round(size) => ("rounding", size),
                Corner::Cut(size) => ("chamfer", size),
            };
            let size = size_mm / unit_mm;
            let inserted = insert(before, &mut next, size_mm).ok_or(TurningError::Corner { what, size, line })?;
            let inserted = match corner {
                Corner::Round(_) => inserted,
                Corner::Cut(_) => Segment::line(inserted.start, inserted.end),
            };
            made.push(Segment { of, ..inserted });
        }
        made.push(next);
        corner = one.corner;
    }
    made.retain(|segment| length(minus(segment.end, segment.start)) > SAME_MM);
    Ok(made)
}

/// Shortens two segments so that an arc of this radius fits between them; gives that arc.
fn insert(before: &mut Segment, behind: &mut Segment, radius_mm: f64) -> Option<Segment> {
    let corner = before.end;
    let turn = cross(before.direction(corner), behind.direction(corner));
    if turn.abs() < 1e-9 {
        return None;
    }
    // The centre is as far from both, on the inner side of the corner.
    let side_mm = if turn < 0.0 { radius_mm } else { -radius_mm };
    let (one, two) = (before.beside(side_mm)?, behind.beside(side_mm)?);
    let candidates = one.meets(&two);
    let near = |a: &Point, b: &Point| {
        let distance = |point: &Point| length(minus(*point, corner));
        distance(a).total_cmp(&distance(b))
    };
    let centre = candidates.into_iter().min_by(near)?;
    let (start, end) = (before.at(one.share(centre)), behind.at(two.share(centre)));
    let tolerance = 1e-6;
    let fits = one.share(centre) >= -tolerance && two.share(centre) <= 1.0 + tolerance;
    if !fits || !start.iter().chain(&end).all(|number| number.is_finite()) {
        return None;
    }
    before.end = start;
    behind.start = end;
    Some(Segment::arc(start, end, centre, if turn > 0.0 { 1 } else { -1 }))
}
