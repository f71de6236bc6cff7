//! isocnc: the command line.
fn main() {}
