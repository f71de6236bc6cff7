//! What planning and interpolation cost, and what plans come to: `cargo bench --bench plan`.
//!
//! Prints, with the load and what the host of a virtual machine stole:
//! - from text to committed profile, for both planners on one thread and on two: blocks per second of 200,000 straight
//!   moves of 0.1 mm (target 200,000 on two cores), entities per second of 500 lines and 500 arcs (target 100,000);
//! - motion times of programs, beside what LinuxCNC needs where that is known;
//! - one step of interpolation with kinematics: three axes (target: mean below 1 µs, 99.9 % below 5 µs), five axes with
//!   tool-centre-point control (target: mean below 3 µs).
//!
//! Speeds are medians of rounds in which every variant has its turn. Options behind `--`: `--rounds N` (5);
//! `--programs DIR`, programs (*.ngc) whose motion times are taken in place of our own.

mod common;
#[path = "../tests/proof_programs/mod.rs"]
mod proof_programs;

use anyhow::Context;
use common::Busyness;
use hdrhistogram::Histogram;
use isocnc::config::{self, Config};
use isocnc::machine::motion_settings::{ring_capacity, stop_ramp};
use isocnc::machine::tables::Tables;
use isocnc::program::{Feeder, Progress, Threads, home};
use motion::canon::Position;
use motion::element::{Auxiliary, Element, Enables, Span};
use motion::kinematics::{Hand, Kinematics, Rotary, RotaryAxis, TableTable, ToolFrame, Transform};
use motion::path::Piece;
use motion::plan::PlannerKind;
use motion::ring::{self, Publish, Sink, Timed};
use motion::rt::{Interpolator, SampleState};
use proof_programs::Size;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::thread::Scope;
use std::time::Instant;

const MACHINE: &str = include_str!("../tests/proof_programs/three-axes.toml");
const PLANNERS: [(PlannerKind, &str); 2] = [(PlannerKind::Optimal, "optimal"), (PlannerKind::Classic, "classic")];
/// Seconds that LinuxCNC needs, 2.9 without limited jerk and 2.10 with its S-curve, for programs of these beginnings; the
/// same limits (100 mm/s, 1000 mm/s², 20,000 mm/s³ where there is one), 1 ms.
const LINUXCNC: [(&str, &str); 4] = [
    ("circle", "3.94 (2.9, no limit of jerk), 19.1 (2.10)"),
    ("b_circle_g64", "3.94 (2.9, no limit of jerk), 19.1 (2.10)"),
    ("c_rose", "37.6 (2.9, no limit of jerk), 176.5 (2.10)"),
    ("d_mixed_g64", "132.1 (2.9, no limit of jerk, 0.068 mm off), 490 (2.10)"),
];

struct Options {
    rounds: usize,
    programs: Option<PathBuf>,
}

impl Options {
    fn read() -> anyhow::Result<Options> {
        let mut options = Options {
            rounds: 5,
            programs: None,
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(name) = arguments.next() {
            match name.as_str() {
                "--bench" => {}
                "--rounds" => options.rounds = arguments.next().context("--rounds N")?.parse()?,
                "--programs" => options.programs = Some(arguments.next().context("--programs DIR")?.into()),
                other => anyhow::bail!("{other}: expected --rounds N or --programs DIR"),
            }
        }
        Ok(options)
    }
}

/// Takes a plan for its duration only.
#[derive(Default)]
struct Measure {
    time_s: f64,
    tail_s: f64,
}

impl Sink<Element> for Measure {
    fn free(&self) -> usize {
        usize::MAX / 2
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.time_s += committed.iter().map(Timed::duration_s).sum::<f64>();
        self.tail_s = tail.iter().map(Timed::duration_s).sum();
        Publish::Done
    }
}

/// What planning a program comes to.
struct Planned {
    blocks: usize,
    motion_s: f64,
    wall_s: f64,
}

fn machine(planner: PlannerKind) -> anyhow::Result<(Config, Tables)> {
    let mut config = config::parse(MACHINE, Path::new("three-axes.toml")).context("the machine file of the proof")?;
    config.program.planner = planner;
    let tables = Tables::read(&config)?;
    Ok((config, tables))
}

fn plan(text: &str, planner: PlannerKind, threads: usize) -> anyhow::Result<Planned> {
    let (config, tables) = machine(planner)?;
    std::thread::scope(|scope| plan_in(scope, (&config, &tables), text, threads))
}

fn plan_in<'t>(
    scope: &'t Scope<'t, '_>,
    machine @ (config, _): (&Config, &Tables),
    text: &'t str,
    threads: usize,
) -> anyhow::Result<Planned> {
    let began = Instant::now();
    let sink = Measure::default();
    let mut feeder = Feeder::in_threads(
        machine,
        text.as_bytes(),
        home(config),
        sink,
        Threads::new(threads, scope),
    );
    let mut blocks = 0;
    loop {
        let progress = feeder
            .pump()
            .map_err(|error| anyhow::anyhow!(error.located("program")))?;
        blocks += feeder.ideal_path().count();
        if progress == Progress::Done {
            break;
        }
    }
    let wall_s = began.elapsed().as_secs_f64();
    let sink = feeder.sink();
    Ok(Planned {
        blocks,
        motion_s: sink.time_s + sink.tail_s,
        wall_s,
    })
}

