//! The form of every line of a text, without running it.
//!
//! In:  program text.
//! Out: what is wrong with lines whatever the state in which they are run: words, expressions, codes that exclude each
//!      other, blocks of O-words that are not closed. Judged is what can be run: the program up to an M2, M30 or M99 that is
//!      in no block, and the subroutines that are called from there.

use crate::Settings;
use crate::block::{Block, Faults};
use crate::code::{Motion, Stop, integer_in};
use crate::error::{Error, ErrorKind, OWordError};
use crate::expression::Values;
use crate::interpreter::of_the_whole;
use crate::o_word::{self, Keyword, Label, OWord};
use crate::octet::{is_blank, is_empty};
use crate::remap;
use crate::scan::{Cursor, Fault, LINE_OCTETS_MAX, Span};
use crate::text::Text;
use motion::cancel::Cancel;
use std::collections::{HashMap, HashSet};
use std::io::{self, Read, Seek};
use std::ops::ControlFlow;

/// Parameters of a program that is not run: all there, none known.
#[derive(Default)]
pub(crate) struct Unknown {
    /// Codes that call subroutines.
    remaps: Vec<remap::Entry>,
}

impl Values for Unknown {
    fn numbered(&self, _: u32) -> Option<f64> {
        Some(f64::NAN)
    }

    fn named(&self, _: &str) -> Option<f64> {
        Some(f64::NAN)
    }

    fn nearest(&self, _: &str) -> Option<String> {
        None
    }

    fn remapped(&self, letter: u8, number: f64) -> Option<usize> {
        self.remaps.iter().position(|entry| entry.is(letter, number))
    }
}

/// A part of a text that is run as a whole or not at all: a subroutine; `None`: the program itself.
type Part = Option<Label>;

/// Which parts call which.
#[derive(Default)]
struct Calls {
    calls: HashMap<Part, HashSet<Label>>,
    count: usize,
    /// A label is computed, or there are too many: any subroutine may be called.
    any: bool,
}

impl Calls {
    fn add(&mut self, from: &Part, to: Option<Label>) {
        match to {
            Some(label) if self.count < CALLS_MAX => {
                self.count += usize::from(self.calls.entry(from.clone()).or_default().insert(label));
            }
            Some(_) | None => self.any = true,
        }
    }

    /// The parts that are run.
    fn reached(&self) -> HashSet<Part> {
        let mut reached = HashSet::from([None]);
        let mut next = vec![None];
        while let Some(part) = next.pop() {
            for label in self.calls.get(&part).into_iter().flatten() {
                let called = Some(label.clone());
                if reached.insert(called.clone()) {
                    next.push(called);
                }
            }
        }
        reached
    }
}

/// Most calls that are told apart.
const CALLS_MAX: usize = 100_000;
/// Most mistakes that are kept of subroutines that may not be called, as a multiple of those that are told.
const ERRORS_KEPT_PER_TOLD: usize = 10;

/// A block of O-words that has been opened.
struct Opened {
    label: Label,
    keyword: Keyword,
    line: u32,
    text: Vec<u8>,
    span: Span,
    part: Part,
    /// Whether it stands behind the end of the program.
    behind_end: bool,
}

impl Opened {
    /// O-words that close it.
    fn closed_by(&self) -> &'static [Keyword] {
        match self.keyword {
            Keyword::Sub => &[Keyword::EndSub],
            Keyword::If => &[Keyword::EndIf],
            Keyword::While => &[Keyword::EndWhile],
            Keyword::Do => &[Keyword::While],
            Keyword::Repeat => &[Keyword::EndRepeat],
            Keyword::Program
            | Keyword::EndSub
            | Keyword::Call
            | Keyword::Return
            | Keyword::ElseIf
            | Keyword::Else
            | Keyword::EndIf
            | Keyword::EndWhile
            | Keyword::EndRepeat
            | Keyword::Break
            | Keyword::Continue => &[],
        }
    }

    /// The mistake of a block that is open at the end of the text, and the part that it concerns.
    fn not_closed(self) -> (Part, Error) {
        let expected = self
            .closed_by()
            .first()
            .map_or_else(String::new, |keyword| keyword.name());
        let kind = OWordError::BlockNotClosed {
            label: self.label.to_string(),
            keyword: self.keyword.name(),
            expected: format!("{} {expected}", self.label),
        }
        .into();
        let range = usize::from(self.span.start)..usize::from(self.span.end);
        // The program comes to the beginning of a subroutine, and looks for its end.
        let of_program = self.keyword == Keyword::Sub && !self.behind_end;
        let part = if of_program { None } else { self.part };
        (part, Error::at("", self.line, &self.text, range, kind))
    }
}

