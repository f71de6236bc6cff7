//! Position, speed or any other loop: proportional, integral, derivative, with feed forward.

use crate::component::Component;
use crate::declare::component;

component! {
    /// Control loop with feed forward and limits. Integral does not grow against a limit of the output. Limits of 0 are none.
    Pid = "pid";
    in {
        enable: bool = false, "controls; else the output and the integral are 0";
        command: f64 = 0.0, "wanted value";
        feedback: f64 = 0.0, "actual value";
        command_deriv: Option<f64> = None, "speed of the command, 1/s; where no net reaches it, it is worked out";
        feedback_deriv: Option<f64> = None, "speed of the feedback, 1/s; where no net reaches it, it is worked out";
        deadband: f64 = 0.0, "an error this small is 0, a greater one is less by it";
        maxerror: f64 = 0.0, "limit of the error";
        maxerrori: f64 = 0.0, "limit of the integral";
        maxerrord: f64 = 0.0, "limit of the derivative of the error, 1/s";
        maxcmdd: f64 = 0.0, "limit of the speed of the command, 1/s";
        maxcmddd: f64 = 0.0, "limit of its acceleration, 1/s^2";
        maxcmdddd: f64 = 0.0, "limit of its jerk, 1/s^3";
        pgain: f64 = 1.0, "gain of the error";
        igain: f64 = 0.0, "gain of its integral, 1/s";
        dgain: f64 = 0.0, "gain of its derivative, s";
        ff0: f64 = 0.0, "gain of the command";
        ff1: f64 = 0.0, "gain of its speed, s";
        ff2: f64 = 0.0, "gain of its acceleration, s^2";
        ff3: f64 = 0.0, "gain of its jerk, s^3";
        bias: f64 = 0.0, "is added";
        maxoutput: f64 = 0.0, "limit of the output";
        index_enable: bool = false, "as it falls, command and feedback have jumped: speeds that are worked out stay, error of this command";
        error_previous_target: bool = true, "the error is that of the command of the call before, which the feedback answers to";
    }
    out {
        error: f64 = 0.0, "command less feedback";
        output: f64 = 0.0, "what the loop asks for; 0 where an input is no number";
        saturated: bool = false, "the output is at its limit";
        saturated_s: f64 = 0.0, "for how long, s";
        saturated_count: i32 = 0, "for how many calls";
    }
    state { integral: f64 = 0.0; before: Option<[f64; 2]> = None; speeds: [f64; 2] = [0.0; 2]; derivatives: [f64; 3] = [0.0; 3]; index_before: bool = false; limit: f64 = 0.0; }
}

/// Within `most` of 0; any value where `most` is 0. RT.
fn within(value: f64, most: f64) -> f64 {
    if most > 0.0 && value.abs() > most {
        most.copysign(value)
    } else {
        value
    }
}

impl Component for Pid {
    fn update(&mut self, period_s: f64) {
        let index_fell = std::mem::replace(&mut self.index_before, self.index_enable) && !self.index_enable;
        let now = [self.command, self.feedback];
        let [command_before, feedback_before] = self.before.unwrap_or(now);
        let compared = match self.error_previous_target && !index_fell {
            true => command_before,
            false => self.command,
        };
        self.error = compared - self.feedback;
        let error = within(self.error, self.maxerror);
        let error = if error > self.deadband {
            error - self.deadband
        } else if error < -self.deadband {
            error + self.deadband
        } else {
            0.0
        };
        if now.iter().all(|value| value.is_finite()) {
            if !index_fell {
                self.speeds = [
                    (self.command - command_before) / period_s,
                    (self.feedback - feedback_before) / period_s,
                ];
            }
            self.before = Some(now);
        }
        let command_deriv = self.command_deriv.unwrap_or(self.speeds[0]);
        let feedback_deriv = self.feedback_deriv.unwrap_or(self.speeds[1]);
        let [speed_before, acceleration_before, _] = self.derivatives;
        let speed = within(command_deriv, self.maxcmdd);
        let acceleration = within((speed - speed_before) / period_s, self.maxcmddd);
        let jerk = within((acceleration - acceleration_before) / period_s, self.maxcmdddd);
        let derivatives = [speed, acceleration, jerk];
        let error_deriv = within(command_deriv - feedback_deriv, self.maxerrord);
        self.finish(error, error_deriv, derivatives, period_s);
        if derivatives.iter().all(|value| value.is_finite()) {
            self.derivatives = derivatives;
        }
    }
}

impl Pid {
    /// Integral, sum, limit. RT.
    fn finish(&mut self, error: f64, error_deriv: f64, [speed, acceleration, jerk]: [f64; 3], period_s: f64) {
        if !self.enable {
            (self.integral, self.output, self.limit) = (0.0, 0.0, 0.0);
        } else {
            if error * self.limit <= 0.0 {
                self.integral += error * period_s;
            }
            self.integral = within(self.integral, self.maxerrori);
            let forward = self.ff0 * self.command + self.ff1 * speed + self.ff2 * acceleration + self.ff3 * jerk;
            let loops = self.pgain * error + self.igain * self.integral + self.dgain * error_deriv;
            let wanted = self.bias + loops + forward;
            self.output = within(wanted, self.maxoutput);
            if !self.output.is_finite() || !self.integral.is_finite() {
                (self.output, self.integral) = (0.0, 0.0);
            }
            self.limit = if self.output == wanted {
                0.0
            } else {
                1f64.copysign(wanted)
            };
        }
        self.saturated = self.limit != 0.0;
        (self.saturated_s, self.saturated_count) = match self.saturated {
            true => (self.saturated_s + period_s, self.saturated_count.saturating_add(1)),
            false => (0.0, 0),
        };
    }
}
