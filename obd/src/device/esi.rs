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
//! Not read: groups of devices, pictures, EEPROM data, object dictionaries, which the device itself can tell.

use super::error::Log;
use super::value::integer;
use super::{DeviceErrors, DeviceMistake, xml};
use roxmltree::Node;
use std::ops::RangeInclusive;
use std::string::{String, ToString};
use std::vec::Vec;

/// Most bits of a PDO: those of the data that one datagram can carry.
const PDO_BITS_MAX: u32 = 1486 * 8;
/// Most slots of a device.
const SLOTS_MAX: u32 = 256;
/// The list of modules that are expected (ETG.5001): its sub-index is the number of the slot, from 1.
const MODULE_LIST: u16 = 0xF030;
/// Longest value of a start-up command, octets.
const DATA_MAX: usize = 4096;

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

fn read(text: &str, log: &mut Log<'_>, choice: Option<EsiChoice<'_>>) -> Option<EsiFile> {
    let document = xml::document(text, log)?;
    let root = document.root_element();
    let name = root.tag_name().name();
    if name != "EtherCATInfo" {
        log.wrong(root.range().start, "root element", Some(name), "expected EtherCATInfo");
        return None;
    }
    let mut reader = Reader { log, choice };
    let vendor = child(root, "Vendor");
    let number = vendor.and_then(|vendor| child(vendor, "Id"));
    let vendor_id = reader.needed(number, root, "Vendor Id", 0..=u32::MAX.into());
    let descriptions = child(root, "Descriptions");
    let modules = descriptions.and_then(|all| child(all, "Modules"));
    // Of modules and of devices that nobody can name.
    let mut loose = Vec::new();
    let modules: Vec<Module<'_, '_>> = modules
        .into_iter()
        .flat_map(|modules| named(modules, "Module"))
        .filter_map(|module| {
            let (module, mistakes) = reader.apart(|reader| reader.module(module));
            loose.extend(mistakes);
            module
        })
        .collect();
    let devices = descriptions.and_then(|all| child(all, "Devices"));
    let devices: Vec<EsiDevice> = devices
        .into_iter()
        .flat_map(|devices| named(devices, "Device"))
        .filter_map(|device| {
            let (device, mistakes) = reader.apart(|reader| reader.device(device, &modules));
            match device {
                Some(device) => Some(EsiDevice { mistakes, ..device }),
                None => {
                    loose.extend(mistakes);
                    None
                }
            }
        })
        .collect();
    let is_usable = devices.iter().any(|device| device.mistakes.is_empty());
    let all = devices.iter().map(|device| device.mistakes.as_slice());
    for mistakes in all.chain([loose.as_slice()]) {
        match is_usable {
            true => reader.log.note(mistakes),
            false => reader.log.put_back(mistakes),
        }
    }
    if devices.is_empty() {
        let rule = "is missing: at least one device with a product code";
        reader
            .log
            .wrong(root.range().start, "Descriptions Devices Device", None, rule);
    }
    Some(EsiFile {
        vendor: vendor_id? as u32,
        vendor_name: vendor.map_or_else(String::new, |vendor| name_of(vendor)),
        devices,
        modules: modules.iter().map(Module::named).collect(),
        ..EsiFile::default()
    })
}

fn named<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.tag_name().name() == name)
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    named(node, name).next()
}

fn words<'a>(node: Node<'a, '_>) -> &'a str {
    node.text().unwrap_or_default().trim()
}

/// The name of something: the English one, where there are several.
fn name_of(node: Node<'_, '_>) -> String {
    let english = named(node, "Name").find(|name| name.attribute("LcId") == Some("1033"));
    english
        .or_else(|| child(node, "Name"))
        .map_or_else(String::new, |name| words(name).to_string())
}

