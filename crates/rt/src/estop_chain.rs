//! The emergency stop chain: whether it is open, and what may close it again.
//!
//! In:  pins; the state of the machine.
//! Out: pins, among them those for a latch; whether the chain is open; edges that order an emergency stop, or reset it.
//!
//! RT: nothing allocates but [`EstopChain::new`].

use crate::desk::Button;
use cia402::axis::Request;
use config::{Config, StopCategory};
use hal_pins::{Hal, HalError, Input, Output};
use machine::state::State;

/// How long a reset asks the latch of the chain to close, cycles.
const RESET_PULSE: u32 = 100;

/// The chain of a machine.
pub struct EstopChain {
    /// True: the chain is closed.
    enable_in: Input<bool>,
    /// False: software wants the chain open.
    user_enable_out: Output<bool>,
    /// A pulse at a reset, for a latch.
    user_request_enable: Output<bool>,
    activate: Button,
    reset: Button,
    is_activated: Output<bool>,
    machine_is_on: Output<bool>,
    /// Cycles that the pulse still lasts.
    pulse: u32,
    /// An unwired net keeps it open, whatever its pin says.
    held_open: bool,
    /// What an emergency stop asks of drives.
    request: Request,
}

impl EstopChain {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config) -> Result<EstopChain, HalError> {
        Ok(EstopChain {
            enable_in: hal.input("iocontrol.0.emc-enable-in", true)?,
            user_enable_out: hal.output("iocontrol.0.user-enable-out")?,
            user_request_enable: hal.output("iocontrol.0.user-request-enable")?,
            activate: Button::new(hal, "halui.estop.activate")?,
            reset: Button::new(hal, "halui.estop.reset")?,
            is_activated: hal.output("halui.estop.is-activated")?,
            machine_is_on: hal.output("halui.machine.is-on")?,
            pulse: 0,
            held_open: false,
            request: match config.stops.emergency {
                StopCategory::Zero => Request::CutPower,
                StopCategory::One => Request::QuickStop,
            },
        })
    }

    /// From now on it is open: a net that hangs on it has no source.
    pub(super) fn hold_open(&mut self) {
        self.held_open = true;
    }

    /// Whether such a net keeps it open.
    pub fn is_held_open(&self) -> bool {
        self.held_open
    }

    /// Whether its pin says that it is open.
    pub fn is_open(&self) -> bool {
        !self.enable_in.get()
    }

    /// What an emergency stop asks of drives.
    pub fn request(&self) -> Request {
        self.request
    }

    /// Whether the pin that orders an emergency stop has risen since the last call, and the one that resets it.
    pub fn take(&mut self) -> [bool; 2] {
        [self.activate.take(), self.reset.take()]
    }

    /// Asks the latch to close.
    pub fn request_enable(&mut self) {
        self.pulse = RESET_PULSE;
    }

    /// Asks no longer.
    pub fn forget_enable(&mut self) {
        self.pulse = 0;
    }

    /// Whether the latch is still being asked.
    pub fn is_enable_requested(&self) -> bool {
        self.pulse > 0
    }

    /// Once in every cycle.
    pub fn show(&mut self, state: State) {
        let is_estop = state == State::Estop;
        self.is_activated.set(is_estop);
        self.user_enable_out.set(!is_estop || self.pulse > 0);
        self.user_request_enable.set(self.pulse > 0);
        self.pulse = self.pulse.saturating_sub(1);
        self.machine_is_on
            .set(state.is_under_command() && state != State::Enabling);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hal_pins::AnyValue;
    use std::path::Path;

    #[test]
    fn every_press_orders_an_emergency_stop_and_every_reset_ends_one() {
        let folder = tempfile::tempdir().unwrap();
        let mut hal = Hal::create_in(&[folder.path().to_owned()], "estop", 64).unwrap();
        let text = include_str!("../../../configs/mill3-demo.toml");
        let config = config::parse(text, Path::new("m.toml")).unwrap();
        let mut chain = EstopChain::new(&mut hal, &config).unwrap();
        for (pin, taken) in [
            ("halui.estop.activate", [true, false]),
            ("halui.estop.reset", [false, true]),
        ] {
            for press in 0..3 {
                hal.set(pin, true).unwrap();
                assert_eq!(chain.take(), taken, "{pin}, press {press}");
                assert_eq!(chain.take(), [false; 2], "{pin} acts once");
                hal.set(pin, false).unwrap();
                assert_eq!(chain.take(), [false; 2]);
            }
        }
        chain.show(State::Estop);
        assert_eq!(hal.view().value("halui.estop.is-activated"), Some(AnyValue::Bit(true)));
    }
}
