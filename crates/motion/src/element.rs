//! What the ring carries: motion on exact geometry, waits, and things to do at rest.
//!
//! In:  from the planner. Out: to the interpolation.

use crate::canon::{Input, OrientDirection, ProbeMode, SpindleDirection, WaitMode};
use crate::path::Piece;
use crate::ring::Timed;
use crate::rt::MotionLimits;
use std::f64::consts::TAU;
use std::fmt;

/// One element of the plan.
// Spans are the rule and everything else the exception, so that their size costs nothing.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
pub enum Element {
    /// Motion.
    Span(Span),
    /// Motion in step with the spindle, from rest to rest.
    Synced(Synced),
    /// Motion until a contact changes, from rest to rest; the plan goes on from wherever that is.
    Probing(Probing),
    /// Rest for a time.
    Dwell {
        /// Seconds.
        seconds: f64,
        /// Line of the program.
        line: u32,
    },
    /// Something to do at rest; the plan goes on once it is acknowledged.
    Action {
        /// What to do.
        action: Action,
        /// Line of the program.
        line: u32,
    },
}

impl Element {
    /// Line of the program.
    pub fn line(&self) -> u32 {
        match self {
            Element::Span(span) => span.line,
            Element::Synced(synced) => synced.line,
            Element::Probing(probing) => probing.line,
            Element::Dwell { line, .. } | Element::Action { line, .. } => *line,
        }
    }

    /// How far it brings a program: length of the path, mm or degrees; of what is no motion along a path that is known, its planned
    /// time, s. As different as these are, their sum tells one place of a program from another whatever the overrides. RT.
    pub fn way(&self) -> f64 {
        match self {
            Element::Span(span) => span.place(span.duration_s) - span.s0,
            Element::Synced(_) | Element::Probing(_) | Element::Dwell { .. } | Element::Action { .. } => {
                self.duration_s()
            }
        }
    }
}

impl Timed for Element {
    fn duration_s(&self) -> f64 {
        match self {
            Element::Span(span) => span.duration_s,
            Element::Synced(synced) => synced.duration_s(),
            Element::Probing(probing) => probing.duration_s(),
            Element::Dwell { seconds, .. } => *seconds,
            Element::Action { .. } => 0.0,
        }
    }
}

/// Motion along one piece of the path.
///
/// With s the place and dots for derivatives by time, the law of motion is `s... = jerk + gradient s.`: constant jerk where
/// `gradient` is 0 (starts, stops and the phases of a classic slope); acceleration that changes evenly with the place where
/// `jerk` is 0 (the spline of the optimal planner).
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Piece of path of which the span is a stretch.
    pub piece: Piece,
    /// Place on the piece where the span begins, mm (degrees on a purely rotary piece).
    pub s0: f64,
    /// Speed there, mm/s.
    pub v0: f64,
    /// Acceleration there, mm/s².
    pub a0: f64,
    /// Jerk all along besides what comes from `gradient`, mm/s³.
    pub jerk: f64,
    /// Change of acceleration with the place, 1/s²; `|gradient| duration_s²` is at most [`Span::GRADIENT_TIME2_MAX`].
    pub gradient: f64,
    /// Time from its beginning to its end, s.
    pub duration_s: f64,
    /// Line of the program.
    pub line: u32,
    /// Whether the move is a rapid one (G0).
    pub rapid: bool,
    /// What acts on it from outside.
    pub enables: Enables,
    /// What the program has told spindle, coolant, tool changer and operator before it.
    pub auxiliary: Auxiliary,
    /// Number of the modes in force, as [`Source::modes`](crate::canon::Source::modes) says.
    pub modes: u32,
}

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
/// as it is passed: no rest is needed for them. Whether they are told on the way or at rest ([`Element::Action`]), this is the
/// state behind them.
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

impl Span {
    /// Up to here the series of [`Span::place`] is exact to rounding: its first term left out is below 1e-13 of the sum.
    pub const GRADIENT_TIME2_MAX: f64 = 4.0;

    /// Place on the piece after `t_s` seconds. RT.
    pub fn place(&self, t_s: f64) -> f64 {
        let x = self.gradient * t_s * t_s;
        let third = self.jerk + self.gradient * self.v0;
        self.s0 + t_s * (self.v0 + t_s * (self.a0 * series::<2>(x) + t_s * third * series::<3>(x)))
    }

    /// Speed after `t_s` seconds. RT.
    pub fn speed(&self, t_s: f64) -> f64 {
        let x = self.gradient * t_s * t_s;
        let third = self.jerk + self.gradient * self.v0;
        self.v0 + t_s * (self.a0 * series::<1>(x) + t_s * third * series::<2>(x))
    }
}

