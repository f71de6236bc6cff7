//! Objects of the communication profile (0x1000..0x1FFF) that a controlled node has, and where the node keeps them.
//!
//! Not here: 0x1010 and 0x1011 (nothing is stored on the device), MN objects, IP routing. An access to them is aborted with
//! 0x06020000, which managing nodes know to expect.

use obd::{DataType, Dictionary, EntryDef, Key, Scalar};

use super::CnError;
use crate::wire::{EPL_VERSION, ERROR_ENTRY_LEN, PAYLOAD_LIMIT_MIN, PAYLOAD_MAX};

/// Entries of each PDO mapping (0x1600, 0x1A00).
pub const MAPPING_ENTRIES: usize = 32;
/// Errors kept in the history (0x1003).
pub const HISTORY_ENTRIES: usize = 8;
/// Bits of 0x1F82: isochronous, SDO by ASnd, extended NMT commands, dynamic PDO mapping, multiplexed.
pub const FEATURE_FLAGS: u32 = 1 | 1 << 2 | 1 << 5 | 1 << 6 | 1 << 9;
/// Most octets of a host name.
pub const HOST_NAME_LEN: usize = 32;

const U32_MAX: i64 = u32::MAX as i64;
const LIMIT_MIN: i64 = PAYLOAD_LIMIT_MIN as i64;
const LIMIT_MAX: i64 = PAYLOAD_MAX as i64;

const fn u8_(index: u16, name: &'static str) -> EntryDef {
    EntryDef::ro(index, DataType::U8, name)
}

