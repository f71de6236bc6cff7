//! Filters, derivatives and integrals.

use super::{Past, about, model};
use crate::rig::T;

#[test]
fn filters() {
    // As the sum of all inputs, each with what time has left of it.
    model::<Vec<f64>>("lowpass", &[], &[("gain", 0.2, 0.2), ("load", 0.0, 0.0)], |seen, r| {
        seen.push(r.number("in"));
        let weights = (0..).map(|age| 0.2 * 0.8f64.powi(age));
        about(
            r.number("out"),
            seen.iter()
                .rev()
                .zip(weights)
                .map(|(value, weight)| value * weight)
                .sum(),
        );
    });
    model::<Vec<f64>>(
        "ilowpass",
        &[],
        &[("gain", 0.25, 0.25), ("scale", 100.0, 100.0)],
        |seen, r| {
            seen.push(r.number("in"));
            let weights = (0..).map(|age| 0.25 * 0.75f64.powi(age));
            let value: f64 = seen
                .iter()
                .rev()
                .zip(weights)
                .map(|(value, weight)| value * weight)
                .sum();
            assert!((r.number("out") - value * 100.0).abs() <= 0.5 + 1e-6);
        },
    );
    // Direct form I, with coefficients of a stable filter.
    let own = [
        ("type", 0.0, 0.0),
        ("enable", 1.0, 1.0),
        ("n0", 0.5, 0.5),
        ("n1", -0.25, -0.25),
        ("n2", 0.125, 0.125),
        ("d1", -0.5, -0.5),
        ("d2", 0.25, 0.25),
    ];
    model::<(Vec<f64>, Vec<f64>)>("biquad", &[], &own, |(x, y), r| {
        x.push(r.number("in"));
        let at = |values: &[f64], age: usize| values.iter().rev().nth(age).copied().unwrap_or(0.0);
        let out = 0.5 * at(x, 0) - 0.25 * at(x, 1) + 0.125 * at(x, 2) + 0.5 * at(y, 0) - 0.25 * at(y, 1);
        y.push(out);
        about(r.number("out"), out);
    });
    model::<Vec<f64>>("ddt", &[], &[], |seen, r| {
        seen.push(r.number("in"));
        let before = seen.iter().rev().nth(1).unwrap_or(&seen[0]);
        about(r.number("out") * T + before, r.number("in"));
    });
    model::<f64>("integ", &[], &[("min", -0.05, -0.05), ("max", 0.05, 0.05)], |sum, r| {
        *sum = if r.bit("reset") {
            0.0
        } else {
            (*sum + r.number("in") * r.number("gain") * T).clamp(-0.05, 0.05)
        };
        about(r.number("out"), *sum);
    });
    model::<Vec<f64>>("minmax", &[], &[("reset", -1.0, 0.6)], |seen, r| {
        // From 0, until it is reset.
        match r.bit("reset") {
            true => seen.clear(),
            false if seen.is_empty() => seen.push(0.0),
            false => {}
        }
        seen.push(r.number("in"));
        assert_eq!(r.number("max"), seen.iter().copied().fold(f64::MIN, f64::max));
        assert_eq!(r.number("min"), seen.iter().copied().fold(f64::MAX, f64::min));
    });
    let filter = [("enable", 1.0, 1.0), ("delay", 3.0, 3.0), ("dead-time", 0.0, 0.0)];
    model::<(Past, bool)>("probe_filter", &[], &filter, |(past, out), r| {
        past.push(r.bit("in"));
        if past.lasts() >= 3 {
            *out = past.now();
        }
        assert_eq!(r.bit("out"), *out);
    });
    let held = [("enable", 1.0, 1.0), ("delay", 1.0, 1.0), ("dead-time", 0.005, 0.005)];
    model::<Past>("probe_filter", &[], &held, |out, r| {
        let before = out.seen.last().copied();
        out.push(r.bit("out"));
        // A change comes five calls behind the last one at the earliest.
        let changes: Vec<usize> = (1..out.seen.len())
            .filter(|at| out.seen[*at] != out.seen[at - 1])
            .collect();
        assert!(
            changes.windows(2).all(|pair| pair[1] - pair[0] >= 5),
            "{changes:?} {before:?}"
        );
    });
}
