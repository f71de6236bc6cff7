//! The probe's pin.
//!
//! In:  `motion.probe-input`. Out: whether the probe is in contact, and has come into contact in this cycle. RT but [`Probe::new`].

use config::Config;
use hal_pins::{Hal, HalError, Input};

/// The probe of a machine.
pub struct Probe {
    input: Input<bool>,
    /// In the last cycle, and in this one.
    in_contact: [bool; 2],
    /// It stops the hand as it comes into contact.
    stops_jog: bool,
}

impl Probe {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config) -> Result<Probe, HalError> {
        Ok(Probe {
            input: hal.input("motion.probe-input", false)?,
            in_contact: [false; 2],
            stops_jog: config.probe_stops_jog,
        })
    }

    /// Once in every cycle.
    pub fn look(&mut self) {
        let [_, before] = self.in_contact;
        self.in_contact = [before, self.input.get()];
    }

    /// Whether it is in contact.
    pub fn is_in_contact(&self) -> bool {
        self.in_contact[1]
    }

    /// Whether a jog is to stop: out of a contact that was there before, the hand leads.
    pub fn stops_jog(&self) -> bool {
        self.stops_jog && self.in_contact == [false, true]
    }
}
