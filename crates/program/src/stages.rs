//! What comes before speeds: interpretation with cutter compensation, and smoothing.
//!
//! In:  program text; whether single block is on; answers to what the program waits for.
//! Out: the smoothed path call by call, and what the program had meant.
//!
//! Either stage works in the thread that asks it, or in one of its own with a queue behind it, of which the one in front of it takes
//! whole batches. What comes out is the same. Cutter compensation is no stage of its own: programs read where it has led the tool
//! (#5420), so that the interpreter cannot run ahead of it.

use super::dry_run::{Dry, DryRun};
use super::exact_stops::ExactStops;
use super::records::{Records, SayingsTo};
use super::waits::{Answers, Awaited, Known, Told, awaited_behind};
use motion::canon::{Axis, Call, Event, PathMode, Position, ProbeEnd, Record, Source};
use motion::plan::timeline::{Task, Timeline, during};
use motion::plan::workers::{QueueIn, QueueOut, Workers, queue};
use motion::plan::{PathPlanner, PlanError, PlanErrorKind, Programmed, Smoothed};
use motion::rt::probe::Answer;
use rt::shared::RtStatus;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::{Builder, Scope, ScopedJoinHandle};

/// Calls that go from stage to stage together.
pub(super) const BATCH: usize = 128;
/// Batches that wait between two stages.
const ROOM: usize = 4;

/// Codes of the work systems.
const WORK_SYSTEMS: [&str; 9] = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];

/// Starts a thread.
pub(super) type Spawn<'t> =
    Box<dyn Fn(Builder, Box<dyn FnOnce() + Send + 't>) -> std::io::Result<ScopedJoinHandle<'t, ()>> + 't>;

/// The threads that plan a program.
pub struct Threads<'t> {
    pub(super) count: usize,
    pub(super) spawn: Spawn<'t>,
    pub(super) timeline: Option<Timeline>,
}

impl<'t> Threads<'t> {
    /// So many, that of the caller among them; the others are of the scope.
    pub fn new(count: usize, scope: &'t Scope<'t, '_>) -> Threads<'t> {
        Threads {
            count,
            spawn: Box::new(move |thread, work| thread.spawn_scoped(scope, work)),
            timeline: None,
        }
    }

    /// The same that tell what they work on.
    pub fn recorded(self, timeline: Timeline) -> Threads<'t> {
        let timeline = Some(timeline);
        Threads { timeline, ..self }
    }
}

/// A stage, here or in a thread of its own.
pub(super) enum Stage<'t, Worker, Batch> {
    Here(Box<Worker>),
    There(Thread<'t, Worker, Batch>),
    /// Its thread is being started or has panicked.
    Gone,
}

/// The thread of a stage.
pub(super) struct Thread<'t, Worker, Batch> {
    pub(super) batches: QueueOut<Batch>,
    back: mpsc::Receiver<Box<Worker>>,
    thread: ScopedJoinHandle<'t, ()>,
}

impl<'t, Worker: Send + 't, Batch: Send + 't> Stage<'t, Worker, Batch> {
    /// Goes on in a thread of its own, if the system has one: `work` puts batches into the queue as long as it is open.
    pub(super) fn start(
        &mut self,
        thread: Builder,
        spawn: &Spawn<'t>,
        workers: &Workers,
        work: impl FnOnce(&mut Worker, &QueueIn<Batch>) + Send + 't,
    ) {
        let Stage::Here(worker) = std::mem::replace(self, Stage::Gone) else {
            return;
        };
        let (put, batches) = queue(ROOM, workers);
        let (to_thread, handed) = mpsc::channel::<Box<Worker>>();
        let (send_back, back) = mpsc::channel();
        let thread = spawn(
            thread,
            Box::new(move || {
                // Handed over once the thread is there: where there is none, the stage stays here.
                let Ok(mut worker) = handed.recv() else { return };
                work(&mut worker, &put);
                drop(put);
                // Nobody may want it back.
                let _ = send_back.send(worker);
            }),
        );
        *self = match thread {
            Ok(thread) => match to_thread.send(worker) {
                Ok(()) => Stage::There(Thread { batches, back, thread }),
                Err(mpsc::SendError(worker)) => Stage::Here(worker),
            },
            Err(_) => Stage::Here(worker),
        };
    }

