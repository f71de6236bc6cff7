//! What drives tell of safety circuits and limit switches, on virtual time: sign of a drive to what the machine does.

use cia402::State as Power;
use isocnc::config;
use isocnc::machine::sequence::{Job, Step};
use isocnc::machine::state::State;
use isocnc::machine::tables::Tables;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::{Rehearsal, rehearse_with};
use isocnc::program::{Begin, home};
use isocnc::rt::joint_jog::{JogMotion, JogOrder};
use isocnc::rt::shared::Command;
use isocnc::sim::NetConfig;
use std::path::Path;

const MILL: &str = include_str!("../configs/mill3-demo.toml");
const PART: &str = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5 Z0\nG1 X200 F3000\nM2\n";
const CYCLES_MAX: u64 = 60_000;
/// Cycles from a sign in a drive to what the control does: the drive's own period, and the frame that takes it there.
const CYCLES_OF_A_SIGN: u64 = 4;

/// The demo mill with more keys for each joint and more tables, standing by with its network up.
fn stand_by(of_joints: &str, tables: &str, act: impl FnOnce(&mut Rehearsal<'_>)) {
    let machine = MILL.replace("[[joint]]", &format!("[[joint]]\n{of_joints}")) + tables;
    let config = config::parse(&machine, Path::new("machine.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    rehearse_with(
        &config,
        PART.as_bytes(),
        NetConfig::clean(5),
        Operator::standing_by,
        |run| {
            reach(run, "disabled", |run| run.control.state() == State::Disabled);
            act(run);
            for peaks in run.control.peaks() {
                assert_eq!(peaks.over, [0; 3], "{peaks:?}");
            }
            Ok(())
        },
    )
    .unwrap();
}

fn reach(run: &mut Rehearsal<'_>, what: &str, done: impl FnMut(&mut Rehearsal<'_>) -> bool) {
    let reached = run.run_until(CYCLES_MAX, done).unwrap();
    assert!(reached, "never {what}: {:#?}", run.operator.journal());
}

fn wait(run: &mut Rehearsal<'_>, cycles: u64) {
    assert!(!run.run_until(cycles, |_| false).unwrap());
}

fn begin(run: &mut Rehearsal<'_>, job: Job) {
    let now_ns = run.now_ns();
    assert!(run.operator.begin(now_ns, job));
}

/// Homed, drives on, then in `state`.
fn bring_to(run: &mut Rehearsal<'_>, state: State) {
    let home = run.operator.homing_order(run.operator.not_homed());
    if matches!(state, State::Running | State::Held) {
        begin(run, Job::Program { home, runs: 1 });
        reach(run, "cutting", |run| {
            let live = run.operator.live();
            live.line == 3 && live.velocity_mm_s > 40.0
        });
        if state == State::Held {
            run.operator.give(Command::Hold);
        }
    } else {
        begin(run, Job::Home(home));
        let is_homed = |run: &mut Rehearsal<'_>| run.control.state() == State::Ready && run.operator.not_homed() == 0;
        reach(run, "homed", is_homed);
        if state == State::Jogging {
            jog(run, 20.0);
            wait(run, 150);
        }
    }
    reach(run, "there", |run| run.control.state() == state);
}

/// X by hand at a velocity, for as long as an order holds.
fn jog(run: &mut Rehearsal<'_>, velocity_mm_s: f64) {
    run.operator.give(Command::Jog(JogOrder {
        acceleration_share: 1.0,
        unhomed: false,
        joints: 1,
        axis: None,
        motion: JogMotion::Run { velocity_mm_s },
    }));
}

fn powers(run: &mut Rehearsal<'_>) -> [Option<Power>; 3] {
    [1, 2, 3].map(|id| run.net().machine().drive_state(id))
}

fn loads(run: &mut Rehearsal<'_>) -> [f64; 3] {
    [0, 1, 2].map(|joint| run.net().machine().joint_position_mm(joint).unwrap())
}

fn set_sto(run: &mut Rehearsal<'_>, open: bool, faults: bool) {
    let drive = run.net().machine_mut().drive_injected(1).unwrap();
    (drive.sto_open, drive.sto_faults) = (open, faults);
}

fn cause(run: &Rehearsal<'_>) -> String {
    run.operator
        .alarm()
        .map(|alarm| alarm.cause.text.clone())
        .unwrap_or_default()
}

/// Once with a drive that is SWITCH ON DISABLED then, once with one that takes it for a fault; the sign by a 1, by a 0.
#[test]
fn the_safety_circuit_of_a_drive_is_the_emergency_stop_chain() {
    let mut reached = 0;
    for (faults, state) in [false, true].into_iter().flat_map(|faults| {
        [
            State::Disabled,
            State::Ready,
            State::Jogging,
            State::Running,
            State::Held,
        ]
        .map(|state| (faults, state))
    }) {
        stand_by("sto = { object = \"0x60FD\", bit = 3 }", "", |run| {
            if state != State::Disabled {
                bring_to(run, state);
            }
            set_sto(run, true, faults);
            let soon = run.run_until(CYCLES_OF_A_SIGN, |run| run.control.state() == State::Estop);
            assert!(soon.unwrap(), "from {state:?}: {:?}", run.control.state());
            wait(run, 1_000);
            let told = cause(run);
            assert!(told.contains("axis X") && told.contains("(STO)"), "{told}");
            assert!(
                !powers(run).contains(&Some(Power::OperationEnabled)),
                "{:?}",
                powers(run)
            );
            let rest = loads(run);
            // Nothing gets on while it is open.
            run.operator.reset_estop();
            wait(run, 500);
            assert_eq!((run.control.state(), loads(run)), (State::Estop, rest));
            set_sto(run, false, faults);
            wait(run, 500);
            assert_eq!((run.control.state(), loads(run)), (State::Estop, rest));
            run.operator.reset_estop();
            reach(run, "off", |run| run.control.state() == State::Disabled);
            wait(run, 500);
            assert_eq!((run.control.state(), loads(run)), (State::Disabled, rest));
            if state != State::Disabled {
                assert_eq!(run.operator.not_homed(), 0, "its place was read all the time");
            }
            begin(run, Job::On);
            reach(run, "on", |run| run.control.state() == State::Ready);
            reached += 1;
        });
    }
    assert_eq!(reached, 10);
    // Another drive tells it by a 0.
    stand_by("sto = { object = \"0x60FD\", bit = 7, active = false }", "", |run| {
        wait(run, 100);
        assert_eq!(run.control.state(), State::Estop);
    });
}

#[test]
fn a_drive_that_does_not_get_on_for_its_safety_circuit_says_so() {
    for under_power in [false, true] {
        stand_by("", "", |run| {
            if under_power {
                bring_to(run, State::Ready);
            }
            set_sto(run, true, false);
            wait(run, 10);
            if !under_power {
                begin(run, Job::On);
            }
            reach(run, "faulted", |run| run.control.state() == State::Faulted);
            wait(run, 100);
            let told = cause(run);
            assert!(
                told.contains("axis X") && told.contains("safety circuit (STO)"),
                "{told}"
            );
        });
    }
}

#[test]
fn drives_are_switched_off_at_once_where_the_file_says_so() {
    for (tables, at_once) in [("", false), ("[estop]\ncategory = 0\n", true)] {
        stand_by("", tables, |run| {
            bring_to(run, State::Running);
            run.operator.give(Command::Estop);
            let mut seen = Vec::new();
            let off = |run: &mut Rehearsal<'_>| {
                let powers = powers(run);
                seen.push(powers);
                powers == [Some(Power::SwitchOnDisabled); 3]
            };
            reach(run, "off", off);
            let ramps = seen
                .iter()
                .flatten()
                .any(|power| *power == Some(Power::QuickStopActive));
            assert_eq!(ramps, !at_once, "{seen:?}");
            wait(run, 1_000);
            let rest = loads(run);
            run.operator.reset_estop();
            reach(run, "disabled", |run| run.control.state() == State::Disabled);
            begin(run, Job::On);
            reach(run, "on", |run| run.control.state() == State::Ready);
            let moved = (0..3)
                .map(|joint| (loads(run)[joint] - rest[joint]).abs())
                .fold(0.0, f64::max);
            assert!(moved < 0.01, "{moved}");
        });
    }
}

