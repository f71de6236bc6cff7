//! `[bus]`: the wire, how the network starts, and how the nodes share the cycle.
//!
//! In:  the table of the machine file. Out: a [`Bus`] whose nodes fit together; whether its worst cycle fits the cycle is judged by `bus::check`.

use super::document::{Item, Section};
use super::drive::DriveUse;
use super::error::nearest;
use super::ethercat;
use super::node::{self, Names, Network};
use super::types::{Bus, BusClock, BusKind, BusLink};
use std::path::Path;

/// Least and greatest AsyncMTU; and the octets of an Ethernet header, which it does not count.
const ASYNC_MTU: [u16; 2] = [300, 1500];
const ETHERNET_HEADER_LEN: u16 = 14;

/// Shortest cycle on POWERLINK, which asks one node after another, us; EtherCAT asks all of them in one frame.
const POWERLINK_CYCLE_MIN_US: u32 = 250;

pub(super) fn bus(
    section: &mut Section<'_, '_>,
    cycle_us: Option<u32>,
    folder: &Path,
    uses: &[DriveUse],
) -> Option<Bus> {
    let cycle_or_most_us = i64::from(cycle_us.unwrap_or(10_000));
    let kind = section.word("kind", &BusKind::WORDS, None);
    let interface = interface(section, kind);
    let is_ethercat = kind.is_some_and(BusKind::is_ethercat);
    if let (Some(BusKind::Powerlink | BusKind::Memory), Some(cycle_us @ ..POWERLINK_CYCLE_MIN_US)) = (kind, cycle_us) {
        section.wrong(
            "kind",
            format!("takes cycles from {POWERLINK_CYCLE_MIN_US} us, machine.cycle_us is {cycle_us}"),
        );
    }
    section.foreign(if is_ethercat {
        &ethercat::BUS_OF_POWERLINK
    } else {
        &ethercat::BUS_OF_ETHERCAT
    });
    let own = match is_ethercat {
        true => ethercat::bus(section).map(Own::of_ethercat),
        false => Own::of_powerlink(section, kind, cycle_or_most_us),
    };
    let startup = if is_ethercat { Some(None) } else { startup(section) };
    let around = Network {
        folder,
        cycle_us,
        multiplex_cycles: own.as_ref().map(|own| own.multiplex_cycles),
        uses,
        clock: is_ethercat.then(|| own.as_ref().map(|own| own.clock)),
    };
    let mut nodes = Vec::new();
    let mut pending = Vec::new();
    let mut used = Names::default();
    let no_bus = kind == Some(BusKind::None);
    let tables = match no_bus {
        true => section.sections("node"),
        false => section.some_sections("node"),
    };
    if no_bus && !tables.is_empty() {
        section.wrong("node", "cannot be: bus.kind is \"none\"");
    }
    let mut complete = no_bus || !tables.is_empty();
    for mut table in tables {
        match node::node(&mut table, &around, &mut used) {
            Some((node, cross)) => {
                nodes.push(node);
                pending.push(cross);
            }
            None => complete = false,
        }
        table.done();
    }
    if !complete {
        return None;
    }
    for (own, pending) in pending.iter().enumerate() {
        match node::cross(&nodes, own, pending) {
            Some(cross) => nodes[own].cross = cross,
            None => complete = false,
        }
    }
    let own = own?;
    let bus = Bus {
        kind: kind?,
        interface: interface?,
        link: own.link,
        async_slot_timeout_us: own.async_slot_timeout_us,
        pres_lost_max: own.lost_max,
        soc_lost_max: Some(own.soc_lost_max),
        multiplex_cycles: own.multiplex_cycles,
        async_mtu: own.async_mtu,
        prescaler: own.prescaler,
        tap: own.tap,
        startup: startup?,
        clock: own.clock,
        nodes,
    };
    complete.then_some(bus)
}

/// Keys that only one of the buses has; of the other, what they are left out as.
struct Own {
    link: BusLink,
    async_slot_timeout_us: u32,
    lost_max: u32,
    soc_lost_max: u32,
    multiplex_cycles: u8,
    async_mtu: u16,
    prescaler: u16,
    tap: Option<String>,
    clock: BusClock,
}

impl Own {
    const LEFT_OUT: Own = Own {
        link: BusLink::Raw,
        async_slot_timeout_us: 150,
        lost_max: 3,
        soc_lost_max: 3,
        multiplex_cycles: 0,
        async_mtu: ASYNC_MTU[1],
        prescaler: 2,
        tap: None,
        clock: BusClock::Own,
    };

    fn of_powerlink(section: &mut Section<'_, '_>, kind: Option<BusKind>, cycle_us: i64) -> Option<Own> {
        let link = link(section, kind);
        let async_slot_timeout_us = section.integer("async_slot_timeout_us", 1..=cycle_us, 150);
        let async_mtu = async_mtu(section, async_slot_timeout_us);
        let pres_lost_max = section.integer("pres_lost_max", 0..=1000, 3);
        let soc_lost_max = section.integer("soc_lost_max", 0..=100, 3);
        let multiplex_cycles = section.integer("multiplex_cycles", 0..=254, 0);
        let prescaler = section.integer("prescaler", 0..=1000, 2);
        let tap = tap(section, kind);
        Some(Own {
            link: link?,
            async_slot_timeout_us: async_slot_timeout_us? as u32,
            lost_max: pres_lost_max? as u32,
            soc_lost_max: soc_lost_max? as u32,
            multiplex_cycles: multiplex_cycles? as u8,
            async_mtu: async_mtu?,
            prescaler: prescaler? as u16,
            tap: tap?,
            clock: BusClock::Own,
        })
    }

