//! The link between a control and the supervisor of its cell.
//!
//! In:  a control, as whatever answers its methods ([`Control`]); where the supervisor is, and a certificate of its cell.
//! Out: state and journal to the supervisor, programs and orders from it, over Zenoh on TLS.
//!
//! Two ordinary threads on the side of the control: one tells and answers at once, one stores and starts programs, which may take its
//! time. All queues between them and Zenoh are bounded; what is published is dropped where a supervisor does not read, and asked for
//! again by number. The control works on without a supervisor, and knows nothing of Zenoh.
//!
//! | to learn | file |
//! |---|---|
//! | what is said, under which keys | `message.rs` |
//! | certificates, and what Zenoh is told | `carrier.rs` |
//! | the control as the link sees it | `control.rs` |
//! | which orders were carried out, over any crash | `ledger.rs` |
//! | programs that have come | `store.rs` |
//! | the threads | `link.rs` |
//! | controls without a machine | `simulated.rs`, with the feature `testing` |

pub mod carrier;
pub mod control;
pub mod ledger;
mod link;
pub mod message;
#[cfg(feature = "testing")]
pub mod simulated;
mod store;

pub use control::{Client, Control, Refused};
pub use link::{Connect, LinkError, Settings, run};
pub use zenoh;
