//! Steps of the machine: spindle, coolant, switches, inputs and outputs, cycles, threads, probing, compensation, turning.

use super::{AXES, FeedMode, PLANES, Writer};

impl Writer {
    pub(super) fn spindle(&mut self) {
        let code = self.random.pick(&["M3", "M4", "M5", ""]);
        let mut words = vec![code.to_owned()];
        words.retain(|word| !word.is_empty());
        if code.is_empty() || self.random.once_in(2) {
            words.push(format!("S{}", self.quarters(4, 4000)));
            self.has_speed = true;
        }
        match code {
            "M3" => self.spindle = 1,
            "M4" => self.spindle = -1,
            "M5" => self.spindle = 0,
            _ => {}
        }
        self.line(words);
    }

    pub(super) fn surface_speed(&mut self) {
        self.has_speed = true;
        let words = match self.random.below(3) {
            0 => vec!["G96".to_owned(), "S100".to_owned()],
            1 => vec!["G96".to_owned(), "S150".to_owned(), "D2000".to_owned()],
            _ => vec!["G97".to_owned(), "S500".to_owned()],
        };
        self.line(words);
    }

    pub(super) fn orient(&mut self) {
        let mut words = vec!["M19".to_owned(), format!("R{}", self.quarters(0, 1440))];
        if self.random.once_in(2) {
            words.push(format!("P{}", self.random.below(3)));
        }
        if self.random.once_in(2) {
            words.push(format!("Q{}", self.distance()));
        }
        self.spindle = 0;
        self.line(words);
    }

    pub(super) fn coolant(&mut self) {
        let code = self.random.pick(&["M7", "M8", "M9"]);
        self.line(vec![code.to_owned()]);
    }

    pub(super) fn override_switch(&mut self) {
        let code = self.random.pick(&["M48", "M49", "M50", "M51", "M52", "M53"]);
        let mut words = vec![code.to_owned()];
        if !["M48", "M49"].contains(&code) && self.random.once_in(2) {
            words.push(format!("P{}", self.random.below(2)));
        }
        self.line(words);
    }

    pub(super) fn dwell(&mut self) {
        let words = vec!["G4".to_owned(), format!("P{}", self.distance())];
        self.line(words);
    }

    pub(super) fn stop(&mut self) {
        let code = self.random.pick(&["M0", "M1", "M60"]);
        self.line(vec![code.to_owned()]);
    }

    pub(super) fn output(&mut self) {
        let words = if self.random.once_in(2) {
            vec![
                self.random.pick(&["M62", "M63", "M64", "M65"]).to_owned(),
                format!("P{}", self.random.below(4)),
            ]
        } else {
            vec![
                self.random.pick(&["M67", "M68"]).to_owned(),
                format!("E{}", self.random.below(4)),
                format!("Q{}", self.quarters(-40, 40)),
            ]
        };
        self.line(words);
    }

    pub(super) fn input(&mut self) {
        let words = match self.random.below(3) {
            0 => vec!["M66", "P1", "L0"],
            1 => vec!["M66", "E0", "L0"],
            _ => vec!["M66", "P0", "L3", "Q5"],
        };
        self.line(words.into_iter().map(str::to_owned).collect());
    }

    /// Saves and restores, also the other way round, which is refused.
    pub(super) fn save(&mut self) {
        // The newest LinuxCNC tells what M72 restores in another order.
        if self.newest {
            return self.reference_point();
        }
        if !self.saved {
            self.raw("M70");
            self.saved = true;
        } else {
            let text = self.random.pick(&["M72", "M71", "M72"]);
            self.raw(text);
            self.saved = false;
            // What was restored is not followed: set what matters.
            self.raw("G49");
            self.raw("G17 G21 G90 G91.1 G94 G8 G64 F100");
            self.reset_modes();
        }
    }

    pub(super) fn reset_modes(&mut self) {
        self.plane = 0;
        self.inch = false;
        self.incremental = false;
        self.absolute_centres = false;
        self.feed_mode = FeedMode::PerMinute;
        self.has_feed = true;
        self.diameter = false;
    }

