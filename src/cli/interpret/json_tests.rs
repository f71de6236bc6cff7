//! Every call has its object, and the table in `docs/canonical-calls.md` has its line.

use super::json::JsonPrinter;
use motion::canon::{
    Axis, Call, Cutter, Event, FeedMode, Input, LengthUnit, OrientDirection, PathMode, Plane, Position, ProbeMode,
    Record, Side, Source, SpindleDirection, SpindleMode, ToolEntry, WaitMode,
};
use serde_json::{Value as Json, json};

const TO: Position = Position([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);

/// One call of every kind and every field, with its name.
#[rustfmt::skip]
fn samples() -> Vec<(&'static str, Call)> {
    let records = [
        ("print", Record::Print("t".into())),
        ("open_log", Record::OpenLog("f".into())),
        ("append_log", Record::AppendLog("f".into())),
        ("log", Record::Log("t".into())),
        ("close_log", Record::CloseLog),
        ("open_probe_log", Record::OpenProbeLog("f".into())),
        ("close_probe_log", Record::CloseProbeLog),
    ];
    let cutter = Cutter { side: Side::Left, radius_mm: 2.0, orientation: 0 };
    let points = vec![([1.0, 2.0], 3.0), ([4.0, 5.0], 6.0)];
    let css = SpindleMode::ConstantSurfaceSpeed { max_rpm: None };
    let continuous = PathMode::Continuous { tolerance_mm: Some(0.1), naive_cam_tolerance_mm: None };
    let (tool, pocket, offset, orientation) = (1, 2, TO, 6);
    let (diameter_mm, front_angle_degrees, back_angle_degrees) = (3.0, 4.0, 5.0);
    let entry = ToolEntry { tool, pocket, offset, diameter_mm, front_angle_degrees, back_angle_degrees, orientation };
    let mode = ProbeMode { towards: true, must_trip: false };
    let (spindle, index, direction) = (1, 2, SpindleDirection::Counterclockwise);
    let speed = Call::SetSpindleSpeed { spindle, speed: 9.0 };
    let rate = Call::SetFeedRate { linear: 1.5, angular: 2.5 };
    let mut samples = vec![
        ("straight_traverse", Call::StraightTraverse { to: TO }),
        ("straight_feed", Call::StraightFeed { to: TO }),
        ("arc_feed", Call::ArcFeed { to: TO, plane: Plane::Zx, centre_mm: [1.0, 2.0], turns: -2 }),
        ("dwell", Call::Dwell { seconds: 0.5 }),
        ("straight_probe", Call::StraightProbe { to: TO, mode }),
        ("rigid_tap", Call::RigidTap { to: TO, return_scale: 2.0 }),
        ("nurbs_feed", Call::NurbsFeed { plane: Plane::Xy, points, order: 3, knots: vec![0.0, 0.5, 1.0] }),
        ("start_spindle_sync", Call::StartSpindleSync { spindle, mm_per_turn: 1.25, velocity: false }),
        ("stop_spindle_sync", Call::StopSpindleSync),
        ("set_feed_mode", Call::SetFeedMode(FeedMode::PerTime)),
        ("set_feed_rate", rate.clone()),
        ("set_feed_mode", Call::SetFeedMode(FeedMode::PerTurn { spindle })),
        ("set_feed_rate", rate),
        ("set_path_mode", Call::SetPathMode(PathMode::ExactPath)),
        ("set_path_mode", Call::SetPathMode(continuous)),
        ("select_plane", Call::SelectPlane(Plane::Vw)),
        ("use_length_unit", Call::UseLengthUnit(LengthUnit::Inch)),
        ("set_g5x_offset", Call::SetG5xOffset { system: 2, origin: TO }),
        ("set_g92_offset", Call::SetG92Offset { offset: TO }),
        ("set_xy_rotation", Call::SetXyRotation { degrees: 30.0 }),
        ("set_tool_length_offset", Call::SetToolLengthOffset { offset: TO }),
        ("set_tool_centre_point", Call::SetToolCentrePoint(true)),
        ("set_cutter_compensation", Call::SetCutterCompensation(Some(cutter))),
        ("set_cutter_compensation", Call::SetCutterCompensation(None)),
        ("set_spindle_mode", Call::SetSpindleMode { spindle, mode: css }),
        ("set_spindle_speed", speed.clone()),
        ("set_spindle_mode", Call::SetSpindleMode { spindle, mode: SpindleMode::Rpm }),
        ("set_spindle_speed", speed),
        ("start_spindle", Call::StartSpindle { spindle, direction, wait_for_speed: true }),
        ("stop_spindle", Call::StopSpindle { spindle }),
        ("orient_spindle", Call::OrientSpindle { spindle, degrees: 30.0, direction: OrientDirection::Shortest }),
        ("wait_spindle_oriented", Call::WaitSpindleOriented { spindle, timeout_s: 5.0 }),
        ("mist", Call::Mist(true)),
        ("flood", Call::Flood(false)),
        ("select_tool", Call::SelectTool { tool: 3 }),
        ("start_change", Call::StartChange),
        ("change_tool", Call::ChangeTool { tool: 3, pocket: 4 }),
        ("set_tool_number", Call::SetToolNumber { tool: 3, pocket: 4 }),
        ("set_tool_entry", Call::SetToolEntry(entry)),
        ("reload_tool_table", Call::ReloadToolTable),
        ("set_planner", Call::SetPlanner { corner_share: Some(0.5) }),
        ("enable_feed_override", Call::EnableFeedOverride(true)),
        ("enable_speed_override", Call::EnableSpeedOverride { spindle, on: false }),
        ("enable_adaptive_feed", Call::EnableAdaptiveFeed(true)),
        ("enable_feed_hold", Call::EnableFeedHold(true)),
        ("set_digital_output", Call::SetDigitalOutput { index, on: true, with_motion: false }),
        ("set_analog_output", Call::SetAnalogOutput { index, value: 2.5, with_motion: true }),
        ("wait_input", Call::WaitInput { input: Input::Analog(index), mode: WaitMode::Immediate, timeout_s: 1.0 }),
        ("user_code", Call::UserCode { number: 100, p: 1.0, q: -1.0 }),
        ("probe", Call::Probe(true)),
        ("message", Call::Message("t".into())),
        ("comment", Call::Comment("t".into())),
        ("program_stop", Call::ProgramStop),
        ("optional_program_stop", Call::OptionalProgramStop),
        ("pallet_shuttle", Call::PalletShuttle),
        ("program_end", Call::ProgramEnd),
        ("reset", Call::Reset),
        ("finish", Call::Finish),
    ];
    samples.extend(records.map(|(name, record)| (name, Call::Record(record))));
    samples
}

/// The objects of the samples, without the fields that tell the place.
fn objects() -> Vec<(&'static str, Json)> {
    let mut printer = JsonPrinter::default();
    let object = |(name, call)| {
        let source = Source {
            line: 3,
            start: 20,
            end: 31,
            ..Source::default()
        };
        let mut object = printer.object(&Event { source, call }, "part.ngc");
        let fields = object.as_object_mut().unwrap();
        assert_eq!(fields.remove("line"), Some(3.into()));
        assert_eq!(fields.remove("span"), Some(json!([20, 31])));
        assert_eq!(fields.remove("file"), Some("part.ngc".into()));
        assert_eq!(fields.get("n"), None);
        (name, object)
    };
    samples().into_iter().map(object).collect()
}

#[test]
fn calls_are_named_and_documented_with_all_their_fields() {
    let docs = include_str!("../../../docs/canonical-calls.md");
    let (_, table) = docs.split_once("## Calls\n").unwrap();
    let mut documented: Vec<&str> = table
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split('`').next())
        .collect();
    documented.retain(|name| *name != "call");
    for (name, object) in objects() {
        assert_eq!(object["call"], name);
        let row = format!("| `{name}` |");
        let row = docs
            .lines()
            .find(|line| line.starts_with(&row))
            .unwrap_or_else(|| panic!("{name} has no line"));
        let fields = row.split(" | ").nth(1).unwrap();
        for field in object.as_object().unwrap().keys().filter(|field| *field != "call") {
            assert!(
                fields.contains(&format!("`{field}`")),
                "{name}: {field} is not in {row}"
            );
        }
        documented.retain(|known| *known != name);
    }
    assert_eq!(documented, [] as [&str; 0], "documented, but no call");
}

