//! Rational Bézier curves in a plane: what a NURBS is between two of its knots.
//!
//! In:  control points with weights, order and knots of a NURBS. The first and the last knot are there as often as the order,
//!      so that the curve begins at the first control point and ends at the last.
//! Out: its spans, their halves, places and derivatives at their ends, and what their control points tell about all between:
//!      a curve with weights above 0 lies in the convex hull of its control points.

/// A place and the first two derivatives by a curve parameter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    pub(super) q: [f64; 2],
    pub(super) first: [f64; 2],
    pub(super) second: [f64; 2],
}

/// A rational Bézier curve over a parameter from 0 to 1.
#[derive(Clone, Debug)]
pub(super) struct Bezier {
    /// Control points times weight, and the weight: homogeneous coordinates. Two or more.
    points: Vec<[f64; 3]>,
}

/// The knots of a NURBS of `points` control points, as many as `order` or more; none given: LinuxCNC's, evenly spaced.
/// `None`: they are none.
pub(super) fn knots(points: usize, order: usize, given: &[f64]) -> Option<Vec<f64>> {
    if given.is_empty() {
        let count = points + 1 - order;
        let even = |index: usize| (index + 1).saturating_sub(order).min(count) as f64;
        return Some((0..points + order).map(even).collect());
    }
    let [first, .., last] = given else { return None };
    let is_clamped = given.len() == points + order
        && given[order - 1] == *first
        && given[points] == *last
        && given.is_sorted()
        && given.iter().all(|knot| knot.is_finite());
    // A knot within as often as the order would tear the curve.
    let is_whole = || (0..points).all(|at| given[at] < given[at + order]);
    (is_clamped && is_whole()).then(|| given.to_vec())
}

/// The spans of a NURBS of `order` 2 or more between its knots; `points` are at least as many as `order`. Each comes with the
/// number of derivatives that go on from the one before.
///
/// The control points of a span are values of its blossom: de Boor's algorithm with a parameter of its own in each step, the
/// end of the span in some of them and its beginning in the others.
pub(super) fn spans(points: &[([f64; 2], f64)], order: usize, knots: &[f64]) -> impl Iterator<Item = (usize, Bezier)> {
    debug_assert!(order >= 2 && points.len() >= order && knots.len() == points.len() + order);
    let degree = order - 1;
    let count = points.len() - degree;
    let is_some = move |span: &usize| knots[span + degree] < knots[span + order];
    (0..count).filter(is_some).map(move |span| {
        let (begin, end) = (knots[span + degree], knots[span + order]);
        let times = knots[..=span + degree]
            .iter()
            .rev()
            .take_while(|knot| **knot == begin)
            .count();
        let own: Vec<[f64; 3]> = points[span..=span + degree]
            .iter()
            .map(|([x, y], w)| [x * w, y * w, *w])
            .collect();
        let blossom = |ends: usize| {
            let mut level = own.clone();
            for step in 1..=degree {
                let parameter = if step <= ends { end } else { begin };
                for at in (step..=degree).rev() {
                    let (low, high) = (knots[span + at], knots[span + at + order - step]);
                    level[at] = between(&level[at - 1], &level[at], (parameter - low) / (high - low));
                }
            }
            level[degree]
        };
        let points = (0..=degree).map(blossom).collect();
        (degree.saturating_sub(times), Bezier { points })
    })
}

impl Bezier {
    /// Both halves, by de Casteljau's algorithm.
    pub(super) fn halves(&self) -> [Bezier; 2] {
        let mut level = self.points.clone();
        let (mut first, mut second) = (Vec::with_capacity(level.len()), Vec::with_capacity(level.len()));
        while let (Some(begin), Some(end)) = (level.first(), level.last()) {
            first.push(*begin);
            second.push(*end);
            level = level.windows(2).map(|pair| between(&pair[0], &pair[1], 0.5)).collect();
        }
        second.reverse();
        [first, second].map(|points| Bezier { points })
    }

    pub(super) fn start(&self) -> Contact {
        let at = |k: usize| self.points[k.min(self.points.len() - 1)];
        self.contact([at(0), at(1), at(2)])
    }

