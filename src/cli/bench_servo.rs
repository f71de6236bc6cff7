//! `isocnc bench-servo`: what a cycle of so many axes takes on this PC, in parts, and how fast programs are planned.
//!
//! In:  nothing but this PC; or a machine file. Out: a table, or JSON.
//!
//! The machine is simulated on virtual time, in this process: what is timed is the control's own code, with a program that moves all
//! axes. What the simulated wire takes is left out, as a real one works beside the processor.

use anyhow::{Context, anyhow, bail, ensure};
use clap::Args;
use config::{self, AxisMap, Config, HomingBy, Joint, SimJoint};
use host::histogram::{Jitter, Summary};
use host::steadiness::Steadiness;
use host::terminal::say;
use host::wait::thread_cpu_s;
use machine::state::State;
use machine::tables::Tables;
use motion::canon::{Axis, Position};
use motion::kinematics::ToolFrame;
use motion::plan::PlannerKind;
use motion::rt::{
    CompensationShare, JointCompensation, MotionLimits, Pid, PidGains, PitchBounds, PitchRow, PitchTable, StopLimits,
};
use operator::rehearsal::{Rehearsal, rehearse_with};
use program::real_time::Measure;
use program::{Feeder, Progress, home};
use rt::cycle::Part;
use serde::Serialize;
use serde_json::{Value as Json, json};
use sim::NetConfig;
use std::f64::consts::TAU;
use std::fmt;
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use terminal::refusal::Refusal;

const DEMO: &str = include_str!("../../configs/mill3-demo.toml");
/// Numbers of axes where none is named.
const AXES: [usize; 7] = [1, 2, 3, 4, 6, 9, 16];
/// Cycles that are timed.
const CYCLES: u64 = 10_000;
/// The same where somebody waits for something else.
pub(super) const CYCLES_OF_CHECK: u64 = 1_500;
/// Cycles that a machine takes to its first one of a program at the most.
const CYCLES_BEFORE: u64 = 120_000;
/// How long that may take here.
const PATIENCE: Duration = Duration::from_secs(5);
/// Lines, and arcs, of the program.
const ENTITIES: usize = 500;
/// Share of the travel that is used, and of the slowest axis' velocity.
const REACH: f64 = 0.5;
/// How often less of it is tried.
const SMALLER: u32 = 8;
/// How far from its switch a joint is switched on, mm.
const NEAR_HOME_MM: f64 = 5.0;
const FEED: f64 = 0.4;
/// Why nothing is measured.
const NO_PROGRAM: &str = "no program is known for a machine without an X axis, or whose joints leave it no room";
/// Repetitions of whose times the least counts: what disturbs only adds.
const ROUNDS: usize = 5;
/// A fast drive answers within this, us: seventeen nodes fit a millisecond.
const PRES_TIMEOUT_US: u32 = 40;
/// Share of a cycle that computing and bus may take.
const LOAD: f64 = 0.9;
/// Cycles of machines, us.
const CYCLES_US: [u32; 6] = [125, 250, 500, 1000, 2000, 4000];

/// Arguments of `bench-servo`.
#[derive(Debug, Args)]
pub(super) struct BenchServoArgs {
    /// Machine file; left out: mills with more and more axes
    machine: Option<PathBuf>,
    /// Numbers of axes, such as 2,3,6
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=16), conflicts_with = "machine")]
    axes: Vec<u8>,
    /// Cycles to time
    #[arg(long, default_value_t = CYCLES, value_parser = clap::value_parser!(u64).range(100..=1_000_000))]
    cycles: u64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What the cycles of a machine take.
