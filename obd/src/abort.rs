//! SDO abort codes: why an access to an object was refused.

use core::fmt;

/// An SDO abort code as sent on the wire; unknown values are kept.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AbortCode(pub u32);

macro_rules! abort_codes {
    ($($(#[$doc:meta])* $name:ident = $value:literal, $text:literal;)*) => {
        impl AbortCode {
            $(#[doc = $text] pub const $name: AbortCode = AbortCode($value);)*

            /// Every code that has a name here.
            pub const ALL: &'static [AbortCode] = &[$(AbortCode::$name),*];

            /// One sentence for people; a fixed text for codes this crate does not know.
            pub const fn text(self) -> &'static str {
                match self.0 {
                    $($value => $text,)*
                    _ => "unknown abort code",
                }
            }
        }
    };
}

abort_codes! {
    RESERVED = 0x0503_0000, "reserved";
    TIME_OUT = 0x0504_0000, "SDO protocol timed out";
    UNKNOWN_COMMAND = 0x0504_0001, "command identifier not valid or unknown";
    BLOCK_SIZE = 0x0504_0002, "invalid block size";
    SEQUENCE_NUMBER = 0x0504_0003, "invalid sequence number";
    OUT_OF_MEMORY = 0x0504_0005, "out of memory";
    UNSUPPORTED_ACCESS = 0x0601_0000, "unsupported access to an object";
    READ_OF_WRITE_ONLY = 0x0601_0001, "attempt to read a write-only object";
    WRITE_OF_READ_ONLY = 0x0601_0002, "attempt to write a read-only object";
    NO_OBJECT = 0x0602_0000, "object does not exist in the object dictionary";
    NOT_MAPPABLE = 0x0604_0041, "object cannot be mapped to the PDO";
    PDO_LENGTH = 0x0604_0042, "number and length of the objects to be mapped exceed the PDO length";
    PARAMETER_INCOMPATIBLE = 0x0604_0043, "general parameter incompatibility";
    HEARTBEAT = 0x0604_0044, "invalid heartbeat declaration";
    INTERNAL_INCOMPATIBLE = 0x0604_0047, "general internal incompatibility in the device";
    HARDWARE = 0x0606_0000, "access failed due to a hardware error";
    LENGTH_MISMATCH = 0x0607_0010, "data type does not match, length of the parameter does not match";
    TOO_LONG = 0x0607_0012, "data type does not match, length of the parameter too high";
    TOO_SHORT = 0x0607_0013, "data type does not match, length of the parameter too low";
    NO_SUB_INDEX = 0x0609_0011, "sub-index does not exist";
    VALUE_RANGE = 0x0609_0030, "value out of range";
    VALUE_TOO_HIGH = 0x0609_0031, "value too high";
    VALUE_TOO_LOW = 0x0609_0032, "value too low";
    MAX_BELOW_MIN = 0x0609_0036, "maximum value is less than minimum value";
    GENERAL = 0x0800_0000, "general error";
    NOT_STORED = 0x0800_0020, "data cannot be transferred or stored to the application";
    LOCAL_CONTROL = 0x0800_0021, "data cannot be transferred or stored because of local control";
    DEVICE_STATE = 0x0800_0022, "data cannot be transferred or stored because of the device state";
    NO_DICTIONARY = 0x0800_0023, "no object dictionary is present";
    NO_CONFIGURATION = 0x0800_0024, "configuration data are empty";
}

impl fmt::Debug for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "AbortCode({:#010x} {})", self.0, self.text())
    }
}

impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#010x} ({})", self.0, self.text())
    }
}

impl core::error::Error for AbortCode {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn codes_are_named_once_and_have_a_text() {
        for (position, code) in AbortCode::ALL.iter().enumerate() {
            assert_ne!(code.text(), "unknown abort code");
            assert!(!AbortCode::ALL[..position].contains(code), "{code:?} stands twice");
        }
        assert_eq!(AbortCode::ALL.len(), 30);
    }

    #[test]
    fn unknown_values_are_kept_and_shown() {
        assert_eq!(AbortCode(0x1234_5678).to_string(), "0x12345678 (unknown abort code)");
        assert_eq!(
            AbortCode::NO_OBJECT.to_string(),
            "0x06020000 (object does not exist in the object dictionary)"
        );
    }
}
