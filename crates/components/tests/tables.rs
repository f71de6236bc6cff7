//! Every component as a table: a pin a line, a call a column.
//!
//! The figures are worked out by hand from what each component is to do.

use crate::rig;

use rig::{Rig, T, table};

#[test]
fn gates() {
    table("and2", &[], T, "in0 0 1 0 1\n in1 0 0 1 1\n > out 0 0 0 1");
    table("or2", &[], T, "in0 0 1 0 1\n in1 0 0 1 1\n > out 0 1 1 1");
    table("xor2", &[], T, "in0 0 1 0 1\n in1 0 0 1 1\n > out 0 1 1 0");
    table("not", &[], T, "in 0 1\n > out 1 0");
    table(
        "maj3",
        &[],
        T,
        "in1 0 1 1 1 1\n in2 0 0 1 1 1\n in3 0 0 0 1 1\n invert 0 0 0 0 1\n > out 0 0 1 1 0",
    );
    table(
        "logic",
        &[("personality", 3)],
        T,
        "in-00 0 1 1 1\n in-01 0 0 1 1\n in-02 0 0 0 1
         > and 0 0 0 1\n > or 0 1 1 1\n > xor 0 1 0 1\n > nand 1 1 1 0\n > nor 1 0 0 0",
    );
    table(
        "bitwise",
        &[],
        T,
        "in0 12\n in1 10\n > out-and 8\n > out-or 14\n > out-xor 6
         > out-nand 0xFFFFFFF7\n > out-nor 0xFFFFFFF1\n > out-xnor 0xFFFFFFF9",
    );
}

#[test]
fn the_tables_of_the_fact_sheet_make_the_gates_of_five_inputs() {
    for (function, result) in [(0x8000_0000u32, [0, 0, 0, 1]), (0xFFFF_FFFE, [0, 1, 1, 1])] {
        let [a, b, c, d] = result;
        table(
            "lut5",
            &[],
            T,
            &format!(
                "function {function}\n in-0 0 1 1 1\n in-1 0 0 1 1\n in-2 0 0 0 1\n in-3 0 0 0 1\n in-4 0 0 0 1
                 > out {a} {b} {c} {d}"
            ),
        );
    }
    table(
        "lut5",
        &[],
        T,
        "function 0x6\n in-0 0 1 0 1\n in-1 0 0 1 1\n > out 0 1 1 0",
    );
}

#[test]
fn what_remembers() {
    table(
        "flipflop",
        &[],
        T,
        "data  1 1 1 0 0 1 1 1
         clk   1 0 1 1 0 1 0 1
         set   0 0 0 0 1 0 0 1
         reset 0 0 0 0 0 0 1 1
         > out 0 0 1 1 1 1 0 0
         > out-not 1 1 0 0 0 0 1 1",
    );
    table("tristate_bit", &[], T, "in 1 1 0 0\n enable 0 1 0 1\n > out 0 1 1 0");
    table("tristate_float", &[], T, "in 1 2 3 4\n enable 0 1 0 1\n > out 0 2 2 4");
    table("sample_hold", &[], T, "in 1 2 3 4\n hold 0 1 1 0\n > out 1 1 1 4");
    table(
        "estop_latch",
        &[],
        T,
        "ok-in    1 1 1 1 0 1 1 1 1
         fault-in 0 0 0 0 0 0 0 0 1
         reset    1 0 1 1 1 1 0 1 1
         > ok-out    0 0 1 1 0 0 0 1 0
         > fault-out 1 1 0 0 1 1 1 0 1
         > watchdog  0 0 1 0 0 0 0 1 1",
    );
    table(
        "safety_latch",
        &[],
        T,
        "error-in 1 1 0 1 1 0 0 0 0 0
         threshold 3
         reset    0 0 0 0 0 0 0 0 0 1
         > count  1 2 1 2 3 2 1 0 0 0
         > error-out 0 0 0 0 1 1 1 1 1 0
         > ok-out    1 1 1 1 0 0 0 0 0 1",
    );
    table(
        "safety_latch",
        &[],
        T,
        "error-in 1 1 0 0\n threshold 2\n latching 0\n > error-out 0 1 0 0",
    );
    table(
        "watchdog",
        &[("num_inputs", 2)],
        1.0,
        "input-0  0 1 0 1 1 1 1 1 1
         input-1  0 1 0 1 0 1 0 1 0
         timeout-0 2\n timeout-1 2
         enable-in 0 1 1 1 1 1 1 0 1
         > ok-out  0 1 1 1 1 1 0 0 1",
    );
}

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

