//! Canonical calls as text, in the printed form of LinuxCNC's stand-alone interpreter (`rs274 -g`).
//!
//! In:  events of a program from its first one on, in order.
//! Out: one line per call: a count, the N-word of the line, the call.
//!
//! ```text
//!     7 N10    STRAIGHT_TRAVERSE(1.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
//!     8 N..... SET_FEED_RATE(100.0000)
//! ```
//!
//! The form is that of the newest LinuxCNC known to us (the development line of 2.10), with one exception: a zero has no
//! sign. Lengths are in the units of the program at that point. The form has no place for U, V and W, for weights and
//! points of splines and for what M66 waits for; who needs all takes the events themselves.

mod decimal;
#[cfg(test)]
mod tests;

use decimal::{push_fixed4, push_integer};
use motion::canon::{
    Axis, Call, Cutter, Event, FeedMode, LengthUnit, OrientDirection, PathMode, Plane, Position, Record, SPINDLES,
    Side, Source, SpindleDirection, SpindleMode, ToolEntry,
};
use std::fmt;
use std::io::{self, Write};

/// What LinuxCNC prints where constant surface speed has no upper bound.
const UNBOUNDED_RPM: f64 = 1e30;
/// Surface speed counts metres or, in inch programs, feet.
const METRES_PER_FOOT: f64 = 0.3048;

/// Writes canonical calls, one a line; made for one run of a program.
#[derive(Clone, Debug)]
pub struct CanonPrinter {
    /// Lines written.
    count: u64,
    /// Unit of the program at this call.
    unit: LengthUnit,
    machine_unit: LengthUnit,
    /// Whether feeds count way per turn.
    per_turn: bool,
    /// Spindles whose speed is that of the surface.
    surface_speed: [bool; SPINDLES],
    /// Tolerance for joining moves that was told last, mm.
    naive_cam_mm: f64,
    /// The line that changed to the exact path last.
    exact_path: Option<(u16, u32)>,
    /// Whether the calls of the start are over.
    started: bool,
    /// Lines of the call under way; kept for its memory.
    text: Vec<u8>,
}

impl CanonPrinter {
    /// A printer before the first event. `machine_unit` is that of the tool table: changes of it are told in this unit.
    pub fn new(machine_unit: LengthUnit) -> CanonPrinter {
        CanonPrinter {
            count: 0,
            unit: LengthUnit::Millimetre,
            per_turn: false,
            surface_speed: [false; SPINDLES],
            naive_cam_mm: 0.0,
            exact_path: None,
            started: false,
            machine_unit,
            text: Vec::with_capacity(256),
        }
    }

