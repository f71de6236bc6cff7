//! Probing: a straight move that ends where a contact changes (G38.2 to G38.5).
//!
//! In:  the line and the feed; in every cycle the contact, and where the axes were measured when it was read.
//! Out: one commanded position per cycle; at the end a [`Probed`]: how it ended, where the contact changed, where the axes
//!      came to rest.
//!
//! At the contact the place is latched in that very cycle and the move comes to rest on the line as quickly as the stop limits
//! allow: with `v` the speed, `A` and `J` the stop limits of the line, after `v²/(2 A) + v A/(2 J)` (`v sqrt(v/J)` where `A` is
//! not reached). A contact that is already there where it is to come, or away where it is to go, moves nothing.
//!
//! In a program, the interpolation runs them: [`Prober`].
//!
//! RT: nothing allocates but [`Probe::new`], [`Probe::idle`] and [`Prober::new`].

mod prober;

pub use prober::{Prober, StopShares};

use super::otg::TrajectoryGenerator;
use super::scale::{MotionLimits, StopLimits};
pub use crate::canon::ProbeEnd;
use crate::canon::{Position, ProbeMode};
use crate::path::Piece;

/// Result of a probing move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probed {
    /// How it ended.
    pub end: ProbeEnd,
    /// Measured place of the axes when the contact changed; where it did not, the commanded place of rest. Machine, mm or degrees.
    pub at: Position,
    /// Commanded place of rest.
    pub rest: Position,
}

/// What whoever reads the program waits for before it goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// A probing move is over.
    Probed(Probed),
    /// What M66 read, 1 or 0 of a digital input; `None`: its time ran out.
    Input(Option<f64>),
    /// The machine rests at a code of the user (M100 to M199), which may be run.
    Reached,
}

/// Limits of motion along a line, from those of the joints: `slopes` are joint units per unit of the line.
///
/// Exact where joints are a linear function of the axes. A line along which no joint moves has no limits.
pub fn limits_along(joints: impl Iterator<Item = (f64, MotionLimits, StopLimits)>) -> (MotionLimits, StopLimits) {
    const NONE: f64 = f64::INFINITY;
    let mut motion = MotionLimits {
        velocity: NONE,
        acceleration: NONE,
        jerk: NONE,
    };
    let mut stop = StopLimits {
        acceleration: NONE,
        jerk: NONE,
    };
    for (slope, of_joint, of_stop) in joints {
        let slope = slope.abs();
        if slope > 0.0 {
            motion.velocity = motion.velocity.min(of_joint.velocity / slope);
            motion.acceleration = motion.acceleration.min(of_joint.acceleration / slope);
            motion.jerk = motion.jerk.min(of_joint.jerk / slope);
            stop.acceleration = stop.acceleration.min(of_stop.acceleration / slope);
            stop.jerk = stop.jerk.min(of_stop.jerk / slope);
        }
    }
    (motion, stop)
}

/// How far the place that drives have latched may be from that of the cycle in which the contact was read: the way of so many cycles,
/// and what drives see of a rest differently, mm.
const LATCHED_WITHIN_CYCLES: f64 = 4.0;
const LATCHED_WITHIN_MM: f64 = 0.02;

/// The machine follows its commands late: so long a contact may still come at the end of the line, s.
const SETTLE_S: f64 = 0.05;

/// A probing move.
#[derive(Debug)]
pub struct Probe {
    /// `None`: there has been no move yet.
    line: Option<Piece>,
    mode: ProbeMode,
    feed: f64,
    otg: TrajectoryGenerator,
    /// How it ends, once that is certain.
    end: Option<ProbeEnd>,
    begun: bool,
    held: bool,
    latched: Option<Position>,
    /// The same, latched by the drives themselves.
    exact: Option<Position>,
    position: Position,
    /// At the end of the line so far, s.
    settled_s: f64,
    cycle_s: f64,
}

impl Probe {
    /// At rest at the start of `line`, which is probed at no more than `feed`, mm/s (degrees/s); limits along the line as from
    /// [`limits_along`].
    pub fn new(
        line: Piece,
        mode: ProbeMode,
        feed: f64,
        (motion, stop): (MotionLimits, StopLimits),
        cycle_s: f64,
    ) -> Probe {
        let mut probe = Probe::idle(cycle_s);
        probe.set_out(line, mode, feed, (motion, stop));
        probe
    }

