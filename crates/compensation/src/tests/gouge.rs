//! What the look-ahead finds, and what it leaves alone. Tools have a radius of 1 mm.

use super::random::{Piece, moves};
use super::*;
use proptest::prelude::*;

/// Programs that must pass as they are, each with its reason.
const LEGAL: &[(&str, &str)] = &[
    (
        "a slot exactly as wide as the tool",
        "G0 X-15 Y10\nG41.1 D2\nG1 X-5\nX0\nY0\nX2\nY10\nX8\nG40\nG0 X20",
    ),
    (
        "outside a square, whose edges go on past the corner at both ends",
        "G0 X-30 Y0\nG42.1 D2\nG1 X-20\nX20\nY20\nX0\nY-10\nG40\nX-10 Y-20",
    ),
    (
        "the entry crosses the exit",
        "G0 X5 Y-15\nG42.1 D2\nG1 X-5 Y0\nX20\nY20\nX0\nY0\nG40\nX-15 Y-5",
    ),
    (
        "a closed contour goes on along its own start",
        "G0 X10 Y10\nG41.1 D2\nG1 X10 Y0\nX20\nY20\nX0\nY0\nX15\nG40\nX15 Y10",
    ),
    (
        "a pocket with an arc in and an arc out",
        "G0 X10 Y10\nG41.1 D2\nG1 X6 Y4\nG3 X10 Y0 I4\nG1 X20\nY20\nX0\nY0\nX10\nG3 X14 Y4 J4\nG40\nG1 X10 Y10",
    ),
    (
        "a boss with an arc in and an arc out",
        "G0 X10 Y-20\nG42.1 D2\nG1 X6 Y-4\nG2 X10 Y0 I4\nG1 X20\nY20\nX0\nY0\nX10\nG2 X14 Y-4 J-4\nG40\nG1 X10 Y-20",
    ),
    (
        "a full circle outside, without a way out",
        "G42.1 D4\nG1 X10 Y-10\nX20\nG3 J10\nG40\nG1 X20 Y-20",
    ),
    ("a rib without width", "G41.1 D2\nG1 X10\nX30\nX10\nG40\nY-10"),
    (
        "walls 2 radii apart",
        "G41.1 D2\nG1 X10\nX30\nY4\nX20\nY2\nX10\nG40\nX0",
    ),
    (
        "another depth",
        "G0 Z5\nG41.1 D2\nG1 X10\nZ0\nX30\nG0 Z5\nX20 Y10\nG1 Y5\nZ2\nY-20\nG40\nG0 X0",
    ),
    (
        "another angle of a rotary axis",
        "G41.1 D2\nG1 X10\nX30\nG0 X40 Y20\nX20 Y10 A90\nG1 Y5\nY-20\nG40\nG0 X0",
    ),
    (
        "a traverse cuts nothing",
        "G41.1 D2\nG1 X10\nX30\nG0 X35 Y5\nX20 Y-10\nG1 Y-20\nG40\nG0 X0",
    ),
    (
        "a helix into a bore",
        "G0 X6 Y0\nG41.1 D2\nG1 X8 Y-2\nG3 X10 Y0 J2\nG3 I-10 Z-6 P3\nG3 I-10\nG3 X8 Y2 I-2\nG40\nG1 X0 Y0",
    ),
    (
        "an entry that comes down through the air above a later part of the contour",
        "G0 Z6\nG41.1 D2\nG1 X30 Y0 Z0\nY20\nX10\nY-20\nG40\nG0 X0",
    ),
    (
        "a ramp through the air above an earlier contour",
        "G0 Z5\nG41.1 D2\nG1 X10\nZ0\nX30\nG0 Z5\nX20 Y10\nG1 Y5\nY-20 Z-2\nG40\nG0 X0",
    ),
    (
        "a helix through the air above an earlier contour",
        "G0 Z5\nG41.1 D2\nG1 X10\nZ0\nX30\nG0 Z5\nX20 Y10\nG1 Y5\nG3 Y-15 J-10 Z-2\nG40\nG0 X0",
    ),
    (
        "a second pass nearer to the part, after a traverse",
        "G0 X-10 Y5\nG41.1 D2\nG1 X0 Y0\nX30\nG0 X40 Y20\nX-10 Y5\nG1 X0 Y-0.5\nX30\nG40\nG1 X40",
    ),
    (
        "the same around a corner, three passes",
        "G0 X-10 Y6\nG41.1 D2\nG1 X0 Y1\nX30\nY20\nG0 X0 Y30\nX-10 Y6\nG1 X0 Y0.5\nX30.5\nY20\nG0 X0 Y30\nX-10 Y6\nG1 X0 Y0\nX31\nY20\nG40\nG1 X30 Y30",
    ),
    (
        "an exit that goes up through the air above the contour",
        "G41.1 D2\nG1 X10\nX30\nY20\nX10\nG40\nX20 Y-10 Z9",
    ),
];