#[derive(Clone, Debug)]
pub(super) struct Servo {
    joints: usize,
    /// Mean of each part, us, by its name.
    parts_us: [(&'static str, f64); 9],
    /// All of them together, cycle by cycle.
    cycle: Summary,
    /// Exchange on a wire of 100 Mbit/s at the worst, us.
    wire_us: f64,
}

impl Servo {
    pub(super) fn to_json(&self) -> Json {
        let parts = self.parts_us.iter().map(|(name, us)| ((*name).to_owned(), json!(us)));
        let parts: serde_json::Map<_, _> = parts.collect();
        json!({ "joints": self.joints, "parts_us": parts, "cycle": self.cycle, "wire_us": self.wire_us })
    }
}

/// As one line.
impl fmt::Display for Servo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Servo { joints, cycle, .. } = self;
        let plural = if *joints == 1 { "" } else { "s" };
        write!(
            f,
            "computing takes {:.1} us of a cycle for {joints} joint{plural}, {:.1} us in 99.9 % of them:",
            cycle.mean_us, cycle.p99_9_us
        )?;
        for (name, us) in &self.parts_us[..Part::ALL.len()] {
            write!(f, " {name} {us:.2},")?;
        }
        write!(f, " more by isocnc bench-servo")
    }
}

/// How fast a planner is.
#[derive(Clone, Debug, Serialize)]
struct Planned {
    planner: &'static str,
    /// Of lines and arcs.
    entities_per_s: f64,
}

/// Measures, and prints.
///
/// # Errors
/// A machine file with mistakes, or a machine for which no program is known.
pub(super) fn bench_servo(args: &BenchServoArgs) -> anyhow::Result<ExitCode> {
    let machines = match &args.machine {
        Some(file) => vec![bus::read(file).map_err(Refusal::from)?],
        None if args.axes.is_empty() => AXES.iter().map(|axes| mill(*axes)).collect::<Result<_, _>>()?,
        None => args
            .axes
            .iter()
            .map(|axes| mill((*axes).into()))
            .collect::<Result<_, _>>()?,
    };
    let first = machines.first().context("a machine")?;
    let late = Steadiness::measure(&first.rt).late;
    let servos: Vec<Servo> = machines
        .iter()
        .map(|config| servo(config, args.cycles))
        .collect::<Result<_, _>>()?;
    let of_entities = match &args.machine {
        Some(_) => first,
        None => &mill(2)?,
    };
    let planned = entities(of_entities)?;
    let cycles_us: Vec<Option<u32>> = servos.iter().map(|servo| shortest_us(servo, &late)).collect();
    if args.json {
        let servos: Vec<_> = servos
            .iter()
            .zip(&cycles_us)
            .map(|(servo, cycle_us)| {
                let mut json = servo.to_json();
                json["shortest_cycle_us"] = json!(cycle_us);
                json
            })
            .collect();
        let all = json!({ "cycles": args.cycles, "late": late, "servo": servos, "planned": planned });
        say(&format!("{all:#}\n"));
    } else {
        say(&text(&servos, &cycles_us, &planned, &late));
    }
    Ok(ExitCode::SUCCESS)
}

fn text(servos: &[Servo], cycles_us: &[Option<u32>], planned: &[Planned], late: &Summary) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let mut put = |line: std::fmt::Arguments<'_>| {
        let _ = writeln!(text, "{line}");
    };
    put(format_args!("what a cycle takes, us (mean of each part)\n"));
    let joints = servos.iter().map(|servo| format!("{:>8}", servo.joints));
    put(format_args!("{:<22}{}", "joints", joints.collect::<String>()));
    for part in 0..servos.first().map_or(0, |servo| servo.parts_us.len()) {
        let name = servos[0].parts_us[part].0;
        let row = servos.iter().map(|servo| format!("{:>8.2}", servo.parts_us[part].1));
        put(format_args!("  {name:<20}{}", row.collect::<String>()));
    }
    let mut row = |name: &str, value: &dyn Fn(&Servo) -> f64| {
        let row = servos.iter().map(|servo| format!("{:>8.2}", value(servo)));
        put(format_args!("{name:<22}{}", row.collect::<String>()));
    };
    row("all, mean", &|servo| servo.cycle.mean_us);
    row("all, 99.9 %", &|servo| servo.cycle.p99_9_us);
    row("a joint, mean", &|servo| servo.cycle.mean_us / servo.joints as f64);
    row("wire, at the worst", &|servo| servo.wire_us);
    let shortest = cycles_us.iter().map(|cycle_us| match cycle_us {
        Some(cycle_us) => format!("{cycle_us:>8}"),
        None => format!("{:>8}", "none"),
    });
    put(format_args!("{:<22}{}", "shortest cycle", shortest.collect::<String>()));
    put(format_args!(
        "\n\"compensation\" is that of backlash and pitch errors, \"position loop\" one that the control closes: not part of the sum.\n\
         The shortest cycle holds the wire (every node at its time-out) and 99.9 % of the computing in nine\n\
         tenths of it, and a thread that wakes up {:.0} us late (99 % of times on this PC) in a quarter.\n",
        late.p99_us
    ));
    for planned in planned {
        put(format_args!(
            "planner {:<10}{:>10.0} lines and arcs a second",
            planned.planner, planned.entities_per_s
        ));
    }
    text
}

