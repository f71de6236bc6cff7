//! Comments: messages, prints, logs and plain ones.
//!
//! In:  a text with its values put in.
//! Out: a comment that does the same when it is read, or the reason why no comment can.

use super::line::LINE_CHARACTERS_MAX;
use super::{FlatWriter, Unwritable};
use crate::comment::{self, CommentKind};
use motion::canon::Record;

impl FlatWriter {
    pub(super) fn record(&mut self, record: &Record) -> Result<(), Unwritable> {
        match record {
            Record::Print(text) => self.remark("PRINT,", text),
            Record::OpenLog(path) => self.remark("LOGOPEN,", path),
            Record::AppendLog(path) => self.remark("LOGAPPEND,", path),
            Record::Log(text) => self.remark("LOG,", text),
            Record::CloseLog => self.plain("(LOGCLOSE)"),
            Record::OpenProbeLog(path) => self.remark("PROBEOPEN ", path),
            Record::CloseProbeLog => self.plain("(PROBECLOSE)"),
        }
    }

    pub(super) fn comment(&mut self, text: &str) -> Result<(), Unwritable> {
        let is_record = || {
            let (kind, _) = comment::read(text.as_bytes());
            matches!(kind, CommentKind::OpenProbeLog | CommentKind::CloseProbeLog)
        };
        // Of a log of probing the record comes behind it.
        if text.starts_with("interpreter:") || is_record() {
            return Ok(());
        }
        self.remark("", text)
    }

    /// `(word text)`; `word` is empty for a comment that does nothing.
    pub(super) fn remark(&mut self, word: &str, text: &str) -> Result<(), Unwritable> {
        let inside = format!("{word}{text}");
        let (kind, start) = comment::read(inside.as_bytes());
        let values = matches!(kind, CommentKind::Print | CommentKind::Log);
        let breaks = |letter: char| matches!(letter, '(' | ')' | '\n' | '\r') || values && matches!(letter, '#' | '%');
        let means_the_same = match kind {
            CommentKind::Plain => word.is_empty(),
            _ => start == word.len(),
        };
        if !means_the_same || text.contains(breaks) {
            return Err(Unwritable::Text(text.to_string()));
        }
        if inside.len() + 2 > LINE_CHARACTERS_MAX {
            return Err(Unwritable::TooLong);
        }
        self.text.push('(');
        self.text.push_str(&inside);
        self.text.push_str(")\n");
        Ok(())
    }
}
