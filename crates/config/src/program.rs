//! `[program]` and `[tools]`: what LinuxCNC's INI file says in [RS274NGC], [EMCIO] and [DISPLAY]PROGRAM_PREFIX.
//!
//! Paths are relative to the folder of the machine file.

use super::paths::MayBeMissing;
use super::question::Bound;
use super::remap::Remap;
use super::section::{Section, keys, left_out};
use ::compensation::{Corner, FeedSettings, Gouge, InsideCorners};
pub use gcode::ToolChanger;
use motion::canon::LengthUnit;
use motion::element::Outputs;
use motion::plan::PlannerKind;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Smallest difference of an arc's radii at start and end that LinuxCNC takes; the greatest is its default.
const ARC_TOLERANCE_MIN_MM: f64 = 0.001;
const ARC_TOLERANCE_MIN_INCH: f64 = 0.00004;
/// No cycle needs more; mm.
const PECK_CLEARANCE_MM: Bound = Bound::Within(0.0, 100.0);
/// Rapid moves that cut corners by more are none that anybody would foresee; mm.
const RAPID_TOLERANCE_MM: Bound = Bound::Positive(100.0);
/// Bend of a corner, degrees: beyond the limit the way to its point and back is 12 radii long.
const CORNER_LIMIT: Bound = Bound::Within(1.0, 160.0);
/// Feed in inside corners, as a share of F; the length that counts as corner, mm; the bend from which on it is one, degrees.
const INSIDE_CORNER_SHARE: Bound = Bound::Within(0.05, 1.0);
const INSIDE_CORNER_MAX_MM: f64 = 100.0;
const INSIDE_CORNER_BEND: Bound = Bound::Within(5.0, 170.0);
const INSIDE_CORNER_DEGREES: f64 = 30.0;
/// Threads that plan; more than a PC has cores are of no use.
const THREADS_MAX: usize = 64;
/// Time of a program of the PC, s.
const USER_CODE_TIMEOUT: Bound = Bound::Within(0.1, 86_400.0);
/// Values of `#<_ini[section]name>`.
const VALUE_MAX: f64 = 1e9;

/// Why the classic planner is refused: it bounds speed by what an axis of the program does, the joints do something else.
pub(super) const CLASSIC_IS_LINEAR: &str = "plans for the axes of the program, and the limits of the joints of these kinematics would not \
     hold: expected \"optimal\", or machine.kinematics \"trivial\" or \"corexy\"";

/// LinuxCNC's tolerance of an arc's centre, mm and inch: default and limit.
const ARC_RADIUS_TOLERANCE: [f64; 2] = [0.02 * std::f64::consts::SQRT_2, 0.002 * std::f64::consts::SQRT_2];

const PLANNERS: [(&str, PlannerKind); 2] = [("optimal", PlannerKind::Optimal), ("classic", PlannerKind::Classic)];
const GOUGES: [(&str, Gouge); 3] = [
    ("error", Gouge::Error),
    ("drop-loop", Gouge::DropLoop),
    ("neighbours-only", Gouge::NeighboursOnly),
];
const CHANGERS: [(&str, ToolChanger); 2] = [("fixed", ToolChanger::Fixed), ("random", ToolChanger::Random)];

