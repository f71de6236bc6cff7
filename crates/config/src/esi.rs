//! The ESI file that a node of EtherCAT names, and the modules in its slots.
//!
//! In:  `device_file`, `modules`, `product_code` and `revision` of a `[[bus.node]]`. Out: the device of the file that the node is, what it
//! exchanges as it comes, and what it is told at its start.

use super::bus_types::{Identity, Mapped, Pdo, StartCommand};
use super::channels::{ObjectKind, Typed};
use super::device::MISTAKES_TOLD;
use super::document::Item;
use super::error::nearest;
use super::section::Section;
use obd::device::{DeviceErrors, EsiChoice, EsiDevice, EsiFile, EsiModule, EsiPdo, EsiSlot, parse_esi, parse_esi_with};
use std::path::Path;

/// An ESI file and the device of it that a node is.
pub(super) struct Esi {
    pub(super) file: String,
    vendor: u32,
    pub(super) device: EsiDevice,
}

impl Esi {
    /// What the device must be, as far as the file tells; the revision is only checked where the machine file asks for it.
    pub(super) fn identity(&self) -> Identity {
        Identity {
            vendor_id: Some(self.vendor),
            product_code: Some(self.device.product),
            ..Identity::default()
        }
    }

    /// Objects that the device exchanges as it comes, which may be none in a direction; `None`: some that are not exchanged, or none in
    /// either direction although it has some that could be.
    pub(super) fn usual(&self, outputs: bool) -> Option<Vec<Mapped>> {
        let assigned: Vec<&EsiPdo> = self.device.assigned(outputs).collect();
        let objects = objects(&assigned).ok()?;
        let has_others = self.device.assigned(!outputs).next().is_some();
        (!objects.is_empty() || has_others || self.pdos(outputs).is_empty()).then_some(objects)
    }

    /// What the types of entries say of their bits. Of octets that several entries share nothing is said.
    pub(super) fn types(&self) -> Vec<Typed> {
        let pdos = self.device.rx_pdos.iter().chain(&self.device.tx_pdos);
        let entries = pdos.flat_map(|pdo| &pdo.entries);
        let typed = entries.filter_map(|entry| {
            let kind = match (&*entry.data_type, entry.bits) {
                ("SINT" | "INT" | "DINT" | "LINT", 8 | 16 | 32 | 64) => ObjectKind::Signed,
                ("USINT" | "UINT" | "UDINT" | "ULINT", 16 | 32 | 64) => ObjectKind::Unsigned,
                ("REAL", 32) | ("LREAL", 64) => ObjectKind::Real,
                _ => return None,
            };
            (entry.index != 0).then_some((entry.index, entry.sub, kind))
        });
        typed.collect()
    }

    pub(super) fn pdos(&self, outputs: bool) -> &[EsiPdo] {
        if outputs {
            &self.device.rx_pdos
        } else {
            &self.device.tx_pdos
        }
    }

    /// PDOs of the file, in any order, whose entries are these objects one behind the other.
    pub(super) fn cover(&self, outputs: bool, wanted: &[Mapped]) -> Option<Vec<Pdo>> {
        let pdos = self.pdos(outputs);
        let as_it_is = |pdo: &EsiPdo| Pdo {
            index: pdo.index,
            entries: Vec::new(),
        };
        // All that are assigned, whose bits may share octets.
        if self.usual(outputs).is_some_and(|usual| usual == wanted) {
            return Some(self.device.assigned(outputs).map(as_it_is).collect());
        }
        let mut left = wanted;
        let mut found: Vec<Pdo> = Vec::new();
        while !left.is_empty() {
            let fitting = |pdo: &EsiPdo| {
                let own = objects(&[pdo]).unwrap_or_default();
                let is_new = found.iter().all(|other| other.index != pdo.index);
                let is_whole = pdo.bits().is_multiple_of(8);
                (is_new && is_whole && !own.is_empty() && left.starts_with(&own)).then_some(own.len())
            };
            // The longest, and those that are assigned anyway first.
            let fitting = pdos.iter().filter_map(|pdo| Some((fitting(pdo)?, pdo)));
            let (count, best) = fitting.max_by_key(|(count, pdo)| (*count, pdo.sync_manager.is_some()))?;
            left = &left[count..];
            found.push(as_it_is(best));
        }
        Some(found)
    }
}

