//! Programs and the calls that they must give; values worked out by hand.

use gcode::{Interpreter, Settings};
use motion::canon::{Axis, Call, Event, LengthUnit, PathMode, Plane, Position, SpindleDirection};

fn events(text: &str, settings: Settings) -> Vec<Event> {
    let text = format!("{text}\nM2\n");
    Interpreter::new(settings)
        .run(text.as_bytes())
        .map(|event| event.unwrap_or_else(|error| panic!("{}", error.render("test.ngc", text.as_bytes()))))
        .collect()
}

/// Calls between those of the start (line 0) and those of the M2 that is put behind `text`.
fn calls_with(text: &str, settings: Settings) -> Vec<Call> {
    let last = text.lines().count() as u32 + 1;
    let inside = |event: &Event| event.source.line > 0 && event.source.line < last;
    events(text, settings)
        .into_iter()
        .filter(inside)
        .map(|event| event.call)
        .collect()
}

fn calls(text: &str) -> Vec<Call> {
    calls_with(text, Settings::default())
}

fn expect(table: &[(&str, &[Call])]) {
    for (text, expected) in table {
        assert_eq!(&calls(text), expected, "{text}");
    }
}

fn at(values: &[(Axis, f64)]) -> Position {
    let mut position = Position::ZERO;
    for (axis, value) in values {
        position[*axis] = *value;
    }
    position
}

fn traverse(x: f64, y: f64, z: f64) -> Call {
    Call::StraightTraverse {
        to: Position::xyz(x, y, z),
    }
}

fn feed(x: f64, y: f64, z: f64) -> Call {
    Call::StraightFeed {
        to: Position::xyz(x, y, z),
    }
}

fn arc(to: Position, plane: Plane, centre_mm: [f64; 2], turns: i32) -> Call {
    Call::ArcFeed {
        to,
        plane,
        centre_mm,
        turns,
    }
}

/// F of a program in mm/min.
fn rate(per_minute: f64) -> Call {
    Call::SetFeedRate {
        per_second: per_minute / 60.0,
    }
}

const INCH: Call = Call::UseLengthUnit(LengthUnit::Inch);
const MM: Call = Call::UseLengthUnit(LengthUnit::Millimetre);

#[test]
fn the_start_is_told_before_the_first_line() {
    let settings = Settings {
        work_system: 2,
        length_unit: LengthUnit::Inch,
        path_mode: PathMode::ExactPath,
        work_offsets: std::array::from_fn(|index| Position::xyz(index as f64, 0.0, 0.0)),
        ..Settings::default()
    };
    let all = events("", settings);
    let start: Vec<Call> = all
        .iter()
        .filter(|event| event.source.line == 0)
        .map(|event| event.call.clone())
        .collect();
    assert_eq!(
        start,
        [
            INCH,
            Call::SetG5xOffset {
                system: 2,
                origin: Position::xyz(1.0, 0.0, 0.0)
            },
            Call::SelectPlane(Plane::Xy),
            Call::SetPathMode(PathMode::ExactPath),
        ]
    );
}

#[test]
fn the_end_stops_spindle_and_coolant_and_goes_back_to_g54() {
    let end = |text: &str| -> Vec<Call> {
        let run = Interpreter::new(Settings::default()).run(text.as_bytes());
        run.map(Result::unwrap)
            .filter(|event| event.source.line == 1)
            .map(|event| event.call)
            .collect()
    };
    let stop = [
        Call::StopSpindle,
        Call::Mist(false),
        Call::Flood(false),
        Call::ProgramEnd,
    ];
    let g54 = Call::SetG5xOffset {
        system: 1,
        origin: Position::ZERO,
    };
    for text in ["M2", "M30\n", "m 3 0 \r\nG99 is not read", "M02 (last)\n%"] {
        let mut calls = end(text);
        calls.retain(|call| !matches!(call, Call::Comment(_)));
        assert_eq!(calls[0], g54, "{text}");
        assert_eq!(calls[1..], stop, "{text}");
    }
    let mut expected = vec![
        Call::SelectPlane(Plane::Zx),
        traverse(1.0, 0.0, 0.0),
        g54,
        Call::SelectPlane(Plane::Xy),
    ];
    expected.extend(stop);
    assert_eq!(end("M2 G0 X1 G18"), expected);
}

