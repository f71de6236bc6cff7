//! The objects of the managing node in one table: access, limits, defaults. Where the values come from is in [`super`].
//!
//! A sub-index of an object "per node" is the node id. The default is what an entry reads that nothing of this network has, such
//! as those of nodes that are not configured. Objects whose sub-index 0 has no line of its own have one all the same: the number
//! of entries.

use obd::{DataType, EntryDef};

use crate::mn::image::{ENTRIES, IMAGE_IN, IMAGE_OUT};
use crate::wire::{EPL_VERSION, ERROR_ENTRY_LEN, PAYLOAD_LIMIT_MIN, PAYLOAD_MAX};

/// Errors of the history (0x1003).
pub const HISTORY_ENTRIES: u8 = 8;
/// Bits of 0x1F82: isochronous, SDO by ASnd, configuration manager, multiplexed, MN in BASIC_ETHERNET, PRes chaining.
pub const FEATURE_FLAGS: u32 = 1 | 1 << 2 | 1 << 8 | 1 << 9 | 1 << 11 | 1 << 18;
/// Last channel of process data: the objects 0x1400+k, 0x1600+k, 0x1800+k and 0x1A00+k stand in the table with k = 0. They
/// exist up to the number of nodes.
pub(super) const CHANNEL_LAST: u16 = 0xFF;

const U32_MAX: i64 = u32::MAX as i64;
const LIMIT_MIN: i64 = PAYLOAD_LIMIT_MIN as i64;
const LIMIT_MAX: i64 = PAYLOAD_MAX as i64;

const U8: DataType = DataType::U8;
const U16: DataType = DataType::U16;
const U32: DataType = DataType::U32;
const BOOL: DataType = DataType::Bool;
const TEXT: DataType = DataType::VisibleString;

const fn ro(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::ro(index, data_type, name)
}
const fn rw(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::rw(index, data_type, name)
}
const fn rws(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::rws(index, data_type, name)
}
const fn constant(index: u16, data_type: DataType, name: &'static str) -> EntryDef {
    EntryDef::constant(index, data_type, name)
}
/// One entry for each node id.
const fn per_node(def: EntryDef) -> EntryDef {
    def.subs(1, 254)
}

