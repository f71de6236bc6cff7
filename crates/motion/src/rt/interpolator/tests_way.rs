//! Backward, forward again, block by block: plans of the planner under random orders.

use super::tests::{CYCLE_S, there};
use super::*;
use crate::canon::{AXES, Call, Event, PathMode, Position, Source};
use crate::element::{Auxiliary, Enables, Span};
use crate::path::Piece;
use crate::plan::{AxisLimits, Planner, PlannerKind, Pumped, Settings};
use crate::ring::{self, Producer, Publish, Sink};
use crate::rt::{Monitor, MonitorLimits, MotionLimits, StopLimits};
use proptest::prelude::*;

const VELOCITY: f64 = 100.0;
const ACCELERATION: f64 = 1000.0;
const JERK: f64 = 20_000.0;
const STOP: StopLimits = StopLimits {
    acceleration: 2000.0,
    jerk: 80_000.0,
};

fn ramp() -> ScaleRamp {
    let plan = MotionLimits {
        velocity: VELOCITY,
        acceleration: ACCELERATION,
        jerk: JERK,
    };
    ScaleRamp::new(&[(plan, STOP)], CYCLE_S)
}

/// Takes a plan and passes it on.
struct Copying {
    producer: Producer<Element>,
    elements: Vec<Element>,
}

impl Sink<Element> for Copying {
    fn free(&self) -> usize {
        self.producer.free()
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        let done = self.producer.publish(committed, tail);
        if done == Publish::Done {
            self.elements.extend(committed);
        }
        done
    }
}

/// A whole plan in the ring.
fn planned(calls: &[Call], planner_kind: PlannerKind) -> (Vec<Element>, Consumer<Element>) {
    let limits = AxisLimits {
        velocity: VELOCITY,
        acceleration: ACCELERATION,
        jerk: JERK,
        travel: [-1e3, 1e3],
    };
    let mut axes = [None; AXES];
    axes[..3].fill(Some(limits));
    let settings = Settings {
        tolerance_mm: 0.05,
        look_ahead_blocks: 200,
        planner_kind,
        ..Settings::new(axes, CYCLE_S)
    };
    let (producer, consumer) = ring::channel(1 << 15);
    let elements = Vec::new();
    let mut planner = Planner::new(settings, Copying { producer, elements });
    for (line, call) in (1..).zip(calls) {
        while planner.pump() == Pumped::Blocked {}
        let source = Source {
            line,
            ..Source::default()
        };
        let call = call.clone();
        planner.push(&Event { source, call }).expect("a good program");
    }
    planner.finish();
    while !planner.is_done() {
        planner.pump();
    }
    let elements = std::mem::take(&mut planner.sink().elements);
    (elements, consumer)
}

fn line(x: f64, y: f64) -> Call {
    Call::StraightFeed {
        to: Position::xyz(x, y, 0.0),
    }
}

fn feed(per_second: f64) -> Call {
    Call::SetFeedRate {
        linear: per_second,
        angular: per_second,
    }
}

/// Corners are rounded, so that the plan does not rest between lines.
const ROUND: Call = Call::SetPathMode(PathMode::Continuous {
    tolerance_mm: Some(0.05),
    naive_cam_tolerance_mm: None,
});

/// An interpolation, what its plan is, and what watches it.
struct Rig {
    interpolator: Interpolator,
    elements: Vec<Element>,
    monitor: Monitor,
    positions: Vec<Position>,
}

impl Rig {
    fn new(calls: &[Call], planner_kind: PlannerKind, kept: usize) -> Rig {
        let (elements, consumer) = planned(calls, planner_kind);
        let limits = MonitorLimits {
            of_order: [VELOCITY, ACCELERATION, JERK],
            scaling: [VELOCITY, STOP.acceleration, STOP.jerk],
            travel: [f64::NEG_INFINITY, f64::INFINITY],
        };
        Rig {
            interpolator: Interpolator::keeping(kept, consumer, Position::ZERO, ramp()),
            elements,
            monitor: Monitor::new(&[limits; 3], CYCLE_S),
            positions: vec![Position::ZERO; 4],
        }
    }

