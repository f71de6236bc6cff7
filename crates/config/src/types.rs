//! The checked machine description: a value of these types is always a machine that may run.
//!
//! In:  from `read`, which turns TOML into these types or into located errors.
//! Out: to every part of the process. Nothing here is ever invalid: ranges, references and names are checked.

use super::analog::AnalogOutput;
pub use super::bus_types::*;
use super::cell::Cell;
pub use super::channels::{Channel, ChannelKind, Follow, ObjectKind};
pub use super::drive::{DriveMode, Reactions, targets, touch_probe_objects};
pub use super::drive_profile::{DriveProfile, InputBits, MappingLimits};
pub use super::factor_group::FactorGroup;
use super::logics::LogicTask;
use super::panel::Panel;
pub use super::sim::{Sim, SimBody, SimFault, SimFaultKind, SimJoint, SimOutline, SimProbe, SimSignal, SimSurface};
pub use super::spindle::{Spindle, SpindleAxis, SpindleCounter, SpindleDrive, SpindleEncoder};
use super::steps::{StepOutput, Steps};
use cia402::profile::object_of;
pub use gcode::ToolChanger;
use motion::canon::{Axis, LengthUnit, Position};
use motion::kinematics::{Follows, JOINTS, Kinematics, Transform};
use motion::rt::{MotionLimits, PidGains, PitchTable};
pub use obd::device::{ConfigurationWrite, DeviceDescription};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Most joints that one machine can have.
pub const JOINTS_MAX: usize = JOINTS;

/// A node by its place in the machine file.
pub type NodeIndex = usize;

/// A whole machine file.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Where it was read from; for messages.
    pub path: PathBuf,
    /// Name of the machine; also names its shared memory.
    pub name: String,
    /// Cycle of bus and interpolation, µs.
    pub cycle_us: u32,
    /// Folder for what the control writes by itself: its journal; `None`: nothing outlives the process.
    pub state_directory: Option<PathBuf>,
    /// Whether the probe stops a jog as it comes into contact.
    pub probe_stops_jog: bool,
    /// Unit of lengths in tool table and parameter file, and in a program before G20 or G21. All keys of the machine file
    /// itself are in mm.
    pub unit: LengthUnit,
    pub rt: Rt,
    /// The field bus.
    pub bus: Bus,
    /// Where step pulses come out; `None`: nowhere.
    pub steps: Option<Steps>,
    /// Family of the kinematics, with its parameters.
    pub transform: Transform,
    /// Joints in the order of the file.
    pub joints: Vec<Joint>,
    /// Program axes and their joints.
    pub axes: Vec<AxisMap>,
    /// Origins of G54 (index 0) to G59.3 (index 8), machine coordinates.
    pub work_offsets: [Position; 9],
    pub spindle: Spindle,
    /// How programs are run.
    pub program: Program,
    pub tools: Tools,
    pub mains: Mains,
    /// How drives stop in an emergency stop.
    pub estop_category: StopCategory,
    /// Connections between pins.
    pub nets: Vec<Net>,
    /// In the order in which they run.
    pub components: Vec<Component>,
    /// Programs in Structured Text.
    pub logics: Vec<LogicTask>,
    /// Those whose outputs other processes write.
    pub external: Vec<External>,
    /// What the simulated machine is made of.
    pub sim: Sim,
    /// The operator panel in the browser; `None`: only where the command line asks for it.
    pub panel: Option<Panel>,
    /// The link to the supervisor of a cell.
    pub cell: Option<Cell>,
}