/// The table, in the order of index and sub-index.
#[rustfmt::skip]
pub const MN_PROFILE: &[EntryDef] = &[
    ro(0x1000, U32, "NMT_DeviceType_U32"),
    ro(0x1001, U8, "ERR_ErrorRegister_U8"),
    rw(0x1003, U8, "NumberOfEntries").limits(0, 0), // writing 0 empties the history
    ro(0x1003, DataType::OctetString, "ErrorEntry_DOM").subs(1, HISTORY_ENTRIES).capacity(ERROR_ENTRY_LEN as u16),
    rws(0x1006, U32, "NMT_CycleLen_U32").limits(100, U32_MAX), // us
    constant(0x1008, TEXT, "NMT_ManufactDevName_VS").capacity(64),
    constant(0x1009, TEXT, "NMT_ManufactHwVers_VS").capacity(64),
    constant(0x100A, TEXT, "NMT_ManufactSwVers_VS").capacity(64),
    ro(0x1018, U32, "VendorId_U32").sub(1),
    ro(0x1018, U32, "ProductCode_U32").sub(2),
    ro(0x1018, U32, "RevisionNo_U32").sub(3),
    ro(0x1018, U32, "SerialNo_U32").sub(4),
    rws(0x1020, U32, "ConfDate_U32").sub(1),
    rws(0x1020, U32, "ConfTime_U32").sub(2),
    ro(0x1030, U16, "InterfaceIndex_U16").sub(1).default(1),
    constant(0x1030, TEXT, "InterfaceDescription_VSTR").sub(2).capacity(16).default_octets(b"Interface 1"),
    constant(0x1030, U8, "InterfaceType_U8").sub(3).default(6), // ethernetCsmacd
    constant(0x1030, U16, "InterfaceMtu_U16").sub(4).default(1518),
    constant(0x1030, DataType::Mac, "InterfacePhysAddress_OSTR").sub(5),
    constant(0x1030, TEXT, "InterfaceName_VSTR").sub(6).capacity(16).default_octets(b"Interface 1"),
    ro(0x1030, U8, "InterfaceOperStatus_U8").sub(7).default(1),
    rw(0x1030, U8, "InterfaceAdminState_U8").sub(8).default(1).limits(1, 1),
    ro(0x1030, BOOL, "Valid_BOOL").sub(9).default(1),
    rws(0x1300, U32, "SDO_SequLayerTimeout_U32").default(15_000).limits(100, U32_MAX), // ms

    // Channel 0 is the PRes of the managing node, channel k the node at place k of the configuration, counted from 1.
    rws(0x1400, U8, "NodeID_U8").sub(1).limits(0, 254),
    rws(0x1400, U8, "MappingVersion_U8").sub(2),
    rws(0x1600, U8, "NumberOfEntries").limits(0, 254),
    rws(0x1600, DataType::U64, "ObjectMapping").subs(1, 254),
    rws(0x1800, U8, "NodeID_U8").sub(1).limits(0, 254),
    rws(0x1800, U8, "MappingVersion_U8").sub(2),
    rws(0x1A00, U8, "NumberOfEntries").limits(0, 254),
    rws(0x1A00, DataType::U64, "ObjectMapping").subs(1, 254),

    rw(0x1C00, U32, "CRCError CumulativeCnt_U32").sub(1),
    ro(0x1C00, U32, "CRCError ThresholdCnt_U32").sub(2),
    rws(0x1C00, U32, "CRCError Threshold_U32").sub(3).default(15),
    rw(0x1C02, U32, "CycTimeExceed CumulativeCnt_U32").sub(1),
    ro(0x1C02, U32, "CycTimeExceed ThresholdCnt_U32").sub(2),
    rws(0x1C02, U32, "CycTimeExceed Threshold_U32").sub(3).default(15),
    per_node(rw(0x1C07, U32, "LossPResCumCnt_U32")),
    per_node(ro(0x1C08, U32, "LossPResThrCnt_U32")),
    per_node(rws(0x1C09, U32, "LossPResThreshold_U32").default(15)),
    rw(0x1C12, U32, "DLL_MNCycleSuspendNumber_U32").default(1),
    rws(0x1C14, U32, "DLL_CNLossOfSocTolerance_U32").default(100_000), // ns
    per_node(rw(0x1C15, U32, "LossStatusResCumCnt_U32")),
    per_node(ro(0x1C16, U32, "LossStatusResThrCnt_U32")),
    per_node(rws(0x1C17, U32, "LossStatusResThreshold_U32").default(15)),

    ro(0x1E40, U16, "IfIndex_U16").sub(1).default(1),
    ro(0x1E40, DataType::Ip, "Addr_IPAD").sub(2).default(0xC0A8_64F0), // 192.168.100.240
    ro(0x1E40, DataType::Ip, "NetMask_IPAD").sub(3).default(0xFFFF_FF00),
    ro(0x1E40, U16, "ReasmMaxSize_U16").sub(4).default(50_000),
    rws(0x1E40, DataType::Ip, "DefaultGateway_IPAD").sub(5).default(0xC0A8_64FE), // 192.168.100.254
    rw(0x1E4A, BOOL, "Forwarding_BOOL").sub(1),
    rw(0x1E4A, U16, "DefaultTTL_U16").sub(2).default(64),
    ro(0x1E4A, U32, "ForwardDatagrams_U32").sub(3),

    per_node(rw(0x1F22, DataType::Domain, "CFM_ConciseDcfList_ADOM").capacity(u16::MAX)),
    per_node(rws(0x1F26, U32, "CFM_ExpConfDateList_AU32")),
    per_node(rws(0x1F27, U32, "CFM_ExpConfTimeList_AU32")),
    ro(0x1F52, U32, "ApplSwDate_U32").sub(1),
    ro(0x1F52, U32, "ApplSwTime_U32").sub(2),
    per_node(rws(0x1F53, U32, "PDL_MnExpAppSwDateList_AU32")),
    per_node(rws(0x1F54, U32, "PDL_MnExpAppSwTimeList_AU32")),
    rws(0x1F80, U32, "NMT_StartUp_U32").default(0x0800),
    per_node(rws(0x1F81, U32, "NMT_NodeAssignment_AU32")),
    constant(0x1F82, U32, "NMT_FeatureFlags_U32").default(FEATURE_FLAGS as i64),
    constant(0x1F83, U8, "NMT_EPLVersion_U8").default(EPL_VERSION as i64),
    per_node(rws(0x1F84, U32, "NMT_MNNodeExpDeviceType_AU32")),
    per_node(rws(0x1F85, U32, "NMT_MNVendorIdList_AU32")),
    per_node(rws(0x1F86, U32, "NMT_MNProductCodeList_AU32")),
    per_node(rws(0x1F87, U32, "NMT_MNRevisionNoList_AU32")),
    per_node(rws(0x1F88, U32, "NMT_MNSerialNoList_AU32")),
    rws(0x1F89, U32, "MNWaitNotAct_U32").sub(1).default(1_000_000), // us
    rws(0x1F89, U32, "MNTimeoutPreOp1_U32").sub(2).default(500_000),
    rws(0x1F89, U32, "MNWaitPreOp1_U32").sub(3).default(500_000),
    rws(0x1F89, U32, "MNTimeoutPreOp2_U32").sub(4).default(5_000_000),
    rws(0x1F89, U32, "MNTimeoutReadyToOp_U32").sub(5).default(500_000),
    rws(0x1F8A, U32, "WaitSoCPReq_U32").sub(1).default(1_000), // ns
    rws(0x1F8A, U32, "AsyncSlotTimeout_U32").sub(2).default(100_000).limits(250, U32_MAX),
    per_node(rws(0x1F8B, U16, "NMT_MNPReqPayloadLimitList_AU16").default(LIMIT_MIN).limits(LIMIT_MIN, LIMIT_MAX)),
    ro(0x1F8C, U8, "NMT_CurrNMTState_U8").default(0x1C),
    per_node(rws(0x1F8D, U16, "NMT_PResPayloadLimitList_AU16").default(LIMIT_MIN).limits(LIMIT_MIN, LIMIT_MAX)),
    per_node(ro(0x1F8E, U8, "NMT_MNNodeCurrState_AU8").default(0x1C)),
    per_node(ro(0x1F8F, U8, "NMT_MNNodeExpState_AU8").default(0x1C)),
    per_node(rws(0x1F92, U32, "NMT_MNCNPResTimeout_AU32").default(25_000)), // ns
    ro(0x1F93, U8, "NodeID_U8").sub(1).default(240),
    ro(0x1F93, BOOL, "NodeIDByHW_BOOL").sub(2),
    constant(0x1F98, U16, "IsochrTxMaxPayload_U16").sub(1).default(LIMIT_MAX),
    constant(0x1F98, U16, "IsochrRxMaxPayload_U16").sub(2).default(LIMIT_MAX),
    constant(0x1F98, U32, "PResMaxLatency_U32").sub(3), // ns
    rws(0x1F98, U16, "PReqActPayloadLimit_U16").sub(4).default(LIMIT_MIN).limits(LIMIT_MIN, LIMIT_MAX),
    rws(0x1F98, U16, "PResActPayloadLimit_U16").sub(5).default(LIMIT_MIN).limits(LIMIT_MIN, LIMIT_MAX),
    constant(0x1F98, U32, "ASndMaxLatency_U32").sub(6), // ns
    rws(0x1F98, U8, "MultiplCycleCnt_U8").sub(7),
    rws(0x1F98, U16, "AsyncMTU_U16").sub(8).default(300).limits(300, 1500),
    rws(0x1F98, U16, "Prescaler_U16").sub(9).default(2).limits(0, 1000),
    rws(0x1F9A, TEXT, "NMT_HostName_VSTR").capacity(32),
    per_node(rws(0x1F9B, U8, "NMT_MultiplCycleAssign_AU8")),
    rw(0x1F9E, U8, "NMT_ResetCmd_U8").default(0xFF),
    rw(0x1F9F, BOOL, "Release_BOOL").sub(1),
    rw(0x1F9F, U8, "CmdID_U8").sub(2),
    rw(0x1F9F, U8, "CmdTarget_U8").sub(3),
    rw(0x1F9F, DataType::Domain, "CmdData_DOM").sub(4).capacity(32),

    // The process image: what the channels of process data map. The first of 16 arrays stands for all.
    ro(IMAGE_OUT, U8, "octets of process data to the nodes").subs(1, ENTRIES),
    ro(IMAGE_IN, U8, "octets of process data of the nodes").subs(1, ENTRIES),
];
