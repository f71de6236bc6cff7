//! Where the boot-up of a controlled node stands, what it waits for there, and its place in the PRes chain.
//!
//! Values only: the way from stage to stage is in `boot`, the set-up of the chain in `chaining`.

use core::fmt;

use crate::nmt::NmtCommand;
use crate::sdo::command::Address;

/// Where the boot-up of a node stands. Times are in ns, by the clock of whoever calls the managing node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BootStage {
    /// IdentRequests until it answers.
    Searching {
        /// Earliest time of the next one.
        ident_due_ns: u64,
    },
    /// Wrong identity, or it refused its configuration.
    Refused {
        /// It is looked for again from then on.
        until_ns: u64,
    },
    /// Its configuration is being written.
    Configuring {
        /// Objects written so far.
        written: u32,
        /// The object that is being written; 0 before the first.
        index: u16,
        /// Sub-index of that object.
        sub: u8,
    },
    /// Everything is written and read; the SDO connection is being closed.
    ClosingSdo {
        /// It held its configuration already: nothing was written that a reset would put into use.
        was_current: bool,
    },
    /// ResetConfiguration, which puts the configuration into use, waits for a slot.
    ResettingConfiguration {
        /// ResetConfigurations sent so far.
        sent: u8,
    },
    /// It restarts after ResetConfiguration; IdentRequests until it is back.
    Reidentifying {
        /// Earliest time of the next one.
        ident_due_ns: u64,
        /// Time limit of the stage.
        deadline_ns: u64,
        /// ResetConfigurations sent so far.
        sent: u8,
    },
    /// Configured; has to reach PRE_OPERATIONAL_2.
    WaitingPreOperational2 {
        /// Time limit of the stage.
        deadline_ns: u64,
    },
    /// EnableReadyToOperate was ordered; has to reach READY_TO_OPERATE.
    WaitingReadyToOperate {
        /// Time limit of the stage.
        deadline_ns: u64,
        /// The order is repeated then.
        again_ns: u64,
    },
    /// Its PRes are watched for a few cycles.
    CheckingCommunication {
        /// Time limit of the stage.
        deadline_ns: u64,
        /// Good PRes in a row.
        good: u32,
    },
    /// READY_TO_OPERATE; waits for the network.
    Ready,
    /// StartNode was ordered; has to reach OPERATIONAL.
    WaitingOperational {
        /// Time limit of the stage.
        deadline_ns: u64,
        /// The order is repeated then.
        again_ns: u64,
    },
    /// Process data are exchanged.
    Operational,
    /// Found OPERATIONAL with the right configuration and kept alive (0x1F81 bit 4); waits for the network.
    TakenOver,
    /// Stopped because a mandatory node dropped out (0x1F80 bit 6).
    Stopped {
        /// The order is repeated then.
        again_ns: u64,
    },
}

impl fmt::Display for BootStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            BootStage::Searching { .. } => f.write_str("being looked for"),
            BootStage::Refused { .. } => f.write_str("refused"),
            BootStage::Configuring { index: 0, .. } => f.write_str("about to be configured"),
            BootStage::Configuring { written, index, sub } => write!(
                f,
                "being configured: {written} objects written, now {}",
                Address { index, sub }
            ),
            BootStage::ClosingSdo { was_current: true } => f.write_str("found as it was configured before"),
            BootStage::ClosingSdo { .. } | BootStage::ResettingConfiguration { .. } => {
                f.write_str("configured, about to be reset by ResetConfiguration")
            }
            BootStage::Reidentifying { .. } => f.write_str("restarting after ResetConfiguration"),
            BootStage::WaitingPreOperational2 { .. } => f.write_str("on its way to PRE_OPERATIONAL_2"),
            BootStage::WaitingReadyToOperate { .. } => f.write_str("ordered to READY_TO_OPERATE"),
            BootStage::CheckingCommunication { .. } => f.write_str("in the communication check"),
            BootStage::Ready => f.write_str("ready"),
            BootStage::WaitingOperational { .. } => f.write_str("ordered to OPERATIONAL"),
            BootStage::Operational => f.write_str("operational"),
            BootStage::TakenOver => f.write_str("taken over as it was"),
            BootStage::Stopped { .. } => f.write_str("stopped by order"),
        }
    }
}

/// An NMT command that waits for a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Order {
    pub(super) command: NmtCommand,
    /// Error code for the data of a ResetNode; 0: none.
    pub(super) reason: u16,
}

/// Where the set-up of a chained node stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ChainStep {
    /// Its latency is to be asked for.
    Measure,
    /// Its time is to be set.
    Set,
    /// Its time is set.
    Running,
}

/// A node in the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Chain {
    pub(super) step: ChainStep,
    pub(super) latency_ns: u32,
    /// From the end of our PRes to the start of its own.
    pub(super) pres_time_ns: u32,
    pub(super) due_ns: u64,
    pub(super) tries: u32,
    /// Its PRes of this cycle has come.
    pub(super) heard: bool,
}

impl Chain {
    pub(super) const NEW: Chain = Chain {
        step: ChainStep::Measure,
        latency_ns: 0,
        pres_time_ns: 0,
        due_ns: 0,
        tries: 0,
        heard: false,
    };
}