keys! {
    /// `[program]`; `base`: folder of the machine file.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Program(section, base: &Path) {
        /// Path tolerance of G64 without P, mm; default 0.01.
        pub tolerance_mm: f64 = section.number("tolerance_mm", Bound::Positive(10.0), 0.01),
        /// Path tolerance of G64 at the corners between two rapid moves, mm. `None`: that of the program.
        pub rapid_tolerance_mm: Option<f64> = section.optional_number("rapid_tolerance_mm", RAPID_TOLERANCE_MM),
        /// Blocks that the planner looks ahead; default 10,000.
        pub look_ahead_blocks: usize = section.integer("look_ahead_blocks", 1..=1_000_000, 10_000),
        /// Blocks over which one thread of the classic planner looks ahead at a time; default 300.
        pub look_ahead_buffer_blocks: usize = section.integer("look_ahead_buffer_blocks", 1..=1_000_000, 300),
        /// Blocks on either side of such a buffer from which it begins; default 50.
        pub look_ahead_overlap_blocks: usize = section.integer("look_ahead_overlap_blocks", 0..=1_000_000, 50),
        /// How speed is chosen along the path.
        pub planner: PlannerKind = section.word("planner", &PLANNERS, PlannerKind::default()),
        /// Threads that plan, from text to committed motion, that of the program among them. `None`: one for every core that may be used and is not that of the
        /// real-time threads, at most [`Program::THREADS_USUAL`].
        pub threads: Option<usize> = section.optional_integer("threads", 1..=THREADS_MAX),
        /// File of the parameters that outlive a program, LinuxCNC's var file; made if it is missing. `None`: nothing outlives
        /// the process, and [`Config::work_offsets`](super::Config::work_offsets) hold at each start.
        pub parameter_file: Option<PathBuf> = section.file("parameter_file", base, MayBeMissing::Yes),
        /// Folder of the programs; subroutines are looked for here first.
        pub directory: Option<PathBuf> = section.folder("directory", base),
        /// Further folders in which subroutines are looked for, in this order.
        pub subroutine_directories: Vec<PathBuf> = section.folders("subroutine_directories", base),
        /// M100 to M199.
        pub user_codes: UserCodes = UserCodes::read(section, base),
        /// Folder of the files that programs write; `None`: they write none.
        pub log_directory: Option<PathBuf> = section.folder("log_directory", base),
        /// Modes that are set before every program.
        pub startup_code: String =
            section.optional_text("startup_code").map(|code| code.unwrap_or_default().to_owned()),
        /// Values of `#<_hal[pin]>` in checks and plans, by name in lower case.
        pub pins: BTreeMap<String, f64> = pins(section),
        /// Digital inputs and outputs that programs may name (M62 to M66), each; default 4.
        pub digital_pins: u16 = section.integer("digital_pins", 1..=Outputs::DIGITAL as u16, 4),
        /// Analog inputs and outputs that programs may name (M66 to M68), each; default 4.
        pub analog_pins: u16 = section.integer("analog_pins", 1..=Outputs::ANALOG as u16, 4),
        /// Leave out lines that begin with `/`; default false.
        pub block_delete: bool = section.flag("block_delete", false),
        /// Stop at M1 until the operator switches that off.
        pub optional_stop: bool = section.flag("optional_stop", false),
        /// What programs mean.
        pub dialect: Dialect = Dialect::read(section),
        /// How G73 and G83 back off.
        pub pecks: Pecks = Pecks::read(section),
        /// How the tool goes around the contour under G41 and G42.
        pub cutter: Cutter = Cutter::read(section),
        /// How far an arc may miss its end.
        pub arc_radius_tolerance: ArcTolerance = ArcTolerance::read(section),
        /// Numbers that programs read as `#<_ini[section]name>`, by section and name in lower case.
        pub values: BTreeMap<(String, String), f64> = values(section),
        /// Codes that call subroutines.
        pub remaps: Vec<Remap> = {
            let listed = subroutine_directories.iter().flatten();
            let searched: Vec<PathBuf> = directory.iter().flatten().chain(listed).cloned().collect();
            section.tables("remap", |table, above| Remap::read(table, above, &searched))
        },
    }
    rules {
        section.renamed("planner_threads", "threads");
    }
}

keys! {
    /// What the words of programs mean.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Dialect(section) {
        /// X words are diameters (G7) at the start; default false.
        pub diameter_mode: bool = section.flag("diameter_mode", false),
        /// The offset of G92 and G52 outlives the process; default true.
        pub keep_g92: bool = section.flag("keep_g92", true),
        /// Subprograms in Fanuc's style (a bare O-word, M98, M99); default true.
        pub fanuc_subroutines: bool = section.flag("fanuc_subroutines", true),
    }
}

keys! {
    /// How far drilling cycles back off where a line says nothing.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Pecks(section) {
        /// How far G73 backs off where its line has no D, mm; `None`: 1 mm, in a program in inches 0.05 in.
        pub chip_breaking_mm: Option<f64> = section.optional_number("chip_breaking_clearance_mm", PECK_CLEARANCE_MM),
        /// How far above the last depth G83 begins to feed again where its line has no D, mm; `None`: as for G73.
        pub deep_hole_mm: Option<f64> = section.optional_number("peck_clearance_mm", PECK_CLEARANCE_MM),
    }
}

keys! {
    /// Cutter compensation (G41, G42).
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Cutter(section) {
        /// How the tool goes around outer corners under G41 and G42; default by an arc.
        pub corner: Corner = cutter_corner(section),
        /// What happens where it would cut into another part of the contour; default an error.
        pub gouge: Gouge = section.word("gouge", &GOUGES, Gouge::default()),
        /// Feed under G41 and G42 inside of arcs and in inside corners; default as programmed.
        pub feed: FeedSettings = contour_feed(section),
    }
}

keys! {
    /// Greatest difference of an arc's radii at start and end.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct ArcTolerance(section) {
        /// Greatest difference of an arc's radii at start and end under G21, mm; default 0.02·√2.
        pub mm: f64 =
            arc_tolerance(section, "arc_radius_tolerance_mm", ARC_TOLERANCE_MIN_MM, ARC_RADIUS_TOLERANCE[0]),
        /// The same under G20, inch; default 0.002·√2.
        pub inch: f64 =
            arc_tolerance(section, "arc_radius_tolerance_inch", ARC_TOLERANCE_MIN_INCH, ARC_RADIUS_TOLERANCE[1]),
    }
}

impl ArcTolerance {
    /// That of a unit in mm, where it is another than LinuxCNC's.
    pub fn own_mm(&self, unit: LengthUnit) -> Option<f64> {
        let [mm, inch] = ARC_RADIUS_TOLERANCE;
        match unit {
            LengthUnit::Millimetre => Some(self.mm).filter(|tolerance| *tolerance != mm),
            LengthUnit::Inch => {
                let tolerance = Some(self.inch).filter(|tolerance| *tolerance != inch);
                tolerance.map(|tolerance| tolerance * LengthUnit::Inch.mm())
            }
        }
    }
}

