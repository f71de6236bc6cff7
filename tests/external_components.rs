//! Components whose outputs other processes write: what a control does when these die, hang or write anything anywhere.

use crate::common;

use common::Control;
use hal_pins::{AnyValue, Attached, Claim, HalError, Kind, Type, directories};
use isocnc::config;
use isocnc::machine::sequence::Outcome;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::sim::NetConfig;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const CYCLES_MAX: u64 = 200_000;
/// As long as no process says otherwise, the machine holds.
const PANEL: &str = r#"
[[hal.external]]
name = "panel"
heartbeat_ms = 100
on_loss = "HOW"
pins = [
    { name = "x", direction = "in", type = "float" },
    { name = "hold", direction = "out", type = "bit", safe = true },
    { name = "a", direction = "out", type = "float", safe = 0.0 },
    { name = "b", direction = "out", type = "float", safe = 0.0 },
]
# What is written together is seen together, in every cycle.
[[hal.component]]
name = "difference"
type = "sum2"
set = { gain1 = -1.0 }
[[hal.component]]
name = "differences"
type = "minmax"
[[hal.net]]
name = "a"
source = "panel.a"
targets = ["difference.in0"]
[[hal.net]]
name = "b"
source = "panel.b"
targets = ["difference.in1"]
[[hal.net]]
name = "difference"
source = "difference.out"
targets = ["differences.in"]
[[hal.net]]
name = "x"
source = "axis.x.pos-cmd"
targets = ["panel.x"]
[[hal.net]]
name = "hold"
source = "panel.hold"
targets = ["motion.feed-hold"]
"#;

const PROGRAM: &str = "G21 G90 G53 G0 X10\nG53 G1 X60 F3000\nM2\n";

