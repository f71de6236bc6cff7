//! Ethernet POWERLINK as a [`CyclicBus`]: the managing node of `powerlink::mn` over a link.
//!
//! In:  images once a cycle.
//! Out: frames on the link; the managing node decides which and when, this file only waits and hands over.
//!
//! RT except for [`Powerlink::new`].

pub mod cdc;
pub mod frames;
pub mod managing_node;
pub mod network;
pub mod open;
mod publisher;
pub mod sender;
pub mod service;
pub mod tap;

use super::watch::Watch;
use super::{
    BusEvent, BusState, CycleReport, CyclicBus, EthernetFrame, InputImage, NodeIndex, NodeState, NodeStatistics,
    OutputImage, TimeReference, in_the_kernel,
};
use config::Identity;
use machine::faults::{ForeignMaster, LinkFailure};
use powerlink::link::{Link, LinkError};
use powerlink::mn::{self, ETHERNET_FRAMES, ForeignSign, Mn, MnConfig, MnEvent, QueueError, Step};
use powerlink::nmt::NmtState;
use powerlink::wire::{NetTime, message};
use publisher::{Publisher, SdoBuffers};
use rtrb::Consumer;
use service::PowerlinkService;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// Most nodes that one network can have: ids 1 to 239.
pub const NODES_MAX: usize = 239;
/// Longest frame without check sum.
const FRAME_OCTETS_MAX: usize = 1514;

/// Where a frame says what it is.
const MESSAGE_TYPE_AT: usize = 14;

/// Time of day by the system's clock, for SoC frames on a real wire.
pub fn wall_clock() -> NetTime {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    NetTime {
        seconds: now.as_secs() as u32,
        nanoseconds: now.subsec_nanos(),
    }
}

/// A time of day that is so far behind another.
fn later(time: NetTime, by_ns: u64) -> NetTime {
    let nanoseconds = u64::from(time.nanoseconds) + by_ns;
    NetTime {
        seconds: time.seconds.wrapping_add((nanoseconds / 1_000_000_000) as u32),
        nanoseconds: (nanoseconds % 1_000_000_000) as u32,
    }
}

/// The managing node on a link.
pub struct Powerlink<'a, L, const NODES: usize> {
    /// Of the size of all its nodes: on the heap, for whoever builds a bus hands it on several times.
    mn: Box<Mn<'a, NODES>>,
    link: L,
    /// Told of every time limit, so that the time-out thread sees them although this thread is busy.
    watch: Arc<Watch>,
    /// Wall clock for the SoC.
    net_time: fn() -> NetTime,
    buffer: [u8; FRAME_OCTETS_MAX],
    link_error: Option<LinkError>,
    /// A cycle was made ready and has not been run.
    ready: bool,
    /// When the SoC of this cycle was sent.
    soc_ns: Option<u64>,
    /// What the time-out thread was told: node and date.
    awaited_poll: Option<(u8, u64)>,
    awaited_slot: Option<(u8, u64)>,
    node_ids: Box<[u8]>,
    sdo_buffers: SdoBuffers<'a>,
    publisher: Option<Publisher>,
    reported: BusState,
    /// Frames of other programs that wait for an asynchronous slot.
    ethernet: Option<Consumer<EthernetFrame>>,
}

impl<'a, L: Link, const NODES: usize> Powerlink<'a, L, NODES> {
    /// A managing node that has sent nothing yet.
    pub fn new(
        config: MnConfig<'a>,
        link: L,
        watch: Arc<Watch>,
        net_time: fn() -> NetTime,
    ) -> Result<Self, mn::MnConfigError> {
        let node_ids = config.nodes.iter().map(|node| node.id).collect();
        let mut mn = Box::new(Mn::new(config)?);
        // Before a drive is asked for anything its payload is all zero, which is "disable voltage": always valid.
        mn.set_outputs_valid(true);
        Ok(Powerlink {
            mn,
            node_ids,
            link,
            watch,
            net_time,
            buffer: [0; FRAME_OCTETS_MAX],
            link_error: None,
            ready: false,
            soc_ns: None,
            awaited_poll: None,
            awaited_slot: None,
            sdo_buffers: SdoBuffers::new(),
            publisher: None,
            reported: BusState::Down,
            ethernet: None,
        })
    }

