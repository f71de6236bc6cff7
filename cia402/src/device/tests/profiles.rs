//! The profile modes, the change between modes, feed-forward and the brake.

use super::*;
use crate::profile::mode;

/// A drive that is enabled in a mode by its controlword alone.
pub(super) fn in_mode(code: i8) -> Rig {
    let mut rig = Rig::new(0, (-1000, 1000));
    rig.write(0x6060, 0, code);
    rig.write(0x6065, 0, u32::MAX);
    for word in [0x0000, 0x0006, 0x0007, 0x000F] {
        for _ in 0..25 {
            rig.word(word);
        }
    }
    assert_eq!(
        (rig.device.state(), rig.read::<i8>(0x6061, 0)),
        (State::OperationEnabled, code)
    );
    rig
}

/// PP with 10,000 counts/s and 1e6 counts/s².
fn positioning() -> Rig {
    let mut rig = in_mode(mode::PROFILE_POSITION);
    rig.write(0x6081, 0, 10_000_u32);
    rig.write(0x6083, 0, 1_000_000_u32);
    rig.write(0x6084, 0, 1_000_000_u32);
    rig
}

const NEW: u16 = 0x001F;
const AT_ONCE: u16 = 0x0020;
const RELATIVE: u16 = 0x0040;
const THROUGH: u16 = 0x0200;

impl Rig {
    /// Hands over a set-point with these bits beside *new*; the statusword that acknowledges it, and the one after.
    fn set_point(&mut self, target: i32, bits: u16) -> [u16; 2] {
        self.write(0x607A, 0, target);
        [NEW | bits, 0x000F | bits].map(|word| self.word(word))
    }

    /// Cycles until bit 10, at most so many; greatest speed on the way.
    fn until_reached(&mut self, bits: u16, cycles: u32) -> f64 {
        let mut fastest: f64 = 0.0;
        for _ in 0..cycles {
            if self.word(0x000F | bits) & 0x0400 != 0 {
                return fastest;
            }
            fastest = fastest.max(self.demand.velocity.abs());
        }
        panic!("never there: {:?}", self.demand);
    }
}

#[test]
fn a_set_point_is_acknowledged_reached_by_the_ramps_and_told() {
    let mut rig = positioning();
    assert_eq!(rig.word(0x000F), 0x0637, "at rest, and no set-point");
    let [taken, after] = rig.set_point(2000, 0);
    assert_eq!([taken & 0x3400, after & 0x3400], [0x1000, 0x0000]);
    assert_eq!(rig.until_reached(0, 1000), 10_000.0);
    assert_eq!(rig.sensors.position, 2000);
    // Bit 4 that stays is no second set-point.
    rig.write(0x607A, 0, 5000_i32);
    rig.word(NEW);
    rig.write(0x607A, 0, 6000_i32);
    for _ in 0..2000 {
        rig.word(NEW);
    }
    assert_eq!(
        (rig.sensors.position, rig.read::<u16>(0x6041, 0) & 0x3400),
        (5000, 0x1400)
    );
}

#[test]
fn one_set_point_waits_and_a_third_is_not_acknowledged_anew() {
    let mut rig = positioning();
    rig.set_point(1000, 0);
    let [taken, after] = rig.set_point(-500, 0);
    assert_eq!(
        [taken & 0x1000, after & 0x1000],
        [0x1000, 0x1000],
        "no room until the first one is reached"
    );
    rig.set_point(9000, 0);
    let mut highest = 0;
    for _ in 0..1000 {
        rig.word(0x000F);
        highest = highest.max(rig.sensors.position);
    }
    assert_eq!((highest, rig.sensors.position), (1000, -500));
    assert_eq!(rig.read::<u16>(0x6041, 0) & 0x1400, 0x0400);
}

#[test]
fn a_set_point_at_once_takes_the_place_of_the_one_under_way() {
    let mut rig = positioning();
    rig.set_point(5000, 0);
    for _ in 0..100 {
        rig.word(0x000F);
    }
    let here = rig.sensors.position;
    assert!((500..1500).contains(&here), "{here}");
    rig.set_point(-300, AT_ONCE);
    rig.until_reached(AT_ONCE, 1000);
    assert_eq!(rig.sensors.position, -300);
    // Relative to where the last one leads, also one that has not been reached.
    rig.set_point(200, RELATIVE | AT_ONCE);
    rig.set_point(200, RELATIVE | AT_ONCE);
    rig.until_reached(RELATIVE | AT_ONCE, 1000);
    assert_eq!(rig.sensors.position, 100);
}

