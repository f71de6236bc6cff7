//! Auxiliary functions between moves: told as their place is passed, in the order of the program, once, and without a rest.

use super::*;
use crate::canon::SpindleDirection;
use crate::element::{Action, Element};
use crate::ring::channel;
use crate::rt::{Interpolator, MotionLimits, SampleState, ScaleRamp, StopLimits};

/// What was done, where on X and at which speed, in order; and how many cycles it took.
struct Run {
    done: Vec<(Action, f64, f64)>,
    cycles: usize,
}

impl Run {
    fn actions(&self) -> Vec<Action> {
        self.done.iter().map(|(action, ..)| *action).collect()
    }
}

/// Runs a program; `share`: of the planned speed, by the number of the cycle.
fn run(calls: &[Call], planner_kind: PlannerKind, share: impl Fn(usize) -> f64) -> Run {
    let settings = Settings {
        planner_kind,
        ..settings()
    };
    let (producer, consumer) = channel(settings.largest_publication());
    let limits = MotionLimits {
        velocity: 100.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
    };
    let stop = StopLimits {
        acceleration: 2000.0,
        jerk: 80_000.0,
    };
    let mut planner = Planner::new(settings, producer);
    let ramp = ScaleRamp::new(&[(limits, stop)], settings.cycle_s);
    let mut interpolator = Interpolator::new(consumer, settings.start, ramp);
    let mut events = events(calls.iter().cloned()).into_iter();
    let mut finished = false;
    let mut done = Vec::new();
    for cycles in 0..100_000 {
        while planner.pump() == Pumped::Hungry {
            match events.next() {
                Some(event) => planner.push(&event).unwrap(),
                None if !finished => {
                    planner.finish();
                    finished = true;
                }
                None => break,
            }
        }
        let wanted = share(cycles);
        let sample = interpolator.step(wanted);
        let acts = sample.on_the_way.or(sample.action.filter(|_| wanted > 0.0));
        done.extend(acts.map(|action| (action, sample.position.0[0], sample.velocity_mm_s)));
        assert!(sample.on_the_way.is_none() || wanted > 0.0, "done in a hold");
        if sample.action.is_some() && wanted > 0.0 {
            interpolator.acknowledge_action();
        }
        if sample.state == SampleState::Finished && cycles > 0 {
            return Run { done, cycles };
        }
    }
    panic!("the program does not end");
}

fn spindle(rpm: f64) -> [Call; 2] {
    [
        Call::SetSpindleSpeed { spindle: 0, speed: rpm },
        Call::StartSpindle {
            spindle: 0,
            direction: SpindleDirection::Clockwise,
            wait_for_speed: true,
        },
    ]
}

fn on(rpm: f64) -> Action {
    Action::SpindleOn {
        rpm,
        direction: SpindleDirection::Clockwise,
        surface: None,
    }
}

/// 40 mm in line, a quarter turn, and on; with something to do at each of the places.
fn part(first: &[Call], second: &[Call], third: &[Call]) -> Vec<Call> {
    let quarter = Call::ArcFeed {
        to: Position::xyz(50.0, 10.0, 0.0),
        plane: Plane::Xy,
        centre_mm: [40.0, 10.0],
        turns: 1,
    };
    let groups: [&[Call]; 9] = [
        &[F, ROUND],
        &[feed(20.0, 0.0, 0.0)],
        first,
        &[feed(40.0, 0.0, 0.0)],
        second,
        &[quarter, feed(50.0, 30.0, 0.0)],
        third,
        &[feed(80.0, 30.0, 0.0)],
        &[Call::Flood(false), Call::StopSpindle { spindle: 0 }, Call::ProgramEnd],
    ];
    groups.concat()
}

const KINDS: [PlannerKind; 2] = [PlannerKind::Classic, PlannerKind::Optimal];

#[test]
fn the_machine_does_not_rest_for_coolant_spindle_tool_and_messages() {
    let spindle_on = spindle(3000.0);
    let first = [Call::Flood(true), Call::SelectTool { tool: 7 }];
    let second = [&spindle_on[..], &[Call::Message("half".into())]].concat();
    let third = [
        Call::Mist(true),
        Call::Message("corner".into()),
        Call::SetSpindleSpeed {
            spindle: 0,
            speed: 500.0,
        },
    ];
    for kind in KINDS {
        let plain = run(&part(&[], &[], &[]), kind, |_| 1.0);
        let with = run(&part(&first, &second, &third), kind, |_| 1.0);
        assert_eq!(
            with.actions(),
            [
                Action::Flood(true),
                Action::SelectTool { tool: 7 },
                on(3000.0),
                Action::Message { number: 0 },
                on(500.0),
                Action::Mist(true),
                Action::Message { number: 1 },
                Action::Flood(false),
                Action::SpindleOff,
                Action::ProgramEnd,
            ],
            "{kind:?}"
        );
        // What is done at the end takes a cycle each, with it or without.
        assert!(
            with.cycles <= plain.cycles + 4,
            "{kind:?}: {} {}",
            with.cycles,
            plain.cycles
        );
        // Where it belongs, one thing each cycle, at full speed where the path goes straight on.
        let (_, x, speed) = with.done[0];
        assert!((20.0..20.11).contains(&x) && speed > 95.0, "{kind:?}: {x} {speed}");
        let (_, x, _) = with.done[2];
        // A rounded corner belongs to the move behind it.
        assert!((38.0..41.0).contains(&x), "{kind:?}: {x}");
    }
}

