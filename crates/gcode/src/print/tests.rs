//! Every call as `rs274` prints it. Lines that a run of LinuxCNC 2.9 printed are the rule; the newest differs in tool
//! changes and splines.

use super::*;
use motion::canon::{Cutter, Input, ProbeMode, WaitMode};

/// What is printed of `calls` behind `N0010`, without the count and this number.
fn printed_in(unit: LengthUnit, calls: &[Call]) -> Vec<String> {
    let mut printer = CanonPrinter::new(LengthUnit::Inch);
    printer.unit = unit;
    printer.started = true;
    let mut out = Vec::new();
    let source = Source {
        n: Some(10),
        n_digits: 4,
        ..Source::default()
    };
    for call in calls {
        let call = call.clone();
        printer.write(&Event { source, call }, &mut out).unwrap();
    }
    let text = String::from_utf8(out).unwrap();
    let line = |(i, line): (usize, &str)| {
        let front = format!("{:5} N0010  ", i + 1);
        line.strip_prefix(&front)
            .unwrap_or_else(|| panic!("{line:?}"))
            .to_string()
    };
    text.lines().enumerate().map(line).collect()
}

fn printed(calls: &[Call]) -> Vec<String> {
    printed_in(LengthUnit::Millimetre, calls)
}

const NINE: Position = Position([25.4, -50.8, 0.00001, 4.0, -0.00001, 6.5, 70.0, 80.0, 90.0]);

#[test]
fn moves() {
    let to = NINE;
    let calls = [
        Call::StraightTraverse { to },
        Call::StraightFeed { to },
        Call::ArcFeed {
            to,
            plane: Plane::Zx,
            centre_mm: [12.7, -2.54],
            turns: -2,
        },
        Call::StraightProbe {
            to,
            mode: ProbeMode {
                towards: true,
                must_trip: true,
            },
        },
        Call::RigidTap { to, return_scale: 2.0 },
        Call::NurbsFeed {
            plane: Plane::Xy,
            points: vec![([0.0, 0.0], 1.0); 4],
            order: 3,
            knots: Vec::new(),
        },
        Call::Dwell { seconds: 0.5 },
    ];
    assert_eq!(
        printed(&calls),
        [
            "STRAIGHT_TRAVERSE(25.4000, -50.8000, 0.0000, 4.0000, 0.0000, 6.5000)",
            "STRAIGHT_FEED(25.4000, -50.8000, 0.0000, 4.0000, 0.0000, 6.5000)",
            "ARC_FEED(0.0000, 25.4000, 12.7000, -2.5400, -2, -50.8000, 4.0000, 0.0000, 6.5000)",
            "STRAIGHT_PROBE(25.4000, -50.8000, 0.0000, 4.0000, 0.0000, 6.5000)",
            "RIGID_TAP(25.4000, -50.8000, 0.0000)",
            "NURBS_G5_FEED(4, ...)",
            "DWELL(0.5000)",
        ]
    );
    assert_eq!(
        printed_in(LengthUnit::Inch, &calls)[..5],
        [
            "STRAIGHT_TRAVERSE(1.0000, -2.0000, 0.0000, 4.0000, 0.0000, 6.5000)",
            "STRAIGHT_FEED(1.0000, -2.0000, 0.0000, 4.0000, 0.0000, 6.5000)",
            "ARC_FEED(0.0000, 1.0000, 0.5000, -0.1000, -2, -2.0000, 4.0000, 0.0000, 6.5000)",
            "STRAIGHT_PROBE(1.0000, -2.0000, 0.0000, 4.0000, 0.0000, 6.5000)",
            "RIGID_TAP(1.0000, -2.0000, 0.0000)",
        ]
    );
}

