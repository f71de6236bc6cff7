//! Calls to moves.
//!
//! In:  canonical calls.
//! Out: moves in machine coordinates with everything that holds for them, and what is to be done at rest.

mod curves;

use std::f64::consts::TAU;

use super::frame::{Frame, check_axes, check_travel};
use super::limits::Bounds;
use super::probing;
use super::{PlanErrorKind, Settings};
use crate::canon::{Axis, Call, FeedMode, PathMode, Plane, Position, ProbeMode, SpindleDirection, SpindleMode};
use crate::element::{Action, Element, Enables, Probing, Surface, Synced, Tap};
use crate::kinematics::ToolFrame;
use crate::path::{Circle, Group, Piece};
use crate::rt::MotionLimits;

/// Most turns of an arc: its knots, some dozens a turn, are in memory together.
const TURNS_MAX: u32 = 1000;

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
    /// At its end.
    pub(super) corner: Corner,
    /// Q of G64: how far the ends of moves in line may be off for these to become one, mm; 0: not at all.
    pub(super) naive_cam_mm: f64,
}

/// A feed that is set.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Feed {
    mm_s: f64,
    degrees_s: f64,
}

/// Turns behind the depth of a tap within which the spindle must have come to rest, if the travel leaves as many.
const RUN_DOWN_TURNS: f64 = 10.0;

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
    position: Position,
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
    messages: u32,
}

impl Program {
    pub(super) fn new(start: Position) -> Program {
        Program {
            frame: Frame::default(),
            tool_frame: ToolFrame::OFF,
            position: start,
            feed: None,
            per_turn: false,
            pitch_mm: None,
            enables: Enables::INITIAL,
            mode: PathMode::ExactPath,
            spindle: None,
            speed: 0.0,
            spindle_mode: SpindleMode::Rpm,
            speed_changed: false,
            messages: 0,
        }
    }

    /// Whether the spindle is to be waited for before this call. Told once.
    pub(super) fn take_wait(&mut self, call: &Call, settings: &Settings) -> bool {
        // On a rapid move a constant speed of the surface may come to be quite another one of the spindle.
        let rapid = matches!(call, Call::StraightTraverse { .. });
        self.speed_changed |= rapid && self.spindle.is_some() && self.surface().is_some();
        let cuts = matches!(
            call,
            Call::StraightFeed { .. } | Call::ArcFeed { .. } | Call::NurbsFeed { .. } | Call::RigidTap { .. }
        );
        cuts && std::mem::take(&mut self.speed_changed) && settings.await_spindle
    }

