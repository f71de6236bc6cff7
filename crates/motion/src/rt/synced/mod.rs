//! Motion in step with the spindle: threading (G33, G76) and rigid tapping (G33.1).
//!
//! In:  a [`Synced`] move; where the spindle is, once a cycle ([`SpindleFeedback`]).
//! Out: a place on the piece, once a cycle; for tapping, whether the spindle is to turn the other way; how it went.
//!
//! The wanted place is `pitch (turns - turns0)` with a whole `turns0`: a line through the beginning of the piece at an index of
//! the spindle, whatever its speed and whatever the limits of the machine. All passes of a thread are therefore in phase.
//!
//! ```text
//! waiting   at rest at the beginning, until the spindle turns, no faster than it can be followed, its index is known, and the
//!           wanted place (which is still before the beginning) is as far away as it gains on the ramp
//! ramp      shortest way to the speed of the spindle; ends on the line: nothing is to be made up for but what the spindle
//!           changed its speed by
//! tracking  on the line (`law`); what the spindle does faster than the limits allow is not followed, but made up for
//! braking   shortest way to rest at the end of the piece, off the pitch. For tapping, at its beginning, on the way back.
//! ```
//!
//! So a thread needs a run-in of [`run_in_mm`] before it and, behind it, room to brake. The limits are kept always: each cycle is
//! one of constant jerk, or part of a shortest way, and none is taken from which the greatest speed would be passed or the end
//! of the piece could not be kept.
//!
//! Each move comes to rest and waits for the index again, also where the next one goes on with the thread (its taper): all passes
//! do so at the same place. A hold acts where the move waits or is over, an override never.
//!
//! Tapping: at the depth the spindle is to be reversed; its run-down, its stop and its way back are followed as the rest is.
//!
//! RT: nothing here allocates.

mod law;
mod observer;

use super::otg::State;
use super::otg::segments::Segments;
use super::scale::{MotionLimits, StopLimits};
use crate::element::Synced;
use observer::Observer;
use std::fmt;

/// So long a spindle may turn without an index, or stand while it is to turn, s.
pub const PATIENCE_S: f64 = 5.0;
/// Speed below which the spindle stands, turns/s.
const STANDS: f64 = 0.02;
/// Part of the speed that can be followed by which the spindle may seem to be faster: what its encoder leaves open.
const FASTER: f64 = 0.01;
/// Part of the pitch within which the move is in step.
const IN_STEP: f64 = 1.0 / 200.0;
/// Halvings of a cycle that find the moment of braking: 2^-50 of a cycle is below rounding.
const HALVINGS: usize = 50;
/// Rounding of a place on the piece, mm.
const ROUNDING_MM: f64 = 1e-9;

/// Where the spindle is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpindleFeedback {
    /// Turns, not wrapped; greater with M3. A whole number at the index, once there has been one.
    pub turns: f64,
    /// Whether the index has been seen, so that `turns` counts from it.
    pub indexed: bool,
}

impl SpindleFeedback {
    /// What a spindle without an encoder gives.
    pub const NONE: SpindleFeedback = SpindleFeedback {
        turns: 0.0,
        indexed: false,
    };
}

/// Why a synchronised move was given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncFault {
    /// No index came.
    NoIndex,
    /// The spindle stood when it was to turn.
    SpindleStands,
    /// The spindle stayed faster than the axes can follow.
    TooFast,
    /// The spindle went on beyond the depth, farther than it may to reverse.
    NotReversed,
    /// The encoder gave NaN.
    NoNumber,
    /// Ended from outside: [`Follower::give_up`].
    Aborted,
}

impl fmt::Display for SyncFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SyncFault::NoIndex => write!(
                f,
                "no index of the spindle within {PATIENCE_S} s; expected one each turn"
            ),
            SyncFault::SpindleStands => write!(
                f,
                "the spindle stood for {PATIENCE_S} s in a move in step with it; expected it to turn"
            ),
            SyncFault::TooFast => write!(
                f,
                "the spindle turned faster than the axes can follow at this pitch for {PATIENCE_S} s; expected a lower S, or less \
                 than its override"
            ),
            SyncFault::NotReversed => {
                f.write_str("the spindle did not reverse in time behind the depth of a rigid tapping move")
            }
            SyncFault::NoNumber => f.write_str("the encoder of the spindle gave no number"),
            SyncFault::Aborted => f.write_str("the move in step with the spindle was ended before its end"),
        }
    }
}

/// How a synchronised move went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SyncReport {
    /// Place where it was in step for the first time, mm.
    pub in_step_from_mm: Option<f64>,
    /// Greatest distance from the pitch from there to the braking at the end, against the encoder as it was read, mm.
    pub deviation_mm: f64,
    /// Cycles in which this was more than a two-hundredth of the pitch.
    pub cycles_off: u64,
    /// Of a tap: way behind its depth in which the spindle came to its reversal, mm.
    pub over_run_mm: Option<f64>,
}

