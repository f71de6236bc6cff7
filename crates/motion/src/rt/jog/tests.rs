use super::*;
use crate::rt::otg::tests::{Differences, any_limits, mill};
use proptest::prelude::*;

const CYCLE_S: f64 = 1e-3;

fn limits(range: [f64; 2]) -> JogLimits {
    let (motion, stop) = mill();
    JogLimits { motion, stop, range }
}

/// Two joints of 200 mm, at 0.
fn rig() -> Jog {
    Jog::new(&[limits([-100.0, 100.0]); 2], CYCLE_S)
}

fn steps(jog: &mut Jog, count: usize) -> [f64; 2] {
    let mut positions = [f64::NAN; 2];
    for _ in 0..count {
        jog.step(&mut positions);
    }
    positions
}

fn to_rest(jog: &mut Jog) -> [f64; 2] {
    let mut positions = [f64::NAN; 2];
    for _ in 0..100_000 {
        jog.step(&mut positions);
        if jog.is_at_rest() {
            return positions;
        }
    }
    panic!("still moving");
}

#[test]
fn a_run_ends_at_the_soft_limit_and_a_release_before_it() {
    let mut jog = rig();
    jog.run(0, 50.0);
    jog.run(1, -150.0);
    steps(&mut jog, 500);
    assert!((jog.state(0).unwrap().velocity - 50.0).abs() < 1e-9);
    jog.release(0);
    let rest = to_rest(&mut jog);
    assert!(rest[0] > 20.0 && rest[0] < 30.0, "{rest:?}");
    assert_eq!(rest[1], -100.0);
    // Farther on is not possible, back it is.
    jog.run(1, -10.0);
    assert_eq!(to_rest(&mut jog)[1], -100.0);
    jog.run(1, 10.0);
    assert!(steps(&mut jog, 100)[1] > -100.0);
}

#[test]
fn a_run_said_again_changes_nothing() {
    let (mut once, mut often) = (rig(), rig());
    once.run(0, 150.0);
    for _ in 0..2000 {
        often.run(0, 150.0);
        assert_eq!(steps(&mut once, 1), steps(&mut often, 1));
    }
    assert_eq!(to_rest(&mut often)[0], 100.0);
}

#[test]
fn without_soft_limits_a_run_goes_on() {
    let mut jog = Jog::new(&[limits([f64::NEG_INFINITY, f64::INFINITY]); 2], CYCLE_S);
    jog.run(0, 150.0);
    assert!(steps(&mut jog, 5000)[0] > 700.0);
    jog.release_all();
    to_rest(&mut jog);
}

#[test]
fn increments_add_up_and_end_at_the_limit() {
    let mut jog = rig();
    for _ in 0..5 {
        assert!((jog.advance(0, 0.1, 20.0) - 0.1).abs() < 1e-12);
        steps(&mut jog, 3);
    }
    assert!((to_rest(&mut jog)[0] - 0.5).abs() < 1e-12);
    assert!((jog.advance(0, 150.0, 150.0) - 99.5).abs() < 1e-12);
    assert_eq!(jog.advance(0, 1.0, 150.0), 0.0);
    assert_eq!(to_rest(&mut jog)[0], 100.0);
    assert_eq!(jog.advance(0, f64::NAN, 150.0), 0.0);
    assert_eq!(jog.advance(7, 1.0, 150.0), 0.0);
    assert!(jog.is_at_rest());
}

#[test]
fn an_increment_after_a_run_counts_from_where_the_run_would_have_rested() {
    let mut jog = rig();
    jog.run(0, 100.0);
    steps(&mut jog, 300);
    let mut released = rig();
    released.run(0, 100.0);
    steps(&mut released, 300);
    released.release(0);
    let rest = to_rest(&mut released)[0];
    jog.advance(0, 2.0, 100.0);
    assert!((to_rest(&mut jog)[0] - rest - 2.0).abs() < 1e-9);
}

#[test]
fn behind_a_limit_only_the_way_back_is_open() {
    let mut jog = rig();
    jog.rest_at(&[104.0, 0.0]);
    jog.run(0, 10.0);
    assert_eq!(steps(&mut jog, 50)[0], 104.0);
    assert_eq!(jog.advance(0, 1.0, 10.0), 0.0);
    jog.run(0, -10.0);
    assert!(steps(&mut jog, 1000)[0] < 100.0);
}

#[derive(Clone, Copy, Debug)]
enum Key {
    Run(f64),
    Advance(f64, f64),
    Release,
    Stop,
}

fn any_keys() -> impl Strategy<Value = Vec<(usize, Key, usize)>> {
    let key = prop_oneof![
        4 => (-1.0..=1.0_f64).prop_map(Key::Run),
        3 => (-1.0..=1.0_f64, 0.05..=1.0_f64).prop_map(|(distance, share)| Key::Advance(distance, share)),
        2 => Just(Key::Release),
        1 => Just(Key::Stop),
    ];
    prop::collection::vec((0_usize..2, key, 1_usize..200), 1..25)
}

proptest! {
    /// Any keys at any cycle: the limits are kept by differences, no soft limit is ever passed, and after the last release
    /// both joints come to rest.
    #[test]
    fn limits_hold_for_any_keys(
        (motion, stop) in any_limits(),
        keys in any_keys(),
        length_s in 0.01..2.0_f64,
    ) {
        let range = [-0.2 * motion.velocity * length_s, 0.8 * motion.velocity * length_s];
        let mut jog = Jog::new(&[JogLimits { motion, stop, range }; 2], CYCLE_S);
        let mut differences = [Differences::new(0.0, CYCLE_S), Differences::new(0.0, CYCLE_S)];
        let in_a_stop = MotionLimits {
            acceleration: motion.acceleration.max(stop.acceleration),
            jerk: motion.jerk.max(stop.jerk),
            ..motion
        };
        let mut since_stop = 10;
        let mut step = |jog: &mut Jog| -> Result<(), TestCaseError> {
            let mut positions = [0.0; 2];
            jog.step(&mut positions);
            since_stop = if jog.is_stopping() { 0 } else { since_stop + 1 };
            let allowed = if since_stop < 4 { in_a_stop } else { motion };
            for (differences, position) in differences.iter_mut().zip(positions) {
                prop_assert!(position >= range[0] - 1e-9 && position <= range[1] + 1e-9, "{position} of {range:?}");
                differences.check(position, allowed).map_err(TestCaseError::fail)?;
            }
            Ok(())
        };
        for (joint, key, cycles) in keys {
            match key {
                Key::Run(share) => jog.run(joint, share * motion.velocity),
                Key::Advance(share, speed) => {
                    jog.advance(joint, share * (range[1] - range[0]), speed * motion.velocity);
                }
                Key::Release => jog.release(joint),
                Key::Stop => jog.stop_all(),
            }
            for _ in 0..cycles {
                step(&mut jog)?;
            }
        }
        jog.release_all();
        let mut cycles = 0;
        while !jog.is_at_rest() {
            step(&mut jog)?;
            cycles += 1;
            prop_assert!(cycles < 100_000);
        }
    }
}
