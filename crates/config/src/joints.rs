//! `[[joint]]`: what moves, how far and how fast.

use super::analog::{self, AnalogOutput};
use super::axes::SOFT_LIMITS;
use super::bus_types::{Mapped, Node, Profile};
use super::compensation::{self, Compensation};
use super::drive;
use super::drive_profile::{DriveProfile, InputBits};
use super::factor_group::FactorGroup;
use super::homing::{self, Homing, HomingBy, Known};
use super::limits::{JointLimits, Limits, StopLimits};
use super::modes::{DriveMode, Reactions};
use super::position_loop;
use super::question::Bound;
use super::scale;
use super::section::Section;
use super::steps::{self, StepOutput, Steps};
use super::sto::{Sto, sto};
use super::values::{LENGTH_MAX, VELOCITY_MAX, ratio};
use cia402::profile::object_of;
use motion::kinematics::JOINTS;
use motion::rt::PidGains;
use std::path::Path;

/// Most joints that one machine can have.
pub const JOINTS_MAX: usize = JOINTS;

/// `[[joint]]`; lengths in mm, or degrees for a rotary joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Index into [`Bus::nodes`](super::Bus::nodes) of the drive; behind them all, counted on, for one whose drive is in
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
    /// What 60FDh of its drive tells.
    pub switches: Switches,
    /// What its drive counts at its home point: 0 unless something else is written into 607C.
    pub home_count: i64,
    /// What its drive sends while its safety circuit is open; `None`: nothing that is known.
    pub sto: Option<Sto>,
    /// Of several joints of an axis: how far this one stands ahead of the axis where the gantry is square, mm; default 0.
    pub squaring_offset_mm: f64,
    /// Backlash and pitch errors; the limits above are then what they leave.
    pub compensation: Option<Compensation>,
}

/// The switches of a joint that 60FDh of its drive shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Switches {
    /// Whether limit switches count, beside the pins; default no.
    pub limits: bool,
    /// Where they are.
    pub bits: InputBits,
}

impl Switches {
    /// Whether the lower, and the upper limit switch is closed.
    pub fn limits(&self, digital_inputs: u32) -> [bool; 2] {
        self.bits
            .limits
            .map(|bit| self.limits && digital_inputs >> bit & 1 == 1)
    }

    /// Whether the home switch is closed.
    pub fn home(&self, digital_inputs: u32) -> bool {
        digital_inputs >> self.bits.home & 1 == 1
    }
}

impl Joint {
    /// Whether its drive is in this process: it has step pulses or an amplifier behind an I/O node.
    pub fn is_local(&self) -> bool {
        self.step.is_some() || self.analog.is_some()
    }
}

/// What a joint is checked against.
pub(super) struct Surroundings<'c> {
    /// The nodes; `None` where the bus has errors of its own, which would only be echoed here.
    pub(super) nodes: Option<&'c [Node]>,
    pub(super) cycle_us: Option<u32>,
    /// Where the machine file is.
    pub(super) folder: &'c Path,
    /// Whether there is a table `[steps]`, right or wrong.
    pub(super) has_steps: bool,
}

/// What the joints above have taken.
pub(super) struct Taken {
    /// Ids of nodes, and axes of them.
    drives: Vec<(i64, u8)>,
    /// Joints whose drives are in this process.
    local: usize,
    /// Pins; `None`: there is no port, or it has errors of its own.
    steps: Option<steps::Port>,
}

impl Taken {
    pub(super) fn new(steps: Option<steps::Port>) -> Taken {
        Taken {
            drives: Vec::new(),
            local: 0,
            steps,
        }
    }

    /// The port with all pins that are taken.
    pub(super) fn into_steps(self) -> Option<Steps> {
        self.steps.map(steps::Port::into_steps)
    }
}

/// Who moves a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Output {
    Drive,
    Step,
    Analog,
}

const OUTPUTS: [(&str, Output); 3] = [
    ("drive", Output::Drive),
    ("step", Output::Step),
    ("analog", Output::Analog),
];

/// Keys that are about a drive on the bus.
const OF_DRIVES: [&str; 9] = [
    "node",
    "drive_axis",
    "factor_group",
    "velocity_ratio",
    "torque_per_mm_s2",
    "reactions",
    "sto",
    "touch_probe",
    "limit_switches",
];
/// Those of a loop, which step pulses do not have either.
const OF_LOOPS: [&str; 3] = ["mode", "loop", "pid"];