impl fmt::Display for SyncReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.in_step_from_mm {
            None => f.write_str("never in step with the spindle")?,
            Some(from_mm) => write!(
                f,
                "in step with the spindle from {from_mm:.3} mm on, off by {:.4} mm at most, {} cycles off by much",
                self.deviation_mm, self.cycles_off
            )?,
        }
        match self.over_run_mm {
            None => Ok(()),
            Some(over_run_mm) => write!(f, ", over-run {over_run_mm:.3} mm behind the depth"),
        }
    }
}

/// Way that a move needs from rest until it is in step with a spindle of `turns_s` turns per second that keeps its speed, mm.
pub fn run_in_mm(pitch_mm: f64, turns_s: f64, limits: &MotionLimits) -> f64 {
    ramp(pitch_mm * turns_s.abs(), limits).end.position
}

fn ramp(velocity: f64, limits: &MotionLimits) -> Segments {
    to_velocity(State::resting(0.0), velocity.min(limits.velocity), limits)
}

fn to_velocity(from: State, velocity: f64, limits: &MotionLimits) -> Segments {
    let MotionLimits { acceleration, jerk, .. } = *limits;
    Segments::to_velocity(from, velocity, StopLimits { acceleration, jerk })
}

/// What the follower is doing.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)] // plain data; one is held
enum Phase {
    Waiting,
    Ramp {
        way: Segments,
        time_s: f64,
    },
    Tracking,
    Braking {
        way: Segments,
        time_s: f64,
        /// Place of rest; `None`: wherever it is.
        to: Option<f64>,
    },
    Over,
}

/// Runs one synchronised move.
#[derive(Clone, Debug)]
pub struct Follower {
    cycle_s: f64,
    observer: Observer,
    synced: Option<Synced>,
    phase: Phase,
    /// Place on the piece.
    state: State,
    /// 1 where the spindle turned as with M3 when the move began, else -1.
    sense: f64,
    /// Turns in that sense at which the wanted place is the beginning of the piece.
    turns0: Option<f64>,
    waited_s: f64,
    reversed: bool,
    fault: Option<SyncFault>,
    report: SyncReport,
    /// Line of the last move that came to its end, and how it went, until it is taken.
    over: Option<(u32, SyncReport)>,
}

impl Follower {
    /// A follower without a move.
    pub fn new(cycle_s: f64) -> Follower {
        Follower {
            cycle_s,
            observer: Observer::new(cycle_s),
            synced: None,
            phase: Phase::Over,
            state: State::resting(0.0),
            sense: 1.0,
            turns0: None,
            waited_s: 0.0,
            reversed: false,
            fault: None,
            report: SyncReport::default(),
            over: None,
        }
    }

    /// A move begins, at rest at the beginning of its piece. RT.
    pub fn begin(&mut self, synced: &Synced) {
        *self = Follower {
            observer: self.observer,
            synced: Some(*synced),
            phase: Phase::Waiting,
            over: self.over,
            ..Follower::new(self.cycle_s)
        };
    }

    /// Takes where the spindle is: each cycle, also where no move is under way, so that its speed is known when one begins. RT.
    pub fn observe(&mut self, spindle: &SpindleFeedback) {
        self.observer.update(spindle.turns, spindle.indexed);
        if !spindle.turns.is_finite() {
            self.fail(SyncFault::NoNumber);
        }
    }

    /// One cycle further; before it, [`Follower::observe`]. RT.
    pub fn step(&mut self, spindle: &SpindleFeedback) {
        let Some(synced) = self.synced else { return };
        let was_over = self.is_over();
        match self.phase {
            Phase::Waiting => self.wait(&synced),
            Phase::Ramp { way, time_s } => self.run_up(&synced, &way, time_s),
            Phase::Tracking => self.track(&synced),
            Phase::Braking { way, time_s, to } => self.brake(&way, time_s, to),
            Phase::Over => {}
        }
        self.judge(&synced, spindle.turns);
        if !was_over && self.is_over() {
            self.over = Some((synced.line, self.report));
        }
    }

    /// Line of the last move that came to its end, and how it went; told once. RT.
    pub fn take_report(&mut self) -> Option<(u32, SyncReport)> {
        self.over.take()
    }

    /// Place on the piece, mm. RT.
    pub fn place(&self) -> f64 {
        self.state.position
    }

    /// Speed along the piece, mm/s; negative on the way back. RT.
    pub fn velocity(&self) -> f64 {
        self.state.velocity
    }

