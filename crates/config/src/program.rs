//! `[program]` and `[tools]`: what LinuxCNC's INI file says in [RS274NGC], [EMCIO] and [DISPLAY]PROGRAM_PREFIX.
//!
//! Paths are relative to the folder of the machine file.

use super::document::{Bound, Section};
use super::remap::remap;
use super::types::{ARC_RADIUS_TOLERANCE, Program, ToolChanger, Tools, UserCodes};
use ::compensation::{Corner, FeedSettings, Gouge, InsideCorners};
use motion::canon::LengthUnit;
use motion::element::Outputs;
use motion::plan::PlannerKind;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Smallest difference of an arc's radii at start and end that LinuxCNC takes; the greatest is its default.
const ARC_TOLERANCE_MIN_MM: f64 = 0.001;
const ARC_TOLERANCE_MIN_INCH: f64 = 0.00004;
/// No cycle needs more; mm.
const PECK_CLEARANCE_MAX_MM: f64 = 100.0;
/// Rapid moves that cut corners by more are none that anybody would foresee; mm.
const RAPID_TOLERANCE_MAX_MM: f64 = 100.0;
/// Bend of a corner, degrees: beyond the limit the way to its point and back is 12 radii long.
const CORNER_LIMIT: Bound = Bound::Within(1.0, 160.0);
/// Feed in inside corners, as a share of F; the length that counts as corner, mm; the bend from which on it is one, degrees.
const INSIDE_CORNER_SHARE: Bound = Bound::Within(0.05, 1.0);
const INSIDE_CORNER_MAX_MM: f64 = 100.0;
const INSIDE_CORNER_BEND: Bound = Bound::Within(5.0, 170.0);
const INSIDE_CORNER_DEGREES: f64 = 30.0;
/// Folders that are searched for one file.
const FOLDERS_MAX: usize = 10;
/// Threads that plan; more than a PC has cores are of no use.
const THREADS_MAX: i64 = 64;
/// Time of a program of the PC, s.
const USER_CODE_TIMEOUT: Bound = Bound::Within(0.1, 86_400.0);
/// Values of `#<_ini[section]name>`.
const VALUE_MAX: f64 = 1e9;

/// Why the classic planner is refused: it bounds speed by what an axis of the program does, the joints do something else.
pub(super) const CLASSIC_IS_LINEAR: &str = "plans for the axes of the program, and the limits of the joints of these kinematics would not \
     hold: expected \"optimal\", or machine.kinematics \"trivial\" or \"corexy\"";