    fn of_ethercat(keys: ethercat::BusKeys) -> Own {
        Own {
            lost_max: keys.lost_max,
            clock: keys.clock,
            ..Own::LEFT_OUT
        }
    }
}

/// Shorter frames are padded.
const FRAME_OCTETS_MIN: usize = 60;

/// Time on a 100 Mbit/s wire of an Ethernet frame of `octets` without check sequence (4 octets), preamble (8) and gap (12), ns.
pub fn wire_time_ns(octets: usize) -> u64 {
    (octets.max(FRAME_OCTETS_MIN) as u64 + 4 + 8 + 12) * 80
}

const NEEDS_INTERFACE: &str = "needs a bus on a network interface";

/// What carries the frames; in memory none of these does.
fn link(section: &mut Section<'_, '_>, kind: Option<BusKind>) -> Option<BusLink> {
    let link = section.word("link", &[("raw", BusLink::Raw), ("pnet", BusLink::Pnet)], BusLink::Raw)?;
    if kind.is_some_and(|kind| kind != BusKind::Powerlink) && link != BusLink::Raw {
        section.wrong("link", NEEDS_INTERFACE);
        return None;
    }
    Some(link)
}

/// The name of a TAP device; a wire in memory has no other end that could answer.
fn tap(section: &mut Section<'_, '_>, kind: Option<BusKind>) -> Option<Option<String>> {
    let Some(item) = section.optional("tap") else {
        return Some(None);
    };
    let name = item.text(&section.key("tap"))?;
    let legal = |octet: u8| octet.is_ascii_alphanumeric() || b"-_.".contains(&octet);
    if !(1..=15).contains(&name.len()) || !name.bytes().all(legal) {
        section.wrong("tap", "must be 1 to 15 letters, digits, dashes, underscores or dots");
        return None;
    }
    if kind.is_some_and(|kind| kind != BusKind::Powerlink) {
        section.wrong("tap", NEEDS_INTERFACE);
        return None;
    }
    Some(Some(name.to_owned()))
}

/// The longest ASnd; left out: as long as the asynchronous slot allows.
fn async_mtu(section: &mut Section<'_, '_>, slot_us: Option<i64>) -> Option<u16> {
    let [least, most] = ASYNC_MTU;
    let slot_ns = slot_us? as u64 * 1000;
    let wire_ns = |mtu: u16| wire_time_ns(usize::from(ETHERNET_HEADER_LEN + mtu));
    let Some(item) = section.optional("async_mtu") else {
        return Some(
            (least..=most)
                .rev()
                .find(|mtu| wire_ns(*mtu) <= slot_ns)
                .unwrap_or(least),
        );
    };
    let mtu = item.integer(&section.key("async_mtu"), i64::from(least)..=i64::from(most))? as u16;
    if wire_ns(mtu) > slot_ns {
        let wire_us = wire_ns(mtu).div_ceil(1000);
        section.wrong(
            "async_mtu",
            format!(
                "takes {wire_us} us on the wire, async_slot_timeout_us leaves {}",
                slot_ns / 1000
            ),
        );
        return None;
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
    let Some(item) = section.optional("startup") else {
        return Some(None);
    };
    let path = section.key("startup");
    let bits = item
        .items(&path)?
        .into_iter()
        .enumerate()
        .map(|(index, item)| startup_bit(item, &format!("{path}[{index}]")));
    // Every name is looked at before one that is wrong ends it.
    let bits: Vec<Option<u8>> = bits.collect();
    let bits = bits.into_iter().collect::<Option<Vec<u8>>>()?;
    Some(Some(bits.into_iter().fold(0, |value, bit| value | 1 << bit)))
}

fn startup_bit(item: Item<'_, '_>, key: &str) -> Option<u8> {
    let text = item.text(key)?;
    match START_UP.iter().find(|(name, ..)| *name == text) {
        Some((_, bit, None)) => Some(*bit),
        Some((_, bit, Some(reason))) => {
            let rule = format!("is refused: bit {bit} of 0x1F80 is not served, {reason}");
            item.log.wrong(item.value.span(), key, rule, None);
            None
        }
        None => {
            let served: Vec<&str> = START_UP
                .iter()
                .filter(|(.., refused)| refused.is_none())
                .map(|(name, ..)| *name)
                .collect();
            let hint = nearest(text, START_UP.iter().map(|(name, ..)| *name));
            let hint = hint.map(|near| format!("did you mean {near:?}?"));
            item.log.wrong(
                item.value.span(),
                key,
                format!("must be one of {}", served.join(", ")),
                hint,
            );
            None
        }
    }
}

fn interface(section: &mut Section<'_, '_>, kind: Option<BusKind>) -> Option<String> {
    let item = match kind {
        Some(kind) if kind.has_interface() => section.required("interface", "the network interface of the bus")?,
        Some(_) | None => match section.optional("interface") {
            Some(item) => item,
            None => return Some(String::new()),
        },
    };
    let text = item.text("bus.interface")?;
    // What the kernel takes as the name of an interface.
    let valid = (1..=15).contains(&text.len()) && text.bytes().all(|octet| octet.is_ascii_graphic() && octet != b'/');
    if !valid {
        section.wrong(
            "interface",
            "must be the name of a network interface: 1 to 15 characters, no blank and no /",
        );
    }
    valid.then(|| text.to_owned())
}

pub(super) const NAME_RULE: &str = "must be 1 to 48 letters, digits, dashes, underscores or dots, a letter first";

/// Whether a text may name a machine or a node; such names stand in file names and messages.
pub fn is_name(text: &str) -> bool {
    (1..=48).contains(&text.len())
        && text.starts_with(|first: char| first.is_ascii_alphabetic())
        && text
            .bytes()
            .all(|octet| octet.is_ascii_alphanumeric() || b"-_.".contains(&octet))
}
