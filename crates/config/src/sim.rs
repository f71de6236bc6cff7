//! `[sim]`: what the simulated machine is made of.

use super::bus_types::{Mapped, Node, NodeIndex, Profile};
use super::homing::HomingBy;
use super::joints::Joint;
use super::question::Bound;
use super::section::{Section, keys};
use super::values::LENGTH_MAX;
use cia402::profile::AXES_MAX;
use motion::canon::Axis;

/// Greatest ball at the tip of a probe, mm.
const BALL_MAX: f64 = 100.0;
/// Inputs of a simulated I/O node that something can be wired to; those below are the contacts of its own contactors.
const WIRED: std::ops::RangeInclusive<u8> = 8..=15;

keys! {
    /// `[sim]`: the simulated motor and load, the same for every drive. `nodes`, `of_file`: nodes and joints, `None` where they have errors
    /// of their own.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Sim(section, nodes: Option<&[Node]>, of_file: Option<&[Joint]>) {
        /// Natural frequency of the second-order motor and load under position control, Hz. Beyond the limit, the motor model of the
        /// simulated drives would need finer steps than the bus cycle gives.
        pub natural_frequency_hz: f64 = section.number("natural_frequency_hz", Bound::Within(0.1, 1000.0), 60.0),
        /// Its damping ratio.
        pub damping: f64 = section.number("damping", Bound::Within(0.01, 10.0), 0.8),
        /// Position at power-on as a share of the travel, 0 to 1.
        pub start: f64 = section.number("start", Bound::Within(0.0, 1.0), 0.4),
        /// A touch probe in the spindle; `None`: there is none.
        pub probe: Option<SimProbe> = section.optional_table("probe", |table| SimProbe::read(table, nodes)),
        /// What is special about a joint.
        pub joints: Vec<SimJoint> = section.tables("joint", |table, above| joint(table, nodes, of_file, above)),
        /// What there is at objects of I/O nodes.
        pub signals: Vec<SimSignal> = section.tables("signal", |table, _| {
            let of = node_of(table, nodes, Profile::Io);
            SimSignal::read(table, of)
        }),
        /// What goes wrong.
        pub faults: Vec<SimFault> = section.tables("fault", |table, _| SimFault::read(table, nodes)),
    }
}

/// Beyond all objects of 32 bits.
const VALUE_MAX: f64 = 1e10;

keys! {
    /// `[[sim.signal]]`: what a simulated I/O node measures or counts at one of its objects, over the time t since it was switched on:
    /// `value + per_second t + amplitude sin(2 pi t / period_s)`, and the output `from` in addition. `of`: the node and its place.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SimSignal(section, of: Option<(usize, &Node)>) {
        /// Index into [`Bus::nodes`](super::Bus::nodes) of an I/O node.
        pub node: usize = of.map(|(node, _)| node),
        /// One of its inputs: index and sub-index.
        pub object: (u16, u8) =
            payload_object(section, "object", true, of.map(|(_, node)| (&*node.inputs, "inputs"))).flatten(),
        pub value: f64 = section.number("value", Bound::Size(VALUE_MAX), 0.0),
        pub per_second: f64 = section.number("per_second", Bound::Size(VALUE_MAX), 0.0),
        pub amplitude: f64 = section.number("amplitude", Bound::Size(VALUE_MAX), 0.0),
        pub period_s: f64 = section.number("period_s", Bound::Within(1e-3, 1e6), 1.0),
        /// An output that is wired to this input.
        pub from: Option<(u16, u8)> =
            payload_object(section, "from", false, of.map(|(_, node)| (&*node.outputs, "outputs"))),
        /// The input that holds the multiple of this many counts which was passed last, as an encoder latches its index.
        pub latch: Option<((u16, u8), u32)> = {
            let latch = payload_object(section, "latch", false, of.map(|(_, node)| (&*node.inputs, "inputs")));
            let every = section.integer("latch_every", 1..=1_000_000_000, 1000);
            latch.zip(every).map(|(latch, every)| latch.map(|latch| (latch, every)))
        },
    }
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