#[test]
fn an_exact_stop_is_a_rest_at_which_they_are_done() {
    for kind in KINDS {
        let mut calls = part(&[Call::Flood(true)], &[], &[]);
        calls.insert(2, Call::SetPathMode(PathMode::ExactStop));
        let (action, x, speed) = run(&calls, kind, |_| 1.0).done[0];
        assert_eq!((action, speed), (Action::Flood(true), 0.0), "{kind:?}");
        assert!((x - 20.0).abs() < 1e-9);
    }
}

#[test]
fn what_no_move_brings_about_is_done_at_the_rest_in_its_order() {
    let many: Vec<Call> = (0..40).map(|k| Call::Message(k.to_string())).collect();
    let before_rest = [&[Call::Flood(true)], &many[..], &[Call::ProgramStop, Call::Mist(true)]].concat();
    for kind in KINDS {
        let found = run(&part(&before_rest, &[], &many), kind, |_| 1.0).actions();
        let said = |range: std::ops::Range<u32>| range.map(|number| Action::Message { number });
        let expected: Vec<Action> = [Action::Flood(true)]
            .into_iter()
            .chain(said(0..40))
            .chain([Action::ProgramStop, Action::Mist(true)])
            .chain(said(40..80))
            .chain([Action::Flood(false), Action::SpindleOff, Action::ProgramEnd])
            .collect();
        // The spindle that never turned is told to stand all the same.
        assert_eq!(found, expected, "{kind:?}");
    }
}

#[test]
fn a_hold_just_before_the_place_keeps_them_back_and_a_resume_brings_them_once() {
    for kind in KINDS {
        let calls = part(&[Call::Flood(true)], &[], &[]);
        let whole = run(&calls, kind, |_| 1.0);
        let at = |cycle: usize| move |now: usize| if (cycle..cycle + 300).contains(&now) { 0.0 } else { 1.0 };
        // The place is passed after about 0.35 s.
        for cycle in 250..420 {
            let held = run(&calls, kind, at(cycle));
            assert_eq!(held.actions(), whole.actions(), "{kind:?}, hold in cycle {cycle}");
            assert!(held.done[0].1 >= 20.0 - 1e-9);
        }
    }
}

#[test]
fn the_spindle_is_told_and_waited_for_at_rest_before_the_first_cut() {
    let settings = Settings {
        await_spindle: true,
        ..settings()
    };
    let (producer, mut consumer) = channel(settings.largest_publication());
    let mut planner = Planner::new(settings, producer);
    let to = |x| Call::StraightTraverse {
        to: Position::xyz(x, 0.0, 0.0),
    };
    let start = spindle(1000.0);
    let calls = [&[F, ROUND, to(10.0)], &start[..], &[to(20.0), feed(30.0, 0.0, 0.0)]].concat();
    events(calls).iter().for_each(|event| planner.push(event).unwrap());
    planner.finish();
    assert_eq!(planner.pump(), Pumped::Done);
    let mut told = None;
    let mut waits = Vec::new();
    while let Some(element) = consumer.advance() {
        match element {
            Element::Span(span) if span.auxiliary.spindle.is_some() => {
                told = told.or(Some(span.piece.position(span.s0).0[0]))
            }
            Element::Action { action, .. } => waits.push(action),
            _ => {}
        }
    }
    assert_eq!(waits, [Action::AwaitSpindle]);
    assert!(told.is_some_and(|x| (x - 10.0).abs() < 1e-9), "{told:?}");
}

#[test]
fn there_is_no_way_back_over_a_place_where_the_spindle_was_told_something() {
    for kind in KINDS {
        let with = part(&spindle(1000.0), &[], &[]);
        // Forward for 0.6 s, beyond 20 mm, then back for long, then on.
        let back = |now: usize| if (600..3000).contains(&now) { -1.0 } else { 1.0 };
        let found = run(&with, kind, back);
        assert_eq!(found.actions(), run(&with, kind, |_| 1.0).actions(), "{kind:?}");
    }
}
