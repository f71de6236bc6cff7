//! Every message about a program, grouped by subject. Those of subjects with many are in files of their own beside this one.
//!
//! In:  from every step of the interpretation, with the values that break a rule.
//! Out: one line each: what is wrong, the rule, and the remedy if there is one.

use super::{ArcError, CycleError, ProbeError, SplineError, ThreadError, TurningError};

/// What is wrong; `Display` tells rule and remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ErrorKind {
    /// More octets in a line than the language allows.
    #[error("line of {length} characters: at most {max} are allowed")]
    LineTooLong {
        /// Octets of the line.
        length: usize,
        /// Greatest value allowed.
        max: usize,
    },
    /// A character that has no meaning outside comments.
    #[error("character {0:?} is not allowed here: {hint}", hint = character_hint(*.0))]
    BadCharacter(char),
    /// `(` within `( )`.
    #[error("a comment stands inside a comment: close the first one before this (")]
    NestedComment,
    /// `(` without `)`.
    #[error("comment without end: ) is missing on this line")]
    UnclosedComment,
    /// `)` without `(`.
    #[error(") without ( before it")]
    StrayParenthesis,
    /// `/` not at the start of the line.
    #[error("/ (block delete) must be the first character of a line")]
    MisplacedSlash,
    /// `N` not at the start of the line.
    #[error("N must come before all other words of a line, once")]
    MisplacedLineNumber,
    /// Beyond any machine.
    #[error("number of {letter} is too large: at most {max}")]
    NumberTooLarge {
        /// Letter of the word.
        letter: char,
        /// Greatest value allowed.
        max: f64,
    },
    /// Nothing that has a value behind a letter, sign or operator.
    #[error("{after} needs a number, #parameter, function or [expression] behind it")]
    ValueMissing {
        /// What stands before the place, in upper case.
        after: String,
    },
    /// A decimal point alone.
    #[error("a number needs at least one digit")]
    DigitMissing,
    /// Two decimal points in a number.
    #[error("a number has one decimal point at most")]
    SecondPoint,
    /// `[` without `]`.
    #[error("[ without ]: the expression does not end on this line")]
    BracketNotClosed,
    /// Something that is no operator behind a value in brackets.
    #[error(
        "{found:?} is no operator: an expression goes on with + - * / ** MOD EQ NE GT GE LT LE AND OR XOR or ends with ]{}",
        hint(*.nearest)
    )]
    UnknownOperator {
        /// What stands there.
        found: String,
        /// Operator that was probably meant.
        nearest: Option<&'static str>,
    },
    /// No such function.
    #[error(
        "{name} is no function: there are ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT TAN{}",
        hint(*.nearest)
    )]
    UnknownFunction {
        /// Name as written, capitals.
        name: String,
        /// Function that was probably meant.
        nearest: Option<&'static str>,
    },
    /// A function without `[`.
    #[error("{function} needs its argument in brackets: {function}[...]")]
    FunctionBracketMissing {
        /// The function.
        function: &'static str,
    },
    /// ATAN with one argument.
    #[error("ATAN needs two arguments: ATAN[y]/[x]")]
    AtanSlashMissing,
    /// EXISTS of something else than one parameter.
    #[error("EXISTS asks for one parameter: EXISTS[#<name>] or EXISTS[#5]")]
    ExistsNeedsParameter,
    /// Division by zero.
    #[error("{operator} divides by zero here")]
    DivideByZero {
        /// `/`, `MOD` or `**`
        operator: &'static str,
    },
    /// A root of a negative number.
    #[error("{base} ** {exponent}: a power of a negative number needs an integer as exponent")]
    PowerOfNegative {
        /// Left of `**`.
        base: f64,
        /// Right of `**`.
        exponent: f64,
    },
    /// An argument that a function has no value for.
    #[error("{function}[{argument}] has no value: the argument must be {rule}")]
    FunctionArgument {
        /// The function.
        function: &'static str,
        /// The argument that came.
        argument: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// Beyond what a number can hold.
    #[error("the result of {operation} is too large for a number")]
    ResultTooLarge {
        /// Operator or function.
        operation: &'static str,
    },
    /// `<` without `>`.
    #[error("< without >: the name does not end on this line")]
    NameNotClosed,
    /// A parameter by a number with a fraction.
    #[error("#{value} is no parameter: its number must be an integer")]
    ParameterIndexNotInteger {
        /// The number that came.
        value: f64,
    },
    /// A parameter by a number that no parameter has.
    #[error("#{index} is no parameter: they are numbered from 1 to {max}")]
    ParameterIndexRange {
        /// The number that came.
        index: f64,
        /// Greatest value allowed.
        max: u32,
    },
    /// A parameter that may not be read in the present state.
    #[error("#{index} (current position) cannot be read while cutter compensation is on: write G40 first")]
    ParameterHidden {
        /// Number of the parameter.
        index: u32,
    },
    /// A named parameter that nothing was assigned to.
    #[error("#<{name}> {}", undefined(.name, .nearest))]
    ParameterUndefined {
        /// Its name.
        name: String,
        /// Defined name that was probably meant.
        nearest: Option<String>,
    },
    /// `#1` alone.
    #[error("a parameter at this place needs = and a value: #1 = 5")]
    AssignmentMissing,
    /// A number that must not be negative.
    #[error("{letter}{value} is negative: it must be 0 or more")]
    Negative {
        /// Letter of the word.
        letter: char,
        /// Number of the word as programmed.
        value: f64,
    },
    /// A number that must be an integer.
    #[error("{letter}{value} is not an integer")]
    NotInteger {
        /// Letter of the word.
        letter: char,
        /// Number of the word as programmed.
        value: f64,
    },
    /// The same letter twice.
    #[error("{letter} appears twice on this line: once is allowed")]
    RepeatedLetter {
        /// Letter of the word.
        letter: char,
    },
    /// More M words on a line than LinuxCNC takes.
    #[error("more than {max} M codes on this line: move some to a line of their own")]
    TooManyMCodes {
        /// Most M words on a line.
        max: usize,
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
    /// `$-1` where one spindle is meant.
    #[error("${number} names all spindles, but this code is for one: write its number")]
    SpindleOfAll {
        /// The number that came.
        number: f64,
    },
    /// G96 without the speed of the surface.
    #[error("G96 needs S, the speed of the surface, on its line")]
    SurfaceSpeedMissing,
    /// M62 to M65, M67 or M68 without the output.
    #[error("the number of the output is missing: write {letter} with it")]
    OutputMissing {
        /// P of M62 to M65, E of M67 and M68.
        letter: char,
    },
    /// A number that no input or output has.
    #[error("{letter}{value} is no input or output: they are numbered from 0 to {max}")]
    PinNumber {
        /// P or E.
        letter: char,
        /// The number that came.
        value: f64,
        /// Greatest value allowed.
        max: u8,
    },
    /// M66 without an input.
    #[error("M66 needs the input it looks at: P with the number of a digital or E with that of an analog one")]
    InputMissing,
    /// M66 with P and E.
    #[error("M66 looks at one input: P (digital) or E (analog), not both")]
    TwoInputs,
    /// L of M66.
    #[error("L{value} is no way of M66 to wait: 0 not at all, 1 rise, 2 fall, 3 on, 4 off")]
    WaitMode {
        /// The number that came.
        value: f64,
    },
    /// M66 E with L.
    #[error("L{value} waits for an edge or level, which an analog input has not: leave L away, or write L0")]
    AnalogWait {
        /// Number of L.
        value: f64,
    },
    /// M66 L without a time.
    #[error("M66 with L{value} waits and needs Q, the longest time in seconds: above 0")]
    WaitTime {
        /// Number of L.
        value: f64,
    },
    /// M72 without M70.
    #[error(
        "nothing is saved on this level of calls: M70 or M73 has to come before M72 in the same subroutine or program"
    )]
    NothingSaved,
    /// M19 with an angle beyond a turn.
    #[error("R{degrees} is no angle of M19: from 0 to 360 degrees")]
    OrientAngle {
        /// Angle as programmed, degrees.
        degrees: f64,
    },
    /// G95 with a spindle that has no speed.
    #[error("{motion} in G95 feeds per turn of spindle {spindle}, whose speed is 0: set S")]
    FeedWithoutTurns {
        /// Motion code as programmed.
        motion: String,
        /// Number of the spindle.
        spindle: u8,
    },
    /// No such G code.
    #[error("G{number} {}", unknown_code("G", nearest, *elsewhere))]
    UnknownG {
        /// Number as programmed.
        number: f64,
        /// Code that was probably meant; none that moves.
        nearest: Option<String>,
        /// What it is on other controls, and what to write here.
        elsewhere: Option<&'static str>,
    },
    /// No such M code.
    #[error("M{number} {}", unknown_code("M", nearest, *elsewhere))]
    UnknownM {
        /// Number as programmed.
        number: f64,
        /// Code that was probably meant; none that turns the spindle.
        nearest: Option<String>,
        /// What it is on other controls, and what to write here.
        elsewhere: Option<&'static str>,
    },
    /// Letters without numbers.
    #[error(
        "these are no words of G-code, each of which is a letter and a number: a comment stands in ( ) or behind ;"
    )]
    NoWords,
    /// The line, and so the text, is for something else.
    #[error("{0}")]
    OtherLanguage(crate::Language),
    /// A number as programs for a computer write it.
    #[error("{written} is no number here, as there is no exponent: write {plain}")]
    Exponent {
        /// As it stands there.
        written: String,
        /// The same without exponent.
        plain: String,
    },
    /// Two codes of one modal group.
    #[error("{first} and {second} are both of the modal group \"{group}\": one of them a line")]
    ModalConflict {
        /// The one that came first.
        first: String,
        /// The one at the place of the error.
        second: String,
        /// Name of the group.
        group: &'static str,
    },
    /// A word that nothing on its line uses.
    #[error("{letter} is used by no code on this line: it belongs to {users}")]
    UnusedWord {
        /// Letter of the word.
        letter: char,
        /// Codes that would use it.
        users: &'static str,
    },
    /// Axis words and nothing that moves.
    #[error("{letter} needs a motion code: none is active (G0, G1, ...)")]
    NoMotion {
        /// First axis letter of the line.
        letter: char,
    },
    /// Axis words with G80.
    #[error("G80 ends motion, so {letter} has no use on its line: write G0 or G1")]
    AxisWordWithG80 {
        /// First axis letter of the line.
        letter: char,
    },
    /// G28 or G30 with a motion code.
    #[error("{non_modal} and {motion} would both use the axis words: put them on two lines")]
    AxisConflict {
        /// G28 or G30.
        non_modal: String,
        /// Motion code.
        motion: String,
    },
    /// A feed move without feed.
    #[error("{motion} needs a feed: {hint}", hint = feed_hint(*.cleared, *.zero_line))]
    FeedMissing {
        /// Motion code.
        motion: String,
        /// Whether a feed was set once and then cleared.
        cleared: bool,
        /// The line that set it to 0, if one did.
        zero_line: Option<u32>,
    },
    /// A feed move in G93 without F.
    #[error("{motion} in inverse time mode (G93) needs F on its own line")]
    InverseTimeFeedMissing {
        /// Motion code.
        motion: String,
    },
    /// F0 in G93.
    #[error(
        "{motion} in inverse time mode (G93) would never end with F0: F is moves of this length a minute, so F2 takes half a minute"
    )]
    InverseTimeFeedZero {
        /// Motion code.
        motion: String,
    },
    /// A code of the user that the machine does not have.
    #[error("M{number} has no program: put an executable file M{number} into the folder of user codes")]
    NoSuchUserCode {
        /// 100 to 199.
        number: u8,
    },
    /// M19 with nothing to do.
    #[error("M19 without an angle orients nothing: expected R, 0 to 360 degrees")]
    OrientNothing,
    /// A code of the user that failed.
    #[error("M{number}: {reason}")]
    UserCodeFailed {
        /// 100 to 199.
        number: u8,
        /// Why, as the machine says.
        reason: String,
    },
    /// It ends a program or calls one.
    #[error("expected modes only, no end of a program and no call of another one")]
    StartupFlow,
    /// The code that the machine file has before every program.
    #[error("startup_code of the machine file, \"{line}\": {reason}")]
    StartupCode {
        /// The line of it.
        line: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An assignment to a parameter that only tells something.
    #[error("#{name} is read-only: the control sets it")]
    ReadOnlyParameter {
        /// Number, or name with its < >.
        name: String,
    },
    /// A code without the axis words it needs.
    #[error("{code} needs at least one axis word")]
    AxisMissing {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// M98 without P.
    #[error("M98 needs P, the number of the program to call")]
    ProgramNumberMissing,
    /// `$` beyond the spindles of the machine.
    #[error("${number} is no spindle: they are numbered from 0 to {last}, and $-1 names all")]
    NoSuchSpindle {
        /// The number that came.
        number: f64,
        /// Greatest value allowed.
        last: u8,
    },
    /// P of M19.
    #[error("P of M19 is the way to the angle: 0 the shortest, 1 clockwise, 2 counter-clockwise")]
    OrientDirection,
    /// Q of M19.
    #[error("Q of M19 is the longest time to wait in seconds: above 0")]
    OrientTimeout,
    /// A tool that is not in the table.
    #[error("tool {number} is not in the tool table: add it there, or call one that is{}", lathe_tool_hint(*.number, *.lathe))]
    NoSuchTool {
        /// Number of the word as programmed.
        number: f64,
        /// Its tool, which there is, and its offset, if it is one of other lathes.
        lathe: Option<[u32; 2]>,
    },
    /// M61 without Q.
    #[error("M61 needs Q, the number of the tool in the spindle")]
    ToolNumberMissing,
    /// G43.4 on a machine that cannot.
    #[error(
        "G43.4 needs a machine with tool-centre-point control (kinematics \"table-table\" or \"head-table\"): write G43 for the length alone"
    )]
    NoToolCentrePoint,
    /// A tool with an offset across under G43.4.
    #[error("the tool of G43.4 may have a length in Z only, but its offset in {letter} is {value}")]
    OffsetUnderToolCentrePoint {
        /// Letter of the axis.
        letter: char,
        /// Offset, mm or degrees.
        value: f64,
    },
    /// Machine coordinates under G43.4.
    #[error("{code} goes to a place of the machine's joints, which axes do not name under G43.4: write G49 before it")]
    MachineUnderToolCentrePoint {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// G43.2 with H and axis words.
    #[error("G43.2 adds the offset of a tool (H) or what the axis words say, not both: write two lines")]
    AddedOffsetTwice,
    /// G43.2 with nothing to add.
    #[error("G43.2 needs what it adds: H with a tool number, or axis words")]
    AddedOffsetMissing,
    /// G10 L0 with a tool in the spindle.
    #[error(
        "the tool table can only be read again with an empty spindle, but tool {tool} is in it: write T0 M6 before G10 L0"
    )]
    ReloadWithTool {
        /// The tool in the spindle.
        tool: u32,
    },
    /// G10 without L.
    #[error(
        "G10 needs L to tell what is set: L1, L10 or L11 a tool, L2 or L20 a work system, L0 reads the tool table again"
    )]
    SetDataMissing,
    /// L of G10.
    #[error(
        "L{value} is no use of G10: L1, L10 and L11 set a tool, L2 and L20 a work system, L0 reads the tool table again"
    )]
    SetData {
        /// The number that came.
        value: f64,
    },
    /// G10 L1, L10 or L11 without P.
    #[error("{code} needs P, the number of the tool to set")]
    ToolToSetMissing {
        /// G10 with its L.
        code: &'static str,
    },
    /// P of G10 L1, L10, L11.
    #[error("P{number} of {code} is the number of a tool: 1 or more")]
    ToolToSetRange {
        /// G10 with its L.
        code: &'static str,
        /// The number that came.
        number: f64,
    },
    /// G10 L1, L10 or L11 with nothing to set.
    #[error("{code} sets nothing on this line: write axis words, R (radius), I, J (angles) or Q (orientation)")]
    ToolValuesMissing {
        /// G10 with its L.
        code: &'static str,
    },
    /// What the tool table cannot hold.
    #[error("{0}")]
    ToolNotSet(crate::SetToolError),
    /// G10 L2 or L20 without P.
    #[error("{code} needs P, the work system: 1 for G54 to 9 for G59.3, 0 for the active one")]
    SystemMissing {
        /// G10 with its L.
        code: &'static str,
    },
    /// P of G10 L2, L20.
    #[error("P{value} of {code} is no work system: 1 is G54, 9 is G59.3, 0 the active one")]
    System {
        /// G10 with its L.
        code: &'static str,
        /// The number that came.
        value: f64,
    },
    /// R of G10 L20.
    #[error("G10 L20 has no R: a rotation is set by G10 L2")]
    RotationByPlace,
    /// I or J of G10 L2, L20.
    #[error("{code} has no {letter}: I and J are the angles of a tool, set by G10 L1")]
    AngleOfSystem {
        /// G10 with its L.
        code: &'static str,
        /// I or J.
        letter: char,
    },
    /// `@` or `^` where nothing moves.
    #[error("polar coordinates (@, ^) are for motion only: write X and Y with {code}")]
    PolarWithoutMotion {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// `@` or `^` with X or Y.
    #[error("{letter} and polar coordinates (@, ^) would both tell X and Y: write one of them")]
    PolarMixed {
        /// X or Y.
        letter: char,
    },
    /// `@` or `^` with G53.
    #[error("G53 takes no polar coordinates (@, ^): write X and Y")]
    PolarInMachineCoordinates,
    /// `@` alone where there is no direction.
    #[error("a polar distance (@) from the origin needs an angle (^): the current point is the origin of X and Y")]
    PolarAngleMissing,
    /// A turn or more on an axis that has no ends.
    #[error(
        "{letter}{value} is no place on a rotary axis without ends: from 0 to less than 360, a minus sign turns backwards to it; \
         for whole turns write G91"
    )]
    WrappedRotary {
        /// Letter of the axis.
        letter: char,
        /// The number that came.
        value: f64,
    },
    /// Incremental polar coordinates where there is no direction.
    #[error("incremental polar coordinates need a direction: the current point is the origin of X and Y")]
    PolarAtOrigin,
    /// `(ABORT, text)`.
    #[error("the program gives up: {}", .text.trim_start())]
    Aborted {
        /// Its own words.
        text: String,
    },
    /// `(PY, text)`.
    #[error("comments with Python are not run: use O-words and parameters")]
    PythonComment,
    /// G41.1 or G42.1 without D.
    #[error("{code} needs D, the diameter of the tool")]
    DiameterMissing {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// The orientation of a lathe tool.
    #[error("{letter}{value} is no cutting-edge orientation: an integer from 0 to 9")]
    Orientation {
        /// L of G41.1 and G42.1, Q of G10.
        letter: char,
        /// The number that came.
        value: f64,
    },
    /// A turning tool, or L, outside the plane in which one turns.
    #[error(
        "{code} with a turning tool works in the ZX plane only: write G18 before it, or give the tool orientation 0 (a mill)"
    )]
    TurningToolPlane {
        /// The code as programmed, such as `G83`.
        code: String,
    },
    /// The path of the tool's centre cannot be made.
    #[error("{0}")]
    Compensation(motion::compensation::CompensationErrorKind),
    /// What is wrong with an arc.
    #[error("{0}")]
    Arc(#[from] ArcError),
    /// What is wrong with a canned cycle.
    #[error("{0}")]
    Cycle(#[from] CycleError),
    /// What is wrong with a thread.
    #[error("{0}")]
    Thread(#[from] ThreadError),
    /// A curve.
    #[error("{0}")]
    Spline(#[from] SplineError),
    /// A cycle along a profile.
    #[error("{0}")]
    Turning(#[from] TurningError),
    /// A probing move.
    #[error("{0}")]
    Probe(#[from] ProbeError),
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
    /// A start at a line that is not run.
    #[error("line {line} is never run: it lies behind the end of the program or in a block that is passed over")]
    LineNotRun {
        /// The line.
        line: u32,
    },
    /// A start while cutter compensation is on.
    #[error("the program cannot start at line {line}, as cutter compensation is on there: start before its G41 or G42")]
    StartUnderCompensation {
        /// The line.
        line: u32,
    },
    /// A start between G5.2 and G5.3.
    #[error("the program cannot start at line {line}, in the middle of a NURBS: start at its G5.2")]
    StartInNurbs {
        /// The line.
        line: u32,
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
    /// The file cannot be read.
    #[error("the file cannot be read: {reason}")]
    NotReadable {
        /// What the system says.
        reason: String,
    },
    /// Octets of 0.
    #[error("this is no text: it has octets of 0, which no program has; is it a binary file?")]
    Binary,
    /// What the machine cannot do, in words.
    #[error("{0}")]
    Machine(String),
    /// A check was stopped.
    #[error(
        "the program was still running after {steps} lines: a loop that never ends? A greater budget checks more of it"
    )]
    TooManySteps {
        /// Lines that were run.
        steps: u64,
    },
    /// A check was stopped.
    #[error("{steps} lines were run one after the other without a move, a dwell or a stop: a loop that never ends?")]
    TooManyIdleSteps {
        /// Lines that were run.
        steps: u64,
    },
    /// A check was stopped.
    #[error(
        "the program has been run for {seconds} s up to here, and has not come to its end: a loop that never ends?"
    )]
    OutOfTime {
        /// The time that it may take.
        seconds: u64,
    },
    /// Whoever wanted the program does not want it any more.
    #[error("given up here, before the end of the program")]
    Cancelled,
    /// G53 with anything but G0 and G1.
    #[error("G53 needs a G0 or G1 move on its line")]
    MachineCoordinatesNeedStraight,
    /// G53 in G91.
    #[error("G53 names a machine position, which G91 (incremental) cannot: write G90")]
    MachineCoordinatesIncremental,
    /// G64 and M19 with R.
    #[error("R could be that of G64 (planner) or of M19 (angle): put them on two lines")]
    PlannerWithOrient,
    /// G4 and an arc on one line.
    #[error("G4 and {motion} would both use P: put them on two lines")]
    DwellWithArc {
        /// G2 or G3.
        motion: String,
    },
    /// P of a wait.
    #[error("P is seconds, and would wait for {days:.0} days: no more than a year is allowed")]
    DwellTooLong {
        /// How long it would be.
        days: f64,
    },
    /// G4 without P.
    #[error("G4 needs P, the seconds to wait")]
    DwellMissing,
    /// The text ends too early.
    #[error("the program ends without M2 or M30: write one as its last line")]
    ProgramEndMissing,
    /// The text began with % and ends without.
    #[error("the program ends without M2, M30 or the % that belongs to the % at its start")]
    PercentMissing,
    /// The text cannot be told by [`motion::canon::Source`].
    #[error("the program is longer than 4 GiB: split it")]
    ProgramTooLong,
}

/// What there is to say of a code that there is not.
fn unknown_code(letter: &str, nearest: &Option<String>, elsewhere: Option<&'static str>) -> String {
    match (elsewhere, nearest) {
        (Some(elsewhere), _) => format!("is no code of this control but {elsewhere}"),
        (None, Some(nearest)) => format!("is no known {letter} code: did you mean {nearest}?"),
        (None, None) => format!("is no known {letter} code"),
    }
}

/// T0101 names tool and offset on most lathes.
fn lathe_tool_hint(number: f64, lathe: Option<[u32; 2]>) -> String {
    lathe.map_or_else(String::new, |[tool, offset]| {
        format!("; if T{number:04} is tool {tool} with offset {offset}, as on other lathes, write T{tool} M6 and G43 H{offset}")
    })
}

/// ": did you mean endif?"
fn named_word_hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map_or_else(String::new, |word| format!(": did you mean {word}?"))
}

fn feed_hint(cleared: bool, zero_line: Option<u32>) -> String {
    match (zero_line, cleared) {
        (Some(line), _) => format!("F is 0 since line {line}"),
        (None, true) => "F is not set (G93, G94 clear it)".into(),
        (None, false) => "F is not set".into(),
    }
}

fn character_hint(character: char) -> &'static str {
    match character {
        '%' => "comments stand in ( ) or behind ; (% stands alone on the first and last line)",
        ',' => "a number has a decimal point, as in 1.5",
        '\u{a0}' | '\u{202f}' | '\u{2009}' => "it looks like a blank, as texts from a page have it: write a blank",
        '\u{2212}' | '\u{2013}' => "a minus sign is the - of the keyboard",
        _ => "comments stand in ( ) or behind ;",
    }
}

/// The probable meaning, behind a message.
fn hint(nearest: Option<&'static str>) -> String {
    nearest.map_or(String::new(), |nearest| format!("; did you mean {nearest}?"))
}

fn undefined(name: &str, nearest: &Option<String>) -> String {
    if name.starts_with("_hal[") {
        return "is not known: expected a pin that the control has, and for a check or a plan its value in program.pins of the \
                machine file"
            .into();
    }
    format!("is not defined: assign it before it is read{}", named_hint(nearest))
}

fn named_hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map_or(String::new(), |nearest| format!("; did you mean #<{nearest}>?"))
}
