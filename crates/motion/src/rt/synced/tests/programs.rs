//! Whole programs with threads and taps: calls, plan, interpolation and a simulated spindle.

use super::spindle::Spindle;
use super::{CYCLE_S, LIMITS, STEADY, Turning, allowed_mm, keeps, worst};
use crate::canon::{AXES, Call, Event, Position, Source, SpindleDirection};
use crate::plan::{AxisLimits, PlanErrorKind, Planner, PlannerKind, Settings};
use crate::ring;
use crate::rt::{Interpolator, MotionLimits, Sample, SampleState, ScaleRamp, StopLimits, SyncFault};

/// Of holds, and of what leaves them.
const STOPS: MotionLimits = MotionLimits {
    velocity: 100.0,
    acceleration: 2000.0,
    jerk: 80_000.0,
};

fn settings(planner_kind: PlannerKind) -> Settings {
    let mut axes = [None; AXES];
    axes[..3].fill(Some(AxisLimits {
        velocity: LIMITS.velocity,
        acceleration: LIMITS.acceleration,
        jerk: LIMITS.jerk,
        travel: [-200.0, 200.0],
    }));
    Settings {
        look_ahead_blocks: 100,
        spindle_encoder: true,
        planner_kind,
        ..Settings::new(axes, CYCLE_S)
    }
}

fn rapid(x: f64, z: f64) -> Call {
    Call::StraightTraverse {
        to: Position::xyz(x, 0.0, z),
    }
}

fn feed(x: f64, z: f64) -> Call {
    Call::StraightFeed {
        to: Position::xyz(x, 0.0, z),
    }
}

fn sync(mm_per_turn: f64) -> Call {
    Call::StartSpindleSync {
        spindle: 0,
        mm_per_turn,
        velocity: false,
    }
}

fn spindle_on(rpm: f64) -> [Call; 2] {
    let start = Call::StartSpindle {
        spindle: 0,
        direction: SpindleDirection::Clockwise,
        wait_for_speed: true,
    };
    [Call::SetSpindleSpeed { spindle: 0, speed: rpm }, start]
}

/// As a threading cycle has it: passes at growing depth, the override off meanwhile.
fn passes(count: u32) -> Vec<Call> {
    let mut calls = spindle_on(600.0).to_vec();
    for pass in 0..count {
        let x = -0.1 * f64::from(pass + 1);
        calls.extend([
            rapid(x, 0.0),
            Call::EnableFeedOverride(false),
            sync(1.5),
            feed(x, -25.0),
            Call::StopSpindleSync,
            rapid(2.0, -25.0),
            Call::EnableFeedOverride(true),
            rapid(2.0, 0.0),
        ]);
    }
    calls
}

fn push<S: ring::Sink<crate::element::Element>>(planner: &mut Planner<S>, calls: &[Call]) -> Result<(), PlanErrorKind> {
    for (line, call) in (1..).zip(calls) {
        let source = Source {
            line,
            ..Source::default()
        };
        let event = Event {
            source,
            call: call.clone(),
        };
        planner.push(&event).map_err(|error| error.kind)?;
        planner.pump();
    }
    planner.finish();
    planner.pump();
    Ok(())
}

fn planned(calls: &[Call], planner_kind: PlannerKind) -> Interpolator {
    let settings = settings(planner_kind);
    let (producer, consumer) = ring::channel(settings.largest_publication());
    let mut planner = Planner::new(settings, producer);
    push(&mut planner, calls).unwrap();
    assert!(planner.is_done());
    let MotionLimits { acceleration, jerk, .. } = STOPS;
    let stop = StopLimits { acceleration, jerk };
    Interpolator::new(consumer, Position::ZERO, ScaleRamp::new(&[(LIMITS, stop)], CYCLE_S))
}

/// Runs until nothing follows; a sample and the true turns of the spindle per cycle.
fn run(
    interpolator: &mut Interpolator,
    spindle: &mut Spindle,
    mut scale: impl FnMut(&Sample) -> f64,
) -> Vec<(Sample, f64)> {
    let mut samples: Vec<(Sample, f64)> = Vec::new();
    let mut last = Sample::resting(Position::ZERO);
    for _ in 0..60_000 {
        spindle.order(last.reversal);
        let feedback = spindle.step();
        last = interpolator.step_with(scale(&last), &feedback);
        samples.push((last, spindle.turns()));
        if last.action.is_some() {
            interpolator.acknowledge_action();
        }
        if last.fault.is_some() || (last.state == SampleState::Starved && interpolator.remaining_s() < 1e-9) {
            return samples;
        }
    }
    panic!("no end: {last:?}");
}

fn ends_at(interpolator: &Interpolator, [x, z]: [f64; 2]) {
    let at = interpolator.position().0;
    assert!((at[0] - x).abs() < 1e-12 && (at[2] - z).abs() < 1e-12, "{at:?}");
}

fn axes_keep(samples: &[(Sample, f64)], limits: &MotionLimits) {
    for axis in 0..3 {
        let places: Vec<f64> = samples.iter().map(|(sample, _)| sample.position.0[axis]).collect();
        keeps(&places, limits);
    }
}