#[test]
fn keys() {
    let settings = "max-hold-ns 2000000\n max-space-ns 2000000\n output-hold-ns 1000000\n";
    table(
        "multiclick",
        &[],
        T,
        &format!(
            "{settings} in 0 1 0 0 1 0 0 0 0 0 0\n > single-click 0 0 1 0 0 0 0 0 0 0 0\n > double-click 0 0 0 0 0 1 0 0 0 0 0
             > single-click-only 0\n > double-click-only 0 0 0 0 0 0 0 0 1 0 0\n > state 0 1 2 2 3 4 4 4 0 0 0"
        ),
    );
    // Held for too long it is no click; a fifth one ends all.
    table(
        "multiclick",
        &[],
        T,
        &format!("{settings} in 0 1 1 1 1 0 0 1\n > single-click 0\n > state 0 1 1 1 9 0 0 1"),
    );
    table(
        "multiclick",
        &[],
        T,
        &format!(
            "{settings} invert-input 1\n in 1 0 1 0 1 0 1 0 1 0 1\n > quadruple-click 0 0 0 0 0 0 0 0 1 0 0
             > triple-click 0 0 0 0 0 0 1 0 0 0 0\n > quadruple-click-only 0\n > state 0 1 2 3 4 5 6 7 8 9 0"
        ),
    );
    table(
        "message",
        &[],
        0.05,
        "trigger 1 1 1 1 1 0 1\n force 1 0 1 1 1 1 1\n > show 1 1 0 0 1 0 1\n > count 1 1 2 2 2 2 3",
    );
    table(
        "message",
        &[],
        T,
        "trigger 0 1 0\n edge 0\n > show 1 0 1\n > count 1 1 2",
    );
    // A pulse that the device answers, one that it does not, and a switch that asks for what it is.
    table(
        "toggle2nist",
        &[],
        T,
        "in 0 1 0 1 1 1 1 0 0 0 0 0 0 1 1\n is-on 0 0 0 0 0 0 1 1 1 1 1 1 1 1 1\n max-pulse-length 3
         > on 0 0 0 0 1 1 0 0 0 0 0 0 0 0 0\n > off 0 0 0 0 0 0 0 0 1 1 1 0 0 0 0",
    );
    table(
        "momentary2nist",
        &[],
        T,
        "in 1 1 0 0 1 1 0 0 1 1 1\n is-on 0 0 0 0 0 0 1 1 1 1 0
         > on 0 0 0 0 0 1 0 0 0 0 0\n > off 0 0 0 0 0 0 0 0 0 1 0",
    );
}

#[test]
fn a_simulated_encoder_turns_as_a_counter_of_its_phases_sees() {
    // A quarter of a count a call, from the second call on; three pulses a turn.
    table(
        "sim_encoder",
        &[],
        0.25,
        "speed 5\n ppr 3\n scale 60\n > rawcounts 0 0 0 0 1 1 1 1 2 2\n > phase-a 1 1 1 1 1 1 1 1 0 0
         > phase-b 0 0 0 0 1 1 1 1 1 1\n > phase-z 1 1 1 1 0 0 0 0 0 0",
    );
    // Backward, and no faster than a count a call.
    table(
        "sim_encoder",
        &[],
        1.0,
        "speed -9\n ppr 1\n > rawcounts 0 -1 -2 -3 -4\n > phase-a 1 0 0 1 1\n > phase-b 0 0 1 1 0\n > phase-z 1 0 0 0 1",
    );
}

