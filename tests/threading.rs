//! Threads and taps on the whole path, on virtual time: program text to simulated drives, spindle and encoder, and back.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::rt::overrides::Overridden;
use isocnc::rt::shared::Command;
use isocnc::sim::{Disturbance, NetConfig};
use motion::canon::Axis;
use std::path::Path;

const LATHE: &str = include_str!("../configs/lathe2-demo.toml");
/// The node of the spindle.
const IO: u8 = 10;
/// G54 of the machine, along Z.
const WORK_Z: f64 = -250.0;
const CYCLES_MAX: u64 = 120_000;

/// What there is to know of one cycle; Z in work coordinates.
#[derive(Clone, Copy, Debug)]
struct Seen {
    line: u32,
    x: f64,
    z: f64,
    /// As the control reads the encoder.
    revs: f64,
    /// As a mark on the chuck would show.
    turns: f64,
    /// Where the saddle is at that moment.
    load_z: f64,
}

fn lathe() -> Config {
    config::parse(LATHE, Path::new("lathe2-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

fn on_lathe<T>(config: &Config, seed: u64, text: &str, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    println!("seed {seed}");
    let text = format!("G21 G90 G18 G94 G54 G64\n{text}M5\nM2\n");
    rehearse(config, text.as_bytes(), NetConfig::clean(seed), |run| Ok(act(run)))
        .expect("a machine that can be rehearsed")
}

fn journal(run: &Rehearsal<'_>) -> String {
    let entries = run.operator.journal().iter();
    entries
        .map(|entry| format!("{:9.3} {}\n", entry.time_s, entry.text))
        .collect()
}

/// Runs on until `done`, and gives what was seen of the program on the way.
fn watch(run: &mut Rehearsal<'_>, what: &str, mut done: impl FnMut(&mut Rehearsal<'_>) -> bool) -> Vec<Seen> {
    let revs = run.hal.reader::<f64>("spindle.0.revs").expect("a pin");
    let mut seen = Vec::new();
    let reached = run.run_until(CYCLES_MAX, |run| {
        if matches!(run.control.state(), State::Running | State::Stopping) {
            let live = run.operator.live();
            seen.push(Seen {
                line: live.line,
                x: live.position[Axis::X],
                z: live.position[Axis::Z] - WORK_Z,
                revs: revs.get(),
                turns: run.net().machine().spindle_turns(IO).expect("a spindle"),
                load_z: run.net().machine().joint_position_mm(1).expect("a joint") - WORK_Z,
            });
        }
        done(run)
    });
    assert!(reached.expect("a good program"), "never {what}:\n{}", journal(run));
    seen
}

fn finish(run: &mut Rehearsal<'_>) -> Vec<Seen> {
    let seen = watch(run, "over", |run| run.operator.outcome().is_some());
    println!("{:?}\n{}", run.operator.outcome(), journal(run));
    seen
}

fn causes(run: &Rehearsal<'_>) -> Vec<String> {
    run.operator
        .alarms()
        .iter()
        .map(|alarm| alarm.cause.text.clone())
        .collect()
}

/// No joint was commanded beyond what it is planned with.
fn assert_within_limits(run: &Rehearsal<'_>, config: &Config) {
    for (peaks, joint) in run.control.peaks().iter().zip(&config.joints) {
        println!("{peaks:?}");
        assert_eq!(peaks.over, [0; 3], "{peaks:?} over {:?}", joint.limits);
    }
}

/// Distances from the pitch, of cycles that are to be in step, as far as whole turns leave them open.
fn phases<'s>(seen: impl Iterator<Item = &'s Seen>, pitch: f64, turns: impl Fn(&Seen) -> f64) -> Vec<f64> {
    seen.map(|seen| {
        let off = seen.z + pitch * turns(seen);
        off - pitch * (off / pitch).round()
    })
    .collect()
}

fn spread(values: &[f64]) -> f64 {
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(*value), high.max(*value))
        });
    high - low
}

/// The same with the saddle itself in place of where it was told to be.
fn metal<'s>(seen: impl Iterator<Item = &'s Seen>) -> Vec<Seen> {
    let moved = |seen: &Seen| Seen {
        z: seen.load_z,
        ..*seen
    };
    seen.map(moved).collect()
}