/// `[rt]`. What is `None` is found out by a short measurement when the machine starts; the default holds where that is
/// switched off or cannot be made.
#[derive(Clone, Debug, PartialEq)]
pub struct Rt {
    /// Core of the real-time threads; `None`: the last isolated one, else the last one online.
    pub cpu: Option<usize>,
    /// SCHED_FIFO priority of the cycle thread, 1 to 96; the time-out thread runs one above, a simulated machine two.
    pub priority: u8,
    /// Period of the time-out thread, µs.
    pub timeout_us: u32,
    /// Cycles start at `k * cycle_us + phase_us` of CLOCK_MONOTONIC.
    pub phase_us: Option<u32>,
    /// Spin this long before each cycle, µs.
    pub spin_us: Option<u32>,
    /// How the core is kept from idle states that take long to leave.
    pub keep_awake: Option<KeepAwake>,
    /// Measure what is best for the three above.
    pub calibrate: bool,
    /// A cycle that begins later than this is left out, µs; `None`: a quarter of the cycle. See [`Rt::late_max_us`].
    pub late_max_us: Option<u32>,
    /// Cycles left out of a thousand above which the operator is warned; 0: never.
    pub overruns_warn: u32,
    /// Cycles left out of a thousand above which the machine stops with an alarm; 0: never.
    pub overruns_stop: u32,
    /// Lock all memory.
    pub lock_memory: bool,
    /// What to do where something is missing.
    pub require: Require,
}

impl Default for Rt {
    fn default() -> Rt {
        Rt {
            cpu: None,
            priority: 80,
            timeout_us: 50,
            phase_us: None,
            spin_us: None,
            keep_awake: None,
            calibrate: true,
            late_max_us: None,
            overruns_warn: 5,
            overruns_stop: 200,
            lock_memory: true,
            require: Require::Warn,
        }
    }
}

impl Rt {
    /// Spin of a machine that says nothing, µs.
    pub const SPIN_DEFAULT_US: u32 = 50;

    /// A cycle that begins later than this is left out, µs. A late SoC makes two periods uneven by as much; a missing one makes
    /// one period double: which of them drives take better, their manuals say.
    pub fn late_max_us(&self, cycle_us: u32) -> u32 {
        self.late_max_us.unwrap_or(cycle_us / 4)
    }

    /// The spin without a measurement, µs.
    pub fn spin_us(&self) -> u32 {
        self.spin_us.unwrap_or(Rt::SPIN_DEFAULT_US)
    }

    /// The phase without a measurement, µs: at 37 % of the cycle, far from the scheduler tick, which comes on whole
    /// milliseconds; there in the middle between two ticks of the time-out thread, where these meet the cycle regularly.
    pub fn phase_us(&self, cycle_us: u32) -> u32 {
        self.phase_us.unwrap_or_else(|| {
            let wanted_us = cycle_us * 37 / 100;
            if cycle_us.is_multiple_of(self.timeout_us) {
                wanted_us / self.timeout_us * self.timeout_us + self.timeout_us / 2
            } else {
                wanted_us
            }
        })
    }
}

/// How the core of the real-time threads is kept from idle states that take long to leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KeepAwake {
    /// `/dev/cpu_dma_latency` is held open at 0: the kernel chooses no idle state that takes time to leave. For PCs whose
    /// kernel has a driver for idle states.
    DmaLatency,
    /// A thread of the lowest priority (SCHED_IDLE) spins on the core. For virtual machines without such a driver.
    IdleThread,
    /// The time-out thread wakes at each of its ticks, needed or not. Takes from a tenth (real PCs) to half (virtual machines)
    /// of the core.
    Ticks,
    /// Not at all.
    None,
}

impl KeepAwake {
    /// The word of the machine file.
    pub const fn name(self) -> &'static str {
        match self {
            KeepAwake::DmaLatency => "dma-latency",
            KeepAwake::IdleThread => "idle-thread",
            KeepAwake::Ticks => "ticks",
            KeepAwake::None => "none",
        }
    }
}

/// What to do where the PC cannot give what real time needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Require {
    /// Refuse to run.
    Strict,
    /// Say so once per item and run.
    Warn,
}

