//! `[[logic]]`: programs in Structured Text that run beside the cycle.
//!
//! In:  the file of a program, the pins that its variables are bound to.
//! Out: the compiled program and its pins; errors of the program at the line of the machine file that names it, with their own
//! places in the program.
//!
//! What has to act in the cycle in which it is read (emergency stop chain, limit and home switches, probe) is refused as an output
//! of a program: it would come up to a period late.

use super::components::Component;
use super::document::Scalar;
use super::error::nearest;
use super::net::{Net, PIN_RULE, is_pin};
use super::question::Bound;
use super::section::Section;
use files::read::TEXT_MAX;
use hal_pins::Type;
use logic::{Logic, Role, Value, Variable};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Programs that a machine has at the most: each one has a thread.
const LOGICS_MAX: usize = 8;
/// Mistakes of a program that are told.
const MISTAKES_TOLD: usize = 10;

/// `[[logic]]`
#[derive(Clone, Debug, PartialEq)]
pub struct LogicTask {
    /// Its name, in those of its pins.
    pub name: String,
    pub file: PathBuf,
    /// Cycles from one scan to the next.
    pub every: u64,
    pub logic: Arc<Logic>,
    pub interface: Interface,
    /// Pins of variables at %I and %Q.
    pub addresses: Vec<(String, String)>,
    /// Text outputs that are alarms.
    pub alarms: Vec<String>,
    /// What outputs have where the program has failed: names of variables and values, else 0.
    pub safe: Vec<(String, i64)>,
    /// What goes wrong in a scan is a warning, and the outputs of the scan count.
    pub goes_on: bool,
    /// Scans in a row that were not over when the next one was due, at which it stands; 0: never.
    pub overruns_stop: u32,
    /// Share of its period that the longest scan may take.
    pub share_max: f64,
}

/// What a program reads and writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Interface {
    pub inputs: Vec<LogicPin>,
    pub outputs: Vec<LogicPin>,
}

/// A variable and where it goes.
#[derive(Clone, Debug, PartialEq)]
pub struct LogicPin {
    pub variable: Variable,
    pub end: End,
}

/// The other end of a variable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// A pin of its own.
    Own { pin: String, kind: Type },
    /// A pin of something else; an output writes it by a pin of its own and a net.
    Elsewhere { pin: String, own: String, kind: Type },
    /// What it says is told the operator, and stops the machine if it is an alarm.
    Operator { is_alarm: bool },
}

impl LogicTask {
    /// What a safe value is as a slot.
    pub fn safe_value(&self, name: &str) -> i64 {
        let safe = self.safe.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
        safe.map_or(0, |(_, value)| *value)
    }

    /// What a changed program would read and write.
    ///
    /// # Errors
    /// Why a variable can have no pin.
    pub fn interface_of(&self, logic: &Logic) -> Result<Interface, String> {
        interface(&self.name, logic, &self.addresses, &self.alarms)
    }
}

/// Type of the pin of a variable; `None`: no pin has texts.
pub fn pin_type(variable: &Variable) -> Option<Type> {
    use logic::Scalar::*;
    Some(match variable.scalar() {
        Some(Bool) => Type::Bit,
        Some(Sint | Int | Dint) | None => Type::S32,
        Some(Usint | Uint | Udint | Byte | Word | Dword) => Type::U32,
        Some(Lint) => Type::S64,
        Some(Ulint | Lword) => Type::U64,
        Some(Real | Lreal | Time) => Type::Float,
        Some(String) => return None,
    })
}

/// Name of the pin of a variable: `door_open` is `door-open`, `pocket[3].tool` is `pocket.3.tool`.
fn pin_name(task: &str, variable: &str) -> String {
    let levels = variable.to_ascii_lowercase().replace(']', "");
    format!("logic.{task}.{}", levels.replace('_', "-").replace(['[', ','], "."))
}

