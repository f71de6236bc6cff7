//! The server's end: answers the commands of a few clients from an object dictionary.
//!
//! In:  service data of received SDO frames with the node id of their sender, the objects.
//! Out: one answer at a time per client, kept until the client has it.
//!
//! The server has no clock: the client repeats what got lost, and a repeated command is answered again without being carried
//! out twice.

use obd::{AbortCode, Objects};

use super::command::{self, Address, Command, CommandId, Content, Header, Segmentation};
use super::sequence::{self, Con, Number, Sequence};
use super::{EMPTY_LEN, SERVICE_DATA_MAX};

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

/// What the next frame to the client is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pending {
    Nothing,
    /// There is no connection (again).
    Close,
    /// Handshake, acknowledge, or the answer below.
    Frame,
    /// Frames are missing: ask for them.
    Missing,
}

#[derive(Clone, Debug)]
struct Connection {
    client: u8,
    state: State,
    received: Number,
    sent: Number,
    pending: Pending,
    /// Last answer from the command header on; empty when the client has acknowledged it.
    answer: [u8; SERVICE_DATA_MAX - sequence::HEADER_LEN],
    answer_len: usize,
    /// Value of the server's clock of events at the last frame of this client.
    used_at: u32,
}

/// SDO server for up to `CONNECTIONS` clients; a further client takes the place of the one that was silent longest.
#[derive(Clone, Debug)]
pub struct Server<const CONNECTIONS: usize = 2> {
    connections: [Connection; CONNECTIONS],
    events: u32,
    /// Where the search for the next answer to be sent starts, so that no client is starved.
    turn: usize,
}

