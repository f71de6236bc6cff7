//! One of several: multiplexers, decoders, switches.

use crate::component::{Component, Options};
use crate::declare::component;
use crate::edge::Edge;
use crate::logic::bits;

component! {
    /// One of two numbers.
    Mux2 = "mux2";
    in { sel: bool = false, "chooses `in1`"; in_ as "in#": [f64; 2] = [0.0; 2], "a number"; }
    out { out: f64 = 0.0, "the chosen one"; }
}

impl Component for Mux2 {
    fn update(&mut self, _: f64) {
        self.out = self.in_[usize::from(self.sel)];
    }
}

component! {
    /// One of four numbers.
    Mux4 = "mux4";
    in { sel as "sel#": [bool; 2] = [false; 2], "bit of the choice, `sel0` the least"; in_ as "in#": [f64; 4] = [0.0; 4], "a number"; }
    out { out: f64 = 0.0, "the chosen one"; }
}

impl Component for Mux4 {
    fn update(&mut self, _: f64) {
        self.out = self.in_[bits(&self.sel) as usize & 3];
    }
}

component! {
    /// One of eight numbers.
    Mux8 = "mux8";
    in { sel as "sel#": [bool; 3] = [false; 3], "bit of the choice, `sel0` the least"; in_ as "in#": [f64; 8] = [0.0; 8], "a number"; }
    out { out: f64 = 0.0, "the chosen one"; }
}

impl Component for Mux8 {
    fn update(&mut self, _: f64) {
        self.out = self.in_[bits(&self.sel) as usize & 7];
    }
}

component! {
    /// One of sixteen numbers, by a rotary switch with or without Gray code.
    Mux16 = "mux16";
    in {
        use_graycode: bool = false, "the choice is Gray code";
        suppress_no_input: bool = false, "keeps the output while no bit of the choice is set";
        debounce_time: f64 = 0.0, "how long a choice must last before it counts, s";
        sel as "sel#": [bool; 4] = [false; 4], "bit of the choice, `sel0` the least";
        in_ as "in##": [f64; 16] = [0.0; 16], "a number";
    }
    out {
        out_f: f64 = 0.0, "the chosen one";
        out_s: i32 = 0, "the same without its fraction, within the range of its type";
        selected: i32 = 0, "number of the choice";
        elapsed: f64 = 0.0, "how long a new choice has lasted, s";
    }
    state { chosen: u32 = 0; wanted: u32 = 0; }
}

impl Component for Mux16 {
    fn update(&mut self, period_s: f64) {
        let code = bits(&self.sel) & 15;
        if self.suppress_no_input && code == 0 {
            return;
        }
        let wanted = if self.use_graycode { from_gray(code) } else { code };
        if wanted == self.chosen || wanted != self.wanted {
            self.elapsed = 0.0;
        }
        self.wanted = wanted;
        if wanted != self.chosen {
            // A time that is no number is none.
            if self.elapsed < self.debounce_time {
                self.elapsed += period_s;
            } else {
                self.chosen = wanted;
            }
        }
        self.selected = self.chosen as i32;
        self.out_f = self.in_[self.chosen as usize & 15];
        self.out_s = self.out_f as i32;
    }
}

/// The number that a Gray code stands for. RT.
pub(crate) fn from_gray(code: u32) -> u32 {
    [16, 8, 4, 2, 1]
        .into_iter()
        .fold(code, |number, shift| number ^ number >> shift)
}

component! {
    /// Sets the one of eight outputs that a number names; none where it is outside.
    Select8 = "select8";
    in { enable: bool = true, "sets an output at all"; sel: i32 = 0, "number of the output"; }
    out { out as "out#": [bool; 8] = [false; 8], "it is the one"; }
}

impl Component for Select8 {
    fn update(&mut self, _: f64) {
        for (number, out) in (0..).zip(&mut self.out) {
            *out = self.enable && number == self.sel;
        }
    }
}

component! {
    /// Sets the output that a number and bits name, or all up to it.
    Demux = "demux";
    options { personality: 32, 1..=32, [], "number of outputs"; }
    in {
        sel_bit as "sel-bit-##": [bool; 5] = [false; 5], "bit of a number";
        sel_u32: u32 = 0, "is added to it";
        bargraph: bool = false, "sets all outputs below, too, and not the named one";
    }
    out { out as "out-##": Vec<bool> = vec![false; 32], "it is the one; beyond the last: the last"; }
}

impl Component for Demux {
    fn shape(&mut self, options: &Options<'_>) {
        self.out = vec![false; options.count("personality")];
    }

    fn update(&mut self, _: f64) {
        let last = self.out.len().saturating_sub(1) as u32;
        let named = self.sel_u32.saturating_add(bits(&self.sel_bit)).min(last);
        for (number, out) in (0..).zip(&mut self.out) {
            *out = if self.bargraph { number < named } else { number == named };
        }
    }
}

component! {
    /// One of several outputs, moved on by two keys, round and round.
    Multiswitch = "multiswitch";
    options { personality: 4, 2..=32, [], "number of positions"; }
    in { up: bool = false, "to the next one"; down: bool = false, "to the one before"; }
    out { bit as "bit-##": Vec<bool> = vec![false; 4], "it is the one"; position: i32 = 0, "its number"; }
    state { up_edge: Edge = Edge::default(); down_edge: Edge = Edge::default(); }
}

impl Component for Multiswitch {
    fn shape(&mut self, options: &Options<'_>) {
        self.bit = vec![false; options.count("personality")];
    }

    fn update(&mut self, _: f64) {
        let step = i32::from(self.up_edge.rises(self.up)) - i32::from(self.down_edge.rises(self.down));
        self.position = (self.position + step).rem_euclid(self.bit.len().max(1) as i32);
        for (number, bit) in (0..).zip(&mut self.bit) {
            *bit = number == self.position;
        }
    }
}
