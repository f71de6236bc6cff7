//! Calls to moves.
//!
//! In:  canonical calls.
//! Out: moves in machine coordinates with everything that holds for them, and what is to be done at rest.

mod curves;
mod moves;
mod spindle;

use super::frame::Frame;
use super::{PlanErrorKind, Settings};
use crate::canon::{Axis, Call, PathMode, Position, Record, SPINDLES, SpindleDirection, SpindleMode};
use crate::element::{Action, Auxiliary, Element, Enables, Outputs};
use crate::kinematics::ToolFrame;
use crate::path::Piece;

/// What may happen to the path at the end of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Corner {
    /// Stays as it is.
    Exact,
    /// Stays as it is, and the machine comes to rest.
    Stop,
    /// May be rounded within this distance.
    Round(f64),
}

/// A programmed move. Stages hand it on in its box: it is large, and there are many of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
    pub(super) piece: Piece,
    /// Infinite for rapid moves.
    pub(super) feed: f64,
    pub(super) line: u32,
    pub(super) rapid: bool,
    pub(super) enables: Enables,
    pub(super) auxiliary: Auxiliary,
    /// As [`Source::modes`](crate::canon::Source::modes) says.
    pub(super) modes: u32,
    /// At its end.
    pub(super) corner: Corner,
    /// Q of G64: how far the ends of moves in line may be off for these to become one, mm; 0: not at all.
    pub(super) naive_cam_mm: f64,
}

impl Move {
    /// Whether the spindle leads its feed (G95).
    pub(super) fn is_led(&self) -> bool {
        self.enables.spindle_speed && !self.rapid
    }
}

/// A feed that is set.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Feed {
    mm_s: f64,
    degrees_s: f64,
}

/// What a call comes to.
#[derive(Clone, Debug)]
pub(super) enum Entry {
    Move(Box<Move>),
    /// Parts of one move, in order.
    Curve(Vec<Box<Move>>),
    /// Rest, as the axes mean something else from here on.
    Halt,
    /// A wait, an action, or motion from rest to rest in step with the spindle.
    Rest(Box<Element>),
}

impl Entry {
    pub(super) fn rest(element: Element) -> Entry {
        Entry::Rest(Box::new(element))
    }
}

/// State of the program as far as motion is concerned.
#[derive(Debug)]
pub(super) struct Program {
    frame: Frame,
    /// How the axes are meant.
    tool_frame: ToolFrame,
    /// Where the program is.
    position: Position,
    /// The way there from where the axes are, if that is no move.
    owed: Option<Box<Move>>,
    feed: Option<Feed>,
    /// G95: `feed` counts way per turn, not per second.
    per_turn: bool,
    /// Way per turn of the moves in step with the spindle that follow, mm.
    pitch_mm: Option<f64>,
    /// What acts on the moves that follow from outside. A move in step with the spindle takes no notice of it.
    enables: Enables,
    mode: PathMode,
    spindle: Option<SpindleDirection>,
    /// S: 1/min or, with a speed of the surface, m/min.
    speed: f64,
    spindle_mode: SpindleMode,
    /// The spindle was told another speed, and no feed move has come since.
    speed_changed: bool,
    /// Speed and direction of the spindles beside the first.
    others: [(f64, Option<SpindleDirection>); SPINDLES],
    /// An M19 whose end nobody has waited for.
    orienting: bool,
    /// What has been told to spindle, coolant, tool changer and operator.
    auxiliary: Auxiliary,
    /// Outputs that are to change as the next move begins (M62, M63, M67).
    outputs: Outputs,
    /// Actions that the next move brings about where it begins; at rest if none follows.
    on_the_way: Vec<Element>,
    /// Number of the modes in force, and of those that a move or a rest has brought.
    modes: u32,
    modes_told: u32,
}

/// Actions for which the machine does not come to rest between two moves, at the most.
const ON_THE_WAY_MAX: usize = 16;

impl Program {
    pub(super) fn new(start: Position) -> Program {
        Program {
            frame: Frame::default(),
            tool_frame: ToolFrame::OFF,
            position: start,
            owed: None,
            feed: None,
            per_turn: false,
            pitch_mm: None,
            enables: Enables::INITIAL,
            mode: PathMode::ExactPath,
            spindle: None,
            speed: 0.0,
            spindle_mode: SpindleMode::Rpm,
            speed_changed: false,
            others: [(0.0, None); SPINDLES],
            orienting: false,
            auxiliary: Auxiliary::INITIAL,
            outputs: Outputs::NONE,
            on_the_way: Vec::new(),
            modes: 0,
            modes_told: 0,
        }
    }

