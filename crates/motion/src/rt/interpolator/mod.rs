//! Interpolation: where the axes are now.
//!
//! In:  elements of the ring; the wanted shares of the planned speed; where the spindle is; the contact of a probe.
//! Out: one [`Sample`] per cycle.
//!
//! Position always comes from the exact geometry at the place that plan time has reached, so that rounding of time can
//! never leave the path.
//!
//! With a share below 0 plan time runs backward, over the elements that have been run, from rest and to rest; forward again
//! it passes the same elements. It comes to rest where there is no way back: where the program began, behind an action or a
//! move in step with the spindle, or where elements are no longer kept. In single block it comes to rest where the line of
//! the plan changes, in both directions, and waits there for [`Interpolator::next_block`]. RT.

mod ends;
mod sample;

use super::braking::SAME_S;
use super::probe::{Answer, Prober, StopShares};
use super::scale::ScaleRamp;
use super::shares::Shares;
use super::synced::{Follower, SpindleFeedback, SyncReport};
use super::track::{Track, begins_at_rest};
use crate::canon::Position;
use crate::element::{Action, Auxiliary, Element};
use crate::ring::{Consumer, Timed};
use ends::{Arrived, End};
pub use sample::{Sample, SampleState};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Elements that one cycle may pass. A cycle that reaches this many waits for the next one; it takes elements shorter
/// than a hundredth of a cycle to get there.
const ELEMENTS_PER_CYCLE: usize = 128;

/// Elements that are kept for the way back: seconds to minutes of motion.
const KEPT_ELEMENTS: usize = 4096;

/// Runs down the plan.
#[derive(Debug)]
pub struct Interpolator {
    track: Track,
    ramp: ScaleRamp,
    /// Plan time since the beginning of the current element, s.
    time_s: f64,
    /// Plan time of the elements before it, s.
    done_s: f64,
    /// How far they have brought the program, as [`Element::way`] says.
    done_way: f64,
    backward: bool,
    single_block: bool,
    arrived: Option<Arrived>,
    /// The end of the block before may be left.
    leaves: bool,
    follower: Follower,
    prober: Prober,
    sample: Sample,
    /// What of the auxiliary functions has been told.
    told: Auxiliary,
    /// Shows how many messages.
    messages: Option<Arc<AtomicU32>>,
}

impl Interpolator {
    /// At rest at `start` (machine position), before the first element.
    pub fn new(consumer: Consumer<Element>, start: Position, ramp: ScaleRamp) -> Interpolator {
        Interpolator::keeping(KEPT_ELEMENTS, consumer, start, ramp)
    }

    /// The same with as many elements kept for the way back.
    fn keeping(kept: usize, consumer: Consumer<Element>, start: Position, ramp: ScaleRamp) -> Interpolator {
        let sample = Sample {
            state: SampleState::Starved,
            ..Sample::resting(start)
        };
        Interpolator {
            track: Track::new(consumer, kept),
            follower: Follower::new(ramp.cycle_s()),
            prober: Prober::new(ramp.cycle_s()),
            ramp,
            time_s: 0.0,
            done_s: 0.0,
            done_way: 0.0,
            backward: false,
            single_block: false,
            arrived: None,
            leaves: false,
            told: sample.auxiliary,
            messages: None,
            sample,
        }
    }

    /// The same with a probe: `answers` get the result of every probing move, and what [`Interpolator::answer`] is given; stops at a contact may be harder than planned
    /// motion by `shares`. Without it, probing moves go their whole way.
    pub fn with_probe(self, answers: rtrb::Producer<Answer>, shares: StopShares) -> Interpolator {
        Interpolator {
            prober: self.prober.answering(answers, shares),
            ..self
        }
    }

    /// The same that shows how many messages of the program it has come to.
    pub fn counting_messages(self, messages: Arc<AtomicU32>) -> Interpolator {
        Interpolator {
            messages: Some(messages),
            ..self
        }
    }

    /// Tells who reads the program what it waits for. RT.
    pub fn answer(&mut self, answer: Answer) {
        self.prober.answer(answer);
    }

    /// Whether a probing move is under way, which wants [`Interpolator::see_probe`] before every step. RT.
    pub fn is_probing(&self) -> bool {
        matches!(self.track.current(), Some(Element::Probing(_)))
    }