    /// The stage, whose thread ends if it has one. What that had ready is gone: for the end of a program only.
    ///
    /// # Panics
    /// If its thread has.
    pub(super) fn recall(&mut self) -> &mut Worker {
        if let Stage::There(_) = self
            && let Stage::There(Thread { batches, back, thread }) = std::mem::replace(self, Stage::Gone)
        {
            drop(batches);
            if let Err(panic) = thread.join() {
                std::panic::resume_unwind(panic);
            }
            if let Ok(worker) = back.recv() {
                *self = Stage::Here(worker);
            }
        }
        match self {
            Stage::Here(worker) => worker,
            Stage::There(_) | Stage::Gone => panic!("a stage is gone"),
        }
    }
}

/// What the interpreter gives; `None`: the end.
type Interpreted = Option<Result<Event, Box<gcode::Error>>>;

/// Why the program cannot go on.
pub(super) enum Failed {
    Text(Box<gcode::Error>),
    Plan {
        source: Source,
        /// The word that is to blame, and what is wrong with it.
        letter: Option<char>,
        what: String,
        kind: PlanErrorKind,
    },
    /// What the program wanted to write, or what cannot be run dry.
    Record {
        source: Source,
        what: String,
    },
}

/// What is behind a part.
pub(super) enum After {
    More,
    /// Nothing is read behind it before this is known.
    Await(Awaited),
    Ended,
    Failed(Failed),
}

/// What a call comes to; the path of it is in its batch.
pub(super) struct Part {
    pub(super) line: u32,
    /// Greatest deviation that the program has allowed so far, mm.
    pub(super) tolerance_mm: f64,
    /// Planned time of what probing moves have left of their ways so far, s.
    pub(super) left_s: f64,
    pub(super) programmed: usize,
    pub(super) smoothed: usize,
    pub(super) after: After,
}

/// Batches that have been used up, to be filled again: their memory would have to be taken from the system each time.
pub(super) type Spare = Arc<Mutex<Vec<Batch>>>;

/// Parts one after the other.
#[derive(Default)]
pub(super) struct Batch {
    pub(super) parts: VecDeque<Part>,
    pub(super) programmed: VecDeque<Programmed>,
    pub(super) smoothed: VecDeque<Smoothed>,
}

/// Calls to a smoothed path.
pub(super) struct Smoothing<'t> {
    interpreter: Stage<'t, gcode::Run<'t>, Vec<Interpreted>>,
    /// The batch of the interpreter that is being worked on.
    calls: std::vec::IntoIter<Interpreted>,
    path: PathPlanner,
    exact_stops: ExactStops,
    /// What a dry run makes of it.
    pub(super) dry_run: Option<DryRun>,
    timeline: Option<Timeline>,
    pub(super) spare: Spare,
    /// Where single block is switched.
    pub(super) live: Option<Arc<RtStatus>>,
    /// Who is told what the program waits for; `None`: all is as programmed, and nobody waits.
    pub(super) answers: Option<Answers>,
    /// What the program writes: only one that runs.
    records: Records,
    /// Who is told the texts of messages, in their order; `None` in the place of what is written elsewhere.
    pub(super) messages: Option<mpsc::Sender<Option<String>>>,
    /// Who writes what it prints and logs.
    pub(super) sayings: Option<SayingsTo>,
    /// Why a point of a probing move could not be written.
    unwritten: Option<String>,
    left_s: f64,
    /// 1 for G54 to 9 for G59.3.
    work_system: u8,
    /// What G64 without P allows, mm.
    default_tolerance_mm: f64,
    /// What corners between rapid moves are allowed wherever G64 allows something, mm.
    rapid_tolerance_mm: Option<f64>,
    /// What the path mode of the moment allows, and the most of that for any move.
    mode_tolerance_mm: f64,
    tolerance_mm: f64,
}

