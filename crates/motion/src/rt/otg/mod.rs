//! The online generator: one joint from wherever it is, however it moves, to a place or a velocity, jerk-limited.
//!
//! In:  goals, at any cycle: a place, a velocity, rest, an emergency stop.
//! Out: one [`State`] per cycle; divided differences of the positions keep velocity, acceleration and jerk.
//!
//! Ways to a place are time-optimal ones of the crate rsruckig. Its solver of one joint is called directly: it says
//! with `false` that it found none, where the crate's outer calls would build a text, which real time cannot afford. A way
//! that is not found, or that goes farther than it has to, is replaced by one by way of rest, and if need be by rest: our
//! own shortest way to rest is closed-form and always exists.
//!
//! The solver's tolerances are absolute and made for metres, so it is given thousandths of mm or degrees, and distances
//! from where the joint is.
//!
//! RT: nothing allocates but [`TrajectoryGenerator::new`]; a new goal costs about a µs, a cycle some ns.

pub(super) mod segments;

pub use segments::State;

use super::scale::{MotionLimits, StopLimits};
use rsruckig::block::Block;
use rsruckig::position_third_step1::PositionThirdOrderStep1;
use rsruckig::profile::Profile;
use segments::Segments;

/// Units of the solver in one of ours: metres in a mm.
const SOLVER_UNIT: f64 = 1e-3;
/// Rounding of a position against the range, mm.
const RANGE_SLACK: f64 = 1e-9;
/// Least share of the acceleration: with less a joint would seem to stand.
const SHARE_MIN: f64 = 0.01;
/// Share by which a velocity may be over its limit and be rounding of it.
const SPEED_SLACK: f64 = 1e-9;
/// Greatest distance between the end of a found way and its target that is rounding, mm.
const END_SLACK: f64 = 1e-8;

/// A state and the jerk in it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moving {
    pub(super) state: State,
    pub(super) jerk: f64,
}

/// A way to rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct RestWay(Segments);

impl RestWay {
    /// When it rests, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.0.duration_s()
    }

    /// Times since the beginning at which its jerk changes, s. RT.
    pub(super) fn borders(&self) -> impl Iterator<Item = f64> + '_ {
        self.0.borders()
    }

    /// How it moves at a time since the beginning. RT.
    pub(super) fn at(&self, time_s: f64) -> Moving {
        Moving {
            state: self.0.at(time_s),
            jerk: self.0.jerk_at(time_s),
        }
    }
}

/// What the joint is to reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goal {
    /// A velocity; 0 is rest.
    Velocity,
    /// A place, and rest there.
    Place,
    /// Rest as quickly as the stop limits allow; nothing else counts before it is reached.
    Stop,
}

/// The buffers of the solver, which are large.
#[derive(Debug, Default)]
struct Solver {
    solver: PositionThirdOrderStep1,
    block: Block,
}

/// Moves one joint.
#[derive(Debug)]
pub struct TrajectoryGenerator {
    limits: MotionLimits,
    /// All of its acceleration, of which `limits` may have a share.
    acceleration: f64,
    stop: StopLimits,
    range: [f64; 2],
    cycle_s: f64,
    state: State,
    segments: Segments,
    /// Since the beginning of the segments, s.
    time_s: f64,
    goal: Goal,
    stopping: bool,
    solver: Box<Solver>,
    unsolved: u32,
}

impl TrajectoryGenerator {
    /// A joint at rest that may go anywhere. `limits`: of all motion but emergency stops, which keep `stop`.
    pub fn new(position: f64, limits: MotionLimits, stop: StopLimits, cycle_s: f64) -> TrajectoryGenerator {
        let state = State::resting(position);
        TrajectoryGenerator {
            limits,
            acceleration: limits.acceleration,
            stop,
            range: [f64::NEG_INFINITY, f64::INFINITY],
            cycle_s,
            state,
            segments: Segments::none(state),
            time_s: 0.0,
            goal: Goal::Velocity,
            stopping: false,
            solver: Box::default(),
            unsolved: 0,
        }
    }

    /// Where places may lie; from a state that can come to rest within it, no way to one leaves it. Velocities know no range. RT.
    pub fn set_range(&mut self, range: [f64; 2]) {
        self.range = range;
    }

    /// Says where the joint stands: after something else has moved it. RT.
    pub fn rest_at(&mut self, position: f64) {
        self.go_on_from(State::resting(position));
    }

