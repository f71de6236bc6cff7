//! Interpolation: where the axes are now.
//!
//! In:  elements of the ring; the wanted shares of the planned speed; where the spindle is; the contact of a probe.
//! Out: one [`Sample`] per cycle.
//!
//! Position always comes from the exact geometry at the place that plan time has reached, so that rounding of time can
//! never leave the path. RT.

use super::probe::{Probed, Prober, StopShares};
use super::scale::ScaleRamp;
use super::shares::Shares;
use super::synced::{Follower, SpindleFeedback, SyncFault, SyncReport};
use crate::canon::Position;
use crate::element::{Action, Element, Enables, Probing, Span, Synced};
use crate::kinematics::ToolFrame;
use crate::ring::{Consumer, Timed};

/// Elements that one cycle may pass. A cycle that reaches this many waits for the next one; it takes elements shorter
/// than a hundredth of a cycle to get there.
const ELEMENTS_PER_CYCLE: usize = 128;

/// What the interpolation is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleState {
    /// On the way, or held on it.
    Moving,
    /// Waits at rest for time to pass.
    Dwelling,
    /// Waits at rest for an action to be acknowledged.
    Acting,
    /// At rest, because nothing more has been planned yet.
    Starved,
    /// The program is over.
    Finished,
}

/// What there is to know of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Axis positions in the machine, mm or degrees.
    pub position: Position,
    /// How they are meant: kinematics need both.
    pub frame: ToolFrame,
    /// Speed on the path, mm/s (degrees/s on a purely rotary move).
    pub velocity_mm_s: f64,
    /// Line of the program.
    pub line: u32,
    /// Whether the move is a rapid one.
    pub rapid: bool,
    /// What acts on it from outside; on what is done at rest, as on the move before.
    pub enables: Enables,
    /// What the interpolation is doing.
    pub state: SampleState,
    /// What waits to be acknowledged.
    pub action: Option<Action>,
    /// A tap is on its way back: the spindle is to turn the other way, this much as fast as programmed.
    pub reversal: Option<f64>,
    /// Why a move in step with the spindle was given up; nothing moves from there on.
    pub fault: Option<SyncFault>,
}

impl Sample {
    /// At rest without a program.
    pub const fn resting(position: Position) -> Sample {
        Sample {
            position,
            frame: ToolFrame::OFF,
            velocity_mm_s: 0.0,
            line: 0,
            rapid: false,
            enables: Enables::INITIAL,
            state: SampleState::Finished,
            action: None,
            reversal: None,
            fault: None,
        }
    }
}

/// Runs down the plan.
#[derive(Debug)]
pub struct Interpolator {
    consumer: Consumer<Element>,
    ramp: ScaleRamp,
    current: Option<Element>,
    /// Plan time since the beginning of the current element, s.
    time_s: f64,
    /// Plan time of the elements that are over, s.
    done_s: f64,
    follower: Follower,
    prober: Prober,
    sample: Sample,
}

impl Interpolator {
    /// At rest at `start` (machine position), before the first element.
    pub fn new(consumer: Consumer<Element>, start: Position, ramp: ScaleRamp) -> Interpolator {
        let sample = Sample {
            state: SampleState::Starved,
            ..Sample::resting(start)
        };
        Interpolator {
            consumer,
            follower: Follower::new(ramp.cycle_s()),
            prober: Prober::new(ramp.cycle_s()),
            ramp,
            current: None,
            time_s: 0.0,
            done_s: 0.0,
            sample,
        }
    }

    /// The same with a probe: `answers` get the result of every probing move; stops at a contact may be harder than planned
    /// motion by `shares`. Without it, probing moves go their whole way.
    pub fn with_probe(self, answers: rtrb::Producer<Probed>, shares: StopShares) -> Interpolator {
        Interpolator {
            prober: self.prober.answering(answers, shares),
            ..self
        }
    }

    /// Whether a probing move is under way, which wants [`Interpolator::see_probe`] before every step. RT.
    pub fn is_probing(&self) -> bool {
        matches!(self.current, Some(Element::Probing(_)))
    }

