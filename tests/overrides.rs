//! Overrides, holds and the adapted feed on the whole path, on virtual time: what the operator turns, the machine follows soon
//! and within its limits; path and end stay what they are.
//!
//! Random scripts print their seed; more of them, and overrides that are turned to nothing in more of the cycles:
//! `ISOCNC_SEEDS=100 cargo test --test simulated overrides`.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::rt::overrides::Overridden::{self, Feed, Rapid, Spindle};
use isocnc::rt::shared::Command;
use isocnc::sim::NetConfig;
use motion::canon::{Axis, Position};
use motion::plan::{PlannerKind, deviation};
use std::path::Path;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const CYCLES_MAX: u64 = 200_000;
const CYCLE_S: f64 = 1e-3;
/// From the order to the first set-point that is another one because of it.
const REACTION_CYCLES: usize = 50;

fn machine(planner_kind: PlannerKind) -> Config {
    let mut config = config::parse(MACHINE, Path::new("mill3-demo.toml")).expect("a good machine file");
    config.program.planner = planner_kind;
    config
}

fn run_part<T>(config: &Config, text: &str, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    rehearse(config, text.as_bytes(), NetConfig::clean(1), |run| Ok(act(run))).expect("a good program")
}

fn turn(run: &Rehearsal<'_>, what: Overridden, percent: f64) {
    run.operator
        .shared()
        .overrides
        .order(what, percent)
        .expect("in its range");
}

/// Until the program has run this many cycles.
fn reach_cycle(run: &mut Rehearsal<'_>, cycles: usize) {
    let there = run.run_until(CYCLES_MAX, |run| {
        run.operator.live().elapsed_s >= (cycles as f64 - 0.5) * CYCLE_S
    });
    assert!(there.expect("a good program"), "{:#?}", run.operator.journal());
}

fn cycles(run: &mut Rehearsal<'_>, count: u64) {
    run.run_until(count, |_| false).expect("a good program");
}

fn commands(run: &Rehearsal<'_>) -> Vec<[f64; 3]> {
    let samples = run.operator.recorder.samples();
    samples.iter().map(|sample| sample.command).collect()
}

/// Speeds on the path in cycles on this line, mm/s.
fn speeds(run: &Rehearsal<'_>, line: u32) -> Vec<f64> {
    let samples = run.operator.recorder.samples();
    let steps = samples
        .windows(2)
        .filter(|pair| pair.iter().all(|sample| sample.line == line));
    let way = |pair: &[isocnc::plot::PathSample]| {
        let squares = (0..3).map(|axis| (pair[1].command[axis] - pair[0].command[axis]).powi(2));
        squares.sum::<f64>().sqrt() / CYCLE_S
    };
    steps.map(way).collect()
}

fn fastest(run: &Rehearsal<'_>, line: u32) -> f64 {
    speeds(run, line).into_iter().fold(0.0, f64::max)
}

/// To the end of everything; then what must hold whatever was ordered: no alarm, no limit passed as the monitor sees it and
/// as differences of set-points show it, on the path, at its end.
fn prove(run: &mut Rehearsal<'_>, config: &Config, end: [f64; 3]) {
    assert_eq!(
        run.run(CYCLES_MAX).expect("an end"),
        Outcome::Completed,
        "{:#?}",
        run.operator.journal()
    );
    assert_eq!(run.operator.alarms(), []);
    assert!(
        run.control.peaks().iter().all(|peaks| peaks.over == [0; 3]),
        "{:?}",
        run.control.peaks()
    );
    let commands = commands(run);
    for (joint, of) in config.joints.iter().enumerate() {
        let limits = [of.limits.velocity_mm_s, of.stop.acceleration_mm_s2, of.stop.jerk_mm_s3];
        for window in commands.windows(4) {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k: usize| window[k][joint]);
            let differences = [d - c, d - 2.0 * c + b, d - 3.0 * c + 3.0 * b - a];
            for (order, (difference, limit)) in (1..).zip(differences.into_iter().zip(limits)) {
                let value = (difference.abs() - 1e-11) / CYCLE_S.powi(order);
                assert!(
                    value <= limit * (1.0 + 1e-6),
                    "joint {joint}, order {order}: {value} above {limit}"
                );
            }
        }
    }
    let points: Vec<Position> = commands.iter().map(|&[x, y, z]| Position::xyz(x, y, z)).collect();
    let tolerance_mm = 0.05;
    let found = deviation(&points, run.path(), tolerance_mm);
    assert!(found.off_mm <= tolerance_mm + 1e-9, "{found:?}");
    let last = commands.last().expect("a program ran");
    let off = (0..3).map(|axis| (last[axis] - end[axis]).abs()).fold(0.0, f64::max);
    assert!(off < 1e-9, "ends at {last:?}, not {end:?}");
}

