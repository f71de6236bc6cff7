//! The running process: threads, the end in good order.
//!
//! In:  a machine, what it is there for, a wire, somebody who looks after it.
//! Out: everything that is known of it at the end.

use crate::console::{Operator, look_at_tool};
use crate::journal_keeper;
use crate::memory::{self, Memory};
use crate::operator_loop::{LoopTask, OperatorLoop, Running};
use crate::retain_keeper;
use crate::service::{Service, Until};
use anyhow::{Context, anyhow};
use api::methods::Methods;
use api::network_view::NetworkView;
use api::orders::order_channel;
use api::server::door::Door;
use api::server::{self, Arrivals, Intake, Serve};
use api::socket::{BindError, Socket, path_beside};
use bus::sender::SoleSender;
use bus::watch::Watch;
use bus::{self, CyclicBus, NodeStatistics, Open};
use config::{Config, KeepAwake};
use gcode::PinReader;
use hal_pins::scope::Sampler;
use hal_pins::{AnyValue, Hal};
use host::calibrate::{Calibration, calibrate};
use host::capabilities;
use host::capabilities::Work;
use host::other_controls::CYCLE_THREAD;
use host::setup;
use host::setup::{Finding, Role, STACK_SIZE, by_cure, enter_thread};
use host::signals::{StopOnDrop, StopSignal};
use host::steadiness::Steadiness;
use host::step_port;
use host::terminal::say;
use host::wait::{Grid, monotonic_ns};
use machine::journal::{Entry, Journal};
use machine::state_file::{self, Opened, Remembered};
use machine::tables::{Tables, lock};
use motion::cancel::Cancel;
use motion::rt::Peaks;
use program::text::Reader;
use program::{Begin, Overview, check};
use protocol::message;
use rt::assemble::assemble;
use rt::cycle::MotionController;
use rt::cycle_stats;
use rt::cycle_stats::CycleFigures;
use rt::logic::{self, Desk, Scanner};
use rt::pins::capacity;
use rt::shared::OperatorEndpoints;
use rt::steps::{StepDrives, Ticker};
use rt::thread;
use rt::timeout::{self, Limits, TimeoutThread};
use sim::near_end;
use sim::paced::{Paced, run_paced};
use sim::stepper;
use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, mpsc};
use std::thread::Scope;
use terminal::refusal::Refusal;

/// Exit code of a control that cannot go on by itself and has to be restarted.
pub const EXIT_RESTART: u8 = 3;
/// A cycle thread that hung is given this long to end, in looks of 10 ms.
const END_LOOKS: u32 = 100;

/// A control from power-on to power-off.
pub struct Session<'a> {
    pub config: &'a Config,
    /// What the machine remembers.
    pub tables: &'a Mutex<Tables>,
    /// What it is there for.
    pub task: Task<'a>,
    /// Warn of nothing: the output is for a program.
    pub quiet: bool,
    /// Asks for a stop; caught since the command began, so that at no moment a signal just ends the process.
    pub signal: StopSignal,
    /// Keep the rights of this thread: another session follows in this process.
    pub keep_rights: bool,
    /// What it serves beside its socket.
    pub services: Vec<Box<dyn Service>>,
}

impl<'a> Session<'a> {
    /// The folder of the machine's state; `None`: nothing is remembered.
    fn state_folder(&self) -> Option<&'a PathBuf> {
        match self.task {
            Task::Once(..) | Task::StandBy => self.config.state_directory.as_ref(),
            Task::Repeat(_) => None,
        }
    }

    /// The folder of programs that a service receives.
    fn programs(&self) -> Option<PathBuf> {
        self.services
            .iter()
            .find_map(|service| service.programs())
            .map(Path::to_owned)
    }
}

/// A part program.
#[derive(Clone, Copy, Debug)]
pub struct Program<'a> {
    /// Its name, for messages.
    pub name: &'a str,
    pub text: Reader<'a>,
}

/// What a control does between homing and power-off.
#[derive(Clone, Copy, Debug)]
pub enum Task<'a> {
    /// Runs a program, which comes to this, and keeps a record of it.
    Once(Program<'a>, &'a Overview),
    /// Runs a program again and again until it is told to stop, in constant memory.
    Repeat(Program<'a>),
    /// Waits for programs of clients, drives off.
    StandBy,
}

