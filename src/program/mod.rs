//! From the program file to the ring: interpretation and planning, outside real time.
//!
//! In:  program text; what the machine remembers; the machine position from which it starts.
//! Out: elements in the ring, as many as fit, until the program is planned; then what the program left to remember.

mod exact_stops;
pub mod path;
pub mod probing;
pub mod real_time;
mod settings;
pub mod text;

use crate::config::{self, Config};
use crate::host::wait::thread_cpu_s;
use crate::machine::motion_settings::plan_settings;
use crate::machine::tables::Tables;
use crate::rt::shared::RtStatus;
use exact_stops::ExactStops;
use gcode::CheckLimits;
use motion::cancel::Cancel;
use motion::canon::{Axis, Call, Event, PathMode, Position};
use motion::element::Element;
use motion::kinematics::ToolFrame;
use motion::path::PackedPiece;
use motion::plan::workers::Workers;
use motion::plan::{PlanError, PlanErrorKind, Planner, Programmed, Pumped};
use motion::ring::Sink;
use motion::rt::probe::Probed;
use path::PathNews;
use probing::Probing;
use real_time::{Measure, RealTimeFactor};
pub use settings::{interpreter_settings, settings_with};
use std::fmt;
use std::num::NonZero;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::thread::available_parallelism;
use std::time::{Duration, Instant};
use text::Reader;

/// Canonical calls that one call of [`Feeder::pump`] takes at the most.
const EVENTS_PER_PUMP: usize = 256;
/// Pieces of the programmed path that whoever judges set-points by it may have before them, and final motion ahead of the machine, s,
/// from which on no more is read than that: all of them lie in memory.
const PATH_AHEAD: u64 = 20_000;
const PATH_AHEAD_S: f64 = 0.5;

/// Codes of the work systems.
const WORK_SYSTEMS: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];

/// Why a program cannot be run; shown with its place in the text.
#[derive(Debug)]
pub struct ProgramErrors {
    shown: String,
    count: usize,
    is_cancelled: bool,
}

impl fmt::Display for ProgramErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.shown)
    }
}

impl std::error::Error for ProgramErrors {}

impl ProgramErrors {
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether there is nothing wrong but that nobody wants the program any more.
    pub fn is_cancelled(&self) -> bool {
        self.is_cancelled
    }
}

/// What a whole program comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overview {
    /// Last line with something to do.
    pub lines: u32,
    /// Planned time, s.
    pub time_s: f64,
    /// Greatest deviation from the path that the program allows its moves (G64), mm; 0: none.
    pub tolerance_mm: f64,
    /// How much quicker than motion the calling thread has planned it; no other helped.
    pub real_time: RealTimeFactor,
}

/// Folder of a program, in which its subroutines are looked for first.
fn folder(program: &str) -> Option<&Path> {
    Path::new(program).parent()
}

/// All errors of the text; what a machine can do is not looked at. `path`: of the program.
pub fn check_text(
    config: &Config,
    tables: &Tables,
    path: &str,
    text: Reader<'_>,
    limits: CheckLimits,
) -> Vec<gcode::Error> {
    let mut settings = planned_settings(config, tables, home(config));
    if let Some(folder) = folder(path) {
        settings.subroutine_folders.insert(0, folder.to_owned());
    }
    let errors = gcode::check_on(text, || Ok(text), settings, Probing::new().1, limits);
    errors.unwrap_or_else(|error| vec![not_readable(&error)])
}

/// The text of a program cannot be read.
fn not_readable(error: &std::io::Error) -> gcode::Error {
    gcode::Error {
        file: String::new(),
        line: 1,
        column: 1,
        text: String::new(),
        span: 0..0,
        kind: gcode::ErrorKind::NotReadable {
            reason: error.to_string(),
        },
        calls: Vec::new(),
    }
}

