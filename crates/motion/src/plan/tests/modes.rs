//! The modes in force travel with what is run in them, and change nothing of the motion.

use super::*;
use crate::element::Action;
use crate::ring::channel;
use crate::rt::{Interpolator, MotionLimits, SampleState, ScaleRamp, StopLimits};

/// What is seen of a run: for each cycle X, the number of the modes and the action that waits. `share`: of the planned speed, by the
/// number of the cycle; ends with the program or behind `most` cycles.
fn run(
    events: &[Event],
    planner_kind: PlannerKind,
    most: usize,
    share: impl Fn(usize) -> f64,
) -> Vec<(f64, u32, Option<Action>)> {
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
    let mut events = events.iter();
    let mut seen = Vec::new();
    while seen.len() < most {
        while planner.pump() == Pumped::Hungry {
            match events.next() {
                Some(event) => planner.push(event).unwrap(),
                None => planner.finish(),
            }
        }
        let sample = interpolator.step(share(seen.len()));
        if sample.state == SampleState::Finished && !seen.is_empty() {
            break;
        }
        seen.push((sample.position.0[0], sample.modes, sample.action));
        if sample.action.is_some() {
            interpolator.acknowledge_action();
        }
    }
    seen
}

/// Calls, each with the number of the modes that it runs in.
fn numbered(calls: &[(u32, Call)]) -> Vec<Event> {
    let mut events = events(calls.iter().map(|(_, call)| call.clone()));
    for (event, (modes, _)) in events.iter_mut().zip(calls) {
        event.source.modes = *modes;
    }
    events
}

/// Four moves that nothing stops between, the second and third short enough to become one; a dwell; a stop; a move; the end.
fn program() -> Vec<(u32, Call)> {
    vec![
        (1, F),
        (1, ROUND),
        (1, feed(20.0, 0.0, 0.0)),
        (2, feed(40.0, 10.0, 0.0)),
        (3, feed(40.004, 10.002, 0.0)),
        (4, feed(60.0, 10.0, 0.0)),
        (5, Call::Dwell { seconds: 0.01 }),
        (5, Call::Dwell { seconds: 0.01 }),
        (6, Call::ProgramStop),
        (7, Call::SelectPlane(Plane::Xy)),
        (8, feed(80.0, 10.0, 0.0)),
        (9, Call::ProgramEnd),
    ]
}

#[test]
fn every_move_wait_and_stop_shows_the_modes_of_its_block() {
    for kind in [PlannerKind::Classic, PlannerKind::Optimal] {
        let seen = run(&numbered(&program()), kind, 100_000, |_| 1.0);
        let mut numbers: Vec<u32> = seen.iter().map(|(_, modes, _)| *modes).collect();
        numbers.dedup();
        // One that no move and no rest has brought is passed over; a move that became one with its neighbour may be.
        numbers.retain(|number| *number != 3);
        assert_eq!(numbers, [1, 2, 4, 5, 6, 8, 9], "{kind:?}");
        let first_of = |number: u32| seen.iter().find(|(_, modes, _)| *modes == number).unwrap().0;
        assert!((first_of(2) - 20.0).abs() < 0.2 && first_of(4) > 39.5, "{kind:?}");
        assert_eq!((first_of(5), first_of(6)), (60.0, 60.0), "{kind:?}");
        let of_action = |action| seen.iter().find(|(.., found)| *found == Some(action)).unwrap().1;
        assert_eq!(of_action(Action::ProgramStop), 6, "{kind:?}");
        assert_eq!(of_action(Action::ProgramEnd), 9, "{kind:?}");
        assert!(
            seen.iter()
                .all(|(.., action)| !matches!(action, Some(Action::Modes { .. }))),
            "nothing waits for modes"
        );
    }
}

#[test]
fn modes_that_are_told_change_no_cycle_of_the_motion() {
    for kind in [PlannerKind::Classic, PlannerKind::Optimal] {
        let told = run(&numbered(&program()), kind, 100_000, |_| 1.0);
        let untold: Vec<(u32, Call)> = program().into_iter().map(|(_, call)| (0, call)).collect();
        let untold = run(&numbered(&untold), kind, 100_000, |_| 1.0);
        let places = |seen: &[(f64, u32, Option<Action>)]| -> Vec<(u64, Option<Action>)> {
            seen.iter().map(|(x, _, action)| (x.to_bits(), *action)).collect()
        };
        assert_eq!(places(&told), places(&untold), "{kind:?}");
    }
}

#[test]
fn on_the_way_back_the_modes_are_those_of_the_block_that_is_run_back() {
    let calls = [
        (1, F),
        (1, feed(20.0, 0.0, 0.0)),
        (2, Call::Dwell { seconds: 0.01 }),
        (3, feed(40.0, 0.0, 0.0)),
    ];
    for kind in [PlannerKind::Classic, PlannerKind::Optimal] {
        // On until the second move is under way, back to the beginning, and on again.
        let on = run(&numbered(&calls), kind, 100_000, |_| 1.0)
            .iter()
            .position(|(x, ..)| *x > 30.0)
            .unwrap();
        let seen = run(&numbered(&calls), kind, 4 * on, |cycle| {
            if cycle < on || cycle > 3 * on { 1.0 } else { -1.0 }
        });
        let mut numbers: Vec<u32> = seen.iter().map(|(_, modes, _)| *modes).collect();
        numbers.dedup();
        assert_eq!(numbers[..4], [1, 2, 3, 1], "{kind:?}: {numbers:?}");
        assert!(
            seen.iter().skip(on).any(|(x, ..)| *x < 1.0),
            "{kind:?}: a wait is no end of the way back"
        );
        assert!(seen.iter().all(|(.., action)| action.is_none()), "{kind:?}");
    }
}
