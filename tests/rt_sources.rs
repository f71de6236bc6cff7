//! The sources of both real-time threads name nothing that locks, allocates or writes files, but at start-up.
//!
//! In:  the text of the files that run in real time, tests left out.
//! Out: every use of a word of [`FORBIDDEN`] in a function that is not in [`START_UP`].
//!
//! What a file does not name can still be hidden behind a call: `no_allocation.rs` counts. This test finds what a run
//! may happen not to pass.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Rooms of real time, with all that is in them at any depth, and files of other rooms. What is not in real time there stands in
/// [`START_UP`].
const REAL_TIME: &[&str] = &[
    "crates/rt/src",
    "crates/components/src",
    "crates/motion/src/rt",
    "crates/motion/src/kinematics",
    "crates/powerlink/src/mn",
    "crates/ethercat/src/main",
    "cia402/src/axis",
    "crates/motion/src/ring.rs",
    "crates/logic/src/runtime.rs",
    "crates/logic/src/code.rs",
    "crates/logic/src/block.rs",
    "crates/logic/src/arithmetic.rs",
    "crates/logic/src/scalar.rs",
    "hal-pins/src/cell.rs",
    "hal-pins/src/scope/sampler.rs",
    "hal-pins/src/scope/ring.rs",
    "crates/bus/src/watch.rs",
    "crates/bus/src/powerlink/mod.rs",
    "crates/bus/src/powerlink/publisher.rs",
    "crates/bus/src/ethercat/mod.rs",
    "crates/bus/src/ethercat/publisher.rs",
    "crates/host/src/histogram.rs",
    "crates/host/src/latency.rs",
    "crates/host/src/network_locks.rs",
    "crates/host/src/spin.rs",
    "crates/host/src/step_port.rs",
    "crates/host/src/wait.rs",
    "crates/machine/src/overruns.rs",
];

const FORBIDDEN: [&str; 32] = [
    // Locks and queues that lock.
    "Mutex",
    "RwLock",
    "Condvar",
    "Barrier",
    "OnceLock",
    "LazyLock",
    "mpsc",
    "park(",
    "thread::sleep",
    "thread::spawn",
    "thread::Builder",
    "JoinHandle",
    // Allocation.
    "vec!",
    "Vec::new",
    "with_capacity",
    "Box::new",
    "Arc::new",
    "Rc::new",
    "String::",
    "format!",
    "message!",
    "to_string(",
    "to_owned(",
    "to_vec(",
    ".collect(",
    "HashMap",
    "BTreeMap",
    // Files and terminals.
    "println!",
    "eprint",
    "std::fs",
    "std::io",
    "std::net",
];

/// What a function is given only before real time begins: one that is runs at start-up, whatever it is called.
const GIVEN_AT_START_UP: [&str; 2] = ["&mut Hal", "&Config"];