impl Program {
    /// Threads that plan at the most where the machine file names no number.
    pub const THREADS_USUAL: usize = 4;
}

impl Default for Program {
    fn default() -> Program {
        left_out(|section| Program::read(section, Path::new("")))
    }
}

keys! {
    /// M100 to M199: programs of the PC that part programs may start.
    #[derive(Clone, Debug, PartialEq)]
    pub struct UserCodes(section, base: &Path) {
        /// They may be started; default false.
        pub allowed: bool = section.flag("user_codes", false),
        /// Folders of the files `M100` to `M199`, in the order in which they are searched.
        pub directories: Vec<PathBuf> = section.folders("user_code_directories", base),
        /// How long one may run, s; default 60.
        pub timeout_s: f64 = section.number("user_code_timeout_s", USER_CODE_TIMEOUT, 60.0),
    }
    rules {
        if allowed == Some(true) && directories.as_ref().is_some_and(Vec::is_empty) {
            return section.refused("user_codes", "needs user_code_directories, where the files M100 to M199 are");
        }
    }
}

impl Default for UserCodes {
    fn default() -> UserCodes {
        left_out(|section| UserCodes::read(section, Path::new("")))
    }
}

keys! {
    /// `[tools]`
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Tools(section, base: &Path) {
        /// The tool table; `None`: tools 1 to 99, none with a length or diameter.
        pub table: Option<PathBuf> = section.file("table", base, MayBeMissing::No),
        /// What pocket numbers mean; default fixed.
        pub changer: ToolChanger = section.word("changer", &CHANGERS, ToolChanger::Fixed),
    }
}

/// `machine.units`: what lengths in the tool table and the parameter file are in, and a program before G20 or G21.
pub(super) fn units(section: &mut Section<'_, '_>) -> Option<LengthUnit> {
    let words = [("mm", LengthUnit::Millimetre), ("inch", LengthUnit::Inch)];
    section.word("units", &words, LengthUnit::Millimetre)
}

/// Greatest difference of an arc's radii, of which the default is the greatest that there is.
fn arc_tolerance(section: &mut Section<'_, '_>, key: &'static str, least: f64, most: f64) -> Option<f64> {
    section.number(key, Bound::Within(least, most), most)
}

/// `feed_at_contour` and the keys of inside corners, of which the share switches them on.
fn contour_feed(section: &mut Section<'_, '_>) -> Option<FeedSettings> {
    const SHARE: &str = "inside_corner_feed";
    let arcs = section.flag("feed_at_contour", false);
    let slow = section.optional(SHARE).is_some();
    let share = section.number(SHARE, INSIDE_CORNER_SHARE, 1.0);
    let distance_mm = section.optional_number("inside_corner_mm", Bound::Positive(INSIDE_CORNER_MAX_MM));
    let bend_degrees = section.number("inside_corner_degrees", INSIDE_CORNER_BEND, INSIDE_CORNER_DEGREES);
    for key in ["inside_corner_mm", "inside_corner_degrees"] {
        if section.has(key) && !slow {
            return section.refused(key, "needs inside_corner_feed");
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
        return section.refused(limit, "needs cutter_corner = \"intersection\"");
    }
    let limit_degrees = limit_degrees?;
    Some(match intersection {
        false => Corner::Arc,
        true => Corner::Intersection { limit_degrees },
    })
}

/// `[program.pins]`: what programs read as `#<_hal[pin]>` where no control runs.
fn pins(section: &mut Section<'_, '_>) -> Option<BTreeMap<String, f64>> {
    let Some(mut table) = section.optional_section("pins") else {
        return Some(BTreeMap::new());
    };
    let pins = table.each(|table, name| {
        Some((
            name.to_ascii_lowercase(),
            table.any_number(name, Bound::Size(VALUE_MAX))?,
        ))
    })?;
    let count = pins.len();
    let pins: BTreeMap<_, _> = pins.into_iter().collect();
    (pins.len() == count).then_some(pins)
}

/// `[program.values.SECTION]`: numbers that programs read as `#<_ini[SECTION]NAME>`.
fn values(section: &mut Section<'_, '_>) -> Option<BTreeMap<(String, String), f64>> {
    let mut values = BTreeMap::new();
    let Some(mut groups) = section.optional_section("values") else {
        return Some(values);
    };
    groups.each(|groups, group| {
        groups.any_section(group)?.each(|table, name| {
            let value = table.any_number(name, Bound::Size(VALUE_MAX))?;
            let key = (group.to_ascii_lowercase(), name.to_ascii_lowercase());
            match values.insert(key, value) {
                None => Some(()),
                Some(_) => table.refused(name, "stands here twice: case does not matter to programs"),
            }
        })
    })?;
    Some(values)
}