    /// Writes the lines of an event: one for nearly every call, none for what `rs274` does not print.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(&mut self, event: &Event, out: &mut impl Write) -> io::Result<()> {
        self.text.clear();
        self.push_event(event);
        out.write_all(&self.text)
    }

    /// Writes the lines with which `rs274` ends after an error.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_end_after_error(&mut self, out: &mut impl Write) -> io::Result<()> {
        self.text.clear();
        for _ in 0..2 {
            self.name(&Source::default(), "ON_RESET()");
        }
        out.write_all(&self.text)
    }

    fn push_event(&mut self, event: &Event) {
        let source = &event.source;
        match &event.call {
            // At the start `rs274` does not tell these two.
            Call::SelectPlane(_) | Call::SetPathMode(_) if source.line == 0 && !self.started => {}
            Call::StraightTraverse { to } => self.push_move(source, "STRAIGHT_TRAVERSE(", to),
            Call::StraightFeed { to } => self.push_move(source, "STRAIGHT_FEED(", to),
            Call::StraightProbe { to, mode: _ } => self.push_move(source, "STRAIGHT_PROBE(", to),
            Call::ArcFeed {
                to,
                plane,
                centre_mm,
                turns,
            } => self.push_arc(source, to, *plane, *centre_mm, *turns),
            Call::RigidTap { to, return_scale: _ } => {
                let linear = [Axis::X, Axis::Y, Axis::Z].map(|axis| self.length(to[axis]));
                self.numbers(source, "RIGID_TAP(", &linear, ", ");
            }
            Call::NurbsFeed { knots, .. } if !knots.is_empty() => {
                self.line(source, format_args!("NURBS_G6_FEED({}, ...)", knots.len()));
            }
            Call::NurbsFeed { points, .. } => {
                self.line(source, format_args!("NURBS_G5_FEED({}, ...)", points.len()));
            }
            Call::Dwell { seconds } => self.numbers(source, "DWELL(", &[*seconds], ""),
            Call::StartSpindleSync {
                spindle: _,
                mm_per_turn,
                velocity,
            } => {
                let per_turn = self.length(*mm_per_turn);
                let velocity = u8::from(*velocity);
                self.line(source, format_args!("START_SPEED_FEED_SYNC({per_turn:.6},{velocity})"));
            }
            Call::StopSpindleSync => self.name(source, "STOP_SPEED_FEED_SYNCH()"),
            Call::SetFeedMode(mode) => self.push_feed_mode(source, *mode),
            Call::SetFeedRate { linear, angular: _ } => self.push_feed_rate(source, *linear),
            Call::SetPathMode(mode) => self.push_path_mode(source, *mode),
            Call::SetPlanner { corner_share } => self.push_planner(source, *corner_share),
            Call::SelectPlane(plane) => self.push_plane(source, *plane),
            Call::UseLengthUnit(unit) => self.push_unit(source, *unit),
            Call::SetG5xOffset { system, origin } => self.push_g5x(source, *system, origin),
            Call::SetG92Offset { offset } => self.push_move(source, "SET_G92_OFFSET(", offset),
            Call::SetXyRotation { degrees } => self.numbers(source, "SET_XY_ROTATION(", &[*degrees], ""),
            Call::SetToolLengthOffset { offset } => self.push_tool_offset(source, offset),
            // LinuxCNC's interpreter has nothing like it.
            Call::SetToolCentrePoint(true) => self.name(source, "COMMENT(\"tool-centre-point control on\")"),
            Call::SetToolCentrePoint(false) => self.name(source, "COMMENT(\"tool-centre-point control off\")"),
            Call::SetCutterCompensation(cutter) => self.push_compensation(source, *cutter),
            Call::SetSpindleMode { spindle, mode } => self.push_spindle_mode(source, *spindle, *mode),
            Call::SetSpindleSpeed { spindle, speed } => self.push_spindle_speed(source, *spindle, *speed),
            Call::StartSpindle { spindle, direction, .. } => self.push_spindle_start(source, *spindle, *direction),
            Call::StopSpindle { spindle } => self.line(source, format_args!("STOP_SPINDLE_TURNING({spindle})")),
            Call::OrientSpindle {
                spindle,
                degrees,
                direction,
            } => self.push_orient(source, *spindle, *degrees, *direction),
            Call::WaitSpindleOriented { spindle, timeout_s } => self.line(
                source,
                format_args!("SPINDLE.{spindle}.WAIT_ORIENT_COMPLETE({timeout_s:.4})"),
            ),
            Call::Mist(on) => self.switch(source, *on, ["MIST_ON()", "MIST_OFF()"]),
            Call::Flood(on) => self.switch(source, *on, ["FLOOD_ON()", "FLOOD_OFF()"]),
            Call::SelectTool { tool } => self.line(source, format_args!("SELECT_TOOL({tool})")),
            Call::ChangeTool { .. } => self.name(source, "CHANGE_TOOL()"),
            Call::SetToolNumber { tool, pocket: _ } => self.line(source, format_args!("CHANGE_TOOL_NUMBER({tool})")),
            Call::SetToolEntry(entry) => self.push_tool_entry(source, entry),
            Call::ReloadToolTable => self.name(source, "RELOAD_TOOLDATA()"),
            Call::EnableFeedOverride(on) => {
                self.switch(source, *on, ["ENABLE_FEED_OVERRIDE()", "DISABLE_FEED_OVERRIDE()"]);
            }
            Call::EnableSpeedOverride { spindle, on } => {
                let able = if *on { "ENABLE" } else { "DISABLE" };
                self.line(source, format_args!("{able}_SPEED_OVERRIDE({spindle})"));
            }
            Call::EnableAdaptiveFeed(on) => {
                self.switch(source, *on, ["ENABLE_ADAPTIVE_FEED()", "DISABLE_ADAPTIVE_FEED()"]);
            }
            Call::EnableFeedHold(on) => self.switch(source, *on, ["ENABLE_FEED_HOLD()", "DISABLE_FEED_HOLD()"]),
            Call::SetDigitalOutput { index, on, with_motion } => {
                let set = if *on { "SET" } else { "CLEAR" };
                let when = if *with_motion { "MOTION" } else { "AUX" };
                self.line(source, format_args!("{set}_{when}_OUTPUT_BIT({index})"));
            }
            Call::SetAnalogOutput {
                index,
                value,
                with_motion,
            } => {
                let when = if *with_motion { "MOTION" } else { "AUX" };
                self.line(source, format_args!("SET_{when}_OUTPUT_VALUE({index},{value:.6})"));
            }
            Call::UserCode { number, p, q } => {
                self.line(source, format_args!("USER_DEFINED_FUNCTION({number}, {p:.6}, {q:.6})"));
            }
            Call::Probe(on) => self.switch(source, *on, ["TURN_PROBE_ON()", "TURN_PROBE_OFF()"]),
            Call::Message(text) => self.quoted(source, "MESSAGE", text),
            Call::Comment(text) => self.quoted(source, "COMMENT", text),
            Call::Record(record) => self.push_record(source, record),
            // They print nothing.
            Call::WaitInput { .. } | Call::StartChange => {}
            Call::ProgramStop => self.name(source, "PROGRAM_STOP()"),
            Call::OptionalProgramStop => self.name(source, "OPTIONAL_PROGRAM_STOP()"),
            Call::PalletShuttle => self.name(source, "PALLET_SHUTTLE()"),
            Call::ProgramEnd => self.name(source, "PROGRAM_END()"),
            Call::Reset => self.push_reset(source),
            Call::Finish => self.name(source, "FINISH()"),
        }
    }

    fn push_move(&mut self, source: &Source, name: &str, to: &Position) {
        let numbers = self.six(to);
        self.numbers(source, name, &numbers, ", ");
    }

    fn push_arc(&mut self, source: &Source, to: &Position, plane: Plane, centre_mm: [f64; 2], turns: i32) {
        let [first, second, normal] = plane.axes().map(|axis| self.length(to[axis]));
        let [centre_first, centre_second] = centre_mm.map(|mm| self.length(mm));
        self.begin(source);
        self.text.extend_from_slice(b"ARC_FEED(");
        for number in [first, second, centre_first, centre_second] {
            push_fixed4(&mut self.text, number);
            self.text.extend_from_slice(b", ");
        }
        if turns < 0 {
            self.text.push(b'-');
        }
        push_integer(&mut self.text, turns.unsigned_abs().into(), 0, b' ');
        self.text.extend_from_slice(b", ");
        self.end_numbers(&[normal, to[Axis::A], to[Axis::B], to[Axis::C]], ", ");
    }

    fn push_feed_mode(&mut self, source: &Source, mode: FeedMode) {
        self.per_turn = mode != FeedMode::PerTime;
        match mode {
            FeedMode::PerTime => self.name(source, "SET_FEED_MODE(0, 0)"),
            FeedMode::PerTurn { spindle } => self.line(source, format_args!("SET_FEED_MODE({spindle}, 1)")),
        }
    }

    fn push_feed_rate(&mut self, source: &Source, linear: f64) {
        let per = if self.per_turn { 1.0 } else { 60.0 };
        let rate = tidy(linear * per / self.unit.mm());
        self.numbers(source, "SET_FEED_RATE(", &[rate], "");
    }

    fn push_path_mode(&mut self, source: &Source, mode: PathMode) {
        match mode {
            PathMode::ExactPath => {
                self.exact_path = Some((source.file, source.line));
                self.name(source, "SET_MOTION_CONTROL_MODE(CANON_EXACT_PATH)");
            }
            PathMode::ExactStop => {
                self.name(source, "SET_MOTION_CONTROL_MODE(CANON_EXACT_STOP)");
                // A canned cycle puts the mode back that it found, and with it a tolerance that means nothing here.
                if self.exact_path == Some((source.file, source.line)) {
                    let naive = self.length(self.naive_cam_mm);
                    self.numbers(source, "SET_NAIVECAM_TOLERANCE(", &[naive], "");
                }
            }
            PathMode::Continuous {
                tolerance_mm,
                naive_cam_tolerance_mm,
            } => {
                let tolerance = self.length(tolerance_mm.unwrap_or(0.0));
                self.naive_cam_mm = naive_cam_tolerance_mm.unwrap_or(0.0);
                let naive = self.length(self.naive_cam_mm);
                self.line(
                    source,
                    format_args!("SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, {tolerance:.6})"),
                );
                self.numbers(source, "SET_NAIVECAM_TOLERANCE(", &[naive], "");
            }
        }
    }

    fn push_planner(&mut self, source: &Source, corner_share: Option<f64>) {
        let (kind, share) = corner_share.map_or((0, -1.0), |share| (1, share));
        self.line(
            source,
            format_args!("SET_PLANNER_MODE(type={kind}, peak_scale={share:.6})"),
        );
    }

    fn push_plane(&mut self, source: &Source, plane: Plane) {
        let name = match plane {
            Plane::Xy => "XY",
            Plane::Zx => "XZ",
            Plane::Yz => "YZ",
            Plane::Uv | Plane::Wu | Plane::Vw => "UNKNOWN",
        };
        self.line(source, format_args!("SELECT_PLANE(CANON_PLANE_{name})"));
    }

    fn push_unit(&mut self, source: &Source, unit: LengthUnit) {
        self.unit = unit;
        let name = match unit {
            LengthUnit::Millimetre => "MM",
            LengthUnit::Inch => "INCHES",
        };
        self.line(source, format_args!("USE_LENGTH_UNITS(CANON_UNITS_{name})"));
    }

    fn push_g5x(&mut self, source: &Source, system: u8, origin: &Position) {
        self.begin(source);
        self.text.extend_from_slice(b"SET_G5X_OFFSET(");
        push_integer(&mut self.text, system.into(), 0, b' ');
        self.text.extend_from_slice(b", ");
        let origin = self.six(origin);
        self.end_numbers(&origin, ", ");
    }

    fn push_compensation(&mut self, source: &Source, cutter: Option<Cutter>) {
        let Some(cutter) = cutter else {
            return self.name(source, "STOP_CUTTER_RADIUS_COMPENSATION()");
        };
        let radius = self.length(cutter.radius_mm);
        self.numbers(source, "SET_CUTTER_RADIUS_COMPENSATION(", &[radius], "");
        let side = match cutter.side {
            Side::Left => "LEFT",
            Side::Right => "RIGHT",
        };
        self.line(source, format_args!("START_CUTTER_RADIUS_COMPENSATION({side})"));
    }

    fn push_tool_offset(&mut self, source: &Source, offset: &Position) {
        self.begin(source);
        self.text.extend_from_slice(b"USE_TOOL_LENGTH_OFFSET(");
        for (index, axis) in Axis::ALL.into_iter().enumerate() {
            let number = in_unit(offset, axis, self.unit);
            self.text.extend_from_slice(match index {
                0 => b"",
                3 | 6 => b", ",
                _ => b" ",
            });
            push_fixed4(&mut self.text, number);
        }
        self.text.extend_from_slice(b")\n");
    }

    fn push_tool_entry(&mut self, source: &Source, entry: &ToolEntry) {
        self.begin(source);
        self.text.extend_from_slice(b"SET_TOOL_TABLE_ENTRY(");
        push_integer(&mut self.text, entry.pocket.into(), 0, b' ');
        self.text.extend_from_slice(b", ");
        push_integer(&mut self.text, entry.tool.into(), 0, b' ');
        self.text.push(b',');
        for axis in Axis::ALL {
            let number = in_unit(&entry.offset, axis, self.machine_unit);
            self.text.push(b' ');
            push_fixed4(&mut self.text, number);
        }
        for angle in [entry.front_angle_degrees, entry.back_angle_degrees] {
            self.text.extend_from_slice(b", ");
            push_fixed4(&mut self.text, angle);
        }
        self.text.extend_from_slice(b", ");
        push_integer(&mut self.text, entry.orientation.into(), 0, b' ');
        self.text.extend_from_slice(b")\n");
    }

    fn push_spindle_mode(&mut self, source: &Source, spindle: u8, mode: SpindleMode) {
        let (bound_rpm, surface_speed) = match mode {
            SpindleMode::Rpm => (0.0, false),
            SpindleMode::ConstantSurfaceSpeed { max_rpm } => (max_rpm.unwrap_or(UNBOUNDED_RPM), true),
        };
        if let Some(known) = self.surface_speed.get_mut(usize::from(spindle)) {
            *known = surface_speed;
        }
        self.line(source, format_args!("SET_SPINDLE_MODE({spindle} {bound_rpm:.4})"));
    }

    fn push_spindle_speed(&mut self, source: &Source, spindle: u8, speed: f64) {
        let surface_speed = self.surface_speed.get(usize::from(spindle)) == Some(&true);
        let speed = match self.unit {
            LengthUnit::Inch if surface_speed => tidy(speed / METRES_PER_FOOT),
            LengthUnit::Inch | LengthUnit::Millimetre => speed,
        };
        self.line(source, format_args!("SET_SPINDLE_SPEED({spindle}, {speed:.4})"));
    }

    fn push_spindle_start(&mut self, source: &Source, spindle: u8, direction: SpindleDirection) {
        let direction = match direction {
            SpindleDirection::Clockwise => "CLOCKWISE",
            SpindleDirection::Counterclockwise => "COUNTERCLOCKWISE",
        };
        self.line(source, format_args!("START_SPINDLE_{direction}({spindle})"));
    }

    fn push_orient(&mut self, source: &Source, spindle: u8, degrees: f64, direction: OrientDirection) {
        let direction = match direction {
            OrientDirection::Shortest => 0,
            OrientDirection::Clockwise => 1,
            OrientDirection::Counterclockwise => 2,
        };
        self.line(
            source,
            format_args!("ORIENT_SPINDLE({spindle}, {degrees:.4}, {direction})"),
        );
    }

    fn push_record(&mut self, source: &Source, record: &Record) {
        match record {
            Record::OpenLog(file) => self.quoted(source, "LOGOPEN", file),
            Record::AppendLog(file) => self.quoted(source, "LOGAPPEND", file),
            Record::Log(text) => self.quoted(source, "LOG", text),
            Record::CloseLog => self.name(source, "LOGCLOSE()"),
            // The interpreter itself does these, without a call.
            Record::Print(_) | Record::OpenProbeLog(_) | Record::CloseProbeLog => {}
        }
    }

    fn push_reset(&mut self, source: &Source) {
        // Always the same and so no event of ours.
        if !self.started {
            self.started = true;
            self.name(source, "SET_FEED_REFERENCE(CANON_XYZ)");
        }
        // The line is behind it.
        self.name(&Source::default(), "ON_RESET()");
    }
}

