//! Probing in programs, on virtual time: from the text to a surface of the simulated machine and back into the program.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::machine::tables::Tables;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::program::{Begin, check};
use isocnc::rt::shared::Command;
use isocnc::sim::NetConfig;
use motion::cancel::Cancel;
use motion::canon::Position;
use motion::plan::deviation;
use std::path::Path;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const FIND_MIDDLE: &str = include_str!("../configs/find-middle.ngc");
/// Floor of the pocket in the simulated machine.
const FLOOR_MM: f64 = -100.0;
/// G54 of the machine.
const G54: [f64; 3] = [20.0, 20.0, -60.0];
const CYCLES_MAX: u64 = 200_000;
const CYCLE_S: f64 = 1e-3;
/// Increments of the drives, and rounding.
const RESOLUTION_MM: f64 = 2e-4;
/// To the floor with 10 mm/s, and back to where it was found.
const PLANE: &str = "G21 G90 G94 G54\nG53 G0 Z-80\nG38.2 Z-44.5 F600\nG0 Z[#5063]\nM2\n";

fn machine() -> Config {
    config::parse(MACHINE, Path::new("mill3-demo.toml")).expect("a good machine file")
}

fn rehearse_part<T>(text: &str, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    rehearse(&machine(), text.as_bytes(), NetConfig::clean(1), |run| Ok(act(run))).expect("a machine to rehearse on")
}

fn commands(run: &Rehearsal<'_>) -> Vec<[f64; 3]> {
    let samples = run.operator.recorder.samples();
    samples.iter().map(|sample| sample.command).collect()
}

fn reach(run: &mut Rehearsal<'_>, what: &str, done: impl FnMut(&mut Rehearsal<'_>) -> bool) {
    let reached = run.run_until(CYCLES_MAX, done).expect("a good program");
    assert!(reached, "never {what}: {:#?}", run.operator.journal());
}

/// On the way to the floor, quickly.
fn reach_midst(run: &mut Rehearsal<'_>) {
    reach(run, "on its way", |run| {
        let live = run.operator.live();
        live.line == 3 && live.position.0[2] < -85.0
    });
}

/// The limits of stops, from differences of neighbouring cycles.
fn assert_within_limits(commands: &[[f64; 3]]) {
    assert!(commands.len() > 100, "a program ran: {} cycles", commands.len());
    let joints = machine().joints;
    for window in commands.windows(4) {
        for (joint, limits) in joints.iter().enumerate() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|index: usize| window[index][joint]);
            let (speed, change) = ((d - c) / CYCLE_S, (d - 2.0 * c + b) / CYCLE_S.powi(2));
            let jerk = (d - 3.0 * c + 3.0 * b - a) / CYCLE_S.powi(3);
            assert!(
                speed.abs() <= limits.limits.velocity_mm_s * 1.000_001,
                "joint {joint}: {speed}"
            );
            assert!(
                change.abs() <= limits.stop.acceleration_mm_s2 * 1.000_001,
                "joint {joint}: {change}"
            );
            assert!(
                jerk.abs() <= limits.stop.jerk_mm_s3 * 1.000_001 + 0.1,
                "joint {joint}: {jerk}"
            );
        }
    }
}

fn last_z(run: &Rehearsal<'_>) -> f64 {
    commands(run).last().expect("a program ran")[2]
}

#[test]
fn a_plane_is_found_within_the_way_of_a_cycle() {
    rehearse_part(PLANE, |run| {
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert_eq!(run.operator.alarms(), []);
        let found = last_z(run);
        let beyond = FLOOR_MM - found;
        assert!(beyond.abs() <= 0.01 + RESOLUTION_MM, "{found}");
        let commands = commands(run);
        assert_within_limits(&commands);
        // The stop: 10 mm/s end after v^1.5/J^0.5, and the drive lags.
        let lowest = commands.iter().map(|command| command[2]).fold(0.0, f64::min);
        assert!(lowest < found && lowest > FLOOR_MM - 0.3, "{lowest}");
        for peaks in run.control.peaks() {
            assert_eq!(peaks.over, [0; 3], "{peaks:?}");
        }
    });
}

#[test]
fn the_middle_of_a_pocket_is_found() {
    // On the exact path, so that nothing is off it but what probing does.
    rehearse_part(&format!("G61\n{FIND_MIDDLE}"), |run| {
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert_eq!(run.operator.alarms(), []);
        let commands = commands(run);
        let [x, y, z] = *commands.last().expect("a program ran");
        // Off the sides at 1 mm/s: a thousandth in a cycle.
        assert!((x - 150.0).abs() < 2e-3, "{x}");
        assert!((y - 100.0).abs() < 2e-3, "{y}");
        assert!((z - (FLOOR_MM + 20.0)).abs() < 2e-3, "{z}");
        assert_within_limits(&commands);
        // Judged by what was to be run: probing moves end where they came to rest, and what follows begins there.
        let points: Vec<Position> = commands.iter().map(|&[x, y, z]| Position::xyz(x, y, z)).collect();
        let found = deviation(&points, run.path(), 0.01);
        assert!(found.off_mm < 1e-6 && found.missed_mm < 1e-3, "{found:?}");
        assert!((found.length_mm - found.reached_mm).abs() < 0.1, "{found:?}");
        // 11 probing moves begin and end at rest, which is no part of their planned time.
        let planned_s = run.probed_time_s().expect("it was probed");
        let took_s = commands.len() as f64 * CYCLE_S;
        assert!((took_s - planned_s).abs() < 5.0, "{took_s} s, planned {planned_s} s");
    });
}

