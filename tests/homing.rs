//! Homing by the control, on virtual time: switches of the simulated machine, positions against its loads.

use isocnc::config::{self, Config, HomingBy, HomingByControl};
use isocnc::machine::sequence::{Job, Outcome, Step};
use isocnc::machine::state::State;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::{Rehearsal, rehearse, rehearse_with};
use isocnc::rt::joint_jog::{JogMotion, JogOrder};
use isocnc::rt::shared::Command;
use isocnc::sim::{Disturbance, NetConfig};
use std::path::Path;

const MACHINE: &str = include_str!("../configs/gantry-demo.toml");
const PART: &str = "G21 G90 G94 G54\nG0 X30 Y40 Z20\nG1 X60 Y45 F3000\nG3 X60 Y65 J10\nM2\n";
const CYCLES_MAX: u64 = 120_000;
const CYCLE_S: f64 = 1e-3;
/// `resolution_mm` where the file does not say, and an increment of drive and command.
const RESOLUTION_MM: f64 = 1e-3 + 2e-4;
const JOINTS: usize = 4;
const X: usize = 0;
const LEFT: usize = 1;
const RIGHT: usize = 2;
const Z: usize = 3;

fn machine() -> Config {
    machine_with(&[])
}

/// The example with some places of its text changed.
fn machine_with(changes: &[(&str, &str)]) -> Config {
    let mut text = MACHINE.to_owned();
    for (old, new) in changes {
        assert_eq!(text.matches(old).count(), 1, "{old}");
        text = text.replace(old, new);
    }
    config::parse(&text, Path::new("gantry-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

fn control_of(config: &mut Config, joint: usize) -> &mut HomingByControl {
    match &mut config.joints[joint].homing.by {
        HomingBy::Control(control) => control,
        HomingBy::Drive { .. } => panic!("joint {joint} homes by its drive"),
    }
}

fn rehearse_on<T>(config: &Config, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    rehearse(config, PART.as_bytes(), NetConfig::clean(1), |run| Ok(act(run))).expect("a machine to rehearse on")
}

/// A machine in the hands of the operator, its drives off.
fn by_hand<T>(config: &Config, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    let net = NetConfig::clean(1);
    rehearse_with(config, PART.as_bytes(), net, Operator::standing_by, |run| {
        reach(run, "up", |run| run.operator.live().state == State::Disabled);
        Ok(act(run))
    })
    .expect("a machine to rehearse on")
}

fn reach(run: &mut Rehearsal<'_>, what: &str, done: impl FnMut(&mut Rehearsal<'_>) -> bool) {
    let reached = run.run_until(CYCLES_MAX, done).expect("a good program");
    assert!(reached, "never {what}: {:#?}", run.operator.journal());
}

fn reach_homing(run: &mut Rehearsal<'_>, joint: usize) {
    let mut before_mm = None;
    reach(run, "homing", |run| {
        let at_mm = shown(run, joint);
        let moves = before_mm.is_some_and(|before_mm: f64| (at_mm - before_mm).abs() > 1e-3);
        before_mm = Some(at_mm);
        run.control.state() == State::Homing && moves
    });
}

fn loads(run: &mut Rehearsal<'_>) -> [f64; JOINTS] {
    std::array::from_fn(|joint| run.net().machine().joint_position_mm(joint).expect("a joint"))
}

/// Where the control takes a joint to be.
fn shown(run: &Rehearsal<'_>, joint: usize) -> f64 {
    let name = format!("joint.{joint}.motor-pos-fb");
    run.hal.reader::<f64>(&name).expect("a pin").get()
}

fn is_homed(run: &Rehearsal<'_>, joint: usize) -> bool {
    let name = format!("joint.{joint}.homed");
    run.hal.reader::<bool>(&name).expect("a pin").get()
}

fn target(run: &Rehearsal<'_>, joint: usize) -> i64 {
    let name = format!("cia402.{joint}.drv-target-position");
    run.hal.reader::<i64>(&name).expect("a pin").get()
}

/// Positions are those of the loads.
fn assert_true(run: &mut Rehearsal<'_>, joints: &[usize]) {
    let loads = loads(run);
    for &joint in joints {
        let off_mm = shown(run, joint) - loads[joint];
        assert!(off_mm.abs() <= RESOLUTION_MM, "joint {joint} is {off_mm} mm off");
    }
}

fn assert_no_limit_was_broken(run: &Rehearsal<'_>) {
    for peaks in run.control.peaks() {
        assert_eq!(peaks.over, [0; 3], "{peaks:?}");
    }
}

/// Homing of all joints begins; drives are switched on before.
fn begin_homing(run: &mut Rehearsal<'_>) {
    let now_ns = run.now_ns();
    let order = run.operator.homing_order(u64::MAX);
    assert!(run.operator.begin(now_ns, Job::Home(order)));
}

fn stands_by_homed(run: &Rehearsal<'_>) -> bool {
    run.operator.step() == Step::StandBy && run.control.state() == State::Ready
}

fn homed_by_hand(run: &mut Rehearsal<'_>) {
    begin_homing(run);
    reach(run, "homed", |run| stands_by_homed(run));
}

#[test]
fn a_zero_mark_behind_the_switch_is_found_to_the_increment_again_and_again() {
    const OBJECTS: [&str; 2] = ["\"0x6040/16\", \"0x6060/8\", ", "\"0x6041/16\", \"0x6061/8\", "];
    for probe in [1, 2] {
        let rising = if probe == 1 { "0x60BA" } else { "0x60BC" };
        let config = machine_with(&[
            (
                "id = 1\nname = \"x-drive\"\nprofile = \"cia402\"\n",
                &format!(
                    "id = 1\nname = \"x-drive\"\nprofile = \"cia402\"\noutputs = [{}\"0x60B8/16\", \"0x607A/32\"]\n\
                     inputs = [{}\"0x60FD/32\", \"0x603F/16\", \"0x60B9/16\", \"{rising}/32\", \"0x6064/32\", \"0x60F4/32\"]\n",
                    OBJECTS[0], OBJECTS[1]
                ),
            ),
            (
                "switch_mm = -3.0 ",
                &format!("switch_mm = -3.0\nindex_distance_mm = 4.0\nindex_probe = {probe} # "),
            ),
        ]);
        by_hand(&config, |run| {
            for _ in 0..3 {
                homed_by_hand(run);
                assert!((shown(run, X) - 5.0).abs() < 1e-3, "{}", shown(run, X));
                // An increment of the drive is 0.0001 mm.
                let off_mm = shown(run, X) - loads(run)[X];
                assert!(off_mm.abs() < 1.5e-4, "probe {probe}: {off_mm}");
            }
            assert_no_limit_was_broken(run);
        });
    }
}

#[test]
fn a_machine_homes_by_its_switches_and_runs_its_program() {
    rehearse_on(&machine(), |run| {
        reach(run, "running", |run| run.control.state() == State::Running);
        for joint in 0..JOINTS {
            assert!(is_homed(run, joint), "joint {joint}");
        }
        assert_true(run, &[X, LEFT, RIGHT]);
        let [x_mm, left_mm, right_mm, _] = loads(run);
        for at_mm in [x_mm, left_mm, right_mm] {
            assert!((at_mm - 5.0).abs() <= RESOLUTION_MM, "home is 5: {at_mm}");
        }
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert_eq!(run.operator.alarms(), []);
        assert_no_limit_was_broken(run);
        // Work X60 Y65 Z20 plus G54.
        let at_mm = run.operator.recorder.samples().last().expect("a program ran").command;
        assert_eq!(at_mm.map(|mm| (mm * 1e6).round() * 1e-6), [80.0, 85.0, -40.0]);
        assert_true(run, &[X, LEFT, RIGHT]);
    });
}

#[test]
fn no_drive_is_told_to_jump_when_positions_begin_to_count() {
    let config = machine_with(&[("velocity_mm_s = 150.0", "velocity_mm_s = 150.0\nbacklash_mm = 0.04")]);
    let most = config.joints.iter().map(|joint| {
        let counts = f64::from(joint.counts_per_unit[0]);
        1.05 * joint.limits.velocity_mm_s * CYCLE_S * counts + 1.0
    });
    let most: Vec<f64> = most.collect();
    by_hand(&config, |run| {
        // The second time it stands beside its joint by half of the backlash, and homes from there.
        for _ in 0..2 {
            begin_homing(run);
            let mut before: Option<[(i64, bool); JOINTS]> = None;
            let mut homed = [0; JOINTS];
            reach(run, "homed", |run| {
                let now: [(i64, bool); JOINTS] =
                    std::array::from_fn(|joint| (target(run, joint), is_homed(run, joint)));
                if let Some(before) = before {
                    for joint in [X, LEFT, RIGHT] {
                        let way = (now[joint].0 - before[joint].0).abs();
                        assert!(way as f64 <= most[joint], "joint {joint}: {way} increments");
                        if now[joint].1 && !before[joint].1 {
                            assert_eq!(way, 0, "joint {joint}");
                            homed[joint] += 1;
                        }
                    }
                }
                before = Some(now);
                stands_by_homed(run)
            });
            assert_eq!(homed, [1, 1, 1, 0], "in the cycle that was looked at");
            // A way forth and back, which the backlash follows.
            for velocity_mm_s in [20.0, -20.0] {
                let motion = JogMotion::Run { velocity_mm_s };
                let order = JogOrder {
                    acceleration_share: 1.0,
                    unhomed: false,
                    joints: 1,
                    axis: None,
                    motion,
                };
                run.operator.give(Command::Jog(order));
                reach(run, "jogging", |run| run.control.state() == State::Jogging);
                reach(run, "at rest", |run| run.control.state() == State::Ready);
                // The switch was found on the way down, so that down the motor stands where the joint is.
                let side = if velocity_mm_s > 0.0 { 0.04 } else { 0.0 };
                let beside_mm = loads(run)[X] - shown(run, X);
                assert!(
                    (beside_mm - side).abs() <= RESOLUTION_MM,
                    "{velocity_mm_s}: {beside_mm}"
                );
            }
        }
        assert_eq!(run.operator.alarms(), []);
        assert_no_limit_was_broken(run);
    });
}

#[test]
fn answers_lost_at_the_switch_do_not_move_its_place() {
    // The first pass is fine enough: 4 mm/s in a cycle. Three answers of the node of the switch are lost just before it.
    const RESOLUTION_MM: f64 = 4e-3;
    let mut config = machine();
    for joint in [LEFT, RIGHT] {
        control_of(&mut config, joint).resolution_mm = RESOLUTION_MM;
    }
    by_hand(&config, |run| {
        begin_homing(run);
        let (mut before_mm, mut losses) = (loads(run)[LEFT], 0);
        reach(run, "homed", |run| {
            let at_mm = loads(run)[LEFT];
            let slow = (-0.0045..-0.0035).contains(&(at_mm - before_mm));
            before_mm = at_mm;
            if losses == 0 && slow && at_mm < -3.99 {
                losses += 1;
                let now_ns = run.now_ns();
                run.net().at(now_ns, Disturbance::DropPres { node: 10, count: 3 });
            }
            stands_by_homed(run)
        });
        assert_eq!(losses, 1);
        let off_mm = shown(run, LEFT) - loads(run)[LEFT];
        assert!(off_mm.abs() <= RESOLUTION_MM + 2e-4, "{off_mm} mm off");
        assert_eq!(run.operator.alarms(), []);
    });
}

#[test]
fn a_gantry_that_stands_askew_ends_square() {
    by_hand(&machine(), |run| {
        let before = loads(run);
        assert!((before[RIGHT] - before[LEFT] - 0.6).abs() < 1e-9, "{before:?}");
        begin_homing(run);
        let mut skew_mm = 0.0_f64;
        reach(run, "homed", |run| {
            let now = loads(run);
            skew_mm = skew_mm.max((now[RIGHT] - now[LEFT]).abs());
            stands_by_homed(run)
        });
        let after = loads(run);
        assert!((after[RIGHT] - after[LEFT]).abs() <= 2.0 * RESOLUTION_MM, "{after:?}");
        // The switches lie 0.8 mm apart.
        assert!(skew_mm < 0.81, "bent by {skew_mm} mm on the way");
        assert_true(run, &[X, LEFT, RIGHT]);
    });
}

#[test]
fn a_gantry_too_far_from_square_is_not_bent() {
    let config = machine_with(&[("start_mm = 120.6", "start_mm = 124.0")]);
    fails(
        &config,
        "axis Y (joint 2): not homed: the joints of the gantry are too far from square",
        &[LEFT, RIGHT],
        |run| {
            let loads = loads(run);
            let bent_mm = (loads[RIGHT] - loads[LEFT] - 4.0).abs();
            assert!(bent_mm < 1.6, "{bent_mm} mm");
        },
    );
}

/// Fails to home: the alarm with its cause, and these joints at rest and not homed.
fn fails(config: &Config, cause: &str, joints: &[usize], then: impl FnOnce(&mut Rehearsal<'_>)) {
    rehearse_on(config, |run| {
        reach(run, "faulted", |run| run.control.state() == State::Faulted);
        let at_rest = loads(run);
        for &joint in joints {
            assert!(!is_homed(run, joint), "joint {joint}");
        }
        then(run);
        let began_s = run.operator.live().elapsed_s;
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Faulted);
        let causes: Vec<&str> = run
            .operator
            .alarms()
            .iter()
            .map(|alarm| alarm.cause.text.as_str())
            .collect();
        assert_eq!(causes, [cause]);
        for (at_mm, now_mm) in at_rest.iter().zip(loads(run)) {
            assert!((at_mm - now_mm).abs() < 0.02, "{at_rest:?}");
        }
        assert_eq!(
            (run.operator.live().elapsed_s, run.operator.programs()),
            (began_s, 0),
            "no program ran"
        );
        assert_no_limit_was_broken(run);
    });
}

#[test]
fn a_switch_that_never_closes_is_an_alarm_with_the_name_of_the_joint() {
    let mut config = machine();
    control_of(&mut config, X).search_distance_mm = 100.0;
    let from_mm = config.sim.start * 600.0;
    fails(
        &config,
        "axis X (joint 0): not homed: no home switch within the search distance",
        &[X],
        |run| {
            let way_mm = from_mm - loads(run)[X];
            assert!((100.0..103.0).contains(&way_mm), "{way_mm}");
        },
    );
    // The cable of one side of the gantry is off: it runs on until the gantry may not be bent any more.
    let mut config = machine();
    config.nets.retain(|net| net.name != "y-right-home");
    let cause = "axis Y (joint 2): not homed: the joints of the gantry are too far from square";
    fails(&config, cause, &[LEFT, RIGHT], |_| {});
}

#[test]
fn a_switch_that_stays_closed_is_an_alarm() {
    rehearse_on(&machine(), |run| {
        reach_homing(run, LEFT);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::Inputs { node: 10, wired: 0b10 });
        reach(run, "faulted", |run| run.control.state() == State::Faulted);
        assert!(!is_homed(run, LEFT) && !is_homed(run, RIGHT));
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Faulted);
        let cause = &run.operator.alarms()[0].cause.text;
        assert_eq!(
            cause,
            "axis Y (joint 1): not homed: the home switch does not open when the joint leaves it"
        );
        assert_no_limit_was_broken(run);
    });
}

