//! Limits and comparisons.

use crate::rig::{T, table};

#[test]
fn limits() {
    table(
        "limit1",
        &[],
        T,
        "in 5 -5 0.5 nan 3\n min -1\n max 1\n > out 1 -1 0.5 0.5 1",
    );
    // The upper limit is the last word.
    table("limit1", &[], T, "in 5\n min 3\n max 1\n > out 1");
    table(
        "limit2",
        &[],
        0.5,
        "in 10 10 -10 -10 nan\n max 9\n maxv 4\n load 0 0 0 1 0\n > out 2 4 2 -10 -10",
    );
    table("limit3", &[], 1.0, "in 9\n maxv 3\n maxa 1\n > out 1 3 6 8 9 9 9 9");
    table(
        "limit3",
        &[],
        1.0,
        "in 6 6 6 6 6\n load 1 0 0 0 0\n enable 1 0 0 0 0\n maxa 1\n > out 6 5 3 1 0",
    );
    table(
        "deadzone",
        &[],
        T,
        "in 3 0.4 -3 nan\n center 0 0 0 0\n > out 2.5 0 -2.5 nan",
    );
    table(
        "comp",
        &[],
        T,
        "in0 5\n in1 5 5.4 5.6 4.6 4.4 nan\n hyst 1\n > out 0 0 1 1 0 0\n > equal 1 1 0 1 0 0",
    );
    table(
        "wcomp",
        &[],
        T,
        "in 1 2 3 4 5 nan\n min 2\n max 4\n > out 0 0 1 0 0 0\n > under 1 1 0 0 0 0\n > over 0 0 0 1 1 0",
    );
    table(
        "near",
        &[],
        T,
        "in1 100 100 100 -100 100\n in2 101 99 103 -101 nan\n scale 1.02\n > out 1 1 0 1 0",
    );
    table("near", &[], T, "in1 1\n in2 1.5 1.6 1\n difference 0.5\n > out 1 0 1");
    table(
        "sim_home_switch",
        &[],
        T,
        "cur-pos 0 1 0.95 0.9 2\n > home-sw 0 1 1 0 1",
    );
    table(
        "sim_home_switch",
        &[],
        T,
        "home-pos -1\n cur-pos 0 -1 -0.95 -0.9\n > home-sw 0 1 1 0",
    );
}
