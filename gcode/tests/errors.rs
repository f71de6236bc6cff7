//! Wrong programs and what is said about them: place, rule and remedy.

use gcode::{Error, Interpreter, LINE_MAX, Settings, check};

/// The error that ends a run.
fn first_error(text: &str) -> Error {
    let run = Interpreter::new(Settings::default()).run(text.as_bytes());
    let results: Vec<_> = run.collect();
    let (last, before) = results.split_last().expect("a run is never empty");
    assert!(
        before.iter().all(Result::is_ok),
        "{text}: nothing comes behind an error"
    );
    last.clone().expect_err(text)
}

/// Every program with an M2 behind it: the text of the error, and the part of the program that it marks.
fn expect(table: &[(&str, &str, &str)]) {
    for (program, message, marked) in table {
        let text = format!("{program}\nM2\n");
        let error = first_error(&text);
        assert_eq!(error.to_string(), *message, "{program}");
        assert_eq!(&text[error.span.clone()], *marked, "{program}");
        assert_eq!(check(text.as_bytes(), Settings::default())[0], error, "{program}");
    }
}

#[test]
fn text() {
    let long = format!("G0 X1{}", " ".repeat(LINE_MAX));
    let error = first_error(&long);
    assert_eq!(
        error.to_string(),
        "1:257: line of 261 characters: at most 256 are allowed"
    );
    expect(&[
        (
            "G0 X1 \"",
            "1:7: character '\"' is not allowed here: comments stand in ( ) or behind ;",
            "\"",
        ),
        (
            "(ä) G0 ä",
            "1:8: character 'ä' is not allowed here: comments stand in ( ) or behind ;",
            "ä",
        ),
        (
            "G0 %",
            "1:4: character '%' is not allowed here: comments stand in ( ) or behind ; (% stands alone on the first \
             and last line)",
            "%",
        ),
        (
            "G0 X1\n%",
            "2:1: character '%' is not allowed here: comments stand in ( ) or behind ; (% stands alone on the first \
             and last line)",
            "%",
        ),
        (
            "G0 (a (b) )",
            "1:7: a comment stands inside a comment: close the first one before this (",
            "(",
        ),
        ("G0 (a", "1:4: comment without end: ) is missing on this line", "(a"),
        ("G0 a)", "1:4: A needs a number behind it", "a"),
        ("G0 )", "1:4: ) without ( before it", ")"),
        (
            "(debug, #1)",
            "1:1: comment (DEBUG ...) asks for an action that is not supported: only (MSG, text) is",
            "(debug, #1)",
        ),
        (
            "(LogClose)",
            "1:1: comment (LOGCLOSE ...) asks for an action that is not supported: only (MSG, text) is",
            "(LogClose)",
        ),
        (
            "G0 / X1",
            "1:4: / (block delete) must be the first character of a line",
            "/",
        ),
        (
            "N1 / X1",
            "1:4: / (block delete) must be the first character of a line",
            "/",
        ),
        (
            "G0 N2 X1",
            "1:4: N must come before all other words of a line, once",
            "N2",
        ),
        (
            "N1 N2 X1",
            "1:4: N must come before all other words of a line, once",
            "N2",
        ),
        ("N-1", "1:1: N-1 is negative: it must be 0 or more", "N-1"),
    ]);
}

#[test]
fn constructs_that_are_not_run() {
    expect(&[
        (
            "#1=5",
            "1:1: parameters (#) are not supported: write the number itself",
            "#1=5",
        ),
        (
            "G0 X#1 Y2",
            "1:4: parameters (#) are not supported: write the number itself",
            "X#1 Y2",
        ),
        (
            "G0 X[1+2]",
            "1:4: expressions are not supported: write the number itself",
            "X[1+2]",
        ),
        (
            "G0 X s i n[30]",
            "1:4: expressions are not supported: write the number itself",
            "X s i n[30]",
        ),
        (
            "o100 sub",
            "1:1: O-words (subroutines, loops, conditions) are not supported: write the lines out",
            "o100 sub",
        ),
        (
            "G0 @5 ^30",
            "1:4: polar coordinates (@ and ^) are not supported: write X and Y",
            "@5 ^30",
        ),
        (
            "M3 $1",
            "1:4: spindle numbers ($) are not supported: there is one spindle",
            "$1",
        ),
    ]);
}