    /// Whether that one ends as the probe closes, not as it opens. RT.
    pub fn is_probing_towards(&self) -> bool {
        matches!(self.track.current(), Some(Element::Probing(probing)) if probing.mode.towards)
    }

    /// Whether a dwell is under way. RT.
    pub fn is_dwelling(&self) -> bool {
        matches!(self.track.current(), Some(Element::Dwell { .. }))
    }

    /// Ends a dwell that is under way. RT.
    pub fn skip_dwell(&mut self) {
        if let Some(Element::Dwell { seconds, .. }) = self.track.current() {
            self.time_s = *seconds;
        }
    }

    /// What was read in this cycle: whether the probe is in contact, and where the axes were then. RT.
    pub fn see_probe(&mut self, contact: bool, measured: &Position) {
        self.prober.observe(contact, measured);
    }

    /// Where the drives have latched that the probe closed, and that it opened, since the move began; `None`: they have not. RT.
    pub fn see_latches(&mut self, latched: [Option<Position>; 2]) {
        self.prober.observe_latches(latched);
    }

    /// One cycle further, without an encoder on the spindle. RT.
    pub fn step(&mut self, scale: f64) -> Sample {
        self.step_with(scale, &SpindleFeedback::NONE)
    }

    /// One cycle further. `scale`: wanted share of the planned speed, from 1 over 0 (hold) to -1 (backward); of no effect on a
    /// move in step with the spindle that has begun. RT.
    pub fn step_with(&mut self, scale: f64, spindle: &SpindleFeedback) -> Sample {
        self.step_shares(&Shares::all(scale), spindle)
    }

    /// The same with shares that depend on what the machine is at; backward with [`Shares::all`] below 0. RT.
    pub fn step_shares(&mut self, wanted: &Shares, spindle: &SpindleFeedback) -> Sample {
        self.follower.observe(spindle);
        let scale = wanted.on(self.track.current(), self.sample.enables);
        let share = self.set_direction(scale);
        let end = self.end();
        if self.at_planned_rest() {
            self.change_at_once(share, end);
        }
        let plan_s = self.plan_time(share, end);
        if self.arrived.is_none() {
            if self.backward {
                self.run_backward(plan_s, end, scale, spindle);
            } else {
                self.run_forward(plan_s, end, wanted, spindle);
            }
        }
        self.evaluate();
        self.sample.on_the_way = None;
        self.sample.outputs = None;
        let holds = wanted.hold(self.sample.enables);
        let outputs = self.sample.auxiliary.outputs;
        // All in the cycle in which the move begins, which may be on the ramp of a hold.
        if self.told.outputs != outputs && (!holds || self.time_s > 0.0) {
            self.told.outputs = outputs;
            self.sample.outputs = Some(outputs);
        }
        if !holds && let Some(action) = self.told.first_towards(&self.sample.auxiliary) {
            self.tell(action);
            self.sample.on_the_way = Some(action);
        }
        self.sample
    }

    /// An action is done, or is to be done in this cycle. RT.
    fn tell(&mut self, action: Action) {
        self.told = self.told.after(action).unwrap_or(self.told);
        if let (Action::Message { .. }, Some(messages)) = (action, &self.messages) {
            messages.store(self.told.messages, Ordering::Release);
        }
    }

    /// Where the axes are, machine position. RT.
    pub fn position(&self) -> Position {
        self.sample.position
    }

    /// The action of the last sample is done. RT.
    pub fn acknowledge_action(&mut self) {
        if let Some(&Element::Action { action, .. }) = self.track.current() {
            self.track.leave();
            self.tell(action);
            self.sample.auxiliary = self.told;
            self.sample.action = None;
            self.sample.state = if matches!(action, Action::ProgramEnd | Action::TextEnd) {
                SampleState::Finished
            } else {
                SampleState::Starved
            };
        }
    }

    /// Whether more has been planned behind what is under way. RT.
    pub fn has_more(&self) -> bool {
        self.track.following().next().is_some()
    }

    /// Single block: comes to rest at the end of each block, where the line of the plan changes; where that comes sooner than
    /// the machine can stop, at the end of the following one. On the way back the same at the beginning of each block that
    /// moves. RT.
    pub fn set_single_block(&mut self, on: bool) {
        self.single_block = on;
        if !on && self.is_block_over() {
            self.arrived = None;
        }
    }

