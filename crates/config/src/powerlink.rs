//! POWERLINK's part of the machine file.
//!
//! In:  tables of the machine file, the XDD that a node names. Out: how the cycle is spent and how the network starts; of a node, when it
//! is asked, and by when it answers.

use super::bus_types::{BusClock, BusKind, BusLink, Exchange, Mapped, Profile, Protocol, Stamp, wire_time_ns};
use super::cross::{PendingCross, pending_cross};
use super::device::{self, IsOurs};
use super::document::Item;
use super::drive_profile::DriveProfile;
use super::error::nearest;
use super::esi::Esi;
use super::protocol::{BusKeys, Foreign, Keys, Network, NodeFacts, NodeKeys};
use super::section::Section;
use obd::device::DeviceDescription;

/// Keys of `[bus]` that are EtherCAT's.
const BUS_OF_ETHERCAT: [Foreign; 2] = [
    ("clock", "is for EtherCAT: on POWERLINK the clock of this PC leads"),
    ("lost_max", "is for EtherCAT: use pres_lost_max"),
];
/// Keys of a node that are EtherCAT's.
const NODE_OF_ETHERCAT: [Foreign; 7] = [
    ("alias", "is for EtherCAT: on POWERLINK the id is the address"),
    ("dc", "is for EtherCAT: nodes of POWERLINK follow the SoC"),
    ("shift_us", "is for EtherCAT: nodes of POWERLINK follow the SoC"),
    ("sync1_us", "is for EtherCAT: nodes of POWERLINK follow the SoC"),
    (
        "pdo_step",
        "is for EtherCAT: a node of POWERLINK has one mapping object in each direction",
    ),
    (
        "watchdog_ms",
        "is for EtherCAT: nodes of POWERLINK count SoCs, bus.soc_lost_max",
    ),
    ("modules", "is for EtherCAT: modules stand in an ESI file"),
];

/// Least and greatest AsyncMTU; and the octets of an Ethernet header, which it does not count.
const ASYNC_MTU: [u16; 2] = [300, 1500];
const ETHERNET_HEADER_LEN: u16 = 14;

/// Shortest cycle on POWERLINK, which asks one node after another, us; EtherCAT asks all of them in one frame.
const CYCLE_MIN_US: u32 = 250;
/// The longest cycle, where the file does not tell one, us.
const CYCLE_MAX_US: u32 = 10_000;

/// PRes time-out where no device file tells the latency, µs.
const PRES_TIMEOUT_US: u32 = 150;

/// Octets of a PRes before its payload.
const PRES_HEADER_OCTETS: usize = 24;
/// What an answer takes besides the latency of its device and its time on the wire, until this side has seen it, µs.
const HOST_ALLOWANCE_US: u32 = 100;

/// POWERLINK's part of the machine file.
pub(super) struct Powerlink;

impl Keys for Powerlink {
    fn foreign_of_bus(&self) -> &'static [Foreign] {
        &BUS_OF_ETHERCAT
    }

    fn foreign_of_node(&self) -> &'static [Foreign] {
        &NODE_OF_ETHERCAT
    }

    fn bus(&self, section: &mut Section<'_, '_>, kind: Option<BusKind>, cycle_us: Option<u32>) -> Option<BusKeys> {
        let is_powerlink = kind.is_some_and(|kind| kind.protocol() == Protocol::Powerlink);
        if let (true, Some(cycle_us @ ..CYCLE_MIN_US)) = (is_powerlink, cycle_us) {
            let rule = format!("takes cycles from {CYCLE_MIN_US} us, machine.cycle_us is {cycle_us}");
            section.wrong("kind", rule);
        }
        let cycle_us = cycle_us.unwrap_or(CYCLE_MAX_US);
        let link = link(section, kind);
        let async_slot_timeout_us = section.integer("async_slot_timeout_us", 1..=cycle_us, 150);
        let async_mtu = async_mtu(section, async_slot_timeout_us);
        let pres_lost_max = section.integer("pres_lost_max", 0..=1000, 3);
        let soc_lost_max = section.integer("soc_lost_max", 0..=100, 3);
        let multiplex_cycles = section.integer("multiplex_cycles", 0..=254, 0);
        let prescaler = section.integer("prescaler", 0..=1000, 2);
        let tap = tap(section, kind);
        Some(BusKeys {
            link: link?,
            async_slot_timeout_us: async_slot_timeout_us?,
            lost_max: pres_lost_max?,
            soc_lost_max: soc_lost_max?,
            multiplex_cycles: multiplex_cycles?,
            async_mtu: async_mtu?,
            prescaler: prescaler?,
            tap: tap?,
            clock: BusClock::Own,
        })
    }

    fn startup(&self, section: &mut Section<'_, '_>) -> Option<Option<u32>> {
        startup(section)
    }

    fn device_file(
        &self,
        section: &mut Section<'_, '_>,
        network: &Network<'_>,
        drive: Option<&DriveProfile>,
    ) -> (Option<Option<DeviceDescription>>, Option<Option<Esi>>) {
        let usual = drive.and_then(|drive| drive.device_file.as_deref());
        let device = device::file(section, network.folder, network.cycle_us, usual);
        (device, Some(None))
    }

    fn exchange(
        &self,
        section: &mut Section<'_, '_>,
        network: &Network<'_>,
        profile: Option<Profile>,
        device: Option<&DeviceDescription>,
    ) -> Option<Exchange> {
        exchange(section, network, profile, device)
    }

    fn node(&self, section: &mut Section<'_, '_>, network: &Network<'_>, facts: &NodeFacts<'_>) -> Option<NodeKeys> {
        let pres_timeout_us = pres_timeout(section, network.cycle_us, facts.device, facts.inputs);
        let (software, pdo_version) = (stamp(section), section.integer("pdo_version", 0..=255, 0));
        Some(NodeKeys {
            pres_timeout_us: pres_timeout_us?,
            software: software?,
            pdo_version: pdo_version?,
            ethercat: None,
        })
    }

    fn written_by_master(&self) -> IsOurs {
        obd::device::set_by_managing_node
    }

    fn cross<'d, 'l>(&self, section: &mut Section<'d, 'l>) -> Option<Vec<PendingCross<'d, 'l>>> {
        pending_cross(section)
    }
}