/// By how much the saddle itself lags behind the chuck on the mean, cycles; the thread begins at `begin` at an index.
fn lag_cycles(pass: &[&Seen], begin: f64, pitch: f64, rpm: f64) -> f64 {
    let metal = pass.iter().map(|seen| seen.load_z - begin + pitch * seen.turns);
    let off: Vec<f64> = metal.map(|off| off - pitch * (off / pitch).round()).collect();
    off.iter().sum::<f64>() / off.len() as f64 / (pitch * rpm / 60.0 * 1e-3)
}

const THREAD: &str = "S600 M3\nG0 X10 Z5\nG33 Z-20 K1.5\nG0 X12\nZ5\nX9.5\nG33 Z-20 K1.5\nG0 X12\n";

#[test]
fn two_passes_of_a_thread_are_in_phase() {
    let config = lathe();
    on_lathe(&config, 1, THREAD, |run| {
        let seen = finish(run);
        assert_eq!(
            (run.operator.outcome(), causes(run)),
            (Some(Outcome::Completed), vec![])
        );
        assert_within_limits(run, &config);
        let mut all = Vec::new();
        for line in [4, 8] {
            let pass: Vec<&Seen> = seen
                .iter()
                .filter(|seen| seen.line == line && (-19.0..=2.0).contains(&seen.z))
                .collect();
            // 21 mm at 15 mm/s.
            assert!(pass.len().abs_diff(1400) < 20, "{} cycles", pass.len());
            let read = phases(pass.iter().copied(), 1.5, |seen| seen.revs);
            let chuck = phases(pass.iter().copied(), 1.5, |seen| seen.turns);
            println!(
                "line {line}: off {:.5} mm, at the chuck {:.5} mm",
                spread(&read),
                spread(&chuck)
            );
            let lag = lag_cycles(&pass, 5.0, 1.5, 600.0);
            println!("line {line}: the saddle lags by {lag:.3} cycles");
            assert!(lag.abs() < 0.5, "{lag} cycles");
            assert!(spread(&read) < 0.002, "{}", spread(&read));
            all.extend(chuck);
        }
        assert!(spread(&all) < 0.003, "passes {} mm apart", spread(&all));
        // The operator is told how it went.
        let told = journal(run);
        for line in [4, 8] {
            assert!(
                told.contains(&format!("line {line}: in step with the spindle from ")),
                "{told}"
            );
        }
        assert!(
            !told.contains("never in step") && told.matches(", 0 cycles off by much").count() == 2,
            "{told}"
        );
    });
}

#[test]
fn a_tap_follows_the_spindle_into_the_depth_and_back() {
    let config = lathe();
    on_lathe(&config, 2, "S300 M3\nG0 X0 Z5\nG33.1 Z-10 K1\n", |run| {
        let reverse = run.hal.reader::<bool>("spindle.0.reverse").expect("a pin");
        let mut reversed = 0;
        let seen = watch(run, "over", |run| {
            reversed += u32::from(reverse.get());
            run.operator.outcome().is_some()
        });
        assert_eq!(
            (run.operator.outcome(), causes(run)),
            (Some(Outcome::Completed), vec![])
        );
        assert_within_limits(run, &config);
        assert!(reversed > 1000, "{reversed} cycles in reverse");
        let tap: Vec<&Seen> = seen.iter().filter(|seen| seen.line == 4 && seen.z < 3.0).collect();
        let deepest = tap.iter().map(|seen| seen.z).fold(0.0, f64::min);
        assert!((-12.0..-10.0).contains(&deepest), "{deepest}");
        let off = phases(tap.iter().copied(), 1.0, |seen| seen.revs);
        let metal = phases(metal(tap.iter().copied()).iter(), 1.0, |seen| seen.turns);
        println!(
            "tap: off {:.5} mm as read, {:.5} mm in the metal, deepest {deepest:.3}",
            spread(&off),
            spread(&metal)
        );
        assert!(spread(&metal) < 0.01, "{}", spread(&metal));
        let told = format!("over-run {:.3} mm behind the depth", -10.0 - deepest);
        assert!(journal(run).contains(&told), "{told}:\n{}", journal(run));
        let last = seen.iter().rfind(|seen| seen.line == 4).expect("a tap");
        assert!((last.z - 5.0).abs() < 1e-5, "back at {}", last.z);
    });
}