    /// Plan time that has been run, s.
    fn at_s(&self) -> f64 {
        self.interpolator.done_s + self.interpolator.time_s
    }

    /// Where the plan is at a time, by its elements alone.
    fn place(&self, at_s: f64) -> Position {
        let mut left_s = at_s;
        let mut end = Position::ZERO;
        for element in &self.elements {
            if let Element::Span(span) = element {
                let at = |time_s: f64| span.piece.position(span.place(time_s).clamp(0.0, span.piece.length()));
                if left_s < span.duration_s {
                    return at(left_s.max(0.0));
                }
                end = at(span.duration_s);
            }
            left_s -= element.duration_s();
        }
        end
    }

    /// One cycle, with all that must hold in it.
    fn step(&mut self, scale: f64) -> Sample {
        let before_s = self.at_s();
        let sample = self.interpolator.step(scale);
        let at_s = self.at_s();
        let dwelling = sample.state == SampleState::Dwelling;
        assert!(
            (at_s - before_s).abs() <= CYCLE_S * (1.0 + 1e-9) || dwelling || self.rested(),
            "{before_s} s -> {at_s} s"
        );
        let off_mm = distance(&sample.position, &self.place(at_s));
        assert!(off_mm < 1e-9, "{off_mm} mm off the path at {at_s} s");
        let all_s: f64 = self.elements.iter().map(Timed::duration_s).sum();
        assert!((self.interpolator.remaining_s() - (all_s - at_s)).abs() < 1e-9);
        let trip = self
            .monitor
            .check(&sample.position.0[..3], self.interpolator.is_scaling());
        assert_eq!(trip, None, "at {at_s} s of {all_s} s");
        self.positions.push(sample.position);
        if sample.action.is_some() && scale > 0.0 {
            self.interpolator.acknowledge_action();
        }
        sample
    }

    /// A dwell is passed at once on the way back.
    fn rested(&self) -> bool {
        self.elements
            .iter()
            .any(|element| matches!(element, Element::Dwell { .. }))
    }

    fn run_until(&mut self, scale: f64, done: impl Fn(&Interpolator, &Sample) -> bool) -> Sample {
        for _ in 0..200_000 {
            let sample = self.step(scale);
            if done(&self.interpolator, &sample) {
                return sample;
            }
        }
        panic!("never");
    }

    /// To the end of the plan, single block or not.
    fn finish(&mut self) -> Position {
        self.interpolator.set_single_block(false);
        self.run_until(1.0, |_, sample| sample.state == SampleState::Finished)
            .position
    }

    /// Nothing was ever over a limit, and the machine really stands at the end.
    fn proven(&mut self) {
        let last = *self.positions.last().expect("positions");
        for _ in 0..4 {
            assert_eq!(self.monitor.check(&last.0[..3], false), None);
        }
        for (_, peaks) in self.monitor.peaks() {
            assert_eq!(peaks.over, [0; 3], "{peaks:?}");
        }
    }
}

fn near(at: &Position, [x, y]: [f64; 2]) -> bool {
    distance(at, &Position::xyz(x, y, 0.0)) < 1e-12
}

fn distance(a: &Position, b: &Position) -> f64 {
    let square = |axis: usize| (a.0[axis] - b.0[axis]).powi(2);
    (0..AXES).map(square).sum::<f64>().sqrt()
}

/// A square with rounded corners, lines 3 to 6.
fn square() -> Vec<Call> {
    vec![
        feed(50.0),
        ROUND,
        line(20.0, 0.0),
        line(20.0, 20.0),
        line(0.0, 20.0),
        line(0.0, 0.0),
        Call::ProgramEnd,
    ]
}

