//! Canonical calls as plain G-code: no parameters, no expressions, no loops, no subroutines, no cycles.
//!
//! In:  events of a program from its first one on, and the [`Settings`] it ran with.
//! Out: a text between two lines `%`; read with the same settings ([`FlatWriter::settings_to_read_with`]) it gives the
//!      same moves.
//!
//! How things are written:
//!
//! - Lengths in mm (G21), absolute (G90), centres of arcs absolute (G90.1), one motion code on each line. A number has the
//!   digits it needs to come back to the bit, at most 20 behind the point; a line that would be longer than 250 characters
//!   has 9. Moves name the axes that move, at least one.
//! - Feeds per minute (G94) or turn (G95), also what was G93, to within one part in 2^52. F stands on the first move that
//!   it concerns, in degrees if only rotary axes turn.
//! - Work systems by their code, before it G10 L2 where origin or rotation are not those of the settings. G92 and G52 as
//!   G52, tool lengths as G43.1 and G49, tool entries as G10 L1, tools as T and M6 or M61.
//! - Cycles, G28, G53 and polar coordinates as the moves they come to; the path of the tool's centre as it is, a
//!   programmed one with G41.1 and G42.1; threads and taps as G33 and G33.1; every spline as G5.2 and G5.3.
//! - Axes without ends by their place on the turn, which is rounded.
//! - A probing move and M66 stay what they are: what follows is what came of the answers in this run.
//! - `(PRINT, ..)`, `(LOG, ..)` and messages with the values they had; remarks of the interpreter are left out, as is what
//!   other codes bring about anyway ([`Call::Probe`], [`Call::StartChange`], [`Call::Reset`]).
//!
//! What has no such form is an error ([`Unwritable`]), nothing is left out silently.

mod line;
#[cfg(test)]
mod tests;

use crate::comment::{self, CommentKind};
use crate::execute::circle;
use crate::state::Offsets;
use crate::{Settings, ToolChangePlace};
use line::{Exactness, LINE_MAX, Line, LineError};
use motion::canon::{
    AXES, Axis, Call, Cutter, Event, FeedMode, Input, LengthUnit, OrientDirection, PathMode, Plane, Position, Record,
    Side, Source, SpindleDirection, SpindleMode, ToolEntry, WaitMode,
};
use std::collections::BTreeMap;
use std::io;

/// Offsets and positions nearer than this are the same, mm or degrees: rounding by changes of units and origins.
const SAME: f64 = 1e-9;

/// A call that plain G-code cannot say.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unwritable {
    /// A number that is infinite or none.
    #[error("the number of {0} is not finite")]
    NotFinite(char),
    /// Numbers beyond all machines, or a long text.
    #[error("the line would be longer than {LINE_MAX} characters")]
    TooLong,
    /// A comment with a bracket or line end in it, or that would do something.
    #[error("the text {0:?} would mean something else in a comment")]
    Text(String),
    /// A move at feed without one.
    #[error("a move at feed before a feed above 0 was set")]
    FeedMissing,
    /// An arc that G2 and G3 refuse in mm: start and end differ in radius.
    #[error("an arc that G2 and G3 refuse in mm: {0}")]
    Arc(String),
    /// A whole turn or more at once.
    #[error("{0} has no ends and turns by a whole turn or more, which a word cannot say")]
    Wrapped(char),
    /// A curve that does not begin where the axes stand, or outside the XY plane.
    #[error("a spline {0}")]
    Spline(&'static str),
    /// An arc, spline or probing move in step with a spindle.
    #[error("{0} in step with a spindle")]
    Synchronised(&'static str),
    /// A tap without the pitch.
    #[error("a rigid tap outside of synchronised motion has no pitch")]
    TapWithoutPitch,
    /// Synchronised in speed only.
    #[error("motion that follows the speed of a spindle, but not its angle")]
    SpeedOnly,
    /// No code starts a spindle so.
    #[error("a spindle that starts without a wait for its speed")]
    SpindleWithoutWait,
    /// A wait for an angle that is not behind its M19.
    #[error("a wait for the angle of a spindle that is not behind its M19")]
    WaitWithoutOrient,
    /// A change of pallets without the stop or end that belongs to it.
    #[error("a change of pallets without M30 or M60")]
    PalletAlone,
    /// A number that no user code has.
    #[error("a user code M{0}: they are M100 to M199")]
    UserCode(u8),
}

/// Why a flat text could not be written.
#[derive(Debug, thiserror::Error)]
pub enum FlatError {
    /// The output failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A call cannot be written.
    #[error("line {}: cannot be written as plain G-code: {reason}", at.line)]
    Unwritable {
        /// The block that it comes from.
        at: Source,
        /// Why.
        reason: Unwritable,
    },
}

/// Something that is written together with the call behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Waiting {
    /// For the S word.
    SpindleMode { spindle: u8, mode: SpindleMode },
    /// For the Q word.
    Orient {
        spindle: u8,
        degrees: f64,
        direction: OrientDirection,
    },
    /// For the other half of M9: mist or flood is off, the other still on.
    Coolant,
}

