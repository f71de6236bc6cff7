//! The loop of a supervisor, and the socket by which people of this PC ask it.
//!
//! In:  events of controls and of people. Out: what [`Core`] makes of them.
//!
//! The socket is `supervisor.socket` in the state folder, for its user only. A request is a line of JSON, [`Request`], and behind it as
//! many octets as it says; an answer is a line of JSON.

use crate::core::{Ask, Core, Event, Reply};
use crate::net::{Events, Net, Queue, Refusals};
use crate::page;
use crate::store::Store;
use crate::trust;
use anyhow::{Context, bail};
use cell_link::carrier::LEASE;
use cell_link::message::PROGRAM_MAX;
use nix::fcntl::{Flock, FlockArg};
use nix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::SocketAddr;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Longest line of a request, octets.
const LINE_MAX: u64 = 64 << 10;
/// People who are served at the same time.
const PEOPLE_MAX: usize = 16;
/// Events of one batch.
const BATCH: usize = 1024;
/// What is due is looked at so often.
const TICK: Duration = Duration::from_millis(200);
/// The list of certificates is looked at so often.
const REFRESH: Duration = Duration::from_secs(1);
/// What a supervisor needs at the most for an answer, and more.
const LONGEST_ANSWER: Duration = Duration::from_secs(120);
/// Somebody who says nothing for so long is not served.
const PATIENCE: Duration = Duration::from_secs(10);

/// Where a supervisor is.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Its state folder.
    pub state: PathBuf,
    /// Folder of the authority.
    pub ca: PathBuf,
    /// Where controls connect.
    pub listen: SocketAddr,
    /// Names under which controls reach this PC, beside those that it knows itself.
    pub names: Vec<String>,
    /// Where the page is.
    pub page: Option<SocketAddr>,
    /// What is older than so many days, and not open, is kept no longer; 0: everything is kept.
    pub keep_days: u32,
}

/// What somebody asks through the socket.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// What is asked.
    pub ask: Ask,
    /// Octets of a program that follow.
    #[serde(default)]
    pub octets: usize,
}

/// Seconds since 1970, UTC.
pub fn now() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0.0, |since| since.as_secs_f64())
}

/// Ids that nobody has had: this moment, this process, a number.
pub fn ids() -> Box<dyn FnMut() -> String + Send> {
    let begun = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_nanos());
    let mut number = 0u64;
    Box::new(move || {
        number += 1;
        format!("{begun:x}-{:x}-{number}", std::process::id())
    })
}

/// A supervisor that runs.
pub struct Supervisor {
    core: Core,
    net: Net,
    events: Queue,
    _lock: Flock<File>,
}

/// What encryption refuses, once it is a layer of the log.
pub static REFUSALS: Refusals = Refusals::new();

/// Whom the supervisor tells that it is asked.
#[derive(Clone)]
pub struct Desk(Events);

impl Desk {
    /// Asks, and waits for the answer.
    ///
    /// # Errors
    /// In the words of the supervisor.
    pub fn ask(&self, ask: Ask) -> Result<Value, String> {
        let (sender, answer) = sync_channel(1);
        // Nobody may wait any more.
        let reply: Reply = Box::new(move |answer| drop(sender.try_send(answer)));
        self.0.give(Event::Ask(ask, reply));
        let ended = |_| "the supervisor is too busy, or has ended".to_owned();
        answer.recv_timeout(Duration::from_secs(90)).map_err(ended)?
    }
}

impl Supervisor {
    /// Begins: from here on it listens.
    ///
    /// # Errors
    /// Another one runs in this folder; a file or an address cannot be had.
    pub fn begin(settings: &Settings) -> anyhow::Result<(Supervisor, Desk)> {
        let state = &settings.state;
        let place = || format!("{}", state.display());
        files::make_folder(state).with_context(place)?;
        trust::folder(state).with_context(place)?;
        // Programs and the journal of a shop are nobody else's.
        std::fs::set_permissions(state, std::fs::Permissions::from_mode(0o700))
            .with_context(|| format!("{}: only its owner may make it his alone", state.display()))?;
        for name in ["lock", "cell.db", "cell.db-wal", "cell.db-shm"] {
            let file = state.join(name);
            trust::file(&file).with_context(|| format!("{}", file.display()))?;
        }
        let lock = state.join("lock");
        let file = File::options()
            .create(true)
            .append(true)
            .open(&lock)
            .with_context(|| format!("{}", lock.display()))?;
        let Ok(lock) = Flock::lock(file, FlockArg::LockExclusiveNonblock) else {
            bail!("{}: another supervisor runs here", state.display());
        };
        let store = Store::open(&state.join("cell.db"))?;
        let mut core = Core::new(store, ids()).context("the store cannot be read")?;
        core.keep_days(settings.keep_days);
        let (sender, events) = Events::queue();
        REFUSALS.to(sender.clone());
        let net = Net::listen(&settings.ca, state, settings.listen, &settings.names, sender.clone())?;
        let supervisor = Supervisor {
            core,
            net,
            events,
            _lock: lock,
        };
        Ok((supervisor, Desk(sender)))
    }