#[test]
fn limit_switches_that_a_drive_tells_of_stop_the_machine_and_let_it_be_jogged_off_them() {
    for (state, bits) in [State::Jogging, State::Running, State::Held]
        .into_iter()
        .flat_map(|state| [0b01, 0b10, 0b11].map(|bits| (state, bits)))
    {
        stand_by("limit_switches = \"drive\"", "", |run| {
            bring_to(run, state);
            let set = |run: &mut Rehearsal<'_>, bits| {
                run.net().machine_mut().drive_injected(1).unwrap().digital_inputs = bits;
            };
            set(run, bits);
            reach(run, "faulted", |run| run.control.state() == State::Faulted);
            wait(run, 500);
            let end = if bits == 0b10 { "upper" } else { "lower" };
            let told = cause(run);
            assert!(told.contains("axis X") && told.contains(end), "{told}");
            let shown: [bool; 2] =
                ["joint.0.neg-hard-limit", "joint.0.pos-hard-limit"].map(|pin| run.hal.reader(pin).unwrap().get());
            assert_eq!(shown, [bits & 1, bits >> 1].map(|bit| bit == 1));
            run.operator.acknowledge();
            reach(run, "off", |run| run.control.state() == State::Disabled);
            begin(run, Job::On);
            reach(run, "on", |run| run.control.state() == State::Ready);
            for (velocity_mm_s, in_the_way) in [(-10.0, 0b01), (10.0, 0b10)] {
                let before = loads(run)[0];
                jog(run, velocity_mm_s);
                wait(run, 1_000);
                let way = (loads(run)[0] - before) / velocity_mm_s;
                assert_eq!(way > 0.05, bits & in_the_way == 0, "{bits:b} {velocity_mm_s}: {way}");
                assert!(way > -1e-3, "never the other way: {way}");
                assert_eq!(run.control.state(), State::Ready);
            }
            // Open again it can go either way.
            set(run, 0);
            wait(run, 10);
            jog(run, if bits == 0b10 { 10.0 } else { -10.0 });
            wait(run, 100);
            assert_eq!(run.control.state(), State::Jogging);
        });
    }
}