    /// Whether it waits at the end of a block; on the way back, at its beginning. RT.
    pub fn is_block_over(&self) -> bool {
        self.arrived == Some(Arrived::Block)
    }

    /// Lets the block behind the one that is over begin; on the way back, the one before it. RT.
    pub fn next_block(&mut self) {
        if self.is_block_over() {
            self.arrived = None;
            self.leaves = true;
        }
    }

    /// Whether it waits at the end of the way back. RT.
    pub fn is_way_back_over(&self) -> bool {
        self.arrived == Some(Arrived::WayBack)
    }

    /// The element under way. RT.
    pub fn element(&self) -> Option<&Element> {
        self.track.current()
    }

    /// For how many cycles the element under way goes on by its law, alone and at its planned speed. RT.
    pub fn even_cycles(&self) -> u64 {
        let as_planned = self.ramp.share() == 1.0 && !self.ramp.is_changing();
        let left_s = match self.track.current() {
            Some(element @ (Element::Span(_) | Element::Dwell { .. }))
                if as_planned && !self.backward && !self.single_block && self.arrived.is_none() =>
            {
                element.duration_s() - self.time_s
            }
            Some(Element::Probing(_)) => self.prober.even_s(),
            None | Some(Element::Span(_) | Element::Dwell { .. } | Element::Synced(_) | Element::Action { .. }) => 0.0,
        };
        ((left_s / self.ramp.cycle_s()) as u64).saturating_sub(1)
    }

    /// Goes on by so many cycles at once, no more than [`Interpolator::even_cycles`]: for whoever need not see them. RT.
    pub fn skip(&mut self, cycles: u64) {
        let cycles = cycles.min(self.even_cycles()) as f64;
        match self.track.current() {
            Some(Element::Probing(_)) => self.prober.skip(cycles),
            Some(Element::Span(_) | Element::Dwell { .. }) => self.time_s += cycles * self.ramp.cycle_s(),
            None | Some(Element::Synced(_) | Element::Action { .. }) => {}
        }
    }

    /// Ends a move in step with the spindle that is under way, as [`Follower::give_up`] says. Any other is held by its share. RT.
    pub fn give_up_sync(&mut self) {
        self.follower.give_up();
    }

    /// How far a tap is behind its depth, for as long as the spindle takes to reverse there, mm; else 0. RT.
    pub fn over_run_mm(&self) -> f64 {
        match self.track.current() {
            Some(Element::Synced(_)) => self.follower.over_run_mm(),
            None | Some(Element::Span(_) | Element::Probing(_) | Element::Dwell { .. } | Element::Action { .. }) => 0.0,
        }
    }

    /// Line of a move in step with the spindle that came to its end, and how it went; told once. RT.
    pub fn take_sync_report(&mut self) -> Option<(u32, SyncReport)> {
        self.follower.take_report()
    }

    /// Planned motion still to come, as far as it has been planned yet, s. RT.
    pub fn remaining_s(&self) -> f64 {
        (self.track.published_s() - self.done_s - self.time_s).max(0.0)
    }

    /// Plan time that has passed, s: less again on the way back. RT.
    pub fn passed_s(&self) -> f64 {
        self.done_s + self.time_s
    }

    /// How far the program has come, as [`Element::way`] says: less again on the way back. RT.
    pub fn way(&self) -> f64 {
        match self.track.current() {
            Some(Element::Span(span)) => self.done_way + span.place(self.time_s) - span.s0,
            None | Some(Element::Synced(_) | Element::Probing(_) | Element::Dwell { .. } | Element::Action { .. }) => {
                self.done_way
            }
        }
    }

    /// Where the piece of path under way ends, in the direction of the program, machine position; `None`: nothing moves along one. RT.
    pub fn piece_end(&self) -> Option<Position> {
        let piece = match self.track.current()? {
            Element::Span(span) => &span.piece,
            Element::Synced(synced) => &synced.piece,
            Element::Probing(probing) => &probing.piece,
            Element::Dwell { .. } | Element::Action { .. } => return None,
        };
        Some(piece.position(piece.length()))
    }

    /// Whether nothing moves and nothing will before a step with a share other than 0. RT.
    pub fn is_at_rest(&self) -> bool {
        match self.track.current() {
            Some(Element::Synced(_)) => {
                self.follower.is_over() || (self.follower.is_waiting() && self.ramp.is_at_rest())
            }
            Some(Element::Probing(_)) => self.prober.is_at_rest() && self.ramp.is_at_rest(),
            None | Some(Element::Span(_) | Element::Dwell { .. } | Element::Action { .. }) => {
                self.ramp.is_at_rest() || self.at_planned_rest()
            }
        }
    }

