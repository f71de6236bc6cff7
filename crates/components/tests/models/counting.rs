//! Counters, encoders and hand wheels.

use super::{Past, about, model};
use crate::rig::T;

#[test]
fn counting() {
    model::<(Past, Past, i64)>(
        "updown",
        &[],
        &[("min", -3.0, -3.0), ("max", 3.0, 3.0), ("reset", -1.0, 0.6)],
        |(up, down, count), r| {
            up.push(r.bit("countup"));
            down.push(r.bit("countdown"));
            *count += i64::from(up.rose()) - i64::from(down.rose());
            if r.bit("reset") {
                *count = 0;
            }
            if r.bit("wrap") {
                *count = if *count > 3 {
                    -3
                } else if *count < -3 {
                    3
                } else {
                    *count
                };
            } else if r.bit("clamp") {
                *count = (*count).clamp(-3, 3);
            }
            assert_eq!(r.number("count") as i64, *count);
        },
    );
    model::<Past>(
        "counter",
        &[],
        &[
            ("position-scale", 4.0, 4.0),
            ("reset", 0.0, 0.0),
            ("index-enable", 0.0, 0.0),
        ],
        |past, r| {
            past.push(r.bit("phase-a"));
            let rises = past.seen.windows(2).filter(|pair| !pair[0] && pair[1]).count();
            assert_eq!(r.number("counts"), rises as f64);
            about(r.number("position") * 4.0, rises as f64);
        },
    );
    // Legal steps only: as the place on a circle of four.
    let settings = [
        ("index-enable", 0.0, 0.0),
        ("reset", 0.0, 0.0),
        ("x4-mode", 1.0, 1.0),
        ("missing-teeth", 0.0, 0.0),
        ("counter-mode", 0.0, 0.0),
        ("position-scale", 2.0, 2.0),
    ];
    model::<Vec<usize>>("encoder", &[], &settings, |seen, r| {
        let place = [(false, false), (true, false), (true, true), (false, true)];
        seen.push(
            place
                .iter()
                .position(|phases| *phases == (r.bit("phase-a"), r.bit("phase-b")))
                .unwrap(),
        );
        let step = |pair: &[usize]| match (pair[1] + 4 - pair[0]) % 4 {
            1 => 1.0,
            3 => -1.0,
            _ => 0.0,
        };
        assert_eq!(r.number("counts"), seen.windows(2).map(step).sum::<f64>());
        about(r.number("velocity-rpm"), r.number("velocity") * 60.0);
        assert!((r.number("position-interpolated") - r.number("position")).abs() <= 0.5 + 1e-9);
    });
    model::<(Option<f64>, f64)>(
        "knob2float",
        &[],
        &[("min-out", -2.0, -2.0), ("max-out", 2.0, 2.0), ("scale", 0.1, 0.1)],
        |(last, out), r| {
            let turned = r.number("counts") - last.unwrap_or(r.number("counts"));
            *last = Some(r.number("counts"));
            if r.bit("enable") {
                *out = (*out + turned * 0.1).clamp(-2.0, 2.0);
            }
            about(r.number("out"), *out);
        },
    );
    model::<Vec<[f64; 2]>>(
        "hand_wheel",
        &[("personality", 3)],
        &[("axis", -1.0, 3.0), ("step", 0.0, 4.0)],
        |seen, r| {
            seen.push([r.number("axis"), r.number("step")]);
            let settled = seen.len() > 1 && seen[seen.len() - 1] == seen[seen.len() - 2];
            for axis in 0..3 {
                let expected = r.bit("enable") && settled && r.number("axis") == f64::from(axis);
                assert_eq!(r.bit(&format!("jog-enable-{axis}")), expected);
            }
            let step = if r.number("step") < 4.0 { r.number("step") } else { 0.0 };
            assert_eq!(r.number("jog-scale"), r.number(&format!("step-size-{step}")));
            assert_eq!(r.number("jog-counts"), r.number("counts"));
        },
    );
}

#[test]
fn a_simulated_encoder_counts_its_speed() {
    let settings = [("ppr", 25.0, 25.0), ("scale", 1.0, 1.0), ("speed", -9.0, 9.0)];
    model::<(f64, f64)>("sim_encoder", &[], &settings, |(turned, a_call), r| {
        *turned += *a_call;
        *a_call = r.number("speed") * 100.0 * T;
        assert!((r.number("rawcounts") - *turned).abs() <= 1.0);
        let place = (r.number("rawcounts") as i32).rem_euclid(100);
        assert_eq!(r.bit("phase-z"), place == 0);
        assert_eq!(
            (r.bit("phase-a"), r.bit("phase-b")),
            (place % 4 < 2, (1..=2).contains(&(place % 4)))
        );
    });
}
