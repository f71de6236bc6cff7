//! What the application asks of the network: to go on where it waits, and NMT commands to single nodes.
//!
//! In:  calls of the application, between two calls of `poll`. Out: orders to nodes, which go out with the next slots.
//! RT: no allocation, no locks, bounded by the number of nodes.

use core::fmt;

use super::event::NodeState;
use super::stage::BootStage;
use super::state::Mn;
use crate::ethernet_queue::QueueError;
use crate::nmt::{NmtCommand, NmtState};

/// Why a node is not given an NMT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeCommandError {
    /// There is no node at this position.
    NoSuchNode {
        /// Position in the configuration.
        position: usize,
    },
    /// Only plain commands that change the state of a node are given.
    NoStateCommand {
        /// The command that was asked for.
        command: NmtCommand,
    },
    /// The command means nothing to a node where this one is now.
    WrongState {
        /// The command that was asked for.
        command: NmtCommand,
        /// As the node last reported it.
        node: NmtState,
        /// State of the managing node.
        network: NmtState,
    },
    /// The node does not wait to be booted.
    NotHeld {
        /// State that it is in.
        state: NodeState,
    },
}

impl fmt::Display for NodeCommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NodeCommandError::NoSuchNode { position } => write!(f, "there is no node at position {position}"),
            NodeCommandError::NoStateCommand { command } => {
                write!(f, "{command:?} is no plain command that changes the state of a node")
            }
            NodeCommandError::WrongState { command, node, network } => {
                write!(
                    f,
                    "{command:?} means nothing to a node in {node:?} while the network is {network:?}"
                )
            }
            NodeCommandError::NotHeld { state } => write!(f, "the node does not wait to be booted: it is {state:?}"),
        }
    }
}

impl core::error::Error for NodeCommandError {}

impl<const NODES: usize> Mn<'_, NODES> {
    /// Has an Ethernet frame that is not POWERLINK (IP, for instance) sent in an asynchronous slot of our own. Short frames are
    /// padded; what waits at the end of the network is forgotten.
    ///
    /// # Errors
    /// [`QueueError`] when all places are taken, or for a frame that is POWERLINK or longer than the AsyncMTU (0x1F98/8).
    pub fn send_ethernet(&mut self, frame: &[u8]) -> Result<(), QueueError> {
        self.ethernet.push(frame, self.config.async_mtu)
    }

    /// The state that the network would enter if the application let it (0x1F80 bits 2, 7 and 8; bit 6 after an error).
    pub fn waits_for_application(&self) -> Option<NmtState> {
        self.gate.next
    }

    /// Lets the network take the step it waits for; whether it does wait. Each step is let through once.
    pub fn go_on(&mut self) -> bool {
        self.gate.open = self.gate.next.is_some();
        self.gate.open
    }

    /// Boots a node that is held because bit 2 of its assignment (0x1F81) is clear, by its position in the configuration.
    ///
    /// # Errors
    /// [`NodeCommandError`]: no node at this position, or one that is not held.
    pub fn boot_node(&mut self, position: usize) -> Result<(), NodeCommandError> {
        let now_ns = self.now_ns();
        let Some(Some(node)) = self.nodes.get_mut(position) else {
            return Err(NodeCommandError::NoSuchNode { position });
        };
        if node.stage != BootStage::Held {
            return Err(NodeCommandError::NotHeld { state: node.state });
        }
        node.boot_held(now_ns);
        Ok(())
    }

    /// Gives a node an NMT command, by its position in the configuration (as 0x1F9F asks of a managing node): StartNode when
    /// it is ready, StopNode, EnterPreOperational2 after STOPPED or OPERATIONAL, EnableReadyToOperate after that, and the four
    /// resets, after which it is booted again.
    ///
    /// # Errors
    /// [`NodeCommandError`]: no node at this position, no command that changes a state, or not in the state that it needs.
    pub fn node_command(&mut self, position: usize, command: NmtCommand) -> Result<(), NodeCommandError> {
        let (now_ns, network) = (self.now_ns(), self.network());
        let Some(Some(node)) = self.nodes.get_mut(position) else {
            return Err(NodeCommandError::NoSuchNode { position });
        };
        if command.plain().is_some() || command.cn_event().is_none() {
            return Err(NodeCommandError::NoStateCommand { command });
        }
        let isochronous = network.state.is_isochronous();
        match (command, node.stage) {
            (
                NmtCommand::ResetNode
                | NmtCommand::ResetCommunication
                | NmtCommand::ResetConfiguration
                | NmtCommand::SwReset,
                _,
            ) => {
                node.reset(now_ns, &network, &mut self.events);
                node.command(command);
            }
            (NmtCommand::StartNode, BootStage::Ready) if network.state == NmtState::Operational => {
                node.command(command);
                node.started(now_ns, &network);
            }
            (
                NmtCommand::StopNode,
                BootStage::WaitingPreOperational2 { .. }
                | BootStage::WaitingReadyToOperate { .. }
                | BootStage::CheckingCommunication { .. }
                | BootStage::Ready
                | BootStage::WaitingOperational { .. }
                | BootStage::Operational
                | BootStage::TakenOver
                | BootStage::BackInPreOperational2 { .. },
            ) if isochronous && node.nmt_state.is_isochronous() => {
                node.stop(now_ns);
                node.set_state(NodeState::Stopped, &mut self.events);
            }
            (
                NmtCommand::EnterPreOperational2,
                BootStage::Operational | BootStage::WaitingOperational { .. } | BootStage::Stopped { .. },
            ) => {
                node.back_in_pre_operational_2(now_ns);
                node.set_state(NodeState::Configuring, &mut self.events);
            }
            (NmtCommand::EnableReadyToOperate, BootStage::BackInPreOperational2 { .. })
                if node.nmt_state == NmtState::PreOperational2 =>
            {
                node.enable_again(now_ns, &network);
            }
            (command, _) => {
                return Err(NodeCommandError::WrongState {
                    command,
                    node: node.nmt_state,
                    network: network.state,
                });
            }
        }
        Ok(())
    }

    /// The time as of the last cycle; calls of the application bring none of their own.
    fn now_ns(&self) -> u64 {
        self.cycle_started_ns.unwrap_or(self.pre_op_1_since_ns)
    }
}
