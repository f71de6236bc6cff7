//! Field buses, seen as images that are exchanged once a cycle.
//!
//! In:  the payloads that the nodes shall get ([`OutputImage`]), the time by which to be back.
//! Out: the payloads that came from the nodes ([`InputImage`]), what the cycle took ([`CycleReport`]).
//!
//! A bus has two halves: [`CyclicBus`] for the cycle thread, [`service::BusService`] for everybody else. [`powerlink`] and
//! [`ethercat`] implement both; another one does, too, and is added to [`config::Protocol`]: the compiler then names each registry
//! that lacks it (`protocol.rs` here). The least that there can be is `toy.rs`, the bus of tests.
//!
//! Nothing above this crate knows which bus it is (`tests/house.rs` of the program). The cycle thread calls [`CyclicBus`]: make a
//! cycle ready, exchange, serve, report states and events, publish. [`service::BusService`] answers everyone else: objects of nodes
//! ([`service::Mailbox`]) and what the network is like, in words ([`service::Diagnose`]). The rings between the halves are the bus's
//! own.
//!
//! | to learn | file |
//! |---|---|
//! | the cycle's half; its rings to the other half; the other half | `powerlink/mod.rs`, `ethercat/mod.rs`; `publisher.rs` beside each; `service.rs` or `service/mod.rs` beside it |
//! | what a drive is configured with, regardless of the bus | `configuration.rs` |
//! | what each node is told, and where its values are in its payloads | `plan.rs`, `layout.rs` |
//! | the claim of an interface that everything takes that sends on it | `powerlink/sender.rs` |
//! | the network file from which other managing nodes start | `powerlink/cdc/mod.rs` |
//! | IP frames of other programs (a TAP device): they wait in a ring and leave in our own asynchronous slots; those of nodes come in slots to which the managing node invites them | `powerlink/tap.rs` |
//! | what the time-out thread watches | `watch.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod configuration;
pub mod ethercat;
pub mod layout;
pub mod plan;
pub mod powerlink;
mod protocol;
pub mod service;
#[cfg(feature = "testing")]
pub mod toy;
pub mod watch;

pub use self::ethercat::{Names, Remark};
pub use self::powerlink::frames;
pub use self::powerlink::sender;
pub use self::powerlink::tap::Tap;
use ::powerlink::link::Link;
use anyhow::anyhow;
pub use config::NodeIndex;
use config::{self, Config, ConfigErrors, Identity};
use machine::faults::{ForeignMaster, LinkFailure};
use obd::AbortCode;
use plan::NodePlan;
use protocol::{Run, master};
use service::{BudgetView, BusService};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use watch::Watch;

/// Reads and checks a machine file, its network too.
///
/// # Errors
/// As [`config::read`] and [`check`].
pub fn read(path: &Path) -> Result<Config, ConfigErrors> {
    read_with_cycle(path, None)
}

/// As [`read`], as if the file said `cycle_us` for the cycle of its machine.
///
/// # Errors
/// As [`read`].
pub fn read_with_cycle(path: &Path, cycle_us: Option<u32>) -> Result<Config, ConfigErrors> {
    let config = config::read_with_cycle(path, cycle_us)?;
    check(&config).map(|()| config)
}

/// What only the bus can judge of a machine file: whether the worst cycle of the network fits the cycle.
///
/// # Errors
/// What does not fit, at its place in the file.
pub fn check(config: &Config) -> Result<(), ConfigErrors> {
    master(config).check(config)
}

/// What each node is told before it may take part, in the order of the machine file.
pub fn plan(config: &Config) -> Vec<NodePlan> {
    master(config).plan(config)
}

/// States that a node can tell, in the words of its bus: those of POWERLINK, then those of EtherCAT.
pub fn node_states() -> impl Iterator<Item = String> {
    powerlink::network::node_states().chain(ethercat::node_states())
}

/// How the cycle is spent, part by part. Latencies are those that the time-outs allow.
pub fn budget(config: &Config) -> Vec<BudgetView> {
    master(config).budget(config)
}

