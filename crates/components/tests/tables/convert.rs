//! Conversions between types.

use crate::rig::{T, table};

#[test]
fn conversions() {
    table(
        "conv_float_s32",
        &[],
        T,
        "in 1.9 -1.9 3e9 3e9 nan\n clamp 1 1 1 0 1\n > out 1 -1 2147483647 -1294967296 -1294967296\n > out-of-range 0 0 1 1 1",
    );
    table(
        "conv_float_u32",
        &[],
        T,
        "in 1.9 -1 5e9 -0.5\n clamp 1\n > out 1 0 4294967295 0\n > out-of-range 0 1 1 1",
    );
    table(
        "conv_s32_u32",
        &[],
        T,
        "in 5 -1 -1\n clamp 1 1 0\n > out 5 0 4294967295\n > out-of-range 0 1 1",
    );
    table(
        "conv_u32_s32",
        &[],
        T,
        "in 5 4294967295 4294967295\n clamp 1 1 0\n > out 5 2147483647 -1\n > out-of-range 0 1 1",
    );
    table("conv_u32_s32", &[], T, "in 4294967295\n > out -1\n > out-of-range 1");
    table(
        "conv_s32_bit",
        &[],
        T,
        "in 0 1 2 -1 2 -1\n clamp 1 1 1 1 0 0\n > out 0 1 1 0 1 1\n > out-of-range 0 0 1 1 1 1",
    );
    table(
        "conv_u32_bit",
        &[],
        T,
        "in 0 1 2 2\n clamp 1 1 1 0\n > out 0 1 1 1\n > out-of-range 0 0 1 1",
    );
    table("conv_bit_float", &[], T, "in 0 1\n > out 0 1");
    table("conv_bit_s32", &[], T, "in 0 1\n > out 0 1");
    table("conv_bit_u32", &[], T, "in 0 1\n > out 0 1");
    table("conv_s32_float", &[], T, "in -7\n > out -7");
    table("conv_u32_float", &[], T, "in 4294967295\n > out 4294967295");
    table(
        "bitslice",
        &[("personality", 3)],
        T,
        "in 5 2\n > out-00 1 0\n > out-01 0 1\n > out-02 1 0",
    );
    table(
        "bitmerge",
        &[("personality", 3)],
        T,
        "in-00 1 0\n in-01 0 1\n in-02 1 0\n > out 5 2",
    );
    table("gray2bin", &[], T, "in 0 1 3 2 6\n > out 0 1 2 3 4");
    table("bin2gray", &[], T, "in 0 1 2 3 4\n > out 0 1 3 2 6");
}
