//! EEPROM of a device (slave information interface): what it is, its mailboxes, SyncManagers and process data.
//!
//! Addresses of the interface count words; here all offsets count octets.

use super::{WireError, cleared, put, slice, u16_at, u32_at};

/// Octets in front of the categories.
pub const HEADER_LEN: usize = 0x80;
/// Octet of the alias.
const ALIAS: usize = 8;
/// Octet of the check sum.
const CHECKSUM: usize = 14;
/// Type of the category behind the last.
pub const END: u16 = 0xFFFF;

/// Types of categories.
pub mod category {
    /// Texts, by number from 1.
    pub const STRINGS: u16 = 10;
    /// Names and what the mailbox can do.
    pub const GENERAL: u16 = 30;
    /// Use of each FMMU.
    pub const FMMU: u16 = 40;
    /// Each SyncManager.
    pub const SYNC_MANAGERS: u16 = 41;
    /// Process data that the main device reads.
    pub const TX_PDO: u16 = 50;
    /// Process data that the main device writes.
    pub const RX_PDO: u16 = 51;
    /// Modes of the distributed clocks.
    pub const DC: u16 = 60;
}

/// Bits of [`Mailboxes::protocols`].
pub mod protocol {
    /// ADS.
    pub const AOE: u16 = 0x01;
    /// Ethernet.
    pub const EOE: u16 = 0x02;
    /// CANopen.
    pub const COE: u16 = 0x04;
    /// Files.
    pub const FOE: u16 = 0x08;
    /// Servo drive profile.
    pub const SOE: u16 = 0x10;
}

/// Who made the device, and what it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Number of its maker.
    pub vendor: u32,
    /// Kind of device.
    pub product: u32,
    /// State of its development.
    pub revision: u32,
    /// Number of this one; 0 where there is none.
    pub serial: u32,
}

/// A part of the memory that is a mailbox.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Area {
    /// First octet.
    pub start: u16,
    /// Octets; 0: there is none.
    pub length: u16,
}

/// Mailboxes of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mailboxes {
    /// The device receives here.
    pub receive: Area,
    /// The device sends from here.
    pub send: Area,
    /// See [`protocol`].
    pub protocols: u16,
}

/// CRC-8 of the first 14 octets: polynomial 07h, start FFh.
pub fn checksum(octets: &[u8; 14]) -> u8 {
    octets.iter().fold(0xFF, |crc, octet| {
        (0..8).fold(crc ^ octet, |crc, _| crc << 1 ^ if crc & 0x80 != 0 { 0x07 } else { 0 })
    })
}

/// An EEPROM image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sii<'a> {
    octets: &'a [u8],
}

impl<'a> Sii<'a> {
    /// Takes an untrusted image; never panics, nor do the functions below.
    ///
    /// # Errors
    /// [`WireError::TooShort`] where it ends before its categories.
    pub fn parse(octets: &'a [u8]) -> Result<Sii<'a>, WireError> {
        slice(octets, 0, HEADER_LEN)?;
        Ok(Sii { octets })
    }

    fn word(&self, at: usize) -> u16 {
        u16_at(self.octets, at).unwrap_or(0)
    }

    fn double(&self, at: usize) -> u32 {
        u32_at(self.octets, at).unwrap_or(0)
    }

    /// The check sum of its first words is right.
    pub fn checksum_is_right(&self) -> bool {
        let mut first = [0; 14];
        first.copy_from_slice(&self.octets[..14]);
        self.octets[CHECKSUM] == checksum(&first)
    }

    /// Alias of the station address; 0: none.
    pub fn alias(&self) -> u16 {
        self.word(ALIAS)
    }

    /// What the device is.
    pub fn identity(&self) -> Identity {
        Identity {
            vendor: self.double(16),
            product: self.double(20),
            revision: self.double(24),
            serial: self.double(28),
        }
    }

    /// Its mailboxes from PRE-OP on.
    pub fn mailboxes(&self) -> Mailboxes {
        Mailboxes {
            receive: Area {
                start: self.word(0x30),
                length: self.word(0x32),
            },
            send: Area {
                start: self.word(0x34),
                length: self.word(0x36),
            },
            protocols: self.word(0x38),
        }
    }

    /// Octets of the EEPROM, as it says itself.
    pub fn size(&self) -> usize {
        (usize::from(self.word(0x7C)) + 1) * 128
    }

    /// Its categories, up to the end mark or the end of the image; one that is cut short is left out.
    pub fn categories(&self) -> Categories<'a> {
        Categories {
            octets: &self.octets[HEADER_LEN..],
        }
    }

