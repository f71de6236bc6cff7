//! Whole programs under the RealtimeSanitizer: what the marked functions of both real-time threads call must not block.
//!
//! The sanitizer ends a process at the first call that may (allocation, lock, file, ...) from within a marked function, and
//! prints where. Therefore this program has no test harness: it runs itself again, once for each scenario, and looks how
//! the other one ended. Before that it shows that a violation is found at all.
//!
//! ```sh
//! export RTSAN_ENABLE=1
//! export RTSAN_LIB_PATH="$(rustc --print sysroot)/lib/rustlib/x86_64-unknown-linux-gnu/lib/librustc-stable_rt.rtsan.a"
//! cargo test --target-dir target/rtsan --no-default-features --features rtsan --test realtime_sanitizer
//! ```
//!
//! Without these variables the marks compile to nothing, and this program says so and passes.

use isocnc::config;
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::rt::cycle_stats::{CycleTimes, recorder};
use isocnc::rt::shared::Command as Order;
use isocnc::rt::timeout::{Limits, Watch, Watchdog};
use isocnc::sim::{Disturbance, NetConfig};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Arc;

/// Names the scenario to the process that runs it.
const SCENARIO: &str = "ISOCNC_TEST_RTSAN";
const CYCLES_MAX: u64 = 120_000;
const PART: &str = "G21 G90 G94 G54 G64 P0.01 T1\nS800 M3\nG0 X5 Y5 Z-5\nM8\nG1 X40 F3000\nG3 X50 Y15 J10\nG1 Y60\nG2 X40 Y70 I-10\n\
                    M9\nG4 P0.05\nG0 Z0\nM5\nM2\n";

/// A scenario and its name.
type Scenario = (&'static str, fn());

const SCENARIOS: [Scenario; 8] = [
    ("boot, program, shut-down", whole_program),
    ("hold, override, late cycles, lost answers", disturbed),
    ("a node dies in mid-program, acknowledge", node_lost),
    ("a drive in fault", drive_fault),
    ("time-out thread and figures", watchdog_and_figures),
    ("step pulses", step_pulses),
    ("EtherCAT: boot, program, shut-down", ethercat_program),
    (
        "EtherCAT: a lost frame, a drive without power and back",
        ethercat_faults,
    ),
];

fn main() {
    if let Ok(name) = std::env::var(SCENARIO) {
        match name.as_str() {
            "violation" => println!("{}", violation(std::env::args().count())),
            "harmless" => println!("{}", harmless(std::env::args().count())),
            name => SCENARIOS
                .iter()
                .find(|(known, _)| *known == name)
                .expect("a scenario")
                .1(),
        }
        return;
    }
    let found = run("violation");
    if found.status.success() {
        println!(
            "realtime_sanitizer ... SKIPPED: built without RTSAN_ENABLE and RTSAN_LIB_PATH, so nothing is looked at; the first \
             lines of tests/realtime_sanitizer.rs say how"
        );
        return;
    }
    let said = String::from_utf8_lossy(&found.stderr);
    assert!(
        said.contains("RealtimeSanitizer") && said.contains("malloc"),
        "an allocation is found and named: {said}"
    );
    println!("an allocation in a marked function ... ok, found");
    assert!(run("harmless").status.success(), "a function that only computes passes");
    for (name, _) in SCENARIOS {
        let output = run(name);
        assert!(
            output.status.success(),
            "{name}: {}\n{}\n{}",
            output.status,
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        );
        println!("{name} ... ok");
    }
}

fn run(scenario: &str) -> Output {
    Command::new(std::env::current_exe().expect("this program"))
        .env(SCENARIO, scenario)
        .output()
        .expect("this program runs")
}

#[rtsan_standalone::nonblocking]
fn violation(octets: usize) -> usize {
    std::hint::black_box(vec![1_u8; octets]).len()
}

#[rtsan_standalone::nonblocking]
fn harmless(number: usize) -> usize {
    std::hint::black_box(number) + 1
}

fn rehearsed(seed: u64, act: impl FnOnce(&mut Rehearsal<'_>)) {
    rehearsed_on(include_str!("../configs/mill3-demo.toml"), seed, act);
}

fn rehearsed_on(machine: &str, seed: u64, act: impl FnOnce(&mut Rehearsal<'_>)) {
    // X is homed by the control.
    let machine = machine.replacen(
        "method = 21, search_mm_s = 40.0, latch_mm_s = 4.0, acceleration_mm_s2 = 500.0, position_mm = 0.0",
        "by = \"control\", towards = \"negative\", switch_mm = -2.0, switch = \"drive\", search_mm_s = 40.0, latch_mm_s = 4.0",
        1,
    );
    let machine = machine + "[[logic]]\nfile = \"configs/cell/plant.st\"\nperiod_ms = 2\n";
    let config = config::parse(&machine, Path::new("machine.toml")).expect("a good machine");
    rehearse(&config, PART.as_bytes(), NetConfig::clean(seed), |run| {
        // With an oscilloscope whose ring is soon full.
        run.control
            .set_scope(hal_pins::scope::Sampler::new(&run.hal, 1_000_000).expect("an oscilloscope"));
        let file = run.hal.path().to_owned();
        let machine = file.file_name().and_then(|name| name.to_str()).expect("a name");
        let machine = machine.trim_start_matches("isocnc-hal.");
        let pins =
            hal_pins::Attached::attach_in(&[file.parent().expect("a folder").to_owned()], machine).expect("the pins");
        let names = vec!["joint.0.f-error"; hal_pins::scope::CHANNELS_MAX];
        let _capture = hal_pins::scope::Capture::begin(&pins, &names).expect("a capture");
        act(run);
        Ok(())
    })
    .expect("a good program");
}

fn reach(run: &mut Rehearsal<'_>, state: State) {
    let reached = run.run_until(CYCLES_MAX, |run| run.control.state() == state);
    assert!(
        reached.expect("a good program"),
        "{state:?}: {:?}",
        run.operator.journal()
    );
}

fn cycles(run: &mut Rehearsal<'_>, count: u64) {
    run.run_until(count, |_| false).expect("a good program");
}

fn whole_program() {
    rehearsed(1, |run| {
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed)
    });
}

fn disturbed() {
    rehearsed(2, |run| {
        reach(run, State::Running);
        cycles(run, 300);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::DropPres { node: 1, count: 2 });
        run.cycle(200_000).expect("a good program");
        run.cycle(2_600_000).expect("a good program");
        run.operator.give(Order::Hold);
        reach(run, State::Held);
        run.operator.give(Order::Resume);
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed);
        assert!(run.operator.late_cycles() > 0);
    });
}

