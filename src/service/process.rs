//! The running process: threads, the operator's loop, the end in good order.
//!
//! In:  a machine, a program, a wire.
//! Out: the report of the run.

use super::control::methods::Methods;
use super::control::server;
use super::control::socket::{BindError, Socket, path_beside};
use super::network_view::NetworkView;
use super::operator::{Operator, Wish};
use super::progress::{Progress, say};
use super::report::{self, Facts, FarEnd, Pictures, RunReport};
use super::signals::{self, StopSignal};
use super::tap::{Tap, TapBridge};
use crate::bus::managing_node::{mn_config, node_configs};
use crate::bus::network;
use crate::bus::powerlink::{NODES_MAX, Powerlink, wall_clock};
use crate::bus::{EthernetFrame, Fieldbus, NodeStatistics};
use crate::config::Config;
use crate::program::{self, FeedError, Feeder, Overview, ring_capacity, stop_ramp};
use crate::rt::assemble::assemble;
use crate::rt::figures;
use crate::rt::pins::CAPACITY;
use crate::rt::rights::{self, Work};
use crate::rt::setup::{self, Role, STACK_SIZE, enter_thread};
use crate::rt::thread::{self, grid};
use crate::rt::timeout::{self, Limits, TimeoutThread, Watch};
use crate::rt::wait::monotonic_ns;
use crate::sim::{SimMachine, serve};
use anyhow::{Context, anyhow};
use hal_pins::Hal;
use motion::element::Element;
use motion::plan::Programmed;
use motion::ring::{self, Producer};
use motion::rt::Interpolator;
use powerlink::link::Link;
use powerlink::link::memory;
use powerlink::link::raw::{RawConfig, RawLink, Reception};
use powerlink::mn::MnConfig;
use powerlink::wire;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::Duration;

/// Pause of the operator's loop.
const OPERATOR_PAUSE: Duration = Duration::from_millis(10);
/// Pause of the planner while the ring is full.
const PLANNER_PAUSE: Duration = Duration::from_millis(5);
/// Look for an answer this long before sleeping for it, ns: longer than a quick node takes, too short to matter.
const ANSWER_SPIN_NS: u64 = 20_000;

/// Address of the managing node on the wire in memory.
const MEMORY_MAC: [u8; 6] = [0x02, 0, 0, 0, 0, 0xF0];
/// A cycle thread that has ended leaves this long to see what it ended with, ns.
const ENDED_NS: u64 = 500_000_000;
/// A cycle thread without a cycle for this long is given up, ns.
const DEAD_NS: u64 = 5_000_000_000;
/// Pieces of the programmed path that are kept for the report.
const PATH_MAX: usize = 500_000;

/// What is to be done.
pub struct Job<'a> {
    /// The machine.
    pub config: &'a Config,
    /// Name of the program, for messages.
    pub program: &'a str,
    /// Its text.
    pub text: &'a [u8],
    /// Folder for the report.
    pub out: &'a Path,
    /// Show no progress: the output is for a program.
    pub quiet: bool,
    /// Asks for a stop; caught since the command began, so that at no moment a signal just ends the process.
    pub signal: StopSignal,
    /// Keep the rights of this thread: another job follows in this process.
    pub keep_rights: bool,
    /// Who measures at the far end of the wire, if somebody does.
    pub far_end: Option<Box<dyn FarEnd + 'a>>,
}

/// The wire to the drives.
pub enum Wire {
    /// A network interface.
    Interface(String),
    /// Memory; the simulated machine of the machine file is at the other end, in this process.
    Memory,
}

