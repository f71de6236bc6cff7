//! The control's pins: what other components and other processes see of it, and what they may tell it.
//!
//! In:  the machine file. Out: the parts of the control that have pins, each with its own, linked by the nets.
//!
//! Names are LinuxCNC's where LinuxCNC has one. All of this runs at start-up.

use super::components::count_pins;
use super::estop_chain::EstopChain;
use super::feed_pins::FeedPins;
use super::io_channels::{self, IoPins};
use super::io_pins::{InputPins, OutputPins};
use super::loop_pins::LoopPins;
use super::machine_pins::{AxisPins, JointPins, MachinePins, StatePins};
use super::nodes::{DrivePins, Nodes};
use super::override_pins::OverridePins;
use super::plc::Plc;
use super::probe::Probe;
use super::spindle::Spindles;
use super::step_pins::StepPins;
use super::steps::StepDrives;
use super::timing_pins::TimingPins;
use super::tool_changer::{ToolChanger, ToolInSpindle};
use super::{external, logic};
use crate::desk::{Button, DeskPins};
use crate::jog_pins::JogPins;
use bus::plan::NodePlan;
use config::{self, Config, ConfigErrors, Net};
use hal_pins::{CAPACITY_MAX, Hal, HalError};

/// Pins of the control that there is room for, beside those that the machine file asks for.
const CAPACITY: usize = 2048;

/// Pins and nets that there is to be room for.
pub fn capacity(config: &Config) -> usize {
    let declared =
        count_pins(config) + logic::count_pins(config) + external::count_pins(config) + io_channels::count_pins(config);
    (CAPACITY + declared + config.nets.len()).min(CAPACITY_MAX)
}

/// Parts of the control that have pins, as they are made: each owns its pins.
pub struct Pins {
    pub machine: MachinePins,
    pub nodes: Nodes,
    pub estop: EstopChain,
    pub feed: FeedPins,
    pub probe: Probe,
    pub desk: DeskPins,
    pub jog: JogPins,
    pub spindles: Spindles,
    pub plc: Plc,
    pub program_inputs: InputPins,
    pub program_outputs: OutputPins,
    pub changer: ToolChanger,
}

/// What an input of the control is while nothing is wired to it that should be: a switch that is touched, mains that have failed.
/// `None` for the emergency stop chain, which is kept open, and for inputs that stop nothing.
fn stopped_value(pin: &str) -> Option<bool> {
    let is_limit = pin.starts_with("joint.") && (pin.ends_with(".neg-lim-sw-in") || pin.ends_with(".pos-lim-sw-in"));
    let is_home = pin.starts_with("joint.") && pin.ends_with(".home-sw-in");
    match pin {
        "motion.probe-input" | "motion.feed-hold" => Some(true),
        "iocontrol.0.mains-ok" => Some(false),
        _ => (is_limit || is_home).then_some(true),
    }
}

/// Whether a machine must not move while nothing is wired to an input of the control.
pub fn must_be_wired(pin: &str) -> bool {
    pin == "iocontrol.0.emc-enable-in" || stopped_value(pin).is_some()
}

/// Gives the targets of a net without a source the values which stop. True where the chain has to be kept open instead: it hangs on
/// the net, or what hangs on it is not known, as behind a component.
fn stop_unwired(hal: &Hal, net: &Net) -> Result<bool, HalError> {
    let mut keeps_open = false;
    for target in &net.targets {
        match stopped_value(target) {
            Some(value) => hal.set(target, value)?,
            None => {
                hal.check_reader(&net.name, target)?;
                keeps_open = true;
            }
        }
    }
    Ok(keeps_open)
}

/// Why the pins of a machine cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PinsError {
    /// The shared memory, or a pin of our own.
    #[error(transparent)]
    Hal(#[from] HalError),
    /// Nets and components of the machine file, at their places there.
    #[error("{0}")]
    Nets(ConfigErrors),
}

impl Pins {
    /// Makes all pins, in an order that `isocnc hal show` shows, and links them as the machine file says.
    ///
    /// # Errors
    /// Shared memory too small; every net that names a pin that does not exist or is driven twice.
    pub fn new(hal: &mut Hal, config: &Config, plans: &[NodePlan], steps: &StepDrives) -> Result<Pins, PinsError> {
        let joints = (0..config.joints.len()).map(|joint| JointPins::new(hal, joint));
        let joints = joints.collect::<Result<_, _>>()?;
        let axes = AxisPins::new(hal, config)?;
        let drives = DrivePins::new(hal, config, plans)?;
        let loops = LoopPins::of_machine(hal, config)?;
        let nodes = Nodes::new(config, drives, IoPins::new(hal, config, plans)?);
        let steps = StepPins::new(hal, config, steps)?;
        let state = StatePins::new(hal)?;
        let (hold, adaptive) = (
            hal.input("motion.feed-hold", false)?,
            hal.input("motion.adaptive-feed", 1.0)?,
        );
        let probe = Probe::new(hal, config)?;
        let feed = FeedPins {
            hold,
            adaptive,
            overrides: OverridePins::new(hal)?,
        };
        let program_buttons = [
            Button::new(hal, "halui.program.resume")?,
            Button::new(hal, "halui.program.stop")?,
        ];
        let mains_ok = hal.input("iocontrol.0.mains-ok", true)?;
        let desk = DeskPins::new(hal, config, program_buttons)?;
        let in_spindle = ToolInSpindle::new(hal)?;
        let mut pins = Pins {
            nodes,
            feed,
            probe,
            desk,
            jog: JogPins::new(hal, config)?,
            estop: EstopChain::new(hal, config)?,
            spindles: Spindles::new(hal, config, plans)?,
            plc: Plc::new(hal, config)?,
            program_inputs: InputPins::new(hal, config)?,
            program_outputs: OutputPins::new(hal, config)?,
            changer: ToolChanger::new(hal, config, in_spindle)?,
            machine: MachinePins {
                memory: hal.memory(),
                joints,
                axes,
                loops,
                steps,
                state,
                mains_ok,
                timing: TimingPins::new(hal)?,
            },
        };
        pins.link(hal, config)?;
        pins.plc.logic.bind(hal, config).map_err(PinsError::Nets)?;
        Ok(pins)
    }

    fn link(&mut self, hal: &mut Hal, config: &Config) -> Result<(), PinsError> {
        let mut refused = Vec::new();
        for (number, net) in config.nets.iter().enumerate() {
            let linked = match net.is_unwired() {
                true => stop_unwired(hal, net).map(|keeps_open| {
                    if keeps_open {
                        self.estop.hold_open();
                    }
                }),
                false => hal.link(&net.name, &net.source, &net.targets),
            };
            if let Err(error) = linked {
                refused.push((number, error));
            }
        }
        match refused.is_empty() {
            true => Ok(()),
            false => Err(PinsError::Nets(config::net_errors(config, &refused))),
        }
    }
}