/// What is known of the drive of a joint when the rest of its keys are read; `None` where it is wrong.
struct Drive<'c> {
    output: Output,
    /// Place of its node among all; of a drive in this process, behind them.
    place: Option<usize>,
    /// Of a drive on the bus.
    node: Option<&'c Node>,
    /// Axis at its node.
    axis: Option<u8>,
    mode: Option<DriveMode>,
    factor_group: Option<FactorGroup>,
}

impl<'c> Drive<'c> {
    fn read(section: &mut Section<'_, '_>, around: &Surroundings<'c>, taken: &mut Taken) -> Option<Drive<'c>> {
        let output = section.word("output", &OUTPUTS, Output::Drive)?;
        if output == Output::Drive {
            let place = node(section, around);
            let node = place.zip(around.nodes).map(|(node, nodes)| &nodes[node]);
            let axis = drive::drive_axis(section, node);
            if let Some(axis) = axis {
                not_taken(section, axis, &mut taken.drives);
            }
            return Some(Drive {
                output,
                place,
                node,
                axis,
                mode: drive::mode(section, node.and_then(|node| node.drive.as_ref())),
                factor_group: drive::factor_group(section, axis.unwrap_or(0), node),
            });
        }
        let (keys, word) = match output {
            Output::Step => ([&OF_DRIVES[..], &OF_LOOPS].concat(), "step"),
            _ => (OF_DRIVES.to_vec(), "analog"),
        };
        section.refuse(
            &keys,
            &format!("is of a drive on the bus: this joint has output = {word:?}"),
        );
        taken.local += 1;
        Some(Drive {
            output,
            place: around.nodes.map(|nodes| nodes.len() + taken.local - 1),
            node: None,
            axis: Some(0),
            mode: drive::mode(section, None),
            factor_group: Some(FactorGroup::default()),
        })
    }

    /// What is known of its kind.
    fn profile(&self) -> Option<&'c DriveProfile> {
        self.node?.drive.as_ref()
    }

    /// Position units, and the turns of its motor that they make.
    fn turn(&self) -> Option<[u64; 2]> {
        drive::units_per_turn(&self.factor_group?, self.profile())
    }

    /// Whether what is said of it has no errors of its own.
    fn is_known(&self) -> bool {
        self.output != Output::Drive || self.node.is_some() && self.factor_group.is_some()
    }
}