#[test]
fn time() {
    table(
        "edge",
        &[],
        T,
        "in 1 1 0 0 1 0\n in-edge 1\n > out 0 0 1 0 0 1\n > out-invert 1 1 0 1 1 0",
    );
    table(
        "edge",
        &[],
        T,
        "in 0 1 1 1 1\n in-edge 0\n out-width-ns 2500000\n > out 0 1 1 1 0",
    );
    table("edge", &[], T, "in 0 1 0\n both 1\n > out 0 1 1");
    table(
        "oneshot",
        &[],
        T,
        "in     1 0 1 1 1 1 1 0 1 0 1
         width  0.003
         reset  0 0 0 0 0 0 0 0 0 1 0
         > out  0 0 1 1 1 0 0 0 1 0 1
         > time-left 0 0 0.003 0.002 0.001 0 0 0 0.003 0 0.003",
    );
    table(
        "oneshot",
        &[],
        T,
        "in 0 1 0 1 0 1 0\n width 0.003\n retriggerable 0\n > out 0 1 1 1 0 1 1",
    );
    table(
        "oneshot",
        &[],
        T,
        "in 0 1 1 0 0\n width 0.001\n rising 0\n falling 1\n > out 0 0 0 1 0",
    );
    table(
        "timedelay",
        &[],
        1.0,
        "in 1 1 1 0 0 1 0 0 0\n on-delay 3\n off-delay 2\n > out 0 0 1 1 0 0 0 0 0\n > elapsed 1 2 3 1 2 1 1 1 1",
    );
    table(
        "ton",
        &[],
        0.01,
        "in 0 1 1 1 1 1 0 1 1 0 0 1\n pt 0.03\n > q 0 0 0 0 1 1 0 0 0 0 0 0\n > et 0 0.01 0.02 0.03 0.03 0.03 0 0.01 0.02 0 0 0.01",
    );
    table(
        "ton",
        &[],
        0.01,
        "in 0 1 1 1 1 0\n pt 0.025\n > q 0 0 0 0 1 0\n > et 0 0.01 0.02 0.03 0.03 0",
    );
    table("ton", &[], 0.01, "in 0 1 1 0\n pt 0\n > q 0 1 1 0");
    table(
        "tof",
        &[],
        0.01,
        "in 0 0 1 1 0 0 0 0 0 1 0 1\n pt 0.03\n > q 0 0 1 1 1 1 1 0 0 1 1 1\n > et 0.01 0.02 0 0 0.01 0.02 0.03 0.03 0.03 0 0.01 0",
    );
    table("tof", &[], 0.01, "in 0 1 0\n pt 0\n > q 0 1 0");
    table(
        "dbounce",
        &[],
        T,
        "in 1 1 1 1 0 0 0 1 0 0\n delay 2\n > out 0 0 1 1 1 1 0 0 0 0",
    );
    table(
        "debounce",
        &[("cfg", 2)],
        T,
        "0.in 1 1 1\n 1.in 1 0 1\n delay 2\n > 0.out 0 0 1\n > 1.out 0 0 0",
    );
    table(
        "toggle",
        &[],
        T,
        "in 1 1 0 0 1 1 1 0 0 1 0 0 1 1\n > out 0 0 0 0 0 1 1 1 1 1 1 1 1 0",
    );
    table(
        "blink",
        &[],
        0.25,
        "frequency 1\n duty 0.5\n enable 1 1 1 1 1 0 1\n > out 1 1 0 0 1 0 1",
    );
    table(
        "charge_pump",
        &[],
        T,
        "enable 1 1 1 1 0 1\n > out 1 0 1 0 0 1\n > out-2 0 1 1 0 0 0\n > out-4 0 0 0 1 0 1",
    );
    table(
        "time",
        &[],
        1800.0,
        "start 1 1 1 1 0 1\n pause 0 0 1 0 0 0\n > hours 0 1 1 1 1 0\n > minutes 30 0 0 30 30 30\n > seconds 0",
    );
}

