//! The same machine on POWERLINK and on EtherCAT, on virtual time: programs in every mode of its drives, set-points, probing,
//! homing, spindles, faults.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::{Rehearsal, rehearse, rehearse_with};
use isocnc::rt::phase::sync0_us;
use isocnc::sim::{Disturbance, NetConfig};
use std::path::Path;

const POWERLINK: &str = include_str!("../configs/mill3-demo.toml");
const ETHERCAT: &str = include_str!("../configs/mill3-ethercat.toml");
/// X and Y are told a velocity, Z a torque.
const LOOP: &str = include_str!("../configs/loop3-demo.toml");
/// Two axes at each node.
const DOUBLE: &str = include_str!("../configs/double2-demo.toml");
/// Drives that are known by their profiles, and a spindle.
const CABINET: &str = include_str!("../configs/cabinet2-demo.toml");
const CYCLES_MAX: u64 = 200_000;
/// Increments of the drives of the mill, and rounding.
const RESOLUTION_MM: f64 = 2e-4;

/// Between M62 and M63 stands what is compared: lines, arcs, corners, a dwell.
const PROGRAM: &str = "G21 G90 G64 P0.01\nG53 G0 X20 Y20 Z-20\nM62 P1\nG53 G1 X60 Y30 Z-25 F6000\nG91 G2 X20 Y20 I20 J0\n\
    G1 X-30 Y5\nX-10 Y-20 Z3\nG4 P0.05\nX5\nM63 P1\nG1 X-1\nG90\nM2\n";