/// Interprets and plans the whole program without moving anything, so that all errors are found before it starts. `cancel` ends
/// it at once; time and memory that it takes are limited.
///
/// # Errors
/// All errors of the text, or the first one of the plan: a limit of the machine, or of the check.
pub fn check<'t>(
    config: &Config,
    tables: &Tables,
    path: &str,
    text: impl Into<Reader<'t>>,
    cancel: &Cancel,
) -> Result<Overview, ProgramErrors> {
    let text = text.into();
    let limits = CheckLimits {
        cancel: cancel.clone(),
        ..CheckLimits::default()
    };
    let failed = |shown: String| ProgramErrors {
        shown,
        count: 1,
        is_cancelled: cancel.is_cancelled(),
    };
    if config.joints.is_empty() {
        return Err(failed(format!("{path}: cannot be run: {}", config.without_joints())));
    }
    let mut budget = Budget::new(limits.time);
    let errors = check_text(config, tables, path, text, limits.clone());
    if !errors.is_empty() {
        let shown: Vec<String> = errors.iter().map(|error| error.render(path)).collect();
        return Err(ProgramErrors {
            shown: shown.join("\n\n"),
            count: errors.len(),
            is_cancelled: cancel.is_cancelled(),
        });
    }
    let mut overview = Overview::default();
    let mut feeder = Feeder::new(config, tables, text, home(config), Measure::new(thread_cpu_s))
        .beside(path)
        .within(limits);
    loop {
        match feeder.pump() {
            Ok(Progress::Done) => break,
            Ok(Progress::Working | Progress::RingFull | Progress::Probing) => {}
            // Where a probe will really touch is not known: what follows may be elsewhere, and is judged when it is there.
            Err(error) if feeder.probing.has_assumed() && error.is_of_a_place() && !cancel.is_cancelled() => break,
            Err(error) => return Err(failed(error.render(path))),
        }
        if let Some(limit) = budget.passed() {
            return Err(failed(format!("{path}:{}: {limit}", feeder.line())));
        }
        feeder.ideal_path();
        overview.lines = overview.lines.max(feeder.line());
    }
    overview.lines = overview.lines.max(feeder.line());
    let measure = feeder.sink();
    overview.time_s = measure.time_s();
    overview.real_time = measure.real_time_factor();
    overview.tolerance_mm = feeder.tolerance_mm();
    Ok(overview)
}

/// Memory that a check may take, octets: beside a machine that stands by it is locked, and wanted by others.
const CHECK_MEMORY_MAX: u64 = 512 << 20;

/// Time and memory that a check may still take.
struct Budget {
    began: Instant,
    time: Duration,
    /// When memory was looked at last, and what the process had at the beginning.
    looked: Instant,
    before: Option<u64>,
}

impl Budget {
    fn new(time: Duration) -> Budget {
        Budget {
            began: Instant::now(),
            time,
            looked: Instant::now(),
            before: resident(),
        }
    }

    /// The limit that has been passed, in words. To be asked often.
    fn passed(&mut self) -> Option<String> {
        let now = Instant::now();
        if now - self.looked < Duration::from_millis(20) {
            return None;
        }
        self.looked = now;
        if now - self.began > self.time {
            let seconds = self.time.as_secs();
            return Some(format!("the check may take {seconds} s and has only come so far"));
        }
        let taken = resident()?.saturating_sub(self.before?);
        let most = CHECK_MEMORY_MAX >> 20;
        (taken > CHECK_MEMORY_MAX).then(|| format!("the check may take {most} MiB of memory, and has only come so far"))
    }
}

/// Memory of this process, octets; `None` where the kernel does not tell.
fn resident() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kib << 10)
}

/// Why the program cannot go on.
#[derive(Debug)]
pub enum FeedError {
    Text(Box<gcode::Error>),
    /// The plan: a limit of the machine, and the same as an error of the text.
    Plan(PlanErrorKind, Box<gcode::Error>),
}

impl FeedError {
    /// Whether it may come from where things are.
    fn is_of_a_place(&self) -> bool {
        match self {
            // What holds wherever things are is found in the text before.
            FeedError::Text(_) => true,
            FeedError::Plan(kind, _) => matches!(
                kind,
                PlanErrorKind::Travel { .. }
                    | PlanErrorKind::JointTravel { .. }
                    | PlanErrorKind::Unreachable { .. }
                    | PlanErrorKind::BadArc
            ),
        }
    }

    /// The place in the text, and what is wrong there.
    pub fn of_text(&self) -> &gcode::Error {
        match self {
            FeedError::Text(error) | FeedError::Plan(_, error) => error,
        }
    }

    /// `file:line:column: what`.
    pub fn located(&self, path: &str) -> String {
        format!("{path}:{}", self.of_text())
    }

    /// The same with the line of the program, and a mark under what is wrong.
    pub fn render(&self, path: &str) -> String {
        self.of_text().render(path)
    }
}

/// How far a call of [`Feeder::pump`] came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is more to do at once.
    Working,
    /// The ring is full: try again when the machine has moved on.
    RingFull,
    /// A probing move is under way: what follows it depends on how it ends. Try again in a while.
    Probing,
    /// The whole program is in the ring. As long as the machine runs it, it may change: see [`Feeder::is_over`].
    Done,
}