#[test]
fn change_on_set_point_passes_through_without_a_stop_where_the_way_goes_on() {
    for (bits, next, rests) in [(THROUGH, 3000, false), (0, 3000, true), (THROUGH, -3000, true)] {
        let mut rig = positioning();
        rig.set_point(1500, bits);
        rig.set_point(next, bits);
        let mut slowest = f64::INFINITY;
        while rig.sensors.position < 1400 {
            rig.word(0x000F | bits);
        }
        for _ in 0..30 {
            rig.word(0x000F | bits);
            slowest = slowest.min(rig.demand.velocity.abs());
        }
        assert_eq!(slowest < 1000.0, rests, "{bits:#06x} {next}: {slowest}");
        rig.until_reached(bits, 1000);
        assert_eq!(i64::from(next), rig.sensors.position);
    }
}

#[test]
fn halt_rests_on_the_way_and_the_way_goes_on_after_it() {
    let mut rig = positioning();
    rig.set_point(3000, 0);
    for _ in 0..100 {
        rig.word(0x000F);
    }
    for _ in 0..50 {
        rig.word(0x010F);
    }
    let rest = rig.sensors.position;
    assert!(rig.demand.velocity == 0.0 && (500..2900).contains(&rest), "{rest}");
    rig.until_reached(0, 1000);
    assert_eq!(rig.sensors.position, 3000);
}

#[test]
fn soft_limits_and_limit_switches_end_a_profile() {
    let mut rig = positioning();
    rig.write(0x607D, 1, -400_i32);
    rig.write(0x607D, 2, 400_i32);
    rig.set_point(9000, 0);
    rig.until_reached(0, 1000);
    assert_eq!(rig.sensors.position, 400);
    let mut rig = positioning();
    rig.set_point(20_000, 0);
    for _ in 0..3000 {
        rig.word(0x000F);
    }
    assert_eq!(rig.demand.velocity, 0.0);
    assert!((POSITIVE_LIMIT..POSITIVE_LIMIT + 100).contains(&rig.sensors.position));
    assert_eq!(
        rig.read::<u16>(0x6041, 0) & 0x0C00,
        0x0800,
        "internal limit, not reached"
    );
}

proptest! {
    /// From anywhere to anywhere: there exactly, never past it, within speed and both ramps.
    #[test]
    fn every_profile_arrives_within_its_limits(
        targets in prop::collection::vec(-9000..9000_i32, 1..5),
        speed in 1..200_000_u32,
        up in 1000..50_000_000_u32,
        down in 1000..50_000_000_u32,
    ) {
        let mut rig = in_mode(mode::PROFILE_POSITION);
        rig.write(0x6081, 0, speed);
        rig.write(0x6083, 0, up);
        rig.write(0x6084, 0, down);
        rig.turn(0);
        for target in targets {
            let from = rig.sensors.position;
            rig.set_point(target, 0);
            let mut before = rig.demand.velocity;
            for cycle in 0.. {
                let there = rig.word(0x000F) & 0x0400 != 0;
                let velocity = rig.demand.velocity;
                prop_assert!(velocity.abs() <= f64::from(speed) * (1.0 + 1e-9));
                let step = f64::from(if velocity.abs() > before.abs() { up } else { down }) * 0.001;
                prop_assert!((velocity - before).abs() <= step * (1.0 + 1e-6) + 1e-6, "{before} {velocity} {step}");
                let (low, high) = (from.min(target.into()), from.max(target.into()));
                prop_assert!((low..=high).contains(&rig.sensors.position));
                before = velocity;
                if there { break }
                prop_assert!(cycle < 1_000_000, "{:?}", rig.demand);
            }
            prop_assert_eq!(rig.sensors.position, i64::from(target));
        }
    }
}

#[test]
fn a_speed_is_reached_by_its_ramps_and_told() {
    let mut rig = in_mode(mode::PROFILE_VELOCITY);
    rig.write(0x6083, 0, 1_000_000_u32);
    rig.write(0x6084, 0, 500_000_u32);
    assert_eq!(rig.word(0x000F) & 0x3400, 0x1400, "stands, as it is told to");
    rig.write(0x60FF, 0, 10_000_i32);
    let up = (0..100).take_while(|_| rig.word(0x000F) & 0x0400 == 0).count();
    assert!((9..=11).contains(&up), "10 ms at 1e6 counts/s², less the window: {up}");
    assert_eq!(rig.demand.velocity, 10_000.0);
    assert_eq!(rig.word(0x000F) & 0x3400, 0x0400);
    rig.write(0x60FF, 0, 0_i32);
    let down = (0..100).take_while(|_| rig.word(0x000F) & 0x1000 == 0).count();
    assert!((19..=22).contains(&down), "20 ms at half of it: {down}");
    rig.write(0x607F, 0, 4000_u32);
    rig.write(0x60FF, 0, -10_000_i32);
    for _ in 0..50 {
        rig.word(0x000F);
    }
    assert_eq!(
        (rig.demand.velocity, rig.read::<u16>(0x6041, 0) & 0x0C00),
        (-4000.0, 0x0800)
    );
    rig.write(0x607F, 0, u32::MAX);
    rig.write(0x6080, 0, 30_u32);
    rig.write(0x60FF, 0, 10_000_i32);
    for _ in 0..50 {
        rig.word(0x000F);
    }
    assert_eq!(rig.demand.velocity, 5000.0, "30 turns of 10,000 counts a minute");
}

