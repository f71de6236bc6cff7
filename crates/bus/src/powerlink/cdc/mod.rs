//! The concise DCF of the managing node (.cdc): the whole network in the file format that other managing nodes start from.
//!
//! In:  the configuration of `powerlink::mn`; or the octets of a file.
//! Out: octets, the configuration again, or a listing to compare with that of another tool.
//!
//! Order: for each node first NodeAssignment (1F81) without its valid bit, then everything else, among it the node's own
//! concise DCF (1F22), at last NodeAssignment as it is: nothing starts with half a configuration. What no object holds is not
//! in the file: MAC, the pause after a reset, and the polls in a row that are ridden out.

use super::network::LOSS_COUNT;
use obd::cdc::{CdcError, CdcReader, CdcWrite, CdcWriter};
use obd::mapping::MappingEntry;
use powerlink::mn::{
    Assignment, BootTimes, CHANNEL_OCTETS_MAX, IMAGE_IN, IMAGE_OCTETS_MAX, IMAGE_OUT, MnConfig, NodeConfig, RefusedBit,
    Stamp, StartUp,
};
use powerlink::wire::{PAYLOAD_LIMIT_MIN, node::MN};
use std::collections::BTreeMap;
use std::fmt::{self, Write as _};

/// NodeAssignment while the rest is written: the node exists, is a controlled node and would be started.
const EXISTS: u32 = 0x0000_0007;
/// Why a network cannot be written down for other managing nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CdcWriteError {
    /// More process data of one node than a mapping of octets has entries.
    Channel {
        /// Node id; 240: the managing node's own PRes.
        node: u8,
        /// Octets.
        octets: usize,
    },
    /// More process data of all nodes, in one direction, than the arrays of the process image have entries.
    Image {
        /// Octets.
        octets: usize,
    },
}

impl fmt::Display for CdcWriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CdcWriteError::Channel { node, octets } => write!(
                f,
                "node {node}: {octets} octets of process data, at most {CHANNEL_OCTETS_MAX} can be mapped octet by octet"
            ),
            CdcWriteError::Image { octets } => write!(
                f,
                "{octets} octets of process data in one direction, the process image holds {IMAGE_OCTETS_MAX}"
            ),
        }
    }
}

impl std::error::Error for CdcWriteError {}

/// The concise DCF for another managing node. It knows nothing of polls in a row that are ridden out: as many lost PRes, and one
/// more, reach its threshold (1C09), which is off in our own.
///
/// # Errors
/// As [`write()`].
pub fn write_for_others(config: &MnConfig<'_>) -> Result<Vec<u8>, CdcWriteError> {
    let watched = |node: &NodeConfig<'_>| match node.pres_threshold {
        0 => LOSS_COUNT * (config.pres_lost_max + 1),
        threshold => threshold,
    };
    let nodes = config.nodes.iter().map(|node| NodeConfig {
        pres_threshold: watched(node),
        ..*node
    });
    let nodes: Vec<_> = nodes.collect();
    write(&MnConfig {
        nodes: &nodes,
        ..*config
    })
}

/// The concise DCF of a managing node.
///
/// # Errors
/// More process data than can be mapped octet by octet, as other managing nodes want it.
pub fn write(config: &MnConfig<'_>) -> Result<Vec<u8>, CdcWriteError> {
    for image in [IMAGE_OUT, IMAGE_IN] {
        let mut sum = 0;
        for channel in 0..=config.nodes.len() {
            let octets = config.channel_octets(image, channel);
            if octets > CHANNEL_OCTETS_MAX {
                let node = channel.checked_sub(1).map_or(MN, |at| config.nodes[at].id);
                return Err(CdcWriteError::Channel { node, octets });
            }
            sum += octets;
        }
        if sum > IMAGE_OCTETS_MAX {
            return Err(CdcWriteError::Image { octets: sum });
        }
    }
    let mut file = File(Vec::new());
    for node in config.nodes {
        file.number(0x1F81, node.id, EXISTS);
    }
    network(&mut file, config);
    for (channel, node) in (1..).zip(config.nodes) {
        one_node(&mut file, config, channel, node);
    }
    if config.pres_mn_bytes.is_some() {
        file.number(0x1F81, MN, 1 | 1 << 12 | Assignment::VALID);
    }
    for node in config.nodes {
        file.number(0x1F81, node.id, node.assignment.to_bits());
    }
    Ok(file.octets())
}

