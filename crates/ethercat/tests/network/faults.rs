//! What goes wrong while drives run: who is told, who stays on, who comes back.

use super::world::{Fate, MAC, TERMINAL, World, drive, drive_config, terminal_config};
use ethercat::main::{Break, Event, SetupError};
use ethercat::sub::models;
use ethercat::wire::register::{self, AlState, AlStatusCode};
use ethercat::wire::{BROADCAST, Command, FRAME_LEN_MAX, FrameWriter};
use std::collections::BTreeSet;

/// Drives that are on.
fn moving(count: u16, seed: u64) -> World {
    let mut world = World::drives(count, seed);
    world.run_to_op(3000);
    world.enable = true;
    world.run(800);
    assert!((0..usize::from(count)).all(|drive| world.is_on(drive)));
    world.events.clear();
    world
}

/// A datagram that somebody writes to a device behind the back of the main device.
fn write(world: &mut World, command: Command, address: u32, data: &[u8]) {
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x44; 6]).unwrap();
    writer.push_data(command, 0, address, data).unwrap();
    let length = writer.finish();
    world.segment.receive(world.now_ns, &mut buffer[..length]).unwrap();
}

#[test]
fn a_lost_frame_is_ridden_out_and_never_sent_again() {
    let mut world = moving(3, 3);
    world.sent.clear();
    let mut cycle = 0;
    world.fate = Box::new(move |_, cyclic| {
        cycle += u32::from(cyclic);
        // Two in a row are lost, at times.
        if cyclic && cycle % 50 < 2 {
            Fate::Lost
        } else {
            Fate::Passes
        }
    });
    world.run(500);
    assert_eq!(world.events, []);
    assert!((0..3).all(|drive| world.is_on(drive)));
    let once: BTreeSet<_> = world.sent.iter().collect();
    assert_eq!((once.len(), world.sent.len()), (500, 500), "one frame a cycle");
}

#[test]
fn a_frame_that_comes_in_the_next_cycle_is_late_and_gives_nothing() {
    let mut world = moving(1, 3);
    let mut cycle = 0;
    world.fate = Box::new(move |_, cyclic| {
        cycle += u32::from(cyclic);
        if cyclic && cycle == 5 {
            Fate::Late(1_000_000)
        } else {
            Fate::Passes
        }
    });
    let mut fresh = Vec::new();
    for _ in 0..10 {
        world.cycle();
        fresh.push(world.main.answered(0).lost_in_row);
    }
    assert_eq!(fresh.iter().filter(|row| **row == 1).count(), 1, "{fresh:?}");
    assert_eq!(world.main.counters().late, 1);
}

#[test]
fn a_drive_that_leaves_op_is_told_and_brought_back_while_the_others_run() {
    let mut world = moving(4, 3);
    write(&mut world, Command::Aprw, 0, &[]); // Nothing: a frame of somebody else passes.
    write(
        &mut world,
        Command::Apwr,
        register::position(2, register::AL_CONTROL),
        &[4, 0],
    );
    world.run(3);
    let events = world.take_events();
    assert_eq!(
        events,
        [Event::Left {
            device: 2,
            at: AlState::SafeOp,
            code: AlStatusCode::NONE
        }]
    );
    assert_eq!(world.main.answered(2).working_counter, 1, "it is read, and not written");
    for drive in [0, 1, 3] {
        assert!(world.is_on(drive), "{drive}");
    }
    world.enable = false;
    world.run_to_op(2000);
    let events = world.take_events();
    // The drive tells by itself what it thinks of it.
    let others = events
        .iter()
        .filter(|event| !matches!(event, Event::Emergency { device: 2, .. }));
    assert_eq!(others.collect::<Vec<_>>(), [&Event::Up { device: 2 }]);
    world.enable = true;
    world.run(800);
    assert!((0..4).all(|drive| world.is_on(drive)));
}

