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
    in {
        up: bool = false, "to the next one";
        down: bool = false, "to the one before";
        top_position: u32 = 3, "number of the last one";
    }
    out { bit as "bit-##": Vec<bool> = vec![false; 4], "it is the one"; position: i32 = 0, "its number"; }
    state { up_edge: Edge = Edge::default(); down_edge: Edge = Edge::default(); }
}

impl Component for Multiswitch {
    fn shape(&mut self, options: &Options<'_>) {
        let count = options.count("personality");
        self.bit = vec![false; count];
        self.top_position = count.saturating_sub(1) as u32;
    }

    fn update(&mut self, _: f64) {
        let step = i32::from(self.up_edge.rises(self.up)) - i32::from(self.down_edge.rises(self.down));
        let top = i32::try_from(self.top_position).unwrap_or(i32::MAX);
        self.position = match self.position.saturating_add(step) {
            below if below < 0 => top,
            above if above > top => 0,
            position => position,
        };
        for (number, bit) in (0..).zip(&mut self.bit) {
            *bit = number == self.position;
        }
    }
}

component! {
    /// One of up to 1024 values, of any type, as a value of any type.
    MuxGeneric = "mux_generic";
    options {
        size: 2, 2..=1024, [], "number of values";
        input: 1, 0..=3, ["bit", "float", "s32", "u32"], "type of the values; their pins are `in-TYPE-NN`";
        output: 1, 0..=3, ["bit", "float", "s32", "u32"], "type of the output, whose pin is `out-TYPE`";
    }
    in {
        sel_bit as "sel-bit-##": Vec<bool> = Vec::new(), "bit of a number, where `size` is a power of two";
        sel_int: u32 = 0, "is added to it: the number of the value; beyond the last: the last";
        in_bit as "in-bit-##": Vec<bool> = Vec::new(), "a value";
        in_float as "in-float-##": Vec<f64> = Vec::new(), "a value";
        in_s32 as "in-s32-##": Vec<i32> = Vec::new(), "a value";
        in_u32 as "in-u32-##": Vec<u32> = Vec::new(), "a value";
        suppress_no_input: bool = false, "keeps the output while the number is 0";
        debounce_us: u32 = 0, "how long a new number must last before it counts, us";
    }
    out {
        elapsed: u32 = 0, "how long a new number has lasted, us";
        selected: u32 = 0, "the number";
        out_bit as "out-bit": Vec<bool> = Vec::new(), "whether the chosen one is not 0, nor within 2e-7 of it";
        out_float as "out-float": Vec<f64> = Vec::new(), "the chosen one";
        out_s32 as "out-s32": Vec<i32> = Vec::new(), "the chosen one without its fraction, within the range of the type";
        out_u32 as "out-u32": Vec<u32> = Vec::new(), "the chosen one without its fraction, within the range of the type";
    }
}

impl Component for MuxGeneric {
    fn shape(&mut self, options: &Options<'_>) {
        let size = options.count("size");
        let bits = if size.is_power_of_two() { size.ilog2() } else { 0 };
        self.sel_bit = vec![false; bits as usize];
        match options.get("input") {
            0 => self.in_bit = vec![false; size],
            2 => self.in_s32 = vec![0; size],
            3 => self.in_u32 = vec![0; size],
            _ => self.in_float = vec![0.0; size],
        }
        match options.get("output") {
            0 => self.out_bit = vec![false],
            2 => self.out_s32 = vec![0],
            3 => self.out_u32 = vec![0],
            _ => self.out_float = vec![0.0],
        }
    }

    fn update(&mut self, period_s: f64) {
        let number = self.sel_int.saturating_add(bits(&self.sel_bit));
        if self.suppress_no_input && number == 0 {
            return;
        }
        if number != self.selected && self.elapsed < self.debounce_us {
            self.elapsed = self.elapsed.saturating_add((period_s * 1e6 + 1e-3) as u32);
            return;
        }
        (self.selected, self.elapsed) = (number, 0);
        // All types of pins are exact in it.
        let chosen = [
            one_of(&self.in_bit, number).map(|bit| f64::from(u8::from(bit))),
            one_of(&self.in_float, number),
            one_of(&self.in_s32, number).map(f64::from),
            one_of(&self.in_u32, number).map(f64::from),
        ];
        let Some(chosen) = chosen.into_iter().flatten().next() else {
            return;
        };
        self.out_bit.fill(chosen.abs() > 2e-7);
        self.out_float.fill(chosen);
        self.out_s32.fill(chosen as i32);
        self.out_u32.fill(chosen as u32);
    }
}

/// The value of that number, beyond the last: the last. RT.
fn one_of<V: Copy>(values: &[V], number: u32) -> Option<V> {
    values.get(number as usize).or(values.last()).copied()
}
