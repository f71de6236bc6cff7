//! Programs in Structured Text beside the cycle: the side of the program, and its thread.
//!
//! In:  inputs of one cycle; orders of ordinary threads. Out: outputs, what went wrong, all values for whoever looks.
//!
//! A scan: orders → inputs → forced values → the program → forced values → outputs → all values shown.
//!
//! RT: [`Scanner::scan_if_due`] and [`run`]; no allocation, no locks, no system call but that of the clock.

use super::convert::{cell_of, slot_of};
use super::shared::{Exchange, Image, NO_TEXT};
use config::{End, Interface, LogicPin};
use host::wait::{monotonic_ns, sleep_until};
use logic::{Logic, Runtime, Scalar, Value, Variable};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

/// Values that can be forced at a time.
pub(super) const FORCED_MAX: usize = 64;
/// Looks of the thread in a period: a scan begins so much late at the most.
const LOOKS: u64 = 8;

/// A compiled program with its memory, and where its values come from and go to.
pub(super) struct Program {
    pub(super) runtime: Runtime,
    inputs: Box<[Option<Variable>]>,
    outputs: Box<[Option<Variable>]>,
    pub(super) image: Arc<Image>,
    /// Places in the program that it replaces, and here.
    pub(super) same: Vec<(usize, usize)>,
}

impl Program {
    /// A program at its start. `own`: what it reads and writes; `pins`: what there is, in the order of the cells.
    pub(super) fn new(logic: Arc<Logic>, own: &Interface, pins: &Interface) -> Program {
        let runtime = Runtime::new(logic);
        Program {
            inputs: of_pins(&own.inputs, &pins.inputs),
            outputs: of_pins(&own.outputs, &pins.outputs),
            image: Arc::new(Image::new(runtime.memory())),
            runtime,
            same: Vec::new(),
        }
    }
}

/// The variable of each pin.
fn of_pins(own: &[LogicPin], pins: &[LogicPin]) -> Box<[Option<Variable>]> {
    let is_same = |one: &LogicPin, other: &LogicPin| match (&one.end, &other.end) {
        (End::Operator { .. }, End::Operator { .. }) => one.variable.name.eq_ignore_ascii_case(&other.variable.name),
        (one, other) => one == other,
    };
    let of = |pin: &LogicPin| own.iter().find(|own| is_same(own, pin)).map(|own| own.variable.clone());
    pins.iter().map(of).collect()
}

/// What ordinary threads ask of a program, between two scans.
pub(super) enum Order {
    Force(usize, i64),
    Release(usize),
    ReleaseAll,
    Replace(Box<Program>),
}

/// A program that was replaced, or one that cannot replace it now; to be freed elsewhere.
pub(super) enum Back {
    Replaced(Box<Program>),
    Refused(Box<Program>),
}

/// Runs the scans of one program.
pub struct Scanner {
    /// Number of the program in the machine file.
    pub(super) number: usize,
    /// From scan to scan, ns.
    pub(super) period_ns: u64,
    pub(super) exchange: Arc<Exchange>,
    pub(super) program: Box<Program>,
    /// Places and values; never longer than it was made.
    pub(super) forced: Vec<(usize, i64)>,
    pub(super) orders: rtrb::Consumer<Order>,
    pub(super) back: rtrb::Producer<Back>,
    /// Time of the program at the start of the control: RETAIN timers go on.
    pub(super) since_ns: i64,
    pub(super) done: u64,
    /// Whether there is a clock by which scans can be timed.
    pub(super) timed: bool,
}

impl Scanner {
    /// Number of the program in the machine file.
    pub fn number(&self) -> usize {
        self.number
    }

    /// From scan to scan, ns.
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Begins with what an earlier session has left, at its time; before the first scan.
    pub(super) fn recall(&mut self, time_ns: i64, values: &[(usize, i64)]) {
        self.since_ns = time_ns.saturating_add(self.period_ns as i64);
        for (place, value) in values {
            self.program.runtime.put(*place, *value);
        }
        self.program.image.show(time_ns, self.program.runtime.memory());
    }