    /// Says where the joint is and how it moves: after something else has moved it. Without a goal it goes on with that velocity. RT.
    pub(super) fn go_on_from(&mut self, state: State) {
        self.goal = Goal::Velocity;
        self.limits.acceleration = self.acceleration;
        self.follow(Segments::none(state));
        self.state = state;
    }

    /// Share of its acceleration that it uses for the goals to come; what is no share above 0 is all of it. Less than before counts
    /// only from rest: a joint that moves may need what it had to rest within its range. RT.
    pub fn set_acceleration_share(&mut self, share: f64) {
        let share = if share > 0.0 && share <= 1.0 {
            share.max(SHARE_MIN)
        } else {
            1.0
        };
        let acceleration = share * self.acceleration;
        if acceleration > self.limits.acceleration || self.is_at_rest() {
            self.limits.acceleration = acceleration;
        }
    }

    /// Another joint, at rest, that may go anywhere. RT.
    pub fn restart(&mut self, position: f64, limits: MotionLimits, stop: StopLimits) {
        self.limits = limits;
        self.acceleration = limits.acceleration;
        self.stop = stop;
        self.range = [f64::NEG_INFINITY, f64::INFINITY];
        self.stopping = false;
        self.rest_at(position);
    }

    /// To a place and rest there, at no more than `velocity` (its sign is of no account). A target out of the range or not a
    /// number is none: the joint comes to rest. Without effect while an emergency stop is under way. RT.
    pub fn go_to(&mut self, target: f64, velocity: f64) {
        if self.is_in_a_stop() {
            return;
        }
        let [low, high] = self.range;
        if !(target >= low && target <= high && target.is_finite()) || velocity.is_nan() || velocity == 0.0 {
            self.run_at(0.0);
            return;
        }
        let velocity = velocity.abs().min(self.limits.velocity);
        self.goal = Goal::Place;
        self.set_out(target, velocity);
    }

    /// To a velocity, which is then kept; 0 is the shortest way to rest. A velocity that is NaN is 0. Without effect
    /// while an emergency stop is under way. RT.
    pub fn run_at(&mut self, velocity: f64) {
        if self.is_in_a_stop() {
            return;
        }
        let [least, most] = [-self.limits.velocity, self.limits.velocity];
        let velocity = if velocity.is_finite() {
            velocity.clamp(least, most)
        } else {
            0.0
        };
        self.goal = Goal::Velocity;
        self.follow(self.to_velocity(velocity));
    }

    /// Rest as quickly as the stop limits allow. RT.
    pub fn stop(&mut self) {
        if self.goal != Goal::Stop {
            self.goal = Goal::Stop;
            self.follow(Segments::to_velocity(self.state, 0.0, self.stop));
        }
    }

    /// One cycle further. RT.
    pub fn step(&mut self) -> State {
        self.stopping = self.is_in_a_stop();
        self.time_s += self.cycle_s;
        self.state = self.segments.at(self.time_s);
        if self.time_s >= self.segments.duration_s() {
            // From here on in small steps, so that hours at one velocity round no worse than a second.
            self.follow(Segments::none(self.state));
        }
        self.state
    }

    /// For how long its jerk stays what it is, s, on a way to somewhere. RT.
    pub(super) fn even_s(&self) -> f64 {
        let border = self.segments.borders().find(|border| *border > self.time_s);
        border.map_or(0.0, |border| border - self.time_s)
    }

    /// Goes on by so many cycles at once, no longer than [`TrajectoryGenerator::even_s`]. RT.
    pub(super) fn skip(&mut self, cycles: f64) {
        self.time_s += cycles * self.cycle_s;
    }

    /// Where the joint is and how it moves. RT.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether nothing moves nor will without a new goal. RT.
    pub fn is_at_rest(&self) -> bool {
        self.state.is_at_rest() && self.time_s >= self.segments.duration_s()
    }

    /// Whether the last cycle was part of an emergency stop, for which the limits of stops count. RT.
    pub fn is_stopping(&self) -> bool {
        self.stopping
    }

    /// Whether an emergency stop is under way, which nothing interrupts. RT.
    pub(super) fn is_in_a_stop(&self) -> bool {
        self.goal == Goal::Stop && !self.is_at_rest()
    }

    /// Where the joint comes to rest if it is told to now. RT.
    pub fn resting_place(&self) -> f64 {
        self.to_velocity(0.0).end.position
    }

