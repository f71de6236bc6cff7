//! `[[joint]]`, `[[axis]]` and `[offsets]`: what moves, how far and how fast.

use super::analog;
use super::compensation;
use super::document::{Bound, Item, Section};
use super::drive;
use super::factor_group::{self, FactorGroup};
use super::homing::{self, Known};
use super::mapping::parse_object;
use super::position_loop;
use super::steps;
use super::types::{AxisMap, HomingBy, InputBits, Joint, JointLimits, Mapped, Node, Profile, Sto, StopLimits};
use cia402::profile::object_of;
use motion::canon::{Axis, Position};
use std::path::Path;

/// No machine tool is larger or faster; keeps every later calculation far from overflow. mm or degrees.
pub(super) const LENGTH_MAX: f64 = 1e6;
pub(super) const VELOCITY_MAX: f64 = 1e5;
pub(super) const ACCELERATION_MAX: f64 = 1e7;
const JERK_MAX: f64 = 1e10;

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
#[derive(Default)]
pub(super) struct Taken {
    /// Ids of nodes, and axes of them.
    drives: Vec<(i64, u8)>,
    /// Joints whose drives are in this process.
    local: usize,
    /// Pins; `None`: there is no port, or it has errors of its own.
    pub(super) steps: Option<steps::Port>,
}

/// Who moves a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Output {
    Drive,
    Step,
    Analog,
}

/// Notes keys that are about a drive on the bus where there is none.
fn refuse_keys_of_drives(section: &mut Section<'_, '_>, output: Output) {
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
    const OF_LOOPS: [&str; 3] = ["mode", "loop", "pid"];
    let (keys, word) = match output {
        Output::Drive => return,
        Output::Step => ([&OF_DRIVES[..], &OF_LOOPS].concat(), "step"),
        Output::Analog => (OF_DRIVES.to_vec(), "analog"),
    };
    for key in &keys {
        if section.has(key) {
            section.wrong(
                key,
                format!("is of a drive on the bus: this joint has output = {word:?}"),
            );
        }
    }
    section.known(&keys);
}