struct File(Vec<(u16, u8, Vec<u8>)>);

impl File {
    fn number(&mut self, index: u16, sub: u8, value: u32) {
        self.0.push((index, sub, value.to_le_bytes().to_vec()));
    }

    fn short(&mut self, index: u16, sub: u8, value: u16) {
        self.0.push((index, sub, value.to_le_bytes().to_vec()));
    }

    fn octet(&mut self, index: u16, sub: u8, value: u8) {
        self.0.push((index, sub, vec![value]));
    }

    /// A channel of process data: octet by octet in the process image, as a managing node maps whole objects only.
    fn channel(&mut self, config: &MnConfig<'_>, image: u16, channel: u16, node: u8, version: u8) {
        let communication = channel + if image == IMAGE_OUT { 0x1800 } else { 0x1400 };
        let mapping = communication + 0x200;
        self.octet(mapping, 0, 0);
        self.octet(communication, 1, node);
        self.octet(communication, 2, version);
        let mut count = 0;
        for sub in 1..=CHANNEL_OCTETS_MAX as u8 {
            let Some(entry) = config.mapping_entry(image, usize::from(channel), sub) else {
                break;
            };
            self.0.push((mapping, sub, entry.to_le_bytes().to_vec()));
            count = sub;
        }
        if count > 0 {
            self.octet(mapping, 0, count);
        }
    }

    fn octets(self) -> Vec<u8> {
        let length: usize = self.0.iter().map(|(_, _, value)| 7 + value.len()).sum();
        let mut octets = vec![0; 4 + length];
        let mut cdc = CdcWriter::new(&mut octets).expect("there is room for the count");
        for (index, sub, value) in &self.0 {
            cdc.push(*index, *sub, value).expect("the length was summed up");
        }
        cdc.finish().to_vec()
    }
}

fn limit(octets: u16) -> u16 {
    octets.max(PAYLOAD_LIMIT_MIN as u16)
}

fn network(file: &mut File, config: &MnConfig<'_>) {
    let boot = &config.boot;
    file.number(0x1006, 0, config.cycle_ns / 1000);
    file.number(0x1C00, 3, config.crc_threshold);
    file.number(0x1C02, 3, config.cycle_threshold);
    file.number(0x1F80, 0, config.startup.to_bits());
    file.number(0x1F89, 1, boot.wait_not_active_us);
    file.number(0x1F89, 2, boot.timeout_pre_op_1_us);
    file.number(0x1F89, 3, boot.wait_pre_op_1_us);
    file.number(0x1F89, 4, boot.timeout_pre_op_2_us);
    file.number(0x1F89, 5, boot.timeout_ready_to_operate_us);
    file.number(0x1F8A, 1, config.soc_preq_wait_ns);
    file.number(0x1F8A, 2, config.async_slot_timeout_ns);
    file.octet(0x1F98, 7, config.multiplex_cycles);
    file.short(0x1F98, 8, config.async_mtu);
    file.short(0x1F98, 9, config.prescaler);
    if let Some(octets) = config.pres_mn_bytes {
        file.short(0x1F8D, MN, limit(octets));
        // Node 0: to all.
        file.channel(config, IMAGE_OUT, 0, 0, config.pres_mn_version);
    }
}

fn one_node(file: &mut File, config: &MnConfig<'_>, channel: u16, node: &NodeConfig<'_>) {
    let id = node.id;
    let identity = &node.identity;
    let expected = [
        (0x1F84, identity.device_type),
        (0x1F85, identity.vendor_id),
        (0x1F86, identity.product_code),
        (0x1F87, identity.revision),
        (0x1F88, identity.serial),
        (0x1F53, node.software.map(|stamp| stamp.date)),
        (0x1F54, node.software.map(|stamp| stamp.time)),
        (0x1F26, node.configuration_stamp.map(|stamp| stamp.date)),
        (0x1F27, node.configuration_stamp.map(|stamp| stamp.time)),
    ];
    for (index, value) in expected {
        if let Some(value) = value {
            file.number(index, id, value);
        }
    }
    file.short(0x1F8B, id, limit(node.preq_bytes));
    file.short(0x1F8D, id, limit(node.pres_bytes));
    file.number(0x1F92, id, node.pres_timeout_ns);
    file.number(0x1C09, id, node.pres_threshold);
    file.number(0x1C17, id, node.status_threshold);
    if node.assignment.multiplexed {
        file.octet(0x1F9B, id, node.multiplex_cycle);
    }
    if !node.assignment.async_only {
        // What is for a chained node stands in the managing node's own PRes.
        if !node.assignment.chained {
            file.channel(config, IMAGE_OUT, channel, id, node.preq_version);
        }
        file.channel(config, IMAGE_IN, channel, id, node.pres_version);
    }
    if !node.configuration.is_empty() {
        file.0.push((0x1F22, id, node.configuration.to_vec()));
    }
}

