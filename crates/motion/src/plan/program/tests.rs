//! Tests of what calls come to.

use super::*;
use crate::canon::{AXES, FeedMode, Plane};
use crate::element::Surface;
use crate::path::Group;
use crate::plan::AxisLimits;
use std::f64::consts::PI;

fn settings() -> Settings {
    let axis = AxisLimits {
        velocity: 1.0,
        acceleration: 1.0,
        jerk: 1.0,
        travel: [-1e3, 1e3],
    };
    let axes = [Some(axis); AXES];
    Settings {
        tolerance_mm: 0.1,
        look_ahead_blocks: 9,
        spindle_encoder: true,
        planner_kind: crate::plan::PlannerKind::Classic,
        ..Settings::new(axes, 1e-3)
    }
}

fn moved(program: &mut Program, call: Call) -> Move {
    match program.run(1, &call, &settings()) {
        Ok(Some(Entry::Move(part))) => *part,
        other => panic!("a move expected: {other:?}"),
    }
}

fn speed(rpm: f64) -> Call {
    Call::SetSpindleSpeed { spindle: 0, speed: rpm }
}

fn with_feed() -> Program {
    let mut program = Program::new(Position::ZERO);
    program
        .run(
            1,
            &Call::SetFeedRate {
                linear: 5.0,
                angular: 7.0,
            },
            &settings(),
        )
        .unwrap();
    program
}

fn arc(to: Position, plane: Plane, centre_mm: [f64; 2], turns: i32) -> Call {
    Call::ArcFeed {
        to,
        plane,
        centre_mm,
        turns,
    }
}

#[test]
fn equal_end_points_are_a_full_turn_and_turns_count() {
    for (turns, times) in [(1, 1.0), (-1, 1.0), (3, 3.0), (-2, 2.0)] {
        let part = moved(&mut with_feed(), arc(Position::ZERO, Plane::Xy, [10.0, 0.0], turns));
        assert!((part.piece.length() - times * 20.0 * PI).abs() < 1e-9, "{turns}");
        // Counter-clockwise from (0, 0) about (10, 0) begins downwards.
        let down = part.piece.jet(0.0).d1[1];
        assert!((down + f64::from(turns.signum())).abs() < 1e-12);
    }
}

#[test]
fn direction_decides_which_part_of_the_circle_is_meant() {
    let quarter = Position::xyz(10.0, -10.0, 0.0);
    let part = moved(&mut with_feed(), arc(quarter, Plane::Xy, [10.0, 0.0], 1));
    assert!((part.piece.length() - 5.0 * PI).abs() < 1e-9);
    let part = moved(&mut with_feed(), arc(quarter, Plane::Xy, [10.0, 0.0], -1));
    assert!((part.piece.length() - 15.0 * PI).abs() < 1e-9);
}

#[test]
fn an_arc_turns_and_shifts_with_its_frame() {
    let mut program = with_feed();
    let offset = Call::SetG5xOffset {
        system: 1,
        origin: Position::xyz(100.0, 0.0, 7.0),
    };
    program.run(1, &offset, &settings()).unwrap();
    program
        .run(1, &Call::SetXyRotation { degrees: 90.0 }, &settings())
        .unwrap();
    moved(&mut program, Call::StraightTraverse { to: Position::ZERO });
    // G18: Z is first, X second; the half turn from X0 to X20 bulges to Z-10 or Z+10. X of the work is Y here.
    let part = moved(
        &mut program,
        arc(Position::xyz(20.0, 0.0, 0.0), Plane::Zx, [0.0, 10.0], 1),
    );
    let middle = part.piece.position(part.piece.length() / 2.0);
    for (got, want) in middle.0.iter().zip([100.0, 10.0, 17.0]) {
        assert!((got - want).abs() < 1e-9, "{middle:?}");
    }
}

#[test]
fn a_feed_counts_degrees_where_rotary_axes_alone_move() {
    let mut to = Position::ZERO;
    to[Axis::B] = 9.0;
    assert_eq!(moved(&mut with_feed(), Call::StraightFeed { to }).feed, 7.0);
    to[Axis::V] = 1.0;
    assert_eq!(moved(&mut with_feed(), Call::StraightFeed { to }).feed, 5.0);
}

