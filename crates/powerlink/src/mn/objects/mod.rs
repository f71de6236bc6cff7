//! Object dictionary of the managing node: a view on what it already holds, not a second copy.
//!
//! In:  SDO accesses. Out: values from the configuration, live states and counters; the few writes that a running network takes.
//! RT: no allocation, no locks; a few passes over the table and the nodes.
//!
//! The configuration is taken at the start, checked as a whole, and never changes: writes to it end with 0x08000022 (device
//! state). What may be written is in [`MnObjects::write_value`].

mod table;

use obd::{AbortCode, DataType, EntryDef, Objects, Value};

pub use table::{FEATURE_FLAGS, HISTORY_ENTRIES, MN_PROFILE};

use super::config::{MnConfig, expected_stamp};
use super::configure::SDO_GIVE_UP_NS;
use super::event::{Counters, Events, NodeState};
use super::image::{ARRAYS, IMAGE_IN, IMAGE_OUT, octet_at};
use super::node::{Network, Node};
use super::nodes::Nodes;
use super::startup::Assignment;
use super::state::{Mn, OwnObjects, RequestCommand};
use crate::nmt::{NmtCommand, NmtState};
use crate::wire::{self, ERROR_ENTRY_LEN, ErrorEntry, NetTime, PAYLOAD_LIMIT_MIN};
use table::CHANNEL_LAST;

/// The dictionary of a managing node, for as long as one SDO frame or one look takes.
#[derive(Debug)]
pub struct MnObjects<'m, 'a, const NODES: usize> {
    pub(super) network: Network,
    pub(super) config: &'m mut MnConfig<'a>,
    pub(super) nodes: &'m mut Nodes<'a, NODES>,
    pub(super) counters: &'m mut Counters,
    pub(super) events: &'m mut Events,
    pub(super) own: &'m mut OwnObjects,
}

/// Borrows the parts of a managing node that its objects show, so that the rest stays free.
macro_rules! objects_of {
    ($mn:expr, $now_ns:expr) => {{
        let network = $mn.network($now_ns);
        $crate::mn::objects::MnObjects {
            network,
            config: &mut $mn.config,
            nodes: &mut $mn.nodes,
            counters: &mut $mn.counters,
            events: &mut $mn.events,
            own: &mut $mn.own,
        }
    }};
}
pub(super) use objects_of;

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// Its object dictionary, as an SDO sees it.
    pub fn objects(&mut self, now_ns: u64) -> MnObjects<'_, 'a, NODES> {
        objects_of!(self, now_ns)
    }
}

/// A line of the table that was found; for process data which channel, for the process image which array.
#[derive(Clone, Copy, Debug)]
struct Found {
    def: &'static EntryDef,
    channel: usize,
}

/// The object of the table that stands for this one, and the channel of process data or the array of the process image.
fn base(index: u16) -> (u16, usize) {
    let objects = [0x1400, 0x1600, 0x1800, 0x1A00].map(|first| (first, CHANNEL_LAST));
    let arrays = [IMAGE_OUT, IMAGE_IN].map(|first| (first, ARRAYS - 1));
    for (first, last) in objects.into_iter().chain(arrays) {
        if (first..=first + last).contains(&index) {
            return (first, usize::from(index - first));
        }
    }
    (index, 0)
}

/// Sub-index 0 of an object that has no line for it: its highest sub-index.
static NUMBER_OF_ENTRIES: EntryDef = EntryDef::constant(0, DataType::U8, "NumberOfEntries");

