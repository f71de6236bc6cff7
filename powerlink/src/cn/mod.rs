//! The controlled node.
//!
//! In:  every frame that arrives at the node's interface, the time, the object dictionary of the device.
//! Out: the frame to be sent at once in answer (PRes, IdentResponse, StatusResponse, SDO), and [`Events`]: the synchronous
//!      instant, new outputs in the dictionary, NMT state changes, loss of the managing node.
//!
//! [`Cn`] does no I/O and asks for no time. A process that is several nodes holds one `Cn` for each and hands every frame to
//! all of them; each answers only what is meant for its node id.
//!
//! The device reads its outputs from the dictionary when [`Events::outputs`] is set and writes its inputs there; the next
//! PRes carries them. Mapping (0x1600, 0x1A00), mapping versions, payload limits and cycle length become active by
//! ResetConfiguration and on the way to READY_TO_OPERATE.

mod access;
mod error;
pub mod objects;
mod pdo;

use core::fmt;

use obd::{AbortCode, Dictionary};

use crate::nmt::{self, CnEvent, NmtCommand, NmtState, Reset};
use crate::sdo::{SERVICE_DATA_MAX, Server};
use crate::wire::{
    Asnd, ErrorEntries, ErrorEntry, FRAME_LEN_MAX, Frame, Header, IdentResponse, Mac, NetTime, NmtCommandFrame,
    PAYLOAD_MAX, Preq, Pres, RequestedService, Requests, Soa, Soc, StatusResponse, multicast, node,
};
use access::{Access, FIRST_DEVICE_OBJECT};
pub use error::code as error_code;
use error::{PROFILE_COMMUNICATION, Signalling, TYPE_OCCURRED};
use objects::{HOST_NAME_LEN, Keys};
use pdo::{Pdos, Received};

/// Bits of the error register 0x1001 that a loss of communication sets: generic and communication.
const REGISTER_COMMUNICATION: u8 = 0x11;
/// Network of all POWERLINK nodes: 192.168.100.0.
const IP_NETWORK: u32 = 0xC0A8_6400;
/// Missed cycles that one look at the clock counts at most; bounds the work after a long pause.
const MISSED_PER_LOOK: u32 = 32;

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
        /// Object index.
        index: u16,
        /// Sub-index.
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

/// Which regular frame of the managing node stayed away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loss {
    /// SoC, threshold 0x1C0B/3.
    Soc,
    /// PReq, threshold 0x1C0D/3.
    Preq,
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
    /// Frames of the managing node stayed away so often that the node has left the isochronous states.
    pub communication_lost: Option<Loss>,
    /// An SDO wrote this object of the device (index from 0x2000).
    pub written: Option<(u16, u8)>,
}

/// Answer of [`Cn::receive`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Reaction {
    /// Octets of `response` to be sent at once as an Ethernet frame; `None`: send nothing.
    pub transmit: Option<usize>,
    /// What happened.
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
    /// 0x1006 when the configuration was activated; 0 switches the watch over the SoC off.
    cycle_ns: u64,
    /// When the next SoC is overdue.
    soc_due_ns: Option<u64>,
    /// When NOT_ACTIVE ends for lack of frames.
    silent_at_ns: Option<u64>,
    /// A PReq came since the last SoC.
    polled: bool,
    /// The node is polled in every cycle: PReqs came, and the last one was not for a multiplexed slot.
    polled_every_cycle: bool,
    /// The device may go to READY_TO_OPERATE.
    application_ready: bool,
    /// EnableReadyToOperate came before the device was ready.
    ready_requested: bool,
    /// A reset asked for by 0x1F9E, carried out when the SDO answer is on its way.
    reset_requested: Option<Reset>,
    net_time: NetTime,
}

