//! The planner: speeds where runs meet, and what is handed over when.
//!
//! In:  canonical calls.
//! Out: publications to a ring.
//!
//! Speeds come from a backward pass, which assumes rest at the end of what is known, and a forward pass. A speed of the
//! backward pass that equals its cap cannot rise when more becomes known; all before the last such place is *final*.
//! If the window is full without such a place, its older half is made final, which costs speed but breaks nothing: the
//! backward pass gives the greatest speed from which the machine can still stop, and more path never makes it smaller.

use std::collections::VecDeque;

use super::corners::Corners;
use super::joints::Joints;
use super::profile::{brakeable, end_speed, least_end_speed};
use super::program::{Entry, Program};
use super::runs::{Built, RUN_PIECES, Run, Runs};
use super::{PlanError, Programmed, Settings};
use crate::canon::Event;
use crate::element::Element;
use crate::ring::{Publish, Sink};

/// What became of [`Planner::pump`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pumped {
    /// Everything final has been handed over; more calls, or [`Planner::finish`], are needed.
    Hungry,
    /// The sink is full: pump again later. Do not push much more before that.
    Blocked,
    /// Everything has been handed over, down to the rest at the end.
    Done,
}

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

impl Settings {
    fn window(&self) -> usize {
        self.look_ahead_blocks.max(1)
    }

    /// Elements that the largest publication may have; the ring must hold as many.
    pub fn largest_publication(&self) -> usize {
        let run = RUN_PIECES + PHASE_BORDERS;
        let tail = (self.window() + RUN_PIECES) * (1 + PHASE_BORDERS);
        PUBLICATION + run + tail
    }
}

/// Turns canonical calls into a plan and hands it over.
#[derive(Debug)]
pub struct Planner<S> {
    settings: Settings,
    sink: S,
    program: Program,
    corners: Corners,
    joints: Joints,
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
    finished: bool,
    ideal: Vec<Programmed>,
}

impl<S: Sink<Element>> Planner<S> {
    /// A planner at rest at the start position.
    pub fn new(settings: Settings, sink: S) -> Planner<S> {
        Planner {
            settings,
            sink,
            program: Program::new(settings.start),
            corners: Corners::default(),
            joints: Joints::default(),
            runs: Runs::default(),
            steps: VecDeque::new(),
            final_steps: 0,
            speed: 0.0,
            tail_steps: 0,
            pieces: 0,
            fresh: 0,
            finished: false,
            ideal: Vec::new(),
        }
    }

    /// Takes the next call. An error concerns this call only, which is then of no effect.
    pub fn push(&mut self, event: &Event) -> Result<(), PlanError> {
        let entry = self
            .program
            .take(event.source.line, &event.call, &self.settings)
            .map_err(|kind| PlanError {
                source: event.source,
                kind,
            })?;
        match entry {
            None => {}
            Some(Entry::Move(part)) => {
                self.finished = false;
                self.ideal.push(Programmed {
                    piece: part.piece,
                    feed: part.feed,
                    line: part.line,
                    rapid: part.rapid,
                });
                let mut passed = Vec::new();
                self.corners.push(part, &self.settings, &mut passed);
                self.pass(passed, false);
            }
            Some(Entry::Rest(element)) => {
                self.finished = false;
                self.flush();
                self.steps.push_back(Step {
                    what: What::Rest(Some(element)),
                    end_speed: 0.0,
                });
            }
        }
        Ok(())
    }

    /// Nothing follows for now: what is known is planned to its end, at rest. More may be pushed later.
    pub fn finish(&mut self) {
        self.flush();
        self.finished = true;
    }

    /// Whether everything has been handed over after [`Planner::finish`].
    pub fn is_done(&self) -> bool {
        self.finished && self.steps.is_empty()
    }

    /// Programmed moves since the last call of this function, in machine coordinates.
    pub fn ideal_path(&mut self) -> std::vec::Drain<'_, Programmed> {
        self.ideal.drain(..)
    }

    /// The sink.
    pub fn sink(&mut self) -> &mut S {
        &mut self.sink
    }

    /// Hands over what is final.
    pub fn pump(&mut self) -> Pumped {
        loop {
            if self.final_steps == 0 {
                self.plan_if_due();
            }
            if self.final_steps == 0 {
                return if self.is_done() { Pumped::Done } else { Pumped::Hungry };
            }
            match self.publish() {
                Publish::Done => {}
                Publish::Full => return Pumped::Blocked,
                Publish::TailTaken => {
                    self.drop_steps(self.tail_steps);
                    self.final_steps = 0;
                    self.tail_steps = 0;
                    self.speed = 0.0;
                    // Whatever was planned began with another speed.
                    self.plan();
                }
            }
        }
    }

    /// Plans if there is enough new to make a difference, or no reason to wait.
    fn plan_if_due(&mut self) {
        let window = self.settings.window();
        if self.finished || self.pieces >= window || self.fresh >= window.div_ceil(4) {
            self.plan();
        }
    }

    /// Sends everything through the stages and ends at rest.
    fn flush(&mut self) {
        let mut passed = Vec::new();
        self.corners.flush(&self.settings, &mut passed);
        self.pass(passed, true);
    }

    fn pass(&mut self, passed: Vec<super::corners::Passed>, flush: bool) {
        let mut joined = Vec::new();
        for passed in passed {
            self.joints.push(passed, &self.settings, &mut joined);
        }
        if flush {
            self.joints.flush(&mut joined);
        }
        let mut built = Vec::new();
        for joined in joined {
            self.runs.push(joined, &self.settings, &mut built);
        }
        if flush {
            self.runs.flush(&self.settings, &mut built);
            built.push(Built::Stop);
        }
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
    fn plan(&mut self) {
        self.fresh = 0;
        // A stop must be known within the window, so that a publication has a bounded number of elements.
        let mut pieces = 0;
        let mut count = 0;
        while count < self.steps.len() && pieces < self.settings.window() {
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
        if settled == 0 && pieces >= self.settings.window() {
            settled = count.div_ceil(2);
        }
        self.final_steps = settled;
    }

    /// Hands over the first final steps with a stop behind them.
    fn publish(&mut self) -> Publish {
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
            let result = self.sink.publish(&committed, &tail);
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
