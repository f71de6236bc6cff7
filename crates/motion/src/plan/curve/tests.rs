use super::fit::TOLERANCE_MM;
use super::*;
use crate::plan::limits::jumps;
use crate::plan::smooth::round::{distance, nearest};
use proptest::prelude::*;

type Points = Vec<([f64; 2], f64)>;

const FLAT: Plane = Plane {
    start: Position::ZERO,
    first: [1.0, 0.0, 0.0],
    second: [0.0, 1.0, 0.0],
};

fn weightless(points: &[[f64; 2]]) -> Points {
    points.iter().map(|at| (*at, 1.0)).collect()
}

/// The pieces of a curve that begins at zero.
fn follow(points: &Points, order: u32) -> Vec<Piece> {
    let [x, y] = points[points.len() - 1].0;
    pieces(points, order, &[], &FLAT, &Position::xyz(x, y, 0.0)).expect("a good curve")
}

/// A place of a NURBS by the definition of its basis, which is another way than that of the code.
fn place(points: &Points, order: usize, t: f64) -> [f64; 2] {
    let count = points.len() + 1 - order;
    let knot = |k: usize| (k + 1).saturating_sub(order).min(count) as f64;
    let t = t.min(count as f64 * (1.0 - 1e-15));
    let mut basis: Vec<f64> = (0..points.len() + order - 1)
        .map(|k| f64::from(u8::from(knot(k) <= t && t < knot(k + 1))))
        .collect();
    for step in 2..=order {
        for k in 0..points.len() + order - step {
            let part = |value: f64, over: f64, under: f64| if under > 0.0 { value * over / under } else { 0.0 };
            basis[k] = part(basis[k], t - knot(k), knot(k + step - 1) - knot(k))
                + part(basis[k + 1], knot(k + step) - t, knot(k + step) - knot(k + 1));
        }
    }
    let mut sum = [0.0; 3];
    for (([x, y], w), b) in points.iter().zip(&basis) {
        for (sum, x) in sum.iter_mut().zip([x * w, y * w, *w]) {
            *sum += b * x;
        }
    }
    [sum[0] / sum[2], sum[1] / sum[2]]
}

/// Greatest distance of the curve from the pieces and back, and the length of the curve.
fn compare(points: &Points, order: usize, pieces: &[Piece]) -> (f64, f64) {
    let spans = (points.len() + 1 - order) as f64;
    // The knots among them, where a curve of order 2 has its corners.
    let count = 600 * (points.len() + 1 - order) as u32;
    let polygon: Vec<[f64; AXES]> = (0..=count)
        .map(|k| place(points, order, spans * f64::from(k) / f64::from(count)))
        .map(|[x, y]| Position::xyz(x, y, 0.0).0)
        .collect();
    let length = polygon.windows(2).map(|pair| distance(&pair[0], &pair[1])).sum();
    let off = |q: &[f64; AXES]| {
        let of_piece = |piece: &Piece| {
            let end = piece.length();
            (0..=4)
                .map(|k| nearest(piece, q, 0.0, end, end * f64::from(k) / 4.0).0)
                .fold(f64::INFINITY, f64::min)
        };
        pieces.iter().map(of_piece).fold(f64::INFINITY, f64::min)
    };
    let mut most = polygon.iter().step_by(7).map(off).fold(0.0, f64::max);
    let steps: Vec<Piece> = polygon
        .windows(2)
        .filter_map(|pair| Piece::line(Position(pair[0]), Position(pair[1])))
        .collect();
    let step = pieces.len().div_ceil(40);
    for piece in pieces.iter().step_by(step) {
        for k in 0..=4 {
            let q = piece.position(piece.length() * f64::from(k) / 4.0).0;
            let near = |step: &Piece| nearest(step, &q, 0.0, step.length(), 0.0).0;
            most = most.max(steps.iter().map(near).fold(f64::INFINITY, f64::min));
        }
    }
    (most, length)
}

