//! `[sim]`: what the simulated machine is made of.

use super::document::{Bound, Section};
use super::joints::{letter, range};
use super::mapping::parse_object;
use super::types::{HomingBy, Joint, Mapped, Node, NodeIndex, Profile};
use cia402::profile::AXES_MAX;
use motion::canon::Axis;

/// `[sim]`: the simulated motor and load, the same for every drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Sim {
    /// Natural frequency of the second-order motor and load under position control, Hz.
    pub natural_frequency_hz: f64,
    /// Its damping ratio.
    pub damping: f64,
    /// Position at power-on as a share of the travel, 0 to 1.
    pub start: f64,
    /// A touch probe in the spindle; `None`: there is none.
    pub probe: Option<SimProbe>,
    /// What is special about a joint.
    pub joints: Vec<SimJoint>,
    /// What goes wrong.
    pub faults: Vec<SimFault>,
    /// What there is at objects of I/O nodes.
    pub signals: Vec<SimSignal>,
}

/// `[[sim.signal]]`: what a simulated I/O node measures or counts at one of its objects, over the time t since it was switched on:
/// `value + per_second t + amplitude sin(2 pi t / period_s)`, and the output `from` in addition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimSignal {
    /// Index into [`Bus::nodes`](super::Bus::nodes) of an I/O node.
    pub node: usize,
    /// One of its inputs: index and sub-index.
    pub object: (u16, u8),
    pub value: f64,
    pub per_second: f64,
    pub amplitude: f64,
    pub period_s: f64,
    /// An output that is wired to this input.
    pub from: Option<(u16, u8)>,
    /// The input that holds the multiple of this many counts which was passed last, as an encoder latches its index.
    pub latch: Option<((u16, u8), u32)>,
}

/// `[[sim.joint]]`: where a simulated joint stands and where its home switch is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimJoint {
    /// Index into [`Config::joints`](super::Config::joints).
    pub joint: usize,
    /// Where it stands at power-on, mm; `None`: as [`Sim::start`] has it.
    pub start_mm: Option<f64>,
    /// Where the home switch of a joint that homes by the control closes, mm; `None`: where the machine file believes it to be.
    pub switch_mm: Option<f64>,
    /// The input that it closes, beside bit 2 of 60FDh of its drive: index of an I/O node and number of the input, 8 to 15.
    pub input: Option<(usize, u8)>,
}

impl Sim {
    /// Whether something is wrong with the drive of a node from the start.
    pub fn is_faulty(&self, node: NodeIndex, axis: u8, kind: SimFaultKind) -> bool {
        let mut faults = self.faults.iter();
        faults.any(|fault| (fault.node, fault.drive_axis, fault.kind) == (node, axis, kind))
    }

    /// What is special about a joint, if something is.
    pub fn joint(&self, joint: usize) -> Option<&SimJoint> {
        self.joints.iter().find(|special| special.joint == joint)
    }
}

/// `[sim.probe]`: a touch probe that is in contact where the ball at its tip touches a body.
#[derive(Clone, Debug, PartialEq)]
pub struct SimProbe {
    /// Index into [`Bus::nodes`](super::Bus::nodes) of the I/O node that it is wired to.
    pub node: usize,
    /// Number of the input, as in `io.10.in-08`; 8 to 15.
    pub input: u8,
    /// Diameter of the ball, mm; 0: a point.
    pub diameter_mm: f64,
    /// How far the lowest point of the ball is below the place of the axes, mm.
    pub length_mm: f64,
    /// What it may touch.
    pub surfaces: Vec<SimSurface>,
    /// What else it may touch.
    pub bodies: Vec<SimBody>,
}

/// `[[sim.probe.surface]]`: a plane with a body behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimSurface {
    /// Axis that meets it squarely.
    pub axis: Axis,
    /// Where, machine coordinates, mm.
    pub at_mm: f64,
    /// Whether the body is above, else below.
    pub above: bool,
}

/// `[[sim.probe.box]]`, `[[sim.probe.cylinder]]`: an upright body on the table, or a hole of that shape in a plate without end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimBody {
    pub outline: SimOutline,
    /// Middle of the outline in X and Y, machine coordinates, mm.
    pub middle_mm: [f64; 2],
    /// Lower and upper end of the body, or of the plate, mm.
    pub z_mm: [f64; 2],
    /// Whether the body is around the outline, else inside.
    pub hole: bool,
}

/// What a body is seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SimOutline {
    /// Half of its width and half of its length, mm, turned about its middle by an angle against the X axis.
    Rectangle {
        half_mm: [f64; 2],
        angle_degrees: f64,
    },
    Circle {
        radius_mm: f64,
    },
}

