//! What a supervisor does, without a network and without a clock of its own.
//!
//! In:  what controls say, what people ask, the time. Out: questions to controls, answers to people; the store.
//!
//! Events come in batches. Each batch is one transaction: what it makes of the store is on the disk before any of its questions and
//! answers leave. Whatever a batch would have asked and a full disk undid is asked again: journals by their numbers, orders by their ids.
//!
//! An attempt has an id of its own and is in the store before it is sent; the control carries an id out once. So a supervisor that was
//! killed asks again with the same id, and hears what became of it.
//!
//! | to learn | file |
//! |---|---|
//! | what is known of a machine; what its control answers | `machine.rs`; `answers.rs` |
//! | which machine makes which part | `queue.rs` |
//! | what people ask and are shown | `people.rs` |

mod answers;
mod machine;
mod people;
mod queue;

pub use people::Ask;

use crate::store::{Attempt, Known, Pruned, Store};
use cell_link::message::{Envelope, Journal, Since, State, Topic};
use machine::Machine;
use serde_json::{Value, json};
use std::collections::{HashMap, HashSet};
use std::time::Duration;

/// A control that says nothing for so long is not there, s.
const SILENT_S: f64 = 5.0;
/// An order that was not answered is asked for again after so long, s.
const ASK_AGAIN_S: f64 = 5.0;
/// A machine that refused a run is left alone so long, s.
const REST_S: f64 = 10.0;
/// Failed attempts, one after the other, with which an order is held.
const FAILURES_MAX: usize = 3;
/// Times are written so often, s.
const TIMES_S: f64 = 10.0;
/// What is too old is looked for so often, s.
const PRUNE_S: f64 = 3600.0;
/// Where there was some, it goes on after so long, s, so many rows of each kind at a time: nobody waits for it.
const PRUNE_STEP_S: f64 = 0.2;
const PRUNE_ROWS: u32 = 500;
/// So long after two controls have spoken with one certificate, neither gets an order, s.
const DOUBLED_S: f64 = 10.0;
/// Uploads under way at the same time.
const UPLOADS_MAX: usize = 16;
/// Waits for answers.
const QUICK: Duration = Duration::from_secs(5);
const SLOW: Duration = Duration::from_secs(60);
/// Machines at the most.
const MACHINES_MAX: usize = 256;

/// A control gets orders once it was heard for so long, s: a second one with its certificate would have spoken meanwhile.
const SETTLED_S: f64 = 2.5;
/// Why one that was heard for a shorter time gets none.
const JUST_CAME: &str =
    "it has just come, and gets orders once nobody else speaks with its certificate for 3 s: try again";
/// Why there is no answer to a question, where the control has not said why itself.
pub(crate) const NO_ANSWER: &str = "no answer";
/// Why two controls with one certificate get no orders.
const DOUBLED: &str = "two controls speak with this certificate, and get no orders: each needs its own: isocnc-cell ca issue NAME --dir CA";

/// Somebody who waits for an answer.
pub type Reply = Box<dyn FnOnce(Result<Value, String>) + Send>;

/// What happens.
pub enum Event {
    /// A link is there, or has gone.
    Alive(String, bool),
    /// A control tells how it is.
    State(String, Box<State>),
    /// A control tells what has happened; or somebody asks for that.
    Journal(String, Journal),
    /// The answer to a question of this number; or why there is none.
    Answer(u64, Result<Vec<u8>, String>),
    /// Somebody was refused.
    Refused(String),
    /// Somebody asks.
    Ask(Ask, Reply),
}

/// A question to a control.
#[derive(Debug)]
pub struct Question {
    /// Number of the question.
    pub ticket: u64,
    /// Name of the machine.
    pub machine: String,
    /// What it is about.
    pub topic: Topic,
    /// What is said.
    pub payload: Vec<u8>,
    /// What is said beside it.
    pub attachment: Option<Vec<u8>>,
    /// Longest wait for the answer.
    pub wait: Duration,
}

/// What a question was for.
enum Asked {
    Journal(String),
    Described(String),
    Upload {
        machine: String,
        name: String,
        sha256: String,
        order: Option<i64>,
        reply: Option<Reply>,
    },
    /// A run or the state of an order: its attempt, and who waits.
    Attempt(String, String, Option<Reply>),
    /// Hold or stop of a machine.
    Passing(String, Reply),
}

