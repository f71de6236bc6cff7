//! Another program on the wire, and devices that mean no good: nobody is kept waiting, nothing is taken from what is no answer.

use super::world::{Fate, Random, TERMINAL, World, drive, drive_config, terminal_config};
use ethercat::main::Event;
use ethercat::main::config::Times;
use ethercat::sub::{Segment, SubDevice, SubDeviceConfig, models};
use ethercat::wire::coe::{Emergency, Object};
use ethercat::wire::sii::category;
use ethercat::wire::{Addressing, BROADCAST, Command, FRAME_LEN_MAX, Frame, FrameWriter, Mac};
use proptest::prelude::*;
use std::cell::Cell;
use std::rc::Rc;

/// The vendor that a device says it is of.
const IDENTITY: Object = Object {
    index: 0x1018,
    sub: 1,
    complete: false,
};

/// Two drives and a terminal; the second drive is this one.
fn beside(second: SubDeviceConfig) -> World {
    let devices = vec![drive(0, 0), second, models::digital_terminal(TERMINAL)];
    World::new(devices, vec![drive_config(0), drive_config(1), terminal_config(2)], 3)
}

fn others_are_up(world: &World) -> bool {
    [0, 2]
        .iter()
        .all(|device| world.events.contains(&Event::Up { device: *device }))
}

#[test]
fn a_mailbox_of_any_length_keeps_nobody_else_waiting() {
    for octets in 0..24_u16 {
        for at in [0x32, 0x36] {
            let mut odd = drive(0, 5);
            odd.eeprom[at..at + 2].copy_from_slice(&octets.to_le_bytes());
            let mut world = beside(odd);
            world.run(1000);
            assert!(others_are_up(&world), "{octets} octets at {at:#x}: {:?}", world.events);
        }
    }
}

#[test]
fn an_eeprom_that_says_it_is_long_is_not_read_for_long() {
    let mut long = drive(0, 5);
    let end = long
        .eeprom
        .chunks_exact(2)
        .skip(0x40)
        .position(|word| word == [0xFF, 0xFF]);
    long.eeprom.truncate(0x80 + 2 * end.expect("an end mark"));
    for kind in [category::GENERAL, category::FMMU, category::SYNC_MANAGERS, 0x0800] {
        long.eeprom.extend(kind.to_le_bytes());
        long.eeprom.extend(0xFFF0_u16.to_le_bytes());
        long.eeprom.resize(long.eeprom.len() + 2 * 0xFFF0, 0);
    }
    long.eeprom.extend([0xFF; 4]);
    let mut world = beside(long);
    world.run(1000);
    assert!(others_are_up(&world), "{:?}", world.events);
}

#[test]
fn a_device_that_never_leaves_a_state_is_told_and_keeps_nobody_else_waiting() {
    let mut world = beside(drive(0, 5));
    world.segment.device_mut(1).faults.hung = true;
    world.run(6000);
    assert!(others_are_up(&world), "{:?}", world.events);
    let told: Vec<String> = world
        .events
        .iter()
        .map(Event::to_string)
        .filter(|told| told.starts_with("device 1: "))
        .collect();
    assert_eq!(told, ["device 1: has not come to PRE-OP in time and is in INIT"]);
    world.segment.device_mut(1).faults.hung = false;
    world.run_to_op(10_000);
}

/// Whatever is asked first when the cable breaks: it is told, and all come up when it is whole again.
#[test]
fn a_cable_that_breaks_at_any_frame_of_the_start_is_told() {
    let times = Times {
        step_ns: 100_000_000,
        eeprom_ns: 20_000_000,
        ..Times::default()
    };
    let start = |whole: u32| {
        let mut segment = Segment::new();
        segment.push(SubDevice::new(drive(0, 0), 0), 300);
        let mut world = World::with(segment, vec![drive_config(0)], 3, times, 1_000_000);
        let (sent, is_broken) = (Rc::new(Cell::new(0)), Rc::new(Cell::new(true)));
        let (count, broken) = (sent.clone(), is_broken.clone());
        world.fate = Box::new(move |_, _| {
            count.set(count.get() + 1);
            if broken.get() && count.get() > whole {
                Fate::LostOut
            } else {
                Fate::Passes
            }
        });
        (world, sent, is_broken)
    };
    // The frames of the cycle in which they are counted, each: one of them clears all, and is sent once.
    let (mut world, sent, _) = start(u32::MAX);
    let mut before = 0;
    while !world.events.iter().any(|event| matches!(event, Event::Found { .. })) {
        before = sent.get();
        world.cycle();
    }
    for whole in (before..sent.get()).chain((0..400).step_by(20)) {
        let (mut world, _, is_broken) = start(whole);
        world.run(2500);
        let is_told = world.events.iter().any(|event| {
            matches!(
                event,
                Event::Silent { .. } | Event::Failed { .. } | Event::Lost { .. } | Event::Broken(_)
            )
        });
        assert!(is_told, "after {whole} frames: {:?}", world.events);
        is_broken.set(false);
        world.run_to_op(10_000);
    }
}

