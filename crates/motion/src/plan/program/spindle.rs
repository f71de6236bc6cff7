//! The spindle: its speed, and moves in step with it.
//!
//! In:  S, G96, pitches.
//! Out: what the spindle is told; turns per second for feed by turns; threads and taps from rest to rest.

use super::moves::{check_time, is_no_move};
use super::{Entry, Program};
use crate::canon::{Axis, FeedMode, OrientDirection, Position, SpindleDirection, SpindleMode};
use crate::element::{Action, Element, Surface, Synced, Tap};
use crate::path::Piece;
use crate::plan::limits::Bounds;
use crate::plan::travel;
use crate::plan::{PlanErrorKind, Settings};
use crate::rt::MotionLimits;

/// Turns behind the depth of a tap within which the spindle must have come to rest, if the travel leaves as many.
const RUN_DOWN_TURNS: f64 = 10.0;

impl Program {
    /// The constant speed of the surface, if it is in force.
    pub(super) fn surface(&self) -> Option<Surface> {
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
    pub(super) fn spindle_on(&self, settings: &Settings) -> Option<Action> {
        Some(Action::SpindleOn {
            rpm: self.rpm(settings),
            direction: self.spindle?,
            surface: self.surface(),
        })
    }

    /// What the spindle is to be told where zero of X may be another place now.
    pub(super) fn centre_moved(&self, settings: &Settings) -> Option<Action> {
        self.surface()?;
        self.spindle_on(settings)
    }

    /// What a call for the first spindle alone is for the others.
    fn only_the_first(spindle: u8) -> Result<(), PlanErrorKind> {
        if spindle == 0 {
            return Ok(());
        }
        let what = "more of a second spindle ($1 and above) than S, M3, M4 and M5";
        Err(PlanErrorKind::Unsupported(what))
    }

    pub(super) fn set_feed_mode(&mut self, mode: FeedMode) -> Result<(), PlanErrorKind> {
        self.per_turn = match mode {
            FeedMode::PerTime => false,
            FeedMode::PerTurn { spindle } => {
                Program::only_the_first(spindle)?;
                true
            }
        };
        Ok(())
    }

    /// S follows, or holds again.
    pub(super) fn set_spindle_mode(&mut self, spindle: u8, mode: SpindleMode) -> Result<(), PlanErrorKind> {
        match mode {
            SpindleMode::Rpm if spindle > 0 => return Ok(()),
            SpindleMode::Rpm => {}
            SpindleMode::ConstantSurfaceSpeed { .. } => Program::only_the_first(spindle)?,
        }
        self.spindle_mode = mode;
        Ok(())
    }

    pub(super) fn set_speed(&mut self, spindle: u8, speed: f64, line: u32, settings: &Settings) -> Option<Entry> {
        if spindle > 0 {
            let (_, direction) = *self.others.get(usize::from(spindle))?;
            let told = self.turn_other(spindle, (speed, direction), line);
            return told.filter(|_| direction.is_some());
        }
        self.speed = speed;
        self.speed_changed = self.spindle.is_some();
        let action = self.spindle_on(settings)?;
        self.act(action, line)
    }

    pub(super) fn start_spindle(
        &mut self,
        spindle: u8,
        direction: SpindleDirection,
        wait_for_speed: bool,
        line: u32,
        settings: &Settings,
    ) -> Option<Entry> {
        if spindle > 0 {
            let (speed, _) = *self.others.get(usize::from(spindle))?;
            return self.turn_other(spindle, (speed, Some(direction)), line);
        }
        self.orienting = false;
        self.spindle = Some(direction);
        // A tap in a floating holder goes back while the spindle still comes to its speed.
        self.speed_changed = wait_for_speed;
        let action = self.spindle_on(settings)?;
        self.act(action, line)
    }

    pub(super) fn stop_spindle(&mut self, spindle: u8, line: u32) -> Option<Entry> {
        if spindle > 0 {
            let (speed, before) = *self.others.get(usize::from(spindle))?;
            return self
                .turn_other(spindle, (speed, None), line)
                .filter(|_| before.is_some());
        }
        (self.spindle, self.speed_changed, self.orienting) = (None, false, false);
        self.act(Action::SpindleOff, line)
    }

    /// A spindle beside the first is told its speed and direction, at rest.
    fn turn_other(&mut self, spindle: u8, to: (f64, Option<SpindleDirection>), line: u32) -> Option<Entry> {
        *self.others.get_mut(usize::from(spindle))? = to;
        let rpm = to.1.map(|direction| match direction {
            SpindleDirection::Clockwise => to.0,
            SpindleDirection::Counterclockwise => -to.0,
        });
        let action = Action::TurnSpindle { spindle, rpm };
        Some(Entry::rest(Element::Action { action, line }))
    }

    /// M19.
    pub(super) fn orient(
        &mut self,
        spindle: u8,
        degrees: f64,
        direction: OrientDirection,
    ) -> Result<Action, PlanErrorKind> {
        Program::only_the_first(spindle)?;
        (self.spindle, self.speed_changed, self.orienting) = (None, false, true);
        self.auxiliary.spindle = None;
        Ok(Action::OrientSpindle { degrees, direction })
    }

    /// Q of M19.
    pub(super) fn oriented(&mut self, spindle: u8, timeout_s: f64) -> Result<Action, PlanErrorKind> {
        Program::only_the_first(spindle)?;
        self.orienting = false;
        let timeout_s = Some(timeout_s);
        Ok(Action::AwaitOriented { timeout_s })
    }

    /// The moves that follow are in step with the spindle.
    pub(super) fn start_sync(
        &mut self,
        spindle: u8,
        mm_per_turn: f64,
        velocity: bool,
        settings: &Settings,
    ) -> Result<(), PlanErrorKind> {
        Program::only_the_first(spindle)?;
        if velocity {
            return Err(PlanErrorKind::Unsupported("motion at the speed of the spindle only"));
        }
        if !settings.spindle_encoder {
            return Err(PlanErrorKind::NoSpindleEncoder);
        }
        if !mm_per_turn.is_finite() || mm_per_turn == 0.0 {
            return Err(PlanErrorKind::NotFinite);
        }
        self.pitch_mm = Some(mm_per_turn.abs());
        Ok(())
    }

    /// Turns per second for which feed by turns is planned: as programmed or, with a speed of the surface, the most. What the
    /// spindle does less, the interpolation makes up for.
    pub(super) fn turns_s(&self, settings: &Settings) -> Result<f64, PlanErrorKind> {
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

    /// G33.1.
    pub(super) fn tap(
        &mut self,
        to: &Position,
        return_scale: f64,
        line: u32,
        settings: &Settings,
    ) -> Result<Option<Entry>, PlanErrorKind> {
        match self.pitch_mm {
            Some(pitch_mm) => self.synced(to, pitch_mm, Some(return_scale), line, settings),
            None => Err(PlanErrorKind::Unsupported("rigid tapping (G33.1) without a pitch")),
        }
    }

    /// A straight move in step with the spindle, from rest to rest; `return_scale`: there and back.
    pub(super) fn synced(
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
        if is_no_move(&self.start(), &end) {
            return self.owe(end, line, true, settings).map(|()| None);
        }
        // It begins at rest, where what is owed has been made up for.
        let Some(way) = Piece::line(self.position, end) else {
            return Ok(None);
        };
        travel::check(&way, settings)?;
        let piece = match return_scale {
            None => way,
            Some(_) => self.with_run_down(&way, &end, pitch_mm, settings)?,
        };
        let limits = Bounds::new(&piece).limits(f64::INFINITY, settings);
        let speed = pitch_mm * turns_s * return_scale.map_or(1.0, |scale| scale.max(1.0));
        if speed > limits.v {
            return Err(PlanErrorKind::SpindleTooFast { speed, limit: limits.v });
        }
        check_time(way.length(), pitch_mm * turns_s)?;
        if return_scale.is_none() {
            self.position = end;
        }
        Ok(Some(Entry::rest(Element::Synced(Synced {
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
        travel::check(&least, settings)?;
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
}