#[test]
fn arithmetic() {
    table(
        "sum2",
        &[],
        T,
        "in0 2\n in1 3\n gain0 1 10\n offset 0 0.5\n > out 5 23.5",
    );
    table("mult2", &[], T, "in0 2 -2\n in1 3 nan\n > out 6 nan");
    table(
        "div2",
        &[],
        T,
        "in0 6 6 6\n in1 3 0.1 -0.1\n deadband 0.5\n > out 2 12 -12",
    );
    table("div2", &[], T, "in0 1\n > out 1e12");
    table(
        "invert",
        &[],
        T,
        "in 4 0 0.1 -0.5\n deadband 0 0 0.2 0.2\n > out 0.25 0 0 -2",
    );
    table(
        "abs",
        &[],
        T,
        "in 2 -2 0\n > out 2 2 0\n > sign 0 1 0\n > is-positive 1 0 0\n > is-negative 0 1 0",
    );
    table(
        "abs_s32",
        &[],
        T,
        "in 2 -2147483648\n > out 2 2147483647\n > sign 0 1\n > is-positive 1 0",
    );
    table("hypot", &[], T, "in0 2\n in1 3\n in2 6\n > out 7");
    table("scale", &[], T, "in 3\n gain 0 2\n offset 1\n > out 1 7");
    table("offset", &[], T, "offset 2\n in 10\n fb-in 12\n > out 12\n > fb-out 10");
    table(
        "weighted_sum",
        &[("personality", 3)],
        T,
        "bit.0.in 1 1\n bit.2.in 1 1\n bit.2.weight 4 40\n offset 100\n hold 0 1\n > sum 105 105",
    );
    table(
        "scaled_s32_sums",
        &[],
        T,
        "in0 3\n in1 -1\n scale1 0.5\n in3 2\n scale3 10\n > out-f 22.5\n > out-s 22",
    );
    table(
        "blend",
        &[],
        T,
        "in1 10\n in2 20\n select 0 1 0.25 2 2\n open 0 0 0 0 1\n > out 20 10 17.5 10 0",
    );
    table(
        "feedcomp",
        &[],
        T,
        "in 8\n vel 5\n feed 10 10 0\n enable 0 1 1\n > out 8 4 0",
    );
    table(
        "lincurve",
        &[("personality", 3)],
        T,
        "x-val-00 -1\n y-val-00 5\n x-val-01 1\n y-val-01 15\n x-val-02 2\n y-val-02 0
         in -9 -1 0 1 1.5 9 nan\n > out 5 5 10 15 7.5 0 nan",
    );
    table(
        "led_dim",
        &[],
        T,
        "in 0 0.08 0.42 1 2\n > out 0 0.008856415365880 0.125 1 1",
    );
}

#[test]
fn limits() {
    table(
        "limit1",
        &[],
        T,
        "in 5 -5 0.5 nan 3\n min -1\n max 1\n > out 1 -1 0.5 0.5 1",
    );
    // The upper limit is the last word.
    table("limit1", &[], T, "in 5\n min 3\n max 1\n > out 1");
    table(
        "limit2",
        &[],
        0.5,
        "in 10 10 -10 -10 nan\n max 9\n maxv 4\n load 0 0 0 1 0\n > out 2 4 2 -10 -10",
    );
    table("limit3", &[], 1.0, "in 9\n maxv 3\n maxa 1\n > out 1 3 6 8 9 9 9 9");
    table(
        "limit3",
        &[],
        1.0,
        "in 6 6 6 6 6\n load 1 0 0 0 0\n enable 1 0 0 0 0\n maxa 1\n > out 6 5 3 1 0",
    );
    table(
        "deadzone",
        &[],
        T,
        "in 3 0.4 -3 nan\n center 0 0 0 0\n > out 2.5 0 -2.5 nan",
    );
    table(
        "comp",
        &[],
        T,
        "in0 5\n in1 5 5.4 5.6 4.6 4.4 nan\n hyst 1\n > out 0 0 1 1 0 0\n > equal 1 1 0 1 0 0",
    );
    table(
        "wcomp",
        &[],
        T,
        "in 1 2 3 4 5 nan\n min 2\n max 4\n > out 0 0 1 0 0 0\n > under 1 1 0 0 0 0\n > over 0 0 0 1 1 0",
    );
    table(
        "near",
        &[],
        T,
        "in1 100 100 100 -100 100\n in2 101 99 103 -101 nan\n scale 1.02\n > out 1 1 0 1 0",
    );
    table("near", &[], T, "in1 1\n in2 1.5 1.6 1\n difference 0.5\n > out 1 0 1");
    table(
        "sim_home_switch",
        &[],
        T,
        "cur-pos 0 1 0.95 0.9 2\n > home-sw 0 1 1 0 1",
    );
    table(
        "sim_home_switch",
        &[],
        T,
        "home-pos -1\n cur-pos 0 -1 -0.95 -0.9\n > home-sw 0 1 1 0",
    );
}

