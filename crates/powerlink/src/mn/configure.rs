//! What a node is, and what is written into it: the checks of its IdentResponse and the configuration manager.
//!
//! In:  the IdentResponse, the concise DCF, results of the SDO client.
//! Out: writes through the SDO client, one after the other, and reads of what is expected; what differs, as an event.
//! RT: no allocation, no locks; one write or read a step.

use obd::cdc::{CdcReader, CdcWrite};
use obd::{AbortCode, Expected};

use super::config::{Identity, Stamp, expected_stamp};
use super::event::{Events, IdentityField, MnEvent};
use super::fault::Fault;
use super::node::{Network, Node};
use super::stage::{BootStage, Order};
use crate::nmt::NmtCommand;
use crate::sdo::{Client, ClientError, Timing};
use crate::wire::IdentResponse;

/// A configuration value without an answer for this time has failed.
pub(super) const SDO_GIVE_UP_NS: u64 = 5_000_000_000;
/// What a node may take for an answer without being asked again.
const FIRST_TIMEOUT_MIN_NS: u64 = 10_000_000;

/// The configuration manager of one node: what it has still to write and to read.
#[derive(Debug)]
pub(super) struct ConfigurationManager<'a> {
    /// Writes of the concise DCF that are still to come; `None`: the node holds them already.
    writes: Option<CdcReader<'a>>,
    /// Value of the write under way.
    written_value: &'a [u8],
    /// Values of [`NodeConfig::expected`](super::NodeConfig::expected) that have been asked for, and the one that comes.
    asked: usize,
    read_value: [u8; 4],
}

impl<'a> ConfigurationManager<'a> {
    pub(super) const IDLE: ConfigurationManager<'a> = ConfigurationManager {
        writes: None,
        written_value: &[],
        asked: 0,
        read_value: [0; 4],
    };

    fn is_reading(&self) -> bool {
        self.asked > 0
    }

    /// What the SDO client sends.
    pub(super) fn source(&self) -> &'a [u8] {
        self.written_value
    }

    /// Where the SDO client puts what it receives.
    pub(super) fn sink(&mut self) -> &mut [u8] {
        if self.is_reading() {
            &mut self.read_value
        } else {
            &mut []
        }
    }
}

impl<'a> Node<'a> {
    /// The first value of identity and software that is not as expected. What is compared is up to bits 9 and 10 of 0x1F80 and
    /// bit 5 of the assignment.
    pub(super) fn mismatch(&self, ident: &IdentResponse, network: &Network) -> Option<Fault> {
        let Identity {
            device_type,
            vendor_id,
            product_code,
            revision,
            serial,
        } = self.config.identity;
        let whole = network.startup.check_identity;
        let identity = [
            (IdentityField::DeviceType, device_type, ident.device_type),
            (IdentityField::VendorId, vendor_id.filter(|_| whole), ident.vendor_id),
            (
                IdentityField::ProductCode,
                product_code.filter(|_| whole),
                ident.product_code,
            ),
            (IdentityField::Revision, revision.filter(|_| whole), ident.revision),
            (IdentityField::Serial, serial.filter(|_| whole), ident.serial),
        ]
        .into_iter()
        .find_map(|(field, expected, got)| {
            let expected = expected.filter(|value| *value != got)?;
            Some(Fault::WrongIdentity { field, expected, got })
        });
        let check_software = network.startup.check_software && self.config.assignment.check_software;
        let got = Stamp {
            date: ident.software_date,
            time: ident.software_time,
        };
        let software = self
            .config
            .software
            .filter(|expected| check_software && *expected != got);
        identity.or(software.map(|expected| Fault::WrongSoftware { expected, got }))
    }

    /// Gets ready to write the concise DCF, as far as the node does not hold it, and to read what is expected; `false`: there is neither.
    pub(super) fn begin_configuration(&mut self, ident: &IdentResponse, network: &Network) -> bool {
        let is_current = self.configuration_is_current(ident, network);
        // Checked when the managing node was made; an empty one has nothing to read.
        let writes = CdcReader::new(self.config.configuration).ok();
        self.manager = ConfigurationManager {
            writes: writes.filter(|_| !is_current),
            ..ConfigurationManager::IDLE
        };
        // The connection of the last boot is void, also for the application.
        self.sdo = Client::new(timing(network));
        !is_current || !self.config.expected.is_empty()
    }

    /// Nothing to write: the configuration is empty, or bit 11 of 0x1F80 is set and the node reports the stamp it shall have.
    pub(super) fn configuration_is_current(&self, ident: &IdentResponse, network: &Network) -> bool {
        let Some(writes) = CdcReader::new(self.config.configuration).ok() else {
            return true;
        };
        let expected = expected_stamp(&self.config);
        let is_expected = expected == Some(configuration_of(ident));
        writes.flatten().next().is_none() || (network.startup.check_configuration && is_expected)
    }

    /// The node shows date and time of another configuration than the one that was written: it has not heard
    /// ResetConfiguration, by which that came into use.
    pub(super) fn missed_its_reset(&self, ident: &IdentResponse) -> bool {
        expected_stamp(&self.config).is_some_and(|expected| expected != configuration_of(ident))
    }

