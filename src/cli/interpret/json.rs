//! Canonical calls as JSON, one object a line.
//!
//! In:  events of a program from its first one on, in order.
//! Out: `{"line": 3, "span": [20, 31], "file": "part.ngc", "call": "dwell", "seconds": 0.5}`.
//!
//! `docs/canonical-calls.md` has the table of all calls and their fields. Units are in the names: mm, degrees, seconds,
//! whatever the program speaks; a position is nine numbers, X Y Z (mm) A B C (degrees) U V W (mm).

use motion::canon::{
    Call, Cutter, Event, FeedMode, Input, LengthUnit, OrientDirection, PathMode, Plane, Record, SPINDLES, Side,
    SpindleDirection, SpindleMode, WaitMode,
};
use serde_json::{Value as Json, json};

/// Makes objects of events; knows what earlier calls say about the units of later ones.
#[derive(Clone, Debug, Default)]
pub(super) struct JsonPrinter {
    /// Whether feeds count way per turn.
    per_turn: bool,
    /// Spindles whose speed is that of the surface.
    surface_speed: [bool; SPINDLES],
}

impl JsonPrinter {
    /// The object of an event from the file called `file`.
    pub(super) fn object(&mut self, event: &Event, file: &str) -> Json {
        let source = &event.source;
        let mut object = json!({ "line": source.line, "span": [source.start, source.end], "file": file });
        if let Some(n) = source.n {
            object["n"] = n.into();
        }
        let (name, fields) = self.call(&event.call);
        object["call"] = name.into();
        if let (Json::Object(object), Json::Object(mut fields)) = (&mut object, fields) {
            object.append(&mut fields);
        }
        object
    }

