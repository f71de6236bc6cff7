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

use obd::AbortCode;

use super::command::{self, Address, CommandId, Content, Header, Segmentation};
use super::sequence::{self, Arrival, Con, Flow, Number, Sequence};
use super::service_data::{EMPTY_LEN, SERVICE_DATA_MAX};
use answer::Incoming;
pub use error::ClientError;

/// Segments of an answer that are left unacknowledged at most. The other stack sends four and then waits.
const UNACKNOWLEDGED_MAX: u8 = 2;

/// Time limits of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// An unanswered frame is sent again after this time.
    pub first_timeout_ns: u64,
    /// Each further repetition waits twice as long, but never longer than this.
    pub longest_timeout_ns: u64,
    /// A command fails when nothing new came from the node for this time (0x1300 gives it in ms).
    pub give_up_ns: u64,
    /// An answer is acknowledged by a frame of its own when no command follows within this time.
    pub acknowledge_delay_ns: u64,
}

impl Default for Timing {
    fn default() -> Self {
        Timing {
            first_timeout_ns: 50_000_000,
            longest_timeout_ns: 400_000_000,
            give_up_ns: 15_000_000_000,
            acknowledge_delay_ns: 20_000_000,
        }
    }
}

/// Where the connection stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Closed,
    /// We asked for a connection.
    Opening,
    /// The server agreed; we say that we take it as open, at the most twice.
    Confirming,
    Open,
}

/// Where the command stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Idle,
    Running,
    /// Octets of the answer.
    Done(Result<usize, ClientError>),
}

/// The command that runs.
#[derive(Clone, Copy, Debug)]
struct Request {
    id: CommandId,
    /// In front of what the caller hands in.
    address: Option<Address>,
    /// Octets that the caller hands in.
    len: usize,
    /// Segments that have a number on this connection.
    numbered: usize,
    /// Segments that the server has.
    arrived: usize,
    /// How often the last segment was sent on this connection: from then on the command may be carried out.
    completed: u32,
}

impl Request {
    fn prefix(&self) -> usize {
        self.address.map_or(0, |_| command::ADDRESS_LEN)
    }

    fn segments(&self) -> usize {
        command::segments(self.prefix() + self.len)
    }

    fn is_read(&self) -> bool {
        matches!(self.id, CommandId::ReadByIndex | CommandId::ReadMultipleByIndex)
    }

    fn restart(&mut self) {
        (self.numbered, self.arrived, self.completed) = (0, 0, 0);
    }
}

/// Frames of the server are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Missing {
    No,
    /// The server has to be told.
    ToReport,
    /// It was told.
    Reported,
}

/// SDO client of one node.
#[derive(Clone, Debug)]
pub struct Client {
    timing: Timing,
    state: State,
    /// The server was told once that we take the connection as open.
    confirmed: bool,
    /// The server has said that it takes the connection as open.
    heard_open: bool,
    flow: Flow,
    transaction: u8,
    progress: Progress,
    request: Request,
    incoming: Option<Incoming>,
    /// When the next frame goes out if nothing comes before; `None`: at once.
    again_at_ns: Option<u64>,
    timeout_ns: u64,
    /// Frames sent for this command.
    frames: u32,
    /// When the first frame of this command was sent, or something new came from the server.
    alive_ns: Option<u64>,
    /// When the frames of the server have to be acknowledged at the latest.
    acknowledge_at_ns: Option<u64>,
    unacknowledged: u8,
    missing: Missing,
    /// Why the server has to give up the command.
    abort: Option<AbortCode>,
    /// Close the connection when there is nothing else to do.
    closing: bool,
}

impl Client {
    /// A client without a connection.
    pub fn new(timing: Timing) -> Client {
        Client {
            timing,
            state: State::Closed,
            confirmed: false,
            heard_open: false,
            flow: Flow::new(Number::new(0)),
            transaction: 0,
            progress: Progress::Idle,
            request: Request {
                id: CommandId::ReadByIndex,
                address: None,
                len: 0,
                numbered: 0,
                arrived: 0,
                completed: 0,
            },
            incoming: None,
            again_at_ns: None,
            timeout_ns: timing.first_timeout_ns,
            frames: 0,
            alive_ns: None,
            acknowledge_at_ns: None,
            unacknowledged: 0,
            missing: Missing::No,
            abort: None,
            closing: false,
        }
    }

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

