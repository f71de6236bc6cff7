//! A program run back along its path and block by block, on virtual time: program text to simulated drives.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::rt::joint_jog::{JogMotion, JogOrder};
use isocnc::rt::overrides::Overridden;
use isocnc::rt::shared::Command;
use isocnc::sim::{Disturbance, NetConfig};
use std::path::Path;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const PART: &str = include_str!("../configs/short-part.ngc");
/// Where [`PART`] ends, machine coordinates: work X21 Y16 Z20 plus G54.
const PART_END: [f64; 3] = [41.0, 36.0, -40.0];
/// A line of [`PART`] in the second contour.
const MIDST: u32 = 24;
/// The first line behind the last thing that is done at rest before that, which is to wait for the spindle, and where it begins.
const FIRST: (u32, [f64; 3]) = (13, [24.0, 36.0, -58.0]);
/// Work zero in machine coordinates.
const ZERO: [f64; 3] = [20.0, 20.0, -60.0];
/// Corners may be rounded by this, mm.
const TOLERANCE_MM: f64 = 0.01;
/// Arrows of the chords of a millisecond: at 60 mm/s on a radius of 4 mm (0.06 mm)²/(8 * 4 mm).
const ARROW_MM: f64 = 2e-4;
const CYCLES_MAX: u64 = 120_000;
const CYCLE_S: f64 = 1e-3;

fn machine() -> Config {
    let mut config = config::parse(MACHINE, Path::new("mill3-demo.toml")).expect("a good machine file");
    config.bus.pres_lost_max = 3;
    config
}

fn rehearse_part<T>(seed: u64, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    println!("seed {seed}");
    rehearse(&machine(), PART.as_bytes(), NetConfig::clean(seed), |run| Ok(act(run))).expect("a rehearsal")
}

fn reach(run: &mut Rehearsal<'_>, what: &str, done: impl FnMut(&mut Rehearsal<'_>) -> bool) {
    let reached = run.run_until(CYCLES_MAX, done).expect("a good program");
    assert!(reached, "never {what}: {:#?}", run.operator.journal());
}

fn reach_state(run: &mut Rehearsal<'_>, state: State) {
    reach(run, state.name(), |run| run.control.state() == state);
}

fn reach_midst(run: &mut Rehearsal<'_>) {
    reach(run, "in the midst", |run| run.operator.live().line >= MIDST);
}

fn commands(run: &Rehearsal<'_>) -> Vec<[f64; 3]> {
    let samples = run.operator.recorder.samples();
    samples.iter().map(|sample| sample.command).collect()
}

/// Commands of a run without any orders.
fn straight_on() -> Vec<[f64; 3]> {
    rehearse_part(1, |run| {
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        commands(run)
    })
}