/// Reads one `[[joint]]`.
pub(super) fn joint(section: &mut Section<'_, '_>, around: &Surroundings<'_>, taken: &mut Taken) -> Option<Joint> {
    let drive = Drive::read(section, around, taken)?;
    let (node, mode, axis) = (drive.node, drive.mode, drive.axis.unwrap_or(0));
    let counts_per_unit = scale::counts_per_unit(section, drive.turn(), drive.is_known());
    let velocity_ratio = scale::velocity_ratio(section, drive.factor_group);
    let travel_mm = section.range("travel_mm", SOFT_LIMITS);
    let limits = Limits::read(section);
    let velocity_mm_s = limits.velocity_mm_s;
    let following_error_mm = following_error(section, velocity_mm_s, around.cycle_us);
    let step = match drive.output {
        Output::Step => {
            let port = taken.steps.as_mut();
            steps::output(section, port, around.has_steps, velocity_mm_s, counts_per_unit).map(Some)
        }
        Output::Drive | Output::Analog => {
            section.refuse(&["step"], "is of a joint with output = \"step\"");
            Some(None)
        }
    };
    let analog = match drive.output {
        Output::Analog => analog::output(section, around.nodes, mode).map(Some),
        Output::Drive | Output::Step => {
            section.refuse(&["analog"], "is of a joint with output = \"analog\"");
            Some(None)
        }
    };
    let unhomed_jog_mm_s = unhomed_jog(section, velocity_mm_s);
    let inputs = node.map(|node| node.inputs.as_slice());
    let limits_by_drive = limit_switches(section, axis, inputs);
    let torque_per_mm_s2 = drive::torque_per_mm_s2(section, axis, node);
    let touch_probe = drive::touch_probe(section, axis, node);
    let reactions = drive::reactions(section, axis, node);
    let sto = section.optional_table("sto", |table| sto(table, inputs)).map(|sto| {
        // Left out: where the object of the profile is among the inputs.
        let usual = drive.profile().and_then(|known| known.sto).map(|sto| sto.of_axis(axis));
        let sends = |sto: &Sto| inputs.is_some_and(|inputs| inputs.iter().any(|it| (it.index, it.sub) == sto.object));
        sto.or(usual.filter(sends))
    });
    let squaring_offset_mm = section.number("squaring_offset_mm", Bound::Size(LENGTH_MAX), 0.0);
    let of_joint = Known {
        travel_mm,
        velocity_mm_s,
        stop: limits.stop,
        counts_per_unit,
        turn_mm: (drive.turn().zip(counts_per_unit))
            .map(|([units, turns], counts)| units as f64 / turns as f64 / ratio(counts)),
        is_local: drive.output != Output::Drive,
        drive: drive.profile(),
    };
    let homing = homing::homing(section, &of_joint);
    let counts_per_unit = match drive.output {
        Output::Step => counts_per_unit.and_then(|counts| in_substeps(section, counts)),
        Output::Drive | Output::Analog => counts_per_unit,
    };
    if let (Some(node), Some(mode), Some(homing)) = (node, mode, &homing) {
        let by_drive = matches!(homing.by, HomingBy::Drive { .. });
        drive::modes_are_offered(section, (node, axis), mode, by_drive);
    }
    if let (Some(counts), Some(travel_mm)) = (counts_per_unit, travel_mm) {
        fit_32_bits(section, counts, travel_mm, velocity_mm_s, velocity_ratio);
    }
    let pid = position_loop::keys(section, mode, velocity_mm_s);
    if let (Some(Some((gains, _))), Some(mode)) = (&pid, mode) {
        let goes_on_alone = reactions.as_ref().is_some_and(|it| it.connection_lost == Some(0));
        position_loop::suits(section, mode, goes_on_alone, node, axis);
        let reach = counts_per_unit.zip(velocity_ratio);
        let reach = reach.map(|(counts, units)| ratio(counts) * ratio(units) * gains.output_max);
        if mode == DriveMode::Csv && reach.is_some_and(|reach| reach > f64::from(i32::MAX)) {
            section.wrong("pid", "has an output_max that 60FFh cannot hold");
        }
    }
    let compensation = compensation::keys(section, around.folder);
    let (mut plan, mut stop) = (limits.plan()?, limits.stop?);
    let compensation = match compensation? {
        None => None,
        Some(asked_for) => Some(compensation::share(section, asked_for, &mut plan, &mut stop)?),
    };
    Some(Joint {
        node: drive.place?,
        drive_axis: drive.axis?,
        step: step?,
        analog: analog?,
        mode: mode?,
        counts_per_unit: counts_per_unit?,
        velocity_ratio: velocity_ratio?,
        torque_per_mm_s2: torque_per_mm_s2?,
        reactions: reactions?,
        factor_group: drive.factor_group?,
        pid: pid?.map(|(gains, _)| gains),
        amplifier_lag_s: pid?.and_then(|(_, lag_s)| lag_s),
        travel_mm: travel_mm?,
        limits: plan,
        stop,
        following_error_mm: following_error_mm?,
        homing: homing?,
        compensation,
        unhomed_jog_mm_s: unhomed_jog_mm_s?,
        touch_probe: touch_probe?,
        switches: Switches {
            limits: limits_by_drive?,
            bits: drive.profile().map_or(InputBits::default(), |known| known.input_bits),
        },
        home_count: node.map_or(0, |node| home_count(node, axis)),
        sto: sto?,
        squaring_offset_mm: squaring_offset_mm?,
    })
}

/// `following_error_mm`: what a joint covers in two cycles is lag of the bus, not of the drive.
fn following_error(section: &mut Section<'_, '_>, velocity_mm_s: Option<f64>, cycle_us: Option<u32>) -> Option<f64> {
    let window_mm = section.number("following_error_mm", Bound::Positive(LENGTH_MAX), None);
    if let (Some(window_mm), Some(velocity), Some(cycle_us)) = (window_mm, velocity_mm_s, cycle_us) {
        let least_mm = 2.0 * velocity * f64::from(cycle_us) / 1e6;
        if window_mm <= least_mm {
            let rule = format!("must be above {least_mm}, the way of two cycles at velocity_mm_s");
            section.wrong("following_error_mm", rule);
        }
    }
    window_mm
}

/// The scale of step pulses, in parts of a step.
fn in_substeps(section: &Section<'_, '_>, [steps, units]: [u32; 2]) -> Option<[u32; 2]> {
    let parts = steps.checked_mul(steps::SUBSTEPS);
    if parts.is_none() {
        let most = u32::MAX / steps::SUBSTEPS;
        section.wrong("counts_per_unit", format!("must not be above {most} steps"));
    }
    parts.map(|parts| [parts, units])
}

