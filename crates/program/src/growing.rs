//! A program text that grows while it runs: lines of a client who sends them one after the other.
//!
//! In:  lines, as they come. Out: the text for its reader, who waits a little where there is no more yet, and then takes it for the end.
//!
//! The reader is far ahead of the machine: where it has to wait, the planner has all that came. It need not take that for the end before
//! the machine comes near it: [`Growing::keep_open`]. A text that has ended grows no more; what follows is another program, which begins
//! at rest.

use super::text::temporary_file;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A reader takes it for the end if nothing comes for so long.
const IDLE: Duration = Duration::from_millis(100);
/// How long the text stays open for whoever keeps it open.
const KEPT_OPEN: Duration = Duration::from_secs(1);
/// Longest text, octets.
const LENGTH_MAX: u64 = 1 << 30;

/// A text that grows.
#[derive(Debug)]
pub struct Growing {
    /// Without a name; memory is locked, and a job may be long.
    file: File,
    state: Mutex<State>,
    more: Condvar,
}

#[derive(Debug, Default)]
struct State {
    length: u64,
    /// As far as somebody has read.
    read: u64,
    /// Until then the reader does not take anything for the end.
    open_until: Option<Instant>,
    is_closed: bool,
}

impl Growing {
    /// An empty text.
    ///
    /// # Errors
    /// There is no temporary file to be had.
    pub fn new() -> io::Result<Growing> {
        Ok(Growing {
            file: temporary_file()?,
            state: Mutex::default(),
            more: Condvar::new(),
        })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts lines behind those that are there; gives where they end, or nothing if the text has ended.
    ///
    /// # Errors
    /// The disk does not take them.
    pub fn append(&self, lines: &str) -> io::Result<Option<u64>> {
        let mut state = self.state();
        let end = state.length + lines.len() as u64;
        if state.is_closed || end > LENGTH_MAX {
            return Ok(None);
        }
        self.file.write_all_at(lines.as_bytes(), state.length)?;
        state.length = end;
        self.more.notify_all();
        Ok(Some(end))
    }

    /// Nothing more comes.
    pub fn close(&self) {
        self.state().is_closed = true;
        self.more.notify_all();
    }

    /// While this is said again and again, the reader takes nothing for the end.
    pub fn keep_open(&self, open: bool) {
        let mut state = self.state();
        let was_open = state.open_until.is_some();
        state.open_until = open.then(|| Instant::now() + KEPT_OPEN);
        if was_open && !open {
            self.more.notify_all();
        }
    }

    /// How far it has been read, octets.
    pub fn read_to(&self) -> u64 {
        self.state().read
    }

    /// Reads what is there; waits where nothing is yet.
    ///
    /// # Errors
    /// The disk does not give it.
    pub fn read_at(&self, to: &mut [u8], at: u64) -> io::Result<usize> {
        let mut state = self.state();
        let idle_until = Instant::now() + IDLE;
        while at >= state.length && !state.is_closed {
            let until = state.open_until.map_or(idle_until, |open| open.max(idle_until));
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            (state, _) = self
                .more
                .wait_timeout(state, left)
                .unwrap_or_else(PoisonError::into_inner);
        }
        if at >= state.length {
            state.is_closed = true;
            return Ok(0);
        }
        let most = usize::try_from(state.length - at).map_or(to.len(), |most| most.min(to.len()));
        let count = self.file.read_at(&mut to[..most], at)?;
        state.read = state.read.max(at + count as u64);
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn read_all(text: &Growing) -> String {
        let (mut octets, mut buffer) = (Vec::new(), [0; 7]);
        loop {
            match text.read_at(&mut buffer, octets.len() as u64).unwrap() {
                0 => return String::from_utf8(octets).unwrap(),
                count => octets.extend(&buffer[..count]),
            }
        }
    }

    #[test]
    fn a_reader_waits_for_more_and_ends_where_nothing_comes() {
        let text = Arc::new(Growing::new().unwrap());
        assert_eq!(text.append("G0 X1\n").unwrap(), Some(6));
        let reader = std::thread::spawn({
            let text = Arc::clone(&text);
            move || read_all(&text)
        });
        while text.read_to() < 6 {
            std::thread::yield_now();
        }
        // The reader waits now, or is about to. A PC that stands still for that long has ended the text.
        let is_taken = text.append("G0 X2\n").unwrap().is_some();
        let told = reader.join().unwrap();
        assert_eq!(told, if is_taken { "G0 X1\nG0 X2\n" } else { "G0 X1\n" });
        assert_eq!(text.append("G0 X3\n").unwrap(), None, "it has ended");
        assert_eq!(text.read_to(), told.len() as u64);
    }

    #[test]
    fn a_text_that_is_kept_open_ends_after_that_only() {
        let text = Arc::new(Growing::new().unwrap());
        text.append("G0 X1\n").unwrap();
        text.keep_open(true);
        let reader = std::thread::spawn({
            let text = Arc::clone(&text);
            move || read_all(&text)
        });
        // Longer than a reader waits otherwise.
        for _ in 0..3 {
            std::thread::sleep(IDLE);
            text.keep_open(true);
        }
        let told = text.append("G0 X2\n").unwrap();
        text.keep_open(false);
        let read = reader.join().unwrap();
        // A PC that stands still for as long as it was kept open has ended the text.
        assert_eq!(read, if told.is_some() { "G0 X1\nG0 X2\n" } else { "G0 X1\n" });
    }

    #[test]
    fn what_was_there_before_the_end_is_read_and_what_comes_behind_is_not_taken() {
        let text = Growing::new().unwrap();
        text.append("G0 X1\n").unwrap();
        text.close();
        assert_eq!(text.append("G0 X2\n").unwrap(), None);
        assert_eq!(read_all(&text), "G0 X1\n");
    }
}
