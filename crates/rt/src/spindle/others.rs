//! All spindles of a machine: the first one, and those next to it, of which components or their drives follow the pins.
//!
//! In:  M3, M4 and M5 of a spindle. Out: pins; whether it has its speed.
//!
//! RT: nothing allocates but [`Spindles::new`].

use super::{Spindle, TurnPins};
use bus::plan::NodePlan;
use config::Config;
use hal_pins::{Hal, HalError, Input};
use machine::faults::SpeedNotReached;

/// The spindles of a machine.
pub struct Spindles {
    /// The one that axes move in step with.
    pub first: Spindle,
    others: Vec<OtherSpindle>,
}

impl Spindles {
    /// Those of the machine file.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config, plans: &[NodePlan]) -> Result<Spindles, HalError> {
        Ok(Spindles {
            first: Spindle::new(hal, config, plans)?,
            others: (1..config.spindle.count)
                .map(|number| OtherSpindle::new(hal, config, number))
                .collect::<Result<_, _>>()?,
        })
    }

    /// Turns one next to the first, counter-clockwise below 0 1/min; `None`: it is to stand. RT.
    pub fn turn(&mut self, spindle: u8, rpm: Option<f64>) {
        if let Some(other) = self.other(spindle) {
            other.turn(rpm);
        }
    }

    /// Whether one next to the first has its speed, if that is to be waited for. RT.
    pub fn is_at_speed(&mut self, spindle: u8) -> bool {
        self.other(spindle).is_none_or(OtherSpindle::is_at_speed)
    }

    /// One whose speed has been waited for too long. RT.
    pub fn late(&self) -> Option<SpeedNotReached> {
        let others = || self.others.iter().find_map(OtherSpindle::late);
        self.first.late().or_else(others)
    }

    /// All of them are to stand. RT.
    pub fn stop(&mut self) {
        self.first.stop();
        for other in &mut self.others {
            other.turn(None);
        }
    }

    fn other(&mut self, spindle: u8) -> Option<&mut OtherSpindle> {
        self.others.get_mut(usize::from(spindle).checked_sub(1)?)
    }
}

/// A spindle beside the first: its pins. Components or its drive follow them.
struct OtherSpindle {
    number: u8,
    pins: TurnPins,
    at_speed: Input<bool>,
    waits: bool,
    rpm_max: f64,
    cycle_s: f64,
    timeout_s: f64,
    waited_s: f64,
}

impl OtherSpindle {
    /// The spindle of a number, 1 or more.
    fn new(hal: &mut Hal, config: &Config, number: u8) -> Result<OtherSpindle, HalError> {
        let spindle = &config.spindle;
        Ok(OtherSpindle {
            number,
            pins: TurnPins::new(hal, number)?,
            at_speed: hal.input(&format!("spindle.{number}.at-speed"), true)?,
            waits: spindle.wait_for_speed,
            rpm_max: spindle.rpm_max,
            cycle_s: f64::from(config.cycle_us) * 1e-6,
            timeout_s: spindle.speed_timeout_s,
            waited_s: 0.0,
        })
    }

    /// Its speed, below 0 counter-clockwise; `None`: it is to stand. RT.
    fn turn(&mut self, rpm: Option<f64>) {
        let speed = rpm.unwrap_or(0.0).clamp(-self.rpm_max, self.rpm_max);
        self.pins.show(rpm.map(f64::is_sign_positive), speed);
        self.waited_s = 0.0;
    }

    /// Whether it has the speed that it is told, if that is to be waited for. RT.
    fn is_at_speed(&mut self) -> bool {
        let at_speed = !self.waits || !self.pins.is_on() || self.at_speed.get();
        self.waited_s = if at_speed { 0.0 } else { self.waited_s + self.cycle_s };
        at_speed
    }

    /// Whether its speed has been waited for too long. RT.
    fn late(&self) -> Option<SpeedNotReached> {
        (self.waited_s > self.timeout_s).then(|| SpeedNotReached {
            spindle: self.number,
            wanted_rpm: self.pins.rpm(),
            measured_rpm: None,
        })
    }
}