/// Reads `[program]`; `base`: folder of the machine file.
pub(super) fn program(section: &mut Section<'_, '_>, base: &Path) -> Option<Program> {
    let default = Program::default();
    let tolerance_mm = section.number("tolerance_mm", Bound::Positive(10.0), default.tolerance_mm);
    let rapid_tolerance_mm = match section.has("rapid_tolerance_mm") {
        true => section
            .number("rapid_tolerance_mm", Bound::Positive(RAPID_TOLERANCE_MAX_MM), None)
            .map(Some),
        false => Some(None),
    };
    let look_ahead_blocks = section.integer("look_ahead_blocks", 1..=1_000_000, default.look_ahead_blocks as i64);
    let buffer_blocks = default.look_ahead_buffer_blocks as i64;
    let look_ahead_buffer_blocks = section.integer("look_ahead_buffer_blocks", 1..=1_000_000, buffer_blocks);
    let overlap_blocks = default.look_ahead_overlap_blocks as i64;
    let look_ahead_overlap_blocks = section.integer("look_ahead_overlap_blocks", 0..=1_000_000, overlap_blocks);
    let planner = section.word(
        "planner",
        &[("optimal", PlannerKind::Optimal), ("classic", PlannerKind::Classic)],
        Some(default.planner),
    );
    let threads = section.optional_integer("threads", 1..=THREADS_MAX);
    let parameter_file = file(section, "parameter_file", base, MayBeMissing::Yes);
    let directory = folder(section, "directory", base);
    let subroutine_directories = folders(section, "subroutine_directories", base);
    let user_codes = user_codes(section, base);
    let log_directory = folder(section, "log_directory", base);
    let startup_code = startup_code(section);
    let pins = pins(section);
    let digital_pins = section.integer(
        "digital_pins",
        1..=Outputs::DIGITAL as i64,
        i64::from(default.digital_pins),
    );
    let analog_pins = section.integer(
        "analog_pins",
        1..=Outputs::ANALOG as i64,
        i64::from(default.analog_pins),
    );
    let block_delete = section.flag("block_delete", default.block_delete);
    let optional_stop = section.flag("optional_stop", default.optional_stop);
    let diameter_mode = section.flag("diameter_mode", default.diameter_mode);
    let keep_g92 = section.flag("keep_g92", default.keep_g92);
    let fanuc_subroutines = section.flag("fanuc_subroutines", default.fanuc_subroutines);
    let mut clearance = |key| match section.has(key) {
        true => section
            .number(key, Bound::Within(0.0, PECK_CLEARANCE_MAX_MM), None)
            .map(Some),
        false => Some(None),
    };
    let chip_breaking_clearance_mm = clearance("chip_breaking_clearance_mm");
    let peck_clearance_mm = clearance("peck_clearance_mm");
    let cutter_corner = cutter_corner(section);
    let gouges = [
        ("error", Gouge::Error),
        ("drop-loop", Gouge::DropLoop),
        ("neighbours-only", Gouge::NeighboursOnly),
    ];
    let gouge = section.word("gouge", &gouges, default.gouge);
    let contour_feed = contour_feed(section);
    let mut tolerance = |key, least, most| section.number(key, Bound::Within(least, most), most);
    let [most_mm, most_inch] = ARC_RADIUS_TOLERANCE;
    let arc_radius_tolerance_mm = tolerance("arc_radius_tolerance_mm", ARC_TOLERANCE_MIN_MM, most_mm);
    let arc_radius_tolerance_inch = tolerance("arc_radius_tolerance_inch", ARC_TOLERANCE_MIN_INCH, most_inch);
    let values = values(section);
    let listed = subroutine_directories.iter().flatten();
    let searched: Vec<PathBuf> = directory.iter().flatten().chain(listed).cloned().collect();
    let mut remaps = Vec::new();
    let mut complete = true;
    for mut table in section.sections("remap") {
        match remap(&mut table, &remaps, &searched) {
            Some(remap) => remaps.push(remap),
            None => complete = false,
        }
        table.done();
    }
    section.renamed("planner_threads", "threads");
    Some(Program {
        tolerance_mm: tolerance_mm?,
        rapid_tolerance_mm: rapid_tolerance_mm?,
        look_ahead_blocks: look_ahead_blocks? as usize,
        look_ahead_buffer_blocks: look_ahead_buffer_blocks? as usize,
        look_ahead_overlap_blocks: look_ahead_overlap_blocks? as usize,
        planner: planner?,
        threads: threads?.map(|threads| threads as usize),
        parameter_file: parameter_file?,
        directory: directory?,
        subroutine_directories: subroutine_directories?,
        user_codes: user_codes?,
        log_directory: log_directory?,
        startup_code: startup_code?,
        pins: pins?,
        digital_pins: digital_pins? as u16,
        analog_pins: analog_pins? as u16,
        block_delete: block_delete?,
        optional_stop: optional_stop?,
        diameter_mode: diameter_mode?,
        keep_g92: keep_g92?,
        fanuc_subroutines: fanuc_subroutines?,
        chip_breaking_clearance_mm: chip_breaking_clearance_mm?,
        peck_clearance_mm: peck_clearance_mm?,
        cutter_corner: cutter_corner?,
        gouge: gouge?,
        contour_feed: contour_feed?,
        arc_radius_tolerance_mm: arc_radius_tolerance_mm?,
        arc_radius_tolerance_inch: arc_radius_tolerance_inch?,
        values: values?,
        remaps: complete.then_some(remaps)?,
    })
}

/// Reads `[tools]`.
pub(super) fn tools(section: &mut Section<'_, '_>, base: &Path) -> Option<Tools> {
    let table = file(section, "table", base, MayBeMissing::No);
    let changer = section.word(
        "changer",
        &[("fixed", ToolChanger::Fixed), ("random", ToolChanger::Random)],
        ToolChanger::Fixed,
    );
    Some(Tools {
        table: table?,
        changer: changer?,
    })
}