    /// Octets up to the end mark, the mark included; `None`: the image is cut short.
    pub fn length(&self) -> Option<usize> {
        let mut rest = self.categories();
        while rest.next().is_some() {}
        let at = self.octets.len() - rest.octets.len();
        (u16_at(rest.octets, 0) == Ok(END)).then_some(at + 2)
    }

    fn category(&self, kind: u16) -> Option<&'a [u8]> {
        let mut all = self.categories();
        all.find_map(|category| (category.kind == kind).then_some(category.data))
    }

    /// Text number `number`, from 1; octets as they are. `None` for 0 and for numbers that there are not.
    pub fn string(&self, number: u8) -> Option<&'a [u8]> {
        let strings = self.category(category::STRINGS)?;
        let (&count, mut rest) = strings.split_first()?;
        if number == 0 || number > count {
            return None;
        }
        for _ in 1..number {
            let length = usize::from(*rest.first()?);
            rest = rest.get(1 + length..)?;
        }
        let length = usize::from(*rest.first()?);
        rest.get(1..1 + length)
    }

    /// Names and abilities.
    pub fn general(&self) -> Option<General> {
        General::parse(self.category(category::GENERAL)?).ok()
    }

    /// What each FMMU is for: 1 outputs, 2 inputs, 3 state of a SyncManager.
    pub fn fmmus(&self) -> &'a [u8] {
        self.category(category::FMMU).unwrap_or(&[])
    }

    /// Its SyncManagers, in order.
    pub fn sync_managers(&self) -> impl Iterator<Item = SyncManagerEntry> + 'a {
        let data = self.category(category::SYNC_MANAGERS).unwrap_or(&[]);
        data.chunks_exact(8)
            .filter_map(|entry| SyncManagerEntry::parse(entry).ok())
    }

    /// Process data objects of a direction, [`category::RX_PDO`] or [`category::TX_PDO`]; one that is cut short ends them.
    pub fn pdos(&self, direction: u16) -> Pdos<'a> {
        Pdos {
            octets: self.category(direction).unwrap_or(&[]),
        }
    }
}

/// One category.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Category<'a> {
    /// See [`category`].
    pub kind: u16,
    /// Its octets.
    pub data: &'a [u8],
}

/// The categories of an image.
#[derive(Clone, Debug)]
pub struct Categories<'a> {
    octets: &'a [u8],
}

impl<'a> Iterator for Categories<'a> {
    type Item = Category<'a>;

    fn next(&mut self) -> Option<Category<'a>> {
        let kind = u16_at(self.octets, 0).ok()?;
        if kind == END {
            return None;
        }
        let length = 2 * usize::from(u16_at(self.octets, 2).ok()?);
        let data = self.octets.get(4..4 + length)?;
        self.octets = &self.octets[4 + length..];
        Some(Category { kind, data })
    }
}

/// Names and abilities of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct General {
    /// Text numbers of group, picture, order code and name.
    pub group: u8,
    /// Picture.
    pub image: u8,
    /// Order code.
    pub order: u8,
    /// Name.
    pub name: u8,
    /// Bit 0 SDO, 1 SDO information, 2 PDO assignment, 3 PDO mapping, 4 upload at start, 5 complete access.
    pub coe: u8,
    /// Bit 0: stays in SAFE-OP. Bit 1: no LRW.
    pub flags: u8,
    /// Current that it takes from the E-bus, mA; below 0: it feeds it.
    pub ebus_ma: i16,
    /// Kinds of its ports, four bits each: 1 MII, 3 E-bus.
    pub ports: u16,
}

impl General {
    /// Octets of the category.
    pub const LEN: usize = 32;
    /// LRW is not supported, in `flags`.
    pub const NO_LRW: u8 = 1 << 1;
    /// Complete access is supported.
    pub const COMPLETE_ACCESS: u8 = 1 << 5;

    fn parse(data: &[u8]) -> Result<General, WireError> {
        slice(data, 0, 18)?;
        Ok(General {
            group: data[0],
            image: data[1],
            order: data[2],
            name: data[3],
            coe: data[5],
            flags: data[11],
            ebus_ma: u16_at(data, 12)?.cast_signed(),
            ports: u16_at(data, 16)?,
        })
    }
}

/// Kind of a SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Usage {
    /// Not used.
    Unused,
    /// Mails to the device.
    MailboxOut,
    /// Mails from the device.
    MailboxIn,
    /// Process data to the device.
    Outputs,
    /// Process data from the device.
    Inputs,
    /// Any other number.
    Unknown(u8),
}

impl From<u8> for Usage {
    fn from(octet: u8) -> Usage {
        match octet {
            0 => Usage::Unused,
            1 => Usage::MailboxOut,
            2 => Usage::MailboxIn,
            3 => Usage::Outputs,
            4 => Usage::Inputs,
            other => Usage::Unknown(other),
        }
    }
}

