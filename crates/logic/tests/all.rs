//! All tests of this crate that see it from outside, in one program: each is linked once.

mod common;
#[path = "../../../tests/common/counting.rs"]
mod counting;

mod blocks;
mod differential;
mod errors;
mod growth;
mod language;
mod mutation;
mod no_allocation;
mod second_edition;
