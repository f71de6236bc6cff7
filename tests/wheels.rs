//! Wheels, keys and sticks by pins, on virtual time: pins to simulated drives.

use isocnc::config;
use isocnc::machine::sequence::Job;
use isocnc::machine::state::State;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::{Rehearsal, rehearse_with};
use isocnc::rt::joint_jog::{JogMotion, JogOrder};
use isocnc::rt::shared::Command;
use isocnc::sim::NetConfig;
use std::path::Path;

const MILL: &str = include_str!("../configs/mill3-demo.toml");
const COREXY: &str = include_str!("../configs/corexy-demo.toml");
const CYCLES_MAX: u64 = 60_000;

/// A machine that stands by, homed.
fn homed(machine: &str, act: impl FnOnce(&mut Rehearsal<'_>)) {
    let config = config::parse(machine, Path::new("machine.toml")).unwrap();
    rehearse_with(&config, b"", NetConfig::clean(3), Operator::standing_by, |run| {
        assert!(run.run_until(CYCLES_MAX, |run| run.control.state() == State::Disabled)?);
        let now_ns = run.now_ns();
        let home = run.operator.homing_order(u64::MAX);
        assert!(run.operator.begin(now_ns, Job::Home(home)));
        let is_homed = |run: &mut Rehearsal<'_>| run.control.state() == State::Ready && run.operator.not_homed() == 0;
        assert!(run.run_until(CYCLES_MAX, is_homed)?, "{:?}", run.operator.journal());
        act(run);
        for peaks in run.control.peaks() {
            assert_eq!(peaks.over, [0; 3], "{peaks:?}");
        }
        Ok(())
    })
    .unwrap();
}

fn set<T: hal_pins::Value + Into<hal_pins::AnyValue>>(run: &mut Rehearsal<'_>, pin: &str, value: T) {
    run.hal.set(pin, value).unwrap();
}

fn at(run: &Rehearsal<'_>, axis: usize) -> f64 {
    run.operator.live().position.0[axis]
}

fn wait(run: &mut Rehearsal<'_>, cycles: u64) {
    assert!(!run.run_until(cycles, |_| false).unwrap());
}

fn rest(run: &mut Rehearsal<'_>) {
    let rests = run
        .run_until(CYCLES_MAX, |run| run.control.state() == State::Ready)
        .unwrap();
    assert!(rests, "{:?}", run.operator.live());
}

#[test]
fn a_wheel_moves_its_axis_by_its_counts_from_the_cycle_behind_the_one_that_enables_it() {
    homed(MILL, |run| {
        let begin = at(run, 0);
        set(run, "axis.x.jog-scale", 0.01);
        // Turned while it is off: no matter.
        set(run, "axis.x.jog-counts", 5000);
        wait(run, 20);
        set(run, "axis.x.jog-enable", true);
        wait(run, 20);
        assert_eq!((run.control.state(), at(run, 0)), (State::Ready, begin));
        for counts in (5000..5200).step_by(4) {
            set(run, "axis.x.jog-counts", counts + 4);
            wait(run, 5);
        }
        wait(run, 500);
        assert!((at(run, 0) - begin - 2.0).abs() < 1e-9, "{}", at(run, 0) - begin);
        // A wheel that rests keeps nobody from something else, switched on or not.
        rest(run);
        set(run, "axis.x.jog-enable", false);
        wait(run, 5);
        // On, faster than it can go: what is more than half a second ahead is dropped.
        set(run, "axis.x.jog-enable", true);
        wait(run, 5);
        set(run, "axis.x.jog-counts", 1_000_000);
        wait(run, 3_000);
        let way = at(run, 0) - begin - 2.0;
        let limit_mm = 0.5
            * config::parse(MILL, Path::new("m.toml")).unwrap().joints[0]
                .limits
                .velocity_mm_s;
        assert!((way - limit_mm).abs() < 1.0, "{way}");
        set(run, "axis.x.jog-enable", false);
        rest(run);
    });
}

#[test]
fn a_wheel_in_velocity_mode_ends_with_its_last_count_and_a_wheel_without_power_does_nothing() {
    homed(MILL, |run| {
        set(run, "axis.y.jog-scale", 0.1);
        set(run, "axis.y.jog-vel-mode", true);
        set(run, "axis.y.jog-enable", true);
        let begin = at(run, 1);
        wait(run, 5);
        for counts in 0..200 {
            // 200 mm/s, more than it can do.
            set(run, "axis.y.jog-counts", 2 * counts);
            wait(run, 1);
        }
        let live = run.operator.live();
        assert!(live.velocity_mm_s > 10.0 && live.state == State::Jogging);
        let turned = at(run, 1);
        wait(run, 1_000);
        let overrun = at(run, 1) - turned;
        assert!(
            overrun > 0.0 && at(run, 1) - begin < 39.0,
            "{} {overrun}",
            at(run, 1) - begin
        );
        set(run, "axis.y.jog-enable", false);
        rest(run);
        let now_ns = run.now_ns();
        run.operator.off(now_ns);
        assert!(
            run.run_until(CYCLES_MAX, |run| run.control.state() == State::Disabled)
                .unwrap()
        );
        set(run, "axis.y.jog-enable", true);
        for counts in 0..100 {
            set(run, "axis.y.jog-counts", counts);
            wait(run, 1);
            assert_eq!(run.control.state(), State::Disabled);
        }
        let now_ns = run.now_ns();
        assert!(run.operator.begin(now_ns, Job::On));
        rest(run);
        let rest_at = at(run, 1);
        wait(run, 500);
        assert_eq!(at(run, 1), rest_at, "what was turned with drives off is forgotten");
    });
}

#[test]
fn a_key_runs_its_axis_while_it_is_held_and_what_ended_it_otherwise_wants_it_let_go() {
    for machine in [MILL, COREXY] {
        homed(machine, |run| {
            set(run, "halui.axis.jog-speed", 1200.0);
            wait(run, 5);
            let begin = at(run, 1);
            let away = if begin > 100.0 {
                ("halui.axis.y.minus", -1.0)
            } else {
                ("halui.axis.y.plus", 1.0)
            };
            set(run, away.0, true);
            wait(run, 1_000);
            assert!(
                (run.operator.live().velocity_mm_s - 20.0).abs() < 1e-6,
                "{:?}",
                run.operator.live()
            );
            assert!(away.1 * (at(run, 1) - begin) > 10.0);
            set(run, away.0, false);
            rest(run);
            // A hold ends it, and so it stays.
            set(run, away.0, true);
            wait(run, 300);
            run.operator.give(Command::Hold);
            rest(run);
            let held = at(run, 1);
            wait(run, 500);
            assert_eq!((run.control.state(), at(run, 1)), (State::Ready, held));
            set(run, away.0, false);
            wait(run, 5);
            // A stick: its deflection is the speed, as long as it is beyond the dead band.
            set(run, "halui.axis.y.analog", 0.1);
            wait(run, 300);
            assert_eq!(at(run, 1), held);
            set(run, "halui.axis.y.analog", 0.5 * away.1);
            wait(run, 500);
            assert!((run.operator.live().velocity_mm_s - 10.0).abs() < 1e-6);
            set(run, "halui.axis.y.analog", away.1);
            wait(run, 500);
            assert!((run.operator.live().velocity_mm_s - 20.0).abs() < 1e-6);
            set(run, "halui.axis.y.analog", f64::NAN);
            rest(run);
            // An increment for each rise.
            set(run, "halui.axis.y.analog", 0.0);
            set(run, "halui.axis.y.increment", 0.25);
            let from = at(run, 1);
            let key = if away.1 > 0.0 {
                "halui.axis.y.increment-plus"
            } else {
                "halui.axis.y.increment-minus"
            };
            for _ in 0..3 {
                set(run, key, true);
                wait(run, 30);
                set(run, key, false);
                wait(run, 30);
            }
            rest(run);
            assert!(
                (away.1 * (at(run, 1) - from) - 0.75).abs() < 1e-9,
                "{}",
                at(run, 1) - from
            );
        });
    }
}

/// Greatest change of an axis's commanded velocity, mm/s², over so many cycles.
fn acceleration(run: &mut Rehearsal<'_>, axis: usize, cycles: u64) -> f64 {
    let (mut places, mut most) = ([at(run, axis); 3], 0.0_f64);
    for _ in 0..cycles {
        wait(run, 1);
        places = [places[1], places[2], at(run, axis)];
        most = most.max((places[2] - 2.0 * places[1] + places[0]).abs() * 1e6);
    }
    most
}

#[test]
fn a_wheel_may_have_a_share_of_the_acceleration_and_nothing_else_has_it() {
    for machine in [MILL, COREXY] {
        homed(machine, |run| {
            set(run, "axis.x.jog-scale", 0.05);
            let mut counts = 0;
            let mut turn = |run: &mut Rehearsal<'_>, share: f64, cycles: u64| {
                set(run, "axis.x.jog-accel-fraction", share);
                set(run, "axis.x.jog-enable", true);
                wait(run, 5);
                counts = 400 - counts;
                set(run, "axis.x.jog-counts", counts);
                acceleration(run, 0, cycles)
            };
            let all = turn(run, 1.0, 1_000);
            for (share, wanted) in [
                (0.5, 0.5),
                (0.1, 0.1),
                (0.0, 1.0),
                (-1.0, 1.0),
                (2.0, 1.0),
                (f64::NAN, 1.0),
            ] {
                let most = turn(run, share, 2_000) / all;
                assert!((0.95..1.001).contains(&(most / wanted)), "{share}: {most}");
            }
            // What ends it otherwise has all of it.
            let most = turn(run, 0.1, 350) / all;
            assert!((0.95..1.001).contains(&(most / 0.1)), "{most}");
            assert!(run.operator.live().velocity_mm_s > 20.0);
            set(run, "motion.feed-hold", true);
            let most = acceleration(run, 0, 300) / all;
            assert!(most > 0.3, "{most}");
            set(run, "axis.x.jog-enable", false);
            rest(run);
        });
    }
}

