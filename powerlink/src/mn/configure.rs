//! What a node is, and what is written into it: the checks of its IdentResponse and the configuration manager.
//!
//! In:  the IdentResponse, the concise DCF, results of the SDO client.
//! Out: writes through the SDO client, one after the other; what differs, as an event.
//! RT: no allocation, no locks; one write a step.

use obd::AbortCode;
use obd::cdc::{CdcReader, CdcWrite};

use super::boot::{Order, Stage};
use super::event::{Events, IdentityField, MnEvent};
use super::fault::Fault;
use super::node::{Network, Node};
use crate::nmt::NmtCommand;
use crate::sdo::{Client, ClientError, SERVICE_DATA_MAX, Timing};
use crate::wire::IdentResponse;

/// A configuration value without an answer for this time has failed.
const SDO_GIVE_UP_NS: u64 = 5_000_000_000;
/// Before the first write of the configuration.
pub(super) const NOTHING_WRITTEN: CdcWrite<'static> = CdcWrite {
    index: 0,
    sub: 0,
    value: &[],
};

impl<'a> Node<'a> {
    /// The first value of the identity that is not as expected: (which, expected, got).
    pub(super) fn mismatch(&self, ident: &IdentResponse) -> Option<(IdentityField, u32, u32)> {
        let identity = &self.config.identity;
        [
            (IdentityField::DeviceType, identity.device_type, ident.device_type),
            (IdentityField::VendorId, identity.vendor_id, ident.vendor_id),
            (IdentityField::ProductCode, identity.product_code, ident.product_code),
            (IdentityField::Revision, identity.revision, ident.revision),
            (IdentityField::Serial, identity.serial, ident.serial),
        ]
        .into_iter()
        .find_map(|(field, expected, got)| expected.filter(|value| *value != got).map(|value| (field, value, got)))
    }

    /// Gets ready to write the concise DCF; `false`: there is nothing to write.
    pub(super) fn begin_configuration(&mut self, ident: &IdentResponse, network: &Network) -> bool {
        // Checked when the managing node was made; an empty one has nothing to read.
        self.writes = CdcReader::new(self.config.configuration).ok();
        self.written = 0;
        if self.configuration_is_current(ident) {
            return false;
        }
        self.sdo = Client::new(timing(network.cycle_ns));
        true
    }

    /// Nothing to write: the configuration is empty, or the node reports the date and time (0x1020/1, /2) that it sets.
    fn configuration_is_current(&self, ident: &IdentResponse) -> bool {
        let Some(writes) = self.writes.clone() else { return true };
        let (mut date, mut time, mut count) = (0, 0, 0u32);
        for write in writes.flatten() {
            count += 1;
            if let (0x1020, Ok(value)) = (write.index, write.value.try_into()) {
                match write.sub {
                    1 => date = u32::from_le_bytes(value),
                    2 => time = u32::from_le_bytes(value),
                    _ => {}
                }
            }
        }
        let current = (ident.configuration_date, ident.configuration_time);
        count == 0 || (date != 0 && time != 0 && current == (date, time))
    }

    /// The SDO frame that is due, see [`Client::poll_transmit`].
    pub(super) fn transmit_sdo(&mut self, now_ns: u64, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        self.sdo.poll_transmit(now_ns, self.writing.value, out)
    }

    /// Takes the result of the last write and starts the next one.
    pub(super) fn configure(&mut self, now_ns: u64, network: &Network, events: &mut Events) {
        let CdcWrite { index, sub, .. } = self.writing;
        let node = self.config.id;
        if self.sdo.is_busy() {
            let aborted = match self.sdo.result() {
                None => return,
                Some(Ok(_)) => None,
                Some(Err(ClientError::Aborted(code))) => Some(code),
                Some(Err(error)) => {
                    self.fail(
                        now_ns,
                        network,
                        Fault::ConfigurationFailed { index, sub, error },
                        events,
                    );
                    return;
                }
            };
            if let Some(code) = aborted {
                let fault = Fault::ConfigurationRefused { index, sub, code };
                if !may_be_refused(index, code) {
                    self.refuse(now_ns, network, fault, events);
                    self.order = Some(Order {
                        command: NmtCommand::ResetNode,
                        reason: fault.reset_reason(),
                    });
                    return;
                }
                events.push(fault.event(node));
            } else {
                self.statistics.objects_written += 1;
            }
            self.written += 1;
        } else if self.written == 0 {
            events.push(MnEvent::Configuring { node });
        }
        let Some(Ok(write)) = self.writes.as_mut().and_then(Iterator::next) else {
            self.sdo.close();
            self.stage = Stage::CloseSdo;
            return;
        };
        self.writing = write;
        let CdcWrite { index, sub, value } = write;
        if let Err(error) = self.sdo.start_write(index, sub, value.len()) {
            self.fail(
                now_ns,
                network,
                Fault::ConfigurationFailed { index, sub, error },
                events,
            );
        }
    }
}

/// Storing and restoring parameters is optional: a node without these objects is configured all the same.
fn may_be_refused(index: u16, code: AbortCode) -> bool {
    (index == 0x1010 || index == 0x1011) && code == AbortCode::NO_OBJECT
}

/// Time limits of the SDO clients: a lost frame is repeated after a few rounds of the asynchronous slot.
fn timing(cycle_ns: u64) -> Timing {
    let first_timeout_ns = (20 * cycle_ns).max(20_000_000);
    Timing {
        first_timeout_ns,
        longest_timeout_ns: 8 * first_timeout_ns,
        give_up_ns: SDO_GIVE_UP_NS,
        acknowledge_delay_ns: first_timeout_ns / 2,
    }
}
