//! One line to one [`Block`]: its words, with every rule that needs no other line.
//!
//! In:  a line of text.
//! Out: the block, and all that is wrong with it. Reused from line to line; allocates for errors only.

use crate::error::ErrorKind;
use crate::modal::{
    Coolant, Distance, FeedMode, GCode, MCode, Motion, NonModal, PathCode, Stop, g_name, integer, m_name,
};
use crate::scan::{Scanner, Span, Token};
use motion::canon::{Axis, LengthUnit, Plane, SpindleDirection};

/// A code and where it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Coded<T> {
    pub(crate) value: T,
    /// Ten times the number of a G word, the number of an M word.
    code: u16,
    pub(crate) span: Span,
}

/// What a comment does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CommentKind {
    /// `(MSG, text)`
    Message,
    /// Any other.
    Plain,
}

/// Mistakes of a line with their places.
pub(crate) type Faults = Vec<(Span, ErrorKind)>;

/// One line of a program.
#[derive(Clone, Debug, Default)]
pub(crate) struct Block {
    /// N-word.
    pub(crate) n: Option<u32>,
    /// The last comment of the line, which alone acts, and its text.
    pub(crate) comment: Option<(CommentKind, Span)>,
    pub(crate) codes: Codes,
    words: Words,
}

/// The G and M words of a line, one a modal group.
#[derive(Clone, Debug, Default)]
pub(crate) struct Codes {
    pub(crate) non_modal: Option<Coded<NonModal>>,
    pub(crate) motion: Option<Coded<Option<Motion>>>,
    pub(crate) plane: Option<Coded<Plane>>,
    pub(crate) distance: Option<Coded<Distance>>,
    pub(crate) arc_distance: Option<Coded<Distance>>,
    pub(crate) feed_mode: Option<Coded<FeedMode>>,
    pub(crate) unit: Option<Coded<LengthUnit>>,
    pub(crate) system: Option<Coded<u8>>,
    pub(crate) path: Option<Coded<PathCode>>,
    cutter_compensation: Option<Coded<()>>,
    tool_length_offset: Option<Coded<()>>,
    pub(crate) stop: Option<Coded<Stop>>,
    pub(crate) tool_change: Option<Coded<()>>,
    pub(crate) spindle: Option<Coded<Option<SpindleDirection>>>,
    pub(crate) coolant: Option<Coded<Coolant>>,
}

/// The words of a line that are neither G nor M nor N, by letter.
#[derive(Clone, Debug, Default)]
struct Words {
    /// Bit 0 for A to bit 25 for Z.
    present: u32,
    values: [f64; 26],
    spans: [Span; 26],
}

impl Words {
    fn has(&self, letter: u8) -> bool {
        self.present & (1 << (letter - b'A')) != 0
    }
}

impl Block {
    /// Reads a line, of at most [`crate::LINE_MAX`] octets. What is wrong is added to `faults`; what is right stays.
    pub(crate) fn read(&mut self, line: &[u8], faults: &mut Faults) {
        self.n = None;
        self.comment = None;
        self.codes = Codes::default();
        self.words.present = 0; // numbers and places of absent words are never looked at

        let mut first = true; // nothing but a / has been read
        for (position, (span, token)) in Scanner::new(line).enumerate() {
            let fault = match token {
                Ok(Token::Slash) if position == 0 => continue,
                Ok(Token::Slash) => Some(ErrorKind::MisplacedSlash),
                Ok(Token::Comment(text)) => self.take_comment(line, text),
                Ok(Token::Word { letter: b'N', value }) if first => self.take_line_number(value),
                Ok(Token::Word { letter, value }) => self.take_word(letter, value, span),
                Err(kind) => Some(kind),
            };
            first = false;
            faults.extend(fault.map(|kind| (span, kind)));
        }
    }

    fn take_comment(&mut self, line: &[u8], text: Span) -> Option<ErrorKind> {
        match comment_action(text.of(line)) {
            Action::None => self.comment = Some((CommentKind::Plain, text)),
            Action::Message { skip } => {
                self.comment = Some((
                    CommentKind::Message,
                    Span {
                        start: text.start + skip,
                        end: text.end,
                    },
                ));
            }
            Action::Unsupported(word) => return Some(ErrorKind::UnsupportedComment { word }),
        }
        None
    }

    fn take_line_number(&mut self, value: f64) -> Option<ErrorKind> {
        if value.is_sign_negative() {
            return Some(ErrorKind::Negative { letter: 'N', value });
        }
        self.n = Some(value as u32); // below the scanner's limit, which is below that of u32
        None
    }