const LINE: &str = "G21 G90 G94 G53 G0 Z0\nG53 G0 X0 Y0\nG53 G1 X250 Y100 F4000\nM2\n";

/// Set-points of a run in which something is done after so many cycles of the program.
fn commands_with(config: &Config, text: &str, at: usize, act: impl FnOnce(&mut Rehearsal<'_>)) -> Vec<[f64; 3]> {
    run_part(config, text, |run| {
        reach_cycle(run, at);
        act(run);
        cycles(run, 400);
        commands(run)
    })
}

/// Cycles from an order at a cycle of the program to the first set-point that is another one.
fn reaction(config: &Config, text: &str, at: usize, act: impl FnOnce(&mut Rehearsal<'_>)) -> usize {
    let without = commands_with(config, text, at, |_| {});
    let with = commands_with(config, text, at, act);
    let differs = |(a, b): (&[f64; 3], &[f64; 3])| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1e-9);
    let first = without.iter().zip(&with).position(differs).expect("a difference");
    first - at
}

#[test]
fn the_machine_follows_a_turned_override_soon_though_all_is_planned() {
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let config = machine(planner_kind);
        for at in [600, 1300] {
            for (what, percent) in [(Feed, 50.0), (Feed, 90.0), (Feed, 0.0)] {
                let cycles = reaction(&config, LINE, at, |run| turn(run, what, percent));
                println!(
                    "{planner_kind:?}, {} to {percent} % after {at} cycles: {cycles} cycles",
                    what.name()
                );
                assert!(
                    cycles <= REACTION_CYCLES,
                    "{planner_kind:?} {at} {what:?} {percent}: {cycles}"
                );
            }
        }
    }
}

#[test]
fn feed_and_rapid_moves_run_at_their_percentage() {
    let text = "G21 G90 G94\nG53 G0 Z0\nG53 G0 X0 Y0\nG53 G1 X60 F3000\nG53 G0 X160\nG53 G1 Y60\nM2\n";
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let config = machine(planner_kind);
        run_part(&config, text, |run| {
            turn(run, Feed, 40.0);
            turn(run, Rapid, 50.0);
            reach_cycle(run, 10);
            prove(run, &config, [160.0, 60.0, 0.0]);
            for (line, speed) in [(4, 20.0), (5, 75.0), (6, 20.0)] {
                let got = fastest(run, line);
                assert!(
                    (got / speed - 1.0).abs() < 0.003,
                    "{planner_kind:?} line {line}: {got}, not {speed} mm/s"
                );
            }
        });
    }
    // Above 100 %: by the planner that can.
    let config = machine(PlannerKind::Optimal);
    run_part(&config, text, |run| {
        turn(run, Feed, 120.0);
        prove(run, &config, [160.0, 60.0, 0.0]);
        assert!((fastest(run, 4) / 60.0 - 1.0).abs() < 0.003);
    });
    run_part(&machine(PlannerKind::Classic), "M2\n", |run| {
        let refused = run.operator.shared().overrides.order(Feed, 120.0).unwrap_err();
        assert!(
            refused.contains("without effect with planner = \"classic\""),
            "{refused}"
        );
    });
}