fn distance_to_chord(at: &[f64; 3], from: &[f64; 3], to: &[f64; 3]) -> f64 {
    let axes = [0, 1, 2];
    let along = axes.map(|axis| to[axis] - from[axis]);
    let length2: f64 = along.iter().map(|by| by * by).sum();
    let dot: f64 = axes.iter().map(|&axis| (at[axis] - from[axis]) * along[axis]).sum();
    let share = if length2 > 0.0 {
        (dot / length2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let off = axes.map(|axis| from[axis] + share * along[axis] - at[axis]);
    off.iter().map(|by| by * by).sum::<f64>().sqrt()
}

/// All commands lie on the path of a run without orders, or no further from it than this.
fn assert_on_path(commands: &[[f64; 3]], path: &[[f64; 3]], within_mm: f64) {
    for at in commands {
        let near = path.windows(2).map(|chord| distance_to_chord(at, &chord[0], &chord[1]));
        let off_mm = near.fold(f64::INFINITY, f64::min);
        assert!(off_mm < within_mm, "{off_mm} mm off the path at {at:?}");
    }
}

fn assert_within_stop_limits(run: &Rehearsal<'_>) {
    let commands = commands(run);
    let last = *commands.last().expect("a program ran");
    let standing: Vec<[f64; 3]> = commands.into_iter().chain([last; 3]).collect();
    for (joint, limits) in machine().joints.iter().enumerate() {
        for window in standing.windows(4) {
            let [a, b, c, d] = [0, 1, 2, 3].map(|index: usize| window[index][joint]);
            let acceleration = (d - 2.0 * c + b) / CYCLE_S.powi(2);
            let jerk = (d - 3.0 * c + 3.0 * b - a) / CYCLE_S.powi(3);
            assert!(
                acceleration.abs() <= limits.stop.acceleration_mm_s2 * (1.0 + 1e-6),
                "{acceleration}"
            );
            assert!(jerk.abs() <= limits.stop.jerk_mm_s3 * (1.0 + 1e-6) + 1e-2, "{jerk}");
        }
    }
    for peaks in run.control.peaks() {
        assert_eq!(peaks.over, [0; 3], "{peaks:?}");
    }
}

fn assert_part_ends(run: &Rehearsal<'_>) {
    let last = *commands(run).last().expect("a program ran");
    for (at_mm, end_mm) in last.into_iter().zip(PART_END) {
        assert!((at_mm - end_mm).abs() < 1e-9, "{last:?}");
    }
}

#[test]
fn a_part_is_run_back_to_the_last_action_and_cut_to_its_end() {
    let path = straight_on();
    rehearse_part(2, |run| {
        reach_midst(run);
        run.operator.give(Command::Hold);
        reach_state(run, State::Held);
        let turned = commands(run).len();
        assert!(!run.operator.live().reversing);
        run.operator.give(Command::Reverse(1.0));
        reach_state(run, State::Running);
        reach(run, "on its way back", |run| run.operator.live().line < MIDST - 3);
        let live = run.operator.live();
        assert!(live.reversing && live.velocity_mm_s > 0.0 && live.remaining_s > 0.0);
        // Held on the way, and further at a quarter of the speed.
        run.operator.give(Command::Hold);
        reach_state(run, State::Held);
        run.operator.give(Command::Reverse(0.25));
        reach_state(run, State::Running);
        // By itself it rests where there is no way back.
        reach_state(run, State::Held);
        let live = run.operator.live();
        let (line, began) = FIRST;
        assert!(
            live.reversing && live.line == line && live.velocity_mm_s == 0.0,
            "{live:?}"
        );
        for (at, began) in live.position.0.iter().zip(began) {
            assert!((at - began).abs() < 1e-9, "{live:?}");
        }
        assert!(commands(run).len() > turned + 1000);
        run.operator.give(Command::Resume);
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert_part_ends(run);
        assert_within_stop_limits(run);
        assert_on_path(&commands(run), &path, ARROW_MM);
        assert!(!run.operator.live().reversing);
    });
}

#[test]
fn it_turns_at_once_and_a_stop_or_a_fault_on_the_way_back_rests_on_the_path() {
    let path = straight_on();
    for fault in [false, true] {
        rehearse_part(3, |run| {
            reach_midst(run);
            run.operator.give(Command::Reverse(1.0));
            reach(run, "on its way back", |run| {
                let live = run.operator.live();
                live.line < MIDST && live.velocity_mm_s > 5.0
            });
            assert_eq!(run.control.state(), State::Running);
            if fault {
                let now_ns = run.now_ns();
                let error_code = 0x2310;
                run.net().at(now_ns, Disturbance::DriveFault { node: 1, error_code });
            } else {
                run.operator.give(Command::Stop);
            }
            reach_state(run, State::Stopping);
            let end = run.run(CYCLES_MAX).expect("an end");
            assert_eq!(end, if fault { Outcome::Faulted } else { Outcome::Stopped });
            assert_within_stop_limits(run);
            assert_on_path(&commands(run), &path, ARROW_MM);
            assert!(!run.operator.live().reversing, "nothing runs any more");
        });
    }
}

#[test]
fn block_by_block_the_part_is_the_same() {
    let path = straight_on();
    rehearse_part(4, |run| {
        run.operator.give(Command::SingleBlock(true));
        reach_state(run, State::Running);
        let (mut lines, mut corner) = (Vec::new(), None);
        loop {
            reach(run, "held or over", |run| {
                matches!(run.control.state(), State::Held | State::Ready)
            });
            if run.control.state() == State::Ready {
                break;
            }
            assert_eq!(run.operator.live().velocity_mm_s, 0.0);
            assert!(run.operator.live().single_block);
            let live = run.operator.live();
            lines.push(live.line);
            // N80 G1 Y24
            if live.line == 14 {
                corner = Some(live.position.0);
            }
            run.operator.give(Command::Resume);
            reach_state(run, State::Running);
        }
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert!(lines.is_sorted(), "{lines:?}");
        lines.dedup();
        // Every block that moves or does anything, but for the last one.
        let blocks: Vec<u32> = (6..=46)
            .filter(|line| ![9, 10, 23, 35, 36, 44].contains(line))
            .collect();
        assert_eq!(lines, blocks);
        let corner = corner.expect("a stop there");
        for (axis, work) in [4.0, 24.0, -1.0].into_iter().enumerate() {
            assert!((corner[axis] - (ZERO[axis] + work)).abs() < 1e-9, "{corner:?}");
        }
        assert_part_ends(run);
        assert_within_stop_limits(run);
        // Corners that were rounded are run to their ends now.
        assert_on_path(&commands(run), &path, TOLERANCE_MM + ARROW_MM);
    });
}

#[test]
fn on_the_way_back_it_rests_block_by_block_too() {
    let path = straight_on();
    rehearse_part(5, |run| {
        reach_midst(run);
        run.operator.give(Command::Hold);
        reach_state(run, State::Held);
        run.operator.give(Command::SingleBlock(true));
        let mut lines = Vec::new();
        while run.operator.live().line > FIRST.0 {
            run.operator.give(Command::Reverse(1.0));
            reach_state(run, State::Running);
            reach_state(run, State::Held);
            let live = run.operator.live();
            assert!(live.reversing && live.velocity_mm_s == 0.0, "{live:?}");
            lines.push(live.line);
        }
        // One after the other, none of them left out that moves: to the line behind the last thing that was done at rest.
        let moves: Vec<u32> = (FIRST.0..=MIDST).rev().filter(|line| ![23].contains(line)).collect();
        assert_eq!(lines, moves);
        // Block by block forward again, and then to its end.
        for line in [FIRST.0, FIRST.0 + 1] {
            run.operator.give(Command::Resume);
            reach_state(run, State::Running);
            reach_state(run, State::Held);
            assert_eq!(run.operator.live().line, line);
        }
        run.operator.give(Command::SingleBlock(false));
        run.operator.give(Command::Resume);
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert_part_ends(run);
        assert_within_stop_limits(run);
        assert_on_path(&commands(run), &path, TOLERANCE_MM + ARROW_MM);
    });
}

#[test]
fn an_override_that_is_turned_on_the_way_back_leaves_path_and_limits_alone() {
    let path = straight_on();
    for (seed, percents) in [(6, [50.0, 110.0]), (7, [120.0, 20.0]), (8, [0.0, 70.0])] {
        rehearse_part(seed, |run| {
            let turn = |run: &mut Rehearsal<'_>, percent: f64| {
                let overrides = &run.operator.shared().overrides;
                overrides.order(Overridden::Feed, percent).expect("within its range");
            };
            let wait = |run: &mut Rehearsal<'_>, cycles: u64| {
                let mut left = cycles;
                reach(run, "some cycles later", |_| {
                    left -= 1;
                    left == 0
                });
            };
            reach_midst(run);
            run.operator.give(Command::Reverse(1.0));
            for percent in percents {
                wait(run, 250);
                turn(run, percent);
            }
            wait(run, 250);
            assert!(run.operator.live().reversing);
            run.operator.give(Command::Resume);
            wait(run, 400);
            turn(run, 100.0);
            assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
            assert_part_ends(run);
            assert_within_stop_limits(run);
            assert_on_path(&commands(run), &path, ARROW_MM);
        });
    }
}

