//! Drives with profiles, on the whole path and on virtual time: each way in which a drive may be built, and each profile that ships.

use isocnc::bus::powerlink::Powerlink;
use isocnc::bus::powerlink::managing_node::{mn_config, node_configs};
use isocnc::bus::watch::Watch;
use isocnc::config::{self, Config, DRIVE_PROFILES, parse_drive_profile};
use isocnc::machine::sequence::Outcome;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::{Rehearsal, rehearse, rehearse_on};
use isocnc::sim::near_end::VirtualPowerlink;
use isocnc::sim::{NetConfig, SimMachine, VirtualNet};
use powerlink::wire::NetTime;
use std::path::Path;
use std::sync::Arc;

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

/// Units of which neither positions nor speeds are increments.
const FACTORS: &str = "[factor_group]\nencoder = [131072, 1]\ngear = [5, 2]\nfeed = [5000, 1]\nvelocity = [60, 1]";

/// Homes and runs the part; where both joints are in the end, by a rule on the machine, mm.
fn places(config: &Config, case: &str) -> [f64; 2] {
    let places = rehearse(config, PART.as_bytes(), NetConfig::clean(3), |run| {
        let outcome = run.run(CYCLES_MAX).expect("an end");
        assert_eq!(outcome, Outcome::Completed, "{case}:\n{}", journal(run));
        let net = run.net();
        Ok([0, 1].map(|joint| net.machine().joint_position_mm(joint).expect("a joint")))
    });
    places.unwrap_or_else(|error| panic!("{case}: {error}"))
}

/// Homes, runs the part and ends where it should: at the work offset.
fn cuts(config: &Config, case: &str) {
    let places = places(config, case);
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
    let is_profile = |entry: &std::io::Result<std::fs::DirEntry>| {
        let path = entry.as_ref().expect("an entry").path();
        path.extension().is_some_and(|extension| extension == "toml")
    };
    assert_eq!(folder.filter(is_profile).count(), DRIVE_PROFILES.len());
}

