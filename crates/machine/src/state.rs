//! What the machine is doing, and what it may be asked to do next.
//!
//! In:  orders of the operator or of the [`Sequence`](super::sequence::Sequence), one at a time.
//! Out: [`State`], which the cycle thread shows after every cycle.

pub use protocol::State;