    /// A run of holes.
    pub(super) fn drill(&mut self) {
        self.per_minute();
        let (first, second, third, ..) = PLANES[self.plane];
        let code = self.random.pick(&["G81", "G82", "G83", "G73", "G85", "G89"]);
        let mut words = vec![code.to_owned()];
        words.extend(self.axis_words(&[first, second]));
        let depth = self.distance();
        if self.incremental {
            words.push(format!("R{}", self.quarters(-8, 8)));
            words.push(format!("{}-{depth}", AXES[third] as char));
        } else {
            // Never just where the tool is: rounding would decide.
            let clearance = self.quarters(-8, 8) + 0.1;
            words.push(format!("R{clearance}"));
            words.push(format!("{}{}", AXES[third] as char, clearance - depth));
        }
        match code {
            "G82" | "G89" => words.push(format!("P{}", self.distance())),
            "G83" | "G73" => {
                words.push(format!("Q{}", 1.0 + self.distance()));
                // Without D it clears pecks by one unit of the program, were it an inch.
                if self.newest {
                    words.push(format!("D{}", self.distance()));
                }
            }
            _ => {}
        }
        if self.random.once_in(3) {
            words.push(self.random.pick(&["G98", "G99"]).to_owned());
        }
        if self.random.once_in(3) {
            words.push(format!("L{}", 1 + self.random.below(3)));
        }
        self.feed_word(&mut words);
        self.line(words);
        for _ in 0..self.random.below(3) {
            let words = self.axis_words(&[first, second]);
            self.line(words);
        }
        self.motion = self.random.once_in(2);
        let words = vec![if self.motion { "G0" } else { "G80" }.to_owned()];
        self.line(words);
    }

    pub(super) fn tap(&mut self) {
        self.per_minute();
        // In G18 and G19 the packaged LinuxCNC feeds to X, Y and Z in a wrong order; we do not.
        self.plane = 0;
        self.raw("G17");
        let (code, direction) = self.random.pick(&[("G84", 1), ("G74", -1)]);
        self.spindle_on(direction);
        // LinuxCNC exchanges the axes of taps in ZX and YZ and feeds to another place; ours stay in the hole.
        self.plane = 0;
        self.raw("G17");
        let (first, second, third, ..) = PLANES[self.plane];
        let mut words = vec![code.to_owned(), "R1.1".to_owned(), format!("{}-3", AXES[third] as char)];
        words.extend(self.axis_words(&[first, second]));
        if self.random.once_in(2) {
            words.push("P0.5".to_owned());
        }
        self.feed_word(&mut words);
        self.line(words);
        self.motion = false;
        self.line(vec!["G80".to_owned()]);
    }

    pub(super) fn bore(&mut self) {
        self.per_minute();
        self.spindle_on(1);
        let (first, second, third, i, j) = PLANES[self.plane];
        let code = self.random.pick(&["G86", "G87", "G88"]);
        let mut words = vec![
            code.to_owned(),
            "R1.1".to_owned(),
            format!("{}-3", AXES[third] as char),
            "P0.5".to_owned(),
        ];
        words.extend(self.axis_words(&[first, second]));
        if code == "G87" {
            words.retain(|word| !word.starts_with('P'));
            words.extend([format!("{i}0.5"), format!("{j}0.25")]);
            let rest = *['I', 'J', 'K']
                .iter()
                .find(|letter| **letter != i && **letter != j)
                .expect("the third");
            words.push(format!("{rest}-1"));
        }
        self.feed_word(&mut words);
        self.line(words);
        self.stand();
    }

    pub(super) fn thread(&mut self) {
        self.per_minute();
        self.spindle_on(1);
        let code = self.random.pick(&["G33", "G33.1"]);
        let mut words = vec![code.to_owned(), format!("K{}", self.distance())];
        words.extend(self.axis_words(&[0, 2]));
        self.line(words);
        self.stand();
    }

