//! Calls to moves.
//!
//! In:  canonical calls.
//! Out: moves in machine coordinates with everything that holds for them, and what is to be done at rest.

mod curves;
mod moves;
mod spindle;

use super::frame::Frame;
use super::{PlanErrorKind, Settings};
use crate::canon::{Axis, Call, FeedMode, PathMode, Position, Record, SPINDLES, SpindleDirection, SpindleMode};
use crate::element::{Action, Auxiliary, Element, Enables, Outputs};
use crate::kinematics::ToolFrame;
use crate::path::{NO_MOVE, Piece};

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

/// A programmed move.
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
    Move(Move),
    /// Parts of one move, in order.
    Curve(Vec<Move>),
    /// Rest, as the axes mean something else from here on.
    Halt,
    /// A wait, an action, or motion from rest to rest in step with the spindle.
    Rest(Element),
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
    owed: Option<Move>,
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
        Some(Entry::Rest(element))
    }

    /// A spindle beside the first is told its speed and direction, at rest.
    fn turn_other(&mut self, spindle: u8, to: (f64, Option<SpindleDirection>), line: u32) -> Option<Entry> {
        *self.others.get_mut(usize::from(spindle))? = to;
        let rpm = to.1.map(|direction| match direction {
            SpindleDirection::Clockwise => to.0,
            SpindleDirection::Counterclockwise => -to.0,
        });
        let action = Action::TurnSpindle { spindle, rpm };
        Some(Entry::Rest(Element::Action { action, line }))
    }

    /// Outputs change with the next move, or at once at rest.
    fn set_outputs(&mut self, outputs: &Outputs, with_motion: bool, line: u32) -> Option<Entry> {
        if with_motion {
            self.outputs = self.outputs.with(outputs);
            return None;
        }
        self.auxiliary.outputs = self.auxiliary.outputs.with(outputs);
        let action = outputs.actions().next()?;
        Some(Entry::Rest(Element::Action { action, line }))
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
        let unsupported = |what| Err(PlanErrorKind::Unsupported(what));
        match call {
            // Moves.
            Call::StraightTraverse { to } => return self.straight(to, line, true, settings),
            Call::StraightFeed { to } => {
                return match self.pitch_mm {
                    Some(pitch_mm) => self.synced(to, pitch_mm, None, line, settings),
                    None => self.straight(to, line, false, settings),
                };
            }
            Call::RigidTap { to, return_scale } => {
                return match self.pitch_mm {
                    Some(pitch_mm) => self.synced(to, pitch_mm, Some(*return_scale), line, settings),
                    None => unsupported("rigid tapping (G33.1) without a pitch"),
                };
            }
            Call::ArcFeed { .. } if self.pitch_mm.is_some() => return unsupported("an arc in step with the spindle"),
            Call::ArcFeed { to, plane, centre_mm, turns } => {
                let piece = self.arc(to, *plane, *centre_mm, *turns)?;
                let end = self.frame.machine(to);
                if piece.length() <= NO_MOVE && moves::is_no_move(&self.start(), &end) {
                    return self.owe(end, line, false, settings).map(|()| None);
                }
                return self.accept(piece, end, line, false, settings).map(Entry::Move).map(Some);
            }
            Call::NurbsFeed { plane, points, order, knots } => {
                let order = *order;
                return self.curve(*plane, &curves::Nurbs { points, order, knots }, line, settings);
            }
            Call::StraightProbe { to, mode } => return self.probe(to, *mode, line, settings),
            Call::Dwell { seconds } => {
                let seconds = *seconds;
                return Ok(Some(Entry::Rest(Element::Dwell { seconds, line })));
            }
            // What holds for the moves that follow.
            Call::SetFeedRate { linear, angular } => {
                self.feed = (*linear > 0.0).then_some(Feed { mm_s: *linear, degrees_s: *angular });
            }
            Call::SetPathMode(mode) => self.mode = *mode,
            Call::EnableFeedOverride(on) => self.enables.feed_override = *on,
            Call::EnableSpeedOverride { spindle: 0, on } => self.enables.spindle_override = *on,
            Call::EnableAdaptiveFeed(on) => self.enables.adaptive_feed = *on,
            Call::EnableFeedHold(on) => self.enables.feed_hold = *on,
            Call::SetXyRotation { degrees } => self.frame.rotate(*degrees),
            Call::SetG5xOffset { origin, .. } => {
                self.frame.g5x = *origin;
                return Ok(self.centre_moved(settings).and_then(|action| self.act(action, line)));
            }
            Call::SetG92Offset { offset } => {
                self.frame.g92 = *offset;
                return Ok(self.centre_moved(settings).and_then(|action| self.act(action, line)));
            }
            Call::SetToolLengthOffset { offset } => {
                let length_mm = if self.tool_frame.tcp { offset[Axis::Z] } else { 0.0 };
                let entry = self.reframe(ToolFrame { length_mm, ..self.tool_frame }, settings)?;
                self.frame.tool = *offset;
                return match entry {
                    None => Ok(self.centre_moved(settings).and_then(|action| self.act(action, line))),
                    Some(_) => Ok(entry),
                };
            }
            Call::SetToolCentrePoint(on) => {
                let length_mm = if *on { self.frame.tool[Axis::Z] } else { 0.0 };
                return self.reframe(ToolFrame { tcp: *on, length_mm }, settings);
            }
            // The spindle.
            Call::StartSpindleSync { spindle: 1.., .. }
            | Call::SetFeedMode(FeedMode::PerTurn { spindle: 1.. })
            | Call::SetSpindleMode { spindle: 1.., mode: SpindleMode::ConstantSurfaceSpeed { .. } }
            | Call::OrientSpindle { spindle: 1.., .. }
            | Call::WaitSpindleOriented { spindle: 1.., .. } => {
                return unsupported("more of a second spindle ($1 and above) than S, M3, M4 and M5");
            }
            Call::SetSpindleMode { spindle: 1.., mode: SpindleMode::Rpm } => {}
            Call::SetSpindleSpeed { spindle: spindle @ 1.., speed } => {
                let direction = self.others.get(usize::from(*spindle)).and_then(|(_, direction)| *direction);
                let to = (*speed, direction);
                return Ok(self.turn_other(*spindle, to, line).filter(|_| direction.is_some()));
            }
            Call::StartSpindle { spindle: spindle @ 1.., direction, .. } => {
                let speed = self.others.get(usize::from(*spindle)).map_or(0.0, |(speed, _)| *speed);
                return Ok(self.turn_other(*spindle, (speed, Some(*direction)), line));
            }
            Call::StopSpindle { spindle: spindle @ 1.. } => {
                let (speed, before) = self.others.get(usize::from(*spindle)).copied().unwrap_or((0.0, None));
                return Ok(self.turn_other(*spindle, (speed, None), line).filter(|_| before.is_some()));
            }
            Call::StartSpindleSync { velocity: true, .. } => {
                return unsupported("motion at the speed of the spindle only");
            }
            Call::StartSpindleSync { .. } if !settings.spindle_encoder => return Err(PlanErrorKind::NoSpindleEncoder),
            Call::StartSpindleSync { mm_per_turn, .. } if !(mm_per_turn.is_finite() && *mm_per_turn != 0.0) => {
                return Err(PlanErrorKind::NotFinite);
            }
            Call::StartSpindleSync { mm_per_turn, .. } => self.pitch_mm = Some(mm_per_turn.abs()),
            Call::StopSpindleSync => self.pitch_mm = None,
            Call::SetFeedMode(mode) => self.per_turn = matches!(mode, FeedMode::PerTurn { .. }),
            // S follows, or holds again.
            Call::SetSpindleMode { mode, .. } => self.spindle_mode = *mode,
            Call::SetSpindleSpeed { speed, .. } => {
                self.speed = *speed;
                self.speed_changed = self.spindle.is_some();
                return Ok(self.spindle_on(settings).and_then(|action| self.act(action, line)));
            }
            Call::StartSpindle { direction, wait_for_speed, .. } => {
                self.orienting = false;
                self.spindle = Some(*direction);
                // A tap in a floating holder goes back while the spindle still comes to its speed.
                self.speed_changed = *wait_for_speed;
                return Ok(self.spindle_on(settings).and_then(|action| self.act(action, line)));
            }
            Call::OrientSpindle { degrees, direction, .. } => {
                (self.spindle, self.speed_changed, self.orienting) = (None, false, true);
                self.auxiliary.spindle = None;
                let action = Action::OrientSpindle { degrees: *degrees, direction: *direction };
                return Ok(Some(Entry::Rest(Element::Action { action, line })));
            }
            Call::WaitSpindleOriented { timeout_s, .. } => {
                self.orienting = false;
                let action = Action::AwaitOriented { timeout_s: Some(*timeout_s) };
                return Ok(Some(Entry::Rest(Element::Action { action, line })));
            }
            Call::StopSpindle { .. } => {
                self.orienting = false;
                self.spindle = None;
                self.speed_changed = false;
                return Ok(self.act(Action::SpindleOff, line));
            }
            // What is done between two moves.
            Call::Mist(on) => return Ok(self.act(Action::Mist(*on), line)),
            Call::Flood(on) => return Ok(self.act(Action::Flood(*on), line)),
            Call::SelectTool { tool } => return Ok(self.act(Action::SelectTool { tool: *tool }, line)),
            Call::ChangeTool { tool, .. } => return Ok(self.act(Action::ChangeTool { tool: *tool }, line)),
            Call::SetToolNumber { tool, .. } => return Ok(self.act(Action::SetTool { tool: *tool }, line)),
            // Lines that a program writes are numbered with its messages.
            Call::Message(_)
            | Call::Record(
                Record::Print(_) | Record::OpenLog(_) | Record::AppendLog(_) | Record::Log(_) | Record::CloseLog,
            ) => {
                let number = self.auxiliary.messages;
                return Ok(self.act(Action::Message { number }, line));
            }
            Call::SetDigitalOutput { index, on, with_motion } => {
                let mut outputs = Outputs::NONE;
                if !outputs.set_digital(*index, *on) {
                    return Err(PlanErrorKind::NoSuchOutput { index: *index });
                }
                return Ok(self.set_outputs(&outputs, *with_motion, line));
            }
            Call::SetAnalogOutput { index, value, with_motion } => {
                let mut outputs = Outputs::NONE;
                if !outputs.set_analog(*index, *value) {
                    return Err(PlanErrorKind::NoSuchOutput { index: *index });
                }
                return Ok(self.set_outputs(&outputs, *with_motion, line));
            }
            Call::WaitInput { input, mode, timeout_s } => {
                let action = Action::AwaitInput { input: *input, mode: *mode, timeout_s: *timeout_s };
                return Ok(Some(Entry::Rest(Element::Action { action, line })));
            }
            Call::UserCode { number, p, q } => {
                let action = Action::UserCode { number: *number, p: *p, q: *q };
                return Ok(Some(Entry::Rest(Element::Action { action, line })));
            }
            Call::ProgramStop => return Ok(self.act(Action::ProgramStop, line)),
            Call::OptionalProgramStop => return Ok(self.act(Action::OptionalStop, line)),
            Call::ProgramEnd => return Ok(self.act(Action::ProgramEnd, line)),
            Call::Finish => return Ok(self.act(Action::TextEnd, line)),
            // What this machine cannot do.
            Call::SetCutterCompensation(Some(_)) => {
                return unsupported("a programmed path with cutter compensation (G41, G42)");
            }
            // Of no consequence for motion: told for those who print, and for the process.
            Call::SelectPlane(_)
            | Call::UseLengthUnit(_)
            | Call::Comment(_)
            | Call::Record(Record::OpenProbeLog(_) | Record::CloseProbeLog)
            | Call::SetCutterCompensation(None)
            | Call::EnableSpeedOverride { .. } // of a spindle that there is not: M48 and M49 name all that could be
            | Call::StartChange
            | Call::SetToolEntry(_)
            | Call::ReloadToolTable
            | Call::SetPlanner { .. } // there is one planner, with limited jerk
            | Call::Probe(_)
            | Call::PalletShuttle
            | Call::Reset => {}
        }
        Ok(None)
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
        self.owed = owed.and_then(|owed| {
            let piece = Piece::line(start, end)?.in_frame(to);
            Some(Move { piece, ..owed })
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
