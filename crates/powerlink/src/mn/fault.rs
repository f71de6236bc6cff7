//! Why a controlled node was given up, in one value: from it follow the event, the error code in the ResetNode and the words.
//!
//! In:  what the boot-up or the watch of a node found. Out: the same for the wire, the application and people.

use core::fmt;

use obd::AbortCode;

use super::config::Stamp;
use super::event::{IdentityField, MnEvent};
use crate::nmt::NmtState;
use crate::sdo::ClientError;
use crate::sdo::command::Address;

/// Error codes sent in the data of a ResetNode.
pub(super) mod reset_reason {
    /// The application or the boot-up asks for it.
    pub(in crate::mn) const NONE: u16 = 0;
    /// E_NMT_BPO1_DEVICE_TYPE.
    pub(in crate::mn) const DEVICE_TYPE: u16 = 0x8422;
    /// E_NMT_BPO1_VENDOR_ID.
    pub(in crate::mn) const VENDOR_ID: u16 = 0x8423;
    /// E_NMT_BPO1_PRODUCT_CODE.
    pub(in crate::mn) const PRODUCT_CODE: u16 = 0x8424;
    /// E_NMT_BPO1_REVISION_NO.
    pub(in crate::mn) const REVISION: u16 = 0x8425;
    /// E_NMT_BPO1_SERIAL_NO.
    pub(in crate::mn) const SERIAL: u16 = 0x8426;
    /// E_NMT_BPO1_SW_UPDATE.
    pub(in crate::mn) const SOFTWARE: u16 = 0x842B;
    /// E_NMT_BPO2: a step of the boot-up failed.
    pub(in crate::mn) const BOOT_FAILED: u16 = 0x8430;
    /// E_DLL_LOSS_PRES_TH.
    pub(in crate::mn) const LOSS_OF_PRES: u16 = 0x8243;
    /// E_NMT_NO_STATUS_RES.
    pub(in crate::mn) const NO_STATUS_RESPONSE: u16 = 0xF002;
    /// E_NMT_WRONG_STATE.
    pub(in crate::mn) const WRONG_STATE: u16 = 0x8480;
}

/// Why a node was given up. It is booted again by itself in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It is not what it shall be.
    WrongIdentity {
        /// The first value that differs.
        field: IdentityField,
        /// As configured (0x1F84..0x1F88).
        expected: u32,
        /// The value that the node reported.
        got: u32,
    },
    /// Its software is not the expected one.
    WrongSoftware {
        /// As configured (0x1F53, 0x1F54).
        expected: Stamp,
        /// As reported (0x1F52/1, /2).
        got: Stamp,
    },
    /// It refused a value of its configuration.
    ConfigurationRefused {
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
        /// Abort code that it answered with.
        code: AbortCode,
    },
    /// A value of its configuration could not be written.
    ConfigurationFailed {
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
        /// What went wrong.
        error: ClientError,
    },
    /// An object has another value than it shall have.
    WrongValue {
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
        /// As configured ([`super::NodeConfig::expected`]).
        expected: u32,
        /// The value that was read, of the bits that count.
        got: u32,
    },
    /// A step of the boot-up took too long.
    BootTimeout {
        /// The NMT state it should have reached.
        expected: NmtState,
        /// The one it reported last.
        got: NmtState,
    },
    /// It did not take its time in the PRes chain.
    ChainFailed {
        /// SyncRequests without the right answer.
        requests: u32,
        /// The NMT state it reported last.
        got: NmtState,
    },
    /// Polls stayed unanswered.
    PresLost {
        /// So many in a row.
        in_row: u32,
    },
    /// StatusRequests stayed unanswered, and it was not polled.
    StatusLost {
        /// So many in a row.
        in_row: u32,
    },
    /// It was in a wrong NMT state for longer than the tolerance.
    WrongState {
        /// The state it should be in.
        expected: NmtState,
        /// The state it reported.
        got: NmtState,
    },
}

