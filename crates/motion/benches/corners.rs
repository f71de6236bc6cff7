//! What corners cost: `cargo bench -p isocnc-motion --bench corners`.
//!
//! Two legs of 10 mm from rest to rest, 100 mm/s, 1000 mm/s², 20,000 mm/s³ on both axes, by angle and tolerance. Beside the
//! planned time: that of a reference which chooses path and speed together within the tolerance (see [`REFERENCE`]), and that of
//! a stop at the corner. Options behind `--`: `--turned DEGREES`, the first leg at this angle to X.

use motion::canon::{AXES, Call, Event, PathMode, Position, Source};
use motion::plan::{AxisLimits, PlanError, Settings, deviation, plan_offline};

const LEG_MM: f64 = 10.0;
const TOLERANCES_MM: [f64; 3] = [0.01, 0.05, 0.5];
/// By angle in degrees and tolerance, s, with the first leg along X. Reference figures, not computed here: those of a linear
/// programme over path and speed together, without margins. They are no bound: what it looked through is not known, and one of
/// the plans is faster.
const REFERENCE: [(f64, [f64; 3]); 5] = [
    (20.0, [0.455, 0.379, 0.344]),
    (45.0, [0.465, 0.426, 0.342]),
    (60.0, [0.471, 0.440, 0.360]),
    (90.0, [0.471, 0.447, 0.438]),
    (120.0, [0.457, 0.444, 0.414]),
];

fn main() -> Result<(), PlanError> {
    let mut turned = 0.0f64;
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        if name == "--turned" {
            turned = arguments.next().and_then(|x| x.parse().ok()).unwrap_or(turned);
        }
    }
    println!("degrees      P mm  reference s   stop s  planned s  over reference  off mm  missed mm");
    for (degrees, reference) in REFERENCE {
        let stop = corner(turned, degrees, 0.0)?;
        for (tolerance, reference) in TOLERANCES_MM.into_iter().zip(reference) {
            let planned = corner(turned, degrees, tolerance)?;
            let off = deviation(&planned.samples, &planned.ideal, tolerance);
            println!(
                "{degrees:7} {tolerance:9} {reference:11.3} {:8.4} {:10.4} {:18.3} {:7.4} {:10.4}",
                stop.motion_time_s,
                planned.motion_time_s,
                planned.motion_time_s / reference,
                off.off_mm,
                off.missed_mm
            );
        }
    }
    Ok(())
}

/// The plan of two legs; tolerance 0: a stop between.
fn corner(turned: f64, degrees: f64, tolerance: f64) -> Result<motion::plan::Offline, PlanError> {
    let axis = AxisLimits {
        velocity: 100.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
        travel: [-500.0, 500.0],
    };
    let along = |degrees: f64| {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        Position::xyz(LEG_MM * cos, LEG_MM * sin, 0.0)
    };
    let corner = along(turned);
    let leg = along(turned + degrees);
    let mode = if tolerance > 0.0 {
        PathMode::Continuous {
            tolerance_mm: Some(tolerance),
            naive_cam_tolerance_mm: None,
        }
    } else {
        PathMode::ExactStop
    };
    let calls = [
        Call::SetFeedRate {
            linear: 100.0,
            angular: 100.0,
        },
        Call::SetPathMode(mode),
        Call::StraightFeed { to: corner },
        Call::StraightFeed {
            to: Position::xyz(corner.0[0] + leg.0[0], corner.0[1] + leg.0[1], 0.0),
        },
    ];
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
    plan_offline(&events, Settings::new([Some(axis); AXES], 1e-3))
}
