//! Cycles of a lathe along a profile: G70, G71, G72.
//!
//! In:  the words of the cycle, then the moves of the subroutine that Q names, gathered instead of told.
//! Out: when it returns: cuts along Z (G71) or X (G72) down to the profile, or passes along it (G70).
//!
//! Rules and results are LinuxCNC's: the cycle works from where it starts (X, Z, else the current point); D is left on
//! the profile, I the depth of a cut, R the retract; G70 makes P passes, the first D and the last E beside the profile;
//! U and W shift the profile. F in the profile is of no effect: the feed in force when the cycle begins holds for all of
//! it. A corner at the end of the last move is of no effect, too.

mod allowance;
mod cycle;
mod profile;
mod rough;
mod segment;

use super::circle;
use crate::block::{Block, letters};
use crate::code::{Distance, FeedUnit, Motion, Roughing, integer_in, plane_name};
use crate::error::{ArcError, ErrorKind, TurningError};
use crate::scan::Fault;
use crate::state::{Calls, State};
pub(crate) use cycle::Turning;
use motion::canon::{Axis, Call, Plane, Position, Source};

use cycle::Work;
use profile::{Corner, Move};
use rough::Cut;
use segment::{Point, Segment, plus};

/// Most moves of a profile.
const MOVES_MAX: usize = 1000;
/// Most passes of G70.
const PASSES_MAX: u32 = 100;

impl State {
    pub(super) fn finish(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let mm = self.modal.unit.mm();
        let passes = block.word_value(b'P').unwrap_or(1.0);
        let max = PASSES_MAX;
        let passes = match integer_in(passes, 1..=i64::from(max)) {
            Some(passes) => passes as u32,
            None => return Err(block.span(b'P').fault(TurningError::Passes { value: passes, max })),
        };
        let work = Work::Finish {
            first_mm: mm * block.word_value(b'D').unwrap_or(0.0),
            last_mm: mm * block.word_value(b'E').unwrap_or(0.0),
            passes,
        };
        self.begin_turning(work, block, calls)
    }

    pub(super) fn rough(&mut self, roughing: Roughing, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let mm = self.modal.unit.mm();
        let word = |letter, default| block.word_value(letter).unwrap_or(default);
        if self.compensation.cutter.is_some() {
            let code = self.motion_name(block);
            return Err(block.motion_span().fault(TurningError::Compensated { code }));
        }
        let (step, retract) = (word(b'I', 1.0), word(b'R', 0.5));
        if step <= 0.0 {
            return Err(block.span(b'I').fault(TurningError::Increment { value: step }));
        }
        if retract < 0.0 {
            return Err(block.span(b'R').fault(TurningError::Retract { value: retract }));
        }
        let work = Work::Rough {
            roughing,
            allowance_mm: mm * word(b'D', 0.0),
            step_mm: mm * step,
            retract_mm: mm * retract,
            shift: [mm * word(b'W', 0.0), mm * word(b'U', 0.0)],
        };
        self.begin_turning(work, block, calls)
    }

    fn begin_turning(&mut self, work: Work, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let span = block.motion_span();
        let code = self.motion_name(block);
        if self.modal.plane != Plane::Zx {
            let plane = plane_name(self.modal.plane);
            return Err(span.fault(TurningError::Plane { code, plane }));
        }
        if self.modal.feed_unit == FeedUnit::InverseTime {
            return Err(span.fault(TurningError::InverseTime { code }));
        }
        let Some(number) = block.word_value(b'Q') else {
            return Err(span.fault(TurningError::ProfileMissing { code }));
        };
        let Some(number) = integer_in(number, 0..=i64::from(u32::MAX)) else {
            return Err(block.span(b'Q').fault(TurningError::ProfileNumber { value: number }));
        };
        if let Some(stop) = block.codes.stop {
            return Err(stop.span.fault(TurningError::StopOnLine));
        }
        other_axes(block, b"YABCV@^")?;
        self.need_feed(block, || super::feed::PathLength::Mm(0.0), calls)?;
        let mut to = self.at;
        for axis in [Axis::X, Axis::Z] {
            if let Some(number) = block.axis(axis) {
                to[axis] = self.turning_end(axis, number, self.at[axis]);
            }
        }
        self.at = to;
        calls.push_back(Call::StraightTraverse { to });
        self.modal.motion = Some(Motion::Traverse);
        self.turning = Some(Turning {
            profile: number as u32,
            work,
            start: [to[Axis::Z], to[Axis::X]],
            source: self.source,
            moves: Vec::new(),
        });
        Ok(())
    }

