//! Circles by DDA: steps a second of each method, full circles one after the other: `cargo bench --bench dda`.
//!
//! Only as good as the PC is quiet, which is why the load stands beside. Path variance and pictures: `isocnc dda`.

#[allow(dead_code, reason = "other benches use more of it")]
mod common;

use common::Busyness;
use dda::{ArcDda, Fill, Method, Registers, Rule, Turn};
use std::time::{Duration, Instant};

const RADIUS: i32 = 100;
const WIDTH_BITS: u32 = 8;
/// Long enough that the clock does not matter, short enough for a bench of a minute.
const TIMED: Duration = Duration::from_millis(300);

const METHODS: [(&str, Option<Rule>); 6] = [
    ("traditional", Some(Rule::Traditional)),
    ("weighted 0.125", Some(Rule::Weighted)),
    ("improved, as printed", Some(Rule::Printed)),
    ("improved, signed", Some(Rule::Signed)),
    ("improved, pair", Some(Rule::Pair)),
    ("least error", None),
];

fn main() -> anyhow::Result<()> {
    println!(
        "R = {RADIUS} steps, registers of {WIDTH_BITS} bits\n{:<22}{:>14}",
        "", "million/s"
    );
    let busyness = Busyness::now();
    for (name, rule) in METHODS {
        let method = rule.map_or(Method::LeastError, |rule| {
            Method::Registers(Registers {
                rule,
                width_bits: WIDTH_BITS,
                fill: Fill::Half,
            })
        });
        println!("{name:<22}{:>14.1}", steps_per_s(method)? / 1e6);
    }
    println!("{}", busyness.line());
    Ok(())
}

/// Steps found in a second, full circles one after the other.
fn steps_per_s(method: Method) -> anyhow::Result<f64> {
    let (began, mut steps) = (Instant::now(), 0_u64);
    while began.elapsed() < TIMED {
        for _ in 0..16 {
            let circle = ArcDda::new([RADIUS, 0], [RADIUS, 0], Turn::CounterClockwise, method)?;
            steps += std::hint::black_box(circle).count() as u64;
        }
    }
    Ok(steps as f64 / began.elapsed().as_secs_f64())
}