/// `machine.units`: what lengths in the tool table and the parameter file are in, and a program before G20 or G21.
pub(super) fn units(section: &mut Section<'_, '_>) -> Option<LengthUnit> {
    let words = [("mm", LengthUnit::Millimetre), ("inch", LengthUnit::Inch)];
    section.word("units", &words, LengthUnit::Millimetre)
}

/// `feed_at_contour` and the keys of inside corners, of which the share switches them on.
fn contour_feed(section: &mut Section<'_, '_>) -> Option<FeedSettings> {
    const SHARE: &str = "inside_corner_feed";
    let arcs = section.flag("feed_at_contour", false);
    let slow = section.optional(SHARE).is_some();
    let share = section.number(SHARE, INSIDE_CORNER_SHARE, 1.0);
    let distance_mm = match section.has("inside_corner_mm") {
        true => section
            .number("inside_corner_mm", Bound::Positive(INSIDE_CORNER_MAX_MM), None)
            .map(Some),
        false => Some(None),
    };
    let bend_degrees = section.number("inside_corner_degrees", INSIDE_CORNER_BEND, INSIDE_CORNER_DEGREES);
    for key in ["inside_corner_mm", "inside_corner_degrees"] {
        if section.has(key) && !slow {
            section.wrong(key, "needs inside_corner_feed");
            return None;
        }
    }
    let corners = InsideCorners {
        share: share?,
        distance_mm: distance_mm?,
        bend_degrees: bend_degrees?,
    };
    Some(FeedSettings {
        arcs: arcs?,
        inside_corners: slow.then_some(corners),
    })
}

/// `cutter_corner`, with the limit that only an intersection has.
fn cutter_corner(section: &mut Section<'_, '_>) -> Option<Corner> {
    let limit = "cutter_corner_limit_degrees";
    let given = section.optional(limit).is_some();
    let limit_degrees = section.number(limit, CORNER_LIMIT, Corner::LIMIT_DEGREES);
    let words = [("arc", false), ("intersection", true)];
    let intersection = section.word("cutter_corner", &words, false)?;
    if given && !intersection {
        section.wrong(limit, "needs cutter_corner = \"intersection\"");
        return None;
    }
    let limit_degrees = limit_degrees?;
    Some(match intersection {
        false => Corner::Arc,
        true => Corner::Intersection { limit_degrees },
    })
}

fn user_codes(section: &mut Section<'_, '_>, base: &Path) -> Option<UserCodes> {
    let allowed = section.flag("user_codes", false);
    let directories = folders(section, "user_code_directories", base);
    let timeout_s = section.number("user_code_timeout_s", USER_CODE_TIMEOUT, UserCodes::default().timeout_s);
    if allowed == Some(true) && directories.as_ref().is_some_and(Vec::is_empty) {
        section.wrong(
            "user_codes",
            "needs user_code_directories, where the files M100 to M199 are",
        );
        return None;
    }
    Some(UserCodes {
        allowed: allowed?,
        directories: directories?,
        timeout_s: timeout_s?,
    })
}

/// `startup_code`.
fn startup_code(section: &mut Section<'_, '_>) -> Option<String> {
    match section.optional("startup_code") {
        Some(item) => Some(item.text(&section.key("startup_code"))?.to_owned()),
        None => Some(String::new()),
    }
}

/// `[program.pins]`: what programs read as `#<_hal[pin]>` where no control runs.
fn pins(section: &mut Section<'_, '_>) -> Option<BTreeMap<String, f64>> {
    let mut pins = BTreeMap::new();
    let mut complete = true;
    let Some(mut names) = section.optional_section("pins") else {
        return Some(pins);
    };
    for name in names.names() {
        match names.any_number(&name, Bound::Size(VALUE_MAX)) {
            Some(value) => complete &= pins.insert(name.to_ascii_lowercase(), value).is_none(),
            None => complete = false,
        }
    }
    complete.then_some(pins)
}

