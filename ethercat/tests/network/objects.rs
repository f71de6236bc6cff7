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
