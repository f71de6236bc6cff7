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

    #[error(
        "this is XML, of another tool: its program stands in CDATA or comes from its export as text, and goes into a file of its own"
    )]
    Xml,
    #[error("{wrong} is no operator: write {right}")]
    Foreign { wrong: &'static str, right: &'static str },

    // Structure
    #[error("{wanted} is expected here, not {got}")]
    Expected { wanted: String, got: String },
    #[error("; is missing behind {0}")]
    SemicolonMissing(&'static str),
    #[error("{0} is one word, ELSIF")]
    ElseIfWord(String),
    #[error("this IF has no END_IF of its own: ELSIF in one word goes on with the IF above")]
    ElseIf,
    #[error("= compares: write := to assign")]
    EqualAssigns,
    #[error("nested deeper than {most}")]
    TooDeep { most: usize },
    #[error("{0} is not supported")]
    Unsupported(String),
    #[error("{word} is not supported ({what})")]
    UnsupportedOf { word: String, what: &'static str },
    #[error("bits of words are not supported: write (SHR({name}, {bit}) AND 1) <> 0")]
    BitRead { name: String, bit: i128 },
    #[error("bits of words are not supported: write {name} := {name} OR {mask}, or {name} AND NOT {mask}")]
    BitWritten { name: String, mask: String },
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
    #[error("a value of an enumeration stands behind #: write {name}#{value}")]
    EnumerationPoint { name: String, value: String },
    #[error("{value} is the variable {variable} here, for names are read without their case: write {name}#{value}")]
    ValueHidden {
        value: String,
        variable: String,
        name: String,
    },
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
    #[error("R_EDGE and F_EDGE belong to inputs of type BOOL of a FUNCTION_BLOCK or PROGRAM")]
    EdgePlace,
    #[error("{name} is no variable AT {address} of a program")]
    NotToBePlaced { name: String, address: String },
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
    #[error("the variables need {needed} values, and there is room for {most}")]
    Memory { needed: usize, most: usize },
    #[error("types and variables lay out more than {most} values")]
    Layout { most: usize },
    #[error("the names of all elements and members have more than {most} octets")]
    Names { most: usize },
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
    #[error("{value} is no BOOL: these are 0 and 1, FALSE and TRUE")]
    NumberForBool { value: String },
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
    #[error("the control variable of FOR is an integer variable, no element, no member and no VAR_IN_OUT")]
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
    let most = if name.len() <= 4 { 1 } else { CHANGES_MAX };
    known
        .into_iter()
        .filter_map(|known| Some((changes(name.as_bytes(), known.as_bytes(), most)?, known)))
        .filter(|(changes, known)| *changes < known.len())
        .min()
        .map(|(_, known)| known.to_owned())
}

/// Changes that make one name of another one at most.
const CHANGES_MAX: usize = 2;

/// How many octets are put in, left out, replaced or exchanged with their neighbour to make one name of another one, whatever the
/// case; `None`: more than `most`. Its cost is that of the shorter name: only what `most` changes can reach is looked at.
fn changes(a: &[u8], b: &[u8], most: usize) -> Option<usize> {
    if a.len().abs_diff(b.len()) > most {
        return None;
    }
    let same = |(a, b): &(&u8, &u8)| a.eq_ignore_ascii_case(b);
    let begin = a.iter().zip(b).take_while(same).count();
    let (a, b) = (&a[begin..], &b[begin..]);
    let end = a.iter().rev().zip(b.iter().rev()).take_while(same).count();
    let (a, b) = (&a[..a.len() - end], &b[..b.len() - end]);
    // Column `place` of row i stands for j = i + place - most, of which the changes from a[..i] to b[..j] are counted.
    const WIDTH: usize = 2 * CHANGES_MAX + 1;
    const FAR: usize = usize::MAX / 2;
    let (mut last_but_one, mut last) = ([FAR; WIDTH], [FAR; WIDTH]);
    for (place, count) in (most..WIDTH).enumerate().map(|(count, place)| (place, count)) {
        last[place] = count;
    }
    for i in 1..=a.len() {
        let mut row = [FAR; WIDTH];
        for place in 0..=2 * most {
            let Some(j) = (i + place).checked_sub(most).filter(|j| *j <= b.len()) else {
                continue;
            };
            if j == 0 {
                row[place] = i;
                continue;
            }
            let replaced = last[place] + usize::from(!a[i - 1].eq_ignore_ascii_case(&b[j - 1]));
            let left_out = last.get(place + 1).map_or(FAR, |count| count + 1);
            let put_in = place.checked_sub(1).map_or(FAR, |place| row[place] + 1);
            let is_exchanged =
                i > 1 && j > 1 && a[i - 1].eq_ignore_ascii_case(&b[j - 2]) && a[i - 2].eq_ignore_ascii_case(&b[j - 1]);
            let exchanged = if is_exchanged { last_but_one[place] + 1 } else { FAR };
            row[place] = replaced.min(left_out).min(put_in).min(exchanged);
        }
        if row.iter().all(|count| *count > most) {
            return None;
        }
        (last_but_one, last) = (last, row);
    }
    let count = last[(b.len() + most) - a.len()];
    (count <= most).then_some(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The whole table, as it is written in books.
    fn all_changes(a: &[u8], b: &[u8]) -> usize {
        let mut table = vec![vec![0; b.len() + 1]; a.len() + 1];
        for i in 0..=a.len() {
            for j in 0..=b.len() {
                table[i][j] = if i == 0 || j == 0 {
                    i + j
                } else {
                    let replaced = table[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                    let mut least = replaced.min(table[i - 1][j] + 1).min(table[i][j - 1] + 1);
                    if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                        least = least.min(table[i - 2][j - 2] + 1);
                    }
                    least
                };
            }
        }
        table[a.len()][b.len()]
    }

    #[test]
    fn few_changes_are_counted_as_in_the_whole_table() {
        // All words of up to five letters of two.
        let words: Vec<Vec<u8>> = (0..6_u32)
            .flat_map(|length| {
                (0..1 << length).map(move |bits: u32| (0..length).map(|at| b'a' + (bits >> at & 1) as u8).collect())
            })
            .collect();
        for a in &words {
            for b in &words {
                for most in 1..=CHANGES_MAX {
                    let wanted = Some(all_changes(a, b)).filter(|count| *count <= most);
                    assert_eq!(changes(a, b, most), wanted, "{a:?} {b:?} {most}");
                }
            }
        }
        assert_eq!(nearest("levl", ["label", "LEVEL", "zebra"]), Some("LEVEL".into()));
        assert_eq!(nearest("ab", ["cd", "b"]), None);
    }
}
