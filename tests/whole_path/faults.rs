//! Faults of drives and of the control: a controlled stop, the first cause named, nothing enabled before an acknowledge.

use super::*;

#[test]
fn a_drive_fault_names_axis_and_cause() {
    rehearse_part(NetConfig::clean(9), PART, |run| {
        let fault = Disturbance::DriveFault {
            node: 1,
            error_code: 0x2310,
        };
        let causes = fails_in_order(run, fault, &[1, 2]);
        assert_eq!(causes.len(), 1, "{causes:?}");
        let text = cia402::error_text(0x2310);
        assert!(
            causes[0].starts_with("axis X (joint 0): ") && causes[0].contains("2310") && causes[0].contains(text),
            "{causes:?}"
        );
    });
}

#[test]
fn a_drive_that_warns_stops_the_machine_in_order() {
    rehearse_part(NetConfig::clean(19), PART, |run| {
        reach_state(run, State::Running);
        run.run_until(200, |_| false).expect("a good program");
        run.net().machine_mut().drive_injected(2).expect("a drive").warning = true;
        assert_eq!(finish(run), Outcome::Faulted);
        let first = &run.operator.alarms()[0].cause.text;
        assert!(first.starts_with("axis Y (joint 1): the drive warns"), "{first}");
        assert_powerless(run);
    });
}

#[test]
fn a_following_error_above_the_limit_stops_the_machine_and_names_the_axis() {
    let mut config = machine();
    // The simulated loads lag more than this behind a feed of 60 mm/s.
    config.joints[1].following_error_mm = 0.05;
    rehearse_on(&config, NetConfig::clean(10), PART, |run| {
        assert_eq!(finish(run), Outcome::Faulted);
        let cause = &run.operator.alarms()[0].cause.text;
        assert!(
            cause.starts_with("axis Y (joint 1): ") && cause.contains("ollowing error"),
            "{cause}"
        );
        assert_powerless(run);
    });
}

#[test]
fn a_fault_during_homing_ends_it_and_is_named() {
    let fault = Disturbance::DriveFault {
        node: 1,
        error_code: 0x7300,
    };
    for (disturbance, cause) in [
        (fault, "axis X (joint 0): drive fault 7300h"),
        (Disturbance::Unplug { node: 3 }, "z-drive (node 3): lost"),
    ] {
        rehearse_part(NetConfig::clean(16), PART, |run| {
            reach_state(run, State::Homing);
            run.run_until(300, |_| false).expect("a good program");
            let now_ns = run.now_ns();
            run.net().at(now_ns, disturbance);
            assert_eq!(finish(run), Outcome::Faulted);
            let first = &run.operator.alarms()[0].cause.text;
            assert!(first.starts_with(cause), "{first}");
            assert_eq!(commands(run), [[0.0; 3]; 0]);
            assert_powerless(run);
        });
    }
}

/// A planner with a defect: it plans for a machine of three times the jerk.
#[test]
fn a_command_above_a_limit_stops_the_machine_and_names_joint_order_value_and_limit() {
    let mut wrong = machine();
    wrong.joints[0].limits.jerk_mm_s3 *= 3.0;
    let limit = machine().joints[0].limits.jerk_mm_s3;
    rehearse_on(&planning_late(), NetConfig::clean(25), PART, |run| {
        disable_in_midst(run);
        order(run, Command::Enable, State::Ready);
        let start = run.operator.live().position;
        let (producer, consumer) = motion::ring::channel(ring_capacity(&wrong));
        let tables = Tables::read(&wrong).expect("no files");
        let text = b"G21 G91 G94\nG1 F6000 X10\nM2\n";
        let mut feeder = Feeder::new(&wrong, &tables, text, start, producer);
        while feeder.pump().expect("a good program") == Progress::Working {}
        let program = Interpolator::new(consumer, start, stop_ramp(&wrong));
        order(
            run,
            Command::Start {
                program: Box::new(program),
                mdi: false,
            },
            State::Running,
        );
        reach_state(run, State::Stopping);
        reach_state(run, State::Faulted);
        run.run_until(10, |_| false).expect("a good program");
        let cause = run.operator.alarms()[0].cause.text.clone();
        assert!(cause.starts_with("axis X (joint 0): commanded jerk "), "{cause}");
        assert!(cause.contains(&format!("above its limit, {limit:.1} mm/s³")), "{cause}");
    });
}

#[test]
fn after_an_acknowledge_the_machine_is_enabled_anew_and_stands_still() {
    rehearse_part(NetConfig::clean(29), PART, |run| {
        reach_midst(run);
        let now_ns = run.now_ns();
        let fault = Disturbance::DriveFault {
            node: 1,
            error_code: 0x2310,
        };
        run.net().at(now_ns, fault);
        reach(run, "faulted", |run| run.control.state() == State::Faulted);
        // Before the sequence, which looks every ten cycles, switches off.
        run.operator.give(Command::Acknowledge);
        reach_state(run, State::Disabled);
        let before = loads(run);
        order(run, Command::Enable, State::Ready);
        for (at_mm, before_mm) in loads(run).into_iter().zip(before) {
            assert!((at_mm - before_mm).abs() < 0.01, "moved from {before_mm} to {at_mm}");
        }
    });
}
