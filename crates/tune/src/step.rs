//! `isocnc tune step`: one joint there and back, and how it followed.
//!
//! In:  a machine file, a joint. Out: figures of each move, what might be fed forward, JSON, a picture.

use super::experiment::{self, JointArgs, Plan, letter, measure, within};
use crate::analysis::plant::{Identified, identify};
use crate::analysis::record::{Move, Record};
use crate::analysis::stability::feed_forward;
use crate::analysis::step::{ErrorParts, StepFigures, error_parts, step_figures, torque_per_mm_s2};
use clap::Args;
use config::{Config, DriveMode, Joint};
use host::terminal::{say, table};
use motion::rt::PidGains;
use operator::report::prepare_for;
use plot::chart::{Across, Panel, Series, chart_svg};
use serde_json::{Value as Json, json};
use std::fmt::Write as _;
use std::process::ExitCode;

/// Shares of the speed at which the way is gone there and back: the acceleration that each comes to is another one.
const SPEEDS: [f64; 3] = [1.0, 0.5, 0.2];
/// The first line that is judged.
const FIRST_LINE: u32 = 5;
/// A window of settling that is not named: so much, and so many increments of the drive at the least.
const WINDOW_UM: f64 = 10.0;
const WINDOW_COUNTS: f64 = 4.0;

/// Arguments of `tune step`.
#[derive(Debug, Args)]
pub(super) struct StepArgs {
    #[command(flatten)]
    joint: JointArgs,
    /// Length of the way, mm [default: 20, or half of the travel where that is less]
    #[arg(long, value_name = "MM")]
    distance: Option<f64>,
    /// Speed, mm/s [default: that of the machine file]
    #[arg(long, value_name = "MM_S")]
    speed: Option<f64>,
    /// It has settled once it stays so near to its end, um [default: 10, or 4 increments of the drive where that is more]
    #[arg(long, value_name = "UM")]
    window: Option<f64>,
}

/// Where a joint goes there and back, and how fast.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    pub(super) ends_mm: [f64; 2],
    pub(super) speed_mm_s: f64,
}

impl Way {
    /// # Errors
    /// What the joint is not allowed.
    pub(super) fn new(
        args: &JointArgs,
        joint: &Joint,
        distance_mm: Option<f64>,
        speed_mm_s: Option<f64>,
        usual_mm_s: f64,
    ) -> anyhow::Result<Way> {
        let length_mm = joint.travel_mm[1] - joint.travel_mm[0];
        let distance_mm = within(
            "--distance",
            distance_mm.unwrap_or(20.0_f64.min(length_mm / 2.0)),
            length_mm,
        )?;
        let fastest_mm_s = joint.limits.velocity_mm_s;
        let speed_mm_s = within("--speed", speed_mm_s.unwrap_or(usual_mm_s), fastest_mm_s)?;
        Ok(Way {
            ends_mm: args.way(joint, distance_mm)?,
            speed_mm_s,
        })
    }

    pub(super) fn length_mm(&self) -> f64 {
        self.ends_mm[1] - self.ends_mm[0]
    }

    /// Lines that go there and back at some shares of the speed, with a rest behind each.
    pub(super) fn lines(&self, letter: char) -> Vec<String> {
        let [from_mm, to_mm] = self.ends_mm;
        let mut lines = Vec::new();
        for share in SPEEDS {
            let feed = self.speed_mm_s * share * 60.0;
            for end_mm in [to_mm, from_mm] {
                lines.push(format!("G53 G1 {letter}{end_mm:.5} F{feed:.3}"));
                lines.push("G4 P0.4".to_owned());
            }
        }
        lines
    }
}

/// The first lines: to the beginning of a way; the next line is number [`FIRST_LINE`].
pub(super) fn opening(letter: char, way: &Way) -> Vec<String> {
    vec![
        "(one joint there and back, to see how it follows)".to_owned(),
        "G8 G21 G90 G94 G40 G49 G61.1".to_owned(),
        // Not as a rapid move: a loop whose gains are still bad would not follow it.
        format!("G53 G1 {letter}{:.5} F{:.3}", way.ends_mm[0], way.speed_mm_s * 60.0),
        "G4 P0.5".to_owned(),
    ]
}