    /// On an error the position stays, and the call is of no effect.
    pub(super) fn take(&mut self, line: u32, call: &Call, settings: &Settings) -> Result<Option<Entry>, PlanErrorKind> {
        let rest = |action| Ok(Some(Entry::Rest(Element::Action { action, line })));
        let unsupported = |what| Err(PlanErrorKind::Unsupported(what));
        match call {
            Call::StraightTraverse { to } => self.straight(to, line, true, settings),
            Call::StraightFeed { to } => match self.pitch_mm {
                Some(pitch_mm) => self.synced(to, pitch_mm, None, line, settings),
                None => self.straight(to, line, false, settings),
            },
            Call::RigidTap { to, return_scale } => match self.pitch_mm {
                Some(pitch_mm) => self.synced(to, pitch_mm, Some(*return_scale), line, settings),
                None => unsupported("rigid tapping (G33.1) without a pitch"),
            },
            Call::ArcFeed { .. } if self.pitch_mm.is_some() => unsupported("an arc in step with the spindle"),
            Call::ArcFeed {
                to,
                plane,
                centre_mm,
                turns,
            } => {
                let piece = self.arc(to, *plane, *centre_mm, *turns)?;
                let end = self.frame.machine(to);
                self.accept(piece, end, line, false, settings).map(Entry::Move).map(Some)
            }
            Call::Dwell { seconds } => Ok(Some(Entry::Rest(Element::Dwell {
                seconds: *seconds,
                line,
            }))),
            Call::SetFeedRate { linear, angular } => {
                self.feed = (*linear > 0.0).then_some(Feed {
                    mm_s: *linear,
                    degrees_s: *angular,
                });
                Ok(None)
            }
            Call::SetPathMode(mode) => {
                self.mode = *mode;
                Ok(None)
            }
            // Of no consequence for motion: told for those who print, and for the process.
            Call::SelectPlane(_)
            | Call::UseLengthUnit(_)
            | Call::Comment(_)
            | Call::Record(_)
            | Call::SetCutterCompensation(None)
            | Call::StartChange
            | Call::SetToolEntry(_)
            | Call::ReloadToolTable
            | Call::SetPlanner { .. } // there is one planner, with limited jerk
            | Call::Probe(_)
            | Call::Reset
            | Call::Finish => Ok(None),
            Call::EnableFeedOverride(on) => {
                self.enables.feed_override = *on;
                Ok(None)
            }
            Call::EnableSpeedOverride { spindle: 0, on } => {
                self.enables.spindle_override = *on;
                Ok(None)
            }
            // There is no other spindle: M48 and M49 name all that could be.
            Call::EnableSpeedOverride { .. } => Ok(None),
            Call::EnableAdaptiveFeed(on) => {
                self.enables.adaptive_feed = *on;
                Ok(None)
            }
            Call::EnableFeedHold(on) => {
                self.enables.feed_hold = *on;
                Ok(None)
            }
            Call::SetCutterCompensation(Some(_)) => {
                unsupported("a programmed path with cutter compensation (G41, G42)")
            }
            Call::StraightProbe { to, mode } => self.probe(to, *mode, line, settings),
            Call::NurbsFeed {
                plane,
                points,
                order,
                knots,
            } => {
                let order = *order;
                self.curve(*plane, &curves::Nurbs { points, order, knots }, line, settings)
            }
            Call::StartSpindleSync { spindle: 1.., .. } | Call::SetFeedMode(FeedMode::PerTurn { spindle: 1.. }) => {
                unsupported("a second spindle ($1 and above)")
            }
            Call::StartSpindleSync { velocity: true, .. } => unsupported("motion at the speed of the spindle only"),
            Call::StartSpindleSync { mm_per_turn, .. } => {
                if !settings.spindle_encoder {
                    return Err(PlanErrorKind::NoSpindleEncoder);
                }
                if !(mm_per_turn.is_finite() && *mm_per_turn != 0.0) {
                    return Err(PlanErrorKind::NotFinite);
                }
                self.pitch_mm = Some(mm_per_turn.abs());
                Ok(None)
            }
            Call::StopSpindleSync => {
                self.pitch_mm = None;
                Ok(None)
            }
            Call::SetFeedMode(mode) => {
                self.per_turn = matches!(mode, FeedMode::PerTurn { .. });
                Ok(None)
            }
            Call::SetSpindleMode { spindle: 1.., .. } => unsupported("a second spindle ($1 and above)"),
            // S follows, or holds anew.
            Call::SetSpindleMode { mode, .. } => {
                self.spindle_mode = *mode;
                Ok(None)
            }
            Call::OrientSpindle { .. } | Call::WaitSpindleOriented { .. } => {
                unsupported("orientation of the spindle (M19)")
            }
            Call::SetDigitalOutput { .. } => unsupported("digital outputs (M62 to M65)"),
            Call::SetAnalogOutput { .. } => unsupported("analog outputs (M67, M68)"),
            Call::WaitInput { .. } => unsupported("waiting for an input (M66)"),
            Call::UserCode { .. } => unsupported("codes of the user (M100 to M199)"),
            Call::PalletShuttle => Ok(None),
            Call::SetG5xOffset { origin, .. } => {
                self.frame.g5x = *origin;
                self.centre_moved(settings).map_or(Ok(None), rest)
            }
            Call::SetG92Offset { offset } => {
                self.frame.g92 = *offset;
                self.centre_moved(settings).map_or(Ok(None), rest)
            }
            Call::SetXyRotation { degrees } => {
                self.frame.rotate(*degrees);
                Ok(None)
            }
            Call::SetToolLengthOffset { offset } => {
                let tool_frame = ToolFrame {
                    length_mm: if self.tool_frame.tcp { offset[Axis::Z] } else { 0.0 },
                    ..self.tool_frame
                };
                let entry = self.reframe(tool_frame, settings)?;
                self.frame.tool = *offset;
                match entry {
                    None => self.centre_moved(settings).map_or(Ok(None), rest),
                    Some(_) => Ok(entry),
                }
            }
            Call::SetToolCentrePoint(on) => {
                let tool_frame = ToolFrame {
                    tcp: *on,
                    length_mm: if *on { self.frame.tool[Axis::Z] } else { 0.0 },
                };
                self.reframe(tool_frame, settings)
            }
            Call::SetSpindleSpeed { spindle: 1.., .. }
            | Call::StartSpindle { spindle: 1.., .. }
            | Call::StopSpindle { spindle: 1.. } => unsupported("a second spindle ($1 and above)"),
            Call::SetSpindleSpeed { speed, .. } => {
                self.speed = *speed;
                self.speed_changed = self.spindle.is_some();
                self.spindle_on(settings).map_or(Ok(None), rest)
            }
            Call::StartSpindle {
                direction,
                wait_for_speed,
                ..
            } => {
                self.spindle = Some(*direction);
                // A tap in a floating holder goes back while the spindle still comes to its speed.
                self.speed_changed = *wait_for_speed;
                self.spindle_on(settings).map_or(Ok(None), rest)
            }
            Call::StopSpindle { .. } => {
                self.spindle = None;
                self.speed_changed = false;
                rest(Action::SpindleOff)
            }
            Call::Mist(on) => rest(Action::Mist(*on)),
            Call::Flood(on) => rest(Action::Flood(*on)),
            Call::SelectTool { tool } => rest(Action::SelectTool { tool: *tool }),
            Call::ChangeTool { tool, .. } => rest(Action::ChangeTool { tool: *tool }),
            Call::SetToolNumber { tool, .. } => rest(Action::SetTool { tool: *tool }),
            Call::Message(_) => {
                self.messages += 1;
                rest(Action::Message {
                    number: self.messages - 1,
                })
            }
            Call::ProgramStop => rest(Action::ProgramStop),
            Call::OptionalProgramStop => rest(Action::OptionalStop),
            Call::ProgramEnd => rest(Action::ProgramEnd),
        }
    }

