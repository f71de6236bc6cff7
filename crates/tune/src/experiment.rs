//! A program that is run to measure: from power-on to power-off, asked for before, with one joint under the eye.
//!
//! In:  a machine file, a joint, moves. Out: the record of that joint.

use crate::analysis::record::Record;
use anyhow::{Context, bail, ensure};
use clap::Args;
use config::{Config, Joint};
use host::signals::{StopSignal, exit_code};
use host::terminal::say;
use machine::sequence::Outcome;
use machine::state::State;
use machine::tables::{Tables, TablesError, lock};
use motion::kinematics::Transform;
use operator::measurements;
use operator::operator_loop::{LoopTask, Running};
use operator::progress::Progress;
use operator::recorder::JOINT_SAMPLES_MAX;
use operator::session::{self, Ended, Program, Session, Task, Wire};
use program::text::Reader;
use program::{Begin, check};
use rt::shared::Command;
use rt::waiting::Waiting;
use std::io::{BufRead, IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;
use terminal::refusal::Refusal;

/// What all measurements of one joint are asked.
#[derive(Clone, Debug, Args)]
pub(super) struct JointArgs {
    /// Machine file.
    machine: PathBuf,
    /// The joint that moves
    #[arg(long, value_name = "N")]
    pub(super) joint: usize,
    /// Place from which it sets out, mm in the machine [default: so that the middle of its way is that of its travel]
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    from: Option<f64>,
    /// Folder for the picture and the figures
    #[arg(long, default_value = "isocnc-out")]
    pub(super) out: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
    /// Do not ask before the machine moves
    #[arg(long)]
    yes: bool,
}

impl JointArgs {
    /// # Errors
    /// A machine file with errors; a joint that is none, or that no axis moves alone.
    pub(super) fn read(&self) -> anyhow::Result<Config> {
        let config = bus::read(&self.machine).map_err(Refusal::from)?;
        let joints = config.joints.len();
        ensure!(
            self.joint < joints,
            Refusal::usage(format_args!(
                "--joint {}: {} has {joints} joints, from 0 on",
                self.joint, config.name
            ))
        );
        letter(&config, self.joint)?;
        Ok(config)
    }

    /// Both ends of the way, mm in the machine.
    ///
    /// # Errors
    /// A way that leaves the soft limits.
    pub(super) fn way(&self, joint: &Joint, distance_mm: f64) -> anyhow::Result<[f64; 2]> {
        let [low, high] = joint.travel_mm;
        let from_mm = self.from.unwrap_or(f64::midpoint(low, high) - distance_mm / 2.0);
        let way = [from_mm, from_mm + distance_mm];
        let is_within = way.iter().all(|end| (low..=high).contains(end));
        ensure!(
            is_within,
            Refusal::usage(format_args!(
                "from {from_mm} to {} mm: must lie within the soft limits of the joint, {low} to {high}",
                way[1]
            ))
        );
        Ok(way)
    }
}

/// A number above 0 and up to `most`.
///
/// # Errors
/// It is none.
pub(super) fn within(name: &str, value: f64, most: f64) -> anyhow::Result<f64> {
    ensure!(
        value > 0.0 && value <= most,
        Refusal::usage(format_args!("{name} {value}: must be above 0, and {most} at the most"))
    );
    Ok(value)
}

/// The letter of the axis that is this joint.
///
/// # Errors
/// There is none.
pub(super) fn letter(config: &Config, joint: usize) -> anyhow::Result<char> {
    let is_axis = matches!(config.kinematics().transform(), Transform::Trivial);
    let map = config.axes.iter().find(|map| map.joints.contains(&joint));
    match map {
        Some(map) if is_axis && map.joints.len() > 1 => bail!(
            "joint {joint}: moves axis {} together with others, which one joint cannot be told apart from",
            map.axis.letter()
        ),
        Some(map) if is_axis => Ok(map.axis.letter()),
        _ => bail!(
            "joint {joint}: is no axis of its own, as the kinematics of {} move several joints together",
            config.name
        ),
    }
}

/// What a program of one joint does.
pub(super) struct Plan {
    /// For messages.
    pub(super) name: &'static str,
    pub(super) text: String,
    /// What the machine will do, for whoever is asked.
    pub(super) moves: String,
    /// What makes it shorter, for whoever has asked for too much.
    pub(super) shorter: &'static str,
}

/// Asked where the program rests at M0: `true` goes on, `false` ends it.
pub(super) type Pause<'a> = &'a mut dyn FnMut(&Record) -> anyhow::Result<bool>;

/// Runs a plan and gives the record of its joint; `None`: nobody wanted it, or it was stopped, which the code says.
///
/// # Errors
/// What keeps it from being run to its end.
pub(super) fn measure(
    args: &JointArgs,
    config: &Config,
    plan: &Plan,
    pause: Option<Pause<'_>>,
) -> anyhow::Result<Result<Record, ExitCode>> {
    if !args.yes && !agreed(&plan.moves)? {
        return Ok(Err(ExitCode::FAILURE));
    }
    let mut watch = Watch {
        joint: args.joint,
        cycle_s: f64::from(config.cycle_us) * 1e-6,
        shorter: plan.shorter,
        pause,
        paused: false,
        failed: None,
        skipped: None,
        skipped_meanwhile: 0,
        progress: None,
    };
    let ended = match run(config, plan.name, &plan.text, args.json, &mut watch) {
        // What was found wrong meanwhile is the cause.
        Err(error) => return Err(watch.failed.take().unwrap_or(error)),
        Ok(Err(code)) => return Ok(Err(code)),
        Ok(Ok(ended)) => ended,
    };
    if let Some(error) = watch.failed {
        return Err(error);
    }
    if watch.skipped_meanwhile > 0 {
        files::errln!(
            "warning: this PC left out {} cycles on the way, in which nothing was measured: figures of time are that much wrong",
            watch.skipped_meanwhile
        );
    }
    let record = Record::new(ended.operator.recorder.joint_samples(), watch.cycle_s)?;
    Ok(Ok(record))
}

/// Whether somebody at the terminal agrees to what is going to move.
pub(super) fn agreed(moves: &str) -> anyhow::Result<bool> {
    let input = std::io::stdin();
    ensure!(
        input.is_terminal(),
        "{moves}\nnobody is there to be asked whether the machine may move; --yes says that it may"
    );
    let _ = write!(files::printed::stderr(), "{moves}\nIs the way free? [y/N] ");
    let mut answer = String::new();
    input.lock().read_line(&mut answer)?;
    let agreed = matches!(answer.trim(), "y" | "Y" | "yes");
    if !agreed {
        files::errln!("nothing was moved");
    }
    Ok(agreed)
}

/// Looks on while a program is run.
pub(super) trait Onlooker: LoopTask {
    /// Whether a program of this time may be run; nothing has moved.
    ///
    /// # Errors
    /// It may not.
    fn allows(&self, _time_s: f64) -> anyhow::Result<()> {
        Ok(())
    }

    /// The program is going to be run.
    fn begin(&mut self, progress: Progress);
    /// It is over.
    fn end(&mut self);
}

/// Runs a program from power-on to power-off; the code says where it was stopped.
///
/// # Errors
/// What keeps it from being run to its end.
pub(super) fn run(
    config: &Config,
    name: &str,
    text: &str,
    quiet: bool,
    onlooker: &mut dyn Onlooker,
) -> anyhow::Result<Result<Ended, ExitCode>> {
    let signal = StopSignal::install().context("signals")?;
    let tables = tables(config).map_err(|error| Refusal::from(error).nothing_moved())?;
    let tables = Mutex::new(tables);
    let reader = Reader::from(text.as_bytes());
    let checked = check(
        config,
        &lock(&tables),
        name,
        reader,
        &Begin::at_home(config),
        signal.cancel(),
    );
    let overview = match (checked, signal.caught()) {
        (Ok(overview), _) => overview,
        (Err(_), Some(signal)) => {
            say("stopped while the program was checked; nothing was moved\n");
            return Ok(Err(ExitCode::from(exit_code(signal))));
        }
        (Err(errors), None) => return Err(Refusal::of_program(name, &errors).nothing_moved().into()),
    };
    onlooker
        .allows(overview.time_s)
        .map_err(|error| Refusal::of_file(name, error).nothing_moved())?;
    let wire = match config.bus.kind {
        kind if kind.has_interface() => Wire::Interface(config.bus.interface.clone()),
        _ => Wire::Memory,
    };
    let session = Session {
        config,
        tables: &tables,
        task: Task::Once(Program { name, text: reader }, &overview),
        quiet,
        signal,
        keep_rights: false,
        services: Vec::new(),
    };
    onlooker.begin(Progress::new(&overview, quiet));
    let mut task = Forward(onlooker);
    let ended = session::run(&session, wire, &mut task);
    task.0.end();
    let ended = ended?;
    if ended.operator.outcome() == Some(Outcome::Completed) {
        return Ok(Ok(ended));
    }
    if let Some(signal) = session.signal.caught() {
        say("stopped before the end\n");
        return Ok(Err(ExitCode::from(exit_code(signal))));
    }
    let why = ended.operator.journal().last();
    let why = why.map_or_else(String::new, |entry| entry.text.clone());
    Err(Refusal::of_file(name, format!("did not come to its end: {why}")).into())
}

/// Tools of the machine, and parameters of nobody: what is measured does not turn with the work, and nothing is left behind.
fn tables(config: &Config) -> Result<Tables, TablesError> {
    let mut bare = config.clone();
    (bare.program.parameter_file, bare.state_directory) = (None, None);
    bare.work_offsets = Default::default();
    Tables::read(&bare)
}

struct Forward<'a>(&'a mut dyn Onlooker);

