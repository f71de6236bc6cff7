//! Octets that act at once, whatever lines wait: status, hold, door, resume, reset, overrides, coolant.

use super::{Lock, Order, Session};
use crate::block::block;
use crate::modes::Modes;
use crate::number::AlarmNumber;
use crate::octets::Input;
use crate::status::{Activity, Overrides};

impl Session {
    pub(super) fn real_time(&mut self, command: &Input) {
        let Overrides { feed, spindle, .. } = self.status.overrides;
        match command {
            Input::Status => {
                // One that asks faster than it is answered gets as many answers as it can be told.
                if self.asked.len() < 8 {
                    let number = self.give(Order::Status);
                    self.asked.push_back((number, true));
                }
            }
            Input::Hold => self.hold(false),
            Input::Door => self.hold(true),
            Input::Resume => {
                // The last status may be older than a hold.
                if self.hold.is_on || matches!(self.status.activity, Activity::Held | Activity::Running) {
                    self.give(Order::Resume);
                }
                self.hold.end();
            }
            Input::Reset => self.reset(),
            Input::CancelJog => self.cancel_jog(),
            Input::Feed(by) => {
                let percent = overridden(feed, *by, self.machine.feed_percent);
                self.status.overrides.feed = percent;
                self.give(Order::Feed(percent));
            }
            Input::Rapid(percent) => {
                self.give(Order::Rapid(u16::from(*percent)));
            }
            Input::Spindle(by) => {
                let percent = overridden(spindle, *by, self.machine.spindle_percent);
                self.status.overrides.spindle = percent;
                self.give(Order::Spindle(percent));
            }
            Input::StopSpindle => self.message("the spindle cannot be stopped in a hold from here"),
            Input::Flood => self.coolant("M8", self.status.flood),
            Input::Mist => self.coolant("M7", self.status.mist),
            Input::Line(_) | Input::LongLine => {}
        }
    }

    fn hold(&mut self, by_door: bool) {
        if self.is_jogging() {
            self.cancel_jog();
        }
        if self.is_under_way || matches!(self.status.activity, Activity::Running) {
            self.hold.order = Some(self.give(Order::Hold));
            self.hold.is_on = true;
        }
        self.hold.is_door |= by_door;
    }

    pub(super) fn reset(&mut self) {
        let moves = self.is_under_way || self.status.activity != Activity::Idle || self.is_jogging();
        let homes = self.homing || self.status.activity == Activity::Homing;
        self.inputs.clear();
        self.waiting_inputs.clear();
        // Nobody waits for these answers any more.
        (self.busy, self.sent, self.settling) = (None, None, None);
        self.text.clear();
        (self.is_under_way, self.is_check, self.homing) = (false, false, false);
        self.hold.end();
        self.jog.to = None;
        self.modes = Modes::default();
        self.modes_unknown = true;
        if self.lock == Some(Lock::Sleep) {
            self.lock = None;
        }
        if moves {
            self.give(Order::Stop);
            self.lock = Some(Lock::Reset);
            self.say(if homes {
                AlarmNumber::HomingReset
            } else {
                AlarmNumber::Stopped
            });
        }
        self.greet();
        if self.is_locked() {
            self.say("[MSG:'$H'|'$X' to unlock]");
        }
    }

    /// Coolant goes on and off by lines; while lines run, nothing gets between them.
    fn coolant(&mut self, on: &str, is_on: bool) {
        if self.is_under_way || self.is_locked() || self.status.activity != Activity::Idle {
            return self.message("coolant can be switched from here only while the machine is idle");
        }
        // The other kind stays.
        let other = match on {
            "M8" if self.status.mist => "M7",
            "M7" if self.status.flood => "M8",
            _ => "",
        };
        let line = match is_on {
            false => on.to_owned(),
            true => format!("M9{other}"),
        };
        if let Ok(block) = block(&line, &self.modes) {
            self.accept(block);
        }
    }
}

/// An override that goes on by so many percent.
fn overridden(now: u16, by: Option<i8>, [low, high]: [u16; 2]) -> u16 {
    match by {
        None => 100,
        Some(by) => now.saturating_add_signed(i16::from(by)).clamp(low, high),
    }
}
