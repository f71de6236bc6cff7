//! A third bus, the toy of `bus::toy`, carries a whole machine: power-on, homing, a program, a fault of a drive, a node that is lost.
//!
//! Nothing above the bus knows of it. Commands run on it in `tests/commands_on_another_bus.rs`.

use crate::toy_machine;

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::sim::{NetConfig, SimMachine};
use std::path::Path;

const PART: &str = "G21 G90 G94 G54\nG0 X30 Y40 Z-5\nG1 X60 Y45 F3000\nG3 X60 Y65 J10\nM2\n";

fn machine() -> Config {
    config::parse(&toy_machine::text(), Path::new("toy.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn a_program_is_homed_run_and_ended() {
    rehearse(&machine(), PART.as_bytes(), NetConfig::clean(1), |run| {
        assert_eq!(run.run(120_000)?, Outcome::Completed, "{:#?}", run.operator.journal());
        // G54 of the demo machine lies at X 20, Y 20, Z -60.
        let wanted = [80.0, 85.0, -65.0];
        let told = run.operator.live().position.0;
        for axis in 0..3 {
            let load = run.net().machine().joint_position_mm(axis).expect("a drive");
            assert!((told[axis] - wanted[axis]).abs() < 1e-3, "axis {axis}: {}", told[axis]);
            assert!((load - wanted[axis]).abs() < 1e-3, "axis {axis}: {load}");
        }
        Ok(())
    })
    .expect("a run");
}

/// Runs to the middle of the program, lets something go wrong there, and gives the alarm of the machine that has stopped.
fn alarm_of(go_wrong: impl FnOnce(&mut SimMachine)) -> String {
    let cut = |run: &mut Rehearsal<'_>| run.control.state() == State::Running && run.operator.live().line == 3;
    rehearse(&machine(), PART.as_bytes(), NetConfig::clean(1), |run| {
        assert!(run.run_until(60_000, cut)?, "{:#?}", run.operator.journal());
        go_wrong(run.net().machine_mut());
        let stopped = run.run_until(10_000, |run| run.control.state() == State::Faulted)?;
        assert!(stopped, "{:#?}", run.operator.journal());
        Ok(run.operator.alarm().expect("an alarm").cause.text.clone())
    })
    .expect("a run")
}

#[test]
fn a_node_that_is_lost_stops_the_machine() {
    let alarm = alarm_of(|machine| assert!(machine.plug(2, false)));
    assert!(alarm.contains("lost"), "{alarm}");
}

#[test]
fn a_fault_of_a_drive_stops_the_machine() {
    let alarm = alarm_of(|machine| assert!(machine.raise_drive_fault(1, cia402::device::ERROR_FOLLOWING)));
    assert!(alarm.contains("8611h"), "{alarm}");
}
