use super::*;
use crate::kinematics::{Elbow, Follows, Scara, Transform};
use crate::rt::otg::tests::Differences;
use crate::rt::{MotionLimits, StopLimits};
use proptest::prelude::*;

const CYCLE_S: f64 = 1e-3;

fn limits(velocity: f64, acceleration: f64, jerk: f64, range: [f64; 2]) -> JogLimits {
    JogLimits {
        motion: MotionLimits {
            velocity,
            acceleration,
            jerk,
        },
        stop: StopLimits {
            acceleration: 2.0 * acceleration,
            jerk: 4.0 * jerk,
        },
        range,
    }
}

/// Arms of 300 and 200 mm; shoulder and elbow in degrees, Z in mm, C in degrees.
fn joints() -> [JogLimits; 4] {
    [
        limits(180.0, 1800.0, 36_000.0, [-100.0, 100.0]),
        limits(180.0, 1800.0, 36_000.0, [-150.0, 150.0]),
        limits(200.0, 2000.0, 40_000.0, [-100.0, 0.0]),
        limits(360.0, 3600.0, 72_000.0, [-400.0, 400.0]),
    ]
}

/// At X 300, Y 100, Z -50.
fn scara() -> WorldJog {
    scara_within([f64::NEG_INFINITY, f64::INFINITY])
}

/// The same with a travel of its own for each axis.
fn scara_within(range: [f64; 2]) -> WorldJog {
    let scara = Scara {
        inner_arm_mm: 300.0,
        outer_arm_mm: 200.0,
        tool_offset_mm: 0.0,
        elbow: Elbow::Positive,
        shoulder_middle_degrees: 0.0,
    };
    let follows = [Axis::X, Axis::Y, Axis::Z, Axis::C].map(|axis| Follows {
        axis: Some(axis),
        offset: 0.0,
    });
    let kinematics = Kinematics::new(Transform::Scara(scara), &follows);
    let axis = limits(300.0, 1000.0, 10_000.0, range);
    let mut jog = WorldJog::new(kinematics, &[axis; AXES], &joints(), CYCLE_S);
    assert!(jog.rest_at(&Position::xyz(300.0, 100.0, -50.0), ToolFrame::OFF));
    jog
}

/// Steps and judges every joint.
struct Watch {
    differences: Vec<Differences>,
    joints: [f64; 4],
}

impl Watch {
    fn new(jog: &WorldJog) -> Watch {
        let joints = [jog.joints[0], jog.joints[1], jog.joints[2], jog.joints[3]];
        Watch {
            differences: joints.iter().map(|joint| Differences::new(*joint, CYCLE_S)).collect(),
            joints,
        }
    }

    fn step(&mut self, jog: &mut WorldJog) -> Result<Position, String> {
        let position = jog.step(&mut self.joints);
        for (number, limits) in joints().iter().enumerate() {
            let joint = self.joints[number];
            if !(joint >= limits.range[0] - 1e-9 && joint <= limits.range[1] + 1e-9) {
                return Err(format!("joint {number} is at {joint}"));
            }
            let judged = self.differences[number].check(joint, limits.motion);
            judged.map_err(|over| format!("joint {number} at {position:?}: {over}"))?;
        }
        Ok(position)
    }

    fn until_rest(&mut self, jog: &mut WorldJog) -> Position {
        for _ in 0..200_000 {
            let position = self.step(jog).unwrap();
            if jog.is_at_rest() {
                return position;
            }
        }
        panic!("still moving: {jog:?}");
    }
}

#[test]
fn axes_run_straight_and_as_fast_as_wanted_where_joints_can() {
    let mut jog = scara();
    let mut watch = Watch::new(&jog);
    jog.run(Axis::X, -50.0);
    for _ in 0..1000 {
        watch.step(&mut jog).unwrap();
    }
    let from = watch.step(&mut jog).unwrap();
    let to = watch.step(&mut jog).unwrap();
    assert!((from.0[0] - to.0[0] - 0.05).abs() < 1e-9);
    assert_eq!((to.0[1], to.0[2]), (100.0, -50.0));
    jog.run(Axis::X, 0.0);
    watch.until_rest(&mut jog);
    assert_eq!(jog.obstruction(), None);
}

#[test]
fn an_increment_ends_exactly_where_it_should() {
    let mut jog = scara();
    let mut watch = Watch::new(&jog);
    assert_eq!(jog.advance(Axis::X, -12.5, 80.0), -12.5);
    assert_eq!(jog.advance(Axis::Y, 3.25, 300.0), 3.25);
    let rest = watch.until_rest(&mut jog);
    assert_eq!((rest.0[0], rest.0[1], rest.0[2]), (287.5, 103.25, -50.0));
    // And the joints are there.
    let reached = jog.kinematics.forward(&ToolFrame::OFF, &watch.joints).unwrap();
    for axis in [0, 1, 2] {
        assert!((reached.0[axis] - rest.0[axis]).abs() < 1e-9, "{reached:?}");
    }
    // Orders that come while one is carried out add up; one the other way round turns it back.
    for distance in [10.0, 10.0, -5.0] {
        jog.advance(Axis::X, distance, 50.0);
        for _ in 0..40 {
            watch.step(&mut jog).unwrap();
        }
    }
    assert_eq!(watch.until_rest(&mut jog).0[0], 302.5);
    assert_eq!(jog.advance(Axis::X, f64::NAN, 50.0), 0.0);
    assert_eq!(jog.advance(Axis::X, 5.0, 0.0), 0.0);
    assert!(jog.is_at_rest());
    assert_eq!(jog.obstruction(), None);
}

