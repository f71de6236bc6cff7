//! From power-on to OP, and what keeps a device from it, in words.

use super::world::{self, TERMINAL, World, drive, drive_config, drive_identity, terminal_config};
use ethercat::main::config::{
    ClockConfig, DeviceConfig, Expected, PdoConfig, Place, ProcessDataConfig, StartValue, Times,
};
use ethercat::main::{Event, SetupError};
use ethercat::sub::{IdealMotor, Segment, SubDevice, SubDeviceConfig, models};
use ethercat::wire::Command;
use ethercat::wire::register::{self, AlState, AlStatusCode};
use ethercat::wire::sii::Identity;

fn failures(events: &[Event]) -> Vec<(u16, String)> {
    let failed = |event: &Event| match event {
        Event::Failed { device, error } => Some((*device, error.to_string())),
        _ => None,
    };
    events.iter().filter_map(failed).collect()
}

fn ups(events: &[Event]) -> Vec<u16> {
    let up = |event: &Event| match event {
        Event::Up { device } => Some(*device),
        _ => None,
    };
    let mut devices: Vec<u16> = events.iter().filter_map(up).collect();
    devices.sort_unstable();
    devices
}

#[test]
fn eight_drives_and_a_terminal_come_to_op_within_a_second_and_a_half() {
    let mut world = World::drives(8, 1);
    let ns = world.run_to_op(3000);
    println!("OP of 8 drives and a terminal after {} ms", ns / 1_000_000);
    assert!(ns < 1_500_000_000, "{ns}");
    for number in 0..9 {
        let device = world.segment.device(number);
        assert_eq!((device.state(), device.has_error()), (AlState::Op, false), "{number}");
    }
    assert_eq!(ups(&world.events), (0..9).collect::<Vec<_>>());
    assert_eq!(failures(&world.events), []);
    world.enable = true;
    world.run(1500);
    for drive in 0..8 {
        assert!(world.is_on(drive), "{drive}");
        assert!(world.actual(drive) > 5000, "{drive}: {}", world.actual(drive));
    }
    assert_eq!(world.events.len(), 1 + 9 + 9, "{:?}", world.events);
}

/// Dates lie in one phase to SYNC0, whose clock drifts by 40 ppm, though frames leave up to 5 µs late.
#[test]
fn dates_keep_their_phase_to_sync0() {
    let mut world = World::drives(3, 7);
    world.run_to_op(3000);
    world.run(1000);
    world.dates.clear();
    world.run(3000);
    let cycle_ns = world.cycle_ns as i64;
    let first = world.dates[0] as i64;
    let phases: Vec<f64> = world
        .dates
        .iter()
        .map(|date| {
            let behind = (*date as i64 - first).rem_euclid(cycle_ns);
            (if behind > cycle_ns / 2 {
                behind - cycle_ns
            } else {
                behind
            }) as f64
        })
        .collect();
    let mean = phases.iter().sum::<f64>() / phases.len() as f64;
    let variance = phases.iter().map(|phase| (phase - mean).powi(2)).sum::<f64>() / phases.len() as f64;
    let range = phases.iter().copied().fold(f64::MIN, f64::max) - phases.iter().copied().fold(f64::MAX, f64::min);
    println!("phase to SYNC0: std {:.0} ns, range {range:.0} ns", variance.sqrt());
    assert!(
        variance.sqrt() <= 1000.0 && range <= 8000.0,
        "{} {range}",
        variance.sqrt()
    );
    let punctuality = world.main.punctuality(0).expect("a window");
    assert!(punctuality.is_good(), "{punctuality}");
    assert!((490_000..510_000).contains(&punctuality.before_ns), "{punctuality}");
    assert!((3_000..6_000).contains(&punctuality.spread_ns), "{punctuality}");
    assert!(world.main.budget().fits(), "{}", world.main.budget());
    // All clocks show the same, and SYNC0 of all comes in the middle between two dates.
    let now_ns = world.now_ns;
    let times: Vec<u64> = (0..3)
        .map(|number| world.segment.device(number).system_ns(now_ns).unwrap())
        .collect();
    assert!(times.iter().all(|time| time.abs_diff(times[0]) < 1000), "{times:?}");
    let pulses = [0, 1, 2].map(|number| world.segment.device(number).pulses());
    world.run(100);
    for (number, before) in pulses.into_iter().enumerate() {
        assert!(
            (99..=101).contains(&(world.segment.device(number).pulses() - before)),
            "{number}"
        );
    }
}

