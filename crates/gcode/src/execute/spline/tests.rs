use super::biarc::{distance_mm, pieces};
use super::*;
use crate::printed::{printed, printed_with};
use crate::{NoMachine, Settings};
use proptest::prelude::*;

fn with_arcs(program: &str) -> String {
    let splines = Splines::Arcs { tolerance_mm: 0.001 };
    let settings = Settings {
        splines,
        ..Settings::default()
    };
    printed_with(program, settings, NoMachine)
}

#[test]
fn curves_are_told_as_linuxcnc_tells_them() {
    let program = "F100\nG5 X10 Y10 I5 J0 P0 Q-5\nG5 X20 Y0 P-5 Q5\nG5.1 X30 Y0 I5 J5\n\
                   G5.2 P1 L3\nX0 Y1 P1\nX2 Y2 P2\nX2 Y0 P1\nG5.3\n(debug,#5420 #5421)\nM2\n";
    assert_eq!(
        printed(program),
        "SET_FEED_RATE(100.0000)\nNURBS_G5_FEED(4, ...)\nNURBS_G5_FEED(4, ...)\nNURBS_G5_FEED(3, ...)\n\
         NURBS_G5_FEED(4, ...)\nMESSAGE(\"2.000000 0.000000\")\n"
    );
}

#[test]
fn a_g5_without_i_and_j_goes_on_smoothly() {
    let mut run =
        crate::Interpreter::new(Settings::default()).run(b"F100\nG5 X10 Y10 I5 J0 P0 Q-5\nG5 X20 Y0 P-5 Q5\nM2\n");
    let points = run.by_ref().filter_map(|event| match event.unwrap().call {
        Call::NurbsFeed { points, .. } => Some(points),
        _ => None,
    });
    let second: Vec<[f64; 2]> = points.last().unwrap().into_iter().map(|(point, _)| point).collect();
    assert_eq!(second, [[10.0, 10.0], [10.0, 15.0], [15.0, 5.0], [20.0, 0.0]]);
}

#[test]
fn g5_keeps_the_modal_motion_and_g5_3_ends_it() {
    let shown = printed("F100 G0 X0\nG5 X1 Y1 I1 J1 P1 Q1\nX5\nG5.2 X1 Y1 P1\nX2 Y0 P1\nG5.3\nX7\nM2\n");
    assert!(shown.contains("STRAIGHT_TRAVERSE(5.0000, 1.0000, "), "{shown}");
    assert!(
        shown.ends_with("7:1: X needs a motion code: none is active (G0, G1, ...)\n"),
        "{shown}"
    );
}

