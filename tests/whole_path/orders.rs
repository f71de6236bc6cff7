//! Orders in mid-program: stop, hold, override, drives off, shut-down; and orders that are refused.

use super::*;

#[test]
fn a_stop_in_mid_program_is_on_the_path_within_the_stop_limits() {
    for after in [1, 137, 333] {
        rehearse_part(NetConfig::clean(13), PART, |run| {
            reach_midst(run);
            run.run_until(after, |_| false).expect("a good program");
            let now_ns = run.now_ns();
            run.operator.stop(now_ns);
            reach_state(run, State::Stopping);
            reach(run, "at rest", |run| {
                for id in DRIVES {
                    let power = run.net().machine().drive_state(id);
                    assert_eq!(power, Some(Power::OperationEnabled), "drive {id} while stopping");
                }
                run.control.state() != State::Stopping
            });
            assert_eq!(run.control.state(), State::Ready);
            assert_eq!(finish(run), Outcome::Stopped);
            let commands = commands(run);
            assert_ends_at_rest(&commands);
            assert_within_limits(&commands, true);
            assert_on_path(run);
            assert_eq!(run.operator.alarms(), []);
            // The control's own monitor judges a stop by the limits of stops.
            assert!(run.control.peaks().iter().all(|peaks| peaks.over == [0; 3]));
            assert_powerless(run);
            assert_eq!(run.net().machine().outputs(10), Some([0, 0]));
        });
    }
}

#[test]
fn a_stop_before_the_program_ends_in_order_wherever_it_comes() {
    let mut stopped_in = Vec::new();
    for at_ms in [1, 300, 655, 711, 716, 721, 735, 1_250, 2_750, 2_835, 4_750, 6_375] {
        rehearse_part(NetConfig::clean(14), PART, |run| {
            println!("stop at {at_ms} ms");
            reach(run, "so late", |run| run.now_ns() >= at_ms * 1_000_000);
            stopped_in.push(run.operator.step());
            let now_ns = run.now_ns();
            run.operator.stop(now_ns);
            assert_eq!(finish(run), Outcome::Stopped);
            assert_eq!(run.control.state(), State::Down);
            assert_eq!(run.operator.alarms(), []);
            assert_eq!(commands(run), [[0.0; 3]; 0]);
            run.net().advance(AFTERMATH_NS);
            for id in DRIVES {
                assert_eq!(run.net().machine().drive_state(id), Some(Power::SwitchOnDisabled));
            }
        });
    }
    for step in [Step::Network, Step::Enable, Step::Home] {
        assert!(stopped_in.contains(&step), "none in {step:?}: {stopped_in:?}");
    }
}

#[test]
fn hold_and_override_keep_the_path_and_the_end() {
    let text = PART.replacen("N10 ", "N10 M52 P1 ", 1);
    rehearse_part(NetConfig::clean(15), &text, |run| {
        reach_midst(run);
        run.hal.set("motion.adaptive-feed", 0.4).expect("a pin");
        run.run_until(400, |_| false).expect("a good program");
        run.hal.set("motion.feed-hold", true).expect("a pin");
        run.run_until(400, |_| false).expect("a good program");
        let held = run.operator.live();
        assert_eq!(held.velocity_mm_s, 0.0);
        run.run_until(100, |_| false).expect("a good program");
        assert_eq!(run.operator.live().position, held.position);
        run.hal.set("motion.feed-hold", false).expect("a pin");
        run.hal.set("motion.adaptive-feed", 1.0).expect("a pin");
        assert_eq!(finish(run), Outcome::Completed);
        assert_part_cut(run);
        assert_within_limits(&commands(run), true);
        assert!(run.control.peaks().iter().all(|peaks| peaks.over == [0; 3]));
    });
}

#[test]
fn drives_switched_off_in_mid_program_rest_first_and_no_old_program_moves_them_when_they_are_on_again() {
    rehearse_part(NetConfig::clean(21), PART, |run| {
        disable_in_midst(run);
        let cycles = commands(run).len();
        let before = loads(run);
        order(run, Command::Enable, State::Ready);
        run.run_until(500, |_| false).expect("a good program");
        assert_eq!(commands(run).len(), cycles, "the program has gone on");
        for (at_mm, before_mm) in loads(run).into_iter().zip(before) {
            assert!((at_mm - before_mm).abs() < 0.01, "moved from {before_mm} to {at_mm}");
        }
        assert_eq!(run.operator.alarms(), []);
    });
}

