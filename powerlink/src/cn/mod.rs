//! The controlled node.
//!
//! In:  every frame that arrives at the node's interface, the time, the object dictionary of the device.
//! Out: the frame to be sent at once in answer (PRes, IdentResponse, StatusResponse, SDO) or at its time (a chained PRes), and
//!      [`Events`]: the synchronous instant, new outputs in the dictionary, NMT state changes, loss of the managing node.
//!
//! [`Cn`] does no I/O and asks for no time. A process that is several nodes holds one `Cn` for each and hands every frame to
//! all of them; each answers only what is meant for its node id. Frames that are not POWERLINK are the caller's.
//!
//! The device reads its outputs from the dictionary when [`Events::outputs`] is set and writes its inputs there; the next
//! PRes carries them. Mapping (0x1600.., 0x1A00), mapping versions, payload limits and cycle length become active by
//! ResetConfiguration and on the way to READY_TO_OPERATE.
//!
//! | file | what |
//! |---|---|
//! | `receive` | the way of a received frame |
//! | `state` | NMT state and resets |
//! | `supervision` | counters and thresholds of lost frames |
//! | `error` | history 0x1003 and error signalling |
//! | `pdo` | mappings and copy plans |
//! | `asynchronous` | answers to invitations and queues |
//! | `chaining` | PRes chaining |
//! | [`objects`], `keys`, `access` | the dictionary: table, handles, effects of SDO writes |

mod access;
mod asynchronous;
mod chaining;
mod error;
mod keys;
pub mod objects;
mod pdo;
mod receive;
mod state;
mod supervision;

use core::fmt;

use obd::{AbortCode, Dictionary, Key};

pub use crate::ethernet_queue::{ETHERNET_FRAMES, QueueError};
use crate::nmt::{NmtCommand, NmtState, Reset};
use crate::sdo::Server;
use crate::wire::{ErrorEntry, FRAME_LEN_MAX, Mac, NetTime, Soa, Soc, node};
use access::Access;
pub use asynchronous::NMT_REQUESTS;
use asynchronous::Outbox;
use chaining::Chaining;
pub use error::code as error_code;
use error::{Signalling, TYPE_OCCURRED};
use keys::Keys;
use pdo::Pdos;
pub use supervision::CycleError;
use supervision::Watch;

/// Network of all POWERLINK nodes: 192.168.100.0.
const IP_NETWORK: u32 = 0xC0A8_6400;

/// What makes a node this node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CnConfig<'a> {
    /// Node id, 1..=239.
    pub node_id: u8,
    /// MAC address that the node's frames carry.
    pub mac: Mac,
    /// 0x1000: profile number in the low word.
    pub device_type: u32,
    /// 0x1018/1.
    pub vendor_id: u32,
    /// 0x1018/2.
    pub product_code: u32,
    /// 0x1018/3.
    pub revision: u32,
    /// 0x1018/4.
    pub serial: u32,
    /// 0x1008, up to 32 octets.
    pub device_name: &'a str,
    /// 0x1F9A, up to 32 octets.
    pub host_name: &'a str,
    /// 0x1F98/3: the longest time from the end of a PReq to the start of the PRes in ns.
    pub pres_max_latency_ns: u32,
}

/// Why a node could not be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CnError {
    /// Node ids of controlled nodes are 1..=239.
    NodeId(u8),
    /// The dictionary lacks an object of [`objects::COMMUNICATION_PROFILE`], or a value of the configuration does not fit.
    Object {
        /// Index of the object.
        index: u16,
        /// Sub-index of the object.
        sub: u8,
        /// What is wrong with it.
        code: AbortCode,
    },
}

impl fmt::Display for CnError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            CnError::NodeId(id) => write!(f, "node id {id}: controlled nodes have 1..=239"),
            CnError::Object { index, sub, code } => write!(f, "object {index:#06X}/{sub}: {code}"),
        }
    }
}

impl core::error::Error for CnError {}

/// Which parameters 0x1010 or 0x1011 mean: their sub-index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StorageGroup {
    /// 1: all parameters.
    All,
    /// 2: 0x1000..0x1FFF.
    Communication,
    /// 3: 0x6000..0x9FFF.
    Application,
    /// 4: 0x2000..0x5FFF.
    Manufacturer,
}

impl StorageGroup {
    fn from_sub(sub: u8) -> Option<StorageGroup> {
        match sub {
            1 => Some(StorageGroup::All),
            2 => Some(StorageGroup::Communication),
            3 => Some(StorageGroup::Application),
            4 => Some(StorageGroup::Manufacturer),
            _ => None,
        }
    }
}

/// What an SDO asks of a device that can store parameters (see [`objects::STORAGE`]); the node itself stores nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// "save": values are to be kept over a power failure. The device hands them to
    /// [`Dictionary::set_default`] when it starts again.
    Store(StorageGroup),
    /// "load": the next reset brings the factory's values.
    Restore(StorageGroup),
}

