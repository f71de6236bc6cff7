//! cli
use std::process::ExitCode;

pub mod check;
pub mod hal;
pub mod interpret;

/// main
pub fn main() -> ExitCode {
    ExitCode::SUCCESS
}