/// A number of an ESI file: decimal, or hexadecimal behind `#x`.
fn esi_number(text: &str) -> Option<i128> {
    let text = text.trim();
    match text.strip_prefix("#x").or(text.strip_prefix("#X")) {
        Some(digits) => integer(&std::format!("0x{digits}")),
        // Zeros in front are common, and mean nothing.
        None => {
            let (sign, digits) = text.strip_prefix('-').map_or(("", text), |digits| ("-", digits));
            let kept = digits.trim_start_matches('0');
            let kept = if kept.is_empty() && !digits.is_empty() {
                "0"
            } else {
                kept
            };
            integer(&std::format!("{sign}{kept}")).filter(|_| !kept.starts_with('x') && !kept.starts_with('X'))
        }
    }
}

/// Where the text of an element stands.
fn text_at(node: Node<'_, '_>) -> usize {
    let text = node.children().find(Node::is_text);
    text.map_or(node.range().start, |text| text.range().start)
}

fn is_set(node: Node<'_, '_>, attribute: &str) -> bool {
    matches!(node.attribute(attribute), Some("1" | "true"))
}

/// A module, and where it stands in the file.
struct Module<'a, 'i> {
    ident: u32,
    node: Node<'a, 'i>,
}

impl<'a> Module<'a, '_> {
    /// What slots may ask for instead of single modules.
    fn class(&self) -> Option<&'a str> {
        child(self.node, "Type").and_then(|kind| kind.attribute("ModuleClass"))
    }

    /// The group of modules that it is in.
    fn group(&self) -> Option<i128> {
        let group = child(self.node, "Type").and_then(|kind| kind.attribute("ModulePdoGroup"));
        group.and_then(esi_number)
    }

    fn named(&self) -> EsiModule {
        EsiModule {
            ident: self.ident,
            name: child(self.node, "Type").map_or_else(String::new, |kind| words(kind).to_string()),
        }
    }
}

/// By how much objects of a module lie behind those of the same module in the first slot.
#[derive(Clone, Copy, Debug, Default)]
struct Shift {
    pdo: u32,
    object: u32,
}

struct Reader<'r, 't> {
    log: &'r mut Log<'t>,
    choice: Option<EsiChoice<'r>>,
}

impl Reader<'_, '_> {
    /// Reads a part of the file, and what is wrong in it.
    fn apart<T>(&mut self, read: impl FnOnce(&mut Self) -> Option<T>) -> (Option<T>, Vec<DeviceMistake>) {
        let before = self.log.count();
        let found = read(self);
        (found, self.log.take_since(before))
    }

    fn range(&mut self, at: usize, what: &str, text: &str, range: &RangeInclusive<i128>) -> Option<i128> {
        let number = esi_number(text).filter(|number| range.contains(number));
        if number.is_none() {
            let rule = std::format!(
                "expected an integer from {} to {}, decimal or #x",
                range.start(),
                range.end()
            );
            self.log.wrong(at, what, Some(text.trim()), rule);
        }
        number
    }

    /// The number in an element, which has to be there.
    fn needed(
        &mut self,
        node: Option<Node<'_, '_>>,
        parent: Node<'_, '_>,
        what: &str,
        range: RangeInclusive<i128>,
    ) -> Option<i128> {
        match node {
            Some(node) => self.range(text_at(node), what, node.text().unwrap_or_default(), &range),
            None => {
                self.log.wrong(parent.range().start, what, None, "is missing");
                None
            }
        }
    }

    /// The index in an element, which has to be there: moved where it depends on the slot. 0, a gap, stays.
    fn moved(
        &mut self,
        node: Option<Node<'_, '_>>,
        parent: Node<'_, '_>,
        what: &str,
        range: RangeInclusive<i128>,
        by: u32,
    ) -> Option<u16> {
        let number = self.needed(node, parent, what, range.clone())?;
        let node = node.filter(|node| number != 0 && is_set(*node, "DependOnSlot"));
        let index = number + node.map_or(0, |_| i128::from(by));
        if !range.contains(&index) {
            let rule = std::format!("becomes 0x{index:X} by the number of its slot, which is none");
            let (at, text) = node.map_or((parent.range().start, ""), |node| (text_at(node), words(node)));
            self.log.wrong(at, what, Some(text), rule);
            return None;
        }
        Some(index as u16)
    }

