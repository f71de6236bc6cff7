//! The same machine on POWERLINK and on EtherCAT, on virtual time: programs, set-points, faults.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::operator::rehearsal::rehearse;
use isocnc::sim::{Disturbance, NetConfig};
use std::path::Path;

const POWERLINK: &str = include_str!("../configs/mill3-demo.toml");
const ETHERCAT: &str = include_str!("../configs/mill3-ethercat.toml");
const CYCLES_MAX: u64 = 200_000;

/// Between M62 and M63 stands what is compared: lines, arcs, corners, a dwell.
const PROGRAM: &str = "G21 G90 G64 P0.01\nG53 G0 X20 Y20 Z-20\nM62 P1\nG53 G1 X60 Y30 Z-25 F6000\nG91 G2 X20 Y20 I20 J0\n\
    G1 X-30 Y5\nX-10 Y-20 Z3\nG4 P0.05\nX5\nM63 P1\nG1 X-1\nG90\nM2\n";

fn machine(text: &str) -> Config {
    config::parse(text, Path::new("machine.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// Set-points of all joints between the marks of the program, bit by bit.
fn set_points(machine_file: &str, net: NetConfig) -> Vec<[u64; 3]> {
    rehearse(&machine(machine_file), PROGRAM.as_bytes(), net, |run| {
        let mark = run.hal.reader::<bool>("motion.digital-out-01").expect("a pin");
        let joints = [0, 1, 2].map(|joint| {
            let name = format!("joint.{joint}.motor-pos-cmd");
            run.hal.reader::<f64>(&name).expect("a pin")
        });
        let mut seen = Vec::new();
        run.run_until(CYCLES_MAX, |run| {
            if mark.get() {
                seen.push([0, 1, 2].map(|joint: usize| joints[joint].get().to_bits()));
            }
            run.operator.outcome().is_some()
        })?;
        let outcome = run.operator.outcome();
        assert_eq!(
            outcome,
            Some(Outcome::Completed),
            "{net:?} {:#?}",
            run.operator.journal()
        );
        Ok(seen)
    })
    .expect("a machine to rehearse on")
}

#[test]
fn the_same_program_gives_the_same_set_points_to_the_bit_on_both_buses() {
    let on_powerlink = set_points(POWERLINK, NetConfig::clean(3));
    assert!(on_powerlink.len() > 1000, "{}", on_powerlink.len());
    assert!(on_powerlink == set_points(ETHERCAT, NetConfig::clean(3)));
}

#[test]
fn lost_frames_change_no_set_point_on_ethercat() {
    let clean = set_points(ETHERCAT, NetConfig::clean(3));
    for seed in 0..6 {
        let net = NetConfig {
            loss: 0.0005,
            ..NetConfig::clean(seed)
        };
        assert!(clean == set_points(ETHERCAT, net), "seed {seed}");
    }
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
