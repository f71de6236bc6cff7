//! Reads what the main device needs of an EEPROM through the registers of a device.
//!
//! In:  what came back from 0502h to 050Fh. Out: what to write to 0502h; in the end, what the device is.

use super::event::SetupError;
use crate::wire::register::{self, eeprom};
use crate::wire::sii::{Area, General, Identity, Mailboxes, SyncManagerEntry, Usage, category};

/// SyncManagers of a device that are looked at.
const MANAGERS_MAX: usize = 8;
/// Categories of an EEPROM that are looked at; what has more is no EEPROM.
const CATEGORIES_MAX: u8 = 100;
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
}

impl Found {
    /// The SyncManager that is used so, and its number.
    pub fn manager(&self, usage: Usage) -> Option<(u8, SyncManagerEntry)> {
        let mut all = (0..).zip(self.managers);
        all.find_map(|(number, manager)| Some((number, manager.filter(|manager| manager.usage == usage)?)))
    }

    /// Where the next SyncManager behind this address begins.
    pub(super) fn next_start(&self, start: u16) -> Option<u16> {
        let all = self.managers.iter().flatten().filter(|manager| manager.start > start);
        all.map(|manager| manager.start).min()
    }

    /// The FMMU for outputs or inputs.
    pub fn fmmu(&self, usage: Usage) -> u8 {
        match usage {
            Usage::Outputs => self.fmmus[0].unwrap_or(0),
            _ => self.fmmus[1].unwrap_or(1),
        }
    }

    /// It has a mailbox for CoE.
    pub fn has_coe(&self) -> bool {
        self.mailboxes.protocols & crate::wire::sii::protocol::COE != 0 && self.mailboxes.receive.length > 0
    }
}

/// Where the reader is.
#[derive(Clone, Copy, Debug)]
enum Place {
    Header(usize),
    /// Type and length of a category are read next.
    Category,
    /// The data of a category: its type, its octets, those that came.
    Data {
        kind: u16,
        octets: u32,
        done: u32,
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
    pub(super) fn new() -> Reader {
        Reader {
            place: Place::Header(0),
            address: HEADER[0].into(),
            asked: false,
            categories: 0,
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
                let is_of_use = matches!(kind, category::GENERAL | category::FMMU | category::SYNC_MANAGERS);
                if is_of_use && words > 0 {
                    let octets = 2 * u32::from(words);
                    self.place = Place::Data { kind, octets, done: 0 };
                } else {
                    self.address += u32::from(words);
                }
                is_last
            }
            Place::Data { kind, octets, mut done } => {
                for octet in pair {
                    if done < octets {
                        self.octet(kind, done, octet);
                        done += 1;
                    }
                }
                // Categories have whole words: two of them may be less than a pair.
                self.address += if octets.is_multiple_of(4) || done < octets {
                    2
                } else {
                    1
                };
                self.place = if done < octets {
                    Place::Data { kind, octets, done }
                } else {
                    Place::Category
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
