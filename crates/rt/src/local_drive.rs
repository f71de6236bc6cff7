//! What drives of this process have in common: the state machine of CiA 402, as the control leads those on the bus, too.
//!
//! In:  controlwords. Out: statuswords; payloads of such drives, which lie behind those of the nodes. RT, but for [`plans`].

use bus::layout::{Field, Layout};
use bus::plan::NodePlan;
use cia402::device::transition;
use cia402::profile::{Command, State, controlword, mode, statusword};
use config::{Config, Joint, Mapped};

const fn mapped(index: u16, bits: u8) -> Mapped {
    Mapped { index, sub: 0, bits }
}

/// What such a drive gets: controlword, mode and the target of its mode.
pub(super) fn outputs(joint: &Joint) -> Layout {
    let (index, _) = joint.mode.target();
    let bits = if index == 0x6071 { 16 } else { 32 };
    Layout::new(&[mapped(0x6040, 16), mapped(0x6060, 8), mapped(index, bits)])
}

/// What it tells: statusword, mode, position and error code.
pub(super) fn inputs() -> Layout {
    Layout::new(&[
        mapped(0x6041, 16),
        mapped(0x6061, 8),
        mapped(0x6064, 32),
        mapped(0x603F, 16),
    ])
}

/// Plans of the drives of this process, in the order of their joints: they stand behind those of the nodes.
pub fn plans(config: &Config) -> impl Iterator<Item = NodePlan> {
    let local = config.joints.iter().filter(|joint| joint.is_local());
    local.map(|joint| NodePlan {
        outputs: outputs(joint),
        inputs: inputs(),
        configuration: Vec::new(),
        writes: Vec::new(),
        expected: Vec::new(),
        stamp: None,
        left_out: Vec::new(),
    })
}

/// State of such a drive, and where it is homed: where it stands.
#[derive(Debug)]
pub(super) struct Power {
    pub(super) state: State,
    pub(super) mode: i8,
    /// The mode in which it is run.
    cyclic: i8,
    /// What is told as position, less what is counted.
    pub(super) offset: i64,
    homed: bool,
    controlword: u16,
    outputs: [Field; 3],
    inputs: [Field; 4],
}

impl Power {
    pub(super) fn new(joint: &Joint) -> Power {
        Power {
            state: State::SwitchOnDisabled,
            mode: joint.mode.code(),
            cyclic: joint.mode.code(),
            offset: 0,
            homed: false,
            controlword: 0,
            outputs: outputs(joint).fields.try_into().expect("one field an object"),
            inputs: inputs().fields.try_into().expect("one field an object"),
        }
    }

    /// Whether there is current.
    pub(super) fn is_on(&self) -> bool {
        matches!(self.state, State::OperationEnabled | State::QuickStopActive)
    }

    /// Whether it is homing.
    pub(super) fn is_homing(&self) -> bool {
        self.mode == mode::HOMING
    }

    /// Tells what it is like, at a place that is counted so.
    pub(super) fn tell(&self, counted: i64, error_code: u16, payload: &mut [u8]) {
        let mut word = self.state.statusword() | statusword::VOLTAGE_ENABLED | statusword::REMOTE;
        word |= match (self.is_homing(), self.homed) {
            (true, true) => statusword::MODE_ACK | statusword::TARGET_REACHED,
            (true, false) => statusword::TARGET_REACHED,
            (false, _) if self.state == State::OperationEnabled => statusword::MODE_ACK,
            (false, _) => 0,
        };
        let values = [
            u64::from(word),
            self.mode as u64,
            (counted + self.offset) as u64,
            u64::from(error_code),
        ];
        for (field, value) in self.inputs.iter().zip(values) {
            field.write(payload, value);
        }
    }

    /// Takes controlword and mode; gives the target. The place where it stands is home when that is asked for.
    pub(super) fn obey(&mut self, counted: i64, payload: &[u8]) -> i64 {
        let [word, wanted, target] = self.outputs;
        let (word, wanted) = (word.read(payload) as u16, wanted.read_signed(payload) as i8);
        let risen = word & !self.controlword;
        self.controlword = word;
        let command = Command::from_controlword(word);
        // A fault is reset by an edge.
        let counts = command != Command::FaultReset || risen & Command::FaultReset as u16 != 0;
        if let Some((_, to)) = transition(self.state, command).filter(|_| counts) {
            self.state = to;
        }
        if wanted == mode::HOMING || wanted == self.cyclic {
            self.mode = wanted;
        }
        if self.state == State::OperationEnabled && self.is_homing() {
            if risen & controlword::MODE_START != 0 {
                self.offset = -counted;
                self.homed = true;
            }
            self.homed &= word & controlword::MODE_START != 0;
        }
        target.read_signed(payload)
    }
}
