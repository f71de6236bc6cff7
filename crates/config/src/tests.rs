//! One case per rule: what is changed in a right file, and the message with its place.

use super::*;
use proptest::prelude::*;

const DEMO: &str = include_str!("../../../configs/mill3-demo.toml");

/// The smallest machine: everything that may be left out is left out.
pub(super) const SMALL: &str = "\
schema = 1
[machine]
name = \"small\"
[bus]
kind = \"memory\"
[[bus.node]]
id = 1
profile = \"cia402\"
[[bus.node]]
id = 2
profile = \"io\"
[[joint]]
node = 1
counts_per_unit = [1000, 1]
travel_mm = [-10.0, 10]
velocity_mm_s = 100
acceleration_mm_s2 = 1000.0
jerk_mm_s3 = 20000.0
following_error_mm = 1.0
[joint.homing]
method = 37
search_mm_s = 10.0
latch_mm_s = 1.0
acceleration_mm_s2 = 100.0
[[axis]]
letter = \"X\"
joints = [0]
";

pub(super) fn messages(text: &str) -> Vec<String> {
    match parse(text, Path::new("m.toml")) {
        Ok(_) => Vec::new(),
        Err(errors) => errors.errors().iter().map(|error| error.to_string()).collect(),
    }
}

/// What `part` takes of the demo machine with this text behind it; or what is refused, with lines counted from the first of the text.
pub(super) fn behind_demo<T>(text: &str, part: impl FnOnce(Config) -> T) -> Result<T, Vec<String>> {
    let first = DEMO.lines().count();
    parse(&format!("{DEMO}{text}"), Path::new("m.toml"))
        .map(part)
        .map_err(|errors| {
            let told = errors.errors().iter().map(|error| {
                let (line, column) = error.place.unwrap_or_default();
                let text = error.to_string();
                let rest = text.splitn(4, ':').nth(3).unwrap_or_default().trim();
                format!("{}:{column}: {rest}", line - first)
            });
            told.collect()
        })
}

/// Replaces the only occurrence of `old`; the rest of the file keeps its lines.
pub(super) fn changed(old: &str, new: &str) -> String {
    assert_eq!(SMALL.matches(old).count(), 1, "{old:?} stands once in the file");
    SMALL.replace(old, new)
}

/// Of the toy bus of tests nobody else hears, and what is not built for tests does not know it.
#[test]
fn the_toy_bus_is_in_no_list_and_only_tests_may_name_it() {
    let words = BusKind::WORDS.map(|(word, _)| format!("\"{word}\"")).join(" or ");
    assert!(!words.contains("toy"));
    let of_kind = |kind: &str| messages(&changed("\"memory\"", kind)).into_iter().next();
    let refused = |kind: &str| Some(format!("m.toml:5:8: bus.kind = {kind}: must be {words}"));
    assert_eq!(of_kind("\"bus\""), refused("\"bus\""));
    let toy = match cfg!(feature = "testing") {
        true => Some("m.toml:4:1: bus.interface: is missing: the network interface of the bus".to_owned()),
        false => refused("\"toy\""),
    };
    assert_eq!(of_kind("\"toy\""), toy);
}

#[test]
fn the_demo_machine_is_read_whole() {
    let config = parse(DEMO, Path::new("demo.toml")).unwrap();
    assert_eq!(config.path, Path::new("demo.toml"));
    assert_eq!(config.name, "mill3-demo");
    assert_eq!(config.cycle_us, 1000);
    let rt = Rt {
        late_max_us: Some(500),
        ..Rt::default()
    };
    assert_eq!(config.rt, rt);
    assert_eq!(config.bus.kind, BusKind::Powerlink);
    assert_eq!(config.bus.interface, "plk0");
    assert_eq!((config.bus.async_slot_timeout_us, config.bus.pres_lost_max), (150, 20));
    let nodes: Vec<_> = config
        .bus
        .nodes
        .iter()
        .map(|node| (node.id, node.name.as_str(), node.profile))
        .collect();
    let drive = Profile::Cia402;
    assert_eq!(
        nodes,
        [
            (1, "x-drive", drive),
            (2, "y-drive", drive),
            (3, "z-drive", drive),
            (10, "io", Profile::Io)
        ]
    );
    let x = &config.bus.nodes[0];
    assert!(x.mandatory);
    assert_eq!(x.identity.device_type, Some(0x0002_0192));
    assert_eq!((x.identity.vendor_id, x.identity.product_code), (Some(0), None));
    assert_eq!(
        x.outputs[2],
        Mapped {
            index: 0x60FE,
            sub: 1,
            bits: 32
        }
    );
    // What x-drive writes out is what the others get by leaving it out.
    assert_eq!(x.outputs, config.bus.nodes[1].outputs);
    assert_eq!(x.inputs, config.bus.nodes[1].inputs);
    assert_eq!(config.bus.nodes[3].outputs.len(), 2);
    let joint = &config.joints[2];
    assert_eq!(joint.node, 2);
    assert_eq!(joint.counts_per_unit, [10_000, 1]);
    assert_eq!(joint.travel_mm, [-105.0, 5.0]);
    assert_eq!(
        joint.limits,
        JointLimits {
            velocity_mm_s: 100.0,
            acceleration_mm_s2: 1000.0,
            jerk_mm_s3: 20_000.0
        }
    );
    assert_eq!(
        joint.stop,
        StopLimits {
            acceleration_mm_s2: 2000.0,
            jerk_mm_s3: 80_000.0
        }
    );
    assert_eq!(joint.following_error_mm, 2.0);
    assert_eq!(
        joint.homing,
        Homing {
            search_mm_s: 40.0,
            latch_mm_s: 4.0,
            position_mm: 0.0,
            sequence: None,
            absolute_encoder: false,
            moved_when_off_mm: 1.0,
            volatile: false,
            by: HomingBy::Drive {
                method: 23,
                acceleration_mm_s2: 500.0,
            },
        }
    );
    let axes: Vec<_> = config
        .axes
        .iter()
        .map(|map| (map.axis.letter(), map.joints.clone()))
        .collect();
    assert_eq!(axes, [('X', vec![0]), ('Y', vec![1]), ('Z', vec![2])]);
    assert_eq!(config.work_offsets[0], motion::canon::Position::xyz(20.0, 20.0, -60.0));
    assert_eq!(config.work_offsets[8], motion::canon::Position::ZERO);
    assert_eq!(config.spindle.rpm_max, 24_000.0);
    assert_eq!(
        (config.program.tolerance_mm, config.program.look_ahead_blocks),
        (0.01, 10_000)
    );
    let net = config.nets.iter().find(|net| net.name == "coolant-flood").unwrap();
    assert_eq!(
        (net.source.as_str(), &net.targets[..]),
        ("iocontrol.0.coolant-flood", &["io.10.out-01".to_owned()][..])
    );
    let sim = &config.sim;
    assert_eq!((sim.natural_frequency_hz, sim.damping, sim.start), (60.0, 0.8, 0.4));
    let probe = sim.probe.as_ref().unwrap();
    assert_eq!((probe.node, probe.input, probe.surfaces.len()), (3, 8, 5));
    assert_eq!((probe.diameter_mm, probe.length_mm), (4.0, 0.0));
    let z_mm = [-100.0, -85.0];
    assert_eq!(
        probe.bodies,
        [
            SimBody {
                outline: SimOutline::Rectangle {
                    half_mm: [30.0, 20.0],
                    angle_degrees: 0.0
                },
                middle_mm: [230.0, 140.0],
                z_mm,
                hole: false
            },
            SimBody {
                outline: SimOutline::Circle { radius_mm: 15.0 },
                middle_mm: [60.0, 140.0],
                z_mm,
                hole: false
            }
        ]
    );
    assert_eq!(
        probe.surfaces[4],
        SimSurface {
            axis: motion::canon::Axis::Z,
            at_mm: -100.0,
            above: false
        }
    );
}

