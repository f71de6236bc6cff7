//! Every component against a simple model, with random inputs.
//!
//! A model says what the outputs are by what the inputs are, or have been, in other words than the component: a definition, a
//! sum over all that was, a search.

use crate::rig;

use hal_pins::{AnyValue, Type};
use proptest::test_runner::{Config, TestRunner};
use rig::{Rig, T};

const CALLS: usize = 120;

/// Random numbers (xorshift64*).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// Evenly from 0 to below 1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Runs a component with random inputs: a pin named in `ranges` within its range, numbers within ±10, others small. A pin keeps its
/// value for a few calls. `check` sees the rig after each call, and keeps what it needs to remember.
fn model<S: Default>(kind: &str, options: &[(&str, i64)], ranges: &[(&str, f64, f64)], check: impl Fn(&mut S, &Rig)) {
    let mut runner = TestRunner::new(Config {
        cases: 48,
        failure_persistence: None,
        ..Config::default()
    });
    let run = runner.run(&proptest::prelude::any::<u64>(), |seed| {
        let mut random = Random(seed | 1);
        let mut rig = Rig::new(kind, options);
        let mut state = S::default();
        for call in 0..CALLS {
            for pin in 0..rig.inputs().len() {
                // What counts on a net alone stays off it.
                if rig.pins[pin].name.ends_with("-deriv") {
                    continue;
                }
                let keeps = random.unit() < 0.6;
                let range = ranges.iter().find(|(name, ..)| *name == rig.pins[pin].name);
                // A range of one value is a setting: from the first call on.
                if keeps && !(call == 0 && range.is_some()) {
                    continue;
                }
                let (low, high) = range.map_or((-10.0, 10.0), |(_, low, high)| (*low, *high));
                let number = low + (high - low) * random.unit();
                let value = match rig.pins[pin].default.kind() {
                    Type::Bit if range.is_some() => AnyValue::Bit(number >= 0.5),
                    Type::Bit => AnyValue::Bit(random.next() & 1 != 0),
                    Type::S32 => AnyValue::S32(number.round() as i32),
                    Type::U32 => AnyValue::U32(number.round().abs() as u32),
                    // Coarse, so that equal values and edges are met.
                    _ if range.is_none() => AnyValue::Float((number * 4.0).round() / 4.0),
                    _ => AnyValue::Float(number),
                };
                rig.set_at(pin, value);
            }
            rig.update(T);
            check(&mut state, &rig);
        }
        Ok(())
    });
    if let Err(error) = run {
        panic!("{kind}: {error}");
    }
}

/// One whose outputs depend on the inputs of the same call only.
fn stateless(kind: &str, options: &[(&str, i64)], check: impl Fn(&Rig)) {
    model::<()>(kind, options, &[], |_, rig| check(rig));
}

#[track_caller]
fn about(is: f64, expected: f64) {
    assert!(
        (is - expected).abs() <= 1e-9 * (1.0 + expected.abs()),
        "{is}, expected {expected}"
    );
}

fn pins(rig: &Rig, count: usize, name: impl Fn(usize) -> String) -> Vec<f64> {
    (0..count)
        .map(|at| match rig.get(&name(at)) {
            AnyValue::Bit(value) => f64::from(u8::from(value)),
            _ => rig.number(&name(at)),
        })
        .collect()
}

/// The bits as a number, by its digits.
fn place(bits: &[f64]) -> usize {
    let digits: String = bits
        .iter()
        .rev()
        .map(|bit| if *bit > 0.0 { '1' } else { '0' })
        .collect();
    usize::from_str_radix(&digits, 2).unwrap()
}

/// Calls since a bit was something else, and what it was in the call before.
#[derive(Default)]
struct Past {
    seen: Vec<bool>,
}

impl Past {
    fn push(&mut self, now: bool) {
        self.seen.push(now);
    }
    fn before(&self) -> Option<bool> {
        self.seen.iter().rev().nth(1).copied()
    }
    fn now(&self) -> bool {
        *self.seen.last().unwrap()
    }
    fn rose(&self) -> bool {
        self.now() && self.before() == Some(false)
    }
    fn fell(&self) -> bool {
        !self.now() && self.before() == Some(true)
    }
    /// Calls in a row, this one included, that it has been what it is.
    fn lasts(&self) -> usize {
        self.seen.iter().rev().take_while(|was| **was == self.now()).count()
    }
}

#[test]
fn gates() {
    stateless("and2", &[], |r| {
        assert_eq!(r.bit("out"), [r.bit("in0"), r.bit("in1")] == [true; 2])
    });
    stateless("or2", &[], |r| {
        assert_eq!(r.bit("out"), [r.bit("in0"), r.bit("in1")] != [false; 2])
    });
    stateless("xor2", &[], |r| assert_eq!(r.bit("out"), r.bit("in0") ^ r.bit("in1")));
    stateless("not", &[], |r| assert_ne!(r.bit("out"), r.bit("in")));
    stateless("maj3", &[], |r| {
        let [a, b, c] = ["in1", "in2", "in3"].map(|pin| r.bit(pin));
        assert_eq!(r.bit("out"), (if a == b { a } else { c }) ^ r.bit("invert"));
    });
    model::<()>("lut5", &[], &[("function", 0.0, 4e9)], |_, r| {
        let at = place(&pins(r, 5, |n| format!("in-{n}")));
        let table = format!("{:032b}", r.number("function") as u32);
        assert_eq!(r.bit("out"), table.chars().rev().nth(at) == Some('1'));
    });
    for inputs in [1, 2, 5, 16] {
        stateless("logic", &[("personality", inputs)], |r| {
            let bits = pins(r, inputs as usize, |n| format!("in-{n:02}"));
            assert_eq!(r.bit("and"), !bits.contains(&0.0));
            assert_eq!(r.bit("or"), bits.contains(&1.0));
            assert_eq!(r.bit("xor"), bits.iter().sum::<f64>() % 2.0 == 1.0);
            assert_eq!((r.bit("nand"), r.bit("nor")), (!r.bit("and"), !r.bit("or")));
        });
    }
    stateless("bitwise", &[], |r| {
        for bit in 0..32 {
            let of = |pin: &str| r.number(pin) as u32 >> bit & 1 == 1;
            let (a, b) = (of("in0"), of("in1"));
            let expected = [a && b, a || b, a != b, !(a && b), !(a || b), a == b];
            let names = ["and", "or", "xor", "nand", "nor", "xnor"];
            assert_eq!(names.map(|name| of(&format!("out-{name}"))), expected);
        }
    });
}

