//! Objects of devices that run: values of any length, refusals, emergencies, devices that do not answer.

use super::world::{Fate, World};
use ethercat::main::{Event, SetupError, VALUE_MAX};
use ethercat::wire::coe::{Emergency, Object};
use obd::AbortCode;

const fn object(index: u16, sub: u8) -> Object {
    Object {
        index,
        sub,
        complete: false,
    }
}

/// Seeds of a test: so many, or as `ISOCNC_SEEDS` says.
fn seeds(default: u64) -> u64 {
    std::env::var("ISOCNC_SEEDS").map_or(default, |text| text.parse().expect("a number"))
}

fn operational(seed: u64) -> World {
    let mut world = World::drives(2, seed);
    world.run_to_op(3000);
    world.events.clear();
    world
}

fn result(world: &mut World, order: usize) -> Result<Vec<u8>, SetupError> {
    for _ in 0..2000 {
        world.cycle();
        if let Some(result) = world.main.sdo_result(order) {
            return result.map(<[u8]>::to_vec);
        }
    }
    panic!("no result");
}

fn read(world: &mut World, index: u16, sub: u8) -> Result<Vec<u8>, SetupError> {
    let order = world.main.sdo_read(0, object(index, sub)).expect("an order");
    result(world, order)
}

fn write(world: &mut World, index: u16, sub: u8, value: &[u8]) -> Result<Vec<u8>, SetupError> {
    let order = world.main.sdo_write(0, object(index, sub), value).expect("an order");
    result(world, order)
}

#[test]
fn values_are_read_and_written_while_the_drive_runs() {
    let mut world = operational(3);
    assert_eq!(read(&mut world, 0x1018, 1), Ok(0x0A1B_u32.to_le_bytes().to_vec()));
    assert_eq!(read(&mut world, 0x1008, 0), Ok(b"Simulated servo drive".to_vec()));
    assert_eq!(write(&mut world, 0x6081, 0, &77_u32.to_le_bytes()), Ok(vec![]));
    assert_eq!(read(&mut world, 0x6081, 0), Ok(77_u32.to_le_bytes().to_vec()));
    assert!(world.main.is_operational());
    assert_eq!(world.events, []);
}

#[test]
fn long_values_go_in_segments() {
    // Mailboxes of 32 octets: the name needs a first mail and segments.
    for mailbox in [24, 30, 32, 64] {
        let motors: Vec<Box<dyn ethercat::sub::Motor>> = vec![Box::new(ethercat::sub::IdealMotor::default())];
        let model = ethercat::sub::models::DriveModel {
            mailbox,
            ..Default::default()
        };
        let mut world = World::new(
            vec![model.build(motors).unwrap()],
            vec![super::world::drive_config(0)],
            3,
        );
        world.run_to_op(3000);
        assert_eq!(
            read(&mut world, 0x1008, 0),
            Ok(b"Simulated servo drive".to_vec()),
            "{mailbox}"
        );
        let complete = Object {
            index: 0x1018,
            sub: 0,
            complete: true,
        };
        let order = world.main.sdo_read(0, complete).unwrap();
        let all = result(&mut world, order).unwrap();
        assert_eq!((all.len(), &all[..6]), (18, &[4, 0, 0x1B, 0x0A, 0, 0][..]), "{mailbox}");
    }
}

#[test]
fn refusals_have_their_codes_and_too_long_values_are_not_taken() {
    let mut world = operational(3);
    let refused = |index, sub, code| {
        Err(SetupError::Sdo {
            object: object(index, sub),
            code,
        })
    };
    assert_eq!(read(&mut world, 0x2345, 0), refused(0x2345, 0, AbortCode::NO_OBJECT));
    assert_eq!(
        write(&mut world, 0x6041, 0, &[0, 0]),
        refused(0x6041, 0, AbortCode::WRITE_OF_READ_ONLY)
    );
    assert_eq!(world.main.sdo_write(0, object(0x1008, 0), &[0; VALUE_MAX + 1]), None);
    // The terminal has no mailbox.
    let order = world.main.sdo_read(2, object(0x1018, 1)).unwrap();
    assert_eq!(world.main.sdo_result(order), Some(Err(SetupError::Gone)));
    // Four at once, a fifth has to wait.
    let orders: Vec<Option<usize>> = (1..=5).map(|sub| world.main.sdo_read(1, object(0x1018, sub))).collect();
    assert_eq!(orders, [Some(0), Some(1), Some(2), Some(3), None]);
    for order in 0..4 {
        assert!(result(&mut world, order).is_ok());
    }
}

