//! Closed rings inside each other. Tools have a radius of 1 mm.

use super::*;
use std::fmt::Write;

/// Closed contours that begin and end on the X axis.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Square,
    Circle,
    HalfCircles,
    Rounded,
    /// Arcs in many small lines.
    ManyCorners,
    /// Goes on past its start.
    Overlapping,
}

const SHAPES: [Shape; 6] = [
    Shape::Square,
    Shape::Circle,
    Shape::HalfCircles,
    Shape::Rounded,
    Shape::ManyCorners,
    Shape::Overlapping,
];

/// How far an overlapping ring goes on past its start, mm.
const OVERLAP_MM: f64 = 0.6;

/// A ring from `X size Y start`, counter-clockwise with `turn` 1, clockwise with -1.
fn ring(shape: Shape, size: f64, start: f64, turn: f64) -> String {
    let (r, y, arc) = (size, size * turn, if turn > 0.0 { 3 } else { 2 });
    let square = format!("G1 Y{y}\nX-{r}\nY{}\nX{r}\n", -y);
    match shape {
        Shape::Square => format!("{square}Y{start}\n"),
        Shape::Overlapping => format!("{square}Y{}\n", start + OVERLAP_MM * turn),
        Shape::Circle => format!("G{arc} X{r} Y0 I-{r}\n"),
        Shape::HalfCircles => format!("G{arc} X-{r} Y0 I-{r}\nX{r} I{r}\n"),
        Shape::Rounded | Shape::ManyCorners => {
            let mut text = String::new();
            for [x, y] in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]] {
                let centre = [x * (r - 3.0), y * (r - 3.0)];
                let start_angle = f64::atan2(y, x).to_degrees() - 45.0;
                let steps = if matches!(shape, Shape::Rounded) { 1 } else { 200 };
                let at = |step: u32| {
                    let (sin, cos) = (start_angle + 90.0 * f64::from(step) / f64::from(steps))
                        .to_radians()
                        .sin_cos();
                    [centre[0] + 3.0 * cos, turn * (centre[1] + 3.0 * sin)]
                };
                let [x0, y0] = at(0);
                let _ = writeln!(text, "G1 X{x0:.5} Y{y0:.5}");
                for step in 1..=steps {
                    let [x1, y1] = at(step);
                    let _ = match shape {
                        Shape::Rounded => writeln!(
                            text,
                            "G{arc} X{x1:.5} Y{y1:.5} I{:.5} J{:.5}",
                            centre[0] - x0,
                            turn * centre[1] - y0
                        ),
                        _ => writeln!(text, "X{x1:.5} Y{y1:.5}"),
                    };
                }
            }
            text + &format!("G1 X{r} Y0\n")
        }
    }
}

/// From one ring to the next.
#[derive(Clone, Copy, Debug)]
enum Link {
    Feed,
    /// Up, over and down.
    Traverse,
}

/// Rings of these sizes in this order; the tool is inside of all or outside of all.
fn rings(shape: Shape, sizes: &[f64], inside: bool, side: Side, link: Link) -> String {
    let turn = if inside == (side == Side::Left) { 1.0 } else { -1.0 };
    let code = if side == Side::Left { 41.1 } else { 42.1 };
    let away = if inside { 0.0 } else { 30.0 };
    let mut program = format!("G0 X{away} Y0\nG{code} D2\nG1 X{}\n", sizes[0]);
    for (i, size) in sizes.iter().enumerate() {
        let start = match shape {
            Shape::Overlapping => turn * OVERLAP_MM * i as f64,
            _ => 0.0,
        };
        if i > 0 {
            program += &match link {
                Link::Feed => format!("G1 X{size} Y{start}\n"),
                Link::Traverse => format!("G0 Z5\nX{size} Y{start}\nG1 Z0\n"),
            };
        }
        program += &ring(shape, *size, start, turn);
    }
    program + &format!("G40\nG0 X{away} Y0\n")
}

/// The program passes, and its path is that of the moves without look-ahead.
fn passes(program: &str) -> Result<(), String> {
    let plain = run(program);
    let lines = run_with(Settings::default(), program);
    match plain.iter().chain(&lines).find(|line| line.starts_with("line ")) {
        Some(error) => Err(error.clone()),
        None if plain != lines => Err("other moves".to_owned()),
        None => Ok(()),
    }
}