const NEEDS_INTERFACE: &str = "needs a bus on a network interface";

/// What carries the frames; in memory none of these does.
fn link(section: &mut Section<'_, '_>, kind: Option<BusKind>) -> Option<BusLink> {
    let link = section.word("link", &[("raw", BusLink::Raw), ("pnet", BusLink::Pnet)], BusLink::Raw)?;
    if kind.is_some_and(|kind| kind != BusKind::Powerlink) && link != BusLink::Raw {
        return section.refused("link", NEEDS_INTERFACE);
    }
    Some(link)
}

/// The name of a TAP device; a wire in memory has no other end that could answer.
fn tap(section: &mut Section<'_, '_>, kind: Option<BusKind>) -> Option<Option<String>> {
    let Some(name) = section.optional_text("tap")? else {
        return Some(None);
    };
    let legal = |octet: u8| octet.is_ascii_alphanumeric() || b"-_.".contains(&octet);
    if !(1..=15).contains(&name.len()) || !name.bytes().all(legal) {
        return section.refused("tap", "must be 1 to 15 letters, digits, dashes, underscores or dots");
    }
    if kind.is_some_and(|kind| kind != BusKind::Powerlink) {
        return section.refused("tap", NEEDS_INTERFACE);
    }
    Some(Some(name.to_owned()))
}

/// The longest ASnd; left out: as long as the asynchronous slot allows.
fn async_mtu(section: &mut Section<'_, '_>, slot_us: Option<u32>) -> Option<u16> {
    let [least, most] = ASYNC_MTU;
    let slot_ns = u64::from(slot_us?) * 1000;
    let wire_ns = |mtu: u16| wire_time_ns(usize::from(ETHERNET_HEADER_LEN + mtu));
    let Some(mtu) = section.maybe("async_mtu", |item, path| item.integer(path, least..=most))? else {
        let fitting = (least..=most).rev().find(|mtu| wire_ns(*mtu) <= slot_ns);
        return Some(fitting.unwrap_or(least));
    };
    if wire_ns(mtu) > slot_ns {
        let wire_us = wire_ns(mtu).div_ceil(1000);
        return section.refused(
            "async_mtu",
            format!(
                "takes {wire_us} us on the wire, async_slot_timeout_us leaves {}",
                slot_ns / 1000
            ),
        );
    }
    Some(mtu)
}

/// Names of the bits of 0x1F80; and why the control does not serve one.
const START_UP: [(&str, u8, Option<&str>); 13] = [
    ("start-all-by-broadcast", 1, None),
    ("no-auto-operational", 2, Some(APPLICATION)),
    ("no-start-node", 3, Some(APPLICATION)),
    ("reset-all-on-error", 4, None),
    ("stop-all-on-error", 6, None),
    ("no-auto-preop2", 7, Some(APPLICATION)),
    ("no-auto-ready", 8, Some(APPLICATION)),
    ("check-identity", 9, None),
    ("check-software", 10, None),
    ("check-configuration", 11, None),
    ("no-return-to-preop1", 12, None),
    ("basic-ethernet", 13, Some("a control without its cycle moves nothing")),
    ("redundancy", 14, Some("there is one managing node")),
];
const APPLICATION: &str = "the control always lets the network go on by itself";

/// `startup = ["check-identity", ...]`: bits of 0x1F80; left out: the managing node's defaults.
fn startup(section: &mut Section<'_, '_>) -> Option<Option<u32>> {
    section.maybe("startup", |item, path| {
        let bits = item.list(path, startup_bit)?;
        Some(bits.into_iter().fold(0, |value, bit| value | 1 << bit))
    })
}

