//! Faults of the simulated machine that its machine file asks for.
//!
//! In:  `[[sim.fault]]`, the time, the states of the drives. Out: what happens to a drive, once.

use super::machine::SimMachine;
use crate::config::{Config, InputBits, SimFaultKind};
use cia402::State;

/// 603F: continuous over-current at the output.
const OVERCURRENT: u16 = 0x2310;

/// A fault that is still to come, or has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scripted {
    /// Index of the node.
    pub(super) place: usize,
    /// Axis of it.
    pub(super) axis: u8,
    kind: SimFaultKind,
    after_ns: u64,
    /// When the operation of the drive was first enabled.
    enabled_ns: Option<u64>,
    done: bool,
    /// Bit of 60FD that shows the lower limit switch of the drive.
    lower_limit: u8,
}

/// The faults of a machine file that come later.
pub(super) fn script(config: &Config) -> Vec<Scripted> {
    let faults = config.sim.faults.iter().map(|fault| Scripted {
        place: fault.node,
        axis: fault.drive_axis,
        kind: fault.kind,
        after_ns: (fault.after_s * 1e9) as u64,
        enabled_ns: None,
        done: false,
        lower_limit: {
            let drive = config.bus.nodes[fault.node].drive.as_ref();
            drive.map_or(InputBits::default(), |drive| drive.input_bits).limits[0]
        },
    });
    faults.collect()
}

impl Scripted {
    /// Whether it happens now; once only.
    pub(super) fn is_due(&mut self, now_ns: u64, state: Option<State>) -> bool {
        if state == Some(State::OperationEnabled) {
            self.enabled_ns.get_or_insert(now_ns);
        }
        let is_due = !self.done
            && self
                .enabled_ns
                .is_some_and(|enabled_ns| now_ns.saturating_sub(enabled_ns) >= self.after_ns);
        self.done |= is_due;
        is_due
    }

    /// Does it to the drive of a node.
    pub(super) fn strike(self, machine: &mut SimMachine, node: u8) {
        let id = (node, self.axis);
        match self.kind {
            SimFaultKind::Overcurrent => {
                machine.raise_drive_fault(id, OVERCURRENT);
            }
            SimFaultKind::FollowingError => {
                machine.jam(id, true);
            }
            SimFaultKind::LimitSwitch => {
                if let Some(injected) = machine.drive_injected(id) {
                    injected.digital_inputs |= 1 << self.lower_limit;
                }
            }
            SimFaultKind::PowerOff => {
                machine.power_off(node);
            }
            SimFaultKind::Sto => {
                if let Some(injected) = machine.drive_injected(id) {
                    injected.sto_open = true;
                }
            }
            // So from the start.
            SimFaultKind::IndexMissing | SimFaultKind::SlowEnable => {}
        }
    }
}