#[test]
fn filters() {
    table(
        "lowpass",
        &[],
        T,
        "in 8 8 nan 8 1\n load 0 0 0 0 1\n gain 0.5\n > out 4 6 6 7 1",
    );
    table("ilowpass", &[], T, "in 1 1 0\n scale 1000\n > out 500 750 375");
    // A hand wheel goes on beyond the end of its counts.
    table(
        "ilowpass",
        &[],
        T,
        "in 2097151 2097152 -2097153\n scale 1024\n gain 1\n > out 2147482624 -2147483648 2147482624",
    );
    table("ddt", &[], 0.5, "in 3 4 4 2\n > out 0 2 0 -4");
    table(
        "integ",
        &[],
        0.5,
        "in 4 4 nan 4 4\n gain 2\n max 7\n reset 0 0 0 0 1\n > out 4 7 7 7 0",
    );
    table(
        "minmax",
        &[],
        T,
        "in 3 5 nan -1 2\n reset 0 0 0 0 1\n > max 3 5 5 5 2\n > min 0 0 0 -1 2",
    );
    table(
        "probe_filter",
        &[],
        T,
        "in 0 1 0 1 1 0 0 0 0 0\n delay 2\n dead-time 0.003\n > out 0 0 0 0 1 1 1 0 0 0\n > bounces 0 0 1 1 1 1 1 1 1 1",
    );
    // Own coefficients: the mean of two values.
    table(
        "biquad",
        &[],
        T,
        "in 2 4 4 8\n type 0\n n0 0.5\n n1 0.5\n enable 0 1 1 1\n > out 2 2 4 6\n > valid 0 1 1 1",
    );
    table(
        "biquad",
        &[],
        T,
        "in 2\n type 1\n f0 501\n enable 1\n > out 2\n > valid 0",
    );
}

#[test]
fn a_notch_takes_out_its_frequency_and_leaves_direct_current() {
    for (frequency, gain) in [(50.0, 0.0), (0.0, 1.0)] {
        let mut rig = Rig::new("biquad", &[]);
        rig.set("type", 2u32);
        rig.set("f0", 50.0);
        rig.set("enable", true);
        let mut peak = 0f64;
        for call in 0..2000 {
            let phase = std::f64::consts::TAU * frequency * f64::from(call) * T;
            rig.set("in", libm::cos(phase));
            rig.update(T);
            if call > 1000 {
                peak = peak.max(rig.number("out").abs());
            }
        }
        assert!((peak - gain).abs() < 1e-6, "{frequency} Hz: {peak}");
    }
}

#[test]
fn counting() {
    table(
        "updown",
        &[],
        T,
        "countup   1 0 1 0 1 0 1 0 0 0\n countdown 0 0 0 0 0 0 0 0 1 0\n max 2\n wrap 1\n reset 0 0 0 0 0 0 0 0 0 1
         > count 0 0 1 1 2 2 0 0 2 0",
    );
    table("updown", &[], T, "countdown 0 1 0 1\n clamp 1 1 1 0\n > count 0 0 0 -1");
    table(
        "counter",
        &[],
        0.5,
        "phase-a 0 1 0 1 0 1 0\n phase-z 0 0 0 1 0 0 0\n index-enable 1 1 1 1 1 0 0\n position-scale 2
         > rawcounts 0 1 1 2 2 3 3\n > counts 0 1 1 0 0 1 1\n > position 0 0.5 0.5 0 0 0.5 0.5\n > indexed 0 0 0 1 1 0 0
         > velocity 0 1 0 1 0 1 0",
    );
    // A reset clears all counts, an index those behind it; it counts from the call behind that which asks for it.
    table(
        "counter",
        &[],
        0.5,
        "phase-a 0 1 0 1 0 1 0\n phase-z 0 0 1 0 0 0 1\n index-enable 0 0 1 1 1 1 1\n reset 0 0 0 0 1 0 0
         > rawcounts 0 1 1 2 0 1 1\n > counts 0 1 1 2 0 1 0\n > indexed 0 0 0 0 0 0 1\n > velocity 0 2 0 2 0 2 0",
    );
    table(
        "encoder",
        &[],
        T,
        "phase-a 0 1 1 0 0 1 0 0\n phase-b 0 0 1 1 0 0 0 1\n > counts 0 1 2 3 4 5 4 3\n > rawcounts 0 1 2 3 4 5 4 3",
    );
    table(
        "encoder",
        &[],
        T,
        "phase-a 0 1 1 0 0\n phase-b 0 0 1 1 0\n x4-mode 0\n > counts 0 1 1 1 1",
    );
    // Whatever phases it finds at the start.
    table(
        "encoder",
        &[],
        T,
        "phase-a 1 0 0 1 1 0\n phase-b 1 1 0 0 0 0\n x4-mode 0\n > counts 0 0 0 1 1 0",
    );
    // Two of six teeth are missing: they count, and the tooth behind them is the index.
    table(
        "encoder",
        &[],
        T,
        "phase-a 0 1 0 1 0 1 0 1 0 0 0 0 0 1 0 1 0 1\n counter-mode 1\n missing-teeth 2\n position-scale 6\n index-enable 1
         > rawcounts 0 1 1 2 2 3 3 4 4 4 4 4 4 7 7 8 8 9\n > counts 0 1 1 2 2 3 3 4 4 4 4 4 4 0 0 1 1 2
         > indexed 0 0 0 0 0 0 0 0 0 0 0 0 0 1 1 1 1 1",
    );
    table("encoder", &[], T, "phase-a 0 1 0 1\n counter-mode 1\n > counts 0 1 1 2");
    table(
        "encoder",
        &[],
        T,
        "phase-a 0 1 1 0 0\n phase-b 0 0 1 1 0\n latch-input 0 0 1 1 0\n latch-falling 0\n reset 0 0 0 0 1\n > counts-latched 0 0 2 2 -2
         position-scale 4\n > position-latched 0 0 0.5 0.5 -0.5\n > velocity 0 0 0 250 0\n > velocity-rpm 0 0 0 15000 0",
    );
    table(
        "knob2float",
        &[],
        T,
        "counts 50 52 60 0 1\n enable 1 1 1 1 0\n scale 0.1\n > out 0 0.2 1 0 0",
    );
    table(
        "hand_wheel",
        &[],
        T,
        "counts 5 6 7 8 9\n enable 1\n axis 1 1 2 2 -1\n step 0 0 0 0 3
         > jog-counts 5 6 7 8 9\n > jog-enable-1 0 1 0 0 0\n > jog-enable-2 0 0 0 1 0\n > jog-scale 0.001 0.001 0.001 0.001 1",
    );
}

