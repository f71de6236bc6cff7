//! Homing: what is changed in a right file, and the message with its place.

use super::tests::{SMALL, messages};
use super::*;

/// The gantry of the examples, homed by the control.
const GANTRY: &str = include_str!("../../../configs/gantry-demo.toml");

/// The smallest machine, homed by the control; `keys` stand behind the others of its homing, from line 26 on.
fn small(keys: &str) -> String {
    let homing = "method = 37\nsearch_mm_s = 10.0\nlatch_mm_s = 1.0\nacceleration_mm_s2 = 100.0\n";
    assert_eq!(SMALL.matches(homing).count(), 1);
    let by = "by = \"control\"\nsearch_mm_s = 10.0\nlatch_mm_s = 1.0\ntowards = \"positive\"\nswitch_mm = 11.0\n";
    let net = "[[hal.net]]\nname = \"home\"\nsource = \"io.2.in-08\"\ntargets = [\"joint.0.home-sw-in\"]\n";
    format!("{}{net}", SMALL.replace(homing, &format!("{by}{keys}")))
}

fn changed(text: &str, old: &str, new: &str) -> String {
    assert_eq!(text.matches(old).count(), 1, "{old:?} stands once in the file");
    text.replace(old, new)
}

#[test]
fn what_is_left_out_suits_the_joint() {
    let config = parse(&small(""), Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let homing = config.joints[0].homing;
    let control = HomingByControl {
        towards_positive: true,
        switch: HomeSwitch::Pin,
        switch_mm: 11.0,
        // From -10 to the switch, and the way of the release.
        search_distance_mm: 26.0,
        release_distance_mm: 5.0,
        resolution_mm: 1e-3,
        bounce_s: 0.02,
        skew_mm: None,
        index: None,
    };
    assert_eq!(homing.by, HomingBy::Control(control));
    assert_eq!((homing.position_mm, homing.sequence), (0.0, None));
    let coarse = changed(&small(""), "[1000, 1]", "[100, 1]");
    let config = parse(&coarse, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let HomingBy::Control(control) = config.joints[0].homing.by else {
        panic!("by the control")
    };
    assert_eq!(control.resolution_mm, 0.01, "an increment of the drive");
}

#[test]
fn joints_home_in_the_order_of_their_numbers_those_of_z_first() {
    let order = |text: &str| {
        let config = parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
        config.homing_order()
    };
    assert_eq!(order(GANTRY), [0b1000, 0b0111]);
    let text = changed(
        GANTRY,
        "acceleration_mm_s2 = 500.0 }",
        "acceleration_mm_s2 = 500.0, sequence = 7 }",
    );
    assert_eq!(order(&text), [0b0111, 0b1000]);
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_homing_by_the_control() {
    let cases: &[(String, &[&str])] = &[
        (small("method = 37\n"), &["m.toml:26:10: joint[0].homing.method = 37: is for by = \"drive\""]),
        (small("bounce = 1\n"), &["m.toml:26:1: joint[0].homing.bounce: unknown key; did you mean `bounce_s`?"]),
        (small("index_distance_mm = 6.0\nindex_probe = 2\n"), &[
            "m.toml:26:21: joint[0].homing.index_distance_mm = 6.0: \"0x60B8/16\" must be among the outputs of its node",
            "m.toml:26:21: joint[0].homing.index_distance_mm = 6.0: \"0x60B9/16\" must be among the inputs of its node",
            "m.toml:26:21: joint[0].homing.index_distance_mm = 6.0: \"0x60BC/32\" must be among the inputs of its node",
        ]),
        (small("index_probe = 2\n"), &["m.toml:26:15: joint[0].homing.index_probe = 2: is for a joint with index_distance_mm"]),
        (small("resolution_mm = 0.0005\n"), &[
            "m.toml:26:17: joint[0].homing.resolution_mm = 0.0005: must not be below one increment of the drive, 0.001",
        ]),
        (small("release_distance_mm = 0.1\n"), &[
            "m.toml:26:23: joint[0].homing.release_distance_mm = 0.1: must be above 0.112, the way of a stop from search_mm_s \
             behind the switch",
        ]),
        (small("search_distance_mm = 1000\n"), &[
            "m.toml:22:15: joint[0].homing.search_mm_s = 10.0: must be quicker: 1000 mm of search and twice \
             release_distance_mm with latch_mm_s may take 110 s, above 100 s",
        ]),
        (small("skew_mm = 1.0\n"), &["m.toml:26:11: joint[0].homing.skew_mm = 1.0: is for joints that move an axis together"]),
        (small("switch = \"drive\"\n"), &[]),
        (changed(&small(""), "switch_mm = 11.0", "switch_mm = -11.0"), &[
            "m.toml:25:13: joint[0].homing.switch_mm = -11.0: lies below all of travel_mm (-10): a joint that searches the \
             other way never gets there",
        ]),
        (changed(&small(""), "towards = \"positive\"\n", ""), &[
            "m.toml:20:1: joint[0].homing.towards: is missing: \"negative\" or \"positive\"",
        ]),
        (changed(&small(""), "joint.0.home-sw-in", "motion.probe-input"), &[
            "m.toml:20:1: joint[0].homing.switch: no [[hal.net]] with a source has \"joint.0.home-sw-in\" among its targets: nobody would tell \
             of the switch",
        ]),
        (SMALL.replace("method = 37\n", "method = 37\nskew_mm = 1.0\n"), &[
            "m.toml:22:11: joint[0].homing.skew_mm = 1.0: is for by = \"control\"",
        ]),
    ];
    for (text, expected) in cases {
        assert_eq!(&messages(text), expected, "{text}");
    }
}

#[test]
fn the_joints_of_a_gantry_home_alike() {
    let last = |old: &str, new: &str| {
        let place = GANTRY.rfind(old).unwrap_or_else(|| panic!("{old}"));
        format!("{}{new}{}", &GANTRY[..place], &GANTRY[place + old.len()..])
    };
    let rules = |text: &str| -> Vec<(String, String)> {
        let errors = parse(text, Path::new("m.toml")).expect_err("not alike");
        let errors = errors
            .errors()
            .iter()
            .map(|error| (error.key.clone(), error.rule.clone()));
        errors.collect()
    };
    let together = "for joint 1 and this one, which move Y together";
    for (old, new, key, rule) in [
        (
            "latch_mm_s = 4.0\nswitch_mm = -3.2",
            "latch_mm_s = 3.0\nswitch_mm = -3.2",
            "latch_mm_s",
            "the same",
        ),
        ("skew_mm = 1.5", "skew_mm = 1.6", "skew_mm", "the same"),
        ("skew_mm = 1.5", "skew_mm = 1.5\nsequence = 3", "sequence", "the same"),
        (
            "position_mm = 5.0",
            "position_mm = 5.1",
            "position_mm",
            "5, where the axis is square,",
        ),
    ] {
        let key = format!("joint[2].homing.{key}");
        assert_eq!(rules(&last(old, new)), [(key, format!("must be {rule} {together}"))]);
    }
    let by_drive = last(
        "by = \"control\"\ntowards = \"negative\"\nsearch_mm_s = 40.0\nlatch_mm_s = 4.0\nswitch_mm = -3.2\nposition_mm = 5.0\nskew_mm = 1.5",
        "method = 37\nsearch_mm_s = 40.0\nlatch_mm_s = 4.0\nacceleration_mm_s2 = 500.0",
    );
    assert_eq!(
        rules(&by_drive)[0],
        (
            "joint[2].homing.by".to_owned(),
            format!("must be \"control\" {together}")
        )
    );
}

const BY_DRIVE: &str =
    "homing = { method = 37, search_mm_s = 10.0, latch_mm_s = 1.0, acceleration_mm_s2 = 500.0, position_mm = 0.0 }";

/// The machine of the example, its belts homed by the control.
fn belts(of_first: &str, of_second: &str) -> String {
    let text = include_str!("../../../configs/corexy-demo.toml");
    let by_control =
        |keys: &str| format!("homing = {{ by = \"control\", towards = \"negative\", switch = \"drive\", {keys} }}");
    let [first, second] = [of_first, of_second].map(by_control);
    text.replacen(BY_DRIVE, &first, 1).replacen(BY_DRIVE, &second, 1)
}

#[test]
fn belts_of_corexy_home_as_their_axes() {
    const GOOD: &str =
        "search_mm_s = 20.0, latch_mm_s = 2.0, switch_mm = -1.0, position_mm = 5.0, search_distance_mm = 305.0";
    assert_eq!(messages(&belts(GOOD, GOOD)), Vec::<String>::new());
    let found = |text: &str, key: &str, rule: &str| {
        let errors = messages(text);
        let found = errors.iter().any(|said| said.contains(key) && said.contains(rule));
        assert!(found, "{key}: {rule}: {errors:?}");
    };
    let changed = |old: &str, new: &str| changed(GOOD, old, new);
    let sequence = format!("{GOOD}, sequence = 3");
    found(&belts(GOOD, &sequence), "homing.sequence", "both belts");
    found(
        &belts(&changed("search_mm_s = 20.0", "search_mm_s = 160.0"), GOOD),
        "search_mm_s",
        "must not be above 150",
    );
    found(
        &belts(GOOD, &changed(", search_distance_mm = 305.0", "")),
        "search_distance_mm",
        "not above 305, the travel of Y",
    );
    found(
        &belts(&changed("position_mm = 5.0", "position_mm = 301.0"), GOOD),
        "position_mm",
        "travel_mm of X, 0 to 300",
    );
    let last = belts(GOOD, GOOD).rfind("homing = { by = \"control\"").unwrap();
    let both = belts(GOOD, GOOD);
    let end = last + both[last..].find('}').unwrap() + 1;
    let one = format!("{}{BY_DRIVE}{}", &both[..last], &both[end..]);
    found(&one, "homing.by", "for both belts of CoreXY, or for none");
}

#[test]
fn rules_of_simulated_joints() {
    let with = |keys: &str| messages(&format!("{}[[sim.joint]]\n{keys}", small("")));
    assert_eq!(
        with("joint = 0\nnode = 2\ninput = 8\nstart_mm = 3\n"),
        Vec::<String>::new()
    );
    assert_eq!(
        with("joint = 1\n"),
        ["m.toml:34:9: sim.joint[0].joint = 1: there is no such joint; joints: 1, counted from 0"]
    );
    assert_eq!(
        with("joint = 0\nstart_mm = 20\n"),
        ["m.toml:35:12: sim.joint[0].start_mm = 20: must lie in travel_mm of the joint, -10 to 10"]
    );
    assert_eq!(
        with("joint = 0\nnode = 1\ninput = 8\n"),
        ["m.toml:35:8: sim.joint[0].node = 1: must be a [[bus.node]] of profile \"io\""]
    );
    let by_drive = messages(&format!("{SMALL}[[sim.joint]]\njoint = 0\nswitch_mm = 1.0\n"));
    assert_eq!(
        by_drive,
        ["m.toml:30:13: sim.joint[0].switch_mm = 1.0: is for a joint that homes by the control"]
    );
}
