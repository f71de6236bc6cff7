//! A drive whose positions are not increments: a unit is eight of them, a velocity unit a sixtieth of a unit/s.

use super::*;

const UNIT: i64 = 8;

fn rig(position: i64, mode: Mode) -> Rig {
    let mut rig = Rig::with(
        position,
        SHORT,
        AxisConfig {
            mode,
            ..AxisConfig::default()
        },
    );
    for (index, values) in [
        (0x608F, [4000_u32, 1]),
        (0x6091, [2, 1]),
        (0x6092, [1000, 1]),
        (0x6096, [60, 1]),
    ] {
        rig.write(index, 1, values[0]);
        rig.write(index, 2, values[1]);
    }
    rig
}

#[test]
fn positions_and_their_windows_are_units() {
    let mut rig = rig(800, Mode::Csp);
    rig.enable();
    assert_eq!((rig.read::<i32>(0x6064, 0), rig.read::<i32>(0x6063, 0)), (100, 800));
    for step in 1..=50 {
        rig.lead(100 + 2 * step);
    }
    // 2 units a millisecond; the actual position is that of the cycle before.
    assert_eq!((rig.sensors.position, rig.read::<i32>(0x6064, 0)), (1600, 198));
    assert_eq!(
        (rig.read::<i32>(0x6062, 0), rig.read::<i32>(0x60FC, 0)),
        (200, 200 * UNIT as i32)
    );
    assert_eq!(rig.read::<i32>(0x606B, 0), 2000 * 60);
    rig.write(0x607D, 1, 0_i32);
    rig.write(0x607D, 2, 210_i32);
    for _ in 0..10 {
        rig.lead(400);
    }
    assert_eq!(rig.sensors.position, 210 * UNIT);
    rig.write(0x6065, 0, 5_u32);
    rig.write(0x6066, 0, 3_u16);
    rig.blocked = true;
    rig.write(0x607D, 2, i32::MAX);
    for _ in 0..10 {
        rig.lead(214);
    }
    assert_eq!((rig.read::<i32>(0x60F4, 0), rig.axis.fault()), (4, None));
    for _ in 0..10 {
        rig.lead(217);
    }
    assert_eq!(rig.axis.fault(), Some(AxisFault::Drive { error_code: 0x8611 }));
}

#[test]
fn homing_counts_its_point_in_units_and_searches_in_velocity_units() {
    let mut rig = rig(3000, Mode::Csp);
    rig.write(0x6098, 0, 34_i8);
    rig.write(0x607C, 0, 7_i32);
    // 10 increments a millisecond.
    rig.write(0x6099, 2, 10_000 * 60 / UNIT as u32);
    rig.write(0x609A, 0, u32::MAX);
    rig.enable();
    rig.axis.request(Request::Home);
    let mut fastest: f64 = 0.0;
    while rig.axis.homing() != HomingState::Homed {
        rig.lead(0);
        fastest = fastest.max(rig.demand.velocity);
    }
    rig.lead_to(Status::Enabled, 100);
    assert_eq!(fastest, 10_000.0);
    // The mark at 3350 is 418.75 units from where the encoder began.
    let counts = (rig.sensors.position as f64 / UNIT as f64).round() as i32 - 419 - 7;
    assert_eq!(rig.read::<i32>(0x6064, 0), counts);
}

#[test]
fn a_velocity_and_a_profile_are_velocity_units_and_a_latch_is_a_unit() {
    let mut rig = rig(0, Mode::Csv);
    rig.enable();
    rig.write(0x60B8, 0, 0x0011_u16);
    let target = Target {
        velocity: 500 * 60,
        ..Target::default()
    };
    for _ in 0..100 {
        rig.lead(target);
    }
    // 4 increments a period.
    assert_eq!((rig.demand.velocity, rig.sensors.position), (4000.0, 400));
    assert_eq!(rig.read::<i32>(0x606C, 0), 500 * 60);
    // The probe closes at increment 100, 12.5 units.
    assert_eq!(rig.read::<i32>(0x60BA, 0), 13);

    let mut rig = super::profiles::in_mode(mode::PROFILE_POSITION);
    rig.word(0x0000);
    rig.write(0x6092, 1, 1250_u32);
    rig.write(0x6096, 1, 60_u32);
    rig.write(0x6081, 0, 1000 * 60_u32);
    rig.write(0x6083, 0, u32::MAX);
    rig.write(0x6084, 0, u32::MAX);
    rig.write(0x607A, 0, 300_i32);
    for word in [0x0000, 0x0006, 0x0007, 0x000F] {
        for _ in 0..25 {
            rig.word(word);
        }
    }
    rig.word(0x001F);
    let fastest = (0..1000).fold(0.0, |fastest: f64, _| {
        rig.word(0x000F);
        fastest.max(rig.demand.velocity)
    });
    assert_eq!((rig.sensors.position, fastest), (300 * UNIT, 8000.0));
}

#[test]
fn a_velocity_encoder_of_its_own_counts_as_it_was_built() {
    let mut rig = rig(0, Mode::Csv);
    // A hundredth of the increments of the other one; the group says so.
    rig.device = rig.device.clone().with_quirks(Quirks {
        encoders: [[40, 1], [4000, 1]],
        ..Quirks::default()
    });
    rig.write(0x6090, 1, 40_u32);
    rig.enable();
    let target = Target {
        velocity: 500 * 60,
        ..Target::default()
    };
    for _ in 0..10 {
        rig.lead(target);
    }
    assert_eq!(rig.demand.velocity, 4000.0);
}

#[test]
fn a_group_that_cannot_be_computed_with_is_a_parameter_that_is_wrong() {
    let mut rig = rig(0, Mode::Csp);
    // Two primes.
    for (index, values) in [
        (0x6092, [4_294_967_291_u32, 4_294_967_279]),
        (0x6091, [4_294_967_279, 4_294_967_291]),
    ] {
        rig.write(index, 1, values[0]);
        rig.write(index, 2, values[1]);
    }
    rig.lead_to(Status::Disabled, 100);
    rig.axis.request(Request::Enable);
    for _ in 0..100 {
        rig.lead(0);
    }
    assert_eq!(
        rig.axis.fault(),
        Some(AxisFault::Drive {
            error_code: ERROR_PARAMETER
        })
    );
}

#[test]
fn other_units_wait_until_the_torque_is_off() {
    let mut rig = rig(800, Mode::Csp);
    rig.enable();
    rig.write(0x6092, 1, 8000_u32);
    rig.lead(100);
    assert_eq!((rig.sensors.position, rig.read::<i32>(0x6064, 0)), (800, 100));
    rig.axis.request(Request::Disable);
    rig.lead_to(Status::Disabled, 20);
    rig.lead(100);
    assert_eq!(rig.read::<i32>(0x6064, 0), 800);
}
