//! `[spindle]`: how fast it may turn, how its speed is set, and how the control sees where it is.
//!
//! In:  the section, the nodes of the bus.
//! Out: a [`Spindle`] whose objects stand in the payloads of their nodes.

use super::document::{Bound, Section};
use super::drive::{self, DriveMode, Reactions, SPINDLE_MODES, modes_are_offered};
use super::factor_group::{self, FactorGroup};
use super::joints::{ratio, ratio_of_integers};
use super::mapping::parse_object;
use super::types::{DriveProfile, Exchange, Joint, Mapped, Node, Profile};
use motion::canon::SPINDLES;

/// `[spindle]`
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spindle {
    /// Highest speed, 1/min.
    pub rpm_max: f64,
    /// Spindles that programs may name by `$`; default 1.
    pub count: u8,
    /// Added to the angles of M19, degrees; default 0.
    pub orient_offset_degrees: f64,
    /// Whether feed moves behind a start or a change of speed wait until the speed is reached; default true.
    pub wait_for_speed: bool,
    /// Distance from the programmed speed, as a share of it, at which it counts as reached; default 0.05.
    pub speed_tolerance: f64,
    /// How long the speed may take to be reached, s; default 20.
    pub speed_timeout_s: f64,
    /// The object that sets its speed; `None`: components do, from the pins.
    pub drive: Option<SpindleDrive>,
    /// The drive of CiA 402 that turns it, in place of that object; `None`: none does.
    pub axis: Option<SpindleAxis>,
    /// What tells where the spindle is; `None`: nothing does.
    pub encoder: Option<SpindleEncoder>,
    /// Cycles from the place of the spindle as it is read to where the axes are with the set-points that come of it: what the exchange
    /// takes, and the lag of the drives. Default 3.5 for a counter of a node, 2.5 for pins.
    pub encoder_lead_cycles: f64,
}

/// `[spindle.drive]`: an output of a node that takes the speed, signed; its greatest value stands for the highest speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpindleDrive {
    /// Index into `Bus::nodes`.
    pub node: usize,
    /// The object; it stands among the node's outputs.
    pub speed: Mapped,
}

/// `[spindle.drive]` with a mode: a drive of CiA 402.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpindleAxis {
    /// Index into `Bus::nodes`.
    pub node: usize,
    /// Axis of the drive at its node, from 0; default 0.
    pub drive_axis: u8,
    /// VL, PV or CSV.
    pub mode: DriveMode,
    /// Target of the mode (6042, 60FF) per 1/min: numerator and denominator.
    pub units_per_rpm: [u32; 2],
    /// How fast its target may change, 1/min per second; `None`: it has a ramp of its own.
    pub ramp_rpm_s: Option<f64>,
    /// How it stops.
    pub reactions: Reactions,
    /// In which units it counts.
    pub factor_group: FactorGroup,
}

/// `[spindle.encoder]`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpindleEncoder {
    /// Components write `spindle.0.revs` and `spindle.0.indexed`.
    Pins,
    /// A counter of a node.
    Counter(SpindleCounter),
}

/// A counter of a node that follows the encoder, and wraps with its length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpindleCounter {
    /// Index into `Bus::nodes`; exchanged in every cycle.
    pub node: usize,
    /// The counter; it stands among the node's inputs.
    pub counter: Mapped,
    /// Counts of one turn; below 0 where it counts down with M3.
    pub counts_per_turn: i32,
    /// The object that holds the count at which the index was passed last; `None`: multiples of `counts_per_turn` are at the
    /// index, and the length of the counter holds whole turns.
    pub index: Option<Mapped>,
}

impl Default for Spindle {
    fn default() -> Spindle {
        Spindle {
            rpm_max: 24_000.0,
            count: 1,
            orient_offset_degrees: 0.0,
            wait_for_speed: true,
            speed_tolerance: 0.05,
            speed_timeout_s: 20.0,
            drive: None,
            axis: None,
            encoder: None,
            encoder_lead_cycles: LEAD_CYCLES,
        }
    }
}

