//! `[bus]`: the wire, how the network starts, and how the nodes share the cycle.
//!
//! In:  the table of the machine file. Out: a [`Bus`] whose nodes fit together; whether its worst cycle fits the cycle is judged by `bus::check`.

use super::bus_types::{Bus, BusKind, Protocol};
use super::cross;
use super::drive::DriveUse;
use super::ethercat::Ethercat;
use super::node::{self, Names};
use super::powerlink::Powerlink;
use super::protocol::{Keys, Network};
use super::section::Section;
#[cfg(feature = "testing")]
use super::toy::{self, Toy};
use std::path::Path;

/// The part of a kind of bus. Of a kind that is not known yet, and where there is no bus, it is POWERLINK's.
fn keys_of(kind: Option<BusKind>) -> &'static dyn Keys {
    match kind.map_or(Protocol::None, BusKind::protocol) {
        Protocol::Powerlink | Protocol::None => &Powerlink,
        Protocol::Ethercat => &Ethercat,
        #[cfg(feature = "testing")]
        Protocol::Toy => &Toy,
    }
}

fn kind(section: &mut Section<'_, '_>) -> Option<BusKind> {
    #[cfg(feature = "testing")]
    if toy::is_meant(section) {
        return Some(BusKind::Toy);
    }
    section.word("kind", &BusKind::WORDS, None)
}

pub(super) fn bus(
    section: &mut Section<'_, '_>,
    cycle_us: Option<u32>,
    folder: &Path,
    uses: &[DriveUse],
) -> Option<Bus> {
    let kind = kind(section);
    let interface = interface(section, kind);
    let keys = keys_of(kind);
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
        match cross::cross(&nodes, own, pending) {
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

fn interface(section: &mut Section<'_, '_>, kind: Option<BusKind>) -> Option<String> {
    let text = match kind.is_some_and(BusKind::has_interface) {
        true => section.text("interface", "the network interface of the bus")?,
        false => match section.optional_text("interface")? {
            Some(text) => text,
            None => return Some(String::new()),
        },
    };
    // What the kernel takes as the name of an interface.
    let valid = (1..=15).contains(&text.len()) && text.bytes().all(|octet| octet.is_ascii_graphic() && octet != b'/');
    if !valid {
        let rule = "must be the name of a network interface: 1 to 15 characters, no blank and no /";
        section.wrong("interface", rule);
    }
    valid.then(|| text.to_owned())
}
