//! The threading cycle of lathes: G76.
//!
//! ```text
//!          E              E
//!   start ┌─┐            ┌─┐   crest + 1 K ... start: where the tool goes back
//!            ╲          ╱
//!             ╲________╱       cut after cut deeper, up to crest + K
//! ```
//! The first cut is J deep, the n-th J times the (1/R)-th power of n, the last one K; H more follow at K. Each begins and
//! ends shifted along Z by the tangent of Q, so that the tool cuts with one edge; the last one ends at the programmed Z.

use super::{START_CODES, missing};
use crate::block::Block;
use crate::error::{CycleError, ErrorKind, ThreadError};
use crate::execute::cycle::PASSES_MAX;
use crate::scan::Fault;
use crate::state::{Calls, State};
use motion::canon::{Axis, Call, Position};

/// A thread in program units; X is a radius.
struct Thread {
    /// The point that all cuts set out from; Y and other axes as they are.
    start: Position,
    unit_mm: f64,
    /// Program units of `start`.
    start_x: f64,
    start_z: f64,
    end_z: f64,
    /// 1: X grows with the depth (internal thread); -1: external.
    inwards: f64,
    /// 1: cuts go towards greater Z.
    along: f64,
    /// From the start to the crest.
    crest: f64,
    /// J
    first_cut: f64,
    /// K
    depth: f64,
    /// P
    pitch: f64,
    /// Tangent of Q.
    slide: f64,
    /// E, if there is a taper at all.
    taper: f64,
    taper_in: bool,
    taper_out: bool,
    spindle: u8,
}

impl State {
    /// What can be told of the words of G76 before anything of the line is run.
    pub(in crate::execute) fn check_thread(&self, block: &Block) -> Result<(), Fault> {
        if block.first_axis().is_none() {
            return Err((block.motion_span(), ErrorKind::AxisMissing { code: "G76".into() }));
        }
        self.check_thread_plane(block)?;
        for (letter, meaning) in [
            (b'P', "the way per turn of the spindle"),
            (
                b'I',
                "the way from the start to the crest of the thread, below 0 for an external one",
            ),
            (b'J', "the depth of the first cut"),
            (b'K', "the full depth of the thread"),
        ] {
            if block.word_value(letter).is_none() {
                return Err((block.motion_span(), missing("G76".into(), letter, meaning)));
            }
        }
        for letter in *b"PHLE" {
            block.check_not_negative(letter)?;
        }
        block.check_integer(b'H')?;
        block.check_integer(b'L')
    }

    fn check_thread_plane(&self, block: &Block) -> Result<(), Fault> {
        match block.first_of(b"@^") {
            Some(letter) if self.plane_of(block) != motion::canon::Plane::Xy => {
                let code = "G76".into();
                Err(block.span(letter).fault(CycleError::Polar { code }))
            }
            Some(_) | None => Ok(()),
        }
    }

    pub(in crate::execute) fn thread(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        self.need_no_compensation(block)?;
        let spindle = self.select_spindle(block)?;
        self.need_turning(block, spindle, START_CODES)?;
        if let Some(letter) = block.first_of(b"ABC") {
            return Err(block.span(letter).fault(CycleError::Rotary {
                letter: letter.into(),
                code: "G76".into(),
            }));
        }
        let end = self.end(block)?;
        let thread = self.thread_of(block, end, spindle)?;
        let spring_cuts = block.word_value(b'H').map_or(0, |number| number.round() as u32);
        let degression = block.word_value(b'R').map_or(1.0, |number| number.max(1.0));
        // The n that makes K of J * n ** (1/R).
        let count = libm::pow(thread.depth / thread.first_cut, degression) + f64::from(spring_cuts);
        if count > f64::from(PASSES_MAX) {
            return Err(self.too_long(block, count));
        }
        for n in 1..=PASSES_MAX {
            let depth = thread.first_cut * libm::pow(f64::from(n), 1.0 / degression);
            // As LinuxCNC asks it: counted from the start, the sum's rounding decides whether a last small cut is made.
            if thread.crest + depth >= thread.crest + thread.depth {
                break;
            }
            thread.cut(depth, calls);
        }
        for _ in 0..=spring_cuts {
            thread.cut(thread.depth, calls);
        }
        calls.push_back(Call::StraightTraverse { to: end });
        self.at = end;
        Ok(())
    }

