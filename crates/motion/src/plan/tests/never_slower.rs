//! The optimal planner against the classic one: never slower, whatever the program, the path mode and the jerk.

use super::random::{Step, program, step};
use super::*;
use crate::canon::Plane;
use crate::element::Element;
use crate::plan::workers::Workers;
use crate::ring::{Publish, Sink, Timed};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Counts time.
#[derive(Debug, Default)]
struct Clock(f64);

impl Sink<Element> for Clock {
    fn free(&self) -> usize {
        usize::MAX
    }

    fn publish(&mut self, committed: &[Element], _: &[Element]) -> Publish {
        self.0 += committed.iter().map(Timed::duration_s).sum::<f64>();
        Publish::Done
    }
}

/// Motion time of a program by the optimal planner and by the classic one, s.
fn times_s(events: &[Event], settings: Settings) -> [f64; 2] {
    [PlannerKind::Optimal, PlannerKind::Classic].map(|planner_kind| time_s(events, planner_kind, settings))
}

fn time_s(events: &[Event], planner_kind: PlannerKind, mut settings: Settings) -> f64 {
    settings.planner_kind = planner_kind;
    settings.look_ahead_blocks = 10_000;
    let mut planner = Planner::with_workers(settings, Clock::default(), &Workers::none());
    for event in events {
        planner.push(event).unwrap();
        planner.pump();
    }
    planner.finish();
    while planner.pump() != Pumped::Done {}
    planner.sink().0
}

const MODES: [PathMode; 3] = [
    PathMode::ExactPath,
    PathMode::ExactStop,
    PathMode::Continuous {
        tolerance_mm: Some(0.01),
        naive_cam_tolerance_mm: None,
    },
];

/// The same limits but for the jerk.
fn with_jerk(factor: f64) -> Settings {
    let mut settings = settings();
    for limits in settings.axes.iter_mut().flatten() {
        limits.jerk *= factor;
    }
    settings
}

/// A program of these steps in one path mode.
fn in_mode(steps: &[Step], mode: PathMode) -> Vec<Event> {
    let steps: Vec<Step> = steps
        .iter()
        .filter(|step| !matches!(step, Step::Mode(_)))
        .cloned()
        .collect();
    let mut events = program(&steps, true);
    events[1].call = Call::SetPathMode(mode);
    events
}

/// Asserts that the optimal planner needs no more time, but for a thousandth and a cycle.
fn not_slower(events: &[Event], settings: Settings) -> [f64; 2] {
    let [optimal_s, classic_s] = times_s(events, settings);
    assert!(
        optimal_s <= 1.001 * classic_s + settings.cycle_s,
        "optimal {optimal_s} s, classic {classic_s} s"
    );
    [optimal_s, classic_s]
}

/// Chords of 0.1 mm around a circle of 20 mm.
fn chords(laps: u32) -> Vec<Event> {
    let chords = (1..=laps * 1257).map(|k| {
        let (sin, cos) = (TAU * f64::from(k) / 1257.0).sin_cos();
        feed(20.0 * cos - 20.0, 20.0 * sin, 0.0)
    });
    events([F, Call::SetPathMode(PathMode::ExactPath)].into_iter().chain(chords))
}

/// A flower of harmonics in three axes, as chords of very different lengths.
fn rose(count: u32) -> Vec<Event> {
    let at = |k: u32| {
        let t = 8.0 * TAU * f64::from(k) / 20_000.0;
        let sum = |harmonics: &[[f64; 3]]| -> f64 {
            harmonics
                .iter()
                .map(|[order, amount, phase]| amount * (order * t + phase).sin())
                .sum()
        };
        let x = sum(&[[1.0, 25.0, 0.3], [2.0, 12.0, 1.9], [5.0, 4.0, 4.0], [13.0, 1.5, 2.2]]);
        let y = sum(&[[1.0, 28.0, 1.1], [4.0, 6.0, 5.0], [7.0, 3.0, 0.4], [17.0, 1.0, 3.3]]);
        [x, y, 3.0 * (0.5 * t).sin()]
    };
    let start = at(0);
    let chords = (1..=count).map(|k| {
        let at = at(k);
        // As programs are written: five decimals.
        let [x, y, z] = [0, 1, 2].map(|axis| ((at[axis] - start[axis]) * 1e5).round() / 1e5);
        feed(x, y, z)
    });
    events([F, Call::SetPathMode(PathMode::ExactPath)].into_iter().chain(chords))
}