/// Reads one `[[joint]]`.
pub(super) fn joint(section: &mut Section<'_, '_>, around: &Surroundings<'_>, taken: &mut Taken) -> Option<Joint> {
    const OUTPUTS: [(&str, Output); 3] = [
        ("drive", Output::Drive),
        ("step", Output::Step),
        ("analog", Output::Analog),
    ];
    let output = section.word("output", &OUTPUTS, Output::Drive)?;
    let with_steps = output == Output::Step;
    let node = match output {
        Output::Drive => node(section, around),
        Output::Step | Output::Analog => {
            taken.local += 1;
            refuse_keys_of_drives(section, output);
            None
        }
    };
    let of_node = node.zip(around.nodes).map(|(node, nodes)| &nodes[node]);
    let drive_axis = match output {
        Output::Drive => drive::drive_axis(section, of_node),
        Output::Step | Output::Analog => Some(0),
    };
    if let (Output::Drive, Some(axis)) = (output, drive_axis) {
        not_taken(section, axis, &mut taken.drives);
    }
    let axis = drive_axis.unwrap_or(0);
    let known = of_node.and_then(|node| node.drive.as_ref());
    let mode = drive::mode(section, known);
    let factor_group = match output {
        Output::Drive => factor_group::factor_group(section, axis, of_node),
        Output::Step | Output::Analog => Some(FactorGroup::default()),
    };
    let known_turn = factor_group.and_then(|group| factor_group::units_per_turn(&group, known));
    let node_is_known = output != Output::Drive || of_node.is_some() && factor_group.is_some();
    let counts_per_unit = counts_per_unit(section, known_turn, node_is_known);
    let velocity_ratio = velocity_ratio(section, factor_group);
    let travel_mm = travel(section);
    let velocity_mm_s = section.number("velocity_mm_s", Bound::Positive(VELOCITY_MAX), None);
    let acceleration_mm_s2 = section.number("acceleration_mm_s2", Bound::Positive(ACCELERATION_MAX), None);
    let jerk_mm_s3 = section.number("jerk_mm_s3", Bound::Positive(JERK_MAX), None);
    let stop_acceleration_mm_s2 = stop_limit(
        section,
        "stop_acceleration_mm_s2",
        ACCELERATION_MAX,
        acceleration_mm_s2,
        2.0,
    );
    let stop_jerk_mm_s3 = stop_limit(section, "stop_jerk_mm_s3", JERK_MAX, jerk_mm_s3, 4.0);
    let following_error_mm = section.number("following_error_mm", Bound::Positive(LENGTH_MAX), None);
    if let (Some(window), Some(velocity), Some(cycle_us)) = (following_error_mm, velocity_mm_s, around.cycle_us) {
        // What a joint covers in two cycles is lag of the bus, not of the drive.
        let least_mm = 2.0 * velocity * f64::from(cycle_us) / 1e6;
        if window <= least_mm {
            let rule = format!("must be above {least_mm}, the way of two cycles at velocity_mm_s");
            section.wrong("following_error_mm", rule);
        }
    }
    let step = match with_steps {
        true => {
            let port = taken.steps.as_mut();
            let step = steps::output(section, port, around.has_steps, velocity_mm_s, counts_per_unit);
            step.map(Some)
        }
        false => {
            if section.has("step") {
                section.wrong("step", "is of a joint with output = \"step\"");
            }
            section.known(&["step"]);
            Some(None)
        }
    };
    let analog = match output {
        Output::Analog => analog::output(section, around.nodes, mode).map(Some),
        Output::Drive | Output::Step => {
            if section.has("analog") {
                section.wrong("analog", "is of a joint with output = \"analog\"");
            }
            section.known(&["analog"]);
            Some(None)
        }
    };
    let unhomed_jog_mm_s = unhomed_jog(section, velocity_mm_s);
    let inputs = (node.zip(around.nodes)).map(|(node, nodes)| nodes[node].inputs.as_slice());
    let limits_by_drive = limit_switches(section, axis, inputs);
    let torque_per_mm_s2 = drive::torque_per_mm_s2(section, axis, of_node);
    let touch_probe = drive::touch_probe(section, axis, of_node);
    let reactions = drive::reactions(section, axis, of_node);
    let sto = match section.optional_section("sto") {
        None if section.has("sto") => None,
        // Where the object of the profile is among the inputs.
        None => Some(
            known
                .and_then(|known| known.sto)
                .map(|sto| sto.of_axis(axis))
                .filter(|sto| {
                    let sends = |inputs: &[Mapped]| inputs.iter().any(|it| (it.index, it.sub) == sto.object);
                    inputs.is_some_and(sends)
                }),
        ),
        Some(mut table) => {
            let sto = sto(&mut table, inputs);
            table.done();
            sto.map(Some)
        }
    };
    let squaring_offset_mm = section.number("squaring_offset_mm", Bound::Size(LENGTH_MAX), 0.0);
    let of_joint = Known {
        travel_mm,
        velocity_mm_s,
        stop: stop_acceleration_mm_s2
            .zip(stop_jerk_mm_s3)
            .map(|(acceleration_mm_s2, jerk_mm_s3)| StopLimits {
                acceleration_mm_s2,
                jerk_mm_s3,
            }),
        counts_per_unit,
        turn_mm: known_turn
            .zip(counts_per_unit)
            .map(|([units, turns], counts)| units as f64 / turns as f64 / ratio(counts)),
        is_local: output != Output::Drive,
        drive: known,
    };
    let homing = homing::homing(section, &of_joint);
    let counts_per_unit = match (with_steps, counts_per_unit) {
        (false, counts) => counts,
        (true, Some([steps, units])) => {
            let parts = steps.checked_mul(steps::SUBSTEPS);
            if parts.is_none() {
                section.wrong(
                    "counts_per_unit",
                    format!("must not be above {} steps", u32::MAX / steps::SUBSTEPS),
                );
            }
            parts.map(|parts| [parts, units])
        }
        (true, None) => None,
    };
    if let (Some(node), Some(mode), Some(homing)) = (of_node, mode, &homing) {
        let by_drive = matches!(homing.by, HomingBy::Drive { .. });
        drive::modes_are_offered(section, (node, axis), mode, by_drive);
    }
    if let (Some(counts), Some(travel)) = (counts_per_unit, travel_mm) {
        let counts_per_mm = ratio(counts);
        for end in travel {
            if (end * counts_per_mm).abs() > f64::from(i32::MAX) {
                section.wrong(
                    "travel_mm",
                    format!("must fit 32-bit positions of the drive: {end} is too far"),
                );
            }
        }
        if let Some(velocity) = velocity_mm_s.filter(|velocity| velocity * counts_per_mm > f64::from(i32::MAX)) {
            section.wrong(
                "velocity_mm_s",
                format!("must fit 32-bit speeds of the drive: {velocity} is too fast"),
            );
        }
        // Without a ratio of its own the speed has just been judged.
        let units = velocity_ratio.filter(|units| *units != [1, 1]);
        let units = units.map(|units| ratio(units) * counts_per_mm);
        if let (Some(units), Some(velocity)) = (units, velocity_mm_s)
            && velocity * units > f64::from(i32::MAX)
        {
            section.wrong(
                "velocity_ratio",
                format!(
                    "must let 60FFh hold velocity_mm_s: {velocity} makes {:.0}",
                    velocity * units
                ),
            );
        }
    }
    let pid = position_loop::keys(section, mode, velocity_mm_s);
    if let (Some(Some((gains, _))), Some(mode)) = (&pid, mode) {
        let goes_on_alone = reactions.as_ref().is_some_and(|it| it.connection_lost == Some(0));
        position_loop::suits(section, mode, goes_on_alone, of_node, axis);
        let reach = counts_per_unit.zip(velocity_ratio);
        let reach = reach.map(|(counts, units)| ratio(counts) * ratio(units) * gains.output_max);
        if mode == cia402::Mode::Csv && reach.is_some_and(|reach| reach > f64::from(i32::MAX)) {
            section.wrong("pid", "has an output_max that 60FFh cannot hold");
        }
    }
    let compensation = compensation::keys(section, around.folder);
    let mut limits = JointLimits {
        velocity_mm_s: velocity_mm_s?,
        acceleration_mm_s2: acceleration_mm_s2?,
        jerk_mm_s3: jerk_mm_s3?,
    };
    let mut stop = StopLimits {
        acceleration_mm_s2: stop_acceleration_mm_s2?,
        jerk_mm_s3: stop_jerk_mm_s3?,
    };
    let compensation = match compensation? {
        None => None,
        Some(asked_for) => Some(compensation::share(section, asked_for, &mut limits, &mut stop)?),
    };
    Some(Joint {
        node: match output {
            Output::Drive => node?,
            Output::Step | Output::Analog => around.nodes?.len() + taken.local - 1,
        },
        drive_axis: drive_axis?,
        step: step?,
        analog: analog?,
        mode: mode?,
        counts_per_unit: counts_per_unit?,
        velocity_ratio: velocity_ratio?,
        torque_per_mm_s2: torque_per_mm_s2?,
        reactions: reactions?,
        factor_group: factor_group?,
        pid: pid?.map(|(gains, _)| gains),
        amplifier_lag_s: pid?.and_then(|(_, lag_s)| lag_s),
        travel_mm: travel_mm?,
        limits,
        stop,
        following_error_mm: following_error_mm?,
        homing: homing?,
        compensation,
        unhomed_jog_mm_s: unhomed_jog_mm_s?,
        touch_probe: touch_probe?,
        limits_by_drive: limits_by_drive?,
        input_bits: known.map_or(InputBits::default(), |known| known.input_bits),
        home_count: of_node.map_or(0, |node| home_count(node, axis)),
        sto: sto?,
        squaring_offset_mm: squaring_offset_mm?,
    })
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

/// `velocity_ratio`; the factor group of the drive, where it has one of speeds, must say the same.
fn velocity_ratio(section: &mut Section<'_, '_>, group: Option<FactorGroup>) -> Option<[u32; 2]> {
    let Some(item) = section.optional("velocity_ratio") else {
        return group.map(|group| group.velocity_ratio());
    };
    let rule = "must be two integers: what 60FFh counts, and the increments/s that it makes";
    let ratio = ratio_of_integers(section, "velocity_ratio", item, rule)?;
    if let Some([above, below]) = group.and_then(|group| group.velocity)
        && !factor_group::same(ratio, [above, below])
    {
        let rule = format!("must be the velocity of factor_group, [{above}, {below}], or be left out");
        section.wrong("velocity_ratio", rule);
        return None;
    }
    Some(ratio)
}

/// `counts_per_unit`, or `turns_per_unit` of a motor of which it is known what its drive counts in a turn, `known_turn`; with both
/// they must be the same. `drive_is_known`: what is said of the drive has no errors of its own.
fn counts_per_unit(
    section: &mut Section<'_, '_>,
    known_turn: Option<[u64; 2]>,
    drive_is_known: bool,
) -> Option<[u32; 2]> {
    let turns = section.optional("turns_per_unit");
    let counts = match section.optional("counts_per_unit") {
        None => None,
        Some(item) => {
            let rule = "must be two integers: increments and the mm (degrees) that they make";
            Some(ratio_of_integers(section, "counts_per_unit", item, rule)?)
        }
    };
    let Some(item) = turns else {
        let what = "increments of the drive, or steps, per mm (degree), like [10000, 1]";
        if counts.is_none() {
            section.required("counts_per_unit", what)?;
        }
        return counts;
    };
    let rule = "must be two integers: turns of the motor and the mm (degrees) that they make";
    let [turns, units] = ratio_of_integers(section, "turns_per_unit", item, rule)?;
    let Some([per_turn, of_turns]) = known_turn else {
        if drive_is_known {
            let rule = "needs a drive profile that has increments_per_turn, or a factor_group that has feed and gear; without one \
                        counts_per_unit is the scale";
            section.wrong("turns_per_unit", rule);
        }
        return None;
    };
    let products = per_turn
        .checked_mul(turns.into())
        .zip(of_turns.checked_mul(units.into()));
    let both = products.map(|(above, below)| factor_group::lowest([above, below]));
    let fits = both.and_then(|both| Some([u32::try_from(both[0]).ok()?, u32::try_from(both[1]).ok()?]));
    let Some(scale) = fits else {
        let turn = if of_turns == 1 {
            format!("{per_turn} a turn")
        } else {
            format!("{per_turn} in {of_turns} turns")
        };
        section.wrong(
            "turns_per_unit",
            format!("makes more increments than there are numbers, {turn}"),
        );
        return None;
    };
    if let Some(counts) = counts.filter(|counts| !factor_group::same(*counts, scale)) {
        let [[counted, of], [made, makes]] = [counts, scale];
        let rule = format!(
            "contradicts turns_per_unit, which makes [{made}, {makes}]: one of them is wrong, and one is enough; it is [{counted}, {of}]"
        );
        section.wrong("counts_per_unit", rule);
        return None;
    }
    Some(scale)
}

/// How fast it may be jogged before it is homed; left out: a tenth of its velocity.
fn unhomed_jog(section: &mut Section<'_, '_>, velocity_mm_s: Option<f64>) -> Option<f64> {
    const SHARE: f64 = 0.1;
    let Some(item) = section.optional("unhomed_jog_mm_s") else {
        return velocity_mm_s.map(|velocity| SHARE * velocity);
    };
    let speed = item.number(&section.key("unhomed_jog_mm_s"), Bound::Positive(VELOCITY_MAX))?;
    if let Some(velocity) = velocity_mm_s.filter(|velocity| speed > *velocity) {
        section.wrong(
            "unhomed_jog_mm_s",
            format!("must not be above velocity_mm_s, {velocity}"),
        );
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

pub(super) fn sto(section: &mut Section<'_, '_>, inputs: Option<&[Mapped]>) -> Option<Sto> {
    let what = "an object that the drive sends, like \"0x60FD\" or \"0x2110:1\"";
    let object = section.required("object", what);
    let bit = section.integer("bit", 0..=63, None).map(|bit| bit as u32);
    let active = section.flag("active", true);
    let text = object?.text(&section.key("object"))?;
    let Some(object) = parse_object(text) else {
        section.wrong("object", format!("must be {what}"));
        return None;
    };
    if let Some(inputs) = inputs {
        match inputs.iter().find(|mapped| (mapped.index, mapped.sub) == object) {
            None => section.wrong("object", "must be among the inputs of its node"),
            Some(mapped) if bit.is_some_and(|bit| bit >= u32::from(mapped.bits)) => {
                section.wrong("bit", format!("must be below {}, the bits of {text}", mapped.bits));
            }
            Some(_) => {}
        }
    }
    Some(Sto {
        object,
        bit: bit?,
        active: active?,
    })
}

/// A limit of stops; left out it is a multiple of that of the plan.
fn stop_limit(
    section: &mut Section<'_, '_>,
    key: &'static str,
    most: f64,
    of_plan: Option<f64>,
    default_ratio: f64,
) -> Option<f64> {
    // Slowing down on the path while the plan uses all of its acceleration takes more than the plan has.
    const RATIO_MIN: f64 = 1.2;
    let Some(item) = section.optional(key) else {
        return of_plan.map(|limit| limit * default_ratio);
    };
    let stop = item.number(&section.key(key), Bound::Positive(most))?;
    if let Some(limit) = of_plan.filter(|limit| stop < RATIO_MIN * limit) {
        section.wrong(
            key,
            format!("must be at least {RATIO_MIN} times the limit of the plan, {limit}"),
        );
    }
    Some(stop)
}

pub(super) fn ratio(counts_per_unit: [u32; 2]) -> f64 {
    f64::from(counts_per_unit[0]) / f64::from(counts_per_unit[1])
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
        section.wrong(
            key,
            "is the drive of a joint above; of a node with several axes drive_axis says which",
        );
    }
    taken.push((id, axis));
}

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
            section.wrong("node", format!("no [[bus.node]] has this id; drives: {list}"));
            None
        }
        Some(index) if nodes[index].profile == Profile::Cia402 => Some(index),
        Some(_) => {
            section.wrong("node", "must be a node of profile \"cia402\"");
            None
        }
    }
}

