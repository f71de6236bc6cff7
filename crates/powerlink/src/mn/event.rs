//! What the managing node reports: events in a ring of fixed size, counters, statistics per node.
//!
//! In:  from the managing node as it runs. Out: to the application, which takes events when it has time; those that find
//! the ring full are counted and dropped, so that nothing in the cycle ever waits for a reader.

use core::fmt;

use obd::AbortCode;

use super::config::Stamp;
use super::threshold::Threshold;
use crate::nmt::{NmtCommand, NmtState};
use crate::wire::{self, ErrorEntry, Mac, WireError};

/// What stands in the place of the EtherType in a frame with a VLAN tag: IEEE 802.1Q, 802.1ad.
const VLAN_ETHER_TYPES: [u16; 2] = [0x8100, 0x88A8];

/// Events the ring holds.
pub const EVENTS_MAX: usize = 64;

/// Which value of the identity a node reported wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IdentityField {
    /// Object 0x1000.
    DeviceType,
    /// Object 0x1018/1.
    VendorId,
    /// Object 0x1018/2.
    ProductCode,
    /// Object 0x1018/3.
    Revision,
    /// Object 0x1018/4.
    Serial,
}

/// Something the application may want to know. `node` is always a node id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MnEvent {
    /// The managing node itself is in a new state.
    NmtStateChanged {
        /// The new state.
        state: NmtState,
    },
    /// The node answered the IdentRequest, and is what it shall be.
    Identified {
        /// Node id, 1..=239.
        node: u8,
    },
    /// The node is not what it shall be; it is not configured.
    IdentityMismatch {
        /// Node id, 1..=239.
        node: u8,
        /// The first value that differs.
        field: IdentityField,
        /// The value that the configuration has.
        expected: u32,
        /// The value that the node reported.
        got: u32,
    },
    /// The software of the node is not the expected one; it is not configured.
    SoftwareMismatch {
        /// Node id, 1..=239.
        node: u8,
        /// The value that the configuration has.
        expected: Stamp,
        /// The value that the node reported.
        got: Stamp,
    },
    /// A mandatory node was not identified within MNTimeoutPreOp1.
    Missing {
        /// Node id, 1..=239.
        node: u8,
    },
    /// A node that is not configured is on the network: looked for where a mandatory one is missing.
    Stranger {
        /// Node id, 1..=239.
        node: u8,
        /// Object 1000h.
        device_type: u32,
        /// Object 1018h/1.
        vendor_id: u32,
        /// Object 1018h/2.
        product_code: u32,
        /// Object 1018h/3.
        revision: u32,
        /// Object 1018h/4.
        serial: u32,
    },
    /// The configuration is being written into the node.
    Configuring {
        /// Node id, 1..=239.
        node: u8,
    },
    /// The node refused a value of its configuration.
    SdoAbort {
        /// Node id, 1..=239.
        node: u8,
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
        /// Abort code of the SDO.
        code: AbortCode,
    },
    /// A value of the configuration could not be written: no answer, or a wrong one.
    SdoFailed {
        /// Node id, 1..=239.
        node: u8,
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
    },
    /// An object has another value than [`super::NodeConfig::expected`] says.
    ValueMismatch {
        /// Node id, 1..=239.
        node: u8,
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
        /// The value that the configuration has.
        expected: u32,
        /// The value that was read, of the bits that count.
        got: u32,
    },
    /// The state of a node as the application sees it has changed.
    NodeStateChanged {
        /// Node id, 1..=239.
        node: u8,
        /// The new state.
        state: NodeState,
    },
    /// A step of the boot-up took the node too long; it is reset and booted again.
    BootTimeout {
        /// Node id, 1..=239.
        node: u8,
        /// The NMT state it should have reached.
        expected: NmtState,
        /// The one it reported last.
        got: NmtState,
    },
    /// More polls in a row than allowed, or the StatusRequests, stayed unanswered; the node is reset and booted again.
    Lost {
        /// Node id, 1..=239.
        node: u8,
        /// Polls or requests in a row without an answer.
        in_row: u32,
    },
    /// The node has been in a wrong NMT state for longer than the tolerance; it is reset and booted again.
    WrongState {
        /// Node id, 1..=239.
        node: u8,
        /// The state it should be in.
        expected: NmtState,
        /// The state it reports.
        got: NmtState,
    },
    /// Process data of the node have another mapping version than configured (E_PDO_MAP_VERS) and are not used; reported once.
    MappingVersion {
        /// Node id, 1..=239.
        node: u8,
        /// The value that the configuration has.
        expected: u8,
        /// The value that was received.
        got: u8,
    },
    /// The node signalled an error (EN) and this is one of its entries.
    ErrorEntry {
        /// Node id, 1..=239.
        node: u8,
        /// As the node sent it.
        entry: ErrorEntry,
    },
    /// The threshold of cycles that were not over in time (0x1C02/3) was reached; the network starts again.
    CycleThreshold,
    /// The threshold of frames with a wrong check sum (0x1C00/3) was reached; the network starts again.
    CrcThreshold,
    /// The network could enter this state; it waits for the application to let it (0x1F80 bits 2, 7 and 8, and bit 6 after an
    /// error).
    WaitsForApplication {
        /// The next state.
        next: NmtState,
    },
    /// A mandatory node dropped out of the OPERATIONAL network, and all nodes get this command (0x1F80 bits 4 and 6).
    AllOnError {
        /// ResetNode or StopNode.
        command: NmtCommand,
    },
    /// Another managing node is on the wire.
    ForeignMn(ForeignSign),
}

