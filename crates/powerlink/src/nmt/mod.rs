//! Network management: states, commands and the state machines of CN and MN as pure functions.
//!
//! In:  the state a node is in and what happened to it.
//! Out: the state it goes to, or `None` where the event means nothing in that state.
//! RT: no allocation, no locks, bounded.

mod command;
mod controlled_node;
mod managing_node;
mod state;

pub use command::{NmtCommand, NodeList};
pub use controlled_node::{CnEvent, cn_next};
pub use managing_node::{MnTrigger, mn_next};
pub use state::{NmtState, Reset, cascade};

#[cfg(test)]
mod tests;
