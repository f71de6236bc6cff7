//! Every error, with the block it names and the numbers it tells.

use super::*;
use motion::canon::FeedMode;

/// The error of a program and its line.
fn error(program: &str) -> (u32, Kind) {
    let mut compensator = Compensator::new();
    let mut out = Vec::new();
    for event in reader::read(program) {
        if let Err(error) = compensator.push(event, &mut out) {
            return (error.source.line, error.kind);
        }
    }
    let error = compensator.finish(&mut out).expect_err("an error");
    (error.source.line, error.kind)
}

fn line(number: u32) -> Source {
    Source {
        line: number,
        ..Source::default()
    }
}

#[track_caller]
fn assert_near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9, "{a} {b}");
}

#[test]
fn entry_too_short() {
    let (line, kind) = error("G41.1 D4\nG1 X1.5 Z9\nX20");
    assert_eq!(line, 2);
    let plane = Plane::Xy;
    assert_eq!(
        kind,
        Kind::EntryTooShort {
            length_mm: 1.5,
            radius_mm: 2.0,
            plane
        }
    );
    assert_eq!(
        kind.to_string(),
        "the first move after G41 or G42 is 1.5000 mm long in the XY plane, but has to be longer than the tool's radius of \
         2.0000 mm, so that the tool gets beside the contour without touching it: start 0.5000 mm further away"
    );
}

#[test]
fn entry_arc_too_flat() {
    let (line, kind) = error("G41.1 D2\nG3 X9.983342 Y0.499583 J100\nG1 X20");
    assert_eq!(line, 2);
    let Kind::EntryArcTooFlat { height_mm, radius_mm } = kind else {
        panic!("{kind:?}")
    };
    assert_eq!(radius_mm, 1.0);
    assert!((height_mm - 100.0 * (1.0 - 0.1f64.cos())).abs() < 1e-5, "{height_mm}");
}

#[test]
fn arc_too_tight() {
    for (program, arc_mm) in [
        ("G41.1 D4\nG1 X10\nG3 Y3 J1.5", 1.5),
        ("G42.1 D4\nG1 X10\nG2 Y-4 J-2", 2.0),
        ("G41.1 D4\nG3 Y3 J1.5", 1.5),
    ] {
        assert_eq!(error(program).1, Kind::ArcTooTight { arc_mm, radius_mm: 2.0 });
    }
}

#[test]
fn corner_unreachable() {
    // Each time the arc of radius 3 leaves a circle of radius 1 to the centre.
    let cases = [
        // Line to arc: the line beside the contour is 2 above the circle's middle.
        ("G41.1 D4\nG1 X3\nX10\nG3 X4 I-3", 4, 1.0),
        // The same backwards.
        ("G42.1 D4\nG1 X4 Y-10\nG1 Y0\nG2 X10 I3\nG1 X3", 5, 1.0),
        // Arc to arc: two such circles about (7, 0) and (4, 3).
        (
            "G41.1 D4\nG1 X10 Y-10\nG1 Y0\nG3 X4 I-3\nG3 X7 Y3 J3",
            5,
            18f64.sqrt() - 2.0,
        ),
    ];
    for (program, at, gap) in cases {
        let (line, kind) = error(program);
        assert_eq!(line, at, "{kind}");
        let Kind::CornerUnreachable {
            first,
            gap_mm,
            radius_mm,
        } = kind
        else {
            panic!("{kind:?}")
        };
        assert_eq!((first, radius_mm), (super::errors::line(at - 1), 2.0));
        assert_near(gap_mm, gap);
    }
}

#[test]
fn move_too_short() {
    // 1.5 is left of the move of line 4 between two corners of which each takes 2.
    let (at, kind) = error("G41.1 D4\nG1 X10\nX20\nY1.5\nX0");
    assert_eq!(at, 5);
    let Kind::MoveTooShort {
        first,
        short_mm,
        radius_mm,
    } = kind
    else {
        panic!("{kind:?}")
    };
    assert_eq!((first, radius_mm), (line(4), 2.0));
    assert_near(short_mm, 2.5);
    assert_eq!(
        kind.to_string(),
        "a tool of radius 2.0000 mm would cut into the contour: between its neighbours the move of line 4 is 2.5000 mm too short \
         for the tool to get to it; take a smaller tool, or make the move longer"
    );
}

/// LinuxCNC goes back here, into the wall of line 3, and says nothing.
#[test]
fn a_short_move_before_another_in_line_is_too_short_as_well() {
    let (at, kind) = error("G41.1 D2\nG1 X10\nX20\nY0.5\nY20");
    assert_eq!(
        (at, kind.to_string().contains("line 4 is 0.5000 mm too short")),
        (5, true)
    );
}

