//! The network: what comes from controls as events, questions to them.
//!
//! In:  a session. Out: events into a bounded queue, which drops and counts what does not fit: states come again, journals are asked
//! for by number, and a question without an answer is asked again. It is bounded by events and by octets.

use crate::ca::{Ca, CaError};
use crate::core::{Event, NO_ANSWER, Question};
use cell_link::carrier::{self, CarrierError, Identity};
use cell_link::message::{BadMessage, Envelope, Journal, State, Topic, parse_key};
use cell_link::zenoh::qos::Priority;
use cell_link::zenoh::sample::{Sample, SampleKind};
use cell_link::zenoh::{self, Session, Wait};
use nix::errno::Errno;
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant, SystemTime};
use tracing::field::{Field, Visit};
use tracing::{Level, Metadata, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// Events that wait.
const EVENTS: usize = 65_536;
/// Octets that the messages of controls among them have come in.
const EVENTS_OCTETS: usize = 64 << 20;
/// Of these, what one machine may have: one that talks without end takes nothing away from the others.
const EVENTS_OF_ONE: usize = 1024;
const OCTETS_OF_ONE: usize = EVENTS_OCTETS / 4;

/// Why there is no network.
#[derive(Debug, thiserror::Error)]
pub enum NetError {
    #[error(transparent)]
    /// The authority.
    Ca(#[from] CaError),
    #[error(transparent)]
    /// Certificates or the session.
    Carrier(#[from] CarrierError),
    #[error("{0}")]
    /// Zenoh refused something.
    Session(String),
}

/// Where events go.
#[derive(Clone)]
pub struct Events {
    queue: SyncSender<(Event, usize)>,
    octets: Arc<AtomicUsize>,
    /// Events and octets of each machine that wait.
    of_each: Arc<Mutex<HashMap<String, (usize, usize)>>>,
    dropped: Arc<AtomicU64>,
}

/// Where they come out.
pub struct Queue {
    queue: Receiver<(Event, usize)>,
    octets: Arc<AtomicUsize>,
    of_each: Arc<Mutex<HashMap<String, (usize, usize)>>>,
}

/// The machine that an event is of, which says as much as it likes.
fn said_by(event: &Event) -> Option<&str> {
    match event {
        Event::Alive(name, _) | Event::State(name, _) | Event::Journal(name, _) => Some(name),
        // As many as there were questions, refusals or people.
        Event::Answer(..) | Event::Refused(_) | Event::Ask(..) => None,
    }
}

impl Events {
    /// A queue that is empty.
    pub fn queue() -> (Events, Queue) {
        let (sender, queue) = sync_channel(EVENTS);
        let events = Events {
            queue: sender,
            octets: Arc::default(),
            of_each: Arc::default(),
            dropped: Arc::default(),
        };
        let (octets, of_each) = (Arc::clone(&events.octets), Arc::clone(&events.of_each));
        let queue = Queue { queue, octets, of_each };
        (events, queue)
    }

    /// Gives an event, or drops it: nobody waits here.
    pub fn give(&self, event: Event) {
        self.give_message(event, 0);
    }

    /// The same of a message of so many octets.
    fn give_message(&self, event: Event, octets: usize) {
        // Held until it is in the queue, which nobody waits for: what comes out was counted.
        let mut of_each = self.of_each.lock().unwrap_or_else(PoisonError::into_inner);
        let name = said_by(&event).map(str::to_owned);
        let of_one = name
            .as_ref()
            .and_then(|name| of_each.get(name))
            .copied()
            .unwrap_or_default();
        let all = self.octets.fetch_add(octets, Ordering::Relaxed) + octets;
        let is_taken = (octets == 0 || all <= EVENTS_OCTETS)
            && of_one.0 < EVENTS_OF_ONE
            && (octets == 0 || of_one.1 + octets <= OCTETS_OF_ONE)
            && self.queue.try_send((event, octets)).is_ok();
        match (is_taken, name) {
            (true, Some(name)) => _ = of_each.insert(name, (of_one.0 + 1, of_one.1 + octets)),
            (true, None) => {}
            (false, _) => {
                self.octets.fetch_sub(octets, Ordering::Relaxed);
                self.dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Events that were dropped.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

impl Queue {
    fn out(&self, (event, octets): (Event, usize)) -> Event {
        self.octets.fetch_sub(octets, Ordering::Relaxed);
        if let Some(name) = said_by(&event) {
            let mut of_each = self.of_each.lock().unwrap_or_else(PoisonError::into_inner);
            match of_each.get_mut(name) {
                Some((count, of_one)) if *count > 1 => (*count, *of_one) = (*count - 1, *of_one - octets),
                _ => _ = of_each.remove(name),
            }
        }
        event
    }

    /// The next event, after so long at the most.
    ///
    /// # Errors
    /// There was none, or there never will be one.
    pub fn recv_timeout(&self, longest: Duration) -> Result<Event, RecvTimeoutError> {
        self.queue.recv_timeout(longest).map(|event| self.out(event))
    }

    /// Those that wait.
    pub fn try_iter(&self) -> impl Iterator<Item = Event> {
        self.queue.try_iter().map(|event| self.out(event))
    }
}

/// Questions to one machine that wait.
const QUESTIONS_MAX: usize = 64;
/// A machine that says what is no message is told of so often.
const TELL_AGAIN: Duration = Duration::from_secs(60);
/// Refusals that are told in a second: strangers fill neither the log nor the store.
const REFUSALS_MAX: u32 = 10;

/// What the encryption says of clients that it refuses, for the store: a layer of the log.
pub struct Refusals {
    events: OnceLock<Events>,
    /// Since when those of this second are counted.
    second: Mutex<Option<(Instant, u32)>>,
    is_out_of_files: AtomicBool,
}

/// Whether this is of the encryption, which advises to open more files whatever it is; it is told in the supervisor's words.
pub fn is_of_encryption(metadata: &Metadata<'_>) -> bool {
    metadata.target().starts_with("zenoh_link_tls") && *metadata.level() == Level::WARN
}

impl Refusals {
    /// They go nowhere yet.
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Refusals {
        Refusals {
            events: OnceLock::new(),
            second: Mutex::new(None),
            is_out_of_files: AtomicBool::new(false),
        }
    }

    /// Where they go from now on.
    pub fn to(&self, events: Events) {
        // A second supervisor of a process has them in its log.
        let _ = self.events.set(events);
    }

    /// Whether the process had no file left for a connection since the last call.
    ///
    /// Zenoh then looks at no handshake any more, not even at those that are over, so that it would have none left for ever.
    pub fn takes_out_of_files(&self) -> bool {
        self.is_out_of_files.swap(false, Ordering::Relaxed)
    }

    fn is_told(&self) -> bool {
        let mut second = self.second.lock().unwrap_or_else(PoisonError::into_inner);
        let (begun, count) = second
            .take_if(|(begun, _)| begun.elapsed() < Duration::from_secs(1))
            .unwrap_or((Instant::now(), 0));
        *second = Some((begun, count.saturating_add(1)));
        count < REFUSALS_MAX
    }
}

impl<S: Subscriber> Layer<S> for &'static Refusals {
    fn on_event(&self, event: &tracing::Event<'_>, _: Context<'_, S>) {
        struct Message(String);
        impl Visit for Message {
            fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
                if field.name() == "message" {
                    self.0 = format!("{value:?}");
                }
            }
        }
        let is_refusal = is_of_encryption(event.metadata());
        if let Some(events) = self.events.get().filter(|_| is_refusal && self.is_told()) {
            let mut message = Message(String::new());
            event.record(&mut message);
            let what = message.0.split(". Hint").next().unwrap_or_default();
            if [Errno::EMFILE, Errno::ENFILE]
                .iter()
                .any(|errno| what.ends_with(&format!("(os error {})", *errno as i32)))
            {
                self.is_out_of_files.store(true, Ordering::Relaxed);
            }
            events.give(Event::Refused(format!("encryption: {what}")));
        }
    }
}

/// The listening side of a cell.
pub struct Net {
    ca: Ca,
    address: SocketAddr,
    identity: Identity,
    events: Events,
    session: Session,
    /// Questions to each machine, which a thread of its own sends: a link that takes nothing holds up no other machine.
    lanes: HashMap<String, SyncSender<(Question, Answer)>>,
    /// When the list of certificates that this session knows was written.
    listed: Option<SystemTime>,
}

/// What this PC is called.
pub(crate) fn host_name() -> Option<String> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok()?;
    let name = name.trim_end();
    (!name.is_empty() && name.is_ascii()).then(|| name.to_owned())
}

/// Addresses and names under which this PC may be reached at `address`.
fn names(address: SocketAddr, more: &[String]) -> Vec<String> {
    let mut names = vec!["localhost".to_owned(), "127.0.0.1".to_owned(), "::1".to_owned()];
    names.extend(host_name());
    if address.ip().is_unspecified() {
        for interface in nix::ifaddrs::getifaddrs().into_iter().flatten() {
            let address = interface.address;
            let v4 = address
                .as_ref()
                .and_then(|address| address.as_sockaddr_in())
                .map(|address| address.ip().to_string());
            let v6 = address
                .as_ref()
                .and_then(|address| address.as_sockaddr_in6())
                .map(|address| address.ip().to_string());
            names.extend(v4.or(v6));
        }
    } else {
        names.push(address.ip().to_string());
    }
    names.extend(more.iter().cloned());
    names.sort();
    names.dedup();
    names
}

impl Net {
    /// Listens at `address` with a certificate that is made for it, for the machines that the authority knows.
    ///
    /// # Errors
    /// The authority cannot be read, the folder not be written, the address not be had.
    pub fn listen(
        ca: &Path,
        state: &Path,
        address: SocketAddr,
        more_names: &[String],
        events: Events,
    ) -> Result<Net, NetError> {
        let ca = Ca::of(ca);
        let (certificate, key): (PathBuf, PathBuf) = ca.issue_server(state, &names(address, more_names))?;
        let identity = Identity {
            certificate,
            key,
            ca: ca.certificate(),
        };
        let listed = written(&ca);
        let session = open(&ca, address, &identity, &events)?;
        Ok(Net {
            ca,
            address,
            identity,
            events,
            session,
            lanes: HashMap::new(),
            listed,
        })
    }

    /// Opens the session anew where certificates were issued or revoked: who may come is fixed when it is opened. All controls come
    /// back within seconds.
    ///
    /// # Errors
    /// As [`Net::listen`]; then the old session is closed.
    pub fn refresh(&mut self) -> Result<bool, NetError> {
        let written = written(&self.ca);
        if written == self.listed {
            return Ok(false);
        }
        // A list that cannot be read lets nobody new in, and nobody out.
        self.ca.valid()?;
        self.open_anew()?;
        self.listed = written;
        Ok(true)
    }

    /// Opens the session anew, with all links.
    ///
    /// # Errors
    /// As [`Net::listen`]; then the old session is closed.
    pub fn open_anew(&mut self) -> Result<(), NetError> {
        // They are of the session that ends.
        self.lanes.clear();
        if let Err(cause) = self.session.close().wait() {
            tracing::debug!("{cause}");
        }
        self.session = open(&self.ca, self.address, &self.identity, &self.events)?;
        Ok(())
    }

    /// Asks a control; nobody waits here.
    pub fn ask(&mut self, question: Question) {
        let answer = Answer {
            events: self.events.clone(),
            ticket: Some(question.ticket),
        };
        // Where it comes to nothing, the end of `answer` says so.
        let begun = match question.topic {
            Topic::Program => in_a_thread("sends", {
                let session = self.session.clone();
                move || send(&session, question, answer)
            }),
            _ => self
                .lane(&question.machine)
                .map(|lane| drop(lane.try_send((question, answer)))),
        };
        if let Err(cause) = begun {
            tracing::warn!("{cause}");
        }
    }

    fn lane(&mut self, machine: &str) -> std::io::Result<&SyncSender<(Question, Answer)>> {
        if !self.lanes.contains_key(machine) {
            let (lane, questions) = sync_channel::<(Question, Answer)>(QUESTIONS_MAX);
            let session = self.session.clone();
            in_a_thread("asks", move || {
                for (question, answer) in questions {
                    send(&session, question, answer);
                }
            })?;
            self.lanes.insert(machine.to_owned(), lane);
        }
        Ok(&self.lanes[machine])
    }

    /// Events that came faster than they were taken.
    pub fn dropped(&self) -> u64 {
        self.events.dropped()
    }

    /// Ends it.
    pub fn close(self) {
        if let Err(cause) = self.session.close().wait() {
            tracing::debug!("{cause}");
        }
    }
}

fn in_a_thread(name: &str, work: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
    std::thread::Builder::new().name(name.into()).spawn(work).map(drop)
}

/// Sends a question, which takes as long as its link: where that takes nothing, until Zenoh gives it up.
fn send(session: &Session, question: Question, answer: Answer) {
    // Orders overtake whatever else is on its way. A program has a queue of its own in Zenoh: who says a word in the same one waits until it
    // is gone, and the thread that serves all links is among those who do.
    let priority = match question.topic {
        Topic::Order | Topic::Run => Priority::InteractiveHigh,
        Topic::Program => Priority::DataLow,
        _ => Priority::Data,
    };
    let answer = Mutex::new(answer);
    let mut get = session
        .get(question.topic.key(&question.machine))
        .payload(question.payload)
        .priority(priority)
        .timeout(question.wait);
    if let Some(attachment) = question.attachment {
        get = get.attachment(attachment);
    }
    let asked = get
        .callback(move |reply| {
            let result = match reply.result() {
                Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
                // What Zenoh itself says once the time is over.
                Err(error) if *error.payload().to_bytes() == *b"Timeout" => Err(NO_ANSWER.into()),
                Err(error) => Err(String::from_utf8_lossy(&error.payload().to_bytes()).into_owned()),
            };
            answer.lock().unwrap_or_else(PoisonError::into_inner).give(result);
        })
        .wait();
    if let Err(cause) = asked {
        tracing::debug!("{cause}");
    }
}

fn written(ca: &Ca) -> Option<SystemTime> {
    std::fs::metadata(ca.list()).and_then(|list| list.modified()).ok()
}

/// The one answer to a question; that there is none where it ends without one.
struct Answer {
    events: Events,
    ticket: Option<u64>,
}

impl Answer {
    fn give(&mut self, result: Result<Vec<u8>, String>) {
        if let Some(ticket) = self.ticket.take() {
            let octets = result.as_ref().map_or_else(String::len, Vec::len);
            self.events.give_message(Event::Answer(ticket, result), octets);
        }
    }
}

impl Drop for Answer {
    fn drop(&mut self) {
        self.give(Err(NO_ANSWER.into()));
    }
}

fn open(ca: &Ca, address: SocketAddr, identity: &Identity, events: &Events) -> Result<Session, NetError> {
    let (valid, revoked) = ca.valid()?;
    let failed = |cause: zenoh::Error| NetError::Session(cause.to_string());
    let session = carrier::listen(address, identity, &valid).map_err(|cause| match cause {
        CarrierError::Session(why) => {
            // Zenoh says where again, and again.
            let why = why
                .rsplit_once(&format!("{address}: "))
                .map_or(&*why, |(_, cause)| cause);
            NetError::Session(format!("{address} cannot be listened at: {why}"))
        }
        file => NetError::Carrier(file),
    })?;
    let (valid, revoked): (HashSet<String>, HashSet<String>) =
        (valid.into_iter().collect(), revoked.into_iter().collect());
    let linked = events.clone();
    session
        .info()
        .link_events_listener()
        .history(true)
        .callback(move |event| {
            if event.kind() != SampleKind::Put {
                return;
            }
            let name = event.link().auth_identifier().unwrap_or("without a name");
            if !valid.contains(name) {
                let why = if revoked.contains(name) {
                    "is revoked"
                } else {
                    "was not issued here"
                };
                let text = format!(
                    "{}: its certificate {name} {why}: nothing of it is heard",
                    event.link().dst()
                );
                linked.give(Event::Refused(text));
            }
        })
        .background()
        .wait()
        .map_err(failed)?;
    let alive = events.clone();
    session
        .liveliness()
        .declare_subscriber(Topic::Alive.key("*"))
        .history(true)
        .callback(move |sample| {
            if let Some((machine, Topic::Alive)) = parse_key(sample.key_expr().as_str()) {
                alive.give(Event::Alive(machine.to_owned(), sample.kind() == SampleKind::Put));
            }
        })
        .background()
        .wait()
        .map_err(failed)?;
    session
        .declare_queryable(Topic::Heard.key("*"))
        .callback(|query| {
            if let Err(cause) = query.reply(query.key_expr().clone(), "").wait() {
                tracing::debug!("{cause}");
            }
        })
        .background()
        .wait()
        .map_err(failed)?;
    for topic in [Topic::State, Topic::Journal] {
        let events = events.clone();
        let told = Mutex::default();
        session
            .declare_subscriber(topic.key("*"))
            .callback(move |sample| {
                let Some((machine, _)) = parse_key(sample.key_expr().as_str()) else {
                    return;
                };
                match event(topic, machine, &sample) {
                    Ok(event) => events.give_message(event, sample.payload().len()),
                    Err(bad) if is_due(&told, machine) => events.give(Event::Refused(format!("{machine}: {bad}"))),
                    Err(_) => {}
                }
            })
            .background()
            .wait()
            .map_err(failed)?;
    }
    Ok(session)
}

/// Whether it is time to tell of a machine again: its next message is as bad as the last one.
fn is_due(told: &Mutex<HashMap<String, Instant>>, machine: &str) -> bool {
    let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
    let is_due = told.get(machine).is_none_or(|told| told.elapsed() >= TELL_AGAIN);
    if is_due {
        told.insert(machine.to_owned(), Instant::now());
    }
    is_due
}

fn event(topic: Topic, machine: &str, sample: &Sample) -> Result<Event, BadMessage> {
    let octets = sample.payload().to_bytes();
    let machine = machine.to_owned();
    match topic {
        Topic::State => Envelope::<State>::from_octets(&octets).map(|said| Event::State(machine, Box::new(said.body))),
        _ => Envelope::<Journal>::from_octets(&octets).map(|said| Event::Journal(machine, said.body)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Core;
    use crate::store::Store;
    use cell_link::message::Since;
    use serde_json::{Value, json};

    /// Entries of about 1 MB.
    fn journal(since: u64, last: u64) -> Journal {
        let text = "x".repeat(1 << 20);
        let entries = (since + 1..=last.min(since + 3))
            .map(|seq| json!({ "seq": seq, "unix_s": 1.0, "kind": "note", "text": text }));
        Journal {
            since,
            entries: entries.collect(),
            more: last > since + 3,
            last,
        }
    }

    #[test]
    fn a_machine_that_talks_without_end_takes_no_room_from_others() {
        let (events, queue) = Events::queue();
        let state = |name: &str| Event::State(name.into(), Box::default());
        for _ in 0..2 * EVENTS {
            events.give_message(state("talks"), 9000);
            events.give(Event::Alive("talks".into(), true));
        }
        for _ in 0..EVENTS_OF_ONE {
            events.give_message(state("mill"), 9000);
        }
        events.give_message(Event::Answer(1, Ok(Vec::new())), 9000);
        let waiting: Vec<Event> = queue.try_iter().collect();
        let of = |name: &str| waiting.iter().filter(|event| said_by(event) == Some(name)).count();
        assert_eq!(
            (of("talks"), of("mill"), waiting.len()),
            (EVENTS_OF_ONE, EVENTS_OF_ONE, 2 * EVENTS_OF_ONE + 1)
        );
        // All of it was taken, and there is room again.
        assert_eq!(
            (
                queue.octets.load(Ordering::Relaxed),
                queue.of_each.lock().unwrap().len()
            ),
            (0, 0)
        );
        events.give(state("talks"));
        assert_eq!(queue.try_iter().count(), 1);
    }

    #[test]
    fn a_supervisor_that_sleeps_keeps_so_many_octets_and_asks_for_what_it_has_dropped() {
        const COUNT: u64 = 200;
        let (events, queue) = Events::queue();
        let give = |event: Event, octets: usize| events.give_message(event, octets);
        // Nobody takes anything while a control tells 200 MB.
        for seq in 0..COUNT {
            let body = Journal {
                entries: journal(seq, seq + 1).entries,
                ..journal(seq, seq)
            };
            let octets = Envelope::new(seq, &body).to_octets().len();
            give(Event::Journal("mill".into(), body), octets);
        }
        let waiting = queue.octets.load(Ordering::Relaxed);
        assert!(waiting <= OCTETS_OF_ONE && waiting > OCTETS_OF_ONE / 2, "{waiting}");
        assert!(events.dropped() > COUNT / 2, "{}", events.dropped());
        // People are not in the way of it.
        give(Event::Refused("somebody".into()), 0);

        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("cell.db")).unwrap();
        let mut number = 0;
        let ids = move || {
            number += 1;
            number.to_string()
        };
        let mut core = Core::new(store, Box::new(ids)).unwrap();
        let mut now = 1000.0;
        let state = State {
            journal: COUNT,
            ..State::default()
        };
        let told = || Event::State("mill".into(), Box::new(state.clone()));
        let mut kept = 0;
        for round in 0..2 * COUNT {
            now += 1.0;
            let mut batch: Vec<Event> = queue.try_iter().take(16).collect();
            if round == 0 {
                kept = batch.len();
            }
            batch.push(told());
            for question in core.take(batch, now) {
                let answer = match question.topic {
                    Topic::Journal => {
                        let asked: Envelope<Since> = Envelope::from_octets(&question.payload).unwrap();
                        Envelope::new(0, journal(asked.body.since, COUNT)).to_octets()
                    }
                    _ => Envelope::new(0, json!({})).to_octets(),
                };
                let octets = answer.len();
                give(Event::Answer(question.ticket, Ok(answer)), octets);
            }
        }
        assert!(kept > 0);
        assert_eq!(queue.octets.load(Ordering::Relaxed), 0, "all of it was taken");
        // An answer has no more than a message of a control.
        let mut seqs = Vec::new();
        loop {
            let (sender, answer) = sync_channel(1);
            let ask = crate::core::Ask::Journal {
                machine: "mill".into(),
                since: Some(seqs.len() as u64),
            };
            let reply = Box::new(move |answer| sender.send(answer).unwrap());
            core.take(vec![Event::Ask(ask, reply)], now);
            let answer: Value = answer.try_recv().unwrap().unwrap();
            let entries = answer["entries"].as_array().unwrap();
            if entries.is_empty() {
                break;
            }
            assert!(answer.to_string().len() < 5 << 20);
            seqs.extend(entries.iter().filter_map(|entry| entry["seq"].as_u64()));
        }
        assert!(seqs.iter().copied().eq(1..=COUNT), "each of them is there, once");
    }
}