impl LoopTask for Forward<'_> {
    fn tick(&mut self, running: &mut Running, now_ns: u64) {
        self.0.tick(running, now_ns);
    }
}

impl Onlooker for Option<Progress> {
    fn begin(&mut self, progress: Progress) {
        *self = Some(progress);
    }

    fn end(&mut self) {
        *self = None;
    }
}

/// Has one joint traced, and answers at M0.
struct Watch<'a> {
    joint: usize,
    cycle_s: f64,
    shorter: &'static str,
    pause: Option<Pause<'a>>,
    paused: bool,
    failed: Option<anyhow::Error>,
    /// Cycles left out when the program began.
    skipped: Option<u64>,
    skipped_meanwhile: u64,
    progress: Option<Progress>,
}

impl Onlooker for Watch<'_> {
    fn allows(&self, time_s: f64) -> anyhow::Result<()> {
        let cycles = (time_s / self.cycle_s).ceil();
        ensure!(
            cycles <= JOINT_SAMPLES_MAX as f64,
            "takes {time_s:.0} s, {cycles:.0} cycles, and a record holds {JOINT_SAMPLES_MAX}: {}",
            self.shorter
        );
        Ok(())
    }

    fn begin(&mut self, progress: Progress) {
        self.progress = Some(progress);
    }

    fn end(&mut self) {
        self.progress = None;
    }
}