#[test]
fn what_remembers() {
    model::<(Past, bool)>("flipflop", &[], &[], |(clock, q), r| {
        clock.push(r.bit("clk"));
        if clock.rose() {
            *q = r.bit("data");
        }
        *q = (*q || r.bit("set")) && !r.bit("reset");
        assert_eq!((r.bit("out"), r.bit("out-not")), (*q, !*q));
    });
    model::<f64>("tristate_float", &[], &[], |last, r| {
        if r.bit("enable") {
            *last = r.number("in");
        }
        assert_eq!(r.number("out"), *last);
    });
    model::<bool>("tristate_bit", &[], &[], |last, r| {
        if r.bit("enable") {
            *last = r.bit("in");
        }
        assert_eq!(r.bit("out"), *last);
    });
    model::<f64>("sample_hold", &[], &[], |last, r| {
        if !r.bit("hold") {
            *last = r.number("in");
        }
        assert_eq!(r.number("out"), *last);
    });
    // Closed if it was reset since the last fault.
    model::<(Past, Vec<bool>)>(
        "estop_latch",
        &[],
        &[("ok-in", 0.3, 1.3), ("fault-in", -0.3, 0.7)],
        |(reset, since), r| {
            reset.push(r.bit("reset"));
            if !r.bit("ok-in") || r.bit("fault-in") {
                since.clear();
            } else {
                since.push(reset.rose());
            }
            assert_eq!(
                (r.bit("ok-out"), r.bit("fault-out")),
                (since.contains(&true), !since.contains(&true))
            );
        },
    );
    model::<(Past, i64, bool)>(
        "safety_latch",
        &[],
        &[
            ("heal", 0.0, 3.0),
            ("harm", 0.0, 5.0),
            ("threshold", 8.0, 8.0),
            ("min", 0.0, 0.0),
            ("max", 12.0, 12.0),
            ("enable", 0.0, 2.0),
        ],
        |(reset, count, tripped), r| {
            reset.push(r.bit("reset"));
            if !r.bit("enable") {
                (*count, *tripped) = (0, r.bit("error-in"));
            } else {
                if reset.rose() {
                    (*count, *tripped) = (0, false);
                }
                let step = if r.bit("error-in") {
                    r.number("harm")
                } else {
                    -r.number("heal")
                };
                *count = (*count + step as i64).clamp(0, 12);
                *tripped = *count >= 8 || *tripped && r.bit("latching");
            }
            assert_eq!(
                (r.number("count") as i64, r.bit("error-out"), r.bit("ok-out")),
                (*count, *tripped, !*tripped)
            );
        },
    );
    model::<(Vec<[bool; 2]>, usize, bool)>(
        "watchdog",
        &[("num_inputs", 2)],
        &[
            ("timeout-0", 0.0045, 0.0045),
            ("timeout-1", 0.0075, 0.0075),
            ("enable-in", 0.0, 5.0),
        ],
        |(seen, since, ok), r| {
            seen.push([r.bit("input-0"), r.bit("input-1")]);
            *since = if r.bit("enable-in") { *since + 1 } else { 0 };
            // A call is one change old at the earliest.
            let stale = |input: usize, calls: usize| {
                let tail: Vec<_> = seen.iter().rev().take(calls + 2).map(|seen| seen[input]).collect();
                *since > calls
                    && tail.len() == calls + 2
                    && tail[..=calls + 1].windows(2).all(|pair| pair[0] == pair[1])
                    || *since > calls && tail.len() < calls + 2 && tail.windows(2).all(|pair| pair[0] == pair[1])
            };
            *ok = match *since {
                0 => false,
                1 => true,
                _ => *ok && !stale(0, 4) && !stale(1, 7),
            };
            assert_eq!(r.bit("ok-out"), *ok);
        },
    );
}

