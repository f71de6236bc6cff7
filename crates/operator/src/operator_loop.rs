//! The operator's loop of a running control: orders, the program thread, whoever looks after it; until everything is over.
//!
//! In:  what the real-time threads show and report, a wish to stop.
//! Out: orders to the cycle thread; how long the last program was planned to take.

use super::standby::{Clients, Part};
use super::systemd::{Service, ServiceStatus};
use crate::console::Operator;
use crate::memory::Memory;
use crate::path_judge::PathJudge;
use crate::program_reports::StandByReport;
use crate::report::ProgramReport;
use crate::session::{EXIT_RESTART, Program, Session, Task};
use crate::table_writer::Keeper;
use api::orders::OrderInbox;
use gcode::{CheckLimits, PinReader};
use host::capabilities;
use host::capabilities::Work;
use host::stalls::Stalls;
use host::wait::{monotonic_ns, to_next};
use machine::motion_settings::{ring_capacity, stop_ramp, stop_shares};
use machine::sequence::{Outcome, Step};
use machine::state::State;
use machine::tables::lock;
use motion::cancel::Cancel;
use motion::canon::Position;
use motion::element::Element;
use motion::ring::{self, Producer};
use motion::rt::Interpolator;
use program::text::Reader;
use program::{self, Begin, FeedError, Feeder, Threads, waits};
use rt::cycle_stats::Windows;
use rt::timeout;
use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::Duration;

/// Pause of the loop, which an order of a client ends.
const PAUSE: Duration = Duration::from_millis(10);
/// Pause of the planner while the ring is full, if no order wakes it.
const PLANNER_PAUSE: Duration = Duration::from_millis(5);
/// A cycle thread that has ended leaves this long to see what it ended with, ns.
const ENDED_NS: u64 = 500_000_000;
/// A cycle thread without a cycle for this long, ns, and through so many turns of this loop, is given up. A PC that stood still
/// (a virtual machine that its host did not run) goes on where it was.
const DEAD_NS: u64 = 5_000_000_000;
const DEAD_TURNS: u32 = 100;
/// A control that is silenced says so for this long before it ends, ns.
const SILENCED_NS: u64 = 500_000_000;
/// A time-out thread that has not looked for this long, ns, and through so many cycles and turns of this loop, hangs. It looks
/// every 10 ms at least.
const UNWATCHED_NS: u64 = 1_000_000_000;
const UNWATCHED_CYCLES: u64 = 100;
const UNWATCHED_TURNS: u32 = 20;

/// A control that runs, as the ordinary threads see it.
pub struct Running {
    /// Orders and what came of them.
    pub operator: Operator,
    /// What the time-out thread reports.
    pub reports: rtrb::Consumer<timeout::Report>,
    /// Shows whether it looks.
    pub watch: Arc<timeout::Watch>,
    /// There is a time-out thread; on paced time there is none.
    pub watched: bool,
    /// Cuts the figures of the cycle into windows.
    pub windows: Windows,
    /// The core of the real-time threads.
    pub cpu: usize,
}

/// Looks after a running control: shows its progress, measures, says when it is enough.
pub trait LoopTask {
    /// Called every few milliseconds, and once more when all is over. Must not wait for anything.
    fn tick(&mut self, running: &mut Running, now_ns: u64);
}

/// The loop of one session.
pub(super) struct OperatorLoop<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    session: &'scope Session<'env>,
    /// Pins that programs may read.
    pins: PinReader,
    /// Ends all threads of the session.
    stop: &'scope AtomicBool,
    clients: Clients<'scope, 'env>,
    planner: Option<PlannerThread<'scope>>,
    /// Nobody wants the rest of the program that is being planned.
    given_up: Cancel,
    /// As [`Feeder::probed_time_s`] says of the last program.
    probed_time_s: Option<f64>,
    /// The modes that the last program has left, until it is known how it ended.
    modes_left: Option<gcode::Modes>,
    /// The work system that was in force before the program under way, 1 for G54; `None`: it is known how the last one ended.
    system_before: Option<u8>,
    /// When the last program was begun, and the cycles left out by then; `None`: it is over.
    begun_ns: u64,
    begun_skipped: Option<u64>,
    keeper: Keeper<'scope, 'env>,
    stalls: Stalls,
    /// A stall of the cycle thread that is not told of yet, and the cycle in which it began.
    stalled: Option<(timeout::Report, u64)>,
    watcher: Watcher,
}

type PlannerThread<'scope> = ScopedJoinHandle<'scope, Planned>;

