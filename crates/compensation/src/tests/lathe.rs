//! Turning with a nose radius: the part's shape must come out exact. Worked by hand, G18, nose radius 0.8 mm (D1.6).

use super::*;

/// Ends of the moves: Z and X of the controlled point.
fn ends(program: &str) -> Vec<Point> {
    let (mut compensator, mut out) = (Compensator::new(), Vec::new());
    for event in reader::read(program) {
        compensator.push(event, &mut out).expect("fits");
    }
    compensator.finish(&mut out).expect("fits");
    let ends = out.iter().filter_map(|event| end_of(&event.call));
    ends.map(|to| in_plane(to, Plane::Zx)).collect()
}

fn assert_near(actual: &[Point], expected: &[Point], what: &str) {
    assert_eq!(actual.len(), expected.len(), "{what}: {actual:?}");
    for (a, b) in actual.iter().zip(expected) {
        assert!(length(sub(*a, *b)) < 1e-9, "{what}: {actual:?}\n{expected:?}");
    }
}

/// From the nose's centre to the controlled point, in nose radii, as LinuxCNC has it: Z and X.
const SHIFTS: [(u8, Point); 10] = [
    (0, [0.0, 0.0]),
    (1, [1.0, -1.0]),
    (2, [-1.0, -1.0]),
    (3, [-1.0, 1.0]),
    (4, [1.0, 1.0]),
    (5, [1.0, 0.0]),
    (6, [0.0, -1.0]),
    (7, [-1.0, 0.0]),
    (8, [0.0, 1.0]),
    (9, [0.0, 0.0]),
];

/// A cylinder of radius 10 up to Z-10, then a cone of 45 degrees up to radius 20. The tool comes from the right, outside:
/// on the right hand of the motion, G42 (first axis Z, second X, X upwards).
#[test]
fn a_cone_comes_out_exact_with_every_orientation() {
    let r = 0.8;
    for (orientation, [z, x]) in SHIFTS {
        let program = format!("G0 X10 Z5\nG18\nG42.1 D1.6 L{orientation}\nG1 Z2\nZ-10\nX20 Z-20\nG40\nG0 X30 Z-20");
        // The inner corner between both: the centre is r above the cylinder, and on the line beside the cone, which is
        // r square to it: 45 degrees, so that it comes to its corner r (sqrt 2 - 1) later than the contour.
        let corner = [-10.0 + r * (2f64.sqrt() - 1.0), 10.0 + r];
        let square = r * 0.5f64.sqrt();
        let shifted = |[a, b]: Point| [a + r * z, b + r * x];
        let expected = [
            [5.0, 10.0],
            shifted([2.0, 10.0 + r]),
            shifted(corner),
            shifted([-20.0 + square, 20.0 + square]),
            [-20.0, 30.0],
        ];
        assert_near(&ends(&program), &expected, &format!("L{orientation}"));
    }
}

/// What the controlled point would do without compensation: with orientation 2 cylinder and face are right, and the nose
/// leaves r (2 - sqrt 2) / 2 square to a cone of 45 degrees.
#[test]
fn cylinder_and_face_need_no_compensation_with_orientation_2() {
    let program = "G0 X20 Z5\nG18\nG42.1 D1.6 L2\nG1 X10\nZ-10\nX20\nG40\nG0 X30";
    let path = ends(program);
    // Beside the cylinder the controlled point has its radius; beside the face at Z-10 it has its Z.
    assert!(
        (path[2][1] - 10.0).abs() < 1e-9 && (path[2][0] + 10.0).abs() < 1e-9,
        "{path:?}"
    );
    assert!((path[3][0] + 10.0).abs() < 1e-9, "{path:?}");
}

/// A ball of radius 10 about Z-10 on the spindle's axis, from its pole, then a cylinder.
#[test]
fn a_ball_comes_out_exact() {
    let r = 0.8;
    // Clockwise in Z, X as the printed arcs have it: from the pole up to the equator.
    let program = "G0 X0 Z5\nG18\nG42.1 D1.6 L2\nG1 X-2 Z0\nX0\nG3 X10 Z-10 K-10\nG1 Z-20\nG40\nG0 X30";
    let path = ends(program);
    let shifted = |[a, b]: Point| [a - r, b - r];
    let expected = [
        [5.0, 0.0],
        shifted([r, -2.0]),
        shifted([r, 0.0]),
        shifted([-10.0, 10.0 + r]),
        shifted([-20.0, 10.0 + r]),
        [-20.0, 30.0],
    ];
    let at: Vec<Point> = path.iter().copied().filter(|at| *at != path[1]).collect();
    let want: Vec<Point> = expected.iter().copied().filter(|at| *at != expected[1]).collect();
    assert_near(&at, &want, "ball");
    // The nose's centre goes about the ball's: 10.8 from it, all the way.
    let (mut compensator, mut out) = (Compensator::new(), Vec::new());
    for event in reader::read(program) {
        compensator.push(event, &mut out).expect("fits");
    }
    let arc = out.iter().find_map(|event| match event.call {
        Call::ArcFeed { centre_mm, .. } => Some(centre_mm),
        _ => None,
    });
    assert_near(&[arc.expect("an arc")], &[shifted([-10.0, 0.0])], "centre");
}
