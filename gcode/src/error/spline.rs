//! What is wrong with a curve.

/// Why a curve (G5 to G5.3) cannot be run. Lengths are in program units.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SplineError {
    /// Not in G17.
    #[error("curves (G5 to G5.3) lie in the XY plane, and {plane} is active: write G17 before")]
    Plane {
        /// G18, G19 or one of UVW.
        plane: &'static str,
    },
    /// With cutter compensation.
    #[error("a curve (G5 to G5.3) cannot be followed by a tool beside it (cutter compensation): write G40 before")]
    Compensated,
    /// A word of another axis.
    #[error("{letter} cannot move along a curve (G5 to G5.3), which takes X and Y only: move it on a line of its own")]
    OtherAxis {
        /// The letter.
        letter: char,
    },
    /// One of I and J.
    #[error("{code} takes both I and J, the way from the start to the first control point: {missing} is missing")]
    FirstPoint {
        /// G5 or G5.1.
        code: &'static str,
        /// The missing letter.
        missing: char,
    },
    /// One of P and Q, or none.
    #[error("G5 needs P and Q, the way from the end to the last control point: {missing} is missing")]
    LastPoint {
        /// The missing letter.
        missing: char,
    },
    /// X or Y alone.
    #[error("a control point of G5.2 needs both X and Y: {missing} is missing")]
    PointIncomplete {
        /// The missing letter.
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
        /// The limit.
        max: usize,
    },
    /// A curve that arcs cannot follow.
    #[error("the curve would take more than {max} arcs to follow: is one of its control points far off?")]
    TooManyPieces {
        /// The limit.
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
    /// G5.3 with axis words.
    #[error("G5.3 only ends the curve: write the last control point on a line before it")]
    EndWithPoint,
}
