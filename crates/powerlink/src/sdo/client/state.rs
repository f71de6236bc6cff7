//! What a client holds: where its connection and its command stand.

use obd::AbortCode;

use super::error::ClientError;
use crate::sdo::command::{self, Address, CommandId};
use crate::sdo::sequence::{Flow, Number};

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
pub(super) enum State {
    Closed,
    /// We asked for a connection.
    Opening,
    /// The server agreed; we say that we take it as open, at the most twice.
    Confirming,
    Open,
}

/// Where the command stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    Idle,
    Running,
    /// Octets of the answer.
    Done(Result<usize, ClientError>),
}

/// The command that runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Request {
    pub(super) id: CommandId,
    /// In front of what the caller hands in.
    pub(super) address: Option<Address>,
    /// Octets that the caller hands in.
    pub(super) len: usize,
    /// Segments that have a number on this connection.
    pub(super) numbered: usize,
    /// Segments that the server has.
    pub(super) arrived: usize,
    /// How often the last segment was sent on this connection: from then on the command may be carried out.
    pub(super) completed: u32,
}

impl Request {
    pub(super) fn prefix(&self) -> usize {
        self.address.map_or(0, |_| command::ADDRESS_LEN)
    }

    pub(super) fn segments(&self) -> usize {
        command::segments(self.prefix() + self.len)
    }

    pub(super) fn is_read(&self) -> bool {
        matches!(self.id, CommandId::ReadByIndex | CommandId::ReadMultipleByIndex)
    }

    pub(super) fn restart(&mut self) {
        (self.numbered, self.arrived, self.completed) = (0, 0, 0);
    }
}

/// Frames of the server are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Missing {
    No,
    /// The server has to be told.
    ToReport,
    /// It was told.
    Reported,
}

/// A segmented answer under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Incoming {
    pub(super) len: usize,
    pub(super) done: usize,
}

/// SDO client of one node.
#[derive(Clone, Debug)]
pub struct Client {
    pub(super) timing: Timing,
    pub(super) state: State,
    /// The server was told once that we take the connection as open.
    pub(super) confirmed: bool,
    /// The server has said that it takes the connection as open.
    pub(super) heard_open: bool,
    pub(super) flow: Flow,
    pub(super) transaction: u8,
    pub(super) progress: Progress,
    pub(super) request: Request,
    pub(super) incoming: Option<Incoming>,
    /// When the next frame goes out if nothing comes before; `None`: at once.
    pub(super) again_at_ns: Option<u64>,
    pub(super) timeout_ns: u64,
    /// Frames sent for this command.
    pub(super) frames: u32,
    /// When the first frame of this command was sent, or something new came from the server.
    pub(super) alive_ns: Option<u64>,
    /// When the frames of the server have to be acknowledged at the latest.
    pub(super) acknowledge_at_ns: Option<u64>,
    pub(super) unacknowledged: u8,
    pub(super) missing: Missing,
    /// Why the server has to give up the command.
    pub(super) abort: Option<AbortCode>,
    /// Close the connection when there is nothing else to do.
    pub(super) closing: bool,
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
}
