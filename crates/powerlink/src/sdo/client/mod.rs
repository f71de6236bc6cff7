//! The client's end: one connection to one node, one command at a time.
//!
//! In:  [`Client::start_write`], [`Client::start_read`] and the two for several objects, service data of the node's SDO
//!      frames, the time.
//! Out: service data to be sent ([`Client::poll_transmit`]), then one [`Client::result`].
//!
//! The caller holds all data: it hands in what is written at each [`Client::poll_transmit`] and the buffer for what is read at
//! each [`Client::receive`], the same ones until the command ends. So a client has no buffer of its own, and a frame that has to
//! go out again is made again.
//!
//! The connection is opened by the first command. What is lost is repeated after a short time-out that doubles, so that one
//! lost frame costs a few cycles. The next command carries the acknowledge of the last answer if it is started in time;
//! otherwise a frame of its own does.

mod answer;
mod error;
mod state;
mod transmit;

use obd::AbortCode;

use super::command::{Address, CommandId, Content};
use super::sequence::{self, Arrival, Con, Flow, Number, Sequence};
pub use error::ClientError;
pub use state::{Client, Timing};
use state::{Missing, Progress, Request, State};

/// Segments of an answer that are left unacknowledged at most. The other stack sends four and then waits.
const UNACKNOWLEDGED_MAX: u8 = 2;

impl Client {
    /// Starts to write one object of the node with a value of `len` octets.
    ///
    /// # Errors
    /// [`ClientError::Busy`] before the result of the last command was taken.
    pub fn start_write(&mut self, index: u16, sub: u8, len: usize) -> Result<(), ClientError> {
        self.start(CommandId::WriteByIndex, Some(Address { index, sub }), len)
    }

    /// Starts to read one object of the node; nothing is handed in.
    ///
    /// # Errors
    /// [`ClientError::Busy`] before the result of the last command was taken.
    pub fn start_read(&mut self, index: u16, sub: u8) -> Result<(), ClientError> {
        self.start(CommandId::ReadByIndex, Some(Address { index, sub }), 0)
    }

    /// Starts to write several objects. `len` octets made by a [`BlockWriter`](super::multiple::BlockWriter) are handed in; the
    /// answer is for [`failures`](super::multiple::failures).
    ///
    /// # Errors
    /// [`ClientError::Busy`] before the result of the last command was taken.
    pub fn start_write_multiple(&mut self, len: usize) -> Result<(), ClientError> {
        self.start(CommandId::WriteMultipleByIndex, None, len)
    }

    /// Starts to read several objects. Their addresses are handed in, [`ADDRESS_LEN`](super::command::ADDRESS_LEN) octets each
    /// ([`Address::emit`]), `len` octets in all; the answer is for [`Blocks`](super::multiple::Blocks).
    ///
    /// # Errors
    /// [`ClientError::Busy`] before the result of the last command was taken.
    pub fn start_read_multiple(&mut self, len: usize) -> Result<(), ClientError> {
        self.start(CommandId::ReadMultipleByIndex, None, len)
    }

    fn start(&mut self, id: CommandId, address: Option<Address>, len: usize) -> Result<(), ClientError> {
        if self.progress != Progress::Idle {
            return Err(ClientError::Busy);
        }
        self.request = Request {
            id,
            address,
            len,
            numbered: 0,
            arrived: 0,
            completed: 0,
        };
        self.transaction = self.transaction.wrapping_add(1);
        self.progress = Progress::Running;
        self.frames = 0;
        self.alive_ns = None;
        self.send_now();
        if self.closing || self.flow.in_flight() > 0 {
            // The server may or may not know the last command, so the numbers cannot go on.
            self.reset_connection();
        }
        Ok(())
    }

    /// Whether a command is running or its result has not been taken.
    pub fn is_busy(&self) -> bool {
        self.progress != Progress::Idle
    }

    /// Whether the node has to send next: a command is running, and it has all that may be sent now.
    pub fn awaits_answer(&self, now_ns: u64) -> bool {
        self.progress == Progress::Running && !self.wants_to_transmit(now_ns)
    }

    /// Other time limits from the next frame on, as when the asynchronous slot comes at another pace.
    pub fn set_timing(&mut self, timing: Timing) {
        self.timing = timing;
    }

    /// Takes the result of the command: `None` while it runs, else the octets of the answer in the caller's buffer (0 after a
    /// write).
    pub fn result(&mut self) -> Option<Result<usize, ClientError>> {
        let Progress::Done(result) = self.progress else {
            return None;
        };
        self.progress = Progress::Idle;
        Some(result)
    }

    /// Segments of the request that the node has.
    #[cfg(test)]
    pub(super) fn arrived(&self) -> usize {
        self.request.arrived
    }

    /// Gives up the command that runs, if any, and closes the connection with the next frames.
    pub fn close(&mut self) {
        if self.progress == Progress::Running && self.request.numbered > 0 {
            self.abort = Some(AbortCode::GENERAL);
        }
        self.progress = Progress::Idle;
        self.closing = self.state != State::Closed;
    }

    /// Forgets the connection, as when the node was reset; a running command is sent again on a new connection.
    pub fn reset_connection(&mut self) {
        self.state = State::Closed;
        self.flow = Flow::new(Number::new(0));
        self.closing = false;
        self.abort = None;
        self.acknowledge_at_ns = None;
        self.unacknowledged = 0;
        self.missing = Missing::No;
        self.incoming = None;
        self.request.restart();
        self.send_now();
    }

