//! The machine file: TOML to a checked [`Config`], or located errors.
//!
//! In:  a TOML file (`configs/mill3-demo.toml` names every key but those of other machines: `configs/*-demo.toml`).
//! Out: a [`Config`], which is always a machine that may run, or [`ConfigErrors`] with *every* error of the file, each
//! with line, column, key path, value and the rule that it breaks. Where the text is no TOML at all, only the errors
//! of its syntax are told.
//!
//! To add a key: a field in `types.rs`, a line in the reader of its section (`bus.rs`, `node.rs`, `joints.rs`, `spindle.rs` or here), a row in
//! `tests.rs`.
//!
//! | to learn | file |
//! |---|---|
//! | the checked description; nothing after it checks again | `types.rs`, the bus and its nodes in `bus_types.rs` |
//! | how each error is noted with its place | `document.rs`, `error.rs` |
//! | what is known of a kind of drive (`drives/`): defaults and limits of nodes and joints, what is read back while the node boots, how its simulated one is built | `drive_profile.rs` |
//! | in which units a drive counts: written and compared by `bus`, computed with by the simulated drive alone | `factor_group.rs` |
//! | channels of I/O nodes by type, name and unit | `channels.rs` |
//! | programs in Structured Text | `logics.rs` |
//! | kinematics | `kinematics.rs`, their meaning in `motion::kinematics` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod analog;
mod bus;
mod bus_types;
mod cell;
mod channels;
mod compensation;
mod components;
mod device;
mod document;
mod drive;
mod drive_profile;
mod error;
mod ethercat;
mod external;
mod factor_group;
mod homing;
mod joints;
mod keys;
mod kinematics;
mod logics;
mod mapping;
mod node;
mod panel;
mod period;
mod position_loop;
mod powerlink;
mod program;
mod remap;
mod sim;
mod spindle;
mod steps;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_analog;
#[cfg(test)]
mod tests_channels;
#[cfg(test)]
mod tests_components;
#[cfg(test)]
mod tests_devices;
#[cfg(test)]
mod tests_ethercat;
#[cfg(test)]
mod tests_homing;
#[cfg(test)]
mod tests_kinematics;
#[cfg(test)]
mod tests_logics;
#[cfg(test)]
mod tests_program;
#[cfg(test)]
mod tests_spindle;
#[cfg(test)]
mod tests_steps;
mod types;

pub use analog::AnalogOutput;
pub use bus::{is_name, wire_time_ns};
pub use cell::{Cell, Remote};
pub use document::{Bound, Question};
#[cfg(feature = "testing")]
pub use drive_profile::questions as drive_profile_questions;
pub use drive_profile::{BUILT_IN as DRIVE_PROFILES, parse as parse_drive_profile};
pub use error::{ConfigError, ConfigErrors};
pub use ethercat::assigned as esi_assigned;
pub use logics::{End, Interface, LogicPin, LogicTask, pin_type};
pub use panel::{Encryption, OnLostControl, PANEL_PORT, Panel};
pub use position_loop::GAIN_MAX;
pub use steps::{PARALLEL_PINS, SUBSTEPS, SimStepper, StepKind, StepOutput, StepPortKind, Steps, rate_max_hz};
pub use types::*;

use document::{Log, Section};
use files::read::TEXT_MAX;
use hal_pins::HalError;
use kinematics::Family;
use motion::canon::LengthUnit;
use motion::plan::PlannerKind;
use std::path::{Path, PathBuf};
use toml::de::DeTable;

/// Reads and checks a machine file.
///
/// # Errors
/// The file cannot be read, or every error in it.
pub fn read(path: &Path) -> Result<Config, ConfigErrors> {
    match files::read(path, TEXT_MAX) {
        Ok(bytes) => parse(&bytes, path),
        Err(error) => {
            let rule = format!("cannot be read: {error}");
            let error = ConfigError::whole(&path.display().to_string(), rule);
            Err(ConfigErrors::new(vec![error], 0))
        }
    }
}

/// As [`read`], as if the file said `cycle_us` for the cycle of its machine.
///
/// # Errors
/// As [`read`].
pub fn read_with_cycle(path: &Path, cycle_us: Option<u32>) -> Result<Config, ConfigErrors> {
    match (files::read_text(path, TEXT_MAX), cycle_us) {
        (Ok(text), Some(cycle_us)) => parse(&period::with_cycle_us(&text, cycle_us), path),
        // What cannot be read, or is no text, says so there.
        (Ok(_) | Err(_), _) => read(path),
    }
}

