//! Speeds where runs meet, and what is handed over when.
//!
//! In:  stretches and halts.
//! Out: publications to a ring.
//!
//! Speeds come from a backward pass, which assumes rest at the end of what is known, and a forward pass. A speed of the
//! backward pass that equals its cap cannot rise when more becomes known; all before the last such place is *final*.
//! Such a place lies one braking length before the end at the latest, so that the look-ahead is as long as it must be. A
//! backward pass ends where it finds the speed of the pass before: nothing further ahead can change.
//!
//! Two things bound memory, cost speed where they apply, and break nothing, because the backward pass gives the greatest
//! speed from which the machine can still stop, and more path never makes it smaller: if the window, of so many pieces and
//! [`BRAKING_LENGTHS`], is full without a final place, its older half is made final; and if the stop behind a publication would have too many elements, speeds are
//! planned for a stop that has not.

use std::collections::VecDeque;
use std::sync::Arc;

use super::buffers::{Ahead, Buffers, Runs as Path, before, cap};
use super::runs::{Built, RUN_PIECES, Run, Runs};
use crate::element::Element;
use crate::plan::gate::Gate;
use crate::plan::junctions::{Joined, Junctions};
use crate::plan::profile::{change_length, end_speed, least_end_speed};
use crate::plan::smooth::Passed;
use crate::plan::workers::Workers;
use crate::plan::{Pumped, Settings};
use crate::ring::{Publish, Sink};

/// What happens, one after the other.
#[derive(Debug)]
enum What {
    Run(Arc<Run>),
    /// Rest; with something to do or without.
    Rest(Option<Box<Element>>),
}

impl What {
    fn run(&self) -> Option<&Arc<Run>> {
        match self {
            What::Run(run) => Some(run),
            What::Rest(_) => None,
        }
    }

    fn pieces(&self) -> usize {
        self.run().map_or(0, |run| run.pieces())
    }
}

#[derive(Debug)]
struct Step {
    what: What,
    /// Greatest speed at its end from which what follows can be run, by the backward pass; `None`: not planned yet.
    end_speed: Option<f64>,
    /// What was computed ahead of it, if anything.
    ahead: Ahead,
}

impl Step {
    fn new(what: What) -> Step {
        Step {
            what,
            end_speed: None,
            ahead: Ahead::default(),
        }
    }

    /// Elements that it comes to at the most: a border between phases may fall into any piece, and there are six.
    fn elements_max(&self) -> usize {
        const PHASE_BORDERS: usize = 6;
        self.what.pieces() + PHASE_BORDERS
    }
}

/// Final elements from which on a publication is not made larger.
const PUBLICATION: usize = 128;

/// Elements that the stop behind a publication may have: enough for a second of braking over short blocks.
const TAIL: usize = 8192;

/// Pieces that are new before speeds are planned again, at the most: so many, or so many buffers. It does not depend on how many
/// threads there are.
const FRESH: usize = 128;
const BUFFERS: usize = 4;

/// Braking lengths that are looked ahead at the least, however many pieces that are: up to what that many stops may have.
const BRAKING_LENGTHS: usize = 3;

/// Elements that the largest publication may have. It does not depend on how far is looked ahead.
pub(in crate::plan) fn largest_publication() -> usize {
    // The last run of a publication may be as long as runs are; see `elements_max`.
    PUBLICATION + RUN_PIECES + 6 + TAIL
}

/// Plans runs and hands them over.
#[derive(Debug)]
pub(in crate::plan) struct Steps {
    buffers: Buffers,
    junctions: Junctions,
    runs: Runs,
    steps: VecDeque<Step>,
    /// Steps at the front whose speeds are decided.
    final_steps: usize,
    /// Steps at the front whose motion has been computed ahead, as far as that is worth it.
    computed_steps: usize,
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
    /// Memory that is kept from one call to the next: stretches, runs, and the elements of a publication and of the stop
    /// behind it.
    joined: Vec<Joined>,
    built: Vec<Built>,
    committed: Vec<Element>,
    tail: Vec<Element>,
    /// Elements of the publication that found no room; 0: none is waiting, or it has changed since.
    refused: usize,
    gate: Gate,
    /// The line at which the gate is closed.
    closed: Option<u32>,
    #[cfg(test)]
    pub(in crate::plan) spoil: Option<fn(&mut [Element]) -> bool>,
}