impl LoopTask for Watch<'_> {
    fn tick(&mut self, running: &mut Running, now_ns: u64) {
        let operator = &mut running.operator;
        operator.shared().trace_joint(self.joint);
        operator.recorder.keep_joint();
        let live = operator.live();
        if live.state == State::Running {
            let before = *self.skipped.get_or_insert(live.cycles_skipped);
            self.skipped_meanwhile = live.cycles_skipped - before;
        }
        if live.waiting == Some(Waiting::Operator) && !self.paused {
            self.paused = true;
            let record = Record::new(operator.recorder.joint_samples(), self.cycle_s);
            let goes_on = record.and_then(|record| match &mut self.pause {
                Some(pause) => pause(&record),
                None => Ok(true),
            });
            match goes_on {
                Ok(true) => operator.give(Command::Resume),
                Ok(false) => operator.end(now_ns),
                Err(error) => {
                    self.failed = Some(error);
                    operator.end(now_ns);
                }
            }
        } else if live.waiting != Some(Waiting::Operator) {
            self.paused = false;
        }
        self.progress.tick(running, now_ns);
    }
}

/// Writes the figures and the picture of a measurement of a joint, and keeps them for the panel.
///
/// # Errors
/// What the file system refuses.
pub(super) fn write(
    args: &JointArgs,
    config: &Config,
    name: &str,
    figures: &serde_json::Value,
    picture: &str,
) -> anyhow::Result<()> {
    let figures = format!("{figures:#}\n");
    for (ending, text) in [("json", figures.as_str()), ("svg", picture)] {
        let path = args.out.join(format!("{name}.{ending}"));
        files::write(&path, text).with_context(|| path.display().to_string())?;
    }
    let of_joint = format!("{name}-{}", args.joint);
    measurements::keep(
        config.state_directory.as_deref(),
        &of_joint,
        &figures,
        picture,
        args.json,
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_that_would_have_no_end_is_refused_with_the_way_out() {
        let watch = Watch {
            joint: 0,
            cycle_s: 0.001,
            shorter: "a higher --low takes less",
            pause: None,
            paused: false,
            failed: None,
            skipped: None,
            skipped_meanwhile: 0,
            progress: None,
        };
        assert!(watch.allows(1000.0).is_ok());
        assert_eq!(
            watch.allows(1000.001).unwrap_err().to_string(),
            "takes 1000 s, 1000001 cycles, and a record holds 1000000: a higher --low takes less"
        );
    }

    #[test]
    fn a_measurement_does_not_turn_with_the_work_and_keeps_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let kept = "5220 1\n5221 7\n5230 30\n";
        std::fs::write(folder.path().join("own.var"), kept).unwrap();
        let text = include_str!("../../../configs/mill3-demo.toml")
            .replace("# parameter_file =", "parameter_file = \"own.var\" #");
        let config = config::parse(&text, &folder.path().join("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
        assert!(config.program.parameter_file.is_some());
        let value = |tables: &Tables, number: u16| {
            let found = tables.parameters().iter().find(|(known, _)| *known == number);
            found.map_or(0.0, |(_, value)| *value)
        };
        let of_work = Tables::read(&config).unwrap();
        assert_eq!([5221, 5230].map(|number| value(&of_work, number)), [7.0, 30.0]);
        let bare = tables(&config).unwrap();
        assert_eq!([5221, 5230].map(|number| value(&bare, number)), [0.0, 0.0]);
        assert_eq!(std::fs::read_to_string(folder.path().join("own.var")).unwrap(), kept);
    }
}
