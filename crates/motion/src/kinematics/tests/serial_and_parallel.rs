//! SCARA and linear delta by hand; what they cannot reach, and where they become singular.

use super::{assert_near, machine, position};
use crate::canon::Axis::{C, X, Y, Z};
use crate::canon::Position;
use crate::kinematics::{Elbow, Jet3, Kinematics, LinearDelta, Scara, ToolFrame, Transform, Unreachable};
use crate::path::Jet;

const OFF: ToolFrame = ToolFrame::OFF;

pub(super) fn scara(elbow: Elbow, tool_offset_mm: f64) -> Kinematics {
    let scara = Scara {
        inner_arm_mm: 300.0,
        outer_arm_mm: 200.0,
        tool_offset_mm,
        elbow,
        shoulder_middle_degrees: 0.0,
    };
    machine(Transform::Scara(scara), &[X, Y, Z, C])
}

pub(super) fn delta() -> Kinematics {
    let delta = LinearDelta {
        rod_mm: 250.0,
        radius_mm: 150.0,
        towers: [90.0, -30.0, -150.0].map(LinearDelta::tower),
    };
    machine(Transform::LinearDelta(delta), &[X, Y, Z])
}

#[track_caller]
fn joints<const N: usize>(kinematics: &Kinematics, frame: &ToolFrame, position: &Position) -> [f64; N] {
    let mut joints = [0.0; N];
    assert_eq!(kinematics.inverse(frame, &position.0, &mut joints), Ok(()));
    joints
}

#[test]
fn a_scara_bends_its_elbow_either_way_to_the_same_place() {
    // Inner arm along X, outer arm along Y.
    let place = position(&[(X, 300.0), (Y, 200.0), (Z, -12.0)]);
    let got: [f64; 4] = joints(&scara(Elbow::Positive, 0.0), &OFF, &place);
    assert_near(&got, &[0.0, 90.0, -12.0, -90.0], 1e-12);
    // The mirror image of it about the line from the shoulder to the place, at atan(2/3).
    let line = 2.0_f64.atan2(3.0).to_degrees();
    let got: [f64; 4] = joints(&scara(Elbow::Negative, 0.0), &OFF, &place);
    assert_near(&got, &[2.0 * line, -90.0, -12.0, 90.0 - 2.0 * line], 1e-12);
    // A tool 40 mm in front of the wrist that looks along Y: the wrist stands where it stood.
    let place = position(&[(X, 300.0), (Y, 240.0), (C, 90.0)]);
    let got: [f64; 4] = joints(&scara(Elbow::Positive, 40.0), &OFF, &place);
    assert_near(&got, &[0.0, 90.0, 0.0, 0.0], 1e-12);
}

#[test]
fn the_jump_of_the_shoulder_lies_where_its_travel_is_not() {
    let behind = Scara {
        inner_arm_mm: 300.0,
        outer_arm_mm: 200.0,
        tool_offset_mm: 0.0,
        elbow: Elbow::Positive,
        shoulder_middle_degrees: 200.0,
    };
    let kinematics = machine(Transform::Scara(behind), &[X, Y, Z, C]);
    // Across the negative X axis, where the angle of a vector jumps.
    let shoulder = |y: f64| joints::<4>(&kinematics, &OFF, &Position::xyz(-400.0, y, 0.0))[0];
    assert!((shoulder(0.001) - shoulder(-0.001)).abs() < 0.01);
    for y in [-300.0, -0.001, 0.001, 300.0] {
        assert!((20.0..380.0).contains(&shoulder(y)));
    }
}

#[test]
fn what_a_scara_cannot_reach_is_named_and_its_limits_are_reached() {
    let kinematics = scara(Elbow::Positive, 0.0);
    let mut joints = [7.0; 4];
    for (x, why) in [
        (500.001, "the place is farther away than both arms reach"),
        (99.999, "the place is nearer to the shoulder than folded arms reach"),
    ] {
        let got = kinematics.inverse(&OFF, &Position::xyz(x, 0.0, 0.0).0, &mut joints);
        assert_eq!(got, Err(Unreachable { joint: 1, why }));
        assert_eq!(joints, [7.0; 4]);
    }
    for (x, elbow) in [(500.0, 0.0), (100.0, 180.0)] {
        kinematics
            .inverse(&OFF, &Position::xyz(x, 0.0, 0.0).0, &mut joints)
            .unwrap();
        assert!((joints[1] - elbow).abs() < 1e-5, "{joints:?}");
        // A move along the arms out of there is no matter of time.
        let mut jet = Jet {
            q: Position::xyz(x, 0.0, 0.0).0,
            ..Jet::default()
        };
        jet.d1[0] = 1.0;
        let error = kinematics.jets(&OFF, &jet, &mut [Jet3::ZERO; 4]).unwrap_err();
        assert!(error.why.starts_with("the position is singular"), "{error}");
    }
}

#[test]
fn near_the_line_joints_move_fast_and_the_reason_has_a_name() {
    let kinematics = scara(Elbow::Positive, 0.0);
    let slope = |x: f64| {
        let mut jet = Jet {
            q: Position::xyz(x, 0.0, 0.0).0,
            ..Jet::default()
        };
        jet.d1[0] = 1.0;
        let mut joints = [Jet3::ZERO; 4];
        kinematics.jets(&OFF, &jet, &mut joints).unwrap();
        joints[1].d1.abs()
    };
    assert!(slope(499.99) > 10.0 * slope(490.0) && slope(490.0) > slope(400.0));
    let name = |x: f64| kinematics.singularity(&OFF, &Position::xyz(x, 0.0, 0.0));
    assert_eq!(name(499.9), Some("the arms are nearly stretched"));
    assert_eq!(name(100.1), Some("the arms are nearly folded"));
    assert_eq!(name(400.0), None);
    let level = |y: f64| delta().singularity(&OFF, &Position::xyz(0.0, y, 0.0));
    assert_eq!((level(0.0), level(-99.5)), (None, Some("a rod is nearly level")));
}

#[test]
fn a_delta_stands_on_right_triangles() {
    // 150, 200, 250 with the platform in the middle; 70, 240, 250 for the first tower, 80 mm towards it.
    let got: [f64; 3] = joints(&delta(), &OFF, &Position::xyz(0.0, 0.0, -5.0));
    assert_near(&got, &[195.0; 3], 1e-12);
    let got: [f64; 3] = joints(&delta(), &OFF, &Position::xyz(0.0, 80.0, 0.0));
    let others = 21_600.0_f64.sqrt();
    assert_near(&got, &[240.0, others, others], 1e-12);
    let error = delta().inverse(&OFF, &Position::xyz(0.0, -101.0, 0.0).0, &mut [0.0; 3]);
    assert_eq!(error.unwrap_err().joint, 0);
    assert_eq!(delta().forward(&OFF, &[0.0, 1000.0, 0.0]), None);
}
