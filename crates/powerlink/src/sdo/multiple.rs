//! Several objects in one command: the data of WriteMultipleByIndex and ReadMultipleByIndex.
//!
//! In and out: command data. A block is: offset of the next block u32 (0: this is the last), index u16, sub-index u8, flags u8
//! (bit 7: the data are an abort code; bits 0 and 1: octets of padding), data padded to a multiple of four octets.
//!
//! | | command data |
//! |---|---|
//! | request to write, answer to read | blocks |
//! | request to read | object addresses |
//! | answer to write | for each object that was refused: address with flag bit 7, abort code u32 |
//!
//! Offsets count from the command header, as if all data stood in one frame.

use obd::AbortCode;

use super::command::{self, ADDRESS_LEN, Address};

/// Octets of a block in front of its data.
pub const BLOCK_HEADER_LEN: usize = 8;
/// Octets of a refusal in the answer to a write.
pub const FAILURE_LEN: usize = 8;

const FLAG_ABORT: u8 = 0x80;
const PADDING: u8 = 0x03;

/// One object of a block list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block<'a> {
    /// Object that is read or written.
    pub address: Address,
    /// Its value; `Err`: why it could not be read.
    pub value: Result<&'a [u8], AbortCode>,
}

/// Reads a list of blocks; ends after the first one that cannot be read, which it gives as [`AbortCode::BLOCK_SIZE`]. Never
/// panics.
#[derive(Clone, Debug)]
pub struct Blocks<'a> {
    data: &'a [u8],
    /// Where the next block begins.
    at: Option<usize>,
}

impl<'a> Blocks<'a> {
    /// Over command data; without any, there are no blocks.
    pub fn new(data: &'a [u8]) -> Blocks<'a> {
        let at = (!data.is_empty()).then_some(0);
        Blocks { data, at }
    }

    /// Where the block that comes next begins.
    pub(super) fn position(&self) -> Option<usize> {
        self.at
    }

    /// Goes on at a place that [`position`](Self::position) gave.
    pub(super) fn resume(data: &'a [u8], at: Option<usize>) -> Blocks<'a> {
        Blocks { data, at }
    }

    fn read(&mut self, at: usize) -> Option<Block<'a>> {
        let (header, _) = self.data.get(at..)?.split_first_chunk::<BLOCK_HEADER_LEN>()?;
        let offset = u32::from_le_bytes([header[0], header[1], header[2], header[3]]) as usize;
        let (address, _) = Address::split(&header[4..])?;
        let flags = header[7];
        let end = if offset == 0 {
            self.data.len()
        } else {
            let next = offset.checked_sub(command::HEADER_LEN)?;
            self.at = Some(next);
            next
        };
        let end = end.checked_sub(usize::from(flags & PADDING))?;
        let value = self.data.get(at + BLOCK_HEADER_LEN..end)?;
        let value = if flags & FLAG_ABORT == 0 {
            Ok(value)
        } else {
            Err(command::abort_code(value)?)
        };
        Some(Block { address, value })
    }
}

impl<'a> Iterator for Blocks<'a> {
    type Item = Result<Block<'a>, AbortCode>;

    fn next(&mut self) -> Option<Self::Item> {
        // Each block begins behind the header of the one before, so the list ends.
        let at = self.at.take()?;
        let block = self.read(at);
        if block.is_none() {
            self.at = None;
        }
        Some(block.ok_or(AbortCode::BLOCK_SIZE))
    }
}

/// Writes a list of blocks.
#[derive(Debug)]
pub struct BlockWriter<'a> {
    octets: &'a mut [u8],
    len: usize,
    /// Where the last block begins.
    last: Option<usize>,
}