/// A ratio of two integers above 0.
pub(super) fn ratio_of_integers(
    section: &mut Section<'_, '_>,
    key: &'static str,
    item: Item<'_, '_>,
    rule: &'static str,
) -> Option<[u32; 2]> {
    let path = section.key(key);
    let items = item.items(&path)?;
    let [above, below] = items[..] else {
        section.wrong(key, rule);
        return None;
    };
    let above = above.integer(&format!("{path}[0]"), 1..=i64::from(u32::MAX));
    let below = below.integer(&format!("{path}[1]"), 1..=i64::from(u32::MAX));
    Some([above? as u32, below? as u32])
}

fn travel(section: &mut Section<'_, '_>) -> Option<[f64; 2]> {
    range(section, "travel_mm", "soft limits, like [-5.0, 305.0]")
}

/// A lower and an upper limit, mm.
pub(super) fn range(section: &mut Section<'_, '_>, key: &'static str, what: &str) -> Option<[f64; 2]> {
    let path = section.key(key);
    let items = section.required(key, what)?.items(&path)?;
    let [lower, upper] = items[..] else {
        section.wrong(key, "must be two numbers: lower and upper limit");
        return None;
    };
    let lower = lower.number(&format!("{path}[0]"), Bound::Size(LENGTH_MAX));
    let upper = upper.number(&format!("{path}[1]"), Bound::Size(LENGTH_MAX));
    let range = [lower?, upper?];
    if range[0] >= range[1] {
        section.wrong(key, "the lower limit must be below the upper one");
        return None;
    }
    Some(range)
}