#[test]
fn every_rule_has_its_error() {
    for (program, error) in [
        (
            "G18 G5 X1 Y1 I1 J1 P1 Q1",
            "2:5: this curve cannot lie in the plane G18: G5 and G5.1 take G17",
        ),
        (
            "G41.1 D1 G5.1 X1 Y1 I1 J1",
            "2:10: a curve (G5 to G5.3) cannot be followed",
        ),
        ("G5 X1 Y1 I1 J1 P1 Q1 A3", "2:22: A cannot move along a curve"),
        ("G5 X1 Y1 I1 P1 Q1", "2:1: G5 takes both I and J"),
        (
            "G5.1 X1 Y1 J1",
            "2:1: G5.1 takes both I and J, the way from the start to the first control point: I is missing",
        ),
        (
            "G5 X1 Y1 I1 J1 P1",
            "2:1: G5 needs P and Q, the way from the end to the last control point: Q is missing",
        ),
        ("G5 I1 J1 P1 Q1", "2:1: G5 needs at least one axis word"),
        ("F0 G5.1 X1 I1 J1", "2:4: G5.1 needs a feed"),
        ("F0 G5.2 X1 Y1 P1", "2:4: G5.2 needs a feed"),
        (
            "G5.2 X1 P1",
            "2:1: a control point of G5.2 needs both axes of the plane: Y is missing",
        ),
        ("G5.2 X1 Y1 P0", "2:12: P0 is no weight"),
        ("G5.2 X1 Y1 P1 L3.5", "2:15: L3.5 is no order"),
        ("G5.2 P1\nG5.2 P1", "3:1: P alone is the weight of the start"),
        ("G5.2 P1\nX1 Y1", "3:1: a control point of G5.2 needs P"),
        (
            "G5.2 X1 Y1 P1 L4\nX2 Y2 P1\nG5.3",
            "4:1: a curve of order 4 (L) needs 4 control points at least, with the start: there are 3",
        ),
        ("G5.3", "2:1: G5.3 ends a curve that G5.2 began"),
        (
            "G5.2 X1 Y1 P1\nG1 X5",
            "3:1: the curve begun with G5.2 has 2 control points and no end",
        ),
        (
            "G5.2 X1 Y1 P1",
            "3:1: the curve begun with G5.2 has 2 control points and no end",
        ),
        (
            "G5.2 X1 Y1 P1\nX2 Y2 P1\nG5.3 X1",
            "4:6: G5.3 and G6.3 only end the curve",
        ),
        ("G17.1 G5.2 U1 V1 P1", "2:7: this curve cannot lie in the plane"),
        (
            "G18 G5.2 X1 Z1 Y1 P1",
            "2:16: Y cannot move along a curve, which takes Z and X only",
        ),
        (
            "G18 G5.2 Z1 P1",
            "2:5: a control point of G5.2 needs both axes of the plane: X is missing",
        ),
        (
            "G5.2 X1 Y1 P1\nG18\nX1 Z1 P1",
            "4:1: the plane has changed since this curve was begun",
        ),
        ("F0 G6.2 X1 Y1 R1 K0 P3", "2:4: G6.2 needs a feed"),
        ("G6.2 X1 Y1 R1 K0 Q1", "2:1: the first line of G6.2 needs P"),
        ("G6.2 X1 Y1 R1 K0 P1.5", "2:18: P1.5 is no order"),
        ("G6.2 X1 Y1 R1 K0 P3 Q4", "2:21: Q4 of G6.2 is 1, 2 or 3"),
        ("G6.2 X1 Y1 R0 K0 P3", "2:12: R0 is no weight"),
        ("G6.2 X1 Y1 R1 P3", "2:1: G6.2 needs K"),
        (
            "G6.2 X1 R1 K0 P3",
            "2:1: a control point of G6.2 needs both axes of the plane: Y is missing",
        ),
        ("G6.2 X1 Y1 K1 P3\nX2 Y2 K0", "3:7: K0 is below the knot before, K1"),
        (
            "G6.2 X1 Y1 K1 P3\nK1\nX2 Y2 K1",
            "4:1: a control point behind a knot alone",
        ),
        (
            "G6.2 X1 Y1 K0 P3\nX2 Y2 K0\nK0\nK0",
            "5:1: the last knot has come 3 times, and there are 2 control points and 4 knots",
        ),
        (
            "G6.2 X1 Y1 K0 P2\nX2 Y2 K1\nX3 Y3 K2\nK3\nK3",
            "6:1: the first knot must come 2 times",
        ),
        (
            "G6.2 X1 Y1 K0 P3\nG1 X5",
            "3:1: the curve begun with G6.2 has 1 control points and no end",
        ),
        (
            "G6.2 X1 Y1 K0 P3",
            "3:1: the curve begun with G6.2 has 1 control points and no end",
        ),
        (
            "G6.2 X1 Y1 K0 P3\nG6.3",
            "3:1: the curve begun with G6.2 has 1 control points and no end",
        ),
        ("G6.2 X1 Y1 K0 P3\nG5.2 X1 Y1 P1", "3:1: the curve begun with G6.2"),
        ("G5.2 X1 Y1 P1\nG6.2 X1 Y1 K0 P3", "3:1: the curve begun with G5.2"),
    ] {
        let shown = printed(&format!("F100\n{program}\nM2\n"));
        assert!(shown.lines().any(|line| line.starts_with(error)), "{program}: {shown}");
    }
}

#[test]
fn arcs_of_a_straight_curve_are_lines_to_its_end() {
    let shown = with_arcs("F100\nG5.1 X10 Y10 Z0 I5 J5\nM2\n");
    assert!(shown.contains("Z cannot move along a curve"), "{shown}");
    let shown = with_arcs("F100 G0 Z3\nG5.1 X10 Y10 I5 J5\nM2\n");
    let last = shown.lines().last();
    assert_eq!(
        last,
        Some("STRAIGHT_FEED(10.0000, 10.0000, 3.0000, 0.0000, 0.0000, 0.0000)"),
        "{shown}"
    );
    assert!(!shown.contains("ARC"), "{shown}");
}