/// From the cycle in which a place is known to where the axes are with the set-points that come of it, cycles: those computed in
/// it leave in the next one and are reached at the end of the following one; half a cycle is for the lag of the drives.
const LEAD_CYCLES: f64 = 2.5;
/// What a node tells was so when the cycle before ended.
const LATCHED_CYCLES: f64 = 1.0;

/// Where the spindle's encoder is read.
#[derive(Clone, Copy, PartialEq)]
enum Source {
    Pins,
    Node,
}

/// `[spindle]`; `nodes`: `None` if the bus is wrong itself.
pub(super) fn spindle(mut section: Section<'_, '_>, nodes: Option<&[Node]>, joints: &[Joint]) -> Option<Spindle> {
    let default = Spindle::default();
    let rpm_max = section.number("rpm_max", Bound::Positive(1e6), default.rpm_max);
    let count = section.integer("count", 1..=SPINDLES as i64, i64::from(default.count));
    let orient_offset_degrees = section.number(
        "orient_offset_degrees",
        Bound::Size(360.0),
        default.orient_offset_degrees,
    );
    let wait_for_speed = section.flag("wait_for_speed", default.wait_for_speed);
    let percent = section.number(
        "speed_tolerance_percent",
        Bound::Within(0.1, 50.0),
        default.speed_tolerance * 100.0,
    );
    let speed_timeout_s = section.number("speed_timeout_s", Bound::Within(0.1, 600.0), default.speed_timeout_s);
    let (drive, axis) = match section.has("drive") {
        false => (Some(None), Some(None)),
        true => match section.section("drive") {
            None => (None, None),
            Some(section) if section.has("mode") => (Some(None), axis(section, nodes, joints, rpm_max).map(Some)),
            Some(section) => (drive(section, nodes).map(Some), Some(None)),
        },
    };
    let encoder = match section.has("encoder") {
        false => Some(None),
        true => section
            .section("encoder")
            .and_then(|section| encoder(section, nodes))
            .map(Some),
    };
    section.done();
    Some(Spindle {
        rpm_max: rpm_max?,
        count: count? as u8,
        orient_offset_degrees: orient_offset_degrees?,
        wait_for_speed: wait_for_speed?,
        speed_tolerance: percent? / 100.0,
        speed_timeout_s: speed_timeout_s?,
        drive: drive?,
        axis: axis?,
        encoder: encoder.map(|encoder| encoder.map(|(encoder, _)| encoder))?,
        encoder_lead_cycles: encoder?.map_or(default.encoder_lead_cycles, |(_, lead)| lead),
    })
}

fn drive(mut section: Section<'_, '_>, nodes: Option<&[Node]>) -> Option<SpindleDrive> {
    let node = node(&mut section, nodes, |node| node.exchange != Exchange::AsyncOnly);
    let speed = object(
        &mut section,
        "speed",
        true,
        node.map(|(_, node)| &node.outputs),
        "outputs",
    );
    if let (Some((_, node)), Some(Some(speed))) = (node, speed)
        && let Some(channel) = node.channels.iter().find(|it| it.output && it.object == speed)
    {
        let rule = format!(
            "is the channel {:?} of the node already: an output has one writer",
            channel.name
        );
        section.wrong("speed", rule);
    }
    section.done();
    Some(SpindleDrive {
        node: node?.0,
        speed: speed??,
    })
}

