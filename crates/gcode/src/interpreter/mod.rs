//! A whole program, line by line.
//!
//! In:  program text, [`Settings`], and a [`Machine`] that answers.
//! Out: [`Event`]s one by one, or the first error.
//!
//! Reads a line when the calls of the one before are used up, so memory does not grow with the program. What O-words do
//! is in `control`, all errors of a text at once in `check`.

mod compensated;
mod control;
mod failure;
mod subroutine;

pub(crate) use failure::of_the_whole;

use crate::Settings;
use crate::block::{Block, Faults, LineNumber, Remapped};
use crate::error::{Error, ErrorKind};
use crate::execute::Flow;
use crate::flow::{Level, LevelKind, Place, Search, SearchEnd, Subroutine};
use crate::limits::{CheckLimits, Spent};
use crate::machine::{Machine, NoMachine, PinReader};
use crate::modes::Told;
use crate::o_word::Label;
use crate::octet::{is_blank, is_empty};
use crate::parameter::ARGUMENTS_MAX;
use crate::remap::{Phase, Rest};
use crate::scan::{Fault, LINE_OCTETS_MAX, Span};
use crate::state::{Calls, State};
use crate::text::Text;
use ::compensation::{Compensator, ContourFeed};
use motion::canon::{Call, Event, Source};
use std::collections::HashMap;
use std::io::{Cursor, Read, Seek};
use std::path::Path;
use std::time::Instant;

/// A fault with its place, of what a line asks for.
pub(crate) type Outcome = Result<(), Fault>;

/// Text that can be read from any place.
pub trait ReadSeek: Read + Seek + Send {}

impl<T: Read + Seek + Send> ReadSeek for T {}

/// How the end of a file is marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Delimiter {
    /// No line with text has been read.
    Unknown,
    /// By M2 or M30.
    ProgramEnd,
    /// By `%`, as there was one at the start; M2 and M30 end it too.
    Percent,
}

/// The program or the file of a subroutine.
pub(crate) struct File<'t> {
    /// Empty: the program itself.
    pub(crate) name: String,
    pub(crate) text: Text<Box<dyn ReadSeek + 't>>,
    delimiter: Delimiter,
}

impl<'t> File<'t> {
    pub(crate) fn new(name: String, text: Box<dyn ReadSeek + 't>) -> File<'t> {
        File {
            name,
            text: Text::new(text),
            delimiter: Delimiter::Unknown,
        }
    }
}

/// An interpreter before the first line of a program.
pub struct Interpreter {
    state: State,
    machine: Box<dyn Machine + Send>,
}

impl Interpreter {
    /// An interpreter that asks no machine.
    pub fn new(settings: Settings) -> Interpreter {
        Interpreter {
            state: State::new(settings),
            machine: Box::new(NoMachine),
        }
    }

    /// The same, asking this machine.
    pub fn with_machine(self, machine: impl Machine + Send + 'static) -> Interpreter {
        Interpreter {
            machine: Box::new(machine),
            ..self
        }
    }

    pub(crate) fn settings(&self) -> &Settings {
        &self.state.settings
    }

    /// The events of a program in memory, lazily.
    pub fn run(self, text: &[u8]) -> Run<'_> {
        self.run_reader(Cursor::new(text))
    }

    /// The events of a program of any length, lazily; a small part of it is in memory at any time.
    pub fn run_reader<'t>(self, text: impl ReadSeek + 't) -> Run<'t> {
        let mut run = Run {
            machine: self.machine,
            files: vec![File::new(String::new(), Box::new(text))],
            file: 0,
            levels: vec![Level::new(None, LevelKind::Program, None, [0.0; ARGUMENTS_MAX])],
            subroutines: HashMap::new(),
            search: None,
            search_ends: HashMap::new(),
            calls: Calls::new(),
            compensator: None,
            compensated: ContourFeed::default(),
            refused: None,
            source: Source::default(),
            ended: false,
            spent: Spent::default(),
            continues: false,
            stop_before: None,
            is_mdi: false,
            told: None,
            line: Vec::new(),
            block: Block::default(),
            faults: Faults::new(),
            errors: Vec::new(),
            state: self.state,
        };
        run.state.push_initial_calls(&mut run.calls);
        run.use_compensator(false);
        run.start_up();
        run
    }
}