keys! {
    /// `[sim.probe]`: a touch probe that is in contact where the ball at its tip touches a body.
    #[derive(Clone, Debug, PartialEq)]
    pub struct SimProbe(section, nodes: Option<&[Node]>) {
        /// Index into [`Bus::nodes`](super::Bus::nodes) of the I/O node that it is wired to.
        pub node: usize = node_of(section, nodes, Profile::Io).map(|(node, _)| node),
        /// Number of the input, as in `io.10.in-08`; 8 to 15.
        pub input: u8 = section.integer("input", WIRED, None),
        /// Diameter of the ball, mm; 0: a point.
        pub diameter_mm: f64 = section.number("diameter_mm", Bound::Within(0.0, BALL_MAX), 0.0),
        /// How far the lowest point of the ball is below the place of the axes, mm.
        pub length_mm: f64 = section.number("length_mm", Bound::Within(0.0, LENGTH_MAX), 0.0),
        /// What it may touch.
        pub surfaces: Vec<SimSurface> = section.tables("surface", |table, _| surface(table)),
        /// What else it may touch.
        pub bodies: Vec<SimBody> = {
            let boxes = section.tables("box", |table, _| rectangle(table));
            let cylinders = section.tables("cylinder", |table, _| cylinder(table));
            boxes.zip(cylinders).map(|(boxes, cylinders)| [boxes, cylinders].concat())
        },
    }
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

keys! {
    /// `[[sim.fault]]`: something that goes wrong with a simulated drive.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SimFault(section, nodes: Option<&[Node]>) {
        /// Index into [`Bus::nodes`](super::Bus::nodes).
        pub node: usize = node_of(section, nodes, Profile::Cia402).map(|(node, _)| node),
        /// Axis of the drive at its node; default 0.
        pub drive_axis: u8 = section.integer("drive_axis", 0..=AXES_MAX - 1, 0),
        pub kind: SimFaultKind = section.word("kind", &SimFaultKind::WORDS, None),
        /// So long after its operation was first enabled, s; default 1, at most an hour. Without meaning for kinds that are so from the start.
        pub after_s: f64 = section.number("after_s", Bound::Within(0.0, 3600.0), 1.0),
    }
    rules {
        if let Some(SimFaultKind::IndexMissing | SimFaultKind::SlowEnable) = kind
            && section.has("after_s")
        {
            section.wrong("after_s", "must be left out: this kind is so from the start");
        }
    }
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

/// `[[sim.joint]]`; `before`: those above it.
fn joint(
    section: &mut Section<'_, '_>,
    nodes: Option<&[Node]>,
    joints: Option<&[Joint]>,
    before: &[SimJoint],
) -> Option<SimJoint> {
    let number = section.integer("joint", 0..=usize::from(u16::MAX), None);
    let start_mm = section.optional_number("start_mm", Bound::Size(LENGTH_MAX));
    let switch_mm = section.optional_number("switch_mm", Bound::Size(LENGTH_MAX));
    let input = match section.has("node") || section.has("input") {
        true => {
            let node = node_of(section, nodes, Profile::Io);
            let input = section.integer("input", WIRED, None);
            node.zip(input).map(|((node, _), input)| Some((node, input)))
        }
        false => Some(None),
    };
    let joint = number?;
    let Some(of) = joints?.get(joint) else {
        let count = joints?.len();
        let rule = format!("there is no such joint; joints: {count}, counted from 0");
        return section.refused("joint", rule);
    };
    if before.iter().any(|other| other.joint == joint) {
        section.wrong("joint", "stands in a table above");
    }
    if let Some(Some(start_mm)) = start_mm
        && !(of.travel_mm[0]..=of.travel_mm[1]).contains(&start_mm)
    {
        let [low, high] = of.travel_mm;
        let rule = format!("must lie in travel_mm of the joint, {low} to {high}");
        section.wrong("start_mm", rule);
    }
    if let HomingBy::Drive { .. } = of.homing.by {
        section.refuse(
            &["switch_mm", "node", "input"],
            "is for a joint that homes by the control",
        );
    }
    section.known(&["node", "input"]);
    Some(SimJoint {
        joint,
        start_mm: start_mm?,
        switch_mm: switch_mm?,
        input: input?,
    })
}

/// `[[sim.probe.box]]`.
fn rectangle(section: &mut Section<'_, '_>) -> Option<SimBody> {
    let x_mm = section.range("x_mm", "its ends, like [10.0, 50.0]");
    let y_mm = section.range("y_mm", "its ends, like [10.0, 50.0]");
    let z_mm = section.range("z_mm", "its ends, like [-100.0, -80.0]");
    let angle_degrees = section.number("angle_degrees", Bound::Size(360.0), 0.0);
    let hole = section.flag("hole", false);
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
fn cylinder(section: &mut Section<'_, '_>) -> Option<SimBody> {
    let x_mm = section.number("x_mm", Bound::Size(LENGTH_MAX), None);
    let y_mm = section.number("y_mm", Bound::Size(LENGTH_MAX), None);
    let diameter_mm = section.number("diameter_mm", Bound::Positive(LENGTH_MAX), None);
    let z_mm = section.range("z_mm", "its ends, like [-100.0, -80.0]");
    let hole = section.flag("hole", false);
    Some(SimBody {
        outline: SimOutline::Circle {
            radius_mm: diameter_mm? / 2.0,
        },
        middle_mm: [x_mm?, y_mm?],
        z_mm: z_mm?,
        hole: hole?,
    })
}

/// The node of a profile that the key `node` names by its id: its place among all, and itself.
fn node_of<'n>(
    section: &mut Section<'_, '_>,
    nodes: Option<&'n [Node]>,
    profile: Profile,
) -> Option<(usize, &'n Node)> {
    let id = section.integer("node", 1..=239, None)?;
    let mut all = nodes?.iter().enumerate();
    let found = all.find(|(_, node)| node.id == id && node.profile == profile);
    if found.is_none() {
        let word = if profile == Profile::Io { "io" } else { "cia402" };
        section.wrong("node", format!("must be a [[bus.node]] of profile {word:?}"));
    }
    found
}

fn surface(section: &mut Section<'_, '_>) -> Option<SimSurface> {
    let axis = section.axis("axis");
    let mut limit = |key| section.optional_number(key, Bound::Size(LENGTH_MAX)).flatten();
    let (above_mm, below_mm) = (limit("above_mm"), limit("below_mm"));
    if section.has("above_mm") == section.has("below_mm") {
        let rule = "must have either above_mm or below_mm beside it: where the body is";
        section.wrong("axis", rule);
    }
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

/// An object of a payload of the node; `Some(None)`: left out.
fn payload_object(
    section: &mut Section<'_, '_>,
    key: &'static str,
    required: bool,
    payload: Option<(&[Mapped], &str)>,
) -> Option<Option<(u16, u8)>> {
    let Some(object) = section.object(key, required, "0x6401:1")? else {
        return Some(None);
    };
    let (objects, name) = payload?;
    if !objects.iter().any(|mapped| (mapped.index, mapped.sub) == object) {
        return section.refused(key, format!("must stand among the `{name}` of the node"));
    }
    Some(Some(object))
}
