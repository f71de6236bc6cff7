//! What the managing node is told before it starts, and the checks it makes.
//!
//! In:  node list and times, written by the caller. Out: nothing, or the first thing that is wrong with them.

use core::fmt;

use obd::cdc::{CdcError, CdcReader};

use super::budget::{Budget, WorstCycle};
use super::objects::DeviceInfo;
use super::startup::{self, Assignment, StartUp};
use crate::wire::{self, Mac, PAYLOAD_MAX};

/// Values an IdentResponse must carry; `None` is not checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Identity {
    /// Object 0x1000, expected value 0x1F84.
    pub device_type: Option<u32>,
    /// Object 0x1018/1, expected value 0x1F85.
    pub vendor_id: Option<u32>,
    /// Object 0x1018/2, expected value 0x1F86.
    pub product_code: Option<u32>,
    /// Object 0x1018/3, expected value 0x1F87.
    pub revision: Option<u32>,
    /// Object 0x1018/4, expected value 0x1F88.
    pub serial: Option<u32>,
}

/// Date and time as a node keeps them beside its software (0x1F52) or its configuration (0x1020).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Days since 1984-01-01.
    pub date: u32,
    /// Milliseconds since midnight.
    pub time: u32,
}

/// One controlled node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeConfig<'a> {
    /// Node id, 1..=239.
    pub id: u8,
    /// What the node is to the network (object 0x1F81).
    pub assignment: Assignment,
    /// Cycle of the round in which a multiplexed node is polled, from 1 (object 0x1F9B); 0 for all others.
    pub multiplex_cycle: u8,
    /// From the end of the PReq to the PRes (object 0x1F92).
    pub pres_timeout_ns: u32,
    /// What the node must say it is.
    pub identity: Identity,
    /// Its software (objects 0x1F53, 0x1F54); `None` is not checked.
    pub software: Option<Stamp>,
    /// A node that reports this configuration (objects 0x1F26, 0x1F27) is not configured again. `None`: the values of 0x1020 in
    /// the concise DCF, where it has them.
    pub configuration_stamp: Option<Stamp>,
    /// Mapping version of the PReq (its PDOVersion).
    pub preq_version: u8,
    /// Mapping version that the PRes must have in its high nibble; 0 is not checked.
    pub pres_version: u8,
    /// Threshold of lost PRes (object 0x1C09): each adds 8, each good one takes 1 away; 0 switches it off. Beside it stands
    /// [`MnConfig::pres_lost_max`].
    pub pres_threshold: u32,
    /// Threshold of unanswered StatusRequests (object 0x1C17), counted in the same way.
    pub status_threshold: u32,
    /// Process data for the node, in octets, at most 1490: in its PReq; for a chained node in the PRes of the managing node.
    pub preq_bytes: u16,
    /// Where the process data for a chained node begin in the PRes of the managing node, octets; 0 for all others.
    pub pres_mn_offset: u16,
    /// Process data expected in the PRes, in octets, at most 1490.
    pub pres_bytes: u16,
    /// Concise DCF to write into the node (object 0x1F22); empty: nothing to write.
    pub configuration: &'a [u8],
}

impl Default for NodeConfig<'_> {
    /// A mandatory node without process data, identity or configuration; the id is still to be given.
    fn default() -> Self {
        NodeConfig {
            id: 0,
            assignment: Assignment::default(),
            multiplex_cycle: 0,
            pres_timeout_ns: 25_000,
            identity: Identity::default(),
            software: None,
            configuration_stamp: None,
            preq_version: 0,
            pres_version: 0,
            pres_threshold: 0,
            status_threshold: 8 * 15,
            preq_bytes: 0,
            pres_mn_offset: 0,
            pres_bytes: 0,
            configuration: &[],
        }
    }
}

/// Times of the boot-up (object 0x1F89, and one of our own).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BootTimes {
    /// MNWaitNotAct, 0x1F89/1: how long to listen for another managing node before sending, in µs.
    pub wait_not_active_us: u32,
    /// MNTimeoutPreOp1, 0x1F89/2: a mandatory node not identified by then is reported, in µs.
    pub timeout_pre_op_1_us: u32,
    /// MNWaitPreOp1, 0x1F89/3: shortest stay in PRE_OPERATIONAL_1, in µs.
    pub wait_pre_op_1_us: u32,
    /// MNTimeoutPreOp2, 0x1F89/4: from a node's configuration to its READY_TO_OPERATE, in µs.
    pub timeout_pre_op_2_us: u32,
    /// MNTimeoutReadyToOp, 0x1F89/5: from StartNode to OPERATIONAL, and for the communication check, in µs.
    pub timeout_ready_to_operate_us: u32,
    /// Pause after the ResetNode broadcast, in which the nodes restart, in µs.
    pub reset_pause_us: u32,
}

