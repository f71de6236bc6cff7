//! Edges, delays, filters of switches, clocks.

use super::{Past, about, model};
use crate::rig::T;

#[test]
fn time() {
    model::<(Past, Option<f64>, f64)>("edge", &[], &[("out-width-ns", 0.0, 6e6)], |(past, end, now), r| {
        past.push(r.bit("in"));
        *now += 1.0;
        let edge = if r.bit("both") {
            past.rose() || past.fell()
        } else if r.bit("in-edge") {
            past.fell()
        } else {
            past.rose()
        };
        if edge {
            *end = Some(*now + (r.number("out-width-ns") / 1e6).max(1e-9));
        }
        let runs = end.is_some_and(|end| *now < end);
        assert_eq!((r.bit("out"), r.bit("out-invert")), (runs, !runs));
    });
    // In half periods, so that no rounding decides.
    model::<(Past, i32)>(
        "oneshot",
        &[],
        &[("width", 0.0055, 0.0055), ("reset", -1.0, 0.7)],
        |(past, left), r| {
            if r.bit("reset") {
                // What is true behind it has risen.
                past.push(false);
                *left = 0;
            } else {
                past.push(r.bit("in"));
                let edge = past.rose() && r.bit("rising") || past.fell() && r.bit("falling");
                *left = match edge && (r.bit("retriggerable") || *left == 0) {
                    true => 11,
                    false => (*left - 2).max(0),
                };
            }
            assert_eq!((r.bit("out"), r.bit("out-not")), (*left > 0, *left == 0));
            about(r.number("time-left"), f64::from(*left) * T / 2.0);
        },
    );
    model::<(usize, bool)>(
        "timedelay",
        &[],
        &[("on-delay", 0.0025, 0.0025), ("off-delay", 0.0035, 0.0035)],
        |(differs, out), r| {
            *differs = if r.bit("in") != *out { *differs + 1 } else { 0 };
            if *differs >= if r.bit("in") { 3 } else { 4 } {
                (*differs, *out) = (0, r.bit("in"));
            }
            assert_eq!(r.bit("out"), *out);
        },
    );
    model::<Past>("ton", &[], &[("pt", 0.0025, 0.0025)], |past, r| {
        past.push(r.bit("in"));
        assert_eq!(r.bit("q"), past.now() && past.lasts() > 3);
    });
    model::<Past>("tof", &[], &[("pt", 0.0025, 0.0025)], |past, r| {
        past.push(r.bit("in"));
        let was_true = past.seen.contains(&true);
        assert_eq!(r.bit("q"), past.now() || was_true && past.lasts() <= 3);
    });
    model::<(i32, bool)>("dbounce", &[], &[("delay", 3.0, 3.0)], |(level, out), r| {
        bounce(level, out, r.bit("in"), r.bit("out"))
    });
    model::<[(i32, bool); 3]>("debounce", &[("cfg", 3)], &[("delay", 3.0, 3.0)], |states, r| {
        for (n, (level, out)) in states.iter_mut().enumerate() {
            bounce(level, out, r.bit(&format!("{n}.in")), r.bit(&format!("{n}.out")));
        }
    });
    // A level from 0 to 2: a press is to come to 2, letting go to 0. A key that is held in the first call was pressed before.
    model::<(Option<i32>, bool, bool)>("toggle", &[], &[("debounce", 2.0, 2.0)], |(level, pressed, out), r| {
        let before = level.unwrap_or(if r.bit("in") { 2 } else { 0 });
        *pressed |= level.is_none() && r.bit("in");
        let now = (before + if r.bit("in") { 1 } else { -1 }).clamp(0, 2);
        *level = Some(now);
        *out ^= now == 2 && !*pressed;
        *pressed = now == 2 || *pressed && now > 0;
        assert_eq!(r.bit("out"), *out);
    });
    model::<usize>(
        "blink",
        &[],
        &[("frequency", 125.0, 125.0), ("duty", 0.3, 0.3), ("enable", 1.0, 1.0)],
        |call, r| {
            // Three of eight calls: phases 0, 1/8 and 2/8 are below 0.3.
            assert_eq!(r.bit("out"), *call % 8 < 3);
            *call += 1;
        },
    );
    model::<u32>("charge_pump", &[], &[], |count, r| {
        *count += u32::from(r.bit("enable"));
        for (pin, divisor) in [("out", 1), ("out-2", 2), ("out-4", 4)] {
            assert_eq!(r.bit(pin), r.bit("enable") && *count / divisor % 2 == 1);
        }
    });
    model::<(u64, bool)>("time", &[], &[], |(calls, ran), r| {
        let runs = r.bit("start") || r.bit("pause");
        if runs && !*ran {
            *calls = 0;
        }
        *ran = runs;
        *calls += u64::from(r.bit("start") && !r.bit("pause"));
        assert_eq!(r.number("seconds"), (*calls as f64 * T).floor() % 60.0);
        assert_eq!((r.number("minutes"), r.number("hours")), (0.0, 0.0));
    });
}

/// A switch filtered by a level from 0 to 3: it counts in the call behind the one that reaches the end.
fn bounce(level: &mut i32, out: &mut bool, now: bool, is: bool) {
    match (now, *level) {
        (true, 3) => *out = true,
        (false, 0) => *out = false,
        (true, _) => *level += 1,
        (false, _) => *level -= 1,
    }
    assert_eq!(is, *out);
}
