//! Programs in Structured Text beside the cycle: the cycle's side.
//!
//! In:  pins. Out: pins; what the operator is told; faults.
//!
//! ```text
//!  cycle thread                                  rt-logic N, below it
//!  end of a cycle on the grid: all inputs ──────▶ one scan ──┐
//!  beginning of a cycle: all outputs at once ◀──────────────┘
//! ```
//!
//! What a scan reads is of one cycle, and what it writes shows in one cycle: the next one, if the scan is over by then. The time of
//! a scan is that of the cycles since the start. The thread never waits and is never woken: it looks at its clock whether a scan is due.
//! A date at which the last scan is not over is left out and counted; three in a row (`overruns_stop`), or something that goes wrong in a scan,
//! make a fault: the program stands and its outputs have their safe values until it is acknowledged. It then begins anew, with
//! what is RETAIN.
//!
//! Without threads (virtual time, paced time) a scan runs in the cycle itself, so that the same comes out each time.
//!
//! RT: nothing allocates but [`Ports::claim`] and [`Ports::bind`].

pub mod budget;
mod convert;
mod desk;
mod ends;
mod scanner;
mod shared;

pub use desk::{Desk, Forced, Replaced, Shown, Told};
pub use scanner::{Scanner, run};

use config::{self, Config, ConfigErrors, End, LogicPin};
use ends::{Reader, Writer};
use hal_pins::{Hal, HalError, Output};
use machine::faults::{Fault, LogicError};
use machine::retain_file::Retained;
use scanner::Program;
use shared::{Exchange, NO_TEXT};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

/// All programs of a machine.
pub struct Ports {
    ports: Vec<Port>,
    desk: Arc<Desk>,
}

/// What keeps the outputs of a program at their safe values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    Error,
    Late,
}

/// A text output of a program.
struct TextOutput {
    /// Its place among the outputs.
    output: usize,
    is_alarm: bool,
    now: u64,
    /// What the operator was told last.
    told: u64,
}

struct TaskPins {
    scans: Output<u64>,
    overruns: Output<u64>,
    scan_ns: Output<i64>,
    stands: Output<bool>,
}

/// One program, from the side of the cycle.
struct Port {
    exchange: Arc<Exchange>,
    readers: Vec<Reader>,
    writers: Vec<Writer>,
    texts: Vec<TextOutput>,
    pins: TaskPins,
    /// Cycles from scan to scan, and a cycle, ns.
    every: u64,
    cycle_ns: u64,
    /// Cycles since the start, with those left out, and the next one with a scan.
    now: u64,
    date: u64,
    requested: u64,
    published: u64,
    overruns: u64,
    late_in_row: u32,
    /// So many in a row, and it stands; 0: never.
    late_max: u32,
    /// The scan under way was not over at its next date.
    is_late: bool,
    goes_on: bool,
    standing: Option<Standing>,
    begins_anew: bool,
    fault: Option<Fault>,
    number: usize,
    /// Runs scans in the cycle, where no thread does.
    scanner: Option<Scanner>,
}

/// Pins and nets of all programs, for the size of the shared memory.
pub fn count_pins(config: &Config) -> usize {
    let of = |task: &config::LogicTask| task.interface.inputs.len() + 2 * task.interface.outputs.len() + 4;
    config.logics.iter().map(of).sum()
}