/// `[[joint]]`; lengths in mm, or degrees for a rotary joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Index into [`Bus::nodes`] of the drive; behind them all, counted on, for one whose drive is in
    /// this process ([`Joint::is_local`]).
    pub node: usize,
    /// Axis of the drive at its node, from 0: its objects lie so many times 800h behind those of the first one; default 0.
    pub drive_axis: u8,
    /// Its step pulses; `None`: it has none.
    pub step: Option<StepOutput>,
    /// Its amplifier with an analog input; `None`: it has none.
    pub analog: Option<AnalogOutput>,
    /// Mode in which its drive is run; default CSP.
    pub mode: DriveMode,
    /// Drive increments per mm (degree): numerator and denominator, both above 0. Of step pulses: in parts of a step,
    /// [`SUBSTEPS`](super::SUBSTEPS).
    pub counts_per_unit: [u32; 2],
    /// 60B2 of the drive for an acceleration of 1 mm/s², 1/1000 of the rated torque; `None`: the pin of 60B2 stays free.
    pub torque_per_mm_s2: Option<f64>,
    /// What the drive does when it stops; see [`Reactions`].
    pub reactions: Reactions,
    /// In which units the drive counts; see [`FactorGroup`].
    pub factor_group: FactorGroup,
    /// 60FF and 60B1 of the drive per increment/s: numerator and denominator; default 1 to 1.
    pub velocity_ratio: [u32; 2],
    /// The position loop that the control closes for a drive in CSV or CST: mm to mm/s, or to a share of the rated torque;
    /// `None`: the drive holds the position that it is told.
    pub pid: Option<PidGains>,
    /// What its amplifier takes until it follows, beside the cycles of the bus, s; `None`: nobody has measured it.
    pub amplifier_lag_s: Option<f64>,
    /// Soft limits, lower below upper.
    pub travel_mm: [f64; 2],
    /// Limits of the plan.
    pub limits: JointLimits,
    /// Limits of stops; not below those of the plan.
    pub stop: StopLimits,
    /// Greatest distance between command and actual position, mm.
    pub following_error_mm: f64,
    /// Greatest speed by hand before it is homed, mm/s; default a tenth of its velocity.
    pub unhomed_jog_mm_s: f64,
    /// How it finds out where it is.
    pub homing: Homing,
    /// Number of the touch probe of its drive (1 or 2) at which the machine's probe is wired, too; `None`: none is.
    pub touch_probe: Option<u8>,
    /// Whether 60FDh of its drive tells of its limit switches, beside the pins; default no.
    pub limits_by_drive: bool,
    /// Where 60FDh of its drive shows its switches.
    pub input_bits: InputBits,
    /// What its drive counts at its home point: 0 unless something else is written into 607C.
    pub home_count: i64,
    /// What its drive sends while its safety circuit is open; `None`: nothing that is known.
    pub sto: Option<Sto>,
    /// Of several joints of an axis: how far this one stands ahead of the axis where the gantry is square, mm; default 0.
    pub squaring_offset_mm: f64,
    /// Backlash and pitch errors; the limits above are then what they leave.
    pub compensation: Option<Compensation>,
}

impl Joint {
    /// Whether its drive is in this process: it has step pulses or an amplifier behind an I/O node.
    pub fn is_local(&self) -> bool {
        self.step.is_some() || self.analog.is_some()
    }
}

/// What the motor is told beside the position of its joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Compensation {
    /// Way that is lost when the joint turns round, mm.
    pub backlash_mm: f64,
    pub table: PitchTable,
    /// How fast a difference may be taken up, mm and s.
    pub take_up: MotionLimits,
}

/// Limits of planned motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// mm/s
    pub velocity_mm_s: f64,
    /// mm/s²
    pub acceleration_mm_s2: f64,
    /// mm/s³
    pub jerk_mm_s3: f64,
}

/// Limits of stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopLimits {
    /// mm/s²
    pub acceleration_mm_s2: f64,
    /// mm/s³
    pub jerk_mm_s3: f64,
}