#[test]
fn a_machine_of_drives_that_are_known_makes_its_part() {
    let config = config::parse(DEMO, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let [x, y, _] = &config.bus.nodes[..] else {
        panic!("three nodes")
    };
    assert_eq!((x.identity.vendor_id, y.identity.vendor_id), (Some(0x6A), Some(0xFB)));
    assert_eq!(config.joints[0].counts_per_unit, [524_288, 5]);
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
    let by_turns = |text: String| text.replace("counts_per_unit = [400, 1]", "turns_per_unit = [1, 5]");
    let cases: [(&str, Change<'_>); 21] = [
        ("axes = 2\n[identity]\nvendor_id = 0x12D\nserial = 7", &same),
        ("without = [\"0x607C\", \"0x6085\"]", &same),
        ("increments_per_turn = 2000", &by_turns),
        ("[sto]\nobject = \"0x60FD\"\nbit = 24\nactive = false", &same),
        ("[[sdo]]\nobject = \"0x6067\"\nvalue = 20\nbits = 32", &same),
        (FACTORS, &same),
        (FACTORS, &offset),
        (FACTORS, &by_control),
        // 2000 units a turn of the motor.
        (FACTORS, &by_turns),
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
    // Every key of a profile is of one of them, or of one below.
    let schema: serde_json::Value = serde_json::from_str(include_str!("../drives/profile.schema.json")).expect("JSON");
    let keys = schema["properties"].as_object().expect("keys").keys();
    let is_tried = |key: &str| cases.iter().any(|(profile, _)| profile.contains(key));
    let others = ["schema", "description", "device_file", "homing_methods"];
    let untried: Vec<&String> = keys
        .filter(|key| !is_tried(key) && !others.contains(&key.as_str()))
        .collect();
    assert!(untried.is_empty(), "{untried:?}");
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

/// What the journal has after three seconds of a control of this machine, on whose wire that one is.
fn journal_beside(wanted: &Config, there: &Config) -> String {
    let plans = isocnc::bus::plan(wanted);
    let nodes = node_configs(&wanted.bus, &plans);
    let link = VirtualNet::new(SimMachine::new(there).expect("simulated"), NetConfig::clean(1));
    let network = mn_config(wanted, &nodes, [2, 0, 0, 0, 0, 0xF0]);
    let bus: VirtualPowerlink<'_> =
        Powerlink::new(network, link, Arc::new(Watch::default()), NetTime::default).expect("a network");
    rehearse_on(wanted, b"", bus, Operator::standing_by, |run| {
        run.run_until(3000, |_| false)?;
        let entries = run.operator.journal().iter();
        Ok(entries.map(|entry| format!("{}\n", entry.text)).collect())
    })
    .expect("a control")
}

#[test]
fn a_loop_of_the_control_ends_at_the_same_place_whatever_the_drive_counts_in() {
    let by_velocity = |text: String| {
        let pid =
            "mode = \"csv\"\nloop = \"pid\"\npid = { p = 40.0, ff1 = 1.0, ff2 = 0.005 }\ncounts_per_unit = [400, 1]";
        text.replace("counts_per_unit = [400, 1]", pid)
    };
    let of = |profile: &str| {
        let config = with_profile(profile, by_velocity).unwrap_or_else(|errors| panic!("{profile}: {errors}"));
        places(&config, profile)[1]
    };
    let plain = of("");
    for more in ["", "\nwrite = false", "\nvelocity_encoder = [4096, 1]"] {
        let place = of(&format!("{FACTORS}{more}"));
        // Two increments of the plain one.
        assert!((place - plain).abs() < 0.005, "{more}: {place} where {plain} is wanted");
    }
}

#[test]
fn a_factor_group_is_written_and_compared_or_compared_alone() {
    let group = |feed: u32, write: bool| {
        let profile =
            format!("[factor_group]\nencoder = [4096, 1]\ngear = [1, 1]\nfeed = [{feed}, 1]\nwrite = {write}");
        with_profile(&profile, |text| text).unwrap_or_else(|errors| panic!("{errors}"))
    };
    let plan = |config: &Config| isocnc::bus::plan(config).swap_remove(1);
    let of_group = |index: u16| (0x608F..=0x6096).contains(&index);
    let written = plan(&group(5000, true));
    let writes = written.writes.iter().filter(|it| of_group(it.index));
    let writes: Vec<_> = writes.map(|it| (it.index, it.sub, it.value.clone())).collect();
    let value = |number: u32| number.to_le_bytes().to_vec();
    assert_eq!(
        writes,
        [
            (0x608F, 1, value(4096)),
            (0x608F, 2, value(1)),
            (0x6091, 1, value(1)),
            (0x6091, 2, value(1)),
            (0x6092, 1, value(5000)),
            (0x6092, 2, value(1)),
        ]
    );
    // Before all that is in the units that it makes.
    let place = |index: u16| written.writes.iter().position(|it| it.index == index);
    assert!(place(0x6092) < place(0x6065) && place(0x6092) < place(0x6099));
    let compared = written.expected.iter().filter(|it| of_group(it.index));
    assert_eq!(
        compared.map(|it| it.value).collect::<Vec<_>>(),
        [4096, 1, 1, 1, 5000, 1]
    );
    let kept = plan(&group(5000, false));
    assert!(kept.writes.iter().all(|it| !of_group(it.index)));
    assert_eq!(kept.expected, written.expected);
    // The drive was given another one with its own tool.
    let told = "6092h:1 is 0x00000fa0, expected 0x00001388";
    let text = journal_beside(&group(5000, false), &group(4000, false));
    assert!(text.contains(&format!("y-drive (node 2): {told}")), "{text}");
    let text = journal_beside(&group(5000, true), &group(4000, true));
    assert!(!text.contains(told), "{text}");
}

#[test]
fn the_drive_of_the_spindle_has_its_factor_group_too() {
    let text = |group: &str| {
        let drive = format!("mode = \"pv\"\n{group}");
        DEMO.replace("drive = \"schneider-atv320\"", "drive = \"own.toml\"")
            .replace("mode = \"vl\"", &drive)
    };
    let folder = tempfile::tempdir().expect("a folder");
    let profile = format!("{HEAD}[factor_group]\nencoder = [4096, 1]\ngear = [2, 1]\nfeed = [3600, 1]");
    std::fs::write(folder.path().join("own.toml"), profile).expect("written");
    let config = config::parse(
        &text("factor_group = { velocity = [1, 60] }"),
        &folder.path().join("m.toml"),
    );
    let config = config.unwrap_or_else(|errors| panic!("{errors}"));
    // 1800 units a turn of the motor; a velocity unit is 60 of them a second.
    assert_eq!(config.spindle.axis.map(|axis| axis.units_per_rpm), Some([1, 2]));
    let part = "G21 G90 G54\nM3 S1200\nG4 P2\nG1 X10 F6000\nM5\nM2\n";
    rehearse(&config, part.as_bytes(), NetConfig::clean(3), |run| {
        assert_eq!(
            run.run(CYCLES_MAX).expect("an end"),
            Outcome::Completed,
            "{}",
            journal(run)
        );
        Ok(())
    })
    .expect("a run");
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
            let cause = &run.operator.alarms()[0].cause.text;
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
    let cases: [(&str, Change<'_>, &str); 16] = [
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
            "joint[1].turns_per_unit = [1, 5]: needs a drive profile that has increments_per_turn, or a factor_group that has feed and gear",
        ),
        (
            "[factor_group]\nfeed = [5000, 1]\ngear = [5, 2]",
            &by(
                "counts_per_unit = [400, 1]",
                "counts_per_unit = [401, 1]\nturns_per_unit = [1, 5]",
            ),
            "joint[1].counts_per_unit = [401, 1]: contradicts turns_per_unit, which makes [400, 1]: one of them is wrong",
        ),
        (
            "increments_per_turn = 131072\n[factor_group]\nfeed = [5000, 1]\ngear = [5, 2]",
            &same,
            "own.toml:3:23: increments_per_turn = 131072: contradicts factor_group, which makes 2000 units of 0x6064 of a turn of the motor",
        ),
        (
            "[factor_group]\nvelocity = [60, 1]",
            &by(
                "counts_per_unit = [400, 1]",
                "counts_per_unit = [400, 1]\nvelocity_ratio = [1, 1]",
            ),
            "joint[1].velocity_ratio = [1, 1]: must be the velocity of factor_group, [60, 1], or be left out",
        ),
        (
            "without = [\"0x6091:1\"]",
            &by(
                "counts_per_unit = [400, 1]",
                "counts_per_unit = [400, 1]\nfactor_group = { gear = [1, 1] }",
            ),
            "joint[1].factor_group.gear = [1, 1]: the drive has no 0x6091:1, as own.toml says",
        ),
        (
            "increments_per_turn = 2000",
            &by(
                "homing = { method = 23,",
                "homing = { by = \"control\", towards = \"negative\", switch_mm = -3.0, index_distance_mm = 5.1,",
            ),
            "joint[1].homing.index_distance_mm = 5.1: must not be above 5, the way of a turn of the motor: a zero mark that is missed",
        ),
        (
            "[[sdo]]\nobject = \"0x6092:1\"\nvalue = 4000\nbits = 32",
            &by(
                "counts_per_unit = [400, 1]",
                "counts_per_unit = [400, 1]\nfactor_group = { feed = [5000, 1] }",
            ),
            "joint[1].factor_group.feed = [5000, 1]: must be what `sdo` of the node writes into 0x6092:1, or stand there no more",
        ),
        (
            "increments_per_turn = 4096",
            &by(
                "counts_per_unit = [400, 1]",
                "turns_per_unit = [1, 5]\ncounts_per_unit = [400, 1]",
            ),
            "counts_per_unit = [400, 1]: contradicts turns_per_unit, which makes [4096, 5]",
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

const DOUBLE: &str = include_str!("../configs/double2-demo.toml");
/// Moves every axis of both nodes.
const DOUBLE_PART: &str = "G21 G90 G54 G64\nG1 X30 Y10 Z5 A45 F6000\nG2 X30 Y30 J10\nG1 X0 Y0 Z0 A90\nM2\n";

#[test]
fn two_nodes_with_two_axes_each_boot_home_and_cut() {
    let text = DOUBLE.replace(
        "reactions = { quick_stop",
        "homing_is_left = 1\nreactions = { quick_stop",
    );
    assert!(config::parse(&text, Path::new("m.toml")).is_err(), "the file is read");
    let config = config::parse(DOUBLE, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let mapped = |list: &[config::Mapped]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(
        mapped(&config.bus.nodes[0].outputs),
        [
            "0x6040/16",
            "0x6060/8",
            "0x60FE:1/32",
            "0x607A/32",
            "0x6840/16",
            "0x6860/8",
            "0x68FE:1/32",
            "0x687A/32"
        ]
    );
    let plans = isocnc::bus::plan(&config);
    let value = |node: usize, index: u16, sub: u8| {
        let mut writes = plans[node]
            .writes
            .iter()
            .filter(|it| (it.index, it.sub) == (index, sub));
        let value = writes.next().map(|write| write.value.clone());
        assert_eq!(writes.count(), 0, "0x{index:04X}:{sub} once");
        value
    };
    for index in [0x60C2, 0x68C2] {
        assert_eq!(value(0, index, 1), Some(vec![1]));
    }
    assert_eq!(
        (value(1, 0x6098, 0), value(1, 0x6898, 0)),
        (Some(vec![23]), Some(vec![37]))
    );
    assert_eq!(
        (value(1, 0x605A, 0), value(1, 0x685A, 0)),
        (Some(vec![2, 0]), Some(vec![6, 0]))
    );
    assert_eq!(
        (value(1, 0x6067, 0), value(1, 0x6867, 0)),
        (None, Some(vec![50, 0, 0, 0]))
    );
    let places = rehearse(&config, DOUBLE_PART.as_bytes(), NetConfig::clean(3), |run| {
        let outcome = run.run(CYCLES_MAX).expect("an end");
        assert_eq!(outcome, Outcome::Completed, "{}", journal(run));
        let net = run.net();
        Ok([0, 1, 2, 3].map(|joint| net.machine().joint_position_mm(joint).expect("a joint")))
    });
    let wanted = [20.0, 20.0, -60.0, 90.0];
    for (place, wanted) in places.expect("a run").into_iter().zip(wanted) {
        assert!((place - wanted).abs() < 0.01, "{place} where {wanted} is wanted");
    }
}

#[test]
fn a_fault_of_one_axis_stops_those_of_all_nodes_and_is_named() {
    for (axis, joint, name) in [
        (0, 0, "axis X (joint 0, axis 0 of xy-drive)"),
        (1, 1, "axis Y (joint 1, axis 1 of xy-drive)"),
    ] {
        let fault = format!("\n[[sim.fault]]\nnode = 1\ndrive_axis = {axis}\nkind = \"overcurrent\"\nafter_s = 12.0\n");
        let config = config::parse(&format!("{DOUBLE}{fault}"), Path::new("m.toml"));
        let config = config.unwrap_or_else(|errors| panic!("{errors}"));
        let part = DOUBLE_PART.replace("M2", "G1 X150 Y100 F600\nM2");
        let (stands, text) = rehearse(&config, part.as_bytes(), NetConfig::clean(3), |run| {
            let outcome = run.run(CYCLES_MAX).expect("an end");
            assert_ne!(outcome, Outcome::Completed, "{}", journal(run));
            let net = run.net();
            let ids = [(1_u8, 0_u8), (1, 1), (2, 0), (2, 1)];
            let states = ids.map(|id| net.machine().drive_state(id).expect("a drive"));
            assert!(!states.contains(&cia402::State::OperationEnabled), "{states:?}");
            let places = [0, 1].map(|joint| net.machine().joint_position_mm(joint).expect("a joint"));
            Ok((places, journal(run)))
        })
        .expect("a run");
        assert!(text.contains(name) && text.contains("2310"), "joint {joint}:\n{text}");
        assert!(text.contains("machine faulted"), "{text}");
        // Both axes of the move stand on its way, from 20 and 20 to 170 and 120: the one whose drive is good, too.
        let share = [(stands[0] - 20.0) / 150.0, (stands[1] - 20.0) / 100.0];
        assert!(
            share.iter().all(|share| (0.02..0.9).contains(share)),
            "{stands:?}\n{text}"
        );
    }
}

#[test]
fn the_drive_of_the_spindle_says_how_it_stops_and_hears_a_set_point_as_often_as_it_is_polled() {
    let text = DOUBLE
        .replace("kind = \"memory\"", "kind = \"memory\"\nmultiplex_cycles = 4")
        .replace(
            "[[joint]]\nnode = 1                        #",
            "[[bus.node]]\nid = 3\nprofile = \"cia402\"\nmultiplex = 1\n\n[[joint]]\nnode = 1 #",
        );
    let spindle = "\n[spindle.drive]\nnode = 3\ndrive_axis = 1\nmode = \"csv\"\nunits_per_rpm = [10000, 60]\nramp_rpm_s = 1000.0\n\
                   reactions = { quick_stop = 6, shutdown = 1 }\n";
    let config = config::parse(&format!("{text}{spindle}"), Path::new("m.toml"));
    let config = config.unwrap_or_else(|errors| panic!("{errors}"));
    let plans = isocnc::bus::plan(&config);
    let value = |node: usize, index: u16, sub: u8| {
        let mut writes = plans[node].writes.iter();
        let write = writes.find(|it| (it.index, it.sub) == (index, sub));
        write.map(|write| write.value.clone())
    };
    let of_spindle =
        [(0x68C2, 1), (0x68C2, 2), (0x685A, 0), (0x685B, 0), (0x60C2, 1)].map(|(index, sub)| value(2, index, sub));
    let wanted: [Option<&[u8]>; 5] = [Some(&[4]), Some(&[0xFD]), Some(&[6, 0]), Some(&[1, 0]), None];
    assert_eq!(of_spindle.each_ref().map(Option::as_deref), wanted);
    assert_eq!(value(0, 0x60C2, 1), Some(vec![1]), "a joint is polled in each cycle");
}

#[test]
fn a_profile_says_how_many_axes_a_device_has_and_holds_for_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let parse = |profile: &str, text: &str| {
        std::fs::write(folder.path().join("own.toml"), format!("{HEAD}{profile}")).expect("written");
        let text = text.replacen("profile = \"cia402\"", "profile = \"cia402\"\ndrive = \"own.toml\"", 1);
        config::parse(&text, &folder.path().join("m.toml")).map_err(|errors| errors.to_string())
    };
    let refused = parse("", DOUBLE).unwrap_err();
    assert!(
        refused.contains("joint[1].drive_axis = 1: must be left out: own.toml has one axis"),
        "{refused}"
    );
    let third = DOUBLE.replacen("drive_axis = 1", "drive_axis = 2", 1);
    let refused = parse("axes = 2", &third).unwrap_err();
    assert!(
        refused.contains("joint[1].drive_axis = 2: must be below 2, the axes of own.toml"),
        "{refused}"
    );
    let twice = DOUBLE.replacen("drive_axis = 1", "drive_axis = 0", 1);
    let refused = parse("axes = 2", &twice).unwrap_err();
    assert!(
        refused.contains("joint[1].drive_axis = 0: is the drive of a joint above"),
        "{refused}"
    );

    let profile = "axes = 2\nmodes = [\"hm\", \"csp\"]\nwithout = [\"0x607C\"]\n\
                   [digital_inputs]\nhome = 20\n[sto]\nobject = \"0x60FD\"\nbit = 24\n\
                   [[sdo]]\nobject = \"0x6067\"\nvalue = 20\nbits = 32\n[[sdo]]\nobject = \"0x2110:3\"\nvalue = 7\nbits = 16\n";
    let config = parse(profile, DOUBLE).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(config.joints[1].sto.map(|sto| sto.object), Some((0x68FD, 0)));
    let plan = &isocnc::bus::plan(&config)[0];
    let written = |index: u16| plan.writes.iter().filter(|write| write.index == index).count();
    assert_eq!([0x6067, 0x6867, 0x2110, 0x607C, 0x687C].map(written), [1, 1, 1, 0, 0]);
    let expected: Vec<u16> = plan.expected.iter().map(|it| it.index).collect();
    assert_eq!(expected, [0x6502, 0x6D02, 0x60C2, 0x60C2, 0x68C2, 0x68C2]);
    rehearse(&config, DOUBLE_PART.as_bytes(), NetConfig::clean(3), |run| {
        let outcome = run.run(CYCLES_MAX).expect("an end");
        assert_eq!(outcome, Outcome::Completed, "{}", journal(run));
        Ok(())
    })
    .expect("a run");
}
