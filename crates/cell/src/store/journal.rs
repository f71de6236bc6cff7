//! Journals of the machines in the store: each entry once, the oldest ones gone where they fill the disk.

use super::{Outcome, Store};
use cell_link::message::MESSAGE_MAX;
use rusqlite::{OptionalExtension, Rows, params};
use serde_json::Value;
use std::collections::HashMap;

/// Entries of journals in one answer, octets: as many as a message of a control may have.
const ANSWER_OCTETS: usize = MESSAGE_MAX;
/// Entries of the journal of one machine, octets: beyond that its oldest ones go, so that none fills the disk for all.
const JOURNAL_OCTETS: i64 = 256 << 20;

impl Store {
    /// An entry of a journal; once for all, however often it comes.
    pub fn add_entry(&self, machine: &str, seq: u64, entry: &Value) -> Outcome<()> {
        let text = |key: &str| entry[key].as_str().unwrap_or_default();
        let sql = "INSERT OR IGNORE INTO journal (machine, book, seq, unix_s, kind, text, entry, acknowledged)
            SELECT name, book, ?2, ?3, ?4, ?5, ?6, ?7 FROM machine WHERE name = ?1";
        let acknowledged = entry["alarm"]["acknowledged"].is_object();
        let whole = entry.to_string();
        let added = self.db.prepare(sql)?.execute(params![
            machine,
            seq as i64,
            entry["unix_s"].as_f64().unwrap_or(0.0),
            text("kind"),
            text("text"),
            whole,
            acknowledged,
        ])?;
        for seq in entry["acknowledges"][0]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_u64)
        {
            let sql = "UPDATE journal SET acknowledged = 1 WHERE machine = ?1 AND seq = ?2
                AND book = (SELECT book FROM machine WHERE name = ?1)";
            self.db.prepare(sql)?.execute(params![machine, seq as i64])?;
        }
        let sql = "UPDATE machine SET journal = max(journal, ?2), octets = octets + ?3 WHERE name = ?1";
        let octets = (added * whole.len()) as i64;
        self.db
            .prepare(sql)?
            .execute(params![machine, seq as i64, octets])
            .map(drop)
    }

    /// Takes away the oldest entries of a machine that has more than its share; gives how many. Alarms go with them, open ones, too.
    pub fn keep_share(&self, machine: &str) -> Outcome<usize> {
        self.keep_octets(machine, JOURNAL_OCTETS)
    }

    pub(super) fn keep_octets(&self, machine: &str, most: i64) -> Outcome<usize> {
        let sql = "SELECT octets FROM machine WHERE name = ?1";
        let has: Option<i64> = self
            .db
            .prepare(sql)?
            .query_row([machine], |row| row.get(0))
            .optional()?;
        let mut too_many = has.unwrap_or(0) - most;
        let mut up_to = None;
        let mut rows = self
            .db
            .prepare("SELECT book, seq, octet_length(entry) FROM journal WHERE machine = ?1 ORDER BY book, seq")?;
        let mut rows = rows.query([machine])?;
        while too_many > 0
            && let Some(row) = rows.next()?
        {
            up_to = Some((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?));
            too_many -= row.get::<_, i64>(2)?;
        }
        let sql = "DELETE FROM journal WHERE machine = ?1 AND (book, seq) <= (?2, ?3)
            RETURNING machine, octet_length(entry)";
        match up_to {
            Some((book, seq)) => self.delete_entries(sql, params![machine, book, seq]),
            None => Ok(0),
        }
    }

    /// Deletes entries of journals by a statement that returns the machine and the octets of each; gives how many.
    pub(super) fn delete_entries(&self, sql: &str, of: impl rusqlite::Params) -> Outcome<usize> {
        let mut gone: HashMap<String, i64> = HashMap::new();
        let mut count = 0;
        let mut rows = self.db.prepare(sql)?;
        let mut rows = rows.query(of)?;
        while let Some(row) = rows.next()? {
            *gone.entry(row.get(0)?).or_default() += row.get::<_, i64>(1)?;
            count += 1;
        }
        for (machine, octets) in gone {
            let sql = "UPDATE machine SET octets = max(0, octets - ?2) WHERE name = ?1";
            self.db.prepare(sql)?.execute(params![machine, octets])?;
        }
        Ok(count)
    }

    /// A machine counts its journal from the beginning again: what is here of the earlier one stays, and its alarms are over.
    pub fn begin_journal_anew(&self, machine: &str) -> Outcome<()> {
        let sql = "UPDATE journal SET acknowledged = 1 WHERE machine = ?1 AND kind = 'alarm'";
        self.db.prepare(sql)?.execute([machine])?;
        let sql = "UPDATE machine SET journal = 0, book = book + 1 WHERE name = ?1";
        self.db.prepare(sql)?.execute([machine]).map(drop)
    }

    /// Entries of a machine behind a number, the oldest first: so many at the most, and no more than fit into an answer.
    pub fn journal(&self, machine: &str, since: u64, most: u32) -> Outcome<Vec<Value>> {
        let sql = "SELECT entry FROM journal WHERE machine = ?1 AND seq > ?2
            AND book = (SELECT book FROM machine WHERE name = ?1) ORDER BY seq LIMIT ?3";
        let mut rows = self.db.prepare(sql)?;
        // Numbers beyond those of the table are behind all of it.
        let since = i64::try_from(since).unwrap_or(i64::MAX);
        fitting(rows.query(params![machine, since, most])?)
    }

    /// The last entries of a machine, the oldest first, as many as above.
    pub fn last_entries(&self, machine: &str, most: u32) -> Outcome<Vec<Value>> {
        let sql = "SELECT entry FROM journal WHERE machine = ?1
            AND book = (SELECT book FROM machine WHERE name = ?1) ORDER BY seq DESC LIMIT ?2";
        let mut rows = self.db.prepare(sql)?;
        let mut entries = fitting(rows.query(params![machine, most])?)?;
        entries.reverse();
        Ok(entries)
    }

    /// Alarms that nobody has acknowledged, the newest first: machine, number, time, text.
    pub fn alarms(&self) -> Outcome<Vec<(String, u64, f64, String)>> {
        let sql =
            "SELECT machine, seq, unix_s, substr(text, 1, 2000) FROM journal WHERE kind = 'alarm' AND acknowledged = 0
            ORDER BY unix_s DESC LIMIT 500";
        let mut rows = self.db.prepare(sql)?;
        let alarms = rows.query_map([], |row| {
            Ok((row.get(0)?, row.get::<_, i64>(1)? as u64, row.get(2)?, row.get(3)?))
        })?;
        alarms.collect()
    }
}

/// Entries, as far as they fit into an answer; the first one always does.
fn fitting(mut rows: Rows<'_>) -> Outcome<Vec<Value>> {
    let (mut entries, mut octets) = (Vec::new(), 0);
    while let Some(row) = rows.next()? {
        let entry: String = row.get(0)?;
        octets += entry.len();
        if octets > ANSWER_OCTETS && !entries.is_empty() {
            break;
        }
        entries.push(serde_json::from_str(&entry).unwrap_or_default());
    }
    Ok(entries)
}
