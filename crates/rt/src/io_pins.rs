//! Inputs and outputs that programs read and set: M62 to M68 by number, coolant by M7 to M9.
//!
//! In:  pins that others drive, once a cycle; what the program sets or waits for.
//! Out: pins that others read; what an input was found to be.
//!
//! Made at start-up; the rest is RT.

use config::Config;
use hal_pins::{Hal, HalError, Input, Output};
use motion::canon::{self, WaitMode};
use motion::element::Outputs;

/// `motion.digital-out-NN`, `motion.analog-out-NN` and coolant. Those with a number keep their values until a program sets them
/// otherwise: through its end, a stop, a fault, and power off of the drives.
pub struct OutputPins {
    digital: Vec<Output<bool>>,
    analog: Vec<Output<f64>>,
    /// M8 and M7, which are off behind the end of a program.
    flood: Output<bool>,
    mist: Output<bool>,
}

impl OutputPins {
    /// As many as the machine file says.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config) -> Result<OutputPins, HalError> {
        let digital = 0..config.program.digital_pins;
        let analog = 0..config.program.analog_pins;
        Ok(OutputPins {
            digital: digital
                .map(|index| hal.output(&format!("motion.digital-out-{index:02}")))
                .collect::<Result<_, _>>()?,
            analog: analog
                .map(|index| hal.output(&format!("motion.analog-out-{index:02}")))
                .collect::<Result<_, _>>()?,
            flood: hal.output("iocontrol.0.coolant-flood")?,
            mist: hal.output("iocontrol.0.coolant-mist")?,
        })
    }

    /// Sets all that the program has set so far. RT.
    pub fn set(&mut self, outputs: &Outputs) {
        for (index, pin) in self.digital.iter_mut().enumerate() {
            if let Some(on) = outputs.digital(index) {
                pin.set(on);
            }
        }
        for (index, pin) in self.analog.iter_mut().enumerate() {
            if let Some(value) = outputs.analog(index) {
                pin.set(value);
            }
        }
    }

    /// M8, M9. RT.
    pub fn set_flood(&mut self, on: bool) {
        self.flood.set(on);
    }

    /// M7, M9. RT.
    pub fn set_mist(&mut self, on: bool) {
        self.mist.set(on);
    }

    /// Whether flood is on. RT.
    pub fn has_flood(&self) -> bool {
        self.flood.get()
    }

    /// Whether mist is on. RT.
    pub fn has_mist(&self) -> bool {
        self.mist.get()
    }

    /// M64, M65. RT.
    pub fn set_digital(&mut self, index: u8, on: bool) {
        if let Some(pin) = self.digital.get_mut(usize::from(index)) {
            pin.set(on);
        }
    }

    /// M68. RT.
    pub fn set_analog(&mut self, index: u8, value: f64) {
        if let Some(pin) = self.analog.get_mut(usize::from(index)) {
            pin.set(value);
        }
    }
}

/// `motion.digital-in-NN` and `motion.analog-in-NN`.
pub struct InputPins {
    digital: Vec<Input<bool>>,
    analog: Vec<Input<f64>>,
    /// Digital inputs as they were in the cycle before, and are in this one (bit n: input n).
    before: u64,
    now: u64,
    cycle_s: f64,
    awaited: Option<Awaited>,
}

/// M66 under way.
#[derive(Clone, Copy, Debug)]
struct Awaited {
    input: canon::Input,
    mode: WaitMode,
    timeout_s: f64,
    waited_s: f64,
    read: Option<f64>,
}

impl InputPins {
    /// As many as the machine file says.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config) -> Result<InputPins, HalError> {
        let digital = 0..config.program.digital_pins;
        let analog = 0..config.program.analog_pins;
        Ok(InputPins {
            digital: digital
                .map(|index| hal.input(&format!("motion.digital-in-{index:02}"), false))
                .collect::<Result<_, _>>()?,
            analog: analog
                .map(|index| hal.input(&format!("motion.analog-in-{index:02}"), 0.0))
                .collect::<Result<_, _>>()?,
            before: 0,
            now: 0,
            cycle_s: f64::from(config.cycle_us) * 1e-6,
            awaited: None,
        })
    }

    /// Looks at the inputs; once in every cycle. RT.
    pub fn look(&mut self) {
        self.before = self.now;
        let bits = self.digital.iter().enumerate();
        self.now = bits.fold(0, |bits, (index, pin)| bits | u64::from(pin.get()) << index);
    }

    /// M66 begins. RT.
    pub fn await_input(&mut self, input: canon::Input, mode: WaitMode, timeout_s: f64) {
        self.awaited = Some(Awaited {
            input,
            mode,
            timeout_s,
            waited_s: 0.0,
            read: None,
        });
    }

    /// Whether what M66 waits for is there, or its time is over; once in every cycle, from that in which it begins. An edge is a
    /// difference between two cycles, the later of which is that one or one behind it. RT.
    pub fn is_over(&mut self) -> bool {
        let Some(awaited) = &mut self.awaited else { return true };
        let is_on = |bits: u64| match awaited.input {
            canon::Input::Digital(index) => bits.checked_shr(index.into()).unwrap_or(0) & 1 == 1,
            canon::Input::Analog(_) => false,
        };
        let (before, now) = (is_on(self.before), is_on(self.now));
        let is_there = match awaited.mode {
            WaitMode::Immediate => true,
            WaitMode::Rise => now && !before,
            WaitMode::Fall => before && !now,
            WaitMode::High => now,
            WaitMode::Low => !now,
        };
        if is_there {
            awaited.read = Some(match awaited.input {
                canon::Input::Digital(_) => f64::from(u8::from(now)),
                canon::Input::Analog(index) => self.analog.get(usize::from(index)).map_or(0.0, Input::get),
            });
            return true;
        }
        awaited.waited_s += self.cycle_s;
        // Sums of cycle times are off by their rounding.
        awaited.waited_s + 0.5 * self.cycle_s >= awaited.timeout_s
    }

    /// What the last M66 read, 1 or 0 of a digital input; `None`: its time ran out. RT.
    pub fn read(&self) -> Option<f64> {
        self.awaited?.read
    }
}
