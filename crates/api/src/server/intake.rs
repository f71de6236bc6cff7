//! The socket thread: takes in connections and what they say, whatever the service is about.
//!
//! In:  connections, guests at the door, octets.
//! Out: arrivals and what they have said, for the service; what brings the machine to rest, at once.
//!
//! It parses no more than the lines that may bring the machine to rest, writes nothing, and waits for nobody: neither a method that
//! takes long nor a disk or a terminal that holds up the service keeps a stop from the cycle.

use super::door::{Door, Guest, Guests, door};
use super::{CLIENTS_MAX, LINE_MAX};
use crate::repeats;
use crate::rpc::{self, Request};
use crate::server::door::GUESTS_MAX;
use crate::socket::{Socket, check_peer};
use host::wait::to_next;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::eventfd::{EfdFlags, EventFd};
use nix::sys::time::TimeSpec;
use protocol::Role;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read};
use std::net::Shutdown;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Octets read at once.
const CHUNK: usize = 4096;
/// Longest time between two looks at whether all is over.
const PERIOD: Duration = Duration::from_millis(20);
/// Connections at the same time: those that are served, and as many that wait for it.
const CONNECTIONS_MAX: usize = 2 * CLIENTS_MAX + GUESTS_MAX;
/// Ids of orders that are remembered, so that one that comes twice acts once.
const IDS_MAX: usize = 256;
/// What the name of each method has in it that acts at once: other lines are not parsed here.
const AT_ONCE: [&[u8]; 2] = [b"stop", b"hold"];

/// One connection, between the thread that reads it and the one that serves it.
#[derive(Debug)]
pub(super) struct Connection {
    pub(super) stream: UnixStream,
    heard: Mutex<Heard>,
    /// The service has let it go.
    is_over: AtomicBool,
    /// Ends a wait of the socket thread.
    room: Option<Arc<EventFd>>,
}

/// What has come and is not served yet: at most a line and a chunk.
#[derive(Debug, Default)]
pub(super) struct Heard {
    pub(super) octets: Vec<u8>,
    /// Nothing more will come.
    pub(super) ended: bool,
    pub(super) broken: bool,
}

impl Heard {
    /// Whether more is to be read.
    fn has_room(&self) -> bool {
        !self.ended && !self.broken && self.octets.len() <= LINE_MAX
    }
}

impl Connection {
    pub(super) fn new(stream: UnixStream, room: Option<Arc<EventFd>>) -> Connection {
        Connection {
            stream,
            heard: Mutex::default(),
            is_over: AtomicBool::new(false),
            room,
        }
    }

    /// What has come. Neither side keeps it for long.
    pub(super) fn heard(&self) -> MutexGuard<'_, Heard> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next line without its end, if a whole one has come; or that what has come is too long for one (`Err`), and is dropped.
    pub(super) fn next_line(&self) -> Result<Option<Vec<u8>>, ()> {
        let mut heard = self.heard();
        let had_room = heard.has_room();
        let line = match heard.octets.iter().position(|octet| *octet == b'\n') {
            Some(end) => {
                let mut line: Vec<u8> = heard.octets.drain(..=end).collect();
                line.pop();
                if line.ends_with(b"\r") {
                    line.pop();
                }
                Ok(Some(line))
            }
            None if heard.octets.len() > LINE_MAX => {
                heard.octets.clear();
                Err(())
            }
            None => Ok(None),
        };
        if !had_room && heard.has_room() {
            self.tell_room();
        }
        line
    }

    /// Nobody serves it any more.
    pub(super) fn close(&self) {
        self.is_over.store(true, Ordering::Release);
        // Fails where the other end has gone.
        let _ = self.stream.shutdown(Shutdown::Both);
        self.tell_room();
    }

    fn tell_room(&self) {
        if let Some(room) = &self.room {
            // It can fail only where it is full, and then it wakes, too.
            let _ = room.write(1);
        }
    }
}

