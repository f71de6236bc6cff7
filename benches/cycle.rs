//! What a cycle costs: `cargo bench --bench cycle`.
//!
//! Prints, with the load and what the host of a virtual machine stole, because these figures are only as good as the PC is quiet:
//! - the compute budget: everything of a three-axis cycle but the exchange, cycle by cycle, while a program runs: drives, pins,
//!   interpolation, monitor, figures, copies of the process data. Budget: mean below 5 µs, 99.9 % below 20 µs; a control of
//!   1999 took 53 µs for two axes. The exchange itself runs on a simulated wire, so that caches are no warmer than they may be.
//!   Once with each cycle at its date, a millisecond apart and off the scheduler tick, as in the machine; once without a
//!   pause, where the scheduler tick falls into every 500th cycle or so. Then the same of 16 joints, all of which move: 99.9 %
//!   below 60 µs;
//! - how many cycles it takes from OPERATIONAL until drives are on, of 3, 6 and 16 of them, on virtual time: 200 ms at the most;
//! - the interpolation of one set-point;
//! - the figures of a cycle and their pins;
//! - a whole cycle of the control on virtual time, with the simulated wire and machine in it;
//! - the time-out thread's look at every limit.

mod common;
#[path = "common/timed.rs"]
mod timed;

use common::Busyness;
use isocnc::bus::CyclicBus;
use isocnc::bus::powerlink::Powerlink;
use isocnc::bus::powerlink::managing_node::{mn_config, node_configs};
use isocnc::bus::powerlink::network;
use isocnc::config::{self, Config, KeepAwake, Rt};
use isocnc::host::histogram::Jitter;
use isocnc::host::setup::{Role, enter_thread, prepare_process};
use isocnc::host::wait::{monotonic_ns, wait_until};
use isocnc::machine::motion_settings::{ring_capacity, stop_ramp};
use isocnc::machine::state::State;
use isocnc::machine::tables::Tables;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::rehearse;
use isocnc::program::{Feeder, home};
use isocnc::rt::assemble::assemble;
use isocnc::rt::cycle::MotionController;
use isocnc::rt::cycle_stats::{CycleTimes, Recorder, recorder};
use isocnc::rt::pins::capacity;
use isocnc::rt::thread::grid;
use isocnc::rt::timeout::{Limits, Watch, Watchdog};
use isocnc::sim::{NetConfig, SimMachine, VirtualNet};
use motion::ring;
use motion::rt::Interpolator;
use powerlink::link::Link;
use powerlink::wire::NetTime;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use timed::Timed;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const PROGRAM: &[u8] = include_bytes!("../configs/sample-part.ngc");
const BATCHES: usize = 101;

/// Median of the time of one call over batches of `calls`, ns; `act` returns false when there is no more to do.
fn median_ns(calls: u32, mut act: impl FnMut()) -> f64 {
    let mut batches: Vec<f64> = (0..BATCHES)
        .map(|_| {
            let began = Instant::now();
            (0..calls).for_each(|_| act());
            began.elapsed().as_nanos() as f64 / f64::from(calls)
        })
        .collect();
    batches.sort_by(f64::total_cmp);
    batches[BATCHES / 2]
}

/// Cycles of a running program that are timed.
const CYCLES: u64 = 10_000;
/// Spin before a cycle, ns.
const SPIN_NS: u64 = 50_000;
/// Joints of the large machine.
const MANY: usize = 16;
/// Longest that it may take to switch drives on, ms.
const ENABLING_MS: u64 = 200;

type Bus<'a, const NODES: usize> = Timed<Powerlink<'a, VirtualNet, NODES>>;

/// The demo mill with so many joints, an axis of it moved by every third one.
fn machine(joints: usize) -> anyhow::Result<Config> {
    let mut parts: Vec<String> = MACHINE.split("\n[[").map(str::to_owned).collect();
    let of = |parts: &[String], what: &str| -> Vec<String> {
        let parts = parts.iter().filter(|part| part.starts_with(what));
        parts.cloned().collect()
    };
    let (nodes, of_joints) = (of(&parts, "bus.node]]"), of(&parts, "joint]]"));
    parts.retain(|part| {
        !["bus.node]]", "joint]]", "axis]]"]
            .iter()
            .any(|what| part.starts_with(what))
            || part.contains("[offsets]")
    });
    let head = parts.remove(0);
    // The last axis has the tables behind it.
    let tail = MACHINE.find("\n[offsets]").map_or("", |at| &MACHINE[at..]);
    let mut text = head;
    for node in 0..joints {
        let drive = nodes[node % 3].replace("-drive", &format!("{node}-drive"));
        text += &format!(
            "\n[[{}",
            drive.replacen(&format!("id = {}", node % 3 + 1), &format!("id = {}", 21 + node), 1)
        );
    }
    text += &format!("\n[[{}", nodes[3]);
    for joint in 0..joints {
        let of_joint = of_joints[joint % 3].replacen(
            &format!("node = {}", joint % 3 + 1),
            &format!("node = {}", 21 + joint),
            1,
        );
        text += &format!("\n[[{of_joint}");
    }
    for (axis, letter) in ["X", "Y", "Z"].iter().enumerate() {
        let moved: Vec<usize> = (axis..joints).step_by(3).collect();
        text += &format!("\n[[axis]]\nletter = {letter:?}\njoints = {moved:?}\n");
    }
    // Seventeen nodes within a millisecond.
    let text = (text + tail).replace("pres_timeout_us = 150", "pres_timeout_us = 40");
    Ok(config::parse(&text, Path::new("mill.toml"))?)
}