    /// The axes rest somewhere on the way of the last move.
    pub(super) fn stands_at(&mut self, position: Position) {
        self.position = position;
    }

    /// Work coordinates of a machine position.
    pub(super) fn to_work(&self, machine: &Position) -> Position {
        self.frame.work(machine)
    }

    /// A straight move until a contact changes, from rest to rest.
    fn probe(
        &mut self,
        to: &Position,
        mode: ProbeMode,
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        match self.straight(to, line, false, settings)? {
            Some(Entry::Move(Move { piece, feed, line, .. })) => {
                let limits = probing::limits_along(&piece, settings)?;
                Ok(Some(Entry::Rest(Element::Probing(Probing {
                    piece,
                    mode,
                    feed,
                    limits,
                    line,
                }))))
            }
            // Nobody must wait for a move that never comes.
            None => Err(PlanErrorKind::Unsupported("a probing move of no length")),
            other => Ok(other),
        }
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
        self.position = joints
            .kinematics
            .reframe(&self.position, &self.tool_frame, &to)
            .map_err(|unreachable| PlanErrorKind::Unreachable {
                unreachable,
                place: Box::new(self.position),
            })?;
        self.tool_frame = to;
        Ok(Some(Entry::Halt))
    }

    /// The constant speed of the surface, if it is in force.
    fn surface(&self) -> Option<Surface> {
        match self.spindle_mode {
            SpindleMode::Rpm => None,
            SpindleMode::ConstantSurfaceSpeed { .. } => Some(Surface {
                m_per_minute: self.speed,
                centre_mm: self.frame.machine(&Position::ZERO)[Axis::X],
            }),
        }
    }

    /// Speed of the spindle as programmed, 1/min; with a speed of the surface, the highest.
    fn rpm(&self, settings: &Settings) -> f64 {
        match self.spindle_mode {
            SpindleMode::Rpm => self.speed,
            SpindleMode::ConstantSurfaceSpeed { max_rpm } => {
                max_rpm.unwrap_or(f64::INFINITY).min(settings.spindle_rpm_max)
            }
        }
    }

    /// What the spindle is to be told; `None`: it stands.
    fn spindle_on(&self, settings: &Settings) -> Option<Action> {
        Some(Action::SpindleOn {
            rpm: self.rpm(settings),
            direction: self.spindle?,
            surface: self.surface(),
        })
    }

    /// What the spindle is to be told where zero of X may be another place now.
    fn centre_moved(&self, settings: &Settings) -> Option<Action> {
        self.surface()?;
        self.spindle_on(settings)
    }