/// How many joints have a jump of direction, and how many of curvature only.
fn jumping(pieces: &[Piece]) -> (usize, usize) {
    let (mut direction_jumps, mut bends) = (0, 0);
    for pair in pieces.windows(2) {
        let (end, start) = (pair[0].position(pair[0].length()), pair[1].position(0.0));
        assert!(distance(&end.0, &start.0) < 1e-9, "{end:?} {start:?}");
        if let Some(jump) = jumps(&pair[0].jet(pair[0].length()), &pair[1].jet(0.0)) {
            let kink = jump.kink.iter().any(|x| *x > 1e-12);
            direction_jumps += usize::from(kink);
            bends += usize::from(!kink);
        }
    }
    (direction_jumps, bends)
}

#[test]
fn a_cubic_is_kept_as_it_is() {
    let points = weightless(&[[0.0, 0.0], [10.0, 30.0], [40.0, -20.0], [50.0, 0.0]]);
    let pieces = follow(&points, 4);
    assert!(pieces.len() <= 8, "{}", pieces.len());
    assert_eq!(jumping(&pieces), (0, 0));
    let length = compare(&points, 4, &pieces).1;
    let sum: f64 = pieces.iter().map(Piece::length).sum();
    assert!((sum - length).abs() < 1e-3, "{sum} {length}");
    for piece in &pieces {
        for k in 0..=10 {
            let q = piece.position(piece.length() * f64::from(k) / 10.0).0;
            // X rises with the parameter: the place of the same X is found by halving.
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                let side = if place(&points, 4, middle)[0] < q[0] {
                    &mut low
                } else {
                    &mut high
                };
                *side = middle;
            }
            assert!((q[1] - place(&points, 4, low)[1]).abs() < 1e-9, "{q:?}");
        }
    }
}

#[test]
fn a_parabola_of_known_length() {
    // y = x² / 40 from -20 to 20.
    let pieces = follow(&weightless(&[[0.0, 0.0], [20.0, -20.0], [40.0, 0.0]]), 3);
    let length = 20.0 * (2.0_f64.sqrt() + 1.0_f64.asinh());
    let sum: f64 = pieces.iter().map(Piece::length).sum();
    assert!((sum - length).abs() < 1e-9, "{sum} {length}");
    for piece in &pieces {
        for k in 0..=10 {
            let q = piece.position(piece.length() * f64::from(k) / 10.0).0;
            let x = q[0] - 20.0;
            assert!((q[1] - (x * x / 40.0 - 10.0)).abs() < 1e-11, "{q:?}");
        }
    }
}

#[test]
fn a_quarter_of_a_circle_is_one_within_the_tolerance() {
    let points = vec![([0.0, 0.0], 1.0), ([0.0, 50.0], 0.5_f64.sqrt()), ([50.0, 50.0], 1.0)];
    let pieces = follow(&points, 3);
    for piece in &pieces {
        for k in 0..=20 {
            let jet = piece.jet(piece.length() * f64::from(k) / 20.0);
            assert!(((jet.q[0] - 50.0).hypot(jet.q[1]) - 50.0).abs() < TOLERANCE_MM);
            assert!((jet.d2[0].hypot(jet.d2[1]) * 50.0 - 1.0).abs() < 0.01, "{jet:?}");
        }
    }
    assert!(pieces.len() <= 8, "{}", pieces.len());
    assert_eq!(jumping(&pieces), (0, 0));
}

#[test]
fn a_curve_has_the_jumps_of_its_knots_and_no_others() {
    let zigzag: Vec<[f64; 2]> = (0..9).map(|k| [f64::from(k) * 5.0, f64::from(k % 2) * 7.0]).collect();
    let points = weightless(&zigzag);
    assert_eq!(jumping(&follow(&points, 2)), (7, 0), "a polygon");
    assert_eq!(jumping(&follow(&points, 3)), (0, 6), "arcs of parabolas");
    for order in 4..=9 {
        assert_eq!(jumping(&follow(&points, order)), (0, 0), "order {order}");
    }
}

#[test]
fn a_cusp_is_one_sharp_place() {
    // The cubic that turns back in its middle.
    let points = weightless(&[[0.0, 0.0], [10.0, 10.0], [0.0, 10.0], [10.0, 0.0]]);
    let pieces = follow(&points, 4);
    assert_eq!(jumping(&pieces).0, 1);
    let tip = pieces.windows(2).find(|pair| {
        let (a, b) = (pair[0].jet(pair[0].length()).d1, pair[1].jet(0.0).d1);
        a[0] * b[0] + a[1] * b[1] < 0.0
    });
    let tip = tip.expect("it turns back")[1].position(0.0).0;
    assert!((tip[0] - 5.0).hypot(tip[1] - 7.5) < TOLERANCE_MM, "{tip:?}");
    assert!(compare(&points, 4, &pieces).0 < TOLERANCE_MM);
}