/// Why a file is no configuration of our managing node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CdcFileError {
    /// The octets are no concise DCF.
    Octets(CdcError),
    /// A value of the wrong length.
    Length {
        index: u16,
        sub: u8,
        /// Octets expected.
        need: usize,
        /// Octets that came.
        got: usize,
    },
    /// A bit that our managing node does not serve.
    Refused(RefusedBit),
}

impl fmt::Display for CdcFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CdcFileError::Octets(error) => error.fmt(f),
            CdcFileError::Length { index, sub, need, got } => {
                write!(f, "0x{index:04X}:{sub}: expected {need} octets, got {got}")
            }
            CdcFileError::Refused(refused) => refused.fmt(f),
        }
    }
}

impl std::error::Error for CdcFileError {}

/// The network that a file describes.
#[derive(Clone, Debug, PartialEq)]
pub struct CdcNetwork<'a> {
    /// Values of the managing node; its nodes are those below.
    network: MnConfig<'static>,
    /// The nodes, by their ids.
    pub nodes: Vec<NodeConfig<'a>>,
    /// Objects that our managing node has no use for.
    pub others: Vec<(u16, u8)>,
}

impl<'a> CdcNetwork<'a> {
    /// The configuration of a managing node on an interface of this MAC.
    pub fn config(&'a self, mac: [u8; 6]) -> MnConfig<'a> {
        MnConfig {
            nodes: &self.nodes,
            mac,
            ..self.network
        }
    }
}

/// Values by their objects, the last one of each; and which were looked at.
struct Values<'a> {
    values: BTreeMap<(u16, u8), &'a [u8]>,
    used: Vec<(u16, u8)>,
}

impl<'a> Values<'a> {
    fn octets(&mut self, index: u16, sub: u8) -> Option<&'a [u8]> {
        self.used.push((index, sub));
        self.values.get(&(index, sub)).copied()
    }

    fn number(&mut self, index: u16, sub: u8, need: usize) -> Result<Option<u64>, CdcFileError> {
        let Some(value) = self.octets(index, sub) else {
            return Ok(None);
        };
        if value.len() != need {
            return Err(CdcFileError::Length {
                index,
                sub,
                need,
                got: value.len(),
            });
        }
        let mut wide = [0; 8];
        wide[..need].copy_from_slice(value);
        Ok(Some(u64::from_le_bytes(wide)))
    }

    fn long(&mut self, index: u16, sub: u8) -> Result<Option<u32>, CdcFileError> {
        Ok(self.number(index, sub, 4)?.map(|value| value as u32))
    }

    fn stamp(&mut self, date: u16, time: u16, node: u8) -> Result<Option<Stamp>, CdcFileError> {
        let (date, time) = (self.long(date, node)?, self.long(time, node)?);
        Ok(date.zip(time).map(|(date, time)| Stamp { date, time }))
    }

    /// First and last bit, and version, of what a mapping holds; `None`: there is no such channel.
    fn mapped(&mut self, communication: u16) -> Result<Option<(u8, u8, u16, u16)>, CdcFileError> {
        let Some(node) = self.number(communication, 1, 1)? else {
            return Ok(None);
        };
        let version = self.number(communication, 2, 1)?.unwrap_or(0);
        let count = self.number(communication + 0x200, 0, 1)?.unwrap_or(0);
        let (mut first, mut end) = (u16::MAX, 0);
        for sub in 1..=count as u8 {
            let entry = MappingEntry::from_u64(self.number(communication + 0x200, sub, 8)?.unwrap_or(0));
            first = first.min(entry.bit_offset);
            end = end.max(entry.bit_offset.saturating_add(entry.bit_length));
        }
        Ok(Some((node as u8, version as u8, first.min(end) / 8, end / 8)))
    }
}

