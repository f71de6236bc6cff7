//! From the program file to the ring: interpretation and planning, outside real time.
//!
//! In:  program text; what the machine remembers; the machine position from which it starts.
//! Out: elements in the ring, as many as fit, until the program is planned; then what the program left to remember.
//!
//! Interpreter, smoothing and speeds are a pipeline: each in its own thread from `program.threads` on, with short queues of whole
//! batches between them; a full queue holds up the stage before it, and a stage that waits solves windows of the plan. The speeds
//! take call by call, regardless of the thread it comes from, so that one thread and many give the same bits. Compensation
//! stays with the interpreter, as programs read where it has led the tool (#5420). `isocnc plan --timeline FILE.svg` draws
//! which thread did what, and when.
//!
//! Memory does not grow with a program: a long text is in a temporary file as it was when it was read, and a planner that is
//! ten seconds ahead of the machine waits (`motion::ring`).
//!
//! | to learn | file |
//! |---|---|
//! | the stages before speeds | `stages.rs` |
//! | the look at a whole program before anything moves, within limits of lines, time and memory; a `Cancel` (signal, stop, client that has gone) ends it at once | `check.rs` |
//! | what the check leaves behind for the time still to come, found by how far the interpolation has come (`Interpolator::way`) | `outline.rs` |
//! | what is doubtful in a program | `doubts.rs` |
//! | how much faster than motion a program is planned, for `plan` and for each check before a run | `real_time.rs` |
//! | the text as it was when it was read; one that grows while it runs | `text.rs`; `growing.rs` |
//! | what the interpreter is told of a machine; the probing cycles of `programs/probing/`, found if no folder has a file of that name | `settings.rs` |
//! | touch-off and values set by hand, by the interpreter's own G10 | `change.rs` |
//! | where a program begins; a start in the middle; dry run; exact stops of single block | `begin.rs`; `from_line.rs`; `dry_run.rs`; `exact_stops.rs` |
//! | what a program waits for: a contact, an input, a user code | `waits.rs` |
//! | M100 to M199; what programs log. Both only if a program runs | `user_code.rs`; `records.rs` |
//! | the way of a program for a picture | `tool_path.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod begin;
mod change;
mod check;
mod doubts;
mod dry_run;
mod exact_stops;
mod feed_error;
mod from_line;
pub mod growing;
pub mod outline;
pub mod path;
pub mod real_time;
mod records;
mod settings;
mod stages;
pub mod text;
pub mod tool_path;
mod user_code;
pub mod waits;

pub use begin::{Begin, home};
pub use change::{Change, ToolChange, changed};
pub use check::{Overview, ProgramErrors, check, check_text, error_json};
use config::{self, Config};
pub use doubts::{Doubt, doubts};
use dry_run::DryRun;
pub use feed_error::FeedError;
pub use from_line::{approach, preview};
use gcode::{CheckLimits, PinReader};
use machine::motion_settings::plan_settings;
use machine::tables::Tables;
use motion::canon::{Position, Source};
use motion::element::Element;
use motion::plan::timeline::{Task, during};
use motion::plan::workers::Workers;
use motion::plan::{PathPlanner, PlanErrorKind, Programmed, Pumped, SpeedPlanner};
use motion::ring::Sink;
use motion::rt::probe::Answer;
use outline::Lead;
use path::{PathNews, ProgrammedPath};
use records::Sayings;
use rt::shared::RtStatus;
pub use settings::{interpreter_settings, modes_at_start, settings_with};
pub use stages::Threads;
use stages::{After, BATCH, Batch, Failed, Part, Smoothing, Spare, Stage};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, AtomicU64};
use std::sync::{Arc, PoisonError, mpsc};
use std::thread::available_parallelism;
use std::time::Duration;
use text::Reader;
use waits::{Awaited, Known, Waits};

/// Canonical calls that one call of [`Feeder::pump`] takes at the most.
const EVENTS_PER_PUMP: usize = 256;