fn interface(
    task: &str,
    logic: &Logic,
    addresses: &[(String, String)],
    alarms: &[String],
) -> Result<Interface, String> {
    let end = |variable: &Variable| -> Result<End, String> {
        let name = logic.name(variable);
        let told = |rule: String| format!("line {}: {name}: {rule}", variable.line);
        let Some(kind) = pin_type(variable) else {
            let is_alarm = alarms.iter().any(|alarm| alarm.eq_ignore_ascii_case(&name));
            return match variable.role {
                Role::Output => Ok(End::Operator { is_alarm }),
                Role::Input | Role::Internal => Err(told("a STRING is no input: pins have no texts".into())),
            };
        };
        let own = pin_name(task, &name);
        if !is_pin(&own) {
            return Err(told(format!("its pin would be \"{own}\", which {PIN_RULE}")));
        }
        let pin = match variable.address.as_deref() {
            None => return Ok(End::Own { pin: own, kind }),
            Some(address) if address.starts_with('%') => {
                let bound = addresses.iter().find(|(known, _)| is_same_address(known, address));
                let what = || {
                    told(format!(
                        "{address} is bound to no pin: say at = {{ \"{address}\" = \"..\" }} here"
                    ))
                };
                bound.map(|(_, pin)| pin.clone()).ok_or_else(what)?
            }
            Some(pin) => pin.to_owned(),
        };
        if !is_pin(&pin) {
            return Err(told(format!("{pin:?} {PIN_RULE}")));
        }
        Ok(End::Elsewhere { pin, own, kind })
    };
    let all = |role: Role| -> Result<Vec<LogicPin>, String> {
        let of_role = logic.all_variables().filter(|variable| variable.role == role);
        let pins = of_role.map(|variable| {
            let end = end(variable)?;
            Ok(LogicPin {
                variable: variable.clone(),
                end,
            })
        });
        pins.collect()
    };
    Ok(Interface {
        inputs: all(Role::Input)?,
        outputs: all(Role::Output)?,
    })
}

/// `%IX0.0` and `%I0.0` are the same bit, in any case of the letters.
fn is_same_address(one: &str, other: &str) -> bool {
    let plain = |address: &str| {
        let address = address.to_ascii_uppercase();
        match address.get(2..) {
            Some(bit) if bit.starts_with(|first: char| first.is_ascii_digit()) => {
                format!("{}X{bit}", &address[..2])
            }
            _ => address,
        }
    };
    plain(one) == plain(other)
}

/// Reads them all; `None` where one is wrong. `priority`: that of the cycle thread.
pub(super) fn logics(
    root: &mut Section<'_, '_>,
    folder: &Path,
    cycle_us: Option<u32>,
    priority: Option<u8>,
) -> Option<Vec<LogicTask>> {
    let mut tasks: Vec<LogicTask> = Vec::new();
    let sections = root.sections("logic");
    let count = sections.len();
    if count > LOGICS_MAX {
        let rule = format!("must not be more than {LOGICS_MAX} programs, are {count}");
        root.wrong("logic", rule);
    }
    if let Some(priority) = priority.filter(|priority| usize::from(*priority) <= count) {
        let rule = format!("runs below the cycle thread: rt.priority must be above {count}, is {priority}");
        root.wrong("logic", rule);
    }
    for section in sections {
        let task = section.whole(|section| task(section, folder, cycle_us, &tasks));
        tasks.extend(task);
    }
    (tasks.len() == count && count <= LOGICS_MAX).then_some(tasks)
}

fn task(section: &mut Section<'_, '_>, folder: &Path, cycle_us: Option<u32>, above: &[LogicTask]) -> Option<LogicTask> {
    let file = section
        .text("file", "a file of Structured Text")
        .map(|file| folder.join(file));
    let name = name(section, file.as_deref(), above);
    let every = period(section, cycle_us);
    let goes_on = section.word("on_error", &[("safe", false), ("continue", true)], false);
    let overruns_stop = section.integer("overruns_stop", 0..=1000, 3);
    let share = section.number("budget_percent", Bound::Within(1.0, 90.0), 50.0);
    let logic = file.as_deref().and_then(|file| compile(section, file));
    let addresses = addresses(section);
    let alarms = alarms(section, logic.as_deref());
    let safe = section.section("safe");
    let (file, name, logic, addresses, alarms) = (file?, name?, logic?, addresses?, alarms?);
    let safe = self::safe(safe?, &logic);
    let interface = match interface(&name, &logic, &addresses, &alarms) {
        Ok(interface) => interface,
        Err(rule) => {
            return section.refused("file", format!("{}: {rule}", file.display()));
        }
    };
    Some(LogicTask {
        name,
        file,
        every: every?,
        logic,
        interface,
        addresses,
        alarms,
        safe: safe?,
        goes_on: goes_on?,
        overruns_stop: overruns_stop?,
        share_max: share? / 100.0,
    })
}