#[test]
fn a_circle_of_chords_on_the_exact_path_is_not_slower() {
    let settings = with_jerk(5.0);
    let [optimal_s, classic_s] = not_slower(&chords(1), settings);
    // Each kink is passed as fast as the jerk limit allows: 0.9 * 0.985 J T² / 0.005 rad.
    assert!(optimal_s < 0.75 * classic_s, "{optimal_s} {classic_s}");
    let plan = proven(
        &chords(1),
        Settings {
            planner_kind: PlannerKind::Optimal,
            ..settings
        },
        0.0,
    );
    assert!((plan.motion_time_s - optimal_s).abs() < 1e-9);
}

#[test]
fn a_rose_of_chords_on_the_exact_path_is_not_slower() {
    for factor in [1.0, 5.0] {
        let settings = with_jerk(factor);
        not_slower(&rose(3000), settings);
        proven(
            &rose(1000),
            Settings {
                planner_kind: PlannerKind::Optimal,
                ..settings
            },
            0.0,
        );
    }
}

#[test]
fn an_arc_alone_is_not_slower_however_straight() {
    for jerk in [0.2, 1.0] {
        for radius in [0.05, 0.5, 5.0] {
            for sweep in [0.01, 0.1, 0.3, 1.0, 3.0] {
                for (rise, turns) in [(0.0, 1), (0.3, 1), (-1.0, 1), (3.0, 1), (3.0, 3), (10.0, 1), (10.0, 3)] {
                    for spiral in [0.0, 0.0015] {
                        let arc = Step::Arc {
                            plane: Plane::Xy,
                            radius,
                            from: 0.7,
                            sweep,
                            turns,
                            rise,
                            spiral,
                        };
                        not_slower(&in_mode(&[arc], MODES[0]), with_jerk(jerk));
                    }
                }
            }
        }
    }
}

#[test]
fn a_corner_beside_a_short_run_is_not_slower() {
    for scale in [0.2, 1.0, 5.0, 10.0] {
        for chord in [0.005, 0.02, 0.1] {
            for count in [1, 2, 3, 6] {
                let line = Step::Line {
                    by: [0.0, 0.0, 0.5],
                    scale,
                    turn_a: 0.0,
                    rapid: false,
                };
                let run = Step::Dense {
                    radius: 30.0,
                    chord,
                    count,
                    heading: 0.0,
                };
                for steps in [[line.clone(), run.clone()], [run, line]] {
                    for jerk in [0.2, 1.0] {
                        not_slower(&in_mode(&steps, MODES[2]), with_jerk(jerk));
                    }
                }
            }
        }
    }
}

/// A program, its path mode and how many times the moderate jerk the machine bears.
fn case() -> impl Strategy<Value = (Vec<Step>, usize, f64)> {
    let jerk = prop_oneof![Just(0.2), Just(1.0), Just(5.0), Just(25.0)];
    (prop::collection::vec(step(), 1..20), 0..MODES.len(), jerk)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_program_is_slower((steps, mode, jerk) in case()) {
        not_slower(&in_mode(&steps, MODES[mode]), with_jerk(jerk));
    }
}

#[test]
#[ignore = "takes minutes"]
fn none_of_a_thousand_programs_is_slower() {
    use proptest::strategy::ValueTree;
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let (mut slower, mut sums) = (0, [[0.0; 2]; 3]);
    for number in 0..1000 {
        let (steps, _, jerk) = case().new_tree(&mut runner).unwrap().current();
        for (mode, sum) in MODES.into_iter().zip(&mut sums) {
            let settings = with_jerk(jerk);
            let [optimal_s, classic_s] = times_s(&in_mode(&steps, mode), settings);
            sum[0] += optimal_s;
            sum[1] += classic_s;
            if optimal_s > 1.001 * classic_s + settings.cycle_s {
                slower += 1;
                println!("program {number}, {mode:?}, jerk {jerk}: optimal {optimal_s:.4} s, classic {classic_s:.4} s");
            }
        }
    }
    println!("optimal and classic, s: {sums:.1?}");
    assert_eq!(slower, 0);
}
