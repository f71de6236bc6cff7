//! Comments that do something: messages, logs, ABORT.

use crate::block::Remark;
use crate::comment::{self, CommentKind};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::{Calls, State};
use motion::canon::{Call, Record};

/// Where a program switches messages of DEBUG comments off.
const SHOW_DEBUG: u32 = 5599;

impl State {
    pub(super) fn remark(&mut self, remark: Remark, line: &[u8], calls: &mut Calls) -> Result<(), Fault> {
        let Remark::Parentheses(span) = remark else {
            return Ok(()); // a remark behind a semicolon is for the reader of the text only
        };
        let text = span.slice(line);
        let (kind, start) = comment::read(text);
        let own = &text[start..];
        if text.is_empty() {
            return Ok(()); // nothing to tell
        }
        let plain = || String::from_utf8_lossy(own).into_owned();
        let with_values = || comment::with_values(own, self);
        if matches!(kind, CommentKind::OpenProbeLog | CommentKind::CloseProbeLog) {
            // LinuxCNC's interpreter hands these on as they are; who runs the calls acts on them.
            let whole = String::from_utf8_lossy(text.trim_ascii_start()).into_owned();
            calls.push_back(Call::Comment(whole.into()));
        }
        calls.push_back(match kind {
            CommentKind::Plain => Call::Comment(plain().into()),
            CommentKind::Message => Call::Message(plain()),
            CommentKind::Debug if self.parameters.get(SHOW_DEBUG) == 0.0 => return Ok(()),
            CommentKind::Debug => Call::Message(with_values()),
            CommentKind::Print => Call::Record(Record::Print(with_values())),
            CommentKind::Log => Call::Record(Record::Log(with_values())),
            CommentKind::OpenLog => Call::Record(Record::OpenLog(plain())),
            CommentKind::AppendLog => Call::Record(Record::AppendLog(plain())),
            CommentKind::CloseLog => Call::Record(Record::CloseLog),
            CommentKind::OpenProbeLog => Call::Record(Record::OpenProbeLog(plain().trim().into())),
            CommentKind::CloseProbeLog => Call::Record(Record::CloseProbeLog),
            CommentKind::Abort => {
                let text = with_values();
                return Err((span, ErrorKind::Aborted { text }));
            }
            CommentKind::Python => return Err((span, ErrorKind::PythonComment)),
        });
        Ok(())
    }
}