/// The shortest usual cycle that is kept; `None`: none.
fn shortest_us(servo: &Servo, late: &Summary) -> Option<u32> {
    let busy_us = servo.wire_us + servo.cycle.p99_9_us;
    CYCLES_US.into_iter().find(|cycle_us| {
        let cycle_us = f64::from(*cycle_us);
        busy_us <= LOAD * cycle_us && late.p99_us <= cycle_us / 4.0
    })
}

/// The demo mill with so many joints: an axis for each of the first nine, then a second joint of the first axes, and so on.
fn mill(joints: usize) -> anyhow::Result<Config> {
    let demo = config::parse(DEMO, Path::new("mill3-demo.toml"))?;
    let letters = [
        Axis::X,
        Axis::Y,
        Axis::Z,
        Axis::U,
        Axis::V,
        Axis::W,
        Axis::A,
        Axis::B,
        Axis::C,
    ];
    let mut config = demo.clone();
    for node in &mut config.bus.nodes {
        node.pres_timeout_us = PRES_TIMEOUT_US;
    }
    let (io, drives) = config
        .bus
        .nodes
        .clone()
        .split_last()
        .map(|(io, drives)| (io.clone(), drives.to_vec()))
        .context("nodes")?;
    config.bus.nodes.clear();
    config.joints.clear();
    for joint in 0..joints {
        let (mut node, mut own) = (drives[joint % drives.len()].clone(), demo.joints[0].clone());
        node.id = 21 + joint as u8;
        node.name = format!("drive-{joint}");
        own.node = joint;
        config.bus.nodes.push(node);
        config.joints.push(own);
    }
    config.bus.nodes.push(io);
    config.axes = letters
        .iter()
        .take(joints)
        .enumerate()
        .map(|(number, axis)| AxisMap {
            axis: *axis,
            joints: (number..joints).step_by(letters.len()).collect(),
            wrapped: false,
            travel_mm: None,
        })
        .collect();
    // Its inputs hang on the node, which has another number now.
    config.sim.probe = None;
    config.sim.joints.clear();
    Ok(config)
}

/// The same machine, whose joints are switched on near their switches: a joint of metres would search for minutes.
fn near_home(config: &Config) -> Config {
    let mut config = config.clone();
    for (number, joint) in config.joints.iter().enumerate() {
        let home_mm = match &joint.homing.by {
            // It is home wherever it stands.
            HomingBy::Drive { method: 35 | 37, .. } => continue,
            HomingBy::Drive { .. } => joint.homing.position_mm,
            HomingBy::Control(by) => by.switch_mm,
        };
        let [low, high] = joint.travel_mm;
        let inside_mm = NEAR_HOME_MM.min((high - low) / 4.0);
        let start_mm = Some(home_mm.clamp(low + inside_mm, high - inside_mm));
        match config.sim.joints.iter_mut().find(|special| special.joint == number) {
            Some(special) => special.start_mm = start_mm,
            None => config.sim.joints.push(SimJoint {
                joint: number,
                start_mm,
                switch_mm: None,
                input: None,
            }),
        }
    }
    config
}

