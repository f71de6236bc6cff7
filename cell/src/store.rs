//! What a supervisor keeps: SQLite in one file.
//!
//! In:  machines, their journals, programs, orders and attempts as they come. Out: the same, after any end of the process.
//!
//! Whatever belongs together is one transaction, on the disk before anything is told or sent (WAL, `synchronous = FULL`). A disk that is
//! full undoes the transaction as a whole.

use cell_link::message::{OrderState, Phase, Use};
use rusqlite::{Connection, OptionalExtension, Row, params};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Version of the tables.
const VERSION: i64 = 1;

const TABLES: &str = "
CREATE TABLE machine (name TEXT PRIMARY KEY, class TEXT NOT NULL DEFAULT '', described TEXT NOT NULL DEFAULT 'null',
    journal INTEGER NOT NULL DEFAULT 0, book INTEGER NOT NULL DEFAULT 0) STRICT;
CREATE TABLE journal (machine TEXT NOT NULL, book INTEGER NOT NULL, seq INTEGER NOT NULL, unix_s REAL NOT NULL, kind TEXT NOT NULL,
    text TEXT NOT NULL, entry TEXT NOT NULL, acknowledged INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (machine, book, seq)) STRICT, WITHOUT ROWID;
CREATE INDEX alarm ON journal (kind, acknowledged) WHERE kind = 'alarm';
CREATE TABLE program (sha256 TEXT PRIMARY KEY, content BLOB NOT NULL) STRICT;
CREATE TABLE stored (machine TEXT NOT NULL, program TEXT NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY (machine, program)) STRICT;
CREATE TABLE parts_order (id INTEGER PRIMARY KEY AUTOINCREMENT, wish TEXT NOT NULL, sha256 TEXT NOT NULL, state TEXT NOT NULL,
    note TEXT NOT NULL DEFAULT '', created_unix_s REAL NOT NULL) STRICT;
CREATE TABLE attempt (id TEXT PRIMARY KEY, parts_order INTEGER, machine TEXT NOT NULL, program TEXT NOT NULL, sha256 TEXT NOT NULL,
    phase TEXT NOT NULL, note TEXT NOT NULL DEFAULT '', sent_unix_s REAL NOT NULL, ended_unix_s REAL, took_s REAL) STRICT;
CREATE INDEX attempt_order ON attempt (parts_order, phase);
CREATE INDEX attempt_open ON attempt (phase) WHERE ended_unix_s IS NULL;
CREATE TABLE time_used (machine TEXT NOT NULL, day INTEGER NOT NULL, what TEXT NOT NULL, seconds REAL NOT NULL,
    PRIMARY KEY (machine, day, what)) STRICT, WITHOUT ROWID;
CREATE TABLE refusal (unix_s REAL NOT NULL, text TEXT NOT NULL) STRICT;
";

/// What a machine must be for an order, and how many parts are wanted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Wish {
    /// Name of the program.
    pub program: String,
    /// Parts.
    pub count: u32,
    /// Only machines of this class; empty: any.
    pub class: String,
    /// Letters of axes that a machine must have.
    pub axes: String,
    /// Least travel of axes, mm or degrees.
    pub travel: Vec<(char, f64)>,
    /// Numbers of tools that must be in its table.
    pub tools: Vec<u32>,
}

/// How an order of parts is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OrderIs {
    /// Machines work at it.
    Open,
    /// All its parts are made.
    Done,
    /// Somebody gave it up.
    Cancelled,
    /// Too many attempts have failed, one after the other: somebody is to look.
    Held,
}

impl OrderIs {
    /// As it is written.
    pub fn word(self) -> &'static str {
        match self {
            OrderIs::Open => "open",
            OrderIs::Done => "done",
            OrderIs::Cancelled => "cancelled",
            OrderIs::Held => "held",
        }
    }
}

