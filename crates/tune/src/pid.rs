//! `isocnc tune pid`: gains of a position loop that the control closes, found from moves and tried.
//!
//! In:  a machine file, a joint. Out: what its amplifier is like, gains with their stability margins, figures before and after, lines
//! for the machine file.
//!
//! The moves go through the ordinary limits, with the gains of the machine file. With `--apply` the program rests in the middle
//! (M0) while the pins of the loop are set, and goes the same way again.

use super::experiment::{self, JointArgs, Plan, letter, measure};
use super::step::{Way, figures_table, judged, opening};
use crate::analysis::plant::{Identified, Plant, identify};
use crate::analysis::record::{Move, Record};
use crate::analysis::stability::{
    BUS_CYCLES, GAIN_MARGIN_DB, Margins, PHASE_MARGIN_DEG, feed_forward, margins, propose,
};
use crate::analysis::step::{StepFigures, step_figures};
use anyhow::{Context, bail, ensure};
use clap::Args;
use config::{Config, DriveMode, Joint};
use hal_pins::{AnyValue, Hal};
use host::terminal::say;
use motion::rt::PidGains;
use operator::report::prepare_for;
use plot::chart::{Across, Panel, Series, chart_svg};
use serde_json::{Value as Json, json};
use std::fmt::Write as _;
use std::process::ExitCode;

/// Share of the speed of a joint at which it is moved where nothing is said: gains that are still bad follow that, too.
const SPEED_SHARE: f64 = 0.2;
/// It has settled within this, um.
const WINDOW_MM: f64 = 0.01;

/// Arguments of `tune pid`.
#[derive(Debug, Args)]
pub(super) struct PidArgs {
    #[command(flatten)]
    joint: JointArgs,
    /// Length of the way, mm [default: 20, or half of the travel where that is less]
    #[arg(long, value_name = "MM")]
    distance: Option<f64>,
    /// Speed, mm/s [default: a fifth of that of the machine file]
    #[arg(long, value_name = "MM_S")]
    speed: Option<f64>,
    /// Try the gains through the pins of the loop, and show what comes of them
    #[arg(long)]
    apply: bool,
    /// Change nothing but ff1 and ff2
    #[arg(long)]
    feed_forward: bool,
}

/// Gains that suit what was found, and what speaks for them.
#[derive(Clone, Copy, Debug)]
struct Proposal {
    found: Identified,
    now: PidGains,
    margins_now: Margins,
    then: PidGains,
    margins: Margins,
}

impl Proposal {
    /// # Errors
    /// Moves that do not tell what the loop is around; gains that would have too little margin.
    fn new(record: &Record, joint: &Joint, feed_forward_only: bool) -> anyhow::Result<Proposal> {
        let now = joint.pid.context("the control closes no loop for it")?;
        let found = identify(record, &judged(record), joint.mode == DriveMode::Cst)?;
        let cycle_s = record.cycle_s;
        let then = rounded(&match feed_forward_only {
            true => PidGains {
                ff: feed_forward(&found.plant, now.d, &now, cycle_s),
                ..now
            },
            false => propose(&found.plant, &now, cycle_s),
        });
        let proposal = Proposal {
            found,
            now,
            margins_now: margins(&now, &found.plant, cycle_s),
            then,
            margins: margins(&then, &found.plant, cycle_s),
        };
        ensure!(
            feed_forward_only || proposal.margins.suffice(),
            "no gains leave {GAIN_MARGIN_DB} dB and {PHASE_MARGIN_DEG} degrees of margin with {}",
            plant_text(&found)
        );
        Ok(proposal)
    }

    /// Pins of the loop of a joint, with what they shall be.
    fn pins(&self, joint: usize) -> [(String, f64); 5] {
        let PidGains { p, i, d, ff, .. } = self.then;
        [("pgain", p), ("igain", i), ("dgain", d), ("ff1", ff[1]), ("ff2", ff[2])]
            .map(|(name, value)| (format!("pid.{joint}.{name}"), value))
    }

