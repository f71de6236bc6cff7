//! What is wrong with an arc.

/// Why an arc (G2, G3) cannot be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArcError {
    /// `@` or `^` of an arc in another plane.
    #[error("polar coordinates (@, ^) of an arc lie in the XY plane, and {plane} is active: write the axes")]
    PolarPlane {
        /// G18 or G19.
        plane: &'static str,
    },
    /// An arc in a plane of UVW.
    #[error("there are no arcs in the plane {plane}: arcs move X, Y and Z (G17, G18, G19)")]
    Plane {
        /// G17.1, G18.1 or G19.1.
        plane: &'static str,
    },
    /// Arc without centre and radius.
    #[error("{motion} needs {offsets} or R: neither centre nor radius is given")]
    CentreMissing {
        /// G2 or G3.
        motion: String,
        /// Centre letters of the plane.
        offsets: &'static str,
    },
    /// A centre letter of another plane.
    #[error("{letter} is no centre offset of the plane {plane}: it takes {offsets}")]
    OffsetOfOtherPlane {
        /// Letter of the word.
        letter: char,
        /// G17, G18 or G19.
        plane: &'static str,
        /// Centre letters of the plane.
        offsets: &'static str,
    },
    /// Centre and radius.
    #[error("an arc takes {letter} or R, not both")]
    Mixed {
        /// The centre letter.
        letter: char,
    },
    /// One absolute centre coordinate only.
    #[error("absolute arc centres (G90.1) need both coordinates: {missing} is missing")]
    AbsoluteCentreIncomplete {
        /// Letter of the word that is missing.
        missing: char,
    },
    /// R form without end point.
    #[error("an arc by R needs its end point: {axes} are missing")]
    EndMissing {
        /// Axes of the plane.
        axes: &'static str,
    },
    /// R form that ends where it starts.
    #[error("an arc by R cannot end where it starts: write a full circle with {offsets}")]
    EndIsStart {
        /// Centre letters of the plane.
        offsets: &'static str,
    },
    /// R form that does not reach.
    #[error("radius {radius:.4} is too small: half the distance to the end point is {half_chord:.4}")]
    RadiusTooSmall {
        /// Programmed radius, program units.
        radius: f64,
        /// Half the distance from start to end, program units.
        half_chord: f64,
    },
    /// Centre on the start or the end.
    #[error("the centre of the arc lies on its start or end: the radius is 0")]
    RadiusZero,
    /// Centre form that does not fit.
    #[error(
        "radius at start {start:.4}, at end {end:.4}: difference {difference:.4} > {tolerance:.4} tolerance (centre {}, end {}, \
         in the units of the program); is the unit right (G20, G21), and are the centre's words offsets from the start (G91.1) or \
         a place (G90.1)?",
        pair(*.centre), pair(*.end_at),
        difference = (.start - .end).abs()
    )]
    RadiiDiffer {
        /// Radius at the start, program units.
        start: f64,
        /// Radius at the end, program units.
        end: f64,
        /// Greatest difference allowed, program units.
        tolerance: f64,
        /// Where the centre lies, on the axes of the plane, program units.
        centre: [f64; 2],
        /// Where the end lies, on the axes of the plane, program units.
        end_at: [f64; 2],
    },
    /// P of an arc.
    #[error("P{value} of an arc is its number of turns: an integer from 1 to {max}")]
    Turns {
        /// Number of P.
        value: f64,
        /// Greatest value allowed.
        max: i32,
    },
}

fn pair([first, second]: [f64; 2]) -> String {
    format!("{first:.4} {second:.4}")
}
