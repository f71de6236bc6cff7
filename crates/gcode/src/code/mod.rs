//! The G and M codes of RS274/NGC by their modal groups.
//!
//! In:  numbers of G and M words, by `table`.
//! Out: typed codes, to `block`, which keeps one a group.

mod table;

pub(crate) use table::{g_name, m_name};

use motion::canon::{LengthUnit, Plane, ProbeMode, Side, SpindleDirection};

/// Group 1: what axis words do. `None` beside it: G80.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// G0
    Traverse,
    /// G1
    Feed,
    /// G2
    ArcClockwise,
    /// G3
    ArcCounterclockwise,
    /// G5
    CubicSpline,
    /// G5.1
    QuadraticSpline,
    /// G5.2: opens a NURBS; the lines up to G5.3 are its control points.
    Nurbs,
    /// G5.3
    NurbsEnd,
    /// G6.2: a line of a NURBS with knots, which the last of these end.
    NurbsKnot,
    /// G6.3
    NurbsKnotEnd,
    /// G33
    SpindleSynchronised,
    /// G33.1
    RigidTap,
    /// G38.2 to G38.5
    Probe(ProbeMode),
    /// G70: finishing cycle of a lathe.
    Finish,
    /// G71, G72 and their forms with .1 and .2.
    Rough(Roughing),
    /// G73, G74, G81 to G89
    Cycle(Cycle),
    /// G76
    Thread,
}

/// G71 and G72.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Roughing {
    /// G72: cuts along X; else along Z.
    pub(crate) along_x: bool,
    pub(crate) pockets: Pockets,
}

/// What roughing does with the pockets of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pockets {
    /// Cuts them along with the rest.
    With,
    /// .1: leaves them.
    Without,
    /// .2: cuts them behind the rest.
    After,
}

/// Canned cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cycle {
    /// G73: drilling with chip breaking.
    ChipBreaking,
    /// G74: left-hand tapping.
    LeftTapping,
    /// G81: drilling.
    Drilling,
    /// G82: drilling with dwell.
    DwellDrilling,
    /// G83: peck drilling.
    PeckDrilling,
    /// G84: right-hand tapping.
    RightTapping,
    /// G85: boring, feed out.
    Boring,
    /// G86: boring, spindle stop, rapid out.
    StopBoring,
    /// G87: back boring.
    BackBoring,
    /// G88: boring, spindle stop, manual out.
    ManualBoring,
    /// G89: boring, dwell, feed out.
    DwellBoring,
}

impl Motion {
    pub(crate) fn is_arc(self) -> bool {
        matches!(self, Motion::ArcClockwise | Motion::ArcCounterclockwise)
    }
}

/// Group 0: acts on its own line only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NonModal {
    /// G4
    Dwell,
    /// G10
    SetData,
    /// G28, G30
    Return(StoredPoint),
    /// G28.1, G30.1
    Store(StoredPoint),
    /// G52
    LocalOffset,
    /// G53
    MachineCoordinates,
    /// G92
    SetPosition,
    /// G92.1: clears the offset and its parameters.
    ClearPosition,
    /// G92.2: switches the offset off.
    SuspendPosition,
    /// G92.3: switches the offset of the parameters on.
    RestorePosition,
}

impl NonModal {
    /// Whether the axis words of the line are for this code.
    pub(crate) fn takes_axes(self) -> bool {
        match self {
            NonModal::SetData | NonModal::Return(_) | NonModal::LocalOffset | NonModal::SetPosition => true,
            NonModal::Store(_)
            | NonModal::Dwell
            | NonModal::MachineCoordinates
            | NonModal::ClearPosition
            | NonModal::SuspendPosition
            | NonModal::RestorePosition => false,
        }
    }
}

/// Machine positions that the control remembers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StoredPoint {
    G28,
    G30,
}

/// Groups 3 and 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Distance {
    /// G90, G90.1
    Absolute,
    /// G91, G91.1
    Incremental,
}

/// Group 5: what F means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FeedUnit {
    /// G93: one over the minutes of a move.
    InverseTime,
    /// G94
    UnitsPerMinute,
    /// G95
    UnitsPerTurn,
}

