//! The kinds of steps: moves, modes, offsets, tools. `flow.rs` and `machine.rs` have the others.

use super::{AXES, FeedMode, PLANES, Writer};

/// Every kind of step; those that come more often are there more than once.
pub(super) const KINDS: &[fn(&mut Writer)] = &[
    Writer::rapid,
    Writer::rapid,
    Writer::feed,
    Writer::feed,
    Writer::feed,
    Writer::axis_words_alone,
    Writer::arc_by_centre,
    Writer::arc_by_centre,
    Writer::arc_by_radius,
    Writer::circle,
    Writer::plane,
    Writer::units,
    Writer::distance_mode,
    Writer::centre_mode,
    Writer::feed_modes,
    Writer::system,
    Writer::set_origin,
    Writer::set_place,
    Writer::g92,
    Writer::tool,
    Writer::tool_offset,
    Writer::tool_entry,
    Writer::reference_point,
    Writer::machine_place,
    Writer::path_mode,
    Writer::polar,
    Writer::spline,
    Writer::diameter,
    Writer::several_modes,
    Writer::spindle,
    Writer::surface_speed,
    Writer::orient,
    Writer::coolant,
    Writer::override_switch,
    Writer::dwell,
    Writer::stop,
    Writer::output,
    Writer::input,
    Writer::save,
    Writer::drill,
    Writer::drill,
    Writer::tap,
    Writer::bore,
    Writer::thread,
    Writer::thread_cycle,
    Writer::probe,
    Writer::contour,
    Writer::contour,
    Writer::turn,
    Writer::set_parameter,
    Writer::set_parameter,
    Writer::named_parameter,
    Writer::expression,
    Writer::branch,
    Writer::count,
    Writer::repeat,
    Writer::call,
    Writer::fanuc_call,
    Writer::remark,
    Writer::states,
    Writer::mistake,
];

impl Writer {
    fn rapid(&mut self) {
        let mut words = vec!["G0".to_owned()];
        words.extend(self.axis_words(&[0, 1, 2, 3, 4, 5]));
        self.motion = true;
        self.line(words);
    }

    fn feed(&mut self) {
        let mut words = vec!["G1".to_owned()];
        words.extend(self.axis_words(&[0, 1, 2, 3, 4, 5]));
        self.feed_word(&mut words);
        self.motion = true;
        self.line(words);
    }

    /// The motion code in force; G1 in a feed mode that wants F has one.
    fn axis_words_alone(&mut self) {
        if !self.motion || self.feed_mode == FeedMode::InverseTime {
            return self.rapid();
        }
        let words = self.axis_words(&[0, 1, 2]);
        self.line(words);
    }

    /// An arc of quarter turns: the end is the start turned about the centre.
    fn arc_by_centre(&mut self) {
        let (first, second, third, i, j) = PLANES[self.plane];
        if self.diameter {
            return self.circle();
        }
        let offset = (self.quarters(-20, 20), self.distance());
        // From the centre to the start, turned by one or two quarters.
        let start = (-offset.0, -offset.1);
        let end = if self.random.once_in(2) {
            (-start.1, start.0)
        } else {
            (-start.0, -start.1)
        };
        let moved = (end.0 - start.0, end.1 - start.1);
        let place = |axis: usize, way: f64| {
            if self.incremental {
                format!("{}{way}", AXES[axis] as char)
            } else {
                format!("{}[#{}+{way}]", AXES[axis] as char, 5420 + axis)
            }
        };
        let centre = |letter: char, axis: usize, way: f64| {
            if self.absolute_centres {
                format!("{letter}[#{}+{way}]", 5420 + axis)
            } else {
                format!("{letter}{way}")
            }
        };
        let mut words = vec![
            place(first, moved.0),
            place(second, moved.1),
            centre(i, first, offset.0),
            centre(j, second, offset.1),
        ];
        words.push(self.random.pick(&["G2", "G3"]).to_owned());
        if self.random.once_in(3) {
            let way = self.quarters(-8, 8);
            words.push(format!("{}{way}", AXES[third] as char));
        }
        if self.random.once_in(5) {
            words.push(format!("P{}", 1 + self.random.below(3)));
        }
        if self.random.once_in(8) {
            words.push(format!("A{}", self.quarters(-100, 100)));
        }
        self.feed_word(&mut words);
        self.motion = false;
        self.line(words);
    }