#[test]
fn couplers_terminals_and_a_drive_of_two_axes_come_up_beside_each_other() {
    let identity = |product| Identity {
        vendor: 2,
        product,
        revision: 1,
        serial: 0,
    };
    let motors: Vec<Box<dyn ethercat::sub::Motor>> =
        vec![Box::new(IdealMotor::default()), Box::new(IdealMotor::default())];
    let mut coupler = models::coupler(identity(1));
    coupler.clock = Some(ethercat::sub::ClockConfig::default());
    let mut parts = vec![
        DeviceConfig::at(0),
        terminal_config(1),
        DeviceConfig::at(2),
        drive_config(3),
    ];
    parts[2].outputs = ProcessDataConfig { octets: 8, pdos: &[] };
    parts[2].inputs = ProcessDataConfig { octets: 8, pdos: &[] };
    // Two axes, as they come out of the box.
    parts[3].outputs = ProcessDataConfig { octets: 16, pdos: &[] };
    parts[3].inputs = ProcessDataConfig { octets: 16, pdos: &[] };
    let devices = vec![
        coupler,
        models::digital_terminal(TERMINAL),
        models::analog_terminal(identity(4)).unwrap(),
        models::DriveModel::default().build(motors).unwrap(),
    ];
    let mut world = World::new(devices, parts, 3);
    world.run_to_op(3000);
    assert_eq!(ups(&world.events), [0, 1, 2, 3]);
    world.main.outputs_mut(1)[0] = 0xA5;
    world.main.outputs_mut(2).copy_from_slice(&[1, 0, 2, 0, 3, 0, 4, 0]);
    let terminal = |world: &mut World, number: usize| {
        world
            .segment
            .device_mut(number)
            .application_mut()
            .as_terminal()
            .unwrap()
            .outputs
            .clone()
    };
    world.run(3);
    assert_eq!(terminal(&mut world, 1), [0xA5]);
    assert_eq!(terminal(&mut world, 2), [1, 0, 2, 0, 3, 0, 4, 0]);
}

#[test]
fn a_wrong_device_a_missing_one_and_a_stranger_are_named() {
    let devices = vec![
        models::digital_terminal(TERMINAL),
        drive(0, 0),
        models::coupler(TERMINAL),
    ];
    let mut parts = vec![drive_config(0), drive_config(1), drive_config(7)];
    parts[1].place = Place::Position(1);
    let mut world = World::new(devices, parts, 3);
    world.run(4000);
    let told = failures(&world.events);
    assert_eq!(
        told,
        [
            (2, "nothing is at position 7".to_owned()),
            (
                0,
                "expected vendor 00000A1Bh product 04020001h revision any, found vendor 00000002h product 00000088h \
                 revision 00000001h serial 0"
                    .to_owned()
            )
        ]
    );
    let strangers = world
        .events
        .iter()
        .filter(|event| matches!(event, Event::Stranger { position: 2, .. }));
    assert_eq!(strangers.count(), 1);
    assert_eq!(ups(&world.events), [1]);
    assert!(!world.main.is_operational());
}

#[test]
fn devices_are_found_by_alias_wherever_they_are() {
    let with_alias = |alias: u16| {
        let motors: Vec<Box<dyn ethercat::sub::Motor>> = vec![Box::new(IdealMotor::default())];
        models::DriveModel {
            alias,
            ..models::DriveModel::default()
        }
        .build(motors)
        .unwrap()
    };
    let part = |alias: u16| DeviceConfig {
        place: Place::Alias(alias),
        ..drive_config(0)
    };
    let mut world = World::new(vec![with_alias(12), with_alias(11)], vec![part(11), part(12)], 3);
    world.run_to_op(3000);
    assert_eq!(
        world.main.found(0).map(|(position, found)| (position, found.alias)),
        Some((1, 11))
    );
    assert_eq!(world.main.found(1).map(|(position, _)| position), Some(0));
}