/// A drive of CiA 402, which no joint has.
fn axis(
    mut section: Section<'_, '_>,
    nodes: Option<&[Node]>,
    joints: &[Joint],
    rpm_max: Option<f64>,
) -> Option<SpindleAxis> {
    /// A spindle that takes a millionth of a second to its speed needs no ramp.
    const RAMP_MAX_RPM_S: f64 = 1e9;
    let found = node(&mut section, nodes, |node| node.exchange != Exchange::AsyncOnly);
    let mode = section.word("mode", &SPINDLE_MODES, None);
    let drive_axis = drive::drive_axis(&mut section, found.map(|(_, node)| node));
    let number = drive_axis.unwrap_or(0);
    let reactions = drive::reactions(&mut section, number, found.map(|(_, node)| node));
    if let Some((index, node)) = found {
        if node.profile != Profile::Cia402 {
            section.wrong("node", "must be a node of profile \"cia402\"");
        } else if joints
            .iter()
            .any(|joint| (joint.node, joint.drive_axis) == (index, number))
        {
            section.wrong("node", "is the drive of a joint");
        } else if let Some(mode) = mode {
            modes_are_offered(&mut section, (node, number), mode, false);
        }
    }
    let factor_group = factor_group::factor_group(&mut section, number, found.map(|(_, node)| node));
    let known = found.and_then(|(_, node)| node.drive.as_ref());
    let per_rpm = factor_group.and_then(|group| units_per_rpm(&group, known));
    let item = section.optional("units_per_rpm");
    let units_per_rpm = match (item, mode, per_rpm) {
        (Some(item), ..) => {
            let rule = "must be two integers: what the target counts, and the 1/min that it makes";
            ratio_of_integers(&mut section, "units_per_rpm", item, rule)
        }
        // By the profile 6042 is in 1/min.
        (None, Some(DriveMode::Vl), _) => Some([1, 1]),
        (None, Some(_), Some(per_rpm)) => Some(per_rpm),
        (None, Some(_), None) => {
            section.wrong(
                "units_per_rpm",
                "is missing: what 60FFh counts, and the 1/min that it makes, like [10000, 60]",
            );
            None
        }
        (None, None, _) => None,
    };
    let ramp_rpm_s = match mode {
        // Nobody but the control makes its set-points.
        Some(DriveMode::Csv) => section
            .number("ramp_rpm_s", Bound::Positive(RAMP_MAX_RPM_S), None)
            .map(Some),
        _ => match section.optional("ramp_rpm_s") {
            None => Some(None),
            Some(item) => item
                .number(&section.key("ramp_rpm_s"), Bound::Positive(RAMP_MAX_RPM_S))
                .map(Some),
        },
    };
    if let (Some(units), Some(rpm_max), Some(mode)) = (units_per_rpm, rpm_max, mode) {
        let (most, object) = match mode {
            DriveMode::Vl => (f64::from(i16::MAX), "6042h"),
            _ => (f64::from(i32::MAX), "60FFh"),
        };
        if rpm_max * ratio(units) > most {
            let makes = rpm_max * ratio(units);
            section.wrong(
                "units_per_rpm",
                format!("must let {object} hold rpm_max: {rpm_max} makes {makes:.0}"),
            );
        }
    }
    section.done();
    Some(SpindleAxis {
        node: found?.0,
        drive_axis: drive_axis?,
        mode: mode?,
        units_per_rpm: units_per_rpm?,
        ramp_rpm_s: ramp_rpm_s?,
        reactions: reactions?,
        factor_group: factor_group?,
    })
}

/// Velocity units of 1/min, where they are known and can be written.
fn units_per_rpm(group: &FactorGroup, known: Option<&DriveProfile>) -> Option<[u32; 2]> {
    let [units, turns] = factor_group::units_per_turn(group, known)?;
    let [velocity, per] = group.velocity_ratio().map(u64::from);
    let above = units.checked_mul(velocity)?;
    let below = turns.checked_mul(per)?.checked_mul(60)?;
    let [above, below] = factor_group::lowest([above, below]);
    Some([u32::try_from(above).ok()?, u32::try_from(below).ok()?])
}