/// What the program thread ends with.
struct Planned {
    /// As [`Feeder::probed_time_s`] says.
    probed_time_s: Option<f64>,
    error: Option<FeedError>,
    /// What the program left for the machine to remember.
    left: gcode::Settings,
    /// The modes in which it left the machine.
    modes: gcode::Modes,
}

impl<'scope, 'env> OperatorLoop<'scope, 'env> {
    pub(super) fn new(
        scope: &'scope Scope<'scope, 'env>,
        session: &'scope Session<'env>,
        stop: &'scope AtomicBool,
        inbox: OrderInbox,
        pins: PinReader,
        cpu: usize,
        memory: Memory<'env>,
    ) -> OperatorLoop<'scope, 'env> {
        let stands_by = matches!(session.task, Task::StandBy);
        let clients = Clients::new(scope, session.config, session.tables, stands_by, inbox);
        OperatorLoop {
            scope,
            session,
            pins,
            stop,
            clients: match session.task {
                Task::Once(program, overview) => clients.of_program(program.name, overview),
                Task::Repeat(_) | Task::StandBy => clients,
            },
            keeper: Keeper::new(scope, session.tables, memory),
            planner: None,
            modes_left: None,
            system_before: None,
            begun_ns: 0,
            begun_skipped: None,
            given_up: Cancel::default(),
            probed_time_s: None,
            stalls: Stalls::new(cpu),
            stalled: None,
            watcher: Watcher::default(),
        }
    }

    /// Runs until everything is over; gives how long the last program was planned to take, as [`Feeder::probed_time_s`] says.
    pub(super) fn run(
        mut self,
        running: &mut Running,
        task: &mut dyn LoopTask,
        cycle_thread_lives: &dyn Fn() -> bool,
    ) -> anyhow::Result<Option<f64>> {
        let mut service = Service::from_environment();
        let (mut cycles, mut cycles_since_ns, mut turns) = (0, monotonic_ns(), 0);
        let mut silenced_ns = None;
        loop {
            let now_ns = monotonic_ns();
            let live = running.operator.live();
            if live.state == State::Silenced && self.session.signal.caught().is_none() {
                // Whoever asks meanwhile is told.
                if now_ns - *silenced_ns.get_or_insert(now_ns) > SILENCED_NS {
                    break;
                }
            } else if running.operator.outcome().is_some() {
                break;
            }
            if live.cycles != cycles {
                (cycles, cycles_since_ns, turns) = (live.cycles, now_ns, 0);
            } else if now_ns - cycles_since_ns > ENDED_NS && !cycle_thread_lives() {
                break;
            } else if now_ns - cycles_since_ns > DEAD_NS && turns > DEAD_TURNS {
                // It cannot be joined either: the end of the process is what is left.
                let _ = writeln!(
                    files::printed::stderr(),
                    "isocnc: the cycle thread has stopped; nothing leads the machine any more, which stops by itself: {}",
                    self.stalls.evidence(now_ns)
                );
                std::process::exit(i32::from(EXIT_RESTART));
            }
            turns += 1;
            if self.session.signal.caught().is_some() {
                service.stopping();
            }
            self.step(running, now_ns)?;
            task.tick(running, now_ns);
            self.notify_service(&mut service, &running.operator, now_ns);
            self.clients.wait(to_next(PAUSE));
        }
        service.stopping();
        task.tick(running, monotonic_ns());
        self.notify_service(&mut service, &running.operator, monotonic_ns());
        self.stop.store(true, Ordering::Release);
        self.clients.give_up_check();
        self.clients.give_up_drawing();
        self.given_up.cancel();
        // What it may still find wrong concerns nobody any more.
        if let Some(Ok(planned)) = self.planner.take().map(ScopedJoinHandle::join) {
            self.probed_time_s = planned.probed_time_s;
            self.keep(planned.left, &mut running.operator);
        }
        let outcome = running.operator.outcome().unwrap_or(Outcome::Faulted);
        self.settle(outcome);
        self.end_program(running, outcome, monotonic_ns());
        self.keeper.finish(&mut running.operator);
        Ok(self.probed_time_s)
    }