#[test]
fn an_encoder_that_stops_is_slow_and_then_at_rest() {
    let mut rig = Rig::new("encoder", &[]);
    rig.set("counter-mode", true);
    for call in 0..40 {
        rig.set("phase-a", call < 20 && call % 4 == 3);
        rig.update(T);
    }
    // The last edge was 20 calls before this one: 1 count in 21 ms at the most, by its end.
    assert!((rig.number("velocity") - 1.0 / 0.021).abs() < 1e-6);
    assert!(rig.number("position-interpolated") <= rig.number("position") + 1.0);
    for _ in 0..1000 {
        rig.update(T);
    }
    assert_eq!(rig.number("velocity"), 0.0);
}

#[test]
fn an_encoder_below_the_least_speed_shows_none_at_all() {
    // A count each 11 calls of 100 ms: 0.91 a second.
    let mut rig = Rig::new("encoder", &[]);
    rig.set("counter-mode", true);
    for call in 0..200 {
        rig.set("phase-a", call % 11 == 0);
        rig.update(0.1);
        assert_eq!(rig.number("velocity"), 0.0, "call {call}");
        assert_eq!(
            rig.number("position-interpolated"),
            rig.number("position"),
            "call {call}"
        );
    }
    assert_eq!(rig.number("counts"), 18.0);
}