/// Moves that are judged.
pub(super) fn judged(record: &Record) -> Vec<Move> {
    let moves = record.moves();
    moves.into_iter().filter(|of| of.line >= FIRST_LINE).collect()
}

/// What might be fed forward.
#[derive(Clone, Debug)]
enum Proposal {
    /// To the loop that the control closes.
    Loop {
        found: Identified,
        now: [f64; 4],
        then: [f64; 4],
    },
    /// To the drive (60B2), by the torque that it tells of.
    Torque { now: Option<f64>, then: f64 },
    /// Nothing is known to go by.
    None(&'static str),
}

impl Proposal {
    fn new(record: &Record, moves: &[Move], joint: &Joint) -> Proposal {
        match &joint.pid {
            Some(gains) => match loop_proposal(record, moves, joint, gains) {
                Ok(proposal) => proposal,
                Err(_) => Proposal::None("the moves do not tell what the amplifier is like"),
            },
            None if record.has_torque() => Proposal::Torque {
                now: joint.torque_per_mm_s2,
                then: torque_per_mm_s2(record, moves),
            },
            None => Proposal::None("with 0x6077/16 among the inputs of its node, torque_per_mm_s2 would be proposed"),
        }
    }

    fn to_json(&self) -> Json {
        match self {
            Proposal::Loop { found, now, then } => json!({ "plant": found, "ff_now": now, "ff": then }),
            Proposal::Torque { now, then } => json!({ "torque_per_mm_s2_now": now, "torque_per_mm_s2": then }),
            Proposal::None(_) => Json::Null,
        }
    }

    fn text(&self) -> String {
        match self {
            Proposal::Loop { now, then, .. } => format!(
                "proposed      ff1 = {:.4}, ff2 = {:.6}   (now {} and {}; isocnc tune pid --feed-forward tries them)\n",
                then[1], then[2], now[1], now[2]
            ),
            Proposal::Torque { now, then } => {
                let now = now.map_or("none".to_owned(), |now| now.to_string());
                format!("proposed      torque_per_mm_s2 = {then:.5}   (now {now}; needs 0x60B2/16 among the outputs)\n")
            }
            Proposal::None(why) => format!("proposed      nothing: {why}\n"),
        }
    }
}

fn loop_proposal(record: &Record, moves: &[Move], joint: &Joint, gains: &PidGains) -> anyhow::Result<Proposal> {
    let found = identify(record, moves, joint.mode == DriveMode::Cst)?;
    Ok(Proposal::Loop {
        found,
        now: gains.ff,
        then: feed_forward(&found.plant, gains.d, gains, record.cycle_s),
    })
}

/// Moves a joint and judges it.
///
/// # Errors
/// Arguments or a machine file that make no sense; what keeps the program from being run, or the picture from being written.
pub(super) fn step(args: &StepArgs) -> anyhow::Result<ExitCode> {
    let config = args.joint.read()?;
    let joint = &config.joints[args.joint.joint];
    let way = Way::new(
        &args.joint,
        joint,
        args.distance,
        args.speed,
        joint.limits.velocity_mm_s,
    )?;
    let window_mm = match args.window {
        Some(window_um) => within("--window", window_um, 1e5)? / 1000.0,
        None => {
            let [counts, units] = joint.counts_per_unit.map(f64::from);
            (WINDOW_UM / 1000.0).max(WINDOW_COUNTS * units / counts)
        }
    };
    prepare_for(&args.joint.out, &["step.json", "step.svg"])?;
    let letter = letter(&config, args.joint.joint)?;
    let plan = Plan {
        name: "step",
        text: text(letter, &way),
        moves: format!(
            "{}: homes all joints, then moves joint {} ({letter}) between {:.3} and {:.3} mm, three times there and back, at up to {} mm/s",
            config.name, args.joint.joint, way.ends_mm[0], way.ends_mm[1], way.speed_mm_s
        ),
        shorter: "a greater --speed or a shorter --distance takes less",
    };
    let record = match measure(&args.joint, &config, &plan, None)? {
        Ok(record) => record,
        Err(code) => return Ok(code),
    };
    let found = Found::new(&record, joint, window_mm);
    let figures = found.to_json(&config, &args.joint);
    let title = format!("{}: joint {} ({letter})", config.name, args.joint.joint);
    experiment::write(
        &args.joint,
        &config,
        "step",
        &figures,
        &picture(&title, &record, &found.moves),
    )?;
    match args.joint.json {
        true => say(&format!("{figures:#}\n")),
        false => say(&format!(
            "\n{title}, {:.3} mm at up to {} mm/s\n\n{}picture       {}\n",
            way.length_mm(),
            way.speed_mm_s,
            found.text(),
            args.joint.out.join("step.svg").display()
        )),
    }
    Ok(ExitCode::SUCCESS)
}

fn text(letter: char, way: &Way) -> String {
    let mut lines = opening(letter, way);
    lines.extend(way.lines(letter));
    lines.push("M2".to_owned());
    lines.join("\n") + "\n"
}

/// All that moves have shown.
struct Found {
    moves: Vec<Move>,
    figures: Vec<StepFigures>,
    parts: ErrorParts,
    proposal: Proposal,
    window_mm: f64,
}

impl Found {
    fn new(record: &Record, joint: &Joint, window_mm: f64) -> Found {
        let moves = judged(record);
        Found {
            figures: moves.iter().map(|of| step_figures(record, of, window_mm)).collect(),
            parts: error_parts(record, &moves),
            proposal: Proposal::new(record, &moves, joint),
            moves,
            window_mm,
        }
    }

