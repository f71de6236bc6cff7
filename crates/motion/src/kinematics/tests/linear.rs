//! Trivial machines, gantries and CoreXY.

use crate::canon::{Axis, Position};
use crate::kinematics::{Follows, Jet3, Kinematics, ToolFrame, Transform};
use crate::path::Jet;

const OFF: ToolFrame = ToolFrame::OFF;

fn follows(axis: Axis, offset: f64) -> Follows {
    Follows {
        axis: Some(axis),
        offset,
    }
}

#[test]
fn a_gantry_moves_both_joints_and_is_read_from_the_first() {
    let kinematics = Kinematics::trivial(&[Some(Axis::X), Some(Axis::Y), Some(Axis::Y), None]);
    let mut joints = [7.0; 4];
    kinematics
        .inverse(&OFF, &Position::xyz(1.0, 2.0, 3.0).0, &mut joints)
        .unwrap();
    assert_eq!(joints, [1.0, 2.0, 2.0, 0.0]);
    assert_eq!(
        kinematics.forward(&OFF, &[1.0, 2.0, 2.5, 9.0]),
        Some(Position::xyz(1.0, 2.0, 0.0))
    );
    assert!(kinematics.is_trivial(&OFF) && kinematics.is_linear(&OFF) && !kinematics.has_tcp());
}

#[test]
fn each_joint_of_a_gantry_has_its_own_squaring_offset() {
    let joints = [follows(Axis::Y, 0.25), follows(Axis::X, 0.0), follows(Axis::Y, -0.5)];
    let kinematics = Kinematics::new(Transform::Trivial, &joints);
    let mut joints = [0.0; 3];
    kinematics
        .inverse(&OFF, &Position::xyz(10.0, 20.0, 0.0).0, &mut joints)
        .unwrap();
    assert_eq!(joints, [20.25, 10.0, 19.5]);
    assert_eq!(kinematics.forward(&OFF, &joints), Some(Position::xyz(10.0, 20.0, 0.0)));
}

#[test]
fn both_motors_of_a_corexy_pull_x_and_against_each_other_y() {
    let joints = [follows(Axis::X, 0.0), follows(Axis::Y, 0.0), follows(Axis::Z, 0.0)];
    let kinematics = Kinematics::new(Transform::CoreXy, &joints);
    let mut joints = [0.0; 3];
    for (axes, motors) in [
        ([10.0, 0.0, 5.0], [10.0, 10.0, 5.0]),
        ([0.0, 10.0, 5.0], [10.0, -10.0, 5.0]),
        ([7.5, -2.5, -1.0], [5.0, 10.0, -1.0]),
    ] {
        let position = Position::xyz(axes[0], axes[1], axes[2]);
        kinematics.inverse(&OFF, &position.0, &mut joints).unwrap();
        assert_eq!(joints, motors);
        assert_eq!(kinematics.forward(&OFF, &joints), Some(position));
    }
    assert!(!kinematics.is_trivial(&OFF) && kinematics.is_linear(&OFF));
}

#[test]
fn derivatives_go_the_way_of_positions() {
    let joints = [follows(Axis::X, 3.0), follows(Axis::Y, 0.0), follows(Axis::A, 0.0)];
    let mut jet = Jet::default();
    for (axis, values) in [
        (0, [1.0, 2.0, 3.0, 4.0]),
        (1, [10.0, 20.0, 30.0, 40.0]),
        (3, [5.0, 6.0, 7.0, 8.0]),
    ] {
        [jet.q[axis], jet.d1[axis], jet.d2[axis], jet.d3[axis]] = values;
    }
    let mut got = [Jet3::ZERO; 3];
    Kinematics::new(Transform::Trivial, &joints)
        .jets(&OFF, &jet, &mut got)
        .unwrap();
    let a = Jet3::new(5.0, 6.0, 7.0, 8.0);
    assert_eq!(
        got,
        [Jet3::new(4.0, 2.0, 3.0, 4.0), Jet3::new(10.0, 20.0, 30.0, 40.0), a]
    );
    Kinematics::new(Transform::CoreXy, &joints)
        .jets(&OFF, &jet, &mut got)
        .unwrap();
    assert_eq!(
        got,
        [
            Jet3::new(14.0, 22.0, 33.0, 44.0),
            Jet3::new(-9.0, -18.0, -27.0, -36.0),
            a
        ]
    );
}
