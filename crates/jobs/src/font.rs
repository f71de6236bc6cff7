//! The letters: single strokes on a grid.
//!
//! In:  a character. Out: its width and its strokes, in units of the grid: capitals are [`CAPITAL`] high, the base line is at 0.
//!
//! A glyph is written as strokes, with `;` between them. A stroke is its points, with what leads to each: nothing is a line, `q` and `Q` a
//! quarter of a circle, `h` and `H` half of one; small letters turn counter-clockwise, large ones clockwise. One point alone is a dot.

/// Height of capitals, in units.
pub(crate) const CAPITAL: f64 = 8.0;
/// Between two glyphs, in units.
pub(crate) const SPACING: f64 = 2.0;

/// Character, width in units, strokes.
const GLYPHS: [(char, f64, &str); 102] = [
    (' ', 3.0, ""),
    ('!', 0.0, "0,8 0,2.5;0,0"),
    ('"', 2.0, "0,8 0,6;2,8 2,6"),
    ('#', 5.0, "1,1 2,7;3,1 4,7;0,3 4.5,3;0.5,5 5,5"),
    ('$', 4.0, "4,6 h0,6 q2,4 Q4,2 H0,2;2,9 2,-1"),
    ('%', 6.0, "0,0 6,8;0,7 H2,7 H0,7;4,1 H6,1 H4,1"),
    (
        '&',
        6.0,
        "6,0 1,5.5 1,7 2,8 3,8 4,7 4,6 0.5,3.5 0,2.5 0,1.5 1.5,0 3.5,0 6,3",
    ),
    ('\'', 0.0, "0,8 0,6"),
    ('(', 2.0, "2,9 q2,-1"),
    (')', 2.0, "0,9 Q0,-1"),
    ('*', 4.0, "2,6.5 2,1.5;0,5.25 4,2.75;0,2.75 4,5.25"),
    ('+', 4.0, "2,6 2,2;0,4 4,4"),
    (',', 1.0, "1,0 0,-2"),
    ('-', 4.0, "0,4 4,4"),
    ('.', 0.0, "0,0"),
    ('/', 4.0, "0,0 4,8"),
    ('0', 4.0, "0,2 0,6 H4,6 4,2 H0,2"),
    ('1', 2.0, "0,6 2,8 2,0"),
    ('2', 4.0, "0,6 H4,6 0,0 4,0"),
    ('3', 4.0, "0,6 H4,6 Q2,4 Q4,2 H0,2"),
    ('4', 5.0, "4,0 4,8 0,2.5 5,2.5"),
    ('5', 4.0, "4,8 0,8 0,5 1.5,5 Q4,2.5 Q1.5,0 0,0"),
    ('6', 4.0, "4,8 q0,4 0,2 h4,2 h0,2"),
    ('7', 4.0, "0,8 4,8 1,0"),
    ('8', 4.0, "2,4 q4,6 h0,6 q2,4 Q4,2 H0,2 Q2,4"),
    ('9', 4.0, "0,0 q4,4 4,6 h0,6 h4,6"),
    (':', 0.0, "0,0;0,4"),
    (';', 1.0, "1,4;1,0 0,-2"),
    ('<', 4.0, "4,7 0,4 4,1"),
    ('=', 4.0, "0,5 4,5;0,3 4,3"),
    ('>', 4.0, "0,7 4,4 0,1"),
    ('?', 4.0, "0,6 H4,6 Q2,4 2,2.5;2,0"),
    ('@', 8.0, "6,4 h2,4 h6,4 h8,4 h0,4 q4,0"),
    ('A', 6.0, "0,0 3,8 6,0;1.125,3 4.875,3"),
    ('B', 5.0, "0,0 0,8 3,8 H3,4 0,4;3,4 H3,0 0,0"),
    ('C', 6.0, "6,5 q3,8 q0,5 0,3 q3,0 q6,3"),
    ('D', 5.0, "0,0 0,8 2,8 Q5,5 5,3 Q2,0 0,0"),
    ('E', 4.0, "4,0 0,0 0,8 4,8;0,4 3,4"),
    ('F', 4.0, "0,0 0,8 4,8;0,4 3,4"),
    ('G', 6.0, "6,5 q3,8 q0,5 0,3 q3,0 q6,3 6,4 3.5,4"),
    ('H', 5.0, "0,0 0,8;5,0 5,8;0,4 5,4"),
    ('I', 0.0, "0,0 0,8"),
    ('J', 4.0, "0,2 h4,2 4,8"),
    ('K', 5.0, "0,0 0,8;5,8 0,3;1.8,4.8 5,0"),
    ('L', 4.0, "0,8 0,0 4,0"),
    ('M', 6.0, "0,0 0,8 3,3 6,8 6,0"),
    ('N', 5.0, "0,0 0,8 5,0 5,8"),
    ('O', 6.0, "0,3 0,5 Q3,8 Q6,5 6,3 Q3,0 Q0,3"),
    ('P', 5.0, "0,0 0,8 3,8 H3,4 0,4"),
    ('Q', 6.0, "0,3 0,5 Q3,8 Q6,5 6,3 Q3,0 Q0,3;4,2 6.5,-0.5"),
    ('R', 5.0, "0,0 0,8 3,8 H3,4 0,4;2.5,4 5,0"),
    ('S', 4.0, "4,6 h0,6 q2,4 Q4,2 H0,2"),
    ('T', 6.0, "3,0 3,8;0,8 6,8"),
    ('U', 5.0, "0,8 0,2.5 h5,2.5 5,8"),
    ('V', 6.0, "0,8 3,0 6,8"),
    ('W', 8.0, "0,8 2,0 4,6 6,0 8,8"),
    ('X', 5.0, "0,0 5,8;0,8 5,0"),
    ('Y', 6.0, "0,8 3,4 6,8;3,4 3,0"),
    ('Z', 5.0, "0,8 5,8 0,0 5,0"),
    ('[', 2.0, "2,9 0,9 0,-1 2,-1"),
    ('\\', 4.0, "0,8 4,0"),
    (']', 2.0, "0,9 2,9 2,-1 0,-1"),
    ('^', 4.0, "0,5 2,8 4,5"),
    ('_', 5.0, "0,-1 5,-1"),
    ('`', 1.0, "0,8 1,6.5"),
    ('a', 4.0, "4,3 h0,3 0,2 h4,2;4,5 4,0"),
    ('b', 4.0, "0,8 0,0;0,3 H4,3 4,2 H0,2"),
    ('c', 4.0, "4,3 h0,3 0,2 h4,2"),
    ('d', 4.0, "4,8 4,0;4,3 h0,3 0,2 h4,2"),
    ('e', 4.0, "0,2.5 4,2.5 4,3 h0,3 0,2 q2,0 3.5,0"),
    ('f', 3.0, "3,8 q1,6 1,0;0,5 3,5"),
    ('g', 4.0, "4,5 4,-1 H0,-1;4,3 h0,3 0,2 h4,2"),
    ('h', 4.0, "0,0 0,8;0,3 H4,3 4,0"),
    ('i', 0.0, "0,0 0,5;0,7"),
    ('j', 2.0, "2,5 2,-1 Q0,-3;2,7"),
    ('k', 4.0, "0,0 0,8;4,5 0,2;1.5,3.125 4,0"),
    ('l', 1.0, "0,8 0,1 q1,0"),
    ('m', 6.0, "0,0 0,5;0,3.5 H3,3.5 3,0;3,3.5 H6,3.5 6,0"),
    ('n', 4.0, "0,0 0,5;0,3 H4,3 4,0"),
    ('o', 4.0, "0,2 0,3 H4,3 4,2 H0,2"),
    ('p', 4.0, "0,5 0,-3;0,3 H4,3 4,2 H0,2"),
    ('q', 4.0, "4,5 4,-3;4,3 h0,3 0,2 h4,2"),
    ('r', 3.0, "0,0 0,5;0,3 Q2,5 3,5"),
    ('s', 2.5, "2.5,3.75 h0,3.75 q1.25,2.5 Q2.5,1.25 H0,1.25"),
    ('t', 3.0, "1,8 1,2 q3,0;0,5 3,5"),
    ('u', 4.0, "0,5 0,2 h4,2;4,5 4,0"),
    ('v', 4.0, "0,5 2,0 4,5"),
    ('w', 6.0, "0,5 1.5,0 3,4 4.5,0 6,5"),
    ('x', 4.0, "0,0 4,5;0,5 4,0"),
    ('y', 4.0, "0,5 2,0;4,5 1,-2.5"),
    ('z', 4.0, "0,5 4,5 0,0 4,0"),
    ('{', 3.0, "3,9 q2,8 2,5 Q1,4 Q2,3 2,0 q3,-1"),
    ('|', 0.0, "0,9 0,-1"),
    ('}', 3.0, "0,9 Q1,8 1,5 q2,4 q1,3 1,0 Q0,-1"),
    ('~', 4.0, "0,3.5 Q2,4 q4,4.5"),
    ('Ä', 6.0, "0,0 3,8 6,0;1.125,3 4.875,3;1.5,10;4.5,10"),
    ('Ö', 6.0, "0,3 0,5 Q3,8 Q6,5 6,3 Q3,0 Q0,3;1.5,10;4.5,10"),
    ('Ü', 5.0, "0,8 0,2.5 h5,2.5 5,8;1.25,10;3.75,10"),
    ('ä', 4.0, "4,3 h0,3 0,2 h4,2;4,5 4,0;1,7;3,7"),
    ('ö', 4.0, "0,2 0,3 H4,3 4,2 H0,2;1,7;3,7"),
    ('ü', 4.0, "0,5 0,2 h4,2;4,5 4,0;1,7;3,7"),
    ('ß', 4.0, "0,0 0,6.5 H3,6.5 Q1.5,5 Q4,2.5 Q1.5,0"),
];