#[test]
fn the_passes_of_a_threading_cycle_are_in_phase() {
    let config = lathe();
    let text = "S480 M3\nG0 X12 Z5\nG76 P1.5 Z-15 I-1 J0.3 R1.5 K0.92 Q0 H1\n";
    on_lathe(&config, 3, text, |run| {
        let seen = finish(run);
        assert_eq!(
            (run.operator.outcome(), causes(run)),
            (Some(Outcome::Completed), vec![])
        );
        assert_within_limits(run, &config);
        // On the way in at 12 mm/s; rapid moves are ten times as fast.
        let cutting = |pair: &&[Seen]| {
            let step = pair[0].z - pair[1].z;
            pair[0].line == 4 && (-14.0..=1.0).contains(&pair[0].z) && (0.005..0.03).contains(&step) && pair[0].x < 11.5
        };
        let cut: Vec<&Seen> = seen.windows(2).filter(cutting).map(|pair| &pair[0]).collect();
        let mut depths: Vec<f64> = cut.iter().map(|seen| (seen.x * 1e3).round() / 1e3).collect();
        depths.dedup();
        assert!(depths.len() >= 5, "passes at {depths:?}");
        let off = phases(cut.into_iter(), 1.5, |seen| seen.turns);
        println!("{} passes: off {:.5} mm", depths.len(), spread(&off));
        assert!(spread(&off) < 0.005, "{}", spread(&off));
    });
}

/// Up to the midst of the move of a line, past a place.
fn reach_midst(run: &mut Rehearsal<'_>, line: u32, z: f64) {
    watch(run, "in the midst", |run| {
        let live = run.operator.live();
        live.line == line && live.position[Axis::Z] - WORK_Z < z
    });
}

#[test]
fn an_override_of_the_spindle_goes_only_as_far_as_the_axes_can_follow() {
    // 140 mm/s of 150, with an override of 120 % from the beginning or from the middle on: 150 of which a hundredth is kept.
    let text = "S2100 M3\nG0 X10 Z60\nG33 Z-40 K4\n";
    let most_rpm = 0.99 * 150.0 / 4.0 * 60.0;
    for in_work in [false, true] {
        let config = lathe();
        on_lathe(&config, 13, text, |run| {
            let told = run.hal.reader::<f64>("spindle.0.speed-out").expect("a pin");
            let raise = |run: &mut Rehearsal<'_>| {
                let overrides = &run.operator.shared().overrides;
                overrides.order(Overridden::Spindle, 120.0).expect("within its range");
            };
            if in_work {
                reach_midst(run, 4, 20.0);
            }
            raise(run);
            let mut greatest = 0.0f64;
            let seen = watch(run, "over", |run| {
                let live = run.operator.live();
                if live.line == 4 && live.velocity_mm_s > 0.0 {
                    greatest = greatest.max(told.get());
                }
                run.operator.outcome().is_some()
            });
            println!("{:?}\n{}", run.operator.outcome(), journal(run));
            assert_eq!(
                (run.operator.outcome(), causes(run)),
                (Some(Outcome::Completed), vec![])
            );
            assert_within_limits(run, &config);
            assert!(
                (greatest - most_rpm).abs() < 1e-6,
                "told {greatest}, not {most_rpm} 1/min"
            );
            let cut: Vec<&Seen> = seen
                .iter()
                .filter(|seen| seen.line == 4 && (-20.0..10.0).contains(&seen.z))
                .collect();
            assert!(cut.len() > 150, "{} cycles", cut.len());
            let off = phases(cut.into_iter(), 4.0, |seen| seen.revs);
            assert!(spread(&off) < 0.05, "{}", spread(&off));
            let journal = journal(run);
            assert_eq!(
                journal.matches("line 4: spindle override held to 106 %").count(),
                1,
                "{journal}"
            );
            assert!(!journal.contains("never in step"), "{journal}");
        });
    }
}