#[test]
fn what_a_device_refuses_is_said_in_words_and_it_is_tried_again() {
    for (state, code, words) in [
        (
            AlState::SafeOp,
            AlStatusCode::OUTPUT_SM,
            "refused SAFE-OP and is in PRE-OP: 001Dh (SyncManager of the outputs does not fit the mapping); 8 octets of \
             outputs were set up, it expects another length",
        ),
        (
            AlState::PreOp,
            AlStatusCode::MAILBOX,
            "refused PRE-OP and is in INIT: 0016h (mailbox set-up is wrong); mailboxes were set up as in its EEPROM, \
             1000h/128 and 1080h/128",
        ),
        (
            AlState::Op,
            AlStatusCode(0x8123),
            "refused OP and is in SAFE-OP: 8123h (a code of the maker); 2 values were written before",
        ),
    ] {
        let mut world = World::drives(2, 5);
        world.segment.device_mut(1).faults.refused = Some((state, code));
        world.run(3000);
        assert_eq!(failures(&world.events), [(1, words.to_owned())], "{state}");
        assert_eq!(ups(&world.events), [0, 2], "the others are not kept waiting");
        world.segment.device_mut(1).faults.refused = None;
        world.run_to_op(8000);
    }
}

#[test]
fn without_sync0_there_is_no_op() {
    let mut world = World::drives(2, 5);
    world.segment.device_mut(0).faults.no_sync0 = true;
    world.run(3000);
    let told = failures(&world.events);
    assert_eq!(told.len(), 1);
    assert!(
        told[0]
            .1
            .contains("002Dh (no SYNC0 was seen); frames come too near to SYNC0"),
        "{told:?}"
    );
}

#[test]
fn silence_is_told_again_and_again() {
    let mut world = World::drives(1, 5);
    world.segment.cut(0);
    world.run(3000);
    let silent: Vec<&Event> = world.events.iter().collect();
    assert!(
        silent.len() > 1 && silent.iter().all(|event| matches!(event, Event::Silent { .. })),
        "{silent:?}"
    );
    world.segment.heal(0);
    world.run_to_op(8000);
}

#[test]
fn values_that_are_refused_and_maps_that_are_fixed_are_named() {
    // An analog terminal whose PDOs are fixed.
    let identity = Identity {
        vendor: 2,
        product: 4,
        revision: 1,
        serial: 0,
    };
    let terminal = || models::analog_terminal(identity).unwrap();
    let data = |entries: &'static [u32]| ProcessDataConfig {
        octets: 8,
        pdos: Vec::leak(vec![PdoConfig { index: 0x1600, entries }]),
    };
    let part = |entries| DeviceConfig {
        outputs: data(entries),
        inputs: ProcessDataConfig { octets: 8, pdos: &[] },
        ..DeviceConfig::at(0)
    };
    // As it is anyway: nothing is written.
    const OWN: &[u32] = &[0x7000_0110, 0x7000_0210, 0x7000_0310, 0x7000_0410];
    let mut world = World::new(vec![terminal()], vec![part(OWN)], 3);
    world.run_to_op(3000);
    const OTHER: &[u32] = &[0x7000_0210, 0x7000_0110, 0x7000_0310, 0x7000_0410];
    let mut world = World::new(vec![terminal()], vec![part(OTHER)], 3);
    world.run(3000);
    assert_eq!(
        failures(&world.events),
        [(
            0,
            "refused 1600h:00: attempt to write a read-only object; PDO 1600h cannot be changed, use its own entries or \
             another one"
                .to_owned()
        )]
    );
    // A start value that the drive does not know, behind two that it does.
    let mut part = drive_config(0);
    let mut start = part.start.to_vec();
    start.push(StartValue {
        index: 0x2345,
        sub: 1,
        complete: false,
        optional: false,
        value: &[1, 2],
    });
    part.start = Vec::leak(start);
    let mut world = World::new(vec![drive(0, 0)], vec![part], 3);
    world.run(3000);
    assert_eq!(
        failures(&world.events),
        [(
            0,
            "refused 2345h:01: object does not exist in the object dictionary".to_owned()
        )]
    );
}

