//! Reads what the main device needs of an EEPROM through the registers of a device.
//!
//! In:  what came back from 0502h to 050Fh. Out: what to write to 0502h; in the end, what the device is.

use super::event::SetupError;
use crate::wire::coe::MAILBOX_MIN;
use crate::wire::register::{self, eeprom};
use crate::wire::sii::{Area, General, Identity, Mailboxes, SyncManagerEntry, Usage, category};

/// SyncManagers of a device that are looked at.
const MANAGERS_MAX: usize = 8;
/// Categories of an EEPROM that are looked at; what has more is no EEPROM.
const CATEGORIES_MAX: u8 = 100;
/// Octets of PDOs that are looked at.
const PDO_OCTETS_MAX: u32 = 4096;
/// Pairs of words in front of the categories: alias, identity, mailboxes.
const HEADER: [u16; 8] = [0x04, 0x08, 0x0A, 0x0C, 0x0E, 0x18, 0x1A, 0x1C];
/// First word of the categories.
const CATEGORIES: u16 = 0x40;

/// What an EEPROM says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// What the device is.
    pub identity: Identity,
    /// Alias of its station address.
    pub alias: u16,
    /// Its mailboxes.
    pub mailboxes: Mailboxes,
    /// What it can do; [`General::coe`] and [`General::flags`].
    pub coe: u8,
    /// See [`General::flags`].
    pub flags: u8,
    managers: [Option<SyncManagerEntry>; MANAGERS_MAX],
    /// FMMUs for outputs and for inputs.
    fmmus: [Option<u8>; 2],
    /// Outputs and inputs by its PDOs, where those were read.
    process_data: [Bits; 2],
}

/// Octets of process data whose bits are kept.
const OCTETS_MAX: usize = 32;

/// Process data of a direction: how long its PDOs are, and which of its first bits have an object. The others are gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Bits {
    length: u32,
    used: [u8; OCTETS_MAX],
}

impl Bits {
    /// An entry of a PDO.
    fn push(&mut self, index: u16, bits: u8) {
        for bit in self.length..self.length + u32::from(bits) {
            if let Some(octet) = self.used.get_mut((bit / 8) as usize).filter(|_| index != 0) {
                *octet |= 1 << (bit % 8);
            }
        }
        self.length += u32::from(bits);
    }
}

impl Found {
    /// The SyncManager that is used so, and its number.
    pub fn manager(&self, usage: Usage) -> Option<(u8, SyncManagerEntry)> {
        let mut all = (0..).zip(self.managers);
        all.find_map(|(number, manager)| Some((number, manager.filter(|manager| manager.usage == usage)?)))
    }

    /// The SyncManager whose memory begins next behind this address, what it is for, and where.
    pub(super) fn next_behind(&self, start: u16) -> Option<(u8, Usage, u16)> {
        let all = (0..).zip(self.managers).filter_map(|(number, manager)| {
            let manager = manager?;
            let start = match manager.usage {
                Usage::MailboxOut => self.mailboxes.receive.start,
                Usage::MailboxIn => self.mailboxes.send.start,
                Usage::Outputs | Usage::Inputs => manager.start,
                Usage::Unused | Usage::Unknown(_) => return None,
            };
            Some((number, manager.usage, start))
        });
        all.filter(|(_, _, behind)| *behind > start)
            .min_by_key(|(_, _, start)| *start)
    }

    /// The FMMU for outputs or inputs.
    pub fn fmmu(&self, usage: Usage) -> u8 {
        match usage {
            Usage::Outputs => self.fmmus[0].unwrap_or(0),
            _ => self.fmmus[1].unwrap_or(1),
        }
    }

    /// Which bits of each octet of its outputs or inputs have an object, by the PDOs of its EEPROM; `None`: those were not read, or do not
    /// fit the SyncManager.
    pub fn used_bits(&self, usage: Usage) -> Option<&[u8]> {
        let bits = &self.process_data[usize::from(usage != Usage::Outputs)];
        let (_, manager) = self.manager(usage)?;
        let octets = bits.length.div_ceil(8);
        bits.used
            .get(..octets as usize)
            .filter(|_| octets == u32::from(manager.length))
    }

