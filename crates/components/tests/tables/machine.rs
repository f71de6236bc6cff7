//! Gantries, compensation, joysticks and tool carousels.

use crate::rig::{T, table};

#[test]
fn machine() {
    table(
        "gantry",
        &[],
        T,
        "search-vel -1\n position-cmd 0 -1 -2 -3 -2 -1\n joint.00.pos-fb 0 -1 -2 -2 -1 0\n joint.01.pos-fb 0 -1 -2 -3 -2 -1
         joint.00.home 0 0 0 1 1 0\n joint.01.home 0 0 0 0 1 0
         > joint.00.pos-cmd 0 -1 -2 -2 -1 0\n > joint.01.pos-cmd 0 -1 -2 -3 -2 -1
         > joint.00.offset 0 0 0 -1 -1 -1\n > home 0 0 0 0 1 0\n > limit 0 0 0 1 1 0\n > position-fb 0 -1 -2 -3 -2 -1",
    );
    table(
        "thermal_compensation",
        &[],
        1.0,
        "temperature 30 30 30 nan 30\n coefficient 0.00001\n position 500\n max 0.045\n maxv 0.02\n enable 1 1 1 1 0
         > offset -0.02 -0.04 -0.045 -0.045 -0.025\n > limited 1 1 1 1 0",
    );
    table(
        "joyhandle",
        &[],
        T,
        "in 0 0.5 -0.5 1 7\n scale 4\n offset 0\n > out 0 1 -1 4 4",
    );
    table(
        "joyhandle",
        &[],
        T,
        "in 0.1 0.6 1\n deadband 0.2\n power 1\n scale 4\n offset 1\n > out 0 3 5",
    );
    table("joyhandle", &[], T, "in 0.5\n inverse 1\n > out 0.75");
    table(
        "carousel",
        &[("pockets", 8), ("encoding", 1)],
        T,
        "pocket-number 3\n enable 0 1 1 1 1 1 0\n sense-0 1 1 0 0 1 1 1\n sense-1 0 0 1 1 1 1 1\n sense-2 0\n rev-pulse 0.001
         fwd-dc 2\n rev-dc -1\n hold-dc 0.5
         > current-position 1 1 2 2 3 3 3\n > motor-fwd 0 1 1 1 0 0 0\n > motor-rev 0 0 0 0 1 0 0\n > ready 0 0 0 0 0 1 0
         > motor-vel 0.5 2 2 2 -1 0.5 0.5\n > active 0 1 1 1 1 0 0\n > homed 1",
    );
    // The shorter way: from 1 back to 7, which is 15 modulo 8.
    table(
        "carousel",
        &[("pockets", 8), ("encoding", 3), ("num_sense", 8)],
        T,
        "pocket-number 15\n enable 0 1 1 1\n sense-0 1 1 0 0\n sense-7 0 0 1 0\n sense-6 0 0 0 1
         > motor-rev 0 1 1 0\n > ready 0 0 0 1\n > current-position 1 1 8 7",
    );
    table(
        "carousel",
        &[("pockets", 4), ("encoding", 4), ("num_sense", 2), ("dir", 1)],
        T,
        "pocket-number 2\n enable 0 1 1 1 1 1\n sense-0 0 0 0 1 0 0\n sense-1 0 1 0 1 0 1
         > homed 0 0 0 1 1 1\n > motor-fwd 0 1 1 1 1 0\n > current-position 0 0 0 1 1 2\n > ready 0 0 0 0 0 1",
    );
    // It coasts past pocket 3, comes back onto its sensor and off it, and goes slowly forward onto the edge.
    table(
        "carousel",
        &[("pockets", 8), ("encoding", 3), ("num_sense", 8)],
        T,
        "pocket-number 3\n align-dc 0.1\n decel-time 0.002\n fwd-dc 2\n hold-dc 0.5\n enable 0 1 1 1 1 1 1 1 1 0
         sense-0 1 1 0 0 0 0 0 0 0 0\n sense-2 0 0 1 0 0 1 0 0 1 1
         > motor-vel 0.5 2 0 0 -0.1 -0.1 0.1 0.1 0.5 0.5\n > motor-fwd 0 1 0 0 0 0 1 1 0 0\n > motor-rev 0 0 0 0 1 1 0 0 0 0
         > active 0 1 1 1 1 1 1 1 0 0\n > ready 0 0 0 0 0 0 0 0 1 0\n > current-position 1 1 3 3 3 3 3 3 3 3",
    );
    // From turning backward it goes on off the sensor; the pulses of an aligning move count no pocket.
    table(
        "carousel",
        &[("pockets", 6), ("encoding", 4), ("num_sense", 2)],
        T,
        "pocket-number 6\n align-dc 0.1\n enable 0 1 1 1 1 1 1\n sense-0 1 1 0 0 0 0 0\n sense-1 1 1 0 1 1 0 1
         > motor-rev 0 1 1 0 1 0 0\n > motor-fwd 0 0 0 0 0 1 0\n > current-position 1 1 1 6 6 6 6\n > ready 0 0 0 0 0 0 1",
    );
    table(
        "carousel",
        &[("pockets", 6), ("num_sense", 3)],
        T,
        "sense-0 1 1 0\n sense-1 1 0 0\n sense-2 0 1 0\n parity 0\n > current-position 2 6 6\n > parity-error 0 0 0",
    );
    // From 7 to 8 the four bits change a call apart: 15, 14, 12, 8. Pocket 12 passes by in one call, and is none.
    table(
        "carousel",
        &[("pockets", 16), ("encoding", 1)],
        T,
        "pocket-number 12\n debounce 1\n enable 0 1 1 1 1 1 1 1 1\n sense-0 1 1 1 0 0 0 0 0 0\n sense-1 1 1 1 1 0 0 0 0 0
         sense-2 1 1 1 1 1 0 0 1 1\n sense-3 0 0 1 1 1 1 1 1 1
         > current-position 7 7 15 14 12 8 8 12 12\n > motor-fwd 0 1 1 1 1 1 1 1 0\n > ready 0 0 0 0 0 0 0 0 1",
    );
    // Sensors that are no code have no parity; without a strobe nothing is said of it.
    table(
        "carousel",
        &[("encoding", 3), ("num_sense", 8)],
        T,
        "sense-0 1 0\n sense-1 0 1\n parity 0 1\n > parity-error 0 1",
    );
    table("carousel", &[], T, "sense-0 1\n strobe 0 1\n > parity-error 0 1");
    // What was forgotten is sought again; a jog that knows no pocket seeks it, too.
    table(
        "carousel",
        &[("pockets", 4), ("encoding", 4), ("num_sense", 2)],
        T,
        "sense-0 1 0 0 0 1 0 0\n sense-1 1 0 0 0 1 0 1\n unhome 0 0 1 1 1 1 1\n jog-fwd 0 0 0 1 0 1 1
         > homed 1 1 0 0 1 1 1\n > motor-fwd 0 0 0 1 0 1 0\n > current-position 1 1 1 1 1 1 2",
    );
}
