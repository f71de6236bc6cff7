//! The form of every line of a text, without running it.
//!
//! In:  program text.
//! Out: what is wrong with lines whatever the state in which they are run: words, expressions, codes that exclude each
//!      other, blocks of O-words that are not closed.

use crate::block::{Block, Faults};
use crate::error::{Error, ErrorKind};
use crate::expression::Values;
use crate::o_word::{self, Keyword, Label, OWord};
use crate::scan::{Fault, LINE_MAX, Span, is_blank, is_empty};
use crate::text::Text;
use motion::cancel::Cancel;
use std::io::{self, Read, Seek};

/// Parameters of a program that is not run: all there, none known.
pub(crate) struct Unknown;

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
}

/// A block of O-words that has been opened.
struct Opened {
    label: Label,
    keyword: Keyword,
    line: u32,
    text: Vec<u8>,
    span: Span,
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
pub(crate) fn errors(text: impl Read + Seek, errors_max: usize, cancel: &Cancel) -> io::Result<Vec<Error>> {
    let mut text = Text::new(text);
    let mut errors = Vec::new();
    let mut block = Block::default();
    let mut faults = Faults::new();
    let mut opened: Vec<Opened> = Vec::new();
    let (mut any, mut percent) = (false, false);
    while errors.len() < errors_max
        && !cancel.is_cancelled()
        && let Some(line) = text.next_line()?
    {
        let octets = text.octets();
        if line.length > LINE_MAX as u64 {
            let length = line.length as usize;
            let kind = ErrorKind::LineTooLong { length, max: LINE_MAX };
            errors.push(Error::at("", line.number, octets, LINE_MAX - 1..LINE_MAX, kind));
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
        if let Some((cursor, _)) = o_word::start(octets) {
            match o_word::read(cursor, &Unknown) {
                Ok(Some(o_word)) => {
                    if let Err(fault) = nest(&mut opened, &o_word, line.number, octets) {
                        faults.push(fault);
                    }
                }
                Ok(None) => {}
                Err(fault) => faults.push(fault),
            }
        } else {
            block.read(octets, &Unknown, &mut faults);
        }
        for (span, kind) in faults.drain(..) {
            let range = usize::from(span.start)..usize::from(span.end);
            errors.push(Error::at("", line.number, octets, range, kind));
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
        errors.push(Error::at("", block.line, &block.text, range, kind));
    }
    errors.sort_by_key(|error| error.line);
    errors.truncate(errors_max);
    Ok(errors)
}

/// Opens and closes blocks.
fn nest(opened: &mut Vec<Opened>, o_word: &OWord, line: u32, text: &[u8]) -> Result<(), Fault> {
    let label = &o_word.label;
    let not_open = |opener| {
        let label = label.to_string();
        let keyword = o_word.keyword.name();
        Err((o_word.span, ErrorKind::BlockNotOpen { label, keyword, opener }))
    };
    let inner = opened.iter().rposition(|block| block.label == *label);
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
                line,
                text: text.to_vec(),
                span: o_word.span,
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