/// The frame that shows that there is another managing node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForeignSign {
    /// Node id of its sender: of the other managing node (240; 241 to 250, redundant), or of a node that answers one.
    pub id: u8,
    /// MAC of its sender.
    pub mac: Mac,
}

/// Answers of nodes that we asked nothing. No node sends anything unless a managing node asks for it, and what another control of
/// this PC sends on the same interface is not heard, only the answers to it. One answer may have waited in a switch, or be one to
/// what we asked before we were started again; a node that goes on answering is asked by somebody.
#[derive(Clone, Copy, Debug)]
pub struct UnaskedAnswers([u8; 256]);

impl UnaskedAnswers {
    /// Answers of one node that show that another managing node is at work.
    const SIGN: u8 = 3;

    /// None was heard yet.
    pub const fn new() -> Self {
        UnaskedAnswers([0; 256])
    }

    /// Takes an answer of `node`; whether it shows that another managing node is at work.
    pub fn is_sign(&mut self, node: u8) -> bool {
        let heard = &mut self.0[usize::from(node)];
        *heard = heard.saturating_add(1);
        *heard >= Self::SIGN
    }
}

impl Default for UnaskedAnswers {
    fn default() -> Self {
        Self::new()
    }
}

impl ForeignSign {
    /// The managing node itself was heard, and not only a node that answers it.
    pub fn is_its_own(&self) -> bool {
        (wire::node::MN..=wire::node::MN_MAX).contains(&self.id)
    }
}

impl fmt::Display for ForeignSign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ForeignSign {
            id,
            mac: [a, b, c, d, e, g],
        } = self;
        let mac = format_args!("{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}");
        if self.is_its_own() {
            write!(f, "another managing node is on the wire: {mac}, node id {id}")
        } else {
            write!(
                f,
                "another managing node is on the wire, perhaps on this PC: node {id} ({mac}) answers one"
            )
        }
    }
}