/// The longest that the exchange of a cycle can take, ns.
pub fn worst_exchange_ns(config: &Config) -> u64 {
    master(config).worst_exchange_ns(config)
}

/// A bus that is open.
pub struct Open<'a> {
    /// Its half for the cycle thread.
    pub cyclic: Box<dyn CyclicBus + Send + 'a>,
    /// Its half for everybody else.
    pub service: Box<dyn BusService>,
}

/// Opens the bus of a machine on a network interface for the time of a call. `watch`: told of every time limit; `threads`: what
/// each thread that the bus starts for itself does first; `warn`: told what is not as good as it could be.
///
/// # Errors
/// What keeps it from being opened, or what the call gives.
pub fn with_interface<T>(
    config: &Config,
    interface: &str,
    watch: Arc<Watch>,
    threads: fn(),
    warn: &mut dyn FnMut(&str),
    run: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    opened(run, |run| {
        master(config).with_interface(config, interface, watch, threads, warn, run)
    })
}

/// As [`with_interface`], on any link, which has the address `mac`.
///
/// # Errors
/// A network that cannot be, or what the call gives.
pub fn with_link<T>(
    config: &Config,
    link: impl Link + Send,
    mac: [u8; 6],
    watch: Arc<Watch>,
    run: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    opened(run, |run| {
        master(config).with_link(config, Box::new(link), mac, watch, run)
    })
}

/// What a call gives that is made while a bus is open, or why it is not open.
fn opened<T>(
    call: impl FnOnce(Open<'_>) -> anyhow::Result<T>,
    open: impl FnOnce(Run<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<T> {
    let mut given = None;
    open(Box::new(|bus| given = Some(call(bus))))?;
    given.unwrap_or_else(|| Err(anyhow!("the bus was not opened")))
}

/// RT: the calls that the cycle thread is there to make, send and receive; hidden from the RealtimeSanitizer, which would take
/// them for a mistake. How many there are is counted in `tests/system_calls.rs`.
fn in_the_kernel<T>(call: impl FnOnce() -> T) -> T {
    #[cfg(feature = "rtsan")]
    let _hidden = rtsan_standalone::ScopedDisabler::default();
    call()
}

/// Octets of the longest value that is read or written while the bus runs.
pub const SDO_VALUE_MAX: usize = 4096;
/// Values that may be on their way at once.
pub const SDO_ORDERS: usize = 4;

/// What the control needs to know of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeState {
    /// Not seen yet, or gone.
    Absent,
    /// Being identified and configured.
    Configuring,
    /// Configured; its process data are not valid yet.
    Ready,
    /// Process data are exchanged and valid.
    Operational,
    /// Was operational and was lost.
    Faulted,
}

/// What the control needs to know of the whole network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusState {
    /// No cycle runs.
    Down,
    /// Nodes are being brought up.
    Booting,
    /// All mandatory nodes are operational.
    Operational,
}

/// Something that happened on the bus; names a node by its place in the machine file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BusEvent {
    /// The network as a whole changed its state.
    Network(BusState),
    /// A node answered the search.
    Identified(NodeIndex),
    /// A node is not the one that the machine file describes.
    WrongIdentity {
        node: NodeIndex,
        /// Object that differs, for example `1018:1`.
        object: (u16, u8),
        /// What the machine file wants.
        expected: u32,
        /// What the node reports.
        got: u32,
    },
    /// A node refused a configuration value.
    ConfigurationRefused {
        node: NodeIndex,
        /// Object that was written.
        object: (u16, u8),
        /// SDO abort code.
        abort: AbortCode,
    },
    /// An object of a node has another value than its drive profile, or what was written, says.
    WrongValue {
        node: NodeIndex,
        object: (u16, u8),
        /// What it should be.
        expected: u32,
        /// What the node says.
        got: u32,
    },
    /// A node has not answered the search for some time; the search goes on.
    Missing(NodeIndex),
    /// A node that the machine file does not have, found while one that it has is missing.
    Stranger {
        /// Its id.
        id: u8,
        /// What it reports.
        identity: Identity,
    },
    /// A node did not take a step of its boot-up in time; it is booted again.
    BootFailed(NodeIndex),
    /// A node is operational.
    NodeUp(NodeIndex),
    /// A node did not answer more polls in a row than are ridden out.
    NodeLost(NodeIndex),
    /// A node reports an error.
    NodeError {
        node: NodeIndex,
        /// Error code of the entry.
        code: u16,
    },
    /// Another managing node is on the wire.
    ForeignMaster(ForeignMaster),
    /// The network adapter does not send or receive.
    LinkFailed(LinkFailure),
    /// What only this bus has to tell.
    Remark(Remark),
}