#[test]
fn percent_signs_delimit_a_program() {
    let run = |text: &str| -> Vec<Call> {
        let run = Interpreter::new(Settings::default()).run(text.as_bytes());
        run.map(Result::unwrap)
            .filter(|event| event.source.line > 0)
            .map(|event| event.call)
            .collect()
    };
    assert_eq!(run("%\nG0 X1\n%\nnonsense"), [traverse(1.0, 0.0, 0.0)]);
    assert_eq!(run("\n \t\n % \r\nG0 X1\r\n%"), [traverse(1.0, 0.0, 0.0)]);
    assert_eq!(run("%\nM2").last(), Some(&Call::ProgramEnd));
}

#[test]
fn text_outside_the_words_does_not_count() {
    expect(&[
        ("", &[]),
        ("  \t \r", &[]),
        ("N10", &[]),
        ("/", &[]),
        ("g0x1y2z3", &[traverse(1.0, 2.0, 3.0)]),
        ("G 0 0 X 1 0 . 5 Y - . 2 5 Z + 3 .", &[traverse(10.5, -0.25, 3.0)]),
        ("Z3 Y2 X1 G0", &[traverse(1.0, 2.0, 3.0)]),
        ("N1.5 G0 X1", &[traverse(1.0, 0.0, 0.0)]),
        ("/N1 G0 X1", &[traverse(1.0, 0.0, 0.0)]),
        ("G0 X1 ; Y2 (", &[traverse(1.0, 0.0, 0.0)]),
    ]);
}

#[test]
fn the_last_comment_of_a_line_acts() {
    let comment = |text: &str| Call::Comment(text.into());
    let message = |text: &str| Call::Message(text.into());
    expect(&[
        ("(a) G0 X1 (b c)", &[comment("b c"), traverse(1.0, 0.0, 0.0)]),
        ("(MSG,  change tool )", &[message("  change tool ")]),
        ("( mSg,x)", &[message("x")]),
        ("(MSG, lost) (kept)", &[comment("kept")]),
        ("(MSG)", &[comment("MSG")]),
        ("(MSG , x)", &[comment("MSG , x")]),
        ("(message, x)", &[comment("message, x")]),
        ("()", &[comment("")]),
        ("(ä)", &[comment("ä")]),
        ("; no call", &[]),
    ]);
}

#[test]
fn deleted_blocks_are_left_out_where_the_operator_wants_it() {
    let settings = Settings {
        block_delete: true,
        ..Settings::default()
    };
    assert_eq!(
        calls_with(" / not even read\nG0 X1", settings),
        [traverse(1.0, 0.0, 0.0)]
    );
}

#[test]
fn straight_moves() {
    expect(&[
        ("G0 X1 Y2\nZ3", &[traverse(1.0, 2.0, 0.0), traverse(1.0, 2.0, 3.0)]),
        ("G0", &[traverse(0.0, 0.0, 0.0)]),
        ("G1 X1 F60\nY2", &[rate(60.0), feed(1.0, 0.0, 0.0), feed(1.0, 2.0, 0.0)]),
        (
            "G1 F60\nG0 X1",
            &[rate(60.0), feed(0.0, 0.0, 0.0), traverse(1.0, 0.0, 0.0)],
        ),
        ("G0 X1\nG80\nG0 X2", &[traverse(1.0, 0.0, 0.0), traverse(2.0, 0.0, 0.0)]),
        (
            "G91 G0 X1\nX1 Y-1\nG90 X1",
            &[
                traverse(1.0, 0.0, 0.0),
                traverse(2.0, -1.0, 0.0),
                traverse(1.0, -1.0, 0.0),
            ],
        ),
        ("G20 G0 X1", &[INCH, traverse(25.4, 0.0, 0.0)]),
        (
            "G20 G0 X1\nG21 Y1",
            &[INCH, traverse(25.4, 0.0, 0.0), MM, traverse(25.4, 1.0, 0.0)],
        ),
    ]);
}

#[test]
fn g80_gives_way_to_another_motion_code_on_its_line() {
    for line in ["G0 G80", "G80 G0", "G80 G0 G80"] {
        let expected = [traverse(0.0, 0.0, 0.0), traverse(1.0, 0.0, 0.0)];
        assert_eq!(calls(&format!("{line}\nX1")), expected, "{line}");
    }
    expect(&[("G80 G80", &[])]);
}

