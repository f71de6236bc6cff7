//! Every seam between what moves joints: a program's plan, probing moves, threads and taps, holds, the way back, single block,
//! overrides, stops, jogs of joints and of axes, the way back from them, homing. One after the other at random, on every family of kinematics, with
//! both planners; all that leaves for the joints is one row of set-points, judged by its differences from cycle to cycle.
//!
//! These are the generators of the cycle thread themselves, without a bus. Random scripts print their seed; more of them:
//! `ISOCNC_SEEDS=100 cargo test --test simulated seams`.

use isocnc::config::{self, Config, JOINTS_MAX};
use isocnc::machine::motion_settings::{ring_capacity, stop_ramp, stop_shares};
use isocnc::machine::tables::Tables;
use isocnc::program::{Feeder, Progress, home, waits};
use isocnc::rt::joint_jog::{JogMotion, JogOrder, JointJog};
use isocnc::rt::overrides::{Overridden, Overrides};
use isocnc::rt::shared::RtStatus;
use isocnc::rt::way_back::{self, WayBack};
use motion::canon::{Axis, Position, SpindleDirection};
use motion::element::{Action, Surface};
use motion::kinematics::ToolFrame;
use motion::plan::PlannerKind;
use motion::ring;
use motion::rt::homing::{Homing, HomingInput, HomingJoint, HomingStatus, HomingWay};
use motion::rt::{Interpolator, MotionLimits, Sample, SampleState, Shares, SpindleFeedback, StopLimits};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

const CYCLE_S: f64 = 1e-3;
/// Cycles of one program, jog or homing, then it is ended.
const CYCLES_MAX: usize = 12_000;
/// Excess that is rounding, as a part of the limit, and as a position, mm.
const SLACK: f64 = 1e-6;
const ROUNDING_MM: f64 = 2e-11;

/// A machine file, where its programs take place (by axis letter), and what else they use.
struct Place {
    name: &'static str,
    machine: &'static str,
    room: &'static [(char, f64, f64)],
    /// Whether there is tool-centre-point control, and motion in step with the spindle.
    tool_centre: bool,
    in_step: bool,
}

const PLACES: [Place; 8] = [
    Place {
        name: "mill3",
        machine: include_str!("../configs/mill3-demo.toml"),
        room: &[('X', 30.0, 270.0), ('Y', 30.0, 170.0), ('Z', -85.0, -15.0)],
        tool_centre: false,
        in_step: true,
    },
    Place {
        name: "gantry",
        machine: include_str!("../configs/gantry-demo.toml"),
        room: &[('X', 50.0, 550.0), ('Y', 50.0, 350.0), ('Z', -85.0, -15.0)],
        tool_centre: false,
        in_step: true,
    },
    Place {
        name: "corexy",
        machine: include_str!("../configs/corexy-demo.toml"),
        room: &[('X', 40.0, 260.0), ('Y', 40.0, 260.0), ('Z', 30.0, 60.0)],
        tool_centre: false,
        in_step: false,
    },
    Place {
        name: "delta",
        machine: include_str!("../configs/delta-demo.toml"),
        room: &[('X', -50.0, 50.0), ('Y', -50.0, 50.0), ('Z', 80.0, 200.0)],
        tool_centre: false,
        in_step: false,
    },
    Place {
        name: "scara",
        machine: include_str!("../configs/scara-demo.toml"),
        room: &[
            ('X', 280.0, 380.0),
            ('Y', -60.0, 60.0),
            ('Z', -100.0, -20.0),
            ('C', -40.0, 40.0),
        ],
        tool_centre: false,
        in_step: false,
    },
    Place {
        name: "head5",
        machine: include_str!("../configs/head5-demo.toml"),
        room: &[
            ('X', -150.0, 150.0),
            ('Y', -150.0, 150.0),
            ('Z', -60.0, 60.0),
            ('B', -35.0, 35.0),
            ('C', -80.0, 80.0),
        ],
        tool_centre: true,
        in_step: true,
    },
    Place {
        name: "trunnion5",
        machine: include_str!("../configs/trunnion5-demo.toml"),
        room: &[
            ('X', -80.0, 80.0),
            ('Y', -80.0, 80.0),
            ('Z', -80.0, 20.0),
            ('A', -40.0, 15.0),
            ('C', -80.0, 80.0),
        ],
        tool_centre: true,
        in_step: true,
    },
    Place {
        name: "lathe2",
        machine: include_str!("../configs/lathe2-demo.toml"),
        room: &[('X', 15.0, 85.0), ('Z', -260.0, -40.0)],
        tool_centre: false,
        in_step: true,
    },
];