#[test]
fn what_is_left_out_has_its_default() {
    let config = parse(SMALL, Path::new("m.toml")).unwrap();
    assert_eq!(config.cycle_us, 1000);
    assert_eq!(config.bus.interface, "");
    assert_eq!((config.bus.async_slot_timeout_us, config.bus.pres_lost_max), (150, 3));
    assert_eq!(
        (
            config.rt.priority,
            config.rt.timeout_us,
            config.rt.phase_us,
            config.rt.spin_us,
            config.rt.calibrate
        ),
        (80, 50, None, None, true)
    );
    assert_eq!(config.bus.nodes[0].name, "node-1");
    assert_eq!(
        (config.bus.nodes[0].mandatory, config.bus.nodes[0].pres_timeout_us),
        (true, 150)
    );
    let object = |index, sub, bits| Mapped { index, sub, bits };
    assert_eq!(
        config.bus.nodes[0].outputs,
        [
            object(0x6040, 0, 16),
            object(0x6060, 0, 8),
            object(0x60FE, 1, 32),
            object(0x607A, 0, 32)
        ]
    );
    assert_eq!(
        config.bus.nodes[1].outputs,
        [object(0x6200, 1, 8), object(0x6200, 2, 8)]
    );
    assert_eq!(config.bus.nodes[1].inputs, [object(0x6000, 1, 8), object(0x6000, 2, 8)]);
    assert_eq!(
        config.joints[0].stop,
        StopLimits {
            acceleration_mm_s2: 2000.0,
            jerk_mm_s3: 80_000.0
        }
    );
    assert_eq!(config.joints[0].homing.position_mm, 0.0);
}

#[test]
fn what_calibration_may_choose_can_be_given_and_has_a_default() {
    let given = changed(
        "\n[bus]",
        "\n[rt]\nphase_us = 370\nspin_us = 0\nkeep_awake = \"idle-thread\"\ncalibrate = false\n[bus]",
    );
    let rt = parse(&given, Path::new("m.toml")).unwrap().rt;
    assert_eq!(
        (rt.phase_us(1000), rt.spin_us(), rt.keep_awake, rt.calibrate),
        (370, 0, Some(KeepAwake::IdleThread), false)
    );
    let rt = Rt::default();
    assert_eq!(rt.spin_us(), 50);
    // In the middle between two ticks; where these do not meet the cycle regularly, there is no such place.
    assert_eq!(
        [250, 500, 1000, 2000].map(|cycle_us| rt.phase_us(cycle_us)),
        [75, 175, 375, 725]
    );
    assert_eq!(
        Rt {
            timeout_us: 60,
            ..rt.clone()
        }
        .phase_us(1000),
        370
    );
    assert_eq!([250, 1000].map(|cycle_us| rt.late_max_us(cycle_us)), [62, 250]);
}

/// Text to replace, its replacement, and the messages.
pub(super) type Case = (&'static str, &'static str, &'static [&'static str]);

