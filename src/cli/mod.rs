//! cli
use std::process::ExitCode;

pub mod check;
pub mod hal;

/// main
pub fn main() -> ExitCode {
    ExitCode::SUCCESS
}
