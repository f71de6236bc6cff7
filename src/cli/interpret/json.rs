//! Canonical calls as JSON, one object a line.
//!
//! In:  events of a program from its first one on, in order.
//! Out: `{"line": 3, "span": [20, 31], "file": "part.ngc", "call": "dwell", "seconds": 0.5}`.
//!
//! `docs/canonical-calls.md` has the table of all calls and their fields. Units are in the names: mm, degrees, seconds,
//! whatever the program speaks; a position is nine numbers, X Y Z (mm) A B C (degrees) U V W (mm).

use motion::canon::{
    Call, Event, FeedMode, Input, LengthUnit, OrientDirection, PathMode, Plane, Record, SPINDLES, Side,
    SpindleDirection, SpindleMode, WaitMode,
};
use serde_json::{Value as Json, json};

/// A call a line: its name in JSON, and the values of its fields.
macro_rules! table {
    ($call:expr; $($pattern:pat $(if $guard:expr)? => $name:ident { $($field:ident: $value:expr),* };)*) => {
        match $call {
            $($pattern $(if $guard)? => (stringify!($name), json!({ $(stringify!($field): $value),* })),)*
        }
    };
}

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
        self.follow(&event.call);
        let (name, fields) = self.call(&event.call);
        object["call"] = name.into();
        if let (Json::Object(object), Json::Object(mut fields)) = (&mut object, fields) {
            object.append(&mut fields);
        }
        object
    }

    /// Keeps what a call says about the units of later ones.
    fn follow(&mut self, call: &Call) {
        match call {
            Call::SetFeedMode(mode) => self.per_turn = matches!(mode, FeedMode::PerTurn { .. }),
            Call::SetSpindleMode { spindle, mode } => {
                if let Some(known) = self.surface_speed.get_mut(usize::from(*spindle)) {
                    *known = matches!(mode, SpindleMode::ConstantSurfaceSpeed { .. });
                }
            }
            _ => {}
        }
    }

    fn is_surface_speed(&self, spindle: u8) -> bool {
        self.surface_speed.get(usize::from(spindle)) == Some(&true)
    }

    /// Name and fields of a call.
    fn call(&self, call: &Call) -> (&'static str, Json) {
        let per = if self.per_turn { "turn" } else { "second" };
        table! { call;
            Call::StraightTraverse { to } => straight_traverse { to: to.0 };
            Call::StraightFeed { to } => straight_feed { to: to.0 };
            Call::ArcFeed { to, plane, centre_mm, turns } =>
                arc_feed { to: to.0, plane: plane_name(*plane), centre_mm: centre_mm, turns: turns };
            Call::Dwell { seconds } => dwell { seconds: seconds };
            Call::StraightProbe { to, mode } =>
                straight_probe { to: to.0, towards: mode.towards, must_trip: mode.must_trip };
            Call::RigidTap { to, return_scale } => rigid_tap { to: to.0, return_scale: return_scale };
            Call::NurbsFeed { plane, points, order, knots } => nurbs_feed {
                plane: plane_name(*plane), points_mm: points.iter().map(|(point, _)| point).collect::<Vec<_>>(),
                weights: points.iter().map(|(_, weight)| weight).collect::<Vec<_>>(), order: order, knots: knots
            };
            Call::StartSpindleSync { spindle, mm_per_turn, velocity } =>
                start_spindle_sync { spindle: spindle, mm_per_turn: mm_per_turn, velocity: velocity };
            Call::StopSpindleSync => stop_spindle_sync {};
            Call::SetFeedMode(FeedMode::PerTime) => set_feed_mode { per: per };
            Call::SetFeedMode(FeedMode::PerTurn { spindle }) => set_feed_mode { per: per, spindle: spindle };
            Call::SetFeedRate { linear, angular } =>
                set_feed_rate { linear_mm: linear, angular_degrees: angular, per: per };
            Call::SetPathMode(PathMode::ExactPath) => set_path_mode { mode: "exact_path" };
            Call::SetPathMode(PathMode::ExactStop) => set_path_mode { mode: "exact_stop" };
            Call::SetPathMode(PathMode::Continuous { tolerance_mm, naive_cam_tolerance_mm }) => set_path_mode {
                mode: "continuous", tolerance_mm: tolerance_mm, naive_cam_tolerance_mm: naive_cam_tolerance_mm
            };
            Call::SetPlanner { corner_share } => set_planner { corner_share: corner_share };
            Call::SelectPlane(plane) => select_plane { plane: plane_name(*plane) };
            Call::UseLengthUnit(LengthUnit::Millimetre) => use_length_unit { unit: "mm" };
            Call::UseLengthUnit(LengthUnit::Inch) => use_length_unit { unit: "inch" };
            Call::SetG5xOffset { system, origin } => set_g5x_offset { system: system, origin: origin.0 };
            Call::SetG92Offset { offset } => set_g92_offset { offset: offset.0 };
            Call::SetXyRotation { degrees } => set_xy_rotation { degrees: degrees };
            Call::SetToolLengthOffset { offset } => set_tool_length_offset { offset: offset.0 };
            Call::SetToolCentrePoint(on) => set_tool_centre_point { on: on };
            Call::SetCutterCompensation(None) => set_cutter_compensation { side: "off" };
            Call::SetCutterCompensation(Some(cutter)) => set_cutter_compensation {
                side: side_name(cutter.side), radius_mm: cutter.radius_mm, orientation: cutter.orientation
            };
            Call::SetSpindleMode { spindle, mode: SpindleMode::Rpm } =>
                set_spindle_mode { spindle: spindle, mode: "rpm" };
            Call::SetSpindleMode { spindle, mode: SpindleMode::ConstantSurfaceSpeed { max_rpm } } =>
                set_spindle_mode { spindle: spindle, mode: "constant_surface_speed", max_rpm: max_rpm };
            Call::SetSpindleSpeed { spindle, speed } if self.is_surface_speed(*spindle) =>
                set_spindle_speed { spindle: spindle, surface_m_per_minute: speed };
            Call::SetSpindleSpeed { spindle, speed } => set_spindle_speed { spindle: spindle, rpm: speed };
            Call::StartSpindle { spindle, direction, wait_for_speed } => start_spindle {
                spindle: spindle, direction: direction_name(*direction), wait_for_speed: wait_for_speed
            };
            Call::StopSpindle { spindle } => stop_spindle { spindle: spindle };
            Call::OrientSpindle { spindle, degrees, direction } =>
                orient_spindle { spindle: spindle, degrees: degrees, direction: orient_direction_name(*direction) };
            Call::WaitSpindleOriented { spindle, timeout_s } =>
                wait_spindle_oriented { spindle: spindle, timeout_s: timeout_s };
            Call::Mist(on) => mist { on: on };
            Call::Flood(on) => flood { on: on };
            Call::SelectTool { tool } => select_tool { tool: tool };
            Call::StartChange => start_change {};
            Call::ChangeTool { tool, pocket } => change_tool { tool: tool, pocket: pocket };
            Call::SetToolNumber { tool, pocket } => set_tool_number { tool: tool, pocket: pocket };
            Call::SetToolEntry(entry) => set_tool_entry {
                tool: entry.tool, pocket: entry.pocket, offset: entry.offset.0, diameter_mm: entry.diameter_mm,
                front_angle_degrees: entry.front_angle_degrees, back_angle_degrees: entry.back_angle_degrees,
                orientation: entry.orientation
            };
            Call::ReloadToolTable => reload_tool_table {};
            Call::EnableFeedOverride(on) => enable_feed_override { on: on };
            Call::EnableSpeedOverride { spindle, on } => enable_speed_override { spindle: spindle, on: on };
            Call::EnableAdaptiveFeed(on) => enable_adaptive_feed { on: on };
            Call::EnableFeedHold(on) => enable_feed_hold { on: on };
            Call::SetDigitalOutput { index, on, with_motion } =>
                set_digital_output { index: index, on: on, with_motion: with_motion };
            Call::SetAnalogOutput { index, value, with_motion } =>
                set_analog_output { index: index, value: value, with_motion: with_motion };
            Call::WaitInput { input: Input::Digital(index), mode, timeout_s } =>
                wait_input { input: "digital", index: index, mode: wait_mode(*mode), timeout_s: timeout_s };
            Call::WaitInput { input: Input::Analog(index), mode, timeout_s } =>
                wait_input { input: "analog", index: index, mode: wait_mode(*mode), timeout_s: timeout_s };
            Call::UserCode { number, p, q } => user_code { number: number, p: p, q: q };
            Call::Probe(on) => probe { on: on };
            Call::Message(text) => message { text: text };
            Call::Comment(text) => comment { text: text };
            Call::Record(Record::Print(text)) => print { text: text };
            Call::Record(Record::OpenLog(path)) => open_log { path: path };
            Call::Record(Record::AppendLog(path)) => append_log { path: path };
            Call::Record(Record::Log(text)) => log { text: text };
            Call::Record(Record::CloseLog) => close_log {};
            Call::Record(Record::OpenProbeLog(path)) => open_probe_log { path: path };
            Call::Record(Record::CloseProbeLog) => close_probe_log {};
            Call::ProgramStop => program_stop {};
            Call::OptionalProgramStop => optional_program_stop {};
            Call::PalletShuttle => pallet_shuttle {};
            Call::ProgramEnd => program_end {};
            Call::Reset => reset {};
            Call::Finish => finish {};
        }
    }
}

fn side_name(side: Side) -> &'static str {
    match side {
        Side::Left => "left",
        Side::Right => "right",
    }
}

fn direction_name(direction: SpindleDirection) -> &'static str {
    match direction {
        SpindleDirection::Clockwise => "clockwise",
        SpindleDirection::Counterclockwise => "counterclockwise",
    }
}

fn orient_direction_name(direction: OrientDirection) -> &'static str {
    match direction {
        OrientDirection::Shortest => "shortest",
        OrientDirection::Clockwise => "clockwise",
        OrientDirection::Counterclockwise => "counterclockwise",
    }
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
