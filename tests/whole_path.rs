//! The whole path on virtual time: program text to simulated drives and back, with faults at chosen moments.
//!
//! Every run prints its seed; the same seed gives the same octets on the wire and the same bits in the trace.

use cia402::State as Power;
use isocnc::bus::Fieldbus;
use isocnc::config::{self, Config};
use isocnc::machine::sequence::{Outcome, Step};
use isocnc::machine::state::State;
use isocnc::machine::tables::Tables;
use isocnc::program::{Feeder, Progress, home, ring_capacity, stop_ramp};
use isocnc::rt::shared::Command;
use isocnc::sim::rehearsal::{Rehearsal, rehearse};
use isocnc::sim::{Disturbance, NetConfig};
use motion::canon::{Axis, Position};
use motion::plan::deviation;
use motion::rt::Interpolator;
use powerlink::nmt::NmtState;
use powerlink::wire::{Header, Soc, multicast};
use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hasher};
use std::path::Path;
use std::sync::{Arc, Mutex};

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const PART: &str = include_str!("../configs/short-part.ngc");
/// Node ids of the demo machine's drives: X, Y, Z.
const DRIVES: [u8; 3] = [1, 2, 3];
/// Where [`PART`] ends, machine coordinates: work X21 Y16 Z20 plus G54.
const PART_END: [f64; 3] = [41.0, 36.0, -40.0];
/// A line of [`PART`] in the midst of the first contour.
const MIDST: u32 = 18;
/// No run of these programs takes longer, waits of the sequence included.
const CYCLES_MAX: u64 = 60_000;
/// Time after which drives without a managing node have stopped and reset.
const AFTERMATH_NS: u64 = 1_000_000_000;
const CYCLE_S: f64 = 1e-3;
/// Positions are numbers around 100: their rounding, in a difference of third order.
const ROUNDING_MM: f64 = 1e-12;

fn machine() -> Config {
    let mut config = config::parse(MACHINE, Path::new("mill3-demo.toml")).expect("a good machine file");
    // That of a machine on a PC of its own; the demo's own number is for PCs that stand still at times.
    config.bus.pres_lost_max = 3;
    config
}

/// Rehearses `text` on the demo machine.
fn rehearse_part<T>(net: NetConfig, text: &str, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    rehearse_on(&machine(), net, text, act)
}

/// A machine whose program is still being planned in its midst, so that it is not over when the drives are switched off.
fn planning_late() -> Config {
    let mut config = machine();
    config.program.planner = motion::plan::Slope::Classic;
    config.program.look_ahead_blocks = 1000;
    config
}

fn rehearse_on<T>(config: &Config, net: NetConfig, text: &str, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    println!("seed {}", net.seed);
    rehearse(config, text.as_bytes(), net, |run| Ok(act(run))).expect("a machine that can be rehearsed")
}

/// To the end of everything; a panic with the journal if there is none.
fn finish(run: &mut Rehearsal<'_>) -> Outcome {
    let outcome = run.run(CYCLES_MAX).expect("an end");
    println!("{outcome:?}\n{}", journal(run));
    assert_eq!((run.control.notices_lost(), run.control.trace_lost()), (0, 0));
    outcome
}

/// Up to the moment at which `done` holds.
fn reach(run: &mut Rehearsal<'_>, what: &str, done: impl FnMut(&mut Rehearsal<'_>) -> bool) {
    let reached = run.run_until(CYCLES_MAX, done).expect("a good program");
    assert!(reached, "never {what}:\n{}", journal(run));
}

fn reach_state(run: &mut Rehearsal<'_>, state: State) {
    reach(run, state.name(), |run| run.control.state() == state);
}

fn reach_midst(run: &mut Rehearsal<'_>) {
    reach(run, "in the midst of the program", |run| {
        run.operator.live().line >= MIDST
    });
}

fn journal(run: &Rehearsal<'_>) -> String {
    let mut text = String::new();
    for entry in run.operator.journal() {
        writeln!(text, "{:9.3} {}", entry.time_s, entry.text).expect("a string takes everything");
    }
    text
}

