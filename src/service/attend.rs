//! The operator's loop of a running control: orders, the program thread, whoever looks after it; until everything is over.
//!
//! In:  what the real-time threads show and report, a wish to stop.
//! Out: orders to the cycle thread; what was planned of the last program.

use super::desk::Desk;
use super::keeper::Keeper;
use super::operator::{Operator, Wish};
use super::process::{Session, Task};
use super::standby::{Clients, Part};
use super::systemd::{Service, Sight};
use crate::machine::sequence::Step;
use crate::machine::tables::lock;
use crate::program::{self, FeedError, Feeder, probing, ring_capacity, stop_ramp, stop_shares};
use crate::rt::figures::Windows;
use crate::rt::rights::{self, Work};
use crate::rt::shared::Live;
use crate::rt::timeout;
use crate::rt::wait::{monotonic_ns, to_next};
use gcode::CheckLimits;
use motion::cancel::Cancel;
use motion::canon::Position;
use motion::element::Element;
use motion::plan::Programmed;
use motion::ring::{self, Producer};
use motion::rt::Interpolator;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::Duration;

/// Pause of the loop.
const PAUSE: Duration = Duration::from_millis(10);
/// Pause of the planner while the ring is full, if no order wakes it.
const PLANNER_PAUSE: Duration = Duration::from_millis(5);
/// A cycle thread that has ended leaves this long to see what it ended with, ns.
const ENDED_NS: u64 = 500_000_000;
/// A cycle thread without a cycle for this long is given up, ns.
const DEAD_NS: u64 = 5_000_000_000;
/// Pieces of the programmed path that are kept for the report.
const PATH_MAX: usize = 500_000;

/// A control that runs, as the ordinary threads see it.
pub struct Running {
    /// Orders and what came of them.
    pub operator: Operator,
    /// What the time-out thread reports.
    pub reports: rtrb::Consumer<timeout::Report>,
    /// Cuts the figures of the cycle into windows.
    pub windows: Windows,
    /// The core of the real-time threads.
    pub cpu: usize,
}

/// Looks after a running control: shows its progress, measures, says when it is enough.
pub trait Attendant {
    /// Called every few milliseconds, and once more when all is over. Must not wait for anything.
    fn attend(&mut self, running: &mut Running, now_ns: u64);
}

/// The loop of one session.
pub(super) struct Attendance<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    session: &'scope Session<'env>,
    /// Ends all threads of the session.
    stop: &'scope AtomicBool,
    clients: Clients<'scope, 'env>,
    planner: Option<PlannerThread<'scope>>,
    /// Nobody wants the rest of the program that is being planned.
    given_up: Cancel,
    ran: Ran,
    keeper: Keeper<'scope, 'env>,
}

type PlannerThread<'scope> = ScopedJoinHandle<'scope, Planned>;

/// What was planned of a program while it ran.
#[derive(Debug, Default)]
pub(super) struct Ran {
    /// The programmed path as far as it was planned; of probing moves what they went.
    pub(super) path: Vec<Programmed>,
    /// As [`Feeder::probed_time_s`] says.
    pub(super) probed_time_s: Option<f64>,
}

/// What the program thread ends with.
struct Planned {
    ran: Ran,
    error: Option<FeedError>,
    /// What the program left for the machine to remember.
    left: gcode::Settings,
}

impl<'scope, 'env> Attendance<'scope, 'env> {
    pub(super) fn new(
        scope: &'scope Scope<'scope, 'env>,
        session: &'scope Session<'env>,
        stop: &'scope AtomicBool,
        desk: Desk,
    ) -> Attendance<'scope, 'env> {
        let stands_by = matches!(session.task, Task::StandBy);
        Attendance {
            scope,
            session,
            stop,
            clients: Clients::new(scope, session.config, session.tables, stands_by, desk),
            keeper: Keeper::new(scope, session.tables),
            planner: None,
            given_up: Cancel::default(),
            ran: Ran::default(),
        }
    }

    /// Runs until everything is over; gives what was planned of the last program.
    pub(super) fn run(
        mut self,
        running: &mut Running,
        attendant: &mut dyn Attendant,
        cycle_thread_lives: &dyn Fn() -> bool,
    ) -> anyhow::Result<Ran> {
        let mut service = Service::from_environment();
        let (mut cycles, mut cycles_since_ns) = (0, monotonic_ns());
        while running.operator.outcome().is_none() {
            let now_ns = monotonic_ns();
            let live = running.operator.live();
            if live.cycles != cycles {
                (cycles, cycles_since_ns) = (live.cycles, now_ns);
            } else if now_ns - cycles_since_ns > ENDED_NS && !cycle_thread_lives() {
                break;
            } else if now_ns - cycles_since_ns > DEAD_NS {
                // It cannot be joined either: the end of the process is what is left.
                let _ = writeln!(
                    std::io::stderr(),
                    "isocnc: the cycle thread has stopped; the drives stop for want of SoC"
                );
                std::process::exit(1);
            }
            if self.session.signal.caught().is_some() {
                service.stopping();
            }
            self.step(running, now_ns)?;
            attendant.attend(running, now_ns);
            self.tell(&mut service, &running.operator, now_ns);
            std::thread::sleep(to_next(PAUSE));
        }
        service.stopping();
        attendant.attend(running, monotonic_ns());
        self.tell(&mut service, &running.operator, monotonic_ns());
        self.stop.store(true, Ordering::Release);
        self.clients.give_up_check();
        self.given_up.cancel();
        // What it may still find wrong concerns nobody any more.
        if let Some(Ok(planned)) = self.planner.take().map(ScopedJoinHandle::join) {
            self.ran = planned.ran;
            self.keep(planned.left);
        }
        self.keeper.finish(&mut running.operator);
        Ok(self.ran)
    }