impl Steps {
    /// At rest at the beginning of a path that comes.
    pub(in crate::plan) fn new(settings: &Settings, workers: &Workers) -> Steps {
        Steps {
            buffers: Buffers::new(settings, workers),
            junctions: Junctions::default(),
            runs: Runs::default(),
            steps: VecDeque::new(),
            final_steps: 0,
            computed_steps: 0,
            speed: 0.0,
            tail_steps: 0,
            pieces: 0,
            fresh: 0,
            finished: false,
            joined: Vec::new(),
            built: Vec::new(),
            committed: Vec::new(),
            tail: Vec::new(),
            refused: 0,
            gate: Gate::new(settings),
            closed: None,
            #[cfg(test)]
            spoil: None,
        }
    }

    /// Publications that the gate has refused.
    pub(in crate::plan) fn planned_anew(&self) -> u64 {
        self.gate.refused()
    }

    /// The path goes on.
    pub(in crate::plan) fn push(&mut self, passed: Passed, settings: &Settings) {
        self.finished = false;
        let mut joined = std::mem::take(&mut self.joined);
        self.junctions.push(passed, settings, &mut joined);
        self.run(&mut joined, settings);
        self.joined = joined;
    }

    /// What is known ends at rest, where `element` happens if there is one.
    pub(in crate::plan) fn rest(&mut self, element: Option<Box<Element>>, settings: &Settings) {
        let mut joined = Vec::new();
        self.junctions.flush(&mut joined);
        self.run(&mut joined, settings);
        let mut built = Vec::new();
        self.runs.flush(settings, &mut built);
        built.push(Built::Stop);
        self.append(&mut built);
        if element.is_some() {
            self.finished = false;
            self.steps.push_back(Step::new(What::Rest(element)));
        }
    }