/// What it is called, by its file if nothing else is said.
fn name(section: &mut Section<'_, '_>, file: Option<&Path>, above: &[LogicTask]) -> Option<String> {
    let name = match section.optional_text("name")? {
        Some(name) => name.to_owned(),
        None => {
            let stem = file?.file_stem()?.to_string_lossy();
            stem.to_ascii_lowercase().replace('_', "-")
        }
    };
    let rule = if !is_pin(&name) || name.contains('.') {
        "must be of lower-case letters, digits and dashes, like \"machine\": it is part of the names of pins"
    } else if above.iter().any(|task| task.name == name) {
        "is taken by a program above: give this one another name"
    } else {
        return Some(name);
    };
    section.refused("name", rule)
}

/// Cycles from one scan to the next.
fn period(section: &mut Section<'_, '_>, cycle_us: Option<u32>) -> Option<u64> {
    let period_ms = section.number("period_ms", Bound::Positive(60_000.0), 10.0)?;
    let cycle_us = f64::from(cycle_us?);
    let cycles = period_ms * 1000.0 / cycle_us;
    let whole = cycles.round();
    if whole < 1.0 || (cycles - whole).abs() > 1e-6 {
        let rule = format!("must be a whole number of cycles, which take {} ms", cycle_us / 1000.0);
        return section.refused("period_ms", rule);
    }
    Some(whole as u64)
}

/// The program; its mistakes are told with their places in it.
fn compile(section: &mut Section<'_, '_>, file: &Path) -> Option<Arc<Logic>> {
    let text = match files::read_text(file, TEXT_MAX) {
        Ok(text) => text,
        Err(error) => {
            return section.refused("file", format!("cannot be read: {error}"));
        }
    };
    match logic::compile(&text) {
        Ok(logic) => Some(Arc::new(logic)),
        Err(told) => {
            let errors = told.iter().filter(|one| one.severity == logic::Severity::Error);
            let count = errors.clone().count();
            for one in errors.take(MISTAKES_TOLD) {
                section.wrong("file", format!("{}:{one}", file.display()));
            }
            if count > MISTAKES_TOLD {
                let more = count - MISTAKES_TOLD;
                let rule = format!("has {more} more: isocnc logic check {}", file.display());
                section.wrong("file", rule);
            }
            None
        }
    }
}

/// `at = { "%IX0.0" = "io.10.in-03" }`
fn addresses(section: &mut Section<'_, '_>) -> Option<Vec<(String, String)>> {
    let mut addresses: Vec<(String, String)> = Vec::new();
    section.section("at")?.each(|table, address| {
        let rule = match table.any_scalar(address) {
            _ if !address.starts_with('%') => "is no address: one begins with %I or %Q; a pin of its own needs a net",
            _ if addresses.iter().any(|(above, _)| is_same_address(above, address)) => "is bound above",
            Some(Scalar::Word(pin)) if is_pin(&pin) => {
                addresses.push((address.to_owned(), pin));
                return Some(());
            }
            Some(_) => PIN_RULE,
            None => return None,
        };
        table.refused(address, rule)
    })?;
    Some(addresses)
}

/// Outputs of texts that are alarms.
fn alarms(section: &mut Section<'_, '_>, logic: Option<&Logic>) -> Option<Vec<String>> {
    let is_text = |output: &&Variable| output.scalar() == Some(logic::Scalar::String);
    section.list("alarms", |item, path| {
        let name = item.text(path)?.to_owned();
        let Some(logic) = logic else { return Some(name) };
        let known: Vec<String> = logic
            .outputs()
            .filter(is_text)
            .map(|output| logic.name(output))
            .collect();
        if !known.iter().any(|known| known.eq_ignore_ascii_case(&name)) {
            let near = nearest(&name, known.iter().map(String::as_str));
            return item.no_word(path, "is no output of the program that is a STRING", near);
        }
        Some(name)
    })
}

