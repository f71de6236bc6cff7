//! Error codes of the communication profile with their names, as they stand in error entries (0x1003, StatusResponse) and in
//! the data of a ResetNode.
//!
//! In:  a code. Out: its name in the standard and what it says. Codes of device profiles (such as CiA 402) are not here.

use core::fmt;

use crate::wire::ErrorEntry;

/// One code of the communication profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorCode {
    /// As in the entry.
    pub code: u16,
    /// Name in the standard.
    pub name: &'static str,
    /// What has happened.
    pub text: &'static str,
}

const fn line(code: u16, name: &'static str, text: &'static str) -> ErrorCode {
    ErrorCode { code, name, text }
}

/// All codes, ascending.
pub const ERROR_CODES: [ErrorCode; 45] = [
    line(
        0x8161,
        "E_DLL_BAD_PHYS_MODE",
        "wrong speed or duplex of the Ethernet port",
    ),
    line(0x8162, "E_DLL_COLLISION", "a collision on the wire"),
    line(0x8163, "E_DLL_COLLISION_TH", "too many collisions"),
    line(0x8164, "E_DLL_CRC_TH", "too many frames with a wrong check sum"),
    line(0x8165, "E_DLL_LOSS_OF_LINK", "no link at the Ethernet port"),
    line(0x8166, "E_DLL_MAC_BUFFER", "the Ethernet controller ran out of buffers"),
    line(0x8201, "E_DLL_ADDRESS_CONFLICT", "another node has the same node id"),
    line(0x8202, "E_DLL_MULTIPLE_MN", "another managing node is on the wire"),
    line(0x8210, "E_PDO_SHORT_RX", "process data are shorter than their mapping"),
    line(0x8211, "E_PDO_MAP_VERS", "process data have another mapping version"),
    line(
        0x8212,
        "E_NMT_ASND_MTU_DIF",
        "nodes disagree about the longest asynchronous frame",
    ),
    line(
        0x8213,
        "E_NMT_ASND_MTU_LIM",
        "the longest asynchronous frame is out of range",
    ),
    line(
        0x8214,
        "E_NMT_ASND_TX_LIM",
        "an asynchronous frame is too long to be sent",
    ),
    line(0x8231, "E_NMT_CYCLE_LEN", "the cycle length does not fit"),
    line(0x8232, "E_DLL_CYCLE_EXCEED", "a cycle was not over in time"),
    line(0x8233, "E_DLL_CYCLE_EXCEED_TH", "too many cycles were not over in time"),
    line(0x8234, "E_NMT_IDLE_LIM", "too little time is left in the cycle"),
    line(0x8235, "E_DLL_JITTER_TH", "the start of the cycle jitters too much"),
    line(0x8236, "E_DLL_LATE_PRES_TH", "too many late answers to polls"),
    line(0x8237, "E_NMT_PREQ_CN", "a poll to a node that is not configured"),
    line(0x8238, "E_NMT_PREQ_LIM", "a poll is longer than its limit"),
    line(
        0x8239,
        "E_NMT_PRES_CN",
        "process data from a node that is not configured",
    ),
    line(
        0x823A,
        "E_NMT_PRES_RX_LIM",
        "received process data are longer than their limit",
    ),
    line(
        0x823B,
        "E_NMT_PRES_TX_LIM",
        "process data to be sent are longer than their limit",
    ),
    line(0x8241, "E_DLL_INVALID_FORMAT", "a frame of wrong format"),
    line(0x8242, "E_DLL_LOSS_PREQ_TH", "too many polls were missed"),
    line(0x8243, "E_DLL_LOSS_PRES_TH", "too many answers to polls were missed"),
    line(
        0x8244,
        "E_DLL_LOSS_SOA_TH",
        "too many starts of the asynchronous phase were missed",
    ),
    line(0x8245, "E_DLL_LOSS_SOC_TH", "too many starts of cycle were missed"),
    line(0x8410, "E_NMT_BA1", "another managing node is active"),
    line(0x8411, "E_NMT_BA1_NO_MN_SUPPORT", "the node cannot be a managing node"),
    line(0x8420, "E_NMT_BPO1", "boot-up failed in PRE_OPERATIONAL_1"),
    line(0x8421, "E_NMT_BPO1_GET_IDENT", "no answer to the IdentRequest"),
    line(0x8422, "E_NMT_BPO1_DEVICE_TYPE", "wrong device type"),
    line(0x8423, "E_NMT_BPO1_VENDOR_ID", "wrong vendor id"),
    line(0x8424, "E_NMT_BPO1_PRODUCT_CODE", "wrong product code"),
    line(0x8425, "E_NMT_BPO1_REVISION_NO", "wrong revision number"),
    line(0x8426, "E_NMT_BPO1_SERIAL_NO", "wrong serial number"),
    line(
        0x8428,
        "E_NMT_BPO1_CF_VERIFY",
        "the configuration is not the expected one",
    ),
    line(0x842B, "E_NMT_BPO1_SW_UPDATE", "the software is not the expected one"),
    line(0x8430, "E_NMT_BPO2", "boot-up failed in PRE_OPERATIONAL_2"),
    line(0x8440, "E_NMT_BRO", "boot-up failed in READY_TO_OPERATE"),
    line(0x8480, "E_NMT_WRONG_STATE", "the node is in a wrong NMT state"),
    line(0xF001, "E_NMT_NO_IDENT_RES", "no answer to IdentRequests"),
    line(0xF002, "E_NMT_NO_STATUS_RES", "no answer to StatusRequests"),
];

