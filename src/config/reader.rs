//! From the text of a machine file to a checked [`Config`], or to all that is wrong with it.
//!
//! Each section is read by one function below, in the order of the file; the rules stand where a value is read.

use super::cursor::{Cursor, Findings, Located};
use super::errors::ConfigErrors;
use super::types::*;
use motion::canon::{Axis, Position};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::path::Path;
use toml::de::DeTable;

/// Homing methods of CiA 402 that a drive can be asked for.
const HOMING_METHODS: &str = "1 to 14, 17 to 30, 33, 34, 35, 37";
/// Longest isochronous payload, octets.
const PAYLOAD_OCTETS_MAX: usize = 1490;

/// Reads and checks a machine file.
///
/// # Errors
/// Everything that is wrong with it at once, or that it cannot be read.
pub fn read(path: &Path) -> Result<Config, ConfigErrors> {
    match std::fs::read_to_string(path) {
        Ok(text) => parse(&text, path),
        Err(error) => {
            let findings = Findings::new("");
            findings.add(0..0, "", "", format!("the file cannot be read: {error}"));
            Err(ConfigErrors::new(
                &path.display().to_string(),
                "",
                findings.into_errors(),
            ))
        }
    }
}

/// Checks the text of a machine file; `path` is for messages.
///
/// # Errors
/// Everything that is wrong with it at once.
pub fn parse(text: &str, path: &Path) -> Result<Config, ConfigErrors> {
    let findings = Findings::new(text);
    let (document, syntax_errors) = DeTable::parse_recoverable(text);
    for error in &syntax_errors {
        findings.add(error.span().unwrap_or(0..0), "", "", error.message());
    }
    // What stands behind a syntax error may belong to another table: nothing more can be said then.
    let config = if syntax_errors.is_empty() {
        document_of(Cursor::new(&findings, document, ""), &findings)
    } else {
        None
    };
    let errors = findings.into_errors();
    match config {
        Some(mut config) if errors.is_empty() => {
            config.path = path.into();
            Ok(config)
        }
        Some(_) | None => Err(ConfigErrors::new(&path.display().to_string(), text, errors)),
    }
}

fn document_of(mut document: Cursor<'_, '_>, findings: &Findings<'_>) -> Option<Config> {
    if let Some(schema) = document.required::<i64>("schema") {
        check(
            findings,
            &schema,
            schema.value == 1,
            "must be 1, the only schema there is",
        );
    }
    let machine = document
        .required_table("machine")
        .and_then(|table| machine(table, findings));
    let cycle_us = machine.as_ref().map_or(1000, |(_, cycle_us)| *cycle_us);
    let rt = rt(document.table("rt"), findings, cycle_us);
    let bus = document
        .required_table("bus")
        .and_then(|table| bus(table, findings, cycle_us));
    let nodes: &[Node] = bus.as_ref().map_or(&[], |bus| &bus.nodes);
    let joints = joints(document.tables("joint"), findings, nodes, bus.is_some(), cycle_us);
    let axes = axes(document.tables("axis"), findings, joints.as_ref().map(Vec::len));
    let work_offsets = offsets(document.table("offsets"));
    let spindle = spindle(document.table("spindle"), findings);
    let program = program(document.table("program"), findings);
    let nets = nets(document.table("hal"), findings);
    let sim = sim(document.table("sim"), findings);
    document.refuse_unsupported(&["logic", "tools"]);
    document.finish();
    let (name, cycle_us) = machine?;
    Some(Config {
        path: Default::default(),
        name,
        cycle_us,
        rt: rt?,
        bus: bus?,
        joints: joints?,
        axes: axes?,
        work_offsets,
        spindle: spindle?,
        program: program?,
        nets,
        sim: sim?,
    })
}

fn machine(mut table: Cursor<'_, '_>, findings: &Findings<'_>) -> Option<(String, u32)> {
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Kinematics {
        Trivial,
    }
    let name = table.required::<String>("name");
    if let Some(name) = &name {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let good = (1..=40).contains(&name.value.len()) && name.value.chars().all(plain);
        check(
            findings,
            name,
            good,
            "must be 1 to 40 letters, digits, `-` or `_`: it also names shared memory",
        );
    }
    let kinematics = table.required::<Kinematics>("kinematics");
    let cycle_us = number(&mut table, findings, "cycle_us", Some(1000_u32), 250..=10_000);
    table.finish();
    kinematics?;
    Some((name?.value, cycle_us?))
}