#[test]
fn an_increment_beyond_the_reach_ends_before_it_and_says_so() {
    let mut jog = scara();
    let mut watch = Watch::new(&jog);
    jog.advance(Axis::X, 400.0, 200.0);
    let rest = watch.until_rest(&mut jog);
    assert!(rest.0[0] > 470.0 && rest.0[0] < 490.0, "{rest:?}");
    assert!(jog.obstruction().is_some());
    jog.advance(Axis::X, -100.0, 200.0);
    let back = watch.until_rest(&mut jog);
    assert_eq!(back.0[0], rest.0[0] - 100.0);
    // Let go in between, it rests where it can.
    jog.advance(Axis::X, -100.0, 50.0);
    for _ in 0..500 {
        watch.step(&mut jog).unwrap();
    }
    jog.release_all();
    let released = watch.until_rest(&mut jog);
    assert!(
        released.0[0] < back.0[0] - 10.0 && released.0[0] > back.0[0] - 60.0,
        "{released:?}"
    );
}

#[test]
fn the_travel_of_an_axis_itself_ends_runs_and_increments_exactly() {
    let mut jog = scara_within([-1000.0, 305.0]);
    let mut watch = Watch::new(&jog);
    jog.run(Axis::X, 60.0);
    for _ in 0..2000 {
        watch.step(&mut jog).unwrap();
    }
    assert_eq!(watch.step(&mut jog).unwrap().0[0], 305.0);
    jog.run(Axis::X, 0.0);
    watch.until_rest(&mut jog);
    jog.run(Axis::X, 60.0);
    assert!(jog.is_at_rest(), "no farther");
    assert_eq!(jog.advance(Axis::X, 2.0, 60.0), 0.0);
    assert_eq!(jog.advance(Axis::X, -2.0, 60.0), -2.0);
    assert_eq!(jog.advance(Axis::X, 7.0, 60.0), 2.0);
    assert_eq!(watch.until_rest(&mut jog).0[0], 305.0);
    assert_eq!(jog.obstruction(), None);
}

#[test]
fn the_end_of_the_reach_is_named_and_not_run_into() {
    let mut jog = scara();
    let mut watch = Watch::new(&jog);
    jog.run(Axis::X, 200.0);
    let rest = watch.until_rest(&mut jog);
    // Both arms in line would be at 489.9; near that the joints become infinitely fast.
    assert!(rest.0[0] > 470.0 && rest.0[0] < 490.0, "{rest:?}");
    assert!(jog.obstruction().is_some());
    // Back it goes.
    jog.run(Axis::X, -100.0);
    for _ in 0..1000 {
        watch.step(&mut jog).unwrap();
    }
    assert!(watch.step(&mut jog).unwrap().0[0] < rest.0[0] - 30.0);
    jog.release_all();
    watch.until_rest(&mut jog);
}

#[test]
fn the_travel_of_a_joint_ends_the_jog_of_all_axes() {
    let mut jog = scara();
    let mut watch = Watch::new(&jog);
    jog.run(Axis::Z, 100.0);
    jog.run(Axis::Y, 10.0);
    let rest = watch.until_rest(&mut jog);
    let travel = Obstruction {
        joint: 2,
        why: Obstacle::Travel,
    };
    assert_eq!(jog.obstruction(), Some(travel));
    assert!(rest.0[2] <= 0.0 && rest.0[2] > -0.5, "{rest:?}");
    assert!(rest.0[1] > 100.0 && rest.0[1] < 110.0);
}

#[test]
fn a_stop_is_quicker_than_a_release() {
    let mut ways = [0.0; 2];
    for (way, hard) in ways.iter_mut().zip([false, true]) {
        let mut jog = scara();
        let mut joints = [0.0; 4];
        jog.run(Axis::X, -100.0);
        let mut position = Position::ZERO;
        for _ in 0..500 {
            position = jog.step(&mut joints);
        }
        let from = position.0[0];
        if hard {
            jog.stop_all();
        } else {
            jog.release_all();
        }
        while !jog.is_at_rest() {
            position = jog.step(&mut joints);
            assert_eq!(jog.is_stopping(), hard);
        }
        *way = from - position.0[0];
    }
    assert!(ways[1] < 0.6 * ways[0], "{ways:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    /// Any wishes at any cycle, into corners and singularities: every joint keeps its limits and its travel, and rests in the end.
    #[test]
    fn joints_keep_their_limits_for_any_wishes(
        wishes in prop::collection::vec((0_usize..4, -300.0..300.0_f64, 1_usize..600, any::<bool>()), 1..12),
    ) {
        let mut jog = scara();
        let mut watch = Watch::new(&jog);
        for (axis, velocity, cycles, by_distance) in wishes {
            let axis = [Axis::X, Axis::Y, Axis::Z, Axis::C][axis];
            if by_distance {
                jog.advance(axis, velocity / 4.0, velocity);
            } else {
                jog.run(axis, velocity);
            }
            for _ in 0..cycles {
                watch.step(&mut jog).map_err(TestCaseError::fail)?;
            }
        }
        jog.release_all();
        let mut cycles = 0;
        while !jog.is_at_rest() {
            watch.step(&mut jog).map_err(TestCaseError::fail)?;
            cycles += 1;
            prop_assert!(cycles < 10_000);
        }
    }
}