/// A connection that is to be served.
#[derive(Debug)]
pub(super) struct Arrival {
    pub(super) connection: Arc<Connection>,
    /// What it may do and is called, if it came through the door.
    pub(super) guest: Option<(Role, String)>,
}

/// Where the service takes connections over, and hears of those that were refused.
#[derive(Debug)]
pub struct Arrivals(pub(super) Receiver<io::Result<Arrival>>);

/// The socket thread's side.
#[derive(Debug)]
pub struct Intake {
    arrivals: Sender<io::Result<Arrival>>,
    guests: Guests,
    /// Ends a wait of the service.
    wake: Option<Arc<EventFd>>,
    /// Ends a wait here.
    room: Option<Arc<EventFd>>,
    /// Ids of orders that have acted.
    ids: VecDeque<String>,
}

/// The way in; `wake`: as of [`Serve::wake`](super::Serve::wake).
pub fn entrance(wake: Option<Arc<EventFd>>) -> (Door, Intake, Arrivals) {
    let flags = EfdFlags::EFD_NONBLOCK | EfdFlags::EFD_CLOEXEC;
    let room = EventFd::from_flags(flags).ok().map(Arc::new);
    let (door, guests) = door(room.clone());
    let (arrivals, inside) = channel();
    let intake = Intake {
        arrivals,
        guests,
        wake,
        room,
        ids: VecDeque::new(),
    };
    (door, intake, Arrivals(inside))
}

/// A connection that is read.
pub(super) struct Talker {
    connection: Arc<Connection>,
    /// The line under way.
    line: Vec<u8>,
    /// It is too long for one.
    is_long: bool,
}

impl Intake {
    /// Takes in until `stop`; without a socket only whoever comes through the door. `at_once`: is told of each request whose method
    /// has "stop" or "hold" in its name, once for each id.
    pub fn run(mut self, socket: Option<&Socket>, at_once: &dyn Fn(&Request), stop: &AtomicBool) {
        let mut talkers: Vec<Talker> = Vec::new();
        while !stop.load(Ordering::Acquire) {
            talkers.retain(|talker| !talker.connection.is_over.load(Ordering::Acquire));
            let heard = self.ready(socket, &talkers);
            let mut is_new = !heard.is_empty();
            for at in heard {
                for line in talkers[at].read() {
                    self.act(&line, at_once);
                }
            }
            is_new |= self.let_in(socket, &mut talkers);
            if is_new && let Some(wake) = &self.wake {
                // It can fail only where it is full, and then it wakes, too.
                let _ = wake.write(1);
            }
        }
    }