#[test]
fn with_no_feed_rapid_moves_run_up_to_the_next_feed_move_and_it_waits() {
    let text = "G21 G90 G94\nG53 G0 Z0\nG53 G0 X50 Y50\nG53 G1 X90 F3000\nG53 G0 Z-5\nM2\n";
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let config = machine(planner_kind);
        run_part(&config, text, |run| {
            turn(run, Feed, 0.0);
            reach_cycle(run, 3000);
            let live = run.operator.live();
            assert_eq!((live.state, live.velocity_mm_s), (State::Running, 0.0));
            assert_eq!(
                (live.position[Axis::X], live.position[Axis::Y]),
                (50.0, 50.0),
                "{planner_kind:?}"
            );
            turn(run, Feed, 100.0);
            turn(run, Rapid, 0.0);
            cycles(run, 3000);
            let live = run.operator.live();
            assert_eq!(
                (live.position[Axis::X], live.position[Axis::Z]),
                (90.0, 0.0),
                "{planner_kind:?}"
            );
            turn(run, Rapid, 30.0);
            prove(run, &config, [90.0, 50.0, -5.0]);
        });
    }
}

/// Down to the work, along it, up and away, with all corners rounded; the corners between rapid moves and those at feed.
const SEAMS: &str = "G21 G90 G94 G64 P0.05 F3000\nG53 G0 X0 Y0 Z0\nG53 G0 X50 Y50\nG53 G1 Z-20\nG53 G1 X90\nG53 G0 Z0\nG53 G0 Y90\nG53 G1 X60\nM2\n";
const SEAM_CORNERS: [[f64; 3]; 3] = [[50.0, 50.0, 0.0], [90.0, 50.0, -20.0], [90.0, 90.0, 0.0]];
const SEAM_END: [f64; 3] = [60.0, 90.0, 0.0];

#[test]
fn rapid_and_feed_moves_meet_on_the_move_at_any_override() {
    let config = machine(PlannerKind::Optimal);
    for (feed, rapid) in [
        (100.0, 100.0),
        (50.0, 100.0),
        (100.0, 50.0),
        (120.0, 10.0),
        (10.0, 100.0),
    ] {
        run_part(&config, SEAMS, |run| {
            turn(run, Feed, feed);
            turn(run, Rapid, rapid);
            prove(run, &config, SEAM_END);
            for (line, limit) in [(4, feed / 2.0), (5, feed / 2.0), (6, 1.5 * rapid), (8, feed / 2.0)] {
                let got = fastest(run, line);
                assert!(
                    got <= limit * (1.0 + 1e-6),
                    "feed {feed} %, rapid {rapid} %, line {line}: {got}"
                );
            }
            let commands = commands(run);
            for corner in SEAM_CORNERS {
                let off = |at: &[f64; 3]| (0..3).map(|axis| (at[axis] - corner[axis]).powi(2)).sum::<f64>().sqrt();
                let near: Vec<_> = commands.windows(2).filter(|pair| off(&pair[0]) < 1.0).collect();
                let slowest = near.iter().map(|pair| {
                    (0..3)
                        .map(|axis| (pair[1][axis] - pair[0][axis]).powi(2))
                        .sum::<f64>()
                        .sqrt()
                });
                let slowest_mm_s = slowest.fold(f64::INFINITY, f64::min) / CYCLE_S;
                assert!(
                    slowest_mm_s > 0.5,
                    "feed {feed} %, rapid {rapid} %, {corner:?}: {slowest_mm_s} mm/s"
                );
            }
        });
    }
}

