//! Every message about a program, with its cure where there is one.

/// What is wrong, or may not be meant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "each says what it is in words")]
pub enum Kind {
    // Text
    #[error("a program has at most {most} octets")]
    TooLong { most: usize },
    #[error("{0:?} is nothing in Structured Text")]
    Character(char),
    #[error("the comment is not closed: {0} is missing")]
    CommentOpen(&'static str),
    #[error("the text is not closed: ' is missing in its line")]
    StringOpen,
    #[error("${0} is none of $$ $' $N $L $P $R $T or two hexadecimal digits")]
    StringEscape(String),
    #[error("the pragma is not closed: }} is missing")]
    PragmaOpen,
    #[error("the pragma has no effect")]
    PragmaSkipped,
    #[error("{0} is no number: {1}")]
    Number(String, &'static str),
    #[error("{0} is no duration: {1}")]
    Duration(String, &'static str),
    #[error("{0} is no address: it is %, one of I Q M, one of X B W D L or none, and numbers with points between them")]
    Address(String),
    #[error("{0}: the standard has no name with two _ in a row or one at its end")]
    Underscores(String),

    // Structure
    #[error("{wanted} is expected here, not {got}")]
    Expected { wanted: String, got: String },
    #[error("; is missing behind {0}")]
    SemicolonMissing(&'static str),
    #[error("= compares: write := to assign")]
    EqualAssigns,
    #[error("nested deeper than {most}")]
    TooDeep { most: usize },
    #[error("{0} is not supported")]
    Unsupported(String),
    #[error("this has no effect: all programs run in the order of the file, once a scan")]
    ConfigurationIgnored,
    #[error("task {name}: INTERVAL {interval}; the period is set where the file is run")]
    TaskRead { name: String, interval: String },
    #[error("there is no PROGRAM in the file")]
    NoProgram,

    // Names
    #[error("{name} is not declared{}", hint(nearest))]
    Undeclared { name: String, nearest: Option<String> },
    #[error("{name} is no type{}", hint(nearest))]
    NoType { name: String, nearest: Option<String> },
    #[error("{name} is already declared")]
    Twice { name: String },
    #[error("{name} is a word of the language")]
    Keyword { name: String },
    #[error("{name} has no {member}{}", hint(nearest))]
    NoMember {
        name: String,
        member: String,
        nearest: Option<String>,
    },
    #[error("{member} of {name} is not visible from outside")]
    Hidden { name: String, member: String },
    #[error("{name} contains itself")]
    Recursive { name: String },
    #[error("{value} belongs to several enumerations: write {example}#{value}")]
    Ambiguous { value: String, example: String },
    #[error("{name} has its value of the start where it is declared, in VAR_GLOBAL")]
    ExternalInitial { name: String },
    #[error("the type of {name} is {wanted} where it is declared")]
    ExternalType { name: String, wanted: String },
    #[error("{name} is at {address}, as another variable is")]
    AddressTwice { name: String, address: String },
    #[error("{address} holds {bits} bits, a {ty} does not")]
    AddressWidth { address: String, bits: u32, ty: String },
    #[error("{section} does not belong into a {unit}")]
    Section { section: &'static str, unit: &'static str },
    #[error("a function sees constants only of VAR_GLOBAL: {name} may be given as an input")]
    GlobalInFunction { name: String },
    #[error("an address belongs to a variable of a program or to VAR_GLOBAL, of an elementary type")]
    AddressPlace,
    #[error("a function keeps nothing, so it has no function block and no address: {name}")]
    StateInFunction { name: String },
    #[error("the result of a function is an elementary type or an enumeration")]
    ResultType,
    #[error("bounds of an array are from -2147483648 to 2147483647, the lower one first")]
    Bounds,
    #[error("a STRING holds 1 to 65535 characters")]
    TextLength,
    #[error("the texts, cut to the lengths of all STRING[n], have more than {most} octets")]
    Texts { most: usize },
    #[error("the variables need more memory than {most} values")]
    Memory { most: usize },
    #[error("the program is too long: more than {most} instructions")]
    Code { most: usize },
    #[error("a constant is needed here")]
    Constant,
    #[error("a constant needs a value: write :=")]
    ConstantWithoutValue,
    #[error("{got} values for {wanted}")]
    InitialCount { wanted: usize, got: usize },
    #[error("this is no value of {0}")]
    InitialShape(String),

    // Types
    #[error("{from} does not become {to} by itself{}", cure(cure_text))]
    Mismatch {
        from: String,
        to: String,
        cure_text: Option<String>,
    },
    #[error("{value} is no BOOL: write {word}")]
    NumberForBool { value: String, word: &'static str },
    #[error("{value} is out of the range of {ty}: {low} to {high}")]
    OutOfRange {
        value: String,
        ty: &'static str,
        low: String,
        high: String,
    },
    #[error("{operator} does not take {ty}{}", cure(cure_text))]
    Operand {
        operator: String,
        ty: String,
        cure_text: Option<String>,
    },
    #[error("{operator} does not take {left} and {right} together{}", cure(cure_text))]
    Operands {
        operator: String,
        left: String,
        right: String,
        cure_text: Option<String>,
    },
    #[error("{ty} has no elements")]
    NoArray { ty: String },
    #[error("{ty} has {wanted} dimensions, not {got}")]
    Dimensions { ty: String, wanted: usize, got: usize },
    #[error("{value} is out of the array: {low} to {high}")]
    Index { value: String, low: i32, high: i32 },
    #[error("{ty} has no members")]
    NoStruct { ty: String },
    #[error("{name} is a {ty} as a whole, and a single value is needed here")]
    Whole { name: String, ty: String },
    #[error("division by zero")]
    DivisionByZero,
    #[error("TRUE or FALSE are not selected here: write IF")]
    CaseType,
    #[error("{value} is already selected above")]
    LabelTwice { value: String },
    #[error("a range begins with its lower value")]
    LabelRange,
    #[error("the step of a loop is not 0")]
    StepZero,
    #[error("the control variable of FOR is an integer variable of its own, no element and no member")]
    ControlVariable,
    #[error("{name} counts the loop, and is not assigned inside")]
    ControlAssigned { name: String },
    #[error("{0} stands in a loop only")]
    OutsideLoop(&'static str),

    // Calls and assignments
    #[error("{name} is {what}, and is not assigned here")]
    ReadOnly { name: String, what: &'static str },
    #[error("{name} is {what}, and is not called here: what the call keeps would be lost; VAR_IN_OUT hands it over")]
    CalledCopy { name: String, what: &'static str },
    #[error("{name} is a function block: declare an instance of it, VAR x : {name}; END_VAR, and call that")]
    BlockAsFunction { name: String },
    #[error("{name} is a program: it runs by itself, once a scan")]
    ProgramCalled { name: String },
    #[error("{name} is a function: its result is used, x := {name}(..)")]
    FunctionAsStatement { name: String },
    #[error("{name} is no function{}", hint(nearest))]
    NoFunction { name: String, nearest: Option<String> },
    #[error("{name} is no instance of a function block, and cannot be called")]
    NoBlock { name: String },
    #[error("a block is called as a statement; its outputs are read as {name}.Q")]
    BlockInExpression { name: String },
    #[error("{name} takes {wanted}, not {got}")]
    ArgumentCount { name: String, wanted: String, got: usize },
    #[error("{name} has no {direction} {argument}{}", hint(nearest))]
    NoArgument {
        name: String,
        argument: String,
        direction: &'static str,
        nearest: Option<String>,
    },
    #[error("{argument} is given twice")]
    ArgumentTwice { argument: String },
    #[error("{argument} of {name} is missing")]
    ArgumentMissing { name: String, argument: String },
    #[error("arguments are given all by name or all by place")]
    ArgumentsMixed,
    #[error("inputs of a block are given by name: {name}({first} := ..)")]
    ArgumentsByPlace { name: String, first: String },
    #[error("{argument} is VAR_IN_OUT: it takes a variable that may be assigned")]
    InOut { argument: String },

    // Not meant
    #[error("{name} is assigned twice; the last value counts")]
    AssignedTwice { name: String },
    #[error("{name} is altered in the loop, whose TO and BY hold as they were before the first iteration")]
    LimitAltered { name: String },
    #[error("the text is longer than {ty}, and is cut to its first {length} characters")]
    TextCut { ty: String, length: u32 },
    #[error("ELSE is never reached: every value is selected above")]
    ElseUnreachable,
    #[error("this branch is never reached: the condition above is TRUE")]
    BranchUnreachable,
    #[error("two {ty} are hardly ever equal: compare their difference with a tolerance")]
    RealEqual { ty: &'static str },
    #[error("this is worked out as {ty}, and becomes wider behind it: write {name}(..) of each value")]
    NarrowConversion { name: String, ty: &'static str },
    #[error("- is stronger than **: this is (-a) ** b")]
    MinusPower,
    #[error("F_TRIG gives no pulse in its first call; some controls do")]
    FirstFallingEdge,
}

fn hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map_or_else(String::new, |name| format!(": is {name} meant?"))
}

fn cure(text: &Option<String>) -> String {
    text.as_ref().map_or_else(String::new, |text| format!(": {text}"))
}

/// Which of some known names was probably meant: few changes, whatever the case.
pub(crate) fn nearest<'k>(name: &str, known: impl IntoIterator<Item = &'k str>) -> Option<String> {
    let name = name.to_ascii_uppercase();
    let most = if name.chars().count() <= 4 { 1 } else { 2 };
    known
        .into_iter()
        .map(|known| (strsim::osa_distance(&name, &known.to_ascii_uppercase()), known))
        .filter(|(distance, known)| *distance <= most && *distance < known.chars().count())
        .min()
        .map(|(_, known)| known.to_owned())
}