fn commands(run: &Rehearsal<'_>) -> Vec<[f64; 3]> {
    let samples = run.operator.recorder.samples();
    samples.iter().map(|sample| sample.command).collect()
}

/// Greatest velocity, acceleration and jerk of each joint, from differences of neighbouring cycles.
fn peaks(commands: &[[f64; 3]]) -> [[f64; 3]; 3] {
    let mut peaks = [[0.0_f64; 3]; 3];
    for window in commands.windows(4) {
        for (joint, peaks) in peaks.iter_mut().enumerate() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|index: usize| window[index][joint]);
            let differences = [d - c, d - 2.0 * c + b, d - 3.0 * c + 3.0 * b - a];
            let mut power = 1.0;
            for (peak, difference) in peaks.iter_mut().zip(differences) {
                power *= CYCLE_S;
                *peak = peak.max((difference.abs() - 8.0 * ROUNDING_MM) / power);
            }
        }
    }
    peaks
}

/// Joints follow the axes X, Y, Z on this machine. `stop`: within the limits of stops, else within those of programs.
fn assert_within_limits(commands: &[[f64; 3]], stop: bool) {
    assert!(commands.len() > 100, "a program ran: {} cycles", commands.len());
    for (joint, (peaks, limits)) in peaks(commands).iter().zip(&machine().joints).enumerate() {
        let [acceleration, jerk] = if stop {
            [limits.stop.acceleration_mm_s2, limits.stop.jerk_mm_s3]
        } else {
            [limits.limits.acceleration_mm_s2, limits.limits.jerk_mm_s3]
        };
        for (peak, limit) in peaks.iter().zip([limits.limits.velocity_mm_s, acceleration, jerk]) {
            assert!(*peak <= limit * (1.0 + 1e-6), "joint {joint}: {peak} above {limit}");
        }
    }
}

fn assert_on_path(run: &Rehearsal<'_>) {
    let tolerance_mm = machine().program.tolerance_mm;
    let points: Vec<Position> = commands(run).iter().map(|&[x, y, z]| Position::xyz(x, y, z)).collect();
    let off_mm = deviation(&points, run.path(), tolerance_mm).off_mm;
    assert!(off_mm <= tolerance_mm + 1e-9, "{off_mm} mm off the path");
}

/// Ends of the command: at rest, for joints that stand from the last sample on have kept the limits of stops. Rest may be
/// reached in the midst of the last cycle.
fn assert_ends_at_rest(commands: &[[f64; 3]]) {
    let last = *commands.last().expect("a program ran");
    let standing: Vec<[f64; 3]> = commands.iter().copied().chain([last; 3]).collect();
    assert_within_limits(&standing, true);
}

/// The network is down: whatever still had power gives it up by itself.
fn assert_powerless(run: &mut Rehearsal<'_>) {
    run.net().advance(AFTERMATH_NS);
    for id in DRIVES {
        let machine = run.net().machine();
        if machine.nmt_state(id) == Some(NmtState::Off) {
            continue;
        }
        let power = machine.drive_state(id).expect("a drive");
        assert!(
            matches!(power, Power::SwitchOnDisabled | Power::Fault),
            "drive {id} ends in {power:?}"
        );
    }
}

fn assert_part_cut(run: &mut Rehearsal<'_>) {
    let last = *commands(run).last().expect("a program ran");
    for (joint, (at_mm, end_mm)) in last.into_iter().zip(PART_END).enumerate() {
        assert!((at_mm - end_mm).abs() < 1e-9, "joint {joint} at {at_mm}, not {end_mm}");
        let load_mm = run.net().machine().joint_position_mm(joint).expect("a joint");
        assert!(
            (load_mm - end_mm).abs() < 0.01,
            "load {joint} at {load_mm}, not {end_mm}"
        );
    }
    assert_on_path(run);
}

fn lost(run: &mut Rehearsal<'_>) -> [u64; 3] {
    [0, 1, 2].map(|node| run.control.bus_mut().statistics(node).lost)
}

