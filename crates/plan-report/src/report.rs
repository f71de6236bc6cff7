//! What a plan comes to, as a table for people or JSON for programs.

use super::joints::{Joint, NAMES, ORDERS, joint_name};
use super::judge::Judged;
use super::picture::recording::Numbers;
use super::rests::Rests;
use super::run_down::Work;
use super::script::ScriptReport;
use super::slow_places::FeedKept;
use super::times::TimeTable;
use config::Config;
use motion::plan::{Deviation, PlannerKind};
use program::real_time::RealTimeFactor;
use serde::Serialize;
use std::fmt;

/// Limits that the text shows; JSON has all of them.
const LIMITS_SHOWN: usize = 6;

/// What a plan comes to. Lengths and derivatives of rotary joints are in degrees.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    #[serde(flatten)]
    pub(super) planning: Planning,
    #[serde(flatten)]
    limits: Limits,
    #[serde(flatten)]
    path: PathKept,
    starved_cycles: u64,
    /// A move in step with the spindle behind which nothing was run down, and why.
    given_up: Option<GivenUp>,
    /// What the operator did.
    script: Option<ScriptReport>,
    #[serde(flatten)]
    feed: FeedKept,
    /// Rests before moves at which something is done or waited for.
    rests: Vec<Rests>,
    #[serde(flatten)]
    times: TimeTable,
    /// What the page shows in pictures.
    picture: Option<Numbers>,
}

/// What was planned, and in what time.
#[derive(Debug, Serialize)]
pub(super) struct Planning {
    planner: &'static str,
    lines: u32,
    /// Programmed moves.
    blocks: usize,
    /// What goes through the ring.
    elements: usize,
    motion_time_s: f64,
    /// From text to committed profile.
    wall_time_s: f64,
    blocks_per_s: f64,
    /// How much quicker than motion one thread plans it.
    pub(super) real_time_factor: RealTimeFactor,
    threads: usize,
}

/// How the limits of the joints are kept.
#[derive(Debug, Serialize)]
struct Limits {
    joints: Vec<JointReport>,
    /// Cycles of the whole program, and how many of them were run and judged: of elements that take long, not every one.
    cycles: u64,
    cycles_judged: u64,
    cycles_over_limits: u64,
    /// Where each limit that is not kept is passed the most.
    over_limits: Vec<OverLimit>,
    /// Joints that leave their travel.
    beyond_travel: Vec<BeyondTravel>,
}

/// How the path is kept, mm.
#[derive(Debug, Serialize)]
struct PathKept {
    /// What the program allows.
    tolerance_mm: f64,
    /// Of a set-point from the path.
    deviation_max_mm: f64,
    /// Of a programmed point from the set-points.
    missed_max_mm: f64,
    /// Way of a tap behind its depth, in which its spindle comes to the reversal; no part of the deviation.
    over_run_mm: f64,
    /// Length of the programmed path, and up to where the set-points were followed.
    path_length_mm: f64,
    path_reached_mm: f64,
}

/// A limit that is not kept.
#[derive(Debug, Serialize)]
struct OverLimit {
    joint: usize,
    axis: Option<char>,
    limit: &'static str,
    cycles: u64,
    /// The most, what is allowed, and where.
    value: f64,
    allowed: f64,
    line: u32,
    time_s: f64,
}

impl fmt::Display for OverLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let joint = joint_name(self.joint, self.axis);
        write!(
            f,
            "over limits, not run: {joint} passes its {} limit: {:.1} of {:.1}, {:.1} %, {:.3} s after the start; {} cycles are over",
            self.limit,
            self.value,
            self.allowed,
            self.value / self.allowed * 100.0,
            self.time_s,
            self.cycles
        )
    }
}

/// A joint that leaves its travel.
#[derive(Debug, Serialize)]
struct BeyondTravel {
    joint: usize,
    axis: Option<char>,
    unit: &'static str,
    cycles: u64,
    /// The most, what is allowed, and where.
    value: f64,
    allowed: f64,
    line: u32,
    time_s: f64,
}

impl fmt::Display for BeyondTravel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let joint = joint_name(self.joint, self.axis);
        write!(
            f,
            "{joint} leaves its travel: {:.4} {unit}, the limit is {:.4} {unit}, {:.3} s after the start; {} cycles are \
             beyond",
            self.value,
            self.allowed,
            self.time_s,
            self.cycles,
            unit = self.unit,
        )
    }
}

