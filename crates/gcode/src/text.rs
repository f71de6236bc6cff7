//! The lines of a text of any length, in constant memory.
//!
//! In:  anything that reads and seeks.
//! Out: one line at a time, without its end, with its place; the place can be set back for loops and calls.
//!
//! A line ends with LF or CR LF, the last one also with the text. A window holds the lines around the present one, some
//! more those around earlier places, so that neither a loop nor a call of a subroutine far away reads again. A line that
//! is too long is read to its end but not kept.

use crate::scan::LINE_OCTETS_MAX;
use files::read::BYTE_ORDER_MARK;
use std::io::{self, Read, Seek, SeekFrom};

/// Octets of a window.
const WINDOW_OCTETS: usize = 64 * 1024;
/// What is read first at a new place, which may be left soon.
const FIRST_READ_OCTETS: usize = 8 * 1024;
/// Windows kept beside the present one.
const PARKED_WINDOWS_MAX: usize = 7;

/// Where a line stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Line {
    /// Its first octet, counted from the start of the text.
    pub(crate) offset: u64,
    /// Its number, counted from 1.
    pub(crate) number: u32,
    /// Its octets, without the line end. When this is more than [`LINE_OCTETS_MAX`], only that many are kept.
    pub(crate) length: u64,
}

/// A part of a text.
#[derive(Debug)]
struct Window {
    buffer: Box<[u8]>,
    /// Octets that the buffer holds, from its start.
    filled: usize,
    /// Where the first of them stands in the text.
    base: u64,
    /// Whether the text ends with them.
    last: bool,
    /// When it was used last, in jumps.
    used: u64,
}

impl Window {
    fn new(size: usize) -> Window {
        Window {
            buffer: vec![0; size].into_boxed_slice(),
            filled: 0,
            base: 0,
            last: false,
            used: 0,
        }
    }

    /// Forgets what it holds; goes on at a place of the text.
    fn reset(&mut self, base: u64) {
        (self.base, self.filled, self.last) = (base, 0, false);
    }

    /// Index of an octet of the text, if it or the one before it is held.
    fn index(&self, offset: u64) -> Option<usize> {
        let within = offset.checked_sub(self.base)?;
        (within <= self.filled as u64).then_some(within as usize)
    }
}

/// A text and a place in it.
#[derive(Debug)]
pub(crate) struct Text<R> {
    source: R,
    /// Where the source would be read next.
    position: u64,
    /// Lines around the present one.
    window: Window,
    /// Lines around earlier places.
    parked: Vec<Window>,
    jumps: u64,
    /// Next octet to read, in the window.
    at: usize,
    /// Number of the line read last.
    number: u32,
    /// The line read last, in the window.
    line: std::ops::Range<usize>,
}

impl<R: Read + Seek> Text<R> {
    /// Reads `source`, which must stand at its start.
    pub(crate) fn new(source: R) -> Text<R> {
        Text::with_window(source, WINDOW_OCTETS)
    }

    /// Half of `size` is more than a line with its end.
    fn with_window(source: R, size: usize) -> Text<R> {
        debug_assert!(size / 2 > LINE_OCTETS_MAX + 2);
        Text {
            source,
            position: 0,
            window: Window::new(size),
            parked: Vec::new(),
            jumps: 0,
            at: 0,
            number: 0,
            line: 0..0,
        }
    }

    /// Takes the next line; its octets are [`Self::octets`]. `None`: the text ends here.
    pub(crate) fn next_line(&mut self) -> io::Result<Option<Line>> {
        self.pass_leader();
        let start = self.at;
        if let Some(length) = line_feed(&self.window.buffer[start..self.window.filled]) {
            return Ok(Some(self.line_at(start, length, 1)));
        }
        self.next_line_beyond()
    }

    /// Goes behind octets of 0 before a line: a punched tape, and what goes as one over a line, begins with hundreds.
    #[inline]
    fn pass_leader(&mut self) {
        while self.window.buffer[..self.window.filled].get(self.at) == Some(&0) {
            self.at += 1;
        }
    }

    /// As [`Self::next_line`], where the line does not end within the buffer.
    #[cold]
    fn next_line_beyond(&mut self) -> io::Result<Option<Line>> {
        self.line = 0..0;
        let mut searched = self.at;
        loop {
            self.pass_leader();
            searched = searched.max(self.at);
            if let Some(length) = line_feed(&self.window.buffer[searched..self.window.filled]) {
                return Ok(Some(self.line_at(self.at, searched + length - self.at, 1)));
            }
            let length = self.window.filled - self.at;
            if length > LINE_OCTETS_MAX + 1 {
                return self.too_long().map(Some);
            }
            if self.window.last {
                return Ok((length > 0).then(|| self.line_at(self.at, length, 0)));
            }
            if self.window.filled == self.window.buffer.len() {
                self.make_room();
            }
            searched = self.window.filled;
            self.fill()?;
        }
    }

    /// Drops lines at the start of a full buffer; half of it is kept for jumps back.
    fn make_room(&mut self) {
        let dropped = self.at - self.at.min(self.window.buffer.len() / 2);
        self.window.buffer.copy_within(dropped..self.window.filled, 0);
        self.window.base += dropped as u64;
        self.window.filled -= dropped;
        self.at -= dropped;
    }