/// A program on its way into the ring.
pub struct Feeder<'t, S: Sink<Element>> {
    events: gcode::Run<'t>,
    planner: Planner<S>,
    waiting: Option<Event>,
    probing: Probing,
    exact_stops: ExactStops,
    /// 1 for G54 to 9 for G59.3.
    work_system: u8,
    /// Who is told of the programmed path, in place of [`Feeder::ideal_path`].
    told: Option<Sender<PathNews>>,
    /// Pieces of it that have been told, and how many of them set-points have left behind.
    path: u64,
    path_passed: Option<Arc<AtomicU64>>,
    /// Where the operator's overrides are, and those that the plan was last made with.
    live: Option<Arc<RtStatus>>,
    overrides: [f64; 2],
    line: u32,
    ended: bool,
    /// Planned time of what probing moves left of their ways at a contact, s.
    left_s: f64,
    /// What G64 without P allows, mm.
    default_tolerance_mm: f64,
    /// What the path mode of the moment allows, and the most of that for any move.
    mode_tolerance_mm: f64,
    tolerance_mm: f64,
}

impl<'t, S: Sink<Element>> Feeder<'t, S> {
    /// Begins at `start`, a machine position at rest.
    pub fn new(
        config: &Config,
        tables: &Tables,
        text: impl Into<Reader<'t>>,
        start: Position,
        sink: S,
    ) -> Feeder<'t, S> {
        Feeder::with_workers(config, tables, text, start, sink, &Workers::none())
    }

    /// The same with threads that help to plan; what is planned does not depend on them.
    pub fn with_workers(
        config: &Config,
        tables: &Tables,
        text: impl Into<Reader<'t>>,
        start: Position,
        sink: S,
        workers: &Workers,
    ) -> Feeder<'t, S> {
        let (probing, asked) = Probing::new();
        Feeder {
            events: gcode::Interpreter::new(planned_settings(config, tables, start))
                .with_machine(asked)
                .run_reader(text.into()),
            planner: Planner::with_workers(plan_settings(config, start), sink, workers),
            waiting: None,
            probing,
            exact_stops: ExactStops::NONE,
            work_system: 1,
            told: None,
            path: 0,
            path_passed: None,
            live: None,
            overrides: [1.0; 2],
            line: 0,
            ended: false,
            left_s: 0.0,
            default_tolerance_mm: config.program.tolerance_mm,
            mode_tolerance_mm: 0.0,
            tolerance_mm: 0.0,
        }
    }

    /// The same that stops with an error where a check has to, or when it is cancelled.
    pub fn within(mut self, limits: CheckLimits) -> Feeder<'t, S> {
        self.events = self.events.within(limits);
        self
    }

    /// The same for the program of this path: its subroutines are looked for beside it first.
    pub fn beside(mut self, path: &str) -> Feeder<'t, S> {
        if let Some(folder) = folder(path) {
            self.events = self.events.subroutines_beside(folder);
        }
        self
    }

    /// The same for a machine that probes: `results` tell how each probing move ended, and nothing behind it is read before.
    /// Without it, every probing move touches something at its end.
    pub fn with_probe(mut self, results: rtrb::Consumer<Probed>) -> Feeder<'t, S> {
        self.probing.wait_for(results);
        self
    }

    /// The same that tells of the programmed path as it comes, each move before any motion along it is in the ring.
    pub fn telling_path(self, to: Sender<PathNews>) -> Feeder<'t, S> {
        Feeder { told: Some(to), ..self }
    }

    /// The same that does not go far ahead of the one who judges set-points by its path: `passed` counts the pieces behind them.
    pub fn keeping_near(self, passed: Arc<AtomicU64>) -> Feeder<'t, S> {
        Feeder {
            path_passed: Some(passed),
            ..self
        }
    }

    /// The same that follows the operator, from the next [`Feeder::pump`] on: overrides; in single block, exact stops.
    pub fn following(self, live: Arc<RtStatus>) -> Feeder<'t, S> {
        Feeder {
            live: Some(live),
            ..self
        }
    }

    /// Plans a part of the program, and again what an override has changed.
    ///
    /// # Errors
    /// The first thing that is wrong; what was planned before it stays in the ring and ends at rest.
    pub fn pump(&mut self) -> Result<Progress, FeedError> {
        for _ in 0..EVENTS_PER_PUMP {
            self.follow_overrides();
            self.tell_path(None);
            if self.planner.pump() == Pumped::Blocked {
                return Ok(Progress::RingFull);
            }
            if self.probing.is_under_way() {
                let Some(probed) = self.probing.receive() else {
                    return Ok(Progress::Probing);
                };
                self.left_s += self.planner.probed(probed.rest);
                self.tell_path(Some(PathNews::Probed));
                self.probing.send(gcode::Probed {
                    end: probed.end,
                    at: self.planner.to_work(&probed.at),
                    rest: self.planner.to_work(&probed.rest),
                });
            }
            if self.ended {
                return Ok(if self.planner.is_done() {
                    Progress::Done
                } else {
                    Progress::Working
                });
            }
            if self.is_far_ahead() {
                return Ok(Progress::RingFull);
            }
            match self.waiting.take().map(Ok).or_else(|| self.events.next()) {
                Some(Ok(event)) => {
                    self.line = event.source.line;
                    self.look_at(&event.call);
                    let single_block = self.live.as_ref().is_some_and(|live| live.single_block());
                    if let Some(call) = self.exact_stops.switch(single_block) {
                        let source = event.source;
                        self.plan(&Event { source, call })?;
                    }
                    if self.exact_stops.let_pass(&event.call) {
                        self.plan(&event)?;
                    }
                    if let Call::StraightProbe { .. } = event.call
                        && self.probing.begin()
                    {
                        // All before it, and the move itself; the rest is planned once it is over.
                        self.planner.await_contact();
                        self.tell_path(Some(PathNews::Probing));
                        self.planner.finish();
                    }
                }
                Some(Err(error)) => {
                    self.planner.finish();
                    self.ended = true;
                    return Err(FeedError::Text(error));
                }
                None => {
                    self.planner.finish();
                    self.ended = true;
                }
            }
        }
        Ok(Progress::Working)
    }

    fn plan(&mut self, event: &Event) -> Result<(), FeedError> {
        let Err(PlanError { source, kind }) = self.planner.push(event) else {
            return Ok(());
        };
        let (letter, what) = match kind {
            PlanErrorKind::Travel { axis, value, limit } => {
                (Some(axis.letter()), self.beyond_travel(axis, value, limit))
            }
            PlanErrorKind::NoSuchAxis { axis } => (Some(axis.letter()), None),
            _ => (None, None),
        };
        let what = what.unwrap_or_else(|| kind.to_string());
        Err(FeedError::Plan(kind, self.events.error_at(source, letter, what)))
    }

    /// Why a place is beyond the travel of an axis, by the offsets in force; `None` where a rotation makes the axis another one in
    /// the work.
    fn beyond_travel(&self, axis: Axis, value: f64, limit: f64) -> Option<String> {
        let zero = Position::ZERO;
        let mut one = zero;
        one[axis] = 1.0;
        let [zero, one] = [zero, one].map(|machine| self.planner.to_work(&machine));
        let follows = |other: &Axis| ((one[*other] - zero[*other]) - f64::from(*other == axis)).abs() < 1e-9;
        let (letter, offset) = (axis.letter(), 0.0 - zero[axis]);
        let unit = if axis.is_rotary() { "degrees" } else { "mm" };
        Axis::ALL.iter().all(follows).then(|| {
            format!(
                "{letter} {:.3} {unit} in {} (offset {letter} {offset:.3}) is machine {value:.3}, travel ends at {limit:.3}",
                value - offset,
                WORK_SYSTEMS[usize::from(self.work_system.clamp(1, 9)) - 1],
            )
        })
    }

    /// Nobody waits for the end of a probing move any more: the path has all of its way.
    pub fn give_up_contact(&mut self) {
        self.planner.give_up_contact();
        self.tell_path(Some(PathNews::Probed));
    }

    /// Tells how the programmed path goes on, and what comes behind that.
    fn tell_path(&mut self, news: Option<PathNews>) {
        let Some(told) = &self.told else { return };
        let path = self.planner.ideal_path();
        self.path += path.len() as u64;
        let ways = path.map(|part| PathNews::Way(PackedPiece::from(&part.piece)));
        // Who does not listen any more does not want to know.
        ways.chain(news).for_each(|news| drop(told.send(news)));
    }

    /// Planned time of a program whose probing moves ended where the machine touched something, s: of the ways that they and
    /// what follows them really had, as far as it was planned. `None`: none did, and a look at the text says as much.
    pub fn probed_time_s(&mut self) -> Option<f64> {
        let left_s = self.left_s;
        let published_s = self.planner.sink().published_s().filter(|_| left_s > 0.0)?;
        Some(published_s - left_s)
    }

    /// Programmed path since the last call, before corners were rounded; machine coordinates. A probing move is told when it is
    /// over, as far as it went.
    pub fn ideal_path(&mut self) -> std::vec::Drain<'_, Programmed> {
        let path = self.planner.ideal_path();
        self.path += path.len() as u64;
        path
    }

    /// Whether there is more path before the set-points than need be.
    fn is_far_ahead(&mut self) -> bool {
        let Some(passed) = &self.path_passed else { return false };
        self.path - passed.load(Ordering::Relaxed) > PATH_AHEAD && self.planner.sink().ahead_s() > Some(PATH_AHEAD_S)
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
        let sink = self.planner.sink();
        sink.consumer_at().is_none_or(|at| at + 1 >= sink.next_number())
    }

    fn follow_overrides(&mut self) {
        let Some(live) = &self.live else { return };
        let mut wanted = self.overrides;
        for (wanted, share) in wanted.iter_mut().zip(live.overrides.planned()) {
            *wanted = share.unwrap_or(*wanted);
        }
        if wanted != self.overrides {
            self.overrides = wanted;
            self.planner.set_override(wanted[0], wanted[1]);
        }
    }

    /// Where the plan goes.
    pub fn sink(&mut self) -> &mut S {
        self.planner.sink()
    }

    /// Offsets, parameters and tools as the program left them, as far as it was interpreted.
    pub fn left_behind(&self) -> gcode::Settings {
        self.events.snapshot()
    }

    /// Follows the work system, the path mode and what it allows the moves in it.
    fn look_at(&mut self, call: &Call) {
        match call {
            Call::SetG5xOffset { system, .. } => self.work_system = *system,
            Call::SetPathMode(PathMode::Continuous { tolerance_mm, .. }) => {
                self.mode_tolerance_mm = tolerance_mm.unwrap_or(self.default_tolerance_mm);
            }
            Call::SetPathMode(PathMode::ExactPath | PathMode::ExactStop) => self.mode_tolerance_mm = 0.0,
            Call::StraightTraverse { .. }
            | Call::StraightFeed { .. }
            | Call::ArcFeed { .. }
            | Call::NurbsFeed { .. } => {
                self.tolerance_mm = self.tolerance_mm.max(self.mode_tolerance_mm);
            }
            _ => {}
        }
    }

    /// Greatest deviation from the path that the program has allowed its moves so far (G64), mm; 0: none.
    pub fn tolerance_mm(&self) -> f64 {
        self.tolerance_mm
    }

    /// Line that was interpreted last.
    pub fn line(&self) -> u32 {
        self.line
    }
}