/// The table. Values that differ from node to node (identity, names, addresses) are set by [`super::Cn::new`].
pub const COMMUNICATION_PROFILE: &[EntryDef] = &[
    EntryDef::ro(0x1000, DataType::U32, "NMT_DeviceType_U32"),
    EntryDef::ro(0x1001, DataType::U8, "ERR_ErrorRegister_U8").tpdo(),
    EntryDef::rw(0x1003, DataType::U8, "NumberOfEntries").limits(0, 0),
    EntryDef::ro(0x1003, DataType::OctetString, "ErrorEntry_DOM")
        .subs(1, HISTORY_ENTRIES as u8)
        .capacity(ERROR_ENTRY_LEN as u16),
    EntryDef::rws(0x1006, DataType::U32, "NMT_CycleLen_U32").limits(100, U32_MAX), // us
    EntryDef::constant(0x1008, DataType::VisibleString, "NMT_ManufactDevName_VS").capacity(32),
    EntryDef::constant(0x1009, DataType::VisibleString, "NMT_ManufactHwVers_VS").capacity(16),
    EntryDef::constant(0x100A, DataType::VisibleString, "NMT_ManufactSwVers_VS")
        .capacity(16)
        .default_octets(env!("CARGO_PKG_VERSION").as_bytes()),
    EntryDef::ro(0x1018, DataType::U32, "VendorId_U32").sub(1),
    EntryDef::ro(0x1018, DataType::U32, "ProductCode_U32").sub(2),
    EntryDef::ro(0x1018, DataType::U32, "RevisionNo_U32").sub(3),
    EntryDef::ro(0x1018, DataType::U32, "SerialNo_U32").sub(4),
    EntryDef::rws(0x1020, DataType::U32, "ConfDate_U32").sub(1),
    EntryDef::rws(0x1020, DataType::U32, "ConfTime_U32").sub(2),
    EntryDef::ro(0x1030, DataType::U16, "InterfaceIndex_U16")
        .sub(1)
        .default(1),
    EntryDef::constant(0x1030, DataType::VisibleString, "InterfaceDescription_VSTR")
        .sub(2)
        .capacity(16)
        .default_octets(b"Interface 1"),
    EntryDef::constant(0x1030, DataType::U8, "InterfaceType_U8")
        .sub(3)
        .default(6), // ethernetCsmacd
    EntryDef::constant(0x1030, DataType::U16, "InterfaceMtu_U16")
        .sub(4)
        .default(1518),
    EntryDef::constant(0x1030, DataType::Mac, "InterfacePhysAddress_OSTR").sub(5),
    EntryDef::constant(0x1030, DataType::VisibleString, "InterfaceName_VSTR")
        .sub(6)
        .capacity(16)
        .default_octets(b"Interface 1"),
    u8_(0x1030, "InterfaceOperStatus_U8").sub(7).default(1),
    EntryDef::rw(0x1030, DataType::U8, "InterfaceAdminState_U8")
        .sub(8)
        .default(1)
        .limits(1, 1),
    EntryDef::ro(0x1030, DataType::Bool, "Valid_BOOL").sub(9).default(1),
    EntryDef::rws(0x1300, DataType::U32, "SDO_SequLayerTimeout_U32")
        .default(15_000)
        .limits(100, U32_MAX), // ms
    EntryDef::rws(0x1400, DataType::U8, "NodeID_U8").sub(1).limits(0, 254), // 0: the PReq; else whose PRes
    EntryDef::rws(0x1400, DataType::U8, "MappingVersion_U8").sub(2),
    EntryDef::rws(0x1600, DataType::U8, "NumberOfEntries").limits(0, MAPPING_ENTRIES as i64),
    EntryDef::rws(0x1600, DataType::U64, "ObjectMapping").subs(1, MAPPING_ENTRIES as u8),
    EntryDef::rws(0x1800, DataType::U8, "NodeID_U8").sub(1).limits(0, 0), // a CN has only its own PRes
    EntryDef::rws(0x1800, DataType::U8, "MappingVersion_U8").sub(2),
    EntryDef::rws(0x1A00, DataType::U8, "NumberOfEntries").limits(0, MAPPING_ENTRIES as i64),
    EntryDef::rws(0x1A00, DataType::U64, "ObjectMapping").subs(1, MAPPING_ENTRIES as u8),
    EntryDef::rw(0x1C0B, DataType::U32, "LossSoC CumulativeCnt_U32").sub(1),
    EntryDef::ro(0x1C0B, DataType::U32, "LossSoC ThresholdCnt_U32").sub(2),
    EntryDef::rws(0x1C0B, DataType::U32, "LossSoC Threshold_U32")
        .sub(3)
        .default(15),
    EntryDef::rw(0x1C0D, DataType::U32, "LossPReq CumulativeCnt_U32").sub(1),
    EntryDef::ro(0x1C0D, DataType::U32, "LossPReq ThresholdCnt_U32").sub(2),
    EntryDef::rws(0x1C0D, DataType::U32, "LossPReq Threshold_U32")
        .sub(3)
        .default(15),
    // Stays at 0: the network adapter drops frames with a wrong CRC before they come here.
    EntryDef::rw(0x1C0F, DataType::U32, "CRCError CumulativeCnt_U32").sub(1),
    EntryDef::ro(0x1C0F, DataType::U32, "CRCError ThresholdCnt_U32").sub(2),
    EntryDef::rws(0x1C0F, DataType::U32, "CRCError Threshold_U32")
        .sub(3)
        .default(15),
    EntryDef::rws(0x1C14, DataType::U32, "DLL_CNLossOfSocTolerance_U32").default(100_000), // ns
    EntryDef::ro(0x1E40, DataType::U16, "IfIndex_U16").sub(1).default(1),
    EntryDef::ro(0x1E40, DataType::Ip, "Addr_IPAD").sub(2),
    EntryDef::ro(0x1E40, DataType::Ip, "NetMask_IPAD")
        .sub(3)
        .default(0xFFFF_FF00),
    EntryDef::ro(0x1E40, DataType::U16, "ReasmMaxSize_U16")
        .sub(4)
        .default(50_000),
    EntryDef::rws(0x1E40, DataType::Ip, "DefaultGateway_IPAD")
        .sub(5)
        .default(0xC0A8_64FE), // 192.168.100.254
    EntryDef::ro(0x1F52, DataType::U32, "ApplSwDate_U32").sub(1),
    EntryDef::ro(0x1F52, DataType::U32, "ApplSwTime_U32").sub(2),
    EntryDef::constant(0x1F82, DataType::U32, "NMT_FeatureFlags_U32").default(FEATURE_FLAGS as i64),
    EntryDef::constant(0x1F83, DataType::U8, "NMT_EPLVersion_U8").default(EPL_VERSION as i64),
    u8_(0x1F8C, "NMT_CurrNMTState_U8").tpdo().default(0x1C),
    u8_(0x1F93, "NodeID_U8").sub(1),
    EntryDef::ro(0x1F93, DataType::Bool, "NodeIDByHW_BOOL").sub(2),
    EntryDef::constant(0x1F98, DataType::U16, "IsochrTxMaxPayload_U16")
        .sub(1)
        .default(LIMIT_MAX),
    EntryDef::constant(0x1F98, DataType::U16, "IsochrRxMaxPayload_U16")
        .sub(2)
        .default(LIMIT_MAX),
    EntryDef::constant(0x1F98, DataType::U32, "PResMaxLatency_U32").sub(3), // ns
    EntryDef::rws(0x1F98, DataType::U16, "PReqActPayloadLimit_U16")
        .sub(4)
        .default(LIMIT_MIN)
        .limits(LIMIT_MIN, LIMIT_MAX),
    EntryDef::rws(0x1F98, DataType::U16, "PResActPayloadLimit_U16")
        .sub(5)
        .default(LIMIT_MIN)
        .limits(LIMIT_MIN, LIMIT_MAX),
    EntryDef::constant(0x1F98, DataType::U32, "ASndMaxLatency_U32").sub(6), // ns
    EntryDef::rws(0x1F98, DataType::U8, "MultiplCycleCnt_U8").sub(7),
    EntryDef::rws(0x1F98, DataType::U16, "AsyncMTU_U16")
        .sub(8)
        .default(300)
        .limits(300, 1500),
    EntryDef::rws(0x1F98, DataType::U16, "Prescaler_U16")
        .sub(9)
        .default(2)
        .limits(0, 1000),
    EntryDef::rws(0x1F99, DataType::U32, "NMT_CNBasicEthernetTimeout_U32").default(5_000_000), // us
    EntryDef::rws(0x1F9A, DataType::VisibleString, "NMT_HostName_VSTR").capacity(HOST_NAME_LEN as u16),
    EntryDef::rw(0x1F9E, DataType::U8, "NMT_ResetCmd_U8").default(0xFF),
];

