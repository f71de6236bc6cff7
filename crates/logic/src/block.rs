//! Standard function blocks: timers, counters, edges, memories.
//!
//! In:  slots of an instance, in the order of [`Block::variables`], and the time of the scan.
//! Out: its outputs and what it remembers.
//!
//! RT: no allocation, no locks, bounded.

use crate::scalar::Scalar;
use crate::syntax::Section;

/// A standard function block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Block {
    Ton,
    Tof,
    Tp,
    RisingEdge,
    FallingEdge,
    SetDominant,
    ResetDominant,
    Semaphore,
    /// Of a type of integer.
    CountUp(Scalar),
    CountDown(Scalar),
    CountBoth(Scalar),
}

type Variable = (&'static str, Section, Scalar);

const TIMER: &[Variable] = &[
    ("IN", Section::Input, Scalar::Bool),
    ("PT", Section::Input, Scalar::Time),
    ("Q", Section::Output, Scalar::Bool),
    ("ET", Section::Output, Scalar::Time),
    ("PHASE", Section::Local, Scalar::Sint),
    ("START", Section::Local, Scalar::Time),
];
const EDGE: &[Variable] = &[
    ("CLK", Section::Input, Scalar::Bool),
    ("Q", Section::Output, Scalar::Bool),
    ("M", Section::Local, Scalar::Bool),
];
const SET_DOMINANT: &[Variable] = &[
    ("S1", Section::Input, Scalar::Bool),
    ("R", Section::Input, Scalar::Bool),
    ("Q1", Section::Output, Scalar::Bool),
];
const RESET_DOMINANT: &[Variable] = &[
    ("S", Section::Input, Scalar::Bool),
    ("R1", Section::Input, Scalar::Bool),
    ("Q1", Section::Output, Scalar::Bool),
];
const SEMAPHORE: &[Variable] = &[
    ("CLAIM", Section::Input, Scalar::Bool),
    ("RELEASE", Section::Input, Scalar::Bool),
    ("BUSY", Section::Output, Scalar::Bool),
    ("X", Section::Local, Scalar::Bool),
];
const COUNT_UP: &[Variable] = &[
    ("CU", Section::Input, Scalar::Bool),
    ("R", Section::Input, Scalar::Bool),
    ("PV", Section::Input, Scalar::Int),
    ("Q", Section::Output, Scalar::Bool),
    ("CV", Section::Output, Scalar::Int),
    ("M", Section::Local, Scalar::Bool),
];
const COUNT_DOWN: &[Variable] = &[
    ("CD", Section::Input, Scalar::Bool),
    ("LD", Section::Input, Scalar::Bool),
    ("PV", Section::Input, Scalar::Int),
    ("Q", Section::Output, Scalar::Bool),
    ("CV", Section::Output, Scalar::Int),
    ("M", Section::Local, Scalar::Bool),
];
const COUNT_BOTH: &[Variable] = &[
    ("CU", Section::Input, Scalar::Bool),
    ("CD", Section::Input, Scalar::Bool),
    ("R", Section::Input, Scalar::Bool),
    ("LD", Section::Input, Scalar::Bool),
    ("PV", Section::Input, Scalar::Int),
    ("QU", Section::Output, Scalar::Bool),
    ("QD", Section::Output, Scalar::Bool),
    ("CV", Section::Output, Scalar::Int),
    ("MU", Section::Local, Scalar::Bool),
    ("MD", Section::Local, Scalar::Bool),
];

impl Block {
    /// All of them with their names.
    pub(crate) fn all() -> Vec<(String, Block)> {
        let simple = [
            ("TON", Block::Ton),
            ("TOF", Block::Tof),
            ("TP", Block::Tp),
            ("R_TRIG", Block::RisingEdge),
            ("F_TRIG", Block::FallingEdge),
            ("SR", Block::SetDominant),
            ("RS", Block::ResetDominant),
            ("SEMA", Block::Semaphore),
        ];
        let mut all: Vec<_> = simple.map(|(name, block)| (name.to_owned(), block)).into();
        type OfType = fn(Scalar) -> Block;
        let counters: [(&str, OfType); 3] = [
            ("CTU", Block::CountUp),
            ("CTD", Block::CountDown),
            ("CTUD", Block::CountBoth),
        ];
        for (name, block) in counters {
            all.push((name.to_owned(), block(Scalar::Int)));
            for scalar in [Scalar::Int, Scalar::Dint, Scalar::Lint, Scalar::Udint, Scalar::Ulint] {
                all.push((format!("{name}_{}", scalar.name()), block(scalar)));
            }
        }
        all
    }

    /// Its variables, one slot each.
    pub(crate) fn variables(self) -> Vec<Variable> {
        let (variables, counted) = match self {
            Block::Ton | Block::Tof | Block::Tp => (TIMER, Scalar::Int),
            Block::RisingEdge | Block::FallingEdge => (EDGE, Scalar::Int),
            Block::SetDominant => (SET_DOMINANT, Scalar::Int),
            Block::ResetDominant => (RESET_DOMINANT, Scalar::Int),
            Block::Semaphore => (SEMAPHORE, Scalar::Int),
            Block::CountUp(scalar) => (COUNT_UP, scalar),
            Block::CountDown(scalar) => (COUNT_DOWN, scalar),
            Block::CountBoth(scalar) => (COUNT_BOTH, scalar),
        };
        let of_type = |scalar: Scalar| if scalar == Scalar::Int { counted } else { scalar };
        let variables = variables.iter();
        variables
            .map(|(name, section, scalar)| (*name, *section, of_type(*scalar)))
            .collect()
    }

    /// One call; `slots` begins with those of the instance.
    pub(crate) fn call(self, slots: &mut [i64], now_ns: i64) {
        match self {
            Block::Ton | Block::Tof | Block::Tp => {
                if let Some(slots) = slots.first_chunk_mut() {
                    self.time(slots, now_ns);
                }
            }
            Block::RisingEdge | Block::FallingEdge => {
                if let Some([clock, q, memory]) = slots.first_chunk_mut() {
                    *q = match self {
                        Block::RisingEdge => *clock & !*memory & 1,
                        _ => !*clock & *memory & 1,
                    };
                    *memory = *clock;
                }
            }
            Block::SetDominant => {
                if let Some([set, reset, q]) = slots.first_chunk_mut() {
                    *q = *set | (!*reset & *q & 1);
                }
            }
            Block::ResetDominant => {
                if let Some([set, reset, q]) = slots.first_chunk_mut() {
                    *q = !*reset & (*set | *q) & 1;
                }
            }
            Block::Semaphore => {
                if let Some([claim, release, busy, taken]) = slots.first_chunk_mut() {
                    *busy = *taken;
                    if *claim != 0 {
                        *taken = 1;
                    } else if *release != 0 {
                        (*busy, *taken) = (0, 0);
                    }
                }
            }
            Block::CountUp(scalar) => {
                if let Some([up, reset, preset, q, value, memory]) = slots.first_chunk_mut() {
                    let edge = rises(*up, memory);
                    if *reset != 0 {
                        *value = 0;
                    } else if edge {
                        *value = counted(scalar, *value, 1);
                    }
                    *q = i64::from(scalar.number(*value) >= scalar.number(*preset));
                }
            }
            Block::CountDown(scalar) => {
                if let Some([down, load, preset, q, value, memory]) = slots.first_chunk_mut() {
                    let edge = rises(*down, memory);
                    if *load != 0 {
                        *value = *preset;
                    } else if edge {
                        *value = counted(scalar, *value, -1);
                    }
                    *q = i64::from(scalar.number(*value) <= 0);
                }
            }
            Block::CountBoth(scalar) => {
                if let Some(slots) = slots.first_chunk_mut() {
                    count_both(scalar, slots);
                }
            }
        }
    }

    /// Phase 0: at rest; 1: time runs; 2: it has run out. An elapsed time of exactly PT has run out.
    fn time(self, [input, preset, q, elapsed, phase, start]: &mut [i64; 6], now_ns: i64) {
        let on = *input != 0;
        let begins = match self {
            Block::Tof => !on && *q != 0,
            _ => on,
        };
        if *phase == 0 && begins {
            (*phase, *start) = (1, now_ns);
        }
        match self {
            Block::Ton if !on => *phase = 0,
            Block::Tof if on => *phase = 0,
            _ => {}
        }
        if *phase == 1 && now_ns.saturating_sub(*start) >= *preset {
            (*phase, *elapsed) = (2, (*preset).max(0));
        }
        if self == Block::Tp && *phase == 2 && !on {
            *phase = 0;
        }
        match *phase {
            1 => *elapsed = now_ns.saturating_sub(*start),
            // Before its first TRUE, and with TRUE, the time of TOF is 0.
            0 => *elapsed = 0,
            _ => {}
        }
        *q = i64::from(match self {
            Block::Ton => *phase == 2,
            Block::Tof => on || *phase == 1,
            _ => *phase == 1,
        });
    }
}

/// Whether there is an edge; remembers the value for the next call.
fn rises(now: i64, memory: &mut i64) -> bool {
    let edge = now != 0 && *memory == 0;
    *memory = now;
    edge
}

/// One more or less, at most to the end of the type.
fn counted(scalar: Scalar, value: i64, by: i128) -> i64 {
    let (low, high) = scalar.range();
    scalar.wrap((scalar.number(value) + by).clamp(low, high)).0
}

fn count_both(scalar: Scalar, slots: &mut [i64; 10]) {
    let [
        up,
        down,
        reset,
        load,
        preset,
        at_preset,
        at_zero,
        value,
        memory_up,
        memory_down,
    ] = slots;
    let (goes_up, goes_down) = (rises(*up, memory_up), rises(*down, memory_down));
    if *reset != 0 {
        *value = 0;
    } else if *load != 0 {
        *value = *preset;
    } else if goes_up != goes_down {
        *value = counted(scalar, *value, if goes_up { 1 } else { -1 });
    }
    *at_preset = i64::from(scalar.number(*value) >= scalar.number(*preset));
    *at_zero = i64::from(scalar.number(*value) <= 0);
}
