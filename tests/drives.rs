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

/// A probing move down to the floor of the pocket at -100, and back to where it was found; on the drives' touch probes, or on the
/// pin alone. Where it was found, Z.
fn found_mm(config: &Config, feed: u32, towards: bool) -> f64 {
    let text = match towards {
        true => format!("G21 G90 G94 G54\nG53 G0 Z-80\nG38.2 Z-44.5 F{feed}\nG0 Z[#5063]\nM2\n"),
        // Off the floor, in the other direction.
        false => {
            format!("G21 G90 G94 G54\nG53 G0 Z-80\nG38.2 Z-44.5 F60\nG38.4 Z-20 F{feed}\nG0 Z[#5063]\nM2\n")
        }
    };
    rehearse(config, text.as_bytes(), NetConfig::clean(1), |run| {
        assert_eq!(
            run.run(CYCLES_MAX).expect("an end"),
            Outcome::Completed,
            "{}",
            journal(run)
        );
        Ok(run.operator.recorder.samples().last().expect("a program ran").command[2])
    })
    .expect("a machine that can be rehearsed")
}

#[test]
fn touch_probes_of_the_drives_agree_with_the_pin_within_the_way_of_a_cycle() {
    const FLOOR_MM: f64 = -100.0;
    /// Increments of the drives, and rounding.
    const INCREMENT_MM: f64 = 1e-4;
    let mill = include_str!("../configs/mill3-demo.toml");
    let pin = read(mill);
    for number in [1, 2] {
        let edges = ["\"0x60BA/32\", \"0x60BB/32\"", "\"0x60BC/32\", \"0x60BD/32\""][number - 1];
        let mut text = mill.to_owned();
        for node in ["x-drive", "y-drive", "z-drive"] {
            let name = format!("name = \"{node}\"");
            let start = text.find(&name).expect("a node");
            // The first node writes its objects out; they are those that the others have.
            if let Some(end) = text[start..].find("[[").map(|end| start + end)
                && let Some(outputs) = text[start..end].find("outputs =").map(|at| start + at)
            {
                let inputs_end = end - 1;
                text.replace_range(outputs..inputs_end, "");
            }
            let lines = format!(
                "{name}\noutputs = [\"0x6040/16\", \"0x6060/8\", \"0x60B8/16\", \"0x607A/32\"]\ninputs = [\"0x6041/16\", \"0x6061/8\", \"0x60FD/32\", \"0x603F/16\", \"0x60B9/16\", {edges}, \"0x6064/32\", \"0x60F4/32\"]"
            );
            text = text.replacen(&name, &lines, 1);
        }
        let text = text.replace(
            "counts_per_unit = [10000, 1]",
            &format!("touch_probe = {number}\ncounts_per_unit = [10000, 1]"),
        );
        let touch = read(&text);
        assert!(touch.joints.iter().all(|joint| joint.touch_probe == Some(number as u8)));
        for (feed, towards) in [(600, true), (2400, true), (600, false)] {
            let cycle_mm = f64::from(feed) / 60.0 * 1e-3;
            let [by_touch, by_pin] = [&touch, &pin].map(|config| found_mm(config, feed, towards));
            println!("{feed} mm/min: {by_touch} by the drives, {by_pin} by the pin");
            assert!(
                (by_touch - FLOOR_MM).abs() <= INCREMENT_MM,
                "{by_touch} at {feed} mm/min"
            );
            assert!(
                (by_touch - by_pin).abs() <= cycle_mm + INCREMENT_MM,
                "{by_touch} {by_pin} at {feed} mm/min"
            );
            assert!(
                (by_pin - FLOOR_MM).abs() > INCREMENT_MM,
                "nothing to gain: {by_pin} at {feed} mm/min"
            );
        }
    }
}

/// What goes wrong with the first drive, and the words of the alarm that comes of it.
#[test]
fn every_fault_that_can_be_asked_for_stops_the_machine_in_words() {
    let text = SEED
        .replace("[\"0x6062/32\"", "[\"0x607A/32\"")
        .replace("mode = \"ip\"", "mode = \"csp\"\nlimit_switches = \"drive\"")
        .replace("\"0x6041/16\"]", "\"0x6041/16\", \"0x603F/16\"]")
        // With the zero mark, and quickly towards it.
        .replace("method = 21", "method = 5")
        .replace("latch_mm_s = 4.0", "latch_mm_s = 40.0");
    let kinds = [
        (
            "overcurrent",
            "after_s = 6.0",
            "axis X (joint 0): drive fault 2310h: continuous over-current",
        ),
        ("following-error", "after_s = 6.0", "axis X (joint 0): following error"),
        (
            "limit-switch",
            "after_s = 6.0",
            "axis X (joint 0): its lower limit switch has closed",
        ),
        ("power-off", "after_s = 6.0", "x-drive (node 1): lost"),
        (
            "sto",
            "after_s = 6.0",
            "axis X (joint 0): the safety circuit (STO) of the drive is open",
        ),
        (
            "index-missing",
            "",
            "axis X (joint 0): homing: the drive shows a homing error",
        ),
        (
            "slow-enable",
            "",
            "axis X (joint 0): the drive did not answer in time: command enable operation",
        ),
    ];
    for (kind, after, words) in kinds {
        let config = read(&format!(
            "{text}\n[[sim.fault]]\nnode = 1\nkind = \"{kind}\"\n{after}\n"
        ));
        let cause = rehearse(&config, SEED_PART.as_bytes(), NetConfig::clean(3), |run| {
            assert_eq!(
                run.run(CYCLES_MAX).expect("an end"),
                Outcome::Faulted,
                "{kind}: {}",
                journal(run)
            );
            Ok(run.operator.alarms()[0].cause.text.clone())
        });
        let cause = cause.expect("a machine that can be rehearsed");
        assert!(cause.to_lowercase().contains(&words.to_lowercase()), "{kind}: {cause}");
    }
    // The same machine without any of them.
    run_part(&read(&text), SEED_PART);
}
