//! Machine files: those that ship are good, and every mistake is found at its place.

use isocnc::config::{self, Config, ConfigErrors};
use proptest::prelude::*;
use std::path::Path;

const DEMO: &str = include_str!("../configs/mill3-demo.toml");

fn parse(text: &str) -> Result<Config, ConfigErrors> {
    config::parse(text, Path::new("m.toml"))
}

/// The lines of all errors after one change of the demo machine.
fn errors_after(from: &str, to: &str) -> Vec<String> {
    assert!(DEMO.contains(from), "the demo machine has no {from:?}");
    let text = DEMO.replacen(from, to, 1);
    parse(&text).expect_err("a mistake must be found").lines().collect()
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
fn values_arrive_where_they_belong() {
    let config = parse(DEMO).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!((config.name.as_str(), config.cycle_us), ("mill3-demo", 1000));
    assert_eq!(
        config.bus.nodes.iter().map(|node| node.id).collect::<Vec<_>>(),
        [1, 2, 3, 10]
    );
    assert_eq!(config.joints[2].travel_mm, [-105.0, 5.0]);
    assert_eq!(config.joints[1].node, 1);
    assert_eq!(config.work_offsets[0].0[..3], [20.0, 20.0, -60.0]);
    // Node 2 says nothing of its mapping: that of its profile.
    assert_eq!(config.bus.nodes[1].outputs, config.bus.nodes[0].outputs);
}

#[test]
fn each_mistake_is_named_at_its_place() {
    let cases: &[(&str, &str, &str)] = &[
        (
            "schema = 1",
            "schema = 2",
            "m.toml:2:10: schema = 2: must be 1, the only schema there is",
        ),
        (
            "cycle_us = 1000",
            "cycle_us = 100",
            "m.toml:7:12: machine.cycle_us = 100: must be 250 to 10000",
        ),
        (
            "priority = 80",
            "priority = 99",
            "m.toml:11:12: rt.priority = 99: must be 1 to 97",
        ),
        (
            "priority = 80",
            "prioritaet = 80",
            "m.toml:11:1: rt.prioritaet: unknown key (did you mean `priority`?)",
        ),
        (
            "phase_us = 370",
            "phase_us = 1000",
            "m.toml:13:12: rt.phase_us = 1000: must be 0 to 999",
        ),
        (
            "lock_memory = true",
            "lock_memory = 1",
            "rt.lock_memory = 1: invalid type: integer `1`, expected a boolean",
        ),
        (
            "require = \"warn\"",
            "require = \"loud\"",
            "rt.require = \"loud\": unknown variant `loud`, expected `strict` or `warn`",
        ),
        (
            "\"trivial\"",
            "\"hexapod\"",
            "machine.kinematics = \"hexapod\": unknown variant `hexapod`, expected `trivial`",
        ),
        (
            "\nid = 1\n",
            "\nid = 240\n",
            "must be 1 to 239, the ids of controlled nodes",
        ),
        (
            "\nid = 2\n",
            "\nid = 1\n",
            "bus.node[1].id = 1: is the id of another node, too",
        ),
        (
            "\"0x607A/32\"",
            "\"607A/32\"",
            "must be an object and its length in bits",
        ),
        ("\"0x607A/32\", ", "", "bus.node[0].outputs: a drive needs 0x607A here"),
        (
            "pres_timeout_us = 150",
            "pres_timeout_us = 900",
            "the cycle of 1000 us is too short: time-outs of 4 nodes 1350 us",
        ),
        (
            "\nnode = 1\n",
            "\nnode = 7\n",
            "joint[0].node = 7: is the id of no [[bus.node]]",
        ),
        ("\nnode = 1\n", "\nnode = 10\n", "joint[0].node = 10: is no drive"),
        (
            "\nnode = 2\n",
            "\nnode = 1\n",
            "joint[1].node = 1: moves another joint already",
        ),
        (
            "counts_per_unit = [10000, 1]",
            "counts_per_unit = [0, 1]",
            "joint[0].counts_per_unit = [0, 1]: both parts",
        ),
        (
            "[-5.0, 305.0]",
            "[305.0, -5.0]",
            "the lower end must be below the upper one",
        ),
        (
            "[-5.0, 305.0]",
            "[-5.0, 1e9]",
            "must fit the 32 bits of a drive's position",
        ),
        (
            "velocity_mm_s = 150.0",
            "velocity_mm_s = -5",
            "joint[0].velocity_mm_s = -5: must be above 0",
        ),
        ("velocity_mm_s = 150.0\n", "", "joint[0].velocity_mm_s: is missing"),
        (
            "stop_acceleration_mm_s2 = 3000.0",
            "stop_acceleration_mm_s2 = 1500.0",
            "must be at least 1.2 times",
        ),
        (
            "following_error_mm = 2.0",
            "following_error_mm = 0.1",
            "the way of two cycles at full speed",
        ),
        (
            "method = 21",
            "method = 31",
            "joint[0].homing.method = 31: is no homing method of CiA 402",
        ),
        (
            "position_mm = 0.0",
            "position_mm = 400.0",
            "must lie within the travel of the joint",
        ),
        (
            "letter = \"X\"",
            "letter = \"Q\"",
            "axis[0].letter = \"Q\": must be one of X Y Z A B C U V W",
        ),
        (
            "joints = [1]",
            "joints = [0]",
            "axis[1].joints = [0]: joint 0 is moved by another axis, too",
        ),
        (
            "joints = [2]",
            "joints = [3]",
            "joint 3 does not exist; there are 3, counted from 0",
        ),
        (
            "[spindle]",
            "[logic]\nperiod_ms = 10\n[spindle]",
            "logic: is not supported yet",
        ),
        ("g54 = {", "g554 = {", "offsets.g554: unknown key (did you mean `g54`?)"),
        ("[machine]", "[machine", "m.toml:4:"),
    ];
    for (from, to, expected) in cases {
        let lines = errors_after(from, to);
        let shown = lines.join("\n");
        assert!(
            lines.iter().any(|line| line.contains(expected)),
            "{to:?} gave\n{shown}\ninstead of {expected}"
        );
        assert!(lines.iter().all(|line| line.starts_with("m.toml:")), "{lines:?}");
    }
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

#[test]
fn the_place_is_underlined() {
    let text = DEMO.replace("priority = 80", "priority = 99");
    let shown = parse(&text).unwrap_err().to_string();
    assert!(shown.contains("--> m.toml:11:12"), "{shown}");
    assert!(shown.contains("^^"), "{shown}");
}

proptest! {
    /// No text makes the reader panic, and what is refused is refused with a reason that can be shown.
    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,200}") {
        if let Err(errors) = parse(&text) {
            prop_assert!(!errors.errors().is_empty());
            prop_assert!(!errors.to_string().is_empty());
        }
    }

    /// The same for a good file with one piece of it replaced.
    #[test]
    fn a_spoilt_file_is_read_or_refused(
        start in 0..DEMO.len(),
        length in 0_usize..40,
        insert in "[-a-z0-9.=\\[\\]\"{}\n ]{0,12}",
    ) {
        let end = (start + length).min(DEMO.len());
        let text = format!("{}{insert}{}", &DEMO[..start], &DEMO[end..]);
        if let Err(errors) = parse(&text) {
            prop_assert!(!errors.errors().is_empty());
            prop_assert!(!errors.to_string().is_empty());
        }
    }
}
