//! Table-table and head-table by hand, and against products of 4 × 4 matrices computed elsewhere.

use super::{assert_near, machine, position, tcp};
use crate::canon::Axis::{A, B, C, X, Y, Z};
use crate::canon::{Axis, Position};
use crate::kinematics::{
    Hand, HeadTable, Kinematics, Rotary, RotaryAxis, TableTable, ToolFrame, Transform, Unreachable,
};

fn rotary(axis: RotaryAxis, hand: Hand, centre_mm: [f64; 3]) -> Rotary {
    Rotary { axis, hand, centre_mm }
}

/// A/C trunnion: x-rot-point 3, y-rot-point 5, z-rot-point -20, y-offset 12, z-offset 8 in LinuxCNC's terms.
pub(super) fn trunnion(hand: Hand) -> Kinematics {
    let table = TableTable {
        primary: rotary(RotaryAxis::A, hand, [0.0, 17.0, -12.0]),
        secondary: rotary(RotaryAxis::C, hand, [3.0, 5.0, 0.0]),
    };
    machine(Transform::TableTable(table), &[X, Y, Z, A, C])
}

pub(super) fn trunnion_bc() -> Kinematics {
    let table = TableTable {
        primary: rotary(RotaryAxis::B, Hand::Left, [-4.0, 0.0, -12.0]),
        secondary: rotary(RotaryAxis::C, Hand::Left, [3.0, 5.0, 0.0]),
    };
    machine(Transform::TableTable(table), &[X, Y, Z, B, C])
}

pub(super) fn swivel_head() -> Kinematics {
    let head = HeadTable {
        head: rotary(RotaryAxis::B, Hand::Right, [0.0; 3]),
        pivot_mm: [2.0, -1.0, 150.0],
        table: rotary(RotaryAxis::C, Hand::Left, [3.0, 5.0, 0.0]),
    };
    machine(Transform::HeadTable(head), &[X, Y, Z, B, C])
}

#[track_caller]
fn joints(kinematics: &Kinematics, frame: &ToolFrame, position: &Position) -> [f64; 5] {
    let mut joints = [0.0; 5];
    assert_eq!(kinematics.inverse(frame, &position.0, &mut joints), Ok(()));
    joints
}

#[test]
fn a_trunnion_at_a_right_angle_brings_the_top_of_the_work_to_the_side() {
    let centred = |hand| {
        let table = TableTable {
            primary: rotary(RotaryAxis::A, hand, [0.0; 3]),
            secondary: rotary(RotaryAxis::C, hand, [0.0; 3]),
        };
        machine(Transform::TableTable(table), &[X, Y, Z, A, C])
    };
    // A tip 10 above the centre, tool 50: Z60 after G43. A90 right-handed tips +Z to -Y.
    let top = position(&[(Z, 60.0), (A, 90.0)]);
    let right = joints(&centred(Hand::Right), &tcp(50.0), &top);
    assert_near(&right, &[0.0, -10.0, 50.0, 90.0, 0.0], 1e-12);
    let left = joints(&centred(Hand::Left), &tcp(50.0), &top);
    assert_near(&left, &[0.0, 10.0, 50.0, 90.0, 0.0], 1e-12);
    // C90 right-handed carries +X to +Y; then A90 lays it down to +Z.
    let side = position(&[(X, 20.0), (A, 90.0), (C, 90.0)]);
    let got = joints(&centred(Hand::Right), &tcp(0.0), &side);
    assert_near(&got, &[0.0, 0.0, 20.0, 90.0, 90.0], 1e-12);
}

#[test]
fn a_head_at_a_right_angle_lies_beside_its_tip() {
    let head = HeadTable {
        head: rotary(RotaryAxis::B, Hand::Right, [0.0; 3]),
        pivot_mm: [0.0, 0.0, 150.0],
        table: rotary(RotaryAxis::C, Hand::Left, [0.0; 3]),
    };
    let machine = machine(Transform::HeadTable(head), &[X, Y, Z, B, C]);
    // B90 right-handed turns the tool, which pointed to -Z, to -X: the pivot lies at X 150 + 50, as high as the tip.
    let got = joints(&machine, &tcp(50.0), &position(&[(Z, 50.0), (B, 90.0)]));
    assert_near(&got, &[200.0, 0.0, -150.0, 90.0, 0.0], 1e-12);
    // The table turned left-handed by C90: what lay at +X lies at -Y.
    let got = joints(&machine, &tcp(50.0), &position(&[(X, 10.0), (Z, 50.0), (C, 90.0)]));
    assert_near(&got, &[0.0, -10.0, 50.0, 0.0, 90.0], 1e-12);
}