    /// Name and fields of a call.
    fn call(&mut self, call: &Call) -> (&'static str, Json) {
        match call {
            Call::StraightTraverse { to } => ("straight_traverse", json!({ "to": to.0 })),
            Call::StraightFeed { to } => ("straight_feed", json!({ "to": to.0 })),
            Call::ArcFeed {
                to,
                plane,
                centre_mm,
                turns,
            } => (
                "arc_feed",
                json!({ "to": to.0, "plane": plane_name(*plane), "centre_mm": centre_mm, "turns": turns }),
            ),
            Call::Dwell { seconds } => ("dwell", json!({ "seconds": seconds })),
            Call::StraightProbe { to, mode } => (
                "straight_probe",
                json!({ "to": to.0, "towards": mode.towards, "must_trip": mode.must_trip }),
            ),
            Call::RigidTap { to, return_scale } => ("rigid_tap", json!({ "to": to.0, "return_scale": return_scale })),
            Call::NurbsFeed {
                plane,
                points,
                order,
                knots,
            } => {
                let (points, weights): (Vec<_>, Vec<_>) = points.iter().copied().unzip();
                let plane = plane_name(*plane);
                (
                    "nurbs_feed",
                    json!({ "plane": plane, "points_mm": points, "weights": weights, "order": order, "knots": knots }),
                )
            }
            Call::StartSpindleSync {
                spindle,
                mm_per_turn,
                velocity,
            } => (
                "start_spindle_sync",
                json!({ "spindle": spindle, "mm_per_turn": mm_per_turn, "velocity": velocity }),
            ),
            Call::StopSpindleSync => ("stop_spindle_sync", json!({})),
            Call::SetFeedMode(mode) => {
                self.per_turn = matches!(mode, FeedMode::PerTurn { .. });
                let fields = match mode {
                    FeedMode::PerTime => json!({ "per": "second" }),
                    FeedMode::PerTurn { spindle } => json!({ "per": "turn", "spindle": spindle }),
                };
                ("set_feed_mode", fields)
            }
            Call::SetFeedRate { linear, angular } => {
                let per = if self.per_turn { "turn" } else { "second" };
                (
                    "set_feed_rate",
                    json!({ "linear_mm": linear, "angular_degrees": angular, "per": per }),
                )
            }
            Call::SetPathMode(mode) => ("set_path_mode", path_mode(*mode)),
            Call::SelectPlane(plane) => ("select_plane", json!({ "plane": plane_name(*plane) })),
            Call::UseLengthUnit(LengthUnit::Millimetre) => ("use_length_unit", json!({ "unit": "mm" })),
            Call::UseLengthUnit(LengthUnit::Inch) => ("use_length_unit", json!({ "unit": "inch" })),
            Call::SetG5xOffset { system, origin } => {
                ("set_g5x_offset", json!({ "system": system, "origin": origin.0 }))
            }
            Call::SetG92Offset { offset } => ("set_g92_offset", json!({ "offset": offset.0 })),
            Call::SetXyRotation { degrees } => ("set_xy_rotation", json!({ "degrees": degrees })),
            Call::SetToolLengthOffset { offset } => ("set_tool_length_offset", json!({ "offset": offset.0 })),
            Call::SetToolCentrePoint(on) => ("set_tool_centre_point", json!({ "on": on })),
            Call::SetCutterCompensation(cutter) => ("set_cutter_compensation", compensation(*cutter)),
            Call::SetSpindleMode { spindle, mode } => ("set_spindle_mode", self.spindle_mode(*spindle, *mode)),
            Call::SetSpindleSpeed { spindle, speed } => ("set_spindle_speed", self.spindle_speed(*spindle, *speed)),
            Call::StartSpindle {
                spindle,
                direction,
                wait_for_speed,
            } => {
                let direction = match direction {
                    SpindleDirection::Clockwise => "clockwise",
                    SpindleDirection::Counterclockwise => "counterclockwise",
                };
                (
                    "start_spindle",
                    json!({ "spindle": spindle, "direction": direction, "wait_for_speed": wait_for_speed }),
                )
            }
            Call::StopSpindle { spindle } => ("stop_spindle", json!({ "spindle": spindle })),
            Call::OrientSpindle {
                spindle,
                degrees,
                direction,
            } => {
                let direction = match direction {
                    OrientDirection::Shortest => "shortest",
                    OrientDirection::Clockwise => "clockwise",
                    OrientDirection::Counterclockwise => "counterclockwise",
                };
                (
                    "orient_spindle",
                    json!({ "spindle": spindle, "degrees": degrees, "direction": direction }),
                )
            }
            Call::WaitSpindleOriented { spindle, timeout_s } => (
                "wait_spindle_oriented",
                json!({ "spindle": spindle, "timeout_s": timeout_s }),
            ),
            Call::Mist(on) => ("mist", json!({ "on": on })),
            Call::Flood(on) => ("flood", json!({ "on": on })),
            Call::SelectTool { tool } => ("select_tool", json!({ "tool": tool })),
            Call::StartChange => ("start_change", json!({})),
            Call::ChangeTool { tool, pocket } => ("change_tool", json!({ "tool": tool, "pocket": pocket })),
            Call::SetToolNumber { tool, pocket } => ("set_tool_number", json!({ "tool": tool, "pocket": pocket })),
            Call::SetToolEntry(entry) => (
                "set_tool_entry",
                json!({
                    "tool": entry.tool, "pocket": entry.pocket, "offset": entry.offset.0,
                    "diameter_mm": entry.diameter_mm, "front_angle_degrees": entry.front_angle_degrees,
                    "back_angle_degrees": entry.back_angle_degrees, "orientation": entry.orientation,
                }),
            ),
            Call::SetPlanner { corner_share } => ("set_planner", json!({ "corner_share": corner_share })),
            Call::ReloadToolTable => ("reload_tool_table", json!({})),
            Call::EnableFeedOverride(on) => ("enable_feed_override", json!({ "on": on })),
            Call::EnableSpeedOverride { spindle, on } => {
                ("enable_speed_override", json!({ "spindle": spindle, "on": on }))
            }
            Call::EnableAdaptiveFeed(on) => ("enable_adaptive_feed", json!({ "on": on })),
            Call::EnableFeedHold(on) => ("enable_feed_hold", json!({ "on": on })),
            Call::SetDigitalOutput { index, on, with_motion } => (
                "set_digital_output",
                json!({ "index": index, "on": on, "with_motion": with_motion }),
            ),
            Call::SetAnalogOutput {
                index,
                value,
                with_motion,
            } => (
                "set_analog_output",
                json!({ "index": index, "value": value, "with_motion": with_motion }),
            ),
            Call::WaitInput { input, mode, timeout_s } => {
                let (input, index) = match input {
                    Input::Digital(index) => ("digital", index),
                    Input::Analog(index) => ("analog", index),
                };
                let mode = wait_mode(*mode);
                (
                    "wait_input",
                    json!({ "input": input, "index": index, "mode": mode, "timeout_s": timeout_s }),
                )
            }
            Call::UserCode { number, p, q } => ("user_code", json!({ "number": number, "p": p, "q": q })),
            Call::Probe(on) => ("probe", json!({ "on": on })),
            Call::Message(text) => ("message", json!({ "text": text })),
            Call::Comment(text) => ("comment", json!({ "text": text })),
            Call::Record(record) => record_fields(record),
            Call::ProgramStop => ("program_stop", json!({})),
            Call::OptionalProgramStop => ("optional_program_stop", json!({})),
            Call::PalletShuttle => ("pallet_shuttle", json!({})),
            Call::ProgramEnd => ("program_end", json!({})),
            Call::Reset => ("reset", json!({})),
            Call::Finish => ("finish", json!({})),
        }
    }

