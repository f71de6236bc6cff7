//! What the time-out thread takes from the core of the cycle thread: `cargo bench --bench timeout`.
//!
//! A loop at the priority of the cycle thread counts how far it gets in a fifth of a second: alone, with a time-out thread that
//! looks at every tick, and with one that sleeps over the ticks at which nothing can be due while the loop behaves like a
//! cycle thread with three polls and a slot a cycle. What it loses is the cost, interrupts and switches included; the
//! processor time of the thread itself is a part of that, in a virtual machine the smaller one. Rounds are interleaved; the
//! medians are printed with the load, because these figures are only as good as the PC is quiet.
//!
//! Then the same thread with the pulses of four step joints at the greatest rate of its tick, to a port that costs nothing but keeps
//! the date of every pulse: how late pulses come, in an even train from one to the next. A parallel port adds about 1 µs a write.
//!
//! Goals: at 50 µs no more than 10 % of the core, with pulses 15 %.

mod common;

use common::Busyness;
use isocnc::bus::OutputImage;
use isocnc::config::{self, Config, KeepAwake, Rt};
use isocnc::host::setup::{Process, Role, enter_thread, prepare_process};
use isocnc::host::step_port::StepPort;
use isocnc::host::wait::monotonic_ns;
use isocnc::rt::local_drive;
use isocnc::rt::steps::StepDrives;
use isocnc::rt::timeout::{Counters, Limits, REPORTS, TimeoutThread, Watch};
use std::hint::{black_box, spin_loop};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

const ROUNDS: usize = 7;
const ROUND_NS: u64 = 200_000_000;
/// A real-time loop must leave the core gaps: the kernel takes them otherwise, in the midst of a round.
const PAUSE: Duration = Duration::from_millis(100);
const PERIOD_NS: u64 = 1_000_000;
const PHASE_NS: u64 = 375_000;
const POLL_NS: u64 = 30_000;
const WAIT_NS: u64 = 150_000;

/// What is compared.
#[derive(Clone, Copy)]
struct Way {
    name: &'static str,
    limits: Option<Limits>,
    /// Ticks of a pulse of the step joints; `None`: there are none.
    length_ticks: Option<u32>,
}

const STEP_JOINTS: usize = 4;
const WORDS: [u16; 4] = [0x0006, 0x0007, 0x000F, 0x000F];

/// The plotter with four joints.
fn step_machine(length_ticks: u32) -> anyhow::Result<Config> {
    let text = include_str!("../configs/plotter2-steps.toml");
    let mut config = config::parse(text, Path::new("plotter2-steps.toml"))?;
    let joint = config.joints[0].clone();
    config.joints = vec![joint; STEP_JOINTS];
    for (number, joint) in config.joints.iter_mut().enumerate() {
        joint.node = number;
        if let Some(output) = &mut joint.step {
            output.lines = [2 * number as u8, 2 * number as u8 + 1];
            output.enable = None;
            output.timing.high_ticks = length_ticks;
        }
    }
    Ok(config)
}

/// Dates of the pulses of the first joint.
struct Dates(Arc<Mutex<Vec<u64>>>, u32);

impl StepPort for Dates {
    fn write(&mut self, now_ns: u64, levels: u32) -> bool {
        // Nobody else takes the lock before the thread has ended.
        if levels & !self.1 & 1 == 1
            && let Ok(mut dates) = self.0.lock()
            && dates.len() < dates.capacity()
        {
            dates.push(now_ns);
        }
        self.1 = levels;
        true
    }
}

/// What the cycle thread does for step joints: the greatest rate, up.
struct Leader {
    drives: StepDrives,
    outputs: OutputImage,
    per_cycle: i32,
    cycles: i32,
}

impl Leader {
    fn lead(&mut self) {
        let word = WORDS[(self.cycles as usize).min(WORDS.len() - 1)];
        let target = self.per_cycle * (self.cycles - WORDS.len() as i32).max(0);
        for joint in 0..STEP_JOINTS {
            let payload = self.outputs.node_mut(joint);
            payload[..2].copy_from_slice(&word.to_le_bytes());
            payload[2] = 8;
            payload[3..7].copy_from_slice(&target.to_le_bytes());
        }
        self.drives.write(&self.outputs);
        self.cycles += 1;
    }
}

