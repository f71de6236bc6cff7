//! What is wrong with O-words: blocks, subroutines and their calls, remapped codes that call one.

/// Why a block or a subroutine cannot be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OWordError {
    /// The number of an O-word.
    #[error("O{value} is no label: its number must be an integer from 0 on")]
    LabelNotInteger {
        /// The number that came.
        value: f64,
    },
    /// A word behind an O-label that is none of its keywords.
    #[error("{word} is no O-word: there are sub endsub call return if elseif else endif while endwhile do repeat endrepeat break continue{}", named_word_hint(.nearest))]
    UnknownKeyword {
        /// The word, lower case.
        word: String,
        /// The one that was probably meant.
        nearest: Option<String>,
    },
    /// More arguments than an O-word takes.
    #[error("{keyword} takes {most} values in brackets at most")]
    TooManyArguments {
        /// The O-word.
        keyword: String,
        /// Greatest value allowed.
        most: usize,
    },
    /// A label with values, and no word between them.
    #[error("{label} needs a word between its name and the values: {label} call [...]")]
    CallMissing {
        /// The label.
        label: String,
    },
    /// A condition or count is missing.
    #[error("{keyword} needs a value in brackets behind it: {keyword} [...]")]
    ConditionMissing {
        /// The O-word.
        keyword: String,
    },
    /// Something else on an O-word line.
    #[error("an O-word stands alone on its line: write this on the next one")]
    WordBehindOWord,
    /// The line that ends a block or another part of it is missing.
    #[error("{label} {keyword} has no {expected} behind it in this file")]
    BlockNotClosed {
        /// The label.
        label: String,
        /// What was opened.
        keyword: String,
        /// What would close it.
        expected: String,
    },
    /// A part of a block that was not begun.
    #[error("{label} {keyword} without {label} {opener} before it")]
    BlockNotOpen {
        /// The label.
        label: String,
        /// What stands there.
        keyword: String,
        /// What would have to stand before it.
        opener: &'static str,
    },
    /// A label twice.
    #[error("{label} is already the label of line {line}: each block needs its own")]
    DuplicateLabel {
        /// The label.
        label: String,
        /// Where it was first.
        line: u32,
    },
    /// A second definition of a subroutine.
    #[error("{label} is defined already in line {line}{}: a subroutine has one definition", if file.is_empty() { String::new() } else { format!(" of {file}") })]
    DefinedTwice {
        /// Label of the subroutine.
        label: String,
        /// Empty for the program itself.
        file: String,
        /// Line of the first definition.
        line: u32,
    },
    /// `call` of what M98 calls, or M98 of what `call` calls.
    #[error("{label} {}", if *.by_m98 { "is defined by sub and endsub: call it with `call`" } else { "is ended by M99: call it with M98" })]
    WrongCall {
        /// The label.
        label: String,
        /// How it was called.
        by_m98: bool,
    },
    /// M98, M99 or a bare O-word where the settings do not allow them.
    #[error(
        "{word} belongs to subprograms in Fanuc's style, which the machine has switched off: use sub, call and endsub"
    )]
    FanucSubprogram {
        /// What stands there.
        word: String,
    },
    /// M98 without P.
    #[error("M98 needs P, the number of the program to call")]
    ProgramNumberMissing,
    /// A remapped code without a word that its subroutine needs.
    #[error("{code} needs {letter}, a parameter of its subroutine")]
    RemapWordMissing {
        /// The code as programmed, such as `G83`.
        code: String,
        /// Letter of the word.
        letter: char,
    },
    /// A remapped code that demands a feed.
    #[error("{code} needs a feed: write F before it")]
    RemapNeedsFeed {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// A remapped code that demands a spindle speed.
    #[error("{code} needs a spindle speed: write S before it")]
    RemapNeedsSpeed {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// A subroutine in a subroutine.
    #[error("{label} sub stands inside the subroutine {outer}: define it before or behind")]
    NestedSubroutine {
        /// The label.
        label: String,
        /// The subroutine around.
        outer: String,
    },
    /// A subroutine that is neither in the file nor on the search path.
    #[error("subroutine {label} is not found: it is neither in this file nor as {file} in {folders}")]
    NoSuchSubroutine {
        /// The label.
        label: String,
        /// The file that was looked for.
        file: String,
        /// Where.
        folders: String,
    },
    /// A subroutine behind the `%` that ends the file.
    #[error(
        "{label} stands in line {line}, behind the % of line {percent}, which ends the program: move it before that %, or leave the % \
         out"
    )]
    SubroutineBehindPercent {
        /// The label.
        label: String,
        /// Where it stands.
        line: u32,
        /// Where the `%` stands.
        percent: u32,
    },
    /// More definitions than are remembered.
    #[error("more than {max} subroutines: a number computed for each new definition needs another way")]
    TooManySubroutines {
        /// Greatest value allowed.
        max: usize,
    },
    /// Too many subroutine calls within each other.
    #[error("{label} is the {depth}th call within calls: at most {depth_max} are allowed")]
    CallsTooDeep {
        /// The label.
        label: String,
        /// How deep it would be.
        depth: usize,
        /// Greatest value allowed.
        depth_max: usize,
    },
    /// A return in the main program.
    #[error("{label} {keyword} outside a subroutine")]
    NoSubroutine {
        /// The label.
        label: String,
        /// What stands there.
        keyword: String,
    },
}

/// ": did you mean endif?"
fn named_word_hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map_or_else(String::new, |word| format!(": did you mean {word}?"))
}