/// The entry of the EEPROM for the SyncManager that is used so.
fn manager_of(device: &mut SubDeviceConfig, usage: u8) -> &mut [u8] {
    let entry =
        |octets: &[u8]| octets[0] == 0 && matches!(octets[1], 0x10..0x18) && octets[6] == 1 && octets[7] == usage;
    let at = device.eeprom.windows(8).position(entry).expect("an entry");
    &mut device.eeprom[at..at + 8]
}

#[test]
fn what_cannot_be_is_said_before_anything_is_written() {
    let refused = |device, part: DeviceConfig<'static>| {
        let mut world = World::new(vec![device], vec![part], 3);
        world.run(1000);
        let told = failures(&world.events);
        assert_eq!(told.len(), 1, "{told:?}");
        assert_eq!(world.segment.device(0).state(), AlState::Init);
        told[0].1.clone()
    };
    let clock = Some(ClockConfig {
        activate: 0x300,
        shift_ns: 0,
        sync1_ns: 0,
    });
    let words = refused(
        models::digital_terminal(TERMINAL),
        DeviceConfig {
            clock,
            ..terminal_config(0)
        },
    );
    assert_eq!(words, "has no distributed clock; switch SYNC0 off for it");
    let start = &[StartValue {
        index: 0x6060,
        sub: 0,
        complete: false,
        optional: false,
        value: &[8],
    }];
    let words = refused(
        models::digital_terminal(TERMINAL),
        DeviceConfig {
            start,
            ..terminal_config(0)
        },
    );
    assert_eq!(words, "values shall be written by SDO, and it has no CoE mailbox");
    let outputs = ProcessDataConfig { octets: 3, pdos: &[] };
    let words = refused(
        models::digital_terminal(TERMINAL),
        DeviceConfig {
            outputs,
            ..terminal_config(0)
        },
    );
    assert_eq!(words, "has 1 octets of outputs that cannot be changed, not 3");
    let words = refused(models::coupler(TERMINAL), terminal_config(0));
    assert_eq!(
        words,
        "the EEPROM has no SyncManager for outputs: the device has none, their list has to be empty"
    );
    let outputs = ProcessDataConfig { octets: 300, pdos: &[] };
    let words = refused(
        drive(0, 0),
        DeviceConfig {
            outputs,
            ..drive_config(0)
        },
    );
    assert_eq!(
        words,
        "SyncManager 2 (outputs) does not fit: 3 x 300 octets from 1100h on end at 1484h, SyncManager 3 (inputs) begins at 1400h"
    );
    // Nothing lies behind the inputs but the end of the memory.
    let inputs = ProcessDataConfig { octets: 100, pdos: &[] };
    let mut at_the_end = drive(0, 0);
    manager_of(&mut at_the_end, 4)[..2].copy_from_slice(&0x2F00_u16.to_le_bytes());
    let words = refused(
        at_the_end,
        DeviceConfig {
            inputs,
            ..drive_config(0)
        },
    );
    assert_eq!(
        words,
        "SyncManager 3 (inputs) does not fit: 3 x 100 octets from 2F00h on end at 302Ch, the memory of the device ends at 3000h"
    );
    // Octet 32h of an EEPROM: length of the mails to the device.
    let mut long = drive(0, 0);
    long.eeprom[0x32..0x34].copy_from_slice(&256_u16.to_le_bytes());
    assert_eq!(
        refused(long, drive_config(0)),
        "SyncManager 0 (mails to it) does not fit: 1 x 256 octets from 1000h on end at 1100h, SyncManager 1 (mails from it) \
         begins at 1080h"
    );
    let mut short = drive(0, 0);
    short.eeprom[0x32..0x34].copy_from_slice(&15_u16.to_le_bytes());
    assert_eq!(
        refused(short, drive_config(0)),
        "a mailbox of 15 octets by its EEPROM is too short for an SDO, which takes 16"
    );
    let mut lrw = drive(0, 0);
    lrw.features = ethercat::wire::register::feature::NO_LRW;
    assert_eq!(
        refused(lrw, drive_config(0)),
        "cannot be read and written by one datagram (LRW)"
    );
    let mut spoilt = drive(0, 0);
    spoilt.eeprom[10] ^= 1;
    assert_eq!(refused(spoilt, drive_config(0)), "the check sum of the EEPROM is wrong");
    let mut slow = drive(0, 0);
    slow.eeprom_ns = 200_000_000;
    assert_eq!(refused(slow, drive_config(0)), "the EEPROM does not become ready");
}

