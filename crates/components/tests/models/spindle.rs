//! Spindles, their gears and their test signals.

use super::{Past, about, model};
use crate::rig::T;

#[test]
fn spindle() {
    model::<(Past, bool, bool)>(
        "spindle_monitor",
        &[],
        &[
            ("threshold", 3.0, 3.0),
            ("spindle-command", 5.0, 6.0),
            ("spindle-feedback", 0.0, 10.0),
            ("spindle-is-on", 0.0, 5.0),
        ],
        |(on, at_speed, under), r| {
            let behind = r.number("spindle-command") - r.number("spindle-feedback");
            on.push(r.bit("spindle-is-on"));
            // It acts with the second call of being on or off; what was is forgotten in the first call behind it.
            if !on.now() && on.lasts() > 1 || on.now() && on.lasts() == 1 {
                (*at_speed, *under) = (false, false);
            } else if on.lasts() == 1 {
            } else if *at_speed {
                *under |= behind > 3.0;
            } else {
                *at_speed = behind < 3.0 && behind > -3.0;
            }
            assert_eq!(
                (r.bit("spindle-at-speed"), r.bit("spindle-underspeed")),
                (*at_speed, *under)
            );
        },
    );
    let gears = [
        ("min1", 1.0, 1.0),
        ("max1", 5.0, 5.0),
        ("min2", 2.0, 2.0),
        ("max2", 8.0, 8.0),
        ("scale2", 2.0, 2.0),
    ];
    model::<()>("gearchange", &[], &gears, |_, r| {
        let wanted = r.number("speed-in");
        let speed = if r.bit("sel") {
            wanted.abs().clamp(2.0, 8.0) / 2.0
        } else {
            wanted.abs().clamp(1.0, 5.0)
        };
        assert_eq!(r.number("speed-out"), if wanted < 0.0 { -speed } else { speed });
        assert_eq!(r.bit("dir-out"), r.bit("dir-in") ^ (r.bit("sel") && r.bit("reverse")));
    });
    // The target is at the angle, and no other place at it is nearer that way.
    model::<(Past, f64)>(
        "orient",
        &[],
        &[("mode", 0.0, 2.0), ("angle", 0.0, 359.0)],
        |(enable, from), r| {
            enable.push(r.bit("enable"));
            if enable.rose() {
                *from = r.number("position");
                let (command, angle) = (r.number("command"), r.number("angle") / 360.0);
                about((command - angle).round(), command - angle);
                let ahead = command - *from;
                match r.number("mode") as i32 {
                    0 => assert!(ahead.abs() <= 0.5 + 1e-9),
                    1 => assert!((-1e-9..1.0).contains(&ahead)),
                    _ => assert!((-1.0..1e-9).contains(&ahead)),
                }
            }
            if r.bit("enable") {
                about(r.number("poserr") / 360.0 + r.number("command"), r.number("position"));
            }
            assert!(!r.bit("is-oriented"));
        },
    );
    model::<f64>(
        "sim_spindle",
        &[],
        &[("scale", 2.0, 2.0), ("index-enable", 0.0, 0.0)],
        |turns, r| {
            *turns += r.number("velocity-cmd") * 2.0 * T;
            about(r.number("position-fb"), *turns);
        },
    );
    model::<f64>(
        "siggen",
        &[],
        &[("frequency", 7.0, 7.0), ("reset", 0.0, 0.0)],
        |calls, r| {
            *calls += 1.0;
            let angle = std::f64::consts::TAU * 7.0 * *calls * T;
            let unit = |pin: &str| r.number(pin) - r.number("offset");
            let (amplitude, is) = (r.number("amplitude"), |expected: f64| expected * r.number("amplitude"));
            assert!((unit("sine") - is(libm::sin(angle))).abs() < 1e-9);
            assert!((unit("cosine") - is(libm::cos(angle))).abs() < 1e-9);
            // The triangle is the angle of the cosine, the square its slope, the sawtooth the phase.
            let triangle = 1.0 - 2.0 / std::f64::consts::PI * libm::acos(libm::cos(angle));
            assert!((unit("triangle") - is(triangle)).abs() < 1e-6);
            about(unit("square").abs(), amplitude.abs());
            assert_eq!(r.bit("clock"), libm::sin(angle) < 0.0);
            let phase = angle / std::f64::consts::TAU;
            assert!((unit("sawtooth") - is(2.0 * (phase - phase.floor()) - 1.0)).abs() < 1e-9);
        },
    );
}