/// Checks the text of a machine file; `path` is for messages, and device files are looked for beside it.
///
/// # Errors
/// Every error in the text.
pub fn parse(text: &(impl AsRef<[u8]> + ?Sized), path: &Path) -> Result<Config, ConfigErrors> {
    let file = path.display().to_string();
    let text = files::without_mark(text.as_ref());
    let text = match std::str::from_utf8(text) {
        Ok(text) => text,
        Err(error) => {
            // A place can only be told in the part that is text.
            let valid = &text[..error.valid_up_to()];
            let valid = std::str::from_utf8(valid).unwrap_or_default();
            let rule = "must be UTF-8 text".to_owned();
            let lines = error::lines(valid);
            let error = ConfigError::at(&file, (valid, &lines), valid.len()..valid.len(), String::new(), rule);
            return Err(ConfigErrors::new(vec![error], 0));
        }
    };
    let log = Log::new(&file, text);
    let (document, syntax) = DeTable::parse_recoverable(text);
    for error in &syntax {
        let span = error.span().unwrap_or(text.len()..text.len());
        log.misplaced(span, "", error.message(), None);
    }
    let config = if syntax.is_empty() {
        machine_file(&log, document.get_ref(), path)
    } else {
        None
    };
    let (errors, more) = log.into_errors();
    match config {
        Some(config) if errors.is_empty() => Ok(config),
        // A value is only ever left out with an error; should that fail, the machine must still be refused.
        _ if errors.is_empty() => {
            let rule = "is refused for a reason that was lost".to_owned();
            Err(ConfigErrors::new(vec![ConfigError::whole(&file, rule)], 0))
        }
        _ => Err(ConfigErrors::new(errors, more)),
    }
}

/// What the readers ask of each key while they read this text, which may be wrong; `path` as in [`parse`]. Keys that come twice
/// are asked twice.
#[cfg(feature = "testing")]
pub fn questions(text: &str, path: &Path) -> Vec<(String, Question)> {
    let log = Log::new("", text);
    let (document, _) = DeTable::parse_recoverable(text);
    machine_file(&log, document.get_ref(), path);
    log.into_questions()
}

/// Whether the planner that is chosen suits the kinematics: once more where it has been changed.
///
/// # Errors
/// Why it does not.
pub fn check_planner(config: &Config) -> Result<(), &'static str> {
    let tip = motion::kinematics::ToolFrame {
        tcp: true,
        ..motion::kinematics::ToolFrame::OFF
    };
    match config.program.planner {
        PlannerKind::Classic if !config.kinematics().is_linear(&tip) => Err(program::CLASSIC_IS_LINEAR),
        PlannerKind::Classic | PlannerKind::Optimal => Ok(()),
    }
}

/// A mistake in `[bus]` that only the bus itself can see, at the place of `key` in the machine file.
pub fn bus_error(config: &Config, key: &str, rule: String) -> ConfigErrors {
    let file = config.path.display().to_string();
    let text = files::read_text(&config.path, TEXT_MAX).unwrap_or_default();
    let (document, _) = DeTable::parse_recoverable(&text);
    let bus = document.get_ref().get("bus").and_then(|bus| bus.get_ref().as_table());
    let path = format!("bus.{key}");
    match bus.and_then(|bus| bus.get(key)) {
        Some(value) => {
            let log = Log::new(&file, &text);
            log.misplaced(value.span(), &path, rule, None);
            let (errors, more) = log.into_errors();
            ConfigErrors::new(errors, more)
        }
        // The file is not the one any more that was read.
        None => ConfigErrors::new(vec![ConfigError::whole(&file, format!("{path}: {rule}"))], 0),
    }
}