    fn take_word(&mut self, letter: u8, value: f64, span: Span) -> Option<ErrorKind> {
        match letter {
            b'N' => Some(ErrorKind::MisplacedLineNumber),
            b'G' => match GCode::of(value) {
                Ok((code, g)) => self.take_g(Coded { value: g, code, span }),
                Err(kind) => Some(kind),
            },
            b'M' => match MCode::of(value) {
                Ok((code, m)) => self.take_m(Coded { value: m, code, span }),
                Err(kind) => Some(kind),
            },
            letter => {
                if self.words.has(letter) {
                    return Some(ErrorKind::RepeatedLetter { letter: letter.into() });
                }
                let index = usize::from(letter - b'A');
                self.words.present |= 1 << index;
                self.words.values[index] = value;
                self.words.spans[index] = span;
                value_fault(letter, value)
            }
        }
    }

    fn take_g(&mut self, word: Coded<GCode>) -> Option<ErrorKind> {
        match word.value {
            GCode::NonModal(code) => put(&mut self.codes.non_modal, word, code, "non-modal", g_name),
            // G80 gives way to another motion code on its line: "G0 G17 G80 G90" is a usual first line.
            GCode::Motion(None) if self.codes.motion.is_some() => None,
            GCode::Motion(code) => {
                if self.codes.motion.is_some_and(|first| first.value.is_none()) {
                    self.codes.motion = None;
                }
                put(&mut self.codes.motion, word, code, "motion", g_name)
            }
            GCode::Plane(code) => put(&mut self.codes.plane, word, code, "plane", g_name),
            GCode::Distance(code) => put(&mut self.codes.distance, word, code, "distance mode", g_name),
            GCode::ArcDistance(code) => put(&mut self.codes.arc_distance, word, code, "arc distance mode", g_name),
            GCode::FeedMode(code) => put(&mut self.codes.feed_mode, word, code, "feed mode", g_name),
            GCode::Unit(code) => put(&mut self.codes.unit, word, code, "units", g_name),
            GCode::System(code) => put(&mut self.codes.system, word, code, "coordinate system", g_name),
            GCode::Path(code) => put(&mut self.codes.path, word, code, "path control", g_name),
            GCode::NoCutterCompensation => put(
                &mut self.codes.cutter_compensation,
                word,
                (),
                "cutter compensation",
                g_name,
            ),
            GCode::NoToolLengthOffset => put(
                &mut self.codes.tool_length_offset,
                word,
                (),
                "tool length offset",
                g_name,
            ),
        }
    }

    fn take_m(&mut self, word: Coded<MCode>) -> Option<ErrorKind> {
        match word.value {
            MCode::Stop(code) => put(&mut self.codes.stop, word, code, "program stop", m_name),
            MCode::ToolChange => put(&mut self.codes.tool_change, word, (), "tool change", m_name),
            MCode::Spindle(code) => put(&mut self.codes.spindle, word, code, "spindle", m_name),
            MCode::Coolant(code) => put(&mut self.codes.coolant, word, code, "coolant", m_name),
        }
    }

    /// Number of a word, by capital letter.
    pub(crate) fn word(&self, letter: u8) -> Option<f64> {
        self.words
            .has(letter)
            .then(|| self.words.values[usize::from(letter - b'A')])
    }

    /// Place of a word that is there.
    pub(crate) fn span(&self, letter: u8) -> Span {
        debug_assert!(self.words.has(letter));
        self.words.spans[usize::from(letter - b'A')]
    }

    /// Number of an axis word.
    pub(crate) fn axis(&self, axis: Axis) -> Option<f64> {
        self.word(axis.letter() as u8)
    }

    /// First axis letter, in the order of [`Axis::ALL`].
    pub(crate) fn first_axis(&self) -> Option<u8> {
        Axis::ALL
            .map(|axis| axis.letter() as u8)
            .into_iter()
            .find(|letter| self.words.has(*letter))
    }

    /// What this line does with its axis words while `modal` is the active motion; `None`: no motion.
    pub(crate) fn motion_now(&self, modal: Option<Motion>) -> Option<Motion> {
        if let Some(coded) = self.codes.motion {
            return coded.value;
        }
        if let Some(Coded {
            value: NonModal::Return(_),
            ..
        }) = self.codes.non_modal
        {
            return None;
        }
        let centre = b"IJK".iter().any(|letter| self.words.has(*letter));
        modal.filter(|motion| self.first_axis().is_some() || (motion.is_arc() && centre))
    }

