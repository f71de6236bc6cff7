//! Lines that begin with `$`: settings, offsets, check mode, unlocking, homing, sleep.

use super::{Busy, Lock, Order, Session, Then};
use crate::number::ErrorNumber;
use crate::reports;
use crate::status::{Activity, modes_line};

impl Session {
    pub(super) fn dollar(&mut self, line: &str) {
        let is_idle = !self.is_under_way && self.status.activity == Activity::Idle;
        match line {
            "" => {
                self.say("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]");
                self.say("ok");
            }
            "$" => {
                let text = reports::settings(&self.machine);
                self.output.extend(text.into_bytes());
                self.say("ok");
            }
            "G" => {
                let text = modes_line(&self.modes);
                self.output.extend(text.into_bytes());
                self.say("ok");
            }
            "I" => {
                self.output.extend(reports::build().into_bytes());
                self.say("ok");
            }
            "N" => {
                self.say("$N0=");
                self.say("$N1=");
                self.say("ok");
            }
            "#" => {
                let number = self.give(Order::Offsets);
                self.busy = Some(Busy::On(number, Then::Offsets));
            }
            "C" if self.is_check => {
                self.say("[MSG:Disabled]");
                self.say("ok");
                self.reset();
            }
            "C" if !is_idle || self.is_locked() => self.say(ErrorNumber::NotIdle),
            "C" => {
                self.is_check = true;
                self.say("[MSG:Enabled]");
                self.say("ok");
            }
            "X" if !is_idle => self.say(ErrorNumber::NotIdle),
            // Nothing is locked.
            "X" if !self.is_locked() => self.say("ok"),
            "X" => {
                let number = self.give(Order::Unlock);
                self.busy = Some(Busy::On(number, Then::Unlocked));
            }
            "H" if !is_idle || self.is_check || self.lock == Some(Lock::Sleep) => self.say(ErrorNumber::NotIdle),
            "H" => {
                self.lock = self.lock.filter(|lock| *lock != Lock::Reset);
                self.homing = true;
                self.modes.forget_place();
                self.modes_unknown = true;
                let number = self.give(Order::Home);
                self.busy = Some(Busy::On(number, Then::Ok));
            }
            "SLP" if !is_idle => self.say(ErrorNumber::NotIdle),
            "SLP" => {
                self.lock = Some(Lock::Sleep);
                self.say("[MSG:Sleeping]");
                let number = self.give(Order::Off);
                self.busy = Some(Busy::On(number, Then::Ok));
            }
            _ => match line.strip_prefix("J=") {
                Some(rest) => self.jog(rest),
                None => self.say(ErrorNumber::BadDollar),
            },
        }
    }
}
