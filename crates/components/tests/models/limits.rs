//! Limits and comparisons.

use super::{CALLS, about, model, stateless};
use crate::rig::T;

#[test]
fn limits_and_comparisons() {
    let band = [("min", -4.0, -1.0), ("max", 1.0, 4.0)];
    model::<()>("limit1", &[], &band, |_, r| {
        assert_eq!(r.number("out"), r.number("in").clamp(r.number("min"), r.number("max")));
    });
    model::<f64>(
        "limit2",
        &[],
        &[("min", -4.0, -4.0), ("max", 4.0, 4.0), ("maxv", 500.0, 500.0)],
        |last, r| {
            let target = r.number("in").clamp(-4.0, 4.0);
            let out = r.number("out");
            let most = if r.bit("load") { 100.0 } else { 0.5 };
            // As near to the target as it may come.
            let left = (target - *last).abs() - most;
            about((target - out).abs(), left.max(0.0));
            *last = out;
        },
    );
    model::<[f64; 2]>(
        "limit3",
        &[],
        &[
            ("min", -4.0, -4.0),
            ("max", 4.0, 4.0),
            ("maxv", 800.0, 800.0),
            ("maxa", 1e5, 1e5),
            ("load", 0.0, 0.0),
        ],
        |[position, velocity], r| {
            let out = r.number("out");
            let speed = (out - *position) / T;
            assert!((-4.0 - 1e-9..=4.0 + 1e-9).contains(&out), "{out}");
            assert!(speed.abs() <= 800.0 * (1.0 + 1e-9), "{speed}");
            assert!(
                (speed - *velocity).abs() <= 1e5 * T * (1.0 + 1e-6),
                "{speed} {velocity}"
            );
            (*position, *velocity) = (out, speed);
        },
    );
    stateless("deadzone", &[], |r| {
        let half = r.number("threshold") / 2.0;
        let (value, center) = (r.number("in"), r.number("center"));
        let out = r.number("out");
        let inside = (value - center).abs() <= half;
        if inside {
            assert_eq!(out, center);
        } else if half >= 0.0 {
            about((out - value).abs(), half);
            assert!((out - center) * (value - center) >= 0.0);
        }
    });
    model::<bool>("comp", &[], &[("hyst", 2.0, 2.0)], |out, r| {
        let above = r.number("in1") - r.number("in0");
        if above.abs() > 1.0 {
            *out = above > 0.0;
        }
        assert_eq!((r.bit("out"), r.bit("equal")), (*out, above.abs() <= 1.0));
    });
    model::<()>("wcomp", &[], &band, |_, r| {
        // Sorted into three, and each of them once.
        assert_eq!(
            [r.bit("under"), r.bit("out"), r.bit("over")]
                .iter()
                .filter(|bit| **bit)
                .count(),
            1
        );
        assert_eq!(
            r.bit("out"),
            r.number("in") > r.number("min") && r.number("in") < r.number("max")
        );
        assert_eq!(r.bit("over"), r.number("in") >= r.number("max"));
    });
    stateless("near", &[], |r| {
        let (a, b, scale) = (r.number("in1"), r.number("in2"), r.number("scale"));
        let ratio = b / a;
        let by_factor =
            scale > 1.0 && (a == 0.0 && b == 0.0 || a != 0.0 && ratio >= 1.0 / scale - 1e-12 && ratio <= scale + 1e-12);
        let by_difference = a.max(b) - a.min(b) <= r.number("difference");
        assert_eq!(r.bit("out"), by_factor || by_difference);
    });
    for home in [3.0, -3.0] {
        model::<bool>(
            "sim_home_switch",
            &[],
            &[("home-pos", home, home), ("hysteresis", 1.0, 1.0)],
            |closed, r| {
                let outward = r.number("cur-pos") * home / 3.0;
                *closed = outward >= 3.0 || *closed && outward > 2.0;
                assert_eq!(r.bit("home-sw"), *closed);
            },
        );
    }
}

#[test]
fn a_limited_number_comes_to_rest_where_its_input_does() {
    for (maxv, maxa) in [(50.0, 1e4), (900.0, 1e4), (900.0, 9e4), (123.4, 33_333.0), (1e20, 1e7)] {
        let settings = [
            ("in", 3.0, 3.0),
            ("maxv", maxv, maxv),
            ("maxa", maxa, maxa),
            ("load", 0.0, 0.0),
            ("enable", 1.0, 1.0),
            ("min", -20.0, -20.0),
            ("max", 20.0, 20.0),
        ];
        model::<Vec<f64>>("limit3", &[], &settings, |seen, r| {
            seen.push(r.number("out"));
            assert!(r.number("out") <= 3.0 + 1e-9, "{seen:?}");
            assert!(seen.len() < CALLS || (r.number("out") - 3.0).abs() < 1e-6, "{seen:?}");
        });
    }
}