/// Writes canonical calls as plain G-code; made for one run of a program.
#[derive(Clone, Debug)]
pub struct FlatWriter {
    begun: bool,
    /// Where the axes stand, work coordinates, and on which axes the reader of the text stands there to the bit.
    at: Position,
    known: [bool; AXES],
    /// As the reader of the text has them.
    offsets: Offsets,
    origins: [Position; 9],
    rotations_degrees: [f64; 9],
    plane: Plane,
    feed_mode: FeedMode,
    feed: Option<f64>,
    tools: BTreeMap<u32, ToolEntry>,
    /// R of the G64 that comes next.
    planner: Option<f64>,
    /// The entry that was written last.
    entry: Option<ToolEntry>,
    selected_tool: u32,
    mist: bool,
    flood: bool,
    /// What the calls have set and the next moves need.
    linear: f64,
    angular: f64,
    synchronised: Option<(u8, f64)>,
    pallet: bool,
    waiting: Option<Waiting>,
    wrapped_rotary: [bool; AXES],
    orient_offset_degrees: f64,
    diameter_mode: bool,
    arc_tolerance_mm: Option<f64>,
    line: Line,
    text: String,
}

impl FlatWriter {
    /// A writer before the first event of a program that runs with these settings.
    pub fn new(settings: &Settings) -> FlatWriter {
        let index = usize::from(settings.work_system.clamp(1, 9)) - 1;
        let offsets = Offsets {
            system: settings.work_system.clamp(1, 9),
            g5x: settings.work_offsets[index],
            rotation_degrees: settings.work_rotations_degrees[index],
            g92: if settings.g92_active {
                settings.g92_offset
            } else {
                Position::ZERO
            },
            tool: Position::ZERO,
        };
        let tools = settings.tools.tools().map(|tool| {
            let entry = ToolEntry {
                tool: tool.number,
                pocket: tool.pocket,
                offset: tool.offset,
                diameter_mm: tool.diameter_mm,
                front_angle_degrees: tool.front_angle_deg,
                back_angle_degrees: tool.back_angle_deg,
                orientation: tool.orientation,
            };
            (tool.number, entry)
        });
        FlatWriter {
            begun: false,
            planner: None,
            at: offsets.work(settings.start),
            known: [true; AXES],
            offsets,
            origins: settings.work_offsets,
            rotations_degrees: settings.work_rotations_degrees,
            plane: Plane::Xy,
            feed_mode: FeedMode::PerTime,
            feed: None,
            tools: tools.collect(),
            entry: None,
            selected_tool: 0,
            mist: false,
            flood: false,
            linear: 0.0,
            angular: 0.0,
            synchronised: None,
            pallet: false,
            waiting: None,
            wrapped_rotary: settings.wrapped_rotary,
            orient_offset_degrees: settings.orient_offset_degrees,
            diameter_mode: settings.diameter_mode,
            arc_tolerance_mm: settings.arc_radius_tolerance_mm,
            line: Line::default(),
            text: String::new(),
        }
    }

    /// The settings with which the text gives the same moves: those of the program without what would be done a second
    /// time, the subroutines of remapped codes and the moves of a tool change.
    pub fn settings_to_read_with(settings: &Settings) -> Settings {
        Settings {
            remaps: Vec::new(),
            tool_change: ToolChangePlace {
                spindle_on: settings.tool_change.spindle_on,
                ..ToolChangePlace::default()
            },
            keep_tool_offset: false,
            ..settings.clone()
        }
    }

    /// Writes what an event comes to: often one line, sometimes none or some more. Some calls are written together with
    /// the one behind them.
    ///
    /// # Errors
    /// Those of `out`, and calls that plain G-code cannot say; the writer is of no use behind one.
    pub fn write(&mut self, event: &Event, out: &mut impl io::Write) -> Result<(), FlatError> {
        self.text.clear();
        self.begin();
        if event.source.line == 0 && matches!(event.call, Call::SetPathMode(_)) {
            return Ok(()); // told at the start, as the settings have it
        }
        let result = self
            .resolve(&event.call)
            .and_then(|done| if done { Ok(()) } else { self.call(&event.call) });
        result.map_err(|reason| FlatError::Unwritable {
            at: event.source,
            reason,
        })?;
        Ok(out.write_all(self.text.as_bytes())?)
    }