/// Values of outputs where the program has failed.
fn safe(mut table: Section<'_, '_>, logic: &Logic) -> Option<Vec<(String, i64)>> {
    table.each(|table, name| {
        let output = logic.variable(name).filter(|variable| variable.role == Role::Output);
        let Some(output) = output else {
            let known: Vec<String> = logic.outputs().map(|output| logic.name(output)).collect();
            let near = nearest(name, known.iter().map(String::as_str));
            let hint = near.map_or(String::new(), |near| format!("; did you mean {near:?}?"));
            return table.refused(name, format!("is no output of the program{hint}"));
        };
        let scalar = output.scalar();
        let value = match (table.any_scalar(name)?, scalar) {
            (Scalar::Flag(value), _) => logic.slot_value(output, Value::Bool(value)),
            (Scalar::Integer(value), Some(logic::Scalar::Time)) => value.checked_mul(1_000_000),
            (Scalar::Integer(value), Some(logic::Scalar::Real | logic::Scalar::Lreal)) => {
                logic.slot_value(output, Value::Lreal(value as f64))
            }
            (Scalar::Integer(value), _) => logic.slot_value(output, Value::Integer(i128::from(value))),
            (Scalar::Number(value), Some(logic::Scalar::Time)) => Some((value * 1e6).round() as i64),
            (Scalar::Number(value), _) => logic.slot_value(output, Value::Lreal(value)),
            (Scalar::Word(word), None) => logic.slot_value(output, Value::Text(&word)),
            (Scalar::Word(_), _) => None,
        };
        let Some(value) = value else {
            let form = if scalar == Some(logic::Scalar::Time) {
                ", in ms"
            } else {
                ""
            };
            return table.refused(name, format!("must be a value of type {}{form}", output.ty));
        };
        Some((name.to_owned(), value))
    })
}

/// Whether something must act in the cycle in which it is read.
fn acts_at_once(pin: &str) -> bool {
    let of_joint = pin.strip_prefix("joint.").and_then(|rest| rest.split_once('.'));
    let is_switch = |(_, name): (&str, &str)| matches!(name, "home-sw-in" | "neg-lim-sw-in" | "pos-lim-sw-in");
    matches!(pin, "iocontrol.0.emc-enable-in" | "motion.probe-input") || of_joint.is_some_and(is_switch)
}

/// Refuses programs that alone decide on what has to act at once. A program may have its say beside an input that is there in the
/// same cycle: through a component that takes both.
pub(super) fn keep_fast_inputs(root: &Section<'_, '_>, tasks: &[LogicTask], nets: &[Net], components: &[Component]) {
    let by_net = nets
        .iter()
        .flat_map(|net| net.targets.iter().map(|target| (net.source.as_str(), target.as_str())));
    let outputs = tasks.iter().flat_map(|task| &task.interface.outputs);
    let by_program = outputs.filter_map(|output| match &output.end {
        End::Elsewhere { pin, own, .. } => Some((own.as_str(), pin.as_str())),
        End::Own { .. } | End::Operator { .. } => None,
    });
    let ways: Vec<(&str, &str)> = by_net.chain(by_program).collect();
    for (_, target) in ways.iter().filter(|(_, target)| acts_at_once(target)) {
        let sources = sources(target, &ways, components);
        let of = |task: &&LogicTask| {
            let prefix = format!("logic.{}.", task.name);
            sources.iter().any(|source| source.starts_with(&prefix))
        };
        let at_once = sources.iter().any(|source| !source.starts_with("logic."));
        if let Some(task) = tasks.iter().find(of).filter(|_| !at_once) {
            let rule = format!(
                "program \"{}\" would lead {target}, which has to act in the cycle in which its input is read, up to {} cycles late: \
                 lead the input itself there, and what the program has to say through a component beside it (and2: the input, the \
                 program)",
                task.name, task.every
            );
            root.wrong("logic", rule);
        }
    }
}

/// Pins that are no component's and that a target depends on.
fn sources<'w>(target: &str, ways: &[(&'w str, &'w str)], components: &[Component]) -> Vec<&'w str> {
    let mut sources = Vec::new();
    let mut seen: Vec<(&str, &str)> = Vec::new();
    let mut open: Vec<_> = ways.iter().filter(|(_, read)| *read == target).copied().collect();
    while let Some(way) = open.pop() {
        if seen.contains(&way) {
            continue;
        }
        seen.push(way);
        let is_of = |pin: &str, component: &Component| {
            let rest = pin.strip_prefix(component.name.as_str());
            rest.is_some_and(|rest| rest.starts_with('.'))
        };
        match components.iter().find(|component| is_of(way.0, component)) {
            None => sources.push(way.0),
            Some(component) => open.extend(ways.iter().filter(|(_, read)| is_of(read, component))),
        }
    }
    sources
}
