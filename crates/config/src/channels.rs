//! `[[bus.node.channel]]`: inputs and outputs of an I/O node that have a name and a type.
//!
//! In:  tables of the machine file, what the node sends and takes, its device file.
//! Out: [`Channel`]s whose objects are mapped and which do not contradict each other, and what the bits of each object mean
//!      ([`Node::object_kind`](super::Node::object_kind)), of which the pins are made.

use super::objects::{Mapped, Profile};
use super::question::Bound;
use super::section::Section;
use hal_pins::UNIT_LEN_MAX;
use obd::device::DeviceDescription;

/// Longest name of a channel, octets: `io.239.` and what comes behind it fit the name of a pin.
const NAME_LEN_MAX: usize = 32;
/// Greatest factor and offset.
const SCALE_MAX: f64 = 1e12;
/// Greatest raw value that a limit may have: those of all objects of 32 bits fit.
const RAW_MAX: i64 = 1 << 32;

/// An input or output with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// One level of a pin's name: `io.ID.NAME`.
    pub name: String,
    /// The object that holds it; it stands in the payload.
    pub object: Mapped,
    /// Whether the control sends it.
    pub output: bool,
    pub kind: ChannelKind,
    /// Unit of its value; may be empty.
    pub unit: String,
}

/// What a channel is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChannelKind {
    /// One bit.
    Bit { bit: u8 },
    /// An output bit whose switchings are counted.
    Relay { bit: u8 },
    /// A whole number as it is.
    Integer { signed: Option<bool> },
    /// A measured or set quantity: raw value times `scale` plus `offset`.
    Analog {
        signed: Option<bool>,
        scale: f64,
        offset: f64,
        /// Corner frequency of the low-pass filter of an input, Hz.
        filter_hz: Option<f64>,
        /// Least and greatest raw value: beyond them, an input is faulty, and an output never goes.
        raw_min: Option<i64>,
        raw_max: Option<i64>,
    },
    /// A counter that wraps.
    Counter { follow: Follow },
    /// An output whose raw value is a duty cycle.
    Pwm {
        /// Value at which the duty cycle is 1.
        scale: f64,
        /// Raw value at which it is 1.
        full: i64,
    },
}

/// How a counter becomes a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follow {
    /// Counts of one unit; below 0: the other direction.
    pub counts_per_unit: f64,
    /// The object that holds the count at the last index, of the length of the counter.
    pub latch: Option<Mapped>,
}

/// What the bits of a mapped object are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectKind {
    /// Single inputs or outputs.
    Bits,
    Signed,
    Unsigned,
    /// IEEE 754, of 32 or 64 bits.
    Real,
}

/// An object, and what the ESI file of its node says of its bits.
pub type Typed = (u16, u8, ObjectKind);

/// What the bits of an object are, as far as CiA 401 and a device file tell; `types`: those of an ESI file, which knows best.
pub(super) fn kind_of(object: Mapped, device: Option<&DeviceDescription>, types: &[Typed]) -> ObjectKind {
    let typed = types
        .iter()
        .find(|(index, sub, _)| (*index, *sub) == (object.index, object.sub));
    if let Some((_, _, kind)) = typed {
        return *kind;
    }
    // CiA 401: 6000h to 63FFh digital, from 6400h on analog, 6403h and 6413h as real numbers.
    match object.index {
        0x6000..=0x63FF => return ObjectKind::Bits,
        0x6403 | 0x6413 if object.bits == 32 => return ObjectKind::Real,
        0x6400..=0x67FF => return ObjectKind::Signed,
        _ => {}
    }
    let told = device.and_then(|device| device.object(object.index, object.sub)?.data_type);
    // Data types by their index (DS 301): signed from 2 to 4 and of odd lengths, real numbers 8 and 11h.
    match told.map(|told| told.0) {
        Some(0x0002..=0x0004 | 0x0010 | 0x0012..=0x0015) => ObjectKind::Signed,
        Some(0x0008 | 0x0011) => ObjectKind::Real,
        _ if object.bits == 8 => ObjectKind::Bits,
        _ => ObjectKind::Unsigned,
    }
}

/// The word of a type.
#[derive(Clone, Copy, PartialEq)]
enum Word {
    Bit,
    Relay,
    Integer,
    Analog,
    Counter,
    Encoder,
    Pwm,
}

