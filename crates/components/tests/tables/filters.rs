//! Filters, derivatives and integrals.

use crate::rig::{Rig, T, table};

#[test]
fn filters() {
    table(
        "lowpass",
        &[],
        T,
        "in 8 8 nan 8 1\n load 0 0 0 0 1\n gain 0.5\n > out 4 6 6 7 1",
    );
    table("ilowpass", &[], T, "in 1 1 0\n scale 1000\n > out 500 750 375");
    // A hand wheel goes on beyond the end of its counts.
    table(
        "ilowpass",
        &[],
        T,
        "in 2097151 2097152 -2097153\n scale 1024\n gain 1\n > out 2147482624 -2147483648 2147482624",
    );
    table("ddt", &[], 0.5, "in 3 4 4 2\n > out 0 2 0 -4");
    table(
        "integ",
        &[],
        0.5,
        "in 4 4 nan 4 4\n gain 2\n max 7\n reset 0 0 0 0 1\n > out 4 7 7 7 0",
    );
    table(
        "minmax",
        &[],
        T,
        "in 3 5 nan -1 2\n reset 0 0 0 0 1\n > max 3 5 5 5 2\n > min 0 0 0 -1 2",
    );
    table(
        "probe_filter",
        &[],
        T,
        "in 0 1 0 1 1 0 0 0 0 0\n delay 2\n dead-time 0.003\n > out 0 0 0 0 1 1 1 0 0 0\n > bounces 0 0 1 1 1 1 1 1 1 1",
    );
    // Own coefficients: the mean of two values.
    table(
        "biquad",
        &[],
        T,
        "in 2 4 4 8\n type 0\n n0 0.5\n n1 0.5\n enable 0 1 1 1\n > out 2 2 4 6\n > valid 0 1 1 1",
    );
    table(
        "biquad",
        &[],
        T,
        "in 2\n type 1\n f0 501\n enable 1\n > out 2\n > valid 0",
    );
}

#[test]
fn a_notch_takes_out_its_frequency_and_leaves_direct_current() {
    for (frequency, gain) in [(50.0, 0.0), (0.0, 1.0)] {
        let mut rig = Rig::new("biquad", &[]);
        rig.set("type", 2u32);
        rig.set("f0", 50.0);
        rig.set("enable", true);
        let mut peak = 0f64;
        for call in 0..2000 {
            let phase = std::f64::consts::TAU * frequency * f64::from(call) * T;
            rig.set("in", libm::cos(phase));
            rig.update(T);
            if call > 1000 {
                peak = peak.max(rig.number("out").abs());
            }
        }
        assert!((peak - gain).abs() < 1e-6, "{frequency} Hz: {peak}");
    }
}
