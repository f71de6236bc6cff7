//! The threads of the link.
//!
//! In:  ways to the control, settings. Out: what the supervisor is told and answered, until the control ends.
//!
//! | thread | does |
//! |---|---|
//! | `cell` (the caller's) | state and journal as they change, ends of orders into the ledger |
//! | `cell-orders` | hold, stop, questions: at once |
//! | `cell-programs` | stores, checks and starts programs, one at a time |
//! | `cell-connect` | until there is a session, which from then on makes itself again; anew where nobody hears at it |
//! | `cell-close` | ends a session at which nobody hears |

use crate::carrier::{self, Identity};
use crate::control::{Control, Refused};
use crate::ledger::{Ledger, Line};
use crate::message::{
    ENTRIES_MAX, Envelope, Journal, MESSAGE_MAX, Order, OrderState, Phase, Remote, Since, State, Stored, Topic, Upload,
    What, is_id, sum,
};
use crate::store;
use protocol::limits::REQUEST_ID;
use protocol::params::{self, Hex, NoParams};
use protocol::{Activity, Entry, Method, Mode, Outcome, Power, Status, method};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;
use sha2::{Digest, Sha256};
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::query::Query;
use zenoh::{Session, Wait};

/// The state is told at least so often.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Longest sleep of a thread: so long may an end take to be noticed.
const NAP: Duration = Duration::from_millis(250);
/// The same while the disk of the control takes what has happened.
const SHORT_NAP: Duration = Duration::from_millis(5);
/// A supervisor that is linked is asked so often whether it hears.
const ASK: Duration = Duration::from_secs(5);
/// One that has not answered so many times in a row never will: the link has got lost between two sessions of its own.
const UNHEARD_MAX: u32 = 3;
/// Between two tries to reach a supervisor that was never there.
const RETRY: Duration = Duration::from_secs(1);
/// Entries of a journal in one message, octets: with what is around them it is none that is too long.
const ENTRIES_OCTETS: usize = MESSAGE_MAX / 2;
/// Questions that wait to be answered.
const QUESTIONS: usize = 64;
/// Ports of a machine that a supervisor is told: those of 64 stations with 8 modules of 8 channels.
const PORTS_MAX: usize = 4096;
/// The longest one, octets, where it is not a program: with that, all that wait have a bound.
const QUESTION_MAX: usize = 64 << 10;
/// Programs and runs that wait: each may hold a whole program.
const PROGRAMS: usize = 2;

/// What the link of a control is told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Address and port of the supervisor.
    pub supervisor: String,
    /// Certificate and key of this machine.
    pub identity: Identity,
    /// What the supervisor may do.
    pub remote: Remote,
    /// Folder of programs.
    pub programs: PathBuf,
    /// Folder of the state.
    pub state: PathBuf,
    /// Where the panel of this machine is.
    pub panel: Option<String>,
}

/// A way to the control: another client of it, which hears of changes where that is `true`.
pub type Connect<'a> = dyn Fn(bool) -> Result<Box<dyn Control>, Refused> + Sync + 'a;

/// Why a link has ended.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    #[error(transparent)]
    /// A file of the identity, or the carrier.
    Identity(#[from] carrier::CarrierError),
    #[error("orders that were begun: {0}")]
    /// The ledger cannot be read or written.
    Ledger(#[from] io::Error),
    #[error("the certificate {certificate} is called {name:?}, which is no machine's")]
    /// The certificate is of no machine.
    Name {
        /// Which file.
        certificate: String,
        /// The name in it.
        name: String,
    },
    #[error(transparent)]
    /// The control has ended.
    Control(#[from] Refused),
}

/// What the control calls the supervisor.
const SUPERVISOR: &str = "supervisor";

/// What the threads share.
struct Shared<'a> {
    settings: &'a Settings,
    machine: String,
    /// Another one after each start.
    boot: u64,
    connect: &'a Connect<'a>,
    ledger: Mutex<Ledger>,
    /// What bars a run, if anything does.
    bars: Mutex<Option<String>>,
    /// Messages so far.
    said: AtomicU64,
    stop: &'a AtomicBool,
    /// One of the threads has ended.
    ended: AtomicBool,
    /// Nobody wants a session any more.
    given_up: Arc<AtomicBool>,
}

impl Shared<'_> {
    fn ledger(&self) -> MutexGuard<'_, Ledger> {
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What bars a run now.
    fn bars(&self) -> Option<String> {
        self.bars.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.ended.load(Ordering::Relaxed)
    }

    /// Whether an order is for another control that has the same certificate: the answer to it is that one's.
    fn is_of_another(&self, order: &Order) -> bool {
        order.boot.is_some_and(|boot| boot != self.boot)
    }

    fn say<B: Serialize>(&self, body: B) -> Vec<u8> {
        Envelope::new(self.said.fetch_add(1, Ordering::Relaxed), body).to_octets()
    }
}