/// Whatever is turned to nothing when: the machine comes to rest, at the corner itself where there was time to plan it, and at no
/// corner that belongs to what goes on; then it runs to the end.
#[test]
fn an_override_of_nothing_holds_at_the_corner_between_a_rapid_move_and_one_at_feed() {
    /// Cycles between the order and the corner in which a rest there can always be planned.
    const PLANNED_CYCLES: usize = 450;
    let config = machine(PlannerKind::Optimal);
    let (lines, total) = run_part(&config, SEAMS, |run| {
        prove(run, &config, SEAM_END);
        let samples = run.operator.recorder.samples();
        let first = |line| samples.iter().position(|sample| sample.line >= line).expect("a line");
        ([4, 6, 8].map(first), samples.len())
    });
    let mut exact = 0;
    let step = if std::env::var_os("ISOCNC_SEEDS").is_some() {
        41
    } else {
        123
    };
    for (what, corners) in [(Feed, [0, 2]), (Rapid, [1, 1])] {
        for at in (5..total - 5).step_by(step) {
            run_part(&config, SEAMS, |run| {
                reach_cycle(run, at);
                turn(run, what, 0.0);
                cycles(run, 2500);
                let live = run.operator.live();
                assert_eq!(live.velocity_mm_s, 0.0, "{what:?} at {at}");
                let next = corners
                    .into_iter()
                    .find(|corner| at < lines[*corner])
                    .filter(|corner| at + PLANNED_CYCLES < lines[*corner]);
                let is_held = |line: u32| match what {
                    Feed => matches!(line, 4 | 5 | 8),
                    Rapid | Spindle => matches!(line, 0..=3 | 6 | 7),
                };
                let under_way = run.operator.recorder.samples()[at].line;
                if let Some(corner) = next
                    && !is_held(under_way)
                {
                    let position = [Axis::X, Axis::Y, Axis::Z].map(|axis| live.position[axis]);
                    assert_eq!(position, SEAM_CORNERS[corner], "{what:?} at {at}");
                    exact += 1;
                }
                turn(run, what, 100.0);
                prove(run, &config, SEAM_END);
            });
        }
    }
    assert!(exact > 5, "{exact}");
}

/// The same turned back before the machine is there, and a hold on top.
#[test]
fn an_override_turned_to_nothing_and_back_leaves_the_corner_rounded() {
    let config = machine(PlannerKind::Optimal);
    let undisturbed = run_part(&config, SEAMS, |run| {
        prove(run, &config, SEAM_END);
        commands(run)
    });
    for (what, at, after) in [(Feed, 20, 40), (Feed, 60, 5), (Rapid, 900, 10), (Feed, 200, 30)] {
        run_part(&config, SEAMS, |run| {
            reach_cycle(run, at);
            turn(run, what, 0.0);
            cycles(run, after);
            run.operator.give(Command::Hold);
            cycles(run, after);
            turn(run, what, 100.0);
            cycles(run, 300);
            run.operator.give(Command::Resume);
            prove(run, &config, SEAM_END);
            let commands = commands(run);
            for corner in SEAM_CORNERS {
                let nearest = |of: &[[f64; 3]]| {
                    let squares = of
                        .iter()
                        .map(|at| (0..3).map(|axis| (at[axis] - corner[axis]).powi(2)).sum::<f64>());
                    squares.fold(f64::INFINITY, f64::min).sqrt()
                };
                let [before, now] = [nearest(&undisturbed), nearest(&commands)];
                assert!(
                    now > 0.5 * before && before > 0.005,
                    "{what:?} at {at}, {corner:?}: {now}, {before}"
                );
            }
        });
    }
}