/// The events of a program; made by [`Interpreter::run`].
///
/// The first events tell units, offsets, plane and path mode; their [`Source`] has line 0. The iterator ends after M2,
/// M30, the closing `%` or the first error. What a line did before its error was found has been done: a line whose form
/// is wrong does nothing.
pub struct Run<'t> {
    pub(crate) state: State,
    machine: Box<dyn Machine + Send>,
    pub(crate) files: Vec<File<'t>>,
    /// The file that is being read.
    pub(crate) file: usize,
    /// The program and the subroutines under way, the last called one last.
    pub(crate) levels: Vec<Level>,
    /// Where the first line of each known subroutine is.
    pub(crate) subroutines: HashMap<Label, Subroutine>,
    /// Lines are passed over until this is found.
    pub(crate) search: Option<Search>,
    /// Where a search for a label from a line of a file ended before. A line may begin searches for two things: `elseif`.
    pub(crate) search_ends: HashMap<(usize, u32, SearchEnd), (Label, Place)>,
    /// Calls of the line read last that have not been handed out.
    pub(crate) calls: Calls,
    /// Makes the path of the tool's centre while cutter compensation is on.
    compensator: Option<Compensator>,
    /// What it made.
    compensated: ContourFeed,
    /// What it refused, behind what it made before.
    refused: Option<Box<Error>>,
    source: Source,
    pub(crate) ended: bool,
    spent: Spent,
    continues: bool,
    /// The line before which a start in the middle of the program stops passing over events.
    pub(crate) stop_before: Option<u32>,
    /// The text need not end with M2, M30 or `%`.
    pub(crate) is_mdi: bool,
    /// Who is told of the modes of its blocks.
    pub(crate) told: Option<Told>,
    /// Kept for their memory.
    line: Vec<u8>,
    block: Block,
    faults: Faults,
    pub(crate) errors: Vec<Error>,
}

