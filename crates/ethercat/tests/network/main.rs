//! The main device and simulated devices on virtual time.
#![cfg(feature = "std")]
#![allow(unreachable_pub, reason = "the modules of a test have no outside")]

mod boot;
mod captures;
mod faults;
mod hostile;
mod objects;
mod weather;
mod world;
