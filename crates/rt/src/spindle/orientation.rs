//! M19: the spindle is turned to an angle, by a component or by its drive.
//!
//! In:  M19 of the program; the pins of what turns it. Out: pins; whether it is there, or why not.
//!
//! RT: nothing allocates but [`Orientation::new`].

use hal_pins::{Hal, HalError, Input, Output};
use machine::faults::OrientFailure;
use motion::canon::OrientDirection;

/// What M19 has come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Orienting {
    /// No M19 holds the spindle.
    Not,
    /// On its way to the angle.
    UnderWay,
    /// There, and held.
    Done,
}

/// M19: what turns the spindle to an angle is a component or the spindle's drive.
pub(super) struct Orientation {
    orient: Output<bool>,
    angle: Output<f64>,
    mode: Output<i32>,
    is_oriented: Input<bool>,
    fault: Input<i32>,
    locked: Output<bool>,
    brake: Output<bool>,
    state: Orienting,
    timeout_s: f64,
    waited_s: f64,
}

impl Orientation {
    pub(super) fn new(hal: &mut Hal) -> Result<Orientation, HalError> {
        Ok(Orientation {
            orient: hal.output("spindle.0.orient")?,
            angle: hal.output("spindle.0.orient-angle")?,
            mode: hal.output("spindle.0.orient-mode")?,
            is_oriented: hal.input("spindle.0.is-oriented", false)?,
            fault: hal.input("spindle.0.orient-fault", 0)?,
            locked: hal.output("spindle.0.locked")?,
            brake: hal.output("spindle.0.brake")?,
            state: Orienting::Not,
            timeout_s: f64::INFINITY,
            waited_s: 0.0,
        })
    }

    pub(super) fn begin(&mut self, degrees: f64, direction: OrientDirection) {
        self.angle.set(degrees);
        self.mode.set(match direction {
            OrientDirection::Shortest => 0,
            OrientDirection::Clockwise => 1,
            OrientDirection::Counterclockwise => 2,
        });
        (self.timeout_s, self.waited_s) = (f64::INFINITY, 0.0);
        self.set(Orienting::UnderWay);
    }

    pub(super) fn end(&mut self) {
        self.set(Orienting::Not);
    }

    fn set(&mut self, state: Orienting) {
        self.state = state;
        self.orient.set(state == Orienting::UnderWay);
        self.locked.set(state == Orienting::Done);
        self.brake.set(state == Orienting::Done);
    }

    /// M19 Q: from here on the time counts. RT.
    pub(super) fn begin_wait(&mut self, timeout_s: f64) {
        (self.timeout_s, self.waited_s) = (timeout_s, 0.0);
    }

    /// Whether the spindle is there; once in every cycle of a wait. RT.
    pub(super) fn is_over(&mut self, cycle_s: f64) -> bool {
        self.waited_s += cycle_s;
        self.state != Orienting::UnderWay
    }

    /// Once in every cycle. RT.
    pub(super) fn look(&mut self) {
        if self.state == Orienting::UnderWay && self.is_oriented.get() && self.fault.get() == 0 {
            self.set(Orienting::Done);
        }
    }

    pub(super) fn failure(&self) -> Option<OrientFailure> {
        if self.state != Orienting::UnderWay {
            return None;
        }
        match self.fault.get() {
            0 => (self.waited_s > self.timeout_s).then_some(OrientFailure::Late {
                degrees: self.angle.get(),
                timeout_s: self.timeout_s,
            }),
            code => Some(OrientFailure::Fault { code }),
        }
    }
}
