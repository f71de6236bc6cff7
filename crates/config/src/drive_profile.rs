//! `drive = "NAME"` of a `[[bus.node]]`: what is known of a kind of drive, from a file of its own.
//!
//! In:  the key; the profiles that are part of the program (`drives/`), or a file beside the machine file.
//! Out: a [`DriveProfile`]. What it knows holds where the machine file says nothing, and what the machine file says is judged by it.
//! A mistake in it is noted at the line of the machine file that names it, with its own place in the profile.

use super::device;
use super::document::{Item, Log};
use super::error::nearest;
use super::factor_group::FactorGroup;
use super::modes::{DriveMode, METHOD_RULE, Reactions, is_homing_method};
use super::objects::{Identity, Mapped, Profile, parse_object};
use super::section::{Section, keys, left_out};
use super::sto::{Sto, sto};
use cia402::profile::mode::{self, Offered, supported_bit};
use cia402::profile::{AXES_MAX, axis_of};
use files::read::TEXT_MAX;
use obd::device::ConfigurationWrite;
use std::path::{Path, PathBuf};
use toml::de::DeTable;

/// Profiles that are part of the program, by the name that a machine file gives them.
pub const BUILT_IN: [(&str, &str); 3] = [
    ("kollmorgen-akd", include_str!("../../../drives/kollmorgen-akd.toml")),
    ("maxon-epos4", include_str!("../../../drives/maxon-epos4.toml")),
    (
        "schneider-atv320",
        include_str!("../../../drives/schneider-atv320.toml"),
    ),
];

/// Mistakes of a profile that are told.
const MISTAKES_TOLD: usize = 10;

/// Words for modes, with their codes in 6060.
const MODES: [(&str, i8); 9] = [
    ("pp", mode::PROFILE_POSITION),
    ("vl", mode::VELOCITY),
    ("pv", mode::PROFILE_VELOCITY),
    ("tq", mode::PROFILE_TORQUE),
    ("hm", mode::HOMING),
    ("ip", mode::INTERPOLATED_POSITION),
    ("csp", mode::CYCLIC_SYNCHRONOUS_POSITION),
    ("csv", mode::CYCLIC_SYNCHRONOUS_VELOCITY),
    ("cst", mode::CYCLIC_SYNCHRONOUS_TORQUE),
];

