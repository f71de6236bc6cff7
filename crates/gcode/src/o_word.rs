//! O-words of a line: `O100 sub`, `o<name> call [1] [2]`.
//!
//! In:  a line whose first word is O; what `#` stands for.
//! Out: label, keyword and arguments. What they do is in `flow`.

use crate::block::LineNumber;
use crate::code::integer_in;
use crate::error::OWordError;
use crate::expression::Values;
use crate::near_miss::nearest;
use crate::parameter::ARGUMENTS_MAX;
use crate::scan::{Cursor, Fault, Item, Span};
use std::fmt;

/// What an O-word is called.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Label {
    /// `O100`
    Number(u32),
    /// `O<name>`, in lower case without blanks.
    Name(Box<str>),
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Label::Number(number) => write!(f, "O{number}"),
            Label::Name(name) => write!(f, "O<{name}>"),
        }
    }
}

/// What an O-word does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keyword {
    /// `O5` alone: a program for M98.
    Program,
    Sub,
    EndSub,
    Call,
    Return,
    If,
    ElseIf,
    Else,
    EndIf,
    While,
    EndWhile,
    Do,
    Repeat,
    EndRepeat,
    Break,
    Continue,
}

impl Keyword {
    const ALL: [(Keyword, &str); 15] = [
        (Keyword::Sub, "SUB"),
        (Keyword::EndSub, "ENDSUB"),
        (Keyword::Call, "CALL"),
        (Keyword::Return, "RETURN"),
        (Keyword::If, "IF"),
        (Keyword::ElseIf, "ELSEIF"),
        (Keyword::Else, "ELSE"),
        (Keyword::EndIf, "ENDIF"),
        (Keyword::While, "WHILE"),
        (Keyword::EndWhile, "ENDWHILE"),
        (Keyword::Do, "DO"),
        (Keyword::Repeat, "REPEAT"),
        (Keyword::EndRepeat, "ENDREPEAT"),
        (Keyword::Break, "BREAK"),
        (Keyword::Continue, "CONTINUE"),
    ];

    /// As it is written, lower case.
    pub(crate) fn name(self) -> String {
        Keyword::ALL
            .iter()
            .find(|(keyword, _)| *keyword == self)
            .map_or_else(String::new, |(_, name)| name.to_ascii_lowercase())
    }

    /// How many arguments there must and may be.
    fn arguments(self) -> (usize, usize) {
        match self {
            Keyword::If | Keyword::ElseIf | Keyword::While | Keyword::Repeat => (1, 1),
            Keyword::Call => (0, ARGUMENTS_MAX),
            Keyword::Return | Keyword::EndSub => (0, 1),
            Keyword::Program
            | Keyword::Sub
            | Keyword::Else
            | Keyword::EndIf
            | Keyword::EndWhile
            | Keyword::Do
            | Keyword::EndRepeat
            | Keyword::Break
            | Keyword::Continue => (0, 0),
        }
    }
}

/// An O-word line.
#[derive(Clone, Debug)]
pub(crate) struct OWord {
    pub(crate) label: Label,
    pub(crate) keyword: Keyword,
    /// The whole line but comments.
    pub(crate) span: Span,
    pub(crate) arguments: [f64; ARGUMENTS_MAX],
    pub(crate) argument_count: usize,
}

impl OWord {
    /// The only argument, of keywords that have one.
    pub(crate) fn argument(&self) -> f64 {
        self.arguments[0]
    }
}

/// A cursor behind the O of an O-word line, and its N-word; `None`: it is no O-word line.
pub(crate) fn start(line: &[u8]) -> Option<(Cursor<'_>, Option<LineNumber>)> {
    let mut cursor = Cursor::new(line);
    let mut n = None;
    loop {
        match cursor.item()? {
            Ok(Item::BlockDelete) => {}
            Ok(Item::Letter(b'N')) if n.is_none() => n = Some(LineNumber::read(&mut cursor).ok()?),
            Ok(Item::Letter(b'O')) => return Some((cursor, n)),
            Ok(_) | Err(_) => return None,
        }
    }
}

/// Label and keyword behind an O; the cursor stands before the arguments. `None`: the label is not known before the
/// program runs.
pub(crate) fn head(cursor: &mut Cursor<'_>, values: &impl Values) -> Result<(Option<Label>, Keyword), Fault> {
    let start = cursor.at;
    let label = if cursor.peek() == Some(b'<') {
        Some(Label::Name(cursor.name()?.as_ref().into()))
    } else {
        let value = cursor.value(values)?;
        match integer_in(value, 0..=i64::from(u32::MAX)) {
            Some(number) => Some(Label::Number(number as u32)),
            None if value.is_nan() => None,
            None => {
                return Err((cursor.span_from(start), OWordError::LabelNotInteger { value }.into()));
            }
        }
    };
    let at = cursor.at;
    if !cursor.peek().is_some_and(|octet| octet.is_ascii_uppercase()) {
        return Ok((label, Keyword::Program));
    }
    let word = cursor.consume_letters();
    let found = Keyword::ALL.iter().find(|(_, name)| *name == word);
    match found {
        Some((keyword, _)) => Ok((label, *keyword)),
        None => {
            let near = nearest(&word, Keyword::ALL.iter().map(|(_, name)| *name));
            Err(cursor.span_from(at).fault(OWordError::UnknownKeyword {
                word: word.to_ascii_lowercase(),
                nearest: near.map(str::to_ascii_lowercase),
            }))
        }
    }
}

/// Reads an O-word line behind its O. The span of the whole is from the O on.
pub(crate) fn read(mut cursor: Cursor<'_>, values: &impl Values) -> Result<Option<OWord>, Fault> {
    let start = cursor.at - 1;
    let (label, keyword) = head(&mut cursor, values)?;
    let mut arguments = [0.0; ARGUMENTS_MAX];
    let mut argument_count = 0;
    let (least, most) = keyword.arguments();
    while let Some(octet @ (b'[' | b'(')) = cursor.peek() {
        if octet == b'(' {
            // A note between arguments.
            if let Some(Err(fault)) = cursor.item() {
                return Err(fault);
            }
            continue;
        }
        let at = cursor.at;
        let value = cursor.value(values)?;
        if argument_count == most {
            if let (Keyword::Program, Some(label)) = (keyword, &label) {
                let label = label.to_string();
                return Err((cursor.span_from(start), OWordError::CallMissing { label }.into()));
            }
            let keyword = keyword.name();
            return Err((
                cursor.span_from(at),
                OWordError::TooManyArguments { keyword, most }.into(),
            ));
        }
        arguments[argument_count] = value;
        argument_count += 1;
    }
    let span = cursor.span_from(start);
    if argument_count < least {
        let keyword = keyword.name();
        return Err((span, OWordError::ConditionMissing { keyword }.into()));
    }
    while let Some(item) = cursor.item() {
        match item? {
            Item::Comment(_) | Item::Remark(_) => {}
            Item::BlockDelete | Item::Letter(_) | Item::Parameter => {
                return Err((cursor.span(), OWordError::WordBehindOWord.into()));
            }
        }
    }
    Ok(label.map(|label| OWord {
        label,
        keyword,
        span,
        arguments,
        argument_count,
    }))
}