#[test]
fn what_is_no_move_gives_no_feed_and_measures_nothing() {
    // 10 degrees/s; LinuxCNC counts no linear part below 1e-8 mm.
    let turn = |x: f64, y: f64| {
        let mut to = Position::xyz(x, y, 0.0);
        to[Axis::C] = 90.0;
        let calls = Call::SetFeedRate {
            linear: 10.0,
            angular: 10.0,
        };
        let mut program = Program::new(Position::ZERO);
        program.run(1, &calls, &settings()).unwrap();
        moved(&mut program, Call::StraightFeed { to })
    };
    for x in [0.0, 5e-17, 5e-9, 1e-8] {
        let part = turn(x, 0.0);
        assert_eq!(
            (part.piece.group(), part.piece.length(), part.feed),
            (Group::Rotary, 90.0, 10.0),
            "{x}"
        );
        assert_eq!(part.piece.position(90.0).0[0], x);
    }
    // Its own feed, though C measures it: as long as 2e-5 mm take at 10 mm/s.
    let part = turn(2e-5, 0.0);
    assert_eq!((part.piece.group(), part.piece.length()), (Group::Rotary, 90.0));
    assert!((part.piece.length() / part.feed - 2e-6).abs() < 1e-18);
    let part = turn(0.02, 0.0);
    assert_eq!((part.piece.group(), part.feed), (Group::Main, 10.0));
}

#[test]
fn what_is_no_move_is_owed_until_the_next_rest_and_adds_up_to_nothing() {
    let mut program = with_feed();
    let go = |program: &mut Program, x: f64| {
        let to = Position::xyz(x, 0.0, 0.0);
        program.run(1, &Call::StraightFeed { to }, &settings()).unwrap()
    };
    assert!(matches!(go(&mut program, 1.0), Some(Entry::Move(_))));
    assert!(program.take_owed().is_none());
    for k in 1..=10 {
        assert!(go(&mut program, 1.0 + 1e-9 * f64::from(k)).is_none(), "{k}");
    }
    // Together they are one.
    let Some(Entry::Move(part)) = go(&mut program, 1.0 + 1.1e-8) else {
        panic!("a move")
    };
    assert_eq!(
        (part.piece.position(0.0).0[0], part.piece.position(1.0).0[0]),
        (1.0, 1.0 + 1.1e-8)
    );
    assert!(program.take_owed().is_none());
    // What follows begins where the axes are, and a rest brings them to where the program is.
    assert!(go(&mut program, 1.0).is_some() && go(&mut program, 1.0 - 1e-13).is_none());
    let Some(Entry::Move(part)) = go(&mut program, 3.0) else {
        panic!("a move")
    };
    assert_eq!(part.piece.position(0.0).0[0], 1.0);
    assert!(go(&mut program, 3.0 + 1e-12).is_none());
    let owed = program.take_owed().expect("a way");
    assert_eq!(
        (owed.piece.position(0.0).0[0], owed.piece.position(1.0).0[0]),
        (3.0, 3.0 + 1e-12)
    );
    assert!(program.take_owed().is_none());
}

#[test]
fn a_move_that_takes_more_than_a_year_is_refused_whatever_gives_its_feed() {
    const YEAR_S: f64 = 365.0 * 86_400.0;
    let run = |feed: f64, calls: &[Call]| {
        let mut program = Program::new(Position::ZERO);
        let feed = Call::SetFeedRate {
            linear: feed,
            angular: feed,
        };
        let mut all = vec![feed];
        all.extend_from_slice(calls);
        let last = all.pop().unwrap();
        for call in all {
            program.run(1, &call, &settings()).unwrap();
        }
        program.run(1, &last, &settings()).map(|entry| entry.is_some())
    };
    let line = Call::StraightFeed {
        to: Position::xyz(10.0, 0.0, 0.0),
    };
    let mut to = Position::ZERO;
    to[Axis::C] = 10.0;
    let turn = Call::StraightFeed { to };
    let spindle = [
        speed(60.0),
        Call::StartSpindle {
            spindle: 0,
            direction: SpindleDirection::Clockwise,
            wait_for_speed: true,
        },
    ];
    for (slow, calls) in [
        (10.0, vec![line.clone()]),
        (10.0, vec![turn]),
        (PI, vec![arc(Position::xyz(2.0, 0.0, 0.0), Plane::Xy, [1.0, 0.0], 1)]),
        (
            10.0,
            [
                &[Call::SetFeedMode(FeedMode::PerTurn { spindle: 0 })],
                &spindle[..],
                std::slice::from_ref(&line),
            ]
            .concat(),
        ),
    ] {
        assert_eq!(run(slow / YEAR_S * 1.01, &calls), Ok(true), "{calls:?}");
        let refused = run(slow / YEAR_S / 2.0, &calls);
        assert!(
            matches!(refused, Err(PlanErrorKind::TooSlow { seconds }) if (seconds / YEAR_S - 2.0).abs() < 1e-9),
            "{calls:?}: {refused:?}"
        );
    }
    let thread = |mm_per_turn: f64| {
        let sync = Call::StartSpindleSync {
            spindle: 0,
            mm_per_turn,
            velocity: false,
        };
        run(1.0, &[&spindle[..], &[sync, line.clone()]].concat())
    };
    assert_eq!(thread(1e-3), Ok(true));
    assert!(matches!(
        thread(10.0 / YEAR_S / 4.0),
        Err(PlanErrorKind::TooSlow { .. })
    ));
    let told = PlanErrorKind::TooSlow {
        seconds: 6.2e9 * 86_400.0,
    }
    .to_string();
    assert!(
        told.starts_with("the move would take 6200000000 days at its feed;"),
        "{told}"
    );
}