    /// The number in an element, if it is there.
    fn number(&mut self, parent: Node<'_, '_>, name: &'static str, range: RangeInclusive<i128>) -> Option<i128> {
        let node = child(parent, name).filter(|node| !words(*node).is_empty())?;
        self.needed(Some(node), parent, name, range)
    }

    /// The number in an attribute, if it is there.
    fn attribute(&mut self, node: Node<'_, '_>, name: &str, range: RangeInclusive<i128>) -> Option<i128> {
        let attribute = node
            .attribute_node(name)
            .filter(|attribute| !attribute.value().is_empty())?;
        let what = std::format!("{} {name}", node.tag_name().name());
        self.range(attribute.range_value().start, &what, attribute.value(), &range)
    }

    fn device(&mut self, node: Node<'_, '_>, modules: &[Module<'_, '_>]) -> Option<EsiDevice> {
        const ANY: RangeInclusive<i128> = 0..=u32::MAX as i128;
        let Some(kind) = child(node, "Type") else {
            self.log.wrong(node.range().start, "Device Type", None, "is missing");
            return None;
        };
        if kind.attribute("ProductCode").is_none() {
            // Groups of modules and devices of the past have none.
            self.log.odd(
                kind.range().start,
                "Device Type",
                Some(words(kind)),
                "has no ProductCode and is left out",
            );
            return None;
        }
        let product = self.attribute(kind, "ProductCode", ANY)? as u32;
        let revision = self.attribute(kind, "RevisionNo", ANY).unwrap_or(0) as u32;
        let sync_managers: Vec<EsiSyncManager> = named(node, "Sm").map(|sm| self.sync_manager(sm)).collect();
        let usage = |node: Node<'_, '_>| usage(words(node));
        let mut device = EsiDevice {
            name: words(kind).to_string(),
            product,
            revision,
            fmmus: named(node, "Fmmu").map(usage).collect(),
            rx_pdos: Vec::new(),
            tx_pdos: Vec::new(),
            coe: child(node, "Mailbox")
                .and_then(|mailbox| child(mailbox, "CoE"))
                .map(|coe| self.coe(coe)),
            op_modes: Vec::new(),
            slots: Vec::new(),
            modules: Vec::new(),
            open_slot: None,
            moved_by_group: None,
            mistakes: Vec::new(),
            sync_managers,
        };
        self.all_pdos(node, &mut device, Shift::default());
        if let Some(slots) = child(node, "Slots") {
            self.slots(slots, &mut device, modules);
        }
        if let Some(dc) = child(node, "Dc") {
            device.op_modes = named(dc, "OpMode").filter_map(|mode| self.op_mode(mode)).collect();
        }
        self.check_sizes(node, &device);
        Some(device)
    }

    fn sync_manager(&mut self, node: Node<'_, '_>) -> EsiSyncManager {
        const WORD: RangeInclusive<i128> = 0..=0xFFFF;
        EsiSyncManager {
            usage: usage(words(node)),
            start: self.attribute(node, "StartAddress", WORD).unwrap_or(0) as u16,
            default_size: self.attribute(node, "DefaultSize", WORD).unwrap_or(0) as u16,
            max_size: self.attribute(node, "MaxSize", WORD).map(|size| size as u16),
            control: self.attribute(node, "ControlByte", 0..=0xFF).unwrap_or(0) as u8,
            enable: self
                .attribute(node, "Enable", WORD)
                .is_some_and(|enable| enable & 1 != 0),
        }
    }

    /// The number of a module; one without is left out.
    fn module<'a, 'i>(&mut self, node: Node<'a, 'i>) -> Option<Module<'a, 'i>> {
        let kind = child(node, "Type").filter(|kind| kind.attribute("ModuleIdent").is_some())?;
        let ident = self.attribute(kind, "ModuleIdent", 0..=u32::MAX.into())? as u32;
        Some(Module { ident, node })
    }