/// `[joint.homing]`: how a joint finds out where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homing {
    /// Speed towards the switch, mm/s; 6099:1.
    pub search_mm_s: f64,
    /// Speed at which its place is found, mm/s; 6099:2.
    pub latch_mm_s: f64,
    /// Where the joint stands when it is homed, mm; of a drive: machine position of its home point. Default 0.
    pub position_mm: f64,
    /// Joints of lower numbers home first, those of the same side by side; `None`: see [`Homing::sequence`].
    pub sequence: Option<u8>,
    /// The encoder knows its place from power-on on: the joint stays homed over a restart; default no.
    pub absolute_encoder: bool,
    /// How far a joint with an absolute encoder may have moved meanwhile, mm; default 1.
    pub moved_when_off_mm: f64,
    /// The joint is to be homed again whenever its drive has been switched off; default no.
    pub volatile: bool,
    /// Who homes it.
    pub by: HomingBy,
}

impl Homing {
    /// Place in the order of homing of a joint that moves `axis`; where the file names none, Z comes first, because the tool
    /// must be clear before anything moves sideways.
    pub fn sequence(&self, axis: Axis) -> u8 {
        self.sequence.unwrap_or(if axis == Axis::Z { 0 } else { 1 })
    }
}

/// Who homes a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomingBy {
    /// Its drive (CiA 402 mode 6).
    Drive {
        /// Homing method, 6098.
        method: i8,
        /// 609A as mm/s².
        acceleration_mm_s2: f64,
    },
    /// The control, in the cyclic mode.
    Control(HomingByControl),
}

/// Homing by the control; see `motion::rt::homing`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingByControl {
    /// Direction in which the switch lies.
    pub towards_positive: bool,
    /// Who tells of the switch; default a pin.
    pub switch: HomeSwitch,
    /// Position that the place has at which the switch closes, or of the zero mark behind it, mm.
    pub switch_mm: f64,
    /// Where the switch must be found within, mm; default from the far end of the travel, and the way of the release.
    pub search_distance_mm: f64,
    /// Where it must open again within, mm; default 5.
    pub release_distance_mm: f64,
    /// How exactly its place is to be found, mm; default 0.001, or an increment of the drive.
    pub resolution_mm: f64,
    /// How long it must be open to count as open, s; default 0.02.
    pub bounce_s: f64,
    /// How far joints that move an axis together may be moved against each other, mm; `None` for a joint alone.
    pub skew_mm: Option<f64>,
    /// The zero mark of the encoder behind the switch, which then counts; `None`: the switch does.
    pub index: Option<HomingIndex>,
}

/// A zero mark that the drive latches with a touch probe of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingIndex {
    /// Where it must come within behind the switch, mm.
    pub distance_mm: f64,
    /// Number of the touch probe, 1 or 2; default 1.
    pub probe: u8,
}

/// Who tells whether a home switch is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomeSwitch {
    /// The pin `joint.N.home-sw-in`.
    Pin,
    /// Its drive: 60FDh, bit 2 unless its profile has another one.
    Drive,
}

/// The sign of a drive that its safety circuit is open (safe torque off): a bit of an object that it sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sto {
    /// The object, one of the inputs of its node.
    pub object: (u16, u8),
    /// Number of the bit, from 0.
    pub bit: u32,
    /// Value of the bit while the circuit is open; default true.
    pub active: bool,
}

impl Sto {
    /// The same of an axis of a node, where the object is one of the drive profile.
    pub(super) fn of_axis(self, axis: u8) -> Sto {
        let (index, sub) = self.object;
        Sto {
            object: (object_of(axis, index), sub),
            ..self
        }
    }
}

/// Stop categories of IEC 60204-1 that an emergency stop may have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopCategory {
    /// Drives are switched off at once, motors run out.
    Zero,
    /// Drives stop by their quick stop, then take their power away.
    #[default]
    One,
}