    /// What was read in this cycle: whether the probe is in contact, and where the axes were then. RT.
    pub fn see_probe(&mut self, contact: bool, measured: &Position) {
        self.prober.see(contact, measured);
    }

    /// One cycle further, without an encoder on the spindle. RT.
    pub fn step(&mut self, scale: f64) -> Sample {
        self.step_with(scale, &SpindleFeedback::NONE)
    }

    /// One cycle further. `scale`: wanted share of the planned speed, 0 (hold) to 1; of no effect on a move in step with the
    /// spindle that has begun. RT.
    pub fn step_with(&mut self, scale: f64, spindle: &SpindleFeedback) -> Sample {
        self.step_shares(&Shares::all(scale), spindle)
    }

    /// The same with shares that depend on what the machine is at. RT.
    pub fn step_shares(&mut self, wanted: &Shares, spindle: &SpindleFeedback) -> Sample {
        self.follower.see(spindle);
        let scale = wanted.on(self.current.as_ref(), self.sample.enables);
        if self.at_planned_rest() {
            // Nothing moves, so that the share may change at once.
            self.ramp.jump(scale);
        }
        let passed_s = self.ramp.step(scale);
        let mut plan_s = passed_s;
        for _ in 0..ELEMENTS_PER_CYCLE {
            match self.current {
                None => {
                    if self.sample.state == SampleState::Finished || !self.advance() {
                        break;
                    }
                    plan_s = self.share_from_rest(wanted, plan_s, passed_s);
                }
                Some(Element::Action { .. }) => break,
                Some(Element::Synced(_)) => {
                    if scale > 0.0 || !self.follower.is_waiting() {
                        self.follower.step(spindle);
                    }
                    if self.follower.is_over() && self.follower.fault().is_none() {
                        self.advance();
                    }
                    break;
                }
                Some(Element::Probing(probing)) => {
                    self.prober.step(&probing, scale == 0.0);
                    if self.prober.take_result() {
                        self.advance();
                    }
                    break;
                }
                Some(element @ (Element::Span(_) | Element::Dwell { .. })) => {
                    let rest_s = element.duration_s() - self.time_s;
                    if plan_s < rest_s {
                        self.time_s += plan_s;
                        break;
                    }
                    plan_s -= rest_s.max(0.0);
                    if !self.advance() {
                        break;
                    }
                    plan_s = self.share_from_rest(wanted, plan_s, passed_s);
                }
            }
        }
        self.evaluate();
        self.sample
    }

    /// Where the axes are, machine position. RT.
    pub fn position(&self) -> Position {
        self.sample.position
    }

    /// The action of the last sample is done. RT.
    pub fn acknowledge_action(&mut self) {
        if let Some(Element::Action { action, .. }) = self.current {
            self.current = None;
            self.sample.action = None;
            self.sample.state = if action == Action::ProgramEnd {
                SampleState::Finished
            } else {
                SampleState::Starved
            };
        }
    }

    /// Ends a move in step with the spindle that is under way, as [`Follower::give_up`] says. Any other is held by its share. RT.
    pub fn give_up_sync(&mut self) {
        self.follower.give_up();
    }

    /// How the last move in step with the spindle went. RT.
    pub fn sync_report(&self) -> SyncReport {
        self.follower.report()
    }

    /// Planned motion still to come, as far as it has been planned yet, s. RT.
    pub fn remaining_s(&self) -> f64 {
        (self.consumer.published_s() - self.done_s - self.time_s).max(0.0)
    }

