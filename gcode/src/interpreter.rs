//! A whole text, line by line.
//!
//! In:  program text and [`Settings`].
//! Out: [`Event`]s one by one, or the first error ([`Interpreter::run`]); all errors ([`check`]).
//!
//! Reads a line when the calls of the one before are used up, so memory does not grow with the program.

use crate::block::{Block, Faults};
use crate::error::{Error, ErrorKind};
use crate::execute::{Executor, Flow};
use crate::modal::Stop;
use crate::scan::{LINE_MAX, is_blank};
use motion::canon::{Call, Event, LengthUnit, PathMode, Position, Source};
use std::collections::VecDeque;

/// What the machine remembers from before the program.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Where the axes stand, machine coordinates.
    pub start: Position,
    /// Origins of G54 (index 0) to G59.3 (index 8), machine coordinates.
    pub work_offsets: [Position; 9],
    /// Work system that is active at the start: 1 for G54 to 9 for G59.3; beyond, the nearest of them.
    pub work_system: u8,
    /// Path mode at the start.
    pub path_mode: PathMode,
    /// Unit at the start.
    pub length_unit: LengthUnit,
    /// Stored point of G28, machine coordinates.
    pub g28: Position,
    /// Stored point of G30, machine coordinates.
    pub g30: Position,
    /// Whether lines that begin with `/` are left out.
    pub block_delete: bool,
}

impl Default for Settings {
    /// Everything at zero, G54, G21, G64 without tolerance, no block delete.
    fn default() -> Settings {
        Settings {
            start: Position::ZERO,
            work_offsets: [Position::ZERO; 9],
            work_system: 1,
            path_mode: PathMode::Continuous {
                tolerance_mm: None,
                naive_cam_tolerance_mm: None,
            },
            length_unit: LengthUnit::Millimetre,
            g28: Position::ZERO,
            g30: Position::ZERO,
            block_delete: false,
        }
    }
}

/// How the end of the program is marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Delimiter {
    /// No line with text has been read.
    Unknown,
    /// By M2 or M30.
    ProgramEnd,
    /// By `%`, as there was one at the start; M2 and M30 end it too.
    Percent,
}

/// The state of one run through a program.
///
/// The first calls tell unit, active work system, plane and path mode; their [`Source`] has line 0. Not told, as they
/// are always the same at the start: no G92 offset, no rotation, no tool length offset; and no feed is set.
#[derive(Clone, Debug)]
pub struct Interpreter {
    executor: Executor,
    delimiter: Delimiter,
    /// Next octet to read.
    offset: usize,
    /// Number and first octet of the line read last.
    line: u32,
    line_start: usize,
    ended: bool,
    /// Calls of the line read last that have not been handed out.
    calls: VecDeque<Call>,
    source: Source,
    /// Kept for their memory.
    block: Block,
    faults: Faults,
    errors: Vec<Error>,
}

impl Interpreter {
    /// An interpreter before the first line of a program.
    pub fn new(settings: Settings) -> Interpreter {
        let executor = Executor::new(settings);
        let mut calls = VecDeque::new();
        executor.start(&mut calls);
        Interpreter {
            executor,
            delimiter: Delimiter::Unknown,
            offset: 0,
            line: 0,
            line_start: 0,
            ended: false,
            calls,
            source: Source::default(),
            block: Block::default(),
            faults: Faults::new(),
            errors: Vec::new(),
        }
    }

