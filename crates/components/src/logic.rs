//! Logic of bits: gates, tables, latches.

use crate::component::{Component, Options};
use crate::declare::component;
use crate::edge::Edge;

component! {
    /// True while both inputs are.
    And2 = "and2";
    in { in0: bool = false, "one operand"; in1: bool = false, "the other"; }
    out { out: bool = false, "`in0` and `in1`"; }
}

impl Component for And2 {
    fn update(&mut self, _: f64) {
        self.out = self.in0 && self.in1;
    }
}

component! {
    /// True while at least one input is.
    Or2 = "or2";
    in { in0: bool = false, "one operand"; in1: bool = false, "the other"; }
    out { out: bool = false, "`in0` or `in1`"; }
}

impl Component for Or2 {
    fn update(&mut self, _: f64) {
        self.out = self.in0 || self.in1;
    }
}

component! {
    /// True while the inputs differ.
    Xor2 = "xor2";
    in { in0: bool = false, "one operand"; in1: bool = false, "the other"; }
    out { out: bool = false, "`in0` other than `in1`"; }
}

impl Component for Xor2 {
    fn update(&mut self, _: f64) {
        self.out = self.in0 != self.in1;
    }
}

component! {
    /// True while the input is false.
    Not = "not";
    in { in_: bool = false, "operand"; }
    out { out: bool = false, "not `in`"; }
}

impl Component for Not {
    fn update(&mut self, _: f64) {
        self.out = !self.in_;
    }
}

component! {
    /// Any function of five bits, as a table.
    Lut5 = "lut5";
    in {
        in_ as "in-#": [bool; 5] = [false; 5], "bit N of the place in the table";
        function: u32 = 0, "the table: bit n is the result at place n; and 0x80000000, or 0xFFFFFFFE, or of two 0xE, xor of two 0x6";
    }
    out { out: bool = false, "bit of `function` at the place that the inputs name"; }
}

impl Component for Lut5 {
    fn update(&mut self, _: f64) {
        let place = bits(&self.in_);
        self.out = self.function >> (place & 31) & 1 != 0;
    }
}

/// The number that bits make, the first one the least. RT.
pub(crate) fn bits(bits: &[bool]) -> u32 {
    bits.iter()
        .take(32)
        .enumerate()
        .fold(0, |number, (at, bit)| number | u32::from(*bit) << at)
}

component! {
    /// Gates of many inputs; all five functions at once.
    Logic = "logic";
    options { personality: 2, 1..=16, [], "number of inputs"; }
    in { in_ as "in-##": Vec<bool> = vec![false; 2], "an operand"; }
    out {
        and: bool = false, "all inputs are true";
        or: bool = false, "at least one is";
        xor: bool = false, "an odd number is";
        nand: bool = false, "not `and`";
        nor: bool = false, "not `or`";
    }
}

impl Component for Logic {
    fn shape(&mut self, options: &Options<'_>) {
        self.in_ = vec![false; options.count("personality")];
    }

    fn update(&mut self, _: f64) {
        let set = self.in_.iter().filter(|bit| **bit).count();
        self.and = set == self.in_.len();
        self.or = set > 0;
        self.xor = set % 2 == 1;
        (self.nand, self.nor) = (!self.and, !self.or);
    }
}

component! {
    /// True while at least two of three inputs are.
    Maj3 = "maj3";
    in {
        in1: bool = false, "a vote";
        in2: bool = false, "a vote";
        in3: bool = false, "a vote";
        invert: bool = false, "turns the result around";
    }
    out { out: bool = false, "majority"; }
}

impl Component for Maj3 {
    fn update(&mut self, _: f64) {
        let votes = [self.in1, self.in2, self.in3];
        self.out = (votes.iter().filter(|vote| **vote).count() >= 2) != self.invert;
    }
}

component! {
    /// Whether eight bits are the same as eight others.
    Match8 = "match8";
    in {
        in_: bool = true, "else the output is false; from the output of another one, for more bits";
        a as "a#": [bool; 8] = [false; 8], "bit of one number";
        b as "b#": [bool; 8] = [false; 8], "the same bit of the other";
    }
    out { out: bool = false, "`in`, and all bits are the same"; }
}

impl Component for Match8 {
    fn update(&mut self, _: f64) {
        self.out = self.in_ && self.a == self.b;
    }
}

component! {
    /// Logic of the bits of two numbers.
    Bitwise = "bitwise";
    in { in0: u32 = 0, "one operand"; in1: u32 = 0, "the other"; }
    out {
        out_and: u32 = 0, "bits that both have";
        out_or: u32 = 0, "bits that one has";
        out_xor: u32 = 0, "bits that just one has";
        out_nand: u32 = 0, "not `out-and`";
        out_nor: u32 = 0, "not `out-or`";
        out_xnor: u32 = 0, "not `out-xor`";
    }
}

impl Component for Bitwise {
    fn update(&mut self, _: f64) {
        let (a, b) = (self.in0, self.in1);
        (self.out_and, self.out_or, self.out_xor) = (a & b, a | b, a ^ b);
        (self.out_nand, self.out_nor, self.out_xnor) = (!(a & b), !(a | b), !(a ^ b));
    }
}

component! {
    /// D flip-flop; reset beats set, and set beats the clock.
    Flipflop = "flipflop";
    in {
        data: bool = false, "value taken at a rising edge of the clock";
        clk: bool = false, "clock";
        set: bool = false, "sets at once";
        reset: bool = false, "clears at once";
    }
    out { out: bool = false, "value"; out_not: bool = true, "not `out`"; }
    state { clock: Edge = Edge::default(); }
}

impl Component for Flipflop {
    fn update(&mut self, _: f64) {
        let rises = self.clock.rises(self.clk);
        self.out = match (self.reset, self.set, rises) {
            (true, _, _) => false,
            (false, true, _) => true,
            (false, false, true) => self.data,
            (false, false, false) => self.out,
        };
        self.out_not = !self.out;
    }
}

component! {
    /// Follows the input while enabled, else keeps what it has.
    TristateBit = "tristate_bit";
    in { in_: bool = false, "value"; enable: bool = false, "takes it"; }
    out { out: bool = false, "last value that was taken"; }
}

impl Component for TristateBit {
    fn update(&mut self, _: f64) {
        if self.enable {
            self.out = self.in_;
        }
    }
}

component! {
    /// Follows the input while enabled, else keeps what it has.
    TristateFloat = "tristate_float";
    in { in_: f64 = 0.0, "value"; enable: bool = false, "takes it"; }
    out { out: f64 = 0.0, "last value that was taken"; }
}

impl Component for TristateFloat {
    fn update(&mut self, _: f64) {
        if self.enable {
            self.out = self.in_;
        }
    }
}

component! {
    /// Keeps a number while `hold`, else follows it.
    SampleHold = "sample_hold";
    in { in_: i32 = 0, "value"; hold: bool = false, "keeps the value"; }
    out { out: i32 = 0, "value, or what it was"; }
}

impl Component for SampleHold {
    fn update(&mut self, _: f64) {
        if !self.hold {
            self.out = self.in_;
        }
    }
}