/// An axis with the middle and half the length of the way that is used of it, in machine coordinates.
type Room = (Axis, f64, f64);

/// Where the path goes at a share of its turn.
fn place(rooms: &[Room], turn: f64) -> impl Iterator<Item = (Axis, f64)> {
    let places = rooms.iter().enumerate();
    places.map(move |(number, (axis, middle, half))| (*axis, middle + half * (TAU * turn + number as f64).sin()))
}

/// The largest rooms in which all joints stay within their travel.
fn rooms(config: &Config) -> Option<Vec<Room>> {
    let kinematics = config.kinematics();
    let middles: Vec<f64> = config
        .joints
        .iter()
        .map(|joint| f64::midpoint(joint.travel_mm[0], joint.travel_mm[1]))
        .collect();
    // Where joints are not axes, the middle of what a joint travels says nothing of its axis.
    let centres = [kinematics.forward(&ToolFrame::OFF, &middles), Some(home(config))];
    let room = |map: &AxisMap, centre: &Position, reach: f64| {
        let [low, high] = map.travel_mm.unwrap_or(config.joints[map.joints[0]].travel_mm);
        let middle = map
            .travel_mm
            .map_or(centre[map.axis], |[low, high]| f64::midpoint(low, high));
        (map.axis, middle, reach * (high - low) / 2.0)
    };
    let reaches = (0..SMALLER).map(|halvings| REACH / f64::from(1 << halvings));
    let tries = reaches.flat_map(|reach| centres.iter().flatten().map(move |centre| (reach, centre)));
    let mut tries = tries.map(|(reach, centre)| {
        config
            .axes
            .iter()
            .map(|map| room(map, centre, reach))
            .collect::<Vec<Room>>()
    });
    tries.find(|rooms| {
        let turns = (0..ENTITIES).map(|line| line as f64 / ENTITIES as f64);
        let mut places = turns.flat_map(|turn| {
            let mut at = Position::ZERO;
            place(rooms, turn).for_each(|(axis, mm)| at[axis] = mm);
            let mut beside = at;
            let arcs = [Axis::X, Axis::Y].map(|axis| rooms.iter().position(|room| room.0 == axis));
            if let [Some(x), Some(y)] = arcs {
                // Half circles lie beside the middle of X: their outermost places.
                let radius = rooms[x].2 / 20.0;
                beside[Axis::X] = rooms[x].1 + 2.0 * radius;
                beside[Axis::Y] = rooms[y].1 + rooms[y].2 * 1.0_f64.sin() + radius;
            }
            [at, beside]
        });
        places.all(|at| {
            let mut joints = vec![0.0; config.joints.len()];
            let within = |(joint, mm): (&Joint, &f64)| (joint.travel_mm[0]..=joint.travel_mm[1]).contains(mm);
            kinematics.inverse(&ToolFrame::OFF, &at.0, &mut joints).is_ok()
                && config.joints.iter().zip(&joints).all(within)
        })
    })
}