/// Group 7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compensation {
    /// G40
    Off,
    /// G41, G42: with a tool of the table.
    Tool(Side),
    /// G41.1, G42.1: with the diameter on the line.
    Dynamic(Side),
}

/// Group 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LengthOffset {
    /// G43
    Tool,
    /// G43.1
    Dynamic,
    /// G43.2
    Additional,
    /// G43.4
    ToolCentrePoint,
    /// G49
    Off,
}

/// Group 10: where cycles go between holes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Retract {
    /// G98: where the cycle began, or R if that is higher.
    OldZ,
    /// G99
    R,
}

/// Group 13.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PathCode {
    /// G61
    ExactPath,
    /// G61.1
    ExactStop,
    /// G64
    Continuous,
}

/// Group 14.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpindleCode {
    /// G96
    ConstantSurfaceSpeed,
    /// G97
    Rpm,
}

/// A G word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GCode {
    NonModal(NonModal),
    /// `None`: G80.
    Motion(Option<Motion>),
    Plane(Plane),
    Distance(Distance),
    ArcDistance(Distance),
    FeedUnit(FeedUnit),
    Unit(LengthUnit),
    Compensation(Compensation),
    LengthOffset(LengthOffset),
    Retract(Retract),
    /// 1 for G54 to 9 for G59.3.
    System(u8),
    Path(PathCode),
    Spindle(SpindleCode),
    /// G7: X words are diameters.
    Diameter(bool),
}

/// M group 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    /// M0
    Program,
    /// M1
    Optional,
    /// M2
    End,
    /// M30: with a change of pallets.
    PalletEnd,
    /// M60: a stop with a change of pallets.
    Pallet,
    /// M98
    Call,
    /// M99
    Return,
}

/// M group 5.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InputOutput {
    /// M62 to M65.
    Digital { on: bool, with_motion: bool },
    /// M66
    Wait,
    /// M67, M68
    Analog { with_motion: bool },
}

/// M group 6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ToolCode {
    /// M6
    Change,
    /// M61
    SetNumber,
}

/// M group 7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpindleAction {
    /// M3, M4
    Start(SpindleDirection),
    /// M5
    Stop,
    /// M19
    Orient,
}

/// M group 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Coolant {
    /// M7
    Mist,
    /// M8
    Flood,
    /// M9
    Off,
}

/// M group 9.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Override {
    /// M48, M49: feed and speed.
    Both(bool),
    /// M50
    Feed,
    /// M51
    Speed,
    /// M52
    Adaptive,
    /// M53
    Hold,
}

/// M70 to M73.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ModalCode {
    /// M70
    Save,
    /// M71
    Forget,
    /// M72
    Restore,
    /// M73: saves, and the return from the subroutine restores.
    SaveForReturn,
}

/// An M word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MCode {
    Stop(Stop),
    InputOutput(InputOutput),
    Tool(ToolCode),
    Spindle(SpindleAction),
    Coolant(Coolant),
    Override(Override),
    Modal(ModalCode),
    /// M100 to M199.
    User(u8),
}

/// G word of a plane.
pub(crate) const fn plane_name(plane: Plane) -> &'static str {
    match plane {
        Plane::Xy => "G17",
        Plane::Zx => "G18",
        Plane::Yz => "G19",
        Plane::Uv => "G17.1",
        Plane::Wu => "G18.1",
        Plane::Vw => "G19.1",
    }
}

/// How far from an integer a number may be that stands for one.
const INTEGER_TOLERANCE: f64 = 1e-4;

/// The integer that a number stands for, if it is near enough to one.
pub(crate) fn integer(number: f64) -> Option<i64> {
    let rounded = number.round();
    ((number - rounded).abs() <= INTEGER_TOLERANCE && rounded.abs() < 9e15).then_some(rounded as i64)
}

/// An integer within limits.
pub(crate) fn integer_in(number: f64, range: std::ops::RangeInclusive<i64>) -> Option<i64> {
    integer(number).filter(|integer| range.contains(integer))
}