const WORDS: [(&str, Word); 7] = [
    ("bit", Word::Bit),
    ("relay", Word::Relay),
    ("integer", Word::Integer),
    ("analog", Word::Analog),
    ("counter", Word::Counter),
    ("encoder", Word::Encoder),
    ("pwm", Word::Pwm),
];

/// The channels of a node; `payloads`: what it sends and what it takes, `None` where that is wrong itself.
pub(super) fn channels(
    section: &mut Section<'_, '_>,
    profile: Option<Profile>,
    device: Option<&DeviceDescription>,
    types: &[Typed],
    payloads: Option<(&[Mapped], &[Mapped])>,
) -> Option<Vec<Channel>> {
    if section.has("channel") && profile == Some(Profile::Cia402) {
        let rule = "is for nodes of profile \"io\": objects of a drive have pins of their own";
        section.wrong("channel", rule);
    }
    section.tables("channel", |table, above| channel(table, device, types, payloads, above))
}

/// What the keys of a channel say, whatever its type is, so that each key is known; `None` where they are wrong.
struct Asked {
    bit: Option<Option<u8>>,
    signed: Option<Option<bool>>,
    scale: Option<f64>,
    offset: Option<f64>,
    filter_hz: Option<Option<f64>>,
    raw_min: Option<Option<i64>>,
    raw_max: Option<Option<i64>>,
    counts_per_unit: Option<f64>,
    latch: Option<Option<(Mapped, bool)>>,
}

impl Asked {
    fn read(section: &mut Section<'_, '_>, payloads: Option<(&[Mapped], &[Mapped])>) -> Asked {
        Asked {
            bit: section.optional_integer("bit", 0..=63),
            signed: section.maybe("signed", |item, path| item.flag(path)),
            scale: section.number("scale", Bound::Size(SCALE_MAX), 1.0),
            offset: section.number("offset", Bound::Size(SCALE_MAX), 0.0),
            filter_hz: section.optional_number("filter_hz", Bound::Positive(1e6)),
            raw_min: section.optional_integer("raw_min", -RAW_MAX..=RAW_MAX),
            raw_max: section.optional_integer("raw_max", -RAW_MAX..=RAW_MAX),
            counts_per_unit: section.number("counts_per_unit", Bound::Size(SCALE_MAX), 1.0),
            latch: mapped(section, "latch", false, payloads),
        }
    }

    /// Whether its numbers are no zeros, and a range is one.
    fn are_numbers(&self, section: &Section<'_, '_>) -> bool {
        for (key, value) in [("scale", self.scale), ("counts_per_unit", self.counts_per_unit)] {
            if value == Some(0.0) {
                section.wrong(key, "must not be 0");
                return false;
            }
        }
        if let (Some(Some(low)), Some(Some(high))) = (self.raw_min, self.raw_max)
            && low >= high
        {
            section.wrong("raw_max", format!("must be above raw_min, {low}"));
            return false;
        }
        true
    }

    /// An input or output that is scaled; `known`: what the bits of its object are.
    fn analog(
        &self,
        section: &Section<'_, '_>,
        object: Mapped,
        output: bool,
        known: ObjectKind,
    ) -> Option<ChannelKind> {
        let is_signed = self.signed.flatten().unwrap_or(known == ObjectKind::Signed);
        let most = greatest(object, is_signed);
        let least = if is_signed { -most - 1 } else { 0 };
        for (key, value) in [("raw_min", self.raw_min), ("raw_max", self.raw_max)] {
            if let Some(Some(value)) = value
                && known != ObjectKind::Real
                && !(least..=most).contains(&value)
            {
                let word = if is_signed { "a signed" } else { "an unsigned" };
                let rule = format!("must lie between {least} and {most}, what {object} holds as {word} number");
                return section.refused(key, rule);
            }
        }
        if output && section.has("filter_hz") {
            return section.refused("filter_hz", "is for inputs");
        }
        Some(ChannelKind::Analog {
            signed: self.signed?,
            scale: self.scale?,
            offset: self.offset?,
            filter_hz: self.filter_hz?,
            raw_min: self.raw_min?,
            raw_max: self.raw_max?,
        })
    }

    fn counter(&self, section: &Section<'_, '_>, object: Mapped) -> Option<ChannelKind> {
        let latch = self.latch?.map(|(latch, _)| latch);
        if let Some(latch) = latch.filter(|latch| latch.bits != object.bits || *latch == object) {
            let rule = format!("must be another object of the length of the counter {object}, is {latch}");
            return section.refused("latch", rule);
        }
        let counts_per_unit = self.counts_per_unit?;
        Some(ChannelKind::Counter {
            follow: Follow { counts_per_unit, latch },
        })
    }

