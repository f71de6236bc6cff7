//! Rounded corner: a quintic with given position, direction and curvature at both ends.

use super::{Derivatives, Group, Jet, LengthTable, by_length};
use crate::canon::{AXES, Position};

/// One end of a [`Blend`].
#[derive(Clone, Copy, Debug)]
pub struct BlendEnd {
    /// Position and derivatives by length of the leg where the blend leaves or meets it.
    pub leg: Jet,
    /// Length of the leg that one unit of the curve parameter would cover there.
    pub pace: f64,
    /// Second derivative of that length by the parameter: how the pace changes. The shape of the corner depends on it.
    pub pace_change: f64,
}

/// A curve that nearly stops somewhere, as a part of its mean pace, turns too sharply there to be of use.
const SLOWEST: f64 = 0.15;

/// Quintic polynomial in nine axes.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    /// Coefficients of u^0 to u^5.
    c: [[f64; AXES]; 6],
    table: LengthTable,
    group: Group,
    /// Whether no axis but X, Y and Z moves.
    main_only: bool,
    /// Least length per parameter, as a part of the greatest.
    evenness: f64,
}

impl Blend {
    pub(super) fn is(&self, other: &Blend) -> bool {
        // All of it at once: a way out at each number would cost more than it saves.
        let pairs = self.c.as_flattened().iter().zip(other.c.as_flattened());
        pairs.fold(true, |same, (a, b)| same & (a == b))
    }

    /// The quintic whose second-order contact with both legs makes position, direction and curvature continuous.
    pub(super) fn new(from: &BlendEnd, to: &BlendEnd, group: Group) -> Option<Blend> {
        let mut c = [[0.0; AXES]; 6];
        // One axis at a time; the coefficients lie across the rows.
        #[allow(clippy::needless_range_loop)]
        for axis in 0..AXES {
            let first = |end: &BlendEnd| end.leg.d1[axis] * end.pace;
            let second = |end: &BlendEnd| end.leg.d2[axis] * end.pace * end.pace + end.leg.d1[axis] * end.pace_change;
            let (v0, v1, a0, a1) = (first(from), first(to), second(from), second(to));
            let rise = to.leg.q[axis] - from.leg.q[axis];
            c[0][axis] = from.leg.q[axis];
            c[1][axis] = v0;
            c[2][axis] = a0 / 2.0;
            c[3][axis] = 10.0 * rise - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
            c[4][axis] = -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
            c[5][axis] = 6.0 * rise - 3.0 * (v0 + v1) + 0.5 * (a1 - a0);
        }
        let main_only = c[1..].iter().all(|row| row[3..].iter().all(|&x| x == 0.0));
        let hodograph = Hodograph::new(&c, group);
        let speed = |u: f64| hodograph.speed(u);
        let table = LengthTable::new(speed);
        let mean = table.length();
        let speeds: [f64; 33] = core::array::from_fn(|k| speed(k as f64 / 32.0));
        let slowest = speeds.into_iter().fold(f64::INFINITY, f64::min);
        let fastest = speeds.into_iter().fold(0.0, f64::max);
        (mean.is_finite() && mean > 0.0 && slowest >= SLOWEST * mean).then(|| Blend {
            c,
            table: table.refined([slowest, fastest], speed),
            group,
            main_only,
            evenness: slowest / fastest,
        })
    }

    /// Least length per parameter, as a part of the greatest. Where other axes go on, the length may nearly stand still though
    /// its direction turns little, and derivatives by length change as fast there.
    pub fn evenness(&self) -> f64 {
        self.evenness
    }

    pub(super) fn length(&self) -> f64 {
        self.table.length()
    }

    /// Axes along which the length is counted.
    pub fn group(&self) -> Group {
        self.group
    }

    #[inline]
    fn hodograph(&self) -> Hodograph {
        Hodograph::new(&self.c, self.group)
    }

    /// Length up to parameter `u`.
    pub(super) fn length_to(&self, u: f64) -> f64 {
        let hodograph = self.hodograph();
        self.table.length_to(u, |u| hodograph.speed(u))
    }

    /// RT.
    pub(super) fn parameter(&self, s: f64) -> f64 {
        let hodograph = self.hodograph();
        self.table.parameter(s, |u| hodograph.speed(u), |u| hodograph.pace(u))
    }

    /// RT.
    pub(super) fn position(&self, s: f64) -> Position {
        Position(self.position_at(self.parameter(s)))
    }

    /// Position at curve parameter `u`, 0 to 1. RT.
    pub fn position_at(&self, u: f64) -> [f64; AXES] {
        let mut q = self.c[0];
        for (axis, q) in q[..self.axes()].iter_mut().enumerate() {
            let c = |k: usize| self.c[k][axis];
            *q = c(0) + u * (c(1) + u * (c(2) + u * (c(3) + u * (c(4) + u * c(5)))));
        }
        q
    }

    /// Bézier points of an axis: the curve lies between the least and the greatest of them.
    fn bezier(&self, axis: usize) -> [f64; 6] {
        let c = |k: usize| self.c[k][axis];
        // u^k is the sum of (i over k) / (5 over k) of the Bernstein polynomials from i = k on.
        [
            c(0),
            c(0) + c(1) / 5.0,
            c(0) + 2.0 * c(1) / 5.0 + c(2) / 10.0,
            c(0) + 3.0 * c(1) / 5.0 + 3.0 * c(2) / 10.0 + c(3) / 10.0,
            c(0) + 4.0 * c(1) / 5.0 + 6.0 * c(2) / 10.0 + 4.0 * c(3) / 10.0 + c(4) / 5.0,
            c(0) + c(1) + c(2) + c(3) + c(4) + c(5),
        ]
    }

