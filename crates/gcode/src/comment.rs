//! Comments that do something.
//!
//! In:  the text between the parentheses of a comment.
//! Out: what it asks for ([`read`]), and its text with the values of parameters put in ([`with_values`]).
//!
//! The first word decides, in any case, blanks before it left out. It ends with a comma, but for those that take no
//! text and for PROBEOPEN, which is followed by a blank.

use crate::expression::{PARAMETER_MAX, Values};
use std::fmt::Write;

/// What a comment asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CommentKind {
    /// Nothing.
    Plain,
    /// `(MSG,text)`: a message for the operator.
    Message,
    /// `(DEBUG,text)`: the same with values, unless #5599 is 0.
    Debug,
    /// `(PRINT,text)`: a line on the screen, with values.
    Print,
    /// `(LOG,text)`: a line for the log file, with values.
    Log,
    /// `(LOGOPEN,file)`
    OpenLog,
    /// `(LOGAPPEND,file)`
    AppendLog,
    /// `(LOGCLOSE)`
    CloseLog,
    /// `(PROBEOPEN file)`
    OpenProbeLog,
    /// `(PROBECLOSE)`
    CloseProbeLog,
    /// `(ABORT,text)`: an error, with values.
    Abort,
    /// `(PY,text)` and its like: statements in Python.
    Python,
}

/// What stands for a value that is not known or too long.
const UNKNOWN: &str = "######";
/// Values of as many characters and more are too long.
const VALUE_CHARACTERS_MAX: usize = 30;
/// Values nearer to zero are told as zero.
const SHOWN_AS_ZERO_MAX: f64 = 1e-4;

/// What a comment asks for, and the octets of `text` from which its own text begins.
pub(crate) fn read(text: &[u8]) -> (CommentKind, usize) {
    const WITH_COMMA: [(&[u8], CommentKind); 10] = [
        (b"MSG", CommentKind::Message),
        (b"DEBUG", CommentKind::Debug),
        (b"PRINT", CommentKind::Print),
        (b"LOG", CommentKind::Log),
        (b"LOGOPEN", CommentKind::OpenLog),
        (b"LOGAPPEND", CommentKind::AppendLog),
        (b"PROBEOPEN", CommentKind::OpenProbeLog),
        (b"ABORT", CommentKind::Abort),
        (b"PY", CommentKind::Python),
        (b"PYRUN", CommentKind::Python),
    ];
    const ALONE: [(&[u8], CommentKind); 3] = [
        (b"LOGCLOSE", CommentKind::CloseLog),
        (b"PROBECLOSE", CommentKind::CloseProbeLog),
        (b"PYRELOAD", CommentKind::Python),
    ];
    let trimmed = text.trim_ascii_start();
    let start = text.len() - trimmed.len();
    let letters = trimmed.iter().take_while(|octet| octet.is_ascii_alphabetic()).count();
    let (word, behind) = trimmed.split_at(letters);
    let find = |words: &[(&[u8], CommentKind)]| {
        let found = words.iter().find(|(known, _)| word.eq_ignore_ascii_case(known));
        found.map(|(_, kind)| *kind)
    };
    let (kind, taken) = match behind {
        [] => (find(&ALONE), letters),
        [b',', ..] => (find(&WITH_COMMA), letters + 1),
        [b' ' | b'\t', ..] if word.eq_ignore_ascii_case(b"PROBEOPEN") => {
            let blanks = behind.len() - behind.trim_ascii_start().len();
            (Some(CommentKind::OpenProbeLog), letters + blanks)
        }
        _ => (None, 0),
    };
    match kind {
        Some(kind) => (kind, start + taken),
        None => (CommentKind::Plain, start),
    }
}

/// `text` with the values of parameters in place of `#5` and `#<name>`. The forms `%d` (no decimals), `%f` (four) and
/// `%.0f` to `%.9f` hold for all values behind them; without one there are six.
pub(crate) fn with_values(text: &[u8], values: &impl Values) -> String {
    let text = String::from_utf8_lossy(text);
    let mut rest = &*text;
    let mut decimals = 6;
    let mut result = String::with_capacity(text.len() + VALUE_CHARACTERS_MAX);
    while let Some(at) = rest.find(['#', '%']) {
        result.push_str(&rest[..at]);
        rest = &rest[at..];
        if let Some((format, behind)) = format(rest) {
            decimals = format;
            rest = behind;
        } else if rest.starts_with("%.") {
            rest = &rest[1..]; // LinuxCNC drops the % of a form that it does not know
        } else if let Some((value, behind)) = parameter(rest, values) {
            push_value(&mut result, value, decimals);
            rest = behind;
        } else {
            result.push_str(&rest[..1]);
            rest = &rest[1..];
        }
    }
    result.push_str(rest);
    result
}

/// The decimals of a form that `text` begins with, and what is behind it.
fn format(text: &str) -> Option<(usize, &str)> {
    if let Some(behind) = text.strip_prefix("%d") {
        return Some((0, behind));
    }
    if let Some(behind) = text.strip_prefix("%f") {
        return Some((4, behind));
    }
    match text.as_bytes() {
        [b'%', b'.', digit @ b'0'..=b'9', b'f', ..] => Some((usize::from(digit - b'0'), &text[4..])),
        _ => None,
    }
}

