//! The drive of a joint with step pulses: what CiA 402 asks of a drive in CSP that is homed where it stands.
//!
//! In:  a payload with controlword, mode and target; pulses sent. Out: a payload with statusword, mode, position and error code;
//! where the pulses are to go.
//!
//! All lengths are in parts of a step. RT: nothing here allocates.

use super::{INPUTS, OUTPUTS};
use crate::bus::layout::{Field, Layout};
use cia402::device::transition;
use cia402::profile::{Command, State, controlword, mode, statusword};

/// 603F: the port does not take levels any more (output stage).
pub(super) const ERROR_PORT: u16 = 0x5410;

#[derive(Debug)]
pub(super) struct StepDrive {
    outputs: [Field; 3],
    inputs: [Field; 4],
    state: State,
    mode: i8,
    /// What is told as position, less what was sent.
    offset: i64,
    /// Where the pulses are to be, without the offset.
    target: i64,
    /// The way of the last cycle.
    velocity: i64,
    /// How much that becomes less in a cycle of a quick stop.
    stop: i64,
    homed: bool,
    controlword: u16,
}

impl StepDrive {
    pub(super) fn new(stop: i64) -> StepDrive {
        let fields = |objects: &[_]| Layout::new(objects).fields;
        StepDrive {
            outputs: fields(&OUTPUTS).try_into().expect("one field an object"),
            inputs: fields(&INPUTS).try_into().expect("one field an object"),
            state: State::SwitchOnDisabled,
            mode: mode::CYCLIC_SYNCHRONOUS_POSITION,
            offset: 0,
            target: 0,
            velocity: 0,
            stop,
            homed: false,
            controlword: 0,
        }
    }

    /// Whether the motor holds.
    pub(super) fn has_current(&self) -> bool {
        matches!(self.state, State::OperationEnabled | State::QuickStopActive)
    }

    /// What it tells when pulses to the place `made` were sent; `failed`: the port takes no more.
    pub(super) fn tell(&mut self, made: i64, failed: bool, payload: &mut [u8]) {
        if failed && self.state != State::Fault {
            self.rest_at(made);
            self.state = State::Fault;
        }
        let mut word = self.state.statusword() | statusword::VOLTAGE_ENABLED | statusword::REMOTE;
        let enabled = self.state == State::OperationEnabled;
        word |= match self.mode {
            mode::HOMING if self.homed => statusword::MODE_ACK | statusword::TARGET_REACHED,
            mode::HOMING => statusword::TARGET_REACHED,
            _ if enabled => statusword::MODE_ACK,
            _ => 0,
        };
        let error = if self.state == State::Fault { ERROR_PORT } else { 0 };
        let values = [
            u64::from(word),
            self.mode as u64,
            (made + self.offset) as u64,
            u64::from(error),
        ];
        for (field, value) in self.inputs.iter().zip(values) {
            field.write(payload, value);
        }
    }

    /// Does what it is told; pulses to the place `made` were sent. Gives where they are to be at the end of the next cycle.
    pub(super) fn obey(&mut self, made: i64, payload: &[u8]) -> i64 {
        let [word, wanted, target] = self.outputs;
        let (word, wanted) = (word.read(payload) as u16, wanted.read_signed(payload) as i8);
        let risen = word & !self.controlword;
        self.controlword = word;
        let command = Command::from_controlword(word);
        // A fault is reset by an edge.
        let is_edge = command != Command::FaultReset || risen & Command::FaultReset as u16 != 0;
        if let Some((_, to)) = transition(self.state, command).filter(|_| is_edge) {
            if self.state == State::OperationEnabled && to != State::QuickStopActive {
                self.rest_at(made);
            }
            self.state = to;
        }
        if matches!(wanted, mode::HOMING | mode::CYCLIC_SYNCHRONOUS_POSITION) {
            self.mode = wanted;
        }
        match (self.state, self.mode) {
            (State::QuickStopActive, _) => {
                self.velocity -= self.velocity.signum() * self.stop.min(self.velocity.abs());
                self.target += self.velocity;
                if self.velocity == 0 {
                    self.state = State::SwitchOnDisabled;
                }
            }
            (State::OperationEnabled, mode::HOMING) => {
                self.rest_at(made);
                if risen & controlword::MODE_START != 0 {
                    self.offset = -made;
                    self.homed = true;
                }
                self.homed &= word & controlword::MODE_START != 0;
            }
            (State::OperationEnabled, _) => {
                // The network knows the low 32 bits.
                let now = (self.target + self.offset) as i32;
                self.velocity = i64::from((target.read(payload) as i32).wrapping_sub(now));
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