/// 1/N! + x/(N+2)! + x²/(N+4)! + ...: of these are the solutions of the law of motion (cosh and sinh, or cos and sin).
fn series<const N: u32>(x: f64) -> f64 {
    const TERMS: usize = 10;
    /// Terms where x is that small: the next one is beyond rounding.
    const FEW: (f64, usize) = (0.03, 5);
    let factors = const {
        let mut factors = [0.0; TERMS];
        let mut k = 0;
        while k < TERMS {
            factors[k] = 1.0 / factorial(N + 2 * k as u32);
            k += 1;
        }
        factors
    };
    let terms = if x.abs() < FEW.0 {
        &factors[..FEW.1]
    } else {
        &factors[..]
    };
    terms.iter().rev().fold(0.0, |sum, factor| factor + x * sum)
}

const fn factorial(n: u32) -> f64 {
    let (mut product, mut k) = (1.0, 2);
    while k <= n {
        product *= k as f64;
        k += 1;
    }
    product
}

/// Motion along one piece in step with the spindle: the place is the pitch times the turns since an index (G33, G76), or there
/// and back through a reversal of the spindle (G33.1). Where it is when, the spindle decides: `rt::Follower`.
#[derive(Clone, Copy, Debug)]
pub struct Synced {
    /// The geometry; of a tapping move, from its start to beyond the depth.
    pub piece: Piece,
    /// Way per turn, mm, greater than 0.
    pub pitch_mm: f64,
    /// Along the piece, for motion of any timing: every joint keeps its own.
    pub limits: MotionLimits,
    /// The way back of a tapping move.
    pub tap: Option<Tap>,
    /// Programmed speed of the spindle, turns/s, greater than 0: for estimates.
    pub turns_s: f64,
    /// Line of the program.
    pub line: u32,
}

impl Synced {
    /// As fast as the axes can follow the spindle, turns/s.
    pub fn turns_s_max(&self) -> f64 {
        self.limits.velocity / self.pitch_mm
    }

    /// Time at the programmed speed of the spindle without start, reversal and stop, s: how long it really takes, the spindle
    /// decides.
    pub fn duration_s(&self) -> f64 {
        let turns = self
            .tap
            .map_or(self.piece.length(), |tap| tap.depth_mm * (1.0 + 1.0 / tap.return_scale));
        turns / (self.pitch_mm * self.turns_s)
    }
}

/// What makes a synchronised move one of rigid tapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tap {
    /// Place on the piece at which the spindle is to be reversed, mm; the piece goes on behind it for its run-down.
    pub depth_mm: f64,
    /// Speed of the spindle on the way back relative to the way in, greater than 0.
    pub return_scale: f64,
}

/// Motion along a straight piece that ends where a contact changes (G38.2 to G38.5): `rt::probe`.
#[derive(Clone, Copy, Debug)]
pub struct Probing {
    /// The geometry, as far as the move may go.
    pub piece: Piece,
    /// What the move waits for.
    pub mode: ProbeMode,
    /// Programmed feed, mm/s (degrees/s on a purely rotary piece).
    pub feed: f64,
    /// Along the piece, for motion of any timing: every joint keeps its own.
    pub limits: MotionLimits,
    /// Line of the program.
    pub line: u32,
}

impl Probing {
    /// Time of the whole way at the programmed feed, without start and stop, s: how long it really takes, the contact decides.
    pub fn duration_s(&self) -> f64 {
        self.piece.length() / self.feed.min(self.limits.velocity)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canon::Position;

    #[test]
    fn place_and_speed_solve_the_law_of_motion() {
        let t: f64 = 0.1;
        let (v, a) = (20.0, -150.0);
        for gradient in [-350.0f64, -20.0, 0.0, 20.0, 350.0] {
            let span = Span {
                piece: Piece::line(Position::ZERO, Position::xyz(100.0, 0.0, 0.0)).unwrap(),
                s0: 3.0,
                v0: v,
                a0: a,
                jerk: 0.0,
                gradient,
                duration_s: t,
                line: 1,
                rapid: false,
                enables: Enables::default(),
                auxiliary: Auxiliary::INITIAL,
                modes: 0,
            };
            let r = gradient.abs().sqrt();
            let (sinh, cosh) = if gradient > 0.0 {
                ((r * t).sinh(), (r * t).cosh())
            } else {
                ((r * t).sin(), (r * t).cos())
            };
            let (place, speed) = if gradient == 0.0 {
                (v * t + a * t * t / 2.0, v + a * t)
            } else {
                (v * sinh / r + a / gradient * (cosh - 1.0), v * cosh + a * sinh / r)
            };
            assert!((span.place(t) - 3.0 - place).abs() < 1e-12, "{gradient}");
            assert!((span.speed(t) - speed).abs() < 1e-11, "{gradient}");
        }
    }
}