#[test]
fn legal_programs_pass() {
    for (name, program) in LEGAL {
        let plain = run(program);
        assert!(
            !plain.iter().any(|line| line.starts_with("line ")),
            "{name}: {plain:#?}"
        );
        assert_eq!(run_with(Settings::default(), program), plain, "{name}");
    }
}

/// Programs that cut into their contour, with the lines of the tool's move and of the contour's that is cut.
const GOUGES: &[(&str, &str, u32, u32)] = &[
    (
        "a bottle whose neck is too narrow",
        "G0 X-15 Y1\nG41.1 D2\nG1 X-5 Y0\nX0\nY-10\nX-10\nY-20\nX10\nY-10\nX1.9\nY0\nX10\nG40\nG0 X20",
        5,
        11,
    ),
    (
        "an island in a pocket",
        "G0 X15 Y15\nG41.1 D2\nG1 X15 Y0\nX30\nY30\nX0\nY0\nX15\nG0 X15 Y20\nG1 X20 Y15\nX20 Y28.5\nX10\nG40\nG0 X15 Y20",
        6,
        11,
    ),
    (
        "the path comes back too close to itself",
        "G41.1 D2\nG1 X10\nX30\nY6\nX20\nY1.5\nX15\nG40\nG0 X0 Y3",
        3,
        6,
    ),
    (
        "a contour crosses itself",
        "G41.1 D2\nG1 X10\nX30\nY-10\nX20\nY10\nX40\nY-20\nX0\nG40\nG0 X-5",
        3,
        6,
    ),
    (
        "the entry goes through the contour",
        "G41.1 D2\nG1 X30 Y0\nY20\nX10\nY-20\nG40\nG0 X0",
        2,
        5,
    ),
    (
        "the exit goes through the contour",
        "G41.1 D2\nG1 X10\nX30\nY20\nX10\nG40\nX20 Y-10",
        7,
        3,
    ),
    (
        "the passes in the wrong order: the first one cuts into the contour of the second",
        "G0 X-10 Y5\nG41.1 D2\nG1 X0 Y-0.5\nX30\nG0 X40 Y20\nX-10 Y5\nG1 X0 Y0\nX30\nG40\nG1 X40",
        4,
        7,
    ),
    (
        "a later contour that crosses an earlier one",
        "G0 X-10 Y5\nG41.1 D2\nG1 X0 Y0\nX30\nG0 X35 Y20\nX20 Y10\nG1 X15 Y5\nY-20\nG40\nG1 X40",
        4,
        8,
    ),
    (
        "a tight bend in small pieces",
        "G41.1 D2\nG1 X10\nX20\nX20.03 Y0.001\nX20.06 Y0.003\nX20.09 Y0.006\nX20.12 Y0.01\nX20.15 Y0.015\nX20.18 Y0.021\nX20.21 Y0.028\nX20.24 Y0.036\nX20.27 Y0.045\nX20.30 Y0.055\nX24 Y1.4\nG40\nG0 X0",
        3,
        7,
    ),
    (
        "an entry that is down where the contour is as high",
        "G0 Z6\nG41.1 D2\nG1 X30 Y0 Z0\nY20 Z4\nX10\nY-20\nG40\nG0 X0",
        3,
        6,
    ),
    (
        "a ramp that is down where it comes to an earlier contour",
        "G0 Z5\nG41.1 D2\nG1 X10\nZ0\nX30\nG0 Z5\nX20 Y10\nG1 Y5\nY-20 Z-40\nG40\nG0 X0",
        9,
        5,
    ),
    (
        "a helix that is down where it comes to an earlier contour",
        "G0 Z5\nG41.1 D2\nG1 X10\nZ0\nX30\nG0 Z5\nX20 Y10\nG1 Y5\nG3 Y-15 J-10 Z-40\nG40\nG0 X0",
        9,
        5,
    ),
    (
        "a helix whose second turn comes to an earlier contour",
        "G0 Z5\nG41.1 D2\nG1 X10\nZ0\nX30\nG0 Z5\nX20 Y10\nG1 Y5\nG3 Y-15 J-10 Z-2 P2\nG40\nG0 X0",
        9,
        5,
    ),
];