fn rt(table: Option<Cursor<'_, '_>>, findings: &Findings<'_>, cycle_us: u32) -> Option<Rt> {
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum RequireWord {
        Strict,
        Warn,
    }
    let default = Rt {
        cpu: None,
        priority: 80,
        timeout_us: 50,
        phase_us: 370 % cycle_us.max(1),
        spin_us: 50,
        keep_awake: true,
        lock_memory: true,
        require: Require::Warn,
    };
    let Some(mut table) = table else { return Some(default) };
    let cpu = table.optional::<usize>("cpu");
    let priority = number(&mut table, findings, "priority", Some(default.priority), 1..=97);
    let timeout_us = number(
        &mut table,
        findings,
        "timeout_us",
        Some(default.timeout_us),
        20..=cycle_us,
    );
    let phase_us = number(
        &mut table,
        findings,
        "phase_us",
        Some(default.phase_us),
        0..=cycle_us - 1,
    );
    let spin_us = number(&mut table, findings, "spin_us", Some(default.spin_us), 0..=cycle_us / 2);
    let keep_awake = table
        .optional::<bool>("keep_awake")
        .map_or(default.keep_awake, |found| found.value);
    let lock_memory = table
        .optional::<bool>("lock_memory")
        .map_or(default.lock_memory, |found| found.value);
    let require = table
        .optional::<RequireWord>("require")
        .map_or(Require::Warn, |found| match found.value {
            RequireWord::Strict => Require::Strict,
            RequireWord::Warn => Require::Warn,
        });
    table.finish();
    Some(Rt {
        cpu: cpu.map(|found| found.value),
        priority: priority?,
        timeout_us: timeout_us?,
        phase_us: phase_us?,
        spin_us: spin_us?,
        keep_awake,
        lock_memory,
        require,
    })
}

fn bus(mut table: Cursor<'_, '_>, findings: &Findings<'_>, cycle_us: u32) -> Option<Bus> {
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Kind {
        Powerlink,
        Memory,
    }
    let kind = table.required::<Kind>("kind").map(|found| match found.value {
        Kind::Powerlink => BusKind::Powerlink,
        Kind::Memory => BusKind::Memory,
    });
    let interface = match kind {
        Some(BusKind::Memory) => Some(
            table
                .optional::<String>("interface")
                .map_or(String::new(), |found| found.value),
        ),
        Some(BusKind::Powerlink) | None => table.required::<String>("interface").map(|found| {
            // IFNAMSIZ leaves 15 characters.
            check(
                findings,
                &found,
                (1..=15).contains(&found.value.len()),
                "must be a name of 1 to 15 characters",
            );
            found.value
        }),
    };
    let async_slot = table.optional::<u32>("async_slot_timeout_us");
    let async_slot_timeout_us = async_slot.as_ref().map_or(100, |found| found.value);
    if let Some(found) = &async_slot {
        check(
            findings,
            found,
            (1..cycle_us).contains(&found.value),
            "must be above 0 and below the cycle",
        );
    }
    let pres_lost_max = number(&mut table, findings, "pres_lost_max", Some(3), 0..=100);
    let tables = table.tables("node");
    let count = tables.len();
    if count == 0 {
        findings.add(
            table.span.clone(),
            "bus.node",
            "",
            "a bus has at least one [[bus.node]]",
        );
    }
    let mut nodes: Vec<Node> = Vec::new();
    for table in tables {
        let place = (table.span.clone(), table.path.clone());
        let Some((node, id)) = node(table, findings) else {
            continue;
        };
        if nodes.iter().any(|other| other.id == node.id) {
            findings.add(id.span, &id.key, &node.id.to_string(), "is the id of another node, too");
        }
        if nodes.iter().any(|other| other.name == node.name) {
            findings.add(
                place.0,
                &format!("{}.name", place.1),
                &node.name,
                "is the name of another node, too",
            );
        }
        nodes.push(node);
    }
    let slots_us: u64 = nodes.iter().map(|node| u64::from(node.pres_timeout_us)).sum();
    let needed_us = slots_us + u64::from(async_slot_timeout_us);
    if needed_us >= u64::from(cycle_us) {
        let rule = format!(
            "the cycle of {cycle_us} us is too short: time-outs of {count} nodes {slots_us} us + asynchronous slot \
             {async_slot_timeout_us} us = {needed_us} us"
        );
        findings.add(table.span.clone(), "bus", "", rule);
    }
    table.finish();
    Some(Bus {
        kind: kind?,
        interface: interface?,
        async_slot_timeout_us,
        pres_lost_max: pres_lost_max?,
        nodes: (nodes.len() == count).then_some(nodes)?,
    })
}

