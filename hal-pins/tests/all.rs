//! All tests of this crate that see it from outside, in one program: each is linked once. Not the models: the crate loom takes signals
//! that tests of lost memory need.

mod corrupt;
mod external;
mod pins;
mod processes;
mod scope;
