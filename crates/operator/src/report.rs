//! The report of a run: one structure, printed for people and written as JSON.
//!
//! In:  what the operator, the recorder, the bus and the analyser at the far end know at the end.
//! Out: `run.json`, `toolpath.svg`, `soc-period.svg` and `report.html`, which holds the pictures, in the output folder; a summary
//! for the terminal.

use crate::console::{Alarm, Operator, Warning};
use crate::session::Ended;
use analyser::SocReport;
use anyhow::Context;
use bus::NodeStatistics;
use config::{Config, Joint};
use host::calibrate::Calibration;
use host::terminal::{alarm, table};
use machine::journal::Entry;
use machine::sequence::Outcome;
use motion::rt::Peaks;
use plot::PathSample;
use program::Overview;
use program::real_time::RealTimeFactor;
use rt::cycle_stats::FiguresSummary;
use rt::phase::sync0_us;
use rt::timeout;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

/// Whoever measures at the far end of the wire.
pub trait FarEnd {
    /// Ends the measurement; `None` if there is none to be had.
    fn finish(&mut self) -> Option<SocReport>;

    /// Its picture, as SVG.
    fn draw(&self, soc_period: &SocReport) -> String;
}

/// What pictures are drawn of; kept out of the report itself.
#[derive(Clone, Copy, Debug)]
pub struct Pictures<'a> {
    /// Samples of the program.
    pub samples: &'a [PathSample],
    /// Time from one to the next, s.
    pub sample_s: f64,
    /// Period of the SoC at the far end, as it was drawn.
    pub soc_period: Option<&'a str>,
}

/// Everything that is known at the end of a run.
pub struct Facts<'a> {
    pub config: &'a Config,
    /// Name of the program.
    pub program: &'a str,
    /// What the whole program comes to.
    pub overview: Overview,
    /// The control after the run.
    pub ended: &'a Ended,
    /// Measured at the far end of the wire.
    pub soc_period: Option<SocReport>,
}

impl<'a> Facts<'a> {
    /// The report, and what its pictures are drawn of.
    pub fn report(self) -> (RunReport, Pictures<'a>) {
        let Ended {
            operator,
            probed_time_s,
            figures,
            peaks,
            statistics,
            timeouts,
            cpu: _,
            kept_awake: _,
            findings,
            calibration,
        } = self.ended;
        let recorder = &operator.recorder;
        let run = ProgramReport::new(
            self.config,
            operator,
            self.program,
            &self.overview,
            *probed_time_s,
            operator.outcome(),
            operator.warnings().to_vec(),
        );
        let motion_time_s = run.motion_time_s;
        let report = RunReport {
            machine: self.config.name.clone(),
            run,
            operational_s: operator.operational_s(),
            peaks: peaks
                .iter()
                .zip(&self.config.joints)
                .map(|(peaks, joint)| JointPeaks::new(peaks, joint))
                .collect(),
            nodes: self
                .config
                .bus
                .nodes
                .iter()
                .zip(statistics)
                .map(|(node, frames)| NodeReport {
                    name: node.name.clone(),
                    id: node.id,
                    frames: *frames,
                })
                .collect(),
            cycle: figures.summary(),
            sync0_us: sync0_us(self.config),
            timeout_thread: *timeouts,
            soc_period: self.soc_period,
            findings: findings.iter().map(ToString::to_string).collect(),
            calibration: calibration.clone(),
            journal: operator.journal().to_vec(),
        };
        (
            report,
            Pictures {
                samples: recorder.samples(),
                sample_s: motion_time_s / recorder.samples().len().max(1) as f64,
                soc_period: None,
            },
        )
    }
}

/// Files of a report.
const RUN: &str = "run.json";
const TOOLPATH: &str = "toolpath.svg";
const SOC_PERIOD: &str = "soc-period.svg";
const PAGE: &str = "report.html";
/// What a measurement at the far end is handed over in.
pub const SOC_PERIOD_DATA: &str = "soc-period.json";

