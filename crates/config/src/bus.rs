//! `[bus]`: the wire, how the network starts, and how the nodes share the cycle.
//!
//! In:  the table of the machine file. Out: a [`Bus`] whose nodes fit together; whether its worst cycle fits the cycle is judged by `bus::check`.

use super::document::Section;
use super::drive::DriveUse;
use super::keys;
use super::node::{self, Names, Network};
use super::powerlink;
use super::types::{Bus, BusKind};
use std::path::Path;

pub(super) fn bus(
    section: &mut Section<'_, '_>,
    cycle_us: Option<u32>,
    folder: &Path,
    uses: &[DriveUse],
) -> Option<Bus> {
    let kind = section.word("kind", &BusKind::WORDS, None);
    let interface = interface(section, kind);
    let keys = keys::of(kind);
    section.foreign(keys.foreign_of_bus());
    let own = keys.bus(section, kind, cycle_us);
    let startup = keys.startup(section);
    let around = Network {
        folder,
        cycle_us,
        multiplex_cycles: own.as_ref().map(|own| own.multiplex_cycles),
        uses,
        keys,
        clock: own.as_ref().map(|own| own.clock),
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
        match powerlink::cross(&nodes, own, pending) {
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

/// Shorter frames are padded.
const FRAME_OCTETS_MIN: usize = 60;

/// Time on a 100 Mbit/s wire of an Ethernet frame of `octets` without check sequence (4 octets), preamble (8) and gap (12), ns.
pub fn wire_time_ns(octets: usize) -> u64 {
    (octets.max(FRAME_OCTETS_MIN) as u64 + 4 + 8 + 12) * 80
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