/// Lines, then half circles of X and Y, in which all axes move; `None`: the machine has no X, or no room.
fn program(config: &Config) -> Option<String> {
    let rooms: Vec<Room> = rooms(config)?
        .into_iter()
        .map(|(axis, middle, half)| (axis, middle - config.work_offsets[0][axis], half))
        .collect();
    rooms.iter().find(|(axis, ..)| *axis == Axis::X)?;
    let slowest = config.joints.iter().map(|joint| joint.limits.velocity_mm_s);
    let feed_mm_min = 60.0 * FEED * slowest.fold(f64::INFINITY, f64::min);
    let words = |turn: f64, wanted: &dyn Fn(Axis) -> bool| -> String {
        let places = place(&rooms, turn).filter(|(axis, _)| wanted(*axis));
        places.map(|(axis, at)| format!(" {}{at:.4}", axis.letter())).collect()
    };
    let place = |turn: f64| words(turn, &|_| true);
    let mut text = format!(
        "G21 G90 G91.1 G17 G94 G54 G64 P0.01\nG0{}\nF{feed_mm_min:.0}\n",
        place(0.0)
    );
    for line in 1..=ENTITIES {
        let _ = writeln!(text, "G1{}", place(line as f64 / ENTITIES as f64));
    }
    // To and fro by half circles, which end where they began.
    let [x, y] = [Axis::X, Axis::Y].map(|axis| rooms.iter().find(|(other, ..)| *other == axis));
    for arc in 1..=ENTITIES {
        let turn = arc as f64 / ENTITIES as f64;
        let (Some((_, x, half)), Some((_, y, half_y))) = (x, y) else {
            let _ = writeln!(text, "G1{}", place(turn));
            continue;
        };
        let (y, radius) = (y + half_y * 1.0_f64.sin(), half / 20.0);
        let (to, centre) = if arc % 2 == 1 {
            (x + 2.0 * radius, radius)
        } else {
            (*x, -radius)
        };
        let others = words(turn, &|axis| !matches!(axis, Axis::X | Axis::Y));
        let _ = writeln!(text, "G2 X{to:.4} Y{y:.4} I{centre:.4} J0{others}");
    }
    text.push_str("M2\n");
    Some(text)
}

/// What the cycles of a machine take while a program moves all its axes.
///
/// By an ordinary thread: a control may be running, and its core is its own.
pub(super) fn servo(config: &Config, cycles: u64) -> anyhow::Result<Servo> {
    let Some(text) = program(config) else {
        bail!("{NO_PROGRAM}");
    };
    let config = &near_home(config);
    let net = NetConfig::clean(1);
    rehearse_with(
        config,
        text.as_bytes(),
        net,
        |operator| operator.repeating(),
        |run| {
            let runs = |run: &mut Rehearsal<'_>| run.control.state() == State::Running;
            let began = Instant::now();
            ensure!(
                run.run_until(CYCLES_BEFORE, |run| {
                    runs(run) || run.operator.outcome().is_some() || began.elapsed() > PATIENCE
                })? && runs(run),
                "the machine does not come to run a program{}",
                run.operator
                    .journal()
                    .last()
                    .map_or(String::new(), |entry| format!(": {}", entry.text))
            );
            run.control.time_parts();
            run.net().time_calls();
            let mut all = Jitter::new(0);
            let mut before = Duration::ZERO;
            // Between two runs of the program the machine rests: those cycles do not count.
            let mut resting = [Duration::ZERO; Part::ALL.len()];
            let (mut counted, mut of_wire) = (0, Duration::ZERO);
            for _ in 0..10 * cycles {
                let wire = run.net().spent();
                let parts = Part::ALL.map(|part| run.control.laps().spent(part));
                run.cycle(0)?;
                let wire = run.net().spent() - wire;
                let after: Duration = Part::ALL.iter().map(|part| run.control.laps().spent(*part)).sum();
                if runs(run) {
                    all.record((after - before).saturating_sub(wire).as_nanos() as u64);
                    of_wire += wire;
                    counted += 1;
                } else {
                    for ((resting, part), before) in resting.iter_mut().zip(Part::ALL).zip(parts) {
                        *resting += run.control.laps().spent(part) - before;
                    }
                }
                before = after;
                if counted == cycles {
                    break;
                }
            }
            ensure!(counted == cycles, "the program ran in {counted} cycles only");
            let mean_us = |part: Part| {
                let wire = if part == Part::Bus { of_wire } else { Duration::ZERO };
                let spent = run.control.laps().spent(part) - resting[part as usize];
                spent.saturating_sub(wire).as_secs_f64() * 1e6 / cycles as f64
            };
            Ok(Servo {
                joints: config.joints.len(),
                parts_us: [
                    ("bus", mean_us(Part::Bus)),
                    ("drives", mean_us(Part::Drives)),
                    ("pins", mean_us(Part::Pins)),
                    ("orders, state", mean_us(Part::Orders)),
                    ("interpolation", mean_us(Part::Interpolation)),
                    ("kinematics", mean_us(Part::Kinematics)),
                    ("monitor", mean_us(Part::Monitor)),
                    ("compensation", config.joints.len() as f64 * compensation_us()?),
                    ("position loop", config.joints.len() as f64 * loop_us()),
                ],
                cycle: all.summary(),
                wire_us: bus::worst_exchange_ns(config) as f64 / 1e3,
            })
        },
    )
}

