//! The interpolation on plans made by hand.

use super::*;
use crate::element::{Auxiliary, Enables, Span};
use crate::path::Piece;
use crate::ring::{self, Producer, Publish, Sink};
use crate::rt::{MotionLimits, StopLimits};

pub(super) const CYCLE_S: f64 = 1e-3;

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
pub(super) fn there(from_mm: f64, line: u32) -> [Element; 4] {
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
            auxiliary: Auxiliary::INITIAL,
            modes: 0,
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
