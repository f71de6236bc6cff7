//! `[joint.homing]`: how a joint finds out where it is, by its drive or by the control.
//!
//! | `by` | keys |
//! |---|---|
//! | both | `search_mm_s`, `latch_mm_s`, `position_mm`, `sequence`, `absolute_encoder`, `moved_when_off_mm`, `volatile` |
//! | `"drive"` (default) | `method`, `acceleration_mm_s2` |
//! | `"control"` | `towards`, `switch_mm`, `switch`, `search_distance_mm`, `release_distance_mm`, `resolution_mm`, `bounce_s`, `skew_mm`, `index_distance_mm`, `index_probe` |

use super::drive_profile::DriveProfile;
use super::limits::StopLimits;
use super::modes::{METHOD_RULE, is_homing_method};
use super::question::Bound;
use super::section::{Section, keys};
use super::values::{ACCELERATION_MAX, LENGTH_MAX, VELOCITY_MAX, ratio};
use motion::canon::Axis;

/// Homing of joints of one sequence number may take no longer than 120 s; some of it is for what is not in the sum, s.
const DURATION_MAX_S: f64 = 100.0;
/// What an axis sinks into its brake, or is pushed, while nobody looks.
const MOVED_USUAL_MM: f64 = 1.0;
const SWITCHES: [(&str, HomeSwitch); 2] = [("pin", HomeSwitch::Pin), ("drive", HomeSwitch::Drive)];

const OF_DRIVES: [&str; 2] = ["method", "acceleration_mm_s2"];
const OF_THE_CONTROL: [&str; 10] = [
    "towards",
    "switch_mm",
    "switch",
    "search_distance_mm",
    "release_distance_mm",
    "resolution_mm",
    "bounce_s",
    "skew_mm",
    "index_distance_mm",
    "index_probe",
];

#[derive(Clone, Copy, PartialEq, Eq)]
enum By {
    Drive,
    Control,
}

/// `[joint.homing]`: how a joint finds out where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homing {
    /// Speed towards the switch, mm/s; 6099:1.
    pub search_mm_s: f64,
    /// Speed at which its place is found, mm/s; 6099:2.
    pub latch_mm_s: f64,
    /// Where the joint stands when it is homed, mm; of a drive: machine position of its home point. Default 0.
    pub position_mm: f64,
    /// Joints of lower numbers home first, those of the same side by side; `None`: see [`Homing::sequence`].
    pub sequence: Option<u8>,
    /// The encoder knows its place from power-on on: the joint stays homed over a restart; default no.
    pub absolute_encoder: bool,
    /// How far a joint with an absolute encoder may have moved meanwhile, mm; default 1.
    pub moved_when_off_mm: f64,
    /// The joint is to be homed again whenever its drive has been switched off; default no.
    pub volatile: bool,
    /// Who homes it.
    pub by: HomingBy,
}

impl Homing {
    /// Place in the order of homing of a joint that moves `axis`; where the file names none, Z comes first, because the tool
    /// must be clear before anything moves sideways.
    pub fn sequence(&self, axis: Axis) -> u8 {
        self.sequence.unwrap_or(if axis == Axis::Z { 0 } else { 1 })
    }
}

/// Who homes a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomingBy {
    /// Its drive (CiA 402 mode 6).
    Drive {
        /// Homing method, 6098.
        method: i8,
        /// 609A as mm/s².
        acceleration_mm_s2: f64,
    },
    /// The control, in the cyclic mode.
    Control(HomingByControl),
}

/// A zero mark that the drive latches with a touch probe of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingIndex {
    /// Where it must come within behind the switch, mm.
    pub distance_mm: f64,
    /// Number of the touch probe, 1 or 2; default 1.
    pub probe: u8,
}

/// Who tells whether a home switch is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomeSwitch {
    /// The pin `joint.N.home-sw-in`.
    Pin,
    /// Its drive: 60FDh, bit 2 unless its profile has another one.
    Drive,
}

