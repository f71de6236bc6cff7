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
//! | which machine makes which part | `queue.rs` |
//! | what people ask and are shown | `people.rs` |

mod people;
mod queue;

pub use people::Ask;

use crate::store::{Attempt, Known, Pruned, Store};
use cell_link::message::{Envelope, Journal, OrderState, Phase, Since, State, Stored, Topic, Use};
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

/// What is known of a machine while the supervisor runs.
#[derive(Default)]
struct Machine {
    class: String,
    described: Value,
    journal: u64,
    is_alive: bool,
    state: State,
    /// The run of its control before the one of `state`; where that speaks again, there are two of them, until then.
    boot_before: u64,
    doubled_until_s: f64,
    /// When the run of `state` was first heard.
    boot_since_s: f64,
    heard_s: f64,
    is_asked_journal: bool,
    is_asked_described: bool,
    is_share_told: bool,
    uploads: usize,
    /// Its attempt that is not over, and when it was last asked about.
    attempt: Option<(Attempt, f64)>,
    /// Orders that it cannot carry out, and why; orders that it is left alone with until then.
    unfit: HashMap<i64, String>,
    rests_until_s: f64,
    counted_until_s: f64,
    time: HashMap<Use, f64>,
}

impl Machine {
    fn is_there(&self, now: f64) -> bool {
        self.is_alive && now - self.heard_s < SILENT_S
    }

    /// Why it gets no orders: it is not known yet whether its certificate is its own, or it is not.
    fn gets_no_orders(&self, now: f64) -> Option<&'static str> {
        if now < self.doubled_until_s {
            return Some(DOUBLED);
        }
        (now - self.boot_since_s < SETTLED_S).then_some(JUST_CAME)
    }

    /// The run of its control that is meant by an order; `None`: it has not spoken yet.
    fn boot(&self) -> Option<u64> {
        (self.heard_s > 0.0 && self.state.boot != 0).then_some(self.state.boot)
    }
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

    fn answer(&mut self, ticket: u64, answer: Result<Vec<u8>, String>, now: f64) -> Outcome<()> {
        fn read<B: serde::de::DeserializeOwned>(answer: Result<Vec<u8>, String>) -> Result<B, String> {
            let envelope = Envelope::from_octets(&answer?).map_err(|bad| bad.to_string())?;
            Ok(envelope.body)
        }
        let Some((asked, _)) = self.asked.remove(&ticket) else {
            return Ok(());
        };
        match asked {
            Asked::Journal(name) => {
                if let Some(machine) = self.machines.get_mut(&name) {
                    machine.is_asked_journal = false;
                }
                match read(answer) {
                    Ok(journal) => self.journal(&name, &journal)?,
                    Err(why) => tracing::debug!("{name}: journal: {why}"),
                }
            }
            Asked::Described(name) => match read::<Value>(answer) {
                Ok(described) => {
                    self.store.set_described(&name, &described)?;
                    if let Some(machine) = self.machines.get_mut(&name) {
                        machine.described = described;
                        machine.unfit.clear();
                    }
                    self.is_queue_due = true;
                }
                Err(why) => {
                    tracing::debug!("{name}: description: {why}");
                    if let Some(machine) = self.machines.get_mut(&name) {
                        machine.is_asked_described = false;
                    }
                }
            },
            Asked::Upload {
                machine,
                name,
                sha256,
                order,
                reply,
            } => {
                let outlook = read::<Stored>(answer).map(|stored| stored.outlook);
                if let Some(known) = self.machines.get_mut(&machine) {
                    known.uploads = known.uploads.saturating_sub(1);
                    match (&outlook, order) {
                        (Ok(Err(why)), Some(order)) => _ = known.unfit.insert(order, why.clone()),
                        (Err(_), Some(_)) => known.rests_until_s = now + REST_S,
                        _ => {}
                    }
                }
                let outlook = outlook.and_then(|outlook| outlook);
                if outlook.is_ok() {
                    self.store.set_stored(&machine, &name, Some(&sha256))?;
                }
                self.is_queue_due = true;
                if let Some(reply) = reply {
                    let answer = outlook.map_err(|why| in_words(&machine, why)).map(
                        |outlook| json!({ "machine": machine, "program": name, "sha256": sha256, "outlook": outlook }),
                    );
                    self.replies.push((reply, answer));
                }
            }
            Asked::Attempt(machine, id, reply) => {
                let state = read::<OrderState>(answer);
                if let Ok(state) = &state {
                    let unknown = state.phase == Phase::Unknown && state.id == id;
                    let is_cancelled = unknown && !self.is_wanted(&id)?;
                    match is_cancelled {
                        // It never came there, and nobody wants it any more.
                        true => {
                            let never = OrderState {
                                phase: Phase::Refused,
                                note: "cancelled before it was sent".into(),
                                ..state.clone()
                            };
                            self.attempt_is(&machine, &never, now)?;
                        }
                        false => self.attempt_is(&machine, state, now)?,
                    }
                }
                if let Some(reply) = reply {
                    let answer = match state {
                        Ok(state) if state.phase == Phase::Refused => Err(format!("{machine} refuses: {}", state.note)),
                        Ok(state) => Ok(json!({ "id": state.id, "phase": state.phase, "note": state.note })),
                        Err(why) => Err(format!(
                            "{machine} has not answered ({why}); the order stands, as {id}: isocnc-cell queue"
                        )),
                    };
                    self.replies.push((reply, answer));
                }
            }
            Asked::Passing(machine, reply) => {
                let state = read::<OrderState>(answer).map_err(|why| in_words(&machine, why));
                let answer = state.and_then(|state| match state.phase {
                    Phase::Completed => Ok(json!({})),
                    _ => Err(state.note),
                });
                self.replies.push((reply, answer));
            }
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

/// Why an order of people came to nothing.
fn in_words(machine: &str, why: String) -> String {
    match why == NO_ANSWER {
        true => format!(
            "{machine} has not answered, and may not have got it: isocnc-cell machines tells whether it is reached"
        ),
        false => why,
    }
}

impl Machine {
    /// Adds the time since the last look to what it was spent on; what nothing was heard of is unknown.
    fn count_time(&mut self, now: f64) {
        let since = std::mem::replace(&mut self.counted_until_s, now);
        if since == 0.0 || now <= since {
            return;
        }
        let heard = match self.is_there(now) {
            true => now,
            false => self.heard_s.clamp(since, now),
        };
        for (what, seconds) in [(self.state.use_of_time(), heard - since), (Use::Unknown, now - heard)] {
            if seconds > 0.0 {
                *self.time.entry(what).or_default() += seconds;
            }
        }
    }
}

#[cfg(test)]
mod tests;
