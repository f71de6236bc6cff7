//! How the machine is, and the line that tells it.

use crate::modes::Modes;
use std::fmt::Write;

/// Lines between two that tell the work offset and the overrides, while something moves and while nothing does, as Grbl has them.
const OFFSET_EVERY: [u32; 2] = [30, 10];
const OVERRIDES_EVERY: [u32; 2] = [20, 10];

/// What of a machine does not change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Machine {
    /// X, Y and Z; `None`: it is not there.
    pub axes: [Option<Axis>; 3],
    /// Fastest spindle, 1/min.
    pub rpm_max: f64,
    /// How far feed and spindle can be overridden, percent.
    pub feed_percent: [u16; 2],
    /// The same for the spindle.
    pub spindle_percent: [u16; 2],
}

/// An axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axis {
    /// mm, machine coordinates.
    pub travel_mm: [f64; 2],
    /// Fastest, mm/min.
    pub velocity_mm_min: f64,
    /// mm/s².
    pub acceleration_mm_s2: f64,
}

/// What is going on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activity {
    /// Nothing.
    #[default]
    Idle,
    /// Joints home.
    Homing,
    /// Something is moved by hand.
    Jogging,
    /// Lines run, or are about to.
    Running,
    /// It comes to rest.
    Stopping,
    /// It rests on its path, or waits for somebody.
    Held,
}

/// Whether the spindle turns, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spindle {
    /// It is on.
    pub on: bool,
    /// Clockwise (M3) above 0.
    pub speed_rpm: f64,
}

/// Percent of what is programmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overrides {
    /// Moves at feed.
    pub feed: u16,
    /// Rapid moves.
    pub rapid: u16,
    /// The spindle.
    pub spindle: u16,
}

impl Default for Overrides {
    fn default() -> Overrides {
        Overrides {
            feed: 100,
            rapid: 100,
            spindle: 100,
        }
    }
}

/// How the machine is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    /// Why it stopped by itself, or that it is in an emergency stop.
    pub alarm: Option<String>,
    /// Drives are on and joints homed: lines can run.
    pub is_ready: bool,
    /// What is going on.
    pub activity: Activity,
    /// Machine coordinates, mm.
    pub position_mm: [f64; 3],
    /// What is to be subtracted for work coordinates, mm.
    pub work_offset_mm: [f64; 3],
    /// Along the path, mm/min.
    pub feed_mm_min: f64,
    /// The first one.
    pub spindle: Spindle,
    /// Coolant is on.
    pub flood: bool,
    /// Mist is on.
    pub mist: bool,
    /// Where they stand.
    pub overrides: Overrides,
    /// Limit switches that are closed.
    pub limits: [bool; 3],
    /// The probe is closed.
    pub probe: bool,
    /// What the machine waits for somebody to do, in words.
    pub waiting: Option<String>,
}

/// Tells how the machine is.
#[derive(Debug, Default)]
pub(crate) struct Reporter {
    since_offset: u32,
    since_overrides: u32,
    told: Option<([f64; 3], Overrides, Accessories)>,
}

type Accessories = (bool, bool, bool, bool);

/// What a session knows beside the control.
pub(crate) struct Seen {
    /// The word of the state.
    pub(crate) state: &'static str,
    /// Lines that could be taken, and octets.
    pub(crate) room: [usize; 2],
}

impl Reporter {
    pub(crate) fn line(&mut self, status: &Status, seen: &Seen) -> String {
        let mut line = format!("<{}|MPos:{}", seen.state, triple(status.position_mm));
        let Spindle { on, speed_rpm } = status.spindle;
        let rpm = if on { speed_rpm.abs() } else { 0.0 };
        let [lines, octets] = seen.room;
        // Writing to a text cannot fail.
        let _ = write!(line, "|Bf:{lines},{octets}|FS:{:.0},{rpm:.0}", status.feed_mm_min);
        let letters = ['X', 'Y', 'Z'].into_iter().zip(status.limits).filter(|(_, on)| *on);
        let pins: String = letters
            .map(|(letter, _)| letter)
            .chain(status.probe.then_some('P'))
            .collect();
        if !pins.is_empty() {
            let _ = write!(line, "|Pn:{pins}");
        }
        let moves = usize::from(!matches!(
            status.activity,
            Activity::Running | Activity::Jogging | Activity::Homing
        ));
        let accessories = (on && speed_rpm >= 0.0, on && speed_rpm < 0.0, status.flood, status.mist);
        let told = self
            .told
            .replace((status.work_offset_mm, status.overrides, accessories));
        self.since_offset += 1;
        self.since_overrides += 1;
        let new_offset = told.as_ref().is_none_or(|told| told.0 != status.work_offset_mm);
        let new_overrides = told.is_none_or(|told| (told.1, told.2) != (status.overrides, accessories));
        if new_offset || self.since_offset >= OFFSET_EVERY[moves] {
            self.since_offset = 0;
            let _ = write!(line, "|WCO:{}", triple(status.work_offset_mm));
            if new_overrides {
                // In the next one.
                self.since_overrides = u32::MAX - 1;
            }
        } else if new_overrides || self.since_overrides >= OVERRIDES_EVERY[moves] {
            self.since_overrides = 0;
            let Overrides { feed, rapid, spindle } = status.overrides;
            let _ = write!(line, "|Ov:{feed},{rapid},{spindle}");
            let (clockwise, counter, flood, mist) = accessories;
            let letters = [('S', clockwise), ('C', counter), ('F', flood), ('M', mist)];
            let on: String = letters
                .into_iter()
                .filter(|(_, on)| *on)
                .map(|(letter, _)| letter)
                .collect();
            if !on.is_empty() {
                let _ = write!(line, "|A:{on}");
            }
        }
        line.push_str(">\r\n");
        line
    }
}