    /// Writes what still waits, and the end of the text.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn finish(mut self, out: &mut impl io::Write) -> Result<(), FlatError> {
        self.text.clear();
        self.begin();
        let waiting = self.waiting.take();
        let result = match waiting {
            Some(waiting) => self.alone(waiting),
            None if self.pallet => Err(Unwritable::PalletAlone),
            None => Ok(()),
        };
        result.map_err(|reason| FlatError::Unwritable {
            at: Source::default(),
            reason,
        })?;
        self.text.push_str("%\n");
        Ok(out.write_all(self.text.as_bytes())?)
    }

    fn begin(&mut self) {
        if !std::mem::replace(&mut self.begun, true) {
            self.text.push_str("%\nG21 G90 G90.1\n");
            if self.diameter_mode {
                self.text.push_str("G8\n");
            }
        }
    }

    /// Writes what waits, together with `call` if they belong together, which is the answer.
    fn resolve(&mut self, call: &Call) -> Result<bool, Unwritable> {
        let Some(waiting) = self.waiting.take() else {
            return Ok(false);
        };
        match (waiting, call) {
            (Waiting::SpindleMode { spindle, mode }, Call::SetSpindleSpeed { spindle: of, speed })
                if spindle == *of =>
            {
                self.spindle_mode(spindle, mode, Some(*speed))?;
                Ok(true)
            }
            (
                Waiting::Orient {
                    spindle,
                    degrees,
                    direction,
                },
                Call::WaitSpindleOriented { spindle: of, timeout_s },
            ) if spindle == *of => {
                self.orient(spindle, degrees, direction, Some(*timeout_s))?;
                Ok(true)
            }
            (Waiting::Coolant, Call::Mist(false) | Call::Flood(false)) => {
                (self.mist, self.flood) = (false, false);
                self.plain("M9")?;
                Ok(true)
            }
            (waiting, _) => {
                self.alone(waiting)?;
                Ok(false)
            }
        }
    }

    fn alone(&mut self, waiting: Waiting) -> Result<(), Unwritable> {
        match waiting {
            Waiting::SpindleMode { spindle, mode } => self.spindle_mode(spindle, mode, None),
            Waiting::Orient {
                spindle,
                degrees,
                direction,
            } => self.orient(spindle, degrees, direction, None),
            Waiting::Coolant => {
                self.plain("M9")?;
                self.plain(if self.mist { "M7" } else { "M8" })
            }
        }
    }

    fn call(&mut self, call: &Call) -> Result<(), Unwritable> {
        match call {
            Call::StraightTraverse { to } => {
                self.line.begin("G0");
                self.move_to(*to)
            }
            Call::StraightFeed { to } => self.straight_feed(*to),
            Call::ArcFeed {
                to,
                plane,
                centre_mm,
                turns,
            } => self.arc(*to, *plane, *centre_mm, *turns),
            Call::StraightProbe { to, mode } => self.probe(*to, mode.towards, mode.must_trip),
            Call::RigidTap { to, return_scale } => self.rigid_tap(*to, *return_scale),
            Call::NurbsFeed { plane, points, order } => self.nurbs(*plane, points, *order),
            Call::Dwell { seconds } => self.one_word("G4", 'P', *seconds),
            Call::StartSpindleSync { velocity: true, .. } => Err(Unwritable::SpeedOnly),
            Call::StartSpindleSync {
                spindle,
                mm_per_turn,
                velocity: false,
            } => {
                self.synchronised = Some((*spindle, *mm_per_turn));
                Ok(())
            }
            Call::StopSpindleSync => {
                self.synchronised = None;
                Ok(())
            }
            Call::SetFeedMode(mode) => self.feed_mode(*mode),
            Call::SetFeedRate { linear, angular } => {
                (self.linear, self.angular) = (*linear, *angular);
                Ok(())
            }
            Call::SetPathMode(mode) => self.path_mode(*mode),
            Call::SetPlanner { corner_share } => {
                self.planner = Some(corner_share.unwrap_or(0.0)); // the path mode behind it tells it
                Ok(())
            }
            Call::SelectPlane(plane) => self.select_plane(*plane),
            Call::SetG5xOffset { system, origin } => self.g5x(*system, *origin),
            Call::SetG92Offset { offset } => self.g92(*offset),
            Call::SetXyRotation { degrees } => self.rotation(*degrees),
            Call::SetToolLengthOffset { offset } => self.tool_length(*offset),
            Call::SetCutterCompensation(cutter) => self.compensation(*cutter),
            Call::SetSpindleMode { spindle, mode } => {
                let (spindle, mode) = (*spindle, *mode);
                self.waiting = Some(Waiting::SpindleMode { spindle, mode });
                Ok(())
            }
            Call::SetSpindleSpeed { spindle, speed } => {
                self.line.begin("").word('S', *speed).spindle(*spindle);
                self.end_line()
            }
            Call::StartSpindle {
                wait_for_speed: false, ..
            } => Err(Unwritable::SpindleWithoutWait),
            Call::StartSpindle {
                spindle,
                direction,
                wait_for_speed: true,
            } => {
                let code = match direction {
                    SpindleDirection::Clockwise => "M3",
                    SpindleDirection::Counterclockwise => "M4",
                };
                self.line.begin(code).spindle(*spindle);
                self.end_line()
            }
            Call::StopSpindle { spindle } => {
                self.line.begin("M5").spindle(*spindle);
                self.end_line()
            }
            Call::OrientSpindle {
                spindle,
                degrees,
                direction,
            } => {
                self.waiting = Some(Waiting::Orient {
                    spindle: *spindle,
                    degrees: *degrees,
                    direction: *direction,
                });
                Ok(())
            }
            Call::WaitSpindleOriented { .. } => Err(Unwritable::WaitWithoutOrient),
            Call::Mist(true) => {
                self.mist = true;
                self.plain("M7")
            }
            Call::Flood(true) => {
                self.flood = true;
                self.plain("M8")
            }
            Call::Mist(false) => {
                self.mist = false;
                self.coolant_off(self.flood)
            }
            Call::Flood(false) => {
                self.flood = false;
                self.coolant_off(self.mist)
            }
            Call::SelectTool { tool } => {
                self.selected_tool = *tool;
                self.one_word("", 'T', *tool)
            }
            Call::ChangeTool { tool, pocket: _ } => {
                self.line.begin("M6");
                if self.selected_tool != *tool {
                    self.selected_tool = *tool;
                    self.line.word('T', *tool);
                }
                self.end_line()
            }
            Call::SetToolNumber { tool, pocket: _ } => self.one_word("M61", 'Q', *tool),
            Call::SetToolEntry(entry) => self.tool_entry(entry),
            Call::ReloadToolTable => self.plain("G10 L0"),
            Call::EnableFeedOverride(on) => self.one_word("M50", 'P', u8::from(*on)),
            Call::EnableSpeedOverride { spindle, on } => {
                self.line.begin("M51").word('P', u8::from(*on)).spindle(*spindle);
                self.end_line()
            }
            Call::EnableAdaptiveFeed(on) => self.one_word("M52", 'P', u8::from(*on)),
            Call::EnableFeedHold(on) => self.one_word("M53", 'P', u8::from(*on)),
            Call::SetDigitalOutput { index, on, with_motion } => {
                let code = match (with_motion, on) {
                    (true, true) => "M62",
                    (true, false) => "M63",
                    (false, true) => "M64",
                    (false, false) => "M65",
                };
                self.one_word(code, 'P', *index)
            }
            Call::SetAnalogOutput {
                index,
                value,
                with_motion,
            } => {
                let code = if *with_motion { "M67" } else { "M68" };
                self.line.begin(code).word('E', *index).word('Q', *value);
                self.end_line()
            }
            Call::WaitInput { input, mode, timeout_s } => self.wait_input(*input, *mode, *timeout_s),
            Call::UserCode { number, p, q } => self.user_code(*number, *p, *q),
            Call::Message(text) => self.remark("MSG,", text),
            Call::Comment(text) if text.starts_with("interpreter:") => Ok(()),
            Call::Comment(text) => match comment::read(text.as_bytes()).0 {
                // Its record comes behind it.
                CommentKind::OpenProbeLog | CommentKind::CloseProbeLog => Ok(()),
                _ => self.remark("", text),
            },
            Call::Record(record) => self.record(record),
            Call::ProgramStop => {
                let code = if std::mem::take(&mut self.pallet) { "M60" } else { "M0" };
                self.plain(code)
            }
            Call::OptionalProgramStop => self.plain("M1"),
            Call::PalletShuttle => {
                self.pallet = true;
                Ok(())
            }
            Call::ProgramEnd => {
                let code = if std::mem::take(&mut self.pallet) { "M30" } else { "M2" };
                self.plain(code)
            }
            // Other codes bring these about, and the unit is always mm.
            Call::UseLengthUnit(_) | Call::Probe(_) | Call::StartChange | Call::Reset => Ok(()),
            Call::Finish => Ok(()), // the text always ends with a %
        }
    }
}

