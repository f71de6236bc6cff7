//! What only EtherCAT has: keys of `[bus]` and of `[[bus.node]]`; keys of POWERLINK that mean nothing there.
//!
//! In:  tables of the machine file, the ESI file that a node names. Out: clocks, aliases, PDOs and modules that fit that file, and what it
//! has a device told at its start.

use super::device::IsOurs;
use super::document::{Item, Section};
use super::drive_profile::DriveProfile;
use super::error::nearest;
use super::keys::{BusKeys, Foreign, Keys, NodeFacts, NodeKeys};
use super::node::Network;
use super::powerlink::PendingCross;
use super::types::{
    BusClock, BusKind, BusLink, DeviceDescription, EthercatNode, Exchange, Identity, Mapped, Pdo, Profile,
    StartCommand, SyncClock,
};
use cia402::profile::axis_of;
use obd::device::{
    DeviceErrors, EsiChoice, EsiDevice, EsiFile, EsiModule, EsiPdo, EsiSlot, EsiUsage, parse_esi, parse_esi_with,
};
use std::path::Path;

/// Keys of `[bus]` that are POWERLINK's, and why EtherCAT has none.
const BUS_OF_POWERLINK: [Foreign; 9] = [
    ("link", "frames of EtherCAT go through a packet socket, always"),
    (
        "async_slot_timeout_us",
        "EtherCAT has no asynchronous slot: parameters go in frames of their own between two cycles",
    ),
    ("async_mtu", "EtherCAT has no asynchronous slot"),
    ("pres_lost_max", "the frames of EtherCAT have no PRes: use lost_max"),
    (
        "soc_lost_max",
        "EtherCAT has no SoC: devices have a watchdog, watchdog_ms of the node",
    ),
    ("multiplex_cycles", "EtherCAT exchanges all devices in each cycle"),
    ("prescaler", "EtherCAT has no SoC"),
    ("tap", "IP over EtherCAT (EoE) is not served"),
    ("startup", "0x1F80 is an object of a POWERLINK managing node"),
];
/// Keys of a node that are POWERLINK's, and why EtherCAT has none.
const NODE_OF_POWERLINK: [Foreign; 8] = [
    ("pres_timeout_us", "EtherCAT asks all devices by the same frames"),
    ("multiplex", "EtherCAT exchanges all devices in each cycle"),
    (
        "chained",
        "frames of EtherCAT pass all devices one behind the other, always",
    ),
    ("async_only", "leave outputs and inputs empty"),
    ("software_date", "0x1F52 is an object of POWERLINK"),
    ("software_time", "0x1F52 is an object of POWERLINK"),
    (
        "pdo_version",
        "PDOs of EtherCAT have no version, they are written and read back",
    ),
    ("cross", "devices of EtherCAT do not hear each other"),
];
/// From the PDO of one axis to that of the next, as drives usually have it, and most.
const PDO_STEP: i64 = 0x10;
const PDO_STEP_MAX: i64 = 0x40;
/// Objects of axes begin here.
const OF_AXES: u16 = 0x6000;
/// Registers 0980h and 0981h: SYNC0 alone, SYNC0 and SYNC1.
const SYNC0: u16 = 0x0300;
const SYNC0_AND_1: u16 = 0x0700;

/// Of a POWERLINK node's keys, what they mean here.
const PRES_TIMEOUT_US: u32 = 150;

/// EtherCAT's part of the machine file.
pub(super) struct Ethercat;

impl Keys for Ethercat {
    fn foreign_of_bus(&self) -> &'static [Foreign] {
        &BUS_OF_POWERLINK
    }

    fn foreign_of_node(&self) -> &'static [Foreign] {
        &NODE_OF_POWERLINK
    }

    fn bus(&self, section: &mut Section<'_, '_>, _kind: Option<BusKind>, _cycle_us: Option<u32>) -> Option<BusKeys> {
        let clock = section.word(
            "clock",
            &[("bus", BusClock::Bus), ("own", BusClock::Own)],
            BusClock::Bus,
        );
        let lost_max = section.integer("lost_max", 0..=1000, 3);
        Some(BusKeys {
            link: BusLink::Raw,
            async_slot_timeout_us: 150,
            lost_max: lost_max? as u32,
            soc_lost_max: 3,
            multiplex_cycles: 0,
            async_mtu: 1500,
            prescaler: 2,
            tap: None,
            clock: clock?,
        })
    }

    fn startup(&self, _section: &mut Section<'_, '_>) -> Option<Option<u32>> {
        Some(None)
    }

    fn device_file(
        &self,
        section: &mut Section<'_, '_>,
        network: &Network<'_>,
        _drive: Option<&DriveProfile>,
    ) -> (Option<Option<DeviceDescription>>, Option<Option<Esi>>) {
        (Some(None), esi(section, network.folder))
    }

    fn exchange(
        &self,
        _section: &mut Section<'_, '_>,
        _network: &Network<'_>,
        _profile: Option<Profile>,
        _device: Option<&DeviceDescription>,
    ) -> Option<Exchange> {
        Some(Exchange::Polled)
    }

    fn node(&self, section: &mut Section<'_, '_>, network: &Network<'_>, facts: &NodeFacts<'_>) -> Option<NodeKeys> {
        Some(NodeKeys {
            pres_timeout_us: PRES_TIMEOUT_US,
            software: None,
            pdo_version: 0,
            ethercat: Some(node(section, network, facts)?),
        })
    }

    fn written_by_master(&self) -> IsOurs {
        set_by_main_device
    }

    fn cross<'d, 'l>(&self, _section: &mut Section<'d, 'l>) -> Option<Vec<PendingCross<'d, 'l>>> {
        Some(Vec::new())
    }
}