/// Keeps the link until `stop`, or until the control ends.
///
/// # Errors
/// A file of the identity or of the ledger is wrong; or the control has ended.
pub fn run(settings: &Settings, connect: &Connect<'_>, stop: &AtomicBool) -> Result<(), LinkError> {
    let name = carrier::common_name(&settings.identity.certificate)?;
    let Some(machine) = carrier::machine_of(&name) else {
        return Err(LinkError::Name {
            certificate: settings.identity.certificate.display().to_string(),
            name,
        });
    };
    let shared = Shared {
        settings,
        machine: machine.to_owned(),
        boot: SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_millis() as u64),
        connect,
        ledger: Mutex::new(Ledger::open(&settings.state)?),
        bars: Mutex::default(),
        said: AtomicU64::new(0),
        stop,
        ended: AtomicBool::new(false),
        given_up: Arc::default(),
    };
    let (orders, order_queries) = sync_channel(QUESTIONS);
    let (programs, program_queries) = sync_channel(PROGRAMS);
    let shared = &shared;
    std::thread::scope(|scope| {
        let named = |name: &str| std::thread::Builder::new().name(name.to_owned());
        named("cell-orders").spawn_scoped(scope, move || ended(shared, answer_orders(shared, &order_queries)))?;
        named("cell-programs").spawn_scoped(scope, move || ended(shared, answer_programs(shared, &program_queries)))?;
        let told = Teller::new(shared).and_then(|teller| teller.tell(orders, programs));
        shared.ended.store(true, Ordering::Relaxed);
        shared.given_up.store(true, Ordering::Relaxed);
        told
    })
}

/// A thread of the link has ended, and with it the others do.
fn ended(shared: &Shared<'_>, how: Result<(), Refused>) {
    if let Err(cause) = how {
        tracing::debug!("cell: {cause}");
    }
    shared.ended.store(true, Ordering::Relaxed);
}

/// What keeps a session going: its end ends all of it.
struct Live {
    session: Session,
    _token: LivelinessToken,
    /// When the supervisor was asked whether it hears.
    asked: Instant,
    /// How many times since it has answered last.
    unheard: Arc<AtomicU32>,
}

impl Live {
    /// Whether there is a link now: one that is lost is made again by the session itself.
    fn is_linked(&self) -> bool {
        self.session.info().routers_zid().wait().next().is_some()
    }

    /// Asks whether the supervisor hears; whether it has not for too long.
    fn is_deaf(&mut self, machine: &str) -> bool {
        if self.asked.elapsed() < ASK {
            return false;
        }
        self.asked = Instant::now();
        if !self.is_linked() {
            self.unheard.store(0, Ordering::Relaxed);
            return false;
        }
        let unheard = Arc::clone(&self.unheard);
        let is_deaf = unheard.fetch_add(1, Ordering::Relaxed) >= UNHEARD_MAX;
        let asked = (self.session.get(Topic::Heard.key(machine)).timeout(ASK))
            .callback(move |reply| {
                if reply.result().is_ok() {
                    unheard.store(0, Ordering::Relaxed);
                }
            })
            .wait();
        if let Err(cause) = asked {
            tracing::debug!("cell: {cause}");
        }
        is_deaf
    }

    /// Ends it; nobody waits for that.
    fn leave(self) {
        let close = move || {
            if let Err(cause) = self.session.close().wait() {
                tracing::debug!("cell: {cause}");
            }
        };
        if let Err(cause) = std::thread::Builder::new().name("cell-close".into()).spawn(close) {
            tracing::debug!("cell: {cause}");
        }
    }
}

