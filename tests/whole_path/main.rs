//! The whole path on virtual time: program text to simulated drives and back, with faults at chosen moments.
//!
//! Every run prints its seed; the same seed gives the same octets on the wire and the same bits in the trace.
//! Here: what all runs share, clean runs, late plans. By subject beside it: drives and faults, modes of drives, orders, the wire,
//! EtherCAT, late cycles, what the last wall keeps back, step pulses, analog amplifiers.

mod analog;
mod ethercat;
mod faults;
mod last_wall;
mod late_cycles;
mod modes;
mod orders;
mod steps;
mod wire;

use cia402::State as Power;
use isocnc::bus::CyclicBus;
use isocnc::config::{self, Config};
use isocnc::machine::motion_settings::{ring_capacity, stop_ramp};
use isocnc::machine::sequence::{Outcome, Step};
use isocnc::machine::state::State;
use isocnc::machine::tables::Tables;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::program::{Feeder, Progress, home};
use isocnc::rt::shared::Command;
use isocnc::sim::{Disturbance, NetConfig};
use motion::canon::{Axis, Position};
use motion::plan::deviation;
use motion::rt::Interpolator;
use powerlink::wire::{Header, Soc, multicast};
use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hasher};
use std::path::Path;
use std::sync::{Arc, Mutex};

const MACHINE: &str = include_str!("../../configs/mill3-demo.toml");
const PART: &str = include_str!("../../configs/short-part.ngc");
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
    config.program.planner = motion::plan::PlannerKind::Classic;
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
        if !machine.is_powered(id).expect("a drive") {
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

/// As [`stops_in_order`], by a disturbance.
fn fails_in_order(run: &mut Rehearsal<'_>, disturbance: Disturbance, alive: &[usize]) -> Vec<String> {
    stops_in_order(run, alive, |run| run.net().at(0, disturbance))
}

/// Something goes wrong in the midst of the program; it must come to rest on its path within the stop limits before any drive is
/// switched off by the control, and the whole run to an end. Returns the causes of all alarms.
fn stops_in_order(run: &mut Rehearsal<'_>, alive: &[usize], disturb: impl FnOnce(&mut Rehearsal<'_>)) -> Vec<String> {
    reach_midst(run);
    assert_eq!(run.control.state(), State::Running);
    disturb(run);
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
    run.operator
        .alarms()
        .iter()
        .map(|alarm| alarm.cause.text.clone())
        .collect()
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
    // What the second run takes longer, but for the braking and speeding up, it stands: before the first move, too, of which the
    // corner into the next one has to be known.
    let longer = (starved.len() - fed.len()) as u64;
    let stands = |commands: &[[f64; 3]]| commands.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64;
    let stood = stands(&starved) - stands(&fed);
    assert!(stood > longer / 2 && stood < longer, "{stood} of {longer}");
    // The operator is told of what it stood behind the first move.
    assert!(
        waited[0] == 0 && waited[1] > 1000 && waited[1] <= stood,
        "{waited:?} of {stood}"
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