#[test]
fn a_drive_that_fails_while_another_joint_homes_stops_both() {
    rehearse_on(&machine(), |run| {
        reach_homing(run, X);
        run.run_until(500, |_| false).expect("no program yet");
        let now_ns = run.now_ns();
        let fault = Disturbance::DriveFault {
            node: 2,
            error_code: 0x7305,
        };
        run.net().at(now_ns, fault);
        reach(run, "stopping", |run| run.control.state() == State::Stopping);
        let (at_mm, speed_mm_s) = (shown(run, X), run.operator.live().velocity_mm_s);
        assert!(speed_mm_s > 30.0, "{speed_mm_s}");
        reach(run, "faulted", |run| run.control.state() == State::Faulted);
        // 60 mm/s end after v^1.5 / J^0.5, and the drive lags.
        let way_mm = (shown(run, X) - at_mm).abs();
        assert!(way_mm > 0.5 && way_mm < 2.0, "{way_mm}");
        assert!([X, LEFT, RIGHT].iter().all(|&joint| !is_homed(run, joint)));
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Faulted);
        let alarms = run.operator.alarms();
        assert!(
            alarms.len() == 1 && alarms[0].cause.text.starts_with("axis Y (joint 1): drive fault"),
            "{alarms:?}"
        );
        assert_no_limit_was_broken(run);
    });
}