    /// Puts the modules that are chosen, else those that are usual, into the slots of a device.
    fn slots(&mut self, slots: Node<'_, '_>, device: &mut EsiDevice, modules: &[Module<'_, '_>]) {
        const STEP: RangeInclusive<i128> = 0..=0xFFFF;
        const COUNT: RangeInclusive<i128> = 0..=255;
        let steps = ["SlotPdoIncrement", "SlotIndexIncrement"];
        let of_all = steps.map(|name| self.attribute(slots, name, STEP));
        let chosen = self
            .choice
            .filter(|it| (it.product, it.revision) == (device.product, device.revision));
        let mut start = Vec::new();
        for slot in named(slots, "Slot") {
            let own = steps.map(|name| self.attribute(slot, name, STEP));
            let [pdo_step, object_step] = [0, 1].map(|at| own[at].or(of_all[at]).unwrap_or(0) as u32);
            let least = self.attribute(slot, "MinInstances", COUNT).unwrap_or(0) as u32;
            let most = self.attribute(slot, "MaxInstances", COUNT).unwrap_or(1) as u32;
            let first = device.slots.len() as u32;
            let count = most.max(least).max(1);
            if first + count > SLOTS_MAX {
                let rule = std::format!("is beyond the {SLOTS_MAX} slots that a device can have");
                self.log.wrong(slot.range().start, "Slot", Some(&name_of(slot)), rule);
                return;
            }
            let Some((allowed, usual)) = self.modules_of(slot, least, modules) else {
                continue;
            };
            if chosen.is_none() && usual.is_none() {
                let line = self.log.line(slot.range().start);
                let told = std::format!("slot {:?} in line {line}", name_of(slot));
                device.open_slot.get_or_insert(told);
            }
            for number in first..first + count {
                device.slots.push(EsiSlot {
                    name: name_of(slot),
                    modules: allowed.clone(),
                    is_needed: number < first + least,
                });
                let ident = match chosen {
                    Some(chosen) => chosen.modules.get(number as usize).copied().unwrap_or(0),
                    None => usual.filter(|_| number < first + least.max(1)).unwrap_or(0),
                };
                device.modules.push(ident);
                let Some(module) = modules.iter().find(|module| ident != 0 && module.ident == ident) else {
                    continue;
                };
                let shift = Shift {
                    pdo: pdo_step * number,
                    object: object_step * number,
                };
                self.all_pdos(module.node, device, shift);
                let coe = child(module.node, "Mailbox").and_then(|mailbox| child(mailbox, "CoE"));
                let commands = coe.into_iter().flat_map(|coe| named(coe, "InitCmd"));
                start.extend(commands.filter_map(|command| self.command(command, shift.object)));
            }
        }
        device.moved_by_group = self.moved_by_group(slots, device, modules);
        let list = match is_set(slots, "DownloadModuleIdentList") {
            true => self.module_list(slots, &device.modules),
            false => Vec::new(),
        };
        match &mut device.coe {
            // Objects of a module are there when the device knows of it.
            Some(coe) => {
                coe.start.splice(0..0, list);
                coe.start.extend(start);
            }
            None if list.is_empty() && start.is_empty() => {}
            None => {
                let rule = "have start-up commands, but the device has no CoE mailbox";
                self.log.wrong(slots.range().start, "Slots", None, rule);
            }
        }
    }