/// Compensation of backlash and pitch errors of one joint, by a table of 100 rows, us.
fn compensation_us() -> anyhow::Result<f64> {
    const CALLS: u32 = 10_000;
    let rows: Vec<PitchRow> = (0..100)
        .map(|row| {
            let (at_mm, error_mm) = (f64::from(row), 0.01 * f64::from(row).sin());
            PitchRow {
                position_mm: at_mm,
                forward_mm: 0.01 - error_mm,
                backward_mm: error_mm - 0.01,
            }
        })
        .collect();
    let bounds = PitchBounds {
        correction_mm: 0.5,
        slope: 0.01,
    };
    let motion = MotionLimits {
        velocity: 150.0,
        acceleration: 1500.0,
        jerk: 30_000.0,
    };
    let stop = StopLimits {
        acceleration: 3000.0,
        jerk: 120_000.0,
    };
    let share = CompensationShare::new(PitchTable::new(&rows, &bounds)?, motion, stop)?;
    let mut compensation = JointCompensation::new(share.table, 0.0, share.take_up, 1e-3);
    let all_us = least_us(|| {
        for call in 0..CALLS {
            let at_mm = 50.0 + 40.0 * (1e-3 * f64::from(call)).sin();
            black_box(compensation.step(black_box(at_mm)));
        }
    });
    Ok(all_us / f64::from(CALLS))
}

/// A position loop with all its parts around one joint, us.
fn loop_us() -> f64 {
    const CALLS: u32 = 10_000;
    let gains = PidGains {
        p: 40.0,
        i: 10.0,
        d: 0.01,
        ff: [0.0, 1.0, 0.005, 1e-6],
        dead_band: 1e-4,
        integral_max: 1.0,
        output_max: 200.0,
        ..PidGains::default()
    };
    let mut pid = Pid::new(gains, 1e-3);
    let all_us = least_us(|| {
        for call in 0..CALLS {
            let at = (1e-3 * f64::from(call)).sin();
            black_box(pid.step(black_box(at), black_box(0.99 * at)));
        }
    });
    all_us / f64::from(CALLS)
}

/// The least time of some rounds, us.
fn least_us(mut act: impl FnMut()) -> f64 {
    let rounds = (0..ROUNDS).map(|_| {
        let began = Instant::now();
        act();
        began.elapsed().as_secs_f64() * 1e6
    });
    rounds.fold(f64::INFINITY, f64::min)
}