keys! {
    /// Homing by the control; see `motion::rt::homing`. `search_mm_s`, `latch_mm_s`: what [`Homing`] has, where they are right.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct HomingByControl(section, known: &Known<'_>, search_mm_s: Option<f64>, latch_mm_s: Option<f64>) {
        /// Direction in which the switch lies.
        pub towards_positive: bool = section.word("towards", &[("negative", false), ("positive", true)], None),
        /// Position that the place has at which the switch closes, or of the zero mark behind it, mm.
        pub switch_mm: f64 = section.number("switch_mm", Bound::Size(LENGTH_MAX), None),
        /// Who tells of the switch; default a pin.
        pub switch: HomeSwitch = section.word("switch", &SWITCHES, HomeSwitch::Pin),
        /// Where it must open again within, mm; default 5.
        pub release_distance_mm: f64 = section.number("release_distance_mm", Bound::Positive(LENGTH_MAX), 5.0),
        /// Where the switch must be found within, mm; default from the far end of the travel, and the way of the release.
        pub search_distance_mm: f64 = {
            let way_mm = way_of_search(section, towards_positive, switch_mm, known.travel_mm)?;
            let usual_mm = way_mm.zip(release_distance_mm).map(|(way_mm, release_mm)| way_mm + release_mm);
            let given_mm = section.optional_number("search_distance_mm", Bound::Positive(LENGTH_MAX));
            given_mm.and_then(|given_mm| given_mm.or(usual_mm))
        },
        /// How exactly its place is to be found, mm; default 0.001, or an increment of the drive.
        pub resolution_mm: f64 = {
            let increment_mm = known.increment_mm();
            let resolution_mm = section.number("resolution_mm", Bound::Positive(LENGTH_MAX), increment_mm.max(1e-3));
            if resolution_mm.is_some_and(|resolution_mm| resolution_mm < increment_mm) {
                let rule = format!("must not be below one increment of the drive, {increment_mm}");
                section.wrong("resolution_mm", rule);
            }
            resolution_mm
        },
        /// How long it must be open to count as open, s; default 0.02.
        pub bounce_s: f64 = section.number("bounce_s", Bound::Within(0.0, 1.0), 0.02),
        /// How far joints that move an axis together may be moved against each other, mm; `None` for a joint alone.
        pub skew_mm: Option<f64> = section.optional_number("skew_mm", Bound::Positive(LENGTH_MAX)),
        /// The zero mark of the encoder behind the switch, which then counts; `None`: the switch does.
        pub index: Option<HomingIndex> = index(section, known.turn_mm),
    }
    rules {
        if let (Some(release_mm), Some(search_mm_s), Some(stop)) = (release_distance_mm, search_mm_s, known.stop) {
            let stop_mm = stopping_way_mm(search_mm_s, stop);
            if release_mm <= stop_mm {
                let rule = format!("must be above {stop_mm:.3}, the way of a stop from search_mm_s behind the switch");
                section.wrong("release_distance_mm", rule);
            }
        }
        if let (Some(search_mm), Some(release_mm), Some(search_mm_s), Some(latch_mm_s)) =
            (search_distance_mm, release_distance_mm, search_mm_s, latch_mm_s)
        {
            let index_mm = index.flatten().map_or(0.0, |index| index.distance_mm);
            let duration_s = search_mm / search_mm_s + (2.0 * release_mm + index_mm) / latch_mm_s;
            if duration_s > DURATION_MAX_S {
                let rule = format!(
                    "must be quicker: {search_mm} mm of search and twice release_distance_mm with latch_mm_s may take \
                     {duration_s:.0} s, above {DURATION_MAX_S} s"
                );
                section.wrong("search_mm_s", rule);
            }
        }
    }
}