impl fmt::Display for MnEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            MnEvent::NmtStateChanged { state } => write!(f, "managing node: {state:?}"),
            MnEvent::Identified { node } => write!(f, "node {node}: identified"),
            MnEvent::IdentityMismatch {
                node,
                field,
                expected,
                got,
            } => {
                write!(f, "node {node}: {field:?} is {got:#010x}, expected {expected:#010x}")
            }
            MnEvent::SoftwareMismatch { node, expected, got } => write!(
                f,
                "node {node}: software of date {} time {}, expected date {} time {}",
                got.date, got.time, expected.date, expected.time
            ),
            MnEvent::Missing { node } => write!(f, "node {node}: mandatory, and does not answer the IdentRequest"),
            MnEvent::Stranger { node, device_type, .. } => {
                write!(f, "node {node}: not configured, device type {device_type:#010x}")
            }
            MnEvent::Configuring { node } => write!(f, "node {node}: writing the configuration"),
            MnEvent::SdoAbort { node, index, sub, code } => {
                write!(f, "node {node}: refused to take {index:04X}h/{sub:02X}h: {code}")
            }
            MnEvent::SdoFailed { node, index, sub } => {
                write!(
                    f,
                    "node {node}: no valid answer to the write of {index:04X}h/{sub:02X}h"
                )
            }
            MnEvent::ValueMismatch {
                node,
                index,
                sub,
                expected,
                got,
            } => write!(
                f,
                "node {node}: {index:04X}h/{sub:02X}h is {got:#010x}, expected {expected:#010x}"
            ),
            MnEvent::NodeStateChanged { node, state } => write!(f, "node {node}: {state:?}"),
            MnEvent::BootTimeout { node, expected, got } => {
                write!(
                    f,
                    "node {node}: still {got:?}, expected {expected:?} by now; booting it again"
                )
            }
            MnEvent::Lost { node, in_row } => {
                write!(
                    f,
                    "node {node}: lost, {in_row} polls in a row without an answer; booting it again"
                )
            }
            MnEvent::WrongState { node, expected, got } => {
                write!(f, "node {node}: is in {got:?}, expected {expected:?}; booting it again")
            }
            MnEvent::MappingVersion { node, expected, got } => write!(
                f,
                "node {node}: process data of mapping version {got:#04x}, expected {expected:#04x}; not used"
            ),
            MnEvent::ErrorEntry { node, entry } => {
                write!(f, "node {node}: error {entry}")
            }
            MnEvent::CycleThreshold => {
                f.write_str("the threshold of exceeded cycles (1C02h/03h) is reached; starting the network again")
            }
            MnEvent::CrcThreshold => {
                f.write_str("the threshold of check sum errors (1C00h/03h) is reached; starting the network again")
            }
            MnEvent::WaitsForApplication { next } => {
                write!(f, "managing node: {next:?} would be next; waits for the application")
            }
            MnEvent::AllOnError { command } => write!(f, "a mandatory node dropped out: {command:?} to all"),
            MnEvent::ForeignMn(sign) => sign.fmt(f),
        }
    }
}

/// Ring of events.
#[derive(Clone, Debug)]
pub(super) struct Events {
    ring: [Option<MnEvent>; EVENTS_MAX],
    first: usize,
    len: usize,
    /// Events that found the ring full.
    pub(super) dropped: u64,
}

impl Events {
    pub(super) fn new() -> Events {
        Events {
            ring: [None; EVENTS_MAX],
            first: 0,
            len: 0,
            dropped: 0,
        }
    }

    pub(super) fn push(&mut self, event: MnEvent) {
        if self.len == EVENTS_MAX {
            self.dropped += 1;
            return;
        }
        self.ring[(self.first + self.len) % EVENTS_MAX] = Some(event);
        self.len += 1;
    }

    pub(super) fn pop(&mut self) -> Option<MnEvent> {
        let event = self.ring[self.first].take()?;
        self.first = (self.first + 1) % EVENTS_MAX;
        self.len -= 1;
        Some(event)
    }
}

/// Frames that were not looked at any further, by reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Malformed {
    /// Shorter than their fields.
    pub too_short: u64,
    /// Longer than Ethernet allows.
    pub too_long: u64,
    /// EtherType other than 0x88AB.
    pub ether_type: u64,
    /// With a VLAN tag.
    pub vlan: u64,
    /// Message type the standard does not define.
    pub message_type: u64,
    /// The size field of a PReq or PRes promises more than there is.
    pub payload_size: u64,
    /// Of a type that no node of that id sends.
    pub source: u64,
    /// Of a type that does not go to a node of that id.
    pub destination: u64,
}

