//! The client's end: one connection to one node, one command at a time.
//!
//! In:  [`Client::start_write`] or [`Client::start_read`], service data of the node's SDO frames, the time.
//! Out: service data to be sent ([`Client::poll_transmit`]), then one [`Client::result`].
//!
//! The connection is opened by the first command. What is lost is repeated after a short time-out that doubles, so that one
//! lost frame costs a few cycles. The next command carries the acknowledge of the last answer if it is started in time;
//! otherwise a frame of its own does.

use core::fmt;

use obd::AbortCode;

use super::command::{self, Address, CommandId, Content, Header, Segmentation};
use super::sequence::{self, Con, Number, Sequence};
use super::{EMPTY_LEN, EXPEDITED_READ_MAX, EXPEDITED_WRITE_MAX, SERVICE_DATA_MAX};

/// Time limits of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// An unanswered frame is sent again after this time.
    pub first_timeout_ns: u64,
    /// Each further repetition waits twice as long, but never longer than this.
    pub longest_timeout_ns: u64,
    /// A command that was not answered in this time, counted from its first frame, has failed (0x1300 gives it in ms).
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

/// Why a command failed, or was not started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientError {
    /// The node refused the command.
    Aborted(AbortCode),
    /// No answer came within [`Timing::give_up_ns`], though the frames were sent this many times.
    TimedOut {
        /// Frames sent for this command.
        frames: u32,
    },
    /// The answer does not follow the protocol, or announces segments.
    BadAnswer(&'static str),
    /// The last command has not ended, or its result was not taken.
    Busy,
    /// The value does not fit in one frame.
    TooLong {
        /// Octets of the value.
        got: usize,
        /// Octets that fit.
        most: usize,
    },
}

impl fmt::Display for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClientError::Aborted(code) => write!(f, "aborted by the node: {code}"),
            ClientError::TimedOut { frames } => write!(f, "no answer, {frames} frames were sent"),
            ClientError::BadAnswer(what) => write!(f, "bad answer: {what}"),
            ClientError::Busy => write!(f, "the command before has not ended"),
            ClientError::TooLong { got, most } => {
                write!(
                    f,
                    "a value of {got} octets does not fit in one frame, which holds {most}"
                )
            }
        }
    }
}

impl core::error::Error for ClientError {}

/// Where the connection stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Closed,
    /// We asked for a connection.
    Opening,
    /// The server agreed; we said that we take it as open.
    Confirming,
    Open,
}

/// Where the command stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Idle,
    Running,
    /// Octets of the value that was read.
    Done(Result<usize, ClientError>),
}

/// The frame that waits for an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outstanding {
    /// Nothing was sent yet, or it has to be sent at once.
    Due,
    /// Sent; to be repeated at this time.
    Sent { again_at_ns: u64 },
}

/// SDO client of one node.
#[derive(Clone, Debug)]
pub struct Client {
    timing: Timing,
    state: State,
    received: Number,
    sent: Number,
    transaction: u8,
    progress: Progress,
    outstanding: Outstanding,
    timeout_ns: u64,
    /// Frames sent for this command.
    frames: u32,
    /// When the first frame of this command was sent.
    started_ns: Option<u64>,
    /// The command has a number of its own since it was sent on this connection.
    numbered: bool,
    /// When the last answer has to be acknowledged at the latest.
    acknowledge_at_ns: Option<u64>,
    /// Close the connection when there is nothing else to do.
    closing: bool,
    id: CommandId,
    /// Command data of the request, later the value of the answer.
    data: [u8; SERVICE_DATA_MAX],
    data_len: usize,
}

impl Client {
    /// A client without a connection.
    pub fn new(timing: Timing) -> Client {
        Client {
            timing,
            state: State::Closed,
            received: Number::default(),
            sent: Number::default(),
            transaction: 0,
            progress: Progress::Idle,
            outstanding: Outstanding::Due,
            timeout_ns: timing.first_timeout_ns,
            frames: 0,
            started_ns: None,
            numbered: false,
            acknowledge_at_ns: None,
            closing: false,
            id: CommandId::ReadByIndex,
            data: [0; SERVICE_DATA_MAX],
            data_len: 0,
        }
    }