/// A loose contact in front of the last device, while all are counted.
#[test]
fn a_number_of_devices_that_does_not_stay_is_told() {
    let mut world = beside(drive(0, 5));
    for number in 0..700 {
        match number % 2 {
            0 => world.segment.cut(2),
            _ => world.segment.heal(2),
        }
        world.run(5);
    }
    let unsteady: Vec<&Event> = world.events.iter().collect();
    assert!(
        matches!(unsteady[..], [Event::Unsteady { .. }]),
        "once in three seconds: {unsteady:?}"
    );
    world.segment.heal(2);
    world.run_to_op(3000);
}

/// A frame of another main device.
fn foreign(source: Mac) -> Vec<u8> {
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut writer = FrameWriter::new(&mut buffer, BROADCAST, source).expect("room");
    writer.push(Command::Brd, 1, 0, 2).expect("room");
    let length = writer.finish();
    buffer[..length].to_vec()
}

#[test]
fn a_flood_of_foreign_frames_and_of_emergencies_hides_nothing() {
    let mut world = World::drives(2, 3);
    world.run_to_op(3000);
    world.enable = true;
    world.run(1500);
    world.take_events();
    let emergency = Emergency {
        code: 0x8130,
        register: 0x11,
        data: [0; 5],
    };
    let mut order = None;
    for cycle in 0..300_u64 {
        for number in 0..200_u8 {
            world.intrude(&foreign([0x0A, number, cycle as u8, 3, 4, 5]));
        }
        world.segment.device_mut(0).report(emergency);
        if cycle == 50 {
            order = world.main.sdo_read(0, IDENTITY);
        }
        if cycle == 99 {
            let vendor = order.and_then(|order| world.main.sdo_result(order));
            assert!(matches!(vendor, Some(Ok([_, _, _, _]))), "{vendor:?}");
        }
        if cycle == 100 {
            world.segment.power_off(1);
        }
        world.cycle();
        assert!(world.events.len() < 1000, "as many events as frames");
    }
    let lost = |event: &&Event| matches!(event, Event::Lost { device: 1, .. });
    assert_eq!(world.events.iter().filter(lost).count(), 1, "{:?}", world.events);
    assert!(world.is_on(0), "the other one goes on");
}

/// An answer that is none: of another frame, of other datagrams, cut off. Its data and counters are others, too.
fn no_answer(random: &mut Random, octets: &[u8]) -> Vec<u8> {
    let mut forged = octets.to_vec();
    let frame = Frame::parse(octets).expect("what devices send is a frame");
    let datagrams: Vec<_> = frame.datagrams().collect();
    for datagram in &datagrams {
        let end = datagram.data_at() + datagram.data.len() + 2;
        for octet in &mut forged[datagram.data_at()..end] {
            *octet ^= random.below(256) as u8;
        }
    }
    let chosen = &datagrams[random.below(datagrams.len() as u64) as usize];
    let header = chosen.data_at() - 10;
    let used = datagrams.last().map_or(16, |last| last.data_at() + last.data.len() + 2);
    match random.below(7) {
        0 => forged[header + 1] ^= 1 << random.below(7),
        1 => forged[header] ^= 1 << random.below(3),
        // The address: of positions devices change the first half, which tells nothing.
        2 => forged[header + 4 + random.below(2) as usize] ^= 1 << random.below(8),
        3 => forged[header + 6] ^= 1 << random.below(8),
        4 => forged[14] ^= 1 << random.below(8),
        // Of another device.
        5 if chosen.command.addressing() == Addressing::Station => {
            forged[header + 2 + random.below(2) as usize] ^= 1 << random.below(8);
        }
        _ => forged.truncate(random.below(used as u64) as usize),
    }
    forged
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    /// Before each answer come others that are none: all goes on to the octet as without them.
    #[test]
    fn what_is_no_answer_changes_nothing(seed in any::<u64>()) {
        let run = |is_forged: bool| {
            let mut world = World::drives(2, seed);
            if is_forged {
                world.forge = Box::new(|random, octets| {
                    (0..random.below(3)).map(|_| no_answer(random, octets)).collect()
                });
            }
            let mut seen = Vec::new();
            for cycle in 0..1500 {
                world.enable = cycle > 800;
                world.cycle();
                let answered = [0, 1, 2].map(|device| world.main.answered(device));
                seen.push((answered, [world.actual(0), world.actual(1)], world.lost_last, world.dates.last().copied()));
            }
            let own = |event: &Event| !matches!(event, Event::OtherMain { .. });
            let events: Vec<Event> = world.take_events().into_iter().filter(own).collect();
            (seen, events, world.is_on(0) && world.is_on(1), world.main.counters())
        };
        let (plain, forged) = (run(false), run(true));
        prop_assert!(plain.2, "they are on: {:?}", plain.1);
        prop_assert!(plain.0 == forged.0, "cycles differ");
        prop_assert_eq!(plain.1, forged.1);
        prop_assert!(forged.3.late > 0 && forged.3.services_lost == plain.3.services_lost);
    }
}