/// What else runs before real time begins, after it has ended or in another thread: file, or folder with all that is below it;
/// function, `*` for all of them; why.
const START_UP: &[(&str, &str, &str)] = &[
    ("crates/bus/src/powerlink/publisher.rs", "rings", "makes the rings"),
    ("crates/bus/src/ethercat/mod.rs", "new", "makes the bus"),
    ("crates/bus/src/ethercat/mod.rs", "node_states", "names for people"),
    (
        "crates/bus/src/powerlink/publisher.rs",
        "new",
        "makes the buffers, which are never freed",
    ),
    (
        "crates/rt/src/cycle/mod.rs",
        "peaks",
        "read by the report when the cycle thread is gone",
    ),
    ("crates/rt/src/logic/mod.rs", "recall", "before the first cycle"),
    ("crates/rt/src/logic/mod.rs", "take_scanners", "before the first cycle"),
    (
        "crates/rt/src/logic/scanner.rs",
        "new",
        "a program that does not run yet",
    ),
    (
        "crates/rt/src/logic/scanner.rs",
        "of_pins",
        "a program that does not run yet",
    ),
    ("crates/rt/src/logic/shared.rs", "new", "makes the cells"),
    ("crates/rt/src/logic/shared.rs", "look", "runs in ordinary threads"),
    (
        "crates/components/src/",
        "",
        "declarations: first values of pins, lists of kinds",
    ),
    ("crates/components/src/", "shape", "makes the pins of an instance"),
    (
        "crates/components/src/component.rs",
        "*",
        "makes kinds and pins; an instance runs by its own `update`",
    ),
    ("crates/logic/src/runtime.rs", "new", "makes the memory"),
    (
        "crates/logic/src/block.rs",
        "all",
        "declares the blocks to the compiler",
    ),
    (
        "crates/logic/src/block.rs",
        "variables",
        "declares the blocks to the compiler",
    ),
    ("crates/host/src/step_port.rs", "", "opens a file, in imports"),
    ("crates/host/src/step_port.rs", "open", "opens the port"),
    (
        "crates/host/src/step_port.rs",
        "octets_and_bits",
        "looks at a machine file",
    ),
    (
        "crates/rt/src/logic/budget.rs",
        "*",
        "looks at a program before it runs",
    ),
    ("crates/rt/src/logic/desk.rs", "*", "the ordinary threads' side"),
    ("crates/rt/src/steps/ticker.rs", "new", "makes the ticker"),
    ("crates/rt/src/tool_pockets.rs", "default", "makes the cells"),
    ("crates/rt/src/cycle_stats.rs", "new", "makes empty figures"),
    (
        "crates/rt/src/waiting.rs",
        "message",
        "a sentence for the operator, made by his thread",
    ),
    (
        "crates/rt/src/waiting.rs",
        "release",
        "a sentence for the operator, made by his thread",
    ),
    (
        "crates/rt/src/waiting.rs",
        "input_message",
        "a sentence for the operator, made by his thread",
    ),
    (
        "crates/rt/src/overrides.rs",
        "check",
        "an order is looked at by the operator's thread before it becomes one",
    ),
    (
        "crates/motion/src/rt/joint_compensation/pitch_file.rs",
        "parse",
        "reads a file of the machine at start-up",
    ),
    (
        "crates/host/src/network_locks.rs",
        "",
        "reads what kernel it is, in imports",
    ),
    ("crates/host/src/network_locks.rs", "open", "makes the sockets"),
    (
        "crates/rt/src/timeout/mod.rs",
        "",
        "the handle of the thread, in imports and the type that ordinary threads hold",
    ),
    ("crates/rt/src/timeout/mod.rs", "spawn", "starts the thread"),
    ("crates/host/src/latency.rs", "new", "makes empty figures"),
    (
        "crates/host/src/latency.rs",
        "ticks_per_ns",
        "compares two clocks before the scan begins",
    ),
    ("crates/host/src/latency.rs", "on_a_thread", "starts the thread"),
    ("crates/bus/src/powerlink/mod.rs", "new", "makes the bus"),
    (
        "crates/motion/src/rt/joint_compensation/pitch_table.rs",
        "new",
        "makes the table",
    ),
    ("crates/motion/src/rt/monitor.rs", "new", "makes the monitor"),
    (
        "crates/motion/src/rt/track.rs",
        "new",
        "makes room for the elements that are kept",
    ),
    ("crates/motion/src/rt/jog/mod.rs", "new", "makes the joints"),
    ("crates/motion/src/rt/jog/world/mod.rs", "new", "makes the axes"),
    ("crates/motion/src/rt/homing/mod.rs", "new", "makes the groups"),
    ("crates/motion/src/rt/homing/group.rs", "new", "makes the joints"),
    ("crates/motion/src/ring.rs", "channel", "makes the ring"),
    ("crates/motion/src/ring.rs", "hold", "the planner's end takes memory"),
    ("crates/rt/src/", "object_name", "names a pin that is made"),
    ("crates/rt/src/", "channel_name", "names a pin that is made"),
];

fn files(root: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for name in REAL_TIME {
        let before = files.len();
        below(&root.join(name), &mut files);
        assert!(files.len() > before, "{name}: no source in it");
    }
    files
}

/// A source, or all of a folder, at any depth, but for tests.
fn below(path: &Path, files: &mut Vec<PathBuf>) {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    if stem.starts_with("tests") || stem.ends_with("_tests") {
        return;
    }
    if path.is_dir() {
        let entries = std::fs::read_dir(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut entries: Vec<PathBuf> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
        entries.sort();
        entries.iter().for_each(|entry| below(entry, files));
    } else if path.extension().is_some_and(|extension| extension == "rs") {
        files.push(path.to_owned());
    }
}

/// Whether an exception is one for this function of this file.
fn excepts(exception: &(&str, &str, &str), file: &str, function: &str) -> bool {
    let (place, known, _) = *exception;
    let is_place = if place.ends_with('/') {
        file.starts_with(place)
    } else {
        file == place
    };
    is_place && (known == "*" || known == function)
}

/// Name of the function that a line begins.
fn function(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let (before, after) = line.split_once("fn ")?;
    let introduces = before
        .split_whitespace()
        .all(|word| matches!(word, "pub" | "const" | "unsafe" | "pub(crate)" | "pub(super)"));
    introduces.then(|| after.split(['(', '<']).next().unwrap_or(after))
}

/// Whether a function, by the lines of its signature, is given what there is only before real time begins.
fn runs_at_start_up<'a>(lines: impl Iterator<Item = &'a str>) -> bool {
    let mut signature = String::new();
    for line in lines {
        signature += line;
        if line.contains('{') || line.ends_with(';') {
            break;
        }
    }
    GIVEN_AT_START_UP.iter().any(|given| {
        let mut behind = signature.split(given).skip(1);
        behind.any(|rest| !rest.starts_with(char::is_alphanumeric))
    })
}

