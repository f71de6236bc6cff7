//! Numbers in which kinematics are computed: a plain one, or one that carries its derivatives along.
//!
//! In:  values, or values with their derivatives by path length s.
//! Out: the same of every expression of them.
//!
//! Every map from axes to joints is written once, generic over [`Number`]. With `f64` it gives positions (real time);
//! with [`Jet3`] it gives what the planner needs besides: q', q'' and q''' of every joint, by the exact rules of
//! differentiation and not by differences. Angles are radians here; kinematics turn degrees into them.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A value that can be computed with as kinematics need it. RT: nothing allocates, nothing panics; an argument outside the
/// domain of a function gives NaN, the border of a domain infinite derivatives.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// A number that does not depend on s.
    fn constant(value: f64) -> Self;

    /// The value alone.
    fn value(self) -> f64;

    /// Square root.
    fn sqrt(self) -> Self;

    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);

    /// Angle of the vector (x, `self`), radians, in -π..=π.
    fn atan2(self, x: Self) -> Self;

    /// Angle in 0..=π with this cosine, radians.
    fn acos(self) -> Self;

    /// Angle in -π/2..=π/2 with this sine, radians.
    fn asin(self) -> Self;

    /// Length of the vector (`self`, `other`).
    fn hypot(self, other: Self) -> Self;

    /// Degrees to radians.
    fn to_radians(self) -> Self {
        self * (std::f64::consts::PI / 180.0)
    }

    /// Radians to degrees.
    fn to_degrees(self) -> Self {
        self * (180.0 / std::f64::consts::PI)
    }
}

impl Number for f64 {
    fn constant(value: f64) -> f64 {
        value
    }

    fn value(self) -> f64 {
        self
    }

    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }

    fn sin_cos(self) -> (f64, f64) {
        libm::sincos(self)
    }

    fn atan2(self, x: f64) -> f64 {
        libm::atan2(self, x)
    }

    fn acos(self) -> f64 {
        libm::acos(self)
    }

    fn asin(self) -> f64 {
        libm::asin(self)
    }

    fn hypot(self, other: f64) -> f64 {
        libm::hypot(self, other)
    }
}

/// A value and its first three derivatives by path length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jet3 {
    /// Value, mm or degrees.
    pub q: f64,
    /// q', per unit of length.
    pub d1: f64,
    /// q'', per unit of length squared.
    pub d2: f64,
    /// q''', per unit of length cubed.
    pub d3: f64,
}

impl Jet3 {
    /// Zero, whatever s.
    pub const ZERO: Jet3 = Jet3::new(0.0, 0.0, 0.0, 0.0);

    /// A value with its derivatives.
    pub const fn new(q: f64, d1: f64, d2: f64, d3: f64) -> Jet3 {
        Jet3 { q, d1, d2, d3 }
    }

    /// Whether value and derivatives are finite.
    pub fn is_finite(&self) -> bool {
        self.q.is_finite() && self.d1.is_finite() && self.d2.is_finite() && self.d3.is_finite()
    }

    /// f(self), by the values of f and its first three derivatives at `self.q` (Faà di Bruno).
    fn through(self, [f0, f1, f2, f3]: [f64; 4]) -> Jet3 {
        let Jet3 { d1, d2, d3, .. } = self;
        Jet3 {
            q: f0,
            d1: f1 * d1,
            d2: f2 * d1 * d1 + f1 * d2,
            d3: f3 * d1 * d1 * d1 + 3.0 * f2 * d1 * d2 + f1 * d3,
        }
    }
}

impl Add for Jet3 {
    type Output = Jet3;
    fn add(self, other: Jet3) -> Jet3 {
        Jet3::new(
            self.q + other.q,
            self.d1 + other.d1,
            self.d2 + other.d2,
            self.d3 + other.d3,
        )
    }
}

impl Sub for Jet3 {
    type Output = Jet3;
    fn sub(self, other: Jet3) -> Jet3 {
        Jet3::new(
            self.q - other.q,
            self.d1 - other.d1,
            self.d2 - other.d2,
            self.d3 - other.d3,
        )
    }
}

impl Neg for Jet3 {
    type Output = Jet3;
    fn neg(self) -> Jet3 {
        Jet3::new(-self.q, -self.d1, -self.d2, -self.d3)
    }
}