    /// Whether the share of the planned speed is on its way to another one, or a probing move stops at its contact. RT.
    pub fn is_scaling(&self) -> bool {
        match self.track.current() {
            Some(Element::Probing(_)) => self.prober.is_stopping(),
            None | Some(Element::Span(_) | Element::Synced(_) | Element::Dwell { .. } | Element::Action { .. }) => {
                !self.at_planned_rest() && self.ramp.is_changing()
            }
        }
    }

    /// Time from full speed to rest in a hold, s.
    pub fn ramp_s(&self) -> f64 {
        self.ramp.ramp_s()
    }

    /// Whether the plan itself stands still, or moves, whatever the share of its speed: that may change at once.
    fn at_planned_rest(&self) -> bool {
        match self.track.current() {
            None | Some(Element::Action { .. } | Element::Dwell { .. } | Element::Synced(_) | Element::Probing(_)) => {
                true
            }
            Some(Element::Span(span)) => self.time_s == 0.0 && begins_at_rest(span),
        }
    }

    /// Takes the direction that is wanted, at rest; gives the share that is wanted in the direction of the moment.
    fn set_direction(&mut self, scale: f64) -> f64 {
        let backward = scale < 0.0 || (scale == 0.0 && self.backward);
        if backward != self.backward && (self.ramp.is_at_rest() || self.at_planned_rest()) {
            self.backward = backward;
            (self.arrived, self.leaves) = (None, false);
        }
        if self.arrived.is_some() || backward != self.backward {
            0.0
        } else {
            scale.abs()
        }
    }

    /// Nothing moves, so that the share may change at once, unless the way is too short to come down from it.
    fn change_at_once(&mut self, share: f64, end: Option<End>) {
        self.ramp.jump(share);
        if end.is_some_and(|end| !end.rests && !self.ramp.can_rest_in(end.way_s)) {
            self.ramp.jump(0.0);
        }
    }

    /// Plan time that passes in this cycle, s.
    fn plan_time(&mut self, share: f64, end: Option<End>) -> f64 {
        let Some(End { way_s, .. }) = end.filter(|end| !end.rests) else {
            return self.ramp.step(share);
        };
        let passed_s = self.ramp.step_within(share, way_s);
        if self.ramp.is_at_rest() && way_s - passed_s <= SAME_S {
            // Just to the end, whatever the sum of the durations on the way.
            f64::INFINITY
        } else {
            passed_s
        }
    }

    fn run_forward(&mut self, passed_s: f64, end: Option<End>, wanted: &Shares, spindle: &SpindleFeedback) {
        let (mut plan_s, mut end) = (passed_s, end);
        let scale = wanted.on(self.track.current(), self.sample.enables);
        for _ in 0..ELEMENTS_PER_CYCLE {
            match self.track.current() {
                None if self.sample.state == SampleState::Finished => break,
                None => {}
                Some(&Element::Action {
                    action: Action::Modes { number },
                    ..
                }) => self.sample.modes = number,
                Some(Element::Action { .. }) => break,
                Some(Element::Synced(_)) => {
                    self.step_synced(scale, spindle);
                    if !self.follower.is_over() || self.follower.fault().is_some() {
                        break;
                    }
                }
                Some(Element::Probing(probing)) => {
                    self.prober.step(probing, scale <= 0.0);
                    if !self.prober.take_result() {
                        break;
                    }
                }
                Some(element @ (Element::Span(_) | Element::Dwell { .. })) => {
                    let rest_s = element.duration_s() - self.time_s;
                    if plan_s < rest_s {
                        self.time_s += plan_s;
                        break;
                    }
                    plan_s -= rest_s.max(0.0);
                }
            }
            if let Some(end) = end
                && end.next == self.track.next()
            {
                self.arrive(end.rests);
                break;
            }
            // What a spindle or a probe leads is generated cycle by cycle: it begins with the cycle behind the one in which the
            // motion before it came to rest, else both would move in that one; and so does what follows it.
            let apart = self.is_led();
            if !self.advance() || apart || self.is_led() {
                break;
            }
            let share = wanted.on(self.track.current(), self.sample.enables);
            if self.at_planned_rest() && (share != self.ramp.share() || self.ramp.is_changing()) {
                // A move that begins at rest has its share at once, which may be none.
                end = self.end();
                self.change_at_once(share, end);
                let left = if passed_s > 0.0 {
                    (plan_s / passed_s).min(1.0)
                } else {
                    0.0
                };
                plan_s = self.ramp.share() * left * self.ramp.cycle_s();
            }
        }
    }