    fn step(&mut self, running: &mut Running, now_ns: u64) -> anyhow::Result<()> {
        if self.session.signal.caught().is_some() {
            running.operator.end(now_ns);
            self.clients.give_up_check();
        }
        let is_planning = self.planner.is_some();
        self.clients
            .serve(&mut running.operator, &mut self.keeper, is_planning, now_ns);
        let (ticks, cycles) = (running.watch.counters().ticks, running.operator.live().cycles);
        while let Ok(report) = running.reports.pop() {
            match report.event {
                // The kernel counts a wait for the core once it is over.
                timeout::Event::CycleStarved { .. } => self.stalled = Some((report, cycles)),
                timeout::Event::PresTimeout { .. }
                | timeout::Event::AsyncTimeout { .. }
                | timeout::Event::CycleLate { .. }
                | timeout::Event::CycleHung { .. } => {
                    let evidence = || self.stalls.evidence(now_ns).to_string();
                    running.operator.hear(&report, evidence);
                }
            }
        }
        if let Some((report, _)) = self.stalled.take_if(|(_, stalled_at)| cycles > *stalled_at) {
            let evidence = || self.stalls.evidence(now_ns).to_string();
            running.operator.hear(&report, evidence);
        }
        if self.stalled.is_none() {
            self.stalls.update(now_ns);
        }
        if running.watched && self.watcher.is_gone(now_ns, ticks, cycles) {
            running.operator.is_unwatched(now_ns);
        }
        match running.operator.step() {
            // What is left of it to come to rest on is in the ring already.
            Step::StandBy | Step::Disable | Step::ShutDown | Step::Done => self.given_up.cancel(),
            Step::Network | Step::Enable | Step::Home | Step::Program | Step::Stop => {}
        }
        if let Some(position) = running.operator.poll(now_ns) {
            // A program that is repeated has come to its end: nobody waits for the machine any more.
            self.given_up.cancel();
            self.join_planner(running, now_ns);
            self.end_program(running, Outcome::Completed, now_ns);
            let is_mdi = self.clients.part().is_some_and(|part| part.is_mdi());
            if let (Task::Once(..) | Task::StandBy, false) = (self.session.task, is_mdi) {
                self.begun_ns = now_ns;
                self.begun_skipped = Some(running.operator.live().cycles_skipped);
                let name = self.program_name().unwrap_or_default().to_owned();
                running.operator.begin_program(&name);
                self.keeper.memory.begin_program(&name);
                let tools = self.clients.part().map_or(&[][..], |part| &part.overview.tools);
                self.keeper.begin_program(tools, &mut running.operator);
            }
            // Tools that the run before has changed are where the next one begins.
            self.keeper.look(&mut running.operator, now_ns);
            let program = self.plan_from(position, &mut running.operator)?;
            running.operator.start(program, is_mdi);
        }
        running.operator.recorder.judge(false);
        if self.planner.as_ref().is_some_and(ScopedJoinHandle::is_finished) {
            self.join_planner(running, now_ns);
        }
        if self.planner.is_none()
            && let Some(outcome) = running.operator.program_outcome()
        {
            self.end_program(running, outcome, now_ns);
            if let Some(modes) = self.modes_left.take() {
                self.settle(outcome);
                self.clients
                    .adopt_modes(Some(modes).filter(|_| outcome == Outcome::Completed));
            }
        }
        if self.planner.is_none() && running.operator.step() != Step::Program {
            self.keeper.poll(&mut running.operator);
        }
        self.keeper.look(&mut running.operator, now_ns);
        Ok(())
    }

    /// The program under way is over, if there is one: counts it, and keeps its report.
    fn end_program(&mut self, running: &mut Running, outcome: Outcome, now_ns: u64) {
        let Some(skipped_before) = self.begun_skipped.take() else {
            return;
        };
        let operator = &mut running.operator;
        operator.recorder.judge(true);
        let took_s = now_ns.saturating_sub(self.begun_ns) as f64 * 1e-9;
        let code = outcome.code();
        let line = operator.recorder.last_line();
        let is_dry = self.clients.part().is_some_and(|part| part.dry_feed_min().is_some());
        let is_part = outcome == Outcome::Completed && !is_dry;
        self.keeper.memory.end_program(code, is_part, line);
        if is_part {
            self.keeper.made_part(operator);
        }
        let mut number = None;
        if let (Task::StandBy, Some(part)) = (self.session.task, self.clients.part()) {
            let config = self.session.config;
            let warnings = operator.warnings_of_program();
            let (planned_s, outcome) = (self.probed_time_s, Some(outcome));
            let run = ProgramReport::new(
                config,
                operator,
                &part.name,
                &part.overview,
                planned_s,
                outcome,
                warnings,
            );
            number = Some(self.keeper.memory.add_report(|number, parts| StandByReport {
                number,
                machine: config.name.clone(),
                begun_unix_s: operator.program_begun_unix_s(),
                took_s,
                parts,
                cycles_skipped: operator.live().cycles_skipped - skipped_before,
                run,
            }));
        }
        operator.end_program(code, took_s, number);
    }