    /// Starts to write one object of the node.
    pub fn start_write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), ClientError> {
        if value.len() > EXPEDITED_WRITE_MAX {
            return Err(ClientError::TooLong {
                got: value.len(),
                most: EXPEDITED_WRITE_MAX,
            });
        }
        self.start(CommandId::WriteByIndex, Address { index, sub }, value)
    }

    /// Starts to read one object of the node.
    pub fn start_read(&mut self, index: u16, sub: u8) -> Result<(), ClientError> {
        self.start(CommandId::ReadByIndex, Address { index, sub }, &[])
    }

    fn start(&mut self, id: CommandId, address: Address, value: &[u8]) -> Result<(), ClientError> {
        if self.progress != Progress::Idle {
            return Err(ClientError::Busy);
        }
        let mut octets = [0; command::ADDRESS_LEN];
        address.emit(&mut octets);
        self.data[..octets.len()].copy_from_slice(&octets);
        self.data_len = octets.len() + value.len();
        self.data[octets.len()..self.data_len].copy_from_slice(value);
        self.id = id;
        self.transaction = self.transaction.wrapping_add(1);
        self.progress = Progress::Running;
        self.frames = 0;
        self.started_ns = None;
        self.numbered = false;
        if self.closing {
            // The server may or may not know the last command, so the numbers cannot go on.
            self.reset_connection();
        }
        self.send_now();
        Ok(())
    }

    /// Whether a command is running or its result has not been taken.
    pub fn is_busy(&self) -> bool {
        self.progress != Progress::Idle
    }

    /// Takes the result of the command: `None` while it runs, else the value that was read (empty after a write).
    pub fn result(&mut self) -> Option<Result<&[u8], ClientError>> {
        let Progress::Done(result) = self.progress else {
            return None;
        };
        self.progress = Progress::Idle;
        Some(result.map(|len| &self.data[..len]))
    }

    /// Gives up the command that runs, if any, and closes the connection with the next frame.
    pub fn close(&mut self) {
        self.progress = Progress::Idle;
        self.closing = self.state != State::Closed;
    }

    /// Forgets the connection, as when the node was reset; a running command starts anew on a new connection.
    pub fn reset_connection(&mut self) {
        self.state = State::Closed;
        self.closing = false;
        self.acknowledge_at_ns = None;
        self.numbered = false;
        self.send_now();
    }

    fn send_now(&mut self) {
        self.outstanding = Outstanding::Due;
        self.timeout_ns = self.timing.first_timeout_ns;
    }

    /// Takes the service data of an SDO frame sent by the node. Frames that make no sense are dropped; never panics.
    pub fn receive(&mut self, now_ns: u64, service_data: &[u8]) {
        let Some(sequence) = Sequence::parse(service_data) else {
            return;
        };
        let content = Content::parse(&service_data[sequence::HEADER_LEN..]);
        match (self.state, sequence.received_con, sequence.sent_con) {
            (State::Opening, Con::Init, Con::Init) => {
                self.received = sequence.sent;
                self.state = State::Confirming;
                self.send_now();
            }
            // The server repeats its agreement: our confirmation got lost.
            (State::Confirming, Con::Init, Con::Init) => self.outstanding = Outstanding::Due,
            (State::Confirming, Con::Valid, Con::Valid | Con::Request) => {
                self.received = sequence.sent;
                self.state = State::Open;
                self.send_now();
            }
            (State::Open, Con::Valid | Con::Request, Con::Valid | Con::Request) => {
                self.receive_open(now_ns, sequence, content);
            }
            // The server has no connection (any more). A running command opens a new one, no faster than the time-out allows
            // when the server keeps refusing.
            (State::Opening | State::Confirming, Con::None, Con::None) => self.state = State::Closed,
            (State::Open, Con::None, Con::None) => self.reset_connection(),
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

    fn receive_open(&mut self, now_ns: u64, sequence: Sequence, content: Content<'_>) {
        if sequence.received_con == Con::Request && self.numbered && self.progress == Progress::Running {
            self.outstanding = Outstanding::Due;
        }
        if sequence.sent == self.received.next() {
            if content == Content::Malformed {
                return;
            }
            self.received = sequence.sent;
            self.acknowledge_at_ns = Some(now_ns.saturating_add(self.timing.acknowledge_delay_ns));
            if let Content::Command(command) = content
                && self.progress == Progress::Running
                && self.numbered
                && command.header.response
                && command.header.transaction == self.transaction
            {
                self.progress = Progress::Done(self.take_answer(command));
            }
        }
        if sequence.sent_con == Con::Request {
            self.acknowledge_at_ns = Some(now_ns);
        }
    }

    fn take_answer(&mut self, command: command::Command<'_>) -> Result<usize, ClientError> {
        let header = command.header;
        if header.abort {
            let code = command::abort_code(command.data).ok_or(ClientError::BadAnswer("an abort without a code"))?;
            return Err(ClientError::Aborted(code));
        }
        if header.id != self.id {
            return Err(ClientError::BadAnswer("another command than the one that was sent"));
        }
        if header.segmentation != Segmentation::Expedited {
            return Err(ClientError::BadAnswer(
                "a segmented transfer, which this client does not support",
            ));
        }
        if command.data.len() > EXPEDITED_READ_MAX {
            return Err(ClientError::BadAnswer("more data than one frame holds"));
        }
        self.data[..command.data.len()].copy_from_slice(command.data);
        Ok(command.data.len())
    }

    /// Whether [`poll_transmit`](Self::poll_transmit) has a frame to send at this time: then the node needs the asynchronous
    /// slot.
    pub fn wants_to_transmit(&self, now_ns: u64) -> bool {
        match self.progress {
            Progress::Running => match self.outstanding {
                Outstanding::Due => true,
                Outstanding::Sent { again_at_ns } => now_ns >= again_at_ns,
            },
            Progress::Idle | Progress::Done(_) => {
                self.closing || self.acknowledge_at_ns.is_some_and(|at_ns| now_ns >= at_ns)
            }
        }
    }

    /// Writes the service data of the frame that is due into `out` (at least [`SERVICE_DATA_MAX`] octets are always enough)
    /// and returns its length. `None`: nothing to send now, or `out` is too short. A command whose time is over fails here.
    pub fn poll_transmit(&mut self, now_ns: u64, out: &mut [u8]) -> Option<usize> {
        if self.progress == Progress::Running
            && self
                .started_ns
                .is_some_and(|started_ns| now_ns.saturating_sub(started_ns) >= self.timing.give_up_ns)
        {
            self.progress = Progress::Done(Err(ClientError::TimedOut { frames: self.frames }));
            self.closing = self.state != State::Closed;
        }
        if !self.wants_to_transmit(now_ns) {
            return None;
        }
        match self.progress {
            Progress::Running => self.transmit_command(now_ns, out),
            Progress::Idle | Progress::Done(_) => self.transmit_alone(out),
        }
    }

    /// Acknowledges or closes.
    fn transmit_alone(&mut self, out: &mut [u8]) -> Option<usize> {
        let con = if self.closing { Con::None } else { Con::Valid };
        let len = self.emit(out, con, con, false)?;
        self.acknowledge_at_ns = None;
        if self.closing {
            self.closing = false;
            self.state = State::Closed;
        }
        Some(len)
    }

    /// The next step towards the answer: opens the connection, or sends the command.
    fn transmit_command(&mut self, now_ns: u64, out: &mut [u8]) -> Option<usize> {
        let repeated = matches!(self.outstanding, Outstanding::Sent { .. });
        if out.len() < SERVICE_DATA_MAX.min(EMPTY_LEN + self.data_len) {
            return None;
        }
        let len = match self.state {
            State::Closed | State::Opening => {
                self.state = State::Opening;
                (self.received, self.sent) = (Number::default(), Number::default());
                self.emit(out, Con::None, Con::Init, false)
            }
            State::Confirming => self.emit(out, Con::Init, Con::Valid, false),
            State::Open => {
                let again = self.numbered;
                if !again {
                    self.sent = self.sent.next();
                    self.numbered = true;
                }
                self.acknowledge_at_ns = None;
                self.emit(out, Con::Valid, if again { Con::Request } else { Con::Valid }, true)
            }
        }?;
        if repeated {
            self.timeout_ns = self.timeout_ns.saturating_mul(2).min(self.timing.longest_timeout_ns);
        }
        self.started_ns.get_or_insert(now_ns);
        self.frames += 1;
        self.outstanding = Outstanding::Sent {
            again_at_ns: now_ns.saturating_add(self.timeout_ns),
        };
        Some(len)
    }

    fn emit(&self, out: &mut [u8], received_con: Con, sent_con: Con, with_command: bool) -> Option<usize> {
        let data = if with_command { &self.data[..self.data_len] } else { &[] };
        let len = EMPTY_LEN + data.len();
        let (sequence, rest) = out.get_mut(..len)?.split_first_chunk_mut()?;
        let (header, rest) = rest.split_first_chunk_mut()?;
        Sequence {
            received: self.received,
            received_con,
            sent: self.sent,
            sent_con,
        }
        .emit(sequence);
        if with_command {
            Header {
                transaction: self.transaction,
                response: false,
                abort: false,
                segmentation: Segmentation::Expedited,
                id: self.id,
            }
            .emit(data.len() as u16, header);
        } else {
            header.fill(0);
        }
        rest.copy_from_slice(data);
        Some(len)
    }
}

#[cfg(test)]
mod tests;