    fn thread_of(&self, block: &Block, end: Position, spindle: u8) -> Result<Thread, Fault> {
        let word = |letter: u8| block.word_value(letter).unwrap_or(0.0);
        let fail = |letter: u8, error: ThreadError| Err(block.span(letter).fault(error));
        let radius = if self.modal.diameter { 0.5 } else { 1.0 };
        let [crest, first_cut, depth] = [b'I', b'J', b'K'].map(|letter| word(letter) * radius);
        let (pitch, angle, taper_kind) = (word(b'P'), word(b'Q'), word(b'L').round());
        if pitch == 0.0 {
            let (letter, rule) = ('P', "above 0");
            let (code, value) = ("G76".into(), pitch);
            return fail(
                b'P',
                ThreadError::Pitch {
                    code,
                    letter,
                    rule,
                    value,
                },
            );
        }
        if crest == 0.0 {
            return fail(b'I', ThreadError::Crest);
        }
        if first_cut <= 0.0 {
            return fail(b'J', ThreadError::FirstCut { value: word(b'J') });
        }
        if depth <= first_cut {
            let (value, first_cut) = (word(b'K'), word(b'J'));
            return fail(b'K', ThreadError::Depth { value, first_cut });
        }
        if angle.abs() >= 90.0 {
            return fail(b'Q', ThreadError::Angle { value: angle });
        }
        if taper_kind > 3.0 {
            return fail(b'L', ThreadError::Taper { value: word(b'L') });
        }
        let unit = self.modal.unit;
        let units = |mm: f64| crate::print::length_in(mm, unit);
        let taper = word(b'E');
        Ok(Thread {
            start: self.at,
            unit_mm: unit.mm(),
            start_x: units(self.at[Axis::X]),
            start_z: units(self.at[Axis::Z]),
            end_z: units(end[Axis::Z]),
            inwards: crest.signum(),
            along: if end[Axis::Z] > self.at[Axis::Z] { 1.0 } else { -1.0 },
            crest: crest.abs(),
            first_cut,
            depth,
            pitch,
            slide: libm::tan(angle.to_radians()),
            taper,
            taper_in: taper > 0.0 && taper_kind % 2.0 == 1.0,
            taper_out: taper > 0.0 && taper_kind >= 2.0,
            spindle,
        })
    }
}

impl Thread {
    fn point(&self, x: f64, z: f64) -> Position {
        let mut point = self.start;
        point[Axis::X] = x * self.unit_mm;
        point[Axis::Z] = z * self.unit_mm;
        point
    }

    fn sync(&self, pitch: f64) -> Call {
        Call::StartSpindleSync {
            spindle: self.spindle,
            mm_per_turn: pitch * self.unit_mm,
            velocity: false,
        }
    }

    /// One cut, from above its start to above its end.
    fn cut(&self, depth: f64, calls: &mut Calls) {
        let rapid = |x: f64, z: f64| Call::StraightTraverse { to: self.point(x, z) };
        let feed = |x: f64, z: f64| Call::StraightFeed { to: self.point(x, z) };
        let cut_x = self.start_x + self.inwards * (self.crest + depth);
        let above_x = self.start_x - self.inwards * (self.depth - depth);
        let taper_x = cut_x - self.inwards * self.depth;
        let start_z = self.start_z + self.along * depth * self.slide;
        let end_z = self.end_z - self.along * (self.depth - depth) * self.slide;
        // So fast that the way along Z has the pitch of the thread.
        let taper_pitch = || self.pitch * libm::hypot(self.depth, self.taper) / self.taper;

        calls.push_back(rapid(above_x, start_z));
        if !self.taper_in {
            calls.push_back(rapid(cut_x, start_z));
        }
        calls.push_back(Call::EnableFeedOverride(false));
        if self.taper_in {
            let to_z = start_z + self.along * self.taper;
            calls.extend([self.sync(taper_pitch()), feed(taper_x, start_z), feed(cut_x, to_z)]);
        }
        calls.push_back(self.sync(self.pitch));
        if self.taper_out {
            calls.push_back(feed(cut_x, end_z - self.along * self.taper));
            calls.extend([self.sync(taper_pitch()), feed(taper_x, end_z)]);
        } else {
            calls.push_back(feed(cut_x, end_z));
        }
        // LinuxCNC lets the override act again even if M49 or M50 had switched it off.
        calls.extend([
            Call::StopSpindleSync,
            rapid(above_x, end_z),
            Call::EnableFeedOverride(true),
        ]);
    }
}
