//! The same arithmetic on several spans at once, in a form that compilers turn into vector instructions.
//!
//! Every operation is written out lane by lane: so it is vector instructions also where nothing is optimised between crates.

use std::ops::{Add, AddAssign, Mul, Sub};

/// Spans that are worked on at once.
pub(super) const LANES: usize = 4;

/// One number for each of [`LANES`] spans.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lane(pub(super) [f64; LANES]);

/// A lane by an expression of the numbers in one or two lanes.
macro_rules! each {
    ($a:ident => $value:expr; $x:expr) => {{
        let [p, q, r, s] = $x.0;
        let f = |$a: f64| $value;
        Lane([f(p), f(q), f(r), f(s)])
    }};
    ($a:ident, $b:ident => $value:expr; $x:expr, $y:expr) => {{
        let ([p, q, r, s], [t, u, v, w]) = ($x.0, $y.0);
        let f = |$a: f64, $b: f64| $value;
        Lane([f(p, t), f(q, u), f(r, v), f(s, w)])
    }};
}

impl Lane {
    #[inline(always)]
    pub(super) fn splat(value: f64) -> Lane {
        Lane([value; LANES])
    }

    #[inline(always)]
    pub(super) fn recip(self) -> Lane {
        each!(a => 1.0 / a; self)
    }

    /// The greater one; never keeps a NaN of `other`.
    #[inline(always)]
    pub(super) fn max(self, other: Lane) -> Lane {
        each!(a, b => if b > a { b } else { a }; self, other)
    }

    /// The smaller one; never keeps a NaN of `other`.
    #[inline(always)]
    pub(super) fn min(self, other: Lane) -> Lane {
        each!(a, b => if b < a { b } else { a }; self, other)
    }

    #[inline(always)]
    pub(super) fn greatest(self) -> f64 {
        let [a, b, c, d] = self.0;
        let more = |a: f64, b: f64| if b > a { b } else { a };
        more(more(more(more(f64::NEG_INFINITY, a), b), c), d)
    }

    /// Whether one of them is above a bound.
    #[inline(always)]
    pub(super) fn exceeds(self, bound: f64) -> bool {
        let [a, b, c, d] = self.0;
        (a > bound) | (b > bound) | (c > bound) | (d > bound)
    }

    #[inline(always)]
    pub(super) fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        a + b + c + d
    }
}

impl Add for Lane {
    type Output = Lane;
    #[inline(always)]
    fn add(self, other: Lane) -> Lane {
        each!(a, b => a + b; self, other)
    }
}

impl Sub for Lane {
    type Output = Lane;
    #[inline(always)]
    fn sub(self, other: Lane) -> Lane {
        each!(a, b => a - b; self, other)
    }
}

impl Mul for Lane {
    type Output = Lane;
    #[inline(always)]
    fn mul(self, other: Lane) -> Lane {
        each!(a, b => a * b; self, other)
    }
}

impl AddAssign for Lane {
    #[inline(always)]
    fn add_assign(&mut self, other: Lane) {
        *self = *self + other;
    }
}
