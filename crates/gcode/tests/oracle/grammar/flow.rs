//! Steps of the language: parameters, expressions, O-words, remarks, and mistakes.

use super::Writer;

impl Writer {
    pub(super) fn set_parameter(&mut self) {
        let value = self.value(2);
        let text = format!("#{}={value}", 101 + self.random.below(5));
        self.raw(&text);
    }

    pub(super) fn named_parameter(&mut self) {
        let name = self.random.pick(&["depth", "_shared value", "Width"]);
        let value = self.value(2);
        self.raw(&format!("#<{name}> = {value}"));
        self.raw(&format!("(debug, #<{name}>)"));
        self.raw(&format!("#104 = [#<{name}> / 2]"));
    }

    /// An expression of every operator and function, told by DEBUG.
    pub(super) fn expression(&mut self) {
        let value = self.value(4);
        self.raw(&format!("#105 = {value}"));
        self.raw("(debug, #105)");
        self.raw("#105 = [#105 MOD 50]");
    }

    /// A value, with `depth` brackets at most; no operation in it can fail.
    fn value(&mut self, depth: usize) -> String {
        if depth == 0 {
            return match self.random.below(3) {
                0 => format!("#{}", 101 + self.random.below(5)),
                1 => format!("{}", self.random.below(12)),
                _ => format!("{}", self.quarters(-40, 40)),
            };
        }
        let one = self.value(depth - 1);
        match self.random.below(10) {
            0 => format!("SIN[{one}]"),
            1 => format!("ABS[{one}]"),
            2 => format!("ROUND[{one}]"),
            3 => format!("FIX[{one}]"),
            4 => format!("FUP[{one}]"),
            5 => format!("ATAN[{one}]/[{}]", self.value(depth - 1)),
            6 => format!("SQRT[ABS[{one}]]"),
            _ => {
                let operator = self.random.pick(&[
                    "+", "-", "*", "+", "-", "EQ", "NE", "GT", "GE", "LT", "LE", "AND", "OR", "XOR",
                ]);
                let other = self.value(depth - 1);
                let third = self.random.pick(&["", "", "+1", "*2", "/4", " MOD 3", " GT 1", "**2"]);
                format!("[{one} {operator} {other}{third}]")
            }
        }
    }

    pub(super) fn branch(&mut self) {
        let label = self.label();
        let condition = self.value(1);
        self.raw(&format!("o{label} if [{condition} GT 2]"));
        self.raw("  G0 X1");
        if self.random.once_in(2) {
            self.raw(&format!("o{label} elseif [{condition} LT -2]"));
            self.raw("  G0 Y2");
        }
        if self.random.once_in(2) {
            self.raw(&format!("o{label} else"));
            self.raw("  G0 Z3");
        }
        self.raw(&format!("o{label} endif"));
        self.motion = false;
    }

    pub(super) fn count(&mut self) {
        let label = self.label();
        let inner = self.label();
        let most = 1 + self.random.below(4);
        self.raw("#110 = 0");
        let is_do = self.random.once_in(2);
        self.raw(&if is_do {
            format!("o{label} do")
        } else {
            format!("o{label} while [#110 LT {most}]")
        });
        self.raw("  #110 = [#110 + 1]");
        if self.random.once_in(2) {
            // Not continue: the packaged LinuxCNC remembers it in later loops.
            let way = "break";
            self.raw(&format!("  o{inner} if [#110 EQ 2]"));
            self.raw(&format!("    o{label} {way}"));
            self.raw(&format!("  o{inner} endif"));
        }
        self.raw("  G0 X#110");
        self.raw(&if is_do {
            format!("o{label} while [#110 LT {most}]")
        } else {
            format!("o{label} endwhile")
        });
        self.motion = false;
    }

    pub(super) fn repeat(&mut self) {
        let label = self.label();
        let text = format!("o{label} repeat [{}]", self.random.below(4));
        self.raw(&text);
        self.raw("  G0 Y[#5421+1.5]");
        self.raw(&format!("o{label} endrepeat"));
        self.motion = false;
    }

    pub(super) fn call(&mut self) {
        let label = self.label();
        let name = if self.random.once_in(2) {
            format!("<sub{label}>")
        } else {
            format!("{label}")
        };
        self.raw(&format!("o{name} sub"));
        self.raw("  G0 X#1 Y#2");
        self.raw("  #1 = 99");
        self.raw("  (debug, #1 #30 #<_call_level>)");
        self.raw(&format!("  o{} if [#2 GT 2]", label + 500));
        self.raw(&format!("    o{name} return [#2]"));
        self.raw(&format!("  o{} endif", label + 500));
        self.raw(&format!("o{name} endsub [7]"));
        let (first, second) = (self.random.below(9), self.random.below(4));
        self.raw(&format!("o{name} call [{first}] [{second}]"));
        self.raw("(debug, #1 #<_value> #<_value_returned>)");
        self.motion = false;
    }

    pub(super) fn fanuc_call(&mut self) {
        let label = 2000 + self.label();
        let text = format!("M98 P{label} L{}", 1 + self.random.below(3));
        self.raw(&text);
        self.subs
            .push_str(&format!("o{label}\n  G0 Z[#5422+0.5]\n  #111=[#111+1]\nM99\n"));
        self.motion = false;
    }

    pub(super) fn remark(&mut self) {
        let text = self.random.pick(&[
            "(plain)",
            "  ( led by blanks )",
            "(MSG,  two blanks)",
            "(debug, #101 and %d#102 %.3f#103)",
            "; nothing of this",
            "(one) (and two)",
            "()",
        ]);
        self.raw(text);
    }

    pub(super) fn states(&mut self) {
        let text = self.random.pick(&[
            "(debug, #<_metric> #<_absolute> #<_plane> #<_coord_system> #<_feed>)",
            "(debug, #5420 #5421 #5422 #5423)",
            "(debug, #<_x> #<_y> #<_z> #<_a>)",
            "(debug, #5220 #5221 #5222 #5230 #5211 #5210)",
            "(debug, #<_spindle_on> #<_spindle_cw> #<_mist> #<_flood> #<_rpm>)",
            "(debug, #5161 #5162 #5181 #5183 #5399)",
            "(debug, #<_current_tool> #<_selected_tool> #5400 #5410)",
            "(debug, #<_motion_mode> #<_units_per_rev> #<_inverse_time> #<_retract_r_plane>)",
        ]);
        self.raw(text);
    }

    /// Now and then a line that is refused.
    pub(super) fn mistake(&mut self) {
        if !self.random.once_in(4) {
            return self.remark();
        }
        let line = self.random.pick(&[
            "G0 X1 X2",
            "G0 G1 X1",
            "M3 M4",
            "G0 X1 Q2",
            "G2 X5",
            "G2 X5 I1 R2",
            "G77",
            "M88",
            "T99",
            "G43 H99",
            "G0 X[1/0]",
            "G0 X#<nothing>",
            "#0=1",
            "#5420=1",
            "G0 X",
            "G0 X1 (open",
            "G4",
            "G80 X1",
            "G10 L2 P11 X1",
            "G81 X1",
            "G33 Z1",
            "M19 R400",
            "M66",
            "o9999 endif",
            "o9998 call",
            "G1 X[SQRT[-1]]",
            "%",
            "G17 G18",
            "G53 G2 X1 I1",
            "G64 P",
        ]);
        self.raw(line);
    }
}
