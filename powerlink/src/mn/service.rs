//! SDO of the application: any object of any node, read or written while the network runs.
//!
//! In:  a command and the buffer for its value, then the node's answers. Out: the result, and the buffer back.
//! RT: no allocation, no locks, never waits. One command a node at a time, nodes beside each other; it uses the SDO client of
//! the node whenever the configuration manager does not.

use core::fmt;

use super::boot::Stage;
use super::diagnosis::BootStage;
use super::node::Node;
use super::{Mn, Reason};
use crate::sdo::{ClientError, SERVICE_DATA_MAX};

/// What is done with which object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoCommand {
    /// ReadByIndex: the value comes into the buffer.
    Read {
        /// Object.
        index: u16,
        /// Sub-index.
        sub: u8,
    },
    /// WriteByIndex: the value stands at the start of the buffer.
    Write {
        /// Object.
        index: u16,
        /// Sub-index.
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
    /// The application has cancelled the command.
    Cancelled,
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
            SdoError::Cancelled => f.write_str("cancelled"),
            SdoError::Client(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for SdoError {}

/// A command that was not taken.
#[derive(Debug, PartialEq, Eq)]
pub struct SdoRefused<'a> {
    /// Why.
    pub error: SdoError,
    /// The buffer, untouched.
    pub buffer: &'a mut [u8],
}

/// The end of a command.
#[derive(Debug, PartialEq, Eq)]
pub struct SdoResult<'a> {
    /// The command.
    pub command: SdoCommand,
    /// Octets of the value that was read, at the start of the buffer; 0 after a write.
    pub result: Result<usize, SdoError>,
    /// The buffer.
    pub buffer: &'a mut [u8],
}

/// A command of the application under way.
#[derive(Debug)]
pub(super) struct Job<'a> {
    command: SdoCommand,
    buffer: &'a mut [u8],
    /// How it ended, where the SDO client no longer knows.
    ended: Option<Result<usize, SdoError>>,
}

impl Job<'_> {
    /// What the SDO client sends.
    fn source(&self) -> &[u8] {
        match self.command {
            SdoCommand::Read { .. } => &[],
            SdoCommand::Write { octets, .. } => &self.buffer[..octets],
        }
    }

    /// Where the SDO client puts what it receives.
    fn sink(&mut self) -> &mut [u8] {
        match self.command {
            SdoCommand::Read { .. } => self.buffer,
            SdoCommand::Write { .. } => &mut [],
        }
    }
}

impl<'a> Node<'a> {
    fn runs_job(&self) -> bool {
        self.job.as_ref().is_some_and(|job| job.ended.is_none())
    }

    /// The SDO frame that is due, of the configuration manager or of the application.
    pub(super) fn transmit_sdo(&mut self, now_ns: u64, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        let value = match &self.job {
            Some(job) if job.ended.is_none() => job.source(),
            Some(_) | None => self.writing.value,
        };
        self.sdo.poll_transmit(now_ns, value, out)
    }

    /// An SDO frame of the node's server came.
    pub(super) fn receive_sdo(&mut self, now_ns: u64, service_data: &[u8]) {
        let sink = match &mut self.job {
            Some(job) if job.ended.is_none() => job.sink(),
            Some(_) | None => &mut [],
        };
        self.sdo.receive(now_ns, service_data, sink);
    }

    /// The SDO client is no longer the application's.
    pub(super) fn end_job(&mut self, error: SdoError) {
        if !self.runs_job() {
            return;
        }
        // The result may be there, only not taken yet.
        let result = self.sdo.result().map(|result| result.map_err(SdoError::Client));
        self.sdo.close();
        if let Some(job) = &mut self.job {
            job.ended = Some(result.unwrap_or(Err(error)));
        }
    }

    /// The configuration manager has done its work and the node runs.
    fn takes_commands(&self) -> bool {
        match self.stage {
            Stage::Search
            | Stage::Refused { .. }
            | Stage::Configure
            | Stage::CloseSdo
            | Stage::ResetConfiguration { .. }
            | Stage::Reidentify { .. } => false,
            Stage::Enable { .. }
            | Stage::WaitReady { .. }
            | Stage::Check { .. }
            | Stage::Ready
            | Stage::WaitOperational { .. }
            | Stage::Operational
            | Stage::Held
            | Stage::TakenOver
            | Stage::BackInPreOperational2 { .. }
            | Stage::Stopped { .. } => true,
        }
    }
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// Starts to read or write an object of a node, by its position in the configuration. Never waits: ask
    /// [`sdo_result`](Self::sdo_result) in later cycles.
    pub fn sdo_request(
        &mut self,
        node: usize,
        command: SdoCommand,
        buffer: &'a mut [u8],
    ) -> Result<(), SdoRefused<'a>> {
        let error = match self.sdo_refusal(node, command, buffer.len()) {
            Some(error) => error,
            None => match self.nodes.get_mut(node) {
                Some(Some(node)) => {
                    let started = match command {
                        SdoCommand::Read { index, sub } => node.sdo.start_read(index, sub),
                        SdoCommand::Write { index, sub, octets } => node.sdo.start_write(index, sub, octets),
                    };
                    match started {
                        Ok(()) => {
                            node.job = Some(Job {
                                command,
                                buffer,
                                ended: None,
                            });
                            return Ok(());
                        }
                        Err(error) => SdoError::Client(error),
                    }
                }
                Some(None) | None => SdoError::NoNode,
            },
        };
        Err(SdoRefused { error, buffer })
    }

    fn sdo_refusal(&self, node: usize, command: SdoCommand, room: usize) -> Option<SdoError> {
        let Some(node) = self.node(node) else {
            return Some(SdoError::NoNode);
        };
        if node.job.is_some() {
            return Some(SdoError::Busy);
        }
        if !node.takes_commands() || !self.state.is_isochronous() {
            let why = self.reason(node).unwrap_or(Reason::Booting {
                stage: BootStage::Operational,
            });
            return Some(SdoError::NotConfigured { why });
        }
        match command {
            SdoCommand::Write { octets: need, .. } if need > room => Some(SdoError::BufferTooShort { need, got: room }),
            SdoCommand::Write { .. } | SdoCommand::Read { .. } => None,
        }
    }

    /// Takes the result of the command to a node; `None` while it runs, or when there is none.
    pub fn sdo_result(&mut self, node: usize) -> Option<SdoResult<'a>> {
        let node = self.nodes.get_mut(node)?.as_mut()?;
        let ended = node.job.as_ref()?.ended;
        let result = match ended {
            Some(result) => result,
            None => node.sdo.result()?.map_err(SdoError::Client),
        };
        let Job { command, buffer, .. } = node.job.take()?;
        Some(SdoResult {
            command,
            result,
            buffer,
        })
    }

    /// How far a long transfer is: octets that the node has, octets that came from it. `None`: none is under way.
    pub fn sdo_transferred(&self, node: usize) -> Option<(usize, usize)> {
        let node = self.node(node)?;
        node.runs_job().then(|| node.sdo.transferred())
    }

    /// Gives up the command to a node; [`sdo_result`](Self::sdo_result) hands the buffer back.
    pub fn sdo_cancel(&mut self, node: usize) {
        if let Some(Some(node)) = self.nodes.get_mut(node) {
            node.end_job(SdoError::Cancelled);
        }
    }
}
