//! Orders that were begun, and what became of them: an order that comes again is not carried out again, over any crash.
//!
//! In:  ids as they begin and end. Out: how an id is; `cell-orders.jsonl` in the state folder.
//!
//! A line is on the disk before its program is started, and the end before it is told. What was begun and not ended when the
//! control starts was cut off: `interrupted`.

use crate::message::{OrderState, Phase};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Orders that are remembered.
const ORDERS_MAX: usize = 1000;
/// Lines from which on the file is written anew.
const LINES_MAX: usize = 4 * ORDERS_MAX;
/// Longest file, octets.
const FILE_MAX: u64 = 8 << 20;
/// Its name.
const NAME: &str = "cell-orders.jsonl";

/// An order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    #[serde(flatten)]
    /// How it is.
    pub state: OrderState,
    /// The program, as it was stored.
    pub program: String,
    /// The last entry of the journal as it began.
    pub journal: u64,
}

/// Orders of a control.
#[derive(Debug)]
pub struct Ledger {
    file: File,
    path: PathBuf,
    /// Octets of whole lines.
    length: u64,
    lines: usize,
    /// The oldest first.
    orders: VecDeque<Line>,
}

impl Ledger {
    /// The orders of this folder. Those that were under way are [`Phase::Running`] still: see [`Ledger::unfinished`].
    ///
    /// # Errors
    /// The file cannot be read or is none; then nothing may be run.
    pub fn open(folder: &Path) -> io::Result<Ledger> {
        let path = folder.join(NAME);
        // Made if it is not there; a link of another user is refused.
        let file = files::append(&path).map_err(|cause| wrong(&path, &cause.to_string()))?;
        let text = files::read::read(&path, FILE_MAX).map_err(|cause| wrong(&path, &cause.to_string()))?;
        // A line that a crash has cut short was never told to anybody.
        let whole = text.iter().rposition(|octet| *octet == b'\n').map_or(0, |at| at + 1);
        if whole < text.len() {
            file.set_len(whole as u64)?;
        }
        let mut ledger = Ledger {
            file,
            length: whole as u64,
            lines: 0,
            orders: VecDeque::new(),
            path,
        };
        for (at, line) in text[..whole].split(|octet| *octet == b'\n').enumerate() {
            if line.is_empty() {
                continue;
            }
            let line: Line = serde_json::from_slice(line)
                .map_err(|error| wrong(&ledger.path, &format!("line {}: {error}", at + 1)))?;
            ledger.lines += 1;
            ledger.take(line);
        }
        Ok(ledger)
    }

    /// How an order is; `None`: it has never begun here.
    pub fn get(&self, id: &str) -> Option<&Line> {
        self.orders.iter().rev().find(|line| line.state.id == id)
    }

    /// The order that was begun last.
    pub fn last(&self) -> Option<&Line> {
        self.orders.back()
    }

    /// The orders that are under way, as far as the file tells.
    pub fn unfinished(&self) -> Vec<Line> {
        let running = |line: &&Line| line.state.phase == Phase::Running;
        self.orders.iter().filter(running).cloned().collect()
    }

    /// Puts an order on the disk, as it is now.
    ///
    /// # Errors
    /// The disk has not taken it: it is as before.
    pub fn put(&mut self, line: Line) -> io::Result<()> {
        if self.lines >= LINES_MAX {
            self.write_anew()?;
        }
        let mut text = serde_json::to_vec(&line).map_err(io::Error::other)?;
        text.push(b'\n');
        let written = self.file.write_all(&text).and_then(|()| self.file.sync_data());
        if let Err(error) = written {
            // Half a line would be taken for the beginning of the next one.
            self.file.set_len(self.length)?;
            return Err(error);
        }
        self.length += text.len() as u64;
        self.lines += 1;
        self.take(line);
        Ok(())
    }

    fn take(&mut self, line: Line) {
        match self
            .orders
            .iter_mut()
            .rev()
            .find(|known| known.state.id == line.state.id)
        {
            Some(known) => *known = line,
            None => self.orders.push_back(line),
        }
        while self.orders.len() > ORDERS_MAX {
            self.orders.pop_front();
        }
    }

    fn write_anew(&mut self) -> io::Result<()> {
        let mut text = Vec::new();
        for line in &self.orders {
            serde_json::to_writer(&mut text, line).map_err(io::Error::other)?;
            text.push(b'\n');
        }
        files::write(&self.path, &text)?;
        if let Some(folder) = self.path.parent() {
            File::open(folder)?.sync_all()?;
        }
        self.file = files::append(&self.path)?;
        (self.length, self.lines) = (text.len() as u64, self.orders.len());
        Ok(())
    }
}

fn wrong(path: &Path, what: &str) -> io::Error {
    let help = "put it aside to begin anew: what it holds is then not known any more";
    io::Error::new(ErrorKind::InvalidData, format!("{}: {what}; {help}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(id: &str, phase: Phase) -> Line {
        Line {
            state: OrderState {
                id: id.into(),
                phase,
                note: String::new(),
                took_s: None,
            },
            program: "p.ngc".into(),
            journal: 0,
        }
    }

    #[test]
    fn orders_are_known_again_at_whatever_length_the_file_was_cut() {
        let folder = tempfile::tempdir().unwrap();
        let mut ledger = Ledger::open(folder.path()).unwrap();
        ledger.put(line("a", Phase::Running)).unwrap();
        ledger.put(line("a", Phase::Completed)).unwrap();
        ledger.put(line("b", Phase::Running)).unwrap();
        let text = std::fs::read(folder.path().join(NAME)).unwrap();
        let ends: Vec<usize> = (0..text.len()).filter(|at| text[*at] == b'\n').collect();
        for cut in 0..=text.len() {
            std::fs::write(folder.path().join(NAME), &text[..cut]).unwrap();
            let mut ledger = Ledger::open(folder.path()).unwrap();
            let whole = ends.iter().filter(|end| **end < cut).count();
            let phase = |id: &str| ledger.get(id).map(|line| line.state.phase);
            let expected = [
                (None, None),
                (Some(Phase::Running), None),
                (Some(Phase::Completed), None),
                (Some(Phase::Completed), Some(Phase::Running)),
            ];
            assert_eq!((phase("a"), phase("b")), expected[whole], "cut at {cut}");
            // What is written next is a line of its own.
            ledger.put(line("c", Phase::Running)).unwrap();
            assert!(Ledger::open(folder.path()).unwrap().get("c").is_some());
        }
        std::fs::write(folder.path().join(NAME), "{}\n").unwrap();
        let error = Ledger::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("line 1: missing field"), "{error}");
    }

    #[test]
    fn the_file_does_not_grow_without_end() {
        let folder = tempfile::tempdir().unwrap();
        let mut ledger = Ledger::open(folder.path()).unwrap();
        ledger.lines = LINES_MAX;
        for number in 0..ORDERS_MAX + 5 {
            ledger.take(line(&format!("n-{number}"), Phase::Completed));
        }
        ledger.put(line("last", Phase::Running)).unwrap();
        assert_eq!(ledger.lines, ORDERS_MAX + 1);
        let again = Ledger::open(folder.path()).unwrap();
        assert_eq!(again.orders.len(), ORDERS_MAX);
        assert_eq!(again.last().unwrap().state.id, "last");
        assert_eq!(again.unfinished().len(), 1);
        assert!(again.get("n-5").is_none() && again.get("n-6").is_some());
    }
}
