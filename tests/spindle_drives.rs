//! Spindles that drives of CiA 402 turn, on the whole path and on virtual time.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::sim::NetConfig;
use std::path::Path;

const DEMO: &str = include_str!("../configs/cabinet2-demo.toml");
/// Node of the spindle's drive.
const NODE: u8 = 3;
const PART: &str = "G21 G90 G54 G64\nM3 S1200\nG1 X30 F3000\nM4 S600\nG1 X0\nM5\nG4 P1\nM2\n";
const CYCLES_MAX: u64 = 60_000;

/// The demo, and the same with a servo in place of the converter.
fn machines() -> Vec<(&'static str, Config)> {
    let of = |text: &str| config::parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let servo = |drive: &str| {
        let text = DEMO.replace("drive = \"schneider-atv320\"", "");
        let from = text.find("[spindle.drive]").expect("its drive");
        let end = from + text[from..].find("\n\n").expect("an end");
        of(&format!(
            "{}[spindle.drive]\nnode = 3\n{drive}{}",
            &text[..from],
            &text[end..]
        ))
    };
    vec![
        ("vl", of(DEMO)),
        ("pv", servo("mode = \"pv\"\nunits_per_rpm = [4096, 60]")),
        (
            "csv",
            servo("mode = \"csv\"\nunits_per_rpm = [65536, 60]\nramp_rpm_s = 1500.0"),
        ),
    ]
}

fn journal(run: &Rehearsal<'_>) -> String {
    let entries = run.operator.journal().iter();
    entries
        .map(|entry| format!("{:9.3} {}\n", entry.time_s, entry.text))
        .collect()
}

