//! What the stage does with each canonical call.
//!
//! In:  a call.
//! Out: its class while compensation is on.

use motion::canon::Call;

/// Kinds of calls as compensation sees them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// A move to compensate.
    Move,
    /// Happens where it stands between the moves: held behind the move that is held.
    InOrder,
    /// Tells or prepares something that no move depends on: goes out at once.
    AtOnce,
    /// Chooses the plane.
    Plane,
    /// Switches compensation.
    Switch,
    /// Not possible while compensation is on.
    Refused(&'static str),
}

impl Class {
    pub(super) fn new(call: &Call) -> Class {
        match call {
            Call::StraightTraverse { .. } | Call::StraightFeed { .. } | Call::ArcFeed { .. } => Class::Move,
            Call::StraightProbe { .. } => Class::Refused("probing (G38.2 to G38.5)"),
            Call::RigidTap { .. } => Class::Refused("rigid tapping (G33.1)"),
            Call::NurbsFeed { .. } => Class::Refused("a curve (G5 to G5.3)"),
            Call::StartSpindleSync { velocity: false, .. } => Class::Refused("threading (G33, G76)"),
            Call::SetG5xOffset { .. } | Call::SetXyRotation { .. } => {
                Class::Refused("a change of the work coordinate system")
            }
            Call::SetG92Offset { .. } => Class::Refused("an offset by G92 or G52"),
            Call::SetToolLengthOffset { .. } => Class::Refused("a change of the tool length offset (G43, G49)"),
            Call::SetToolCentrePoint(_) => Class::Refused("a switch of tool-centre-point control (G43.4, G49)"),
            Call::ChangeTool { .. } | Call::StartChange => Class::Refused("a tool change (M6)"),
            Call::SelectPlane(_) => Class::Plane,
            Call::SetCutterCompensation(_) => Class::Switch,
            Call::UseLengthUnit(_)
            | Call::SelectTool { .. }
            | Call::SetToolEntry(_)
            | Call::ReloadToolTable
            | Call::SetPlanner { .. }
            | Call::Message(_) => Class::AtOnce,
            Call::Dwell { .. }
            | Call::Record(_)
            | Call::StartSpindleSync { velocity: true, .. }
            | Call::StopSpindleSync
            | Call::SetFeedMode(_)
            | Call::SetFeedRate { .. }
            | Call::SetPathMode(_)
            | Call::SetSpindleMode { .. }
            | Call::SetSpindleSpeed { .. }
            | Call::StartSpindle { .. }
            | Call::StopSpindle { .. }
            | Call::OrientSpindle { .. }
            | Call::WaitSpindleOriented { .. }
            | Call::Mist(_)
            | Call::Flood(_)
            | Call::SetToolNumber { .. }
            | Call::EnableFeedOverride(_)
            | Call::EnableSpeedOverride { .. }
            | Call::EnableAdaptiveFeed(_)
            | Call::EnableFeedHold(_)
            | Call::SetDigitalOutput { .. }
            | Call::SetAnalogOutput { .. }
            | Call::WaitInput { .. }
            | Call::UserCode { .. }
            | Call::Probe(_)
            | Call::Comment(_)
            | Call::ProgramStop
            | Call::OptionalProgramStop
            | Call::PalletShuttle
            | Call::ProgramEnd
            | Call::Reset
            | Call::Finish => Class::InOrder,
        }
    }
}
