//! All tests of this crate that see it from outside, in one program: each is linked once.

#[path = "../../../tests/common/counting.rs"]
mod counting;

mod esi;
mod ethercrab;
#[path = "network/main.rs"]
mod network;
mod no_allocation;
