//! Canonical moves to a plan in time, jerk limited per axis.
//!
//! In:  canonical calls, in program order ([`Planner::push`]).
//! Out: elements to a [`Sink`](crate::ring::Sink) ([`Planner::pump`]): what is final, and a planned stop behind it.
//!
//! The way of a move, one module each:
//!
//! ```text
//! program   calls -> pieces in machine coordinates, with feed and line           (frame: offsets; travel)
//!                                                                                (curve: NURBS to quintics)
//! smooth    rounds corners within the tolerance, stops where that cannot be
//! junctions slows down where pieces that are not rounded meet with a small jump
//! optimal   speeds near the shortest time, by an interior point method; or
//! classic   joins pieces into runs, plans speeds backward and forward, slopes    (limits, profile)
//! gate      every seam of what they hand over
//! planner   all of them, one after the other; or the path and its speeds apart, in two threads
//! ```
//!
//! Not real time; allocates.

// Wherever motion and rest share an enum, motion is the large variant and nearly all there is.
#![allow(clippy::large_enum_variant)]

pub mod check;
pub mod classic;
mod curve;
pub mod deviation;
mod frame;
mod gate;
pub mod joint_space;
mod junctions;
mod limits;
pub mod offline;
pub mod optimal;
mod planner;
mod probing;
mod profile;
mod program;
mod roots;
mod smooth;
pub mod timeline;
mod travel;
pub mod workers;

use std::fmt;

use crate::canon::{AXES, Axis, Position, Source};
use crate::kinematics::Unreachable;
use crate::path::Piece;

pub use deviation::{Deviation, deviation};
pub use gate::{LimitJudge, Over};
pub use joint_space::JointSpace;
pub use offline::{Offline, plan_offline};
pub use planner::{FEED_OVERRIDE_MAX, PathPlanner, Planner, Pumped, Smoothed, SpeedPlanner};
pub use travel::TRAVEL_TOLERANCE;

#[cfg(test)]
mod tests;

/// What one axis can do; speed, acceleration and jerk are greater than 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// Greatest speed, mm/s or degrees/s.
    pub velocity: f64,
    /// Greatest acceleration, per s².
    pub acceleration: f64,
    /// Greatest jerk, per s³.
    pub jerk: f64,
    /// Least and greatest machine position, mm or degrees.
    pub travel: [f64; 2],
}

/// How speed is chosen along the path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlannerKind {
    /// Nearly the shortest time that the limits of every joint allow.
    #[default]
    Optimal,
    /// Corner speeds, backward and forward pass, seven-phase slope: less to compute, more time on the way.
    Classic,
}

/// What a planner must know of the machine.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Limits by axis; `None`: the machine has no such axis, and moving it is an error. Where `joints` holds, they are guides
    /// for smoothing, and their travel counts only while each joint follows its axis.
    pub axes: [Option<AxisLimits>; AXES],
    /// Joints of a machine whose kinematics are not trivial. `None`: each axis moves as its joints do.
    pub joints: Option<JointSpace>,
    /// Time between set-points, s.
    pub cycle_s: f64,
    /// Greatest deviation from the path where G64 names none, mm.
    pub tolerance_mm: f64,
    /// The same at the corners between two rapid moves where corners may be rounded, mm. `None`: as at all others.
    pub rapid_tolerance_mm: Option<f64>,
    /// Pieces of path that are looked ahead where speeds depend on so many. More where three braking lengths are longer; the
    /// optimal planner always looks as far as that.
    pub look_ahead_blocks: usize,
    /// With [`PlannerKind::Classic`], pieces of path over which one thread looks ahead at a time, at least 1.
    pub look_ahead_buffer_blocks: usize,
    /// With [`PlannerKind::Classic`], pieces of path behind such a buffer and before it from which its speeds are computed.
    pub look_ahead_overlap_blocks: usize,
    /// Whether an encoder with an index tells where the spindle is: without it, a program with moves in step with the spindle
    /// (G33, G33.1, G76) is refused.
    pub spindle_encoder: bool,
    /// Whether the first feed move behind a change of the spindle's speed waits until the speed is reached, at rest.
    pub await_spindle: bool,
    /// Highest speed of the spindle, 1/min.
    pub spindle_rpm_max: f64,
    /// Machine position from which the program starts.
    pub start: Position,
    /// How speed is chosen along the path.
    pub planner_kind: PlannerKind,
}