fn median(figures: &mut [f64]) -> f64 {
    figures.sort_by(f64::total_cmp);
    figures[figures.len() / 2]
}

/// From text to committed profile.
fn throughput(options: &Options) -> anyhow::Result<()> {
    println!("from text to committed profile, median of {} rounds", options.rounds);
    for (name, what) in [("surface", "straight moves of 0.1 mm"), ("mixed", "lines and arcs")] {
        let text = proof_programs::find(name)
            .context("a program of this name")?
            .text(Size::Full);
        let variants: Vec<(PlannerKind, &str, usize)> = PLANNERS
            .iter()
            .flat_map(|(planner_kind, name)| [1, 2].map(|threads| (*planner_kind, *name, threads)))
            .collect();
        let mut rates = vec![Vec::new(); variants.len()];
        let mut blocks = 0;
        for _ in 0..options.rounds {
            for ((planner_kind, _, threads), rates) in variants.iter().zip(&mut rates) {
                let planned = plan(&text, *planner_kind, *threads)?;
                blocks = planned.blocks;
                rates.push(planned.blocks as f64 / planned.wall_s);
            }
        }
        for ((_, planner, threads), rates) in variants.iter().zip(&mut rates) {
            println!(
                "  {what}, {blocks}: {planner}, {threads} threads: {:.0} blocks/s",
                median(rates)
            );
        }
    }
    Ok(())
}

/// How long programs take on the machine.
fn motion_times(options: &Options) -> anyhow::Result<()> {
    println!("motion time, s: 100 mm/s, 1000 mm/s², 20,000 mm/s³");
    let programs: Vec<(String, String)> = match &options.programs {
        Some(folder) => {
            let mut files: Vec<PathBuf> = std::fs::read_dir(folder)?
                .map(|entry| entry.map(|e| e.path()))
                .collect::<Result<_, _>>()?;
            files.retain(|file| file.extension().is_some_and(|extension| extension == "ngc"));
            files.sort();
            let named = |file: &PathBuf| {
                let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                Ok((name, std::fs::read_to_string(file)?))
            };
            files.iter().map(named).collect::<anyhow::Result<_>>()?
        }
        None => ["circle", "rose", "mixed", "trochoid", "spiral", "text"]
            .iter()
            .filter_map(|name| proof_programs::find(name))
            .map(|case| (case.name.to_owned(), case.text(Size::Full)))
            .collect(),
    };
    for (name, text) in programs {
        let times: Vec<String> = PLANNERS
            .iter()
            .map(|(planner_kind, planner)| Ok(format!("{planner} {:.3}", plan(&text, *planner_kind, 2)?.motion_s)))
            .collect::<anyhow::Result<_>>()?;
        let known = LINUXCNC
            .iter()
            .find(|(begin, _)| name == *begin || (begin.len() > 6 && name.starts_with(begin)));
        let beside = known.map_or_else(String::new, |(_, times)| format!("; LinuxCNC {times}"));
        println!("  {name}: {}{beside}", times.join(", "));
    }
    Ok(())
}

/// Steps of the interpolation with kinematics, each timed.
fn steps(what: &str, mut interpolator: Interpolator, kinematics: &Kinematics, joints: usize) -> anyhow::Result<()> {
    let mut histogram = Histogram::<u64>::new(3)?;
    let mut positions = vec![0.0; joints];
    // What reading the clock takes is taken off.
    let mut clock_ns = u64::MAX;
    for _ in 0..10_000 {
        let began = Instant::now();
        clock_ns = clock_ns.min(black_box(began).elapsed().as_nanos() as u64);
    }
    loop {
        let began = Instant::now();
        let sample = interpolator.step(1.0);
        let reached = kinematics.inverse(&sample.frame, &sample.position.0, black_box(&mut positions));
        let took_ns = began.elapsed().as_nanos() as u64;
        reached?;
        if sample.action.is_some() {
            interpolator.acknowledge_action();
        }
        match sample.state {
            SampleState::Moving => histogram.record(took_ns.saturating_sub(clock_ns))?,
            SampleState::Finished => break,
            SampleState::Starved if interpolator.remaining_s() == 0.0 && !histogram.is_empty() => break,
            SampleState::Starved | SampleState::Dwelling | SampleState::Acting => {}
        }
    }
    println!(
        "  {what}, {} steps: mean {:.0} ns, median {} ns, 99.9 % below {} ns, worst {} ns",
        histogram.len(),
        histogram.mean(),
        histogram.value_at_quantile(0.5),
        histogram.value_at_quantile(0.999),
        histogram.max()
    );
    Ok(())
}

