//! All that the managing node holds from one call to the next: itself, and where each of its parts stands.
//!
//! Values only; what happens to them is in the file of each part: `cycle` (the phases), `async_scheduler` (the slot), `network`
//! (all nodes together), `server` (its own objects for others), `objects`.

use super::budget::Budget;
use super::check::{MnConfigError, check};
use super::config::MnConfig;
use super::event::{Counters, Events, ForeignSign, UnaskedAnswers};
use super::node::Node;
use crate::ethernet_queue::EthernetQueue;
use crate::nmt::{NmtCommand, NmtState, NodeList};
use crate::sdo::Server;
use crate::wire::{self, FRAME_LEN_MAX, NetTime, PAYLOAD_MAX, RequestedService, Requests};

/// A broadcast that matters is sent this many times, because it is not acknowledged.
pub(super) const BROADCAST_REPEAT: u8 = 2;
/// Clients that are served beside each other.
const CLIENTS: usize = 2;
/// Longest value that passes as a whole: process data of one node.
const STAGING: usize = 1536;
/// NoService SoAs at the start of PRE_OPERATIONAL_1 that wake the nodes (C_DLL_PREOP1_START_CYCLES).
const WAKE_SOAS: u8 = 10;
/// Marks a node id without a node in the table from id to position.
pub(super) const NO_NODE: u8 = u8::MAX;

/// Where the cycle stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Between cycles; in the reduced cycle the next SoA may go out.
    Idle,
    /// The SoC lies ready in the buffer of the cycle, so many octets long, and is to be sent.
    SocDue { len: usize },
    /// The SoC was handed out.
    SocSent,
    /// The first PReq has to wait until then.
    AfterSoc { until_ns: u64 },
    /// The PRes of the managing node, which triggers the chain, is to be sent.
    ChainDue,
    /// It was handed out.
    ChainSent,
    /// The chained nodes have to send until then.
    AwaitChain { sent_ns: u64, deadline_ns: u64 },
    /// The next PReq goes to this node or one behind it.
    NextPreq { index: usize },
    /// The PReq was handed out; its time-out starts when the caller comes back from sending.
    PreqSent { index: usize },
    /// The node has to answer until then.
    AwaitPres {
        index: usize,
        sent_ns: u64,
        deadline_ns: u64,
    },
    /// The PRes of the managing node, if it sends one, and then the SoA are to be sent.
    PresMnDue,
    /// The SoA is to be sent.
    SoaDue,
    /// The SoA was handed out.
    SoaSent { grant: Grant },
    /// Our own ASnd was handed out.
    AsndSent,
    /// Somebody else has the slot until then. `looked`: the caller has received since the deadline.
    AwaitAsnd {
        grant: Grant,
        deadline_ns: u64,
        looked: bool,
    },
}

/// Who may send in the slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grant {
    /// No one: NoService.
    NoService,
    /// We; the frame lies in `asnd_frame`.
    Own(Own),
    /// A controlled node, by position.
    Node { index: usize, service: RequestedService },
    /// The diagnostic device.
    Diagnostic { service: RequestedService },
    /// A node that is not configured, asked who it is.
    Stranger { id: u8 },
}

/// What the managing node sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Own {
    /// NMT command to one node.
    Order { index: usize },
    /// Extended NMT command to several nodes.
    Orders { list: NodeList },
    /// ResetNode to all, at the start.
    ResetAll,
    /// ResetNode to one node, at the start.
    ResetEach { index: usize },
    /// Command to all.
    Broadcast,
    /// StopNode or ResetNode to all, at the end.
    ShutDown,
    /// InvalidService to one node.
    Reject,
    /// SDO to one node.
    Sdo,
    /// A frame of the application that is not POWERLINK.
    Ethernet,
}

/// Kinds of use of the slot that take turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SlotUse {
    Sync,
    Status,
    Invite,
    Sdo,
    Server,
    Diagnostic,
    Ethernet,
    Ident,
}

pub(super) const SLOT_USES: [SlotUse; 8] = [
    SlotUse::Sync,
    SlotUse::Status,
    SlotUse::Invite,
    SlotUse::Sdo,
    SlotUse::Server,
    SlotUse::Diagnostic,
    SlotUse::Ethernet,
    SlotUse::Ident,
];

/// Whose turn it is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RoundRobin {
    /// SlotUse that is asked first.
    pub(super) kind: usize,
    /// Node that is asked first, per kind.
    pub(super) node: [usize; SLOT_USES.len()],
    pub(super) order: usize,
    pub(super) nmt_request: usize,
    /// The last slot went to an NMT request.
    pub(super) nmt_request_last: bool,
}

