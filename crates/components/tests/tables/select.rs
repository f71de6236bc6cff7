//! One of several: switches, names for numbers and bits.

use crate::rig::{T, table};

#[test]
fn one_of_several() {
    table("mux2", &[], T, "in0 1\n in1 2\n sel 0 1\n > out 1 2");
    table(
        "mux4",
        &[],
        T,
        "in0 1\n in1 2\n in2 3\n in3 4\n sel0 0 1 0 1\n sel1 0 0 1 1\n > out 1 2 3 4",
    );
    table(
        "mux8",
        &[],
        T,
        "in1 1\n in4 4\n in7 7\n sel0 1 0 1\n sel1 0 0 1\n sel2 0 1 1\n > out 1 4 7",
    );
    table(
        "mux16",
        &[],
        1.0,
        "in01 1.5\n in02 2.5\n in03 3.5\n sel0 0 1 1 1 0 0 0\n sel1 0 0 1 1 1 1 1\n debounce-time 1
         > out-f 0 0 0 3.5 3.5 2.5 2.5\n > selected 0 0 0 3 3 2 2",
    );
    table(
        "mux16",
        &[],
        T,
        "in02 2.5\n in03 -3.5\n use-graycode 0 1 1\n suppress-no-input 1\n sel0 0 0 0\n sel1 1 1 0\n
         > out-f 2.5 -3.5 -3.5\n > out-s 2 -3 -3",
    );
    table(
        "select8",
        &[],
        T,
        "sel 0 7 8 -1 1\n enable 1 1 1 1 0\n > out0 1 0 0 0 0\n > out7 0 1 0 0 0\n > out1 0 0 0 0 0",
    );
    table(
        "demux",
        &[("personality", 4)],
        T,
        "sel-bit-00 0 1 1 0 0\n sel-bit-01 0 0 1 0 0\n sel-u32 0 1 9 0 2\n bargraph 0 0 0 1 1
         > out-00 1 0 0 0 1\n > out-01 0 0 0 0 1\n > out-02 0 1 0 0 0\n > out-03 0 0 1 0 0",
    );
    table(
        "multiswitch",
        &[("personality", 4)],
        T,
        "up 0 1 0 1 0\n down 0 0 0 0 1\n top-position 1\n > position 0 1 1 0 1\n > bit-01 0 1 1 0 1",
    );
    table(
        "mux_generic",
        &[("size", 3), ("input", 0), ("output", 2)],
        T,
        "in-bit-01 1\n sel-int 0 1 2 7\n > out-s32 0 1 0 0\n > selected 0 1 2 7",
    );
    table(
        "mux_generic",
        &[("size", 4), ("output", 3)],
        T,
        "in-float-00 -1.5\n in-float-01 1.5\n in-float-03 5e9\n sel-bit-00 0 1 1 1 1 0\n sel-bit-01 0 0 1 1 1 0\n debounce-us 2000
         suppress-no-input 0 0 0 0 0 1
         > out-u32 0 0 0 4294967295 4294967295 4294967295\n > elapsed 0 1000 2000 0 0 0\n > selected 0 0 0 3 3 3",
    );
    table(
        "enum",
        &[("size", 3)],
        T,
        "input 0 1 2 7\n val-02 7\n > out-00 1 0 0 0\n > out-01 0 1 0 0\n > out-02 0 0 0 1",
    );
    table(
        "enum",
        &[("mode", 1), ("size", 3)],
        T,
        "in-00 0 1 1\n in-02 0 0 1\n val-00 4\n > output 0 4 2",
    );
    table(
        "match8",
        &[],
        T,
        "a0 1 1 1 0\n b0 0 1 1 0\n b7 0 0 0 1\n in 1 1 0 1\n > out 0 1 0 0",
    );
    table("constant", &[], T, "value 1.5\n > out 1.5");
    table(
        "multiswitch",
        &[("personality", 3)],
        T,
        "up 1 0 1 0 1 0 1 0 0\n down 0 0 0 0 0 0 0 0 1\n > position 0 0 1 1 2 2 0 0 2\n > bit-00 1 1 0 0 0 0 1 1 0",
    );
}
