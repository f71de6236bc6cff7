//! `isocnc tune sweep`: one joint to and fro, faster and faster, and how much of it arrives.
//!
//! In:  a machine file, a joint. Out: the frequency response from command to actual place, and of the loop that the control closes;
//! figures, JSON, a Bode plot.
//!
//! At each frequency the strokes are the longest ones that the limits of the joint allow, up to `--distance`. Jerk bounds them:
//! at twice the frequency they are an eighth as long, and end where the drive cannot count them any more.

use super::experiment::{self, JointArgs, Plan, letter, measure, within};
use crate::analysis::frequency::{Bounds, Strokes, Sweep, sweep};
use crate::analysis::record::{Move, Record};
use anyhow::ensure;
use clap::Args;
use config::{Config, Joint};
use host::terminal::say;
use operator::report::prepare_for;
use plot::chart::{Across, Panel, Series, chart_svg};
use serde_json::{Value as Json, json};
use std::fmt::Write as _;
use std::process::ExitCode;

/// Shortest stroke: so many increments of the drive.
const COUNTS_MIN: f64 = 4.0;
/// The first line that is judged.
const FIRST_LINE: u32 = 5;
/// Greatest frequency, Hz.
const MOST_HZ: f64 = 450.0;

/// Arguments of `tune sweep`.
#[derive(Debug, Args)]
pub(super) struct SweepArgs {
    #[command(flatten)]
    joint: JointArgs,
    /// Longest stroke, mm [default: 5, or a quarter of the travel where that is less]
    #[arg(long, value_name = "MM")]
    distance: Option<f64>,
    /// Greatest speed, mm/s [default: half of that of the machine file]
    #[arg(long, value_name = "MM_S")]
    speed: Option<f64>,
    /// Lowest frequency, Hz
    #[arg(long, value_name = "HZ", default_value_t = 1.0)]
    low: f64,
    /// Highest frequency, Hz; less where the strokes become too short for the drive to count
    #[arg(long, value_name = "HZ", default_value_t = 200.0)]
    high: f64,
}

/// Strokes of all frequencies, of one joint.
fn strokes(args: &SweepArgs, joint: &Joint) -> anyhow::Result<Vec<Strokes>> {
    let length_mm = joint.travel_mm[1] - joint.travel_mm[0];
    let longest_mm = within(
        "--distance",
        args.distance.unwrap_or(5.0_f64.min(length_mm / 4.0)),
        length_mm,
    )?;
    let fastest_mm_s = joint.limits.velocity_mm_s;
    let velocity_mm_s = within("--speed", args.speed.unwrap_or(0.5 * fastest_mm_s), fastest_mm_s)?;
    within("--high", args.high, MOST_HZ)?;
    within("--low", args.low, args.high)?;
    let [counts, units] = joint.counts_per_unit.map(f64::from);
    let bounds = Bounds {
        velocity_mm_s,
        acceleration_mm_s2: joint.limits.acceleration_mm_s2,
        jerk_mm_s3: joint.limits.jerk_mm_s3,
        stroke_mm: [longest_mm, COUNTS_MIN * units / counts],
    };
    let strokes = bounds.strokes(args.low, args.high);
    ensure!(
        strokes.len() > 1,
        "between {} and {} Hz the limits of this joint let it swing by less than {COUNTS_MIN} increments of its drive",
        args.low,
        args.high
    );
    Ok(strokes)
}

/// One line of O-words for each frequency, a rest behind it.
fn text(letter: char, from_mm: f64, strokes: &[Strokes]) -> String {
    let fastest_mm_s = strokes.iter().map(|it| it.velocity_mm_s).fold(0.0, f64::max);
    let mut lines = vec![
        "(one joint to and fro, faster and faster)".to_owned(),
        "G8 G21 G90 G94 G40 G49 G61.1".to_owned(),
        format!("G53 G1 {letter}{from_mm:.5} F{:.3}", 60.0 * fastest_mm_s),
        "G4 P0.5".to_owned(),
    ];
    for (number, strokes) in strokes.iter().enumerate() {
        let number = 100 + number;
        lines.push(format!("o{number} repeat [{}]", strokes.periods));
        // In machine coordinates: those of the work may be turned.
        lines.push(format!(
            "G53 G1 {letter}{:.6} F{:.4}",
            from_mm + strokes.length_mm,
            strokes.velocity_mm_s * 60.0
        ));
        lines.push(format!("G53 G1 {letter}{from_mm:.6}"));
        lines.push(format!("o{number} endrepeat"));
        lines.push("G4 P0.2".to_owned());
    }
    lines.push("M2".to_owned());
    lines.join("\n") + "\n"
}