#[test]
fn one_of_several() {
    stateless("mux2", &[], |r| {
        assert_eq!(r.number("out"), r.number(if r.bit("sel") { "in1" } else { "in0" }))
    });
    for (kind, bits) in [("mux4", 2), ("mux8", 3)] {
        stateless(kind, &[], |r| {
            let at = place(&pins(r, bits, |n| format!("sel{n}")));
            assert_eq!(r.number("out"), r.number(&format!("in{at}")));
        });
    }
    model::<()>(
        "mux16",
        &[],
        &[("debounce-time", 0.0, 0.0), ("suppress-no-input", 0.0, 0.0)],
        |_, r| {
            let code = place(&pins(r, 4, |n| format!("sel{n}")));
            let gray = (0..16).find(|number| number ^ number >> 1 == code).unwrap();
            let at = if r.bit("use-graycode") { gray } else { code };
            assert_eq!(r.number("selected"), at as f64);
            assert_eq!(r.number("out-f"), r.number(&format!("in{at:02}")));
            assert_eq!(r.number("out-s"), r.number("out-f").trunc());
        },
    );
    stateless("select8", &[], |r| {
        let set: Vec<usize> = (0..8).filter(|n| r.bit(&format!("out{n}"))).collect();
        let named = r.number("sel");
        let expected = r.bit("enable") && (0.0..8.0).contains(&named);
        assert_eq!(set, if expected { vec![named as usize] } else { vec![] });
    });
    model::<()>("demux", &[("personality", 20)], &[("sel-u32", 0.0, 12.0)], |_, r| {
        let named = place(&pins(r, 5, |n| format!("sel-bit-{n:02}"))) + r.number("sel-u32") as usize;
        let set: Vec<usize> = (0..20).filter(|n| r.bit(&format!("out-{n:02}"))).collect();
        let expected: Vec<usize> = if r.bit("bargraph") {
            (0..named.min(19)).collect()
        } else {
            vec![named.min(19)]
        };
        assert_eq!(set, expected);
    });
    let top = [("top-position", 4.0, 4.0)];
    model::<(Past, Past, i32)>("multiswitch", &[("personality", 5)], &top, |(up, down, sum), r| {
        up.push(r.bit("up"));
        down.push(r.bit("down"));
        *sum += i32::from(up.rose()) - i32::from(down.rose());
        let at = sum.rem_euclid(5) as usize;
        let set: Vec<usize> = (0..5).filter(|n| r.bit(&format!("bit-{n:02}"))).collect();
        assert_eq!(set, [at]);
    });
}

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

#[test]
fn arithmetic() {
    stateless("sum2", &[], |r| {
        let terms = [("in0", "gain0"), ("in1", "gain1")].map(|(a, b)| r.number(a) * r.number(b));
        about(r.number("out") - r.number("offset"), terms.iter().sum());
    });
    stateless("mult2", &[], |r| {
        about(r.number("out"), r.number("in1") * r.number("in0"))
    });
    model::<()>("div2", &[], &[("deadband", 0.1, 0.1)], |_, r| {
        let (a, b) = (r.number("in0"), r.number("in1"));
        if b.abs() >= 0.1 {
            about(r.number("out") * b, a);
        } else {
            about(r.number("out").abs() * 0.1, a.abs());
        }
    });
    stateless("invert", &[], |r| {
        let dead = r.number("in") == 0.0 || r.number("in").abs() < r.number("deadband");
        about(r.number("out") * r.number("in"), if dead { 0.0 } else { 1.0 });
    });
    for kind in ["abs", "abs_s32"] {
        stateless(kind, &[], |r| {
            let value = r.number("in");
            assert_eq!(r.number("out"), value.max(-value));
            assert_eq!(
                (r.bit("is-negative"), r.bit("is-positive"), r.bit("sign")),
                (value < 0.0, value > 0.0, value < 0.0)
            );
        });
    }
    stateless("hypot", &[], |r| {
        let squares: f64 = ["in0", "in1", "in2"].iter().map(|pin| r.number(pin).powi(2)).sum();
        about(r.number("out").powi(2), squares);
    });
    stateless("scale", &[], |r| {
        about(r.number("out"), r.number("offset") + r.number("gain") * r.number("in"))
    });
    stateless("offset", &[], |r| {
        about(r.number("out") - r.number("in"), r.number("offset"));
        about(r.number("fb-in") - r.number("fb-out"), r.number("offset"));
    });
    model::<()>("weighted_sum", &[("personality", 5)], &[("hold", 0.0, 0.0)], |_, r| {
        let bits = pins(r, 5, |n| format!("bit.{n}.in"));
        let weights = pins(r, 5, |n| format!("bit.{n}.weight"));
        let sum: f64 = bits.iter().zip(&weights).map(|(bit, weight)| bit * weight).sum();
        assert_eq!(r.number("sum"), sum + r.number("offset"));
    });
    stateless("scaled_s32_sums", &[], |r| {
        let sum: f64 = (0..4)
            .map(|n| r.number(&format!("in{n}")) * r.number(&format!("scale{n}")))
            .sum();
        about(r.number("out-f"), sum);
        assert_eq!(r.number("out-s"), r.number("out-f").trunc());
    });
    stateless("blend", &[], |r| {
        let (one, zero, select) = (r.number("in1"), r.number("in2"), r.number("select"));
        if r.bit("open") || (0.0..=1.0).contains(&select) {
            about(r.number("out"), zero + (one - zero) * select);
        } else {
            about(r.number("out"), if select > 1.0 { one } else { zero });
        }
    });
    stateless("feedcomp", &[], |r| {
        let (vel, feed) = (r.number("vel"), r.number("feed"));
        let factor = match (r.bit("enable"), feed) {
            (false, _) => 1.0,
            (true, 0.0) => 0.0,
            (true, feed) => vel / feed,
        };
        about(r.number("out"), r.number("in") * factor);
    });
    let points: Vec<(String, f64, f64)> = (0..5)
        .map(|n| (format!("x-val-{n:02}"), f64::from(n * n), f64::from(n * n)))
        .collect();
    let ranges: Vec<(&str, f64, f64)> = points
        .iter()
        .map(|(name, low, high)| (name.as_str(), *low, *high))
        .chain([("in", -3.0, 20.0)])
        .collect();
    model::<()>("lincurve", &[("personality", 5)], &ranges, |_, r| {
        let (x, y) = (
            pins(r, 5, |n| format!("x-val-{n:02}")),
            pins(r, 5, |n| format!("y-val-{n:02}")),
        );
        // As a sum of hats.
        let at = r.number("in").clamp(x[0], x[4]);
        let hat = |n: usize| {
            let left = if n == 0 {
                1.0
            } else {
                (at - x[n - 1]) / (x[n] - x[n - 1])
            };
            let right = if n == 4 {
                1.0
            } else {
                (x[n + 1] - at) / (x[n + 1] - x[n])
            };
            left.min(right).clamp(0.0, 1.0)
        };
        about(r.number("out"), (0..5).map(|n| y[n] * hat(n)).sum());
    });
    model::<()>("led_dim", &[], &[("in", 0.0, 1.0)], |_, r| {
        // The inverse law: L* of the luminance.
        let luminance = r.number("out");
        let brightness = if luminance <= 0.008856 {
            9.033 * luminance
        } else {
            1.16 * libm::cbrt(luminance) - 0.16
        };
        assert!((brightness - r.number("in")).abs() < 1e-4);
    });
}