    /// How far it is behind the depth of a tap, mm. RT.
    pub fn over_run_mm(&self) -> f64 {
        let tap = self.synced.and_then(|synced| synced.tap);
        tap.map_or(0.0, |tap| (self.state.position - tap.depth_mm).max(0.0))
    }

    /// Whether it waits at rest at the beginning: a hold may act. RT.
    pub fn is_waiting(&self) -> bool {
        matches!(self.phase, Phase::Waiting)
    }

    /// Whether the move is over, at rest; see [`Follower::fault`]. RT.
    pub fn is_over(&self) -> bool {
        matches!(self.phase, Phase::Over)
    }

    /// Why the move is being given up, or was. RT.
    pub fn fault(&self) -> Option<SyncFault> {
        self.fault
    }

    /// The speed, relative to the programmed one, at which the spindle is to turn the other way; `None`: as programmed. RT.
    pub fn reversal(&self) -> Option<f64> {
        let tap = self.synced?.tap?;
        (self.reversed && !self.is_over()).then_some(tap.return_scale)
    }

    /// How the move went so far. RT.
    pub fn report(&self) -> SyncReport {
        self.report
    }

    /// Ends the move: on the piece as soon as the limits allow, off the pitch. A tap is in the work, so that the spindle is
    /// reversed and followed back to the beginning. RT.
    pub fn give_up(&mut self) {
        let in_work = matches!(self.phase, Phase::Ramp { .. } | Phase::Tracking);
        if in_work && self.synced.is_some_and(|synced| synced.tap.is_some()) {
            self.fault = self.fault.or(Some(SyncFault::Aborted));
            self.reversed = true;
        } else {
            self.fail(SyncFault::Aborted);
        }
    }

    /// Rest as soon as the limits allow.
    fn fail(&mut self, fault: SyncFault) {
        let Some(synced) = self.synced else { return };
        match self.phase {
            Phase::Over => return,
            Phase::Waiting => self.phase = Phase::Over,
            Phase::Ramp { .. } | Phase::Tracking => self.brake_to(to_velocity(self.state, 0.0, &synced.limits), None),
            Phase::Braking { .. } => {}
        }
        self.fault = self.fault.or(Some(fault));
    }

    /// Counts the time for which what is waited for does not come.
    fn lose_patience(&mut self, missing: Option<SyncFault>) {
        match missing {
            None => self.waited_s = 0.0,
            Some(fault) => {
                self.waited_s += self.cycle_s;
                if self.waited_s > PATIENCE_S {
                    self.fail(fault);
                }
            }
        }
    }

    fn wait(&mut self, synced: &Synced) {
        let turns_s = self.observer.speed();
        if !self.observer.is_settled() {
            return self.lose_patience(Some(SyncFault::NoIndex));
        }
        if turns_s.abs() < STANDS {
            self.turns0 = None;
            return self.lose_patience(Some(SyncFault::SpindleStands));
        }
        if turns_s.abs() > (1.0 + FASTER) * synced.turns_s_max() {
            self.turns0 = None;
            return self.lose_patience(Some(SyncFault::TooFast));
        }
        if turns_s.signum() != self.sense {
            self.sense = turns_s.signum();
            self.turns0 = None;
        }
        let [turns, turns_s, _] = self.observer.one_cycle_ago();
        let speed = synced.pitch_mm * turns_s.abs();
        let way = ramp(synced.pitch_mm * turns_s.abs(), &synced.limits);
        // What the wanted place gains while the ramp lasts.
        let lead = speed * way.duration_s() - way.end.position;
        let turns = self.sense * turns;
        let turns0 = *self.turns0.get_or_insert((turns + lead / synced.pitch_mm).ceil());
        let wanted = synced.pitch_mm * (turns - turns0);
        // One cycle ago it was at `wanted`; when the ramp begins, it is at -lead.
        let since_s = ((wanted + lead) / speed).min(0.0);
        if since_s > -self.cycle_s {
            self.waited_s = 0.0;
            self.run_up(synced, &way, since_s);
        }
    }

    /// The ramp, `time_s` of which were over when this cycle began; below 0, it begins in it.
    fn run_up(&mut self, synced: &Synced, way: &Segments, time_s: f64) {
        let until_s = time_s + self.cycle_s;
        let begin_s = time_s.max(0.0);
        if !self.advance(synced, until_s - begin_s, |t| way.at(begin_s + t)) {
            return;
        }
        self.phase = if until_s < way.duration_s() {
            Phase::Ramp {
                way: *way,
                time_s: until_s,
            }
        } else {
            Phase::Tracking
        };
    }

