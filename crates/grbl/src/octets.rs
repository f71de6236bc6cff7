//! What comes, octet by octet: real-time commands are taken out wherever they stand, the rest are lines.

/// Longest line without spaces and comments, octets.
pub const LINE_MAX: usize = 256;

/// Something that the sender wants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Input {
    /// `?`
    Status,
    /// `!`
    Hold,
    /// `~`
    Resume,
    /// 18h
    Reset,
    /// 84h
    Door,
    /// 85h
    CancelJog,
    /// 90h to 94h: by so many percent; `None`: back to 100.
    Feed(Option<i8>),
    /// 95h to 97h: to this many percent.
    Rapid(u8),
    /// 99h to 9Dh: by so many percent; `None`: back to 100.
    Spindle(Option<i8>),
    /// 9Eh
    StopSpindle,
    /// A0h
    Flood,
    /// A1h
    Mist,
    /// A line in capitals, without spaces, comments and its end.
    Line(String),
    /// A line that was longer than [`LINE_MAX`].
    LongLine,
}

/// Takes octets apart.
#[derive(Debug, Default)]
pub struct Inputs {
    line: String,
    is_long: bool,
    comment: Comment,
    /// The last octet ended a line with CR: a LF behind it ends no other one.
    was_return: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Comment {
    #[default]
    None,
    /// To the next `)`.
    InBrackets,
    /// To the end of the line.
    ToEnd,
}

impl Inputs {
    /// Forgets the line that has begun.
    pub fn clear(&mut self) {
        *self = Inputs::default();
    }

    /// What this octet comes to, if it ends anything.
    ///
    /// Octets from 80h on may come as text in UTF-8 (C2h before them), as terminals send them; C2h and those that mean nothing are
    /// dropped.
    pub fn take(&mut self, octet: u8) -> Option<Input> {
        if let Some(command) = real_time(octet) {
            return Some(command);
        }
        let was_return = std::mem::replace(&mut self.was_return, octet == b'\r');
        match octet {
            b'\n' if was_return => None,
            b'\r' | b'\n' => Some(self.end()),
            // A `$` line may hold anything but a comment within brackets.
            _ if self.comment == Comment::ToEnd => None,
            b')' if self.comment == Comment::InBrackets => {
                self.comment = Comment::None;
                None
            }
            _ if self.comment == Comment::InBrackets => None,
            b'(' => {
                self.comment = Comment::InBrackets;
                None
            }
            b';' => {
                self.comment = Comment::ToEnd;
                None
            }
            // Block delete is no part of Grbl.
            b'/' => None,
            0x21..=0x7E => {
                match self.line.len() < LINE_MAX {
                    true => self.line.push(char::from(octet.to_ascii_uppercase())),
                    false => self.is_long = true,
                }
                None
            }
            _ => None,
        }
    }

    fn end(&mut self) -> Input {
        self.comment = Comment::None;
        let line = std::mem::take(&mut self.line);
        match std::mem::take(&mut self.is_long) {
            true => Input::LongLine,
            false => Input::Line(line),
        }
    }
}

fn real_time(octet: u8) -> Option<Input> {
    Some(match octet {
        b'?' => Input::Status,
        b'!' => Input::Hold,
        b'~' => Input::Resume,
        0x18 => Input::Reset,
        0x84 => Input::Door,
        0x85 => Input::CancelJog,
        0x90 => Input::Feed(None),
        0x91 => Input::Feed(Some(10)),
        0x92 => Input::Feed(Some(-10)),
        0x93 => Input::Feed(Some(1)),
        0x94 => Input::Feed(Some(-1)),
        0x95 => Input::Rapid(100),
        0x96 => Input::Rapid(50),
        0x97 => Input::Rapid(25),
        0x99 => Input::Spindle(None),
        0x9A => Input::Spindle(Some(10)),
        0x9B => Input::Spindle(Some(-10)),
        0x9C => Input::Spindle(Some(1)),
        0x9D => Input::Spindle(Some(-1)),
        0x9E => Input::StopSpindle,
        0xA0 => Input::Flood,
        0xA1 => Input::Mist,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(octets: &[u8]) -> Vec<Input> {
        let mut inputs = Inputs::default();
        octets.iter().filter_map(|octet| inputs.take(*octet)).collect()
    }

    fn line(text: &str) -> Input {
        Input::Line(text.to_owned())
    }

    #[test]
    fn real_time_octets_are_taken_out_of_the_middle_of_a_line() {
        assert_eq!(
            all(b"g1 x?1!.5\n~"),
            [Input::Status, Input::Hold, line("G1X1.5"), Input::Resume]
        );
        assert_eq!(all(&[0x18, 0x84, 0x85]), [Input::Reset, Input::Door, Input::CancelJog]);
    }

    #[test]
    fn all_overrides_are_known_and_octets_without_a_meaning_are_dropped() {
        let feed = [None, Some(10), Some(-10), Some(1), Some(-1)];
        assert_eq!(all(&[0x90, 0x91, 0x92, 0x93, 0x94]), feed.map(Input::Feed));
        assert_eq!(all(&[0x95, 0x96, 0x97]), [100, 50, 25].map(Input::Rapid));
        assert_eq!(all(&[0x99, 0x9A, 0x9B, 0x9C, 0x9D]), feed.map(Input::Spindle));
        assert_eq!(
            all(&[0x9E, 0xA0, 0xA1]),
            [Input::StopSpindle, Input::Flood, Input::Mist]
        );
        assert_eq!(all(&[0x80, 0x98, 0x9F, 0xFF, 0xC2, 0x00, 0x07]), []);
        // As text: U+0091 is C2 91.
        assert_eq!(all("X\u{91}1\n".as_bytes()), [Input::Feed(Some(10)), line("X1")]);
    }

    #[test]
    fn each_end_of_a_line_counts_once_and_empty_lines_are_lines() {
        assert_eq!(
            all(b"G0\r\nG1\rX1\n\n\r\n"),
            [line("G0"), line("G1"), line("X1"), line(""), line("")]
        );
    }

    #[test]
    fn comments_and_block_delete_are_left_out() {
        assert_eq!(all(b"/g1 (fast; (x1) x2 ; y3\n"), [line("G1X2")]);
        // What is not closed ends with its line.
        assert_eq!(all(b"x1 (open\ny2\n"), [line("X1"), line("Y2")]);
    }

    #[test]
    fn a_line_that_is_too_long_is_told_once() {
        let text = ["X".repeat(LINE_MAX + 1), "\nG0\n".into()].concat();
        assert_eq!(all(text.as_bytes()), [Input::LongLine, line("G0")]);
        let text = ["X".repeat(LINE_MAX), "\n".into()].concat();
        assert_eq!(all(text.as_bytes()), [line(&"X".repeat(LINE_MAX))]);
    }
}