impl Malformed {
    pub(super) fn count(&mut self, error: WireError) {
        let counter = match error {
            WireError::TooShort { .. } => &mut self.too_short,
            // Reading never fails for lack of room.
            WireError::TooLong { .. } | WireError::NoRoom { .. } => &mut self.too_long,
            WireError::EtherType { got } if VLAN_ETHER_TYPES.contains(&got) => &mut self.vlan,
            WireError::EtherType { .. } => &mut self.ether_type,
            WireError::MessageType { .. } => &mut self.message_type,
            WireError::PayloadSize { .. } => &mut self.payload_size,
            WireError::Source { .. } => &mut self.source,
            WireError::Destination { .. } => &mut self.destination,
        };
        *counter += 1;
    }

    /// All reasons together.
    pub fn total(&self) -> u64 {
        let unreadable = self.too_short + self.too_long + self.message_type + self.payload_size;
        let not_ours = self.ether_type + self.vlan;
        unreadable + not_ours + self.source + self.destination
    }
}

/// What happened on the wire, not belonging to one node. Nothing is ever reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Counters {
    /// Frames that were not looked at any further.
    pub malformed: Malformed,
    /// Frames of known nodes that were not asked for.
    pub unexpected: u64,
    /// Frames of nodes that are not configured, or for another node.
    pub unknown_node: u64,
    /// Frames of another managing node, or in NOT_ACTIVE of nodes that go on answering one.
    pub foreign_mn_frames: u64,
    /// Our own frames, seen again.
    pub own_frames: u64,
    /// Cycles begun: SoCs that were sent.
    pub cycles: u64,
    /// Cycles that were left out because the next one was started too late.
    pub cycles_skipped: u64,
    /// Cycles that were cut off by the next one before their SoA was sent.
    pub cycles_overrun: u64,
    /// The same as threshold counter (0x1C02).
    pub cycle_exceeded: Threshold,
    /// Frames with a wrong check sum, where the driver tells (0x1C00).
    pub crc_errors: Threshold,
    /// SoAs that were sent, of the reduced cycle too.
    pub soa_sent: u64,
    /// ASnds of our own sent.
    pub asnd_sent: u64,
    /// Asynchronous slots whose answer did not come in time.
    pub async_timeouts: u64,
    /// Events dropped because they were not taken in time.
    pub events_dropped: u64,
}

/// Figures of one node. Nothing is ever reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct NodeStatistics {
    /// PReqs sent; of a chained node: PRes of the managing node to which it had to answer.
    pub preq_sent: u64,
    /// PRes that answered in time.
    pub pres_received: u64,
    /// PReqs without a PRes in time.
    pub pres_lost: u64,
    /// PRes that came after their time-out, and were discarded.
    pub pres_late: u64,
    /// PRes with RD and less process data than configured, whose data were discarded.
    pub pres_short: u64,
    /// PRes with RD and another mapping version than configured, whose data were discarded.
    pub pres_version: u64,
    /// Lost PRes as threshold counter (0x1C07, 0x1C08).
    pub loss_of_pres: Threshold,
    /// Longest row of lost PRes.
    pub lost_in_row_max: u32,
    /// Longest time from a sent PReq to its PRes, as seen by the managing node, in ns.
    pub response_ns_max: u32,
    /// Asynchronous slots granted to the node.
    pub slots_granted: u64,
    /// Granted slots in which nothing came.
    pub slots_unused: u64,
    /// StatusRequests without an answer, as threshold counter (0x1C15, 0x1C16; the threshold is 0x1C17).
    pub loss_of_status: Threshold,
    /// How many times its boot-up began.
    pub boots: u64,
    /// Objects written by SDO.
    pub objects_written: u64,
    /// Times the node was given up and booted again.
    pub faults: u64,
}

/// State of a controlled node as the application sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeState {
    /// Not heard of yet.
    Absent,
    /// Identified; being booted.
    Configuring,
    /// READY_TO_OPERATE, communication checked; waits for the network.
    Ready,
    /// OPERATIONAL: process data are valid.
    Operational,
    /// Lost, refused or failed; it is being looked for and booted again.
    Faulted,
    /// STOPPED by order: no process data, until it is ordered otherwise.
    Stopped,
}