/// Makes the folder of a report ready before anything moves: it can be written, and holds no file of an earlier run that
/// would pass for one of this run.
///
/// # Errors
/// What the file system refuses.
pub fn prepare(folder: &Path) -> anyhow::Result<()> {
    prepare_for(folder, &[RUN, TOOLPATH, SOC_PERIOD, SOC_PERIOD_DATA, PAGE])
}

/// Whether a report could be written there, long before it is; nothing is made.
///
/// # Errors
/// What is in the way.
pub fn check(folder: &Path) -> anyhow::Result<()> {
    // What is missing will be made in the nearest folder that is there.
    let there = folder.ancestors().find(|path| path.exists()).unwrap_or(Path::new(""));
    files::check(&there.join(RUN)).with_context(|| folder.display().to_string())
}

/// As [`prepare`], for files of these names.
///
/// # Errors
/// What the file system refuses.
pub fn prepare_for(folder: &Path, names: &[&str]) -> anyhow::Result<()> {
    files::make_folder(folder).with_context(|| folder.display().to_string())?;
    for name in names {
        let path = folder.join(name);
        // Made and taken away again: what cannot be written is known before anything moves.
        let gone = files::write(&path, "").and_then(|()| files::remove(&path));
        gone.with_context(|| path.display().to_string())?;
    }
    Ok(())
}

/// Writes `run.json`, the pictures and the page that shows them into a folder, which is made if it is not there.
///
/// # Errors
/// What the file system refuses.
pub fn write(folder: &Path, report: &RunReport, pictures: &Pictures<'_>) -> anyhow::Result<()> {
    let put = |name: &str, text: String| {
        let path = folder.join(name);
        files::write(&path, text).with_context(|| path.display().to_string())
    };
    files::make_folder(folder).with_context(|| folder.display().to_string())?;
    put(RUN, serde_json::to_string_pretty(report)?)?;
    let title = format!("{} on {}", report.run.program, report.machine);
    let mut drawn = Vec::new();
    if !pictures.samples.is_empty() {
        drawn.push((
            TOOLPATH,
            plot::toolpath_svg(&title, pictures.samples, pictures.sample_s),
        ));
    }
    if let Some(soc_period) = pictures.soc_period {
        drawn.push((SOC_PERIOD, soc_period.to_owned()));
    }
    for (name, svg) in &drawn {
        put(name, svg.clone())?;
    }
    let drawn: Vec<String> = drawn.into_iter().map(|(_, svg)| svg).collect();
    put(PAGE, plot::html(&title, &report.to_string(), &drawn))
}

/// The address of the page in a folder, for a browser.
pub fn address(folder: &Path) -> String {
    let path = folder.join(PAGE);
    let path = std::path::absolute(&path).unwrap_or(path);
    let mut address = String::from("file://");
    for octet in path.as_os_str().as_bytes() {
        match octet {
            b'/' | b'-' | b'.' | b'_' | b'~' => address.push(char::from(*octet)),
            octet if octet.is_ascii_alphanumeric() => address.push(char::from(*octet)),
            octet => address.push_str(&format!("%{octet:02X}")),
        }
    }
    address
}

/// What a program did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProgramReport {
    /// Path of the program.
    pub program: String,
    /// How it ended.
    pub result: protocol::Outcome,
    /// The step that took too long, if one did.
    pub timed_out_step: Option<protocol::Step>,
    /// Why, if it did not complete.
    pub alarms: Vec<Alarm>,
    /// What was wrong without stopping it.
    pub warnings: Vec<Warning>,
    /// Last line of the program that was run.
    pub line_reached: u32,
    /// Last line of the program with something to do.
    pub lines: u32,
    /// Seconds that the program was planned to take; its probing moves, and what follows them, as far as they really went.
    pub planned_time_s: f64,
    /// How much quicker than motion it was planned when it was checked.
    pub real_time_factor: RealTimeFactor,
    /// Seconds that it took, holds and waits included.
    pub motion_time_s: f64,
    /// Cycles of this in which the machine stood because its plan came late.
    pub starved_cycles: u64,
    /// Greatest distance between command and actual position of any joint, mm.
    pub following_error_max_mm: f64,
    /// Program line where that was.
    pub following_error_max_line: u32,
    /// Deviation from the programmed path; `None` where no path was recorded.
    pub deviation: Option<Deviation>,
}