#[test]
fn backward_to_the_beginning_and_forward_to_the_same_end() {
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let mut rig = Rig::new(&square(), planner_kind, KEPT_ELEMENTS);
        let end = Rig::new(&square(), planner_kind, KEPT_ELEMENTS).finish();
        for _ in 0..900 {
            rig.step(1.0);
        }
        let turned = rig.run_until(-1.0, |_, sample| sample.velocity_mm_s == 0.0);
        assert!(turned.position.0[0] > 10.0, "well on its way: {:?}", turned.position);
        // Half speed all the way: twice the time of the plan, but for the ramp, which speeds up over twice its share.
        let way_s = rig.at_s();
        let cycles = rig.positions.len();
        let back = rig.run_until(-0.5, |interpolator, _| interpolator.is_way_back_over());
        let took_s = (rig.positions.len() - cycles) as f64 * CYCLE_S;
        assert!(
            took_s > 2.0 * way_s && took_s < 2.0 * way_s + rig.interpolator.ramp_s(),
            "{took_s} for {way_s}"
        );
        assert!(
            back.position == Position::ZERO && rig.interpolator.is_at_rest(),
            "{:?}",
            back.position
        );
        assert_eq!((back.line, back.velocity_mm_s), (3, 0.0));
        assert!(rig.at_s().abs() < 1e-12);
        // There it stays.
        assert_eq!(rig.step(-1.0), back);
        assert_eq!(rig.finish(), end);
        rig.proven();
    }
}

#[test]
fn there_is_no_way_back_over_an_action_and_a_dwell_takes_no_time_on_it() {
    let mut calls = square();
    // The corners themselves, so that it is known where moves begin.
    calls[1] = Call::SetPathMode(PathMode::ExactPath);
    calls.insert(4, Call::Message("now".into()));
    calls.insert(6, Call::Dwell { seconds: 0.2 });
    let mut rig = Rig::new(&calls, PlannerKind::Optimal, KEPT_ELEMENTS);
    rig.run_until(1.0, |_, sample| sample.line == 8);
    for _ in 0..300 {
        rig.step(1.0);
    }
    let back = rig.run_until(-1.0, |interpolator, _| interpolator.is_way_back_over());
    assert!(near(&back.position, [20.0, 20.0]) && back.line == 6, "{back:?}");
    // Forward again it waits again.
    rig.run_until(1.0, |_, sample| sample.state == SampleState::Dwelling);
    let before = rig.positions.len();
    rig.run_until(1.0, |_, sample| sample.state != SampleState::Dwelling);
    let cycles = rig.positions.len() - before;
    assert!((199..=201).contains(&cycles), "{cycles}");
    assert!(near(&rig.finish(), [0.0, 0.0]));
    rig.proven();
}

#[test]
fn where_no_more_is_kept_the_way_back_ends_at_rest() {
    for (kept, planner_kind) in [
        (1, PlannerKind::Optimal),
        (2, PlannerKind::Classic),
        (7, PlannerKind::Classic),
        (30, PlannerKind::Optimal),
    ] {
        let mut rig = Rig::new(&square(), planner_kind, kept);
        for _ in 0..1100 {
            rig.step(1.0);
        }
        rig.run_until(0.0, |interpolator, _| interpolator.is_at_rest());
        let floor_s: f64 = {
            let taken = rig.interpolator.track.next() as usize;
            let oldest = taken.saturating_sub(kept);
            rig.elements[..oldest].iter().map(Timed::duration_s).sum()
        };
        assert!(floor_s > 0.0 && floor_s < rig.at_s());
        for _ in 0..2 {
            let back = rig.run_until(-1.0, |interpolator, _| interpolator.is_way_back_over());
            assert!(
                (rig.at_s() - floor_s).abs() < 1e-12,
                "{} s, not {floor_s} s",
                rig.at_s()
            );
            assert_eq!(rig.step(-1.0), back);
            // A little forward, without anything new that had to be kept.
            for _ in 0..20 {
                rig.step(0.3);
            }
        }
        assert!(near(&rig.finish(), [0.0, 0.0]));
        rig.proven();
    }
}