fn with_panel(on_loss: &str, act: impl FnOnce(&mut Rehearsal<'_>) -> anyhow::Result<()>) {
    let text = format!("{MACHINE}{}", PANEL.replace("HOW", on_loss));
    let config = config::parse(&text, Path::new("mill3-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    rehearse(&config, PROGRAM.as_bytes(), NetConfig::clean(1), act).expect("a machine to rehearse on");
}

fn claim(run: &Rehearsal<'_>) -> Claim {
    Claim::of_in(&[std::env::temp_dir()], run.hal.machine(), "panel").unwrap()
}

fn journal(run: &Rehearsal<'_>) -> Vec<String> {
    let entries = run.operator.journal().iter().map(|entry| entry.text.clone());
    entries.filter(|text| text.contains("panel")).collect()
}

#[test]
fn a_process_that_hangs_stops_the_machine_where_the_file_says_so_and_holds_it_where_its_safe_values_do() {
    const LOST: &str = "external component panel: its process does not renew its heartbeat: it has died or hangs; its outputs have their \
                        safe values";
    for on_loss in ["stop", "warn", "journal"] {
        with_panel(on_loss, |run| {
            let mut panel = claim(run);
            panel.set("hold", false).unwrap();
            let x = run.hal.reader::<f64>("axis.x.pos-cmd")?;
            let hold = run.hal.reader::<bool>("motion.feed-hold")?;
            // It writes until X is under way; what it reads is X of the cycle before.
            let mut last = 0.0;
            let under_way = run.run_until(CYCLES_MAX, |_| {
                panel.update().unwrap();
                assert_eq!(panel.get("x").unwrap(), AnyValue::Float(x.get()));
                let moves = x.get() > 30.0 && x.get() > last;
                last = x.get();
                moves
            })?;
            assert!(under_way && !hold.get(), "{:#?}", run.operator.journal());
            // The last record is taken in the next cycle, and bears a hundred more.
            let mut cycles = 0;
            assert!(run.run_until(1000, |_| {
                cycles += 1;
                hold.get()
            })?);
            assert_eq!(cycles, 1 + 100 + 1);
            run.run_until(20, |_| false)?;
            let told = journal(run);
            let begun = "external component panel: process ";
            assert!(
                told[0].starts_with(begun) && told[0].ends_with(" writes its outputs"),
                "{told:?}"
            );
            match on_loss {
                "stop" => {
                    assert_eq!(told[1..], [format!("alarm: {LOST}")]);
                    run.run(CYCLES_MAX)?;
                    assert!(
                        matches!(run.operator.outcome(), Some(Outcome::Faulted)),
                        "{:?}",
                        run.operator.outcome()
                    );
                }
                _ => {
                    let expected = match on_loss {
                        "warn" => format!("warning: {LOST}"),
                        _ => LOST.replace(": it has died or hangs", ""),
                    };
                    assert_eq!(told[1..], [expected]);
                    // Begun anew it lets the machine go on to the end.
                    assert!(panel.update().is_err());
                    run.cycle(0)?;
                    panel.begin().unwrap();
                    assert_eq!(panel.get("hold").unwrap(), AnyValue::Bit(true));
                    panel.set("hold", false).unwrap();
                    run.run_until(CYCLES_MAX, |run| {
                        panel.update().unwrap();
                        run.operator.outcome().is_some()
                    })?;
                    assert_eq!(run.operator.outcome(), Some(Outcome::Completed));
                    assert!(x.get() > 59.9);
                }
            }
            Ok(())
        });
    }
}

#[test]
fn processes_that_come_and_go_are_told_of_once_a_second_at_the_most() {
    with_panel("warn", |run| {
        let mut cycles = 0;
        while cycles < 10_000 {
            let mut panel = claim(run);
            for _ in 0..5 {
                panel.update().unwrap();
                run.cycle(0)?;
                cycles += 1;
            }
            drop(panel);
            for _ in 0..5 {
                run.cycle(0)?;
                cycles += 1;
            }
        }
        let told = journal(run);
        assert!((2..=12).contains(&told.len()), "{told:#?}");
        Ok(())
    });
}

/// What is no number, at all inputs of the control at once, costs what each of them says, and no program.
#[test]
fn what_is_no_number_at_every_input_stops_nothing() {
    let plain = config::parse(MACHINE, Path::new("mill3-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let mut inputs = Vec::new();
    rehearse(&plain, PROGRAM.as_bytes(), NetConfig::clean(1), |run| {
        let pins = run.hal.list().into_iter();
        let free = pins.filter(|pin| pin.kind == Kind::Input && pin.value_type() == Type::Float && pin.net.is_none());
        inputs = free.map(|pin| pin.name).collect();
        Ok(())
    })
    .expect("a machine to rehearse on");
    assert!(inputs.len() > 10, "{inputs:?}");
    let external = "[[hal.external]]\nname = \"panel\"\npins = [{ name = \"x\", direction = \"out\", type = \"float\", safe = 0.5 }]\n";
    let text = format!("{MACHINE}{external}[[hal.net]]\nname = \"x\"\nsource = \"panel.x\"\ntargets = {inputs:?}\n");
    let config = config::parse(&text, Path::new("mill3-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    rehearse(&config, PROGRAM.as_bytes(), NetConfig::clean(1), |run| {
        let x = run.hal.reader::<f64>("axis.x.pos-cmd")?;
        let target = run.hal.reader::<f64>("joint.0.motor-pos-cmd")?;
        let mut panel = claim(run);
        panel.set("x", f64::NAN).unwrap();
        run.run_until(CYCLES_MAX, |run| {
            panel.update().unwrap();
            assert!(target.get().is_finite());
            run.operator.outcome().is_some()
        })?;
        assert_eq!(
            run.operator.outcome(),
            Some(Outcome::Completed),
            "{:#?}",
            run.operator.journal()
        );
        assert!(x.get() > 59.9);
        Ok(())
    })
    .expect("a machine to rehearse on");
}

/// A process of ours that ends with the test.
struct Client(Child);

impl Drop for Client {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const MACHINE_NAME: &str = "ISOCNC_TEST_EXTERNAL_MACHINE";

/// A writer: `a` and `b` are always the same, and the machine may move.
#[test]
fn role_writer() {
    let Ok(machine) = std::env::var(MACHINE_NAME) else {
        return;
    };
    let mut panel = loop {
        match Claim::of(&machine, "panel") {
            Ok(panel) => break panel,
            Err(HalError::Claimed { .. }) => std::thread::sleep(Duration::from_millis(1)),
            Err(error) => panic!("{error}"),
        }
    };
    println!("writes its outputs");
    for count in 1u64.. {
        panel.set("hold", false).unwrap();
        panel.set("a", count as f64).unwrap();
        panel.set("b", count as f64).unwrap();
        if panel.update().is_err() {
            panel.begin().unwrap();
        }
        if count % 64 == 0 {
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}

fn writer(machine: &str) -> Client {
    let mut command = testing::command(std::env::current_exe().unwrap());
    let command = command
        .args(["--exact", "external_components::role_writer", "--nocapture"])
        .env(MACHINE_NAME, machine);
    let mut client = Client(command.stdout(Stdio::piped()).spawn().unwrap());
    let mut said = BufReader::new(client.0.stdout.take().unwrap());
    let mut line = String::new();
    while !line.contains("writes its outputs") {
        line.clear();
        assert!(
            said.read_line(&mut line).unwrap() > 0,
            "the writer ended before it wrote"
        );
    }
    client
}

/// The same numbers each time.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
}

/// The files of two components of a control that runs; the second is for what is done to files.
fn start() -> (Control, PathBuf, PathBuf) {
    let machine = format!("external-{}", std::process::id());
    let changed = |text: &str| {
        let panel = PANEL.replace("HOW", "journal");
        let victim = "\n[[hal.external]]\nname = \"victim\"\npins = [{ name = \"out\", direction = \"out\", type = \"s32\", safe = 7 }]\n";
        format!("{text}{panel}{victim}")
    };
    let control = Control::start_in(tempfile::tempdir().unwrap(), "external", Stdio::null(), changed);
    assert_eq!(control.machine, machine);
    control.wait_for("up", |status| status["state"] == "disabled");
    let file = |name: &str| {
        let places = directories();
        let mut paths = places
            .iter()
            .map(|place| place.join(format!("isocnc-external-{name}.{machine}")));
        paths.find(|path| path.exists()).expect("the file of the component")
    };
    let (panel, victim) = (file("panel"), file("victim"));
    (control, panel, victim)
}

#[test]
fn writers_that_are_killed_or_write_anything_anywhere_do_not_disturb_a_control_that_runs() {
    let (mut control, file, victim) = start();
    let machine = control.machine.clone();
    let pins = Attached::attach(&machine).unwrap();
    let value = |name: &str| pins.get(name).unwrap().value;
    let cycles = || match value("rt.cycles") {
        AnyValue::U64(cycles) => cycles,
        other => panic!("{other:?}"),
    };
    let mut random = Random(0x1999);
    let until = |what: &str, is: &dyn Fn() -> bool| {
        let give_up = Instant::now() + common::PATIENCE;
        while !is() {
            assert!(Instant::now() < give_up, "never {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    // 200 writers killed at any moment; every other one has been heard by then.
    for round in 0..200 {
        let before = value("panel.a");
        let writer = writer(&machine);
        if round % 2 == 0 {
            until("heard", &|| value("panel.a") != before);
        }
        std::thread::sleep(Duration::from_micros(random.next() % 5000));
        drop(writer);
    }
    let differences = [value("differences.min"), value("differences.max")];
    assert_eq!(differences, [AnyValue::Float(0.0); 2]);
    // Random words everywhere, beside a writer that means well, which loses its session by that again and again.
    let scribbled = std::fs::OpenOptions::new().write(true).open(&file).unwrap();
    let words = scribbled.metadata().unwrap().len() / 8;
    let well_meant = writer(&machine);
    let mut begun = cycles();
    for _ in 0..50 {
        for _ in 0..1000 {
            scribbled
                .write_all_at(&random.next().to_le_bytes(), 8 * (random.next() % words))
                .unwrap();
        }
        until("a cycle beside it", &|| cycles() > begun);
        begun = cycles();
    }
    drop(well_meant);
    // A file that is cut short again and again, written full of something else, and taken away.
    let cut = std::fs::OpenOptions::new().write(true).open(&victim).unwrap();
    let begun = cycles();
    for round in 0..3000u64 {
        cut.set_len(random.next() % 3 * 300).unwrap();
        cut.write_all_at(b"something else", round % 512).unwrap();
    }
    cut.set_len(0).unwrap();
    control.wait_for("told of", |status| status["external"][1]["losses"] == 1);
    std::fs::remove_file(&victim).unwrap();
    std::fs::write(&victim, "something else").unwrap();
    assert_eq!(value("victim.out"), AnyValue::S32(7));
    // Nothing of it was more than the loss of a component, and the next process finds all in order.
    until("lost", &|| value("panel.alive") == AnyValue::Bit(false));
    assert_eq!(value("motion.feed-hold"), AnyValue::Bit(true));
    let differences = [value("differences.min"), value("differences.max")];
    assert_eq!(differences, [AnyValue::Float(0.0); 2]);
    let last = writer(&machine);
    let status = control.wait_for("alive again", |status| status["external"][0]["alive"] == true);
    assert!(cycles() > begun);
    assert_eq!(
        (&status["state"], &status["alarm"]),
        (&"disabled".into(), &serde_json::Value::Null)
    );
    let (_, said) = control.words(&["status"]);
    assert!(
        said.contains("external  panel: its process writes its outputs"),
        "{said}"
    );
    assert!(
        said.contains("external  victim: no process writes its outputs"),
        "{said}"
    );
    drop(last);
    // It ends as any other.
    nix::sys::signal::kill(
        nix::unistd::Pid::from_raw(control.process.id() as i32),
        nix::sys::signal::Signal::SIGINT,
    )
    .unwrap();
    assert_eq!(testing::end(&mut control.process).code(), Some(130));
}