/// Reads all `[[axis]]`; every one of `joints` joints must belong to one axis. `follows`: each joint follows its axis.
pub(super) fn axes(root: &mut Section<'_, '_>, joints: usize, follows: bool) -> Option<Vec<AxisMap>> {
    let mut axes: Vec<AxisMap> = Vec::new();
    let mut taken = vec![false; joints];
    let mut complete = true;
    let tables = root.some_sections("axis");
    if tables.is_empty() {
        return None;
    }
    for mut section in tables {
        let axis = letter(&mut section, "letter");
        if let Some(axis) = axis
            && axes.iter().any(|other| other.axis == axis)
        {
            section.wrong("letter", "is taken by an axis above");
            complete = false;
        }
        let joints = joints_of_axis(&mut section, &mut taken);
        let wrapped = section.flag("wrapped", false);
        if wrapped == Some(true) && axis.is_some_and(|axis| !axis.is_rotary()) {
            section.wrong("wrapped", "only A, B and C turn without end");
            complete = false;
        }
        let travel_mm = section.has("travel_mm").then(|| travel(&mut section));
        if travel_mm.is_some() && follows {
            section.wrong("travel_mm", "the joints' own travel_mm is that of the axis");
            complete = false;
        }
        section.done();
        match (axis, joints, wrapped, travel_mm) {
            (Some(axis), Some(joints), Some(wrapped), None | Some(Some(_))) => axes.push(AxisMap {
                axis,
                joints,
                wrapped,
                travel_mm: travel_mm.flatten(),
            }),
            _ => complete = false,
        }
    }
    if complete && let Some(left_out) = taken.iter().position(|taken| !taken) {
        root.wrong("axis", format!("joint {left_out} belongs to no axis"));
        return None;
    }
    complete.then_some(axes)
}