impl Default for BootTimes {
    fn default() -> Self {
        BootTimes {
            wait_not_active_us: 1_000_000,
            timeout_pre_op_1_us: 500_000,
            wait_pre_op_1_us: 500_000,
            timeout_pre_op_2_us: 5_000_000,
            timeout_ready_to_operate_us: 500_000,
            reset_pause_us: 250_000,
        }
    }
}

/// The network as the managing node shall run it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MnConfig<'a> {
    /// Cycle length (object 0x1006), whole microseconds, in ns.
    pub cycle_ns: u32,
    /// From the SoC to the first PReq (object 0x1F8A/1).
    pub soc_preq_wait_ns: u32,
    /// Longest wait for the answer in the asynchronous slot, from the SoA on (object 0x1F8A/2).
    pub async_slot_timeout_ns: u32,
    /// Longest ASnd, octets after the Ethernet header (object 0x1F98/8), 300..=1500.
    pub async_mtu: u16,
    /// Cycles of a multiplexed round (object 0x1F98/7); 0: no node is multiplexed.
    pub multiplex_cycles: u8,
    /// The PS flag of the SoC toggles every so many cycles (object 0x1F98/9), at most 1000; 0: never.
    pub prescaler: u16,
    /// Process data that the managing node sends to all in a PRes of its own, in octets (object 0x1F81/240 bit 12); `None`: it
    /// sends none. Chained nodes need it.
    pub pres_mn_bytes: Option<u16>,
    /// Mapping version of that PRes.
    pub pres_mn_version: u8,
    /// How the network starts (object 0x1F80).
    pub startup: StartUp,
    /// Times of the boot-up.
    pub boot: BootTimes,
    /// Threshold of frames with a wrong check sum (object 0x1C00/3); 0 switches it off.
    pub crc_threshold: u32,
    /// Threshold of cycles that were not over in time (object 0x1C02/3); 0 switches it off: late cycles are counted, and the
    /// network goes on.
    pub cycle_threshold: u32,
    /// PRes lost in a row that are ridden out with the last value; one more, and the node is lost.
    pub pres_lost_max: u32,
    /// The controlled nodes in polling order.
    pub nodes: &'a [NodeConfig<'a>],
    /// MAC of the interface.
    pub mac: Mac,
    /// What the managing node says of itself in its dictionary.
    pub device: DeviceInfo<'a>,
    /// A diagnostic device (node 253) is looked for now and then, and may use the asynchronous slot.
    pub diagnostic_device: bool,
}

impl Default for MnConfig<'_> {
    /// A cycle of 1 ms without nodes; the MAC is still to be given.
    fn default() -> Self {
        MnConfig {
            cycle_ns: 1_000_000,
            soc_preq_wait_ns: 0,
            async_slot_timeout_ns: 100_000,
            async_mtu: 300,
            multiplex_cycles: 0,
            prescaler: 2,
            pres_mn_bytes: None,
            pres_mn_version: 0,
            startup: StartUp::default(),
            boot: BootTimes::default(),
            crc_threshold: 0,
            cycle_threshold: 0,
            pres_lost_max: 3,
            nodes: &[],
            mac: [0; 6],
            device: DeviceInfo::default(),
            diagnostic_device: false,
        }
    }
}

/// Which of the two directions of process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// PReq: managing node to controlled node.
    Preq,
    /// PRes: controlled node to all.
    Pres,
}

