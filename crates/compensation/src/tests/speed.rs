//! How fast the stage is: `cargo test --release -p isocnc-motion compensation::tests::speed -- --ignored --nocapture`.

use super::*;
use std::time::Instant;

/// A wavy spiral outwards: turns 4 mm apart, of lines of about `step_mm`.
fn spiral(step_mm: f64, count: u32) -> Vec<Call> {
    let mut angle = 40.0f64;
    let point = |angle: f64| {
        let radius = 4.0 * angle / std::f64::consts::TAU + 0.3 * (9.0 * angle).sin();
        Position::xyz(radius * angle.cos(), radius * angle.sin(), 0.0)
    };
    (0..count)
        .map(|_| {
            angle += step_mm / (4.0 * angle / std::f64::consts::TAU);
            Call::StraightFeed { to: point(angle) }
        })
        .collect()
}

#[test]
#[ignore = "prints how fast it is"]
fn elements_per_second() {
    for (step_mm, radius_mm) in [(1.0, 1.0), (0.5, 1.0), (0.1, 1.0), (0.1, 0.3)] {
        for gouge in [Gouge::NeighboursOnly, Gouge::Error, Gouge::DropLoop] {
            let settings = Settings {
                gouge,
                ..Settings::default()
            };
            let calls = spiral(step_mm, 200_000);
            let mut compensator = Compensator::with_settings(settings);
            let mut out = Vec::with_capacity(400_000);
            let cutter = Cutter {
                side: Side::Right,
                radius_mm,
                orientation: 0,
            };
            // Along the spiral.
            let [from, to] = [0, 1].map(|i| end_of(&calls[i]).map_or([0.0; 2], |to| in_plane(to, Plane::Xy)));
            let back = scale(sub(from, to), 2.0 / step_mm);
            compensator.set_position(with_plane(Position::ZERO, Plane::Xy, add(from, back)));
            let start = Instant::now();
            let source = Source::default();
            let switch = Call::SetCutterCompensation(Some(cutter));
            let events = std::iter::once(switch).chain(calls).map(|call| Event { source, call });
            let mut result = Ok(());
            for event in events {
                result = result.and_then(|()| compensator.push(event, &mut out));
            }
            let result = result.and_then(|()| compensator.finish(&mut out));
            let rate = 2e5 / start.elapsed().as_secs_f64();
            println!(
                "{step_mm} mm lines, radius {radius_mm}, {gouge:?}: {rate:.0} elements/s, done: {}",
                result.is_ok()
            );
        }
    }
}
