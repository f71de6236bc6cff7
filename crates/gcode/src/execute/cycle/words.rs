//! What the words of a canned cycle leave for the lines behind.

use crate::code::Cycle;

/// What the words of the lines before said, as numbers of the program.
#[derive(Clone, Debug, Default)]
pub(crate) struct CycleWords {
    /// The cycle of which R, depth, P, Q, I, J and K still hold.
    pub(super) cycle: Option<Cycle>,
    pub(super) r: f64,
    pub(super) depth: f64,
    /// P; taps take that of any cycle before.
    pub(super) dwell_s: f64,
    pub(super) peck: f64,
    /// I, J and K of G87.
    pub(super) aside: [f64; 3],
    /// Where the normal axis stood before the first cycle of an uninterrupted run of them. LinuxCNC keeps the number when
    /// the unit, an offset or the plane changes, and so do we.
    pub(super) initial: Option<f64>,
}

impl CycleWords {
    /// Another motion code ends a run of cycles: nothing holds any longer.
    pub(crate) fn end_run(&mut self) {
        self.cycle = None;
        self.initial = None;
    }
}