    /// The events of a program, lazily. Ends after M2, M30, the closing `%` or the first error; a block with an error
    /// has no effect.
    pub fn run(self, text: &[u8]) -> Run<'_> {
        Run {
            interpreter: self,
            text,
        }
    }

    /// The next event of `text`, for those who keep the text themselves; `text` must be the same at every call.
    /// `None`: the program has ended.
    pub fn next_event(&mut self, text: &[u8]) -> Option<Result<Event, Error>> {
        loop {
            if let Some(call) = self.calls.pop_front() {
                return Some(Ok(Event {
                    source: self.source,
                    call,
                }));
            }
            if self.ended {
                return None;
            }
            self.step(text);
            if !self.errors.is_empty() {
                self.ended = true;
                self.calls.clear();
                return Some(Err(self.errors.swap_remove(0)));
            }
        }
    }

    /// Reads and runs one line: fills `calls`, or `errors`.
    fn step(&mut self, text: &[u8]) {
        if u32::try_from(text.len()).is_err() {
            self.ended = true;
            self.errors.push(Error::at(text, 1, 0, 0..0, ErrorKind::ProgramTooLong));
            return;
        }
        let Some(rest) = text.get(self.offset..).filter(|rest| !rest.is_empty()) else {
            return self.end_of_text(text);
        };
        self.line += 1;
        self.line_start = self.offset;
        let length = rest.iter().position(|octet| *octet == b'\n').unwrap_or(rest.len());
        self.offset += (length + 1).min(rest.len());
        let line = &rest[..length];
        let line = line.strip_suffix(b"\r").unwrap_or(line);

        let Some(first) = line.iter().position(|octet| !is_blank(*octet)) else {
            return;
        };
        if line[first] == b'%' && line[first + 1..].iter().all(|octet| is_blank(*octet)) {
            match self.delimiter {
                Delimiter::Unknown => return self.delimiter = Delimiter::Percent,
                Delimiter::Percent => return self.ended = true,
                Delimiter::ProgramEnd => {} // refused as any other octet that means nothing
            }
        }
        if self.delimiter == Delimiter::Unknown {
            self.delimiter = Delimiter::ProgramEnd;
        }
        if line.len() > LINE_MAX {
            let span = self.line_start + LINE_MAX..self.line_start + line.len();
            let kind = ErrorKind::LineTooLong {
                length: line.len(),
                max: LINE_MAX,
            };
            self.errors
                .push(Error::at(text, self.line, self.line_start, span, kind));
            return;
        }
        if line[first] == b'/' && self.executor.block_delete() {
            return;
        }
        self.run_line(text, line);
    }

    fn run_line(&mut self, text: &[u8], line: &[u8]) {
        self.faults.clear();
        self.block.read(line, &mut self.faults);
        self.source = Source {
            file: 0,
            line: self.line,
            n: self.block.n,
            n_digits: line_number_digits(line),
            start: self.line_start as u32, // the text is shorter than 4 GiB
            end: (self.line_start + line.len()) as u32,
        };
        if self.faults.is_empty() {
            match self.executor.execute(&self.block, line, &mut self.calls) {
                Ok(Flow::On) => {}
                Ok(Flow::End) => self.ended = true,
                Err(fault) => self.faults.push(fault),
            }
        }
        if !self.faults.is_empty() {
            self.executor.recover(&self.block, &self.faults);
            self.ended |= self.block.codes.stop.is_some_and(|coded| coded.value == Stop::End);
        }
        for (span, kind) in self.faults.drain(..) {
            let span = self.line_start + usize::from(span.start)..self.line_start + usize::from(span.end);
            self.errors
                .push(Error::at(text, self.line, self.line_start, span, kind));
        }
    }

    /// No line is left although the program has not ended.
    fn end_of_text(&mut self, text: &[u8]) {
        self.ended = true;
        let kind = match self.delimiter {
            Delimiter::Unknown | Delimiter::ProgramEnd => ErrorKind::ProgramEndMissing,
            Delimiter::Percent => ErrorKind::PercentMissing,
        };
        let last_line = text[self.line_start..].trim_ascii_end().len();
        let end = self.line_start + last_line;
        self.errors
            .push(Error::at(text, self.line.max(1), self.line_start, end..end, kind));
    }
}

/// Digits behind the N at the start of a line, zeros in front counted; 0 without any.
fn line_number_digits(line: &[u8]) -> u8 {
    let start = line.iter().position(|octet| !is_blank(*octet) && *octet != b'/');
    let Some((b'N' | b'n', rest)) = start.and_then(|start| line[start..].split_first()) else {
        return 0;
    };
    let digits = rest.iter().take_while(|octet| octet.is_ascii_digit()).count();
    u8::try_from(digits).unwrap_or(u8::MAX)
}

/// The events of a program; made by [`Interpreter::run`].
#[derive(Clone, Debug)]
pub struct Run<'t> {
    interpreter: Interpreter,
    text: &'t [u8],
}

impl Iterator for Run<'_> {
    type Item = Result<Event, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.interpreter.next_event(self.text)
    }
}

impl std::iter::FusedIterator for Run<'_> {}

/// All errors of a program, in the order of its lines. A mistake is told once: the lines behind it are read as if it
/// were mended.
pub fn check(text: &[u8], settings: Settings) -> Vec<Error> {
    let mut interpreter = Interpreter::new(settings);
    let mut errors = Vec::new();
    while !interpreter.ended {
        interpreter.step(text);
        interpreter.calls.clear();
        errors.append(&mut interpreter.errors);
    }
    errors
}
