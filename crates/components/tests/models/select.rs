//! One of several: switches, names for numbers and bits.

use super::{Past, model, pins, place, stateless};

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