/// Lines a [`Dictionary`] needs for [`COMMUNICATION_PROFILE`]; add [`obd::lines_of`] of the device's table.
pub const COMMUNICATION_ENTRIES: usize = obd::lines_of(COMMUNICATION_PROFILE);
/// Octets a [`Dictionary`] needs for [`COMMUNICATION_PROFILE`]; add [`obd::octets_of`] of the device's table.
pub const COMMUNICATION_BYTES: usize = obd::octets_of(COMMUNICATION_PROFILE);

/// Handles of the objects that the node itself uses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Keys {
    pub(super) device_type: Key<u32>,
    pub(super) error_register: Key<u8>,
    pub(super) history_count: Key<u8>,
    pub(super) cycle_us: Key<u32>,
    pub(super) identity: [Key<u32>; 4],
    pub(super) configuration_date: Key<u32>,
    pub(super) configuration_time: Key<u32>,
    pub(super) software_date: Key<u32>,
    pub(super) software_time: Key<u32>,
    pub(super) receive: PdoKeys,
    pub(super) transmit: PdoKeys,
    pub(super) loss_of_soc: CounterKeys,
    pub(super) loss_of_preq: CounterKeys,
    pub(super) soc_tolerance_ns: Key<u32>,
    pub(super) ip_address: Key<u32>,
    pub(super) subnet_mask: Key<u32>,
    pub(super) default_gateway: Key<u32>,
    pub(super) feature_flags: Key<u32>,
    pub(super) nmt_state: Key<u8>,
    pub(super) pres_max_latency_ns: Key<u32>,
    pub(super) async_mtu: Key<u16>,
    pub(super) basic_ethernet_us: Key<u32>,
}

/// Objects of one PDO.
#[derive(Clone, Copy, Debug)]
pub(super) struct PdoKeys {
    pub(super) node: Key<u8>,
    pub(super) version: Key<u8>,
    pub(super) count: Key<u8>,
    pub(super) entries: [Key<u64>; MAPPING_ENTRIES],
    pub(super) payload_limit: Key<u16>,
}

/// Sub-indices 1..3 of a threshold counter.
#[derive(Clone, Copy, Debug)]
pub(super) struct CounterKeys {
    pub(super) cumulative: Key<u32>,
    pub(super) count: Key<u32>,
    pub(super) threshold: Key<u32>,
}