#[test]
fn a_feed_per_turn_is_that_of_the_programmed_speed_and_none_where_the_spindle_stands() {
    let mut program = with_feed();
    let to = Position::xyz(0.0, 0.0, 1.0);
    let mode = Call::SetFeedMode(FeedMode::PerTurn { spindle: 0 });
    program.run(1, &mode, &settings()).unwrap();
    program.run(1, &speed(90.0), &settings()).unwrap();
    let stands = program.run(1, &Call::StraightFeed { to }, &settings());
    assert_eq!(stands.unwrap_err(), PlanErrorKind::SpindleStands);
    let start = Call::StartSpindle {
        spindle: 0,
        direction: SpindleDirection::Counterclockwise,
        wait_for_speed: true,
    };
    program.run(1, &start, &settings()).unwrap();
    assert_eq!(moved(&mut program, Call::StraightFeed { to }).feed, 7.5);
    let mode = Call::SetFeedMode(FeedMode::PerTime);
    program.run(1, &mode, &settings()).unwrap();
    let to = Position::ZERO;
    assert_eq!(moved(&mut program, Call::StraightFeed { to }).feed, 5.0);
}

#[test]
fn what_cannot_be_run_is_refused_by_name() {
    let calls = [
        (
            Call::SetFeedMode(FeedMode::PerTurn { spindle: 1 }),
            "more of a second spindle ($1 and above) than S, M3, M4 and M5",
        ),
        (
            Call::WaitSpindleOriented {
                spindle: 1,
                timeout_s: 1.0,
            },
            "more of a second spindle ($1 and above) than S, M3, M4 and M5",
        ),
        // One of a million took more memory than a PC has.
        (
            arc(Position::ZERO, Plane::Xy, [1.0, 0.0], -1001),
            "an arc of more than 1000 turns",
        ),
        (
            arc(Position::ZERO, Plane::Uv, [1.0, 0.0], 1),
            "an arc in the planes of U, V and W (G17.1 to G19.1)",
        ),
    ];
    for (call, what) in calls {
        assert_eq!(
            with_feed().run(1, &call, &settings()).unwrap_err(),
            PlanErrorKind::Unsupported(what)
        );
    }
}

#[test]
fn modes_decide_what_may_happen_to_a_corner() {
    let mut program = with_feed();
    let modes = [
        (PathMode::ExactPath, Corner::Exact),
        (PathMode::ExactStop, Corner::Stop),
        (
            PathMode::Continuous {
                tolerance_mm: Some(0.02),
                naive_cam_tolerance_mm: None,
            },
            Corner::Round(0.02),
        ),
        (
            PathMode::Continuous {
                tolerance_mm: None,
                naive_cam_tolerance_mm: None,
            },
            Corner::Round(0.1),
        ),
    ];
    for (x, (mode, corner)) in (1..).zip(modes) {
        program.run(1, &Call::SetPathMode(mode), &settings()).unwrap();
        let part = moved(
            &mut program,
            Call::StraightFeed {
                to: Position::xyz(f64::from(x), 0.0, 0.0),
            },
        );
        assert_eq!((part.corner, part.feed, part.rapid), (corner, 5.0, false));
    }
}

#[test]
fn a_spindle_speed_is_an_action_only_while_the_spindle_turns() {
    let mut program = with_feed();
    let mut take = |call| {
        assert!(program.run(4, &call, &settings()).unwrap().is_none());
        match program.take_on_the_way()[..] {
            [Element::Action { action, line: 4 }] => Some(action),
            [] => None,
            ref other => panic!("an action expected: {other:?}"),
        }
    };
    let direction = SpindleDirection::Counterclockwise;
    assert_eq!(take(speed(500.0)), None);
    assert_eq!(
        take(Call::StartSpindle {
            spindle: 0,
            direction,
            wait_for_speed: true,
        }),
        Some(Action::SpindleOn {
            rpm: 500.0,
            direction,
            surface: None,
        })
    );
    assert_eq!(
        take(speed(9.0)),
        Some(Action::SpindleOn {
            rpm: 9.0,
            direction,
            surface: None,
        })
    );
    assert_eq!(take(Call::StopSpindle { spindle: 0 }), Some(Action::SpindleOff));
    assert_eq!(take(speed(8.0)), None);
    assert_eq!(take(Call::Message("a".into())), Some(Action::Message { number: 0 }));
    assert_eq!(take(Call::Message("b".into())), Some(Action::Message { number: 1 }));
}

