//! Drives with profiles, on the whole path and on virtual time: each way in which a drive may be built, and each profile that ships.

use isocnc::config::{self, Config, DRIVE_PROFILES, parse_drive_profile};
use isocnc::machine::sequence::Outcome;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::sim::NetConfig;
use std::path::Path;

const DEMO: &str = include_str!("../configs/cabinet2-demo.toml");
const PART: &str = "G21 G90 G54 G64\nG1 X30 Y10 F6000\nG2 X30 Y30 J10\nG1 X0 Y0\nM2\n";
const CYCLES_MAX: u64 = 60_000;
/// What is other in the machine file.
type Change<'c> = &'c dyn Fn(String) -> String;
/// Of every drive that does all that the demo asks of it.
const HEAD: &str = "schema = 1\ndescription = \"a drive of a test\"\n";

fn journal(run: &Rehearsal<'_>) -> String {
    let entries = run.operator.journal().iter();
    entries
        .map(|entry| format!("{:9.3} {}\n", entry.time_s, entry.text))
        .collect()
}

/// Homes, runs the part and ends where it should: at the work offset, by a rule on the machine.
fn cuts(config: &Config, case: &str) {
    let places = rehearse(config, PART.as_bytes(), NetConfig::clean(3), |run| {
        let outcome = run.run(CYCLES_MAX).expect("an end");
        assert_eq!(outcome, Outcome::Completed, "{case}:\n{}", journal(run));
        let net = run.net();
        Ok([0, 1].map(|joint| net.machine().joint_position_mm(joint).expect("a joint")))
    });
    let places = places.unwrap_or_else(|error| panic!("{case}: {error}"));
    for place in places {
        assert!((place - 20.0).abs() < 0.01, "{case}: {places:?}");
    }
}

/// The demo with a profile of the test for its second drive; `change`: what else is other.
fn with_profile(profile: &str, change: impl Fn(String) -> String) -> Result<Config, String> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("own.toml"), format!("{HEAD}{profile}")).expect("written");
    let text = change(DEMO.replace("\"maxon-epos4\"", "\"own.toml\""));
    config::parse(&text, &folder.path().join("m.toml")).map_err(|errors| errors.to_string())
}