fn jog_by(run: &mut Rehearsal<'_>, joint: u32, distance_mm: f64) {
    let motion = JogMotion::Advance {
        distance_mm,
        velocity_mm_s: 50.0,
    };
    run.operator.give(Command::Jog(JogOrder {
        acceleration_share: 1.0,
        unhomed: false,
        joints: 1 << joint,
        axis: None,
        motion,
    }));
}

/// The hand stays on the key until nothing moves any more.
fn rest_away(run: &mut Rehearsal<'_>) {
    for _ in 0..20 {
        run.operator.give(Command::Jog(JogOrder {
            acceleration_share: 1.0,
            unhomed: false,
            joints: u64::MAX,
            axis: None,
            motion: JogMotion::Keep,
        }));
        let _ = run.run_until(100, |_| false).expect("no fault");
    }
    let mut before = None;
    reach(run, "at rest away from the path", |run| {
        let live = run.operator.live();
        let rests = before == Some(live.position) && run.operator.is_up_to_date();
        before = Some(live.position);
        live.state == State::Away && rests
    });
}

fn place(run: &Rehearsal<'_>) -> [f64; 3] {
    let position = run.operator.live().position;
    [position.0[0], position.0[1], position.0[2]]
}

/// Set-points of a part that is held in the midst, and whatever is done to it there.
fn held_part(seed: u64, meanwhile: impl FnOnce(&mut Rehearsal<'_>, [f64; 3])) -> Vec<[f64; 3]> {
    rehearse_part(seed, |run| {
        reach_midst(run);
        run.operator.give(Command::Hold);
        reach_state(run, State::Held);
        let held = place(run);
        meanwhile(run, held);
        assert_eq!((run.control.state(), place(run)), (State::Held, held));
        run.operator.give(Command::Resume);
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert_within_stop_limits(run);
        let mut commands = commands(run);
        commands.dedup();
        commands
    })
}

/// Places on the way back, cycle by cycle.
fn way_back(run: &mut Rehearsal<'_>) -> Vec<[f64; 3]> {
    let mut way = Vec::new();
    run.operator.give(Command::Resume);
    reach(run, "back", |run| {
        way.push(place(run));
        run.control.state() == State::Held
    });
    way
}

#[test]
fn a_part_that_was_left_by_hand_comes_out_as_the_one_that_was_not() {
    let undisturbed = held_part(7, |_, _| {});
    let left = held_part(7, |run, held| {
        assert_eq!(run.operator.live().waiting, None);
        jog_by(run, 2, 30.0);
        rest_away(run);
        jog_by(run, 0, -7.5);
        jog_by(run, 1, 5.0);
        rest_away(run);
        let away = place(run);
        assert!((away[2] - held[2] - 30.0).abs() < 1e-9 && (away[0] - held[0] + 7.5).abs() < 1e-9);
        assert!(
            run.operator
                .live()
                .waiting
                .is_some_and(|waiting| waiting.release().text.contains("resume"))
        );
        assert!(run.operator.live().line >= MIDST);
        let way = way_back(run);
        // Beside first, then down, the last of it slowly.
        for pair in way.windows(2) {
            let [before, after] = [pair[0], pair[1]];
            let is_beside = (before[0] - held[0]).hypot(before[1] - held[1]) < 1e-9;
            assert!(is_beside || after[2] == away[2], "{after:?}");
            if before[2] < held[2] + 4.9 {
                assert!(
                    before[2] - after[2] <= 100.0 / 60.0 * CYCLE_S + 1e-9,
                    "{before:?} {after:?}"
                );
            }
        }
    });
    assert!(undisturbed.len() > 1000);
    assert_eq!(left, undisturbed);
}

#[test]
fn from_below_the_way_back_goes_up_first_and_a_hold_or_a_hand_may_break_it() {
    let undisturbed = held_part(8, |_, _| {});
    let left = held_part(8, |run, held| {
        jog_by(run, 0, 12.0);
        rest_away(run);
        jog_by(run, 2, -3.0);
        rest_away(run);
        let below = place(run);
        // What only programs can be asked is without effect here.
        for command in [Command::Reverse(1.0), Command::Hold, Command::ToolChanged] {
            run.operator.give(command);
        }
        rest_away(run);
        assert_eq!(place(run), below);
        run.operator.give(Command::Resume);
        reach(run, "on the way up", |run| place(run)[2] > below[2] + 1.0);
        assert_eq!((run.control.state(), place(run)[0]), (State::Returning, below[0]));
        run.operator.give(Command::Hold);
        rest_away(run);
        let broken = place(run);
        assert!(broken[2] < held[2] && broken[0] == below[0], "{broken:?}");
        jog_by(run, 1, 4.0);
        rest_away(run);
        let way = way_back(run);
        for at in &way {
            let is_beside = (at[0] - broken[0]).abs() < 1e-9;
            assert!(is_beside || (at[2] - held[2]).abs() < 1e-9, "{at:?}");
        }
    });
    assert_eq!(left, undisturbed);
}

#[test]
fn away_from_the_path_and_on_the_way_back_a_stop_gives_the_part_up_and_a_fault_stops_the_machine() {
    for (returning, fault) in [(false, false), (true, false), (false, true), (true, true)] {
        rehearse_part(9, |run| {
            reach_midst(run);
            run.operator.give(Command::Hold);
            reach_state(run, State::Held);
            jog_by(run, 2, 20.0);
            rest_away(run);
            jog_by(run, 0, 60.0);
            if returning {
                // The hand is let go first.
                run.operator.give(Command::Resume);
                reach(run, "beside", |run| {
                    run.control.state() == State::Returning && run.operator.live().velocity_mm_s > 10.0
                });
            } else {
                reach(run, "in motion", |run| run.operator.live().velocity_mm_s > 10.0);
            }
            match fault {
                true => run.operator.give(Command::Estop),
                false => run.operator.give(Command::Stop),
            }
            reach(run, "at an end", |run| {
                matches!(run.control.state(), State::Ready | State::Estop | State::Disabled)
            });
            let off = run.operator.live().switched_off;
            assert!(off > 0, "spindle and coolant are off");
            // Drives that stop by their own ramp do so behind the state.
            let _ = run.run_until(1000, |_| false);
            let rest = place(run);
            run.operator.give(Command::Resume);
            let moved = run.run_until(200, |run| place(run) != rest);
            assert!(!moved.expect("no fault"), "it moves again: {rest:?} {:?}", place(run));
            for peaks in run.control.peaks() {
                assert_eq!(peaks.over, [0; 3], "{peaks:?}");
            }
        });
    }
}

/// The mains fail in the cut: to rest on the path, the tool out of the work, then drives off; power that comes back starts nothing.
#[test]
fn mains_that_fail_stop_the_part_and_take_the_tool_out_of_the_work() {
    for retract_mm in [0.0, 6.5] {
        let mut config = machine();
        config.stops.mains.retract_mm = retract_mm;
        let act = |run: &mut Rehearsal<'_>| {
            reach_midst(run);
            run.hal.set("iocontrol.0.mains-ok", false).unwrap();
            reach_state(run, State::Stopping);
            reach(run, "at rest on the path", |run| {
                run.operator.live().velocity_mm_s == 0.0
            });
            let rest = place(run);
            reach_state(run, State::Faulted);
            let end = place(run);
            assert_eq!(end[..2], rest[..2]);
            assert!((end[2] - rest[2] - retract_mm).abs() < 1e-9, "{rest:?} {end:?}");
            let _ = run.run_until(500, |_| false).unwrap();
            let cause = &run.operator.alarms()[0].cause.text;
            assert_eq!(cause, "the mains have failed (iocontrol.0.mains-ok)");
            run.hal.set("iocontrol.0.mains-ok", true).unwrap();
            // Drives without power rest where they are, but for what is left of a following error.
            let moves = |run: &mut Rehearsal<'_>| (0..3).any(|axis| (place(run)[axis] - end[axis]).abs() > 0.05);
            assert!(!run.run_until(500, moves).unwrap(), "it moves again");
            for peaks in run.control.peaks() {
                assert_eq!(peaks.over, [0; 3], "{peaks:?}");
            }
            Ok(())
        };
        rehearse(&config, PART.as_bytes(), NetConfig::clean(11), act).expect("a rehearsal");
    }
}