    /// Whether a spindle or a probe decides where the current element is when.
    fn is_led(&self) -> bool {
        matches!(self.track.current(), Some(Element::Synced(_) | Element::Probing(_)))
    }

    fn run_backward(&mut self, plan_s: f64, end: Option<End>, scale: f64, spindle: &SpindleFeedback) {
        let mut plan_s = plan_s;
        for _ in 0..ELEMENTS_PER_CYCLE {
            match self.track.current() {
                Some(Element::Synced(_)) if !(self.follower.is_over() || self.follower.is_waiting()) => {
                    self.step_synced(scale, spindle);
                    break;
                }
                Some(Element::Probing(probing)) if !self.prober.is_at_rest() => {
                    self.prober.step(probing, scale <= 0.0);
                    break;
                }
                Some(&Element::Span(span)) => {
                    if plan_s < self.time_s {
                        self.time_s -= plan_s;
                        break;
                    }
                    plan_s -= self.time_s;
                    self.time_s = 0.0;
                    // What stands before it may have no place of its own.
                    self.show(&span, 0.0, 0.0);
                    if end.is_some_and(|end| end.what == Arrived::Block && end.next + 1 == self.track.next()) {
                        self.arrived = Some(Arrived::Block);
                        self.ramp.jump(0.0);
                        break;
                    }
                }
                None
                | Some(Element::Dwell { .. } | Element::Action { .. } | Element::Synced(_) | Element::Probing(_)) => {}
            }
            if plan_s <= 0.0 {
                break;
            }
            if !self.retreat() {
                self.arrived = Some(Arrived::WayBack);
                self.ramp.jump(0.0);
                break;
            }
            self.leaves = false;
        }
    }

    /// A hold acts on a move in step with the spindle only while it waits for the index; and there is no way back on it.
    fn step_synced(&mut self, scale: f64, spindle: &SpindleFeedback) {
        if scale > 0.0 || !self.follower.is_waiting() {
            self.follower.step(spindle);
        }
    }

    /// Comes to rest at the end of a block.
    fn arrive(&mut self, rests: bool) {
        self.arrived = Some(Arrived::Block);
        self.ramp.jump(0.0);
        if rests {
            self.pass();
        } else if let Some(element) = self.track.current() {
            self.time_s = element.duration_s();
        }
    }

    /// Goes on to the next element; where there is none, the end of the last one is the rest. RT.
    fn advance(&mut self) -> bool {
        self.pass();
        let next = self.track.forward();
        let goes_on = next.is_some();
        match next {
            Some(Element::Synced(synced)) => self.follower.begin(synced),
            Some(Element::Probing(probing)) => self.prober.begin(probing),
            None | Some(Element::Span(_) | Element::Dwell { .. } | Element::Action { .. }) => {}
        }
        self.leaves &= !goes_on;
        goes_on
    }

    /// The current element is over; its end is shown until another one begins.
    fn pass(&mut self) {
        if let Some(&element) = self.track.current() {
            self.done_s += element.duration_s();
            self.done_way += element.way();
            match element {
                Element::Span(span) => self.show(&span, span.duration_s, 0.0),
                Element::Synced(synced) => self.show_synced(&synced),
                Element::Probing(probing) => self.show_probing(&probing),
                Element::Dwell { .. } | Element::Action { .. } => {}
            }
            self.track.leave();
        }
        self.time_s = 0.0;
    }

    /// Goes back to the end of the element before. RT.
    fn retreat(&mut self) -> bool {
        let Some(element) = self.track.back() else { return false };
        self.done_s -= element.duration_s();
        self.done_way -= element.way();
        self.time_s = match element {
            Element::Span(span) => span.duration_s,
            // Run forward again, it waits again.
            Element::Dwell { .. } | Element::Action { .. } | Element::Synced(_) | Element::Probing(_) => 0.0,
        };
        true
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_way;