/// The wire to the drives.
pub enum Wire {
    /// A network interface.
    Interface(String),
    /// Memory; the simulated machine of the machine file is at the other end, in this process.
    Memory,
    /// The same on paced time, for a PC that keeps no cycle: a date comes when everybody is ready for it.
    Paced,
}

/// What is known of a control that has ended.
pub struct Ended {
    /// Journal, alarms, outcome, what the program did.
    pub operator: Operator,
    /// Planned time of a program whose probing moves ended at a contact: of what was really to be run, s.
    pub probed_time_s: Option<f64>,
    /// How the cycle thread ran.
    pub figures: Box<CycleFigures>,
    /// Peaks of each joint.
    pub peaks: Vec<Peaks>,
    /// Frames of each node.
    pub statistics: Vec<NodeStatistics>,
    /// What the time-out thread counted.
    pub timeouts: timeout::Counters,
    /// The core of the real-time threads.
    pub cpu: usize,
    /// What kept it awake.
    pub kept_awake: KeepAwake,
    /// What this PC lacks.
    pub findings: Vec<Finding>,
    /// The timing: who chose it, and what was measured for it.
    pub calibration: Calibration,
}

/// Whether interface and name of a control are free: another one may have them.
///
/// # Errors
/// Who has them.
pub fn check_free(config: &Config, wire: &Wire) -> anyhow::Result<()> {
    if let Wire::Interface(interface) = wire {
        drop(SoleSender::claim(interface)?);
    }
    let hal = Hal::create(&config.name, capacity(config)).context("pins")?;
    match Socket::bind(&path_beside(hal.path(), &config.name)) {
        Err(error @ BindError::Running { .. }) => Err(error.into()),
        // Without a socket a control runs all the same.
        Ok(_) | Err(BindError::NoSocket { .. } | BindError::System { .. }) => Ok(()),
    }
}

/// What a control of this machine would not start with, or run no program with, as far as its files and this build of isocnc say.
/// Nothing is opened or written.
///
/// # Errors
/// The first of them.
pub fn check_start(config: &Config) -> anyhow::Result<()> {
    let tables = Tables::read(config).map_err(Refusal::from)?;
    if !config.joints.is_empty() {
        // What stands before every program: startup code.
        let begin = Begin::at_home(config);
        let name = config.path.display().to_string();
        check(config, &tables, &name, "M2\n", &begin, &Cancel::default())
            .map_err(|errors| Refusal::of_program(&name, &errors))?;
    }
    Ok(())
}

/// Runs a control from power-on to power-off; `task` looks after it meanwhile.
///
/// # Errors
/// What keeps it from starting; a thread that panicked. How the machine fared is no error but in [`Ended`].
pub fn run(session: &Session<'_>, wire: Wire, task: &mut dyn LoopTask) -> anyhow::Result<Ended> {
    // Before anything that takes time: nothing is to be tuned for a wire that is another one's.
    let _sole = match &wire {
        Wire::Interface(interface) => Some(SoleSender::claim(interface)?),
        Wire::Memory | Wire::Paced => None,
    };
    let mut process = setup::prepare_process(&session.config.rt)?;
    let calibration = calibrate(session.config, &mut process);
    if !session.quiet {
        for finding in by_cure(&process.findings) {
            // Nobody need be there to read it.
            let _ = writeln!(files::printed::stderr(), "warning: {finding}");
        }
        if !matches!(wire, Wire::Paced) {
            say(&format!("{calibration}\n"));
        }
        if let Wire::Interface(_) = wire
            && let Some(advice) = Steadiness::measure(&session.config.rt).advice(session.config)
        {
            let _ = writeln!(files::printed::stderr(), "warning: {advice}");
        }
    }
    let process = Arc::new(process);
    let config = session.config;
    logic::budget::of_machine(config)?;
    let watch = Arc::new(Watch::default());
    let in_memory = !matches!(wire, Wire::Interface(_));
    let near = |paced| NearEnd {
        process: &process,
        calibration,
        watch: Arc::clone(&watch),
        in_memory,
        paced,
    };
    match &wire {
        Wire::Interface(interface) => bus::with_interface(
            config,
            interface,
            Arc::clone(&watch),
            || capabilities::give_up_or_warn(Work::Ordinary),
            &mut |warning| _ = writeln!(files::printed::stderr(), "warning: {warning}"),
            |open| run_on(session, task, near(None), open),
        ),
        Wire::Paced => near_end::with_paced(config, Arc::clone(&watch), |open, wire| {
            run_on(session, task, near(Some(wire)), open)
        }),
        Wire::Memory => near_end::with_memory(config, Arc::clone(&watch), &process, |open| {
            run_on(session, task, near(None), open)
        }),
    }
}