/// A move in step with the spindle that was given up.
#[derive(Debug, Serialize)]
struct GivenUp {
    line: u32,
    why: String,
}

/// What a plan asks of a joint; [velocity, acceleration, jerk] in seconds and the unit of the joint.
#[derive(Debug, Serialize)]
struct JointReport {
    joint: usize,
    axis: Option<char>,
    unit: &'static str,
    velocity_max: f64,
    velocity_share: f64,
    acceleration_max: f64,
    acceleration_share: f64,
    jerk_max: f64,
    jerk_share: f64,
    /// Cycles over the limit.
    over: [u64; ORDERS],
    /// Where a script holds and goes on, within the limits of stops; else `None`.
    stopping: Option<Stopping>,
}

/// What holds and stops ask of a joint, as [`JointReport`].
#[derive(Debug, Serialize)]
struct Stopping {
    acceleration_max: f64,
    acceleration_share: f64,
    jerk_max: f64,
    jerk_share: f64,
    over: [u64; ORDERS],
}

impl Report {
    pub(super) fn new(config: &Config, work: &Work) -> Report {
        let judged = &work.judged;
        Report {
            planning: Planning::new(config.program.planner, work),
            limits: Limits::new(judged),
            path: PathKept::new(work),
            starved_cycles: work.starved_cycles,
            given_up: work.given_up.map(|(line, fault)| GivenUp {
                line,
                why: fault.to_string(),
            }),
            script: work.script.clone(),
            feed: judged.feed.clone(),
            rests: judged.rests.clone(),
            times: judged.times.clone(),
            picture: (judged.recording.as_ref()).map(|recording| recording.numbers(&judged.joints, judged.cycle_s)),
        }
    }

    /// What keeps the program from being run as it is, each with its line.
    pub(super) fn wrong(&self) -> Vec<(u32, String)> {
        let over = self.limits.over_limits.iter().map(|over| (over.line, over.to_string()));
        let given_up = self
            .given_up
            .iter()
            .map(|given_up| (given_up.line, given_up.why.clone()));
        let beyond = self
            .limits
            .beyond_travel
            .iter()
            .map(|beyond| (beyond.line, beyond.to_string()));
        over.chain(beyond).chain(given_up).collect()
    }

    /// What [`Report::compared`] says behind the planner, one after the other.
    pub(super) const COMPARED: [&'static str; 12] = [
        "motion time, s",
        "planned in, s",
        "real-time factor",
        "deviation, mm",
        "missed, mm",
        "at feed, %",
        "stops",
        "rests",
        "velocity, %",
        "acceleration, %",
        "jerk, %",
        "over limits",
    ];

    /// What is compared with other settings, each in a few characters; of limits, the joint that uses most.
    pub(super) fn compared(&self) -> [String; 13] {
        let most = |share: fn(&JointReport) -> f64| {
            let most = self.limits.joints.iter().map(share).fold(0.0, f64::max);
            format!("{:.1}", most * 100.0)
        };
        [
            self.planning.planner.to_owned(),
            format!("{:.3}", self.planning.motion_time_s),
            format!("{:.3}", self.planning.wall_time_s),
            self.planning
                .real_time_factor
                .whole
                .map_or("-".to_owned(), |whole| format!("{whole:.0}")),
            format!("{:.4}", self.path.deviation_max_mm),
            format!("{:.4}", self.path.missed_max_mm),
            format!("{:.1}", self.feed.at_feed_share * 100.0),
            self.feed.stops.to_string(),
            self.rests.iter().map(|rests| rests.count).sum::<u64>().to_string(),
            most(|joint| joint.velocity_share),
            most(|joint| joint.acceleration_share),
            most(|joint| joint.jerk_share),
            self.limits.cycles_over_limits.to_string(),
        ]
    }

    /// Orders of a script that never came, each with its line in the script.
    pub(super) fn left_out(&self) -> &[(u32, String)] {
        self.script.as_ref().map_or(&[], |script| &script.left_out)
    }

    /// In one line, for the head of a picture.
    pub(super) fn in_short(&self) -> String {
        format!(
            "{} blocks, {:.3} m, {:.3} s; planner {}; off the path by {:.4} mm at the most",
            self.planning.blocks,
            self.path.path_length_mm / 1000.0,
            self.planning.motion_time_s,
            self.planning.planner,
            self.path.deviation_max_mm,
        )
    }
}