    /// Works until `stop`.
    pub fn run(mut self, stop: &AtomicBool) {
        let mut refreshed = Instant::now();
        let mut dropped = 0;
        // Why all links are to be opened anew.
        let mut anew = None;
        let has_slept = watch_for_sleep();
        while !stop.load(Ordering::Relaxed) {
            let mut batch = Vec::new();
            match self.events.recv_timeout(TICK) {
                Ok(event) => batch.push(event),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            batch.extend(self.events.try_iter().take(BATCH));
            for question in self.core.take(batch, now()) {
                self.net.ask(question);
            }
            if refreshed.elapsed() >= REFRESH {
                refreshed = Instant::now();
                if has_slept.swap(false, Ordering::Relaxed) {
                    anew = Some("this process was stopped for a while");
                }
                if REFUSALS.takes_out_of_files() {
                    anew = Some("connections of strangers have taken all files of this process");
                }
                if let Some(why) = anew {
                    match self.net.open_anew() {
                        Ok(()) => {
                            tracing::info!("{why}: all controls connect anew");
                            anew = None;
                        }
                        Err(cause) => tracing::error!("{cause}"),
                    }
                }
                match self.net.refresh() {
                    Ok(true) => tracing::info!("the list of certificates has changed: all controls connect anew"),
                    Ok(false) => {}
                    Err(cause) => tracing::error!("{cause}"),
                }
                let now_dropped = self.net.dropped();
                if now_dropped > dropped {
                    tracing::warn!(
                        "{} events came too fast and were dropped; they are asked for again",
                        now_dropped - dropped
                    );
                    dropped = now_dropped;
                }
            }
        }
        self.net.close();
    }
}

/// Time since this PC was started, with that in which it slept.
fn since_start() -> Duration {
    clock_gettime(ClockId::CLOCK_BOOTTIME).map_or(Duration::ZERO, Duration::from)
}

/// Tells whether this process was stopped for longer than a link bears: its controls have then left behind connections by the hundred,
/// and Zenoh takes 0.1 s for each before it takes those that count.
fn watch_for_sleep() -> Arc<AtomicBool> {
    let has_slept = Arc::new(AtomicBool::new(false));
    let told = Arc::downgrade(&has_slept);
    let watch = move || {
        let mut last = since_start();
        loop {
            std::thread::sleep(TICK);
            let Some(told) = told.upgrade() else { return };
            let now = since_start();
            if now.saturating_sub(last) > LEASE {
                told.store(true, Ordering::Relaxed);
            }
            last = now;
        }
    };
    if let Err(cause) = std::thread::Builder::new().name("sleep".into()).spawn(watch) {
        tracing::warn!("{cause}");
    }
    has_slept
}

/// Runs a supervisor until `stop`; `ready` is called once everything listens.
///
/// # Errors
/// As [`Supervisor::begin`].
pub fn run(
    settings: &Settings,
    stop: &Arc<AtomicBool>,
    ready: impl FnOnce() -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let (supervisor, desk) = Supervisor::begin(settings)?;
    let path = socket(&settings.state);
    // The lock says that nobody else has it.
    match std::fs::remove_file(&path) {
        Err(cause) if cause.kind() != ErrorKind::NotFound => {
            Err(cause).with_context(|| format!("{}", path.display()))?
        }
        _ => {}
    }
    let listener = UnixListener::bind(&path).with_context(|| format!("{}", path.display()))?;
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600))
        .with_context(|| format!("{}", path.display()))?;
    let people = desk.clone();
    std::thread::Builder::new()
        .name("people".into())
        .spawn(move || serve_people(&listener, &people))?;
    if let Some(address) = settings.page {
        page::begin(address, desk).with_context(|| format!("the page cannot listen at {address}"))?;
    }
    ready()?;
    supervisor.run(stop);
    // It may have gone with its folder.
    let _ = std::fs::remove_file(&path);
    Ok(())
}

fn socket(state: &Path) -> PathBuf {
    state.join("supervisor.socket")
}

fn serve_people(listener: &UnixListener, desk: &Desk) {
    let served = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming() {
        let Ok(stream) = stream else {
            // Too many open files: without a pause this would take a processor for itself.
            std::thread::sleep(TICK);
            continue;
        };
        if served.load(Ordering::Relaxed) >= PEOPLE_MAX {
            // Whoever does not take so little is not waited for.
            let _ = stream.set_nonblocking(true);
            let why = format!("{PEOPLE_MAX} are served already: try again");
            let _ = answer(&stream, &Err(why));
            continue;
        }
        served.fetch_add(1, Ordering::Relaxed);
        let (desk, served) = (desk.clone(), Arc::clone(&served));
        let work = move || {
            if let Err(cause) = serve_one(&stream, &desk) {
                tracing::debug!("{cause}");
            }
            served.fetch_sub(1, Ordering::Relaxed);
        };
        if let Err(cause) = std::thread::Builder::new().name("asks".into()).spawn(work) {
            tracing::warn!("{cause}");
        }
    }
}

