//! The same arithmetic on several spans at once, in a form that compilers turn into vector instructions.
//!
//! Every operation is written out lane by lane: so it is vector instructions also where nothing is optimised between crates.

use std::ops::{Add, AddAssign, Mul, Sub};

/// Spans that are worked on at once.
pub(super) const LANES: usize = 8;

/// One number for each of [`LANES`] spans.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lane(pub(super) [f64; LANES]);

/// A lane by an expression of the numbers in one or two lanes.
macro_rules! each {
    ($a:ident => $value:expr; $x:expr) => {{
        let f = |$a: f64| $value;
        let mut lane = $x;
        for a in &mut lane.0 {
            *a = f(*a);
        }
        lane
    }};
    ($a:ident, $b:ident => $value:expr; $x:expr, $y:expr) => {{
        let f = |$a: f64, $b: f64| $value;
        let mut lane = $x;
        for (a, b) in lane.0.iter_mut().zip($y.0) {
            *a = f(*a, b);
        }
        lane
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
        let more = |a: f64, b: f64| if b > a { b } else { a };
        self.0.into_iter().fold(f64::NEG_INFINITY, more)
    }

    /// Whether one of them is above a bound.
    #[inline(always)]
    pub(super) fn exceeds(self, bound: f64) -> bool {
        self.0.into_iter().fold(false, |any, a| any | (a > bound))
    }

    #[inline(always)]
    pub(super) fn sum(self) -> f64 {
        self.0.into_iter().sum()
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
