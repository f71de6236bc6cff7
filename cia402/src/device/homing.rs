//! Homing methods (6098) of the drive.
//!
//! In:  limit switches, home switch and zero mark; speeds. Out: the speed of the next period, until the home point is
//! latched.
//!
//! The methods on switches are four ways to cross an edge, each also mirrored. `d` is the direction of the first search:
//!
//! | kind | 3..14 | crosses the edge | first |
//! |---|---|---|---|
//! | `LeaveBack` | 3 7, 5 11 | moving -d, active to inactive | be on the switch |
//! | `EnterNear` | 4 8, 6 12 | moving +d, inactive to active | then leave it moving -d |
//! | `EnterFar` | 9, 13 | moving -d, inactive to active | then leave it moving +d |
//! | `LeaveForward` | 10, 14 | moving +d, active to inactive | be on the switch |
//!
//! Methods 1 and 2 are `LeaveBack` on a limit switch; 17 to 30 are 1 to 14 without the zero mark.

/// A switch or mark on the way of the motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Switch {
    /// Level now; true is active.
    pub active: bool,
    /// Where it changed during the last period, motor counts.
    pub edge: Option<i64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Which {
    NegativeLimit,
    PositiveLimit,
    Home,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    LeaveBack,
    EnterNear,
    EnterFar,
    LeaveForward,
}

/// A homing method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// At an edge of a switch, or at the first zero mark behind it.
    Edge {
        which: Which,
        kind: Kind,
        direction: i8,
        index: bool,
    },
    /// At the next zero mark.
    Index { direction: i8 },
    /// Where the motor is.
    Here,
}

impl Method {
    /// The method of a number; `None` for reserved numbers and for those that this drive does not have.
    pub(super) fn from_number(number: i8) -> Option<Method> {
        let edge = |number, index| {
            let (which, kind, direction) = match number {
                1 => (Which::NegativeLimit, Kind::LeaveBack, -1),
                2 => (Which::PositiveLimit, Kind::LeaveBack, 1),
                3 | 7 => (Which::Home, Kind::LeaveBack, 1),
                4 | 8 => (Which::Home, Kind::EnterNear, 1),
                5 | 11 => (Which::Home, Kind::LeaveBack, -1),
                6 | 12 => (Which::Home, Kind::EnterNear, -1),
                9 => (Which::Home, Kind::EnterFar, 1),
                10 => (Which::Home, Kind::LeaveForward, 1),
                13 => (Which::Home, Kind::EnterFar, -1),
                14 => (Which::Home, Kind::LeaveForward, -1),
                _ => return None,
            };
            Some(Method::Edge {
                which,
                kind,
                direction,
                index,
            })
        };
        match number {
            1..=14 => edge(number, true),
            17..=30 => edge(number - 16, false),
            33 => Some(Method::Index { direction: -1 }),
            34 => Some(Method::Index { direction: 1 }),
            35 | 37 => Some(Method::Here),
            _ => None,
        }
    }
}

/// What the drive sees of the machine at the end of a period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sensors {
    /// Position since power-on, motor counts; never jumps.
    pub position: i64,
    /// Velocity, counts/s.
    pub velocity: i64,
    /// Torque, 1/1000 of the rated one.
    pub torque: i16,
    /// Limit switch on the negative side.
    pub negative_limit: Switch,
    /// Limit switch on the positive side.
    pub positive_limit: Switch,
    /// Home switch, shown in 60FD.
    pub home: Switch,
    /// Touch probes 1 and 2.
    pub probes: [Switch; 2],
    /// Where the motor passed its zero mark during the last period, motor counts.
    pub index: Option<i64>,
}

impl Sensors {
    fn switch(&self, which: Which) -> Switch {
        match which {
            Which::NegativeLimit => self.negative_limit,
            Which::PositiveLimit => self.positive_limit,
            Which::Home => self.home,
        }
    }

    /// Whether a limit switch forbids this direction.
    pub(super) fn blocked(&self, direction: f64) -> bool {
        (direction < 0.0 && self.negative_limit.active) || (direction > 0.0 && self.positive_limit.active)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Quickly, until the switch is active.
    Seek { turned: bool },
    /// Slowly back onto a switch that was run over.
    Regain,
    /// Off the switch, to the side from which the edge is crossed.
    Depart,
    /// Slowly across the edge.
    Cross,
    /// On to the next zero mark.
    Mark,
}

/// What homing wants of the next period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Progress {
    /// Move at this speed, counts/s.
    Move(f64),
    /// The home point, motor counts.
    Home(i64),
    /// It cannot be found.
    Failed,
}