/// Machine position after homing.
pub fn home(config: &Config) -> Position {
    let joints: Vec<f64> = config.joints.iter().map(|joint| joint.homing.position_mm).collect();
    // Carriages of a delta may be homed where no rods could be; from there no program begins.
    config
        .kinematics()
        .forward(&ToolFrame::OFF, &joints)
        .unwrap_or_default()
}

/// Settings of a program that is planned.
fn planned_settings(config: &Config, tables: &Tables, start: Position) -> gcode::Settings {
    gcode::Settings {
        splines: gcode::Splines::Timed,
        ..settings_with(config, tables, start)
    }
}

/// The threads that help the calling one to plan. They run where it may run and have the rights that it has: to be called
/// where both are settled.
pub fn workers(config: &Config) -> Workers {
    let usual = || {
        available_parallelism()
            .map_or(1, NonZero::get)
            .min(config::Program::PLANNER_THREADS_USUAL)
    };
    let threads = config.program.planner_threads.unwrap_or_else(usual);
    Workers::new(threads.saturating_sub(1), || ())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn demo() -> (Config, Tables) {
        let config = config::parse(include_str!("../../configs/mill3-demo.toml"), Path::new("demo.toml")).unwrap();
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
    fn what_the_moves_may_be_off_is_what_the_program_says_of_them() {
        let (config, tables) = demo();
        let tolerance_mm = |text: &str| {
            let checked = check(&config, &tables, "p.ngc", text.as_bytes(), &Cancel::default());
            checked.expect("a program").tolerance_mm
        };
        assert_eq!(tolerance_mm("G21 G90 G64 P0.05\nG1 X1 F100\nG64 P0.2\nM2\n"), 0.05);
        assert_eq!(
            tolerance_mm("G21 G90 G64\nG1 X1 F100\nM2\n"),
            config.program.tolerance_mm
        );
        assert_eq!(tolerance_mm("G21 G90 G61\nG1 X1 F100\nM2\n"), 0.0);
    }

    #[test]
    fn a_check_tells_how_quick_planning_is() {
        let (config, tables) = demo();
        let text = b"G21 G90 G64 P0.05\nG1 X100 F1000\nY50\nX0\nM2\n";
        let checked = check(&config, &tables, "p.ngc", text, &Cancel::default()).expect("a program");
        assert!(checked.real_time.whole.is_some_and(|whole| whole > 0.0), "{checked:?}");
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
        assert!(error.render("p.ngc").contains("^^^^^"));
    }
}
