//! Touch probes of the drive (60B8 to 60BD): the position is latched at the very increment at which an input changes.
//!
//! In:  60B8, the edges of the two probe inputs and of the zero mark. Out: 60B9 and the latched positions.
//!
//! Each probe has eight bits of 60B8: 0 on, 1 continuous (else the first edge only), 2 the zero mark in place of the input, 4
//! rising edges, 5 falling ones; and three of 60B9: 0 on, 1 and 2 a rising, a falling edge is stored.

use super::homing::{Sensors, Switch};
use super::{Device, objects::Keys};
use obd::{Dictionary, Key};

const ON: u16 = 1 << 0;
const CONTINUOUS: u16 = 1 << 1;
const ZERO_MARK: u16 = 1 << 2;
/// Rising, falling.
const EDGES: [u16; 2] = [1 << 4, 1 << 5];
/// As [`EDGES`], in 60B9.
const STORED: [u16; 2] = [1 << 1, 1 << 2];

/// Objects of the latched positions of a probe: rising, falling.
fn latches(keys: &Keys, probe: usize) -> [Key<i32>; 2] {
    match probe {
        0 => [keys.probe_1_rising, keys.probe_1_falling],
        _ => [keys.probe_2_rising, keys.probe_2_falling],
    }
}

impl Device {
    /// One period of both probes.
    pub(super) fn watch_probes<const E: usize, const B: usize>(
        &mut self,
        objects: &mut Dictionary<E, B>,
        sensors: &Sensors,
    ) {
        let function = objects.get(self.keys.probe_function);
        let (factors, offset) = (self.factors, self.offset);
        let mut status = 0;
        for probe in 0..2 {
            let function = function >> (8 * probe);
            let stored = &mut self.probes_stored[probe];
            if function & ON == 0 {
                *stored = 0;
                continue;
            }
            let input = match function & ZERO_MARK {
                0 => sensors.probes[probe],
                // A mark is passed: it rises where it is.
                _ => Switch {
                    active: true,
                    edge: sensors.index,
                },
            };
            let edge = if input.active { 0 } else { 1 };
            let wanted = function & EDGES[edge] != 0 && (function & CONTINUOUS != 0 || *stored & STORED[edge] == 0);
            if let Some(at) = input.edge.filter(|_| wanted) {
                *stored |= STORED[edge];
                // The network's positions are the low 32 bits.
                objects.set(latches(&self.keys, probe)[edge], (factors.units(at) + offset) as i32);
            }
            status |= (ON | *stored) << (8 * probe);
        }
        objects.set(self.keys.probe_status, status);
    }
}
