use std::f64::consts::{PI, TAU};

use super::*;
use proptest::prelude::*;

fn close(a: &[f64; AXES], b: &[f64; AXES], slack: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= slack)
}

/// Derivatives by length against central differences, and the length against the sum of small chords.
fn check_derivatives(piece: &Piece, slack: f64) {
    let h = piece.length() * 1e-3;
    for k in 1..20 {
        let s = piece.length() * f64::from(k) / 20.0;
        let (low, here, high) = (piece.jet(s - h), piece.jet(s), piece.jet(s + h));
        assert_eq!(here.q, piece.position(s).0);
        let slope = |a: &[f64; AXES], b: &[f64; AXES]| core::array::from_fn(|i| (b[i] - a[i]) / (2.0 * h));
        let scale = 1.0 / piece.length();
        assert!(close(&slope(&low.q, &high.q), &here.d1, slack), "q' at {s}");
        assert!(
            close(&slope(&low.d1, &high.d1), &here.d2, slack * 40.0 * scale),
            "q'' at {s}"
        );
        assert!(
            close(&slope(&low.d2, &high.d2), &here.d3, slack * 2000.0 * scale * scale),
            "q''' at {s}"
        );
        assert!((piece.group().norm(&here.d1) - 1.0).abs() < 1e-12, "unit speed at {s}");
    }
}

#[test]
fn a_line_counts_length_along_xyz_then_uvw_then_abc() {
    let mut to = Position::xyz(3.0, 4.0, 0.0);
    to.0[3] = 90.0;
    to.0[6] = 7.0;
    let piece = Piece::line(Position::ZERO, to).unwrap();
    assert_eq!((piece.length(), piece.group()), (5.0, Group::Main));
    assert_eq!(piece.position(2.5).0, [1.5, 2.0, 0.0, 45.0, 0.0, 0.0, 3.5, 0.0, 0.0]);
    assert_eq!(piece.position(99.0), to);
    let only = |axis: usize| {
        let mut to = Position::ZERO;
        to.0[axis] = -2.0;
        to.0[4] = 30.0;
        Piece::line(Position::ZERO, to).unwrap()
    };
    assert_eq!((only(7).length(), only(7).group()), (2.0, Group::Parallel));
    assert_eq!((only(4).length(), only(4).group()), (30.0, Group::Rotary));
    assert!(Piece::line(to, to).is_none());
    assert!(Piece::line(to, Position::xyz(f64::NAN, 0.0, 0.0)).is_none());
}