    /// A line of a profile: its move is gathered.
    pub(super) fn read_profile_block(&mut self, block: &Block) -> Result<(), Fault> {
        let Some(mut turning) = self.turning.take() else {
            return Ok(());
        };
        let result = self.add_profile_move(&mut turning, block);
        self.turning = Some(turning);
        result
    }

    fn add_profile_move(&mut self, turning: &mut Turning, block: &Block) -> Result<(), Fault> {
        if let Some(span) = block.codes.first_beside_motion() {
            return Err(span.fault(TurningError::NoProfile));
        }
        match block.codes.motion.map(|code| (code.value, code.span)) {
            None => {}
            Some((
                Some(motion @ (Motion::Traverse | Motion::Feed | Motion::ArcClockwise | Motion::ArcCounterclockwise)),
                _,
            )) => self.modal.motion = Some(motion),
            Some((_, span)) => return Err(span.fault(TurningError::NoProfile)),
        }
        other_axes(block, b"YBV@^STDEHJLPQ$")?;
        let at = [self.at[Axis::Z], self.at[Axis::X]];
        let x = self.profile_end(block, Axis::X, b'U', at[1])?;
        let z = self.profile_end(block, Axis::Z, b'W', at[0])?;
        let end = [z, x];
        if end == at {
            return Ok(());
        }
        if turning.moves.len() >= MOVES_MAX {
            return Err(block.motion_span().fault(TurningError::TooLong { max: MOVES_MAX }));
        }
        let segment = match self.modal.motion {
            Some(motion @ (Motion::ArcClockwise | Motion::ArcCounterclockwise)) => {
                self.profile_arc(motion, block, at, end)?
            }
            _ => Segment::line(at, end),
        };
        let mm = self.modal.unit.mm();
        let size = |letter: u8| {
            block
                .word_value(letter)
                .map(|size| size.abs() * mm)
                .filter(|size| *size > 0.0)
        };
        let corner = match (size(b'A'), size(b'C')) {
            (Some(_), Some(_)) => return Err(block.span(b'C').fault(TurningError::TwoCorners)),
            (Some(size), None) => Some(Corner::Round(size)),
            (None, Some(size)) => Some(Corner::Cut(size)),
            (None, None) => None,
        };
        [self.at[Axis::Z], self.at[Axis::X]] = end;
        turning.moves.push(Move {
            segment,
            corner,
            source: self.source,
        });
        Ok(())
    }

    /// Where a move of a profile ends on an axis, mm.
    fn profile_end(&self, block: &Block, axis: Axis, increment: u8, at: f64) -> Result<f64, Fault> {
        let letter = axis.letter();
        match (block.axis(axis), block.word_value(increment)) {
            (Some(_), Some(_)) => Err(block.span(increment).fault(TurningError::TwoWords {
                first: letter,
                second: increment.into(),
                axis: letter,
            })),
            (None, Some(_)) if self.modal.distance == Distance::Incremental => {
                Err(block.span(increment).fault(TurningError::IncrementTwice {
                    letter: increment.into(),
                    axis: letter,
                }))
            }
            (None, Some(number)) => Ok(at + self.turning_length(axis, number)),
            (Some(number), None) => Ok(self.turning_end(axis, number, at)),
            (None, None) => Ok(at),
        }
    }

    /// Length of a word of X or Z (in G7 X is a diameter), mm.
    fn turning_length(&self, axis: Axis, number: f64) -> f64 {
        let halved = axis == Axis::X && self.modal.diameter;
        self.length(axis, number) / if halved { 2.0 } else { 1.0 }
    }

    fn turning_end(&self, axis: Axis, number: f64, at: f64) -> f64 {
        let value = self.turning_length(axis, number);
        match self.modal.distance {
            Distance::Absolute => value,
            Distance::Incremental => at + value,
        }
    }