/// Reads one request.
///
/// # Errors
/// It is none; in words.
pub fn read_request(from: &mut impl BufRead) -> Result<Ask, String> {
    let mut line = Vec::new();
    from.by_ref()
        .take(LINE_MAX)
        .read_until(b'\n', &mut line)
        .map_err(|cause| cause.to_string())?;
    let request: Request = serde_json::from_slice(&line).map_err(|error| format!("no request: {error}"))?;
    if request.octets > PROGRAM_MAX {
        return Err(format!("{} octets, and {PROGRAM_MAX} are the most", request.octets));
    }
    let mut octets = Vec::new();
    from.take(request.octets as u64)
        .read_to_end(&mut octets)
        .map_err(|cause| cause.to_string())?;
    if octets.len() < request.octets {
        return Err(format!("{} of {} octets have come", octets.len(), request.octets));
    }
    let mut ask = request.ask;
    if let Ask::Upload { content, .. } | Ask::Add { content, .. } = &mut ask {
        *content = octets;
    }
    Ok(ask)
}

fn serve_one(stream: &UnixStream, desk: &Desk) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let result = read_request(&mut BufReader::new(stream)).and_then(|ask| desk.ask(ask));
    answer(stream, &result)
}

fn answer(mut stream: &UnixStream, result: &Result<Value, String>) -> std::io::Result<()> {
    let answer = match result {
        Ok(result) => json!({ "result": result }),
        Err(why) => json!({ "error": why }),
    };
    stream.write_all(format!("{answer}\n").as_bytes())
}

/// Asks the supervisor of a folder, from another process.
///
/// # Errors
/// None runs there; or in its words.
pub fn ask(state: &Path, ask: &Ask) -> anyhow::Result<Value> {
    let path = socket(state);
    let mut stream = UnixStream::connect(&path).map_err(|cause| {
        let dir = state.display();
        match cause.kind() {
            ErrorKind::NotFound | ErrorKind::ConnectionRefused => anyhow::anyhow!(
                "no supervisor runs in {dir}: isocnc-cell run --dir {dir} --ca CA --listen ADDRESS:PORT"
            ),
            _ => anyhow::Error::new(cause).context(format!("{}", path.display())),
        }
    })?;
    let content = match ask {
        Ask::Upload { content, .. } | Ask::Add { content, .. } => &content[..],
        _ => &[],
    };
    let request = Request {
        ask: ask.clone(),
        octets: content.len(),
    };
    stream.set_read_timeout(Some(LONGEST_ANSWER))?;
    stream.set_write_timeout(Some(LONGEST_ANSWER))?;
    let silent = |cause: std::io::Error| match cause.kind() {
        ErrorKind::WouldBlock => anyhow::anyhow!(
            "the supervisor has not answered for {} s: its process is stopped, or has too much to do; what was ordered may still be done",
            LONGEST_ANSWER.as_secs()
        ),
        _ => anyhow::Error::new(cause).context("the supervisor does not answer"),
    };
    let sent = stream
        .write_all((serde_json::to_string(&request)? + "\n").as_bytes())
        .and_then(|()| stream.write_all(content));
    let mut answer = Vec::new();
    match sent {
        Err(cause) if cause.kind() == ErrorKind::WouldBlock => return Err(silent(cause)),
        // One that refuses does not read all of it, and says why.
        _ => {
            let read = stream.read_to_end(&mut answer);
            if answer.is_empty() {
                sent.and(read.map(drop)).map_err(silent)?;
            }
        }
    }
    let mut answer: Value = serde_json::from_slice(&answer).context("the supervisor has ended meanwhile")?;
    match answer["error"].as_str() {
        Some(why) => bail!("{why}"),
        None => Ok(answer["result"].take()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_program_comes_behind_its_request() {
        let text = b"{\"ask\":{\"upload\":{\"machine\":\"mill\",\"name\":\"p.ngc\"}},\"octets\":3}\nG0\n";
        let expected = Ask::Upload {
            machine: "mill".into(),
            name: "p.ngc".into(),
            content: b"G0\n".to_vec(),
        };
        assert_eq!(read_request(&mut &text[..]), Ok(expected));
        let short = read_request(&mut &text[..text.len() - 1]).unwrap_err();
        assert_eq!(short, "2 of 3 octets have come");
        let error = read_request(&mut &b"{\"ask\":\"dance\"}\n"[..]).unwrap_err();
        assert!(error.contains("unknown variant `dance`"), "{error}");
        let long = format!("{{\"ask\":\"queue\",\"octets\":{}}}\n", PROGRAM_MAX + 1);
        assert!(read_request(&mut long.as_bytes()).unwrap_err().contains("the most"));
    }

    proptest! {
        #[test]
        fn no_request_panics(octets in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = read_request(&mut &octets[..]);
        }
    }
}