fn machine(text: &str) -> Config {
    config::parse(text, Path::new("machine.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// A machine file for POWERLINK, for EtherCAT: a node stands at the position that its id says.
fn on_ethercat(machine_file: &str) -> String {
    const OF_POWERLINK: [&str; 3] = ["soc_lost_max", "pres_timeout_us", "async_slot_timeout_us"];
    let means_something = |line: &&str| OF_POWERLINK.iter().all(|key| !line.starts_with(key));
    let lines = machine_file.lines().filter(means_something);
    let line = |line: &str| match line.strip_prefix("pres_lost_max") {
        Some(rest) => format!("lost_max{rest}\n"),
        None => format!("{line}\n"),
    };
    let text: String = lines.map(line).collect();
    let text = text.replace("kind = \"memory\"", "kind = \"ethercat-memory\"");
    text.replace("kind = \"powerlink\"", "kind = \"ethercat\"")
}

/// The same machine on both buses.
fn both(machine_file: &str) -> [(&'static str, Config); 2] {
    [
        ("POWERLINK", machine(machine_file)),
        ("EtherCAT", machine(&on_ethercat(machine_file))),
    ]
}

/// Runs a program to its end, looking on in every cycle.
fn completed(
    bus: &str,
    config: &Config,
    program: &str,
    net: NetConfig,
    mut look: impl FnMut(&mut Rehearsal<'_>),
) -> anyhow::Result<()> {
    rehearse(config, program.as_bytes(), net, |run| {
        run.run_until(CYCLES_MAX, |run| {
            look(run);
            run.operator.outcome().is_some()
        })?;
        let (outcome, journal) = (run.operator.outcome(), run.operator.journal());
        assert_eq!(outcome, Some(Outcome::Completed), "{bus} {net:?} {journal:#?}");
        Ok(())
    })
}

/// Set-points of all joints between the marks of the program, bit by bit.
fn set_points(config: &Config, net: NetConfig) -> Vec<Vec<u64>> {
    let mut seen = Vec::new();
    completed("", config, PROGRAM, net, |run| {
        if run.hal.reader::<bool>("motion.digital-out-01").expect("a pin").get() {
            let joints = 0..config.joints.len();
            let command = |joint| {
                let name = format!("joint.{joint}.motor-pos-cmd");
                run.hal.reader::<f64>(&name).expect("a pin").get().to_bits()
            };
            seen.push(joints.map(command).collect());
        }
    })
    .expect("a machine to rehearse on");
    seen
}

#[test]
fn the_same_program_gives_the_same_set_points_to_the_bit_on_both_buses() {
    let net = NetConfig::clean(3);
    let on_powerlink = set_points(&machine(POWERLINK), net);
    assert!(on_powerlink.len() > 1000, "{}", on_powerlink.len());
    assert!(on_powerlink == set_points(&machine(ETHERCAT), net));
    // Interpolated position; velocities and a torque, for loops that the control closes; two axes at one node.
    let interpolated = POWERLINK
        .replace("\"0x607A/32\"", "\"0x60C1:1/32\"")
        .replace("counts_per_unit", "mode = \"ip\"\ncounts_per_unit");
    for machine_file in [&interpolated, LOOP, DOUBLE] {
        let [on_powerlink, on_ethercat] = both(machine_file).map(|(_, config)| set_points(&config, net));
        assert!(on_powerlink.len() > 1000, "{}", on_powerlink.len());
        assert!(on_powerlink == on_ethercat);
    }
}

/// What EtherCAT makes possible: eight cycles in a millisecond. Drives are told so by 60C2, and refuse what is not their cycle.
#[test]
fn a_part_takes_the_same_time_and_ends_at_the_same_place_in_cycles_of_125_us() {
    let slow = set_points(&machine(ETHERCAT), NetConfig::clean(3));
    let text = ETHERCAT
        .replace("\ncycle_us = 1000", "\ncycle_us = 125")
        .replace("late_us_max = 500", "late_us_max = 60");
    let fast = set_points(&machine(&text), NetConfig::clean(3));
    let times = fast.len() as f64 / slow.len() as f64;
    assert!((7.9..8.1).contains(&times), "{} and {} cycles", slow.len(), fast.len());
    let end = |set_points: &[Vec<u64>]| {
        set_points
            .last()
            .map(|joints| joints.iter().map(|bits| f64::from_bits(*bits)).collect::<Vec<_>>())
    };
    for (one, other) in end(&slow).into_iter().flatten().zip(end(&fast).into_iter().flatten()) {
        assert!((one - other).abs() < 1e-9, "{one} {other}");
    }
}

#[test]
fn lost_frames_change_no_set_point_on_ethercat() {
    let config = machine(ETHERCAT);
    let clean = set_points(&config, NetConfig::clean(3));
    for seed in 0..6 {
        let net = NetConfig {
            loss: 0.0005,
            ..NetConfig::clean(seed)
        };
        assert!(clean == set_points(&config, net), "seed {seed}");
    }
}

/// Where the touch probes of the drives find the floor of the pocket (60B8h to 60BDh), and back there.
#[test]
fn the_touch_probes_of_the_drives_find_the_same_place_on_both_buses() {
    const FLOOR_MM: f64 = -100.0;
    let objects = "outputs = [\"0x6040/16\", \"0x6060/8\", \"0x60B8/16\", \"0x607A/32\"]\n\
        inputs = [\"0x6041/16\", \"0x6061/8\", \"0x60B9/16\", EDGES, \"0x6064/32\"]";
    for (number, edges) in [(1, "\"0x60BA/32\", \"0x60BB/32\""), (2, "\"0x60BC/32\", \"0x60BD/32\"")] {
        let objects = objects.replace("EDGES", edges);
        // The first node writes its objects out.
        let lines = POWERLINK
            .lines()
            .filter(|line| !line.starts_with("outputs") && !line.starts_with("inputs"));
        let text: String = lines.map(|line| format!("{line}\n")).collect();
        let text = text
            .replace("profile = \"cia402\"", &format!("profile = \"cia402\"\n{objects}"))
            .replace("counts_per_unit", &format!("touch_probe = {number}\ncounts_per_unit"));
        for towards in ["", "G38.4 Z-20 F600\n"] {
            let program = format!("G21 G90 G94 G54\nG53 G0 Z-80\nG38.2 Z-44.5 F600\n{towards}G0 Z[#5063]\nM2\n");
            for (bus, config) in both(&text) {
                let mut found_mm = 0.0;
                completed(bus, &config, &program, NetConfig::clean(1), |run| {
                    found_mm = run
                        .operator
                        .recorder
                        .samples()
                        .last()
                        .map_or(0.0, |sample| sample.command[2]);
                })
                .expect("a machine to rehearse on");
                let off_mm = (found_mm - FLOOR_MM).abs();
                assert!(off_mm <= RESOLUTION_MM, "{bus}, probe {number}: {found_mm}");
            }
        }
    }
}

/// Drives that home by themselves, by every kind of method: limit switches, home switch, zero mark, where they stand.
#[test]
fn drives_home_by_the_same_methods_to_the_same_places_on_both_buses() {
    for method in [1, 7, 17, 19, 21, 23, 33, 34, 37] {
        let text = POWERLINK.replace("method = 21", &format!("method = {method}"));
        let homed = both(&text).map(|(bus, config)| {
            let mut places = [[0.0; 2]; 3];
            completed(bus, &config, "M2\n", NetConfig::clean(1), |run| {
                for (joint, place) in places.iter_mut().enumerate() {
                    let name = format!("joint.{joint}.motor-pos-fb");
                    let shown_mm = run.hal.reader::<f64>(&name).expect("a pin").get();
                    let load_mm = run.net().machine().joint_position_mm(joint).expect("a joint");
                    *place = [shown_mm, load_mm];
                }
            })
            .expect("a machine to rehearse on");
            places
        });
        let [on_powerlink, on_ethercat] = homed.map(|places| places.map(|[shown_mm, load_mm]| load_mm - shown_mm));
        for (joint, (one, other)) in on_powerlink.iter().zip(on_ethercat).enumerate() {
            println!("{method} {joint}: {one} {other}");
            assert!(
                (one - other).abs() <= RESOLUTION_MM,
                "method {method}, joint {joint}: {one} mm, {other} mm"
            );
        }
    }
}

/// A spindle that a drive turns: by velocity (VL), profile velocity (PV) and cyclic velocity (CSV).
#[test]
fn drives_turn_the_spindle_in_each_of_its_modes_on_both_buses() {
    const PART: &str = "G21 G90 G54 G64\nM3 S1200\nG1 X30 F3000\nM4 S600\nG1 X0\nM5\nG4 P1\nM2\n";
    let servo = |keys: &str| {
        let text = CABINET.replace("drive = \"schneider-atv320\"", "");
        text.replace("mode = \"vl\"", keys)
    };
    for text in [
        CABINET.to_owned(),
        servo("mode = \"pv\"\nunits_per_rpm = [4096, 60]"),
        servo("mode = \"csv\"\nunits_per_rpm = [65536, 60]\nramp_rpm_s = 1500.0"),
    ] {
        for (bus, config) in both(&text) {
            let mode = config.spindle.axis.as_ref().expect("a drive").mode;
            let mut fed_rpm = [0.0; 2];
            completed(bus, &config, PART, NetConfig::clean(3), |run| {
                let read = |pin: &str| run.hal.reader::<f64>(pin).expect("a pin").get();
                if read("motion.current-vel") > 0.0 {
                    let rpm = 60.0 * read("spindle.0.speed-in");
                    fed_rpm[usize::from(rpm < 0.0)] = rpm;
                }
            })
            .expect("a machine to rehearse on");
            let off = [fed_rpm[0] - 1200.0, fed_rpm[1] + 600.0];
            assert!(off.iter().all(|off| off.abs() < 65.0), "{bus} {mode:?}: {fed_rpm:?}");
        }
    }
}

/// The clock of the bus leads: cycles begin at one place before SYNC0, whose clock runs apart from ours, though they begin up to 5 us late
/// and frames take 2 to 5 us to the drives.
#[test]
fn cycles_begin_at_one_place_before_sync0_and_that_is_reported() {
    for seed in 1..4 {
        let config = machine(ETHERCAT);
        assert_eq!(sync0_us(&config), Some(500.0));
        let net = NetConfig::clean(seed);
        let phase = rehearse_with(&config, b"", net, Operator::standing_by, |run| {
            let mut late_ns = seed;
            let mut cycles = |run: &mut Rehearsal<'_>, count: u32| -> anyhow::Result<()> {
                for _ in 0..count {
                    late_ns = (late_ns * 7_919 + 12_345) % 5_001;
                    run.cycle(late_ns)?;
                }
                Ok(())
            };
            // Until it is heard, and a second more.
            while run.take_phase().is_none() {
                cycles(run, 10)?;
            }
            cycles(run, 1000)?;
            run.take_phase();
            cycles(run, 5000)?;
            Ok(run.take_phase())
        });
        let phase = phase.expect("a machine to rehearse on").expect("a clock leads");
        println!("seed {seed}: {phase:?}");
        assert_eq!(phase.n, 5000);
        assert!(phase.std_us <= 1.0 && phase.range_us <= 8.0, "{phase:?}");
        assert!(phase.mean_us.abs() <= 1.0, "{phase:?}");
    }
    let phase = rehearse_with(
        &machine(POWERLINK),
        b"",
        NetConfig::clean(1),
        Operator::standing_by,
        |run| {
            run.run_until(2000, |_| false)?;
            Ok(run.take_phase())
        },
    );
    assert_eq!(phase.expect("a machine to rehearse on"), None, "nobody but us leads");
}

/// What the journal has once a disturbance has ended the program.
fn journal(disturbance: Disturbance) -> String {
    rehearse(&machine(ETHERCAT), PROGRAM.as_bytes(), NetConfig::clean(1), |run| {
        let mark = run.hal.reader::<bool>("motion.digital-out-01").expect("a pin");
        assert!(run.run_until(CYCLES_MAX, |_| mark.get())?, "the program runs");
        run.run_until(100, |_| false)?;
        run.net().at(0, disturbance);
        assert_eq!(run.run(CYCLES_MAX)?, Outcome::Faulted);
        let entries = run.operator.journal().iter();
        Ok(entries.map(|entry| format!("{}\n", entry.text)).collect())
    })
    .expect("a machine to rehearse on")
}

#[test]
fn a_drive_without_supply_a_pulled_cable_and_a_fault_stop_the_program_and_are_named() {
    let told = journal(Disturbance::PowerOff { node: 3 });
    assert!(told.contains("z-drive"), "{told}");
    let told = journal(Disturbance::Unplug { node: 2 });
    assert!(told.contains("y-drive"), "{told}");
    let told = journal(Disturbance::DriveFault {
        node: 1,
        error_code: 0x4310,
    });
    assert!(told.contains("x-drive") && told.contains("4310"), "{told}");
}