impl From<Usage> for u8 {
    fn from(usage: Usage) -> u8 {
        match usage {
            Usage::Unused => 0,
            Usage::MailboxOut => 1,
            Usage::MailboxIn => 2,
            Usage::Outputs => 3,
            Usage::Inputs => 4,
            Usage::Unknown(other) => other,
        }
    }
}

/// A SyncManager as the EEPROM has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncManagerEntry {
    /// First octet of its memory.
    pub start: u16,
    /// Octets, as they come out of the box.
    pub length: u16,
    /// Its control register.
    pub control: u8,
    /// Bit 0: on. Bit 1: its length is fixed. Bit 2: virtual. Bit 3: on in OP only.
    pub enable: u8,
    /// What it is for.
    pub usage: Usage,
}

impl SyncManagerEntry {
    pub(crate) fn parse(entry: &[u8]) -> Result<SyncManagerEntry, WireError> {
        slice(entry, 0, 8)?;
        Ok(SyncManagerEntry {
            start: u16_at(entry, 0)?,
            length: u16_at(entry, 2)?,
            control: entry[4],
            enable: entry[6],
            usage: Usage::from(entry[7]),
        })
    }

    fn emit(&self) -> [u8; 8] {
        let ([a, b], [c, d]) = (self.start.to_le_bytes(), self.length.to_le_bytes());
        [a, b, c, d, self.control, 0, self.enable, self.usage.into()]
    }
}

/// A process data object as the EEPROM has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pdo<'a> {
    /// 16xxh or 1Axxh.
    pub index: u16,
    /// Its SyncManager; 255: not assigned.
    pub sync_manager: u8,
    /// Number of its name.
    pub name: u8,
    /// Bit 0 mandatory, 4 fixed.
    pub flags: u16,
    entries: &'a [u8],
}

impl<'a> Pdo<'a> {
    /// Its entries, in order.
    pub fn entries(&self) -> impl Iterator<Item = PdoEntry> + 'a {
        self.entries.chunks_exact(8).map(|entry| PdoEntry {
            index: u16::from_le_bytes([entry[0], entry[1]]),
            sub: entry[2],
            name: entry[3],
            data_type: entry[4],
            bits: entry[5],
        })
    }

    /// Length of its data, bits.
    pub fn bits(&self) -> usize {
        self.entries().map(|entry| usize::from(entry.bits)).sum()
    }
}

/// An entry of a process data object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PdoEntry {
    /// Index of the object; 0: a gap.
    pub index: u16,
    /// Sub-index of the object.
    pub sub: u8,
    /// Number of its name.
    pub name: u8,
    /// Code of its type.
    pub data_type: u8,
    /// Length, bits.
    pub bits: u8,
}

/// The process data objects of a direction.
#[derive(Clone, Debug)]
pub struct Pdos<'a> {
    octets: &'a [u8],
}

impl<'a> Iterator for Pdos<'a> {
    type Item = Pdo<'a>;

    fn next(&mut self) -> Option<Pdo<'a>> {
        let header = slice(self.octets, 0, 8).ok()?;
        let end = 8 + 8 * usize::from(header[2]);
        let pdo = Pdo {
            index: u16::from_le_bytes([header[0], header[1]]),
            sync_manager: header[3],
            name: header[5],
            flags: u16::from_le_bytes([header[6], header[7]]),
            entries: self.octets.get(8..end)?,
        };
        self.octets = &self.octets[end..];
        Some(pdo)
    }
}

/// A process data object to be written.
#[derive(Clone, Copy, Debug)]
pub struct PdoImage<'a> {
    /// 16xxh or 1Axxh.
    pub index: u16,
    /// Its SyncManager.
    pub sync_manager: u8,
    /// Its entries.
    pub entries: &'a [PdoEntry],
}

/// All that an EEPROM of ours holds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Image<'a> {
    /// Word 0: kind of the interface to the firmware and its set-up.
    pub pdi: u16,
    /// Length of a SYNC pulse, 10 ns each.
    pub pulse_length: u16,
    /// Alias of the station address.
    pub alias: u16,
    /// What the device is.
    pub identity: Identity,
    /// Its mailboxes.
    pub mailboxes: Mailboxes,
    /// Its texts, from number 1 on.
    pub strings: &'a [&'a str],
    /// Names and abilities.
    pub general: General,
    /// What each FMMU is for.
    pub fmmus: &'a [u8],
    /// Its SyncManagers.
    pub sync_managers: &'a [SyncManagerEntry],
    /// Process data to the device.
    pub rx_pdos: &'a [PdoImage<'a>],
    /// Process data from the device.
    pub tx_pdos: &'a [PdoImage<'a>],
}

/// Writes categories one after the other.
struct Writer<'a> {
    buffer: &'a mut [u8],
    at: usize,
}