fn interpolation() -> anyhow::Result<()> {
    println!("one step of interpolation and kinematics");
    for name in ["rose", "mixed"] {
        let text = proof_programs::find(name)
            .context("a program of this name")?
            .text(Size::Full);
        for (planner_kind, planner) in PLANNERS {
            let (config, tables) = machine(planner_kind)?;
            let mut recorder = All::default();
            let mut feeder = Feeder::new(&config, &tables, text.as_bytes(), home(&config), &mut recorder);
            while feeder.pump().map_err(|error| anyhow::anyhow!(error.located(name)))? != Progress::Done {
                feeder.ideal_path();
            }
            drop(feeder);
            let (mut producer, consumer) = ring::channel(ring_capacity(&config).max(recorder.0.len()));
            producer.publish(&recorder.0, &[]);
            let interpolator = Interpolator::new(consumer, home(&config), stop_ramp(&config));
            let axes: Vec<_> = config.axes.iter().map(|map| Some(map.axis)).collect();
            steps(
                &format!("3 axes, {name}, {planner}"),
                interpolator,
                &Kinematics::trivial(&axes),
                3,
            )?;
        }
    }
    five_axes()
}

/// A trunnion table that turns under a short block all the time, with tool-centre-point control.
fn five_axes() -> anyhow::Result<()> {
    use motion::canon::Axis::{A, C, X, Y, Z};
    let rotary = |axis: RotaryAxis, centre_mm: [f64; 3]| Rotary {
        axis,
        hand: Hand::Right,
        centre_mm,
    };
    let table = TableTable {
        primary: rotary(RotaryAxis::A, [0.0, 0.0, 50.0]),
        secondary: rotary(RotaryAxis::C, [0.0, 0.0, 0.0]),
    };
    let follows = Kinematics::trivial(&[Some(X), Some(Y), Some(Z), Some(A), Some(C)]);
    let kinematics = Kinematics::new(Transform::TableTable(table), follows.joints());
    let frame = ToolFrame {
        tcp: true,
        length_mm: 80.0,
    };
    let at = |k: usize| {
        let t = k as f64 * 0.01;
        let mut position = Position::xyz(30.0 * t.cos(), 30.0 * t.sin(), 2.0 * (3.0 * t).sin());
        (position[A], position[C]) = (25.0 * (0.5 * t).sin(), 40.0 * t);
        position
    };
    let elements: Vec<Element> = (0..20_000)
        .filter_map(|k| {
            let piece = Piece::line(at(k), at(k + 1))?.in_frame(frame);
            Some(Element::Span(Span {
                piece,
                s0: 0.0,
                v0: piece.length() / 0.005,
                a0: 0.0,
                jerk: 0.0,
                gradient: 0.0,
                duration_s: 0.005,
                line: k as u32,
                rapid: false,
                enables: Enables::default(),
                auxiliary: Auxiliary::INITIAL,
                modes: 0,
            }))
        })
        .collect();
    let (config, _) = machine(PlannerKind::Optimal)?;
    let (mut producer, consumer) = ring::channel(elements.len());
    producer.publish(&elements, &[]);
    let interpolator = Interpolator::new(consumer, at(0), stop_ramp(&config));
    steps("5 axes with tool-centre-point control", interpolator, &kinematics, 5)
}

/// Keeps everything that is final.
#[derive(Default)]
struct All(Vec<Element>);

impl Sink<Element> for &mut All {
    fn free(&self) -> usize {
        usize::MAX / 2
    }

    fn publish(&mut self, committed: &[Element], _: &[Element]) -> Publish {
        self.0.extend_from_slice(committed);
        Publish::Done
    }
}

fn main() -> anyhow::Result<()> {
    let options = Options::read()?;
    let busyness = Busyness::now();
    motion_times(&options)?;
    throughput(&options)?;
    interpolation()?;
    println!("{}", busyness.line());
    Ok(())
}
