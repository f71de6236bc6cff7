//! isocnc: the command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    isocnc::cli::main()
}