/// Mistakes in nets that show only where the pins are there, at their places in the machine file: number of the net, and why.
pub fn net_errors(config: &Config, refused: &[(usize, HalError)]) -> ConfigErrors {
    let file = config.path.display().to_string();
    let text = files::read_text(&config.path, TEXT_MAX).unwrap_or_default();
    let (document, _) = DeTable::parse_recoverable(&text);
    let hal = document.get_ref().get("hal").and_then(|hal| hal.get_ref().as_table());
    let tables = hal.and_then(|hal| hal.get("net")?.get_ref().as_array());
    let log = Log::new(&file, &text);
    let mut elsewhere = Vec::new();
    for (number, error) in refused {
        let net = &config.nets[*number];
        let table = tables.and_then(|tables| tables.get(*number)?.get_ref().as_table());
        let target = net
            .targets
            .iter()
            .position(|target| Some(target.as_str()) == error.pin());
        let is_source = Some(net.source.as_str()) == error.pin();
        let (key, value) = match target {
            Some(target) => {
                let targets = table.and_then(|table| table.get("targets")?.get_ref().as_array());
                (
                    format!("targets[{target}]"),
                    targets.and_then(|targets| targets.get(target)),
                )
            }
            None => {
                let key = if is_source { "source" } else { "name" };
                (key.to_owned(), table.and_then(|table| table.get(key)))
            }
        };
        let key = format!("hal.net[{number}].{key}");
        match value {
            Some(value) => log.wrong(value.span(), &key, error.to_string(), None),
            // The file is not the one any more that was read.
            None => elsewhere.push(ConfigError::whole(&file, format!("{key}: {error}"))),
        }
    }
    let (mut errors, more) = log.into_errors();
    errors.append(&mut elsewhere);
    ConfigErrors::new(errors, more)
}

/// A component whose pins cannot be made, at the place of its name in the machine file; `kind`: `component` or `external`.
pub fn component_error(config: &Config, kind: &str, number: usize, error: &HalError) -> ConfigErrors {
    let file = config.path.display().to_string();
    let text = files::read_text(&config.path, TEXT_MAX).unwrap_or_default();
    let (document, _) = DeTable::parse_recoverable(&text);
    let hal = document.get_ref().get("hal").and_then(|hal| hal.get_ref().as_table());
    let tables = hal.and_then(|hal| hal.get(kind)?.get_ref().as_array());
    let table = tables.and_then(|tables| tables.get(number)?.get_ref().as_table());
    let key = format!("hal.{kind}[{number}].name");
    let log = Log::new(&file, &text);
    match table.and_then(|table| table.get("name")) {
        Some(value) => log.wrong(value.span(), &key, error.to_string(), None),
        // The file is not the one any more that was read.
        None => return ConfigErrors::new(vec![ConfigError::whole(&file, format!("{key}: {error}"))], 0),
    }
    let (errors, more) = log.into_errors();
    ConfigErrors::new(errors, more)
}

/// A program whose pins cannot be had, at the place of its file in the machine file.
pub fn logic_error(config: &Config, number: usize, rule: &str) -> ConfigErrors {
    let file = config.path.display().to_string();
    let text = files::read_text(&config.path, TEXT_MAX).unwrap_or_default();
    let (document, _) = DeTable::parse_recoverable(&text);
    let tables = document
        .get_ref()
        .get("logic")
        .and_then(|logic| logic.get_ref().as_array());
    let table = tables.and_then(|tables| tables.get(number)?.get_ref().as_table());
    let key = format!("logic[{number}].file");
    let log = Log::new(&file, &text);
    match table.and_then(|table| table.get("file")) {
        Some(value) => log.wrong(value.span(), &key, rule, None),
        // The file is not the one any more that was read.
        None => return ConfigErrors::new(vec![ConfigError::whole(&file, format!("{key}: {rule}"))], 0),
    }
    let (errors, more) = log.into_errors();
    ConfigErrors::new(errors, more)
}