    /// Starts to read several objects. Their addresses are handed in, [`ADDRESS_LEN`](command::ADDRESS_LEN) octets each
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

    /// Octets of the request that the node has and octets of the answer that have come, to show how far a long transfer is.
    pub fn transferred(&self) -> (usize, usize) {
        let request = &self.request;
        let sent = match request.arrived.checked_sub(1) {
            Some(last) => command::segment(request.prefix() + request.len, last).1.end - request.prefix(),
            None => 0,
        };
        (sent, self.incoming.map_or(0, |incoming| incoming.done))
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

    /// Whether [`poll_transmit`](Self::poll_transmit) has a frame to send at this time: then the node needs the asynchronous
    /// slot.
    pub fn wants_to_transmit(&self, now_ns: u64) -> bool {
        let owes = self.missing == Missing::ToReport || self.acknowledge_at_ns.is_some_and(|at_ns| now_ns >= at_ns);
        match self.progress {
            Progress::Running => {
                let timer = self.again_at_ns.is_none_or(|at_ns| now_ns >= at_ns);
                timer || (self.state == State::Open && (owes || self.flow.due() > 0 || self.can_number()))
            }
            Progress::Idle | Progress::Done(_) => self.closing || (self.state == State::Open && owes),
        }
    }

    /// When [`wants_to_transmit`](Self::wants_to_transmit) becomes true if nothing is received before; `None`: not at all.
    pub fn next_deadline_ns(&self) -> Option<u64> {
        if self.wants_to_transmit(0) {
            return Some(0);
        }
        let again_ns = self.again_at_ns.filter(|_| self.progress == Progress::Running);
        let acknowledge_ns = self.acknowledge_at_ns.filter(|_| self.state == State::Open);
        match (again_ns, acknowledge_ns) {
            (Some(again_ns), Some(acknowledge_ns)) => Some(again_ns.min(acknowledge_ns)),
            (at_ns, None) | (None, at_ns) => at_ns,
        }
    }

    /// Whether a further segment of the request may follow.
    fn can_number(&self) -> bool {
        self.flow.has_room() && self.request.numbered < self.request.segments()
    }

    /// Writes the service data of the frame that is due into `out` and returns its length. `value` is what is written, as long
    /// as announced at the start; empty when an object is read. `None`: nothing to send now. A command whose time is over fails
    /// here.
    pub fn poll_transmit(&mut self, now_ns: u64, value: &[u8], out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        if self.progress == Progress::Running {
            if value.len() != self.request.len {
                let (expected, got) = (self.request.len, value.len());
                self.fail(ClientError::WrongLength { expected, got }, Some(AbortCode::GENERAL));
            } else if self
                .alive_ns
                .is_some_and(|alive_ns| now_ns.saturating_sub(alive_ns) >= self.timing.give_up_ns)
            {
                self.fail(ClientError::TimedOut { frames: self.frames }, None);
                self.closing = self.state != State::Closed;
            }
        }
        if !self.wants_to_transmit(now_ns) {
            return None;
        }
        match self.progress {
            Progress::Running => {
                if self.again_at_ns.is_some_and(|at_ns| now_ns >= at_ns) {
                    self.timeout_ns = self.timeout_ns.saturating_mul(2).min(self.timing.longest_timeout_ns);
                    self.flow.repeat_last();
                }
                self.alive_ns.get_or_insert(now_ns);
                self.frames += 1;
                let again_at_ns = now_ns.saturating_add(self.timeout_ns);
                let timer = self
                    .again_at_ns
                    .replace(again_at_ns)
                    .is_none_or(|at_ns| now_ns >= at_ns);
                self.transmit_running(now_ns, timer, value, out)
            }
            Progress::Idle | Progress::Done(_) if self.closing => self.transmit_close(out),
            Progress::Idle | Progress::Done(_) => self.transmit_acknowledge(Con::Valid, out),
        }
    }

    /// The next step towards the answer: opens the connection, or sends a part of the command.
    fn transmit_running(
        &mut self,
        now_ns: u64,
        timer: bool,
        value: &[u8],
        out: &mut [u8; SERVICE_DATA_MAX],
    ) -> Option<usize> {
        match self.state {
            State::Closed | State::Opening => {
                self.state = State::Opening;
                self.flow = Flow::new(Number::new(0));
                return self.emit_empty(Con::None, Con::Init, out);
            }
            State::Confirming => {
                let len = self.emit_empty(Con::Init, Con::Valid, out);
                if core::mem::replace(&mut self.confirmed, true) {
                    // What got lost is our confirmation or the answer to it. Not every server answers one that it has already,
                    // so the command follows at once: that is answered by whoever has taken the connection as open.
                    self.state = State::Open;
                    self.send_now();
                }
                return len;
            }
            State::Open => {}
        }
        if self.missing == Missing::ToReport {
            return self.transmit_acknowledge(Con::Valid, out);
        }
        if self.flow.due() == 0 && self.can_number() {
            self.flow.add();
            self.request.numbered += 1;
        }
        if let Some(outgoing) = self.flow.transmit() {
            let segment = self.request.arrived + usize::from(outgoing.place);
            let last = segment + 1 == self.request.segments();
            let full = !last && !self.flow.has_room();
            let asks = outgoing.number == self.flow.sent() && (outgoing.repeated || full);
            if last {
                self.request.completed += 1;
            }
            let sent_con = if asks { Con::Request } else { Con::Valid };
            self.emit_sequence(Con::Valid, outgoing.number, sent_con, out)?;
            self.acknowledge_at_ns = None;
            self.unacknowledged = 0;
            return self.emit_segment(segment, value, &mut out[sequence::HEADER_LEN..]);
        }
        // Nothing left to say: the answer is late, or has to be acknowledged.
        let owes = self.acknowledge_at_ns.is_some_and(|at_ns| now_ns >= at_ns);
        let sent_con = if timer && !owes { Con::Request } else { Con::Valid };
        self.transmit_acknowledge(sent_con, out)
    }

    fn emit_segment(&self, at: usize, value: &[u8], out: &mut [u8]) -> Option<usize> {
        let prefix = self.request.prefix();
        let len = prefix + self.request.len;
        let (segmentation, range) = command::segment(len, at);
        let header = Header {
            transaction: self.transaction,
            response: false,
            abort: false,
            segmentation,
            id: self.request.id,
        };
        let written = command::emit_segment(header, len, range.len(), out, |data| {
            let address = if at == 0 { self.request.address } else { None };
            let value_at = range.start.saturating_sub(prefix);
            match address.and_then(|address| Some((address, data.split_first_chunk_mut()?))) {
                Some((address, (octets, rest))) => {
                    address.emit(octets);
                    rest.copy_from_slice(&value[..rest.len()]);
                }
                None => data.copy_from_slice(&value[value_at..value_at + data.len()]),
            }
        })?;
        Some(sequence::HEADER_LEN + written)
    }

    /// Acknowledges without a command, asks for missing frames or for an acknowledge.
    fn transmit_acknowledge(&mut self, sent_con: Con, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        let received_con = if self.missing == Missing::ToReport {
            self.missing = Missing::Reported;
            Con::Request
        } else {
            Con::Valid
        };
        self.acknowledge_at_ns = None;
        self.unacknowledged = 0;
        self.emit_empty(received_con, sent_con, out)
    }

    /// Tells the server why the command ends, if it does not know; then closes.
    fn transmit_close(&mut self, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        if let (Some(code), State::Open) = (self.abort.take(), self.state) {
            let number = self.flow.add();
            self.emit_sequence(Con::Valid, number, Con::Valid, out)?;
            let header = Header {
                transaction: self.transaction,
                response: false,
                abort: true,
                segmentation: Segmentation::Expedited,
                id: self.request.id,
            };
            let octets = code.0.to_le_bytes();
            let out = &mut out[sequence::HEADER_LEN..];
            let written = command::emit_segment(header, octets.len(), octets.len(), out, |data| {
                data.copy_from_slice(&octets);
            })?;
            return Some(sequence::HEADER_LEN + written);
        }
        let len = self.emit_empty(Con::None, Con::None, out)?;
        self.reset_connection();
        Some(len)
    }

    fn emit_empty(&self, received_con: Con, sent_con: Con, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        out[..EMPTY_LEN].fill(0);
        self.emit_sequence(received_con, self.flow.sent(), sent_con, out)?;
        Some(EMPTY_LEN)
    }

    fn emit_sequence(
        &self,
        received_con: Con,
        sent: Number,
        sent_con: Con,
        out: &mut [u8; SERVICE_DATA_MAX],
    ) -> Option<()> {
        Sequence {
            received: self.flow.received(),
            received_con,
            sent,
            sent_con,
        }
        .emit(out.first_chunk_mut()?);
        Some(())
    }
}

#[cfg(test)]
mod tests;