/// Stages that may have a thread of their own: interpreter and smoothing.
const STAGES: usize = 2;

/// Folder of a program, in which its subroutines are looked for first.
fn folder(program: &str) -> Option<&Path> {
    Path::new(program).parent()
}

/// How far a call of [`Feeder::pump`] came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is more to do at once.
    Working,
    /// The ring is full: try again when the machine has moved on.
    RingFull,
    /// A probing move, a wait for an input (M66) or a code of the user (M100 to M199) is under way: what follows depends on how it ends. Try again in a while.
    Waiting,
    /// The whole program is in the ring. As long as the machine runs it, it may change: see [`Feeder::is_over`].
    Done,
}

/// A program on its way into the ring.
pub struct Feeder<'t, S: Sink<Element>> {
    smoothing: Stage<'t, Smoothing<'t>, Batch>,
    /// What came from smoothing and is not planned yet.
    batch: Batch,
    spare: Spare,
    speed: SpeedPlanner<S>,
    path: ProgrammedPath,
    waits: Waits,
    log_directory: Option<PathBuf>,
    /// What it prints and logs.
    sayings: Option<Sayings>,
    /// Those that are not started yet.
    threads: Option<Threads<'t>>,
    workers: Workers,
    /// To the thread of smoothing.
    answers: Option<mpsc::Sender<Known>>,
    /// Where the operator's overrides are, and those that the plan was last made with; which of the moves are held.
    live: Option<Arc<RtStatus>>,
    overrides: [f64; 2],
    held: [bool; 2],
    line: u32,
    /// The first thing that it asked the machine, and its line.
    assumed: Option<(u32, Awaited)>,
    lead: Lead,
    ended: bool,
    /// Planned time of what probing moves left of their ways at a contact, s.
    left_s: f64,
    tolerance_mm: f64,
}

