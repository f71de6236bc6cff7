//! An SDO of the application: what is asked of a node, how it ends, and the buffer for its value meanwhile.

use core::fmt;

use super::diagnosis::Reason;
use crate::sdo::ClientError;

/// What is done with which object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoCommand {
    /// ReadByIndex: the value comes into the buffer.
    Read {
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
    },
    /// WriteByIndex: the value stands at the start of the buffer.
    Write {
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
        /// Octets of the value.
        octets: usize,
    },
}

/// Why a command was not taken, or has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoError {
    /// There is no node at this position.
    NoNode,
    /// The last command to this node has not ended, or its result was not taken.
    Busy,
    /// The node is not there, or the configuration manager is at work with it.
    NotConfigured {
        /// What it is doing.
        why: Reason,
    },
    /// The value does not fit in the buffer.
    BufferTooShort {
        /// Octets of the value.
        need: usize,
        /// Octets of the buffer.
        got: usize,
    },
    /// The node was lost or reset while the command was under way: a write may or may not have been carried out.
    NodeReset,
    /// The node refused the command, or did not answer it.
    Client(ClientError),
}

impl fmt::Display for SdoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SdoError::NoNode => f.write_str("there is no such node"),
            SdoError::Busy => f.write_str("the last command to this node has not ended"),
            SdoError::NotConfigured { why } => write!(f, "the node takes no commands now: {why}"),
            SdoError::BufferTooShort { need, got } => {
                write!(f, "a value of {need} octets in a buffer of {got}")
            }
            SdoError::NodeReset => f.write_str("the node was lost or reset before it answered"),
            SdoError::Client(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for SdoError {}

/// A command that was not taken.
#[derive(Debug, PartialEq, Eq)]
pub struct SdoRefused<'a> {
    /// Why it was not taken.
    pub error: SdoError,
    /// The buffer, untouched.
    pub buffer: &'a mut [u8],
}

/// The end of a command.
#[derive(Debug, PartialEq, Eq)]
pub struct SdoResult<'a> {
    /// The command that has ended.
    pub command: SdoCommand,
    /// Octets of the value that was read, at the start of the buffer; 0 after a write.
    pub result: Result<usize, SdoError>,
    /// The buffer that came with the command.
    pub buffer: &'a mut [u8],
}

/// A command of the application under way.
#[derive(Debug)]
pub(super) struct Job<'a> {
    pub(super) command: SdoCommand,
    pub(super) buffer: &'a mut [u8],
    /// How it ended, where the SDO client no longer knows.
    pub(super) ended: Option<Result<usize, SdoError>>,
}

impl Job<'_> {
    /// What the SDO client sends.
    pub(super) fn source(&self) -> &[u8] {
        match self.command {
            SdoCommand::Read { .. } => &[],
            SdoCommand::Write { octets, .. } => &self.buffer[..octets],
        }
    }

    /// Where the SDO client puts what it receives.
    pub(super) fn sink(&mut self) -> &mut [u8] {
        match self.command {
            SdoCommand::Read { .. } => self.buffer,
            SdoCommand::Write { .. } => &mut [],
        }
    }
}
