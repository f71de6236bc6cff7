//! The service thread: clients, their lines, their answers.
//!
//! In:  connections and lines of any octets, which the socket thread (`intake`) has taken in.
//! Out: one answer for each request, in any order. Everything a client can make grow has a limit: a client that does not
//! read is not read any more either, and the others do not notice. Subscribers are told of changes as fast as they read.

pub mod door;
mod intake;
pub mod subscription;

pub use intake::{Arrivals, Intake, entrance};

use super::rpc::{self, Request, RpcError, code};
use super::socket::peer;
use door::GUESTS_MAX;
use host::wait::to_next;
use intake::{Arrival, Connection};
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::eventfd::EventFd;
use nix::sys::socket::setsockopt;
use nix::sys::socket::sockopt::SndBuf;
use nix::sys::time::TimeSpec;
use protocol::Role;
use serde_json::Value;
use std::io::{ErrorKind, Write};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use subscription::{State, Subscription, UNREAD_MAX};

/// Clients of the socket at the same time. One more takes the place of the one that has been silent for the longest time, of those that wait for
/// an answer, read what they have subscribed to or have control only where there are no others: a stop must get through whoever
/// else is there.
pub const CLIENTS_MAX: usize = 16;
/// Clients that are taken in one turn: each is read in the next one, before it can be the longest silent of many new ones.
const TAKEN_PER_TURN: usize = 4;
/// Octets of a line without its end.
pub const LINE_MAX: usize = 64 * 1024;
/// With so many octets of answers waiting, a client is not served before it has read.
const OUTPUT_HIGH: usize = 256 * 1024;
/// Requests of one client that wait for a node or for the operator: more than lines of MDI may wait for each other, so that a stop
/// behind them is read.
pub const PENDING_MAX: usize = 96;
/// Longest time between two looks at what real time has to say.
const PERIOD: Duration = Duration::from_millis(20);
/// The same while somebody wants to be told of changes.
const PERIOD_TOLD: Duration = Duration::from_millis(10);

/// Names a request whose answer comes later.
pub type Ticket = u64;

/// Names a connection.
pub type ClientId = u64;

/// Whoever asks, as long as its connection lasts.
#[derive(Debug)]
pub struct Caller {
    /// Its connection.
    pub client: ClientId,
    /// The process at the other end.
    pub process: i32,
    /// What it may do.
    pub role: Role,
    /// What it is called; `None`: as its process.
    pub name: Option<String>,
    /// What it wants to be told.
    pub subscription: Option<Subscription>,
}

/// What the requests are about.
pub trait Serve {
    /// Answers a request; `None`: [`later`](Self::later) brings the answer with this ticket.
    fn call(&mut self, caller: &mut Caller, request: &Request, ticket: Ticket) -> Option<Result<Value, RpcError>>;

    /// Takes in what has come since the last call and gives an answer that is ready.
    fn later(&mut self) -> Option<(Ticket, Result<Value, RpcError>)>;

    /// Whoever waits for this answer has gone. False: to be told again.
    fn gone(&mut self, ticket: Ticket) -> bool;

    /// Whether a connection is worth more than others, silent as it may be.
    fn keeps(&self, client: ClientId) -> bool;

    /// A connection is over.
    fn left(&mut self, client: ClientId);

    /// How everything is, for subscribers.
    fn state(&mut self) -> State;

    /// A notification for a connection that has read all it was told; `None`: nothing is new.
    fn news(&mut self, _client: ClientId) -> Option<String> {
        None
    }

    /// What is written to where an answer is ready or something has changed: ends a wait.
    fn wake(&self) -> Option<Arc<EventFd>>;
}

/// Serves until `stop` whoever arrives.
pub fn serve(arrivals: &Arrivals, service: &mut impl Serve, stop: &AtomicBool) {
    let mut clients: Vec<Client> = Vec::new();
    let mut next_ticket = 0;
    let wake = service.wake();
    while !stop.load(Ordering::Acquire) {
        while let Some((ticket, result)) = service.later() {
            for client in &mut clients {
                client.answer_later(ticket, &result);
            }
        }
        let mut state = None;
        for client in &mut clients {
            client.serve_lines(service, &mut next_ticket);
            client.write();
            if client.is_listening() {
                client.tell(state.get_or_insert_with(|| service.state()));
            }
            client.tell_news(service);
            client.tell_gone(service);
        }
        clients.retain(|client| {
            let stays = !client.is_over();
            if !stays {
                tracing::debug!(client = client.caller.client, "disconnected");
                service.left(client.caller.client);
            }
            stays
        });
        wait(wake.as_deref(), &clients);
        let_in(arrivals, &mut clients, service, &mut next_ticket);
    }
    // What is ready should still arrive.
    clients.iter_mut().for_each(Client::write);
}

