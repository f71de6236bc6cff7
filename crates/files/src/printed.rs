//! What a command prints: the one way to standard output and standard error.
//!
//! In:  text, some of it of others: names of programs and devices, messages, remarks, lines of files.
//! Out: the same text with what would steer a terminal, or turn the order of letters round, as `\u001b`.
//!
//! Colours pass, as they harm nobody. The form of what is taken out is that of JSON, which says the same as before by it.

use std::io::{self, BufWriter, IsTerminal, StderrLock, StdoutLock, Write};

/// Standard output.
pub fn stdout() -> Plain<StdoutLock<'static>> {
    Plain(io::stdout().lock())
}

/// Standard output for much text.
pub fn buffered() -> Plain<BufWriter<StdoutLock<'static>>> {
    Plain(BufWriter::with_capacity(1 << 16, io::stdout().lock()))
}

/// Standard error.
pub fn stderr() -> Plain<StderrLock<'static>> {
    Plain(io::stderr().lock())
}

/// Whether colours belong on this output: on a terminal, where `NO_COLOR` is not set or empty (<https://no-color.org>).
pub fn shows_colours(output: &impl IsTerminal) -> bool {
    output.is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Text that has another form for a terminal with colours, to standard error or output.
pub fn tell(text: &str, coloured: &str, is_error: bool) {
    let shows = match is_error {
        true => shows_colours(&io::stderr()),
        false => shows_colours(&io::stdout()),
    };
    let text = if shows { coloured } else { text }.as_bytes();
    // What cannot be printed is not.
    let _ = match is_error {
        true => stderr().write_all(text),
        false => stdout().write_all(text),
    };
}

/// A line to standard output. A reader that has gone away is no error: what cannot be printed is not.
#[macro_export]
macro_rules! outln {
    ($($text:tt)*) => {{
        let _ = ::std::io::Write::write_fmt(&mut $crate::printed::stdout(), format_args!("{}\n", format_args!($($text)*)));
    }};
}

/// A line to standard error. What cannot be printed is not.
#[macro_export]
macro_rules! errln {
    ($($text:tt)*) => {{
        let _ = ::std::io::Write::write_fmt(&mut $crate::printed::stderr(), format_args!("{}\n", format_args!($($text)*)));
    }};
}

/// Writes text and no orders for a terminal. A letter of several octets has to come as a whole; buffers belong inside.
#[derive(Debug)]
pub struct Plain<W>(pub W);

impl<W: Write> Write for Plain<W> {
    fn write(&mut self, octets: &[u8]) -> io::Result<usize> {
        let (mut from, mut at) = (0, 0);
        while at < octets.len() {
            let Some((letter, length)) = unwanted(&octets[at..]) else {
                at += passed(&octets[at..]);
                continue;
            };
            self.0.write_all(&octets[from..at])?;
            write!(self.0, "\\u{letter:04x}")?;
            at += length;
            from = at;
        }
        self.0.write_all(&octets[from..])?;
        Ok(octets.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Text as [`Plain`] prints it.
pub fn plain(text: &str) -> String {
    let mut plain = Plain(Vec::with_capacity(text.len()));
    // Writing into memory does not fail.
    let _ = plain.write_all(text.as_bytes());
    String::from_utf8_lossy(&plain.0).into_owned()
}

/// The letter at the beginning that must not pass, and its octets: a control character (C0, DEL, C1), or one that turns the
/// order of letters round (U+202A to 202E, U+2066 to 2069).
fn unwanted(octets: &[u8]) -> Option<(u32, usize)> {
    match *octets {
        [b'\n' | b'\t', ..] | [b'\r', b'\n', ..] => None,
        [0x1B, ..] if colour(octets).is_some() => None,
        [octet @ (..0x20 | 0x7F), ..] => Some((u32::from(octet), 1)),
        [0xC2, octet @ 0x80..=0x9F, ..] => Some((u32::from(octet), 2)),
        [0xE2, 0x80, octet @ 0xAA..=0xAE, ..] => Some((0x2000 | u32::from(octet & 0x3F), 3)),
        [0xE2, 0x81, octet @ 0xA6..=0xA9, ..] => Some((0x2040 | u32::from(octet & 0x3F), 3)),
        _ => None,
    }
}

/// Octets at the beginning that pass.
fn passed(octets: &[u8]) -> usize {
    colour(octets).unwrap_or(1)
}

/// Octets of a colour or weight at the beginning (ECMA-48, SGR); nothing that hides text.
fn colour(octets: &[u8]) -> Option<usize> {
    let parameters = octets.strip_prefix(b"\x1b[")?;
    let length = parameters
        .iter()
        .position(|octet| !matches!(octet, b'0'..=b'9' | b';'))?;
    let numbers = std::str::from_utf8(&parameters[..length]).ok()?;
    let harmless = |number: &str| matches!(number.parse(), Ok(0..=4 | 7 | 22..=27 | 30..=49 | 90..=107_u8));
    let is_colour = parameters[length] == b'm' && (numbers.is_empty() || numbers.split(';').all(harmless));
    is_colour.then_some(b"\x1b[m".len() + length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_steers_a_terminal_is_shown_and_colours_pass() {
        for (text, printed) in [
            ("G1 X1\n\tä µ €\r\n", "G1 X1\n\tä µ €\r\n"),
            ("part\x1b]0;title\x07.ngc", "part\\u001b]0;title\\u0007.ngc"),
            ("a\rb\x08\x7f", "a\\u000db\\u0008\\u007f"),
            ("\u{9b}2J\u{202e}cgn.\u{2066}", "\\u009b2J\\u202ecgn.\\u2066"),
            ("\x1b[31m\x1b[1mred\x1b[0m\x1b[m", "\x1b[31m\x1b[1mred\x1b[0m\x1b[m"),
            ("\x1b[8mhidden\x1b[2J\x1b[", "\\u001b[8mhidden\\u001b[2J\\u001b["),
        ] {
            assert_eq!(plain(text), printed, "{text:?}");
        }
        // No text, and whole all the same.
        let mut out = Plain(Vec::new());
        out.write_all(&[0xFF, b'a', 0xC2]).unwrap();
        assert_eq!(out.0, [0xFF, b'a', 0xC2]);
    }

    proptest! {
        #[test]
        fn no_text_steers_a_terminal(text in "(\\PC|\\p{Cc}|\\p{Cf}|\x1b\\[[0-9;]{0,4}[a-zA-Z]){0,40}") {
            let printed = plain(&text);
            let is_order = |(at, letter): (usize, char)| match letter {
                '\n' | '\t' => false,
                '\r' => !printed[at..].starts_with("\r\n"),
                '\x1b' => colour(&printed.as_bytes()[at..]).is_none(),
                '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => true,
                letter => letter.is_control(),
            };
            prop_assert!(!printed.char_indices().any(is_order), "{printed:?}");
            prop_assert_eq!(plain(&printed), printed.clone());
        }
    }
}
