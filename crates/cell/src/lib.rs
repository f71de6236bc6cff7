//! The supervisor of a cell of machines.
//!
//! In:  links of 1 to 256 controls, orders of people. Out: programs and orders to controls, their journals and ends into a store, a
//! queue of parts that is kept going, a page that shows all of it.
//!
//! | to learn | file |
//! |---|---|
//! | certificates of a cell | `ca.rs` |
//! | what is decided, without network and clock | `core/` |
//! | what is kept; of journals | `store/mod.rs`; `store/journal.rs` |
//! | what others could have changed | `trust.rs` |
//! | the network: Zenoh to events and back | `net.rs` |
//! | the loop, and who asks it from this PC | `serve.rs` |
//! | the page | `page.rs`, `web/` |
//! | cost and feasibility | `plan.rs` |

pub mod ca;
pub mod core;
pub mod net;
mod page;
pub mod plan;
pub mod serve;
pub mod store;
mod trust;