    /// Takes the result of the last write or read and starts the next one.
    pub(super) fn configure(&mut self, network: &Network, events: &mut Events) {
        let BootStage::Configuring {
            mut written,
            index,
            sub,
        } = self.stage
        else {
            return;
        };
        let node = self.config.id;
        if self.sdo.is_busy() {
            let Some(result) = self.sdo.result() else { return };
            let reading = self.manager.is_reading();
            let fault = match result {
                Ok(octets) if reading => self.wrong_value(octets),
                Ok(_) => {
                    self.statistics.objects_written += 1;
                    None
                }
                Err(ClientError::Aborted(code)) => {
                    let fault = Fault::ConfigurationRefused { index, sub, code };
                    if reading {
                        Some(fault).filter(|_| !is_missing(code))
                    } else if may_be_refused(index, sub, code) {
                        events.push(fault.event(node));
                        None
                    } else {
                        Some(fault)
                    }
                }
                Err(error) => {
                    let fault = Fault::ConfigurationFailed { index, sub, error };
                    return self.fail(network, fault, events);
                }
            };
            if let Some(fault) = fault {
                return self.refuse_configured(network, fault, events);
            }
            written += u32::from(!reading);
        } else if written == 0 && self.manager.writes.is_some() {
            events.push(MnEvent::Configuring { node });
        }
        self.sdo.set_timing(timing(network));
        let (index, sub, started) = match self.manager.writes.as_mut().and_then(Iterator::next) {
            Some(Ok(CdcWrite { index, sub, value })) => {
                self.manager.written_value = value;
                (index, sub, self.sdo.start_write(index, sub, value.len()))
            }
            Some(Err(_)) | None => match self.config.expected.get(self.manager.asked) {
                Some(&Expected { index, sub, .. }) => {
                    self.manager.asked += 1;
                    self.manager.written_value = &[];
                    (index, sub, self.sdo.start_read(index, sub))
                }
                None => {
                    self.sdo.close();
                    let was_current = self.manager.writes.is_none();
                    self.stage = BootStage::ClosingSdo { was_current };
                    return;
                }
            },
        };
        self.stage = BootStage::Configuring { written, index, sub };
        if let Err(error) = started {
            let fault = Fault::ConfigurationFailed { index, sub, error };
            self.fail(network, fault, events);
        }
    }

    /// What is wrong with the value that has been read, of so many octets; `None`: nothing, or none was read.
    fn wrong_value(&self, octets: usize) -> Option<Fault> {
        let Expected {
            index,
            sub,
            mask,
            value,
        } = *self.config.expected.get(self.manager.asked.checked_sub(1)?)?;
        let mut read = [0; 4];
        for (octet, came) in read.iter_mut().zip(self.manager.read_value.iter().take(octets)) {
            *octet = *came;
        }
        let got = u32::from_le_bytes(read) & mask;
        (got != value).then_some(Fault::WrongValue {
            index,
            sub,
            expected: value,
            got,
        })
    }

    /// It is reset, so that it forgets what was written.
    fn refuse_configured(&mut self, network: &Network, fault: Fault, events: &mut Events) {
        self.refuse(network, fault, events);
        self.order = Some(Order {
            command: NmtCommand::ResetNode,
            reason: fault.error_code(),
        });
    }
}

fn is_missing(code: AbortCode) -> bool {
    code == AbortCode::NO_OBJECT || code == AbortCode::NO_SUB_INDEX
}

fn configuration_of(ident: &IdentResponse) -> Stamp {
    Stamp {
        date: ident.configuration_date,
        time: ident.configuration_time,
    }
}

/// A node without these objects is configured all the same: they store parameters, say which configuration it holds, tune its
/// watch over the network, or tell it of other nodes and of slots it may have no part in. What it lacks is told as an event. A node that has the object and
/// refuses the value is refused.
fn may_be_refused(index: u16, sub: u8, code: AbortCode) -> bool {
    let optional = match index {
        0x1010 | 0x1011 | 0x1020 | 0x1C0A..=0x1C14 | 0x1F81 | 0x1F8D | 0x1F9B => true,
        // Length of the multiplexed round, AsyncMTU, prescaler.
        0x1F98 => matches!(sub, 7..=9),
        _ => false,
    };
    optional && is_missing(code)
}

/// Time limits of the SDO clients: a frame is repeated when all nodes that are being configured could have had their command
/// and their answer twice, and a few others their slot.
pub(super) fn timing(network: &Network) -> Timing {
    let slots = 8 + 4 * u64::from(network.being_configured);
    let first_timeout_ns = (slots * network.slot_ns).max(FIRST_TIMEOUT_MIN_NS);
    Timing {
        first_timeout_ns,
        longest_timeout_ns: 8 * first_timeout_ns,
        give_up_ns: SDO_GIVE_UP_NS,
        acknowledge_delay_ns: first_timeout_ns / 2,
    }
}
