//! The drive's own set-point generator.
//!
//! In:  a target per period, or a speed to reach. Out: the [`Demand`] of the next period.

/// Which loop of the motor the demand is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Control {
    /// The position loop.
    #[default]
    Position,
    /// The velocity loop: nobody in the drive holds a position.
    Velocity,
    /// The torque alone.
    Torque,
}

/// What the motor's loop is to do during the next period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// Torque is on. If not, the rest means nothing.
    pub powered: bool,
    /// Which of the following counts.
    pub control: Control,
    /// Position at the end of the period, motor counts. In the other two, what the motor would reach without a lag.
    pub position: f64,
    /// Velocity at the end of the period, counts/s.
    pub velocity: f64,
    /// Velocity that whoever leads the drive feeds forward into its position loop (60B1), counts/s; 0: the loop's own.
    pub feed_forward: f64,
    /// The brake holds the motor.
    pub brake: bool,
    /// Torque, 1/1000 of the rated one; beside position and velocity it is added to what their loops find.
    pub torque: f64,
}

/// Position and velocity that the motor is to follow, in motor counts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Generator {
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) torque: f64,
    pub(super) feed_forward: f64,
    pub(super) control: Control,
}

impl Generator {
    /// Follows a motor without torque.
    pub(super) fn track(&mut self, position: i64) {
        *self = Generator {
            position: position as f64,
            ..Generator::default()
        };
    }

    /// Runs at a speed from where the motor is.
    pub(super) fn run(&mut self, from: i64, velocity: f64, torque: f64, period_s: f64) {
        *self = Generator {
            position: from as f64 + velocity * period_s,
            velocity,
            torque,
            feed_forward: 0.0,
            control: Control::Velocity,
        };
    }

    /// Gives a torque to a motor that is where it is.
    pub(super) fn push(&mut self, from: i64, velocity: i64, torque: f64) {
        *self = Generator {
            position: from as f64,
            velocity: velocity as f64,
            torque,
            feed_forward: 0.0,
            control: Control::Torque,
        };
    }

    fn by_position(&mut self) {
        (self.control, self.torque, self.feed_forward) = (Control::Position, 0.0, 0.0);
    }

    /// Moves to a position within one period.
    pub(super) fn follow(&mut self, position: f64, period_s: f64) {
        self.by_position();
        self.velocity = (position - self.position) / period_s;
        self.position = position;
    }

    /// Changes the velocity towards `velocity` by at most `acceleration`; true when it is reached.
    ///
    /// The velocity runs straight over the period: `s = (v0 + v1) / 2 · t`.
    pub(super) fn approach(&mut self, velocity: f64, acceleration: f64, period_s: f64) -> bool {
        self.by_position();
        let step = acceleration * period_s;
        let before = self.velocity;
        self.velocity = velocity.clamp(before - step, before + step);
        self.position += (before + self.velocity) / 2.0 * period_s;
        self.velocity == velocity
    }

    /// One period of the way to a goal: `speed` and speed at the goal, acceleration and deceleration. True once it is there, or
    /// past it where it does not stop.
    pub(super) fn go(&mut self, goal: f64, [speed, end]: [f64; 2], [up, down]: [f64; 2], period_s: f64) -> bool {
        self.by_position();
        let way = goal - self.position;
        let direction = if way < 0.0 { -1.0 } else { 1.0 };
        let (left, before) = (way * direction, self.velocity * direction);
        if before < 0.0 {
            self.approach(0.0, down, period_s);
            return false;
        }
        let step = down * period_s;
        if end == 0.0 && before <= step && left <= step * period_s {
            (self.position, self.velocity) = (goal, 0.0);
            return true;
        }
        // The greatest speed at the end of the period from which the goal can still be reached as it is to be.
        let fits = |after: f64| {
            let then = left - (before + after) / 2.0 * period_s;
            then >= 0.0 && after * after - end * end <= 2.0 * down * then
        };
        let (mut low, mut high) = (
            (before - step).max(0.0),
            (before + up * period_s).min(speed.max(before - step)),
        );
        if fits(high) {
            low = high;
        }
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            if fits(middle) { low = middle } else { high = middle }
        }
        self.velocity = low * direction;
        self.position += (before + low) / 2.0 * period_s * direction;
        (goal - self.position) * direction <= 0.0
    }

    pub(super) fn at_rest(&self) -> bool {
        self.velocity == 0.0
    }
}

/// To the nearest count. (`f64::round` needs std.)
pub(super) fn round(counts: f64) -> i64 {
    (counts + if counts < 0.0 { -0.5 } else { 0.5 }) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_takes_half_of_v_squared_over_a() {
        let mut generator = Generator {
            position: 0.0,
            velocity: 1000.0,
            ..Generator::default()
        };
        let mut periods = 1;
        while !generator.approach(0.0, 10_000.0, 0.001) {
            periods += 1;
        }
        assert_eq!(periods, 100);
        assert!((generator.position - 50.0).abs() < 1e-9, "{}", generator.position);
    }

    #[test]
    fn rounding_is_to_the_nearest_count() {
        assert_eq!([1.4, 1.6, -1.4, -1.6].map(round), [1, 2, -1, -2]);
    }
}
