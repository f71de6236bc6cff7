//! Why a program cannot go on, at its place in the text.

use motion::plan::PlanErrorKind;

/// Why the program cannot go on.
#[derive(Debug)]
pub enum FeedError {
    Text(Box<gcode::Error>),
    /// The plan: a limit of the machine, and the same as an error of the text.
    Plan(PlanErrorKind, Box<gcode::Error>),
}

impl FeedError {
    /// Whether it may come from where things are.
    pub(super) fn is_of_a_place(&self) -> bool {
        match self {
            // What holds wherever things are is found in the text before.
            FeedError::Text(_) => true,
            FeedError::Plan(kind, _) => matches!(
                kind,
                PlanErrorKind::Travel { .. }
                    | PlanErrorKind::JointTravel { .. }
                    | PlanErrorKind::Unreachable { .. }
                    | PlanErrorKind::BadArc
            ),
        }
    }

    /// The place in the text, and what is wrong there.
    pub fn of_text(&self) -> &gcode::Error {
        match self {
            FeedError::Text(error) | FeedError::Plan(_, error) => error,
        }
    }

    /// `file:line:column: what`.
    pub fn located(&self, path: &str) -> String {
        format!("{path}:{}", self.of_text())
    }

    /// The same with the line of the program, and a mark under what is wrong.
    pub fn render(&self, path: &str) -> String {
        self.of_text().render(path)
    }
}