/// Lines at whose ends it came to rest, with the place of each.
fn blocks(rig: &mut Rig) -> Vec<(u32, Position)> {
    let mut blocks = Vec::new();
    rig.interpolator.set_single_block(true);
    loop {
        let sample = rig.run_until(1.0, |interpolator, sample| {
            interpolator.is_block_over() || sample.state == SampleState::Finished
        });
        if sample.state == SampleState::Finished {
            return blocks;
        }
        assert!(rig.interpolator.is_at_rest() && sample.velocity_mm_s == 0.0);
        blocks.push((sample.line, sample.position));
        // There it stays.
        assert_eq!(rig.step(1.0).position, sample.position);
        rig.interpolator.next_block();
    }
}

#[test]
fn in_single_block_every_block_ends_at_rest() {
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let mut rig = Rig::new(&square(), planner_kind, KEPT_ELEMENTS);
        let found = blocks(&mut rig);
        let lines: Vec<u32> = found.iter().map(|(line, _)| *line).collect();
        assert_eq!(lines, [3, 4, 5, 6], "{planner_kind:?}");
        // Where the line changes in the rounding of a corner: within its tolerance and a little to either side of it.
        let corners = [(20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0)];
        for ((line, at), (x, y)) in found.iter().zip(corners) {
            assert!(distance(at, &Position::xyz(x, y, 0.0)) < 1.0, "{line}: {at:?}");
        }
        rig.proven();
    }
}

/// Backward block by block to where there is no way back: lines at whose beginnings it came to rest, with the place of each.
fn blocks_back(rig: &mut Rig) -> Vec<(u32, Position)> {
    let mut blocks = Vec::new();
    rig.interpolator.set_single_block(true);
    loop {
        let sample = rig.run_until(-1.0, |interpolator, _| {
            interpolator.is_block_over() || interpolator.is_way_back_over()
        });
        assert!(rig.interpolator.is_at_rest() && sample.velocity_mm_s == 0.0);
        blocks.push((sample.line, sample.position));
        // There it stays.
        assert_eq!(rig.step(-1.0).position, sample.position);
        if rig.interpolator.is_way_back_over() {
            return blocks;
        }
        rig.interpolator.next_block();
    }
}

#[test]
fn in_single_block_it_rests_at_the_beginning_of_every_block_on_the_way_back() {
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        for exact in [false, true] {
            let mut calls = square();
            if exact {
                calls[1] = Call::SetPathMode(PathMode::ExactStop);
                // It is no block of its own on the way back.
                calls.insert(4, Call::Dwell { seconds: 0.05 });
            }
            let last = if exact { 7 } else { 6 };
            let mut rig = Rig::new(&calls, planner_kind, KEPT_ELEMENTS);
            rig.run_until(1.0, |_, sample| sample.line == last);
            for _ in 0..150 {
                rig.step(1.0);
            }
            rig.run_until(0.0, |interpolator, _| interpolator.is_at_rest());
            let back = blocks_back(&mut rig);
            let lines: Vec<u32> = back.iter().map(|(line, _)| *line).collect();
            assert_eq!(
                lines,
                if exact { [7, 6, 4, 3] } else { [6, 5, 4, 3] },
                "{planner_kind:?}"
            );
            // Their beginnings; in the rounding of a corner, within its tolerance and a little to either side of it.
            let corners = [(0.0, 20.0), (20.0, 20.0), (20.0, 0.0), (0.0, 0.0)];
            for ((line, at), (x, y)) in back.iter().zip(corners) {
                let off_mm = distance(at, &Position::xyz(x, y, 0.0));
                assert!(off_mm < if exact { 1e-12 } else { 1.0 }, "{line}: {at:?}");
            }
            // Forward from there it is block by block as well, and a turn between two blocks leaves none out.
            let found = blocks(&mut Rig::new(&calls, planner_kind, KEPT_ELEMENTS));
            let first = rig.run_until(1.0, |interpolator, _| interpolator.is_block_over());
            assert_eq!((first.line, first.position), found[0]);
            let again = rig.run_until(-1.0, |interpolator, _| interpolator.is_way_back_over());
            assert_eq!(again.position, Position::ZERO);
            assert_eq!(blocks(&mut rig), found);
            rig.proven();
        }
    }
}