/// A piece of a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) to: [f64; 2],
    /// How far it turns, degrees, counter-clockwise; 0: a line.
    pub(crate) sweep: f64,
}

/// A stroke: where it begins, and its pieces; a dot has none.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stroke {
    pub(crate) from: [f64; 2],
    pub(crate) pieces: Vec<Piece>,
}

/// Width and strokes of a character; `None`: the font does not have it.
pub(crate) fn glyph(wanted: char) -> Option<(f64, Vec<Stroke>)> {
    let (_, width, strokes) = GLYPHS.iter().find(|(letter, ..)| *letter == wanted)?;
    Some((*width, strokes.split(';').filter_map(stroke).collect()))
}

fn stroke(text: &str) -> Option<Stroke> {
    let mut pieces = text.split_whitespace().filter_map(piece);
    Some(Stroke {
        from: pieces.next()?.to,
        pieces: pieces.collect(),
    })
}

fn piece(text: &str) -> Option<Piece> {
    let sweep = match text.chars().next()? {
        'q' => 90.0,
        'Q' => -90.0,
        'h' => 180.0,
        'H' => -180.0,
        _ => 0.0,
    };
    let (x, y) = text.trim_start_matches(['q', 'Q', 'h', 'H']).split_once(',')?;
    Some(Piece {
        to: [x.parse().ok()?, y.parse().ok()?],
        sweep,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_letters_are_there_and_lie_within_their_width() {
        let wanted = (32..127_u8).map(char::from).chain("ÄÖÜäöüß".chars());
        for letter in wanted.clone() {
            let (width, strokes) = glyph(letter).unwrap_or_else(|| panic!("no {letter}"));
            assert_eq!(strokes.is_empty(), letter == ' ', "{letter}");
            let (_, _, text) = GLYPHS.iter().find(|(of, ..)| *of == letter).unwrap();
            let points: usize = strokes.iter().map(|stroke| 1 + stroke.pieces.len()).sum();
            assert_eq!(points, text.matches(',').count(), "{letter}: a point that is not read");
            for stroke in strokes {
                let mut from = stroke.from;
                let points = std::iter::once(stroke.from).chain(stroke.pieces.iter().map(|piece| piece.to));
                for [x, y] in points {
                    assert!(
                        (-0.5..=width + 0.5).contains(&x) && (-3.0..=10.0).contains(&y),
                        "{letter}: {x} {y}"
                    );
                }
                for piece in stroke.pieces {
                    assert_ne!(piece.to, from, "{letter}");
                    from = piece.to;
                }
            }
        }
        assert_eq!(wanted.count(), GLYPHS.len());
        assert_eq!(glyph('€'), None);
    }
}
