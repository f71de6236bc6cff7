//! `isocnc simulate`: the simulated machine as the nodes of its bus on an interface.

use analyser::Analyser;
use anyhow::{Context, anyhow, ensure};
use bus::Tap;
use bus::sender::SoleSender;
use clap::Args;
use config::{KeepAwake, Protocol, Require, Rt};
use host::capabilities::{self, Work};
use host::setup;
use host::setup::{Role, STACK_SIZE, enter_thread};
use host::signals::{StopOnDrop, StopSignal};
use host::terminal::say;
use host::wait::to_next;
use sim::{self, READY, SimMachine, near_end, serve};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use terminal::refusal::Refusal;

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Machine file.
    machine: PathBuf,
    /// Network interface on which the managing node or the main device is.
    #[arg(long)]
    interface: String,
    /// Measure the SoC period at this end from kernel receive stamps and write it to this file at the end.
    #[arg(long, value_name = "FILE")]
    analyse: Option<PathBuf>,
    /// Record every frame to this file (pcap with nanoseconds).
    #[arg(long, value_name = "FILE")]
    capture: Option<PathBuf>,
    /// Other end of the veth pair, if there is one on this PC: without it the recording lacks what this end sends.
    #[arg(long, value_name = "INTERFACE")]
    other_end: Option<String>,
    /// Give one node an IP address, 192.168.100.ID, on a TAP device of this name; its frames use the asynchronous slot.
    #[arg(long, value_name = "NAME", requires = "tap_node")]
    tap: Option<String>,
    /// The node (id) whose address the TAP device has.
    #[arg(long, value_name = "ID", requires = "tap")]
    tap_node: Option<u8>,
    /// Cycle instead of that of the machine file, µs.
    #[arg(long, value_name = "P", hide = true)]
    cycle_us: Option<u32>,
    /// End with the process (id) that started this one, and leave Ctrl-C to it.
    #[arg(long, value_name = "PID", hide = true)]
    with_parent: Option<u32>,
}

/// Simulates until a signal ends it.
pub fn simulate(args: &SimulateArgs) -> anyhow::Result<ExitCode> {
    // Before anything else: nobody but the parent would end this process.
    if let Some(parent) = args.with_parent {
        stay_with(parent)?;
    }
    let config = bus::read_with_cycle(&args.machine, args.cycle_us).map_err(Refusal::from)?;
    ensure!(
        args.tap.is_none() || config.bus.kind.protocol() != Protocol::Ethercat,
        "--tap: the simulated devices of EtherCAT have no Ethernet over EtherCAT (EoE)"
    );
    let signal = StopSignal::install().context("signals")?;
    let mut machine = SimMachine::new(&config).map_err(|error| anyhow!("{error}"))?;
    let _sole = SoleSender::claim(&args.interface)?;
    let mut link = near_end::far_end(&config, &args.interface)?;
    let analyser = match (&args.analyse, &args.capture) {
        (None, None) => None,
        (_, capture) => {
            let other_end = args.other_end.as_deref().filter(|_| capture.is_some());
            Some(Analyser::start(
                &args.interface,
                other_end,
                config.cycle_us,
                capture.as_deref(),
            )?)
        }
    };
    // The control of the same PC says what is missing; a machine alone on its PC may be late at no harm.
    let process = setup::prepare_process(&Rt {
        require: Require::Warn,
        keep_awake: Some(KeepAwake::None),
        ..config.rt.clone()
    })?;
    let mut tap = match (&args.tap, args.tap_node) {
        (Some(name), Some(id)) => {
            if !config.bus.nodes.iter().any(|node| node.id == id) {
                return Err(anyhow!("--tap-node {id}: the machine file has no such node"));
            }
            let tap = Tap::open(name, &args.interface, sim::node_mac(id), id, config.bus.async_mtu)?;
            let (bridge, frames) = tap
                .start(|| capabilities::give_up_or_warn(Work::Ordinary))
                .context("TAP device")?;
            Some((id, bridge, frames))
        }
        _ => None,
    };
    let mut hand_in = |machine: &mut SimMachine| {
        if let Some((id, _, frames)) = &mut tap {
            while let Ok(frame) = frames.pop() {
                machine.send_ethernet(*id, frame.octets());
            }
        }
    };
    let stop = AtomicBool::new(false);
    let served = std::thread::scope(|scope| -> anyhow::Result<_> {
        let machine_thread = std::thread::Builder::new()
            .name("machine".into())
            .stack_size(STACK_SIZE)
            .spawn_scoped(scope, || {
                drop(enter_thread(Role::Machine, &process));
                serve(&mut link, &mut machine, &stop, &mut hand_in, &mut |_, _| {})
            })?;
        // However this ends, the machine ends with it.
        let ended = StopOnDrop(&stop);
        let mut out = files::printed::stdout();
        writeln!(out, "{READY}")
            .and_then(|()| out.flush())
            .context("nobody hears that the machine is ready")?;
        drop(out);
        while !machine_thread.is_finished() && (signal.caught().is_none() || only_interrupted(args, &signal)) {
            std::thread::sleep(to_next(Duration::from_millis(20)));
        }
        drop(ended);
        let served = machine_thread
            .join()
            .map_err(|_| anyhow!("the simulated machine panicked"))?;
        served.with_context(|| args.interface.clone())
    })?;
    if args.with_parent.is_none() {
        say(&format!(
            "{} frames received, {} sent, {} dropped
",
            served.received, served.sent, served.dropped
        ));
    }
    if let Some(analyser) = analyser {
        let measured = analyser.stop()?;
        if let Some(path) = &args.analyse {
            files::write(path, serde_json::to_string(&measured)?).with_context(|| path.display().to_string())?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Ctrl-C reaches every process of the terminal; the machine must live on until the control has stopped.
fn only_interrupted(args: &SimulateArgs, signal: &StopSignal) -> bool {
    args.with_parent.is_some() && signal.caught() == Some(libc::SIGINT)
}

/// Has the kernel end this process with the thread that started it.
fn stay_with(parent: u32) -> anyhow::Result<()> {
    // SAFETY: takes two numbers and touches no memory.
    unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM as libc::c_ulong) };
    // It says nothing of a parent that has ended before.
    let parent_now = std::os::unix::process::parent_id();
    ensure!(
        parent_now == parent,
        "process {parent}, for which this machine was to be, has ended"
    );
    Ok(())
}