/// Distance from the thread through Z0 at an index, in the cycles of the passes where it is deep in the thread.
fn off_thread(samples: &[(Sample, f64)], pitch_mm: f64) -> Vec<f64> {
    samples
        .windows(2)
        .filter(|w| {
            let (z, dz) = (w[1].0.position.0[2], w[1].0.position.0[2] - w[0].0.position.0[2]);
            w[1].0.position.0[0] < 0.0 && dz < 0.0 && z < -8.0 && z > -23.0
        })
        .map(|w| {
            let turns0 = w[1].1 + w[1].0.position.0[2] / pitch_mm;
            (turns0 - turns0.round()) * pitch_mm
        })
        .collect()
}

#[test]
fn passes_of_a_threading_cycle_are_in_phase() {
    for planner_kind in [PlannerKind::Classic, PlannerKind::Optimal] {
        let turning = Turning {
            ripple: 0.002,
            drop: 0.02,
            seed: 11,
            ..STEADY
        };
        let mut interpolator = planned(&passes(4), planner_kind);
        let samples = run(&mut interpolator, &mut Spindle::new(turning, CYCLE_S), |_| 1.0);
        axes_keep(&samples, &LIMITS);
        ends_at(&interpolator, [2.0, 0.0]);
        let off = off_thread(&samples, 1.5);
        assert!(off.len() > 3000, "{}", off.len());
        let allowed = allowed_mm(1.5, &turning);
        assert!(worst(&off) <= allowed, "{} > {allowed}", worst(&off));
    }
}

#[test]
fn a_hold_acts_when_the_pass_is_over_and_an_override_not_at_all() {
    let mut interpolator = planned(&passes(2), PlannerKind::Classic);
    let (mut held, mut rested) = (0, 0);
    let samples = run(&mut interpolator, &mut Spindle::new(STEADY, CYCLE_S), |last| {
        let [x, _, z] = [0, 1, 2].map(|axis| last.position.0[axis]);
        if (-0.15..0.0).contains(&x) && z < -10.0 && held < 3000 {
            held += 1;
            rested += u32::from(z == -25.0);
            return 0.0;
        }
        if x < -0.15 && z < -1.0 && z > -24.0 { 0.5 } else { 1.0 }
    });
    axes_keep(&samples, &STOPS);
    // 15 mm at 15 mm/s are a second; the other two are spent at its end.
    assert!((1900..2100).contains(&rested), "{rested}");
    let off = off_thread(&samples, 1.5);
    assert!(off.len() > 1500 && worst(&off) <= allowed_mm(1.5, &STEADY));
    ends_at(&interpolator, [2.0, 0.0]);
}

#[test]
fn a_tap_is_run_there_and_back_and_the_program_goes_on() {
    let mut calls = spindle_on(600.0).to_vec();
    let to = Position::xyz(5.0, 0.0, -20.0);
    calls.extend([
        rapid(5.0, 0.0),
        sync(1.0),
        Call::RigidTap { to, return_scale: 2.0 },
        Call::StopSpindleSync,
        rapid(9.0, 0.0),
    ]);
    let mut interpolator = planned(&calls, PlannerKind::Optimal);
    let samples = run(&mut interpolator, &mut Spindle::new(STEADY, CYCLE_S), |_| 1.0);
    axes_keep(&samples, &LIMITS);
    let deepest = samples
        .iter()
        .map(|(sample, _)| sample.position.0[2])
        .fold(0.0, f64::min);
    // 10 turns/s come to rest within 1.25 turns at 40 turns/s².
    assert!((deepest + 21.25).abs() < 0.1, "{deepest}");
    assert!(samples.iter().any(|(sample, _)| sample.reversal == Some(2.0)));
    ends_at(&interpolator, [9.0, 0.0]);
}

#[test]
fn without_an_encoder_a_thread_is_refused_before_and_given_up_when_it_fails() {
    let mut settings = settings(PlannerKind::Classic);
    let refused = |settings, calls: &[Call]| {
        let mut planner = Planner::new(settings, crate::plan::offline::Recorder::default());
        push(&mut planner, calls).unwrap_err()
    };
    let fast = [&spindle_on(3000.0)[..], &[sync(3.0), feed(0.0, -9.0)]].concat();
    assert_eq!(
        refused(settings, &[sync(1.5), feed(0.0, -9.0)]),
        PlanErrorKind::SpindleStands
    );
    assert!(matches!(
        refused(settings, &fast),
        PlanErrorKind::SpindleTooFast { speed: 150.0, .. }
    ));
    settings.spindle_encoder = false;
    assert_eq!(refused(settings, &passes(1)), PlanErrorKind::NoSpindleEncoder);

    let mut interpolator = planned(&passes(1), PlannerKind::Classic);
    let mut samples = Vec::new();
    for _ in 0..8000 {
        samples.push((interpolator.step(1.0), 0.0));
        interpolator.acknowledge_action();
    }
    axes_keep(&samples, &LIMITS);
    let last = samples[samples.len() - 1].0;
    assert_eq!(last.fault, Some(SyncFault::NoIndex));
    assert_eq!(last.position, Position::xyz(-0.1, 0.0, 0.0));
    assert!(interpolator.is_at_rest());
}
