//! Random and fixed programs through the whole planner.

use super::check::check;
use super::deviation::deviation;
use super::smooth::round::distance;
use super::*;
use crate::canon::{Call, Event, PathMode, Plane};

mod corners;
mod gate;
mod joint_space;
mod led;
mod modes;
mod never_slower;
mod on_the_way;
mod override_tests;
mod random;
mod residues;
mod slow;
mod tiny;
mod travel;

fn settings() -> Settings {
    let linear = AxisLimits {
        velocity: 100.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
        travel: [-500.0, 500.0],
    };
    let mut axes = [None; AXES];
    axes[..3].fill(Some(linear));
    axes[2] = Some(AxisLimits {
        velocity: 60.0,
        acceleration: 500.0,
        jerk: 8_000.0,
        travel: [-500.0, 500.0],
    });
    axes[3] = Some(AxisLimits {
        velocity: 90.0,
        acceleration: 900.0,
        jerk: 30_000.0,
        travel: [-1e5, 1e5],
    });
    Settings {
        tolerance_mm: 0.05,
        look_ahead_blocks: 200,
        planner_kind: PlannerKind::Classic,
        ..Settings::new(axes, 1e-3)
    }
}

fn events(calls: impl IntoIterator<Item = Call>) -> Vec<Event> {
    let located = |(i, call)| Event {
        source: Source {
            line: i as u32 + 1,
            ..Source::default()
        },
        call,
    };
    calls.into_iter().enumerate().map(located).collect()
}

fn feed(x: f64, y: f64, z: f64) -> Call {
    Call::StraightFeed {
        to: Position::xyz(x, y, z),
    }
}

const ROUND: Call = Call::SetPathMode(PathMode::Continuous {
    tolerance_mm: Some(0.01),
    naive_cam_tolerance_mm: None,
});
const F: Call = Call::SetFeedRate {
    linear: 100.0,
    angular: 100.0,
};

/// Plans, and asserts everything that must hold for any program; returns the plan.
fn proven(events: &[Event], settings: Settings, tolerance: f64) -> Offline {
    let plan = plan_offline(events, settings).unwrap();
    let peaks = check(&plan.samples, settings.cycle_s, &settings.axes);
    assert_eq!(peaks.over(), 0, "{peaks:?}");
    let found = deviation(&plan.samples, &plan.ideal, tolerance);
    assert!(found.off_mm <= tolerance + 1e-9, "{found:?}");
    assert!(
        found.length_mm - found.reached_mm <= 2.0 * tolerance + 1e-6,
        "{found:?}"
    );
    if let (Some(last), Some(end)) = (plan.ideal.last(), plan.samples.last()) {
        assert!(distance(&last.piece.position(last.piece.length()).0, &end.0) < 1e-12);
    }
    plan
}

#[test]
fn a_single_line_takes_the_textbook_time() {
    let plan = proven(&events([F, feed(100.0, 0.0, 0.0)]), settings(), 0.0);
    // 7 phases at 1000 mm/s2 and 20,000 mm/s3: 85 mm at 100 mm/s, 0.3 s for the ramps; limits are used to 98.5 %.
    assert!(
        plan.motion_time_s > 1.15 && plan.motion_time_s < 1.16,
        "{}",
        plan.motion_time_s
    );
}

#[test]
fn a_circle_of_short_chords_does_not_crawl() {
    let chords = (1..=1257).map(|k| {
        let (sin, cos) = (f64::from(k) * 0.005).sin_cos();
        feed(20.0 * cos - 20.0, 20.0 * sin, 0.0)
    });
    let plan = proven(&events([F, ROUND].into_iter().chain(chords)), settings(), 0.01);
    assert!(plan.motion_time_s < 2.2, "{}", plan.motion_time_s);
}

#[test]
fn blocks_of_a_small_part_of_the_braking_length_are_run_at_full_speed() {
    // Braking takes 7.6 mm: 760 blocks. As exact paths they stay what they are.
    let blocks = (1..=6000).map(|k| feed(0.01 * f64::from(k), 0.0, 0.0));
    let calls = events([F].into_iter().chain(blocks));
    let time = |look_ahead_blocks| {
        let settings = Settings {
            look_ahead_blocks,
            ..settings()
        };
        proven(&calls, settings, 0.0).motion_time_s
    };
    let (few, all) = (time(20), time(10_000));
    assert!((few - all).abs() < 1e-9, "{few} {all}");
    // 60 mm at 100 mm/s, and two ramps of 0.15 s at half the speed; some more where runs meet.
    assert!(all < 0.8, "{all}");
}

