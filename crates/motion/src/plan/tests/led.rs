//! Feed that the spindle leads (G95), and what is beside it: the share of the speed changes at rest, so that the limits of plans hold.

use super::*;
use crate::canon::{FeedMode, SpindleDirection};
use crate::ring;
use crate::rt::{Interpolator, MotionLimits, SampleState, ScaleRamp, Shares, SpindleFeedback, StopLimits};

/// Set-points of a program whose spindle turns at this share of the speed that is planned for.
fn run(planner_kind: PlannerKind, share: f64, calls: &[Call]) -> Vec<Position> {
    let settings = Settings {
        planner_kind,
        ..settings()
    };
    let ramps: Vec<_> = (settings.axes.iter().flatten())
        .map(|axis| {
            let plan = MotionLimits {
                velocity: axis.velocity,
                acceleration: axis.acceleration,
                jerk: axis.jerk,
            };
            let stop = StopLimits {
                acceleration: 2.0 * axis.acceleration,
                jerk: 4.0 * axis.jerk,
            };
            (plan, stop)
        })
        .collect();
    let (producer, consumer) = ring::channel(1 << 15);
    let mut planner = Planner::new(settings, producer);
    for event in &events(calls.iter().cloned()) {
        planner.push(event).unwrap();
        planner.pump();
    }
    planner.finish();
    while planner.pump() != Pumped::Done {}
    let mut interpolator = Interpolator::new(consumer, settings.start, ScaleRamp::new(&ramps, settings.cycle_s));
    let shares = Shares {
        turning: share,
        ..Shares::FULL
    };
    let mut samples = vec![settings.start];
    for _ in 0..100_000 {
        let sample = interpolator.step_shares(&shares, &SpindleFeedback::NONE);
        samples.push(sample.position);
        if sample.action.is_some() {
            interpolator.acknowledge_action();
        }
        if sample.state == SampleState::Finished {
            return samples;
        }
    }
    panic!("no end");
}

fn rapid(x: f64, y: f64, z: f64) -> Call {
    Call::StraightTraverse {
        to: Position::xyz(x, y, z),
    }
}

#[test]
fn limits_of_plans_hold_from_a_feed_that_the_spindle_leads_to_one_that_it_does_not_and_back() {
    let spindle = [
        Call::SetSpindleSpeed {
            spindle: 0,
            speed: 2500.0,
        },
        Call::StartSpindle {
            spindle: 0,
            direction: SpindleDirection::Clockwise,
            wait_for_speed: false,
        },
    ];
    let led = |on: bool| {
        Call::SetFeedMode(match on {
            true => FeedMode::PerTurn { spindle: 0 },
            false => FeedMode::PerTime,
        })
    };
    let per_turn = Call::SetFeedRate {
        linear: 0.2,
        angular: 0.2,
    };
    let moves = [
        ROUND,
        rapid(20.0, 0.0, 0.0),
        led(true),
        per_turn.clone(),
        feed(20.0, 0.0, -6.0),
        feed(22.0, 0.0, -7.5),
        rapid(22.0, 0.0, 40.0),
        rapid(25.0, 0.0, 40.0),
        feed(25.0, 0.0, 38.0),
        led(false),
        F,
        feed(60.0, 0.0, 38.5),
        feed(60.0, 30.0, 38.5),
        led(true),
        per_turn,
        feed(60.0, 32.0, 39.0),
        Call::ProgramEnd,
    ];
    let calls = [&[F], &spindle[..], &moves[..]].concat();
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        for share in [1.0, 0.7, 0.25] {
            let samples = run(planner_kind, share, &calls);
            let settings = settings();
            let peaks = check(&samples, settings.cycle_s, &settings.axes);
            assert_eq!(peaks.over(), 0, "{planner_kind:?} {share}: {peaks:?}");
            assert_eq!(samples.last(), Some(&Position::xyz(60.0, 32.0, 39.0)));
        }
    }
}