/// Notes positions and speeds that the numbers of the drive cannot hold.
fn fit_32_bits(
    section: &Section<'_, '_>,
    counts_per_unit: [u32; 2],
    travel_mm: [f64; 2],
    velocity_mm_s: Option<f64>,
    velocity_ratio: Option<[u32; 2]>,
) {
    const MOST: f64 = i32::MAX as f64;
    let counts_per_mm = ratio(counts_per_unit);
    for end in travel_mm.into_iter().filter(|end| (end * counts_per_mm).abs() > MOST) {
        let rule = format!("must fit 32-bit positions of the drive: {end} is too far");
        section.wrong("travel_mm", rule);
    }
    let Some(velocity) = velocity_mm_s else { return };
    if velocity * counts_per_mm > MOST {
        let rule = format!("must fit 32-bit speeds of the drive: {velocity} is too fast");
        section.wrong("velocity_mm_s", rule);
    }
    // Without a ratio of its own the speed has just been judged.
    let Some(units) = velocity_ratio.filter(|units| *units != [1, 1]) else {
        return;
    };
    let makes = velocity * (ratio(units) * counts_per_mm);
    if makes > MOST {
        let rule = format!("must let 60FFh hold velocity_mm_s: {velocity} makes {makes:.0}");
        section.wrong("velocity_ratio", rule);
    }
}

/// What the drive counts at its home point: 0, unless something is written into its home offset (607C).
fn home_count(node: &Node, axis: u8) -> i64 {
    let offset = (object_of(axis, 0x607C), 0);
    let written = node.writes.iter().find(|write| (write.index, write.sub) == offset);
    let offset = written.and_then(|write| <[u8; 4]>::try_from(write.value.as_slice()).ok());
    let offset = offset.map_or(0, i32::from_le_bytes);
    match &node.drive {
        Some(drive) => drive.home_count(offset),
        None => -i64::from(offset),
    }
}

/// How fast it may be jogged before it is homed; left out: a tenth of its velocity.
fn unhomed_jog(section: &mut Section<'_, '_>, velocity_mm_s: Option<f64>) -> Option<f64> {
    const SHARE: f64 = 0.1;
    let Some(speed) = section.optional_number("unhomed_jog_mm_s", Bound::Positive(VELOCITY_MAX))? else {
        return velocity_mm_s.map(|velocity| SHARE * velocity);
    };
    if let Some(velocity) = velocity_mm_s.filter(|velocity| speed > *velocity) {
        let rule = format!("must not be above velocity_mm_s, {velocity}");
        section.wrong("unhomed_jog_mm_s", rule);
    }
    Some(speed)
}

/// Who tells of the limit switches: the drive only where it sends 60FDh. `inputs`: what it sends, `None` where that is not known.
fn limit_switches(section: &mut Section<'_, '_>, axis: u8, inputs: Option<&[Mapped]>) -> Option<bool> {
    let by_drive = section.word("limit_switches", &[("pin", false), ("drive", true)], false)?;
    let wanted = object_of(axis, 0x60FD);
    if by_drive && inputs.is_some_and(|inputs| inputs.iter().all(|object| object.index != wanted)) {
        let rule = format!("\"0x{wanted:04X}/32\" must be among the inputs of its node");
        section.wrong("limit_switches", rule);
    }
    Some(by_drive)
}

/// Notes an axis of a node that a joint above has.
fn not_taken(section: &mut Section<'_, '_>, axis: u8, taken: &mut Vec<(i64, u8)>) {
    let id = section
        .optional("node")
        .and_then(|item| item.value.get_ref().as_integer());
    let Some(id) = id.and_then(|id| i64::from_str_radix(id.as_str(), id.radix()).ok()) else {
        return;
    };
    if taken.contains(&(id, axis)) {
        let key = if section.has("drive_axis") {
            "drive_axis"
        } else {
            "node"
        };
        let rule = "is the drive of a joint above; of a node with several axes drive_axis says which";
        section.wrong(key, rule);
    }
    taken.push((id, axis));
}

/// The place of the node of a drive.
fn node(section: &mut Section<'_, '_>, around: &Surroundings<'_>) -> Option<usize> {
    let id = section.integer("node", 1..=239, None)?;
    let nodes = around.nodes?;
    let drives = || {
        nodes
            .iter()
            .filter(|node| node.profile == Profile::Cia402)
            .map(|node| node.id.to_string())
    };
    match nodes.iter().position(|node| i64::from(node.id) == id) {
        None => {
            let list = drives().collect::<Vec<_>>().join(", ");
            section.refused("node", format!("no [[bus.node]] has this id; drives: {list}"))
        }
        Some(index) if nodes[index].profile == Profile::Cia402 => Some(index),
        Some(_) => section.refused("node", "must be a node of profile \"cia402\""),
    }
}
