//! A lathe cycle with its words and its profile, and the cuts that it comes to.

use super::allowance;
use super::profile::{Frame, Move, normal};
use super::rough::{Cut, finish, rough};
use super::segment::{Point, Segment};
use crate::code::Roughing;
use crate::error::TurningError;
use motion::canon::Source;

/// A cycle whose profile is being read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Turning {
    /// Number of the subroutine.
    pub(crate) profile: u32,
    pub(super) work: Work,
    /// Where it works from, `[Z, X]`. While the profile is read, the current point is the end of its last move.
    pub(super) start: Point,
    /// Where the cycle stands in the text.
    pub(super) source: Source,
    pub(super) moves: Vec<Move>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Work {
    /// G70; distances of the first and last pass, mm.
    Finish { first_mm: f64, last_mm: f64, passes: u32 },
    /// G71, G72.
    Rough {
        roughing: Roughing,
        allowance_mm: f64,
        step_mm: f64,
        retract_mm: f64,
        shift: Point,
    },
}

impl Turning {
    /// The cuts, each with the number of the move of the profile along which it goes (0: it goes down to it), and the frame in which
    /// they are told.
    pub(super) fn cuts(&self, unit_mm: f64) -> Result<(Frame, Vec<(Cut, u32)>), TurningError> {
        let mut moves = self.moves.clone();
        if moves.len() < 2 {
            return Err(TurningError::TooShort { moves: moves.len() });
        }
        let beside = |path: &[Segment], mm: f64| {
            let allowance = mm / unit_mm;
            // Moves without length are left out by now.
            let [first, rest @ ..] = path else {
                return Err(TurningError::TooShort { moves: 0 });
            };
            if rest.is_empty() {
                return Err(TurningError::TooShort { moves: 1 });
            }
            let beside = allowance::beside(rest, mm).unwrap_or_default();
            let begin = beside.first().ok_or(TurningError::Allowance { allowance })?.start;
            let to_begin = Segment { end: begin, ..*first };
            Ok([vec![to_begin], beside].concat())
        };
        match self.work {
            Work::Finish {
                first_mm,
                last_mm,
                passes,
            } => {
                let along_z = normal(&moves, false, unit_mm);
                let (frame, path) = match along_z {
                    Err(TurningError::NotMonotonic { .. }) => normal(&moves, true, unit_mm).or(along_z)?,
                    Ok(_) | Err(_) => along_z?,
                };
                let mut cuts = Vec::new();
                for pass in (0..passes).rev() {
                    let share = f64::from(pass) / f64::from(passes);
                    finish(&beside(&path, last_mm + share * (first_mm - last_mm))?, &mut cuts);
                }
                Ok((frame, cuts))
            }
            Work::Rough {
                roughing,
                allowance_mm,
                step_mm,
                retract_mm,
                shift,
            } => {
                close(&mut moves, self.start, roughing.along_x);
                let (frame, path) = normal(&moves, roughing.along_x, unit_mm)?;
                let mut path = beside(&path, allowance_mm)?;
                let shift = frame.vector(shift);
                for segment in &mut path {
                    *segment = segment.moved(shift);
                }
                // Cuts at all levels must meet something.
                if let (Some(first), Some(last)) = (path.first(), path.last())
                    && last.end[1] < first.start[1]
                {
                    let end = [last.end[0], first.start[1]];
                    path.push(Segment::line(last.end, end));
                }
                let cuts = rough(&path, roughing.pockets, step_mm, retract_mm)?;
                Ok((frame, cuts.into_iter().map(|cut| (cut, 0)).collect()))
            }
        }
    }
}

/// Leads the end of a profile up to the level from which is cut, so that D is left there, too.
fn close(moves: &mut Vec<Move>, start: Point, along_x: bool) {
    let (Some(first), Some(last)) = (moves.first(), moves.last()) else {
        return;
    };
    let (along, depth) = if along_x { (1, 0) } else { (0, 1) };
    let way = |segment: &Segment, axis: usize| segment.end[axis] - segment.start[axis];
    let from = last.segment.end;
    if way(&last.segment, along) != 0.0 && way(&first.segment, depth) * (start[depth] - from[depth]) < 0.0 {
        let mut to = from;
        to[depth] = start[depth];
        let source = last.source;
        moves.push(Move {
            segment: Segment::line(from, to),
            corner: None,
            source,
        });
    }
}