impl ProgramReport {
    /// Of the program that the records of this operator are of. `warnings`: those of its time.
    pub fn new(
        config: &Config,
        operator: &Operator,
        name: &str,
        overview: &Overview,
        probed_time_s: Option<f64>,
        outcome: Option<Outcome>,
        warnings: Vec<Warning>,
    ) -> ProgramReport {
        let recorder = &operator.recorder;
        let (following_error_max_mm, following_error_max_line) = recorder.following_error_max();
        ProgramReport {
            program: name.into(),
            result: outcome.unwrap_or(Outcome::Faulted).code(),
            timed_out_step: match outcome {
                Some(Outcome::TimedOut(step)) => Some(step.code(true)),
                _ => None,
            },
            alarms: operator.alarms_of_program().to_vec(),
            warnings,
            line_reached: recorder.line(),
            lines: overview.lines,
            planned_time_s: probed_time_s.unwrap_or(overview.time_s),
            real_time_factor: overview.real_time,
            motion_time_s: recorder.cycles() as f64 * f64::from(config.cycle_us) * 1e-6,
            starved_cycles: recorder.starved_cycles(),
            following_error_max_mm,
            following_error_max_line,
            deviation: recorder.deviation(),
        }
    }
}

/// Everything there is to say of a run.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// Name of the machine.
    pub machine: String,
    /// What the program did.
    #[serde(flatten)]
    pub run: ProgramReport,
    /// Seconds from the first cycle to OPERATIONAL of the whole network.
    pub operational_s: Option<f64>,
    /// Peaks of the commanded positions, one per joint.
    pub peaks: Vec<JointPeaks>,
    /// Frames per node.
    pub nodes: Vec<NodeReport>,
    /// How the cycle thread ran, by its own clock.
    pub cycle: FiguresSummary,
    /// So long after the date of a cycle SYNC0 comes, us; `None`: no node follows one.
    pub sync0_us: Option<f64>,
    /// What the time-out thread counted.
    pub timeout_thread: timeout::Counters,
    /// SoC period at the far end of the wire, from kernel receive stamps.
    pub soc_period: Option<SocReport>,
    /// What this PC does not give to real time.
    pub findings: Vec<String>,
    /// The timing: who chose it, and what was measured for it.
    pub calibration: Calibration,
    /// What happened when.
    pub journal: Vec<Entry>,
}

/// Distance from the programmed path, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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

impl JointPeaks {
    fn new(peaks: &Peaks, joint: &Joint) -> JointPeaks {
        let [velocity_mm_s, acceleration_mm_s2, jerk_mm_s3] = peaks.of_order;
        let limits = &joint.limits;
        let uses = [
            velocity_mm_s / limits.velocity_mm_s,
            acceleration_mm_s2 / limits.acceleration_mm_s2,
            jerk_mm_s3 / limits.jerk_mm_s3,
        ];
        JointPeaks {
            velocity_mm_s,
            acceleration_mm_s2,
            jerk_mm_s3,
            use_max: uses.into_iter().fold(0.0, f64::max),
            over: peaks.over.iter().sum(),
        }
    }
}

/// Frames of one node.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NodeReport {
    /// Name in the machine file.
    pub name: String,
    pub id: u8,
    #[serde(flatten)]
    pub frames: NodeStatistics,
}