/// Waits until something has come, an answer is ready, or a client can be written to.
fn wait(wake: Option<&EventFd>, clients: &[Client]) {
    let writing = clients.iter().filter(|client| !client.output.is_empty());
    let mut fds: Vec<PollFd<'_>> = writing
        .map(|client| PollFd::new(client.connection.stream.as_fd(), PollFlags::POLLOUT))
        .collect();
    let clients_told = clients.iter().any(|client| client.caller.subscription.is_some());
    let period = if clients_told { PERIOD_TOLD } else { PERIOD };
    fds.extend(wake.map(|wake| PollFd::new(wake.as_fd(), PollFlags::POLLIN)));
    // An interrupted or failed wait is a short one.
    let _ = ppoll(&mut fds, Some(TimeSpec::from_duration(to_next(period))), None);
    if let Some(wake) = wake {
        // Empty where nothing has woken it.
        let _ = wake.read();
    }
}

/// Takes over those that have arrived.
fn let_in(arrivals: &Arrivals, clients: &mut Vec<Client>, service: &mut impl Serve, next_ticket: &mut Ticket) {
    for _ in 0..TAKEN_PER_TURN {
        let Arrival { connection, guest } = match arrivals.0.try_recv() {
            Ok(Ok(arrival)) => arrival,
            Ok(Err(cause)) => {
                tracing::warn!(%cause, "connection refused");
                continue;
            }
            Err(_) => return,
        };
        match &guest {
            Some((_, name)) if clients.iter().filter(|client| client.is_guest).count() >= GUESTS_MAX => {
                tracing::warn!(name, "refused: {GUESTS_MAX} guests are there");
                connection.close();
                continue;
            }
            Some(_) => {}
            None => make_room(clients, service),
        }
        *next_ticket += 1;
        tracing::debug!(client = *next_ticket, "connected");
        let mut client = Client::new(connection, *next_ticket);
        if let Some((role, name)) = guest {
            client.is_guest = true;
            client.caller.role = role;
            client.caller.name = Some(name);
        }
        clients.push(client);
    }
}

/// One of the socket's clients goes where there are as many as may be.
fn make_room(clients: &mut Vec<Client>, service: &mut impl Serve) {
    let of_socket = |at: &usize| !clients[*at].is_guest;
    if (0..clients.len()).filter(of_socket).count() < CLIENTS_MAX {
        return;
    }
    // One that waits for an answer goes only where all do.
    let silent = (0..clients.len()).filter(of_socket).min_by_key(|at| {
        let client = &clients[*at];
        let is_here = client.waits() || client.is_listening() || service.keeps(client.caller.client);
        (is_here, client.heard)
    });
    if let Some(mut client) = silent.map(|at| clients.swap_remove(at)) {
        let what = format!("{CLIENTS_MAX} others are connected, and this one was silent for the longest time");
        tracing::warn!(client = client.caller.client, "disconnected: {what}");
        client.answer(&Value::Null, Err(RpcError::new(code::REFUSED, what)));
        client.write();
        client.pending.iter().for_each(|(ticket, _)| _ = service.gone(*ticket));
        service.left(client.caller.client);
    }
}

struct Client {
    /// Named by the ticket of its connection.
    caller: Caller,
    connection: Arc<Connection>,
    /// It came through the door.
    is_guest: bool,
    /// When something of it was heard last: the ticket of that, or of its connection.
    heard: Ticket,
    /// A line that is too long has been refused; its rest is passed over.
    skipping: bool,
    output: Vec<u8>,
    /// Requests that wait for their answer: ticket and id.
    pending: Vec<(Ticket, Option<Value>)>,
    broken: bool,
}

impl Drop for Client {
    fn drop(&mut self) {
        self.connection.close();
    }
}

impl Client {
    fn new(connection: Arc<Connection>, heard: Ticket) -> Client {
        Client {
            caller: Caller {
                client: heard,
                process: peer(&connection.stream).map_or(0, |peer| peer.pid()),
                role: Role::SetUp,
                name: None,
                subscription: None,
            },
            connection,
            is_guest: false,
            heard,
            skipping: false,
            output: Vec::new(),
            pending: Vec::new(),
            broken: false,
        }
    }

    fn is_over(&self) -> bool {
        let is_broken = self.is_broken();
        let heard = self.connection.heard();
        let served = heard.ended && self.pending.is_empty() && self.output.is_empty() && heard.octets.is_empty();
        is_broken && self.pending.iter().all(|(_, id)| id.is_none()) || served
    }