impl Ports {
    /// Claims the pins of all programs.
    ///
    /// # Errors
    /// Number of the program whose pins cannot be had, and why.
    pub fn claim(hal: &mut Hal, config: &Config) -> Result<Ports, (usize, HalError)> {
        let (mut ports, mut desks) = (Vec::new(), Vec::new());
        let cycle_ns = u64::from(config.cycle_us) * 1000;
        for (number, task) in config.logics.iter().enumerate() {
            let interface = &task.interface;
            let of_task = |figure: &str| format!("logic.{}.task.{figure}", task.name);
            let mut claim = || -> Result<_, HalError> {
                let readers = interface.inputs.iter().map(|pin| Reader::claim(hal, &task.logic, pin));
                let readers = readers.collect::<Result<Vec<_>, _>>()?;
                let writers = interface.outputs.iter().map(|pin| Writer::claim(hal, task, pin));
                let writers = writers.collect::<Result<Vec<_>, _>>()?;
                let pins = TaskPins {
                    scans: hal.output(&of_task("scans"))?,
                    overruns: hal.output(&of_task("overruns"))?,
                    scan_ns: hal.output(&of_task("scan-ns"))?,
                    stands: hal.output(&of_task("stands"))?,
                };
                Ok((readers, writers, pins))
            };
            let (readers, writers, pins) = claim().map_err(|error| (number, error))?;
            let text = |(output, pin): (usize, &LogicPin)| match pin.end {
                End::Operator { is_alarm } => Some(TextOutput {
                    output,
                    is_alarm,
                    now: NO_TEXT,
                    told: NO_TEXT,
                }),
                End::Own { .. } | End::Elsewhere { .. } => None,
            };
            let exchange = Arc::new(Exchange::new(readers.len(), writers.len()));
            let program = Program::new(task.logic.clone(), interface, interface);
            let (scanner, desk) = desk::rings(task, number, exchange.clone(), program, cycle_ns);
            desks.push(desk);
            ports.push(Port {
                exchange,
                texts: interface.outputs.iter().enumerate().filter_map(text).collect(),
                readers,
                writers,
                pins,
                every: task.every,
                cycle_ns,
                now: 0,
                date: 0,
                requested: 0,
                published: 0,
                overruns: 0,
                late_in_row: 0,
                late_max: task.overruns_stop,
                is_late: false,
                goes_on: task.goes_on,
                standing: None,
                begins_anew: false,
                fault: None,
                number,
                scanner: Some(scanner),
            });
        }
        Ok(Ports {
            ports,
            desk: Arc::new(Desk::new(desks)),
        })
    }

    /// Binds variables to pins of others, once all pins and the nets of the machine file are there.
    ///
    /// # Errors
    /// A pin that is not there, has another type or another writer, at the place of the program in the machine file.
    pub fn bind(&mut self, hal: &mut Hal, config: &Config) -> Result<(), ConfigErrors> {
        for (number, (port, task)) in self.ports.iter_mut().zip(&config.logics).enumerate() {
            let told = |pin: &LogicPin, error: HalError| {
                let (name, line) = (&pin.variable.name, pin.variable.line);
                let rule = format!("{}:{line}: {name}: {error}", task.file.display());
                config::logic_error(config, number, &rule)
            };
            for (reader, pin) in port.readers.iter_mut().zip(&task.interface.inputs) {
                reader.bind(hal, pin).map_err(|error| told(pin, error))?;
            }
            for pin in &task.interface.outputs {
                if let End::Elsewhere { pin: target, own, .. } = &pin.end {
                    let net = format!("{own}-net");
                    hal.link(&net, own, &[target]).map_err(|error| told(pin, error))?;
                }
            }
        }
        Ok(())
    }

    /// What ordinary threads see of the programs and tell them.
    pub fn desk(&self) -> Arc<Desk> {
        self.desk.clone()
    }

    /// Gives a program what an earlier session has left of its RETAIN variables, before the first cycle; says what it could not
    /// take.
    pub fn recall(&mut self, number: usize, time_ns: i64, retained: &[Retained]) -> Vec<String> {
        let Some(scanner) = self.ports.get_mut(number).and_then(|port| port.scanner.as_mut()) else {
            return Vec::new();
        };
        let logic = scanner.program.runtime.logic().clone();
        let (taken, left): (Vec<_>, Vec<_>) = desk::places(retained, &logic).into_iter().partition(Result::is_ok);
        let taken: Vec<(usize, i64)> = taken.into_iter().flatten().collect();
        scanner.recall(time_ns, &taken);
        left.into_iter().filter_map(Result::err).collect()
    }

    /// The programs, to be run by threads of their own; before the first cycle.
    pub fn take_scanners(&mut self) -> Vec<Scanner> {
        self.ports.iter_mut().filter_map(|port| port.scanner.take()).collect()
    }

    /// Shows what scans have come to, all outputs of one at once. At the beginning of a cycle. RT.
    pub fn publish(&mut self) {
        for port in &mut self.ports {
            port.publish();
        }
    }

    /// Gives programs whose scan is due the inputs of this cycle. At its end; `skipped`: cycles that were left out before it;
    /// `at_rest`: programs may be replaced. RT.
    pub fn sample(&mut self, skipped: u64, at_rest: bool) {
        for port in &mut self.ports {
            port.sample(skipped, at_rest);
        }
    }

    /// Something that has gone wrong in a program, or an alarm that it gives; each once. RT.
    pub fn take_fault(&mut self) -> Option<Fault> {
        self.ports
            .iter_mut()
            .find_map(|port| port.fault.take().or_else(|| port.new_text(true)))
    }