/// What is known of the joint; `None` where it has errors of its own.
pub(super) struct Known<'n> {
    pub(super) travel_mm: Option<[f64; 2]>,
    pub(super) velocity_mm_s: Option<f64>,
    pub(super) stop: Option<StopLimits>,
    pub(super) counts_per_unit: Option<[u32; 2]>,
    /// Way of a turn of its motor, mm.
    pub(super) turn_mm: Option<f64>,
    /// It has no drive that could search.
    pub(super) is_local: bool,
    /// What is known of its drive.
    pub(super) drive: Option<&'n DriveProfile>,
}

impl Known<'_> {
    fn increment_mm(&self) -> f64 {
        self.counts_per_unit.map_or(0.0, |counts| 1.0 / ratio(counts))
    }
}

/// Reads the homing of one joint.
pub(super) fn homing(joint: &mut Section<'_, '_>, known: &Known<'_>) -> Option<Homing> {
    joint.required(
        "homing",
        "how the drive finds its reference point: { method = 35, ... }",
    )?;
    let mut section = joint.section("homing")?;
    let by = section.word("by", &[("drive", By::Drive), ("control", By::Control)], By::Drive)?;
    let method = match by {
        By::Drive => method(&mut section, known.drive),
        By::Control => None,
    };
    if known.is_local && method.is_some_and(|method| !matches!(method, 35 | 37)) {
        let rule = "must be 37 (it is homed where it stands), or by = \"control\": there is no drive that could search";
        section.wrong("method", rule);
    }
    let search_mm_s = section.number("search_mm_s", Bound::Positive(VELOCITY_MAX), None);
    let latch_mm_s = section.number("latch_mm_s", Bound::Positive(VELOCITY_MAX), None);
    let acceleration_mm_s2 = match by {
        By::Drive => section.number("acceleration_mm_s2", Bound::Positive(ACCELERATION_MAX), None),
        By::Control => None,
    };
    let position_mm = section.number("position_mm", Bound::Size(LENGTH_MAX), 0.0);
    let sequence = section.optional_integer("sequence", 0..=99);
    let absolute_encoder = section.flag("absolute_encoder", false);
    let moved_when_off_mm = section.number("moved_when_off_mm", Bound::Positive(LENGTH_MAX), MOVED_USUAL_MM);
    let volatile = section.flag("volatile", false);
    if (absolute_encoder, volatile) == (Some(true), Some(true)) {
        let rule = "is not for a joint with absolute_encoder = true: that stays homed";
        section.wrong("volatile", rule);
    }
    if let (Some(search), Some(most)) = (search_mm_s, known.velocity_mm_s)
        && search > most
    {
        let rule = format!("must not be above velocity_mm_s of the joint, {most}");
        section.wrong("search_mm_s", rule);
    }
    if let (Some(latch), Some(search)) = (latch_mm_s, search_mm_s)
        && latch > search
    {
        section.wrong("latch_mm_s", format!("must not be above search_mm_s, {search}"));
    }
    if let (Some(position), Some([lower, upper])) = (position_mm, known.travel_mm)
        && !(lower..=upper).contains(&position)
    {
        section.wrong("position_mm", format!("must lie in travel_mm, {lower} to {upper}"));
    }
    let by = match by {
        By::Drive => {
            if let Some(counts) = known.counts_per_unit {
                // The drive is told whole increments per second (squared).
                for (key, value) in [
                    ("search_mm_s", search_mm_s),
                    ("latch_mm_s", latch_mm_s),
                    ("acceleration_mm_s2", acceleration_mm_s2),
                ] {
                    let fits = |value: f64| (1.0..=f64::from(u32::MAX)).contains(&(value * ratio(counts)));
                    if value.is_some_and(|value| !fits(value)) {
                        section.wrong(key, "must be 1 to 4294967295 in increments of the drive");
                    }
                }
            }
            refuse(&mut section, &OF_THE_CONTROL, "is for by = \"control\"");
            method
                .zip(acceleration_mm_s2)
                .map(|(method, acceleration_mm_s2)| HomingBy::Drive {
                    method,
                    acceleration_mm_s2,
                })
        }
        By::Control => {
            let control = HomingByControl::read(&mut section, known, search_mm_s, latch_mm_s);
            refuse(&mut section, &OF_DRIVES, "is for by = \"drive\"");
            control.map(HomingBy::Control)
        }
    };
    section.done();
    Some(Homing {
        search_mm_s: search_mm_s?,
        latch_mm_s: latch_mm_s?,
        position_mm: position_mm?,
        sequence: sequence?,
        absolute_encoder: absolute_encoder?,
        moved_when_off_mm: moved_when_off_mm?,
        volatile: volatile?,
        by: by?,
    })
}

