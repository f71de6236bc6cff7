//! What takes a drive from state to state: the controlword, faults, the safety circuit, the end of the connection.
//!
//! In:  the controlword and the option codes (605A to 605E, 6007). Out: the state, and what the motor does on the way.

use super::homing::Sensors;
use super::{Activity, Device, ERROR_COMMUNICATION, ERROR_PARAMETER, ERROR_STO, HomingIndication};
use crate::profile::{State, mode};
use obd::Dictionary;

impl Device {
    /// Safe torque off: whatever the drive is doing, its torque is gone.
    pub(super) fn watch_safety_circuit<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
    ) {
        let is_on = match self.power.state() {
            State::ReadyToSwitchOn | State::SwitchedOn | State::OperationEnabled | State::QuickStopActive => true,
            State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::FaultReactionActive | State::Fault => false,
        };
        if !self.injected.sto_open {
            return;
        }
        if self.injected.sto_faults && !matches!(self.activity, Activity::Off) {
            self.raise_fault(ERROR_STO);
        }
        self.activity = Activity::Off;
        if is_on && !self.injected.sto_faults {
            self.power.start_transition(10, State::SwitchOnDisabled);
            self.entered(objects, sensors);
        }
    }

    /// 6007: what a drive does that is no longer led. Only a drive that moves can need it.
    pub(super) fn watch_connection<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        connected: bool,
    ) {
        let lost = self.connected && !connected;
        self.connected = connected;
        if !lost || self.power.state() != State::OperationEnabled {
            return;
        }
        match objects.get(self.keys.abort_connection) {
            1 => self.raise_fault(ERROR_COMMUNICATION),
            2 => self.begin_transition(objects, sensors, 9, State::SwitchOnDisabled),
            3 => self.begin_transition(objects, sensors, 11, State::QuickStopActive),
            _ => {}
        }
    }

    pub(super) fn react_to_fault<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
    ) {
        let at_fault = matches!(self.power.state(), State::FaultReactionActive | State::Fault);
        if self.error_code != 0 && !at_fault {
            self.power.start_transition(13, State::FaultReactionActive);
            self.entered(objects, sensors);
        }
    }

    pub(super) fn apply_controlword<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        word: u16,
    ) {
        let Some((number, to)) = self.power.requested_transition(word) else {
            return;
        };
        if self.injected.refused & (1 << number) != 0 {
            return;
        }
        match number {
            // A stop that is under way goes on to its end; only taking the voltage away is quicker.
            5 | 8 | 11 if matches!(self.activity, Activity::Stop { .. }) => {}
            // Only 605A = 5 to 8 stays in QUICK STOP ACTIVE and lets the controller go on from there.
            16 if objects.get(self.keys.quick_stop_option) < 5 || self.quirks.stays_in_quick_stop => {}
            2 if self.injected.sto_open => {}
            15 if self.injected.cause_stays || self.injected.sto_open => {}
            15 => {
                self.error_code = 0;
                self.begin_transition(objects, sensors, number, to);
            }
            _ => self.begin_transition(objects, sensors, number, to),
        }
    }

    /// Starts a transition, with the stop that its option code asks for in front of it.
    fn begin_transition<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        sensors: &Sensors,
        number: u8,
        to: State,
    ) {
        let ramp = match number {
            5 => objects.get(self.keys.disable_option) == 1,
            8 => objects.get(self.keys.shutdown_option) == 1,
            _ => false,
        };
        if ramp {
            let deceleration = self.speed_of(objects, self.keys.deceleration);
            self.activity = Activity::Stop {
                deceleration,
                number,
                to,
            };
            return;
        }
        // Whoever makes its own way needs no time between set-points.
        let own_way = matches!(
            self.mode,
            mode::PROFILE_POSITION | mode::VELOCITY | mode::PROFILE_VELOCITY | mode::PROFILE_TORQUE
        );
        if number == 4 && !(self.factors.are_good && (own_way || self.interpolation_time_fits(objects))) {
            self.raise_fault(ERROR_PARAMETER);
            return;
        }
        self.power.start_transition(number, to);
        self.entered(objects, sensors);
    }

    /// 60C2 must be the bus cycle: digits · 10^power seconds.
    fn interpolation_time_fits<const E: usize, const B: usize>(&self, objects: &Dictionary<E, B>) -> bool {
        let power = objects.get(self.keys.interpolation_power);
        let Some(scale) = u32::try_from(i32::from(power) + 9)
            .ok()
            .and_then(|power| 10u64.checked_pow(power))
        else {
            return false;
        };
        u64::from(objects.get(self.keys.interpolation_digits)).checked_mul(scale) == Some(u64::from(self.period_ns))
    }

    /// Sets the motor's activity for a state that has just been entered; harmless if it has not changed.
    pub(super) fn entered<const E: usize, const B: usize>(&mut self, objects: &Dictionary<E, B>, sensors: &Sensors) {
        let keys = self.keys;
        let ramp = self.speed_of(objects, keys.deceleration);
        let quick = self.speed_of(objects, keys.quick_deceleration);
        let powered = !matches!(self.activity, Activity::Off);
        self.activity = match self.power.state() {
            State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::ReadyToSwitchOn | State::SwitchedOn => {
                Activity::Off
            }
            State::OperationEnabled => match self.activity {
                Activity::Off => {
                    self.generator.track(sensors.position);
                    self.homing = HomingIndication::Idle;
                    self.begin_mode();
                    Activity::Mode
                }
                Activity::Mode | Activity::Hold { .. } => Activity::Mode,
                Activity::Stop { .. } => self.activity,
            },
            State::QuickStopActive => {
                let (number, to) = (12, State::SwitchOnDisabled);
                match objects.get(keys.quick_stop_option) {
                    _ if self.quirks.stays_in_quick_stop => Activity::Hold { deceleration: quick },
                    0 => Activity::Stop {
                        deceleration: f64::INFINITY,
                        number,
                        to,
                    },
                    1 => Activity::Stop {
                        deceleration: ramp,
                        number,
                        to,
                    },
                    5 => Activity::Hold { deceleration: ramp },
                    6 => Activity::Hold { deceleration: quick },
                    _ => Activity::Stop {
                        deceleration: quick,
                        number,
                        to,
                    },
                }
            }
            State::FaultReactionActive => {
                let (number, to) = (14, State::Fault);
                match objects.get(keys.fault_option) {
                    _ if !powered => Activity::Off,
                    0 => Activity::Off,
                    1 => Activity::Stop {
                        deceleration: ramp,
                        number,
                        to,
                    },
                    _ => Activity::Stop {
                        deceleration: quick,
                        number,
                        to,
                    },
                }
            }
            State::Fault => Activity::Off,
        };
    }
}