    /// Whether nothing moves and nothing will before a step with a share above 0. RT.
    pub fn is_at_rest(&self) -> bool {
        match self.current {
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
        match self.current {
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
        match self.current {
            None | Some(Element::Action { .. } | Element::Dwell { .. } | Element::Synced(_) | Element::Probing(_)) => {
                true
            }
            Some(Element::Span(span)) => self.time_s == 0.0 && span.v0 == 0.0 && span.a0 == 0.0,
        }
    }

    /// A move that begins at rest has its share at once, which may be none: gives what of it passes in this cycle, of which
    /// `plan_s` out of `passed_s` was left with the share before.
    fn share_from_rest(&mut self, wanted: &Shares, plan_s: f64, passed_s: f64) -> f64 {
        let share = wanted.on(self.current.as_ref(), self.sample.enables);
        if !self.at_planned_rest() || (share == self.ramp.share() && !self.ramp.is_changing()) {
            return plan_s;
        }
        self.ramp.jump(share);
        let left = if passed_s > 0.0 { plan_s / passed_s } else { 0.0 };
        share * left * self.ramp.cycle_s()
    }

    /// Goes on to the next element; where there is none, the end of the last one is the rest. RT.
    fn advance(&mut self) -> bool {
        if let Some(element) = self.current.take() {
            self.done_s += element.duration_s();
            match element {
                Element::Span(span) => self.show(&span, span.duration_s, 0.0),
                Element::Synced(synced) => self.show_synced(&synced),
                Element::Probing(probing) => self.show_probing(&probing),
                Element::Dwell { .. } | Element::Action { .. } => {}
            }
        }
        self.time_s = 0.0;
        self.current = self.consumer.advance();
        match &self.current {
            Some(Element::Synced(synced)) => self.follower.begin(synced),
            Some(Element::Probing(probing)) => self.prober.begin(probing),
            None | Some(Element::Span(_) | Element::Dwell { .. } | Element::Action { .. }) => {}
        }
        self.current.is_some()
    }

    fn evaluate(&mut self) {
        self.sample.action = None;
        self.sample.reversal = None;
        self.sample.fault = None;
        self.sample.velocity_mm_s = 0.0;
        match self.current {
            Some(Element::Span(span)) => {
                let speed = span.speed(self.time_s).max(0.0) * self.ramp.share();
                self.show(&span, self.time_s, speed);
                self.sample.state = SampleState::Moving;
            }
            Some(Element::Synced(synced)) => {
                self.show_synced(&synced);
                self.sample.reversal = self.follower.reversal();
                self.sample.fault = self.follower.fault().filter(|_| self.follower.is_over());
                self.sample.state = SampleState::Moving;
            }
            Some(Element::Probing(probing)) => {
                self.show_probing(&probing);
                self.sample.velocity_mm_s = self.prober.speed();
                self.sample.state = SampleState::Moving;
            }
            Some(Element::Dwell { line, .. }) => {
                self.sample.line = line;
                self.sample.state = SampleState::Dwelling;
            }
            Some(Element::Action { action, line }) => {
                self.sample.line = line;
                self.sample.action = Some(action);
                self.sample.state = SampleState::Acting;
            }
            None => {
                if self.sample.state != SampleState::Finished {
                    self.sample.state = SampleState::Starved;
                }
            }
        }
    }

    fn show(&mut self, span: &Span, time_s: f64, speed: f64) {
        let place = span.place(time_s).clamp(0.0, span.piece.length());
        self.sample.position = span.piece.position(place);
        self.sample.frame = *span.piece.frame();
        self.sample.velocity_mm_s = speed;
        self.sample.line = span.line;
        self.sample.rapid = span.rapid;
        self.sample.enables = span.enables;
    }

    fn show_probing(&mut self, probing: &Probing) {
        self.sample.position = self.prober.position();
        self.sample.frame = *probing.piece.frame();
        self.sample.line = probing.line;
        self.sample.rapid = false;
    }

    fn show_synced(&mut self, synced: &Synced) {
        let place = self.follower.place().clamp(0.0, synced.piece.length());
        self.sample.position = synced.piece.position(place);
        self.sample.frame = *synced.piece.frame();
        self.sample.velocity_mm_s = self.follower.velocity().abs();
        self.sample.line = synced.line;
        self.sample.rapid = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::Piece;
    use crate::ring::{self, Producer, Publish, Sink};
    use crate::rt::{MotionLimits, StopLimits};

    const CYCLE_S: f64 = 1e-3;

    fn rig() -> (Producer<Element>, Interpolator) {
        let (producer, consumer) = ring::channel(64);
        let plan = MotionLimits {
            velocity: 100.0,
            acceleration: 1000.0,
            jerk: 20_000.0,
        };
        let stop = StopLimits {
            acceleration: 2000.0,
            jerk: 80_000.0,
        };
        (
            producer,
            Interpolator::new(consumer, Position::ZERO, ScaleRamp::new(&[(plan, stop)], CYCLE_S)),
        )
    }

    /// Rest to rest over 1 mm along X in 0.2 s: jerk +J, -J, -J, +J of 50 ms each, J = 1/(2 t³) with t = 50 ms.
    fn there(from_mm: f64, line: u32) -> [Element; 4] {
        let (t, jerk) = (0.05, 4000.0);
        let piece = Piece::line(Position::xyz(from_mm, 0.0, 0.0), Position::xyz(from_mm + 1.0, 0.0, 0.0)).unwrap();
        let (mut s0, mut v0, mut a0) = (0.0, 0.0, 0.0);
        [jerk, -jerk, -jerk, jerk].map(|jerk| {
            let span = Span {
                piece,
                s0,
                v0,
                a0,
                jerk,
                gradient: 0.0,
                duration_s: t,
                line,
                rapid: false,
                enables: Enables::default(),
            };
            (s0, v0, a0) = (span.place(t), span.speed(t), a0 + jerk * t);
            Element::Span(span)
        })
    }

    #[test]
    fn the_plan_is_followed_in_its_time_and_ends_at_its_end() {
        let (mut producer, mut interpolator) = rig();
        assert_eq!(producer.publish(&there(0.0, 7), &[]), Publish::Done);
        assert_eq!(interpolator.remaining_s(), 0.2);
        let samples: Vec<Sample> = (0..=200).map(|_| interpolator.step(1.0)).collect();
        // Half of the way at half of the time, by symmetry.
        assert!((samples[99].position.0[0] - 0.5).abs() < 1e-12);
        assert!((samples[99].velocity_mm_s - 10.0).abs() < 1e-9);
        assert_eq!((samples[99].line, samples[99].state), (7, SampleState::Moving));
        assert!((samples[200].position.0[0] - 1.0).abs() < 1e-12);
        assert_eq!(samples[200].state, SampleState::Starved);
        assert!(interpolator.remaining_s() < 1e-9);
    }

    #[test]
    fn a_hold_rests_on_the_path_and_a_resume_reaches_the_same_end() {
        let (mut producer, mut interpolator) = rig();
        producer.publish(&there(0.0, 1), &[]);
        for _ in 0..60 {
            interpolator.step(1.0);
        }
        let cycles = (interpolator.ramp_s() / CYCLE_S) as usize + 40;
        for _ in 0..cycles {
            interpolator.step(0.0);
        }
        assert!(interpolator.is_at_rest());
        let held = interpolator.step(0.0);
        assert!(held.position.0[0] > 0.0 && held.position.0[0] < 1.0 && held.velocity_mm_s == 0.0);
        assert_eq!(interpolator.step(0.0), held);
        let last = (0..2000).map(|_| interpolator.step(1.0)).last().unwrap();
        assert!((last.position.0[0] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_action_waits_at_rest_until_it_is_acknowledged() {
        let (mut producer, mut interpolator) = rig();
        let action = Action::ChangeTool { tool: 3 };
        let mut plan = there(0.0, 1).to_vec();
        plan.push(Element::Action { action, line: 2 });
        plan.extend(there(1.0, 3));
        plan.push(Element::Action {
            action: Action::ProgramEnd,
            line: 4,
        });
        producer.publish(&plan, &[]);
        let mut sample = Sample::resting(Position::ZERO);
        for _ in 0..500 {
            sample = interpolator.step(1.0);
        }
        assert_eq!(
            (sample.action, sample.state, sample.line),
            (Some(action), SampleState::Acting, 2)
        );
        assert!((sample.position.0[0] - 1.0).abs() < 1e-12);
        interpolator.acknowledge_action();
        for _ in 0..300 {
            sample = interpolator.step(1.0);
        }
        assert_eq!(sample.action, Some(Action::ProgramEnd));
        interpolator.acknowledge_action();
        sample = interpolator.step(1.0);
        assert_eq!(sample.state, SampleState::Finished);
        assert!((sample.position.0[0] - 2.0).abs() < 1e-12);
    }

    /// Steps until nothing changes any more for a while; how many there were until then.
    fn run_down(interpolator: &mut Interpolator, wanted: &Shares) -> usize {
        let (mut cycles, mut before) = (0, interpolator.position());
        for cycle in 1..3000 {
            let sample = interpolator.step_shares(wanted, &SpindleFeedback::NONE);
            if sample.position != before {
                (cycles, before) = (cycle, sample.position);
            }
        }
        cycles
    }

    fn as_move(elements: [Element; 4], rapid: bool, enables: Enables) -> [Element; 4] {
        elements.map(|element| match element {
            Element::Span(span) => Element::Span(Span { rapid, enables, ..span }),
            other => other,
        })
    }

    #[test]
    fn each_kind_of_move_has_its_own_share_and_a_feed_move_of_none_is_not_begun() {
        let (mut producer, mut interpolator) = rig();
        let off = Enables {
            feed_override: false,
            ..Enables::INITIAL
        };
        let mut plan = as_move(there(0.0, 1), true, Enables::INITIAL).to_vec();
        plan.extend(there(1.0, 2));
        plan.extend(as_move(there(2.0, 3), false, off));
        producer.publish(&plan, &[]);
        let shares = |feed, rapid| Shares {
            feed,
            rapid,
            ..Shares::FULL
        };
        // 0.2 s at half of the speed, then exactly at the end of the rapid move.
        assert_eq!(run_down(&mut interpolator, &shares(0.0, 0.5)), 400);
        assert_eq!(interpolator.position().0[0], 1.0);
        assert!(interpolator.is_at_rest() && interpolator.sample.line == 2);
        // A quarter on the feed move, all of the speed where overrides do not act; the last one ends where it should.
        assert_eq!(run_down(&mut interpolator, &shares(0.25, 0.0)), 1000);
        assert!((interpolator.position().0[0] - 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_machine_adapts_the_feed_and_the_switch_holds_where_the_program_lets_them() {
        let adaptive = Enables {
            adaptive_feed: true,
            ..Enables::INITIAL
        };
        let deaf = Enables {
            feed_hold: false,
            ..Enables::INITIAL
        };
        let wanted = |switch, adaptive| Shares {
            switch,
            adaptive,
            ..Shares::FULL
        };
        let cases = [
            (Enables::INITIAL, wanted(1.0, 0.5), 200),
            (adaptive, wanted(1.0, 0.5), 400),
            (Enables::INITIAL, wanted(0.0, 1.0), 0),
            (adaptive, wanted(1.0, 0.0), 0),
            // Before the first move the switch acts, as when any program begins: that costs a cycle.
            (deaf, wanted(0.0, 0.5), 201),
        ];
        for (enables, wanted, cycles) in cases {
            let (mut producer, mut interpolator) = rig();
            producer.publish(&as_move(there(0.0, 1), false, enables), &[]);
            assert_eq!(run_down(&mut interpolator, &wanted), cycles, "{enables:?} {wanted:?}");
        }
    }

    #[test]
    fn a_dwell_takes_its_time() {
        let (mut producer, mut interpolator) = rig();
        producer.publish(
            &[Element::Dwell {
                seconds: 0.0505,
                line: 1,
            }],
            &[],
        );
        let dwelling = (0..100)
            .filter(|_| interpolator.step(1.0).state == SampleState::Dwelling)
            .count();
        assert_eq!(dwelling, 50);
    }
}
