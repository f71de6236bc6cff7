//! The machine: a value of [`Config`] is always a machine that may run.
//!
//! In:  the sections of the machine file, in an order in which each can be checked against those before.
//! Out: to every part of the process. Nothing here is ever invalid: ranges, references and names are checked.

use super::axes::{self, AxisMap};
use super::bus;
use super::bus_types::Bus;
use super::cell::Cell;
use super::components::{self, Component};
use super::document::Log;
use super::drive;
use super::external::{self, External};
use super::homing_fit;
use super::input_device::{InputDevice, inputs};
use super::joints::{self, JOINTS_MAX, Joint};
use super::kinematics::{self, Family};
use super::logics::{self, LogicTask};
use super::net::Net;
use super::panel::Panel;
use super::program::{CLASSIC_IS_LINEAR, Program, Tools, units};
use super::question::Bound;
use super::rt::Rt;
use super::section::{Section, keys, left_out};
use super::sim::Sim;
use super::spindle::{self, Spindle};
use super::steps::{self, Steps};
use super::values::{NAME_RULE, is_name};
use motion::canon::{Axis, LengthUnit, Position};
use motion::kinematics::{Follows, Kinematics, ToolFrame, Transform};
use motion::plan::PlannerKind;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::de::DeTable;

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
    pub stops: Stops,
    /// Connections between pins.
    pub nets: Vec<Net>,
    /// In the order in which they run.
    pub components: Vec<Component>,
    /// Programs in Structured Text.
    pub logics: Vec<LogicTask>,
    /// Those whose outputs other processes write.
    pub external: Vec<External>,
    /// Devices of the kernel; the pins of each are one of `external`, at its end.
    pub inputs: Vec<InputDevice>,
    /// What the simulated machine is made of.
    pub sim: Sim,
    /// The operator panel in the browser; `None`: only where the command line asks for it.
    pub panel: Option<Panel>,
    /// The link to the supervisor of a cell.
    pub cell: Option<Cell>,
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

/// Whether the planner that is chosen suits the kinematics: once more where it has been changed.
///
/// # Errors
/// Why it does not.
pub fn check_planner(config: &Config) -> Result<(), &'static str> {
    let tip = ToolFrame {
        tcp: true,
        ..ToolFrame::OFF
    };
    match config.program.planner {
        PlannerKind::Classic if !config.kinematics().is_linear(&tip) => Err(CLASSIC_IS_LINEAR),
        PlannerKind::Classic | PlannerKind::Optimal => Ok(()),
    }
}

keys! {
    /// What is done with the energy that is left when the mains fail, behind the stop on the path.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Mains(section) {
        /// The axis that takes the tool out of the work.
        pub retract_axis: Axis = match section.has("retract_axis") {
            true => section.axis("retract_axis"),
            false => Some(Axis::Z),
        },
        /// How far, mm; its sign is the direction. 0: it stays.
        pub retract_mm: f64 = section.number("retract_mm", Bound::Within(-1000.0, 1000.0), 0.0),
    }
}

impl Default for Mains {
    fn default() -> Mains {
        left_out(Mains::read)
    }
}

/// Stops that nobody has planned.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stops {
    /// How drives stop in an emergency stop.
    pub emergency: StopCategory,
    /// What is done when the mains fail.
    pub mains: Mains,
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

/// What `[machine]` says; `None` where it is wrong.
#[derive(Default)]
struct Machine {
    name: Option<String>,
    family: Option<Family>,
    cycle_us: Option<u32>,
    unit: Option<LengthUnit>,
    state_directory: Option<Option<PathBuf>>,
    probe_stops_jog: Option<bool>,
}

