//! What ordinary threads see of programs in Structured Text and tell them.
//!
//! In:  values behind scans; names and values of users; changed files of programs.
//! Out: variables in words; orders to a program between two scans.

use super::scanner::{Back, FORCED_MAX, Order, Program, Scanner};
use super::shared::{Exchange, Image};
use config::{End, Interface, LogicTask};
use files::read::TEXT_MAX;
use hal_pins::nearest;
use logic::{Logic, Role, Scalar, Value, Variable};
use machine::retain_file::Retained;
use std::collections::HashMap;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Orders that can wait for a scan.
const ORDERS: usize = 2 * FORCED_MAX;

/// All programs of a machine, for ordinary threads.
#[derive(Default)]
pub struct Desk {
    tasks: Vec<TaskDesk>,
    /// What is to be told in the journal.
    warnings: Mutex<Vec<String>>,
}

/// One of them.
pub(super) struct TaskDesk {
    task: LogicTask,
    period_ns: u64,
    exchange: Arc<Exchange>,
    inner: Mutex<Inner>,
}

struct Inner {
    logic: Arc<Logic>,
    image: Arc<Image>,
    /// Texts of the program before: an alarm of it may still be told.
    before: Option<Arc<Logic>>,
    orders: rtrb::Producer<Order>,
    back: rtrb::Consumer<Back>,
    forced: Vec<Forced>,
    /// What is on its way to replace it, and for whom.
    new: Option<(Arc<Logic>, Arc<Image>, usize, u64)>,
}

/// How a program runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    pub name: String,
    pub file: String,
    pub period_ms: f64,
    pub steps_max: u64,
    pub scans: u64,
    /// Scans that were left out, as the one before was not over.
    pub overruns: u64,
    pub overflows: u64,
    pub scan_us: f64,
    pub scan_max_us: f64,
    pub stands: bool,
    /// Variables that are forced.
    pub forced: usize,
}

/// What has come of a program that was sent to replace another.
#[derive(Debug, PartialEq)]
pub struct Replaced {
    /// Of whoever has sent it.
    pub ticket: u64,
    /// Number of the program.
    pub task: usize,
    /// How many variables go on; or why it has not replaced the other.
    pub carried: Result<usize, String>,
}

/// A variable that has a value whatever pins and the program make of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Forced {
    place: usize,
    pub variable: String,
    pub value: String,
}

/// A variable behind a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    pub name: String,
    pub ty: String,
    pub value: String,
    /// Line of its declaration.
    pub line: u32,
    pub role: Role,
    pub retain: bool,
    /// Its pin.
    pub pin: Option<String>,
    pub forced: bool,
}

/// The ends of the rings of a program, and what runs it.
pub(super) fn rings(
    task: &LogicTask,
    number: usize,
    exchange: Arc<Exchange>,
    program: Program,
    cycle_ns: u64,
) -> (Scanner, TaskDesk) {
    let (orders, orders_out) = rtrb::RingBuffer::new(ORDERS);
    let (back_in, back) = rtrb::RingBuffer::new(2);
    let period_ns = task.every * cycle_ns;
    let inner = Inner {
        logic: task.logic.clone(),
        image: program.image.clone(),
        before: None,
        orders,
        back,
        forced: Vec::new(),
        new: None,
    };
    let scanner = Scanner {
        number,
        period_ns,
        exchange: exchange.clone(),
        program: Box::new(program),
        forced: Vec::with_capacity(FORCED_MAX),
        orders: orders_out,
        back: back_in,
        since_ns: 0,
        done: 0,
        timed: false,
    };
    let desk = TaskDesk {
        task: task.clone(),
        period_ns,
        exchange,
        inner: Mutex::new(inner),
    };
    (scanner, desk)
}

impl Desk {
    pub(super) fn new(tasks: Vec<TaskDesk>) -> Desk {
        Desk {
            tasks,
            warnings: Mutex::default(),
        }
    }