#[test]
fn arcs_take_the_time_that_g93_names() {
    let mut feed_mm_s = 0.0;
    let (mut time_s, mut at) = (0.0, [0.0, 0.0]);
    let splines = Splines::Arcs { tolerance_mm: 0.001 };
    let settings = Settings {
        splines,
        ..Settings::default()
    };
    for event in crate::Interpreter::new(settings).run(b"G93\nG5 X10 Y10 I8 J0 P0 Q-8 F2\nM2\n") {
        match event.unwrap().call {
            Call::SetFeedRate { linear, .. } if linear > 0.0 => feed_mm_s = linear,
            Call::ArcFeed {
                to, centre_mm, turns, ..
            } => {
                let to = in_plane(to, Plane::Xy);
                let arc = super::super::circle::Arc { centre_mm, turns };
                time_s += super::super::circle::length_mm(arc, at, to) / feed_mm_s;
                at = to;
            }
            _ => {}
        }
    }
    assert!((time_s - 30.0).abs() < 1e-9, "{time_s}");
    assert_eq!(at, [10.0, 10.0]);
}

#[test]
fn a_timed_curve_takes_the_time_that_g93_names() {
    let settings = |splines| Settings {
        splines,
        ..Settings::default()
    };
    // y = x² / 40 from X-20 to X20, whose length is 20 (sqrt 2 + asinh 1), in half a minute.
    let program = b"G0 X-20 Y10\nG93\nG5.1 X20 Y10 I20 J-20 F2\nM2\n";
    let feeds = |splines| -> Vec<f64> {
        crate::Interpreter::new(settings(splines))
            .run(program)
            .filter_map(|event| match event.unwrap().call {
                Call::SetFeedRate { linear, .. } if linear > 0.0 => Some(linear),
                _ => None,
            })
            .collect()
    };
    assert_eq!(feeds(Splines::Nurbs), []);
    let length = 20.0 * (2.0_f64.sqrt() + 1.0_f64.asinh());
    let [feed] = feeds(Splines::Timed)[..] else {
        panic!("one feed");
    };
    assert!((feed - length / 30.0).abs() < 1e-5, "{feed}");
}

#[test]
fn weights_make_a_nurbs_a_quarter_circle() {
    // Order 3, the middle one of three control points weighted by cos 45 degrees.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let curve = Curve::new(&[([1.0, 0.0], 1.0), ([1.0, 1.0], half), ([0.0, 1.0], 1.0)], 3, &[]);
    for parameter in [0.0, 0.1, 0.5, 0.77, 1.0] {
        let [x, y] = curve.point(parameter);
        assert!((x.hypot(y) - 1.0).abs() < 1e-14, "{parameter}: {x} {y}");
    }
    let arcs = pieces(&curve, 1e-6);
    assert!(arcs.iter().all(|piece| {
        let arc = piece.arc.expect("no line");
        arc.turns == 1 && arc.centre_mm[0].hypot(arc.centre_mm[1]) < 1e-6
    }));
}