#[test]
fn numbers() {
    expect(&[
        ("G0 X", "1:4: X needs a number behind it", "X"),
        ("G0 X-", "1:4: X needs a number behind it", "X-"),
        ("G0 X Y1", "1:4: X needs a number behind it", "X"),
        (
            "G0 X.",
            "1:4: number of X is malformed: one sign, digits and one decimal point at most",
            "X.",
        ),
        (
            "G0 X1.2.3",
            "1:4: number of X is malformed: one sign, digits and one decimal point at most",
            "X1.2.3",
        ),
        (
            "G0 X--1 Y2",
            "1:4: number of X is malformed: one sign, digits and one decimal point at most",
            "X--1",
        ),
        (
            "G0 X1-1",
            "1:4: number of X is malformed: one sign, digits and one decimal point at most",
            "X1-1",
        ),
        (
            "G0 X1000000000.1",
            "1:4: number of X is too large: at most 1000000000",
            "X1000000000.1",
        ),
        (
            "G0 X1e3",
            "1:6: E is used by no code on this line: it belongs to codes that are not supported",
            "e3",
        ),
        ("F-1", "1:1: F-1 is negative: it must be 0 or more", "F-1"),
        ("S-0.5", "1:1: S-0.5 is negative: it must be 0 or more", "S-0.5"),
        ("T-1", "1:1: T-1 is negative: it must be 0 or more", "T-1"),
        ("T1.5", "1:1: T1.5 is not an integer", "T1.5"),
        ("G4 P-1", "1:4: P-1 is negative: it must be 0 or more", "P-1"),
        ("G64 P-1", "1:5: P-1 is negative: it must be 0 or more", "P-1"),
        ("G64 P1 Q-1", "1:8: Q-1 is negative: it must be 0 or more", "Q-1"),
    ]);
}