    /// It has a mailbox for CoE.
    pub fn has_coe(&self) -> bool {
        self.says_coe() && self.shorter_mailbox() >= MAILBOX_MIN
    }

    /// It says that it has one, however long that is.
    pub(super) fn says_coe(&self) -> bool {
        self.mailboxes.protocols & crate::wire::sii::protocol::COE != 0 && self.mailboxes.receive.length > 0
    }

    /// Octets of the shorter one of its mailboxes.
    pub(super) fn shorter_mailbox(&self) -> u16 {
        self.mailboxes.receive.length.min(self.mailboxes.send.length)
    }
}

/// Where the reader is.
#[derive(Clone, Copy, Debug)]
enum Place {
    Header(usize),
    /// Type and length of a category are read next.
    Category,
    /// The data of a category: its type, its octets that are of interest, those that came, and the first word behind all of it.
    Data {
        kind: u16,
        octets: u32,
        done: u32,
        behind: u32,
    },
}

/// Reads an EEPROM.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reader {
    place: Place,
    /// Word that is read next.
    address: u32,
    /// The command is on its way.
    asked: bool,
    categories: u8,
    /// PDOs are read, too.
    has_pdos: bool,
    /// Entries of the last PDO that are still to come, and whether it is assigned.
    entries: (u8, bool),
    /// Entry of a category that is not whole yet.
    entry: [u8; 8],
    found: Found,
}

/// What is to be done.
pub(super) enum Next {
    /// Write these octets to 0502h.
    Command([u8; 6]),
    /// Read [`REPLY_LEN`] octets from 0502h.
    Look,
}

/// Octets of 0502h to 050Fh.
pub(super) const REPLY_LEN: usize = 14;

/// How far the reader has come.
pub(super) enum Progress {
    /// The EEPROM is busy.
    Busy,
    /// There is more to be read.
    More,
    /// This is what it says.
    Done(Found),
}

impl Reader {
    /// `has_pdos`: what it says of process data is read, too.
    pub(super) fn new(has_pdos: bool) -> Reader {
        Reader {
            place: Place::Header(0),
            address: HEADER[0].into(),
            asked: false,
            categories: 0,
            has_pdos,
            entries: (0, false),
            entry: [0; 8],
            found: Found::default(),
        }
    }

    pub(super) fn next(&self) -> Next {
        if self.asked {
            return Next::Look;
        }
        let mut command = [0; 6];
        command[..2].copy_from_slice(&eeprom::READ.to_le_bytes());
        command[2..].copy_from_slice(&self.address.to_le_bytes());
        Next::Command(command)
    }

    /// The command was taken.
    pub(super) fn commanded(&mut self) {
        self.asked = true;
    }

    /// What was seen at 0502h.
    pub(super) fn look(&mut self, octets: &[u8; REPLY_LEN]) -> Result<Progress, SetupError> {
        let status = u16::from_le_bytes([octets[0], octets[1]]);
        if status & eeprom::BUSY != 0 {
            return Ok(Progress::Busy);
        }
        if status & eeprom::ERRORS != 0 {
            return Err(SetupError::Eeprom(Some(status & eeprom::ERRORS)));
        }
        self.asked = false;
        let at = usize::from(register::EEPROM_DATA - register::EEPROM_CONTROL);
        let data = &octets[at..at + if status & eeprom::EIGHT_OCTETS != 0 { 8 } else { 4 }];
        let first = self.address;
        for (number, pair) in (0_u32..).zip(data.chunks_exact(4)) {
            // What was not asked for is read by the way, as far as it is what comes next.
            if self.address == first + 2 * number && self.take([pair[0], pair[1], pair[2], pair[3]]) {
                return Ok(Progress::Done(self.found));
            }
        }
        Ok(Progress::More)
    }