    /// Octets of the line that was taken last, at most [`LINE_OCTETS_MAX`].
    pub(crate) fn octets(&self) -> &[u8] {
        &self.window.buffer[self.line.clone()]
    }

    /// Offset of the line that [`Self::next_line`] would take, and the number of the line before it.
    pub(crate) fn place(&self) -> (u64, u32) {
        (self.window.base + self.at as u64, self.number)
    }

    /// Goes to a place once told by [`Self::place`]: at once if a window holds it, else with the next line.
    pub(crate) fn seek(&mut self, offset: u64, number: u32) {
        self.number = number;
        self.line = 0..0;
        if let Some(index) = self.window.index(offset) {
            self.at = index;
            return;
        }
        self.jumps += 1;
        self.window.used = self.jumps;
        let found = self.parked.iter().position(|window| window.index(offset).is_some());
        let other = found.unwrap_or_else(|| self.unused_window(offset));
        std::mem::swap(&mut self.window, &mut self.parked[other]);
        self.at = self.window.index(offset).unwrap_or_default(); // always found: its beginning at least
    }

    /// A parked window that goes on at a new place: another one, or that which was left longest ago.
    #[cold]
    fn unused_window(&mut self, base: u64) -> usize {
        if self.parked.len() < PARKED_WINDOWS_MAX {
            self.parked.push(Window::new(self.window.buffer.len()));
        }
        let oldest = self.parked.iter().enumerate().min_by_key(|(_, window)| window.used);
        let oldest = oldest.map_or(0, |(index, _)| index);
        self.parked[oldest].reset(base);
        oldest
    }

    /// The line of `length` octets at `start` of the buffer, followed by a line end of `end` octets.
    fn line_at(&mut self, mut start: usize, mut length: usize, end: usize) -> Line {
        self.at = start + length + end;
        // Some editors begin a text with a mark of its encoding.
        if self.window.base + start as u64 == 0 && self.window.buffer[..length].starts_with(BYTE_ORDER_MARK) {
            (start, length) = (BYTE_ORDER_MARK.len(), length - BYTE_ORDER_MARK.len());
        }
        self.number = self.number.saturating_add(1);
        let length = match self.window.buffer[start..start + length] {
            [.., b'\r'] => length - 1,
            _ => length,
        };
        self.line = start..start + length.min(LINE_OCTETS_MAX);
        Line {
            offset: self.window.base + start as u64,
            number: self.number,
            length: length as u64,
        }
    }

    /// A line longer than is kept: reads on to its end.
    fn too_long(&mut self) -> io::Result<Line> {
        self.go_behind_window()?;
        let mut chunk = [0; 4096];
        let mut length = (self.window.filled - self.at) as u64;
        let mut ends_with_return = self.window.buffer[self.window.filled - 1] == b'\r';
        self.number = self.number.saturating_add(1);
        let offset = self.window.base + self.at as u64;
        loop {
            let count = read(&mut self.source, &mut chunk)?;
            self.position += count as u64;
            let piece = &chunk[..count];
            let found = line_feed(piece);
            let piece = &piece[..found.unwrap_or(count)];
            length += piece.len() as u64;
            ends_with_return = piece.last().map_or(ends_with_return, |octet| *octet == b'\r');
            if found.is_none() && count > 0 {
                continue;
            }
            // What is kept stays in the buffer until the next line is read.
            self.line = self.at..self.at + LINE_OCTETS_MAX;
            self.window
                .reset(self.position - (count - found.map_or(count, |at| at + 1)) as u64);
            self.at = 0;
            return Ok(Line {
                offset,
                number: self.number,
                length: length - u64::from(ends_with_return),
            });
        }
    }

    /// Moves the source behind what the window holds.
    fn go_behind_window(&mut self) -> io::Result<()> {
        let behind = self.window.base + self.window.filled as u64;
        if self.position != behind {
            self.source.seek(SeekFrom::Start(behind))?;
            self.position = behind;
        }
        Ok(())
    }

    /// Reads as much as comes at once behind what the window holds.
    fn fill(&mut self) -> io::Result<()> {
        self.go_behind_window()?;
        let window = &mut self.window;
        let size = window.buffer.len();
        let end = if window.filled == 0 {
            FIRST_READ_OCTETS.min(size)
        } else {
            size
        };
        let count = read(&mut self.source, &mut window.buffer[window.filled..end])?;
        window.filled += count;
        window.last = count == 0;
        self.position += count as u64;
        Ok(())
    }
}

/// One read that an interrupt does not end.
fn read(source: &mut impl Read, to: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(to) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
}