#[test]
fn codes() {
    expect(&[
        ("G22", "1:1: G22 is no known G code: the nearest one is G21", "G22"),
        ("G0.5 X1", "1:1: G0.5 is no known G code: the nearest one is G0", "G0.5"),
        (
            "G1.01 X1",
            "1:1: G1.01 is no known G code: the nearest one is G1",
            "G1.01",
        ),
        ("G-1", "1:1: G-1 is no known G code: the nearest one is G0", "G-1"),
        (
            "G92 X1",
            "1:1: G92 is not supported: the nearest G code that is, is G91.1",
            "G92",
        ),
        (
            "G38.2 X1",
            "1:1: G38.2 is not supported: the nearest G code that is, is G40",
            "G38.2",
        ),
        (
            "G81 X1",
            "1:1: G81 is not supported: the nearest G code that is, is G80",
            "G81",
        ),
        ("M10", "1:1: M10 is no known M code: the nearest one is M9", "M10"),
        ("M-1", "1:1: M-1 is no known M code: the nearest one is M0", "M-1"),
        ("M3.5", "1:1: M3.5 is no known M code: the nearest one is M3", "M3.5"),
        (
            "M62 P1",
            "1:1: M62 is not supported: the nearest M code that is, is M30",
            "M62",
        ),
        (
            "G0 G1 X1",
            "1:4: G0 and G1 are both of the modal group \"motion\": one of them a line",
            "G1",
        ),
        (
            "G0 G0 X1",
            "1:4: G0 and G0 are both of the modal group \"motion\": one of them a line",
            "G0",
        ),
        (
            "G80 G0 G80 G1 X1",
            "1:12: G0 and G1 are both of the modal group \"motion\": one of them a line",
            "G1",
        ),
        (
            "G17 G18",
            "1:5: G17 and G18 are both of the modal group \"plane\": one of them a line",
            "G18",
        ),
        (
            "G90 G91",
            "1:5: G90 and G91 are both of the modal group \"distance mode\": one of them a line",
            "G91",
        ),
        (
            "G91.1 G90.1",
            "1:7: G91.1 and G90.1 are both of the modal group \"arc distance mode\": one of them a line",
            "G90.1",
        ),
        (
            "G93 G94",
            "1:5: G93 and G94 are both of the modal group \"feed mode\": one of them a line",
            "G94",
        ),
        (
            "G20 G21",
            "1:5: G20 and G21 are both of the modal group \"units\": one of them a line",
            "G21",
        ),
        (
            "G54 G59.3",
            "1:5: G54 and G59.3 are both of the modal group \"coordinate system\": one of them a line",
            "G59.3",
        ),
        (
            "G61 G64",
            "1:5: G61 and G64 are both of the modal group \"path control\": one of them a line",
            "G64",
        ),
        (
            "G4 G53",
            "1:4: G4 and G53 are both of the modal group \"non-modal\": one of them a line",
            "G53",
        ),
        (
            "M0 M30",
            "1:4: M0 and M30 are both of the modal group \"program stop\": one of them a line",
            "M30",
        ),
        (
            "M6 M6",
            "1:4: M6 and M6 are both of the modal group \"tool change\": one of them a line",
            "M6",
        ),
        (
            "M3 M5",
            "1:4: M3 and M5 are both of the modal group \"spindle\": one of them a line",
            "M5",
        ),
        (
            "M7 M8",
            "1:4: M7 and M8 are both of the modal group \"coolant\": one of them a line",
            "M8",
        ),
    ]);
}

#[test]
fn words_and_codes_together() {
    expect(&[
        ("G0 X1 X2", "1:7: X appears twice on this line: once is allowed", "X2"),
        ("F1 G0 F1", "1:7: F appears twice on this line: once is allowed", "F1"),
        (
            "P1",
            "1:1: P is used by no code on this line: it belongs to G2, G3, G4 and G64",
            "P1",
        ),
        (
            "G61 P1",
            "1:5: P is used by no code on this line: it belongs to G2, G3, G4 and G64",
            "P1",
        ),
        (
            "G4 P1 Q1",
            "1:7: Q is used by no code on this line: it belongs to G64",
            "Q1",
        ),
        (
            "G0 X1 K1",
            "1:7: K is used by no code on this line: it belongs to G2 and G3",
            "K1",
        ),
        (
            "G0 X1 R1",
            "1:7: R is used by no code on this line: it belongs to G2 and G3",
            "R1",
        ),
        (
            "F1 G2 I1\nR1",
            "2:1: R is used by no code on this line: it belongs to G2 and G3",
            "R1",
        ),
        (
            "H1",
            "1:1: H is used by no code on this line: it belongs to codes that are not supported",
            "H1",
        ),
        ("X1", "1:1: X needs a motion code: none of G0 G1 G2 G3 is active", "X1"),
        (
            "G54 Y1",
            "1:5: Y needs a motion code: none of G0 G1 G2 G3 is active",
            "Y1",
        ),
        (
            "G0 X1\nG80\nW2",
            "3:1: W needs a motion code: none of G0 G1 G2 G3 is active",
            "W2",
        ),
        (
            "G80 X1",
            "1:5: G80 ends motion, so X has no use on its line: write G0 or G1",
            "X1",
        ),
        (
            "G28 G0 X1",
            "1:5: G28 and G0 would both use the axis words: put them on two lines",
            "G0",
        ),
        (
            "G1 G30",
            "1:1: G30 and G1 would both use the axis words: put them on two lines",
            "G1",
        ),
        ("G4", "1:1: G4 needs P, the seconds to wait", "G4"),
        ("G53", "1:1: G53 needs a G0 or G1 move on its line", "G53"),
        ("G0 X1\nG53", "2:1: G53 needs a G0 or G1 move on its line", "G53"),
        ("F1 G2 I1\nG53 X1", "2:1: G53 needs a G0 or G1 move on its line", "G53"),
        (
            "G91 G53 G0 X1",
            "1:5: G53 names a machine position, which G91 (incremental) cannot: write G90",
            "G53",
        ),
    ]);
}