/// What is wrong with a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MnConfigError {
    /// The cycle is zero or no whole number of microseconds.
    CycleLength {
        /// As configured.
        cycle_ns: u32,
    },
    /// A MAC of zeros or a multicast MAC.
    Mac {
        /// As configured.
        got: Mac,
    },
    /// More nodes than this managing node has room for.
    TooManyNodes {
        /// As configured.
        got: usize,
        /// Room.
        most: usize,
    },
    /// Controlled nodes have the ids 1..=239.
    NodeId {
        /// As configured.
        got: u8,
    },
    /// Two nodes have this id.
    DuplicateNode {
        /// Their id.
        id: u8,
    },
    /// A PReq or PRes holds at most 1490 octets of process data.
    PayloadLength {
        /// Node id.
        id: u8,
        /// PReq or PRes.
        direction: Direction,
        /// As configured.
        got: u16,
    },
    /// A multiplexed node needs a cycle of the round (0x1F9B) that exists (0x1F98/7), all others must have none.
    MultiplexCycle {
        /// Node id.
        id: u8,
        /// As configured.
        got: u8,
        /// Cycles of the round.
        most: u8,
    },
    /// Two of the ways to exchange process data that exclude each other: polled each cycle, multiplexed, chained, or none.
    Exchange {
        /// Node id.
        id: u8,
    },
    /// A chained node answers to the PRes of the managing node, which sends none.
    ChainedWithoutPresMn {
        /// Node id.
        id: u8,
    },
    /// The process data of a chained node reach beyond the PRes of the managing node.
    BeyondPresMn {
        /// Node id.
        id: u8,
        /// Where they end.
        end: u32,
        /// Octets of the PRes.
        most: u16,
    },
    /// AsyncMTU (0x1F98/8) is 300..=1500.
    AsyncMtu {
        /// As configured.
        got: u16,
    },
    /// The prescaler (0x1F98/9) is at most 1000.
    Prescaler {
        /// As configured.
        got: u16,
    },
    /// A time-out of zero.
    NoTimeout {
        /// Node id; 240 for the asynchronous slot.
        id: u8,
    },
    /// All polls timing out and the asynchronous slot do not fit into the cycle.
    CycleTooShort {
        /// What the longest cycle can take.
        worst: WorstCycle,
        /// As configured.
        cycle_ns: u32,
    },
    /// Two things that cannot go together, or one without the other it needs.
    Conflict {
        /// Node id; 240 for the network.
        id: u8,
        /// What is wrong.
        reason: &'static str,
    },
    /// The concise DCF cannot be read.
    Configuration {
        /// Node id.
        id: u8,
        /// What is wrong, and where.
        error: CdcError,
    },
}

impl fmt::Display for MnConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            MnConfigError::CycleLength { cycle_ns } => {
                write!(
                    f,
                    "cycle of {cycle_ns} ns: expected a whole number of microseconds above 0"
                )
            }
            MnConfigError::Mac { got } => write!(f, "MAC {got:02x?}: expected the unicast address of the interface"),
            MnConfigError::TooManyNodes { got, most } => write!(f, "{got} nodes, there is room for {most}"),
            MnConfigError::NodeId { got } => write!(f, "node id {got}: controlled nodes have 1..=239"),
            MnConfigError::DuplicateNode { id } => write!(f, "two nodes have the id {id}"),
            MnConfigError::PayloadLength { id, direction, got } => {
                write!(
                    f,
                    "node {id}: {direction:?} of {got} octets, at most {PAYLOAD_MAX} fit into a frame"
                )
            }
            MnConfigError::MultiplexCycle { id, got, most } => write!(
                f,
                "node {id}: multiplexed cycle {got}: expected 1..={most} for a multiplexed node and 0 for another"
            ),
            MnConfigError::Exchange { id } => write!(
                f,
                "node {id}: multiplexed, chained and asynchronous only exclude each other"
            ),
            MnConfigError::ChainedWithoutPresMn { id } => write!(
                f,
                "node {id}: chained, and needs a PRes of the managing node, which sends none"
            ),
            MnConfigError::BeyondPresMn { id, end, most } => write!(
                f,
                "node {id}: process data end at octet {end} of the managing node's PRes, which has {most}"
            ),
            MnConfigError::AsyncMtu { got } => write!(f, "AsyncMTU of {got} octets: expected 300..=1500"),
            MnConfigError::Prescaler { got } => write!(f, "prescaler {got}: expected 0..=1000"),
            MnConfigError::NoTimeout { id } => write!(f, "node {id}: a time-out of 0 ns can never be met"),
            MnConfigError::CycleTooShort { worst, cycle_ns } => write!(
                f,
                "the time-outs do not fit the cycle of {} us: {worst}",
                cycle_ns / 1000
            ),
            MnConfigError::Conflict { id, reason } => write!(f, "node {id}: {reason}"),
            MnConfigError::Configuration { id, error } => write!(f, "node {id}: concise DCF: {error}"),
        }
    }
}

