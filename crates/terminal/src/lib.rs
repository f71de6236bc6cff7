//! What all commands share: how they end, and how they print.
//!
//! In:  errors of any kind. Out: their text, or JSON in one shape for all commands ([`refusal`]).

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod refusal;

use std::io::{ErrorKind, Write};

/// Writes to standard output; the reader of a pipe may have seen enough.
///
/// # Errors
/// Any other that writing gives.
pub fn print(text: &str) -> std::io::Result<()> {
    match files::printed::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}