/// The encoder, and its lead.
fn encoder(mut section: Section<'_, '_>, nodes: Option<&[Node]>) -> Option<(SpindleEncoder, f64)> {
    let words = [("pins", Source::Pins), ("node", Source::Node)];
    let source = section.word("source", &words, None)?;
    let usual = match source {
        Source::Pins => LEAD_CYCLES,
        Source::Node => LEAD_CYCLES + LATCHED_CYCLES,
    };
    let lead = section.number("lead_cycles", Bound::Within(0.0, 20.0), usual);
    let encoder = match source {
        Source::Pins => Some(SpindleEncoder::Pins),
        Source::Node => counter(&mut section, nodes).map(SpindleEncoder::Counter),
    };
    section.done();
    Some((encoder?, lead?))
}

fn counter(section: &mut Section<'_, '_>, nodes: Option<&[Node]>) -> Option<SpindleCounter> {
    let every_cycle = |node: &Node| matches!(node.exchange, Exchange::Polled | Exchange::Chained);
    let node = node(section, nodes, every_cycle);
    let inputs = node.map(|(_, node)| &node.inputs);
    let counter = object(section, "counter", true, inputs, "inputs");
    let index = object(section, "index", false, inputs, "inputs");
    /// A turn in steps of a millionth is finer than any spindle runs round.
    const COUNTS_MAX: i64 = 100_000_000;
    let counts = section.integer("counts_per_turn", -COUNTS_MAX..=COUNTS_MAX, None)?;
    let (node, counter, index) = (node?.0, counter??, index?);
    let room = 1_i128 << counter.bits;
    let counts_abs = i128::from(counts.abs());
    // From one cycle to the next the counter is followed over less than half of its length.
    let rule = if counts_abs < 4 {
        "must be at least 4, or at most -4 where the counter counts down with M3".to_owned()
    } else if index.is_none() && room % counts_abs != 0 {
        format!(
            "must be a power of two up to the length of the counter, {counter}: without `index`, its zero is at the index"
        )
    } else if counts_abs > room {
        format!("must not be above the length of the counter, {counter}")
    } else {
        return Some(SpindleCounter {
            node,
            counter,
            counts_per_turn: counts as i32,
            index: match index {
                Some(index) if index.bits != counter.bits => {
                    section.wrong("index", format!("must have the length of the counter, {counter}"));
                    return None;
                }
                Some(_) | None => index,
            },
        });
    };
    section.wrong("counts_per_turn", rule);
    None
}

/// The node that `node` names by its id.
pub(super) fn node<'n>(
    section: &mut Section<'_, '_>,
    nodes: Option<&'n [Node]>,
    fits: impl Fn(&Node) -> bool,
) -> Option<(usize, &'n Node)> {
    let id = section.integer("node", 1..=239, None)?;
    let (index, node) = nodes?
        .iter()
        .enumerate()
        .find(|(_, node)| i64::from(node.id) == id)
        .or_else(|| {
            section.wrong("node", "is no node of the bus");
            None
        })?;
    if !fits(node) {
        section.wrong("node", "must be a node whose process data are exchanged in every cycle");
        return None;
    }
    Some((index, node))
}

/// An object that stands in a payload; `Some(None)`: left out.
pub(super) fn object(
    section: &mut Section<'_, '_>,
    key: &'static str,
    required: bool,
    payload: Option<&Vec<Mapped>>,
    name: &str,
) -> Option<Option<Mapped>> {
    let item = match required {
        true => Some(section.required(key, "an object of the node, like \"0x3000:1\"")?),
        false => section.optional(key),
    };
    let Some(item) = item else { return Some(None) };
    let text = item.text(&section.key(key))?;
    let Some((index, sub)) = parse_object(text) else {
        section.wrong(key, "must be an object like \"0x3000:1\"");
        return None;
    };
    let found = payload?
        .iter()
        .find(|object| (object.index, object.sub) == (index, sub));
    if found.is_none() {
        section.wrong(key, format!("does not stand among the `{name}` of the node"));
    }
    found.map(|object| Some(*object))
}
