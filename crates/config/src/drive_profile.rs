//! `drive = "NAME"` of a `[[bus.node]]`: what is known of a kind of drive, from a file of its own.
//!
//! In:  the key; the profiles that are part of the program (`drives/`), or a file beside the machine file.
//! Out: a [`DriveProfile`]. What it knows holds where the machine file says nothing, and what the machine file says is judged by it.
//! A mistake in it is noted at the line of the machine file that names it, with its own place in the profile.

use super::device;
use super::document::{Log, Section};
use super::drive::{self, DriveMode, Reactions};
use super::error::nearest;
use super::factor_group::{self, FactorGroup};
use super::joints;
use super::mapping::parse_object;
use super::types::{ConfigurationWrite, Identity, Mapped, Profile, Sto};
use cia402::profile::mode::{self, Offered, supported_bit};
use cia402::profile::{AXES_MAX, axis_of};
use files::read::TEXT_MAX;
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

/// What is known of a kind of drive.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveProfile {
    /// As the machine file names it.
    pub name: String,
    /// What it is, and what is known of it, in words.
    pub description: String,
    /// Axes of one device; default 1.
    pub axes: u8,
    /// What it must say it is; `None`: not known.
    pub identity: Identity,
    /// Its device file.
    pub device_file: Option<PathBuf>,
    /// Increments of 6064 for a turn of its motor.
    pub increments_per_turn: Option<u32>,
    /// Modes that it offers, as 6502 has them; `None`: not known.
    pub modes: Option<u32>,
    /// Homing methods (6098) that work; empty: not known.
    pub homing_methods: Vec<i8>,
    /// At its home point it counts 607C; by the profile it counts -607C.
    pub home_offset_adds: bool,
    /// Bits of 60FD.
    pub input_bits: InputBits,
    /// Its sign that its safety circuit is open.
    pub sto: Option<Sto>,
    /// Objects that the control would write and that it does not have.
    pub without: Vec<(u16, u8)>,
    /// It stays in QUICK STOP ACTIVE whatever 605A says, until its voltage is disabled.
    pub stays_in_quick_stop: bool,
    /// What its PReq may hold.
    pub outputs: MappingLimits,
    /// What its PRes may hold.
    pub inputs: MappingLimits,
    /// How it stops, where the joint does not say.
    pub reactions: Reactions,
    /// In which units it counts, where the joint does not say.
    pub factor_group: FactorGroup,
    /// Values that are written before those of the machine file.
    pub writes: Vec<ConfigurationWrite>,
}

/// Numbers of the bits of 60FD in which a drive shows its switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputBits {
    /// Lower and upper limit switch; default 0 and 1.
    pub limits: [u8; 2],
    /// Home switch; default 2.
    pub home: u8,
}

impl Default for InputBits {
    fn default() -> InputBits {
        InputBits {
            limits: [0, 1],
            home: 2,
        }
    }
}