/// All that is wrong with the form of a text, in the order of its lines, `errors_max` mistakes at most.
///
/// Reads to the end of the text, also behind M2, where subroutines may stand.
///
/// # Errors
/// The text cannot be read.
pub(crate) fn errors(
    text: impl Read + Seek,
    settings: &Settings,
    errors_max: usize,
    cancel: &Cancel,
) -> io::Result<Vec<Error>> {
    let mut text = Text::new(text);
    let mut form = Form::new(settings);
    let (mut any, mut percent) = (false, false);
    while !cancel.is_cancelled()
        && form.of_program < errors_max
        && form.of_subroutines < ERRORS_KEPT_PER_TOLD * errors_max
        && let Some(line) = text.next_line()?
    {
        let octets = text.octets();
        if line.length > LINE_OCTETS_MAX as u64 {
            form.too_long(line.number, octets, line.length as usize);
            continue;
        }
        let Some(first) = octets.iter().position(|octet| !is_blank(*octet)) else {
            continue;
        };
        if octets[first] == b'%' && is_empty(&octets[first + 1..]) && (!any || percent) {
            if any {
                break; // nothing behind the closing % is read
            }
            (any, percent) = (true, true);
            continue;
        }
        any = true;
        if form.line(line.number, octets).is_break() {
            break;
        }
    }
    if cancel.is_cancelled() {
        form.opened.clear(); // what closes them has not been read
    }
    Ok(form.finish(errors_max))
}

/// What the lines up to one have come to.
struct Form {
    unknown: Unknown,
    /// With the parts that they are about.
    errors: Vec<(Part, Error)>,
    /// Of these, so many in lines of the program and of subroutines.
    of_program: usize,
    of_subroutines: usize,
    calls: Calls,
    opened: Vec<Opened>,
    /// Where the line is.
    part: Part,
    /// Behind the end of the program; what is in no subroutine is not run.
    ended: bool,
    /// Of the line; kept for their memory.
    block: Block,
    faults: Faults,
}

impl Form {
    fn new(settings: &Settings) -> Form {
        let mut calls = Calls::default();
        for remap in &settings.remaps {
            calls.add(&None, Some(Label::Name(remap.subroutine.as_str().into())));
        }
        Form {
            unknown: Unknown {
                remaps: settings.remaps.iter().map(remap::Entry::new).collect(),
            },
            errors: Vec::new(),
            of_program: 0,
            of_subroutines: 0,
            calls,
            opened: Vec::new(),
            part: None,
            ended: false,
            block: Block::default(),
            faults: Faults::new(),
        }
    }

    /// Whether the line may be run.
    fn is_run(&self) -> bool {
        self.part.is_some() || !self.ended
    }

    fn too_long(&mut self, number: u32, octets: &[u8], length: usize) {
        if self.is_run() {
            let max = LINE_OCTETS_MAX;
            let kind = ErrorKind::LineTooLong { length, max };
            let error = Error::at("", number, octets, max - 1..max, kind);
            self.errors.push((self.part.clone(), error));
        }
    }

    /// Reads a line that is not empty; `Break`: what is wrong with it is so with the whole text.
    fn line(&mut self, number: u32, octets: &[u8]) -> ControlFlow<()> {
        self.faults.clear();
        let is_last = match o_word::start(octets) {
            Some((cursor, _)) => self.o_word(cursor, number, octets),
            None => self.words(octets),
        };
        if self.is_run() {
            self.tell(number, octets)?;
        }
        if is_last && self.part.take().is_none() {
            self.ended = true;
        }
        ControlFlow::Continue(())
    }

    /// An O-word; whether its part ends with it.
    fn o_word(&mut self, cursor: Cursor<'_>, number: u32, octets: &[u8]) -> bool {
        let o_word = match o_word::read(cursor, &self.unknown) {
            Ok(Some(o_word)) => o_word,
            Ok(None) => {
                self.calls.any |= self.is_run();
                return false;
            }
            Err(fault) => {
                self.faults.push(fault);
                return false;
            }
        };
        let begins = match o_word.keyword {
            Keyword::Sub => self.part.is_none(),
            Keyword::Program => self.ended && self.part.is_none(),
            _ => false,
        };
        if begins {
            self.part = Some(o_word.label.clone());
            self.opened.retain(|block| block.part != self.part);
        }
        if o_word.keyword == Keyword::Call {
            self.calls.add(&self.part, Some(o_word.label.clone()));
        }
        if let Err(fault) = self.nest(&o_word, number, octets) {
            self.faults.push(fault);
        }
        o_word.keyword == Keyword::EndSub && self.part.as_ref() == Some(&o_word.label)
    }

