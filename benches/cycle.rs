//! What a cycle costs: `cargo bench --bench cycle`.
//!
//! Prints medians over batches, with the load average, because these figures are only as good as the PC is quiet:
//! - the interpolation of one set-point, and the same with the monitor;
//! - a whole cycle of the control on virtual time, with the simulated wire and machine in it (an upper bound);
//! - the time-out thread's look at every limit.
//!
//! Budget of the interpolation, drives, pins and copies of a three-axis cycle: 5 µs.

use isocnc::config;
use isocnc::machine::state::State;
use isocnc::program::{Feeder, home, ring_capacity, stop_ramp};
use isocnc::rt::timeout::{Limits, Watch, Watchdog};
use isocnc::sim::NetConfig;
use isocnc::sim::rehearsal::rehearse;
use motion::ring;
use motion::rt::Interpolator;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

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

fn main() -> anyhow::Result<()> {
    let config = config::parse(MACHINE, Path::new("mill3-demo.toml"))?;
    println!(
        "load average       {}",
        std::fs::read_to_string("/proc/loadavg").unwrap_or_default().trim()
    );

    let (producer, consumer) = ring::channel(ring_capacity(&config));
    let mut feeder = Feeder::new(&config, PROGRAM, home(&config), producer);
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
