//! What is kept on the disk, by the code that keeps it, in a process that is killed at any instant.
//!
//! The process is this test binary, started anew: it changes everything again and again, and says the number of each change once
//! all of it counts as written.

use super::console::Operator;
use super::journal_keeper;
use super::memory::{self, Memory};
use super::table_writer::Keeper;
use config::Config;
use machine::journal::Journal;
use machine::state_file::{self, Parts};
use machine::tables::{Tables, lock};
use motion::canon::{Axis, Position};
use program::{Change, ToolChange, changed};
use rt::shared::OperatorEndpoints;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

const KILLS: u64 = 200;
/// Its value is the folder of the process that is to be killed.
const FOLDER: &str = "ISOCNC_TEST_KEEP_IN";
/// How that process is called among the tests.
const PROCESS: &str = "tests_kills::the_process_that_is_killed";

fn machine(folder: &Path) -> Config {
    let text = include_str!("../../../configs/mill3-demo.toml");
    let mut config = config::parse(text, Path::new("demo.toml")).unwrap();
    config.state_directory = Some(folder.to_owned());
    config
}

fn operator(config: &Config) -> Operator {
    let endpoints = OperatorEndpoints {
        commands: rtrb::RingBuffer::new(1).0,
        notices: rtrb::RingBuffer::new(1).1,
        trace: rtrb::RingBuffer::new(1).1,
        finished: rtrb::RingBuffer::new(1).1,
        live: Arc::default(),
        logic: Arc::default(),
    };
    Operator::new(config, endpoints, 0)
}

fn text(number: u64) -> String {
    format!("change {number}")
}

#[test]
fn the_process_that_is_killed() {
    let Some(folder) = std::env::var_os(FOLDER) else {
        return;
    };
    let folder = Path::new(&folder);
    let config = &machine(folder);
    let tables = &Mutex::new(Tables::read(config).unwrap());
    let mut operator = operator(config);
    let opened = Journal::open(folder).unwrap();
    let kept = Arc::new(journal_keeper::Kept::default());
    let (sender, entries) = mpsc::channel();
    operator
        .log_mut()
        .keep(opened.entries, opened.last, sender, Arc::clone(&kept));
    let state = state_file::open(folder, &config.name);
    assert_eq!((opened.warning, state.warning), (None, None));
    let first = state.remembered.parts.count + 1;
    let mut memory = Memory::new(config, state.remembered);
    let writer = memory.kept_on_disk(folder);
    std::thread::scope(|scope| {
        scope.spawn(move || journal_keeper::keep(opened.journal, &entries, &kept));
        scope.spawn(move || memory::write(folder, &writer));
        let mut keeper = Keeper::new(scope, tables, memory);
        for number in first.. {
            let (axis, value) = (Axis::X, number as f64);
            let system = Some(2);
            let offset = Change::Offset { axis, value, system };
            let tool = Change::Tool(ToolChange {
                number: 5,
                length: Some(number as f64),
                ..ToolChange::default()
            });
            for change in [offset, tool] {
                let left = changed(config, &lock(tables), Position::ZERO, None, &change);
                let _ = keeper.hand_in(left.unwrap());
            }
            keeper.memory.add_mdi(&text(number));
            let (count, target) = (number, None);
            keeper.memory.set_parts(Parts { count, target });
            operator.add_entry(text(number));
            let mark = keeper.mark(&operator);
            while !keeper.is_settled(&mark, &operator) {
                keeper.poll(&mut operator);
                keeper.look(&mut operator, 0);
                std::thread::sleep(Duration::from_micros(100));
            }
            assert_eq!(keeper.failure(&operator), None);
            writeln!(std::io::stdout(), "\nchanged {number}").unwrap();
        }
    });
}

/// The numbers of the changes that a process said, which is killed when it has said this many, and some time later.
fn killed_after(folder: &Path, changes: usize, later: Duration) -> Vec<u64> {
    let mut process = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", PROCESS, "--nocapture", "--test-threads=1"])
        .env(FOLDER, folder)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(process.stdout.take().unwrap()).lines();
    let mut numbers = lines.map_while(Result::ok).filter_map(|line| {
        let number = line.strip_prefix("changed ")?;
        number.parse::<u64>().ok()
    });
    let mut said: Vec<u64> = numbers.by_ref().take(changes).collect();
    std::thread::sleep(later);
    process.kill().unwrap();
    // What it has said before it was killed counts.
    said.extend(numbers);
    process.wait().unwrap();
    said
}

#[test]
fn two_hundred_kills_lose_nothing_that_counted_as_written() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let config = machine(folder);
    // A generator of pseudo-random numbers, the same in each run.
    let mut seed = 18_u64;
    let mut random = |below: u64| {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) % below
    };
    let (mut told, mut before) = (Vec::new(), 0);
    for kill in 0..KILLS {
        let later = Duration::from_micros(random(4_000));
        told.extend(killed_after(folder, random(3) as usize, later));
        // A process may be killed when it has written a change and not said so: the next one goes on behind that.
        let said = told.last().copied().unwrap_or(0);
        let most = said.max(before) + 1;
        let state = state_file::open(folder, &config.name);
        assert_eq!(state.warning, None, "kill {kill}");
        let count = state.remembered.parts.count;
        assert!((said..=most).contains(&count), "kill {kill}: {count}, said {said}");
        before = count;
        assert_eq!(
            state.remembered.mdi.last().cloned(),
            (count > 0).then(|| text(count)),
            "kill {kill}"
        );
        // The files that a person edits are whole as well.
        let tables = Tables::read(&config).unwrap_or_else(|error| panic!("kill {kill}: {error}"));
        let found = tables.parameters().iter().find(|(number, _)| *number == 5241);
        let offset = found.map_or(0.0, |(_, value)| *value) as u64;
        let length = tables.tools().tools().find(|tool| tool.number == 5).unwrap().offset[Axis::Z] as u64;
        for value in [offset, length] {
            assert!((said..=most).contains(&value), "kill {kill}: {value}, said {said}");
        }
        let journal = Journal::open(folder).unwrap();
        assert_eq!(journal.warning, None, "kill {kill}");
        assert!(
            journal.entries.iter().map(|entry| entry.seq).eq(1..=journal.last),
            "kill {kill}"
        );
        // A change that a kill met halfway may be in the state and not in the journal: nobody said that it was written.
        for number in &told {
            let kept = journal.entries.iter().any(|entry| entry.text == text(*number));
            assert!(kept, "kill {kill}: change {number} is not in the journal");
        }
    }
    assert!(
        told.len() as u64 > KILLS / 2,
        "only {} changes in {KILLS} processes",
        told.len()
    );
}
