//! The PID controller.

use super::{about, model};
use crate::rig::T;

#[test]
fn pid() {
    let settings = [
        ("enable", 1.0, 1.0),
        ("deadband", 0.0, 0.0),
        ("maxerror", 0.0, 0.0),
        ("maxerrori", 0.0, 0.0),
        ("maxerrord", 0.0, 0.0),
        ("maxcmdd", 0.0, 0.0),
        ("maxcmddd", 0.0, 0.0),
        ("maxcmdddd", 0.0, 0.0),
        ("maxoutput", 0.0, 0.0),
        ("index-enable", 0.0, 0.0),
        ("error-previous-target", 0.0, 0.0),
    ];
    // Without limits: the textbook sum over all that was.
    model::<Vec<[f64; 2]>>("pid", &[], &settings, |seen, r| {
        if seen.is_empty() {
            // What was before the first call is as in it.
            seen.extend([[r.number("command"), r.number("feedback")]; 3]);
        }
        seen.push([r.number("command"), r.number("feedback")]);
        let at = |age: usize| seen[seen.len() - 1 - age];
        let error = at(0)[0] - at(0)[1];
        let integral: f64 = seen[3..]
            .iter()
            .map(|[command, feedback]| (command - feedback) * T)
            .sum();
        let c = [0, 1, 2, 3].map(|age| at(age)[0]);
        let speed = (c[0] - c[1]) / T;
        let acceleration = (c[0] - 2.0 * c[1] + c[2]) / (T * T);
        let jerk = (c[0] - 3.0 * c[1] + 3.0 * c[2] - c[3]) / (T * T * T);
        let derivative = speed - (at(0)[1] - at(1)[1]) / T;
        let terms = [
            ("pgain", error),
            ("igain", integral),
            ("dgain", derivative),
            ("ff0", c[0]),
            ("ff1", speed),
            ("ff2", acceleration),
            ("ff3", jerk),
            ("bias", 1.0),
        ];
        let size: f64 = terms.iter().map(|(gain, value)| (r.number(gain) * value).abs()).sum();
        let output: f64 = terms.iter().map(|(gain, value)| r.number(gain) * value).sum();
        assert!(
            (r.number("output") - output).abs() <= 1e-9 * (1.0 + size),
            "{} {output}",
            r.number("output")
        );
        assert!(!r.bit("saturated"));
    });
    let mut limited = settings.to_vec();
    limited.retain(|(name, ..)| !["maxoutput", "enable", "index-enable"].contains(name));
    limited.push(("maxoutput", 5.0, 5.0));
    model::<()>("pid", &[], &limited, |_, r| {
        assert!(r.number("output").abs() <= 5.0);
        assert!(!r.bit("saturated") || r.number("output").abs() == 5.0);
        assert!(r.bit("enable") || r.number("output") == 0.0);
        about(r.number("error"), r.number("command") - r.number("feedback"));
    });
}