#[test]
fn feeds_and_modes() {
    let calls = [
        Call::StartSpindleSync {
            spindle: 1,
            mm_per_turn: 1.27,
            velocity: false,
        },
        Call::StopSpindleSync,
        Call::SetFeedMode(FeedMode::PerTurn { spindle: 1 }),
        Call::SetFeedRate {
            linear: 2.54,
            angular: 0.1,
        },
        Call::SetFeedMode(FeedMode::PerTime),
        Call::SetFeedRate {
            linear: 25.4,
            angular: 1.0,
        },
        Call::SetPathMode(PathMode::ExactPath),
        Call::SetPathMode(PathMode::ExactStop),
        Call::SetPathMode(PathMode::Continuous {
            tolerance_mm: Some(0.127),
            naive_cam_tolerance_mm: Some(0.254),
        }),
        Call::SetPathMode(PathMode::Continuous {
            tolerance_mm: None,
            naive_cam_tolerance_mm: None,
        }),
        Call::SelectPlane(Plane::Xy),
        Call::SelectPlane(Plane::Zx),
        Call::SelectPlane(Plane::Yz),
        Call::SelectPlane(Plane::Uv),
        Call::SelectPlane(Plane::Wu),
        Call::SelectPlane(Plane::Vw),
        Call::UseLengthUnit(LengthUnit::Millimetre),
        Call::UseLengthUnit(LengthUnit::Inch),
    ];
    assert_eq!(
        printed_in(LengthUnit::Inch, &calls),
        [
            "START_SPEED_FEED_SYNC(0.050000,0)",
            "STOP_SPEED_FEED_SYNCH()",
            "SET_FEED_MODE(1, 1)",
            "SET_FEED_RATE(0.1000)",
            "SET_FEED_MODE(0, 0)",
            "SET_FEED_RATE(60.0000)",
            "SET_MOTION_CONTROL_MODE(CANON_EXACT_PATH)",
            "SET_MOTION_CONTROL_MODE(CANON_EXACT_STOP)",
            "SET_NAIVECAM_TOLERANCE(0.0000)",
            "SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.005000)",
            "SET_NAIVECAM_TOLERANCE(0.0100)",
            "SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.000000)",
            "SET_NAIVECAM_TOLERANCE(0.0000)",
            "SELECT_PLANE(CANON_PLANE_XY)",
            "SELECT_PLANE(CANON_PLANE_XZ)",
            "SELECT_PLANE(CANON_PLANE_YZ)",
            "SELECT_PLANE(CANON_PLANE_UNKNOWN)",
            "SELECT_PLANE(CANON_PLANE_UNKNOWN)",
            "SELECT_PLANE(CANON_PLANE_UNKNOWN)",
            "USE_LENGTH_UNITS(CANON_UNITS_MM)",
            "USE_LENGTH_UNITS(CANON_UNITS_INCHES)",
        ]
    );
}

#[test]
fn offsets() {
    let calls = [
        Call::SetG5xOffset {
            system: 9,
            origin: NINE,
        },
        Call::SetG92Offset { offset: NINE },
        Call::SetXyRotation { degrees: -30.0 },
        Call::SetToolLengthOffset { offset: NINE },
        Call::SetCutterCompensation(Some(Cutter {
            side: Side::Left,
            radius_mm: 2.54,
            orientation: 0,
        })),
        Call::SetCutterCompensation(Some(Cutter {
            side: Side::Right,
            radius_mm: -2.54,
            orientation: 3,
        })),
        Call::SetCutterCompensation(None),
    ];
    assert_eq!(
        printed_in(LengthUnit::Inch, &calls),
        [
            "SET_G5X_OFFSET(9, 1.0000, -2.0000, 0.0000, 4.0000, 0.0000, 6.5000)",
            "SET_G92_OFFSET(1.0000, -2.0000, 0.0000, 4.0000, 0.0000, 6.5000)",
            "SET_XY_ROTATION(-30.0000)",
            "USE_TOOL_LENGTH_OFFSET(1.0000 -2.0000 0.0000, 4.0000 0.0000 6.5000, 2.7559 3.1496 3.5433)",
            "SET_CUTTER_RADIUS_COMPENSATION(0.1000)",
            "START_CUTTER_RADIUS_COMPENSATION(LEFT)",
            "SET_CUTTER_RADIUS_COMPENSATION(-0.1000)",
            "START_CUTTER_RADIUS_COMPENSATION(RIGHT)",
            "STOP_CUTTER_RADIUS_COMPENSATION()",
        ]
    );
}

