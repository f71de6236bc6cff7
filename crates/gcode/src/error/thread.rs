//! What is wrong with a thread or a tap in step with the spindle.

/// Why a thread (G33, G76) or a tap (G33.1) cannot be cut.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ThreadError {
    /// F with a move whose speed is the spindle's.
    #[error("{code} goes as fast as the spindle turns, so F has no use on its line")]
    WithFeed {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// A pitch of 0, or below 0 where the direction is told by something else.
    #[error("{code} needs a pitch {rule}: {letter} is the way per turn, and it is {value}")]
    Pitch {
        /// The code as programmed, such as `G83`.
        code: String,
        /// K or P.
        letter: char,
        /// What it must be.
        rule: &'static str,
        /// Number of the word as programmed.
        value: f64,
    },
    /// I of G76.
    #[error("I of G76 is the way from the start to the crest of the thread, below 0 for an external one: not 0")]
    Crest,
    /// J of G76.
    #[error("J of G76 is the depth of the first cut: above 0, and it is {value}")]
    FirstCut {
        /// Number of the word as programmed.
        value: f64,
    },
    /// K of G76.
    #[error(
        "K of G76 is the full depth of the thread: above J {first_cut}, the depth of the first cut, and it is {value}"
    )]
    Depth {
        /// Number of K.
        value: f64,
        /// Number of J.
        first_cut: f64,
    },
    /// L of G76.
    #[error("L{value} of G76 is no taper: 0 none, 1 at the entry, 2 at the exit, 3 at both")]
    Taper {
        /// Number of the word as programmed.
        value: f64,
    },
    /// Q of G76.
    #[error("Q{value} of G76 is the angle of the compound slide: between -90 and 90 degrees, usually 29, 29.5 or 30")]
    Angle {
        /// Number of the word as programmed.
        value: f64,
    },
}
