//! The objects of the communication profile (0x1000..0x1FFF) of a controlled node, one line each.
//!
//! Access, ranges and defaults are those of DS 301 as openPOWERLINK's controlled nodes have them; units stand behind the
//! line. Who changes a value: `const` no one, `ro` the node itself, `rw` and `rws` an SDO; `rws` is what 0x1010 stores.
//! What differs from node to node (identity, names, addresses) is set by [`super::Cn::new`].
//!
//! Not here: objects of a managing node, routing, SDO parameters of a client. An access to them is aborted with
//! 0x06020000, which ends the configuration by most managing nodes. So what configuration tools write into every node of a
//! network with cross traffic or multiplexing (0x1F81, 0x1F9B) is here, although this node does without. [`STORAGE`] is for devices that can store parameters.

use obd::{DataType, EntryDef};

use crate::wire::{EPL_VERSION, ERROR_ENTRY_LEN, PAYLOAD_LIMIT_MIN, PAYLOAD_MAX};

/// PDOs that the node receives: 0x1400..0x1403, 0x1600..0x1603.
pub const RPDOS: usize = 4;
/// Entries of each PDO mapping (0x1600.., 0x1A00).
pub const MAPPING_ENTRIES: usize = 32;
/// Errors kept in the history (0x1003).
pub const HISTORY_ENTRIES: usize = 8;
/// Bits of 0x1F82: isochronous, SDO by ASnd, extended NMT commands, dynamic PDO mapping, multiplexed, SDO of several
/// objects, PRes chaining.
pub const FEATURE_FLAGS: u32 = 1 | 1 << 2 | 1 << 5 | 1 << 6 | 1 << 9 | 1 << 15 | 1 << 18;
/// Most octets of a host name.
pub const HOST_NAME_LEN: usize = 32;

const U32_MAX: i64 = u32::MAX as i64;
const LIMIT_MIN: i64 = PAYLOAD_LIMIT_MIN as i64;
const LIMIT_MAX: i64 = PAYLOAD_MAX as i64;
const ENTRIES_MAX: i64 = MAPPING_ENTRIES as i64;

use DataType::{Bool, Ip, Mac, OctetString, U8, U16, U32, U64, VisibleString};

const fn constant(index: u16, sub: u8, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::constant(index, data_type, name).sub(sub)
}
const fn ro(index: u16, sub: u8, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::ro(index, data_type, name).sub(sub)
}
const fn rw(index: u16, sub: u8, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::rw(index, data_type, name).sub(sub)
}
const fn rws(index: u16, sub: u8, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::rws(index, data_type, name).sub(sub)
}
const fn text(index: u16, sub: u8, capacity: u16, name: &'static str) -> EntryDef {
    constant(index, sub, VisibleString, name).capacity(capacity)
}
/// Entries of a mapping object.
const fn mapping(index: u16) -> EntryDef {
    EntryDef::rws(index, U64, "ObjectMapping").subs(1, MAPPING_ENTRIES as u8)
}
/// One value for each node id.
const fn per_node(def: EntryDef) -> EntryDef {
    def.subs(1, 254)
}

