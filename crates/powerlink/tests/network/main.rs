//! A whole network of one managing node and several controlled nodes on virtual time.
#![cfg(feature = "std")]
#![allow(unreachable_pub, reason = "the modules of a test have no outside")]

mod boot;
mod captures;
mod device;
mod endurance;
mod lost_asnd;
mod robustness;
mod supervision;
mod watch;
mod weather;
mod world;
