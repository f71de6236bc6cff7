//! SDO access to the objects of a controlled node: what the dictionary checks, and what the node adds to some objects.

use obd::{AbortCode, Dictionary, Objects};

use super::event::{Storage, StorageGroup, WriteCheck};
use super::keys::Keys;
use super::objects::{HISTORY_ENTRIES, LOAD, SAVE};
use super::pdo;
use crate::nmt::{CnEvent, NmtCommand, NmtState, Reset};

/// First object of the device; those before belong to the communication profile.
pub(super) const FIRST_DEVICE_OBJECT: u16 = 0x2000;

/// The dictionary as an SDO sees it during one frame.
pub(super) struct Access<'a, const E: usize, const B: usize> {
    pub(super) dictionary: &'a mut Dictionary<E, B>,
    pub(super) keys: &'a Keys,
    pub(super) state: NmtState,
    pub(super) check: Option<WriteCheck<E, B>>,
    /// The last object of the device that was written, and whether it was not the only one.
    pub(super) written: Option<(u16, u8)>,
    pub(super) written_several: bool,
    /// The reset that a write to 0x1F9E asks for.
    pub(super) reset: Option<Reset>,
    /// What a write to 0x1010 or 0x1011 asks for.
    pub(super) storage: Option<Storage>,
}

impl<const E: usize, const B: usize> Access<'_, E, B> {
    fn check_effect(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
        if pdo::is_fixed_in_use(index, sub) && self.exchanges_pdos() {
            return Err(AbortCode::DEVICE_STATE);
        }
        let dictionary = &*self.dictionary;
        match (self.check, index) {
            (Some(check), FIRST_DEVICE_OBJECT..) => check(dictionary, index, sub, value),
            (None, FIRST_DEVICE_OBJECT..) => Ok(()),
            (_, _) => pdo::check_write(dictionary, self.keys, (index, sub), value),
        }
    }

    /// A mapping or limit that is in use must not change under it.
    fn exchanges_pdos(&self) -> bool {
        matches!(self.state, NmtState::ReadyToOperate | NmtState::Operational)
    }

    /// 0x1F9E: the value is an NMT command, one of the four resets; it always reads as 255.
    fn reset_command(&mut self, value: &[u8]) -> Result<(), AbortCode> {
        let command = value.first().copied().unwrap_or(0xFF);
        match (NmtCommand::from(command).plain(), NmtCommand::from(command).cn_event()) {
            (None, Some(CnEvent::Reset(reset))) => {
                self.reset = Some(reset);
                Ok(())
            }
            _ => Err(AbortCode::VALUE_RANGE),
        }
    }

    /// 0x1010 and 0x1011: the value is the signature; what is read stays what the device can do.
    fn storage_command(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
        let (signature, make): (u32, fn(StorageGroup) -> Storage) = if index == 0x1010 {
            (SAVE, Storage::Store)
        } else {
            (LOAD, Storage::Restore)
        };
        let group = StorageGroup::from_sub(sub).ok_or(AbortCode::NO_SUB_INDEX)?;
        if value != signature.to_le_bytes() {
            return Err(AbortCode::NOT_STORED);
        }
        self.storage = Some(make(group));
        Ok(())
    }

    /// 0x1003/0 takes only 0: the history is emptied.
    fn clear_history(&mut self) {
        for sub in 1..=HISTORY_ENTRIES as u8 {
            if let Ok(handle) = self.dictionary.find(0x1003, sub) {
                // An empty string always fits.
                let _ = self.dictionary.set_octets(handle, &[]);
            }
        }
    }
}

impl<const E: usize, const B: usize> Objects for Access<'_, E, B> {
    fn sdo_read(&mut self, index: u16, sub: u8, out: &mut [u8]) -> Result<usize, AbortCode> {
        self.dictionary.sdo_read(index, sub, out)
    }

    fn sdo_write_parts(&mut self, index: u16, sub: u8, len: usize) -> Result<bool, AbortCode> {
        self.dictionary.sdo_write_parts(index, sub, len)
    }

    fn sdo_write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
        self.dictionary.check_write(index, sub, value)?;
        match index {
            0x1F9E => return self.reset_command(value),
            0x1010 | 0x1011 => return self.storage_command(index, sub, value),
            _ => {}
        }
        self.check_effect(index, sub, value)?;
        self.dictionary.write(index, sub, value)?;
        if (index, sub) == (0x1003, 0) {
            self.clear_history();
        }
        if index >= FIRST_DEVICE_OBJECT {
            self.written_several |= self.written.is_some();
            self.written = Some((index, sub));
        }
        Ok(())
    }
}
