//! Canonical moves: the vocabulary in which a part program is told to the planner.
//!
//! In:  from the interpreter (`gcode`), in program order.
//! Out: to [`crate::plan`].
//!
//! Lengths are millimetres, angles degrees, speeds per second, whatever units the program text used. Positions are
//! those of the *work* coordinate system; the offset calls tell how it lies in the machine:
//! `machine = rotate_xy(work + g92) + g5x + tool`.

mod axis;

use std::borrow::Cow;
use std::fmt;

pub use axis::{AXES, Axis, Plane, Position};

/// Spindles that a program can name with `$`: 0 to 7.
pub const SPINDLES: usize = 8;

/// How exactly the path is followed between moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathMode {
    /// G61: on the programmed path; slows down as far as corners demand, stops where they are sharp.
    ExactPath,
    /// G61.1: comes to rest at the end of every move.
    ExactStop,
    /// G64: corners may be rounded.
    Continuous {
        /// P: greatest distance from the programmed path, mm; `None`: best speed, no bound named by the program.
        tolerance_mm: Option<f64>,
        /// Q: tolerance of joining nearly collinear moves, mm; 0 switches it off.
        naive_cam_tolerance_mm: Option<f64>,
    },
}

/// Direction of spindle rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpindleDirection {
    /// M3.
    Clockwise,
    /// M4.
    Counterclockwise,
}

/// What S means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpindleMode {
    /// G97: revolutions per minute.
    Rpm,
    /// G96: the speed of the surface under the tool stays the same.
    ConstantSurfaceSpeed {
        /// D: never faster than this, revolutions per minute; `None`: as fast as the machine can.
        max_rpm: Option<f64>,
    },
}

/// Way to the angle at which M19 holds the spindle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrientDirection {
    /// P0.
    Shortest,
    /// P1.
    Clockwise,
    /// P2.
    Counterclockwise,
}

/// What a feed counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeedMode {
    /// G93, G94: way per time.
    PerTime,
    /// G95: way per turn of a spindle.
    PerTurn {
        /// Number of the spindle.
        spindle: u8,
    },
}

/// G38.2 to G38.5.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProbeMode {
    /// G38.2, G38.3: until the probe touches. G38.4, G38.5: until it lets go.
    pub towards: bool,
    /// G38.2, G38.4: an end of the move without a change of the contact is an error.
    pub must_trip: bool,
}

/// How a probing move ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProbeEnd {
    /// The contact changed as it was to.
    Tripped,
    /// The end of the line was reached without.
    Missed,
    /// The contact was as it was to become before anything moved.
    Already,
    /// The operator ended it.
    Aborted,
}

impl ProbeEnd {
    /// Whether the program goes on: without a change of the contact only where the mode does not demand one.
    pub fn is_fine(self, mode: ProbeMode) -> bool {
        match self {
            ProbeEnd::Tripped => true,
            ProbeEnd::Missed | ProbeEnd::Already => !mode.must_trip,
            ProbeEnd::Aborted => false,
        }
    }
}

/// Side of the contour on which the tool goes, in the direction of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// G41.
    Left,
    /// G42.
    Right,
}

/// The tool whose radius is compensated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutter {
    /// Where the tool goes.
    pub side: Side,
    /// Radius, mm; negative: the other side with the magnitude.
    pub radius_mm: f64,
    /// Cutting-edge orientation of a lathe tool, 1 to 9; 0: a mill.
    pub orientation: u8,
}

/// A tool as the table has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolEntry {
    /// Number that T names.
    pub tool: u32,
    /// Place as LinuxCNC counts it: the line of the table from 1 on, or 0, the spindle.
    pub pocket: u32,
    /// Offsets of the axes.
    pub offset: Position,
    /// D, mm.
    pub diameter_mm: f64,
    /// I, degrees.
    pub front_angle_degrees: f64,
    /// J, degrees.
    pub back_angle_degrees: f64,
    /// Q, 0 to 9.
    pub orientation: u8,
}

/// An input for which M66 waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// P.
    Digital(u8),
    /// E.
    Analog(u8),
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Input::Digital(index) => write!(f, "digital input {index}"),
            Input::Analog(index) => write!(f, "analog input {index}"),
        }
    }
}

/// What M66 waits for, its L word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitMode {
    /// L0: nothing; takes the value that is there.
    Immediate,
    /// L1.
    Rise,
    /// L2.
    Fall,
    /// L3.
    High,
    /// L4.
    Low,
}

/// Something that a program writes, in files or on the screen.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// `(PRINT, text)`: a line for the standard error stream.
    Print(String),
    /// `(LOGOPEN, file)`: begins a new log.
    OpenLog(String),
    /// `(LOGAPPEND, file)`: goes on with a log.
    AppendLog(String),
    /// `(LOG, text)`: a line for the open log.
    Log(String),
    /// `(LOGCLOSE)`.
    CloseLog,
    /// `(PROBEOPEN, file)`: the points of probing moves go to a file from here on.
    OpenProbeLog(String),
    /// `(PROBECLOSE)`.
    CloseProbeLog,
}