#[test]
fn limits_and_comparisons() {
    let band = [("min", -4.0, -1.0), ("max", 1.0, 4.0)];
    model::<()>("limit1", &[], &band, |_, r| {
        assert_eq!(r.number("out"), r.number("in").clamp(r.number("min"), r.number("max")));
    });
    model::<f64>(
        "limit2",
        &[],
        &[("min", -4.0, -4.0), ("max", 4.0, 4.0), ("maxv", 500.0, 500.0)],
        |last, r| {
            let target = r.number("in").clamp(-4.0, 4.0);
            let out = r.number("out");
            let most = if r.bit("load") { 100.0 } else { 0.5 };
            // As near to the target as it may come.
            let left = (target - *last).abs() - most;
            about((target - out).abs(), left.max(0.0));
            *last = out;
        },
    );
    model::<[f64; 2]>(
        "limit3",
        &[],
        &[
            ("min", -4.0, -4.0),
            ("max", 4.0, 4.0),
            ("maxv", 800.0, 800.0),
            ("maxa", 1e5, 1e5),
            ("load", 0.0, 0.0),
        ],
        |[position, velocity], r| {
            let out = r.number("out");
            let speed = (out - *position) / T;
            assert!((-4.0 - 1e-9..=4.0 + 1e-9).contains(&out), "{out}");
            assert!(speed.abs() <= 800.0 * (1.0 + 1e-9), "{speed}");
            assert!(
                (speed - *velocity).abs() <= 1e5 * T * (1.0 + 1e-6),
                "{speed} {velocity}"
            );
            (*position, *velocity) = (out, speed);
        },
    );
    stateless("deadzone", &[], |r| {
        let half = r.number("threshold") / 2.0;
        let (value, center) = (r.number("in"), r.number("center"));
        let out = r.number("out");
        let inside = (value - center).abs() <= half;
        if inside {
            assert_eq!(out, center);
        } else if half >= 0.0 {
            about((out - value).abs(), half);
            assert!((out - center) * (value - center) >= 0.0);
        }
    });
    model::<bool>("comp", &[], &[("hyst", 2.0, 2.0)], |out, r| {
        let above = r.number("in1") - r.number("in0");
        if above.abs() > 1.0 {
            *out = above > 0.0;
        }
        assert_eq!((r.bit("out"), r.bit("equal")), (*out, above.abs() <= 1.0));
    });
    model::<()>("wcomp", &[], &band, |_, r| {
        // Sorted into three, and each of them once.
        assert_eq!(
            [r.bit("under"), r.bit("out"), r.bit("over")]
                .iter()
                .filter(|bit| **bit)
                .count(),
            1
        );
        assert_eq!(
            r.bit("out"),
            r.number("in") > r.number("min") && r.number("in") < r.number("max")
        );
        assert_eq!(r.bit("over"), r.number("in") >= r.number("max"));
    });
    stateless("near", &[], |r| {
        let (a, b, scale) = (r.number("in1"), r.number("in2"), r.number("scale"));
        let ratio = b / a;
        let by_factor =
            scale > 1.0 && (a == 0.0 && b == 0.0 || a != 0.0 && ratio >= 1.0 / scale - 1e-12 && ratio <= scale + 1e-12);
        let by_difference = a.max(b) - a.min(b) <= r.number("difference");
        assert_eq!(r.bit("out"), by_factor || by_difference);
    });
    for home in [3.0, -3.0] {
        model::<bool>(
            "sim_home_switch",
            &[],
            &[("home-pos", home, home), ("hysteresis", 1.0, 1.0)],
            |closed, r| {
                let outward = r.number("cur-pos") * home / 3.0;
                *closed = outward >= 3.0 || *closed && outward > 2.0;
                assert_eq!(r.bit("home-sw"), *closed);
            },
        );
    }
}

#[test]
fn a_limited_number_comes_to_rest_where_its_input_does() {
    for (maxv, maxa) in [(50.0, 1e4), (900.0, 1e4), (900.0, 9e4), (123.4, 33_333.0), (1e20, 1e7)] {
        let settings = [
            ("in", 3.0, 3.0),
            ("maxv", maxv, maxv),
            ("maxa", maxa, maxa),
            ("load", 0.0, 0.0),
            ("enable", 1.0, 1.0),
            ("min", -20.0, -20.0),
            ("max", 20.0, 20.0),
        ];
        model::<Vec<f64>>("limit3", &[], &settings, |seen, r| {
            seen.push(r.number("out"));
            assert!(r.number("out") <= 3.0 + 1e-9, "{seen:?}");
            assert!(seen.len() < CALLS || (r.number("out") - 3.0).abs() < 1e-6, "{seen:?}");
        });
    }
}