    /// How often a pass over a run took what had been computed ahead, and how often it had to compute that again.
    pub(in crate::plan) fn computed_ahead(&self) -> [u64; 2] {
        self.buffers.counts()
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
    pub(in crate::plan) fn pump(&mut self, settings: &Settings, sink: &mut dyn Sink<Element>) -> Pumped {
        loop {
            if let Some(line) = self.closed {
                return Pumped::Refused { line };
            }
            if self.final_steps == 0 {
                self.plan_if_due(settings);
            }
            if self.final_steps == 0 {
                return if self.is_done() { Pumped::Done } else { Pumped::Hungry };
            }
            match self.publish(sink) {
                Publish::Done => {}
                // Nothing is meant to replace final motion here.
                Publish::Full | Publish::Passed if self.closed.is_none() => return Pumped::Blocked,
                Publish::Full | Publish::Passed => {}
                Publish::TailTaken => {
                    self.gate.tail_taken();
                    // The backward pass does not depend on the speed before it.
                    self.final_steps = self.final_steps.saturating_sub(self.tail_steps);
                    self.drop_steps(self.tail_steps);
                    self.tail_steps = 0;
                    self.speed = 0.0;
                }
            }
        }
    }

    /// Plans if there is enough new to make a difference, or no reason to wait.
    fn plan_if_due(&mut self, settings: &Settings) {
        let most = FRESH.max(BUFFERS * settings.look_ahead_buffer_blocks);
        if self.finished || self.fresh >= settings.look_ahead_blocks.div_ceil(4).clamp(1, most) {
            self.plan(settings);
        }
    }

    /// Whether enough is looked ahead: the pieces that are asked for, and three braking lengths from the highest speed.
    fn is_full(&self, settings: &Settings) -> bool {
        if self.pieces < settings.look_ahead_blocks {
            return false;
        }
        let (mut length, mut braking) = (0.0, 0.0_f64);
        for step in &self.steps {
            if let What::Run(run) = &step.what {
                length += run.length;
                braking = braking.max(change_length(run.limits.v, 0.0, &run.limits));
            }
        }
        // No stop has more elements, so that no braking length is of more pieces, either.
        length >= BRAKING_LENGTHS as f64 * braking || self.pieces >= BRAKING_LENGTHS * TAIL
    }

    fn run(&mut self, joined: &mut Vec<Joined>, settings: &Settings) {
        let mut built = std::mem::take(&mut self.built);
        for joined in joined.drain(..) {
            self.runs.push(joined, settings, &mut built);
        }
        self.append(&mut built);
        self.built = built;
    }

    fn append(&mut self, built: &mut Vec<Built>) {
        self.refused = 0;
        for built in built.drain(..) {
            let what = match built {
                Built::Run(run) => {
                    self.pieces += run.pieces();
                    self.fresh += run.pieces();
                    What::Run(Arc::new(run))
                }
                // One rest after another is one rest.
                Built::Stop if self.steps.back().is_none_or(|step| matches!(step.what, What::Rest(_))) => continue,
                Built::Stop => What::Rest(None),
            };
            self.steps.push_back(Step::new(what));
        }
    }

    fn run_at(&self, i: usize) -> Option<&Run> {
        self.steps.get(i)?.what.run().map(Arc::as_ref)
    }

    /// Greatest speed at the end of step `i`, by what is on both sides.
    fn cap(&self, i: usize) -> f64 {
        cap(self.run_at(i), self.run_at(i + 1))
    }

    /// Greatest speed before step `i` if `after` is that at its end.
    fn before(&self, i: usize, after: f64) -> f64 {
        let ahead = &self.steps[i].ahead;
        let computed = self.buffers.counted(ahead.has()[0], ahead.before(after));
        computed.unwrap_or_else(|| before(i.checked_sub(1).and_then(|i| self.run_at(i)), self.run_at(i), after))
    }

    /// The steps from `first` on, for jobs.
    fn path(&self, steps: std::ops::Range<usize>) -> Path {
        self.steps.range(steps).map(|step| step.what.run().cloned()).collect()
    }

    /// Has the threads compute what the backward pass will ask for.
    fn compute_speeds(&mut self) {
        // Those that were there before have been looked at from further ahead than a buffer would.
        let new = self
            .steps
            .iter()
            .rev()
            .take_while(|step| step.end_speed.is_none())
            .count();
        let first = (self.steps.len() - new).saturating_sub(1);
        if self
            .buffers
            .are_worth_it(&mut self.steps.range(first..).map(|step| step.what.pieces()))
        {
            let computed = self.buffers.speeds(&self.path(first..self.steps.len()));
            // What is before the first is not in the path.
            let known = usize::from(first > 0);
            for (step, speeds) in self.steps.range_mut(first..).zip(computed).skip(known) {
                step.ahead.set_speeds(speeds);
            }
        }
    }

    /// Has the threads compute the motion that the next final steps will come to.
    fn compute_motion(&mut self) {
        let most = self.buffers.pieces_at_once();
        let mut pieces = 0;
        let within = self.steps.range(..self.final_steps).take_while(|step| {
            let within = pieces < most;
            pieces += step.what.pieces();
            within
        });
        let steps = 0..within.count();
        self.computed_steps = steps.end;
        if self
            .buffers
            .are_worth_it(&mut self.steps.range(steps.clone()).map(|step| step.what.pieces()))
        {
            let path = self.path(steps.clone());
            let ends = self
                .steps
                .range(steps.clone())
                .map(|step| step.end_speed.unwrap_or(0.0))
                .collect();
            let computed = self.buffers.motion(&path, ends, self.speed);
            for (step, motion) in self.steps.range_mut(steps).zip(computed) {
                step.ahead.set_motion(motion);
            }
        }
    }

    /// Plans the speeds of all steps, none of which is final, and makes steps final; some in any case if the window is full.
    fn plan(&mut self, settings: &Settings) {
        (self.fresh, self.refused) = (0, 0);
        self.compute_speeds();
        let mut after = 0.0;
        for i in (0..self.steps.len()).rev() {
            // `after` is the speed at the end of step i. At its cap, nothing that follows can raise it; but what follows
            // the last known step is not known.
            let known = i + 1 < self.steps.len() || self.finished || matches!(self.steps[i].what, What::Rest(_));
            if self.final_steps == 0 && known && after >= self.cap(i) {
                self.final_steps = i + 1;
            }
            if self.steps[i].end_speed == Some(after) {
                break;
            }
            self.steps[i].end_speed = Some(after);
            after = self.before(i, after);
        }
        if self.final_steps == 0 && self.is_full(settings) {
            self.final_steps = self.steps.len().div_ceil(2);
        }
    }

    /// Lowers speeds so that the machine can stop within as many steps as a tail may have, and leaves half of them final at
    /// the most.
    fn plan_short(&mut self) {
        let mut elements = 0;
        let fits = |step: &&Step| {
            elements += step.elements_max();
            elements <= TAIL
        };
        let count = self.steps.iter().take_while(fits).count();
        self.final_steps = self.final_steps.min(count.div_ceil(2));
        let mut after = 0.0;
        for i in (0..count).rev() {
            // The others may be faster again.
            if i < self.final_steps {
                let planned = self.steps[i].end_speed.unwrap_or(0.0);
                self.steps[i].end_speed = Some(planned.min(after));
            }
            after = self.before(i, after);
        }
    }

    /// Speed at the end of step `i` if that before it is `speed`.
    fn speed_after(&self, i: usize, speed: f64) -> f64 {
        match (&self.steps[i].what, self.steps[i].end_speed) {
            (What::Run(run), Some(end)) => end_speed(speed, end, run.length, &run.limits),
            // Only what is planned becomes final, and all else ends at rest.
            (What::Run(_), None) | (What::Rest(_), _) => 0.0,
        }
    }

    /// Hands over the first final steps with a stop behind them.
    fn publish(&mut self, sink: &mut dyn Sink<Element>) -> Publish {
        // Asked again and again while the machine runs what is there: it would be put together each time.
        if sink.is_full(self.refused) {
            return Publish::Full;
        }
        if self.computed_steps == 0 {
            self.compute_motion();
        }
        let (mut committed, mut tail) = (std::mem::take(&mut self.committed), std::mem::take(&mut self.tail));
        let result = self.publish_in(sink, &mut committed, &mut tail);
        self.refused = match result {
            Publish::Full => committed.len() + tail.len(),
            Publish::Done | Publish::Passed | Publish::TailTaken => 0,
        };
        (self.committed, self.tail) = (committed, tail);
        result
    }

    fn publish_in(
        &mut self,
        sink: &mut dyn Sink<Element>,
        committed: &mut Vec<Element>,
        tail: &mut Vec<Element>,
    ) -> Publish {
        let (steps, tail_steps, after) = loop {
            committed.clear();
            let mut steps = 0;
            let mut after = self.speed;
            while steps < self.final_steps && (steps == 0 || committed.len() < PUBLICATION) {
                let step = &self.steps[steps];
                after = match self
                    .buffers
                    .counted(step.ahead.has()[1], step.ahead.motion(after, step.end_speed))
                {
                    Some(motion) => {
                        committed.extend_from_slice(&motion.elements);
                        motion.after
                    }
                    None => self.elements(steps, after, self.speed_after(steps, after), committed),
                };
                steps += 1;
            }
            match self.stop(steps, after, tail) {
                Some(tail_steps) => break (steps, tail_steps, after),
                None => self.plan_short(),
            }
        };
        if !(committed.is_empty() && tail.is_empty()) {
            #[cfg(test)]
            if self.spoil.is_some_and(|spoil| spoil(committed)) {
                self.spoil = None;
            }
            if let Err(line) = self.gate.check(committed, tail, false) {
                self.closed = Some(line);
                return Publish::Full;
            }
            let result = sink.publish(committed, tail);
            if result != Publish::Done {
                return result;
            }
            self.gate.handed_over();
        }
        self.speed = after;
        self.final_steps -= steps;
        self.tail_steps = tail_steps;
        self.drop_steps(steps);
        Publish::Done
    }

    /// Puts the fastest stop from `speed` at the beginning of step `first` into `tail`, and returns of how many steps it
    /// is; `None` if it is too long.
    fn stop(&self, first: usize, mut speed: f64, tail: &mut Vec<Element>) -> Option<usize> {
        tail.clear();
        let mut step = first;
        let mut elements = 0;
        while speed > 0.0 && step < self.steps.len() {
            elements += self.steps[step].elements_max();
            if elements > TAIL {
                return None;
            }
            let least = match &self.steps[step].what {
                What::Run(run) => least_end_speed(speed, run.length, &run.limits),
                What::Rest(_) => 0.0,
            };
            speed = self.elements(step, speed, least, tail);
            step += 1;
        }
        debug_assert!(speed == 0.0, "a stop is known");
        Some(step - first)
    }

    /// Appends the elements of a step; returns the speed at its end.
    fn elements(&self, step: usize, speed: f64, end_speed: f64, out: &mut Vec<Element>) -> f64 {
        match &self.steps[step].what {
            What::Run(run) => {
                run.spans(speed, end_speed, out);
                end_speed
            }
            What::Rest(element) => {
                out.extend(element.as_deref());
                0.0
            }
        }
    }

    fn drop_steps(&mut self, count: usize) {
        self.computed_steps = self.computed_steps.saturating_sub(count);
        for step in self.steps.drain(..count) {
            self.pieces -= step.what.pieces();
        }
    }
}