#[test]
fn where_the_program_switches_overrides_off_it_runs_as_programmed() {
    // Lines 4 and 7 follow the override, 5 and 6 do not.
    let text = "G21 G90 G94 G64 P0.01\nG53 G0 Z0\nG53 G0 X0 Y0\nG53 G1 X60 F3000\nM49 G53 G1 X120\nG53 G1 Y60\nM48 G53 G1 X60\nM2\n";
    for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        for (at, percent) in [(10, 30.0), (1500, 30.0), (2500, 0.0)] {
            let config = machine(planner_kind);
            run_part(&config, text, |run| {
                reach_cycle(run, at);
                turn(run, Feed, percent);
                let off = run.run_until(CYCLES_MAX, |run| !run.operator.live().enables.feed_override);
                if percent > 0.0 {
                    assert!(off.expect("a good program"));
                } else {
                    turn(run, Feed, 100.0);
                }
                prove(run, &config, [60.0, 60.0, 0.0]);
                for line in [5, 6] {
                    let got = fastest(run, line);
                    assert!(
                        (got / 50.0 - 1.0).abs() < 0.001,
                        "{planner_kind:?} {at} line {line}: {got}"
                    );
                }
                if percent > 0.0 {
                    // Its beginning is run down from full speed.
                    let slowed = speeds(run, 7);
                    let middle = slowed[slowed.len() / 2];
                    assert!((middle / 15.0 - 1.0).abs() < 0.003, "{planner_kind:?} {at}: {middle}");
                }
            });
        }
    }
}

#[test]
fn the_machine_adapts_the_feed_and_the_switch_holds_only_where_the_program_wants_it() {
    let text = "G21 G90 G94\nG53 G0 Z0\nG53 G0 X0 Y0\nG53 G1 X60 F3000\nM52 P1 G53 G1 X120\nM52 P0\nM53 P0 G53 G1 Y60\nM53 P1 G53 G1 X60\nM2\n";
    let config = machine(PlannerKind::Optimal);
    run_part(&config, text, |run| {
        run.hal.set("motion.adaptive-feed", 0.5).expect("a pin");
        let line = |run: &mut Rehearsal<'_>, line: u32| {
            assert!(
                run.run_until(CYCLES_MAX, |run| run.operator.live().line == line)
                    .expect("a good program")
            );
        };
        line(run, 7);
        cycles(run, 100);
        // Of no effect here; at the next line, which wants it, the machine waits.
        run.hal.set("motion.feed-hold", true).expect("a pin");
        assert!(!run.operator.live().enables.feed_hold);
        line(run, 8);
        cycles(run, 2000);
        assert_eq!((run.operator.live().line, run.operator.live().velocity_mm_s), (8, 0.0));
        run.hal.set("motion.feed-hold", false).expect("a pin");
        prove(run, &config, [60.0, 60.0, 0.0]);
        for (line, speed) in [(4, 50.0), (5, 25.0), (7, 50.0), (8, 50.0)] {
            let got = if line == 5 {
                let speeds = speeds(run, 5);
                speeds[speeds.len() / 2]
            } else {
                fastest(run, line)
            };
            assert!(
                (got / speed - 1.0).abs() < 0.003,
                "line {line}: {got}, not {speed} mm/s"
            );
        }
    });
}

#[test]
fn the_spindle_follows_its_override_where_the_program_lets_it() {
    let text = "G21 G90 G94 S1000 M3\nG53 G1 X5 F300\nM51 P0\nG53 G1 X10\nM51 P1\nG53 G1 X15\nM2\n";
    run_part(&machine(PlannerKind::Optimal), text, |run| {
        let speed = run.hal.reader::<f64>("spindle.0.speed-out").expect("a pin");
        turn(run, Spindle, 80.0);
        for (line, rpm) in [(2, 800.0), (4, 1000.0), (6, 800.0)] {
            assert!(
                run.run_until(CYCLES_MAX, |run| run.operator.live().line == line)
                    .expect("a good program")
            );
            cycles(run, 20);
            assert_eq!(speed.get(), rpm, "line {line}");
        }
        turn(run, Spindle, 120.0);
        cycles(run, 2);
        assert_eq!(speed.get(), 1200.0);
    });
}