    /// The calls that follow run in the modes of this number.
    pub(super) fn use_modes(&mut self, number: u32) {
        self.modes = number;
    }

    /// The modes in force, if neither a move nor a rest has brought them: told once.
    pub(super) fn take_modes(&mut self) -> Option<Action> {
        let number = self.modes;
        (std::mem::replace(&mut self.modes_told, number) != number).then_some(Action::Modes { number })
    }

    /// What an action comes to: where moves are passed on the move, it is done as the next one begins, if it can be.
    fn act(&mut self, action: Action, line: u32) -> Option<Entry> {
        let element = Element::Action { action, line };
        let passed = self.mode != PathMode::ExactStop && self.on_the_way.len() < ON_THE_WAY_MAX;
        let after = self.auxiliary.after(action);
        self.auxiliary = after.unwrap_or(self.auxiliary);
        if after.is_some() && passed {
            self.on_the_way.push(element);
            return None;
        }
        Some(Entry::rest(element))
    }

    /// An output changes with the next move, or at once at rest; `set` says whether there is one of this number.
    fn set_output(
        &mut self,
        index: u8,
        set: impl FnOnce(&mut Outputs) -> bool,
        with_motion: bool,
        line: u32,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        let mut outputs = Outputs::NONE;
        if !set(&mut outputs) {
            return Err(PlanErrorKind::NoSuchOutput { index });
        }
        if with_motion {
            self.outputs = self.outputs.with(&outputs);
            return Ok(None);
        }
        self.auxiliary.outputs = self.auxiliary.outputs.with(&outputs);
        let action = outputs.actions().next();
        Ok(action.map(|action| Entry::rest(Element::Action { action, line })))
    }

    /// Outputs that change as the move of the moment begins; at rest before it, if the plan does not know when that is.
    pub(super) fn take_outputs(&mut self) -> Outputs {
        let outputs = std::mem::replace(&mut self.outputs, Outputs::NONE);
        self.auxiliary.outputs = self.auxiliary.outputs.with(&outputs);
        outputs
    }

    /// A move has begun: it brings about what was said before it.
    pub(super) fn begins(&mut self) {
        self.on_the_way.clear();
        self.modes_told = self.modes;
    }

    /// No move follows before the next rest: what was said is to be done there.
    pub(super) fn take_on_the_way(&mut self) -> Vec<Element> {
        std::mem::take(&mut self.on_the_way)
    }

    /// What the spindle is to be waited for before this call. Told once.
    pub(super) fn take_wait(&mut self, call: &Call, settings: &Settings) -> Option<Action> {
        if self.orienting && is_kept_back_by_orientation(call) {
            self.orienting = false;
            return Some(Action::AwaitOriented { timeout_s: None });
        }
        // On a rapid move a constant speed of the surface may come to be quite another one of the spindle.
        let rapid = matches!(call, Call::StraightTraverse { .. });
        self.speed_changed |= rapid && self.spindle.is_some() && self.surface().is_some();
        let cuts = matches!(
            call,
            Call::StraightFeed { .. } | Call::ArcFeed { .. } | Call::NurbsFeed { .. } | Call::RigidTap { .. }
        );
        (cuts && std::mem::take(&mut self.speed_changed) && settings.await_spindle).then_some(Action::AwaitSpindle)
    }