/// Cycles from a network that is up until all drives are on.
fn enabling_cycles(config: &Config) -> anyhow::Result<u64> {
    rehearse(config, PROGRAM, NetConfig::clean(1), |run| {
        anyhow::ensure!(run.run_until(60_000, |run| run.control.network_is_up())?, "no network");
        let mut cycles = 0;
        let is_on = run.run_until(60_000, |run| {
            cycles += 1;
            run.control.state() == State::Ready
        });
        anyhow::ensure!(is_on?, "drives did not go on");
        Ok(cycles)
    })
}

/// Times everything of a cycle but the exchange, in a thread as the cycle thread is one.
fn compute_budget<const NODES: usize>(config: &Config, budget: [Option<f64>; 2]) -> anyhow::Result<()> {
    let rt = Rt {
        keep_awake: Some(KeepAwake::None),
        // A real-time thread may lock nothing more once it runs, and this one makes its pins itself.
        lock_memory: false,
        ..config.rt.clone()
    };
    let process = prepare_process(&rt)?;
    for finding in &process.findings {
        println!("{finding}");
    }
    let joints = config.joints.len();
    println!("compute budget, {joints:2} joints             mean     p50     p99   p99.9     max  us, {CYCLES} cycles");
    for (way, paced) in [("at its date", true), ("no pause", false)] {
        let busyness = Busyness::now();
        let timed = std::thread::scope(|scope| {
            let work = || {
                drop(enter_thread(Role::Cycle, &process));
                timed_cycles::<NODES>(config, paced)
            };
            scope.spawn(work).join()
        });
        let [compute, alone] = timed.map_err(|_| anyhow::anyhow!("the cycle panicked"))??;
        for (what, jitter) in [("everything", &compute), ("without figures", &alone)] {
            let figures = jitter.summary();
            println!(
                "  {way:<12} {what:<16} {:11.2} {:7.2} {:7.2} {:7.2} {:7.2}",
                figures.mean_us, figures.p50_us, figures.p99_us, figures.p99_9_us, figures.max_us
            );
        }
        let figures = compute.summary();
        for (what, is, asked) in [
            ("mean", figures.mean_us, budget[0]),
            ("p99.9", figures.p99_9_us, budget[1]),
        ] {
            if let Some(asked) = asked {
                println!(
                    "  budget, {what} {asked}: {}",
                    if is < asked { "kept" } else { "MISSED" }
                );
            }
        }
        println!("  {}", busyness.line());
    }
    Ok(())
}

/// Boots, enables, homes and runs a program; gives the times of the cycles in which it runs, with and without the figures.
fn timed_cycles<const NODES: usize>(config: &Config, paced: bool) -> anyhow::Result<[Jitter; 2]> {
    let plans = network::plan(config);
    let nodes = node_configs(&config.bus, &plans);
    let machine = SimMachine::new(config).map_err(|error| anyhow::anyhow!("{error}"))?;
    let net = VirtualNet::new(machine, NetConfig::clean(1));
    let mn = mn_config(config, &nodes, [2, 0, 0, 0, 0, 0xF0]);
    let bus = Powerlink::<_, NODES>::new(mn, net, Arc::new(Watch::default()), NetTime::default);
    let bus = Timed::new(bus.map_err(|error| anyhow::anyhow!("{error}"))?);
    let name = format!("bench-{}", std::process::id());
    let mut hal = hal_pins::Hal::create_in(&[std::env::temp_dir()], &name, capacity(config))?;
    let (control, endpoints) = assemble(config, &plans, bus, &mut hal)?;
    let mut control = Box::new(control);
    let mut operator = Operator::new(config, endpoints, 0).repeating();
    let (mut recorder, _windows) = recorder(grid(config).period_ns);
    let (mut compute, mut alone) = (Jitter::new(0), Jitter::new(0));
    let tables = Tables::read(config)?;
    let mut feeder = None;
    let mut deadline_ns = grid(config).first_after(0);
    for cycle in 0_u64.. {
        if paced && control.state() == State::Running {
            wait_until(grid(config).first_after(monotonic_ns() + SPIN_NS), SPIN_NS);
        }
        let [all_ns, alone_ns] = cycle_ns(&mut control, &mut recorder, deadline_ns, grid(config).period_ns);
        deadline_ns += grid(config).period_ns;
        if control.state() == State::Running {
            compute.record(all_ns);
            alone.record(alone_ns);
        }
        if compute.n() >= CYCLES {
            break;
        }
        // Other threads' work; the program begins again as often as it takes.
        if cycle.is_multiple_of(10) {
            let now_ns = control.bus_mut().now_ns();
            if let Some(position) = operator.poll(now_ns) {
                let (producer, consumer) = ring::channel(ring_capacity(config));
                feeder = Some(Feeder::new(config, &tables, PROGRAM, position, producer));
                operator.start(
                    Box::new(Interpolator::new(consumer, position, stop_ramp(config))),
                    false,
                );
            }
        }
        if let Some(feeder) = &mut feeder {
            let _ = feeder.pump();
        }
        anyhow::ensure!(
            operator.outcome().is_none(),
            "the program ended after {} cycles",
            compute.n()
        );
    }
    Ok([compute, alone])
}

