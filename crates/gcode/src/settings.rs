//! What an interpreter is told before the first line.

use crate::ToolTable;
use ::compensation::{Corner, FeedSettings, Gouge};
use motion::canon::{AXES, LengthUnit, PathMode, Position};
use motion::kinematics::Kinematics;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Which path the moves under cutter compensation describe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CompensatedPath {
    /// That of the tool's centre.
    #[default]
    Centre,
    /// As programmed, between [`motion::canon::Call::SetCutterCompensation`]s.
    Programmed,
}

/// How curves (G5 to G5.3) are told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Splines {
    /// As what they are, by [`motion::canon::Call::NurbsFeed`]: for those who show a program. In G93, LinuxCNC tells no feed
    /// with them, and neither does this.
    #[default]
    Nurbs,
    /// The same for a planner: in G93 with the feed that makes a curve take the time on its line.
    Timed,
    /// By arcs and lines: for a planner that knows nothing else.
    Arcs {
        /// How far they may leave the curve, mm, above 0.
        tolerance_mm: f64,
    },
}

/// A code that calls a subroutine instead of what it usually does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remap {
    /// `G88.1`, `M400`, or `T`, `S`, `F`; capital letter first.
    pub code: String,
    /// Name of the subroutine, in lower case.
    pub subroutine: String,
    /// Words that the subroutine takes, in LinuxCNC's form: a capital letter must be there, a small one may be. They are
    /// its named parameters, `#<x>` of X or, where the form begins with `@`, #1, #2, ... `>` demands a feed above 0, `^` a
    /// spindle speed above 0, `n` or `N` hands on the line number.
    pub arguments: String,
    /// Modal group of a G or M code.
    pub modal_group: u8,
}

/// What a machine does at a tool change (M6) before the tool is changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ToolChangePlace {
    /// The spindles go on turning.
    pub spindle_on: bool,
    /// Z goes to machine position 0.
    pub quill_up: bool,
    /// Then the axes go to the stored point of G30.
    pub at_g30: bool,
}