    /// Turns per second for which feed by turns is planned: as programmed or, with a speed of the surface, the most. What the
    /// spindle does less, the interpolation makes up for.
    fn turns_s(&self, settings: &Settings) -> Result<f64, PlanErrorKind> {
        let rpm = self.rpm(settings);
        let turns = self.spindle.is_some() && self.speed > 0.0 && rpm > 0.0;
        turns.then_some(rpm / 60.0).ok_or(PlanErrorKind::SpindleStands)
    }

    /// The highest speed on the way from one place to another, turns/s.
    fn turns_s_between(&self, from: f64, to: f64, settings: &Settings) -> Result<f64, PlanErrorKind> {
        let most = self.turns_s(settings)?;
        Ok(self.surface().map_or(most, |surface| {
            let [low, high] = [from.min(to), from.max(to)];
            let nearest = surface.centre_mm.clamp(low, high);
            most.min(surface.rpm(nearest) / 60.0)
        }))
    }

    /// A straight move in step with the spindle, from rest to rest; `return_scale`: there and back.
    fn synced(
        &mut self,
        to: &Position,
        pitch_mm: f64,
        return_scale: Option<f64>,
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        if let Some(joints) = &settings.joints
            && !joints.kinematics.is_trivial(&self.tool_frame)
        {
            return Err(PlanErrorKind::Unsupported(
                "motion in step with the spindle where joints are not axes",
            ));
        }
        let end = self.frame.machine(to);
        if end.0.iter().any(|x| !x.is_finite()) {
            return Err(PlanErrorKind::NotFinite);
        }
        let turns_s = self.turns_s_between(self.position[Axis::X], end[Axis::X], settings)?;
        let Some(way) = Piece::line(self.position, end) else {
            return Ok(None);
        };
        check_travel(&way, &settings.axes)?;
        let piece = match return_scale {
            None => way,
            Some(_) => self.with_run_down(&way, &end, pitch_mm, settings)?,
        };
        let limits = Bounds::of(&piece).limits(f64::INFINITY, settings);
        let speed = pitch_mm * turns_s * return_scale.map_or(1.0, |scale| scale.max(1.0));
        if speed > limits.v {
            return Err(PlanErrorKind::SpindleTooFast { speed, limit: limits.v });
        }
        if return_scale.is_none() {
            self.position = end;
        }
        Ok(Some(Entry::Rest(Element::Synced(Synced {
            piece: piece.in_frame(self.tool_frame),
            pitch_mm,
            limits: MotionLimits {
                velocity: limits.v,
                acceleration: limits.a,
                jerk: limits.j,
            },
            tap: return_scale.map(|return_scale| Tap {
                depth_mm: way.length(),
                return_scale,
            }),
            turns_s,
            line,
        }))))
    }

    /// The way to the depth of a tap and as far beyond as the travel allows: one turn at least.
    fn with_run_down(
        &self,
        way: &Piece,
        end: &Position,
        pitch_mm: f64,
        settings: &Settings,
    ) -> Result<Piece, PlanErrorKind> {
        let direction = way.jet(0.0).d1;
        let beyond = |mm: f64| {
            let end = std::array::from_fn(|axis| end.0[axis] + mm * direction[axis]);
            Piece::line(self.position, Position(end)).ok_or(PlanErrorKind::NotFinite)
        };
        let least = beyond(pitch_mm)?;
        check_travel(&least, &settings.axes)?;
        let mut room = RUN_DOWN_TURNS * pitch_mm;
        for ((limits, direction), end) in settings.axes.iter().zip(direction).zip(end.0) {
            let Some(limits) = limits else { continue };
            let limit = if direction > 0.0 {
                limits.travel[1]
            } else {
                limits.travel[0]
            };
            if direction != 0.0 {
                room = room.min((limit - end) / direction);
            }
        }
        if room > pitch_mm { beyond(room) } else { Ok(least) }
    }

    fn straight(
        &mut self,
        to: &Position,
        line: u32,
        rapid: bool,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        let end = self.frame.machine(to);
        if end.0.iter().any(|x| !x.is_finite()) {
            return Err(PlanErrorKind::NotFinite);
        }
        match Piece::line(self.position, end) {
            Some(piece) => self
                .accept(piece, end, line, rapid, settings)
                .map(Entry::Move)
                .map(Some),
            None => Ok(None),
        }
    }