impl<'t, S: Sink<Element>> Feeder<'t, S> {
    /// Begins at `start`, a machine position at rest. All is done in the thread that calls [`Feeder::pump`].
    pub fn new(
        config: &Config,
        tables: &Tables,
        text: impl Into<Reader<'t>>,
        start: Position,
        sink: S,
    ) -> Feeder<'t, S> {
        Feeder::with_workers((config, tables), text.into(), start, sink, Workers::none())
    }

    /// The same in several threads; what is planned does not depend on how many. They begin with the first [`Feeder::pump`], with
    /// the rights of the thread that calls it and where that may run, and end with the feeder.
    pub fn in_threads(
        machine: (&Config, &Tables),
        text: impl Into<Reader<'t>>,
        start: Position,
        sink: S,
        threads: Threads<'t>,
    ) -> Feeder<'t, S> {
        let beside = threads.count.saturating_sub(1);
        let stages = beside.min(STAGES);
        let workers = Workers::with_helpers(beside - stages, stages, threads.timeline.clone(), || ());
        Feeder {
            threads: Some(threads),
            ..Feeder::with_workers(machine, text.into(), start, sink, workers)
        }
    }

    fn with_workers(
        (config, tables): (&Config, &Tables),
        text: Reader<'t>,
        start: Position,
        sink: S,
        workers: Workers,
    ) -> Feeder<'t, S> {
        let settings = plan_settings(config, start);
        let (waits, asked) = Waits::new(config.program.user_codes.clone());
        let interpreter = gcode::Interpreter::new(planned_settings(config, tables, start))
            .with_machine(asked)
            .run_reader(text);
        let path = PathPlanner::new(settings);
        let timeline = workers.timeline().cloned();
        let smoothing = Smoothing::new(interpreter, path, &config.program, timeline);
        Feeder {
            spare: Arc::clone(&smoothing.spare),
            smoothing: Stage::Here(Box::new(smoothing)),
            batch: Batch::default(),
            speed: SpeedPlanner::new(settings, sink, &workers),
            path: ProgrammedPath::default(),
            waits,
            log_directory: config.program.log_directory.clone(),
            sayings: None,
            threads: None,
            workers,
            answers: None,
            live: None,
            overrides: [1.0; 2],
            held: [false; 2],
            line: 0,
            assumed: None,
            lead: Lead::default(),
            ended: false,
            left_s: 0.0,
            tolerance_mm: 0.0,
        }
    }

    /// The same that stops with an error where a check has to, or when it is cancelled.
    pub fn within(self, limits: CheckLimits) -> Feeder<'t, S> {
        self.with_interpreter(|interpreter| interpreter.within(limits))
    }

    /// The same for the program of this path: its subroutines are looked for beside it first.
    pub fn beside(self, path: &str) -> Feeder<'t, S> {
        match folder(path) {
            Some(folder) => self.with_interpreter(|interpreter| interpreter.subroutines_beside(folder)),
            None => self,
        }
    }

    /// The same that begins so. What the lines before a line ask of the machine is taken as it comes in a check: to be called before
    /// [`Feeder::with_probe`], and behind [`Feeder::beside`] and [`Feeder::within`].
    pub fn beginning(mut self, begin: &Begin) -> Feeder<'t, S> {
        match begin {
            Begin::Dry { begin, feed_s } => {
                self.smoothing.recall().dry_run = Some(DryRun::new(*feed_s));
                self.beginning(begin)
            }
            Begin::Program { .. } => self,
            Begin::Mdi { modes: None, .. } => self.with_interpreter(gcode::Run::as_mdi),
            Begin::FromLine { line, approach, .. } => self.with_interpreter(|run| run.begin_at_line(*line, approach)),
            Begin::Mdi { modes: Some(modes), .. } => self.with_interpreter(|run| run.as_mdi().continuing(modes)),
        }
    }

    /// The same for a machine that runs it: `results` tell how each probing move ended and what inputs read, and nothing behind is
    /// read before. Without it, every probing move touches something at its end, and every input comes as it is waited for.
    pub fn with_probe(mut self, results: rtrb::Consumer<Answer>) -> Feeder<'t, S> {
        let answers = self.waits.wait_for(results);
        self.smoothing.recall().answers = Some(answers);
        self
    }

    /// The same that tells of the programmed path as it comes, each move before any motion along it is in the ring.
    pub fn telling_path(mut self, to: mpsc::Sender<PathNews>) -> Feeder<'t, S> {
        self.path.tell(to);
        self
    }

    /// The same that does not go far ahead of the one who judges set-points by its path: `passed` counts the pieces behind them.
    pub fn keeping_near(mut self, passed: Arc<AtomicU64>) -> Feeder<'t, S> {
        self.path.keep_near(passed);
        self
    }

    /// The same that reads pins of a running control for `#<_hal[name]>`.
    pub fn reading_pins(self, pins: PinReader) -> Feeder<'t, S> {
        self.with_interpreter(|interpreter| interpreter.with_pins(pins))
    }

    /// The same that prints and logs what the program says, as the interpolation comes to it, which counts its messages there.
    pub fn saying(mut self, messages_reached: Arc<AtomicU32>) -> Feeder<'t, S> {
        let (to, sayings) = Sayings::new(self.log_directory.clone(), messages_reached);
        self.smoothing.recall().sayings = Some(to);
        self.sayings = Some(sayings);
        self
    }

    /// Prints and logs what the machine has come to.
    ///
    /// # Errors
    /// What cannot be written. Nothing more is planned then.
    pub fn say_reached(&mut self) -> Result<(), FeedError> {
        let Some(sayings) = &mut self.sayings else {
            return Ok(());
        };
        let Err((source, what)) = sayings.write() else {
            return Ok(());
        };
        self.ended = true;
        Err(self.failed(Failed::Record { source, what }))
    }

    /// The same that tells the texts of messages, in their order; `None` in the place of what the program prints or logs.
    pub fn telling_messages(mut self, to: mpsc::Sender<Option<String>>) -> Feeder<'t, S> {
        self.smoothing.recall().messages = Some(to);
        self
    }

    /// The same that tells the modes of its blocks as they are read, as [`gcode::Run::telling_modes`] says. To be called behind
    /// [`Feeder::beginning`].
    pub fn telling_modes(self, to: mpsc::Sender<(u32, gcode::InForce)>) -> Feeder<'t, S> {
        self.with_interpreter(|interpreter| interpreter.telling_modes(to))
    }

    /// The same that follows the operator, from the next [`Feeder::pump`] on: overrides; in single block, exact stops.
    pub fn following(mut self, live: Arc<RtStatus>) -> Feeder<'t, S> {
        self.smoothing.recall().live = Some(Arc::clone(&live));
        self.live = Some(live);
        self
    }

    fn with_interpreter(mut self, change: impl FnOnce(gcode::Run<'t>) -> gcode::Run<'t>) -> Feeder<'t, S> {
        self.smoothing.recall().change_interpreter(change);
        self
    }

    /// Plans a part of the program, and again what an override has changed.
    ///
    /// # Errors
    /// The first thing that is wrong; what was planned before it stays in the ring and ends at rest. Nothing follows it.
    ///
    /// # Panics
    /// Where a thread of it has.
    pub fn pump(&mut self) -> Result<Progress, FeedError> {
        self.say_reached()?;
        if let Some(threads) = self.threads.take() {
            self.answers = stages::start(&mut self.smoothing, &threads, &self.workers);
        }
        let timeline = self.workers.timeline().cloned();
        during(timeline.as_ref(), Some(Task::Slope), || self.plan())
    }

    fn plan(&mut self) -> Result<Progress, FeedError> {
        for _ in 0..EVENTS_PER_PUMP {
            self.follow_overrides();
            match self.speed.pump() {
                Pumped::Blocked => return Ok(Progress::RingFull),
                Pumped::Refused { line } => {
                    self.ended = true;
                    return Err(self.over_limits(line));
                }
                Pumped::Hungry | Pumped::Done => {}
            }
            if self.waits.awaited().is_some() {
                let Some(known) = self.waits.receive() else {
                    return Ok(Progress::Waiting);
                };
                self.answered(known);
            }
            if self.ended {
                return Ok(if self.speed.is_done() {
                    Progress::Done
                } else {
                    Progress::Working
                });
            }
            if self.path.is_far_ahead(|| self.speed.sink().ahead_s()) {
                return Ok(Progress::RingFull);
            }
            let part = self.next_part();
            self.line = part.line;
            self.tolerance_mm = part.tolerance_mm;
            self.left_s = part.left_s;
            for programmed in self.batch.programmed.drain(..part.programmed) {
                self.lead.add(programmed.piece.length());
                self.path.push(programmed);
            }
            if let Some(live) = &self.live {
                live.set_lead(self.lead.now());
            }
            for smoothed in self.batch.smoothed.drain(..part.smoothed) {
                self.speed.push(smoothed);
            }
            self.path.tell_part();
            match part.after {
                After::More => {}
                After::Await(awaited) => {
                    if self.assumed.is_none() && awaited != Awaited::Probe {
                        self.assumed = Some((self.line, awaited));
                    }
                    if self.waits.begin(awaited) && awaited == Awaited::Probe {
                        self.path.tell_news(PathNews::Probing);
                    }
                }
                After::Ended => self.ended = true,
                After::Failed(failed) => {
                    self.ended = true;
                    return Err(self.failed(failed));
                }
            }
        }
        Ok(Progress::Working)
    }

    /// Waits for it, where it comes from a thread.
    fn next_part(&mut self) -> Part {
        // Single block counts from the next call on.
        let most = if self.live.is_some() { 1 } else { BATCH };
        loop {
            if let Some(part) = self.batch.parts.pop_front() {
                return part;
            }
            match &mut self.smoothing {
                Stage::Here(smoothing) => smoothing.work(most, &mut self.batch),
                Stage::There(thread) => match thread.batches.take() {
                    Some(batch) => {
                        let used = std::mem::replace(&mut self.batch, batch);
                        let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
                        spare.push(used);
                    }
                    // It has told no end: it panicked.
                    None => self.smoothing.recall().work(most, &mut self.batch),
                },
                Stage::Gone => panic!("a stage is gone"),
            }
        }
    }

    fn answered(&mut self, known: Known) {
        if let Known::Machine(Answer::Probed(_)) = known {
            // How far it went comes with the next part.
            self.path.tell_behind(PathNews::Probed);
        }
        match (&mut self.smoothing, &self.answers) {
            (Stage::There(_), Some(answers)) => {
                // A thread that is gone is noticed by what does not come.
                let _ = answers.send(known);
            }
            (smoothing, _) => {
                let smoothing = smoothing.recall();
                smoothing.answered(known);
                self.left_s = smoothing.left_s();
            }
        }
    }

    fn failed(&mut self, failed: Failed) -> FeedError {
        match failed {
            Failed::Text(error) => FeedError::Text(error),
            Failed::Record { source, what } => {
                FeedError::Text(self.recall().interpreter().error_at(source, None, what))
            }
            Failed::Plan {
                source,
                letter,
                what,
                kind,
            } => FeedError::Plan(kind, self.recall().interpreter().error_at(source, letter, what)),
        }
    }

    /// What is planned is not run.
    fn over_limits(&mut self, line: u32) -> FeedError {
        let kind = PlanErrorKind::OverLimits;
        self.failed(Failed::Plan {
            source: Source {
                line,
                ..Source::default()
            },
            letter: None,
            what: kind.to_string(),
            kind,
        })
    }

    /// The stages without their threads, for the end of the program.
    fn recall(&mut self) -> &mut Smoothing<'t> {
        // It may be waiting for one.
        self.answers = None;
        self.smoothing.recall()
    }

    /// Nobody waits for the end of a probing move any more: the path has all of its way. Nothing more is planned.
    pub fn give_up_contact(&mut self) {
        self.ended = true;
        let smoothing = self.recall();
        let (way, left_s) = (smoothing.path().give_up_contact(), smoothing.left_s());
        self.left_s = left_s;
        way.into_iter().for_each(|part| self.path.push(part));
        self.path.tell_news(PathNews::Probed);
    }

    /// Planned time of a program whose probing moves ended where the machine touched something, s: of the ways that they and
    /// what follows them really had, as far as it was planned. `None`: none did, and a look at the text says as much.
    pub fn probed_time_s(&mut self) -> Option<f64> {
        let left_s = self.left_s;
        let published_s = self.speed.sink().published_s().filter(|_| left_s > 0.0)?;
        Some(published_s - left_s)
    }

    /// What a program that is only looked at takes for granted of what it asks the machine; `None`: nothing but that probes touch.
    fn assumes(&self) -> Option<String> {
        let (line, awaited) = self.assumed?;
        Some(match awaited {
            Awaited::Probe => return None,
            Awaited::Input => format!("line {line} reads an input (M66), which counts as if it came at once"),
            Awaited::UserCode { number, .. } => {
                format!("line {line} runs M{number}, which counts as if it took no time")
            }
        })
    }

    /// Programmed path since the last call, before corners were rounded; machine coordinates. A probing move is told when it is
    /// over, as far as it went.
    pub fn ideal_path(&mut self) -> std::vec::Drain<'_, Programmed> {
        self.path.take()
    }

    /// Pauses until there may be something to do: an order comes, or the machine has moved on for `most`.
    pub fn pause(&self, most: Duration) {
        match &self.live {
            Some(live) => live.overrides.wait(most),
            None => std::thread::sleep(most),
        }
    }

    /// Whether no override can change anything any more: the machine has come to the last element of a program that is done.
    pub fn is_over(&mut self) -> bool {
        let sink = self.speed.sink();
        sink.consumer_at().is_none_or(|at| at + 1 >= sink.next_number())
    }

    fn follow_overrides(&mut self) {
        let Some(live) = &self.live else { return };
        let planned = live.overrides.planned();
        let mut wanted = self.overrides;
        for (wanted, share) in wanted.iter_mut().zip(planned) {
            *wanted = share.unwrap_or(*wanted);
        }
        let held = planned.map(|share| share.is_none());
        if (wanted, held) != (self.overrides, self.held) {
            (self.overrides, self.held) = (wanted, held);
            self.speed.set_override(wanted[0], wanted[1], held);
        }
    }

    /// As [`SpeedPlanner::computed_ahead`] says.
    pub fn computed_ahead(&self) -> [u64; 2] {
        self.speed.computed_ahead()
    }

    /// Where the plan goes.
    pub fn sink(&mut self) -> &mut S {
        self.speed.sink()
    }

    /// Offsets, parameters and tools as the program left them, as far as it was interpreted: with threads of its own, the
    /// interpreter is ahead of the plan by some hundred calls. Nothing more is planned.
    pub fn left_behind(&mut self) -> gcode::Settings {
        self.ended = true;
        self.recall().interpreter().snapshot()
    }

    /// The modes in which the program has left the machine. Nothing more is planned.
    pub fn modes_left(&mut self) -> gcode::Modes {
        self.ended = true;
        self.recall().interpreter().modes()
    }

    /// Greatest deviation from the path that the program has allowed its moves so far (G64), mm; 0: none.
    pub fn tolerance_mm(&self) -> f64 {
        self.tolerance_mm
    }

    /// Line that was planned last.
    pub fn line(&self) -> u32 {
        self.line
    }
}