/// Homing under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Homing {
    method: Method,
    stage: Stage,
    /// Direction of the stage.
    direction: f64,
    /// Come to rest before the stage begins.
    settling: bool,
}

impl Homing {
    pub(super) fn new(method: Method, sensors: &Sensors) -> Homing {
        let (stage, direction) = match method {
            Method::Edge {
                which, kind, direction, ..
            } if sensors.switch(which).active => on_switch(kind, f64::from(direction)),
            Method::Edge { direction, .. } => (Stage::Seek { turned: false }, f64::from(direction)),
            Method::Index { direction } => (Stage::Mark, f64::from(direction)),
            Method::Here => (Stage::Mark, 0.0),
        };
        Homing {
            method,
            stage,
            direction,
            settling: false,
        }
    }

    /// One period. `search` and `latch` are speeds in counts/s; `at_rest` says that the demand stands still.
    pub(super) fn step(&mut self, sensors: &Sensors, search: f64, latch: f64, at_rest: bool) -> Progress {
        let (which, kind, index) = match self.method {
            Method::Here => return Progress::Home(sensors.position),
            Method::Index { .. } => {
                return match sensors.index {
                    Some(mark) => Progress::Home(mark),
                    None if sensors.blocked(self.direction) => Progress::Failed,
                    None => Progress::Move(self.direction * latch),
                };
            }
            Method::Edge { which, kind, index, .. } => (which, kind, index),
        };
        if self.settling && !at_rest {
            return Progress::Move(0.0);
        }
        self.settling = false;
        let switch = sensors.switch(which);
        match self.stage {
            Stage::Seek { .. } if switch.active => self.next(Stage::Regain, -self.direction),
            Stage::Seek { turned } if sensors.blocked(self.direction) => {
                if turned || which != Which::Home {
                    return Progress::Failed;
                }
                self.next(Stage::Seek { turned: true }, -self.direction)
            }
            Stage::Regain if switch.active => {
                let (stage, direction) = on_switch(kind, self.first_direction());
                self.next(stage, direction)
            }
            Stage::Depart if !switch.active => self.next(Stage::Cross, -self.direction),
            Stage::Cross if switch.edge.is_some() && switch.active == enters(kind) => {
                if !index {
                    return Progress::Home(switch.edge.unwrap_or(sensors.position));
                }
                self.stage = Stage::Mark;
                Progress::Move(self.direction * latch)
            }
            Stage::Mark if sensors.index.is_some() => Progress::Home(sensors.index.unwrap_or(sensors.position)),
            Stage::Regain | Stage::Depart | Stage::Cross | Stage::Mark if sensors.blocked(self.direction) => {
                Progress::Failed
            }
            Stage::Seek { .. } | Stage::Depart => Progress::Move(self.direction * search),
            Stage::Regain | Stage::Cross | Stage::Mark => Progress::Move(self.direction * latch),
        }
    }

    fn next(&mut self, stage: Stage, direction: f64) -> Progress {
        self.stage = stage;
        self.direction = direction;
        self.settling = true;
        Progress::Move(0.0)
    }

    fn first_direction(&self) -> f64 {
        match self.method {
            Method::Edge { direction, .. } | Method::Index { direction } => f64::from(direction),
            Method::Here => 0.0,
        }
    }
}

/// Whether the edge is crossed from inactive to active.
fn enters(kind: Kind) -> bool {
    match kind {
        Kind::EnterNear | Kind::EnterFar => true,
        Kind::LeaveBack | Kind::LeaveForward => false,
    }
}

/// What follows once the motor stands on the switch: stage and its direction.
fn on_switch(kind: Kind, first: f64) -> (Stage, f64) {
    match kind {
        Kind::LeaveBack => (Stage::Cross, -first),
        Kind::LeaveForward => (Stage::Cross, first),
        Kind::EnterNear => (Stage::Depart, -first),
        Kind::EnterFar => (Stage::Depart, first),
    }
}