#[test]
fn counts_that_the_encoder_loses_stop_a_thread_and_are_made_up_for_between_two() {
    let config = lathe();
    on_lathe(&config, 14, THREAD, |run| {
        reach_midst(run, 4, -5.0);
        assert!(run.net().machine_mut().slip_encoder(IO, -9));
        let seen = finish(run);
        assert_eq!(run.operator.outcome(), Some(Outcome::Faulted));
        assert_eq!(
            causes(run),
            [
                "spindle: its encoder counted 9 less than whole turns between two indexes: look at its cable, its shield and \
              counts_per_turn"
            ]
        );
        assert_within_limits(run, &config);
        // A turn at the most until it shows, and the way to rest.
        let last = seen.last().expect("a program");
        assert!((-7.5..-5.0).contains(&last.z), "{last:?}");
    });
    on_lathe(&config, 15, THREAD, |run| {
        let mut seen = watch(run, "between two passes", |run| run.operator.live().line == 5);
        assert!(run.net().machine_mut().slip_encoder(IO, 100));
        seen.extend(finish(run));
        assert_eq!(
            (run.operator.outcome(), causes(run)),
            (Some(Outcome::Completed), vec![])
        );
        let warning = "warning: spindle: its encoder counted 100 more than whole turns";
        assert_eq!(journal(run).matches(warning).count(), 1, "{}", journal(run));
        let pass = |seen: &&Seen| matches!(seen.line, 4 | 8) && (-19.0..=2.0).contains(&seen.z);
        let chuck = phases(seen.iter().filter(pass), 1.5, |seen| seen.turns);
        assert!(
            chuck.len() > 2700 && spread(&chuck) < 0.003,
            "passes {} mm apart",
            spread(&chuck)
        );
    });
}

#[test]
fn an_encoder_that_is_lost_stops_the_machine() {
    let config = lathe();
    on_lathe(&config, 4, THREAD, |run| {
        reach_midst(run, 4, -5.0);
        let now_ns = run.now_ns();
        run.net().at(now_ns, Disturbance::Unplug { node: IO });
        let seen = finish(run);
        assert_eq!(run.operator.outcome(), Some(Outcome::Faulted));
        assert_eq!(causes(run), ["io (node 10): lost, it does not answer any more"]);
        assert_within_limits(run, &config);
        // From 15 mm/s within the limits, after four lost answers.
        let last = seen.last().expect("a program");
        assert!((-7.0..-5.0).contains(&last.z), "{last:?}");
    });
}

#[test]
fn a_spindle_that_stands_is_a_fault_and_so_is_one_that_never_turns() {
    let config = lathe();
    on_lathe(&config, 5, THREAD, |run| {
        reach_midst(run, 4, -5.0);
        run.net().machine_mut().block_spindle(IO, true);
        finish(run);
        assert_eq!(run.operator.outcome(), Some(Outcome::Faulted));
        assert_eq!(
            causes(run),
            ["spindle: the spindle stood for 5 s in a move in step with it; expected it to turn"]
        );
        assert_within_limits(run, &config);
    });
    on_lathe(&config, 6, THREAD, |run| {
        run.net().machine_mut().block_spindle(IO, true);
        let seen = finish(run);
        assert_eq!(run.operator.outcome(), Some(Outcome::Faulted));
        let causes = causes(run);
        assert_eq!(causes.len(), 1);
        assert!(
            causes[0].starts_with("spindle: turns at 0 1/min, wanted are 600"),
            "{causes:?}"
        );
        assert!(seen.iter().all(|seen| seen.z > 4.9), "cut with a spindle that stands");
    });
}

#[test]
fn a_spindle_without_an_index_is_a_fault() {
    let text = LATHE.replace("source = \"node\"", "source = \"pins\"");
    let from = text.find("node = 10\ncounter").expect("the encoder");
    let text = &text[..from];
    let config = config::parse(text, Path::new("pins.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    on_lathe(&config, 7, THREAD, |run| {
        let mut turns = 0.0;
        let seen = watch(run, "over", |run| {
            turns += 0.01;
            run.hal.set("spindle.0.revs", turns).expect("a pin");
            run.operator.outcome().is_some()
        });
        assert_eq!(run.operator.outcome(), Some(Outcome::Faulted));
        assert_eq!(
            causes(run),
            ["spindle: no index of the spindle within 5 s; expected one each turn"]
        );
        assert!(seen.iter().all(|seen| seen.z > 4.9), "cut without an index");
    });
}

