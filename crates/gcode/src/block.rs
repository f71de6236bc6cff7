//! One line to one [`Block`]: its words with their values, and every rule that needs no other line.
//!
//! In:  a line of text; what `#` stands for.
//! Out: the block, and all that is wrong with it. Reused from line to line; allocates for errors and assignments only.
//!
//! Which letters belong to which codes is checked in `usage`.

use crate::code::{
    Compensation, Coolant, Distance, FeedUnit, GCode, InputOutput, LengthOffset, MCode, ModalCode, Motion, NonModal,
    Override, PathCode, Retract, SpindleAction, SpindleCode, Stop, ToolCode, g_name, integer, m_name,
};
use crate::error::{ErrorKind, ExpressionError};
use crate::expression::{Assigned, Values};
use crate::scan::{Cursor, Fault, Item, NUMBER_MAX, Span, number_with_exponent};
use motion::canon::{Axis, LengthUnit, Plane};

/// A code and where it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Coded<T> {
    pub(crate) value: T,
    /// Ten times the number of a G word, the number of an M word.
    code: u16,
    pub(crate) span: Span,
}

impl<T> Coded<T> {
    /// As it is usually written; of a G word.
    pub(crate) fn name(&self) -> String {
        g_name(self.code)
    }
}

/// Mistakes of a line with their places.
pub(crate) type Faults = Vec<Fault>;

/// An assignment to a parameter; takes effect when the whole line is read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Assignment {
    pub(crate) target: Parameter,
    pub(crate) value: f64,
    pub(crate) span: Span,
}

/// A parameter to which a value goes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Parameter {
    Numbered(u32),
    /// In lower case without blanks, global if it begins with `_`.
    Named(String),
}

/// A comment that acts, the last one of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Remark {
    /// `( ... )`
    Parentheses(Span),
    /// `; ...`
    Semicolon(Span),
}

/// An N-word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LineNumber {
    /// Its whole part.
    pub(crate) whole: u32,
    /// Digits of that as written.
    pub(crate) digits: u8,
}

impl LineNumber {
    /// Reads what stands behind the N.
    pub(crate) fn read(cursor: &mut Cursor<'_>) -> Result<LineNumber, Fault> {
        let start = cursor.at;
        let number = cursor.unsigned()?;
        let written = &cursor.line[start..cursor.at];
        let whole = written.split(|octet| *octet == b'.').next().unwrap_or_default();
        let digits = whole.iter().filter(|octet| octet.is_ascii_digit()).count();
        Ok(LineNumber {
            whole: number as u32, // saturates: it is only shown
            digits: digits as u8,
        })
    }
}

/// A code that calls a subroutine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Remapped {
    /// Which of the remapped codes.
    pub(crate) index: usize,
    /// Its number.
    pub(crate) value: f64,
    pub(crate) span: Span,
}

/// One line of a program that is no O-word line.
#[derive(Clone, Debug, Default)]
pub(crate) struct Block {
    pub(crate) n: Option<LineNumber>,
    pub(crate) remark: Option<Remark>,
    pub(crate) codes: Codes,
    pub(crate) assignments: Vec<Assignment>,
    pub(crate) remapped: Vec<Remapped>,
    words: Words,
    m_count: usize,
}

/// So many letters without a number are no mistyped words but a sentence, of which the letters are not worth a mistake each.
const LETTERS_ALONE: usize = 5;

/// Longest wait, s: a year.
const DWELL_S_MAX: f64 = 365.0 * 86_400.0;

/// Most M words on a line.
const M_WORDS_MAX: usize = 4;

/// The G and M words of a line, one a modal group.
#[derive(Clone, Debug, Default)]
pub(crate) struct Codes {
    pub(crate) non_modal: Option<Coded<NonModal>>,
    pub(crate) motion: Option<Coded<Option<Motion>>>,
    pub(crate) plane: Option<Coded<Plane>>,
    pub(crate) distance: Option<Coded<Distance>>,
    pub(crate) arc_distance: Option<Coded<Distance>>,
    pub(crate) feed_unit: Option<Coded<FeedUnit>>,
    pub(crate) unit: Option<Coded<LengthUnit>>,
    pub(crate) compensation: Option<Coded<Compensation>>,
    pub(crate) length_offset: Option<Coded<LengthOffset>>,
    pub(crate) retract: Option<Coded<Retract>>,
    pub(crate) system: Option<Coded<u8>>,
    pub(crate) path: Option<Coded<PathCode>>,
    pub(crate) spindle_mode: Option<Coded<SpindleCode>>,
    pub(crate) diameter: Option<Coded<bool>>,
    pub(crate) stop: Option<Coded<Stop>>,
    pub(crate) input_output: Option<Coded<InputOutput>>,
    pub(crate) tool: Option<Coded<ToolCode>>,
    pub(crate) spindle: Option<Coded<SpindleAction>>,
    pub(crate) coolant: Option<Coded<Coolant>>,
    pub(crate) overrides: Option<Coded<Override>>,
    pub(crate) modal: Option<Coded<ModalCode>>,
    pub(crate) user: Option<Coded<u8>>,
}