/// Tells the supervisor how the machine is.
struct Teller<'a> {
    shared: &'a Shared<'a>,
    control: Box<dyn Control>,
    joints: usize,
    /// Entries up to this one were told, or will be asked for.
    told: u64,
    /// Something has happened that is not on the disk of the control yet.
    is_behind: bool,
    /// The machine was moved by hand since it was homed or ran a program.
    by_hand: bool,
    /// Orders under way, the oldest first; and ends that the disk has not taken yet.
    running: Vec<Line>,
}

impl<'a> Teller<'a> {
    fn new(shared: &'a Shared<'a>) -> Result<Teller<'a>, LinkError> {
        let mut control = (shared.connect)(true)?;
        let joints = control.ask::<method::Describe>(&NoParams {})?.joints.len();
        let last = journal(control.as_mut(), u64::from(u32::MAX))?.last;
        let mut teller = Teller {
            shared,
            control,
            joints,
            told: last,
            is_behind: false,
            by_hand: false,
            running: Vec::new(),
        };
        teller.settle_earlier()?;
        Ok(teller)
    }

    /// Orders that an earlier control of this machine had begun: its journal may know how they ended.
    fn settle_earlier(&mut self) -> Result<(), LinkError> {
        // The ledger is asked once, for it is written to below.
        let unfinished = self.shared.ledger().unfinished();
        for line in unfinished {
            let mut since = line.journal;
            let mut settled = None;
            while settled.is_none() {
                let News { entries, more, .. } = journal(self.control.as_mut(), since)?;
                settled = entries.iter().find_map(|entry| end_of(&line, entry));
                match entries.last() {
                    Some(last) if more => since = last.seq,
                    _ => break,
                }
            }
            let settled = settled.unwrap_or_else(|| {
                let mut line = line.clone();
                line.state.phase = Phase::Interrupted;
                line.state.note = "the control ended while it ran".into();
                line
            });
            self.shared.ledger().put(settled)?;
        }
        Ok(())
    }

    fn tell(mut self, orders: SyncSender<Query>, programs: SyncSender<Query>) -> Result<(), LinkError> {
        let (sessions, connected) = sync_channel(1);
        connect_in_background(self.shared, sessions.clone());
        let address = &self.shared.settings.supervisor;
        let mut live: Option<Live> = None;
        let mut was_linked = false;
        let mut last_told: Option<(State, Instant)> = None;
        while !self.shared.stops() {
            let nap = if self.is_behind { SHORT_NAP } else { NAP };
            let status = self.control.wait(nap)?.clone();
            if live.is_none()
                && let Ok(session) = connected.try_recv()
            {
                live = Some(self.begin(session, &orders, &programs)?);
                last_told = None;
            }
            let is_linked = live.as_ref().is_some_and(Live::is_linked);
            match (was_linked, is_linked) {
                (false, true) => tracing::info!("cell: connected to the supervisor at {address}"),
                (true, false) => tracing::warn!("cell: the supervisor at {address} is lost; trying again"),
                _ => {}
            }
            was_linked = is_linked;
            if live.as_mut().is_some_and(|live| live.is_deaf(&self.shared.machine)) {
                tracing::warn!("cell: the supervisor at {address} is linked and answers nothing; connecting anew");
                if let Some(deaf) = live.take() {
                    deaf.leave();
                }
                was_linked = false;
                connect_in_background(self.shared, sessions.clone());
            }
            self.note_hands(&status);
            let news = self.news(&status)?;
            self.note_ends(&news.entries);
            let state = self.state(&status);
            *self.shared.bars.lock().unwrap_or_else(PoisonError::into_inner) = self.bars(&status);
            let Some(live) = &live else { continue };
            if !news.entries.is_empty() {
                self.put(&live.session, Topic::Journal, news.message());
            }
            let due = last_told.as_ref().is_none_or(|(told, at)| {
                let same = State {
                    done_percent: state.done_percent,
                    remaining_s: state.remaining_s,
                    ..told.clone()
                };
                same != state || at.elapsed() >= HEARTBEAT
            });
            if due {
                self.put(&live.session, Topic::State, &state);
                last_told = Some((state, Instant::now()));
            }
        }
        if let Some(live) = live
            && let Err(cause) = live.session.close().wait()
        {
            tracing::debug!("cell: {cause}");
        }
        Ok(())
    }

    fn begin(
        &self,
        session: Session,
        orders: &SyncSender<Query>,
        programs: &SyncSender<Query>,
    ) -> Result<Live, LinkError> {
        let failed = |cause: zenoh::Error| carrier::CarrierError::Session(cause.to_string());
        for topic in [
            Topic::Journal,
            Topic::Describe,
            Topic::Order,
            Topic::Program,
            Topic::Run,
        ] {
            let queue = match topic {
                Topic::Program | Topic::Run => programs.clone(),
                _ => orders.clone(),
            };
            session
                .declare_queryable(topic.key(&self.shared.machine))
                .callback(move |query| {
                    if topic != Topic::Program && octets(&query) > QUESTION_MAX {
                        return refuse(&query, &format!("{QUESTION_MAX} octets are the most here"));
                    }
                    // Who waits here would hold up the whole session.
                    if let Err(TrySendError::Full(query) | TrySendError::Disconnected(query)) = queue.try_send(query) {
                        refuse(&query, "too many are waiting: try again");
                    }
                })
                .background()
                .wait()
                .map_err(failed)?;
        }
        let token = session
            .liveliness()
            .declare_token(Topic::Alive.key(&self.shared.machine))
            .wait()
            .map_err(failed)?;
        Ok(Live {
            session,
            _token: token,
            asked: Instant::now(),
            unheard: Arc::default(),
        })
    }

    /// Nobody waits for a supervisor that does not read: what is dropped is asked for again.
    fn put(&self, session: &Session, topic: Topic, body: impl Serialize) {
        let put = session
            .put(topic.key(&self.shared.machine), self.shared.say(body))
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .wait();
        if let Err(cause) = put {
            tracing::debug!("cell: {cause}");
        }
    }

    fn note_hands(&mut self, status: &Status) {
        match (status.mode, status.activity) {
            (Mode::Auto, _) | (_, Activity::Homing) => self.by_hand = false,
            (_, Activity::Jogging) => self.by_hand = true,
            _ => {}
        }
    }

    /// Whether a line of MDI is of somebody at the machine.
    fn is_of_hand(entry: &Entry) -> bool {
        entry.text.starts_with("MDI: ") && entry.by.as_deref() != Some(SUPERVISOR)
    }

    /// Entries that are new.
    fn news(&mut self, status: &Status) -> Result<News, Refused> {
        let newest = status.messages.last().map_or(0, |entry| entry.seq);
        let news = match newest > self.told {
            true => journal(self.control.as_mut(), self.told)?,
            false => News {
                since: self.told,
                entries: Vec::new(),
                more: false,
                last: self.told,
            },
        };
        self.told = news.entries.last().map_or(self.told, |entry| entry.seq);
        self.by_hand |= news.entries.iter().any(Self::is_of_hand);
        self.is_behind = newest > self.told;
        Ok(news)
    }

    /// Puts ends of orders into the ledger, again and again where the disk is full.
    fn note_ends(&mut self, news: &[Entry]) {
        let unfinished = self.shared.ledger().unfinished();
        for line in unfinished {
            if self.running.iter().all(|known| known.state.id != line.state.id) {
                self.running.push(line);
            }
        }
        for line in &mut self.running {
            if let Some(end) = news.iter().find_map(|entry| end_of(line, entry)) {
                *line = end;
            }
        }
        let shared = self.shared;
        self.running.retain(|line| {
            let mut ledger = shared.ledger();
            let known = ledger.get(&line.state.id).map(|line| line.state.phase);
            if known != Some(Phase::Running) {
                return false;
            }
            if line.state.phase == Phase::Running {
                return true;
            }
            match ledger.put(line.clone()) {
                Ok(()) => false,
                Err(cause) => {
                    tracing::warn!("cell: the end of an order is not on the disk yet: {cause}");
                    true
                }
            }
        });
    }

    fn state(&self, status: &Status) -> State {
        let why_not = self.why_not(status);
        State {
            boot: self.shared.boot,
            state: status.state,
            power: status.power,
            activity: status.activity,
            mode: status.mode,
            is_ready: why_not.is_none(),
            why_not,
            remote: self.shared.settings.remote,
            program: status.program.as_ref().map(|program| program.name.clone()),
            done_percent: status.done_percent,
            remaining_s: status.remaining_s,
            alarm: status.alarm.as_ref().map(ToString::to_string),
            parts: status.parts.count,
            journal: self.told,
            order: self.shared.ledger().last().map(|line| line.state.clone()),
        }
    }

    /// Why a run would be refused now, as people are told.
    fn why_not(&self, status: &Status) -> Option<String> {
        let has_control = || {
            let holder = status.control.as_ref().filter(|control| control.taken)?;
            Some(format!("{} has control", holder.name))
        };
        self.bars(status).or_else(has_control)
    }

    /// What bars a run, whoever has control: that says the control itself, which knows whether it is still so.
    fn bars(&self, status: &Status) -> Option<String> {
        if self.shared.settings.remote < Remote::Run {
            return Some(
                "the machine file does not let the supervisor run programs: remote = \"run\" of [cell]".into(),
            );
        }
        if let Some(alarm) = &status.alarm {
            return Some(format!("alarm: {alarm}"));
        }
        if status.power != Power::On {
            return Some(format!("drives are not on: {}", status.power));
        }
        if status.activity != Activity::Idle {
            return Some(format!("the machine is {}", status.activity));
        }
        let homed = status.homed.len();
        if homed < self.joints {
            return Some(format!("{homed} of {} joints are homed", self.joints));
        }
        let by_hand = "the machine was moved by hand: run a program at the machine, or home it, to hand it over";
        self.by_hand.then(|| by_hand.into())
    }
}

