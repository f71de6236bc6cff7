//! Position loop of one joint: PID with feed-forward of the command's derivatives.
//!
//! In:  command and feedback once a cycle, in units of the joint (mm, degrees).
//! Out: what the amplifier is told, in units of the amplifier (mm/s of a velocity amplifier, share of the rated torque of a
//! torque amplifier).
//!
//! Names, limits and the order of the steps are those of LinuxCNC's component `pid`, so that tuned values can be taken over. A limit
//! of 0 is none.

/// Gains and limits of a loop; all 0 but what is set.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PidGains {
    /// Output for a unit of error.
    pub p: f64,
    /// Output for a unit of error that has lasted a second.
    pub i: f64,
    /// Output for a unit/s of the error's derivative.
    pub d: f64,
    /// Output for the command, its velocity, acceleration and jerk.
    pub ff: [f64; 4],
    /// Always added.
    pub bias: f64,
    /// An error smaller than this is none, unit.
    pub dead_band: f64,
    /// Greatest error that counts, unit.
    pub error_max: f64,
    /// Greatest integral of the error, unit s.
    pub integral_max: f64,
    /// Greatest derivative of the error, unit/s.
    pub derivative_max: f64,
    /// Greatest velocity, acceleration and jerk of the command that are fed forward.
    pub ff_max: [f64; 3],
    /// Greatest output.
    pub output_max: f64,
}

/// The loop of one joint.
#[derive(Clone, Debug)]
pub struct Pid {
    gains: PidGains,
    period_s: f64,
    integral: f64,
    command: f64,
    feedback: f64,
    /// Velocity and acceleration of the command as they were fed forward last.
    derivatives: [f64; 2],
    /// Which limit of the output acted last: -1, 0 or 1.
    limited: f64,
    error: f64,
    output: f64,
    /// Periods that were left out since the last call.
    left_out: u64,
}

/// `value` within `most` of 0; 0: any.
fn limited(value: f64, most: f64) -> f64 {
    if most > 0.0 { value.clamp(-most, most) } else { value }
}

impl Pid {
    /// A loop that is called every `period_s` and stands still.
    pub fn new(gains: PidGains, period_s: f64) -> Pid {
        Pid {
            gains,
            period_s,
            integral: 0.0,
            command: 0.0,
            feedback: 0.0,
            derivatives: [0.0; 2],
            limited: 0.0,
            error: 0.0,
            output: 0.0,
            left_out: 0,
        }
    }

    /// Begins anew with a joint at rest that is held where it stands: nothing of what was before acts. RT.
    pub fn restart(&mut self, position: f64) {
        *self = Pid {
            command: position,
            feedback: position,
            ..Pid::new(self.gains, self.period_s)
        };
    }

    /// Other gains from the next call on; what the integral adds goes on, so that the output does not jump by it. RT.
    pub fn set_gains(&mut self, gains: PidGains) {
        self.integral = match gains.i {
            0.0 => 0.0,
            i => limited(self.integral * self.gains.i / i, gains.integral_max),
        };
        self.gains = gains;
    }

    /// One period. The error is that of the command of the call before, which is what the feedback answers to. RT.
    #[inline]
    pub fn step(&mut self, command: f64, feedback: f64) -> f64 {
        let gains = &self.gains;
        let period_s = self.period_s;
        let error = limited(self.command - feedback, gains.error_max);
        self.error = error;
        let error = if error > gains.dead_band {
            error - gains.dead_band
        } else if error < -gains.dead_band {
            error + gains.dead_band
        } else {
            0.0
        };
        // No winding up: the integral only grows away from a limit of the output.
        if error * self.limited <= 0.0 {
            self.integral = limited(self.integral + error * period_s, gains.integral_max);
        }
        let velocity = (command - self.command) / period_s;
        let since_s = period_s * (1 + std::mem::take(&mut self.left_out)) as f64;
        let derivative = limited(velocity - (feedback - self.feedback) / since_s, gains.derivative_max);
        let [velocity_before, acceleration_before] = self.derivatives;
        let [velocity_max, acceleration_max, jerk_max] = gains.ff_max;
        let velocity = limited(velocity, velocity_max);
        let acceleration = limited((velocity - velocity_before) / period_s, acceleration_max);
        let jerk = limited((acceleration - acceleration_before) / period_s, jerk_max);
        let fed_forward = [command, velocity, acceleration, jerk];
        let fed_forward: f64 = gains.ff.iter().zip(fed_forward).map(|(gain, value)| gain * value).sum();
        let wanted = gains.bias + gains.p * error + gains.i * self.integral + gains.d * derivative + fed_forward;
        self.output = limited(wanted, gains.output_max);
        self.limited = if self.output < wanted {
            1.0
        } else if self.output > wanted {
            -1.0
        } else {
            0.0
        };
        self.command = command;
        self.feedback = feedback;
        self.derivatives = [velocity, acceleration];
        self.output
    }

    /// So many periods were left out: the joint has gone on meanwhile, the command has not. RT.
    pub fn leave_out(&mut self, periods: u64) {
        self.left_out += periods;
    }

    /// One period of which no feedback has come: the joint is taken to follow. RT.
    pub fn step_blind(&mut self, command: f64) -> f64 {
        self.step(command, self.feedback + command - self.command)
    }

    /// Gains and limits in force.
    pub fn gains(&self) -> &PidGains {
        &self.gains
    }

    /// Output of the last call.
    pub fn output(&self) -> f64 {
        self.output
    }

    /// Error of the last call, within its limit.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Whether the last output was limited.
    pub fn is_saturated(&self) -> bool {
        self.limited != 0.0
    }
}

#[cfg(test)]
mod tests;
