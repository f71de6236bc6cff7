//! EtherCAT as a [`CyclicBus`]: the main device of `ethercat::main` over a link.
//!
//! In:  images once a cycle. Out: frames on the link; the main device decides which and when, this file only waits and hands over.
//!
//! RT except for [`Ethercat::new`].

pub mod frames;
pub mod open;
mod publisher;
mod remark;
mod service;
pub mod setup;

pub use remark::{Names, Remark};

use super::powerlink::link_failure;
use super::watch::Watch;
use super::{
    BusEvent, BusState, CycleReport, CyclicBus, InputImage, NodeIndex, NodeState, NodeStatistics, OutputImage,
    TimeReference, in_the_kernel,
};
use config::Identity;
use ethercat::main::config::Config as Network;
use ethercat::main::{DeviceState, Event, MainDevice, SetupError};
use ethercat::wire::register::AlState;
use ethercat::wire::{FRAME_LEN_MAX, MAC_PASSED, WireError};
use machine::faults::ForeignMaster;
use powerlink::link::{Link, LinkError};
use publisher::Publisher;
use service::EthercatService;
use std::sync::Arc;

/// A service frame is not sent later than this before the end of its time, ns: its answer comes before the next cycle.
const SERVICE_NS: u64 = 60_000;

/// States that a device can tell.
pub fn node_states() -> impl Iterator<Item = String> {
    [
        AlState::Init,
        AlState::PreOp,
        AlState::Boot,
        AlState::SafeOp,
        AlState::Op,
    ]
    .iter()
    .map(ToString::to_string)
}

/// What a node has done so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counted {
    polls: u64,
    answers: u64,
    lost: u64,
    lost_in_row_max: u32,
    /// Working counters that were neither 0 nor right.
    refused: u64,
    /// Longest time from the frame to its answer, ns.
    response_ns_max: u64,
    boots: u64,
    faults: u64,
    last_fault: Option<Event>,
    /// Errors that it reported.
    errors: u64,
    last_error: Option<u16>,
}

/// Where the end of the network is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// It runs.
    No,
    /// All devices are to be asked to go to INIT.
    Wanted,
    /// They were.
    Done,
}

/// The main device on a link, with room for `N` devices on the wire and `F` frames a cycle.
pub struct Ethercat<'a, L, const N: usize, const F: usize> {
    main: MainDevice<'a, N, F>,
    link: L,
    /// Told of every cycle; its time-out thread may forbid more of them.
    watch: Arc<Watch>,
    buffer: [u8; FRAME_LEN_MAX],
    link_error: Option<LinkError>,
    /// Length of a cycle, ns.
    cycle_ns: u64,
    /// The cycle follows the clock of the bus, where there is one.
    follows: bool,
    /// There was a clock of the bus.
    has_followed: bool,
    /// Date of the cycle that was made ready and has not been run; its frames.
    ready: Option<(u64, usize)>,
    /// Whether the machine needs a node.
    mandatory: Box<[bool]>,
    counted: Box<[Counted]>,
    /// All mandatory nodes were operational.
    was_operational: bool,
    end: End,
    publisher: Option<Publisher>,
    reported: BusState,
    /// Comes behind the remark that was told.
    next_event: Option<BusEvent>,
}

