//! All that the managing node holds from one call to the next: itself, and where each of its parts stands.
//!
//! Values only; what happens to them is in the file of each part: `cycle` and `async_phase` (the phases), `clock` (what the SoC
//! says), `async_scheduler` (the slot), `nodes`, `network` (all nodes together), `server` (its own objects for others), `objects`.

use super::budget::Budget;
use super::check::{MnConfigError, check};
use super::clock::CycleClock;
use super::config::MnConfig;
use super::event::{Counters, Events, ForeignSign, UnaskedAnswers};
use super::nodes::Nodes;
use crate::ethernet_queue::EthernetQueue;
use crate::nmt::{NmtCommand, NmtState, NodeList};
use crate::sdo::Server;
use crate::wire::{self, FRAME_LEN_MAX, PAYLOAD_MAX, RequestedService, Requests};

/// A broadcast that matters is sent this many times, because it is not acknowledged.
pub(super) const BROADCAST_REPEAT: u8 = 2;
/// Clients that are served beside each other.
const CLIENTS: usize = 2;
/// Longest value that passes as a whole: process data of one node.
const STAGING: usize = 1536;
/// NoService SoAs at the start of PRE_OPERATIONAL_1 that wake the nodes (C_DLL_PREOP1_START_CYCLES).
const WAKE_SOAS: u8 = 10;
/// Another managing node is reported again after it was silent for this time.
const FOREIGN_SILENCE_NS: u64 = 1_000_000_000;

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
    /// We; the frame lies in the [`AsyncSlot`].
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

/// How far the start of the network has come: listening in NOT_ACTIVE, then PRE_OPERATIONAL_1.
#[derive(Clone, Copy, Debug)]
pub(super) struct NetworkStart {
    /// End of listening in NOT_ACTIVE; set by the first call that brings the time.
    pub(super) listen_until_ns: Option<u64>,
    /// The network fell back to PRE_OPERATIONAL_1; what that begins with is still to be done.
    pub(super) entered_pre_op_1: bool,
    pub(super) pre_op_1_since_ns: u64,
    pub(super) reduced: Reduced,
    /// Since when all mandatory nodes are identified.
    pub(super) identified_since_ns: Option<u64>,
    pub(super) missing_reported: bool,
}

impl NetworkStart {
    /// PRE_OPERATIONAL_1 begins; where in `reduced`, is up to what led there.
    pub(super) fn begin_pre_op_1(&mut self, now_ns: u64) {
        self.pre_op_1_since_ns = now_ns;
        self.missing_reported = false;
        self.identified_since_ns = None;
    }
}

/// What competes for the asynchronous slot in addition to the needs of the nodes, and the ASnd that we send in it.
#[derive(Debug)]
pub(super) struct AsyncSlot {
    pub(super) round_robin: RoundRobin,
    /// Command to all that waits for a slot.
    pub(super) broadcast: Option<PendingBroadcast>,
    /// Next node id that is asked who it is because a mandatory node is missing; `None`: all have been asked, or none is missing.
    pub(super) next_stranger: Option<u8>,
    pub(super) server: Server<CLIENTS, STAGING>,
    pub(super) diagnostic: DiagnosticDevice,
    /// Frames of the application.
    pub(super) ethernet: EthernetQueue,
    pub(super) frame: [u8; FRAME_LEN_MAX],
    pub(super) len: usize,
}

/// Another managing node.
#[derive(Debug)]
pub(super) struct Foreign {
    /// When it was heard last, and by what.
    pub(super) last: Option<(u64, ForeignSign)>,
    /// In NOT_ACTIVE: of nodes that we asked nothing.
    pub(super) unasked: UnaskedAnswers,
}

impl Foreign {
    /// It was heard; whether that is to be reported: it had been silent.
    pub(super) fn heard(&mut self, now_ns: u64, sign: ForeignSign) -> bool {
        let silent = self
            .last
            .is_none_or(|(heard_ns, _)| now_ns >= heard_ns + FOREIGN_SILENCE_NS);
        self.last = Some((now_ns, sign));
        silent
    }
}