#[test]
fn feeds() {
    expect(&[
        ("G1", "1:1: G1 needs a feed: F is not set", "G1"),
        ("G0 X1\nX2 G1", "2:4: G1 needs a feed: F is not set", "G1"),
        ("G1 F0 X1", "1:1: G1 needs a feed: F is not set", "G1"),
        ("G3 X1 I.5", "1:1: G3 needs a feed: F is not set", "G3"),
        (
            "G1 F1 X1\nG94\nY1",
            "3:1: G1 needs a feed: F is not set (G93, G94 clear it)",
            "Y1",
        ),
        (
            "G93 G1 X1",
            "1:5: G1 in inverse time mode (G93) needs F above 0 on its own line",
            "G1",
        ),
        (
            "G93 G1 X1 F1\nX2",
            "2:1: G1 in inverse time mode (G93) needs F above 0 on its own line",
            "X2",
        ),
        (
            "G93 G1 X1 F0",
            "1:5: G1 in inverse time mode (G93) needs F above 0 on its own line",
            "G1",
        ),
    ]);
}

#[test]
fn arcs() {
    expect(&[
        (
            "F1 G2 X1 Y1",
            "1:4: G2 needs I, J or R: neither centre nor radius is given",
            "G2",
        ),
        (
            "F1 G18 G3",
            "1:8: G3 needs I, K or R: neither centre nor radius is given",
            "G3",
        ),
        (
            "F1 G2 I1\nX1",
            "2:1: G2 needs I, J or R: neither centre nor radius is given",
            "X1",
        ),
        (
            "F1 G2 X1 I5 K1",
            "1:13: K is no centre offset of the plane G17: it takes I, J",
            "K1",
        ),
        (
            "F1 G18 G2 X1 I5 J1",
            "1:17: J is no centre offset of the plane G18: it takes I, K",
            "J1",
        ),
        (
            "F1 G19 G2 Y1 J5 I1",
            "1:17: I is no centre offset of the plane G19: it takes J, K",
            "I1",
        ),
        ("F1 G2 I5 R5 X1", "1:7: an arc takes I or R, not both", "I5"),
        (
            "F1 G90.1 G2 X10 I5",
            "1:17: absolute arc centres (G90.1) need both coordinates: J is missing",
            "I5",
        ),
        (
            "F1 G2 R5",
            "1:7: an arc by R needs its end point: X and Y are missing",
            "R5",
        ),
        (
            "F1 G19 G2 R5 X1",
            "1:11: an arc by R needs its end point: Y and Z are missing",
            "R5",
        ),
        (
            "F1 G2 R5 X0",
            "1:7: an arc by R cannot end where it starts: write a full circle with I, J",
            "R5",
        ),
        (
            "F1 G2 R4.99 X10",
            "1:7: radius 4.9900 is too small: half the distance to the end point is 5.0000",
            "R4.99",
        ),
        (
            "F1 G2 R0 X1",
            "1:7: radius 0.0000 is too small: half the distance to the end point is 0.5000",
            "R0",
        ),
        (
            "F1 G2 I0 J0",
            "1:7: the centre of the arc lies on its start or end: the radius is 0",
            "I0",
        ),
        (
            "F1 G2 I5 X5",
            "1:7: the centre of the arc lies on its start or end: the radius is 0",
            "I5",
        ),
        (
            "F1 G2 X10 I5.025",
            "1:11: radius at start 5.0250, at end 4.9750: difference 0.0500 > 0.0283 tolerance",
            "I5.025",
        ),
        (
            "F1 G20 G2 X10 I5.025",
            "1:15: radius at start 5.0250, at end 4.9750: difference 0.0500 > 0.0050 tolerance",
            "I5.025",
        ),
        (
            "F1 G2 X10 I5 P0",
            "1:14: P0 of an arc is its number of turns: an integer from 1 to 1000000",
            "P0",
        ),
        (
            "F1 G2 X10 I5 P1.5",
            "1:14: P1.5 of an arc is its number of turns: an integer from 1 to 1000000",
            "P1.5",
        ),
        (
            "F1 G2 X10 R5 P-1",
            "1:14: P-1 of an arc is its number of turns: an integer from 1 to 1000000",
            "P-1",
        ),
    ]);
}