    fn pwm(&self, section: &Section<'_, '_>, object: Mapped, known: ObjectKind) -> Option<ChannelKind> {
        let greatest = greatest(object, known == ObjectKind::Signed);
        let full = self.raw_max?.unwrap_or(greatest);
        if !(1..=greatest).contains(&full) {
            let rule = format!("must lie between 1 and {greatest}, the greatest value of {object}");
            return section.refused("raw_max", rule);
        }
        Some(ChannelKind::Pwm {
            scale: self.scale?,
            full,
        })
    }
}

/// The greatest number that an object holds.
fn greatest(object: Mapped, signed: bool) -> i64 {
    let bits = u32::from(object.bits) - u32::from(signed);
    i64::try_from((1_u128 << bits) - 1).unwrap_or(i64::MAX)
}

fn channel(
    section: &mut Section<'_, '_>,
    device: Option<&DeviceDescription>,
    types: &[Typed],
    payloads: Option<(&[Mapped], &[Mapped])>,
    before: &[Channel],
) -> Option<Channel> {
    let name = name(section, before);
    let object = mapped(section, "object", true, payloads);
    let known = object
        .flatten()
        .map(|(object, _)| (object, kind_of(object, device, types)));
    let usual = match known {
        _ if section.has("bit") => Word::Bit,
        Some((object, _)) if (0x6400..=0x67FF).contains(&object.index) => Word::Analog,
        Some((_, ObjectKind::Real)) => Word::Analog,
        Some((_, ObjectKind::Bits)) => Word::Bit,
        _ => Word::Integer,
    };
    let word = section.optional_word("type", &WORDS).map(|word| word.unwrap_or(usual));
    let unit = unit(section);
    let asked = Asked::read(section, payloads);
    let word = word?;
    let fits = only_its_keys(section, word);
    let (name, (object, output), unit, known) = (name?, object??, unit?, known?.1);
    let needs = |direction: bool, what: &str| {
        let rule = format!("must be one of the {what} of the node for this type");
        (output != direction).then_some(rule)
    };
    let refusal = match word {
        Word::Relay | Word::Pwm => needs(true, "outputs"),
        Word::Counter | Word::Encoder => needs(false, "inputs"),
        _ if known == ObjectKind::Real && word != Word::Analog => {
            Some("holds a real number: its type is \"analog\"".to_owned())
        }
        _ => None,
    };
    if let Some(rule) = refusal {
        return section.refused("object", rule);
    }
    if !asked.are_numbers(section) {
        return None;
    }
    let kind = match word {
        Word::Bit => ChannelKind::Bit {
            bit: whole_bit(section, asked.bit?, object)?,
        },
        Word::Relay => ChannelKind::Relay {
            bit: whole_bit(section, asked.bit?, object)?,
        },
        Word::Integer => ChannelKind::Integer { signed: asked.signed? },
        Word::Analog => asked.analog(section, object, output, known)?,
        Word::Counter | Word::Encoder => asked.counter(section, object)?,
        Word::Pwm => asked.pwm(section, object, known)?,
    };
    let channel = Channel {
        name,
        object,
        output,
        kind,
        unit,
    };
    (fits && !contradicts(section, &channel, before)).then_some(channel)
}

/// Refuses keys that mean nothing for a type.
fn only_its_keys(section: &mut Section<'_, '_>, word: Word) -> bool {
    let own: &[&str] = match word {
        Word::Bit | Word::Relay => &["bit"],
        Word::Integer => &["signed"],
        Word::Analog => &["signed", "scale", "offset", "filter_hz", "raw_min", "raw_max"],
        Word::Counter => &["counts_per_unit"],
        Word::Encoder => &["counts_per_unit", "latch"],
        Word::Pwm => &["scale", "raw_max"],
    };
    let mut fits = true;
    for key in [
        "bit",
        "signed",
        "scale",
        "offset",
        "filter_hz",
        "raw_min",
        "raw_max",
        "counts_per_unit",
        "latch",
    ] {
        if !own.contains(&key) && section.has(key) {
            let word = WORDS
                .iter()
                .find(|(_, other)| *other == word)
                .map_or("", |(word, _)| word);
            let rule = match own {
                [] => format!("is not for a channel of type {word:?}"),
                own => format!("is not for a channel of type {word:?}, which has: {}", own.join(", ")),
            };
            section.wrong(key, rule);
            fits = false;
        }
    }
    fits
}