    /// Leaves a warning for the journal.
    pub fn warn(&self, what: String) {
        let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        warnings.push(what);
    }

    /// The warnings that have come since the last call.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut warnings)
    }

    /// Names of the programs, in the order of the machine file.
    pub fn names(&self) -> Vec<&str> {
        self.tasks.iter().map(|task| task.task.name.as_str()).collect()
    }

    /// How the programs run.
    pub fn told(&self) -> Vec<Told> {
        self.tasks.iter().map(TaskDesk::told).collect()
    }

    /// What is forced, with the name of its program.
    pub fn forced(&self) -> Vec<(&str, Forced)> {
        let mut all = Vec::new();
        for task in &self.tasks {
            let forced = task.inner().forced.clone();
            all.extend(forced.into_iter().map(|forced| (task.task.name.as_str(), forced)));
        }
        all
    }

    /// The number of a program, by its name or its file; without either the only one.
    ///
    /// # Errors
    /// There is none of that name, or there are several.
    pub fn find(&self, name: Option<&str>) -> Result<usize, String> {
        let names = self.names().join(", ");
        match (name, self.tasks.len()) {
            (_, 0) => {
                Err("this machine has no program in Structured Text: [[logic]] in its machine file names one".into())
            }
            (None, 1) => Ok(0),
            (None, _) => Err(format!("there are several programs: say which of {names}")),
            (Some(name), _) => {
                let is_meant = |task: &TaskDesk| {
                    let file = &task.task.file;
                    task.task.name == name
                        || file.as_os_str() == name
                        || file.file_name().is_some_and(|last| last == name)
                        || std::fs::canonicalize(name).is_ok_and(|path| std::fs::canonicalize(file).ok() == Some(path))
                };
                let found = self.tasks.iter().position(is_meant);
                found.ok_or_else(|| format!("no program is called {name:?}; there are {names}"))
            }
        }
    }

    /// Values of variables behind the last scan: of all, or of those that are called so or belong to what is.
    ///
    /// # Errors
    /// There is no such variable.
    pub fn look(&self, task: usize, names: &[String]) -> Result<(i64, Vec<Shown>), String> {
        let (time_ns, all, _) = self.look_at(task, names, "", 0, usize::MAX)?;
        Ok((time_ns, all))
    }

    /// The same of those whose name or pin has all words of `search` in it, from number `from` of them on, `most` at the most; true:
    /// there are others behind them.
    ///
    /// # Errors
    /// There is no such variable.
    pub fn look_at(
        &self,
        task: usize,
        names: &[String],
        search: &str,
        from: usize,
        most: usize,
    ) -> Result<(i64, Vec<Shown>, bool), String> {
        let task = self.tasks.get(task).ok_or("no such program")?;
        let inner = task.inner();
        let logic = &inner.logic;
        let mut wanted: Vec<&Variable> = Vec::new();
        for name in names {
            let found = logic.variables_of(name);
            if found.is_empty() {
                return Err(no_variable(logic, name));
            }
            wanted.extend(found);
        }
        if names.is_empty() {
            wanted.extend(logic.all_variables());
        }
        let (time_ns, values) = inner
            .image
            .look()
            .ok_or("scans come too fast to be looked at: once more")?;
        let pins = &task.task.interface;
        let pin_of = |variable: &Variable| {
            let mut all = pins.inputs.iter().chain(&pins.outputs);
            match &all.find(|pin| pin.variable.name == variable.name)?.end {
                End::Own { pin, .. } | End::Elsewhere { pin, .. } => Some(pin),
                End::Operator { .. } => None,
            }
        };
        let words: Vec<String> = search.split_whitespace().map(str::to_lowercase).collect();
        if !words.is_empty() {
            wanted.retain(|variable| {
                let pin = pin_of(variable).map_or("", |pin| pin);
                let text = format!("{} {pin}", logic.name(variable)).to_lowercase();
                words.iter().all(|word| text.contains(word))
            });
        }
        let shown = |variable: &Variable| {
            let slot = values.get(variable.place()).copied().unwrap_or(0);
            Shown {
                name: logic.name(variable),
                ty: variable.ty.clone(),
                value: logic.value(variable, slot).to_string(),
                line: variable.line,
                role: variable.role,
                retain: variable.retain,
                pin: pin_of(variable).cloned(),
                forced: inner.forced.iter().any(|forced| forced.place == variable.place()),
            }
        };
        let more = wanted.len().saturating_sub(from) > most;
        let page = wanted.into_iter().skip(from).take(most);
        Ok((time_ns, page.map(shown).collect(), more))
    }

    /// Forces a variable to a value from the next scan on, whatever the program or a pin makes of it. Says what it is in full.
    ///
    /// # Errors
    /// No such variable, no value of its type, too many.
    pub fn force(&self, task: usize, name: &str, value: &str) -> Result<String, String> {
        let task = self.tasks.get(task).ok_or("no such program")?;
        let mut inner = task.inner();
        let logic = inner.logic.clone();
        let variable = logic.variable(name).ok_or_else(|| no_variable(&logic, name))?;
        if variable.constant {
            return Err(format!("{name} is a constant: it stands in the program as a number"));
        }
        let read = logic.read(variable, value);
        let slot = read.and_then(|value| logic.slot_value(variable, value));
        let slot = slot.ok_or_else(|| format!("{value:?} is no {}{}", variable.ty, variable.form()))?;
        let place = variable.place();
        let known = inner.forced.iter().any(|forced| forced.place == place);
        if !known && inner.forced.len() == FORCED_MAX {
            return Err(format!("{FORCED_MAX} variables are forced already: release some"));
        }
        inner.order(Order::Force(place, slot))?;
        inner.forced.retain(|forced| forced.place != place);
        let forced = Forced {
            place,
            variable: logic.name(variable),
            value: logic.value(variable, slot).to_string(),
        };
        let said = format!("{} = {}", forced.variable, forced.value);
        inner.forced.push(forced);
        Ok(said)
    }

    /// Lets a variable, or all of them, have again what the program and pins make of it. Says how many were forced.
    ///
    /// # Errors
    /// No such variable, or it is not forced.
    pub fn release(&self, task: usize, name: Option<&str>) -> Result<usize, String> {
        let task = self.tasks.get(task).ok_or("no such program")?;
        let mut inner = task.inner();
        let Some(name) = name else {
            inner.order(Order::ReleaseAll)?;
            return Ok(std::mem::take(&mut inner.forced).len());
        };
        let logic = inner.logic.clone();
        let place = logic.variable(name).ok_or_else(|| no_variable(&logic, name))?.place();
        if !inner.forced.iter().any(|forced| forced.place == place) {
            return Err(format!("{name} is not forced"));
        }
        inner.order(Order::Release(place))?;
        inner.forced.retain(|forced| forced.place != place);
        Ok(1)
    }

    /// Compiles the file of a program anew and sends it to take the place of the one that runs; [`Desk::replaced`] says what
    /// came of it.
    ///
    /// # Errors
    /// What is wrong with the program, what it needs that is not there, another one that is on its way.
    pub fn replace(&self, task: usize, ticket: u64) -> Result<(), String> {
        let desk = self.tasks.get(task).ok_or("no such program")?;
        let file = desk.task.file.display();
        let text = files::read_text(&desk.task.file, TEXT_MAX).map_err(|error| format!("{file}: {error}"))?;
        let logic = logic::compile(&text).map_err(|told| {
            let errors = told.iter().filter(|one| one.severity == logic::Severity::Error);
            let lines: Vec<String> = errors.take(10).map(|one| format!("{file}:{one}")).collect();
            lines.join("\n")
        })?;
        let logic = Arc::new(logic);
        let interface = desk
            .task
            .interface_of(&logic)
            .map_err(|rule| format!("{file}: {rule}"))?;
        check_pins(&interface, &desk.task.interface).map_err(|rule| format!("{file}: {rule}"))?;
        super::budget::check(&logic, desk.period_ns, desk.task.share_max)
            .map_err(|too_long| too_long.at(&file.to_string()))?;
        let mut inner = desk.inner();
        if inner.new.is_some() {
            return Err("another change of it is on its way".into());
        }
        let mut program = Program::new(logic.clone(), &interface, &desk.task.interface);
        program.same = logic.same_variables(&inner.logic, false);
        let (image, count) = (program.image.clone(), program.same.len());
        inner.order(Order::Replace(Box::new(program)))?;
        inner.new = Some((logic, image, count, ticket));
        Ok(())
    }

    /// What has come of a program that was sent to replace another.
    pub fn replaced(&self) -> Option<Replaced> {
        self.tasks.iter().enumerate().find_map(|(task, desk)| {
            let mut inner = desk.inner();
            let back = inner.back.pop().ok()?;
            let (logic, image, count, ticket) = inner.new.take()?;
            let carried = match back {
                Back::Replaced(_) => {
                    inner.forced.clear();
                    inner.before = Some(std::mem::replace(&mut inner.logic, logic));
                    inner.image = image;
                    Ok(count)
                }
                Back::Refused(_) => Err("the machine is not at rest any more: stop it, and once more".into()),
            };
            Some(Replaced { ticket, task, carried })
        })
    }

    /// A text of a program, by its number.
    pub fn text(&self, task: usize, number: u32) -> String {
        let Some(task) = self.tasks.get(task) else {
            return String::new();
        };
        let inner = task.inner();
        let text = inner.logic.text(number).or_else(|| inner.before.as_ref()?.text(number));
        text.unwrap_or_default().to_owned()
    }

    /// Where a program comes from, for messages.
    pub fn file(&self, task: usize) -> String {
        let file = self.tasks.get(task).map(|task| task.task.file.display().to_string());
        file.unwrap_or_default()
    }

    /// RETAIN variables behind the last scan: its time, and each with name, type and value; `None`: it has none, or they cannot be
    /// looked at now.
    pub fn retained(&self, task: usize) -> Option<(i64, Vec<Retained>)> {
        let inner = self.tasks.get(task)?.inner();
        let logic = &inner.logic;
        let (time_ns, values) = inner.image.look()?;
        let retained = logic
            .all_variables()
            .filter(|variable| variable.retain && !variable.constant);
        let retained: Vec<Retained> = retained
            .filter(|variable| variable.scalar() != Some(Scalar::String))
            .map(|variable| Retained {
                name: full_name(variable),
                ty: variable.ty.clone(),
                value: match (variable.scalar(), values.get(variable.place()).copied().unwrap_or(0)) {
                    (Some(_), slot) => slot.to_string(),
                    (None, slot) => logic.value(variable, slot).to_string(),
                },
            })
            .collect();
        (!retained.is_empty()).then_some((time_ns, retained))
    }
}

