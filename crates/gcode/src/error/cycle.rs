//! What is wrong with a canned cycle, and with the spindle that it or a thread needs.

/// Why a canned cycle (G73, G74, G81 to G89) cannot be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CycleError {
    /// A canned cycle that does not know where to begin.
    #[error("{cycle} needs R, the level at which feeding begins: no {cycle} is active whose R would still hold")]
    RMissing {
        /// The code as programmed, such as `G83`.
        cycle: String,
    },
    /// A canned cycle that does not know how deep to go.
    #[error("{cycle} needs {axis}, the depth of the hole: no {cycle} is active whose {axis} would still hold")]
    DepthMissing {
        /// The code as programmed, such as `G83`.
        cycle: String,
        /// Axis of the hole.
        axis: char,
    },
    /// A canned cycle that would cut upwards.
    #[error("R {r:.4} is below the depth {axis} {depth:.4}: the hole goes from R down")]
    RBelowDepth {
        /// Where feeding would begin, program units.
        r: f64,
        /// Axis of the hole.
        axis: char,
        /// Its end, program units.
        depth: f64,
    },
    /// A word that a canned cycle or a thread needs.
    #[error("{code} needs {letter}, {meaning}")]
    WordMissing {
        /// The code as programmed, such as `G83`.
        code: String,
        /// Letter of the word.
        letter: char,
        /// What it tells.
        meaning: &'static str,
    },
    /// Q of G73 and G83.
    #[error("{cycle} needs Q above 0, the depth of one peck: it is {value}")]
    Peck {
        /// The code as programmed, such as `G83`.
        cycle: String,
        /// Number of the word as programmed.
        value: f64,
    },
    /// L0: no hole at all.
    #[error("L0 asks {cycle} for no hole at all: L is how many holes in a row, 1 or more")]
    Repeats {
        /// The code as programmed, such as `G83`.
        cycle: String,
    },
    /// Words that would make endless lists of moves.
    #[error("{code} would go into the work {count:.0} times on this line: at most {max} are allowed{}", cycle_hint(.code))]
    TooLong {
        /// The code as programmed, such as `G83`.
        code: String,
        /// How often.
        count: f64,
        /// Greatest value allowed.
        max: u32,
    },
    /// A rotary axis in a canned cycle or G76.
    #[error("{letter} cannot turn during {code}: move it on a line before")]
    Rotary {
        /// Letter of the axis.
        letter: char,
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// An axis that the plane does not know.
    #[error("{letter} cannot move during {code} in the plane {plane}: its axes are {axes}")]
    AxisOfOtherPlane {
        /// Letter of the axis.
        letter: char,
        /// The code as programmed, such as `G83`.
        code: String,
        /// Its axes and its code: `XY (G17)`.
        plane: String,
        /// First, second and normal axis.
        axes: String,
    },
    /// `@` or `^` with a cycle outside XY.
    #[error("polar coordinates (@, ^) tell X and Y, so {code} takes them in the plane XY (G17) only")]
    Polar {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// A cycle in G93.
    #[error("{cycle} is many moves, for which one time (G93) cannot do: write G94 and F")]
    InverseTime {
        /// The code as programmed, such as `G83`.
        cycle: String,
    },
    /// A cycle or thread with cutter compensation.
    #[error("{code} cannot be run while cutter compensation is on: write G40 first")]
    Compensated {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// A code that needs a turning spindle.
    #[error("{code} needs spindle {spindle} to turn: write {start} and S first")]
    SpindleAtRest {
        /// The code as programmed, such as `G83`.
        code: String,
        /// Number of the spindle.
        spindle: u8,
        /// M code that starts it.
        start: &'static str,
    },
    /// G74 and G84 with the spindle turning the other way.
    #[error("{code} needs a spindle that turns {needed}, and it turns the other way: {other} taps so")]
    SpindleDirection {
        /// The code as programmed, such as `G83`.
        code: String,
        /// Direction and its M code.
        needed: &'static str,
        /// Code for the other direction.
        other: String,
    },
    /// `$` with a code that goes with one spindle.
    #[error("${number} is no spindle that {code} can go with: one of 0 to {last}")]
    OneSpindle {
        /// The number that came.
        number: f64,
        /// The code as programmed, such as `G83`.
        code: String,
        /// Greatest value allowed.
        last: u8,
    },
}

fn cycle_hint(code: &str) -> &'static str {
    match code {
        "G73" | "G83" => ": are Q and L right?",
        "G76" => ": are J, R and H right?",
        _ => ": is L right?",
    }
}