    fn to_json(self) -> Json {
        let gains = |gains: &PidGains| {
            let [ff0, ff1, ff2, ff3] = gains.ff;
            json!({ "p": gains.p, "i": gains.i, "d": gains.d, "ff0": ff0, "ff1": ff1, "ff2": ff2, "ff3": ff3 })
        };
        json!({
            "plant": self.found,
            "now": { "gains": gains(&self.now), "margins": self.margins_now },
            "proposed": { "gains": gains(&self.then), "margins": self.margins },
        })
    }

    fn text(&self) -> String {
        let mut text = format!("amplifier     {}\n", plant_text(&self.found));
        for (name, gains, margins) in [
            ("now", &self.now, &self.margins_now),
            ("proposed", &self.then, &self.margins),
        ] {
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "{name:<13} p = {}, i = {}, d = {}, ff1 = {}, ff2 = {}: {margins}",
                gains.p, gains.i, gains.d, gains.ff[1], gains.ff[2],
            );
        }
        text
    }
}

fn plant_text(found: &Identified) -> String {
    let dead_ms = found.plant.dead_s() * 1e3;
    let plant = match found.plant {
        Plant::Velocity { gain, lag_s, .. } => {
            format!("gain {gain:.4}, lag {:.2} ms, dead time {dead_ms:.2} ms", lag_s * 1e3)
        }
        Plant::Torque { gain, damping, .. } => {
            format!("{gain:.0} mm/s2 by the rated torque, damping {damping:.1} 1/s, dead time {dead_ms:.2} ms")
        }
    };
    format!("{plant}; the model leaves {:.2} % of the motion", found.left * 100.0)
}

/// A number with four digits that count.
fn rounded_number(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = 10_f64.powi(3 - value.abs().log10().floor() as i32);
    (value * scale).round() / scale
}

fn rounded(gains: &PidGains) -> PidGains {
    PidGains {
        p: rounded_number(gains.p),
        i: rounded_number(gains.i),
        d: rounded_number(gains.d),
        ff: gains.ff.map(rounded_number),
        ..*gains
    }
}

/// Lines of the machine file for gains and what is known of the amplifier.
fn toml(gains: &PidGains, found: &Identified, cycle_s: f64) -> String {
    let [ff0, ff1, ff2, ff3] = gains.ff;
    let [ff1_max, ff2_max, ff3_max] = gains.ff_max;
    let lag_s = match found.plant {
        Plant::Velocity { lag_s, dead_s, .. } => lag_s + dead_s,
        Plant::Torque { dead_s, .. } => dead_s,
    };
    let keys = [
        ("p", gains.p),
        ("i", gains.i),
        ("d", gains.d),
        ("ff0", ff0),
        ("ff1", ff1),
        ("ff2", ff2),
        ("ff3", ff3),
        ("bias", gains.bias),
        ("dead_band_mm", gains.dead_band),
        ("error_max_mm", gains.error_max),
        ("integral_max_mm_s", gains.integral_max),
        ("derivative_max_mm_s", gains.derivative_max),
        ("ff1_max_mm_s", ff1_max),
        ("ff2_max_mm_s2", ff2_max),
        ("ff3_max_mm_s3", ff3_max),
        ("output_max", gains.output_max),
        ("lag_ms", rounded_number((lag_s - BUS_CYCLES * cycle_s).max(0.0) * 1e3)),
    ];
    let keys = keys.iter().filter(|(key, value)| *value != 0.0 || *key == "ff1");
    let keys: Vec<String> = keys.map(|(key, value)| format!("{key} = {value:?}")).collect();
    format!("pid = {{ {} }}", keys.join(", "))
}

