//! What an SDO server serves.

use crate::AbortCode;

/// What an SDO server reads and writes: a plain [`Dictionary`](crate::Dictionary), or a node that adds effects to some of its objects.
///
/// A value passes as a whole unless the object says otherwise: the server collects what comes in several frames and calls
/// [`sdo_write`](Objects::sdo_write) at the end, so that half a value is never seen. An object too large for the server's
/// buffer, such as a program of one MiB, passes in parts: it answers [`sdo_read_parts`](Objects::sdo_read_parts) or
/// [`sdo_write_parts`](Objects::sdo_write_parts) and keeps the parts apart from its value until
/// [`sdo_write_end`](Objects::sdo_write_end) itself.
pub trait Objects {
    /// Copies the value to the start of `out` and returns its length.
    ///
    /// # Errors
    /// The abort code that the SDO is answered with; [`AbortCode::OUT_OF_MEMORY`] when `out` is too short.
    fn sdo_read(&mut self, index: u16, sub: u8, out: &mut [u8]) -> Result<usize, AbortCode>;

    /// Takes a value from the network; either stored as a whole, or refused and nothing changed.
    ///
    /// # Errors
    /// The abort code that the SDO is answered with; nothing has changed then.
    fn sdo_write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode>;

    /// A read begins. `Some`: octets of a value that is fetched by [`sdo_read_part`](Objects::sdo_read_part).
    ///
    /// # Errors
    /// The abort code that the SDO is answered with.
    fn sdo_read_parts(&mut self, index: u16, sub: u8) -> Result<Option<usize>, AbortCode> {
        let _ = (index, sub);
        Ok(None)
    }

    /// Fills `out` with the octets of the value from `offset` on. Each is asked for once, in order.
    ///
    /// # Errors
    /// The abort code that ends the transfer.
    fn sdo_read_part(&mut self, index: u16, sub: u8, offset: usize, out: &mut [u8]) -> Result<(), AbortCode> {
        let _ = (index, sub, offset, out);
        Err(AbortCode::UNSUPPORTED_ACCESS)
    }

    /// A write of `len` octets that come in several frames begins; an unfinished one before it is void. `true`: they are handed
    /// over by [`sdo_write_part`](Objects::sdo_write_part). What can be refused now need not be sent.
    ///
    /// # Errors
    /// The abort code that the SDO is answered with.
    fn sdo_write_parts(&mut self, index: u16, sub: u8, len: usize) -> Result<bool, AbortCode> {
        let _ = (index, sub, len);
        Ok(false)
    }

    /// Takes the octets from `offset` on; they come once and in order.
    ///
    /// # Errors
    /// The abort code that ends the transfer.
    fn sdo_write_part(&mut self, index: u16, sub: u8, offset: usize, part: &[u8]) -> Result<(), AbortCode> {
        let _ = (index, sub, offset, part);
        Err(AbortCode::UNSUPPORTED_ACCESS)
    }

    /// All parts were handed over: the new value becomes valid, or is refused and nothing changed.
    ///
    /// # Errors
    /// The abort code that the SDO is answered with; nothing has changed then.
    fn sdo_write_end(&mut self, index: u16, sub: u8) -> Result<(), AbortCode> {
        let _ = (index, sub);
        Err(AbortCode::UNSUPPORTED_ACCESS)
    }

    /// The write in parts has broken off: what came is void.
    fn sdo_write_cancel(&mut self, index: u16, sub: u8) {
        let _ = (index, sub);
    }
}