#[test]
fn a_stop_ends_a_thread_at_once_and_a_tap_only_out_of_the_work() {
    let config = lathe();
    on_lathe(&config, 8, THREAD, |run| {
        reach_midst(run, 4, -5.0);
        run.operator.give(Command::Stop);
        let seen = watch(run, "ready", |run| run.control.state() == State::Ready);
        assert_eq!(causes(run), [""; 0]);
        let last = seen.last().expect("a program");
        assert!((-7.0..-5.0).contains(&last.z), "{last:?}");
        assert_within_limits(run, &config);
    });
    on_lathe(&config, 9, "S300 M3\nG0 X0 Z5\nG33.1 Z-10 K1\n", |run| {
        reach_midst(run, 4, -5.0);
        run.operator.give(Command::Stop);
        let seen = watch(run, "ready", |run| run.control.state() == State::Ready);
        assert_eq!(causes(run), [""; 0]);
        let deepest = seen.iter().map(|seen| seen.z).fold(0.0, f64::min);
        assert!((-8.0..-5.0).contains(&deepest), "{deepest}");
        let off = phases(metal(seen.iter().filter(|seen| seen.z < 3.0)).iter(), 1.0, |seen| {
            seen.turns
        });
        assert!(spread(&off) < 0.01, "torn by {}", spread(&off));
        let last = seen.last().expect("a program");
        assert!((last.z - 5.0).abs() < 1e-5, "back at {}", last.z);
        assert_within_limits(run, &config);
    });
}