/// What happened, for the device behind the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Events {
    /// A SoC arrived in a state with isochronous traffic or in STOPPED: this is the synchronous instant.
    pub sync: Option<Soc>,
    /// Valid outputs were copied into the dictionary.
    pub outputs: bool,
    /// The NMT state is another one than before the call.
    pub nmt_state: Option<NmtState>,
    /// A reset ran, entered at this depth. Objects of the device (from 0x2000) have their defaults again after
    /// [`Reset::Software`] and [`Reset::Node`].
    pub reset: Option<Reset>,
    /// SoCs that were due and did not arrive.
    pub soc_missed: u32,
    /// A counter reached its threshold and the node has left the isochronous states; the first one, where there are several.
    pub cycle_error: Option<CycleError>,
    /// An SDO wrote this object of the device (index from 0x2000); the last one, if several.
    pub written: Option<(u16, u8)>,
    /// The frame wrote other objects of the device before (WriteMultipleByIndex).
    pub written_several: bool,
    /// An SDO asks for parameters to be stored or restored.
    pub storage: Option<Storage>,
    /// The managing node does not serve this NMT request of the node (InvalidService).
    pub nmt_rejected: Option<NmtCommand>,
}

/// Answer of [`Cn::receive`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Reaction {
    /// Octets of `response` to be sent at once as an Ethernet frame; `None`: send nothing.
    pub transmit: Option<usize>,
    /// For the device behind the node.
    pub events: Events,
}

/// Judges an SDO write to an object of the device (index from 0x2000) after the dictionary has accepted it and before it is
/// stored.
pub type WriteCheck<const E: usize, const B: usize> = fn(&Dictionary<E, B>, u16, u8, &[u8]) -> Result<(), AbortCode>;

/// One controlled node with a dictionary of `E` lines and `B` octets.
#[derive(Clone, Debug)]
pub struct Cn<const E: usize, const B: usize> {
    node_id: u8,
    mac: Mac,
    dictionary: Dictionary<E, B>,
    keys: Keys,
    state: NmtState,
    check: Option<WriteCheck<E, B>>,
    sdo: Server,
    signalling: Signalling,
    pdos: Pdos,
    watch: Watch,
    chaining: Chaining,
    outbox: Outbox,
    /// 0x1F98/8 when the configuration was activated.
    async_mtu: u16,
    /// 0x1020/1 and /2 when the configuration was activated: which one is in use.
    configuration: (u32, u32),
    /// When NOT_ACTIVE ends for lack of frames.
    silent_at_ns: Option<u64>,
    /// The device may go to READY_TO_OPERATE.
    application_ready: bool,
    /// EnableReadyToOperate came before the device was ready.
    ready_requested: bool,
    /// A reset asked for by 0x1F9E, carried out when the SDO answer is on its way.
    reset_requested: Option<Reset>,
    /// Last ER of the managing node.
    exception_reset: bool,
    net_time: NetTime,
}

impl<const E: usize, const B: usize> Cn<E, B> {
    /// Builds the node and runs it through the reset cascade to NOT_ACTIVE. The dictionary has to contain
    /// [`objects::COMMUNICATION_PROFILE`].
    ///
    /// # Errors
    /// [`CnError`]: a node id out of range, a missing object, a name that is too long.
    pub fn new(config: &CnConfig<'_>, mut dictionary: Dictionary<E, B>, now_ns: u64) -> Result<Self, CnError> {
        if !(1..=node::CN_MAX).contains(&config.node_id) {
            return Err(CnError::NodeId(config.node_id));
        }
        let keys = Keys::find(&dictionary)?;
        let ip_address = IP_NETWORK | u32::from(config.node_id);
        let own: [(u16, u8, &[u8]); 11] = [
            (0x1000, 0, &config.device_type.to_le_bytes()),
            (0x1008, 0, config.device_name.as_bytes()),
            (0x1018, 1, &config.vendor_id.to_le_bytes()),
            (0x1018, 2, &config.product_code.to_le_bytes()),
            (0x1018, 3, &config.revision.to_le_bytes()),
            (0x1018, 4, &config.serial.to_le_bytes()),
            (0x1030, 5, &config.mac),
            (0x1E40, 2, &ip_address.to_le_bytes()),
            (0x1F93, 1, &[config.node_id]),
            (0x1F98, 3, &config.pres_max_latency_ns.to_le_bytes()),
            (0x1F9A, 0, config.host_name.as_bytes()),
        ];
        for (index, sub, octets) in own {
            dictionary
                .find(index, sub)
                .and_then(|handle| dictionary.set_default(handle, octets))
                .map_err(|code| CnError::Object { index, sub, code })?;
        }
        let mut cn = Cn {
            node_id: config.node_id,
            mac: config.mac,
            dictionary,
            keys,
            state: NmtState::Off,
            check: None,
            sdo: Server::new(),
            signalling: Signalling::new(),
            pdos: Pdos::EMPTY,
            watch: Watch::NONE,
            chaining: Chaining::default(),
            outbox: Outbox::new(),
            async_mtu: 0,
            configuration: (0, 0),
            silent_at_ns: None,
            application_ready: true,
            ready_requested: false,
            reset_requested: None,
            exception_reset: false,
            net_time: NetTime::default(),
        };
        cn.enter(NmtState::Initialising, now_ns, &mut Events::default());
        Ok(cn)
    }

