//! A dense program in real time: `cargo bench --bench dense`.
//!
//! Runs `isocnc demo` on an ellipse of chords of 0.067 mm at 40 m/min, 10,000 blocks a second, as a process of its own with
//! the real-time threads, the bus and the simulated machine of the demo, and prints what its report says: how many cycles
//! waited for the plan, were left out or late, and how fast the blocks passed. With the load and what the host stole.
//!
//! Options behind `--`: `--seconds S` of motion (20); `--memory`, the wire in memory also where a private network would be
//! allowed; `--rounds N` (1); `--write DIR`, only the machine file and the program, as `router.toml` and `dense.ngc`.

mod common;

use anyhow::{Context, ensure};
use common::Busyness;
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
/// The demo's mill as light and fast as a router: 40 m/min is well within its limits on all of the ellipse.
const ROUTER: [(&str, f64); 6] = [
    ("velocity_mm_s", 900.0),
    ("acceleration_mm_s2", 20_000.0),
    ("jerk_mm_s3", 1e6),
    ("stop_acceleration_mm_s2", 40_000.0),
    ("stop_jerk_mm_s3", 4e6),
    ("following_error_mm", 50.0),
];
const BLOCK_MM: f64 = 0.067;
const FEED_MM_MIN: f64 = 40_000.0;
/// Centre and half axes of the ellipse, mm.
const CENTRE: [f64; 2] = [130.0, 80.0];
const HALF: [f64; 2] = [120.0, 75.0];

struct Options {
    seconds: f64,
    rounds: usize,
    memory: bool,
    write: Option<PathBuf>,
}

impl Options {
    fn read() -> anyhow::Result<Options> {
        let mut options = Options {
            seconds: 20.0,
            rounds: 1,
            memory: false,
            write: None,
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(name) = arguments.next() {
            match name.as_str() {
                "--bench" => {}
                "--memory" => options.memory = true,
                "--seconds" => options.seconds = arguments.next().context("--seconds S")?.parse()?,
                "--rounds" => options.rounds = arguments.next().context("--rounds N")?.parse()?,
                "--write" => options.write = Some(arguments.next().context("--write DIR")?.into()),
                other => anyhow::bail!("{other}: expected --seconds S, --rounds N, --memory or --write DIR"),
            }
        }
        Ok(options)
    }
}

/// The machine file with other limits.
fn router() -> String {
    let mut text = String::new();
    for line in MACHINE.lines() {
        let key = line.split(" =").next().unwrap_or_default();
        match ROUTER.iter().find(|(name, _)| *name == key) {
            Some((name, value)) => writeln!(text, "{name} = {value:.1}"),
            None => writeln!(text, "{line}"),
        }
        .expect("a string takes everything");
    }
    text
}

/// Laps of the ellipse for so many seconds at full feed; gives the text and the number of blocks.
fn program(seconds: f64) -> (String, usize) {
    let blocks = (seconds * FEED_MM_MIN / 60.0 / BLOCK_MM) as usize;
    let mut text = format!(
        "G21 G90 G94 G54 G64 P0.01\nG0 X{:.4} Y{:.4} Z0\nF{FEED_MM_MIN}\n",
        CENTRE[0] + HALF[0],
        CENTRE[1]
    );
    let mut angle = 0.0_f64;
    for _ in 0..blocks {
        angle += BLOCK_MM / (HALF[0] * angle.sin()).hypot(HALF[1] * angle.cos());
        angle %= TAU;
        let (sin, cos) = angle.sin_cos();
        writeln!(
            text,
            "G1 X{:.4} Y{:.4}",
            CENTRE[0] + HALF[0] * cos,
            CENTRE[1] + HALF[1] * sin
        )
        .expect("a string takes everything");
    }
    (text + "M2\n", blocks)
}

/// Writes the machine file and the program; gives the number of blocks.
fn write(folder: &Path, seconds: f64) -> anyhow::Result<usize> {
    std::fs::create_dir_all(folder)?;
    let (text, blocks) = program(seconds);
    std::fs::write(folder.join("router.toml"), router())?;
    std::fs::write(folder.join("dense.ngc"), &text)?;
    Ok(blocks)
}

fn run(folder: &Path, memory: bool) -> anyhow::Result<Value> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
    command
        .args(["demo", "--json", "--machine"])
        .arg(folder.join("router.toml"));
    command
        .arg("--program")
        .arg(folder.join("dense.ngc"))
        .arg("--out")
        .arg(folder.join("out"));
    if memory {
        command.arg("--memory");
    }
    let output = command.stderr(Stdio::inherit()).output().context("the binary")?;
    ensure!(!output.stdout.is_empty(), "the demo gave no report: {}", output.status);
    serde_json::from_slice(&output.stdout).context("the report of the demo")
}

fn main() -> anyhow::Result<()> {
    let options = Options::read()?;
    if let Some(folder) = &options.write {
        write(folder, options.seconds)?;
        return Ok(());
    }
    let folder = tempfile::tempdir()?;
    let blocks = write(folder.path(), options.seconds)?;
    println!("{blocks} blocks of {BLOCK_MM} mm at {FEED_MM_MIN} mm/min\n");
    println!("result      motion s   blocks/s   waited for plan   left out   late at most us");
    for _ in 0..options.rounds {
        let busyness = Busyness::now();
        let report = run(folder.path(), options.memory)?;
        let motion_s = report["motion_time_s"].as_f64().context("the motion time")?;
        let cycle = &report["cycle"];
        println!(
            "{:10} {motion_s:9.3} {:10.0} {:>17} {:>10} {:>17.1}",
            report["result"].as_str().unwrap_or("?"),
            blocks as f64 / motion_s,
            report["starved_cycles"],
            cycle["skipped"],
            cycle["lateness"]["max_us"].as_f64().unwrap_or(f64::NAN),
        );
        println!("  {}", busyness.line());
        for alarm in report["alarms"].as_array().into_iter().flatten() {
            println!("  alarm: {}", alarm["cause"]);
        }
    }
    Ok(())
}
