use super::*;
use crate::canon::{Call, Event, PathMode, Position, Source};
use crate::plan::{AxisLimits, PathPlanner, PlannerKind, SpeedPlanner};
use crate::ring::{Publish, Sink};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Kept for all cases, as a planner keeps them.
static WORKERS: LazyLock<Vec<Workers>> = LazyLock::new(|| (0..8).map(|threads| Workers::new(threads, || ())).collect());

/// Everything that is handed over, and how.
#[derive(Debug, Default, PartialEq)]
struct Recorder(Vec<String>);

impl Sink<Element> for Recorder {
    fn free(&self) -> usize {
        usize::MAX
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.0.push(format!("{committed:?} {tail:?}"));
        Publish::Done
    }
}

fn event(call: Call) -> Event {
    Event {
        source: Source::default(),
        call,
    }
}

/// A way of many short lines: places, and where the machine waits.
fn calls(steps: &[(f64, f64, u8)], tolerance_mm: f64) -> Vec<Event> {
    let mode = PathMode::Continuous {
        tolerance_mm: Some(tolerance_mm),
        naive_cam_tolerance_mm: None,
    };
    let mut calls = vec![
        event(Call::SetPathMode(mode)),
        event(Call::SetFeedRate {
            linear: 80.0,
            angular: 80.0,
        }),
    ];
    let (mut at, mut direction) = ([0.0_f64; 2], 0.0_f64);
    for (length, turn, kind) in steps {
        direction += turn;
        at[0] += length * direction.cos();
        at[1] += length * direction.sin();
        let mut to = Position::ZERO;
        (to.0[0], to.0[1]) = (at[0], at[1]);
        calls.push(event(Call::StraightFeed { to }));
        match kind {
            0 => calls.push(event(Call::Dwell { seconds: 0.1 })),
            1 => calls.push(event(Call::SetFeedRate {
                linear: 5.0 + 90.0 * turn.abs().min(1.0),
                angular: 80.0,
            })),
            // The end is told again, or nearly.
            2 => {
                to.0[0] += turn * 1e-9;
                to.0[2] += length * 1e-14;
                calls.push(event(Call::StraightFeed { to }));
            }
            _ => {}
        }
    }
    calls
}

/// Publications, and what of the passes was computed again.
fn planned(calls: &[Event], settings: Settings, threads: usize) -> (Recorder, [u64; 2]) {
    let mut path = PathPlanner::new(settings);
    let mut speed = SpeedPlanner::new(settings, Recorder::default(), &WORKERS[threads - 1]);
    for call in calls {
        path.push(call).unwrap();
        path.smoothed().for_each(|smoothed| speed.push(smoothed));
        speed.pump();
    }
    path.finish();
    path.smoothed().for_each(|smoothed| speed.push(smoothed));
    speed.pump();
    assert!(speed.is_done());
    (std::mem::take(speed.sink()), speed.computed_ahead())
}

fn settings(look_ahead: usize, buffer: usize, overlap: usize, jerk: f64) -> Settings {
    let mut axes = [None; crate::canon::AXES];
    axes[..3].fill(Some(AxisLimits {
        velocity: 100.0,
        acceleration: 1000.0,
        jerk,
        travel: [-1e6, 1e6],
    }));
    Settings {
        planner_kind: PlannerKind::Classic,
        look_ahead_blocks: look_ahead,
        look_ahead_buffer_blocks: buffer,
        look_ahead_overlap_blocks: overlap,
        ..Settings::new(axes, 1e-3)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn buffers_give_the_bits_of_one_thread(
        steps in prop::collection::vec((0.02f64..1.5, -0.4f64..0.4, 0u8..60), 1..700),
        tolerance in prop::sample::select(vec![0.0, 0.01, 0.1]),
        look_ahead in prop::sample::select(vec![1usize, 100, 10_000]),
        buffer in prop_oneof![1usize..40, 40usize..500],
        overlap in prop_oneof![Just(0usize), 1usize..100, Just(100_000)],
        jerk in prop::sample::select(vec![2e3, 2e4, 1e6]),
    ) {
        let calls = calls(&steps, tolerance);
        let settings = settings(look_ahead, buffer, overlap, jerk);
        let (expected, [ahead, again]) = planned(&calls, settings, 1);
        prop_assert_eq!([ahead, again], [0, 0]);
        for threads in 2..=8 {
            let (got, _) = planned(&calls, settings, threads);
            prop_assert!(got == expected, "{} threads", threads);
        }
    }
}

#[test]
fn an_overlap_that_is_too_short_is_noticed_and_one_of_the_braking_length_is_enough() {
    // A lap of 0.1 mm lines at 80 mm/s: braking at 1000 mm/s2 with 20,000 mm/s3 takes 5.2 mm, 52 lines.
    let calls = calls(&vec![(0.1, 0.002, 9); 6000], 0.0);
    let share = |buffer, overlap| {
        let settings = settings(10_000, buffer, overlap, 2e4);
        let ((expected, _), (got, [ahead, again])) = (planned(&calls, settings, 1), planned(&calls, settings, 3));
        assert!(got == expected, "{buffer}/{overlap}");
        assert!(ahead > 20, "{ahead} were computed ahead");
        again as f64 / (ahead + again) as f64
    };
    // An overlap reaches to the end of a run, which may have 512 pieces: so runs are kept short by the buffers' own size.
    let (none, enough) = (share(600, 0), share(600, 2000));
    assert!(none > 0.0 && enough < 0.5 * none, "{none} {enough}");
}
