//! The control socket: a running control answers questions and takes orders of other processes.
//!
//! In:  JSON-RPC 2.0 requests, one a line, over a Unix stream socket that only the control's user may open.
//! Out: answers, one a line. What real time knows comes from what it publishes; orders to it go through rings. The
//! service thread may wait, allocate and fail: nothing in real time waits for it.
//!
//! [`methods::table`] is the table of what can be asked; [`openrpc`] the same for programs; [`control`] who may give orders; [`server`]
//! keeps clients apart and tells subscribers of changes; [`client`] finds controls for whoever asks. What travels is of [`protocol`].
//!
//! | to learn | file |
//! |---|---|
//! | what can be asked, and in which thread each method runs (`Runs`) | `methods/table.rs` |
//! | the same for programs, with all answers | `openrpc.rs`; the types: `crates/protocol` |
//! | which client may give orders; which role may give which | `control.rs`; `crates/protocol/src/role.rs` |
//! | connections; a stop or hold goes from here to the next cycle | `server/intake.rs` |
//! | clients and their answers; clients of this process | `server/mod.rs`; `server/door.rs` |
//! | what subscribers are sent, and when: the service thread looks every 10 ms, and is woken if an answer is ready or something has changed; an order wakes the operator's loop | `server/subscription.rs` |
//! | programs that arrive in parts; ways of programs that leave in parts | `uploads.rs`; `paths.rs` (made by `program::tool_path`) |
//! | oscilloscopes of clients | `scopes.rs` |
//! | the network in words | `network_view/mod.rs` |
//! | what a button of the user orders | `buttons.rs` |
//! | what takes long | `errands.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod buttons;
pub mod client;
pub mod control;
pub mod errands;
pub mod methods;
mod metrics;
pub mod network_view;
pub mod openrpc;
pub mod orders;
pub mod paths;
pub mod repeats;
pub mod rpc;
pub mod scopes;
pub mod server;
pub mod socket;
mod text_lines;
pub mod uploads;
