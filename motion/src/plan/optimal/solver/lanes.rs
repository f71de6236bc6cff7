//! The same arithmetic on several spans at once, in a form that compilers turn into vector instructions.

use std::ops::{Add, AddAssign, Mul, Sub};

/// Spans that are worked on at once.
pub(super) const LANES: usize = 4;

/// One number for each of [`LANES`] spans.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lane(pub(super) [f64; LANES]);

impl Lane {
    #[inline(always)]
    pub(super) fn splat(value: f64) -> Lane {
        Lane([value; LANES])
    }

    #[inline(always)]
    fn zip(self, other: Lane, f: impl Fn(f64, f64) -> f64) -> Lane {
        Lane(core::array::from_fn(|lane| f(self.0[lane], other.0[lane])))
    }

    #[inline(always)]
    pub(super) fn recip(self) -> Lane {
        Lane(core::array::from_fn(|lane| 1.0 / self.0[lane]))
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Lane {
        Lane(core::array::from_fn(|lane| self.0[lane].sqrt()))
    }

    /// The greater one; never keeps a NaN of `other`.
    #[inline(always)]
    pub(super) fn max(self, other: Lane) -> Lane {
        self.zip(other, |a, b| if b > a { b } else { a })
    }

    /// The smaller one; never keeps a NaN of `other`.
    #[inline(always)]
    pub(super) fn min(self, other: Lane) -> Lane {
        self.zip(other, |a, b| if b < a { b } else { a })
    }

    #[inline(always)]
    pub(super) fn greatest(self) -> f64 {
        self.0.iter().fold(f64::NEG_INFINITY, |a, &b| if b > a { b } else { a })
    }

    #[inline(always)]
    pub(super) fn sum(self) -> f64 {
        self.0.iter().sum()
    }
}

impl Add for Lane {
    type Output = Lane;
    #[inline(always)]
    fn add(self, other: Lane) -> Lane {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lane {
    type Output = Lane;
    #[inline(always)]
    fn sub(self, other: Lane) -> Lane {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lane {
    type Output = Lane;
    #[inline(always)]
    fn mul(self, other: Lane) -> Lane {
        self.zip(other, |a, b| a * b)
    }
}

impl AddAssign for Lane {
    #[inline(always)]
    fn add_assign(&mut self, other: Lane) {
        *self = *self + other;
    }
}
