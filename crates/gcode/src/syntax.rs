//! The form of every line of a text, without running it.
//!
//! In:  program text.
//! Out: what is wrong with lines whatever the state in which they are run: words, expressions, codes that exclude each
//!      other, blocks of O-words that are not closed. Judged is what can be run: the program up to an M2, M30 or M99 that is
//!      in no block, and the subroutines that are called from there.

use crate::Settings;
use crate::block::{Block, Faults};
use crate::code::{Motion, Stop, integer_in};
use crate::error::{Error, ErrorKind};
use crate::expression::Values;
use crate::interpreter::of_the_whole;
use crate::o_word::{self, Keyword, Label, OWord};
use crate::octet::{is_blank, is_empty};
use crate::remap;
use crate::scan::{Fault, LINE_OCTETS_MAX, Span};
use crate::text::Text;
use motion::cancel::Cancel;
use std::collections::{HashMap, HashSet};
use std::io::{self, Read, Seek};

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
    let unknown = Unknown {
        remaps: settings.remaps.iter().map(remap::Entry::new).collect(),
    };
    // With what they are about.
    let mut errors: Vec<(Part, Error)> = Vec::new();
    let mut calls = Calls::default();
    for remap in &settings.remaps {
        calls.add(&None, Some(Label::Name(remap.subroutine.as_str().into())));
    }
    // Where the line is; `ended`: behind the end of the program, but in no subroutine.
    let (mut part, mut ended): (Part, bool) = (None, false);
    let (mut of_program, mut of_subroutines) = (0, 0);
    let mut block = Block::default();
    let mut faults = Faults::new();
    let mut opened: Vec<Opened> = Vec::new();
    let (mut any, mut percent) = (false, false);
    while !cancel.is_cancelled()
        && of_program < errors_max
        && of_subroutines < ERRORS_KEPT_PER_TOLD * errors_max
        && let Some(line) = text.next_line()?
    {
        let octets = text.octets();
        if line.length > LINE_OCTETS_MAX as u64 {
            let length = line.length as usize;
            let kind = ErrorKind::LineTooLong {
                length,
                max: LINE_OCTETS_MAX,
            };
            if part.is_some() || !ended {
                let error = Error::at("", line.number, octets, LINE_OCTETS_MAX - 1..LINE_OCTETS_MAX, kind);
                errors.push((part.clone(), error));
            }
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
        faults.clear();
        let (mut leaves, mut ends) = (false, false);
        if let Some((cursor, _)) = o_word::start(octets) {
            match o_word::read(cursor, &unknown) {
                Ok(Some(o_word)) => {
                    let begins = match o_word.keyword {
                        Keyword::Sub => part.is_none(),
                        Keyword::Program => ended && part.is_none(),
                        _ => false,
                    };
                    if begins {
                        part = Some(o_word.label.clone());
                        opened.retain(|block| block.part != part);
                    }
                    leaves = o_word.keyword == Keyword::EndSub && part.as_ref() == Some(&o_word.label);
                    if o_word.keyword == Keyword::Call {
                        calls.add(&part, Some(o_word.label.clone()));
                    }
                    let place = Place {
                        line: line.number,
                        text: octets,
                        part: &part,
                        behind_end: ended,
                    };
                    if let Err(fault) = nest(&mut opened, &o_word, &place) {
                        faults.push(fault);
                    }
                }
                Ok(None) => calls.any |= part.is_some() || !ended,
                Err(fault) => faults.push(fault),
            }
        } else {
            block.read(octets, &unknown, &mut faults);
            let stop = block.codes.stop.map(|code| code.value);
            let profile = matches!(
                block.codes.motion.map(|code| code.value),
                Some(Some(Motion::Finish | Motion::Rough(_)))
            );
            for letter in [b'P', b'Q'] {
                let called = if letter == b'P' {
                    stop == Some(Stop::Call)
                } else {
                    profile
                };
                if called && let Some(number) = block.word_value(letter) {
                    let label = integer_in(number, 0..=i64::from(u32::MAX));
                    calls.add(&part, label.map(|number| Label::Number(number as u32)));
                }
            }
            let deleted = octets[first] == b'/';
            let in_block = opened
                .iter()
                .any(|block| block.part == part && block.keyword != Keyword::Sub);
            if matches!(stop, Some(Stop::End | Stop::PalletEnd | Stop::Return)) && !deleted && !in_block {
                match part {
                    None => ends = true,
                    Some(_) => leaves = stop == Some(Stop::Return) && !opened.iter().any(|block| block.part == part),
                }
            }
        }
        if part.is_some() || !ended {
            let whole = of_the_whole(octets, &faults);
            let is_whole = whole.is_some();
            if let Some(whole) = whole {
                faults.clear();
                faults.push(whole);
            }
            for (span, kind) in faults.drain(..) {
                let range = usize::from(span.start)..usize::from(span.end);
                errors.push((part.clone(), Error::at("", line.number, octets, range, kind)));
                match part {
                    None => of_program += 1,
                    Some(_) => of_subroutines += 1,
                }
            }
            if is_whole && part.is_none() {
                opened.clear(); // what closes them is not looked for
                break;
            }
        }
        ended |= ends;
        if leaves {
            part = None;
        }
    }
    if cancel.is_cancelled() {
        opened.clear(); // what closes them has not been read
    }
    for block in opened {
        let expected = block
            .closed_by()
            .first()
            .map_or_else(String::new, |keyword| keyword.name());
        let kind = ErrorKind::BlockNotClosed {
            label: block.label.to_string(),
            keyword: block.keyword.name(),
            expected: format!("{} {expected}", block.label),
        };
        let range = usize::from(block.span.start)..usize::from(block.span.end);
        // The program comes to the beginning of a subroutine, and looks for its end.
        let of_program = block.keyword == Keyword::Sub && !block.behind_end;
        let part = if of_program { None } else { block.part };
        errors.push((part, Error::at("", block.line, &block.text, range, kind)));
    }
    let reached = calls.reached();
    errors.retain(|(part, _)| calls.any || reached.contains(part));
    let mut errors: Vec<Error> = errors.into_iter().map(|(_, error)| error).collect();
    errors.sort_by_key(|error| error.line);
    errors.truncate(errors_max);
    Ok(errors)
}

/// Where an O-word stands.
struct Place<'t> {
    line: u32,
    text: &'t [u8],
    part: &'t Part,
    behind_end: bool,
}

/// Opens and closes blocks.
fn nest(opened: &mut Vec<Opened>, o_word: &OWord, place: &Place<'_>) -> Result<(), Fault> {
    let label = &o_word.label;
    let not_open = |opener| {
        let label = label.to_string();
        let keyword = o_word.keyword.name();
        Err((o_word.span, ErrorKind::BlockNotOpen { label, keyword, opener }))
    };
    let inner = opened
        .iter()
        .rposition(|block| block.label == *label && block.part == *place.part);
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
                line: place.line,
                text: place.text.to_vec(),
                span: o_word.span,
                part: place.part.clone(),
                behind_end: place.behind_end,
            });
            Ok(())
        }
        Keyword::ElseIf | Keyword::Else if inner.is_none_or(|at| opened[at].keyword != Keyword::If) => not_open("if"),
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
