//! The elements of an ESI file, one by one: numbers, devices, SyncManagers, PDOs, start-up commands, clocks.

use super::dictionary::dictionary;
use super::slots::{Module, Shift};
use super::{EsiChoice, EsiCoe, EsiCommand, EsiDevice, EsiEntry, EsiFile, EsiOpMode, EsiPdo, EsiSyncManager, EsiUsage};
use crate::device::error::Log;
use crate::device::value::integer;
use crate::device::{DeviceMistake, xml};
use roxmltree::Node;
use std::ops::RangeInclusive;
use std::string::{String, ToString};
use std::vec::Vec;

/// Most bits of a PDO: those of the data that one datagram can carry.
const PDO_BITS_MAX: u32 = 1486 * 8;
/// Longest value of a start-up command, octets.
const DATA_MAX: usize = 4096;

pub(super) fn read(text: &str, log: &mut Log<'_>, choice: Option<EsiChoice<'_>>) -> Option<EsiFile> {
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

pub(super) fn named<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.tag_name().name() == name)
}

pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    named(node, name).next()
}

pub(super) fn words<'a>(node: Node<'a, '_>) -> &'a str {
    node.text().unwrap_or_default().trim()
}

/// The name of something: the English one, where there are several.
pub(super) fn name_of(node: Node<'_, '_>) -> String {
    let english = named(node, "Name").find(|name| name.attribute("LcId") == Some("1033"));
    english
        .or_else(|| child(node, "Name"))
        .map_or_else(String::new, |name| words(name).to_string())
}

/// A number of an ESI file: decimal, or hexadecimal behind `#x`.
pub(super) fn esi_number(text: &str) -> Option<i128> {
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
pub(super) fn text_at(node: Node<'_, '_>) -> usize {
    let text = node.children().find(Node::is_text);
    text.map_or(node.range().start, |text| text.range().start)
}

pub(super) fn is_set(node: Node<'_, '_>, attribute: &str) -> bool {
    matches!(node.attribute(attribute), Some("1" | "true"))
}

/// Reads one file.
pub(super) struct Reader<'r, 't> {
    pub(super) log: &'r mut Log<'t>,
    /// Modules for one of its devices.
    pub(super) choice: Option<EsiChoice<'r>>,
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
    pub(super) fn needed(
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
    pub(super) fn attribute(&mut self, node: Node<'_, '_>, name: &str, range: RangeInclusive<i128>) -> Option<i128> {
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
            dictionary: dictionary(node),
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

    /// Adds the PDOs of a device, or of a module of it.
    pub(super) fn all_pdos(&mut self, node: Node<'_, '_>, device: &mut EsiDevice, shift: Shift) {
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

    pub(super) fn command(&mut self, node: Node<'_, '_>, by: u32) -> Option<EsiCommand> {
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
