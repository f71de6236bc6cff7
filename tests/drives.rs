//! Drives as they are in cabinets, on the whole path and on virtual time: program text to simulated drives and back.

use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
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

/// The greatest following error of a part on a machine, mm, by the pin of the first joint.
fn following_error_max_mm(config: &Config, text: &str) -> f64 {
    rehearse(config, text.as_bytes(), NetConfig::clean(3), |run| {
        let error = run.hal.reader::<f64>("joint.0.f-error").expect("a pin");
        let mut greatest: f64 = 0.0;
        let over = run.run_until(CYCLES_MAX, |run| {
            if run.control.state() == State::Running {
                greatest = greatest.max(error.get().abs());
            }
            run.operator.outcome().is_some()
        });
        assert!(over.expect("a good program"), "never over:\n{}", journal(run));
        assert_eq!(run.operator.outcome(), Some(Outcome::Completed), "{}", journal(run));
        Ok(greatest)
    })
    .expect("a machine that can be rehearsed")
}

#[test]
fn a_velocity_that_is_fed_forward_leaves_less_following_error() {
    let csp = SEED
        .replace("[\"0x6062/32\"", "[\"0x607A/32\"")
        .replace("mode = \"ip\"", "mode = \"csp\"");
    let part = "G21 G90 G54 G64\nG1 X120 F9000\nG1 X0\nM2\n";
    let without_mm = following_error_max_mm(&read(&csp), part);
    let with = csp.replace("\"0x6040/16\"]", "\"0x60B1/32\", \"0x6040/16\"]");
    let with_mm = following_error_max_mm(&read(&with), part);
    println!("{without_mm} {with_mm}");
    assert!(with_mm < 0.7 * without_mm, "{with_mm} against {without_mm} mm");
}

/// 605A = 6 holds the motor after a quick stop; what the machine file says of it is what the drive does.
#[test]
fn a_drive_is_configured_with_the_reactions_of_the_machine_file() {
    let text = SEED.replacen(
        "\n[[joint]]\nnode = 2",
        "[joint.reactions]\nquick_stop = 1\nshutdown = 1\ndisable = 0\nhalt = 2\nfault = 0\nconnection_lost = 3\n\n[[joint]]\nnode = 2",
        1,
    );
    let config = read(&text);
    let plans = isocnc::bus::plan(&config);
    let value = |node: usize, index: u16| {
        let mut writes = plans[node].writes.iter();
        writes
            .find(|write| write.index == index)
            .map(|write| write.value.clone())
    };
    let written = [0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6007].map(|index| value(0, index));
    let expected = [1_i16, 1, 0, 2, 0, 3].map(|value| Some(value.to_le_bytes().to_vec()));
    assert_eq!(written, expected);
    assert_eq!((value(1, 0x605A), value(1, 0x605E)), (Some(vec![2, 0]), None));
    let places = run_part(&config, "G21 G90 G54\nG1 X10 F6000\nM2\n");
    assert!((places.last().unwrap()[0] - 30.0).abs() < 0.001);
}