/// What the machine remembers from before the program, and how it is set up.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Where the axes stand, machine coordinates, mm and degrees.
    pub start: Position,
    /// Origins of G54 (index 0) to G59.3 (index 8), machine coordinates, mm and degrees.
    pub work_offsets: [Position; 9],
    /// R of the work systems: their rotation about Z, degrees.
    pub work_rotations_degrees: [f64; 9],
    /// Work system that is active at the start: 1 for G54 to 9 for G59.3; beyond, the nearest of them.
    pub work_system: u8,
    /// Offset of G92 and G52, mm and degrees.
    pub g92_offset: Position,
    /// Whether that offset is in effect at the start.
    pub g92_active: bool,
    /// Path mode at the start.
    pub path_mode: PathMode,
    /// Unit of lengths (G20, G21) at the start.
    pub length_unit: LengthUnit,
    /// Unit of the machine: that of stored parameters (#5161 to #5390).
    pub machine_unit: LengthUnit,
    /// Stored point of G28, machine coordinates, mm and degrees.
    pub g28: Position,
    /// Stored point of G30, machine coordinates, mm and degrees.
    pub g30: Position,
    /// Further parameters by number: what a parameter file holds. Numbers that have a field above are taken from there.
    pub parameters: BTreeMap<u16, f64>,
    /// Tool table at the start.
    pub tools: ToolTable,
    /// Number of the tool in the spindle, 0: none.
    pub tool_in_spindle: u32,
    /// What M6 does before the change.
    pub tool_change: ToolChangePlace,
    /// G43 goes on with the length of the next tool after a tool change.
    pub keep_tool_offset: bool,
    /// From axes to joints: where the axes read otherwise when tool-centre-point control (G43.4) is switched. Without joints
    /// the machine has none.
    pub kinematics: Kinematics,
    /// Whether lines that begin with `/` are left out.
    pub block_delete: bool,
    /// Path of the moves under cutter compensation.
    pub compensated_path: CompensatedPath,
    /// How the compensated tool goes around outer corners.
    pub cutter_corner: Corner,
    /// What happens where it would cut into another part of the contour.
    pub gouge: Gouge,
    /// Feed of the compensated tool inside of arcs and in inside corners.
    pub contour_feed: FeedSettings,
    /// How curves are told.
    pub splines: Splines,
    /// Whether X words are diameters at the start (G7).
    pub diameter_mode: bool,
    /// Spindles that the machine has, 1 to [`motion::canon::SPINDLES`].
    pub spindles: u8,
    /// Rotary axes that have no ends: absolute positions are reached the short way round, the sign tells the direction.
    pub wrapped_rotary: [bool; AXES],
    /// Greatest difference of the radii at start and end of an arc, mm; `None`: LinuxCNC's for the unit in force.
    pub arc_radius_tolerance_mm: Option<f64>,
    /// How far G73 backs off where its line has no D, mm; `None`: 1 mm, in inches 0.05 in.
    pub chip_breaking_clearance_mm: Option<f64>,
    /// How far above the last depth G83 begins to feed again where its line has no D, mm; `None`: as for G73.
    pub peck_clearance_mm: Option<f64>,
    /// Digital inputs and outputs that programs may name, each: LinuxCNC has at most 64.
    pub digital_pins: u16,
    /// Analog inputs and outputs that programs may name, each: LinuxCNC has at most 16.
    pub analog_pins: u16,
    /// Added to the angles of M19, degrees.
    pub orient_offset_degrees: f64,
    /// An M19 without R, P and Q, which orients nothing, is an error; LinuxCNC takes no notice of it.
    pub orient_needs_angle: bool,
    /// Folders in which subroutines with files of their own are looked for, in this order.
    pub subroutine_folders: Vec<PathBuf>,
    /// Subroutines that come with the machine, path of the file and its text: found where no folder has a file of that name.
    pub subroutine_files: &'static [(&'static str, &'static str)],
    /// Codes of M100 to M199 that can be run; `None`: all, for those who only look at a program.
    pub user_codes: Option<Vec<u8>>,
    /// Whether there are subprograms in Fanuc's style: a bare O-word, M98 and M99. Without them these words are errors.
    pub fanuc_subprograms: bool,
    /// Whether M99 in the program itself runs it again from its start; else it ends it.
    pub repeats_by_m99: bool,
    /// Codes that call subroutines.
    pub remaps: Vec<Remap>,
    /// Values of `#<_ini[section]key>`, by `section` and `key` in lower case.
    pub ini_values: BTreeMap<(String, String), f64>,
    /// Values of `#<_hal[pin]>` where no control runs, by name in lower case.
    pub pin_values: BTreeMap<String, f64>,
    /// Lines that are run before every program, modes only.
    pub startup_code: String,
}

impl Default for Settings {
    /// Everything at zero, G54, G21, G64 without tolerance, no block delete.
    fn default() -> Settings {
        Settings {
            start: Position::ZERO,
            work_offsets: [Position::ZERO; 9],
            work_rotations_degrees: [0.0; 9],
            work_system: 1,
            g92_offset: Position::ZERO,
            g92_active: false,
            path_mode: PathMode::Continuous {
                tolerance_mm: None,
                naive_cam_tolerance_mm: None,
            },
            length_unit: LengthUnit::Millimetre,
            machine_unit: LengthUnit::Millimetre,
            g28: Position::ZERO,
            g30: Position::ZERO,
            parameters: BTreeMap::new(),
            tools: ToolTable::default(),
            tool_in_spindle: 0,
            tool_change: ToolChangePlace::default(),
            keep_tool_offset: false,
            kinematics: Kinematics::trivial(&[]),
            block_delete: false,
            compensated_path: CompensatedPath::default(),
            cutter_corner: Corner::default(),
            gouge: Gouge::default(),
            contour_feed: FeedSettings::default(),
            splines: Splines::default(),
            diameter_mode: false,
            spindles: 1,
            wrapped_rotary: [false; AXES],
            arc_radius_tolerance_mm: None,
            chip_breaking_clearance_mm: None,
            peck_clearance_mm: None,
            digital_pins: 256,
            analog_pins: 256,
            orient_offset_degrees: 0.0,
            orient_needs_angle: false,
            subroutine_folders: Vec::new(),
            subroutine_files: &[],
            user_codes: None,
            fanuc_subprograms: true,
            repeats_by_m99: false,
            remaps: Vec::new(),
            ini_values: BTreeMap::new(),
            pin_values: BTreeMap::new(),
            startup_code: String::new(),
        }
    }
}
