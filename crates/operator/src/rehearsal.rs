//! A whole run on virtual time: control, bus, simulated machine and planner in one thread.
//!
//! In:  a machine file, a program, a wire with a seed and disturbances.
//! Out: everything that a real run gives, the same bits each time.
//!
//! The cycle is the very same code as in real time; only the clock and the wire differ.

use super::console::Operator;
use crate::session::pin_reader;
use anyhow::anyhow;
use config::Config;
use hal_pins::Hal;
use host::wait::Grid;
use machine::motion_settings::{ring_capacity, stop_ramp, stop_shares};
use machine::sequence::{Outcome, Step};
use machine::tables::Tables;
use motion::element::Element;
use motion::plan::Programmed;
use motion::ring::{self, Producer};
use motion::rt::Interpolator;
use program::{Begin, Feeder, Progress, waits};
use rt::assemble::assemble;
use rt::cycle::MotionController;
use rt::phase::{Phase, PhaseFigures};
use rt::pins::capacity;
use rt::thread::{Steering, grid};
use sim::near_end::{VirtualBus, VirtualTime, with_virtual};
use sim::{NetConfig, VirtualNet, stepper};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, mpsc};

/// Cycles between two looks of the operator.
const OPERATOR_CYCLES: u64 = 10;

/// A run on virtual time.
pub struct Rehearsal<'a, B = VirtualBus<'a>> {
    /// The cycle thread's part.
    pub control: Box<MotionController<B>>,
    /// The operator's part.
    pub operator: Operator,
    pub hal: Hal,
    config: &'a Config,
    tables: Tables,
    text: &'a [u8],
    /// How a program of a client begins, and whether it is a line of MDI; `None`: the one that the run was built with.
    asked: Option<(Begin, bool)>,
    left: Option<(gcode::Settings, gcode::Modes)>,
    feeder: Option<Feeder<'a, Producer<Element>>>,
    path: Vec<Programmed>,
    probed_time_s: Option<f64>,
    grid: Grid,
    steering: Steering,
    phase: Phase,
    deadline_ns: u64,
    skipped: u64,
    cycles: u64,
    /// The planner works in every cycle of this number only: 1, unless it shall be short of time.
    pub feed_every: u64,
}

