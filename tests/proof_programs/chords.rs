//! Curves as CAM systems write them: many short straight moves.

use super::random::{Random, count};
use super::{Size, along};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

/// A circle as chords of 0.1 mm.
pub(super) fn circle(size: Size) -> String {
    let (radius_mm, laps) = match size {
        Size::Small => (5.0, 1),
        Size::Full => (20.0, 3),
    };
    let chords = (TAU * radius_mm / 0.1_f64).round() as usize;
    along((0..=laps * chords).map(|k| {
        let angle = PI + TAU * k as f64 / chords as f64;
        [radius_mm * (1.0 + angle.cos()), radius_mm * angle.sin(), 0.0]
    }))
}

/// A flower of seeded harmonics in three axes; chords of 0.004 to 0.4 mm.
pub(super) fn rose(size: Size) -> String {
    let mut random = Random(20_240);
    let mut harmonics = |orders: [f64; 6]| {
        orders.map(|order: f64| {
            let amount = random.within(0.3, 1.0) * 40.0 / order.powf(1.2);
            (order, amount, random.within(0.0, TAU))
        })
    };
    let across = harmonics([1.0, 2.0, 3.0, 5.0, 8.0, 13.0]);
    let along_y = harmonics([1.0, 2.0, 4.0, 7.0, 11.0, 17.0]);
    let at = |t: f64| {
        let sum = |harmonics: [(f64, f64, f64); 6]| -> f64 {
            harmonics
                .iter()
                .map(|(order, amount, phase)| amount * (order * t + phase).sin())
                .sum()
        };
        // A slow change, so that no turn is like another.
        let swell = 1.0 + 0.15 * (0.618_03 * t).sin();
        [swell * sum(across), swell * sum(along_y), 3.0 * (0.5 * t).sin()]
    };
    let start = at(0.0);
    // The small one is the beginning of the full one.
    along((0..=count(size, 400, 20_000)).map(|k| {
        let point = at(8.0 * TAU * k as f64 / 20_000.0);
        std::array::from_fn(|axis| point[axis] - start[axis])
    }))
}

/// An Archimedean spiral of 1 mm pitch from its centre; chords of 0.1 mm.
pub(super) fn spiral(size: Size) -> String {
    let turns = count(size, 4, 30) as f64;
    let mut angle = 0.0_f64;
    let mut points = vec![[0.0; 3]];
    while angle < TAU * turns {
        let radius = angle / TAU;
        // Length by angle of r = angle / tau.
        angle += 0.1 / radius.hypot(1.0 / TAU);
        points.push([angle / TAU * angle.cos(), angle / TAU * angle.sin(), 0.0]);
    }
    along(points)
}

/// Loops of 3 mm that step forward by 0.8 mm each, as for clearing a slot; chords of 0.35 mm, links with a lift.
pub(super) fn trochoid(size: Size) -> String {
    const RADIUS_MM: f64 = 3.0;
    const STEP_MM: f64 = 0.8;
    const CHORDS: usize = 55;
    let (rows, loops) = (count(size, 1, 8), count(size, 3, 40));
    let mut text = String::new();
    for row in 0..rows {
        let y = row as f64 * 4.0;
        for k in 0..loops * CHORDS + 1 {
            let turn = k as f64 / CHORDS as f64;
            let (sin, cos) = (TAU * turn).sin_cos();
            let _ = writeln!(
                text,
                "G1 X{:.4} Y{:.4}",
                STEP_MM * turn + RADIUS_MM * sin,
                y + RADIUS_MM * (1.0 - cos)
            );
        }
        let _ = writeln!(text, "G1 Z1\nG0 X0 Y{:.4}\nG1 Z0", y + 4.0);
    }
    text
}

/// Finishing of a waved surface in rows, there and back; blocks of 0.1 mm. The full one has 200,000.
pub(super) fn surface(size: Size) -> String {
    let (rows, blocks) = (count(size, 3, 200), count(size, 100, 1000));
    let mut text = String::new();
    for row in 0..rows {
        let y = row as f64 * 0.3;
        for k in 0..=blocks {
            let k = if row % 2 == 0 { k } else { blocks - k };
            let x = k as f64 * 0.1;
            let z = 2.0 * (x / 7.0).sin() * (y / 11.0).cos() + 0.8 * ((x + y) / 2.5).sin();
            let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4}");
        }
    }
    text
}

/// Five points around a circle of 30 mm, one lap: r = 30 (1 + 0.35 cos 5t). Length 293.7 mm.
pub(super) fn star(size: Size) -> String {
    let chords = 2937;
    // The small one stops early.
    along((0..=count(size, 400, chords)).map(|k| {
        let t = TAU * k as f64 / chords as f64;
        let r = 30.0 * (1.0 + 0.35 * (5.0 * t).cos());
        [r * t.cos(), r * t.sin(), 0.0]
    }))
}

/// (60 sin 2t, 40 sin 3t, 3 sin t), one period; chords of about 0.2 mm.
pub(super) fn lissajous(size: Size) -> String {
    let chords = 4000;
    along((0..=count(size, 400, chords)).map(|k| {
        let t = TAU * k as f64 / chords as f64;
        [60.0 * (2.0 * t).sin(), 40.0 * (3.0 * t).sin(), 3.0 * t.sin()]
    }))
}
