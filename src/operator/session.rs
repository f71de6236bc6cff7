//! The running process: threads, the end in good order.
//!
//! In:  a machine, what it is there for, a wire, somebody who looks after it.
//! Out: everything that is known of it at the end.

use super::tap::{Tap, TapBridge};
use crate::api::methods::Methods;
use crate::api::network_view::NetworkView;
use crate::api::orders::desk;
use crate::api::server;
use crate::api::socket::{BindError, Socket, path_beside};
use crate::bus::managing_node::{mn_config, node_configs};
use crate::bus::network;
use crate::bus::powerlink::{NODES_MAX, Powerlink, wall_clock};
use crate::bus::sender::SoleSender;
use crate::bus::{EthernetFrame, Fieldbus, NodeStatistics};
use crate::config::{Config, KeepAwake};
use crate::host::calibrate::{Calibration, calibrate};
use crate::host::capabilities;
use crate::host::capabilities::Work;
use crate::host::setup;
use crate::host::setup::{Finding, Role, STACK_SIZE, by_cure, enter_thread};
use crate::host::signals::StopSignal;
use crate::host::steadiness::Steadiness;
use crate::host::terminal::say;
use crate::host::wait::{Grid, monotonic_ns};
use crate::machine::tables::Tables;
use crate::operator::console::Operator;
use crate::operator::operator_loop::{Attendance, Attendant, Running};
use crate::rt::assemble::assemble;
use crate::rt::cycle_stats;
use crate::rt::cycle_stats::CycleFigures;
use crate::rt::pins::CAPACITY;
use crate::rt::thread;
use crate::rt::timeout::{self, Limits, TimeoutThread, Watch};
use crate::sim::paced::{Paced, run_paced};
use crate::sim::{SimMachine, serve};
use anyhow::{Context, anyhow};
use hal_pins::Hal;
use motion::plan::Programmed;
use motion::rt::Peaks;
use powerlink::link::Link;
use powerlink::link::memory;
use powerlink::link::raw::{RawConfig, RawLink, Reception};
use powerlink::mn::MnConfig;
use powerlink::wire;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// Look for an answer this long before sleeping for it, ns: longer than a quick node takes, too short to matter.
const ANSWER_SPIN_NS: u64 = 20_000;

/// Exit code of a control that cannot go on by itself and is to be started anew.
pub const ANEW: u8 = 3;
/// A cycle thread that hung is given this long to end, in looks of 10 ms.
const END_LOOKS: u32 = 100;

/// Address of the managing node on the wire in memory.
const MEMORY_MAC: [u8; 6] = [0x02, 0, 0, 0, 0, 0xF0];
/// A control from power-on to power-off.
pub struct Session<'a> {
    /// The machine.
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
}

/// A part program.
#[derive(Clone, Copy, Debug)]
pub struct Program<'a> {
    /// Its name, for messages.
    pub name: &'a str,
    /// Its text.
    pub text: &'a [u8],
}

/// What a control does between homing and power-off.
#[derive(Clone, Copy, Debug)]
pub enum Task<'a> {
    /// Runs a program and keeps a record of it.
    Once(Program<'a>),
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
    /// The programmed path as far as it was planned; of probing moves what they went.
    pub path: Vec<Programmed>,
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

/// Runs a control from power-on to power-off; `attendant` looks after it meanwhile.
///
/// # Errors
/// What keeps it from starting; a thread that panicked. How the machine fared is no error but in [`Ended`].
pub fn run(session: &Session<'_>, wire: Wire, attendant: &mut dyn Attendant) -> anyhow::Result<Ended> {
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
            let _ = writeln!(std::io::stderr(), "warning: {finding}");
        }
        if !matches!(wire, Wire::Paced) {
            say(&format!("{calibration}\n"));
        }
        if let Wire::Interface(_) = wire
            && let Some(advice) = Steadiness::measure(&session.config.rt).advice(session.config)
        {
            let _ = writeln!(std::io::stderr(), "warning: {advice}");
        }
    }
    let process = Arc::new(process);
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
            let tap = match &session.config.bus.tap {
                Some(name) => {
                    let tap = Tap::open(name, &interface, mac, wire::node::MN, session.config.bus.async_mtu)?;
                    Some(tap.start().context("TAP device")?)
                }
                None => None,
            };
            let paced = None;
            run_on(
                session,
                attendant,
                &process,
                calibration,
                NearEnd { link, mac, tap, paced },
            )
        }
        Wire::Paced => {
            let machine = SimMachine::new(session.config).map_err(|error| anyhow!("{error}"))?;
            let wire = Paced::new(machine);
            let near_end = NearEnd {
                link: wire.clone(),
                mac: MEMORY_MAC,
                tap: None,
                paced: Some(wire),
            };
            run_on(session, attendant, &process, calibration, near_end)
        }
        Wire::Memory => {
            let (near, mut far) = memory::pair(ANSWER_SPIN_NS);
            let mut machine = SimMachine::new(session.config).map_err(|error| anyhow!("{error}"))?;
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
                let near_end = NearEnd {
                    link: near,
                    mac: MEMORY_MAC,
                    tap: None,
                    paced: None,
                };
                let done = run_on(session, attendant, &process, calibration, near_end);
                drop(ended);
                // Our end of its link is gone by now: an error it gives is that.
                let _ = machine_thread.join();
                done
            })
        }
    }
}