/// Three lengths, as they are told everywhere.
pub(crate) fn triple(values: [f64; 3]) -> String {
    let [x, y, z] = values.map(|value| if value.abs() < 0.0005 { 0.0 } else { value });
    format!("{x:.3},{y:.3},{z:.3}")
}

/// `[GC:..]`
pub(crate) fn modes_line(modes: &Modes) -> String {
    let Modes {
        plane,
        system,
        spindle,
        tool,
        speed_rpm,
        ..
    } = modes;
    let motion = modes.motion.word();
    let (unit, distance) = (if modes.inch { 20 } else { 21 }, if modes.relative { 91 } else { 90 });
    let feed_mode = if modes.inverse_time { 93 } else { 94 };
    let coolant = match (modes.mist, modes.flood) {
        (false, false) => "M9",
        (true, false) => "M7",
        (false, true) => "M8",
        (true, true) => "M7 M8",
    };
    let feed = modes.feed_mm_min / modes.unit_mm();
    format!(
        "[GC:{motion} G{system} G{plane} G{unit} G{distance} G{feed_mode} M{spindle} {coolant} T{tool} F{feed:.0} S{speed_rpm:.0}]\r\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEEN: Seen = Seen {
        state: "Idle",
        room: [15, 128],
    };

    #[test]
    fn a_status_has_its_fields_in_their_order() {
        let mut reporter = Reporter::default();
        let status = Status {
            position_mm: [1.0, -2.5, -0.0001],
            work_offset_mm: [10.0, 0.0, 0.0],
            feed_mm_min: 599.6,
            spindle: Spindle {
                on: true,
                speed_rpm: -1000.0,
            },
            flood: true,
            limits: [true, false, true],
            probe: true,
            ..Status::default()
        };
        assert_eq!(
            reporter.line(&status, &SEEN),
            "<Idle|MPos:1.000,-2.500,0.000|Bf:15,128|FS:600,1000|Pn:XZP|WCO:10.000,0.000,0.000>\r\n"
        );
        assert_eq!(
            reporter.line(&status, &SEEN),
            "<Idle|MPos:1.000,-2.500,0.000|Bf:15,128|FS:600,1000|Pn:XZP|Ov:100,100,100|A:CF>\r\n"
        );
        assert!(reporter.line(&status, &SEEN).ends_with("|Pn:XZP>\r\n"));
    }

    #[test]
    fn offset_and_overrides_are_told_at_change_and_now_and_then() {
        let mut reporter = Reporter::default();
        let mut status = Status::default();
        let mut told = |status: &Status, word: &str| reporter.line(status, &SEEN).contains(word);
        assert!(told(&status, "|WCO:") && told(&status, "|Ov:"));
        // Every tenth at rest.
        let offsets: Vec<usize> = (1..=40).filter(|_| told(&status, "|WCO:")).collect();
        assert_eq!(offsets.len(), 4, "{offsets:?}");
        status.overrides.feed = 90;
        assert!(told(&status, "|Ov:90,100,100"));
        status.work_offset_mm = [1.0, 2.0, 3.0];
        status.overrides.feed = 80;
        assert!(told(&status, "|WCO:1.000,2.000,3.000"));
        assert!(told(&status, "|Ov:80,"));
        status.flood = true;
        assert!(told(&status, "|A:F"));
        status.activity = Activity::Running;
        let count = (0..60).filter(|_| told(&status, "|WCO:")).count();
        assert_eq!(count, 2, "every thirtieth while something moves");
    }

    #[test]
    fn modes_are_told_as_senders_read_them() {
        assert_eq!(
            modes_line(&Modes::default()),
            "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]\r\n"
        );
    }
}