/// Reads the file of a managing node.
///
/// # Errors
/// The octets are no concise DCF, a value has the wrong length, or a bit is set that our managing node does not serve.
pub fn read(octets: &[u8]) -> Result<CdcNetwork<'_>, CdcFileError> {
    let writes = CdcReader::new(octets).and_then(|reader| reader.collect::<Result<Vec<_>, _>>());
    let writes: Vec<CdcWrite<'_>> = writes.map_err(CdcFileError::Octets)?;
    let values = writes
        .iter()
        .map(|write| ((write.index, write.sub), write.value))
        .collect();
    let mut values = Values {
        values,
        used: Vec::new(),
    };
    let mut network = read_network(&mut values)?;
    let mut nodes = Vec::new();
    for id in 1..MN {
        let bits = values.long(0x1F81, id)?.unwrap_or(0);
        if let Some(assignment) = Assignment::from_bits(id, bits).map_err(CdcFileError::Refused)? {
            nodes.push(read_node(&mut values, id, assignment)?);
        }
    }
    for channel in 0..=0xFF {
        if let Some((node, version, _, end)) = values.mapped(0x1400 + channel)?
            && let Some(node) = nodes.iter_mut().find(|known| known.id == node)
        {
            (node.pres_bytes, node.pres_version) = (end, version);
        }
        match values.mapped(0x1800 + channel)? {
            Some((0, version, _, end)) => (network.pres_mn_bytes, network.pres_mn_version) = (Some(end), version),
            Some((node, version, _, end)) => {
                if let Some(node) = nodes.iter_mut().find(|known| known.id == node) {
                    (node.preq_bytes, node.preq_version) = (end, version);
                }
            }
            None => {}
        }
    }
    let others = values
        .values
        .keys()
        .filter(|object| !values.used.contains(object))
        .copied()
        .collect();
    Ok(CdcNetwork { network, nodes, others })
}