    /// Its other half. Not RT.
    pub fn service(&mut self) -> PowerlinkService {
        let (publisher, service) = publisher::rings(self.node_ids.len());
        self.publisher = Some(publisher);
        service
    }

    /// Frames that are not POWERLINK, to be sent in asynchronous slots.
    pub fn set_ethernet_source(&mut self, frames: Consumer<EthernetFrame>) {
        self.ethernet = Some(frames);
    }

    /// Hands waiting frames of other programs to the managing node, as many as it has room for.
    fn hand_in_ethernet(&mut self) {
        let Some(frames) = &mut self.ethernet else { return };
        for _ in 0..ETHERNET_FRAMES {
            let Ok(frame) = frames.peek() else { return };
            match self.mn.send_ethernet(frame.octets()) {
                // It stays for a later cycle.
                Err(QueueError::Full) => return,
                // What the bus cannot carry is dropped, as any network does.
                Ok(()) | Err(QueueError::Length { .. } | QueueError::Powerlink) => _ = frames.pop(),
            }
        }
    }

    /// The link, for tests that steer a simulated wire.
    pub fn link_mut(&mut self) -> &mut L {
        &mut self.link
    }

    /// The managing node, for diagnosis.
    pub fn mn(&self) -> &Mn<'a, NODES> {
        &self.mn
    }

    /// Tells the time-out thread which answers are awaited, if that has changed. Whether it was quicker to give one up does
    /// not matter here: the managing node judges by its own clock.
    fn show_awaited(&mut self) {
        let poll = self.mn.outstanding();
        if poll != self.awaited_poll {
            match poll {
                Some((node, deadline_ns)) => self.watch.begin_poll(node, deadline_ns),
                None => _ = self.watch.end_poll(),
            }
            self.awaited_poll = poll;
        }
        let slot = self.mn.awaited_slot();
        if slot != self.awaited_slot {
            match slot {
                Some((node, deadline_ns)) => self.watch.begin_async(node, deadline_ns),
                None => _ = self.watch.end_async(),
            }
            self.awaited_slot = slot;
        }
    }

    /// The event in the words of the control; `None` for what it has no use for.
    fn translate(&self, event: MnEvent) -> Option<BusEvent> {
        let index = |id: u8| self.node_ids.iter().position(|own| *own == id);
        Some(match event {
            // After a threshold the network starts again: every node is lost, and says so.
            MnEvent::NmtStateChanged { .. }
            | MnEvent::Configuring { .. }
            | MnEvent::WaitsForApplication { .. }
            | MnEvent::AllOnError { .. }
            | MnEvent::CycleThreshold
            | MnEvent::CrcThreshold
            | MnEvent::MappingVersion { .. } => return None,
            MnEvent::Identified { node } => BusEvent::Identified(index(node)?),
            MnEvent::IdentityMismatch {
                node,
                field,
                expected,
                got,
            } => BusEvent::WrongIdentity {
                node: index(node)?,
                object: field.object(),
                expected,
                got,
            },
            MnEvent::SoftwareMismatch { node, expected, got } => {
                let (sub, expected, got) = if expected.date != got.date {
                    (1, expected.date, got.date)
                } else {
                    (2, expected.time, got.time)
                };
                BusEvent::WrongIdentity {
                    node: index(node)?,
                    object: (0x1F52, sub),
                    expected,
                    got,
                }
            }
            MnEvent::Missing { node } => BusEvent::Missing(index(node)?),
            MnEvent::Stranger {
                node,
                device_type,
                vendor_id,
                product_code,
                revision,
                serial,
            } => BusEvent::Stranger {
                id: node,
                identity: Identity {
                    device_type: Some(device_type),
                    vendor_id: Some(vendor_id),
                    product_code: Some(product_code),
                    revision: Some(revision),
                    serial: Some(serial),
                },
            },
            MnEvent::SdoAbort {
                node,
                index: object,
                sub,
                code,
            } => BusEvent::ConfigurationRefused {
                node: index(node)?,
                object: (object, sub),
                abort: code,
            },
            MnEvent::ValueMismatch {
                node,
                index: object,
                sub,
                expected,
                got,
            } => BusEvent::WrongValue {
                node: index(node)?,
                object: (object, sub),
                expected,
                got,
            },
            MnEvent::SdoFailed { node, .. } | MnEvent::BootTimeout { node, .. } => BusEvent::BootFailed(index(node)?),
            MnEvent::NodeStateChanged {
                node,
                state: mn::NodeState::Operational,
            } => BusEvent::NodeUp(index(node)?),
            MnEvent::NodeStateChanged { .. } => return None,
            MnEvent::Lost { node, .. } | MnEvent::WrongState { node, .. } => BusEvent::NodeLost(index(node)?),
            MnEvent::ErrorEntry { node, entry } => BusEvent::NodeError {
                node: index(node)?,
                code: entry.code,
            },
            MnEvent::ForeignMn(sign) => BusEvent::ForeignMaster(foreign_master(sign)),
        })
    }

    /// Sends, waits and receives until the isochronous part is over or `deadline_ns` has come.
    fn run_until(&mut self, deadline_ns: u64, stop_at_isochronous_end: bool) {
        loop {
            let now_ns = self.link.now_ns();
            let wait_ns = match self.mn.poll(now_ns) {
                Step::Send(frame) => {
                    if frame.get(MESSAGE_TYPE_AT) == Some(&message::SOC) {
                        self.soc_ns = Some(self.link.now_ns());
                    }
                    if let Err(error) = in_the_kernel(|| self.link.send(frame)) {
                        self.link_error = Some(error);
                    }
                    continue;
                }
                Step::IsochronousDone if stop_at_isochronous_end => {
                    self.show_awaited();
                    return;
                }
                Step::IsochronousDone => now_ns,
                Step::WaitUntil(time_ns) => time_ns.min(deadline_ns),
                Step::Idle => deadline_ns,
            };
            self.show_awaited();
            match in_the_kernel(|| self.link.receive(&mut self.buffer, wait_ns)) {
                Ok(Some(received)) => {
                    let now_ns = self.link.now_ns();
                    self.mn.receive(now_ns, &self.buffer[..received.length]);
                    self.show_awaited();
                    // A wire that is flooded with frames must not keep this thread beyond its date.
                    if now_ns >= deadline_ns {
                        return;
                    }
                }
                Ok(None) if wait_ns >= deadline_ns => return,
                Ok(None) => {}
                Err(error) => {
                    self.link_error = Some(error);
                    return;
                }
            }
        }
    }
}