/// Lines and their parts.
impl CanonPrinter {
    /// Count and N-word.
    fn begin(&mut self, source: &Source) {
        self.count += 1;
        push_integer(&mut self.text, self.count, 5, b' ');
        self.text.push(b' ');
        let Some(n) = source.n else {
            self.text.extend_from_slice(b"N..... ");
            return;
        };
        self.text.push(b'N');
        let start = self.text.len();
        push_integer(&mut self.text, n.into(), source.n_digits.into(), b'0');
        let width = self.text.len() - start;
        self.text.resize(self.text.len() + 6_usize.saturating_sub(width), b' ');
    }

    fn name(&mut self, source: &Source, call: &str) {
        self.begin(source);
        self.text.extend_from_slice(call.as_bytes());
        self.text.push(b'\n');
    }

    /// What is on or off.
    fn switch(&mut self, source: &Source, on: bool, [name_on, name_off]: [&str; 2]) {
        self.name(source, if on { name_on } else { name_off });
    }

    fn quoted(&mut self, source: &Source, name: &str, text: &str) {
        self.begin(source);
        for part in [name, "(\"", text, "\")\n"] {
            self.text.extend_from_slice(part.as_bytes());
        }
    }

    /// For calls that are rare.
    fn line(&mut self, source: &Source, call: fmt::Arguments<'_>) {
        self.begin(source);
        // A Vec takes all that is written.
        let _ = writeln!(self.text, "{call}");
    }