#[test]
fn spindle_and_coolant() {
    let speed = Call::SetSpindleSpeed {
        spindle: 0,
        speed: 50.0 * 0.3048,
    };
    let mode = |mode| Call::SetSpindleMode { spindle: 0, mode };
    let start = |direction| Call::StartSpindle {
        spindle: 7,
        direction,
        wait_for_speed: true,
    };
    let orient = |direction| Call::OrientSpindle {
        spindle: 0,
        degrees: 30.0,
        direction,
    };
    let calls = [
        mode(SpindleMode::ConstantSurfaceSpeed { max_rpm: None }),
        speed.clone(),
        mode(SpindleMode::ConstantSurfaceSpeed { max_rpm: Some(100.0) }),
        mode(SpindleMode::Rpm),
        speed.clone(),
        start(SpindleDirection::Clockwise),
        start(SpindleDirection::Counterclockwise),
        Call::StopSpindle { spindle: 7 },
        orient(OrientDirection::Shortest),
        orient(OrientDirection::Clockwise),
        orient(OrientDirection::Counterclockwise),
        Call::WaitSpindleOriented {
            spindle: 0,
            timeout_s: 5.0,
        },
        Call::Mist(true),
        Call::Mist(false),
        Call::Flood(true),
        Call::Flood(false),
    ];
    assert_eq!(
        printed_in(LengthUnit::Inch, &calls),
        [
            "SET_SPINDLE_MODE(0 1000000000000000019884624838656.0000)",
            "SET_SPINDLE_SPEED(0, 50.0000)",
            "SET_SPINDLE_MODE(0 100.0000)",
            "SET_SPINDLE_MODE(0 0.0000)",
            "SET_SPINDLE_SPEED(0, 15.2400)",
            "START_SPINDLE_CLOCKWISE(7)",
            "START_SPINDLE_COUNTERCLOCKWISE(7)",
            "STOP_SPINDLE_TURNING(7)",
            "ORIENT_SPINDLE(0, 30.0000, 0)",
            "ORIENT_SPINDLE(0, 30.0000, 1)",
            "ORIENT_SPINDLE(0, 30.0000, 2)",
            "SPINDLE.0.WAIT_ORIENT_COMPLETE(5.0000)",
            "MIST_ON()",
            "MIST_OFF()",
            "FLOOD_ON()",
            "FLOOD_OFF()",
        ]
    );
    let metric = [calls[0].clone(), speed];
    assert_eq!(printed(&metric)[1], "SET_SPINDLE_SPEED(0, 15.2400)");
}

#[test]
fn tools() {
    let calls = [
        Call::SelectTool { tool: 12 },
        Call::StartChange,
        Call::ChangeTool { tool: 12, pocket: 3 },
        Call::SetToolNumber { tool: 12, pocket: 3 },
        Call::SetToolEntry(ToolEntry {
            tool: 12,
            pocket: 3,
            offset: Position::xyz(0.0, 0.0, 3.0),
            diameter_mm: 4.0,
            front_angle_degrees: 10.0,
            back_angle_degrees: -20.0,
            orientation: 9,
        }),
        Call::ReloadToolTable,
    ];
    // The table is in the unit of the machine, inches here, whatever the program speaks.
    let entry = "0.0000 0.0000 0.1181 0.0000 0.0000 0.0000 0.0000 0.0000 0.0000, 10.0000, -20.0000, 9";
    assert_eq!(
        printed(&calls),
        [
            "SELECT_TOOL(12)".to_string(),
            "CHANGE_TOOL()".to_string(),
            "CHANGE_TOOL_NUMBER(12)".to_string(),
            format!("SET_TOOL_TABLE_ENTRY(3, 12, {entry})"),
            "RELOAD_TOOLDATA()".to_string(),
        ]
    );
}

#[test]
fn overrides_inputs_and_outputs() {
    let digital = |on, with_motion| Call::SetDigitalOutput {
        index: 3,
        on,
        with_motion,
    };
    let analog = |with_motion| Call::SetAnalogOutput {
        index: 2,
        value: -3.0,
        with_motion,
    };
    let speed_override = |on| Call::EnableSpeedOverride { spindle: 1, on };
    let calls = [
        Call::EnableFeedOverride(true),
        Call::EnableFeedOverride(false),
        speed_override(true),
        speed_override(false),
        Call::EnableAdaptiveFeed(true),
        Call::EnableAdaptiveFeed(false),
        Call::EnableFeedHold(true),
        Call::EnableFeedHold(false),
        digital(true, true),
        digital(false, true),
        digital(true, false),
        digital(false, false),
        analog(true),
        analog(false),
        Call::WaitInput {
            input: Input::Digital(1),
            mode: WaitMode::High,
            timeout_s: 1.0,
        },
        Call::UserCode {
            number: 100,
            p: 1.0,
            q: -1.0,
        },
        Call::Probe(true),
        Call::Probe(false),
    ];
    assert_eq!(
        printed(&calls),
        [
            "ENABLE_FEED_OVERRIDE()",
            "DISABLE_FEED_OVERRIDE()",
            "ENABLE_SPEED_OVERRIDE(1)",
            "DISABLE_SPEED_OVERRIDE(1)",
            "ENABLE_ADAPTIVE_FEED()",
            "DISABLE_ADAPTIVE_FEED()",
            "ENABLE_FEED_HOLD()",
            "DISABLE_FEED_HOLD()",
            "SET_MOTION_OUTPUT_BIT(3)",
            "CLEAR_MOTION_OUTPUT_BIT(3)",
            "SET_AUX_OUTPUT_BIT(3)",
            "CLEAR_AUX_OUTPUT_BIT(3)",
            "SET_MOTION_OUTPUT_VALUE(2,-3.000000)",
            "SET_AUX_OUTPUT_VALUE(2,-3.000000)",
            "USER_DEFINED_FUNCTION(100, 1.000000, -1.000000)",
            "TURN_PROBE_ON()",
            "TURN_PROBE_OFF()",
        ]
    );
}