fn node_lost() {
    rehearsed(3, |run| {
        reach(run, State::Running);
        cycles(run, 300);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::PowerOff { node: 2 });
        reach(run, State::Faulted);
        run.operator.give(Order::Acknowledge);
        cycles(run, 500);
    });
}

fn drive_fault() {
    rehearsed(4, |run| {
        reach(run, State::Running);
        cycles(run, 300);
        let now_ns = run.now_ns();
        let fault = Disturbance::DriveFault {
            node: 1,
            error_code: 0x7300,
        };
        run.net().at(now_ns, fault);
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Faulted);
    });
}

fn step_pulses() {
    let text = include_str!("../configs/plotter2-steps.toml");
    let config = config::parse(text, Path::new("plotter2-steps.toml")).expect("a good machine file");
    let program = b"G1 X20 Y10 F3000\nG2 X0 Y0 R12\nM2\n";
    rehearse(&config, program, NetConfig::clean(1), |run| {
        reach(run, State::Running);
        cycles(run, 500);
        Ok(())
    })
    .expect("a machine that can be rehearsed");
}

fn on_ethercat(seed: u64, act: impl FnOnce(&mut Rehearsal<'_>)) {
    rehearsed_on(include_str!("../configs/mill3-ethercat.toml"), seed, act);
}

fn ethercat_program() {
    on_ethercat(5, |run| {
        assert_eq!(run.run(CYCLES_MAX).expect("an end"), Outcome::Completed)
    });
}

fn ethercat_faults() {
    on_ethercat(6, |run| {
        reach(run, State::Running);
        cycles(run, 300);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::DropPres { node: 1, count: 2 });
        run.cycle(200_000).expect("a good program");
        run.cycle(2_600_000).expect("a good program");
        cycles(run, 20);
        assert_eq!(run.control.state(), State::Running);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::PowerOff { node: 2 });
        reach(run, State::Faulted);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::PowerOn { node: 2 });
        run.operator.give(Order::Acknowledge);
        cycles(run, 5000);
        let is_back = run.net().machine().is_operational(2);
        assert_eq!(is_back, Some(true), "{:?}", run.operator.journal());
    });
}

fn watchdog_and_figures() {
    let watch = Arc::new(Watch::default());
    let mut watchdog = Watchdog::new(Arc::clone(&watch), Limits::new(1_000_000, 50_000, 3));
    let (mut recorder, mut windows) = recorder(1_000_000);
    let mut reports = 0;
    for tick in 20..40_000_u64 {
        let now_ns = tick * 50_000;
        if tick % 20 == 0 && tick < 39_000 {
            watch.begin_cycle(tick / 20, now_ns);
            watch.begin_poll(1, now_ns + 120_000);
            watch.begin_async(2, now_ns + 300_000);
            watch.end_cycle(tick / 20, true);
            recorder.record(&CycleTimes {
                deadline_ns: now_ns,
                woke_ns: now_ns + 300,
                soc_ns: Some(now_ns + 900),
                exchanged_ns: now_ns + 90_000,
                ended_ns: now_ns + 95_000,
                next_ns: now_ns + 1_000_000,
                skipped: 0,
                pres_lost: 1,
                phase_ns: Some(-20),
            });
            if windows.last().is_some() || tick == 20 {
                windows.cut();
            }
        }
        watchdog.tick(now_ns, |_| reports += 1);
    }
    assert!(reports > 1000 && !watch.soc_allowed());
}
