//! A NURBS in its plane: point and direction at any place.
//!
//! In:  control points with weights, order, knots; without knots they are LinuxCNC's, evenly spaced. The ends are there as
//!      often as the order, so that the curve begins at the first control point and ends at the last.
//! Out: points, mm.

/// A rational B-spline.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// Control points times weight, and the weight: homogeneous coordinates.
    points: Vec<[f64; 3]>,
    order: usize,
    knots: Vec<f64>,
    /// Number of the first knot of each span that is not empty.
    spans: Vec<usize>,
}

impl Curve {
    /// `points` are at least as many as `order`, which is 2 or more; weights are above 0.
    pub(super) fn new(points: &[([f64; 2], f64)], order: u32, knots: &[f64]) -> Curve {
        debug_assert!(order >= 2 && points.len() >= order as usize);
        let order = order as usize;
        let count = points.len() + 1 - order;
        let even = |index: usize| (index + 1).saturating_sub(order).min(count) as f64;
        let knots = match knots.is_empty() {
            true => (0..points.len() + order).map(even).collect(),
            false => knots.to_vec(),
        };
        let spans = (order - 1..points.len())
            .filter(|at| knots[*at] < knots[at + 1])
            .collect();
        let points = points.iter().map(|([x, y], w)| [x * w, y * w, *w]).collect();
        Curve {
            points,
            order,
            knots,
            spans,
        }
    }

    /// Number of polynomial pieces: the parameter runs from 0 to this.
    pub(super) fn spans(&self) -> usize {
        self.spans.len()
    }

    /// The point at a parameter.
    pub(super) fn point(&self, parameter: f64) -> [f64; 2] {
        self.point_and_derivative(parameter).0
    }

    /// De Boor's algorithm: the last two points of its last but one step span the tangent.
    pub(super) fn point_and_derivative(&self, parameter: f64) -> ([f64; 2], [f64; 2]) {
        let degree = self.order - 1;
        let parameter = parameter.clamp(0.0, self.spans() as f64);
        let piece = (parameter as usize).min(self.spans() - 1); // clamped to few thousands
        let first = self.spans[piece];
        let width = self.knots[first + 1] - self.knots[first];
        let parameter = self.knots[first] + (parameter - piece as f64) * width;
        let span = first - degree;
        let mut level: Vec<[f64; 3]> = self.points[span..=first].to_vec();
        let mut derivative = [0.0; 3];
        for step in 1..=degree {
            for at in (step..=degree).rev() {
                let low = self.knots[span + at];
                let high = self.knots[span + at + self.order - step];
                let share = (parameter - low) / (high - low);
                let (before, here) = (level[at - 1], level[at]);
                if step == degree {
                    let rate = width * degree as f64 / (high - low);
                    derivative = std::array::from_fn(|axis| rate * (here[axis] - before[axis]));
                }
                level[at] = std::array::from_fn(|axis| before[axis] + share * (here[axis] - before[axis]));
            }
        }
        let [x, y, w] = level[degree];
        let point = [x / w, y / w];
        // (f / w)' = (f' - (f / w) w') / w
        let rational = |axis: usize| (derivative[axis] - point[axis] * derivative[2]) / w;
        (point, [rational(0), rational(1)])
    }

    /// Unit vector along the curve at a parameter. Where the derivative vanishes (control points on each other), the way
    /// to a near place further on or, at the end, from before.
    pub(super) fn direction(&self, parameter: f64) -> Option<[f64; 2]> {
        let (point, derivative) = self.point_and_derivative(parameter);
        unit(derivative).or_else(|| {
            const PARAMETER_STEP: f64 = 1e-3;
            let end = self.spans() as f64;
            let (from, to) = if parameter + PARAMETER_STEP <= end {
                (point, self.point(parameter + PARAMETER_STEP))
            } else {
                (self.point(parameter - PARAMETER_STEP), point)
            };
            unit([to[0] - from[0], to[1] - from[1]])
        })
    }
}

/// A vector of length 1 in the same direction; `None`: there is none.
fn unit(vector: [f64; 2]) -> Option<[f64; 2]> {
    const LENGTH_MIN: f64 = 1e-9;
    let length = libm::hypot(vector[0], vector[1]);
    (length > LENGTH_MIN).then(|| [vector[0] / length, vector[1] / length])
}