keys! {
    /// What is known of a kind of drive. `called`: as the machine file names it; `beside`: the file that it is from, `None`: part of the
    /// program.
    #[derive(Clone, Debug, PartialEq)]
    pub struct DriveProfile(root, called: &str, beside: Option<&Path>) {
        /// As the machine file names it.
        pub name: String = {
            root.integer("schema", 1..=1, None);
            Some(called.to_owned())
        },
        /// What it is, and what is known of it, in words.
        pub description: String =
            root.text("description", "what the drive is, and where what stands here is from").map(str::to_owned),
        /// Its device file.
        pub device_file: Option<PathBuf> = device_file(root, beside),
        /// Axes of one device; default 1.
        pub axes: u8 = root.integer("axes", 1..=AXES_MAX, 1),
        /// Increments of 6064 for a turn of its motor.
        pub increments_per_turn: Option<u32> = root.optional_integer("increments_per_turn", 1..=u32::MAX),
        /// Modes that it offers, as 6502 has them; `None`: not known.
        pub modes: Option<u32> = root.maybe("modes", |list, path| {
            let bits = list.list(path, |item, path| item.word(path, &MODES).map(supported_bit))?;
            Some(bits.into_iter().fold(0, |all, bit| all | bit))
        }),
        /// Homing methods (6098) that work; empty: not known.
        pub homing_methods: Vec<i8> = root.list("homing_methods", |item, path| {
            let method = item.integer(path, i8::MIN..=i8::MAX)?;
            let is_one = is_homing_method(method);
            if !is_one {
                item.wrong(path, METHOD_RULE);
            }
            is_one.then_some(method)
        }),
        /// At its home point it counts 607C; by the profile it counts -607C.
        pub home_offset_adds: bool = root.word("home_offset", &[("minus", false), ("plus", true)], false),
        /// It stays in QUICK STOP ACTIVE whatever 605A says, until its voltage is disabled.
        pub stays_in_quick_stop: bool = root.word("quick_stop", &[("off", false), ("stays", true)], false),
        /// Objects that the control would write and that it does not have.
        pub without: Vec<(u16, u8)> = root.list("without", object),
        /// What it must say it is; `None`: not known.
        pub identity: Identity = root.table("identity", |table| device::identity(table, None, Identity::default())),
        /// Bits of 60FD.
        pub input_bits: InputBits = root.table("digital_inputs", InputBits::read),
        /// Its sign that its safety circuit is open.
        pub sto: Option<Sto> = root.optional_table("sto", |table| sto(table, None)),
        /// What its PReq may hold.
        pub outputs: MappingLimits = root.table("outputs", MappingLimits::read),
        /// What its PRes may hold.
        pub inputs: MappingLimits = root.table("inputs", MappingLimits::read),
        /// How it stops, where the joint does not say.
        pub reactions: Reactions =
            root.table("reactions", |table| Reactions::read(table, 0, None, &Reactions::default())),
        /// In which units it counts, where the joint does not say.
        pub factor_group: FactorGroup =
            root.table("factor_group", |table| FactorGroup::read(table, &FactorGroup::default())),
        /// Values that are written before those of the machine file.
        pub writes: Vec<ConfigurationWrite> =
            device::writes(root, None, &[], obd::device::set_by_managing_node),
    }
    rules {
        let of_turn = factor_group.and_then(|group| group.units_per_turn());
        if let (Some([units, turns]), Some(Some(increments))) = (of_turn, increments_per_turn)
            && (turns != 1 || units != u64::from(increments))
        {
            let units = match turns {
                1 => units.to_string(),
                _ => format!("{units}/{turns}"),
            };
            let rule = format!("contradicts factor_group, which makes {units} units of 0x6064 of a turn of the motor");
            root.wrong("increments_per_turn", rule);
        }
    }
}

keys! {
    /// Numbers of the bits of 60FD in which a drive shows its switches.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct InputBits(table) {
        /// Lower and upper limit switch; default 0 and 1.
        pub limits: [u8; 2] = {
            let negative = table.integer("negative_limit", 0..=31, 0);
            let positive = table.integer("positive_limit", 0..=31, 1);
            negative.zip(positive).map(|(negative, positive)| [negative, positive])
        },
        /// Home switch; default 2.
        pub home: u8 = table.integer("home", 0..=31, 2),
    }
}

impl Default for InputBits {
    fn default() -> InputBits {
        left_out(InputBits::read)
    }
}

keys! {
    /// What a drive takes into one of its payloads; `None`: not known.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct MappingLimits(table) {
        /// Most objects.
        pub objects_max: Option<u16> = table.optional_integer("objects_max", 1..=254),
        /// Most octets.
        pub octets_max: Option<u16> = table.optional_integer("octets_max", 1..=1490),
        /// All objects that it takes; those of the first axis stand for those of all.
        pub objects: Option<Vec<(u16, u8)>> = table.maybe("objects", |list, path| list.list(path, object)),
    }
}

impl MappingLimits {
    /// Whether an object may be mapped, as far as that is known.
    pub fn takes(&self, object: &Mapped) -> bool {
        let objects = self.objects.as_deref();
        objects.is_none_or(|objects| objects.contains(&(axis_of(object.index).1, object.sub)))
    }
}

impl DriveProfile {
    /// Whether a mode (6060) is offered, as far as that is known.
    pub fn offers(&self, code: i8) -> bool {
        self.modes.is_none_or(|modes| modes & supported_bit(code) != 0)
    }

    /// The modes that it offers, in words.
    pub fn offered(&self) -> String {
        Offered(self.modes.unwrap_or(0)).to_string()
    }

    /// The mode of a joint that names none.
    pub fn usual_mode(&self) -> DriveMode {
        match self.offers(DriveMode::Csp.code()) || !self.offers(DriveMode::Ip.code()) {
            true => DriveMode::Csp,
            false => DriveMode::Ip,
        }
    }