#[test]
fn fields_hold_what_the_call_says() {
    let expected = [
        json!({ "call": "arc_feed", "to": TO.0, "plane": "zx", "centre_mm": [1.0, 2.0], "turns": -2 }),
        json!({ "call": "straight_probe", "to": TO.0, "towards": true, "must_trip": false }),
        json!({
            "call": "nurbs_feed", "plane": "xy", "points_mm": [[1.0, 2.0], [4.0, 5.0]], "weights": [3.0, 6.0],
            "order": 3, "knots": [0.0, 0.5, 1.0],
        }),
        json!({ "call": "set_feed_rate", "linear_mm": 1.5, "angular_degrees": 2.5, "per": "second" }),
        json!({ "call": "set_feed_mode", "per": "turn", "spindle": 1 }),
        json!({ "call": "set_feed_rate", "linear_mm": 1.5, "angular_degrees": 2.5, "per": "turn" }),
        json!({
            "call": "set_path_mode", "mode": "continuous", "tolerance_mm": 0.1, "naive_cam_tolerance_mm": null,
        }),
        json!({ "call": "set_cutter_compensation", "side": "left", "radius_mm": 2.0, "orientation": 0 }),
        json!({ "call": "set_cutter_compensation", "side": "off" }),
        json!({
            "call": "set_spindle_mode", "spindle": 1, "mode": "constant_surface_speed", "max_rpm": null,
        }),
        json!({ "call": "set_spindle_speed", "spindle": 1, "surface_m_per_minute": 9.0 }),
        json!({ "call": "set_spindle_speed", "spindle": 1, "rpm": 9.0 }),
        json!({
            "call": "start_spindle", "spindle": 1, "direction": "counterclockwise", "wait_for_speed": true,
        }),
        json!({ "call": "wait_input", "input": "analog", "index": 2, "mode": "immediate", "timeout_s": 1.0 }),
        json!({ "call": "open_log", "path": "f" }),
    ];
    let objects = objects();
    for expected in expected {
        assert!(objects.iter().any(|(_, object)| *object == expected), "{expected}");
    }
}

#[test]
fn the_number_of_a_line_is_told_where_there_is_one() {
    let source = Source {
        n: Some(10),
        ..Source::default()
    };
    let call = Call::ProgramStop;
    let object = JsonPrinter::default().object(&Event { source, call }, "part.ngc");
    assert_eq!(object["n"], 10);
}

#[test]
fn a_position_is_in_the_order_of_the_axes() {
    let letters: String = Axis::ALL.iter().map(|axis| axis.letter()).collect();
    assert_eq!(letters, "XYZABCUVW"); // as docs/canonical-calls.md says
}