/// A generator of numbers that is the same everywhere (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    fn once_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }
}

/// Velocity, acceleration and jerk of a joint, of plans and of stops.
#[derive(Clone, Copy)]
struct Limits {
    plan: [f64; 3],
    stop: [f64; 3],
}

/// Looks at every set-point, whoever gave it.
struct Judge {
    limits: Vec<Limits>,
    last: Vec<[f64; 3]>,
    /// Cycles in which a stop is still seen in a difference of third order.
    scaling: u8,
    cycles: u64,
    /// Greatest use of the limits of plans, and of those of stops.
    used: [[f64; 3]; 2],
}

impl Judge {
    fn new(config: &Config, joints: &[f64]) -> Judge {
        let of = |joint: &config::Joint| Limits {
            plan: [
                joint.limits.velocity_mm_s,
                joint.limits.acceleration_mm_s2,
                joint.limits.jerk_mm_s3,
            ],
            stop: [
                joint.limits.velocity_mm_s,
                joint.stop.acceleration_mm_s2,
                joint.stop.jerk_mm_s3,
            ],
        };
        Judge {
            limits: config.joints.iter().map(of).collect(),
            last: joints.iter().map(|&at| [at; 3]).collect(),
            scaling: 0,
            cycles: 0,
            used: [[0.0; 3]; 2],
        }
    }

    /// Takes a cycle; `stops`: the limits of stops count in it. What is over is told.
    fn see(&mut self, joints: &[f64], stops: bool) -> Result<(), String> {
        self.scaling = if stops { 4 } else { self.scaling.saturating_sub(1) };
        self.cycles += 1;
        for (joint, (last, (&now, limits))) in self.last.iter_mut().zip(joints.iter().zip(&self.limits)).enumerate() {
            let [q1, q2, q3] = *last;
            let differences = [now - q1, now - 2.0 * q1 + q2, now - 3.0 * q1 + 3.0 * q2 - q3];
            let stops = self.scaling > 0;
            let limits = if stops { limits.stop } else { limits.plan };
            let mut power = 1.0;
            for (order, (difference, limit)) in differences.into_iter().zip(limits).enumerate() {
                power *= CYCLE_S;
                let value = difference.abs() / power;
                let rounding = f64::from(2_u32 << order) * ROUNDING_MM.max(4.0 * f64::EPSILON * now.abs()) / power;
                let used = &mut self.used[usize::from(stops)][order];
                *used = used.max((value - rounding) / limit);
                if value.is_nan() || value > limit * (1.0 + SLACK) + rounding {
                    return Err(format!(
                        "joint {joint}: {} {value:.3} of {limit} in cycle {}",
                        ["velocity", "acceleration", "jerk"][order],
                        self.cycles
                    ));
                }
            }
            *last = [now, q1, q2];
        }
        Ok(())
    }
}

/// A spindle that turns as it is told, with an encoder.
#[derive(Default)]
struct Spindle {
    told: f64,
    surface: Option<Surface>,
    factor: f64,
    turns: f64,
    turns_s: f64,
}

impl Spindle {
    fn wanted(&self, sample: &Sample) -> f64 {
        let told = match self.surface {
            Some(surface) => self.told.signum() * (surface.rpm(sample.position.0[0]) / 60.0).min(self.told.abs()),
            None => self.told,
        };
        sample.reversal.map_or(told * self.factor, |scale| -told * scale)
    }

