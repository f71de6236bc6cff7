//! Sensors of the simulated machine: what closes where the loads are.
//!
//! In:  positions of the loads. Out: inputs of I/O nodes.

use crate::config::{Config, HomingBy, SimJoint, SimProbe};
use motion::kinematics::{Kinematics, ToolFrame};

/// First input that something can be wired to: bit 0 of 6000h/2.
const WIRED: u8 = 8;

/// A home switch of a joint, closed from its place on.
#[derive(Clone, Copy, Debug)]
struct HomeSwitch {
    joint: usize,
    at_mm: f64,
    /// It is closed above its place, else below.
    above: bool,
    node: usize,
    input: u8,
}

/// All sensors of a machine.
#[derive(Debug)]
pub(super) struct Sensors {
    kinematics: Kinematics,
    probe: Option<SimProbe>,
    home_switches: Box<[HomeSwitch]>,
}

impl Sensors {
    /// `None`: the machine has none.
    pub(super) fn new(config: &Config) -> Option<Sensors> {
        let home_switch = |special: &SimJoint| {
            let (node, input) = special.input?;
            let HomingBy::Control(control) = config.joints[special.joint].homing.by else {
                return None;
            };
            Some(HomeSwitch {
                joint: special.joint,
                at_mm: special.switch_mm.unwrap_or(control.switch_mm),
                above: control.towards_positive,
                node,
                input,
            })
        };
        let sensors = Sensors {
            kinematics: config.kinematics(),
            probe: config.sim.probe.clone(),
            home_switches: config.sim.joints.iter().filter_map(home_switch).collect(),
        };
        (sensors.probe.is_some() || !sensors.home_switches.is_empty()).then_some(sensors)
    }

    /// Tells every sensor to `tell`: index of its node, bit of 6000h/2, whether it is closed.
    ///
    /// RT: no allocation, no locks.
    pub(super) fn update_switches(&self, loads_mm: &[f64], tell: &mut dyn FnMut(usize, u8, bool)) {
        // Switches on one input are wired side by side: it is closed if one of them is.
        let closed = |node: usize, input: u8| {
            let mut switches = self.home_switches.iter();
            switches.any(|switch| {
                let load_mm = loads_mm.get(switch.joint).copied().unwrap_or_default();
                (switch.node, switch.input) == (node, input) && is_beyond(load_mm, switch.at_mm, switch.above)
            })
        };
        for switch in &self.home_switches {
            tell(switch.node, switch.input - WIRED, closed(switch.node, switch.input));
        }
        let Some(probe) = &self.probe else { return };
        // Where no tip can be, none touches anything.
        let tip = self.kinematics.forward(&ToolFrame::OFF, loads_mm);
        let touches = tip.is_some_and(|tip| {
            let mut surfaces = probe.surfaces.iter();
            surfaces.any(|surface| is_beyond(tip[surface.axis], surface.at_mm, surface.above))
        });
        tell(
            probe.node,
            probe.input - WIRED,
            touches || closed(probe.node, probe.input),
        );
    }
}

fn is_beyond(position_mm: f64, at_mm: f64, above: bool) -> bool {
    if above {
        position_mm >= at_mm
    } else {
        position_mm <= at_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use std::path::Path;

    #[test]
    fn home_switches_close_where_the_loads_are_and_two_on_one_input_side_by_side() {
        let machine = include_str!("../../configs/gantry-demo.toml");
        let looked = |machine: &str, loads_mm: [f64; 4]| {
            let config = config::parse(machine, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
            let sensors = Sensors::new(&config).expect("home switches");
            let mut told = Vec::new();
            sensors.update_switches(&loads_mm, &mut |node, bit, closed| told.push((node, bit, closed)));
            told
        };
        let told = looked(machine, [9.0, -3.9, -3.3, 0.0]);
        assert_eq!(told, [(4, 1, false), (4, 2, true)], "places in the file, -4.0 and -3.2");
        let told = looked(machine, [9.0, -4.0, 0.0, 0.0]);
        assert_eq!(told, [(4, 1, true), (4, 2, false)]);
        let shared = machine.replace("input = 10\n", "input = 9\n");
        let told = looked(&shared, [9.0, -4.0, 0.0, 0.0]);
        assert_eq!(told, [(4, 1, true), (4, 1, true)]);
    }
}
