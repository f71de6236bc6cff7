//! The oscilloscope: values of pins in every cycle, for readers in other processes.
//!
//! In:  pins and nets that readers name; the cycle, which calls [`Sampler::sample`] once.
//! Out: one record a cycle for each [`Capture`], or a count of those that were lost.
//!
//! ```text
//!  cycle thread                       file beside the pins                       reader
//!  Sampler::sample ──▶ [ ring of capture 0: records ] ──▶ Capture::read  (isocnc hal scope)
//!                  ──▶ [ ring of capture 1: records ] ──▶ Capture::read  (control socket)
//! ```
//!
//! Why so: the control makes all of the memory at its start, so nothing is mapped, allocated or handed over while cycles run, and
//! a reader that begins or dies costs the cycle nothing but a few words. Each reader has a ring of its own, so none has to agree
//! with another about channels, and a slow one loses records of its own only. A ring is never written over: what the reader
//! has not taken yet stays, and the cycle counts what found no room; so nothing is ever read half, and a reader that was killed
//! costs one count a cycle. Which ring belongs to whom is said by a lock that the kernel takes away with the process.
//!
//! The cycle believes nothing that a reader has written: it keeps where it writes to itself, a number of a cell that there is
//! none of is refused, any place that a reader claims to have read up to is at worst a full ring.

mod capture;
mod file;
mod layout;
mod ring;
mod sampler;

pub use capture::{Capture, Channel, Record, check};
pub use layout::CAPTURES;
pub use ring::CHANNELS_MAX;
pub use sampler::Sampler;