/// `[[axis]]`
#[derive(Clone, Debug, PartialEq)]
pub struct AxisMap {
    pub axis: Axis,
    /// Joints that it moves (more than one: gantry).
    pub joints: Vec<usize>,
    /// A rotary axis without ends: programs name angles of one turn; default false.
    pub wrapped: bool,
    /// Soft limits of the axis itself where its joints are not the axis; `None`: only those of the joints.
    pub travel_mm: Option<[f64; 2]>,
}

impl Config {
    /// Why a machine without joints refuses whatever would move something.
    pub fn without_joints(&self) -> String {
        let name = &self.name;
        format!("{name} has no joints: it exchanges inputs and outputs, and moves nothing")
    }

    /// Whether the node of the drive of a joint has other axes that are used.
    pub fn shares_node(&self, joint: &Joint) -> bool {
        let joints = self.joints.iter().map(|joint| (joint.node, joint.drive_axis));
        let spindle = self.spindle.axis.map(|of| (of.node, of.drive_axis));
        let other = |(node, axis)| node == joint.node && axis != joint.drive_axis;
        joint.drive_axis > 0 || joints.chain(spindle).any(other)
    }

    /// The drive of a joint for people: its node, and which axis of that where it has several; `None`: it is in this process.
    pub fn drive_name(&self, joint: &Joint) -> Option<String> {
        let node = self.bus.nodes.get(joint.node)?;
        let name = format!("{} (node {})", node.name, node.id);
        Some(match self.shares_node(joint) {
            true => format!("axis {} of {name}", joint.drive_axis),
            false => name,
        })
    }

    /// Sets of joints (bit n: joint n) in the order in which they home.
    pub fn homing_order(&self) -> Vec<u64> {
        let mut order: BTreeMap<u8, u64> = BTreeMap::new();
        for map in &self.axes {
            for &joint in &map.joints {
                *order.entry(self.joints[joint].homing.sequence(map.axis)).or_default() |= 1 << joint;
            }
        }
        order.into_values().collect()
    }

    /// The joints of X and of Y where they are belts that both axes pull.
    pub fn belts(&self) -> Option<[usize; 2]> {
        let belt = |axis| {
            let map = self.axes.iter().find(|map| map.axis == axis)?;
            map.joints.first().copied()
        };
        matches!(self.transform, Transform::CoreXy).then_some([belt(Axis::X)?, belt(Axis::Y)?])
    }

    /// From axes to joints.
    pub fn kinematics(&self) -> Kinematics {
        let mut follows = [Follows::default(); JOINTS_MAX];
        for (follows, joint) in follows.iter_mut().zip(&self.joints) {
            follows.offset = joint.squaring_offset_mm;
        }
        for map in &self.axes {
            for &joint in &map.joints {
                follows[joint].axis = Some(map.axis);
            }
        }
        Kinematics::new(self.transform, &follows[..self.joints.len()])
    }
}