/// Moves.
impl FlatWriter {
    /// Adds the words of a move to the line that was begun, and ends it; the axes stand at `to` behind it.
    fn move_to(&mut self, to: Position) -> Result<(), Unwritable> {
        self.push_axes(to)?;
        if !self.line.has_words() {
            self.push_axis(Axis::X, to)?;
        }
        self.end_move(to)
    }

    fn push_axes(&mut self, to: Position) -> Result<(), Unwritable> {
        for axis in Axis::ALL {
            if to[axis] != self.at[axis] || !self.known[axis as usize] {
                self.push_axis(axis, to)?;
            }
        }
        Ok(())
    }

    fn push_axis(&mut self, axis: Axis, to: Position) -> Result<(), Unwritable> {
        if self.wrapped_rotary[axis as usize] {
            let place = wrapped_word(self.at[axis], to[axis]).ok_or(Unwritable::Wrapped(axis.letter()))?;
            self.line.signed_word(axis.letter(), place);
            self.known[axis as usize] = false; // a place and some turns: rounded
        } else {
            self.line.word(axis.letter(), to[axis]);
            self.known[axis as usize] = true;
        }
        Ok(())
    }

    fn end_move(&mut self, to: Position) -> Result<(), Unwritable> {
        if self.push_line()? == Exactness::Rounded {
            self.known = [false; AXES];
        }
        self.at = to;
        Ok(())
    }

