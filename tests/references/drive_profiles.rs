//! `docs/drive-profiles.md` and `drives/profile.schema.json`: the keys of a drive profile, from what its reader asks.

use super::machine_file::{Keys, as_json, parse};
use super::root;
use isocnc::config::drive_profile_questions;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::LazyLock;
use toml::Table;

const SCHEMA: &str = "drives/profile.schema.json";
const TITLE: &str = "isocnc drive profile";

/// What is in no profile that ships.
const MORE: &str = r#"
schema = 1
description = "a drive of a test"
device_file = "servo.xdd"
[[sdo]]
object = "0x2010:3"
value = 5
bits = 64
"#;

fn shipped() -> Vec<PathBuf> {
    let folder = std::fs::read_dir(root("drives")).expect("drives");
    let mut files: Vec<PathBuf> = folder.map(|entry| entry.expect("an entry").path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    assert!(files.len() >= 3, "{files:?}");
    files.sort();
    files
}

static KEYS: LazyLock<Keys> = LazyLock::new(|| {
    let text = |path: &PathBuf| std::fs::read_to_string(path).expect("a profile that ships");
    let mut files: Vec<(Table, PathBuf)> = shipped().into_iter().map(|path| (parse(&text(&path)), path)).collect();
    files.push((parse(MORE), root("drives/more.toml")));
    Keys::explore(files, drive_profile_questions)
});

#[test]
fn the_keys_of_a_drive_profile() {
    KEYS.check("docs/drive-profiles.md", SCHEMA, TITLE);
}

#[test]
fn every_profile_that_ships_fits_the_schema_that_it_names_and_a_wrong_one_does_not() {
    let validator = jsonschema::validator_for(&KEYS.schema(TITLE, &BTreeMap::new())).expect("a schema");
    for path in shipped() {
        let text = std::fs::read_to_string(&path).expect("a profile that ships");
        assert_eq!(
            text.lines().next(),
            Some("#:schema ./profile.schema.json"),
            "{}",
            path.display()
        );
        let errors: Vec<String> = validator
            .iter_errors(&as_json(&parse(&text)))
            .map(|error| error.to_string())
            .collect();
        assert!(errors.is_empty(), "{}: {errors:?}", path.display());
    }
    let good = MORE.trim_start();
    assert!(validator.is_valid(&as_json(&parse(good))));
    for (from, to) in [
        ("schema = 1", "schema = 2"),
        ("description = \"a drive of a test\"\n", ""),
        ("value = 5", "value = \"5\""),
        ("[[sdo]]", "modes = [\"cps\"]\n[[sdo]]"),
        ("[[sdo]]", "home_offset = \"plus \"\n[[sdo]]"),
        ("[[sdo]]", "[factor_group]\nfeed = [0, 1]\n[[sdo]]"),
        ("[[sdo]]", "[factor_group]\nfeeds = [1, 1]\n[[sdo]]"),
    ] {
        assert!(good.contains(from), "{from}");
        assert!(
            !validator.is_valid(&as_json(&parse(&good.replacen(from, to, 1)))),
            "{to}"
        );
    }
}

#[test]
fn isocnc_schema_prints_the_schema_of_a_profile() {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["schema", "--drive"])
        .output()
        .expect("isocnc");
    let text = std::fs::read_to_string(root(SCHEMA)).expect("the schema");
    assert!(output.status.success() && String::from_utf8_lossy(&output.stdout) == text);
}