impl Fault {
    /// The event that tells the application.
    pub(super) fn event(self, node: u8) -> MnEvent {
        match self {
            Fault::WrongIdentity { field, expected, got } => MnEvent::IdentityMismatch {
                node,
                field,
                expected,
                got,
            },
            Fault::WrongSoftware { expected, got } => MnEvent::SoftwareMismatch { node, expected, got },
            Fault::ConfigurationRefused { index, sub, code } => MnEvent::SdoAbort { node, index, sub, code },
            Fault::ConfigurationFailed { index, sub, .. } => MnEvent::SdoFailed { node, index, sub },
            Fault::WrongValue {
                index,
                sub,
                expected,
                got,
            } => MnEvent::ValueMismatch {
                node,
                index,
                sub,
                expected,
                got,
            },
            Fault::BootTimeout { expected, got } => MnEvent::BootTimeout { node, expected, got },
            Fault::ChainFailed { got, .. } => MnEvent::BootTimeout {
                node,
                expected: NmtState::PreOperational2,
                got,
            },
            Fault::PresLost { in_row } | Fault::StatusLost { in_row } => MnEvent::Lost { node, in_row },
            Fault::WrongState { expected, got } => MnEvent::WrongState { node, expected, got },
        }
    }

    /// The error code of the profile: for the ResetNode, and for the error history.
    pub fn error_code(self) -> u16 {
        match self {
            Fault::WrongIdentity { field, .. } => match field {
                IdentityField::DeviceType => reset_reason::DEVICE_TYPE,
                IdentityField::VendorId => reset_reason::VENDOR_ID,
                IdentityField::ProductCode => reset_reason::PRODUCT_CODE,
                IdentityField::Revision => reset_reason::REVISION,
                IdentityField::Serial => reset_reason::SERIAL,
            },
            Fault::WrongSoftware { .. } => reset_reason::SOFTWARE,
            Fault::ConfigurationRefused { .. }
            | Fault::ConfigurationFailed { .. }
            | Fault::WrongValue { .. }
            | Fault::BootTimeout { .. }
            | Fault::ChainFailed { .. } => reset_reason::BOOT_FAILED,
            Fault::PresLost { .. } => reset_reason::LOSS_OF_PRES,
            Fault::StatusLost { .. } => reset_reason::NO_STATUS_RESPONSE,
            Fault::WrongState { .. } => reset_reason::WRONG_STATE,
        }
    }
}

/// A value that was expected or found, worded as in the machine file and on type plates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultValue {
    /// Of an identity.
    Identity(IdentityField, u32),
    /// Of the software.
    Software(Stamp),
    /// Of another object.
    Number(u32),
    /// An NMT state.
    State(NmtState),
    /// What an SDO was answered with.
    Abort(AbortCode),
}

impl fmt::Display for FaultValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            // As printed on the type plate.
            FaultValue::Identity(IdentityField::Serial, number) => number.fmt(f),
            FaultValue::Identity(_, number) | FaultValue::Number(number) | FaultValue::Abort(AbortCode(number)) => {
                write!(f, "0x{number:08X}")
            }
            FaultValue::Software(Stamp { date, time }) => write!(f, "{date} d {time} ms"),
            FaultValue::State(state) => state.fmt(f),
        }
    }
}

impl Fault {
    /// The object that it is about.
    pub fn object(self) -> Option<Address> {
        let (index, sub) = match self {
            Fault::WrongIdentity { field, .. } => field.object(),
            Fault::WrongSoftware { .. } => (0x1F52, 0),
            Fault::ConfigurationRefused { index, sub, .. }
            | Fault::ConfigurationFailed { index, sub, .. }
            | Fault::WrongValue { index, sub, .. } => (index, sub),
            Fault::BootTimeout { .. } | Fault::WrongState { .. } => (0x1F8C, 0),
            Fault::ChainFailed { .. } | Fault::PresLost { .. } | Fault::StatusLost { .. } => return None,
        };
        Some(Address { index, sub })
    }

