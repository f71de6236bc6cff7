//! Drives as they are in cabinets, on the whole path and on virtual time: program text to simulated drives and back.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::sim::NetConfig;
use std::path::Path;

const SEED: &str = include_str!("../configs/seed-2axis.toml");
const SEED_PART: &str = include_str!("../configs/seed-part.ngc");
const CYCLES_MAX: u64 = 60_000;

fn read(text: &str) -> Config {
    config::parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

fn journal(run: &Rehearsal<'_>) -> String {
    let entries = run.operator.journal().iter();
    entries
        .map(|entry| format!("{:9.3} {}\n", entry.time_s, entry.text))
        .collect()
}

/// Runs a program to its end; where the loads of all joints were, cycle by cycle, machine coordinates.
fn run_part(config: &Config, text: &str) -> Vec<Vec<f64>> {
    rehearse(config, text.as_bytes(), NetConfig::clean(3), |run| {
        let mut places = Vec::new();
        let joints = config.joints.len();
        let over = run.run_until(CYCLES_MAX, |run| {
            let net = run.net();
            let machine = net.machine();
            places.push(
                (0..joints)
                    .filter_map(|joint| machine.joint_position_mm(joint))
                    .collect(),
            );
            run.operator.outcome().is_some()
        });
        assert!(over.expect("a good program"), "never over:\n{}", journal(run));
        assert_eq!(run.operator.outcome(), Some(Outcome::Completed), "{}", journal(run));
        Ok(places)
    })
    .expect("a machine that can be rehearsed")
}

/// How near the loads came to a place.
fn distance_mm(places: &[Vec<f64>], at: &[f64]) -> f64 {
    let distance = |place: &Vec<f64>| {
        let squares = place.iter().zip(at).map(|(place, at)| (place - at) * (place - at));
        squares.sum::<f64>().sqrt()
    };
    places.iter().map(distance).fold(f64::INFINITY, f64::min)
}

#[test]
fn two_axes_with_the_published_process_data_make_their_part() {
    let config = read(SEED);
    let octets = |objects: &[config::Mapped]| objects.iter().map(|object| usize::from(object.bits / 8)).sum::<usize>();
    for node in &config.bus.nodes {
        assert_eq!((octets(&node.outputs), octets(&node.inputs)), (11, 14));
    }
    // The same with the objects that the profile has for it.
    let csp = SEED
        .replace("[\"0x6062/32\"", "[\"0x607A/32\"")
        .replace("mode = \"ip\"", "mode = \"csp\"");
    let ip = SEED.replace("[\"0x6062/32\"", "[\"0x60C1:1/32\"");
    for text in [SEED, &csp, &ip] {
        let places = run_part(&read(text), SEED_PART);
        // Work coordinates of places on frame, circle and star; G54 lies at 20, 20. A load lags behind its command.
        for [x, y] in [
            [50.0, 0.0],
            [97.071, 2.929],
            [100.0, 30.0],
            [0.0, 30.0],
            [30.0, 30.0],
            [50.0, 50.0],
            [50.0, 30.0],
            [60.0, 20.0],
        ] {
            let missed_mm = distance_mm(&places, &[x + 20.0, y + 20.0]);
            assert!(missed_mm < 0.1, "{x} {y} missed by {missed_mm} mm");
        }
        let last = places.last().unwrap();
        assert!(last.iter().all(|place| (place - 20.0).abs() < 0.001), "{last:?}");
    }
}
