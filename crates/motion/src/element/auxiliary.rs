//! What a move is told beside its motion: overrides that act on it, auxiliary functions, outputs; and what is done at rest.
//!
//! In:  from the program. Out: part of every span, and actions between moves.

use crate::canon::{Input, OrientDirection, SpindleDirection, WaitMode};
use std::f64::consts::TAU;
use std::fmt;

/// What acts on a move from outside, as the program has it at that block (M48 to M53).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Enables {
    /// The operator's overrides of feed and of rapid moves (M48 to M50).
    pub feed_override: bool,
    /// His override of the spindle's speed (M48, M49, M51).
    pub spindle_override: bool,
    /// The feed that the machine adapts (M52).
    pub adaptive_feed: bool,
    /// The switch for feed hold (M53).
    pub feed_hold: bool,
    /// The speed of the spindle (G95): the move is planned for the speed that it is to have at most.
    pub spindle_speed: bool,
}

impl Enables {
    /// As any program begins.
    pub const INITIAL: Enables = Enables {
        feed_override: true,
        spindle_override: true,
        adaptive_feed: false,
        feed_hold: true,
        spindle_speed: false,
    };
}

impl Default for Enables {
    fn default() -> Enables {
        Enables::INITIAL
    }
}

/// Auxiliary functions as they stand at a move. A move that begins with others than the one before it tells them to the machine
/// as it is passed: no rest is needed for them. Whether they are told on the way or at rest
/// ([`Element::Action`](super::Element::Action)), this is the state behind them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Auxiliary {
    /// The spindle: speed (1/min), direction and speed of the surface as in [`Action::SpindleOn`]; `None`: it is to stand.
    pub spindle: Option<(f64, SpindleDirection, Option<Surface>)>,
    /// M7.
    pub mist: bool,
    /// M8.
    pub flood: bool,
    /// The tool that was selected last (T).
    pub selected_tool: Option<u32>,
    /// How many messages there have been.
    pub messages: u32,
    /// Outputs that the program has set (M62 to M68).
    pub outputs: Outputs,
}

/// Digital and analog outputs as a program has set them; those that it has not stay as they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs {
    /// Digital outputs that are set, on or off (bit n: output n).
    digital: u64,
    /// Those of them that are on.
    on: u64,
    /// Analog outputs that are set.
    analog: u16,
    /// Their values; 0 where none is set.
    values: [f64; Outputs::ANALOG],
}

impl Outputs {
    /// Digital outputs that there can be at the most, as in LinuxCNC.
    pub const DIGITAL: usize = 64;
    /// Analog outputs that there can be at the most.
    pub const ANALOG: usize = 16;

    /// None is set.
    pub const NONE: Outputs = Outputs {
        digital: 0,
        on: 0,
        analog: 0,
        values: [0.0; Outputs::ANALOG],
    };

    /// Sets a digital output; false: there is none of this number. RT.
    pub fn set_digital(&mut self, index: u8, on: bool) -> bool {
        let Some(bit) = 1_u64.checked_shl(index.into()) else {
            return false;
        };
        self.digital |= bit;
        self.on = if on { self.on | bit } else { self.on & !bit };
        true
    }

    /// Sets an analog output; false: there is none of this number, or the value is no number. RT.
    pub fn set_analog(&mut self, index: u8, value: f64) -> bool {
        match self.values.get_mut(usize::from(index)) {
            Some(place) if value.is_finite() => {
                *place = value;
                self.analog |= 1 << index;
                true
            }
            Some(_) | None => false,
        }
    }

    /// The actions that set these, in order.
    pub fn actions(self) -> impl Iterator<Item = Action> {
        let number = |index: usize| index as u8;
        let digital = move |index| {
            let index_of = number(index);
            self.digital(index).map(|on| Action::SetDigital { index: index_of, on })
        };
        let analog = move |index| {
            let index_of = number(index);
            self.analog(index)
                .map(|value| Action::SetAnalog { index: index_of, value })
        };
        (0..Outputs::DIGITAL)
            .filter_map(digital)
            .chain((0..Outputs::ANALOG).filter_map(analog))
    }

    /// What the program has set a digital output to; `None`: nothing. RT.
    pub fn digital(&self, index: usize) -> Option<bool> {
        let bit = u32::try_from(index).ok().and_then(|index| 1_u64.checked_shl(index))?;
        (self.digital & bit != 0).then_some(self.on & bit != 0)
    }

    /// What the program has set an analog output to; `None`: nothing. RT.
    pub fn analog(&self, index: usize) -> Option<f64> {
        let value = self.values.get(index)?;
        (self.analog >> index & 1 != 0).then_some(*value)
    }

