//! The oscilloscope's ring: records of every cycle, losses that are counted, and nothing that another process does disturbs the cycle.

use hal_pins::scope::{CAPTURES, CHANNELS_MAX, Capture, Sampler, check};
use hal_pins::{AnyValue, Attached, Hal, HalError, Output};
use proptest::prelude::*;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const PERIOD_NS: u64 = 1_000_000;
const DIR: &str = "ISOCNC_TEST_SCOPE_DIR";
/// Records of one channel that a ring holds.
const DEPTH: u64 = (1 << 17) / 3;

struct Rig {
    count: Output<i32>,
    wave: Output<f64>,
    sampler: Sampler,
    far: Attached,
    _hal: Hal,
    dir: tempfile::TempDir,
    cycles: u64,
}

fn rig() -> Rig {
    let dir = tempfile::tempdir().unwrap();
    let dirs = vec![dir.path().to_owned()];
    let mut hal = Hal::create_in(&dirs, "m", 16).unwrap();
    let count = hal.output::<i32>("a.count").unwrap();
    let wave = hal.output::<f64>("a.wave").unwrap();
    hal.set_unit("a.wave", "mm").unwrap();
    hal.input("b.in", 0.0).unwrap();
    hal.input("b.on", true).unwrap();
    hal.link("net", "a.wave", &["b.in"]).unwrap();
    hal.alias("name", "b.in").unwrap();
    Rig {
        count,
        wave,
        sampler: Sampler::new(&hal, PERIOD_NS).unwrap(),
        far: Attached::attach_in(&dirs, "m").unwrap(),
        _hal: hal,
        dir,
        cycles: 0,
    }
}

impl Rig {
    fn path(&self) -> PathBuf {
        self.dir.path().join("isocnc-scope.m")
    }

    fn cycle(&mut self) {
        self.count.set(self.cycles as i32);
        self.wave.set(self.cycles as f64 * 0.5);
        self.sampler.sample(7 + self.cycles * PERIOD_NS);
        self.cycles += 1;
    }

    fn cycles(&mut self, count: u64) {
        (0..count).for_each(|_| self.cycle());
    }
}

/// Number of the cycle, date, values.
type Row = (u64, u64, Vec<AnyValue>);

fn rows(capture: &mut Capture, most: usize) -> Result<Vec<Row>, HalError> {
    let channels = capture.channels().to_vec();
    let mut rows = Vec::new();
    capture.read(most, |record| {
        let values = channels.iter().zip(record.words);
        let values = values.map(|(channel, word)| channel.value(*word)).collect();
        rows.push((record.cycle, record.time_ns, values));
    })?;
    Ok(rows)
}

#[test]
fn every_cycle_is_a_record_with_its_date_and_the_values_of_all_channels() {
    let mut rig = rig();
    rig.cycles(3);
    let mut capture = Capture::begin(&rig.far, &["a.count", "net", "name", "b.on", "a.count"]).unwrap();
    assert_eq!(capture.period_ns(), PERIOD_NS);
    assert_eq!(rows(&mut capture, 9).unwrap(), [], "not asked for yet");
    rig.cycles(2);
    let row = |cycle: u64| {
        let (count, wave) = (AnyValue::S32(cycle as i32), AnyValue::Float(cycle as f64 * 0.5));
        (
            cycle,
            7 + cycle * PERIOD_NS,
            vec![count, wave, wave, AnyValue::Bit(true), count],
        )
    };
    assert_eq!(rows(&mut capture, 1).unwrap(), [row(3)]);
    rig.cycles(1);
    assert_eq!(rows(&mut capture, 9).unwrap(), [row(4), row(5)]);
    assert_eq!((rows(&mut capture, 9).unwrap().len(), capture.lost()), (0, 0));
    let units: Vec<&str> = capture.channels().iter().map(|channel| channel.unit.as_str()).collect();
    assert_eq!(units, ["", "", "", "", ""], "a net has none");
    assert!(capture.is_running());
    drop(rig.sampler);
    assert!(!capture.is_running() && !rig.dir.path().join("isocnc-scope.m").exists());
    let late = Capture::begin(&rig.far, &["net"]).err().unwrap();
    assert!(matches!(late, HalError::NoScope), "{late}");
}