#[test]
fn joints_are_those_of_products_of_matrices() {
    let at = |rotary: &[(Axis, f64)]| {
        let mut position = position(&[(X, 11.0), (Y, -7.0), (Z, 45.0)]);
        for &(axis, degrees) in rotary {
            position[axis] = degrees;
        }
        position
    };
    let linear = |kinematics: &Kinematics, rotary: &[(Axis, f64)]| {
        let got = joints(kinematics, &tcp(60.0), &at(rotary));
        [got[0], got[1], got[2]]
    };
    // The first one is what the formulas of LinuxCNC's xyzac-trt give, too.
    let got = linear(&trunnion(Hand::Right), &[(A, 35.0), (C, -110.0)]);
    assert_near(
        &got,
        &[-11.01247259603625, 6.094893722143606, 36.701838612982556],
        1e-12,
    );
    let got = linear(&trunnion(Hand::Left), &[(A, 35.0), (C, -110.0)]);
    assert_near(&got, &[11.540150302825552, 14.969453205158246, 45.7594804061514], 1e-12);
    let got = linear(&trunnion_bc(), &[(B, 50.0), (C, 70.0)]);
    assert_near(
        &got,
        &[-2.691856202354302, -6.621782686195293, 44.89181358989286],
        1e-12,
    );
    let got = linear(&swivel_head(), &[(B, 25.0), (C, 70.0)]);
    assert_near(
        &got,
        &[83.02230023679463, -6.621782686195293, 24.479398754215083],
        1e-12,
    );
}

#[test]
fn without_tool_centre_point_control_and_at_zero_angles_joints_are_axes() {
    for kinematics in [trunnion(Hand::Left), trunnion_bc(), swivel_head()] {
        let turned = Position([11.0, -7.0, 45.0, 35.0, 35.0, -110.0, 0.0, 0.0, 0.0]);
        assert_eq!(
            joints(&kinematics, &ToolFrame::OFF, &turned),
            [11.0, -7.0, 45.0, 35.0, -110.0]
        );
        assert!(kinematics.is_trivial(&ToolFrame::OFF) && !kinematics.is_linear(&tcp(0.0)) && kinematics.has_tcp());
        for length_mm in [0.0, 60.0, -3.0] {
            let upright = Position::xyz(11.0, -7.0, 45.0);
            assert_near(
                &joints(&kinematics, &tcp(length_mm), &upright),
                &[11.0, -7.0, 45.0, 0.0, 0.0],
                1e-12,
            );
        }
    }
}

#[test]
fn switching_the_frame_moves_no_joint() {
    let kinematics = trunnion(Hand::Left);
    let before = Position([11.0, -7.0, 45.0, 35.0, 0.0, -110.0, 0.0, 0.0, 0.0]);
    let (off, on, longer) = (ToolFrame::OFF, tcp(60.0), tcp(75.0));
    let mut now = before;
    let mut from = off;
    for to in [on, longer, off] {
        now = kinematics.reframe(&now, &from, &to).unwrap();
        assert_near(
            &joints(&kinematics, &to, &now),
            &joints(&kinematics, &off, &before),
            1e-11,
        );
        from = to;
    }
    assert_near(&now.0, &before.0, 1e-11);
    // With tool-centre-point control the position is another one, unless the table lies at zero.
    let there = kinematics.reframe(&before, &off, &on).unwrap();
    assert!((there[X] - before[X]).abs() > 1.0, "{there:?}");
    let none: Result<Position, Unreachable> = kinematics.reframe(&Position::xyz(1.0, 2.0, 3.0), &off, &on);
    assert_near(&none.unwrap().0, &Position::xyz(1.0, 2.0, 3.0).0, 1e-12);
}
