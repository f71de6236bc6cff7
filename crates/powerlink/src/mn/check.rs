//! The checks of a configuration before the managing node starts: everything that it relies on later.
//!
//! In:  the configuration. Out: nothing, or the first thing that is wrong with it.

use core::fmt;

use obd::cdc::{CdcError, CdcReader};

use super::budget::{Budget, WorstCycle};
use super::config::{Direction, MnConfig, NodeConfig, expected_stamp};
use super::startup::Assignment;
use crate::wire::{self, Mac, PAYLOAD_MAX};

/// What is wrong with a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MnConfigError {
    /// The cycle is zero or no whole number of microseconds.
    CycleLength {
        /// The value that the configuration has.
        cycle_ns: u32,
    },
    /// A MAC of zeros or a multicast MAC.
    Mac {
        /// The value that the configuration has.
        got: Mac,
    },
    /// More nodes than this managing node has room for.
    TooManyNodes {
        /// The value that the configuration has.
        got: usize,
        /// Nodes that there is room for.
        most: usize,
    },
    /// Controlled nodes have the ids 1..=239.
    NodeId {
        /// The value that the configuration has.
        got: u8,
    },
    /// Two nodes have this id.
    DuplicateNode {
        /// The id that they share.
        id: u8,
    },
    /// A PReq or PRes holds at most 1490 octets of process data.
    PayloadLength {
        /// Node id, 1..=239.
        id: u8,
        /// PReq or PRes.
        direction: Direction,
        /// The value that the configuration has.
        got: u16,
    },
    /// A multiplexed node needs a cycle of the round (0x1F9B) that exists (0x1F98/7), all others must have none.
    MultiplexCycle {
        /// Node id, 1..=239.
        id: u8,
        /// The value that the configuration has.
        got: u8,
        /// Cycles of the round.
        most: u8,
    },
    /// Two of the ways to exchange process data that exclude each other: polled each cycle, multiplexed, chained, or none.
    Exchange {
        /// Node id, 1..=239.
        id: u8,
    },
    /// A chained node answers to the PRes of the managing node, which sends none.
    ChainedWithoutPresMn {
        /// Node id, 1..=239.
        id: u8,
    },
    /// The process data of a chained node reach beyond the PRes of the managing node.
    BeyondPresMn {
        /// Node id, 1..=239.
        id: u8,
        /// Where they end.
        end: u32,
        /// Octets of the PRes.
        most: u16,
    },
    /// AsyncMTU (0x1F98/8) is 300..=1500.
    AsyncMtu {
        /// The value that the configuration has.
        got: u16,
    },
    /// The prescaler (0x1F98/9) is at most 1000.
    Prescaler {
        /// The value that the configuration has.
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
        /// The value that the configuration has.
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
        /// Node id, 1..=239.
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
        check_node(config, node).map_err(|reason| MnConfigError::Conflict { id, reason })?;
    }
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

/// What the bits of one node cannot ask for together.
fn check_node(config: &MnConfig<'_>, node: &NodeConfig<'_>) -> Result<(), &'static str> {
    let Assignment {
        automatic_start,
        keep_alive,
        check_software,
        async_only,
        ..
    } = node.assignment;
    if !automatic_start {
        return Err("a node that waits for the application to boot it (1F81h bit 2 is clear) is not served");
    }
    if check_software && config.startup.check_software && node.software.is_none() {
        return Err("the software shall be checked (1F81h bit 5), and none is expected (1F53h, 1F54h)");
    }
    if async_only && (node.preq_bytes > 0 || node.pres_bytes > 0) {
        return Err("a node that is never polled (1F81h bit 8) has no process data");
    }
    if keep_alive && !node.configuration.is_empty() {
        if !config.startup.check_configuration {
            return Err("a node that is kept alive (1F81h bit 4) needs the configuration check (1F80h bit 11)");
        }
        if expected_stamp(node).is_none() {
            return Err(
                "a node that is kept alive (1F81h bit 4) needs date and time of its configuration (1F26h, 1F27h)",
            );
        }
    }
    Ok(())
}