/// Disturbs the program in its midst now; it must come to rest on its path within the stop limits before any drive is
/// switched off by the control, and the whole run to an end. Returns the causes of all alarms.
fn fails_in_order(run: &mut Rehearsal<'_>, disturbance: Disturbance, alive: &[usize]) -> Vec<String> {
    reach_midst(run);
    assert_eq!(run.control.state(), State::Running);
    let now_ns = run.now_ns();
    run.net().at(now_ns, disturbance);
    reach_state(run, State::Stopping);
    reach(run, "at rest", |run| {
        for &joint in alive {
            let power = run.net().machine().drive_state(DRIVES[joint]);
            assert_eq!(power, Some(Power::OperationEnabled), "joint {joint} while stopping");
        }
        run.control.state() != State::Stopping
    });
    assert_eq!(run.control.state(), State::Faulted);
    assert_eq!(finish(run), Outcome::Faulted);
    let commands = commands(run);
    assert_ends_at_rest(&commands);
    assert_within_limits(&commands, true);
    assert_on_path(run);
    // Where the stop left them.
    let last = commands[commands.len() - 1];
    for &joint in alive {
        let load_mm = run.net().machine().joint_position_mm(joint).expect("a joint");
        assert!(
            (load_mm - last[joint]).abs() < 0.05,
            "load {joint} at {load_mm}, not {}",
            last[joint]
        );
    }
    assert_powerless(run);
    run.operator.alarms().iter().map(|alarm| alarm.cause.clone()).collect()
}

#[test]
fn a_clean_run_cuts_the_part_and_goes_through_every_step_once() {
    rehearse_part(NetConfig::clean(1), PART, |run| {
        let homed = [0, 1, 2].map(|joint| {
            run.hal
                .reader::<bool>(&format!("joint.{joint}.homed"))
                .expect("a pin of every joint")
        });
        let mut homed_at = [None; 3];
        let mut cycle = 0;
        reach(run, "running", |run| {
            cycle += 1;
            for (at, pin) in homed_at.iter_mut().zip(&homed) {
                if pin.get() {
                    at.get_or_insert(cycle);
                }
            }
            run.control.state() == State::Running
        });
        let [Some(x), Some(y), Some(z)] = homed_at else {
            panic!("not all homed: {homed_at:?}")
        };
        assert!(z < x && z < y, "Z clears the work first: {homed_at:?}");

        assert_eq!(finish(run), Outcome::Completed);
        assert_eq!(run.operator.alarms(), []);
        let steps: Vec<&str> = run
            .operator
            .journal()
            .iter()
            .map(|entry| entry.text.as_str())
            .filter(|text| text.starts_with("network") || text.starts_with("machine"))
            .collect();
        assert_eq!(
            steps,
            [
                "network booting",
                "network operational",
                "machine disabled",
                "machine enabling",
                "machine ready",
                "machine homing",
                "machine ready",
                "machine homing",
                "machine ready",
                "machine running",
                "machine ready",
                "machine disabling",
                "machine disabled",
                "machine shutting down",
                "network down",
                "machine down",
            ]
        );
        assert_part_cut(run);
        let commands = commands(run);
        // Homing comes to rest a little behind the switch, and the program starts where the machine stands.
        for (at_mm, home_mm) in commands[0].into_iter().zip(home(&machine()).0) {
            assert!((at_mm - home_mm).abs() < 0.1, "starts at {at_mm}");
        }
        assert_within_limits(&commands, false);
        assert_ends_at_rest(&commands);
        for peaks in run.control.peaks() {
            assert_eq!(peaks.over, [0; 3], "{peaks:?}");
        }
        run.net().advance(AFTERMATH_NS);
        for id in DRIVES {
            assert_eq!(run.net().machine().drive_state(id), Some(Power::SwitchOnDisabled));
        }
        assert_eq!(lost(run), [0; 3]);
        assert_eq!(run.operator.late_cycles(), 0);
        // The relays of spindle and coolant are open again.
        assert_eq!(run.net().machine().outputs(10), Some([0, 0]));
    });
}

