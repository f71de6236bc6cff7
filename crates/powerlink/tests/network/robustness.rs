//! What must not bring a network down, one test for each: faults that another stack was measured not to survive.

use std::cell::Cell;
use std::rc::Rc;

use powerlink::link::simulated::SplitMix64;
use powerlink::mn::{BootTimes, ForeignSign, MnEvent, NodeState};
use powerlink::nmt::NmtState;
use powerlink::wire::{Asnd, FRAME_LEN_MAX, Frame, Header, IdentResponse, Pres, Requests, message, multicast};

use super::device::{PDO_BYTES, WRITES, mac};
use super::weather::{FOREIGN, FOREIGN_MAC, second_mn};
use super::world::{PRES_LOST_MAX, Setup, World};

/// A whole boot of the test network on good wires takes fewer cycles.
const BOOT_CYCLES: u64 = 1_000;

/// A network in OPERATIONAL.
fn operational(seed: u64, nodes: u8) -> World {
    let mut world = World::new(&Setup::new(seed, nodes));
    world.run_until_operational(BOOT_CYCLES);
    world.run(10);
    world.events.clear();
    world
}

/// Lets the next PRes of a node vanish; the counter says how many.
fn lose_pres(world: &mut World, id: u8) -> Rc<Cell<u32>> {
    let count = Rc::new(Cell::new(0));
    let left = count.clone();
    world.vanish = Box::new(move |sender, octets| {
        let hit = left.get() > 0 && sender == id && octets[14] == message::PRES;
        left.set(left.get() - u32::from(hit));
        hit
    });
    count
}

/// A frame as somebody sends it.
fn frame(source: u8, destination: u8, message_type: u8, tail: &[u8]) -> Vec<u8> {
    let mut octets = multicast::ASND.to_vec();
    octets.extend(mac(source));
    octets.extend([0x88, 0xAB, message_type, destination, source]);
    octets.extend(tail);
    octets
}