    /// The same with those that `later` sets.
    pub fn with(mut self, later: &Outputs) -> Outputs {
        self.digital |= later.digital;
        self.on = self.on & !later.digital | later.on;
        for (index, value) in later.values.iter().enumerate() {
            if later.analog >> index & 1 != 0 {
                self.values[index] = *value;
            }
        }
        self.analog |= later.analog;
        self
    }
}

impl Auxiliary {
    /// As any program begins.
    pub const INITIAL: Auxiliary = Auxiliary {
        spindle: None,
        mist: false,
        flood: false,
        selected_tool: None,
        messages: 0,
        outputs: Outputs::NONE,
    };

    /// What holds behind an action; `None`: the machine has to come to rest for it.
    pub fn after(self, action: Action) -> Option<Auxiliary> {
        Some(match action {
            Action::SpindleOn {
                rpm,
                direction,
                surface,
            } => Auxiliary {
                spindle: Some((rpm, direction, surface)),
                ..self
            },
            Action::SpindleOff | Action::OrientSpindle { .. } => Auxiliary { spindle: None, ..self },
            Action::Mist(mist) => Auxiliary { mist, ..self },
            Action::Flood(flood) => Auxiliary { flood, ..self },
            Action::SelectTool { tool } => Auxiliary {
                selected_tool: Some(tool),
                ..self
            },
            Action::Message { number } => Auxiliary {
                messages: number + 1,
                ..self
            },
            Action::SetDigital { index, on } => {
                let mut after = self;
                after.outputs.set_digital(index, on);
                after
            }
            Action::SetAnalog { index, value } => {
                let mut after = self;
                after.outputs.set_analog(index, value);
                after
            }
            Action::AwaitSpindle
            | Action::AwaitInput { .. }
            | Action::AwaitOriented { .. }
            | Action::TurnSpindle { .. }
            | Action::UserCode { .. }
            | Action::ChangeTool { .. }
            | Action::SetTool { .. }
            | Action::ProgramStop
            | Action::OptionalStop
            | Action::ProgramEnd
            | Action::TextEnd
            | Action::Modes { .. } => return None,
        })
    }

    /// The first of the actions that lead from here to `to`; [`Auxiliary::outputs`] apart, of which all change at once. RT.
    pub fn first_towards(self, to: &Auxiliary) -> Option<Action> {
        if self.spindle != to.spindle {
            Some(
                to.spindle
                    .map_or(Action::SpindleOff, |(rpm, direction, surface)| Action::SpindleOn {
                        rpm,
                        direction,
                        surface,
                    }),
            )
        } else if self.mist != to.mist {
            Some(Action::Mist(to.mist))
        } else if self.flood != to.flood {
            Some(Action::Flood(to.flood))
        } else if let Some(tool) = to.selected_tool.filter(|_| self.selected_tool != to.selected_tool) {
            Some(Action::SelectTool { tool })
        } else {
            let number = self.messages;
            (number < to.messages).then_some(Action::Message { number })
        }
    }
}

/// Constant speed of the surface under the tool (G96).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Metres per minute, not negative.
    pub m_per_minute: f64,
    /// X of the spindle's axis in the machine, mm.
    pub centre_mm: f64,
}

impl Surface {
    /// Revolutions per minute where X stands at `x_mm` (machine), without regard for the highest speed. RT.
    pub fn rpm(&self, x_mm: f64) -> f64 {
        const MM_PER_M: f64 = 1000.0;
        let circumference_mm = TAU * (x_mm - self.centre_mm).abs();
        // At the centre there is no speed that would do.
        if circumference_mm > 0.0 {
            self.m_per_minute * MM_PER_M / circumference_mm
        } else if self.m_per_minute > 0.0 {
            f64::INFINITY
        } else {
            0.0
        }
    }
}

