//! Splines: cubics, parabolas and NURBS, smooth ones and such as no one should write.

use super::Size;
use super::random::{Random, count};
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::fmt::Write as _;

/// A wave of cubics that go on smoothly, parabolas, a rounded polygon with weights, a B-spline of order 4.
pub(super) fn splines(size: Size) -> String {
    let mut text = String::from("G5 X10 Y5 I4 J0 P-4 Q0\n");
    for k in 1..=count(size, 3, 12) {
        let (x, y) = (10.0 + 8.0 * k as f64, if k % 2 == 0 { 5.0 } else { -4.0 });
        let _ = writeln!(text, "G5 X{x} Y{y} P-4 Q0");
    }
    text += "G5.1 X40 Y30 I6 J12\nG5.1 X20 Y35 I-12 J14\nG1 X10 Y35\n";
    // Four quarters of a circle, as weights make them exactly.
    let (mut x, mut y) = (10.0, 35.0);
    for [[i, j], [p, q]] in [
        [[-10.0, 0.0], [-10.0, -10.0]],
        [[0.0, -10.0], [10.0, -10.0]],
        [[10.0, 0.0], [10.0, 10.0]],
        [[0.0, 10.0], [-10.0, 10.0]],
    ] {
        let _ = writeln!(text, "G5.2 X{} Y{} P{FRAC_1_SQRT_2:.12} L3", x + i, y + j);
        (x, y) = (x + p, y + q);
        let _ = writeln!(text, "X{x} Y{y} P1\nG5.3");
    }
    text += &flower(count(size, 12, 60), "L4");
    text
}

/// A B-spline around control points by chance, with weights by chance.
fn flower(points: usize, order: &str) -> String {
    let mut random = Random(5);
    let mut text = format!("G5.2 X14 Y20 P1 {order}\n");
    for k in 0..points {
        let angle = TAU * k as f64 / 12.0;
        let radius = random.within(8.0, 30.0);
        let weight = random.within(0.5, 3.0);
        let (x, y) = (radius * angle.cos(), radius * angle.sin());
        let _ = writeln!(text, "X{x:.4} Y{y:.4} P{weight:.3}");
    }
    text + "G5.3\n"
}

/// Control points on each other, cusps, loops, curves back over themselves, corners of heavy weights.
pub(super) fn odd_splines(size: Size) -> String {
    let mut text = String::from(
        "G5 X10 Y0 I10 J10 P-10 Q10\nG5 X20 Y0 I0 J0 P0 Q0\nG5 X30 Y6 I0 J0 P-4 Q3\nG5 X20 Y6 I20 J5 P20 Q5\n\
         G5 X10 Y6 I-15 J0 P15 Q0\nG5.1 X0 Y6 I0 J0\nG5.1 X0 Y6 I5 J5\n\
         G5.2 X10 Y6 P200 L3\nX10 Y16 P200\nX5 Y16 P1\nX0 Y16 P0.01\nX0 Y10 P1\nG5.3\n\
         G5.2 X0 Y20 P1 L5\nX0 Y20 P1\nX0 Y20 P1\nX9 Y20 P1\nX9 Y20 P1\nX9 Y12 P1\nX12 Y12 P1\nG5.3\n",
    );
    text += &flower(count(size, 8, 30), "L3").replace("G5.2 X14 Y20", "G5.2 X14 Y16");
    text
}
