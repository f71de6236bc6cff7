//! Canned cycles: G73, G74, G81 to G89.
//!
//! In:  the words of a line, and those of the lines before that still hold.
//! Out: the moves of its holes, in exact path mode, and the path mode that was there before.
//!
//! [`State::cycle`] is what all cycles have in common; what each does in its hole is the table at the end of `steps`.
//!
//! Levels along the normal of the plane are computed in the program's unit and as LinuxCNC does it, because the rounding of
//! their sums decides how many pecks a hole has.

mod hole;
mod steps;
#[cfg(test)]
mod tests;
mod words;

use crate::block::{Block, letters};
use crate::code::{Cycle, Distance, FeedUnit, Motion, Retract, integer_in, plane_name};
use crate::error::{CycleError, ErrorKind};
use crate::print::length_in;
use crate::scan::Fault;
use crate::state::{Calls, State};
use hole::Hole;
pub(super) use hole::PASSES_MAX;
use motion::canon::{Axis, Call, LengthUnit, PathMode, Plane, SpindleDirection};
pub(crate) use words::CycleWords;

use steps::{SpindleRule, spindle_rule, steps};

/// Levels nearer to each other than this, in program units, are the same.
const LEVEL_ROUNDING: f64 = 1e-9;

/// The words of a line that make its holes, with those that still hold.
struct Words {
    r: f64,
    depth: f64,
    dwell_s: f64,
    peck: f64,
    aside: [f64; 3],
}

impl State {
    pub(super) fn cycle(&mut self, cycle: Cycle, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        self.need_cycle_feed(block, calls)?;
        self.need_no_compensation(block)?;
        let [.., normal] = self.modal.plane.axes();
        let (r_word, depth_word) = self.level_words(cycle, block)?;
        let repeats = self.repeats(block)?;

        let unit = self.modal.unit;
        let mut current = length_in(self.at[normal], unit);
        let mut initial = *self.cycle.initial.get_or_insert(current);
        let (r, bottom) = match self.modal.distance {
            Distance::Absolute => (r_word, depth_word),
            Distance::Incremental => (r_word + initial, r_word + initial + depth_word),
        };
        if r < bottom {
            let axis = normal.letter();
            let span = match block.first_of(&[b'R', axis as u8]) {
                Some(letter) => block.span(letter),
                None => block.motion_span(),
            };
            let depth = bottom;
            return Err(span.fault(CycleError::RBelowDepth { r, axis, depth }));
        }
        // A level that came from R through millimetres and back is still R.
        for level in [&mut initial, &mut current] {
            if (*level - r).abs() < LEVEL_ROUNDING {
                *level = r;
            }
        }
        if initial < r {
            self.at[normal] = r * unit.mm();
            calls.push_back(Call::StraightTraverse { to: self.at });
            initial = r;
            current = r;
        }
        let retract = match self.modal.retract {
            Retract::R => r,
            Retract::OldZ => initial,
        };

        let path_mode = self.modal.path_mode;
        if path_mode != PathMode::ExactPath {
            calls.push_back(Call::SetPathMode(PathMode::ExactPath));
        }
        let words = self.hole_words(cycle, block, r_word, depth_word)?;
        if r == bottom {
            self.doubts.drills_nothing(self.source);
        }
        if let Some(seconds) = block.word_value(b'P') {
            self.doubts.dwell(self.source, seconds);
        }
        self.doubts.cut(self.source);
        let mut hole = self.hole(cycle, block, &words, [r, bottom, retract])?;
        self.check_length(cycle, block, repeats, &hole)?;
        for count in 0..repeats {
            hole.at = self.end(block)?;
            if count == 0 && current > r {
                hole.rapid(current, calls);
                hole.rapid(r, calls);
            } else {
                hole.rapid(retract, calls);
                if retract > r {
                    hole.rapid(r, calls);
                }
            }
            self.check_spindle(cycle, block, &hole)?;
            self.check_peck(cycle, block, &hole)?;
            for step in steps(cycle) {
                hole.step(*step, calls);
            }
            self.at = hole.at;
            self.at[normal] = retract * unit.mm();
        }
        if path_mode != PathMode::ExactPath {
            calls.push_back(Call::SetPathMode(path_mode));
        }

        self.cycle = CycleWords {
            cycle: Some(cycle),
            r: words.r,
            depth: words.depth,
            dwell_s: words.dwell_s,
            peck: words.peck,
            aside: words.aside,
            initial: self.cycle.initial,
        };
        Ok(())
    }

