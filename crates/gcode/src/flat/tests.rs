use super::moves::wrapped_word;
use super::*;
use crate::{Tool, ToolChanger, ToolTable};
use motion::canon::{
    Axis, Cutter, FeedMode, Input, LengthUnit, OrientDirection, PathMode, ProbeMode, Record, Side, SpindleDirection,
    SpindleMode, ToolEntry, WaitMode,
};

fn settings() -> Settings {
    let mut tools = ToolTable::new(LengthUnit::Millimetre, ToolChanger::Fixed);
    for number in 1..=3 {
        let tool = Tool {
            number,
            pocket: number,
            ..Tool::default()
        };
        tools.set(tool).unwrap();
    }
    let mut settings = Settings {
        tools,
        ..Settings::default()
    };
    settings.work_offsets[1] = Position::xyz(10.1, -20.3, 0.7);
    settings.work_rotations_degrees[2] = 30.0;
    settings
}

fn flat_of(settings: &Settings, events: impl IntoIterator<Item = Event>) -> Result<String, FlatError> {
    let mut writer = FlatWriter::new(settings);
    let mut out = Vec::new();
    for event in events {
        writer.write(&event, &mut out)?;
    }
    writer.finish(&mut out)?;
    Ok(String::from_utf8(out).unwrap())
}

fn events(calls: &[Call]) -> Vec<Event> {
    let event = |(line, call): (usize, &Call)| Event {
        source: Source {
            line: line as u32 + 1,
            ..Source::default()
        },
        call: call.clone(),
    };
    calls.iter().enumerate().map(event).collect()
}

/// The lines of calls between the first and the last one, which are always the same.
fn lines(calls: &[Call]) -> Vec<String> {
    let text = flat_of(&settings(), events(calls)).unwrap();
    let body = text
        .strip_prefix("%\nG21 G90 G90.1\n")
        .unwrap()
        .strip_suffix("%\n")
        .unwrap();
    body.lines().map(String::from).collect()
}

fn refused(calls: &[Call]) -> String {
    flat_of(&settings(), events(calls)).unwrap_err().to_string()
}

const FEED: Call = Call::SetFeedRate {
    linear: 10.0,
    angular: 2.0,
};

fn feed(x: f64, y: f64, z: f64) -> Call {
    Call::StraightFeed {
        to: Position::xyz(x, y, z),
    }
}

#[test]
fn moves_name_the_axes_that_move_and_feeds_what_they_count() {
    let mut turned = Position::xyz(1.0, 2.5, 0.0);
    turned[Axis::B] = -90.0;
    let calls = [
        Call::StraightTraverse {
            to: Position::xyz(0.0, 0.0, 0.0),
        },
        FEED,
        feed(1.0, 0.0, 0.0),
        feed(1.0, 2.5, 0.0),
        Call::StraightFeed { to: turned },
        Call::StraightFeed { to: turned },
        Call::SetFeedMode(FeedMode::PerTurn { spindle: 1 }),
        Call::SetFeedRate {
            linear: 0.25,
            angular: 0.25,
        },
        Call::StraightTraverse { to: Position::ZERO },
        feed(0.0, 0.0, -1.0),
    ];
    assert_eq!(
        lines(&calls),
        [
            "G0 X0",
            "G1 X1 F600",
            "G1 Y2.5",
            "G1 B-90 F120",
            "G1 X1 F600",
            "G95 $1",
            "G0 X0 Y0 B0",
            "G1 Z-1 F0.25",
        ]
    );
}

#[test]
fn arcs_have_absolute_centres_in_their_own_plane() {
    let arc = |to, plane, centre_mm, turns| Call::ArcFeed {
        to,
        plane,
        centre_mm,
        turns,
    };
    let calls = [
        FEED,
        arc(Position::xyz(10.0, 0.0, 0.0), Plane::Xy, [5.0, 0.0], -1),
        arc(Position::xyz(10.0, 0.0, 3.0), Plane::Xy, [5.0, 0.0], 3),
        arc(Position::xyz(12.0, 0.0, 1.0), Plane::Zx, [1.0, 10.0], 1),
    ];
    assert_eq!(
        lines(&calls),
        ["G2 X10 I5 J0 F600", "G3 Z3 I5 J0 P3", "G3 G18 X12 Z1 K1 I10",]
    );
    let wrong = arc(Position::xyz(10.0, 0.0, 0.0), Plane::Xy, [4.0, 0.0], -1);
    assert_eq!(
        refused(&[FEED, wrong]),
        "line 2: cannot be written as plain G-code: an arc that G2 and G3 refuse in mm: radius at start 4.0000, at end 6.0000: difference 2.0000 > 0.0283 tolerance (centre 4.0000 0.0000, end 10.0000 0.0000, in the units of the program); is the unit right (G20, G21), and are the centre's words offsets from the start (G91.1) or a place (G90.1)?"
    );
}

