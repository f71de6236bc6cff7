//! What only EtherCAT has: keys of `[bus]` and of `[[bus.node]]`; keys of POWERLINK that mean nothing there.
//!
//! In:  tables of the machine file, the ESI file that a node names. Out: clocks, aliases and PDOs that fit that file.

use super::bus_types::{BusClock, BusKind, BusLink, EthercatNode, Exchange, Mapped, Pdo, Profile, SyncClock};
use super::cross::PendingCross;
use super::device::IsOurs;
use super::drive_profile::DriveProfile;
use super::esi::{Esi, esi, objects, set_by_main_device, start};
use super::protocol::{BusKeys, Foreign, Keys, Network, NodeFacts, NodeKeys};
use super::section::Section;
use cia402::profile::axis_of;
use obd::device::{DeviceDescription, EsiPdo, EsiUsage};

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
const PDO_STEP: u16 = 0x10;
const PDO_STEP_MAX: u16 = 0x40;
/// Objects of axes begin here.
const OF_AXES: u16 = 0x6000;
/// Registers 0980h and 0981h: SYNC0 alone, SYNC0 and SYNC1.
const SYNC0: u16 = 0x0300;
const SYNC0_AND_1: u16 = 0x0700;
/// The bit of register 0981 that switches SYNC1 on.
const SYNC1_ON: u16 = 0x0400;

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
            lost_max: lost_max?,
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

/// Keys of a node beside those that both buses have.
fn node(section: &mut Section<'_, '_>, network: &Network<'_>, facts: &NodeFacts<'_>) -> Option<EthercatNode> {
    let alias = section.optional_integer("alias", 1..=u16::MAX);
    let clock = clock(section, network, facts);
    let watchdog_ms = section.optional_integer("watchdog_ms", 0..=6_553);
    let step = section.integer("pdo_step", 0..=PDO_STEP_MAX, PDO_STEP)?;
    let step = if facts.is_drive { step } else { 0 };
    let (outputs, inputs) = (facts.outputs?, facts.inputs?);
    let fit =
        [(true, outputs), (false, inputs)].map(|(to_device, objects)| fits(section, facts.esi, to_device, objects));
    let outputs = pdos(section, facts.esi, true, step, outputs).filter(|_| fit[0]);
    let inputs = pdos(section, facts.esi, false, step, inputs).filter(|_| fit[1]);
    Some(EthercatNode {
        alias: alias?,
        clock: clock?,
        watchdog_ms: watchdog_ms?,
        outputs: outputs?,
        inputs: inputs?,
        dictionary: facts.esi.and_then(|esi| esi.device.dictionary.clone()),
        types: facts.esi.map_or(Vec::new(), Esi::types),
        start: facts.esi.map_or(Vec::new(), start),
        modules: facts.esi.map_or(Vec::new(), |esi| esi.device.modules.clone()),
    })
}

/// `dc`, `shift_us` and `sync1_us`. Left out: drives follow SYNC0 in the middle between two dates, and so do others whose ESI file has no
/// mode without clocks; by how much the file wants it later, and SYNC1 behind it, is as the file says.
fn clock(section: &mut Section<'_, '_>, network: &Network<'_>, facts: &NodeFacts<'_>) -> Option<Option<SyncClock>> {
    let cycle_us = network.cycle_us.unwrap_or(1000) as i32;
    let is_bus = network.clock.unwrap_or(BusClock::Bus) == BusClock::Bus;
    let modes = facts.esi.map_or(&[][..], |esi| &esi.device.op_modes);
    let mode = modes.iter().find(|mode| mode.activate != 0);
    let has_free_run = modes.iter().any(|mode| mode.activate == 0);
    let wants_clock = match facts.esi {
        None => facts.is_drive,
        Some(_) => mode.is_some() && (facts.is_drive || !has_free_run),
    };
    let usual = is_bus && wants_clock;
    let dc = section
        .maybe("dc", |item, path| item.flag(path))
        .map(|dc| dc.unwrap_or(usual));
    let shift_us = section.optional_integer("shift_us", -cycle_us..=cycle_us);
    let sync1_us = section.optional_integer("sync1_us", 0..=cycle_us);
    if dc? && !is_bus {
        return section.refused("dc", "needs bus.clock = \"bus\": SYNC0 comes by the clock of the bus");
    }
    if !dc? {
        for key in ["shift_us", "sync1_us"] {
            if section.has(key) {
                return section.refused(key, "needs dc = true: without a clock there is no SYNC0");
            }
        }
        return Some(None);
    }
    let cycle_ns = cycle_us * 1000;
    let later_ns = mode
        .map_or(0, |mode| mode.shift_sync0_ns)
        .clamp(-cycle_ns / 2, cycle_ns / 2);
    let shift_ns = shift_us?.map_or(cycle_ns / 2 + later_ns, |us| us * 1000);
    let sync1 = sync1_us?;
    // Register 09A4: the time from SYNC0 to SYNC1.
    let of_file = mode.filter(|mode| mode.activate & SYNC1_ON != 0);
    let of_file_ns = of_file.map_or(0, |mode| {
        i64::from(mode.cycle_sync1_ns) + i64::from(mode.shift_sync1_ns)
    });
    let activate = match (sync1, mode) {
        (Some(_), _) => SYNC0_AND_1,
        (None, Some(mode)) => mode.activate,
        (None, None) => SYNC0,
    };
    Some(Some(SyncClock {
        activate,
        shift_ns,
        sync1_ns: sync1.map_or(of_file_ns.clamp(0, i64::from(cycle_ns)) as u32, |us| {
            us.unsigned_abs() * 1000
        }),
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
        return section.refused(key, rule);
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
            return section.refused(key, rule);
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
