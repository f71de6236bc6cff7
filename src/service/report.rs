//! The report of a run: one structure, printed for people and written as JSON.
//!
//! In:  what the operator, the recorder, the bus and the analyser at the far end know at the end.
//! Out: `run.json`, `toolpath.svg`, `soc-period.svg` in the output folder; a summary for the terminal.

use super::analyser::SocPeriod;
use super::operator::{Alarm, Entry};
use crate::bus::NodeStatistics;
use crate::rt::setup::Finding;
use serde::Serialize;
use std::fmt;

/// Everything there is to say of a run.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// Name of the machine.
    pub machine: String,
    /// Path of the program.
    pub program: String,
    /// `completed`, `stopped`, `faulted` or `timed out`.
    pub result: String,
    /// Why, if it did not complete.
    pub alarms: Vec<Alarm>,
    /// Seconds from the first cycle to OPERATIONAL of the whole network.
    pub operational_s: Option<f64>,
    /// Blocks of the program that were run.
    pub blocks_done: u32,
    /// Blocks of the program.
    pub blocks: u32,
    /// Seconds from the first to the last cycle of the program.
    pub motion_time_s: f64,
    /// Greatest distance between command and actual position of any joint, mm.
    pub following_error_max_mm: f64,
    /// Program line where that was.
    pub following_error_max_line: u32,
    /// Deviation from the programmed path; `None` where no path was recorded.
    pub deviation: Option<Deviation>,
    /// Peaks of the commanded positions, one per joint.
    pub peaks: Vec<JointPeaks>,
    /// Frames per node.
    pub nodes: Vec<NodeReport>,
    /// Cycles of the whole run.
    pub cycles: u64,
    /// Cycles left out because the thread came too late.
    pub cycles_skipped: u64,
    /// Worst lateness of a cycle that was not left out, µs.
    pub late_max_us: f64,
    /// SoC period at the far end of the wire, from kernel receive stamps.
    pub soc_period: Option<SocPeriod>,
    /// What this PC does not give to real time.
    pub findings: Vec<Finding>,
    /// What happened when.
    pub journal: Vec<Entry>,
}

/// Distance from the programmed path, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Deviation {
    /// Greatest distance of the commanded path.
    pub command_max_mm: f64,
    /// Greatest distance of the actual path.
    pub actual_max_mm: f64,
    /// What the program allows.
    pub tolerance_mm: f64,
}

/// Greatest differences of the commanded positions of one joint against its limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JointPeaks {
    /// mm/s
    pub velocity_mm_s: f64,
    /// mm/s²
    pub acceleration_mm_s2: f64,
    /// mm/s³
    pub jerk_mm_s3: f64,
    /// Greatest share of a limit that was used; 1 is the limit.
    pub use_max: f64,
    /// Cycles over a limit.
    pub over: u64,
}

/// Frames of one node.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NodeReport {
    /// Name in the machine file.
    pub name: String,
    /// Node id.
    pub id: u8,
    /// Polls.
    #[serde(flatten)]
    pub frames: NodeStatistics,
}

impl fmt::Display for RunReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "result                 {}", self.result)?;
        for alarm in &self.alarms {
            writeln!(f, "  alarm at {:8.3} s    {}", alarm.time_s, alarm.cause)?;
        }
        writeln!(
            f,
            "program                {}: {} of {} blocks, {:.1} s of motion",
            self.program, self.blocks_done, self.blocks, self.motion_time_s
        )?;
        if let Some(operational_s) = self.operational_s {
            writeln!(f, "network operational    after {operational_s:.2} s")?;
        }
        writeln!(
            f,
            "following error        {:.4} mm at most (line {})",
            self.following_error_max_mm, self.following_error_max_line
        )?;
        if let Some(deviation) = &self.deviation {
            writeln!(
                f,
                "deviation from path    commanded {:.4} mm, actual {:.4} mm, tolerance {:.4} mm",
                deviation.command_max_mm, deviation.actual_max_mm, deviation.tolerance_mm
            )?;
        }
        for (joint, peaks) in self.peaks.iter().enumerate() {
            writeln!(
                f,
                "joint {joint} peaks          {:8.2} mm/s  {:9.1} mm/s2  {:10.0} mm/s3   {:3.0} % of limit, {} over",
                peaks.velocity_mm_s,
                peaks.acceleration_mm_s2,
                peaks.jerk_mm_s3,
                peaks.use_max * 100.0,
                peaks.over
            )?;
        }
        writeln!(
            f,
            "cycles                 {}, {} left out, latest {:.1} us late",
            self.cycles, self.cycles_skipped, self.late_max_us
        )?;
        writeln!(f, "\nnode                       polled    answered    lost")?;
        for node in &self.nodes {
            writeln!(
                f,
                "{:>3} {:<16} {:>12} {:>11} {:>7}",
                node.id, node.name, node.frames.polls, node.frames.answers, node.frames.lost
            )?;
        }
        if let Some(soc_period) = &self.soc_period {
            writeln!(f, "\nSoC period at the far end of the wire (kernel receive stamps)\n{soc_period}")?;
        }
        Ok(())
    }
}