/// What a session runs with, whatever its wire is.
struct NearEnd<'a> {
    process: &'a Arc<setup::Process>,
    calibration: Calibration,
    watch: Arc<Watch>,
    /// The nodes are simulated in this process.
    in_memory: bool,
    /// Time is that of this wire.
    paced: Option<Paced>,
}

fn run_on(
    session: &Session<'_>,
    task: &mut dyn LoopTask,
    near_end: NearEnd<'_>,
    open: Open<'_>,
) -> anyhow::Result<Ended> {
    let config = session.config;
    let NearEnd {
        process,
        calibration,
        watch,
        in_memory,
        paced,
    } = near_end;
    let rt = calibration.applied(&config.rt);
    let mut spin = calibration.spin(config);
    let grid = Grid {
        phase_ns: calibration.phase_ns(),
        ..thread::grid(config)
    };
    let mut hal = Hal::create(&config.name, capacity(config)).context("pins")?;
    let (control, endpoints) = assemble(config, &bus::plan(config), open.cyclic, &mut hal)?;
    // On the heap: it is larger than the stack of a real-time thread, which is locked in memory as a whole.
    let mut control = Box::new(control);
    let steps = pulses(config, control.steps_mut(), paced.is_some())?;
    let desk = control.logic_mut().desk();
    let (client, inbox) = order_channel();
    let view = network_view(config, in_memory);
    let methods = Methods::new(view, endpoints.live.clone(), open.service, client, monotonic_ns);
    let methods = methods
        .of_machine(config, pin_values(&hal), time_of_day, hal.path())
        .with_programs(session.programs())
        .with_logic(desk.clone());
    let socket = control_socket(hal.path(), &config.name)?;
    let (door, intake, arrivals) = server::entrance(methods.wake());
    sample(&hal, grid.period_ns, &mut control);

    let (recorder, windows) = cycle_stats::recorder(grid.period_ns);
    let (reports, watch_reports) = rtrb::RingBuffer::new(timeout::REPORTS);
    let Remembering {
        operator,
        journal,
        mut memory,
    } = remember(session, endpoints, &mut control)?;
    // On paced time the cycle runs them itself.
    let scanners = match paced {
        None => control.logic_mut().take_scanners(),
        Some(_) => Vec::new(),
    };
    let mut running = Running {
        operator,
        reports: watch_reports,
        watch: Arc::clone(&watch),
        watched: paced.is_none(),
        windows,
        cpu: process.cpu,
    };
    let stop = AtomicBool::new(false);
    let (figures, probed_time_s) = std::thread::scope(|scope| -> anyhow::Result<_> {
        let limits = Limits::for_machine(&config.bus, &rt, grid);
        // On paced time nobody can be late.
        let spawn = || TimeoutThread::spawn(Arc::clone(process), Arc::clone(&watch), limits, reports, steps);
        let timeouts = paced.is_none().then(spawn).transpose()?;
        let run_cycles = || match &paced {
            None => {
                // What is missing has been told by `prepare_process`.
                drop(enter_thread(Role::Cycle, process));
                thread::run(&mut *control, grid, &mut spin, &watch, recorder, &stop)
            }
            Some(wire) => {
                capabilities::give_up_or_warn(Work::Ordinary);
                run_paced(&mut *control, grid, wire, recorder, &stop)
            }
        };
        let builder = std::thread::Builder::new()
            .name(CYCLE_THREAD.into())
            .stack_size(STACK_SIZE);
        let cycle = builder.spawn_scoped(scope, run_cycles)?;
        let threads = Threads { scope, stop: &stop };
        threads.scan_logic(scanners, process)?;
        threads.keep_on_disk(session, journal, &mut memory, &desk)?;
        if socket.is_some() || !session.services.is_empty() {
            threads.serve_socket(socket.as_ref(), intake, methods, arrivals)?;
        }
        let ends = threads.serve(&session.services, &door)?;
        // Everything is open and every thread of the cycle runs.
        if !session.keep_rights {
            capabilities::give_up_or_warn(Work::Closing);
        }
        let ended = StopOnDrop(&stop);
        let lives = || !cycle.is_finished();
        let operator_loop = OperatorLoop::new(scope, session, &stop, inbox, pin_reader(&hal), process.cpu, memory);
        let probed_time_s = operator_loop.run(&mut running, task, &lives);
        drop(ended);
        drop(ends);
        running.operator.close_journal();
        let figures = end_of_cycles(cycle, &running.operator);
        drop(timeouts);
        Ok((figures?, probed_time_s?))
    })?;
    use_files_again();
    Ok(Ended {
        operator: running.operator,
        probed_time_s,
        figures,
        peaks: control.peaks(),
        statistics: (0..config.bus.nodes.len())
            .map(|node| control.bus_mut().statistics(node))
            .collect(),
        timeouts: watch.counters(),
        cpu: process.cpu,
        kept_awake: process.kept_awake(),
        findings: process.findings.clone(),
        calibration: Calibration {
            spin_raised_us: spin.raised_us(),
            ..calibration
        },
    })
}