    fn is_broken(&self) -> bool {
        self.broken || self.connection.heard().broken
    }

    /// Whether it has asked for something that it has no answer to.
    fn waits(&self) -> bool {
        !self.pending.is_empty() || !self.connection.heard().octets.is_empty()
    }

    /// Whether it wants to be told of changes and has read the last ones.
    fn is_listening(&self) -> bool {
        self.caller.subscription.is_some() && self.output.is_empty() && !self.is_broken()
    }

    fn may_be_served(&self) -> bool {
        self.output.len() < OUTPUT_HIGH && self.pending.len() < PENDING_MAX
    }

    /// Serves whole lines while the client takes the answers.
    fn serve_lines(&mut self, service: &mut impl Serve, next_ticket: &mut Ticket) {
        while self.may_be_served() {
            let line = match self.connection.next_line() {
                Ok(Some(line)) => line,
                Ok(None) => return,
                Err(()) => {
                    if !std::mem::replace(&mut self.skipping, true) {
                        self.refuse_long_line();
                    }
                    return;
                }
            };
            if std::mem::take(&mut self.skipping) {
                continue;
            }
            if line.len() > LINE_MAX {
                self.refuse_long_line();
            } else if !line.iter().all(u8::is_ascii_whitespace) {
                *next_ticket += 1;
                self.heard = *next_ticket;
                self.serve_line(&line, service, *next_ticket);
            }
        }
    }

    fn serve_line(&mut self, line: &[u8], service: &mut impl Serve, ticket: Ticket) {
        match rpc::parse(line) {
            Err((id, error)) => self.answer(&id, Err(error)),
            Ok(request) => {
                let subscribed = self.caller.subscription.is_some();
                match (service.call(&mut self.caller, &request, ticket), request.id) {
                    (Some(result), Some(id)) => self.answer(&id, result),
                    // A notification is carried out and not answered.
                    (Some(_), None) => {}
                    (None, id) => self.pending.push((ticket, id)),
                }
                if !subscribed && self.caller.subscription.is_some() {
                    // What it does not read is soon full: it is to find there how everything is, not how it was. Without, that
                    // is more.
                    let _ = setsockopt(&self.connection.stream, SndBuf, &UNREAD_MAX);
                }
            }
        }
    }

    /// Tells what has changed.
    fn tell(&mut self, state: &State) {
        if let Some(subscription) = &mut self.caller.subscription
            && let Some(line) = subscription.notification(state)
        {
            self.output.extend_from_slice(line.as_bytes());
            self.write();
        }
    }

    /// Tells what it has asked to be told beside the state.
    fn tell_news(&mut self, service: &mut impl Serve) {
        // Bounded: what is new grows with the time that passes.
        while self.output.is_empty()
            && !self.is_broken()
            && let Some(line) = service.news(self.caller.client)
        {
            self.output.extend_from_slice(line.as_bytes());
            self.write();
        }
    }

    /// Tells that nobody waits for the answers any more. One that says no more may still wait; notifications never did.
    fn tell_gone(&mut self, service: &mut impl Serve) {
        if !self.pending.is_empty() && (self.is_broken() || self.connection.heard().ended && self.has_hung_up()) {
            self.pending
                .retain(|(ticket, id)| id.is_none() || !service.gone(*ticket));
        }
    }

    fn has_hung_up(&self) -> bool {
        let mut fd = [PollFd::new(self.connection.stream.as_fd(), PollFlags::empty())];
        // A look and no wait.
        let looked = ppoll(&mut fd, Some(TimeSpec::from_duration(Duration::ZERO)), None).is_ok();
        looked
            && fd[0]
                .revents()
                .is_some_and(|events| events.contains(PollFlags::POLLHUP))
    }

    fn refuse_long_line(&mut self) {
        let what = format!("the line is longer than {LINE_MAX} octets");
        self.answer(&Value::Null, Err(RpcError::new(code::INVALID_REQUEST, what)));
    }

    fn answer_later(&mut self, ticket: Ticket, result: &Result<Value, RpcError>) {
        let Some(at) = self.pending.iter().position(|(own, _)| *own == ticket) else {
            return;
        };
        if let (_, Some(id)) = self.pending.swap_remove(at) {
            self.answer(&id, result.clone());
        }
    }

    fn answer(&mut self, id: &Value, result: Result<Value, RpcError>) {
        self.output.extend_from_slice(rpc::answer(id, result).as_bytes());
    }

    fn write(&mut self) {
        while !self.output.is_empty() {
            match (&self.connection.stream).write(&self.output) {
                Ok(0) => self.broken = true,
                Ok(length) => drop(self.output.drain(..length)),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.broken = true,
            }
            if self.broken {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests;