    /// What the drive counts at its home point where 607C has a value.
    pub fn home_count(&self, home_offset: i32) -> i64 {
        match self.home_offset_adds {
            true => home_offset.into(),
            false => -i64::from(home_offset),
        }
    }
}

/// `drive = "NAME"` of a node; `Some(None)`: none is named.
pub(super) fn named(
    section: &mut Section<'_, '_>,
    folder: &Path,
    profile: Option<Profile>,
) -> Option<Option<DriveProfile>> {
    let Some(item) = section.optional("drive") else {
        return Some(None);
    };
    let name = item.text(&section.key("drive"))?;
    if profile == Some(Profile::Io) {
        return section.refused("drive", "is for a node of profile \"cia402\"");
    }
    let (text, beside) = match BUILT_IN.iter().find(|(built_in, _)| *built_in == name) {
        Some((_, text)) => ((*text).to_owned(), None),
        None if !name.ends_with(".toml") => {
            let names = BUILT_IN.map(|(name, _)| name);
            let rule = format!(
                "must be one of {}, or a file that ends in .toml, beside the machine file",
                names.join(", ")
            );
            return item.no_word(&section.key("drive"), rule, nearest(name, names));
        }
        None => {
            let path = folder.join(name);
            match files::read_text(&path, TEXT_MAX) {
                Ok(text) => (text, Some(path)),
                Err(error) => {
                    return section.refused("drive", format!("cannot be read: {error}"));
                }
            }
        }
    };
    match parse(name, &text, beside.as_deref()) {
        Ok(profile) => Some(Some(profile)),
        Err(mistakes) => {
            for line in mistakes.iter().take(MISTAKES_TOLD) {
                section.wrong("drive", format!("is no drive profile that can be used: {line}"));
            }
            if let Some(more) = mistakes.len().checked_sub(MISTAKES_TOLD).filter(|more| *more > 0) {
                section.wrong("drive", format!("has {more} more mistakes"));
            }
            None
        }
    }
}

/// The profile of a text; `beside`: the file that it is from, `None`: part of the program.
///
/// # Errors
/// Every mistake, with its place.
pub fn parse(name: &str, text: &str, beside: Option<&Path>) -> Result<DriveProfile, Vec<String>> {
    let log = Log::new(name, text);
    let (document, syntax) = DeTable::parse_recoverable(text);
    for error in &syntax {
        let span = error.span().unwrap_or(text.len()..text.len());
        log.misplaced(span, "", error.message(), None);
    }
    let found = match syntax.is_empty() {
        true => Section::root(&log, document.get_ref()).whole(|root| DriveProfile::read(root, name, beside)),
        false => None,
    };
    let (errors, _) = log.into_errors();
    match found {
        Some(profile) if errors.is_empty() => Ok(profile),
        _ if errors.is_empty() => Err(vec![format!("{name}: is refused for a reason that was lost")]),
        _ => Err(errors.iter().map(ToString::to_string).collect()),
    }
}

/// What the reader asks of each key while it reads this text, which may be wrong, as if it stood in the file `beside`.
#[cfg(feature = "testing")]
pub fn questions(text: &str, beside: &Path) -> Vec<(String, super::question::Question)> {
    let log = Log::new("", text);
    let (document, _) = DeTable::parse_recoverable(text);
    Section::root(&log, document.get_ref()).whole(|root| DriveProfile::read(root, "", Some(beside)));
    log.into_questions()
}

fn device_file(root: &mut Section<'_, '_>, beside: Option<&Path>) -> Option<Option<PathBuf>> {
    let file = root.optional_text("device_file");
    if beside.is_none() && root.has("device_file") {
        let rule = "cannot be named by a profile that is part of the program";
        root.wrong("device_file", rule);
    }
    let folder = beside.and_then(Path::parent).unwrap_or(Path::new(""));
    Some(file?.map(|file| folder.join(file)))
}

/// An item of a list of objects.
fn object(item: Item<'_, '_>, path: &str) -> Option<(u16, u8)> {
    let object = parse_object(item.text(path)?);
    if object.is_none() {
        item.wrong(path, "must be an object, like \"0x6041\" or \"0x60FE:1\"");
    }
    object
}