/// `[program]`
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// Path tolerance of G64 without P, mm; default 0.01.
    pub tolerance_mm: f64,
    /// Path tolerance of G64 at the corners between two rapid moves, mm. `None`: that of the program.
    pub rapid_tolerance_mm: Option<f64>,
    /// Blocks that the planner looks ahead; default 10,000.
    pub look_ahead_blocks: usize,
    /// Blocks over which one thread of the classic planner looks ahead at a time; default 300.
    pub look_ahead_buffer_blocks: usize,
    /// Blocks on either side of such a buffer from which it begins; default 50.
    pub look_ahead_overlap_blocks: usize,
    /// How speed is chosen along the path.
    pub planner: motion::plan::PlannerKind,
    /// Threads that plan, from text to committed motion, that of the program among them. `None`: one for every core that may be used and is not that of the
    /// real-time threads, at most [`Program::THREADS_USUAL`].
    pub threads: Option<usize>,
    /// File of the parameters that outlive a program, LinuxCNC's var file; made if it is missing. `None`: nothing outlives
    /// the process, and [`Config::work_offsets`] hold at each start.
    pub parameter_file: Option<PathBuf>,
    /// Folder of the programs; subroutines are looked for here first.
    pub directory: Option<PathBuf>,
    /// Further folders in which subroutines are looked for, in this order.
    pub subroutine_directories: Vec<PathBuf>,
    /// M100 to M199.
    pub user_codes: UserCodes,
    /// Folder of the files that programs write; `None`: they write none.
    pub log_directory: Option<PathBuf>,
    /// Modes that are set before every program.
    pub startup_code: String,
    /// Values of `#<_hal[pin]>` in checks and plans, by name in lower case.
    pub pins: BTreeMap<String, f64>,
    /// Digital inputs and outputs that programs may name (M62 to M66), each; default 4.
    pub digital_pins: u16,
    /// Analog inputs and outputs that programs may name (M66 to M68), each; default 4.
    pub analog_pins: u16,
    /// Leave out lines that begin with `/`; default false.
    pub block_delete: bool,
    /// Stop at M1 until the operator switches that off.
    pub optional_stop: bool,
    /// X words are diameters (G7) at the start; default false.
    pub diameter_mode: bool,
    /// The offset of G92 and G52 outlives the process; default true.
    pub keep_g92: bool,
    /// Subprograms in Fanuc's style (a bare O-word, M98, M99); default true.
    pub fanuc_subroutines: bool,
    /// How far G73 backs off where its line has no D, mm; `None`: 1 mm, in a program in inches 0.05 in.
    pub chip_breaking_clearance_mm: Option<f64>,
    /// How far above the last depth G83 begins to feed again where its line has no D, mm; `None`: as for G73.
    pub peck_clearance_mm: Option<f64>,
    /// How the tool goes around outer corners under G41 and G42; default by an arc.
    pub cutter_corner: ::compensation::Corner,
    /// What happens where it would cut into another part of the contour; default an error.
    pub gouge: ::compensation::Gouge,
    /// Feed under G41 and G42 inside of arcs and in inside corners; default as programmed.
    pub contour_feed: ::compensation::FeedSettings,
    /// Greatest difference of an arc's radii at start and end under G21, mm; default 0.02·√2.
    pub arc_radius_tolerance_mm: f64,
    /// The same under G20, inch; default 0.002·√2.
    pub arc_radius_tolerance_inch: f64,
    /// Numbers that programs read as `#<_ini[section]name>`, by section and name in lower case.
    pub values: BTreeMap<(String, String), f64>,
    /// Codes that call subroutines.
    pub remaps: Vec<Remap>,
}

/// LinuxCNC's tolerance of an arc's centre where the machine file names none, mm and inch.
pub const ARC_RADIUS_TOLERANCE: [f64; 2] = [0.02 * std::f64::consts::SQRT_2, 0.002 * std::f64::consts::SQRT_2];

impl Program {
    /// Threads that plan at the most where the machine file names no number.
    pub const THREADS_USUAL: usize = 4;
}

impl Default for Program {
    fn default() -> Program {
        let [arc_radius_tolerance_mm, arc_radius_tolerance_inch] = ARC_RADIUS_TOLERANCE;
        Program {
            tolerance_mm: 0.01,
            rapid_tolerance_mm: None,
            look_ahead_blocks: 10_000,
            look_ahead_buffer_blocks: 300,
            look_ahead_overlap_blocks: 50,
            planner: motion::plan::PlannerKind::default(),
            threads: None,
            parameter_file: None,
            directory: None,
            subroutine_directories: Vec::new(),
            user_codes: UserCodes::default(),
            log_directory: None,
            startup_code: String::new(),
            pins: BTreeMap::new(),
            digital_pins: 4,
            analog_pins: 4,
            block_delete: false,
            optional_stop: false,
            diameter_mode: false,
            keep_g92: true,
            fanuc_subroutines: true,
            chip_breaking_clearance_mm: None,
            peck_clearance_mm: None,
            cutter_corner: ::compensation::Corner::default(),
            gouge: ::compensation::Gouge::default(),
            contour_feed: ::compensation::FeedSettings::default(),
            arc_radius_tolerance_mm,
            arc_radius_tolerance_inch,
            values: BTreeMap::new(),
            remaps: Vec::new(),
        }
    }
}