/// The axis that a key names.
pub(super) fn letter(section: &mut Section<'_, '_>, key: &'static str) -> Option<Axis> {
    let item = section.required(key, "one of X Y Z A B C U V W")?;
    let text = item.text(&section.key(key))?;
    let mut letters = text.chars();
    let axis = letters
        .next()
        .filter(|_| letters.next().is_none())
        .and_then(Axis::from_letter);
    if axis.is_none() {
        section.wrong(key, "must be one of X Y Z A B C U V W");
    }
    axis
}

fn joints_of_axis(section: &mut Section<'_, '_>, taken: &mut [bool]) -> Option<Vec<usize>> {
    let path = section.key("joints");
    let item = section.required("joints", "the joints that the axis moves, counted from 0")?;
    let items = item.items(&path)?;
    if items.is_empty() {
        section.wrong("joints", "must name at least one joint");
        return None;
    }
    let mut joints = Vec::new();
    let mut complete = true;
    for (index, item) in items.into_iter().enumerate() {
        let key = format!("{path}[{index}]");
        let Some(joint) = item.integer(&key, 0..=i64::from(u16::MAX)) else {
            complete = false;
            continue;
        };
        let joint = joint as usize;
        let rule = match taken.get(joint) {
            None => format!("there is no such joint; joints: {}, counted from 0", taken.len()),
            Some(true) => "belongs to an axis already".to_owned(),
            Some(false) => {
                taken[joint] = true;
                joints.push(joint);
                continue;
            }
        };
        item.log.wrong(item.value.span(), &key, rule, None);
        complete = false;
    }
    complete.then_some(joints)
}

