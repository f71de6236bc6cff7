//! All tests of this crate that see it from outside, in one program: each is linked once.

mod cell;
mod commands;
mod kills;