fn read_network(values: &mut Values<'_>) -> Result<MnConfig<'static>, CdcFileError> {
    let default = MnConfig::default();
    let boot = default.boot;
    let startup = values
        .long(0x1F80, 0)?
        .map(StartUp::from_bits)
        .transpose()
        .map_err(CdcFileError::Refused)?;
    let own = values.long(0x1F81, MN)?.unwrap_or(0);
    let own_limit = values.number(0x1F8D, MN, 2)?.map(|limit| limit as u16);
    Ok(MnConfig {
        cycle_ns: values
            .long(0x1006, 0)?
            .map_or(default.cycle_ns, |cycle_us| cycle_us.saturating_mul(1000)),
        crc_threshold: values.long(0x1C00, 3)?.unwrap_or(default.crc_threshold),
        cycle_threshold: values.long(0x1C02, 3)?.unwrap_or(default.cycle_threshold),
        startup: startup.unwrap_or(default.startup),
        boot: BootTimes {
            wait_not_active_us: values.long(0x1F89, 1)?.unwrap_or(boot.wait_not_active_us),
            timeout_pre_op_1_us: values.long(0x1F89, 2)?.unwrap_or(boot.timeout_pre_op_1_us),
            wait_pre_op_1_us: values.long(0x1F89, 3)?.unwrap_or(boot.wait_pre_op_1_us),
            timeout_pre_op_2_us: values.long(0x1F89, 4)?.unwrap_or(boot.timeout_pre_op_2_us),
            timeout_ready_to_operate_us: values.long(0x1F89, 5)?.unwrap_or(boot.timeout_ready_to_operate_us),
            ..boot
        },
        soc_preq_wait_ns: values.long(0x1F8A, 1)?.unwrap_or(default.soc_preq_wait_ns),
        async_slot_timeout_ns: values.long(0x1F8A, 2)?.unwrap_or(default.async_slot_timeout_ns),
        multiplex_cycles: values
            .number(0x1F98, 7, 1)?
            .map_or(default.multiplex_cycles, |cycles| cycles as u8),
        async_mtu: values.number(0x1F98, 8, 2)?.map_or(default.async_mtu, |mtu| mtu as u16),
        prescaler: values
            .number(0x1F98, 9, 2)?
            .map_or(default.prescaler, |prescaler| prescaler as u16),
        pres_mn_bytes: own_limit.filter(|_| own & 1 << 12 != 0),
        ..default
    })
}

fn read_node<'a>(values: &mut Values<'a>, id: u8, assignment: Assignment) -> Result<NodeConfig<'a>, CdcFileError> {
    let default = NodeConfig::default();
    let configuration = values.octets(0x1F22, id).unwrap_or(&[]);
    let limit = |limit: Option<u64>| {
        if assignment.async_only {
            0
        } else {
            limit.unwrap_or(0) as u16
        }
    };
    // Limits of payloads, until a mapping says it exactly.
    let (preq, pres) = (values.number(0x1F8B, id, 2)?, values.number(0x1F8D, id, 2)?);
    let mut node = NodeConfig {
        id,
        assignment,
        multiplex_cycle: values.number(0x1F9B, id, 1)?.unwrap_or(0) as u8,
        pres_timeout_ns: values.long(0x1F92, id)?.unwrap_or(default.pres_timeout_ns),
        identity: powerlink::mn::Identity {
            device_type: values.long(0x1F84, id)?,
            vendor_id: values.long(0x1F85, id)?,
            product_code: values.long(0x1F86, id)?,
            revision: values.long(0x1F87, id)?,
            serial: values.long(0x1F88, id)?,
        },
        software: values.stamp(0x1F53, 0x1F54, id)?,
        configuration_stamp: values.stamp(0x1F26, 0x1F27, id)?,
        pres_threshold: values.long(0x1C09, id)?.unwrap_or(default.pres_threshold),
        status_threshold: values.long(0x1C17, id)?.unwrap_or(default.status_threshold),
        preq_bytes: limit(preq),
        pres_bytes: limit(pres),
        configuration,
        ..default
    };
    if assignment.chained && !configuration.is_empty() {
        // Where its outputs stand in the managing node's PRes only the node itself is told.
        let own = CdcReader::new(configuration).and_then(|reader| reader.collect::<Result<Vec<_>, _>>());
        let own = own.map_err(CdcFileError::Octets)?;
        let own = own
            .iter()
            .map(|write| ((write.index, write.sub), write.value))
            .collect();
        let mut own = Values {
            values: own,
            used: Vec::new(),
        };
        if let Some((MN, version, first, end)) = own.mapped(0x1400)? {
            (node.pres_mn_offset, node.preq_bytes, node.preq_version) = (first, end - first, version);
        }
    }
    Ok(node)
}

/// One line for each write, with those of the nodes below theirs: to be compared with the listing of another file.
///
/// # Errors
/// The octets are no concise DCF.
pub fn listing(octets: &[u8]) -> Result<String, CdcError> {
    let mut text = String::new();
    list(octets, "", &mut text)?;
    Ok(text)
}

fn list(octets: &[u8], indent: &str, text: &mut String) -> Result<(), CdcError> {
    for write in CdcReader::new(octets)? {
        let CdcWrite { index, sub, value } = write?;
        // Writing to a text cannot fail.
        let _ = match value.len() {
            length @ (1 | 2 | 4 | 8) => {
                let mut wide = [0; 8];
                wide[..length].copy_from_slice(value);
                let number = u64::from_le_bytes(wide);
                writeln!(
                    text,
                    "{indent}0x{index:04X}:{sub:<3} {length} octets  0x{number:0digits$X}",
                    digits = 2 * length
                )
            }
            length if indent.is_empty() && index == 0x1F22 && length >= 4 => {
                let _ = writeln!(
                    text,
                    "0x{index:04X}:{sub:<3} {length} octets, the configuration of node {sub}:"
                );
                list(value, "    ", text)?;
                continue;
            }
            length => {
                let octets = value.iter().map(|octet| format!(" {octet:02x}")).collect::<String>();
                writeln!(text, "{indent}0x{index:04X}:{sub:<3} {length} octets {octets}")
            }
        };
    }
    Ok(())
}

#[cfg(test)]
mod tests;