    /// Node id (0x1F93/1).
    pub fn node_id(&self) -> u8 {
        self.node_id
    }

    /// NMT state (0x1F8C).
    pub fn nmt_state(&self) -> NmtState {
        self.state
    }

    /// The dictionary, for the device's outputs.
    pub fn dictionary(&self) -> &Dictionary<E, B> {
        &self.dictionary
    }

    /// The dictionary, for the device's inputs.
    pub fn dictionary_mut(&mut self) -> &mut Dictionary<E, B> {
        &mut self.dictionary
    }

    /// Has SDO writes to the objects of the device judged by `check`.
    pub fn set_write_check(&mut self, check: WriteCheck<E, B>) {
        self.check = Some(check);
    }

    /// Reports an error of the device: into the history 0x1003 and to the managing node. `profile` is the number of the device
    /// profile, as 402 (1 for a vendor's own codes).
    pub fn report_error(&mut self, profile: u16, code: u16, info: [u8; 8]) {
        let entry_type = TYPE_OCCURRED | (profile & 0x0FFF);
        let entry = ErrorEntry {
            entry_type,
            code,
            time: self.net_time,
            info,
        };
        error::record(&mut self.dictionary, &self.keys, &entry);
        self.count(self.keys.statistics.history_writes);
        let mut queued = false;
        self.signalling_step(|signalling| queued = signalling.push(entry));
        self.count(if queued {
            self.keys.statistics.queue_writes
        } else {
            self.keys.statistics.queue_overflows
        });
    }

    /// When [`poll`](Self::poll) and [`poll_transmit`](Self::poll_transmit) have to be called at the latest if no frame arrives
    /// before.
    pub fn next_deadline_ns(&self) -> Option<u64> {
        let at_once = (self.state == NmtState::BasicEthernet && self.outbox.has_frame()).then_some(0);
        [
            self.watch.soc_due_ns(),
            self.silent_at_ns,
            self.chaining.transmit_at_ns(),
            self.chaining.fall_back_at_ns(),
            at_once,
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Looks at the clock. RT: no allocation, no locks, bounded.
    pub fn poll(&mut self, now_ns: u64) -> Events {
        let mut events = Events::default();
        self.run_timers(now_ns, &mut events);
        events
    }

    /// Writes a frame into `response` that is due by the clock and not the answer to a frame: the PRes of a chained node at its
    /// time, and in BASIC_ETHERNET what [`send_ethernet`](Self::send_ethernet) has queued. `None`: nothing is due.
    /// RT: no allocation, no locks, bounded.
    pub fn poll_transmit(&mut self, now_ns: u64, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        if self.state == NmtState::BasicEthernet {
            return self.outbox.pop_frame(response);
        }
        self.poll_chained_pres(now_ns, response)
    }

    /// Does something with error signalling and counts what it did to EN.
    fn signalling_step(&mut self, step: impl FnOnce(&mut Signalling)) {
        let before = self.signalling.exception_new();
        step(&mut self.signalling);
        if self.signalling.exception_new() != before {
            self.count(self.keys.statistics.new_edges);
        }
    }

    /// EA and ER of a StatusRequest to this node.
    fn take_status_request(&mut self, soa: &Soa) {
        self.count(self.keys.telegrams.status_requests);
        if soa.exception_reset && !self.exception_reset {
            self.count(self.keys.statistics.reset_edges);
        }
        self.exception_reset = soa.exception_reset;
        self.signalling_step(|signalling| {
            signalling.acknowledge(soa.exception_acknowledge);
            signalling.reset(soa.exception_reset);
        });
    }

    fn set_error_register(&mut self, register: u8) {
        if self.dictionary.get(self.keys.error_register) != register {
            self.dictionary.set(self.keys.error_register, register);
            self.count(self.keys.statistics.static_changes);
        }
    }

    /// One more of what 0x1101 and 0x1102 count.
    fn count(&mut self, counter: Key<u32>) {
        let count = self.dictionary.get(counter);
        self.dictionary.set(counter, count.wrapping_add(1));
    }
}

#[cfg(test)]
mod tests;
