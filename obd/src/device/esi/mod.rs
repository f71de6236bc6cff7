//! ESI: `EtherCATInfo`, what the maker of EtherCAT devices delivers.
//!
//! In:  the text. Out: the devices of the file; mistakes in the [`Log`]. Names are compared without their namespace; elements and
//! attributes that are not known are skipped, as the schema is extended by every edition.
//!
//! A modular device has slots, and modules that stand in them (ETG.5001). Whoever reads the file chooses them; else a module that the maker
//! puts into a slot by default is taken as there. Its PDOs and start-up commands are those of the device then, moved by the number of the
//! slot. A slot that is left open is named.
//!
//! A file of a maker has many devices, and one of them may be odd. What is wrong in a device is its own: the others can be used, and
//! the file is refused only where none can.
//!
//! Modules may be in groups by which their PDOs are ordered and aligned (`ModulePdoGroup`). Manuals and captures of devices show PDOs of
//! padding before and behind the modules of a group, and tell no rule for their lengths: where one might be needed, it is said.
//!
//! Of an object dictionary it is read which objects there are and which can be written ([`EsiDictionary`]). Not read: groups of devices,
//! pictures, EEPROM data, dictionaries in files of their own.

mod dictionary;
mod read;
mod slots;

pub use dictionary::EsiDictionary;

use super::error::Log;
use super::{DeviceErrors, DeviceMistake};
use read::read;
use std::string::{String, ToString};
use std::vec::Vec;

/// The devices of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiFile {
    /// As the file was named.
    pub file: String,
    /// Number of the maker.
    pub vendor: u32,
    /// Its name.
    pub vendor_name: String,
    /// All devices whose kind is told, in the order of the file.
    pub devices: Vec<EsiDevice>,
    /// Modules for slots of devices.
    pub modules: Vec<EsiModule>,
    /// What is odd, and changes nothing that is used; what is wrong in devices and modules that may not be asked for.
    pub notes: Vec<DeviceMistake>,
}

/// A device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiDevice {
    /// Order code.
    pub name: String,
    /// Kind of device.
    pub product: u32,
    /// State of its development.
    pub revision: u32,
    /// Its SyncManagers, in order.
    pub sync_managers: Vec<EsiSyncManager>,
    /// What each FMMU is for.
    pub fmmus: Vec<EsiUsage>,
    /// Process data to the device.
    pub rx_pdos: Vec<EsiPdo>,
    /// Process data from the device.
    pub tx_pdos: Vec<EsiPdo>,
    /// Its CoE mailbox.
    pub coe: Option<EsiCoe>,
    /// Its objects; `None`: the file does not tell them.
    pub dictionary: Option<EsiDictionary>,
    /// Modes of its distributed clocks; the first one is the maker's own choice.
    pub op_modes: Vec<EsiOpMode>,
    /// Places for modules, in order.
    pub slots: Vec<EsiSlot>,
    /// `ModuleIdent` of what stands in each of them, 0: nothing.
    pub modules: Vec<u32>,
    /// The first slot of which the file does not tell the module, so that process data are not known: in words, with its line.
    pub open_slot: Option<String>,
    /// Its modules are in groups that would move their process data, so that these are not known: in words, with the line.
    pub moved_by_group: Option<String>,
    /// Why it cannot be used: the first hundred mistakes of its description. Empty for one that can.
    pub mistakes: Vec<DeviceMistake>,
}

/// A module that can stand in a slot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiModule {
    /// `ModuleIdent`, by which a device knows it.
    pub ident: u32,
    /// Order code.
    pub name: String,
}

/// A place for a module.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiSlot {
    /// Its name.
    pub name: String,
    /// `ModuleIdent` of all that can stand in it.
    pub modules: Vec<u32>,
    /// It cannot be empty.
    pub is_needed: bool,
}

/// Modules that are chosen for a device.
#[derive(Clone, Copy, Debug)]
pub struct EsiChoice<'a> {
    /// Which device of the file.
    pub product: u32,
    /// Its revision, exactly.
    pub revision: u32,
    /// `ModuleIdent` for each slot from the first on, 0: it is empty, as all behind these.
    pub modules: &'a [u32],
}

/// What a SyncManager or an FMMU is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EsiUsage {
    /// Mails to the device.
    MailboxOut,
    /// Mails from the device.
    MailboxIn,
    /// Process data to the device.
    Outputs,
    /// Process data from the device.
    Inputs,
    /// State of the mailbox.
    MailboxState,
    /// Anything else, and nothing.
    Other,
}

/// A SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EsiSyncManager {
    /// What it is for.
    pub usage: EsiUsage,
    /// First octet of its memory.
    pub start: u16,
    /// Octets, as they come out of the box.
    pub default_size: u16,
    /// Most octets; `None`: not said.
    pub max_size: Option<u16>,
    /// Its control register.
    pub control: u8,
    /// It is on.
    pub enable: bool,
}