/// Finds gains, and tries them.
///
/// # Errors
/// Arguments or a machine file that make no sense; what keeps the program from being run, or the figures from being written.
pub(super) fn pid(args: &PidArgs) -> anyhow::Result<ExitCode> {
    let config = args.joint.read()?;
    let number = args.joint.joint;
    let joint = &config.joints[number];
    ensure!(
        joint.pid.is_some(),
        "joint {number}: its drive closes the position loop itself; this is for loop = \"pid\". isocnc tune step and sweep work with both"
    );
    let usual_mm_s = SPEED_SHARE * joint.limits.velocity_mm_s;
    let way = Way::new(&args.joint, joint, args.distance, args.speed, usual_mm_s)?;
    prepare_for(&args.joint.out, &["pid.json", "pid.svg"])?;
    let letter = letter(&config, number)?;
    let plan = Plan {
        name: "tune pid",
        text: text(letter, &way, args.apply),
        moves: moves_text(&config, number, letter, &way, args.apply),
        shorter: "a greater --speed or a shorter --distance takes less",
    };
    let mut proposed = None;
    let mut apply = |record: &Record| {
        let proposal = Proposal::new(record, joint, args.feed_forward)?;
        let pins = Hal::attach(&config.name).context("pins")?;
        for (name, value) in proposal.pins(number) {
            pins.set(&name, AnyValue::Float(value))?;
        }
        proposed = Some(proposal);
        Ok(true)
    };
    let record = match measure(&args.joint, &config, &plan, Some(&mut apply))? {
        Ok(record) => record,
        Err(code) => return Ok(code),
    };
    let proposal = match proposed {
        Some(proposal) => proposal,
        None if args.apply => bail!("the program did not rest to take other gains"),
        None => Proposal::new(&record, joint, args.feed_forward)?,
    };
    let figures = halves(&record, args.apply);
    let toml = toml(&proposal.then, &proposal.found, record.cycle_s);
    let title = format!("{}: joint {number} ({letter})", config.name);
    let mut json = proposal.to_json();
    json["machine"] = json!(config.name);
    json["joint"] = json!(number);
    json["moves"] = json!({ "before": figures[0], "after": figures.get(1) });
    json["toml"] = json!(toml);
    experiment::write(
        &args.joint,
        &config,
        "pid",
        &json,
        &picture(&title, &record, args.apply),
    )?;
    match args.joint.json {
        true => say(&format!("{json:#}\n")),
        false => {
            let mut said = format!("\n{title}\n\n{}", proposal.text());
            for (name, figures) in ["before", "after"].iter().zip(&figures) {
                let _ = write!(said, "\n{name}\n{}", figures_table(figures));
            }
            if !args.apply {
                said.push_str("\n--apply tries them\n");
            }
            let _ = write!(
                said,
                "\nfor [[joint]] {number} of the machine file:\n{toml}\npicture       {}\n",
                args.joint.out.join("pid.svg").display()
            );
            say(&said);
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn text(letter: char, way: &Way, twice: bool) -> String {
    let mut lines = opening(letter, way);
    lines.extend(way.lines(letter));
    if twice {
        lines.push("M0".to_owned());
        lines.push("G4 P0.4".to_owned());
        lines.extend(way.lines(letter));
    }
    lines.push("M2".to_owned());
    lines.join("\n") + "\n"
}

fn moves_text(config: &Config, number: usize, letter: char, way: &Way, twice: bool) -> String {
    let [from_mm, to_mm] = way.ends_mm;
    let again = if twice { ", and again with other gains" } else { "" };
    format!(
        "{}: homes all joints, then moves joint {number} ({letter}) between {from_mm:.3} and {to_mm:.3} mm, three times there and back, \
         at up to {} mm/s{again}",
        config.name, way.speed_mm_s
    )
}

/// Figures of the moves before and behind the rest in the middle.
fn halves(record: &Record, twice: bool) -> Vec<Vec<StepFigures>> {
    let moves = judged(record);
    let figures = |moves: &[Move]| moves.iter().map(|of| step_figures(record, of, WINDOW_MM)).collect();
    match moves.split_at_checked(moves.len() / 2) {
        Some((before, after)) if twice => vec![figures(before), figures(after)],
        _ => vec![figures(&moves)],
    }
}

/// The following error over the same moves, before and after.
fn picture(title: &str, record: &Record, twice: bool) -> String {
    let moves = judged(record);
    let half = if twice { moves.len() / 2 } else { moves.len() };
    let series = |name: &str, moves: &[Move]| {
        let begin = moves.first().map_or(0, |of| of.motion.start);
        let end = moves.last().map_or(0, |of| of.motion.end);
        let errors = (begin..end).map(|at| {
            let time_s = (at - begin) as f64 * record.cycle_s;
            (time_s, record.cycles[at].following_error_mm * 1000.0)
        });
        Series::new(name, errors)
    };
    let (before, after) = moves.split_at(half);
    let mut errors = vec![series("before", before)];
    if twice {
        errors.push(series("after", after));
    }
    let panel = Panel {
        name: "following error, um",
        series: errors,
        marks: vec![0.0],
    };
    let across = Across {
        name: "time, s",
        logarithmic: false,
    };
    chart_svg(title, across, &[panel])
}

#[cfg(test)]
mod tests {
    use super::super::tests::{LOOP, rehearsed, rehearsed_with};
    use super::*;
    use std::path::Path;

    const LOOPS: [&str; 2] = [
        "pid = { p = 40.0, ff1 = 1.0, ff2 = 0.005 }",
        "pid = { p = 5.0, i = 50.0, d = 0.075, ff2 = 0.0005, integral_max_mm_s = 0.05, output_max = 3.0 }",
    ];

    fn machine(gains: [&str; 2]) -> Config {
        let mut file = LOOP.to_owned();
        for (was, gains) in LOOPS.iter().zip(gains) {
            assert!(file.contains(was));
            file = file.replacen(was, gains, 1);
        }
        config::parse(&file, Path::new("m.toml")).unwrap()
    }

    fn way(joint: usize) -> Way {
        let ends_mm = if joint == 2 { [-80.0, -60.0] } else { [100.0, 120.0] };
        Way {
            ends_mm,
            speed_mm_s: 25.0,
        }
    }

    fn worst(figures: &[StepFigures]) -> f64 {
        let errors = figures
            .iter()
            .map(|it| it.accelerating_um.max(it.at_speed_um).max(it.braking_um));
        errors.fold(0.0, f64::max)
    }

    #[test]
    fn bad_gains_become_good_ones_with_enough_margin() {
        let soft = "pid = { p = 4.0, ff1 = 0.9 }";
        let hard = "pid = { p = 90.0, ff1 = 1.1 }";
        let soft_torque = "pid = { p = 0.7, d = 0.03, output_max = 3.0 }";
        for (joint, gains) in [
            (0, [soft, LOOPS[1]]),
            (0, [hard, LOOPS[1]]),
            (2, [LOOPS[0], soft_torque]),
        ] {
            let config = machine(gains);
            let letter = letter(&config, joint).unwrap();
            let text = text(letter, &way(joint), true);
            let mut proposed = None;
            let record = rehearsed_with(&config, joint, &text, |record, pins| {
                let proposal = Proposal::new(record, &config.joints[joint], false).unwrap();
                for (name, value) in proposal.pins(joint) {
                    pins.set(&name, value).unwrap();
                }
                proposed = Some(proposal);
            });
            let proposal = proposed.expect("the program rested");
            let said = proposal.text();
            assert!(proposal.margins.suffice(), "{said}");
            let [before, after] = &halves(&record, true)[..] else {
                panic!("two halves");
            };
            assert!(
                worst(after) < 0.1 * worst(before),
                "{said}{}{}",
                figures_table(before),
                figures_table(after)
            );
            let overshoot = after.iter().map(|it| it.overshoot_um).fold(0.0, f64::max);
            assert!(overshoot < 5.0, "{said}{}", figures_table(after));
        }
    }

    #[test]
    fn what_is_printed_is_read_again_and_comes_to_the_same() {
        let joint = 0;
        let config = machine(LOOPS);
        let letter = letter(&config, joint).unwrap();
        let record = rehearsed(&config, joint, &text(letter, &way(joint), false));
        let proposal = Proposal::new(&record, &config.joints[joint], true).unwrap();
        assert_eq!(proposal.then.p, proposal.now.p);
        // The simulated motor: 60 Hz with damping 0.8, told a velocity, behind two cycles.
        let late_s = 0.002 + 1.0 / (2.0 * 0.8 * 60.0 * std::f64::consts::TAU);
        let [_, ff1, ff2, _] = proposal.then.ff;
        assert!(
            (ff1 - 1.0).abs() < 0.002 && (ff2 / late_s - 1.0).abs() < 0.03,
            "{}",
            proposal.text()
        );
        let line = toml(&proposal.then, &proposal.found, record.cycle_s);
        let file = LOOP.replacen(LOOPS[0], &line, 1);
        let read = config::parse(&file, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{line}: {errors}"));
        assert_eq!(read.joints[joint].pid, Some(proposal.then), "{line}");
    }
}