#[test]
fn where_the_plan_rests_a_block_costs_no_time_for_a_ramp() {
    let mut calls = square();
    calls[1] = Call::SetPathMode(PathMode::ExactStop);
    calls.insert(5, Call::Dwell { seconds: 0.1 });
    let mut rig = Rig::new(&calls, PlannerKind::Optimal, KEPT_ELEMENTS);
    let found = blocks(&mut rig);
    assert_eq!(found.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [3, 4, 5, 6, 7]);
    let corners = [[20.0, 0.0], [20.0, 20.0], [0.0, 20.0], [0.0, 20.0], [0.0, 0.0]];
    for ((line, at), corner) in found.iter().zip(corners) {
        assert!(near(at, corner), "{line}: {at:?}");
    }
    let all_s: f64 = rig.elements.iter().map(Timed::duration_s).sum();
    let took_s = (rig.positions.len() - 4) as f64 * CYCLE_S;
    // Two cycles or three a block: what is left of its last one, and those in which it was looked at and let go.
    assert!(
        took_s >= all_s && took_s < all_s + 6.0 * 4.0 * CYCLE_S,
        "{took_s} s for {all_s} s"
    );
    rig.proven();
}

#[test]
fn a_block_too_short_to_stop_in_is_passed_and_the_one_behind_it_is_not() {
    // To 50 mm/s over 2.5 mm, blocks of 1 mm and 20 ms each, to rest.
    let (mut producer, consumer) = ring::channel(64);
    let mut interpolator = Interpolator::new(consumer, Position::ZERO, ramp());
    let piece = Piece::line(Position::ZERO, Position::xyz(45.0, 0.0, 0.0)).unwrap();
    let (mut s0, mut v0, mut a0) = (0.0, 0.0, 0.0);
    let mut span = |jerk: f64, duration_s: f64, line: u32| {
        let span = Span {
            piece,
            s0,
            v0,
            a0,
            jerk,
            gradient: 0.0,
            duration_s,
            line,
            rapid: false,
            enables: Enables::INITIAL,
            auxiliary: Auxiliary::INITIAL,
            modes: 0,
        };
        (s0, v0, a0) = (span.place(duration_s), span.speed(duration_s), a0 + jerk * duration_s);
        Element::Span(span)
    };
    let mut plan = vec![span(JERK, 0.05, 1), span(-JERK, 0.05, 1)];
    plan.extend((2..42).map(|line| span(0.0, 0.02, line)));
    plan.extend([span(-JERK, 0.05, 42), span(JERK, 0.05, 42)]);
    producer.publish(&plan, &[]);
    for _ in 0..110 {
        interpolator.step(1.0);
    }
    interpolator.set_single_block(true);
    let run = |interpolator: &mut Interpolator| {
        for _ in 0..2000 {
            let sample = interpolator.step(1.0);
            if interpolator.is_block_over() {
                return (sample.line, sample.position.0[0]);
            }
        }
        panic!("never");
    };
    // 10 ms into the first of them; half of the ramp's time is needed.
    let passed = ((interpolator.ramp_s() / 2.0 + 0.01) / 0.02).ceil();
    assert!(passed > 2.0);
    let (line, x) = run(&mut interpolator);
    assert!((x - (2.5 + passed)).abs() < 1e-9, "{x} mm, {passed} blocks");
    assert_eq!(line, 1 + passed as u32);
    // From rest it is each of them.
    for k in 1..=3 {
        interpolator.next_block();
        let (line, x) = run(&mut interpolator);
        assert!((x - (2.5 + passed + f64::from(k))).abs() < 1e-9, "{x} mm");
        assert_eq!(line, 1 + passed as u32 + k);
    }
}