#[test]
fn feed_waits_until_the_drive_tells_the_speed_and_it_is_off_at_the_end() {
    for (mode, config) in machines() {
        rehearse(&config, PART.as_bytes(), NetConfig::clean(3), |run| {
            let speed = run.hal.reader::<f64>("spindle.0.speed-in").expect("a pin");
            let told = run.hal.reader::<f64>("spindle.0.speed-out").expect("a pin");
            let word = run
                .hal
                .reader::<u64>("cia402.2.statusword")
                .expect("a pin of a drive without a joint");
            let moving = run.hal.reader::<f64>("motion.current-vel").expect("a pin");
            let (mut fed, mut enabled, mut off) = ([0; 2], false, false);
            let over = run.run_until(CYCLES_MAX, |run| {
                enabled |= word.get() & 0x6F == 0x27;
                // Behind M5, while the program dwells.
                off |= enabled && run.control.state() == State::Running && word.get() & 0x4F == 0x40;
                if run.control.state() == State::Running && moving.get() > 0.0 && told.get() != 0.0 {
                    let rpm = 60.0 * speed.get();
                    assert!(
                        (rpm - told.get()).abs() <= 0.05 * told.get().abs() + 5.0,
                        "{mode}: {rpm} of {}",
                        told.get()
                    );
                    fed[usize::from(rpm < 0.0)] += 1;
                }
                run.operator.outcome().is_some()
            });
            assert!(over.expect("a good program"), "{mode}:\n{}", journal(run));
            assert_eq!(
                run.operator.outcome(),
                Some(Outcome::Completed),
                "{mode}:\n{}",
                journal(run)
            );
            assert!(
                enabled && off && fed.iter().all(|cycles| *cycles > 100),
                "{mode}: {fed:?}"
            );
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{mode}: {error}"));
    }
}

#[test]
fn a_fault_of_its_drive_stops_the_machine_on_its_path() {
    for (mode, config) in machines() {
        rehearse(&config, PART.as_bytes(), NetConfig::clean(3), |run| {
            let moving = run.hal.reader::<f64>("motion.current-vel").expect("a pin");
            let cuts = run.run_until(CYCLES_MAX, |run| {
                run.control.state() == State::Running && moving.get() > 40.0
            });
            assert!(cuts.expect("a good program"), "{mode}:\n{}", journal(run));
            assert!(run.net().machine_mut().raise_drive_fault(NODE, 0x2310));
            let mut stopping = false;
            let over = run.run_until(CYCLES_MAX, |run| {
                stopping |= run.control.state() == State::Stopping;
                run.operator.outcome().is_some()
            });
            assert!(over.expect("an end") && stopping, "{mode}:\n{}", journal(run));
            assert_eq!(run.operator.outcome(), Some(Outcome::Faulted), "{mode}");
            let cause = &run.operator.alarms()[0].cause.text;
            assert!(cause.starts_with("spindle: drive fault 2310h"), "{mode}: {cause}");
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{mode}: {error}"));
    }
}

#[test]
fn rules_of_a_drive_of_the_spindle() {
    let cases = [
        (
            "rpm_max = 6000.0",
            "rpm_max = 40000.0",
            "spindle.drive.units_per_rpm: must let 6042h hold rpm_max: 40000 makes 40000",
        ),
        (
            "mode = \"vl\"",
            "mode = \"vl\"\nramp_rpm_s = 0",
            "spindle.drive.ramp_rpm_s = 0: must be above 0",
        ),
        (
            "mode = \"vl\"",
            "mode = \"vl\"\nspeed = \"0x6042\"",
            "spindle.drive.speed: unknown key",
        ),
    ];
    for (from, to, wanted) in cases {
        assert_eq!(DEMO.matches(from).count(), 1, "{from}");
        let errors = config::parse(&DEMO.replace(from, to), Path::new("m.toml"))
            .expect_err(to)
            .to_string();
        assert!(errors.contains(wanted), "{to}: {errors}");
    }
    let servo = DEMO.replace("drive = \"schneider-atv320\"", "");
    for (mode, wanted) in [
        ("pv", "spindle.drive.units_per_rpm: is missing: what 60FFh counts"),
        ("csv", "spindle.drive.ramp_rpm_s: is missing: a number"),
    ] {
        let text = servo.replace("mode = \"vl\"", &format!("mode = \"{mode}\""));
        let errors = config::parse(&text, Path::new("m.toml")).expect_err(mode).to_string();
        assert!(errors.contains(wanted), "{mode}: {errors}");
    }
    let other = DEMO
        .replace("\"schneider-atv320\"", "\"kollmorgen-akd\"")
        .replace("mode = \"vl\"", "mode = \"csv\"\nramp_rpm_s = 1000.0");
    let errors = config::parse(&other, Path::new("m.toml"))
        .expect_err("no such mode")
        .to_string();
    let wanted =
        "spindle.drive.mode = \"csv\": must be one that kollmorgen-akd offers (6502h): PP, PV, TQ, HM, IP, CSP";
    assert!(errors.contains(wanted), "{errors}");
    // Node 2 maps what any drive does, and is that of an axis.
    let taken = servo
        .replace("[spindle.drive]\nnode = 3", "[spindle.drive]\nnode = 2")
        .replace("mode = \"vl\"", "mode = \"pv\"\nunits_per_rpm = [1, 1]");
    let errors = config::parse(&taken, Path::new("m.toml"))
        .expect_err("taken")
        .to_string();
    assert!(errors.contains("is the drive of a joint"), "{errors}");
}

#[test]
fn a_spindle_that_takes_long_to_stand_keeps_its_drive_until_it_does() {
    let (mode, mut config) = machines().remove(2);
    let axis = config.spindle.axis.as_mut().expect("its drive");
    // From 1200 1/min to rest in eight seconds: longer than drives are else given to be off.
    axis.ramp_rpm_s = Some(150.0);
    rehearse(&config, b"M3 S1200\nG4 P0.1\nM2\n", NetConfig::clean(3), |run| {
        let speed = run.hal.reader::<f64>("spindle.0.speed-in").expect("a pin");
        let word = run.hal.reader::<u64>("cia402.2.statusword").expect("a pin");
        let outcome = run.run_until(CYCLES_MAX, |run| {
            let powerless = word.get() & 0x6F != 0x27;
            let turns = 60.0 * speed.get() > 50.0;
            assert!(!(powerless && turns), "{mode}: no power at {} 1/s", speed.get());
            run.operator.outcome().is_some()
        });
        assert!(outcome.expect("an end"), "{mode}:\n{}", journal(run));
        assert_eq!(
            run.operator.outcome(),
            Some(Outcome::Completed),
            "{mode}:\n{}",
            journal(run)
        );
        Ok(())
    })
    .unwrap();
}