#[test]
fn spindle() {
    table(
        "spindle_monitor",
        &[],
        T,
        "spindle-is-on 0 1 1 1 1 0 0\n spindle-command -100\n threshold 5\n spindle-feedback 0 0 -96 -97 -90 -90 -90
         > spindle-at-speed 0 0 1 1 1 1 0\n > spindle-underspeed 0 0 0 0 1 1 0",
    );
    // The other way round is too slow.
    table(
        "spindle_monitor",
        &[],
        T,
        "spindle-is-on 1\n spindle-command 1000\n threshold 5\n spindle-feedback 1000 1000 2000 -1000
         > spindle-at-speed 0 1 1 1\n > spindle-underspeed 0 0 0 1",
    );
    table(
        "gearchange",
        &[],
        T,
        "speed-in 500 -5 3000 nan\n sel 0 0 1 1\n min1 10\n max2 2000\n scale2 4\n reverse 1\n dir-in 1
         > speed-out 500 -10 500 500\n > dir-out 1 1 0 0",
    );
    table(
        "orient",
        &[],
        T,
        "enable 0 1\n position 3.6\n angle 90\n mode 0\n > command 0 3.25\n > poserr 0 126",
    );
    table(
        "orient",
        &[],
        T,
        "enable 0 1\n position 3.6\n angle 90\n mode 1\n > command 0 4.25",
    );
    table(
        "orient",
        &[],
        T,
        "enable 0 1\n position 3.1\n angle 90\n mode 2\n > command 0 2.25",
    );
    // Enabled from the start; another mode leaves the target where it was.
    table(
        "orient",
        &[],
        T,
        "enable 1 0 1\n position 3.6\n angle 90\n mode 0 3 3\n > command 3.25",
    );
    table(
        "sim_spindle",
        &[],
        0.5,
        "velocity-cmd 90\n scale 0.016666666666666666\n index-enable 0 1 1 1 0\n > position-fb 0.75 0.5 1.25 2 2.75\n > indexed 0 1 1 1 0",
    );
    table(
        "siggen",
        &[],
        0.125,
        "frequency 2\n amplitude 3\n offset 1\n > sine 4 1 -2 1\n > cosine 1 -2 1 4\n > square -2 -2 4 -2\n > triangle 1 -2 1 4
         > sawtooth -0.5 1 2.5 -2\n > clock 0 0 1 0",
    );
}

#[test]
fn a_spindle_is_oriented_after_more_than_100_calls_at_its_angle() {
    let mut rig = Rig::new("orient", &[]);
    rig.set("position", 0.2505);
    rig.set("angle", 90.0);
    rig.update(T);
    rig.set("enable", true);
    let calls = (1..).find(|_| {
        rig.update(T);
        rig.bit("is-oriented")
    });
    assert_eq!(calls, Some(101));
}

