//! Sums, products and curves.

use crate::rig::{T, table};

#[test]
fn arithmetic() {
    table(
        "sum2",
        &[],
        T,
        "in0 2\n in1 3\n gain0 1 10\n offset 0 0.5\n > out 5 23.5",
    );
    table("mult2", &[], T, "in0 2 -2\n in1 3 nan\n > out 6 nan");
    table(
        "div2",
        &[],
        T,
        "in0 6 6 6\n in1 3 0.1 -0.1\n deadband 0.5\n > out 2 12 -12",
    );
    table("div2", &[], T, "in0 1\n > out 1e12");
    table(
        "invert",
        &[],
        T,
        "in 4 0 0.1 -0.5\n deadband 0 0 0.2 0.2\n > out 0.25 0 0 -2",
    );
    table(
        "abs",
        &[],
        T,
        "in 2 -2 0\n > out 2 2 0\n > sign 0 1 0\n > is-positive 1 0 0\n > is-negative 0 1 0",
    );
    table(
        "abs_s32",
        &[],
        T,
        "in 2 -2147483648\n > out 2 2147483647\n > sign 0 1\n > is-positive 1 0",
    );
    table("hypot", &[], T, "in0 2\n in1 3\n in2 6\n > out 7");
    table("scale", &[], T, "in 3\n gain 0 2\n offset 1\n > out 1 7");
    table("offset", &[], T, "offset 2\n in 10\n fb-in 12\n > out 12\n > fb-out 10");
    table(
        "weighted_sum",
        &[("personality", 3)],
        T,
        "bit.0.in 1 1\n bit.2.in 1 1\n bit.2.weight 4 40\n offset 100\n hold 0 1\n > sum 105 105",
    );
    table(
        "scaled_s32_sums",
        &[],
        T,
        "in0 3\n in1 -1\n scale1 0.5\n in3 2\n scale3 10\n > out-f 22.5\n > out-s 22",
    );
    table(
        "blend",
        &[],
        T,
        "in1 10\n in2 20\n select 0 1 0.25 2 2\n open 0 0 0 0 1\n > out 20 10 17.5 10 0",
    );
    table(
        "feedcomp",
        &[],
        T,
        "in 8\n vel 5\n feed 10 10 0\n enable 0 1 1\n > out 8 4 0",
    );
    table(
        "lincurve",
        &[("personality", 3)],
        T,
        "x-val-00 -1\n y-val-00 5\n x-val-01 1\n y-val-01 15\n x-val-02 2\n y-val-02 0
         in -9 -1 0 1 1.5 9 nan\n > out 5 5 10 15 7.5 0 nan",
    );
    table(
        "led_dim",
        &[],
        T,
        "in 0 0.08 0.42 1 2\n > out 0 0.008856415365880 0.125 1 1",
    );
}