/// What a run left: a digest of all frames with their times, the journal, the commands.
fn traces(seed: u64) -> (u64, String, Vec<[f64; 3]>) {
    rehearse_part(NetConfig::clean(seed), PART, |run| {
        let digest = Arc::new(Mutex::new(DefaultHasher::new()));
        let sink = Arc::clone(&digest);
        run.net().set_tap(Box::new(move |at_ns, frame| {
            let mut digest = sink.lock().expect("one thread");
            digest.write_u64(at_ns);
            digest.write(frame);
        }));
        assert_eq!(finish(run), Outcome::Completed);
        let digest = digest.lock().expect("one thread").finish();
        (digest, journal(run), commands(run))
    })
}

#[test]
fn one_seed_gives_one_run_and_another_the_same_path() {
    let (first, again, other) = (traces(7), traces(7), traces(8));
    assert!(first == again, "the same seed, another run");
    assert_ne!(first.0, other.0, "another seed, the same times on the wire");
    assert!(first.2 == other.2, "the wire has no say in the path");
}

#[test]
fn lost_answers_up_to_the_limit_are_counted_and_ridden_out() {
    let limit = machine().bus.pres_lost_max;
    assert_eq!(limit, 3);
    for count in [1, limit] {
        rehearse_part(NetConfig::clean(2), PART, |run| {
            reach_midst(run);
            let before = lost(run);
            assert_eq!(before, [0; 3]);
            let now_ns = run.now_ns();
            run.net().at(now_ns, Disturbance::DropPres { node: 2, count });
            assert_eq!(finish(run), Outcome::Completed);
            assert_eq!(lost(run), [0, u64::from(count), 0]);
            assert_eq!(run.operator.alarms(), []);
            assert_part_cut(run);
            assert_within_limits(&commands(run), false);
        });
    }
}

#[test]
fn more_lost_answers_than_the_limit_stop_all_joints_on_the_path() {
    rehearse_part(NetConfig::clean(3), PART, |run| {
        let causes = fails_in_order(run, Disturbance::DropPres { node: 2, count: 5 }, &[0, 2]);
        assert_eq!(causes, ["y-drive (node 2): lost, it does not answer any more"]);
        assert_eq!(lost(run)[0], 0);
    });
}

#[test]
fn a_node_dead_in_mid_program_stops_the_others_on_the_path() {
    for (node, alive, cause) in [
        (1, &[1, 2][..], "x-drive (node 1): lost, it does not answer any more"),
        (3, &[0, 1][..], "z-drive (node 3): lost, it does not answer any more"),
        (10, &[0, 1, 2][..], "io (node 10): lost, it does not answer any more"),
    ] {
        for disturbance in [Disturbance::PowerOff { node }, Disturbance::Unplug { node }] {
            rehearse_part(NetConfig::clean(4), PART, |run| {
                let causes = fails_in_order(run, disturbance, alive);
                assert_eq!(causes, [cause], "{disturbance:?}");
            });
        }
    }
}

#[test]
fn a_mandatory_node_that_never_answers_ends_the_boot_and_is_named() {
    rehearse_part(NetConfig::clean(5), PART, |run| {
        run.net().at(0, Disturbance::PowerOff { node: 2 });
        assert_eq!(finish(run), Outcome::TimedOut(Step::Network));
        assert!(journal(run).contains("y-drive (node 2) does not answer"));
        assert_eq!(commands(run), [[0.0; 3]; 0]);
    });
}

#[test]
fn a_mandatory_node_that_dies_during_boot_ends_it_and_is_named() {
    for at_ms in [655, 700, 800, 900, 963] {
        rehearse_part(NetConfig::clean(6), PART, |run| {
            println!("dies at {at_ms} ms");
            run.net().at(at_ms * 1_000_000, Disturbance::PowerOff { node: 2 });
            let outcome = finish(run);
            assert!(
                matches!(outcome, Outcome::TimedOut(Step::Network) | Outcome::Faulted),
                "{outcome:?}"
            );
            let named = journal(run).lines().any(|line| {
                line.contains("y-drive (node 2)") && !line.ends_with("found") && !line.ends_with("operational")
            });
            assert!(named, "{}", journal(run));
            assert_eq!(commands(run), [[0.0; 3]; 0]);
        });
    }
}

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
        let first = &run.operator.alarms()[0].cause;
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
        let cause = &run.operator.alarms()[0].cause;
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
            let first = &run.operator.alarms()[0].cause;
            assert!(first.starts_with(cause), "{first}");
            assert_eq!(commands(run), [[0.0; 3]; 0]);
            assert_powerless(run);
        });
    }
}