/// Octets of PDOs in which no entry begins have this index, and their number in the payload as sub-index.
const PADDING: u16 = 0x5FFF;

/// An object of whole octets, and which bits of its first octet are of an entry: the others are gaps.
pub(crate) type Used = (Mapped, u8);

/// What a device exchanges as it comes, in whole octets.
///
/// # Errors
/// The entry that is not exchanged, in words.
pub fn assigned(device: &EsiDevice, outputs: bool) -> Result<Vec<Used>, String> {
    let assigned: Vec<&EsiPdo> = device.assigned(outputs).collect();
    used(&assigned)
}

/// Entries of PDOs one behind the other.
pub(super) fn objects(pdos: &[&EsiPdo]) -> Result<Vec<Mapped>, String> {
    Ok(used(pdos)?.into_iter().map(|(object, _)| object).collect())
}

/// Entries of PDOs one behind the other. Those of less than an octet, and gaps, are gathered into octets, each called by the first
/// entry that begins in it.
fn used(pdos: &[&EsiPdo]) -> Result<Vec<Used>, String> {
    let mut objects: Vec<Used> = Vec::new();
    // Bits of the last octet that are taken, and whether it has its name; 0: it is full.
    let (mut taken, mut is_named) = (0, true);
    for (pdo, entry) in pdos
        .iter()
        .flat_map(|pdo| pdo.entries.iter().map(move |entry| (pdo, entry)))
    {
        let is_gap = entry.index == 0;
        let mut bits = u32::from(entry.bits);
        let object = Mapped {
            index: entry.index,
            sub: entry.sub,
            bits: entry.bits,
        };
        if taken == 0 && !is_gap && matches!(bits, 8 | 16 | 32 | 64) {
            objects.push((object, u8::MAX));
            continue;
        }
        if !is_gap && taken + bits > 8 {
            return Err(format!(
                "PDO 0x{:04X}: entry 0x{:04X}:{} has {bits} bits from bit {taken} of an octet on; exchanged are 8, 16, 32 and 64 bits \
                 from bit 0 on, and what lies within one octet",
                pdo.index, entry.index, entry.sub
            ));
        }
        while bits > 0 {
            if taken == 0 {
                let number = u8::try_from(objects.len() + 1);
                let padding = Mapped {
                    index: PADDING,
                    sub: number.map_err(|_| format!("PDO 0x{:04X}: more than 255 objects", pdo.index))?,
                    bits: 8,
                };
                objects.push((padding, 0));
                is_named = false;
            }
            let part = bits.min(8 - taken);
            if let Some((octet, used)) = objects.last_mut().filter(|_| !is_gap) {
                if !is_named {
                    *octet = Mapped { bits: 8, ..object };
                    is_named = true;
                }
                *used |= (u8::MAX >> (8 - part)) << taken;
            }
            taken = (taken + part) % 8;
            bits -= part;
        }
    }
    Ok(objects)
}

/// Whether objects hold bits that nobody can name.
pub(super) fn have_padding(objects: &[Mapped]) -> bool {
    objects.iter().any(|object| object.index == PADDING)
}

