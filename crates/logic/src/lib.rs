//! Structured Text (IEC 61131-3) to a bounded program.
//!
//! In:  the text of a file with PROGRAM, FUNCTION_BLOCK, FUNCTION and TYPE.
//! Out: a compiled program ([`Logic`]) whose longest scan is known in steps, or located errors ([`Diagnostic`]).
//!
//! `token` and `parse` read the text, `compile` checks names and types and makes instructions (`code`), [`Runtime`] runs them.
//! Memory is laid out when it is compiled, and calls are never recursive, so a scan allocates nothing. What goes wrong in a scan
//! (division by zero, an index) has a result and is told ([`Fault`]); the scan goes on to its end.
//!
//! ```
//! let text = "PROGRAM lamp
//!     VAR_INPUT button : BOOL; END_VAR
//!     VAR_OUTPUT light : BOOL; END_VAR
//!     VAR delay : TON; END_VAR
//!     delay(IN := button, PT := T#20ms);
//!     light := delay.Q;
//! END_PROGRAM";
//! let logic = std::sync::Arc::new(logic::compile(text).unwrap());
//! let mut runtime = logic::Runtime::new(logic.clone());
//! runtime.set(logic.variable("button").unwrap(), logic::Value::Bool(true));
//! for now_ms in [0, 10, 20] {
//!     assert!(runtime.scan(now_ms * 1_000_000) <= logic.steps_max());
//! }
//! assert_eq!(runtime.get(logic.variable("light").unwrap()), logic::Value::Bool(true));
//!
//! let errors = logic::compile("PROGRAM p VAR x : INT; END_VAR x = 5; END_PROGRAM").unwrap_err();
//! assert_eq!(errors[0].to_string(), "1:34: = compares: write := to assign");
//! ```
//!
//! # Where to read
//!
//! | to learn | file |
//! |---|---|
//! | how text becomes declarations and statements | `token.rs`, `parse/mod.rs` |
//! | what a value is, and what becomes what by itself; operators and conversions | `scalar.rs`; `arithmetic.rs` |
//! | where a variable lies in memory | `compile/declare/mod.rs`, `compile/memory.rs`, `compile/place.rs` |
//! | what is checked of expressions, calls, statements | `compile/expression.rs` and `compile/operator.rs`, `compile/function/mod.rs` and `compile/call.rs`, `compile/statement.rs` |
//! | how the longest way through a scan is counted | `compile/statement.rs` (branches and loops), `compile/emit.rs` |
//! | instructions, and what runs them | `code.rs`, `runtime.rs` |
//! | timers, counters, edges | `block.rs` |
//! | every message | `diagnostic/kind.rs` |
//!
//! `tests/differential.rs` runs random programs against an evaluator of another kind. Why this is no crate of others:
//! `docs/decisions/structured-text.md`.

#![warn(clippy::missing_errors_doc)]

mod arithmetic;
mod block;
mod code;
mod compile;
mod diagnostic;
pub mod duration;
mod logic;
mod parse;
mod runtime;
mod scalar;
mod syntax;
mod token;
mod value;

pub use compile::{ITERATIONS_MAX, MEMORY_MAX, TEXT_MAX, compile};
pub use diagnostic::{Diagnostic, Kind, Severity};
pub use logic::{Logic, Role, Unbound, Variable};
pub use runtime::{Fault, Runtime, Wrong};
pub use scalar::Scalar;
pub use value::Value;
