//! What pins cost: `cargo bench -p isocnc-hal-pins --bench pins`. Nothing is asserted.
//!
//! Prints, with the load: a pin written and read, uncontended (budget 5 ns each); attaching to a control with 5000 pins and listing them
//! (budget 20 ms); what an oscilloscope of 32 channels adds to a cycle, its ring read and full, and four of them (budget 1 us).

use hal_pins::scope::{CAPTURES, CHANNELS_MAX, Capture, Sampler};
use hal_pins::{Attached, Hal};
use std::hint::black_box;
use std::time::Instant;

const PINS: usize = 5000;
const BATCHES: usize = 101;

/// Median of the time of one call over batches, ns.
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

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = format!("bench-{}", std::process::id());
    let mut hal = Hal::create(&name, PINS + 16)?;
    let mut outputs = Vec::new();
    for number in 0..PINS {
        outputs.push(hal.output::<f64>(&format!("bench.{number}.out"))?);
    }
    hal.input("bench.in", 0.0)?;
    hal.link("bench-net", "bench.0.out", &["bench.in"])?;
    let input = hal.reader::<f64>("bench.in")?;

    let write_ns = median_ns(100_000, || black_box(&mut outputs[0]).set(black_box(1.5)));
    let read_ns = median_ns(100_000, || _ = black_box(black_box(&input).get()));
    println!("a pin written      {write_ns:8.2} ns; budget 5 ns");
    println!("a pin read         {read_ns:8.2} ns, over a net; budget 5 ns");
    let list_ns = median_ns(1, || {
        let far = Attached::attach(&name).expect("the pins");
        assert_eq!(black_box(far.list().expect("a list")).len(), PINS + 2);
    });
    println!(
        "attach and list    {:8.2} ms, {} pins; budget 20 ms",
        list_ns / 1e6,
        PINS + 2
    );

    let mut sampler = Sampler::new(&hal, 1_000_000)?;
    let far = Attached::attach(&name)?;
    let names: Vec<String> = (0..CHANNELS_MAX).map(|at| format!("bench.{}.out", at * 100)).collect();
    println!(
        "oscilloscope, idle {:8.2} ns a cycle",
        median_ns(10_000, || sampler.sample(1))
    );
    let mut captures = vec![Capture::begin(&far, &names)?];
    for count in [1, CAPTURES] {
        while captures.len() < count {
            captures.push(Capture::begin(&far, &names)?);
        }
        let ns = median_ns(1000, || {
            sampler.sample(1);
        });
        // Between the batches nobody reads: the ring is full for most of them.
        println!("  {count} x {CHANNELS_MAX} channels, full {ns:7.2} ns a cycle");
        let mut batches: Vec<f64> = (0..BATCHES)
            .map(|_| {
                for capture in &mut captures {
                    while capture.read(usize::MAX, |_| ()).expect("records") > 0 {}
                }
                let began = Instant::now();
                (0..1000).for_each(|_| sampler.sample(1));
                began.elapsed().as_nanos() as f64 / 1e3
            })
            .collect();
        batches.sort_by(f64::total_cmp);
        println!(
            "  {count} x {CHANNELS_MAX} channels, read {:7.2} ns a cycle; budget 1000 ns",
            batches[BATCHES / 2]
        );
    }
    let load = std::fs::read_to_string("/proc/loadavg")?;
    println!("load average {}", load.trim());
    Ok(())
}