#[test]
fn pins_keep_jogs_from_beginning_and_end_them() {
    homed(MILL, |run| {
        set(run, "halui.axis.jog-speed", 1200.0);
        set(run, "axis.x.jog-scale", 0.01);
        set(run, "axis.x.jog-enable", true);
        wait(run, 5);
        let mut counts = 0;
        let mut turn = |run: &mut Rehearsal<'_>| {
            counts += 100;
            set(run, "axis.x.jog-counts", counts);
        };
        for pin in [
            "motion.jog-inhibit",
            "motion.jog-stop",
            "motion.jog-stop-immediate",
            "motion.feed-hold",
        ] {
            let begin = [at(run, 0), at(run, 1)];
            set(run, pin, true);
            wait(run, 2);
            assert!(run.operator.live().jog_barred);
            turn(run);
            set(run, "halui.axis.y.plus", true);
            wait(run, 300);
            assert_eq!(
                (run.control.state(), at(run, 0), at(run, 1)),
                (State::Ready, begin[0], begin[1]),
                "{pin}"
            );
            set(run, pin, false);
            wait(run, 300);
            assert_eq!(
                (at(run, 0), at(run, 1)),
                (begin[0], begin[1]),
                "{pin}: what was wanted meanwhile is forgotten"
            );
            set(run, "halui.axis.y.plus", false);
            wait(run, 5);
            assert!(!run.operator.live().jog_barred);
        }
        // One that runs goes on when new ones are kept from beginning, and ends by the others.
        let away = if at(run, 1) > 100.0 {
            "halui.axis.y.minus"
        } else {
            "halui.axis.y.plus"
        };
        let mut ways = Vec::new();
        for (pin, ends) in [
            ("motion.jog-inhibit", false),
            ("motion.jog-stop", true),
            ("motion.jog-stop-immediate", true),
        ] {
            set(run, away, true);
            wait(run, 400);
            assert!((run.operator.live().velocity_mm_s - 20.0).abs() < 1e-6);
            let from = at(run, 1);
            set(run, pin, true);
            wait(run, 300);
            assert_eq!(run.operator.live().velocity_mm_s == 0.0, ends, "{pin}");
            ways.push((at(run, 1) - from).abs());
            set(run, pin, false);
            wait(run, 300);
            assert_eq!(
                run.operator.live().velocity_mm_s == 0.0,
                ends,
                "{pin}: the key has to be let go"
            );
            set(run, away, false);
            rest(run);
        }
        assert!(ways[2] < ways[1] && ways[1] < ways[0], "{ways:?}");
    });
}