/// Runs a job and writes its report. The exit code says how it ended.
///
/// # Errors
/// What keeps it from starting, or its report from being written.
pub fn run_and_report(job: Job<'_>, wire: Wire, json: bool) -> anyhow::Result<ExitCode> {
    let overview = match program::check(job.config, job.program, job.text) {
        Ok(overview) => overview,
        Err(errors) => {
            eprintln!("{errors}\n\nnothing was moved");
            return Ok(ExitCode::FAILURE);
        }
    };
    let out = job.out;
    report::prepare(out)?;
    let (report, pictures, signal) = run(job, wire, overview)?;
    report::write(out, &report, &pictures)?;
    if json {
        say(&format!("{}\n", serde_json::to_string_pretty(&report)?));
    } else {
        say(&format!("\n{report}\nreport                 {}\n", out.display()));
    }
    Ok(match (signal, report.result.as_str()) {
        (Some(signal), _) if report.alarms.is_empty() => ExitCode::from(signals::exit_code(signal)),
        (None, "completed") => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    })
}

type Done = (RunReport, Pictures, Option<i32>);

fn run(job: Job<'_>, wire: Wire, overview: Overview) -> anyhow::Result<Done> {
    let signal = job.signal.clone();
    let process = Arc::new(setup::prepare_process(&job.config.rt)?);
    if !job.quiet {
        for finding in &process.findings {
            // As with `say`: nobody need be there to read it.
            let _ = writeln!(std::io::stderr(), "warning: {finding}");
        }
    }
    match wire {
        Wire::Interface(interface) => {
            let config = RawConfig {
                spin_ns: ANSWER_SPIN_NS,
                ..RawConfig::default()
            };
            let link = RawLink::open(&interface, config)?;
            if let reception @ Reception::Calls { .. } = link.reception() {
                let _ = writeln!(std::io::stderr(), "warning: {interface}: {reception}");
            }
            let mac = link.mac();
            let tap = match &job.config.bus.tap {
                Some(name) => {
                    let tap = Tap::open(name, &interface, mac, wire::node::MN, job.config.bus.async_mtu)?;
                    Some(tap.start().context("TAP device")?)
                }
                None => None,
            };
            run_on(job, overview, &process, link, mac, tap, &signal)
        }
        Wire::Memory => {
            let (near, mut far) = memory::pair(ANSWER_SPIN_NS);
            let mut machine = SimMachine::new(job.config).map_err(|error| anyhow!("{error}"))?;
            let stop = AtomicBool::new(false);
            std::thread::scope(|scope| {
                let machine_thread = std::thread::Builder::new()
                    .name("machine".into())
                    .stack_size(STACK_SIZE)
                    .spawn_scoped(scope, || {
                        drop(enter_thread(Role::Machine, &process));
                        serve(&mut far, &mut machine, &stop, &mut |_| {}, &mut |_, _| {})
                    })?;
                let ended = StopOnDrop(&stop);
                let done = run_on(job, overview, &process, near, MEMORY_MAC, None, &signal);
                drop(ended);
                // Our end of its link is gone by now: an error it gives is that.
                let _ = machine_thread.join();
                done
            })
        }
    }
}

