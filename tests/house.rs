//! The house: what Cargo cannot say of it, and that ARCHITECTURE.md names files and threads that are there; its items are links
//! that `cargo doc` checks.

use std::collections::BTreeSet;
use std::fs::{read_dir, read_to_string};
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn read(path: impl AsRef<Path>) -> String {
    let path = path.as_ref();
    read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// All Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.is_dir() && !matches!(name, "target" | ".git" | "fuzz" | "node_modules") {
            found.extend(sources(&path));
        } else if name.ends_with(".rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The crates of the workspace, by their folders; that of the program is the root.
fn crates() -> Vec<String> {
    let mut folders: Vec<String> = ["", "cia402", "hal-pins", "obd"].map(str::to_owned).into();
    let entries = read_dir(Path::new(ROOT).join("crates")).expect("crates");
    folders.extend(entries.map(|entry| {
        let name = entry.expect("an entry").file_name();
        format!("crates/{}", name.to_str().expect("UTF-8"))
    }));
    folders.sort();
    folders
}

fn architecture() -> String {
    read(Path::new(ROOT).join("ARCHITECTURE.md"))
}

/// What stands between back quotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.lines().flat_map(|line| line.split('`').skip(1).step_by(2))
}

#[test]
fn files_that_the_architecture_names_are_there() {
    let text = architecture();
    // A table may say once where its files are, a sentence names those beside another one.
    let bases: BTreeSet<&str> = quoted(&text)
        .filter_map(|word| Some(word.rsplit_once('/')?.0))
        .collect();
    let mut missing = Vec::new();
    let mut seen = 0;
    for word in quoted(&text) {
        let is_path = word.contains('/') || word.ends_with(".rs") || word.ends_with(".md") || word.ends_with(".sh");
        let is_one = word
            .chars()
            .all(|letter| letter.is_ascii_alphanumeric() || "/._-".contains(letter));
        if !is_path || !is_one || word.starts_with('/') {
            continue;
        }
        seen += 1;
        let below = |base: &str| Path::new(ROOT).join(base).join(word).exists();
        if !below("") && !bases.iter().any(|base| below(base)) {
            missing.push(word);
        }
    }
    assert!(
        missing.is_empty(),
        "ARCHITECTURE.md names what is not there: {missing:?}"
    );
    assert!(seen > 60, "only {seen} paths were found");
}

#[test]
fn all_that_is_printed_goes_one_way() {
    // Questions about an output print nothing.
    let asks = [
        "is_terminal()",
        "goes_to_journal(",
        "shows_colours(",
        "takes_more(",
        "ProgressDrawTarget::",
        "use_stderr()",
        "let out = stderr();",
    ];
    let mut printed = 0;
    // The crate that prints, and what tests are made of.
    let others = |folder: &String| !["crates/files", "crates/testing"].contains(&folder.as_str());
    for folder in crates().into_iter().filter(others) {
        for path in sources(&Path::new(ROOT).join(folder).join("src")) {
            if path.to_string_lossy().contains("tests") {
                continue;
            }
            let text = read(&path);
            let product = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
            for (number, line) in (1..).zip(product.lines()) {
                let line = line.split("//").next().unwrap_or_default();
                let lets_through = line.replace("files::outln!", "").replace("files::errln!", "");
                let lets_through = lets_through
                    .replace("printed::stdout()", "")
                    .replace("printed::stderr", "");
                printed += usize::from(lets_through.len() != line.len());
                let found = [
                    "println!",
                    "print!(",
                    "stdout()",
                    "stderr()",
                    "io::stdout",
                    "io::stderr",
                ]
                .iter()
                .any(|way| lets_through.contains(way));
                assert!(
                    !found || asks.iter().any(|ask| lets_through.contains(ask)),
                    "{}:{number}: printed by files::printed only: {line}",
                    path.display()
                );
            }
        }
    }
    assert!(printed > 60, "{printed}");
}

/// Crates that may know a bus by its name; the machine file has keys that only EtherCAT has.
const KNOW_A_BUS: [&str; 4] = ["crates/bus", "crates/bus-tools", "crates/config", "crates/sim"];