    fn step(&mut self, sample: &Sample) {
        let before = self.turns_s;
        self.turns_s += (self.wanted(sample) - before).clamp(-0.05, 0.05);
        self.turns += (before + self.turns_s) / 2.0 * CYCLE_S;
    }

    /// Whether it is done.
    fn act(&mut self, action: Action, sample: &Sample) -> bool {
        match action {
            Action::SpindleOn {
                rpm,
                direction,
                surface,
            } => {
                self.surface = surface;
                self.told = rpm / 60.0
                    * if direction == SpindleDirection::Clockwise {
                        1.0
                    } else {
                        -1.0
                    };
                self.factor = 1.0;
                true
            }
            Action::SpindleOff | Action::ProgramEnd => {
                self.told = 0.0;
                true
            }
            Action::AwaitSpindle => (self.turns_s - self.wanted(sample)).abs() < 1e-9,
            _ => true,
        }
    }
}

/// A machine, standing or moving.
struct Machine<'a> {
    place: &'a Place,
    config: &'a Config,
    tables: Tables,
    random: Random,
    joints: Vec<f64>,
    judge: Judge,
    spindle: Spindle,
    /// What was done, in words, the latest last.
    story: Vec<String>,
    /// How often each generator began to move, by its name.
    ran: BTreeMap<&'static str, usize>,
}

