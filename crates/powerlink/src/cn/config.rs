//! What makes a node this node, and why it could not be built.

use core::fmt;

use obd::AbortCode;

use crate::wire::Mac;

/// What makes a node this node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CnConfig<'a> {
    /// Node id, 1..=239.
    pub node_id: u8,
    /// MAC address that the node's frames carry.
    pub mac: Mac,
    /// 0x1000: profile number in the low word.
    pub device_type: u32,
    /// 0x1018/1.
    pub vendor_id: u32,
    /// 0x1018/2.
    pub product_code: u32,
    /// 0x1018/3.
    pub revision: u32,
    /// 0x1018/4.
    pub serial: u32,
    /// 0x1008, up to 32 octets.
    pub device_name: &'a str,
    /// 0x1F9A, up to 32 octets.
    pub host_name: &'a str,
    /// 0x1F98/3: the longest time from the end of a PReq to the start of the PRes in ns.
    pub pres_max_latency_ns: u32,
}

/// Why a node could not be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CnError {
    /// Node ids of controlled nodes are 1..=239.
    NodeId(u8),
    /// The dictionary lacks an object of [`COMMUNICATION_PROFILE`](super::objects::COMMUNICATION_PROFILE), or a value of the configuration does not fit.
    Object {
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
        /// What is wrong with it.
        code: AbortCode,
    },
}

impl fmt::Display for CnError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            CnError::NodeId(id) => write!(f, "node id {id}: controlled nodes have 1..=239"),
            CnError::Object { index, sub, code } => write!(f, "object {index:#06X}/{sub}: {code}"),
        }
    }
}

impl core::error::Error for CnError {}