/// Line number, function and word of each forbidden use before the tests of a file, and in what does not run at start-up.
fn uses(text: &str) -> Vec<(usize, String, &'static str)> {
    let mut uses = Vec::new();
    let (mut current, mut is_start_up) = (String::new(), false);
    for (number, line) in (1..).zip(text.lines()) {
        if line.trim_start().starts_with("#[cfg(test)]") {
            break;
        }
        if let Some(name) = function(line) {
            current = name.to_owned();
            is_start_up = runs_at_start_up(text.lines().skip(number - 1));
        } else if line.starts_with(|first: char| first.is_alphabetic() || first == '}') && !line.starts_with("where") {
            // An item of its own begins, or the one before ends.
            current.clear();
            is_start_up = false;
        }
        let code = line.split("//").next().unwrap_or(line);
        let found = FORBIDDEN.into_iter().filter(|word| !is_start_up && code.contains(word));
        uses.extend(found.map(|word| (number, current.clone(), word)));
    }
    uses
}

#[test]
fn real_time_sources_name_no_lock_no_allocation_no_file() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut needed = BTreeSet::new();
    let mut found = Vec::new();
    for path in files(root) {
        let name = path.strip_prefix(root).expect("inside").display().to_string();
        let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        for (line, function, word) in uses(&text) {
            match START_UP.iter().find(|exception| excepts(exception, &name, &function)) {
                Some((file, known, _)) => _ = needed.insert((*file, *known)),
                None => found.push(format!("{name}:{line}: `{word}` in `{function}`")),
            }
        }
    }
    assert!(
        found.is_empty(),
        "real-time code that may lock, allocate or wait:\n{}",
        found.join("\n")
    );
    let idle: Vec<_> = START_UP
        .iter()
        .filter(|(file, function, _)| !needed.contains(&(*file, *function)))
        .collect();
    assert!(idle.is_empty(), "exceptions that nothing needs: {idle:?}");
}

#[test]
fn uses_are_found_with_their_function_and_comments_and_tests_are_not() {
    let text = "use std::sync::Mutex;\nimpl X {\n    pub fn step(&self) { // no vec!\n        let a = vec![1];\n    }\n}\n\
                fn make(\n    hal: &mut Hal,\n) -> X {\n    vec![1];\n}\nfn made(config: &ConfigErrors) {\n    vec![1];\n}\n\
                declare! {\n    in { a: Vec<bool> = vec![false]; }\n}\n\
                #[cfg(test)]\nmod tests { fn t() { format!(); } }\n";
    assert_eq!(
        uses(text),
        [
            (1, String::new(), "Mutex"),
            (4, "step".to_owned(), "vec!"),
            (13, "made".to_owned(), "vec!"),
            (16, String::new(), "vec!")
        ]
    );
}

/// A file that comes into a room of real time is looked at without anybody naming it.
#[test]
fn all_of_a_room_is_real_time_unless_it_is_said_not_to_be() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let found: Vec<String> = files(root)
        .iter()
        .map(|path| path.strip_prefix(root).expect("inside").display().to_string())
        .collect();
    for file in [
        "crates/rt/src/jog_pins.rs",
        "crates/rt/src/steps/ticker.rs",
        "crates/components/src/pid.rs",
        "crates/logic/src/runtime.rs",
        "crates/motion/src/rt/interpolator/mod.rs",
    ] {
        assert!(found.iter().any(|known| known == file), "{file}");
    }
    assert!(!found.iter().any(|file| file.contains("tests")), "{found:?}");
    let exception = ("crates/rt/src/logic/", "new", "");
    assert!(
        excepts(&exception, "crates/rt/src/logic/a.rs", "new") && !excepts(&exception, "crates/rt/src/a.rs", "new")
    );
    assert!(
        !excepts(&("crates/rt/src/a.rs", "new", ""), "crates/rt/src/a.rs", "step")
            && excepts(&("crates/rt/src/a.rs", "*", ""), "crates/rt/src/a.rs", "step")
    );
}