impl<'a, const NODES: usize> MnObjects<'_, 'a, NODES> {
    fn find(&self, index: u16, sub: u8) -> Result<Found, AbortCode> {
        let (object, channel) = base(index);
        if channel > self.config.nodes.len() && object != IMAGE_OUT && object != IMAGE_IN {
            return Err(AbortCode::NO_OBJECT);
        }
        let lines = || MN_PROFILE.iter().filter(|def| def.index == object);
        let line = lines().find(|def| (def.sub_first..=def.sub_last).contains(&sub));
        match line {
            Some(def) => Ok(Found { def, channel }),
            None if lines().next().is_none() => Err(AbortCode::NO_OBJECT),
            None if sub == 0 => Ok(Found {
                def: &NUMBER_OF_ENTRIES,
                channel,
            }),
            None => Err(AbortCode::NO_SUB_INDEX),
        }
    }

    /// The node of a channel of process data; channel 0 has none.
    fn node_of_channel(&self, channel: usize) -> Option<&Node<'a>> {
        self.nodes.get(channel.checked_sub(1)?)
    }

    /// Value of an object that is a number; `None`: the default of the table.
    fn number(&self, index: u16, channel: usize, sub: u8) -> Option<u64> {
        let config = &*self.config;
        let device = &config.device;
        let node = || self.nodes.with_id(sub);
        let counter = match index {
            0x1C00 => self.counters.crc_errors,
            _ => self.counters.cycle_exceeded,
        };
        let number: u32 = match (index, sub) {
            (0x1000, _) => device.device_type,
            (0x1001, _) => self.error_register().into(),
            (0x1003, _) => self.history().iter().flatten().count() as u32,
            (0x1006, _) => config.cycle_ns / 1000,
            (0x1018, 1) => device.vendor_id,
            (0x1018, 2) => device.product_code,
            (0x1018, 3) => device.revision,
            (0x1018, 4) => device.serial,
            (0x1300, _) => (SDO_GIVE_UP_NS / 1_000_000) as u32,
            (0x1400 | 0x1800, 1) => self.node_of_channel(channel)?.config.id.into(),
            (0x1400, 2) => self.node_of_channel(channel)?.config.pres_version.into(),
            (0x1800, 2) if channel == 0 => config.pres_mn_version.into(),
            (0x1800, 2) => self.node_of_channel(channel)?.config.preq_version.into(),
            (0x1600 | 0x1A00, 0) => {
                let image = image_of(index);
                (1..=254)
                    .take_while(|sub| config.mapping_entry(image, channel, *sub).is_some())
                    .count() as u32
            }
            (0x1600 | 0x1A00, sub) => return Some(config.mapping_entry(image_of(index), channel, sub).unwrap_or(0)),
            (IMAGE_OUT | IMAGE_IN, sub) => {
                let (of_channel, at) = config.channel_of(index, octet_at(channel, sub))?;
                let node = self.node_of_channel(of_channel)?;
                let octets = if index == IMAGE_OUT {
                    node.output()
                } else {
                    node.input().0
                };
                (*octets.get(at)?).into()
            }
            (0x1C00 | 0x1C02, 1) => counter.cumulative,
            (0x1C00 | 0x1C02, 2) => counter.count,
            (0x1C00, _) => config.crc_threshold,
            (0x1C02, _) => config.cycle_threshold,
            (0x1C07, _) => node()?.statistics.loss_of_pres.cumulative,
            (0x1C08, _) => node()?.statistics.loss_of_pres.count,
            (0x1C09, _) => node()?.config.pres_threshold,
            (0x1C15, _) => node()?.statistics.loss_of_status.cumulative,
            (0x1C16, _) => node()?.statistics.loss_of_status.count,
            (0x1C17, _) => node()?.config.status_threshold,
            (0x1F26, _) => expected_stamp(&node()?.config)?.date,
            (0x1F27, _) => expected_stamp(&node()?.config)?.time,
            (0x1F52, 1) => device.software.date,
            (0x1F52, 2) => device.software.time,
            (0x1F53, _) => node()?.config.software?.date,
            (0x1F54, _) => node()?.config.software?.time,
            (0x1F80, _) => config.startup.to_bits(),
            (0x1F81, wire::node::MN) => self.own_assignment(),
            (0x1F81, _) => node()?.config.assignment.to_bits(),
            (0x1F84, _) => node()?.config.identity.device_type?,
            (0x1F85, _) => node()?.config.identity.vendor_id?,
            (0x1F86, _) => node()?.config.identity.product_code?,
            (0x1F87, _) => node()?.config.identity.revision?,
            (0x1F88, _) => node()?.config.identity.serial?,
            (0x1F89, 1) => config.boot.wait_not_active_us,
            (0x1F89, 2) => config.boot.timeout_pre_op_1_us,
            (0x1F89, 3) => config.boot.wait_pre_op_1_us,
            (0x1F89, 4) => config.boot.timeout_pre_op_2_us,
            (0x1F89, 5) => config.boot.timeout_ready_to_operate_us,
            (0x1F8A, 1) => config.soc_preq_wait_ns,
            (0x1F8A, 2) => config.async_slot_timeout_ns,
            (0x1F8B, _) => payload_limit(node()?.config.preq_bytes),
            (0x1F8C, _) => u8::from(self.network.state).into(),
            (0x1F8D, wire::node::MN) => payload_limit(config.pres_mn_bytes?),
            (0x1F8D, _) => payload_limit(node()?.config.pres_bytes),
            (0x1F8E, wire::node::MN) => u8::from(self.network.state).into(),
            (0x1F8E, _) => match node()?.nmt_state {
                // Nothing was heard since it is looked for.
                NmtState::Off => return None,
                state => u8::from(state).into(),
            },
            (0x1F8F, wire::node::MN) => u8::from(NmtState::Operational).into(),
            (0x1F8F, _) => u8::from(node()?.expected_nmt_state(self.network.state)).into(),
            (0x1F92, _) => node()?.config.pres_timeout_ns,
            (0x1F98, 5) => payload_limit(config.pres_mn_bytes?),
            (0x1F98, 7) => config.multiplex_cycles.into(),
            (0x1F98, 8) => config.async_mtu.into(),
            (0x1F98, 9) => config.prescaler.into(),
            (0x1F9B, _) => node()?.config.multiplex_cycle.into(),
            (0x1F9F, 2) => self.own.request.command.into(),
            (0x1F9F, 3) => self.own.request.target.into(),
            _ => return None,
        };
        Some(number.into())
    }

    /// Value of an object that is not a number; `None`: the default of the table.
    fn octets(&self, index: u16, sub: u8) -> Option<&[u8]> {
        let device = &self.config.device;
        Some(match (index, sub) {
            (0x1008, _) => device.device_name.as_bytes(),
            (0x1009, _) => device.hardware_version.as_bytes(),
            (0x100A, _) => device.software_version.as_bytes(),
            (0x1030, 5) => &self.config.mac,
            (0x1F22, _) => self.nodes.with_id(sub)?.config.configuration,
            (0x1F9A, _) => device.host_name.as_bytes(),
            _ => return None,
        })
    }

    /// Bit 0, generic, and bit 4, communication, as long as a node is missing or faulted that should run.
    fn error_register(&self) -> u8 {
        let faulted = self.nodes.iter().any(|node| node.state == NodeState::Faulted);
        if faulted { 0x11 } else { 0 }
    }

    /// The managing node itself: it exists, sends a PRes or not, and the entry is valid.
    fn own_assignment(&self) -> u32 {
        let sends_pres = u32::from(self.config.pres_mn_bytes.is_some()) << 12;
        1 | sends_pres | Assignment::VALID
    }

    /// The last faults of the nodes, the newest first; the node's id is the first octet of the additional information.
    fn history(&self) -> [Option<ErrorEntry>; HISTORY_ENTRIES as usize] {
        let mut history = [None; HISTORY_ENTRIES as usize];
        let mut before = (u64::MAX, u8::MAX);
        for entry in &mut history {
            let next = self
                .nodes
                .iter()
                .filter_map(|node| Some((node.config.id, node.record.last_fault?)))
                .filter(|(id, last)| last.at_ns >= self.own.history_from_ns && (last.at_ns, *id) < before)
                .max_by_key(|(id, last)| (last.at_ns, *id));
            let Some((id, last)) = next else { break };
            before = (last.at_ns, id);
            *entry = Some(ErrorEntry {
                // Occurred, of the communication profile.
                entry_type: 0x3002,
                code: last.fault.error_code(),
                time: NetTime {
                    seconds: (last.at_ns / 1_000_000_000) as u32,
                    nanoseconds: (last.at_ns % 1_000_000_000) as u32,
                },
                info: [id, 0, 0, 0, 0, 0, 0, 0],
            });
        }
        history
    }

    fn read_value(&self, found: Found, index: u16, sub: u8, out: &mut [u8]) -> Result<usize, AbortCode> {
        let Found { def, channel } = found;
        let (object, _) = base(index);
        if core::ptr::eq(def, &NUMBER_OF_ENTRIES) {
            let last = MN_PROFILE.iter().filter(|def| def.index == object);
            let highest = last.map(|def| def.sub_last).max().unwrap_or(0);
            return put(out, &[highest]);
        }
        if object == 0x1003 && sub > 0 {
            let entry = self.history()[usize::from(sub - 1)];
            return match entry {
                Some(entry) => put::<ERROR_ENTRY_LEN>(out, &entry.to_octets()),
                None => Ok(0),
            };
        }
        match (def.data_type.size(), def.default) {
            (_, Value::Octets(default)) => put_slice(out, self.octets(object, sub).unwrap_or(default)),
            (Some(_), Value::Zero) if def.data_type == DataType::Mac => {
                put_slice(out, self.octets(object, sub).unwrap_or(&[0; 6]))
            }
            (None, _) => put_slice(out, self.octets(object, sub).unwrap_or(&[])),
            (Some(size), default) => {
                let default = match default {
                    Value::Integer(value) => value as u64,
                    Value::Zero | Value::Octets(_) => 0,
                };
                let number = self.number(object, channel, sub).unwrap_or(default);
                put_slice(out, number.to_le_bytes().get(..size).unwrap_or(&[]))
            }
        }
    }

    /// What a running network takes: counters and thresholds of errors, the history, requests for NMT services.
    fn write_value(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
        let number = le_number(value) as u32;
        match (index, sub) {
            (0x1003, 0) => self.own.history_from_ns = self.network.now_ns + 1,
            (0x1030, 8) => {}
            (0x1C00, 1) => self.counters.crc_errors.cumulative = number,
            (0x1C00, 3) => self.config.crc_threshold = number,
            (0x1C02, 1) => self.counters.cycle_exceeded.cumulative = number,
            (0x1C02, 3) => self.config.cycle_threshold = number,
            (0x1C07, id) => self.configured_node(id)?.statistics.loss_of_pres.cumulative = number,
            (0x1C09, id) => self.configured_node(id)?.config.pres_threshold = number,
            (0x1C15, id) => self.configured_node(id)?.statistics.loss_of_status.cumulative = number,
            (0x1C17, id) => self.configured_node(id)?.config.status_threshold = number,
            // The application of the control resets itself; no node may.
            (0x1F9E, _) => return Err(AbortCode::LOCAL_CONTROL),
            (0x1F9F, 1) if number == 0 => {}
            (0x1F9F, 1) => return self.execute_request(),
            (0x1F9F, 2) => self.own.request.command = number as u8,
            (0x1F9F, 3) => self.own.request.target = number as u8,
            (_, _) => return Err(AbortCode::DEVICE_STATE),
        }
        Ok(())
    }

    fn writable(&self, index: u16, sub: u8) -> Result<&'static EntryDef, AbortCode> {
        let Found { def, .. } = self.find(index, sub)?;
        if def.access.writable() {
            Ok(def)
        } else {
            Err(AbortCode::WRITE_OF_READ_ONLY)
        }
    }

    fn concise_dcf(&self, index: u16, sub: u8) -> Option<&'a [u8]> {
        let node = self.nodes.with_id(sub).filter(|_| index == 0x1F22)?;
        Some(node.config.configuration)
    }

    /// A configured node; counters of others are not kept.
    fn configured_node(&mut self, id: u8) -> Result<&mut Node<'a>, AbortCode> {
        self.nodes.with_id_mut(id).ok_or(AbortCode::DEVICE_STATE)
    }

    /// 0x1F9F: a request to a node for its identity or its status; a reset, of a node that does not take part in the process.
    /// Everything else is up to the boot-up.
    fn execute_request(&mut self) -> Result<(), AbortCode> {
        let RequestCommand { command, target } = self.own.request;
        let network = self.network;
        let node = self.nodes.with_id_mut(target).ok_or(AbortCode::VALUE_RANGE)?;
        match NmtCommand::from(command) {
            NmtCommand::IdentRequest => node.ident.asked = true,
            NmtCommand::StatusRequest => node.status.asked = true,
            NmtCommand::ResetNode if node.state == NodeState::Operational => return Err(AbortCode::DEVICE_STATE),
            NmtCommand::ResetNode => node.reset(&network, self.events),
            _ => return Err(AbortCode::LOCAL_CONTROL),
        }
        Ok(())
    }
}

