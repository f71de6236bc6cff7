//! What is wrong with a curve.

/// Why a curve (G5 to G6.3) cannot be run. Lengths are in program units.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SplineError {
    /// G5 and G5.1 not in G17, or a curve in the planes of U, V and W.
    #[error("this curve cannot lie in the plane {plane}: G5 and G5.1 take G17, NURBS (G5.2, G6.2) G17, G18 and G19")]
    Plane {
        /// G18, G19 or one of UVW.
        plane: &'static str,
    },
    /// With cutter compensation.
    #[error("a curve (G5 to G5.3) cannot be followed by a tool beside it (cutter compensation): write G40 before")]
    Compensated,
    /// Another plane in the middle of a NURBS.
    #[error("the plane has changed since this curve was begun: its control points lie in one plane")]
    PlaneChange,
    /// A word of another axis.
    #[error("{letter} cannot move along a curve, which takes {first} and {second} only: move it on a line of its own")]
    OtherAxis {
        /// Letter of the word.
        letter: char,
        /// First axis of the plane.
        first: char,
        /// Second axis of the plane.
        second: char,
    },
    /// One of I and J.
    #[error("{code} takes both I and J, the way from the start to the first control point: {missing} is missing")]
    FirstPoint {
        /// G5 or G5.1.
        code: &'static str,
        /// Letter of the word that is missing.
        missing: char,
    },
    /// One of P and Q, or none.
    #[error("G5 needs P and Q, the way from the end to the last control point: {missing} is missing")]
    LastPoint {
        /// Letter of the word that is missing.
        missing: char,
    },
    /// One axis of the plane alone.
    #[error("a control point of {code} needs both axes of the plane: {missing} is missing")]
    PointIncomplete {
        /// G5.2 or G6.2.
        code: &'static str,
        /// Letter of the word that is missing.
        missing: char,
    },
    /// P alone, behind the first line.
    #[error(
        "P alone is the weight of the start, on the line that begins with G5.2; further control points need X and Y"
    )]
    StartWeightLate,
    /// No P on a further point.
    #[error("a control point of G5.2 needs P, its weight: P1 makes it as strong as the others")]
    WeightMissing,
    /// P that pulls away.
    #[error("P{value} is no weight of a control point: it must be above 0")]
    Weight {
        /// The number that came.
        value: f64,
    },
    /// L that is no order.
    #[error("L{value} is no order of a curve: it must be a whole number, from 3 on to be of effect")]
    Order {
        /// The number that came.
        value: f64,
    },
    /// G5.3 too early.
    #[error("a curve of order {order} (L) needs {order} control points at least, with the start: there are {points}")]
    TooFewPoints {
        /// L, or 3.
        order: u32,
        /// Points so far.
        points: usize,
    },
    /// A curve without end.
    #[error("a curve has {max} control points at most: close it with G5.3 and begin another one at its end")]
    TooManyPoints {
        /// Greatest value allowed.
        max: usize,
    },
    /// A curve that arcs cannot follow.
    #[error("the curve would take more than {max} arcs to follow: is one of its control points far off?")]
    TooManyPieces {
        /// Greatest value allowed.
        max: usize,
    },
    /// G5.3 alone.
    #[error("G5.3 ends a curve that G5.2 began, and none is begun")]
    NotOpen,
    /// Something else before G5.3.
    #[error("the curve begun with G5.2 has {points} control points and no end: write G5.3 before this")]
    NotClosed {
        /// Points so far.
        points: usize,
    },
    /// No P on the first line of G6.2.
    #[error("the first line of G6.2 needs P, the order of the curve (4: cubic)")]
    KnotOrderMissing,
    /// P that is no order.
    #[error("P{value} is no order of a curve: a whole number, 2 or more (4: cubic)")]
    KnotOrder {
        /// The number that came.
        value: f64,
    },
    /// Q that is none of LinuxCNC's.
    #[error("Q{value} of G6.2 is 1, 2 or 3; the curve is the same with all of them")]
    KnotWay {
        /// The number that came.
        value: f64,
    },
    /// R that pulls away.
    #[error("R{value} is no weight of a control point: it must be above 0")]
    KnotWeight {
        /// The number that came.
        value: f64,
    },
    /// A knot (G6.2) without K, its value.
    #[error("G6.2 needs K, a knot, on each line")]
    KnotMissing,
    /// K below the one before.
    #[error("K{value} is below the knot before, K{before}: knots never fall")]
    KnotFalls {
        /// The number that came.
        value: f64,
        /// Value of the knot before it.
        before: f64,
    },
    /// A control point behind a line with K alone.
    #[error("a control point behind a knot alone: the lines of G6.2 that have K only stand at the end of the curve")]
    PointBehindKnots,
    /// Knots and points that do not fit.
    #[error(
        "the last knot has come {order} times, and there are {points} control points and {knots} knots: there must be {order} points \
         or more, and behind them {order} lines with K alone"
    )]
    KnotCount {
        /// Number of control points.
        points: usize,
        /// Number of knots.
        knots: usize,
        /// Number of the P word.
        order: u32,
    },
    /// Knots with which the curve does not begin at its first point, or is torn.
    #[error("the first knot must come {order} times, as the last one does, and no other one so often")]
    KnotEnds {
        /// Number of the P word.
        order: u32,
    },
    /// Something else before the last knot.
    #[error(
        "the curve begun with G6.2 has {points} control points and no end: write lines with K alone before this, until the last knot \
         has come {order} times"
    )]
    KnotsMissing {
        /// Points so far.
        points: usize,
        /// Number of the P word.
        order: u32,
    },
    /// G5.3 with axis words.
    #[error("G5.3 and G6.3 only end the curve: write the last control point on a line before it")]
    EndWithPoint,
}