/// What follows the end writes files as this user does.
fn use_files_again() {
    if let Err(cause) = capabilities::use_files() {
        // Folders that this user may write anyway are none the worse.
        let _ = writeln!(files::printed::stderr(), "warning: {cause}");
    }
}

/// Gives the steppers their port, of this PC or simulated; what makes their pulses beside the cycle.
fn pulses(config: &Config, steps: &mut StepDrives, is_paced: bool) -> anyhow::Result<Option<Ticker>> {
    let out_of_this_pc = config.steps.as_ref().map(step_port::open).transpose()?.flatten();
    if let Some(port) = out_of_this_pc.or_else(|| stepper::port(config)) {
        steps.set_port(port);
    }
    // On paced time the cycle makes its pulses itself.
    Ok(if is_paced { None } else { steps.take_ticker() })
}

/// Has each cycle sample pins for the oscilloscope.
fn sample<B: CyclicBus>(hal: &Hal, period_ns: u64, control: &mut MotionController<B>) {
    match Sampler::new(hal, period_ns) {
        Ok(scope) => control.set_scope(scope),
        // The machine runs as well without.
        Err(cause) => tracing::warn!("no oscilloscope: {cause}"),
    }
}

/// What clients see of the network.
fn network_view(config: &Config, in_memory: bool) -> NetworkView {
    let mut view = NetworkView::from_config(config);
    if in_memory {
        view.interface = "a wire in memory".into();
    }
    view
}

/// A journal on the disk, and what comes for it.
type OpenJournal = (Journal, mpsc::Receiver<Entry>, Arc<journal_keeper::Kept>);

/// Who looks after the machine, with all that is left of the last time.
struct Remembering<'a> {
    operator: Operator,
    journal: Option<OpenJournal>,
    memory: Memory<'a>,
}

/// Takes up what the last control of this machine has left: journal, state, retained values of the logic.
fn remember<'a, B: CyclicBus>(
    session: &Session<'a>,
    endpoints: OperatorEndpoints,
    control: &mut MotionController<B>,
) -> anyhow::Result<Remembering<'a>> {
    let config = session.config;
    let mut operator = Operator::new(config, endpoints, monotonic_ns());
    operator.log_mut().set_time_of_day(time_of_day);
    let journal = match &config.state_directory {
        Some(folder) => Some(open_journal(folder, &mut operator)?),
        None => None,
    };
    let remembered = match session.state_folder() {
        Some(folder) => recall(folder, &config.name, &mut operator),
        None => Remembered::default(),
    };
    if let Some(folder) = &config.state_directory {
        retain_keeper::recall(folder, &config.name, control.logic_mut(), &mut operator);
    }
    lock(session.tables).set_tool_in_spindle(remembered.tool);
    for warning in lock(session.tables).warnings() {
        operator.add_warning(warning);
    }
    judge_tool(&lock(session.tables), &remembered, &mut operator);
    let memory = Memory::new(config, remembered);
    for note in session.services.iter().filter_map(|service| service.note()) {
        operator.add_entry(note.to_owned());
    }
    Ok(Remembering {
        operator: match session.task {
            Task::Once(..) => operator,
            Task::Repeat(_) => operator.repeating(),
            Task::StandBy => operator.standing_by(),
        },
        journal,
        memory,
    })
}

