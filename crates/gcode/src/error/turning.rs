//! What is wrong with a cycle along a profile.

/// Why a lathe cycle (G70 to G72.2) cannot be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TurningError {
    /// Not in G18.
    #[error("{code} turns in the ZX plane, and {plane} is active: write G18 before")]
    Plane {
        /// The code as programmed, such as `G83`.
        code: String,
        /// The plane in force.
        plane: &'static str,
    },
    /// With cutter compensation.
    #[error("{code} cuts along Z or X, not beside a contour (cutter compensation): write G40 before")]
    Compensated {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// With G93.
    #[error("{code} makes many moves, which cannot all take the time of one F (G93): write G94 before")]
    InverseTime {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// No Q.
    #[error("{code} needs Q, the number of the subroutine with the profile: G71 Q100 runs o100 sub")]
    ProfileMissing {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// Q that is no number of a subroutine.
    #[error("Q{value} is no number of a subroutine: a whole number from 0 on")]
    ProfileNumber {
        /// The number that came.
        value: f64,
    },
    /// I of 0 or less.
    #[error("I{value} is no depth of a cut: it must be above 0")]
    Increment {
        /// The number that came.
        value: f64,
    },
    /// R below 0.
    #[error("R{value} is no distance to retract: it must not be negative")]
    Retract {
        /// The number that came.
        value: f64,
    },
    /// P of G70.
    #[error("P{value} is no number of finishing passes: a whole number from 1 to {max}")]
    Passes {
        /// The number that came.
        value: f64,
        /// Greatest value allowed.
        max: u32,
    },
    /// A word of another axis with the cycle or in the profile.
    #[error("{letter} has no place here: a lathe cycle moves X and Z")]
    OtherAxis {
        /// Letter of the word.
        letter: char,
    },
    /// Something else in a profile.
    #[error("a profile has moves with G0, G1, G2 and G3 only, and O-words and parameters: put this before the cycle")]
    NoProfile,
    /// M2 and the like with the cycle.
    #[error("the lathe cycle reads its profile behind this line: put the M code on a line of its own")]
    StopOnLine,
    /// A coordinate twice.
    #[error("{first} and {second} both tell where {axis} goes: write one of them")]
    TwoWords {
        /// X or Z.
        first: char,
        /// U or W.
        second: char,
        /// X or Z.
        axis: char,
    },
    /// U or W in G91.
    #[error("{letter} is an increment already, so it has no meaning in G91: write {axis}")]
    IncrementTwice {
        /// U or W.
        letter: char,
        /// X or Z.
        axis: char,
    },
    /// A corner that is rounded (A) and cut (C).
    #[error("A rounds the corner behind a move and C cuts it: write one of them")]
    TwoCorners,
    /// A corner that does not fit.
    #[error(
        "a {what} of {size:.4} does not fit behind this move of the profile (line {line}): it reaches beyond one of the two moves, or they have no corner"
    )]
    Corner {
        /// Rounding or chamfer.
        what: &'static str,
        /// A or C, program units.
        size: f64,
        /// Line of the move.
        line: u32,
    },
    /// A profile of one move.
    #[error("the profile has {moves} moves: it needs one to its start and one at least along it")]
    TooShort {
        /// How many there are.
        moves: usize,
    },
    /// A profile without end.
    #[error("a profile has {max} moves at most")]
    TooLong {
        /// Greatest value allowed.
        max: usize,
    },
    /// A profile that turns back.
    #[error(
        "the profile turns back along {axis} with the move of line {line}, and a cut along {axis} could not follow: moves must \
         go on in one direction of {axis}, arcs no further than where they would turn back"
    )]
    NotMonotonic {
        /// The axis along which is cut.
        axis: char,
        /// Line of the move.
        line: u32,
    },
    /// D too large for the profile.
    #[error(
        "D: {allowance:.4} beside the profile there is no path that keeps this distance from all of it: it is too narrow somewhere"
    )]
    Allowance {
        /// The distance, program units.
        allowance: f64,
    },
    /// Too many cuts.
    #[error("roughing would take more than {max} cuts: a greater I makes fewer")]
    TooManyCuts {
        /// Greatest value allowed.
        max: usize,
    },
}