fn machine(section: &mut Section<'_, '_>, base: &Path) -> Machine {
    let name = section.text("name", "the name of the machine");
    if name.is_some_and(|name| !is_name(name)) {
        section.wrong("name", NAME_RULE);
    }
    let family = section.word("kinematics", &Family::WORDS, Family::Trivial);
    let cycle_us: Option<u32> = section.integer("cycle_us", 125..=10_000, 1000);
    // 60C2 tells a drive its cycle as an octet and a power of ten.
    let in_60c2 = |cycle_us: u32| {
        let mut units = [1, 10, 100].into_iter();
        units.any(|unit| cycle_us.is_multiple_of(unit) && cycle_us / unit <= 255)
    };
    if cycle_us.is_some_and(|cycle_us| !in_60c2(cycle_us)) {
        let rule = "must be a time that a drive can be told: above 255 whole tens, above 2550 whole hundreds";
        section.wrong("cycle_us", rule);
    }
    Machine {
        name: name.map(str::to_owned),
        family,
        cycle_us,
        unit: units(section),
        state_directory: section.new_folder("state_directory", base),
        probe_stops_jog: section.flag("probe_stops_jog", true),
    }
}

/// What moves; `None` where it is wrong.
struct Mechanics {
    steps: Option<Option<Steps>>,
    /// Those that are right.
    joints: Vec<Joint>,
    /// Whether all of them are.
    complete: bool,
    axes: Option<Vec<AxisMap>>,
    transform: Option<Transform>,
}

impl Mechanics {
    /// `[steps]`, `[[joint]]`, `[[axis]]`, `[kinematics]`; `None`: axes or joints that the kinematics need are not there.
    fn read(
        root: &mut Section<'_, '_>,
        family: Option<Family>,
        around: &joints::Surroundings<'_>,
        timeout_us: Option<u32>,
    ) -> Option<Mechanics> {
        let port = root.optional_section("steps");
        let port = port.and_then(|section| steps::steps(section, timeout_us, around.cycle_us));
        let mut taken = joints::Taken::new(port);
        // To be said, so that a file that ends too soon is no machine.
        let is_still = family == Some(Family::None);
        let tables = match is_still {
            true => no_tables(root, "joint"),
            false => root.some_sections("joint"),
        };
        let count = tables.len();
        if count > JOINTS_MAX {
            let rule = format!("must not be more than {JOINTS_MAX} joints, are {count}");
            root.wrong("joint", rule);
        }
        let joints = tables
            .into_iter()
            .filter_map(|table| table.whole(|table| joints::joint(table, around, &mut taken)));
        let joints: Vec<Joint> = joints.collect();
        let complete = joints.len() == count;
        let axes = match is_still {
            true => no_tables(root, "axis").is_empty().then(Vec::new),
            false => axes::axes(root, count, family.is_none_or(Family::follows)),
        };
        let table = root.section("kinematics").zip(family);
        let mut transform = table.and_then(|(table, family)| table.whole(|table| kinematics::transform(table, family)));
        if let (Some(transform), Some(axes), true) = (&mut transform, &axes, complete)
            && !kinematics::fit(root, transform, axes, &joints)
        {
            return None;
        }
        let touch_probes = joints.iter().filter(|joint| joint.touch_probe.is_some()).count();
        if touch_probes != 0 && touch_probes != joints.len() {
            let rule =
                "touch_probe must stand at all joints or at none: where the tool was at a contact takes all of them";
            root.wrong("joint", rule);
        }
        let steps = taken.into_steps();
        if steps.is_some() && joints.iter().all(|joint| joint.step.is_none()) {
            root.wrong("steps", "is used by no joint: one with output = \"step\"");
        }
        Some(Mechanics {
            steps: match around.has_steps {
                true => steps.map(Some),
                false => Some(None),
            },
            joints,
            complete,
            axes,
            transform,
        })
    }

    /// All joints.
    fn all_joints(&self) -> Option<&[Joint]> {
        self.complete.then_some(self.joints.as_slice())
    }
}

/// Tables that a machine of inputs and outputs does not have.
fn no_tables<'d, 'l>(root: &mut Section<'d, 'l>, key: &'static str) -> Vec<Section<'d, 'l>> {
    if root.optional(key).is_some() {
        root.wrong(key, "cannot be: machine.kinematics is \"none\"");
    }
    Vec::new()
}