    fn circle(&mut self) {
        let (first, second, third, i, j) = PLANES[self.plane];
        let mut words = vec![self.random.pick(&["G2", "G3"]).to_owned()];
        let distance = self.distance();
        if self.absolute_centres {
            if self.diameter {
                return self.rapid();
            }
            words.push(format!("{i}[#{}+{distance}]", 5420 + first));
            words.push(format!("{j}#{}", 5420 + second));
        } else {
            words.push(format!("{}{distance}", self.random.pick(&[i, j])));
        }
        if self.random.once_in(2) {
            words.push(format!("{}{}", AXES[third] as char, self.quarters(-8, 8)));
        }
        self.feed_word(&mut words);
        self.motion = false;
        self.line(words);
    }

    fn arc_by_radius(&mut self) {
        let (first, second, ..) = PLANES[self.plane];
        if self.diameter || !self.incremental && self.random.once_in(2) {
            return self.rapid();
        }
        let (x, y) = (self.quarters(-20, 20), self.distance());
        let half = (x * x + y * y).sqrt() / 2.0;
        let radius = (half * 4.0).ceil() / 4.0 + self.quarters(0, 20);
        let sign = if self.random.once_in(3) { -1.0 } else { 1.0 };
        let mut words = vec![
            self.random.pick(&["G2", "G3"]).to_owned(),
            format!("R{}", sign * radius),
        ];
        for (axis, way) in [(first, x), (second, y)] {
            words.push(if self.incremental {
                format!("{}{way}", AXES[axis] as char)
            } else {
                format!("{}[#{}+{way}]", AXES[axis] as char, 5420 + axis)
            });
        }
        self.feed_word(&mut words);
        self.motion = false;
        self.line(words);
    }

    fn plane(&mut self) {
        self.plane = self.random.below(3);
        let words = vec![format!("G{}", 17 + self.plane)];
        self.line(words);
    }

    fn units(&mut self) {
        self.inch = self.random.once_in(2);
        // The packaged LinuxCNC does not convert the tool's offset and the tolerance of G64.
        self.raw("G49");
        let words = vec![if self.inch { "G20" } else { "G21" }.to_owned(), "G64".to_owned()];
        self.line(words);
    }

    fn distance_mode(&mut self) {
        self.incremental = self.random.once_in(2);
        let words = vec![if self.incremental { "G91" } else { "G90" }.to_owned()];
        self.line(words);
    }

    fn centre_mode(&mut self) {
        self.absolute_centres = self.random.once_in(2);
        let words = vec![if self.absolute_centres { "G90.1" } else { "G91.1" }.to_owned()];
        self.line(words);
    }

    fn feed_modes(&mut self) {
        let (mode, code) = self.random.pick(&[
            (FeedMode::PerMinute, "G94"),
            (FeedMode::InverseTime, "G93"),
            (FeedMode::PerTurn, "G95"),
        ]);
        self.feed_mode = mode;
        self.has_feed = false;
        self.line(vec![code.to_owned()]);
    }

    fn system(&mut self) {
        let code = self
            .random
            .pick(&["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"]);
        self.line(vec![code.to_owned()]);
    }

    fn set_origin(&mut self) {
        let mut words = vec!["G10".to_owned(), "L2".to_owned(), format!("P{}", self.random.below(10))];
        words.extend(self.axis_words(&[0, 1, 2, 3, 4, 5]));
        if self.random.once_in(3) {
            words.push(format!("R{}", self.quarters(-720, 720)));
        }
        self.line(words);
    }

    fn set_place(&mut self) {
        let mut words = vec![
            "G10".to_owned(),
            "L20".to_owned(),
            format!("P{}", self.random.below(10)),
        ];
        words.extend(self.axis_words(&[0, 1, 2, 3, 4, 5]));
        self.line(words);
    }

    fn g92(&mut self) {
        match self.random.below(6) {
            0 => self.line(vec!["G92.1".to_owned()]),
            1 => self.line(vec!["G92.2".to_owned()]),
            2 => self.line(vec!["G92.3".to_owned()]),
            code => {
                let mut words = vec![if code == 3 { "G52" } else { "G92" }.to_owned()];
                words.extend(self.axis_words(&[0, 1, 2, 3, 4, 5]));
                self.line(words);
            }
        }
    }

    fn tool(&mut self) {
        // The changer of the newest stand-alone goes by index: the tenth tool is none.
        let number = self
            .random
            .pick(if self.newest { &[0, 1, 2, 2] } else { &[0, 1, 2, 10] });
        // Not M61: the stand-alone's changer takes no notice of it.
        match self.random.below(2) {
            0 => self.line(vec![format!("T{number}")]),
            _ => {
                self.spindle = 0;
                self.line(vec![format!("T{number}"), "M6".to_owned()]);
            }
        }
    }

