//! One hole of a canned cycle: its steps as canonical calls.

use super::steps::{Level, PeckOut, Step};
use crate::state::{Calls, Overrides};
use motion::canon::{Axis, Call, OrientDirection, Position, SpindleDirection};

/// How often the tool may go into the work on one line. Far more than a hole or a row of holes can have; without a bound a
/// forgotten decimal point could fill the memory.
pub(in crate::execute) const PASSES_MAX: u32 = 20_000;

/// A hole and how it is made. Levels are numbers of the program, in its unit: the depths of pecks are sums of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hole {
    /// In its plane, and everything that stands still.
    pub(super) at: Position,
    /// Perpendicular to the plane.
    pub(super) normal: Axis,
    /// Millimetres in one unit of the program.
    pub(super) unit_mm: f64,
    pub(super) r: f64,
    pub(super) bottom: f64,
    pub(super) retract: f64,
    pub(super) counterbore: f64,
    /// Q
    pub(super) peck: f64,
    /// Of G73 and G83.
    pub(super) clearance: f64,
    /// P, s.
    pub(super) dwell_s: f64,
    /// I, J and K of G87 in the plane, mm.
    pub(super) aside_mm: [(Axis, f64); 2],
    pub(super) spindle: u8,
    /// How the spindle turned when the cycle began.
    pub(super) turning: Option<SpindleDirection>,
    pub(super) overrides: Overrides,
}

impl Hole {
    fn level(&self, level: Level) -> f64 {
        match level {
            Level::R => self.r,
            Level::Bottom => self.bottom,
            Level::Retract => self.retract,
            Level::Counterbore => self.counterbore,
        }
    }

    /// The point of the hole at a number of the program along the normal.
    fn point(&self, along: f64) -> Position {
        let mut point = self.at;
        point[self.normal] = along * self.unit_mm;
        point
    }

    pub(super) fn feed(&self, along: f64, calls: &mut Calls) {
        let to = self.point(along);
        calls.push_back(Call::StraightFeed { to });
    }

    pub(super) fn rapid(&self, along: f64, calls: &mut Calls) {
        let to = self.point(along);
        calls.push_back(Call::StraightTraverse { to });
    }

    pub(super) fn step(&self, step: Step, calls: &mut Calls) {
        let spindle = self.spindle;
        match step {
            Step::Feed(level) => self.feed(self.level(level), calls),
            Step::Rapid(level) => self.rapid(self.level(level), calls),
            Step::RapidAside(level) => {
                let mut to = self.point(self.level(level));
                for (axis, offset_mm) in self.aside_mm {
                    to[axis] += offset_mm;
                }
                calls.push_back(Call::StraightTraverse { to });
            }
            Step::Pecks(out) => self.pecks(out, calls),
            Step::Dwell => calls.push_back(Call::Dwell { seconds: self.dwell_s }),
            Step::LockOverrides => calls.extend([
                Call::EnableFeedOverride(false),
                Call::EnableSpeedOverride { spindle, on: false },
            ]),
            Step::ReleaseOverrides => {
                if self.overrides.feed {
                    calls.push_back(Call::EnableFeedOverride(true));
                }
                if self.overrides.speed[usize::from(spindle)] {
                    calls.push_back(Call::EnableSpeedOverride { spindle, on: true });
                }
            }
            Step::Stop => calls.push_back(Call::StopSpindle { spindle }),
            Step::Start => self.start_spindle(self.turning, true, calls),
            Step::Reverse => {
                calls.push_back(Call::StopSpindle { spindle });
                // A tap that waited at the bottom for the speed would go on cutting while the spindle comes to rest.
                self.start_spindle(self.turning.map(reversed), false, calls);
            }
            Step::ReverseBack => {
                calls.push_back(Call::StopSpindle { spindle });
                self.start_spindle(self.turning, true, calls);
            }
            Step::Orient => {
                calls.push_back(Call::StopSpindle { spindle });
                // LinuxCNC asks for the way against which the spindle turned (with M4 for one that M19 does not have).
                let direction = match self.turning {
                    Some(SpindleDirection::Clockwise) | None => OrientDirection::Counterclockwise,
                    Some(SpindleDirection::Counterclockwise) => OrientDirection::Clockwise,
                };
                calls.push_back(Call::OrientSpindle {
                    spindle,
                    degrees: 0.0,
                    direction,
                });
            }
            Step::ProgramStop => calls.push_back(Call::ProgramStop),
        }
    }

    fn start_spindle(&self, direction: Option<SpindleDirection>, wait_for_speed: bool, calls: &mut Calls) {
        // Cycles that start the spindle begin only if it turns.
        if let Some(direction) = direction {
            calls.push_back(Call::StartSpindle {
                spindle: self.spindle,
                direction,
                wait_for_speed,
            });
        }
    }

    fn pecks(&self, out: PeckOut, calls: &mut Calls) {
        // Subtracted one by one as LinuxCNC does it: the sum of rounding errors decides on the last peck.
        let mut depth = self.r - self.peck;
        for _ in 0..PASSES_MAX {
            if depth <= self.bottom {
                break;
            }
            self.feed(depth, calls);
            match out {
                PeckOut::ToR => self.rapid(self.r, calls),
                PeckOut::ByClearance => {}
            }
            // A peck below the clearance would come out above R, where a clamp may be.
            self.rapid((depth + self.clearance).min(self.r), calls);
            depth -= self.peck;
        }
        self.feed(self.bottom, calls);
    }

    /// How many times the tool goes in: the hole must be made of pecks.
    pub(super) fn peck_count(&self) -> f64 {
        ((self.r - self.bottom) / self.peck).max(1.0)
    }
}

fn reversed(direction: SpindleDirection) -> SpindleDirection {
    match direction {
        SpindleDirection::Clockwise => SpindleDirection::Counterclockwise,
        SpindleDirection::Counterclockwise => SpindleDirection::Clockwise,
    }
}
