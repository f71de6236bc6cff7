//! `[[bus.node.channel]]`: inputs and outputs of an I/O node that have a name and a type.
//!
//! In:  tables of the machine file, what the node sends and takes, its device file.
//! Out: [`Channel`]s whose objects are mapped and which do not contradict each other, and what the bits of each object mean
//!      ([`Node::object_kind`]), of which the pins are made.

use super::document::{Bound, Section};
use super::mapping::parse_object;
use super::types::{DeviceDescription, Mapped, Node, Profile};
use hal_pins::UNIT_LEN_MAX;

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

impl Node {
    /// Whether an object holds single inputs or outputs, whatever channels make of it.
    pub fn is_of_bits(&self, object: Mapped) -> bool {
        kind_of(object, self.device.as_ref()) == ObjectKind::Bits
    }

    /// What the bits of one of its objects are: what a channel says, else its device file, else CiA 401. Of what nobody knows,
    /// octets are bits, and what is longer is a number.
    pub fn object_kind(&self, object: Mapped) -> ObjectKind {
        let known = kind_of(object, self.device.as_ref());
        let as_number = |signed: Option<bool>| match (signed, known) {
            (Some(true), _) | (None, ObjectKind::Signed) => ObjectKind::Signed,
            (None, ObjectKind::Real) => ObjectKind::Real,
            (Some(false), _) | (None, ObjectKind::Unsigned | ObjectKind::Bits) => ObjectKind::Unsigned,
        };
        let named = self.channels.iter().find_map(|channel| match channel.kind {
            ChannelKind::Counter { follow } if follow.latch == Some(object) => Some(ObjectKind::Unsigned),
            _ if channel.object != object => None,
            ChannelKind::Bit { .. } | ChannelKind::Relay { .. } => Some(ObjectKind::Bits),
            ChannelKind::Integer { signed } | ChannelKind::Analog { signed, .. } => Some(as_number(signed)),
            ChannelKind::Counter { .. } => Some(ObjectKind::Unsigned),
            ChannelKind::Pwm { .. } => Some(as_number(None)),
        });
        named.unwrap_or(known)
    }
}

fn kind_of(object: Mapped, device: Option<&DeviceDescription>) -> ObjectKind {
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
    payloads: Option<(&[Mapped], &[Mapped])>,
) -> Option<Vec<Channel>> {
    if section.has("channel") && profile == Some(Profile::Cia402) {
        section.wrong(
            "channel",
            "is for nodes of profile \"io\": objects of a drive have pins of their own",
        );
    }
    let mut found: Vec<Channel> = Vec::new();
    let mut complete = true;
    for mut table in section.sections("channel") {
        match channel(&mut table, device, payloads, &found) {
            Some(channel) => found.push(channel),
            None => complete = false,
        }
        table.done();
    }
    complete.then_some(found)
}