#[test]
fn curves_threads_taps_and_probing_moves() {
    let sync = |velocity| Call::StartSpindleSync {
        spindle: 0,
        mm_per_turn: 1.5,
        velocity,
    };
    let tap = Call::RigidTap {
        to: Position::xyz(1.0, 0.0, -9.0),
        return_scale: 2.0,
    };
    let probe = |towards, must_trip| Call::StraightProbe {
        to: Position::xyz(1.0, 0.0, -8.0),
        mode: ProbeMode { towards, must_trip },
    };
    let nurbs = |plane, start, order| Call::NurbsFeed {
        plane,
        points: vec![(start, 1.0), ([2.0, 1.0], 0.5), ([3.0, 0.0], 1.0)],
        order,
        knots: Vec::new(),
    };
    let calls = [
        FEED,
        sync(false),
        feed(1.0, 0.0, 0.0),
        Call::StopSpindleSync,
        sync(false),
        tap.clone(),
        Call::StopSpindleSync,
        nurbs(Plane::Xy, [1.0, 0.0], 3),
        probe(true, true),
        probe(true, false),
        probe(false, true),
        probe(false, false),
    ];
    assert_eq!(
        lines(&calls),
        [
            "G33 X1 K1.5",
            "G33.1 Z-9 K1.5 I2",
            "G5.2 P1 L3 F600",
            "X2 Y1 P0.5",
            "X3 Y0 P1",
            "G5.3",
            "G38.2 X1 Z-8",
            "G38.3 X1 Z-8",
            "G38.4 X1 Z-8",
            "G38.5 X1 Z-8",
        ]
    );
    for (calls, reason) in [
        (
            vec![sync(true)],
            "motion that follows the speed of a spindle, but not its angle",
        ),
        (vec![tap], "a rigid tap outside of synchronised motion has no pitch"),
        (
            vec![sync(false), probe(true, true)],
            "a probing move in step with a spindle",
        ),
        (
            vec![FEED, nurbs(Plane::Uv, [0.0, 0.0], 3)],
            "a spline in a plane of U, V and W",
        ),
        (
            vec![FEED, nurbs(Plane::Xy, [1.0, 0.0], 3)],
            "a spline that does not begin where the axes stand",
        ),
        (
            vec![FEED, nurbs(Plane::Xy, [0.0, 0.0], 4)],
            "a spline with fewer points than its order, or an order below 3",
        ),
        (
            vec![feed(1.0, 0.0, 0.0)],
            "a move at feed before a feed above 0 was set",
        ),
        (
            vec![FEED, feed(f64::INFINITY, 0.0, 0.0)],
            "the number of X is not finite",
        ),
    ] {
        let line = calls.len();
        assert_eq!(
            refused(&calls),
            format!("line {line}: cannot be written as plain G-code: {reason}")
        );
    }
}