/// Some devices send a refusal as a response, most as a request.
#[test]
fn a_refusal_is_known_in_both_forms() {
    for abort_is_response in [false, true] {
        let mut device = super::world::drive(0, 0);
        device.abilities.abort_is_response = abort_is_response;
        let mut world = World::new(vec![device], vec![super::world::drive_config(0)], 3);
        world.run_to_op(3000);
        let code = AbortCode::NO_OBJECT;
        let refused = SetupError::Sdo {
            object: object(0x2345, 0),
            code,
        };
        assert_eq!(read(&mut world, 0x2345, 0), Err(refused), "{abort_is_response}");
    }
}

#[test]
fn an_emergency_comes_before_the_answer_and_by_itself() {
    let mut world = operational(3);
    let emergency = Emergency {
        code: 0x7300,
        register: 0x20,
        data: [1, 2, 3, 4, 5],
    };
    world.segment.device_mut(0).faults.emergency = Some(emergency);
    assert_eq!(read(&mut world, 0x1018, 1), Ok(0x0A1B_u32.to_le_bytes().to_vec()));
    assert_eq!(world.take_events(), [Event::Emergency { device: 0, emergency }]);
    world.segment.device_mut(1).report(emergency);
    world.run(30);
    assert_eq!(world.take_events(), [Event::Emergency { device: 1, emergency }]);
}

#[test]
fn a_mute_mailbox_costs_its_order_and_nothing_else() {
    let mut world = operational(3);
    world.segment.device_mut(0).faults.mute = true;
    assert_eq!(
        read(&mut world, 0x1018, 1),
        Err(SetupError::SdoTimeout {
            object: object(0x1018, 1)
        })
    );
    assert!(world.main.is_operational());
    world.segment.device_mut(0).faults.mute = false;
    assert_eq!(read(&mut world, 0x1018, 2), Ok(0x0402_0001_u32.to_le_bytes().to_vec()));
}

/// An answer that comes when its order was given up is not that to the next order, though it is of the same object.
#[test]
fn an_answer_to_an_order_that_was_given_up_is_not_taken_for_the_next_one() {
    let mut world = operational(3);
    let timeout = |index, sub| {
        Err(SetupError::SdoTimeout {
            object: object(index, sub),
        })
    };
    let number = |value: u32| Ok(value.to_le_bytes().to_vec());
    assert_eq!(write(&mut world, 0x6081, 0, &77_u32.to_le_bytes()), Ok(vec![]));
    // One order after the other is not answered in time: the device has them all in its hands.
    for given_up in 1..4_u32 {
        world.segment.device_mut(0).faults.withholds = true;
        for _ in 0..given_up {
            assert_eq!(read(&mut world, 0x6081, 0), timeout(0x6081, 0));
        }
        let objects = world.segment.device_mut(0).objects_mut();
        objects
            .preset(0x6081, 0, &(80_u32 + given_up).to_le_bytes())
            .expect("an object");
        world.segment.device_mut(0).faults.withholds = false;
        assert_eq!(
            read(&mut world, 0x6081, 0),
            number(80 + given_up),
            "{given_up} given up"
        );
        assert_eq!(read(&mut world, 0x1018, 2), number(0x0402_0001));
    }
    // A value that was taken too late; the next one is refused, and that is told.
    world.segment.device_mut(0).faults.withholds = true;
    assert_eq!(write(&mut world, 0x6060, 0, &[8]), timeout(0x6060, 0));
    world.segment.device_mut(0).faults.withholds = false;
    let refused = write(&mut world, 0x6060, 0, &[100]);
    assert!(matches!(refused, Err(SetupError::Sdo { .. })), "{refused:?}");
    // Objects of the identity, of which one is asked in between, are no exception.
    for sub in 0..=4 {
        world.segment.device_mut(0).faults.withholds = true;
        assert_eq!(read(&mut world, 0x1018, sub), timeout(0x1018, sub));
        world.segment.device_mut(0).faults.withholds = false;
        assert_eq!(read(&mut world, 0x1018, 1), number(0x0A1B));
        assert_eq!(read(&mut world, 0x1018, 2), number(0x0402_0001));
    }
    assert!(world.main.is_operational());
}