fn main() -> anyhow::Result<()> {
    let rt = Rt {
        keep_awake: Some(KeepAwake::None),
        ..Rt::default()
    };
    let process = Arc::new(prepare_process(&rt)?);
    for finding in &process.findings {
        println!("{finding}");
    }
    let every = |tick_us: u64| Limits {
        phase_ns: PHASE_NS,
        ..Limits::new(PERIOD_NS, tick_us * 1000, u32::MAX)
    };
    let sparing = |tick_us: u64| Limits {
        shortest_wait_ns: WAIT_NS,
        every_tick: false,
        ..every(tick_us)
    };
    let ways = [
        ("no time-out thread", None, None),
        ("every tick of 100 us", Some(every(100)), None),
        ("every tick of  50 us", Some(every(50)), None),
        ("ticks of 100 us, those needed", Some(sparing(100)), None),
        ("ticks of  50 us, those needed", Some(sparing(50)), None),
        ("4 step joints, 10 kHz", Some(sparing(50)), Some(1)),
        ("4 step joints, 20 kHz", Some(sparing(50)), Some(0)),
    ]
    .map(|(name, limits, length_ticks)| Way {
        name,
        limits,
        length_ticks,
    });

    let busyness = Busyness::now();
    let mut rounds: Vec<Vec<Round>> = ways.iter().map(|_| Vec::new()).collect();
    for _ in 0..ROUNDS {
        for (way, rounds) in ways.iter().zip(&mut rounds) {
            rounds.push(round(&process, *way)?);
        }
    }
    println!("{}", busyness.line());
    println!(
        "{:<30} {:>12} {:>12} {:>12} {:>12}",
        "", "core lost %", "thread %", "looks/ms", "us lost/look"
    );
    let alone = median(rounds[0].iter().map(|round| round.rate).collect());
    for (way, rounds) in ways.iter().zip(&rounds) {
        let lost = 1.0 - median(rounds.iter().map(|round| round.rate).collect()) / alone;
        let thread = median(rounds.iter().map(|round| round.counters.cpu_share).collect());
        let looks = median(rounds.iter().map(|round| round.counters.ticks as f64).collect()) / (ROUND_NS as f64 / 1e6);
        let each = if looks > 0.0 { lost * 1000.0 / looks } else { 0.0 };
        println!(
            "{:<30} {:12.1} {:12.1} {looks:12.2} {each:12.1}",
            way.name,
            lost * 100.0,
            thread * 100.0
        );
    }
    println!(
        "\n{:<30} {:>12} {:>12} {:>12} {:>12}",
        "pulses", "pulses", "p50 us", "p99 us", "worst us"
    );
    for (way, rounds) in ways.iter().zip(&rounds) {
        let Some(length_ticks) = way.length_ticks else { continue };
        let even_ns = u64::from(length_ticks + 1) * 50_000;
        let dates = |round: &'_ Round| {
            round
                .dates
                .windows(2)
                .map(|pair| pair[1] - pair[0])
                .collect::<Vec<u64>>()
        };
        let mut off_us: Vec<f64> = rounds
            .iter()
            .flat_map(dates)
            .map(|distance_ns| distance_ns.abs_diff(even_ns) as f64 / 1e3)
            .collect();
        off_us.sort_by(f64::total_cmp);
        let at = |share: f64| off_us[((off_us.len() - 1) as f64 * share) as usize];
        let count = off_us.len();
        println!(
            "{:<30} {count:12} {:12.1} {:12.1} {:12.1}",
            way.name,
            at(0.5),
            at(0.99),
            at(1.0)
        );
    }
    Ok(())
}

struct Round {
    /// How far the loop gets, turns a µs.
    rate: f64,
    counters: Counters,
    /// Of the pulses of the first step joint.
    dates: Vec<u64>,
}

fn round(process: &Arc<Process>, way: Way) -> anyhow::Result<Round> {
    let dates = Arc::new(Mutex::new(Vec::with_capacity((ROUND_NS / 50_000) as usize)));
    let mut ticker = None;
    let mut leader = match way.length_ticks {
        None => None,
        Some(length_ticks) => {
            let config = step_machine(length_ticks)?;
            let mut drives = StepDrives::new(&config);
            drives.set_port(Box::new(Dates(Arc::clone(&dates), 0)));
            ticker = drives.take_ticker();
            Some(Leader {
                drives,
                outputs: OutputImage::new(local_drive::plans(&config).map(|plan| plan.outputs.octets)),
                per_cycle: 20 / (length_ticks as i32 + 1) * config::SUBSTEPS as i32,
                cycles: 0,
            })
        }
    };
    let limits = way.limits;
    let watch = Arc::new(Watch::default());
    let (reports, _reports) = rtrb::RingBuffer::new(REPORTS);
    let thread = limits
        .map(|limits| TimeoutThread::spawn(Arc::clone(process), Arc::clone(&watch), limits, reports, ticker))
        .transpose()?;
    // Before it has its priority it would not get the core from the loop.
    while thread.is_some() && watch.counters().ticks == 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    let rate = std::thread::scope(|scope| {
        let work = || {
            drop(enter_thread(Role::Cycle, process));
            turns(&watch, leader.as_mut())
        };
        scope.spawn(work).join()
    })
    .map_err(|_| anyhow::anyhow!("the loop panicked"))?;
    drop(thread);
    std::thread::sleep(PAUSE);
    let dates = dates.lock().map(|dates| dates.clone()).unwrap_or_default();
    Ok(Round {
        rate,
        counters: watch.counters(),
        dates,
    })
}

/// The loop: cycles with three polls and a slot, and nothing but counting between.
fn turns(watch: &Watch, mut leader: Option<&mut Leader>) -> f64 {
    let began_ns = monotonic_ns();
    let mut now_ns = began_ns;
    let mut turns = 0_u64;
    let mut date_ns = (began_ns / PERIOD_NS + 1) * PERIOD_NS + PHASE_NS;
    let mut step = 0;
    while now_ns - began_ns < ROUND_NS {
        for _ in 0..64 {
            spin_loop();
        }
        turns = black_box(turns + 1);
        now_ns = monotonic_ns();
        if now_ns < date_ns + step * POLL_NS {
            continue;
        }
        let cycle = date_ns / PERIOD_NS;
        match step {
            0 => watch.begin_cycle(cycle, date_ns),
            1..=3 => _ = watch.end_poll(),
            _ => _ = watch.end_async(),
        }
        match step {
            0..=2 => watch.begin_poll(step as u8 + 1, now_ns + WAIT_NS),
            3 => watch.begin_async(1, now_ns + WAIT_NS),
            _ => {
                if let Some(leader) = &mut leader {
                    leader.lead();
                }
                watch.end_cycle(cycle, true);
                (step, date_ns) = (0, date_ns + PERIOD_NS);
                continue;
            }
        }
        step += 1;
    }
    watch.disarm();
    turns as f64 * 1000.0 / (now_ns - began_ns) as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