#[test]
fn pins_turn_overrides_and_show_them() {
    run_part(&machine(PlannerKind::Optimal), LINE, |run| {
        let value = run.hal.reader::<f64>("halui.feed-override.value").expect("a pin");
        reach_cycle(run, 10);
        assert_eq!(value.get(), 1.0);
        run.hal.set("halui.feed-override.scale", 0.05).expect("a pin");
        run.hal.set("halui.feed-override.counts", -4).expect("a pin");
        cycles(run, 2);
        assert!((value.get() - 0.8).abs() < 1e-12, "a hand wheel: {}", value.get());
        run.hal.set("halui.feed-override.increase", true).expect("a pin");
        cycles(run, 3);
        assert!(
            (value.get() - 0.85).abs() < 1e-12,
            "once for each edge: {}",
            value.get()
        );
        run.hal.set("halui.feed-override.direct-value", true).expect("a pin");
        run.hal.set("halui.feed-override.counts", 9).expect("a pin");
        cycles(run, 2);
        assert!((value.get() - 0.45).abs() < 1e-12, "a potentiometer: {}", value.get());
        turn(run, Feed, 70.0);
        cycles(run, 2);
        assert!(
            (value.get() - 0.7).abs() < 1e-12,
            "an order, until it is turned again: {}",
            value.get()
        );
        run.hal.set("halui.feed-override.counts", 90).expect("a pin");
        cycles(run, 2);
        assert!((value.get() - 1.2).abs() < 1e-12, "as far as it goes: {}", value.get());
        cycles(run, 30);
        let journal = run.operator.journal();
        assert!(
            journal.iter().any(|entry| entry.text == "feed override 120 %"),
            "{journal:#?}"
        );
    });
}

/// Everything that can be turned, held and adapted, at random moments.
fn script(seed: u64, planner_kind: PlannerKind) {
    println!("seed {seed}, {planner_kind:?}");
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = move |below: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) % below
    };
    let mut text = String::from("G21 G90 G94 G64 P0.05\nG53 G0 Z0\nG53 G0 X100 Y100\nF4500\n");
    let mut at = [100.0, 100.0];
    for _ in 0..40 {
        let switch = [
            "", "", "M49 ", "M48 ", "M50 P0 ", "M52 P1 ", "M52 P0 ", "M53 P0 ", "M53 P1 ",
        ][random(9) as usize];
        at = [60.0 + random(80) as f64, 60.0 + random(80) as f64];
        text += &match random(5) {
            0 => format!("{switch}G53 G0 X{} Y{}\n", at[0], at[1]),
            1 => format!("{switch}G53 G1 X{} Y{}\nG4 P0.05\n", at[0], at[1]),
            _ => format!("{switch}G53 G1 X{} Y{} Z-{}\n", at[0], at[1], random(9)),
        };
    }
    text += "M48\nM53 P1\nG53 G1 Z0\nM2\n";
    let config = machine(planner_kind);
    run_part(&config, &text, |run| {
        reach_cycle(run, 1);
        for _ in 0..60 {
            cycles(run, 1 + random(250));
            match random(9) {
                0 => run.operator.give(Command::Hold),
                1 | 2 => run.operator.give(Command::Resume),
                3 => turn(run, Rapid, random(101) as f64),
                4 => turn(run, Feed, 0.0),
                5 | 6 => turn(
                    run,
                    Feed,
                    random(if planner_kind == PlannerKind::Optimal { 121 } else { 101 }) as f64,
                ),
                7 => run
                    .hal
                    .set("motion.adaptive-feed", random(101) as f64 / 100.0)
                    .expect("a pin"),
                _ => run.hal.set("motion.feed-hold", random(3) == 0).expect("a pin"),
            }
        }
        run.hal.set("motion.feed-hold", false).expect("a pin");
        run.hal.set("motion.adaptive-feed", 1.0).expect("a pin");
        turn(run, Feed, 100.0);
        turn(run, Rapid, 100.0);
        cycles(run, 300);
        run.operator.give(Command::Resume);
        prove(run, &config, [at[0], at[1], 0.0]);
    });
}

#[test]
fn any_script_of_orders_keeps_limits_path_and_end() {
    let seeds = std::env::var("ISOCNC_SEEDS").ok().and_then(|count| count.parse().ok());
    for seed in 1..=seeds.unwrap_or(3) {
        for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
            script(seed, planner_kind);
        }
    }
}