/// What the mains have left undone is not done by the next stop.
#[test]
fn an_emergency_stop_in_the_stop_for_the_mains_leaves_no_retract_behind() {
    let mut config = machine();
    config.stops.mains.retract_mm = -6.5;
    let operator = isocnc::operator::console::Operator::standing_by;
    let net = NetConfig::clean(12);
    isocnc::operator::rehearsal::rehearse_with(&config, PART.as_bytes(), net, operator, |run| {
        use isocnc::machine::sequence::Job;
        reach_state(run, State::Disabled);
        let now_ns = run.now_ns();
        let home = run.operator.homing_order(u64::MAX);
        assert!(run.operator.begin(now_ns, Job::Program { home, runs: 1 }));
        reach_midst(run);
        run.hal.set("iocontrol.0.mains-ok", false).unwrap();
        reach_state(run, State::Stopping);
        run.operator.give(Command::Estop);
        reach_state(run, State::Estop);
        run.hal.set("iocontrol.0.mains-ok", true).unwrap();
        let _ = run.run_until(500, |_| false).unwrap();
        run.operator.reset_estop();
        reach_state(run, State::Disabled);
        let _ = run.run_until(50, |_| false).unwrap();
        let now_ns = run.now_ns();
        assert!(run.operator.begin(now_ns, Job::On));
        reach_state(run, State::Ready);
        let rest_mm = place(run)[2];
        jog_by(run, 0, 5.0);
        reach_state(run, State::Jogging);
        run.operator.give(Command::Stop);
        reach_state(run, State::Ready);
        assert_eq!(place(run)[2], rest_mm, "Z moves by surprise");
        Ok(())
    })
    .expect("a rehearsal");
}