/// Garbage of every kind that brought the other stack down, and how the managing node counts it: unreadable for being short, of
/// another EtherType, of an unknown type, for its size field; from unknown nodes; unasked; from or to a node that it cannot be
/// from or for; with a VLAN tag.
fn garbage() -> Vec<(Vec<u8>, [u64; 9])> {
    const SHORT: [u64; 9] = [1, 0, 0, 0, 0, 0, 0, 0, 0];
    const ETHER_TYPE: [u64; 9] = [0, 1, 0, 0, 0, 0, 0, 0, 0];
    const TYPE: [u64; 9] = [0, 0, 1, 0, 0, 0, 0, 0, 0];
    const SIZE: [u64; 9] = [0, 0, 0, 1, 0, 0, 0, 0, 0];
    const UNKNOWN: [u64; 9] = [0, 0, 0, 0, 1, 0, 0, 0, 0];
    const UNASKED: [u64; 9] = [0, 0, 0, 0, 0, 1, 0, 0, 0];
    const SOURCE: [u64; 9] = [0, 0, 0, 0, 0, 0, 1, 0, 0];
    const DESTINATION: [u64; 9] = [0, 0, 0, 0, 0, 0, 0, 1, 0];
    const VLAN: [u64; 9] = [0, 0, 0, 0, 0, 0, 0, 0, 1];
    let mut buffer = [0; FRAME_LEN_MAX];
    let header = Header::multicast(multicast::ASND, FOREIGN_MAC, 1);
    let ident = Frame::Asnd(Asnd::IdentResponse(IdentResponse::default()));
    let length = ident.emit(&header, &mut buffer).unwrap();
    let ident = buffer[..length].to_vec();
    let pres = |id| {
        let mut buffer = [0; FRAME_LEN_MAX];
        let pres = Pres {
            nmt_state: NmtState::Operational,
            multiplexed: false,
            exception_new: true,
            ready: true,
            requests: Requests::default(),
            pdo_version: 0,
            payload: &[0xEE; PDO_BYTES],
        };
        let length = pres
            .emit(&Header::multicast(multicast::PRES, FOREIGN_MAC, id), 36, &mut buffer)
            .unwrap();
        buffer[..length].to_vec()
    };
    let mut ip = frame(1, 2, message::SOC, &[0; 43]);
    ip[12..14].copy_from_slice(&[0x08, 0x00]);
    let mut garbage = vec![
        (frame(1, 240, 0x00, &[0; 43]), TYPE),
        (frame(1, 240, 0x02, &[0; 43]), TYPE),
        (frame(1, 240, 0x7F, &[0xFF; 43]), TYPE),
        (ip, ETHER_TYPE),
        (frame(240, 255, message::SOC, &[]), SHORT),
        (frame(240, 255, message::SOC, &[0; 18]), SHORT),
        (frame(240, 255, message::SOA, &[]), SHORT),
        (frame(240, 255, message::SOA, &[0; 5]), SHORT),
        (
            frame(1, 255, message::PRES, &[0xFD, 1, 0, 0, 0, 0xFF, 0xFF, 0, 0]),
            SIZE,
        ),
        (frame(1, 255, message::PRES, &[0xFD]), SHORT),
        (frame(1, 240, message::ASND, &[]), SHORT),
        (frame(1, 255, message::ASND, &[0x01, 0, 0]), SHORT),
        (frame(1, 255, message::ASND, &[0x02, 0, 0]), SHORT),
        (ident, UNASKED),
    ];
    for id in [99, 239] {
        garbage.push((pres(id), UNKNOWN));
    }
    for id in [0, 241, 250, 253, 254, 255] {
        garbage.push((pres(id), SOURCE));
    }
    // What only a managing node sends, from somebody who is none; what it sends, to nobody who is meant.
    for (source, destination, message_type) in [
        (1, 255, message::SOC),
        (0, 255, message::SOA),
        (241, 255, message::SOA),
        (7, 1, message::PREQ),
        (239, 255, message::AMNI),
        (240, 255, message::AMNI),
        (251, 255, message::AMNI),
        (0, 240, message::ASND),
        (255, 240, message::ASND),
    ] {
        garbage.push((frame(source, destination, message_type, &[0; 43]), SOURCE));
    }
    for (source, destination, message_type) in [
        (240, 1, message::SOC),
        (240, 0, message::SOA),
        (240, 255, message::PREQ),
        (240, 240, message::PREQ),
        (1, 240, message::PRES),
        (245, 1, message::AMNI),
        (1, 0, message::ASND),
        (1, 250, message::ASND),
    ] {
        garbage.push((frame(source, destination, message_type, &[0; 43]), DESTINATION));
    }
    // A true cycle, but of another network on the same cable.
    for tag in [
        [0x81, 0x00, 0x00, 0x05],
        [0x81, 0x00, 0x00, 0x00],
        [0x88, 0xA8, 0xE0, 0x07],
    ] {
        let mut tagged = frame(240, 255, message::SOC, &[0; 43]);
        tagged.splice(12..12, tag);
        garbage.push((tagged, VLAN));
    }
    // The intruder speaks outside of the isochronous phase; in it a PRes of a node that is being polled is taken for its own.
    garbage.push((pres(1), UNASKED));
    for tail in [
        &[0x05; 43][..],
        &[0x05, 0xFF, 0xFF, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF],
        &[0x05],
    ] {
        garbage.push((frame(1, 240, message::ASND, tail), UNASKED));
    }
    garbage
}

/// Everything that somebody could see of a network: frames of the managing node are counted and stamped by the nodes.
fn visible(world: &World) -> Vec<String> {
    let counters = world.mn.counters();
    let mut visible = vec![format!(
        "{} {} {}",
        counters.cycles, counters.soa_sent, counters.asnd_sent
    )];
    for (index, device) in world.devices.iter().enumerate() {
        let statistics = world.mn.statistics(index);
        let state = device.node.as_ref().map(|node| node.nmt_state());
        visible.push(format!("{:?} {state:?} {statistics:?}", world.mn.node_state(index)));
    }
    visible
}

#[test]
fn garbage_before_and_after_the_start_is_counted_by_reason_and_does_nothing_else() {
    // Jitter is drawn for every frame, so that one more would change all after it.
    let mut setup = Setup::new(1, 3);
    setup.path.jitter_ns = 0;
    let mut quiet = World::new(&setup);
    let mut noisy = World::new(&setup);
    let mut expected = [0; 9];
    let mut next = garbage().into_iter().cycle();
    for cycle in 0..2_000_u64 {
        // In NOT_ACTIVE, through the whole boot, and in OPERATIONAL; late in the cycle, when nobody else sends. What a node might
        // say itself comes when it has nothing more to say; in NOT_ACTIVE it would be an answer to another managing node.
        let (octets, counts) = next.next().unwrap();
        let of_a_node = counts[4] + counts[5] > 0;
        if !of_a_node || noisy.is_operational() {
            noisy.intrusions.push_back((noisy.now_ns + 700_000, octets));
            for (sum, count) in expected.iter_mut().zip(counts) {
                *sum += count;
            }
        }
        quiet.cycle();
        noisy.cycle();
        assert_eq!(visible(&noisy), visible(&quiet), "after cycle {cycle}");
    }
    assert!(quiet.is_operational());
    assert_eq!(noisy.troubles(), Vec::<&MnEvent>::new());
    let counters = noisy.mn.counters();
    let counted = [
        counters.malformed.too_short,
        counters.malformed.ether_type,
        counters.malformed.message_type,
        counters.malformed.payload_size,
        counters.unknown_node,
        counters.unexpected,
        counters.malformed.source,
        counters.malformed.destination,
        counters.malformed.vlan,
    ];
    assert_eq!(counted, expected);
    assert_eq!(counters.foreign_mn_frames, 0);
}