/// What the path may be off from the contour is no gouge.
#[test]
fn a_cut_no_deeper_than_the_tolerance_is_none() {
    let tolerance = |mm| PathMode::Continuous {
        tolerance_mm: mm,
        naive_cam_tolerance_mm: None,
    };
    // Between walls so far apart less than 2 mm, how deep the tool cuts beside one into the other.
    for (mode, deep_mm, is_gouge) in [
        (PathMode::ExactPath, 0.0005, false),
        (PathMode::ExactPath, 0.002, true),
        (tolerance(None), 0.0005, false),
        (tolerance(None), 0.002, true),
        (tolerance(Some(0.02)), 0.019, false),
        (tolerance(Some(0.02)), 0.021, true),
        // As much as the radius, and more: no more than a tenth of the radius counts.
        (tolerance(Some(1.0)), 0.099, false),
        (tolerance(Some(1.0)), 0.101, true),
        (tolerance(Some(5.0)), 0.9, true),
    ] {
        let height = 2.0 - deep_mm;
        let program = format!("G41.1 D2\nG1 X10\nX30\nY6\nX20\nY{height}\nX15\nG40\nG0 X0 Y3");
        let (mut compensator, mut out) = (Compensator::new(), Vec::new());
        compensator.set_path_mode(mode);
        let found = reader::read(&program)
            .into_iter()
            .try_for_each(|event| compensator.push(event, &mut out));
        match found {
            Ok(()) => assert!(!is_gouge, "{mode:?} {deep_mm}"),
            Err(error) => {
                assert!(is_gouge, "{mode:?} {deep_mm}: {error}");
                let Kind::Gouge {
                    tool,
                    contour,
                    missing_mm,
                    ..
                } = error.kind
                else {
                    panic!("{error}");
                };
                assert_eq!([tool.line, contour.line], [3, 6]);
                assert!((missing_mm - deep_mm).abs() < 1e-9, "{missing_mm}");
            }
        }
    }
}