#[test]
fn a_drive_thrown_back_to_init_is_set_up_anew() {
    let mut world = moving(3, 3);
    write(
        &mut world,
        Command::Apwr,
        register::position(1, register::AL_CONTROL),
        &[1, 0],
    );
    world.run(5);
    world.run_to_op(3000);
    let events = world.take_events();
    assert!(
        matches!(
            events[0],
            Event::Left {
                device: 1,
                at: AlState::Init,
                ..
            }
        ),
        "{events:?}"
    );
    assert!(
        matches!(
            events[..],
            [_, Event::Identified { device: 1, .. }, Event::Up { device: 1 }]
        ),
        "{events:?}"
    );
}

#[test]
fn a_broken_cable_is_found_between_two_devices_and_all_come_back() {
    let mut world = moving(6, 3);
    world.segment.cut(4);
    world.run(400);
    let events = world.take_events();
    let lost: Vec<u16> = events
        .iter()
        .filter_map(|event| match event {
            Event::Lost {
                device,
                working_counter: 0,
                ..
            } => Some(*device),
            _ => None,
        })
        .collect();
    assert_eq!(lost, [4, 5, 6], "{events:?}");
    let place = Break {
        before: Some((3, 1)),
        behind: 4,
        link_lost: true,
        lost_links: 1,
    };
    let broken: Vec<&Event> = events
        .iter()
        .filter(|event| matches!(event, Event::Broken(_)))
        .collect();
    assert_eq!(broken, [&Event::Broken(place)]);
    assert_eq!(
        place.to_string(),
        "no link between position 3, port 1, and position 4: cable, or power of the latter"
    );
    assert!((0..4).all(|drive| world.is_on(drive)), "those before it run");
    world.enable = false;
    world.run(3000);
    world.segment.heal(4);
    world.run_to_op(9000);
    let events = world.take_events();
    assert_eq!(
        events.iter().filter(|event| matches!(event, Event::Up { .. })).count(),
        3,
        "{events:?}"
    );
    world.enable = true;
    world.run(800);
    assert!((0..6).all(|drive| world.is_on(drive)));
}

#[test]
fn a_drive_without_power_for_a_while_gets_address_clock_and_objects_anew() {
    let mut world = moving(3, 3);
    world.enable = false;
    // The last drive and the terminal behind it.
    world.segment.power_off(2);
    world.run(50);
    world.segment.power_on(2, world.now_ns);
    world.run_to_op(9000);
    let events = world.take_events();
    assert!(
        events
            .iter()
            .any(|event| matches!(event, Event::Identified { device: 2, position: 2 })),
        "{events:?}"
    );
    world.enable = true;
    world.run(1500);
    assert!((0..3).all(|drive| world.is_on(drive)));
    let now_ns = world.now_ns;
    let times = [0, 1, 2].map(|number| world.segment.device(number).system_ns(now_ns).unwrap());
    assert!(times.iter().all(|time| time.abs_diff(times[0]) < 1000), "{times:?}");
}

/// Those behind it still have the time of before: they are told the new one, and do not wait for their clocks to drift there.
#[test]
fn a_leading_clock_that_was_off_for_long_is_followed_at_once() {
    for (drives, off_ms) in [(3, 20), (3, 600), (8, 300)] {
        let mut world = moving(drives, 3);
        world.enable = false;
        world.segment.power_off(0);
        world.run(off_ms);
        world.take_events();
        world.segment.power_on(0, world.now_ns);
        world.run_to_op(300 + 150 * (drives as u64 + 1));
        let events = world.take_events();
        let failed = events.iter().find(|event| matches!(event, Event::Failed { .. }));
        assert_eq!(failed, None, "{events:?}");
    }
}

#[test]
fn the_device_whose_clock_leads_may_go_and_come_back() {
    let mut world = moving(3, 3);
    world.enable = false;
    world.segment.power_off(0);
    world.run(20);
    let events = world.take_events();
    assert!(
        events.iter().any(|event| matches!(
            event,
            Event::Broken(Break {
                before: None,
                behind: 0,
                ..
            })
        )),
        "{events:?}"
    );
    world.segment.power_on(0, world.now_ns);
    world.run_to_op(12_000);
    world.enable = true;
    world.run(2000);
    assert!((0..3).all(|drive| world.is_on(drive)));
    let now_ns = world.now_ns;
    let times = [0, 1, 2].map(|number| world.segment.device(number).system_ns(now_ns).unwrap());
    assert!(times.iter().all(|time| time.abs_diff(times[0]) < 1000), "{times:?}");
}

