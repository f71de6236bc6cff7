//! Gates, and what keeps a bit or a number.

use crate::rig::{T, table};

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