#[test]
fn ends() {
    let end = |text: &str| first_error(text).to_string();
    assert_eq!(
        end(""),
        "1:1: the program ends without M2 or M30: write one as its last line"
    );
    assert_eq!(
        end("\n\n"),
        "2:1: the program ends without M2 or M30: write one as its last line"
    );
    assert_eq!(
        end("G0 X1\nG0 X2\n"),
        "2:6: the program ends without M2 or M30: write one as its last line"
    );
    assert_eq!(
        end("G0 X1"),
        "1:6: the program ends without M2 or M30: write one as its last line"
    );
    assert_eq!(
        end("%\nG0"),
        "2:3: the program ends without M2, M30 or the % that belongs to the % at its start"
    );
    assert_eq!(end("/M2x"), "1:4: X needs a number behind it");
}

#[test]
fn a_block_with_an_error_has_no_effect() {
    let text = b"G0 X1\n(a) F100 S5 M3 G1 X2 G4\nM2";
    let results: Vec<_> = Interpreter::new(Settings::default()).run(text).collect();
    let lines: Vec<_> = results
        .iter()
        .map(|result| result.as_ref().map(|event| event.source.line))
        .collect();
    assert_eq!(lines[..5], [Ok(0), Ok(0), Ok(0), Ok(0), Ok(1)]);
    assert_eq!(
        lines[5].unwrap_err().to_string(),
        "2:22: G4 needs P, the seconds to wait"
    );
    assert_eq!(lines.len(), 6);
}

#[test]
fn check_finds_every_mistake_once() {
    let text = "\
X1 (no motion yet)
X2
G1 X3
X4 K1
G2 X5 Y1
G22 G23 X6 I1
G1 X-7 X8 F-1
G1 X9
G1 X10 \" Z..
(MSG, fine)
G91 M2 H1
not read";
    let errors = check(text.as_bytes(), Settings::default());
    let found: Vec<_> = errors
        .iter()
        .map(|error| (error.line, error.column, &text[error.span.clone()]))
        .collect();
    assert_eq!(
        found,
        [
            (1, 1, "X1"),
            (3, 1, "G1"),
            (4, 4, "K1"),
            (5, 1, "G2"),
            (6, 1, "G22"),
            (6, 5, "G23"),
            (7, 8, "X8"),
            (7, 11, "F-1"),
            (9, 8, "\""),
            (9, 10, "Z.."),
            (11, 8, "H1"),
        ]
    );
}

#[test]
fn a_correct_program_has_no_errors() {
    assert_eq!(check(b"%\nG0 X1\n%", Settings::default()), []);
}

#[test]
fn errors_are_shown_in_their_line() {
    let text = "G0 X1\n(ä) G1 X2 \r\nM2\n";
    let error = first_error(text);
    assert_eq!(
        error.render("part.ngc", text.as_bytes()),
        "\
error: G1 needs a feed: F is not set
 --> part.ngc:2:5
  |
2 | (ä) G1 X2 
  |     ^^"
    );
}