    fn to_json(&self, config: &Config, args: &JointArgs) -> Json {
        json!({
            "machine": config.name,
            "joint": args.joint,
            "window_um": self.window_mm * 1000.0,
            "moves": self.figures,
            "following_error": self.parts,
            "feed_forward": self.proposal.to_json(),
        })
    }

    fn text(&self) -> String {
        let parts = &self.parts;
        let mut text = figures_table(&self.figures);
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "\nsettled: stays within {} um of its end; times from the end of the command on\n\
             of the following error {:.3} ms go with velocity, {:.2} um with each 1000 mm/s2, {:.2} um with the direction, {:.2} um always;\n\
             {:.0} % are none of these",
            self.window_mm * 1000.0,
            parts.with_velocity_ms,
            parts.with_acceleration_um,
            parts.with_direction_um,
            parts.constant_um,
            parts.left * 100.0
        );
        text + &self.proposal.text()
    }
}

/// A row a move.
pub(super) fn figures_table(figures: &[StepFigures]) -> String {
    let heading = [
        ">to, mm",
        ">rise, ms",
        ">of command",
        ">overshoot, um",
        ">settled, ms",
        ">error accelerating, um",
        ">at speed",
        ">braking",
        ">at rest",
    ];
    let or_never = |ms: Option<f64>| ms.map_or("never".to_owned(), |ms| format!("{ms:.0}"));
    table(
        &heading,
        figures.iter().map(|it| {
            vec![
                format!("{:.3}", it.to_mm),
                or_never(it.rise_ms),
                format!("{:.0}", it.command_rise_ms),
                format!("{:.1}", it.overshoot_um),
                or_never(it.settling_ms),
                format!("{:.1}", it.accelerating_um),
                format!("{:.1}", it.at_speed_um),
                format!("{:.1}", it.braking_um),
                format!("{:.1}", it.at_rest_um),
            ]
        }),
    )
}

