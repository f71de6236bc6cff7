//! Gates, and what keeps a bit or a number.

use super::{Past, model, pins, place, stateless};

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