/// Units in which the program speaks; canonical calls are in mm all the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthUnit {
    /// G21.
    Millimetre,
    /// G20.
    Inch,
}

impl LengthUnit {
    /// Millimetres in one unit.
    pub const fn mm(self) -> f64 {
        match self {
            LengthUnit::Millimetre => 1.0,
            LengthUnit::Inch => 25.4,
        }
    }
}

/// What follows from the words of a block, in the order in which it happens.
#[derive(Clone, Debug, PartialEq)]
pub enum Call {
    /// G0: move at the machine's own speed.
    StraightTraverse {
        /// End point in work coordinates.
        to: Position,
    },
    /// G1: straight move at feed.
    StraightFeed {
        /// End point in work coordinates.
        to: Position,
    },
    /// G2, G3: arc or helix at feed; other axes turn evenly along.
    ArcFeed {
        /// End point in work coordinates.
        to: Position,
        /// Plane of the circle.
        plane: Plane,
        /// Centre on the first and second axis of the plane, work coordinates, mm.
        centre_mm: [f64; 2],
        /// Turns begun: positive counter-clockwise seen against the plane's normal, never 0. 1 and -1: less than or
        /// exactly one turn; each further unit adds a full one.
        turns: i32,
    },
    /// G4.
    Dwell {
        /// Seconds, not negative.
        seconds: f64,
    },
    /// G38.2 to G38.5: straight move at feed that ends where the probe trips. The interpreter asks for the result behind it.
    StraightProbe {
        /// End point in work coordinates if the probe does not trip.
        to: Position,
        /// What the move waits for.
        mode: ProbeMode,
    },
    /// G33.1: straight move in step with the spindle and, the spindle reversed, back to its start.
    RigidTap {
        /// Deepest point in work coordinates.
        to: Position,
        /// I: speed of the way back relative to the way in.
        return_scale: f64,
    },
    /// G5 to G5.3, G6.2: a curve at feed in a plane; other axes stand.
    NurbsFeed {
        /// Plane of the curve.
        plane: Plane,
        /// Control points on the first and second axis of the plane, work coordinates, mm, each with its weight.
        points: Vec<([f64; 2], f64)>,
        /// Order of the curve: its degree plus one.
        order: u32,
        /// Knots, as many as points and order together, never falling, the first and the last each as often as the order;
        /// none: evenly spaced.
        knots: Vec<f64>,
    },
    /// G33, G76: the moves that follow are in step with a spindle.
    StartSpindleSync {
        /// Number of the spindle.
        spindle: u8,
        /// Way per turn, mm.
        mm_per_turn: f64,
        /// Speed only (G95): the angle does not matter.
        velocity: bool,
    },
    /// Ends what [`Call::StartSpindleSync`] began.
    StopSpindleSync,
    /// G93, G94, G95.
    SetFeedMode(FeedMode),
    /// Feed of the moves that follow, in way per second or, where [`FeedMode::PerTurn`] holds, per turn. 0: none is set.
    SetFeedRate {
        /// Moves of XYZ or, if none of these moves, UVW: mm.
        linear: f64,
        /// Moves of ABC alone: degrees.
        angular: f64,
    },
    /// G61, G61.1, G64.
    SetPathMode(PathMode),
    /// R of G64, just before its path mode: how speeds are planned from here on.
    SetPlanner {
        /// Share of the greatest speed in corners with limited jerk, 0.1 to 1; `None`: trapezoids.
        corner_share: Option<f64>,
    },
    /// G17 to G19.1.
    SelectPlane(Plane),
    /// G20, G21; only for those who print what the program said.
    UseLengthUnit(LengthUnit),
    /// G54 to G59.3: origin of the active system in machine coordinates.
    SetG5xOffset {
        /// 1 for G54 to 9 for G59.3.
        system: u8,
        /// Origin in machine coordinates.
        origin: Position,
    },
    /// G92, G52.
    SetG92Offset {
        /// Shift inside the rotated system.
        offset: Position,
    },
    /// R of the active system: rotation of XY, degrees.
    SetXyRotation {
        /// Degrees, counter-clockwise.
        degrees: f64,
    },
    /// G43, G49: shift by the tool, machine directions.
    SetToolLengthOffset {
        /// Shift.
        offset: Position,
    },
    /// G43.4 and its end: whether X Y Z are those of the tool's tip on the work, wherever the rotary axes stand. The length of
    /// the tool is Z of [`Call::SetToolLengthOffset`]. No joint moves; the axes read otherwise (`kinematics::Kinematics::reframe`).
    SetToolCentrePoint(bool),
    /// G41, G42 and, with `None`, G40: radius compensation of the moves that follow. Only where the interpreter gives the
    /// programmed path; else the moves are those of the tool's centre.
    SetCutterCompensation(Option<Cutter>),
    /// G96, G97.
    SetSpindleMode {
        /// Number of the spindle.
        spindle: u8,
        /// What S means.
        mode: SpindleMode,
    },
    /// S.
    SetSpindleSpeed {
        /// Number of the spindle.
        spindle: u8,
        /// Revolutions per minute or, with constant surface speed, metres per minute; not negative.
        speed: f64,
    },
    /// M3, M4.
    StartSpindle {
        /// Number of the spindle.
        spindle: u8,
        /// Which way.
        direction: SpindleDirection,
        /// Whether the next feed waits until the speed is reached.
        wait_for_speed: bool,
    },
    /// M5.
    StopSpindle {
        /// Number of the spindle.
        spindle: u8,
    },
    /// M19: turn to an angle and hold it.
    OrientSpindle {
        /// Number of the spindle.
        spindle: u8,
        /// Angle, degrees from 0 to 360.
        degrees: f64,
        /// Way there.
        direction: OrientDirection,
    },
    /// M19 with Q: wait until the angle is reached.
    WaitSpindleOriented {
        /// Number of the spindle.
        spindle: u8,
        /// Longest wait, s.
        timeout_s: f64,
    },
    /// M7 on, M9 off.
    Mist(bool),
    /// M8 on, M9 off.
    Flood(bool),
    /// T: the tool that the next change brings.
    SelectTool {
        /// Tool number, 0: none.
        tool: u32,
    },
    /// M6 begins.
    StartChange,
    /// M6: bring the selected tool.
    ChangeTool {
        /// Tool number, 0: none.
        tool: u32,
        /// Pocket from which it comes, 0: none.
        pocket: u32,
    },
    /// M61: the spindle holds this tool; nothing moves.
    SetToolNumber {
        /// Tool number, 0: none.
        tool: u32,
        /// Its pocket, 0: none.
        pocket: u32,
    },
    /// G10 L1, L10, L11: a line of the tool table changes.
    SetToolEntry(ToolEntry),
    /// G10 L0: the tool table was read again.
    ReloadToolTable,
    /// M48 to M50: whether the operator's feed override acts.
    EnableFeedOverride(bool),
    /// M48, M49, M51: whether the operator's override of a spindle acts.
    EnableSpeedOverride {
        /// Number of the spindle.
        spindle: u8,
        /// Whether it acts.
        on: bool,
    },
    /// M52: whether the machine adapts the feed.
    EnableAdaptiveFeed(bool),
    /// M53: whether the feed-hold switch acts.
    EnableFeedHold(bool),
    /// M62 to M65.
    SetDigitalOutput {
        /// Number of the output.
        index: u8,
        /// On or off.
        on: bool,
        /// M62, M63: at the beginning of the next move; M64, M65: at once.
        with_motion: bool,
    },
    /// M67, M68.
    SetAnalogOutput {
        /// Number of the output.
        index: u8,
        /// Value.
        value: f64,
        /// M67: at the beginning of the next move; M68: at once.
        with_motion: bool,
    },
    /// M66. The interpreter asks for the result behind it.
    WaitInput {
        /// Which.
        input: Input,
        /// For what.
        mode: WaitMode,
        /// Longest wait, s.
        timeout_s: f64,
    },
    /// M100 to M199: a program or pin of the user.
    UserCode {
        /// Number of the M code.
        number: u8,
        /// P, -1 if it is not there.
        p: f64,
        /// Q, -1 if it is not there.
        q: f64,
    },
    /// Switches the probe on for a probing move, and off behind it.
    Probe(bool),
    /// (MSG, text).
    Message(String),
    /// Any other comment, or a remark of the interpreter on what it does; of no effect.
    Comment(Cow<'static, str>),
    /// Something for a file or the screen.
    Record(Record),
    /// M0.
    ProgramStop,
    /// M1.
    OptionalProgramStop,
    /// M30, M60: the pallets change.
    PalletShuttle,
    /// M2, M30.
    ProgramEnd,
    /// The state of the interpreter is that of a new program.
    Reset,
    /// The `%` behind the program.
    Finish,
}

/// Place in the program text from which a call comes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Source {
    /// Line, counted from 1.
    pub line: u32,
    /// N-word of the block, if it has one; its whole part.
    pub n: Option<u32>,
    /// Digits of the whole part of the N-word as written, with zeros in front; 0: as many as the number has.
    pub n_digits: u8,
    /// File: 0 for the program, others are subroutines in files of their own.
    pub file: u16,
    /// Octets of the block in the text.
    pub start: u32,
    /// One past the last octet.
    pub end: u32,
    /// Number of the modes in force behind the block, where somebody is told of them; 0: nobody is.
    pub modes: u32,
}

/// A canonical call and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Place in the program.
    pub source: Source,
    /// What the program asks for there.
    pub call: Call,
}
