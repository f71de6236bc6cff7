//! What the managing node is told before it starts: node list and times. `check` says what may be wrong with it.

use obd::Expected;
use obd::cdc::CdcReader;

use super::startup::{Assignment, StartUp};
use crate::wire::Mac;

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
    /// What is read from the node behind that, and must be so; a node that has no such object is believed.
    pub expected: &'a [Expected],
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
            expected: &[],
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

/// What the managing node says of itself in its dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceInfo<'a> {
    /// Object 0x1000.
    pub device_type: u32,
    /// Object 0x1018/1.
    pub vendor_id: u32,
    /// Object 0x1018/2.
    pub product_code: u32,
    /// Object 0x1018/3.
    pub revision: u32,
    /// Object 0x1018/4.
    pub serial: u32,
    /// Object 0x1008.
    pub device_name: &'a str,
    /// Object 0x1009.
    pub hardware_version: &'a str,
    /// Object 0x100A.
    pub software_version: &'a str,
    /// Object 0x1F9A.
    pub host_name: &'a str,
    /// Object 0x1F52.
    pub software: Stamp,
}

impl Default for DeviceInfo<'_> {
    fn default() -> Self {
        DeviceInfo {
            device_type: 0,
            vendor_id: 0,
            product_code: 0,
            revision: 0,
            serial: 0,
            device_name: "managing node",
            hardware_version: "",
            software_version: env!("CARGO_PKG_VERSION"),
            host_name: "",
            software: Stamp { date: 0, time: 0 },
        }
    }
}

/// The date and time (0x1020/1, /2) that a configured node reports: as configured (0x1F26, 0x1F27), else as the concise DCF
/// writes them. `None`: it cannot be told, as a date or a time of zero is what a node without configuration has.
pub(super) fn expected_stamp(config: &NodeConfig<'_>) -> Option<Stamp> {
    let stamp = config.configuration_stamp.unwrap_or_else(|| {
        let mut stamp = Stamp { date: 0, time: 0 };
        // An empty configuration has nothing to read.
        for write in CdcReader::new(config.configuration).into_iter().flatten().flatten() {
            if let (0x1020, Ok(value)) = (write.index, write.value.try_into()) {
                match write.sub {
                    1 => stamp.date = u32::from_le_bytes(value),
                    2 => stamp.time = u32::from_le_bytes(value),
                    _ => {}
                }
            }
        }
        stamp
    });
    (stamp.date != 0 && stamp.time != 0).then_some(stamp)
}

pub(super) fn us_to_ns(microseconds: u32) -> u64 {
    u64::from(microseconds) * 1000
}
