//! What a supervisor keeps: SQLite in one file.
//!
//! In:  machines, their journals, programs, orders and attempts as they come. Out: the same, after any end of the process.
//!
//! Whatever belongs together is one transaction, on the disk before anything is told or sent (WAL, `synchronous = FULL`). A disk that is
//! full undoes the transaction as a whole.

mod journal;

use cell_link::message::{OrderState, Phase, Use};
use rusqlite::{Connection, OptionalExtension, Row, params};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Version of the tables.
const VERSION: i64 = 2;
const TABLES: &str = "
CREATE TABLE machine (name TEXT PRIMARY KEY, class TEXT NOT NULL DEFAULT '', described TEXT NOT NULL DEFAULT 'null',
    journal INTEGER NOT NULL DEFAULT 0, book INTEGER NOT NULL DEFAULT 0, octets INTEGER NOT NULL DEFAULT 0) STRICT;
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

/// What a store of version 1 lacks.
const FROM_VERSION_1: &str = "
ALTER TABLE machine ADD COLUMN octets INTEGER NOT NULL DEFAULT 0;
UPDATE machine SET octets = (SELECT coalesce(sum(octet_length(entry)), 0) FROM journal WHERE journal.machine = machine.name);
";

/// By which what is old is found, without a look at all that is young. Stores of before have them not.
const AGES: &str = "
CREATE INDEX IF NOT EXISTS journal_age ON journal (unix_s) WHERE kind <> 'alarm' OR acknowledged = 1;
CREATE INDEX IF NOT EXISTS attempt_age ON attempt (ended_unix_s) WHERE parts_order IS NULL;
CREATE INDEX IF NOT EXISTS order_age ON parts_order (created_unix_s) WHERE state IN ('done', 'cancelled');
CREATE INDEX IF NOT EXISTS order_program ON parts_order (sha256);
CREATE INDEX IF NOT EXISTS time_age ON time_used (day);
";

/// What is too old of each kind, before ?1: ?2 of it, the oldest first.
const OLD_ENTRIES: &str = "SELECT machine, book, seq FROM journal
    WHERE unix_s < ?1 AND (kind <> 'alarm' OR acknowledged = 1) ORDER BY unix_s LIMIT ?2";
const OLD_ATTEMPTS: &str = "SELECT rowid FROM attempt INDEXED BY attempt_age
    WHERE ended_unix_s < ?1 AND parts_order IS NULL ORDER BY ended_unix_s LIMIT ?2";
const OLD_ORDERS: &str = "SELECT id FROM parts_order o WHERE state IN ('done', 'cancelled') AND created_unix_s < ?1
    AND NOT EXISTS (SELECT 1 FROM attempt a WHERE a.parts_order = o.id AND (a.ended_unix_s IS NULL OR a.ended_unix_s >= ?1))
    ORDER BY created_unix_s LIMIT ?2";
const OLD_TIMES: &str = "SELECT machine, day, what FROM time_used WHERE day < ?1 ORDER BY day LIMIT ?2";

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

/// What is there no more, as it was too old.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pruned {
    /// Entries of journals.
    pub entries: usize,
    /// Orders of parts.
    pub orders: usize,
    /// Attempts.
    pub attempts: usize,
    /// Contents of programs that no order has.
    pub programs: usize,
    /// Times of use, each of a machine, a day and a use.
    pub times: usize,
}