impl<'a> Machine<'a> {
    fn new(place: &'a Place, config: &'a Config, seed: u64) -> Machine<'a> {
        let mut joints = vec![0.0; config.joints.len()];
        let start = home(config);
        config
            .kinematics()
            .inverse(&ToolFrame::OFF, &start.0, &mut joints)
            .expect("a home position");
        Machine {
            place,
            config,
            tables: Tables::read(config).expect("no tables"),
            random: Random(seed),
            judge: Judge::new(config, &joints),
            joints,
            spindle: Spindle::default(),
            story: vec![format!("{} seed {seed} {:?}", place.name, config.program.planner)],
            ran: BTreeMap::new(),
        }
    }

    fn count(&mut self, what: &'static str) {
        *self.ran.entry(what).or_default() += 1;
    }

    fn note(&mut self, what: impl Into<String>) {
        self.story.push(format!("cycle {}: {}", self.judge.cycles, what.into()));
    }

    fn see(&mut self, stops: bool) {
        if let Err(over) = self.judge.see(&self.joints, stops) {
            let from = self.story.len().saturating_sub(12);
            panic!("{}\n{over}\n{}", self.story[0], self.story[from..].join("\n"));
        }
    }

    /// A place in the room, or some coordinates of one.
    fn words(&mut self, all: bool) -> String {
        let mut text = String::new();
        let chosen = self.random.below(self.place.room.len());
        for (k, &(letter, low, high)) in self.place.room.iter().enumerate() {
            if all || k == chosen || self.random.once_in(2) {
                let at = (self.random.within(low, high) * 1e3).round() / 1e3;
                let _ = write!(text, " {letter}{}", at + self.residue());
            }
        }
        text
    }

    /// What computing leaves beside a number; mostly nothing.
    fn residue(&mut self) -> f64 {
        let order = self.random.within(-17.0, -3.0);
        match self.random.below(6) {
            0 => 10.0_f64.powf(order),
            1 => -(10.0_f64.powf(order)),
            2 => self.random.pick(&[1e-8, -1e-8, 1.1e-8]),
            _ => 0.0,
        }
    }

    /// A program of random blocks.
    fn text(&mut self) -> String {
        let lathe = self.place.name == "lathe2";
        let plane = if lathe { "G18" } else { "G17" };
        let mut text = format!("G21 G90 G94 G40 G49 {plane} G54\nS600 M3\nG0{}\n", self.words(true));
        let mut tool_centre = false;
        let mut led = false;
        for _ in 0..4 + self.random.below(12) {
            if self.place.in_step && !tool_centre && self.random.once_in(5) {
                // Feed per turn is given anew with its mode.
                led = !led;
                let _ = writeln!(text, "{}", if led { "G95 F0.3" } else { "G94 F800" });
            }
            let feed = match led {
                false => self.random.pick(&[60.0, 300.0, 1000.0, 3000.0, 9000.0]),
                true => self.random.pick(&[0.05, 0.2, 1.0, 3.0]),
            };
            if self.place.in_step && self.random.once_in(8) {
                let surface = format!("G96 S{:.0} D1500", self.random.within(30.0, 200.0));
                let _ = writeln!(
                    text,
                    "{}",
                    if self.random.once_in(2) {
                        surface.as_str()
                    } else {
                        "G97 S600"
                    }
                );
            }
            let line = match self.random.below(16) {
                0..=2 => format!("G0{}", self.words(false)),
                3..=5 => format!("G1{} F{feed}", self.words(false)),
                6 if lathe => format!("G3 I{:.3} K0 F{feed}", self.random.within(-4.0, 4.0)),
                6 => format!(
                    "G2 I{:.3} J{:.3} F{feed}",
                    self.random.within(-5.0, 5.0),
                    self.random.within(-5.0, 5.0)
                ),
                7..=9 => format!("G38.{}{} F{feed}", self.random.pick(&[3, 5]), self.words(false)),
                10 | 11 if tool_centre || !self.place.in_step => "G0".into(),
                10 => format!("G33 Z{:.3} K{:.3}", self.z(), self.random.within(0.2, 1.5)),
                11 => format!("G33.1 Z{:.3} K{:.3}", self.z(), self.random.within(0.2, 1.5)),
                12 => format!("G4 P{:.4}", self.random.within(0.0, 0.02)),
                13 => self.random.pick(&["G61", "G61.1", "G64", "G64 P0.05"]).into(),
                // The end is told again, or nearly.
                15 if self.random.once_in(2) => {
                    let words = self.words(false);
                    let beside: Vec<String> = words
                        .split_whitespace()
                        .map(|word| {
                            format!(
                                "{}{}",
                                &word[..1],
                                word[1..].parse::<f64>().expect("a number") + self.residue()
                            )
                        })
                        .collect();
                    let code = self.random.pick(&["G0", "G1"]);
                    format!("{code}{words} F{feed}\n{code} {}", beside.join(" "))
                }
                14 if self.place.tool_centre => {
                    tool_centre = !tool_centre;
                    if tool_centre { "G43.4 H0" } else { "G49" }.into()
                }
                _ => format!(
                    "G0{}\nG38.3{} F{feed}\nG0{}",
                    self.words(true),
                    self.words(false),
                    self.words(false)
                ),
            };
            let _ = writeln!(text, "{line}");
        }
        text + "G49\nM2\n"
    }

    fn z(&mut self) -> f64 {
        let &(_, low, high) = self.place.room.iter().find(|(letter, ..)| *letter == 'Z').expect("a Z");
        self.random.within(low, high)
    }

    /// Runs a random program. Every third machine has no probe, so that its probing moves go their whole ways.
    fn program(&mut self) {
        let text = self.text();
        let (probes, restless) = (!self.random.once_in(3), self.random.once_in(2));
        self.run(&text, probes, restless);
    }

    /// Runs a program, and whatever a restless operator does meanwhile; left alone, nothing but a contact is a stop.
    fn run(&mut self, text: &str, probes: bool, restless: bool) {
        self.note(format!("program\n{text}"));
        let kinematics = self.config.kinematics();
        let start = kinematics.forward(&ToolFrame::OFF, &self.joints).expect("a place");
        let live = Arc::new(RtStatus::new(Overrides::new(self.config.program.planner)));
        let (producer, consumer) = ring::channel(ring_capacity(self.config));
        let (answers, results) = waits::line();
        let mut feeder =
            Feeder::new(self.config, &self.tables, text.as_bytes(), start, producer).following(Arc::clone(&live));
        let mut run = Interpolator::new(consumer, start, stop_ramp(self.config));
        if probes {
            feeder = feeder.with_probe(results);
            run = run.with_probe(answers, stop_shares(self.config));
        }
        let (mut ordered, mut fed, mut stopping) = (false, false, false);
        let (mut wanted, mut contact) = (Shares::FULL, false);
        let mut sample = Sample::resting(start);
        let feed_every = self.random.pick(&[1, 1, 7, 300]);
        for cycle in 0.. {
            if !fed && cycle % feed_every == 0 {
                match feeder.pump() {
                    Ok(progress) => fed = progress == Progress::Done && feeder.is_over(),
                    Err(error) => {
                        self.note(error.located("program"));
                        fed = true;
                    }
                }
            }
            if cycle >= CYCLES_MAX && !stopping {
                stopping = true;
            }
            if restless && !stopping && self.random.once_in(150) {
                ordered = true;
                let what = self.random.below(9);
                self.note(format!("order {what} in line {}", sample.line));
                match what {
                    0 | 1 => wanted.all = 0.0,
                    2 => wanted.all = -self.random.pick(&[1.0, 0.5, 0.03]),
                    3 => wanted.all = self.random.pick(&[0.3, 0.77]),
                    4 => run.set_single_block(true),
                    5 => {
                        let percent = self.random.pick(&[100.0, 60.0, 17.0, 0.0]);
                        let what = self.random.pick(&[Overridden::Feed, Overridden::Rapid]);
                        live.overrides.order(what, percent).expect("in its range");
                    }
                    6 => self.spindle.factor = self.random.within(0.5, 1.2),
                    7 if self.random.once_in(4) => stopping = true,
                    _ => wanted.switch = 0.0,
                }
            }
            if self.random.once_in(60) {
                wanted = Shares::FULL;
                run.next_block();
                if self.random.once_in(2) {
                    run.set_single_block(false);
                    live.overrides.set_percent(Overridden::Feed, 100.0);
                    live.overrides.set_percent(Overridden::Rapid, 100.0);
                }
            }
            if stopping {
                run.give_up_sync();
            }
            let [feed, rapid] = live.overrides.of_time();
            let shares = if stopping {
                Shares::all(0.0)
            } else {
                Shares { feed, rapid, ..wanted }
            };
            if run.is_probing() {
                contact = contact || self.random.once_in(400);
                run.see_probe(contact, &sample.position);
            } else {
                contact = false;
            }
            let feedback = SpindleFeedback {
                turns: self.spindle.turns,
                indexed: true,
            };
            let before = sample.line;
            sample = run.step_shares(&shares, &feedback);
            self.spindle.step(&sample);
            if sample.line != before {
                let line = text.lines().nth(sample.line.saturating_sub(1) as usize).unwrap_or("");
                self.note(format!("line {} {line}", sample.line));
                let modes = text.lines().take(sample.line as usize);
                let modes = modes.filter(|line| line.starts_with("G94") || line.starts_with("G95"));
                let is_led = line.starts_with("G1") && modes.last().is_some_and(|line| line.starts_with("G95"));
                self.count(match line {
                    _ if line.starts_with("G38") => "probing",
                    _ if line.starts_with("G33.1") => "tap",
                    _ if line.starts_with("G33") => "thread",
                    _ if is_led => "led feed",
                    _ => "program",
                });
            }
            kinematics
                .inverse(&sample.frame, &sample.position.0, &mut self.joints)
                .expect("a place that the planner found good");
            let stops = run.is_scaling();
            assert!(
                !stops || ordered || stopping || run.is_probing(),
                "{}: a stop that nobody ordered, line {}",
                self.story[0],
                sample.line
            );
            self.see(stops);
            if let Some(action) = sample.on_the_way {
                self.spindle.act(action, &sample);
            }
            if let Some(action) = sample.action
                && !shares.hold(sample.enables)
                && self.spindle.act(action, &sample)
            {
                run.acknowledge_action();
            }
            let empty = fed && sample.state == SampleState::Starved && sample.action.is_none();
            if sample.state == SampleState::Finished
                || sample.fault.is_some()
                || (stopping && run.is_at_rest())
                || (empty && run.is_at_rest() && run.remaining_s() < 1e-9)
            {
                break;
            }
            assert!(
                cycle < 4 * CYCLES_MAX,
                "{}: no end of line {}",
                self.story[0],
                sample.line
            );
        }
        self.note("program ends");
    }

    fn jog_order(&mut self, axis: Option<bool>) -> JogOrder {
        let world = axis.unwrap_or(false);
        let joint = self.random.below(self.joints.len());
        let limits = self.config.joints[joint].limits;
        let motion = match self.random.below(8) {
            0 | 1 => JogMotion::Advance {
                distance_mm: self.random.within(-8.0, 8.0),
                velocity_mm_s: self.random.within(0.05, 1.2) * limits.velocity_mm_s,
            },
            2..=4 => JogMotion::Run {
                velocity_mm_s: self.random.within(-1.2, 1.2) * limits.velocity_mm_s,
            },
            5 => JogMotion::Release,
            _ => JogMotion::Keep,
        };
        if world {
            let (letter, ..) = self.place.room[self.random.below(self.place.room.len())];
            let axis = Axis::ALL.into_iter().find(|axis| axis.letter() == letter);
            JogOrder {
                acceleration_share: 1.0,
                unhomed: false,
                joints: (1 << self.joints.len()) - 1,
                axis,
                motion,
            }
        } else {
            JogOrder {
                acceleration_share: 1.0,
                unhomed: false,
                joints: 1 << joint,
                axis: None,
                motion,
            }
        }
    }

    /// Moves joints, or axes where they are not joints, by hand.
    fn jog(&mut self) {
        let world = !self.config.kinematics().is_trivial(&ToolFrame::OFF) && self.random.once_in(2);
        self.count(if world { "jog of axes" } else { "jog of joints" });
        self.note(format!("jog, axes: {world}"));
        let mut hand = JointJog::new(self.config);
        let left = self.joints.clone();
        let first = self.jog_order(Some(world));
        hand.begin(&self.joints, u64::MAX, &first);
        hand.obey(&first);
        let until = 100 + self.random.below(700);
        for cycle in 0.. {
            if cycle < until && self.random.once_in(40) {
                let order = self.jog_order(Some(world));
                self.note(format!("{order:?}"));
                hand.obey(&order);
            }
            if cycle == until {
                self.note("let go");
                if self.random.once_in(2) {
                    hand.stop();
                } else {
                    hand.release_all();
                }
            }
            hand.step(&mut self.joints);
            self.see(hand.is_stopping());
            if cycle > until && hand.is_at_rest() {
                break;
            }
            assert!(cycle < CYCLES_MAX, "{}: a jog without an end", self.story[0]);
        }
        if self.random.once_in(2) {
            self.go_back(&mut hand, &left);
        }
    }

    /// Back to where the hand took the machine from, held on the way now and then.
    fn go_back(&mut self, hand: &mut JointJog, left: &[f64]) {
        self.count("way back");
        self.note("way back");
        let kinematics = self.config.kinematics();
        let mut joints_mm = [0.0; JOINTS_MAX];
        joints_mm[..left.len()].copy_from_slice(left);
        let axes = kinematics.forward(&ToolFrame::OFF, left).expect("a place");
        let place = way_back::Place { joints_mm, axes };
        let mut way_back = WayBack::new(self.config);
        hand.begin_to_go(&self.joints);
        way_back.begin();
        let mut held = 0;
        for cycle in 0.. {
            if held == 0 && self.random.once_in(700) {
                self.note("held");
                held = 300;
                hand.release_all();
                way_back.interrupt();
            }
            if held > 0 {
                held -= 1;
            }
            let progress = match held {
                0 => way_back.step(&place, hand, [1.0, 1.0]),
                _ => way_back::Progress::Moving,
            };
            match progress {
                way_back::Progress::Moving => {}
                way_back::Progress::There => {
                    for (joint, left) in self.joints.iter_mut().zip(left) {
                        assert!((*joint - left).abs() < 1e-6, "{joint} {left}");
                        *joint = *left;
                    }
                    self.count("came back");
                    break;
                }
                way_back::Progress::Elsewhere => break,
            }
            hand.step(&mut self.joints);
            self.see(hand.is_stopping());
            assert!(cycle < 8 * CYCLES_MAX, "{}: a way back without an end", self.story[0]);
        }
        self.note("way back ends");
    }

    /// Homes an axis by a switch nearby, and ends where it was; or is stopped on the way.
    fn homing(&mut self) {
        let map = self.random.below(self.config.axes.len());
        let joints = self.config.axes[map].joints.clone();
        let begin = self.joints[joints[0]];
        if joints.iter().any(|&joint| (self.joints[joint] - begin).abs() > 1e-6) {
            return;
        }
        self.count("homing");
        let least = |value: fn(&config::Joint) -> f64| {
            let values = joints.iter().map(|&joint| value(&self.config.joints[joint]));
            values.fold(f64::INFINITY, f64::min)
        };
        let motion = MotionLimits {
            velocity: least(|joint| joint.limits.velocity_mm_s),
            acceleration: least(|joint| joint.limits.acceleration_mm_s2),
            jerk: least(|joint| joint.limits.jerk_mm_s3),
        };
        let stop = StopLimits {
            acceleration: least(|joint| joint.stop.acceleration_mm_s2),
            jerk: least(|joint| joint.stop.jerk_mm_s3),
        };
        let towards = self.random.pick(&[-1.0, 1.0]);
        let away = self.random.pick(&[2.0, -1.0, 9.0]);
        let way = HomingWay {
            sequence: 0,
            search: towards * self.random.within(0.1, 0.8) * motion.velocity,
            latch: 4.0,
            search_distance: 60.0,
            release_distance: 30.0,
            index_distance: None,
            resolution: 1e-2,
            bounce_s: 0.01,
            home: begin,
            skew: f64::INFINITY,
        };
        self.note(format!("homing of joints {joints:?}: {way:?}, switch {away} away"));
        let switches: Vec<f64> = (0..joints.len())
            .map(|k| begin + towards * (away + 0.3 * k as f64))
            .collect();
        let members: Vec<HomingJoint> = joints
            .iter()
            .zip(&switches)
            .map(|(&joint, &switch)| HomingJoint {
                joint,
                switch,
                motion,
                stop,
            })
            .collect();
        let mut homing = Homing::new(&[(way, &members)], CYCLE_S);
        let mask = joints.iter().fold(0, |mask, joint| mask | 1 << joint);
        homing.begin(mask, &self.joints);
        let abort = self.random.once_in(3).then(|| self.random.below(1500));
        let mut inputs = vec![HomingInput::default(); self.joints.len()];
        for cycle in 0.. {
            for (&joint, &switch) in joints.iter().zip(&switches) {
                inputs[joint].closed = towards * (self.joints[joint] - switch) >= 0.0;
                inputs[joint].measured = self.joints[joint];
            }
            if abort == Some(cycle) {
                self.note("homing stopped");
                homing.abort();
            }
            homing.step(&inputs, &mut self.joints);
            self.see(homing.is_stopping());
            if homing.status() != HomingStatus::Running && homing.is_at_rest() {
                break;
            }
            assert!(cycle < 4 * CYCLES_MAX, "{}: homing without an end", self.story[0]);
        }
        if joints.len() > 1 {
            // Sides that were left askew: by hand, one at a time, as nobody can in the control.
            let at = self.joints[joints[0]];
            if joints.iter().any(|&joint| (self.joints[joint] - at).abs() > 1e-6) {
                self.joints
                    .iter_mut()
                    .enumerate()
                    .filter(|(joint, _)| joints.contains(joint))
                    .for_each(|(_, q)| *q = at);
                self.judge.last = self.joints.iter().map(|&at| [at; 3]).collect();
            }
        }
    }

    fn live(&mut self, deeds: usize) {
        self.program();
        for _ in 0..deeds {
            match self.random.below(5) {
                0 | 1 => self.jog(),
                2 => self.homing(),
                _ => self.program(),
            }
        }
    }
}

