//! `machine.kinematics` and `[kinematics]`: what the example machines say, and one case per rule.

use super::tests::{Case, messages};
use super::*;
use motion::canon::Axis;
use motion::kinematics::{Elbow, Hand, LinearDelta, RotaryAxis, Transform};

const TRUNNION: &str = include_str!("../../../configs/trunnion5-demo.toml");
const HEAD: &str = include_str!("../../../configs/head5-demo.toml");
const COREXY: &str = include_str!("../../../configs/corexy-demo.toml");
const SCARA: &str = include_str!("../../../configs/scara-demo.toml");
const DELTA: &str = include_str!("../../../configs/delta-demo.toml");

fn read(text: &str) -> Config {
    parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// The messages of a file in which the only occurrence of each text is replaced, without their places.
fn check(text: &str, cases: &[Case]) {
    for (old, new, expected) in cases {
        assert_eq!(text.matches(old).count(), 1, "{old:?} stands once in the file");
        let found = messages(&text.replace(old, new));
        let found: Vec<&str> = found
            .iter()
            .map(|message| message.splitn(4, ':').nth(3).unwrap_or("").trim())
            .collect();
        // A hint may follow.
        let begins = |(found, expected): (&&str, &&str)| found.starts_with(expected);
        let as_expected = found.len() == expected.len() && found.iter().zip(*expected).all(begins);
        assert!(as_expected, "{new:?} for {old:?}: {found:?} for {expected:?}");
    }
}

#[test]
fn every_family_is_read_with_its_parameters() {
    let Transform::TableTable(table) = read(TRUNNION).transform else {
        panic!("a table on a table");
    };
    assert_eq!(
        (table.primary.axis, table.secondary.axis),
        (RotaryAxis::A, RotaryAxis::C)
    );
    assert_eq!(
        (table.primary.centre_mm, table.primary.hand),
        ([0.0, 0.0, -120.0], Hand::Left)
    );
    let Transform::HeadTable(head) = read(HEAD).transform else {
        panic!("a head over a table");
    };
    assert_eq!((head.head.axis, head.head.hand), (RotaryAxis::B, Hand::Right));
    assert_eq!((head.pivot_mm, head.table.hand), ([0.0, 0.0, 150.0], Hand::Left));
    let Transform::Scara(arms) = read(SCARA).transform else {
        panic!("arms");
    };
    assert_eq!((arms.inner_arm_mm, arms.outer_arm_mm), (300.0, 200.0));
    assert_eq!((arms.elbow, arms.shoulder_middle_degrees), (Elbow::Positive, 0.0));
    let Transform::LinearDelta(rods) = read(DELTA).transform else {
        panic!("rods");
    };
    assert_eq!(
        (rods.rod_mm, rods.radius_mm, rods.towers[1]),
        (250.0, 150.0, LinearDelta::tower(-30.0))
    );
    let corexy = read(COREXY);
    assert_eq!(corexy.transform, Transform::CoreXy);
    assert_eq!(corexy.axes[0].travel_mm, Some([0.0, 300.0]));
    let follows: Vec<_> = corexy
        .kinematics()
        .joints()
        .iter()
        .map(|follows| (follows.axis, follows.offset))
        .collect();
    let wanted = [(Axis::X, 0.0), (Axis::Y, 0.0), (Axis::Z, 0.0), (Axis::Z, 0.15)];
    assert_eq!(follows, wanted.map(|(axis, offset)| (Some(axis), offset)));
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_kinematics() {
    check(TRUNNION, &[
        ("kinematics = \"table-table\"", "kinematics = \"tabletable\"", &[
            "machine.kinematics = \"tabletable\": must be \"trivial\" or \"corexy\" or \"table-table\" or \"head-table\" or \"scara\" or \"linear-delta\" or \"none\"; did you mean \"table-table\"?",
        ]),
        ("primary = \"A\" ", "primary = \"D\" ", &["kinematics.primary = \"D\": must be \"A\" or \"B\" or \"C\""]),
        ("primary = \"A\" ", "primary = \"C\" ", &["kinematics.secondary = \"C\": must be another axis than primary"]),
        ("secondary = \"C\" ", "secondary = \"B\" ", &["axis: is missing for these kinematics: B"]),
        ("primary_centre_mm = [0.0, 0.0, -120.0]", "", &["kinematics.primary_centre_mm: is missing: an array of 3 numbers"]),
        ("[0.0, 0.0, -120.0]", "[0.0, -120.0]", &["kinematics.primary_centre_mm = [0.0, -120.0]: must be 3 numbers, are 2"]),
        ("[0.0, 0.0, -120.0]", "[0.0, \"0\", nan]", &[
            "kinematics.primary_centre_mm[1] = \"0\": must be a number, is a string",
            "kinematics.primary_centre_mm[2] = nan: must be a finite number",
        ]),
        ("primary_turns", "primary_turn", &["kinematics.primary_turn: unknown key; did you mean `primary_turns`?"]),
        ("letter = \"Z\"\n", "letter = \"Z\"\ntravel_mm = [0, 1]\n", &["axis[2].travel_mm = [0, 1]: the joints' own travel_mm is that of the axis"]),
    ]);
    check(HEAD, &[
        ("table = \"C\"", "table = \"B\"", &["kinematics.table = \"B\": must be another axis than head"]),
        ("pivot_length_mm = 150.0", "pivot_length_mm = inf", &["kinematics.pivot_length_mm = inf: must be a finite number"]),
    ]);
    check(COREXY, &[
        ("cycle_us = 1000\n", "cycle_us = 1000\n[kinematics]\nradius_mm = 1\n", &["kinematics.radius_mm: unknown key"]),
        ("letter = \"Y\"", "letter = \"B\"", &["axis: is missing for these kinematics: Y"]),
    ]);
    check(SCARA, &[
        ("outer_arm_mm = 200.0", "outer_arm_mm = 0", &["kinematics.outer_arm_mm = 0: must be above 0"]),
        ("travel_mm = [-150.0, 150.0]", "travel_mm = [-190.0, 190.0]", &["joint: the shoulder of a SCARA (the joint of X) must turn less than 360 degrees"]),
        ("travel_mm = [2.0, 150.0]", "travel_mm = [2.0, 190.0]", &["joint: the elbow of a SCARA (the joint of Y) must stay within -180 and 180 degrees"]),
    ]);
    check(DELTA, &[
        ("radius_mm = 150.0", "radius_mm = 250.0", &["kinematics.radius_mm = 250.0: must be below rod_mm, 250"]),
        ("[90.0, -30.0, -150.0]", "[90.0, -30.0, 330.0]", &["kinematics.tower_angles_degrees = [90.0, -30.0, 330.0]: must lie apart, like [90.0, -30.0, -150.0]"]),
    ]);
}

#[test]
fn the_classic_planner_is_for_linear_kinematics_only() {
    let classic = |text: &str| {
        assert!(!text.contains("[program]"), "the example has none of its own");
        messages(&format!("{text}\n[program]\nplanner = \"classic\"\n"))
    };
    for text in [TRUNNION, HEAD, SCARA, DELTA] {
        let found = classic(text);
        let line = text.lines().count() + 3;
        assert_eq!(found.len(), 1, "{found:?}");
        let begin = format!("m.toml:{line}:11: program.planner = \"classic\": plans for the axes of the program");
        assert!(found[0].starts_with(&begin), "{found:?}, not {begin}");
        assert!(found[0].contains("expected \"optimal\""), "{found:?}");
    }
    assert_eq!(classic(COREXY), Vec::<String>::new());
}

#[test]
fn the_elbow_stays_as_it_is_homed() {
    let text = SCARA
        .replace("[2.0, 150.0]", "[-150.0, -2.0]")
        .replace("position_mm = 90.0", "position_mm = -90.0");
    let Transform::Scara(arms) = read(&text).transform else {
        panic!("arms");
    };
    assert_eq!(arms.elbow, Elbow::Negative);
}