#[test]
fn nothing_above_the_bus_depends_on_a_bus() {
    let depends = |folder: &String| {
        let manifest = read(Path::new(ROOT).join(folder).join("Cargo.toml"));
        // What tests of a crate are made of is not in the program.
        let product = manifest.split("[dev-dependencies]").next().unwrap_or_default();
        let mut lines = product.split("[dependencies]").skip(1).flat_map(str::lines);
        lines.any(|line| {
            ["powerlink", "ethercat"]
                .iter()
                .any(|bus| line.split(['.', ' ']).next() == Some(bus))
        })
    };
    let found: Vec<String> = crates().into_iter().filter(depends).collect();
    assert_eq!(found, KNOW_A_BUS);
}

/// Names that a source gives to threads, without numbers.
fn threads(text: &str) -> Vec<&str> {
    // What a test starts is no thread of the process.
    let product = text.split("#[cfg(test)]").next().unwrap_or_default();
    let given = [".name(", "named(", "in_a_thread("].map(|call| product.split(call).skip(1));
    let named = given.into_iter().flatten().filter_map(|rest| {
        let literal = rest.strip_prefix("format!(").unwrap_or(rest).strip_prefix('"')?;
        Some(literal.split(['"', ' ']).next().unwrap_or_default())
    });
    let is_thread = product.contains("thread") && product.contains("Builder::new()");
    named.filter(|_| is_thread).collect()
}

/// Rows of the tables of threads: those of the process, then those of the supervisor.
fn thread_rows(text: &str) -> Vec<&str> {
    let tables = text.split("| thread |").skip(1);
    tables
        .flat_map(|table| table.lines().skip(2).take_while(|line| line.starts_with('|')))
        .collect()
}

#[test]
fn every_thread_stands_in_the_table_of_threads() {
    let text = architecture();
    let rows = thread_rows(&text);
    let mut missing = Vec::new();
    let mut seen = BTreeSet::new();
    let mut literals = String::new();
    for folder in crates() {
        let all = sources(&Path::new(ROOT).join(&folder).join("src"));
        for path in all
            .iter()
            .filter(|path| !path.components().any(|part| part.as_os_str() == "tests"))
        {
            let source = read(path);
            for name in threads(&source) {
                seen.insert(name.to_owned());
                // A row may say what its thread starts.
                let is_it = |row: &&str| row.contains(&format!("`{name}`")) || row.starts_with(&format!("| `{name} "));
                if !rows.iter().any(is_it) {
                    missing.push(format!("{}: {name}", path.display()));
                }
            }
            literals += &source;
        }
    }
    assert!(missing.is_empty(), "ARCHITECTURE.md does not name threads: {missing:?}");
    assert!(
        seen.len() >= 30
            && ["planner", "cell-orders", "sends"]
                .iter()
                .all(|name| seen.contains(*name)),
        "{seen:?}"
    );
    // Nor does it name threads that nobody starts; a process is called as it is.
    let name = |row: &&str| {
        row.split('`')
            .nth(1)
            .unwrap_or_default()
            .split(' ')
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    let started = |name: &String| {
        name.starts_with("isocnc")
            || literals.contains(&format!("\"{name}\""))
            || literals.contains(&format!("\"{name} "))
    };
    let idle: Vec<String> = rows.iter().map(name).filter(|name| !started(name)).collect();
    assert!(
        idle.is_empty(),
        "threads of ARCHITECTURE.md that nobody starts: {idle:?}"
    );
}

/// Tests are modules of few programs, which cargo does not look for: one that none of them names would never run.
#[test]
fn every_file_of_tests_is_part_of_a_program() {
    let mut unused = Vec::new();
    for folder in crates() {
        let folder = Path::new(ROOT).join(folder);
        let tests = folder.join("tests");
        let manifest = read(folder.join("Cargo.toml"));
        if !tests.exists() || !manifest.contains("autotests = false") {
            continue;
        }
        let files = sources(&tests);
        let mut text: String = files.iter().map(read).collect();
        text += &read(folder.join("src/lib.rs"));
        for file in files {
            let name = file.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
            // A module in a folder of its own has the folder's name.
            let parent = file.parent().and_then(|parent| parent.file_name()?.to_str());
            let module = match name {
                "mod" | "main" => parent.unwrap_or_default(),
                name => name,
            };
            let is_program = manifest.contains(&format!("[[test]]\nname = \"{module}\""));
            if !is_program && !text.contains(&format!("mod {module};")) && !text.contains(&format!("{name}.rs\"]")) {
                unused.push(file.display().to_string());
            }
        }
    }
    assert!(unused.is_empty(), "no program has these tests: {unused:#?}");
}
