//! All tests of this crate that see it from outside, in one program: each is linked once.

#[path = "../../../tests/common/counting.rs"]
mod counting;
mod rig;

#[path = "differential/main.rs"]
mod differential;
mod models;
mod no_allocation;
mod rules;
mod tables;