/// Where an orderly end stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shutdown {
    No,
    Stop { left: u8 },
    Reset { left: u8 },
    Done,
}

impl Shutdown {
    /// First step in this state of the managing node.
    pub(super) fn begin(state: NmtState) -> Shutdown {
        match state {
            NmtState::PreOperational2 | NmtState::ReadyToOperate | NmtState::Operational => {
                Shutdown::Stop { left: BROADCAST_REPEAT }
            }
            NmtState::PreOperational1 => Shutdown::Reset { left: BROADCAST_REPEAT },
            NmtState::Off
            | NmtState::Initialising
            | NmtState::ResetApplication
            | NmtState::ResetCommunication
            | NmtState::ResetConfiguration
            | NmtState::NotActive
            | NmtState::BasicEthernet
            | NmtState::Stopped
            | NmtState::Unknown(_) => Shutdown::Done,
        }
    }

    pub(super) fn next(self) -> Shutdown {
        match self {
            Shutdown::Stop { left } if left > 1 => Shutdown::Stop { left: left - 1 },
            Shutdown::Stop { .. } => Shutdown::Reset { left: BROADCAST_REPEAT },
            Shutdown::Reset { left } if left > 1 => Shutdown::Reset { left: left - 1 },
            Shutdown::Reset { .. } | Shutdown::Done => Shutdown::Done,
            Shutdown::No => Shutdown::No,
        }
    }
}

/// Where the start of PRE_OPERATIONAL_1 stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reduced {
    /// NoService SoAs that are still to be sent.
    Wake { left: u8 },
    /// The ResetNode broadcast is next.
    Reset,
    /// As some node is kept alive, ResetNode goes to the others one by one; this one is next.
    ResetEach { index: usize },
    /// The nodes restart.
    Pause { until_ns: u64 },
    /// IdentRequests.
    Ident,
}

/// A step that needs the application's leave.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gate {
    /// The network would enter this state.
    pub(super) next: Option<NmtState>,
    /// The application lets it.
    pub(super) open: bool,
}

/// What all nodes are told at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Broadcast {
    Start,
    Stop,
    Reset,
}

impl Broadcast {
    pub(super) fn command(self) -> NmtCommand {
        match self {
            Broadcast::Start => NmtCommand::StartNode,
            Broadcast::Stop => NmtCommand::StopNode,
            Broadcast::Reset => NmtCommand::ResetNode,
        }
    }
}

/// A command to all nodes, sent a few times because it is not acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PendingBroadcast {
    pub(super) what: Broadcast,
    pub(super) left: u8,
}

/// The server of a managing node.
pub(super) type OwnServer = Server<CLIENTS, STAGING>;

/// The diagnostic device. It is no part of the configuration: it only may come and ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(super) struct DiagnosticDevice {
    pub(super) requests: Requests,
    pub(super) ask_ns: u64,
    pub(super) present: bool,
    pub(super) unanswered: u8,
}

/// An NMT service asked for by writing to 0x1F9F; carried out when Release becomes TRUE.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(super) struct RequestCommand {
    pub(super) command: u8,
    pub(super) target: u8,
}