    /// What can be told of the words before anything of the line is run.
    pub(super) fn check_cycle(&self, block: &Block) -> Result<(), Fault> {
        let code = || self.motion_name(block);
        if block.first_axis().is_none() {
            return Err((block.motion_span(), ErrorKind::AxisMissing { code: code() }));
        }
        if let Some(letter) = block.first_of(b"ABC") {
            return Err(block.span(letter).fault(CycleError::Rotary {
                letter: letter.into(),
                code: code(),
            }));
        }
        if let Some(letter) = block.first_of(b"@^")
            && self.plane_of(block) != Plane::Xy
        {
            return Err(block.span(letter).fault(CycleError::Polar { code: code() }));
        }
        block.check_not_negative(b'L')?;
        block.check_integer(b'L')
    }

    /// The plane that is in force when the motion of a line is run.
    pub(super) fn plane_of(&self, block: &Block) -> Plane {
        block.codes.plane.map_or(self.modal.plane, |code| code.value)
    }

    fn need_cycle_feed(&self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        match self.modal.feed_unit {
            FeedUnit::InverseTime => {
                let cycle = self.motion_name(block);
                Err(block.motion_span().fault(CycleError::InverseTime { cycle }))
            }
            FeedUnit::UnitsPerMinute | FeedUnit::UnitsPerTurn => {
                self.need_feed(block, || super::feed::PathLength::Mm(0.0), calls)
            }
        }
    }

    /// Refuses a cycle or a thread while cutter compensation is on.
    pub(super) fn need_no_compensation(&self, block: &Block) -> Result<(), Fault> {
        if self.compensation.cutter.is_none() {
            return Ok(());
        }
        let code = self.motion_name(block);
        Err(block.motion_span().fault(CycleError::Compensated { code }))
    }

    /// R and depth as numbers of the program, from the line or, in a run of the same cycle, from before.
    fn level_words(&self, cycle: Cycle, block: &Block) -> Result<(f64, f64), Fault> {
        let name = || self.motion_name(block);
        let held = self.cycle.cycle == Some(cycle);
        let [first, second, normal] = self.modal.plane.axes();
        let r = block.word_value(b'R').or(held.then_some(self.cycle.r));
        let r = r.ok_or_else(|| block.motion_span().fault(CycleError::RMissing { cycle: name() }))?;
        for axis in Axis::ALL.into_iter().filter(|axis| !axis.is_rotary()) {
            if block.axis(axis).is_some() && ![first, second, normal].contains(&axis) {
                return Err(block.span(axis.letter() as u8).fault(CycleError::AxisOfOtherPlane {
                    letter: axis.letter(),
                    code: name(),
                    plane: format!(
                        "{}{} ({})",
                        first.letter(),
                        second.letter(),
                        plane_name(self.modal.plane)
                    ),
                    axes: format!("{} {} {}", first.letter(), second.letter(), normal.letter()),
                }));
            }
        }
        let radius = if normal == Axis::X && self.modal.diameter {
            0.5
        } else {
            1.0
        };
        let depth = block.axis(normal).map(|depth| depth * radius);
        let depth = depth.or(held.then_some(self.cycle.depth)).ok_or_else(|| {
            let axis = normal.letter();
            block
                .motion_span()
                .fault(CycleError::DepthMissing { cycle: name(), axis })
        })?;
        Ok((r, depth))
    }

