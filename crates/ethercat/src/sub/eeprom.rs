//! The EEPROM behind the registers of a simulated device.

use crate::wire::register::eeprom as bit;
use crate::wire::sii;
use std::vec::Vec;

/// A command that is under way.
#[derive(Clone, Copy, Debug)]
struct Pending {
    done_ns: u64,
    command: u16,
    address: u32,
}

/// The EEPROM.
#[derive(Clone, Debug)]
pub(super) struct Eeprom {
    pub(super) image: Vec<u8>,
    pub(super) eight_octets: bool,
    /// What a command takes.
    pub(super) command_ns: u64,
    pending: Option<Pending>,
    errors: u16,
}

impl Eeprom {
    pub(super) fn new(image: Vec<u8>, eight_octets: bool, command_ns: u64) -> Eeprom {
        let mut eeprom = Eeprom {
            image,
            eight_octets,
            command_ns,
            pending: None,
            errors: 0,
        };
        eeprom.errors = eeprom.loading_errors();
        eeprom
    }

    /// A word as the chip loads it; erased where the image ends.
    pub(super) fn word(&self, address: usize) -> u16 {
        let at = |octet: usize| self.image.get(octet).copied().unwrap_or(0xFF);
        u16::from_le_bytes([at(2 * address), at(2 * address + 1)])
    }

    /// What 0502h shows of the load at power-on.
    fn loading_errors(&self) -> u16 {
        match sii::Sii::parse(&self.image) {
            Ok(sii) if sii.checksum_is_right() => 0,
            Ok(_) => bit::BAD_CHECKSUM,
            Err(_) => bit::NOT_LOADED,
        }
    }

    /// What 0502h shows.
    pub(super) fn status(&self) -> u16 {
        let eight = if self.eight_octets { bit::EIGHT_OCTETS } else { 0 };
        let busy = self.pending.map_or(0, |pending| bit::BUSY | pending.command);
        eight | busy | self.errors
    }

    /// A command was written to 0502h; one while another is under way is lost.
    pub(super) fn command(&mut self, now_ns: u64, control: u16, address: u32) {
        if self.pending.is_some() {
            return;
        }
        let command = control & (bit::READ | bit::WRITE | bit::RELOAD);
        match command {
            0 => self.errors &= bit::BAD_CHECKSUM | bit::NOT_LOADED,
            bit::WRITE if control & bit::WRITE_ENABLE == 0 => self.errors |= bit::NOT_ENABLED,
            bit::READ | bit::WRITE | bit::RELOAD => {
                self.errors &= bit::BAD_CHECKSUM | bit::NOT_LOADED;
                self.pending = Some(Pending {
                    done_ns: now_ns + self.command_ns,
                    command,
                    address,
                });
            }
            _ => self.errors |= bit::NO_ACKNOWLEDGE,
        }
    }

    /// When the command that is under way ends.
    pub(super) fn next_ns(&self) -> Option<u64> {
        self.pending.map(|pending| pending.done_ns)
    }

    /// Ends the command that is due; `data` is 0508h. Whether the chip has loaded the EEPROM anew.
    pub(super) fn poll(&mut self, now_ns: u64, data: &mut [u8]) -> bool {
        let Some(pending) = self.pending.filter(|pending| pending.done_ns <= now_ns) else {
            return false;
        };
        self.pending = None;
        let at = usize::try_from(pending.address).unwrap_or(usize::MAX).saturating_mul(2);
        match pending.command {
            bit::READ => {
                let count = if self.eight_octets { 8 } else { 4 };
                for (offset, octet) in data.iter_mut().take(count).enumerate() {
                    *octet = self.image.get(at.saturating_add(offset)).copied().unwrap_or(0xFF);
                }
                false
            }
            bit::WRITE => {
                match self.image.get_mut(at..at.saturating_add(2)) {
                    Some(word) => word.copy_from_slice(&data[..2]),
                    None => self.errors |= bit::NO_ACKNOWLEDGE,
                }
                false
            }
            _ => {
                self.errors = self.loading_errors();
                true
            }
        }
    }
}
