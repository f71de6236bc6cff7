//! The PID controller.

use crate::rig::table;

#[test]
fn pid() {
    // Proportional with dead band: no jump at its edge. The error is that of the command before.
    table(
        "pid",
        &[],
        1.0,
        "enable 1\n command 3 3 3 2.5\n feedback 1 0 2.5 2.5\n pgain 2\n deadband 1\n > output 2 4 0 0\n > error 2 3 0.5 0.5",
    );
    table(
        "pid",
        &[],
        1.0,
        "enable 1\n command 0 5\n error-previous-target 1\n > error 0 0",
    );
    table(
        "pid",
        &[],
        1.0,
        "enable 1\n command 0 5\n error-previous-target 0\n > error 0 5",
    );
    // Integral: grows, is clamped, does not wind up against the output's limit, goes with `enable`.
    table(
        "pid",
        &[],
        0.5,
        "enable 1 1 1 1 0\n command 2\n pgain 0\n igain 1\n maxerrori 2.5\n > output 1 2 2.5 2.5 0",
    );
    table(
        "pid",
        &[],
        1.0,
        "enable 1\n command 2 2 2 -2 -2\n error-previous-target 0\n pgain 0\n igain 1\n maxoutput 3\n > output 2 3 3 2 0
         > saturated 0 1 1 0 0\n > saturated-s 0 1 2 0 0\n > saturated-count 0 1 2 0 0",
    );
    // Derivative of both, and feed forward of the command's derivatives, within their limits.
    table(
        "pid",
        &[],
        0.5,
        "enable 1\n pgain 0\n dgain 1\n command 0 1 1\n feedback 0 0 1\n maxerrord 1.5\n > output 0 1.5 -1.5",
    );
    table(
        "pid",
        &[],
        0.5,
        "enable 1\n pgain 0\n ff0 1\n ff1 10\n ff2 100\n ff3 1000\n command 0 1 1\n > output 0 8421 -16399",
    );
    table(
        "pid",
        &[],
        0.5,
        "enable 1\n pgain 0\n ff1 1\n maxcmdd 1.5\n command 0 1 0\n > output 0 1.5 -1.5",
    );
    table(
        "pid",
        &[],
        0.5,
        "enable 1\n pgain 0\n dgain 1\n command-deriv 3\n feedback-deriv 1\n bias 10\n > output 12",
    );
    // Each for itself.
    table(
        "pid",
        &[],
        0.5,
        "enable 1\n pgain 0\n dgain 1\n command-deriv 3\n feedback 0 1\n > output 3 1",
    );
    table(
        "pid",
        &[],
        0.5,
        "enable 1\n pgain 0\n dgain 1\n feedback-deriv 3\n command 0 1\n > output -3 -1",
    );
    // The limit of the integral holds while the output is at its limit, too.
    table(
        "pid",
        &[],
        1.0,
        "enable 1\n command 2\n error-previous-target 0\n pgain 0\n igain 1\n maxoutput 3\n maxerrori 0 0 1\n > output 2 3 1",
    );
    // Speeds go on over an index.
    table(
        "pid",
        &[],
        1.0,
        "enable 1\n pgain 0\n dgain 1\n index-enable 1 1 0 0\n command 0 2 -100 -98\n > output 0 2 2 2",
    );
    // An index makes both jump: neither derivative nor the command before count.
    table(
        "pid",
        &[],
        1.0,
        "enable 1\n dgain 1\n index-enable 1 0\n command 100 0\n feedback 100 1\n > output 0 -1",
    );
    table(
        "pid",
        &[],
        1.0,
        "enable 1\n command 1\n feedback 0 nan 0\n > output 1 0 1",
    );
}
