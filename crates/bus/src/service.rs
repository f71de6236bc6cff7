//! The half of a bus that is not real time: objects of nodes read and written for clients, and what the bus is like, in words.
//!
//! In:  requests. Out: replies, some cycles later; [`NetworkLive`] and [`NodeLive`], as they go through the control socket.

use super::NodeIndex;
use obd::AbortCode;
use serde::{Deserialize, Serialize};

/// Reads or writes one object of one node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MailboxRequest {
    /// Comes back with the reply.
    pub ticket: u64,
    pub node: NodeIndex,
    pub index: u16,
    pub sub: u8,
    /// What is written, at most [`super::SDO_VALUE_MAX`] octets; `None`: the object is read.
    pub value: Option<Vec<u8>>,
}

/// How a request ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MailboxReply {
    /// That of the request.
    pub ticket: u64,
    /// The value that was read; empty after a write.
    pub result: Result<Vec<u8>, MailboxError>,
}

/// Why an object was not read or written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MailboxError {
    /// The node refuses.
    Aborted(AbortCode),
    /// It did not get that far.
    Failed(String),
}

/// As many requests are under way as there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MailboxFull;

/// Objects of the nodes, while the cycle runs. Not RT.
pub trait Mailbox {
    /// Hands a request in; it is carried out within the following cycles.
    ///
    /// # Errors
    /// [`MailboxFull`].
    fn request(&mut self, request: MailboxRequest) -> Result<(), MailboxFull>;

    /// The next request that has ended.
    fn reply(&mut self) -> Option<MailboxReply>;
}

/// What the bus is like. Not RT. `now_ns` is the time of the bus's clock, for "since 3.2 s".
pub trait Diagnose {
    /// The network as a whole; `None`: not known yet.
    fn network(&mut self, now_ns: u64) -> Option<NetworkLive>;

    /// One node; `None`: not known yet, or there is none.
    fn node(&mut self, node: NodeIndex, now_ns: u64) -> Option<NodeLive>;
}

pub trait BusService: Mailbox + Diagnose + Send {}

impl<T: Mailbox + Diagnose + Send> BusService for T {}

/// One part of the cycle, us.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BudgetView {
    /// What it is for.
    pub part: String,
    /// The node that it is for.
    pub node: Option<u8>,
    /// Frames on the wire.
    pub wire_us: f64,
    /// Latency of the node; where it has not told one, what its time-out leaves for it.
    pub latency_us: f64,
    /// The longest it can take.
    pub worst_us: f64,
}

/// The network as it is now.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NetworkLive {
    /// State of the managing node.
    pub nmt_state: String,
    /// Why it is not OPERATIONAL.
    pub why: Option<String>,
    /// Another managing node that was heard: its MAC and how many frames.
    pub foreign: Option<String>,
    pub cycles: u64,
    /// Cycles left out because the next one was started too late.
    pub cycles_skipped: u64,
    /// Cycles cut off by the next one.
    pub cycles_overrun: u64,
    /// Asynchronous slots whose answer did not come in time.
    pub async_timeouts: u64,
    /// Frames that could not be read, or that nobody had asked for.
    pub bad_frames: u64,
}

/// A node as it is now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodeLive {
    /// Process data are valid.
    pub operational: bool,
    /// State that the node reported last.
    pub nmt_state: String,
    /// State it should be in (0x1F8F).
    pub expected_nmt_state: String,
    /// Where its boot-up stands.
    pub stage: String,
    /// Why it is not operational.
    pub why: Option<Why>,
    /// The last thing that went wrong, also when it is operational again.
    pub last_fault: Option<String>,
    /// What it said it is.
    pub identity: Option<IdentityView>,
    /// The last errors it signalled, the newest first.
    pub errors: Vec<String>,
    /// Errors it signalled since the start.
    pub errors_total: u64,
    pub polls: u64,
    /// PReqs without a PRes in time.
    pub lost: u64,
    /// Longest row of lost PRes.
    pub lost_in_row_max: u32,
    /// PRes that came too late.
    pub late: u64,
    /// PRes whose data were too short or of another mapping version.
    pub refused: u64,
    /// Longest time from PReq to PRes, us.
    pub response_max_us: f64,
    pub boots: u64,
    /// Times it was given up.
    pub faults: u64,
}

/// Why a node is not operational.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Why {
    pub text: String,
    /// The object that it is about.
    pub object: Option<String>,
    /// Its value as it should be.
    pub expected: Option<String>,
    /// Its value as it is.
    pub actual: Option<String>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "named as the fields of the IdentResponse")]
pub struct IdentityView {
    pub device_type: u32,
    pub vendor_id: u32,
    pub product_code: u32,
    pub revision: u32,
    pub serial: u32,
    pub feature_flags: u32,
    pub response_time_us: f64,
    pub mtu: u16,
    pub poll_in_octets: u16,
    pub poll_out_octets: u16,
    pub configuration_date: u32,
    pub configuration_time: u32,
    pub software_date: u32,
    pub software_time: u32,
    pub ip_address: String,
    pub host_name: String,
}

/// `0x1006` or `0x1018/1`.
pub fn object(index: u16, sub: u8) -> String {
    match sub {
        0 => format!("0x{index:04X}"),
        sub => format!("0x{index:04X}/{sub}"),
    }
}

/// `01:11:1e:00:00:01`
pub fn mac(mac: [u8; 6]) -> String {
    mac.map(|octet| format!("{octet:02x}")).join(":")
}
