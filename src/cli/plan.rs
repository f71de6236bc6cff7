//! `isocnc plan`: a whole program planned off line.

use crate::config;
use crate::machine::tables::Tables;
use crate::program::{Feeder, Progress, home, ring_capacity, stop_ramp};
use anyhow::{Context, anyhow};
use clap::Args;
use motion::canon::Axis;
use motion::path::Shape;
use motion::plan::Programmed;
use motion::ring;
use motion::rt::{Interpolator, Monitor, MonitorLimits, SampleState};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Arguments of `plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Machine file.
    machine: PathBuf,
    /// Part program.
    program: PathBuf,
    /// Write one commanded position per cycle: `t,` and axis letters, s and mm.
    #[arg(long, value_name = "FILE.csv")]
    samples: Option<PathBuf>,
    /// Write the programmed path, before corners are rounded: lines `P`, `L` and `C` with feed.
    #[arg(long, value_name = "FILE.txt")]
    path: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What a plan comes to.
#[derive(Debug, Serialize)]
struct PlanReport {
    lines: u32,
    pieces: usize,
    motion_time_s: f64,
    wall_time_s: f64,
    /// Greatest use of a velocity, acceleration and jerk limit by each axis; 1 is the limit.
    peak_use: Vec<[f64; 3]>,
    over: u64,
    deviation_max_mm: f64,
}

/// Plans a program and runs it down without a clock.
pub fn plan(args: &PlanArgs) -> anyhow::Result<ExitCode> {
    let config = match config::read(&args.machine) {
        Ok(config) => config,
        Err(errors) => {
            eprint!("{errors}");
            return Ok(ExitCode::FAILURE);
        }
    };
    let text = std::fs::read(&args.program).with_context(|| args.program.display().to_string())?;
    let name = args.program.display().to_string();
    let tables = match Tables::read(&config) {
        Ok(tables) => tables,
        Err(error) => {
            eprintln!("{error}");
            return Ok(ExitCode::FAILURE);
        }
    };
    if let Err(errors) = crate::program::check(&config, &tables, &name, &text) {
        eprintln!("{errors}");
        return Ok(ExitCode::FAILURE);
    }

    let began = Instant::now();
    let start = home(&config);
    let (producer, consumer) = ring::channel(ring_capacity(&config));
    let mut feeder = Feeder::new(&config, &tables, &text, start, producer);
    let mut interpolator = Interpolator::new(consumer, start, stop_ramp(&config));
    let axes: Vec<Axis> = config.axes.iter().map(|map| map.axis).collect();
    let cycle_s = f64::from(config.cycle_us) * 1e-6;
    let limits: Vec<MonitorLimits> = config
        .axes
        .iter()
        .map(|map| {
            let limits = &config.joints[map.joints[0]].limits;
            let of_order = [limits.velocity_mm_s, limits.acceleration_mm_s2, limits.jerk_mm_s3];
            MonitorLimits {
                of_order,
                scaling: of_order,
            }
        })
        .collect();
    let mut monitor = Monitor::new(&limits, cycle_s);
    let (mut samples, mut path) = (vec![start], Vec::new());
    let mut done = false;
    loop {
        while !done {
            let progress = feeder.pump().map_err(|error| anyhow!(error.located(&name)))?;
            path.extend(feeder.ideal_path());
            match progress {
                Progress::Working => {}
                Progress::RingFull => break,
                Progress::Done => done = true,
            }
        }
        let sample = interpolator.step(1.0);
        if sample.action.is_some() {
            interpolator.acknowledge_action();
        }
        let values: Vec<f64> = axes.iter().map(|axis| sample.position[*axis]).collect();
        monitor.see(&values, false);
        samples.push(sample.position);
        match sample.state {
            SampleState::Finished => break,
            SampleState::Starved if done && sample.action.is_none() && interpolator.remaining_s() == 0.0 => break,
            SampleState::Moving | SampleState::Dwelling | SampleState::Acting | SampleState::Starved => {}
        }
    }
    let report = PlanReport {
        lines: feeder.line(),
        pieces: path.len(),
        motion_time_s: (samples.len() - 1) as f64 * cycle_s,
        wall_time_s: began.elapsed().as_secs_f64(),
        peak_use: monitor
            .peaks()
            .map(|(limits, peaks)| std::array::from_fn(|order| peaks.of_order[order] / limits.of_order[order]))
            .collect(),
        over: monitor.peaks().map(|(_, peaks)| peaks.over.iter().sum::<u64>()).sum(),
        deviation_max_mm: motion::plan::deviation(&samples, &path, config.program.tolerance_mm).off_mm,
    };
    if let Some(file) = &args.samples {
        let mut csv = String::from("t");
        axes.iter()
            .for_each(|axis| csv.extend([',', axis.letter().to_ascii_lowercase()]));
        for (cycle, position) in samples.iter().enumerate() {
            write!(csv, "\n{:.6}", cycle as f64 * cycle_s)?;
            axes.iter()
                .try_for_each(|axis| write!(csv, ",{:.12}", position[*axis]))?;
        }
        csv.push('\n');
        std::fs::write(file, csv).with_context(|| file.display().to_string())?;
    }
    if let Some(file) = &args.path {
        std::fs::write(file, path_text(&path)).with_context(|| file.display().to_string())?;
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        println!("lines           {}", report.lines);
        println!("pieces          {}", report.pieces);
        println!("motion time     {:.3} s", report.motion_time_s);
        println!("wall time       {:.3} s", report.wall_time_s);
        for (axis, [v, a, j]) in axes.iter().zip(&report.peak_use) {
            println!(
                "axis {}          velocity {:.3}, acceleration {:.3}, jerk {:.3} of the limit",
                axis.letter(),
                v,
                a,
                j
            );
        }
        println!("cycles over     {}", report.over);
        println!("deviation       {:.6} mm", report.deviation_max_mm);
    }
    Ok(if report.over == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The programmed path, one element a line: `P x y z`, `L x y z F mm/s`, `C x y z cx cy cz nx ny nz F mm/s T turns`.
fn path_text(path: &[Programmed]) -> String {
    let xyz = |position: &motion::canon::Position| {
        format!(
            "{:.12} {:.12} {:.12}",
            position[Axis::X],
            position[Axis::Y],
            position[Axis::Z]
        )
    };
    let mut text = String::new();
    if let Some(first) = path.first() {
        text += &format!("P {}\n", xyz(&first.piece.position(0.0)));
    }
    for element in path {
        let end = xyz(&element.piece.position(element.piece.length()));
        let feed = if element.feed.is_finite() {
            format!(" F {:.9}", element.feed)
        } else {
            String::new()
        };
        match element.piece.shape() {
            Shape::Arc(arc) => {
                let ([cx, cy, cz], [nx, ny, nz]) = (arc.centre_mm(), arc.turns_about());
                // Full turns beyond the first; an arc that ends where it begins makes one.
                let turns = (arc.sweep_rad() / std::f64::consts::TAU - 1e-9).ceil() - 1.0;
                text += &format!("C {end} {cx:.12} {cy:.12} {cz:.12} {nx} {ny} {nz}{feed} T {turns}\n");
            }
            Shape::Line(_) | Shape::Blend(_) => text += &format!("L {end}{feed}\n"),
        }
    }
    text
}