#[test]
fn late_cycles_cost_time_and_no_jump() {
    let clean = rehearse_part(NetConfig::clean(11), PART, |run| {
        assert_eq!(finish(run), Outcome::Completed);
        commands(run)
    });
    // A date that has passed by no more than half the cycle is still kept; what comes later waits for the next date on the grid.
    for (late_us, late_max_us, skipped) in [(400, 400, 0), (600, 0, 1), (4_100, 100, 4), (4_600, 0, 5)] {
        rehearse_part(NetConfig::clean(11), PART, |run| {
            reach_midst(run);
            run.cycle(late_us * 1000).expect("a good program");
            assert_eq!(finish(run), Outcome::Completed);
            assert_eq!(run.operator.late_cycles(), skipped, "late by {late_us} us");
            assert_eq!(
                run.operator.live().late_max_ns,
                late_max_us * 1000,
                "late by {late_us} us"
            );
            // One step of the trajectory for every cycle that ran: the very same set-points, only later.
            assert!(commands(run) == clean, "late by {late_us} us");
            assert_part_cut(run);
        });
    }
}

#[test]
fn many_overruns_are_told_of_and_too_many_stop_the_machine_on_the_path() {
    let mut config = machine();
    (config.rt.overruns_warn, config.rt.overruns_stop) = (5, 20);
    // Every so many cycles one is late by more than is kept.
    let run_late = |every: u64, outcome: Outcome| {
        rehearse_on(&config, NetConfig::clean(21), PART, |run| {
            reach_midst(run);
            let mut cycle = 0;
            while run.operator.outcome().is_none() {
                cycle += 1;
                let late_ns = if run.control.state() == State::Running && cycle % every == 0 {
                    600_000
                } else {
                    0
                };
                run.cycle(late_ns).expect("a good program");
            }
            assert_eq!(run.operator.outcome(), Some(outcome), "{}", journal(run));
            let commands = commands(run);
            assert_within_limits(&commands, outcome == Outcome::Faulted);
            assert_on_path(run);
            assert_ends_at_rest(&commands);
            let told = journal(run)
                .matches("warning: 6 of the last 1000 cycles were left out")
                .count();
            let alarms: Vec<String> = run.operator.alarms().iter().map(|alarm| alarm.cause.clone()).collect();
            (told, alarms, run.operator.late_cycles())
        })
    };
    let (told, alarms, late) = run_late(400, Outcome::Completed);
    assert_eq!((told, alarms.len()), (0, 0));
    assert!(late > 0);
    let (told, alarms, _) = run_late(60, Outcome::Completed);
    assert_eq!((told, alarms.len()), (1, 0));
    let (told, alarms, late) = run_late(20, Outcome::Faulted);
    assert_eq!((told, late), (1, 21));
    assert!(
        alarms[0].starts_with("21 of the last 1000 cycles were left out"),
        "{alarms:?}"
    );
}

#[test]
fn overruns_of_boot_up_do_not_count_against_the_machine() {
    let mut config = machine();
    (config.rt.overruns_warn, config.rt.overruns_stop) = (0, 20);
    rehearse_on(&config, NetConfig::clean(22), PART, |run| {
        let (mut cycles, mut late) = (0_u64, 0);
        while run.control.state() == State::Booting {
            cycles += 1;
            let is_late = cycles.is_multiple_of(5);
            late += u64::from(is_late);
            run.cycle(if is_late { 600_000 } else { 0 }).expect("a good program");
        }
        assert!(late > 100, "{late} late cycles");
        run.cycle(600_000).expect("a good program");
        assert_eq!(finish(run), Outcome::Completed, "{}", journal(run));
        assert_eq!(run.operator.late_cycles(), late + 1);
    });
}