/// Managing node with room for `NODES` controlled nodes (about 4 kB each).
#[derive(Debug)]
pub struct Mn<'a, const NODES: usize> {
    pub(super) config: MnConfig<'a>,
    pub(super) state: NmtState,
    pub(super) phase: Phase,
    pub(super) reduced: Reduced,
    pub(super) nodes: [Option<Node<'a>>; NODES],
    /// Position of a node id in `nodes`.
    pub(super) index_of: [u8; 256],
    pub(super) outputs_valid: bool,
    pub(super) done_due: bool,
    /// This cycle has been counted as exceeded.
    pub(super) exceeded: bool,
    /// A cycle was cut off before its SoA: that goes out before the next SoC.
    pub(super) soa_owed: bool,
    /// The state that the last SoA showed.
    pub(super) soa_showed: Option<NmtState>,
    /// End of listening in NOT_ACTIVE; set by the first call that brings the time.
    pub(super) listen_until_ns: Option<u64>,
    pub(super) pre_op_1_since_ns: u64,
    pub(super) missing_reported: bool,
    /// The network fell back to PRE_OPERATIONAL_1; what that begins with is still to be done.
    pub(super) entered_pre_op_1: bool,
    /// Since when all mandatory nodes are identified, in PRE_OPERATIONAL_1.
    pub(super) identified_since_ns: Option<u64>,
    /// Nodes the configuration manager is at work with.
    pub(super) being_configured: u32,
    pub(super) gate: Gate,
    /// Command to all that waits for a slot.
    pub(super) pending_broadcast: Option<PendingBroadcast>,
    /// When another managing node was heard last, and by what.
    pub(super) foreign: Option<(u64, ForeignSign)>,
    /// In NOT_ACTIVE: of nodes that we asked nothing.
    pub(super) unasked: UnaskedAnswers,
    pub(super) cycle_started_ns: Option<u64>,
    pub(super) net_time: NetTime,
    pub(super) relative_time_us: u64,
    pub(super) prescaled_slot: bool,
    /// Cycle of the multiplexed round, from 1; 0 before the first.
    pub(super) multiplex_cycle: u8,
    /// MC of the SoC.
    pub(super) round_toggle: bool,
    pub(super) round_robin: RoundRobin,
    /// Next node id that is asked who it is because a mandatory node is missing; `None`: all have been asked, or none is missing.
    pub(super) next_stranger: Option<u8>,
    pub(super) shutdown: Shutdown,
    pub(super) events: Events,
    pub(super) counters: Counters,
    pub(super) server: OwnServer,
    pub(super) diagnostic: DiagnosticDevice,
    /// What 0x1F9F asks for.
    pub(super) request: RequestCommand,
    /// Faults before this time are no longer in the error history (0x1003).
    pub(super) history_from_ns: u64,
    /// Any node is chained: our PRes goes before the polls, to trigger the chain.
    pub(super) has_chain: bool,
    /// What the cycle leaves for it, in ns.
    pub(super) chain_room_ns: u64,
    /// Payload of our own PRes.
    pub(super) pres_mn: [u8; PAYLOAD_MAX],
    pub(super) cycle_frame: [u8; FRAME_LEN_MAX],
    pub(super) asnd_frame: [u8; FRAME_LEN_MAX],
    pub(super) asnd_len: usize,
    /// Frames of the application that wait for a slot.
    pub(super) ethernet: EthernetQueue,
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// A managing node in NOT_ACTIVE. Everything it relies on later is checked here.
    ///
    /// # Errors
    /// [`MnConfigError`]: the first thing that is wrong with the configuration.
    pub fn new(config: MnConfig<'a>) -> Result<Self, MnConfigError> {
        check(&config, NODES.min(usize::from(wire::node::CN_MAX)))?;
        let mut index_of = [NO_NODE; 256];
        for (index, node) in config.nodes.iter().enumerate() {
            // At most 239 nodes, checked above.
            index_of[usize::from(node.id)] = index as u8;
        }
        Ok(Mn {
            config,
            state: NmtState::NotActive,
            phase: Phase::Idle,
            reduced: Reduced::Wake { left: WAKE_SOAS },
            nodes: core::array::from_fn(|index| config.nodes.get(index).map(|node| Node::new(*node))),
            index_of,
            outputs_valid: false,
            done_due: false,
            exceeded: false,
            soa_owed: false,
            soa_showed: None,
            listen_until_ns: None,
            pre_op_1_since_ns: 0,
            missing_reported: false,
            entered_pre_op_1: false,
            identified_since_ns: None,
            being_configured: 0,
            gate: Gate::default(),
            pending_broadcast: None,
            foreign: None,
            unasked: UnaskedAnswers::new(),
            cycle_started_ns: None,
            net_time: NetTime::default(),
            relative_time_us: 0,
            prescaled_slot: false,
            multiplex_cycle: 0,
            round_toggle: false,
            round_robin: RoundRobin::default(),
            next_stranger: None,
            shutdown: Shutdown::No,
            events: Events::new(),
            counters: Counters::default(),
            server: OwnServer::new(),
            diagnostic: DiagnosticDevice::default(),
            request: RequestCommand::default(),
            history_from_ns: 0,
            has_chain: config.nodes.iter().any(|node| node.assignment.chained),
            chain_room_ns: Budget::new(&config, &[]).chain_room_ns(),
            pres_mn: [0; PAYLOAD_MAX],
            cycle_frame: [0; FRAME_LEN_MAX],
            asnd_frame: [0; FRAME_LEN_MAX],
            asnd_len: 0,
            ethernet: EthernetQueue::new(),
        })
    }
}