impl<const E: usize, const B: usize> Cn<E, B> {
    /// Builds the node and runs it through the reset cascade to NOT_ACTIVE. The dictionary has to contain
    /// [`objects::COMMUNICATION_PROFILE`].
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
            cycle_ns: 0,
            soc_due_ns: None,
            silent_at_ns: None,
            polled: false,
            polled_every_cycle: false,
            application_ready: true,
            ready_requested: false,
            reset_requested: None,
            net_time: NetTime::default(),
        };
        cn.enter(NmtState::Initialising, now_ns, &mut Events::default());
        Ok(cn)
    }

    /// Node id.
    pub fn node_id(&self) -> u8 {
        self.node_id
    }

    /// NMT state.
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

    /// Says whether the device is ready for operation (true from the start). READY_TO_OPERATE is entered when the managing
    /// node allows it and this is true.
    pub fn set_application_ready(&mut self, now_ns: u64, ready: bool) -> Events {
        let mut events = Events::default();
        self.application_ready = ready;
        if ready && self.ready_requested {
            self.event(CnEvent::ReadyToOperate, now_ns, &mut events);
        }
        events
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
        self.signalling.push(entry);
    }

    /// When [`poll`](Self::poll) has to be called at the latest if no frame arrives before.
    pub fn next_deadline_ns(&self) -> Option<u64> {
        match (self.soc_due_ns, self.silent_at_ns) {
            (Some(soc_ns), Some(silent_ns)) => Some(soc_ns.min(silent_ns)),
            (due_ns, None) | (None, due_ns) => due_ns,
        }
    }

    /// Looks at the clock. RT: no allocation, no locks, bounded.
    pub fn poll(&mut self, now_ns: u64) -> Events {
        let mut events = Events::default();
        self.run_timers(now_ns, &mut events);
        events
    }

    /// Takes one received Ethernet frame that arrived at `now_ns` (the receive stamp, where there is one: the watch over the SoC
    /// depends on it), and writes the frame that has to be sent at once into `response`. Frames that are
    /// malformed or meant for others change nothing. RT: no allocation, no locks, bounded.
    pub fn receive(&mut self, now_ns: u64, frame: &[u8], response: &mut [u8; FRAME_LEN_MAX]) -> Reaction {
        let mut reaction = Reaction::default();
        self.run_timers(now_ns, &mut reaction.events);
        let (Ok(header), Ok(frame)) = (Header::parse(frame), Frame::parse(frame)) else {
            return reaction;
        };
        let from_mn = header.source_node == node::MN;
        let to_us = header.destination_node == self.node_id;
        let events = &mut reaction.events;
        match frame {
            Frame::Soc(soc) if from_mn => self.receive_soc(now_ns, soc, events),
            Frame::Soa(soa) if from_mn => reaction.transmit = self.receive_soa(now_ns, &soa, response, events),
            Frame::Preq(preq) if from_mn => {
                self.hear(CnEvent::PollFrame, now_ns, events);
                if to_us {
                    reaction.transmit = self.receive_preq(&preq, response, events);
                }
            }
            Frame::Pres(pres) if header.source_node != self.node_id => {
                self.hear(CnEvent::PollFrame, now_ns, events);
                self.receive_pres(header.source_node, &pres, events);
            }
            Frame::Asnd(Asnd::NmtCommand(command))
                if from_mn && (to_us || header.destination_node == node::BROADCAST) =>
            {
                self.receive_nmt_command(now_ns, &command, events);
            }
            Frame::Asnd(Asnd::Sdo(service_data)) if to_us && self.communicates() => {
                self.receive_sdo(header.source_node, service_data, events);
            }
            Frame::Soc(_)
            | Frame::Soa(_)
            | Frame::Preq(_)
            | Frame::Pres(_)
            | Frame::Asnd(
                Asnd::NmtCommand(_)
                | Asnd::Sdo(_)
                | Asnd::IdentResponse(_)
                | Asnd::StatusResponse(_)
                | Asnd::NmtRequest(_)
                | Asnd::SyncResponse(_)
                | Asnd::Other(_),
            )
            | Frame::Amni(_)
            | Frame::Ainv(_) => {}
        }
        reaction
    }

    fn receive_soc(&mut self, now_ns: u64, soc: Soc, events: &mut Events) {
        self.net_time = soc.net_time;
        self.hear(CnEvent::Soc, now_ns, events);
        if !self.expects_soc() {
            return;
        }
        events.sync = Some(soc);
        self.keys.loss_of_soc.good(&mut self.dictionary);
        self.watch_soc(now_ns);
        let exchanges = matches!(self.state, NmtState::ReadyToOperate | NmtState::Operational);
        if exchanges && self.polled_every_cycle && !self.polled && self.keys.loss_of_preq.error(&mut self.dictionary) {
            self.lose(Loss::Preq, now_ns, events);
        }
        self.polled = false;
    }

    fn receive_preq(
        &mut self,
        preq: &Preq<'_>,
        response: &mut [u8; FRAME_LEN_MAX],
        events: &mut Events,
    ) -> Option<usize> {
        if !self.state.is_isochronous() {
            return None;
        }
        self.polled = true;
        self.polled_every_cycle = !preq.multiplexed;
        self.keys.loss_of_preq.good(&mut self.dictionary);
        self.signalling.acknowledge(preq.exception_acknowledge);
        if self.pdos.receive_from == 0 {
            self.receive_pdo(preq.pdo_version, preq.payload, preq.ready, events);
        }
        let mut payload = [0; PAYLOAD_MAX];
        self.pdos.transmit(&self.dictionary, &mut payload);
        let pres = Pres {
            nmt_state: self.state,
            multiplexed: preq.multiplexed,
            exception_new: self.signalling.exception_new(),
            ready: self.state == NmtState::Operational,
            requests: self.requests(),
            pdo_version: self.pdos.transmit_version,
            payload: &payload[..self.pdos.transmit_octets()],
        };
        let header = Header::multicast(multicast::PRES, self.mac, self.node_id);
        pres.emit(&header, self.pdos.transmit_limit, response).ok()
    }

    fn receive_pres(&mut self, from: u8, pres: &Pres<'_>, events: &mut Events) {
        if from == self.pdos.receive_from && self.state.is_isochronous() {
            self.receive_pdo(pres.pdo_version, pres.payload, pres.ready, events);
        }
    }

    fn receive_pdo(&mut self, version: u8, payload: &[u8], ready: bool, events: &mut Events) {
        let operational = self.state == NmtState::Operational;
        if !operational && self.state != NmtState::ReadyToOperate {
            return;
        }
        match self
            .pdos
            .receive(&mut self.dictionary, version, payload, ready, operational)
        {
            Received::Valid => events.outputs = true,
            Received::NewFault(code) => self.report_error(PROFILE_COMMUNICATION, code, [0; 8]),
            Received::Ignored | Received::SameFault => {}
        }
    }

    fn receive_soa(
        &mut self,
        now_ns: u64,
        soa: &Soa,
        response: &mut [u8; FRAME_LEN_MAX],
        events: &mut Events,
    ) -> Option<usize> {
        self.hear(CnEvent::Soa, now_ns, events);
        if soa.target != self.node_id || !self.communicates() {
            return None;
        }
        match soa.service {
            RequestedService::IdentRequest => self.emit_ident(response),
            RequestedService::StatusRequest => {
                // The answer still shows the flags as they were before this request.
                let len = self.emit_status(response);
                self.signalling.acknowledge(soa.exception_acknowledge);
                self.signalling.reset(soa.exception_reset);
                len
            }
            RequestedService::UnspecifiedInvite => self.emit_sdo(response),
            // This node never asks for an NMT service, and does not take part in PRes chaining.
            RequestedService::NoService
            | RequestedService::NmtRequestInvite
            | RequestedService::SyncRequest
            | RequestedService::Unknown(_) => None,
        }
    }

    fn receive_nmt_command(&mut self, now_ns: u64, frame: &NmtCommandFrame, events: &mut Events) {
        if frame.command.plain().is_some() && !frame.nodes().contains(self.node_id) {
            return;
        }
        match (frame.command, frame.command.cn_event()) {
            (_, Some(CnEvent::ReadyToOperate)) if !self.application_ready => {
                self.ready_requested = self.state == NmtState::PreOperational2;
            }
            (_, Some(event)) => self.event(event, now_ns, events),
            (NmtCommand::NetHostNameSet, None) => self.set_host_name(&frame.data),
            (_, None) => {}
        }
    }

    fn receive_sdo(&mut self, client: u8, service_data: &[u8], events: &mut Events) {
        let mut access = Access {
            dictionary: &mut self.dictionary,
            keys: &self.keys,
            state: self.state,
            check: self.check,
            written: None,
            reset: None,
        };
        self.sdo.receive(client, service_data, &mut access);
        let Access { written, reset, .. } = access;
        events.written = written.filter(|(index, _)| *index >= FIRST_DEVICE_OBJECT);
        if reset.is_some() {
            self.reset_requested = reset;
        }
    }

    fn emit_ident(&self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let (dictionary, keys) = (&self.dictionary, &self.keys);
        let mut host_name = [0; HOST_NAME_LEN];
        let name = dictionary.read(0x1F9A, 0).unwrap_or(&[]);
        host_name[..name.len()].copy_from_slice(name);
        let ident = IdentResponse {
            requests: self.requests(),
            nmt_state: self.state,
            feature_flags: dictionary.get(keys.feature_flags),
            mtu: dictionary.get(keys.async_mtu),
            poll_in_size: dictionary.get(keys.receive.payload_limit),
            poll_out_size: dictionary.get(keys.transmit.payload_limit),
            response_time_ns: dictionary.get(keys.pres_max_latency_ns),
            device_type: dictionary.get(keys.device_type),
            vendor_id: dictionary.get(keys.identity[0]),
            product_code: dictionary.get(keys.identity[1]),
            revision: dictionary.get(keys.identity[2]),
            serial: dictionary.get(keys.identity[3]),
            configuration_date: dictionary.get(keys.configuration_date),
            configuration_time: dictionary.get(keys.configuration_time),
            software_date: dictionary.get(keys.software_date),
            software_time: dictionary.get(keys.software_time),
            ip_address: dictionary.get(keys.ip_address),
            subnet_mask: dictionary.get(keys.subnet_mask),
            default_gateway: dictionary.get(keys.default_gateway),
            host_name,
            ..IdentResponse::default()
        };
        let header = Header::multicast(multicast::ASND, self.mac, self.node_id);
        Asnd::IdentResponse(ident).emit(&header, response).ok()
    }

    fn emit_status(&self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let mut static_errors = [0; 8];
        static_errors[0] = self.dictionary.get(self.keys.error_register);
        let status = StatusResponse {
            exception_clear: self.signalling.exception_clear(),
            exception_new: self.signalling.exception_new(),
            requests: self.requests(),
            nmt_state: self.state,
            static_errors,
            entries: ErrorEntries(self.signalling.entries()),
        };
        let header = Header::multicast(multicast::ASND, self.mac, self.node_id);
        Asnd::StatusResponse(status).emit(&header, response).ok()
    }

    fn emit_sdo(&mut self, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let mut service_data = [0; SERVICE_DATA_MAX];
        let (client, len) = self.sdo.poll_transmit(&mut service_data)?;
        let header = Header {
            destination: multicast::ASND,
            source: self.mac,
            destination_node: client,
            source_node: self.node_id,
        };
        Asnd::Sdo(&service_data[..len]).emit(&header, response).ok()
    }

    /// RS and PR: SDO frames that wait for an invitation.
    fn requests(&self) -> Requests {
        match self.sdo.pending() {
            0 => Requests::default(),
            pending => Requests {
                count: pending.min(7) as u8,
                priority: Requests::PRIORITY_GENERIC,
            },
        }
    }

    /// Whether the node may send when it is invited.
    fn communicates(&self) -> bool {
        self.state == NmtState::PreOperational1 || self.expects_soc()
    }

    /// Whether the isochronous cycle runs for this node.
    fn expects_soc(&self) -> bool {
        self.state.is_isochronous() || self.state == NmtState::Stopped
    }

    /// A frame of a managing node, or of another node's isochronous traffic.
    fn hear(&mut self, event: CnEvent, now_ns: u64, events: &mut Events) {
        if self.state == NmtState::NotActive {
            self.watch_silence(now_ns);
        }
        self.event(event, now_ns, events);
    }

    fn run_timers(&mut self, now_ns: u64, events: &mut Events) {
        if self.sdo.pending() == 0
            && let Some(reset) = self.reset_requested.take()
        {
            self.event(CnEvent::Reset(reset), now_ns, events);
        }
        if self.silent_at_ns.is_some_and(|at_ns| now_ns >= at_ns) {
            self.silent_at_ns = None;
            self.event(CnEvent::BasicEthernetTimeout, now_ns, events);
        }
        for look in 0..=MISSED_PER_LOOK {
            let Some(due_ns) = self.soc_due_ns.filter(|due_ns| now_ns >= *due_ns) else {
                return;
            };
            if look == MISSED_PER_LOOK {
                self.soc_due_ns = Some(now_ns.saturating_add(self.cycle_ns));
                return;
            }
            self.soc_due_ns = Some(due_ns.saturating_add(self.cycle_ns));
            events.soc_missed += 1;
            if self.keys.loss_of_soc.error(&mut self.dictionary) {
                self.lose(Loss::Soc, now_ns, events);
            }
        }
    }

    /// A threshold was reached: the error is reported, and the node waits in PRE_OPERATIONAL_1 for the managing node.
    fn lose(&mut self, loss: Loss, now_ns: u64, events: &mut Events) {
        let code = match loss {
            Loss::Soc => error_code::LOSS_SOC_THRESHOLD,
            Loss::Preq => error_code::LOSS_PREQ_THRESHOLD,
        };
        let register = self.dictionary.get(self.keys.error_register) | REGISTER_COMMUNICATION;
        self.dictionary.set(self.keys.error_register, register);
        self.report_error(PROFILE_COMMUNICATION, code, [0; 8]);
        events.communication_lost = Some(loss);
        self.event(CnEvent::CycleError, now_ns, events);
    }

    fn event(&mut self, event: CnEvent, now_ns: u64, events: &mut Events) {
        if let Some(next) = nmt::cn_next(self.state, event) {
            if let CnEvent::Reset(reset) = event {
                events.reset = Some(reset);
            }
            self.enter(next, now_ns, events);
        }
    }

    /// Enters a state and runs through the reset cascade from there.
    fn enter(&mut self, first: NmtState, now_ns: u64, events: &mut Events) {
        self.ready_requested = false;
        let mut next = Some(first);
        // At most the four steps of the cascade and NOT_ACTIVE.
        while let Some(state) = next {
            self.state = state;
            self.enter_one(state, now_ns);
            next = nmt::cascade(state);
        }
        if !self.expects_soc() {
            self.soc_due_ns = None;
            self.polled_every_cycle = false;
        }
        if self.state != NmtState::NotActive {
            self.silent_at_ns = None;
        }
        self.dictionary.set(self.keys.nmt_state, self.state.into());
        events.nmt_state = Some(self.state);
    }

    fn enter_one(&mut self, state: NmtState, now_ns: u64) {
        match state {
            NmtState::ResetApplication => self.dictionary.restore_defaults(FIRST_DEVICE_OBJECT, 0xFFFF),
            NmtState::ResetCommunication => {
                self.dictionary.restore_defaults(0x1000, FIRST_DEVICE_OBJECT - 1);
                self.sdo.reset();
                self.signalling = Signalling::new();
                self.reset_requested = None;
            }
            NmtState::ResetConfiguration | NmtState::ReadyToOperate => self.activate_configuration(),
            NmtState::NotActive => self.watch_silence(now_ns),
            NmtState::Operational => {
                let register = self.dictionary.get(self.keys.error_register) & !REGISTER_COMMUNICATION;
                self.dictionary.set(self.keys.error_register, register);
            }
            NmtState::Off
            | NmtState::Initialising
            | NmtState::BasicEthernet
            | NmtState::PreOperational1
            | NmtState::PreOperational2
            | NmtState::Stopped
            | NmtState::Unknown(_) => {}
        }
    }

    fn activate_configuration(&mut self) {
        self.pdos = Pdos::activate(&self.dictionary, &self.keys.receive, &self.keys.transmit);
        self.cycle_ns = u64::from(self.dictionary.get(self.keys.cycle_us)) * 1000;
    }

    fn watch_soc(&mut self, now_ns: u64) {
        let tolerance_ns = u64::from(self.dictionary.get(self.keys.soc_tolerance_ns));
        self.soc_due_ns =
            (self.cycle_ns > 0).then(|| now_ns.saturating_add(self.cycle_ns).saturating_add(tolerance_ns));
    }

    fn watch_silence(&mut self, now_ns: u64) {
        let silence_ns = u64::from(self.dictionary.get(self.keys.basic_ethernet_us)) * 1000;
        self.silent_at_ns = (silence_ns > 0).then(|| now_ns.saturating_add(silence_ns));
    }

    /// NetHostNameSet: up to the first zero.
    fn set_host_name(&mut self, data: &[u8]) {
        let len = data.iter().position(|octet| *octet == 0).unwrap_or(data.len());
        if let Ok(handle) = self.dictionary.find(0x1F9A, 0) {
            // Command data are as long as the object.
            let _ = self.dictionary.set_octets(handle, &data[..len]);
        }
    }
}

#[cfg(test)]
mod tests;