/// Our end of a wire.
struct NearEnd<L> {
    link: L,
    mac: [u8; 6],
    tap: Option<(TapBridge, rtrb::Consumer<EthernetFrame>)>,
    /// Time is that of this wire.
    paced: Option<Paced>,
}

fn run_on<L: Link + Send>(
    session: &Session<'_>,
    attendant: &mut dyn Attendant,
    process: &Arc<setup::Process>,
    calibration: Calibration,
    near_end: NearEnd<L>,
) -> anyhow::Result<Ended> {
    let config = session.config;
    let NearEnd { link, mac, tap, paced } = near_end;
    let rt = calibration.applied(&config.rt);
    let mut spin = calibration.spin(config);
    let grid = Grid {
        phase_ns: calibration.phase_ns(),
        ..thread::grid(config)
    };
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
    let (counter, desk) = desk();
    let methods = Methods::new(network, inlets.live.clone(), diagnosis, counter, monotonic_ns);
    let socket = control_socket(hal.path(), &config.name)?;

    let (recorder, windows) = cycle_stats::recorder(grid.period_ns);
    let (reports, watch_reports) = rtrb::RingBuffer::new(timeout::REPORTS);
    let operator = Operator::new(config, inlets, monotonic_ns());
    let mut running = Running {
        operator: match session.task {
            Task::Once(_) => operator,
            Task::Repeat(_) => operator.repeating(),
            Task::StandBy => operator.standing_by(),
        },
        reports: watch_reports,
        watch: Arc::clone(&watch),
        windows,
        cpu: process.cpu,
    };
    let stop = AtomicBool::new(false);
    let (figures, ran) = std::thread::scope(|scope| -> anyhow::Result<_> {
        let limits = Limits::of(&config.bus, &rt, grid);
        let timeouts = match &paced {
            None => Some(TimeoutThread::spawn(
                Arc::clone(process),
                Arc::clone(&watch),
                limits,
                reports,
            )?),
            // Nobody can be late.
            Some(_) => None,
        };
        let cycle = std::thread::Builder::new()
            .name("rt-cycle".into())
            .stack_size(STACK_SIZE)
            .spawn_scoped(scope, || match &paced {
                None => {
                    // What is missing has been told by `prepare_process`.
                    drop(enter_thread(Role::Cycle, process));
                    thread::run(&mut control, grid, &mut spin, &watch, recorder, &stop)
                }
                Some(wire) => {
                    capabilities::give_up_or_warn(Work::Ordinary);
                    run_paced(&mut control, grid, wire, recorder, &stop)
                }
            })?;
        if let Some(socket) = &socket {
            std::thread::Builder::new()
                .name("service".into())
                .stack_size(STACK_SIZE)
                .spawn_scoped(scope, || {
                    capabilities::give_up_or_warn(Work::Ordinary);
                    let mut methods = methods;
                    server::serve(socket, &mut methods, &stop);
                })?;
        }
        // Everything is open and every thread of the cycle runs.
        if !session.keep_rights {
            capabilities::give_up_or_warn(Work::Closing);
        }
        let ended = StopOnDrop(&stop);
        let lives = || !cycle.is_finished();
        let attendance = Attendance::new(scope, session, &stop, desk, process.cpu);
        let ran = attendance.run(&mut running, attendant, &lives);
        drop(ended);
        if running.operator.ends_anew() {
            end_with_thread(&cycle, &running.operator);
        }
        let figures = cycle
            .join()
            .map_err(|_| anyhow!("the cycle thread panicked; the drives stop for want of SoC"));
        drop(timeouts);
        Ok((figures?, ran?))
    })?;
    if let Err(cause) = capabilities::use_files() {
        // Folders that this user may write anyway are none the worse.
        let _ = writeln!(std::io::stderr(), "warning: {cause}");
    }

    Ok(Ended {
        operator: running.operator,
        path: ran.path,
        probed_time_s: ran.probed_time_s,
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
        .map_or("the cycle thread hung", |alarm| alarm.cause.as_str());
    let _ = writeln!(std::io::stderr(), "isocnc: {cause}");
    std::process::exit(i32::from(ANEW));
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
pub(crate) struct StopOnDrop<'a>(pub(crate) &'a AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}
