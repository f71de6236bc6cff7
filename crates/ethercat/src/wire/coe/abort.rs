//! Abort codes of CoE that POWERLINK does not have, or means otherwise.

use obd::AbortCode;

/// The toggle bit of a segment is wrong; reserved in POWERLINK.
pub const TOGGLE: AbortCode = AbortCode::RESERVED;
/// Entries cannot be written while sub-index 0 is not 0.
pub const SUB_0_NOT_ZERO: AbortCode = AbortCode(0x0601_0003);
/// The object does not support complete access.
pub const NO_COMPLETE_ACCESS: AbortCode = AbortCode(0x0601_0004);
/// The value is longer than the mailbox.
pub const EXCEEDS_MAILBOX: AbortCode = AbortCode(0x0601_0005);
/// The object is mapped, and so cannot be written.
pub const MAPPED: AbortCode = AbortCode(0x0601_0006);

/// One sentence for people, of every code that a device may send.
pub const fn text(code: AbortCode) -> &'static str {
    match code {
        TOGGLE => "toggle bit not alternated",
        SUB_0_NOT_ZERO => "sub-index cannot be written while sub-index 0 is not 0",
        NO_COMPLETE_ACCESS => "object does not support complete access",
        EXCEEDS_MAILBOX => "object is longer than the mailbox",
        MAPPED => "object is mapped in a PDO, write refused",
        other => other.text(),
    }
}