#[test]
fn filters() {
    // As the sum of all inputs, each with what time has left of it.
    model::<Vec<f64>>("lowpass", &[], &[("gain", 0.2, 0.2), ("load", 0.0, 0.0)], |seen, r| {
        seen.push(r.number("in"));
        let weights = (0..).map(|age| 0.2 * 0.8f64.powi(age));
        about(
            r.number("out"),
            seen.iter()
                .rev()
                .zip(weights)
                .map(|(value, weight)| value * weight)
                .sum(),
        );
    });
    model::<Vec<f64>>(
        "ilowpass",
        &[],
        &[("gain", 0.25, 0.25), ("scale", 100.0, 100.0)],
        |seen, r| {
            seen.push(r.number("in"));
            let weights = (0..).map(|age| 0.25 * 0.75f64.powi(age));
            let value: f64 = seen
                .iter()
                .rev()
                .zip(weights)
                .map(|(value, weight)| value * weight)
                .sum();
            assert!((r.number("out") - value * 100.0).abs() <= 0.5 + 1e-6);
        },
    );
    // Direct form I, with coefficients of a stable filter.
    let own = [
        ("type", 0.0, 0.0),
        ("enable", 1.0, 1.0),
        ("n0", 0.5, 0.5),
        ("n1", -0.25, -0.25),
        ("n2", 0.125, 0.125),
        ("d1", -0.5, -0.5),
        ("d2", 0.25, 0.25),
    ];
    model::<(Vec<f64>, Vec<f64>)>("biquad", &[], &own, |(x, y), r| {
        x.push(r.number("in"));
        let at = |values: &[f64], age: usize| values.iter().rev().nth(age).copied().unwrap_or(0.0);
        let out = 0.5 * at(x, 0) - 0.25 * at(x, 1) + 0.125 * at(x, 2) + 0.5 * at(y, 0) - 0.25 * at(y, 1);
        y.push(out);
        about(r.number("out"), out);
    });
    model::<Vec<f64>>("ddt", &[], &[], |seen, r| {
        seen.push(r.number("in"));
        let before = seen.iter().rev().nth(1).unwrap_or(&seen[0]);
        about(r.number("out") * T + before, r.number("in"));
    });
    model::<f64>("integ", &[], &[("min", -0.05, -0.05), ("max", 0.05, 0.05)], |sum, r| {
        *sum = if r.bit("reset") {
            0.0
        } else {
            (*sum + r.number("in") * r.number("gain") * T).clamp(-0.05, 0.05)
        };
        about(r.number("out"), *sum);
    });
    model::<Vec<f64>>("minmax", &[], &[("reset", -1.0, 0.6)], |seen, r| {
        // From 0, until it is reset.
        match r.bit("reset") {
            true => seen.clear(),
            false if seen.is_empty() => seen.push(0.0),
            false => {}
        }
        seen.push(r.number("in"));
        assert_eq!(r.number("max"), seen.iter().copied().fold(f64::MIN, f64::max));
        assert_eq!(r.number("min"), seen.iter().copied().fold(f64::MAX, f64::min));
    });
    let filter = [("enable", 1.0, 1.0), ("delay", 3.0, 3.0), ("dead-time", 0.0, 0.0)];
    model::<(Past, bool)>("probe_filter", &[], &filter, |(past, out), r| {
        past.push(r.bit("in"));
        if past.lasts() >= 3 {
            *out = past.now();
        }
        assert_eq!(r.bit("out"), *out);
    });
    let held = [("enable", 1.0, 1.0), ("delay", 1.0, 1.0), ("dead-time", 0.005, 0.005)];
    model::<Past>("probe_filter", &[], &held, |out, r| {
        let before = out.seen.last().copied();
        out.push(r.bit("out"));
        // A change comes five calls behind the last one at the earliest.
        let changes: Vec<usize> = (1..out.seen.len())
            .filter(|at| out.seen[*at] != out.seen[at - 1])
            .collect();
        assert!(
            changes.windows(2).all(|pair| pair[1] - pair[0] >= 5),
            "{changes:?} {before:?}"
        );
    });
}