/// Moves a joint and shows its frequency response.
///
/// # Errors
/// Arguments or a machine file that make no sense; what keeps the program from being run, or the picture from being written.
pub(super) fn run(args: &SweepArgs) -> anyhow::Result<ExitCode> {
    let config = args.joint.read()?;
    let number = args.joint.joint;
    let joint = &config.joints[number];
    let strokes = strokes(args, joint)?;
    let longest_mm = strokes.iter().map(|strokes| strokes.length_mm).fold(0.0, f64::max);
    let [from_mm, to_mm] = args.joint.way(joint, longest_mm)?;
    prepare_for(&args.joint.out, &["sweep.json", "sweep.svg"])?;
    let letter = letter(&config, number)?;
    let highest_hz = strokes.last().map_or(0.0, |strokes| strokes.frequency_hz);
    let time_s: f64 = strokes
        .iter()
        .map(|it| f64::from(it.periods) / it.frequency_hz + 0.2)
        .sum();
    let plan = Plan {
        name: "sweep",
        text: text(letter, from_mm, &strokes),
        moves: format!(
            "{}: homes all joints, then moves joint {number} ({letter}) to and fro between {from_mm:.3} and {to_mm:.3} mm for {time_s:.0} s, \
             up to {highest_hz:.0} times a second, within its limits",
            config.name
        ),
        shorter: "a higher --low, a greater --speed or a shorter --distance takes less",
    };
    let record = match measure(&args.joint, &config, &plan, None)? {
        Ok(record) => record,
        Err(code) => return Ok(code),
    };
    let found = judged(&record, &strokes, joint)?;
    let figures = to_json(&config, number, &found);
    let title = format!("{}: joint {number} ({letter})", config.name);
    experiment::write(&args.joint, &config, "sweep", &figures, &picture(&title, &found))?;
    match args.joint.json {
        true => say(&format!("{figures:#}\n")),
        false => say(&format!(
            "\n{title}\n{}picture       {}\n",
            said(&found, args.high),
            args.joint.out.join("sweep.svg").display()
        )),
    }
    Ok(ExitCode::SUCCESS)
}

fn judged(record: &Record, strokes: &[Strokes], joint: &Joint) -> anyhow::Result<Sweep> {
    let moves: Vec<Move> = record.moves().into_iter().filter(|of| of.line >= FIRST_LINE).collect();
    ensure!(
        moves.len() == strokes.len(),
        "of {} frequencies {} were run",
        strokes.len(),
        moves.len()
    );
    let periods: Vec<u32> = strokes.iter().map(|strokes| strokes.periods).collect();
    Ok(sweep(record, &moves, &periods, joint.pid.as_ref()))
}

fn to_json(config: &Config, number: usize, found: &Sweep) -> Json {
    json!({ "machine": config.name, "joint": number, "sweep": found })
}

fn said(found: &Sweep, high_hz: f64) -> String {
    let mut text = String::new();
    let last_hz = found.points.last().map_or(0.0, |point| point.frequency_hz);
    let bandwidth = match found.bandwidth_hz {
        Some(hz) => format!("{hz:.1} Hz (-3 dB)"),
        None => format!("beyond {last_hz:.0} Hz"),
    };
    let [peak_hz, peak_db] = found.peak;
    // Writing to a string does not fail.
    let _ = writeln!(text, "bandwidth     {bandwidth}");
    let _ = writeln!(text, "peak          {peak_db:.1} dB at {peak_hz:.1} Hz");
    if let Some(margins) = &found.margins {
        let margins = match (margins.gain_db.is_nan(), margins.phase_deg.is_nan()) {
            (false, false) => margins.to_string(),
            (true, false) => format!(
                "phase margin {:.0} degrees, crossover {:.1} Hz; gain margin beyond {last_hz:.0} Hz",
                margins.phase_deg, margins.crossover_hz
            ),
            (_, true) => {
                let first = found.points.first();
                let first_db = first.and_then(|point| Some(20.0 * point.open?.size().log10()));
                match first_db {
                    Some(db) if db < 0.0 => "crossover below the lowest frequency: try a lower --low".to_owned(),
                    _ => format!("crossover beyond {last_hz:.0} Hz"),
                }
            }
        };
        let _ = writeln!(text, "loop          {margins}");
    }
    if last_hz < 0.9 * high_hz {
        let _ = writeln!(
            text,
            "above {last_hz:.0} Hz the jerk of this joint lets it swing by less than {COUNTS_MIN} increments of its drive"
        );
    }
    text
}

