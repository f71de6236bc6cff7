//! The simulated machine: controlled nodes with drives and motors behind them.
//!
//! In:  a machine file, frames of a managing node, the time.
//! Out: frames of the nodes, as [`SimMachine`]; the same on a wire ([`serve`]) or on virtual time ([`VirtualNet`]).
//!
//! | to learn | file |
//! |---|---|
//! | the seam between simulated devices and the bus that carries them; the protocols | `carrier.rs`; `protocol.rs`, `powerlink.rs`, `ethercat.rs`, of tests `toy.rs` |
//! | a servo drive; how its profile says that it is built; its motor and load | `drive.rs`; `built.rs`; `motor.rs` |
//! | an I/O node; an amplifier with an analog input behind it | `io.rs`; `amplifier.rs` |
//! | stepper motors at the pins of the step port | `stepper.rs` |
//! | the spindle with its converter and encoder | `spindle.rs` |
//! | touch probe and home switches, closed by where the loads are; limit switches and stops | `sensors.rs`; `track.rs` |
//! | faults on order | `faults.rs` |
//! | virtual time; the wire for a PC that keeps no cycle: virtual time that waits for whichever side is late | `virtual_net.rs`; `paced.rs` |
//!
//! Everything that has a state machine (managing node, controlled nodes, SDO, drives, the sequence) gets time and frames from
//! outside. So a whole machine runs on virtual time in tests: same inputs, same bits. Only the simulated drive computes with the
//! factor group of a drive (`cia402::device`); the control writes and compares it.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod amplifier;
mod built;
mod carrier;
mod drive;
mod ethercat;
mod faults;
mod io;
mod machine;
mod motor;
pub mod near_end;
pub mod paced;
mod powerlink;
mod protocol;
mod run;
mod sensors;
mod spindle;
pub mod stepper;
#[cfg(feature = "testing")]
mod toy;
mod track;
mod virtual_net;

pub use self::powerlink::node_mac;
pub use machine::{DriveId, SimMachine};
pub use run::{Served, serve};
pub use virtual_net::{Disturbance, NetConfig, VirtualNet};

use config::Node;
use std::fmt;

/// Printed by a process of the simulated machine once it listens.
pub const READY: &str = "ready";

/// Why a node of the machine file cannot be simulated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SimError {
    pub node: String,
    pub id: u8,
    /// What is in the way.
    pub cause: String,
}

impl SimError {
    fn new(node: &Node, cause: impl fmt::Display) -> SimError {
        SimError {
            node: node.name.clone(),
            id: node.id,
            cause: cause.to_string(),
        }
    }
}

impl fmt::Display for SimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "simulated node {} ({}): {}", self.id, self.node, self.cause)
    }
}

impl std::error::Error for SimError {}

#[cfg(test)]
mod test_machine;
#[cfg(test)]
use test_machine::test_config;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_ethercat;
