//! The server's end: answers the commands of a few clients from an object dictionary.
//!
//! In:  service data of received SDO frames with the node id of their sender, the objects.
//! Out: answers, kept until the client has them.
//!
//! The server has no clock: the client repeats what got lost, and a repeated command is answered again without being carried
//! out twice. A long value that an object takes or gives as a whole is kept in a staging area, one for each connection; what
//! does not fit there is refused with [`AbortCode::OUT_OF_MEMORY`](obd::AbortCode::OUT_OF_MEMORY), see [`Objects`] for objects that pass in parts.

mod transfer;

use obd::Objects;

use super::command::{self, Content, SEGMENT_MAX};
use super::sequence::{self, Arrival, Con, Flow, Number, Sequence, WINDOW};
use super::service_data::{EMPTY_LEN, SERVICE_DATA_MAX};
use transfer::{Tickets, Transfer};

/// Where a connection stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// No connection.
    Closed,
    /// The client asked for a connection and was answered.
    Opening,
    /// Commands are taken.
    Open,
}

/// A frame that waits beside those with answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pending {
    Nothing,
    /// Handshake, acknowledge, or that there is no connection (again); an answer does as well.
    Reply,
    /// Frames are missing: ask for them.
    Missing,
}

/// An answer from the command header on.
#[derive(Clone, Copy, Debug)]
struct Frame {
    len: usize,
    octets: [u8; command::HEADER_LEN + SEGMENT_MAX],
}

#[derive(Clone, Debug)]
struct Connection<const STAGING: usize> {
    client: u8,
    state: State,
    flow: Flow,
    pending: Pending,
    /// The client was told that frames are missing, and none has come since.
    missing_told: bool,
    /// Frames in flight, the oldest at `oldest`.
    history: [Frame; WINDOW as usize],
    oldest: usize,
    transfer: Transfer<STAGING>,
    /// Value of the server's clock of events at the last frame of this client.
    used_at: u32,
}

/// SDO server for up to `CONNECTIONS` clients; a further client takes the place of the one that was silent longest. Values of
/// up to `STAGING` octets pass as a whole.
#[derive(Clone, Debug)]
pub struct Server<const CONNECTIONS: usize = 2, const STAGING: usize = 1024> {
    connections: [Connection<STAGING>; CONNECTIONS],
    tickets: Tickets,
    events: u32,
    /// Where the search for the next answer to be sent starts, so that no client is starved.
    turn: usize,
}

impl<const CONNECTIONS: usize, const STAGING: usize> Default for Server<CONNECTIONS, STAGING> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const CONNECTIONS: usize, const STAGING: usize> Server<CONNECTIONS, STAGING> {
    /// A server without connections.
    pub fn new() -> Self {
        const { assert!(CONNECTIONS > 0) };
        Server {
            connections: core::array::from_fn(|_| Connection::new(0)),
            tickets: 0,
            events: 0,
            turn: 0,
        }
    }

    /// Takes the service data of an SDO frame sent by node `client`. Frames that make no sense are dropped; never panics.
    pub fn receive(&mut self, client: u8, service_data: &[u8], objects: &mut impl Objects) {
        let Some(sequence) = Sequence::parse(service_data) else {
            return;
        };
        let content = Content::parse(&service_data[sequence::HEADER_LEN..]);
        if content == Content::Malformed {
            return;
        }
        self.events = self.events.wrapping_add(1).max(1);
        let at = self.connection(client, objects);
        let connection = &mut self.connections[at];
        connection.used_at = self.events;
        connection.receive(sequence, content, objects, &mut self.tickets);
    }