impl Settings {
    /// Those of a machine whose joints are its axes, without an encoder on the spindle (0 to 6000/min): from the origin, 0.01 mm
    /// where G64 names no tolerance, 10,000 blocks of look-ahead.
    pub fn new(axes: [Option<AxisLimits>; AXES], cycle_s: f64) -> Settings {
        Settings {
            axes,
            joints: None,
            cycle_s,
            tolerance_mm: 0.01,
            rapid_tolerance_mm: None,
            look_ahead_blocks: 10_000,
            look_ahead_buffer_blocks: 300,
            look_ahead_overlap_blocks: 50,
            spindle_encoder: false,
            await_spindle: false,
            spindle_rpm_max: 6000.0,
            start: Position::ZERO,
            planner_kind: PlannerKind::default(),
        }
    }
}

/// A programmed move before anything is rounded.
#[derive(Clone, Copy, Debug)]
pub struct Programmed {
    /// Geometry in machine coordinates.
    pub piece: Piece,
    /// Programmed feed, mm/s (degrees/s when only rotary axes move); infinite for rapid moves.
    pub feed: f64,
    /// Line of the program.
    pub line: u32,
    /// Whether it is a rapid move.
    pub rapid: bool,
}

/// Why a call cannot be planned.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanError {
    /// Where in the program.
    pub source: Source,
    /// What is wrong with it.
    pub kind: PlanErrorKind,
}

/// Kind of a [`PlanError`].
#[derive(Clone, Debug, PartialEq)]
pub enum PlanErrorKind {
    /// A move leaves the travel of an axis.
    Travel {
        /// Which.
        axis: Axis,
        /// Where the move would lead, machine coordinates.
        value: f64,
        /// The limit it would pass.
        limit: f64,
    },
    /// A move of an axis that the machine does not have.
    NoSuchAxis {
        /// Which.
        axis: Axis,
    },
    /// A move takes a joint beyond its travel.
    JointTravel {
        /// Which, counted from 0.
        joint: usize,
        /// Whether its positions are degrees.
        rotary: bool,
        /// Where the move would lead it.
        value: f64,
        /// The limit it would pass.
        limit: f64,
        /// Where on the move, machine coordinates of the axes.
        place: Box<Position>,
    },
    /// A move leads to a place that the machine cannot take.
    Unreachable {
        /// Which joint cannot follow, and why.
        unreachable: Unreachable,
        /// Where on the move, machine coordinates of the axes.
        place: Box<Position>,
    },
    /// Tool-centre-point control on a machine without it.
    NoToolCentrePoint,
    /// A feed move without a feed rate.
    NoFeedRate,
    /// A curve (NURBS) of an order that is not planned, with too few control points, or with a weight that is not above 0.
    BadCurve {
        /// Its order: degree plus one.
        order: u32,
        /// How many control points it has.
        points: usize,
    },
    /// A curve that begins elsewhere than the move before it has ended.
    CurveStart {
        /// Its beginning, machine coordinates.
        place: Box<Position>,
    },
    /// A curve of which too many pieces would be needed.
    WildCurve,
    /// An arc whose radius is zero at one end, or that makes no turn.
    BadArc,
    /// A move in step with the spindle on a machine that does not know where its spindle is.
    NoSpindleEncoder,
    /// There is no output of this number; or its value is no number.
    NoSuchOutput {
        /// Number of the output.
        index: u8,
    },
    /// A move that goes by turns of a spindle that does not turn.
    SpindleStands,
    /// A move in step with the spindle that is too fast for the axes.
    SpindleTooFast {
        /// Pitch times the programmed speed, mm/s.
        speed: f64,
        /// Greatest speed of the axes along the move, mm/s.
        limit: f64,
    },
    /// A move that would take more than a year.
    TooSlow {
        /// Its time at its feed.
        seconds: f64,
    },
    /// A number that is infinite or none at all.
    NotFinite,
    /// A joint would jump there, or pass a limit, however it is planned: a defect of the planner.
    OverLimits,
    /// A call that this planner cannot carry out.
    Unsupported(&'static str),
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.source.line, self.kind)
    }
}