impl Run<'_> {
    /// Stops with an error after so many lines, those of loops counted each time: for programs that may never end.
    pub fn limit_steps(mut self, steps: u64) -> Self {
        self.spent.limits.steps = steps;
        self
    }

    /// Stops with an error where a check has to: at so many lines, after so long, or when it is cancelled.
    pub fn within(mut self, limits: CheckLimits) -> Self {
        self.spent.limits = limits;
        self.spent.since = Some(Instant::now());
        self
    }

    /// Gives moves that cutter compensation held back the N-word of the line that let them go, which is what `rs274` prints;
    /// their line remains their own.
    pub fn number_by_release(mut self) -> Self {
        self.use_compensator(true);
        self
    }

    /// Looks for subroutines in this folder before all others.
    pub fn subroutines_beside(mut self, folder: &Path) -> Self {
        self.state.settings.subroutine_folders.insert(0, folder.to_owned());
        self
    }

    /// Goes on behind the line of an error, one in a subroutine behind the call of it in the program itself.
    pub fn continue_after_errors(mut self) -> Self {
        self.continues = true;
        self
    }

    /// Reads the pins of a running control for `#<_hal[name]>`, as they are when the line is read.
    pub fn with_pins(mut self, pins: PinReader) -> Self {
        self.state.pins = Some(pins);
        self
    }

    /// Runs the code that the machine has before every program.
    fn start_up(&mut self) {
        let code = std::mem::take(&mut self.state.settings.startup_code);
        for line in code.lines() {
            let before = self.calls.len();
            if let Err(kind) = self.start_up_line(line) {
                self.calls.truncate(before);
                let (line, reason) = (line.to_owned(), kind.to_string());
                self.fail(Span::default(), ErrorKind::StartupCode { line, reason });
                break;
            }
            if self.calls.iter().skip(before).any(takes_time) || !self.state.questions.is_empty() {
                self.calls.truncate(before);
                let (line, reason) = (
                    line.to_owned(),
                    "expected modes only, nothing that moves or waits".to_owned(),
                );
                self.fail(Span::default(), ErrorKind::StartupCode { line, reason });
                break;
            }
        }
        self.state.settings.startup_code = code;
    }

    fn start_up_line(&mut self, line: &str) -> Result<(), ErrorKind> {
        self.faults.clear();
        self.block.read(line.as_bytes(), &self.state, &mut self.faults);
        if let Some((_, kind)) = self.faults.pop() {
            return Err(kind);
        }
        match self.state.execute(&self.block, line.as_bytes(), &mut self.calls) {
            Ok(Flow::On) if self.block.remapped.is_empty() => Ok(()),
            Ok(_) => Err(ErrorKind::StartupFlow),
            Err((_, kind)) => Err(kind),
        }
    }

    /// Name of a file of the events ([`Source::file`]); empty: the program itself.
    pub fn file_name(&self, file: u16) -> &str {
        self.files.get(usize::from(file)).map_or("", |file| file.name.as_str())
    }

    /// The program's parameters, offsets, tool and modes as they are behind the last event.
    pub fn snapshot(&self) -> Settings {
        self.state.snapshot()
    }

    pub(crate) fn is_cancelled(&self) -> bool {
        self.spent.limits.cancel.is_cancelled()
    }

    /// Reads and runs one line: fills `calls`, or `errors`.
    #[inline]
    pub(crate) fn step(&mut self) {
        self.state.sources.clear(); // whoever has left out calls has left out these
        if !self.state.questions.is_empty()
            && let Err(kind) = self.state.ask_machine(&mut *self.machine)
        {
            return self.fail(Span::default(), kind);
        }
        if let Err(kind) = self.spent.count_line() {
            self.ended = true;
            return self.fail(Span::default(), kind);
        }
        let file = &mut self.files[self.file];
        let line = match file.text.next_line() {
            Ok(Some(line)) => line,
            Ok(None) => return self.end_of_text(),
            Err(error) => {
                self.ended = true;
                let reason = match error.kind() {
                    std::io::ErrorKind::IsADirectory => "it is a folder".into(),
                    _ => error.to_string(),
                };
                return self.fail(Span::default(), ErrorKind::NotReadable { reason });
            }
        };
        let octets = file.text.octets();
        self.source = Source {
            file: self.file as u16,
            line: line.number,
            n: None,
            n_digits: 0,
            start: line.offset as u32,
            end: line.offset.saturating_add(line.length) as u32,
            modes: 0,
        };
        if self.stop_before == Some(line.number) && self.file == 0 && self.search.is_none() {
            self.stop_before = None;
            return file.text.seek(line.offset, line.number - 1);
        }
        if line.length > LINE_OCTETS_MAX as u64 {
            let length = line.length as usize;
            let kind = ErrorKind::LineTooLong {
                length,
                max: LINE_OCTETS_MAX,
            };
            return self.fail(Span::new(LINE_OCTETS_MAX - 1, LINE_OCTETS_MAX), kind);
        }
        if line.offset + line.length > u64::from(u32::MAX) {
            self.ended = true;
            return self.fail(Span::default(), ErrorKind::ProgramTooLong);
        }
        let Some(first) = octets.iter().position(|octet| !is_blank(*octet)) else {
            return;
        };
        match octets[first] {
            b'%' if is_empty(&octets[first + 1..]) => match file.delimiter {
                Delimiter::Unknown => return file.delimiter = Delimiter::Percent,
                Delimiter::Percent => return self.end_by_percent(),
                Delimiter::ProgramEnd => {} // refused as any other octet that means nothing
            },
            b'/' if self.state.settings.block_delete => return,
            _ => {}
        }
        if file.delimiter == Delimiter::Unknown {
            file.delimiter = Delimiter::ProgramEnd;
        }
        if self.search.is_some() {
            return self.search_line();
        }
        if may_be_o_word(octets[first]) && crate::o_word::start(octets).is_some() {
            return self.run_o_line();
        }
        self.run_block();
    }

    fn run_block(&mut self) {
        let octets = self.files[self.file].text.octets();
        self.faults.clear();
        self.state.source = self.source;
        self.block.read(octets, &self.state, &mut self.faults);
        number_source(&mut self.source, self.block.n);
        self.state.source = self.source;
        if !self.faults.is_empty() {
            return self.fail_all();
        }
        if !self.block.remapped.is_empty() {
            let rest = Rest {
                block: self.block.clone(),
                line: octets.to_vec(),
                source: self.source,
                from: Phase::Feed,
            };
            return self.run_rest_of_block(rest);
        }
        let result = self.state.execute(&self.block, octets, &mut self.calls);
        self.apply_flow(result);
    }

    /// Goes where a block leads.
    #[inline]
    fn apply_flow(&mut self, result: Result<Flow, Fault>) {
        match result {
            Ok(Flow::On) => {}
            Ok(Flow::End) => self.ended = true,
            Ok(Flow::Call { program, times, span }) => self.call_program(program, times, span),
            Ok(Flow::Return) => self.return_by_m99(),
            Ok(Flow::Profile { program, span }) => self.call_profile(program, span),
            Err((span, kind)) => self.fail(span, kind),
        }
    }

    /// Runs a block with remapped codes up to the first of them, which is called.
    pub(crate) fn run_rest_of_block(&mut self, mut rest: Rest) {
        let phase_of = |remapped: &Remapped| self.state.remaps[remapped.index].phase;
        let next = rest.block.remapped.iter().copied().min_by_key(phase_of);
        let Some(code) = next else {
            let phases = rest.from..=Phase::Stop;
            let result = self
                .state
                .execute_phases(&rest.block, &rest.line, phases, &mut self.calls);
            return self.apply_flow(result);
        };
        if let Err((span, kind)) = self.call_remapped(&mut rest, code) {
            self.fail(span, kind);
        }
    }

    fn call_remapped(&mut self, rest: &mut Rest, code: Remapped) -> Outcome {
        let entry = self.state.remaps[code.index].clone();
        let speed = rest
            .block
            .word_value(b'S')
            .unwrap_or(self.state.modal.spindles[0].speed);
        let feed = rest.block.word_value(b'F').unwrap_or(self.state.modal.feed);
        let arguments = entry.take_arguments(&mut rest.block, &code, feed, speed)?;
        rest.block.remapped.retain(|other| *other != code);
        if rest.from < entry.phase {
            let before = rest.from..=entry.phase;
            self.state
                .execute_phases(&rest.block, &rest.line, before, &mut self.calls)?;
        }
        rest.from = entry.phase.next();
        let kind = LevelKind::Remap(Box::new(rest.clone()));
        self.enter(entry.label, kind, code.span)?;
        self.state.remapping.push(code.index);
        self.state.parameters.set_arguments(arguments.numbered);
        for (letter, value) in &arguments.named {
            let name = char::from(*letter).to_string();
            self.state.parameters.set_named(&name, *value);
        }
        if arguments.line_number {
            self.state.parameters.set_named("n", f64::from(self.source.line));
        }
        Ok(())
    }

    fn run_o_line(&mut self) {
        // Taken out of the buffer, as a call may read another file.
        let mut line = std::mem::take(&mut self.line);
        line.clear();
        line.extend_from_slice(self.files[self.file].text.octets());
        if let Some((cursor, n)) = crate::o_word::start(&line) {
            number_source(&mut self.source, n);
            self.state.source = self.source;
            let result = crate::o_word::read(cursor, &self.state)
                .and_then(|o_word| o_word.map_or(Ok(()), |o_word| self.run_o_word(&o_word)));
            if let Err((span, kind)) = result {
                self.fail(span, kind);
            }
        }
        self.line = line;
    }

    /// Where reading goes on, as far as this file is concerned.
    pub(crate) fn place(&self) -> Place {
        let (offset, line) = self.files[self.file].text.place();
        Place {
            file: self.file,
            offset,
            line,
        }
    }

    /// Goes on reading there.
    pub(crate) fn go_to(&mut self, place: Place) {
        self.file = place.file;
        self.files[place.file].text.seek(place.offset, place.line);
    }

    /// Place of the line that is being run.
    pub(crate) fn source(&self) -> Source {
        self.source
    }

    /// Goes back to a line that was read before, for what is left to run or to tell of it.
    pub(crate) fn set_source(&mut self, source: Source) {
        self.source = source;
        self.state.source = source;
    }

    /// The closing `%`.
    fn end_by_percent(&mut self) {
        if self.search.is_some() || self.levels.len() > 1 {
            return self.end_of_text();
        }
        self.ended = true;
        self.calls.extend([Call::Finish, Call::Reset, Call::Reset]);
    }

    /// No line is left although the program has not ended.
    fn end_of_text(&mut self) {
        if let Some(search) = self.search.take() {
            self.ended = true;
            return self.search_failed(&search);
        }
        if self.levels.len() > 1 {
            return self.end_of_subroutine();
        }
        self.ended = true;
        if self.is_mdi {
            return match self.state.check_nurbs_closed(None) {
                Ok(()) => {
                    self.state.end_compensation(&mut self.calls);
                    self.calls.push_back(Call::Finish);
                }
                Err(kind) => self.fail(Span::default(), kind),
            };
        }
        let kind = match self.files[self.file].delimiter {
            Delimiter::Unknown | Delimiter::ProgramEnd => ErrorKind::ProgramEndMissing,
            Delimiter::Percent => ErrorKind::PercentMissing,
        };
        let end = self.line_of(self.source).len();
        self.fail(Span::new(end, end), kind);
    }
}