#[test]
fn a_bus_that_loses_every_fifth_frame_comes_up() {
    for seed in 0..20 {
        let mut world = World::drives(3, seed);
        world.fate = Box::new(|random, cyclic| {
            if !cyclic && random.below(5) == 0 {
                world::Fate::Lost
            } else {
                world::Fate::Passes
            }
        });
        world.run_to_op(6000);
        assert_eq!(failures(&world.events), [], "seed {seed}");
    }
}

#[test]
fn devices_in_a_tree_have_their_delays() {
    let mut segment = Segment::new();
    segment.push(SubDevice::new(drive(0, 5), 0), 30);
    segment.push_at(SubDevice::new(drive(10_000, 6), 0), Some((0, 3)), 145);
    segment.push_at(SubDevice::new(models::digital_terminal(TERMINAL), 0), Some((1, 1)), 155);
    segment.push_at(SubDevice::new(drive(20_000, 7), 0), Some((2, 1)), 100);
    segment.push_at(SubDevice::new(drive(-30_000, 8), 0), Some((0, 1)), 785);
    let parts = vec![
        drive_config(0),
        drive_config(1),
        drive_config(3),
        drive_config(4),
        terminal_config(2),
    ];
    let mut world = World::with(segment, parts, 3, Times::default(), 1_000_000);
    world.run_to_op(3000);
    world.run(1000);
    let now_ns = world.now_ns;
    let times = [0, 1, 3, 4].map(|number| world.segment.device(number).system_ns(now_ns).unwrap());
    assert!(times.iter().all(|time| time.abs_diff(times[0]) < 300), "{times:?}");
}

#[test]
fn any_expectation_is_checked() {
    let found = drive_identity();
    let base = Expected::default();
    assert!(base.matches(&found));
    for (expected, fits) in [
        (
            Expected {
                vendor: Some(found.vendor),
                ..base
            },
            true,
        ),
        (
            Expected {
                vendor: Some(1),
                ..base
            },
            false,
        ),
        (
            Expected {
                product: Some(1),
                ..base
            },
            false,
        ),
        (
            Expected {
                revision: Some(99),
                ..base
            },
            false,
        ),
        (
            Expected {
                serial: Some(4),
                ..base
            },
            false,
        ),
    ] {
        assert_eq!(expected.matches(&found), fits, "{expected:?}");
    }
    assert_eq!(SetupError::Gone.to_string(), "does not answer any more");
}

#[test]
fn a_drive_that_is_slower_than_the_cycle_says_so_and_comes_up() {
    let mut device = drive(0, 0);
    device.objects.preset(0x1C32, 5, &1_500_000_u32.to_le_bytes()).unwrap();
    let mut world = World::new(vec![device, drive(0, 5)], vec![drive_config(0), drive_config(1)], 3);
    world.run_to_op(3000);
    let slow: Vec<String> = world
        .events
        .iter()
        .filter(|event| matches!(event, Event::Slow { .. }))
        .map(Event::to_string)
        .collect();
    assert_eq!(
        slow,
        ["device 0 says that its shortest cycle is 1500 us (1C32h:05), which is longer than ours"]
    );
}

/// What is written into AL control of a device at its station address: its state and its acknowledgement, in order.
fn asked_states(world: &mut World, station: u16) -> std::sync::Arc<std::sync::Mutex<Vec<u16>>> {
    let seen = std::sync::Arc::<std::sync::Mutex<Vec<u16>>>::default();
    let tapped = std::sync::Arc::clone(&seen);
    world.tap = Box::new(move |_, octets| {
        let Ok(frame) = ethercat::wire::Frame::parse(octets) else {
            return;
        };
        for datagram in frame.datagrams() {
            // As it is sent: nobody has counted it.
            let is_control = datagram.ado() == register::AL_CONTROL && datagram.working_counter == 0;
            if datagram.command == Command::Fpwr && is_control && datagram.adp() == station {
                let word = [datagram.data[0], datagram.data[1]];
                tapped.lock().unwrap().push(u16::from_le_bytes(word));
            }
        }
    });
    seen
}

