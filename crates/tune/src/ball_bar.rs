//! `isocnc tune ball-bar`: circles both ways, and how round they were.
//!
//! In:  a machine file. Out: a program of circles that is run from power-on to power-off; a table, JSON, a picture.

use super::experiment;
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use config::Config;
use host::terminal::say;
use motion::canon::Axis;
use operator::circularity::{Circularity, circularity};
use operator::measurements;
use operator::report::prepare_for;
use plot::circle::{Way, circle_svg};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// Turns each way; the one in the middle counts.
const TURNS: u32 = 3;
const PICTURE: &str = "ball-bar.svg";
const DATA: &str = "ball-bar.json";

/// A plane of two axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Plane {
    Xy,
    Xz,
    Yz,
}

impl Plane {
    fn axes(self) -> [Axis; 2] {
        match self {
            Plane::Xy => [Axis::X, Axis::Y],
            Plane::Xz => [Axis::X, Axis::Z],
            Plane::Yz => [Axis::Y, Axis::Z],
        }
    }

    /// G-code of the plane, and the word for the middle along its first axis.
    fn words(self) -> (&'static str, char) {
        match self {
            Plane::Xy => ("G17", 'I'),
            Plane::Xz => ("G18", 'I'),
            Plane::Yz => ("G19", 'J'),
        }
    }
}

/// Arguments of `tune ball-bar`.
#[derive(Debug, Args)]
pub(super) struct BallBarArgs {
    /// Machine file.
    machine: PathBuf,
    /// Plane of the circles
    #[arg(long, value_enum, default_value_t = Plane::Xy)]
    plane: Plane,
    /// Radius, mm
    #[arg(long, default_value_t = 20.0)]
    radius: f64,
    /// Feed, mm/min
    #[arg(long, default_value_t = 1000.0)]
    feed: f64,
    /// Middle in machine coordinates, such as 150,100, mm [default: that of the travel]
    #[arg(long, value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    middle: Vec<f64>,
    /// Folder for the picture and the figures
    #[arg(long, default_value = "isocnc-out")]
    out: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Do not ask before the machine moves
    #[arg(long)]
    yes: bool,
}

/// The program of the circles, and the lines that turn: counter-clockwise and clockwise in the plane, whichever comes first.
fn program(plane: Plane, middle_mm: [f64; 2], radius_mm: f64, feed_mm_min: f64) -> (String, [u32; 2]) {
    let ([first, second], (code, centre)) = (plane.axes(), plane.words());
    let [across, up] = middle_mm;
    let lines = [
        "(circles both ways, to see how round they are)".to_owned(),
        format!("G8 G21 G90 G94 {code} G91.1 G40 G49 G64 P0.001"),
        format!(
            "G53 G0 {}{:.4} {}{up:.4}",
            first.letter(),
            across + radius_mm,
            second.letter()
        ),
        format!("G91 F{feed_mm_min}"),
        format!(
            "G3 {}0 {}0 {centre}{:.4} P{TURNS}",
            first.letter(),
            second.letter(),
            -radius_mm
        ),
        "G4 P0.5".to_owned(),
        format!(
            "G2 {}0 {}0 {centre}{:.4} P{TURNS}",
            first.letter(),
            second.letter(),
            -radius_mm
        ),
        "G4 P0.5".to_owned(),
        "G90".to_owned(),
        "M2".to_owned(),
    ];
    (lines.join("\n") + "\n", [5, 7])
}

/// Middle of the travel of two axes, mm; an error where the machine has none of them.
fn middle_of(config: &Config, axes: [Axis; 2]) -> anyhow::Result<[f64; 2]> {
    let mut middle_mm = [0.0; 2];
    for (middle_mm, axis) in middle_mm.iter_mut().zip(axes) {
        let map = config.axes.iter().find(|map| map.axis == axis);
        let map = map.with_context(|| format!("{} has no axis {}", config.name, axis.letter()))?;
        let [low, high] = map.travel_mm.unwrap_or(config.joints[map.joints[0]].travel_mm);
        *middle_mm = f64::midpoint(low, high);
    }
    Ok(middle_mm)
}

/// Runs the circles and judges them.
///
/// # Errors
/// Arguments or a machine file that make no sense; what keeps the program from being run, or the picture from being written.
pub(super) fn ball_bar(args: &BallBarArgs) -> anyhow::Result<ExitCode> {
    for (what, value) in [("--radius", args.radius), ("--feed", args.feed)] {
        if !(value > 0.0 && value.is_finite()) {
            bail!("{what} {value}: must be above 0");
        }
    }
    let config = bus::read(&args.machine).map_err(Refusal::from)?;
    let axes = args.plane.axes();
    let middle_mm = match args.middle[..] {
        [] => middle_of(&config, axes)?,
        [across, up] => [across, up],
        _ => bail!("--middle: must be two places, such as 150,100"),
    };
    let (text, lines) = program(args.plane, middle_mm, args.radius, args.feed);
    let name = "ball bar";
    prepare_for(&args.out, &[PICTURE, DATA])?;
    if !args.yes && !experiment::agreed(&moves(&config, args, middle_mm))? {
        return Ok(ExitCode::FAILURE);
    }
    let ended = match experiment::run(&config, name, &text, args.json, &mut None)? {
        Ok(ended) => ended,
        Err(code) => return Ok(code),
    };
    let axes_at = axes.map(|axis| axis as usize);
    let found = circularity(
        ended.operator.recorder.samples(),
        lines,
        TURNS,
        axes_at,
        args.feed / 60.0,
    )?;
    // A heading that fits the picture.
    let heading = format!("{}: radius {} mm, {} mm/min", config.name, args.radius, args.feed);
    let (figures, picture) = told(&heading, axes, &found)?;
    for (name, text) in [(DATA, &figures), (PICTURE, &picture)] {
        let path = args.out.join(name);
        files::write(&path, text).with_context(|| path.display().to_string())?;
    }
    let state = config.state_directory.as_deref();
    measurements::keep(state, "ball-bar", &figures, &picture, args.json);
    match args.json {
        true => say(&format!("{:#}\n", serde_json::to_value(&found)?)),
        false => say(&format!(
            "\n{}\n{}picture   {}\n",
            title(&config, args, &found),
            table(axes, &found),
            args.out.join(PICTURE).display()
        )),
    }
    Ok(ExitCode::SUCCESS)
}