/// A spindle that components drive and measure, at the speed that `rpm` gives for what it is told.
fn on_pins(text: &str, act: impl FnOnce(&mut Rehearsal<'_>)) {
    let from = LATHE.find("[spindle.drive]").expect("the spindle's drive");
    let machine = format!("{}[spindle.encoder]\nsource = \"pins\"\n", &LATHE[..from]);
    let config = config::parse(&machine, Path::new("pins.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    on_lathe(&config, 10, text, act);
}

#[test]
fn feed_by_turns_follows_a_spindle_that_is_slower_than_programmed() {
    // 0.2 mm a turn at 600 1/min are 2 mm/s.
    on_pins("G95 S600 M3\nG0 X20 Z1\nG1 Z-20 F0.2\n", |run| {
        let told = run.hal.reader::<f64>("spindle.0.speed-out").expect("a pin");
        run.hal.set("spindle.0.indexed", true).expect("a pin");
        let (mut turns, mut stood) = (0.0, 0);
        let mut at = Vec::new();
        let done = run.run_until(CYCLES_MAX, |run| {
            let live = run.operator.live();
            let z = live.position[Axis::Z] - WORK_Z;
            // It slows down by a quarter in the work, and stands for a second.
            let share = match z {
                z if z < -10.0 && stood < 1000 => 0.0,
                z if z < -5.0 => 0.75,
                _ => 1.0,
            };
            stood += u32::from(share == 0.0);
            turns += told.get() / 60.0 * share * 1e-3;
            if live.line == 4 {
                at.push((live.velocity_mm_s, share));
            }
            run.hal.set("spindle.0.revs", turns).expect("a pin");
            run.operator.outcome().is_some()
        });
        assert!(done.expect("a good program"), "{}", journal(run));
        assert_eq!(
            (run.operator.outcome(), causes(run)),
            (Some(Outcome::Completed), vec![])
        );
        // The speed of most cycles of each part.
        for (share, expected) in [(1.0, 2.0), (0.75, 1.5), (0.0, 0.0)] {
            let mut speeds: Vec<f64> = at.iter().filter(|seen| seen.1 == share).map(|seen| seen.0).collect();
            speeds.sort_by(f64::total_cmp);
            let median = speeds[speeds.len() / 2];
            println!("share {share}: {median} mm/s of {} cycles", speeds.len());
            assert!((median - expected).abs() < 0.01, "{median}, not {expected}");
        }
        for peaks in run.control.peaks() {
            assert_eq!(peaks.over, [0; 3], "{peaks:?}");
        }
    });
}

#[test]
fn the_speed_of_the_surface_stays_while_the_radius_falls_up_to_the_highest_speed() {
    let config = lathe();
    // Facing from a radius of 50 mm inwards: 100 m/min, 1000 1/min at most, reached at 15.9 mm.
    let text = "G0 X50 Z0\nG96 D1000 S100 M3\nG1 X40 F1200\nX1\n";
    on_lathe(&config, 11, text, |run| {
        let told = run.hal.reader::<f64>("spindle.0.speed-out").expect("a pin");
        let mut worst = 0.0_f64;
        let mut most = 0.0_f64;
        let mut cycles = 0;
        let seen = watch(run, "over", |run| {
            let live = run.operator.live();
            if run.control.state() == State::Running && matches!(live.line, 4 | 5) {
                cycles += 1;
                let radius_mm = live.position[Axis::X];
                let wanted = (100e3 / (std::f64::consts::TAU * radius_mm)).min(1000.0);
                worst = worst.max((told.get() - wanted).abs());
                most = most.max(told.get());
            }
            run.operator.outcome().is_some()
        });
        assert_eq!(
            (run.operator.outcome(), causes(run)),
            (Some(Outcome::Completed), vec![])
        );
        assert!(cycles > 2000, "{cycles}");
        println!("told within {worst} 1/min");
        assert!(worst < 1e-6, "{worst}");
        assert_eq!(most, 1000.0);
        assert!(seen.iter().any(|seen| seen.x < 1.01));
    });
}

#[test]
fn a_tap_in_a_floating_holder_turns_the_spindle_back_at_the_depth() {
    let config = lathe();
    let text = "G17 S300 M3 F300\nG0 X0 Z5\nG84 Z-5 R1\nG80\n";
    on_lathe(&config, 12, text, |run| {
        let told = run.hal.reader::<f64>("spindle.0.speed-out").expect("a pin");
        let mut directions = Vec::new();
        watch(run, "over", |run| {
            directions.push(told.get());
            directions.dedup();
            run.operator.outcome().is_some()
        });
        assert_eq!(
            (run.operator.outcome(), causes(run)),
            (Some(Outcome::Completed), vec![])
        );
        directions.retain(|told| *told != 0.0);
        assert_eq!(directions, [300.0, -300.0, 300.0]);
    });
}

/// `isocnc plan` of a program on the lathe: its exit code and what it says.
fn planned(name: &str, program: &str) -> (bool, String) {
    let folder = std::env::temp_dir().join(format!("isocnc-threading-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let file = folder.join("part.ngc");
    std::fs::write(&file, format!("G21 G90 G18 G94 G54 G61\n{program}M5\nM2\n")).expect("a file");
    let machine = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/lathe2-demo.toml");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["plan", machine])
        .arg(&file)
        .arg("--json")
        .output()
        .expect("the program");
    std::fs::remove_dir_all(&folder).expect("the folder");
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    println!("{said}");
    (output.status.success(), said)
}

#[test]
fn threads_taps_and_feed_by_turns_are_planned_with_a_spindle_that_does_what_it_is_told() {
    for (name, program) in [
        ("thread", THREAD),
        ("tap", "S300 M3\nG0 X0 Z5\nG33.1 Z-10 K1\n"),
        (
            "cycle",
            "S480 M3\nG0 X12 Z5\nG76 P1.5 Z-15 I-1 J0.3 R1.5 K0.92 Q29 H1\n",
        ),
        ("facing", "G0 X50 Z0\nG96 D1000 S100 M3\nG95 G1 X1 F0.2\n"),
    ] {
        let (good, said) = planned(name, program);
        assert!(good, "{name}: {said}");
        assert!(
            said.contains("\"given_up\": null") && said.contains("\"cycles_over_limits\": 0"),
            "{name}: {said}"
        );
        // The run-down of a tap is no deviation. On its way back it may sway along the path, which counts as one.
        let number = |key: &str| -> f64 {
            let (_, behind) = said.split_once(&format!("\"{key}\": ")).expect("a figure");
            let end = behind.find([',', '\n', '}']).expect("its end");
            behind[..end].parse().expect("a number")
        };
        let over_run = number("over_run_mm");
        let deviation = number("deviation_max_mm");
        assert!(deviation < if name == "tap" { 0.03 } else { 1e-6 }, "{name}: {said}");
        assert!(
            if name == "tap" {
                over_run > 0.05
            } else {
                over_run == 0.0
            },
            "{name}: {said}"
        );
    }
    let (good, said) = planned("fast", "S3000 M3\nG0 X10 Z5\nG33 Z-20 K4\n");
    assert!(
        !good && said.contains("pitch and spindle speed come to 200.000 mm/s"),
        "{said}"
    );
}