/// Lines and arcs that each planner plans in a second of processor time, from text to the ring, in one thread.
fn entities(config: &Config) -> anyhow::Result<Vec<Planned>> {
    let text = program(config).context(NO_PROGRAM)?;
    let count = text
        .lines()
        .filter(|line| line.starts_with("G1 ") || line.starts_with("G2 "))
        .count();
    let tables = Tables::read(config)?;
    [("optimal", PlannerKind::Optimal), ("classic", PlannerKind::Classic)]
        .into_iter()
        .map(|(planner, kind)| {
            let mut config = config.clone();
            config.program.planner = kind;
            let mut least_s = f64::INFINITY;
            for _ in 0..ROUNDS {
                let began_s = thread_cpu_s();
                let mut feeder = Feeder::new(
                    &config,
                    &tables,
                    text.as_bytes(),
                    home(&config),
                    Measure::new(thread_cpu_s),
                );
                while feeder.pump().map_err(|error| anyhow!(error.located("program")))? != Progress::Done {}
                least_s = least_s.min(thread_cpu_s() - began_s);
            }
            Ok(Planned {
                planner,
                entities_per_s: count as f64 / least_s,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::cancel::Cancel;
    use program::{Begin, check};

    #[test]
    fn its_program_has_as_many_lines_as_arcs_and_moves_all_axes_of_any_mill() {
        for joints in [1, 2, 3, 9, 16] {
            let config = mill(joints).unwrap();
            let text = program(&config).unwrap();
            let count = |word: &str| text.lines().filter(|line| line.starts_with(word)).count();
            let arcs = if joints == 1 { 0 } else { ENTITIES };
            assert_eq!((count("G1 "), count("G2 ")), (2 * ENTITIES - arcs, arcs), "{joints}");
            let tables = Tables::read(&config).unwrap();
            let begin = Begin::at_home(&config);
            let overview = check(&config, &tables, "bench", text.as_bytes(), &begin, &Cancel::default());
            assert!(overview.is_ok(), "{joints}: {overview:?}");
        }
    }

    /// A SCARA's shoulder is no X axis, and a joint of six metres does not search its switch for minutes.
    #[test]
    fn it_runs_on_arms_and_on_large_machines() {
        let scara = config::parse(include_str!("../../configs/scara-demo.toml"), Path::new("m.toml")).unwrap();
        let large = DEMO.replace("travel_mm = [-5.0, 305.0]", "travel_mm = [-5.0, 6005.0]");
        assert_ne!(large, DEMO);
        let large = config::parse(&large, Path::new("m.toml")).unwrap();
        for config in [scara, large] {
            let servo = servo(&config, 100).unwrap_or_else(|error| panic!("{}: {error:#}", config.name));
            assert_eq!((servo.joints, servo.cycle.n), (config.joints.len(), 100));
        }
    }

    #[test]
    fn the_parts_make_up_the_cycle() {
        let servo = servo(&mill(2).unwrap(), 200).unwrap();
        let sum: f64 = servo.parts_us[..7].iter().map(|(_, us)| us).sum();
        assert_eq!((servo.joints, servo.cycle.n), (2, 200));
        assert!((sum - servo.cycle.mean_us).abs() < 1e-3 * sum + 0.01, "{servo:?}");
        assert!(servo.parts_us.iter().all(|(_, us)| *us > 0.0), "{servo:?}");
        // Three nodes, and what frames take.
        assert!(servo.wire_us > 3.0 * f64::from(PRES_TIMEOUT_US), "{servo:?}");
    }

    #[test]
    fn the_shortest_cycle_holds_wire_computing_and_late_wake_ups() {
        let servo = |wire_us, p99_9_us| Servo {
            joints: 2,
            parts_us: [("", 0.0); 9],
            cycle: Summary {
                p99_9_us,
                ..Summary::default()
            },
            wire_us,
        };
        let late = |p99_us| Summary {
            p99_us,
            ..Summary::default()
        };
        assert_eq!(shortest_us(&servo(100.0, 10.0), &late(10.0)), Some(125));
        assert_eq!(shortest_us(&servo(103.0, 10.0), &late(10.0)), Some(250));
        assert_eq!(shortest_us(&servo(100.0, 10.0), &late(100.0)), Some(500));
        assert_eq!(shortest_us(&servo(4000.0, 10.0), &late(1.0)), None);
    }

    #[test]
    fn the_table_has_a_column_a_machine() {
        let servos = [1, 2].map(|joints| servo(&mill(joints).unwrap(), 100).unwrap());
        let planned = [Planned {
            planner: "optimal",
            entities_per_s: 5000.4,
        }];
        let late = Summary {
            p99_us: 12.3,
            ..Summary::default()
        };
        let said = text(&servos, &[Some(500), None], &planned, &late);
        assert!(said.contains("\njoints                       1       2\n"), "{said}");
        assert!(said.contains("\nshortest cycle             500    none\n"), "{said}");
        assert!(
            said.contains("\nplanner optimal         5000 lines and arcs a second\n"),
            "{said}"
        );
    }
}