/// Where each RETAIN variable goes in a program, and as what; `Err`: why it does not.
pub(super) fn places(all: &[Retained], logic: &Logic) -> Vec<Result<(usize, i64), String>> {
    let retained = logic
        .all_variables()
        .filter(|variable| variable.retain && !variable.constant);
    let known: HashMap<String, &Variable> = retained.map(|variable| (full_name(variable), variable)).collect();
    all.iter().map(|one| place(one, &known, logic)).collect()
}

fn place(retained: &Retained, known: &HashMap<String, &Variable>, logic: &Logic) -> Result<(usize, i64), String> {
    let Retained { name, ty, value } = retained;
    let Some(variable) = known.get(name) else {
        return Err(format!("{name} is not RETAIN any more"));
    };
    if !variable.ty.eq_ignore_ascii_case(ty) {
        let new = &variable.ty;
        return Err(format!(
            "{name} was {ty} and is {new} now: it begins with its value of the start"
        ));
    }
    let of_range = |scalar: Scalar, slot: &i64| {
        let number = match scalar {
            Scalar::Ulint | Scalar::Lword => i128::from(*slot as u64),
            _ => i128::from(*slot),
        };
        let (low, high) = scalar.range();
        (low..=high).contains(&number)
    };
    let slot = match variable.scalar() {
        Some(Scalar::Real | Scalar::Lreal) => {
            let bits = value.parse().ok().map(|slot: i64| f64::from_bits(slot as u64));
            bits.and_then(|number| logic.slot_value(variable, Value::Lreal(number)))
        }
        Some(scalar) => value.parse().ok().filter(|slot| of_range(scalar, slot)),
        None => logic.slot_value(variable, Value::Text(value)),
    };
    let slot =
        slot.ok_or_else(|| format!("{name} has no value {value} any more: it begins with its value of the start"))?;
    Ok((variable.place(), slot))
}

