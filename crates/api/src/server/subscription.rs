//! What a subscriber has been told, and what it is to be told next.
//!
//! In:  how everything is, again and again. Out: notifications of what differs from what was told last.
//!
//! Nothing is kept for a subscriber but the state that it was told last: one that reads slowly is told less often, of the same.

use crate::rpc;
use protocol::StateChange;
use protocol::limits::STATE_RATE_MAX_HZ;
use serde_json::{Map, Value};

/// Octets of the system that hold what a subscriber has not read: beyond them, it is told less often.
pub const UNREAD_MAX: usize = 16 * 1024;
/// What changes all the time while something moves: told at the rate that was asked for.
pub const SAMPLED: [&str; 11] = [
    "position_mm",
    "work_offset_mm",
    "work_rotation_degrees",
    "codes",
    "to_go_mm",
    "velocity_mm_s",
    "spindle",
    "line",
    "remaining_s",
    "done_percent",
    "elapsed_s",
];
/// What counts: told once a second, which shows that the control lives. A change of anything else is an event, told at once.
pub const COUNTED: [&str; 3] = ["cycles", "cycles_skipped", "late_max_us"];
const COUNTED_NS: u64 = 1_000_000_000;

/// How everything is at one moment.
#[derive(Debug, PartialEq)]
pub struct State {
    /// When, ns of CLOCK_MONOTONIC.
    pub monotonic_ns: u64,
    /// When, s since 1970, UTC.
    pub unix_s: f64,
    /// What `status` answers.
    pub fields: Map<String, Value>,
}

impl State {
    /// When, CLOCK_MONOTONIC, s.
    pub fn monotonic_s(&self) -> f64 {
        self.monotonic_ns as f64 * 1e-9
    }
}

/// A client that wants to be told of changes.
#[derive(Debug)]
pub struct Subscription {
    interval_ns: u64,
    told: Map<String, Value>,
    sampled_ns: u64,
    counted_ns: u64,
}

impl Subscription {
    /// Of a client that is told the whole state now.
    pub fn begin(state: &State, rate_hz: u64) -> Subscription {
        Subscription {
            interval_ns: 1_000_000_000 / rate_hz.clamp(1, STATE_RATE_MAX_HZ),
            told: state.fields.clone(),
            sampled_ns: state.monotonic_ns,
            counted_ns: state.monotonic_ns,
        }
    }

    /// The line that tells what has changed, if it is time for one.
    pub fn notification(&mut self, state: &State) -> Option<String> {
        let is_due = |last_ns, every_ns| state.monotonic_ns.saturating_sub(last_ns) >= every_ns;
        let (is_sample, is_count) = (
            is_due(self.sampled_ns, self.interval_ns),
            is_due(self.counted_ns, COUNTED_NS),
        );
        let of = |name: &str, names: &[&str]| names.contains(&name);
        let changed: Vec<_> = (state.fields.iter())
            .filter(|(name, value)| (is_count || !of(name, &COUNTED)) && self.told.get(*name) != Some(value))
            .collect();
        let is_event = changed
            .iter()
            .any(|(name, _)| !of(name, &SAMPLED) && !of(name, &COUNTED));
        if changed.is_empty() || !(is_sample || is_count || is_event) {
            return None;
        }
        let changed: Map<String, Value> = changed
            .into_iter()
            .map(|(name, value)| (name.clone(), value.clone()))
            .collect();
        self.told.extend(changed.clone());
        self.sampled_ns = state.monotonic_ns;
        if is_count {
            self.counted_ns = state.monotonic_ns;
        }
        let change = StateChange {
            monotonic_s: state.monotonic_s(),
            unix_s: state.unix_s,
            changed,
        };
        Some(rpc::notification("state", &change))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn state(ms: u64, fields: Value) -> State {
        State {
            monotonic_ns: ms * 1_000_000,
            unix_s: 1e9 + ms as f64 * 1e-3,
            fields: fields.as_object().cloned().unwrap_or_default(),
        }
    }

    fn told(subscription: &mut Subscription, state: &State) -> Option<Value> {
        let line = subscription.notification(state)?;
        let message: Value = serde_json::from_str(&line).unwrap();
        assert_eq!((&message["method"], message.get("id")), (&json!("state"), None));
        assert_eq!(message["params"]["monotonic_s"], state.monotonic_ns as f64 * 1e-9);
        Some(message["params"]["changed"].clone())
    }

    #[test]
    fn what_is_sampled_comes_at_the_rate_an_event_at_once_and_counters_each_second() {
        let at =
            |ms, line: u32, state_word: &str| state(ms, json!({ "line": line, "state": state_word, "cycles": ms }));
        let mut subscription = Subscription::begin(&at(0, 1, "ready"), 20);
        assert_eq!(told(&mut subscription, &at(49, 2, "ready")), None, "not due");
        assert_eq!(told(&mut subscription, &at(50, 2, "ready")), Some(json!({ "line": 2 })));
        // With an event goes what has changed meanwhile; nothing is told twice.
        let event = json!({ "line": 3, "state": "held" });
        assert_eq!(told(&mut subscription, &at(51, 3, "held")), Some(event));
        assert_eq!(told(&mut subscription, &at(999, 3, "held")), None);
        assert_eq!(
            told(&mut subscription, &at(1000, 3, "held")),
            Some(json!({ "cycles": 1000 }))
        );
        assert_eq!(told(&mut subscription, &at(1999, 3, "held")), None);
    }

    #[test]
    fn a_faster_rate_than_the_greatest_is_that_one() {
        for (rate_hz, interval_ns) in [
            (0, 1_000_000_000),
            (1, 1_000_000_000),
            (20, 50_000_000),
            (99, 50_000_000),
        ] {
            let subscription = Subscription::begin(&state(0, json!({})), rate_hz);
            assert_eq!(subscription.interval_ns, interval_ns);
        }
    }

    /// What is told, applied in turn, is what everything is.
    #[test]
    fn changes_on_changes_give_the_state() {
        let mut mine = json!({ "a": 1, "b": null, "line": 1 });
        let mut subscription = Subscription::begin(&state(0, mine.clone()), 20);
        for (ms, fields) in [
            (10, json!({ "a": null, "b": { "x": [1] }, "line": 2 })),
            (20, json!({ "a": null, "b": { "x": [1, 2] }, "line": 2 })),
            (90, json!({ "a": 1, "b": null, "line": 3 })),
        ] {
            let changed = told(&mut subscription, &state(ms, fields.clone())).expect("a change");
            for (name, value) in changed.as_object().unwrap() {
                mine[name] = value.clone();
            }
            assert_eq!(mine, fields);
        }
    }
}