#[test]
fn a_stop_ends_homing_at_rest_and_the_next_one_begins_anew() {
    by_hand(&machine(), |run| {
        begin_homing(run);
        reach_homing(run, X);
        let now_ns = run.now_ns();
        run.operator.stop(now_ns);
        reach(run, "stopping", |run| run.control.state() == State::Stopping);
        reach(run, "off", |run| {
            run.control.state() == State::Disabled && run.operator.step() == Step::StandBy
        });
        assert_eq!(run.operator.alarms(), []);
        assert!([X, LEFT, RIGHT].iter().all(|&joint| !is_homed(run, joint)));
        assert!(is_homed(run, Z), "Z was homed before");
        assert_no_limit_was_broken(run);
        homed_by_hand(run);
        assert_true(run, &[X, LEFT, RIGHT]);
        assert_no_limit_was_broken(run);
    });
}

#[test]
fn soft_limits_hold_once_a_joint_is_homed_and_not_before_it_may_be_jogged() {
    let motion = JogMotion::Run { velocity_mm_s: -150.0 };
    let order = JogOrder {
        acceleration_share: 1.0,
        unhomed: false,
        joints: 1,
        axis: None,
        motion,
    };
    let jog = |run: &mut Rehearsal<'_>| {
        run.operator.give(Command::Jog(order));
        for _ in 0..20 {
            run.run_until(50, |_| false).expect("no program");
            let motion = JogMotion::Keep;
            let keep = JogOrder {
                acceleration_share: 1.0,
                unhomed: false,
                joints: u64::MAX,
                axis: None,
                motion,
            };
            run.operator.give(Command::Jog(keep));
        }
        reach(run, "at rest", |run| run.control.state() == State::Ready);
    };
    by_hand(&machine(), |run| {
        let now_ns = run.now_ns();
        assert!(run.operator.begin(now_ns, Job::On));
        reach(run, "on", |run| run.control.state() == State::Ready);
        let before = loads(run);
        jog(run);
        assert_eq!(loads(run), before, "not homed");
        homed_by_hand(run);
        jog(run);
        assert!(loads(run)[X].abs() <= RESOLUTION_MM, "{}", loads(run)[X]);
        assert_eq!(run.operator.alarms(), []);
        assert_no_limit_was_broken(run);
    });
}

