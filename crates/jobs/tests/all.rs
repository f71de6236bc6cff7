//! All tests of this crate that see it from outside, in one program.

mod bounds;
mod driven;
mod golden;
mod refusals;