/// The supervisor.
pub struct Core {
    store: Store,
    machines: HashMap<String, Machine>,
    /// What was asked, and until when there may be an answer.
    asked: HashMap<u64, (Asked, f64)>,
    now: f64,
    last_ticket: u64,
    said: u64,
    times_due_s: f64,
    /// For how long everything is kept, s; `None`: for ever.
    keep_s: Option<f64>,
    prune_due_s: f64,
    /// What is there no more since it was last told.
    pruned: Pruned,
    /// Orders may be open that nothing was decided about.
    is_queue_due: bool,
    /// What leaves with the end of the batch.
    questions: Vec<Question>,
    replies: Vec<(Reply, Result<Value, String>)>,
    ids: Box<dyn FnMut() -> String + Send>,
}

type Outcome<T> = rusqlite::Result<T>;

impl Core {
    /// A supervisor over a store; `ids` makes ids that nobody has had.
    ///
    /// # Errors
    /// The store cannot be read.
    pub fn new(store: Store, ids: Box<dyn FnMut() -> String + Send>) -> Outcome<Core> {
        let mut core = Core {
            store,
            machines: HashMap::new(),
            asked: HashMap::new(),
            now: 0.0,
            last_ticket: 0,
            said: 0,
            times_due_s: 0.0,
            keep_s: None,
            prune_due_s: 0.0,
            pruned: Pruned::default(),
            is_queue_due: true,
            questions: Vec::new(),
            replies: Vec::new(),
            ids,
        };
        core.reload()?;
        Ok(core)
    }

    /// What is older than so many days, and not open, is kept no longer; 0: everything is kept.
    pub fn keep_days(&mut self, days: u32) {
        self.keep_s = (days > 0).then_some(f64::from(days) * 86_400.0);
    }

    /// Makes what is known from the store again, as after a transaction that was undone.
    fn reload(&mut self) -> Outcome<()> {
        let mut open: HashMap<String, Attempt> = HashMap::new();
        for attempt in self.store.open_attempts()? {
            open.insert(attempt.machine.clone(), attempt);
        }
        let known = self.store.machines()?;
        // One that came in the transaction comes again; in memory alone, nothing of its journal would be kept.
        let names: HashSet<&str> = known.iter().map(|known| known.name.as_str()).collect();
        self.machines.retain(|name, _| names.contains(name.as_str()));
        for Known {
            name,
            class,
            described,
            journal,
        } in known
        {
            let attempt = open.remove(&name).map(|attempt| (attempt, 0.0));
            let machine = self.machines.entry(name).or_default();
            (machine.class, machine.journal, machine.attempt) = (class, journal, attempt);
            if !described.is_null() {
                machine.described = described;
            }
        }
        Ok(())
    }

    /// Takes events, and does what is due at `now` (s since 1970); gives questions to controls. Answers to people have left.
    pub fn take(&mut self, events: Vec<Event>, now: f64) -> Vec<Question> {
        self.now = now;
        let mut events = events.into_iter();
        let done = self.store.begin().and_then(|()| {
            for event in events.by_ref() {
                self.event(event, now)?;
            }
            self.due(now)?;
            self.store.commit()
        });
        let mut questions = std::mem::take(&mut self.questions);
        let mut replies = std::mem::take(&mut self.replies);
        if let Err(error) = done {
            self.store.roll_back();
            let error = error.to_string();
            tracing::error!("the store has not taken it: {error}");
            for event in events {
                match event {
                    Event::Ask(_, reply) => replies.push((reply, Err(String::new()))),
                    Event::Answer(ticket, _) => self.forget(ticket, &error),
                    // They come again.
                    Event::Alive(..) | Event::State(..) | Event::Journal(..) | Event::Refused(_) => {}
                }
            }
            for (_, answer) in &mut replies {
                *answer = Err(format!("the store has not taken it: {error}"));
            }
            for Question { ticket, .. } in questions.drain(..) {
                self.forget(ticket, &error);
            }
            if let Err(error) = self.reload() {
                tracing::error!("the store cannot be read: {error}");
            }
            self.is_queue_due = true;
        }
        for (reply, answer) in replies {
            reply(answer);
        }
        // Of its own: what it cannot do is to undo nothing else.
        self.prune(now);
        questions
    }

    /// One step of what is too old.
    fn prune(&mut self, now: f64) {
        let Some(keep_s) = self.keep_s.filter(|_| now >= self.prune_due_s) else {
            return;
        };
        let step = self.store.begin().and_then(|()| {
            let step = self.store.prune(now - keep_s, PRUNE_ROWS)?;
            self.store.commit()?;
            Ok(step)
        });
        self.prune_due_s = now + PRUNE_S;
        match step {
            Ok(step) if step == Pruned::default() => {
                let Pruned {
                    entries,
                    orders,
                    attempts,
                    programs,
                    times,
                } = std::mem::take(&mut self.pruned);
                // Contents alone are no news: no command tells of them.
                if entries + orders + attempts + times > 0 {
                    tracing::info!(
                        "older than {} days, and kept no longer: {entries} entries of journals, {orders} orders, {attempts} attempts, \
                         {programs} programs, {times} times of use",
                        keep_s / 86_400.0
                    );
                }
            }
            Ok(step) => {
                self.pruned += step;
                self.prune_due_s = now + PRUNE_STEP_S;
            }
            Err(error) => {
                self.store.roll_back();
                tracing::warn!("what is too old stays for now: {error}");
            }
        }
    }