#[test]
fn a_ring_goes_round_without_a_gap_and_counts_what_finds_it_full() {
    let mut rig = rig();
    let mut capture = Capture::begin(&rig.far, &["a.count"]).unwrap();
    let mut next = 0;
    // Many times round, with blocks that do not divide it.
    while next < 3 * DEPTH {
        rig.cycles(9_973);
        for (cycle, _, values) in rows(&mut capture, usize::MAX).unwrap() {
            assert_eq!((cycle, &values[0]), (next, &AnyValue::S32(next as i32)));
            next += 1;
        }
    }
    assert_eq!((next, capture.lost()), (rig.cycles, 0));
    rig.cycles(DEPTH + 5);
    assert_eq!(capture.lost(), 5);
    let kept = rows(&mut capture, usize::MAX).unwrap();
    assert_eq!((kept.len() as u64, kept[0].0), (DEPTH, next));
    rig.cycles(2);
    // The numbers tell where something is missing.
    assert_eq!(rows(&mut capture, 9).unwrap()[0].0, next + DEPTH + 5);
    assert_eq!(capture.lost(), 5);
}

#[test]
fn captures_do_not_know_of_each_other_and_one_too_many_is_refused_in_words() {
    let mut rig = rig();
    let mut slow = Capture::begin(&rig.far, &["a.wave"]).unwrap();
    let mut captures: Vec<Capture> = (1..CAPTURES)
        .map(|_| Capture::begin(&rig.far, &["a.count", "a.wave"]).unwrap())
        .collect();
    rig.cycles(DEPTH + 100);
    captures[0].read(10, |_| ()).unwrap();
    assert_eq!((slow.lost(), rows(&mut slow, 1).unwrap()[0].0), (100, 0));
    let refused = Capture::begin(&rig.far, &["a.wave"]).err().unwrap().to_string();
    let pid = std::process::id();
    assert_eq!(
        refused,
        format!(
            "all 4 captures of the oscilloscope are in use, by the processes {pid}, {pid}, {pid}, {pid}: end one of them"
        )
    );
    captures.remove(1);
    let mut again = Capture::begin(&rig.far, &["b.on"]).unwrap();
    assert_eq!(rows(&mut again, 1).unwrap(), []);
    rig.cycle();
    assert_eq!(rows(&mut again, 9).unwrap().len(), 1);
    let names = vec!["a.wave"; CHANNELS_MAX + 1];
    let many = Capture::begin(&rig.far, &names).err().unwrap().to_string();
    assert_eq!(many, "33 channels: a capture has 1 to 32");
    let near = Capture::begin(&rig.far, &["a.cuont"]).err().unwrap().to_string();
    assert_eq!(near, "no pin or net 'a.cuont'; did you mean 'a.count'?");
}

fn open(path: &Path) -> File {
    File::options().read(true).write(true).open(path).unwrap()
}

#[test]
fn a_file_that_is_cut_short_stops_no_cycle_and_is_told() {
    let mut rig = rig();
    let mut capture = Capture::begin(&rig.far, &["a.count"]).unwrap();
    rig.cycles(5);
    capture.read(1, |_| ()).unwrap();
    open(&rig.path()).set_len(4096).unwrap();
    rig.cycles(2000);
    let told = capture.read(9, |_| ()).unwrap_err().to_string();
    assert!(
        told.ends_with("isocnc-scope.m: was cut short or overwritten by another process"),
        "{told}"
    );
    // The pins are another file.
    assert_eq!(rig.far.get("a.count").unwrap().value, AnyValue::S32(2004));
    open(&rig.path()).set_len(0).unwrap();
    rig.cycles(5);
    assert!(Capture::begin(&rig.far, &["a.count"]).is_err());
}