/// Sections in an order in which each can be checked against those before.
fn machine_file<'d>(log: &Log<'d>, table: &DeTable<'d>, path: &Path) -> Option<Config> {
    let mut root = Section::root(log, table);
    root.integer("schema", 1..=1, None);

    let base = path.parent().unwrap_or(Path::new(""));
    let machine = root.section("machine").map(|section| machine(section, base));
    let (name, family, cycle_us, unit, state_directory, probe_stops_jog) = machine.unwrap_or_default();
    let rt = root.section("rt").and_then(|section| rt(section, cycle_us));
    let uses = drive::uses(table);
    let bus = root.section("bus").and_then(|mut section| {
        let folder = path.parent().unwrap_or(Path::new(""));
        let bus = bus::bus(&mut section, cycle_us, folder, &uses);
        section.done();
        bus
    });

    let has_steps = root.has("steps");
    let steps = root
        .optional_section("steps")
        .and_then(|section| steps::steps(section, rt.as_ref().map(|rt| rt.timeout_us), cycle_us));
    let around = joints::Surroundings {
        nodes: bus.as_ref().map(|bus| bus.nodes.as_slice()),
        cycle_us,
        folder: path.parent().unwrap_or(Path::new("")),
        has_steps,
    };
    let mut taken = joints::Taken::default();
    taken.steps = steps;
    // To be said, so that a file that ends too soon is no machine.
    let is_still = family == Some(Family::None);
    let tables = match is_still {
        true => no_tables(&mut root, "joint"),
        false => root.some_sections("joint"),
    };
    let count = tables.len();
    if count > JOINTS_MAX {
        root.wrong(
            "joint",
            format!("must not be more than {JOINTS_MAX} joints, are {count}"),
        );
    }
    let mut joints = Vec::new();
    for mut section in tables {
        joints.extend(joints::joint(&mut section, &around, &mut taken));
        section.done();
    }
    let follows = family.is_none_or(Family::follows);
    let axes = match is_still {
        true => no_tables(&mut root, "axis").is_empty().then(Vec::new),
        false => joints::axes(&mut root, count, follows),
    };
    let mut transform = root.section("kinematics").and_then(|mut section| {
        let transform = kinematics::transform(&mut section, family?);
        section.done();
        transform
    });
    if let (Some(transform), Some(axes), true) = (&mut transform, &axes, joints.len() == count)
        && !kinematics::fit(&root, transform, axes, &joints)
    {
        return None;
    }
    let touch_probes = joints.iter().filter(|joint| joint.touch_probe.is_some()).count();
    if touch_probes != 0 && touch_probes != joints.len() {
        root.wrong(
            "joint",
            "touch_probe must stand at all joints or at none: where the tool was at a contact takes all of them",
        );
    }
    let work_offsets = joints::offsets(&mut root, axes.as_deref());
    let nodes = bus.as_ref().map(|bus| bus.nodes.as_slice());
    let spindle = root
        .section("spindle")
        .and_then(|section| spindle::spindle(section, nodes, &joints));
    let base = path.parent().unwrap_or(Path::new(""));
    let program = root.section("program").and_then(|mut section| {
        let program = program::program(&mut section, base);
        let classic = program
            .as_ref()
            .is_some_and(|program| program.planner == PlannerKind::Classic);
        if classic && !family.is_none_or(Family::is_linear) {
            section.wrong("planner", program::CLASSIC_IS_LINEAR);
        }
        section.done();
        program
    });
    let tools = root.section("tools").and_then(|mut section| {
        let tools = program::tools(&mut section, base);
        section.done();
        tools
    });
    let hal = root.section("hal").and_then(hal);
    let nets = hal.as_ref().map(|(nets, ..)| nets);
    let all_joints = (joints.len() == count).then_some(joints.as_slice());
    if let (Some(joints), Some(axes), Some(transform), Some(nodes), Some(nets)) =
        (all_joints, &axes, &transform, nodes, nets)
    {
        homing::fit(&mut root, joints, axes, transform, nodes, nets);
    }
    let sim = root
        .section("sim")
        .and_then(|section| sim::sim(section, nodes, all_joints));
    let mains = root.section("mains").and_then(mains);
    let estop_category = root.section("estop").and_then(estop_category);
    if taken
        .steps
        .as_ref()
        .is_some_and(|_| joints.iter().all(|joint| joint.step.is_none()))
    {
        root.wrong("steps", "is used by no joint: one with output = \"step\"");
    }
    let priority = rt.as_ref().map(|rt| rt.priority);
    let logics = logics::logics(&mut root, base, cycle_us, priority);
    if let (Some(logics), Some((nets, components, _))) = (&logics, &hal) {
        logics::keep_fast_inputs(&root, logics, nets, components);
    }
    let folder = state_directory.as_ref().and_then(|folder| folder.as_deref());
    let panel = match root.optional_section("panel") {
        None => Some(None),
        Some(section) => panel::panel(section, base, folder).map(Some),
    };
    let cell = match root.optional_section("cell") {
        None => Some(None),
        Some(section) => cell::cell(section, base, folder).map(Some),
    };
    root.done();

    let (nets, components, external) = hal?;
    Some(Config {
        path: path.to_owned(),
        name: name?,
        cycle_us: cycle_us?,
        state_directory: state_directory?,
        probe_stops_jog: probe_stops_jog?,
        unit: unit?,
        rt: rt?,
        bus: bus?,
        steps: match has_steps {
            true => Some(taken.steps?.into_steps()),
            false => None,
        },
        transform: transform?,
        joints: (joints.len() == count).then_some(joints)?,
        axes: axes?,
        work_offsets: work_offsets?,
        spindle: spindle?,
        program: program?,
        tools: tools?,
        mains: mains?,
        estop_category: estop_category?,
        nets,
        components,
        logics: logics?,
        external,
        sim: sim?,
        panel: panel?,
        cell: cell?,
    })
}