    /// Finds the place of a client, or makes one.
    fn connection(&mut self, client: u8, objects: &mut impl Objects) -> usize {
        let events = self.events;
        let known = self
            .connections
            .iter()
            .position(|connection| connection.client == client && connection.used_at != 0);
        known.unwrap_or_else(|| {
            let silence = |connection: &Connection<STAGING>| match connection.used_at {
                0 => u32::MAX,
                used_at => events.wrapping_sub(used_at),
            };
            let longest = (0..CONNECTIONS)
                .rev()
                .max_by_key(|at| silence(&self.connections[*at]))
                .unwrap_or(0);
            let connection = &mut self.connections[longest];
            connection.close(objects, self.tickets);
            connection.client = client;
            longest
        })
    }

    /// Whether there is a connection with this client.
    pub fn serves(&self, client: u8) -> bool {
        self.connections
            .iter()
            .any(|connection| connection.client == client && connection.state != State::Closed)
    }

    /// Number of frames that wait for the asynchronous slot.
    pub fn pending(&self) -> usize {
        self.connections.iter().map(Connection::pending).sum()
    }

    /// Writes the service data of the next frame into `out` and returns the node id of its receiver and the length. `None`:
    /// nothing to send.
    pub fn poll_transmit(&mut self, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<(u8, usize)> {
        let at = (0..CONNECTIONS)
            .map(|step| (self.turn + step) % CONNECTIONS)
            .find(|at| self.connections[*at].pending() > 0)?;
        let connection = &mut self.connections[at];
        let len = connection.transmit(out)?;
        let client = connection.client;
        self.turn = (at + 1) % CONNECTIONS;
        Some((client, len))
    }

    /// Forgets all connections, as after a reset of the node. Objects that pass in parts are not told; their next write begins
    /// again anyway.
    pub fn reset(&mut self) {
        *self = Self::new();
    }
}

impl<const STAGING: usize> Connection<STAGING> {
    fn new(client: u8) -> Self {
        Connection {
            client,
            state: State::Closed,
            flow: Flow::new(Number::default()),
            pending: Pending::Nothing,
            missing_told: false,
            history: [Frame {
                len: 0,
                octets: [0; command::HEADER_LEN + SEGMENT_MAX],
            }; WINDOW as usize],
            oldest: 0,
            transfer: Transfer::new(),
            used_at: 0,
        }
    }

    fn close(&mut self, objects: &mut impl Objects, tickets: Tickets) {
        self.transfer.cancel(objects, tickets);
        self.state = State::Closed;
        self.flow = Flow::new(Number::default());
        self.pending = Pending::Nothing;
        self.missing_told = false;
    }

    fn receive(&mut self, sequence: Sequence, content: Content<'_>, objects: &mut impl Objects, tickets: &mut Tickets) {
        match (self.state, sequence.received_con, sequence.sent_con) {
            (_, Con::None, Con::Init) => {
                self.close(objects, *tickets);
                self.flow = Flow::new(sequence.sent);
                self.state = State::Opening;
                self.pending = Pending::Reply;
            }
            (_, Con::None, Con::None) => self.close(objects, *tickets),
            (State::Opening, Con::Init, Con::Valid | Con::Request) => {
                self.state = State::Open;
                self.pending = Pending::Reply;
            }
            // Our frame that opened the connection got lost, and the client repeats its own.
            (State::Open, Con::Init, Con::Valid | Con::Request) => self.pending = Pending::Reply,
            (State::Open, Con::Valid | Con::Request, Con::Valid | Con::Request) => {
                self.receive_open(sequence, content, objects, tickets);
            }
            // A client that believes in a connection we do not have is told so and can start again at once.
            (State::Closed | State::Opening, Con::Init | Con::Valid | Con::Request, Con::Valid | Con::Request) => {
                self.close(objects, *tickets);
                self.flow = Flow::new(sequence.sent);
                self.pending = Pending::Reply;
            }
            (_, Con::None, Con::Valid | Con::Request)
            | (_, Con::Init | Con::Valid | Con::Request, Con::None | Con::Init) => {}
        }
    }

