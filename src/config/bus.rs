//! `[bus]`, `[[bus.node]]` and the PDO mapping strings; how the nodes share the cycle.

use super::document::{Item, Section};
use super::types::{Bus, BusKind, Identity, Mapped, Node, Profile};

/// Time on a 100 Mbit/s wire of a frame of `octets` without its check sequence, with preamble and gap, ns.
fn wire_time_ns(octets: usize) -> u64 {
    const CHECK_SEQUENCE: usize = 4;
    const PREAMBLE_AND_GAP: usize = 20;
    const NS_PER_OCTET: u64 = 80;
    (octets.max(60) + CHECK_SEQUENCE + PREAMBLE_AND_GAP) as u64 * NS_PER_OCTET
}

/// How a cycle is spent in the worst case: every answer comes at its limit.
#[derive(Clone, Debug, PartialEq, Eq)]
struct CycleBudget {
    /// SoC, every PReq and SoA on the wire, ns.
    frames_ns: u64,
    /// Sum of the PRes time-outs, µs.
    pres_us: u64,
    /// The async slot, µs.
    async_us: u64,
}

impl CycleBudget {
    /// The budget of a bus.
    fn of(bus: &Bus) -> CycleBudget {
        /// Ethernet and PReq header.
        const PREQ_PAYLOAD_AT: usize = 24;
        let polls_ns = bus.nodes.iter().map(|node| {
            let payload: usize = node.outputs.iter().map(|object| usize::from(object.bits / 8)).sum();
            wire_time_ns(PREQ_PAYLOAD_AT + payload)
        });
        CycleBudget {
            frames_ns: 2 * wire_time_ns(0) + polls_ns.sum::<u64>(),
            pres_us: bus.nodes.iter().map(|node| u64::from(node.pres_timeout_us)).sum(),
            async_us: u64::from(bus.async_slot_timeout_us),
        }
    }

    /// All together, rounded up to µs.
    fn total_us(&self) -> u64 {
        self.frames_ns.div_ceil(1000) + self.pres_us + self.async_us
    }
}

/// `41 (frames) + 600 (PRes) + 150 (async slot) = 791 us`.
impl std::fmt::Display for CycleBudget {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let CycleBudget {
            frames_ns,
            pres_us,
            async_us,
        } = self;
        let frames_us = frames_ns.div_ceil(1000);
        write!(
            f,
            "{frames_us} (frames) + {pres_us} (PRes) + {async_us} (async slot) = {} us",
            self.total_us()
        )
    }
}

pub(super) fn bus(section: &mut Section<'_, '_>, cycle_us: Option<u32>) -> Option<Bus> {
    let cycle_or_most_us = i64::from(cycle_us.unwrap_or(10_000));
    let kind = section.word(
        "kind",
        &[("powerlink", BusKind::Powerlink), ("memory", BusKind::Memory)],
        None,
    );
    let interface = interface(section, kind);
    let async_slot_timeout_us = section.integer("async_slot_timeout_us", 1..=cycle_or_most_us, 150);
    let pres_lost_max = section.integer("pres_lost_max", 0..=1000, 3);
    let soc_lost_max = section.integer("soc_lost_max", 0..=100, 3);
    let mut nodes = Vec::new();
    let mut used = Names::default();
    let tables = section.some_sections("node");
    let mut complete = !tables.is_empty();
    for mut table in tables {
        match node(&mut table, cycle_or_most_us, &mut used) {
            Some(node) => nodes.push(node),
            None => complete = false,
        }
        table.done();
    }
    section.not_yet(&["cycle_us", "redundancy", "multiplexed_cycles", "prescaler"]);
    if !complete {
        return None;
    }
    let bus = Bus {
        kind: kind?,
        interface: interface?,
        async_slot_timeout_us: async_slot_timeout_us? as u32,
        pres_lost_max: pres_lost_max? as u32,
        soc_lost_max: soc_lost_max? as u32,
        nodes,
    };
    let budget = CycleBudget::of(&bus);
    if let Some(cycle_us) = cycle_us.filter(|cycle_us| budget.total_us() > u64::from(*cycle_us)) {
        let rule = format!("the time-outs do not fit the cycle of {cycle_us} us: {budget}");
        section.wrong("node", rule);
        return None;
    }
    Some(bus)
}

