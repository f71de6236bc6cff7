//! What an analyser has measured.
//!
//! In:  the counts and figures of a [measurement](super::tally).
//! Out: [`SocReport`], to be printed, stored as JSON or drawn.

use host::histogram::{Bucket, Summary};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Frames by type of message, in the words of POWERLINK. Of EtherCAT, `soc` begins a cycle, `preq` is one more with process data, `pres`
/// is on its way back, `asnd` is one of services.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameCounts {
    /// Start of cycle.
    pub soc: u64,
    pub preq: u64,
    pub pres: u64,
    /// Start of the asynchronous phase.
    pub soa: u64,
    pub asnd: u64,
    /// Frames of the bus of other types.
    pub other: u64,
    /// Frames that are not of the bus; on a wire of its own there are none.
    pub foreign: u64,
    /// Of all these, frames of EtherCAT.
    #[serde(default)]
    pub ethercat: u64,
}

impl FrameCounts {
    /// Frames of the bus.
    pub fn of_bus(&self) -> u64 {
        self.soc + self.preq + self.pres + self.soa + self.asnd + self.other
    }
}

/// Whose clock stamped the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StampSource {
    /// The kernel, when its driver handed the frame over.
    #[default]
    Kernel,
    /// The network card, when the frame came off the wire.
    Hardware,
}

/// What does not follow in the order of cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Breaks {
    /// Periods of one and a half cycles and more: the managing node left out at least one SoC.
    pub overruns: u64,
    /// SoC missing in them.
    pub soc_missing: u64,
    /// Gaps that were taken for a network stopped and started; they are not among the periods.
    pub restarts: u64,
    /// Longest of these gaps, µs.
    pub restart_longest_us: f64,
    /// Steps of the clock that stamps, each of which cost a few periods that were not measured.
    pub clock_steps: u64,
}

impl Breaks {
    /// In sentences; `begins`: what the frame that begins a cycle is called.
    fn remarks(&self, begins: &str) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.overruns > 0 {
            let (gaps, missing) = (counted(self.overruns, "gap"), counted(self.soc_missing, begins));
            remarks.push(format!("{gaps} of at least 1.5 cycles: {missing} not sent"));
        }
        if self.restarts > 0 {
            let times = match self.restarts {
                1 => "once".to_owned(),
                times => format!("{times} times"),
            };
            let longest_s = self.restart_longest_us * 1e-6;
            remarks.push(format!(
                "the {begins} paused {times}, {longest_s:.3} s at most: not among the periods"
            ));
        }
        if self.clock_steps > 0 {
            remarks.push(format!(
                "the clock was stepped {} times; the periods around that were skipped",
                self.clock_steps
            ));
        }
        remarks
    }
}

/// What was measured. Times in µs where the name says nothing else.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SocReport {
    pub interface: String,
    pub cycle_us: u32,
    /// Whose receive stamps were used.
    pub stamps: StampSource,
    /// Why not the network card's, if they are the kernel's.
    pub why_not_hardware: Option<String>,
    /// From the first SoC to the last, s.
    pub duration_s: f64,
    /// Number of periods.
    pub n: u64,
    pub period_mean_us: f64,
    pub period_std_us: f64,
    pub period_min_us: f64,
    pub period_max_us: f64,
    /// Longest minus shortest.
    pub period_range_us: f64,
    /// Half of the periods are no longer.
    pub period_p50_us: f64,
    /// 99 % are no longer.
    pub period_p99_us: f64,
    /// 99.9 % are no longer.
    pub period_p99_9_us: f64,
    /// 99.99 % are no longer.
    pub period_p99_99_us: f64,
    /// How far periods are from nominal, to either side.
    pub deviation: Summary,
    /// What was no period.
    #[serde(flatten)]
    pub breaks: Breaks,
    /// Frames seen, both directions.
    pub frames: FrameCounts,
    /// Frames that the socket could not hold; above 0 some periods are wrong.
    pub frames_dropped: u64,
    /// Frames without a receive stamp, which the kernel leaves out for a moment after the start; measured are the others.
    pub frames_unstamped: u64,
    /// Width of an interval of `interval_maxima_us`, s.
    pub interval_s: f64,
    /// Longest period of each interval since the first SoC; 0 where there was none.
    pub interval_maxima_us: Vec<f64>,
    /// Periods as deviations from nominal.
    pub histogram: Vec<Bucket>,
}

impl SocReport {
    /// What the frame that begins a cycle is called.
    pub fn begins(&self) -> &'static str {
        match self.frames.ethercat {
            0 => "SoC",
            _ => "cycle frame",
        }
    }

    /// Everything that a reader of the figures has to know beside them, in sentences.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = self.breaks.remarks(self.begins());
        if self.frames_dropped > 0 {
            remarks.push(format!(
                "{} frames were not seen for lack of room: some periods are wrong",
                self.frames_dropped
            ));
        }
        remarks
    }
}

/// Way of a joint at 30 m/min, the rapid speed of a fast machine, in a microsecond: what a set-point that is taken early or late
/// is off its place.
pub const MICROMETRES_PER_US: f64 = 0.5;

/// `1 gap`, `2 gaps`, `3 SoC`.
fn counted(count: u64, what: &str) -> String {
    let plural = if count == 1 || what == "SoC" { "" } else { "s" };
    format!("{count} {what}{plural}")
}

impl fmt::Display for SocReport {
    /// The table in the form in which such measurements are published.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let title = format!("{} period at {}, µs", self.begins(), self.interface);
        writeln!(
            f,
            "{title:<28} {:>12} {:>12} {:>12} {:>12}",
            "mean", "max range", "std dev", "n"
        )?;
        write!(
            f,
            "{:<28} {:>12.3} {:>12.3} {:>12.3} {:>12}",
            format!("cycle {}", self.cycle_us),
            self.period_mean_us,
            self.period_range_us,
            self.period_std_us,
            self.n
        )?;
        for remark in self.remarks() {
            write!(f, "\n{remark}")?;
        }
        Ok(())
    }
}
