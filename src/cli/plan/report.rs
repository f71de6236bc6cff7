//! What a plan comes to, as a table for people or JSON for programs.

use super::joints::{NAMES, ORDERS, Peaks};
use super::run_down::Work;
use super::slow_places::FeedKept;
use crate::config::Config;
use motion::plan::{Deviation, PlannerKind};
use serde::Serialize;
use std::fmt;

/// What a plan comes to. Lengths and derivatives of rotary joints are in degrees.
#[derive(Debug, Serialize)]
pub(super) struct Report {
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
    threads: usize,
    pub(super) joints: Vec<JointReport>,
    /// Cycles of the whole program, and how many of them were run and judged: of elements that take long, not every one.
    cycles: u64,
    cycles_judged: u64,
    pub(super) cycles_over_limits: u64,
    /// Where each limit that is not kept is passed the most.
    over_limits: Vec<OverLimit>,
    /// Joints that leave their travel.
    beyond_travel: Vec<BeyondTravel>,
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
    starved_cycles: u64,
    /// A move in step with the spindle behind which nothing was run down, and why.
    given_up: Option<GivenUp>,
    #[serde(flatten)]
    feed: FeedKept,
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
        let axis = self.axis.map(|axis| format!(" ({axis})")).unwrap_or_default();
        write!(
            f,
            "joint {}{axis} passes its {} limit: {:.1} of {:.1}, {:.1} %, {:.3} s after the start; {} cycles are over",
            self.joint,
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
        let axis = self.axis.map(|axis| format!(" ({axis})")).unwrap_or_default();
        write!(
            f,
            "joint {}{axis} leaves its travel: {:.4} {unit}, the limit is {:.4} {unit}, {:.3} s after the start; {} cycles are \
             beyond",
            self.joint,
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
pub(super) struct JointReport {
    joint: usize,
    axis: Option<char>,
    unit: &'static str,
    pub(super) velocity_max: f64,
    pub(super) velocity_share: f64,
    pub(super) acceleration_max: f64,
    pub(super) acceleration_share: f64,
    pub(super) jerk_max: f64,
    pub(super) jerk_share: f64,
    /// Cycles over the limit.
    over: [u64; ORDERS],
}

impl Report {
    pub(super) fn new(config: &Config, work: &Work) -> Report {
        let mut over_limits = Vec::new();
        let joints: Vec<JointReport> = (work.joints.all.iter().enumerate())
            .map(|(index, joint)| {
                let Peaks {
                    greatest: peaks,
                    over,
                    at,
                } = joint.peaks;
                let share = |order: usize| peaks[order] / joint.limits[order];
                over_limits.extend((0..ORDERS).filter(|&order| over[order] > 0).map(|order| {
                    let (cycle, line) = at[order];
                    OverLimit {
                        joint: index,
                        axis: joint.axis.map(|axis| axis.letter()),
                        limit: NAMES[order],
                        cycles: over[order],
                        value: peaks[order],
                        allowed: joint.limits[order],
                        line,
                        time_s: cycle as f64 * work.cycle_s,
                    }
                }));
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
                    over,
                }
            })
            .collect();
        let beyond_travel = (work.joints.all.iter().enumerate())
            .filter_map(|(index, joint)| {
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
                    time_s: cycle as f64 * work.cycle_s,
                })
            })
            .collect();
        let Deviation {
            off_mm,
            missed_mm,
            reached_mm,
            length_mm,
        } = work.deviation;
        Report {
            planner: match config.program.planner {
                PlannerKind::Optimal => "optimal",
                PlannerKind::Classic => "classic",
            },
            lines: work.lines,
            blocks: work.blocks,
            elements: work.elements,
            motion_time_s: work.motion_time_s,
            wall_time_s: work.wall_time_s,
            blocks_per_s: work.blocks as f64 / work.wall_time_s,
            threads: work.threads,
            cycles: work.cycles,
            cycles_judged: work.cycles_judged,
            cycles_over_limits: joints.iter().flat_map(|joint| joint.over).sum(),
            over_limits,
            beyond_travel,
            joints,
            tolerance_mm: work.tolerance_mm,
            deviation_max_mm: off_mm,
            missed_max_mm: missed_mm,
            over_run_mm: work.over_run_mm,
            path_length_mm: length_mm,
            path_reached_mm: reached_mm,
            starved_cycles: work.starved_cycles,
            given_up: work.given_up.map(|(line, fault)| GivenUp {
                line,
                why: fault.to_string(),
            }),
            feed: work.feed.clone(),
        }
    }

    /// What keeps the program from being run as it is, each with its line.
    pub(super) fn wrong(&self) -> Vec<(u32, String)> {
        let over = self.over_limits.iter().map(|over| (over.line, over.to_string()));
        let given_up = self
            .given_up
            .iter()
            .map(|given_up| (given_up.line, given_up.why.clone()));
        let beyond = self
            .beyond_travel
            .iter()
            .map(|beyond| (beyond.line, beyond.to_string()));
        over.chain(beyond).chain(given_up).collect()
    }

    /// In one line, for the head of a picture.
    pub(super) fn in_short(&self) -> String {
        format!(
            "{} blocks, {:.3} m, {:.3} s; planner {}; off the path by {:.4} mm at the most",
            self.blocks,
            self.path_length_mm / 1000.0,
            self.motion_time_s,
            self.planner,
            self.deviation_max_mm,
        )
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "planner         {}", self.planner)?;
        writeln!(f, "program         {} lines, {} blocks", self.lines, self.blocks)?;
        writeln!(f, "motion time     {:.3} s", self.motion_time_s)?;
        writeln!(
            f,
            "planned in      {:.3} s, {:.0} blocks/s, {} threads, {} elements",
            self.wall_time_s, self.blocks_per_s, self.threads, self.elements
        )?;
        for joint in &self.joints {
            let name = match joint.axis {
                Some(axis) => format!("joint {} ({axis})", joint.joint),
                None => format!("joint {}", joint.joint),
            };
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
        writeln!(f, "over limits     {} cycles", self.cycles_over_limits)?;
        if self.cycles_judged < self.cycles {
            writeln!(
                f,
                "judged          {} of {} cycles: of elements that take long, their ends and places on the way (all: --samples)",
                self.cycles_judged, self.cycles
            )?;
        }
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
        writeln!(
            f,
            "feed            reached in {:.1} % of the time at feed; {} stops on the way",
            self.feed.at_feed_share * 100.0,
            self.feed.stops
        )?;
        for place in &self.feed.slow_places {
            let axis = place.axis.map(|axis| format!(" ({axis})")).unwrap_or_default();
            writeln!(
                f,
                "slow place      line {} limited to {:.1} % of feed ({:.2} mm/s) by joint {}{axis} {} ({:.0} % of its limit)",
                place.line,
                place.feed_share * 100.0,
                place.speed_mm_s,
                place.joint,
                place.limit,
                place.limit_share * 100.0
            )?;
        }
        if let Some(given_up) = &self.given_up {
            writeln!(f, "given up        line {}: {}", given_up.line, given_up.why)?;
        }
        writeln!(f, "starved         {} cycles", self.starved_cycles)
    }
}
