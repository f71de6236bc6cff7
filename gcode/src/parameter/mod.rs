//! Numbered parameters: which there are, and the file in which a machine keeps them.

pub mod file;

/// Greatest number of a parameter; the smallest one is 1.
pub const PARAMETER_MAX: u16 = 5601;
