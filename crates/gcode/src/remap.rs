//! Codes that call a subroutine instead of what they usually do.
//!
//! In:  [`Remap`]s of the settings; blocks with such codes.
//! Out: calls with the words of the block as parameters, each at the place in the order of a block at which its code
//!      stands. Within such a subroutine its code is the usual one.

use crate::block::{Block, Remapped};
use crate::error::OWordError;
use crate::o_word::Label;
use crate::parameter::ARGUMENTS_MAX;
use crate::scan::Fault;
use crate::settings::Remap;
use motion::canon::Source;

/// Parts of a block in their order, as far as a remapped code can stand for one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Phase {
    /// Comment, G96, G93 and so on, F.
    Feed,
    /// S
    Speed,
    /// T
    SelectTool,
    /// M group 5.
    InputOutput,
    /// M group 6.
    Tool,
    /// M group 7.
    Spindle,
    /// M70 to M73, M group 8.
    Coolant,
    /// M group 9.
    Override,
    /// M group 10.
    User,
    /// G codes that set something.
    Modes,
    /// G group 1.
    Motion,
    /// M group 4.
    Stop,
}

impl Phase {
    /// The part behind; nothing of a block is behind the last one.
    pub(crate) fn next(self) -> Phase {
        match self {
            Phase::Feed => Phase::Speed,
            Phase::Speed => Phase::SelectTool,
            Phase::SelectTool => Phase::InputOutput,
            Phase::InputOutput => Phase::Tool,
            Phase::Tool => Phase::Spindle,
            Phase::Spindle => Phase::Coolant,
            Phase::Coolant => Phase::Override,
            Phase::Override => Phase::User,
            Phase::User => Phase::Modes,
            Phase::Modes => Phase::Motion,
            Phase::Motion | Phase::Stop => Phase::Stop,
        }
    }
}

/// A remapped code, ready to be found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    letter: u8,
    /// Ten times the number of a G or M word; the numbers of other words do not matter.
    tenths: i64,
    pub(crate) phase: Phase,
    pub(crate) label: Label,
    name: String,
    arguments: String,
}

impl Entry {
    pub(crate) fn new(remap: &Remap) -> Entry {
        let name = remap.code.to_ascii_uppercase();
        let letter = name.bytes().next().unwrap_or(b'?');
        let number: f64 = name.get(1..).and_then(|number| number.parse().ok()).unwrap_or(-1.0);
        let phase = match (letter, remap.modal_group) {
            (b'F', _) => Phase::Feed,
            (b'S', _) => Phase::Speed,
            (b'T', _) => Phase::SelectTool,
            (b'M', 4) => Phase::Stop,
            (b'M', 5) => Phase::InputOutput,
            (b'M', 6) => Phase::Tool,
            (b'M', 7) => Phase::Spindle,
            (b'M', 8) => Phase::Coolant,
            (b'M', 9) => Phase::Override,
            (b'M', _) => Phase::User,
            (_, _) => Phase::Motion,
        };
        Entry {
            letter,
            tenths: (number * 10.0).round() as i64,
            phase,
            label: Label::Name(remap.subroutine.to_ascii_lowercase().into()),
            name,
            arguments: remap.arguments.clone(),
        }
    }

    /// Whether this word is the code.
    pub(crate) fn is(&self, letter: u8, number: f64) -> bool {
        self.letter == letter
            && (matches!(letter, b'F' | b'S' | b'T') || (number * 10.0 - self.tenths as f64).abs() < 1e-3)
    }

    /// Takes the words of the block that are for the subroutine; of F, S and T its own number, too.
    pub(crate) fn take_arguments(
        &self,
        block: &mut Block,
        code: &Remapped,
        feed: f64,
        speed: f64,
    ) -> Result<Arguments, Fault> {
        let at = |kind| (code.span, kind);
        let code_name = || self.name.clone();
        let mut arguments = Arguments::default();
        if matches!(self.letter, b'F' | b'S' | b'T') {
            arguments.named.push((self.letter.to_ascii_lowercase(), code.value));
        }
        let by_position = self.arguments.starts_with('@');
        for wanted in self.arguments.bytes() {
            match wanted {
                b'@' => {}
                b'>' if feed > 0.0 => {}
                b'>' => return Err(at(OWordError::RemapNeedsFeed { code: code_name() }.into())),
                b'^' if speed > 0.0 => {}
                b'^' => return Err(at(OWordError::RemapNeedsSpeed { code: code_name() }.into())),
                b'n' | b'N' => arguments.line_number = true,
                letter if letter.is_ascii_alphabetic() => {
                    let word = letter.to_ascii_uppercase();
                    let value = block.word_value(word);
                    if letter.is_ascii_uppercase() && value.is_none() {
                        let (code, letter) = (code_name(), word.into());
                        return Err(at(OWordError::RemapWordMissing { code, letter }.into()));
                    }
                    block.remove(word);
                    if by_position {
                        if arguments.count < ARGUMENTS_MAX {
                            arguments.numbered[arguments.count] = value.unwrap_or(-1.0);
                            arguments.count += 1;
                        }
                    } else if let Some(value) = value {
                        arguments.named.push((word.to_ascii_lowercase(), value));
                    }
                }
                _ => {}
            }
        }
        Ok(arguments)
    }
}

/// What a remapped code hands on.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Arguments {
    /// #1, #2, ...
    pub(crate) numbered: [f64; ARGUMENTS_MAX],
    count: usize,
    /// Small letter and value.
    pub(crate) named: Vec<(u8, f64)>,
    /// Whether the number of the line is `#<n>`.
    pub(crate) line_number: bool,
}

/// The rest of a block whose remapped code is being run.
#[derive(Clone, Debug)]
pub(crate) struct Rest {
    pub(crate) block: Block,
    pub(crate) line: Vec<u8>,
    /// Where that is.
    pub(crate) source: Source,
    /// First part that was not run.
    pub(crate) from: Phase,
}