#[test]
fn a_jog_behind_a_resume_takes_it_back() {
    let undisturbed = held_part(13, |_, _| {});
    let left = held_part(13, |run, _| {
        jog_by(run, 2, 20.0);
        rest_away(run);
        jog_by(run, 0, 40.0);
        reach(run, "in motion", |run| run.operator.live().velocity_mm_s > 10.0);
        // The hand has to come to rest first, and is back before it has.
        run.operator.give(Command::Resume);
        let _ = run.run_until(3, |_| false).unwrap();
        assert!(run.operator.live().velocity_mm_s > 10.0);
        jog_by(run, 0, -2.0);
        rest_away(run);
        let at = place(run);
        let _ = run.run_until(1_000, |_| false).unwrap();
        assert_eq!(
            (run.control.state(), place(run)),
            (State::Away, at),
            "it goes back by itself"
        );
        way_back(run);
    });
    assert_eq!(left, undisturbed);
}

/// The leg that was broken off is not taken for done: the tool would go beside, or down, where it must not.
#[test]
fn a_probe_that_comes_into_contact_on_the_way_back_ends_it_there() {
    let mut config = machine();
    config.nets.retain(|net| net.source != "io.10.in-08");
    rehearse(&config, PART.as_bytes(), NetConfig::clean(14), |run| {
        reach_midst(run);
        run.operator.give(Command::Hold);
        reach_state(run, State::Held);
        let held = place(run);
        jog_by(run, 0, 12.0);
        rest_away(run);
        jog_by(run, 2, -3.0);
        rest_away(run);
        let below = place(run);
        run.operator.give(Command::Resume);
        reach(run, "on the way up", |run| place(run)[2] > below[2] + 1.0);
        run.hal.set("motion.probe-input", true).unwrap();
        rest_away(run);
        let at = place(run);
        assert!(at[2] < held[2] && at[0] == below[0], "{at:?}");
        run.hal.set("motion.probe-input", false).unwrap();
        for at in way_back(run) {
            let is_beside = (at[0] - below[0]).abs() < 1e-9;
            assert!(is_beside || (at[2] - held[2]).abs() < 1e-9, "{at:?}");
        }
        Ok(())
    })
    .unwrap();
}