#[test]
fn short_exact_blocks_go_on_at_full_speed_from_window_to_window() {
    // More blocks than a window has spans: the stop behind each border takes 760 of them.
    let blocks = (1..=20_000).map(|k| feed(0.01 * f64::from(k), 0.0, 0.0));
    let settings = Settings {
        planner_kind: PlannerKind::Optimal,
        ..settings()
    };
    let plan = proven(&events([F].into_iter().chain(blocks)), settings, 0.0);
    // 200 mm at 100 mm/s, and two ramps of 0.15 s at half the speed.
    assert!(plan.motion_time_s < 2.17, "{}", plan.motion_time_s);
}

#[test]
fn errors_say_line_axis_value_and_limit() {
    let error = plan_offline(&events([F, feed(1.0, 2.0, 3.0), feed(1.0, -501.5, 3.0)]), settings()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "line 3: Y would reach -501.5000 mm in machine coordinates, beyond its travel limit -500.0000"
    );
    let error = plan_offline(&events([feed(1.0, 2.0, 3.0)]), settings()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "line 1: feed move without a feed rate; expected F before it"
    );
    let mut to = Position::ZERO;
    to.0[4] = 1.0;
    let error = plan_offline(&events([Call::StraightTraverse { to }]), settings()).unwrap_err();
    assert_eq!(error.to_string(), "line 1: this machine has no axis B");
}

#[test]
fn tangent_arcs_are_run_through_on_the_exact_path() {
    // An S of two half circles: direction is continuous, curvature jumps from 1/10 to -1/10.
    let half = |x: f64, centre: f64, turns| Call::ArcFeed {
        to: Position::xyz(x, 0.0, 0.0),
        plane: Plane::Xy,
        centre_mm: [centre, 0.0],
        turns,
    };
    let exact = [F, half(20.0, 10.0, 1), half(40.0, 30.0, -1)];
    let plan = proven(&events(exact.clone()), settings(), 0.0);
    let speed = |k: usize| distance(&plan.samples[k].0, &plan.samples[k - 1].0) / 1e-3;
    let slowest = (200..plan.samples.len() - 200).map(speed).fold(f64::INFINITY, f64::min);
    // 0.75 * 0.2 * v^2 / T <= 0.6 * 0.985 * J, less what the arcs take themselves: v is about 8 mm/s.
    assert!(slowest > 5.0 && slowest < 9.0, "{slowest}");
    // Where it may be rounded, the curvature changes over a stretch and not at once.
    let rounded = proven(&events([ROUND].into_iter().chain(exact)), settings(), 0.01);
    assert!(rounded.motion_time_s < plan.motion_time_s);
}

#[test]
fn exact_stop_rests_at_every_corner() {
    let calls = [
        F,
        Call::SetPathMode(PathMode::ExactStop),
        feed(10.0, 0.0, 0.0),
        feed(20.0, 0.0, 0.0),
    ];
    let plan = proven(&events(calls), settings(), 0.0);
    let rest = plan.samples.iter().position(|q| (q.0[0] - 10.0).abs() < 1e-3).unwrap();
    let step = distance(&plan.samples[rest + 1].0, &plan.samples[rest].0);
    assert!(step < 1e-3, "{step}");
    let through = proven(
        &events([F, feed(10.0, 0.0, 0.0), feed(20.0, 0.0, 0.0)]),
        settings(),
        0.0,
    );
    assert!(through.motion_time_s < plan.motion_time_s - 0.05);
}

#[test]
fn waits_take_their_time_at_rest() {
    let dwell = Call::Dwell { seconds: 0.5 };
    let with = proven(
        &events([F, feed(1.0, 0.0, 0.0), dwell.clone(), feed(2.0, 0.0, 0.0)]),
        settings(),
        0.0,
    );
    let halves = proven(&events([F, feed(1.0, 0.0, 0.0)]), settings(), 0.0);
    assert!((with.motion_time_s - 2.0 * halves.motion_time_s - 0.5).abs() < 1e-9);
    let only = proven(&events([dwell]), settings(), 0.0);
    assert_eq!(only.motion_time_s, 0.5);
    assert!(only.samples.len() >= 501 && only.samples.iter().all(|q| *q == Position::ZERO));
}