/// Entries of the journal of the control.
struct News {
    /// The number that was asked for; of new entries: that of the one before them.
    since: u64,
    entries: Vec<Entry>,
    more: bool,
    last: u64,
}

impl News {
    /// As the supervisor is told of them.
    fn message(&self) -> Journal {
        Journal {
            since: self.since,
            entries: self.entries.iter().map(|entry| json!(entry)).collect(),
            more: self.more,
            last: self.last,
        }
    }
}

/// The entries behind a number that are on the disk of the control: what it may forget is told to nobody, for its number would be that
/// of something else.
fn journal(control: &mut dyn Control, since: u64) -> Result<News, Refused> {
    let answer = control.ask::<method::JournalSince>(&params::JournalSince { seq: Some(since) })?;
    let on_disk = answer.on_disk;
    let last = answer.last.min(on_disk);
    let mut entries = answer.entries;
    entries.retain(|entry| entry.seq <= on_disk);
    let mut octets = 0;
    let fits = |entry: &&Entry| {
        octets += json!(entry).to_string().len();
        octets <= ENTRIES_OCTETS
    };
    let fitting = entries.iter().take_while(fits).count();
    entries.truncate(fitting.clamp(1, ENTRIES_MAX));
    Ok(News {
        since,
        more: entries.last().is_some_and(|told| told.seq < last),
        entries,
        last,
    })
}