fn machine(place: &Place, planner_kind: PlannerKind) -> Config {
    let parse = |text| config::parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let mut config = parse(place.machine);
    config.program.planner = planner_kind;
    // Machine coordinates everywhere, and an encoder on every spindle.
    config.work_offsets = [Position::ZERO; 9];
    let lathe = parse(include_str!("../configs/lathe2-demo.toml"));
    config.spindle.encoder = lathe.spindle.encoder;
    config.spindle.wait_for_speed = true;
    config.spindle.rpm_max = 3000.0;
    config
}

/// No limit is passed, and every generator has had its turn.
fn live_through(name: &str) {
    let seeds: u64 = std::env::var("ISOCNC_SEEDS")
        .ok()
        .and_then(|seeds| seeds.parse().ok())
        .unwrap_or(8);
    let place = PLACES
        .iter()
        .find(|place| place.name == name)
        .expect("a machine of this name");
    let classic = ["mill3", "gantry", "corexy"].contains(&name);
    let slopes = [PlannerKind::Optimal, PlannerKind::Classic];
    let mut ran: BTreeMap<&'static str, usize> = BTreeMap::new();
    for &planner_kind in &slopes[..1 + usize::from(classic)] {
        let config = machine(place, planner_kind);
        let mut used = [[0.0_f64; 3]; 2];
        for seed in 0..seeds {
            let mut machine = Machine::new(place, &config, seed);
            machine.live(8);
            for (what, count) in machine.ran {
                *ran.entry(what).or_default() += count;
            }
            for (used, of) in used.iter_mut().flatten().zip(machine.judge.used.iter().flatten()) {
                *used = used.max(*of);
            }
        }
        println!("{name} {planner_kind:?}: used of plans and stops {used:.3?}");
        // All of that did move, and fast.
        assert!(used[0][2] > 0.8, "{used:?}");
    }
    println!("{name}: {ran:?}");
    let trivial = machine(place, PlannerKind::Optimal)
        .kinematics()
        .is_trivial(&ToolFrame::OFF);
    let axes = (!trivial).then_some("jog of axes");
    let in_step: &[&str] = if place.in_step {
        &["thread", "tap", "led feed"]
    } else {
        &[]
    };
    let all = ["program", "probing", "jog of joints", "homing", "way back", "came back"];
    for what in all.iter().chain(in_step).copied().chain(axes) {
        assert!(ran.get(what).is_some_and(|count| *count >= 1), "{what}: {ran:?}");
    }
}