    fn repeats(&self, block: &Block) -> Result<u32, Fault> {
        match block.word_value(b'L') {
            None => Ok(1),
            Some(number) => match integer_in(number, 0..=i64::from(u32::MAX)) {
                Some(0) => {
                    let cycle = self.motion_name(block);
                    Err(block.span(b'L').fault(CycleError::Repeats { cycle }))
                }
                Some(repeats) => Ok(repeats as u32),
                None => Err(self.too_long(block, number)),
            },
        }
    }

    /// P, Q, I, J and K, from the line or, in a run of the same cycle, from before.
    fn hole_words(&self, cycle: Cycle, block: &Block, r: f64, depth: f64) -> Result<Words, Fault> {
        block.check_dwell(b'P')?;
        block.check_not_negative(b'D')?;
        let held = self.cycle.cycle == Some(cycle);
        let before = &self.cycle;
        let word = |letter: u8, before: f64| block.word_value(letter).unwrap_or(before);
        let words = Words {
            r,
            depth,
            dwell_s: word(b'P', before.dwell_s),
            peck: word(b'Q', before.peck),
            aside: [
                word(b'I', before.aside[0]),
                word(b'J', before.aside[1]),
                word(b'K', before.aside[2]),
            ],
        };
        let missing = |letter: &&(u8, &str)| !held && !block.has(letters(&[letter.0]));
        if let Some((letter, meaning)) = words_needed(cycle, self.modal.plane).iter().find(missing) {
            return Err(block.motion_span().fault(CycleError::WordMissing {
                code: self.motion_name(block),
                letter: (*letter).into(),
                meaning,
            }));
        }
        Ok(words)
    }

    fn hole(
        &mut self,
        cycle: Cycle,
        block: &Block,
        words: &Words,
        [r, bottom, retract]: [f64; 3],
    ) -> Result<Hole, Fault> {
        let [first, second, normal] = self.modal.plane.axes();
        let unit_mm = self.modal.unit.mm();
        let aside = |axis: Axis| words.aside[axis as usize % 3];
        let counterbore = match self.modal.distance {
            Distance::Absolute => aside(normal),
            Distance::Incremental => bottom + aside(normal),
        };
        let spindle = if matches!(cycle, Cycle::LeftTapping | Cycle::RightTapping) {
            self.select_spindle(block)?
        } else {
            self.spindle
        };
        let clearance_mm = if cycle == Cycle::ChipBreaking {
            self.settings.chip_breaking_clearance_mm
        } else {
            self.settings.peck_clearance_mm
        };
        Ok(Hole {
            at: self.at,
            normal,
            unit_mm,
            r,
            bottom,
            retract,
            counterbore,
            peck: words.peck,
            clearance: match (block.word_value(b'D'), clearance_mm) {
                (Some(clearance), _) => clearance,
                (None, Some(clearance_mm)) => length_in(clearance_mm, self.modal.unit),
                (None, None) => usual_clearance(self.modal.unit),
            },
            dwell_s: words.dwell_s,
            aside_mm: [first, second].map(|axis| (axis, aside(axis) * unit_mm)),
            spindle,
            turning: self.modal.spindles[usize::from(spindle)].turning,
            overrides: self.modal.overrides,
        })
    }
}

/// What is checked when a hole is begun, and the spindle of cycles and threads.
impl State {
    /// The spindle with which a thread goes: the one that `$` names, from then on for all.
    pub(super) fn select_spindle(&mut self, block: &Block) -> Result<u8, Fault> {
        if let Some(number) = block.word_value(b'$') {
            let last = self.settings.spindles - 1;
            let spindle = integer_in(number, 0..=i64::from(last)).ok_or_else(|| {
                let code = self.motion_name(block);
                block.span(b'$').fault(CycleError::OneSpindle { number, code, last })
            })?;
            self.spindle = spindle as u8;
        }
        Ok(self.spindle)
    }

    /// Refuses a code that needs a turning spindle if it stands.
    pub(super) fn need_turning(&self, block: &Block, spindle: u8, start: &'static str) -> Result<(), Fault> {
        if self.modal.spindles[usize::from(spindle)].turning.is_some() {
            return Ok(());
        }
        let code = self.motion_name(block);
        Err(block
            .motion_span()
            .fault(CycleError::SpindleAtRest { code, spindle, start }))
    }

