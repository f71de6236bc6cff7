//! External components: a control and the processes that write its pins, in Rust, C and Python.

use hal_pins::{AnyValue, Change, Claim, EXTERNAL_PINS_MAX, External, ExternalPin, Hal, HalError, Kind, Lost};
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{FileExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Cycles without a record that are borne.
const LIMIT: u64 = 20;

fn pin(name: &str, kind: Kind, value: impl Into<AnyValue>) -> ExternalPin {
    ExternalPin {
        name: name.into(),
        kind,
        value: value.into(),
        keeps: false,
    }
}

/// A control with one external component, "panel.0": `ask` and `turn` are inputs, the others are outputs.
struct Rig {
    hal: Hal,
    panel: External,
    dirs: Vec<PathBuf>,
    folder: tempfile::TempDir,
}

fn rig() -> Rig {
    let pins = [
        pin("ask", Kind::Input, 7i32),
        pin("a", Kind::Output, 1u64),
        pin("turn", Kind::Input, 0.5),
        pin("b", Kind::Output, 1u64),
        pin("lamp", Kind::Output, true),
        pin("level", Kind::Output, -2i32),
    ];
    rig_of("panel.0", &pins, LIMIT)
}

/// In a folder that clients find as that of `$XDG_RUNTIME_DIR`.
fn rig_of(name: &str, pins: &[ExternalPin], limit: u64) -> Rig {
    let folder = tempfile::tempdir().unwrap();
    let dirs = vec![folder.path().join("isocnc")];
    std::fs::create_dir(&dirs[0]).unwrap();
    std::fs::set_permissions(&dirs[0], std::fs::Permissions::from_mode(0o700)).unwrap();
    let mut hal = Hal::create_in(&dirs, "mill.3", 512).unwrap();
    let panel = External::create(&mut hal, name, pins, limit, limit).unwrap();
    Rig {
        hal,
        panel,
        dirs,
        folder,
    }
}

impl Rig {
    fn claim(&self) -> Result<Claim, HalError> {
        Claim::of_in(&self.dirs, "mill.3", "panel.0")
    }

    fn cycle(&mut self) -> Option<Change> {
        let change = self.panel.take(1);
        self.panel.give();
        change
    }

    fn value(&self, pin: &str) -> AnyValue {
        let list = self.hal.list();
        list.iter().find(|info| info.name == pin).unwrap().value
    }

    /// `a`, `b`, `lamp`, `level`.
    fn outputs(&self) -> [AnyValue; 4] {
        ["a", "b", "lamp", "level"].map(|pin| self.value(&format!("panel.0.{pin}")))
    }

    fn file(&self) -> PathBuf {
        self.dirs[0].join("isocnc-external-panel_0.mill.3")
    }

    fn write(&self, word: u64, value: u64) {
        let file = std::fs::OpenOptions::new().write(true).open(self.file()).unwrap();
        file.write_all_at(&value.to_le_bytes(), 8 * word).unwrap();
    }
}

const SAFE: [AnyValue; 4] = [
    AnyValue::U64(1),
    AnyValue::U64(1),
    AnyValue::Bit(true),
    AnyValue::S32(-2),
];

#[test]
fn a_process_writes_outputs_and_reads_inputs_until_it_gives_the_component_up() {
    let mut rig = rig();
    assert_eq!(rig.outputs(), SAFE);
    assert_eq!(rig.value("panel.0.alive"), AnyValue::Bit(false));
    let mut claim = rig.claim().unwrap();
    let names: Vec<&str> = claim.pins().iter().map(|pin| pin.name.as_str()).collect();
    assert_eq!(names, ["ask", "turn", "a", "b", "lamp", "level"]);
    assert_eq!(claim.get("ask").unwrap(), AnyValue::S32(7));
    assert_eq!(claim.get("lamp").unwrap(), AnyValue::Bit(true));
    // Claimed, but nothing written yet.
    assert_eq!((rig.cycle(), rig.outputs()), (None, SAFE));
    rig.hal.set("panel.0.ask", -8i32).unwrap();
    rig.cycle();
    claim.set("level", 5i32).unwrap();
    claim.set("lamp", false).unwrap();
    claim.update().unwrap();
    assert_eq!(claim.get("ask").unwrap(), AnyValue::S32(-8));
    assert_eq!(rig.cycle(), Some(Change::Attached));
    let written = [
        AnyValue::U64(1),
        AnyValue::U64(1),
        AnyValue::Bit(false),
        AnyValue::S32(5),
    ];
    assert_eq!((rig.outputs(), rig.panel.holder()), (written, std::process::id()));
    assert_eq!(rig.value("panel.0.alive"), AnyValue::Bit(true));
    let refused = rig.claim().err().unwrap().to_string();
    let pid = std::process::id();
    assert_eq!(
        refused,
        format!(
            "external component 'panel.0' is claimed by process {pid}: it has one writer at a time; end that process first"
        )
    );
    for (pin, value, why) in [
        ("ask", AnyValue::S32(1), "it is an input of this component"),
        (
            "level",
            AnyValue::Bit(true),
            "'level' is of type s32, but bit is needed",
        ),
        ("levle", AnyValue::S32(1), "did you mean 'level'?"),
    ] {
        let said = claim.set(pin, value).unwrap_err().to_string();
        assert!(said.contains(why), "{said}");
    }
    drop(claim);
    assert_eq!((rig.cycle(), rig.outputs()), (Some(Change::Released), SAFE));
    assert_eq!(rig.value("panel.0.losses"), AnyValue::U32(0));
    rig.claim().unwrap();
}

#[test]
fn a_late_heartbeat_ends_the_session_and_only_a_new_one_writes_again() {
    let mut rig = rig();
    let mut claim = rig.claim().unwrap();
    claim.set("level", 5i32).unwrap();
    claim.update().unwrap();
    assert_eq!(rig.cycle(), Some(Change::Attached));
    for _ in 0..LIMIT {
        assert_eq!(rig.cycle(), None);
        assert_eq!(rig.value("panel.0.level"), AnyValue::S32(5));
    }
    assert_eq!((rig.cycle(), rig.outputs()), (Some(Change::Lost), SAFE));
    assert_eq!(rig.value("panel.0.losses"), AnyValue::U32(1));
    // What goes on is heard of, and not believed.
    assert_eq!(claim.update(), Err(Lost::Ended));
    assert_eq!((rig.cycle(), rig.outputs()), (None, SAFE));
    claim.begin().unwrap();
    assert_eq!(claim.get("level").unwrap(), AnyValue::S32(-2));
    claim.update().unwrap();
    assert_eq!(rig.cycle(), Some(Change::Attached));
    // Cycles that were left out count.
    assert_eq!(rig.panel.take(LIMIT + 1), Some(Change::Lost));
}

#[test]
fn what_is_counted_stays_and_the_next_process_counts_on() {
    let counts = ExternalPin {
        keeps: true,
        ..pin("counts", Kind::Output, 0i32)
    };
    let mut rig = rig_of("panel.0", &[counts, pin("on", Kind::Output, false)], LIMIT);
    let values = |rig: &Rig| (rig.value("panel.0.counts"), rig.value("panel.0.on"));
    let mut claim = rig.claim().unwrap();
    claim.set("counts", -7i32).unwrap();
    claim.set("on", true).unwrap();
    claim.update().unwrap();
    rig.cycle();
    assert_eq!(values(&rig), (AnyValue::S32(-7), AnyValue::Bit(true)));
    // It hangs.
    for _ in 0..=LIMIT {
        rig.cycle();
    }
    assert_eq!(values(&rig), (AnyValue::S32(-7), AnyValue::Bit(false)));
    drop(claim);
    let next = rig.claim().unwrap();
    assert_eq!(next.get("counts").unwrap(), AnyValue::S32(-7));
}

#[test]
fn a_claim_that_never_writes_is_ended_too() {
    let mut rig = rig();
    let mut claim = rig.claim().unwrap();
    for _ in 0..=LIMIT + 1 {
        assert_eq!(rig.cycle(), None);
    }
    assert_eq!(claim.update(), Err(Lost::Ended));
    assert_eq!(rig.outputs(), SAFE);
}

#[test]
fn a_process_hears_that_its_control_has_ended() {
    let rig = rig();
    let mut claim = rig.claim().unwrap();
    let Rig {
        hal,
        panel,
        dirs,
        folder,
    } = rig;
    drop(panel);
    assert_eq!(claim.update(), Err(Lost::Gone));
    let known = Claim::of_in(&dirs, "mill.3", "panel.0").err().unwrap().to_string();
    assert!(known.contains("has no external component 'panel.0'"), "{known}");
    drop(hal);
    let unknown = Claim::of_in(&dirs, "mill.3", "panel.0").err().unwrap().to_string();
    assert!(
        unknown.starts_with("no control for machine 'mill.3' is running"),
        "{unknown}"
    );
    assert_eq!(std::fs::read_dir(&dirs[0]).unwrap().count(), 0, "{folder:?}");
}

#[test]
fn files_of_killed_controls_go_and_those_of_others_stay() {
    let rig = rig();
    let left_over = rig.dirs[0].join("isocnc-external-vfd.lathe.2");
    std::fs::write(&left_over, "").unwrap();
    let other = Hal::create_in(&rig.dirs, "router", 4).unwrap();
    assert!(!left_over.exists() && rig.file().exists());
    drop(other);
}

#[test]
fn the_file_is_as_documented_and_each_damage_is_named() {
    let rig = rig();
    let good = std::fs::read(rig.file()).unwrap();
    let word = |at: usize| u64::from_le_bytes(good[8 * at..8 * at + 8].try_into().unwrap());
    assert_eq!(&good[..8], b"isocEXT\n");
    let words = 16 + 6 * 10 + 2 * (4 + 3) + 2 * (6 + 3);
    assert_eq!([1, 2, 3, 4, 5].map(word), [1, 8 * words, 6, 2, LIMIT]);
    assert_eq!(
        (good.len(), word(6)),
        (8 * words as usize, u64::from(std::process::id()))
    );
    // The first output: third of the pins.
    let third = 16 + 2 * 10;
    assert_eq!(
        [word(third), word(third + 1), word(third + 2)],
        [0x01_01_05, 1, u64::from(b'a')]
    );
    let damaged = |at: u64, value: u64| {
        rig.write(at, value);
        let said = rig.claim().err().unwrap().to_string();
        rig.write(at, word(at as usize));
        said.rsplit(": ").next().unwrap().to_owned()
    };
    let said = [
        (0, 5),
        (1, 2),
        (3, 257),
        (4, 7),
        (3, 5),
        (16, 7),
        (16, 0x03_01_02),
        (16, 0x41_01_02),
        (18, 0x41),
    ];
    let said = said.map(|(at, value)| damaged(at, value));
    for (said, expected) in said.iter().zip([
        "not an external component of a control that runs",
        "layout 2 of another version of isocnc; this one knows 1",
        "257 pins, 2 of them inputs",
        "6 pins, 7 of them inputs",
        "864 octets, expected 752 for 5 pins",
        "pin 0 has type 7",
        "pin 0 is an output",
        "pin 0 has a name that is none",
        "pin 0 has a name that is none",
    ]) {
        assert!(said.ends_with(expected), "{said}");
    }
    rig.claim().unwrap();
}

#[test]
fn a_file_that_is_cut_short_costs_the_component_and_nothing_else() {
    let mut rig = rig();
    let mut claim = rig.claim().unwrap();
    claim.set("level", 5i32).unwrap();
    claim.update().unwrap();
    rig.cycle();
    let file = std::fs::OpenOptions::new().write(true).open(rig.file()).unwrap();
    file.set_len(0).unwrap();
    assert_eq!((rig.cycle(), rig.outputs()), (Some(Change::CutShort), SAFE));
    // As often as anybody likes: it is not touched any more.
    for _ in 0..3000 {
        file.set_len(0).unwrap();
        assert_eq!(rig.cycle(), None);
    }
    assert_eq!(rig.value("panel.0.losses"), AnyValue::U32(1));
}

/// Whatever lies in the place of the file is no way in, and what it leads to stays as it is.
#[test]
fn links_pipes_and_files_of_others_in_the_place_of_the_file_are_refused() {
    let mut rig = rig();
    let mine = rig.folder.path().join("mine");
    std::fs::write(&mine, "mine").unwrap();
    let refused = |rig: &Rig| rig.claim().err().unwrap().to_string();
    let file = rig.file();
    let replace = |with: &dyn Fn()| {
        std::fs::remove_file(&file).unwrap();
        with();
    };
    replace(&|| std::os::unix::fs::symlink(&mine, &file).unwrap());
    assert!(refused(&rig).contains("not a regular file"), "{}", refused(&rig));
    replace(&|| nix::unistd::mkfifo(&file, nix::sys::stat::Mode::S_IRWXU).unwrap());
    assert!(refused(&rig).contains("not a regular file"), "{}", refused(&rig));
    // Somebody else's is not even looked for: no control holds its lock.
    replace(&|| std::fs::write(&file, "theirs").unwrap());
    assert!(refused(&rig).contains("has no external component"), "{}", refused(&rig));
    rig.cycle();
    assert_eq!(rig.outputs(), SAFE);
    // What lies there before a control begins is replaced, and not followed.
    std::os::unix::fs::symlink(&mine, rig.dirs[0].join("isocnc-external-later.mill.3")).unwrap();
    let outputs = [pin("out", Kind::Output, 1.0)];
    let later = External::create(&mut rig.hal, "later", &outputs, LIMIT, LIMIT).unwrap();
    let found = std::fs::symlink_metadata(rig.dirs[0].join("isocnc-external-later.mill.3")).unwrap();
    assert!(found.is_file() && found.permissions().mode() & 0o777 == 0o600);
    drop(later);
    assert_eq!(std::fs::read_to_string(&mine).unwrap(), "mine");
}

#[test]
fn a_heartbeat_that_goes_back_is_none() {
    let mut rig = rig();
    let mut claim = rig.claim().unwrap();
    for level in 1..=5 {
        claim.set("level", level).unwrap();
        claim.update().unwrap();
        rig.cycle();
    }
    for cycle in 0..LIMIT {
        // Numbers of records that were: their places hold others.
        rig.write(10, 3 - cycle % 2);
        assert_eq!((rig.cycle(), rig.value("panel.0.level")), (None, AnyValue::S32(5)));
    }
    rig.write(10, 1);
    assert_eq!((rig.cycle(), rig.outputs()), (Some(Change::Lost), SAFE));
}

#[test]
fn what_is_no_number_is_handed_on_as_by_any_component() {
    let mut rig = rig_of("panel.0", &[pin("x", Kind::Output, 1.0)], LIMIT);
    let mut claim = rig.claim().unwrap();
    for value in [f64::NAN, f64::INFINITY, f64::MIN_POSITIVE / 2.0, -0.0] {
        claim.set("x", value).unwrap();
        claim.update().unwrap();
        rig.cycle();
        let AnyValue::Float(shown) = rig.value("panel.0.x") else {
            panic!()
        };
        assert_eq!(shown.to_bits(), value.to_bits());
    }
}

/// Tells others at its end, also that of a test that fails, that they are to end.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A writer without a pause is never lost for it, however large its record. A cycle comes once it has written another one, be that
/// when it may.
#[test]
fn a_writer_that_never_rests_is_heard() {
    const CYCLES: u64 = 2000;
    for pins in [1, EXTERNAL_PINS_MAX] {
        let outputs: Vec<ExternalPin> = (0..pins)
            .map(|number| pin(&format!("out-{number}"), Kind::Output, 0u64))
            .collect();
        let mut rig = rig_of("panel.0", &outputs, LIMIT);
        let mut claim = rig.claim().unwrap();
        let (written, is_over) = (AtomicU64::new(0), AtomicBool::new(false));
        std::thread::scope(|scope| {
            let _ends = Ends(&is_over);
            scope.spawn(|| {
                for count in 1u64.. {
                    for output in &outputs {
                        claim.set(&output.name, count).unwrap();
                    }
                    claim.update().unwrap();
                    written.store(count, Ordering::Relaxed);
                    if is_over.load(Ordering::Relaxed) {
                        break;
                    }
                }
            });
            let (mut seen, mut shown) = (0, BTreeSet::from([0]));
            for cycle in 0..CYCLES {
                let give_up = Instant::now() + testing::PATIENCE;
                while written.load(Ordering::Relaxed) == seen {
                    assert!(Instant::now() < give_up, "{pins} pins: nothing comes after {seen}");
                    std::thread::yield_now();
                }
                seen = written.load(Ordering::Relaxed);
                let change = rig.cycle();
                assert!(
                    matches!(change, None | Some(Change::Attached)),
                    "cycle {cycle}: {change:?}"
                );
                let [first, last] = [0, pins - 1].map(|number| rig.value(&format!("panel.0.out-{number}")));
                assert_eq!(first, last);
                let AnyValue::U64(first) = first else { panic!() };
                assert!(Some(&first) >= shown.last(), "{first} behind {shown:?}");
                shown.insert(first);
            }
            // It would be lost otherwise.
            assert!(
                shown.len() as u64 > CYCLES / LIMIT,
                "{pins} pins: {} of {seen}",
                shown.len()
            );
        });
    }
}

proptest! {
    /// Whatever stands in the file: the control takes whole records of the session only, and the next process finds the file in order.
    #[test]
    fn any_words_anywhere_disturb_nothing(
        steps in prop::collection::vec(prop::collection::vec((0u64..110, prop_oneof![0u64..4, any::<u64>()]), 0..6), 1..60)
    ) {
        let mut rig = rig();
        let words = std::fs::metadata(rig.file()).unwrap().len() / 8;
        let mut claim = rig.claim().unwrap();
        let mut count = 1;
        for writes in steps {
            for (at, value) in writes {
                rig.write(at % words, value);
            }
            count += 1;
            let _ = claim.set("a", AnyValue::U64(count)).and_then(|()| claim.set("b", AnyValue::U64(count)));
            let said = claim.update();
            rig.cycle();
            if said == Err(Lost::Gone) {
                break;
            }
            if said.is_err() {
                claim.begin().unwrap();
            }
            let [a, b, ..] = rig.outputs();
            prop_assert_eq!(a, b);
        }
        drop(claim);
        for _ in 0..=2 * LIMIT {
            rig.cycle();
        }
        prop_assert_eq!(rig.outputs(), SAFE);
        // What does not change was mended.
        let mut next = rig.claim().unwrap();
        next.update().unwrap();
        prop_assert_eq!(rig.cycle(), Some(Change::Attached));
    }
}

/// A process of ours that ends with the test.
struct Client(Child);

impl Drop for Client {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a client and waits for its first line.
fn client(command: &mut Command, folder: &Path) -> Client {
    let command = command.env("XDG_RUNTIME_DIR", folder).stdout(Stdio::piped());
    let mut client = Client(command.spawn().unwrap());
    let mut line = String::new();
    let mut said = BufReader::new(client.0.stdout.take().unwrap());
    while said.read_line(&mut line).unwrap() > 0 && !line.contains("writes its outputs") {
        line.clear();
    }
    assert!(line.contains("writes its outputs"), "the client ended before it wrote");
    client
}

const DIR: &str = "ISOCNC_TEST_EXTERNAL_DIR";

/// A writer: two outputs that are always the same, as fast as it can.
#[test]
fn role_writer() {
    let Some(dir) = std::env::var_os(DIR) else { return };
    let dirs = [PathBuf::from(dir).join("isocnc")];
    let mut claim = loop {
        match Claim::of_in(&dirs, "mill.3", "panel.0") {
            Ok(claim) => break claim,
            // The kernel has not taken the lock of the one that was killed yet.
            Err(HalError::Claimed { .. }) => std::thread::yield_now(),
            Err(error) => panic!("{error}"),
        }
    };
    let AnyValue::U64(mut count) = claim.get("a").unwrap() else {
        panic!()
    };
    println!("writes its outputs");
    loop {
        count += 1;
        claim.set("a", count).unwrap();
        claim.set("b", count).unwrap();
        if claim.update().is_err() {
            claim.begin().unwrap();
        }
    }
}

#[test]
fn writers_that_are_killed_at_any_moment_never_leave_half_a_record() {
    let mut rig = rig();
    let mut before = 1;
    // Whether a process is heard for the first time.
    let mut look = |rig: &mut Rig, round| {
        // Nobody is late while the next one begins.
        let change = rig.panel.take(0);
        rig.panel.give();
        assert!(!matches!(change, Some(Change::Lost | Change::CutShort)), "{change:?}");
        let [AnyValue::U64(a), AnyValue::U64(b), ..] = rig.outputs() else {
            panic!()
        };
        assert_eq!(a, b, "round {round}");
        assert!(a >= before, "round {round}: {a} behind {before}");
        before = a;
        change.is_some()
    };
    for round in 0..200u64 {
        let mut is_heard = false;
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "external::role_writer", "--nocapture"])
            .env(DIR, rig.folder.path());
        // Its claim waits for a cycle.
        let spawned = std::thread::scope(|scope| {
            let folder = rig.folder.path().to_owned();
            let spawned = scope.spawn(move || client(&mut command, &folder));
            while !spawned.is_finished() {
                is_heard |= look(&mut rig, round);
                std::thread::sleep(Duration::from_micros(200));
            }
            spawned.join().unwrap()
        });
        let until = Instant::now() + Duration::from_micros(137 * (round % 29));
        let give_up = Instant::now() + testing::PATIENCE;
        let mut count = 0;
        // Every other one may be killed before it has written anything.
        while count < 20 || Instant::now() < until || round % 2 == 0 && !is_heard {
            is_heard |= look(&mut rig, round);
            count += 1;
            assert!(Instant::now() < give_up, "round {round}: it is not heard");
        }
        drop(spawned);
    }
    // Written between the last look and the kill.
    rig.panel.take(0);
    for _ in 0..LIMIT {
        assert_eq!(rig.panel.take(1), None);
    }
    assert_eq!((rig.panel.take(1), rig.outputs()), (Some(Change::Lost), SAFE));
}

fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        println!("skipped: there is no {program} here");
    }
    found
}

fn clients() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("clients")
}

/// Runs cycles of a millisecond until this holds.
fn until(rig: &mut Rig, what: &str, mut holds: impl FnMut(&Rig, Option<Change>) -> bool) {
    let end = Instant::now() + testing::PATIENCE;
    loop {
        let change = rig.cycle();
        if holds(rig, change) {
            return;
        }
        assert!(Instant::now() < end, "{what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A client of another language from its claim to a kill: `drive` says what its inputs are, `follows` whether its outputs are as they
/// should be then.
fn through_its_life(rig: &mut Rig, mut command: Command, follows: impl Fn(&Rig) -> bool) {
    let component = rig.file_of_component();
    let folder = rig.folder.path().to_owned();
    let started = std::thread::spawn({
        let folder = folder.clone();
        move || (client(&mut command, &folder), command)
    });
    until(rig, "the client begins", |_, _| started.is_finished());
    let (mut running, mut command) = started.join().unwrap();
    until(rig, "its outputs follow", |rig, _| follows(rig));
    // A second one is refused, and says who has it.
    let second = command
        .env("XDG_RUNTIME_DIR", &folder)
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    let refused = second.spawn().unwrap().wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    let expected = format!(
        "external component '{component}' is claimed by process {}",
        running.0.id()
    );
    assert!(!refused.status.success() && said.contains(&expected), "{said}");
    // Stopped: lost by its heartbeat. It goes on: it hears of it, and begins anew.
    let signal = |signal: i32, of: &Client| {
        // SAFETY: takes two numbers; the process is our child, which is not waited for yet.
        assert_eq!(unsafe { libc::kill(of.0.id() as i32, signal) }, 0);
    };
    signal(libc::SIGSTOP, &running);
    until(rig, "it is lost", |_, change| change == Some(Change::Lost));
    signal(libc::SIGCONT, &running);
    until(rig, "it begins anew", |_, change| change == Some(Change::Attached));
    until(rig, "its outputs follow again", |rig, _| follows(rig));
    // Asked to end, it gives the component up at once.
    signal(libc::SIGTERM, &running);
    until(rig, "it gives the component up", |_, change| {
        change == Some(Change::Released)
    });
    assert!(testing::end(&mut running.0).success());
    // The next one is killed.
    let started = std::thread::spawn(move || client(&mut command, &folder));
    until(rig, "the next one begins", |_, _| started.is_finished());
    let killed = started.join().unwrap();
    until(rig, "its outputs follow", |rig, _| follows(rig));
    drop(killed);
    until(rig, "its loss is seen", |_, change| change == Some(Change::Lost));
}

impl Rig {
    fn file_of_component(&self) -> String {
        let alive = self.hal.list().into_iter().find(|info| info.name.ends_with(".alive"));
        alive.unwrap().name.trim_end_matches(".alive").to_owned()
    }
}

#[test]
fn the_example_in_c_is_compiled_without_a_warning_and_runs_under_the_sanitizers() {
    if !has("cc") {
        return;
    }
    let pins = [
        pin("run", Kind::Input, true),
        pin("speed-cmd", Kind::Input, 90.0),
        pin("speed", Kind::Output, 0.0),
        pin("at-speed", Kind::Output, false),
        pin("updates", Kind::Output, 0u32),
    ];
    let mut rig = rig_of("vfd", &pins, 150);
    let program = rig.folder.path().join("vfd");
    let strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"];
    for extra in [
        &["-O2"][..],
        &["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"],
    ] {
        let mut compiler = Command::new("cc");
        compiler.args(strict).args(extra).arg("-o").arg(&program);
        let compiled = compiler.arg(clients().join("c/vfd.c")).arg("-lm").output().unwrap();
        let said = String::from_utf8_lossy(&compiled.stderr);
        if said.contains("cannot find") && extra.len() > 1 {
            println!("skipped: no libraries of the sanitizers here: {said}");
            continue;
        }
        assert!(compiled.status.success(), "{said}");
        let mut command = Command::new(&program);
        command.arg("mill.3");
        through_its_life(&mut rig, command, |rig| {
            rig.value("vfd.speed") == AnyValue::Float(90.0) && rig.value("vfd.at-speed") == AnyValue::Bit(true)
        });
    }
}

#[test]
fn the_header_is_for_later_c_and_for_cpp_too() {
    for (compiler, standard) in [
        ("cc", &["-std=c11"][..]),
        ("cc", &["-std=gnu17", "-Wconversion"]),
        ("c++", &["-x", "c++", "-std=c++11", "-Wconversion"]),
        ("c++", &["-x", "c++", "-std=c++20"]),
    ] {
        if has(compiler) {
            let mut command = Command::new(compiler);
            command
                .args(standard)
                .args(["-pedantic", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]);
            let compiled = command.arg(clients().join("c/vfd.c")).output().unwrap();
            assert!(
                compiled.status.success(),
                "{standard:?}: {}",
                String::from_utf8_lossy(&compiled.stderr)
            );
        }
    }
}

#[test]
fn the_example_in_python_runs_through_its_life() {
    if !has("python3") {
        return;
    }
    let pins = [
        pin("running", Kind::Input, true),
        pin("alarm", Kind::Input, false),
        pin("green", Kind::Output, false),
        pin("red", Kind::Output, true),
        pin("updates", Kind::Output, 0u32),
    ];
    let mut rig = rig_of("lamp", &pins, 400);
    let mut command = Command::new("python3");
    command.arg("-B").arg(clients().join("python/lamp.py"));
    through_its_life(&mut rig, command, |rig| {
        rig.value("lamp.green") == AnyValue::Bit(true) && rig.value("lamp.red") == AnyValue::Bit(false)
    });
}

#[test]
fn values_of_all_types_cross_in_every_language() {
    let values = [
        ("bit", AnyValue::Bit(true)),
        ("s32", AnyValue::S32(i32::MIN)),
        ("u32", AnyValue::U32(u32::MAX)),
        ("s64", AnyValue::S64(i64::MIN + 1)),
        ("u64", AnyValue::U64(u64::MAX - 1)),
        ("float", AnyValue::Float(-0.1)),
    ];
    let nothing = |value: AnyValue| match value {
        AnyValue::Bit(_) => AnyValue::Bit(false),
        AnyValue::S32(_) => AnyValue::S32(0),
        AnyValue::U32(_) => AnyValue::U32(0),
        AnyValue::S64(_) => AnyValue::S64(0),
        AnyValue::U64(_) => AnyValue::U64(0),
        AnyValue::Float(_) => AnyValue::Float(0.0),
    };
    let inputs = values.map(|(name, value)| pin(&format!("in-{name}"), Kind::Input, value));
    let outputs = values.map(|(name, value)| pin(&format!("out-{name}"), Kind::Output, nothing(value)));
    let pins: Vec<ExternalPin> = inputs.into_iter().chain(outputs).collect();
    let folder = tempfile::tempdir().unwrap();
    let mut commands = Vec::new();
    if has("cc") {
        let source = folder.path().join("echo.c");
        let copies: String = values
            .iter()
            .map(|(name, _)| {
                format!(
                    "isocnc_hal_set_{name}(&hal, isocnc_hal_pin(&hal, \"out-{name}\"), \
                     isocnc_hal_get_{name}(&hal, isocnc_hal_pin(&hal, \"in-{name}\")));\n"
                )
            })
            .collect();
        let text = format!(
            "#include \"isocnc_hal.h\"\nint main(void) {{ static isocnc_hal hal; if (isocnc_hal_claim(&hal, NULL, \"echo\") != 0) return 1;\n\
             puts(\"writes its outputs\"); fflush(stdout); while (isocnc_hal_update(&hal) == 0) {{ {copies} isocnc_hal_sleep_ms(1); }}\n\
             isocnc_hal_release(&hal); return 0; }}\n"
        );
        std::fs::write(&source, text).unwrap();
        let program = folder.path().join("echo");
        let mut compiler = Command::new("cc");
        compiler
            .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-I"])
            .arg(clients().join("c"));
        let compiled = compiler.arg("-o").arg(&program).arg(&source).output().unwrap();
        assert!(
            compiled.status.success(),
            "{}",
            String::from_utf8_lossy(&compiled.stderr)
        );
        commands.push(Command::new(program));
    }
    if has("python3") {
        let text = "import isocnc_hal, time\nwith isocnc_hal.claim('echo') as echo:\n    print('writes its outputs', flush=True)\n    \
                    while True:\n        echo.update()\n        for name in echo.pins():\n            if name.startswith('in-'):\n                \
                    echo['out-' + name[3:]] = echo[name]\n        time.sleep(0.001)\n";
        let mut python = Command::new("python3");
        python
            .args(["-B", "-c", text])
            .env("PYTHONPATH", clients().join("python"));
        commands.push(python);
    }
    for mut command in commands {
        let mut rig = rig_of("echo", &pins, 2000);
        let folder = rig.folder.path().to_owned();
        let started = std::thread::spawn(move || client(&mut command, &folder));
        until(&mut rig, "it begins", |_, _| started.is_finished());
        let _running = started.join().unwrap();
        until(&mut rig, "all values are there", |rig, _| {
            values
                .iter()
                .all(|(name, value)| rig.value(&format!("echo.out-{name}")) == *value)
        });
    }
}