/// Reads the ESI file of a node; `Some(None)`: there is none.
pub(super) fn esi(section: &mut Section<'_, '_>, folder: &Path) -> Option<Option<Esi>> {
    let chosen = modules(section);
    let Some(item) = section.optional("device_file") else {
        if section.has("modules") {
            return section.refused("modules", "needs device_file, an ESI file: it tells slots and modules");
        }
        return Some(None);
    };
    let path = folder.join(item.text(&section.key("device_file"))?);
    let file = path.display().to_string();
    let octets = match files::read(&path, files::read::TEXT_MAX) {
        Ok(octets) => octets,
        Err(error) => {
            return section.refused("device_file", format!("cannot be read: {error}"));
        }
    };
    let parsed = match parse_esi(&file, &octets) {
        Ok(parsed) => parsed,
        Err(errors) => return cannot_be_used(section, &errors),
    };
    let wanted = |section: &mut Section<'_, '_>, key| section.optional_integer(key, 0..=u32::MAX);
    let (product, revision) = (wanted(section, "product_code")?, wanted(section, "revision")?);
    let found = match product {
        Some(product) => parsed.find(product, revision),
        None if parsed.devices.len() == 1 => parsed.devices.first(),
        None => None,
    };
    let Some(device) = found else {
        let all: Vec<String> = parsed
            .devices
            .iter()
            .map(|device| format!("0x{:08X} ({})", device.product, device.name))
            .collect();
        let rule = match product {
            Some(product) => format!(
                "has no device with product_code 0x{product:08X}, only {}",
                all.join(", ")
            ),
            None => format!("has several devices: product_code must be one of {}", all.join(", ")),
        };
        return section.refused("device_file", rule);
    };
    can_be_used(section, &file, device)?;
    let refitted = match chosen? {
        Some(chosen) => {
            let modules = fit(section, &chosen, &parsed, device)?;
            let choice = EsiChoice {
                product: device.product,
                revision: device.revision,
                modules: &modules,
            };
            match parse_esi_with(&file, &octets, Some(choice)) {
                Ok(parsed) => Some(parsed),
                Err(errors) => return cannot_be_used(section, &errors),
            }
        }
        None => None,
    };
    let refitted = refitted
        .as_ref()
        .and_then(|esi| esi.find(device.product, Some(device.revision)));
    let device = refitted.unwrap_or(device);
    can_be_used(section, &file, device)?;
    if let Some(slot) = &device.open_slot {
        let rule = format!(
            "does not tell what {} exchanges: {slot} may hold one of several modules, and none of them is usual (ModuleIdent Default): \
             modules of the node chooses them",
            device.name
        );
        return section.refused("device_file", rule);
    }
    if let Some(why) = &device.moved_by_group {
        return section.refused("device_file", format!("cannot be used for {}: {why}", device.name));
    }
    for (key, outputs) in [("outputs", true), ("inputs", false)] {
        if let (false, Err(why)) = (section.has(key), assigned(device, outputs)) {
            let rule = format!("has {key} that cannot be exchanged as they are: {why}");
            return section.refused("device_file", rule);
        }
    }
    Some(Some(Esi {
        vendor: parsed.vendor,
        device: device.clone(),
        file,
    }))
}

/// The device that is asked for must be without mistakes; others of the file need not.
fn can_be_used(section: &Section<'_, '_>, file: &str, device: &EsiDevice) -> Option<()> {
    for mistake in device.mistakes.iter().take(MISTAKES_TOLD) {
        let rule = format!("cannot be used for {}: {}", device.name, mistake.line(file));
        section.wrong("device_file", rule);
    }
    device.mistakes.is_empty().then_some(())
}

fn cannot_be_used<T>(section: &Section<'_, '_>, errors: &DeviceErrors) -> Option<T> {
    for line in errors.lines().take(MISTAKES_TOLD) {
        section.wrong("device_file", format!("is no ESI file that can be used: {line}"));
    }
    None
}