impl<const NODES: usize> Objects for MnObjects<'_, '_, NODES> {
    fn sdo_read(&mut self, index: u16, sub: u8, out: &mut [u8]) -> Result<usize, AbortCode> {
        let found = self.find(index, sub)?;
        if !found.def.access.readable() {
            return Err(AbortCode::READ_OF_WRITE_ONLY);
        }
        self.read_value(found, index, sub, out)
    }

    /// A concise DCF may be long, and does not change while it is read.
    fn sdo_read_parts(&mut self, index: u16, sub: u8) -> Result<Option<usize>, AbortCode> {
        self.find(index, sub)?;
        Ok(self.concise_dcf(index, sub).map(<[u8]>::len))
    }

    fn sdo_read_part(&mut self, index: u16, sub: u8, offset: usize, out: &mut [u8]) -> Result<(), AbortCode> {
        let dcf = self.concise_dcf(index, sub).unwrap_or(&[]);
        let part = offset.checked_add(out.len()).and_then(|end| dcf.get(offset..end));
        out.copy_from_slice(part.ok_or(AbortCode::GENERAL)?);
        Ok(())
    }

    fn sdo_write_parts(&mut self, index: u16, sub: u8, len: usize) -> Result<bool, AbortCode> {
        check_length(self.writable(index, sub)?, len)?;
        // Nothing that long is taken by a running network.
        Err(AbortCode::DEVICE_STATE)
    }