/// `[program.values.SECTION]`: numbers that programs read as `#<_ini[SECTION]NAME>`.
fn values(section: &mut Section<'_, '_>) -> Option<BTreeMap<(String, String), f64>> {
    let mut values = BTreeMap::new();
    let mut complete = true;
    let Some(mut groups) = section.optional_section("values") else {
        return Some(values);
    };
    for group in groups.names() {
        let Some(mut names) = groups.any_section(&group) else {
            complete = false;
            continue;
        };
        for name in names.names() {
            match names.any_number(&name, Bound::Size(VALUE_MAX)) {
                Some(value) => {
                    let key = (group.to_ascii_lowercase(), name.to_ascii_lowercase());
                    if values.insert(key, value).is_some() {
                        names.wrong(&name, "stands here twice: case does not matter to programs");
                        complete = false;
                    }
                }
                None => complete = false,
            }
        }
    }
    complete.then_some(values)
}

/// Whether a file may be made later.
#[derive(Clone, Copy, PartialEq, Eq)]
enum MayBeMissing {
    Yes,
    No,
}

/// A file; left out: `Some(None)`.
fn file(
    section: &mut Section<'_, '_>,
    key: &'static str,
    base: &Path,
    may_be_missing: MayBeMissing,
) -> Option<Option<PathBuf>> {
    let Some(path) = path(section, key, base)? else {
        return Some(None);
    };
    let rule = match std::fs::metadata(&path) {
        Ok(metadata) if metadata.is_file() => return Some(Some(path)),
        Ok(_) => format!("is no file: {}", path.display()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound && may_be_missing == MayBeMissing::Yes => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            match folder {
                Some(folder) if !folder.is_dir() => format!("there is no folder {}", folder.display()),
                Some(_) | None => return Some(Some(path)),
            }
        }
        Err(error) => format!("{}: {error}", path.display()),
    };
    section.wrong(key, rule);
    None
}

/// A folder that is there; left out: `Some(None)`.
fn folder(section: &mut Section<'_, '_>, key: &'static str, base: &Path) -> Option<Option<PathBuf>> {
    let Some(path) = path(section, key, base)? else {
        return Some(None);
    };
    if !path.is_dir() {
        section.wrong(key, format!("there is no folder {}", path.display()));
        return None;
    }
    Some(Some(path))
}

/// A folder that is made if it is missing, in one that is there.
pub(super) fn new_folder(section: &mut Section<'_, '_>, key: &'static str, base: &Path) -> Option<Option<PathBuf>> {
    let Some(path) = path(section, key, base)? else {
        return Some(None);
    };
    let is_folder = path.is_dir();
    // A path of one word lies where the process runs.
    let beside = |parent: &Path| parent.as_os_str().is_empty() || parent.is_dir();
    let can_be_made = !path.exists() && path.parent().is_some_and(beside);
    if !is_folder && !can_be_made {
        section.wrong(key, format!("{} is no folder and cannot be made", path.display()));
        return None;
    }
    Some(Some(path))
}

pub(super) fn path(section: &mut Section<'_, '_>, key: &'static str, base: &Path) -> Option<Option<PathBuf>> {
    let Some(item) = section.optional(key) else {
        return Some(None);
    };
    let text = item.text(&section.key(key))?;
    if text.is_empty() {
        section.wrong(key, "must be a path");
        return None;
    }
    Some(Some(base.join(text)))
}

/// Folders in the order in which they are searched; left out: none.
fn folders(section: &mut Section<'_, '_>, key: &'static str, base: &Path) -> Option<Vec<PathBuf>> {
    let Some(item) = section.optional(key) else {
        return Some(Vec::new());
    };
    let path = section.key(key);
    let items = item.items(&path)?;
    if items.len() > FOLDERS_MAX {
        section.wrong(
            key,
            format!("must not be more than {FOLDERS_MAX} folders, are {}", items.len()),
        );
        return None;
    }
    let mut folders = Vec::new();
    let mut complete = true;
    for (index, item) in items.into_iter().enumerate() {
        let key = format!("{path}[{index}]");
        let Some(folder) = item.text(&key).map(|text| base.join(text)) else {
            complete = false;
            continue;
        };
        if folder.is_dir() {
            folders.push(folder);
        } else {
            let rule = format!("there is no folder {}", folder.display());
            item.log.wrong(item.value.span(), &key, rule, None);
            complete = false;
        }
    }
    complete.then_some(folders)
}
