//! `[spindle]`: how fast it may turn, how its speed is set, and how the control sees where it is.
//!
//! In:  the section, the nodes of the bus.
//! Out: a [`Spindle`] whose objects stand in the payloads of their nodes.

use super::bus_types::{Exchange, Mapped, Node, Profile};
use super::drive::{self, modes_are_offered};
use super::drive_profile::DriveProfile;
use super::factor_group::{self, FactorGroup};
use super::joints::Joint;
use super::modes::{DriveMode, Reactions, SPINDLE_MODES};
use super::node_keys::{has_no_channel, node, object};
use super::question::Bound;
use super::section::{Section, keys, left_out};
use super::values::ratio;
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

/// A spindle that takes a millionth of a second to its speed needs no ramp.
const RAMP_RPM_S: Bound = Bound::Positive(1e9);

keys! {
    /// `[spindle.drive]` with a mode: a drive of CiA 402, which no joint has. `found`: its node and the place of that.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SpindleAxis(section, found: Option<(usize, &Node)>, joints: &[Joint], rpm_max: Option<f64>) {
        /// Index into `Bus::nodes`.
        pub node: usize = found.map(|(node, _)| node),
        /// VL, PV or CSV.
        pub mode: DriveMode = section.word("mode", &SPINDLE_MODES, None),
        /// Axis of the drive at its node, from 0; default 0.
        pub drive_axis: u8 = drive::drive_axis(section, found.map(|(_, node)| node)),
        /// How it stops.
        pub reactions: Reactions = drive::reactions(section, drive_axis.unwrap_or(0), found.map(|(_, node)| node)),
        /// In which units it counts.
        pub factor_group: FactorGroup =
            drive::factor_group(section, drive_axis.unwrap_or(0), found.map(|(_, node)| node)),
        /// Target of the mode (6042, 60FF) per 1/min: numerator and denominator.
        pub units_per_rpm: [u32; 2] =
            units(section, mode, factor_group, found.and_then(|(_, node)| node.drive.as_ref())),
        /// How fast its target may change, 1/min per second; `None`: it has a ramp of its own.
        pub ramp_rpm_s: Option<f64> = match mode {
            // Nobody but the control makes its set-points.
            Some(DriveMode::Csv) => section.number("ramp_rpm_s", RAMP_RPM_S, None).map(Some),
            _ => section.optional_number("ramp_rpm_s", RAMP_RPM_S),
        },
    }
    rules {
        if let Some((index, node)) = found {
            let axis = drive_axis.unwrap_or(0);
            if node.profile != Profile::Cia402 {
                section.wrong("node", "must be a node of profile \"cia402\"");
            } else if joints.iter().any(|joint| (joint.node, joint.drive_axis) == (index, axis)) {
                section.wrong("node", "is the drive of a joint");
            } else if let Some(mode) = mode {
                modes_are_offered(section, (node, axis), mode, false);
            }
        }
        if let (Some(units), Some(rpm_max), Some(mode)) = (units_per_rpm, rpm_max, mode) {
            let (most, object) = match mode {
                DriveMode::Vl => (f64::from(i16::MAX), "6042h"),
                _ => (f64::from(i32::MAX), "60FFh"),
            };
            let makes = rpm_max * ratio(units);
            if makes > most {
                let rule = format!("must let {object} hold rpm_max: {rpm_max} makes {makes:.0}");
                section.wrong("units_per_rpm", rule);
            }
        }
    }
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
pub(super) fn spindle(section: &mut Section<'_, '_>, nodes: Option<&[Node]>, joints: &[Joint]) -> Option<Spindle> {
    let rpm_max = section.number("rpm_max", Bound::Positive(1e6), 24_000.0);
    let count = section.integer("count", 1..=SPINDLES as u8, 1);
    let orient_offset_degrees = section.number("orient_offset_degrees", Bound::Size(360.0), 0.0);
    let wait_for_speed = section.flag("wait_for_speed", true);
    let percent = section.number("speed_tolerance_percent", Bound::Within(0.1, 50.0), 5.0);
    let speed_timeout_s = section.number("speed_timeout_s", Bound::Within(0.1, 600.0), 20.0);
    let (drive, axis) = match section.has("drive") {
        false => (Some(None), Some(None)),
        true => match section.section("drive") {
            None => (None, None),
            Some(table) if table.has("mode") => {
                let axis = table.whole(|table| {
                    let found = node(table, nodes, |node| node.exchange != Exchange::AsyncOnly);
                    SpindleAxis::read(table, found, joints, rpm_max)
                });
                (Some(None), axis.map(Some))
            }
            Some(table) => (table.whole(|table| drive(table, nodes)).map(Some), Some(None)),
        },
    };
    let encoder = match section.has("encoder") {
        false => Some(None),
        true => section
            .section("encoder")
            .and_then(|table| encoder(table, nodes))
            .map(Some),
    };
    Some(Spindle {
        rpm_max: rpm_max?,
        count: count?,
        orient_offset_degrees: orient_offset_degrees?,
        wait_for_speed: wait_for_speed?,
        speed_tolerance: percent? / 100.0,
        speed_timeout_s: speed_timeout_s?,
        drive: drive?,
        axis: axis?,
        encoder: encoder?.map(|(encoder, _)| encoder),
        encoder_lead_cycles: encoder?.map_or(LEAD_CYCLES, |(_, lead)| lead),
    })
}

impl Default for Spindle {
    fn default() -> Spindle {
        left_out(|section| spindle(section, None, &[]))
    }
}

fn drive(section: &mut Section<'_, '_>, nodes: Option<&[Node]>) -> Option<SpindleDrive> {
    let node = node(section, nodes, |node| node.exchange != Exchange::AsyncOnly);
    let speed = object(section, "speed", true, node.map(|(_, node)| &node.outputs), "outputs");
    if let (Some((_, node)), Some(Some(speed))) = (node, speed) {
        has_no_channel(section, "speed", node, speed);
    }
    Some(SpindleDrive {
        node: node?.0,
        speed: speed??,
    })
}

/// `units_per_rpm`, where it is not given as the mode and the units of the drive have it.
fn units(
    section: &mut Section<'_, '_>,
    mode: Option<DriveMode>,
    group: Option<FactorGroup>,
    known: Option<&DriveProfile>,
) -> Option<[u32; 2]> {
    let per_rpm = group.and_then(|group| units_per_rpm(&group, known));
    let what = "what the target counts, and the 1/min that it makes";
    match (section.ratio("units_per_rpm", what)?, mode?, per_rpm) {
        (Some(units), ..) => Some(units),
        // By the profile 6042 is in 1/min.
        (None, DriveMode::Vl, _) => Some([1, 1]),
        (None, _, Some(per_rpm)) => Some(per_rpm),
        (None, _, None) => {
            let rule = "is missing: what 60FFh counts, and the 1/min that it makes, like [10000, 60]";
            section.refused("units_per_rpm", rule)
        }
    }
}

/// Velocity units of 1/min, where they are known and can be written.
fn units_per_rpm(group: &FactorGroup, known: Option<&DriveProfile>) -> Option<[u32; 2]> {
    let [units, turns] = drive::units_per_turn(group, known)?;
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
    const COUNTS_MAX: i32 = 100_000_000;
    let counts: i32 = section.integer("counts_per_turn", -COUNTS_MAX..=COUNTS_MAX, None)?;
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
            counts_per_turn: counts,
            index: match index {
                Some(index) if index.bits != counter.bits => {
                    return section.refused("index", format!("must have the length of the counter, {counter}"));
                }
                Some(_) | None => index,
            },
        });
    };
    section.refused("counts_per_turn", rule)
}