/// Builds a run and hands it to `act`.
///
/// # Errors
/// If the machine file describes no machine that can be simulated, or what `act` gives.
pub fn rehearse<T>(
    config: &Config,
    text: &[u8],
    net: NetConfig,
    act: impl FnOnce(&mut Rehearsal<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    rehearse_with(config, text, net, |operator| operator, act)
}

/// As [`rehearse`], with an operator who does something else than running the program once: `operator` makes him so.
///
/// # Errors
/// As [`rehearse`].
pub fn rehearse_with<T>(
    config: &Config,
    text: &[u8],
    net: NetConfig,
    operator: impl FnOnce(Operator) -> Operator,
    act: impl FnOnce(&mut Rehearsal<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    with_virtual(config, net, |bus| rehearse_on(config, text, bus, operator, act))
}

/// As [`rehearse_with`], on any bus.
///
/// # Errors
/// As [`rehearse`].
pub fn rehearse_on<'a, B: VirtualTime, T>(
    config: &'a Config,
    text: &'a [u8],
    bus: B,
    operator: impl FnOnce(Operator) -> Operator,
    act: impl FnOnce(&mut Rehearsal<'a, B>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let mut hal = private_pins(config)?;
    let (mut control, endpoints) = assemble(config, &bus::plan(config), bus, &mut hal)?;
    if let Some(port) = stepper::port(config) {
        control.steps_mut().set_port(port);
    }
    let grid = grid(config);
    let mut rehearsal = Rehearsal {
        control: Box::new(control),
        operator: operator(Operator::new(config, endpoints, 0)),
        hal,
        config,
        tables: Tables::read(config)?,
        text,
        asked: None,
        left: None,
        feeder: None,
        path: Vec::new(),
        probed_time_s: None,
        grid,
        steering: Steering::default(),
        phase: Phase::default(),
        deadline_ns: grid.first_after(0),
        skipped: 0,
        cycles: 0,
        feed_every: 1,
    };
    act(&mut rehearsal)
}

impl Rehearsal<'_> {
    /// The wire and the simulated machine behind it.
    pub fn net(&mut self) -> &mut VirtualNet {
        self.control.bus_mut().net()
    }
}

impl<'a, B: VirtualTime> Rehearsal<'a, B> {
    /// Virtual time, ns.
    pub fn now_ns(&mut self) -> u64 {
        self.control.bus_mut().now_ns()
    }

    /// Programmed path as far as it was planned, before corners were rounded; of probing moves what they went, once they are
    /// over.
    pub fn path(&self) -> &[Programmed] {
        &self.path
    }

    /// Planned time of a program whose probing moves ended at a contact: of what was really to be run, s.
    pub fn probed_time_s(&self) -> Option<f64> {
        self.probed_time_s
    }

    /// How the dates of cycles have lain to the clock of the bus since the last call; `None`: it does not lead.
    pub fn take_phase(&mut self) -> Option<PhaseFigures> {
        std::mem::take(&mut self.phase).figures()
    }

    /// What the next program is to be: a client's, in place of the one that the run was built with. Its errors while it runs are
    /// alarms.
    pub fn set_program(&mut self, text: &'a [u8], tables: Tables, begin: Begin, mdi: bool) {
        (self.text, self.tables, self.asked) = (text, tables, Some((begin, mdi)));
    }

    /// Whether the planner still works for the last program.
    pub fn is_planning(&self) -> bool {
        self.feeder.is_some()
    }

    /// Tables and modes that a program has left behind.
    pub fn take_left(&mut self) -> Option<(gcode::Settings, gcode::Modes)> {
        self.left.take()
    }

    /// One cycle, `late_ns` after its date; where that is too late for the date, at the next one that can be kept.
    ///
    /// # Errors
    /// If the program turns out to be wrong.
    pub fn cycle(&mut self, late_ns: u64) -> anyhow::Result<()> {
        self.control.serve(self.deadline_ns);
        self.control.prepare(self.deadline_ns);
        let behind_ns = self.deadline_ns.saturating_sub(self.now_ns());
        self.control.bus_mut().advance(behind_ns + late_ns);
        let now_ns = self.now_ns();
        let keep = self.grid.keep(self.deadline_ns, now_ns);
        if keep.skipped > 0 {
            (self.deadline_ns, self.skipped) = (keep.deadline_ns, self.skipped + keep.skipped);
            self.control.prepare(self.deadline_ns);
            let behind_ns = self.deadline_ns.saturating_sub(self.now_ns());
            self.control.bus_mut().advance(behind_ns);
        }
        let deadline_ns = self.deadline_ns;
        let began_ns = self.now_ns();
        let report = self.control.cycle(
            began_ns - deadline_ns,
            self.skipped,
            deadline_ns + self.grid.period_ns * 9 / 10,
        );
        if let Some(late_ns) = report.time.late_ns() {
            self.phase.record(late_ns);
        }
        let now_ns = self.now_ns();
        let begun_ns = deadline_ns.saturating_add_signed(self.steering.shift_ns(report.time));
        let next = self.grid.next(begun_ns, now_ns);
        (self.deadline_ns, self.skipped) = (next.deadline_ns, next.skipped);
        self.cycles += 1;
        if self.cycles.is_multiple_of(OPERATOR_CYCLES) {
            self.poll_operator(now_ns);
        }
        if self.cycles.is_multiple_of(self.feed_every) {
            self.feed()?;
        }
        Ok(())
    }

    /// Cycles until `done` says so; `false`: it did not within `cycles_max`.
    ///
    /// # Errors
    /// As [`Rehearsal::cycle`].
    pub fn run_until(&mut self, cycles_max: u64, mut done: impl FnMut(&mut Self) -> bool) -> anyhow::Result<bool> {
        for _ in 0..cycles_max {
            self.cycle(0)?;
            if done(self) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Runs to the end of everything.
    ///
    /// # Errors
    /// If it does not end within `cycles_max`.
    pub fn run(&mut self, cycles_max: u64) -> anyhow::Result<Outcome> {
        self.run_until(cycles_max, |rehearsal| rehearsal.operator.outcome().is_some())?;
        self.operator.outcome().ok_or_else(|| {
            anyhow!(
                "no end within {cycles_max} cycles; the journal says\n{:#?}",
                self.operator.journal()
            )
        })
    }

    fn poll_operator(&mut self, now_ns: u64) {
        if let Some(position) = self.operator.poll(now_ns) {
            let (producer, consumer) = ring::channel(ring_capacity(self.config));
            self.operator.shared().pockets.set(self.tables.tools());
            let (answers, results) = waits::line();
            let feeder = Feeder::new(self.config, &self.tables, self.text, position, producer);
            let (messages, heard) = mpsc::channel();
            self.operator.hear_messages(heard);
            let feeder = feeder.with_probe(results).reading_pins(pin_reader(&self.hal));
            let reached = Arc::new(AtomicU32::new(0));
            let mut feeder = feeder.telling_messages(messages).saying(Arc::clone(&reached));
            if let Some((begin, _)) = &self.asked {
                feeder = feeder.beginning(&begin.moved_to(position));
            }
            self.feeder = Some(feeder.following(self.operator.shared()));
            let program = Interpolator::new(consumer, position, stop_ramp(self.config))
                .with_probe(answers, stop_shares(self.config))
                .counting_messages(reached);
            let is_mdi = self.asked.as_ref().is_some_and(|(_, mdi)| *mdi);
            self.operator.start(Box::new(program), is_mdi);
        }
    }

    fn feed(&mut self) -> anyhow::Result<()> {
        if let Some(feeder) = &mut self.feeder {
            let given_up = self.asked.is_some() && self.operator.step() != Step::Program;
            let progress = match feeder.pump().map_err(|error| error.located("program")) {
                _ if given_up => Progress::Done,
                Ok(progress) => progress,
                Err(what) if self.asked.is_some() => {
                    let now_ns = self.control.bus_mut().now_ns();
                    self.operator.fail(now_ns, what);
                    Progress::Waiting
                }
                Err(what) => return Err(anyhow!(what)),
            };
            self.path.extend(feeder.ideal_path());
            self.probed_time_s = feeder.probed_time_s();
            if given_up || progress == Progress::Done && feeder.is_over() {
                feeder.give_up_contact();
                feeder
                    .say_reached()
                    .map_err(|error| anyhow!(error.located("program")))?;
                self.left = Some((feeder.left_behind(), feeder.modes_left()));
                self.feeder = None;
            }
        }
        Ok(())
    }
}

/// Pins under a name of their own, so that any number of rehearsals can run side by side.
fn private_pins(config: &Config) -> anyhow::Result<Hal> {
    static RUNS: AtomicU64 = AtomicU64::new(0);
    let name = format!("rehearsal-{}-{}", std::process::id(), RUNS.fetch_add(1, Relaxed));
    Ok(Hal::create_in(&[std::env::temp_dir()], &name, capacity(config))?)
}
