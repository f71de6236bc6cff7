//! What a command shows while a program runs: the journal as it comes, and below it how far the program is.
//!
//! In:  the operator. Out: the terminal.

use crate::host::terminal::{StatusLine, alarm, is_heard};
use crate::machine::journal::Entry;
use crate::machine::state::State;
use crate::operator::console::{Operator, level};
use crate::program::Overview;
use motion::canon::Axis;
use std::time::Duration;
use tracing::Level;

/// Pause between two lines where the output is no terminal.
const PAUSE: Duration = Duration::from_secs(5);

/// Shows how far a program is, and the journal as it comes.
pub struct Progress {
    lines: u32,
    planned_s: f64,
    line: StatusLine,
}

impl Progress {
    /// `quiet`: shows nothing at all.
    pub fn new(overview: &Overview, quiet: bool) -> Progress {
        Progress {
            lines: overview.lines,
            planned_s: overview.time_s,
            line: StatusLine::new("{wide_msg}", PAUSE, quiet),
        }
    }

    /// Prints what is new.
    pub fn show(&mut self, operator: &mut Operator) {
        while !self.line.is_quiet()
            && is_heard()
            && let Some(entry) = operator.next_entry()
        {
            self.line.say(&told(entry));
        }
        let live = operator.live();
        if !matches!(live.state, State::Running | State::Held | State::Stopping) || !self.line.is_due() {
            return;
        }
        let axis = |axis: Axis| live.position[axis];
        // What matters most first: narrow terminals show the beginning.
        let line = format!(
            "line {:>5} of {}  {:6.1} / {:.1} s  X {:8.3} Y {:8.3} Z {:8.3}  {:6.0} mm/min  SoC late {:.1} us at most",
            live.line,
            self.lines,
            live.elapsed_s,
            self.planned_s,
            axis(Axis::X),
            axis(Axis::Y),
            axis(Axis::Z),
            live.velocity_mm_s * 60.0,
            live.late_max_ns as f64 / 1000.0,
        );
        self.line.show(|bar| bar.set_message(line.clone()), || line.clone());
    }
}

/// An entry of the journal as a line; alarms are red on a terminal.
pub fn told(entry: &Entry) -> String {
    let line = format!("{:9.3} s  {}", entry.time_s, entry.text);
    match level(entry) {
        Level::ERROR => format!("{}\n", alarm(line)),
        _ => format!("{line}\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::journal::Kind;

    #[test]
    fn alarms_are_told_as_such() {
        let entry = |kind, text: &str| Entry {
            seq: 1,
            unix_s: 0.0,
            time_s: 1.5,
            kind,
            text: text.into(),
            alarm: None,
            program: None,
            acknowledges: None,
        };
        assert_eq!(
            told(&entry(Kind::Note, "machine ready")),
            "    1.500 s  machine ready\n"
        );
        // Colours are for terminals; a test has none, or one.
        let alarm = console::strip_ansi_codes(&told(&entry(Kind::Alarm, "alarm: x-drive lost"))).into_owned();
        assert_eq!(alarm, "    1.500 s  alarm: x-drive lost\n");
    }
}
