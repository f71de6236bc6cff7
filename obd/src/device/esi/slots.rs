//! Modular devices: which module stands in which slot, and what it adds to its device.
//!
//! In:  slots, modules, those that are chosen. Out: PDOs and start-up commands of the modules, moved by the number of their slot.

use super::read::{Reader, child, esi_number, is_set, name_of, named, text_at, words};
use super::{EsiCommand, EsiDevice, EsiModule, EsiSlot};
use roxmltree::Node;
use std::ops::RangeInclusive;
use std::string::{String, ToString};
use std::vec::Vec;

/// Most slots of a device.
const SLOTS_MAX: u32 = 256;
/// The list of modules that are expected (ETG.5001): its sub-index is the number of the slot, from 1.
const MODULE_LIST: u16 = 0xF030;
/// A module, and where it stands in the file.
pub(super) struct Module<'a, 'i> {
    pub(super) ident: u32,
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

    pub(super) fn named(&self) -> EsiModule {
        EsiModule {
            ident: self.ident,
            name: child(self.node, "Type").map_or_else(String::new, |kind| words(kind).to_string()),
        }
    }
}

/// By how much objects of a module lie behind those of the same module in the first slot.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shift {
    pub(super) pdo: u32,
    pub(super) object: u32,
}

impl Reader<'_, '_> {
    /// The number of a module; one without is left out.
    pub(super) fn module<'a, 'i>(&mut self, node: Node<'a, 'i>) -> Option<Module<'a, 'i>> {
        let kind = child(node, "Type").filter(|kind| kind.attribute("ModuleIdent").is_some())?;
        let ident = self.attribute(kind, "ModuleIdent", 0..=u32::MAX.into())? as u32;
        Some(Module { ident, node })
    }

    /// Puts the modules that are chosen, else those that are usual, into the slots of a device.
    pub(super) fn slots(&mut self, slots: Node<'_, '_>, device: &mut EsiDevice, modules: &[Module<'_, '_>]) {
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
}