/// A wave of short lines, far more of them than the planner takes at a time.
fn wave(lines: u32) -> String {
    let mut text = String::from("G21 G90 G94 G54 G64 P0.01\nG0 X0 Y50 Z0\nG1 F6000\n");
    for line in 1..=lines {
        let along = f64::from(line) * 0.2;
        // To and fro, so that any number of lines fits the machine.
        let x = (along % 480.0).min(480.0 - along % 480.0);
        writeln!(text, "X{x:.2} Y{:.4}", 50.0 + 20.0 * (along / 40.0).sin()).expect("a string takes everything");
    }
    text + "G0 X10 Y10\nM2\n"
}

#[test]
fn a_late_planner_makes_the_machine_wait_and_the_part_is_the_same() {
    let text = wave(4000);
    let config = machine();
    let mut waited = Vec::new();
    let [fed, starved] = [1, 1000].map(|feed_every| {
        rehearse_on(&config, NetConfig::clean(12), &text, |run| {
            run.feed_every = feed_every;
            assert_eq!(finish(run), Outcome::Completed);
            let commands = commands(run);
            assert_within_limits(&commands, false);
            assert_on_path(run);
            waited.push(run.operator.recorder.starved_cycles());
            commands
        })
    });
    // What the second run takes longer, but for the braking and speeding up.
    let longer = (starved.len() - fed.len()) as u64;
    assert!(
        waited[0] == 0 && waited[1] > longer / 2 && waited[1] < longer,
        "{waited:?} of {longer}"
    );
    for commands in [&fed, &starved] {
        let last = commands[commands.len() - 1];
        let off_mm = [30.0, 30.0, -60.0].iter().zip(last).map(|(end, at)| (end - at).abs());
        assert!(off_mm.fold(0.0, f64::max) < 1e-9, "ends at {last:?}");
    }
    // The machine waits at rest for what is planned late.
    assert!(
        starved.len() > fed.len() + 1000,
        "{} cycles, fed well {}",
        starved.len(),
        fed.len()
    );
}

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
fn a_noisy_wire_is_ridden_out() {
    for seed in [101, 102, 103] {
        let net = NetConfig {
            loss: 0.01,
            ..NetConfig::clean(seed)
        };
        // Losses of that share hit neighbouring polls all the time, but hardly ever more than the limit in a row.
        rehearse_part(net, PART, |run| {
            assert_eq!(finish(run), Outcome::Completed);
            assert_part_cut(run);
            assert_within_limits(&commands(run), false);
            assert!(lost(run).iter().sum::<u64>() > 100, "{:?}", lost(run));
        });
    }
}

#[test]
fn a_very_noisy_wire_never_hangs_the_machine() {
    for seed in 111..117 {
        let net = NetConfig {
            loss: 0.08,
            ..NetConfig::clean(seed)
        };
        rehearse_part(net, PART, |run| match finish(run) {
            Outcome::Completed => assert_part_cut(run),
            Outcome::Faulted => assert!(!run.operator.alarms().is_empty()),
            Outcome::TimedOut(step) => assert_eq!(step, Step::Network),
            Outcome::Stopped => panic!("nobody stopped it"),
        });
    }
}

#[test]
fn a_wire_that_corrupts_doubles_and_reorders_never_hangs_the_machine() {
    for seed in [201, 202, 203] {
        let net = NetConfig {
            loss: 0.002,
            duplicate: 0.01,
            reorder: 0.005,
            corrupt: 0.002,
            ..NetConfig::clean(seed)
        };
        rehearse_part(net, PART, |run| match finish(run) {
            Outcome::Completed => {
                let last = *commands(run).last().expect("a program ran");
                assert_eq!(last[Axis::X as usize], PART_END[0]);
            }
            Outcome::Faulted => assert!(!run.operator.alarms().is_empty()),
            Outcome::TimedOut(_) => {}
            Outcome::Stopped => panic!("nobody stopped it"),
        });
    }
}