    /// The state after the next cycle and the jerk on the way there, with nothing ordered meanwhile. RT.
    pub(super) fn next(&self) -> Moving {
        let time_s = self.time_s + self.cycle_s;
        Moving {
            state: self.segments.at(time_s),
            jerk: self.segments.jerk_at(self.time_s),
        }
    }

    /// The shortest way to rest from a state. RT.
    pub(super) fn rest_from(&self, state: State) -> RestWay {
        RestWay(self.to_velocity_from(state, 0.0))
    }

    /// Where the joint comes to rest with what it was told last; infinite where that is a velocity. RT.
    pub fn destination(&self) -> f64 {
        match self.goal {
            Goal::Velocity if self.segments.end.velocity != 0.0 => f64::INFINITY.copysign(self.segments.end.velocity),
            Goal::Velocity | Goal::Place | Goal::Stop => self.segments.end.position,
        }
    }

    /// Ways that the solver did not find.
    pub fn unsolved(&self) -> u32 {
        self.unsolved
    }

    fn to_velocity(&self, velocity: f64) -> Segments {
        self.to_velocity_from(self.state, velocity)
    }

    fn to_velocity_from(&self, state: State, velocity: f64) -> Segments {
        let MotionLimits { acceleration, jerk, .. } = self.limits;
        Segments::to_velocity(state, velocity, StopLimits { acceleration, jerk })
    }

    fn follow(&mut self, segments: Segments) {
        self.segments = segments;
        self.time_s = 0.0;
    }

    /// Sets out for a place: by the quickest way, else by way of rest, else to rest.
    fn set_out(&mut self, target: f64, velocity: f64) {
        let rest = self.to_velocity(0.0);
        let way = self
            .quickest(target, velocity, &rest)
            .or_else(|| self.append_way(rest, target, velocity));
        self.follow(way.unwrap_or(rest));
    }

    /// The quickest way to a place, if the solver finds it and it goes no farther than it has to.
    fn quickest(&mut self, target: f64, velocity: f64, rest: &Segments) -> Option<Segments> {
        let State {
            position,
            velocity: v0,
            acceleration: a0,
        } = self.state;
        // What the velocity comes to while the acceleration is taken back.
        let v1 = v0 + a0 * a0.abs() / (2.0 * self.limits.jerk);
        let fastest = velocity.max(v0.abs()).max(v1.abs());
        let way = if fastest <= velocity * (1.0 + SPEED_SLACK) {
            self.append_way(Segments::none(self.state), target, fastest)?
        } else {
            // Slower first. The solver could do it, too, but ends beside its tolerances.
            let slower = self.to_velocity(velocity.copysign(target - rest.end.position));
            self.append_way(slower, target, velocity)?
        };
        let least = position.min(target).min(rest.extent()[0]) - RANGE_SLACK;
        let most = position.max(target).max(rest.extent()[1]) + RANGE_SLACK;
        let [low, high] = way.extent();
        (low >= least && high <= most).then_some(way)
    }

    /// The quickest way from the end of `way` to rest at a place, if the solver finds it.
    fn append_way(&mut self, mut way: Segments, target: f64, velocity: f64) -> Option<Segments> {
        let Solver { solver, block } = &mut *self.solver;
        let v_max = velocity * SOLVER_UNIT;
        let a_max = self.limits.acceleration * SOLVER_UNIT;
        let j_max = self.limits.jerk * SOLVER_UNIT;
        let v0 = way.end.velocity * SOLVER_UNIT;
        // What rounding puts over the limit would have no solution; the way itself starts from what is.
        let a0 = (way.end.acceleration * SOLVER_UNIT).clamp(-a_max, a_max);
        let distance = (target - way.end.position) * SOLVER_UNIT;

        let mut profile = Profile::default();
        profile.set_boundary(0.0, v0, a0, distance, 0.0, 0.0);
        solver.reset(0.0, v0, a0, distance, 0.0, 0.0, v_max, -v_max, a_max, -a_max, j_max);
        if !solver.get_profile(&profile, block) {
            self.unsolved += 1;
            return None;
        }
        for (duration_s, jerk) in block.p_min.t.into_iter().zip(block.p_min.j) {
            way.push(duration_s, jerk / SOLVER_UNIT);
        }
        let off = (way.end.position - target).abs();
        way.end = State::resting(target);
        let found = off <= END_SLACK;
        self.unsolved += u32::from(!found);
        found.then_some(way)
    }
}

#[cfg(test)]
pub(super) mod tests;
