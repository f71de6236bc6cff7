//! The same part with drives in each of the cyclic modes: what the machine does must not depend on who closes the position loop.

use super::*;
use isocnc::config::{DriveMode, Mapped};
use motion::rt::PidGains;

/// The demo machine with all its drives in a mode.
fn machine_in(mode: DriveMode, pid: Option<PidGains>) -> Config {
    let mut config = machine();
    let (index, sub) = mode.target();
    let bits = if mode == DriveMode::Cst { 16 } else { 32 };
    for node in &mut config.bus.nodes {
        for object in &mut node.outputs {
            if object.index == 0x607A {
                *object = Mapped { index, sub, bits };
            }
        }
    }
    for joint in &mut config.joints {
        (joint.mode, joint.pid) = (mode, pid);
    }
    config
}

/// Gains for a velocity amplifier.
fn of_velocity() -> PidGains {
    PidGains {
        p: 40.0,
        ff: [0.0, 1.0, 0.005, 0.0],
        output_max: 180.0,
        ..PidGains::default()
    }
}

/// Gains for a torque amplifier: `mm_s2` is what the rated torque accelerates with.
fn of_torque(mm_s2: f64) -> PidGains {
    PidGains {
        p: 10_000.0 / mm_s2,
        d: 150.0 / mm_s2,
        i: 100_000.0 / mm_s2,
        integral_max: 0.05,
        ff: [0.0, 0.0, 1.0 / mm_s2, 0.0],
        output_max: 3.0,
        ..PidGains::default()
    }
}

fn place_of_loads(run: &mut Rehearsal<'_>) -> Position {
    let machine = run.net().machine();
    let [x, y, z] = [0, 1, 2].map(|joint| machine.joint_position_mm(joint).expect("a joint"));
    Position::xyz(x, y, z)
}

/// Where the loads of the machine were, cycle by cycle, while the part was run, and how far they were off its path at most.
fn part_in(config: &Config) -> (Vec<Position>, f64) {
    // Loads have settled before it ends.
    let part = PART.replace("M2", "G4 P0.5\nM2");
    assert_ne!(part, PART);
    rehearse_on(config, NetConfig::clean(1), &part, |run| {
        let mut loads = Vec::new();
        reach(run, "a result", |run| {
            if run.control.state() == State::Running {
                loads.push(place_of_loads(run));
            }
            run.operator.outcome().is_some()
        });
        assert_eq!(run.operator.outcome(), Some(Outcome::Completed), "{}", journal(run));
        // The load is beside the path by no more than it lags.
        let off_mm = deviation(&loads, run.path(), 0.5).off_mm;
        (loads, off_mm)
    })
}

#[test]
fn every_mode_makes_the_same_part() {
    let (of_drive, drive_off_mm) = part_in(&machine());
    // The rated torque of the simulated motor accelerates with a third of what it can at most.
    let most = 3.0 * machine().joints[0].stop.acceleration_mm_s2;
    for (mode, pid, off_max_mm) in [
        (DriveMode::Ip, None, drive_off_mm + 1e-9),
        (DriveMode::Csv, Some(of_velocity()), 0.05),
        (DriveMode::Cst, Some(of_torque(most / 3.0)), 0.05),
    ] {
        let (loads, off_mm) = part_in(&machine_in(mode, pid));
        assert!(off_mm <= off_max_mm, "{mode:?}: {off_mm} mm off the path");
        let [end, wanted] = [&loads, &of_drive].map(|loads| *loads.last().expect("it ran"));
        for axis in [Axis::X, Axis::Y, Axis::Z] {
            let beside_mm = (end[axis] - wanted[axis]).abs();
            assert!(
                beside_mm < 0.002,
                "{mode:?}: {} is {beside_mm} mm beside its end",
                axis.letter()
            );
        }
        assert!(loads.len().abs_diff(of_drive.len()) <= 2, "{mode:?} takes another time");
    }
}

#[test]
fn answers_that_get_lost_do_not_disturb_a_loop() {
    let config = machine_in(DriveMode::Csv, Some(of_velocity()));
    let (_, quiet_mm) = part_in(&config);
    let off_mm = rehearse_on(&config, NetConfig::clean(1), PART, |run| {
        reach_midst(run);
        let mut loads = Vec::new();
        let mut cycle = 0_u64;
        reach(run, "a result", |run| {
            cycle += 1;
            if cycle.is_multiple_of(20) && run.control.state() == State::Running {
                run.net().machine_mut().drop_pres(1, 2);
            }
            if run.control.state() == State::Running {
                loads.push(place_of_loads(run));
            }
            run.operator.outcome().is_some()
        });
        assert_eq!(run.operator.outcome(), Some(Outcome::Completed), "{}", journal(run));
        deviation(&loads, run.path(), 0.5).off_mm
    });
    assert!(
        off_mm <= quiet_mm + 0.01,
        "{off_mm} mm off the path, {quiet_mm} without losses"
    );
}

#[test]
fn a_loop_that_runs_the_wrong_way_is_stopped_by_its_following_error() {
    let mut wrong = of_velocity();
    (wrong.p, wrong.ff) = (-40.0, [0.0; 4]);
    let config = machine_in(DriveMode::Csv, Some(wrong));
    rehearse_on(&config, NetConfig::clean(1), PART, |run| {
        reach(run, "a result", |run| run.operator.outcome().is_some());
        assert_ne!(run.operator.outcome(), Some(Outcome::Completed));
        let said = journal(run);
        assert!(said.contains("following error"), "{said}");
    });
}

#[test]
fn a_joint_that_does_not_follow_is_led_to_rest_on_its_path_only_by_a_loop_of_its_own() {
    for (config, on_path) in [
        (machine(), true),
        (machine_in(DriveMode::Csv, Some(of_velocity())), false),
    ] {
        rehearse_on(&config, NetConfig::clean(1), PART, |run| {
            reach_midst(run);
            assert!(run.net().machine_mut().jam(DRIVES[0], true));
            let mut stopping = false;
            reach(run, "a result", |run| {
                stopping |= run.control.state() == State::Stopping;
                run.operator.outcome().is_some()
            });
            let said = journal(run);
            assert!(said.contains("following error"), "{said}");
            assert_eq!(stopping, on_path, "{said}");
        });
    }
}