/// What a drive takes into one of its payloads; `None`: not known.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MappingLimits {
    /// Most objects.
    pub objects_max: Option<u16>,
    /// Most octets.
    pub octets_max: Option<u16>,
    /// All objects that it takes; those of the first axis stand for those of all.
    pub objects: Option<Vec<(u16, u8)>>,
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
        section.wrong("drive", "is for a node of profile \"cia402\"");
        return None;
    }
    let (text, beside) = match BUILT_IN.iter().find(|(built_in, _)| *built_in == name) {
        Some((_, text)) => ((*text).to_owned(), None),
        None if !name.ends_with(".toml") => {
            let names = BUILT_IN.map(|(name, _)| name);
            let rule = format!(
                "must be one of {}, or a file that ends in .toml, beside the machine file",
                names.join(", ")
            );
            let hint = nearest(name, names).map(|near| format!("did you mean {near:?}?"));
            item.log.wrong(item.value.span(), &section.key("drive"), rule, hint);
            return None;
        }
        None => {
            let path = folder.join(name);
            match files::read_text(&path, TEXT_MAX) {
                Ok(text) => (text, Some(path)),
                Err(error) => {
                    section.wrong("drive", format!("cannot be read: {error}"));
                    return None;
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
        true => read(Section::root(&log, document.get_ref()), name, beside),
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
pub fn questions(text: &str, beside: &Path) -> Vec<(String, super::Question)> {
    let log = Log::new("", text);
    let (document, _) = DeTable::parse_recoverable(text);
    read(Section::root(&log, document.get_ref()), "", Some(beside));
    log.into_questions()
}

fn read(mut root: Section<'_, '_>, name: &str, beside: Option<&Path>) -> Option<DriveProfile> {
    root.integer("schema", 1..=1, None);
    let description = root.required("description", "what the drive is, and where what stands here is from");
    let description = description.and_then(|item| Some(item.text("description")?.to_owned()));
    let device_file = match root.optional("device_file") {
        None => Some(None),
        Some(item) => {
            let file = item.text("device_file");
            if beside.is_none() {
                root.wrong(
                    "device_file",
                    "cannot be named by a profile that is part of the program",
                );
            }
            let folder = beside.and_then(Path::parent).unwrap_or(Path::new(""));
            file.map(|file| Some(folder.join(file)))
        }
    };
    let axes = root.integer("axes", 1..=i64::from(AXES_MAX), 1);
    let increments_per_turn = root.optional_integer("increments_per_turn", 1..=i64::from(u32::MAX));
    let modes = modes(&mut root);
    let homing_methods = homing_methods(&mut root);
    let home_offset_adds = root.word("home_offset", &[("minus", false), ("plus", true)], false);
    let stays_in_quick_stop = root.word("quick_stop", &[("off", false), ("stays", true)], false);
    let without = objects(&mut root, "without");
    let identity = root.section("identity").and_then(|mut table| {
        let identity = device::identity(&mut table, None, None);
        table.done();
        identity
    });
    let input_bits = root.section("digital_inputs").and_then(input_bits);
    let sto = match root.optional_section("sto") {
        None if root.has("sto") => None,
        None => Some(None),
        Some(mut table) => {
            let sto = joints::sto(&mut table, None);
            table.done();
            sto.map(Some)
        }
    };
    let outputs = root.section("outputs").and_then(mapping_limits);
    let inputs = root.section("inputs").and_then(mapping_limits);
    let reactions = root.section("reactions").and_then(|mut table| {
        let reactions = drive::reactions_of(&mut table, 0, None, &Reactions::default());
        table.done();
        reactions
    });
    let factor_group = root.section("factor_group").and_then(|mut table| {
        let group = factor_group::values(&mut table, &FactorGroup::default());
        table.done();
        group
    });
    let of_turn = factor_group.and_then(|group| group.units_per_turn());
    if let (Some([units, turns]), Some(Some(increments))) = (of_turn, increments_per_turn)
        && (turns != 1 || i64::try_from(units) != Ok(increments))
    {
        let units = if turns == 1 {
            units.to_string()
        } else {
            format!("{units}/{turns}")
        };
        root.wrong(
            "increments_per_turn",
            format!("contradicts factor_group, which makes {units} units of 0x6064 of a turn of the motor"),
        );
    }
    let writes = device::writes(&mut root, None, &[], obd::device::set_by_managing_node);
    root.done();
    Some(DriveProfile {
        name: name.to_owned(),
        description: description?,
        axes: axes? as u8,
        identity: identity?,
        device_file: device_file?,
        increments_per_turn: increments_per_turn?.map(|count| count as u32),
        modes: modes?,
        homing_methods: homing_methods?,
        home_offset_adds: home_offset_adds?,
        input_bits: input_bits?,
        sto: sto?,
        without: without?.unwrap_or_default(),
        stays_in_quick_stop: stays_in_quick_stop?,
        outputs: outputs?,
        inputs: inputs?,
        reactions: reactions?,
        factor_group: factor_group?,
        writes: writes?,
    })
}

fn modes(root: &mut Section<'_, '_>) -> Option<Option<u32>> {
    let Some(list) = root.optional("modes") else {
        return Some(None);
    };
    let items = list.items("modes")?.into_iter().enumerate();
    let bits: Vec<_> = items
        .map(|(at, item)| item.word(&format!("modes[{at}]"), &MODES).map(supported_bit))
        .collect();
    let bits: Option<Vec<u32>> = bits.into_iter().collect();
    Some(Some(bits?.into_iter().fold(0, |all, bit| all | bit)))
}

fn homing_methods(root: &mut Section<'_, '_>) -> Option<Vec<i8>> {
    let Some(list) = root.optional("homing_methods") else {
        return Some(Vec::new());
    };
    let items = list.items("homing_methods")?.into_iter().enumerate();
    let methods: Vec<_> = items
        .map(|(at, item)| {
            let key = format!("homing_methods[{at}]");
            let method = item.integer(&key, i8::MIN.into()..=i8::MAX.into())?;
            if !super::homing::is_homing_method(method) {
                item.log
                    .wrong(item.value.span(), &key, super::homing::METHOD_RULE, None);
                return None;
            }
            Some(method as i8)
        })
        .collect();
    methods.into_iter().collect()
}

fn input_bits(mut table: Section<'_, '_>) -> Option<InputBits> {
    let usual = InputBits::default();
    let bit = |table: &mut Section<'_, '_>, key, usual: u8| table.integer(key, 0..=31, i64::from(usual));
    let negative = bit(&mut table, "negative_limit", usual.limits[0]);
    let positive = bit(&mut table, "positive_limit", usual.limits[1]);
    let home = bit(&mut table, "home", usual.home);
    table.done();
    Some(InputBits {
        limits: [negative? as u8, positive? as u8],
        home: home? as u8,
    })
}

fn mapping_limits(mut table: Section<'_, '_>) -> Option<MappingLimits> {
    let objects_max = table.optional_integer("objects_max", 1..=254);
    let octets_max = table.optional_integer("octets_max", 1..=1490);
    let objects = objects(&mut table, "objects");
    table.done();
    Some(MappingLimits {
        objects_max: objects_max?.map(|most| most as u16),
        octets_max: octets_max?.map(|most| most as u16),
        objects: objects?,
    })
}

/// A list of objects; `Some(None)`: left out.
fn objects(table: &mut Section<'_, '_>, key: &'static str) -> Option<Option<Vec<(u16, u8)>>> {
    let path = table.key(key);
    let Some(list) = table.optional(key) else {
        return Some(None);
    };
    let items = list.items(&path)?.into_iter().enumerate();
    let objects: Vec<_> = items
        .map(|(at, item)| {
            let key = format!("{path}[{at}]");
            let object = parse_object(item.text(&key)?);
            if object.is_none() {
                let rule = "must be an object, like \"0x6041\" or \"0x60FE:1\"";
                item.log.wrong(item.value.span(), &key, rule, None);
            }
            object
        })
        .collect();
    objects.into_iter().collect::<Option<Vec<_>>>().map(Some)
}