fn node(mut table: Cursor<'_, '_>, findings: &Findings<'_>) -> Option<(Node, Located<u8>)> {
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum ProfileWord {
        Cia402,
        Io,
    }
    let id = table.required::<u8>("id");
    if let Some(id) = &id {
        check(
            findings,
            id,
            (1..=239).contains(&id.value),
            "must be 1 to 239, the ids of controlled nodes",
        );
    }
    let name = table.optional::<String>("name").map(|found| found.value);
    let profile = table.required::<ProfileWord>("profile").map(|found| match found.value {
        ProfileWord::Cia402 => Profile::Cia402,
        ProfileWord::Io => Profile::Io,
    });
    let mandatory = table.optional::<bool>("mandatory").is_none_or(|found| found.value);
    let pres_timeout_us = number(&mut table, findings, "pres_timeout_us", Some(25), 1..=10_000);
    let mut identity = |key| table.optional::<u32>(key).map(|found| found.value);
    let identity = Identity {
        device_type: identity("device_type"),
        vendor_id: identity("vendor_id"),
        product_code: identity("product_code"),
        revision: identity("revision"),
        serial: identity("serial"),
    };
    let default = profile.map_or((&[][..], &[][..]), default_mapping);
    let needed = match profile {
        Some(Profile::Cia402) => (&[0x6040, 0x607A][..], &[0x6041, 0x6064][..]),
        Some(Profile::Io) | None => (&[][..], &[][..]),
    };
    let outputs = mapping(&mut table, findings, "outputs", default.0, needed.0);
    let inputs = mapping(&mut table, findings, "inputs", default.1, needed.1);
    table.finish();
    let id = id?;
    let node = Node {
        id: id.value,
        name: name.unwrap_or_else(|| format!("node-{}", id.value)),
        profile: profile?,
        mandatory,
        pres_timeout_us: pres_timeout_us?,
        identity,
        outputs: outputs?,
        inputs: inputs?,
    };
    Some((node, id))
}

/// What is mapped where the machine file says nothing.
fn default_mapping(profile: Profile) -> (&'static [&'static str], &'static [&'static str]) {
    match profile {
        Profile::Cia402 => (
            &["0x6040/16", "0x607A/32", "0x6060/8", "0x60FE:1/32"],
            &[
                "0x6041/16",
                "0x6064/32",
                "0x60F4/32",
                "0x6061/8",
                "0x60FD/32",
                "0x603F/16",
            ],
        ),
        Profile::Io => (&["0x6200:1/8", "0x6200:2/8"], &["0x6000:1/8", "0x6000:2/8"]),
    }
}

fn mapping(
    table: &mut Cursor<'_, '_>,
    findings: &Findings<'_>,
    key: &'static str,
    default: &[&str],
    needed: &[u16],
) -> Option<Vec<Mapped>> {
    let Some(found) = table.optional::<Vec<toml::Spanned<String>>>(key) else {
        return default.iter().map(|word| mapped(word)).collect();
    };
    let mut objects: Vec<Mapped> = Vec::new();
    for word in &found.value {
        let written = format!("{:?}", word.get_ref());
        match mapped(word.get_ref()) {
            None => findings.add(
                word.span(),
                &found.key,
                &written,
                "must be an object and its length in bits, such as \"0x6041/16\" or \"0x60FE:1/32\" (8, 16, 32 or 64 bits)",
            ),
            Some(object) if objects.iter().any(|other| (other.index, other.sub) == (object.index, object.sub)) => {
                findings.add(word.span(), &found.key, &written, "is mapped twice");
            }
            Some(object) => objects.push(object),
        }
    }
    for index in needed {
        if objects.iter().all(|object| object.index != *index) {
            findings.add(
                found.span.clone(),
                &found.key,
                "",
                format!("a drive needs {index:#06X} here"),
            );
        }
    }
    let octets: usize = objects.iter().map(|object| usize::from(object.bits / 8)).sum();
    if octets > PAYLOAD_OCTETS_MAX || objects.len() > 254 {
        findings.add(
            found.span,
            &found.key,
            "",
            format!("{octets} octets in {} objects do not fit a frame", objects.len()),
        );
    }
    Some(objects)
}