impl std::ops::AddAssign for Pruned {
    fn add_assign(&mut self, more: Pruned) {
        self.entries += more.entries;
        self.orders += more.orders;
        self.attempts += more.attempts;
        self.programs += more.programs;
        self.times += more.times;
    }
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
            0 | 1 => {
                let made = if version == 0 { TABLES } else { FROM_VERSION_1 };
                let made = format!("BEGIN; {made} PRAGMA user_version = {VERSION}; COMMIT;");
                db.execute_batch(&made).with_context(place)?;
            }
            later => anyhow::bail!("{}: version {later}, and this program knows {VERSION}", place()),
        }
        db.execute_batch(AGES).with_context(place)?;
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

    /// Takes away what is of before `before` (seconds since 1970, UTC), the oldest first, so many rows of each kind at the most.
    ///
    /// What is open stays: alarms that nobody has acknowledged, orders that are open or held, with all their attempts, and attempts that
    /// are not over. The number of the last entry of a machine stays, too, so nothing comes a second time.
    pub fn prune(&self, before: f64, most: u32) -> Outcome<Pruned> {
        let sql = format!(
            "DELETE FROM journal WHERE (machine, book, seq) IN ({OLD_ENTRIES}) RETURNING machine, octet_length(entry)"
        );
        let entries = self.delete_entries(&sql, params![before, most])?;
        let sql = format!("DELETE FROM attempt WHERE rowid IN ({OLD_ATTEMPTS})");
        let mut attempts = self.db.prepare(&sql)?.execute(params![before, most])?;
        // The parts of an order are counted by its attempts: it goes as a whole, once the last one is old.
        let mut rows = self.db.prepare(OLD_ORDERS)?;
        let old: Vec<i64> = rows
            .query_map(params![before, most], |row| row.get(0))?
            .collect::<Outcome<_>>()?;
        let (mut orders, mut left) = (0, most as usize);
        for id in old {
            let sql = "DELETE FROM attempt WHERE rowid IN (SELECT rowid FROM attempt WHERE parts_order = ?1 LIMIT ?2)";
            let gone = self.db.prepare(sql)?.execute(params![id, left as i64])?;
            (attempts, left) = (attempts + gone, left - gone);
            if left == 0 {
                // There may be more of it: the next time.
                break;
            }
            orders += self.db.execute("DELETE FROM parts_order WHERE id = ?1", [id])?;
        }
        // A content may be long: one at a time.
        let sql = "DELETE FROM program WHERE rowid = (SELECT rowid FROM program p
            WHERE NOT EXISTS (SELECT 1 FROM parts_order o WHERE o.sha256 = p.sha256) LIMIT 1)";
        let programs = self.db.execute(sql, [])?;
        let day = (before / 86_400.0).floor() as i64;
        let sql = format!("DELETE FROM time_used WHERE (machine, day, what) IN ({OLD_TIMES})");
        let times = self.db.prepare(&sql)?.execute(params![day, most])?;
        Ok(Pruned {
            entries,
            orders,
            attempts,
            programs,
            times,
        })
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
    fn what_is_old_goes_in_small_steps_and_what_is_open_stays() {
        const OLD: f64 = 10.0 * 86_400.0;
        let store = Store::open(Path::new(":memory:")).unwrap();
        store.add_machine("mill").unwrap();
        let entry = |seq: u64, unix_s: f64, kind: &str| {
            let entry =
                json!({"seq": seq, "unix_s": unix_s, "kind": kind, "text": "x", "alarm": {"acknowledged": null}});
            store.add_entry("mill", seq, &entry).unwrap();
        };
        entry(1, 1.0, "alarm");
        for seq in 2..=6 {
            entry(seq, 2.0, "note");
        }
        entry(7, OLD, "note");
        let attempt = |id: &str, order: Option<i64>, ended: Option<f64>| {
            let attempt = Attempt {
                id: id.into(),
                order,
                machine: "mill".into(),
                program: "p".into(),
                sha256: "s".into(),
                phase: Phase::Unknown,
                note: String::new(),
                sent_unix_s: 1.0,
                took_s: None,
            };
            store.add_attempt(&attempt).unwrap();
            if let Some(ended) = ended {
                let state = OrderState {
                    id: id.into(),
                    phase: Phase::Completed,
                    note: String::new(),
                    took_s: None,
                };
                store.set_attempt(&state, ended).unwrap();
            }
        };
        attempt("by-hand", None, Some(1.0));
        attempt("under-way", None, None);
        // Of each order: how it is, and when its attempts ended.
        let order = |name: &str, state: OrderIs, ended: &[Option<f64>]| {
            let id = store.add_order(&Wish::default(), name, 1.0).unwrap();
            store.add_program(name, b"G0").unwrap();
            store.set_order(id, state, "").unwrap();
            for (number, ended) in ended.iter().enumerate() {
                attempt(&format!("{name}-{number}"), Some(id), *ended);
            }
            id
        };
        order("gone", OrderIs::Done, &[Some(1.0); 7]);
        let kept = [
            order("open", OrderIs::Open, &[Some(1.0), Some(2.0)]),
            order("held", OrderIs::Held, &[Some(1.0)]),
            order("lately", OrderIs::Done, &[Some(1.0), Some(OLD)]),
            order("runs-on", OrderIs::Cancelled, &[Some(1.0), None]),
        ];
        store.add_program("sent", b"G1").unwrap();
        for day in [8, 9, 10] {
            store.add_time("mill", day, Use::Idle, 1.0).unwrap();
        }
        let before: Vec<PartsOrder> = store.orders(false).unwrap().into_iter().skip(1).collect();

        let (mut all, mut steps) = (Pruned::default(), 0);
        loop {
            let step = store.prune(OLD, 3).unwrap();
            assert!(step.entries <= 3 && step.attempts <= 6 && step.programs <= 1 && step.times <= 3);
            if step == Pruned::default() {
                break;
            }
            all += step;
            steps += 1;
        }
        let expected = Pruned {
            entries: 5,
            orders: 1,
            attempts: 8,
            programs: 2,
            times: 2,
        };
        assert_eq!((all, steps), (expected, 3));
        assert_eq!(store.orders(false).unwrap(), before);
        assert_eq!(before.iter().map(|order| order.id).collect::<Vec<_>>(), kept);
        let seqs = |entries: Vec<Value>| {
            entries
                .iter()
                .map(|entry| entry["seq"].as_u64().unwrap())
                .collect::<Vec<_>>()
        };
        assert_eq!(seqs(store.journal("mill", 0, 100).unwrap()), [1, 7]);
        assert_eq!(
            (store.alarms().unwrap().len(), store.machines().unwrap()[0].journal),
            (1, 7)
        );
        assert_eq!(store.open_attempts().unwrap().len(), 2);
        assert!(store.program("open").unwrap().is_some() && store.program("gone").unwrap().is_none());
        assert_eq!(store.times(0).unwrap().len(), 1);

        // Once it is acknowledged, the alarm goes as well.
        let by = json!({"seq": 8, "unix_s": OLD, "kind": "note", "text": "ack", "acknowledges": [[1], {"by": "x"}]});
        store.add_entry("mill", 8, &by).unwrap();
        assert_eq!(store.prune(OLD, 3).unwrap().entries, 1);
        assert_eq!(seqs(store.journal("mill", 0, 100).unwrap()), [7, 8]);
    }

    #[test]
    fn a_machine_that_tells_too_much_loses_its_own_oldest_entries_only() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cell.db");
        let store = Store::open(&file).unwrap();
        let octets = |store: &Store, machine: &str| -> (i64, i64) {
            let count = |sql: &str| store.db.query_row(sql, [machine], |row| row.get(0)).unwrap();
            (
                count("SELECT octets FROM machine WHERE name = ?1"),
                count("SELECT coalesce(sum(octet_length(entry)), 0) FROM journal WHERE machine = ?1"),
            )
        };
        for machine in ["loud", "calm"] {
            store.add_machine(machine).unwrap();
            for seq in 1..=100_u64 {
                let entry = json!({"seq": seq, "unix_s": 1.0, "kind": "alarm", "text": "ü".repeat(seq as usize)});
                store.add_entry(machine, seq, &entry).unwrap();
                store.add_entry(machine, seq, &entry).unwrap();
            }
            // Its state folder is another one: what it told before counts as well.
            store.begin_journal_anew(machine).unwrap();
            store.add_entry(machine, 1, &json!({"seq": 1})).unwrap();
        }
        let (counted, has) = octets(&store, "loud");
        assert!(counted == has && has > 10_000, "{counted} {has}");
        assert_eq!(store.keep_octets("loud", has).unwrap(), 0);
        assert_eq!(store.keep_octets("loud", 5_000).unwrap(), 79);
        let (counted, has) = octets(&store, "loud");
        assert!(counted == has && (4_700..=5_000).contains(&has), "{counted} {has}");
        // The newest one stays, of whatever book.
        assert_eq!(store.journal("loud", 0, 10).unwrap(), [json!({"seq": 1})]);
        assert_eq!(store.keep_octets("loud", 0).unwrap(), 22);
        assert_eq!(octets(&store, "loud"), (0, 0));
        assert_eq!(store.prune(2.0, 200).unwrap().entries, 101);
        assert_eq!(octets(&store, "calm"), (0, 0));
        // A store of before has no such column.
        store.add_entry("calm", 2, &json!({"seq": 2, "text": "x"})).unwrap();
        let counted = octets(&store, "calm");
        let before = "ALTER TABLE machine DROP COLUMN octets; PRAGMA user_version = 1;";
        store.db.execute_batch(before).unwrap();
        drop(store);
        assert_eq!(octets(&Store::open(&file).unwrap(), "calm"), counted);
    }

    #[test]
    fn what_is_old_is_found_without_a_look_at_all_that_is_young() {
        let store = Store::open(Path::new(":memory:")).unwrap();
        for (sql, index) in [
            (OLD_ENTRIES, "journal_age (unix_s<?)"),
            (OLD_ATTEMPTS, "attempt_age (ended_unix_s<?)"),
            (OLD_ORDERS, "order_age (created_unix_s<?)"),
            (OLD_TIMES, "time_age (day<?)"),
        ] {
            let plan: String = (store.db)
                .query_row(&format!("EXPLAIN QUERY PLAN {sql}"), params![1, 1], |row| row.get(3))
                .unwrap();
            assert!(plan.contains(index), "{plan}");
        }
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
