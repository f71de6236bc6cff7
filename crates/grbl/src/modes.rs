//! What lines leave in force.

/// mm in an inch.
pub(crate) const MM_PER_INCH: f64 = 25.4;

/// The motion in force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Motion {
    #[default]
    Rapid,
    Feed,
    /// G2, G3.
    Arc {
        clockwise: bool,
    },
    /// G38.2 to G38.5: the digit behind the point.
    Probe(u8),
    /// G80.
    None,
}

impl Motion {
    pub(crate) fn word(self) -> String {
        match self {
            Motion::Rapid => "G0".into(),
            Motion::Feed => "G1".into(),
            Motion::Arc { clockwise: true } => "G2".into(),
            Motion::Arc { clockwise: false } => "G3".into(),
            Motion::Probe(kind) => format!("G38.{kind}"),
            Motion::None => "G80".into(),
        }
    }

    pub(crate) fn of_code(code: u16) -> Option<Motion> {
        Some(match code {
            0 => Motion::Rapid,
            100 => Motion::Feed,
            200 => Motion::Arc { clockwise: true },
            300 => Motion::Arc { clockwise: false },
            3820 | 3830 | 3840 | 3850 => Motion::Probe((code % 100 / 10) as u8),
            8000 => Motion::None,
            _ => return None,
        })
    }
}

/// Modes, as the lines that were accepted leave them. What Grbl begins with is the default.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Modes {
    pub(crate) motion: Motion,
    /// 17, 18 or 19.
    pub(crate) plane: u8,
    pub(crate) inch: bool,
    pub(crate) relative: bool,
    /// G93.
    pub(crate) inverse_time: bool,
    /// 54 to 59.
    pub(crate) system: u8,
    /// 3, 4 or 5.
    pub(crate) spindle: u8,
    pub(crate) flood: bool,
    pub(crate) mist: bool,
    /// mm/min; 0: none yet.
    pub(crate) feed_mm_min: f64,
    pub(crate) speed_rpm: f64,
    pub(crate) tool: u32,
    /// Where the lines lead, work coordinates, mm; `None`: not known here.
    pub(crate) at: [Option<f64>; 3],
}

impl Default for Modes {
    fn default() -> Modes {
        Modes {
            motion: Motion::Rapid,
            plane: 17,
            inch: false,
            relative: false,
            inverse_time: false,
            system: 54,
            spindle: 5,
            flood: false,
            mist: false,
            feed_mm_min: 0.0,
            speed_rpm: 0.0,
            tool: 0,
            at: [None; 3],
        }
    }
}

impl Modes {
    /// The line that puts a control into these modes, whatever it was in. Spindle and coolant are left as they are.
    pub(crate) fn line(&self) -> String {
        let Modes { plane, system, .. } = self;
        let [unit, distance, feed] = [
            20 + u8::from(!self.inch),
            90 + u8::from(self.relative),
            93 + u8::from(!self.inverse_time),
        ];
        format!("G80G{unit}G{distance}G{feed}G{plane}G40G49G91.1G{system}\n")
    }

    /// mm in the unit of the program.
    pub(crate) fn unit_mm(&self) -> f64 {
        if self.inch { MM_PER_INCH } else { 1.0 }
    }

    /// Where the axes are is not known any more, as after a stop.
    pub(crate) fn forget_place(&mut self) {
        self.at = [None; 3];
    }

    /// What Grbl keeps of these at the end of a program.
    pub(crate) fn at_end(&self) -> Modes {
        Modes {
            inch: self.inch,
            feed_mm_min: self.feed_mm_min,
            speed_rpm: self.speed_rpm,
            tool: self.tool,
            motion: Motion::Feed,
            ..Modes::default()
        }
    }
}