    fn sdo_write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
        let def = self.writable(index, sub)?;
        check_length(def, value.len())?;
        check_limits(def, value)?;
        self.write_value(base(index).0, sub, value)
    }
}

fn check_length(def: &EntryDef, octets: usize) -> Result<(), AbortCode> {
    let (shortest, longest) = match def.data_type.size() {
        Some(size) => (size, size),
        None => (0, usize::from(def.capacity)),
    };
    if octets > longest {
        return Err(AbortCode::TOO_LONG);
    }
    if octets < shortest {
        return Err(AbortCode::TOO_SHORT);
    }
    Ok(())
}

fn check_limits(def: &EntryDef, value: &[u8]) -> Result<(), AbortCode> {
    let number = le_number(value);
    let above = |limit: i64| number > limit as u64;
    if def.data_type == DataType::Bool && number > 1 {
        return Err(AbortCode::VALUE_RANGE);
    }
    if def.high.is_some_and(above) {
        return Err(AbortCode::VALUE_TOO_HIGH);
    }
    if def.low.is_some_and(|limit| number < limit as u64) {
        return Err(AbortCode::VALUE_TOO_LOW);
    }
    Ok(())
}

/// The first eight octets as a number; all numbers here are unsigned.
fn le_number(value: &[u8]) -> u64 {
    value
        .iter()
        .take(8)
        .rev()
        .fold(0, |number, octet| number << 8 | u64::from(*octet))
}

/// The image that the channels of this mapping object map.
fn image_of(mapping: u16) -> u16 {
    if mapping == 0x1A00 { IMAGE_OUT } else { IMAGE_IN }
}

fn payload_limit(octets: u16) -> u32 {
    usize::from(octets).max(PAYLOAD_LIMIT_MIN) as u32
}

fn put<const LEN: usize>(out: &mut [u8], value: &[u8; LEN]) -> Result<usize, AbortCode> {
    put_slice(out, value)
}

fn put_slice(out: &mut [u8], value: &[u8]) -> Result<usize, AbortCode> {
    out.get_mut(..value.len())
        .ok_or(AbortCode::OUT_OF_MEMORY)?
        .copy_from_slice(value);
    Ok(value.len())
}
