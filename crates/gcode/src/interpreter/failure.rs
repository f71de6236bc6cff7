//! What goes wrong in a run, with its place in the text.

use super::Run;
use crate::error::{CallSite, Error, ErrorKind};
use crate::flow::Level;
use crate::foreign::language;
use crate::scan::{Fault, Span};
use ::compensation::CompensationError;
use motion::canon::{Event, Source};
use std::ops::Range;

/// What is wrong with the whole text, as far as its first wrong line shows it: one mistake instead of one in every line.
pub(crate) fn of_the_whole(line: &[u8], faults: &[Fault]) -> Option<Fault> {
    let is_garbled = |(_, kind): &Fault| matches!(kind, ErrorKind::BadCharacter(_));
    if line.contains(&0) && faults.iter().any(is_garbled) {
        return Some((Span::default(), ErrorKind::Binary));
    }
    let language = faults.iter().find_map(|(_, kind)| language(line, kind))?;
    Some((Span::new(0, line.len()), ErrorKind::OtherLanguage(language)))
}

impl Run<'_> {
    /// An error of the machine that carries out a block: at its first word of this letter, or at all of it.
    pub fn error_at(&mut self, source: Source, letter: Option<char>, what: String) -> Box<Error> {
        let octets = self.line_of(source);
        let span = letter.and_then(|letter| word_of(&octets, letter));
        let name = &self.files[usize::from(source.file)].name;
        let kind = ErrorKind::Machine(what);
        let span = span.unwrap_or(0..octets.len());
        Box::new(Error::at(name, source.line.max(1), &octets, span, kind))
    }

    /// The line read last is wrong.
    #[cold]
    pub(crate) fn fail(&mut self, span: Span, kind: ErrorKind) {
        self.faults.clear();
        self.faults.push((span, kind));
        self.fail_all();
    }

    #[cold]
    pub(super) fn fail_all(&mut self) {
        let octets = self.line_of(self.source);
        if let Some(of_all) = of_the_whole(&octets, &self.faults) {
            self.ended = true;
            self.faults = vec![of_all];
        }
        let sites: Vec<CallSite> = self
            .levels
            .iter()
            .rev()
            .filter_map(|level| self.call_site(level))
            .collect();
        let faults = std::mem::take(&mut self.faults);
        for (span, kind) in faults {
            let range = usize::from(span.start)..usize::from(span.end);
            let name = &self.files[usize::from(self.source.file)].name;
            let mut error = Error::at(name, self.source.line.max(1), &octets, range, kind);
            error.calls.clone_from(&sites);
            self.errors.push(error);
        }
    }

    pub(super) fn call_site(&self, level: &Level) -> Option<CallSite> {
        let back = level.back?;
        Some(CallSite {
            subroutine: level.label.as_ref()?.to_string(),
            file: self.files[back.file].name.clone(),
            line: back.line,
        })
    }

    /// The text of a line that was read before; reading goes on where it was.
    #[cold]
    pub(super) fn line_of(&mut self, source: Source) -> Vec<u8> {
        let text = &mut self.files[usize::from(source.file)].text;
        if source.line == 0 {
            return Vec::new();
        }
        let (offset, number) = text.place();
        text.seek(u64::from(source.start), source.line - 1);
        let octets = match text.next_line() {
            Ok(Some(_)) => text.octets().to_vec(),
            Ok(None) | Err(_) => Vec::new(),
        };
        text.seek(offset, number);
        octets
    }

    /// Nothing is run any more, and nothing that was is handed out.
    #[cold]
    pub(super) fn cancelled(&mut self) -> Option<Result<Event, Box<Error>>> {
        if self.ended && self.calls.is_empty() && self.errors.is_empty() && self.refused.is_none() {
            return None;
        }
        self.fail(Span::default(), ErrorKind::Cancelled);
        let error = self.errors.pop()?;
        self.refused = None;
        self.end_by_error(Box::new(error))
    }

    /// The error of the line read last, whose calls have been handed out.
    #[cold]
    pub(super) fn failed(&mut self) -> Box<Error> {
        let error = Box::new(self.errors.swap_remove(0));
        self.errors.clear();
        if self.continues && !self.ended {
            while self.levels.len() > 1 {
                self.leave(None);
            }
            return error;
        }
        self.ended = true;
        // Moves that wait for the next one are not run.
        self.compensator = None;
        error
    }

    /// The last thing that is told; moves that are held wait for one that never comes.
    #[cold]
    pub(super) fn end_by_error(&mut self, error: Box<Error>) -> Option<Result<Event, Box<Error>>> {
        self.ended = true;
        self.calls.clear();
        self.errors.clear();
        self.compensator = None;
        self.compensated.clear();
        Some(Err(error))
    }

    /// The error with the line it is about, which may have been read a while ago.
    #[cold]
    pub(super) fn compensation_error(&mut self, error: &CompensationError) -> Box<Error> {
        let kind = ErrorKind::Compensation(error.kind);
        let source = error.source;
        let octets = self.line_of(source);
        let file = &self.files[usize::from(source.file)];
        let all = 0..octets.len();
        Box::new(Error::at(&file.name, source.line, &octets, all, kind))
    }
}

/// Octets of the first word of a letter in a line, out of comments and expressions.
fn word_of(line: &[u8], letter: char) -> Option<Range<usize>> {
    let (mut open, mut begin, mut end) = (0_u32, None, line.len());
    for (at, octet) in line.iter().enumerate() {
        let is_over = open == 0 && (matches!(octet, b'(' | b';') || octet.is_ascii_alphabetic());
        if is_over && begin.is_some() {
            end = at;
            break;
        }
        match octet {
            b';' if open == 0 => return None,
            b'(' | b'[' | b'<' => open += 1,
            b')' | b']' | b'>' => open = open.saturating_sub(1),
            octet if is_over && char::from(*octet).eq_ignore_ascii_case(&letter) => begin = Some(at),
            _ => {}
        }
    }
    begin.map(|begin| begin..begin + line[begin..end].trim_ascii_end().len())
}