    /// The value that was expected.
    pub fn expected(self) -> Option<FaultValue> {
        match self {
            Fault::WrongIdentity { field, expected, .. } => Some(FaultValue::Identity(field, expected)),
            Fault::WrongSoftware { expected, .. } => Some(FaultValue::Software(expected)),
            Fault::WrongValue { expected, .. } => Some(FaultValue::Number(expected)),
            Fault::BootTimeout { expected, .. } | Fault::WrongState { expected, .. } => {
                Some(FaultValue::State(expected))
            }
            Fault::ConfigurationRefused { .. }
            | Fault::ConfigurationFailed { .. }
            | Fault::ChainFailed { .. }
            | Fault::PresLost { .. }
            | Fault::StatusLost { .. } => None,
        }
    }

    /// The value that was found in its place.
    pub fn found(self) -> Option<FaultValue> {
        match self {
            Fault::WrongIdentity { field, got, .. } => Some(FaultValue::Identity(field, got)),
            Fault::WrongSoftware { got, .. } => Some(FaultValue::Software(got)),
            Fault::WrongValue { got, .. } => Some(FaultValue::Number(got)),
            Fault::ConfigurationRefused { code, .. } => Some(FaultValue::Abort(code)),
            Fault::BootTimeout { got, .. } | Fault::WrongState { got, .. } => Some(FaultValue::State(got)),
            Fault::ConfigurationFailed { .. }
            | Fault::ChainFailed { .. }
            | Fault::PresLost { .. }
            | Fault::StatusLost { .. } => None,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Fault::WrongIdentity { field, expected, got } => {
                let (index, sub) = field.object();
                let [got, expected] = [got, expected].map(|number| FaultValue::Identity(field, number));
                write!(f, "{} {field} is {got}, expected {expected}", Address { index, sub })
            }
            Fault::WrongSoftware { expected, got } => {
                let [got, expected] = [got, expected].map(FaultValue::Software);
                write!(f, "0x1F52 software date and time is {got}, expected {expected}")
            }
            Fault::ConfigurationRefused { index, sub, code } => write!(
                f,
                "refused the configured value of {}: {} (0x{:08X})",
                Address { index, sub },
                code.text(),
                code.0
            ),
            Fault::ConfigurationFailed { index, sub, error } => {
                write!(f, "{} could not be written: {error}", Address { index, sub })
            }
            Fault::WrongValue {
                index,
                sub,
                expected,
                got,
            } => {
                let [got, expected] = [got, expected].map(FaultValue::Number);
                write!(f, "{} is {got}, expected {expected}", Address { index, sub })
            }
            Fault::BootTimeout { expected, got } => write!(f, "still {got}, expected {expected} by now"),
            Fault::ChainFailed { requests, got } => write!(
                f,
                "did not take its time in the PRes chain: {requests} SyncRequests without the right answer, in {got}"
            ),
            Fault::PresLost { in_row } => write!(f, "lost: {in_row} polls in a row without an answer"),
            Fault::StatusLost { in_row } => write!(f, "lost: {in_row} StatusRequests in a row without an answer"),
            Fault::WrongState { expected, got } => write!(f, "is in {got}, expected {expected}"),
        }
    }
}

impl IdentityField {
    /// The object of the node that holds the value.
    pub fn object(self) -> (u16, u8) {
        match self {
            IdentityField::DeviceType => (0x1000, 0),
            IdentityField::VendorId => (0x1018, 1),
            IdentityField::ProductCode => (0x1018, 2),
            IdentityField::Revision => (0x1018, 3),
            IdentityField::Serial => (0x1018, 4),
        }
    }
}

impl fmt::Display for IdentityField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            IdentityField::DeviceType => "device type",
            IdentityField::VendorId => "vendor id",
            IdentityField::ProductCode => "product code",
            IdentityField::Revision => "revision number",
            IdentityField::Serial => "serial number",
        })
    }
}
