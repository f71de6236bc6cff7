//! A machine of the cell, as the supervisor has it in memory.

use super::{DOUBLED, JUST_CAME, SETTLED_S, SILENT_S};
use crate::store::Attempt;
use cell_link::message::{State, Use};
use serde_json::Value;
use std::collections::HashMap;

/// What is known of a machine while the supervisor runs.
#[derive(Default)]
pub(super) struct Machine {
    pub(super) class: String,
    pub(super) described: Value,
    pub(super) journal: u64,
    pub(super) is_alive: bool,
    pub(super) state: State,
    /// The run of its control before the one of `state`; where that speaks again, there are two of them, until then.
    pub(super) boot_before: u64,
    pub(super) doubled_until_s: f64,
    /// When the run of `state` was first heard.
    pub(super) boot_since_s: f64,
    pub(super) heard_s: f64,
    pub(super) is_asked_journal: bool,
    pub(super) is_asked_described: bool,
    pub(super) is_share_told: bool,
    pub(super) uploads: usize,
    /// Its attempt that is not over, and when it was last asked about.
    pub(super) attempt: Option<(Attempt, f64)>,
    /// Orders that it cannot carry out, and why; orders that it is left alone with until then.
    pub(super) unfit: HashMap<i64, String>,
    pub(super) rests_until_s: f64,
    pub(super) counted_until_s: f64,
    pub(super) time: HashMap<Use, f64>,
}

impl Machine {
    pub(super) fn is_there(&self, now: f64) -> bool {
        self.is_alive && now - self.heard_s < SILENT_S
    }

    /// Why it gets no orders: it is not known yet whether its certificate is its own, or it is not.
    pub(super) fn gets_no_orders(&self, now: f64) -> Option<&'static str> {
        if now < self.doubled_until_s {
            return Some(DOUBLED);
        }
        (now - self.boot_since_s < SETTLED_S).then_some(JUST_CAME)
    }

    /// The run of its control that is meant by an order; `None`: it has not spoken yet.
    pub(super) fn boot(&self) -> Option<u64> {
        (self.heard_s > 0.0 && self.state.boot != 0).then_some(self.state.boot)
    }

    /// Adds the time since the last look to what it was spent on; what nothing was heard of is unknown.
    pub(super) fn count_time(&mut self, now: f64) {
        let since = std::mem::replace(&mut self.counted_until_s, now);
        if since == 0.0 || now <= since {
            return;
        }
        let heard = match self.is_there(now) {
            true => now,
            false => self.heard_s.clamp(since, now),
        };
        for (what, seconds) in [(self.state.use_of_time(), heard - since), (Use::Unknown, now - heard)] {
            if seconds > 0.0 {
                *self.time.entry(what).or_default() += seconds;
            }
        }
    }
}