    fn accept(
        &mut self,
        piece: Piece,
        end: Position,
        line: u32,
        rapid: bool,
        settings: &Settings,
    ) -> Result<Move, PlanErrorKind> {
        let piece = piece.in_frame(self.tool_frame);
        match &settings.joints {
            Some(joints) if !joints.kinematics.is_trivial(&self.tool_frame) => {
                // The axes' own travel is that of the joints which they are when the control is off.
                if self.tool_frame.tcp {
                    check_axes(&piece, &settings.axes)?;
                } else {
                    check_travel(&piece, &settings.axes)?;
                }
                joints.check(&piece)?;
            }
            Some(_) | None => check_travel(&piece, &settings.axes)?,
        }
        let feed = if rapid {
            f64::INFINITY
        } else {
            let feed = self.feed.ok_or(PlanErrorKind::NoFeedRate)?;
            let per_s = if self.per_turn { self.turns_s(settings)? } else { 1.0 };
            let delta = std::array::from_fn(|i| end.0[i] - self.position.0[i]);
            match Group::of(&delta) {
                Some(Group::Rotary) => feed.degrees_s * per_s,
                Some(Group::Main | Group::Parallel) | None => feed.mm_s * per_s,
            }
        };
        self.position = end;
        let corner = match self.mode {
            PathMode::ExactPath => Corner::Exact,
            PathMode::ExactStop => Corner::Stop,
            PathMode::Continuous { tolerance_mm, .. } => {
                let tolerance = tolerance_mm.unwrap_or(settings.tolerance_mm);
                if tolerance > 0.0 {
                    Corner::Round(tolerance)
                } else {
                    Corner::Exact
                }
            }
        };
        let naive_cam_mm = match self.mode {
            PathMode::Continuous {
                naive_cam_tolerance_mm, ..
            } => naive_cam_tolerance_mm.unwrap_or(0.0),
            PathMode::ExactPath | PathMode::ExactStop => 0.0,
        };
        Ok(Move {
            piece,
            feed,
            line,
            rapid,
            enables: Enables {
                spindle_speed: self.per_turn,
                ..self.enables
            },
            corner,
            naive_cam_mm,
        })
    }