#[test]
fn counting() {
    model::<(Past, Past, i64)>(
        "updown",
        &[],
        &[("min", -3.0, -3.0), ("max", 3.0, 3.0), ("reset", -1.0, 0.6)],
        |(up, down, count), r| {
            up.push(r.bit("countup"));
            down.push(r.bit("countdown"));
            *count += i64::from(up.rose()) - i64::from(down.rose());
            if r.bit("reset") {
                *count = 0;
            }
            if r.bit("wrap") {
                *count = if *count > 3 {
                    -3
                } else if *count < -3 {
                    3
                } else {
                    *count
                };
            } else if r.bit("clamp") {
                *count = (*count).clamp(-3, 3);
            }
            assert_eq!(r.number("count") as i64, *count);
        },
    );
    model::<Past>(
        "counter",
        &[],
        &[
            ("position-scale", 4.0, 4.0),
            ("reset", 0.0, 0.0),
            ("index-enable", 0.0, 0.0),
        ],
        |past, r| {
            past.push(r.bit("phase-a"));
            let rises = past.seen.windows(2).filter(|pair| !pair[0] && pair[1]).count();
            assert_eq!(r.number("counts"), rises as f64);
            about(r.number("position") * 4.0, rises as f64);
        },
    );
    // Legal steps only: as the place on a circle of four.
    let settings = [
        ("index-enable", 0.0, 0.0),
        ("reset", 0.0, 0.0),
        ("x4-mode", 1.0, 1.0),
        ("missing-teeth", 0.0, 0.0),
        ("counter-mode", 0.0, 0.0),
        ("position-scale", 2.0, 2.0),
    ];
    model::<Vec<usize>>("encoder", &[], &settings, |seen, r| {
        let place = [(false, false), (true, false), (true, true), (false, true)];
        seen.push(
            place
                .iter()
                .position(|phases| *phases == (r.bit("phase-a"), r.bit("phase-b")))
                .unwrap(),
        );
        let step = |pair: &[usize]| match (pair[1] + 4 - pair[0]) % 4 {
            1 => 1.0,
            3 => -1.0,
            _ => 0.0,
        };
        assert_eq!(r.number("counts"), seen.windows(2).map(step).sum::<f64>());
        about(r.number("velocity-rpm"), r.number("velocity") * 60.0);
        assert!((r.number("position-interpolated") - r.number("position")).abs() <= 0.5 + 1e-9);
    });
    model::<(Option<f64>, f64)>(
        "knob2float",
        &[],
        &[("min-out", -2.0, -2.0), ("max-out", 2.0, 2.0), ("scale", 0.1, 0.1)],
        |(last, out), r| {
            let turned = r.number("counts") - last.unwrap_or(r.number("counts"));
            *last = Some(r.number("counts"));
            if r.bit("enable") {
                *out = (*out + turned * 0.1).clamp(-2.0, 2.0);
            }
            about(r.number("out"), *out);
        },
    );
    model::<Vec<[f64; 2]>>(
        "hand_wheel",
        &[("personality", 3)],
        &[("axis", -1.0, 3.0), ("step", 0.0, 4.0)],
        |seen, r| {
            seen.push([r.number("axis"), r.number("step")]);
            let settled = seen.len() > 1 && seen[seen.len() - 1] == seen[seen.len() - 2];
            for axis in 0..3 {
                let expected = r.bit("enable") && settled && r.number("axis") == f64::from(axis);
                assert_eq!(r.bit(&format!("jog-enable-{axis}")), expected);
            }
            let step = if r.number("step") < 4.0 { r.number("step") } else { 0.0 };
            assert_eq!(r.number("jog-scale"), r.number(&format!("step-size-{step}")));
            assert_eq!(r.number("jog-counts"), r.number("counts"));
        },
    );
}

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

#[test]
fn machine() {
    // Joints go with the axis, but for those that wait at their switch; an offset changes only then.
    model::<(Option<f64>, Vec<f64>, bool)>(
        "gantry",
        &[("personality", 3)],
        &[("search-vel", -1.0, -1.0)],
        |(before, offsets, home), r| {
            offsets.resize(3, 0.0);
            let switches = pins(r, 3, |n| format!("joint.{n:02}.home"));
            *home = if *home {
                switches.contains(&1.0)
            } else {
                !switches.contains(&0.0)
            };
            let moved = r.number("position-cmd") - before.unwrap_or(r.number("position-cmd"));
            for (offset, switch) in offsets.iter_mut().zip(&switches) {
                if moved < 0.0 && !*home && *switch > 0.0 {
                    *offset += moved;
                }
            }
            *before = Some(r.number("position-cmd"));
            for (n, offset) in offsets.iter().enumerate() {
                about(r.number(&format!("joint.{n:02}.offset")), *offset);
                about(
                    r.number(&format!("joint.{n:02}.pos-cmd")),
                    r.number("position-cmd") - offset,
                );
            }
            assert_eq!((r.bit("home"), r.bit("limit")), (*home, switches.contains(&1.0)));
            let shown = (0..3).any(|n| {
                (r.number("position-fb") - r.number(&format!("joint.{n:02}.pos-fb")) - offsets[n]).abs() < 1e-9
            });
            assert!(shown);
        },
    );
    model::<f64>(
        "thermal_compensation",
        &[],
        &[
            ("temperature", 15.0, 40.0),
            ("reference", 20.0, 20.0),
            ("coefficient", 1e-5, 1e-5),
            ("position", 0.0, 900.0),
            ("maxv", 2.0, 2.0),
        ],
        |offset, r| {
            let length = r.number("position") - r.number("fixed-point");
            let wanted = if r.bit("enable") {
                1e-5 * (20.0 - r.number("temperature")) * length
            } else {
                0.0
            };
            let most = r.number("max").max(0.0);
            let target = wanted.clamp(-most, most);
            about(
                (target - r.number("offset")).abs(),
                ((target - *offset).abs() - 0.002).max(0.0),
            );
            assert_eq!(r.bit("limited"), wanted.abs() > most);
            *offset = r.number("offset");
        },
    );
    let stick = [
        ("in", -1.2, 1.2),
        ("power", 1.0, 4.0),
        ("deadband", 0.0, 0.5),
        ("scale", 1.0, 5.0),
        ("offset", 0.0, 1.0),
    ];
    model::<Vec<[f64; 6]>>("joyhandle", &[], &stick, |seen, r| {
        let (x, out) = (r.number("in"), r.number("out"));
        let full = r.number("scale") + r.number("offset");
        assert!(out.abs() <= full + 1e-9);
        match x.abs() {
            x if x <= r.number("deadband") => assert_eq!(out, 0.0),
            x if x >= 1.0 => about(out.abs(), full),
            _ => assert!(out * x >= 0.0),
        }
        // Farther out is more.
        let settings = ["power", "deadband", "scale", "offset"].map(|pin| r.number(pin));
        if !r.bit("inverse") {
            for [x0, out0, a, b, c, d] in seen.iter() {
                assert!([*a, *b, *c, *d] != settings || (x - x0) * (out - out0) >= -1e-9);
            }
            let [a, b, c, d] = settings;
            seen.push([x, out, a, b, c, d]);
        }
    });
    model::<f64>(
        "conv_float_s32",
        &[],
        &[("in", -5e9, 5e9), ("clamp", 1.0, 1.0)],
        |_, r| {
            assert_eq!(
                r.number("out"),
                r.number("in").trunc().clamp(-2_147_483_648.0, 2_147_483_647.0)
            );
            assert_eq!(r.bit("out-of-range"), r.number("in").trunc() != r.number("out"));
        },
    );
}