/// Tables that a machine of inputs and outputs does not have.
fn no_tables<'d, 'l>(root: &mut Section<'d, 'l>, key: &'static str) -> Vec<Section<'d, 'l>> {
    if root.optional(key).is_some() {
        root.wrong(key, "cannot be: machine.kinematics is \"none\"");
    }
    Vec::new()
}

/// Name, kinematics, cycle, unit and state folder.
type Machine = (
    Option<String>,
    Option<Family>,
    Option<u32>,
    Option<LengthUnit>,
    Option<Option<PathBuf>>,
    Option<bool>,
);

fn machine(mut section: Section<'_, '_>, base: &Path) -> Machine {
    let name = section
        .required("name", "the name of the machine")
        .and_then(|item| item.text("machine.name"));
    if name.is_some_and(|name| !bus::is_name(name)) {
        section.wrong("name", bus::NAME_RULE);
    }
    let family = section.word("kinematics", &Family::WORDS, Family::Trivial);
    let cycle_us = section
        .integer("cycle_us", 125..=10_000, 1000)
        .map(|cycle_us| cycle_us as u32);
    // 60C2 tells a drive its cycle as an octet and a power of ten.
    let in_60c2 = |cycle_us: &u32| {
        [1_u32, 10, 100]
            .into_iter()
            .any(|unit| cycle_us.is_multiple_of(unit) && cycle_us / unit <= 255)
    };
    if cycle_us.is_some_and(|cycle_us| !in_60c2(&cycle_us)) {
        section.wrong(
            "cycle_us",
            "must be a time that a drive can be told: above 255 whole tens, above 2550 whole hundreds",
        );
    }
    let unit = program::units(&mut section);
    let state_directory = program::new_folder(&mut section, "state_directory", base);
    let probe_stops_jog = section.flag("probe_stops_jog", true);
    section.done();
    (
        name.map(str::to_owned),
        family,
        cycle_us,
        unit,
        state_directory,
        probe_stops_jog,
    )
}

fn rt(mut section: Section<'_, '_>, cycle_us: Option<u32>) -> Option<Rt> {
    let cycle_us = i64::from(cycle_us.unwrap_or(10_000));
    /// More cores than any kernel is built for.
    const CPU_MAX: i64 = 8191;
    let defaults = Rt::default();
    let cpu = section.optional_integer("cpu", 0..=CPU_MAX);
    let priority = section.integer("priority", 1..=96, i64::from(defaults.priority));
    let timeout_us = section.integer("timeout_us", 20..=cycle_us, i64::from(defaults.timeout_us));
    let phase_us = section.optional_integer("phase_us", 0..=cycle_us - 1);
    // A thread that spins all the time is stopped for 50 ms in each second (throttling, fair server): half is far below.
    let spin_us = section.optional_integer("spin_us", 0..=cycle_us / 2);
    let keep_awake = section.optional_word(
        "keep_awake",
        &[
            KeepAwake::DmaLatency,
            KeepAwake::IdleThread,
            KeepAwake::Ticks,
            KeepAwake::None,
        ]
        .map(|choice| (choice.name(), choice)),
    );
    let calibrate = section.flag("calibrate", defaults.calibrate);
    let late_max_us = section.optional_integer("late_us_max", 1..=cycle_us / 2);
    let overruns_warn = section.integer("overruns_warn", 0..=1000, i64::from(defaults.overruns_warn));
    let overruns_stop = section.integer("overruns_stop", 0..=1000, i64::from(defaults.overruns_stop));
    let lock_memory = section.flag("lock_memory", defaults.lock_memory);
    let require = section.word(
        "require",
        &[("strict", Require::Strict), ("warn", Require::Warn)],
        defaults.require,
    );
    section.done();
    Some(Rt {
        cpu: cpu?.map(|cpu| cpu as usize),
        priority: priority? as u8,
        timeout_us: timeout_us? as u32,
        phase_us: phase_us?.map(|phase_us| phase_us as u32),
        spin_us: spin_us?.map(|spin_us| spin_us as u32),
        keep_awake: keep_awake?,
        calibrate: calibrate?,
        late_max_us: late_max_us?.map(|late_us| late_us as u32),
        overruns_warn: overruns_warn? as u32,
        overruns_stop: overruns_stop? as u32,
        lock_memory: lock_memory?,
        require: require?,
    })
}