    /// A question that does not leave.
    fn forget(&mut self, ticket: u64, why: &str) {
        let reply = match self.asked.remove(&ticket).map(|(asked, _)| asked) {
            Some(Asked::Journal(machine)) => {
                if let Some(machine) = self.machines.get_mut(&machine) {
                    machine.is_asked_journal = false;
                }
                None
            }
            Some(Asked::Described(machine)) => {
                if let Some(machine) = self.machines.get_mut(&machine) {
                    machine.is_asked_described = false;
                }
                None
            }
            Some(Asked::Upload { machine, reply, .. }) => {
                if let Some(machine) = self.machines.get_mut(&machine) {
                    machine.uploads = machine.uploads.saturating_sub(1);
                }
                reply
            }
            Some(Asked::Attempt(_, _, reply)) => reply,
            Some(Asked::Passing(_, reply)) => Some(reply),
            None => None,
        };
        if let Some(reply) = reply {
            reply(Err(format!("the store has not taken it: {why}")));
        }
    }

    fn ask<B: serde::Serialize>(&mut self, machine: &str, topic: Topic, body: B, asked: Asked) {
        let payload = self.say(body);
        self.question(machine, topic, payload, None, QUICK, asked);
    }

    fn say<B: serde::Serialize>(&mut self, body: B) -> Vec<u8> {
        self.said += 1;
        Envelope::new(self.said, body).to_octets()
    }

    fn question(
        &mut self,
        machine: &str,
        topic: Topic,
        payload: Vec<u8>,
        attachment: Option<Vec<u8>>,
        wait: Duration,
        asked: Asked,
    ) {
        self.last_ticket += 1;
        let until = self.now + wait.as_secs_f64() + ASK_AGAIN_S;
        self.asked.insert(self.last_ticket, (asked, until));
        self.questions.push(Question {
            ticket: self.last_ticket,
            machine: machine.to_owned(),
            topic,
            payload,
            attachment,
            wait,
        });
    }

    /// A machine by its name, which may be new here.
    fn machine(&mut self, name: &str) -> Outcome<Option<&mut Machine>> {
        if !self.machines.contains_key(name) {
            if self.machines.len() >= MACHINES_MAX {
                tracing::warn!(
                    "{name}: {MACHINES_MAX} machines are known, which are the most: isocnc-cell machines --forget NAME"
                );
                return Ok(None);
            }
            self.store.add_machine(name)?;
            self.machines.insert(name.to_owned(), Machine::default());
        }
        Ok(self.machines.get_mut(name))
    }

    fn event(&mut self, event: Event, now: f64) -> Outcome<()> {
        match event {
            // Of one that is off the list.
            Event::Alive(name, false) if !self.machines.contains_key(&name) => {}
            Event::Alive(name, is_alive) => {
                let Some(machine) = self.machine(&name)? else {
                    return Ok(());
                };
                machine.is_alive = is_alive;
                if is_alive {
                    // Its link is another one: what the earlier one was asked is asked again.
                    (machine.is_asked_journal, machine.is_asked_described) = (false, false);
                    machine.heard_s = now;
                    self.ask_described(&name);
                    self.ask_journal(&name);
                }
                self.is_queue_due = true;
            }
            Event::State(name, state) => self.state(&name, *state, now)?,
            Event::Journal(name, journal) => self.journal(&name, &journal)?,
            Event::Answer(ticket, answer) => self.answer(ticket, answer, now)?,
            Event::Refused(text) => self.refused(&text, now)?,
            Event::Ask(ask, reply) => {
                let mut reply = Some(reply);
                let answer = self.asked_by_people(ask, &mut reply, now);
                if let Some(reply) = reply {
                    let (answer, failed) = match answer {
                        Ok(answer) => (answer, Ok(())),
                        Err(error) => (Err(String::new()), Err(error)),
                    };
                    self.replies.push((reply, answer));
                    return failed;
                }
                // Who has taken the reply answers later.
                answer?.ok();
            }
        }
        Ok(())
    }

    fn refused(&self, text: &str, now: f64) -> Outcome<()> {
        tracing::warn!("refused: {text}");
        self.store.add_refusal(now, text)
    }