    /// Bounds of the position of an axis, not tight, at next to no cost.
    pub fn hull(&self, axis: usize) -> (f64, f64) {
        let points = self.bezier(axis);
        points[1..]
            .iter()
            .fold((points[0], points[0]), |(low, high), x| (low.min(*x), high.max(*x)))
    }

    /// Least and greatest position of an axis, within 1e-10.
    ///
    /// Halved until the Bézier points of a part, between which the curve lies, are in order or not beyond what is known.
    pub fn reach(&self, axis: usize) -> (f64, f64) {
        const NEAR: f64 = 1e-10;
        /// Parts of 1/2^20 of a curve differ from their chord by its 2^40th part.
        const HALVINGS: u32 = 20;
        fn extend(points: [f64; 6], halvings: u32, low: &mut f64, high: &mut f64) {
            *low = low.min(points[0]).min(points[5]);
            *high = high.max(points[0]).max(points[5]);
            let inside = points.iter().all(|x| (*low - NEAR..=*high + NEAR).contains(x));
            if inside || halvings == 0 {
                return;
            }
            let (mut level, mut halves) = (points, [points; 2]);
            for step in 0..6 {
                halves[0][step] = level[0];
                halves[1][5 - step] = level[5 - step];
                for at in 0..5 - step {
                    level[at] = 0.5 * (level[at] + level[at + 1]);
                }
            }
            for half in halves {
                extend(half, halvings - 1, low, high);
            }
        }
        let points = self.bezier(axis);
        let (mut low, mut high) = (points[0].min(points[5]), points[0].max(points[5]));
        extend(points, HALVINGS, &mut low, &mut high);
        (low, high)
    }

    /// Axes behind which none moves.
    pub fn axes(&self) -> usize {
        if self.main_only { 3 } else { AXES }
    }

    /// RT.
    pub(super) fn jet(&self, s: f64) -> Jet {
        self.jet_at(self.parameter(s))
    }

    /// Position and derivatives by length at curve parameter `u`, 0 to 1: the even scale for looking at the curve, which
    /// may turn most where it is shortest. RT.
    pub fn jet_at(&self, u: f64) -> Jet {
        if self.main_only {
            self.jet_of::<3>(u)
        } else {
            self.jet_of::<AXES>(u)
        }
    }

    /// The same, where only the first `N` axes move.
    fn jet_of<const N: usize>(&self, u: f64) -> Jet {
        let mut jet = Jet {
            q: self.c[0],
            ..Jet::default()
        };
        for axis in 0..N {
            let c = |k: usize| self.c[k][axis];
            jet.q[axis] = c(0) + u * (c(1) + u * (c(2) + u * (c(3) + u * (c(4) + u * c(5)))));
        }
        let [d1, d2, d3] = self.derivatives_at::<N>(u);
        jet.d1[..N].copy_from_slice(&d1);
        jet.d2[..N].copy_from_slice(&d2);
        jet.d3[..N].copy_from_slice(&d3);
        jet
    }

    /// Derivatives by length of the first `N` axes (see [`Blend::axes`]) at curve parameter `u`, 0 to 1. RT.
    #[inline]
    pub fn derivatives_at<const N: usize>(&self, u: f64) -> Derivatives<N> {
        let mut derivatives = [[0.0; N]; 3];
        let [d1, d2, d3] = &mut derivatives;
        for axis in 0..N {
            let c = |k: usize| self.c[k][axis];
            d1[axis] = c(1) + u * (2.0 * c(2) + u * (3.0 * c(3) + u * (4.0 * c(4) + u * 5.0 * c(5))));
            d2[axis] = 2.0 * c(2) + u * (6.0 * c(3) + u * (12.0 * c(4) + u * 20.0 * c(5)));
            d3[axis] = 6.0 * c(3) + u * (24.0 * c(4) + u * 60.0 * c(5));
        }
        by_length(derivatives, self.group.first())
    }
}

/// First derivative by the curve parameter of the three axes along which the length is counted: coefficients of u^0 to u^4.
#[derive(Clone, Copy)]
struct Hodograph([[f64; 3]; 5]);

impl Hodograph {
    #[inline]
    fn new(c: &[[f64; AXES]; 6], group: Group) -> Hodograph {
        let first = group.first();
        let mut hodograph = [[0.0; 3]; 5];
        for (k, (row, power)) in hodograph.iter_mut().zip([1.0, 2.0, 3.0, 4.0, 5.0]).enumerate() {
            for axis in 0..3 {
                row[axis] = power * c[k + 1][first + axis];
            }
        }
        Hodograph(hodograph)
    }

    /// Length per parameter. RT.
    #[inline]
    fn speed(&self, u: f64) -> f64 {
        let [c0, c1, c2, c3, c4] = &self.0;
        let d: [f64; 3] = core::array::from_fn(|k| c0[k] + u * (c1[k] + u * (c2[k] + u * (c3[k] + u * c4[k]))));
        (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
    }

    /// Length per parameter and its derivative. RT.
    #[inline]
    fn pace(&self, u: f64) -> [f64; 2] {
        let [c0, c1, c2, c3, c4] = &self.0;
        let speed = self.speed(u);
        let mut rise = 0.0;
        for k in 0..3 {
            let d1 = c0[k] + u * (c1[k] + u * (c2[k] + u * (c3[k] + u * c4[k])));
            let d2 = c1[k] + u * (2.0 * c2[k] + u * (3.0 * c3[k] + u * 4.0 * c4[k]));
            rise += d1 * d2;
        }
        [speed, rise / speed]
    }
}