#[test]
fn a_shut_down_in_mid_program_rests_on_the_path_first() {
    rehearse_part(NetConfig::clean(22), PART, |run| {
        reach_midst(run);
        order(run, Command::ShutDown, State::Stopping);
        // A later, lesser wish changes nothing.
        run.operator.give(Command::Disable);
        reach_state(run, State::ShuttingDown);
        // The operator takes records of ten cycles at a time.
        run.run_until(10, |_| false).expect("a good program");
        let commands = commands(run);
        assert_ends_at_rest(&commands);
        assert_within_limits(&commands, true);
        assert_on_path(run);
        reach_state(run, State::Down);
        assert_powerless(run);
        assert_eq!(run.operator.alarms(), []);
    });
}

#[test]
fn a_program_from_elsewhere_is_refused_before_anything_moves() {
    rehearse_on(&planning_late(), NetConfig::clean(23), PART, |run| {
        disable_in_midst(run);
        order(run, Command::Enable, State::Ready);
        let before = loads(run);
        let (_producer, consumer) = motion::ring::channel(4);
        let config = machine();
        let mut elsewhere = run.operator.live().position;
        elsewhere[Axis::X] += 1.0;
        let program = Interpolator::new(consumer, elsewhere, stop_ramp(&config));
        order(
            run,
            Command::Start {
                program: Box::new(program),
                mdi: false,
            },
            State::Faulted,
        );
        run.run_until(100, |_| false).expect("a good program");
        for (at_mm, before_mm) in loads(run).into_iter().zip(before) {
            assert!((at_mm - before_mm).abs() < 0.01, "moved from {before_mm} to {at_mm}");
        }
        assert!(
            run.operator.alarms()[0]
                .cause
                .text
                .starts_with("axis X (joint 0): command")
        );
    });
}

#[test]
fn a_held_machine_begins_nothing_and_a_feed_that_is_no_number_holds_it() {
    let text = "G21 G90 G94 G54 M52 P1\nG1 X5 F600\nM3 S1000\nG1 X10\nM2\n";
    for not_moving in [0.0, f64::NAN] {
        rehearse_part(NetConfig::clean(25), text, |run| {
            let spindle = run.hal.reader::<bool>("spindle.0.on").expect("a pin");
            // So near the end of the first move that the ramp reaches it.
            reach(run, "near the end of the first move", |run| {
                run.operator.live().line == 2 && run.operator.live().position[Axis::X] > 25.0 - 0.01
            });
            run.hal.set("motion.adaptive-feed", not_moving).expect("a pin");
            run.run_until(500, |_| false).expect("a good program");
            let held = run.operator.live();
            assert_eq!(
                (held.line, held.velocity_mm_s),
                (3, 0.0),
                "rests before the spindle's line"
            );
            assert!(!spindle.get(), "the spindle started in a hold");
            run.hal.set("motion.adaptive-feed", 1.0).expect("a pin");
            reach(run, "at the second move", |run| run.operator.live().line == 4);
            assert!(spindle.get());
            assert_eq!(finish(run), Outcome::Completed);
            assert!(!spindle.get());
        });
    }
}

#[test]
fn the_answer_to_the_last_tool_change_does_not_answer_the_next() {
    let mut config = machine();
    config.nets.retain(|net| net.name != "tool-change-loop");
    rehearse_on(&config, NetConfig::clean(26), "G21 G90\nT1 M6\nM2\n", |run| {
        run.hal.set("iocontrol.0.tool-changed", true).expect("a pin");
        let asked = run.hal.reader::<bool>("iocontrol.0.tool-change").expect("a pin");
        reach_state(run, State::Running);
        run.run_until(300, |_| false).expect("a good program");
        assert_eq!((run.control.state(), asked.get()), (State::Running, false));
        run.hal.set("iocontrol.0.tool-changed", false).expect("a pin");
        reach(run, "asked for a tool", |_| asked.get());
        run.run_until(300, |_| false).expect("a good program");
        assert_eq!((run.control.state(), asked.get()), (State::Running, true));
        run.hal.set("iocontrol.0.tool-changed", true).expect("a pin");
        assert_eq!(finish(run), Outcome::Completed);
        assert!(!asked.get());
    });
}