#[test]
fn switching_off_what_is_never_on_is_allowed_and_does_nothing() {
    expect(&[("G21 G90 G17 G94 G40 G49 G80", &[Call::SelectPlane(Plane::Xy), MM])]);
}

#[test]
fn nine_axes_and_only_lengths_are_converted() {
    let all = "X1 Y2 Z3 A4 B5 C6 U7 V8 W9";
    let to = Position([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
    assert_eq!(calls(&format!("G0 {all}")), [Call::StraightTraverse { to }]);
    let i = 25.4;
    let to = Position([i, 2.0 * i, 3.0 * i, 4.0, 5.0, 6.0, 7.0 * i, 8.0 * i, 9.0 * i]);
    assert_eq!(calls(&format!("G20 G0 {all}")), [INCH, Call::StraightTraverse { to }]);
}

#[test]
fn arcs_by_centre() {
    let xyz = Position::xyz;
    expect(&[
        (
            "F60 G2 X10 I5",
            &[rate(60.0), arc(xyz(10.0, 0.0, 0.0), Plane::Xy, [5.0, 0.0], -1)],
        ),
        (
            "F60 G3 X5 Y5 I5",
            &[rate(60.0), arc(xyz(5.0, 5.0, 0.0), Plane::Xy, [5.0, 0.0], 1)],
        ),
        (
            "F60 G2 I5",
            &[rate(60.0), arc(Position::ZERO, Plane::Xy, [5.0, 0.0], -1)],
        ),
        (
            "F60 G3 J-2 Z4 P3",
            &[rate(60.0), arc(xyz(0.0, 0.0, 4.0), Plane::Xy, [0.0, -2.0], 3)],
        ),
        (
            "F60 G2 I5\nI3",
            &[
                rate(60.0),
                arc(Position::ZERO, Plane::Xy, [5.0, 0.0], -1),
                arc(Position::ZERO, Plane::Xy, [3.0, 0.0], -1),
            ],
        ),
        (
            "G0 X10\nF60 G90.1 G2 I5 J0",
            &[
                traverse(10.0, 0.0, 0.0),
                rate(60.0),
                arc(xyz(10.0, 0.0, 0.0), Plane::Xy, [5.0, 0.0], -1),
            ],
        ),
        (
            "G0 X10\nF60 G90.1\nG91.1 G2 I5",
            &[
                traverse(10.0, 0.0, 0.0),
                rate(60.0),
                arc(xyz(10.0, 0.0, 0.0), Plane::Xy, [15.0, 0.0], -1),
            ],
        ),
        (
            "G18 F60 G2 X10 I5 Y2",
            &[
                rate(60.0),
                Call::SelectPlane(Plane::Zx),
                arc(xyz(10.0, 2.0, 0.0), Plane::Zx, [0.0, 5.0], -1),
            ],
        ),
        (
            "G19 F60 G3 Z10 K5 X1",
            &[
                rate(60.0),
                Call::SelectPlane(Plane::Yz),
                arc(xyz(1.0, 0.0, 10.0), Plane::Yz, [0.0, 5.0], 1),
            ],
        ),
        (
            "G20\nF60 G2 X1 I0.5",
            &[
                INCH,
                Call::SetFeedRate { per_second: 25.4 },
                arc(xyz(25.4, 0.0, 0.0), Plane::Xy, [12.7, 0.0], -1),
            ],
        ),
        (
            "F60 G91 G3 X4 I2 A90",
            &[
                rate(60.0),
                arc(at(&[(Axis::X, 4.0), (Axis::A, 90.0)]), Plane::Xy, [2.0, 0.0], 1),
            ],
        ),
    ]);
}

#[test]
fn arcs_by_radius() {
    // Chord 6, radius 5: the centre is 4 beside the middle.
    let to = Position::xyz(6.0, 0.0, 0.0);
    let xy = |centre_y: f64, turns: i32| arc(to, Plane::Xy, [3.0, centre_y], turns);
    expect(&[
        ("F60 G2 X6 R5", &[rate(60.0), xy(-4.0, -1)]),
        ("F60 G3 X6 R5", &[rate(60.0), xy(4.0, 1)]),
        ("F60 G2 X6 R-5", &[rate(60.0), xy(4.0, -1)]),
        ("F60 G3 X6 R-5", &[rate(60.0), xy(-4.0, 1)]),
        ("F60 G3 X6 R5 P2", &[rate(60.0), xy(4.0, 2)]),
        ("F60 G90.1 G3 X6 R5", &[rate(60.0), xy(4.0, 1)]),
        ("F60 G2 X6 R2.999", &[rate(60.0), xy(0.0, -1)]),
        (
            "F60 G18 G2 X6 R5",
            &[
                rate(60.0),
                Call::SelectPlane(Plane::Zx),
                arc(to, Plane::Zx, [4.0, 3.0], -1),
            ],
        ),
    ]);
}

#[test]
fn a_full_circle_survives_rounding() {
    // 0.1 + 0.2 is not 0.3 in binary, yet the arc starts and ends at "X0.3".
    let calls = calls("G91 G0 X0.1\nX0.2\nF60\nG90 G2 X0.3 Y0 I5");
    let Some(Call::ArcFeed { to, .. }) = calls.last() else {
        panic!("{calls:?}")
    };
    assert_eq!(to[Axis::X], 0.1 + 0.2);
}

#[test]
fn dwell_takes_seconds_and_leaves_the_motion_alone() {
    let dwell = |seconds| Call::Dwell { seconds };
    expect(&[
        ("G4 P.5", &[dwell(0.5)]),
        ("G4 P0", &[dwell(0.0)]),
        (
            "G0 X1\nG4 P2\nX3",
            &[traverse(1.0, 0.0, 0.0), dwell(2.0), traverse(3.0, 0.0, 0.0)],
        ),
        (
            "G0\nG4 P2 X3",
            &[traverse(0.0, 0.0, 0.0), dwell(2.0), traverse(3.0, 0.0, 0.0)],
        ),
    ]);
}

#[test]
fn path_modes() {
    let continuous = |tolerance_mm, naive_cam_tolerance_mm| {
        Call::SetPathMode(PathMode::Continuous {
            tolerance_mm,
            naive_cam_tolerance_mm,
        })
    };
    expect(&[
        ("G61", &[Call::SetPathMode(PathMode::ExactPath)]),
        ("G61.1", &[Call::SetPathMode(PathMode::ExactStop)]),
        ("G64", &[continuous(None, None)]),
        ("G64 P0.1", &[continuous(Some(0.1), Some(0.1))]),
        ("G64 P0.1 Q0", &[continuous(Some(0.1), Some(0.0))]),
        ("G64 Q0.2", &[continuous(None, Some(0.2))]),
        ("G20 G64 P1", &[INCH, continuous(Some(25.4), Some(25.4))]),
    ]);
}

#[test]
fn planes() {
    expect(&[
        ("G17", &[Call::SelectPlane(Plane::Xy)]),
        ("G18", &[Call::SelectPlane(Plane::Zx)]),
        ("G19", &[Call::SelectPlane(Plane::Yz)]),
    ]);
}

#[test]
fn feed_in_units_per_minute() {
    let per_second = |per_second| Call::SetFeedRate { per_second };
    let a = |degrees| Call::StraightFeed {
        to: at(&[(Axis::A, degrees)]),
    };
    let u = |mm| Call::StraightFeed {
        to: at(&[(Axis::U, mm)]),
    };
    expect(&[
        ("F120", &[per_second(2.0)]),
        ("F0", &[]),
        (
            "F120\nG1 X1\nG94 F60\nX2",
            &[
                per_second(2.0),
                feed(1.0, 0.0, 0.0),
                per_second(1.0),
                feed(2.0, 0.0, 0.0),
            ],
        ),
        // F comes before the change of units on the same line.
        ("F60 G20", &[per_second(1.0), INCH]),
        ("G20\nF60", &[INCH, per_second(25.4)]),
        // A feed set in inches stays what it was in G21.
        (
            "G20\nF60\nG21 G1 X1",
            &[INCH, per_second(25.4), MM, feed(1.0, 0.0, 0.0)],
        ),
        // Degrees are not inches.
        (
            "G20\nF60\nG1 A10\nU1",
            &[INCH, per_second(25.4), per_second(1.0), a(10.0), per_second(25.4), {
                Call::StraightFeed {
                    to: at(&[(Axis::A, 10.0), (Axis::U, 25.4)]),
                }
            }],
        ),
        ("F60 G1 U1", &[per_second(1.0), u(1.0)]),
    ]);
}

#[test]
fn feed_in_inverse_time() {
    let per_second = |per_second| Call::SetFeedRate { per_second };
    expect(&[
        // 5 mm in half a minute.
        ("G93 G1 X3 Y4 F2", &[per_second(10.0 / 60.0), feed(3.0, 4.0, 0.0)]),
        // The same speed is not told twice, nor is that of a move of length 0.
        (
            "G93 G1 X3 F2\nX6 F2\nX6 F3",
            &[
                per_second(0.1),
                feed(3.0, 0.0, 0.0),
                feed(6.0, 0.0, 0.0),
                feed(6.0, 0.0, 0.0),
            ],
        ),
        ("G93 G0 X3", &[traverse(3.0, 0.0, 0.0)]),
        (
            "G93 G1 X3 A40 F1",
            &[
                per_second(3.0 / 60.0),
                Call::StraightFeed {
                    to: at(&[(Axis::X, 3.0), (Axis::A, 40.0)]),
                },
            ],
        ),
        (
            "G93 G1 U3 V4 A90 F1",
            &[
                per_second(5.0 / 60.0),
                Call::StraightFeed {
                    to: at(&[(Axis::U, 3.0), (Axis::V, 4.0), (Axis::A, 90.0)]),
                },
            ],
        ),
        (
            "G93 G1 A30 B40 F1",
            &[
                per_second(50.0 / 60.0),
                Call::StraightFeed {
                    to: at(&[(Axis::A, 30.0), (Axis::B, 40.0)]),
                },
            ],
        ),
        // Back in G94 the feed is set anew.
        (
            "G93 G1 X3 F60\nG94 F120 X4",
            &[
                per_second(3.0),
                feed(3.0, 0.0, 0.0),
                per_second(2.0),
                feed(4.0, 0.0, 0.0),
            ],
        ),
    ]);
}

#[test]
fn inverse_time_counts_along_helix_and_turns() {
    // Radius 2, a turn and a quarter in a second, and 3 mm up.
    let calls = calls("G93 G3 X-2 Y2 I-2 Z3 P2 F60");
    let Call::SetFeedRate { per_second } = calls[0] else {
        panic!("{calls:?}")
    };
    assert!((per_second - (5.0 * std::f64::consts::PI).hypot(3.0)).abs() < 1e-12);
}

#[test]
fn work_systems() {
    let settings = || Settings {
        start: Position::xyz(1.0, 2.0, 3.0),
        work_offsets: std::array::from_fn(|index| Position::xyz(10.0 * index as f64, 0.0, -1.0)),
        ..Settings::default()
    };
    let codes = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
    for (index, code) in codes.into_iter().enumerate().skip(1) {
        let x = 10.0 * index as f64;
        let expected = [
            Call::SetG5xOffset {
                system: index as u8 + 1,
                origin: Position::xyz(x, 0.0, -1.0),
            },
            // The point in the machine has stayed: X1 Y2 Z3.
            traverse(1.0 - x, 5.0, 4.0),
        ];
        assert_eq!(calls_with(&format!("{code} G0 Y5"), settings()), expected, "{code}");
    }
    assert_eq!(calls_with("G54 G0 Y5", settings()), [traverse(1.0, 5.0, 4.0)]);
}

#[test]
fn machine_coordinates() {
    let settings = || Settings {
        work_offsets: std::array::from_fn(|_| Position::xyz(100.0, 200.0, 0.0)),
        start: Position::xyz(100.0, 200.0, 0.0),
        ..Settings::default()
    };
    assert_eq!(calls_with("G53 G0 X1", settings()), [traverse(-99.0, 0.0, 0.0)]);
    assert_eq!(
        calls_with("G0 X1\nG53 Y0\nY0", settings()),
        [
            traverse(1.0, 0.0, 0.0),
            traverse(1.0, -200.0, 0.0),
            traverse(1.0, 0.0, 0.0)
        ]
    );
    assert_eq!(
        calls_with("F60 G20\nG53 G1 X10", settings()),
        [rate(60.0), INCH, feed(154.0, 0.0, 0.0)]
    );
}

#[test]
fn returns_go_through_the_programmed_point() {
    let settings = || Settings {
        work_offsets: std::array::from_fn(|_| Position::xyz(10.0, 0.0, 0.0)),
        start: Position::xyz(10.0, 0.0, 0.0),
        g28: Position::xyz(1.0, 2.0, 3.0),
        g30: Position::xyz(-1.0, -2.0, -3.0),
        ..Settings::default()
    };
    assert_eq!(
        calls_with("G28", settings()),
        [traverse(0.0, 0.0, 0.0), traverse(-9.0, 2.0, 3.0)]
    );
    assert_eq!(
        calls_with("G30", settings()),
        [traverse(0.0, 0.0, 0.0), traverse(-11.0, -2.0, -3.0)]
    );
    // Named axes alone go on to the stored point.
    assert_eq!(
        calls_with("G28 Z5", settings()),
        [traverse(0.0, 0.0, 5.0), traverse(0.0, 0.0, 3.0)]
    );
    assert_eq!(
        calls_with("G91 G28 Z5 X0\nG90", settings()),
        [traverse(0.0, 0.0, 5.0), traverse(-9.0, 0.0, 3.0)]
    );
    // The motion before goes on behind.
    assert_eq!(
        calls_with("G0 X1\nG28 X2\nX3", settings()),
        [
            traverse(1.0, 0.0, 0.0),
            traverse(2.0, 0.0, 0.0),
            traverse(-9.0, 0.0, 0.0),
            traverse(3.0, 0.0, 0.0)
        ]
    );
    assert_eq!(
        calls_with("G28 G80 X2", settings()),
        [traverse(2.0, 0.0, 0.0), traverse(-9.0, 0.0, 0.0)]
    );
}

#[test]
fn spindle_tools_and_coolant() {
    expect(&[
        (
            "S1000 M3",
            &[
                Call::SetSpindleSpeed { rpm: 1000.0 },
                Call::StartSpindle(SpindleDirection::Clockwise),
            ],
        ),
        ("M4", &[Call::StartSpindle(SpindleDirection::Counterclockwise)]),
        ("M5", &[Call::StopSpindle]),
        ("T3", &[Call::SelectTool { tool: 3 }]),
        (
            "M6 T12",
            &[
                Call::SelectTool { tool: 12 },
                Call::StopSpindle,
                Call::ChangeTool { tool: 12 },
            ],
        ),
        (
            "T0\nM6",
            &[
                Call::SelectTool { tool: 0 },
                Call::StopSpindle,
                Call::ChangeTool { tool: 0 },
            ],
        ),
        ("M7", &[Call::Mist(true)]),
        ("M8", &[Call::Flood(true)]),
        ("M9", &[Call::Mist(false), Call::Flood(false)]),
        ("M0", &[Call::ProgramStop]),
        ("M1", &[Call::OptionalProgramStop]),
    ]);
}

#[test]
fn a_line_runs_in_the_documented_order() {
    let line = "M1 X2 G1 G91 G61 G55 G20 G18 G4 P3 M8 M3 M6 T5 S100 F60 G94 (c)";
    let expected = [
        Call::Comment("c".into()),
        rate(60.0),
        Call::SetSpindleSpeed { rpm: 100.0 },
        Call::SelectTool { tool: 5 },
        Call::StopSpindle,
        Call::ChangeTool { tool: 5 },
        Call::StartSpindle(SpindleDirection::Clockwise),
        Call::Flood(true),
        Call::Dwell { seconds: 3.0 },
        Call::SelectPlane(Plane::Zx),
        INCH,
        Call::SetG5xOffset {
            system: 2,
            origin: Position::ZERO,
        },
        Call::SetPathMode(PathMode::ExactPath),
        feed(50.8, 0.0, 0.0),
        Call::OptionalProgramStop,
    ];
    assert_eq!(calls(line), expected);
}

#[test]
fn sources_name_line_number_and_octets() {
    let all = events("(first)\r\n/ N20 G0 X1\n", Settings::default());
    let source = |line: u32| all.iter().find(|event| event.source.line == line).unwrap().source;
    assert_eq!((source(0).n, source(0).start, source(0).end), (None, 0, 0));
    assert_eq!((source(1).n, source(1).start, source(1).end), (None, 0, 7));
    assert_eq!((source(2).n, source(2).start, source(2).end), (Some(20), 9, 20));
}

#[test]
fn an_interpreter_can_be_kept_beside_an_owned_text() {
    struct Program {
        text: Vec<u8>,
        interpreter: Interpreter,
    }
    let mut program = Program {
        text: b"G0 X1\nM2".to_vec(),
        interpreter: Interpreter::new(Settings::default()),
    };
    let mut count = 0;
    while let Some(event) = program.interpreter.next_event(&program.text) {
        event.unwrap();
        count += 1;
    }
    assert_eq!(count, 4 + 1 + 5);
}