#[test]
fn before_a_joint_is_homed_its_own_wheel_moves_it_slowly_and_that_of_its_axis_does_not() {
    let config = config::parse(MILL, Path::new("machine.toml")).unwrap();
    rehearse_with(&config, b"", NetConfig::clean(3), Operator::standing_by, |run| {
        assert!(run.run_until(CYCLES_MAX, |run| run.control.state() == State::Disabled)?);
        let now_ns = run.now_ns();
        assert!(run.operator.begin(now_ns, Job::On));
        rest(run);
        let begin = at(run, 0);
        set(run, "halui.axis.jog-speed", 1200.0);
        for wheel in ["axis.x", "joint.0"] {
            set(run, &format!("{wheel}.jog-scale"), 0.1);
            set(run, &format!("{wheel}.jog-enable"), true);
        }
        wait(run, 5);
        set(run, "axis.x.jog-counts", 50);
        set(run, "halui.axis.x.plus", true);
        wait(run, 300);
        assert_eq!((run.control.state(), at(run, 0)), (State::Ready, begin));
        set(run, "joint.0.jog-counts", 50);
        let mut fastest: f64 = 0.0;
        for _ in 0..1_000 {
            wait(run, 1);
            fastest = fastest.max(run.operator.live().velocity_mm_s);
        }
        assert!((fastest - 15.0).abs() < 1e-6, "a tenth of 150: {fastest}");
        assert!((at(run, 0) - begin - 5.0).abs() < 1e-9, "{}", at(run, 0) - begin);
        // No more than half a second ahead at that speed.
        set(run, "joint.0.jog-counts", 100_000);
        wait(run, 3_000);
        let way = at(run, 0) - begin - 5.0;
        assert!((way - 7.5).abs() < 1e-9, "{way}");
        Ok(())
    })
    .unwrap();
}

