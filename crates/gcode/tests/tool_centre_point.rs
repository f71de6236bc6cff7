//! G43.4: the calls that come of it, where the axes read afterwards, and what is refused.

use gcode::{Interpreter, Settings, ToolChanger, ToolTable};
use motion::canon::{Axis, Call, LengthUnit, Position};
use motion::kinematics::{Follows, Hand, Kinematics, Rotary, RotaryAxis, TableTable, Transform};

/// An A/C trunnion whose centre lines cross at the machine's zero.
fn trunnion() -> Settings {
    let rotary = |axis| Rotary {
        axis,
        hand: Hand::Right,
        centre_mm: [0.0; 3],
    };
    let table = TableTable {
        primary: rotary(RotaryAxis::A),
        secondary: rotary(RotaryAxis::C),
    };
    let follows = [Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C].map(|axis| Follows {
        axis: Some(axis),
        offset: 0.0,
    });
    let tools = b"T1 P1 Z50 D6\nT2 P2 Z80 D6\nT3 P3 X4 Z80 D6\n";
    Settings {
        kinematics: Kinematics::new(Transform::TableTable(table), &follows),
        tools: ToolTable::parse(tools, LengthUnit::Millimetre, ToolChanger::Fixed).unwrap(),
        ..Settings::default()
    }
}

fn calls(text: &str) -> Vec<Call> {
    let wanted = |call: &Call| {
        matches!(
            call,
            Call::StraightTraverse { .. } | Call::SetToolLengthOffset { .. } | Call::SetToolCentrePoint(_)
        )
    };
    // The text ends without M2, which is an error at its end only.
    let interpreter = Interpreter::new(trunnion());
    let calls = interpreter
        .run(text.as_bytes())
        .map_while(|event| Some(event.ok()?.call));
    calls.filter(wanted).collect()
}

/// Where the last rapid move of a program leads.
fn last(text: &str) -> Position {
    let target = |call: &Call| match call {
        Call::StraightTraverse { to } => Some(*to),
        _ => None,
    };
    calls(text).iter().rev().find_map(target).unwrap()
}

fn error(text: &str) -> String {
    let mut events = Interpreter::new(trunnion()).run(text.as_bytes());
    let error = events.find_map(Result::err).expect("an error");
    error.to_string()
}

#[track_caller]
fn assert_near(got: Position, wanted: [f64; 3]) {
    assert!(
        got.0.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9),
        "{got:?} for {wanted:?}"
    );
}

#[test]
fn the_length_comes_before_the_switch_and_goes_after_it() {
    let length = |z| {
        let offset = Position::xyz(0.0, 0.0, z);
        Call::SetToolLengthOffset { offset }
    };
    let on = Call::SetToolCentrePoint;
    assert_eq!(
        calls("G43.4 H1\nG43.4 H2\nG49\n"),
        [length(50.0), on(true), length(80.0), on(false), length(0.0)]
    );
    // G43 is of the same modal group; the end of the program ends it, too.
    assert_eq!(
        calls("G43.4 H1\nG43 H1\n"),
        [length(50.0), on(true), on(false), length(50.0)]
    );
    assert_eq!(
        calls("G43.4 H1\nM2\n"),
        [length(50.0), on(true), on(false), length(50.0)]
    );
    // M70 keeps it.
    let restored = calls("G43.4 H1\nM70\nG49\nM72\n");
    assert_eq!(restored[4..], [length(50.0), on(true)]);
}

#[test]
fn axes_read_as_the_tip_on_the_work_from_then_on() {
    // The spindle nose at Y-10 Z60, tool 50, table at A90: its tip stands at Y-10 Z10. On the work, whose +Z lies towards -Y
    // and whose +Y towards +Z, that is Y10 Z10; unnamed axes stay there.
    assert_near(last("G0 Y-10 Z60 A90\nG43.4 H1\nG0 X5\n"), [5.0, 10.0, 10.0]);
    // Switched off, the axes read as the joints stand, less the tool of G43.
    assert_near(last("G0 Y-10 Z60 A90\nG43.4 H1\nG49\nG0 X5\n"), [5.0, -10.0, 60.0]);
    assert_near(last("G0 Y-10 Z60 A90\nG43.4 H1\nG43 H1\nG0 X5\n"), [5.0, -10.0, 10.0]);
    // A longer tool at the same joints: its tip is 30 lower, at Z-20, which is -Y on the work.
    assert_near(last("G0 Y-10 Z60 A90\nG43.4 H1\nG43.4 H2\nG0 X5\n"), [5.0, -20.0, 10.0]);
    // At zero angles it is G43.
    assert_near(last("G0 Y-10 Z60\nG43.4 H1\nG0 X5\n"), [5.0, -10.0, 10.0]);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let plain = Interpreter::new(Settings::default())
        .run(b"G43.4\n")
        .find_map(Result::err)
        .unwrap();
    assert!(
        plain
            .to_string()
            .contains("G43.4 needs a machine with tool-centre-point control"),
        "{plain}"
    );
    assert!(error("G43.4 H3\n").contains("its offset in X is 4"));
    for line in ["G53 G0 Z0", "G28", "G30.1"] {
        let got = error(&format!("G43.4 H1\n{line}\n"));
        assert!(got.contains("write G49 before it"), "{line}: {got}");
    }
}