fn line_feed(octets: &[u8]) -> Option<usize> {
    memchr::memchr(b'\n', octets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::Cursor;

    /// Gives a few octets at a time, as a pipe may.
    struct Slow(Cursor<Vec<u8>>, usize);

    impl Read for Slow {
        fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
            let count = to.len().min(self.1);
            self.0.read(&mut to[..count])
        }
    }

    impl Seek for Slow {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.0.seek(to)
        }
    }

    fn lines<R: Read + Seek>(text: &mut Text<R>) -> Vec<(u64, u32, u64, Vec<u8>)> {
        let mut lines = Vec::new();
        while let Some(line) = text.next_line().unwrap() {
            lines.push((line.offset, line.number, line.length, text.octets().to_vec()));
        }
        lines
    }

    #[test]
    fn line_ends_do_not_belong_to_the_line() {
        let mut text = Text::new(Cursor::new(b"G0\r\n\n\rM2\r"));
        assert_eq!(
            lines(&mut text),
            [
                (0, 1, 2, b"G0".to_vec()),
                (4, 2, 0, b"".to_vec()),
                (5, 3, 3, b"\rM2".to_vec())
            ]
        );
        assert_eq!(lines(&mut Text::new(Cursor::new(b""))), []);
        assert_eq!(lines(&mut Text::new(Cursor::new(b"\n"))).len(), 1);
    }

    #[test]
    fn a_line_that_is_too_long_is_told_and_left_behind() {
        let long = "X".repeat(100_000);
        let mut text = Text::with_window(Cursor::new(format!("G0\n{long}\r\nM2\n{long}")), 600);
        let lines = lines(&mut text);
        let told: Vec<_> = lines
            .iter()
            .map(|line| (line.0, line.1, line.2, line.3.len()))
            .collect();
        assert_eq!(
            told,
            [
                (0, 1, 2, 2),
                (3, 2, 100_000, LINE_OCTETS_MAX),
                (100_005, 3, 2, 2),
                (100_008, 4, 100_000, LINE_OCTETS_MAX)
            ]
        );
    }

    #[test]
    fn a_jump_within_the_buffer_does_not_read() {
        let mut text = Text::new(Slow(Cursor::new(b"a\nb\nc\n".to_vec()), 100));
        text.next_line().unwrap();
        let place = text.place();
        while text.next_line().unwrap().is_some() {}
        text.source = Slow(Cursor::new(Vec::new()), 100);
        text.seek(place.0, place.1);
        assert_eq!(
            text.next_line().unwrap(),
            Some(Line {
                offset: 2,
                number: 2,
                length: 1
            })
        );
        assert_eq!(text.octets(), b"b");
    }

    /// Counts what it is asked for.
    struct Counting(Cursor<Vec<u8>>, usize);

    impl Read for Counting {
        fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
            self.1 += 1;
            self.0.read(to)
        }
    }

    impl Seek for Counting {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.0.seek(to)
        }
    }

    #[test]
    fn calls_of_a_subroutine_far_away_read_it_once() {
        let lines: String = (0..200_000).map(|line| format!("G1 X{line}\n")).collect();
        let mut text = Text::new(Counting(Cursor::new(lines.clone().into_bytes()), 0));
        text.next_line().unwrap();
        let subroutine = text.place();
        while text.next_line().unwrap().unwrap().number < 150_000 {}
        let reads = text.source.1;
        for call in 0..1000 {
            let back = text.place();
            text.seek(subroutine.0, subroutine.1);
            assert_eq!(text.next_line().unwrap().unwrap().number, 2);
            text.seek(back.0, back.1);
            assert_eq!(text.next_line().unwrap().unwrap().number, 150_001 + call);
            assert_eq!(text.octets(), format!("G1 X{}", 150_000 + call).as_bytes());
        }
        assert!(
            text.source.1 <= reads + 3,
            "{} reads of 1000 calls",
            text.source.1 - reads
        );
    }

    proptest! {
        #[test]
        fn any_text_is_read_as_if_it_were_in_memory(
            pieces in prop::collection::vec(prop_oneof!["[a-c\r]{0,5}", "\r?\n", "x{250,260}", "z{500,520}", "y{600,700}"], 0..40),
            count in 1_usize..400,
            jumps in prop::collection::vec(any::<prop::sample::Index>(), 0..20),
        ) {
            let octets = pieces.concat().into_bytes();
            let mut expected = Vec::new();
            let mut offset = 0;
            for (index, piece) in octets.split_inclusive(|octet| *octet == b'\n').enumerate() {
                let line = piece.strip_suffix(b"\n").unwrap_or(piece);
                let line = line.strip_suffix(b"\r").unwrap_or(line);
                let kept = line[..line.len().min(LINE_OCTETS_MAX)].to_vec();
                expected.push((offset, index as u32 + 1, line.len() as u64, kept));
                offset += piece.len() as u64;
            }
            let mut text = Text::with_window(Slow(Cursor::new(octets), count), 600);
            prop_assert_eq!(&lines(&mut text), &expected);
            for jump in jumps {
                if expected.is_empty() { break }
                let to = jump.index(expected.len());
                text.seek(expected[to].0, expected[to].1 - 1);
                for expected in expected[to..].iter().take(5) {
                    let line = text.next_line().unwrap().unwrap();
                    prop_assert_eq!((line.offset, line.number, line.length), (expected.0, expected.1, expected.2));
                    prop_assert_eq!(text.octets(), expected.3.as_slice());
                }
            }
        }
    }
}