impl<const CONNECTIONS: usize> Default for Server<CONNECTIONS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const CONNECTIONS: usize> Server<CONNECTIONS> {
    /// A server without connections.
    pub fn new() -> Self {
        const { assert!(CONNECTIONS > 0) };
        Server {
            connections: core::array::from_fn(|_| Connection::closed(0)),
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
        self.events = self.events.wrapping_add(1);
        let events = self.events;
        let connection = self.connection(client);
        connection.used_at = events;
        connection.receive(sequence, content, objects);
    }

    fn connection(&mut self, client: u8) -> &mut Connection {
        let events = self.events;
        let known = self
            .connections
            .iter()
            .position(|connection| connection.client == client && connection.used_at != 0);
        let at = known.unwrap_or_else(|| {
            let silence = |connection: &Connection| match connection.used_at {
                0 => u32::MAX,
                used_at => events.wrapping_sub(used_at),
            };
            let longest = (0..CONNECTIONS)
                .rev()
                .max_by_key(|at| silence(&self.connections[*at]))
                .unwrap_or(0);
            self.connections[longest] = Connection::closed(client);
            longest
        });
        &mut self.connections[at]
    }

    /// Number of frames that wait for the asynchronous slot.
    pub fn pending(&self) -> usize {
        self.connections
            .iter()
            .filter(|connection| connection.pending != Pending::Nothing)
            .count()
    }

    /// Writes the service data of the next frame into `out` and returns the node id of its receiver and the length. `None`:
    /// nothing to send.
    pub fn poll_transmit(&mut self, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<(u8, usize)> {
        let at = (0..CONNECTIONS)
            .map(|step| (self.turn + step) % CONNECTIONS)
            .find(|at| self.connections[*at].pending != Pending::Nothing)?;
        let connection = &mut self.connections[at];
        let len = connection.transmit(out)?;
        let client = connection.client;
        self.turn = (at + 1) % CONNECTIONS;
        Some((client, len))
    }

    /// Forgets all connections, as after a reset of the node.
    pub fn reset(&mut self) {
        *self = Self::new();
    }
}

impl Connection {
    fn closed(client: u8) -> Connection {
        Connection {
            client,
            state: State::Closed,
            received: Number::default(),
            sent: Number::default(),
            pending: Pending::Nothing,
            answer: [0; SERVICE_DATA_MAX - sequence::HEADER_LEN],
            answer_len: 0,
            used_at: 0,
        }
    }

    fn receive(&mut self, sequence: Sequence, content: Content<'_>, objects: &mut impl Objects) {
        match (self.state, sequence.received_con, sequence.sent_con) {
            (_, Con::None, Con::Init) => {
                self.received = sequence.sent;
                self.sent = Number::default();
                self.answer_len = 0;
                self.state = State::Opening;
                self.pending = Pending::Frame;
            }
            (_, Con::None, Con::None) => {
                self.state = State::Closed;
                self.answer_len = 0;
                self.pending = Pending::Nothing;
            }
            (State::Opening, Con::Init, Con::Valid | Con::Request) => {
                self.state = State::Open;
                self.received = sequence.sent;
                self.pending = Pending::Frame;
            }
            // Our frame that opened the connection got lost, and the client repeats its own.
            (State::Open, Con::Init, Con::Valid | Con::Request) => self.pending = Pending::Frame,
            (State::Open, Con::Valid | Con::Request, Con::Valid | Con::Request) => {
                self.receive_open(sequence, content, objects);
            }
            // A client that believes in a connection we do not have is told so and can start again at once.
            (State::Closed | State::Opening, Con::Init | Con::Valid | Con::Request, Con::Valid | Con::Request) => {
                self.received = sequence.sent;
                self.sent = sequence.received;
                self.state = State::Closed;
                self.pending = Pending::Close;
            }
            (_, Con::None, Con::Valid | Con::Request)
            | (_, Con::Init | Con::Valid | Con::Request, Con::None | Con::Init) => {}
        }
    }

    fn receive_open(&mut self, sequence: Sequence, content: Content<'_>, objects: &mut impl Objects) {
        if sequence.received == self.sent && sequence.received_con == Con::Valid {
            self.answer_len = 0;
        }
        if sequence.sent == self.received.next() {
            self.received = sequence.sent;
            match content {
                Content::Command(command) if !command.header.response => {
                    self.answer_len = answer(command, objects, &mut self.answer);
                    self.sent = self.sent.next();
                    self.pending = Pending::Frame;
                }
                Content::Command(_) | Content::Empty | Content::Malformed => self.acknowledge(sequence),
            }
        } else if sequence.sent == self.received {
            self.acknowledge(sequence);
            // The client repeats a command: it lacks our answer.
            if matches!(content, Content::Command(_)) {
                self.pending = Pending::Frame;
            }
        } else {
            self.pending = Pending::Missing;
        }
    }

    /// Sends an acknowledge, or the answer again, if the client asks for it; takes back an answer that has arrived.
    fn acknowledge(&mut self, sequence: Sequence) {
        if sequence.sent_con == Con::Request || sequence.received_con == Con::Request {
            self.pending = Pending::Frame;
        } else if self.answer_len == 0 {
            self.pending = Pending::Nothing;
        }
    }

    fn transmit(&mut self, out: &mut [u8]) -> Option<usize> {
        let cons = match (self.pending, self.state) {
            (Pending::Nothing, _) => return None,
            (Pending::Close, _) | (Pending::Frame | Pending::Missing, State::Closed) => (Con::None, Con::None),
            (Pending::Frame | Pending::Missing, State::Opening) => (Con::Init, Con::Init),
            (Pending::Frame, State::Open) => (Con::Valid, Con::Valid),
            (Pending::Missing, State::Open) => (Con::Request, Con::Valid),
        };
        let answer: &[u8] = if self.answer_len > 0 && self.pending == Pending::Frame {
            &self.answer[..self.answer_len]
        } else {
            &[0; command::HEADER_LEN]
        };
        let len = sequence::HEADER_LEN + answer.len();
        let (header, rest) = out.get_mut(..len)?.split_first_chunk_mut()?;
        Sequence {
            received: self.received,
            received_con: cons.0,
            sent: self.sent,
            sent_con: cons.1,
        }
        .emit(header);
        rest.copy_from_slice(answer);
        self.pending = Pending::Nothing;
        Some(len.max(EMPTY_LEN))
    }
}

/// Carries out a command and writes its answer from the command header on; returns the length.
fn answer(command: Command<'_>, objects: &mut impl Objects, out: &mut [u8]) -> usize {
    let (header, data) = out.split_at_mut(command::HEADER_LEN);
    let result = execute(command, objects, data);
    let size = match result {
        Ok(size) => size,
        Err(code) => {
            data[..4].copy_from_slice(&code.0.to_le_bytes());
            4
        }
    };
    let mut octets = [0; command::HEADER_LEN];
    Header {
        transaction: command.header.transaction,
        response: true,
        abort: result.is_err(),
        segmentation: Segmentation::Expedited,
        id: command.header.id,
    }
    .emit(size as u16, &mut octets);
    header.copy_from_slice(&octets);
    command::HEADER_LEN + size
}

/// The one place where commands are told apart; returns the length of the answer's data.
fn execute(command: Command<'_>, objects: &mut impl Objects, out: &mut [u8]) -> Result<usize, AbortCode> {
    match command.header.segmentation {
        Segmentation::Expedited => {}
        Segmentation::Initiate | Segmentation::Segment | Segmentation::Complete => {
            return Err(AbortCode::UNKNOWN_COMMAND);
        }
    }
    let address = || Address::split(command.data).ok_or(AbortCode::BLOCK_SIZE);
    match command.header.id {
        CommandId::WriteByIndex => {
            let (Address { index, sub }, value) = address()?;
            objects.sdo_write(index, sub, value)?;
            Ok(0)
        }
        CommandId::ReadByIndex => {
            let (Address { index, sub }, _) = address()?;
            objects.sdo_read(index, sub, out)
        }
        CommandId::WriteAllByIndex
        | CommandId::ReadAllByIndex
        | CommandId::WriteByName
        | CommandId::ReadByName
        | CommandId::FileWrite
        | CommandId::FileRead
        | CommandId::WriteMultipleByIndex
        | CommandId::ReadMultipleByIndex
        | CommandId::MaximumSegmentSize
        | CommandId::LinkNameToIndex
        | CommandId::Other(_) => Err(AbortCode::UNKNOWN_COMMAND),
    }
}

#[cfg(test)]
mod tests;
