//! Modes: what a feed counts, how corners are taken, the plane, the compensation of the cutter's radius.
//!
//! In:  the mode that a call sets, and the one that the reader of the text has.
//! Out: G94 and G95, G61 to G64, G17 to G19.1, G40 to G42.1; a feed mode or plane only where it changes.

use super::{FlatWriter, Unwritable};
use crate::code::plane_name;
use motion::canon::{Cutter, FeedMode, PathMode, Plane, Side};

impl FlatWriter {
    pub(super) fn feed_mode(&mut self, mode: FeedMode) -> Result<(), Unwritable> {
        if mode == self.feed_mode {
            return Ok(());
        }
        self.feed_mode = mode;
        self.feed = None;
        match mode {
            FeedMode::PerTime => self.plain("G94"),
            FeedMode::PerTurn { spindle } => {
                self.line.begin("G95").spindle(spindle);
                self.end_line()
            }
        }
    }

    pub(super) fn path_mode(&mut self, mode: PathMode) -> Result<(), Unwritable> {
        match mode {
            PathMode::ExactPath => self.plain("G61"),
            PathMode::ExactStop => self.plain("G61.1"),
            PathMode::Continuous {
                tolerance_mm,
                naive_cam_tolerance_mm,
            } => {
                self.line.begin("G64");
                if let Some(tolerance) = tolerance_mm {
                    self.line.word('P', tolerance);
                }
                // With P alone Q would be the same.
                if let Some(naive) = naive_cam_tolerance_mm.or(tolerance_mm.map(|_| 0.0)) {
                    self.line.word('Q', naive);
                }
                if let Some(share) = self.planner.take() {
                    self.line.word('R', share);
                }
                self.end_line()
            }
        }
    }

    pub(super) fn select_plane(&mut self, plane: Plane) -> Result<(), Unwritable> {
        if plane == self.plane {
            return Ok(());
        }
        self.plane = plane;
        self.plain(plane_name(plane))
    }

    pub(super) fn compensation(&mut self, cutter: Option<Cutter>) -> Result<(), Unwritable> {
        let Some(cutter) = cutter else {
            return self.plain("G40");
        };
        let left = (cutter.side == Side::Left) == (cutter.radius_mm >= 0.0);
        self.line.begin(if left { "G41.1" } else { "G42.1" });
        self.line.word('D', 2.0 * cutter.radius_mm.abs());
        if cutter.orientation != 0 {
            self.line.word('L', cutter.orientation);
        }
        self.end_line()
    }
}
