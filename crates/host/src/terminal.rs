//! The terminal of a command: lines that stay, and below them one status line that is redrawn in place.
//!
//! In:  texts. Out: the terminal, or plain lines now and then where the output is none.
//!
//! The status line is cut off at the right where the terminal ends: wrapped, it could not be wiped again.

use comfy_table::{CellAlignment, Table, presets};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use ratatui::crossterm::event::{self, Event};
use std::io::{self, Write, stdin, stdout};
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

/// Template of a status line with a bar, in per cent, and a text.
pub const BAR: &str = "[{bar:12}] {percent:>3} %  {eta:>4} left  {wide_msg}";
/// Pause between two redraws of the line on a terminal.
const REDRAW: Duration = Duration::from_millis(100);

/// A status line that is redrawn in place.
pub struct StatusLine {
    bar: ProgressBar,
    pause: Duration,
    next: Instant,
    quiet: bool,
}

impl StatusLine {
    /// `template` of the crate indicatif; `pause`: between two lines where the output is no terminal; `quiet`: shows nothing at
    /// all.
    pub fn new(template: &str, pause: Duration, quiet: bool) -> StatusLine {
        StatusLine::on(ProgressDrawTarget::stdout(), template, pause, quiet)
    }

    /// A line on standard error that counts, for a command whose output may go elsewhere; nothing where that is no terminal.
    pub fn beside_output(template: &str, quiet: bool) -> StatusLine {
        StatusLine::on(ProgressDrawTarget::stderr(), template, REDRAW, quiet)
    }

    /// Shows a number, where this is a terminal.
    pub fn set_position(&self, position: u64) {
        if !self.quiet {
            self.bar.set_position(position);
        }
    }

    fn on(target: ProgressDrawTarget, template: &str, pause: Duration, quiet: bool) -> StatusLine {
        let bar = ProgressBar::with_draw_target(None, target);
        // A template of ours is a good one: a test draws each.
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("#.."));
        }
        StatusLine {
            pause: if bar.is_hidden() { pause } else { REDRAW },
            bar,
            next: Instant::now(),
            quiet,
        }
    }

    /// Whether another line is due, and would be taken at once.
    pub fn is_due(&self) -> bool {
        !self.quiet && Instant::now() >= self.next && is_heard()
    }

    /// Shows a line now: on a terminal `draw` sets it, elsewhere `line` is printed.
    pub fn show(&mut self, draw: impl FnOnce(&ProgressBar), line: impl FnOnce() -> String) {
        self.next = Instant::now() + self.pause;
        if self.bar.is_hidden() {
            say(&format!("{}\n", line()));
        } else {
            draw(&self.bar);
        }
    }

    /// Whether nothing at all is shown.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Prints text that stays, above the line.
    pub fn say(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| say(text));
        }
    }
}

impl Drop for StatusLine {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Rows below a heading, in columns two blanks apart; a heading that begins with `>` stands, as all below it, at the right. Ends
/// with the end of its last line.
pub fn table(heading: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(heading.iter().map(|name| name.trim_start_matches('>')));
    table.add_rows(rows);
    for (column, name) in table.column_iter_mut().zip(heading) {
        column.set_padding((0, 2));
        if name.starts_with('>') {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    format!("{}\n", table.trim_fmt())
}

/// A text that must not be overlooked: red where standard output is a terminal and `NO_COLOR` is not set.
pub fn alarm(text: impl std::fmt::Display) -> impl std::fmt::Display {
    console::style(text).red().bold()
}

/// Whether something printed now would be taken at once, by a reader or by nobody. A stopped terminal (Ctrl-S) and a pipe that
/// nobody empties keep whoever prints waiting; the loop that hears of a stop must not be the one.
pub fn is_heard() -> bool {
    takes_more(stdout())
}

/// The same of an output.
pub fn takes_more(out: impl AsFd) -> bool {
    let mut fd = [PollFd::new(out.as_fd(), PollFlags::POLLOUT)];
    // A look and no wait; where it fails there is nothing to wait for.
    poll(&mut fd, PollTimeout::ZERO).map_or(true, |ready| ready > 0)
}

/// What was pressed, or that the window has another size; waited for as long as `wait` (at most 65 s). Waits in crossterm never
/// end, and take all of a core, where the terminal is closed meanwhile.
///
/// # Errors
/// The terminal was closed, or cannot be read.
pub fn event_within(wait: Duration) -> io::Result<Option<Event>> {
    let keys = stdin();
    let mut keys = [PollFd::new(keys.as_fd(), PollFlags::POLLIN)];
    let wait = u16::try_from(wait.as_millis()).unwrap_or(u16::MAX);
    match poll(&mut keys, PollTimeout::from(wait)) {
        // A signal: a window of another size, or a wish to stop.
        Ok(_) | Err(Errno::EINTR) => {}
        Err(error) => return Err(error.into()),
    }
    let gone = PollFlags::POLLHUP | PollFlags::POLLERR | PollFlags::POLLNVAL;
    if keys[0].revents().is_some_and(|now| now.intersects(gone)) {
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the terminal was closed"));
    }
    Ok(if event::poll(Duration::ZERO)? {
        Some(event::read()?)
    } else {
        None
    })
}

/// Prints. A reader that has gone away must not stop a machine in motion: what cannot be printed is not.
pub fn say(text: &str) {
    let mut out = files::printed::stdout();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

#[cfg(test)]
mod tests {
    use super::*;
    use indicatif::InMemoryTerm;

    #[test]
    fn a_line_never_takes_more_than_one_row_and_is_cut_off_at_the_right() {
        for template in ["{wide_msg}", BAR] {
            let terminal = InMemoryTerm::new(24, 40);
            let target = ProgressDrawTarget::term_like(Box::new(terminal.clone()));
            let mut line = StatusLine::on(target, template, REDRAW, false);
            for number in 0..30 {
                let text = format!("{number:02} a text that is much longer than the forty columns of the terminal");
                line.show(|bar| bar.set_message(text), String::new);
                line.bar.tick();
            }
            let shown = terminal.contents();
            assert_eq!(shown.lines().count(), 1, "{shown}");
            assert!(shown.lines().all(|row| row.chars().count() <= 40), "{shown}");
            drop(line);
            assert_eq!(terminal.contents(), "");
        }
    }
}