#[inline]
fn number_source(source: &mut Source, n: Option<LineNumber>) {
    source.n = n.map(|n| n.whole);
    source.n_digits = n.map_or(0, |n| n.digits);
}

/// Whether a line can begin like this and be an O-word.
fn may_be_o_word(first: u8) -> bool {
    matches!(first, b'o' | b'O' | b'n' | b'N' | b'/')
}

impl Iterator for Run<'_> {
    type Item = Result<Event, Box<Error>>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if self.is_cancelled() {
                return self.cancelled();
            }
            if let Some(event) = self.compensated.pop() {
                return Some(Ok(event));
            }
            if let Some(error) = self.refused.take() {
                return self.end_by_error(error);
            }
            if let Some(call) = self.calls.pop_front() {
                if takes_time(&call) {
                    self.spent.idle_steps = 0;
                }
                let source = self.state.sources.pop_front().unwrap_or(self.source);
                let source = Source {
                    modes: self.modes_number(),
                    ..source
                };
                let event = Event { source, call };
                if !self.is_compensated(&event.call) {
                    return Some(Ok(event));
                }
                self.compensate(event);
                continue;
            }
            if !self.errors.is_empty() {
                // What stands before the error happens before it.
                if let Some(compensator) = &mut self.compensator
                    && compensator.release(&mut self.compensated)
                {
                    self.compensated.let_go();
                    continue;
                }
                return Some(Err(self.failed()));
            }
            if self.ended {
                if self.finish_compensation() {
                    continue;
                }
                return None;
            }
            self.step();
            self.tell_modes();
        }
    }
}

/// Whether a call moves the machine or lets it wait.
#[inline]
fn takes_time(call: &Call) -> bool {
    matches!(
        call,
        Call::StraightTraverse { .. }
            | Call::StraightFeed { .. }
            | Call::ArcFeed { .. }
            | Call::NurbsFeed { .. }
            | Call::StraightProbe { .. }
            | Call::RigidTap { .. }
            | Call::Dwell { .. }
            | Call::WaitInput { .. }
            | Call::WaitSpindleOriented { .. }
            | Call::ChangeTool { .. }
            | Call::UserCode { .. }
            | Call::ProgramStop
            | Call::OptionalProgramStop
            | Call::PalletShuttle
    )
}

impl std::iter::FusedIterator for Run<'_> {}