    /// Adds F to the line if it is not the one in force. `to`: where the move ends.
    fn push_feed(&mut self, to: Position) -> Result<(), Unwritable> {
        let moves = |axis: &Axis| (to[*axis] - self.at[*axis]).abs() > SAME;
        let (rotary, linear): (Vec<Axis>, Vec<Axis>) = Axis::ALL
            .iter()
            .filter(|axis| moves(axis))
            .partition(|axis| axis.is_rotary());
        let turns_only = linear.is_empty() && !rotary.is_empty();
        let rate = if turns_only { self.angular } else { self.linear };
        if rate <= 0.0 {
            return Err(Unwritable::FeedMissing);
        }
        let word = match self.feed_mode {
            FeedMode::PerTime => per_minute(rate),
            FeedMode::PerTurn { .. } => rate,
        };
        if self.feed != Some(word) {
            self.feed = Some(word);
            self.line.word('F', word);
        }
        Ok(())
    }

    fn straight_feed(&mut self, to: Position) -> Result<(), Unwritable> {
        let Some((spindle, mm_per_turn)) = self.synchronised else {
            self.line.begin("G1");
            self.push_axes(to)?;
            if !self.line.has_words() {
                self.push_axis(Axis::X, to)?;
            }
            self.push_feed(to)?;
            return self.end_move(to);
        };
        self.line.begin("G33");
        self.push_axes(to)?;
        if !self.line.has_words() {
            self.push_axis(Axis::Z, to)?;
        }
        self.line.word('K', mm_per_turn).spindle(spindle);
        self.end_move(to)
    }

    fn arc(&mut self, to: Position, plane: Plane, centre_mm: [f64; 2], turns: i32) -> Result<(), Unwritable> {
        if self.synchronised.is_some() {
            return Err(Unwritable::Synchronised("an arc"));
        }
        let [first, second, _] = plane.axes();
        let in_plane = |position: Position| [position[first], position[second]];
        circle::by_centre(
            in_plane(self.at),
            in_plane(to),
            centre_mm,
            turns,
            LengthUnit::Millimetre,
            self.arc_tolerance_mm,
        )
        .and_then(|_| circle::turns_of(f64::from(turns).abs()))
        .map_err(|kind| Unwritable::Arc(kind.to_string()))?;
        self.line.begin(if turns < 0 { "G2" } else { "G3" });
        if plane != self.plane {
            self.plane = plane;
            self.line.code(plane_code(plane));
        }
        self.push_axes(to)?;
        let letters = match plane {
            Plane::Xy | Plane::Uv => ['I', 'J'],
            Plane::Zx | Plane::Wu => ['K', 'I'],
            Plane::Yz | Plane::Vw => ['J', 'K'],
        };
        for (letter, number) in letters.into_iter().zip(centre_mm) {
            self.line.word(letter, number);
        }
        if turns.abs() > 1 {
            self.line.word('P', turns.abs());
        }
        self.push_feed(to)?;
        self.end_move(to)
    }

    fn probe(&mut self, to: Position, towards: bool, must_trip: bool) -> Result<(), Unwritable> {
        if self.synchronised.is_some() {
            return Err(Unwritable::Synchronised("a probing move"));
        }
        self.line.begin(match (towards, must_trip) {
            (true, true) => "G38.2",
            (true, false) => "G38.3",
            (false, true) => "G38.4",
            (false, false) => "G38.5",
        });
        let (from, known) = (self.at, self.known);
        self.push_axes(to)?;
        if !self.line.has_words() {
            self.push_axis(Axis::X, to)?;
        }
        self.push_feed(to)?;
        self.end_move(to)?;
        // Where it ends is for the machine to say.
        for axis in Axis::ALL {
            self.known[axis as usize] = known[axis as usize] && from[axis] == to[axis];
        }
        Ok(())
    }