fn startup_bit(item: Item<'_, '_>, key: &str) -> Option<u8> {
    let text = item.text(key)?;
    match START_UP.iter().find(|(name, ..)| *name == text) {
        Some((_, bit, None)) => Some(*bit),
        Some((_, bit, Some(reason))) => {
            let rule = format!("is refused: bit {bit} of 0x1F80 is not served, {reason}");
            item.refused(key, rule)
        }
        None => {
            let served = START_UP.iter().filter(|(.., refused)| refused.is_none());
            let served: Vec<&str> = served.map(|(name, ..)| *name).collect();
            let near = nearest(text, START_UP.iter().map(|(name, ..)| *name));
            item.no_word(key, format!("must be one of {}", served.join(", ")), near)
        }
    }
}

/// `multiplex`, `chained` and `async_only`, of which only one can be.
fn exchange(
    section: &mut Section<'_, '_>,
    network: &Network<'_>,
    profile: Option<Profile>,
    device: Option<&DeviceDescription>,
) -> Option<Exchange> {
    let multiplex = section.maybe("multiplex", |item, path| item.integer(path, 1..=254));
    let chained = section.flag("chained", false);
    let async_only = section.flag("async_only", false);
    let features = device.map(|device| &device.features);
    let cannot = |what: &str| {
        device.map_or(String::new(), |device| {
            format!("is not for this device: {} says {what}", device.file)
        })
    };
    match (multiplex?, chained?, async_only?) {
        (None, false, false) => Some(Exchange::Polled),
        (Some(cycle), false, false) => {
            let cycles = network.multiplex_cycles?;
            if cycle > cycles {
                let rule = match cycles {
                    0 => "needs bus.multiplex_cycles, the number of cycles of a round".to_owned(),
                    cycles => format!("must be an integer from 1 to {cycles}, the cycles of a round"),
                };
                return section.refused("multiplex", rule);
            }
            if features.is_some_and(|features| features.multiplexing == Some(false)) {
                return section.refused("multiplex", cannot("DLLCNFeatureMultiplex=\"false\""));
            }
            Some(Exchange::Multiplexed(cycle))
        }
        (None, true, false) => {
            if features.is_some_and(|features| features.chaining == Some(false)) {
                return section.refused("chained", cannot("DLLCNPResChaining=\"false\""));
            }
            Some(Exchange::Chained)
        }
        (None, false, true) if profile == Some(Profile::Cia402) => {
            section.refused("async_only", "cannot be: a drive is not run without process data")
        }
        (None, false, true) => Some(Exchange::AsyncOnly),
        (multiplex, chained, _) => {
            let key = if multiplex.is_none() && chained {
                "chained"
            } else {
                "async_only"
            };
            let key = if multiplex.is_some() { "multiplex" } else { key };
            let rule = "cannot stand together: multiplex, chained and async_only exclude each other";
            section.refused(key, rule)
        }
    }
}

/// The PRes time-out; left out: from the latency that the device file tells.
fn pres_timeout(
    section: &mut Section<'_, '_>,
    cycle_us: Option<u32>,
    device: Option<&DeviceDescription>,
    inputs: Option<&[Mapped]>,
) -> Option<u32> {
    let cycle_us = cycle_us.unwrap_or(CYCLE_MAX_US);
    let octets: usize = inputs
        .unwrap_or(&[])
        .iter()
        .map(|object| usize::from(object.bits / 8))
        .sum();
    let wire_ns = wire_time_ns(PRES_HEADER_OCTETS + octets);
    let latency = device.and_then(|device| Some((device, device.features.pres_latency_ns?)));
    let answer_us = latency.map(|(_, latency_ns)| (u64::from(latency_ns) + wire_ns).div_ceil(1000) as u32);
    let default_us = answer_us.map_or(PRES_TIMEOUT_US, |answer_us| answer_us.saturating_add(HOST_ALLOWANCE_US));
    let timeout_us = section.integer("pres_timeout_us", 1..=cycle_us, default_us)?;
    if let (Some((device, latency_ns)), Some(answer_us)) = (latency, answer_us)
        && timeout_us < answer_us
    {
        let rule = format!(
            "must be at least {answer_us}: by {} the device may take {latency_ns} ns, its PRes {wire_ns} ns on the wire",
            device.file
        );
        return section.refused("pres_timeout_us", rule);
    }
    Some(timeout_us)
}

/// `software_date` and `software_time`: both or none.
fn stamp(section: &mut Section<'_, '_>) -> Option<Option<Stamp>> {
    const MS_OF_DAY: u32 = 24 * 60 * 60 * 1000;
    let mut part = |key, most| section.maybe(key, |item, path| item.integer(path, 0..=most));
    let (date, time) = (part("software_date", u32::MAX), part("software_time", MS_OF_DAY - 1));
    match (date?, time?) {
        (None, None) => Some(None),
        (Some(date), Some(time)) => Some(Some(Stamp { date, time })),
        (None, Some(_)) => {
            let rule = "is missing: software_time is only checked together with it";
            section.refused("software_date", rule)
        }
        (Some(_), None) => {
            let rule = "is missing: software_date is only checked together with it";
            section.refused("software_time", rule)
        }
    }
}
