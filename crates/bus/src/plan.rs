//! What each node is told before it may take part, and where its values lie in its payloads.
//!
//! Made by the bus from the machine file ([`super::plan()`]).

use super::layout::Layout;
use config::{ConfigurationWrite, Stamp};
use obd::Expected;

/// One node of the network, ready for its master.
#[derive(Clone, Debug)]
pub struct NodePlan {
    /// What the control sends.
    pub outputs: Layout,
    /// What the node sends.
    pub inputs: Layout,
    /// Concise DCF: configuration writes, downloaded by SDO.
    pub configuration: Vec<u8>,
    /// What stands in the concise DCF.
    pub writes: Vec<ConfigurationWrite>,
    /// What is read behind that, and must be so.
    pub expected: Vec<Expected>,
    /// Date and time (0x1020) that tell this configuration from any other; `None`: the device does not keep them.
    pub stamp: Option<Stamp>,
    /// What was not written, and why.
    pub left_out: Vec<LeftOut>,
}

/// A value that is not written into a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeftOut {
    pub index: u16,
    pub sub: u8,
    pub reason: LeftOutReason,
}

/// Why a value is not written into a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOutReason {
    /// The control would set it, and the device does not have it or lets nobody write it.
    NotInDevice,
    /// The device file wants it, and it is the master's own.
    ManagingNodeSets,
    /// The device file wants it, and no SDO can write it.
    NotWritable,
}