/// An order as this entry of the journal ends it; `None`: the entry is of something else.
fn end_of(line: &Line, entry: &Entry) -> Option<Line> {
    let program = entry.program.as_ref()?;
    let result = program.result?;
    if line.state.phase != Phase::Running || entry.seq <= line.journal {
        return None;
    }
    let mut line = line.clone();
    line.state.phase = match result {
        Outcome::Completed => Phase::Completed,
        Outcome::Stopped | Outcome::Faulted | Outcome::TimedOut => Phase::Failed,
    };
    line.state.note = result.to_string();
    line.state.took_s = program.took_s;
    Some(line)
}

fn connect_in_background(shared: &Shared<'_>, sessions: SyncSender<Session>) {
    let (settings, given_up) = (shared.settings.clone(), Arc::clone(&shared.given_up));
    let open = move || {
        let (mut told, mut last) = (None, None);
        while !given_up.load(Ordering::Relaxed) {
            match carrier::connect(&settings.supervisor, &settings.identity) {
                // Nobody takes it where the control has ended meanwhile.
                Ok(session) => return drop(sessions.send(session)),
                Err(cause) => {
                    // A supervisor that begins between the try and the question why it failed looks like a wrong one, once.
                    let cause = Some(cause.to_string());
                    if told.is_none() || told != cause && last == cause {
                        let (address, why) = (&settings.supervisor, cause.as_deref().unwrap_or_default());
                        tracing::warn!("cell: no supervisor at {address}; trying again: {why}");
                        told.clone_from(&cause);
                    }
                    last = cause;
                }
            }
            std::thread::sleep(RETRY);
        }
    };
    // It may be in the middle of a try when the control ends, which does not wait for it.
    if let Err(cause) = std::thread::Builder::new().name("cell-connect".into()).spawn(open) {
        tracing::warn!("cell: no thread to connect with: {cause}");
    }
}