#[test]
fn a_converter_runs_in_turns_a_minute_and_obeys_its_ramp_bits() {
    let mut rig = in_mode(mode::VELOCITY);
    rig.write(0x6046, 1, 6_u32);
    rig.write(0x6046, 2, 60_u32);
    rig.write(0x6042, 0, 30_i16);
    let run = |rig: &mut Rig, word: u16, speed: i16| {
        rig.write(0x6042, 0, speed);
        rig.turn(0);
        for _ in 0..200 {
            rig.word(word);
            rig.sensors.position = 0;
        }
        (rig.demand.velocity, rig.read::<i16>(0x6043, 0))
    };
    assert_eq!(run(&mut rig, 0x000F, 30), (0.0, 0), "the ramp is off");
    assert_eq!(run(&mut rig, 0x007F, 30), (5000.0, 30));
    assert_eq!(run(&mut rig, 0x005F, 0), (5000.0, 30), "locked");
    assert_eq!(run(&mut rig, 0x003F, 30), (0.0, 0), "its input is off");
    assert_eq!(run(&mut rig, 0x007F, -3), (-1000.0, -6), "the least speed");
    assert_eq!(run(&mut rig, 0x007F, 200), (10_000.0, 60), "the greatest one");
    assert_eq!(run(&mut rig, 0x007F, 0), (0.0, 0));
}

#[test]
fn a_torque_is_reached_by_its_slope() {
    let mut rig = in_mode(mode::PROFILE_TORQUE);
    rig.write(0x6087, 0, 5000_u32);
    rig.write(0x6071, 0, -100_i16);
    let steps = (0..100).take_while(|_| rig.word(0x000F) & 0x0400 == 0).count();
    assert_eq!(
        (steps, rig.demand.torque, rig.demand.control),
        (19, -100.0, Control::Torque)
    );
}

#[test]
fn the_controller_hands_over_positions_one_after_the_other() {
    let config = AxisConfig {
        mode: Mode::Pp,
        ..AxisConfig::default()
    };
    let mut rig = Rig::with(0, (-1000, 1000), config);
    rig.write(0x6065, 0, u32::MAX);
    rig.enable();
    for target in [500, -200, 0] {
        rig.lead(target);
        let cycles = (0..500)
            .take_while(|_| {
                rig.lead(target);
                // Bit 10 while bit 12 is clear: there, and ready for the next set-point.
                rig.sensors.position != target || rig.read::<u16>(0x6041, 0) & 0x1400 != 0x0400
            })
            .count();
        assert!((3..500).contains(&cycles), "{cycles}");
        assert_eq!(rig.sensors.position, target);
    }
}

#[test]
fn feed_forward_goes_to_the_position_loop_and_no_further_than_the_mode() {
    let mut rig = Rig::moving(100_000);
    let target = Target {
        position: rig.axis.target_position() + 100,
        velocity: 10_000,
        torque: 70,
    };
    rig.lead(target);
    assert_eq!((rig.demand.feed_forward, rig.demand.torque), (10_000.0, 70.0));
    rig.axis.request(Request::QuickStop);
    rig.lead(target);
    assert_eq!((rig.demand.feed_forward, rig.demand.torque), (0.0, 0.0));
}

#[test]
fn the_brake_is_the_drives_own_unless_it_is_masked_in() {
    let mut rig = Rig::moving(0);
    rig.write(0x60FE, 1, 1_u32);
    rig.lead(0);
    assert!(!rig.demand.brake, "not its business");
    rig.write(0x60FE, 2, 1_u32);
    rig.lead(0);
    assert!(rig.demand.brake);
    rig.write(0x60FE, 1, 0_u32);
    rig.lead(0);
    assert!(!rig.demand.brake);
}
