//! All tests of this crate that see it from outside, in one program: each is linked once.

mod cn_replay;
mod golden_frames;
mod mn_replay;
#[path = "network/main.rs"]
mod network;
mod raw_links;
mod sdo_frames;