/// A process data object.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiPdo {
    /// 16xxh or 1Axxh.
    pub index: u16,
    /// Its name.
    pub name: String,
    /// Number of the SyncManager that it is assigned to out of the box.
    pub sync_manager: Option<u8>,
    /// Its entries cannot be changed.
    pub is_fixed: bool,
    /// It has to be assigned.
    pub is_mandatory: bool,
    /// PDOs that cannot be assigned beside it.
    pub excluded: Vec<u16>,
    /// Its entries.
    pub entries: Vec<EsiEntry>,
}

impl EsiPdo {
    /// Length of its data.
    pub fn bits(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bits)).sum()
    }
}

/// An entry of a process data object.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiEntry {
    /// Index of the object; 0: a gap.
    pub index: u16,
    /// Sub-index.
    pub sub: u8,
    /// Length.
    pub bits: u8,
    /// Its name.
    pub name: String,
    /// Its type, as the file names it.
    pub data_type: String,
}

impl EsiEntry {
    /// As it stands in a mapping object.
    pub fn mapping(&self) -> u32 {
        u32::from(self.index) << 16 | u32::from(self.sub) << 8 | u32::from(self.bits)
    }
}

/// A CoE mailbox.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiCoe {
    /// SDO information.
    pub information: bool,
    /// PDOs can be assigned.
    pub assign: bool,
    /// Entries of PDOs can be chosen.
    pub configure: bool,
    /// Complete access.
    pub complete_access: bool,
    /// Values that the device wants at its start, in order.
    pub start: Vec<EsiCommand>,
}

/// A value that a device wants at its start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiCommand {
    /// Steps at which it is written: `IP`, `PS`, `SO`.
    pub transitions: Vec<String>,
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub sub: u8,
    /// All sub-indices at once.
    pub complete: bool,
    /// Its octets.
    pub data: Vec<u8>,
    /// What it is for.
    pub comment: String,
}

/// A mode of the distributed clocks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiOpMode {
    /// Its name.
    pub name: String,
    /// Registers 0980h and 0981h; 0: no clocks.
    pub activate: u16,
    /// Cycle of SYNC0, ns; 0: that of the network by `factor_sync0`.
    pub cycle_sync0_ns: u32,
    /// Cycles of the network in one of SYNC0; below 0: the other way round.
    pub factor_sync0: i32,
    /// By how much SYNC0 comes behind the date of the cycle, ns.
    pub shift_sync0_ns: i32,
    /// Cycle of SYNC1, ns.
    pub cycle_sync1_ns: u32,
    /// Cycles of SYNC0 in one of SYNC1.
    pub factor_sync1: i32,
    /// By how much SYNC1 comes behind its date, ns.
    pub shift_sync1_ns: i32,
}

impl EsiFile {
    /// The device of this kind: of this revision, or the newest one that is not newer, or else the newest of all.
    pub fn find(&self, product: u32, revision: Option<u32>) -> Option<&EsiDevice> {
        let of_kind = || self.devices.iter().filter(|device| device.product == product);
        let not_newer = revision.and_then(|revision| {
            let older = of_kind().filter(|device| device.revision <= revision);
            older.max_by_key(|device| device.revision)
        });
        not_newer.or_else(|| of_kind().max_by_key(|device| device.revision))
    }
}

impl EsiDevice {
    /// PDOs that are assigned out of the box: to the device, or from it.
    pub fn assigned(&self, to_device: bool) -> impl Iterator<Item = &EsiPdo> {
        let pdos = if to_device { &self.rx_pdos } else { &self.tx_pdos };
        pdos.iter().filter(|pdo| pdo.sync_manager.is_some())
    }

    /// Octets of those.
    pub fn octets(&self, to_device: bool) -> u32 {
        self.assigned(to_device).map(EsiPdo::bits).sum::<u32>().div_ceil(8)
    }
}

/// Reads an ESI file.
///
/// # Errors
/// What is wrong in the file as a whole; every mistake, where no device of it can be used.
pub fn parse_esi(file: &str, octets: &[u8]) -> Result<EsiFile, DeviceErrors> {
    parse_esi_with(file, octets, None)
}

/// Reads an ESI file, with chosen modules in the slots of one of its devices.
///
/// # Errors
/// As [`parse_esi`].
pub fn parse_esi_with(file: &str, octets: &[u8], choice: Option<EsiChoice<'_>>) -> Result<EsiFile, DeviceErrors> {
    let text = super::text(file, octets)?;
    let mut log = Log::new(file, &text);
    let read = read(&text, &mut log, choice);
    let notes = log.finish()?;
    let mut esi = read.ok_or_else(|| DeviceErrors::whole(file, "is refused for a reason that was lost".to_string()))?;
    esi.file = file.to_string();
    esi.notes = notes;
    Ok(esi)
}
