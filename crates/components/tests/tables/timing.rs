//! Edges, delays, filters of switches, clocks.

use crate::rig::{T, table};

#[test]
fn time() {
    table(
        "edge",
        &[],
        T,
        "in 1 1 0 0 1 0\n in-edge 1\n > out 0 0 1 0 0 1\n > out-invert 1 1 0 1 1 0",
    );
    table(
        "edge",
        &[],
        T,
        "in 0 1 1 1 1\n in-edge 0\n out-width-ns 2500000\n > out 0 1 1 1 0",
    );
    table("edge", &[], T, "in 0 1 0\n both 1\n > out 0 1 1");
    table(
        "oneshot",
        &[],
        T,
        "in     1 0 1 1 1 1 1 0 1 0 1
         width  0.003
         reset  0 0 0 0 0 0 0 0 0 1 0
         > out  0 0 1 1 1 0 0 0 1 0 1
         > time-left 0 0 0.003 0.002 0.001 0 0 0 0.003 0 0.003",
    );
    table(
        "oneshot",
        &[],
        T,
        "in 0 1 0 1 0 1 0\n width 0.003\n retriggerable 0\n > out 0 1 1 1 0 1 1",
    );
    table(
        "oneshot",
        &[],
        T,
        "in 0 1 1 0 0\n width 0.001\n rising 0\n falling 1\n > out 0 0 0 1 0",
    );
    table(
        "timedelay",
        &[],
        1.0,
        "in 1 1 1 0 0 1 0 0 0\n on-delay 3\n off-delay 2\n > out 0 0 1 1 0 0 0 0 0\n > elapsed 1 2 3 1 2 1 1 1 1",
    );
    table(
        "ton",
        &[],
        0.01,
        "in 0 1 1 1 1 1 0 1 1 0 0 1\n pt 0.03\n > q 0 0 0 0 1 1 0 0 0 0 0 0\n > et 0 0.01 0.02 0.03 0.03 0.03 0 0.01 0.02 0 0 0.01",
    );
    table(
        "ton",
        &[],
        0.01,
        "in 0 1 1 1 1 0\n pt 0.025\n > q 0 0 0 0 1 0\n > et 0 0.01 0.02 0.03 0.03 0",
    );
    table("ton", &[], 0.01, "in 0 1 1 0\n pt 0\n > q 0 1 1 0");
    table(
        "tof",
        &[],
        0.01,
        "in 0 0 1 1 0 0 0 0 0 1 0 1\n pt 0.03\n > q 0 0 1 1 1 1 1 0 0 1 1 1\n > et 0.01 0.02 0 0 0.01 0.02 0.03 0.03 0.03 0 0.01 0",
    );
    table("tof", &[], 0.01, "in 0 1 0\n pt 0\n > q 0 1 0");
    table(
        "dbounce",
        &[],
        T,
        "in 1 1 1 1 0 0 0 1 0 0\n delay 2\n > out 0 0 1 1 1 1 0 0 0 0",
    );
    table(
        "debounce",
        &[("cfg", 2)],
        T,
        "0.in 1 1 1\n 1.in 1 0 1\n delay 2\n > 0.out 0 0 1\n > 1.out 0 0 0",
    );
    table(
        "toggle",
        &[],
        T,
        "in 1 1 0 0 1 1 1 0 0 1 0 0 1 1\n > out 0 0 0 0 0 1 1 1 1 1 1 1 1 0",
    );
    table(
        "blink",
        &[],
        0.25,
        "frequency 1\n duty 0.5\n enable 1 1 1 1 1 0 1\n > out 1 1 0 0 1 0 1",
    );
    table(
        "charge_pump",
        &[],
        T,
        "enable 1 1 1 1 0 1\n > out 1 0 1 0 0 1\n > out-2 0 1 1 0 0 0\n > out-4 0 0 0 1 0 1",
    );
    table(
        "time",
        &[],
        1800.0,
        "start 1 1 1 1 0 1\n pause 0 0 1 0 0 0\n > hours 0 1 1 1 1 0\n > minutes 30 0 0 30 30 30\n > seconds 0",
    );
}