    fn send_now(&mut self) {
        self.again_at_ns = None;
        self.timeout_ns = self.timing.first_timeout_ns;
    }

    /// Something new came: the time-outs restart.
    fn alive(&mut self, now_ns: u64) {
        self.alive_ns = Some(now_ns);
        self.timeout_ns = self.timing.first_timeout_ns;
        self.again_at_ns = Some(now_ns.saturating_add(self.timeout_ns));
    }

    /// Ends the command; the server is told why unless it knows.
    fn fail(&mut self, error: ClientError, tell: Option<AbortCode>) {
        self.progress = Progress::Done(Err(error));
        self.incoming = None;
        if tell.is_some() {
            self.abort = tell;
            self.closing = self.state != State::Closed;
        }
    }

    /// Takes the service data of an SDO frame sent by the node; what is read goes into `sink`. Frames that make no sense are
    /// dropped; never panics.
    pub fn receive(&mut self, now_ns: u64, service_data: &[u8], sink: &mut [u8]) {
        let Some(sequence) = Sequence::parse(service_data) else {
            return;
        };
        let content = Content::parse(&service_data[sequence::HEADER_LEN..]);
        match (self.state, sequence.received_con, sequence.sent_con) {
            (State::Opening, Con::Init, Con::Init) => {
                self.flow = Flow::new(sequence.sent);
                self.state = State::Confirming;
                self.confirmed = false;
                self.heard_open = false;
                self.send_now();
            }
            // The server repeats its agreement: our confirmation got lost.
            (State::Confirming, Con::Init, Con::Init) => self.again_at_ns = None,
            (State::Confirming, Con::Valid, Con::Valid | Con::Request) => {
                self.state = State::Open;
                self.heard_open = true;
                self.alive_ns = Some(now_ns);
                self.send_now();
            }
            (State::Open, Con::Valid | Con::Request, Con::Valid | Con::Request) => {
                self.heard_open = true;
                self.receive_open(now_ns, sequence, content, sink);
            }
            // The server has no connection (any more). A running command opens a new one, no faster than the time-out allows
            // when the server keeps refusing.
            (State::Opening | State::Confirming, Con::None, Con::None) => self.state = State::Closed,
            (State::Open, Con::None, Con::None) => self.connection_lost(),
            // Late or foreign frames.
            (State::Closed, _, _)
            | (State::Opening | State::Confirming, Con::None, Con::Init | Con::Valid | Con::Request)
            | (State::Opening | State::Confirming, Con::Init, Con::None | Con::Valid | Con::Request)
            | (State::Opening, Con::Valid | Con::Request, _)
            | (State::Confirming, Con::Valid, Con::None | Con::Init)
            | (State::Confirming, Con::Request, _)
            | (State::Open, Con::None, Con::Init | Con::Valid | Con::Request)
            | (State::Open, Con::Init, _)
            | (State::Open, Con::Valid | Con::Request, Con::None | Con::Init) => {}
        }
    }

    /// The command is sent again from its start, unless the server may have carried it out already: a copy that it refuses for lack of a
    /// connection tells nothing of the copies before. Where it never had one, it refused them all.
    fn connection_lost(&mut self) {
        let carried_out = self.heard_open && !self.request.is_read() && self.request.completed > 1;
        self.reset_connection();
        if self.progress == Progress::Running && carried_out {
            self.fail(ClientError::ConnectionLost, None);
        }
    }

    fn receive_open(&mut self, now_ns: u64, sequence: Sequence, content: Content<'_>, sink: &mut [u8]) {
        let Some(arrived) = self.flow.acknowledge(sequence.received) else {
            return;
        };
        if arrived > 0 {
            self.request.arrived += usize::from(arrived);
            self.alive(now_ns);
        }
        if sequence.received_con == Con::Request {
            self.flow.repeat();
        }
        let arrival = match content {
            // An acknowledge repeats the number of the last command.
            Content::Empty if self.flow.arrival(sequence.sent) == Arrival::Next => Arrival::Gap,
            Content::Malformed => return,
            Content::Empty | Content::Command(_) => self.flow.arrival(sequence.sent),
        };
        match (arrival, content) {
            (Arrival::Next, Content::Command(command)) => {
                self.flow.accept();
                self.missing = Missing::No;
                self.unacknowledged += 1;
                self.alive(now_ns);
                self.take_command(command, sink);
                let segments_follow = self.incoming.is_some() && self.unacknowledged >= UNACKNOWLEDGED_MAX;
                let delay_ns = if segments_follow || sequence.sent_con == Con::Request {
                    0
                } else {
                    self.timing.acknowledge_delay_ns
                };
                self.acknowledge_by(now_ns.saturating_add(delay_ns));
            }
            (Arrival::Gap, _) => {
                if self.missing == Missing::No || sequence.sent_con == Con::Request {
                    self.missing = Missing::ToReport;
                }
            }
            (Arrival::Known | Arrival::Next, _) => {
                // A repeated answer shows that our acknowledge got lost.
                if sequence.sent_con == Con::Request || matches!(content, Content::Command(_)) {
                    self.acknowledge_by(now_ns);
                }
            }
        }
    }

    fn acknowledge_by(&mut self, at_ns: u64) {
        self.acknowledge_at_ns = Some(self.acknowledge_at_ns.map_or(at_ns, |earlier_ns| earlier_ns.min(at_ns)));
    }
}

#[cfg(test)]
mod tests;