impl Planning {
    fn new(planner: PlannerKind, work: &Work) -> Planning {
        let (blocks, wall_time_s) = (work.judged.blocks, work.planned.wall_time_s);
        Planning {
            planner: match planner {
                PlannerKind::Optimal => "optimal",
                PlannerKind::Classic => "classic",
            },
            lines: work.lines,
            blocks,
            elements: work.planned.elements,
            motion_time_s: work.motion_time_s,
            wall_time_s,
            blocks_per_s: blocks as f64 / wall_time_s,
            real_time_factor: work.real_time,
            threads: work.planned.threads,
        }
    }
}

impl fmt::Display for Planning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "planner         {}", self.planner)?;
        writeln!(f, "program         {} lines, {} blocks", self.lines, self.blocks)?;
        writeln!(f, "motion time     {:.3} s", self.motion_time_s)?;
        writeln!(
            f,
            "planned in      {:.3} s, {:.0} blocks/s, {} threads, {} elements",
            self.wall_time_s, self.blocks_per_s, self.threads, self.elements
        )?;
        let Some(whole) = self.real_time_factor.whole else {
            return Ok(());
        };
        write!(
            f,
            "real-time factor {whole:.0}: s of motion per s of one thread that plans"
        )?;
        match self.real_time_factor.least {
            Some(least) => writeln!(
                f,
                "; at the least {:.1}, lines {} to {}",
                least.factor, least.from_line, least.to_line
            ),
            None => writeln!(f),
        }
    }
}

impl Limits {
    fn new(judged: &Judged) -> Limits {
        let joints = || judged.joints.all.iter().enumerate();
        let time_s = |cycle: u64| cycle as f64 * judged.cycle_s;
        let mut over_limits = Vec::new();
        for (index, joint) in joints() {
            for (peaks, limits) in [(joint.peaks, joint.limits), (joint.stop_peaks, joint.stop_limits)] {
                over_limits.extend((0..ORDERS).filter(|&order| peaks.over[order] > 0).map(|order| {
                    let (cycle, line) = peaks.at[order];
                    OverLimit {
                        joint: index,
                        axis: joint.axis.map(|axis| axis.letter()),
                        limit: NAMES[order],
                        cycles: peaks.over[order],
                        value: peaks.greatest[order],
                        allowed: limits[order],
                        line,
                        time_s: time_s(cycle),
                    }
                }));
            }
        }
        let beyond_travel = joints().filter_map(|(index, joint)| {
            let beyond = joint.beyond_travel?;
            let (cycle, line) = beyond.at;
            Some(BeyondTravel {
                joint: index,
                axis: joint.axis.map(|axis| axis.letter()),
                unit: joint.unit(),
                cycles: beyond.cycles,
                value: beyond.value,
                allowed: beyond.limit,
                line,
                time_s: time_s(cycle),
            })
        });
        Limits {
            joints: joints().map(|(index, joint)| JointReport::new(index, joint)).collect(),
            cycles: judged.cycles,
            cycles_judged: judged.cycles_judged,
            cycles_over_limits: over_limits.iter().map(|over| over.cycles).sum(),
            beyond_travel: beyond_travel.collect(),
            over_limits,
        }
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for joint in &self.joints {
            let name = joint_name(joint.joint, joint.axis);
            writeln!(
                f,
                "{name:15} velocity {:.1} {unit}/s ({:.1} %), acceleration {:.1} {unit}/s² ({:.1} %), jerk {:.0} {unit}/s³ ({:.1} %)",
                joint.velocity_max,
                joint.velocity_share * 100.0,
                joint.acceleration_max,
                joint.acceleration_share * 100.0,
                joint.jerk_max,
                joint.jerk_share * 100.0,
                unit = joint.unit,
            )?;
        }
        for joint in &self.joints {
            if let Some(stopping) = &joint.stopping {
                writeln!(
                    f,
                    "{:15} of its stop limits: acceleration {:.1} %, jerk {:.1} %",
                    format!("joint {}", joint.joint),
                    stopping.acceleration_share * 100.0,
                    stopping.jerk_share * 100.0
                )?;
            }
        }
        writeln!(f, "over limits     {} cycles", self.cycles_over_limits)?;
        if self.cycles_judged < self.cycles {
            writeln!(
                f,
                "judged          {} of {} cycles: of elements that take long, their ends and places on the way (all: --samples)",
                self.cycles_judged, self.cycles
            )?;
        }
        Ok(())
    }
}

