//! A profile: b = v² and u = dv/dt at every knot, u linear in between. And how near it is to its limits.

use std::ops::Range;

use super::grid::Grid;

/// Motion along the path at one knot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Square of the speed, mm²/s² (degrees²/s²).
    pub b: f64,
    /// Acceleration along the path, b'/2, mm/s² (degrees/s²).
    pub u: f64,
}

/// The constraint of a profile that is nearest to its limit, or farthest beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    /// Value over limit, margins of the plan included: below 1 is feasible. Infinite where b is not positive or not a
    /// number.
    pub value: f64,
    /// Span where it is.
    pub span: usize,
}

/// Middle Bézier ordinate of b over a span of a length: the coefficient of the B-spline that belongs to the span.
pub fn coefficient(from: State, length: f64) -> f64 {
    from.b + from.u * length
}

/// Worst constraint of a profile (one state per knot) over a range of spans.
pub fn worst(grid: &Grid, spans: Range<usize>, profile: &[State]) -> Worst {
    let mut worst = Worst {
        value: 0.0,
        span: spans.start,
    };
    for (index, span) in spans.enumerate() {
        let value = span_value(grid, span, profile[index], profile[index + 1]);
        if value > worst.value {
            worst = Worst { value, span };
        }
    }
    worst
}

/// Worst constraint within one span between two states; infinite instead of NaN.
pub(super) fn span_value(grid: &Grid, span: usize, from: State, to: State) -> f64 {
    let length = grid.length(span);
    let caps = grid.caps(span);
    let w = (to.u - from.u) / length;
    let ordinate = coefficient(from, length);
    let mut value = (from.b / caps.begin).max(ordinate / caps.middle).max(to.b / caps.end);
    // Keeps a NaN, which a comparison does not.
    let mut sum = w;
    for (checkpoint, &(part, _)) in grid.checkpoints(span).iter().enumerate() {
        // b is a parabola with the Bézier ordinates of both ends and the middle, u a straight line.
        let rest = 1.0 - part;
        let b = rest * rest * from.b + 2.0 * part * rest * ordinate + part * part * to.b;
        let u = rest * from.u + part * to.u;
        if !(b > 0.0 && b < f64::INFINITY && u.is_finite() && w.is_finite()) {
            return f64::INFINITY;
        }
        let v = b.sqrt();
        for row in grid.rows(span, checkpoint) {
            let acceleration = (row.a1 * u + row.a2 * b).abs();
            let jerk = ((row.j1 * w + row.j2 * u + row.j3 * b).abs() + row.kink) * v;
            sum += acceleration + jerk;
            value = if acceleration > value { acceleration } else { value };
            value = if jerk > value { jerk } else { value };
        }
    }
    if sum.is_nan() {
        return f64::INFINITY;
    }
    value
}
