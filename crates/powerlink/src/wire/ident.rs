//! IdentResponse: what a node is, the answer to an IdentRequest.

use super::header::{EPL_VERSION, Requests, WireError, array, check_len, put, u16_at, u32_at};
use crate::nmt::NmtState;

/// Octets of an IdentResponse without FCS.
pub const IDENT_RESPONSE_LEN: usize = 176;

/// Identity, lengths and features of a node: IdentResponse (DS 301 ch. 7.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdentResponse {
    /// PR and RS: asynchronous requests waiting at the sender.
    pub requests: Requests,
    /// State of the sender.
    pub nmt_state: NmtState,
    /// Protocol version, 0x20.
    pub epl_version: u8,
    /// Object 0x1F82.
    pub feature_flags: u32,
    /// AsyncMTU, object 0x1F98/8, in octets.
    pub mtu: u16,
    /// PReqActPayloadLimit, object 0x1F98/4, in octets.
    pub poll_in_size: u16,
    /// PResActPayloadLimit, object 0x1F98/5, in octets.
    pub poll_out_size: u16,
    /// PResMaxLatency, object 0x1F98/3, in ns.
    pub response_time_ns: u32,
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
    /// Free for the vendor.
    pub vendor_extension_1: [u8; 8],
    /// Object 0x1020/1: date of the configuration the node holds.
    pub configuration_date: u32,
    /// Object 0x1020/2: time of the configuration the node holds.
    pub configuration_time: u32,
    /// Object 0x1F52/1.
    pub software_date: u32,
    /// Object 0x1F52/2.
    pub software_time: u32,
    /// 192.168.100.1 is 0xC0A8_6401; sent little endian like every number.
    pub ip_address: u32,
    /// Written as `ip_address` is.
    pub subnet_mask: u32,
    /// Written as `ip_address` is.
    pub default_gateway: u32,
    /// Object 0x1F9A, padded with zeros.
    pub host_name: [u8; 32],
    /// Free for the vendor.
    pub vendor_extension_2: [u8; 48],
}

impl Default for IdentResponse {
    fn default() -> Self {
        IdentResponse {
            requests: Requests::default(),
            nmt_state: NmtState::PreOperational1,
            epl_version: EPL_VERSION,
            feature_flags: 0,
            mtu: 300,
            poll_in_size: 36,
            poll_out_size: 36,
            response_time_ns: 0,
            device_type: 0,
            vendor_id: 0,
            product_code: 0,
            revision: 0,
            serial: 0,
            vendor_extension_1: [0; 8],
            configuration_date: 0,
            configuration_time: 0,
            software_date: 0,
            software_time: 0,
            ip_address: 0,
            subnet_mask: 0,
            default_gateway: 0,
            host_name: [0; 32],
            vendor_extension_2: [0; 48],
        }
    }
}

impl IdentResponse {
    pub(super) fn parse(frame: &[u8]) -> Result<IdentResponse, WireError> {
        check_len(frame, IDENT_RESPONSE_LEN)?;
        Ok(IdentResponse {
            requests: Requests::from_octet(frame[19]),
            nmt_state: NmtState::from(frame[20]),
            epl_version: frame[22],
            feature_flags: u32_at(frame, 24),
            mtu: u16_at(frame, 28),
            poll_in_size: u16_at(frame, 30),
            poll_out_size: u16_at(frame, 32),
            response_time_ns: u32_at(frame, 34),
            device_type: u32_at(frame, 40),
            vendor_id: u32_at(frame, 44),
            product_code: u32_at(frame, 48),
            revision: u32_at(frame, 52),
            serial: u32_at(frame, 56),
            vendor_extension_1: array(frame, 60),
            configuration_date: u32_at(frame, 68),
            configuration_time: u32_at(frame, 72),
            software_date: u32_at(frame, 76),
            software_time: u32_at(frame, 80),
            ip_address: u32_at(frame, 84),
            subnet_mask: u32_at(frame, 88),
            default_gateway: u32_at(frame, 92),
            host_name: array(frame, 96),
            vendor_extension_2: array(frame, 128),
        })
    }

    /// Writes octets 18..176; the caller has zeroed them and checked the length.
    pub(super) fn write(&self, frame: &mut [u8]) {
        frame[19] = self.requests.to_octet();
        frame[20] = self.nmt_state.into();
        frame[22] = self.epl_version;
        put(frame, 24, self.feature_flags.to_le_bytes());
        put(frame, 28, self.mtu.to_le_bytes());
        put(frame, 30, self.poll_in_size.to_le_bytes());
        put(frame, 32, self.poll_out_size.to_le_bytes());
        put(frame, 34, self.response_time_ns.to_le_bytes());
        put(frame, 40, self.device_type.to_le_bytes());
        put(frame, 44, self.vendor_id.to_le_bytes());
        put(frame, 48, self.product_code.to_le_bytes());
        put(frame, 52, self.revision.to_le_bytes());
        put(frame, 56, self.serial.to_le_bytes());
        put(frame, 60, self.vendor_extension_1);
        put(frame, 68, self.configuration_date.to_le_bytes());
        put(frame, 72, self.configuration_time.to_le_bytes());
        put(frame, 76, self.software_date.to_le_bytes());
        put(frame, 80, self.software_time.to_le_bytes());
        put(frame, 84, self.ip_address.to_le_bytes());
        put(frame, 88, self.subnet_mask.to_le_bytes());
        put(frame, 92, self.default_gateway.to_le_bytes());
        put(frame, 96, self.host_name);
        put(frame, 128, self.vendor_extension_2);
    }
}