    /// Whether groups of modules order or align what the modules of a device exchange: in words. They do not where modules stand in the order
    /// of their groups and every PDO is as long as the longest alignment.
    fn moved_by_group(
        &mut self,
        slots: Node<'_, '_>,
        device: &EsiDevice,
        modules: &[Module<'_, '_>],
    ) -> Option<String> {
        const OCTETS: RangeInclusive<i128> = 0..=255;
        let groups: Vec<Node<'_, '_>> = named(slots, "ModulePdoGroup").collect();
        let first = groups.first()?;
        let alignments = groups
            .iter()
            .filter_map(|group| self.attribute(*group, "Alignment", OCTETS));
        let octets = alignments.max().unwrap_or(1).max(1) as u32;
        let stand = device
            .modules
            .iter()
            .filter_map(|ident| modules.iter().find(|module| module.ident == *ident));
        let stand: Vec<&Module<'_, '_>> = stand.collect();
        let is_moved = |direction: &'static str, to_device: bool| {
            let own = stand.iter().filter(|module| child(module.node, direction).is_some());
            let order: Vec<Option<i128>> = own.map(|module| module.group()).collect();
            let is_ordered = order.windows(2).all(|pair| match pair {
                [Some(before), Some(behind)] => before <= behind,
                other => other[0] == other[1],
            });
            let is_whole = device
                .assigned(to_device)
                .all(|pdo| pdo.bits().is_multiple_of(8 * octets));
            !(order.is_empty() || is_ordered && is_whole)
        };
        if !is_moved("RxPdo", true) && !is_moved("TxPdo", false) {
            return None;
        }
        let line = self.log.line(first.range().start);
        Some(std::format!(
            "process data of its modules are ordered and aligned by groups (ModulePdoGroup in line {line}), by no rule that is public; used are \
             modules in the order of their groups, each PDO of which fills {octets} octets or a multiple of that"
        ))
    }

    /// Modules that can stand in a slot, and the one that usually does.
    fn modules_of(
        &mut self,
        slot: Node<'_, '_>,
        least: u32,
        modules: &[Module<'_, '_>],
    ) -> Option<(Vec<u32>, Option<u32>)> {
        let mut allowed = Vec::new();
        let mut usual = None;
        for node in named(slot, "ModuleIdent") {
            let ident = self.needed(Some(node), slot, "Slot ModuleIdent", 0..=u32::MAX.into())? as u32;
            allowed.push(ident);
            if is_set(node, "Default") {
                usual = usual.or(Some((node, ident)));
            }
        }
        for class in named(slot, "ModuleClass") {
            let name = words(child(class, "Class").unwrap_or(class));
            let of_class = modules.iter().filter(|module| module.class() == Some(name));
            allowed.extend(of_class.map(|module| module.ident));
        }
        // Where one has to be and there is one only, it is that.
        if least > 0 && allowed.len() == 1 {
            usual = usual.or_else(|| Some((child(slot, "ModuleIdent")?, allowed[0])));
        }
        if let Some((node, ident)) = usual
            && modules.iter().all(|module| module.ident != ident)
        {
            let rule = "is no module of this file";
            self.log
                .wrong(text_at(node), "Slot ModuleIdent", Some(words(node)), rule);
            return None;
        }
        Some((allowed, usual.map(|(_, ident)| ident)))
    }

    /// Commands that tell a device its modules, up to the last one that there is: an array is written with sub-index 0 at 0, then its
    /// values, then their number.
    fn module_list(&mut self, slots: Node<'_, '_>, modules: &[u32]) -> Vec<EsiCommand> {
        let count = modules.iter().rposition(|ident| *ident != 0).map_or(0, |last| last + 1);
        let Ok(count) = u8::try_from(count) else {
            let rule = std::format!("have {count} modules, a list of modules has 255");
            self.log.wrong(slots.range().start, "Slots", None, rule);
            return Vec::new();
        };
        let command = |sub: u8, data: Vec<u8>| EsiCommand {
            transitions: Vec::from(["PS".to_string()]),
            index: MODULE_LIST,
            sub,
            data,
            comment: "modules".to_string(),
            ..EsiCommand::default()
        };
        let values = (1..=count).zip(modules);
        let values = values.map(|(sub, ident)| command(sub, ident.to_le_bytes().to_vec()));
        let (begin, end) = (command(0, Vec::from([0])), command(0, Vec::from([count])));
        [begin].into_iter().chain(values).chain([end]).collect()
    }

    /// Adds the PDOs of a device, or of a module of it.
    fn all_pdos(&mut self, node: Node<'_, '_>, device: &mut EsiDevice, shift: Shift) {
        let managers = device.sync_managers.len();
        self.pdos(node, "RxPdo", 0x1600..=0x17FF, managers, shift, &mut device.rx_pdos);
        self.pdos(node, "TxPdo", 0x1A00..=0x1BFF, managers, shift, &mut device.tx_pdos);
    }

    fn pdos(
        &mut self,
        parent: Node<'_, '_>,
        name: &'static str,
        indices: RangeInclusive<i128>,
        managers: usize,
        shift: Shift,
        pdos: &mut Vec<EsiPdo>,
    ) {
        for node in named(parent, name) {
            let what = std::format!("{name} Index");
            let number = self.moved(child(node, "Index"), node, &what, indices.clone(), shift.pdo);
            let Some(index) = number else { continue };
            if pdos.iter().any(|pdo| pdo.index == index) {
                let what = std::format!("{name} 0x{index:04X}");
                self.log
                    .wrong(node.range().start, what, None, "stands twice in the device");
                continue;
            }
            let last = managers.saturating_sub(1) as i128;
            let sync_manager = self.attribute(node, "Sm", 0..=last).map(|number| number as u8);
            let excluded = named(node, "Exclude")
                .filter_map(|other| self.moved(Some(other), node, "Exclude", 0..=0xFFFF, shift.pdo))
                .collect();
            let entries = named(node, "Entry")
                .filter_map(|entry| self.entry(entry, index, shift))
                .collect();
            let pdo = EsiPdo {
                index,
                name: name_of(node),
                sync_manager,
                is_fixed: is_set(node, "Fixed"),
                is_mandatory: is_set(node, "Mandatory"),
                excluded,
                entries,
            };
            if pdo.bits() > PDO_BITS_MAX {
                let rule = std::format!("has {} bits, a datagram carries {PDO_BITS_MAX}", pdo.bits());
                self.log
                    .wrong(node.range().start, std::format!("{name} 0x{index:04X}"), None, rule);
            }
            pdos.push(pdo);
        }
    }

    fn entry(&mut self, node: Node<'_, '_>, pdo: u16, shift: Shift) -> Option<EsiEntry> {
        let what = |field: &str| std::format!("PDO 0x{pdo:04X} Entry {field}");
        let index = self.moved(child(node, "Index"), node, &what("Index"), 0..=0xFFFF, shift.object)?;
        let bits = self.needed(child(node, "BitLen"), node, &what("BitLen"), 1..=255)?;
        let sub = self.number(node, "SubIndex", 0..=255).unwrap_or(0);
        Some(EsiEntry {
            index,
            sub: sub as u8,
            bits: bits as u8,
            name: name_of(node),
            data_type: child(node, "DataType").map_or_else(String::new, |of| words(of).to_string()),
        })
    }

    fn coe(&mut self, node: Node<'_, '_>) -> EsiCoe {
        EsiCoe {
            information: is_set(node, "SdoInfo"),
            assign: is_set(node, "PdoAssign"),
            configure: is_set(node, "PdoConfig"),
            complete_access: is_set(node, "CompleteAccess"),
            start: named(node, "InitCmd")
                .filter_map(|command| self.command(command, 0))
                .collect(),
        }
    }

    fn command(&mut self, node: Node<'_, '_>, by: u32) -> Option<EsiCommand> {
        let index = self.moved(child(node, "Index"), node, "InitCmd Index", 0..=0xFFFF, by)?;
        let what = |field: &str| std::format!("InitCmd 0x{index:04X} {field}");
        let sub = self.needed(child(node, "SubIndex"), node, &what("SubIndex"), 0..=255)?;
        let Some(data) = child(node, "Data") else {
            self.log.wrong(node.range().start, what("Data"), None, "is missing");
            return None;
        };
        let digits: String = words(data).split_whitespace().collect();
        let octet = |pair: &[u8]| {
            let text = std::str::from_utf8(pair)
                .ok()
                .filter(|text| text.bytes().all(|digit| digit.is_ascii_hexdigit()));
            text.and_then(|text| u8::from_str_radix(text, 16).ok())
        };
        let octets: Option<Vec<u8>> = digits.as_bytes().chunks(2).map(octet).collect();
        let octets = octets.filter(|octets| digits.len().is_multiple_of(2) && (1..=DATA_MAX).contains(&octets.len()));
        let Some(octets) = octets else {
            let rule = std::format!("expected 1 to {DATA_MAX} octets of two hex digits each");
            self.log.wrong(text_at(data), what("Data"), Some(words(data)), rule);
            return None;
        };
        let mut transitions = Vec::new();
        for transition in named(node, "Transition") {
            let text = words(transition);
            if matches!(
                text,
                "IP" | "PS" | "SO" | "SP" | "OP" | "OS" | "PI" | "SI" | "OI" | "IB" | "BI"
            ) {
                transitions.push(text.to_string());
            } else {
                let rule = "expected a step of the state machine such as PS";
                self.log
                    .wrong(text_at(transition), what("Transition"), Some(text), rule);
            }
        }
        Some(EsiCommand {
            transitions,
            index,
            sub: sub as u8,
            complete: is_set(node, "CompleteAccess"),
            data: octets,
            comment: child(node, "Comment").map_or_else(String::new, |comment| words(comment).to_string()),
        })
    }

    fn op_mode(&mut self, node: Node<'_, '_>) -> Option<EsiOpMode> {
        const NS: RangeInclusive<i128> = 0..=u32::MAX as i128;
        const SIGNED: RangeInclusive<i128> = i32::MIN as i128..=i32::MAX as i128;
        let activate = self.needed(child(node, "AssignActivate"), node, "OpMode AssignActivate", 0..=0xFFFF)?;
        let mut factor = |name: &'static str| {
            let cycle = child(node, name)?;
            self.attribute(cycle, "Factor", SIGNED)
        };
        let (factor_sync0, factor_sync1) = (factor("CycleTimeSync0"), factor("CycleTimeSync1"));
        Some(EsiOpMode {
            name: name_of(node),
            activate: activate as u16,
            cycle_sync0_ns: self.number(node, "CycleTimeSync0", NS).unwrap_or(0) as u32,
            factor_sync0: factor_sync0.unwrap_or(1) as i32,
            shift_sync0_ns: self.number(node, "ShiftTimeSync0", SIGNED).unwrap_or(0) as i32,
            cycle_sync1_ns: self.number(node, "CycleTimeSync1", NS).unwrap_or(0) as u32,
            factor_sync1: factor_sync1.unwrap_or(1) as i32,
            shift_sync1_ns: self.number(node, "ShiftTimeSync1", SIGNED).unwrap_or(0) as i32,
        })
    }

    /// What is assigned out of the box has to fit into its SyncManager.
    fn check_sizes(&mut self, node: Node<'_, '_>, device: &EsiDevice) {
        for (number, manager) in device.sync_managers.iter().enumerate() {
            let Some(most) = manager.max_size else { continue };
            let all = device.rx_pdos.iter().chain(&device.tx_pdos);
            let own = all.filter(|pdo| pdo.sync_manager.map(usize::from) == Some(number));
            let octets = own.map(EsiPdo::bits).sum::<u32>().div_ceil(8);
            if octets > u32::from(most) {
                let what = std::format!("Device {} Sm {number}", device.name);
                let rule = std::format!("its PDOs have {octets} octets, its MaxSize is {most}");
                self.log.wrong(node.range().start, what, None, rule);
            }
        }
    }
}

fn usage(text: &str) -> EsiUsage {
    match text {
        "MBoxOut" => EsiUsage::MailboxOut,
        "MBoxIn" => EsiUsage::MailboxIn,
        "Outputs" => EsiUsage::Outputs,
        "Inputs" => EsiUsage::Inputs,
        "MBoxState" => EsiUsage::MailboxState,
        _ => EsiUsage::Other,
    }
}