#[test]
fn an_override_at_0_rests_on_the_way_back() {
    // What is left of the part is planned anew for the overrides.
    let _ = held_part(15, |run, held| {
        jog_by(run, 2, 20.0);
        rest_away(run);
        jog_by(run, 0, 60.0);
        rest_away(run);
        run.operator.give(Command::Resume);
        let overrides = run.operator.shared();
        // Beside at rapid speed, and slowly down at the end of it.
        for (what, speed_mm_s) in [(Overridden::Rapid, 10.0), (Overridden::Feed, 1.0)] {
            reach(run, "on its way", |run| {
                let live = run.operator.live();
                let slow = place(run)[2] < held[2] + 3.0;
                live.state == State::Returning && live.velocity_mm_s > speed_mm_s && (what == Overridden::Rapid || slow)
            });
            overrides.overrides.order(what, 0.0).unwrap();
            let _ = run.run_until(500, |_| false).unwrap();
            let at = place(run);
            let moved = run.run_until(300, |run| place(run) != at).unwrap();
            assert!(
                !moved && run.control.state() == State::Returning,
                "{what:?}: {:?}",
                run.operator.live()
            );
            overrides.overrides.order(what, 100.0).unwrap();
        }
        reach_state(run, State::Held);
    });
}

#[test]
fn a_limit_switch_ends_the_way_of_the_tool_out_of_the_work() {
    let mut config = machine();
    config.stops.mains.retract_mm = 6.5;
    rehearse(&config, PART.as_bytes(), NetConfig::clean(16), |run| {
        reach_midst(run);
        run.hal.set("iocontrol.0.mains-ok", false).unwrap();
        reach_state(run, State::Stopping);
        reach(run, "at rest on the path", |run| {
            run.operator.live().velocity_mm_s == 0.0
        });
        let rest = place(run);
        reach(run, "on its way", |run| place(run)[2] > rest[2] + 1.0);
        run.hal.set("joint.2.pos-lim-sw-in", true).unwrap();
        reach_state(run, State::Faulted);
        let end = place(run);
        assert!((1.0..4.5).contains(&(end[2] - rest[2])), "{rest:?} {end:?}");
        for peaks in run.control.peaks() {
            assert_eq!(peaks.over, [0; 3], "{peaks:?}");
        }
        Ok(())
    })
    .unwrap();
}