/// Octets of the longest Ethernet frame without check sequence.
pub const FRAME_OCTETS_MAX: usize = 1514;

/// An Ethernet frame of another program of this PC, on its way to the asynchronous slot.
#[derive(Clone, Copy, Debug)]
pub struct EthernetFrame {
    length: u16,
    octets: [u8; FRAME_OCTETS_MAX],
}

impl EthernetFrame {
    /// A frame without check sum; what is longer than Ethernet allows is cut.
    pub fn new(frame: &[u8]) -> EthernetFrame {
        let length = frame.len().min(FRAME_OCTETS_MAX);
        let mut octets = [0; FRAME_OCTETS_MAX];
        octets[..length].copy_from_slice(&frame[..length]);
        EthernetFrame {
            length: length as u16,
            octets,
        }
    }

    pub fn octets(&self) -> &[u8] {
        &self.octets[..usize::from(self.length)]
    }
}

/// Payloads of all nodes in one piece of memory.
#[derive(Clone, Debug)]
pub struct ProcessImage {
    bytes: Box<[u8]>,
    nodes: Box<[Range<usize>]>,
}

impl ProcessImage {
    /// Zeroed payloads of the given lengths in octets.
    pub fn new(lengths: impl IntoIterator<Item = usize>) -> ProcessImage {
        let mut end = 0;
        let nodes: Box<[Range<usize>]> = lengths
            .into_iter()
            .map(|length| {
                let start = end;
                end += length;
                start..end
            })
            .collect();
        ProcessImage {
            bytes: vec![0; end].into(),
            nodes,
        }
    }

    /// Payload of one node.
    #[inline]
    pub fn node(&self, node: NodeIndex) -> &[u8] {
        &self.bytes[self.nodes[node].clone()]
    }

    /// Payload of one node, to be written.
    #[inline]
    pub fn node_mut(&mut self, node: NodeIndex) -> &mut [u8] {
        &mut self.bytes[self.nodes[node].clone()]
    }
}

/// What the nodes shall get.
pub type OutputImage = ProcessImage;

/// What came from the nodes; a lost answer leaves the last value in place.
#[derive(Clone, Debug)]
pub struct InputImage {
    pub payload: ProcessImage,
    /// For each node: polls in a row without an answer, 0 when this cycle's came.
    pub lost_in_row: Box<[u32]>,
    /// For each node: whether valid data came in this cycle.
    pub fresh: Box<[bool]>,
}

impl InputImage {
    /// Zeroed payloads of the given lengths in octets.
    pub fn new(lengths: impl IntoIterator<Item = usize>) -> InputImage {
        let payload = ProcessImage::new(lengths);
        let nodes = payload.nodes.len();
        InputImage {
            payload,
            lost_in_row: vec![0; nodes].into(),
            fresh: vec![false; nodes].into(),
        }
    }
}

/// Whose clock the dates of cycles follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimeReference {
    /// That of this PC: the nodes follow the frame that starts their cycle (POWERLINK: SoC).
    #[default]
    Ours,
    /// That of the bus, as one of its nodes keeps it (EtherCAT: distributed clocks).
    Bus {
        /// By how much this cycle began behind its date there, ns; below 0: before it.
        late_ns: i64,
    },
    /// That of the bus, which has not told its time in this cycle.
    Unheard,
}

