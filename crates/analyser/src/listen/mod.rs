//! An analyser by itself: a PC that only listens, or a process that measures for another one.
//!
//! In:  an interface; Ctrl-C of a user, or orders of another process as lines on standard input.
//! Out: the figures as a table or JSON.
//!
//! Nothing is ever sent. At a network tap or at any port of the hub every frame of the network is heard; a switch would hold
//! back and reorder what is to be measured.

use super::{Analyser, FrameCounts, MICROMETRES_PER_US, Place, SocReport, StampSource, Window};
use anyhow::{Context, bail, ensure};
use host::signals::StopSignal;
use host::terminal::{StatusLine, say};
use std::fmt::Write as _;
use std::io::{BufRead, Write, stdin};
use std::process::ExitCode;
use std::time::Duration;

/// Printed once the interface is listened at.
pub const READY: &str = "ready";
/// The order to begin a window.
pub const BEGIN: &str = "begin";
/// The order to end it and to print its figures as one line of JSON.
pub const END: &str = "end";

/// Pause between two looks at what was measured.
const PAUSE: Duration = Duration::from_millis(100);
/// Pause between two lines of progress where the output is no terminal.
const PROGRESS: Duration = Duration::from_secs(10);
/// Without a SoC for this long the network was stopped, ns.
const STOPPED_NS: u64 = 1_000_000_000;
/// Periods from which the nominal cycle is told.
const FIRST_PERIODS: u64 = 100;
/// What a cycle is taken for until it is known better, µs.
const USUAL_CYCLE_US: u32 = 1000;

/// What a user wants measured.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// Interface to listen at.
    pub interface: String,
    /// Nominal period, µs; `None`: to be told from the first periods.
    pub cycle_us: Option<u32>,
    /// Number of periods after which to end; `None`: at Ctrl-C.
    pub cycles: Option<u64>,
    /// Print JSON and no progress.
    pub json: bool,
}

/// Listens until enough was heard or a signal ends it, and prints the figures.
///
/// # Errors
/// The interface cannot be listened at; no SoC was heard.
pub fn listen(wanted: &Wanted) -> anyhow::Result<ExitCode> {
    ensure!(wanted.cycle_us != Some(0), "a cycle of 0 µs: expected 1 or more");
    let signal = StopSignal::install().context("signals")?;
    let place = Place {
        interface: &wanted.interface,
        other_end: None,
        capture: None,
        hardware_stamps: true,
    };
    let window = Window::without_restarts(wanted.cycle_us.unwrap_or(USUAL_CYCLE_US));
    let mut analyser = Analyser::start_at(&place, window)?;
    let told = |text: &str| {
        if !wanted.json {
            say(text)
        }
    };
    told(&format!(
        "listening at {} for the frames that begin cycles: SoC of POWERLINK, FRMW beside LRW of EtherCAT; Ctrl-C ends\n",
        wanted.interface
    ));
    let cycle_us = match wanted.cycle_us {
        Some(cycle_us) => Some(cycle_us),
        None => find_cycle(&mut analyser, &signal)?,
    };
    let Some(cycle_us) = cycle_us else {
        bail!("{}", nothing_heard(&analyser.stop()?));
    };
    if wanted.cycle_us.is_none() {
        told(&format!(
            "cycle {cycle_us} µs, as the first periods are (else say --period-us)\n"
        ));
    }
    let periods_max = wanted.cycles.unwrap_or(u64::MAX);
    analyser.begin(Window {
        cycle_us,
        periods_max,
        restart_ns: STOPPED_NS,
    })?;
    let mut progress = StatusLine::new("{wide_msg}", PROGRESS, wanted.json);
    loop {
        let report = analyser.report()?;
        if progress.is_due() {
            progress.show(
                |bar| bar.set_message(files::printed::plain(&so_far(&report))),
                || so_far(&report),
            );
        }
        if signal.caught().is_some() || report.n >= periods_max {
            break;
        }
        std::thread::sleep(PAUSE);
    }
    let report = analyser.stop()?;
    drop(progress);
    if report.n == 0 {
        bail!("{}", nothing_heard(&report));
    }
    if wanted.json {
        say(&format!("{}\n", serde_json::to_string_pretty(&report)?));
    } else {
        say(&format!("\n{}\n", table(&report)));
    }
    Ok(ExitCode::SUCCESS)
}