#[test]
fn modes_and_offsets() {
    let continuous = |tolerance_mm, naive_cam_tolerance_mm| {
        Call::SetPathMode(PathMode::Continuous {
            tolerance_mm,
            naive_cam_tolerance_mm,
        })
    };
    let g5x = |system, origin| Call::SetG5xOffset { system, origin };
    let known = Position::xyz(10.1, -20.3, 0.7);
    let cutter = |radius_mm, orientation| {
        Call::SetCutterCompensation(Some(Cutter {
            side: Side::Left,
            radius_mm,
            orientation,
        }))
    };
    let calls = [
        Call::SetPathMode(PathMode::ExactPath),
        Call::SetPathMode(PathMode::ExactStop),
        continuous(None, None),
        continuous(Some(0.1), None),
        continuous(Some(0.1), Some(0.02)),
        continuous(None, Some(0.02)),
        Call::SelectPlane(Plane::Xy),
        Call::SelectPlane(Plane::Vw),
        Call::UseLengthUnit(LengthUnit::Inch),
        g5x(2, known),
        Call::SetXyRotation { degrees: 0.0 },
        g5x(2, Position::xyz(10.1, 5.0, 0.7)),
        g5x(1, Position::ZERO),
        Call::SetXyRotation { degrees: 15.0 },
        Call::SetG92Offset {
            offset: Position::xyz(0.0, 3.0, 0.0),
        },
        Call::SetG92Offset { offset: Position::ZERO },
        Call::SetToolLengthOffset {
            offset: Position::xyz(0.0, 0.0, 12.7),
        },
        Call::SetToolLengthOffset { offset: Position::ZERO },
        cutter(2.0, 0),
        cutter(-2.0, 3),
        Call::SetCutterCompensation(None),
    ];
    assert_eq!(
        lines(&calls),
        [
            "G61",
            "G61.1",
            "G64",
            "G64 P0.1 Q0",
            "G64 P0.1 Q0.02",
            "G64 Q0.02",
            "G19.1",
            "G55",
            "G10 L2 P2 Y5",
            "G54",
            "G10 L2 P1 R15",
            "G52 Y3",
            "G52 Y0",
            "G43.1 Z12.7",
            "G49",
            "G41.1 D4",
            "G42.1 D4 L3",
            "G40",
        ]
    );
}

#[test]
fn spindle_coolant_and_tools() {
    let mode = |spindle, mode| Call::SetSpindleMode { spindle, mode };
    let speed = |spindle, speed| Call::SetSpindleSpeed { spindle, speed };
    let start = |direction, wait_for_speed| Call::StartSpindle {
        spindle: 1,
        direction,
        wait_for_speed,
    };
    let orient = |direction| Call::OrientSpindle {
        spindle: 0,
        degrees: 30.0,
        direction,
    };
    let entry = |tool, x| {
        Call::SetToolEntry(ToolEntry {
            tool,
            pocket: 0,
            offset: Position::xyz(x, 0.0, 0.0),
            diameter_mm: 3.0,
            front_angle_degrees: 0.0,
            back_angle_degrees: 0.0,
            orientation: 0,
        })
    };
    let css = |max_rpm| SpindleMode::ConstantSurfaceSpeed { max_rpm };
    let calls = [
        mode(0, css(Some(2000.0))),
        speed(0, 120.0),
        mode(1, css(None)),
        speed(0, 100.0),
        mode(0, SpindleMode::Rpm),
        speed(0, 500.0),
        speed(1, 700.0),
        start(SpindleDirection::Clockwise, true),
        start(SpindleDirection::Counterclockwise, true),
        Call::StopSpindle { spindle: 1 },
        Call::StopSpindle { spindle: 0 },
        orient(OrientDirection::Clockwise),
        orient(OrientDirection::Counterclockwise),
        Call::WaitSpindleOriented {
            spindle: 0,
            timeout_s: 5.0,
        },
        orient(OrientDirection::Shortest),
        Call::Mist(true),
        Call::Flood(true),
        Call::Mist(false),
        Call::Flood(false),
        Call::Mist(true),
        Call::Flood(true),
        Call::Flood(false),
        Call::SelectTool { tool: 2 },
        Call::StartChange,
        Call::ChangeTool { tool: 2, pocket: 2 },
        Call::ChangeTool { tool: 3, pocket: 2 },
        Call::SetToolNumber { tool: 2, pocket: 2 },
        entry(2, 1.5),
        entry(2, 1.5),
        entry(2, 0.0),
        Call::ReloadToolTable,
    ];
    assert_eq!(
        lines(&calls),
        [
            "G96 D2000 S120",
            "G96 $1",
            "S100",
            "G97 S500",
            "S700 $1",
            "M3 $1",
            "M4 $1",
            "M5 $1",
            "M5",
            "M19 R30 P1",
            "M19 R30 P2 Q5",
            "M19 R30",
            "M7",
            "M8",
            "M9",
            "M7",
            "M8",
            "M9",
            "M7",
            "T2",
            "M6",
            "M6 T3",
            "M61 Q2",
            "G10 L1 P2 X1.5 R1.5 I0 J0 Q0",
            "G10 L1 P2 X0 R1.5 I0 J0 Q0",
            "G10 L0",
        ]
    );
    assert_eq!(
        refused(&[start(SpindleDirection::Clockwise, false)]),
        "line 1: cannot be written as plain G-code: a spindle that starts without a wait for its speed"
    );
}