    fn check_spindle(&self, cycle: Cycle, block: &Block, hole: &Hole) -> Result<(), Fault> {
        let needed = match spindle_rule(cycle) {
            SpindleRule::Any => return Ok(()),
            SpindleRule::Turning => return self.need_turning(block, hole.spindle, "M3 or M4"),
            SpindleRule::TurningIn(needed) => needed,
        };
        let (start, needed_name, other) = match needed {
            SpindleDirection::Clockwise => ("M3", "clockwise (M3)", Cycle::LeftTapping),
            SpindleDirection::Counterclockwise => ("M4", "counter-clockwise (M4)", Cycle::RightTapping),
        };
        self.need_turning(block, hole.spindle, start)?;
        if hole.turning == Some(needed) {
            return Ok(());
        }
        Err(block.motion_span().fault(CycleError::SpindleDirection {
            code: self.motion_name(block),
            needed: needed_name,
            other: Motion::Cycle(other).name(),
        }))
    }

    fn check_peck(&self, cycle: Cycle, block: &Block, hole: &Hole) -> Result<(), Fault> {
        if !pecks(cycle) || hole.peck > 0.0 {
            return Ok(());
        }
        let cycle = self.motion_name(block);
        Err(block.span(b'Q').fault(CycleError::Peck {
            cycle,
            value: hole.peck,
        }))
    }

    fn check_length(&self, cycle: Cycle, block: &Block, repeats: u32, hole: &Hole) -> Result<(), Fault> {
        let a_hole = if pecks(cycle) && hole.peck > 0.0 {
            hole.peck_count()
        } else {
            1.0
        };
        let count = a_hole * f64::from(repeats);
        if count <= f64::from(PASSES_MAX) {
            return Ok(());
        }
        Err(self.too_long(block, count))
    }

    pub(super) fn too_long(&self, block: &Block, count: f64) -> Fault {
        let code = self.motion_name(block);
        let max = PASSES_MAX;
        block.motion_span().fault(CycleError::TooLong { code, count, max })
    }
}

/// How far a peck comes out, or stays away from the last depth, where neither D nor a setting says so: as in LinuxCNC.
fn usual_clearance(unit: LengthUnit) -> f64 {
    match unit {
        LengthUnit::Millimetre => 1.0,
        LengthUnit::Inch => 0.05,
    }
}

fn pecks(cycle: Cycle) -> bool {
    matches!(cycle, Cycle::ChipBreaking | Cycle::PeckDrilling)
}

/// Words that the first line of a run needs beside R and depth, with what they tell.
fn words_needed(cycle: Cycle, plane: Plane) -> &'static [(u8, &'static str)] {
    match cycle {
        Cycle::ChipBreaking | Cycle::PeckDrilling => &[(b'Q', "the depth of one peck")],
        Cycle::DwellDrilling | Cycle::StopBoring | Cycle::ManualBoring | Cycle::DwellBoring => {
            &[(b'P', "the seconds to wait at the bottom")]
        }
        Cycle::BackBoring => back_boring_words(plane),
        Cycle::LeftTapping | Cycle::RightTapping | Cycle::Drilling | Cycle::Boring => &[],
    }
}

fn back_boring_words(plane: Plane) -> &'static [(u8, &'static str)] {
    const ASIDE: &str = "how far beside the hole the tool goes in and out";
    const END: &str = "the level at which the counterbore ends";
    match plane {
        Plane::Xy | Plane::Uv => &[(b'I', ASIDE), (b'J', ASIDE), (b'K', END)],
        Plane::Zx | Plane::Wu => &[(b'I', ASIDE), (b'J', END), (b'K', ASIDE)],
        Plane::Yz | Plane::Vw => &[(b'I', END), (b'J', ASIDE), (b'K', ASIDE)],
    }
}
