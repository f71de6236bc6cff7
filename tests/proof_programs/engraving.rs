//! Text of single strokes: short lines and arcs, with lifts between.

use super::Size;
use std::fmt::Write as _;

/// One step of the pen; places on a grid 4 wide and 6 high.
enum Pen {
    /// Lifts and goes there.
    Go(f64, f64),
    /// Draws straight.
    Line(f64, f64),
    /// Draws an arc of this radius, clockwise.
    Clockwise(f64, f64, f64),
    /// Draws an arc of this radius, counter-clockwise.
    Counter(f64, f64, f64),
}
use Pen::{Clockwise, Counter, Go, Line};

/// The strokes of a letter; `None`: a space.
fn strokes(letter: char) -> Option<&'static [Pen]> {
    Some(match letter {
        'A' => &[
            Go(0.0, 0.0),
            Line(2.0, 6.0),
            Line(4.0, 0.0),
            Go(0.7, 2.0),
            Line(3.3, 2.0),
        ],
        'C' => &[
            Go(4.0, 4.0),
            Counter(0.0, 4.0, 2.0),
            Line(0.0, 2.0),
            Counter(4.0, 2.0, 2.0),
        ],
        'I' => &[Go(2.0, 0.0), Line(2.0, 6.0)],
        'N' => &[Go(0.0, 0.0), Line(0.0, 6.0), Line(4.0, 0.0), Line(4.0, 6.0)],
        'O' => &[
            Go(4.0, 2.0),
            Line(4.0, 4.0),
            Counter(0.0, 4.0, 2.0),
            Line(0.0, 2.0),
            Counter(4.0, 2.0, 2.0),
        ],
        'S' => &[Go(3.5, 4.5), Counter(2.0, 3.0, 1.5), Clockwise(0.5, 1.5, 1.5)],
        'X' => &[Go(0.0, 0.0), Line(4.0, 6.0), Go(0.0, 6.0), Line(4.0, 0.0)],
        '0' => &[
            Go(4.0, 2.0),
            Line(4.0, 4.0),
            Counter(0.0, 4.0, 2.0),
            Line(0.0, 2.0),
            Counter(4.0, 2.0, 2.0),
            Go(0.8, 1.2),
            Line(3.2, 4.8),
        ],
        '2' => &[Go(0.0, 4.0), Clockwise(4.0, 4.0, 2.0), Line(0.0, 0.0), Line(4.0, 0.0)],
        '3' => &[
            Go(0.5, 6.0),
            Line(3.5, 6.0),
            Line(2.0, 3.5),
            Clockwise(2.0, 0.0, 1.75),
            Line(0.5, 0.0),
        ],
        '5' => &[
            Go(4.0, 6.0),
            Line(0.5, 6.0),
            Line(0.5, 3.5),
            Line(2.2, 3.5),
            Clockwise(2.2, 0.0, 1.75),
            Line(0.0, 0.0),
        ],
        '-' => &[Go(1.0, 3.0), Line(3.0, 3.0)],
        '.' => &[Go(2.0, 0.0), Line(2.0, 0.1)],
        _ => return None,
    })
}

/// A line of text at three sizes, 6 to 1.2 mm high.
pub(super) fn text(size: Size) -> String {
    let (letters, scales): (_, &[f64]) = match size {
        Size::Small => ("SX2", &[0.2]),
        Size::Full => ("ISOCNC 5-AXIS 0.0023 NANOCOSINOS", &[1.0, 0.5, 0.2]),
    };
    let mut text = String::from("G0 Z1\n");
    for (row, scale) in scales.iter().enumerate() {
        let mut left = 0.0;
        for letter in letters.chars() {
            let at = |x: f64, y: f64| format!("X{:.4} Y{:.4}", (left + x) * scale, y * scale - 10.0 * row as f64);
            for step in strokes(letter).into_iter().flatten() {
                let _ = match *step {
                    Go(x, y) => writeln!(text, "G0 Z1\nG0 {}\nG1 Z-0.2", at(x, y)),
                    Line(x, y) => writeln!(text, "G1 {}", at(x, y)),
                    Clockwise(x, y, radius) => writeln!(text, "G2 {} R{:.4}", at(x, y), radius * scale),
                    Counter(x, y, radius) => writeln!(text, "G3 {} R{:.4}", at(x, y), radius * scale),
                };
            }
            left += 6.0;
        }
    }
    text.push_str("G0 Z1\n");
    text
}