impl TimeReference {
    /// By how much this cycle began behind its date by the clock of the bus, ns, where that is known.
    pub fn late_ns(self) -> Option<i64> {
        match self {
            TimeReference::Bus { late_ns } => Some(late_ns),
            TimeReference::Ours | TimeReference::Unheard => None,
        }
    }
}

/// What one exchange took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CycleReport {
    /// When the exchange began, ns of the bus clock.
    pub sent_ns: u64,
    /// When the frame that starts the cycle of the nodes (POWERLINK: SoC) was handed to the network adapter, ns of the bus
    /// clock; `None` in a cycle without one.
    pub started_ns: Option<u64>,
    /// When the exchange was over.
    pub done_ns: u64,
    /// Answers that did not come in this cycle.
    pub lost: u32,
    pub time: TimeReference,
}

/// The half of a bus that the cycle thread knows. RT: no call allocates, locks or waits beyond its deadline.
pub trait CyclicBus {
    /// Makes the cycle of the date `begin_ns` ready, so that its first frame only has to be sent when the date has come.
    /// Nothing is sent yet. Called again before [`CyclicBus::exchange`], it moves the cycle to a later date.
    fn prepare(&mut self, begin_ns: u64, outputs: &OutputImage);

    /// Runs the cycle that was made ready, its first frame at once, and returns with what has come by `deadline_ns` at the
    /// latest.
    fn exchange(&mut self, deadline_ns: u64, inputs: &mut InputImage) -> CycleReport;

    /// Serves what is not cyclic (parameters, alarms, node management) until `until_ns`.
    fn serve(&mut self, until_ns: u64);

    /// Time of the clock that deadlines refer to, ns.
    fn now_ns(&mut self) -> u64;

    /// State of a node.
    fn node_state(&self, node: NodeIndex) -> NodeState;

    /// State of the network.
    fn state(&self) -> BusState;

    /// Next thing that happened.
    fn pop_event(&mut self) -> Option<BusEvent>;

    /// Begins to bring the network down in an orderly way; goes on within the following cycles.
    fn shut_down(&mut self);

    /// Frames sent and lost so far for a node: polls, answers that did not come.
    fn statistics(&self, node: NodeIndex) -> NodeStatistics;

    /// Shows what it is like to its other half, and carries out what that asks of nodes: once in each cycle.
    fn publish(&mut self, cycle: u64);
}

/// A bus on the heap: one for many nodes is larger than what a stack should move about.
impl<B: CyclicBus + ?Sized> CyclicBus for Box<B> {
    fn prepare(&mut self, begin_ns: u64, outputs: &OutputImage) {
        (**self).prepare(begin_ns, outputs);
    }

    fn exchange(&mut self, deadline_ns: u64, inputs: &mut InputImage) -> CycleReport {
        (**self).exchange(deadline_ns, inputs)
    }

    fn serve(&mut self, until_ns: u64) {
        (**self).serve(until_ns);
    }

    fn now_ns(&mut self) -> u64 {
        (**self).now_ns()
    }

    fn node_state(&self, node: NodeIndex) -> NodeState {
        (**self).node_state(node)
    }

    fn state(&self) -> BusState {
        (**self).state()
    }

    fn pop_event(&mut self) -> Option<BusEvent> {
        (**self).pop_event()
    }

    fn shut_down(&mut self) {
        (**self).shut_down();
    }

    fn statistics(&self, node: NodeIndex) -> NodeStatistics {
        (**self).statistics(node)
    }

    fn publish(&mut self, cycle: u64) {
        (**self).publish(cycle);
    }
}

/// Polls of one node so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct NodeStatistics {
    pub polls: u64,
    /// Answers that came in time.
    pub answers: u64,
    /// Answers that did not come in time.
    pub lost: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn payloads_lie_side_by_side() {
        let mut image = ProcessImage::new([2, 0, 3]);
        image.node_mut(0).fill(1);
        image.node_mut(2).fill(3);
        assert_eq!(image.node(0), [1, 1]);
        assert!(image.node(1).is_empty());
        assert_eq!(image.node(2), [3, 3, 3]);
    }
}