#[test]
fn one_lost_pres_now_and_then_is_counted_for_its_node_and_nothing_else_happens() {
    let mut world = operational(2, 3);
    let lose = lose_pres(&mut world, 2);
    for _ in 0..50 {
        lose.set(1);
        world.run(20);
    }
    let lost: Vec<_> = (0..3).map(|index| world.mn.statistics(index).pres_lost).collect();
    assert_eq!(lost, [0, 50, 0]);
    assert_eq!((world.is_operational(), world.troubles().len()), (true, 0));
}

#[test]
fn as_many_pres_in_a_row_as_configured_are_ridden_out_with_the_last_value() {
    let mut world = operational(3, 3);
    let before = world.mn.input(1).data.to_vec();
    assert!(before.iter().any(|octet| *octet != 0));
    let lose = lose_pres(&mut world, 2);
    lose.set(PRES_LOST_MAX);
    for row in 1..=PRES_LOST_MAX {
        let last = world.mn.input(1).data.to_vec();
        world.cycle();
        let input = world.mn.input(1);
        assert_eq!((input.fresh, input.lost_in_row, input.data), (false, row, &last[..]));
    }
    world.cycle();
    let input = world.mn.input(1);
    assert!(input.fresh && input.lost_in_row == 0 && input.data != before);
    assert_eq!((world.is_operational(), world.troubles().len()), (true, 0));
}

#[test]
fn beyond_that_the_node_is_lost_alone_and_back_by_itself_in_less_than_half_a_second() {
    let mut world = operational(4, 3);
    let lose = lose_pres(&mut world, 2);
    lose.set(PRES_LOST_MAX + 1);
    let begun = world.cycle;
    world.run(u64::from(PRES_LOST_MAX) + 1);
    assert_eq!(world.mn.node_state(1), NodeState::Faulted);
    let lost = MnEvent::Lost {
        node: 2,
        in_row: PRES_LOST_MAX + 1,
    };
    assert!(
        world.events.iter().any(|(_, event)| *event == lost),
        "{:?}",
        world.events
    );
    world.run_until_operational(BOOT_CYCLES);
    let cycles = world.cycle - begun;
    println!("lost and OPERATIONAL again after {cycles} ms");
    assert!(cycles < 500, "{cycles} ms");
    let network = world
        .events
        .iter()
        .any(|(_, event)| matches!(event, MnEvent::NmtStateChanged { .. }));
    assert!(!network, "the network stays up");
    for index in [0, 2] {
        let statistics = world.mn.statistics(index);
        assert_eq!((statistics.boots, statistics.faults, statistics.pres_lost), (1, 0, 0));
    }
    assert_eq!(world.mn.statistics(1).boots, 2);
}

/// Cycles until a network that loses this share of all ASnd is OPERATIONAL.
fn boot_with_lost_asnd(seed: u64, share: f64) -> u64 {
    let mut world = World::new(&Setup::new(seed, 3));
    let mut random = SplitMix64::new(seed);
    world.vanish = Box::new(move |_, octets| octets[14] == message::ASND && random.happens(share));
    world.run_until_operational(100 * BOOT_CYCLES)
}

#[test]
fn with_one_percent_of_asnd_lost_a_boot_takes_less_than_twice_the_clean_one() {
    let clean = boot_with_lost_asnd(0, 0.0);
    let mut boots: Vec<_> = (0..500).map(|seed| boot_with_lost_asnd(seed, 0.01)).collect();
    boots.sort_unstable();
    println!(
        "clean {clean} ms; with 1 % loss: median {} ms, 90 % {} ms, 99 % {} ms, longest {} ms",
        boots[249], boots[449], boots[494], boots[499]
    );
    assert!(boots[499] > clean, "no frame was lost");
    assert!(boots[499] < 2 * clean, "{} ms, clean {clean} ms", boots[499]);
}