/// The value of a parameter that `text` begins with, and what is behind it. The value is `None` if there is none.
fn parameter<'t>(text: &'t str, values: &impl Values) -> Option<(Option<f64>, &'t str)> {
    let behind = text.strip_prefix('#')?;
    if let Some(named) = behind.strip_prefix('<') {
        let (name, behind) = named.split_once('>')?;
        let name: String = name
            .chars()
            .filter(|character| !character.is_ascii_whitespace())
            .collect();
        return Some((values.named(&name.to_ascii_lowercase()), behind));
    }
    let digits = behind.bytes().take_while(u8::is_ascii_digit).count();
    if digits == 0 {
        return None;
    }
    let (index, behind) = behind.split_at(digits);
    let value = match index.parse() {
        Ok(0) => Some(0.0),
        Ok(index) if index <= PARAMETER_MAX => values.numbered(index),
        Ok(_) | Err(_) => None,
    };
    Some((value, behind))
}

fn push_value(text: &mut String, value: Option<f64>, decimals: usize) {
    let start = text.len();
    if let Some(value) = value.filter(|value| value.is_finite()) {
        let value = if value.abs() < SHOWN_AS_ZERO_MAX { 0.0 } else { value };
        let written = write!(text, "{value:.decimals$}");
        if written.is_ok() && text.len() - start < VALUE_CHARACTERS_MAX {
            return;
        }
        text.truncate(start);
    }
    text.push_str(UNKNOWN);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// #1 = 2.5, #2 = -1000000.5, #3 = -0.00000001, #4 = 1e30, `a` = 7, `_g` = -0.5.
    struct Known;

    impl Values for Known {
        fn numbered(&self, index: u32) -> Option<f64> {
            match index {
                1 => Some(2.5),
                2 => Some(-1_000_000.5),
                3 => Some(-1e-8),
                4 => Some(1e30),
                5 => None,
                6 => Some(f64::NAN),
                _ => Some(0.0),
            }
        }

        fn named(&self, name: &str) -> Option<f64> {
            match name {
                "a" => Some(7.0),
                "_g" => Some(-0.5),
                _ => None,
            }
        }

        fn nearest(&self, _: &str) -> Option<String> {
            None
        }
    }

    #[test]
    fn the_first_word_decides() {
        use CommentKind::*;
        for (text, kind, own) in [
            ("text ", Plain, "text "),
            ("  spaced  text", Plain, "spaced  text"),
            ("", Plain, ""),
            ("MSG,a", Message, "a"),
            (" msg,   a", Message, "   a"),
            ("msg , a", Plain, "msg , a"),
            ("m s g, a", Plain, "m s g, a"),
            ("MSG", Plain, "MSG"),
            ("Debug,#1", Debug, "#1"),
            ("PRINT,a", Print, "a"),
            ("LOG,a", Log, "a"),
            ("LOGOPEN,a.txt", OpenLog, "a.txt"),
            ("LOGAPPEND,a.txt", AppendLog, "a.txt"),
            ("LogClose", CloseLog, ""),
            (" LOGCLOSE ", Plain, "LOGCLOSE "),
            ("PROBEOPEN  a.txt", OpenProbeLog, "a.txt"),
            ("probeopen,a.txt", OpenProbeLog, "a.txt"),
            ("PROBECLOSE", CloseProbeLog, ""),
            ("ABORT,#1", Abort, "#1"),
            ("abort", Plain, "abort"),
            ("PY,x", Python, "x"),
            ("pyreload", Python, ""),
        ] {
            let (found, start) = read(text.as_bytes());
            assert_eq!((found, &text[start..]), (kind, own), "{text:?}");
        }
    }

    #[test]
    fn values_and_their_forms() {
        for (text, expected) in [
            (
                "a #1 b #<a> c#<none>#< A > d",
                "a 2.500000 b 7.000000 c######7.000000 d",
            ),
            ("#1 %.3f #1", "2.500000  2.500"),
            (
                "%d #1 %f #1 %.4f#2 %.2f #<a> %d#2",
                " 2  2.5000 -1000000.5000  7.00 -1000000",
            ),
            ("%d#<_g> #3 %.9f#<a>", "-0 0 7.000000000"),
            ("#3 #4 #5 #6 %d#4", "0.000000 ###### ###### ###### ######"),
            ("#0 #5601 #5602 #99999999999", "0.000000 0.000000 ###### ######"),
            ("#[1+1] #-1 #1.5 ##1 # #", "#[1+1] #-1 2.500000.5 #2.500000 # #"),
            ("100% %% %g %lf %5.1f #1", "100% %% %g %lf %5.1f 2.500000"),
            ("%.10f#1 %.f %.3d", ".10f2.500000 .f .3d"),
            ("#<open", "#<open"),
        ] {
            assert_eq!(with_values(text.as_bytes(), &Known), expected, "{text:?}");
        }
        assert_eq!(with_values(b"\xFF#1", &Known), "\u{fffd}2.500000");
    }
}