    fn arc(&self, to: &Position, plane: Plane, centre_mm: [f64; 2], turns: i32) -> Result<Piece, PlanErrorKind> {
        if let Plane::Uv | Plane::Wu | Plane::Vw = plane {
            return Err(PlanErrorKind::Unsupported(
                "an arc in the planes of U, V and W (G17.1 to G19.1)",
            ));
        }
        if turns.unsigned_abs() > TURNS_MAX {
            return Err(PlanErrorKind::Unsupported("an arc of more than 1000 turns"));
        }
        let [first, second, normal] = plane.axes();
        let mut centre = *to;
        centre[first] = centre_mm[0];
        centre[second] = centre_mm[1];
        let centre = Group::Main.pick(&self.frame.machine(&centre).0);
        let [first, second, normal] = [first, second, normal].map(|axis| self.frame.direction(axis));
        let end = self.frame.machine(to);
        if end.0.iter().chain(&centre).any(|x| !x.is_finite()) {
            return Err(PlanErrorKind::NotFinite);
        }
        let angle_and_radius = |q: &Position| {
            let arm = [0, 1, 2].map(|i| q.0[i] - centre[i]);
            let part = |unit: &[f64; 3]| arm[0] * unit[0] + arm[1] * unit[1] + arm[2] * unit[2];
            let (x, y) = (part(&first), part(&second));
            (libm::atan2(y, x), libm::hypot(x, y))
        };
        let ((from, radius), (until, _)) = (angle_and_radius(&self.position), angle_and_radius(&end));
        let mut sweep = if turns > 0 { until - from } else { from - until }.rem_euclid(TAU);
        // Equal end points are a full turn; so are those that differ by the rounding of a computed program.
        if sweep * radius < 1e-9 || (TAU - sweep) * radius < 1e-9 {
            sweep = TAU;
        }
        sweep += TAU * f64::from(turns.unsigned_abs().saturating_sub(1));
        let circle = Circle {
            start: self.position,
            end,
            centre_mm: centre,
            normal,
            sweep_rad: if turns > 0 { sweep } else { -sweep },
        };
        Piece::arc(&circle).filter(|_| turns != 0).ok_or(PlanErrorKind::BadArc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canon::AXES;
    use crate::plan::AxisLimits;
    use std::f64::consts::PI;

    fn settings() -> Settings {
        let axis = AxisLimits {
            velocity: 1.0,
            acceleration: 1.0,
            jerk: 1.0,
            travel: [-1e3, 1e3],
        };
        let axes = [Some(axis); AXES];
        Settings {
            tolerance_mm: 0.1,
            look_ahead_blocks: 9,
            spindle_encoder: true,
            slope: crate::plan::Slope::Classic,
            ..Settings::new(axes, 1e-3)
        }
    }

    fn moved(program: &mut Program, call: Call) -> Move {
        match program.take(1, &call, &settings()) {
            Ok(Some(Entry::Move(part))) => part,
            other => panic!("a move expected: {other:?}"),
        }
    }

    fn speed(rpm: f64) -> Call {
        Call::SetSpindleSpeed { spindle: 0, speed: rpm }
    }

    fn with_feed() -> Program {
        let mut program = Program::new(Position::ZERO);
        program
            .take(
                1,
                &Call::SetFeedRate {
                    linear: 5.0,
                    angular: 7.0,
                },
                &settings(),
            )
            .unwrap();
        program
    }

    fn arc(to: Position, plane: Plane, centre_mm: [f64; 2], turns: i32) -> Call {
        Call::ArcFeed {
            to,
            plane,
            centre_mm,
            turns,
        }
    }

    #[test]
    fn equal_end_points_are_a_full_turn_and_turns_count() {
        for (turns, times) in [(1, 1.0), (-1, 1.0), (3, 3.0), (-2, 2.0)] {
            let part = moved(&mut with_feed(), arc(Position::ZERO, Plane::Xy, [10.0, 0.0], turns));
            assert!((part.piece.length() - times * 20.0 * PI).abs() < 1e-9, "{turns}");
            // Counter-clockwise from (0, 0) about (10, 0) begins downwards.
            let down = part.piece.jet(0.0).d1[1];
            assert!((down + f64::from(turns.signum())).abs() < 1e-12);
        }
    }

    #[test]
    fn direction_decides_which_part_of_the_circle_is_meant() {
        let quarter = Position::xyz(10.0, -10.0, 0.0);
        let part = moved(&mut with_feed(), arc(quarter, Plane::Xy, [10.0, 0.0], 1));
        assert!((part.piece.length() - 5.0 * PI).abs() < 1e-9);
        let part = moved(&mut with_feed(), arc(quarter, Plane::Xy, [10.0, 0.0], -1));
        assert!((part.piece.length() - 15.0 * PI).abs() < 1e-9);
    }

    #[test]
    fn an_arc_turns_and_shifts_with_its_frame() {
        let mut program = with_feed();
        let offset = Call::SetG5xOffset {
            system: 1,
            origin: Position::xyz(100.0, 0.0, 7.0),
        };
        program.take(1, &offset, &settings()).unwrap();
        program
            .take(1, &Call::SetXyRotation { degrees: 90.0 }, &settings())
            .unwrap();
        moved(&mut program, Call::StraightTraverse { to: Position::ZERO });
        // G18: Z is first, X second; the half turn from X0 to X20 bulges to Z-10 or Z+10. X of the work is Y here.
        let part = moved(
            &mut program,
            arc(Position::xyz(20.0, 0.0, 0.0), Plane::Zx, [0.0, 10.0], 1),
        );
        let middle = part.piece.position(part.piece.length() / 2.0);
        for (got, want) in middle.0.iter().zip([100.0, 10.0, 17.0]) {
            assert!((got - want).abs() < 1e-9, "{middle:?}");
        }
    }

    #[test]
    fn a_feed_counts_degrees_where_rotary_axes_alone_move() {
        let mut to = Position::ZERO;
        to[Axis::B] = 9.0;
        assert_eq!(moved(&mut with_feed(), Call::StraightFeed { to }).feed, 7.0);
        to[Axis::V] = 1.0;
        assert_eq!(moved(&mut with_feed(), Call::StraightFeed { to }).feed, 5.0);
    }

    #[test]
    fn a_feed_per_turn_is_that_of_the_programmed_speed_and_none_where_the_spindle_stands() {
        let mut program = with_feed();
        let to = Position::xyz(0.0, 0.0, 1.0);
        let mode = Call::SetFeedMode(FeedMode::PerTurn { spindle: 0 });
        program.take(1, &mode, &settings()).unwrap();
        program.take(1, &speed(90.0), &settings()).unwrap();
        let stands = program.take(1, &Call::StraightFeed { to }, &settings());
        assert_eq!(stands.unwrap_err(), PlanErrorKind::SpindleStands);
        let start = Call::StartSpindle {
            spindle: 0,
            direction: SpindleDirection::Counterclockwise,
            wait_for_speed: true,
        };
        program.take(1, &start, &settings()).unwrap();
        assert_eq!(moved(&mut program, Call::StraightFeed { to }).feed, 7.5);
        let mode = Call::SetFeedMode(FeedMode::PerTime);
        program.take(1, &mode, &settings()).unwrap();
        let to = Position::ZERO;
        assert_eq!(moved(&mut program, Call::StraightFeed { to }).feed, 5.0);
    }

    #[test]
    fn what_cannot_be_run_is_refused_by_name() {
        let calls = [
            (
                Call::StartSpindle {
                    spindle: 1,
                    direction: SpindleDirection::Clockwise,
                    wait_for_speed: true,
                },
                "a second spindle ($1 and above)",
            ),
            // One of a million took more memory than a PC has.
            (
                arc(Position::ZERO, Plane::Xy, [1.0, 0.0], -1001),
                "an arc of more than 1000 turns",
            ),
            (
                arc(Position::ZERO, Plane::Uv, [1.0, 0.0], 1),
                "an arc in the planes of U, V and W (G17.1 to G19.1)",
            ),
        ];
        for (call, what) in calls {
            assert_eq!(
                with_feed().take(1, &call, &settings()).unwrap_err(),
                PlanErrorKind::Unsupported(what)
            );
        }
    }

    #[test]
    fn modes_decide_what_may_happen_to_a_corner() {
        let mut program = with_feed();
        let modes = [
            (PathMode::ExactPath, Corner::Exact),
            (PathMode::ExactStop, Corner::Stop),
            (
                PathMode::Continuous {
                    tolerance_mm: Some(0.02),
                    naive_cam_tolerance_mm: None,
                },
                Corner::Round(0.02),
            ),
            (
                PathMode::Continuous {
                    tolerance_mm: None,
                    naive_cam_tolerance_mm: None,
                },
                Corner::Round(0.1),
            ),
        ];
        for (x, (mode, corner)) in (1..).zip(modes) {
            program.take(1, &Call::SetPathMode(mode), &settings()).unwrap();
            let part = moved(
                &mut program,
                Call::StraightFeed {
                    to: Position::xyz(f64::from(x), 0.0, 0.0),
                },
            );
            assert_eq!((part.corner, part.feed, part.rapid), (corner, 5.0, false));
        }
    }

    #[test]
    fn a_spindle_speed_is_an_action_only_while_the_spindle_turns() {
        let mut program = with_feed();
        let mut take = |call| match program.take(4, &call, &settings()).unwrap() {
            Some(Entry::Rest(Element::Action { action, line: 4 })) => Some(action),
            None => None,
            other => panic!("an action expected: {other:?}"),
        };
        let direction = SpindleDirection::Counterclockwise;
        assert_eq!(take(speed(500.0)), None);
        assert_eq!(
            take(Call::StartSpindle {
                spindle: 0,
                direction,
                wait_for_speed: true,
            }),
            Some(Action::SpindleOn {
                rpm: 500.0,
                direction,
                surface: None,
            })
        );
        assert_eq!(
            take(speed(9.0)),
            Some(Action::SpindleOn {
                rpm: 9.0,
                direction,
                surface: None,
            })
        );
        assert_eq!(take(Call::StopSpindle { spindle: 0 }), Some(Action::SpindleOff));
        assert_eq!(take(speed(8.0)), None);
        assert_eq!(take(Call::Message("a".into())), Some(Action::Message { number: 0 }));
        assert_eq!(take(Call::Message("b".into())), Some(Action::Message { number: 1 }));
    }

    #[test]
    fn a_constant_speed_of_the_surface_follows_its_zero_and_is_planned_for_its_highest_speed() {
        let mut program = with_feed();
        let direction = SpindleDirection::Clockwise;
        let mode = |max_rpm| Call::SetSpindleMode {
            spindle: 0,
            mode: SpindleMode::ConstantSurfaceSpeed { max_rpm },
        };
        let start = Call::StartSpindle {
            spindle: 0,
            direction,
            wait_for_speed: true,
        };
        let mut take = |call: Call| match program.take(1, &call, &settings()).unwrap() {
            Some(Entry::Rest(Element::Action {
                action: Action::SpindleOn { rpm, surface, .. },
                ..
            })) => Some((rpm, surface)),
            _ => None,
        };
        let surface = |m_per_minute, centre_mm| {
            Some(Surface {
                m_per_minute,
                centre_mm,
            })
        };
        assert_eq!(take(mode(Some(1500.0))), None);
        assert_eq!(take(speed(120.0)), None);
        assert_eq!(take(start), Some((1500.0, surface(120.0, 0.0))));
        let offset = Position::xyz(-7.0, 0.0, 3.0);
        assert_eq!(
            take(Call::SetG5xOffset {
                system: 1,
                origin: offset,
            }),
            Some((1500.0, surface(120.0, -7.0)))
        );
        take(Call::SetFeedMode(FeedMode::PerTurn { spindle: 0 }));
        // 5 mm a turn.
        let part = moved(
            &mut program,
            Call::StraightFeed {
                to: Position::xyz(20.0, 0.0, 0.0),
            },
        );
        assert_eq!((part.feed, part.enables.spindle_speed), (125.0, true));
        // Without D as fast as the machine can.
        program.take(1, &mode(None), &settings()).unwrap();
        let part = moved(
            &mut program,
            Call::StraightFeed {
                to: Position::xyz(30.0, 0.0, 0.0),
            },
        );
        assert_eq!(part.feed, 500.0);
        // 120 m/min at a radius of 30 mm.
        let found = surface(120.0, -7.0).unwrap().rpm(23.0);
        assert!(
            (found - 120_000.0 / (60.0 * std::f64::consts::PI)).abs() < 1e-9,
            "{found}"
        );
    }

    #[test]
    fn the_first_cut_behind_a_change_of_speed_waits_once() {
        let settings = Settings {
            await_spindle: true,
            ..settings()
        };
        let mut program = with_feed();
        let to = Position::xyz(1.0, 0.0, 0.0);
        let cut = Call::StraightFeed { to };
        let start = |wait_for_speed| Call::StartSpindle {
            spindle: 0,
            direction: SpindleDirection::Clockwise,
            wait_for_speed,
        };
        let mut waits = |calls: &[Call]| {
            let waits = |call: &Call| {
                let waits = program.take_wait(call, &settings);
                program.take(1, call, &settings).unwrap();
                waits
            };
            calls.iter().map(waits).collect::<Vec<bool>>()
        };
        assert_eq!(waits(&[cut.clone(), speed(100.0), cut.clone()]), [false; 3]);
        let rapid = Call::StraightTraverse { to };
        assert_eq!(
            waits(&[start(true), rapid, cut.clone(), cut.clone()]),
            [false, false, true, false]
        );
        assert_eq!(waits(&[speed(200.0), cut.clone()]), [false, true]);
        assert_eq!(waits(&[start(false), cut.clone()]), [false; 2]);
        assert_eq!(waits(&[start(true), Call::StopSpindle { spindle: 0 }, cut]), [false; 3]);
    }

    #[test]
    fn a_refused_move_leaves_the_program_where_it_is() {
        let mut program = with_feed();
        let far = Call::StraightFeed {
            to: Position::xyz(2e3, 0.0, 0.0),
        };
        assert!(matches!(
            program.take(1, &far, &settings()),
            Err(PlanErrorKind::Travel {
                axis: Axis::X,
                limit: 1e3,
                ..
            })
        ));
        let part = moved(
            &mut program,
            Call::StraightFeed {
                to: Position::xyz(3.0, 4.0, 0.0),
            },
        );
        assert_eq!(part.piece.length(), 5.0);
        let none = Call::StraightFeed {
            to: Position::xyz(f64::NAN, 0.0, 0.0),
        };
        assert_eq!(
            program.take(1, &none, &settings()).unwrap_err(),
            PlanErrorKind::NotFinite
        );
        let centre = arc(Position::xyz(5.0, 5.0, 0.0), Plane::Xy, [3.0, 4.0], 1);
        assert_eq!(
            program.take(1, &centre, &settings()).unwrap_err(),
            PlanErrorKind::BadArc
        );
    }
}
