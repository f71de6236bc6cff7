//! What goes over the control socket: one language for the control and everyone who speaks to it.
//!
//! In:  nothing of a machine. Out: a type for the parameters and the answer of each method and for each notification, their schemas,
//! and the client that sends the one and reads the other.
//!
//! A request is typed where it is made and an answer where it is read; what a field means is said once, at its type, and becomes the
//! description of its schema. A client never reads more than the control says: it takes no decision and holds no state of a machine
//! but the last one that it was told.
//!
//! | to learn | file |
//! |---|---|
//! | which methods there are, with parameters and answers of each | `method.rs` |
//! | what parameters and answers hold | `params.rs`; `answers/` |
//! | what fields of answers can say | `codes.rs` |
//! | what the control says to people, by code | `message.rs` |
//! | words and bounds of parameters | `limits.rs` |
//! | which role may do what | `role.rs` |
//! | lines of JSON-RPC, and errors | `rpc.rs` |
//! | schemas | `schema.rs` |
//! | the client; the same with tokio | `client.rs`; `with_tokio.rs` |

pub mod answers;
pub mod client;
pub mod codes;
pub mod limits;
pub mod message;
pub mod method;
pub mod params;
pub mod role;
pub mod rpc;
pub mod schema;
#[cfg(feature = "tokio")]
pub mod with_tokio;

pub use answers::*;
pub use client::{Client, ClientError, Followed, Sender};
pub use codes::{Activity, LastResult, Mode, Next, Outcome, Power, Reaction, Severity, State, Step, WaitingFor};
pub use message::{Message, Param};
pub use method::Method;
pub use role::{Remote, Role};
pub use rpc::{Received, RpcError};

/// Version of what is served: the first number changes when something is gone or means something else, the second when something is
/// new.
pub const API_VERSION: &str = "3.2";