/// An order of parts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartsOrder {
    /// Number or id.
    pub id: i64,
    #[serde(flatten)]
    /// What is wanted.
    pub wish: Wish,
    /// SHA-256 of its content.
    pub sha256: String,
    /// How it is.
    pub state: OrderIs,
    /// Why it is so.
    pub note: String,
    /// When it was ordered, seconds since 1970, UTC.
    pub created_unix_s: f64,
    /// Parts that were completed; attempts that ended otherwise; attempts under way.
    pub completed: u32,
    /// Attempts that ended otherwise.
    pub failed: u32,
    /// Attempts under way.
    pub under_way: u32,
}

/// One run of a program on a machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Attempt {
    /// Number or id.
    pub id: String,
    /// Its order; `None`: somebody has run a program.
    pub order: Option<i64>,
    /// Name of the machine.
    pub machine: String,
    /// Name of the program.
    pub program: String,
    /// SHA-256 of its content.
    pub sha256: String,
    /// [`Phase::Unknown`]: sent, and not answered yet.
    pub phase: Phase,
    /// Why it is so.
    pub note: String,
    /// When it was sent, seconds since 1970, UTC.
    pub sent_unix_s: f64,
    /// From begin to end, s.
    pub took_s: Option<f64>,
}

/// What is kept of a machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// Name of the machine.
    pub name: String,
    /// Its class; empty: none.
    pub class: String,
    /// What does not change of it.
    pub described: Value,
    /// Last entry of its journal that is here.
    pub journal: u64,
}

/// The file.
#[derive(Debug)]
pub struct Store {
    db: Connection,
}

type Outcome<T> = rusqlite::Result<T>;

fn phase(word: &str) -> Phase {
    let all = [
        Phase::Refused,
        Phase::Running,
        Phase::Completed,
        Phase::Failed,
        Phase::Interrupted,
    ];
    all.into_iter()
        .find(|phase| phase.to_string() == word)
        .unwrap_or(Phase::Unknown)
}

fn attempt(row: &Row<'_>) -> Outcome<Attempt> {
    Ok(Attempt {
        id: row.get(0)?,
        order: row.get(1)?,
        machine: row.get(2)?,
        program: row.get(3)?,
        sha256: row.get(4)?,
        phase: phase(&row.get::<_, String>(5)?),
        note: row.get(6)?,
        sent_unix_s: row.get(7)?,
        took_s: row.get(8)?,
    })
}

const ATTEMPT: &str = "SELECT id, parts_order, machine, program, sha256, phase, note, sent_unix_s, took_s FROM attempt";

impl Store {
    /// Opens the file, or makes it.
    ///
    /// # Errors
    /// It is none of a supervisor, a later version's, or cannot be read.
    pub fn open(file: &Path) -> anyhow::Result<Store> {
        use anyhow::Context;
        let place = || format!("{}", file.display());
        let db = Connection::open(file).with_context(place)?;
        db.execute_batch("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;")
            .with_context(place)?;
        let version: i64 = db
            .query_row("PRAGMA user_version", [], |row| row.get(0))
            .with_context(place)?;
        match version {
            VERSION => {}
            0 => {
                let made = format!("BEGIN; {TABLES} PRAGMA user_version = {VERSION}; COMMIT;");
                db.execute_batch(&made).with_context(place)?;
            }
            later => anyhow::bail!("{}: version {later}, and this program knows {VERSION}", place()),
        }
        Ok(Store { db })
    }

    /// Begins a transaction.
    ///
    /// # Errors
    /// Of the file.
    pub fn begin(&self) -> Outcome<()> {
        self.db.execute_batch("BEGIN IMMEDIATE")
    }

    /// Puts a transaction on the disk.
    ///
    /// # Errors
    /// The disk has not taken it.
    pub fn commit(&self) -> Outcome<()> {
        self.db.execute_batch("COMMIT")
    }

    /// Undoes a transaction.
    pub fn roll_back(&self) {
        // SQLite may have done it already.
        let _ = self.db.execute_batch("ROLLBACK");
    }

    /// All machines.
    ///
    /// # Errors
    /// Of the file, as of all below.
    pub fn machines(&self) -> Outcome<Vec<Known>> {
        let mut rows = self
            .db
            .prepare("SELECT name, class, described, journal FROM machine ORDER BY name")?;
        let known = rows.query_map([], |row| {
            Ok(Known {
                name: row.get(0)?,
                class: row.get(1)?,
                described: serde_json::from_str(&row.get::<_, String>(2)?).unwrap_or_default(),
                journal: row.get::<_, i64>(3)? as u64,
            })
        })?;
        known.collect()
    }