    /// Whether a program stands or gives an alarm, though all that has been told: nothing may move then. RT.
    pub fn standing(&self) -> Option<Fault> {
        let alarm = |port: &Port| {
            let standing = port.texts.iter().find(|text| text.is_alarm && text.now != NO_TEXT);
            standing.map(|text| port.text_fault(text.now))
        };
        self.ports.iter().find_map(alarm)
    }

    /// A message for the operator: number of the program, and of its text. RT.
    pub fn take_message(&mut self) -> Option<(usize, u32)> {
        self.ports.iter_mut().find_map(|port| match port.new_text(false)? {
            Fault::LogicAlarm { task, text } => Some((task, text)),
            _ => None,
        })
    }

    /// Somebody has acknowledged: programs that stand begin anew. RT.
    pub fn acknowledge(&mut self) {
        for port in &mut self.ports {
            port.begins_anew |= port.standing.take().is_some();
            port.late_in_row = 0;
        }
    }
}

impl Port {
    fn publish(&mut self) {
        let done = self.exchange.done.load(Acquire);
        if done == self.published {
            return;
        }
        self.published = done;
        self.pins.scans.set(self.exchange.scans.load(Relaxed));
        self.pins.scan_ns.set(self.exchange.scan_ns.load(Relaxed));
        if let Some(error) = self.exchange.error() {
            self.fault = Some(Fault::LogicError {
                task: self.number,
                error: LogicError {
                    goes_on: self.goes_on,
                    ..error
                },
            });
            if !self.goes_on {
                self.stand(Standing::Error);
            }
        }
        if self.standing.is_none() {
            for (writer, cell) in self.writers.iter_mut().zip(&self.exchange.outputs) {
                writer.set(cell.load(Relaxed));
            }
            for text in &mut self.texts {
                let now = self.exchange.outputs.get(text.output);
                text.now = now.map_or(NO_TEXT, |cell| cell.load(Relaxed));
            }
        }
        self.pins.stands.set(self.standing.is_some());
    }

    /// Outputs have their safe values from now on.
    fn stand(&mut self, why: Standing) {
        self.standing = self.standing.or(Some(why));
        for writer in &mut self.writers {
            writer.set_safe();
        }
        for text in &mut self.texts {
            (text.now, text.told) = (NO_TEXT, NO_TEXT);
        }
        self.pins.stands.set(true);
    }

    fn sample(&mut self, skipped: u64, at_rest: bool) {
        self.now += skipped;
        if self.now >= self.date {
            self.date = (self.now / self.every + 1) * self.every;
            let is_over = self.exchange.done.load(Acquire) == self.requested;
            match is_over {
                true => self.request(at_rest),
                false => self.leave_out(),
            }
        }
        self.now += 1;
        if let Some(scanner) = &mut self.scanner {
            scanner.scan_if_due();
        }
    }

    fn request(&mut self, at_rest: bool) {
        if !std::mem::take(&mut self.is_late) {
            self.late_in_row = 0;
        }
        for (reader, cell) in self.readers.iter().zip(&self.exchange.inputs) {
            cell.store(reader.get(), Relaxed);
        }
        let exchange = &self.exchange;
        exchange
            .time_ns
            .store(self.now.saturating_mul(self.cycle_ns) as i64, Relaxed);
        exchange.may_replace.store(at_rest, Relaxed);
        exchange.stands.store(self.standing.is_some(), Relaxed);
        let begins_anew = self.standing.is_none() && std::mem::take(&mut self.begins_anew);
        exchange.begins_anew.store(begins_anew, Relaxed);
        self.requested += 1;
        exchange.requested.store(self.requested, Release);
    }

    fn leave_out(&mut self) {
        self.overruns += 1;
        self.pins.overruns.set(self.overruns);
        self.exchange.overruns.store(self.overruns, Relaxed);
        self.late_in_row += 1;
        self.is_late = true;
        if self.late_in_row == self.late_max && self.standing.is_none() {
            self.stand(Standing::Late);
            self.fault = Some(Fault::LogicLate {
                task: self.number,
                scans: self.late_max,
            });
        }
    }

    /// A text that the operator has not been told, as an alarm whatever it is.
    fn new_text(&mut self, is_alarm: bool) -> Option<Fault> {
        let untold = |text: &&mut TextOutput| text.is_alarm == is_alarm && text.now != text.told;
        let text = self.texts.iter_mut().find(untold)?;
        text.told = text.now;
        let now = text.now;
        (now != NO_TEXT).then(|| self.text_fault(now))
    }

    fn text_fault(&self, text: u64) -> Fault {
        Fault::LogicAlarm {
            task: self.number,
            text: text as u32,
        }
    }
}

#[cfg(test)]
mod tests;