impl Codes {
    /// Place of a code that is no motion code.
    pub(crate) fn first_beside_motion(&self) -> Option<Span> {
        fn span<T>(code: &Option<Coded<T>>) -> Option<Span> {
            code.as_ref().map(|code| code.span)
        }
        [
            span(&self.non_modal),
            span(&self.plane),
            span(&self.distance),
            span(&self.arc_distance),
            span(&self.feed_unit),
            span(&self.unit),
            span(&self.compensation),
            span(&self.length_offset),
            span(&self.retract),
            span(&self.system),
            span(&self.path),
            span(&self.spindle_mode),
            span(&self.diameter),
            span(&self.stop),
            span(&self.input_output),
            span(&self.tool),
            span(&self.spindle),
            span(&self.coolant),
            span(&self.overrides),
            span(&self.modal),
            span(&self.user),
        ]
        .into_iter()
        .flatten()
        .min_by_key(|span| span.start)
    }
}

/// Letters of words: A to Z and `@ ^ $`.
const LETTERS: usize = 29;

/// The words of a line that are neither G nor M nor N, by letter.
#[derive(Clone, Debug)]
struct Words {
    /// A bit a letter, see [`slot`].
    present: u32,
    values: [f64; LETTERS],
    spans: [Span; LETTERS],
}

impl Default for Words {
    fn default() -> Words {
        Words {
            present: 0,
            values: [0.0; LETTERS],
            spans: [Span::default(); LETTERS],
        }
    }
}

/// Place of a letter in [`Words`].
const fn slot(letter: u8) -> usize {
    match letter {
        b'@' => 26,
        b'^' => 27,
        b'$' => 28,
        letter => (letter - b'A') as usize,
    }
}

/// The bits of some letters in [`Words::present`].
pub(crate) const fn letters(text: &[u8]) -> u32 {
    let mut bits = 0;
    let mut at = 0;
    while at < text.len() {
        bits |= 1 << slot(text[at]);
        at += 1;
    }
    bits
}

/// Letters of the nine axes.
const AXES: u32 = letters(b"XYZABCUVW");

impl Block {
    /// Reads a line, of at most [`crate::LINE_OCTETS_MAX`] octets. What is wrong is added to `faults`; what is right stays.
    pub(crate) fn read(&mut self, line: &[u8], values: &impl Values, faults: &mut Faults) {
        self.clear();
        let before = faults.len();
        self.read_rest(Cursor::new(line), values, faults);
        let is_letter_alone =
            |(_, kind): &&Fault| matches!(kind, ErrorKind::Expression(ExpressionError::ValueMissing { .. }));
        if faults.len() >= before + LETTERS_ALONE
            && faults[before..].iter().filter(is_letter_alone).count() >= LETTERS_ALONE
        {
            faults.truncate(before);
            faults.push((Span::new(0, line.len()), ErrorKind::NoWords));
        }
    }

    pub(crate) fn clear(&mut self) {
        self.n = None;
        self.remark = None;
        self.codes = Codes::default();
        self.assignments.clear();
        self.m_count = 0;
        self.remapped.clear();
        self.words.present = 0; // numbers and places of absent words are never looked at
    }

    /// Reads what stands behind the cursor.
    fn read_rest(&mut self, mut cursor: Cursor<'_>, values: &impl Values, faults: &mut Faults) {
        let mut first = true; // nothing but a / has been read
        while let Some(item) = cursor.item() {
            let result = match item {
                Ok(Item::BlockDelete) => continue,
                Ok(Item::Comment(text)) => {
                    self.remark = Some(Remark::Parentheses(text));
                    Ok(())
                }
                Ok(Item::Remark(text)) => {
                    // For the reader of the text only: a comment in parentheses before it still acts.
                    self.remark.get_or_insert(Remark::Semicolon(text));
                    Ok(())
                }
                Ok(Item::Parameter) => self.assignment(&mut cursor, values),
                Ok(Item::Letter(b'N')) if first => LineNumber::read(&mut cursor).map(|number| self.n = Some(number)),
                Ok(Item::Letter(b'N')) => Err((cursor.span(), ErrorKind::MisplacedLineNumber)),
                Ok(Item::Letter(b'E')) if let Some(fault) = cursor.exponent() => Err(fault),
                Ok(Item::Letter(letter)) => match cursor.value(values) {
                    Ok(value) => match values.remapped(letter, value) {
                        None => self.word(letter, value, cursor.span()),
                        Some(index) => {
                            let span = cursor.span();
                            self.remapped.push(Remapped { index, value, span });
                            Ok(())
                        }
                    },
                    Err(fault) => Err(fault),
                },
                Err(fault) => Err(fault),
            };
            first = false;
            if let Err((span, kind)) = result {
                let exponent = match kind {
                    ErrorKind::RepeatedLetter { letter: 'E' } => number_with_exponent(cursor.line, span.start.into()),
                    _ => None,
                };
                faults.push(exponent.unwrap_or((span, kind)));
            }
        }
    }

