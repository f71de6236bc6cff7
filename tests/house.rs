//! The house: rooms of `src/` use only rooms below them, and ARCHITECTURE.md names what is there.

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

fn architecture() -> String {
    read(Path::new(ROOT).join("ARCHITECTURE.md"))
}

/// Rooms in the order of their table in ARCHITECTURE.md, which is the lowest first.
fn rooms(text: &str) -> Vec<String> {
    let table = text.split("| room |").nth(1).expect("a table of rooms");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let room = |row: &str| {
        row.split('`')
            .nth(1)
            .expect("a name in each row")
            .trim_end_matches('/')
            .to_owned()
    };
    rows.map(room).collect()
}

/// Words after `crate::` that a line names; a group `crate::{a, b::c}` names several.
fn named(line: &str) -> Vec<String> {
    let word = |text: &str| -> String {
        let letters = text.trim_start().chars();
        letters
            .take_while(|letter| letter.is_alphanumeric() || *letter == '_')
            .collect()
    };
    let mut words = Vec::new();
    for rest in line.split("crate::").skip(1) {
        match rest.strip_prefix('{') {
            Some(group) => words.extend(group.split(['}', ',']).map(word)),
            None => words.push(word(rest)),
        }
    }
    words
}

fn room_of(path: &Path) -> Option<String> {
    let below = path.strip_prefix(Path::new(ROOT).join("src")).ok()?;
    let mut parts = below.components();
    let room = parts.next()?.as_os_str().to_str()?.to_owned();
    parts.next().map(|_| room)
}

#[test]
fn a_room_uses_only_rooms_below_it() {
    let rooms = rooms(&architecture());
    let level = |room: &str| rooms.iter().position(|known| known == room);
    let (mut up, mut arrows) = (Vec::new(), BTreeSet::new());
    for path in sources(&Path::new(ROOT).join("src")) {
        let Some(room) = room_of(&path) else { continue };
        let own = level(&room).unwrap_or_else(|| panic!("{room} is no room of ARCHITECTURE.md"));
        for (number, line) in read(&path).lines().enumerate() {
            for used in named(line) {
                let Some(other) = level(&used) else { continue };
                if other > own {
                    up.push(format!("{}:{}: {room} uses {used}", path.display(), number + 1));
                }
                if other != own {
                    arrows.insert((own, other));
                }
            }
        }
    }
    assert!(up.is_empty(), "{}", up.join("\n"));
    assert!(arrows.len() > rooms.len(), "hardly an arrow was found: {arrows:?}");
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
fn items_that_the_architecture_names_are_there() {
    let mut words = BTreeSet::new();
    for path in sources(Path::new(ROOT)) {
        let names = path.strip_prefix(ROOT).expect("below the root").iter();
        words.extend(names.filter_map(|name| Some(name.to_str()?.trim_end_matches(".rs").to_owned())));
        for line in read(&path).lines() {
            let mut before = "";
            for word in line.split(|letter: char| !letter.is_alphanumeric() && letter != '_') {
                if matches!(
                    before,
                    "fn" | "struct" | "enum" | "trait" | "type" | "mod" | "const" | "static"
                ) {
                    words.insert(word.to_owned());
                }
                before = word;
            }
        }
    }
    let text = architecture();
    let is_item = |word: &&str| {
        word.contains("::")
            && word
                .chars()
                .all(|letter| letter.is_alphanumeric() || "_:".contains(letter))
    };
    let items: Vec<&str> = quoted(&text).filter(is_item).collect();
    // Variants of an enum are named by their enum.
    let known = |item: &str| {
        item.rsplit("::")
            .take(2)
            .all(|part| words.contains(part) || part.starts_with(char::is_uppercase))
    };
    let missing: Vec<&&str> = items.iter().filter(|item| !known(item)).collect();
    assert!(
        missing.is_empty(),
        "ARCHITECTURE.md names what is not there: {missing:?}"
    );
    assert!(items.len() > 10, "only {} items were found", items.len());
}

/// Where a bus may be known by its name. The trait of links lies in the crate `powerlink`: EtherCAT's bus names it, too.
const OF_A_BUS: [&str; 4] = ["src/bus/powerlink/", "src/bus/ethercat/", "src/sim/", "src/cli/bus/"];

#[test]
fn nothing_above_the_bus_names_a_bus() {
    let mut named = Vec::new();
    let mut seen = 0;
    for path in sources(&Path::new(ROOT).join("src")) {
        let below = path
            .strip_prefix(ROOT)
            .expect("below the root")
            .to_str()
            .expect("UTF-8")
            .to_owned();
        let is_of_it = OF_A_BUS.iter().any(|folder| below.starts_with(folder));
        let is_door = below == "src/bus/mod.rs";
        for (number, line) in read(&path).lines().enumerate() {
            // The bus's own door chooses between kinds: its module of that name is none of the crate.
            for bus in ["powerlink", "ethercat"] {
                let of_crate = format!("::{bus}::");
                let is_module = is_door && !line.contains(&of_crate) || line.contains(&format!("self::{bus}::"));
                // Keys of the machine file that only one bus has.
                let is_key = bus == "ethercat" && below.starts_with("src/config/");
                let is_comment = line.trim_start().starts_with("//");
                let names = line.contains(&of_crate[2..]) && !is_module && !is_key && !is_comment;
                seen += usize::from(names);
                if names && !is_of_it {
                    named.push(format!("{below}:{}: {}", number + 1, line.trim()));
                }
            }
        }
    }
    assert!(named.is_empty(), "{}", named.join("\n"));
    assert!(seen > 20, "only {seen} names were found");
}

/// Names that a source gives to threads, without numbers.
fn threads(text: &str) -> impl Iterator<Item = &str> {
    // What a test starts is no thread of the process.
    let product = text.split("#[cfg(test)]").next().unwrap_or_default();
    let named = product.split(".name(").skip(1);
    named.filter_map(|rest| {
        let literal = rest.strip_prefix("format!(").unwrap_or(rest).strip_prefix('"')?;
        Some(literal.split(['"', ' ']).next().unwrap_or_default())
    })
}

#[test]
fn every_thread_stands_in_the_table_of_threads() {
    let text = architecture();
    let table = text.split("| thread |").nth(1).expect("a table of threads");
    let rows: Vec<&str> = table
        .lines()
        .take_while(|line| line.starts_with('|') || line.starts_with(' '))
        .collect();
    let mut missing = Vec::new();
    let mut seen = BTreeSet::new();
    for folder in [
        "src",
        "motion/src",
        "powerlink/src",
        "hal-pins/src",
        "gcode/src",
        "panel/src",
    ] {
        for path in sources(&Path::new(ROOT).join(folder)) {
            for name in threads(&read(&path)) {
                seen.insert(name.to_owned());
                let is_it =
                    |row: &&str| row.starts_with(&format!("| `{name}`")) || row.starts_with(&format!("| `{name} "));
                if !rows.iter().any(is_it) {
                    missing.push(format!("{}: {name}", path.display()));
                }
            }
        }
    }
    assert!(missing.is_empty(), "ARCHITECTURE.md does not name threads: {missing:?}");
    assert!(seen.len() >= 11 && seen.contains("planner"), "{seen:?}");
}