#[test]
fn gouges_are_found_with_both_lines() {
    let mut wrong = Vec::new();
    for (name, program, tool, contour) in GOUGES {
        let lines = run_with(Settings::default(), program);
        let error = lines.last().expect("an error");
        let expected = format!("line {}: beside the move of line {tool} ", tool.max(contour));
        if !error.starts_with(&expected) || !error.contains(&format!("into the contour of line {contour}, at ")) {
            wrong.push(format!("{name}: {error}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A pocket behind a neck of some width, somewhere in the plane, entered and left along the wall in which the neck is.
fn bottle(neck: f64, depth: f64, angle: f64, moved: Point) -> Vec<Call> {
    let (sin, cos) = angle.sin_cos();
    let at = |[x, y]: Point| Position::xyz(x * cos - y * sin + moved[0], x * sin + y * cos + moved[1], 0.0);
    let wall = [
        [-15.0, 0.0],
        [0.0, 0.0],
        [0.0, -depth],
        [-8.0, -depth],
        [-8.0, -depth - 9.0],
        [neck + 8.0, -depth - 9.0],
        [neck + 8.0, -depth],
        [neck, -depth],
        [neck, 0.0],
        [neck + 15.0, 0.0],
    ];
    let mut calls = vec![
        Call::StraightTraverse { to: at([-25.0, 5.0]) },
        Call::SetCutterCompensation(Some(Cutter {
            side: Side::Left,
            radius_mm: 1.0,
            orientation: 0,
        })),
    ];
    calls.extend(wall.map(|point| Call::StraightFeed { to: at(point) }));
    calls.push(Call::SetCutterCompensation(None));
    calls.push(Call::StraightTraverse {
        to: at([neck + 25.0, 5.0]),
    });
    calls
}

fn compensate(settings: Settings, calls: &[Call]) -> Result<Vec<Call>, Box<CompensationError>> {
    let (mut compensator, mut out) = (Compensator::with_settings(settings), Vec::new());
    for (line, call) in (1..).zip(calls) {
        let source = Source {
            line,
            ..Source::default()
        };
        compensator.push(
            Event {
                source,
                call: call.clone(),
            },
            &mut out,
        )?;
    }
    compensator.finish(&mut out)?;
    assert_eq!(compensator.held(), 0);
    Ok(out.into_iter().map(|event| event.call).collect())
}

const DROP: Settings = Settings {
    corner: Corner::Arc,
    gouge: Gouge::DropLoop,
    number_by_release: false,
};

/// Moves of the contour: all but the traverses, the entry and the exit.
fn contour(calls: &[Call]) -> Vec<Piece> {
    moves(calls, Plane::Xy)[2..calls.len() - 3].to_vec()
}

/// Least distance of the path, without the way there, the entry and the way out, from the contour.
fn clearance(path: &[Call], contour: &[Piece]) -> f64 {
    let path = moves(path, Plane::Xy);
    let mut least = f64::INFINITY;
    for piece in &path[2..path.len() - 1] {
        for step in 0..=60 {
            let at = piece.at(f64::from(step) / 60.0);
            for wall in contour {
                least = least.min(wall.distance(at).0);
            }
        }
    }
    least
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn necks_are_found_where_they_are_too_narrow(
        neck in 0.1f64..4.0, depth in 0.5f64..20.0, angle in -3.0f64..3.0, x in -100.0f64..100.0, y in -100.0f64..100.0
    ) {
        let narrow = 2.0 - PATH_TOLERANCE_MM;
        prop_assume!((neck - 2.0).abs() > 1e-5 && (neck - narrow).abs() > 1e-5);
        let calls = bottle(neck, depth, angle, [x, y]);
        let result = compensate(Settings::default(), &calls);
        if neck > narrow {
            prop_assert!(result.is_ok(), "{:?}", result.err().map(|error| error.to_string()));
        } else {
            // The two walls of the neck are lines 5 and 11; of a short one, what is in front of it comes too close as well.
            let error = result.expect_err("too narrow");
            let Kind::Gouge { tool, contour, missing_mm, .. } = error.kind else {
                return Err(TestCaseError::fail(error.to_string()));
            };
            prop_assert!((4..=6).contains(&tool.line) && (10..=12).contains(&contour.line), "{error}");
            prop_assert!(missing_mm > 0.0 && missing_mm <= 1.0);
        }
        // Without the loop the tool goes past the neck, or into it.
        let path = compensate(DROP, &calls);
        prop_assert!(path.is_ok(), "{:?}", path.err().map(|error| error.to_string()));
        let path = path.unwrap_or_default();
        let least = clearance(&path, &contour(&calls));
        prop_assert!((least - 1.0).abs() < 2e-6, "{least}");
        let moves = path.iter().filter(|call| end_of(call).is_some()).count();
        prop_assert_eq!(moves > 8, neck > 2.0, "{:#?}", path);
    }

    /// Where nothing has to be dropped the path is the one of the corners.
    #[test]
    fn dropping_nothing_changes_nothing(random in super::random::random()) {
        let contour = random.pieces();
        let calls = random.programmed(&contour);
        let (Ok(plain), Ok(dropped)) = (compensate(Settings::default(), &calls), compensate(DROP, &calls)) else {
            return Err(TestCaseError::reject("does not fit"));
        };
        let ends = |calls: &[Call]| calls.iter().filter_map(end_of).map(|to| in_plane(to, random.plane)).collect::<Vec<_>>();
        let (plain, dropped) = (ends(&plain), ends(&dropped));
        prop_assert_eq!(plain.len(), dropped.len());
        for (a, b) in plain.iter().zip(&dropped) {
            prop_assert!(length(sub(*a, *b)) < 1e-5, "{a:?} {b:?}");
        }
    }
}

#[test]
fn an_arc_too_tight_for_the_tool_is_cut_off() {
    let program = |groove: &str| format!("G41.1 D2\nG1 X10\nX20\nG3 {groove}\nG1 X40\nG40\nG0 X50");
    // A groove of radius 0.6 in a wall: the tool rolls over its edges, and is lowest in the middle between them.
    let lines = run_with(DROP, &program("X20.6 Y-0.6 I0.6\nG3 X21.2 Y0 J0.6"));
    assert_eq!(
        lines,
        [
            "STRAIGHT_FEED(10.0000, 1.0000, 0.0000)",
            "STRAIGHT_FEED(20.0000, 1.0000, 0.0000)",
            "ARC_FEED(20.6000, 0.8000, 20.0000, 0.0000, -1, 0.0000)",
            "ARC_FEED(21.2000, 1.0000, 21.2000, 0.0000, -1, 0.0000)",
            "STRAIGHT_FEED(40.0000, 1.0000, 0.0000)",
            "STRAIGHT_TRAVERSE(50.0000, 0.0000, 0.0000)",
        ]
    );
    // One that it reaches.
    let wide = program("X23 Y-3 I3\nG3 X26 Y0 J3");
    assert_eq!(run_with(DROP, &wide), run(&wide));
}

#[test]
fn two_contours_too_close_to_each_other_have_no_loop_to_drop() {
    let (_, program, ..) = GOUGES[1];
    let lines = run_with(DROP, program);
    assert!(
        lines.last().is_some_and(|line| line.contains(" would cut ")),
        "{lines:#?}"
    );
}

#[test]
fn what_happens_in_a_loop_happens_where_it_was_cut() {
    let program = "G0 X-15 Y1\nG41.1 D2\nG1 X-5 Y0\nX0\nY-10\nX-10\nM8\nY-20\nX10\nY-10\nX1\nY0\nX10\nG40\nG0 X20";
    let events: Vec<Event> = {
        let (mut compensator, mut out) = (Compensator::with_settings(DROP), Vec::new());
        for event in reader::read(program) {
            compensator.push(event, &mut out).expect("droppable");
        }
        out
    };
    let flood = events
        .iter()
        .position(|event| event.call == Call::Flood(true))
        .expect("kept");
    let lines: Vec<u32> = events.iter().map(|event| event.source.line).collect();
    assert_eq!(lines[flood], 7, "{lines:?}");
    assert!(
        lines.iter().filter(|line| (6..=10).contains(*line)).count() == 1,
        "{lines:?}"
    );
}

#[test]
fn sharp_corners_by_intersection() {
    let settings = Settings {
        corner: Corner::Intersection { limit_degrees: 100.0 },
        ..Settings::default()
    };
    // A square corner between lines, one between an arc and a line, and one too sharp.
    let lines = run_with(
        settings,
        "G41.1 D2\nG1 X10\nX20\nY-10\nG3 X30 Y-20 I10\nG1 Y-40\nX25 Y-20\nG40\nG0 X0",
    );
    assert_eq!(
        lines,
        [
            "STRAIGHT_FEED(10.0000, 1.0000, 0.0000)",
            "STRAIGHT_FEED(21.0000, 1.0000, 0.0000)",
            "STRAIGHT_FEED(21.0000, -10.0000, 0.0000)",
            "ARC_FEED(30.0000, -19.0000, 30.0000, -10.0000, 1, 0.0000)",
            "STRAIGHT_FEED(31.0000, -19.0000, 0.0000)",
            "STRAIGHT_FEED(31.0000, -40.0000, 0.0000)",
            "ARC_FEED(29.0299, -40.2425, 30.0000, -40.0000, -1, 0.0000)",
            "STRAIGHT_FEED(24.0299, -20.2425, 0.0000)",
            "STRAIGHT_TRAVERSE(0.0000, -20.0000, 0.0000)",
        ]
    );
}

/// The window does not hold more than it has to, and what is far apart along the contour is not compared.
#[test]
fn long_contours_go_out_as_they_come() {
    let (mut compensator, mut out) = (Compensator::new(), Vec::new());
    let mut push = |call, out: &mut Vec<Event>| {
        let source = Source::default();
        compensator.push(Event { source, call }, out).expect("straight on");
        compensator.held()
    };
    push(
        Call::SetCutterCompensation(Some(Cutter {
            side: Side::Left,
            radius_mm: 1.0,
            orientation: 0,
        })),
        &mut out,
    );
    let mut held = 0;
    for i in 1..=40_000 {
        let to = Position::xyz(2.0 * f64::from(i), 0.0, 0.0);
        held = held.max(push(Call::StraightFeed { to }, &mut out));
    }
    assert!((AHEAD..AHEAD + 3).contains(&held), "{held}");
    assert!(out.len() >= 40_000 - held, "{}", out.len());
}
