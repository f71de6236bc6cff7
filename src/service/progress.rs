//! One line that says how far the program is, and journal lines as they come.
//!
//! In:  the operator. Out: the terminal, or plain lines now and then where the output is none.

use super::operator::Operator;
use crate::machine::state::State;
use crate::program::Overview;
use motion::canon::Axis;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::io::{IsTerminal, Write, stdout};
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

/// Pause between two lines on a terminal, and elsewhere.
const PAUSE: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];

/// Shows progress.
pub struct Progress {
    overview: Overview,
    quiet: bool,
    terminal: bool,
    next: Instant,
    /// A progress line stands on the terminal and must be wiped before anything else is printed.
    standing: bool,
}

impl Progress {
    /// `quiet`: shows nothing at all.
    pub fn new(overview: Overview, quiet: bool) -> Progress {
        Progress {
            overview,
            quiet,
            terminal: stdout().is_terminal(),
            next: Instant::now(),
            standing: false,
        }
    }

    /// Prints what is new.
    pub fn show(&mut self, operator: &mut Operator) {
        if self.quiet {
            return;
        }
        while is_heard()
            && let Some(entry) = operator.next_entry()
        {
            let line = format!("{:9.3} s  {}\n", entry.time_s, entry.text);
            self.wipe();
            say(&line);
        }
        let live = operator.live();
        if !matches!(live.state, State::Running | State::Held | State::Stopping)
            || Instant::now() < self.next
            || !is_heard()
        {
            return;
        }
        self.next = Instant::now() + PAUSE[usize::from(!self.terminal)];
        let axis = |axis: Axis| live.position[axis];
        let line = format!(
            "line {:>5} of {}  {:6.1} / {:.1} s  X {:8.3} Y {:8.3} Z {:8.3}  {:6.0} mm/min  SoC late {:.1} us at most",
            live.line,
            self.overview.lines,
            live.elapsed_s,
            self.overview.time_s,
            axis(Axis::X),
            axis(Axis::Y),
            axis(Axis::Z),
            live.velocity_mm_s * 60.0,
            live.late_max_ns as f64 / 1000.0,
        );
        if self.terminal {
            say(&format!("\r\x1b[2K{line}"));
            self.standing = true;
        } else {
            say(&format!("{line}\n"));
        }
    }

    fn wipe(&mut self) {
        if std::mem::take(&mut self.standing) {
            say("\r\x1b[2K");
        }
    }
}

/// Whether something printed now would be taken at once, by a reader or by nobody. A stopped terminal (Ctrl-S) and a pipe that
/// nobody empties keep whoever prints waiting; the loop that hears of a stop must not be the one.
pub fn is_heard() -> bool {
    let out = stdout();
    let mut fd = [PollFd::new(out.as_fd(), PollFlags::POLLOUT)];
    // A look and no wait; where it fails there is nothing to wait for.
    poll(&mut fd, PollTimeout::ZERO).map_or(true, |ready| ready > 0)
}

/// Prints. A reader that has gone away must not stop a machine in motion: what cannot be printed is not.
pub fn say(text: &str) {
    let mut out = stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.wipe();
    }
}