/// Lines of the dictionary, ascending.
#[rustfmt::skip]
pub const COMMUNICATION_PROFILE: &[EntryDef] = &[
    ro(0x1000, 0, U32, "NMT_DeviceType_U32"),
    ro(0x1001, 0, U8, "ERR_ErrorRegister_U8").tpdo(),
    rw(0x1003, 0, U8, "NumberOfEntries").limits(0, 0), // 0 empties the history
    EntryDef::ro(0x1003, OctetString, "ErrorEntry_DOM").subs(1, HISTORY_ENTRIES as u8).capacity(ERROR_ENTRY_LEN as u16),
    rws(0x1006, 0, U32, "NMT_CycleLen_U32").limits(100, U32_MAX), // us; 0 until it is written
    text(0x1008, 0, 32, "NMT_ManufactDevName_VS"),
    text(0x1009, 0, 16, "NMT_ManufactHwVers_VS"),
    text(0x100A, 0, 16, "NMT_ManufactSwVers_VS").default_octets(env!("CARGO_PKG_VERSION").as_bytes()),
    ro(0x1018, 1, U32, "VendorId_U32"),
    ro(0x1018, 2, U32, "ProductCode_U32"),
    ro(0x1018, 3, U32, "RevisionNo_U32"),
    ro(0x1018, 4, U32, "SerialNo_U32"),
    rws(0x1020, 1, U32, "ConfDate_U32"), // days since 1984-01-01
    rws(0x1020, 2, U32, "ConfTime_U32"), // ms since midnight
    ro(0x1030, 1, U16, "InterfaceIndex_U16").default(1),
    text(0x1030, 2, 16, "InterfaceDescription_VSTR").default_octets(b"Interface 1"),
    constant(0x1030, 3, U8, "InterfaceType_U8").default(6), // ethernetCsmacd
    constant(0x1030, 4, U16, "InterfaceMtu_U16").default(1518),
    constant(0x1030, 5, Mac, "InterfacePhysAddress_OSTR"),
    text(0x1030, 6, 16, "InterfaceName_VSTR").default_octets(b"Interface 1"),
    ro(0x1030, 7, U8, "InterfaceOperStatus_U8").default(1),
    rw(0x1030, 8, U8, "InterfaceAdminState_U8").default(1).limits(1, 1), // cannot be switched off
    ro(0x1030, 9, Bool, "Valid_BOOL").default(1),
    per_node(EntryDef::ro(0x1050, U32, "NMT_RelativeLatencyDiff_AU32")), // ns
    ro(0x1101, 1, U32, "IsochrCyc_U32"), // SoC received
    ro(0x1101, 2, U32, "IsochrRx_U32"), // PReq and PRes received
    ro(0x1101, 3, U32, "IsochrTx_U32"), // PRes sent
    ro(0x1101, 4, U32, "AsyncRx_U32"), // ASnd received
    ro(0x1101, 5, U32, "AsyncTx_U32"), // frames sent in the asynchronous slot
    ro(0x1101, 6, U32, "SdoRx_U32"),
    ro(0x1101, 7, U32, "SdoTx_U32"),
    ro(0x1101, 8, U32, "Status_U32"), // StatusRequests received
    ro(0x1102, 1, U32, "HistoryEntryWrite_U32"),
    ro(0x1102, 2, U32, "EmergencyQueueWrite_U32"),
    ro(0x1102, 3, U32, "EmergencyQueueOverflow_U32"),
    ro(0x1102, 4, U32, "StatusEntryChanged_U32"), // stays 0: there are no status entries
    ro(0x1102, 5, U32, "StaticErrorBitFieldChanged_U32"),
    ro(0x1102, 6, U32, "ExceptionResetEdgePos_U32"),
    ro(0x1102, 7, U32, "ExceptionNewEdge_U32"),
    rws(0x1300, 0, U32, "SDO_SequLayerTimeout_U32").default(15_000).limits(100, U32_MAX), // ms
    rws(0x1400, 1, U8, "NodeID_U8").limits(0, 254), // 0: the PReq of the MN; else whose PRes, 240: the PResMN
    rws(0x1400, 2, U8, "MappingVersion_U8"), // main version in the high nibble; 0: not checked
    rws(0x1401, 1, U8, "NodeID_U8").limits(0, 254),
    rws(0x1401, 2, U8, "MappingVersion_U8"),
    rws(0x1402, 1, U8, "NodeID_U8").limits(0, 254),
    rws(0x1402, 2, U8, "MappingVersion_U8"),
    rws(0x1403, 1, U8, "NodeID_U8").limits(0, 254),
    rws(0x1403, 2, U8, "MappingVersion_U8"),
    rws(0x1600, 0, U8, "NumberOfEntries").limits(0, ENTRIES_MAX),
    mapping(0x1600),
    rws(0x1601, 0, U8, "NumberOfEntries").limits(0, ENTRIES_MAX),
    mapping(0x1601),
    rws(0x1602, 0, U8, "NumberOfEntries").limits(0, ENTRIES_MAX),
    mapping(0x1602),
    rws(0x1603, 0, U8, "NumberOfEntries").limits(0, ENTRIES_MAX),
    mapping(0x1603),
    rws(0x1800, 1, U8, "NodeID_U8").limits(0, 0), // a CN has only its own PRes
    rws(0x1800, 2, U8, "MappingVersion_U8"),
    rws(0x1A00, 0, U8, "NumberOfEntries").limits(0, ENTRIES_MAX),
    mapping(0x1A00),
    rw(0x1C0A, 1, U32, "Collision CumulativeCnt_U32"),
    ro(0x1C0A, 2, U32, "Collision ThresholdCnt_U32"),
    rws(0x1C0A, 3, U32, "Collision Threshold_U32").default(15),
    rw(0x1C0B, 1, U32, "LossSoC CumulativeCnt_U32"),
    ro(0x1C0B, 2, U32, "LossSoC ThresholdCnt_U32"),
    rws(0x1C0B, 3, U32, "LossSoC Threshold_U32").default(15),
    rw(0x1C0C, 1, U32, "LossSoA CumulativeCnt_U32"),
    ro(0x1C0C, 2, U32, "LossSoA ThresholdCnt_U32"),
    rws(0x1C0C, 3, U32, "LossSoA Threshold_U32").default(15),
    rw(0x1C0D, 1, U32, "LossPReq CumulativeCnt_U32"),
    ro(0x1C0D, 2, U32, "LossPReq ThresholdCnt_U32"),
    rws(0x1C0D, 3, U32, "LossPReq Threshold_U32").default(15),
    rw(0x1C0F, 1, U32, "CRCError CumulativeCnt_U32"),
    ro(0x1C0F, 2, U32, "CRCError ThresholdCnt_U32"),
    rws(0x1C0F, 3, U32, "CRCError Threshold_U32").default(15),
    rws(0x1C14, 0, U32, "DLL_CNLossOfSocTolerance_U32").default(100_000), // ns
    ro(0x1E40, 1, U16, "IfIndex_U16").default(1),
    ro(0x1E40, 2, Ip, "Addr_IPAD"), // 192.168.100.node
    ro(0x1E40, 3, Ip, "NetMask_IPAD").default(0xFFFF_FF00),
    ro(0x1E40, 4, U16, "ReasmMaxSize_U16").default(50_000), // octets
    rws(0x1E40, 5, Ip, "DefaultGateway_IPAD").default(0xC0A8_64FE), // 192.168.100.254
    ro(0x1E4A, 1, Bool, "Forwarding_BOOL"), // never
    rws(0x1E4A, 2, U16, "DefaultTTL_U16").default(64).limits(1, 255),
    ro(0x1E4A, 3, U32, "ForwardDatagrams_U32"),
    ro(0x1F52, 1, U32, "ApplSwDate_U32"),
    ro(0x1F52, 2, U32, "ApplSwTime_U32"),
    per_node(EntryDef::rws(0x1F81, U32, "NMT_NodeAssignment_AU32")), // kept for who reads it: a node reads any PRes
    constant(0x1F82, 0, U32, "NMT_FeatureFlags_U32").default(FEATURE_FLAGS as i64),
    constant(0x1F83, 0, U8, "NMT_EPLVersion_U8").default(EPL_VERSION as i64),
    ro(0x1F8C, 0, U8, "NMT_CurrNMTState_U8").tpdo().default(0x1C),
    // Longest payload of the PRes of each node, for RPDOs that read it; octets.
    per_node(EntryDef::rws(0x1F8D, U16, "NMT_PResPayloadLimitList_AU16")).default(LIMIT_MIN).limits(0, LIMIT_MAX),
    ro(0x1F93, 1, U8, "NodeID_U8"),
    ro(0x1F93, 2, Bool, "NodeIDByHW_BOOL"),
    constant(0x1F98, 1, U16, "IsochrTxMaxPayload_U16").default(LIMIT_MAX), // octets
    constant(0x1F98, 2, U16, "IsochrRxMaxPayload_U16").default(LIMIT_MAX), // octets
    constant(0x1F98, 3, U32, "PResMaxLatency_U32"), // ns
    rws(0x1F98, 4, U16, "PReqActPayloadLimit_U16").default(LIMIT_MIN).limits(LIMIT_MIN, LIMIT_MAX), // octets
    rws(0x1F98, 5, U16, "PResActPayloadLimit_U16").default(LIMIT_MIN).limits(LIMIT_MIN, LIMIT_MAX), // octets
    constant(0x1F98, 6, U32, "ASndMaxLatency_U32"), // ns
    rws(0x1F98, 7, U8, "MultiplCycleCnt_U8"), // cycles; 0: no node is multiplexed
    rws(0x1F98, 8, U16, "AsyncMTU_U16").default(300).limits(300, 1500), // octets behind the Ethernet header
    rws(0x1F98, 9, U16, "Prescaler_U16").default(2).limits(0, 1000), // cycles
    ro(0x1F98, 10, U8, "PResMode_U8"), // 1: the PRes follows the PResMN
    ro(0x1F98, 11, U32, "PResTimeFirst_U32"), // ns
    ro(0x1F98, 12, U32, "PResTimeSecond_U32"), // ns
    ro(0x1F98, 13, U32, "SyncMNDelayFirst_U32"), // ns
    ro(0x1F98, 14, U32, "SyncMNDelaySecond_U32"), // ns
    rws(0x1F99, 0, U32, "NMT_CNBasicEthernetTimeout_U32").default(5_000_000), // us; 0: never
    EntryDef::rws(0x1F9A, VisibleString, "NMT_HostName_VSTR").capacity(HOST_NAME_LEN as u16),
    per_node(EntryDef::rws(0x1F9B, U8, "NMT_MultiplCycleAssign_AU8")), // kept for who reads it: the PReq shows the slot
    rw(0x1F9E, 0, U8, "NMT_ResetCmd_U8").default(0xFF),
];

