//! Plans a square whose corners may be rounded by 0.1 mm, and prints where the tool is in every cycle: seconds, X, Y in mm.
//!
//! `cargo run -p isocnc-motion --example square`

use motion::canon::{AXES, Call, Event, PathMode, Position, Source};
use motion::plan::{AxisLimits, PlanError, Settings, plan_offline};

const CYCLE_S: f64 = 1e-3;

fn main() -> Result<(), PlanError> {
    let axis = AxisLimits {
        velocity: 200.0,
        acceleration: 2000.0,
        jerk: 50_000.0,
        travel: [-500.0, 500.0],
    };
    let mut calls = vec![
        Call::SetFeedRate {
            linear: 100.0,
            angular: 100.0,
        },
        Call::SetPathMode(PathMode::Continuous {
            tolerance_mm: Some(0.1),
            naive_cam_tolerance_mm: None,
        }),
    ];
    let corners = [[20.0, 0.0], [20.0, 20.0], [0.0, 20.0], [0.0, 0.0]];
    calls.extend(corners.map(|[x, y]| Call::StraightFeed {
        to: Position::xyz(x, y, 0.0),
    }));
    let events: Vec<Event> = (1..)
        .zip(calls)
        .map(|(line, call)| Event {
            source: Source {
                line,
                ..Source::default()
            },
            call,
        })
        .collect();
    let plan = plan_offline(&events, Settings::new([Some(axis); AXES], CYCLE_S))?;
    for (cycle, Position([x, y, ..])) in plan.samples.iter().enumerate() {
        println!("{:.3} {x:.4} {y:.4}", cycle as f64 * CYCLE_S);
    }
    eprintln!("{:.3} s for 80 mm", plan.motion_time_s);
    Ok(())
}