/// Settings of a program that is planned.
fn planned_settings(config: &Config, tables: &Tables, start: Position) -> gcode::Settings {
    gcode::Settings {
        splines: gcode::Splines::Timed,
        orient_needs_angle: true,
        ..settings_with(config, tables, start)
    }
}

/// How many threads plan, the calling one among them. They run where that may run, and have the rights that it has.
pub fn threads(config: &Config) -> usize {
    let usual = || {
        available_parallelism()
            .map_or(1, NonZero::get)
            .min(config::Program::THREADS_USUAL)
    };
    config.program.threads.unwrap_or_else(usual)
}

#[cfg(test)]
mod tests_threads;

#[cfg(test)]
mod tests {
    use super::real_time::Measure;
    use super::*;

    fn demo() -> (Config, Tables) {
        let config = config::parse(include_str!("../../../configs/mill3-demo.toml"), Path::new("demo.toml")).unwrap();
        let tables = Tables::read(&config).unwrap();
        (config, tables)
    }

    fn first_error(text: &str) -> FeedError {
        let (config, tables) = demo();
        let measure = Measure::new(|| 0.0);
        let mut feeder = Feeder::new(&config, &tables, text.as_bytes(), home(&config), measure);
        loop {
            match feeder.pump() {
                Ok(Progress::Done) => panic!("no error"),
                Ok(_) => {}
                Err(error) => return error,
            }
        }
    }

    #[test]
    fn errors_of_travel_name_the_column_and_the_offset_in_force() {
        let error = first_error("G21 G90\nG10 L2 P1 X100\nG0 Y1 (X0) X 212\nM2\n");
        assert_eq!(
            error.located("p.ngc"),
            "p.ngc:3:12: X 212.000 mm in G54 (offset X 100.000) is machine 312.000, travel ends at 305.000"
        );
        let place = error.of_text();
        assert_eq!(&place.text[place.span.clone()], "X 212");
        // Numbers that differ are shown so.
        let close = first_error("G21 G90\nG0 X 285.0006\nM2\n");
        assert_eq!(
            close.located("p.ngc"),
            "p.ngc:2:4: X 285.00060 mm in G54 (offset X 20.000) is machine 305.00060, travel ends at 305.00000"
        );
        assert!(error.render("p.ngc").contains("^^^^^"));
    }
}
