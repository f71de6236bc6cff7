//! The words of a text without running it, for tools that show, count or convert programs.
//!
//! In:  anything that reads and seeks.
//! Out: line by line the words with their numbers and places. What depends on a parameter is unknown: NaN.

use crate::error::ErrorKind;
use crate::scan::{Cursor, Fault, Item};
use crate::syntax::Unknown;
use crate::text::Text;
use std::io::{self, Read, Seek};
use std::ops::Range;

/// A letter and its number.
#[derive(Clone, Debug, PartialEq)]
pub struct Word {
    /// Capital letter, or one of `@ ^ $`.
    pub letter: u8,
    /// Its number; NaN if it depends on a parameter.
    pub value: f64,
    /// Its octets in the line.
    pub span: Range<usize>,
}

/// Reads the lines of a text, in constant memory.
///
/// ```
/// let mut lexer = gcode::Lexer::new(std::io::Cursor::new("G1 X[1+2] (there)\nM2\n"));
/// let words: Vec<_> = lexer.next_line()?.unwrap().map(|word| word.unwrap()).collect();
/// assert_eq!((words[1].letter, words[1].value, words[1].span.clone()), (b'X', 3.0, 3..9));
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct Lexer<R> {
    text: Text<R>,
}

impl<R: Read + Seek> Lexer<R> {
    /// Begins at the start of `source`.
    pub fn new(source: R) -> Lexer<R> {
        Lexer {
            text: Text::new(source),
        }
    }

    /// The words of the next line; of a line that is too long those of its beginning. `None`: the text has ended.
    ///
    /// # Errors
    /// The text cannot be read.
    #[inline]
    pub fn next_line(&mut self) -> io::Result<Option<Words<'_>>> {
        let line = self.text.next_line()?;
        Ok(line.map(|_| Words {
            cursor: Cursor::new(self.text.octets()),
        }))
    }
}

/// The words of a line; made by [`Lexer::next_line`]. O-words end the line, comments and assignments are left out.
#[derive(Clone, Debug)]
pub struct Words<'l> {
    cursor: Cursor<'l>,
}

impl Iterator for Words<'_> {
    /// What is wrong comes with its octets in the line.
    type Item = Result<Word, (Range<usize>, ErrorKind)>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        if let Some((letter, value)) = self.cursor.plain_word() {
            let span = self.cursor.span().range();
            return Some(Ok(Word { letter, value, span }));
        }
        self.any_word()
    }
}

impl Words<'_> {
    /// The next word, whatever it is.
    fn any_word(&mut self) -> Option<Result<Word, (Range<usize>, ErrorKind)>> {
        loop {
            let letter = match self.cursor.item()? {
                Ok(Item::Letter(b'O')) => return None,
                Ok(Item::Letter(letter)) => letter,
                Ok(Item::BlockDelete | Item::Comment(_) | Item::Remark(_)) => continue,
                Ok(Item::Parameter) => match self.assignment() {
                    Ok(()) => continue,
                    Err(fault) => return Some(Err(located(fault))),
                },
                Err(fault) => return Some(Err(located(fault))),
            };
            let word = self.cursor.value(&Unknown::default()).map(|value| Word {
                letter,
                value,
                span: self.cursor.span().range(),
            });
            return Some(word.map_err(located));
        }
    }

    fn assignment(&mut self) -> Result<(), Fault> {
        self.cursor.parameter_target(&Unknown::default())?;
        self.cursor.value(&Unknown::default())?;
        Ok(())
    }
}

fn located((span, kind): Fault) -> (Range<usize>, ErrorKind) {
    (span.range(), kind)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    #[test]
    fn words_of_each_line() {
        let text = "/N10 G1 x1 . 5 (Y2) Z[2*3] ; A1\n#<a> = 5 F#<a>\r\n\no10 call [1]\nX1.. Y=2\n";
        let mut lexer = Lexer::new(Cursor::new(text));
        let mut lines = Vec::new();
        while let Some(words) = lexer.next_line().unwrap() {
            let shown = words.map(|word| match word {
                Ok(word) => format!("{}{} {:?}", char::from(word.letter), word.value, word.span),
                Err((place, kind)) => format!("{place:?} {kind}"),
            });
            lines.push(shown.collect::<Vec<_>>());
        }
        assert_eq!(lines[0], ["N10 1..4", "G1 5..7", "X1.5 8..14", "Z6 20..26"]);
        assert_eq!(lines[1], ["FNaN 9..14"]);
        assert_eq!(lines[2..4], [vec![], Vec::<String>::new()]);
        assert_eq!(lines[4].len(), 2);
        assert_eq!(lines[4][0], "1..4 a number has one decimal point at most");
    }
}
