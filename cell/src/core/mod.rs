//! What a supervisor does, without a network and without a clock of its own.
//!
//! In:  what controls say, what people ask, the time. Out: questions to controls, answers to people; the store.
//!
//! Events come in batches. Each batch is one transaction: what it makes of the store is on the disk before any of its questions and
//! answers leave. Whatever a batch would have asked and a full disk undid is asked again: journals by their numbers, orders by their ids.
//!
//! An attempt has an id of its own and is in the store before it is sent; the control carries an id out once. So a supervisor that was
//! killed asks again with the same id, and hears what became of it.

use crate::store::{Attempt, Known, OrderIs, PartsOrder, Store, Wish};
use cell_link::message::{
    Envelope, Journal, Order, OrderState, Phase, Remote, Since, State, Stored, Topic, Upload, Use, What, is_program,
};
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
/// Uploads under way at the same time.
const UPLOADS_MAX: usize = 16;
/// Waits for answers.
const QUICK: Duration = Duration::from_secs(5);
const SLOW: Duration = Duration::from_secs(60);
/// Machines at the most.
const MACHINES_MAX: usize = 256;

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

/// What somebody asks.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ask {
    /// All machines.
    Machines,
    /// Says which class a machine is of.
    SetClass {
        /// Name of the machine.
        machine: String,
        /// Name of the class.
        class: String,
    },
    /// Sends a program to a machine.
    Upload {
        /// Name of the machine.
        machine: String,
        /// Name of the program.
        name: String,
        #[serde(skip)]
        /// Its content.
        content: Vec<u8>,
    },
    /// Runs a program that was sent.
    RunProgram {
        /// Name of the machine.
        machine: String,
        /// Name of the program.
        program: String,
    },
    /// Holds what runs.
    Hold {
        /// Name of the machine.
        machine: String,
    },
    /// Gives up what runs.
    Stop {
        /// Name of the machine.
        machine: String,
    },
    /// A control tells what has happened; or somebody asks for that.
    Journal {
        /// Name of the machine.
        machine: String,
        /// Entries behind this number.
        since: u64,
    },
    /// Orders of parts.
    Queue,
    /// Orders parts.
    Add {
        /// What is wanted.
        wish: Wish,
        #[serde(skip)]
        /// Its content.
        content: Vec<u8>,
    },
    /// No further part of an order is begun.
    Cancel {
        /// Number of the order.
        order: i64,
    },
    /// Tries a held order again.
    Resume {
        /// Number of the order.
        order: i64,
    },
    /// All that the page shows.
    Overview,
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
    /// Hold or stop.
    Passing(Reply),
}

/// What is known of a machine while the supervisor runs.
#[derive(Default)]
struct Machine {
    class: String,
    described: Value,
    journal: u64,
    is_alive: bool,
    state: State,
    heard_s: f64,
    is_asked_journal: bool,
    is_asked_described: bool,
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
}