    /// Waits; the places of those that have said something.
    pub(super) fn ready(&self, socket: Option<&Socket>, talkers: &[Talker]) -> Vec<usize> {
        let (places, mut fds): (Vec<usize>, Vec<PollFd<'_>>) = talkers
            .iter()
            .enumerate()
            .filter(|(_, talker)| talker.connection.heard().has_room())
            .map(|(at, talker)| (at, PollFd::new(talker.connection.stream.as_fd(), PollFlags::POLLIN)))
            .unzip();
        if talkers.len() < CONNECTIONS_MAX {
            fds.extend(socket.map(|socket| PollFd::new(socket.listener().as_fd(), PollFlags::POLLIN)));
        }
        fds.extend((self.room.as_ref()).map(|room| PollFd::new(room.as_fd(), PollFlags::POLLIN)));
        // An interrupted or failed wait is a short one.
        let _ = ppoll(&mut fds, Some(TimeSpec::from_duration(to_next(PERIOD))), None);
        if let Some(room) = &self.room {
            // Empty where nothing has woken it.
            let _ = room.read();
        }
        let pairs = places.into_iter().zip(&fds);
        pairs
            .filter(|(_, fd)| fd.any().unwrap_or(false))
            .map(|(at, _)| at)
            .collect()
    }

    /// Does what a line asks for that waits for nobody.
    fn act(&mut self, line: &[u8], at_once: &dyn Fn(&Request)) {
        let may_act = |line: &[u8]| {
            AT_ONCE
                .iter()
                .any(|word| line.windows(word.len()).any(|part| part == *word))
        };
        if !may_act(line) {
            return;
        }
        let Ok(request) = rpc::parse(line) else { return };
        if !may_act(request.method.as_bytes()) {
            return;
        }
        match repeats::id(&request.params) {
            Ok(None) => {}
            // It has acted.
            Ok(Some(id)) if self.ids.iter().any(|known| known == id) => return,
            Ok(Some(id)) => {
                self.ids.push_back(id.to_owned());
                if self.ids.len() > IDS_MAX {
                    self.ids.pop_front();
                }
            }
            Err(_) => return,
        }
        at_once(&request);
    }

    /// Whoever is at the socket or at the door comes in; whether there was anybody.
    fn let_in(&self, socket: Option<&Socket>, talkers: &mut Vec<Talker>) -> bool {
        let before = talkers.len();
        while talkers.len() < CONNECTIONS_MAX {
            let Some(socket) = socket else { break };
            let stream = match socket.listener().accept() {
                Ok((stream, _)) => stream,
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => break,
                Err(_) => {
                    // It stays at the door, and no wait would last: this process has no room for another file.
                    std::thread::sleep(PERIOD);
                    break;
                }
            };
            match stream.set_nonblocking(true).and_then(|()| check_peer(&stream)) {
                Ok(()) => self.take(stream, None, talkers),
                // Told by the service: a terminal may hold up whoever writes to it. Nobody hears it where that has ended.
                Err(cause) => _ = self.arrivals.send(Err(cause)),
            }
        }
        while talkers.len() < CONNECTIONS_MAX {
            let Ok(Guest { stream, role, name }) = self.guests.0.try_recv() else {
                break;
            };
            self.take(stream, Some((role, name)), talkers);
        }
        talkers.len() > before
    }

    fn take(&self, stream: UnixStream, guest: Option<(Role, String)>, talkers: &mut Vec<Talker>) {
        let connection = Arc::new(Connection::new(stream, self.room.clone()));
        let arrival = Arrival {
            connection: Arc::clone(&connection),
            guest,
        };
        // Nobody serves any more.
        if self.arrivals.send(Ok(arrival)).is_ok() {
            talkers.push(Talker::new(connection));
        }
    }
}

impl Talker {
    pub(super) fn new(connection: Arc<Connection>) -> Talker {
        Talker {
            connection,
            line: Vec::new(),
            is_long: false,
        }
    }

    /// Takes in what has come; the lines that it ends.
    pub(super) fn read(&mut self) -> Vec<Vec<u8>> {
        let mut chunk = [0; CHUNK];
        let read = (&self.connection.stream).read(&mut chunk);
        let mut heard = self.connection.heard();
        match read {
            Ok(0) => {
                heard.ended = true;
                // The last line may lack its end.
                if !heard.octets.is_empty() {
                    heard.octets.push(b'\n');
                }
                drop(heard);
                self.lines(b"\n")
            }
            Ok(length) => {
                heard.octets.extend_from_slice(&chunk[..length]);
                drop(heard);
                self.lines(&chunk[..length])
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Vec::new(),
            Err(_) => {
                heard.broken = true;
                Vec::new()
            }
        }
    }

    /// The lines that these octets end.
    fn lines(&mut self, octets: &[u8]) -> Vec<Vec<u8>> {
        let mut lines = Vec::new();
        for part in octets.split_inclusive(|octet| *octet == b'\n') {
            self.is_long |= self.line.len() + part.len() > LINE_MAX + 1;
            match self.is_long {
                true => self.line.clear(),
                false => self.line.extend_from_slice(part),
            }
            if part.ends_with(b"\n") {
                let line = std::mem::take(&mut self.line);
                if !std::mem::take(&mut self.is_long) {
                    lines.push(line);
                }
            }
        }
        lines
    }
}