impl fmt::Display for PlanErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PlanErrorKind::Travel { axis, value, limit } => {
                let unit = if axis.is_rotary() { "degrees" } else { "mm" };
                write!(
                    f,
                    "{} would reach {value:.4} {unit} in machine coordinates, beyond its travel limit {limit:.4}",
                    axis.letter()
                )
            }
            PlanErrorKind::NoSuchAxis { axis } => write!(f, "this machine has no axis {}", axis.letter()),
            PlanErrorKind::JointTravel {
                joint,
                rotary,
                value,
                limit,
                place,
            } => {
                let unit = if *rotary { "degrees" } else { "mm" };
                write!(
                    f,
                    "joint {joint} would reach {value:.4} {unit}, beyond its travel limit {limit:.4}, at {} (machine coordinates)",
                    joint_space::place(place)
                )
            }
            PlanErrorKind::Unreachable { unreachable, place } => {
                f.write_str(&joint_space::unreachable(unreachable, place))
            }
            PlanErrorKind::NoToolCentrePoint => f.write_str(
                "tool-centre-point control (G43.4) needs kinematics \"table-table\" or \"head-table\"; expected G43",
            ),
            PlanErrorKind::NoFeedRate => f.write_str("feed move without a feed rate; expected F before it"),
            PlanErrorKind::BadArc => f.write_str("arc of zero radius; expected start and end away from its centre"),
            PlanErrorKind::BadCurve { order, points } => write!(
                f,
                "curve of order {order} with {points} control points; expected an order (L) from 2 to {}, at least as many control \
                 points, and weights (P) above 0",
                curve::ORDER_MAX
            ),
            PlanErrorKind::CurveStart { place } => write!(
                f,
                "a curve begins at {} (machine coordinates); expected it where the move before ends",
                joint_space::place(place)
            ),
            PlanErrorKind::WildCurve => f.write_str(
                "the curve would take too many pieces; expected control points less far off and weights (P) less unlike",
            ),
            PlanErrorKind::NoSuchOutput { index } => write!(f, "output {index} cannot be set"),
            PlanErrorKind::NoSpindleEncoder => f.write_str(
                "a move in step with the spindle (G33, G33.1, G76) needs an encoder with an index on it, which this machine has not; \
                 expected a program without it",
            ),
            PlanErrorKind::SpindleStands => f.write_str(
                "a move by turns of the spindle (G33, G33.1, G76, G95) while the spindle is to stand; expected S above 0 and M3 or \
                 M4 before it",
            ),
            PlanErrorKind::SpindleTooFast { speed, limit } => write!(
                f,
                "pitch and spindle speed come to {speed:.3} mm/s, more than the axes reach ({limit:.3} mm/s); expected a lower S"
            ),
            PlanErrorKind::TooSlow { seconds } => write!(
                f,
                "the move would take {:.0} days at its feed; expected no more than a year: is F right, in the unit of G93, G94 or G95, and \
                 S, K or P where the spindle leads?",
                seconds / 86_400.0
            ),
            PlanErrorKind::NotFinite => f.write_str("position is not a finite number"),
            PlanErrorKind::OverLimits => f.write_str(
                "over limits, not run: a joint would jump here or pass its limits, which is a defect of the planner; expected another \
                 way to write this move, or program.planner = \"classic\"",
            ),
            PlanErrorKind::Unsupported(what) => {
                write!(f, "the control cannot run {what} yet; expected a program without it")
            }
        }
    }
}

impl std::error::Error for PlanError {}