    /// The rules that join words and codes: every word is used, and once.
    pub(crate) fn check_use(&self, modal: Option<Motion>) -> Result<(), (Span, ErrorKind)> {
        let now = self.motion_now(modal);
        let returns = match self.codes.non_modal {
            Some(Coded {
                value: NonModal::Return(point),
                ..
            }) => Some(point),
            _ => None,
        };
        if let (
            Some(point),
            Some(Coded {
                value: Some(motion),
                span,
                ..
            }),
        ) = (returns, self.codes.motion)
        {
            return Err((
                span,
                ErrorKind::AxisConflict {
                    non_modal: point.name(),
                    motion: motion.name(),
                },
            ));
        }
        if let Some(axis) = self.first_axis()
            && now.is_none()
            && returns.is_none()
        {
            let letter = axis.into();
            let kind = if self.codes.motion.is_some() {
                ErrorKind::AxisWordWithG80 { letter }
            } else {
                ErrorKind::NoMotion { letter }
            };
            return Err((self.span(axis), kind));
        }
        let arc = now.is_some_and(Motion::is_arc);
        let blends = matches!(
            self.codes.path,
            Some(Coded {
                value: PathCode::Continuous,
                ..
            })
        );
        let dwells = matches!(
            self.codes.non_modal,
            Some(Coded {
                value: NonModal::Dwell,
                ..
            })
        );
        const OTHERS: &str = "codes that are not supported";
        let rules: [(&[u8], bool, &'static str); 4] = [
            (b"IJKR", arc, "G2 and G3"),
            (b"P", arc || blends || dwells, "G2, G3, G4 and G64"),
            (b"Q", blends, "G64"),
            (b"DEHL", false, OTHERS),
        ];
        for (letters, used, users) in rules {
            if used {
                continue;
            }
            if let Some(letter) = letters.iter().copied().find(|letter| self.words.has(*letter)) {
                return Err((
                    self.span(letter),
                    ErrorKind::UnusedWord {
                        letter: letter.into(),
                        users,
                    },
                ));
            }
        }
        Ok(())
    }
}

/// Rules of a word's number alone.
fn value_fault(letter: u8, value: f64) -> Option<ErrorKind> {
    match letter {
        b'F' | b'S' | b'T' if value < 0.0 => Some(ErrorKind::Negative {
            letter: letter.into(),
            value,
        }),
        b'T' if integer(value).is_none() => Some(ErrorKind::NotInteger { letter: 'T', value }),
        _ => None,
    }
}

/// Sets a group's code; a second one of the same group is refused.
fn put<T, W>(
    slot: &mut Option<Coded<T>>,
    word: Coded<W>,
    value: T,
    group: &'static str,
    name: fn(u16) -> String,
) -> Option<ErrorKind> {
    if let Some(first) = slot {
        return Some(ErrorKind::ModalConflict {
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
    None
}

enum Action {
    None,
    /// The message stands behind `skip` octets.
    Message {
        skip: u16,
    },
    Unsupported(&'static str),
}

/// What the text of a comment asks for: its first word, up to a comma, in any case.
fn comment_action(text: &[u8]) -> Action {
    const WITH_COMMA: [&str; 8] = [
        "DEBUG",
        "PRINT",
        "LOG",
        "LOGOPEN",
        "LOGAPPEND",
        "PROBEOPEN",
        "ABORT",
        "PY",
    ];
    const ALONE: [&str; 2] = ["LOGCLOSE", "PROBECLOSE"];
    let trimmed = text.trim_ascii_start();
    let blanks = text.len() - trimmed.len();
    let Some(comma) = trimmed.iter().position(|octet| *octet == b',') else {
        let found = ALONE
            .into_iter()
            .find(|word| trimmed.trim_ascii_end().eq_ignore_ascii_case(word.as_bytes()));
        return found.map_or(Action::None, Action::Unsupported);
    };
    let word = &trimmed[..comma];
    if word.eq_ignore_ascii_case(b"MSG") {
        return Action::Message {
            skip: (blanks + comma + 1) as u16,
        };
    }
    let found = WITH_COMMA
        .into_iter()
        .chain(ALONE)
        .find(|known| word.eq_ignore_ascii_case(known.as_bytes()));
    found.map_or(Action::None, Action::Unsupported)
}