#[test]
fn rings_inside_each_other_are_steps_of_clearing() {
    let mut wrong = Vec::new();
    for shape in SHAPES {
        for sizes in [
            &[5.0, 6.5, 8.0, 9.2][..],
            &[9.2, 8.0, 6.5, 5.0],
            &[6.5, 9.2, 5.0, 8.0],
            &[5.0, 6.2],
        ] {
            if matches!(shape, Shape::Overlapping) && sizes == [6.5, 9.2, 5.0, 8.0] {
                continue; // the way to the last ring crosses the one to the second
            }
            for side in [Side::Left, Side::Right] {
                for (inside, link) in [
                    (true, Link::Feed),
                    (true, Link::Traverse),
                    (false, Link::Feed),
                    (false, Link::Traverse),
                ] {
                    if let Err(error) = passes(&rings(shape, sizes, inside, side, link)) {
                        wrong.push(format!(
                            "{shape:?} {sizes:?} {side:?} inside: {inside} {link:?}: {error}"
                        ));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{} {wrong:#?}", wrong.len());
}

/// A clearing pocket of squares with something else in the program, the tool's radius 1 mm: the lines of the tool's move and of
/// the contour's that is cut.
#[test]
fn what_is_a_wall_among_rings_stays_one() {
    let square = |size: f64| ring(Shape::Square, size, 0.0, 1.0);
    let begin = "G0 X0 Y0\nG41.1 D2\n";
    let up = "G0 Z5\n";
    // Lines 4 to 8, 10 to 14.
    let two = format!("{begin}G1 X5\n{}G1 X6.5\n{}", square(5.0), square(6.5));
    let cases = [
        (
            "an island between the rings, where the inner one comes by",
            format!("{two}{up}X-1.9 Y0\nG1 Z0\nG2 I-1\nG40\nG0 X0 Y0\n"),
            Some((6, 18)),
        ),
        (
            "an island as far from all",
            format!("{two}{up}X-1.1 Y0\nG1 Z0\nG2 I-0.9\nG40\nG0 X0 Y0\n"),
            None,
        ),
        (
            "a ring that crosses another one",
            format!("{begin}G1 X5\n{}{up}X7\nG1 Z0\nG3 I-5\nG40\nG0 X0\n", square(5.0)),
            Some((4, 12)),
        ),
        (
            "a way out through the last ring",
            format!("{two}G40\nG1 X-20 Y-3\n"),
            Some((16, 12)),
        ),
        (
            "a way out through a ring in a larger one that is not as deep",
            format!(
                "{begin}G1 X9\n{}{up}X3\nX5\nG1 Z-4\n{}X8\nG40\nG0 X0 Z5\n",
                square(9.0),
                square(5.0)
            ),
            Some((18, 13)),
        ),
        (
            "the same in one that is",
            format!(
                "{begin}G1 X9\n{}{up}X3\nX5\nG1 Z0\n{}X8\nG40\nG0 X0 Z5\n",
                square(9.0),
                square(5.0)
            ),
            None,
        ),
        (
            "a ring with a neck too narrow for the tool",
            format!(
                "G0 X3 Y0\nG41.1 D2\nG1 X5\nY7\nX2\nY3.9\nX-2\nY7\nX-5\nY-5\nX-2\nY2\nX2\nY-5\nX5\nY0\nX9\n{}G40\nG0 X0\n",
                square(9.0)
            ),
            Some((7, 13)),
        ),
        (
            "the same contour twice, and a way out through it",
            format!("{begin}G1 X5\n{}{}G40\nG1 X-20 Y-3\n", square(5.0), square(5.0)),
            Some((15, 6)),
        ),
        (
            "a spiral",
            format!("{begin}G1 X5\nY5\nX-5\nY-5\nX6.5\nY6.5\nX-6.5\nY-6.5\nX5\nG40\nG0 X0 Y0\n"),
            Some((8, 4)),
        ),
    ];
    let mut wrong = Vec::new();
    for (name, program, lines) in cases {
        let found = run_with(Settings::default(), &program)
            .into_iter()
            .find(|line| line.starts_with("line "));
        let as_wanted = match (&found, lines) {
            (None, None) => true,
            (Some(error), Some((tool, contour))) => {
                error.contains(&format!("the move of line {tool} a tool"))
                    && error.contains(&format!("into the contour of line {contour}, at "))
            }
            _ => false,
        };
        if !as_wanted {
            wrong.push(format!("{name}: {lines:?} {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
