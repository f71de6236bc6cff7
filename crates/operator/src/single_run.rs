//! One program from power-on to power-off, and its report.
//!
//! In:  a machine, a program, a wire. Out: the report of the run, on the terminal and in a folder.

use super::progress::Progress;
use super::report::{self, Facts, FarEnd};
use crate::operator_loop::{LoopTask, Running};
use crate::service::Service;
use crate::session;
use crate::session::{Program, Session, Task, Wire};
use anyhow::Context;
use config::{BusKind, Config};
use host::signals;
use host::signals::StopSignal;
use host::terminal::say;
use machine::tables::{Tables, lock};
use program::{Begin, check, doubts};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use terminal::refusal::Refusal;

/// What is to be done.
pub struct Job<'a> {
    pub config: &'a Config,
    pub program: Program<'a>,
    /// Folder for the report.
    pub out: &'a Path,
    /// Print the report as JSON and nothing else.
    pub json: bool,
    /// Asks for a stop.
    pub signal: StopSignal,
    /// What is served beside the socket.
    pub services: Vec<Box<dyn Service>>,
    /// Who measures at the far end of the wire, if somebody does.
    pub far_end: Option<Box<dyn FarEnd + 'a>>,
}

/// Runs a job and writes its report. The exit code says how it ended.
///
/// # Errors
/// What keeps it from starting, or its report from being written.
pub fn run_and_report(job: Job<'_>, wire: Wire) -> anyhow::Result<ExitCode> {
    let Job {
        config, program, out, ..
    } = job;
    // A long program is checked for minutes: what is in the way is told before.
    session::check_free(config, &wire)?;
    report::check(out)?;
    let tables = Tables::read(config).map_err(|error| Refusal::from(error).nothing_moved())?;
    let tables = Mutex::new(tables);
    let begin = Begin::at_home(config);
    let checked = check(
        config,
        &lock(&tables),
        program.name,
        program.text,
        &begin,
        job.signal.cancel(),
    );
    let overview = match checked {
        Ok(overview) => overview,
        Err(errors) if errors.is_cancelled() => return Ok(given_up(&job.signal)),
        Err(errors) => return Err(Refusal::of_program(program.name, &errors).nothing_moved().into()),
    };
    report::prepare(out)?;
    if !job.json {
        say(&format!(
            "{}: {} lines, {} of motion; {}homing comes before it\n",
            program.name,
            overview.lines,
            minutes(overview.time_s),
            if config.bus.kind == BusKind::None {
                ""
            } else {
                "start of the network and "
            },
        ));
    }
    if let Some((line, what)) = overview.real_time.warning() {
        files::errln!("{}:{line}: warning: {what}", program.name);
    }
    let (at, cancel) = (begin.at(), job.signal.cancel());
    for doubt in doubts(config, &lock(&tables), (program.name, program.text), at, cancel) {
        files::errln!("warning: {doubt}");
    }
    let session = Session {
        config,
        tables: &tables,
        task: Task::Once(program, &overview),
        quiet: job.json,
        signal: job.signal,
        keep_rights: false,
        services: job.services,
    };
    let mut progress = Progress::new(&overview, job.json);
    let ended = session::run(&session, wire, &mut progress)?;
    drop(progress);
    let mut far_end = job.far_end;
    let soc_period = far_end.as_mut().and_then(|far_end| far_end.finish());
    let soc_picture = far_end.zip(soc_period.as_ref()).map(|(far_end, soc)| far_end.draw(soc));
    let facts = Facts {
        config,
        program: program.name,
        overview: overview.clone(),
        ended: &ended,
        soc_period,
    };
    let (report, mut pictures) = facts.report();
    pictures.soc_period = soc_picture.as_deref();
    // A full disk must not keep from the user how the program ended.
    let written = report::write(out, &report, &pictures);
    if job.json {
        say(&format!("{}\n", serde_json::to_string_pretty(&report)?));
    } else {
        say(&format!(
            "\n{report:#}\nreport                 {}\npictures               {}\n",
            out.display(),
            report::address(out)
        ));
    }
    written.context("the report could not be written")?;
    if ended.operator.needs_restart() {
        return Ok(ExitCode::from(session::EXIT_RESTART));
    }
    Ok(match (session.signal.caught(), report.run.result) {
        (Some(signal), _) if report.run.alarms.is_empty() => ExitCode::from(signals::exit_code(signal)),
        (None, protocol::Outcome::Completed) => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    })
}

/// A signal came while the program was checked.
fn given_up(signal: &StopSignal) -> ExitCode {
    files::errln!("isocnc: stopped while the program was checked; nothing was moved");
    signal
        .caught()
        .map_or(ExitCode::FAILURE, |signal| ExitCode::from(signals::exit_code(signal)))
}

/// A time as one says it.
fn minutes(time_s: f64) -> String {
    match time_s.round() as u64 {
        seconds @ 0..100 => format!("{seconds} s"),
        seconds => format!("{} min {} s", seconds / 60, seconds % 60),
    }
}

/// Where there is one.
impl LoopTask for Option<Progress> {
    fn tick(&mut self, running: &mut Running, now_ns: u64) {
        if let Some(progress) = self {
            progress.tick(running, now_ns);
        }
    }
}

impl LoopTask for Progress {
    fn tick(&mut self, running: &mut Running, _now_ns: u64) {
        self.show(&mut running.operator);
    }
}