    fn ask_described(&mut self, name: &str) {
        let Some(machine) = self.machines.get_mut(name) else {
            return;
        };
        if !std::mem::replace(&mut machine.is_asked_described, true) {
            self.ask(name, Topic::Describe, json!({}), Asked::Described(name.to_owned()));
        }
    }

    fn ask_journal(&mut self, name: &str) {
        let Some(machine) = self.machines.get_mut(name) else {
            return;
        };
        if !std::mem::replace(&mut machine.is_asked_journal, true) {
            let since = machine.journal;
            self.ask(name, Topic::Journal, Since { since }, Asked::Journal(name.to_owned()));
        }
    }

    fn state(&mut self, name: &str, mut state: State, now: f64) -> Outcome<()> {
        let Some(machine) = self.machine(name)? else {
            return Ok(());
        };
        let mut refusal = None;
        if state.boot != machine.state.boot {
            let before = std::mem::replace(&mut machine.boot_before, machine.state.boot);
            machine.boot_since_s = now;
            if before == state.boot {
                refusal = (now >= machine.doubled_until_s).then(|| format!("{name}: {DOUBLED}"));
                machine.doubled_until_s = now + DOUBLED_S;
            }
        }
        if let Some(why) = machine.gets_no_orders(now) {
            (state.is_ready, state.why_not) = (false, Some(why.into()));
        }
        machine.count_time(now);
        machine.is_alive = true;
        machine.heard_s = now;
        let is_behind = state.journal > machine.journal;
        let became_ready = state.is_ready && !machine.state.is_ready;
        if state.boot != machine.state.boot {
            // Another machine file may have come with it.
            machine.unfit.clear();
            machine.is_asked_described = false;
        }
        let needs_description = !machine.is_asked_described;
        let order = state.order.clone();
        machine.state = state;
        self.is_queue_due |= became_ready;
        if needs_description {
            self.ask_described(name);
        }
        if is_behind {
            self.ask_journal(name);
        }
        if let Some(text) = refusal {
            self.refused(&text, now)?;
        }
        match order {
            Some(order) => self.attempt_is(name, &order, now),
            None => Ok(()),
        }
    }

    fn journal(&mut self, name: &str, journal: &Journal) -> Outcome<()> {
        let now = self.now;
        let Some(machine) = self.machine(name)?.filter(|machine| now >= machine.doubled_until_s) else {
            return Ok(());
        };
        if journal.last < machine.journal && journal.since == machine.journal {
            tracing::warn!("{name}: its journal begins anew, as its state folder is another one");
            machine.journal = 0;
            self.store.begin_journal_anew(name)?;
            self.ask_journal(name);
            return Ok(());
        }
        if journal.since > machine.journal {
            // Some were lost on the way.
            self.ask_journal(name);
            return Ok(());
        }
        let mut last = machine.journal;
        for entry in &journal.entries {
            // The store has no greater numbers than those of i64.
            let seq = entry["seq"].as_i64().and_then(|seq| u64::try_from(seq).ok());
            let Some(seq) = seq.filter(|seq| *seq > last) else {
                continue;
            };
            self.store.add_entry(name, seq, entry)?;
            last = seq;
        }
        let gone = self.store.keep_share(name)?;
        let machine = self.machines.entry(name.to_owned()).or_default();
        if gone > 0 && !std::mem::replace(&mut machine.is_share_told, true) {
            tracing::warn!("{name}: its journal here is longer than 256 MiB: the oldest entries go from now on");
        }
        // What an empty answer says there is more of would be asked for without end.
        let is_further = last > machine.journal;
        machine.journal = last;
        if journal.more && is_further {
            self.ask_journal(name);
        }
        Ok(())
    }

    fn due(&mut self, now: f64) -> Outcome<()> {
        // Where answers come too fast, some are dropped.
        let lost = |(ticket, (_, until)): (&u64, &(Asked, f64))| (now > *until).then_some(*ticket);
        let lost: Vec<u64> = self.asked.iter().filter_map(lost).collect();
        for ticket in lost {
            self.answer(ticket, Err(NO_ANSWER.into()), now)?;
        }
        self.ask_again(now)?;
        if now >= self.times_due_s {
            self.times_due_s = now + TIMES_S;
            self.is_queue_due = true;
            let day = (now / 86_400.0).floor() as i64;
            for (name, machine) in &mut self.machines {
                machine.count_time(now);
                for (what, seconds) in machine.time.drain() {
                    self.store.add_time(name, day, what, seconds)?;
                }
            }
        }
        if std::mem::take(&mut self.is_queue_due) {
            self.plan_queue(now)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