    fn profile_arc(&self, motion: Motion, block: &Block, start: Point, end: Point) -> Result<Segment, Fault> {
        let unit = self.modal.unit;
        let turns = circle::signed_turns(motion == Motion::ArcClockwise, 1);
        let given = block.first_of(b"KI");
        if let Some(radius) = block.word_value(b'R') {
            if let Some(letter) = given {
                return Err(block.span(letter).fault(ArcError::Mixed { letter: letter.into() }));
            }
            let arc = circle::by_radius(start, end, radius * unit.mm(), turns, unit)
                .map_err(|kind| block.span(b'R').fault(kind))?;
            return Ok(Segment::arc(start, end, arc.centre_mm, turns));
        }
        let Some(given) = given else {
            let (motion, offsets) = (motion.name(), "I, K");
            return Err(block.motion_span().fault(ArcError::CentreMissing { motion, offsets }));
        };
        let offset = *b"KI";
        let centre = match self.modal.arc_distance {
            Distance::Incremental => plus(
                start,
                offset.map(|letter| block.word_value(letter).unwrap_or(0.0) * unit.mm()),
            ),
            Distance::Absolute => {
                let mut centre = [0.0; 2];
                for (place, letter) in centre.iter_mut().zip(offset) {
                    let missing = letter.into();
                    let number = block
                        .word_value(letter)
                        .ok_or(block.span(given).fault(ArcError::AbsoluteCentreIncomplete { missing }))?;
                    *place = number * unit.mm();
                }
                centre
            }
        };
        let tolerance_mm = self.settings.arc_radius_tolerance_mm;
        circle::by_centre(start, end, centre, turns, unit, tolerance_mm)
            .map_err(|kind| block.span(given).fault(kind))?;
        Ok(Segment::arc(start, end, centre, turns))
    }

    /// Ends the reading of a profile; the tool is still where the cycle begins.
    pub(crate) fn leave_profile(&mut self) -> Option<Turning> {
        let turning = self.turning.take()?;
        [self.at[Axis::Z], self.at[Axis::X]] = turning.start;
        Some(turning)
    }

    /// The profile is read: tells the cuts.
    pub(crate) fn cut_profile(&mut self, calls: &mut Calls) -> Result<(), ErrorKind> {
        let Some(turning) = self.leave_profile() else {
            return Ok(());
        };
        let (frame, cuts) = turning.cuts(self.modal.unit.mm()).map_err(ErrorKind::Turning)?;
        let place = |at: Position, point: Point| {
            let mut to = at;
            [to[Axis::Z], to[Axis::X]] = frame.back(point);
            to
        };
        // The calls before, if there are any, are of the line that ends the profile.
        self.sources.resize(calls.len(), self.source);
        for (cut, of) in cuts {
            let of = (of as usize).checked_sub(1).and_then(|index| turning.moves.get(index));
            let source = of.map_or(turning.source, |of| of.source);
            self.sources.push_back(Source {
                n: self.source.n,
                n_digits: self.source.n_digits,
                ..source
            });
            let to = place(self.at, cut.to());
            let motion = match cut {
                Cut::Rapid(_) => {
                    calls.push_back(Call::StraightTraverse { to });
                    Motion::Traverse
                }
                Cut::Feed(_) => {
                    calls.push_back(Call::StraightFeed { to });
                    Motion::Feed
                }
                Cut::Arc { arc, .. } => {
                    let turns = frame.turns(arc.turns);
                    calls.push_back(Call::ArcFeed {
                        to,
                        plane: Plane::Zx,
                        centre_mm: frame.back(arc.centre_mm),
                        turns,
                    });
                    if turns > 0 {
                        Motion::ArcCounterclockwise
                    } else {
                        Motion::ArcClockwise
                    }
                }
            };
            self.at = to;
            self.modal.motion = Some(motion);
        }
        Ok(())
    }
}

/// Refuses words that belong to nothing here.
fn other_axes(block: &Block, names: &[u8]) -> Result<(), Fault> {
    match block.first_of(names) {
        Some(letter) if letters(b"STDEHJLPQ$") & letters(&[letter]) != 0 => {
            Err(block.span(letter).fault(TurningError::NoProfile))
        }
        Some(letter) => Err(block
            .span(letter)
            .fault(TurningError::OtherAxis { letter: letter.into() })),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