#[test]
fn what_is_no_oscilloscope_is_refused() {
    let rig = rig();
    let good = std::fs::read(rig.path()).unwrap();
    let path = rig.dir.path().join("copy");
    for (word, value, told) in [
        (0, 1, "not the oscilloscope of a control"),
        (1, 9, "layout 9 of another version"),
        (2, 5, "damaged: 5 captures"),
        (3, u64::MAX, "damaged: 4 captures of 18446744073709551615 words"),
    ] {
        std::fs::write(&path, &good).unwrap();
        open(&path).write_all_at(&u64::to_le_bytes(value), 8 * word).unwrap();
        let found = check(&open(&path)).unwrap_err();
        assert!(found.starts_with(told), "{found}");
    }
    std::fs::write(&path, &good).unwrap();
    assert_eq!(check(&open(&path)), Ok(()));
    for len in [0, 8, good.len() as u64 - 8, good.len() as u64 + 8] {
        open(&path).set_len(len).unwrap();
        assert!(check(&open(&path)).is_err(), "{len}");
    }
}

#[test]
fn what_a_killed_control_has_left_is_none_and_is_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let dirs = [dir.path().to_owned()];
    std::fs::write(dir.path().join("isocnc-scope.m"), "left over").unwrap();
    let hal = Hal::create_in(&dirs, "m", 4).unwrap();
    let far = Attached::attach_in(&dirs, "m").unwrap();
    let none = Capture::begin(&far, &["a.count"]).err().unwrap();
    assert!(matches!(none, HalError::Unknown { .. }), "{none}");
    let sampler = Sampler::new(&hal, 1).unwrap();
    assert_eq!(check(&open(&dir.path().join("isocnc-scope.m"))), Ok(()));
    let names: Vec<_> = std::fs::read_dir(dir.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(names.len(), 2, "{names:?}");
    drop(sampler);
    assert!(!dir.path().join("isocnc-scope.m").exists());
}

/// Reader: captures and reads nothing more.
#[test]
fn role_reader() {
    let Some(dir) = std::env::var_os(DIR) else { return };
    let far = Attached::attach_in(&[PathBuf::from(dir)], "m").unwrap();
    let _capture = Capture::begin(&far, &["a.count"]).unwrap();
    println!("READER READY");
    std::thread::sleep(std::time::Duration::from_secs(600));
}

#[test]
fn a_killed_reader_costs_the_cycle_nothing_and_its_ring_is_free() {
    let mut rig = rig();
    for _ in 0..2 * CAPTURES {
        let mut reader = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "scope::role_reader", "--nocapture", "--test-threads=1"])
            .env(DIR, rig.dir.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(reader.stdout.take().unwrap()).lines();
        assert!(lines.map_while(Result::ok).any(|line| line.contains("READER READY")));
        rig.cycles(10);
        reader.kill().unwrap();
        testing::end(&mut reader);
        rig.cycles(DEPTH + 10);
    }
    let mut capture = Capture::begin(&rig.far, &["a.count"]).unwrap();
    let before = rig.cycles;
    rig.cycles(4);
    let rows = rows(&mut capture, 9).unwrap();
    assert_eq!((rows.len(), rows[0].0, capture.lost()), (4, before, 0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever anybody writes into the words before the rings: the cycle goes on, readers are told, none reads forged places.
    #[test]
    fn any_words_anywhere_disturb_no_cycle(
        changes in prop::collection::vec((0usize..8 + 4 * 64, prop_oneof![any::<u64>(), 0u64..70]), 1..40),
    ) {
        let mut rig = rig();
        let file = open(&rig.path());
        let mut capture = Capture::begin(&rig.far, &["a.count", "a.wave"]).unwrap();
        rig.cycles(3);
        for (word, value) in changes {
            file.write_all_at(&value.to_le_bytes(), 8 * word as u64).unwrap();
            rig.cycles(3);
            let _ = rows(&mut capture, 10);
            capture.lost();
        }
        prop_assert_eq!(rig.far.get("a.count").unwrap().value, AnyValue::S32(rig.cycles as i32 - 1));
        if let Ok(mut other) = Capture::begin(&rig.far, &["a.wave"]) {
            rig.cycles(2);
            let _ = rows(&mut other, 10);
        }
    }
}