#[test]
fn blocks_without_motion_are_blocks() {
    let (mut producer, consumer) = ring::channel(64);
    let mut interpolator = Interpolator::new(consumer, Position::ZERO, ramp());
    let action = |line: u32| Element::Action {
        action: Action::Flood(true),
        line,
    };
    let mut plan = vec![action(1)];
    plan.extend(there(0.0, 2));
    // Of one line: an action, a move, an action.
    plan.push(action(3));
    plan.extend(there(1.0, 3));
    plan.extend([action(3), action(4), action(5)]);
    producer.publish(&plan, &[]);
    interpolator.set_single_block(true);
    let mut seen = Vec::new();
    for _ in 0..2000 {
        let sample = interpolator.step(1.0);
        if sample.action.is_some() {
            seen.push(('a', sample.line));
            interpolator.acknowledge_action();
        }
        if interpolator.is_block_over() {
            seen.push(('.', sample.line));
            interpolator.next_block();
        }
    }
    let a = |line| ('a', line);
    let over = |line| ('.', line);
    assert_eq!(seen, [a(1), over(1), over(2), a(3), a(3), over(3), a(4), over(4), a(5)]);
}

/// An order and for how many cycles it stands.
type Order = (u8, f64, usize);

fn run(rig: &mut Rig, script: &[Order]) {
    let mut scale: f64 = 1.0;
    for &(what, share, cycles) in script {
        match what {
            0 => scale = share,
            1 => scale = -share,
            2 => scale = 0.0,
            3 => rig.interpolator.set_single_block(true),
            4 => rig.interpolator.set_single_block(false),
            5 => scale = 1.0,
            6 => scale = -1.0,
            _ => rig.interpolator.next_block(),
        }
        for _ in 0..cycles {
            rig.step(scale);
        }
    }
}

fn program() -> impl Strategy<Value = Vec<Call>> {
    let scale = prop_oneof![Just(0.05), Just(1.0), Just(20.0)];
    let call = prop_oneof![
        12 => (-1.0..1.0_f64, -1.0..1.0_f64, scale).prop_map(|(x, y, scale)| line(x * scale, y * scale)),
        1 => (5.0..100.0_f64).prop_map(feed),
        1 => Just(ROUND),
        1 => Just(Call::SetPathMode(PathMode::ExactStop)),
        1 => Just(Call::Message("now".into())),
        1 => Just(Call::Dwell { seconds: 0.03 }),
    ];
    prop::collection::vec(call, 4..40).prop_map(|calls| {
        // Moves are relative.
        let mut at = Position::ZERO;
        let absolute = calls.into_iter().map(|call| match call {
            Call::StraightFeed { to } => {
                for (at, by) in at.0.iter_mut().zip(to.0) {
                    *at += by;
                }
                Call::StraightFeed { to: at }
            }
            other => other,
        });
        [feed(80.0), ROUND]
            .into_iter()
            .chain(absolute)
            .chain([Call::ProgramEnd])
            .collect()
    })
}

fn script() -> impl Strategy<Value = Vec<Order>> {
    prop::collection::vec((0_u8..9, 0.05..1.0_f64, 1_usize..400), 1..25)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Whatever is ordered whenever: on the path, within the limits, to the same end, the same each time.
    #[test]
    fn any_orders_lead_to_the_same_end(
        calls in program(),
        script in script(),
        classic in prop::bool::ANY,
        kept in prop_oneof![Just(KEPT_ELEMENTS), 1_usize..60],
    ) {
        let planner_kind = if classic { PlannerKind::Classic } else { PlannerKind::Optimal };
        let [mut rig, mut again] = [0, 1].map(|_| Rig::new(&calls, planner_kind, kept));
        run(&mut rig, &script);
        run(&mut again, &script);
        prop_assert!(rig.positions == again.positions);
        let end = rig.finish();
        prop_assert_eq!(end, Rig::new(&calls, planner_kind, kept).finish());
        rig.proven();
    }
}