#[test]
fn a_second_mn_is_named_within_a_cycle_and_the_network_is_back_by_itself_when_it_has_gone() {
    let mut world = operational(7, 3);
    let mut random = SplitMix64::new(7);
    for cycle in 0..300 {
        second_mn(&mut world, &mut random);
        world.cycle();
        let named = world
            .events
            .iter()
            .filter(|(_, event)| *event == MnEvent::ForeignMn(FOREIGN))
            .count();
        assert_eq!(named, 1, "in cycle {cycle}");
    }
    world.intrusions.clear();
    let cycles = world.run_until_operational(BOOT_CYCLES);
    println!("OPERATIONAL {cycles} ms after the intruder's last frame");
    assert!(cycles < 500);
    world.run(100);
    assert!(world.is_operational());
}

#[test]
fn a_network_that_another_mn_runs_is_left_alone_until_it_has_gone() {
    let mut world = World::new(&Setup::new(8, 2));
    let mut random = SplitMix64::new(8);
    for _ in 0..500 {
        second_mn(&mut world, &mut random);
        world.cycle();
        assert_eq!(world.mn.nmt_state(), NmtState::NotActive);
    }
    let counters = world.mn.counters();
    assert_eq!((counters.soa_sent, counters.asnd_sent, counters.cycles), (0, 0, 0));
    assert!(
        world
            .events
            .iter()
            .any(|(_, event)| *event == MnEvent::ForeignMn(FOREIGN))
    );
    world.run_until_operational(BOOT_CYCLES);
}

/// What another control of the same PC sends on the same interface is not heard there; its nodes are.
#[test]
fn a_node_that_answers_somebody_else_counts_as_another_managing_node() {
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut frame = |id, frame: Frame<'_>| {
        let header = Header::multicast(multicast::ASND, mac(id), id);
        let length = frame.emit(&header, &mut buffer).unwrap();
        buffer[..length].to_vec()
    };
    let pres = Frame::Pres(Pres {
        nmt_state: NmtState::Operational,
        multiplexed: false,
        exception_new: false,
        ready: true,
        requests: Requests::default(),
        pdo_version: 0,
        payload: &[0; PDO_BYTES],
    });
    let ident = Frame::Asnd(Asnd::IdentResponse(IdentResponse::default()));
    // Nodes of ours, and of a network of other nodes.
    for (id, octets) in [
        (1, frame(1, pres)),
        (2, frame(2, ident)),
        (99, frame(99, pres)),
        (253, frame(253, ident)),
    ] {
        let mut world = World::new(&Setup::new(8, 2));
        for _ in 0..500 {
            world.intrusions.push_back((world.now_ns + 700_000, octets.clone()));
            world.cycle();
            assert_eq!(world.mn.nmt_state(), NmtState::NotActive);
        }
        let counters = world.mn.counters();
        assert_eq!((counters.soa_sent, counters.asnd_sent, counters.cycles), (0, 0, 0));
        let sign = ForeignSign { id, mac: mac(id) };
        let told: Vec<_> = world.events.iter().map(|(_, event)| *event).collect();
        assert_eq!(told, [MnEvent::ForeignMn(sign)], "told once");
        world.run_until_operational(BOOT_CYCLES);
    }
}

#[test]
fn late_cycles_are_counted_and_never_restart_anything() {
    let mut world = operational(10, 3);
    let mut random = SplitMix64::new(10);
    // A busy machine for 20 s: one cycle in 40 comes late, by up to three cycles.
    for _ in 0..20_000 {
        if random.below(40) == 0 {
            world.nap = Some((random.below(12) as u32, random.below(3_000_000)));
        }
        world.cycle();
    }
    assert!(world.mn.counters().cycles_skipped > 100, "{:?}", world.mn.counters());
    assert!(world.is_operational());
    assert_eq!(world.troubles(), Vec::<&MnEvent>::new());
    for index in 0..3 {
        assert_eq!(
            (world.mn.statistics(index).boots, world.mn.statistics(index).faults),
            (1, 0)
        );
    }
}