    /// Ends where it began.
    fn rigid_tap(&mut self, to: Position, return_scale: f64) -> Result<(), Unwritable> {
        let Some((spindle, mm_per_turn)) = self.synchronised else {
            return Err(Unwritable::TapWithoutPitch);
        };
        let (at, known) = (self.at, self.known);
        self.line.begin("G33.1");
        self.push_axes(to)?;
        if !self.line.has_words() {
            self.push_axis(Axis::Z, to)?;
        }
        self.line.word('K', mm_per_turn);
        if return_scale != 1.0 {
            self.line.word('I', return_scale);
        }
        self.line.spindle(spindle);
        self.push_line()?;
        // Axes whose place was not sure were named, and the way back leads to where they were.
        (self.at, self.known) = (at, known);
        Ok(())
    }

    fn nurbs(&mut self, plane: Plane, points: &[([f64; 2], f64)], order: u32) -> Result<(), Unwritable> {
        if self.synchronised.is_some() {
            return Err(Unwritable::Synchronised("a spline"));
        }
        if plane != Plane::Xy {
            return Err(Unwritable::Spline("outside the XY plane: G5.2 works in G17 only"));
        }
        let Some(((start, start_weight), rest)) = points.split_first() else {
            return Err(Unwritable::Spline("without points"));
        };
        if points.len() < order as usize || order < 3 {
            return Err(Unwritable::Spline(
                "with fewer points than its order, or an order below 3",
            ));
        }
        if (start[0] - self.at[Axis::X]).abs() > SAME || (start[1] - self.at[Axis::Y]).abs() > SAME {
            return Err(Unwritable::Spline("that does not begin where the axes stand"));
        }
        self.select_plane(Plane::Xy)?;
        let mut to = self.at;
        if let Some((last, _)) = rest.last() {
            [to[Axis::X], to[Axis::Y]] = *last;
        }
        self.line.begin("G5.2").word('P', *start_weight).word('L', order);
        // Its feed counts mm, also where it ends where it began.
        let mut along = self.at;
        along[Axis::X] += 1.0;
        self.push_feed(along)?;
        self.push_line()?;
        for ([x, y], weight) in rest {
            self.line.begin("").word('X', *x).word('Y', *y).word('P', *weight);
            self.push_line()?;
        }
        self.plain("G5.3")?;
        self.at = to;
        self.known[Axis::X as usize] = true;
        self.known[Axis::Y as usize] = true;
        Ok(())
    }
}

/// Modes and offsets.
impl FlatWriter {
    fn feed_mode(&mut self, mode: FeedMode) -> Result<(), Unwritable> {
        if mode == self.feed_mode {
            return Ok(());
        }
        self.feed_mode = mode;
        self.feed = None;
        match mode {
            FeedMode::PerTime => self.plain("G94"),
            FeedMode::PerTurn { spindle } => {
                self.line.begin("G95").spindle(spindle);
                self.end_line()
            }
        }
    }

    fn path_mode(&mut self, mode: PathMode) -> Result<(), Unwritable> {
        match mode {
            PathMode::ExactPath => self.plain("G61"),
            PathMode::ExactStop => self.plain("G61.1"),
            PathMode::Continuous {
                tolerance_mm,
                naive_cam_tolerance_mm,
            } => {
                self.line.begin("G64");
                if let Some(tolerance) = tolerance_mm {
                    self.line.word('P', tolerance);
                }
                // With P alone Q would be the same.
                if let Some(naive) = naive_cam_tolerance_mm.or(tolerance_mm.map(|_| 0.0)) {
                    self.line.word('Q', naive);
                }
                if let Some(share) = self.planner.take() {
                    self.line.word('R', share);
                }
                self.end_line()
            }
        }
    }

    fn select_plane(&mut self, plane: Plane) -> Result<(), Unwritable> {
        if plane == self.plane {
            return Ok(());
        }
        self.plane = plane;
        self.plain(plane_code(plane))
    }

    fn g5x(&mut self, system: u8, origin: Position) -> Result<(), Unwritable> {
        let system = system.clamp(1, 9);
        let index = usize::from(system) - 1;
        self.line.begin("G10 L2").word('P', system);
        let changed = self.push_changed(self.origins[index], origin);
        if changed {
            self.end_line()?;
        }
        self.origins[index] = origin;
        if system != self.offsets.system {
            const CODES: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
            self.plain(CODES[index])?;
        }
        self.set_offsets(Offsets {
            system,
            g5x: origin,
            rotation_degrees: self.rotations_degrees[index],
            ..self.offsets
        });
        Ok(())
    }

    fn rotation(&mut self, degrees: f64) -> Result<(), Unwritable> {
        let known = &mut self.rotations_degrees[usize::from(self.offsets.system) - 1];
        if (*known - degrees).abs() > SAME {
            *known = degrees;
            let system = self.offsets.system;
            self.line.begin("G10 L2").word('P', system).word('R', degrees);
            self.end_line()?;
        }
        self.set_offsets(Offsets {
            rotation_degrees: degrees,
            ..self.offsets
        });
        Ok(())
    }