/// Reads the whole file, which lies at `path`.
pub(super) fn machine_file<'d>(log: &Log<'d>, table: &DeTable<'d>, path: &Path) -> Option<Config> {
    let mut root = Section::root(log, table);
    root.integer("schema", 1..=1, None);
    let base = path.parent().unwrap_or(Path::new(""));
    let machine = root
        .table("machine", |section| Some(machine(section, base)))
        .unwrap_or_default();
    let (family, cycle_us) = (machine.family, machine.cycle_us);
    let rt = root.table("rt", |section| Rt::read(section, cycle_us.unwrap_or(10_000)));
    let uses = drive::uses(table);
    let bus = root.table("bus", |section| bus::bus(section, cycle_us, base, &uses));
    let nodes = bus.as_ref().map(|bus| bus.nodes.as_slice());
    let around = joints::Surroundings {
        nodes,
        cycle_us,
        folder: base,
        has_steps: root.has("steps"),
    };
    let moves = Mechanics::read(&mut root, family, &around, rt.as_ref().map(|rt| rt.timeout_us))?;
    let work_offsets = axes::offsets(&mut root, moves.axes.as_deref());
    let spindle = root.table("spindle", |section| spindle::spindle(section, nodes, &moves.joints));
    let program = root.table("program", |section| {
        let program = Program::read(section, base);
        let is_classic = |program: &Program| program.planner == PlannerKind::Classic;
        if program.as_ref().is_some_and(is_classic) && !family.is_none_or(Family::is_linear) {
            section.wrong("planner", CLASSIC_IS_LINEAR);
        }
        program
    });
    let tools = root.table("tools", |section| Tools::read(section, base));
    let hal = root.table("hal", hal);
    if let (Some(joints), Some(axes), Some(transform), Some(nodes), Some((nets, ..))) =
        (moves.all_joints(), &moves.axes, &moves.transform, nodes, &hal)
    {
        homing_fit::fit(&mut root, joints, axes, transform, nodes, nets);
    }
    let sim = root.table("sim", |section| Sim::read(section, nodes, moves.all_joints()));
    let mains = root.table("mains", Mains::read);
    let estop_category = root.table("estop", |section| section.integer("category", 0..=1, 1));
    let priority = rt.as_ref().map(|rt| rt.priority);
    let logics = logics::logics(&mut root, base, cycle_us, priority);
    if let (Some(logics), Some((nets, components, ..))) = (&logics, &hal) {
        logics::keep_fast_inputs(&root, logics, nets, components);
    }
    let folder = machine.state_directory.as_ref().and_then(|folder| folder.as_deref());
    let panel = root.optional_table("panel", |section| Panel::read(section, base, folder));
    let cell = root.optional_table("cell", |section| Cell::read(section, base, folder.is_some()));
    root.done();

    let (nets, components, external, inputs) = hal?;
    Some(Config {
        path: path.to_owned(),
        name: machine.name?,
        cycle_us: cycle_us?,
        state_directory: machine.state_directory?,
        probe_stops_jog: machine.probe_stops_jog?,
        unit: machine.unit?,
        rt: rt?,
        steps: moves.steps?,
        transform: moves.transform?,
        joints: moves.complete.then_some(moves.joints)?,
        axes: moves.axes?,
        bus: bus?,
        work_offsets: work_offsets?,
        spindle: spindle?,
        program: program?,
        tools: tools?,
        stops: Stops {
            mains: mains?,
            emergency: match estop_category? {
                0 => StopCategory::Zero,
                _ => StopCategory::One,
            },
        },
        nets,
        components,
        logics: logics?,
        external,
        inputs,
        sim: sim?,
        panel: panel?,
        cell: cell?,
    })
}

/// `[[hal.net]]`, `[[hal.component]]`, `[[hal.external]]`, `[[hal.input]]`.
#[allow(clippy::type_complexity, reason = "what a table has, once")]
fn hal(section: &mut Section<'_, '_>) -> Option<(Vec<Net>, Vec<Component>, Vec<External>, Vec<InputDevice>)> {
    let tables = section.sections("net");
    let (count, mut nets) = (tables.len(), Vec::new());
    for table in tables {
        let net = table.whole(|table| Net::read(table, &nets));
        nets.extend(net);
    }
    let complete = nets.len() == count;
    let components = components::components(section, &nets);
    let mut external = external::external(section, &nets);
    let mut none = Vec::new();
    let inputs = inputs(section, external.as_mut().unwrap_or(&mut none));
    complete.then_some((nets, components?, external?, inputs?))
}