    pub(super) fn end(&self) -> Contact {
        let last = self.points.len() - 1;
        let at = |k: usize| self.points[last.saturating_sub(k)];
        let back = self.contact([at(0), at(1), at(2)]);
        Contact {
            first: back.first.map(|x| -x),
            ..back
        }
    }

    /// Place and derivatives where the first three of the control points lie, the second by the quotient rule:
    /// `(f / w)' = (f' - q w') / w` and `(f / w)'' = (f'' - 2 q' w' - q w'') / w`.
    fn contact(&self, [a, b, c]: [[f64; 3]; 3]) -> Contact {
        let degree = (self.points.len() - 1) as f64;
        let w = a[2];
        let q = [a[0] / w, a[1] / w];
        // Differences of places, not of homogeneous coordinates: these lose the digits that far places take.
        let off = |p: &[f64; 3], axis: usize| p[axis] - q[axis] * p[2];
        let w1 = degree * (b[2] - w);
        let first = [0, 1].map(|axis| degree * off(&b, axis) / w);
        let twice = degree * (degree - 1.0);
        let second = [0, 1].map(|axis| (twice * (off(&c, axis) - 2.0 * off(&b, axis)) - 2.0 * first[axis] * w1) / w);
        Contact { q, first, second }
    }

    /// Control points in the plane.
    fn places(&self) -> impl Iterator<Item = [f64; 2]> {
        self.points.iter().map(|p| [p[0] / p[2], p[1] / p[2]])
    }

    /// Diagonal of the rectangle around all control points.
    pub(super) fn extent(&self) -> f64 {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in self.places() {
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        libm::hypot(high[0] - low[0], high[1] - low[1])
    }

    /// Whether the curve runs straight from its start to its end, however unevenly.
    pub(super) fn is_straight(&self) -> bool {
        /// What rounding does to places in line.
        const OFF_MM: f64 = 1e-11;
        let (start, end) = (self.start().q, self.end().q);
        let chord = minus(&end, &start);
        let length = libm::hypot(chord[0], chord[1]);
        let mut before = 0.0;
        length > 0.0
            && self.places().all(|place| {
                let arm = minus(&place, &start);
                let along = (arm[0] * chord[0] + arm[1] * chord[1]) / length;
                let across = (arm[0] * chord[1] - arm[1] * chord[0]) / length;
                let on = across.abs() <= OFF_MM && along >= before - OFF_MM && along <= length + OFF_MM;
                before = along;
                on
            })
    }

    /// How far the quintic with these control points may be from the curve at the same parameter: never less than it is.
    ///
    /// With f / w the curve and p the quintic, f - p w is a polynomial; none of its values is greater than its greatest
    /// Bézier coefficient, of which each is a mean of `w_i (q_i - p_j)`.
    pub(super) fn off(&self, quintic: &[[f64; 2]; 6]) -> f64 {
        const FIFTH: [f64; 6] = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
        let degree = self.points.len() - 1;
        let mut sums = vec![[0.0; 3]; degree + 6];
        let (mut binomial, mut least) = (1.0, f64::INFINITY);
        for (i, point) in self.points.iter().enumerate() {
            for (j, (place, five)) in quintic.iter().zip(FIFTH).enumerate() {
                let share = binomial * five;
                let sum = &mut sums[i + j];
                for axis in 0..2 {
                    sum[axis] += share * (point[axis] - place[axis] * point[2]);
                }
                sum[2] += share;
            }
            least = least.min(point[2]);
            binomial *= (degree - i) as f64 / (i + 1) as f64;
        }
        let size = |sum: &[f64; 3]| libm::hypot(sum[0], sum[1]) / sum[2];
        sums.iter().map(size).fold(0.0, f64::max) / least
    }
}

fn between(a: &[f64; 3], b: &[f64; 3], share: f64) -> [f64; 3] {
    std::array::from_fn(|k| (1.0 - share) * a[k] + share * b[k])
}

pub(super) fn minus(a: &[f64; 2], b: &[f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}