    #[inline]
    fn word(&mut self, letter: u8, value: f64, span: Span) -> Result<(), Fault> {
        let kind = match letter {
            b'G' => self.g_word(value, span).err(),
            b'M' => self.m_word(value, span).err(),
            letter => self.other_word(letter, value, span).err(),
        };
        kind.map_or(Ok(()), |kind| Err((span, kind)))
    }

    fn assignment(&mut self, cursor: &mut Cursor<'_>, values: &impl Values) -> Result<(), Fault> {
        let target = cursor.parameter_target(values)?;
        let span = cursor.span();
        let value = cursor.value(values)?;
        let target = match target {
            Assigned::Numbered(index) => Parameter::Numbered(index),
            Assigned::Named(name) => Parameter::Named(name.into_owned()),
            Assigned::Unknown => return Ok(()), // a check without running; there is nothing to keep
        };
        self.assignments.push(Assignment { target, value, span });
        Ok(())
    }

    #[inline]
    fn other_word(&mut self, letter: u8, value: f64, span: Span) -> Result<(), ErrorKind> {
        if value.abs() > NUMBER_MAX {
            let (letter, max) = (letter.into(), NUMBER_MAX);
            return Err(ErrorKind::NumberTooLarge { letter, max });
        }
        let slot = slot(letter);
        if self.words.present & (1 << slot) != 0 {
            let letter = letter.into();
            return Err(ErrorKind::RepeatedLetter { letter });
        }
        self.words.present |= 1 << slot;
        self.words.values[slot] = value;
        self.words.spans[slot] = span;
        match letter {
            b'F' | b'S' | b'T' if value < 0.0 => Err(ErrorKind::Negative {
                letter: letter.into(),
                value,
            }),
            b'H' | b'T' | b'$' if !value.is_nan() && integer(value).is_none() => Err(ErrorKind::NotInteger {
                letter: letter.into(),
                value,
            }),
            _ => Ok(()),
        }
    }

    fn g_word(&mut self, value: f64, span: Span) -> Result<(), ErrorKind> {
        if value.is_nan() {
            return Ok(()); // which code it is shows when the program runs
        }
        let (code, g) = GCode::from_number(value)?;
        let word = Coded { value: (), code, span };
        let codes = &mut self.codes;
        match g {
            GCode::NonModal(code) => put(&mut codes.non_modal, word, code, "non-modal", g_name),
            // G80 gives way to another motion code on its line: "G0 G17 G80 G90" is a usual first line.
            GCode::Motion(None) if codes.motion.is_some() => Ok(()),
            GCode::Motion(code) => {
                if codes.motion.is_some_and(|first| first.value.is_none()) {
                    codes.motion = None;
                }
                put(&mut codes.motion, word, code, "motion", g_name)
            }
            GCode::Plane(code) => put(&mut codes.plane, word, code, "plane", g_name),
            GCode::Distance(code) => put(&mut codes.distance, word, code, "distance mode", g_name),
            GCode::ArcDistance(code) => put(&mut codes.arc_distance, word, code, "arc distance mode", g_name),
            GCode::FeedUnit(code) => put(&mut codes.feed_unit, word, code, "feed mode", g_name),
            GCode::Unit(code) => put(&mut codes.unit, word, code, "units", g_name),
            GCode::Compensation(code) => put(&mut codes.compensation, word, code, "cutter compensation", g_name),
            GCode::LengthOffset(code) => put(&mut codes.length_offset, word, code, "tool length offset", g_name),
            GCode::Retract(code) => put(&mut codes.retract, word, code, "retract mode of cycles", g_name),
            GCode::System(code) => put(&mut codes.system, word, code, "coordinate system", g_name),
            GCode::Path(code) => put(&mut codes.path, word, code, "path control", g_name),
            GCode::Spindle(code) => put(&mut codes.spindle_mode, word, code, "spindle mode", g_name),
            GCode::Diameter(code) => put(&mut codes.diameter, word, code, "lathe diameter mode", g_name),
        }
    }

