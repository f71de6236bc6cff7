//! isocnc: the process.
