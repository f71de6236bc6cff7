//! Motion of one joint, or along a path, as pieces of constant jerk.
//!
//! In:  where the joint is and how it moves, the limits, a wanted velocity.
//! Out: the pieces, and the state at any time on them.
//!
//! RT: no allocation, every loop bounded by [`PIECES_MAX`].

use crate::rt::StopLimits;

/// Where a joint is and how it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// mm (degrees).
    pub position: f64,
    /// mm/s (degrees/s).
    pub velocity: f64,
    /// mm/s² (degrees/s²).
    pub acceleration: f64,
}

impl State {
    /// At rest at a position, in the unit of the axis.
    pub const fn resting(position: f64) -> State {
        State {
            position,
            velocity: 0.0,
            acceleration: 0.0,
        }
    }

    /// The state after `time_s` of constant jerk. RT.
    pub fn after(self, time_s: f64, jerk: f64) -> State {
        let State {
            position,
            velocity,
            acceleration,
        } = self;
        State {
            position: position + time_s * (velocity + time_s * (acceleration / 2.0 + time_s * jerk / 6.0)),
            velocity: velocity + time_s * (acceleration + time_s * jerk / 2.0),
            acceleration: acceleration + time_s * jerk,
        }
    }

    /// Whether nothing moves nor is about to.
    pub fn is_at_rest(&self) -> bool {
        self.velocity == 0.0 && self.acceleration == 0.0
    }
}

/// Three to another velocity, then seven to a place.
pub(in crate::rt) const PIECES_MAX: usize = 10;

/// Pieces of constant jerk in a row, and the state they end in.
#[derive(Clone, Copy, Debug)]
pub(in crate::rt) struct Segments {
    start: State,
    /// Duration, s, and jerk.
    pieces: [(f64, f64); PIECES_MAX],
    count: usize,
    duration_s: f64,
    /// Taken for exact: what rounding leaves over is the target's, not the sum's.
    pub(in crate::rt) end: State,
}

impl Segments {
    /// Nothing but the state, which goes on with its velocity.
    pub(in crate::rt) fn none(start: State) -> Segments {
        Segments {
            start,
            pieces: [(0.0, 0.0); PIECES_MAX],
            count: 0,
            duration_s: 0.0,
            end: start,
        }
    }

    /// Times at which pieces end.
    pub(in crate::rt) fn borders(&self) -> impl Iterator<Item = f64> + '_ {
        self.pieces[..self.count].iter().scan(0.0, |end, (duration_s, _)| {
            *end += duration_s;
            Some(*end)
        })
    }

    /// Appends a piece; one of no length is left out.
    pub(in crate::rt) fn push(&mut self, duration_s: f64, jerk: f64) {
        if duration_s > 0.0 && self.count < PIECES_MAX {
            self.pieces[self.count] = (duration_s, jerk);
            self.count += 1;
            self.duration_s += duration_s;
            self.end = self.end.after(duration_s, jerk);
        }
    }

    /// From any state to a velocity without acceleration, as quickly as the limits allow; always found.
    ///
    /// The acceleration goes to a peak `p` with full jerk, stays there if that is the limit `A`, and goes back to 0. With
    /// `d` the direction in which velocity is missing once the acceleration is taken back, all measured along `d`:
    ///
    /// ```text
    /// p² = J dv + a0²/2, at most A²        dv = velocity missing, a0 = acceleration now
    /// hold = (dv - (2 p² - a0²)/(2 J))/A   where p = A; where a0 > A: hold = (dv - a0²/(2 J))/A
    /// ```
    ///
    /// To velocity 0 it is also the shortest way to rest.
    pub(in crate::rt) fn to_velocity(start: State, velocity: f64, limits: StopLimits) -> Segments {
        let StopLimits { acceleration, jerk } = limits;
        let a0 = start.acceleration;
        let missing = velocity - start.velocity;
        let direction = (missing - a0 * a0.abs() / (2.0 * jerk)).signum();
        let (a0, missing) = (a0 * direction, missing * direction);
        let peak = (jerk * missing + a0 * a0 / 2.0).max(0.0).sqrt();
        let mut segments = Segments::none(start);
        if peak <= acceleration {
            segments.push((peak - a0) / jerk, jerk * direction);
            segments.push(peak / jerk, -jerk * direction);
        } else {
            let both_ramps = if a0 <= acceleration {
                (2.0 * acceleration * acceleration - a0 * a0) / (2.0 * jerk)
            } else {
                a0 * a0 / (2.0 * jerk)
            };
            let first = acceleration - a0;
            segments.push(first.abs() / jerk, (jerk * direction).copysign(first * direction));
            segments.push((missing - both_ramps) / acceleration, 0.0);
            segments.push(acceleration / jerk, -jerk * direction);
        }
        segments.end.velocity = velocity;
        segments.end.acceleration = 0.0;
        segments
    }

    /// When the last piece is over, s.
    pub(in crate::rt) fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The state at a time since the start; behind the end the velocity of the end goes on. RT.
    pub(in crate::rt) fn at(&self, time_s: f64) -> State {
        if time_s >= self.duration_s {
            return self.end.after(time_s - self.duration_s, 0.0);
        }
        let (mut state, mut left_s) = (self.start, time_s);
        for &(duration_s, jerk) in &self.pieces[..self.count] {
            if left_s <= duration_s {
                return state.after(left_s, jerk);
            }
            state = state.after(duration_s, jerk);
            left_s -= duration_s;
        }
        self.end
    }

    /// The jerk at a time since the start. RT.
    pub(in crate::rt) fn jerk_at(&self, time_s: f64) -> f64 {
        let mut left_s = time_s;
        for &(duration_s, jerk) in &self.pieces[..self.count] {
            if left_s < duration_s {
                return jerk;
            }
            left_s -= duration_s;
        }
        0.0
    }

    /// Least and greatest position on the way. RT.
    pub(in crate::rt) fn extent(&self) -> [f64; 2] {
        let mut state = self.start;
        let mut extent = [state.position; 2];
        let mut see = |position: f64| extent = [extent[0].min(position), extent[1].max(position)];
        for &(duration_s, jerk) in &self.pieces[..self.count] {
            for turn_s in turning_times(state, jerk) {
                if turn_s > 0.0 && turn_s < duration_s {
                    see(state.after(turn_s, jerk).position);
                }
            }
            state = state.after(duration_s, jerk);
            see(state.position);
        }
        extent
    }
}

/// When the velocity passes zero under constant jerk; what is not real is NaN.
fn turning_times(state: State, jerk: f64) -> [f64; 2] {
    let State {
        velocity, acceleration, ..
    } = state;
    if jerk == 0.0 {
        return [-velocity / acceleration; 2];
    }
    // j/2 t² + a t + v = 0, each root in the form without cancellation.
    let root = (acceleration * acceleration - 2.0 * jerk * velocity).sqrt();
    let sum = -(acceleration + root.copysign(acceleration));
    [sum / jerk, 2.0 * velocity / sum]
}
