//! What the tests of the families share.

mod five_axis;
mod linear;
mod number;
mod round_trip;
mod serial_and_parallel;

use super::{Follows, Kinematics, ToolFrame, Transform};
use crate::canon::{Axis, Position};

/// One joint per axis, in this order.
fn machine(transform: Transform, axes: &[Axis]) -> Kinematics {
    let follows: Vec<Follows> = axes
        .iter()
        .map(|&axis| Follows {
            axis: Some(axis),
            offset: 0.0,
        })
        .collect();
    Kinematics::new(transform, &follows)
}

/// A position by axes and values, the others zero.
fn position(values: &[(Axis, f64)]) -> Position {
    let mut position = Position::ZERO;
    for &(axis, value) in values {
        position[axis] = value;
    }
    position
}

fn tcp(length_mm: f64) -> ToolFrame {
    ToolFrame { tcp: true, length_mm }
}

#[track_caller]
fn assert_near(got: &[f64], wanted: &[f64], tolerance: f64) {
    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= tolerance;
    assert!(
        got.len() == wanted.len() && got.iter().zip(wanted).all(near),
        "{got:?} for {wanted:?}"
    );
}

/// First, second and third derivative of `f` at 0 by central differences of nine points, exact for polynomials of degree 8.
fn differences(f: impl Fn(f64) -> f64, h: f64) -> [f64; 3] {
    const FIRST: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    const SECOND: [f64; 5] = [-205.0 / 72.0, 8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];
    const THIRD: [f64; 4] = [-61.0 / 30.0, 169.0 / 120.0, -3.0 / 10.0, 7.0 / 240.0];
    let mut sums = [0.0, SECOND[0] * f(0.0), 0.0];
    for k in 1..=4 {
        let (after, before) = (f(k as f64 * h), f(-(k as f64) * h));
        sums[0] += FIRST[k - 1] * (after - before);
        sums[1] += SECOND[k] * (after + before);
        sums[2] += THIRD[k - 1] * (after - before);
    }
    [sums[0] / h, sums[1] / (h * h), sums[2] / (h * h * h)]
}

#[test]
fn the_differences_are_those_of_a_polynomial() {
    let f = |x: f64| 1.0 + x * (2.0 + x * (3.0 + x * (4.0 + x * (5.0 + x * x * x * x * 6.0))));
    let [d1, d2, d3] = differences(f, 0.5);
    assert!(
        (d1 - 2.0).abs() < 1e-12 && (d2 - 6.0).abs() < 1e-11 && (d3 - 24.0).abs() < 1e-10,
        "{d1} {d2} {d3}"
    );
}