/// Leibniz: `(ab)''' = a'''b + 3a''b' + 3a'b'' + ab'''`.
impl Mul for Jet3 {
    type Output = Jet3;
    fn mul(self, other: Jet3) -> Jet3 {
        let (a, b) = (self, other);
        Jet3 {
            q: a.q * b.q,
            d1: a.d1 * b.q + a.q * b.d1,
            d2: a.d2 * b.q + 2.0 * a.d1 * b.d1 + a.q * b.d2,
            d3: a.d3 * b.q + 3.0 * (a.d2 * b.d1 + a.d1 * b.d2) + a.q * b.d3,
        }
    }
}

/// Leibniz for `qb = a`, solved for q, q', q'', q''' one after the other.
impl Div for Jet3 {
    type Output = Jet3;
    fn div(self, other: Jet3) -> Jet3 {
        let (a, b) = (self, other);
        let q = a.q / b.q;
        let d1 = (a.d1 - q * b.d1) / b.q;
        let d2 = (a.d2 - 2.0 * d1 * b.d1 - q * b.d2) / b.q;
        let d3 = (a.d3 - 3.0 * (d2 * b.d1 + d1 * b.d2) - q * b.d3) / b.q;
        Jet3 { q, d1, d2, d3 }
    }
}

impl Add<f64> for Jet3 {
    type Output = Jet3;
    fn add(self, other: f64) -> Jet3 {
        Jet3 {
            q: self.q + other,
            ..self
        }
    }
}

impl Sub<f64> for Jet3 {
    type Output = Jet3;
    fn sub(self, other: f64) -> Jet3 {
        Jet3 {
            q: self.q - other,
            ..self
        }
    }
}

impl Mul<f64> for Jet3 {
    type Output = Jet3;
    fn mul(self, other: f64) -> Jet3 {
        Jet3::new(self.q * other, self.d1 * other, self.d2 * other, self.d3 * other)
    }
}

impl Number for Jet3 {
    fn constant(value: f64) -> Jet3 {
        Jet3::new(value, 0.0, 0.0, 0.0)
    }

    fn value(self) -> f64 {
        self.q
    }

    /// Leibniz for `rr = a`, solved for r', r'', r'''.
    fn sqrt(self) -> Jet3 {
        let root = self.q.sqrt();
        let half = 0.5 / root;
        let d1 = self.d1 * half;
        let d2 = (self.d2 - 2.0 * d1 * d1) * half;
        let d3 = (self.d3 - 6.0 * d1 * d2) * half;
        Jet3 { q: root, d1, d2, d3 }
    }

    fn sin_cos(self) -> (Jet3, Jet3) {
        let (sin, cos) = libm::sincos(self.q);
        (
            self.through([sin, cos, -sin, -cos]),
            self.through([cos, -sin, -cos, sin]),
        )
    }

    /// θ' = n/d with n = xy' - yx' and d = x² + y²; θ'' and θ''' by Leibniz for `θ'd = n`.
    fn atan2(self, x: Jet3) -> Jet3 {
        let y = self;
        let d = x.q * x.q + y.q * y.q;
        let d_1 = 2.0 * (x.q * x.d1 + y.q * y.d1);
        let d_2 = 2.0 * (x.d1 * x.d1 + y.d1 * y.d1 + x.q * x.d2 + y.q * y.d2);
        let n = x.q * y.d1 - y.q * x.d1;
        let n_1 = x.q * y.d2 - y.q * x.d2;
        let n_2 = x.d1 * y.d2 - y.d1 * x.d2 + x.q * y.d3 - y.q * x.d3;
        let d1 = n / d;
        let d2 = (n_1 - d1 * d_1) / d;
        let d3 = (n_2 - 2.0 * d2 * d_1 - d1 * d_2) / d;
        Jet3 {
            q: libm::atan2(y.q, x.q),
            d1,
            d2,
            d3,
        }
    }

    fn acos(self) -> Jet3 {
        let [_, f1, f2, f3] = arc_sine_derivatives(self.q);
        self.through([libm::acos(self.q), -f1, -f2, -f3])
    }

    fn asin(self) -> Jet3 {
        let [_, f1, f2, f3] = arc_sine_derivatives(self.q);
        self.through([libm::asin(self.q), f1, f2, f3])
    }

    fn hypot(self, other: Jet3) -> Jet3 {
        let length = (self * self + other * other).sqrt();
        Jet3 {
            q: libm::hypot(self.q, other.q),
            ..length
        }
    }
}

/// First three derivatives of the arc sine at x, in places 1 to 3; those of the arc cosine are their negatives.
fn arc_sine_derivatives(x: f64) -> [f64; 4] {
    let square = 1.0 / ((1.0 - x) * (1.0 + x));
    let f1 = square.sqrt();
    let f3 = f1 * square;
    [0.0, f1, x * f3, (1.0 + 2.0 * x * x) * f3 * square]
}