    fn receive_open(
        &mut self,
        sequence: Sequence,
        content: Content<'_>,
        objects: &mut impl Objects,
        tickets: &mut Tickets,
    ) {
        let Some(arrived) = self.flow.acknowledge(sequence.received) else {
            return;
        };
        self.oldest = (self.oldest + usize::from(arrived)) % self.history.len();
        if sequence.received_con == Con::Request {
            self.flow.repeat();
        }
        let arrival = match content {
            // An acknowledge repeats the number of the last command.
            Content::Empty if self.flow.arrival(sequence.sent) == Arrival::Next => Arrival::Gap,
            Content::Empty | Content::Command(_) | Content::Malformed => self.flow.arrival(sequence.sent),
        };
        match (arrival, content) {
            // There would be no place for the answer; the client will send the command again.
            (Arrival::Next, Content::Command(_)) if !self.flow.has_room() => self.flow.repeat(),
            (Arrival::Next, Content::Command(command)) => {
                self.flow.accept();
                self.missing_told = false;
                self.pending = Pending::Reply;
                if !command.header.response {
                    self.transfer.receive_command(command, objects, tickets);
                }
            }
            (Arrival::Gap, _) => {
                if !self.missing_told || sequence.sent_con == Con::Request {
                    self.pending = Pending::Missing;
                }
            }
            (Arrival::Known | Arrival::Next, _) => {
                // The client asks, or repeats a command because it lacks our answer.
                if sequence.sent_con == Con::Request || matches!(content, Content::Command(_)) {
                    self.flow.repeat();
                    self.pending = Pending::Reply;
                }
            }
        }
        while self.flow.has_room() && self.transfer.has_answer() {
            let at = (self.oldest + usize::from(self.flow.in_flight())) % self.history.len();
            let frame = &mut self.history[at];
            let Some(len) = self.transfer.emit(objects, &mut frame.octets) else {
                break;
            };
            frame.len = len;
            self.flow.add();
        }
    }

    /// Frames that wait.
    fn pending(&self) -> usize {
        let due = usize::from(self.flow.due());
        match self.pending {
            Pending::Nothing => due,
            Pending::Reply => due.max(1),
            Pending::Missing => due + 1,
        }
    }

    fn transmit(&mut self, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        let cons = match (self.state, self.pending) {
            (State::Closed, _) => (Con::None, Con::None),
            (State::Opening, _) => (Con::Init, Con::Init),
            (State::Open, Pending::Nothing | Pending::Reply) => (Con::Valid, Con::Valid),
            (State::Open, Pending::Missing) => (Con::Request, Con::Valid),
        };
        self.missing_told |= self.pending == Pending::Missing;
        let outgoing = if self.pending == Pending::Missing {
            None
        } else {
            self.flow.transmit()
        };
        self.pending = Pending::Nothing;
        let (header, rest) = out.split_first_chunk_mut()?;
        let Some(outgoing) = outgoing else {
            rest[..EMPTY_LEN - sequence::HEADER_LEN].fill(0);
            self.emit_sequence(self.flow.sent(), cons, header);
            return Some(EMPTY_LEN);
        };
        // The last frame the window allows asks for an acknowledge when more is to come.
        let last = outgoing.number == self.flow.sent();
        let full = last && !self.flow.has_room() && self.transfer.has_answer();
        let sent_con = if full { Con::Request } else { Con::Valid };
        self.emit_sequence(outgoing.number, (Con::Valid, sent_con), header);
        let frame = &self.history[(self.oldest + usize::from(outgoing.place)) % self.history.len()];
        rest[..frame.len].copy_from_slice(&frame.octets[..frame.len]);
        Some(sequence::HEADER_LEN + frame.len)
    }

    fn emit_sequence(&self, sent: Number, cons: (Con, Con), out: &mut [u8; sequence::HEADER_LEN]) {
        Sequence {
            received: self.flow.received(),
            received_con: cons.0,
            sent,
            sent_con: cons.1,
        }
        .emit(out);
    }
}

#[cfg(test)]
mod tests;