impl Keys {
    pub(super) fn find<const E: usize, const B: usize>(dictionary: &Dictionary<E, B>) -> Result<Keys, CnError> {
        let d = dictionary;
        Ok(Keys {
            device_type: key(d, 0x1000, 0)?,
            error_register: key(d, 0x1001, 0)?,
            history_count: key(d, 0x1003, 0)?,
            cycle_us: key(d, 0x1006, 0)?,
            identity: [
                key(d, 0x1018, 1)?,
                key(d, 0x1018, 2)?,
                key(d, 0x1018, 3)?,
                key(d, 0x1018, 4)?,
            ],
            configuration_date: key(d, 0x1020, 1)?,
            configuration_time: key(d, 0x1020, 2)?,
            software_date: key(d, 0x1F52, 1)?,
            software_time: key(d, 0x1F52, 2)?,
            receive: PdoKeys::find(d, 0x1400, 0x1600, 4)?,
            transmit: PdoKeys::find(d, 0x1800, 0x1A00, 5)?,
            loss_of_soc: CounterKeys::find(d, 0x1C0B)?,
            loss_of_preq: CounterKeys::find(d, 0x1C0D)?,
            soc_tolerance_ns: key(d, 0x1C14, 0)?,
            ip_address: key(d, 0x1E40, 2)?,
            subnet_mask: key(d, 0x1E40, 3)?,
            default_gateway: key(d, 0x1E40, 5)?,
            feature_flags: key(d, 0x1F82, 0)?,
            nmt_state: key(d, 0x1F8C, 0)?,
            pres_max_latency_ns: key(d, 0x1F98, 3)?,
            async_mtu: key(d, 0x1F98, 8)?,
            basic_ethernet_us: key(d, 0x1F99, 0)?,
        })
    }
}

impl PdoKeys {
    fn find<const E: usize, const B: usize>(
        dictionary: &Dictionary<E, B>,
        communication: u16,
        mapping: u16,
        limit_sub: u8,
    ) -> Result<PdoKeys, CnError> {
        let first = key(dictionary, mapping, 1)?;
        let mut entries = [first; MAPPING_ENTRIES];
        for (sub, entry) in (1..).zip(&mut entries) {
            *entry = key(dictionary, mapping, sub)?;
        }
        Ok(PdoKeys {
            node: key(dictionary, communication, 1)?,
            version: key(dictionary, communication, 2)?,
            count: key(dictionary, mapping, 0)?,
            entries,
            payload_limit: key(dictionary, 0x1F98, limit_sub)?,
        })
    }
}

impl CounterKeys {
    fn find<const E: usize, const B: usize>(dictionary: &Dictionary<E, B>, index: u16) -> Result<CounterKeys, CnError> {
        Ok(CounterKeys {
            cumulative: key(dictionary, index, 1)?,
            count: key(dictionary, index, 2)?,
            threshold: key(dictionary, index, 3)?,
        })
    }
}

fn key<T: Scalar, const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    index: u16,
    sub: u8,
) -> Result<Key<T>, CnError> {
    dictionary
        .key(index, sub)
        .map_err(|code| CnError::Object { index, sub, code })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_constants_say_what_the_table_needs() {
        let dictionary =
            Dictionary::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&[COMMUNICATION_PROFILE]).unwrap();
        assert_eq!(dictionary.used(), (COMMUNICATION_ENTRIES, COMMUNICATION_BYTES));
        Keys::find(&dictionary).unwrap();
    }

    #[test]
    fn defaults_of_the_reference_dictionary() {
        let dictionary =
            Dictionary::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&[COMMUNICATION_PROFILE]).unwrap();
        let read = |index, sub| dictionary.read(index, sub).unwrap();
        assert_eq!(read(0x1300, 0), [0x98, 0x3A, 0, 0]);
        assert_eq!(read(0x1C0B, 3), [15, 0, 0, 0]);
        assert_eq!(read(0x1C14, 0), [0xA0, 0x86, 1, 0]);
        assert_eq!(read(0x1E40, 5), [0xFE, 0x64, 0xA8, 0xC0]);
        assert_eq!(read(0x1F83, 0), [0x20]);
        assert_eq!(read(0x1F98, 0), [9]);
        assert_eq!(read(0x1F98, 4), [36, 0]);
        assert_eq!(read(0x1F98, 8), [0x2C, 0x01]);
        assert_eq!(read(0x1F99, 0), [0x40, 0x4B, 0x4C, 0x00]);
        assert_eq!(read(0x1F9E, 0), [0xFF]);
        assert_eq!(read(0x1600, 0), [0]);
    }
}
