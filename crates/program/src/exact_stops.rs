//! Single block: every block ends in its programmed corner, whatever path mode the program is in.
//!
//! In:  canonical calls; whether single block is on. Out: the same with path modes replaced by the exact stop (G61.1) while it
//! is, so that no smoothing makes one of several blocks and the plan rests where each of them ends.

use motion::canon::{Call, PathMode};

/// The path mode of the program, and that of the plan.
#[derive(Debug)]
pub(super) struct ExactStops {
    programmed: PathMode,
    on: bool,
}

impl ExactStops {
    /// As any plan begins.
    pub(super) const NONE: ExactStops = ExactStops {
        programmed: PathMode::ExactPath,
        on: false,
    };

    /// The call that has to come before the next one, because single block was switched.
    pub(super) fn switch(&mut self, on: bool) -> Option<Call> {
        if std::mem::replace(&mut self.on, on) == on {
            return None;
        }
        Some(Call::SetPathMode(if on {
            PathMode::ExactStop
        } else {
            self.programmed
        }))
    }

    /// Whether the planner hears of a call.
    pub(super) fn let_pass(&mut self, call: &Call) -> bool {
        match call {
            Call::SetPathMode(mode) => {
                self.programmed = *mode;
                !self.on
            }
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mode_of_the_program_comes_back_behind_single_block() {
        let round = |tolerance_mm| PathMode::Continuous {
            tolerance_mm,
            naive_cam_tolerance_mm: None,
        };
        let mut stops = ExactStops::NONE;
        assert_eq!(stops.switch(false), None);
        assert!(stops.let_pass(&Call::SetPathMode(round(None))));
        assert_eq!(stops.switch(true), Some(Call::SetPathMode(PathMode::ExactStop)));
        assert_eq!(stops.switch(true), None);
        assert!(!stops.let_pass(&Call::SetPathMode(round(Some(0.1)))));
        assert!(stops.let_pass(&Call::ProgramEnd));
        assert_eq!(stops.switch(false), Some(Call::SetPathMode(round(Some(0.1)))));
        assert!(stops.let_pass(&Call::SetPathMode(PathMode::ExactPath)));
    }
}