/// The bit of an object; an object of one octet or more has as many as it is long.
fn whole_bit(section: &Section<'_, '_>, bit: Option<u8>, object: Mapped) -> Option<u8> {
    match bit {
        None => {
            let rule = format!("has {} bits: `bit` says which, counted from 0", object.bits);
            section.refused("object", rule)
        }
        Some(bit) if bit >= object.bits => {
            let rule = format!("must be an integer from 0 to {}: {object}", object.bits - 1);
            section.refused("bit", rule)
        }
        Some(bit) => Some(bit),
    }
}

/// Whether one of the channels before uses the same bits otherwise, or sets the same output.
fn contradicts(section: &mut Section<'_, '_>, channel: &Channel, before: &[Channel]) -> bool {
    let bit = |kind| match kind {
        ChannelKind::Bit { bit } | ChannelKind::Relay { bit } => Some(bit),
        _ => None,
    };
    for other in before.iter().filter(|other| other.object == channel.object) {
        let rule = match (bit(channel.kind), bit(other.kind)) {
            (Some(own), Some(others)) if own == others => {
                format!("is the channel {:?} above already", other.name)
            }
            (Some(_), Some(_)) => continue,
            (None, None) => format!("is the channel {:?} above already", other.name),
            (Some(_), None) | (None, Some(_)) => {
                format!(
                    "is single bits or one number: the channel {:?} above has it otherwise",
                    other.name
                )
            }
        };
        section.wrong("object", rule);
        return true;
    }
    false
}

fn name(section: &mut Section<'_, '_>, before: &[Channel]) -> Option<String> {
    let text = section.text("name", "the name of the channel, like \"coolant-pump\"")?;
    let is_level = !text.contains('.') && hal_pins::check_name(text).is_ok();
    let is_ours = ["in-", "out-", "object-"].iter().any(|start| text.starts_with(start));
    let ends = ["-raw", "-fault", "-switchings"];
    let rule = if !is_level || text.len() > NAME_LEN_MAX {
        format!(
            "must be lower-case letters, digits and dashes, a letter first, at most {NAME_LEN_MAX}, like \"coolant-pump\""
        )
    } else if is_ours {
        "must not begin with in-, out- or object-: so do pins without a name".to_owned()
    } else if let Some(end) = ends.iter().find(|end| text.ends_with(**end)) {
        format!("must not end with {end}: so does a pin beside a channel")
    } else if before.iter().any(|other| other.name == text) {
        "is taken by a channel above".to_owned()
    } else {
        return Some(text.to_owned());
    };
    section.refused("name", rule)
}

fn unit(section: &mut Section<'_, '_>) -> Option<String> {
    let text = section.optional_text("unit")?.unwrap_or_default();
    if text.len() > UNIT_LEN_MAX || text.contains(char::is_control) {
        let rule = format!("must be at most {UNIT_LEN_MAX} octets, like \"bar\" or \"°C\"");
        return section.refused("unit", rule);
    }
    Some(text.to_owned())
}

/// An object of one of the payloads, and whether it is an output; `Some(None)`: left out.
fn mapped(
    section: &mut Section<'_, '_>,
    key: &'static str,
    required: bool,
    payloads: Option<(&[Mapped], &[Mapped])>,
) -> Option<Option<(Mapped, bool)>> {
    let Some((index, sub)) = section.object(key, required, "0x6200:1")? else {
        return Some(None);
    };
    let (inputs, outputs) = payloads?;
    let find = |objects: &[Mapped]| {
        let is_it = |object: &&Mapped| (object.index, object.sub) == (index, sub);
        objects.iter().find(is_it).copied()
    };
    let found = find(inputs)
        .map(|object| (object, false))
        .or_else(|| Some((find(outputs).filter(|_| required)?, true)));
    if found.is_none() {
        let of = if required { "`inputs` or `outputs`" } else { "`inputs`" };
        let list = |objects: &[Mapped]| {
            let objects: Vec<_> = objects.iter().map(Mapped::to_string).collect();
            objects.join(", ")
        };
        let there = match required {
            true => format!("inputs: {}; outputs: {}", list(inputs), list(outputs)),
            false => format!("inputs: {}", list(inputs)),
        };
        let rule = format!("must stand among the {of} of the node, with its length ({there})");
        section.wrong(key, rule);
    }
    found.map(Some)
}