    /// Words; whether the part ends with them.
    fn words(&mut self, octets: &[u8]) -> bool {
        self.block.read(octets, &self.unknown, &mut self.faults);
        let codes = &self.block.codes;
        let stop = codes.stop.map(|code| code.value);
        let motion = codes.motion.and_then(|code| code.value);
        let calls_profile = matches!(motion, Some(Motion::Finish | Motion::Rough(_)));
        for (letter, calls) in [(b'P', stop == Some(Stop::Call)), (b'Q', calls_profile)] {
            if let Some(number) = self.block.word_value(letter).filter(|_| calls) {
                let label = integer_in(number, 0..=i64::from(u32::MAX));
                self.calls
                    .add(&self.part, label.map(|number| Label::Number(number as u32)));
            }
        }
        let is_deleted = octets.iter().find(|octet| !is_blank(**octet)) == Some(&b'/');
        let mut around = self.opened.iter().filter(|block| block.part == self.part);
        match stop {
            _ if is_deleted => false,
            // A subroutine is left by its M99 in no block; M2 ends the program, also from there.
            Some(Stop::Return) if self.part.is_some() => around.next().is_none(),
            Some(Stop::End | Stop::PalletEnd | Stop::Return) => {
                self.part.is_none() && around.all(|block| block.keyword == Keyword::Sub)
            }
            _ => false,
        }
    }

    /// Keeps what is wrong with a line.
    fn tell(&mut self, number: u32, octets: &[u8]) -> ControlFlow<()> {
        let whole = of_the_whole(octets, &self.faults);
        let is_whole = whole.is_some();
        if let Some(whole) = whole {
            self.faults.clear();
            self.faults.push(whole);
        }
        for (span, kind) in self.faults.drain(..) {
            let range = usize::from(span.start)..usize::from(span.end);
            let error = Error::at("", number, octets, range, kind);
            self.errors.push((self.part.clone(), error));
            match self.part {
                None => self.of_program += 1,
                Some(_) => self.of_subroutines += 1,
            }
        }
        if is_whole && self.part.is_none() {
            self.opened.clear(); // what closes them is not looked for
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }

    /// Opens and closes blocks.
    fn nest(&mut self, o_word: &OWord, number: u32, octets: &[u8]) -> Result<(), Fault> {
        let label = &o_word.label;
        let not_open = |opener| {
            let label = label.to_string();
            let keyword = o_word.keyword.name();
            Err((o_word.span, OWordError::BlockNotOpen { label, keyword, opener }.into()))
        };
        let opened = &mut self.opened;
        let inner = opened
            .iter()
            .rposition(|block| block.label == *label && block.part == self.part);
        let closes = inner.is_some_and(|at| opened[at].closed_by().contains(&o_word.keyword));
        match o_word.keyword {
            Keyword::While | Keyword::EndIf | Keyword::EndWhile | Keyword::EndRepeat | Keyword::EndSub if closes => {
                opened.remove(inner.expect("it closes one"));
                Ok(())
            }
            Keyword::EndIf => not_open("if"),
            Keyword::EndWhile => not_open("while"),
            Keyword::EndRepeat => not_open("repeat"),
            Keyword::EndSub => not_open("sub"),
            Keyword::Sub | Keyword::If | Keyword::While | Keyword::Do | Keyword::Repeat => {
                opened.push(Opened {
                    label: label.clone(),
                    keyword: o_word.keyword,
                    line: number,
                    text: octets.to_vec(),
                    span: o_word.span,
                    part: self.part.clone(),
                    behind_end: self.ended,
                });
                Ok(())
            }
            Keyword::ElseIf | Keyword::Else if inner.is_none_or(|at| opened[at].keyword != Keyword::If) => {
                not_open("if")
            }
            // LinuxCNC knows neither for repeat.
            Keyword::Break | Keyword::Continue
                if inner.is_none_or(|at| !matches!(opened[at].keyword, Keyword::While | Keyword::Do)) =>
            {
                not_open("while or do")
            }
            Keyword::ElseIf
            | Keyword::Else
            | Keyword::Break
            | Keyword::Continue
            | Keyword::Program
            | Keyword::Call
            | Keyword::Return => Ok(()),
        }
    }

    /// All mistakes of what is run, with the blocks that are still open.
    fn finish(mut self, errors_max: usize) -> Vec<Error> {
        let not_closed = self.opened.into_iter().map(Opened::not_closed);
        self.errors.extend(not_closed);
        let reached = self.calls.reached();
        let is_run = |part: &Part| self.calls.any || reached.contains(part);
        let run = self.errors.into_iter().filter(|(part, _)| is_run(part));
        let mut errors: Vec<Error> = run.map(|(_, error)| error).collect();
        errors.sort_by_key(|error| error.line);
        errors.truncate(errors_max);
        errors
    }
}
