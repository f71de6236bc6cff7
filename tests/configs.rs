//! The files that ship: every machine file is good; the rules are tested one by one beside the reader.

use isocnc::config::{self, Config, ConfigErrors};
use std::path::Path;

const DEMO: &str = include_str!("../configs/mill3-demo.toml");

fn parse(text: &str) -> Result<Config, ConfigErrors> {
    config::parse(text, Path::new("m.toml"))
}

#[test]
fn every_file_that_ships_is_good() {
    let mut seen = 0;
    for entry in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/configs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            config::read(&path).unwrap_or_else(|errors| panic!("{errors}"));
            seen += 1;
        }
    }
    assert!(seen >= 2, "{seen} machine files");
}

#[test]
fn one_mistake_does_not_hide_another() {
    let text = DEMO
        .replace("priority = 80", "prio = 80")
        .replace("jerk_mm_s3 = 20000.0", "jerk_mm_s3 = 0")
        .replace("letter = \"Y\"", "letter = \"X\"");
    let errors = parse(&text).unwrap_err();
    let keys: Vec<&str> = errors.errors().iter().map(|error| error.key.as_str()).collect();
    assert_eq!(keys, ["rt.prio", "joint[2].jerk_mm_s3", "axis[1].letter"]);
}
