//! Faults of the simulated machine that its machine file asks for, or somebody while it runs.
//!
//! In:  `[[sim.fault]]`, the time, the states of the drives; what is written into [`FAULT`] of a drive.
//! Out: what happens to a drive, once.

use super::machine::SimMachine;
use cia402::State;
use cia402::profile::AXES_MAX;
use config::{Config, SimFaultKind};
use machine::fault_order::{FAULT, FaultOrder};
use obd::{AbortCode, DataType, EntryDef};

/// Its lines, one for each axis that a drive may have.
pub(super) static FAULT_OBJECTS: [EntryDef; AXES_MAX as usize] = {
    let mut lines = [EntryDef::rw(FAULT, DataType::U64, "Simulated_fault"); AXES_MAX as usize];
    let mut axis = 0;
    while axis < AXES_MAX {
        lines[axis as usize] = lines[axis as usize].sub(axis + 1);
        axis += 1;
    }
    lines
};

/// Whether the object takes a value.
pub(super) fn check_order(value: &[u8]) -> Result<(), AbortCode> {
    FaultOrder::from_octets(value).map(drop).ok_or(AbortCode::VALUE_RANGE)
}

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
        match self.kind {
            SimFaultKind::PowerOff => {
                machine.power_off(node);
            }
            // So from the start.
            SimFaultKind::IndexMissing | SimFaultKind::SlowEnable => {}
            kind => {
                let order = FaultOrder {
                    kind: Some(kind),
                    lasts_100ms: 0,
                };
                machine.fault((node, self.axis), order);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_order_comes_through_the_object_and_nothing_else_does() {
        let kinds = SimFaultKind::WORDS.map(|(_, kind)| Some(kind));
        for kind in kinds.into_iter().chain([None]) {
            let order = FaultOrder { kind, lasts_100ms: 513 };
            assert_eq!(FaultOrder::of_value(u64::from_le_bytes(order.octets())), Some(order));
            assert_eq!(check_order(&order.octets()), Ok(()));
        }
        let good = FaultOrder {
            kind: None,
            lasts_100ms: 0,
        }
        .octets();
        for at in 3..8 {
            let mut other = good;
            other[at] ^= 1;
            assert_eq!(check_order(&other), Err(AbortCode::VALUE_RANGE), "octet {at}");
        }
        assert_eq!(check_order(&good[..4]), Err(AbortCode::VALUE_RANGE));
        assert_eq!(
            check_order(&[8, 0, 0, b'i', b'S', b'I', b'M', 1]),
            Err(AbortCode::VALUE_RANGE)
        );
        assert_eq!(FaultOrder::of_value(0), None);
    }
}
