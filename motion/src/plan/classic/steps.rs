//! Speeds where runs meet, and what is handed over when.
//!
//! In:  stretches and halts.
//! Out: publications to a ring.
//!
//! Speeds come from a backward pass, which assumes rest at the end of what is known, and a forward pass. A speed of the
//! backward pass that equals its cap cannot rise when more becomes known; all before the last such place is *final*.
//! If the window is full without such a place, its older half is made final, which costs speed but breaks nothing: the
//! backward pass gives the greatest speed from which the machine can still stop, and more path never makes it smaller.

use std::collections::VecDeque;

use super::runs::{Built, RUN_PIECES, Run, Runs};
use crate::element::Element;
use crate::plan::kinks::{Joined, Kinks};
use crate::plan::profile::{brakeable, end_speed, least_end_speed};
use crate::plan::smooth::Passed;
use crate::plan::{Pumped, Settings};
use crate::ring::{Publish, Sink};

/// What happens, one after the other.
#[derive(Debug)]
enum What {
    Run(Run),
    /// Rest; with something to do or without.
    Rest(Option<Element>),
}

impl What {
    fn pieces(&self) -> usize {
        match self {
            What::Run(run) => run.pieces(),
            What::Rest(_) => 0,
        }
    }
}

#[derive(Debug)]
struct Step {
    what: What,
    /// Speed at its end, once planned.
    end_speed: f64,
}

/// Final elements from which on a publication is not made larger.
const PUBLICATION: usize = 512;

/// Elements that a run has more than pieces: a border between phases may fall into any piece, and there are six.
const PHASE_BORDERS: usize = 6;

/// Pieces that are looked ahead.
fn window(settings: &Settings) -> usize {
    settings.look_ahead_blocks.max(1)
}

/// Elements that the largest publication may have.
pub(in crate::plan) fn largest_publication(settings: &Settings) -> usize {
    let run = RUN_PIECES + PHASE_BORDERS;
    let tail = (window(settings) + RUN_PIECES) * (1 + PHASE_BORDERS);
    PUBLICATION + run + tail
}

/// Plans runs and hands them over.
#[derive(Debug, Default)]
pub(in crate::plan) struct Steps {
    kinks: Kinks,
    runs: Runs,
    steps: VecDeque<Step>,
    /// Steps at the front whose speeds are decided.
    final_steps: usize,
    /// Speed before the first step.
    speed: f64,
    /// Steps at the front that the tail in the ring goes through.
    tail_steps: usize,
    /// Pieces in all steps.
    pieces: usize,
    /// Pieces that were not there when speeds were last planned.
    fresh: usize,
    /// Nothing follows for now.
    finished: bool,
}

impl Steps {
    /// The path goes on.
    pub(in crate::plan) fn push(&mut self, passed: Passed, settings: &Settings) {
        self.finished = false;
        let mut joined = Vec::new();
        self.kinks.push(passed, settings, &mut joined);
        self.run(joined, settings);
    }

    /// What is known ends at rest, where `element` happens if there is one.
    pub(in crate::plan) fn rest(&mut self, element: Option<Element>, settings: &Settings) {
        let mut joined = Vec::new();
        self.kinks.flush(&mut joined);
        self.run(joined, settings);
        let mut built = Vec::new();
        self.runs.flush(settings, &mut built);
        built.push(Built::Stop);
        self.take(built);
        if element.is_some() {
            self.finished = false;
            self.steps.push_back(Step {
                what: What::Rest(element),
                end_speed: 0.0,
            });
        }
    }

    /// Nothing follows for now; the path has ended at rest.
    pub(in crate::plan) fn finish(&mut self) {
        self.finished = true;
    }

    /// Whether everything has been handed over after [`Steps::finish`].
    pub(in crate::plan) fn is_done(&self) -> bool {
        self.finished && self.steps.is_empty()
    }

    /// Hands over what is final.
    pub(in crate::plan) fn pump<S: Sink<Element>>(&mut self, settings: &Settings, sink: &mut S) -> Pumped {
        loop {
            if self.final_steps == 0 {
                self.plan_if_due(settings);
            }
            if self.final_steps == 0 {
                return if self.is_done() { Pumped::Done } else { Pumped::Hungry };
            }
            match self.publish(sink) {
                Publish::Done => {}
                Publish::Full => return Pumped::Blocked,
                Publish::TailTaken => {
                    self.drop_steps(self.tail_steps);
                    self.final_steps = 0;
                    self.tail_steps = 0;
                    self.speed = 0.0;
                    // Whatever was planned began with another speed.
                    self.plan(settings);
                }
            }
        }
    }