    fn g92(&mut self, offset: Position) -> Result<(), Unwritable> {
        self.line.begin("G52");
        if self.push_changed(self.offsets.g92, offset) {
            self.end_line()?;
        }
        self.set_offsets(Offsets {
            g92: offset,
            ..self.offsets
        });
        Ok(())
    }

    fn tool_length(&mut self, offset: Position) -> Result<(), Unwritable> {
        let old = self.offsets.tool;
        if offset == Position::ZERO {
            self.plain("G49")?;
        } else {
            self.line.begin("G43.1");
            if self.push_changed(old, offset) {
                self.end_line()?;
            }
        }
        self.set_offsets(Offsets {
            tool: offset,
            ..self.offsets
        });
        Ok(())
    }

    /// Adds words for the axes on which two positions differ; whether there are any.
    fn push_changed(&mut self, old: Position, new: Position) -> bool {
        let mut any = false;
        for axis in Axis::ALL {
            // Not finite: refused when the line is written.
            if (new[axis] - old[axis]).abs() > SAME || !new[axis].is_finite() {
                self.line.word(axis.letter(), new[axis]);
                any = true;
            }
        }
        any
    }

    /// The axes stay where they are in the machine, and read otherwise.
    fn set_offsets(&mut self, offsets: Offsets) {
        let old = self.offsets;
        let machine = old.machine(self.at);
        self.offsets = offsets;
        self.at = offsets.work(machine);
        let turned = old.rotation_degrees != 0.0 || offsets.rotation_degrees != 0.0;
        for axis in Axis::ALL {
            let shifts = [old, offsets].iter().any(|offsets| {
                [offsets.g5x, offsets.g92, offsets.tool]
                    .iter()
                    .any(|offset| offset[axis] != 0.0)
            });
            // What the reader of the text comes to may differ in the last bit.
            if shifts || (turned && matches!(axis, Axis::X | Axis::Y)) {
                self.known[axis as usize] = false;
            }
        }
    }

    fn compensation(&mut self, cutter: Option<Cutter>) -> Result<(), Unwritable> {
        let Some(cutter) = cutter else {
            return self.plain("G40");
        };
        let left = (cutter.side == Side::Left) == (cutter.radius_mm >= 0.0);
        self.line.begin(if left { "G41.1" } else { "G42.1" });
        self.line.word('D', 2.0 * cutter.radius_mm.abs());
        if cutter.orientation != 0 {
            self.line.word('L', cutter.orientation);
        }
        self.end_line()
    }
}

/// Spindles, tools, inputs and outputs, texts.
impl FlatWriter {
    fn spindle_mode(&mut self, spindle: u8, mode: SpindleMode, speed: Option<f64>) -> Result<(), Unwritable> {
        match mode {
            SpindleMode::Rpm => self.line.begin("G97"),
            SpindleMode::ConstantSurfaceSpeed { max_rpm: None } => self.line.begin("G96"),
            SpindleMode::ConstantSurfaceSpeed { max_rpm: Some(max_rpm) } => self.line.begin("G96").word('D', max_rpm),
        };
        if let Some(speed) = speed {
            self.line.word('S', speed);
        }
        self.line.spindle(spindle);
        self.end_line()
    }

    fn orient(
        &mut self,
        spindle: u8,
        degrees: f64,
        direction: OrientDirection,
        timeout_s: Option<f64>,
    ) -> Result<(), Unwritable> {
        self.line.begin("M19").word('R', degrees - self.orient_offset_degrees);
        match direction {
            OrientDirection::Shortest => {}
            OrientDirection::Clockwise => {
                self.line.word('P', 1);
            }
            OrientDirection::Counterclockwise => {
                self.line.word('P', 2);
            }
        }
        if let Some(timeout_s) = timeout_s {
            self.line.word('Q', timeout_s);
        }
        self.line.spindle(spindle);
        self.end_line()
    }

    /// Mist or flood was switched off; `other`: the other one is on.
    fn coolant_off(&mut self, other: bool) -> Result<(), Unwritable> {
        if other {
            self.waiting = Some(Waiting::Coolant);
            return Ok(());
        }
        self.plain("M9")
    }

    fn tool_entry(&mut self, entry: &ToolEntry) -> Result<(), Unwritable> {
        let old = self.tools.insert(entry.tool, *entry);
        // A table names the tool in the spindle twice.
        let told = self.entry.replace(*entry);
        if told.is_some_and(|told| ToolEntry { pocket: 0, ..told } == ToolEntry { pocket: 0, ..*entry }) {
            return Ok(());
        }
        self.line.begin("G10 L1").word('P', entry.tool);
        let old_offset = old.map_or(Position::ZERO, |old| old.offset);
        self.push_changed(old_offset, entry.offset);
        self.line
            .word('R', entry.diameter_mm / 2.0)
            .word('I', entry.front_angle_degrees)
            .word('J', entry.back_angle_degrees)
            .word('Q', entry.orientation);
        self.end_line()
    }

