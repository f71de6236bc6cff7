//! What a network needs of a device description: may an object be mapped, and what has to be written into the device.
//!
//! In:  a [`DeviceDescription`]. Out: refusals of mappings with their reason, the configuration writes of an XDC or DCF.

use super::{DeviceDescription, Object};
use crate::PdoAccess;
use crate::mapping::Direction;
use std::fmt;
use std::string::{String, ToString};
use std::vec::Vec;

/// Why the device does not take a mapping of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MappingRefusal {
    /// The device has no such object.
    NoObject {
        /// Sub-indices of this index that it has.
        subs: Vec<u8>,
    },
    /// The object has another length.
    Length {
        /// Its length in bits; `None`: variable, or of a type that cannot be mapped.
        bits: Option<u16>,
        /// Name of the object.
        name: String,
    },
    /// The object cannot be mapped in this direction.
    Direction {
        /// Where it can be mapped.
        pdo: PdoAccess,
        /// Name of the object.
        name: String,
    },
}

impl fmt::Display for MappingRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MappingRefusal::NoObject { subs } if subs.is_empty() => f.write_str("the device has no such object"),
            MappingRefusal::NoObject { subs } => {
                let list: Vec<_> = subs.iter().take(8).map(|sub| sub.to_string()).collect();
                let more = if subs.len() > 8 { ", ..." } else { "" };
                write!(f, "the device has no such sub-index; it has {}{more}", list.join(", "))
            }
            MappingRefusal::Length { bits: Some(bits), name } => write!(f, "{name} has {bits} bits"),
            MappingRefusal::Length { bits: None, name } => write!(f, "{name} has no fixed length and cannot be mapped"),
            MappingRefusal::Direction { pdo, name } => match pdo {
                PdoAccess::No => write!(f, "{name} cannot be mapped"),
                PdoAccess::Rpdo | PdoAccess::Both => {
                    write!(f, "{name} can only be mapped into what the device receives")
                }
                PdoAccess::Tpdo => write!(f, "{name} can only be mapped into what the device sends"),
            },
        }
    }
}

/// One value to be written into a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigurationWrite {
    /// Index of the object.
    pub index: u16,
    /// Sub-index of the object.
    pub sub: u8,
    /// Octets as on the wire.
    pub value: Vec<u8>,
}

/// What a configured file (XDC, DCF) wants to have written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StoredParameters {
    /// Values that differ from the defaults, in the order in which they are to be written.
    pub writes: Vec<ConfigurationWrite>,
    /// Objects whose values the managing node sets by itself; what the file says of them is not written.
    pub left_to_managing_node: Vec<(u16, u8)>,
    /// Objects whose value the file wants, but that no SDO may write or whose octets the file does not tell.
    pub not_writable: Vec<(u16, u8)>,
}

/// Whether the managing node gives an object its value from what it knows of the network: cycle, payload limits, node tables,
/// identity and state of the node, and the process data of the first RPDO and the TPDO.
pub fn set_by_managing_node(index: u16, sub: u8) -> bool {
    match index {
        // Identity, error history, cycle, store and restore commands, date of the configuration.
        0x1000 | 0x1001 | 0x1003 | 0x1006 | 0x1008..=0x100A | 0x1010 | 0x1011 | 0x1018 | 0x1020 => true,
        0x1030..=0x103F | 0x1050 => true,
        0x1400 | 0x1600 | 0x1800 | 0x1A00 => true,
        // Loss of SoC and of PReq: from the machine's own limits.
        0x1C14 => true,
        0x1C0D => sub == 3,
        0x1F22 | 0x1F26 | 0x1F27 | 0x1F50..=0x1F5F | 0x1F80..=0x1F93 | 0x1F98 | 0x1F9B | 0x1F9E | 0x1F9F => true,
        _ => false,
    }
}

impl DeviceDescription {
    /// Whether `bits` of an object may be mapped; `direction` as the device sees it.
    ///
    /// # Errors
    /// Why not.
    pub fn may_map(&self, index: u16, sub: u8, bits: u16, direction: Direction) -> Result<&Object, MappingRefusal> {
        let Some(object) = self.object(index, sub) else {
            let subs = self.subs(index).iter().map(|object| object.sub).collect();
            return Err(MappingRefusal::NoObject { subs });
        };
        let name = || object.name.clone();
        let mappable = match (direction, object.pdo) {
            (_, PdoAccess::Both) | (Direction::Receive, PdoAccess::Rpdo) | (Direction::Transmit, PdoAccess::Tpdo) => {
                true
            }
            (_, PdoAccess::No) | (Direction::Receive, PdoAccess::Tpdo) | (Direction::Transmit, PdoAccess::Rpdo) => {
                false
            }
        };
        if !mappable {
            return Err(MappingRefusal::Direction {
                pdo: object.pdo,
                name: name(),
            });
        }
        if object.bits() != Some(bits) {
            return Err(MappingRefusal::Length {
                bits: object.bits(),
                name: name(),
            });
        }
        Ok(object)
    }

    /// What has to be written into the device, as node `node`, to make it the one that its file describes.
    ///
    /// Order: a mapping is switched off (count 0) before its PDO and its entries change, and on again at its end; everything
    /// else follows by index and sub-index.
    pub fn stored_parameters(&self, node: u8) -> StoredParameters {
        let mut stored = StoredParameters::default();
        let mut plain = Vec::new();
        let mut mappings: Vec<(u16, Vec<ConfigurationWrite>)> = Vec::new();
        for object in &self.objects {
            let (index, sub) = (object.index, object.sub);
            let Some(actual) = &object.actual else { continue };
            let octets = actual.octets(node);
            // A mapping is written as a whole or not at all, so its parts are not compared one by one.
            let mapping = matches!(index, 0x1600..=0x16FF | 0x1A00..=0x1AFF);
            let default = object.default.as_ref().and_then(|default| default.octets(node));
            if octets.is_some() && octets == default && !mapping {
                continue;
            }
            if set_by_managing_node(index, sub) {
                stored.left_to_managing_node.push((index, sub));
                continue;
            }
            let writable = object.access.is_some_and(crate::Access::writable);
            let Some(value) = octets.filter(|_| writable) else {
                stored.not_writable.push((index, sub));
                continue;
            };
            let write = ConfigurationWrite { index, sub, value };
            match mappings.last_mut() {
                Some((of, writes)) if mapping && *of == index => writes.push(write),
                _ if mapping => mappings.push((index, Vec::from([write]))),
                _ => plain.push(write),
            }
        }
        mappings.retain(|(index, writes)| !self.is_default_mapping(*index, writes, node));
        for (index, _) in &mappings {
            stored.writes.push(ConfigurationWrite {
                index: *index,
                sub: 0,
                value: Vec::from([0]),
            });
        }
        stored.writes.append(&mut plain);
        for (_, mut writes) in mappings {
            // The count stands first in the file and goes last into the device; entries behind it mean nothing.
            let count = writes
                .iter()
                .position(|write| write.sub == 0)
                .map(|at| writes.remove(at));
            let used = count
                .as_ref()
                .and_then(|count| count.value.first().copied())
                .unwrap_or(0);
            writes.retain(|write| write.sub <= used);
            stored.writes.append(&mut writes);
            stored.writes.extend(count.filter(|_| used > 0));
        }
        stored
    }

    fn is_default_mapping(&self, index: u16, writes: &[ConfigurationWrite], node: u8) -> bool {
        writes.iter().all(|write| {
            let default = self.object(index, write.sub).and_then(|object| object.default.as_ref());
            default.and_then(|default| default.octets(node)).as_ref() == Some(&write.value)
        })
    }
}