fn estop_category(mut section: Section<'_, '_>) -> Option<StopCategory> {
    let category = section.integer("category", 0..=1, 1);
    section.done();
    category.map(|category| match category {
        0 => StopCategory::Zero,
        _ => StopCategory::One,
    })
}

fn mains(mut section: Section<'_, '_>) -> Option<Mains> {
    let defaults = Mains::default();
    let retract_axis = match section.has("retract_axis") {
        true => joints::letter(&mut section, "retract_axis"),
        false => Some(defaults.retract_axis),
    };
    let retract_mm = section.number("retract_mm", Bound::Within(-1000.0, 1000.0), defaults.retract_mm);
    section.done();
    Some(Mains {
        retract_axis: retract_axis?,
        retract_mm: retract_mm?,
    })
}

/// `[[hal.net]]`, `[[hal.component]]`, `[[hal.external]]`; whether the pins exist that nets name is found out when the pins do.
fn hal(mut section: Section<'_, '_>) -> Option<(Vec<Net>, Vec<Component>, Vec<External>)> {
    let mut nets: Vec<Net> = Vec::new();
    let mut complete = true;
    for mut table in section.sections("net") {
        match net(&mut table, &nets) {
            Some(net) => nets.push(net),
            None => complete = false,
        }
        table.done();
    }
    let components = components::components(&mut section, &nets);
    let external = external::external(&mut section, &nets);
    section.done();
    complete.then_some((nets, components?, external?))
}

const PIN_RULE: &str = "must be a name of lower-case letters, digits, dashes and dots, like \"joint.0.f-error\"";

/// Whether a text has the form of a pin's or signal's name.
fn is_pin(text: &str) -> bool {
    text.len() <= 63
        && text.split('.').all(|level| {
            level.starts_with(|first: char| first.is_ascii_lowercase() || first.is_ascii_digit())
                && level
                    .bytes()
                    .all(|octet| octet.is_ascii_lowercase() || octet.is_ascii_digit() || octet == b'-')
        })
}

fn net(section: &mut Section<'_, '_>, before: &[Net]) -> Option<Net> {
    let mut valid = true;
    let mut pin = |section: &mut Section<'_, '_>, key: &'static str, what| {
        let text = section.required(key, what)?.text(&section.key(key))?;
        if !is_pin(text) {
            section.wrong(key, PIN_RULE);
            valid = false;
        }
        Some(text.to_owned())
    };
    let name = pin(section, "name", "the name of the signal");
    let source = pin(section, "source", "the pin that writes the signal");
    if name
        .as_ref()
        .is_some_and(|name| before.iter().any(|net| net.name == *name))
    {
        section.wrong("name", "is taken by a net above");
        valid = false;
    }
    let path = section.key("targets");
    let items = section
        .required("targets", "the pins that read the signal")
        .and_then(|item| item.items(&path))?;
    if items.is_empty() {
        section.wrong("targets", "must name at least one pin");
        valid = false;
    }
    let mut targets: Vec<String> = Vec::new();
    for (index, item) in items.into_iter().enumerate() {
        let key = format!("{path}[{index}]");
        let Some(target) = item.text(&key) else {
            valid = false;
            continue;
        };
        let rule = if !is_pin(target) {
            PIN_RULE
        } else if source.as_deref() == Some(target) {
            "cannot read itself"
        } else if targets
            .iter()
            .chain(before.iter().flat_map(|net| &net.targets))
            .any(|other| other == target)
        {
            "is written by a net already: a pin has one writer"
        } else {
            targets.push(target.to_owned());
            continue;
        };
        item.log.wrong(item.value.span(), &key, rule, None);
        valid = false;
    }
    if !valid {
        return None;
    }
    Some(Net {
        name: name?,
        source: source?,
        targets,
    })
}