/// The supervisor.
pub struct Core {
    store: Store,
    machines: HashMap<String, Machine>,
    asked: HashMap<u64, Asked>,
    last_ticket: u64,
    said: u64,
    times_due_s: f64,
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
            last_ticket: 0,
            said: 0,
            times_due_s: 0.0,
            is_queue_due: true,
            questions: Vec::new(),
            replies: Vec::new(),
            ids,
        };
        core.reload()?;
        Ok(core)
    }

    /// Makes what is known from the store again, as after a transaction that was undone.
    fn reload(&mut self) -> Outcome<()> {
        let mut open: HashMap<String, Attempt> = HashMap::new();
        for attempt in self.store.open_attempts()? {
            open.insert(attempt.machine.clone(), attempt);
        }
        for Known {
            name,
            class,
            described,
            journal,
        } in self.store.machines()?
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
        questions
    }

    /// A question that does not leave.
    fn forget(&mut self, ticket: u64, why: &str) {
        let reply = match self.asked.remove(&ticket) {
            Some(Asked::Journal(machine)) => {
                self.machines.entry(machine).or_default().is_asked_journal = false;
                None
            }
            Some(Asked::Described(machine)) => {
                self.machines.entry(machine).or_default().is_asked_described = false;
                None
            }
            Some(Asked::Upload { machine, reply, .. }) => {
                let machine = self.machines.entry(machine).or_default();
                machine.uploads = machine.uploads.saturating_sub(1);
                reply
            }
            Some(Asked::Attempt(_, _, reply)) => reply,
            Some(Asked::Passing(reply)) => Some(reply),
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
        self.asked.insert(self.last_ticket, asked);
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
                tracing::warn!("{name}: {MACHINES_MAX} machines are known, which are the most");
                return Ok(None);
            }
            self.store.add_machine(name)?;
            self.machines.insert(name.to_owned(), Machine::default());
        }
        Ok(self.machines.get_mut(name))
    }

    fn event(&mut self, event: Event, now: f64) -> Outcome<()> {
        match event {
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
            Event::Refused(text) => self.store.add_refusal(now, &text)?,
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

    fn state(&mut self, name: &str, state: State, now: f64) -> Outcome<()> {
        let Some(machine) = self.machine(name)? else {
            return Ok(());
        };
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
        match order {
            Some(order) => self.attempt_is(name, &order, now),
            None => Ok(()),
        }
    }

    /// What a control says of an order.
    fn attempt_is(&mut self, name: &str, state: &OrderState, now: f64) -> Outcome<()> {
        let Some(machine) = self.machines.get_mut(name) else {
            return Ok(());
        };
        let Some((attempt, asked_s)) = &mut machine.attempt else {
            return Ok(());
        };
        if attempt.id != state.id {
            return Ok(());
        }
        *asked_s = now;
        if attempt.phase == state.phase {
            return Ok(());
        }
        attempt.phase = state.phase;
        self.store.set_attempt(state, now)?;
        if !state.phase.is_over() {
            return Ok(());
        }
        let Attempt { order, program, .. } = attempt.clone();
        machine.attempt = None;
        if state.phase == Phase::Refused {
            machine.rests_until_s = now + REST_S;
            // The machine may have lost it: the next try sends it again.
            if order.is_some() {
                self.store.set_stored(name, &program, None)?;
            }
        }
        self.is_queue_due = true;
        match order {
            Some(order) => self.settle(order),
            None => Ok(()),
        }
    }

    /// Ends an order that has all its parts, and holds one that fails again and again.
    fn settle(&mut self, id: i64) -> Outcome<()> {
        let Some(order) = self.store.orders(true)?.into_iter().find(|order| order.id == id) else {
            return Ok(());
        };
        if order.completed >= order.wish.count {
            self.store.set_order(id, OrderIs::Done, "")?;
            return Ok(());
        }
        let last = self.store.attempts_of(id, FAILURES_MAX as u32)?;
        let has_failed = |attempt: &Attempt| matches!(attempt.phase, Phase::Failed | Phase::Interrupted);
        if last.len() == FAILURES_MAX && last.iter().all(has_failed) {
            let note = format!(
                "{FAILURES_MAX} attempts failed one after the other, the last one: {}",
                last[0].note
            );
            self.store.set_order(id, OrderIs::Held, &note)?;
        }
        Ok(())
    }

    fn journal(&mut self, name: &str, journal: &Journal) -> Outcome<()> {
        let Some(machine) = self.machine(name)? else {
            return Ok(());
        };
        if journal.since > machine.journal {
            // Some were lost on the way.
            self.ask_journal(name);
            return Ok(());
        }
        let mut last = machine.journal;
        for entry in &journal.entries {
            let Some(seq) = entry["seq"].as_u64().filter(|seq| *seq > last) else {
                continue;
            };
            self.store.add_entry(name, seq, entry)?;
            last = seq;
        }
        let machine = self.machines.entry(name.to_owned()).or_default();
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
        let Some(asked) = self.asked.remove(&ticket) else {
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
                    let answer = outlook.map(
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
            Asked::Passing(reply) => {
                let answer = read::<OrderState>(answer).and_then(|state| match state.phase {
                    Phase::Completed => Ok(json!({})),
                    _ => Err(state.note),
                });
                self.replies.push((reply, answer));
            }
        }
        Ok(())
    }

    /// Whether an attempt may still begin: its order is open, or it has none.
    fn is_wanted(&self, id: &str) -> Outcome<bool> {
        let attempt = self.store.open_attempts()?.into_iter().find(|attempt| attempt.id == id);
        let Some(order) = attempt.and_then(|attempt| attempt.order) else {
            return Ok(true);
        };
        Ok(self.store.orders(true)?.iter().any(|open| open.id == order))
    }

    /// The answer; or nothing that counts, where the reply is taken for later.
    fn asked_by_people(&mut self, ask: Ask, reply: &mut Option<Reply>, now: f64) -> Outcome<Result<Value, String>> {
        let answer = match ask {
            Ask::Machines => Ok(json!({ "machines": self.shown_machines(now) })),
            Ask::SetClass { machine, class } => match self.store.set_class(&machine, &class)? {
                0 => Err(unknown(&machine)),
                _ => {
                    self.machines.entry(machine).or_default().class = class;
                    self.is_queue_due = true;
                    Ok(json!({}))
                }
            },
            Ask::Upload { machine, name, content } => {
                let upload = Upload::of(&name, &content);
                match upload.verify(&content).and_then(|()| self.there(&machine, now)) {
                    Ok(()) => {
                        self.store.add_program(&upload.sha256, &content)?;
                        self.upload(&machine, &upload, content, None, reply.take());
                        Ok(Value::Null)
                    }
                    Err(why) => Err(why),
                }
            }
            Ask::RunProgram { machine, program } => {
                let stored = self.store.stored(&machine, &program)?;
                let busy = self.machines.get(&machine).and_then(|machine| machine.attempt.as_ref());
                match (self.there(&machine, now), stored, busy) {
                    (Err(why), ..) => Err(why),
                    (_, None, _) => Err(format!(
                        "{machine} has no {program} from here: isocnc-cell upload {machine} FILE"
                    )),
                    (.., Some((attempt, _))) => Err(format!("{machine} has an order already: {}", attempt.id)),
                    (Ok(()), Some(sha256), None) => {
                        self.run(&machine, &program, &sha256, None, reply, now)?;
                        Ok(Value::Null)
                    }
                }
            }
            Ask::Hold { machine } => self.pass(&machine, What::Hold, reply, now),
            Ask::Stop { machine } => self.pass(&machine, What::Stop, reply, now),
            Ask::Journal { machine, since } => match self.machines.contains_key(&machine) {
                true => Ok(json!({ "machine": machine, "entries": self.store.journal(&machine, since, 500)? })),
                false => Err(unknown(&machine)),
            },
            Ask::Queue => Ok(json!({ "orders": self.shown_orders()?, "attempts": self.store.history(50)? })),
            Ask::Add { wish, content } => match check(&wish) {
                Ok(()) => {
                    let upload = Upload::of(&wish.program, &content);
                    match upload.verify(&content) {
                        Ok(()) => {
                            self.store.add_program(&upload.sha256, &content)?;
                            let order = self.store.add_order(&wish, &upload.sha256, now)?;
                            self.is_queue_due = true;
                            Ok(json!({ "order": order }))
                        }
                        Err(why) => Err(why),
                    }
                }
                Err(why) => Err(why),
            },
            Ask::Cancel { order } => self.change(order, OrderIs::Cancelled, &[OrderIs::Open, OrderIs::Held])?,
            Ask::Resume { order } => self.change(order, OrderIs::Open, &[OrderIs::Held])?,
            Ask::Overview => Ok(self.overview(now)?),
        };
        Ok(answer)
    }

    fn change(&mut self, id: i64, to: OrderIs, from: &[OrderIs]) -> Outcome<Result<Value, String>> {
        let Some(order) = self.store.orders(false)?.into_iter().find(|order| order.id == id) else {
            return Ok(Err(format!("there is no order {id}: isocnc-cell queue")));
        };
        if !from.contains(&order.state) {
            return Ok(Err(format!("order {id} is {}", serde_json::json!(order.state))));
        }
        self.store.set_order(id, to, "")?;
        for machine in self.machines.values_mut() {
            machine.unfit.remove(&id);
        }
        self.is_queue_due = true;
        Ok(Ok(json!({ "order": id })))
    }

    fn there(&self, name: &str, now: f64) -> Result<(), String> {
        match self.machines.get(name) {
            None => Err(unknown(name)),
            Some(machine) if machine.is_there(now) => Ok(()),
            Some(_) => Err(format!("{name} is not reached; it works on alone")),
        }
    }

    fn pass(&mut self, name: &str, what: What, reply: &mut Option<Reply>, now: f64) -> Result<Value, String> {
        self.there(name, now)?;
        if let Some(reply) = reply.take() {
            let id = (self.ids)();
            self.ask(name, Topic::Order, Order { id, what }, Asked::Passing(reply));
        }
        Ok(Value::Null)
    }

    fn upload(&mut self, machine: &str, upload: &Upload, content: Vec<u8>, order: Option<i64>, reply: Option<Reply>) {
        if let Some(known) = self.machines.get_mut(machine) {
            known.uploads += 1;
        }
        let attachment = self.say(upload);
        let asked = Asked::Upload {
            machine: machine.to_owned(),
            name: upload.name.clone(),
            sha256: upload.sha256.clone(),
            order,
            reply,
        };
        self.question(machine, Topic::Program, content, Some(attachment), SLOW, asked);
    }

    fn run(
        &mut self,
        machine: &str,
        program: &str,
        sha256: &str,
        order: Option<i64>,
        reply: &mut Option<Reply>,
        now: f64,
    ) -> Outcome<()> {
        let attempt = Attempt {
            id: (self.ids)(),
            order,
            machine: machine.to_owned(),
            program: program.to_owned(),
            sha256: sha256.to_owned(),
            phase: Phase::Unknown,
            note: String::new(),
            sent_unix_s: now,
            took_s: None,
        };
        self.store.add_attempt(&attempt)?;
        self.send_run(&attempt, reply.take());
        if let Some(known) = self.machines.get_mut(machine) {
            known.attempt = Some((attempt, now));
        }
        Ok(())
    }

    fn send_run(&mut self, attempt: &Attempt, reply: Option<Reply>) {
        let order = Order {
            id: attempt.id.clone(),
            what: What::Run {
                program: attempt.program.clone(),
                sha256: attempt.sha256.clone(),
            },
        };
        let payload = self.say(order);
        let asked = Asked::Attempt(attempt.machine.clone(), attempt.id.clone(), reply);
        self.question(&attempt.machine, Topic::Run, payload, None, SLOW, asked);
    }

    fn due(&mut self, now: f64) -> Outcome<()> {
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

    /// Asks about attempts of which nothing was heard for a while.
    fn ask_again(&mut self, now: f64) -> Outcome<()> {
        let under_way: HashSet<&String> = (self.asked.values())
            .filter_map(|asked| match asked {
                Asked::Attempt(_, id, _) => Some(id),
                _ => None,
            })
            .collect();
        let mut silent = Vec::new();
        for machine in self.machines.values() {
            if let Some((attempt, asked_s)) = &machine.attempt
                && machine.is_there(now)
                && now - asked_s > ASK_AGAIN_S
                && !under_way.contains(&attempt.id)
            {
                silent.push(attempt.clone());
            }
        }
        for attempt in silent {
            if let Some((_, asked_s)) = self
                .machines
                .get_mut(&attempt.machine)
                .and_then(|machine| machine.attempt.as_mut())
            {
                *asked_s = now;
            }
            if attempt.phase == Phase::Unknown && self.is_wanted(&attempt.id)? {
                // The same id: a control that has carried it out says how it went.
                self.send_run(&attempt, None);
            } else {
                let asked = Asked::Attempt(attempt.machine.clone(), attempt.id.clone(), None);
                let order = Order {
                    id: attempt.id,
                    what: What::Status,
                };
                self.ask(&attempt.machine, Topic::Order, order, asked);
            }
        }
        Ok(())
    }

    /// Gives open orders to machines that are free and fit.
    fn plan_queue(&mut self, now: f64) -> Outcome<()> {
        for order in self.store.orders(true)? {
            let mut missing = order.wish.count.saturating_sub(order.completed + order.under_way) as usize;
            missing = missing.saturating_sub(self.uploads_of(order.id));
            let mut names: Vec<&String> = self.machines.keys().collect();
            names.sort();
            let free: Vec<String> = (names.into_iter())
                .filter(|name| self.machines[*name].takes(&order, now))
                .cloned()
                .collect();
            for name in free {
                if missing == 0 {
                    break;
                }
                let has = self.store.stored(&name, &order.wish.program)?;
                if has.as_ref() == Some(&order.sha256) {
                    self.run(
                        &name,
                        &order.wish.program,
                        &order.sha256,
                        Some(order.id),
                        &mut None,
                        now,
                    )?;
                } else if self.machines.values().map(|machine| machine.uploads).sum::<usize>() < UPLOADS_MAX {
                    let Some(content) = self.store.program(&order.sha256)? else {
                        continue;
                    };
                    let upload = Upload::of(&order.wish.program, &content);
                    self.upload(&name, &upload, content, Some(order.id), None);
                }
                missing -= 1;
            }
        }
        Ok(())
    }

    fn uploads_of(&self, id: i64) -> usize {
        let of = |asked: &&Asked| matches!(asked, Asked::Upload { order: Some(order), .. } if *order == id);
        self.asked.values().filter(of).count()
    }

    fn shown_orders(&self) -> Outcome<Vec<Value>> {
        let orders = self.store.orders(false)?;
        let shown = orders.into_iter().rev().take(200).map(|order| {
            let why: Vec<Value> = (self.machines.iter())
                .filter_map(|(name, machine)| {
                    let why = machine.unfit.get(&order.id).cloned().or(machine.lacks(&order))?;
                    Some(json!({ "machine": name, "why": why }))
                })
                .collect();
            let mut shown = json!(order);
            shown["unfit"] = json!(why);
            shown
        });
        Ok(shown.collect())
    }

    fn shown_machines(&self, now: f64) -> Vec<Value> {
        let mut all: Vec<(&String, &Machine)> = self.machines.iter().collect();
        all.sort_by_key(|(name, _)| *name);
        all.into_iter()
            .map(|(name, machine)| {
                json!({
                    "name": name,
                    "class": machine.class,
                    "alive": machine.is_there(now),
                    "silent_s": (machine.heard_s > 0.0).then(|| (now - machine.heard_s).max(0.0)),
                    "use": if machine.is_there(now) { machine.state.use_of_time() } else { Use::Unknown }.word(),
                    "state": machine.state,
                    "journal": machine.journal,
                    "attempt": machine.attempt.as_ref().map(|(attempt, _)| attempt),
                    "panel": machine.described["panel"],
                })
            })
            .collect()
    }

    fn overview(&self, now: f64) -> Outcome<Value> {
        let day = (now / 86_400.0).floor() as i64;
        let alarms = self.store.alarms()?.into_iter().map(
            |(machine, seq, unix_s, text)| json!({ "machine": machine, "seq": seq, "unix_s": unix_s, "text": text }),
        );
        let times = self.store.times(day - 6)?.into_iter().map(
            |(machine, day, what, seconds)| json!({ "machine": machine, "day": day, "what": what, "seconds": seconds }),
        );
        let refusals = self.store.refusals(20)?.into_iter();
        Ok(json!({
            "unix_s": now,
            "machines": self.shown_machines(now),
            "alarms": alarms.collect::<Vec<Value>>(),
            "orders": self.shown_orders()?,
            "attempts": self.store.history(50)?,
            "times": times.collect::<Vec<Value>>(),
            "refusals": refusals.map(|(unix_s, text)| json!({ "unix_s": unix_s, "text": text })).collect::<Vec<Value>>(),
        }))
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

    /// Whether it is free for an order.
    fn takes(&self, order: &PartsOrder, now: f64) -> bool {
        self.is_there(now)
            && self.state.is_ready
            && self.state.remote == Remote::Run
            && self.attempt.is_none()
            && self.uploads == 0
            && now >= self.rests_until_s
            && !self.unfit.contains_key(&order.id)
            && self.lacks(order).is_none()
    }

    /// What it lacks for an order, as far as its description tells.
    fn lacks(&self, order: &PartsOrder) -> Option<String> {
        let wish = &order.wish;
        if !wish.class.is_empty() && wish.class != self.class {
            return Some(format!("is of class {:?}", self.class));
        }
        let axes = self.described["machine"]["axes"].as_array();
        let axis = |letter: char| {
            let is = |axis: &&Value| axis["axis"].as_str() == Some(letter.to_string().as_str());
            axes.into_iter().flatten().find(is)
        };
        if let Some(letter) = wish.axes.chars().find(|letter| axis(*letter).is_none()) {
            return Some(format!("has no axis {letter}"));
        }
        for (letter, wanted) in &wish.travel {
            let travel = axis(*letter).and_then(|axis| Some(axis["travel"][1].as_f64()? - axis["travel"][0].as_f64()?));
            match travel {
                Some(travel) if travel >= *wanted => {}
                Some(travel) => return Some(format!("travel of {letter} is {travel}, {wanted} is wanted")),
                None => return Some(format!("travel of {letter} is not known")),
            }
        }
        let tools = self.described["tools"]["tools"].as_array();
        let has = |number: &u32| tools.into_iter().flatten().any(|tool| tool["tool"] == *number);
        wish.tools
            .iter()
            .find(|number| !has(number))
            .map(|number| format!("has no tool {number}"))
    }
}

fn unknown(machine: &str) -> String {
    format!("there is no machine {machine:?}: isocnc-cell machines")
}

/// Whether an order can be.
fn check(wish: &Wish) -> Result<(), String> {
    if !is_program(&wish.program) {
        return Err(format!("{:?} cannot name a program", wish.program));
    }
    if !(1..=100_000).contains(&wish.count) {
        return Err(format!("{} parts: 1 to 100000 can be ordered", wish.count));
    }
    let is_axis = |letter: char| "XYZABCUVW".contains(letter);
    if let Some(letter) = wish
        .axes
        .chars()
        .chain(wish.travel.iter().map(|(letter, _)| *letter))
        .find(|letter| !is_axis(*letter))
    {
        return Err(format!("{letter:?} is no axis: X Y Z A B C U V W"));
    }
    if let Some((letter, travel)) = wish.travel.iter().find(|(_, travel)| !(0.0..=1e6).contains(travel)) {
        return Err(format!("travel of {letter}: {travel} must be 0 to 1e6"));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