    /// `name` ends with the opening parenthesis.
    fn numbers(&mut self, source: &Source, name: &str, numbers: &[f64], separator: &str) {
        self.begin(source);
        self.text.extend_from_slice(name.as_bytes());
        self.end_numbers(numbers, separator);
    }

    fn end_numbers(&mut self, numbers: &[f64], separator: &str) {
        for (index, number) in numbers.iter().enumerate() {
            if index > 0 {
                self.text.extend_from_slice(separator.as_bytes());
            }
            push_fixed4(&mut self.text, *number);
        }
        self.text.extend_from_slice(b")\n");
    }

    /// X to C in the unit of the program.
    fn six(&self, position: &Position) -> [f64; 6] {
        [Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::B, Axis::C].map(|axis| in_unit(position, axis, self.unit))
    }

    fn length(&self, mm: f64) -> f64 {
        length_in(mm, self.unit)
    }
}

fn in_unit(position: &Position, axis: Axis, unit: LengthUnit) -> f64 {
    if axis.is_rotary() {
        position[axis]
    } else {
        length_in(position[axis], unit)
    }
}

pub(crate) fn length_in(mm: f64, unit: LengthUnit) -> f64 {
    match unit {
        LengthUnit::Millimetre => mm,
        LengthUnit::Inch => tidy(mm / LengthUnit::Inch.mm()),
    }
}

/// The number that was in the program before it was converted and back, which may have cost its last bits: without this
/// 0.00125 inch may be printed as 0.0012 or 0.0013.
fn tidy(value: f64) -> f64 {
    const DECIMALS: f64 = 1e7;
    let rounded = (value * DECIMALS).round() / DECIMALS;
    if (rounded - value).abs() <= 4.0 * f64::EPSILON * value.abs() {
        rounded
    } else {
        value
    }
}