#[test]
fn three_nodes_with_17_writes_each_are_operational_in_one_and_a_half_seconds_at_10_ms() {
    let mut setup = Setup::new(11, 3);
    setup.cycle_ns = 10_000_000;
    // Times as they are by default; listening for another managing node comes before the first frame, and is not counted.
    setup.boot = BootTimes {
        wait_not_active_us: 0,
        ..BootTimes::default()
    };
    let mut world = World::new(&setup);
    let cycles = world.run_until_operational(BOOT_CYCLES);
    println!("OPERATIONAL after {} ms", cycles * 10);
    assert!(cycles * 10 <= 1_500, "{} ms", cycles * 10);
    for index in 0..3 {
        assert_eq!(world.mn.statistics(index).objects_written, WRITES);
    }
    // Without the half second in PRE_OPERATIONAL_1, in which nodes are configured fast, most writes need slots of the cycle.
    setup.boot.wait_pre_op_1_us = 0;
    let mut world = World::new(&setup);
    let cycles = world.run_until_operational(BOOT_CYCLES);
    println!(
        "OPERATIONAL after {} ms if PRE_OPERATIONAL_1 is left at once",
        cycles * 10
    );
    assert!(cycles * 10 <= 1_500, "{} ms", cycles * 10);
}

#[test]
fn a_node_that_is_switched_off_and_on_comes_back_and_an_optional_one_holds_nobody_up() {
    let mut setup = Setup::new(12, 2);
    setup.optional = vec![110];
    let mut world = World::new(&setup);
    world.power(2, false);
    for _ in 0..BOOT_CYCLES {
        world.cycle();
    }
    assert_eq!(world.mn.nmt_state(), NmtState::Operational);
    let states = [0, 1, 2].map(|index| world.mn.node_state(index));
    assert_eq!(
        states,
        [NodeState::Operational, NodeState::Operational, NodeState::Absent]
    );
    world.power(2, true);
    let cycles = world.run_until_operational(BOOT_CYCLES);
    println!("plugged in and OPERATIONAL after {cycles} ms");
    assert!(cycles < 500, "{cycles} ms");
}

#[test]
fn doubled_and_reordered_frames_disturb_nobody() {
    let mut world = operational(6, 3);
    world.set_paths(|path| {
        path.duplicate = 0.2;
        path.jitter_ns = 5_000;
    });
    // The observer stops the test if anybody uses old or torn data.
    world.run(5_000);
    assert_eq!((world.is_operational(), world.troubles().len()), (true, 0));
    world.set_paths(|path| {
        path.reorder = 0.02;
        path.reorder_ns = 10_000;
    });
    world.run(5_000);
    assert_eq!((world.is_operational(), world.troubles().len()), (true, 0));
}

#[test]
fn mandatory_nodes_are_configured_in_pre_operational_1_at_any_rate() {
    for cycle_ns in [500_000, 1_000_000, 10_000_000, 50_000_000] {
        let mut setup = Setup::new(9, 5);
        setup.cycle_ns = cycle_ns;
        // Long enough for everything: no SoC before all nodes are configured.
        setup.boot = BootTimes {
            wait_not_active_us: 0,
            wait_pre_op_1_us: 3_000_000,
            ..BootTimes::default()
        };
        let mut world = World::new(&setup);
        while world.mn.nmt_state() != NmtState::PreOperational2 {
            world.cycle();
            assert!(world.now_ns < 4_000_000_000);
        }
        for index in 0..5 {
            assert_eq!(
                world.mn.statistics(index).objects_written,
                WRITES,
                "node {index}, cycle {cycle_ns} ns"
            );
        }
        world.run_until_operational(BOOT_CYCLES);
        assert_eq!(world.troubles(), Vec::<&MnEvent>::new());
    }
}
#[test]
fn an_unasked_ident_response_does_nothing() {
    let mut world = World::new(&Setup::new(1, 3));
    let mut buffer = [0; FRAME_LEN_MAX];
    let ident = Frame::Asnd(Asnd::IdentResponse(IdentResponse::default()));
    let length = ident
        .emit(&Header::multicast(multicast::ASND, FOREIGN_MAC, 1), &mut buffer)
        .unwrap();
    // The nodes are being woken and reset.
    world.run(22);
    assert_eq!(world.mn.nmt_state(), NmtState::PreOperational1);
    world
        .intrusions
        .push_back((world.now_ns + 700_000, buffer[..length].to_vec()));
    world.run(2);
    assert_eq!(world.mn.node_state(0), NodeState::Absent);
    assert_eq!(world.mn.counters().unexpected, 1);
}

#[test]
fn no_poll_begins_that_cannot_end_before_the_next_cycle() {
    let mut world = operational(1, 3);
    for wake_ns in (800_000..1_000_000).step_by(5_000) {
        world.nap = Some((4, wake_ns));
        // Long enough for the nodes' threshold counters to forget the polls that were left out.
        world.run(20);
        for index in 0..3 {
            assert_eq!(
                world.mn.statistics(index).pres_lost,
                0,
                "woken {wake_ns} ns after the SoC"
            );
        }
    }
}