/// Threads beside those of the cycle; they end once `stop` says so, or what feeds them is gone.
struct Threads<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    stop: &'scope AtomicBool,
}

impl<'scope> Threads<'scope, '_> {
    /// Starts one, with a stack of so many octets or that of the system.
    fn named(
        &self,
        name: impl Into<String>,
        stack: Option<usize>,
        work: impl FnOnce() + Send + 'scope,
    ) -> std::io::Result<()> {
        let builder = std::thread::Builder::new().name(name.into());
        let builder = match stack {
            Some(octets) => builder.stack_size(octets),
            None => builder,
        };
        builder.spawn_scoped(self.scope, work).map(drop)
    }

    /// Scans the logic, the fastest program with the highest priority.
    fn scan_logic(&self, mut scanners: Vec<Scanner>, process: &Arc<setup::Process>) -> std::io::Result<()> {
        scanners.sort_by_key(Scanner::period_ns);
        for (rank, mut scanner) in scanners.into_iter().enumerate() {
            let (stop, process) = (self.stop, Arc::clone(process));
            self.named(format!("rt-logic {}", scanner.number()), Some(STACK_SIZE), move || {
                drop(enter_thread(Role::Logic(rank as u8), &process));
                logic::run(&mut scanner, stop);
            })?;
        }
        Ok(())
    }

    /// Keeps on the disk what the next control is to know.
    fn keep_on_disk(
        &self,
        session: &Session<'scope>,
        journal: Option<OpenJournal>,
        memory: &mut Memory<'_>,
        desk: &Arc<Desk>,
    ) -> std::io::Result<()> {
        let config = session.config;
        if let Some((journal, entries, kept)) = journal {
            self.named("journal", None, move || journal_keeper::keep(journal, &entries, &kept))?;
        }
        if let Some(folder) = session.state_folder() {
            let writer = memory.kept_on_disk(folder);
            self.named("state", None, move || memory::write(folder, &writer))?;
        }
        if let Some(folder) = config.state_directory.as_ref().filter(|_| !config.logics.is_empty()) {
            let (desk, stop) = (Arc::clone(desk), self.stop);
            self.named("retain", None, move || {
                retain_keeper::run(folder, &config.name, &desk, stop)
            })?;
        }
        Ok(())
    }

    /// Answers clients.
    fn serve_socket(
        &self,
        socket: Option<&'scope Socket>,
        intake: Intake,
        mut methods: Methods,
        arrivals: Arrivals,
    ) -> std::io::Result<()> {
        let (stop, at_once) = (self.stop, methods.at_once());
        // It parses a line at the most, and all of it is locked.
        self.named("socket", Some(STACK_SIZE / 4), move || {
            capabilities::give_up_or_warn(Work::Ordinary);
            intake.run(socket, &at_once, stop);
        })?;
        self.named("service", Some(STACK_SIZE), move || {
            capabilities::give_up_or_warn(Work::Ordinary);
            server::serve(&arrivals, &mut methods, stop);
        })
    }

    /// Serves what the session serves beside its socket, until what is given back is dropped.
    fn serve(&self, services: &'scope [Box<dyn Service>], door: &Door) -> std::io::Result<Vec<UnixStream>> {
        let mut ends = Vec::new();
        for service in services {
            let (end, closed) = UnixStream::pair()?;
            ends.push(end);
            let until = Until {
                stop: self.stop,
                closed,
            };
            let door = door.clone();
            self.named(service.name(), Some(STACK_SIZE), move || service.serve(door, until))?;
        }
        Ok(ends)
    }
}