/// Unit vectors of a piece at its start and end.
fn directions(piece: &Piece) -> [[f64; 2]; 2] {
    [piece.start, piece.end].map(|place| {
        let [x, y] = match piece.arc {
            None => [piece.end[0] - piece.start[0], piece.end[1] - piece.start[1]],
            Some(arc) => {
                let side = f64::from(arc.turns);
                [
                    side * (arc.centre_mm[1] - place[1]),
                    side * (place[0] - arc.centre_mm[0]),
                ]
            }
        };
        [x / x.hypot(y), y / x.hypot(y)]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn arcs_join_smoothly_and_stay_near_the_curve(
        first in prop::array::uniform2(3.0..20.0_f64),
        last in prop::array::uniform2(3.0..20.0_f64),
        end in prop::array::uniform2(-30.0..30.0_f64),
        places in prop::collection::vec(0.0..1.0_f64, 20),
        tolerance_mm in 0.001..0.1_f64,
    ) {
        // Without cusps: the arms point away from each other.
        let end = [end[0] + 60.0, end[1]];
        let points = [[0.0, 0.0], first, [end[0] - last[0], end[1] + last[1]], end].map(|point| (point, 1.0));
        let curve = Curve::new(&points, 4, &[]);
        let arcs = pieces(&curve, tolerance_mm);
        prop_assert_eq!(arcs[0].start, [0.0, 0.0]);
        let off = [0, 1].map(|axis| (arcs[arcs.len() - 1].end[axis] - end[axis]).abs());
        prop_assert!(off[0] + off[1] < 1e-12);
        for two in arcs.windows(2) {
            prop_assert_eq!(two[0].end, two[1].start);
            let ([_, arrives], [leaves, _]) = (directions(&two[0]), directions(&two[1]));
            let turn = (arrives[0] * leaves[1] - arrives[1] * leaves[0]).abs();
            prop_assert!(turn < 1e-4, "corner of {turn} in {two:?}");
        }
        for place in places {
            let point = curve.point(place);
            let off = arcs.iter().map(|piece| distance_mm(piece, point)).fold(f64::MAX, f64::min);
            prop_assert!(off < 1.5 * tolerance_mm, "{off} off at {place}");
        }
        prop_assert!(arcs.len() < 400, "{} pieces", arcs.len());
    }

    #[test]
    fn any_control_points_give_arcs_that_end_where_the_curve_does(
        points in prop::collection::vec((prop::array::uniform2(-5_i32..5), 1_u32..4), 4..9),
        order in 3_u32..=4,
    ) {
        let points: Vec<([f64; 2], f64)> =
            points.iter().map(|([x, y], w)| ([f64::from(*x), f64::from(*y)], f64::from(*w))).collect();
        let curve = Curve::new(&points, order, &[]);
        let arcs = pieces(&curve, 0.01);
        let finite = |piece: &Piece| {
            let centre = piece.arc.map_or([0.0; 2], |arc| arc.centre_mm);
            centre.iter().chain(&piece.end).all(|number| number.is_finite())
        };
        prop_assert!(arcs.iter().all(finite));
        for two in arcs.windows(2) {
            let [a, b] = [two[0].end, two[1].start];
            prop_assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-3, "{a:?} {b:?}");
        }
        if let Some(piece) = arcs.last() {
            let end = points[points.len() - 1].0;
            prop_assert!((piece.end[0] - end[0]).hypot(piece.end[1] - end[1]) < 1e-5);
        }
    }
}

#[test]
fn a_curve_beyond_all_machines_is_refused_in_bounded_memory() {
    let shown = with_arcs("F100\nG5 X999999999 Y-999999999 I999999999 J999999999 P-999999999 Q0\nM2\n");
    assert!(shown.lines().count() < 100_000, "{} lines", shown.lines().count());
    let points: Vec<_> = (0..50).map(|at| ([f64::powi(-1e200, at), 1.0], 1.0)).collect();
    assert!(pieces(&Curve::new(&points, 4, &[]), 0.001).len() <= biarc::PIECES_MAX + 2);
}

#[test]
fn knots_tell_the_same_curve_whatever_their_scale() {
    // Four quarters of a circle: knots within come twice, and spans are as wide as they are.
    let h = std::f64::consts::FRAC_1_SQRT_2;
    let corners = [
        [1.0, 0.0],
        [1.0, 1.0],
        [0.0, 1.0],
        [-1.0, 1.0],
        [-1.0, 0.0],
        [-1.0, -1.0],
        [0.0, -1.0],
        [1.0, -1.0],
        [1.0, 0.0],
    ];
    let points: Vec<([f64; 2], f64)> = (0..)
        .zip(corners)
        .map(|(k, at)| (at, if k % 2 == 0 { 1.0 } else { h }))
        .collect();
    let curve = Curve::new(
        &points,
        3,
        &[0.0, 0.0, 0.0, 1.0, 1.0, 2.5, 2.5, 7.0, 7.0, 8.0, 8.0, 8.0],
    );
    assert_eq!(curve.spans(), 4);
    for k in 0..=40 {
        let (at, along) = curve.point_and_derivative(f64::from(k) / 10.0);
        assert!((libm::hypot(at[0], at[1]) - 1.0).abs() < 1e-12, "{at:?}");
        assert!((at[0] * along[0] + at[1] * along[1]).abs() < 1e-9, "{along:?}");
    }
    assert_eq!(curve.point(2.0), [-1.0, 0.0]);
}

#[test]
fn a_curve_with_knots_begins_at_its_first_point_and_ends_at_its_last() {
    let program =
        "F100 G18\nG6.2 Z1 X2 R1 K0 P3 Q2\nZ2 X4 K0 R2\nZ3 X2 K0\nK1\nK1\nK1\nG6.3\n(debug,#5420 #5422)\nM2\n";
    assert_eq!(
        printed(program),
        "SET_FEED_RATE(100.0000)\nSELECT_PLANE(CANON_PLANE_XZ)\nSTRAIGHT_FEED(2.0000, 0.0000, 1.0000, 0.0000, 0.0000, 0.0000)\n\
         NURBS_G6_FEED(6, ...)\nMESSAGE(\"2.000000 3.000000\")\n"
    );
    let mut run = crate::Interpreter::new(Settings::default()).run(program.as_bytes());
    let told = run.find_map(|event| match event.unwrap().call {
        Call::NurbsFeed {
            plane,
            points,
            order,
            knots,
        } => Some((plane, points, order, knots)),
        _ => None,
    });
    let points = vec![([1.0, 2.0], 1.0), ([2.0, 4.0], 2.0), ([3.0, 2.0], 1.0)];
    assert_eq!(told, Some((Plane::Zx, points, 3, vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0])));
}