    pub(super) fn thread_cycle(&mut self) {
        self.per_minute();
        self.spindle_on(1);
        self.plane = 1;
        // G76 leaves the override on, of which the packaged LinuxCNC's taps know and its M2 does not.
        self.raw("M48");
        self.raw("G18 G90");
        self.incremental = false;
        let first_cut = self.quarters(1, 3);
        let mut words = vec![
            "G76".to_owned(),
            format!("P{}", self.distance()),
            format!("Z-{}", self.distance()),
            format!("I{}", self.random.pick(&[-1.0, 1.0, -0.5])),
            format!("J{first_cut}"),
            format!("K{}", first_cut + self.distance() / 4.0),
        ];
        for (word, often) in [("R1.5", 3), ("R2", 4), ("Q30", 2), ("H2", 3)] {
            if self.random.once_in(often) && !words.iter().any(|known| known[..1] == word[..1]) {
                words.push(word.to_owned());
            }
        }
        if self.random.once_in(3) {
            words.push("E0.5".to_owned());
            words.push(format!("L{}", self.random.below(4)));
        }
        self.line(words);
        self.stand();
    }

    pub(super) fn probe(&mut self) {
        self.per_minute();
        // The stand-alone's machine learns of offsets of tools and of rotations with the next move.
        self.raw("G0");
        let code = self.random.pick(&["G38.2", "G38.3", "G38.4", "G38.5"]);
        let mut words = vec![code.to_owned(), "X[#5420+2.5]".to_owned()];
        if self.incremental || self.diameter {
            words = vec![code.to_owned(), "Z[#5422+40.75]".to_owned()];
        }
        self.feed_word(&mut words);
        self.motion = false;
        self.line(words);
        self.raw("(debug,#5061 #5062 #5063 #5070)");
        self.stand();
    }

    /// A compensated contour: in, some moves, out.
    pub(super) fn contour(&mut self) {
        self.per_minute();
        self.plane = self.random.below(2);
        self.raw("G90 G91.1 G8 G40 G49 G64");
        self.reset_contour();
        self.raw(if self.plane == 0 {
            "G17 G21 G0 X-40 Y-30 Z0"
        } else {
            "G18 G21 G0 Z-40 X-30 Y0"
        });
        let side = self.random.pick(&["G41.1", "G42.1"]);
        let text = format!("{side} D{}", self.quarters(1, 8));
        self.raw(&text);
        self.compensated = true;
        let (a, b) = if self.plane == 0 { ('X', 'Y') } else { ('Z', 'X') };
        self.raw(&format!("G1 F200 {a}0 {b}0"));
        for _ in 0..2 + self.random.below(5) {
            match self.random.below(8) {
                0 => {
                    let third = if self.plane == 0 { 'Z' } else { 'Y' };
                    let depth = self.quarters(-20, 20);
                    self.raw(&format!("{third}{depth}"));
                }
                1 => self.raw("(in the contour)"),
                2 => self.raw("F150"),
                3 => self.raw("M8"),
                _ => {
                    let (x, y) = (self.quarters(-80, 160), self.quarters(-80, 160));
                    self.raw(&format!("G1 {a}{x} {b}{y}"));
                }
            }
        }
        self.raw("G40");
        self.compensated = false;
        self.raw(&format!("G0 {a}-60"));
        self.motion = true;
    }

    fn reset_contour(&mut self) {
        self.incremental = false;
        self.absolute_centres = false;
        self.diameter = false;
        self.inch = false;
        self.has_feed = true;
    }

    /// Roughing and finishing of a turned profile.
    pub(super) fn turn(&mut self) {
        self.per_minute();
        let sub = 1000 + self.label();
        self.raw("G49");
        self.raw("G18 G21 G90 G91.1 G8 G64");
        self.reset_contour();
        self.plane = 1;
        let (x, z) = (self.distance(), self.distance());
        self.raw(&format!("o{sub} sub"));
        self.raw(&format!("G0 X{x}"));
        self.raw(&format!("G1 Z-{z}"));
        self.raw(&format!("G1 X{} Z-{}", x + 4.0, z + 2.5));
        self.raw(&format!("G1 Z-{}", z + 8.0));
        self.raw(&format!("G1 X{}", x + 12.0));
        self.raw(&format!("o{sub} endsub"));
        self.raw(&format!("G0 X{} Z2 F100", x + 13.0));
        match self.random.below(2) {
            0 => self.raw(&format!("G70 Q{sub}")),
            // G72 wants a profile along X: the corpus has it.
            _ => self.raw(&format!("G71 Q{sub} D0.5 I2 R0.5")),
        }
        self.raw("G0");
        self.motion = true;
    }
}
