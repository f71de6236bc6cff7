//! How far a measurement is.
//!
//! In:  parts of a measurement, each with the time it takes by plan. Out: the terminal.

use host::terminal::{BAR, StatusLine};
use std::time::Duration;

/// The bar on a terminal.
/// Pause between two lines where the output is no terminal.
const PAUSE: Duration = Duration::from_secs(10);

pub(super) struct Bar {
    line: StatusLine,
    planned_s: f64,
    /// Planned time of the parts that are over.
    over_s: f64,
}

impl Bar {
    /// A measurement that takes this long by plan. `quiet`: shows nothing at all.
    pub(super) fn new(quiet: bool, planned_s: f64) -> Bar {
        Bar {
            line: StatusLine::new(BAR, PAUSE, quiet),
            planned_s,
            over_s: 0.0,
        }
    }

    /// Shows that a part is under way, of which this much planned time is over.
    pub(super) fn show(&mut self, part: &str, part_s: f64) {
        if !self.line.is_due() {
            return;
        }
        let milliseconds = |time_s: f64| (time_s * 1000.0) as u64;
        let (over_s, planned_s) = (self.over_s + part_s, self.planned_s);
        self.line.show(
            |bar| {
                bar.set_length(milliseconds(planned_s));
                bar.set_position(milliseconds(over_s));
                bar.set_message(files::printed::plain(part));
            },
            || {
                format!(
                    "{:3.0} %  {part}",
                    100.0 * (over_s / planned_s.max(1e-3)).clamp(0.0, 1.0)
                )
            },
        );
    }

    /// A part is over that took this long by plan.
    pub(super) fn part_over(&mut self, part_s: f64) {
        self.over_s += part_s;
    }

    /// Prints a line that stays.
    pub(super) fn say(&mut self, text: &str) {
        self.line.say(&format!("{text}\n"));
    }
}