#[test]
fn a_spindle_switched_on_by_hand_stands_behind_a_fault_until_it_is_told_anew() {
    stand_by("limit_switches = \"drive\"", "", |run| {
        bring_to(run, State::Ready);
        let machine = MILL.replace("[[joint]]", "[[joint]]\nlimit_switches = \"drive\"");
        let config = config::parse(&machine, Path::new("machine.toml")).unwrap();
        let from = Begin::Mdi {
            at: home(&config),
            modes: None,
        };
        run.set_program(b"M3 S800\n", Tables::read(&config).unwrap(), from, true);
        reach(run, "standing by", |run| run.operator.step() == Step::StandBy);
        begin(run, Job::Program { home: vec![], runs: 1 });
        let on = run.hal.reader::<bool>("spindle.0.on").unwrap();
        reach(run, "turning by hand", |run| {
            on.get() && run.control.state() == State::Ready
        });
        run.net().machine_mut().drive_injected(1).unwrap().digital_inputs = 1;
        reach(run, "faulted", |run| run.control.state() == State::Faulted);
        wait(run, 10);
        assert!(!on.get());
        run.operator.acknowledge();
        reach(run, "off", |run| run.control.state() == State::Disabled);
        reach(run, "standing by", |run| run.operator.step() == Step::StandBy);
        begin(run, Job::On);
        reach(run, "on", |run| run.control.state() == State::Ready);
        wait(run, 100);
        assert!(!on.get());
    });
}