impl ErrorCode {
    /// The code's line; `None` for codes of other profiles.
    pub fn find(code: u16) -> Option<&'static ErrorCode> {
        let at = ERROR_CODES.binary_search_by_key(&code, |line| line.code).ok()?;
        Some(&ERROR_CODES[at])
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h {}: {}", self.code, self.name, self.text)
    }
}

/// Profile number in the entry type: codes of the vendor.
const PROFILE_VENDOR: u16 = 1;
/// Profile number in the entry type: codes of the communication profile.
const PROFILE_COMMUNICATION: u16 = 2;

impl fmt::Display for ErrorEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let happened = match self.entry_type & 0x3000 {
            0x1000 => "active",
            0x2000 => "cleared",
            0x3000 => "occurred",
            _ => "end of list",
        };
        match (self.entry_type & 0x0FFF, ErrorCode::find(self.code)) {
            (PROFILE_COMMUNICATION, Some(line)) => write!(f, "{line} ({happened})"),
            (PROFILE_COMMUNICATION, None) => write!(f, "{:04X}h of the communication profile ({happened})", self.code),
            (PROFILE_VENDOR, _) => write!(f, "{:04X}h of the vendor ({happened})", self.code),
            (profile, _) => write!(f, "{:04X}h of device profile {profile} ({happened})", self.code),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn codes_ascend_and_are_found() {
        assert!(ERROR_CODES.windows(2).all(|pair| pair[0].code < pair[1].code));
        for line in &ERROR_CODES {
            assert_eq!(ErrorCode::find(line.code), Some(line));
            assert!(line.name.starts_with("E_") && !line.text.is_empty());
        }
        assert_eq!(ErrorCode::find(0x7305), None, "of the drive profile");
        assert_eq!(
            ErrorCode::find(0x8243).unwrap().to_string(),
            "8243h E_DLL_LOSS_PRES_TH: too many answers to polls were missed"
        );
    }

    #[test]
    fn entries_say_whose_code_it_is() {
        let entry = |entry_type, code| ErrorEntry {
            entry_type,
            code,
            ..ErrorEntry::default()
        };
        // The entry of another vendor's stack in a recorded boot.
        assert_eq!(
            entry(0x3002, 0x8232).to_string(),
            "8232h E_DLL_CYCLE_EXCEED: a cycle was not over in time (occurred)"
        );
        assert_eq!(
            entry(0x1192, 0x7305).to_string(),
            "7305h of device profile 402 (active)"
        );
        assert_eq!(entry(0x2001, 0x0001).to_string(), "0001h of the vendor (cleared)");
        assert_eq!(
            entry(0x3002, 0x9999).to_string(),
            "9999h of the communication profile (occurred)"
        );
    }
}
