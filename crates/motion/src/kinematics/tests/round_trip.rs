//! All families: there and back, and derivatives against differences, at random places and with random tools.

use super::five_axis::{swivel_head, trunnion, trunnion_bc};
use super::serial_and_parallel::{delta, scara};
use super::{differences, machine, tcp};
use crate::canon::Axis::{C, X, Y, Z};
use crate::canon::{AXES, Position};
use crate::kinematics::{Elbow, Hand, JOINTS, Jet3, Kinematics, ToolFrame, Transform};
use crate::path::Jet;
use proptest::prelude::*;

/// A machine, how its tool is held, and a place that it can take.
#[derive(Clone, Debug)]
struct Case {
    kinematics: Kinematics,
    frame: ToolFrame,
    place: Position,
}

/// Places in all octants; angles of more than a turn.
fn five_axis() -> impl Strategy<Value = Case> {
    let machines = prop::sample::select(vec![
        trunnion(Hand::Left),
        trunnion(Hand::Right),
        trunnion_bc(),
        swivel_head(),
    ]);
    let place = (
        [-300.0..300.0, -300.0..300.0, -300.0..300.0],
        -120.0..120.0,
        -720.0..720.0,
    );
    (machines, place, -50.0..250.0, any::<bool>()).prop_map(|(kinematics, ([x, y, z], tilt, c), length_mm, on)| {
        let mut place = Position::xyz(x, y, z);
        let tilting = [3, 4]
            .into_iter()
            .find(|&axis| kinematics.joint_of(crate::canon::Axis::ALL[axis]).is_some());
        place.0[tilting.unwrap_or(3)] = tilt;
        place[C] = c;
        let frame = if on { tcp(length_mm) } else { ToolFrame::OFF };
        Case {
            kinematics,
            frame,
            place,
        }
    })
}

/// Not nearer to a singularity than a few degrees of the elbow.
fn arms() -> impl Strategy<Value = Case> {
    (
        prop::sample::select(vec![0.0, 40.0]),
        105.0..495.0,
        -140.0..140.0_f64,
        -90.0..90.0,
        -360.0..360.0,
        any::<bool>(),
    )
        .prop_map(|(tool, r, direction, z, c, back): (f64, f64, f64, f64, f64, bool)| {
            let (sin, cos) = direction.to_radians().sin_cos();
            let (sin_c, cos_c) = c.to_radians().sin_cos();
            let mut place = Position::xyz(r * cos + tool * cos_c, r * sin + tool * sin_c, z);
            place[C] = c;
            let elbow = if back { Elbow::Negative } else { Elbow::Positive };
            Case {
                kinematics: scara(elbow, tool),
                frame: ToolFrame::OFF,
                place,
            }
        })
}

fn rods() -> impl Strategy<Value = Case> {
    (0.0..90.0, 0.0..360.0_f64, -200.0..200.0).prop_map(|(r, direction, z): (f64, f64, f64)| {
        let (sin, cos) = direction.to_radians().sin_cos();
        let place = Position::xyz(r * cos, r * sin, z);
        Case {
            kinematics: delta(),
            frame: ToolFrame::OFF,
            place,
        }
    })
}

fn belts() -> impl Strategy<Value = Case> {
    [-300.0..300.0, -300.0..300.0, -300.0..300.0].prop_map(|[x, y, z]| Case {
        kinematics: machine(Transform::CoreXy, &[X, Y, Z]),
        frame: ToolFrame::OFF,
        place: Position::xyz(x, y, z),
    })
}

fn any_family() -> impl Strategy<Value = Case> {
    prop_oneof![five_axis(), arms(), rods(), belts()]
}

fn inverse(case: &Case, axes: &[f64; AXES]) -> [f64; JOINTS] {
    let mut joints = [0.0; JOINTS];
    let count = case.kinematics.joints().len();
    case.kinematics
        .inverse(&case.frame, axes, &mut joints[..count])
        .expect("a place that can be reached");
    joints
}

proptest! {
    #[test]
    fn forward_undoes_inverse_and_inverse_forward(case in any_family()) {
        let joints = inverse(&case, &case.place.0);
        let count = case.kinematics.joints().len();
        let place = case.kinematics.forward(&case.frame, &joints[..count]).expect("a place");
        for (got, wanted) in place.0.iter().zip(case.place.0) {
            prop_assert!((got - wanted).abs() < 1e-9, "{:?} for {:?}", place, case.place);
        }
        let again = inverse(&case, &place.0);
        for (got, wanted) in again.iter().zip(joints) {
            prop_assert!((got - wanted).abs() < 1e-9, "{:?} for {:?}", again, joints);
        }
    }

    #[test]
    fn derivatives_of_joints_are_those_of_differences(
        case in any_family(),
        d1 in [-1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0],
        d2 in [-0.1..0.1, -0.1..0.1, -0.1..0.1, -0.1..0.1],
        d3 in [-0.05..0.05, -0.05..0.05, -0.05..0.05, -0.05..0.05],
    ) {
        // X, Y, Z and whichever rotary axes there are.
        let pick = |d: [f64; 4]| [d[0], d[1], d[2], d[3], d[3], -d[3], 0.0, 0.0, 0.0];
        let jet = Jet { q: case.place.0, d1: pick(d1), d2: pick(d2), d3: pick(d3) };
        let count = case.kinematics.joints().len();
        let mut joints = [Jet3::ZERO; JOINTS];
        case.kinematics.jets(&case.frame, &jet, &mut joints[..count]).unwrap();
        let at = |s: f64| inverse(&case, &std::array::from_fn(|k| {
            jet.q[k] + s * (jet.d1[k] + s * (jet.d2[k] / 2.0 + s * jet.d3[k] / 6.0))
        }));
        prop_assert_eq!(joints.map(|joint| joint.q), at(0.0));
        for (k, joint) in joints[..count].iter().enumerate() {
            // An arm that turns past the end of its full turn goes on at the other one.
            let turns = |q: f64| 360.0 * ((q - joint.q) / 360.0).round();
            let wanted = differences(|s| at(s)[k] - turns(at(s)[k]), 0.2);
            for (got, (wanted, tolerance)) in [joint.d1, joint.d2, joint.d3].into_iter().zip(wanted.into_iter().zip([1e-8, 1e-7, 1e-5])) {
                prop_assert!((got - wanted).abs() < tolerance * (1.0 + wanted.abs()), "joint {}: {} for {}", k, got, wanted);
            }
        }
    }
}