/// Tells the nominal cycle from the first periods; `None`: a signal came before enough of them.
fn find_cycle(analyser: &mut Analyser, signal: &StopSignal) -> anyhow::Result<Option<u32>> {
    let mut taken_us = USUAL_CYCLE_US;
    // A quantile is the finer the nearer it is to nominal: once more with what was found, until that stays.
    loop {
        analyser.begin(Window::without_restarts(taken_us))?;
        let median_us = loop {
            if signal.caught().is_some() {
                return Ok(None);
            }
            let report = analyser.report()?;
            if report.n >= FIRST_PERIODS {
                break report.period_p50_us;
            }
            std::thread::sleep(PAUSE);
        };
        let found_us = round_cycle(median_us);
        if found_us == taken_us {
            return Ok(Some(found_us));
        }
        taken_us = found_us;
    }
}

/// The cycle that a median period stands for: to 50 µs where that is 2 % away at most, else to 1 µs.
fn round_cycle(median_us: f64) -> u32 {
    let round = (median_us / 50.0).round() * 50.0;
    let cycle_us = if (median_us - round).abs() <= 0.02 * median_us {
        round
    } else {
        median_us.round()
    };
    cycle_us.clamp(1.0, 4e9) as u32
}

fn nothing_heard(report: &SocReport) -> String {
    let SocReport { interface, frames, .. } = report;
    let seen = match (frames.soc, frames.of_bus(), frames.foreign) {
        (0, 0, 0) => "no frame at all".to_owned(),
        (0, 0, foreign) => format!("no frame of POWERLINK or EtherCAT, {foreign} others"),
        (0, of_bus, _) if frames.ethercat > 0 && frames.pres == of_bus => {
            format!("{of_bus} EtherCAT frames, all of them on their way back")
        }
        (0, _, _) if frames.preq > 0 && frames.ethercat > 0 => format!(
            "{} EtherCAT frames with process data, none with the time of a reference clock (FRMW, ARMW) by which the first one of a \
             cycle is known",
            frames.preq
        ),
        (0, of_bus, _) if frames.ethercat > 0 => {
            format!("{of_bus} EtherCAT frames, none with process data: the main device does not run cycles yet")
        }
        (0, powerlink, _) => {
            format!("no SoC, {powerlink} other POWERLINK frames: the managing node does not run cycles yet")
        }
        (soc, ..) => format!("{soc} {} only, too few to measure", report.begins()),
    };
    format!(
        "{interface}: {seen}. Listen at a network tap, or at a port of the hub of POWERLINK, where a control runs its cycles"
    )
}

/// The figures for people.
fn table(report: &SocReport) -> String {
    let mut text = String::new();
    let cells = |cells: [String; 5]| cells.map(|cell| format!("{cell:>12}")).concat();
    let head = |names: [&str; 5]| cells(names.map(str::to_owned));
    let us = |value: f64| format!("{value:.3}");
    let begins = report.begins();
    let title = format!("{begins} period at {}, µs", report.interface);
    let figures = [
        us(report.period_mean_us),
        us(report.period_range_us),
        us(report.period_std_us),
        report.n.to_string(),
        String::new(),
    ];
    let off = report.deviation;
    let quantiles = [off.p50_us, off.p99_us, off.p99_9_us, off.p99_99_us, off.max_us];
    let errors = quantiles.map(|us| us * MICROMETRES_PER_US);
    let rows = [
        (title, head(["mean", "max range", "std dev", "n", ""])),
        (format!("cycle {}", report.cycle_us), cells(figures)),
        (String::new(), String::new()),
        (
            "distance from nominal, µs".into(),
            head(["p50", "p99", "p99.9", "p99.99", "max"]),
        ),
        ("early or late".into(), cells(quantiles.map(us))),
        ("at 30 m/min, µm".into(), cells(errors.map(us))),
    ];
    for (name, cells) in rows {
        let _ = writeln!(text, "{}", format!("{name:<28}{cells}").trim_end());
    }
    let stamps = match (report.stamps, &report.why_not_hardware) {
        (StampSource::Hardware, _) => "of the network card".to_owned(),
        (StampSource::Kernel, None) => "of the kernel".to_owned(),
        (StampSource::Kernel, Some(why_not)) => format!("of the kernel; none of the network card: {why_not}"),
    };
    let frames = report.frames;
    let _ = write!(
        text,
        "\nmeasured for {:.1} s; {} gaps of at least 1.5 cycles, {} {begins} not sent\nstamps {stamps}\n{}",
        report.duration_s,
        report.breaks.overruns,
        report.breaks.soc_missing,
        counted(&frames),
    );
    let remarks = report.remarks();
    // The first of them says what stands above already.
    for remark in remarks.iter().skip(usize::from(report.breaks.overruns > 0)) {
        let _ = write!(text, "\n{remark}");
    }
    text
}