    /// What a call comes to, if anything. On an error the position stays, and the call is of no effect.
    pub(super) fn run(&mut self, line: u32, call: &Call, settings: &Settings) -> Result<Option<Entry>, PlanErrorKind> {
        let at_rest = |action| Ok(Some(Entry::rest(Element::Action { action, line })));
        match call {
            // Moves.
            Call::StraightTraverse { to } => return self.straight(to, line, true, settings),
            Call::StraightFeed { to } => return self.straight_feed(to, line, settings),
            Call::RigidTap { to, return_scale } => return self.tap(to, *return_scale, line, settings),
            Call::ArcFeed {
                to,
                plane,
                centre_mm,
                turns,
            } => return self.arc_feed(to, *plane, *centre_mm, *turns, line, settings),
            Call::NurbsFeed {
                plane,
                points,
                order,
                knots,
            } => return self.curve(*plane, points, *order, knots, line, settings),
            Call::StraightProbe { to, mode } => return self.probe(to, *mode, line, settings),
            // What holds for the moves that follow.
            &Call::SetFeedRate { linear, angular } => self.set_feed(linear, angular),
            Call::SetFeedMode(mode) => self.set_feed_mode(*mode)?,
            Call::SetPathMode(mode) => self.mode = *mode,
            Call::EnableFeedOverride(on) => self.enables.feed_override = *on,
            Call::EnableSpeedOverride { spindle: 0, on } => self.enables.spindle_override = *on,
            Call::EnableAdaptiveFeed(on) => self.enables.adaptive_feed = *on,
            Call::EnableFeedHold(on) => self.enables.feed_hold = *on,
            Call::SetXyRotation { degrees } => self.frame.rotate(*degrees),
            Call::SetG5xOffset { origin, .. } => {
                self.frame.g5x = *origin;
                return Ok(self.tell_centre(line, settings));
            }
            Call::SetG92Offset { offset } => {
                self.frame.g92 = *offset;
                return Ok(self.tell_centre(line, settings));
            }
            Call::SetToolLengthOffset { offset } => return self.set_tool_offset(offset, line, settings),
            Call::SetToolCentrePoint(on) => return self.set_tool_centre_point(*on, settings),
            // The spindle.
            &Call::SetSpindleMode { spindle, mode } => self.set_spindle_mode(spindle, mode)?,
            &Call::SetSpindleSpeed { spindle, speed } => return Ok(self.set_speed(spindle, speed, line, settings)),
            &Call::StartSpindle {
                spindle,
                direction,
                wait_for_speed,
            } => return Ok(self.start_spindle(spindle, direction, wait_for_speed, line, settings)),
            Call::StopSpindle { spindle } => return Ok(self.stop_spindle(*spindle, line)),
            &Call::OrientSpindle {
                spindle,
                degrees,
                direction,
            } => return at_rest(self.orient(spindle, degrees, direction)?),
            &Call::WaitSpindleOriented { spindle, timeout_s } => return at_rest(self.oriented(spindle, timeout_s)?),
            &Call::StartSpindleSync {
                spindle,
                mm_per_turn,
                velocity,
            } => self.start_sync(spindle, mm_per_turn, velocity, settings)?,
            Call::StopSpindleSync => self.pitch_mm = None,
            // What is done between two moves.
            &Call::Dwell { seconds } => return Ok(Some(Entry::rest(Element::Dwell { seconds, line }))),
            Call::Mist(on) => return Ok(self.act(Action::Mist(*on), line)),
            Call::Flood(on) => return Ok(self.act(Action::Flood(*on), line)),
            &Call::SelectTool { tool } => return Ok(self.act(Action::SelectTool { tool }, line)),
            &Call::ChangeTool { tool, .. } => return Ok(self.act(Action::ChangeTool { tool }, line)),
            &Call::SetToolNumber { tool, .. } => return Ok(self.act(Action::SetTool { tool }, line)),
            // Lines that a program writes are numbered with its messages.
            Call::Message(_)
            | Call::Record(
                Record::Print(_) | Record::OpenLog(_) | Record::AppendLog(_) | Record::Log(_) | Record::CloseLog,
            ) => {
                let number = self.auxiliary.messages;
                return Ok(self.act(Action::Message { number }, line));
            }
            &Call::SetDigitalOutput { index, on, with_motion } => {
                return self.set_output(index, |outputs| outputs.set_digital(index, on), with_motion, line);
            }
            &Call::SetAnalogOutput {
                index,
                value,
                with_motion,
            } => return self.set_output(index, |outputs| outputs.set_analog(index, value), with_motion, line),
            &Call::WaitInput { input, mode, timeout_s } => {
                return at_rest(Action::AwaitInput { input, mode, timeout_s });
            }
            &Call::UserCode { number, p, q } => return at_rest(Action::UserCode { number, p, q }),
            Call::ProgramStop => return Ok(self.act(Action::ProgramStop, line)),
            Call::OptionalProgramStop => return Ok(self.act(Action::OptionalStop, line)),
            Call::ProgramEnd => return Ok(self.act(Action::ProgramEnd, line)),
            Call::Finish => return Ok(self.act(Action::TextEnd, line)),
            // What this machine cannot do.
            Call::SetCutterCompensation(Some(_)) => {
                let what = "a programmed path with cutter compensation (G41, G42)";
                return Err(PlanErrorKind::Unsupported(what));
            }
            // Of no consequence for motion: told for those who print, and for the process. There is one planner, with limited jerk; and
            // M48 and M49 name all spindles that could be.
            Call::SelectPlane(_)
            | Call::UseLengthUnit(_)
            | Call::Comment(_)
            | Call::Record(Record::OpenProbeLog(_) | Record::CloseProbeLog)
            | Call::SetCutterCompensation(None)
            | Call::EnableSpeedOverride { .. }
            | Call::StartChange
            | Call::SetToolEntry(_)
            | Call::ReloadToolTable
            | Call::SetPlanner { .. }
            | Call::Probe(_)
            | Call::PalletShuttle
            | Call::Reset => {}
        }
        Ok(None)
    }