#[test]
fn overrides_inputs_outputs_and_texts() {
    let digital = |on, with_motion| Call::SetDigitalOutput {
        index: 3,
        on,
        with_motion,
    };
    let analog = |with_motion| Call::SetAnalogOutput {
        index: 2,
        value: -1.5,
        with_motion,
    };
    let wait = |input, mode, timeout_s| Call::WaitInput { input, mode, timeout_s };
    let calls = [
        Call::Dwell { seconds: 0.5 },
        Call::EnableFeedOverride(true),
        Call::EnableSpeedOverride { spindle: 0, on: false },
        Call::EnableSpeedOverride { spindle: 1, on: true },
        Call::EnableAdaptiveFeed(true),
        Call::EnableFeedHold(false),
        digital(true, true),
        digital(false, true),
        digital(true, false),
        digital(false, false),
        analog(true),
        analog(false),
        wait(Input::Digital(1), WaitMode::Rise, 2.5),
        wait(Input::Digital(1), WaitMode::Fall, 2.5),
        wait(Input::Digital(1), WaitMode::High, 2.5),
        wait(Input::Digital(1), WaitMode::Low, 2.5),
        wait(Input::Analog(0), WaitMode::Immediate, 0.0),
        Call::UserCode {
            number: 101,
            p: -1.0,
            q: 2.0,
        },
        Call::Probe(true),
        Call::Message(" hello".into()),
        Call::Comment("roughing".into()),
        Call::Comment("interpreter: motion mode set to none".into()),
        Call::Record(Record::Print("a".into())),
        Call::Record(Record::OpenLog("a.txt".into())),
        Call::Record(Record::AppendLog("a.txt".into())),
        Call::Record(Record::Log(" 1.5".into())),
        Call::Record(Record::CloseLog),
        Call::Record(Record::OpenProbeLog("p.txt".into())),
        Call::Record(Record::CloseProbeLog),
        Call::PalletShuttle,
        Call::ProgramStop,
        Call::ProgramStop,
        Call::OptionalProgramStop,
        Call::PalletShuttle,
        Call::ProgramEnd,
        Call::Reset,
        Call::Finish,
    ];
    assert_eq!(
        lines(&calls),
        [
            "G4 P0.5",
            "M50 P1",
            "M51 P0",
            "M51 P1 $1",
            "M52 P1",
            "M53 P0",
            "M62 P3",
            "M63 P3",
            "M64 P3",
            "M65 P3",
            "M67 E2 Q-1.5",
            "M68 E2 Q-1.5",
            "M66 P1 L1 Q2.5",
            "M66 P1 L2 Q2.5",
            "M66 P1 L3 Q2.5",
            "M66 P1 L4 Q2.5",
            "M66 E0 L0",
            "M101 Q2",
            "(MSG, hello)",
            "(roughing)",
            "(PRINT,a)",
            "(LOGOPEN,a.txt)",
            "(LOGAPPEND,a.txt)",
            "(LOG, 1.5)",
            "(LOGCLOSE)",
            "(PROBEOPEN p.txt)",
            "(PROBECLOSE)",
            "M60",
            "M0",
            "M1",
            "M30",
        ]
    );
    assert_eq!(lines(&[Call::ProgramEnd]), ["M2"]);
    for text in ["a)", "(", "a\nb", " msg, a", "logclose"] {
        let expected = format!("the text {text:?} would mean something else in a comment");
        assert!(refused(&[Call::Comment(text.to_string().into())]).ends_with(&expected));
    }
    assert!(refused(&[Call::Record(Record::Print("#1".into()))]).contains("would mean something else"));
    assert!(refused(&[Call::Message("x".repeat(300))]).ends_with("longer than 250 characters"));
    assert!(refused(&[Call::PalletShuttle]).ends_with("without M30 or M60"));
}

#[test]
fn an_axis_without_ends_turns_the_way_it_did() {
    for (at, to, word) in [
        (350.0, 370.0, Some(10.0)),
        (370.0, 350.0, Some(-350.0)),
        (10.0, -10.0, Some(-350.0)),
        (10.0, 0.0, Some(-0.0)),
        (350.0, 360.0, Some(0.0)),
        (0.0, 360.0, None),
        (10.0, -400.0, None),
    ] {
        assert_eq!(
            wrapped_word(at, to).map(f64::to_bits),
            word.map(f64::to_bits),
            "{at} to {to}"
        );
    }
}