/// The carousel turns as it is told, a pocket every five calls, and its sensors say where it is.
#[test]
fn a_carousel_finds_every_pocket_by_the_shorter_way() {
    for (encoding, sensors) in [(0, 4), (1, 4), (2, 8), (3, 12), (4, 2)] {
        let mut random = Random(encoding as u64 + 7);
        let mut rig = Rig::new(
            "carousel",
            &[("pockets", 12), ("encoding", encoding), ("num_sense", sensors)],
        );
        // The first call makes no edge.
        rig.update(T);
        // In fifths of a pocket; 0 is pocket 1.
        let mut place = 20i64;
        for _ in 0..60 {
            let wanted = (random.next() % 12) as i64 + 1;
            let start = place;
            let homed = rig.bit("homed");
            rig.set("pocket-number", wanted as i32);
            rig.set("enable", true);
            let mut travelled = 0;
            for call in 0.. {
                assert!(call < 200, "{encoding}: pocket {wanted} is never found");
                let at_pocket = place.rem_euclid(5) == 0;
                let pocket = (place + 2).div_euclid(5).rem_euclid(12) + 1;
                let bcd = pocket / 10 * 16 + pocket % 10;
                let code = match encoding {
                    0 => pocket ^ pocket >> 1,
                    1 => pocket,
                    2 => bcd,
                    3 => i64::from(at_pocket) << (pocket - 1),
                    _ => i64::from(pocket == 1 && at_pocket) | i64::from(at_pocket) << 1,
                };
                for sensor in 0..sensors {
                    rig.set(&format!("sense-{sensor}"), code >> sensor & 1 != 0);
                }
                // Sensors of numbers are read at the pocket.
                rig.set("strobe", encoding >= 3 || at_pocket);
                rig.update(T);
                assert!(!(rig.bit("motor-fwd") && rig.bit("motor-rev")));
                let step = i64::from(rig.bit("motor-fwd")) - i64::from(rig.bit("motor-rev"));
                if rig.bit("ready") {
                    assert_eq!((pocket, at_pocket), (wanted, true), "{encoding}");
                    break;
                }
                place += step;
                travelled += step.abs();
            }
            if homed {
                let ahead = (5 * (wanted - 1) - start).rem_euclid(60);
                assert_eq!(travelled, ahead.min(60 - ahead), "{encoding}: from {start} to {wanted}");
            }
            rig.set("enable", false);
            rig.update(T);
            assert!(!rig.bit("ready") && !rig.bit("active"));
        }
    }
}

#[test]
fn conversions() {
    model::<()>(
        "conv_float_u32",
        &[],
        &[("in", -5e9, 5e9), ("clamp", 1.0, 1.0)],
        |_, r| {
            assert_eq!(r.number("out"), r.number("in").trunc().clamp(0.0, 4_294_967_295.0));
            assert_eq!(r.bit("out-of-range"), r.number("in").trunc() != r.number("out"));
        },
    );
    stateless("conv_s32_u32", &[], |r| {
        let value = r.number("in");
        let lost = if r.bit("clamp") { 0.0 } else { value + 4_294_967_296.0 };
        assert_eq!(r.number("out"), if value < 0.0 { lost } else { value });
        assert_eq!(r.bit("out-of-range"), value < 0.0);
    });
    model::<()>("conv_u32_s32", &[], &[("in", 0.0, 4e9)], |_, r| {
        let value = r.number("in");
        let is_outside = value > 2_147_483_647.0;
        let outside = if r.bit("clamp") {
            2_147_483_647.0
        } else {
            value - 4_294_967_296.0
        };
        assert_eq!(r.number("out"), if is_outside { outside } else { value });
        assert_eq!(r.bit("out-of-range"), is_outside);
    });
    for (kind, low) in [("conv_s32_bit", -3.0), ("conv_u32_bit", 0.0)] {
        model::<()>(kind, &[], &[("in", low, 3.0)], |_, r| {
            let value = r.number("in");
            let bit = if r.bit("clamp") { value > 0.0 } else { value != 0.0 };
            assert_eq!(
                (r.bit("out"), r.bit("out-of-range")),
                (bit, value != 0.0 && value != 1.0)
            );
        });
    }
    for kind in ["conv_bit_float", "conv_bit_s32", "conv_bit_u32"] {
        stateless(kind, &[], |r| {
            assert_eq!(r.number("out"), if r.bit("in") { 1.0 } else { 0.0 })
        });
    }
    for kind in ["conv_s32_float", "conv_u32_float"] {
        stateless(kind, &[], |r| assert_eq!(r.number("out"), r.number("in")));
    }
    model::<()>("bitslice", &[("personality", 9)], &[("in", 0.0, 500.0)], |_, r| {
        assert_eq!(place(&pins(r, 9, |n| format!("out-{n:02}"))), r.number("in") as usize);
    });
    stateless("bitmerge", &[("personality", 9)], |r| {
        assert_eq!(r.number("out") as usize, place(&pins(r, 9, |n| format!("in-{n:02}"))));
    });
    // One way is the inverse of the other, and neighbours differ in one bit.
    stateless("gray2bin", &[], |r| {
        let number = r.number("out") as u32;
        assert_eq!(number ^ number >> 1, r.number("in") as u32);
    });
    stateless("bin2gray", &[], |r| {
        let (number, code) = (r.number("in") as u32, r.number("out") as u32);
        let next = (number + 1) ^ (number + 1) >> 1;
        assert_eq!((code ^ next).count_ones(), 1);
    });
}

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