#[test]
fn swapped_devices_are_refused_with_expected_and_found() {
    let mut world = World::new(
        vec![drive(0, 0), drive(0, 5), models::digital_terminal(TERMINAL)],
        vec![drive_config(0), drive_config(1), terminal_config(2)],
        3,
    );
    world.run_to_op(3000);
    world.take_events();
    let swap = |world: &mut World| {
        for number in [1, 2] {
            world.segment.power_off(number);
        }
        world.run(50);
        world.segment.swap(1, 2);
        for number in [1, 2] {
            world.segment.power_on(number, world.now_ns);
        }
    };
    swap(&mut world);
    world.run(3000);
    let events = world.take_events();
    let wrong = |device: u16| {
        let is_wrong = |event: &&Event| matches!(event, Event::Failed { device: of, error: SetupError::WrongIdentity { .. } } if *of == device);
        events.iter().filter(is_wrong).count()
    };
    assert_eq!((wrong(1), wrong(2)), (1, 1), "{events:?}");
    assert!(!world.main.is_operational());
    swap(&mut world);
    world.run_to_op(20_000);
}

#[test]
fn another_device_with_our_address_at_a_place_is_told() {
    let mut world = moving(3, 3);
    world.enable = false;
    // One of them was switched off, and is put back at the place of the other one.
    world.segment.power_off(1);
    world.run(50);
    world.segment.swap(1, 2);
    world.segment.power_on(2, world.now_ns);
    world.run(5000);
    let events = world.take_events();
    assert!(
        events.contains(&Event::OrderChanged {
            device: 1,
            position: 1,
            station: 0x1002
        }),
        "{events:?}"
    );
}

#[test]
fn another_main_device_is_told_once_and_changes_nothing() {
    let mut world = moving(2, 3);
    let frame = |source: [u8; 6]| {
        let mut buffer = [0; FRAME_LEN_MAX];
        let mut writer = FrameWriter::new(&mut buffer, BROADCAST, source).unwrap();
        writer.push(Command::Brd, 1, 0, 2).unwrap();
        let length = writer.finish();
        buffer[..length].to_vec()
    };
    for _ in 0..50 {
        world.intrude(&frame([0x0A, 1, 2, 3, 4, 5]));
        world.intrude(&frame(MAC));
        world.cycle();
    }
    assert_eq!(
        world.take_events(),
        [Event::OtherMain {
            source: [0x0A, 1, 2, 3, 4, 5]
        }]
    );
    assert_eq!((world.main.counters().foreign, world.main.counters().echoes), (50, 50));
    assert!((0..2).all(|drive| world.is_on(drive)));
}

#[test]
fn frames_that_arrive_spoilt_are_told_with_their_cable() {
    let mut world = moving(4, 3);
    for _ in 0..3 {
        world.segment.spoil_next(2);
        world.run(20);
    }
    world.run(1500);
    assert_eq!(
        world.take_events(),
        [Event::Spoilt {
            position: 2,
            port: 0,
            frames: 3
        }]
    );
}

#[test]
fn devices_that_are_switched_on_later_are_found_behind_the_others() {
    let mut world = World::drives(4, 3);
    world.segment.cut(2);
    world.run(4000);
    let events = world.take_events();
    let missing = |event: &&Event| {
        matches!(
            event,
            Event::Failed {
                error: SetupError::Missing(_),
                ..
            }
        )
    };
    assert_eq!(events.iter().filter(missing).count(), 3, "{events:?}");
    assert!(!world.main.is_operational());
    world.segment.heal(2);
    world.run_to_op(5000);
    let events = world.take_events();
    assert!(events.contains(&Event::More { devices: 5 }), "{events:?}");
    world.enable = true;
    world.run(1500);
    assert!((0..4).all(|drive| world.is_on(drive)));
    // A cable that breaks among them is found, too.
    world.take_events();
    world.segment.cut(3);
    world.run(400);
    let events = world.take_events();
    let place = Break {
        before: Some((2, 1)),
        behind: 3,
        link_lost: true,
        lost_links: 1,
    };
    assert!(events.contains(&Event::Broken(place)), "{events:?}");
}
