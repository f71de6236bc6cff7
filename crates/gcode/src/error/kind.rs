//! Every message about a program, grouped by subject. Those of subjects with many are in files of their own beside this one.
//!
//! In:  from every step of the interpretation, with the values that break a rule.
//! Out: one line each: what is wrong, the rule, and the remedy if there is one.

use super::{
    ArcError, CycleError, ExpressionError, OWordError, ProbeError, SetDataError, SplineError, ThreadError, TurningError,
};

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
    /// A code without the axis words it needs.
    #[error("{code} needs at least one axis word")]
    AxisMissing {
        /// The code as programmed, such as `G83`.
        code: String,
    },
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
    Compensation(::compensation::CompensationErrorKind),
    /// A value, an expression or a parameter.
    #[error("{0}")]
    Expression(#[from] ExpressionError),
    /// An O-word, a subroutine or its call.
    #[error("{0}")]
    OWord(#[from] OWordError),
    /// G10.
    #[error("{0}")]
    SetData(#[from] SetDataError),
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