/// Something to do between two moves: at rest or, where [`Auxiliary::after`] knows it, as the place is passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// M3, M4, or S while the spindle turns.
    SpindleOn {
        /// Revolutions per minute, not negative; with a speed of the surface, the highest.
        rpm: f64,
        /// Which way.
        direction: SpindleDirection,
        /// Where the speed follows the radius.
        surface: Option<Surface>,
    },
    /// M5.
    SpindleOff,
    /// M19: the spindle turns to an angle and is held there, until it is told something else.
    OrientSpindle {
        /// Angle, degrees.
        degrees: f64,
        /// Way there.
        direction: OrientDirection,
    },
    /// M19 Q; also before what follows an M19 without Q: goes on once the spindle is at its angle.
    AwaitOriented {
        /// Longest wait, s; `None`: as long as the machine waits for a speed of the spindle.
        timeout_s: Option<f64>,
    },
    /// M3, M4, M5 or S of a spindle beside the first: goes on once it has its speed.
    TurnSpindle {
        /// Number of the spindle, 1 or more.
        spindle: u8,
        /// Revolutions per minute, below 0 counter-clockwise; `None`: it is to stand.
        rpm: Option<f64>,
    },
    /// Before the first feed move behind a change of speed: goes on once the spindle has it.
    AwaitSpindle,
    /// M7 on, M9 off.
    Mist(bool),
    /// M8 on, M9 off.
    Flood(bool),
    /// T: the tool that the next change brings.
    SelectTool {
        /// Tool number.
        tool: u32,
    },
    /// M6.
    ChangeTool {
        /// Tool number.
        tool: u32,
    },
    /// M61: the spindle holds this tool; nothing changes it.
    SetTool {
        /// Tool number.
        tool: u32,
    },
    /// (MSG, ...): its number, counted from 0 in the order of the program.
    Message {
        /// Number.
        number: u32,
    },
    /// M64, M65; also M62, M63 before a move whose timing is not the plan's.
    SetDigital {
        /// Number of the output.
        index: u8,
        /// On or off.
        on: bool,
    },
    /// M68; also M67 before a move whose timing is not the plan's.
    SetAnalog {
        /// Number of the output.
        index: u8,
        /// Value.
        value: f64,
    },
    /// M66: goes on once the input is as it is to be, or the time is over.
    AwaitInput {
        /// Which.
        input: Input,
        /// For what.
        mode: WaitMode,
        /// Longest wait, s.
        timeout_s: f64,
    },
    /// M100 to M199: a program of the PC runs; goes on once there is more of the plan, which is when it has ended.
    UserCode {
        /// Number of the M code.
        number: u8,
        /// P, -1 if it is not there.
        p: f64,
        /// Q, -1 if it is not there.
        q: f64,
    },
    /// M0.
    ProgramStop,
    /// M1.
    OptionalStop,
    /// M2, M30.
    ProgramEnd,
    /// A text is over without them, by `%` or as a line of MDI: nothing is switched off.
    TextEnd,
    /// What is done at rest behind it runs in these modes, which no move has brought. There is nothing to do, and nothing waits for it.
    Modes {
        /// Number, as [`Source::modes`](crate::canon::Source::modes) says.
        number: u32,
    },
}

impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let on = |on: bool| if on { "on" } else { "off" };
        match *self {
            Action::SpindleOn {
                rpm,
                direction,
                surface,
            } => {
                let direction = match direction {
                    SpindleDirection::Clockwise => "clockwise",
                    SpindleDirection::Counterclockwise => "counter-clockwise",
                };
                match surface {
                    None => write!(f, "spindle on {direction}, {rpm} 1/min"),
                    Some(surface) => write!(
                        f,
                        "spindle on {direction}, {} m/min at the surface, {rpm} 1/min at most",
                        surface.m_per_minute
                    ),
                }
            }
            Action::SpindleOff => f.write_str("spindle off"),
            Action::OrientSpindle { degrees, .. } => write!(f, "spindle to {degrees} degrees"),
            Action::AwaitOriented { .. } => f.write_str("wait for the angle of the spindle"),
            Action::UserCode { number, p, q } => write!(f, "M{number} {p} {q}"),
            Action::TurnSpindle {
                spindle,
                rpm: Some(rpm),
            } => write!(f, "spindle {spindle} on, {rpm} 1/min"),
            Action::TurnSpindle { spindle, rpm: None } => write!(f, "spindle {spindle} off"),
            Action::AwaitSpindle => f.write_str("wait for the speed of the spindle"),
            Action::Mist(mist) => write!(f, "mist {}", on(mist)),
            Action::Flood(flood) => write!(f, "flood {}", on(flood)),
            Action::SelectTool { tool } => write!(f, "tool {tool} selected"),
            Action::ChangeTool { tool } => write!(f, "change to tool {tool}"),
            Action::SetTool { tool } => write!(f, "tool {tool} in the spindle"),
            Action::Message { number } => write!(f, "message {number}"),
            Action::SetDigital { index, on: value } => write!(f, "digital output {index} {}", on(value)),
            Action::SetAnalog { index, value } => write!(f, "analog output {index} to {value}"),
            Action::AwaitInput { input, mode, timeout_s } => {
                let what = match mode {
                    WaitMode::Immediate => return write!(f, "read {input}"),
                    WaitMode::Rise => "rise",
                    WaitMode::Fall => "fall",
                    WaitMode::High => "be on",
                    WaitMode::Low => "be off",
                };
                write!(f, "wait for {input} to {what}, {timeout_s} s at the most")
            }
            Action::ProgramStop => f.write_str("stop (M0)"),
            Action::OptionalStop => f.write_str("optional stop (M1)"),
            Action::ProgramEnd => f.write_str("end"),
            Action::TextEnd => f.write_str("ended"),
            Action::Modes { number } => write!(f, "modes {number}"),
        }
    }
}