    /// Two words; whether they were the last ones.
    fn take(&mut self, pair: [u8; 4]) -> bool {
        match self.place {
            Place::Header(number) => {
                self.header(HEADER[number], pair);
                let next = HEADER.get(number + 1).copied();
                self.place = next.map_or(Place::Category, |_| Place::Header(number + 1));
                self.address = next.unwrap_or(CATEGORIES).into();
                false
            }
            Place::Category => {
                let [kind, words] = words(pair);
                self.categories += 1;
                let is_last = kind == crate::wire::sii::END || kind == 0 || self.categories > CATEGORIES_MAX;
                self.address += 2;
                let behind = self.address + u32::from(words);
                let octets = self.octets_of_use(kind).min(2 * u32::from(words));
                if octets > 0 {
                    self.entries.0 = 0;
                    self.place = Place::Data {
                        kind,
                        octets,
                        done: 0,
                        behind,
                    };
                } else {
                    self.address = behind;
                }
                is_last
            }
            Place::Data {
                kind,
                octets,
                mut done,
                behind,
            } => {
                for octet in pair {
                    if done < octets {
                        self.octet(kind, done, octet);
                        done += 1;
                    }
                }
                (self.place, self.address) = if done < octets {
                    let place = Place::Data {
                        kind,
                        octets,
                        done,
                        behind,
                    };
                    (place, self.address + 2)
                } else {
                    (Place::Category, behind)
                };
                false
            }
        }
    }

    fn header(&mut self, word: u16, pair: [u8; 4]) {
        let number = u32::from_le_bytes(pair);
        let [low, high] = words(pair);
        let Found {
            identity,
            alias,
            mailboxes,
            ..
        } = &mut self.found;
        match word {
            0x04 => *alias = low,
            0x08 => identity.vendor = number,
            0x0A => identity.product = number,
            0x0C => identity.revision = number,
            0x0E => identity.serial = number,
            0x18 => {
                mailboxes.receive = Area {
                    start: low,
                    length: high,
                }
            }
            0x1A => {
                mailboxes.send = Area {
                    start: low,
                    length: high,
                }
            }
            _ => mailboxes.protocols = low,
        }
    }

    /// Octets of a category that are looked at, so that one that says it is long takes no longer.
    fn octets_of_use(&self, kind: u16) -> u32 {
        match kind {
            // Up to its flags.
            category::GENERAL => 12,
            category::FMMU => 16,
            category::SYNC_MANAGERS => 8 * MANAGERS_MAX as u32,
            category::RX_PDO | category::TX_PDO if self.has_pdos => PDO_OCTETS_MAX,
            _ => 0,
        }
    }

    /// The head of a PDO, or an entry of it.
    fn pdo(&mut self, kind: u16) {
        let [low, high, _, manager, _, bits, ..] = self.entry;
        let (left, is_assigned) = self.entries;
        let Some(left) = left.checked_sub(1) else {
            self.entries = (self.entry[2], usize::from(manager) < MANAGERS_MAX);
            return;
        };
        self.entries.0 = left;
        if is_assigned {
            let direction = usize::from(kind == category::TX_PDO);
            self.found.process_data[direction].push(u16::from_le_bytes([low, high]), bits);
        }
    }

    /// An octet of a category.
    fn octet(&mut self, kind: u16, at: u32, octet: u8) {
        match kind {
            category::GENERAL => match at {
                5 => self.found.coe = octet,
                11 => self.found.flags = octet,
                _ => {}
            },
            category::FMMU => {
                let number = u8::try_from(at).unwrap_or(u8::MAX);
                if let Some(place) = usize::from(octet)
                    .checked_sub(1)
                    .and_then(|usage| self.found.fmmus.get_mut(usage))
                {
                    place.get_or_insert(number);
                }
            }
            category::RX_PDO | category::TX_PDO => {
                self.entry[(at % 8) as usize] = octet;
                if at % 8 == 7 {
                    self.pdo(kind);
                }
            }
            _ => {
                self.entry[(at % 8) as usize] = octet;
                if at % 8 == 7
                    && let Some(place) = self.found.managers.get_mut((at / 8) as usize)
                {
                    *place = SyncManagerEntry::parse(&self.entry).ok();
                }
            }
        }
    }
}

fn words([a, b, c, d]: [u8; 4]) -> [u16; 2] {
    [u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])]
}

impl Found {
    /// It cannot take LRW, by its EEPROM.
    pub(super) fn refuses_lrw(&self) -> bool {
        self.flags & General::NO_LRW != 0
    }
}