impl core::error::Error for MnConfigError {}

/// Everything a managing node relies on later.
pub(super) fn check(config: &MnConfig<'_>, most: usize) -> Result<(), MnConfigError> {
    let MnConfig {
        cycle_ns, mac, nodes, ..
    } = *config;
    if cycle_ns == 0 || !cycle_ns.is_multiple_of(1000) {
        return Err(MnConfigError::CycleLength { cycle_ns });
    }
    if mac == [0; 6] || mac[0] & 1 != 0 {
        return Err(MnConfigError::Mac { got: mac });
    }
    if nodes.len() > most {
        return Err(MnConfigError::TooManyNodes { got: nodes.len(), most });
    }
    if config.async_slot_timeout_ns == 0 {
        return Err(MnConfigError::NoTimeout { id: wire::node::MN });
    }
    if !(300..=1500).contains(&config.async_mtu) {
        return Err(MnConfigError::AsyncMtu { got: config.async_mtu });
    }
    if config.prescaler > 1000 {
        return Err(MnConfigError::Prescaler { got: config.prescaler });
    }
    if let Some(got) = config.pres_mn_bytes.filter(|octets| usize::from(*octets) > PAYLOAD_MAX) {
        let direction = Direction::Pres;
        let id = wire::node::MN;
        return Err(MnConfigError::PayloadLength { id, direction, got });
    }
    for (position, node) in nodes.iter().enumerate() {
        let id = node.id;
        if !(1..=wire::node::CN_MAX).contains(&id) {
            return Err(MnConfigError::NodeId { got: id });
        }
        if nodes[..position].iter().any(|other| other.id == id) {
            return Err(MnConfigError::DuplicateNode { id });
        }
        for (direction, got) in [(Direction::Preq, node.preq_bytes), (Direction::Pres, node.pres_bytes)] {
            if usize::from(got) > PAYLOAD_MAX {
                return Err(MnConfigError::PayloadLength { id, direction, got });
            }
        }
        if node.pres_timeout_ns == 0 {
            return Err(MnConfigError::NoTimeout { id });
        }
        check_exchange(config, node)?;
        check_configuration(node)?;
        startup::check_node(config, node).map_err(|reason| MnConfigError::Conflict { id, reason })?;
    }
    startup::check_network(&config.startup).map_err(|reason| MnConfigError::Conflict {
        id: wire::node::MN,
        reason,
    })?;
    let worst = Budget::new(config, &[]).worst();
    if worst.total_ns() > u64::from(cycle_ns) {
        return Err(MnConfigError::CycleTooShort { worst, cycle_ns });
    }
    Ok(())
}

/// How a node exchanges process data.
fn check_exchange(config: &MnConfig<'_>, node: &NodeConfig<'_>) -> Result<(), MnConfigError> {
    let id = node.id;
    let Assignment {
        multiplexed,
        chained,
        async_only,
        ..
    } = node.assignment;
    if u8::from(multiplexed) + u8::from(chained) + u8::from(async_only) > 1 {
        return Err(MnConfigError::Exchange { id });
    }
    let (got, most) = (node.multiplex_cycle, config.multiplex_cycles);
    if multiplexed != (got != 0) || got > most {
        return Err(MnConfigError::MultiplexCycle { id, got, most });
    }
    if chained {
        let most = config.pres_mn_bytes.ok_or(MnConfigError::ChainedWithoutPresMn { id })?;
        let end = u32::from(node.pres_mn_offset) + u32::from(node.preq_bytes);
        if end > u32::from(most) {
            return Err(MnConfigError::BeyondPresMn { id, end, most });
        }
    }
    Ok(())
}

fn check_configuration(node: &NodeConfig<'_>) -> Result<(), MnConfigError> {
    if node.configuration.is_empty() {
        return Ok(());
    }
    let id = node.id;
    let unreadable = |error| MnConfigError::Configuration { id, error };
    for write in CdcReader::new(node.configuration).map_err(unreadable)? {
        write.map_err(unreadable)?;
    }
    Ok(())
}
