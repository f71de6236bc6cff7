//! The journal of a running control: entries in their order, each with its number and the time of day.
//!
//! In:  entries; the journal of earlier days. Out: the latest of them, and all of them to whoever writes them to the disk.

use crate::bursts::Bursts;
use crate::journal_keeper::Kept;
use machine::journal::{Acknowledged, AlarmRecord, Entry, Kind, ProgramRecord, acknowledge};
use protocol::{Message, message};
use std::sync::{Arc, mpsc};

/// Entries that are kept; older ones go.
const ENTRIES_MAX: usize = 20_000;

/// What an entry has beside its text.
#[derive(Debug, Default)]
pub(super) struct More {
    pub(super) alarm: Option<AlarmRecord>,
    pub(super) program: Option<ProgramRecord>,
    pub(super) acknowledges: Option<(Vec<u64>, Acknowledged)>,
}

/// The journal, as long as the control runs.
#[derive(Default)]
pub struct Log {
    entries: Vec<Entry>,
    /// Entries that have been read.
    read: usize,
    /// Number of the last entry.
    seq: u64,
    /// Time of day, s since 1970; `None`: there is none, as in virtual time.
    time_of_day: Option<fn() -> f64>,
    /// Who writes entries to the disk, and how far that is.
    keeper: Option<(mpsc::Sender<Entry>, Arc<Kept>)>,
    bursts: Bursts,
    /// The client whose order is being carried out.
    by: Option<String>,
}

impl Log {
    /// Goes on with the journal of earlier days, whose last number is this, and gives new entries to `keeper`, too, who shows how far
    /// the disk has them.
    pub fn keep(&mut self, before: Vec<Entry>, last: u64, keeper: mpsc::Sender<Entry>, kept: Arc<Kept>) {
        self.seq = last;
        kept.begin(last);
        self.read = before.len();
        self.entries = before;
        self.keeper = Some((keeper, kept));
    }

    /// Entries have the time of day from this clock, s since 1970.
    pub fn set_time_of_day(&mut self, clock: fn() -> f64) {
        self.time_of_day = Some(clock);
    }

    /// Entries from now on come of an order of this client; `None`: of no order.
    pub(crate) fn set_by(&mut self, by: Option<String>) {
        self.by = by;
    }

    /// The client whose order is being carried out.
    pub(crate) fn by(&self) -> Option<String> {
        self.by.clone()
    }

    /// The entry of this number, while it is kept.
    pub(super) fn entry(&self, seq: u64) -> Option<&Entry> {
        let at = self.entries.binary_search_by_key(&seq, |entry| entry.seq).ok()?;
        self.entries.get(at)
    }

    /// Everything noted so far, or the latest of it.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Number of the last entry.
    pub fn last(&self) -> u64 {
        self.seq
    }

    /// Whether the entries up to this number are on the disk, or cannot be.
    pub fn is_kept(&self, seq: u64) -> bool {
        self.keeper.as_ref().is_none_or(|(_, kept)| kept.has(seq))
    }

    /// Number of the last entry that is on the disk, or cannot be.
    pub fn last_on_disk(&self) -> u64 {
        self.keeper.as_ref().map_or(self.seq, |(_, kept)| kept.last())
    }

    /// Whether the disk does not take the journal.
    pub fn fails(&self) -> bool {
        self.keeper.as_ref().is_some_and(|(_, kept)| kept.fails())
    }

    /// The time of day, s since 1970; 0 where there is none.
    pub(super) fn unix_s(&self) -> f64 {
        self.time_of_day.map_or(0.0, |now| now())
    }

    /// The first entry that has not been read.
    pub(super) fn next(&mut self) -> Option<&Entry> {
        let entry = self.entries.get(self.read)?;
        self.read += 1;
        Some(entry)
    }

    /// An entry, unless it is one of too many of its kind.
    pub(super) fn note(&mut self, time_s: f64, message: Message) {
        if self.bursts.tells(time_s, &message.text) {
            self.write(time_s, message, More::default());
        }
    }

    /// Tells at `now_s` what was not told one by one, of windows that are over at `until_s`.
    pub(super) fn note_bursts(&mut self, until_s: f64, now_s: f64) {
        for text in self.bursts.counted(until_s) {
            self.write(now_s, text.into(), More::default());
        }
    }

    /// An entry, whatever there was before it.
    pub(super) fn write(&mut self, time_s: f64, message: Message, more: More) {
        if self.entries.len() >= ENTRIES_MAX {
            // Half at once, so that it costs nothing to speak of; a control may run for months.
            let gone = self.entries.len() / 2;
            self.entries.drain(..gone);
            self.read = self.read.saturating_sub(gone);
        }
        self.seq += 1;
        let entry = Entry {
            seq: self.seq,
            unix_s: self.unix_s(),
            time_s,
            kind: kind(&message.text),
            by: self.by.clone(),
            alarm: more.alarm,
            program: more.program,
            acknowledges: more.acknowledges,
            ..Entry::new(message)
        };
        if let Some((keeper, _)) = &self.keeper {
            // One that is gone has told so.
            let _ = keeper.send(entry.clone());
        }
        self.entries.push(entry);
    }

    /// Marks alarms as acknowledged by this order, and says so in an entry.
    pub(super) fn acknowledge(&mut self, time_s: f64, seqs: Vec<u64>, by: &str) {
        let how = Acknowledged {
            unix_s: self.unix_s(),
            by: by.to_owned(),
        };
        acknowledge(&mut self.entries, &seqs, &how);
        let told = self.entries.iter().filter(|entry| seqs.contains(&entry.seq));
        let codes: Vec<&str> = told
            .filter_map(|entry| Some(entry.alarm.as_ref()?.code.as_str()))
            .collect();
        let message = message!(
            "alarm.acknowledged",
            "acknowledged by {by}: {codes}",
            by = by,
            codes = codes.join(", ")
        );
        let more = More {
            acknowledges: Some((seqs, how)),
            ..More::default()
        };
        self.write(time_s, message, more);
    }

    /// Nothing more goes to the disk.
    pub(super) fn close(&mut self) {
        self.keeper = None;
    }
}

/// Alarms and warnings begin with this word.
fn kind(text: &str) -> Kind {
    match text.split([':', ',']).next() {
        Some("alarm") => Kind::Alarm,
        Some("warning") => Kind::Warning,
        _ => Kind::Note,
    }
}