#[test]
fn control_points_on_each_other_and_in_line() {
    let cases: [(&[[f64; 2]], u32, usize); 6] = [
        (&[[0.0, 0.0], [0.0, 0.0], [9.0, 3.0], [9.0, 3.0]], 4, 1),
        (&[[0.0, 0.0], [3.0, 1.0], [6.0, 2.0], [9.0, 3.0]], 4, 1),
        (&[[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]], 4, 0),
        (&[[0.0, 0.0], [0.0, 0.0], [5.0, 8.0], [9.0, 3.0]], 4, usize::MAX),
        (&[[0.0, 0.0], [12.0, 0.0], [-3.0, 0.0], [9.0, 0.0]], 4, usize::MAX),
        (
            &[[0.0, 0.0], [4.0, 0.0], [4.0, 0.0], [4.0, 0.0], [4.0, 5.0], [9.0, 9.0]],
            4,
            usize::MAX,
        ),
    ];
    for (points, order, count) in cases {
        let points = weightless(points);
        let pieces = follow(&points, order);
        assert!(
            count == usize::MAX || pieces.len() == count,
            "{points:?}: {}",
            pieces.len()
        );
        if let Some(last) = pieces.last() {
            assert!(compare(&points, order as usize, &pieces).0 < TOLERANCE_MM, "{points:?}");
            let ([x, y], _) = points[points.len() - 1];
            assert!(distance(&last.position(last.length()).0, &Position::xyz(x, y, 0.0).0) < 1e-9);
        }
    }
}

#[test]
fn a_curve_back_over_itself_turns_where_it_is_farthest() {
    // x = 36 t - 99 t² + ... goes beyond both ends and comes back.
    let points = weightless(&[[0.0, 0.0], [12.0, 0.0], [-3.0, 0.0], [9.0, 0.0]]);
    let pieces = follow(&points, 4);
    let sum: f64 = pieces.iter().map(Piece::length).sum();
    let length = compare(&points, 4, &pieces).1;
    assert!((sum - length).abs() < 3.0 * TOLERANCE_MM, "{sum} {length}");
    assert_eq!(jumping(&pieces).0, 2);
}

#[test]
fn a_curve_in_a_turned_plane_ends_where_it_is_told_to() {
    let plane = Plane {
        start: Position::xyz(100.0, 200.0, -7.0),
        first: [0.0, 1.0, 0.0],
        second: [-1.0, 0.0, 0.0],
    };
    let points = weightless(&[[3.0, 3.0], [13.0, 3.0], [13.0, 13.0]]);
    let end = Position::xyz(90.0, 210.0, -7.0);
    let pieces = pieces(&points, 3, &[], &plane, &end).unwrap();
    assert_eq!(pieces[0].position(0.0), plane.start);
    let last = pieces[pieces.len() - 1];
    assert!(distance(&last.position(last.length()).0, &end.0) < 1e-12);
    assert!(pieces[0].jet(0.0).d1[1] > 0.999);
}

#[test]
fn what_is_no_curve_is_refused() {
    let line = weightless(&[[0.0, 0.0], [1.0, 0.0]]);
    let refused = |points: &Points, order| pieces(points, order, &[], &FLAT, &Position::ZERO).unwrap_err();
    assert_eq!(refused(&line, 3), Fault::Malformed);
    assert_eq!(refused(&line, 1), Fault::Malformed);
    assert_eq!(refused(&Vec::new(), 2), Fault::Malformed);
    assert_eq!(refused(&weightless(&[[0.0; 2]; 40]), ORDER_MAX + 1), Fault::Malformed);
    assert_eq!(refused(&vec![([0.0; 2], 1.0), ([1.0; 2], 0.0)], 2), Fault::Malformed);
    assert_eq!(
        refused(&vec![([0.0; 2], 1.0), ([f64::NAN; 2], 1.0)], 2),
        Fault::NotFinite
    );
    assert_eq!(refused(&vec![([0.0; 2], 1.0), ([1e300; 2], 1e300)], 2), Fault::Wild);
}

