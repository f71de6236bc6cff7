//! Subroutines, loops and conditions: where reading goes on.
//!
//! In:  O-words, M98 and M99, in the order in which they are run.
//! Out: places in files, and lines to be passed over.
//!
//! Labels belong to the subroutine in which they stand. A block that is left out is only looked through for the O-word
//! that ends it.

use crate::error::{ErrorKind, OWordError};
use crate::o_word::{Keyword, Label};
use crate::parameter::ARGUMENTS_MAX;
use crate::remap::Rest;
use crate::scan::Span;
use motion::canon::Source;
use std::collections::HashMap;

/// Most calls within calls: LinuxCNC's.
pub(crate) const CALLS_MAX: usize = 9;

/// Most subroutines that a program defines; one that defines them by computed numbers could go on for ever.
pub(crate) const SUBROUTINES_MAX: usize = 100_000;

/// Most labels of a level, and most ends of searches, that are remembered; then they are forgotten and remembered from the start.
pub(crate) const REMEMBERED_MAX: usize = 20_000;

/// A place from which reading goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Which file.
    pub(crate) file: usize,
    /// Next octet to read.
    pub(crate) offset: u64,
    /// Number of the line before it.
    pub(crate) line: u32,
}

/// A subroutine that was come across.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Subroutine {
    /// Behind the line that begins it.
    pub(crate) start: Place,
    /// It begins with its label alone: called by M98, ended by M99.
    pub(crate) is_program: bool,
}

/// A block that is under way.
#[derive(Clone, Debug)]
pub(crate) struct Open {
    pub(crate) label: Label,
    pub(crate) kind: OpenKind,
    /// Line of its O-word.
    pub(crate) line: u32,
}

/// What kind of block is under way, and what it needs to go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum OpenKind {
    /// A branch is being run: the others are passed over.
    If,
    /// `while`: `start` is before its line.
    While { start: Place },
    /// `do`: `start` is behind its line.
    Do { start: Place },
    /// `repeat`: `start` is behind its line.
    Repeat { start: Place, left: u64 },
}

/// A subroutine that is under way, or the program itself.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Its label; `None`: the program itself.
    pub(crate) label: Option<Label>,
    pub(crate) kind: LevelKind,
    /// Where it goes on behind the return, and the line of the call.
    pub(crate) back: Option<Place>,
    /// #1 to #30 of the caller.
    pub(crate) arguments: [f64; ARGUMENTS_MAX],
    pub(crate) blocks: Vec<Open>,
    /// Lines at which the labels of this level were seen to begin a block.
    labels: HashMap<Label, u32>,
}

/// How a level was entered.
#[derive(Clone, Debug)]
pub(crate) enum LevelKind {
    /// The program itself.
    Program,
    /// By `call`.
    Call,
    /// By M98: `start` is the first line, to be run `left` times more.
    Subprogram { start: Place, left: u32 },
    /// By a remapped code: the rest of its block is run behind the return.
    Remap(Box<Rest>),
    /// By a lathe cycle: its moves are gathered.
    Profile,
}

impl Level {
    pub(crate) fn new(
        label: Option<Label>,
        kind: LevelKind,
        back: Option<Place>,
        arguments: [f64; ARGUMENTS_MAX],
    ) -> Level {
        Level {
            label,
            kind,
            back,
            arguments,
            blocks: Vec::new(),
            labels: HashMap::new(),
        }
    }

    /// Begins a block; its label must not have begun another one at this level.
    pub(crate) fn open(&mut self, open: Open) -> Result<(), ErrorKind> {
        match self.labels.get(&open.label) {
            Some(line) if *line != open.line => {
                return Err(OWordError::DuplicateLabel {
                    label: open.label.to_string(),
                    line: *line,
                }
                .into());
            }
            Some(_) => {}
            None => {
                if self.labels.len() >= REMEMBERED_MAX {
                    self.labels.clear();
                }
                self.labels.insert(open.label.clone(), open.line);
            }
        }
        self.blocks.push(open);
        Ok(())
    }

    /// The innermost block of a label that is under way; those within it are left.
    pub(crate) fn find(&mut self, label: &Label) -> Option<&mut Open> {
        let at = self.blocks.iter().rposition(|open| open.label == *label)?;
        self.blocks.truncate(at + 1);
        self.blocks.last_mut()
    }
}

/// What is looked for while lines are passed over.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    pub(crate) label: Label,
    pub(crate) target: SearchEnd,
    /// What began the block, for the message if nothing ends it.
    pub(crate) keyword: Keyword,
    /// Line of that.
    pub(crate) source: Source,
    /// Where it stands in its line.
    pub(crate) span: Span,
}

/// O-words that end a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum SearchEnd {
    /// `elseif`, `else` or `endif`.
    Branch,
    /// `endif`
    EndIf,
    /// `endwhile`, or the `while` that ends a `do`.
    EndWhile,
    /// `endrepeat`
    EndRepeat,
    /// `endsub`
    EndSub,
    /// `sub`, or the label alone: a call of what is defined further down.
    Sub,
}

impl SearchEnd {
    pub(crate) fn is(self, keyword: Keyword) -> bool {
        match self {
            SearchEnd::Branch => matches!(keyword, Keyword::ElseIf | Keyword::Else | Keyword::EndIf),
            SearchEnd::EndIf => keyword == Keyword::EndIf,
            SearchEnd::EndWhile => matches!(keyword, Keyword::EndWhile | Keyword::While),
            SearchEnd::EndRepeat => keyword == Keyword::EndRepeat,
            SearchEnd::EndSub => keyword == Keyword::EndSub,
            SearchEnd::Sub => matches!(keyword, Keyword::Sub | Keyword::Program),
        }
    }

    /// As the message says it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            SearchEnd::Branch | SearchEnd::EndIf => "endif",
            SearchEnd::EndWhile => "endwhile (or while, of a do)",
            SearchEnd::EndRepeat => "endrepeat",
            SearchEnd::EndSub => "endsub",
            SearchEnd::Sub => "sub",
        }
    }
}
