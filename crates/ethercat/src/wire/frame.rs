//! Frames and their datagrams.

use super::{Command, WireError, array, cleared, put, slice, u16_at, u32_at};

/// EtherType of EtherCAT.
pub const ETHER_TYPE: u16 = 0x88A4;
/// Shortest Ethernet frame without FCS; shorter ones are padded with zeros.
pub const FRAME_LEN_MIN: usize = 60;
/// Longest Ethernet frame without FCS.
pub const FRAME_LEN_MAX: usize = 1514;
/// Octets of the Ethernet header and of the frame header behind it.
pub const HEADER_LEN: usize = 16;
/// Octets of a datagram in front of its data.
pub const DATAGRAM_HEADER_LEN: usize = 10;
/// Octets of a datagram beside its data: header and working counter.
pub const DATAGRAM_OVERHEAD: usize = DATAGRAM_HEADER_LEN + 2;
/// Most data that one datagram can carry, in octets.
pub const DATA_MAX: usize = FRAME_LEN_MAX - HEADER_LEN - DATAGRAM_OVERHEAD;
/// Destination of every frame of ours; devices do not look at it.
pub const BROADCAST: Mac = [0xFF; 6];
/// Bit of the first octet of the source address that the first device sets: the frame has been through the network.
pub const MAC_PASSED: u8 = 0x02;

/// An Ethernet address.
pub type Mac = [u8; 6];

/// Type of a frame with datagrams, in bits 12 to 15 of the frame header.
const TYPE_DATAGRAMS: u8 = 1;
const LENGTH_BITS: u16 = 0x07FF;
const CIRCULATING: u16 = 1 << 14;
const MORE: u16 = 1 << 15;

/// Whether `source` is that of a frame that we sent with `own` and that came back through at least one device.
pub fn answers(source: Mac, own: Mac) -> bool {
    source[0] == own[0] | MAC_PASSED && source[0] != own[0] && source[1..] == own[1..]
}

/// A frame whose datagrams were all found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Address it goes to.
    pub destination: Mac,
    /// Address of its sender, changed by the first device; see [`answers`].
    pub source: Mac,
    octets: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Reads an untrusted frame, padded or not; never panics.
    ///
    /// # Errors
    /// [`WireError`]: why it is no frame of datagrams.
    pub fn parse(octets: &'a [u8]) -> Result<Frame<'a>, WireError> {
        if octets.len() > FRAME_LEN_MAX {
            return Err(WireError::TooLong { got: octets.len() });
        }
        slice(octets, 0, HEADER_LEN)?;
        let ether_type = u16::from_be_bytes(array(octets, 12)?);
        if ether_type != ETHER_TYPE {
            return Err(WireError::EtherType { got: ether_type });
        }
        let header = u16_at(octets, 14)?;
        let frame_type = (header >> 12) as u8;
        if frame_type != TYPE_DATAGRAMS {
            return Err(WireError::FrameType { got: frame_type });
        }
        let length = usize::from(header & LENGTH_BITS);
        let datagrams = octets.get(HEADER_LEN..HEADER_LEN + length);
        let datagrams = datagrams.ok_or(WireError::Overrun {
            need: length,
            got: octets.len() - HEADER_LEN,
        })?;
        let mut at = 0;
        loop {
            let (datagram, more) = Datagram::parse(datagrams, at)?;
            at += DATAGRAM_OVERHEAD + datagram.data.len();
            if !more {
                break;
            }
        }
        if at < length {
            return Err(WireError::Rest { octets: length - at });
        }
        Ok(Frame {
            destination: array(octets, 0)?,
            source: array(octets, 6)?,
            octets: datagrams,
        })
    }

    /// Its datagrams, in order; at least one.
    pub fn datagrams(&self) -> Datagrams<'a> {
        Datagrams {
            octets: self.octets,
            next: Some(0),
        }
    }

    /// Writes the frame into a dirty buffer, padded; returns its length.
    ///
    /// # Errors
    /// [`WireError::NoRoom`].
    pub fn emit(&self, buffer: &mut [u8]) -> Result<usize, WireError> {
        let mut writer = FrameWriter::new(buffer, self.destination, self.source)?;
        for datagram in self.datagrams() {
            writer.push_datagram(&datagram)?;
        }
        Ok(writer.finish())
    }
}

/// One datagram of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Datagram<'a> {
    /// What is asked.
    pub command: Command,
    /// Number that its sender gave it; devices leave it.
    pub index: u8,
    /// Lower half ADP, upper half ADO, or a logical address; see [`Command::addressing`].
    pub address: u32,
    /// Set by a device whose port 0 is closed, so that no frame goes round for ever.
    pub circulating: bool,
    /// Event requests of the devices, ORed.
    pub irq: u16,
    /// Data, both ways.
    pub data: &'a [u8],
    /// What the devices that acted have counted.
    pub working_counter: u16,
    /// Where the datagram starts in the frame.
    pub at: usize,
}