fn interface(section: &mut Section<'_, '_>, kind: Option<BusKind>) -> Option<String> {
    let item = match kind {
        Some(BusKind::Powerlink) => section.required("interface", "the network interface of the bus")?,
        Some(BusKind::Memory) | None => match section.optional("interface") {
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

/// Ids and names that are taken.
#[derive(Default)]
struct Names {
    ids: Vec<u8>,
    names: Vec<String>,
}

fn node(section: &mut Section<'_, '_>, cycle_us: i64, used: &mut Names) -> Option<Node> {
    let id = section.integer("id", 1..=239, None).map(|id| id as u8);
    if let Some(id) = id {
        if used.ids.contains(&id) {
            section.wrong("id", "is taken by a node above");
        }
        used.ids.push(id);
    }
    let name = name(section, id);
    if let Some(name) = &name {
        // Of two nodes of one id, the default name is no mistake of its own.
        if used.names.contains(name) && section.optional("name").is_some() {
            section.wrong("name", "is taken by a node above");
        }
        used.names.push(name.clone());
    }
    let profile = section.word("profile", &[("cia402", Profile::Cia402), ("io", Profile::Io)], None);
    let mandatory = section.flag("mandatory", true);
    let pres_timeout_us = section.integer("pres_timeout_us", 1..=cycle_us, 150);
    let mut object = |key| match section.optional(key) {
        None => Some(None),
        Some(item) => item
            .integer(&section.key(key), 0..=i64::from(u32::MAX))
            .map(|value| Some(value as u32)),
    };
    let (device_type, vendor_id) = (object("device_type"), object("vendor_id"));
    let (product_code, revision, serial) = (object("product_code"), object("revision"), object("serial"));
    let outputs = mapping(section, "outputs", profile);
    let inputs = mapping(section, "inputs", profile);
    section.not_yet(&["device_file", "multiplex", "sdo", "chained"]);
    Some(Node {
        id: id?,
        name: name?,
        profile: profile?,
        mandatory: mandatory?,
        pres_timeout_us: pres_timeout_us? as u32,
        identity: Identity {
            device_type: device_type?,
            vendor_id: vendor_id?,
            product_code: product_code?,
            revision: revision?,
            serial: serial?,
        },
        outputs: outputs?,
        inputs: inputs?,
    })
}

fn name(section: &mut Section<'_, '_>, id: Option<u8>) -> Option<String> {
    match section.optional("name") {
        None => id.map(|id| format!("node-{id}")),
        Some(item) => {
            let text = item.text(&section.key("name"))?;
            let valid = is_name(text);
            if !valid {
                section.wrong("name", NAME_RULE);
            }
            valid.then(|| text.to_owned())
        }
    }
}

pub(super) const NAME_RULE: &str = "must be 1 to 48 letters, digits, dashes, underscores or dots, a letter first";

/// Whether a text may name a machine or a node; such names stand in file names and messages.
pub(super) fn is_name(text: &str) -> bool {
    (1..=48).contains(&text.len())
        && text.starts_with(|first: char| first.is_ascii_alphabetic())
        && text
            .bytes()
            .all(|octet| octet.is_ascii_alphanumeric() || b"-_.".contains(&octet))
}

/// Most octets of process data in one PReq or PRes.
const PAYLOAD_OCTETS_MAX: usize = 1490;

fn mapping(section: &mut Section<'_, '_>, key: &'static str, profile: Option<Profile>) -> Option<Vec<Mapped>> {
    let path = section.key(key);
    let Some(list) = section.optional(key) else {
        return Some(default_mapping(key, profile?));
    };
    let mut objects: Vec<Mapped> = Vec::new();
    let items = list.items(&path)?;
    let mut valid = true;
    for (index, item) in items.into_iter().enumerate() {
        match mapped(item, &format!("{path}[{index}]"), profile, &objects) {
            Some(object) => objects.push(object),
            None => valid = false,
        }
    }
    if !valid {
        return None;
    }
    let octets: usize = objects.iter().map(|object| usize::from(object.bits / 8)).sum();
    if octets > PAYLOAD_OCTETS_MAX {
        let rule = format!("must not hold more than {PAYLOAD_OCTETS_MAX} octets, holds {octets}");
        section.wrong(key, rule);
        return None;
    }
    if objects.len() > 254 {
        section.wrong(key, "must not hold more than 254 objects");
        return None;
    }
    if profile == Some(Profile::Cia402) {
        for index in required_of_drives(key) {
            if !objects.iter().any(|object| object.index == index && object.sub == 0) {
                let bits = length_of(index, 0).unwrap_or(32);
                section.wrong(
                    key,
                    format!(
                        "must hold {:?}: a drive is not run without it",
                        format!("0x{index:04X}/{bits}")
                    ),
                );
                valid = false;
            }
        }
    }
    valid.then_some(objects)
}

fn mapped(item: Item<'_, '_>, key: &str, profile: Option<Profile>, before: &[Mapped]) -> Option<Mapped> {
    let text = item.text(key)?;
    let rule = match parse_mapped(text) {
        None => "must be an object with its length, like \"0x6041/16\" or \"0x60FE:1/32\"".to_owned(),
        Some(object) if object.index < 0x1000 => "must be an object from 0x1000 on; below are data types".to_owned(),
        Some(object) if !matches!(object.bits, 8 | 16 | 32 | 64) => {
            "must have a length of 8, 16, 32 or 64 bits".to_owned()
        }
        Some(object)
            if before
                .iter()
                .any(|other| (other.index, other.sub) == (object.index, object.sub)) =>
        {
            "is mapped twice".to_owned()
        }
        Some(object) => match length_of(object.index, object.sub) {
            Some(bits) if profile == Some(Profile::Cia402) && bits != object.bits => {
                format!("must have the length {bits} that the drive profile gives it")
            }
            _ => return Some(object),
        },
    };
    item.log.wrong(item.value.span(), key, rule, None);
    None
}

/// `0x60FE:1/32`; the sub-index is decimal and may be left out.
fn parse_mapped(text: &str) -> Option<Mapped> {
    let digits = |text: &str| text.bytes().next().is_some_and(|octet| octet.is_ascii_hexdigit());
    let (object, bits) = text.split_once('/')?;
    let (index, sub) = object.split_once(':').unwrap_or((object, "0"));
    let index = index.strip_prefix("0x").or(index.strip_prefix("0X"))?;
    if ![index, sub, bits].into_iter().all(digits) {
        return None;
    }
    Some(Mapped {
        index: u16::from_str_radix(index, 16).ok()?,
        sub: sub.parse().ok()?,
        bits: bits.parse().ok()?,
    })
}

/// What the control must send to (`outputs`) and hear from (`inputs`) a drive.
fn required_of_drives(key: &str) -> [u16; 2] {
    if key == "outputs" {
        [0x6040, 0x607A]
    } else {
        [0x6041, 0x6064]
    }
}

/// Length in bits of objects that CiA 402 lets be mapped; `None`: not in this table.
fn length_of(index: u16, sub: u8) -> Option<u8> {
    Some(match (index, sub) {
        (0x6060 | 0x6061, 0) => 8,
        (0x603F | 0x6040 | 0x6041 | 0x6071 | 0x6072 | 0x6074 | 0x6077 | 0x6078 | 0x60B2 | 0x60B8 | 0x60B9, 0) => 16,
        (
            0x6062..=0x6065 | 0x6069 | 0x606B | 0x606C | 0x607A | 0x60B0 | 0x60B1 | 0x60F4 | 0x60FC | 0x60FD | 0x60FF,
            0,
        ) => 32,
        (0x60FE | 0x60C1, 1) | (0x60FE, 2) => 32,
        _ => return None,
    })
}

/// What is mapped where the machine file does not say. Positions stand last: network analysers guess safety frames from
/// the first octets of a payload, and a position can look like one.
fn default_mapping(key: &str, profile: Profile) -> Vec<Mapped> {
    let object = |index, sub, bits| Mapped { index, sub, bits };
    match (profile, key) {
        (Profile::Cia402, "outputs") => {
            vec![
                object(0x6040, 0, 16),
                object(0x6060, 0, 8),
                object(0x60FE, 1, 32),
                object(0x607A, 0, 32),
            ]
        }
        (Profile::Cia402, _) => vec![
            object(0x6041, 0, 16),
            object(0x6061, 0, 8),
            object(0x60FD, 0, 32),
            object(0x603F, 0, 16),
            object(0x6064, 0, 32),
            object(0x60F4, 0, 32),
        ],
        (Profile::Io, "outputs") => vec![object(0x6200, 1, 8), object(0x6200, 2, 8)],
        (Profile::Io, _) => vec![object(0x6000, 1, 8), object(0x6000, 2, 8)],
    }
}