impl JointReport {
    fn new(index: usize, joint: &Joint) -> JointReport {
        let (peaks, stops) = (joint.peaks.greatest, joint.stop_peaks.greatest);
        let share = |order: usize| peaks[order] / joint.limits[order];
        JointReport {
            joint: index,
            axis: joint.axis.map(|axis| axis.letter()),
            unit: joint.unit(),
            velocity_max: peaks[0],
            velocity_share: share(0),
            acceleration_max: peaks[1],
            acceleration_share: share(1),
            jerk_max: peaks[2],
            jerk_share: share(2),
            over: joint.peaks.over,
            stopping: (stops != [0.0; ORDERS]).then(|| Stopping {
                acceleration_max: stops[1],
                acceleration_share: stops[1] / joint.stop_limits[1],
                jerk_max: stops[2],
                jerk_share: stops[2] / joint.stop_limits[2],
                over: joint.stop_peaks.over,
            }),
        }
    }
}

impl PathKept {
    fn new(work: &Work) -> PathKept {
        let Deviation {
            off_mm,
            missed_mm,
            reached_mm,
            length_mm,
        } = work.judged.deviation;
        PathKept {
            tolerance_mm: work.tolerance_mm,
            deviation_max_mm: off_mm,
            missed_max_mm: missed_mm,
            over_run_mm: work.judged.over_run_mm,
            path_length_mm: length_mm,
            path_reached_mm: reached_mm,
        }
    }
}

impl fmt::Display for PathKept {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "deviation       {:.6} mm off the path, {:.6} mm of it missed; the program allows {} mm",
            self.deviation_max_mm, self.missed_max_mm, self.tolerance_mm
        )?;
        if self.over_run_mm > 0.0 {
            writeln!(
                f,
                "over-run        {:.3} mm behind the depth of a tap, until its spindle reverses",
                self.over_run_mm
            )?;
        }
        if self.path_length_mm - self.path_reached_mm > 2.0 * self.tolerance_mm + 1e-3 {
            writeln!(
                f,
                "                the path could be followed for {:.3} of {:.3} mm only",
                self.path_reached_mm, self.path_length_mm
            )?;
        }
        Ok(())
    }
}

impl Report {
    /// How the feed was kept, and why it was not.
    fn write_feed(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let feed = &self.feed;
        writeln!(
            f,
            "feed            reached in {:.1} % of the time at feed; {} stops on the way",
            feed.at_feed_share * 100.0,
            feed.stops
        )?;
        if !self.rests.is_empty() {
            let told = self.rests.iter().map(Rests::to_string).collect::<Vec<_>>();
            writeln!(f, "rests           {}", told.join(", "))?;
        }
        let fed: f64 = feed.limited_by.iter().map(|by| by.time_s).sum();
        if !feed.limited_by.is_empty() {
            let told = feed.limited_by.iter().take(LIMITS_SHOWN).map(|by| {
                let joint = match (by.joint, by.axis) {
                    (_, Some(axis)) => format!("{axis} "),
                    (Some(joint), None) => format!("joint {joint} "),
                    (None, None) => String::new(),
                };
                format!("{joint}{} {:.1} %", by.what, by.time_s / fed * 100.0)
            });
            writeln!(f, "limited by      {}", told.collect::<Vec<_>>().join(", "))?;
        }
        for place in &feed.slow_places {
            writeln!(f, "slow place      line {}: {}", place.line, place.in_words())?;
        }
        for place in &feed.stop_places {
            writeln!(
                f,
                "stop            line {}, after {:.3} s: {}",
                place.line, place.time_s, place.reason
            )?;
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}{}", self.planning, self.limits, self.path)?;
        self.write_feed(f)?;
        write!(f, "{}", self.times)?;
        if let Some(script) = &self.script {
            write!(f, "{script}")?;
        }
        if let Some(given_up) = &self.given_up {
            writeln!(f, "given up        line {}: {}", given_up.line, given_up.why)?;
        }
        writeln!(f, "starved         {} cycles", self.starved_cycles)
    }
}