/// Runs into the error of a probing move; the machine stands, its drives hold, and all comes to an end.
fn fails(text: &str, message: &str, rests_mm: f64) {
    rehearse_part(text, |run| {
        let failed = run.run_until(CYCLES_MAX, |_| false).expect_err("a probing move fails");
        let shown = failed.to_string();
        assert!(shown.starts_with("program:3:") && shown.contains(message), "{shown}");
        assert_eq!(run.control.state(), State::Running);
        let now_ns = run.now_ns();
        run.operator.fail(now_ns, shown.clone());
        let power = run.net().machine().drive_state(3);
        assert_eq!(power, Some(cia402::State::OperationEnabled));
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Faulted);
        let causes: Vec<&str> = run
            .operator
            .alarms()
            .iter()
            .map(|alarm| alarm.cause.text.as_str())
            .collect();
        assert_eq!(causes, [shown.as_str()]);
        let commands = commands(run);
        assert_within_limits(&commands);
        assert!((last_z(run) - rests_mm).abs() < 1e-9, "{}", last_z(run));
    });
}

#[test]
fn no_contact_stops_the_program_at_its_line() {
    let text = "G21 G90 G94 G54\nG53 G0 Z-80\nG38.2 Z-30 F1200\nG0 Z0\nM2\n";
    fails(text, "G38.2 came to its end without contact", G54[2] - 30.0);
    let text = "G21 G90 G94 G54\nG53 G0 Z-102\nG38.4 Z-44 F1200\nG0 Z0\nM2\n";
    fails(text, "G38.4 came to its end still in contact", G54[2] - 44.0);
}

#[test]
fn a_contact_before_the_move_stops_the_program_at_its_line() {
    let text = "G21 G90 G94 G54\nG53 G0 Z-102\nG38.2 Z-44 F600\nG0 Z0\nM2\n";
    fails(text, "G38.2 began in contact", -102.0);
    let text = "G21 G90 G94 G54\nG53 G0 Z-80\nG38.4 Z-44 F600\nG0 Z0\nM2\n";
    fails(text, "G38.4 began without contact", -80.0);
}

#[test]
fn where_no_contact_is_no_mistake_the_program_decides() {
    let text = "G21 G90 G94 G54\nG53 G0 Z-80\nG38.3 Z-30 F1200\n\
                o1 if [#5070 EQ 0]\nG53 G0 Z-1\no1 else\nG53 G0 Z-2\no1 endif\nM2\n";
    rehearse_part(text, |run| {
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert_eq!(last_z(run), -1.0);
    });
}

#[test]
fn a_hold_in_a_probing_move_changes_nothing_of_what_it_finds() {
    rehearse_part(PLANE, |run| {
        reach_midst(run);
        run.operator.give(Command::Hold);
        reach(run, "held", |run| run.control.state() == State::Held);
        let held = run.operator.live().position.0[2];
        assert!(held < -85.0 && held > FLOOR_MM, "{held}");
        for _ in 0..200 {
            run.cycle(0).expect("a good program");
        }
        assert_eq!(run.operator.live().position.0[2], held);
        run.operator.give(Command::Resume);
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        let beyond = FLOOR_MM - last_z(run);
        assert!(beyond.abs() <= 0.01 + RESOLUTION_MM, "{beyond}");
        assert_within_limits(&commands(run));
    });
}

#[test]
fn a_stop_in_a_probing_move_ends_the_program_at_rest() {
    rehearse_part(PLANE, |run| {
        reach_midst(run);
        let now_ns = run.now_ns();
        run.operator.stop(now_ns);
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Stopped);
        assert_eq!(run.operator.alarms(), []);
        assert!(last_z(run) < -85.0 && last_z(run) > FLOOR_MM, "{}", last_z(run));
        assert_within_limits(&commands(run));
    });
}

#[test]
fn what_depends_on_a_touch_is_not_judged_before_it() {
    let config = machine();
    let tables = Tables::read(&config).expect("no tables");
    let judge = |text: &str| {
        check(
            &config,
            &tables,
            "part",
            text.as_bytes(),
            &Begin::at_home(&config),
            &Cancel::default(),
        )
    };
    // Were the floor at the end of the probing move, the cut would lie below the travel.
    let text = "G21 G90 G94 G54\nG53 G0 Z-80\nG38.2 Z-44 F600\nG10 L20 P1 Z0\nG1 Z-3\nM2\n";
    assert!(judge(text).is_ok());
    // This is wrong wherever the floor is.
    let text = "G21 G90 G94 G54\nG53 G0 Z-80\nG38.2 Z-44 F600\nS100 M3 G33 Z-41 K1\nM2\n";
    let errors = judge(text).expect_err("not on this machine").to_string();
    assert!(errors.contains("--> part:4:1"), "{errors}");
    // And this before anything is touched.
    let text = "G21 G90 G94 G54\nG0 Z-80\nG38.2 Z-44 F600\nM2\n";
    let errors = judge(text).expect_err("below the travel").to_string();
    assert!(errors.contains("--> part:2:"), "{errors}");
    // A loop that probes until it touches comes to an end.
    let text =
        "G21 G90 G94 G54\nG53 G0 Z-80\n#1=0\n#5070=0\no1 while [#5070 EQ 0]\nG91 G38.3 Z-1 F600\no1 endwhile\nM2\n";
    assert!(judge(text).is_ok());
}
