//! What the time-out thread takes from the core of the cycle thread: `cargo bench --bench timeout`.
//!
//! A loop at the priority of the cycle thread counts how far it gets in a fifth of a second: alone, with a time-out thread that
//! looks at every tick, and with one that sleeps over the ticks at which nothing can be due while the loop behaves like a
//! cycle thread with three polls and a slot a cycle. What it loses is the cost, interrupts and switches included; the
//! processor time of the thread itself is a part of that, in a virtual machine the smaller one. Rounds are interleaved; the
//! medians are printed with the load, because these figures are only as good as the PC is quiet.
//!
//! Goal: at 50 µs no more than 10 % of the core.

mod common;

use common::Busyness;
use isocnc::config::{KeepAwake, Rt};
use isocnc::host::setup::{Process, Role, enter_thread, prepare_process};
use isocnc::host::wait::monotonic_ns;
use isocnc::rt::timeout::{Counters, Limits, REPORTS, TimeoutThread, Watch};
use std::hint::{black_box, spin_loop};
use std::sync::Arc;
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
        ("no time-out thread", None),
        ("every tick of 100 us", Some(every(100))),
        ("every tick of  50 us", Some(every(50))),
        ("ticks of 100 us, those needed", Some(sparing(100))),
        ("ticks of  50 us, those needed", Some(sparing(50))),
    ]
    .map(|(name, limits)| Way { name, limits });

    let busyness = Busyness::now();
    let mut rounds = vec![Vec::new(); ways.len()];
    for _ in 0..ROUNDS {
        for (way, rounds) in ways.iter().zip(&mut rounds) {
            rounds.push(round(&process, way.limits)?);
        }
    }
    println!("{}", busyness.line());
    println!(
        "{:<30} {:>12} {:>12} {:>12} {:>12}",
        "", "core lost %", "thread %", "looks/ms", "us lost/look"
    );
    let alone = median(rounds[0].iter().map(|(rate, _)| *rate).collect());
    for (way, rounds) in ways.iter().zip(rounds) {
        let lost = 1.0 - median(rounds.iter().map(|(rate, _)| *rate).collect()) / alone;
        let thread = median(rounds.iter().map(|(_, counters)| counters.cpu_share).collect());
        let looks =
            median(rounds.iter().map(|(_, counters)| counters.ticks as f64).collect()) / (ROUND_NS as f64 / 1e6);
        let each = if looks > 0.0 { lost * 1000.0 / looks } else { 0.0 };
        println!(
            "{:<30} {:12.1} {:12.1} {looks:12.2} {each:12.1}",
            way.name,
            lost * 100.0,
            thread * 100.0
        );
    }
    Ok(())
}

/// How far the loop gets, in turns a µs, and what the time-out thread counted.
fn round(process: &Arc<Process>, limits: Option<Limits>) -> anyhow::Result<(f64, Counters)> {
    let watch = Arc::new(Watch::default());
    let (reports, _reports) = rtrb::RingBuffer::new(REPORTS);
    let thread = limits
        .map(|limits| TimeoutThread::spawn(Arc::clone(process), Arc::clone(&watch), limits, reports))
        .transpose()?;
    // Before it has its priority it would not get the core from the loop.
    while thread.is_some() && watch.counters().ticks == 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    let rate = std::thread::scope(|scope| {
        let work = || {
            drop(enter_thread(Role::Cycle, process));
            turns(&watch)
        };
        scope.spawn(work).join()
    })
    .map_err(|_| anyhow::anyhow!("the loop panicked"))?;
    drop(thread);
    std::thread::sleep(PAUSE);
    Ok((rate, watch.counters()))
}

/// The loop: cycles with three polls and a slot, and nothing but counting between.
fn turns(watch: &Watch) -> f64 {
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