/// `[[sim.fault]]`: something that goes wrong with a simulated drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimFault {
    /// Index into [`Bus::nodes`](super::Bus::nodes).
    pub node: usize,
    /// Axis of the drive at its node; default 0.
    pub drive_axis: u8,
    pub kind: SimFaultKind,
    /// So long after its operation was first enabled, s; default 1. Without meaning for kinds that are so from the start.
    pub after_s: f64,
}

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimFaultKind {
    /// Fault 2310h of the drive.
    Overcurrent,
    /// What it moves is jammed.
    FollowingError,
    /// Its lower limit switch closes (bit 0 of 60FD).
    LimitSwitch,
    /// Its zero mark is not there, from the start.
    IndexMissing,
    /// It takes longer to enable its operation than anybody waits, from the start.
    SlowEnable,
    /// Its supply is gone.
    PowerOff,
    /// Its safety circuit is open.
    Sto,
}

impl SimFaultKind {
    /// All of them, with their words.
    pub const WORDS: [(&'static str, SimFaultKind); 7] = [
        ("overcurrent", SimFaultKind::Overcurrent),
        ("following-error", SimFaultKind::FollowingError),
        ("limit-switch", SimFaultKind::LimitSwitch),
        ("index-missing", SimFaultKind::IndexMissing),
        ("slow-enable", SimFaultKind::SlowEnable),
        ("power-off", SimFaultKind::PowerOff),
        ("sto", SimFaultKind::Sto),
    ];
}

/// No machine is larger, mm.
const LENGTH_MAX: f64 = 1e6;
/// Greatest ball at the tip of a probe, mm.
const BALL_MAX: f64 = 100.0;
/// Inputs of a simulated I/O node that something can be wired to; those below are the contacts of its own contactors.
const WIRED: std::ops::RangeInclusive<i64> = 8..=15;

/// Reads `[sim]`; `nodes`, `joints`: `None` where they have errors of their own.
pub(super) fn sim(mut section: Section<'_, '_>, nodes: Option<&[Node]>, joints: Option<&[Joint]>) -> Option<Sim> {
    // Beyond, the motor model of the simulated drives would need finer steps than the bus cycle gives.
    let natural_frequency_hz = section.number("natural_frequency_hz", Bound::Within(0.1, 1000.0), 60.0);
    let damping = section.number("damping", Bound::Within(0.01, 10.0), 0.8);
    let start = section.number("start", Bound::Within(0.0, 1.0), 0.4);
    let probe = section.optional_section("probe").map(|section| probe(section, nodes));
    let mut special: Vec<SimJoint> = Vec::new();
    let mut complete = true;
    for table in section.sections("joint") {
        match joint(table, nodes, joints, &special) {
            Some(one) => special.push(one),
            None => complete = false,
        }
    }
    let signals: Vec<Option<SimSignal>> = section
        .sections("signal")
        .into_iter()
        .map(|section| signal(section, nodes))
        .collect();
    let faults: Vec<Option<SimFault>> = section
        .sections("fault")
        .into_iter()
        .map(|table| fault(table, nodes))
        .collect();
    section.done();
    Some(Sim {
        faults: faults.into_iter().collect::<Option<Vec<SimFault>>>()?,
        joints: complete.then_some(special)?,
        signals: signals.into_iter().collect::<Option<Vec<SimSignal>>>()?,
        natural_frequency_hz: natural_frequency_hz?,
        damping: damping?,
        start: start?,
        probe: match probe {
            None => None,
            Some(probe) => Some(probe?),
        },
    })
}

fn joint(
    mut section: Section<'_, '_>,
    nodes: Option<&[Node]>,
    joints: Option<&[Joint]>,
    before: &[SimJoint],
) -> Option<SimJoint> {
    let number = section.integer("joint", 0..=i64::from(u16::MAX), None);
    let length = |section: &mut Section<'_, '_>, key| match section.optional(key) {
        None => Some(None),
        Some(item) => item.number(&section.key(key), Bound::Size(LENGTH_MAX)).map(Some),
    };
    let start_mm = length(&mut section, "start_mm");
    let switch_mm = length(&mut section, "switch_mm");
    let wired = section.has("node") || section.has("input");
    let input = if wired {
        wire(&mut section, nodes).map(Some)
    } else {
        Some(None)
    };
    let joint = number? as usize;
    let Some(of) = joints?.get(joint) else {
        let count = joints?.len();
        section.wrong(
            "joint",
            format!("there is no such joint; joints: {count}, counted from 0"),
        );
        return None;
    };
    if before.iter().any(|other| other.joint == joint) {
        section.wrong("joint", "stands in a table above");
    }
    if let Some(Some(start_mm)) = start_mm
        && !(of.travel_mm[0]..=of.travel_mm[1]).contains(&start_mm)
    {
        let [low, high] = of.travel_mm;
        section.wrong(
            "start_mm",
            format!("must lie in travel_mm of the joint, {low} to {high}"),
        );
    }
    if let HomingBy::Drive { .. } = of.homing.by {
        for key in ["switch_mm", "node", "input"] {
            if section.has(key) {
                section.wrong(key, "is for a joint that homes by the control");
            }
        }
    }
    section.known(&["node", "input"]);
    section.done();
    Some(SimJoint {
        joint,
        start_mm: start_mm?,
        switch_mm: switch_mm?,
        input: input?,
    })
}

fn fault(mut section: Section<'_, '_>, nodes: Option<&[Node]>) -> Option<SimFault> {
    /// An hour.
    const AFTER_MAX_S: f64 = 3600.0;
    let id = section.integer("node", 1..=239, None);
    let drive_axis = section.integer("drive_axis", 0..=i64::from(AXES_MAX) - 1, 0);
    let kind = section.word("kind", &SimFaultKind::WORDS, None);
    let after_s = section.number("after_s", Bound::Within(0.0, AFTER_MAX_S), 1.0);
    if let Some(SimFaultKind::IndexMissing | SimFaultKind::SlowEnable) = kind
        && section.has("after_s")
    {
        section.wrong("after_s", "must be left out: this kind is so from the start");
    }
    let place = |id: i64| {
        let is_drive = |node: &Node| i64::from(node.id) == id && node.profile == Profile::Cia402;
        nodes.map(|nodes| nodes.iter().position(is_drive))
    };
    let node = id.and_then(place);
    if node == Some(None) {
        section.wrong("node", "must be a [[bus.node]] of profile \"cia402\"");
    }
    section.done();
    Some(SimFault {
        node: node??,
        drive_axis: drive_axis? as u8,
        kind: kind?,
        after_s: after_s?,
    })
}

fn probe(mut section: Section<'_, '_>, nodes: Option<&[Node]>) -> Option<SimProbe> {
    let wire = wire(&mut section, nodes);
    let diameter_mm = section.number("diameter_mm", Bound::Within(0.0, BALL_MAX), 0.0);
    let length_mm = section.number("length_mm", Bound::Within(0.0, LENGTH_MAX), 0.0);
    let surfaces: Vec<Option<SimSurface>> = section.sections("surface").into_iter().map(surface).collect();
    let boxes = section.sections("box").into_iter().map(rectangle);
    let mut bodies: Vec<Option<SimBody>> = boxes.collect();
    bodies.extend(section.sections("cylinder").into_iter().map(cylinder));
    section.done();
    let (node, input) = wire?;
    Some(SimProbe {
        node,
        input,
        diameter_mm: diameter_mm?,
        length_mm: length_mm?,
        surfaces: surfaces.into_iter().collect::<Option<Vec<SimSurface>>>()?,
        bodies: bodies.into_iter().collect::<Option<Vec<SimBody>>>()?,
    })
}

/// `[[sim.probe.box]]`.
fn rectangle(mut section: Section<'_, '_>) -> Option<SimBody> {
    let x_mm = range(&mut section, "x_mm", "its ends, like [10.0, 50.0]");
    let y_mm = range(&mut section, "y_mm", "its ends, like [10.0, 50.0]");
    let z_mm = range(&mut section, "z_mm", "its ends, like [-100.0, -80.0]");
    let angle_degrees = section.number("angle_degrees", Bound::Size(360.0), 0.0);
    let hole = section.flag("hole", false);
    section.done();
    let (x_mm, y_mm) = (x_mm?, y_mm?);
    let half_mm = [x_mm, y_mm].map(|[low, high]| (high - low) / 2.0);
    Some(SimBody {
        outline: SimOutline::Rectangle {
            half_mm,
            angle_degrees: angle_degrees?,
        },
        middle_mm: [x_mm, y_mm].map(|[low, high]| (low + high) / 2.0),
        z_mm: z_mm?,
        hole: hole?,
    })
}

/// `[[sim.probe.cylinder]]`.
fn cylinder(mut section: Section<'_, '_>) -> Option<SimBody> {
    let x_mm = section.number("x_mm", Bound::Size(LENGTH_MAX), None);
    let y_mm = section.number("y_mm", Bound::Size(LENGTH_MAX), None);
    let diameter_mm = section.number("diameter_mm", Bound::Positive(LENGTH_MAX), None);
    let z_mm = range(&mut section, "z_mm", "its ends, like [-100.0, -80.0]");
    let hole = section.flag("hole", false);
    section.done();
    Some(SimBody {
        outline: SimOutline::Circle {
            radius_mm: diameter_mm? / 2.0,
        },
        middle_mm: [x_mm?, y_mm?],
        z_mm: z_mm?,
        hole: hole?,
    })
}

/// Keys `node` and `input`: the node as an index, and the number of the input as in the name of its pin.
fn wire(section: &mut Section<'_, '_>, nodes: Option<&[Node]>) -> Option<(usize, u8)> {
    let id = section.integer("node", 1..=239, None);
    let input = section.integer("input", WIRED, None);
    let index = nodes?.iter().position(|node| Some(i64::from(node.id)) == id);
    if id.is_some() && index.is_none_or(|index| nodes.is_some_and(|nodes| nodes[index].profile != Profile::Io)) {
        section.wrong("node", "must be a [[bus.node]] of profile \"io\"");
        return None;
    }
    Some((index?, input? as u8))
}

fn surface(mut section: Section<'_, '_>) -> Option<SimSurface> {
    let axis: Option<Axis> = letter(&mut section, "axis");
    let limit = |section: &mut Section<'_, '_>, key| {
        let item = section.optional(key)?;
        item.number(&section.key(key), Bound::Size(LENGTH_MAX))
    };
    let above_mm = limit(&mut section, "above_mm");
    let below_mm = limit(&mut section, "below_mm");
    if section.has("above_mm") == section.has("below_mm") {
        section.wrong(
            "axis",
            "must have either above_mm or below_mm beside it: where the body is",
        );
    }
    section.done();
    let (at_mm, above) = match (above_mm, below_mm) {
        (Some(at_mm), None) => (at_mm, true),
        (None, Some(at_mm)) => (at_mm, false),
        (None, None) | (Some(_), Some(_)) => return None,
    };
    Some(SimSurface {
        axis: axis?,
        at_mm,
        above,
    })
}

/// `[[sim.signal]]`.
fn signal(mut section: Section<'_, '_>, nodes: Option<&[Node]>) -> Option<SimSignal> {
    /// Beyond all objects of 32 bits.
    const VALUE_MAX: f64 = 1e10;
    let id = section.integer("node", 1..=239, None);
    let index = nodes.and_then(|nodes| nodes.iter().position(|node| Some(i64::from(node.id)) == id));
    let node = index.and_then(|index| nodes?.get(index));
    let node = node.filter(|node| node.profile == Profile::Io);
    if id.is_some() && nodes.is_some() && node.is_none() {
        section.wrong("node", "must be a [[bus.node]] of profile \"io\"");
    }
    let object = payload_object(&mut section, "object", true, node.map(|node| (&*node.inputs, "inputs")));
    let value = section.number("value", Bound::Size(VALUE_MAX), 0.0);
    let per_second = section.number("per_second", Bound::Size(VALUE_MAX), 0.0);
    let amplitude = section.number("amplitude", Bound::Size(VALUE_MAX), 0.0);
    let period_s = section.number("period_s", Bound::Within(1e-3, 1e6), 1.0);
    let from = payload_object(
        &mut section,
        "from",
        false,
        node.map(|node| (&*node.outputs, "outputs")),
    );
    let latch = payload_object(&mut section, "latch", false, node.map(|node| (&*node.inputs, "inputs")));
    let every = section.integer("latch_every", 1..=1_000_000_000, 1000);
    section.done();
    let every = every? as u32;
    Some(SimSignal {
        node: index?,
        object: object??,
        value: value?,
        per_second: per_second?,
        amplitude: amplitude?,
        period_s: period_s?,
        from: from?,
        latch: latch?.map(|latch| (latch, every)),
    })
}

/// An object of a payload of the node; `Some(None)`: left out.
fn payload_object(
    section: &mut Section<'_, '_>,
    key: &'static str,
    required: bool,
    payload: Option<(&[Mapped], &str)>,
) -> Option<Option<(u16, u8)>> {
    let item = match required {
        true => Some(section.required(key, "an object of the node, like \"0x6401:1\"")?),
        false => section.optional(key),
    };
    let Some(item) = item else { return Some(None) };
    let text = item.text(&section.key(key))?;
    let Some(object) = parse_object(text) else {
        section.wrong(key, "must be an object like \"0x6401:1\"");
        return None;
    };
    let (objects, name) = payload?;
    if !objects.iter().any(|mapped| (mapped.index, mapped.sub) == object) {
        section.wrong(key, format!("must stand among the `{name}` of the node"));
        return None;
    }
    Some(Some(object))
}