    fn tool_offset(&mut self) {
        let tool = self.random.pick(&[0, 1, 2, 10]);
        match self.random.below(5) {
            0 => self.line(vec!["G49".to_owned()]),
            1 => self.line(vec!["G43".to_owned()]),
            2 => {
                let mut words = vec!["G43.1".to_owned()];
                words.extend(self.axis_words(&[0, 1, 2, 3]));
                self.line(words);
            }
            3 => self.line(vec!["G43.2".to_owned(), format!("H{tool}")]),
            _ => self.line(vec!["G43".to_owned(), format!("H{tool}")]),
        }
    }

    fn tool_entry(&mut self) {
        let kind = self.random.pick(&["L1", "L10", "L11"]);
        let mut words = vec![
            "G10".to_owned(),
            kind.to_owned(),
            format!("P{}", self.random.pick(&[1, 2, 10])),
        ];
        words.extend(self.axis_words(&[0, 1, 2, 3]));
        if self.random.once_in(3) {
            words.push(format!("R{}", self.distance()));
        }
        if self.random.once_in(4) {
            words.push(format!("Q{}", self.random.below(10)));
        }
        self.line(words);
    }

    pub(super) fn reference_point(&mut self) {
        let code = self.random.pick(&["G28", "G30", "G28.1", "G30.1"]);
        let mut words = vec![code.to_owned()];
        if !code.ends_with(".1") && self.random.once_in(2) {
            words.extend(self.axis_words(&[0, 1, 2]));
        }
        self.line(words);
    }

    fn machine_place(&mut self) {
        if self.incremental {
            return self.rapid();
        }
        let mut words = vec!["G53".to_owned(), "G0".to_owned()];
        words.extend(self.axis_words(&[0, 1, 2, 3]));
        self.motion = true;
        self.line(words);
    }

    fn path_mode(&mut self) {
        match self.random.below(5) {
            0 => self.line(vec!["G61".to_owned()]),
            1 => self.line(vec!["G61.1".to_owned()]),
            2 => self.line(vec!["G64".to_owned()]),
            3 => self.line(vec!["G64".to_owned(), "P0.25".to_owned()]),
            _ => self.line(vec!["G64".to_owned(), "P0.5".to_owned(), "Q0.125".to_owned()]),
        }
    }

    fn polar(&mut self) {
        if self.incremental || self.diameter || self.plane != 0 {
            return self.rapid();
        }
        let mut words = vec!["G0".to_owned(), format!("@{}", self.distance())];
        words.push(format!("^{}", self.quarters(-720, 720)));
        self.motion = true;
        self.line(words);
    }

    fn spline(&mut self) {
        if self.plane != 0 || self.diameter {
            return self.plane();
        }
        let mut words = self.axis_words(&[0, 1]);
        self.feed_word(&mut words);
        match self.random.below(3) {
            0 => words.extend(["G5", "I1", "J2.5", "P-1", "Q3"].map(str::to_owned)),
            1 => words.extend(["G5.1", "I1", "J2.5"].map(str::to_owned)),
            _ => {
                words = vec!["G5.2".to_owned(), "P1".to_owned(), "X1".to_owned(), "Y2".to_owned()];
                self.per_minute();
                words.push("F100".to_owned());
                self.line(words);
                for point in ["X2 Y3 P1", "P2 X4 Y4", "Y1 X5 P0.5"] {
                    self.raw(point);
                }
                words = vec!["G5.3".to_owned()];
            }
        }
        self.line(words);
        self.stand();
    }

    fn diameter(&mut self) {
        self.diameter = self.random.once_in(2);
        let words = vec![if self.diameter { "G7" } else { "G8" }.to_owned()];
        self.line(words);
    }

    /// Codes of many groups on one line.
    fn several_modes(&mut self) {
        self.raw("G49");
        let mut words = vec!["G40".to_owned()];
        self.plane = self.random.below(3);
        words.push(format!("G{}", 17 + self.plane));
        self.incremental = self.random.once_in(2);
        words.push(if self.incremental { "G91" } else { "G90" }.to_owned());
        self.inch = self.random.once_in(2);
        words.push(if self.inch { "G20" } else { "G21" }.to_owned());
        words.push(self.random.pick(&["G98", "G99"]).to_owned());
        words.push(self.random.pick(&["G64", "G64", "G61.1"]).to_owned());
        words.push("G97".to_owned());
        self.motion = true;
        words.push("G0".to_owned());
        words.extend(self.axis_words(&[0, 1, 2]));
        self.line(words);
    }
}