#[test]
fn a_move_too_short_is_found_at_the_end_too() {
    for end in ["\nG40", ""] {
        let (at, kind) = error(&format!("G41.1 D2\nG1 X10\nX20\nY0.5{end}"));
        assert_eq!(at, if end.is_empty() { 4 } else { 5 });
        assert!(matches!(kind, Kind::MoveTooShort { .. }));
    }
}

#[test]
fn exit_arc() {
    assert_eq!(error("G41.1 D2\nG1 X10\nX20\nG40\nG2 X30 I5"), (5, Kind::ExitArc));
    assert_eq!(
        error("G41.1 D2\nG1 X10\nX20\nG40\nG42.1 D2\nG2 X30 I5"),
        (6, Kind::ExitArc)
    );
}

#[test]
fn already_on_wrong_plane_and_change_of_plane() {
    assert_eq!(error("G41.1 D2\nG42.1 D2"), (2, Kind::AlreadyOn));
    assert_eq!(error("G41.1 D2\nG1 X10\nG42.1 D2"), (3, Kind::AlreadyOn));
    assert_eq!(error("G41.1 D2\nG18"), (2, Kind::PlaneChange));
    assert_eq!(error("G18\nG41.1 D2\nG1 X10\nG17"), (4, Kind::PlaneChange));
    let mut compensator = Compensator::new();
    compensator.set_plane(Plane::Yz);
    let on = reader::read("G41.1 D2").remove(0);
    let error = compensator.push(on, &mut Vec::new()).expect_err("YZ");
    assert_eq!(error.kind, Kind::Plane(Plane::Yz));
}

fn event(call: Call) -> Event {
    Event {
        source: Source::default(),
        call,
    }
}

#[test]
fn what_cannot_be_compensated_is_refused() {
    let offset = Position::ZERO;
    let refused = [
        Call::SetG92Offset { offset },
        Call::SetG5xOffset {
            system: 2,
            origin: offset,
        },
        Call::SetXyRotation { degrees: 5.0 },
        Call::SetToolLengthOffset { offset },
        Call::RigidTap {
            to: offset,
            return_scale: 1.0,
        },
        Call::StartSpindleSync {
            spindle: 0,
            mm_per_turn: 1.0,
            velocity: false,
        },
        Call::StartChange,
    ];
    for call in refused {
        for program in ["G41.1 D2", "G41.1 D2\nG1 X10\nX20"] {
            let (mut compensator, mut out) = (Compensator::new(), Vec::new());
            for event in reader::read(program) {
                compensator.push(event, &mut out).expect("valid");
            }
            let error = compensator.push(event(call.clone()), &mut out).expect_err("refused");
            assert!(matches!(error.kind, Kind::NotAllowed { .. }), "{call:?}: {error}");
            // Nothing has happened; the program could go on.
            compensator
                .push(reader::read("G1 X30").remove(0), &mut out)
                .expect("valid");
        }
    }
}

#[test]
fn events_at_a_corner_are_limited() {
    let (mut compensator, mut out) = (Compensator::with_settings(AS_LINUXCNC), Vec::new());
    for event in reader::read("G41.1 D2\nG1 X10\nX20") {
        compensator.push(event, &mut out).expect("valid");
    }
    let held = || event(Call::SetFeedMode(FeedMode::PerTime));
    for count in 2..=HELD_LIMIT {
        compensator.push(held(), &mut out).expect("room");
        assert_eq!(compensator.held(), count);
    }
    let error = compensator.push(held(), &mut out).expect_err("full");
    assert_eq!(error.kind, Kind::TooManyHeld { limit: HELD_LIMIT });
}

#[test]
fn numbers_that_are_none_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, 2e9] {
        let (mut compensator, mut out) = (Compensator::new(), Vec::new());
        let cutter = |radius_mm| {
            event(Call::SetCutterCompensation(Some(Cutter {
                side: Side::Left,
                radius_mm,
                orientation: 0,
            })))
        };
        assert_eq!(
            compensator.push(cutter(bad), &mut out).expect_err("radius").kind,
            Kind::NotFinite
        );
        compensator.push(cutter(1.0), &mut out).expect("valid");
        let to = Position::xyz(bad, 0.0, 0.0);
        let error = compensator
            .push(event(Call::StraightFeed { to }), &mut out)
            .expect_err("end");
        assert_eq!(error.kind, Kind::NotFinite);
    }
    assert_eq!(error("G41.1 D2\nG2 X10").1, Kind::BadArc);
}
