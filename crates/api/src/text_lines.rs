//! Lines of the text of a program, for a screen that shows where it is.
//!
//! In:  a text, a line. Out: that line and those behind it. Where a line begins is found by reading on from the last one that was asked
//! for, a bounded piece at a time: whoever serves clients waits for nothing long.

use program::text::{Reader, Text};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};

/// Octets of a line that are shown.
const SHOWN_MAX: u64 = 256;
/// Octets that are passed over for one answer at the most.
const SCAN_MAX: u64 = 32 << 20;

/// Where a line begins.
#[derive(Debug, Default)]
pub(super) struct Place {
    revision: u64,
    /// 0: nowhere.
    line: u64,
    at: u64,
}

/// Up to `count` lines from line `from` on (the first is 1), and whether there are more. `None`: that line lies so far on that it was not
/// reached this time; ask again.
///
/// # Errors
/// Of the temporary file of a long text.
pub(super) fn lines(
    text: &Text,
    revision: u64,
    (from, count): (u64, u64),
    place: &mut Place,
) -> io::Result<Option<(Vec<String>, bool)>> {
    if place.revision != revision || place.line == 0 || place.line > from {
        *place = Place {
            revision,
            line: 1,
            at: 0,
        };
    }
    let mut reader = BufReader::with_capacity(64 * 1024, Reader::from(text));
    reader.seek(SeekFrom::Start(place.at))?;
    let begin = place.at;
    while place.line < from {
        if place.at - begin > SCAN_MAX {
            return Ok(None);
        }
        match reader.skip_until(b'\n')? {
            0 => return Ok(Some((Vec::new(), false))),
            octets => place.at += octets as u64,
        }
        place.line += 1;
    }
    let mut lines = Vec::new();
    while (lines.len() as u64) < count && !reader.fill_buf()?.is_empty() {
        let mut line = Vec::new();
        (&mut reader).take(SHOWN_MAX).read_until(b'\n', &mut line)?;
        if line.last() != Some(&b'\n') {
            reader.skip_until(b'\n')?;
        }
        let shown = String::from_utf8_lossy(&line);
        lines.push(shown.trim_end_matches(['\n', '\r']).to_owned());
    }
    let more = !reader.fill_buf()?.is_empty();
    Ok(Some((lines, more)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_forward_and_back_and_a_long_one_is_cut() {
        let long = "x".repeat(1000);
        let text = Text::from(format!("one\r\ntwo\n{long}\nfour").into_bytes());
        let mut place = Place::default();
        let mut of = |revision, from, count| lines(&text, revision, (from, count), &mut place).unwrap().unwrap();
        assert_eq!(of(1, 2, 1), (vec!["two".to_owned()], true));
        assert_eq!(of(1, 4, 9), (vec!["four".to_owned()], false));
        assert_eq!(of(1, 1, 1), (vec!["one".to_owned()], true));
        assert_eq!(of(2, 3, 2), (vec!["x".repeat(256), "four".to_owned()], false));
        assert_eq!(of(2, 5, 1), (vec![], false));
    }

    #[test]
    fn a_line_far_on_is_reached_in_bounded_pieces() {
        let text = Text::from("\n".repeat(SCAN_MAX as usize + 1000).into_bytes());
        let mut place = Place::default();
        let from = SCAN_MAX + 500;
        assert_eq!(lines(&text, 1, (from, 1), &mut place).unwrap(), None);
        let found = lines(&text, 1, (from, 1), &mut place).unwrap();
        assert_eq!(found, Some((vec![String::new()], true)));
    }
}