/// `0x60FE:1/32`
fn mapped(word: &str) -> Option<Mapped> {
    let (object, bits) = word.split_once('/')?;
    let (index, sub) = object.split_once(':').unwrap_or((object, "0"));
    let index = u16::from_str_radix(index.strip_prefix("0x").or(index.strip_prefix("0X"))?, 16).ok()?;
    let sub = sub.parse().ok()?;
    let bits = bits.parse().ok().filter(|bits| matches!(bits, 8 | 16 | 32 | 64))?;
    (index >= 0x1000).then_some(Mapped { index, sub, bits })
}

fn joints(
    tables: Vec<Cursor<'_, '_>>,
    findings: &Findings<'_>,
    nodes: &[Node],
    nodes_known: bool,
    cycle_us: u32,
) -> Option<Vec<Joint>> {
    let count = tables.len();
    if !(1..=JOINTS_MAX).contains(&count) {
        findings.add(
            0..0,
            "joint",
            "",
            format!("a machine has 1 to {JOINTS_MAX} [[joint]], this one {count}"),
        );
    }
    let mut joints: Vec<Joint> = Vec::new();
    let mut used = Vec::new();
    for table in tables {
        let Some((mut joint, node)) = joint(table, findings, cycle_us) else {
            continue;
        };
        match nodes.iter().position(|candidate| candidate.id == node.value) {
            None if nodes_known => findings.add(
                node.span,
                &node.key,
                &node.value.to_string(),
                "is the id of no [[bus.node]]",
            ),
            None => {}
            Some(index) if nodes[index].profile != Profile::Cia402 => {
                findings.add(
                    node.span,
                    &node.key,
                    &node.value.to_string(),
                    "is no drive: its profile is not \"cia402\"",
                );
            }
            Some(index) if used.contains(&index) => {
                findings.add(
                    node.span,
                    &node.key,
                    &node.value.to_string(),
                    "moves another joint already",
                );
            }
            Some(index) => {
                used.push(index);
                joint.node = index;
            }
        }
        joints.push(joint);
    }
    (joints.len() == count).then_some(joints)
}

fn joint(mut table: Cursor<'_, '_>, findings: &Findings<'_>, cycle_us: u32) -> Option<(Joint, Located<u8>)> {
    let node = table.required::<u8>("node");
    let counts = table.required::<[u32; 2]>("counts_per_unit");
    let counts_per_unit = counts.as_ref().map(|found| found.value);
    if let Some(found) = &counts {
        check(
            findings,
            found,
            found.value.iter().all(|&part| part > 0),
            "both parts of the ratio must be above 0",
        );
    }
    let travel = table.required::<[f64; 2]>("travel_mm");
    if let Some(found) = &travel {
        let [low, high] = found.value;
        check(
            findings,
            found,
            low.is_finite() && high.is_finite() && low < high,
            "the lower end must be below the upper one",
        );
        if let Some([counts, units]) = counts_per_unit.filter(|ratio| ratio[1] > 0) {
            let reach = low.abs().max(high.abs()) * f64::from(counts) / f64::from(units);
            check(
                findings,
                found,
                reach < f64::from(i32::MAX),
                "must fit the 32 bits of a drive's position",
            );
        }
    }
    let velocity = positive(&mut table, findings, "velocity_mm_s");
    let acceleration = positive(&mut table, findings, "acceleration_mm_s2");
    let jerk = positive(&mut table, findings, "jerk_mm_s3");
    let stop_acceleration = stop_limit(&mut table, findings, "stop_acceleration_mm_s2", acceleration, 2.0);
    let stop_jerk = stop_limit(&mut table, findings, "stop_jerk_mm_s3", jerk, 4.0);
    let following = table.required::<f64>("following_error_mm");
    if let (Some(found), Some(velocity)) = (&following, velocity) {
        // What a joint covers in two cycles is lag of the bus, not of the drive.
        let least = 2.0 * velocity * f64::from(cycle_us) * 1e-6;
        let rule = format!("must be above {least} mm, the way of two cycles at full speed");
        check(findings, found, found.value.is_finite() && found.value > least, rule);
    }
    let homing = match table.table("homing") {
        Some(homing_table) => homing(homing_table, findings, travel.as_ref().map(|found| found.value)),
        None => {
            // Asking for the leaf reports that it is missing.
            table.required::<i64>("homing");
            None
        }
    };
    table.finish();
    let joint = Joint {
        node: usize::MAX,
        counts_per_unit: counts_per_unit?,
        travel_mm: travel?.value,
        limits: JointLimits {
            velocity_mm_s: velocity?,
            acceleration_mm_s2: acceleration?,
            jerk_mm_s3: jerk?,
        },
        stop: StopLimits {
            acceleration_mm_s2: stop_acceleration?,
            jerk_mm_s3: stop_jerk?,
        },
        following_error_mm: following?.value,
        homing: homing?,
    };
    Some((joint, node?))
}