impl<'a> Datagram<'a> {
    /// The datagram at `at` behind the headers of the frame, and whether another one follows.
    fn parse(octets: &'a [u8], at: usize) -> Result<(Datagram<'a>, bool), WireError> {
        let left = &octets[at.min(octets.len())..];
        if left.len() < DATAGRAM_OVERHEAD {
            return Err(WireError::Overrun {
                need: DATAGRAM_OVERHEAD,
                got: left.len(),
            });
        }
        let flags = u16_at(left, 6)?;
        let length = usize::from(flags & LENGTH_BITS);
        let data = left.get(DATAGRAM_HEADER_LEN..DATAGRAM_HEADER_LEN + length);
        let counter = u16_at(left, DATAGRAM_HEADER_LEN + length);
        let (Some(data), Ok(working_counter)) = (data, counter) else {
            return Err(WireError::Overrun {
                need: DATAGRAM_OVERHEAD + length,
                got: left.len(),
            });
        };
        let datagram = Datagram {
            command: Command::from(left[0]),
            index: left[1],
            address: u32_at(left, 2)?,
            circulating: flags & CIRCULATING != 0,
            irq: u16_at(left, 8)?,
            data,
            working_counter,
            at: HEADER_LEN + at,
        };
        Ok((datagram, flags & MORE != 0))
    }

    /// Position or station address.
    pub fn adp(&self) -> u16 {
        self.address as u16
    }

    /// Offset in the memory of a device.
    pub fn ado(&self) -> u16 {
        (self.address >> 16) as u16
    }

    /// Where its data start in the frame.
    pub fn data_at(&self) -> usize {
        self.at + DATAGRAM_HEADER_LEN
    }
}

/// The datagrams of a frame.
#[derive(Clone, Debug)]
pub struct Datagrams<'a> {
    octets: &'a [u8],
    next: Option<usize>,
}

impl<'a> Iterator for Datagrams<'a> {
    type Item = Datagram<'a>;

    fn next(&mut self) -> Option<Datagram<'a>> {
        let at = self.next.take()?;
        // All were found when the frame was read.
        let (datagram, more) = Datagram::parse(self.octets, at).ok()?;
        self.next = more.then_some(at + DATAGRAM_OVERHEAD + datagram.data.len());
        Some(datagram)
    }
}

/// Writes a frame datagram by datagram into a dirty buffer.
#[derive(Debug)]
pub struct FrameWriter<'a> {
    buffer: &'a mut [u8],
    /// Octets written so far.
    length: usize,
    /// Where the last datagram starts.
    last: Option<usize>,
}

impl<'a> FrameWriter<'a> {
    /// Starts a frame.
    ///
    /// # Errors
    /// [`WireError::NoRoom`] in a buffer that is shorter than any frame.
    pub fn new(buffer: &'a mut [u8], destination: Mac, source: Mac) -> Result<FrameWriter<'a>, WireError> {
        let start = cleared(buffer, FRAME_LEN_MIN)?;
        put(start, 0, destination);
        put(start, 6, source);
        put(start, 12, ETHER_TYPE.to_be_bytes());
        Ok(FrameWriter {
            buffer,
            length: HEADER_LEN,
            last: None,
        })
    }

    /// Octets of data that a further datagram could carry.
    pub fn room(&self) -> usize {
        let end = self.buffer.len().min(FRAME_LEN_MAX);
        end.saturating_sub(self.length + DATAGRAM_OVERHEAD)
    }

    /// Adds a datagram with `length` octets of zeros; returns where its data start in the frame.
    ///
    /// # Errors
    /// [`WireError::NoRoom`]; the frame is as before.
    pub fn push(&mut self, command: Command, index: u8, address: u32, length: usize) -> Result<usize, WireError> {
        let room = self.buffer.len().min(FRAME_LEN_MAX).saturating_sub(self.length);
        let need = DATAGRAM_OVERHEAD + length;
        if need > room {
            return Err(WireError::NoRoom { need, got: room });
        }
        if let Some(last) = self.last {
            self.buffer[last + 7] |= (MORE >> 8) as u8;
        }
        let at = self.length;
        let datagram = cleared(&mut self.buffer[at..], need)?;
        datagram[0] = command.into();
        datagram[1] = index;
        put(datagram, 2, address.to_le_bytes());
        put(datagram, 6, (length as u16).to_le_bytes());
        self.last = Some(at);
        self.length += need;
        Ok(at + DATAGRAM_HEADER_LEN)
    }

    /// Adds a datagram that carries these data.
    ///
    /// # Errors
    /// [`WireError::NoRoom`]; the frame is as before.
    pub fn push_data(&mut self, command: Command, index: u8, address: u32, data: &[u8]) -> Result<usize, WireError> {
        let at = self.push(command, index, address, data.len())?;
        self.buffer[at..at + data.len()].copy_from_slice(data);
        Ok(at)
    }

    /// Data of a datagram, by what [`FrameWriter::push`] has returned.
    pub fn data_mut(&mut self, at: usize, length: usize) -> &mut [u8] {
        &mut self.buffer[at..at + length]
    }

    /// Adds a datagram as it was read.
    fn push_datagram(&mut self, datagram: &Datagram<'_>) -> Result<(), WireError> {
        let at = self.push_data(datagram.command, datagram.index, datagram.address, datagram.data)?;
        let start = at - DATAGRAM_HEADER_LEN;
        if datagram.circulating {
            self.buffer[start + 7] |= (CIRCULATING >> 8) as u8;
        }
        put(self.buffer, start + 8, datagram.irq.to_le_bytes());
        put(
            self.buffer,
            at + datagram.data.len(),
            datagram.working_counter.to_le_bytes(),
        );
        Ok(())
    }

    /// Writes the frame header and the padding; returns the length of the frame.
    pub fn finish(self) -> usize {
        let header = (self.length - HEADER_LEN) as u16 | u16::from(TYPE_DATAGRAMS) << 12;
        put(self.buffer, 14, header.to_le_bytes());
        if self.length < FRAME_LEN_MIN {
            self.buffer[self.length..FRAME_LEN_MIN].fill(0);
        }
        self.length.max(FRAME_LEN_MIN)
    }
}
