//! What the ring carries: motion of constant jerk on exact geometry, waits, and things to do at rest.
//!
//! In:  from the planner. Out: to the interpolation.

use crate::canon::SpindleDirection;
use crate::path::Piece;
use crate::ring::Timed;
use std::fmt;

/// One element of the plan.
// Spans are the rule and everything else the exception, so that their size costs nothing.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
pub enum Element {
    /// Motion.
    Span(Span),
    /// Rest for a time.
    Dwell {
        /// Seconds.
        seconds: f64,
        /// Line of the program.
        line: u32,
    },
    /// Something to do at rest; the plan goes on once it is acknowledged.
    Action {
        /// What to do.
        action: Action,
        /// Line of the program.
        line: u32,
    },
}

impl Timed for Element {
    fn duration_s(&self) -> f64 {
        match self {
            Element::Span(span) => span.duration_s,
            Element::Dwell { seconds, .. } => *seconds,
            Element::Action { .. } => 0.0,
        }
    }
}

/// Motion of constant jerk along one piece of the path.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// The geometry.
    pub piece: Piece,
    /// Place on the piece where the span begins, mm (degrees on a purely rotary piece).
    pub s0: f64,
    /// Speed there, mm/s.
    pub v0: f64,
    /// Acceleration there, mm/s².
    pub a0: f64,
    /// Jerk all along, mm/s³.
    pub jerk: f64,
    /// Time from its beginning to its end, s.
    pub duration_s: f64,
    /// Line of the program.
    pub line: u32,
    /// Whether the move is a rapid one (G0).
    pub rapid: bool,
}

impl Span {
    /// Place on the piece after `t_s` seconds. RT.
    pub fn place(&self, t_s: f64) -> f64 {
        self.s0 + t_s * (self.v0 + t_s * (self.a0 / 2.0 + t_s * self.jerk / 6.0))
    }

    /// Speed after `t_s` seconds. RT.
    pub fn speed(&self, t_s: f64) -> f64 {
        self.v0 + t_s * (self.a0 + t_s * self.jerk / 2.0)
    }
}

/// Something to do at rest, between two moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// M3, M4, or S while the spindle turns.
    SpindleOn {
        /// Revolutions per minute, not negative.
        rpm: f64,
        /// Which way.
        direction: SpindleDirection,
    },
    /// M5.
    SpindleOff,
    /// M7 on, M9 off.
    Mist(bool),
    /// M8 on, M9 off.
    Flood(bool),
    /// T: the tool that the next change brings.
    SelectTool {
        /// Tool number.
        tool: u32,
    },
    /// M6.
    ChangeTool {
        /// Tool number.
        tool: u32,
    },
    /// M61: the spindle holds this tool; nothing changes it.
    SetTool {
        /// Tool number.
        tool: u32,
    },
    /// (MSG, ...): its number, counted from 0 in the order of the program.
    Message {
        /// Number.
        number: u32,
    },
    /// M0.
    ProgramStop,
    /// M1.
    OptionalStop,
    /// M2, M30.
    ProgramEnd,
}

impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let on = |on: bool| if on { "on" } else { "off" };
        match *self {
            Action::SpindleOn {
                rpm,
                direction: SpindleDirection::Clockwise,
            } => {
                write!(f, "spindle on clockwise, {rpm} 1/min")
            }
            Action::SpindleOn {
                rpm,
                direction: SpindleDirection::Counterclockwise,
            } => {
                write!(f, "spindle on counter-clockwise, {rpm} 1/min")
            }
            Action::SpindleOff => f.write_str("spindle off"),
            Action::Mist(mist) => write!(f, "mist {}", on(mist)),
            Action::Flood(flood) => write!(f, "flood {}", on(flood)),
            Action::SelectTool { tool } => write!(f, "tool {tool} selected"),
            Action::ChangeTool { tool } => write!(f, "change to tool {tool}"),
            Action::SetTool { tool } => write!(f, "tool {tool} in the spindle"),
            Action::Message { number } => write!(f, "message {number}"),
            Action::ProgramStop => f.write_str("stop (M0)"),
            Action::OptionalStop => f.write_str("optional stop (M1)"),
            Action::ProgramEnd => f.write_str("end"),
        }
    }
}