    fn track(&mut self, synced: &Synced) {
        let Some(turns0) = self.turns0 else { return };
        let [turns, turns_s, turns_s2] = self.observer.one_cycle_ago();
        let stands = turns_s.abs() < STANDS;
        self.lose_patience(stands.then_some(SyncFault::SpindleStands));
        if !matches!(self.phase, Phase::Tracking) {
            return;
        }
        let (pitch, limits, now) = (synced.pitch_mm, synced.limits, self.state);
        let wanted = State {
            position: pitch * (self.sense * turns - turns0),
            velocity: pitch * self.sense * turns_s,
            acceleration: pitch * self.sense * turns_s2,
        };
        let least = if self.reversed { -limits.velocity } else { 0.0 };
        let acceleration = now.acceleration + law::jerk(&now, &wanted, &limits, self.cycle_s) * self.cycle_s;
        let acceleration = acceleration.clamp(-limits.acceleration, limits.acceleration);
        let jerk = (acceleration - now.acceleration) / self.cycle_s;
        let next = now.after(self.cycle_s, jerk);
        // The velocity that comes of taking the acceleration back.
        let comes_to = next.velocity + next.acceleration * next.acceleration.abs() / (2.0 * limits.jerk);
        let taken = if comes_to > limits.velocity {
            let way = to_velocity(now, limits.velocity, &limits);
            self.advance(synced, self.cycle_s, |t| way.at(t))
        } else if comes_to < least {
            let way = to_velocity(now, least, &limits);
            self.advance(synced, self.cycle_s, |t| way.at(t))
        } else {
            self.advance(synced, self.cycle_s, |t| now.after(t, jerk))
        };
        let at_depth = synced.tap.is_some_and(|tap| self.state.position >= tap.depth_mm);
        self.reversed |= taken && at_depth;
    }

    /// Goes on by `duration_s` as `at` says (t = 0: as it is), unless the end of the piece would then be passed: braking begins
    /// at the moment from which it leads to rest there. Whether it went on.
    fn advance(&mut self, synced: &Synced, duration_s: f64, at: impl Fn(f64) -> State) -> bool {
        let rest = |t: f64| to_velocity(at(t), 0.0, &synced.limits);
        let end = synced.piece.length();
        let to = match rest(duration_s).end.position {
            beyond if beyond > end => end,
            beyond if self.reversed && beyond < 0.0 => 0.0,
            _ => {
                self.state = at(duration_s);
                return true;
            }
        };
        let passes = |t: f64| {
            let place = rest(t).end.position;
            if to == 0.0 { place < to } else { place > to }
        };
        let (mut good, mut bad) = (0.0, duration_s);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (good + bad);
            if passes(middle) {
                bad = middle;
            } else {
                good = middle;
            }
        }
        self.brake_to(rest(good), Some(to));
        self.brake_from(duration_s - good);
        if to > 0.0 && synced.tap.is_some() {
            self.fault = self.fault.or(Some(SyncFault::NotReversed));
        }
        false
    }

    fn brake_to(&mut self, way: Segments, to: Option<f64>) {
        self.phase = Phase::Braking { way, time_s: 0.0, to };
    }

    /// The rest of a cycle in the middle of which braking began.
    fn brake_from(&mut self, time_s: f64) {
        if let Phase::Braking { way, to, .. } = self.phase {
            self.brake(&way, time_s - self.cycle_s, to);
        }
    }

    fn brake(&mut self, way: &Segments, time_s: f64, to: Option<f64>) {
        let time_s = time_s + self.cycle_s;
        self.state = way.at(time_s);
        if time_s < way.duration_s() {
            self.phase = Phase::Braking { way: *way, time_s, to };
            return;
        }
        // What is missing to the end of the piece is rounding.
        let rest = way.end.position;
        let rest = to.filter(|to| (to - rest).abs() < ROUNDING_MM).unwrap_or(rest);
        self.state = State::resting(rest);
        self.phase = Phase::Over;
    }

    /// How far off the pitch it is now, against the encoder as it was read.
    fn judge(&mut self, synced: &Synced, turns: f64) {
        if synced.tap.is_some() {
            let over_run_mm = self.report.over_run_mm.unwrap_or(0.0);
            self.report.over_run_mm = Some(over_run_mm.max(self.over_run_mm()));
        }
        let (Phase::Tracking, Some(turns0)) = (&self.phase, self.turns0) else {
            return;
        };
        let off = (self.state.position - synced.pitch_mm * (self.sense * turns - turns0)).abs();
        let in_step = off <= IN_STEP * synced.pitch_mm;
        if in_step && self.report.in_step_from_mm.is_none() {
            self.report.in_step_from_mm = Some(self.state.position);
        }
        if self.report.in_step_from_mm.is_some() {
            self.report.deviation_mm = self.report.deviation_mm.max(off);
            self.report.cycles_off += u64::from(!in_step);
        }
    }
}

#[cfg(test)]
mod tests;
