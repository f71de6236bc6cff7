//! The whole path on EtherCAT: the faults of its network have the reactions and words of POWERLINK's, the other drives their stop.

use super::*;
use ::ethercat::wire::register::{self, AlState};
use ::ethercat::wire::{BROADCAST, Command as Datagram, FRAME_LEN_MAX, Frame, FrameWriter, MAC_PASSED};
use isocnc::bus::NodeState;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::rehearse_with;
use isocnc::sim::{SimMachine, VirtualNet};

const ETHERCAT: &str = include_str!("../../configs/mill3-ethercat.toml");
/// Frames of services have datagrams with indices from here on.
const SERVICES_FROM: u8 = 0x80;
/// A main device that is not ours.
const OTHER: [u8; 6] = [0x20, 1, 2, 3, 4, 5];

/// That of a machine on a PC of its own, as on POWERLINK.
fn ethercat() -> Config {
    parse(ETHERCAT)
}

fn parse(text: &str) -> Config {
    let mut config = config::parse(text, Path::new("mill3-ethercat.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    config.bus.pres_lost_max = 3;
    config
}

/// Rehearses the part.
fn on_ethercat<T>(seed: u64, act: impl FnOnce(&mut Rehearsal<'_>) -> T) -> T {
    rehearse_on(&ethercat(), NetConfig::clean(seed), PART, act)
}

fn frame_of(source: [u8; 6], command: Datagram, address: u32, data: &[u8]) -> Vec<u8> {
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut writer = FrameWriter::new(&mut buffer, BROADCAST, source).expect("room");
    writer.push_data(command, 1, address, data).expect("room");
    let length = writer.finish();
    buffer[..length].to_vec()
}

/// A register of a drive is written behind the back of the control.
fn write(run: &mut Rehearsal<'_>, position: u16, register: u16, data: &[u8]) {
    let frame = frame_of(OTHER, Datagram::Apwr, register::position(position, register), data);
    let now_ns = run.now_ns();
    run.net().machine_mut().receive(now_ns, &frame, &mut |_| {});
}

fn told(run: &Rehearsal<'_>, text: &str) {
    assert!(journal(run).contains(text), "not told: {text}\n{}", journal(run));
}

#[test]
fn lost_frames_up_to_the_limit_are_counted_ridden_out_and_never_sent_again() {
    for count in [1, 3] {
        on_ethercat(2, |run| {
            // Of each frame of a cycle that has left: its octets but for the outputs, when.
            let sent = Arc::new(Mutex::new(Vec::new()));
            let sink = Arc::clone(&sent);
            run.net().set_tap(Box::new(move |at_ns, octets| {
                let frame = Frame::parse(octets).expect("a frame");
                let first = frame.datagrams().next().expect("a datagram");
                if octets[6] & MAC_PASSED == 0 && first.index < SERVICES_FROM {
                    sink.lock().expect("one thread").push((at_ns, first.index));
                }
            }));
            reach_midst(run);
            assert_eq!(lost(run), [0; 3]);
            run.net().at(0, Disturbance::DropPres { node: 2, count });
            assert_eq!(finish(run), Outcome::Completed);
            // One frame has the data of all.
            assert_eq!(lost(run), [u64::from(count); 3]);
            assert_eq!(run.operator.alarms(), []);
            assert_part_cut(run);
            assert_within_limits(&commands(run), false);
            let sent = sent.lock().expect("one thread");
            assert!(sent.len() > 1000);
            for pair in sent.windows(2) {
                let [(before_ns, before), (at_ns, index)] = [pair[0], pair[1]];
                assert_eq!(index, (before + 1) % SERVICES_FROM, "at {at_ns} ns");
                assert!(at_ns - before_ns > 900_000, "two in a cycle, at {at_ns} ns");
            }
        });
    }
}

#[test]
fn more_lost_frames_than_the_limit_stop_all_joints_on_the_path() {
    on_ethercat(3, |run| {
        let causes = fails_in_order(run, Disturbance::DropPres { node: 2, count: 5 }, &[]);
        assert_eq!(causes[0], "x-drive (node 1): lost, it does not answer any more");
        told(
            run,
            "x-drive (node 1) is lost: working counter 0, expected 3: it does not answer",
        );
    });
}

#[test]
fn a_drive_that_leaves_op_is_named_with_its_state_and_the_others_stop_on_the_path() {
    for (state, name) in [
        (AlState::SafeOp, "SAFE-OP"),
        (AlState::PreOp, "PRE-OP"),
        (AlState::Init, "INIT"),
    ] {
        on_ethercat(4, |run| {
            let causes = stops_in_order(run, &[0, 2], |run| {
                write(run, 1, register::AL_CONTROL, &[state.into(), 0]);
            });
            assert_eq!(causes, ["y-drive (node 2): lost, it does not answer any more"]);
            told(run, &format!("y-drive (node 2) has left OP and is in {name}"));
        });
    }
}

#[test]
fn a_wrong_working_counter_is_told_of_the_drive_that_it_is_of() {
    for (fmmu, counter) in [(0, 1), (1, 2)] {
        on_ethercat(5, |run| {
            // One of its two FMMUs forgets where in the frame its data are.
            let causes = stops_in_order(run, &[0, 2], |run| {
                write(run, 1, register::FMMU + 16 * fmmu, &[0; 16]);
            });
            assert_eq!(causes, ["y-drive (node 2): lost, it does not answer any more"]);
            told(
                run,
                &format!("y-drive (node 2) is lost: working counter {counter}, expected 3"),
            );
        });
    }
}

#[test]
fn a_cable_that_breaks_is_told_between_two_devices_and_those_before_it_stop_on_the_path() {
    for (node, alive, lost, place) in [
        (
            1,
            &[][..],
            "x-drive (node 1)",
            "nothing answers behind this PC: the cable to x-drive (node 1), or its power",
        ),
        (
            2,
            &[0][..],
            "y-drive (node 2)",
            "no link between x-drive (node 1), port 1, and y-drive (node 2): the cable, or power of the latter",
        ),
        (
            3,
            &[0, 1],
            "z-drive (node 3)",
            "no link between y-drive (node 2), port 1, and z-drive (node 3): the cable, or power of the latter",
        ),
        (
            4,
            &[0, 1, 2],
            "io (node 4)",
            "no link between z-drive (node 3), port 1, and io (node 4): the cable, or power of the latter",
        ),
    ] {
        for disturbance in [Disturbance::Unplug { node }, Disturbance::PowerOff { node }] {
            on_ethercat(6, |run| {
                let causes = fails_in_order(run, disturbance, alive);
                assert_eq!(
                    causes[0],
                    format!("{lost}: lost, it does not answer any more"),
                    "{disturbance:?}"
                );
                told(run, place);
            });
        }
    }
}

#[test]
fn a_drive_that_was_without_power_comes_back_by_itself_and_moves_by_orders_only() {
    for (node, name) in [
        (1, "x-drive (node 1)"),
        (2, "y-drive (node 2)"),
        (3, "z-drive (node 3)"),
    ] {
        let (config, net) = (ethercat(), NetConfig::clean(7));
        let act = |run: &mut Rehearsal<'_>| {
            reach_state(run, State::Disabled);
            order(run, Command::Enable, State::Ready);
            run.net().at(0, Disturbance::PowerOff { node });
            reach_state(run, State::Faulted);
            run.net().at(0, Disturbance::PowerOn { node });
            reach(run, "back in OP", |run| {
                let bus = run.control.bus_mut();
                (0..4).all(|node| bus.node_state(node) == NodeState::Operational)
            });
            run.run_until(200, |_| false).expect("a good program");
            let up = format!("{name} operational");
            assert_eq!(journal(run).matches(&up).count(), 2, "{}", journal(run));
            assert_eq!(run.control.state(), State::Faulted, "nobody has acknowledged it");
            let before = loads(run);
            order(run, Command::Acknowledge, State::Disabled);
            order(run, Command::Enable, State::Ready);
            for (at_mm, before_mm) in loads(run).into_iter().zip(before) {
                assert!((at_mm - before_mm).abs() < 0.01, "moved from {before_mm} to {at_mm}");
            }
            Ok(())
        };
        println!("{name}, seed {}", net.seed);
        rehearse_with(&config, PART.as_bytes(), net, Operator::standing_by, act).expect("a machine to rehearse on");
    }
}

#[test]
fn drives_that_have_changed_their_places_are_named_and_nothing_starts() {
    // Y and Z are two products, of which the machine has one where the other should be.
    let product = |text: &str, name: &str, code: &str| {
        let at = text.find(name).expect("a drive");
        let (before, after) = text.split_at(at);
        before.to_owned() + &after.replacen("0x04020002", code, 1)
    };
    let [wanted, built] = [["0x04020003", "0x04020004"], ["0x04020004", "0x04020003"]]
        .map(|[y, z]| parse(&product(&product(ETHERCAT, "y-drive", y), "z-drive", z)));
    rehearse_on(&wanted, NetConfig::clean(8), PART, |run| {
        let machine = SimMachine::new(&built).expect("a machine");
        *run.net() = VirtualNet::new(machine, NetConfig::clean(8));
        assert_eq!(finish(run), Outcome::TimedOut(Step::Network));
        told(run, "y-drive (node 2) is another device: expected ");
        told(run, "as z-drive (node 3) should be: swapped?");
        told(run, "as y-drive (node 2) should be: swapped?");
        assert_eq!(commands(run), [[0.0; 3]; 0]);
    });
}

/// A frame of another main device arrives.
fn hear_other(run: &mut Rehearsal<'_>) {
    let frame = frame_of(OTHER, Datagram::Brd, 0, &[0; 2]);
    run.net().inject(&frame);
}

#[test]
fn another_main_device_is_told_of_and_nothing_starts_beside_it() {
    for at_ms in [5, 100, 165] {
        on_ethercat(9, |run| {
            reach(run, "so late", |run| run.now_ns() >= at_ms * 1_000_000);
            assert_eq!(run.control.state(), State::Booting);
            hear_other(run);
            assert_eq!(finish(run), Outcome::Faulted);
            let cause = &run.operator.alarms()[0].cause.text;
            assert!(
                cause.starts_with("another main device is on the wire: 20:01:02:03:04:05"),
                "{cause}"
            );
            assert_eq!(commands(run), [[0.0; 3]; 0]);
        });
    }
}

#[test]
fn another_main_device_in_mid_program_stops_the_machine_on_the_path() {
    on_ethercat(10, |run| {
        let causes = stops_in_order(run, &[0, 1, 2], hear_other);
        assert!(
            causes[0].starts_with("another main device is on the wire: 20:01:02:03:04:05"),
            "{causes:?}"
        );
    });
}

#[test]
fn a_noisy_wire_is_ridden_out() {
    // Of a limit of 20 in a row nothing is known that would reach it.
    let config = config::parse(ETHERCAT, Path::new("mill3-ethercat.toml")).expect("a good machine");
    for seed in 101..104 {
        let net = NetConfig {
            loss: 0.01,
            ..NetConfig::clean(seed)
        };
        rehearse_on(&config, net, PART, |run| {
            assert_eq!(finish(run), Outcome::Completed);
            assert_part_cut(run);
            assert_within_limits(&commands(run), false);
            assert!(lost(run).iter().all(|lost| *lost > 20), "{:?}", lost(run));
        });
    }
}

#[test]
fn a_wire_that_loses_doubles_and_reorders_never_hangs_the_machine() {
    for (seed, loss) in [(201, 0.002), (202, 0.02), (203, 0.1), (204, 0.3)] {
        let net = NetConfig {
            loss,
            duplicate: 0.01,
            reorder: 0.005,
            corrupt: 0.002,
            ..NetConfig::clean(seed)
        };
        rehearse_on(&ethercat(), net, PART, |run| match finish(run) {
            Outcome::Completed => {
                let last = *commands(run).last().expect("a program ran");
                assert_eq!(last[Axis::X as usize], PART_END[0]);
            }
            Outcome::Faulted => assert!(!run.operator.alarms().is_empty()),
            Outcome::TimedOut(_) => {}
            Outcome::Stopped => panic!("nobody stopped it"),
        });
    }
}