/// Notes keys that belong to the other way of homing.
fn refuse(section: &mut Section<'_, '_>, keys: &[&'static str], rule: &str) {
    let there: Vec<_> = keys.iter().copied().filter(|key| section.has(key)).collect();
    section.refuse(&there, rule);
}

fn method(section: &mut Section<'_, '_>, drive: Option<&DriveProfile>) -> Option<i8> {
    let method = section.integer("method", i8::MIN..=i8::MAX, None)?;
    if !is_homing_method(method) {
        return section.refused("method", METHOD_RULE);
    }
    if let Some(drive) = drive.filter(|it| !it.homing_methods.is_empty() && !it.homing_methods.contains(&method)) {
        let methods: Vec<_> = drive.homing_methods.iter().map(i8::to_string).collect();
        let rule = format!("does not work with {}, only {}", drive.name, methods.join(", "));
        return section.refused("method", rule);
    }
    Some(method)
}

/// From the far end of the travel to the switch; `Some(None)`: not known.
fn way_of_search(
    section: &Section<'_, '_>,
    towards_positive: Option<bool>,
    switch_mm: Option<f64>,
    travel_mm: Option<[f64; 2]>,
) -> Option<Option<f64>> {
    let (Some(positive), Some(switch_mm), Some([low, high])) = (towards_positive, switch_mm, travel_mm) else {
        return Some(None);
    };
    let way_mm = if positive { switch_mm - low } else { high - switch_mm };
    if way_mm <= 0.0 {
        let (far, end) = if positive { ("below", low) } else { ("above", high) };
        let rule = format!("lies {far} all of travel_mm ({end}): a joint that searches the other way never gets there");
        return section.refused("switch_mm", rule);
    }
    Some(Some(way_mm))
}

/// `index_distance_mm` and `index_probe`.
fn index(section: &mut Section<'_, '_>, turn_mm: Option<f64>) -> Option<Option<HomingIndex>> {
    let distance_mm = section.optional_number("index_distance_mm", Bound::Positive(LENGTH_MAX));
    if let (Some(Some(distance_mm)), Some(turn_mm)) = (distance_mm, turn_mm)
        && distance_mm > turn_mm
    {
        let rule = format!(
            "must not be above {turn_mm}, the way of a turn of the motor: a zero mark that is missed would not be told, and the next \
             one be taken for it"
        );
        section.wrong("index_distance_mm", rule);
    }
    let probe = section.optional_integer("index_probe", 1..=2);
    if let (Some(Some(_)), Some(None)) = (probe, distance_mm) {
        section.wrong("index_probe", "is for a joint with index_distance_mm");
    }
    let probe = probe.flatten().unwrap_or(1);
    Some(distance_mm?.map(|distance_mm| HomingIndex { distance_mm, probe }))
}

/// Way of the quickest stop.
pub(super) fn stopping_way_mm(velocity_mm_s: f64, stop: StopLimits) -> f64 {
    let (a, j) = (stop.acceleration_mm_s2, stop.jerk_mm_s3);
    let duration_s = if velocity_mm_s > a * a / j {
        velocity_mm_s / a + a / j
    } else {
        2.0 * (velocity_mm_s / j).sqrt()
    };
    0.5 * velocity_mm_s * duration_s
}