impl<'a, L: Link, const N: usize, const F: usize> Ethercat<'a, L, N, F> {
    /// A main device that has sent nothing yet. `follows`: the cycle follows the clock of the bus; `mandatory`: for each node,
    /// whether the machine needs it.
    ///
    /// # Errors
    /// More devices than `N`, more frames than `F`.
    pub fn new(
        network: &'a Network<'a>,
        mac: [u8; 6],
        link: L,
        watch: Arc<Watch>,
        follows: bool,
        mandatory: impl IntoIterator<Item = bool>,
    ) -> Result<Self, WireError> {
        // Devices mark what has passed them by this bit of the source; ours must not have it.
        let [first, rest @ ..] = mac;
        let [a, b, c, d, e] = rest;
        let main = MainDevice::new([first & !MAC_PASSED, a, b, c, d, e], network)?;
        let mandatory: Box<[bool]> = mandatory.into_iter().collect();
        Ok(Ethercat {
            main,
            link,
            watch,
            buffer: [0; FRAME_LEN_MAX],
            link_error: None,
            cycle_ns: network.cycle_ns.into(),
            follows,
            has_followed: false,
            ready: None,
            counted: vec![Counted::default(); mandatory.len()].into(),
            mandatory,
            was_operational: false,
            end: End::No,
            publisher: None,
            reported: BusState::Down,
            next_event: None,
        })
    }

    /// Its other half. Not RT.
    pub fn service(&mut self) -> EthercatService {
        let (publisher, service) = publisher::rings(self.counted.len());
        self.publisher = Some(publisher);
        service
    }

    /// The link, for tests that steer a simulated wire.
    pub fn link_mut(&mut self) -> &mut L {
        &mut self.link
    }

    /// The main device, for diagnosis.
    pub fn main(&self) -> &MainDevice<'a, N, F> {
        &self.main
    }

    /// Sends the frame of a service, if there is one and none is under way.
    fn send_service(&mut self, now_ns: u64) {
        if let Some(frame) = self.main.service_frame(now_ns)
            && let Err(error) = in_the_kernel(|| self.link.send(frame))
        {
            self.link_error = Some(error);
        }
    }

    /// Waits for a frame and hands it over; whether one came.
    fn receive(&mut self, until_ns: u64) -> bool {
        match in_the_kernel(|| self.link.receive(&mut self.buffer, until_ns)) {
            Ok(Some(received)) => {
                let now_ns = self.link.now_ns();
                let length = received.length.min(FRAME_LEN_MAX);
                self.main.receive(now_ns, &self.buffer[..length]);
                true
            }
            Ok(None) => false,
            Err(error) => {
                self.link_error = Some(error);
                false
            }
        }
    }

    /// Whether all nodes that the machine needs are operational.
    fn is_operational(&self) -> bool {
        let mut nodes = self.mandatory.iter().enumerate();
        nodes.all(|(node, mandatory)| !mandatory || self.main.device_state(node) == DeviceState::Operational)
    }

    /// Counts what happened to a node.
    fn count(&mut self, event: Event) {
        let device = match event {
            Event::Up { device }
            | Event::Left { device, .. }
            | Event::Lost { device, .. }
            | Event::Failed { device, .. }
            | Event::Emergency { device, .. } => device,
            _ => return,
        };
        let Some(counted) = self.counted.get_mut(usize::from(device)) else {
            return;
        };
        match event {
            Event::Up { .. } => counted.boots += 1,
            Event::Emergency { emergency, .. } => {
                counted.errors += 1;
                counted.last_error = Some(emergency.code);
            }
            _ => {
                counted.faults += 1;
                counted.last_fault = Some(event);
            }
        }
    }

    /// The event in the words of the control, and what follows from it.
    fn translate(&self, event: Event) -> (BusEvent, Option<BusEvent>) {
        let remark = BusEvent::Remark(Remark(event));
        match event {
            Event::Stranger { position, identity } => {
                let stranger = BusEvent::Stranger {
                    id: u8::try_from(position + 1).unwrap_or(u8::MAX),
                    identity: Identity {
                        device_type: None,
                        vendor_id: Some(identity.vendor),
                        product_code: Some(identity.product),
                        revision: Some(identity.revision),
                        serial: Some(identity.serial),
                    },
                };
                (stranger, None)
            }
            Event::Identified { device, .. } => (BusEvent::Identified(device.into()), None),
            Event::Failed { device, error } => {
                failed(device.into(), error).map_or((remark, None), |event| (event, None))
            }
            Event::Up { device } => (BusEvent::NodeUp(device.into()), None),
            Event::Left { device, .. } | Event::Lost { device, .. } => {
                (remark, Some(BusEvent::NodeLost(device.into())))
            }
            Event::Emergency { device, emergency } => {
                let (node, code) = (device.into(), emergency.code);
                (BusEvent::NodeError { node, code }, None)
            }
            Event::OtherMain { source } => {
                let sign = ForeignMaster {
                    node: None,
                    mac: source,
                    is_itself: true,
                };
                (BusEvent::ForeignMaster(sign), None)
            }
            Event::Silent { .. }
            | Event::Unsteady { .. }
            | Event::Found { .. }
            | Event::TooMany { .. }
            | Event::Slow { .. }
            | Event::Lacks { .. }
            | Event::More { .. }
            | Event::Broken(_)
            | Event::Spoilt { .. }
            | Event::OrderChanged { .. } => (remark, None),
        }
    }
}

