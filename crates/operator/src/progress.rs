//! What a command shows while a program runs: the journal as it comes, and below it how far the program is.
//!
//! In:  the operator. Out: the terminal.

use crate::console::{Operator, level};
use host::terminal::{StatusLine, alarm, is_heard};
use machine::journal::Entry;
use machine::state::State;
use motion::canon::Axis;
use program::Overview;
use rt::shared::Snapshot;
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
        let line = told_of(&live, self.lines, self.planned_s);
        self.line
            .show(|bar| bar.set_message(files::printed::plain(&line)), || line.clone());
    }
}

/// How far a program of so many lines and seconds is, and what it waits for. What matters most stands first: narrow terminals show
/// the beginning.
fn told_of(live: &Snapshot, lines: u32, planned_s: f64) -> String {
    let begin = format!(
        "line {:>5} of {lines}  {:6.1} / {planned_s:.1} s",
        live.line, live.elapsed_s
    );
    if let Some(waiting) = live.waiting {
        return format!("{begin}  waits: {}; {}", waiting.message(), waiting.release());
    }
    let axis = |axis: Axis| live.position[axis];
    format!(
        "{begin}  X {:8.3} Y {:8.3} Z {:8.3}  {:6.0} mm/min  late by {:.1} us at most",
        axis(Axis::X),
        axis(Axis::Y),
        axis(Axis::Z),
        live.velocity_mm_s * 60.0,
        live.late_max_ns as f64 / 1000.0,
    )
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
    use machine::journal::Kind;
    use rt::shared::RtStatus;
    use rt::waiting::Waiting;

    #[test]
    fn a_program_that_waits_says_for_what_and_what_releases_it() {
        let live = Snapshot {
            line: 6,
            elapsed_s: 2.0,
            waiting: Some(Waiting::ToolChange { tool: 1 }),
            ..RtStatus::default().snapshot()
        };
        assert_eq!(
            told_of(&live, 60, 41.0),
            "line     6 of 60     2.0 / 41.0 s  waits: put tool 1 into the spindle; isocnc tool-changed, or iocontrol.0.tool-changed"
        );
        let moves = told_of(&Snapshot { waiting: None, ..live }, 60, 41.0);
        assert!(
            moves.starts_with("line     6 of 60     2.0 / 41.0 s  X    0.000 Y"),
            "{moves}"
        );
    }

    #[test]
    fn alarms_are_told_as_such() {
        let entry = |kind, text: &str| Entry {
            seq: 1,
            time_s: 1.5,
            kind,
            ..Entry::new(text.into())
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