impl<'a> BlockWriter<'a> {
    /// Starts with no block.
    pub fn new(octets: &'a mut [u8]) -> BlockWriter<'a> {
        BlockWriter {
            octets,
            len: 0,
            last: None,
        }
    }

    /// Appends an object with its value; `false`: there is no room for it, and nothing was written.
    pub fn push(&mut self, address: Address, value: &[u8]) -> bool {
        self.push_with(address, |out| {
            out.get_mut(..value.len())
                .ok_or(AbortCode::OUT_OF_MEMORY)?
                .copy_from_slice(value);
            Ok(value.len())
        })
        .is_ok()
    }

    /// Appends an object that `write` fills in: it gets the room there is and returns the octets it used. Nothing was appended
    /// when it fails, or when there is no room ([`AbortCode::OUT_OF_MEMORY`]).
    pub(super) fn push_with(
        &mut self,
        address: Address,
        write: impl FnOnce(&mut [u8]) -> Result<usize, AbortCode>,
    ) -> Result<(), AbortCode> {
        let room = self.octets.get_mut(self.len + BLOCK_HEADER_LEN..);
        // Whole words only, so that the padding always fits.
        let room = room.ok_or(AbortCode::OUT_OF_MEMORY)?;
        let words = room.len() & !3;
        let value_len = write(&mut room[..words])?;
        if value_len > words {
            return Err(AbortCode::INTERNAL_INCOMPATIBLE);
        }
        let padded = value_len.next_multiple_of(4);
        room[value_len..padded].fill(0);
        self.close(address, (padded - value_len) as u8, padded);
        Ok(())
    }

    /// Appends why an object could not be read; `false`: there is no room for it.
    pub(super) fn push_abort(&mut self, address: Address, code: AbortCode) -> bool {
        let room = self.octets.get_mut(self.len + BLOCK_HEADER_LEN..);
        let Some(octets) = room.and_then(|room| room.first_chunk_mut()) else {
            return false;
        };
        *octets = code.0.to_le_bytes();
        let data_len = octets.len();
        self.close(address, FLAG_ABORT, data_len);
        true
    }

    /// Writes the header of a block whose data stand in place.
    fn close(&mut self, address: Address, flags: u8, data_len: usize) {
        let at = self.len;
        if let Some(last) = self.last {
            let offset = (at + command::HEADER_LEN) as u32;
            self.octets[last..last + 4].copy_from_slice(&offset.to_le_bytes());
        }
        let header = &mut self.octets[at..at + BLOCK_HEADER_LEN];
        let mut octets = [0; ADDRESS_LEN];
        address.emit(&mut octets);
        octets[3] = flags;
        header[..4].fill(0);
        header[4..].copy_from_slice(&octets);
        self.last = Some(at);
        self.len = at + BLOCK_HEADER_LEN + data_len;
    }

    /// Length in octets of what was pushed.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no block.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}

/// Reads the answer to WriteMultipleByIndex: the objects that were refused, and why. Never panics; octets behind the last whole
/// entry are left out.
pub fn failures(answer: &[u8]) -> impl Iterator<Item = (Address, AbortCode)> + '_ {
    answer.chunks_exact(FAILURE_LEN).filter_map(|entry| {
        let (address, code) = Address::split(entry)?;
        Some((address, command::abort_code(code)?))
    })
}

/// Writes one refusal.
pub(super) fn emit_failure(address: Address, code: AbortCode, out: &mut [u8; FAILURE_LEN]) {
    let mut octets = [0; ADDRESS_LEN];
    address.emit(&mut octets);
    octets[3] = FLAG_ABORT;
    out[..ADDRESS_LEN].copy_from_slice(&octets);
    out[ADDRESS_LEN..].copy_from_slice(&code.0.to_le_bytes());
}

/// Writes the request of ReadMultipleByIndex; returns its length. `None`: `out` is too short.
pub fn emit_addresses(addresses: impl IntoIterator<Item = Address>, out: &mut [u8]) -> Option<usize> {
    let mut len = 0;
    for address in addresses {
        address.emit(out.get_mut(len..)?.first_chunk_mut()?);
        len += ADDRESS_LEN;
    }
    Some(len)
}