/// An increment of X by 200 mm at 150 mm/s, which a hand has to be on.
fn increment() -> Command {
    Command::Jog(JogOrder {
        acceleration_share: 1.0,
        unhomed: false,
        joints: 1,
        axis: None,
        motion: JogMotion::Advance {
            distance_mm: 200.0,
            velocity_mm_s: 150.0,
        },
    })
}

#[test]
fn a_wheel_knows_nothing_of_an_increment_that_an_emergency_stop_has_ended() {
    homed(MILL, |run| {
        run.operator.give(increment());
        wait(run, 150);
        assert_eq!(run.control.state(), State::Jogging);
        run.operator.estop();
        let reach = |run: &mut Rehearsal<'_>, state| {
            assert!(run.run_until(CYCLES_MAX, |run| run.control.state() == state).unwrap());
        };
        reach(run, State::Estop);
        run.operator.give(Command::EstopReset);
        reach(run, State::Disabled);
        wait(run, 20);
        let now_ns = run.now_ns();
        assert!(run.operator.begin(now_ns, Job::On));
        rest(run);
        let begin = at(run, 0);
        set(run, "axis.x.jog-scale", 0.1);
        set(run, "axis.x.jog-enable", true);
        wait(run, 5);
        set(run, "axis.x.jog-counts", 1);
        wait(run, 2_000);
        assert!((at(run, 0) - begin - 0.1).abs() < 1e-9, "{}", at(run, 0) - begin);
    });
}

#[test]
fn a_wheel_that_rests_is_no_hand_on_the_jog_of_somebody_else() {
    homed(MILL, |run| {
        set(run, "axis.x.jog-enable", true);
        wait(run, 5);
        let begin = at(run, 0);
        run.operator.give(increment());
        wait(run, 3_000);
        let way = at(run, 0) - begin;
        assert!(way > 5.0 && way < 60.0, "let go after 0.2 s: {way}");
        assert_eq!(run.control.state(), State::Ready);
    });
}

#[test]
fn an_emergency_stop_behind_a_reset_is_not_reset_by_it() {
    homed(MILL, |run| {
        let reach = |run: &mut Rehearsal<'_>, state| {
            assert!(run.run_until(CYCLES_MAX, |run| run.control.state() == state).unwrap());
        };
        run.operator.estop();
        reach(run, State::Estop);
        run.operator.give(Command::EstopReset);
        reach(run, State::Disabled);
        run.operator.estop();
        reach(run, State::Estop);
        wait(run, 200);
        assert_eq!(run.control.state(), State::Estop);
        // Both at once: the stop counts.
        set(run, "halui.estop.activate", true);
        set(run, "halui.estop.reset", true);
        wait(run, 200);
        assert_eq!(run.control.state(), State::Estop);
        // Where other orders leave no room, too.
        run.operator.give(Command::EstopReset);
        reach(run, State::Disabled);
        for _ in 0..1_000 {
            run.operator.give(Command::Hold);
        }
        run.operator.estop();
        wait(run, 2);
        assert_eq!(run.control.state(), State::Estop);
    });
}