    fn spindle_mode(&mut self, spindle: u8, mode: SpindleMode) -> Json {
        if let Some(known) = self.surface_speed.get_mut(usize::from(spindle)) {
            *known = matches!(mode, SpindleMode::ConstantSurfaceSpeed { .. });
        }
        match mode {
            SpindleMode::Rpm => json!({ "spindle": spindle, "mode": "rpm" }),
            SpindleMode::ConstantSurfaceSpeed { max_rpm } => {
                json!({ "spindle": spindle, "mode": "constant_surface_speed", "max_rpm": max_rpm })
            }
        }
    }

    fn spindle_speed(&self, spindle: u8, speed: f64) -> Json {
        if self.surface_speed.get(usize::from(spindle)) == Some(&true) {
            json!({ "spindle": spindle, "surface_m_per_minute": speed })
        } else {
            json!({ "spindle": spindle, "rpm": speed })
        }
    }
}

fn path_mode(mode: PathMode) -> Json {
    match mode {
        PathMode::ExactPath => json!({ "mode": "exact_path" }),
        PathMode::ExactStop => json!({ "mode": "exact_stop" }),
        PathMode::Continuous {
            tolerance_mm,
            naive_cam_tolerance_mm,
        } => json!({
            "mode": "continuous", "tolerance_mm": tolerance_mm, "naive_cam_tolerance_mm": naive_cam_tolerance_mm,
        }),
    }
}

fn compensation(cutter: Option<Cutter>) -> Json {
    let Some(cutter) = cutter else {
        return json!({ "side": "off" });
    };
    let side = match cutter.side {
        Side::Left => "left",
        Side::Right => "right",
    };
    json!({ "side": side, "radius_mm": cutter.radius_mm, "orientation": cutter.orientation })
}

fn wait_mode(mode: WaitMode) -> &'static str {
    match mode {
        WaitMode::Immediate => "immediate",
        WaitMode::Rise => "rise",
        WaitMode::Fall => "fall",
        WaitMode::High => "high",
        WaitMode::Low => "low",
    }
}

fn record_fields(record: &Record) -> (&'static str, Json) {
    match record {
        Record::Print(text) => ("print", json!({ "text": text })),
        Record::OpenLog(path) => ("open_log", json!({ "path": path })),
        Record::AppendLog(path) => ("append_log", json!({ "path": path })),
        Record::Log(text) => ("log", json!({ "text": text })),
        Record::CloseLog => ("close_log", json!({})),
        Record::OpenProbeLog(path) => ("open_probe_log", json!({ "path": path })),
        Record::CloseProbeLog => ("close_probe_log", json!({})),
    }
}

fn plane_name(plane: Plane) -> &'static str {
    match plane {
        Plane::Xy => "xy",
        Plane::Zx => "zx",
        Plane::Yz => "yz",
        Plane::Uv => "uv",
        Plane::Wu => "wu",
        Plane::Vw => "vw",
    }
}