    fn step(&mut self, running: &mut Running, now_ns: u64) -> anyhow::Result<()> {
        if self.session.signal.caught().is_some() {
            running.operator.end(now_ns);
            self.clients.give_up_check();
        }
        self.clients.attend(&mut running.operator, now_ns)?;
        while let Ok(report) = running.reports.pop() {
            running.operator.hear(&report);
        }
        match running.operator.step() {
            // What is left of it to come to rest on is in the ring already.
            Step::StandBy | Step::Disable | Step::ShutDown | Step::Done => self.given_up.cancel(),
            Step::Network | Step::Enable | Step::Home | Step::SetUp | Step::Program | Step::Stop => {}
        }
        if let Wish::PlanFrom(position) = running.operator.poll(now_ns) {
            // A program that is repeated has come to its end: nobody waits for the machine any more.
            self.given_up.cancel();
            self.join_planner(running, now_ns);
            let live = running.operator.shared();
            let program = self.plan_from(position, live)?;
            running.operator.start(program);
        }
        if self.planner.as_ref().is_some_and(ScopedJoinHandle::is_finished) {
            self.join_planner(running, now_ns);
        }
        if self.planner.is_none() && running.operator.step() != Step::Program {
            self.keeper.attend(&mut running.operator)?;
        }
        Ok(())
    }

    /// A program that is repeated measures something and leaves nothing behind.
    fn keep(&mut self, left: gcode::Settings) {
        match self.session.task {
            Task::Once(_) | Task::StandBy => self.keeper.take(left),
            Task::Repeat(_) => {}
        }
    }

    /// Tells systemd how things are.
    fn tell(&self, service: &mut Service, operator: &Operator, now_ns: u64) {
        let live = operator.live();
        let sight = Sight {
            state: live.state,
            cycles: live.cycles,
            alarm: operator.alarm().map(|alarm| alarm.cause.as_str()),
            program: match operator.step() {
                Step::StandBy | Step::SetUp => None,
                _ => self.program_name(),
            },
            stands_by: operator.step() == Step::StandBy,
        };
        service.attend(now_ns, &sight);
    }

    fn program_name(&self) -> Option<&str> {
        match &self.session.task {
            Task::Once(program) | Task::Repeat(program) => Some(program.name),
            Task::StandBy => self.clients.part().map(|part| part.name.as_str()),
        }
    }

    /// Starts the program thread.
    fn plan_from(&mut self, position: Position, live: Arc<Live>) -> anyhow::Result<Box<Interpolator>> {
        let Session {
            config, task, tables, ..
        } = self.session;
        let tables = lock(tables).clone();
        let (producer, consumer) = ring::channel(ring_capacity(config));
        let (answers, results) = probing::line();
        let (text, path_max) = match (task, self.clients.part()) {
            (Task::Once(program), _) => (Text::Given(program.text), PATH_MAX),
            (Task::Repeat(program), _) => (Text::Given(program.text), 0),
            (Task::StandBy, Some(part)) => (Text::Asked(Arc::clone(part)), 0),
            (Task::StandBy, None) => anyhow::bail!("a program was begun that is not there"),
        };
        let stop = self.stop;
        self.given_up = Cancel::default();
        let given_up = self.given_up.clone();
        let planner = std::thread::Builder::new()
            .name("program".into())
            .spawn_scoped(self.scope, move || {
                rights::give_up_or_warn(Work::Ordinary);
                // They inherit from here that they keep off the core of real time, and have no rights.
                let workers = program::workers(config);
                let feeder = Feeder::with_workers(config, &tables, text.octets(), position, producer, &workers)
                    .with_probe(results)
                    .within(running_limits(given_up.clone()))
                    .following(live);
                let over = || stop.load(Ordering::Acquire) || given_up.is_cancelled();
                feed(feeder, path_max, over)
            })?;
        self.planner = Some(planner);
        let interpolator = Interpolator::new(consumer, position, stop_ramp(config));
        Ok(Box::new(interpolator.with_probe(answers, stop_shares(config))))
    }

    fn join_planner(&mut self, running: &mut Running, now_ns: u64) {
        match self.planner.take().map(ScopedJoinHandle::join) {
            None => {}
            Some(Ok(Planned { ran, error, left })) => {
                self.ran = ran;
                self.keep(left);
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

/// Text of a program.
enum Text<'env> {
    /// That of the session.
    Given(&'env [u8]),
    /// That of a client.
    Asked(Arc<Part>),
}

impl Text<'_> {
    fn octets(&self) -> &[u8] {
        match self {
            Text::Given(text) => text,
            Text::Asked(part) => &part.text,
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
fn feed(mut feeder: Feeder<'_, Producer<Element>>, path_max: usize, over: impl Fn() -> bool) -> Planned {
    let mut path = Vec::new();
    let mut failed = None;
    while !over() {
        let progress = feeder.pump();
        let room = path_max.saturating_sub(path.len());
        path.extend(feeder.ideal_path().take(room));
        match progress {
            Ok(program::Progress::Working) => {}
            Ok(program::Progress::Done) if feeder.is_over() => break,
            Ok(program::Progress::RingFull | program::Progress::Probing | program::Progress::Done) => {
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
    let room = path_max.saturating_sub(path.len());
    path.extend(feeder.ideal_path().take(room));
    let probed_time_s = feeder.probed_time_s();
    Planned {
        ran: Ran { path, probed_time_s },
        error: failed,
        left: feeder.left_behind(),
    }
}
