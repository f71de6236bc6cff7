//! What each canned cycle does in its hole, as a table: [`steps`].

use crate::code::Cycle;
use motion::canon::SpindleDirection;

/// A height above the plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Level {
    /// R: where feeding begins.
    R,
    /// The depth word.
    Bottom,
    /// Where the cycle ends: R with G99, with G98 where the run of cycles began if that is higher.
    Retract,
    /// G87: where the counterbore ends.
    Counterbore,
}

/// How far the tool comes out between two pecks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PeckOut {
    /// G83: to R, so that chips come out; then back to the clearance above the last depth.
    ToR,
    /// G73: by the clearance, so that chips break.
    ByClearance,
}

/// A part of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Feeds along the normal.
    Feed(Level),
    /// Rapid along the normal; from beside the hole back above it.
    Rapid(Level),
    /// Rapid to the place beside the hole that I, J and K tell.
    RapidAside(Level),
    /// Feeds from R to the bottom in pecks.
    Pecks(PeckOut),
    /// Waits P seconds.
    Dwell,
    /// The operator's overrides do not act from here on.
    LockOverrides,
    /// They act again, as far as they did before.
    ReleaseOverrides,
    /// The spindle turns against the direction in which the cycle found it.
    Reverse,
    /// And again in that direction.
    ReverseBack,
    Stop,
    Start,
    /// Stops at the angle 0.
    Orient,
    /// The operator takes the tool out.
    ProgramStop,
}

/// What the spindle must do when a hole is begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SpindleRule {
    Any,
    Turning,
    TurningIn(SpindleDirection),
}

pub(super) const fn spindle_rule(cycle: Cycle) -> SpindleRule {
    match cycle {
        Cycle::RightTapping => SpindleRule::TurningIn(SpindleDirection::Clockwise),
        Cycle::LeftTapping => SpindleRule::TurningIn(SpindleDirection::Counterclockwise),
        Cycle::StopBoring | Cycle::BackBoring | Cycle::ManualBoring => SpindleRule::Turning,
        Cycle::Drilling
        | Cycle::DwellDrilling
        | Cycle::ChipBreaking
        | Cycle::PeckDrilling
        | Cycle::Boring
        | Cycle::DwellBoring => SpindleRule::Any,
    }
}

/// What a cycle does behind the start that all have in common, which leaves the tool above the hole at R.
#[rustfmt::skip] // a table: a cycle a line
pub(super) const fn steps(cycle: Cycle) -> &'static [Step] {
    use Level::{Bottom, Counterbore, R, Retract};
    use Step::{
        Dwell, Feed, LockOverrides, Orient, Pecks, ProgramStop, Rapid, RapidAside, ReleaseOverrides, Reverse,
        ReverseBack, Start, Stop,
    };
    const TAPPING: &[Step] = &[
        LockOverrides, Feed(Bottom), Reverse, Dwell, Feed(Retract), ReverseBack, ReleaseOverrides,
    ];
    match cycle {
        /* G73 */ Cycle::ChipBreaking => &[Pecks(PeckOut::ByClearance), Rapid(Retract)],
        /* G74 */ Cycle::LeftTapping => TAPPING,
        /* G81 */ Cycle::Drilling => &[Feed(Bottom), Rapid(Retract)],
        /* G82 */ Cycle::DwellDrilling => &[Feed(Bottom), Dwell, Rapid(Retract)],
        /* G83 */ Cycle::PeckDrilling => &[Pecks(PeckOut::ToR), Rapid(Retract)],
        /* G84 */ Cycle::RightTapping => TAPPING,
        /* G85 */ Cycle::Boring => &[Feed(Bottom), Feed(R), Rapid(Retract)],
        /* G86 */ Cycle::StopBoring => &[Feed(Bottom), Dwell, Stop, Rapid(Retract), Start],
        /* G87 */ Cycle::BackBoring => &[
            RapidAside(R), Orient, RapidAside(Bottom), Rapid(Bottom), Start, Feed(Counterbore), Feed(Bottom),
            Orient, RapidAside(Bottom), RapidAside(Retract), Rapid(Retract), Start,
        ],
        /* G88 */ Cycle::ManualBoring => &[Feed(Bottom), Dwell, Stop, ProgramStop, Start],
        /* G89 */ Cycle::DwellBoring => &[Feed(Bottom), Dwell, Feed(Retract)],
    }
}
