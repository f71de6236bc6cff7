//! The drive of a joint with step pulses: what CiA 402 asks of a drive in CSP.
//!
//! In:  a payload with controlword, mode and target; pulses sent. Out: a payload with statusword, mode, position and error code;
//! where the pulses are to go.
//!
//! All lengths are in parts of a step. RT: nothing here allocates.

use crate::local_drive::Power;
use cia402::State;
use config::Joint;

/// 603F: the port does not take levels any more (output stage).
pub(super) const ERROR_PORT: u16 = 0x5410;

#[derive(Debug)]
pub(super) struct StepDrive {
    power: Power,
    /// Where the pulses are to be.
    target: i64,
    /// The way of the last cycle.
    velocity: i64,
    /// How much that becomes less in a cycle of a quick stop.
    stop: i64,
}

impl StepDrive {
    pub(super) fn new(joint: &Joint, stop: i64) -> StepDrive {
        StepDrive {
            power: Power::new(joint),
            target: 0,
            velocity: 0,
            stop,
        }
    }

    /// Whether the motor holds.
    pub(super) fn has_current(&self) -> bool {
        self.power.is_on()
    }

    /// What it tells when pulses to the place `made` were sent; `failed`: the port takes no more.
    pub(super) fn tell(&mut self, made: i64, failed: bool, payload: &mut [u8]) {
        if failed {
            self.rest_at(made);
            self.power.state = State::Fault;
        }
        let error = if failed { ERROR_PORT } else { 0 };
        self.power.tell(made, error, payload);
    }

    /// Does what it is told; pulses to the place `made` were sent. Gives where they are to be at the end of the next cycle.
    pub(super) fn obey(&mut self, made: i64, payload: &[u8]) -> i64 {
        let target = self.power.obey(made, payload);
        match self.power.state {
            State::QuickStopActive => {
                self.velocity -= self.velocity.signum() * self.stop.min(self.velocity.abs());
                self.target += self.velocity;
                if self.velocity == 0 {
                    self.power.state = State::SwitchOnDisabled;
                }
            }
            State::OperationEnabled if !self.power.is_homing() => {
                // The network knows the low 32 bits.
                let now = (self.target + self.power.offset) as i32;
                self.velocity = i64::from((target as i32).wrapping_sub(now));
                self.target += self.velocity;
            }
            _ => self.rest_at(made),
        }
        self.target
    }

    fn rest_at(&mut self, made: i64) {
        (self.target, self.velocity) = (made, 0);
    }
}