/// Lines a [`Dictionary`](obd::Dictionary) needs for [`COMMUNICATION_PROFILE`]; add [`obd::lines_of`] of the device's table.
pub const COMMUNICATION_ENTRIES: usize = obd::lines_of(COMMUNICATION_PROFILE);
/// Octets a [`Dictionary`](obd::Dictionary) needs for [`COMMUNICATION_PROFILE`]; add [`obd::octets_of`] of the device's table.
pub const COMMUNICATION_BYTES: usize = obd::octets_of(COMMUNICATION_PROFILE);

/// Store and restore parameters, for a device that has where to store them. Sub-indices: 1 all, 2 communication,
/// 3 application, 4 manufacturer. A signature written here comes to the device as
/// [`Events::storage`](super::Events::storage); any other value is aborted.
#[rustfmt::skip]
pub const STORAGE: &[EntryDef] = &[
    EntryDef::rw(0x1010, U32, "NMT_StoreParam_REC").subs(1, 4).default(1), // 1: stores on command
    EntryDef::rw(0x1011, U32, "NMT_RestoreDefParam_REC").subs(1, 4).default(1), // 1: restores on command
];
/// What is written to 0x1010: "save", little endian.
pub const SAVE: u32 = u32::from_le_bytes(*b"save");
/// What is written to 0x1011: "load", little endian.
pub const LOAD: u32 = u32::from_le_bytes(*b"load");

#[cfg(test)]
mod tests;