/// Orders outside the sequence, and cycles until the machine has got where they lead.
fn order(run: &mut Rehearsal<'_>, command: Command, state: State) {
    run.operator.give(command);
    reach_state(run, state);
}

fn loads(run: &mut Rehearsal<'_>) -> [f64; 3] {
    [0, 1, 2].map(|joint| run.net().machine().joint_position_mm(joint).expect("a joint"))
}

/// Switches the drives off in mid-program: on the path to rest first, power off then.
fn disable_in_midst(run: &mut Rehearsal<'_>) {
    reach_midst(run);
    order(run, Command::Disable, State::Stopping);
    reach(run, "at rest", |run| {
        for id in DRIVES {
            let power = run.net().machine().drive_state(id);
            assert_eq!(power, Some(Power::OperationEnabled), "drive {id} while stopping");
        }
        run.control.state() != State::Stopping
    });
    reach_state(run, State::Disabled);
    // Records are fetched every few cycles.
    run.run_until(20, |_| false).expect("a good program");
    let commands = commands(run);
    assert_ends_at_rest(&commands);
    assert_within_limits(&commands, true);
    assert_on_path(run);
    assert_eq!(run.net().machine().outputs(10), Some([0, 0]));
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
        order(run, Command::Start(Box::new(program)), State::Faulted);
        run.run_until(100, |_| false).expect("a good program");
        for (at_mm, before_mm) in loads(run).into_iter().zip(before) {
            assert!((at_mm - before_mm).abs() < 0.01, "moved from {before_mm} to {at_mm}");
        }
        assert!(run.operator.alarms()[0].cause.starts_with("axis X (joint 0): command"));
    });
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
        order(run, Command::Start(Box::new(program)), State::Running);
        reach_state(run, State::Stopping);
        reach_state(run, State::Faulted);
        run.run_until(10, |_| false).expect("a good program");
        let cause = run.operator.alarms()[0].cause.clone();
        assert!(cause.starts_with("axis X (joint 0): commanded jerk "), "{cause}");
        assert!(cause.contains(&format!("above its limit, {limit:.1} mm/s³")), "{cause}");
    });
}

/// The drive is told what backlash and pitch error want; what is shown, and the way back into the program, know nothing of it.
#[test]
fn the_motor_stands_beside_its_joint_by_the_compensation_and_the_part_is_the_same() {
    const BACKLASH_MM: f64 = 0.4;
    let text = MACHINE.replacen(
        "following_error_mm = 2.0\n",
        "following_error_mm = 2.0\nbacklash_mm = 0.4\n",
        1,
    );
    let mut config = config::parse(&text, Path::new("mill3-demo.toml")).expect("a good machine file");
    config.bus.pres_lost_max = 3;
    rehearse_on(&config, NetConfig::clean(26), PART, |run| {
        let mut ends = None;
        let outcome = run.run_until(CYCLES_MAX, |run| {
            if run.operator.live().line >= MIDST {
                ends = Some((run.operator.live().position, loads(run)));
            }
            run.control.state() == State::Down
        });
        assert!(outcome.expect("a good program"));
        println!("{}", journal(run));
        assert_eq!(run.operator.alarms(), []);
        let commands = commands(run);
        assert_on_path(run);
        assert_within_limits(&commands, false);
        let (position, loads) = ends.expect("the program ran");
        let beside_mm = loads[0] - position[Axis::X];
        assert!(
            (beside_mm.abs() - BACKLASH_MM / 2.0).abs() < 0.01,
            "X {beside_mm} mm beside"
        );
        assert!((loads[1] - position[Axis::Y]).abs() < 0.01, "Y has none");
    });
}