pub(super) fn check(cases: &[Case]) {
    for (old, new, expected) in cases {
        assert_eq!(messages(&changed(old, new)), *expected, "{new:?} for {old:?}");
    }
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_machine_and_rt() {
    check(&[
        ("schema = 1\n", "\n", &["m.toml:1:1: schema: is missing: an integer from 1 to 1"]),
        ("schema = 1", "schema = 2", &["m.toml:1:10: schema = 2: must be an integer from 1 to 1"]),
        ("name = \"small\"", "", &["m.toml:2:1: machine.name: is missing: the name of the machine"]),
        ("name = \"small\"", "name = \"a b\"", &[
            "m.toml:3:8: machine.name = \"a b\": must be 1 to 48 letters, digits, dashes, underscores or dots, a letter first",
        ]),
        ("name = \"small\"", "name = 7", &["m.toml:3:8: machine.name = 7: must be a string, is an integer"]),
        ("\n[bus]", "\nkinematics = \"trivia\"\n[bus]", &[
            "m.toml:4:14: machine.kinematics = \"trivia\": must be \"trivial\" or \"corexy\" or \"table-table\" or \"head-table\" or \"scara\" or \"linear-delta\" or \"none\"; did you mean \"trivial\"?",
        ]),
        ("\n[bus]", "\nunits = \"in\"\n[bus]", &["m.toml:4:9: machine.units = \"in\": must be \"mm\" or \"inch\""]),
        ("\n[bus]", "\ncycle_us = 124\n[bus]", &[
            "m.toml:4:12: machine.cycle_us = 124: must be an integer from 125 to 10000",
        ]),
        ("\n[bus]", "\ncycle_us = 333\n[bus]", &[
            "m.toml:4:12: machine.cycle_us = 333: must be a time that a drive can be told: above 255 whole tens, above 2550 whole hundreds",
        ]),
        ("\n[bus]\nkind = \"memory\"", "\ncycle_us = 249\n[bus]\nkind = \"memory\"", &[
            "m.toml:6:8: bus.kind = \"memory\": takes cycles from 250 us, machine.cycle_us is 249",
        ]),
        ("\n[bus]", "\ncycle_us = 1e3\n[bus]", &[
            "m.toml:4:12: machine.cycle_us = 1e3: must be an integer, is a float",
        ]),
        ("\n[bus]", "\ncycle_us = 99999999999999999999\n[bus]", &[
            "m.toml:4:12: machine.cycle_us = 99999999999999999999: must be an integer from 125 to 10000",
        ]),
        ("\n[bus]", "\n[rt]\npriority = 98\n[bus]", &["m.toml:5:12: rt.priority = 98: must be an integer from 1 to 96"]),
        ("\n[bus]", "\n[rt]\ntimeout_us = 19\n[bus]", &[
            "m.toml:5:14: rt.timeout_us = 19: must be an integer from 20 to 1000",
        ]),
        ("\n[bus]", "\n[rt]\nphase_us = 1000\n[bus]", &[
            "m.toml:5:12: rt.phase_us = 1000: must be an integer from 0 to 999",
        ]),
        ("\n[bus]", "\n[rt]\nspin_us = -1\n[bus]", &["m.toml:5:11: rt.spin_us = -1: must be an integer from 0 to 500"]),
        ("\n[bus]", "\n[rt]\nlate_us_max = 501\n[bus]", &[
            "m.toml:5:15: rt.late_us_max = 501: must be an integer from 1 to 500",
        ]),
        ("\n[bus]", "\n[rt]\ncpu = -1\n[bus]", &["m.toml:5:7: rt.cpu = -1: must be an integer from 0 to 8191"]),
        ("\n[bus]", "\n[rt]\nkeep_awake = 1\n[bus]", &[
            "m.toml:5:14: rt.keep_awake = 1: must be \"dma-latency\" or \"idle-thread\" or \"ticks\" or \"none\", is an integer",
        ]),
        ("\n[bus]", "\n[rt]\nkeep_awake = true\nspin_us = 501\ncalibrate = \"no\"\n[bus]", &[
            "m.toml:5:14: rt.keep_awake = true: must be \"dma-latency\" or \"idle-thread\" or \"ticks\" or \"none\", is a boolean",
            "m.toml:6:11: rt.spin_us = 501: must be an integer from 0 to 500",
            "m.toml:7:13: rt.calibrate = \"no\": must be true or false, is a string",
        ]),
        ("\n[bus]", "\n[rt]\nkeep_awake = \"idle\"\n[bus]", &[
            "m.toml:5:14: rt.keep_awake = \"idle\": must be \"dma-latency\" or \"idle-thread\" or \"ticks\" or \"none\"; did you mean \"idle-thread\"?",
        ]),
        ("\n[bus]", "\n[rt]\nrequire = \"Strict\"\n[bus]", &[
            "m.toml:5:11: rt.require = \"Strict\": must be \"strict\" or \"warn\"; did you mean \"strict\"?",
        ]),
        ("\n[bus]", "\n[rt]\nspin = 1\ntimeout_core = 5\nhousekeeping_cpus = [0, -1]\n[bus]", &[
            "m.toml:5:1: rt.spin: unknown key; did you mean `spin_us`?",
            "m.toml:6:1: rt.timeout_core: unknown key; did you mean `timeout_cpu`?",
            "m.toml:7:25: rt.housekeeping_cpus[1] = -1: must be an integer from 0 to 8191",
        ]),
        ("schema = 1\n", "schema = 1\nrt = 5\n", &["m.toml:2:6: rt = 5: must be a table, is an integer"]),
    ]);
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_the_bus() {
    check(&[
        ("\"memory\"", "\"power-link\"", &[
            "m.toml:5:8: bus.kind = \"power-link\": must be \"powerlink\" or \"memory\" or \"ethercat\" or \"ethercat-memory\" or \"none\"; did you mean \"powerlink\"?",
        ]),
        ("\"memory\"", "\"powerlink\"", &["m.toml:4:1: bus.interface: is missing: the network interface of the bus"]),
        ("\"memory\"", "\"powerlink\"\ninterface = \"eth 0\"", &[
            "m.toml:6:13: bus.interface = \"eth 0\": must be the name of a network interface: 1 to 15 characters, no blank and no /",
        ]),
        ("\"memory\"", "\"memory\"\nasync_slot_timeout_us = 0", &[
            "m.toml:6:25: bus.async_slot_timeout_us = 0: must be an integer from 1 to 1000",
        ]),
        ("\"memory\"", "\"memory\"\npres_lost_max = -1", &[
            "m.toml:6:17: bus.pres_lost_max = -1: must be an integer from 0 to 1000",
        ]),
        ("\"memory\"", "\"memory\"\nredundancy = true", &["m.toml:6:1: bus.redundancy: unknown key; known here: kind, interface, clock, lost_max, link, async_slot_timeout_us, async_mtu, pres_lost_max, soc_lost_max, multiplex_cycles, prescaler, tap, startup, node"]),
        ("id = 2", "id = 240", &["m.toml:10:6: bus.node[1].id = 240: must be an integer from 1 to 239"]),
        ("id = 2", "id = 1", &["m.toml:10:6: bus.node[1].id = 1: is taken by a node above"]),
        ("id = 2", "id = 2\nname = \"node-1\"", &[
            "m.toml:11:8: bus.node[1].name = \"node-1\": is taken by a node above",
        ]),
        ("profile = \"io\"", "profile = \"oi\"", &[
            "m.toml:11:11: bus.node[1].profile = \"oi\": must be \"cia402\" or \"io\"; did you mean \"io\"?",
        ]),
        ("profile = \"io\"", "profile = \"io\"\npres_timeout_us = 0", &[
            "m.toml:12:19: bus.node[1].pres_timeout_us = 0: must be an integer from 1 to 1000",
        ]),
        ("profile = \"io\"", "profile = \"io\"\nvendor_id = 0x1_0000_0000", &[
            "m.toml:12:13: bus.node[1].vendor_id = 0x1_0000_0000: must be an integer from 0 to 4294967295",
        ]),
    ]);
    assert_eq!(
        messages("schema = 1\nmachine.name = \"m\"\njoint = []\naxis = 3\nbus = { kind = \"memory\", node = [] }\n"),
        [
            "m.toml:3:9: joint = []: is missing: at least one [[joint]] is needed",
            "m.toml:4:8: axis = 3: must be an array of tables: [[axis]], is an integer",
            "m.toml:5:33: bus.node = []: is missing: at least one [[bus.node]] is needed",
        ]
    );
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_pdo_mapping() {
    let drive = "profile = \"cia402\"";
    let form = "must be an object with its length, like \"0x6041/16\" or \"0x60FE:1/32\"";
    for wrong in ["6041/16", "0x6041", "0x/16", "0x6041/", "0x6041:/16", "0x1FFFF/8", "0x+041/16", "0x6041:256/16", "é"] {
        let text = changed(drive, &format!("{drive}\ninputs = [\"0x6041/16\", \"0x6064/32\", \"{wrong}\"]"));
        assert_eq!(messages(&text), [format!("m.toml:9:37: bus.node[0].inputs[2] = \"{wrong}\": {form}")]);
    }
    check(&[
        (drive, "profile = \"cia402\"\noutputs = [\"0x6040/16\", \"0x607A/32\", \"0x2000/24\", \"0x0005/8\", 5]", &[
            "m.toml:9:38: bus.node[0].outputs[2] = \"0x2000/24\": must have a length of 8, 16, 32 or 64 bits",
            "m.toml:9:51: bus.node[0].outputs[3] = \"0x0005/8\": must be an object from 0x1000 on; below are data types",
            "m.toml:9:63: bus.node[0].outputs[4] = 5: must be a string, is an integer",
        ]),
        (drive, "profile = \"cia402\"\noutputs = [\"0x6040/16\", \"0x607A/16\", \"0x6040:0/16\"]", &[
            "m.toml:9:25: bus.node[0].outputs[1] = \"0x607A/16\": must have the length 32 that the drive profile gives it",
            "m.toml:9:38: bus.node[0].outputs[2] = \"0x6040:0/16\": is mapped twice",
        ]),
        ("node = 1", "node = 1\nmode = \"ip\"", &[]),
        ("node = 1", "node = 1\nmode = \"cps\"", &["m.toml:14:8: joint[0].mode = \"cps\": must be \"csp\" or \"ip\" or \"csv\" or \"cst\"; did you mean \"csp\"?"]),
        ("node = 1", "node = 1\nmode = \"csv\"", &["m.toml:14:8: joint[0].mode = \"csv\": needs loop = \"pid\" beside it, as the drive holds no position then; or \"csp\", \"ip\""]),
        ("node = 1", "node = 1\nmode = \"cst\"", &["m.toml:14:8: joint[0].mode = \"cst\": needs loop = \"pid\" beside it, as the drive holds no position then; or \"csp\", \"ip\""]),
        ("node = 1", "node = 1\nmode = \"csv\"\nloop = \"pid\"\npid = { p = 40.0 }", &[]),
        ("node = 1", "node = 1\nmode = \"cst\"\nloop = \"pid\"\npid = { p = 1, i = 2.0, d = 0.1, ff2 = 1e-4, output_max = 2.5 }", &[]),
        ("node = 1", "node = 1\nmode = \"csv\"\nloop = \"pid\"", &["m.toml:15:8: joint[0].loop = \"pid\": needs the gains beside it: pid = { p = 30.0 }"]),
        ("node = 1", "node = 1\nmode = \"csv\"\nloop = \"pid\"\npid = { p = 1.0 }\nreactions = { connection_lost = 0 }", &["m.toml:17:13: joint[0].reactions: must not have connection_lost = 0: the drive has no position to hold, and would run on with its last set-point"]),
        ("node = 1", "node = 1\nmode = \"cst\"\nloop = \"pid\"\npid = { p = 1.0, output_max = 40.0 }", &["m.toml:16:31: joint[0].pid.output_max = 40.0: must not be above 32.767"]),
        (drive, "profile = \"cia402\"\noutputs = [\"0x6040/16\", \"0x607A/32\", \"0x6062/32\"]", &["m.toml:9:11: bus.node[0].outputs = [\"0x6040/16\", \"0x607A/32\", \"0x6062/32\"]: must not hold 0x607A/32 beside 0x6062/32: a drive has one target"]),
        ("node = 1", "node = 1\nloop = \"pid\"\npid = { p = 1.0 }", &["m.toml:14:8: joint[0].loop = \"pid\": must be \"drive\" where the drive is told positions; \"pid\" is for mode = \"csv\" and \"cst\""]),
        ("node = 1", "node = 1\npid = { p = 1.0 }", &["m.toml:14:7: joint[0].pid: is for loop = \"pid\""]),
        ("node = 1", "node = 1\nmode = \"csv\"\nloop = \"pid\"\npid = { p = 0.0, q = 1 }", &[
            "m.toml:16:13: joint[0].pid.p = 0.0: must be above 0",
            "m.toml:16:18: joint[0].pid.q: unknown key; did you mean `p`?",
        ]),
        ("node = 1", "node = 1\nmode = \"csv\"\nloop = \"pid\"\npid = { p = 1.0, output_max = 50.0 }", &["m.toml:16:31: joint[0].pid.output_max = 50.0: must be above velocity_mm_s, 100: the loop needs room to catch up"]),
        ("node = 1", "node = 1\nvelocity_ratio = [1000000, 1]", &["m.toml:14:18: joint[0].velocity_ratio = [1000000, 1]: must let 60FFh hold velocity_mm_s: 100 makes 100000000000"]),
        ("node = 1", "node = 1\ntorque_per_mm_s2 = 0.1", &["m.toml:14:20: joint[0].torque_per_mm_s2 = 0.1: \"0x60B2/16\" must be among the outputs of its node"]),
        ("node = 1", "node = 1\nreactions = 2", &["m.toml:14:13: joint[0].reactions = 2: must be a table, is an integer"]),
        ("node = 1", "node = 1\ntouch_probe = 3", &["m.toml:14:15: joint[0].touch_probe = 3: must be an integer from 1 to 2"]),
        ("node = 1", "node = 1\ntouch_probe = 2", &[
            "m.toml:14:15: joint[0].touch_probe = 2: \"0x60B8/16\" must be among the outputs of its node",
            "m.toml:14:15: joint[0].touch_probe = 2: \"0x60B9/16\" must be among the inputs of its node",
            "m.toml:14:15: joint[0].touch_probe = 2: \"0x60BC/32\" must be among the inputs of its node",
            "m.toml:14:15: joint[0].touch_probe = 2: \"0x60BD/32\" must be among the inputs of its node",
        ]),
        ("node = 1", "node = 1\nvelocity_ratio = [60]", &["m.toml:14:18: joint[0].velocity_ratio = [60]: must be two integers: what 60FFh counts, and the increments/s that it makes"]),
        (drive, "profile = \"cia402\"\ninputs = [\"0x6061/8\"]", &[
            "m.toml:9:10: bus.node[0].inputs = [\"0x6061/8\"]: must hold \"0x6041/16\": a drive is not run without it",
            "m.toml:9:10: bus.node[0].inputs = [\"0x6061/8\"]: must hold \"0x6064/32\": a drive is not run without it",
        ]),
        (drive, "profile = \"cia402\"\ninputs = \"0x6061/8\"", &[
            "m.toml:9:10: bus.node[0].inputs = \"0x6061/8\": must be an array, is a string",
        ]),
    ]);
    let list = |count| (0..count).map(|sub| format!("\"0x2000:{sub}/64\"")).collect::<Vec<_>>().join(",");
    let text = changed("profile = \"io\"", &format!("profile = \"io\"\ninputs = [{}]", list(187)));
    assert_eq!(messages(&text).len(), 1);
    assert!(messages(&text)[0].ends_with(": must not hold more than 1490 octets, holds 1496"), "{:?}", messages(&text));
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_joints() {
    check(&[
        ("node = 1", "node = 3", &["m.toml:13:8: joint[0].node = 3: no [[bus.node]] has this id; drives: 1"]),
        ("node = 1", "node = 2", &["m.toml:13:8: joint[0].node = 2: must be a node of profile \"cia402\""]),
        ("node = 1\n", "", &["m.toml:12:1: joint[0].node: is missing: an integer from 1 to 239"]),
        ("[1000, 1]", "[1000, 0]", &[
            "m.toml:14:26: joint[0].counts_per_unit[1] = 0: must be an integer from 1 to 4294967295",
        ]),
        ("[1000, 1]", "[1000]", &[
            "m.toml:14:19: joint[0].counts_per_unit = [1000]: must be two integers: increments and the mm (degrees) that they make",
        ]),
        ("[1000, 1]", "1000", &["m.toml:14:19: joint[0].counts_per_unit = 1000: must be an array, is an integer"]),
        ("[-10.0, 10]", "[10.0, 10]", &[
            "m.toml:15:13: joint[0].travel_mm = [10.0, 10]: the lower limit must be below the upper one",
        ]),
        ("[-10.0, 10]", "[-10.0, inf]", &["m.toml:15:21: joint[0].travel_mm[1] = inf: must be a finite number"]),
        ("[-10.0, 10]", "[0.0]", &["m.toml:15:13: joint[0].travel_mm = [0.0]: must be two numbers: lower and upper limit"]),
        ("[1000, 1]", "[300000000, 1]", &[
            "m.toml:15:13: joint[0].travel_mm = [-10.0, 10]: must fit 32-bit positions of the drive: -10 is too far",
            "m.toml:15:13: joint[0].travel_mm = [-10.0, 10]: must fit 32-bit positions of the drive: 10 is too far",
            "m.toml:16:17: joint[0].velocity_mm_s = 100: must fit 32-bit speeds of the drive: 100 is too fast",
            "m.toml:24:22: joint[0].homing.acceleration_mm_s2 = 100.0: must be 1 to 4294967295 in increments of the drive",
        ]),
        ("velocity_mm_s = 100", "velocity_mm_s = -5", &[
            "m.toml:16:17: joint[0].velocity_mm_s = -5: must be above 0",
        ]),
        ("velocity_mm_s = 100", "velocity_mm = 100", &[
            "m.toml:12:1: joint[0].velocity_mm_s: is missing: a number",
            "m.toml:16:1: joint[0].velocity_mm: unknown key; did you mean `velocity_mm_s`?",
        ]),
        ("jerk_mm_s3 = 20000.0", "jerk_mm_s3 = nan", &["m.toml:18:14: joint[0].jerk_mm_s3 = nan: must be a finite number"]),
        ("jerk_mm_s3 = 20000.0", "jerk_mm_s3 = 1e999", &[
            "m.toml:18:14: joint[0].jerk_mm_s3 = 1e999: must be a finite number",
        ]),
        ("jerk_mm_s3 = 20000.0", "jerk_mm_s3 = 1e11", &[
            "m.toml:18:14: joint[0].jerk_mm_s3 = 1e11: must not be above 10000000000",
        ]),
        ("jerk_mm_s3 = 20000.0", "jerk_mm_s3 = 20000.0\nstop_jerk_mm_s3 = 23999\nstop_acceleration_mm_s2 = 1199", &[
            "m.toml:19:19: joint[0].stop_jerk_mm_s3 = 23999: must be at least 1.2 times the limit of the plan, 20000",
            "m.toml:20:27: joint[0].stop_acceleration_mm_s2 = 1199: must be at least 1.2 times the limit of the plan, 1000",
        ]),
        ("following_error_mm = 1.0", "following_error_mm = 0.2", &[
            "m.toml:19:22: joint[0].following_error_mm = 0.2: must be above 0.2, the way of two cycles at velocity_mm_s",
        ]),
        ("method = 37", "method = 15", &[
            "m.toml:21:10: joint[0].homing.method = 15: must be a homing method of CiA 402: 1 to 14, 17 to 30, 33, 34, 35 or 37",
        ]),
        ("search_mm_s = 10.0", "search_mm_s = 101", &[
            "m.toml:22:15: joint[0].homing.search_mm_s = 101: must not be above velocity_mm_s of the joint, 100",
        ]),
        ("latch_mm_s = 1.0", "latch_mm_s = 11.0", &[
            "m.toml:23:14: joint[0].homing.latch_mm_s = 11.0: must not be above search_mm_s, 10",
        ]),
        ("latch_mm_s = 1.0", "latch_mm_s = 0.0001", &[
            "m.toml:23:14: joint[0].homing.latch_mm_s = 0.0001: must be 1 to 4294967295 in increments of the drive",
        ]),
        ("latch_mm_s = 1.0", "latch_mm_s = 1.0\nposition_mm = 10.5", &[
            "m.toml:24:15: joint[0].homing.position_mm = 10.5: must lie in travel_mm, -10 to 10",
        ]),
        ("[joint.homing]", "[joint.hominng]", &[
            "m.toml:12:1: joint[0].homing: is missing: how the drive finds its reference point: { method = 35, ... }",
            "m.toml:20:8: joint[0].hominng: unknown key; did you mean `homing`?",
        ]),
        ("[[axis]]", "[[joint]]\nnode = 1\n[[axis]]", &[
            "m.toml:25:1: joint[1].counts_per_unit: is missing: increments of the drive, or steps, per mm (degree), like [10000, 1]",
            "m.toml:25:1: joint[1].travel_mm: is missing: soft limits, like [-5.0, 305.0]",
            "m.toml:25:1: joint[1].velocity_mm_s: is missing: a number",
            "m.toml:25:1: joint[1].acceleration_mm_s2: is missing: a number",
            "m.toml:25:1: joint[1].jerk_mm_s3: is missing: a number",
            "m.toml:25:1: joint[1].following_error_mm: is missing: a number",
            "m.toml:25:1: joint[1].homing: is missing: how the drive finds its reference point: { method = 35, ... }",
            "m.toml:26:8: joint[1].node = 1: is the drive of a joint above; of a node with several axes drive_axis says which",
            "m.toml:27:1: axis: joint 1 belongs to no axis",
        ]),
    ]);
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_axes_and_offsets() {
    check(&[
        ("letter = \"X\"", "letter = \"Q\"", &["m.toml:26:10: axis[0].letter = \"Q\": must be one of X Y Z A B C U V W"]),
        ("letter = \"X\"", "letter = \"XY\"", &["m.toml:26:10: axis[0].letter = \"XY\": must be one of X Y Z A B C U V W"]),
        ("joints = [0]", "joints = [1]", &[
            "m.toml:27:11: axis[0].joints[0] = 1: there is no such joint; joints: 1, counted from 0",
        ]),
        ("joints = [0]", "joints = []", &["m.toml:27:10: axis[0].joints = []: must name at least one joint"]),
        ("joints = [0]", "joints = [0]\n[[axis]]\nletter = \"x\"\njoints = [0]", &[
            "m.toml:29:10: axis[1].letter = \"x\": is taken by an axis above",
            "m.toml:30:11: axis[1].joints[0] = 0: belongs to an axis already",
        ]),
        ("joints = [0]", "joints = [0]\nvelocity_mm_s = 5", &["m.toml:28:1: axis[0].velocity_mm_s: unknown key; known here: letter, joints, wrapped"]),
        ("joints = [0]", "joints = [0]\n[offsets]\ng54 = { y = 1.0 }\ng59_1 = { x = \"1\" }\ng50 = {}\n", &[
            "m.toml:29:13: offsets.g54.y = 1.0: the machine has no such axis",
            "m.toml:30:15: offsets.g59_1.x = \"1\": must be a number, is a string",
            "m.toml:31:1: offsets.g50: unknown key; did you mean `g54`?",
        ]),
    ]);
}

#[test]
#[rustfmt::skip] // one case a line
fn rules_of_the_rest() {
    let end = "joints = [0]\n";
    check(&[
        (end, "joints = [0]\n[spindle]\nrpm_max = 0\n[program]\ntolerance_mm = 0\nlook_ahead_blocks = 0\nthreads = 65\n", &[
            "m.toml:29:11: spindle.rpm_max = 0: must be above 0",
            "m.toml:31:16: program.tolerance_mm = 0: must be above 0",
            "m.toml:32:21: program.look_ahead_blocks = 0: must be an integer from 1 to 1000000",
            "m.toml:33:11: program.threads = 65: must be an integer from 1 to 64",
        ]),
        (end, "joints = [0]\n[program]\nlook_ahead_buffer_blocks = 0\nlook_ahead_overlap_blocks = -1\n", &[
            "m.toml:29:28: program.look_ahead_buffer_blocks = 0: must be an integer from 1 to 1000000",
            "m.toml:30:29: program.look_ahead_overlap_blocks = -1: must be an integer from 0 to 1000000",
        ]),
        (end, "joints = [0]\n[program]\nplanner_threads = 3\n", &[
            "m.toml:29:1: program.planner_threads: is called `threads` now",
        ]),
        (end, "joints = [0]\n[sim]\nnatural_frequency_hz = 0\ndamping = -1\nstart = 1.5\n", &[
            "m.toml:29:24: sim.natural_frequency_hz = 0: must lie between 0.1 and 1000",
            "m.toml:30:11: sim.damping = -1: must lie between 0.01 and 10",
            "m.toml:31:9: sim.start = 1.5: must lie between 0 and 1",
        ]),
        (end, "joints = [0]\n[[sim.fault]]\nnode = 2\nkind = \"sto\"\nafter_s = -1\n[[sim.fault]]\nnode = 1\nkind = \"slow-enable\"\nafter_s = 1\n[[sim.fault]]\nnode = 1\nkind = \"over-current\"\n", &[
            "m.toml:29:8: sim.fault[0].node = 2: must be a [[bus.node]] of profile \"cia402\"",
            "m.toml:31:11: sim.fault[0].after_s = -1: must lie between 0 and 3600",
            "m.toml:35:11: sim.fault[1].after_s = 1: must be left out: this kind is so from the start",
            "m.toml:38:8: sim.fault[2].kind = \"over-current\": must be \"overcurrent\" or \"following-error\" or \"limit-switch\" or \"index-missing\" or \"slow-enable\" or \"power-off\" or \"sto\"; did you mean \"overcurrent\"?",
        ]),
        (end, "joints = [0]\n[sim.probe]\nnode = 1\ninput = 7\n[[sim.probe.surface]]\naxis = \"Q\"\nbelow_mm = 1\nabove_mm = 2\n", &[
            "m.toml:29:8: sim.probe.node = 1: must be a [[bus.node]] of profile \"io\"",
            "m.toml:30:9: sim.probe.input = 7: must be an integer from 8 to 15",
            "m.toml:32:8: sim.probe.surface[0].axis = \"Q\": must be one of X Y Z A B C U V W",
            "m.toml:32:8: sim.probe.surface[0].axis = \"Q\": must have either above_mm or below_mm beside it: where the body is",
        ]),
        (end, "joints = [0]\n[estop]\ncategory = 2\n", &[
            "m.toml:29:12: estop.category = 2: must be an integer from 0 to 1",
        ]),
        ("[-10.0, 10]", "[-10.0, 10]\nlimit_switches = \"switch\"\nsto = { bit = 64, active = 1 }", &[
            "m.toml:16:18: joint[0].limit_switches = \"switch\": must be \"pin\" or \"drive\"",
            "m.toml:17:7: joint[0].sto.object: is missing: an object that the drive sends, like \"0x60FD\" or \"0x2110:1\"",
            "m.toml:17:15: joint[0].sto.bit = 64: must be an integer from 0 to 63",
            "m.toml:17:28: joint[0].sto.active = 1: must be true or false, is an integer",
        ]),
        ("[-10.0, 10]", "[-10.0, 10]\nsto = { object = \"60FD\", bit = 3 }", &[
            "m.toml:16:18: joint[0].sto.object = \"60FD\": must be an object that the drive sends, like \"0x60FD\" or \"0x2110:1\"",
        ]),
        ("[-10.0, 10]", "[-10.0, 10]\nsto = { object = \"0x2110:1\", bit = 3 }", &[
            "m.toml:16:18: joint[0].sto.object = \"0x2110:1\": must be among the inputs of its node",
        ]),
        ("[-10.0, 10]", "[-10.0, 10]\nsto = { object = \"0x6041\", bit = 16 }", &[
            "m.toml:16:34: joint[0].sto.bit = 16: must be below 16, the bits of 0x6041",
        ]),
        ("[-10.0, 10]", "[-10.0, 10]\nunhomed_jog_mm_s = 1e4", &[
            "m.toml:16:20: joint[0].unhomed_jog_mm_s = 1e4: must not be above velocity_mm_s, 100",
        ]),
        ("name = \"small\"", "name = \"small\"\nprobe_stops_jog = 1", &[
            "m.toml:4:19: machine.probe_stops_jog = 1: must be true or false, is an integer",
        ]),
        (end, "joints = [0]\n[sim.probe]\nnode = 1\ninput = 8\ndiameter_mm = -1\n[[sim.probe.box]]\nx_mm = [5, 5]\ny_mm = [1]\nz_mm = [nan, 2]\nhole = 1\n", &[
            "m.toml:29:8: sim.probe.node = 1: must be a [[bus.node]] of profile \"io\"",
            "m.toml:31:15: sim.probe.diameter_mm = -1: must lie between 0 and 100",
            "m.toml:33:8: sim.probe.box[0].x_mm = [5, 5]: the lower limit must be below the upper one",
            "m.toml:34:8: sim.probe.box[0].y_mm = [1]: must be two numbers: lower and upper limit",
            "m.toml:35:9: sim.probe.box[0].z_mm[0] = nan: must be a finite number",
            "m.toml:36:8: sim.probe.box[0].hole = 1: must be true or false, is an integer",
        ]),
        (end, "joints = [0]\n[sim.probe]\nnode = 1\ninput = 8\n[[sim.probe.cylinder]]\nx_mm = 0\ndiameter_mm = 0\nz_mm = [1, 2]\nradius_mm = 3\n", &[
            "m.toml:29:8: sim.probe.node = 1: must be a [[bus.node]] of profile \"io\"",
            "m.toml:31:1: sim.probe.cylinder[0].y_mm: is missing: a number",
            "m.toml:33:15: sim.probe.cylinder[0].diameter_mm = 0: must be above 0",
            "m.toml:35:1: sim.probe.cylinder[0].radius_mm: unknown key; known here: x_mm, y_mm, diameter_mm, z_mm, hole",
        ]),
        (end, "joints = [0]\n[service]\nperiod_ms = 10\n[hmi]\n[spindel]\n", &[
            "m.toml:28:2: service: unknown key; known here: schema, machine, rt, bus, steps, joint, axis, kinematics, offsets, spindle, program, tools, hal, sim, mains, estop, logic, panel, cell",
            "m.toml:30:2: hmi: unknown key; known here: schema, machine, rt, bus, steps, joint, axis, kinematics, offsets, spindle, program, tools, hal, sim, mains, estop, logic, panel, cell",
            "m.toml:31:2: spindel: unknown key; did you mean `spindle`?",
        ]),
        (end, "joints = [0]\n[[hal.net]]\nname = \"Run\"\nsource = \"a.b\"\ntargets = [\"a.b\", \"c..d\", \"e\"]\n[[hal.net]]\nname = \"n\"\nsource = \"x\"\ntargets = [\"e\", \"e\"]\n", &[
            "m.toml:29:8: hal.net[0].name = \"Run\": must be a name of lower-case letters, digits, dashes and dots, like \"joint.0.f-error\"",
            "m.toml:31:12: hal.net[0].targets[0] = \"a.b\": cannot read itself",
            "m.toml:31:19: hal.net[0].targets[1] = \"c..d\": must be a name of lower-case letters, digits, dashes and dots, like \"joint.0.f-error\"",
            "m.toml:35:17: hal.net[1].targets[1] = \"e\": is written by a net already: a pin has one writer",
        ]),
        (end, "joints = [0]\n[[hal.net]]\nname = \"n\"\nsource = \"x\"\ntargets = [\"e\"]\n[[hal.net]]\nname = \"n\"\nsource = \"y\"\ntargets = [\"e\"]\n[hal.order]\n", &[
            "m.toml:33:8: hal.net[1].name = \"n\": is taken by a net above",
            "m.toml:35:12: hal.net[1].targets[0] = \"e\": is written by a net already: a pin has one writer",
            "m.toml:36:6: hal.order: unknown key; known here: net, component, external, input",
        ]),
        (end, "joints = [0]\n[[hal.net]]\nname = \"n\"\nsource = \"x\"\ntargets = []\n", &[
            "m.toml:31:11: hal.net[0].targets = []: must name at least one pin",
        ]),
    ]);
}

#[test]
fn a_mark_of_the_encoding_is_no_part_of_the_text() {
    let path = Path::new("m.toml");
    assert_eq!(parse(&format!("\u{feff}{SMALL}"), path), parse(SMALL, path));
    let broken = |text: &str| parse(text, path).unwrap_err().to_string();
    assert_eq!(broken("\u{feff}[machine\n"), broken("[machine\n"));
}

#[test]
fn syntax_is_told_first_and_alone() {
    let text = changed("id = 1\n", "id = \n").replace("velocity_mm_s = 100\n", "velocity_mm_s = -1\nnode = 5\n");
    let errors = parse(&text, Path::new("m.toml")).unwrap_err();
    let places: Vec<_> = errors.errors().iter().map(|error| error.place).collect();
    assert_eq!(places, [Some((7, 6)), Some((17, 1))], "{errors}");
    let errors = parse(b"schema = 1\n# \xFF\n", Path::new("m.toml")).unwrap_err();
    assert_eq!(
        errors.errors().iter().next().unwrap().to_string(),
        "m.toml:2:3: must be UTF-8 text"
    );
}

#[test]
fn a_missing_file_is_an_error_of_the_file() {
    let errors = read(Path::new("/nowhere/m.toml")).unwrap_err();
    assert_eq!(errors.errors().len(), 1);
    assert!(
        errors
            .to_string()
            .contains("/nowhere/m.toml: cannot be read: No such file"),
        "{errors}"
    );
    assert_eq!(errors.to_json()["errors"][0]["line"], serde_json::Value::Null);
}

#[test]
fn errors_of_all_sections_come_together_as_text_and_json() {
    let text = changed("\n[bus]", "\ncycel_us = 1\n[rt]\npriority = \"high\"\n[bus]").replace("= 20000.0", "= 0.0");
    let errors = parse(&text, Path::new("m.toml")).unwrap_err();
    assert_eq!(
        errors.to_string(),
        "\
error: m.toml:4:1: machine.cycel_us: unknown key; did you mean `cycle_us`?
  |
4 | cycel_us = 1
  | ^^^^^^^^
error: m.toml:6:12: rt.priority = \"high\": must be an integer, is a string
  |
6 | priority = \"high\"
  |            ^^^^^^
error: m.toml:21:14: joint[0].jerk_mm_s3 = 0.0: must be above 0
   |
21 | jerk_mm_s3 = 0.0
   |              ^^^
3 errors in the machine file
"
    );
    assert_eq!(
        errors.to_json()["errors"][0],
        serde_json::json!({"line": 4, "column": 1, "key": "machine.cycel_us", "value": null,
            "rule": "unknown key", "hint": "did you mean `cycle_us`?"})
    );
}

/// Octet ranges of the numbers in the demo file, outside comments and mapping strings.
fn numbers() -> Vec<std::ops::Range<usize>> {
    let mut found = Vec::new();
    let mut start = 0;
    for line in DEMO.split_inclusive('\n') {
        if let Some((key, value)) = line
            .split_once(" = ")
            .filter(|_| !line.starts_with('#') && !line.contains("0x60"))
        {
            let value_at = start + key.len() + 3;
            let value = value.split('#').next().unwrap_or(value);
            let mut at = 0;
            for part in
                value.split(|c: char| !(c.is_ascii_alphanumeric() || c == '.' || c == '-' || c == '_' || c == '"'))
            {
                if part.starts_with(|c: char| c.is_ascii_digit() || c == '-') {
                    found.push(value_at + at..value_at + at + part.len());
                }
                at += part.len() + 1;
            }
        }
        start += line.len();
    }
    found
}

#[test]
fn every_number_of_the_demo_file_is_checked() {
    let numbers = numbers();
    assert!(numbers.len() > 60, "only {} found", numbers.len());
    for range in numbers {
        let mut text = DEMO.to_owned();
        text.replace_range(range.clone(), "1e300");
        let errors = parse(&text, Path::new("m.toml")).unwrap_err();
        let line = 1 + DEMO[..range.start].matches('\n').count();
        let error = errors
            .errors()
            .iter()
            .find(|error| error.place.is_some_and(|place| place.0 == line));
        let error = error.unwrap_or_else(|| panic!("line {line}: {errors}"));
        let key = DEMO.lines().nth(line - 1).unwrap().split(" = ").next().unwrap();
        assert!(error.key.contains(key), "{} names {key}", error.key);
        assert_eq!(error.value.as_deref(), Some("1e300"));
    }
}

proptest! {
    #[test]
    fn any_octets_are_refused_without_panic(text in prop::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(!parse(&text, Path::new("m")).unwrap_err().to_string().is_empty());
    }

    #[test]
    fn a_mutilated_machine_file_never_panics(
        at in 0..DEMO.len(), drop in 0usize..40, put in "[\\[\\]{}=\"'#\\na-z0-9.µ]{0,6}",
    ) {
        let end = (at + drop).min(DEMO.len());
        let text = [&DEMO.as_bytes()[..at], put.as_bytes(), &DEMO.as_bytes()[end..]].concat();
        if let Err(errors) = parse(&text, Path::new("m")) {
            prop_assert!(!errors.to_string().is_empty());
            prop_assert!(errors.errors().iter().all(|error| !error.rule.contains("was lost")), "{}", errors);
        }
    }

    #[test]
    fn a_truncated_machine_file_is_refused(at in 0..DEMO.len()) {
        let errors = parse(&DEMO.as_bytes()[..at], Path::new("m"));
        // Behind the last table that must be there, whole lines may be missing.
        if at < DEMO.find("letter = \"Z\"").unwrap() {
            prop_assert!(errors.is_err());
        }
    }

    #[test]
    fn a_mutated_number_names_its_key(index in 0usize..60, factor in prop::sample::select(vec![-1.0, -1e9, 1e12])) {
        let range = numbers()[index].clone();
        let Ok(old) = DEMO[range.clone()].parse::<f64>() else { return Ok(()) };
        let mut text = DEMO.to_owned();
        text.replace_range(range.clone(), &format!("{:.1}", old * factor));
        let line = 1 + DEMO[..range.start].matches('\n').count();
        if let Err(errors) = parse(&text, Path::new("m.toml")) {
            // A changed limit may also break the rules of those that are compared with it; one names the place itself.
            prop_assert!(errors.errors().iter().all(|error| error.place.is_some()));
            let near = |error: &ConfigError| error.place.is_some_and(|place| place.0.abs_diff(line) <= 12);
            prop_assert!(errors.errors().iter().any(near), "{}", errors);
        }
    }
}

#[test]
fn compensation_divides_what_the_joint_can_do() {
    let config = parse(
        &changed("jerk_mm_s3 = 20000.0", "jerk_mm_s3 = 20000.0\nbacklash_mm = 0.02"),
        Path::new("m.toml"),
    );
    let joint = config.unwrap().joints.remove(0);
    let compensation = joint.compensation.unwrap();
    let take_up = compensation.take_up;
    assert_eq!(
        (compensation.backlash_mm, compensation.table),
        (0.02, motion::rt::PitchTable::default())
    );
    assert_eq!([joint.limits.velocity_mm_s, take_up.velocity], [95.0, 5.0]);
    assert_eq!([joint.stop.acceleration_mm_s2, take_up.acceleration], [1500.0, 500.0]);
    assert_eq!([joint.stop.jerk_mm_s3, take_up.jerk], [50_000.0, 30_000.0]);
    assert_eq!(parse(SMALL, Path::new("m.toml")).unwrap().joints[0].compensation, None);
}

#[test]
fn a_mistake_in_a_compensation_file_is_told_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("m.toml");
    let text = changed(
        "jerk_mm_s3 = 20000.0",
        "jerk_mm_s3 = 20000.0\ncompensation_file = \"x.comp\"",
    );
    let rule_with = |text: &str, content: &str| {
        std::fs::write(folder.path().join("x.comp"), content).unwrap();
        match parse(text, &machine) {
            Ok(config) => {
                let table = &config.joints[0].compensation.as_ref().unwrap().table;
                format!("{:.4}", table.correction_mm(5.0, true))
            }
            Err(errors) => {
                let rule = &errors.errors()[0].rule;
                rule.split_once("x.comp:")
                    .map_or(rule.as_str(), |(_, rule)| rule)
                    .to_owned()
            }
        }
    };
    let rule = |content: &str| rule_with(&text, content);
    let columns = "a line is three numbers: position, measured forward, measured backward, mm";
    assert_eq!(
        rule("# told forward backward\n0 0 0.01 ; home\n\n10 9.98 9.99\n"),
        "0.0100"
    );
    // What is added, as LinuxCNC's COMP_FILE_TYPE = 1 has it.
    const CORRECTIONS: &str = "0 0.001 0.002\n2 0.003 0.002\n9 0.01 0.011\n";
    assert_eq!(
        rule(CORRECTIONS),
        "2:1: corrects by 1.997 mm at 2 mm, more than 0.5; the file was read as positions, and fits as corrections: write \
         compensation_type = \"corrections\" if that is what it holds"
    );
    let with = |more: &str| {
        changed(
            "jerk_mm_s3 = 20000.0",
            &format!("jerk_mm_s3 = 20000.0\ncompensation_file = \"x.comp\"\n{more}"),
        )
    };
    assert_eq!(
        rule_with(&with("compensation_type = \"corrections\""), CORRECTIONS),
        "0.0060"
    );
    const FAR_OFF: &str = "0 0 0\n10 9.8 9.8\n50 49.2 49.2\n";
    assert_eq!(
        rule(FAR_OFF),
        "2:1: corrects by 0.02 mm per mm more than the row before, more than 0.01; correct the file, or raise \
         compensation_slope_max if the machine is really that far off"
    );
    let steep = with("compensation_slope_max = 0.02");
    assert_eq!(
        rule_with(&steep, FAR_OFF),
        "3:1: corrects by 0.8 mm at 50 mm, more than 0.5; correct the file, or raise compensation_max_mm if the machine is really \
         that far off"
    );
    let raised = with("compensation_slope_max = 0.02\ncompensation_max_mm = 1.0");
    assert_eq!(rule_with(&raised, FAR_OFF), "0.1000");
    let tight = format!("{raised}\n");
    let tight = tight.replacen(
        "compensation_max_mm = 1.0",
        "compensation_max_mm = 1.0\nstop_jerk_mm_s3 = 24000.0",
        1,
    );
    let told = rule_with(&tight, FAR_OFF);
    assert!(
        told.starts_with("cannot be followed within the limits of the joint: its bends would have to be rounded by"),
        "{told}"
    );
    assert!(rule_with(&with("backlash_mm = 0.02"), "0 0 0.01\n").contains("would count twice"));
    assert_eq!(rule_with(&with("backlash_mm = 0.0"), "0 0 0.01\n"), "0.0000");
    assert_eq!(
        messages(&changed(
            "jerk_mm_s3 = 20000.0",
            "jerk_mm_s3 = 20000.0\ncompensation_max_mm = 1.0"
        ))[0],
        "m.toml:19:23: joint[0].compensation_max_mm = 1.0: is about a compensation_file, and there is none"
    );
    assert_eq!(rule("\u{feff}0 0 0.01\n10 9.98 9.99\n"), "0.0100");
    assert_eq!(rule("0 0 0\n10 1o 10\n"), format!("2:4: 1o is not a number; {columns}"));
    assert_eq!(rule("0 0\n"), format!("1:1: 2 numbers; {columns}"));
    assert_eq!(rule("# nothing\n"), format!("1:1: no row; {columns}"));
    assert_eq!(
        rule("# falling\n5 5 5\n\n4 4 4\n"),
        "4:1: position 4 is not above the one before, 5"
    );
    std::fs::remove_file(folder.path().join("x.comp")).unwrap();
    assert!(
        messages(&text)[0].contains("compensation_file = \"x.comp\": cannot be read"),
        "{:?}",
        messages(&text)
    );
    let worn = changed("jerk_mm_s3 = 20000.0", "jerk_mm_s3 = 20000.0\nbacklash_mm = -1");
    assert!(
        messages(&worn)[0].contains("must lie between 0 and 10"),
        "{:?}",
        messages(&worn)
    );
}

/// A generated file with a hundred thousand mistakes is told like one with a hundred: what is told grows with what is shown, not
/// with the square of the file.
#[test]
fn of_very_many_mistakes_the_first_are_told_and_all_are_counted() {
    let keys: String = (0..100_000).map(|number| format!("key{number} = 1\n")).collect();
    let errors = parse(&format!("{keys}{SMALL}"), Path::new("m.toml")).unwrap_err();
    assert_eq!(errors.errors().len(), 100);
    assert!(errors.to_string().ends_with("\n100000 errors in the machine file\n"));
    assert_eq!(errors.to_json()["more"], 99_900);
    // On one line, each excerpt would be the whole file.
    let keys: String = (0..20_000).map(|number| format!("key{number}=1,")).collect();
    let line = format!("{SMALL}[hal]\nset = {{{}}}\n[rt]\nspin = {{{}}}\n", keys, keys);
    let errors = parse(&line, Path::new("m.toml")).unwrap_err();
    assert!(errors.to_string().len() < 2000, "{errors}");
    let many = "[[hal.net]]\nname = \"a\"\n".repeat(4097);
    assert_eq!(
        messages(&format!("{SMALL}{many}")),
        ["m.toml:28:1: hal.net: must not have more than 4096 items, has 4097"]
    );
}