/// Octets of a question, with what is said beside it.
fn octets(query: &Query) -> usize {
    let of = |octets: Option<&zenoh::bytes::ZBytes>| octets.map_or(0, |octets| octets.len());
    of(query.payload()) + of(query.attachment())
}

fn refuse(query: &Query, why: &str) {
    if let Err(cause) = query.reply_err(why.to_owned()).wait() {
        tracing::debug!("cell: {cause}");
    }
}

fn reply<B: Serialize>(shared: &Shared<'_>, query: &Query, body: B) {
    if let Err(cause) = query.reply(query.key_expr().clone(), shared.say(body)).wait() {
        tracing::debug!("cell: {cause}");
    }
}

fn body<B: DeserializeOwned>(octets: Option<&zenoh::bytes::ZBytes>) -> Result<B, String> {
    let octets = octets.map(|octets| octets.to_bytes()).unwrap_or_default();
    Envelope::from_octets(&octets)
        .map(|envelope| envelope.body)
        .map_err(|bad| bad.to_string())
}

/// Takes queries until the end.
fn each(
    shared: &Shared<'_>,
    queries: &Receiver<Query>,
    mut answer: impl FnMut(&Query) -> Result<(), Refused>,
) -> Result<(), Refused> {
    while !shared.stops() {
        match queries.recv_timeout(NAP) {
            Ok(query) => answer(&query)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    Ok(())
}

fn topic(query: &Query) -> Option<Topic> {
    crate::message::parse_key(query.key_expr().as_str()).map(|(_, topic)| topic)
}

fn answer_orders(shared: &Shared<'_>, queries: &Receiver<Query>) -> Result<(), Refused> {
    let mut control = (shared.connect)(false)?;
    each(shared, queries, |query| {
        match topic(query) {
            Some(Topic::Describe) => {
                let described = control.ask::<method::Describe>(&NoParams {})?;
                let tools = control.ask::<method::ToolList>(&NoParams {}).ok();
                let panel = &shared.settings.panel;
                let ports = ports(control.as_mut()).ok();
                reply(
                    shared,
                    query,
                    json!({ "machine": described, "tools": tools, "panel": panel, "ports": ports }),
                );
            }
            Some(Topic::Journal) => match body::<Since>(query.payload()) {
                Ok(Since { since }) => {
                    let journal = journal(control.as_mut(), since)?;
                    reply(shared, query, journal.message());
                }
                Err(why) => refuse(query, &why),
            },
            Some(Topic::Order) => match body::<Order>(query.payload()) {
                Ok(order) if shared.is_of_another(&order) => {}
                Ok(order) => {
                    let state = carry_out(shared, control.as_mut(), &order)?;
                    reply(shared, query, state);
                }
                Err(why) => refuse(query, &why),
            },
            _ => refuse(query, "nothing is answered here"),
        }
        Ok(())
    })
}

/// Channels of inputs and outputs that the machine file names, the first [`PORTS_MAX`].
fn ports(control: &mut dyn Control) -> Result<Vec<serde_json::Value>, Refused> {
    let mut ports = Vec::new();
    let mut from = 0;
    loop {
        let wanted = params::PinList {
            pattern: None,
            from: Some(from),
        };
        let told = control.ask::<method::PinList>(&wanted)?;
        from += told.pins.len() as u32;
        let named = told.pins.iter().filter(|pin| pin.alias_of.is_some());
        ports.extend(named.map(|pin| {
            json!({
                "name": pin.name, "type": pin.kind, "direction": pin.direction, "unit": pin.unit, "channel": pin.alias_of, "net": pin.net,
            })
        }));
        if !told.more || told.pins.is_empty() || ports.len() >= PORTS_MAX {
            ports.truncate(PORTS_MAX);
            return Ok(ports);
        }
    }
}

fn of(id: &str, phase: Phase, note: impl Into<String>) -> OrderState {
    OrderState {
        id: id.to_owned(),
        phase,
        note: note.into(),
        took_s: None,
    }
}

fn carry_out(shared: &Shared<'_>, control: &mut dyn Control, order: &Order) -> Result<OrderState, Refused> {
    let (done, method) = match order.what {
        What::Hold => (control.ask::<method::Hold>(&NoParams {}), "hold"),
        What::Stop => (control.ask::<method::Stop>(&NoParams {}), "stop"),
        What::Status => {
            let known = shared.ledger().get(&order.id).map(|line| line.state.clone());
            return Ok(known.unwrap_or_else(|| of(&order.id, Phase::Unknown, "")));
        }
        What::Run { .. } | What::Mdi { .. } => {
            return Ok(of(&order.id, Phase::Refused, "what moves is ordered under another key"));
        }
    };
    match done {
        Ok(_) => Ok(of(&order.id, Phase::Completed, method)),
        Err(Refused::ByControl(why)) => Ok(of(&order.id, Phase::Refused, why)),
        Err(gone) => Err(gone),
    }
}

fn answer_programs(shared: &Shared<'_>, queries: &Receiver<Query>) -> Result<(), Refused> {
    // The program that was taken last: it is not checked again where it comes again.
    let mut last: Option<(Upload, Stored)> = None;
    each(shared, queries, |query| {
        // What a client has sent is forgotten when it goes: the control has room for a few programs only.
        let mut control = (shared.connect)(false)?;
        match topic(query) {
            Some(Topic::Program) => {
                let content = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
                let stored = body::<Upload>(query.attachment()).and_then(|upload| {
                    upload.verify(&content)?;
                    Ok(upload)
                });
                match stored {
                    Err(why) => refuse(query, &why),
                    Ok(upload) => {
                        let stored = match &last {
                            Some((known, stored)) if *known == upload => stored.clone(),
                            _ => take_program(shared, control.as_mut(), &upload, &content)?,
                        };
                        reply(shared, query, &stored);
                        last = stored.outlook.is_ok().then_some((upload, stored));
                    }
                }
            }
            Some(Topic::Run) => match body::<Order>(query.payload()) {
                Ok(order) if shared.is_of_another(&order) => {}
                Ok(order) => {
                    let state = match &order.what {
                        What::Mdi { line } => run_line(shared, control.as_mut(), &order, line)?,
                        _ => run_program(shared, control.as_mut(), &order)?,
                    };
                    reply(shared, query, state);
                }
                Err(why) => refuse(query, &why),
            },
            _ => refuse(query, "nothing is answered here"),
        }
        Ok(())
    })
}

/// Sends a program to the control, which then has it under a number.
fn send(control: &mut dyn Control, name: &str, content: &[u8]) -> Result<u64, Refused> {
    let begun = control.ask::<method::UploadBegin>(&params::UploadBegin {
        name: name.to_owned(),
        octets: content.len() as u64,
    })?;
    let upload = begun.upload;
    let mut at = 0;
    for part in content.chunks(begun.part_octets.max(1)) {
        let value = Hex(part.to_vec());
        control.ask::<method::UploadAppend>(&params::UploadAppend { upload, at, value })?;
        at += part.len() as u64;
    }
    let sha256 = Hex(Sha256::digest(content).to_vec());
    control.ask::<method::UploadCommit>(&params::UploadCommit { upload, sha256 })?;
    Ok(upload)
}

/// A program that was sent.
fn uploaded(upload: u64) -> params::Program {
    params::Program {
        upload: Some(upload),
        ..Default::default()
    }
}

/// Checks a program and puts it into the folder, if it is right.
fn take_program(
    shared: &Shared<'_>,
    control: &mut dyn Control,
    upload: &Upload,
    content: &[u8],
) -> Result<Stored, Refused> {
    let stored = |outlook| Stored {
        sha256: upload.sha256.clone(),
        outlook,
    };
    if shared.settings.remote < Remote::Upload {
        let why = "the machine file does not let the supervisor send programs: remote = \"upload\" of [cell]";
        return Ok(stored(Err(why.into())));
    }
    let checked =
        send(control, &upload.name, content).and_then(|number| control.ask::<method::ProgramCheck>(&uploaded(number)));
    let outlook = match checked {
        Ok(outlook) => json!(outlook),
        Err(Refused::ByControl(why)) => {
            let why = why.strip_prefix("error: ").unwrap_or(&why);
            return Ok(stored(Err(why.to_owned())));
        }
        Err(gone) => return Err(gone),
    };
    let written = store::write(&shared.settings.programs, &upload.name, content);
    Ok(stored(written.map(|()| outlook).map_err(|cause| cause.to_string())))
}

/// Runs a program that is stored, once for each id.
fn run_program(shared: &Shared<'_>, control: &mut dyn Control, order: &Order) -> Result<OrderState, Refused> {
    let refused = |why: String| Ok(of(&order.id, Phase::Refused, why));
    let What::Run { program, sha256 } = &order.what else {
        return refused("only what moves is ordered under this key".into());
    };
    if !is_id(&order.id) {
        return refused("the id of an order is letters, digits and '-'".into());
    }
    if let Some(known) = shared.ledger().get(&order.id) {
        return Ok(known.state.clone());
    }
    if let Some(why) = shared.bars() {
        return refused(why);
    }
    let content = match store::read(&shared.settings.programs, program) {
        Ok(content) if sum(&content) == *sha256 => content,
        Ok(_) => return refused(format!("{program} has changed since it was sent")),
        Err(cause) => return refused(format!("{program}: {cause}")),
    };
    in_control(control, order, |control| {
        begin(shared, control, order, program, &content)
    })
}

/// Runs a line of MDI; the control carries out an order of this id once.
fn run_line(shared: &Shared<'_>, control: &mut dyn Control, order: &Order, line: &str) -> Result<OrderState, Refused> {
    if let Some(why) = shared.bars() {
        return Ok(of(&order.id, Phase::Refused, why));
    }
    in_control(control, order, |control| {
        let line = json!({ "line": line, REQUEST_ID: order.id });
        control.call(<method::Mdi as Method>::NAME, line)?;
        Ok(of(&order.id, Phase::Completed, "it has begun"))
    })
}

/// Does something that nobody else may come between.
fn in_control(
    control: &mut dyn Control,
    order: &Order,
    run: impl FnOnce(&mut dyn Control) -> Result<OrderState, Refused>,
) -> Result<OrderState, Refused> {
    let supervisor = params::TakeControl {
        name: Some(SUPERVISOR.into()),
        force: None,
    };
    let begun = control
        .ask::<method::TakeControl>(&supervisor)
        .and_then(|_| run(control));
    let released = control.ask::<method::ReleaseControl>(&NoParams {});
    let state = match begun {
        Ok(state) => state,
        Err(Refused::ByControl(why)) => of(&order.id, Phase::Refused, why),
        Err(gone) => return Err(gone),
    };
    released?;
    Ok(state)
}

fn begin(
    shared: &Shared<'_>,
    control: &mut dyn Control,
    order: &Order,
    program: &str,
    content: &[u8],
) -> Result<OrderState, Refused> {
    let number = send(control, program, content)?;
    control.ask::<method::ProgramLoad>(&uploaded(number))?;
    let journal = journal(control, u64::from(u32::MAX))?.last;
    let mut line = Line {
        state: of(&order.id, Phase::Running, ""),
        program: program.to_owned(),
        journal,
    };
    let on_disk = |line: &Line| {
        let not = |cause: io::Error| Refused::ByControl(format!("the disk does not take the order: {cause}"));
        shared.ledger().put(line.clone()).map_err(not)
    };
    on_disk(&line)?;
    // An order with an id: the control carries it out once.
    let start = json!({ REQUEST_ID: order.id });
    match control.call(<method::ProgramStart as Method>::NAME, start) {
        Ok(_) => Ok(line.state),
        Err(Refused::ByControl(why)) => {
            line.state.phase = Phase::Refused;
            line.state.note = why;
            on_disk(&line)?;
            Ok(line.state)
        }
        Err(gone) => Err(gone),
    }
}
