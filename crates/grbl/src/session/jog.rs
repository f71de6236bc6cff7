//! `$J=`: moves by hand, on top of what is still to go.
//!
//! In:  jogs of the sender, statuses of the control.
//! Out: orders with the distance that is left within the travel; where the last one leads.

use super::{Order, Session};
use crate::block::{JogBlock, jog};
use crate::number::ErrorNumber;
use crate::octets::Input;
use crate::status::{Activity, Status};

/// Jogs ahead of where the machine stands can be told only so well, mm.
const TRAVEL_TOLERANCE_MM: f64 = 1e-6;
/// So many statuses in a row without motion end a jog: more than it takes one to begin.
pub(super) const JOG_RESTS: u8 = 5;

/// The jogs under way.
#[derive(Debug, Default)]
pub(super) struct Jog {
    /// Where they lead, machine coordinates, mm.
    pub(super) to: Option<[f64; 3]>,
    /// A status may still be older than the last jog: so many of them.
    unseen: u8,
    /// Statuses in a row in which a jog rests: the control takes one for over only when nobody keeps it any more.
    rests: u8,
}

impl Jog {
    fn begun(to: [f64; 3]) -> Jog {
        Jog {
            to: Some(to),
            // One may be under way, and the cycle has to take the order.
            unseen: 3,
            rests: 0,
        }
    }

    /// A status has come.
    pub(super) fn see(&mut self, status: &Status) {
        let is_jogging = status.activity == Activity::Jogging;
        self.unseen = match is_jogging {
            true => 0,
            false => self.unseen.saturating_sub(1),
        };
        self.rests = match is_jogging && status.feed_mm_min == 0.0 {
            true => self.rests.saturating_add(1),
            false => 0,
        };
        if !is_jogging && self.unseen == 0 || self.rests >= JOG_RESTS {
            self.to = None;
        }
    }
}

impl Session {
    pub(super) fn cancel_jog(&mut self) {
        if self.is_jogging() {
            self.give(Order::StopJog);
            self.waiting_inputs
                .retain(|input| !matches!(input, Input::Line(line) if line.starts_with("$J=")));
        }
    }

    pub(super) fn jog(&mut self, line: &str) {
        let is_free = !self.is_under_way && matches!(self.status.activity, Activity::Idle | Activity::Jogging);
        if !is_free || self.is_check {
            return self.say(ErrorNumber::NotIdle);
        }
        if self.is_locked() {
            return self.say(ErrorNumber::Locked);
        }
        let asked = match jog(line, &self.modes) {
            Ok(asked) => asked,
            Err(error) => return self.say(error),
        };
        let from = self.jog.to.unwrap_or(self.status.position_mm);
        let to = self.jog_end(&asked, from);
        let is_inside = (0..3).all(|axis| match (asked.axes[axis], self.machine.axes[axis]) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(_), Some(limits)) => {
                let [low, high] = limits.travel_mm;
                (low - TRAVEL_TOLERANCE_MM..=high + TRAVEL_TOLERANCE_MM).contains(&to[axis])
            }
        });
        if !is_inside {
            return self.say(ErrorNumber::Travel);
        }
        let distance_mm = [0, 1, 2].map(|axis| to[axis] - from[axis]);
        let length_mm = distance_mm.iter().map(|part| part * part).sum::<f64>().sqrt();
        if length_mm == 0.0 {
            return self.say("ok");
        }
        let velocity_mm_s = distance_mm.map(|part| part / length_mm * asked.feed_mm_min / 60.0);
        self.jog = Jog::begun(to);
        self.modes.forget_place();
        self.give(Order::Jog {
            distance_mm,
            velocity_mm_s,
        });
        self.say("ok");
    }

    fn jog_end(&self, asked: &JogBlock, from: [f64; 3]) -> [f64; 3] {
        let mut to = from;
        for (axis, to) in to.iter_mut().enumerate() {
            let Some(value) = asked.axes[axis] else { continue };
            *to = match (asked.relative, asked.of_machine) {
                (true, _) => *to + value,
                (false, true) => value,
                (false, false) => value + self.status.work_offset_mm[axis],
            };
        }
        to
    }
}
