//! Part program text to canonical calls.
//!
//! In:  the octets of a program in LinuxCNC's RS274/NGC dialect, and what the machine remembers ([`Settings`]).
//! Out: canonical calls ([`motion::canon`]) in the order in which they happen, or located errors ([`Error`]).
//!
//! A line goes through `scan` and `expression` (words with their values), `block` (one line, its modal groups) and `execute`
//! (state, calls); O-words through `control`. Lines are read when the calls of the one before are used up, so a text of any
//! length starts at once and takes constant memory. Knows no machine limits, no time and no bus: what a program asks of
//! the machine, a [`Machine`] answers. A code or construct that is not supported is an error, never skipped.
//!
//! ```
//! use motion::canon::{Call, Position};
//!
//! let text = b"G21 G90\nG1 X10 F600\nM2\n";
//! let mut run = gcode::Interpreter::new(gcode::Settings::default()).run(text);
//! let moved = run.find_map(|event| match event.unwrap().call {
//!     Call::StraightFeed { to } => Some(to),
//!     _ => None,
//! });
//! assert_eq!(moved, Some(Position::xyz(10.0, 0.0, 0.0)));
//!
//! let errors = gcode::check(b"G1 X10\nM2\n", gcode::Settings::default());
//! assert_eq!(errors[0].to_string(), "1:1: G1 needs a feed: F is not set");
//! ```
//!
//! # Where to read
//!
//! Values that are not known without running the program are NaN in a check of the syntax (`syntax::Unknown`); nothing else is
//! ever NaN.
//!
//! | to learn | file |
//! |---|---|
//! | how a line becomes words: octets, numbers, expressions computed while they are read | `text.rs`, `scan.rs`, `number.rs`, `expression/mod.rs` |
//! | which codes there are, and their modal groups | `code/mod.rs`; their numbers in `code/table.rs` |
//! | what a line contains, regardless of the state; which letter belongs to which code | `block.rs`; `execute/usage.rs` |
//! | the order in which a line is run | `execute/mod.rs`, the table of contents; one file per subject next to it |
//! | everything that lasts from line to line; where work coordinates lie | `state/mod.rs` |
//! | parameters; those that only show the state | `parameter/`; `state/predefined.rs` |
//! | subroutines, loops, conditions | `o_word.rs` (the line), `flow.rs` (what is under way), `interpreter/control.rs` and `interpreter/subroutine.rs` (what happens) |
//! | the run itself: one line after the other | `interpreter/mod.rs` |
//! | what is active at a block, and what a line of MDI leaves active for the next one | `modes.rs` |
//! | what it asks the machine: probe, inputs, tool | `machine.rs` |
//! | all errors of a text at once; a start in the middle | `syntax.rs`, `check.rs`; `resume.rs` |
//! | every message | `error/` |
//! | the printed form of LinuxCNC's interpreter; plain G-code back | `print/mod.rs`; `flat/mod.rs`, the table of calls, one file per subject next to it |
//!
//! LinuxCNC's own stand-alone interpreter is the oracle: `tests/corpus/` has one folder per case, `tests/differential.rs` compares
//! generated programs, and `tests/corpus/differences.toml` says where and why we differ from the packaged version.

#![warn(clippy::missing_errors_doc)]
#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, reason = "tests may use the PC's own functions")
)]

mod block;
mod check;
mod code;
mod comment;
mod degrees;
mod doubt;
mod error;
mod execute;
mod expression;
mod flat;
mod flow;
mod foreign;
mod interpreter;
mod lexer;
mod limits;
mod located;
mod machine;
mod modes;
mod near_miss;
mod number;
mod o_word;
mod octet;
mod operator;
pub mod parameter;
mod print;
#[cfg(test)]
mod printed;
mod remap;
mod resume;
mod scan;
mod settings;
mod state;
mod syntax;
mod text;
mod tool_table;

pub use check::{check, check_on, check_reader};
pub use doubt::{Doubt, DoubtKind, doubts};
pub use error::{
    ArcError, CallSite, CycleError, Error, ErrorKind, ExpressionError, OWordError, ProbeError, SetDataError,
    SplineError, ThreadError, TurningError,
};
pub use flat::{FlatError, FlatWriter, Unwritable};
pub use foreign::Language;
pub use interpreter::{Interpreter, ReadSeek, Run};
pub use lexer::{Lexer, Word, Words};
pub use limits::CheckLimits;
pub use located::Located;
pub use machine::{Machine, NoMachine, PinReader, Probed};
pub use modes::{InForce, Modes};
pub use print::CanonPrinter;
pub use resume::{Approach, Resume};
pub use scan::LINE_OCTETS_MAX;
pub use settings::{CompensatedPath, Remap, Settings, Splines, ToolChangePlace};
pub use tool_table::{
    POCKET_MAX, SetToolError, TOOLS_MAX, TableError, TableErrorKind, Tool, ToolChanger, ToolTable, Wear,
};