/// Coordinates of which some are equal.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![3 => -50.0..50.0, 1 => (-3i8..3).prop_map(|x| f64::from(x) * 10.0), 1 => -1e-4..1e-4]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn pieces_follow_the_curve(
        order in 2u32..8,
        rest in prop::collection::vec(((coordinate(), coordinate()), prop_oneof![Just(1.0), 0.05..20.0]), 7..14),
        weighted: bool,
    ) {
        let mut points: Points = vec![([0.0; 2], 1.0)];
        points.extend(rest.into_iter().map(|((x, y), w)| ([x, y], if weighted { w } else { 1.0 })));
        let pieces = follow(&points, order);
        let (off, length) = compare(&points, order as usize, &pieces);
        // The comparison has chords; what these take goes with the square of their length.
        let chords = 30.0 * (length / 600.0 / (points.len() + 1 - order as usize) as f64).powi(2);
        prop_assert!(off <= TOLERANCE_MM + chords.min(1e-2), "{off} with {} pieces", pieces.len());
        let sum: f64 = pieces.iter().map(Piece::length).sum();
        prop_assert!((sum / length - 1.0).abs() < 1e-4, "{sum} {length}");
        let (direction_jumps, bends) = jumping(&pieces);
        if order >= 4 {
            prop_assert_eq!(bends, 0);
        }
        prop_assert!(direction_jumps < 100, "{}", direction_jumps);
    }
}

#[test]
fn knots_that_are_given_tell_where_the_spans_meet() {
    let points = vec![
        ([0.0, 0.0], 1.0),
        ([1.0, 3.0], 1.0),
        ([4.0, 3.0], 2.0),
        ([6.0, 0.0], 1.0),
        ([8.0, -1.0], 0.5),
        ([9.0, 2.0], 1.0),
    ];
    let end = Position::xyz(9.0, 2.0, 0.0);
    let with = |knots: &[f64]| pieces(&points, 4, knots, &FLAT, &end).map(|pieces| format!("{pieces:?}"));
    // Evenly spaced ones, also of another scale, are those that are meant where none are given.
    let even = with(&[]).expect("a good curve");
    assert_eq!(
        with(&[0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0]).expect("the same"),
        even
    );
    // Others tell another curve: with a knot three times within, it goes through a control point, here with a corner.
    let corner = with(&[0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 5.0, 5.0, 5.0, 5.0]).expect("a good curve");
    assert_ne!(corner, even);
    let through = with(&[2.0, 2.0, 2.0, 2.0, 2.5, 2.5, 2.5, 9.0, 9.0, 9.0]);
    assert_eq!(
        through.unwrap_err(),
        Fault::Malformed,
        "the end is there three times only"
    );
    let seven: Points = points.iter().copied().chain([([10.0, 0.0], 1.0)]).collect();
    let end = Position::xyz(10.0, 0.0, 0.0);
    let knots = [2.0, 2.0, 2.0, 2.0, 2.5, 2.5, 2.5, 9.0, 9.0, 9.0, 9.0];
    let through = pieces(&seven, 4, &knots, &FLAT, &end).expect("a good curve");
    let passes = |place: [f64; 2]| {
        let ends = through.iter().map(|piece| piece.position(piece.length()));
        ends.map(|at| libm::hypot(at.0[0] - place[0], at.0[1] - place[1]))
            .fold(f64::INFINITY, f64::min)
    };
    assert!(passes([6.0, 0.0]) < 1e-9, "{}", passes([6.0, 0.0]));
    for wrong in [
        &[0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0][..],
        &[0.0, 0.0, 0.0, 0.0, 2.0, 1.0, 3.0, 3.0, 3.0, 3.0],
        &[-1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0],
        &[0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 3.0, 3.0, 3.0, 3.0],
        &[0.0, 0.0, 0.0, 0.0, f64::NAN, 2.0, 3.0, 3.0, 3.0, 3.0],
        &[0.0; 10],
    ] {
        assert_eq!(with(wrong).unwrap_err(), Fault::Malformed, "{wrong:?}");
    }
}