/// An ESI file and the device of it that a node is.
pub(super) struct Esi {
    file: String,
    vendor: u32,
    device: EsiDevice,
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

    fn pdos(&self, outputs: bool) -> &[EsiPdo] {
        if outputs {
            &self.device.rx_pdos
        } else {
            &self.device.tx_pdos
        }
    }

    /// PDOs of the file, in any order, whose entries are these objects one behind the other.
    fn cover(&self, outputs: bool, wanted: &[Mapped]) -> Option<Vec<Pdo>> {
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
fn objects(pdos: &[&EsiPdo]) -> Result<Vec<Mapped>, String> {
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
fn esi(section: &mut Section<'_, '_>, folder: &Path) -> Option<Option<Esi>> {
    let chosen = modules(section);
    let Some(item) = section.optional("device_file") else {
        if section.has("modules") {
            section.wrong("modules", "needs device_file, an ESI file: it tells slots and modules");
            return None;
        }
        return Some(None);
    };
    let path = folder.join(item.text(&section.key("device_file"))?);
    let file = path.display().to_string();
    let octets = match files::read(&path, files::read::TEXT_MAX) {
        Ok(octets) => octets,
        Err(error) => {
            section.wrong("device_file", format!("cannot be read: {error}"));
            return None;
        }
    };
    let parsed = match parse_esi(&file, &octets) {
        Ok(parsed) => parsed,
        Err(errors) => return cannot_be_used(section, &errors),
    };
    let wanted = |section: &mut Section<'_, '_>, key| section.optional_integer(key, 0..=i64::from(u32::MAX));
    let (product, revision) = (wanted(section, "product_code")?, wanted(section, "revision")?);
    let found = match product {
        Some(product) => parsed.find(product as u32, revision.map(|revision| revision as u32)),
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
        section.wrong("device_file", rule);
        return None;
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
        section.wrong("device_file", rule);
        return None;
    }
    if let Some(why) = &device.moved_by_group {
        section.wrong("device_file", format!("cannot be used for {}: {why}", device.name));
        return None;
    }
    for (key, outputs) in [("outputs", true), ("inputs", false)] {
        if let (false, Err(why)) = (section.has(key), assigned(device, outputs)) {
            section.wrong(
                "device_file",
                format!("has {key} that cannot be exchanged as they are: {why}"),
            );
            return None;
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
    for mistake in device.mistakes.iter().take(super::device::MISTAKES_TOLD) {
        let rule = format!("cannot be used for {}: {}", device.name, mistake.line(file));
        section.wrong("device_file", rule);
    }
    device.mistakes.is_empty().then_some(())
}

fn cannot_be_used<T>(section: &Section<'_, '_>, errors: &DeviceErrors) -> Option<T> {
    for line in errors.lines().take(super::device::MISTAKES_TOLD) {
        section.wrong("device_file", format!("is no ESI file that can be used: {line}"));
    }
    None
}

/// A module that is asked for: its key, its item, its name.
type Asked<'d, 'l> = (String, Item<'d, 'l>, &'l str);

/// `modules`, one for each slot; `Some(None)`: those that are usual.
fn modules<'d, 'l>(section: &mut Section<'d, 'l>) -> Option<Option<Vec<Asked<'d, 'l>>>> {
    let Some(item) = section.optional("modules") else {
        return Some(None);
    };
    let path = section.key("modules");
    let items = item.items(&path)?.into_iter().enumerate();
    let named = items.map(|(at, item)| {
        let key = format!("{path}[{at}]");
        let name = item.text(&key)?;
        Some((key, item, name))
    });
    // Each that is no text is told.
    let named: Vec<Option<Asked<'_, '_>>> = named.collect();
    named.into_iter().collect::<Option<_>>().map(Some)
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
        section.wrong("modules", rule);
        return None;
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
fn start(esi: &Esi) -> Vec<StartCommand> {
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

/// Keys of a node beside those that both buses have.
fn node(section: &mut Section<'_, '_>, network: &Network<'_>, facts: &NodeFacts<'_>) -> Option<EthercatNode> {
    let alias = section.optional_integer("alias", 1..=i64::from(u16::MAX));
    let clock = clock(section, network, facts);
    let watchdog_ms = section.optional_integer("watchdog_ms", 0..=6_553);
    let step = section.integer("pdo_step", 0..=PDO_STEP_MAX, PDO_STEP)?;
    let step = if facts.is_drive { step as u16 } else { 0 };
    let (outputs, inputs) = (facts.outputs?, facts.inputs?);
    let fit =
        [(true, outputs), (false, inputs)].map(|(to_device, objects)| fits(section, facts.esi, to_device, objects));
    let outputs = pdos(section, facts.esi, true, step, outputs).filter(|_| fit[0]);
    let inputs = pdos(section, facts.esi, false, step, inputs).filter(|_| fit[1]);
    Some(EthercatNode {
        alias: alias?.map(|alias| alias as u16),
        clock: clock?,
        watchdog_ms: watchdog_ms?.map(|ms| ms as u16),
        outputs: outputs?,
        inputs: inputs?,
        start: facts.esi.map_or(Vec::new(), start),
        modules: facts.esi.map_or(Vec::new(), |esi| esi.device.modules.clone()),
    })
}

/// `dc`, `shift_us` and `sync1_us`. Left out: drives follow SYNC0 in the middle between two dates, others the frames.
fn clock(section: &mut Section<'_, '_>, network: &Network<'_>, facts: &NodeFacts<'_>) -> Option<Option<SyncClock>> {
    let cycle_us = i64::from(network.cycle_us.unwrap_or(1000));
    let is_bus = network.clock.unwrap_or(BusClock::Bus) == BusClock::Bus;
    let mode = facts
        .esi
        .and_then(|esi| esi.device.op_modes.iter().find(|mode| mode.activate != 0));
    let usual = is_bus && (mode.is_some() || facts.esi.is_none() && facts.is_drive);
    let dc = match section.optional("dc") {
        None => Some(usual),
        Some(item) => item.flag(&section.key("dc")),
    };
    let shift_us = section.optional_integer("shift_us", -cycle_us..=cycle_us);
    let sync1_us = section.optional_integer("sync1_us", 0..=cycle_us);
    if dc? && !is_bus {
        section.wrong("dc", "needs bus.clock = \"bus\": SYNC0 comes by the clock of the bus");
        return None;
    }
    if !dc? {
        for key in ["shift_us", "sync1_us"] {
            if section.has(key) {
                section.wrong(key, "needs dc = true: without a clock there is no SYNC0");
                return None;
            }
        }
        return Some(None);
    }
    let shift_ns = shift_us?.map_or(cycle_us * 500, |us| us * 1000);
    let sync1 = sync1_us?;
    let activate = match (sync1, mode) {
        (Some(_), _) => SYNC0_AND_1,
        (None, Some(mode)) => mode.activate,
        (None, None) => SYNC0,
    };
    Some(Some(SyncClock {
        activate,
        shift_ns: shift_ns as i32,
        sync1_ns: sync1.unwrap_or(0) as u32 * 1000,
    }))
}

/// Process data are kept three times in the memory of a device, which begins here.
const BUFFERS: u32 = 3;
const MEMORY: u16 = 0x1000;

/// Whether process data fit into the memory that the SyncManager of a direction has by the ESI file.
fn fits(section: &Section<'_, '_>, esi: Option<&Esi>, to_device: bool, objects: &[Mapped]) -> bool {
    let (key, usage) = match to_device {
        true => ("outputs", EsiUsage::Outputs),
        false => ("inputs", EsiUsage::Inputs),
    };
    let octets: u32 = objects.iter().map(|object| u32::from(object.bits / 8)).sum();
    let Some(esi) = esi.filter(|_| octets > 0) else {
        return true;
    };
    let managers = || esi.device.sync_managers.iter().enumerate();
    let Some((number, manager)) = managers().find(|(_, manager)| manager.usage == usage) else {
        return true;
    };
    let (file, start) = (&esi.file, manager.start);
    let end = u32::from(start) + BUFFERS * octets;
    let has_buffers = manager.control & 3 == 0 && start >= MEMORY;
    let behind = managers()
        .filter(|(_, behind)| behind.start > start)
        .min_by_key(|(_, behind)| behind.start);
    let rule = match (manager.max_size, behind) {
        (Some(most), _) if octets > u32::from(most) => {
            format!("do not fit SyncManager {number}: they have {octets} octets, by {file} it holds {most}")
        }
        (_, Some((other, behind))) if has_buffers && end > u32::from(behind.start) => format!(
            "do not fit SyncManager {number}: {BUFFERS} x {octets} octets from 0x{start:04X} on end at 0x{end:04X}, by {file} SyncManager \
             {other} begins at 0x{:04X}",
            behind.start
        ),
        _ => return true,
    };
    section.wrong(key, rule);
    false
}

/// PDOs whose entries are these objects: those of the ESI file where they are so, else one for each axis from 1600h or 1A00h on,
/// written anew.
fn pdos(
    section: &Section<'_, '_>,
    esi: Option<&Esi>,
    to_device: bool,
    step: u16,
    wanted: &[Mapped],
) -> Option<Vec<Pdo>> {
    if wanted.is_empty() {
        return Some(Vec::new());
    }
    if let Some(own) = esi.and_then(|esi| esi.cover(to_device, wanted)) {
        return Some(own);
    }
    let (key, first) = if to_device {
        ("outputs", 0x1600)
    } else {
        ("inputs", 0x1A00)
    };
    let parts = match step {
        0 => vec![(0, wanted)],
        _ => of_axes(wanted),
    };
    let mut axes: Vec<u8> = parts.iter().map(|(axis, _)| *axis).collect();
    axes.sort_unstable();
    if let Some(pair) = axes.windows(2).find(|pair| pair[0] == pair[1]) {
        let axis = pair[0];
        let rule = format!(
            "must hold the objects of axis {axis} one behind the other: each axis has a PDO of its own (pdo_step = 0: one for all)"
        );
        section.wrong(key, rule);
        return None;
    }
    let indices: Vec<u16> = parts.iter().map(|(axis, _)| first + step * u16::from(*axis)).collect();
    for (esi, index) in esi
        .iter()
        .flat_map(|esi| indices.iter().map(move |index| (esi, *index)))
    {
        let own = esi.pdos(to_device);
        let usual = own.iter().find(|pdo| pdo.index == index);
        let cannot = match (usual, &esi.device.coe) {
            (_, None) => Some("the device has no mailbox by which its PDOs could be changed".to_owned()),
            (None, _) => Some(format!("the device has no PDO 0x{index:04X}")),
            (Some(pdo), _) if pdo.is_fixed => Some(format!("PDO 0x{index:04X} cannot be changed")),
            (Some(_), _) => None,
        };
        if let Some(cannot) = cannot {
            let all: Vec<String> = own.iter().filter_map(told).collect();
            let (file, all) = (&esi.file, all.join(", "));
            let rule = match (own.is_empty(), section.has(key)) {
                (true, _) => format!("must be [] or left out: by {file} the device has no {key}"),
                (false, true) => format!("do not fit {file}: {cannot}; it has {all}"),
                (false, false) => {
                    format!(
                        "are missing: {file} assigns none; list the objects of PDOs of the device, or [] for none: it has {all}"
                    )
                }
            };
            section.wrong(key, rule);
            return None;
        }
    }
    let pdo = |(index, (_, objects)): (u16, (u8, &[Mapped]))| Pdo {
        index,
        entries: objects.iter().map(Mapped::entry).collect(),
    };
    Some(indices.into_iter().zip(parts).map(pdo).collect())
}

/// Objects one behind the other that are of the same axis, and which; those that are of none stand with the ones before them.
fn of_axes(wanted: &[Mapped]) -> Vec<(u8, &[Mapped])> {
    let mut parts = Vec::new();
    let (mut from, mut axis) = (0, None);
    for (at, object) in wanted.iter().enumerate() {
        let own = axis_of(object.index).0;
        let is_of_axis = object.index >= OF_AXES;
        if is_of_axis && axis.is_some_and(|axis| axis != own) {
            parts.push((axis.unwrap_or(0), &wanted[from..at]));
            from = at;
        }
        if is_of_axis {
            axis = Some(own);
        }
    }
    parts.push((axis.unwrap_or(0), &wanted[from..]));
    parts
}

/// `0x1A00 with 0x6041/16, 0x6064/32`
fn told(pdo: &EsiPdo) -> Option<String> {
    let objects = objects(&[pdo]).ok()?;
    let objects: Vec<String> = objects.iter().map(Mapped::to_string).collect();
    Some(format!("0x{:04X} with {}", pdo.index, objects.join(", ")))
}

/// Objects that the control sets itself from other keys of a node.
pub(super) const fn set_by_main_device(index: u16, _sub: u8) -> bool {
    matches!(index, 0x1000 | 0x1001 | 0x1018 | 0x1600..=0x17FF | 0x1A00..=0x1BFF | 0x1C00 | 0x1C12 | 0x1C13)
}