    fn m_word(&mut self, value: f64, span: Span) -> Result<(), ErrorKind> {
        if value.is_nan() {
            return Ok(());
        }
        self.m_count += 1;
        if self.m_count > M_WORDS_MAX {
            return Err(ErrorKind::TooManyMCodes { max: M_WORDS_MAX });
        }
        let (code, m) = MCode::from_number(value)?;
        let word = Coded { value: (), code, span };
        let codes = &mut self.codes;
        match m {
            MCode::Stop(code) => put(&mut codes.stop, word, code, "program stop", m_name),
            MCode::InputOutput(code) => put(&mut codes.input_output, word, code, "inputs and outputs", m_name),
            MCode::Tool(code) => put(&mut codes.tool, word, code, "tool change", m_name),
            MCode::Spindle(code) => put(&mut codes.spindle, word, code, "spindle", m_name),
            MCode::Coolant(code) => put(&mut codes.coolant, word, code, "coolant", m_name),
            MCode::Override(code) => put(&mut codes.overrides, word, code, "overrides", m_name),
            MCode::Modal(code) => put(&mut codes.modal, word, code, "modal state", m_name),
            MCode::User(code) => put(&mut codes.user, word, code, "user codes", m_name),
        }
    }

    /// Number of a word, by capital letter.
    #[inline]
    pub(crate) fn word_value(&self, letter: u8) -> Option<f64> {
        let slot = slot(letter);
        (self.words.present & (1 << slot) != 0).then(|| self.words.values[slot])
    }

    /// Place of a word that is there.
    pub(crate) fn span(&self, letter: u8) -> Span {
        debug_assert!(self.has(letters(&[letter])));
        self.words.spans[slot(letter)]
    }

    /// Whether one of the letters of a set is there, see [`letters`].
    #[inline]
    pub(crate) fn has(&self, letters: u32) -> bool {
        self.words.present & letters != 0
    }

    /// Letters that are there, as [`letters`] counts them.
    #[inline]
    pub(crate) fn present(&self) -> u32 {
        self.words.present
    }

    /// Whether one of the nine axes is named.
    pub(crate) fn has_axes(&self) -> bool {
        self.has(AXES)
    }

    /// Number of an axis word.
    #[inline]
    pub(crate) fn axis(&self, axis: Axis) -> Option<f64> {
        self.word_value(axis.letter() as u8)
    }

    /// First axis or polar letter, in the order of [`Axis::ALL`].
    pub(crate) fn first_axis(&self) -> Option<u8> {
        b"XYZABCUVW@^"
            .iter()
            .copied()
            .find(|letter| self.has(letters(&[*letter])))
    }

    /// The first letter of `wanted` that is there.
    pub(crate) fn first_of(&self, wanted: &[u8]) -> Option<u8> {
        wanted.iter().copied().find(|letter| self.has(letters(&[*letter])))
    }

    /// Place of the motion code, or of the first axis word where the code is modal.
    pub(crate) fn motion_span(&self) -> Span {
        let axis = || self.first_axis().map(|letter| self.span(letter));
        let code = self.codes.motion.map(|coded| coded.span);
        code.or_else(axis).unwrap_or_default()
    }

    /// Refuses a word below 0.
    pub(crate) fn check_not_negative(&self, letter: u8) -> Result<(), Fault> {
        match self.word_value(letter) {
            Some(value) if value < 0.0 => {
                let span = self.span(letter);
                let letter = letter.into();
                Err((span, ErrorKind::Negative { letter, value }))
            }
            Some(_) | None => Ok(()),
        }
    }

    /// Refuses a wait in seconds below 0, or of more than a year: nobody means one.
    pub(crate) fn check_dwell(&self, letter: u8) -> Result<(), Fault> {
        self.check_not_negative(letter)?;
        match self.word_value(letter) {
            Some(seconds) if seconds > DWELL_S_MAX => {
                let days = seconds / 86_400.0;
                Err(self.span(letter).fault(ErrorKind::DwellTooLong { days }))
            }
            Some(_) | None => Ok(()),
        }
    }

    /// Refuses a word that must be an integer and is none.
    pub(crate) fn check_integer(&self, letter: u8) -> Result<(), Fault> {
        match self.word_value(letter) {
            Some(value) if integer(value).is_none() => {
                let span = self.span(letter);
                let letter = letter.into();
                Err((span, ErrorKind::NotInteger { letter, value }))
            }
            Some(_) | None => Ok(()),
        }
    }

    /// Takes a word away, as if it had been used up.
    pub(crate) fn remove(&mut self, letter: u8) {
        self.words.present &= !(1 << slot(letter));
    }
}

/// Sets a group's code; a second one of the same group is refused.
fn put<T>(
    slot: &mut Option<Coded<T>>,
    word: Coded<()>,
    value: T,
    group: &'static str,
    name: fn(u16) -> String,
) -> Result<(), ErrorKind> {
    if let Some(first) = slot {
        return Err(ErrorKind::ModalConflict {
            first: name(first.code),
            second: name(word.code),
            group,
        });
    }
    *slot = Some(Coded {
        value,
        code: word.code,
        span: word.span,
    });
    Ok(())
}