#[test]
fn a_stop_while_a_drive_homes_beside_the_control_ends_both() {
    let config = machine_with(&[(
        "position_mm = 5.0               # where",
        "sequence = 0\nposition_mm = 5.0 # where",
    )]);
    by_hand(&config, |run| {
        let begin = loads(run);
        begin_homing(run);
        reach(run, "both on their way", |run| {
            let now = loads(run);
            (now[X] - begin[X]).abs() > 20.0 && (now[Z] - begin[Z]).abs() > 5.0
        });
        let at_mm = loads(run);
        let now_ns = run.now_ns();
        run.operator.stop(now_ns);
        reach(run, "off", |run| {
            run.operator.step() == Step::StandBy && run.control.state() == State::Disabled
        });
        let rest = loads(run);
        for joint in [X, Z] {
            assert!(!is_homed(run, joint), "joint {joint}");
            let way_mm = (rest[joint] - at_mm[joint]).abs();
            assert!(way_mm < 6.0, "joint {joint}: {way_mm} mm");
        }
        assert_eq!(run.operator.alarms(), []);
        assert_no_limit_was_broken(run);
        homed_by_hand(run);
        assert_true(run, &[X, LEFT, RIGHT]);
    });
}

#[test]
fn joints_home_in_the_order_of_their_numbers_and_by_whom_makes_no_difference() {
    // X with Z, whose drive homes it; the gantry behind them.
    let config = machine_with(&[(
        "position_mm = 5.0               # where",
        "sequence = 0\nposition_mm = 5.0 # where",
    )]);
    assert_eq!(config.homing_order(), [0b1001, 0b0110]);
    by_hand(&config, |run| {
        let before = loads(run);
        begin_homing(run);
        let mut moved_together = false;
        reach(run, "X and Z homed", |run| {
            let now = loads(run);
            moved_together |= (now[X] - before[X]).abs() > 1.0 && (now[Z] - before[Z]).abs() > 1.0 && !is_homed(run, Z);
            assert_eq!((now[LEFT], now[RIGHT]), (before[LEFT], before[RIGHT]));
            is_homed(run, X) && is_homed(run, Z)
        });
        assert!(moved_together);
        reach(run, "homed", |run| stands_by_homed(run));
        assert_true(run, &[X, LEFT, RIGHT]);
        assert_eq!(run.operator.alarms(), []);
    });
}