fn run_on<L: Link + Send>(
    mut job: Job<'_>,
    overview: Overview,
    process: &Arc<setup::Process>,
    link: L,
    mac: [u8; 6],
    tap: Option<(TapBridge, rtrb::Consumer<EthernetFrame>)>,
    signal: &StopSignal,
) -> anyhow::Result<Done> {
    let config = job.config;
    let plans = network::plan(config);
    let nodes = node_configs(&config.bus, &plans);
    let watch = Arc::new(Watch::default());
    let (_tap, ethernet) = tap.unzip();
    let bus = managing_node(mn_config(config, &nodes, mac), link, Arc::clone(&watch), ethernet)?;
    let mut hal = Hal::create(&config.name, CAPACITY).context("pins")?;
    let (control, inlets, diagnosis) = assemble(config, &plans, bus, &mut hal)?;
    // On the heap: it is larger than the stack of a real-time thread, which is locked in memory as a whole.
    let mut control = Box::new(control);
    let mut network = NetworkView::of(config);
    if mac == MEMORY_MAC {
        network.interface = "a wire in memory".into();
    }
    let methods = Methods::new(network, inlets.live.clone(), diagnosis, monotonic_ns);
    let mut operator = Operator::new(config, inlets, monotonic_ns());
    let socket = control_socket(hal.path(), &config.name)?;

    let (recorder, _windows) = figures::recorder(grid(config).period_ns);
    let stop = AtomicBool::new(false);
    let (figures, path) = std::thread::scope(|scope| -> anyhow::Result<_> {
        let (reports, mut watch_reports) = rtrb::RingBuffer::new(timeout::REPORTS);
        let limits = Limits::new(
            grid(config).period_ns,
            u64::from(config.rt.timeout_us) * 1000,
            config.bus.soc_lost_max,
        );
        let timeouts = TimeoutThread::spawn(Arc::clone(process), Arc::clone(&watch), limits, reports)?;
        let cycle = std::thread::Builder::new()
            .name("rt-cycle".into())
            .stack_size(STACK_SIZE)
            .spawn_scoped(scope, || {
                // What is missing has been told by `prepare_process`.
                drop(enter_thread(Role::Cycle, process));
                thread::run(&mut control, grid(config), &config.rt, &watch, recorder, &stop)
            })?;
        if let Some(socket) = &socket {
            std::thread::Builder::new()
                .name("service".into())
                .stack_size(STACK_SIZE)
                .spawn_scoped(scope, || {
                    rights::give_up_or_warn(Work::Ordinary);
                    let mut methods = methods;
                    server::serve(socket, &mut methods, &stop);
                })?;
        }
        // Everything is open and every thread of the cycle runs.
        if !job.keep_rights {
            rights::give_up_or_warn(Work::Closing);
        }
        let ended = StopOnDrop(&stop);
        let lives = || !cycle.is_finished();
        let path = attend(
            scope,
            &job,
            &overview,
            &mut operator,
            &mut watch_reports,
            signal,
            &stop,
            &lives,
        );
        drop(ended);
        let figures = cycle
            .join()
            .map_err(|_| anyhow!("the cycle thread panicked; the drives stop for want of SoC"));
        drop(timeouts);
        Ok((figures?, path?))
    })?;
    if let Err(cause) = rights::use_files() {
        // Folders that this user may write anyway are none the worse.
        let _ = writeln!(std::io::stderr(), "warning: {cause}");
    }

    let soc_period = job.far_end.as_mut().and_then(|far_end| far_end.finish());
    let statistics: Vec<NodeStatistics> = (0..config.bus.nodes.len())
        .map(|node| control.bus_mut().statistics(node))
        .collect();
    let facts = Facts {
        config,
        program: job.program,
        overview,
        operator: &operator,
        path: &path,
        figures: &figures,
        peaks: &control.peaks(),
        statistics: &statistics,
        timeouts: watch.counters(),
        findings: &process.findings,
        soc_period,
    };
    let (report, pictures) = facts.report();
    Ok((report, pictures, signal.caught()))
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
            let _ = writeln!(std::io::stderr(), "warning: no control socket: {error}");
            Ok(None)
        }
    }
}

/// The managing node, with room for about as many nodes as there are: room for all 239 is over a megabyte, which is locked in
/// memory. On the heap, so that moving it does not fill the stack of the caller.
fn managing_node<'a, L: Link + Send + 'a>(
    config: MnConfig<'a>,
    link: L,
    watch: Arc<Watch>,
    ethernet: Option<rtrb::Consumer<EthernetFrame>>,
) -> anyhow::Result<Box<dyn Fieldbus + Send + 'a>> {
    match config.nodes.len() {
        0..=8 => managing_node_of::<L, 8>(config, link, watch, ethernet),
        9..=32 => managing_node_of::<L, 32>(config, link, watch, ethernet),
        _ => managing_node_of::<L, NODES_MAX>(config, link, watch, ethernet),
    }
}

