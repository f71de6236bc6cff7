//! Joints whose amplifiers have analog inputs, behind an I/O node.

use super::*;

const CABINET: &str = include_str!("../../configs/analog2-demo.toml");
const PART: &str = "G21 G90 G64 P0.01\nG0 X60 Y20\nG3 X60 Y20 I20 J0 F3000\nG1 X100 Y60 F6000\nG4 P0.5\nM2\n";

fn cabinet() -> Config {
    config::parse(CABINET, Path::new("analog2-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// How far the load stands beside where the control takes it to be: what homing has found once for all.
fn place_of_loads(run: &mut Rehearsal<'_>, zero_mm: [f64; 2]) -> Position {
    let machine = run.net().machine();
    let [x, y] = [0, 1].map(|joint| machine.joint_position_mm(joint).expect("a joint") - zero_mm[joint]);
    Position::xyz(x, y, 0.0)
}

#[test]
fn loads_follow_the_path_and_power_is_off_in_the_end() {
    let config = cabinet();
    rehearse_on(&config, NetConfig::clean(1), PART, |run| {
        // Y is homed where it stands.
        reach_state(run, State::Running);
        let y_mm = run.net().machine().joint_position_mm(1).expect("a joint");
        let zero_mm = [0.0, y_mm - 79.0];
        let mut loads = Vec::new();
        reach(run, "a result", |run| {
            loads.push(place_of_loads(run, zero_mm));
            run.operator.outcome().is_some()
        });
        assert_eq!(run.operator.outcome(), Some(Outcome::Completed), "{}", journal(run));
        let off_mm = deviation(&loads, run.path(), 0.5).off_mm;
        assert!(off_mm < 0.05, "{off_mm} mm off the path");
        let end = loads.last().expect("it ran");
        assert!(
            (end[Axis::X] - 100.0).abs() < 0.005 && (end[Axis::Y] - 60.0).abs() < 0.005,
            "{end:?}"
        );
        assert_eq!(finish(run), Outcome::Completed);
        let [contacts, _] = run.net().machine().outputs(10).expect("an I/O node");
        assert_eq!(contacts, 0);
    });
}

#[test]
fn a_fault_input_stops_both_joints_and_says_which_amplifier_it_was() {
    rehearse_on(&cabinet(), NetConfig::clean(1), PART, |run| {
        reach(run, "on the circle", |run| run.operator.live().line >= 3);
        run.net().machine_mut().set_inputs(10, 1 << 2);
        let outcome = finish(run);
        assert!(matches!(outcome, Outcome::Faulted), "{outcome:?}");
        let text = journal(run);
        assert!(text.contains("joint 1") && text.contains("external error"), "{text}");
    });
}

#[test]
fn lost_answers_are_bridged_and_a_lost_node_stops_the_machine() {
    rehearse_on(&cabinet(), NetConfig::clean(1), PART, |run| {
        let mut cycle = 0_u64;
        reach(run, "at its end", |run| {
            cycle += 1;
            if cycle.is_multiple_of(25) && run.control.state() == State::Running {
                run.net().machine_mut().drop_pres(10, 2);
            }
            run.operator.outcome().is_some()
        });
        assert_eq!(run.operator.outcome(), Some(Outcome::Completed), "{}", journal(run));
    });
    rehearse_on(&cabinet(), NetConfig::clean(1), PART, |run| {
        reach(run, "on the circle", |run| run.operator.live().line >= 3);
        run.net().machine_mut().plug(10, false);
        assert!(matches!(finish(run), Outcome::Faulted));
        let before = place_of_loads(run, [0.0; 2]);
        run.net().advance(AFTERMATH_NS);
        let after = place_of_loads(run, [0.0; 2]);
        // The outputs of the node have fallen to zero: no command, no power.
        assert_eq!(before, after);
    });
}
