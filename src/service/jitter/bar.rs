//! How far a measurement is: a bar on a terminal, plain lines now and then elsewhere.
//!
//! In:  parts of a measurement, each with the time it takes by plan. Out: the terminal.

use crate::service::progress::{is_heard, say};
use std::io::{IsTerminal, stdout};
use std::time::{Duration, Instant};

/// Pause between two lines on a terminal, and elsewhere.
const PAUSE: [Duration; 2] = [Duration::from_millis(200), Duration::from_secs(10)];
/// Signs of the bar.
const WIDTH: usize = 24;

/// The bar.
pub(super) struct Bar {
    quiet: bool,
    terminal: bool,
    began: Instant,
    next: Instant,
    planned_s: f64,
    /// Planned time of the parts that are over.
    over_s: f64,
    /// A line stands on the terminal and must be wiped before anything else is printed.
    standing: bool,
}

impl Bar {
    /// A measurement that takes this long by plan. `quiet`: shows nothing at all.
    pub(super) fn new(quiet: bool, planned_s: f64) -> Bar {
        let now = Instant::now();
        Bar {
            quiet,
            terminal: stdout().is_terminal(),
            began: now,
            next: now,
            planned_s,
            over_s: 0.0,
            standing: false,
        }
    }

    /// Shows that a part is under way, of which this much planned time is over.
    pub(super) fn show(&mut self, part: &str, part_s: f64) {
        if self.quiet || Instant::now() < self.next || !is_heard() {
            return;
        }
        self.next = Instant::now() + PAUSE[usize::from(!self.terminal)];
        let line = line(
            part,
            self.over_s + part_s,
            self.planned_s,
            self.began.elapsed().as_secs_f64(),
        );
        if self.terminal {
            say(&format!("\r\x1b[2K{line}"));
            self.standing = true;
        } else {
            say(&format!("{line}\n"));
        }
    }

    /// A part is over that took this long by plan.
    pub(super) fn part_over(&mut self, part_s: f64) {
        self.over_s += part_s;
    }

    /// Prints a line that stays.
    pub(super) fn say(&mut self, text: &str) {
        if !self.quiet {
            self.wipe();
            say(&format!("{text}\n"));
        }
    }

    fn wipe(&mut self) {
        if std::mem::take(&mut self.standing) {
            say("\r\x1b[2K");
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.wipe();
    }
}

/// The time left is what the plan says, times what the parts up to now took more than planned.
fn line(part: &str, over_s: f64, planned_s: f64, elapsed_s: f64) -> String {
    let share = if planned_s > 0.0 {
        (over_s / planned_s).clamp(0.0, 1.0)
    } else {
        1.0
    };
    let slower = if over_s > 1.0 {
        (elapsed_s / over_s).max(1.0)
    } else {
        1.0
    };
    let left_s = ((planned_s - over_s) * slower).max(0.0).round() as u64;
    let full = (share * WIDTH as f64) as usize;
    let time = match (left_s / 3600, left_s / 60 % 60, left_s % 60) {
        (0, minutes, seconds) => format!("{minutes}:{seconds:02}"),
        (hours, minutes, seconds) => format!("{hours}:{minutes:02}:{seconds:02}"),
    };
    format!(
        "[{}{}] {:3.0} %  {time} left  {part}",
        "#".repeat(full),
        ".".repeat(WIDTH - full),
        share * 100.0
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_by_hand() {
        assert_eq!(
            line("begins", 0.0, 60.0, 3.0),
            "[........................]   0 %  1:00 left  begins"
        );
        assert_eq!(
            line("x", 30.0, 60.0, 45.0),
            "[############............]  50 %  0:45 left  x"
        );
        assert_eq!(
            line("x", 70.0, 60.0, 71.0),
            "[########################] 100 %  0:00 left  x"
        );
        assert_eq!(
            line("x", 100.0, 20_000.0, 100.0),
            "[........................]   0 %  5:31:40 left  x"
        );
        assert_eq!(
            line("x", 0.0, 0.0, 0.0),
            "[########################] 100 %  0:00 left  x"
        );
    }
}