/// Why a node does not come up, where every bus has it.
fn failed(node: NodeIndex, error: SetupError) -> Option<BusEvent> {
    Some(match error {
        SetupError::Missing(_) => BusEvent::Missing(node),
        SetupError::WrongIdentity { expected, found } => {
            let fields = [
                (1, expected.vendor, found.vendor),
                (2, expected.product, found.product),
                (3, expected.revision, found.revision),
                (4, expected.serial, found.serial),
            ];
            let mut differ = fields.into_iter().filter_map(|(sub, expected, got)| {
                let expected = expected.filter(|expected| *expected != got)?;
                Some((sub, expected, got))
            });
            let (sub, expected, got) = differ.next()?;
            BusEvent::WrongIdentity {
                node,
                object: (0x1018, sub),
                expected,
                got,
            }
        }
        SetupError::Sdo { object, code } => BusEvent::ConfigurationRefused {
            node,
            object: (object.index, object.sub),
            abort: code,
        },
        SetupError::Differs {
            object,
            expected,
            found,
        } => BusEvent::WrongValue {
            node,
            object: (object.index, object.sub),
            expected,
            got: found,
        },
        _ => return None,
    })
}

impl<L: Link, const N: usize, const F: usize> CyclicBus for Ethercat<'_, L, N, F> {
    fn prepare(&mut self, begin_ns: u64, outputs: &OutputImage) {
        for node in 0..self.counted.len() {
            self.main.outputs_mut(node).copy_from_slice(outputs.node(node));
        }
        if self.watch.soc_allowed() && self.end == End::No {
            self.ready = Some((begin_ns, self.main.prepare()));
        }
    }

    fn exchange(&mut self, deadline_ns: u64, inputs: &mut InputImage) -> CycleReport {
        let sent_ns = self.link.now_ns();
        let ready = self.ready.take().filter(|_| self.watch.soc_allowed());
        let (begin_ns, frames) = ready.unwrap_or((sent_ns, 0));
        for number in 0..frames {
            let frame = self.main.frame(number);
            if let Err(error) = in_the_kernel(|| self.link.send(frame)) {
                self.link_error = Some(error);
            }
        }
        // What has not come back by the half of the cycle is lost: the control computes in the other half.
        let until_ns = deadline_ns.min(sent_ns + self.cycle_ns / 2);
        while frames > 0 && !self.main.cycle_is_whole() {
            let came = self.receive(until_ns);
            // A wire that is flooded with frames must not keep this thread beyond its date.
            if !came || self.link.now_ns() >= until_ns {
                break;
            }
        }
        let done_ns = self.link.now_ns();
        // That the frames were sent behind their date says nothing of the dates.
        let jitter_ns = sent_ns.saturating_sub(begin_ns) as i64;
        let late_ns = self
            .main
            .late_ns()
            .filter(|_| frames > 0)
            .map(|late_ns| late_ns - jitter_ns);
        if ready.is_some() {
            self.main.finish_cycle(done_ns);
        }
        let mut lost = 0;
        for (node, counted) in self.counted.iter_mut().enumerate() {
            let state = self.main.device_state(node);
            let answered = self.main.answered(node);
            let asked = frames > 0 && matches!(state, DeviceState::Operational | DeviceState::Faulted);
            let fresh = asked && answered.fresh && state == DeviceState::Operational;
            if fresh {
                inputs.payload.node_mut(node).copy_from_slice(self.main.inputs(node));
            }
            inputs.fresh[node] = fresh;
            inputs.lost_in_row[node] = if asked { answered.lost_in_row } else { 0 };
            let is_lost = asked && answered.lost_in_row > 0;
            lost += u32::from(is_lost);
            counted.polls += u64::from(asked);
            counted.answers += u64::from(asked && !is_lost);
            counted.lost += u64::from(is_lost);
            counted.refused += u64::from(is_lost && answered.working_counter > 0);
            if fresh {
                counted.response_ns_max = counted.response_ns_max.max(done_ns.saturating_sub(sent_ns));
            }
            counted.lost_in_row_max = counted.lost_in_row_max.max(inputs.lost_in_row[node]);
        }
        self.was_operational |= self.is_operational();
        self.has_followed |= late_ns.is_some();
        let time = match late_ns {
            Some(late_ns) if self.follows => TimeReference::Bus { late_ns },
            // Without this cycle's time the dates go on as the clocks have run apart so far.
            None if self.follows && self.has_followed => TimeReference::Unheard,
            _ => TimeReference::Ours,
        };
        CycleReport {
            sent_ns,
            started_ns: (frames > 0).then_some(sent_ns),
            done_ns,
            lost,
            time,
        }
    }

    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    fn serve(&mut self, until_ns: u64) {
        // A cycle that was made ready waits for its date: its frames are the next ones, and not before.
        if self.ready.is_some() || self.end == End::Done {
            return;
        }
        if self.end == End::Wanted {
            let frame = self.main.shut_down_frame();
            if let Err(error) = in_the_kernel(|| self.link.send(frame)) {
                self.link_error = Some(error);
            }
            self.end = End::Done;
            return;
        }
        loop {
            let now_ns = self.link.now_ns();
            if now_ns + SERVICE_NS < until_ns {
                self.send_service(now_ns);
            }
            // One that does not come back is given up by the main device, some cycles later.
            if !self.main.awaits_service() || now_ns >= until_ns || !self.receive(until_ns) {
                return;
            }
        }
    }

    fn now_ns(&mut self) -> u64 {
        self.link.now_ns()
    }

    fn node_state(&self, node: NodeIndex) -> NodeState {
        match self.main.device_state(node) {
            DeviceState::Absent => NodeState::Absent,
            DeviceState::Coming => NodeState::Configuring,
            DeviceState::Operational => NodeState::Operational,
            DeviceState::Faulted => NodeState::Faulted,
        }
    }

    fn state(&self) -> BusState {
        match (self.end, self.was_operational) {
            (End::Done, _) => BusState::Down,
            (_, true) => BusState::Operational,
            (_, false) => BusState::Booting,
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
        if let Some(event) = self.next_event.take() {
            return Some(event);
        }
        let event = self.main.pop_event()?;
        self.count(event);
        let (event, next) = self.translate(event);
        self.next_event = next;
        Some(event)
    }

    fn shut_down(&mut self) {
        if self.end == End::No {
            self.end = End::Wanted;
        }
    }

    fn statistics(&self, node: NodeIndex) -> NodeStatistics {
        let counted = &self.counted[node];
        NodeStatistics {
            polls: counted.polls,
            answers: counted.answers,
            lost: counted.lost,
        }
    }

    fn publish(&mut self, cycle: u64) {
        if let Some(publisher) = &mut self.publisher {
            publisher.publish(cycle, &mut self.main, &self.counted);
        }
    }
}