    /// A program that is repeated measures something and leaves nothing behind.
    fn keep(&mut self, left: gcode::Settings, operator: &mut Operator) {
        match self.session.task {
            Task::Once(..) | Task::StandBy => {
                for what in self.keeper.hand_in(left) {
                    operator.add_entry(what);
                }
            }
            Task::Repeat(_) => {}
        }
    }

    /// It is known how the last program has ended. One that was given up leaves the work system as it was: what was read of it, the
    /// machine may never have come to.
    fn settle(&mut self, outcome: Outcome) {
        let before = self.system_before.take().filter(|_| outcome != Outcome::Completed);
        match self.session.task {
            Task::Once(..) | Task::StandBy => before.into_iter().for_each(|before| self.keeper.give_up(before)),
            Task::Repeat(_) => {}
        }
    }

    /// Tells systemd how things are.
    fn notify_service(&self, service: &mut Service, operator: &Operator, now_ns: u64) {
        let live = operator.live();
        let sight = ServiceStatus {
            state: live.state,
            cycles: live.cycles,
            alarm: operator.alarm().map(|alarm| alarm.cause.text.as_str()),
            program: match operator.step() {
                Step::StandBy => None,
                _ => self.program_name(),
            },
            stands_by: operator.step() == Step::StandBy,
        };
        service.notify(now_ns, &sight);
    }

    fn program_name(&self) -> Option<&str> {
        match &self.session.task {
            Task::Once(program, _) | Task::Repeat(program) => Some(program.name),
            Task::StandBy => self.clients.part().map(|part| part.name.as_str()),
        }
    }

    /// Starts the program thread.
    fn plan_from(&mut self, position: Position, operator: &mut Operator) -> anyhow::Result<Box<Interpolator>> {
        let Session {
            config, task, tables, ..
        } = self.session;
        let tables = lock(tables).clone();
        self.system_before = Some(tables.work_system());
        let (producer, consumer) = ring::channel(ring_capacity(config));
        let (answers, results) = waits::line();
        let (told, news) = mpsc::channel();
        let (messages, heard) = mpsc::channel();
        operator.hear_messages(heard);
        let (modes, modes_heard) = mpsc::channel();
        self.clients.follow_modes(modes_heard);
        let messages_reached = Arc::new(AtomicU32::new(0));
        let reached = Arc::clone(&messages_reached);
        let live = operator.shared();
        live.pockets.set(tables.tools());
        let judged = match (task, self.clients.part()) {
            (Task::Once(_, overview), _) => Some(overview.tolerance_mm),
            (Task::StandBy, Some(part)) if !part.is_mdi() => Some(part.overview.tolerance_mm),
            (Task::StandBy | Task::Repeat(_), _) => None,
        };
        let passed = judged.map(|tolerance_mm| {
            let judge = PathJudge::new(news, tolerance_mm);
            let passed = judge.passed();
            operator.recorder.judge_with(judge);
            passed
        });
        let text = match (task, self.clients.part()) {
            (Task::Once(program, _) | Task::Repeat(program), _) => Text::Given(*program),
            (Task::StandBy, Some(part)) => Text::Asked(Arc::clone(part)),
            (Task::StandBy, None) => anyhow::bail!("a program was begun that is not there"),
        };
        let stop = self.stop;
        self.given_up = Cancel::default();
        let given_up = self.given_up.clone();
        let pins = self.pins.clone();
        let planner = std::thread::Builder::new()
            .name("program".into())
            .spawn_scoped(self.scope, move || {
                capabilities::give_up_or_warn(Work::Ordinary);
                let over = || stop.load(Ordering::Acquire) || given_up.is_cancelled();
                std::thread::scope(|scope| {
                    // Its threads inherit from here that they keep off the core of real time, and have no rights.
                    let threads = Threads::new(program::threads(config), scope);
                    let machine = (*config, &tables);
                    let mut feeder = Feeder::in_threads(machine, text.reader(), position, producer, threads)
                        .beside(text.name())
                        .within(running_limits(given_up.clone()))
                        .reading_pins(pins)
                        .beginning(&text.begin(position))
                        .telling_modes(modes)
                        .with_probe(results)
                        .following(live)
                        .telling_path(told)
                        .telling_messages(messages)
                        .saying(reached);
                    if let Some(passed) = passed {
                        feeder = feeder.keeping_near(passed);
                    }
                    feed(feeder, over)
                })
            })?;
        self.planner = Some(planner);
        let interpolator = Interpolator::new(consumer, position, stop_ramp(config)).counting_messages(messages_reached);
        Ok(Box::new(interpolator.with_probe(answers, stop_shares(config))))
    }