/// A limit of stops; left out it is a multiple of that of the plan.
fn stop_limit(
    table: &mut Cursor<'_, '_>,
    findings: &Findings<'_>,
    key: &'static str,
    of_plan: Option<f64>,
    default_ratio: f64,
) -> Option<f64> {
    // Slowing down on the path while the plan uses all of its acceleration takes more than the plan has.
    const RATIO_MIN: f64 = 1.2;
    let Some(found) = table.optional::<f64>(key) else {
        return of_plan.map(|limit| limit * default_ratio);
    };
    if let Some(limit) = of_plan {
        let rule = format!("must be at least {RATIO_MIN} times the limit of the plan, {limit}");
        check(
            findings,
            &found,
            found.value.is_finite() && found.value >= RATIO_MIN * limit,
            rule,
        );
    }
    Some(found.value)
}

fn homing(mut table: Cursor<'_, '_>, findings: &Findings<'_>, travel_mm: Option<[f64; 2]>) -> Option<Homing> {
    let method = table.required::<i8>("method");
    if let Some(found) = &method {
        let known = matches!(found.value, 1..=14 | 17..=30 | 33 | 34 | 35 | 37);
        check(
            findings,
            found,
            known,
            format!("is no homing method of CiA 402; there are {HOMING_METHODS}"),
        );
    }
    let search = positive(&mut table, findings, "search_mm_s");
    let latch = positive(&mut table, findings, "latch_mm_s");
    let acceleration = positive(&mut table, findings, "acceleration_mm_s2");
    let position = table.optional::<f64>("position_mm");
    if let (Some(found), Some([low, high])) = (&position, travel_mm) {
        check(
            findings,
            found,
            (low..=high).contains(&found.value),
            "must lie within the travel of the joint",
        );
    }
    table.finish();
    Some(Homing {
        method: method?.value,
        search_mm_s: search?,
        latch_mm_s: latch?,
        acceleration_mm_s2: acceleration?,
        position_mm: position.map_or(0.0, |found| found.value),
    })
}

fn axes(tables: Vec<Cursor<'_, '_>>, findings: &Findings<'_>, joints: Option<usize>) -> Option<Vec<AxisMap>> {
    let count = tables.len();
    if count == 0 {
        findings.add(0..0, "axis", "", "a machine has at least one [[axis]]");
    }
    let mut axes: Vec<AxisMap> = Vec::new();
    let mut used = Vec::new();
    for mut table in tables {
        let letter = table.required::<String>("letter");
        let own_joints = table.required::<Vec<usize>>("joints");
        table.finish();
        let (Some(letter), Some(own_joints)) = (letter, own_joints) else {
            continue;
        };
        let mut letters = letter.value.chars();
        let axis = letters
            .next()
            .and_then(Axis::from_letter)
            .filter(|_| letters.next().is_none());
        check(findings, &letter, axis.is_some(), "must be one of X Y Z A B C U V W");
        let Some(axis) = axis else { continue };
        if axes.iter().any(|other| other.axis == axis) {
            findings.add(
                letter.span,
                &letter.key,
                &letter.value,
                "is the letter of another axis, too",
            );
        }
        check(
            findings,
            &own_joints,
            !own_joints.value.is_empty(),
            "an axis moves at least one joint",
        );
        for &joint in &own_joints.value {
            if let Some(joints) = joints {
                let rule = format!("joint {joint} does not exist; there are {joints}, counted from 0");
                check(findings, &own_joints, joint < joints, rule);
            }
            check(
                findings,
                &own_joints,
                !used.contains(&joint),
                format!("joint {joint} is moved by another axis, too"),
            );
            used.push(joint);
        }
        axes.push(AxisMap {
            axis,
            joints: own_joints.value,
        });
    }
    (axes.len() == count).then_some(axes)
}

