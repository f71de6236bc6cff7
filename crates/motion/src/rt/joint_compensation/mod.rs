//! Backlash and pitch error of one joint.
//!
//! In:  commanded position of the joint, mm, once a cycle.
//! Out: what the motor is told instead: [`JointCompensation::step`]; taken off again from what it reports.
//!
//! What is added is the correction of the way that the joint goes, forward or backward, at the very position that is commanded
//! ([`PitchTable`], half of the backlash to either side), and what is left of the one before: where the joint turns round, the new
//! correction lies elsewhere than the old one, and the distance is taken up by the quickest jerk-limited way, from how it moves to
//! rest ([`TrajectoryGenerator`]). Until a joint has moved nobody knows on which side it stands: what is added stays what it is.
//!
//! [`CompensationShare`] divides what a joint can do, so that command and correction together never pass it.
//!
//! RT but for the constructors.

mod pitch_file;
mod pitch_table;
mod share;
#[cfg(test)]
mod tests;

pub use pitch_file::{PitchFileError, PitchFileKind};
pub use pitch_table::{PitchBounds, PitchError, PitchRow, PitchTable, RoundError};
pub use share::CompensationShare;

use super::monitor::Order;
use super::{MotionLimits, State, StopLimits, TrajectoryGenerator};

/// A turn shorter than this is rounding, no change of direction, mm.
const TURN_MM: f64 = 1e-6;

/// A cycle of the past.
#[derive(Clone, Copy, Debug, Default)]
struct Past {
    command_mm: f64,
    correction_mm: f64,
}

/// Compensation of one joint.
#[derive(Debug)]
pub struct JointCompensation {
    table: PitchTable,
    half_backlash_mm: f64,
    cycle_s: f64,
    velocity_mm_s: f64,
    /// `None` until the joint has moved: on which side it stands is not known then.
    forward: Option<bool>,
    /// The farthest position in that direction, mm.
    turning_mm: f64,
    /// Whether the motor follows commands.
    follows: bool,
    /// The last cycles, the newest first.
    past: [Past; 3],
    /// What is left of the correction before the last turn: on its way to 0.
    remainder: TrajectoryGenerator,
}

impl JointCompensation {
    /// Compensation by `table` and a backlash, which is taken up within `limits`; `cycle_s` above 0.
    pub fn new(table: PitchTable, backlash_mm: f64, limits: MotionLimits, cycle_s: f64) -> JointCompensation {
        let MotionLimits {
            velocity,
            acceleration,
            jerk,
        } = limits;
        JointCompensation {
            table,
            half_backlash_mm: backlash_mm / 2.0,
            cycle_s,
            velocity_mm_s: velocity,
            forward: None,
            turning_mm: 0.0,
            follows: false,
            past: [Past::default(); 3],
            remainder: TrajectoryGenerator::new(0.0, limits, StopLimits { acceleration, jerk }, cycle_s),
        }
    }

    /// What is added now, mm. RT.
    #[inline]
    pub fn correction_mm(&self) -> f64 {
        self.past[0].correction_mm
    }

    /// What is added in the end at a place that was come to in one direction, mm. RT.
    pub fn correction_at_mm(&self, position_mm: f64, forward: bool) -> f64 {
        let backlash_mm = if forward {
            self.half_backlash_mm
        } else {
            -self.half_backlash_mm
        };
        backlash_mm + self.table.correction_mm(position_mm, forward)
    }

    /// The motor does not follow commands: what is added stays, and the direction is not known any more. RT.
    pub fn hold(&mut self) {
        self.follows = false;
    }

    /// Forgets correction and direction: only while the motor does not follow commands. RT.
    pub fn restart(&mut self) {
        self.hold();
        self.past = [Past::default(); 3];
    }

    /// Position of the motor for the position of the joint, mm. NaN comes back and changes nothing. RT.
    #[inline]
    pub fn step(&mut self, command_mm: f64) -> f64 {
        if !command_mm.is_finite() {
            return command_mm;
        }
        if !self.follows {
            self.begin(command_mm);
        }
        if let Some(forward) = self.turned(command_mm) {
            self.take_up(forward);
        }
        let correction_mm = match self.forward {
            None => self.correction_mm(),
            Some(forward) => {
                if self.remainder.is_at_rest() && self.remainder.state().position != 0.0 {
                    self.remainder.go_to(0.0, self.velocity_mm_s);
                }
                self.correction_at_mm(command_mm, forward) + self.remainder.step().position
            }
        };
        let [newest, before, _] = self.past;
        let now = Past {
            command_mm,
            correction_mm,
        };
        self.past = [now, newest, before];
        command_mm + correction_mm
    }

    /// The motor follows from here, where it stands.
    fn begin(&mut self, command_mm: f64) {
        self.follows = true;
        self.forward = None;
        self.turning_mm = command_mm;
        let correction_mm = self.correction_mm();
        self.past = [Past {
            command_mm,
            correction_mm,
        }; 3];
    }

    /// The direction in which the joint moves, if it is another one than before.
    fn turned(&mut self, command_mm: f64) -> Option<bool> {
        let way_mm = command_mm - self.turning_mm;
        let forward = way_mm > 0.0;
        let onwards = self.forward == Some(forward) && way_mm != 0.0;
        let turns = !onwards && way_mm.abs() > TURN_MM;
        if onwards || turns {
            self.turning_mm = command_mm;
        }
        turns.then_some(forward)
    }

    /// From now on the correction of a direction counts. Of the past cycles it would have been another one than what was added:
    /// that difference goes on as it moved in them, and to rest at 0.
    fn take_up(&mut self, forward: bool) {
        self.forward = Some(forward);
        let [now, before, first] = self
            .past
            .map(|past| past.correction_mm - self.correction_at_mm(past.command_mm, forward));
        // The parabola through the three.
        let acceleration = (now - 2.0 * before + first) / (self.cycle_s * self.cycle_s);
        let velocity = (now - before) / self.cycle_s + acceleration * self.cycle_s / 2.0;
        self.remainder.go_on_from(State {
            position: now,
            velocity,
            acceleration,
        });
        self.remainder.go_to(0.0, self.velocity_mm_s);
    }
}