/// A chip that emulates the state machine mirrors the acknowledgement as an error that it does not have, with which it was left by
/// the reset of all devices, and by a main device before.
#[test]
fn a_device_whose_state_machine_is_emulated_comes_up() {
    let mut outputs_only = terminal_config(1);
    outputs_only.inputs.octets = 0;
    let devices = vec![
        models::digital_terminal(TERMINAL),
        models::digital_terminal(TERMINAL),
        drive(0, 0),
    ];
    let mut world = World::new(devices, vec![terminal_config(0), outputs_only, drive_config(2)], 5);
    let seen = asked_states(&mut world, 0x1000);
    world.run_to_op(3000);
    assert_eq!(failures(&world.events), []);
    assert_eq!(ups(&world.events), [0, 1, 2]);
    for number in 0..2 {
        let device = world.segment.device(number);
        assert_eq!((device.state(), device.has_error()), (AlState::Op, false), "{number}");
    }
    assert_eq!(*seen.lock().unwrap(), [1, 2, 4, 8]);
    // Another main device has left it so.
    seen.lock().unwrap().clear();
    world.segment.device_mut(0).power_off();
    world.run(100);
    world.segment.device_mut(0).power_on(world.now_ns);
    world.run(3000);
    assert!(world.main.is_operational());
    assert_eq!(failures(&world.events), []);
    assert!(seen.lock().unwrap().iter().all(|word| word & 0x10 == 0), "{seen:?}");
}

/// An error of a device with firmware is acknowledged where it stands, and nowhere else.
#[test]
fn only_an_error_that_stands_is_acknowledged() {
    let mut world = World::new(vec![drive(0, 0)], vec![drive_config(0)], 5);
    let seen = asked_states(&mut world, 0x1000);
    world.segment.device_mut(0).faults.refused = Some((AlState::SafeOp, AlStatusCode::HARDWARE));
    world.run(600);
    assert_eq!(seen.lock().unwrap()[..5], [1, 2, 4, 0x12, 1], "{seen:?}");
    world.segment.device_mut(0).faults.refused = None;
    seen.lock().unwrap().clear();
    world.run_to_op(3000);
    assert_eq!(*seen.lock().unwrap(), [0x12, 1, 2, 4, 8]);
}

/// What a drive can do without is told and passed over, whether the object or its sub-index is not there; any other refusal of it, and of
/// what is needed, is a failure.
#[test]
fn a_drive_comes_up_without_an_object_that_may_be_missing() {
    let started = |values: &[(u16, u8, bool)]| {
        let mut part = drive_config(0);
        let mut start = part.start.to_vec();
        start.extend(values.iter().map(|(index, sub, optional)| StartValue {
            index: *index,
            sub: *sub,
            complete: false,
            optional: *optional,
            value: &[1, 2],
        }));
        part.start = Vec::leak(start);
        let mut world = World::new(vec![drive(0, 0)], vec![part], 3);
        world.run(3000);
        let lacks = world.events.iter().filter(|event| matches!(event, Event::Lacks { .. }));
        let lacks: Vec<String> = lacks.map(Event::to_string).collect();
        (lacks, failures(&world.events), world.segment.device(0).state())
    };
    let (lacks, failed, state) = started(&[(0x2345, 1, true), (0x6060, 7, true)]);
    assert_eq!((failed.len(), state), (0, AlState::Op));
    assert_eq!(
        lacks,
        [
            "device 0 does not have 2345h:01: nothing is written there",
            "device 0 does not have 6060h:07: nothing is written there"
        ]
    );
    // Two octets for an object of one: it is there.
    let (lacks, failed, _) = started(&[(0x6060, 0, true)]);
    assert!(
        lacks.is_empty() && failed[0].1.starts_with("refused 6060h:00"),
        "{failed:?}"
    );
    let (lacks, failed, _) = started(&[(0x2345, 1, true), (0x2346, 1, false)]);
    assert_eq!((lacks.len(), failed.len()), (1, 1), "{failed:?}");
}
