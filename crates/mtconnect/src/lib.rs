//! An MTConnect agent, sans I/O: pure functions of what a machine is and how it is. Read-only, as MTConnect is.
//!
//! In:  a description of the machine ([`Machine`]), how it is ([`Facts`]), its tools; paths and queries of clients; the time of day.
//! Out: documents of MTConnect 2.7 (probe, current, sample, assets, errors), parts of streams, lines of SHDR.
//!
//! | to learn | file |
//! |---|---|
//! | what is told of a machine: components and data items | `model.rs` |
//! | how values of them come from the state of a control | `facts.rs` |
//! | observations, their numbers, and how everything was at one of them | `ring.rs` |
//! | which items a `path` means | `xpath.rs` |
//! | a request and its answer | `request.rs`, `agent.rs` |
//! | the text of documents | `document.rs`, `xml.rs` |
//! | an answer that goes on and on | `stream.rs` |
//! | lines for an agent of somebody else | `shdr.rs` |

mod agent;
mod document;
mod facts;
mod model;
mod request;
mod ring;
pub mod shdr;
mod stream;
mod time;
mod xml;
mod xpath;

#[cfg(test)]
mod document_tests;

pub use agent::{Agent, Reply, Settings};
pub use document::{Document, Errors};
pub use facts::{Alarm, AxisFacts, Execution, Facts, Mode, Motion, Spindle, Subject, WaitFor};
pub use model::{Axis, Machine, Tool};
pub use request::MAX_COUNT;
pub use stream::Stream;
pub use time::stamp;
