//! Every combination of the bits that a mode has for itself, against the tables of the profile, spelled out.

extern crate std;

use super::profiles::in_mode;
use super::*;
use crate::profile::mode;
use std::format;
use std::vec::Vec;

/// The bits of a controlword of *enable operation*, by their numbers.
fn with_bits(bits: &[(u16, bool)]) -> u16 {
    let set = bits.iter().filter(|(_, on)| *on);
    set.fold(0x000F, |word, (number, _)| word | 1 << number)
}

/// All values of so many bits.
fn all(bits: u32) -> impl Iterator<Item = Vec<bool>> {
    (0..1_u32 << bits).map(move |value| (0..bits).map(|bit| value >> bit & 1 == 1).collect())
}

fn bit(word: u16, number: u16) -> bool {
    word >> number & 1 == 1
}

/// What a drive in PP is about.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// It stands at 0.
    None,
    /// On its way to 2000.
    One,
    /// On its way to 2000, with 3000 behind it.
    Two,
}

#[test]
fn the_handshake_of_set_points_is_that_of_the_table() {
    let mut cases = 0;
    for way in [Way::None, Way::One, Way::Two] {
        for bit_4_before in [false, true] {
            for bits in all(5) {
                let [new, at_once, relative, halt, through] = bits[..] else {
                    unreachable!()
                };
                let mut rig = in_mode(mode::PROFILE_POSITION);
                rig.write(0x6081, 0, 10_000_u32);
                rig.write(0x6083, 0, 1_000_000_u32);
                rig.write(0x6084, 0, 1_000_000_u32);
                let given: &[i32] = match way {
                    Way::None => &[0],
                    Way::One => &[2000],
                    Way::Two => &[2000, 3000],
                };
                for (number, target) in given.iter().enumerate() {
                    rig.write(0x607A, 0, *target);
                    rig.word(0x001F);
                    if !bit_4_before || number + 1 < given.len() {
                        rig.word(0x000F);
                    }
                }
                for _ in 0..20 {
                    rig.word(if bit_4_before { 0x001F } else { 0x000F });
                }
                rig.write(0x607A, 0, 700_i32);
                let rest = [(5, at_once), (6, relative), (9, through)];
                let word = with_bits(&[&rest[..], &[(4, new), (8, halt)]].concat());
                let case = format!("{way:?}, bit 4 {bit_4_before} before, controlword {word:#06x}");
                let shown = rig.word(word);
                // A rising edge, not halted, and room: with two set-points there is none.
                let taken = new && !bit_4_before && !halt && way != Way::Two;
                let acknowledged = match way {
                    Way::Two => true,
                    // It is shown until bit 4 goes; nothing changes while it is halted.
                    Way::None | Way::One => taken || bit_4_before && (new || halt),
                };
                assert_eq!(bit(shown, 12), acknowledged, "{case}: bit 12 of {shown:#06x}");
                if halt {
                    let moves = way != Way::None;
                    assert_eq!(
                        bit(shown, 10),
                        !moves,
                        "{case}: bit 10 of {shown:#06x}, which moves still"
                    );
                    let stands = (0..50).map(|_| rig.word(word)).last().unwrap();
                    assert!(bit(stands, 10) && rig.demand.velocity == 0.0, "{case}: {stands:#06x}");
                }
                let last = if at_once { 2000 } else { 3000 };
                let end = match (way, taken) {
                    (Way::None, false) => 0,
                    (Way::None, true) => 700,
                    (Way::One, false) => 2000,
                    (Way::One, true) if relative => 2700,
                    (Way::One, true) => 700,
                    (Way::Two, _) => last.max(3000),
                };
                let go = with_bits(&rest);
                let there = (0..2000).map(|_| rig.word(go)).last().unwrap();
                assert_eq!(rig.sensors.position, end, "{case}");
                assert_eq!(
                    [10, 12].map(|number| bit(there, number)),
                    [true, false],
                    "{case}: {there:#06x}"
                );
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 3 * 2 * 32);
}

#[test]
fn the_ramp_of_a_converter_obeys_its_three_bits_and_halt() {
    // Bits 4 (ramp on), 5 (unlocked), 6 (its input), and what the speed comes to: from 600 1/min, with 1200 as the target.
    let table = [
        ([false, false, false], 0),
        ([false, false, true], 0),
        ([false, true, false], 0),
        ([false, true, true], 0),
        ([true, false, false], 600),
        ([true, false, true], 600),
        ([true, true, false], 0),
        ([true, true, true], 1200),
    ];
    for (bits, rpm) in table {
        for halt in [false, true] {
            let mut rig = in_mode(mode::VELOCITY);
            rig.home = (i64::MIN, i64::MIN);
            // Slow enough to stay between the limit switches.
            rig.write(0x608F, 0x01, 60_u32);
            rig.write(0x6048, 1, 60_000_u32);
            rig.write(0x6049, 1, 60_000_u32);
            rig.write(0x6042, 0, 600_i16);
            for _ in 0..100 {
                rig.word(0x007F);
            }
            assert_eq!(rig.demand.velocity, 600.0);
            rig.write(0x6042, 0, 1200_i16);
            let word = with_bits(&[(4, bits[0]), (5, bits[1]), (6, bits[2]), (8, halt)]);
            for _ in 0..100 {
                rig.word(word);
            }
            let wanted = if halt { 0 } else { rpm };
            assert_eq!(rig.demand.velocity, f64::from(wanted), "{word:#06x}");
            assert_eq!(rig.read::<i16>(0x6043, 0), wanted as i16, "{word:#06x}");
        }
    }
}

#[test]
fn speed_reached_and_standstill_are_told_with_and_without_halt() {
    // Target, halt: bits 10 and 12 once nothing changes any more.
    for (target, halt, expected) in [
        (0, false, [true, true]),
        (0, true, [true, true]),
        (5000, false, [true, false]),
        (5000, true, [true, true]),
        (-5000, false, [true, false]),
        (-5000, true, [true, true]),
    ] {
        let mut rig = in_mode(mode::PROFILE_VELOCITY);
        rig.write(0x606D, 0, 10_u16);
        rig.write(0x606F, 0, 10_u16);
        rig.write(0x60FF, 0, target);
        let word = with_bits(&[(8, halt)]);
        let mut shown = 0;
        for _ in 0..30 {
            shown = rig.word(word);
        }
        assert_eq!(
            [10, 12].map(|number| bit(shown, number)),
            expected,
            "{target} {word:#06x}: {shown:#06x}"
        );
        assert!(!bit(shown, 13), "{shown:#06x}");
        // On its way back from there neither is true, but for a drive that stood.
        rig.write(0x60FF, 0, 0);
        rig.write(0x6084, 0, 100_000_u32);
        let shown = rig.word(0x000F);
        let shown = if target != 0 && !halt {
            rig.word(0x000F) & shown
        } else {
            shown
        };
        let stood = target == 0 || halt;
        assert_eq!(
            [10, 12].map(|number| bit(shown, number)),
            [stood, stood],
            "{target} {halt}: {shown:#06x}"
        );
    }
}

#[test]
fn torque_reached_is_told_once_the_slope_is_over() {
    for halt in [false, true] {
        let mut rig = in_mode(mode::PROFILE_TORQUE);
        rig.blocked = true;
        rig.write(0x6087, 0, 10_000_u32);
        rig.write(0x6071, 0, 100_i16);
        let word = with_bits(&[(8, halt)]);
        let shown: Vec<bool> = (0..12).map(|_| bit(rig.word(word), 10)).collect();
        // 10 a period; halted it gets no torque and stands.
        let expected: Vec<bool> = (1..=12).map(|period| halt || period >= 10).collect();
        assert_eq!(shown, expected, "halt {halt}");
        assert_eq!(rig.demand.torque, if halt { 0.0 } else { 100.0 });
    }
}

#[test]
fn homing_shows_the_five_results_of_its_table() {
    /// Bits 13, 12 and 10.
    fn result(word: u16) -> [bool; 3] {
        [13, 12, 10].map(|number| bit(word, number))
    }
    const RUNNING: [bool; 3] = [false, false, false];
    const NOT_STARTED: [bool; 3] = [false, false, true];
    const DONE: [bool; 3] = [false, true, true];
    const ERROR: [bool; 3] = [true, false, true];
    let ready = |method: i8| {
        let mut rig = in_mode(mode::HOMING);
        rig.write(0x6098, 0, method);
        rig.write(0x6099, 1, 10_000_u32);
        rig.write(0x6099, 2, 1000_u32);
        rig
    };
    let until_rest = |rig: &mut Rig, word: u16| (0..200).map(|_| rig.word(word)).last().unwrap();
    // Not started, with and without halt.
    for word in [0x000F, 0x010F, 0x011F] {
        assert_eq!(result(until_rest(&mut ready(34), word)), NOT_STARTED, "{word:#06x}");
    }
    // Running, and then what its bits make of it.
    for (word, end) in [
        (0x001F, DONE),
        (0x000F, NOT_STARTED),
        (0x011F, NOT_STARTED),
        (0x010F, NOT_STARTED),
    ] {
        let mut rig = ready(34);
        rig.word(0x000F);
        for _ in 0..20 {
            assert_eq!(result(rig.word(0x001F)), RUNNING);
        }
        let shown = (0..2000).map(|_| rig.word(word)).last().unwrap();
        assert_eq!(result(shown), end, "{word:#06x}: {shown:#06x}");
        assert_eq!(rig.demand.velocity, 0.0);
    }
    // A method that there is not.
    let mut rig = ready(0);
    rig.word(0x000F);
    assert_eq!(result(until_rest(&mut rig, 0x001F)), ERROR);
    // Only a new edge starts it again.
    rig.write(0x6098, 0, 37_i8);
    assert_eq!(result(until_rest(&mut rig, 0x001F)), ERROR);
    rig.word(0x000F);
    assert_eq!(result(until_rest(&mut rig, 0x001F)), DONE);
}

#[test]
fn interpolation_runs_only_with_its_bit_and_without_halt() {
    for (run, halt, follows) in [
        (false, false, false),
        (false, true, false),
        (true, false, true),
        (true, true, false),
    ] {
        let mut rig = in_mode(mode::INTERPOLATED_POSITION);
        let word = with_bits(&[(4, run), (8, halt)]);
        let mut shown = 0;
        for step in 1..=50 {
            rig.write(0x60C1, 1, 10 * step);
            shown = rig.word(word);
        }
        assert_eq!(bit(shown, 12), follows, "{word:#06x}: {shown:#06x}");
        assert_eq!(rig.sensors.position, if follows { 500 } else { 0 }, "{word:#06x}");
    }
}

/// What keeps a drive of a cyclic mode from following.
#[derive(Clone, Copy, Debug, PartialEq)]
enum InTheWay {
    Nothing,
    Halt,
    /// The limit switch of the side to which it is to move.
    Limit,
    /// The limit switch of the other side.
    OtherLimit,
}

#[test]
fn cyclic_modes_follow_their_target_unless_halt_or_a_limit_is_in_the_way() {
    use InTheWay::{Halt, Limit, Nothing, OtherLimit};
    let mut cases = 0;
    for code in [
        mode::CYCLIC_SYNCHRONOUS_POSITION,
        mode::CYCLIC_SYNCHRONOUS_VELOCITY,
        mode::CYCLIC_SYNCHRONOUS_TORQUE,
    ] {
        for in_the_way in [Nothing, Halt, Limit, OtherLimit] {
            for direction in [-1, 1] {
                // Following error beyond its window: only a position has one.
                for lags in [false, true] {
                    let mut rig = in_mode(code);
                    let place = match in_the_way {
                        Nothing | Halt => 0,
                        Limit => POSITIVE_LIMIT * direction,
                        OtherLimit => -POSITIVE_LIMIT * direction,
                    };
                    for word in [0x0000, 0x0006, 0x0007] {
                        rig.turn(place);
                        for _ in 0..25 {
                            rig.word(word);
                        }
                    }
                    rig.write(0x607A, 0, place as i32);
                    for _ in 0..25 {
                        rig.word(0x000F);
                    }
                    rig.write(0x6065, 0, 20_u32);
                    rig.write(0x6066, 0, u16::MAX);
                    rig.blocked = lags || code == mode::CYCLIC_SYNCHRONOUS_TORQUE;
                    let word = with_bits(&[(8, in_the_way == Halt)]);
                    let mut shown = 0;
                    for step in 1..=5 {
                        rig.write(0x607A, 0, (place + 10 * direction * step) as i32);
                        rig.write(0x60FF, 0, (10_000 * direction) as i32);
                        rig.write(0x6071, 0, (100 * direction) as i16);
                        shown = rig.word(word);
                    }
                    let case = format!("{code} {in_the_way:?} {direction} {lags}: {shown:#06x}");
                    let follows = matches!(in_the_way, Nothing | OtherLimit);
                    assert_eq!(bit(shown, 12), follows, "bit 12, {case}");
                    assert_eq!(bit(shown, 11), in_the_way == Limit, "bit 11, {case}");
                    let far = follows && lags && code == mode::CYCLIC_SYNCHRONOUS_POSITION;
                    assert_eq!(bit(shown, 13), far, "bit 13, {case}");
                    let moved = if follows { direction as f64 } else { 0.0 };
                    let demand = match code {
                        mode::CYCLIC_SYNCHRONOUS_TORQUE => rig.demand.torque / 100.0,
                        _ => rig.demand.velocity / 10_000.0,
                    };
                    assert_eq!(demand, moved, "{case}");
                    cases += 1;
                }
            }
        }
    }
    assert_eq!(cases, 3 * 4 * 2 * 2);
}