#[test]
fn a_node_lost_while_the_drives_are_off_wants_an_acknowledge() {
    rehearse_part(NetConfig::clean(24), PART, |run| {
        disable_in_midst(run);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::Unplug { node: 10 });
        reach_state(run, State::Faulted);
        assert_eq!(finish(run), Outcome::Faulted);
        let causes: Vec<&str> = run.operator.alarms().iter().map(|alarm| alarm.cause.as_str()).collect();
        assert_eq!(causes, ["io (node 10): lost, it does not answer any more"]);
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

/// A SoC of another managing node arrives.
fn hear_foreign_master(run: &mut Rehearsal<'_>) {
    let header = Header::multicast(multicast::SOC, [2, 0, 0, 0, 0, 9], 240);
    let mut frame = [0; 60];
    let length = Soc::default().emit(&header, &mut frame).expect("room for a SoC");
    run.net().inject(&frame[..length]);
}

#[test]
fn another_managing_node_is_told_of_and_nothing_starts_beside_it() {
    for at_ms in [300, 655, 690, 711] {
        rehearse_part(NetConfig::clean(27), PART, |run| {
            println!("heard at {at_ms} ms");
            reach(run, "so late", |run| run.now_ns() >= at_ms * 1_000_000);
            assert_eq!(run.control.state(), State::Booting);
            hear_foreign_master(run);
            assert_eq!(finish(run), Outcome::Faulted);
            assert!(
                run.operator.alarms()[0]
                    .cause
                    .starts_with("another managing node is on the wire: 02:00:00:00:00:09")
            );
            assert_eq!(commands(run), [[0.0; 3]; 0]);
        });
    }
}

#[test]
fn another_managing_node_in_mid_program_stops_the_machine_on_the_path() {
    rehearse_part(NetConfig::clean(28), PART, |run| {
        reach_midst(run);
        hear_foreign_master(run);
        reach_state(run, State::Stopping);
        assert_eq!(finish(run), Outcome::Faulted);
        let commands = commands(run);
        assert_ends_at_rest(&commands);
        assert_within_limits(&commands, true);
        assert_on_path(run);
        assert_powerless(run);
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

/// The demo machine with other ways to exchange process data: Y and Z chained, the I/O node in one cycle of four.
fn mixed_machine() -> Config {
    let text = MACHINE
        .replacen(
            "interface = \"plk0\"\n",
            "interface = \"plk0\"\nmultiplex_cycles = 4\n",
            1,
        )
        .replacen("name = \"y-drive\"\n", "name = \"y-drive\"\nchained = true\n", 1)
        .replacen("name = \"z-drive\"\n", "name = \"z-drive\"\nchained = true\n", 1)
        .replacen("name = \"io\"\n", "name = \"io\"\nmultiplex = 2\n", 1);
    let mut config = config::parse(&text, Path::new("mixed.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    config.bus.pres_lost_max = 3;
    config
}

#[test]
fn chained_drives_and_a_multiplexed_node_cut_the_same_part() {
    let polled = rehearse_part(NetConfig::clean(41), PART, |run| {
        assert_eq!(finish(run), Outcome::Completed);
        commands(run)
    });
    rehearse_on(&mixed_machine(), NetConfig::clean(41), PART, |run| {
        assert_eq!(finish(run), Outcome::Completed);
        assert_part_cut(run);
        assert_on_path(run);
        assert_eq!(lost(run), [0; 3]);
        let polls: Vec<u64> = (0..4)
            .map(|node| run.control.bus_mut().statistics(node).polls)
            .collect();
        let cycles = polls[0];
        assert!(
            polls[1].abs_diff(cycles) < 100 && polls[2].abs_diff(cycles) < 100,
            "{polls:?}"
        );
        assert!(polls[3].abs_diff(cycles / 4) < 100, "one cycle of four: {polls:?}");
        let mixed = commands(run);
        // The network boots at another pace, the program is the same to the last bit.
        assert_eq!(mixed[mixed.len() - 1000..], polled[polled.len() - 1000..]);
    });
}

#[test]
fn a_chained_drive_that_dies_stops_the_machine_and_is_named() {
    rehearse_on(&mixed_machine(), NetConfig::clean(42), PART, |run| {
        reach_midst(run);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::Unplug { node: 2 });
        assert_eq!(finish(run), Outcome::Faulted);
        let cause = run.operator.alarms()[0].cause.clone();
        assert!(cause.contains("y-drive"), "{cause}");
        assert_within_limits(&commands(run), true);
    });
}