/// M100 to M199: programs of the PC that part programs may start.
#[derive(Clone, Debug, PartialEq)]
pub struct UserCodes {
    /// They may be started; default false.
    pub allowed: bool,
    /// Folders of the files `M100` to `M199`, in the order in which they are searched.
    pub directories: Vec<PathBuf>,
    /// How long one may run, s; default 60.
    pub timeout_s: f64,
}

impl Default for UserCodes {
    fn default() -> UserCodes {
        UserCodes {
            allowed: false,
            directories: Vec::new(),
            timeout_s: 60.0,
        }
    }
}

/// `[[program.remap]]`
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remap {
    /// `G88.1`, `M400`, or `T`, `S`, `F`.
    pub code: String,
    /// 1 of G codes, 4 to 10 of M codes; 0: `T`, `S` and `F` have a place of their own.
    pub modal_group: u8,
    /// Words that the subroutine takes, as in LinuxCNC's argspec.
    pub arguments: String,
    /// Name of the subroutine, in lower case.
    pub subroutine: String,
}

/// `[tools]`
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tools {
    /// The tool table; `None`: tools 1 to 99, none with a length or diameter.
    pub table: Option<PathBuf>,
    /// What pocket numbers mean; default fixed.
    pub changer: ToolChanger,
}

/// `[[hal.component]]`
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Name of the instance, before the names of its pins.
    pub name: String,
    /// Name of its kind in [`components::CATALOGUE`].
    pub kind: &'static str,
    /// When in the cycle it runs.
    pub place: Place,
    /// Options by their keys.
    pub options: Vec<(String, i64)>,
    /// Inputs with values of their own: name behind that of the instance, and the value.
    pub set: Vec<(String, hal_pins::AnyValue)>,
}

/// When in the cycle a component runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Behind the inputs of nodes, before orders and interpolation.
    BeforeMotion,
    /// Behind the set-points, before the outputs of nodes.
    AfterMotion,
}

/// `[[hal.external]]`
#[derive(Clone, Debug, PartialEq)]
pub struct External {
    /// Name before the names of its pins.
    pub name: String,
    /// How long its process may write nothing, ms.
    pub heartbeat_ms: u32,
    pub on_loss: OnLoss,
    pub pins: Vec<hal_pins::ExternalPin>,
}

/// What a process that writes no more does to the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnLoss {
    /// The journal tells it.
    Journal,
    /// The operator is warned.
    Warn,
    /// Alarm and controlled stop.
    Stop,
}

/// `[[hal.net]]`
#[derive(Clone, Debug, PartialEq)]
pub struct Net {
    /// Name of the signal.
    pub name: String,
    /// Pin that writes it, or [`Net::UNWIRED`].
    pub source: String,
    /// Pins that read it.
    pub targets: Vec<String>,
}

impl Net {
    /// In place of a source that is not known yet. What hangs on such a net stops the machine.
    pub const UNWIRED: &str = "unwired";

    /// Whether its source is still to come.
    pub fn is_unwired(&self) -> bool {
        self.source == Net::UNWIRED
    }
}

/// What is done with the energy that is left when the mains fail, behind the stop on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mains {
    /// The axis that takes the tool out of the work.
    pub retract_axis: Axis,
    /// How far, mm; its sign is the direction. 0: it stays.
    pub retract_mm: f64,
}

impl Default for Mains {
    fn default() -> Mains {
        Mains {
            retract_axis: Axis::Z,
            retract_mm: 0.0,
        }
    }
}