/// Work offset systems in the order of G54 to G59.3.
const SYSTEMS: [&str; 9] = ["g54", "g55", "g56", "g57", "g58", "g59", "g59_1", "g59_2", "g59_3"];

/// Reads `[offsets]`; only axes of the machine may be shifted.
pub(super) fn offsets(root: &mut Section<'_, '_>, axes: Option<&[AxisMap]>) -> Option<[Position; 9]> {
    const LETTERS: [&str; 9] = ["x", "y", "z", "a", "b", "c", "u", "v", "w"];
    let mut offsets = [Position::ZERO; 9];
    let mut complete = true;
    let mut section = root.section("offsets")?;
    for (name, origin) in SYSTEMS.into_iter().zip(&mut offsets) {
        let Some(mut system) = section.optional_section(name) else {
            continue;
        };
        for (letter, axis) in LETTERS.into_iter().zip(Axis::ALL) {
            let Some(item) = system.optional(letter) else { continue };
            match item.number(&system.key(letter), Bound::Size(LENGTH_MAX)) {
                Some(value) => origin[axis] = value,
                None => complete = false,
            }
            if axes.is_some_and(|axes| axes.iter().all(|map| map.axis != axis)) {
                system.wrong(letter, "the machine has no such axis");
                complete = false;
            }
        }
        system.done();
    }
    section.done();
    complete.then_some(offsets)
}