/// The name that a variable has whatever else is in the file.
fn full_name(variable: &Variable) -> String {
    format!("{}.{}", variable.program, variable.name).to_ascii_lowercase()
}

impl TaskDesk {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn told(&self) -> Told {
        let inner = self.inner();
        let exchange = &self.exchange;
        Told {
            name: self.task.name.clone(),
            file: self.task.file.display().to_string(),
            period_ms: self.period_ns as f64 / 1e6,
            steps_max: inner.logic.steps_max(),
            scans: exchange.scans.load(Relaxed),
            overruns: exchange.overruns.load(Relaxed),
            overflows: exchange.overflows.load(Relaxed),
            scan_us: exchange.scan_ns.load(Relaxed) as f64 / 1e3,
            scan_max_us: exchange.scan_max_ns.load(Relaxed) as f64 / 1e3,
            stands: exchange.stands.load(Relaxed),
            forced: inner.forced.len(),
        }
    }
}

impl Inner {
    fn order(&mut self, order: Order) -> Result<(), String> {
        let sent = self.orders.push(order);
        sent.map_err(|_| "the program takes no orders: it makes no scans".into())
    }
}

fn no_variable(logic: &Logic, name: &str) -> String {
    let parts: Vec<String> = logic
        .variables_of(name)
        .into_iter()
        .map(|part| logic.name(part))
        .collect();
    if let [first, ..] = &parts[..] {
        return format!("{name} has {} values: name one of them, such as {first}", parts.len());
    }
    let names: Vec<String> = logic.all_variables().map(|variable| logic.name(variable)).collect();
    match nearest(name, names.iter().map(String::as_str)) {
        Some(near) => format!("there is no variable {name}; did you mean {near}?"),
        None => format!("there is no variable {name}"),
    }
}

/// Pins are made when the control starts: a program may have fewer, and no others.
fn check_pins(new: &Interface, old: &Interface) -> Result<(), String> {
    let missing = |new: &[config::LogicPin], old: &[config::LogicPin]| {
        let is_there = |pin: &config::LogicPin| match &pin.end {
            End::Operator { .. } => old.iter().any(|old| {
                matches!(old.end, End::Operator { .. }) && old.variable.name.eq_ignore_ascii_case(&pin.variable.name)
            }),
            end => old.iter().any(|old| old.end == *end),
        };
        new.iter()
            .find(|pin| !is_there(pin))
            .map(|pin| (pin.variable.name.clone(), pin.variable.line))
    };
    match missing(&new.inputs, &old.inputs).or_else(|| missing(&new.outputs, &old.outputs)) {
        None => Ok(()),
        Some((name, line)) => Err(format!(
            "line {line}: {name} is new, or has another type or pin than before: pins are made when the control starts; start it again"
        )),
    }
}
