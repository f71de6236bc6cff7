//! Sums, products and curves.

use super::{about, model, pins, stateless};

#[test]
fn arithmetic() {
    stateless("sum2", &[], |r| {
        let terms = [("in0", "gain0"), ("in1", "gain1")].map(|(a, b)| r.number(a) * r.number(b));
        about(r.number("out") - r.number("offset"), terms.iter().sum());
    });
    stateless("mult2", &[], |r| {
        about(r.number("out"), r.number("in1") * r.number("in0"))
    });
    model::<()>("div2", &[], &[("deadband", 0.1, 0.1)], |_, r| {
        let (a, b) = (r.number("in0"), r.number("in1"));
        if b.abs() >= 0.1 {
            about(r.number("out") * b, a);
        } else {
            about(r.number("out").abs() * 0.1, a.abs());
        }
    });
    stateless("invert", &[], |r| {
        let dead = r.number("in") == 0.0 || r.number("in").abs() < r.number("deadband");
        about(r.number("out") * r.number("in"), if dead { 0.0 } else { 1.0 });
    });
    for kind in ["abs", "abs_s32"] {
        stateless(kind, &[], |r| {
            let value = r.number("in");
            assert_eq!(r.number("out"), value.max(-value));
            assert_eq!(
                (r.bit("is-negative"), r.bit("is-positive"), r.bit("sign")),
                (value < 0.0, value > 0.0, value < 0.0)
            );
        });
    }
    stateless("hypot", &[], |r| {
        let squares: f64 = ["in0", "in1", "in2"].iter().map(|pin| r.number(pin).powi(2)).sum();
        about(r.number("out").powi(2), squares);
    });
    stateless("scale", &[], |r| {
        about(r.number("out"), r.number("offset") + r.number("gain") * r.number("in"))
    });
    stateless("offset", &[], |r| {
        about(r.number("out") - r.number("in"), r.number("offset"));
        about(r.number("fb-in") - r.number("fb-out"), r.number("offset"));
    });
    model::<()>("weighted_sum", &[("personality", 5)], &[("hold", 0.0, 0.0)], |_, r| {
        let bits = pins(r, 5, |n| format!("bit.{n}.in"));
        let weights = pins(r, 5, |n| format!("bit.{n}.weight"));
        let sum: f64 = bits.iter().zip(&weights).map(|(bit, weight)| bit * weight).sum();
        assert_eq!(r.number("sum"), sum + r.number("offset"));
    });
    stateless("scaled_s32_sums", &[], |r| {
        let sum: f64 = (0..4)
            .map(|n| r.number(&format!("in{n}")) * r.number(&format!("scale{n}")))
            .sum();
        about(r.number("out-f"), sum);
        assert_eq!(r.number("out-s"), r.number("out-f").trunc());
    });
    stateless("blend", &[], |r| {
        let (one, zero, select) = (r.number("in1"), r.number("in2"), r.number("select"));
        if r.bit("open") || (0.0..=1.0).contains(&select) {
            about(r.number("out"), zero + (one - zero) * select);
        } else {
            about(r.number("out"), if select > 1.0 { one } else { zero });
        }
    });
    stateless("feedcomp", &[], |r| {
        let (vel, feed) = (r.number("vel"), r.number("feed"));
        let factor = match (r.bit("enable"), feed) {
            (false, _) => 1.0,
            (true, 0.0) => 0.0,
            (true, feed) => vel / feed,
        };
        about(r.number("out"), r.number("in") * factor);
    });
    let points: Vec<(String, f64, f64)> = (0..5)
        .map(|n| (format!("x-val-{n:02}"), f64::from(n * n), f64::from(n * n)))
        .collect();
    let ranges: Vec<(&str, f64, f64)> = points
        .iter()
        .map(|(name, low, high)| (name.as_str(), *low, *high))
        .chain([("in", -3.0, 20.0)])
        .collect();
    model::<()>("lincurve", &[("personality", 5)], &ranges, |_, r| {
        let (x, y) = (
            pins(r, 5, |n| format!("x-val-{n:02}")),
            pins(r, 5, |n| format!("y-val-{n:02}")),
        );
        // As a sum of hats.
        let at = r.number("in").clamp(x[0], x[4]);
        let hat = |n: usize| {
            let left = if n == 0 {
                1.0
            } else {
                (at - x[n - 1]) / (x[n] - x[n - 1])
            };
            let right = if n == 4 {
                1.0
            } else {
                (x[n + 1] - at) / (x[n + 1] - x[n])
            };
            left.min(right).clamp(0.0, 1.0)
        };
        about(r.number("out"), (0..5).map(|n| y[n] * hat(n)).sum());
    });
    model::<()>("led_dim", &[], &[("in", 0.0, 1.0)], |_, r| {
        // The inverse law: L* of the luminance.
        let luminance = r.number("out");
        let brightness = if luminance <= 0.008856 {
            9.033 * luminance
        } else {
            1.16 * libm::cbrt(luminance) - 0.16
        };
        assert!((brightness - r.number("in")).abs() < 1e-4);
    });
}