/// Magnitude and phase over frequency.
fn picture(title: &str, found: &Sweep) -> String {
    let of = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        let points = found.points.iter().enumerate();
        points.map(|(at, point)| (point.frequency_hz, value(at))).collect()
    };
    let mut magnitudes = vec![Series::new("actual by command", of(&|at| found.points[at].gain_db))];
    let mut phases = vec![Series::new("actual by command", of(&|at| found.points[at].phase_deg))];
    if found.margins.is_some() {
        let open = |at: usize| found.points[at].open.unwrap_or_default();
        magnitudes.push(Series::new("open loop", of(&|at| 20.0 * open(at).size().log10())));
        let phase = |at: usize| {
            let degrees = open(at).angle().to_degrees();
            if degrees > 90.0 { degrees - 360.0 } else { degrees }
        };
        phases.push(Series::new("open loop", of(&phase)));
    }
    let panels = [
        Panel {
            name: "magnitude, dB",
            series: magnitudes,
            marks: vec![-3.0],
        },
        Panel {
            name: "phase, degrees",
            series: phases,
            marks: vec![-180.0],
        },
    ];
    let across = Across {
        name: "frequency, Hz",
        logarithmic: true,
    };
    chart_svg(title, across, &panels)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{LOOP, rehearsed};
    use super::*;
    use crate::analysis::plant::Plant;
    use crate::analysis::stability::{feedback, margins, response};
    use clap::Parser;
    use std::path::Path;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        sweep: SweepArgs,
    }

    fn swept(options: &[&str]) -> Sweep {
        let config = config::parse(LOOP, Path::new("m.toml")).unwrap();
        let line = ["sweep", "m.toml", "--joint", "0"].iter().chain(options);
        let args = Line::parse_from(line).sweep;
        let joint = &config.joints[0];
        let strokes = strokes(&args, joint).unwrap();
        let text = text('X', 100.0, &strokes);
        let record = rehearsed(&config, 0, &text);
        judged(&record, &strokes, joint).unwrap()
    }

    #[test]
    fn the_open_loop_is_that_of_the_amplifier_that_is_known() {
        let found = swept(&["--low", "3"]);
        let said = said(&found, 200.0);
        // Of the simulated motor: 60 Hz with damping 0.8, told a velocity; dead time as the bus has it.
        let lag_s = 1.0 / (2.0 * 0.8 * 60.0 * std::f64::consts::TAU);
        let plant = Plant::Velocity {
            gain: 1.0,
            lag_s,
            dead_s: 0.002,
        };
        let config = config::parse(LOOP, Path::new("m.toml")).unwrap();
        let gains = config.joints[0].pid.unwrap();
        let expected = margins(&gains, &plant, 0.001);
        let found_margins = found.margins.unwrap();
        assert!(
            (found_margins.phase_deg - expected.phase_deg).abs() < 4.0,
            "{said} {expected:?}"
        );
        assert!(
            (found_margins.crossover_hz / expected.crossover_hz - 1.0).abs() < 0.05,
            "{said} {expected:?}"
        );
        for point in found.points.iter().filter(|point| point.frequency_hz < 40.0) {
            let exact = feedback(&gains, point.frequency_hz, 0.001) * response(&plant, point.frequency_hz, 0.001);
            let off = (point.open.unwrap() - exact).size() / exact.size();
            assert!(off < 0.1, "{point:?} {exact:?}");
        }
        assert!(roxmltree::Document::parse(&picture("x", &found)).is_ok());
    }

    #[test]
    fn what_cannot_swing_visibly_is_refused() {
        let config = config::parse(LOOP, Path::new("m.toml")).unwrap();
        let args = Line::parse_from(["sweep", "m.toml", "--joint", "0", "--low", "400", "--high", "440"]).sweep;
        let error = strokes(&args, &config.joints[0]).unwrap_err().to_string();
        assert!(error.starts_with("between 400 and 440 Hz the limits"), "{error}");
        let args = Line::parse_from(["sweep", "m.toml", "--joint", "0", "--high", "900"]).sweep;
        let error = strokes(&args, &config.joints[0]).unwrap_err().to_string();
        assert_eq!(error, "--high 900: must be above 0, and 450 at the most");
    }
}