/// Frames by what they are.
fn counted(frames: &FrameCounts) -> String {
    let FrameCounts {
        soc,
        preq,
        pres,
        soa,
        asnd,
        other,
        foreign,
        ethercat,
    } = frames;
    match ethercat {
        0 => format!(
            "frames: {soc} SoC, {preq} PReq, {pres} PRes, {soa} SoA, {asnd} ASnd, {other} other POWERLINK, {foreign} not POWERLINK"
        ),
        _ => format!(
            "frames: {soc} begin a cycle, {preq} more with process data, {asnd} of services, {other} other EtherCAT,\n  {pres} on \
             their way back, {foreign} not EtherCAT"
        ),
    }
}

/// How it goes, as one line.
fn so_far(report: &SocReport) -> String {
    format!(
        "{:9.1} s  n {}  std dev {:.3} us  range {:.3} us  overruns {}",
        report.duration_s, report.n, report.period_std_us, report.period_range_us, report.breaks.overruns
    )
}

/// Measures for another process: prints [`READY`], then for each pair of lines [`BEGIN`] and [`END`] on standard input one
/// line of JSON, a [`SocReport`]. Ends when standard input is closed, which ends an open window too. Every gap counts as a
/// period.
///
/// # Errors
/// The interface cannot be listened at; an unknown order; nobody reads the answers.
pub fn serve(interface: &str, cycle_us: u32) -> anyhow::Result<ExitCode> {
    // Ctrl-C reaches all processes of a terminal; when to end is for the other process to say.
    let _signal = StopSignal::install().context("signals")?;
    let place = Place {
        interface,
        other_end: None,
        capture: None,
        hardware_stamps: true,
    };
    let window = Window::without_restarts(cycle_us);
    let mut analyser = Analyser::start_at(&place, window)?;
    take_orders(&mut analyser, window, stdin().lock(), files::printed::stdout())?;
    Ok(ExitCode::SUCCESS)
}

fn take_orders(
    analyser: &mut Analyser,
    window: Window,
    orders: impl BufRead,
    mut answers: impl Write,
) -> anyhow::Result<()> {
    writeln!(answers, "{READY}")?;
    answers.flush()?;
    let mut open = false;
    let mut answer = |analyser: &mut Analyser| -> anyhow::Result<()> {
        writeln!(answers, "{}", serde_json::to_string(&analyser.report()?)?)?;
        Ok(answers.flush()?)
    };
    for order in orders.lines() {
        match (order?.trim(), open) {
            (BEGIN, false) => analyser.begin(window)?,
            (BEGIN, true) => bail!("order '{BEGIN}': the last window is still open"),
            (END, true) => answer(analyser)?,
            (END, false) => bail!("order '{END}': nothing has begun"),
            (other, _) => bail!("order '{other}': expected '{BEGIN}' or '{END}'"),
        }
        open = !open;
    }
    if open {
        answer(analyser)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