impl<'t> Smoothing<'t> {
    pub(super) fn new(
        interpreter: gcode::Run<'t>,
        path: PathPlanner,
        program: &config::Program,
        timeline: Option<Timeline>,
    ) -> Smoothing<'t> {
        Smoothing {
            interpreter: Stage::Here(Box::new(interpreter)),
            calls: Vec::new().into_iter(),
            path,
            exact_stops: ExactStops::NONE,
            dry_run: None,
            timeline,
            spare: Spare::default(),
            live: None,
            answers: None,
            records: Records::new(program.log_directory.clone()),
            messages: None,
            sayings: None,
            unwritten: None,
            left_s: 0.0,
            work_system: 1,
            default_tolerance_mm: program.tolerance_mm,
            rapid_tolerance_mm: program.rapid_tolerance_mm,
            mode_tolerance_mm: 0.0,
            tolerance_mm: 0.0,
        }
    }

    /// The interpreter, before it has a thread of its own.
    pub(super) fn change_interpreter(&mut self, change: impl FnOnce(gcode::Run<'t>) -> gcode::Run<'t>) {
        self.interpreter = match std::mem::replace(&mut self.interpreter, Stage::Gone) {
            Stage::Here(interpreter) => Stage::Here(Box::new(change(*interpreter))),
            other => other,
        };
    }

    /// The interpreter goes on in a thread of its own.
    fn start_interpreter(&mut self, spawn: &Spawn<'t>, workers: &Workers) {
        let thread = Builder::new().name("interpreter".to_owned());
        let timeline = self.timeline.clone();
        self.interpreter
            .start(thread, spawn, workers, move |interpreter, batches| {
                loop {
                    let batch = interpret(interpreter, BATCH, timeline.as_ref());
                    let is_over = matches!(batch.last(), Some(Some(Err(_)) | None));
                    if !batches.put(batch) {
                        return;
                    }
                    if is_over {
                        return batches.help();
                    }
                }
            });
    }

    /// The interpreter, whose thread ends if it has one.
    pub(super) fn interpreter(&mut self) -> &mut gcode::Run<'t> {
        // It may be waiting for one.
        self.answers = None;
        self.interpreter.recall()
    }

    pub(super) fn path(&mut self) -> &mut PathPlanner {
        &mut self.path
    }

    /// Planned time of what probing moves have left of their ways, s.
    pub(super) fn left_s(&self) -> f64 {
        self.left_s
    }

    /// Appends what the next calls come to: `most` of them, fewer where nothing follows for now.
    pub(super) fn work(&mut self, most: usize, batch: &mut Batch) {
        let timeline = self.timeline.clone();
        during(timeline.as_ref(), Some(Task::Smooth), || self.smooth(most, batch));
    }

    fn smooth(&mut self, most: usize, batch: &mut Batch) {
        for _ in 0..most {
            let Some(interpreted) = self.next_call(most, batch.parts.is_empty()) else {
                return;
            };
            let mut line = batch.parts.back().map_or(0, |part| part.line);
            let after = match interpreted {
                Some(Ok(event)) => {
                    line = event.source.line;
                    self.take(event)
                }
                Some(Err(error)) => {
                    self.path.finish();
                    After::Failed(Failed::Text(error))
                }
                None => {
                    self.path.finish();
                    After::Ended
                }
            };
            let is_more = match after {
                After::More => true,
                After::Await(_) => self.answers.is_none(),
                After::Ended | After::Failed(_) => false,
            };
            let before = (batch.programmed.len(), batch.smoothed.len());
            batch.programmed.extend(self.path.ideal_path());
            batch.smoothed.extend(self.path.smoothed());
            batch.parts.push_back(Part {
                line,
                tolerance_mm: self.tolerance_mm,
                left_s: self.left_s,
                programmed: batch.programmed.len() - before.0,
                smoothed: batch.smoothed.len() - before.1,
                after,
            });
            if !is_more {
                return;
            }
        }
    }

    /// What the interpreter gives next, of `most` calls if it is asked here. `None`: it has a thread of its own, and is not to be
    /// waited for.
    fn next_call(&mut self, most: usize, wait: bool) -> Option<Interpreted> {
        loop {
            if let Some(interpreted) = self.calls.next() {
                return Some(interpreted);
            }
            let calls = match &mut self.interpreter {
                Stage::Here(interpreter) => interpret(interpreter, most, self.timeline.as_ref()),
                Stage::There(_) if !wait => return None,
                Stage::There(thread) => match thread.batches.take() {
                    Some(calls) => calls,
                    // It has told no end: it panicked.
                    None => interpret(self.interpreter.recall(), most, None),
                },
                Stage::Gone => return Some(None),
            };
            self.calls = calls.into_iter();
        }
    }

    fn take(&mut self, event: Event) -> After {
        self.look_at(&event.call);
        let single_block = self.live.as_ref().is_some_and(|live| live.single_block());
        let source = event.source;
        let switch = self.exact_stops.switch(single_block).map(|call| Event { source, call });
        let awaited = awaited_behind(&event.call);
        if self.answers.is_some()
            && let Err(what) = self.write(&event.call, source)
        {
            return After::Failed(Failed::Record { source, what });
        }
        let passes = self.exact_stops.let_pass(&event.call);
        let changed = self.dry_run.as_mut().map(|dry_run| dry_run.change(&event.call));
        let (before, event, behind) = match changed {
            None => (None, passes.then_some(event), None),
            Some(Ok(Dry::Passes { before })) => (before, passes.then_some(event), None),
            Some(Ok(Dry::Between { before, behind })) => (Some(before), passes.then_some(event), Some(behind)),
            Some(Ok(Dry::Dropped)) => (None, None, None),
            Some(Err(what)) => {
                let what = what.to_owned();
                return After::Failed(Failed::Record { source, what });
            }
        };
        let [before, behind] = [before, behind].map(|call| call.map(|call| Event { source, call }));
        for event in switch.iter().chain(&before).chain(&event).chain(&behind) {
            if let Err(error) = self.path.push(event) {
                return After::Failed(self.failed(error));
            }
        }
        let Some(awaited) = awaited else { return After::More };
        if self.answers.is_some() {
            // All before it, and it itself; the rest is planned once it is over.
            match awaited {
                Awaited::Probe => self.path.await_contact(),
                Awaited::Input | Awaited::UserCode { .. } => {}
            }
            self.path.finish();
        }
        After::Await(awaited)
    }

    /// What the program stopped for has come.
    pub(super) fn answered(&mut self, known: Known) {
        let told = match known {
            Known::Machine(Answer::Probed(probed)) => {
                self.left_s += self.path.probed(probed.rest);
                let at = self.path.to_work(&probed.at);
                if probed.end == ProbeEnd::Tripped {
                    self.unwritten = self.records.touched(&at).err();
                }
                Told::Probed(gcode::Probed {
                    end: probed.end,
                    at,
                    rest: self.path.to_work(&probed.rest),
                })
            }
            Known::Machine(Answer::Input(read)) => Told::Input(read),
            // The machine rests there: it is for user codes only, which tell their end.
            Known::Machine(Answer::Reached) => Told::User(Ok(())),
            Known::User(ended) => Told::User(ended),
        };
        if let Some(answers) = &self.answers {
            answers.send(told);
        }
    }

    /// Writes what a call of a program that runs has to be written.
    fn write(&mut self, call: &Call, source: Source) -> Result<(), String> {
        if let Some(what) = self.unwritten.take() {
            return Err(what);
        }
        match call {
            Call::Record(record @ (Record::OpenProbeLog(_) | Record::CloseProbeLog)) => self.records.record(record),
            Call::Record(record) => {
                self.records.check(record)?;
                if let Some(sayings) = &mut self.sayings {
                    sayings.put(record, source);
                }
                self.tell_message(None);
                Ok(())
            }
            Call::Message(text) => {
                if let Some(sayings) = &mut self.sayings {
                    sayings.pass();
                }
                self.tell_message(Some(text.clone()));
                Ok(())
            }
            Call::UseLengthUnit(unit) => {
                self.records.use_unit(*unit);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn tell_message(&self, text: Option<String>) {
        if let Some(messages) = &self.messages {
            // Nobody may listen any more.
            let _ = messages.send(text);
        }
    }

    /// Follows the work system, the path mode and what it allows the moves in it.
    fn look_at(&mut self, call: &Call) {
        match call {
            Call::SetG5xOffset { system, .. } => self.work_system = *system,
            Call::SetPathMode(PathMode::Continuous { tolerance_mm, .. }) => {
                self.mode_tolerance_mm = tolerance_mm.unwrap_or(self.default_tolerance_mm);
            }
            Call::SetPathMode(PathMode::ExactPath | PathMode::ExactStop) => self.mode_tolerance_mm = 0.0,
            Call::StraightTraverse { .. } => {
                let rapid_mm = self.rapid_tolerance_mm.filter(|_| self.mode_tolerance_mm > 0.0);
                self.tolerance_mm = self
                    .tolerance_mm
                    .max(self.mode_tolerance_mm)
                    .max(rapid_mm.unwrap_or(0.0));
            }
            Call::StraightFeed { .. } | Call::ArcFeed { .. } | Call::NurbsFeed { .. } => {
                self.tolerance_mm = self.tolerance_mm.max(self.mode_tolerance_mm);
            }
            _ => {}
        }
    }

    fn failed(&self, PlanError { source, kind }: PlanError) -> Failed {
        let (letter, what) = match kind {
            PlanErrorKind::Travel { axis, value, limit } => {
                (Some(axis.letter()), self.beyond_travel(axis, value, limit))
            }
            PlanErrorKind::NoSuchAxis { axis } => (Some(axis.letter()), None),
            _ => (None, None),
        };
        Failed::Plan {
            source,
            letter,
            what: what.unwrap_or_else(|| kind.to_string()),
            kind,
        }
    }

    /// Why a place is beyond the travel of an axis, by the offsets in force; `None` where a rotation makes the axis another one in
    /// the work.
    fn beyond_travel(&self, axis: Axis, value: f64, limit: f64) -> Option<String> {
        let zero = Position::ZERO;
        let mut one = zero;
        one[axis] = 1.0;
        let [zero, one] = [zero, one].map(|machine| self.path.to_work(&machine));
        let follows = |other: &Axis| ((one[*other] - zero[*other]) - f64::from(*other == axis)).abs() < 1e-9;
        let (letter, offset) = (axis.letter(), 0.0 - zero[axis]);
        let unit = if axis.is_rotary() { "degrees" } else { "mm" };
        // As many digits as tell the two apart.
        let digits = if (value - limit).abs() < 0.01 { 5 } else { 3 };
        Axis::ALL.iter().all(follows).then(|| {
            format!(
                "{letter} {:.digits$} {unit} in {} (offset {letter} {offset:.3}) is machine {value:.digits$}, travel ends at {limit:.digits$}",
                value - offset,
                WORK_SYSTEMS[usize::from(self.work_system.clamp(1, 9)) - 1],
            )
        })
    }
}

/// The next calls, `most` of them: fewer where the interpreter asks the machine behind the last one, or has come to its end.
fn interpret(interpreter: &mut gcode::Run<'_>, most: usize, timeline: Option<&Timeline>) -> Vec<Interpreted> {
    during(timeline, Some(Task::Interpret), || {
        let mut calls = Vec::with_capacity(most);
        while calls.len() < most {
            let interpreted = interpreter.next();
            let is_last = match &interpreted {
                Some(Ok(event)) => awaited_behind(&event.call).is_some(),
                Some(Err(_)) | None => true,
            };
            calls.push(interpreted);
            if is_last {
                break;
            }
        }
        calls
    })
}

/// Starts the threads of the stages: one for both beside the caller's, or two. Gives who tells what the program
/// waits for.
pub(super) fn start<'t>(
    smoothing: &mut Stage<'t, Smoothing<'t>, Batch>,
    Threads { count, spawn, .. }: &Threads<'t>,
    workers: &Workers,
) -> Option<mpsc::Sender<Known>> {
    if *count < 2 {
        return None;
    }
    if *count > 2
        && let Stage::Here(smoothing) = smoothing
    {
        smoothing.start_interpreter(spawn, workers);
    }
    let (answers, answers_of) = mpsc::channel::<Known>();
    let thread = match count {
        2 => Builder::new().name("interpreter".to_owned()),
        _ => Builder::new().name("smoothing".to_owned()),
    };
    smoothing.start(thread, spawn, workers, move |smoothing, batches| {
        loop {
            let spare = smoothing.spare.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut batch = spare.unwrap_or_default();
            smoothing.work(BATCH, &mut batch);
            let Some(last) = batch.parts.back() else { return };
            let is_over = matches!(last.after, After::Ended | After::Failed(_));
            let waits = matches!(last.after, After::Await(_)) && smoothing.answers.is_some();
            if !batches.put(batch) {
                return;
            }
            if is_over {
                return batches.help();
            }
            if waits {
                match answers_of.recv() {
                    Ok(known) => smoothing.answered(known),
                    Err(_) => return,
                }
            }
        }
    });
    Some(answers)
}