    /// One scan, if one is asked for. RT.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn scan_if_due(&mut self) -> bool {
        let requested = self.exchange.requested.load(Acquire);
        if requested == self.done {
            return false;
        }
        let began_ns = if self.timed { monotonic_ns() } else { 0 };
        self.take_orders();
        // A program that stands is shown as it was when it came to stand.
        match self.exchange.stands.load(Relaxed) {
            false => self.scan(),
            true => self.exchange.set_error(None),
        }
        if self.timed {
            let took_ns = monotonic_ns().saturating_sub(began_ns) as i64;
            self.exchange.scan_ns.store(took_ns, Relaxed);
            self.exchange.scan_max_ns.fetch_max(took_ns, Relaxed);
        }
        self.done = requested;
        self.exchange.done.store(requested, Release);
        true
    }

    fn scan(&mut self) {
        let (exchange, program) = (&self.exchange, &mut *self.program);
        if exchange.begins_anew.load(Relaxed) {
            program.runtime.restart();
        }
        let Program {
            runtime,
            inputs,
            outputs,
            image,
            ..
        } = program;
        for (variable, cell) in inputs.iter().zip(&exchange.inputs) {
            let Some(variable) = variable else { continue };
            if let Some(slot) = slot_of(runtime.logic(), variable, cell.load(Relaxed)) {
                runtime.put(variable.place(), slot);
            }
        }
        force(runtime, &self.forced);
        let time_ns = self.since_ns.saturating_add(exchange.time_ns.load(Relaxed));
        runtime.scan(time_ns);
        force(runtime, &self.forced);
        for (variable, cell) in outputs.iter().zip(&exchange.outputs) {
            let value = variable.as_ref().map_or(0, |variable| output(runtime, variable));
            cell.store(value, Relaxed);
        }
        exchange.set_error(runtime.fault());
        runtime.clear_fault();
        exchange.overflows.store(runtime.overflows(), Relaxed);
        exchange.scans.fetch_add(1, Relaxed);
        image.show(time_ns, runtime.memory());
    }

    fn take_orders(&mut self) {
        while let Ok(order) = self.orders.pop() {
            match order {
                Order::Force(place, value) => {
                    self.forced.retain(|(forced, _)| *forced != place);
                    if self.forced.len() < FORCED_MAX {
                        self.forced.push((place, value));
                    }
                }
                Order::Release(place) => self.forced.retain(|(forced, _)| *forced != place),
                Order::ReleaseAll => self.forced.clear(),
                Order::Replace(new) => self.replace(new),
            }
        }
    }

    /// Puts another program in the place of this one: what both have goes on, so no edge is seen that was none.
    fn replace(&mut self, mut new: Box<Program>) {
        let answer = match self.exchange.may_replace.load(Relaxed) {
            false => Back::Refused(new),
            true => {
                let same = std::mem::take(&mut new.same);
                new.runtime.carry(&self.program.runtime, &same);
                let old = std::mem::replace(&mut self.program, new);
                self.forced.clear();
                self.program
                    .image
                    .show(old.runtime.time_ns(), self.program.runtime.memory());
                let mut old = old;
                // Freed with it.
                old.same = same;
                Back::Replaced(old)
            }
        };
        // One program is under way at the most, and the ring has room for it; else leaking is what real time can afford.
        if let Err(rtrb::PushError::Full(Back::Replaced(program) | Back::Refused(program))) = self.back.push(answer) {
            std::mem::forget(program);
        }
    }
}

fn force(runtime: &mut Runtime, forced: &[(usize, i64)]) {
    for (place, value) in forced {
        runtime.put(*place, *value);
    }
}

/// The cell of an output; of a text its number.
fn output(runtime: &Runtime, variable: &Variable) -> u64 {
    let slot = runtime.memory().get(variable.place()).copied().unwrap_or(0);
    match variable.scalar() {
        Some(Scalar::String) => match runtime.logic().value(variable, slot) {
            Value::Text(text) if !text.is_empty() => slot as u64,
            _ => NO_TEXT,
        },
        scalar => cell_of(scalar, slot),
    }
}

/// The loop of the thread of a program. RT.
pub fn run(scanner: &mut Scanner, stop: &AtomicBool) {
    scanner.timed = true;
    let look_ns = (scanner.period_ns / LOOKS).max(1);
    let mut date_ns = monotonic_ns();
    while !stop.load(Acquire) {
        sleep_until(date_ns);
        let now_ns = monotonic_ns();
        let was_due = scanner.scan_if_due();
        // The next one is asked for about a period behind this one.
        date_ns = match was_due {
            true => now_ns + scanner.period_ns - look_ns,
            false => now_ns + look_ns,
        };
    }
}