impl Writer<'_> {
    /// Room for a category of so many octets, padded to words.
    fn category(&mut self, kind: u16, octets: usize) -> Result<&mut [u8], WireError> {
        let words = octets.div_ceil(2);
        let need = self.at + 4 + 2 * words;
        if need > self.buffer.len() || words > usize::from(u16::MAX) {
            return Err(WireError::NoRoom {
                need,
                got: self.buffer.len(),
            });
        }
        put(self.buffer, self.at, kind.to_le_bytes());
        put(self.buffer, self.at + 2, (words as u16).to_le_bytes());
        let data = cleared(&mut self.buffer[self.at + 4..], 2 * words)?;
        self.at = need;
        Ok(data)
    }

    fn pdos(&mut self, kind: u16, pdos: &[PdoImage<'_>]) -> Result<(), WireError> {
        if pdos.is_empty() {
            return Ok(());
        }
        let octets = pdos.iter().map(|pdo| 8 + 8 * pdo.entries.len()).sum();
        let mut data = self.category(kind, octets)?;
        for pdo in pdos {
            put(data, 0, pdo.index.to_le_bytes());
            data[2] = pdo.entries.len() as u8;
            data[3] = pdo.sync_manager;
            data = &mut data[8..];
            for entry in pdo.entries {
                put(data, 0, entry.index.to_le_bytes());
                put(data, 2, [entry.sub, entry.name, entry.data_type, entry.bits]);
                data = &mut data[8..];
            }
        }
        Ok(())
    }
}

impl Image<'_> {
    /// Writes the image; the octets that it needs. The rest of the buffer is set to ones, as an EEPROM that was erased.
    ///
    /// # Errors
    /// [`WireError::NoRoom`].
    pub fn emit(&self, buffer: &mut [u8]) -> Result<usize, WireError> {
        buffer.fill(0xFF);
        let size = buffer.len();
        let first = cleared(buffer, HEADER_LEN)?;
        put(first, 0, self.pdi.to_le_bytes());
        put(first, 4, self.pulse_length.to_le_bytes());
        put(first, ALIAS, self.alias.to_le_bytes());
        let mut covered = [0; 14];
        covered.copy_from_slice(&first[..14]);
        first[CHECKSUM] = checksum(&covered);
        let identity = &self.identity;
        for (at, value) in [
            (16, identity.vendor),
            (20, identity.product),
            (24, identity.revision),
            (28, identity.serial),
        ] {
            put(first, at, value.to_le_bytes());
        }
        let mailboxes = &self.mailboxes;
        for (at, value) in [
            (0x30, mailboxes.receive.start),
            (0x32, mailboxes.receive.length),
            (0x34, mailboxes.send.start),
            (0x36, mailboxes.send.length),
            (0x38, mailboxes.protocols),
            (0x7C, (size / 128).saturating_sub(1) as u16),
            (0x7E, 1),
        ] {
            put(first, at, value.to_le_bytes());
        }
        let mut writer = Writer { buffer, at: HEADER_LEN };
        let octets = self.strings.iter().map(|text| 1 + text.len()).sum::<usize>();
        let mut data = writer.category(category::STRINGS, 1 + octets)?;
        data[0] = self.strings.len() as u8;
        data = &mut data[1..];
        for text in self.strings {
            data[0] = text.len() as u8;
            data[1..=text.len()].copy_from_slice(text.as_bytes());
            data = &mut data[1 + text.len()..];
        }
        let general = &self.general;
        let data = writer.category(category::GENERAL, General::LEN)?;
        put(data, 0, [general.group, general.image, general.order, general.name]);
        data[5] = general.coe;
        data[11] = general.flags;
        put(data, 12, general.ebus_ma.to_le_bytes());
        put(data, 16, general.ports.to_le_bytes());
        if !self.fmmus.is_empty() {
            let data = writer.category(category::FMMU, self.fmmus.len())?;
            data[..self.fmmus.len()].copy_from_slice(self.fmmus);
        }
        if !self.sync_managers.is_empty() {
            let data = writer.category(category::SYNC_MANAGERS, 8 * self.sync_managers.len())?;
            for (entry, place) in self.sync_managers.iter().zip(data.chunks_exact_mut(8)) {
                place.copy_from_slice(&entry.emit());
            }
        }
        writer.pdos(category::TX_PDO, self.tx_pdos)?;
        writer.pdos(category::RX_PDO, self.rx_pdos)?;
        let end = writer.at + 2;
        match writer.buffer.get_mut(writer.at..end) {
            Some(mark) => mark.copy_from_slice(&END.to_le_bytes()),
            None => return Err(WireError::NoRoom { need: end, got: size }),
        }
        Ok(end)
    }
}