    /// A machine that was not here before.
    pub fn add_machine(&self, name: &str) -> Outcome<()> {
        let sql = "INSERT OR IGNORE INTO machine (name) VALUES (?1)";
        self.db.prepare(sql)?.execute([name]).map(drop)
    }

    /// Which class a machine is of.
    pub fn set_class(&self, name: &str, class: &str) -> Outcome<usize> {
        self.db
            .execute("UPDATE machine SET class = ?2 WHERE name = ?1", [name, class])
    }

    /// A machine that is here no more, with its journal and its times; what it made for orders stays.
    pub fn forget_machine(&self, name: &str) -> Outcome<()> {
        for sql in [
            "DELETE FROM journal WHERE machine = ?1",
            "DELETE FROM stored WHERE machine = ?1",
            "DELETE FROM time_used WHERE machine = ?1",
            "DELETE FROM machine WHERE name = ?1",
        ] {
            self.db.execute(sql, [name])?;
        }
        Ok(())
    }

    /// What does not change of a machine.
    pub fn set_described(&self, name: &str, described: &Value) -> Outcome<()> {
        let sql = "UPDATE machine SET described = ?2 WHERE name = ?1";
        self.db.execute(sql, [name, &described.to_string()]).map(drop)
    }

    /// An entry of a journal; once for all, however often it comes.
    pub fn add_entry(&self, machine: &str, seq: u64, entry: &Value) -> Outcome<()> {
        let text = |key: &str| entry[key].as_str().unwrap_or_default();
        let sql = "INSERT OR IGNORE INTO journal (machine, book, seq, unix_s, kind, text, entry, acknowledged)
            SELECT name, book, ?2, ?3, ?4, ?5, ?6, ?7 FROM machine WHERE name = ?1";
        let acknowledged = entry["alarm"]["acknowledged"].is_object();
        self.db.prepare(sql)?.execute(params![
            machine,
            seq as i64,
            entry["unix_s"].as_f64().unwrap_or(0.0),
            text("kind"),
            text("text"),
            entry.to_string(),
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
        let sql = "UPDATE machine SET journal = max(journal, ?2) WHERE name = ?1";
        self.db.prepare(sql)?.execute(params![machine, seq as i64]).map(drop)
    }

    /// A machine counts its journal from the beginning again: what is here of the earlier one stays, and its alarms are over.
    pub fn begin_journal_anew(&self, machine: &str) -> Outcome<()> {
        let sql = "UPDATE journal SET acknowledged = 1 WHERE machine = ?1 AND kind = 'alarm'";
        self.db.prepare(sql)?.execute([machine])?;
        let sql = "UPDATE machine SET journal = 0, book = book + 1 WHERE name = ?1";
        self.db.prepare(sql)?.execute([machine]).map(drop)
    }

    /// Entries of a machine behind a number, the oldest first.
    pub fn journal(&self, machine: &str, since: u64, most: u32) -> Outcome<Vec<Value>> {
        let sql = "SELECT entry FROM journal WHERE machine = ?1 AND seq > ?2
            AND book = (SELECT book FROM machine WHERE name = ?1) ORDER BY seq LIMIT ?3";
        let mut rows = self.db.prepare(sql)?;
        // Numbers beyond those of the table are behind all of it.
        let since = i64::try_from(since).unwrap_or(i64::MAX);
        let entries = rows.query_map(params![machine, since, most], |row| row.get::<_, String>(0))?;
        entries
            .map(|entry| Ok(serde_json::from_str(&entry?).unwrap_or_default()))
            .collect()
    }

    /// The last entries of a machine, the oldest first.
    pub fn last_entries(&self, machine: &str, most: u32) -> Outcome<Vec<Value>> {
        let sql = "SELECT entry FROM journal WHERE machine = ?1
            AND book = (SELECT book FROM machine WHERE name = ?1) ORDER BY seq DESC LIMIT ?2";
        let mut rows = self.db.prepare(sql)?;
        let entries = rows.query_map(params![machine, most], |row| row.get::<_, String>(0))?;
        let mut entries: Vec<Value> = entries
            .map(|entry| Ok(serde_json::from_str(&entry?).unwrap_or_default()))
            .collect::<Outcome<_>>()?;
        entries.reverse();
        Ok(entries)
    }

    /// Alarms that nobody has acknowledged, the newest first: machine, number, time, text.
    pub fn alarms(&self) -> Outcome<Vec<(String, u64, f64, String)>> {
        let sql = "SELECT machine, seq, unix_s, text FROM journal WHERE kind = 'alarm' AND acknowledged = 0 ORDER BY unix_s DESC LIMIT 500";
        let mut rows = self.db.prepare(sql)?;
        let alarms = rows.query_map([], |row| {
            Ok((row.get(0)?, row.get::<_, i64>(1)? as u64, row.get(2)?, row.get(3)?))
        })?;
        alarms.collect()
    }

    /// Keeps a program.
    pub fn add_program(&self, sha256: &str, content: &[u8]) -> Outcome<()> {
        let sql = "INSERT OR IGNORE INTO program (sha256, content) VALUES (?1, ?2)";
        self.db.execute(sql, params![sha256, content]).map(drop)
    }

    /// The content of a program.
    pub fn program(&self, sha256: &str) -> Outcome<Option<Vec<u8>>> {
        let sql = "SELECT content FROM program WHERE sha256 = ?1";
        self.db.query_row(sql, [sha256], |row| row.get(0)).optional()
    }

    /// A machine has a program now; `None`: not any more.
    pub fn set_stored(&self, machine: &str, program: &str, sha256: Option<&str>) -> Outcome<()> {
        match sha256 {
            Some(sha256) => {
                let sql = "INSERT OR REPLACE INTO stored (machine, program, sha256) VALUES (?1, ?2, ?3)";
                self.db.execute(sql, [machine, program, sha256]).map(drop)
            }
            None => {
                let sql = "DELETE FROM stored WHERE machine = ?1 AND program = ?2";
                self.db.execute(sql, [machine, program]).map(drop)
            }
        }
    }

    /// Which content a machine has under this name.
    pub fn stored(&self, machine: &str, program: &str) -> Outcome<Option<String>> {
        let sql = "SELECT sha256 FROM stored WHERE machine = ?1 AND program = ?2";
        self.db.query_row(sql, [machine, program], |row| row.get(0)).optional()
    }

    /// A new order of parts; gives its number.
    pub fn add_order(&self, wish: &Wish, sha256: &str, now: f64) -> Outcome<i64> {
        let sql = "INSERT INTO parts_order (wish, sha256, state, created_unix_s) VALUES (?1, ?2, 'open', ?3)";
        let wish = serde_json::to_string(wish).unwrap_or_default();
        self.db.execute(sql, params![wish, sha256, now])?;
        Ok(self.db.last_insert_rowid())
    }

    /// How an order is from now on.
    pub fn set_order(&self, id: i64, state: OrderIs, note: &str) -> Outcome<usize> {
        let sql = "UPDATE parts_order SET state = ?2, note = ?3 WHERE id = ?1";
        self.db.execute(sql, params![id, state.word(), note])
    }

    /// Orders of parts, the oldest first; only those that are open, or all.
    pub fn orders(&self, only_open: bool) -> Outcome<Vec<PartsOrder>> {
        let sql = "SELECT o.id, o.wish, o.sha256, o.state, o.note, o.created_unix_s,
                count(CASE WHEN a.phase = 'completed' THEN 1 END),
                count(CASE WHEN a.phase IN ('failed', 'interrupted') THEN 1 END),
                count(CASE WHEN a.phase IN ('unknown', 'running') THEN 1 END)
            FROM parts_order o LEFT JOIN attempt a ON a.parts_order = o.id
            WHERE NOT ?1 OR o.state = 'open' GROUP BY o.id ORDER BY o.id";
        let mut rows = self.db.prepare(sql)?;
        let orders = rows.query_map([only_open], |row| {
            let state: String = row.get(3)?;
            Ok(PartsOrder {
                id: row.get(0)?,
                wish: serde_json::from_str(&row.get::<_, String>(1)?).unwrap_or_default(),
                sha256: row.get(2)?,
                state: match state.as_str() {
                    "open" => OrderIs::Open,
                    "done" => OrderIs::Done,
                    "cancelled" => OrderIs::Cancelled,
                    _ => OrderIs::Held,
                },
                note: row.get(4)?,
                created_unix_s: row.get(5)?,
                completed: row.get(6)?,
                failed: row.get(7)?,
                under_way: row.get(8)?,
            })
        })?;
        orders.collect()
    }

    /// An attempt, before it is sent.
    pub fn add_attempt(&self, one: &Attempt) -> Outcome<()> {
        let sql = "INSERT INTO attempt (id, parts_order, machine, program, sha256, phase, sent_unix_s) VALUES (?1, ?2, ?3, ?4, ?5, 'unknown', ?6)";
        self.db
            .prepare(sql)?
            .execute(params![
                one.id,
                one.order,
                one.machine,
                one.program,
                one.sha256,
                one.sent_unix_s
            ])
            .map(drop)
    }

    /// How an attempt is; what is over stays as it is.
    pub fn set_attempt(&self, state: &OrderState, now: f64) -> Outcome<usize> {
        let sql = "UPDATE attempt SET phase = ?2, note = ?3, took_s = ?4, ended_unix_s = ?5 WHERE id = ?1 AND ended_unix_s IS NULL";
        let ended = state.phase.is_over().then_some(now);
        self.db.prepare(sql)?.execute(params![
            state.id,
            state.phase.to_string(),
            state.note,
            state.took_s,
            ended
        ])
    }

    /// Attempts that are not over.
    pub fn open_attempts(&self) -> Outcome<Vec<Attempt>> {
        let mut rows = self.db.prepare(&format!("{ATTEMPT} WHERE ended_unix_s IS NULL"))?;
        let attempts = rows.query_map([], attempt)?;
        attempts.collect()
    }

    /// Attempts of an order, the newest first.
    pub fn attempts_of(&self, order: i64, most: u32) -> Outcome<Vec<Attempt>> {
        let sql = format!("{ATTEMPT} WHERE parts_order = ?1 ORDER BY sent_unix_s DESC, rowid DESC LIMIT ?2");
        let mut rows = self.db.prepare(&sql)?;
        let attempts = rows.query_map(params![order, most], attempt)?;
        attempts.collect()
    }

    /// The last attempts of all.
    pub fn history(&self, most: u32) -> Outcome<Vec<Attempt>> {
        let mut rows = self
            .db
            .prepare(&format!("{ATTEMPT} ORDER BY sent_unix_s DESC, rowid DESC LIMIT ?1"))?;
        let attempts = rows.query_map([most], attempt)?;
        attempts.collect()
    }

    /// Time that a machine has spent, s.
    pub fn add_time(&self, machine: &str, day: i64, what: Use, seconds: f64) -> Outcome<()> {
        let sql = "INSERT INTO time_used (machine, day, what, seconds) VALUES (?1, ?2, ?3, ?4)
            ON CONFLICT DO UPDATE SET seconds = seconds + excluded.seconds";
        self.db
            .prepare(sql)?
            .execute(params![machine, day, what.word(), seconds])
            .map(drop)
    }

    /// How the time of machines was used from a day on: machine, day, what, s.
    pub fn times(&self, from_day: i64) -> Outcome<Vec<(String, i64, String, f64)>> {
        let sql = "SELECT machine, day, what, seconds FROM time_used WHERE day >= ?1 ORDER BY machine, day, what";
        let mut rows = self.db.prepare(sql)?;
        let times = rows.query_map([from_day], |row| {
            Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
        })?;
        times.collect()
    }

    /// Somebody was refused; the last thousand are kept.
    pub fn add_refusal(&self, now: f64, text: &str) -> Outcome<()> {
        self.db
            .execute("INSERT INTO refusal (unix_s, text) VALUES (?1, ?2)", params![now, text])?;
        let sql = "DELETE FROM refusal WHERE rowid <= (SELECT max(rowid) FROM refusal) - 1000";
        self.db.execute(sql, []).map(drop)
    }

    /// Who was refused, the newest first.
    pub fn refusals(&self, most: u32) -> Outcome<Vec<(f64, String)>> {
        let mut rows = self
            .db
            .prepare("SELECT unix_s, text FROM refusal ORDER BY rowid DESC LIMIT ?1")?;
        let refusals = rows.query_map([most], |row| Ok((row.get(0)?, row.get(1)?)))?;
        refusals.collect()
    }

    /// Lets the file grow to so many pages at the most: what a full disk does to it.
    #[cfg(test)]
    pub(crate) fn limit(&self, pages: u32) {
        self.db.pragma_update(None, "max_page_count", pages).unwrap();
    }

    /// Pages that the file has.
    #[cfg(test)]
    pub(crate) fn pages(&self) -> u32 {
        self.db.query_row("PRAGMA page_count", [], |row| row.get(0)).unwrap()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn entries_come_once_and_alarms_are_open_until_they_are_acknowledged() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cell.db");
        let store = Store::open(&file).unwrap();
        store.add_machine("mill").unwrap();
        let alarm = json!({"seq": 5, "unix_s": 1.0, "kind": "alarm", "text": "hot", "alarm": {"acknowledged": null}});
        store.add_entry("mill", 5, &alarm).unwrap();
        store.add_entry("mill", 5, &alarm).unwrap();
        assert_eq!(store.alarms().unwrap(), [("mill".into(), 5, 1.0, "hot".into())]);
        let by = json!({"seq": 6, "unix_s": 2.0, "kind": "note", "text": "ack", "acknowledges": [[5], {"by": "x"}]});
        store.add_entry("mill", 6, &by).unwrap();
        assert_eq!(store.alarms().unwrap(), []);
        assert_eq!(store.machines().unwrap()[0].journal, 6);
        assert_eq!(store.journal("mill", 5, 10).unwrap(), [by]);
        store.add_entry("mill", 7, &alarm).unwrap();
        store.begin_journal_anew("mill").unwrap();
        assert_eq!(
            (store.alarms().unwrap(), store.machines().unwrap()[0].journal),
            (vec![], 0)
        );
        let first = json!({"seq": 1, "unix_s": 3.0, "kind": "note", "text": "anew"});
        store.add_entry("mill", 1, &first).unwrap();
        assert_eq!(store.journal("mill", 0, 10).unwrap(), [first]);
        drop(store);
        std::fs::write(
            &file,
            "no database, but long enough to be looked at as one: ".repeat(20),
        )
        .unwrap();
        let error = format!("{:#}", Store::open(&file).unwrap_err());
        assert!(error.contains("cell.db: file is not a database"), "{error}");
    }

    #[test]
    fn what_is_over_stays_as_it_is() {
        let store = Store::open(Path::new(":memory:")).unwrap();
        let attempt = Attempt {
            id: "a".into(),
            order: None,
            machine: "mill".into(),
            program: "p".into(),
            sha256: String::new(),
            phase: Phase::Unknown,
            note: String::new(),
            sent_unix_s: 1.0,
            took_s: None,
        };
        store.add_attempt(&attempt).unwrap();
        assert!(store.add_attempt(&attempt).is_err());
        assert_eq!(store.open_attempts().unwrap(), [attempt]);
        let state = |phase| OrderState {
            id: "a".into(),
            phase,
            note: String::new(),
            took_s: None,
        };
        for (phase, changed) in [(Phase::Running, 1), (Phase::Completed, 1), (Phase::Interrupted, 0)] {
            assert_eq!(store.set_attempt(&state(phase), 2.0).unwrap(), changed);
        }
        assert_eq!(store.history(9).unwrap()[0].phase, Phase::Completed);
        assert_eq!(store.open_attempts().unwrap(), []);
    }
}