/// What the machine will do, for whoever is asked.
fn moves(config: &Config, args: &BallBarArgs, middle_mm: [f64; 2]) -> String {
    let ([first, second], [across, up]) = (args.plane.axes().map(Axis::letter), middle_mm);
    format!(
        "{}: homes all joints, then runs circles of {} mm radius around {first} {across:.3} {second} {up:.3} of the machine at {} mm/min, {TURNS} \
         turns each way; all other axes stay where they are homed",
        config.name, args.radius, args.feed
    )
}

fn title(config: &Config, args: &BallBarArgs, found: &Circularity) -> String {
    let [first, second] = args.plane.axes().map(Axis::letter);
    let [across, up] = found.middle_mm;
    format!(
        "{}: circle of {:.3} mm radius at {} mm/min around {first}{across:.3} {second}{up:.3}",
        config.name, found.radius_mm, args.feed
    )
}

fn table(axes: [Axis; 2], found: &Circularity) -> String {
    let [first, second] = axes.map(Axis::letter);
    let mut text = format!("\n{:<34}{:>18}{:>18}\n", "um", "counter-clockwise", "clockwise");
    let mut row = |name: &str, cells: [String; 2]| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<34}{:>18}{:>18}", cells[0], cells[1]);
    };
    let directions = || found.directions.each_ref();
    row(
        "deviation of the radius",
        directions().map(|it| format!("{:.1} to {:.1}", it.radial_um[0], it.radial_um[1])),
    );
    row("  mean", directions().map(|it| format!("{:.1}", it.mean_um)));
    row(
        "circular deviation",
        directions().map(|it| format!("{:.1}", it.circular_um)),
    );
    for (quarter, (sign, axis)) in [('+', first), ('+', second), ('-', first), ('-', second)]
        .into_iter()
        .enumerate()
    {
        row(
            &format!("peak at {sign}{axis}, outward above 0"),
            directions().map(|it| format!("{:.1}", it.peaks_um[quarter])),
        );
    }
    let _ = writeln!(text, "both ways together                {:>18.1}", found.both_um);
    let _ = writeln!(
        text,
        "squareness, um/m                  {:>18.1}",
        found.squareness_um_m
    );
    let _ = writeln!(
        text,
        "{:<34}{:>18.3}",
        format!("lag of {first} behind {second}, ms"),
        found.lag_ms
    );
    text
}

/// The figures as JSON, and the picture.
fn told(title: &str, axes: [Axis; 2], found: &Circularity) -> anyhow::Result<(String, String)> {
    let [one, other] = &found.directions;
    let ways = [
        Way {
            name: "counter-clockwise",
            points: &one.points,
        },
        Way {
            name: "clockwise",
            points: &other.points,
        },
    ];
    let picture = circle_svg(title, axes.map(Axis::letter), &ways);
    Ok((format!("{:#}\n", serde_json::to_value(found)?), picture))
}

#[cfg(test)]
mod tests {
    use super::*;
    use machine::sequence::Outcome;
    use operator::rehearsal::rehearse;
    use sim::NetConfig;
    use std::path::Path;

    const DEMO: &str = include_str!("../../../configs/mill3-demo.toml");

    fn judged(config: &Config, plane: Plane) -> Circularity {
        let middle_mm = middle_of(config, plane.axes()).unwrap();
        let (text, lines) = program(plane, middle_mm, 10.0, 3000.0);
        rehearse(config, text.as_bytes(), NetConfig::clean(1), |run| {
            assert_eq!(run.run(120_000)?, Outcome::Completed, "{:#?}", run.operator.journal());
            let axes = plane.axes().map(|axis| axis as usize);
            Ok(circularity(run.operator.recorder.samples(), lines, TURNS, axes, 50.0)?)
        })
        .unwrap()
    }

    #[test]
    fn circles_of_the_simulated_machine_are_judged_in_every_plane() {
        let config = config::parse(DEMO, Path::new("mill3-demo.toml")).unwrap();
        for plane in [Plane::Xy, Plane::Xz, Plane::Yz] {
            let found = judged(&config, plane);
            let said = table(plane.axes(), &found);
            assert!((found.radius_mm - 10.0).abs() < 1e-3, "{plane:?}: {}", found.radius_mm);
            // All drives lag alike: round, and nothing is askew.
            assert!(found.both_um < 3.0, "{plane:?}: {said}");
            assert!(
                found.lag_ms.abs() < 0.02 && found.squareness_um_m.abs() < 20.0,
                "{plane:?}: {said}"
            );
            let [first, second] = plane.axes().map(Axis::letter);
            for name in [
                format!("peak at -{second}, outward"),
                format!("lag of {first} behind {second}, ms "),
            ] {
                assert!(said.contains(&name), "{said}");
            }
        }
    }

    #[test]
    fn a_machine_without_the_axes_is_named() {
        let config = config::parse(include_str!("../../../configs/seed-2axis.toml"), Path::new("m.toml")).unwrap();
        let error = middle_of(&config, Plane::Xz.axes()).unwrap_err();
        assert_eq!(error.to_string(), "seed-2axis has no axis Z");
    }
}
