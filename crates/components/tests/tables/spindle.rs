//! Spindles, their gears and their test signals.

use crate::rig::{Rig, T, table};

#[test]
fn spindle() {
    table(
        "spindle_monitor",
        &[],
        T,
        "spindle-is-on 0 1 1 1 1 0 0\n spindle-command -100\n threshold 5\n spindle-feedback 0 0 -96 -97 -90 -90 -90
         > spindle-at-speed 0 0 1 1 1 1 0\n > spindle-underspeed 0 0 0 0 1 1 0",
    );
    // The other way round is too slow.
    table(
        "spindle_monitor",
        &[],
        T,
        "spindle-is-on 1\n spindle-command 1000\n threshold 5\n spindle-feedback 1000 1000 2000 -1000
         > spindle-at-speed 0 1 1 1\n > spindle-underspeed 0 0 0 1",
    );
    table(
        "gearchange",
        &[],
        T,
        "speed-in 500 -5 3000 nan\n sel 0 0 1 1\n min1 10\n max2 2000\n scale2 4\n reverse 1\n dir-in 1
         > speed-out 500 -10 500 500\n > dir-out 1 1 0 0",
    );
    table(
        "orient",
        &[],
        T,
        "enable 0 1\n position 3.6\n angle 90\n mode 0\n > command 0 3.25\n > poserr 0 126",
    );
    table(
        "orient",
        &[],
        T,
        "enable 0 1\n position 3.6\n angle 90\n mode 1\n > command 0 4.25",
    );
    table(
        "orient",
        &[],
        T,
        "enable 0 1\n position 3.1\n angle 90\n mode 2\n > command 0 2.25",
    );
    // Enabled from the start; another mode leaves the target where it was.
    table(
        "orient",
        &[],
        T,
        "enable 1 0 1\n position 3.6\n angle 90\n mode 0 3 3\n > command 3.25",
    );
    table(
        "sim_spindle",
        &[],
        0.5,
        "velocity-cmd 90\n scale 0.016666666666666666\n index-enable 0 1 1 1 0\n > position-fb 0.75 0.5 1.25 2 2.75\n > indexed 0 1 1 1 0",
    );
    table(
        "siggen",
        &[],
        0.125,
        "frequency 2\n amplitude 3\n offset 1\n > sine 4 1 -2 1\n > cosine 1 -2 1 4\n > square -2 -2 4 -2\n > triangle 1 -2 1 4
         > sawtooth -0.5 1 2.5 -2\n > clock 0 0 1 0",
    );
}

#[test]
fn a_spindle_is_oriented_after_more_than_100_calls_at_its_angle() {
    let mut rig = Rig::new("orient", &[]);
    rig.set("position", 0.2505);
    rig.set("angle", 90.0);
    rig.update(T);
    rig.set("enable", true);
    let calls = (1..).find(|_| {
        rig.update(T);
        rig.bit("is-oriented")
    });
    assert_eq!(calls, Some(101));
}