    fn join_planner(&mut self, running: &mut Running, now_ns: u64) {
        match self.planner.take().map(ScopedJoinHandle::join) {
            None => {}
            Some(Ok(Planned {
                probed_time_s,
                error,
                left,
                modes,
            })) => {
                self.modes_left = Some(modes);
                self.probed_time_s = probed_time_s;
                self.keep(left, &mut running.operator);
                if let Some(error) = error {
                    let name = self.program_name().unwrap_or_default();
                    running.operator.fail(now_ns, error.located(name));
                }
            }
            Some(Err(_)) => running.operator.fail(
                now_ns,
                "the planner panicked; the machine rests at the end of its plan".into(),
            ),
        }
    }
}

/// Sees whether the time-out thread still looks.
#[derive(Debug, Default)]
struct Watcher {
    ticks: u64,
    /// When and in which cycle it was last seen to look.
    seen: (u64, u64),
    /// Turns of the loop since.
    turns: u32,
}

impl Watcher {
    /// Whether it has not looked for long while everything else went on. A PC that stands still is no such thing, nor is a
    /// control in which no cycle runs: that has a limit of its own.
    fn is_gone(&mut self, now_ns: u64, ticks: u64, cycles: u64) -> bool {
        if ticks != self.ticks || self.turns == 0 {
            *self = Watcher {
                ticks,
                seen: (now_ns, cycles),
                turns: 1,
            };
            return false;
        }
        self.turns = self.turns.saturating_add(1);
        let (seen_ns, seen_at) = self.seen;
        now_ns - seen_ns > UNWATCHED_NS && cycles - seen_at > UNWATCHED_CYCLES && self.turns > UNWATCHED_TURNS
    }
}

/// Text of a program.
enum Text<'env> {
    /// That of the session.
    Given(Program<'env>),
    /// That of a client.
    Asked(Arc<Part>),
}

impl Text<'_> {
    fn reader(&self) -> Reader<'_> {
        match self {
            Text::Given(program) => program.text,
            Text::Asked(part) => Reader::from(&*part.text),
        }
    }

    fn name(&self) -> &str {
        match self {
            Text::Given(program) => program.name,
            Text::Asked(part) => &part.name,
        }
    }

    fn begin(&self, at: Position) -> Begin {
        match self {
            Text::Given(_) => Begin::Program { at },
            Text::Asked(part) => part.begin.moved_to(at),
        }
    }
}

/// A program that runs may take as long as it likes, but a loop without a move would have the machine wait for ever.
fn running_limits(cancel: Cancel) -> CheckLimits {
    CheckLimits {
        steps: u64::MAX,
        time: Duration::MAX,
        cancel,
        ..CheckLimits::default()
    }
}

/// The program thread: plans until the machine has come to the end of the program, as overrides may change till then, or
/// until nobody wants it any more.
fn feed(mut feeder: Feeder<'_, Producer<Element>>, over: impl Fn() -> bool) -> Planned {
    let mut failed = None;
    while !over() {
        match feeder.pump() {
            Ok(program::Progress::Working) => {}
            Ok(program::Progress::Done) if feeder.is_over() => break,
            Ok(program::Progress::RingFull | program::Progress::Waiting | program::Progress::Done) => {
                feeder.pause(to_next(PLANNER_PAUSE));
            }
            Err(_) if over() => break,
            Err(error) => {
                failed = Some(error);
                break;
            }
        }
    }
    feeder.give_up_contact();
    if let Err(error) = feeder.say_reached() {
        failed.get_or_insert(error);
    }
    Planned {
        probed_time_s: feeder.probed_time_s(),
        error: failed,
        left: feeder.left_behind(),
        modes: feeder.modes_left(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_time_out_thread_that_looks_no_more_is_missed_only_while_everything_else_goes_on() {
        // Turns of 10 ms with ten cycles each; then nothing of it looks any more.
        let turns = |ticks_to: u64, cycles_to: u64, turn_ms: u64| {
            let mut watcher = Watcher::default();
            let mut turns = 0..400_u64;
            turns.find(|turn| {
                let (ticks, cycles) = ((turn * 10).min(ticks_to), (turn * 10).min(cycles_to));
                watcher.is_gone(turn * turn_ms * MS, ticks, cycles)
            })
        };
        assert_eq!(turns(u64::MAX, u64::MAX, 10), None);
        assert_eq!(turns(1_000, u64::MAX, 10), Some(201), "a second and a turn later");
        assert_eq!(turns(1_000, 1_050, 10), None, "no cycle runs either");
        assert_eq!(
            turns(1_000, u64::MAX, 1_000),
            Some(120),
            "the PC stood still between two turns"
        );
    }
}