#[inline(never)]
fn managing_node_of<'a, L: Link + Send + 'a, const NODES: usize>(
    config: MnConfig<'a>,
    link: L,
    watch: Arc<Watch>,
    ethernet: Option<rtrb::Consumer<EthernetFrame>>,
) -> anyhow::Result<Box<dyn Fieldbus + Send + 'a>> {
    let mut bus = match Powerlink::<L, NODES>::new(config, link, watch, wall_clock) {
        Ok(bus) => Box::new(bus),
        Err(error) => return Err(anyhow!("network: {error}")),
    };
    if let Some(frames) = ethernet {
        bus.set_ethernet_source(frames);
    }
    Ok(bus)
}

/// Ends threads also where the one that would end them panics: a scope waits for all of them.
struct StopOnDrop<'a>(&'a AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// The operator's loop, until everything is over; returns the programmed path as far as it was planned.
#[allow(
    clippy::too_many_arguments,
    reason = "called from one place, which owns all of these"
)]
fn attend<'scope, 'env>(
    scope: &'scope Scope<'scope, 'env>,
    job: &Job<'env>,
    overview: &Overview,
    operator: &mut Operator,
    watch_reports: &mut rtrb::Consumer<timeout::Report>,
    signal: &StopSignal,
    stop: &'scope AtomicBool,
    cycle_thread_lives: &dyn Fn() -> bool,
) -> anyhow::Result<Vec<Programmed>> {
    let mut planner: Option<PlannerThread<'scope>> = None;
    let mut path = Vec::new();
    let mut progress = Progress::new(*overview, job.quiet);
    let (mut cycles, mut cycles_since_ns) = (0, monotonic_ns());
    while operator.outcome().is_none() {
        let now_ns = monotonic_ns();
        if signal.caught().is_some() {
            operator.stop(now_ns);
        }
        if operator.live().cycles != cycles {
            (cycles, cycles_since_ns) = (operator.live().cycles, now_ns);
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
        while let Ok(report) = watch_reports.pop() {
            operator.hear(&report);
        }
        if let Wish::PlanFrom(position) = operator.poll(now_ns) {
            let (producer, consumer) = ring::channel(ring_capacity(job.config));
            let feeder = Feeder::new(job.config, job.text, position, producer);
            planner = Some(
                std::thread::Builder::new()
                    .name("program".into())
                    .spawn_scoped(scope, move || {
                        rights::give_up_or_warn(Work::Ordinary);
                        feed(feeder, stop)
                    })?,
            );
            operator.start(Box::new(Interpolator::new(consumer, position, stop_ramp(job.config))));
        }
        if planner.as_ref().is_some_and(ScopedJoinHandle::is_finished)
            && let Some(planner) = planner.take()
        {
            match planner.join() {
                Ok((pieces, error)) => {
                    path = pieces;
                    if let Some(error) = error {
                        operator.fail(now_ns, error.located(job.program));
                    }
                }
                Err(_) => operator.fail(
                    now_ns,
                    "the planner panicked; the machine rests at the end of its plan".into(),
                ),
            }
        }
        progress.show(operator);
        std::thread::sleep(OPERATOR_PAUSE);
    }
    progress.show(operator);
    stop.store(true, Ordering::Release);
    if let Some(planner) = planner
        && let Ok((pieces, _)) = planner.join()
    {
        path = pieces;
    }
    Ok(path)
}

type PlannerThread<'scope> = ScopedJoinHandle<'scope, (Vec<Programmed>, Option<FeedError>)>;

/// The program thread: plans until the program is in the ring or nobody wants it any more.
fn feed(mut feeder: Feeder<'_, Producer<Element>>, stop: &AtomicBool) -> (Vec<Programmed>, Option<FeedError>) {
    let mut path = Vec::new();
    while !stop.load(Ordering::Acquire) {
        let progress = feeder.pump();
        let room = PATH_MAX.saturating_sub(path.len());
        path.extend(feeder.ideal_path().take(room));
        match progress {
            Ok(program::Progress::Working) => {}
            Ok(program::Progress::RingFull) => std::thread::sleep(PLANNER_PAUSE),
            Ok(program::Progress::Done) => break,
            Err(error) => return (path, Some(error)),
        }
    }
    (path, None)
}
