//! Modes: what a feed counts, how corners are taken, the plane, the compensation of the cutter's radius.
//!
//! In:  the mode that a call sets, and the one that the reader of the text has.
//! Out: G94 and G95, G61 to G64, G17 to G19.1, G40 to G42.1; a feed mode or plane only where it changes.

use super::{FlatWriter, Unwritable};
use crate::code::plane_name;
use motion::canon::{Cutter, FeedMode, PathMode, Plane, Side};

/// Feed as calls have set it, and as the reader of the text has it.
#[derive(Clone, Debug)]
pub(super) struct Feed {
    mode: FeedMode,
    /// F in force, if it is known.
    word: Option<f64>,
    /// Per second or turn, mm and degrees.
    linear: f64,
    angular: f64,
}

impl Feed {
    pub(super) fn at_start() -> Feed {
        Feed {
            mode: FeedMode::PerTime,
            word: None,
            linear: 0.0,
            angular: 0.0,
        }
    }

    pub(super) fn set_rate(&mut self, linear: f64, angular: f64) {
        (self.linear, self.angular) = (linear, angular);
    }

    /// The F word that a move needs, if it is not in force; `turns_only`: only rotary axes move.
    pub(super) fn changed_word(&mut self, turns_only: bool) -> Result<Option<f64>, Unwritable> {
        let rate = if turns_only { self.angular } else { self.linear };
        if rate <= 0.0 {
            return Err(Unwritable::FeedMissing);
        }
        let word = match self.mode {
            FeedMode::PerTime => per_minute(rate),
            FeedMode::PerTurn { .. } => rate,
        };
        Ok((self.word.replace(word) != Some(word)).then_some(word))
    }
}

/// The F word that is read back as `per_second`, or the nearest one.
fn per_minute(per_second: f64) -> f64 {
    let nearest = per_second * 60.0;
    [nearest, nearest.next_down(), nearest.next_up()]
        .into_iter()
        .find(|word| word / 60.0 == per_second)
        .unwrap_or(nearest)
}

impl FlatWriter {
    pub(super) fn feed_mode(&mut self, mode: FeedMode) -> Result<(), Unwritable> {
        if mode == self.feed.mode {
            return Ok(());
        }
        self.feed.mode = mode;
        self.feed.word = None;
        match mode {
            FeedMode::PerTime => self.plain("G94"),
            FeedMode::PerTurn { spindle } => {
                self.line.begin("G95").spindle(spindle);
                self.end_line()
            }
        }
    }

    pub(super) fn start_spindle_sync(
        &mut self,
        spindle: u8,
        mm_per_turn: f64,
        velocity: bool,
    ) -> Result<(), Unwritable> {
        if velocity {
            return Err(Unwritable::SpeedOnly);
        }
        self.synchronised = Some((spindle, mm_per_turn));
        Ok(())
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