    fn wait_input(&mut self, input: Input, mode: WaitMode, timeout_s: f64) -> Result<(), Unwritable> {
        self.line.begin("M66");
        match input {
            Input::Digital(index) => self.line.word('P', index),
            Input::Analog(index) => self.line.word('E', index),
        };
        let mode = match mode {
            WaitMode::Immediate => 0,
            WaitMode::Rise => 1,
            WaitMode::Fall => 2,
            WaitMode::High => 3,
            WaitMode::Low => 4,
        };
        self.line.word('L', mode);
        if timeout_s != 0.0 {
            self.line.word('Q', timeout_s);
        }
        self.end_line()
    }

    fn user_code(&mut self, number: u8, p: f64, q: f64) -> Result<(), Unwritable> {
        if !(100..=199).contains(&number) {
            return Err(Unwritable::UserCode(number));
        }
        self.line.begin("").word('M', number);
        for (letter, value) in [('P', p), ('Q', q)] {
            if value != -1.0 {
                self.line.word(letter, value);
            }
        }
        self.end_line()
    }

    fn record(&mut self, record: &Record) -> Result<(), Unwritable> {
        match record {
            Record::Print(text) => self.remark("PRINT,", text),
            Record::OpenLog(path) => self.remark("LOGOPEN,", path),
            Record::AppendLog(path) => self.remark("LOGAPPEND,", path),
            Record::Log(text) => self.remark("LOG,", text),
            Record::CloseLog => self.plain("(LOGCLOSE)"),
            Record::OpenProbeLog(path) => self.remark("PROBEOPEN ", path),
            Record::CloseProbeLog => self.plain("(PROBECLOSE)"),
        }
    }

    /// `(word text)`; `word` is empty for a comment that does nothing.
    fn remark(&mut self, word: &str, text: &str) -> Result<(), Unwritable> {
        let inside = format!("{word}{text}");
        let (kind, start) = comment::read(inside.as_bytes());
        let values = matches!(kind, CommentKind::Print | CommentKind::Log);
        let breaks = |letter: char| matches!(letter, '(' | ')' | '\n' | '\r') || values && matches!(letter, '#' | '%');
        let means_the_same = match kind {
            CommentKind::Plain => word.is_empty(),
            _ => start == word.len(),
        };
        if !means_the_same || text.contains(breaks) {
            return Err(Unwritable::Text(text.to_string()));
        }
        if inside.len() + 2 > LINE_MAX {
            return Err(Unwritable::TooLong);
        }
        self.text.push('(');
        self.text.push_str(&inside);
        self.text.push_str(")\n");
        Ok(())
    }

    fn plain(&mut self, code: &str) -> Result<(), Unwritable> {
        self.line.begin(code);
        self.end_line()
    }

    fn one_word(&mut self, code: &str, letter: char, number: impl Into<f64>) -> Result<(), Unwritable> {
        self.line.begin(code).word(letter, number);
        self.end_line()
    }

    fn end_line(&mut self) -> Result<(), Unwritable> {
        self.push_line().map(|_| ())
    }

    fn push_line(&mut self) -> Result<Exactness, Unwritable> {
        self.line.push_to(&mut self.text).map_err(|error| match error {
            LineError::NotFinite(letter) => Unwritable::NotFinite(letter),
            LineError::TooLong => Unwritable::TooLong,
        })
    }
}

fn plane_code(plane: Plane) -> &'static str {
    match plane {
        Plane::Xy => "G17",
        Plane::Zx => "G18",
        Plane::Yz => "G19",
        Plane::Uv => "G17.1",
        Plane::Wu => "G18.1",
        Plane::Vw => "G19.1",
    }
}

/// The F word that is read back as `per_second`, or the nearest one.
fn per_minute(per_second: f64) -> f64 {
    let nearest = per_second * 60.0;
    [nearest, nearest.next_down(), nearest.next_up()]
        .into_iter()
        .find(|word| word / 60.0 == per_second)
        .unwrap_or(nearest)
}

/// The word by which an axis without ends goes from `at` to `to`: its sign is the direction, also that of -0, its
/// magnitude the place on the turn. `None`: it turns by a whole turn or more.
fn wrapped_word(at: f64, to: f64) -> Option<f64> {
    let place = Some(to.rem_euclid(360.0)).filter(|place| *place < 360.0).unwrap_or(0.0);
    let way = to - at;
    (way.abs() < 360.0).then_some(if way < 0.0 { -place } else { place })
}