fn offsets(table: Option<Cursor<'_, '_>>) -> [Position; 9] {
    const SYSTEMS: [&str; 9] = ["g54", "g55", "g56", "g57", "g58", "g59", "g59_1", "g59_2", "g59_3"];
    const LETTERS: [&str; 9] = ["x", "y", "z", "a", "b", "c", "u", "v", "w"];
    let mut origins = [Position::ZERO; 9];
    let Some(mut table) = table else { return origins };
    for (origin, system) in origins.iter_mut().zip(SYSTEMS) {
        let Some(mut system) = table.table(system) else {
            continue;
        };
        for (coordinate, letter) in origin.0.iter_mut().zip(LETTERS) {
            if let Some(found) = system.optional::<f64>(letter) {
                *coordinate = found.value;
            }
        }
        system.finish();
    }
    table.finish();
    origins
}

fn spindle(table: Option<Cursor<'_, '_>>, findings: &Findings<'_>) -> Option<Spindle> {
    let Some(mut table) = table else {
        return Some(Spindle { rpm_max: 24_000.0 });
    };
    let rpm_max = positive(&mut table, findings, "rpm_max");
    table.finish();
    Some(Spindle { rpm_max: rpm_max? })
}

fn program(table: Option<Cursor<'_, '_>>, findings: &Findings<'_>) -> Option<Program> {
    let default = Program {
        tolerance_mm: 0.01,
        look_ahead_blocks: 1000,
    };
    let Some(mut table) = table else { return Some(default) };
    let tolerance_mm = number(
        &mut table,
        findings,
        "tolerance_mm",
        Some(default.tolerance_mm),
        0.0001..=10.0,
    );
    let look_ahead = number(
        &mut table,
        findings,
        "look_ahead_blocks",
        Some(default.look_ahead_blocks),
        1..=100_000,
    );
    table.finish();
    Some(Program {
        tolerance_mm: tolerance_mm?,
        look_ahead_blocks: look_ahead?,
    })
}

fn nets(table: Option<Cursor<'_, '_>>, findings: &Findings<'_>) -> Vec<Net> {
    let Some(mut table) = table else { return Vec::new() };
    let mut nets: Vec<Net> = Vec::new();
    for mut table in table.tables("net") {
        let name = table.required::<String>("name");
        let source = table.required::<String>("source");
        let targets = table.required::<Vec<String>>("targets");
        table.finish();
        let (Some(name), Some(source), Some(targets)) = (name, source, targets) else {
            continue;
        };
        if nets.iter().any(|other| other.name == name.value) {
            findings.add(name.span, &name.key, &name.value, "is the name of another net, too");
        }
        nets.push(Net {
            name: name.value,
            source: source.value,
            targets: targets.value,
        });
    }
    table.refuse_unsupported(&["components", "functions"]);
    table.finish();
    nets
}

fn sim(table: Option<Cursor<'_, '_>>, findings: &Findings<'_>) -> Option<Sim> {
    let default = Sim {
        natural_frequency_hz: 60.0,
        damping: 0.8,
        start: 0.4,
    };
    let Some(mut table) = table else { return Some(default) };
    let frequency = number(
        &mut table,
        findings,
        "natural_frequency_hz",
        Some(default.natural_frequency_hz),
        1.0..=500.0,
    );
    let damping = number(&mut table, findings, "damping", Some(default.damping), 0.1..=10.0);
    let start = number(&mut table, findings, "start", Some(default.start), 0.0..=1.0);
    table.finish();
    Some(Sim {
        natural_frequency_hz: frequency?,
        damping: damping?,
        start: start?,
    })
}

/// A number within a range; left out it is the default, without one it must be there.
fn number<T: DeserializeOwned + PartialOrd + Display>(
    table: &mut Cursor<'_, '_>,
    findings: &Findings<'_>,
    key: &'static str,
    default: Option<T>,
    range: std::ops::RangeInclusive<T>,
) -> Option<T> {
    let found = match default {
        Some(default) => match table.optional_or_error::<T>(key) {
            Ok(None) => return Some(default),
            Ok(Some(found)) => found,
            Err(()) => return None,
        },
        None => table.required::<T>(key)?,
    };
    let rule = format!("must be {} to {}", range.start(), range.end());
    check(findings, &found, range.contains(&found.value), rule);
    Some(found.value)
}

/// A finite number above 0 that must be there.
fn positive(table: &mut Cursor<'_, '_>, findings: &Findings<'_>, key: &'static str) -> Option<f64> {
    let found = table.required::<f64>(key)?;
    check(
        findings,
        &found,
        found.value.is_finite() && found.value > 0.0,
        "must be above 0",
    );
    Some(found.value)
}

fn check<T>(findings: &Findings<'_>, found: &Located<T>, good: bool, rule: impl Into<String>) {
    if !good {
        findings.add_found(found, rule);
    }
}