fn channel(
    section: &mut Section<'_, '_>,
    device: Option<&DeviceDescription>,
    payloads: Option<(&[Mapped], &[Mapped])>,
    before: &[Channel],
) -> Option<Channel> {
    let name = name(section, before);
    let object = mapped(section, "object", true, payloads);
    let has_bit = section.has("bit");
    let known = object.flatten().map(|(object, _)| (object, kind_of(object, device)));
    let usual = match known {
        _ if has_bit => Word::Bit,
        Some((object, _)) if (0x6400..=0x67FF).contains(&object.index) => Word::Analog,
        Some((_, ObjectKind::Real)) => Word::Analog,
        Some((_, ObjectKind::Bits)) => Word::Bit,
        _ => Word::Integer,
    };
    let word = match section.optional("type") {
        None => Some(usual),
        Some(item) => item.word(&section.key("type"), &WORDS),
    };
    let unit = unit(section);
    // Asked for whatever the type is, so that each key is known; those of other types are refused below.
    let bit = section.optional_integer("bit", 0..=63);
    let signed = match section.optional("signed") {
        None => Some(None),
        Some(item) => item.flag(&section.key("signed")).map(Some),
    };
    let scale = section.number("scale", Bound::Size(SCALE_MAX), 1.0);
    let offset = section.number("offset", Bound::Size(SCALE_MAX), 0.0);
    let filter_hz = match section.optional("filter_hz") {
        None => Some(None),
        Some(item) => item.number(&section.key("filter_hz"), Bound::Positive(1e6)).map(Some),
    };
    let raw_min = section.optional_integer("raw_min", -RAW_MAX..=RAW_MAX);
    let raw_max = section.optional_integer("raw_max", -RAW_MAX..=RAW_MAX);
    let counts = section.number("counts_per_unit", Bound::Size(SCALE_MAX), 1.0);
    let latch = mapped(section, "latch", false, payloads);
    let word = word?;
    let fits = only_its_keys(section, word);
    let (name, (object, output), unit) = (name?, object??, unit?);
    let needs = |direction: bool, what: &str| {
        let rule = format!("must be one of the {what} of the node for this type");
        (output != direction).then_some(rule)
    };
    let refusal = match word {
        Word::Relay | Word::Pwm => needs(true, "outputs"),
        Word::Counter | Word::Encoder => needs(false, "inputs"),
        _ if matches!(known, Some((_, ObjectKind::Real))) && word != Word::Analog => {
            Some("holds a real number: its type is \"analog\"".to_owned())
        }
        _ => None,
    };
    if let Some(rule) = refusal {
        section.wrong("object", rule);
        return None;
    }
    for (key, value) in [("scale", scale), ("counts_per_unit", counts)] {
        if value == Some(0.0) {
            section.wrong(key, "must not be 0");
            return None;
        }
    }
    if let (Some(Some(low)), Some(Some(high))) = (raw_min, raw_max)
        && low >= high
    {
        section.wrong("raw_max", format!("must be above raw_min, {low}"));
        return None;
    }
    let kind = match word {
        Word::Bit | Word::Relay => {
            let bit = whole_bit(section, bit?, object)?;
            match word {
                Word::Relay => ChannelKind::Relay { bit },
                _ => ChannelKind::Bit { bit },
            }
        }
        Word::Integer => ChannelKind::Integer { signed: signed? },
        Word::Analog => {
            let is_signed = match (signed, &known) {
                (Some(Some(signed)), _) => signed,
                (_, Some((_, kind))) => *kind == ObjectKind::Signed,
                (_, None) => false,
            };
            let is_real = matches!(known, Some((_, ObjectKind::Real)));
            let bits = u32::from(object.bits) - u32::from(is_signed);
            let most = i64::try_from((1_u128 << bits) - 1).unwrap_or(i64::MAX);
            let least = if is_signed { -most - 1 } else { 0 };
            for (key, value) in [("raw_min", raw_min), ("raw_max", raw_max)] {
                if let Some(Some(value)) = value
                    && !is_real
                    && !(least..=most).contains(&value)
                {
                    let word = if is_signed { "a signed" } else { "an unsigned" };
                    section.wrong(
                        key,
                        format!("must lie between {least} and {most}, what {object} holds as {word} number"),
                    );
                    return None;
                }
            }
            if output && section.has("filter_hz") {
                section.wrong("filter_hz", "is for inputs");
                return None;
            }
            ChannelKind::Analog {
                signed: signed?,
                scale: scale?,
                offset: offset?,
                filter_hz: filter_hz?,
                raw_min: raw_min?,
                raw_max: raw_max?,
            }
        }
        Word::Counter | Word::Encoder => {
            let latch = latch?.map(|(latch, _)| latch);
            if let Some(latch) = latch.filter(|latch| latch.bits != object.bits || *latch == object) {
                let rule = format!("must be another object of the length of the counter {object}, is {latch}");
                section.wrong("latch", rule);
                return None;
            }
            let follow = Follow {
                counts_per_unit: counts?,
                latch,
            };
            ChannelKind::Counter { follow }
        }
        Word::Pwm => {
            let signed = matches!(known, Some((_, ObjectKind::Signed)));
            let bits = u32::from(object.bits) - u32::from(signed);
            let greatest = i64::try_from((1_u128 << bits) - 1).unwrap_or(i64::MAX);
            let full = raw_max?.unwrap_or(greatest);
            if !(1..=greatest).contains(&full) {
                section.wrong(
                    "raw_max",
                    format!("must lie between 1 and {greatest}, the greatest value of {object}"),
                );
                return None;
            }
            ChannelKind::Pwm { scale: scale?, full }
        }
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
fn whole_bit(section: &mut Section<'_, '_>, bit: Option<i64>, object: Mapped) -> Option<u8> {
    match bit {
        None => {
            section.wrong(
                "object",
                format!("has {} bits: `bit` says which, counted from 0", object.bits),
            );
            None
        }
        Some(bit) if bit >= i64::from(object.bits) => {
            section.wrong(
                "bit",
                format!("must be an integer from 0 to {}: {object}", object.bits - 1),
            );
            None
        }
        Some(bit) => Some(bit as u8),
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
    let text = section
        .required("name", "the name of the channel, like \"coolant-pump\"")?
        .text(&section.key("name"))?;
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
    section.wrong("name", rule);
    None
}

fn unit(section: &mut Section<'_, '_>) -> Option<String> {
    let Some(item) = section.optional("unit") else {
        return Some(String::new());
    };
    let text = item.text(&section.key("unit"))?;
    if text.len() > UNIT_LEN_MAX || text.contains(char::is_control) {
        section.wrong(
            "unit",
            format!("must be at most {UNIT_LEN_MAX} octets, like \"bar\" or \"°C\""),
        );
        return None;
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
    let item = match required {
        true => Some(section.required(key, "an object of the node, like \"0x6200:1\"")?),
        false => section.optional(key),
    };
    let Some(item) = item else { return Some(None) };
    let text = item.text(&section.key(key))?;
    let Some((index, sub)) = parse_object(text) else {
        section.wrong(key, "must be an object like \"0x6200:1\"");
        return None;
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
        section.wrong(
            key,
            format!("must stand among the {of} of the node, with its length ({there})"),
        );
    }
    found.map(Some)
}