#[test]
fn machine() {
    table(
        "gantry",
        &[],
        T,
        "search-vel -1\n position-cmd 0 -1 -2 -3 -2 -1\n joint.00.pos-fb 0 -1 -2 -2 -1 0\n joint.01.pos-fb 0 -1 -2 -3 -2 -1
         joint.00.home 0 0 0 1 1 0\n joint.01.home 0 0 0 0 1 0
         > joint.00.pos-cmd 0 -1 -2 -2 -1 0\n > joint.01.pos-cmd 0 -1 -2 -3 -2 -1
         > joint.00.offset 0 0 0 -1 -1 -1\n > home 0 0 0 0 1 0\n > limit 0 0 0 1 1 0\n > position-fb 0 -1 -2 -3 -2 -1",
    );
    table(
        "thermal_compensation",
        &[],
        1.0,
        "temperature 30 30 30 nan 30\n coefficient 0.00001\n position 500\n max 0.045\n maxv 0.02\n enable 1 1 1 1 0
         > offset -0.02 -0.04 -0.045 -0.045 -0.025\n > limited 1 1 1 1 0",
    );
    table(
        "joyhandle",
        &[],
        T,
        "in 0 0.5 -0.5 1 7\n scale 4\n offset 0\n > out 0 1 -1 4 4",
    );
    table(
        "joyhandle",
        &[],
        T,
        "in 0.1 0.6 1\n deadband 0.2\n power 1\n scale 4\n offset 1\n > out 0 3 5",
    );
    table("joyhandle", &[], T, "in 0.5\n inverse 1\n > out 0.75");
    table(
        "carousel",
        &[("pockets", 8), ("encoding", 1)],
        T,
        "pocket-number 3\n enable 0 1 1 1 1 1 0\n sense-0 1 1 0 0 1 1 1\n sense-1 0 0 1 1 1 1 1\n sense-2 0\n rev-pulse 0.001
         fwd-dc 2\n rev-dc -1\n hold-dc 0.5
         > current-position 1 1 2 2 3 3 3\n > motor-fwd 0 1 1 1 0 0 0\n > motor-rev 0 0 0 0 1 0 0\n > ready 0 0 0 0 0 1 0
         > motor-vel 0.5 2 2 2 -1 0.5 0.5\n > active 0 1 1 1 1 0 0\n > homed 1",
    );
    // The shorter way: from 1 back to 7, which is 15 modulo 8.
    table(
        "carousel",
        &[("pockets", 8), ("encoding", 3), ("num_sense", 8)],
        T,
        "pocket-number 15\n enable 0 1 1 1\n sense-0 1 1 0 0\n sense-7 0 0 1 0\n sense-6 0 0 0 1
         > motor-rev 0 1 1 0\n > ready 0 0 0 1\n > current-position 1 1 8 7",
    );
    table(
        "carousel",
        &[("pockets", 4), ("encoding", 4), ("num_sense", 2), ("dir", 1)],
        T,
        "pocket-number 2\n enable 0 1 1 1 1 1\n sense-0 0 0 0 1 0 0\n sense-1 0 1 0 1 0 1
         > homed 0 0 0 1 1 1\n > motor-fwd 0 1 1 1 1 0\n > current-position 0 0 0 1 1 2\n > ready 0 0 0 0 0 1",
    );
    // It coasts past pocket 3, comes back onto its sensor and off it, and goes slowly forward onto the edge.
    table(
        "carousel",
        &[("pockets", 8), ("encoding", 3), ("num_sense", 8)],
        T,
        "pocket-number 3\n align-dc 0.1\n decel-time 0.002\n fwd-dc 2\n hold-dc 0.5\n enable 0 1 1 1 1 1 1 1 1 0
         sense-0 1 1 0 0 0 0 0 0 0 0\n sense-2 0 0 1 0 0 1 0 0 1 1
         > motor-vel 0.5 2 0 0 -0.1 -0.1 0.1 0.1 0.5 0.5\n > motor-fwd 0 1 0 0 0 0 1 1 0 0\n > motor-rev 0 0 0 0 1 1 0 0 0 0
         > active 0 1 1 1 1 1 1 1 0 0\n > ready 0 0 0 0 0 0 0 0 1 0\n > current-position 1 1 3 3 3 3 3 3 3 3",
    );
    // From turning backward it goes on off the sensor; the pulses of an aligning move count no pocket.
    table(
        "carousel",
        &[("pockets", 6), ("encoding", 4), ("num_sense", 2)],
        T,
        "pocket-number 6\n align-dc 0.1\n enable 0 1 1 1 1 1 1\n sense-0 1 1 0 0 0 0 0\n sense-1 1 1 0 1 1 0 1
         > motor-rev 0 1 1 0 1 0 0\n > motor-fwd 0 0 0 0 0 1 0\n > current-position 1 1 1 6 6 6 6\n > ready 0 0 0 0 0 0 1",
    );
    table(
        "carousel",
        &[("pockets", 6), ("num_sense", 3)],
        T,
        "sense-0 1 1 0\n sense-1 1 0 0\n sense-2 0 1 0\n parity 0\n > current-position 2 6 6\n > parity-error 0 0 0",
    );
    // From 7 to 8 the four bits change a call apart: 15, 14, 12, 8. Pocket 12 passes by in one call, and is none.
    table(
        "carousel",
        &[("pockets", 16), ("encoding", 1)],
        T,
        "pocket-number 12\n debounce 1\n enable 0 1 1 1 1 1 1 1 1\n sense-0 1 1 1 0 0 0 0 0 0\n sense-1 1 1 1 1 0 0 0 0 0
         sense-2 1 1 1 1 1 0 0 1 1\n sense-3 0 0 1 1 1 1 1 1 1
         > current-position 7 7 15 14 12 8 8 12 12\n > motor-fwd 0 1 1 1 1 1 1 1 0\n > ready 0 0 0 0 0 0 0 0 1",
    );
    // Sensors that are no code have no parity; without a strobe nothing is said of it.
    table(
        "carousel",
        &[("encoding", 3), ("num_sense", 8)],
        T,
        "sense-0 1 0\n sense-1 0 1\n parity 0 1\n > parity-error 0 1",
    );
    table("carousel", &[], T, "sense-0 1\n strobe 0 1\n > parity-error 0 1");
    // What was forgotten is sought again; a jog that knows no pocket seeks it, too.
    table(
        "carousel",
        &[("pockets", 4), ("encoding", 4), ("num_sense", 2)],
        T,
        "sense-0 1 0 0 0 1 0 0\n sense-1 1 0 0 0 1 0 1\n unhome 0 0 1 1 1 1 1\n jog-fwd 0 0 0 1 0 1 1
         > homed 1 1 0 0 1 1 1\n > motor-fwd 0 0 0 1 0 1 0\n > current-position 1 1 1 1 1 1 2",
    );
}

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
