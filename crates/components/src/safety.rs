//! Latches and watchdogs. They are no safety functions in the sense of the standards: those are wired.

use crate::component::{Component, Options};
use crate::declare::component;
use crate::edge::Edge;

component! {
    /// Latch of an emergency stop chain made in software: faulted at the start and after each fault, until it is reset.
    EstopLatch = "estop_latch";
    in {
        ok_in: bool = true, "the chain before is closed";
        fault_in: bool = false, "a fault, at once";
        reset: bool = false, "resets as it rises, while `ok-in` and not `fault-in`";
    }
    out {
        ok_out: bool = false, "the chain is closed";
        fault_out: bool = true, "not `ok-out`";
        watchdog: bool = false, "changes with every call while `ok-out`";
    }
    state { edge: Edge = Edge::default(); }
}

impl Component for EstopLatch {
    fn update(&mut self, _: f64) {
        let rises = self.edge.rises(self.reset);
        self.ok_out = self.ok_in && !self.fault_in && (self.ok_out || rises);
        self.fault_out = !self.ok_out;
        self.watchdog ^= self.ok_out;
    }
}

component! {
    /// Counts errors up and good calls down, and trips at a threshold.
    SafetyLatch = "safety_latch";
    in {
        error_in: bool = false, "error";
        enable: bool = true, "counts; else the error is handed on";
        heal: i32 = 1, "taken from the count in a good call";
        harm: i32 = 1, "added to the count in a call with an error";
        latching: bool = true, "stays tripped until it is reset";
        reset: bool = false, "count to 0 and no longer tripped, as it rises";
        threshold: i32 = 100, "count at which it trips";
        min: i32 = 0, "least count";
        max: i32 = 1000, "greatest count";
    }
    out {
        count: i32 = 0, "count";
        error_out: bool = false, "tripped";
        ok_out: bool = true, "not tripped";
    }
    state { edge: Edge = Edge::default(); }
}

impl Component for SafetyLatch {
    fn update(&mut self, _: f64) {
        let resets = self.edge.rises(self.reset);
        if !self.enable {
            (self.count, self.error_out) = (0, self.error_in);
        } else {
            if resets {
                (self.count, self.error_out) = (0, false);
            }
            let count = match self.error_in {
                true => self.count.saturating_add(self.harm),
                false => self.count.saturating_sub(self.heal),
            };
            self.count = count.max(self.min).min(self.max);
            self.error_out = self.count >= self.threshold || self.latching && self.error_out;
        }
        self.ok_out = !self.error_out;
    }
}

component! {
    /// Watches that inputs keep changing, each within its own time.
    Watchdog = "watchdog";
    options { num_inputs: 1, 1..=32, [], "number of inputs"; }
    in {
        input as "input-#": Vec<bool> = vec![false; 1], "must keep changing";
        timeout as "timeout-#": Vec<f64> = vec![0.0; 1], "longest time without a change, s";
        enable_in: bool = false, "watches; after a failure it has to fall and rise";
    }
    out { ok_out: bool = false, "watches, and all inputs keep changing"; }
    state { edges: Vec<Edge> = vec![Edge::default(); 1]; since_s: Vec<f64> = vec![0.0; 1]; failed: bool = false; }
}

impl Component for Watchdog {
    fn shape(&mut self, options: &Options<'_>) {
        let count = options.count("num_inputs");
        (self.input, self.timeout) = (vec![false; count], vec![0.0; count]);
        (self.edges, self.since_s) = (vec![Edge::default(); count], vec![0.0; count]);
    }

    fn update(&mut self, period_s: f64) {
        let watched = self.input.iter().zip(&self.timeout);
        let states = self.edges.iter_mut().zip(&mut self.since_s);
        for ((input, timeout), (edge, since_s)) in watched.zip(states) {
            let (rises, falls) = edge.see(*input);
            *since_s = match rises || falls || !self.enable_in {
                true => 0.0,
                false => *since_s + period_s,
            };
            // A time that is no number is over.
            self.failed |= timeout.is_nan() || *since_s > *timeout;
        }
        self.failed &= self.enable_in;
        self.ok_out = self.enable_in && !self.failed;
    }
}