/// One cycle; how long it computed with and without figures, ns.
fn cycle_ns<const NODES: usize>(
    control: &mut MotionController<Bus<'_, NODES>>,
    recorder: &mut Recorder,
    deadline_ns: u64,
    period_ns: u64,
) -> [u64; 2] {
    control.serve(deadline_ns);
    control.prepare(deadline_ns);
    let net = control.bus_mut().bus.link_mut();
    let behind_ns = deadline_ns.saturating_sub(net.now_ns());
    net.advance(behind_ns);
    let report = control.cycle(0, 0, deadline_ns + period_ns * 9 / 10);
    let computed = Instant::now();
    recorder.record(&CycleTimes {
        deadline_ns,
        woke_ns: deadline_ns,
        soc_ns: report.started_ns,
        exchanged_ns: report.done_ns,
        ended_ns: report.done_ns,
        next_ns: deadline_ns + period_ns,
        skipped: 0,
        pres_lost: report.lost,
        phase_ns: None,
    });
    control.show_timing(recorder.timing());
    let ended = Instant::now();
    let bus = control.bus_mut();
    let ns = |end: Instant| (end - bus.exchanged + bus.prepared).as_nanos() as u64;
    [ns(ended), ns(computed)]
}

fn main() -> anyhow::Result<()> {
    let config = config::parse(MACHINE, Path::new("mill3-demo.toml"))?;
    compute_budget::<8>(&config, [Some(5.0), Some(20.0)])?;
    compute_budget::<{ MANY + 1 }>(&machine(MANY)?, [None, Some(60.0)])?;
    for joints in [3, 6, MANY] {
        let machine = machine(joints)?;
        let cycles = enabling_cycles(&machine)?;
        let ms = cycles * u64::from(machine.cycle_us) / 1000;
        let kept = if ms <= ENABLING_MS { "kept" } else { "MISSED" };
        println!(
            "enabling {joints:2} drives  {cycles:6} cycles from OPERATIONAL, {ms} ms; budget {ENABLING_MS} ms: {kept}"
        );
    }

    let (producer, consumer) = ring::channel(ring_capacity(&config));
    let tables = Tables::read(&config)?;
    let mut feeder = Feeder::new(&config, &tables, PROGRAM, home(&config), producer);
    let mut interpolator = Interpolator::new(consumer, home(&config), stop_ramp(&config));
    let mut steps = 0_u32;
    let interpolation_ns = median_ns(500, || {
        steps += 1;
        if steps.is_multiple_of(500) {
            // Outside of what real time does; once in 500 calls and short.
            let _ = feeder.pump();
        }
        let sample = interpolator.step(1.0);
        if sample.action.is_some() {
            interpolator.acknowledge_action();
        }
        black_box(sample);
    });
    println!("interpolation      {interpolation_ns:8.0} ns a set-point");

    let cycle_ns = rehearse(&config, PROGRAM, NetConfig::clean(1), |rehearsal| {
        rehearsal.run_until(60_000, |rehearsal| rehearsal.control.state() == State::Running)?;
        for _ in 0..1000 {
            rehearsal.cycle(0)?;
        }
        Ok(median_ns(200, || {
            rehearsal.cycle(0).expect("the sample part is good");
        }))
    })?;
    println!("rehearsed cycle    {cycle_ns:8.0} ns with wire, four nodes, motors and operator");

    let watch = Arc::new(Watch::default());
    let mut watchdog = Watchdog::new(Arc::clone(&watch), Limits::new(1_000_000, 50_000, 3));
    let mut now_ns = 0;
    let tick_ns = median_ns(1000, || {
        now_ns += 50_000;
        watch.begin_cycle(now_ns / 1_000_000, now_ns / 1_000_000 * 1_000_000);
        watchdog.tick(now_ns, |report| {
            black_box(report);
        });
    });
    println!("time-out tick      {tick_ns:8.0} ns");
    Ok(())
}
