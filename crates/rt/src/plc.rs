//! The PLC: what the builder of a machine adds to the control, in every cycle before motion and after it.
//!
//! In:  pins. Out: pins; what the operator is to hear of it.
//!
//! Components run in the cycle, programs in Structured Text next to it, external components in other processes.
//!
//! RT: nothing allocates but [`Plc::new`].

use super::components::Lists;
use super::external::ExternalPins;
use super::logic::Ports;
use super::pins::PinsError;
use config::Config;
use hal_pins::{Hal, HalError};

/// That of a machine.
pub struct Plc {
    components: Lists,
    /// Programs in Structured Text.
    pub logic: Ports,
    /// Components of other processes.
    pub external: ExternalPins,
}

impl Plc {
    /// Claims the pins of all of it.
    ///
    /// # Errors
    /// Pins that cannot be had, at their places in the machine file.
    pub fn new(hal: &mut Hal, config: &Config) -> Result<Plc, PinsError> {
        let refused = |kind: &'static str| {
            move |(number, error): (usize, HalError)| {
                PinsError::Nets(config::component_error(config, kind, number, &error))
            }
        };
        Ok(Plc {
            components: Lists::new(hal, config).map_err(refused("component"))?,
            logic: Ports::claim(hal, config)
                .map_err(|(number, error)| PinsError::Nets(config::logic_error(config, number, &error.to_string())))?,
            external: ExternalPins::new(hal, config).map_err(refused("external"))?,
        })
    }

    /// Before motion, with the inputs of the nodes; `skipped`: cycles that were left out since the last one. RT.
    pub fn run_before_motion(&mut self, skipped: u64) {
        self.logic.publish();
        self.external.take(skipped);
        self.components.run_before_motion(skipped);
    }

    /// After motion, for the outputs of the nodes; `may_replace`: programs in Structured Text may be replaced. RT.
    pub fn run_after_motion(&mut self, skipped: u64, may_replace: bool) {
        self.components.run_after_motion(skipped);
        self.logic.sample(skipped, may_replace);
        self.external.give();
    }
}