/// A summary; with `{:#}` for a terminal, alarms in red.
impl fmt::Display for ProgramReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.timed_out_step {
            Some(step) => writeln!(f, "result                 {}: {step}", self.result)?,
            None => writeln!(f, "result                 {}", self.result)?,
        }
        for Alarm { time_s, cause } in &self.alarms {
            let told = format!("  alarm at {time_s:8.3} s    {cause}");
            match f.alternate() {
                true => writeln!(f, "{}", alarm(told))?,
                false => writeln!(f, "{told}")?,
            }
        }
        for warning in &self.warnings {
            let times = match warning.times {
                1 => "once".into(),
                times => format!("{times} times"),
            };
            writeln!(f, "  {:<21}{}", format!("warned {times}"), warning.cause)?;
        }
        writeln!(
            f,
            "program                {}: line {} of {}, {:.2} s ({:.2} s planned)",
            self.program, self.line_reached, self.lines, self.motion_time_s, self.planned_time_s
        )?;
        writeln!(f, "waited for the plan    {} cycles", self.starved_cycles)?;
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
        Ok(())
    }
}

/// A summary; with `{:#}` for a terminal, alarms in red.
impl fmt::Display for RunReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.run.fmt(f)?;
        if let Some(operational_s) = self.operational_s {
            writeln!(f, "network operational    after {operational_s:.2} s")?;
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
            "cycles                 {}, {} left out, {} answers lost; begun {:.1} us late on average, {:.1} at most",
            self.cycle.cycles,
            self.cycle.skipped,
            self.cycle.pres_lost,
            self.cycle.lateness.mean_us,
            self.cycle.lateness.max_us,
        )?;
        writeln!(
            f,
            "time of a cycle        exchange {:.1} us (at most {:.1}), computing {:.1} us ({:.1}), free {:.1} us (at least {:.1})",
            self.cycle.exchange.mean_us,
            self.cycle.exchange.max_us,
            self.cycle.compute.mean_us,
            self.cycle.compute.max_us,
            self.cycle.free.mean_us,
            self.cycle.free.min_us,
        )?;
        if let Some(phase) = &self.cycle.phase {
            let (from, of) = match self.sync0_us {
                Some(sync0_us) => ("SYNC0", sync0_us - phase.mean_us),
                None => ("their times by the clock of the bus", -phase.mean_us),
            };
            writeln!(
                f,
                "phase to the bus       cycles begin {of:.2} us before {from}, std {:.2} us, range {:.2} us",
                phase.std_us, phase.range_us
            )?;
        }
        if let Some(raised_us) = self.calibration.spin_raised_us {
            writeln!(
                f,
                "spin                   raised from {} to {raised_us} us: wake-ups came later than at the start",
                self.calibration.spin_us.value
            )?;
        }
        let rows = self.nodes.iter().map(|node| {
            let frames = &node.frames;
            let counts = [frames.polls, frames.answers, frames.lost].map(|count| count.to_string());
            [vec![node.id.to_string(), node.name.clone()], counts.into()].concat()
        });
        write!(
            f,
            "\n{}",
            table(&[">node", "name", ">polled", ">answered", ">lost"], rows)
        )?;
        if let Some(soc_period) = &self.soc_period {
            writeln!(
                f,
                "\nSoC period at the far end of the wire (kernel receive stamps)\n{soc_period}"
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_rid_of_earlier_reports_and_of_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a/b");
        prepare(&out).unwrap();
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 0);
        for name in [RUN, TOOLPATH, SOC_PERIOD, SOC_PERIOD_DATA, PAGE, "machine.toml"] {
            std::fs::write(out.join(name), "old").unwrap();
        }
        prepare(&out).unwrap();
        let left: Vec<_> = std::fs::read_dir(&out)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        assert_eq!(left, ["machine.toml"]);
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("taken");
        std::fs::write(&file, "").unwrap();
        assert!(prepare(&file).unwrap_err().to_string().contains("taken"));
        std::fs::create_dir(folder.path().join(RUN)).unwrap();
        assert!(prepare(folder.path()).unwrap_err().to_string().contains(RUN));
    }

    #[test]
    fn an_address_is_one_that_a_browser_understands() {
        assert_eq!(
            address(Path::new("/tmp/my out#1/ä")),
            "file:///tmp/my%20out%231/%C3%A4/report.html"
        );
        assert!(address(Path::new("out")).starts_with("file:///"));
    }
}