/// The spindle turns ten times a second: over one turn, its index comes in every cycle once, also in the one in which the move
/// before comes to rest.
#[test]
fn a_thread_begins_within_limits_whenever_its_index_comes() {
    let place = PLACES.iter().find(|place| place.name == "lathe2").expect("a lathe");
    let config = machine(place, PlannerKind::Optimal);
    let mut ran = 0;
    for ms in 0..100_u32 {
        let mut machine = Machine::new(place, &config, u64::from(ms));
        let wait_s = f64::from(ms) * 1e-3;
        let text = format!(
            "G21 G90 G18 G94 G54\nS600 M3\nG1 X50 Z-100 F6000\nG4 P{wait_s}\nG0 Z-120.4321\nG33 Z-140 K1.5\nM2\n"
        );
        machine.run(&text, true, false);
        ran += machine.ran.get("thread").copied().unwrap_or(0);
    }
    assert_eq!(ran, 100);
}

#[test]
fn seams_of_a_mill_keep_every_limit() {
    live_through("mill3");
}

#[test]
fn seams_of_a_gantry_keep_every_limit() {
    live_through("gantry");
}

#[test]
fn seams_of_a_corexy_keep_every_limit() {
    live_through("corexy");
}

#[test]
fn seams_of_a_delta_keep_every_limit() {
    live_through("delta");
}

#[test]
fn seams_of_a_scara_keep_every_limit() {
    live_through("scara");
}

#[test]
fn seams_of_a_swivelling_head_keep_every_limit() {
    live_through("head5");
}

#[test]
fn seams_of_a_trunnion_keep_every_limit() {
    live_through("trunnion5");
}

#[test]
fn seams_of_a_lathe_keep_every_limit() {
    live_through("lathe2");
}