/// What others may change in our own objects.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct OwnObjects {
    /// What 0x1F9F asks for.
    pub(super) request: RequestCommand,
    /// Faults before this time are no longer in the error history (0x1003).
    pub(super) history_from_ns: u64,
}

/// Managing node with room for `NODES` controlled nodes (about 4 kB each).
#[derive(Debug)]
pub struct Mn<'a, const NODES: usize> {
    pub(super) config: MnConfig<'a>,
    pub(super) state: NmtState,
    pub(super) nodes: Nodes<'a, NODES>,
    pub(super) start: NetworkStart,
    pub(super) gate: Gate,
    pub(super) shutdown: Shutdown,
    /// Nodes the configuration manager is at work with.
    pub(super) being_configured: u32,
    pub(super) foreign: Foreign,
    pub(super) clock: CycleClock,
    pub(super) phase: Phase,
    /// [`Step::IsochronousDone`](super::Step::IsochronousDone) of this cycle is still to come.
    pub(super) done_due: bool,
    /// This cycle has been counted as exceeded.
    pub(super) exceeded: bool,
    /// A cycle was cut off before its SoA: that goes out before the next SoC.
    pub(super) soa_owed: bool,
    /// The state that the last SoA showed.
    pub(super) soa_showed: Option<NmtState>,
    pub(super) slot: AsyncSlot,
    /// What the cycle leaves for the chain; `None`: no node is chained. With a chain our PRes, which triggers it, goes before
    /// the polls.
    pub(super) chain_room_ns: Option<u64>,
    pub(super) outputs_valid: bool,
    /// Payload of our own PRes.
    pub(super) pres_mn: [u8; PAYLOAD_MAX],
    pub(super) cycle_frame: [u8; FRAME_LEN_MAX],
    pub(super) own: OwnObjects,
    pub(super) events: Events,
    pub(super) counters: Counters,
}

impl<'a, const NODES: usize> Mn<'a, NODES> {
    /// A managing node in NOT_ACTIVE. Everything it relies on later is checked here.
    ///
    /// # Errors
    /// [`MnConfigError`]: the first thing that is wrong with the configuration.
    pub fn new(config: MnConfig<'a>) -> Result<Self, MnConfigError> {
        check(&config, NODES.min(usize::from(wire::node::CN_MAX)))?;
        let has_chain = config.nodes.iter().any(|node| node.assignment.chained);
        Ok(Mn {
            config,
            state: NmtState::NotActive,
            nodes: Nodes::new(config.nodes),
            start: NetworkStart {
                listen_until_ns: None,
                entered_pre_op_1: false,
                pre_op_1_since_ns: 0,
                reduced: Reduced::Wake { left: WAKE_SOAS },
                identified_since_ns: None,
                missing_reported: false,
            },
            gate: Gate::default(),
            shutdown: Shutdown::No,
            being_configured: 0,
            foreign: Foreign {
                last: None,
                unasked: UnaskedAnswers::new(),
            },
            clock: CycleClock::default(),
            phase: Phase::Idle,
            done_due: false,
            exceeded: false,
            soa_owed: false,
            soa_showed: None,
            slot: AsyncSlot {
                round_robin: RoundRobin::default(),
                broadcast: None,
                next_stranger: None,
                server: Server::new(),
                diagnostic: DiagnosticDevice::default(),
                ethernet: EthernetQueue::new(),
                frame: [0; FRAME_LEN_MAX],
                len: 0,
            },
            chain_room_ns: has_chain.then(|| Budget::new(&config, &[]).chain_room_ns()),
            outputs_valid: false,
            pres_mn: [0; PAYLOAD_MAX],
            cycle_frame: [0; FRAME_LEN_MAX],
            own: OwnObjects::default(),
            events: Events::new(),
            counters: Counters::default(),
        })
    }
}
