//! The pins of the position loops that the control closes: gains that may be turned while the machine runs, and what a loop does.
//!
//! In:  gains of the machine file; pins. Out: gains in force; pins.
//!
//! Names are those of LinuxCNC's component `pid`, in lower case. Limits are those of the machine file only.
//!
//! RT: nothing allocates but [`LoopPins::of_machine`].

use super::drives::Drives;
use config::{Config, GAIN_MAX};
use hal_pins::{Hal, HalError, Input, Output};
use motion::rt::PidGains;

/// Gains in the order of their pins.
fn in_order(gains: &PidGains) -> [f64; 9] {
    let [ff0, ff1, ff2, ff3] = gains.ff;
    let PidGains {
        p,
        i,
        d,
        bias,
        dead_band,
        ..
    } = *gains;
    [p, i, d, ff0, ff1, ff2, ff3, bias, dead_band]
}

/// Whether the machine file would allow a value of the pin of this number.
fn is_legal(number: usize, value: f64) -> bool {
    match number {
        0 => value > 0.0 && value <= GAIN_MAX,
        1 | 2 | 8 => (0.0..=GAIN_MAX).contains(&value),
        _ => (-GAIN_MAX..=GAIN_MAX).contains(&value),
    }
}

/// Those of one joint.
pub struct LoopPins {
    joint: usize,
    gains: [Input<f64>; 9],
    error: Output<f64>,
    output: Output<f64>,
    saturated: Output<bool>,
}

impl LoopPins {
    /// Those of all joints whose loops the control closes.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn of_machine(hal: &mut Hal, config: &Config) -> Result<Vec<LoopPins>, HalError> {
        let with_loop = config.joints.iter().enumerate();
        let with_loop = with_loop.filter_map(|(joint, of_joint)| Some((joint, of_joint.pid.as_ref()?)));
        with_loop
            .map(|(joint, gains)| LoopPins::new(hal, joint, gains))
            .collect()
    }

    /// Gains begin as the machine file has them.
    pub(super) fn new(hal: &mut Hal, joint: usize, gains: &PidGains) -> Result<LoopPins, HalError> {
        let mut input = |name: &str, value: f64| hal.input(&format!("pid.{joint}.{name}"), value);
        let [ff0, ff1, ff2, ff3] = gains.ff;
        let gains = [
            input("pgain", gains.p)?,
            input("igain", gains.i)?,
            input("dgain", gains.d)?,
            input("ff0", ff0)?,
            input("ff1", ff1)?,
            input("ff2", ff2)?,
            input("ff3", ff3)?,
            input("bias", gains.bias)?,
            input("deadband", gains.dead_band)?,
        ];
        Ok(LoopPins {
            joint,
            gains,
            error: hal.output(&format!("pid.{joint}.error"))?,
            output: hal.output(&format!("pid.{joint}.output"))?,
            saturated: hal.output(&format!("pid.{joint}.saturated"))?,
        })
    }

    /// Once a cycle, before the loops are closed; `are_lost` is asked behind the reading: pins that were cut away read as 0. A value
    /// beyond what the machine file allows is not taken, and its pin shows again what is in force. RT.
    pub fn turn(&self, drives: &mut Drives, are_lost: impl Fn() -> bool) {
        let Some(now) = drives.iter().nth(self.joint).and_then(|drive| drive.position_loop()) else {
            return;
        };
        let values = self.gains.each_ref().map(Input::get);
        let [p, i, d, ff0, ff1, ff2, ff3, bias, dead_band] = values;
        let wanted = PidGains {
            p,
            i,
            d,
            ff: [ff0, ff1, ff2, ff3],
            bias,
            dead_band,
            ..*now.gains()
        };
        let in_force = in_order(now.gains());
        if values == in_force || are_lost() {
            return;
        }
        let mut legal = true;
        for (number, (pin, (value, in_force))) in self.gains.iter().zip(values.into_iter().zip(in_force)).enumerate() {
            if !is_legal(number, value) {
                pin.correct(value, in_force);
                legal = false;
            }
        }
        if legal {
            drives.set_gains(self.joint, wanted);
        }
    }

    /// Once a cycle. RT.
    pub fn show(&mut self, drives: &Drives) {
        if let Some(pid) = drives.iter().nth(self.joint).and_then(|drive| drive.position_loop()) {
            self.error.set(pid.error());
            self.output.set(pid.output());
            self.saturated.set(pid.is_saturated());
        }
    }
}
