//! What is wrong with G10.

/// Why G10 cannot set a tool or a work system.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SetDataError {
    /// G10 without L.
    #[error(
        "G10 needs L to tell what is set: L1, L10 or L11 a tool, L2 or L20 a work system, L0 reads the tool table again"
    )]
    UseMissing,
    /// L of G10.
    #[error(
        "L{value} is no use of G10: L1, L10 and L11 set a tool, L2 and L20 a work system, L0 reads the tool table again"
    )]
    Use {
        /// The number that came.
        value: f64,
    },
    /// G10 L0 with a tool in the spindle.
    #[error(
        "the tool table can only be read again with an empty spindle, but tool {tool} is in it: write T0 M6 before G10 L0"
    )]
    ReloadWithTool {
        /// The tool in the spindle.
        tool: u32,
    },
    /// G10 L1, L10 or L11 without P.
    #[error("{code} needs P, the number of the tool to set")]
    ToolToSetMissing {
        /// G10 with its L.
        code: &'static str,
    },
    /// P of G10 L1, L10, L11.
    #[error("P{number} of {code} is the number of a tool: 1 or more")]
    ToolToSetRange {
        /// G10 with its L.
        code: &'static str,
        /// The number that came.
        number: f64,
    },
    /// G10 L1, L10 or L11 with nothing to set.
    #[error("{code} sets nothing on this line: write axis words, R (radius), I, J (angles) or Q (orientation)")]
    ToolValuesMissing {
        /// G10 with its L.
        code: &'static str,
    },
    /// What the tool table cannot hold.
    #[error("{0}")]
    ToolNotSet(crate::SetToolError),
    /// G10 L2 or L20 without P.
    #[error("{code} needs P, the work system: 1 for G54 to 9 for G59.3, 0 for the active one")]
    SystemMissing {
        /// G10 with its L.
        code: &'static str,
    },
    /// P of G10 L2, L20.
    #[error("P{value} of {code} is no work system: 1 is G54, 9 is G59.3, 0 the active one")]
    System {
        /// G10 with its L.
        code: &'static str,
        /// The number that came.
        value: f64,
    },
    /// R of G10 L20.
    #[error("G10 L20 has no R: a rotation is set by G10 L2")]
    RotationByPlace,
    /// I or J of G10 L2, L20.
    #[error("{code} has no {letter}: I and J are the angles of a tool, set by G10 L1")]
    AngleOfSystem {
        /// G10 with its L.
        code: &'static str,
        /// I or J.
        letter: char,
    },
}