#[test]
fn a_drive_that_was_away_is_not_homed_any_more() {
    by_hand(&machine(), |run| {
        homed_by_hand(run);
        let now_ns = run.now_ns();
        run.operator.off(now_ns);
        reach(run, "off", |run| {
            run.operator.step() == Step::StandBy && run.control.state() == State::Disabled
        });
        assert!(is_homed(run, X), "its encoder goes on counting");
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::PowerOff { node: 1 });
        reach(run, "forgotten", |run| !is_homed(run, X));
        assert!(is_homed(run, LEFT));
    });
}

/// CoreXY with a switch for X and one for Y, whose belts know nothing of either.
fn crossed() -> Config {
    let text = include_str!("../configs/corexy-demo.toml");
    let by_drive =
        "homing = { method = 37, search_mm_s = 10.0, latch_mm_s = 1.0, acceleration_mm_s2 = 500.0, position_mm = 0.0 }";
    let by_control = |switch_mm: f64, position_mm: f64| {
        format!(
            "homing = {{ by = \"control\", towards = \"negative\", switch_mm = {switch_mm}, position_mm = {position_mm}, \
             search_mm_s = 20.0, latch_mm_s = 2.0, search_distance_mm = 300.0 }}"
        )
    };
    let nets: String = [(0, 8, 0, 12.0), (1, 9, 1, 31.0)]
        .map(|(joint, input, number, start_mm)| {
            format!(
                "[[hal.net]]\nname = \"home-{number}\"\nsource = \"io.10.in-{input:02}\"\ntargets = [\"joint.{joint}.home-sw-in\"]\n\n\
                 [[sim.joint]]\njoint = {joint}\nnode = 10\ninput = {input}\nstart_mm = {start_mm}\n\n"
            )
        })
        .concat();
    let text = text
        .replacen(by_drive, &by_control(-1.5, 4.0), 1)
        .replacen(by_drive, &by_control(-2.5, 7.0), 1)
        .replacen(
            "[[joint]]",
            "[[bus.node]]\nid = 10\nname = \"io\"\nprofile = \"io\"\n\n[[joint]]",
            1,
        );
    config::parse(&format!("{text}\n{nets}"), Path::new("corexy-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn belts_of_corexy_home_by_the_switches_of_their_axes() {
    by_hand(&crossed(), |run| {
        let before = loads(run);
        let [x_mm, y_mm] = [before[0] + before[1], before[0] - before[1]].map(|sum| 0.5 * sum);
        assert!(
            x_mm > 5.0 && y_mm < -5.0,
            "one switch is far, the other closed: {x_mm}, {y_mm}"
        );
        homed_by_hand(run);
        assert_true(run, &[0, 1]);
        // X and Y at their home positions.
        let [first, second] = [0, 1].map(|joint| shown(run, joint));
        assert!((0.5 * (first + second) - 4.0).abs() < 1e-3 && (0.5 * (first - second) - 7.0).abs() < 1e-3);
        assert_eq!(run.operator.alarms(), []);
        assert_no_limit_was_broken(run);
        // Homed again, by the name of one belt: both move.
        let now_ns = run.now_ns();
        let order = run.operator.homing_order(1);
        assert!(run.operator.begin(now_ns, Job::Home(order)));
        reach_homing(run, 1);
        assert!(!is_homed(run, 0) && !is_homed(run, 1));
        reach(run, "homed again", |run| stands_by_homed(run));
        assert_true(run, &[0, 1]);
    });
}
