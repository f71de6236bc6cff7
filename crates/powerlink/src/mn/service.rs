//! SDO of the application: any object of any node, read or written while the network runs.
//!
//! In:  a command and the buffer for its value, then the node's answers. Out: the result, and the buffer back.
//! RT: no allocation, no locks, never waits. One command a node at a time, nodes beside each other; it uses the SDO client of
//! the node whenever the configuration manager does not.

use super::diagnosis::Reason;
use super::node::Node;
use super::sdo_command::{Job, SdoCommand, SdoError, SdoRefused, SdoResult};
use super::stage::BootStage;
use super::state::Mn;
use crate::sdo::SERVICE_DATA_MAX;

impl<'a> Node<'a> {
    fn runs_job(&self) -> bool {
        self.job.as_ref().is_some_and(|job| job.ended.is_none())
    }

    /// The SDO frame that is due, of the configuration manager or of the application.
    pub(super) fn transmit_sdo(&mut self, now_ns: u64, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        let value = match &self.job {
            Some(job) if job.ended.is_none() => job.source(),
            Some(_) | None => self.manager.source(),
        };
        self.sdo.poll_transmit(now_ns, value, out)
    }

    /// An SDO frame of the node's server came.
    pub(super) fn receive_sdo(&mut self, now_ns: u64, service_data: &[u8]) {
        let sink = match &mut self.job {
            Some(job) if job.ended.is_none() => job.sink(),
            Some(_) | None => self.manager.sink(),
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
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// Starts to read or write an object of a node, by its position in the configuration. Never waits: ask
    /// [`sdo_result`](Self::sdo_result) in later cycles.
    ///
    /// # Errors
    /// [`SdoRefused`] gives the buffer back: no node at this position, one that takes no commands now or has one under way, a
    /// buffer that is too short for the value.
    pub fn sdo_request(
        &mut self,
        node: usize,
        command: SdoCommand,
        buffer: &'a mut [u8],
    ) -> Result<(), SdoRefused<'a>> {
        let error = match self.sdo_refusal(node, command, buffer.len()) {
            Some(error) => error,
            None => match self.nodes.get_mut(node) {
                Some(node) => {
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
                None => SdoError::NoNode,
            },
        };
        Err(SdoRefused { error, buffer })
    }

    fn sdo_refusal(&self, node: usize, command: SdoCommand, room: usize) -> Option<SdoError> {
        let Some(node) = self.nodes.get(node) else {
            return Some(SdoError::NoNode);
        };
        if node.job.is_some() {
            return Some(SdoError::Busy);
        }
        if !node.is_configured() || !self.state.is_isochronous() {
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
        let node = self.nodes.get_mut(node)?;
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
}