/// A value, a refusal: whatever comes late is nobody's, though frames are lost.
#[test]
fn whatever_comes_late_is_of_nobody_while_frames_are_lost() {
    for seed in 0..20 {
        let mut world = operational(seed);
        world.fate = Box::new(|random, cyclic| {
            let fates = [Fate::Lost, Fate::Twice, Fate::Passes, Fate::Passes];
            if cyclic {
                Fate::Passes
            } else {
                fates[random.below(4) as usize]
            }
        });
        for number in 0..6_u32 {
            world.segment.device_mut(0).faults.withholds = true;
            let late = [(0x1008, 0), (0x2345, 0), (0x6081, 0)][world.random.below(3) as usize];
            let given_up = read(&mut world, late.0, late.1);
            assert!(
                matches!(given_up, Err(SetupError::SdoTimeout { .. })),
                "seed {seed}: {given_up:?}"
            );
            world.segment.device_mut(0).faults.withholds = false;
            let value = number.to_le_bytes().to_vec();
            assert_eq!(write(&mut world, 0x6081, 0, &value), Ok(vec![]), "seed {seed}");
            assert_eq!(read(&mut world, 0x6081, 0), Ok(value), "seed {seed}");
        }
    }
}

#[test]
fn no_value_is_lost_or_doubled_where_every_third_frame_is_lost() {
    for seed in 0..30 {
        let mut world = operational(seed);
        world.fate = Box::new(|random, cyclic| {
            if cyclic {
                Fate::Passes
            } else {
                [Fate::Lost, Fate::Twice, Fate::Passes][random.below(3) as usize]
            }
        });
        for number in 0..10_u32 {
            assert_eq!(
                write(&mut world, 0x6081, 0, &number.to_le_bytes()),
                Ok(vec![]),
                "seed {seed}"
            );
            assert_eq!(
                read(&mut world, 0x6081, 0),
                Ok(number.to_le_bytes().to_vec()),
                "seed {seed}"
            );
        }
        assert_eq!(
            read(&mut world, 0x1008, 0),
            Ok(b"Simulated servo drive".to_vec()),
            "seed {seed}"
        );
    }
}

/// Services lose every fourth frame, on its way to the devices or back from them.
fn every_fourth_is_lost(world: &mut World) {
    world.fate = Box::new(|random, cyclic| match random.below(8) {
        0 if !cyclic => Fate::Lost,
        1 if !cyclic => Fate::LostOut,
        _ => Fate::Passes,
    });
}

/// One order behind the other, each done at its first try, while emergencies come between and behind the answers.
#[test]
fn every_order_is_done_where_every_fourth_frame_is_lost() {
    for seed in 0..seeds(200) {
        let mut world = operational(seed);
        every_fourth_is_lost(&mut world);
        for number in 0..6_u32 {
            let emergency = Emergency {
                code: 0x7300,
                register: 0x20,
                data: [number as u8; 5],
            };
            let drive = world.segment.device_mut(0);
            drive.report(emergency);
            if number % 2 == 0 {
                drive.faults.emergency = Some(emergency);
            }
            let value = number.to_le_bytes();
            assert_eq!(
                write(&mut world, 0x6081, 0, &value),
                Ok(vec![]),
                "seed {seed}, {number}"
            );
            assert_eq!(read(&mut world, 0x6081, 0), Ok(value.to_vec()), "seed {seed}, {number}");
            // This one comes right behind an answer, maybe into the mailbox that the answer has just left.
            let order = world.main.sdo_read(0, object(0x1008, 0)).expect("an order");
            let cycles = world.random.below(4);
            world.run(cycles);
            world.segment.device_mut(0).report(emergency);
            let name = result(&mut world, order);
            assert_eq!(name, Ok(b"Simulated servo drive".to_vec()), "seed {seed}, {number}");
        }
    }
}

/// A mail that was given up still lies in the mailbox when the next one is sent, and frames are lost.
#[test]
fn an_order_behind_one_that_was_given_up_is_done_where_every_fourth_frame_is_lost() {
    for seed in 0..seeds(200) {
        let mut world = operational(seed);
        every_fourth_is_lost(&mut world);
        for number in 0..2_u32 {
            world.segment.device_mut(0).faults.withholds = true;
            for _ in 0..=number {
                let given_up = read(&mut world, 0x6081, 0);
                assert!(matches!(given_up, Err(SetupError::SdoTimeout { .. })), "{given_up:?}");
            }
            world.segment.device_mut(0).faults.withholds = false;
            let value = number.to_le_bytes();
            assert_eq!(
                write(&mut world, 0x6081, 0, &value),
                Ok(vec![]),
                "seed {seed}, {number}"
            );
            assert_eq!(read(&mut world, 0x6081, 0), Ok(value.to_vec()), "seed {seed}, {number}");
        }
    }
}
