//! Sensors of the simulated machine: what closes where the loads are.
//!
//! In:  positions of the loads. Out: inputs of I/O nodes.

use crate::config::{Config, SimProbe};
use motion::kinematics::{Kinematics, ToolFrame};

/// First input that something can be wired to: bit 0 of 6000h/2.
const WIRED: u8 = 8;

/// All sensors of a machine.
#[derive(Debug)]
pub(super) struct Sensors {
    kinematics: Kinematics,
    probe: SimProbe,
}

impl Sensors {
    /// `None`: the machine has none.
    pub(super) fn new(config: &Config) -> Option<Sensors> {
        Some(Sensors {
            kinematics: config.kinematics(),
            probe: config.sim.probe.clone()?,
        })
    }

    /// Tells every sensor to `tell`: index of its node, bit of 6000h/2, whether it is closed.
    ///
    /// RT: no allocation, no locks.
    pub(super) fn look(&self, loads_mm: &[f64], tell: &mut dyn FnMut(usize, u8, bool)) {
        // Where no tip can be, none touches anything.
        let tip = self.kinematics.forward(&ToolFrame::OFF, loads_mm);
        let closed = tip.is_some_and(|tip| {
            self.probe.surfaces.iter().any(|surface| {
                let at_mm = tip[surface.axis];
                if surface.above {
                    at_mm >= surface.at_mm
                } else {
                    at_mm <= surface.at_mm
                }
            })
        });
        tell(self.probe.node, self.probe.input - WIRED, closed);
    }
}