/// Pins as programs read them.
pub(super) fn pin_reader(hal: &Hal) -> PinReader {
    PinReader::new(pin_values(hal))
}

fn pin_values(hal: &Hal) -> impl Fn(&str) -> Option<f64> + Send + Sync + 'static + use<> {
    let pins = hal.view();
    move |name| pins.value(name).map(AnyValue::to_f64)
}

/// Seconds since 1970.
fn time_of_day() -> f64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0.0, |since| since.as_secs_f64())
}

/// What the last control of this machine has left in the state folder.
fn recall(folder: &Path, machine: &str, operator: &mut Operator) -> Remembered {
    let Opened { remembered, warning } = state_file::open(folder, machine);
    if let Some(warning) = warning {
        operator.add_warning(warning);
    }
    if let Some(program) = remembered.program.as_ref().filter(|program| program.result.is_none()) {
        operator.add_warning(format!(
            "the control ended in mid-program: {}, line {} was reached",
            program.name, program.line
        ));
    }
    remembered
}

/// What the operator should know of the tool in the spindle.
fn judge_tool(tables: &Tables, remembered: &Remembered, operator: &mut Operator) {
    let (in_table, last) = (tables.tool_in_spindle(), remembered.tool);
    if let Some(tool) = remembered.changing {
        operator.add_warning(message!(
            "tool.change_interrupted",
            "the control ended during the change to tool {tool}: {look}",
            tool = tool,
            look = look_at_tool()
        ));
    } else if last != 0 && in_table != last {
        operator.add_warning(message!(
            "tool.other_in_table",
            "the tool table has tool {table} in the spindle (pocket 0), and the control has last seen tool {last} there: {look}",
            table = in_table,
            last = last,
            look = look_at_tool()
        ));
    }
}

/// Opens the journal of the state folder, and lets the operator go on with it.
fn open_journal(folder: &Path, operator: &mut Operator) -> anyhow::Result<OpenJournal> {
    let opened = Journal::open(folder).with_context(|| format!("state_directory {}", folder.display()))?;
    let (keeper, entries) = mpsc::channel();
    let kept = Arc::new(journal_keeper::Kept::default());
    operator
        .log_mut()
        .keep(opened.entries, opened.last, keeper, Arc::clone(&kept));
    if let Some(warning) = opened.warning {
        operator.add_warning(warning);
    }
    Ok((opened.journal, entries, kept))
}

/// Joins the cycle thread: how it ran. Where it hangs, the process ends here.
fn end_of_cycles<T>(cycle: std::thread::ScopedJoinHandle<'_, T>, operator: &Operator) -> anyhow::Result<T> {
    if operator.needs_restart() {
        end_with_thread(&cycle, operator);
    }
    cycle
        .join()
        .map_err(|_| anyhow!("the cycle thread panicked; nothing leads the machine any more, which stops by itself"))
}

/// A thread that hangs cannot be joined: where it does not come back, the process ends without a report.
fn end_with_thread<T>(cycle: &std::thread::ScopedJoinHandle<'_, T>, operator: &Operator) {
    for _ in 0..END_LOOKS {
        if cycle.is_finished() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let cause = operator
        .alarm()
        .map_or("the cycle thread hung", |alarm| alarm.cause.text.as_str());
    let _ = writeln!(files::printed::stderr(), "isocnc: {cause}");
    std::process::exit(i32::from(EXIT_RESTART));
}

/// The socket by which other processes reach this control. A control that cannot have one still cuts.
///
/// # Errors
/// Another control of this machine runs.
fn control_socket(pins: &Path, machine: &str) -> anyhow::Result<Option<Socket>> {
    match Socket::bind(&path_beside(pins, machine)) {
        Ok(socket) => Ok(Some(socket)),
        Err(error @ BindError::Running { .. }) => Err(error.into()),
        Err(error @ (BindError::NoSocket { .. } | BindError::System { .. })) => {
            let _ = writeln!(files::printed::stderr(), "warning: no control socket: {error}");
            Ok(None)
        }
    }
}