#[test]
fn numbers_and_bits_by_name() {
    stateless("constant", &[], |r| assert_eq!(r.number("out"), r.number("value")));
    model::<()>("enum", &[("size", 5)], &[("input", 0.0, 9.0)], |_, r| {
        for bit in 0..5 {
            let stands_for = r.number(&format!("val-{bit:02}"));
            assert_eq!(r.bit(&format!("out-{bit:02}")), stands_for == r.number("input"));
        }
    });
    model::<()>("match8", &[], &[("a7", 0.0, 0.0), ("b7", 0.0, 0.4)], |_, r| {
        let number = |name: &str| pins(r, 8, |bit| format!("{name}{bit}"));
        assert_eq!(r.bit("out"), r.bit("in") && number("a") == number("b"));
    });
    let size = [("size", 6), ("input", 2), ("output", 1)];
    let settings = [("debounce-us", 0.0, 0.0), ("sel-int", 0.0, 8.0)];
    model::<f64>("mux_generic", &size, &settings, |kept, r| {
        let number = r.number("sel-int");
        if !(r.bit("suppress-no-input") && number == 0.0) {
            *kept = r.number(&format!("in-s32-{:02}", number.min(5.0)));
        }
        assert_eq!(r.number("out-float"), *kept);
    });
}

#[test]
fn keys() {
    // Each press is one click, and each group of up to four ends as one `-only`.
    let times = [
        ("max-hold-ns", 9e8, 9e8),
        ("max-space-ns", 3e6, 3e6),
        ("output-hold-ns", 1e6, 1e6),
        ("invert-input", 0.0, 0.0),
    ];
    model::<(Past, usize)>("multiclick", &[], &times, |(key, clicks), r| {
        key.push(r.bit("in"));
        let names = ["single", "double", "triple", "quadruple"];
        let told = |end: &str| -> Vec<usize> {
            let set = (1..=4).filter(|n| r.bit(&format!("{}-click{end}", names[n - 1])));
            set.collect()
        };
        // A key that is pressed at the start is a press.
        let pressed = key.rose() || key.seen.len() == 1 && key.now();
        let falls = key.fell();
        let is_over = !key.now() && key.lasts() == 5;
        match (*clicks, pressed, falls, is_over) {
            (..=3, _, true, _) => {
                *clicks += 1;
                assert_eq!((told(""), told("-only")), (vec![*clicks], vec![]));
            }
            (4, true, ..) => *clicks = 5,
            (5, _, true, _) => *clicks = 0,
            (1..=4, _, _, true) => {
                assert_eq!((told(""), told("-only")), (vec![], vec![*clicks]));
                *clicks = 0;
            }
            _ => assert_eq!((told(""), told("-only")), (vec![], vec![])),
        }
    });
    model::<(Past, f64)>(
        "message",
        &[],
        &[("force", 0.0, 0.0), ("edge", 0.0, 0.0)],
        |(trigger, times), r| {
            trigger.push(r.bit("trigger"));
            *times += f64::from(u8::from(trigger.fell() || trigger.seen.len() == 1 && !trigger.now()));
            assert_eq!((r.bit("show"), r.number("count")), (!trigger.now(), *times));
        },
    );
    for kind in ["toggle2nist", "momentary2nist"] {
        let settings = [("debounce", 1.0, 1.0), ("max-pulse-length", 4.0, 4.0)];
        model::<(Past, Option<bool>, u32)>(kind, &[], &settings, |(key, pulse, calls), r| {
            key.push(r.bit("in"));
            let is_on = r.bit("is-on");
            *calls += 1;
            if *pulse == Some(is_on) || *calls > 4 {
                *pulse = None;
            }
            let asked = match kind {
                "toggle2nist" => (key.rose() || key.fell()).then_some(key.now()),
                _ => key.rose().then_some(!is_on),
            };
            if let Some(wanted) = asked.filter(|wanted| *wanted != is_on) {
                (*pulse, *calls) = (Some(wanted), 1);
            }
            assert_eq!(
                (r.bit("on"), r.bit("off")),
                (*pulse == Some(true), *pulse == Some(false))
            );
        });
    }
}

#[test]
fn a_simulated_encoder_counts_its_speed() {
    let settings = [("ppr", 25.0, 25.0), ("scale", 1.0, 1.0), ("speed", -9.0, 9.0)];
    model::<(f64, f64)>("sim_encoder", &[], &settings, |(turned, a_call), r| {
        *turned += *a_call;
        *a_call = r.number("speed") * 100.0 * T;
        assert!((r.number("rawcounts") - *turned).abs() <= 1.0);
        let place = (r.number("rawcounts") as i32).rem_euclid(100);
        assert_eq!(r.bit("phase-z"), place == 0);
        assert_eq!(
            (r.bit("phase-a"), r.bit("phase-b")),
            (place % 4 < 2, (1..=2).contains(&(place % 4)))
        );
    });
}