#[test]
fn a_helix_is_exact() {
    // Radius 10, one and a half turns clockwise, 3 mm down, A turns by 12 degrees.
    let mut end = Position::xyz(-10.0, 0.0, -3.0);
    end.0[3] = 12.0;
    let circle = Circle {
        start: Position::xyz(10.0, 0.0, 0.0),
        end,
        centre_mm: [0.0; 3],
        normal: [0.0, 0.0, 1.0],
        sweep_rad: -3.0 * PI,
    };
    let piece = Piece::arc(&circle).unwrap();
    assert!((piece.length() - (30.0 * PI).hypot(3.0)).abs() < 1e-12);
    let third = piece.position(piece.length() / 3.0);
    assert!(close(
        &third.0,
        &[-10.0, 0.0, -1.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        1e-12
    ));
    let sixth = piece.position(piece.length() / 6.0);
    assert!(close(
        &sixth.0,
        &[0.0, -10.0, -0.5, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        1e-12
    ));
    assert!(close(&piece.position(piece.length()).0, &end.0, 1e-12));
    check_derivatives(&piece, 2e-5);
}

#[test]
fn a_spiral_keeps_unit_speed_and_meets_both_ends() {
    let circle = Circle {
        start: Position::xyz(5.0, 0.0, 2.0),
        end: Position::xyz(0.0, 6.0, 2.5),
        centre_mm: [0.0, 0.0, 77.0],
        normal: [0.0, 0.0, 1.0],
        sweep_rad: PI / 2.0 + TAU,
    };
    let piece = Piece::arc(&circle).unwrap();
    assert!(close(&piece.position(0.0).0, &circle.start.0, 1e-12));
    assert!(close(&piece.position(piece.length()).0, &circle.end.0, 1e-12));
    check_derivatives(&piece, 3e-5);
    let (a, b) = (piece.cut(0.0, 11.0).unwrap(), piece.cut(11.0, 99.0).unwrap());
    assert!((a.length() - 11.0).abs() < 1e-9 && (a.length() + b.length() - piece.length()).abs() < 1e-9);
    assert!(close(&b.position(4.0).0, &piece.position(15.0).0, 1e-9));
}

#[test]
fn a_blend_joins_line_and_arc_with_equal_curvature() {
    let line = Piece::line(Position::xyz(-5.0, 0.0, 0.0), Position::ZERO).unwrap();
    let circle = Circle {
        start: Position::ZERO,
        end: Position::xyz(4.0, 4.0, 1.0),
        centre_mm: [0.0, 4.0, 0.0],
        normal: [0.0, 0.0, 1.0],
        sweep_rad: PI / 2.0,
    };
    let arc = Piece::arc(&circle).unwrap();
    let from = BlendEnd {
        leg: line.jet(4.5),
        pace: 1.0,
        pace_change: -0.1,
    };
    let to = BlendEnd {
        leg: arc.jet(0.5),
        pace: 1.0,
        pace_change: 0.1,
    };
    let piece = Piece::blend(&from, &to, Group::Main).unwrap();
    let (first, last) = (piece.jet(0.0), piece.jet(piece.length()));
    for (got, want) in [(first, from.leg), (last, to.leg)] {
        assert!(close(&got.q, &want.q, 1e-12));
        assert!(close(&got.d1, &want.d1, 1e-12));
        assert!(close(&got.d2, &want.d2, 1e-10));
    }
    check_derivatives(&piece, 5e-4);
}

#[test]
fn a_blend_that_turns_back_is_refused() {
    let there = Piece::line(Position::ZERO, Position::xyz(1.0, 0.0, 0.0)).unwrap();
    let back = Piece::line(Position::xyz(1.0, 0.0, 0.0), Position::ZERO).unwrap();
    let from = BlendEnd {
        leg: there.jet(0.5),
        pace: 1.0,
        pace_change: 0.0,
    };
    let to = BlendEnd {
        leg: back.jet(0.5),
        pace: 1.0,
        pace_change: 0.0,
    };
    assert!(Piece::blend(&from, &to, Group::Main).is_none());
}

#[test]
fn a_piece_is_small_enough_to_copy() {
    assert!(size_of::<Piece>() <= 700, "{}", size_of::<Piece>());
}

/// A circle is no DDA: it stays on the circle but for the rounding of a double.
#[test]
fn a_circle_is_exact() {
    for radius in [0.5, 100.0, 1000.0] {
        let circle = Circle {
            start: Position::xyz(radius, 0.0, 0.0),
            end: Position::xyz(0.0, radius, 0.0),
            centre_mm: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: std::f64::consts::FRAC_PI_2,
        };
        let piece = Piece::arc(&circle).unwrap();
        for k in 0..=10_000 {
            let [x, y, ..] = piece.position(piece.length() * f64::from(k) / 1e4).0;
            assert!((x.hypot(y) - radius).abs() < 1e-9, "radius {radius}, sample {k}");
        }
    }
}

proptest! {
    #[test]
    fn length_and_parameter_of_a_blend_agree(angle in 0.0f64..2.8, d in 1e-3f64..10.0, p1 in 0.5f64..0.75, p2 in 0.1f64..0.5) {
        let before = Piece::line(Position::xyz(-20.0, 0.0, 0.0), Position::ZERO).unwrap();
        let after = Piece::line(Position::ZERO, Position::xyz(20.0 * angle.cos(), 20.0 * angle.sin(), 0.0)).unwrap();
        let (pace, change) = (5.0 * (1.0 - p1) * d, 20.0 * (2.0 * p1 - p2 - 1.0) * d);
        let from = BlendEnd { leg: before.jet(20.0 - d), pace, pace_change: change };
        let to = BlendEnd { leg: after.jet(d), pace, pace_change: -change };
        if let Some(piece) = Piece::blend(&from, &to, Group::Main) {
            // Equal steps of length are equal distances: the chord of a short step is the step.
            let steps = 4000;
            let mut sum = 0.0;
            let mut last = piece.position(0.0);
            for k in 1..=steps {
                let next = piece.position(piece.length() * f64::from(k) / f64::from(steps));
                sum += (next.0[0] - last.0[0]).hypot(next.0[1] - last.0[1]);
                last = next;
            }
            prop_assert!((sum / piece.length() - 1.0).abs() < 1e-5);
            let (quarter, h) = (piece.length() / 4.0, piece.length() * 1e-5);
            for k in 1..4 {
                let (a, b) = (piece.position(quarter * f64::from(k)), piece.position(quarter * f64::from(k) + h));
                let step = (b.0[0] - a.0[0]).hypot(b.0[1] - a.0[1]);
                prop_assert!((step / h - 1.0).abs() < 1e-5, "{step} {h}");
            }
        }
    }
}

proptest! {
    #[test]
    fn an_arc_with_a_rounded_end_has_the_bounds_of_a_circle(
        radius in 0.5f64..200.0, turn in 0.05f64..12.0, phase in 0.0f64..TAU, rounding in -1e-4f64..1e-4,
        rise in -2.0f64..2.0, part in 0.0f64..0.5,
    ) {
        let at = |radius: f64, angle: f64, z: f64| Position::xyz(radius * angle.cos(), radius * angle.sin(), z);
        let circle = Circle {
            start: at(radius, phase, 0.0),
            end: at(radius + rounding, phase + turn, rise),
            centre_mm: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: turn,
        };
        let whole = Piece::arc(&circle).unwrap();
        let piece = whole.cut(part * whole.length(), whole.length()).unwrap();
        let bounds = piece.greatest_derivatives();
        prop_assume!(bounds.is_some());
        let bounds = bounds.unwrap();
        let mut most = [[0.0f64; AXES]; 3];
        for k in 0..=2000 {
            let jet = piece.jet(piece.length() * f64::from(k) / 2000.0);
            for (most, here) in most.iter_mut().zip([jet.d1, jet.d2, jet.d3]) {
                for (most, here) in most.iter_mut().zip(here) {
                    *most = most.max(here.abs());
                }
            }
        }
        for order in 0..3 {
            let whole = radius.powi(-(order as i32));
            for axis in 0..3 {
                let (bound, most) = (bounds[order][axis], most[order][axis]);
                prop_assert!(bound >= most - 1e-9 * whole, "order {order}, axis {axis}: {bound} < {most}");
                prop_assert!(bound <= most + 0.01 * whole, "order {order}, axis {axis}: {bound} > {most}");
            }
        }
    }
}

proptest! {
    #[test]
    fn the_nearest_place_of_lines_and_flat_arcs_is_that_of_many_places(
        radius in 0.5f64..50.0, turn in 0.05f64..6.2, phase in 0.0f64..TAU, rounding in -1e-4f64..1e-4,
        x in -1.5f64..1.5, y in -1.5f64..1.5, z in -0.1f64..0.1, part in 0.0f64..0.5, clockwise: bool, round: bool,
    ) {
        let at = |radius: f64, angle: f64| Position::xyz(radius * angle.cos(), radius * angle.sin(), 1.0);
        let turn = if clockwise { -turn } else { turn };
        let end = at(radius + rounding, phase + turn);
        let circle = Circle {
            start: at(radius, phase),
            end,
            centre_mm: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: turn,
        };
        let whole = if round { Piece::arc(&circle) } else { Piece::line(circle.start, end) }.unwrap();
        let piece = whole.cut(part * whole.length(), whole.length()).unwrap();
        let [from, to] = [0.1, 0.9].map(|part| part * piece.length());
        let mut q = Position::xyz(radius * x, radius * y, 1.0 + radius * z);
        q.0[7] = 0.01;
        let (distance, s) = match piece.nearest(&q.0, [from, to], 0.5 * (from + to)) {
            Some(nearest) => nearest,
            // An end point that has been rounded by much of the radius.
            None => return Ok(()),
        };
        prop_assert!((from..=to).contains(&s));
        let far = |s: f64| super::distance(&piece.position(s).0, &q.0);
        let least = (0..=4000).map(|k| far(from + (to - from) * f64::from(k) / 4000.0)).fold(f64::INFINITY, f64::min);
        prop_assert!((far(s) - distance).abs() < 1e-6 * radius, "{} at the place, {distance}", far(s));
        // Opposite the middle, the other end of the stretch may be nearer.
        if distance < radius {
            // The nearest one lies between two of the many, at most half a step from one of them.
            let beside = distance.hypot(1.5 * (to - from) / 8000.0);
            prop_assert!(distance <= least + 1e-6 * radius && least <= beside + 1e-6 * radius, "{distance} {least}");
        }
    }
}

proptest! {
    #[test]
    fn an_arc_reaches_as_far_as_its_farthest_places(
        radius in 0.5f64..50.0, change in prop_oneof![Just(0.0), -0.3f64..0.3], turn in 0.05f64..15.0, phase in 0.0f64..TAU,
        rise in prop_oneof![Just(0.0), -20.0f64..20.0], tilt in 0.0f64..1.5, clockwise: bool,
    ) {
        let (sin, cos) = tilt.sin_cos();
        // Tilted about Y.
        let at = |radius: f64, angle: f64, height: f64| {
            let x = radius * angle.cos();
            Position::xyz(cos * x + sin * height, radius * angle.sin(), cos * height - sin * x)
        };
        let turn = if clockwise { -turn } else { turn };
        let circle = Circle {
            start: at(radius, phase, 0.0),
            end: at(radius * (1.0 + change), phase + turn, rise),
            centre_mm: [0.0; 3],
            normal: [sin, 0.0, cos],
            sweep_rad: turn,
        };
        let piece = Piece::arc(&circle).unwrap();
        let Shape::Arc(arc) = piece.shape() else { panic!("an arc") };
        for axis in 0..3 {
            let places = (0..=4000).map(|k| arc.jet_at(f64::from(k) / 4000.0).q[axis]);
            let (low, high) = arc.reach(axis);
            let hull = arc.hull(axis);
            prop_assert!(hull.0 <= low + 1e-12 * radius && hull.1 >= high - 1e-12 * radius, "{axis}: {hull:?}, {low} {high}");
            for q in places.clone() {
                prop_assert!(q >= low - 1e-12 * radius && q <= high + 1e-12 * radius, "{axis}: {q} in {low} {high}");
            }
            let most = places.clone().fold(f64::NEG_INFINITY, f64::max);
            let least = places.fold(f64::INFINITY, f64::min);
            let near = 1e-5 * radius * turn * turn;
            prop_assert!(high - most < near && least - low < near, "{axis}: {low} {high}, {least} {most}");
        }
    }
}

/// Where the length nearly stands still, positions by length agree with derivatives by length, also where the table has a place.
fn check_agreement(piece: &Piece) -> Result<(), TestCaseError> {
    let place = piece.by_parameter(0.0, piece.length());
    for k in 0..=400 {
        let s = place(f64::from(k) / 400.0);
        let here = piece.jet(s);
        let most = |d: &[f64; AXES]| d.iter().fold(0.0, |most: f64, d| most.max(d.abs()));
        // What a central difference misses is a sixth of h² d3, and rounding over h.
        let h = 3e-4 / most(&here.d3).sqrt().max(most(&here.d2)).max(1.0 / piece.length());
        if s < h || s > piece.length() - h {
            continue;
        }
        let (low, high) = (piece.position(s - h), piece.position(s + h));
        for axis in 0..AXES {
            let slope = (high.0[axis] - low.0[axis]) / (2.0 * h);
            let off = (slope - here.d1[axis]).abs();
            prop_assert!(
                off < 1e-5 * most(&here.d1),
                "axis {axis} at {s} of {}: {slope}, not {}",
                piece.length(),
                here.d1[axis]
            );
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn a_blend_whose_length_nearly_stands_still_moves_by_what_is_told(
        paces in prop::array::uniform2(0.002f64..0.05), changes in prop::array::uniform2(-0.3f64..0.3), rise in -0.05f64..0.05,
        turn in 0.1f64..20.0,
    ) {
        let end = |x: f64, y: f64, a: f64, k: usize| {
            let mut leg = Jet::default();
            (leg.q[0], leg.q[1], leg.q[3], leg.d1[0]) = (x, y, a, 1.0);
            BlendEnd { leg, pace: paces[k], pace_change: changes[k] }
        };
        if let Some(piece) = Piece::blend(&end(0.0, 0.0, 0.0, 0), &end(0.02, rise, turn, 1), Group::Main) {
            check_agreement(&piece)?;
        }
    }

    #[test]
    fn a_spiral_from_near_its_centre_moves_by_what_is_told(
        radius in -3.0f64..0.0, end_radius in -1.0f64..1.0, turn in 0.5f64..40.0, rise in -1.0f64..1.0,
    ) {
        let [radius, end_radius] = [radius, end_radius].map(|x| libm::pow(10.0, x));
        let circle = Circle {
            start: Position::xyz(radius, 0.0, 0.0),
            end: Position::xyz(end_radius * turn.cos(), end_radius * turn.sin(), rise),
            centre_mm: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            sweep_rad: turn,
        };
        check_agreement(&Piece::arc(&circle).unwrap())?;
    }
}