/// A module that is asked for: its key, its item, its name.
type Asked<'d, 'l> = (String, Item<'d, 'l>, &'l str);

/// `modules`, one for each slot; `Some(None)`: those that are usual.
fn modules<'d, 'l>(section: &mut Section<'d, 'l>) -> Option<Option<Vec<Asked<'d, 'l>>>> {
    section.maybe("modules", |item, path| {
        item.list(path, |item, path| Some((path.to_owned(), item, item.text(path)?)))
    })
}

/// `ModuleIdent` of what is asked for, slot by slot.
fn fit(section: &Section<'_, '_>, chosen: &[Asked<'_, '_>], esi: &EsiFile, device: &EsiDevice) -> Option<Vec<u32>> {
    let fitted: Vec<Option<u32>> = chosen
        .iter()
        .enumerate()
        .map(|(at, (key, item, name))| {
            let fitted = match device.slots.get(at) {
                Some(slot) => fit_one(slot, at + 1, name, &esi.modules),
                None => Err((
                    format!("is too many: {} has {} slots", device.name, device.slots.len()),
                    None,
                )),
            };
            let refused = |(rule, hint)| item.log.wrong(item.value.span(), key, rule, hint);
            fitted.map_err(refused).ok()
        })
        .collect();
    let mut left = device.slots.iter().enumerate().skip(chosen.len());
    if let Some((at, slot)) = left.find(|(_, slot)| slot.is_needed) {
        let rule = format!("ends before {}", cannot_be_empty(slot, at + 1, &esi.modules));
        return section.refused("modules", rule);
    }
    fitted.into_iter().collect()
}

/// `ModuleIdent` of a module by its name or number, in this slot; 0: it is empty.
///
/// # Errors
/// Why it cannot be, and what may be meant.
fn fit_one(slot: &EsiSlot, number: usize, name: &str, modules: &[EsiModule]) -> Result<u32, (String, Option<String>)> {
    if name.is_empty() {
        return match slot.is_needed {
            true => Err((cannot_be_empty(slot, number, modules), None)),
            false => Ok(0),
        };
    }
    let ident = name
        .strip_prefix("0x")
        .and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let is_it = |module: &&EsiModule| module.name == name || Some(module.ident) == ident;
    let found: Vec<u32> = modules.iter().filter(is_it).map(|module| module.ident).collect();
    if found.is_empty() {
        let hint = nearest(name, modules.iter().map(|module| module.name.as_str()));
        return Err((
            "is no module of the device file, by its type or as ModuleIdent like \"0x21\"".to_owned(),
            hint.map(|near| format!("did you mean {near:?}?")),
        ));
    }
    let fitting: Vec<u32> = found.into_iter().filter(|ident| slot.modules.contains(ident)).collect();
    match fitting[..] {
        [ident] => Ok(ident),
        [] => Err((
            format!(
                "cannot stand in slot {number} ({}), which takes {}",
                slot.name,
                takes(slot, modules)
            ),
            None,
        )),
        _ => {
            let all: Vec<String> = fitting.iter().map(|ident| format!("0x{ident:X}")).collect();
            Err((
                format!("is the type of several modules: one of {}", all.join(", ")),
                None,
            ))
        }
    }
}

fn cannot_be_empty(slot: &EsiSlot, number: usize, modules: &[EsiModule]) -> String {
    format!(
        "slot {number} ({}) cannot be empty: it takes {}",
        slot.name,
        takes(slot, modules)
    )
}

/// `DI4 (0x20), AO1 (0x21)`
fn takes(slot: &EsiSlot, modules: &[EsiModule]) -> String {
    const TOLD: usize = 12;
    let own = modules.iter().filter(|module| slot.modules.contains(&module.ident));
    let mut own: Vec<String> = own
        .map(|module| format!("{} (0x{:X})", module.name, module.ident))
        .collect();
    let more = own.len().saturating_sub(TOLD);
    own.truncate(TOLD);
    if more > 0 {
        own.push(format!("{more} more"));
    }
    match own.is_empty() {
        true => "none of the modules of the device file".to_owned(),
        false => own.join(", "),
    }
}

/// Steps of which the mailbox can do what is asked: to PRE-OP, where it comes up, and from there.
const IN_PRE_OP: [&str; 2] = ["IP", "PS"];

/// Start-up commands of an ESI file, without what the control sets from other keys.
pub(super) fn start(esi: &Esi) -> Vec<StartCommand> {
    let commands = esi.device.coe.iter().flat_map(|coe| &coe.start);
    commands
        .filter(|command| {
            command
                .transitions
                .iter()
                .any(|step| IN_PRE_OP.contains(&step.as_str()))
        })
        .filter(|command| !set_by_main_device(command.index, command.sub))
        .map(|command| StartCommand {
            index: command.index,
            sub: command.sub,
            complete: command.complete,
            value: command.data.clone(),
            comment: command.comment.clone(),
        })
        .collect()
}

/// Objects that the control sets itself from other keys of a node.
pub(super) const fn set_by_main_device(index: u16, _sub: u8) -> bool {
    matches!(index, 0x1000 | 0x1001 | 0x1018 | 0x1600..=0x17FF | 0x1A00..=0x1BFF | 0x1C00 | 0x1C12 | 0x1C13)
}
