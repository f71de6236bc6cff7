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
//!
//! This file has the writer and the table of all calls; each subject has a file of its own beside it.

mod devices;
mod error;
mod line;
mod modes;
mod moves;
mod offsets;
mod remark;
#[cfg(test)]
mod tests;
mod waiting;

pub use error::{FlatError, Unwritable};

use crate::state::Offsets;
use crate::{Settings, ToolChangePlace};
use devices::Tools;
use line::{Exactness, Line};
use modes::Feed;
use motion::canon::{AXES, Call, Event, OrientDirection, Plane, Position, Source, SpindleMode};
use std::io;

/// Offsets and positions nearer than this are the same, mm or degrees: rounding by changes of units and origins.
const SAME_MM_OR_DEGREES: f64 = 1e-9;

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
    feed: Feed,
    tools: Tools,
    /// R of the G64 that comes next.
    planner: Option<f64>,
    mist: bool,
    flood: bool,
    /// The spindle and mm per turn of the moves that come next.
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
        let offsets = Offsets::at_start(settings);
        FlatWriter {
            begun: false,
            planner: None,
            at: offsets.work(settings.start),
            known: [true; AXES],
            offsets,
            origins: settings.work_offsets,
            rotations_degrees: settings.work_rotations_degrees,
            plane: Plane::Xy,
            feed: Feed::at_start(),
            tools: Tools::at_start(settings),
            mist: false,
            flood: false,
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
            .write_waiting(&event.call)
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
            Some(waiting) => self.write_alone(waiting),
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

    /// What each call comes to.
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
            Call::NurbsFeed {
                plane,
                points,
                order,
                knots,
            } => self.nurbs(*plane, points, *order, knots),
            Call::Dwell { seconds } => self.one_word("G4", 'P', *seconds),
            Call::StartSpindleSync {
                spindle,
                mm_per_turn,
                velocity,
            } => self.start_spindle_sync(*spindle, *mm_per_turn, *velocity),
            Call::StopSpindleSync => {
                self.synchronised = None;
                Ok(())
            }
            Call::SetFeedMode(mode) => self.feed_mode(*mode),
            Call::SetFeedRate { linear, angular } => {
                self.feed.set_rate(*linear, *angular);
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
            Call::SetToolCentrePoint(_) => Err(Unwritable::ToolCentrePoint),
            Call::SetCutterCompensation(cutter) => self.compensation(*cutter),
            Call::SetSpindleMode { spindle, mode } => {
                let (spindle, mode) = (*spindle, *mode);
                self.wait(Waiting::SpindleMode { spindle, mode })
            }
            Call::SetSpindleSpeed { spindle, speed } => {
                self.line.begin("").word('S', *speed).spindle(*spindle);
                self.end_line()
            }
            Call::StartSpindle {
                spindle,
                direction,
                wait_for_speed,
            } => self.start_spindle(*spindle, *direction, *wait_for_speed),
            Call::StopSpindle { spindle } => {
                self.line.begin("M5").spindle(*spindle);
                self.end_line()
            }
            Call::OrientSpindle {
                spindle,
                degrees,
                direction,
            } => {
                let (spindle, degrees, direction) = (*spindle, *degrees, *direction);
                self.wait(Waiting::Orient {
                    spindle,
                    degrees,
                    direction,
                })
            }
            Call::WaitSpindleOriented { .. } => Err(Unwritable::WaitWithoutOrient),
            Call::Mist(on) => self.mist(*on),
            Call::Flood(on) => self.flood(*on),
            Call::SelectTool { tool } => self.select_tool(*tool),
            Call::ChangeTool { tool, pocket: _ } => self.change_tool(*tool),
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
            Call::SetDigitalOutput { index, on, with_motion } => self.digital_output(*index, *on, *with_motion),
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
            Call::Comment(text) => self.comment(text),
            Call::Record(record) => self.record(record),
            Call::ProgramStop => self.stop("M0", "M60"),
            Call::OptionalProgramStop => self.plain("M1"),
            Call::PalletShuttle => {
                self.pallet = true;
                Ok(())
            }
            Call::ProgramEnd => self.stop("M2", "M30"),
            // Other codes bring these about, and the unit is always mm.
            Call::UseLengthUnit(_) | Call::Probe(_) | Call::StartChange | Call::Reset => Ok(()),
            Call::Finish => Ok(()), // the text always ends with a %
        }
    }
}

/// Lines, for all subjects.
impl FlatWriter {
    /// The call is written together with the one behind it.
    fn wait(&mut self, waiting: Waiting) -> Result<(), Unwritable> {
        self.waiting = Some(waiting);
        Ok(())
    }

    /// A stop by its code, or by that which changes the pallets, too.
    fn stop(&mut self, code: &str, with_pallets: &str) -> Result<(), Unwritable> {
        let code = if std::mem::take(&mut self.pallet) {
            with_pallets
        } else {
            code
        };
        self.plain(code)
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
        Ok(self.line.push_to(&mut self.text)?)
    }
}