/// Place, velocity, following error and what drives, over time; and the following error over velocity.
fn picture(title: &str, record: &Record, moves: &[Move]) -> String {
    let begin = moves.first().map_or(0, |of| of.motion.start.saturating_sub(50));
    let over = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        let cycles = begin..record.cycles.len();
        cycles
            .map(|at| ((at - begin) as f64 * record.cycle_s, value(at)))
            .collect()
    };
    let mut panels = vec![
        Panel {
            name: "place, mm",
            series: vec![
                Series::new("command", over(&|at| record.cycles[at].command_mm)),
                Series::new("actual", over(&|at| record.cycles[at].actual_mm)),
            ],
            marks: Vec::new(),
        },
        Panel {
            name: "velocity, mm/s",
            series: vec![
                Series::new("command", over(&|at| record.velocity_mm_s(at))),
                Series::new("actual", over(&|at| record.measured_mm_s(at))),
            ],
            marks: Vec::new(),
        },
        Panel {
            name: "following error, um",
            series: vec![Series::new(
                "",
                over(&|at| record.cycles[at].following_error_mm * 1000.0),
            )],
            marks: vec![0.0],
        },
    ];
    if record.has_output() {
        panels.push(Panel {
            name: "output of the loop",
            series: vec![Series::new("", over(&|at| record.cycles[at].output))],
            marks: vec![0.0],
        });
    }
    if record.has_torque() {
        panels.push(Panel {
            name: "torque, 1/1000 of the rated one",
            series: vec![Series::new("", over(&|at| record.cycles[at].torque))],
            marks: vec![0.0],
        });
    }
    let across = Across {
        name: "time, s",
        logarithmic: false,
    };
    chart_svg(title, across, &panels)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{LOOP, rehearsed};
    use super::*;
    use std::path::Path;

    const WAY: Way = Way {
        ends_mm: [100.0, 120.0],
        speed_mm_s: 120.0,
    };

    fn found(file: &str, joint: usize) -> (Record, Found) {
        let config = config::parse(file, Path::new("m.toml")).unwrap();
        let letter = letter(&config, joint).unwrap();
        let way = match joint {
            2 => Way {
                ends_mm: [-80.0, -60.0],
                speed_mm_s: 80.0,
            },
            _ => WAY,
        };
        let record = rehearsed(&config, joint, &text(letter, &way));
        let found = Found::new(&record, &config.joints[joint], 0.01);
        (record, found)
    }

    #[test]
    fn a_joint_of_the_demo_goes_there_and_back_and_is_judged() {
        let (record, found) = found(LOOP, 0);
        assert_eq!(found.figures.len(), 2 * SPEEDS.len());
        for (figures, way) in found.figures.iter().zip([WAY.ends_mm, [120.0, 100.0]].iter().cycle()) {
            assert!(
                (figures.from_mm - way[0]).abs() + (figures.to_mm - way[1]).abs() < 1e-9,
                "{figures:?}"
            );
            assert!(figures.settling_ms.is_some_and(|ms| ms < 100.0), "{figures:?}");
            assert!(figures.at_rest_um < 1.0, "{figures:?}");
            let rise_ms = figures.rise_ms.unwrap();
            assert!((rise_ms - figures.command_rise_ms).abs() < 10.0, "{figures:?}");
        }
        let said = found.text();
        assert!(said.contains("settled: stays within 10 um"), "{said}");
        let svg = picture("x", &record, &found.moves);
        assert!(roxmltree::Document::parse(&svg).is_ok());
        assert!(svg.contains("output of the loop") && !svg.contains("torque"));
    }

    #[test]
    fn what_is_fed_forward_too_little_is_proposed() {
        // Of a gain of 1 a tenth is missing, and nothing is known of the lag.
        let file = LOOP.replace("ff1 = 1.0, ff2 = 0.005", "ff1 = 0.9");
        let (_, worse) = found(&file, 0);
        let Proposal::Loop { then, .. } = worse.proposal else {
            panic!("{:?}", worse.proposal);
        };
        assert!((then[1] - 1.0).abs() < 0.005, "{then:?}");
        assert!((0.003..0.007).contains(&then[2]), "{then:?}");
        let (_, better) = found(
            &LOOP.replace(
                "ff1 = 1.0, ff2 = 0.005",
                &format!("ff1 = {}, ff2 = {}", then[1], then[2]),
            ),
            0,
        );
        for (worse, better) in worse.figures.iter().zip(&better.figures) {
            assert!(better.at_speed_um < 0.1 * worse.at_speed_um, "{worse:?} {better:?}");
            assert!(
                better.accelerating_um < 0.3 * worse.accelerating_um,
                "{worse:?} {better:?}"
            );
        }
    }

    #[test]
    fn a_drive_that_tells_of_its_torque_is_proposed_what_to_feed_forward() {
        let file = include_str!("../../../configs/mill3-demo.toml");
        let objects = "\"0x6064/32\", \"0x60F4/32\"]";
        assert!(file.contains(objects));
        let (record, found) = found(
            &file.replacen(objects, "\"0x6064/32\", \"0x60F4/32\", \"0x6077/16\"]", 1),
            0,
        );
        assert!(record.has_torque() && !record.has_output());
        let Proposal::Torque { now: None, then } = found.proposal else {
            panic!("{:?}", found.proposal);
        };
        // The simulated motor speeds up with 12000 mm/s2 by three times the rated torque.
        assert!((then - 0.25).abs() < 0.005, "{then}");
    }
}
