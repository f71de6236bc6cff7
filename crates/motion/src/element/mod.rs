//! What the ring carries: motion on exact geometry, waits, and things to do at rest.
//!
//! In:  from the planner. Out: to the interpolation.

mod auxiliary;

use crate::canon::ProbeMode;
use crate::path::Piece;
use crate::ring::Timed;
use crate::rt::MotionLimits;

pub use auxiliary::{Action, Auxiliary, Enables, Outputs, Surface};

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