#[test]
fn each_profile_that_ships_can_be_read_and_says_that_it_was_not_tried() {
    for (name, text) in DRIVE_PROFILES {
        let profile = parse_drive_profile(name, text, None).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        assert!(profile.description.ends_with("untried on hardware"), "{name}");
        let file = format!("{}/drives/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        assert!(Path::new(&file).exists(), "{file}");
    }
    let folder = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/drives")).expect("drives");
    assert_eq!(folder.count(), DRIVE_PROFILES.len());
}

#[test]
fn a_machine_of_drives_that_are_known_makes_its_part() {
    let config = config::parse(DEMO, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let [x, y, _] = &config.bus.nodes[..] else {
        panic!("three nodes")
    };
    assert_eq!((x.identity.vendor_id, y.identity.vendor_id), (Some(0x6A), Some(0xFB)));
    assert_eq!(config.joints[0].counts_per_unit, [1_048_576, 10]);
    assert_eq!(config.joints[1].reactions.shutdown, Some(0));
    let plans = isocnc::bus::plan(&config);
    let writes = |node: usize, index: u16| plans[node].writes.iter().any(|write| write.index == index);
    assert!(writes(0, 0x607C) && !writes(1, 0x607C));
    let expected: Vec<_> = plans[0]
        .expected
        .iter()
        .map(|it| (it.index, it.sub, it.value))
        .collect();
    // PP, PV, TQ, HM, IP, CSP; a millisecond.
    assert_eq!(expected, [(0x6502, 0, 0xED), (0x60C2, 1, 1), (0x60C2, 2, 0xFD)]);
    cuts(&config, "demo");
}

#[test]
fn a_drive_of_each_build_homes_and_cuts() {
    let same = |text: String| text;
    let offset = |text: String| {
        let sdo = "\"own.toml\"\nsdo = [{ object = \"0x607C\", value = -12345, bits = 32 }]";
        text.replacen("\"own.toml\"", sdo, 1)
    };
    let by_control = |text: String| {
        let from = "homing = { method = 23, search_mm_s = 40.0, latch_mm_s = 4.0, acceleration_mm_s2 = 500.0, position_mm = 0.0 }";
        let to = "limit_switches = \"drive\"\nhoming = { by = \"control\", towards = \"negative\", switch = \"drive\", switch_mm = -3.0, \
                  search_mm_s = 40.0, latch_mm_s = 1.0 }";
        assert!(text.contains(from));
        text.replace(from, to)
    };
    let cases: [(&str, Change<'_>); 12] = [
        ("", &same),
        ("home_offset = \"minus\"", &offset),
        ("home_offset = \"plus\"", &offset),
        (
            "[digital_inputs]\nnegative_limit = 16\npositive_limit = 17\nhome = 20",
            &by_control,
        ),
        ("quick_stop = \"stays\"", &same),
        ("modes = [\"hm\", \"ip\"]", &same),
        ("[outputs]\nobjects_max = 3\n[inputs]\nobjects_max = 4", &same),
        // It cannot be told its mode in each cycle, and has it from its configuration.
        ("[outputs]\noctets_max = 6", &by_control),
        (
            "[outputs]\nobjects = [\"0x6040\", \"0x6060\", \"0x607A\"]\n[inputs]\nobjects = [\"0x6041\", \"0x6064\"]",
            &same,
        ),
        ("without = [\"0x607C\", \"0x6065\", \"0x6085\"]", &same),
        (
            "[[sdo]]\nobject = \"0x2110:3\"\nvalue = 7\nbits = 16\n[[sdo]]\nobject = \"0x6067\"\nvalue = 20\nbits = 32",
            &same,
        ),
        ("[reactions]\nquick_stop = 6\ndisable = 0", &same),
    ];
    for (profile, change) in cases {
        let config = with_profile(profile, change).unwrap_or_else(|errors| panic!("{profile}: {errors}"));
        cuts(&config, profile);
    }
    // Every method that ends at a place of the machine, by a drive that has no other.
    for method in [1, 3, 7, 11, 17, 19, 23, 27] {
        let change = |text: String| text.replace("method = 23", &format!("method = {method}"));
        let profile = format!("homing_methods = [{method}]");
        let config = with_profile(&profile, change).unwrap_or_else(|errors| panic!("{profile}: {errors}"));
        cuts(&config, &profile);
    }
}

#[test]
fn a_drive_shows_its_safety_circuit_where_its_profile_says() {
    for (sto, inputs) in [
        ("object = \"0x60FD\"\nbit = 24\nactive = false", ""),
        ("object = \"0x2110:1\"\nbit = 3", ", \"0x2110:1/16\""),
    ] {
        let config = with_profile(&format!("[sto]\n{sto}"), |text| {
            let inputs =
                format!("\"own.toml\"\ninputs = [\"0x6041/16\", \"0x6061/8\", \"0x60FD/32\"{inputs}, \"0x6064/32\"]");
            let fault = "\n[[sim.fault]]\nnode = 2\nkind = \"sto\"\nafter_s = 6.0\n";
            text.replacen("\"own.toml\"", &inputs, 1) + fault
        });
        let config = config.unwrap_or_else(|errors| panic!("{errors}"));
        rehearse(&config, PART.as_bytes(), NetConfig::clean(3), |run| {
            let outcome = run.run(CYCLES_MAX).expect("an end");
            assert_eq!(outcome, Outcome::Faulted, "{}", journal(run));
            let cause = &run.operator.alarms()[0].cause;
            assert!(cause.contains("emergency stop: the safety circuit (STO)"), "{cause}");
            Ok(())
        })
        .expect("a machine that can be rehearsed");
    }
}

#[test]
fn what_a_drive_cannot_is_refused_with_what_it_can() {
    let same = |text: String| text;
    let by = |from: &'static str, to: &'static str| move |text: String| text.replacen(from, to, 1);
    let cases: [(&str, Change<'_>, &str); 10] = [
        (
            "[outputs]\nobjects_max = 2",
            &same,
            "joint[1].homing: must be by = \"control\": \"0x6060/8\" is not among the outputs of its node",
        ),
        (
            "homing_methods = [1, 35]",
            &same,
            "m.toml:55:21: joint[1].homing.method = 23: does not work with own.toml, only 1, 35",
        ),
        (
            "modes = [\"csp\", \"hm\"]",
            &by("node = 2\n", "node = 2\nmode = \"ip\"\n"),
            "joint[1].mode = \"ip\": must be one that own.toml offers (6502h): HM, CSP; it is \"ip\"",
        ),
        (
            "modes = [\"csp\"]",
            &same,
            "joint[1].homing: must be by = \"control\": own.toml offers no homing (6502h), only CSP",
        ),
        (
            "[outputs]\nobjects_max = 2",
            &by(
                "\"own.toml\"",
                "\"own.toml\"\noutputs = [\"0x6040/16\", \"0x6060/8\", \"0x607A/32\"]",
            ),
            "bus.node[1].outputs = [\"0x6040/16\", \"0x6060/8\", \"0x607A/32\"]: must not hold more than 2 objects, as own.toml says",
        ),
        (
            "[outputs]\noctets_max = 6",
            &by(
                "\"own.toml\"",
                "\"own.toml\"\noutputs = [\"0x6040/16\", \"0x6060/8\", \"0x607A/32\"]",
            ),
            "must not hold more than 6 octets, as own.toml says, holds 7",
        ),
        (
            "[outputs]\nobjects = [\"0x6040\", \"0x60FE:1\"]",
            &same,
            "bus.node[1].outputs: is missing: of what the profile usually has, 0x607A/32 cannot be mapped in own.toml, only 0x6040, \
             0x60FE:1",
        ),
        (
            "",
            &by("counts_per_unit = [400, 1]", "turns_per_unit = [1, 5]"),
            "joint[1].turns_per_unit = [1, 5]: needs a drive profile that has increments_per_turn",
        ),
        (
            "increments_per_turn = 4096",
            &by(
                "counts_per_unit = [400, 1]",
                "turns_per_unit = [1, 5]\ncounts_per_unit = [400, 1]",
            ),
            "cannot stand beside turns_per_unit: both are the scale",
        ),
        (
            "modes = [\"cps\"]\nhome = 3",
            &same,
            "bus.node[1].drive = \"own.toml\": is no drive profile that can be used: own.toml:3:10: modes[0] = \"cps\": must be",
        ),
    ];
    for (profile, change, wanted) in cases {
        let errors = with_profile(profile, change).expect_err(profile);
        assert!(errors.contains(wanted), "{profile}: {errors}");
    }
    let unknown = DEMO.replace("\"maxon-epos4\"", "\"maxon-epos5\"");
    let errors = config::parse(&unknown, Path::new("m.toml"))
        .expect_err("no such drive")
        .to_string();
    assert!(errors.contains("did you mean \"maxon-epos4\"?"), "{errors}");
}