    /// Plans if there is enough new to make a difference, or no reason to wait.
    fn plan_if_due(&mut self, settings: &Settings) {
        let window = window(settings);
        if self.finished || self.pieces >= window || self.fresh >= window.div_ceil(4) {
            self.plan(settings);
        }
    }

    fn run(&mut self, joined: Vec<Joined>, settings: &Settings) {
        let mut built = Vec::new();
        for joined in joined {
            self.runs.push(joined, settings, &mut built);
        }
        self.take(built);
    }

    fn take(&mut self, built: Vec<Built>) {
        for built in built {
            let what = match built {
                Built::Run(run) => {
                    self.pieces += run.pieces();
                    self.fresh += run.pieces();
                    What::Run(run)
                }
                // One rest after another is one rest.
                Built::Stop if self.steps.back().is_none_or(|step| matches!(step.what, What::Rest(_))) => continue,
                Built::Stop => What::Rest(None),
            };
            self.steps.push_back(Step { what, end_speed: 0.0 });
        }
    }

    /// Greatest speed at the end of step `i`, by what is on both sides.
    fn cap(&self, i: usize) -> f64 {
        match (
            self.steps.get(i).map(|step| &step.what),
            self.steps.get(i + 1).map(|step| &step.what),
        ) {
            (Some(What::Run(a)), Some(What::Run(b))) => a.limits.v.min(b.limits.v),
            _ => 0.0,
        }
    }

    /// Plans the speeds of all steps within the window, none of which is final, and makes steps final; some in any case
    /// if the window is full.
    fn plan(&mut self, settings: &Settings) {
        self.fresh = 0;
        // A stop must be known within the window, so that a publication has a bounded number of elements.
        let mut pieces = 0;
        let mut count = 0;
        while count < self.steps.len() && pieces < window(settings) {
            pieces += self.steps[count].what.pieces();
            count += 1;
        }
        let mut settled = 0;
        let mut after = 0.0;
        for i in (0..count).rev() {
            // `after` is the speed at the end of step i. At its cap, nothing that follows can raise it; but what follows
            // the last known step is not known.
            let known = i + 1 < self.steps.len() || self.finished || matches!(self.steps[i].what, What::Rest(_));
            if settled == 0 && known && after >= self.cap(i) {
                settled = i + 1;
            }
            self.steps[i].end_speed = after;
            after = match &self.steps[i].what {
                What::Run(run) if i > 0 => brakeable(after, self.cap(i - 1), run.length, &run.limits),
                What::Run(_) | What::Rest(_) => 0.0,
            };
        }
        let mut speed = self.speed;
        for step in self.steps.range_mut(..count) {
            if let What::Run(run) = &step.what {
                step.end_speed = end_speed(speed, step.end_speed, run.length, &run.limits);
            }
            speed = step.end_speed;
        }
        if settled == 0 && pieces >= window(settings) {
            settled = count.div_ceil(2);
        }
        self.final_steps = settled;
    }

    /// Hands over the first final steps with a stop behind them.
    fn publish<S: Sink<Element>>(&mut self, sink: &mut S) -> Publish {
        let mut committed = Vec::new();
        let mut steps = 0;
        let mut speed = self.speed;
        while steps < self.final_steps && (steps == 0 || committed.len() < PUBLICATION) {
            speed = self.elements(steps, speed, self.steps[steps].end_speed, &mut committed);
            steps += 1;
        }
        let mut tail = Vec::new();
        let mut tail_steps = 0;
        while speed > 0.0 && steps + tail_steps < self.steps.len() {
            let step = steps + tail_steps;
            let least = match &self.steps[step].what {
                What::Run(run) => least_end_speed(speed, run.length, &run.limits),
                What::Rest(_) => 0.0,
            };
            speed = self.elements(step, speed, least, &mut tail);
            tail_steps += 1;
        }
        debug_assert!(speed == 0.0, "a stop is known");
        if !(committed.is_empty() && tail.is_empty()) {
            let result = sink.publish(&committed, &tail);
            if result != Publish::Done {
                return result;
            }
        }
        self.speed = self.steps[steps - 1].end_speed;
        self.final_steps -= steps;
        self.tail_steps = tail_steps;
        self.drop_steps(steps);
        Publish::Done
    }

    /// Appends the elements of a step; returns the speed at its end.
    fn elements(&self, step: usize, speed: f64, end_speed: f64, out: &mut Vec<Element>) -> f64 {
        match &self.steps[step].what {
            What::Run(run) => {
                run.spans(speed, end_speed, out);
                end_speed
            }
            What::Rest(element) => {
                out.extend(*element);
                0.0
            }
        }
    }

    fn drop_steps(&mut self, count: usize) {
        for step in self.steps.drain(..count) {
            self.pieces -= step.what.pieces();
        }
    }
}