#[test]
fn a_constant_speed_of_the_surface_follows_its_zero_and_is_planned_for_its_highest_speed() {
    let mut program = with_feed();
    let direction = SpindleDirection::Clockwise;
    let mode = |max_rpm| Call::SetSpindleMode {
        spindle: 0,
        mode: SpindleMode::ConstantSurfaceSpeed { max_rpm },
    };
    let start = Call::StartSpindle {
        spindle: 0,
        direction,
        wait_for_speed: true,
    };
    let mut take = |call: Call| {
        program.run(1, &call, &settings()).unwrap();
        match program.take_on_the_way()[..] {
            [
                Element::Action {
                    action: Action::SpindleOn { rpm, surface, .. },
                    ..
                },
            ] => Some((rpm, surface)),
            _ => None,
        }
    };
    let surface = |m_per_minute, centre_mm| {
        Some(Surface {
            m_per_minute,
            centre_mm,
        })
    };
    assert_eq!(take(mode(Some(1500.0))), None);
    assert_eq!(take(speed(120.0)), None);
    assert_eq!(take(start), Some((1500.0, surface(120.0, 0.0))));
    let offset = Position::xyz(-7.0, 0.0, 3.0);
    assert_eq!(
        take(Call::SetG5xOffset {
            system: 1,
            origin: offset,
        }),
        Some((1500.0, surface(120.0, -7.0)))
    );
    take(Call::SetFeedMode(FeedMode::PerTurn { spindle: 0 }));
    // 5 mm a turn.
    let part = moved(
        &mut program,
        Call::StraightFeed {
            to: Position::xyz(20.0, 0.0, 0.0),
        },
    );
    assert_eq!((part.feed, part.enables.spindle_speed), (125.0, true));
    // Without D as fast as the machine can.
    program.run(1, &mode(None), &settings()).unwrap();
    let part = moved(
        &mut program,
        Call::StraightFeed {
            to: Position::xyz(30.0, 0.0, 0.0),
        },
    );
    assert_eq!(part.feed, 500.0);
    // 120 m/min at a radius of 30 mm.
    let found = surface(120.0, -7.0).unwrap().rpm(23.0);
    assert!(
        (found - 120_000.0 / (60.0 * std::f64::consts::PI)).abs() < 1e-9,
        "{found}"
    );
}

#[test]
fn the_first_cut_behind_a_change_of_speed_waits_once() {
    let settings = Settings {
        await_spindle: true,
        ..settings()
    };
    let mut program = with_feed();
    let to = Position::xyz(1.0, 0.0, 0.0);
    let cut = Call::StraightFeed { to };
    let start = |wait_for_speed| Call::StartSpindle {
        spindle: 0,
        direction: SpindleDirection::Clockwise,
        wait_for_speed,
    };
    let mut waits = |calls: &[Call]| {
        let waits = |call: &Call| {
            let waits = program.take_wait(call, &settings) == Some(Action::AwaitSpindle);
            program.run(1, call, &settings).unwrap();
            waits
        };
        calls.iter().map(waits).collect::<Vec<bool>>()
    };
    assert_eq!(waits(&[cut.clone(), speed(100.0), cut.clone()]), [false; 3]);
    let rapid = Call::StraightTraverse { to };
    assert_eq!(
        waits(&[start(true), rapid, cut.clone(), cut.clone()]),
        [false, false, true, false]
    );
    assert_eq!(waits(&[speed(200.0), cut.clone()]), [false, true]);
    assert_eq!(waits(&[start(false), cut.clone()]), [false; 2]);
    assert_eq!(waits(&[start(true), Call::StopSpindle { spindle: 0 }, cut]), [false; 3]);
}

#[test]
fn a_refused_move_leaves_the_program_where_it_is() {
    let mut program = with_feed();
    let far = Call::StraightFeed {
        to: Position::xyz(2e3, 0.0, 0.0),
    };
    assert!(matches!(
        program.run(1, &far, &settings()),
        Err(PlanErrorKind::Travel {
            axis: Axis::X,
            limit: 1e3,
            ..
        })
    ));
    let part = moved(
        &mut program,
        Call::StraightFeed {
            to: Position::xyz(3.0, 4.0, 0.0),
        },
    );
    assert_eq!(part.piece.length(), 5.0);
    let none = Call::StraightFeed {
        to: Position::xyz(f64::NAN, 0.0, 0.0),
    };
    assert_eq!(
        program.run(1, &none, &settings()).unwrap_err(),
        PlanErrorKind::NotFinite
    );
    let centre = arc(Position::xyz(5.0, 5.0, 0.0), Plane::Xy, [3.0, 4.0], 1);
    assert_eq!(program.run(1, &centre, &settings()).unwrap_err(), PlanErrorKind::BadArc);
}