    /// None under way.
    pub fn idle(cycle_s: f64) -> Probe {
        let motion = MotionLimits {
            velocity: 1.0,
            acceleration: 1.0,
            jerk: 1.0,
        };
        let stop = StopLimits {
            acceleration: 1.0,
            jerk: 1.0,
        };
        Probe {
            line: None,
            mode: ProbeMode {
                towards: true,
                must_trip: false,
            },
            feed: 0.0,
            otg: TrajectoryGenerator::new(0.0, motion, stop, cycle_s),
            end: None,
            begun: false,
            held: false,
            latched: None,
            exact: None,
            position: Position::ZERO,
            settled_s: 0.0,
            cycle_s,
        }
    }

    /// Another move, from rest at the start of `line`; see [`Probe::new`]. RT.
    pub fn set_out(&mut self, line: Piece, mode: ProbeMode, feed: f64, (motion, stop): (MotionLimits, StopLimits)) {
        self.otg.restart(0.0, motion, stop);
        self.otg.set_range([0.0, line.length()]);
        self.line = Some(line);
        self.mode = mode;
        self.feed = feed;
        self.end = None;
        self.begun = false;
        self.held = false;
        self.latched = None;
        self.exact = None;
        self.position = line.position(0.0);
        self.settled_s = 0.0;
    }

    /// One cycle further: the commanded position. `contact`: closed or not, as read in this cycle; `measured`: where the axes
    /// were then. RT.
    pub fn step(&mut self, contact: bool, measured: &Position) -> Position {
        let Some(line) = &self.line else { return self.position };
        let length = line.length();
        if self.end.is_none() {
            let as_wanted = contact == self.mode.towards;
            if as_wanted && self.begun {
                self.end = Some(ProbeEnd::Tripped);
                self.latched = Some(*measured);
                self.otg.stop();
            } else if !self.begun && !self.held {
                if as_wanted {
                    self.end = Some(ProbeEnd::Already);
                } else {
                    self.begun = true;
                    self.otg.go_to(length, self.feed);
                }
            }
        }
        let place = self.otg.step().position;
        self.position = line.position(place);
        if self.end.is_none() && self.otg.is_at_rest() && place >= length {
            self.settled_s += self.cycle_s;
            if self.settled_s >= SETTLE_S {
                self.end = Some(ProbeEnd::Missed);
            }
        }
        self.position
    }

    /// The drives have latched where the contact changed, before or behind the cycle in which it was read. Only the first one of
    /// a move counts. RT.
    pub fn refine(&mut self, exact: &Position) {
        if self.begun && self.exact.is_none() {
            self.exact = Some(*exact);
        }
    }

    /// The operator's hold: rest on the line, from which [`Probe::resume`] goes on. The contact is watched all the while. RT.
    pub fn hold(&mut self) {
        if !self.held {
            self.held = true;
            self.otg.run_at(0.0);
        }
    }

    /// Goes on after a hold. RT.
    pub fn resume(&mut self) {
        if !std::mem::take(&mut self.held) {
            return;
        }
        if let Some(line) = &self.line
            && self.end.is_none()
            && self.begun
        {
            self.otg.go_to(line.length(), self.feed);
        }
    }

    /// Ends the move where it can come to rest. RT.
    pub fn abort(&mut self) {
        if self.end.is_none() {
            self.end = Some(ProbeEnd::Aborted);
        }
        self.otg.stop();
    }

    /// For how long it goes on by its law if no contact comes, s. RT.
    fn even_s(&self) -> f64 {
        if self.begun && !self.held && self.end.is_none() {
            self.otg.even_s()
        } else {
            0.0
        }
    }

    /// Whether nothing moves. RT.
    pub fn is_at_rest(&self) -> bool {
        self.otg.is_at_rest()
    }

    /// Whether the last cycle was part of a stop, for which the stop limits count. RT.
    pub fn is_stopping(&self) -> bool {
        self.otg.is_stopping()
    }

    /// Speed along the line, mm/s (degrees/s). RT.
    pub fn speed(&self) -> f64 {
        self.otg.state().velocity.abs()
    }

    /// The result, once everything is at rest. RT.
    pub fn result(&self) -> Option<Probed> {
        if !self.otg.is_at_rest() {
            return None;
        }
        let rest = self.position;
        // What was latched by another contact, before this one or by a shock on the way, is elsewhere.
        let near = |exact: &Position, latched: &Position| {
            let most = LATCHED_WITHIN_CYCLES * self.feed * self.cycle_s + LATCHED_WITHIN_MM;
            exact
                .0
                .iter()
                .zip(latched.0)
                .all(|(exact, latched)| (exact - latched).abs() <= most)
        };
        let exact = self
            .exact
            .filter(|_| self.end == Some(ProbeEnd::Tripped))
            .filter(|exact| self.latched.is_some_and(|latched| near(exact, &latched)));
        self.end.map(|end| Probed {
            end,
            at: exact.or(self.latched).unwrap_or(rest),
            rest,
        })
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_programs;