    fn set_feed(&mut self, mm_s: f64, degrees_s: f64) {
        self.feed = (mm_s > 0.0).then_some(Feed { mm_s, degrees_s });
    }

    /// The zero of X may be another place now: tells the spindle what that is for the speed of its surface.
    fn tell_centre(&mut self, line: u32, settings: &Settings) -> Option<Entry> {
        let action = self.centre_moved(settings)?;
        self.act(action, line)
    }

    fn set_tool_offset(
        &mut self,
        offset: &Position,
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        let length_mm = if self.tool_frame.tcp { offset[Axis::Z] } else { 0.0 };
        let tool_frame = ToolFrame {
            length_mm,
            ..self.tool_frame
        };
        let entry = self.reframe(tool_frame, settings)?;
        self.frame.tool = *offset;
        Ok(entry.or_else(|| self.tell_centre(line, settings)))
    }

    fn set_tool_centre_point(&mut self, on: bool, settings: &Settings) -> Result<Option<Entry>, PlanErrorKind> {
        let length_mm = if on { self.frame.tool[Axis::Z] } else { 0.0 };
        self.reframe(ToolFrame { tcp: on, length_mm }, settings)
    }

    /// The axes rest somewhere on the way of the last move.
    pub(super) fn stands_at(&mut self, position: Position) {
        self.position = position;
        self.owed = None;
    }

    /// Work coordinates of a machine position.
    pub(super) fn to_work(&self, machine: &Position) -> Position {
        self.frame.work(machine)
    }

    /// How the axes are meant at present.
    pub(super) fn tool_frame(&self) -> ToolFrame {
        self.tool_frame
    }

    /// Axes are meant otherwise from here on; no joint moves.
    fn reframe(&mut self, to: ToolFrame, settings: &Settings) -> Result<Option<Entry>, PlanErrorKind> {
        if to == self.tool_frame {
            return Ok(None);
        }
        let Some(joints) = settings.joints.as_ref().filter(|joints| joints.kinematics.has_tcp()) else {
            return Err(PlanErrorKind::NoToolCentrePoint);
        };
        let from = self.tool_frame;
        let reframed = |position: Position| {
            joints
                .kinematics
                .reframe(&position, &from, &to)
                .map_err(|unreachable| PlanErrorKind::Unreachable {
                    unreachable,
                    place: Box::new(position),
                })
        };
        let (start, end) = (reframed(self.start())?, reframed(self.position)?);
        self.position = end;
        let owed = self.owed.take();
        self.owed = owed.and_then(|mut owed| {
            owed.piece = Piece::line(start, end)?.in_frame(to);
            Some(owed)
        });
        self.tool_frame = to;
        Ok(Some(Entry::Halt))
    }
}

/// Whether a call waits for the angle of an M19 without Q: whatever moves, takes time or has others act on the machine.
fn is_kept_back_by_orientation(call: &Call) -> bool {
    matches!(
        call,
        Call::StraightTraverse { .. }
            | Call::StraightFeed { .. }
            | Call::ArcFeed { .. }
            | Call::NurbsFeed { .. }
            | Call::StraightProbe { .. }
            | Call::RigidTap { .. }
            | Call::Dwell { .. }
            | Call::ChangeTool { .. }
            | Call::WaitInput { .. }
            | Call::UserCode { .. }
            | Call::ProgramStop
            | Call::OptionalProgramStop
    )
}

#[cfg(test)]
mod tests;
