//! Conversions between types.

use super::{model, pins, place, stateless};

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