impl<L: Link, const NODES: usize> CyclicBus for Powerlink<'_, L, NODES> {
    fn prepare(&mut self, begin_ns: u64, outputs: &OutputImage) {
        for node in 0..self.node_ids.len() {
            self.mn.output_mut(node).copy_from_slice(outputs.node(node));
        }
        if self.watch.soc_allowed() {
            let ahead_ns = begin_ns.saturating_sub(self.link.now_ns());
            self.mn.start_cycle(begin_ns, later((self.net_time)(), ahead_ns));
            self.ready = true;
        }
    }

    fn exchange(&mut self, deadline_ns: u64, inputs: &mut InputImage) -> CycleReport {
        let sent_ns = self.link.now_ns();
        let soc_allowed = self.watch.soc_allowed();
        self.ready = false;
        if soc_allowed {
            self.run_until(deadline_ns, true);
        } else {
            self.mn.abandon_cycle();
        }
        let nodes = inputs.lost_in_row.len();
        let soc_ns = self.soc_ns.take();
        let mut lost = 0;
        for node in 0..nodes {
            let input = self.mn.input(node);
            // Without a cycle the managing node still holds what came in the last one.
            let fresh = soc_allowed && input.fresh;
            if fresh {
                inputs.payload.node_mut(node).copy_from_slice(input.data);
            }
            inputs.fresh[node] = fresh;
            inputs.lost_in_row[node] = input.lost_in_row;
            lost += u32::from(input.lost_in_row > 0);
        }
        CycleReport {
            sent_ns,
            started_ns: soc_ns,
            done_ns: self.link.now_ns(),
            lost,
            time: TimeReference::Ours,
        }
    }

    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    fn serve(&mut self, until_ns: u64) {
        // A cycle that was made ready waits for its date: its SoC is the next frame, and not before.
        if self.ready {
            return;
        }
        self.hand_in_ethernet();
        self.run_until(until_ns, false);
    }

    fn now_ns(&mut self) -> u64 {
        self.link.now_ns()
    }

    fn node_state(&self, node: NodeIndex) -> NodeState {
        match self.mn.node_state(node) {
            mn::NodeState::Absent => NodeState::Absent,
            mn::NodeState::Configuring => NodeState::Configuring,
            mn::NodeState::Ready => NodeState::Ready,
            mn::NodeState::Operational => NodeState::Operational,
            mn::NodeState::Faulted | mn::NodeState::Stopped => NodeState::Faulted,
        }
    }

    fn state(&self) -> BusState {
        if self.mn.is_shut_down() {
            return BusState::Down;
        }
        match self.mn.nmt_state() {
            NmtState::Operational => BusState::Operational,
            NmtState::Off
            | NmtState::Initialising
            | NmtState::ResetApplication
            | NmtState::ResetCommunication
            | NmtState::ResetConfiguration
            | NmtState::NotActive
            | NmtState::BasicEthernet
            | NmtState::PreOperational1
            | NmtState::PreOperational2
            | NmtState::ReadyToOperate
            | NmtState::Stopped
            | NmtState::Unknown(_) => BusState::Booting,
        }
    }

    fn pop_event(&mut self) -> Option<BusEvent> {
        let state = self.state();
        if state != self.reported {
            self.reported = state;
            return Some(BusEvent::Network(state));
        }
        if let Some(error) = self.link_error.take() {
            return Some(BusEvent::LinkFailed(link_failure(error)));
        }
        while let Some(event) = self.mn.pop_event() {
            if let Some(event) = self.translate(event) {
                return Some(event);
            }
        }
        None
    }

    fn shut_down(&mut self) {
        self.mn.shut_down();
    }

    fn statistics(&self, node: NodeIndex) -> NodeStatistics {
        let of_node = self.mn.statistics(node);
        NodeStatistics {
            polls: of_node.preq_sent,
            answers: of_node.pres_received,
            lost: of_node.pres_lost,
        }
    }

    fn publish(&mut self, cycle: u64) {
        if let Some(publisher) = &mut self.publisher {
            publisher.publish(cycle, &mut self.mn, &mut self.sdo_buffers);
        }
    }
}

/// Why a link does not carry frames, in the words of the control.
pub(super) fn link_failure(error: LinkError) -> LinkFailure {
    match error {
        LinkError::Down => LinkFailure::Down,
        LinkError::NoBuffers => LinkFailure::QueueFull,
        LinkError::FrameLength { got, max } => LinkFailure::FrameLength { octets: got, max },
        LinkError::Os { errno } => LinkFailure::Os { errno },
    }
}

fn foreign_master(sign: ForeignSign) -> ForeignMaster {
    ForeignMaster {
        node: Some(sign.id),
        mac: sign.mac,
        is_itself: sign.is_its_own(),
    }
}