#[test]
fn texts_and_the_end() {
    let calls = [
        Call::Message(" hello  \"w\"".into()),
        Call::Comment("interpreter: motion mode set to none".into()),
        Call::Record(Record::Print("a".into())),
        Call::Record(Record::OpenLog("a.txt".into())),
        Call::Record(Record::AppendLog("a.txt".into())),
        Call::Record(Record::Log(" la".into())),
        Call::Record(Record::CloseLog),
        Call::Record(Record::OpenProbeLog("p.txt".into())),
        Call::Record(Record::CloseProbeLog),
        Call::ProgramStop,
        Call::OptionalProgramStop,
        Call::PalletShuttle,
        Call::ProgramEnd,
        Call::Finish,
    ];
    assert_eq!(
        printed(&calls),
        [
            "MESSAGE(\" hello  \"w\"\")",
            "COMMENT(\"interpreter: motion mode set to none\")",
            "LOGOPEN(\"a.txt\")",
            "LOGAPPEND(\"a.txt\")",
            "LOG(\" la\")",
            "LOGCLOSE()",
            "PROGRAM_STOP()",
            "OPTIONAL_PROGRAM_STOP()",
            "PALLET_SHUTTLE()",
            "PROGRAM_END()",
            "FINISH()",
        ]
    );
}

#[test]
fn the_first_reset_tells_what_feeds_refer_to() {
    let mut printer = CanonPrinter::new(LengthUnit::Millimetre);
    let mut out = Vec::new();
    for call in [Call::Reset, Call::Reset] {
        let source = Source::default();
        printer.write(&Event { source, call }, &mut out).unwrap();
    }
    let expected = "    1 N..... SET_FEED_REFERENCE(CANON_XYZ)\n    2 N..... ON_RESET()\n    3 N..... ON_RESET()\n";
    assert_eq!(String::from_utf8(out).unwrap(), expected);
}

#[test]
fn the_number_of_a_line_has_the_digits_of_the_text() {
    let line = |n, n_digits| {
        let mut out = Vec::new();
        let source = Source {
            n: Some(n),
            n_digits,
            ..Source::default()
        };
        let call = Call::ProgramStop;
        CanonPrinter::new(LengthUnit::Millimetre)
            .write(&Event { source, call }, &mut out)
            .unwrap();
        String::from_utf8(out).unwrap()
    };
    assert_eq!(line(7, 1), "    1 N7     PROGRAM_STOP()\n");
    assert_eq!(line(7, 4), "    1 N0007  PROGRAM_STOP()\n");
    assert_eq!(line(1_234_567, 0), "    1 N1234567PROGRAM_STOP()\n");
}

#[test]
fn inches_are_printed_as_they_were_written() {
    // 5 in the fifth decimal: converted to mm and back, many of these would come out on the wrong side.
    for k in 0..20_000 {
        let text = format!("{}.{:05}", k / 1000, (k * 10 + 5) % 100_000);
        let inches: f64 = text.parse().unwrap();
        let shown = length_in(inches * 25.4, LengthUnit::Inch);
        assert_eq!(shown.to_bits(), inches.to_bits(), "{text}");
    }
}

#[test]
fn the_end_has_no_line_number() {
    let mut printer = CanonPrinter::new(LengthUnit::Millimetre);
    printer.started = true;
    let mut out = Vec::new();
    let source = Source {
        n: Some(10),
        n_digits: 2,
        ..Source::default()
    };
    for call in [Call::ProgramEnd, Call::Reset] {
        printer.write(&Event { source, call }, &mut out).unwrap();
    }
    printer.write_end_after_error(&mut out).unwrap();
    let expected =
        "    1 N10    PROGRAM_END()\n    2 N..... ON_RESET()\n    3 N..... ON_RESET()\n    4 N..... ON_RESET()\n";
    assert_eq!(String::from_utf8(out).unwrap(), expected);
}

#[test]
fn plane_and_path_mode_of_the_start_are_not_printed() {
    let mut printer = CanonPrinter::new(LengthUnit::Millimetre);
    let mut out = Vec::new();
    for call in [Call::SelectPlane(Plane::Xy), Call::SetPathMode(PathMode::ExactPath)] {
        let source = Source::default();
        printer.write(&Event { source, call }, &mut out).unwrap();
    }
    assert_eq!(out, b"");
}
