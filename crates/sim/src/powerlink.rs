//! The simulated nodes on POWERLINK: each a controlled node.
//!
//! In:  frames of the managing node, the time. Out: the frames to answer with.
//!
//! The nodes hang on one wire: what one sends, the others hear. A frame is read once for all of them, and passes by those at which
//! it does nothing ([`Cn::rests_until_ns`]): of hundreds, nearly all. A drive lives by the SoC: each one closes a period of its motors
//! and opens the next. The work of a period is done once the SoA has been answered, when nobody waits for this node. When the SoC
//! stays away for [`FREE_RUN_PERIODS`] its periods go by its own clock; how long it trusts its last set-point then is the business
//! of its controlled node: 1C0B, 1C14.

use super::SimError;
use super::carrier::{Carrier, Device, tables};
use super::drive;
use config::{Config, Node, NodeIndex};
use obd::Dictionary;
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, CnConfig, Events};
use powerlink::nmt::{NmtState, Reset};
use powerlink::wire::{self, ETHER_TYPE, FRAME_LEN_MAX, Frame, Header, Mac, message};
use std::cell::Cell;

const ENTRIES: usize = COMMUNICATION_ENTRIES + drive::ENTRIES;
const OCTETS: usize = COMMUNICATION_BYTES + drive::OCTETS;

/// Periods without a SoC after which a drive goes on by its own clock.
pub(super) const FREE_RUN_PERIODS: u64 = 5;
/// Periods made up for at most after a pause, such as that of a stopped process.
const CATCH_UP_PERIODS: u32 = 20;
/// 1F98h/3 of simulated nodes: they answer as soon as their process is woken.
const PRES_MAX_LATENCY_NS: u32 = 100_000;
/// Number of the device profile in error entries of drives.
const PROFILE: u16 = 402;
/// Where the message type lies in a frame.
const MESSAGE_TYPE: usize = 14;

/// MAC of a simulated node: locally administered, the node id last.
pub fn node_mac(id: u8) -> Mac {
    [0x02, 0x00, 0x00, 0x45, 0x50, id]
}

/// A node on the wire.
#[derive(Debug)]
struct Place {
    cn: Box<Cn<ENTRIES, OCTETS>>,
    device: Device,
    /// The node hangs on the wire.
    plugged: bool,
    /// PRes that get lost before others are sent.
    pres_to_drop: u32,
    period_ns: u64,
    /// The last SoC, or the last period of the drive's own clock.
    period_start_ns: u64,
    /// The SoC came and its period has not been worked off.
    due: bool,
    free_running: bool,
    /// As it has been since something was done to the node or its device last; `None`: nobody has asked.
    rest: Cell<Option<Rest>>,
}

/// What passes a node by.
#[derive(Clone, Copy, Debug)]
struct Rest {
    /// Frames between others: see [`Cn::rests_until_ns`].
    until_ns: u64,
    /// When it has to be polled; `None`: never.
    next_poll_ns: Option<u64>,
}

impl Rest {
    /// Whether a poll would do nothing.
    fn lasts(&self, now_ns: u64) -> bool {
        now_ns < self.until_ns && self.next_poll_ns.is_none_or(|poll_ns| now_ns < poll_ns)
    }
}

/// A frame as all nodes hear it; `None`: it cannot be read.
type Heard<'f> = Option<(Header, Frame<'f>)>;

impl Place {
    fn new(config: &Config, index: NodeIndex) -> Result<Place, SimError> {
        let node = &config.bus.nodes[index];
        let mut lines = vec![COMMUNICATION_PROFILE];
        lines.extend(tables(config, index));
        let mut objects: Dictionary<ENTRIES, OCTETS> =
            Dictionary::new(&lines).map_err(|error| SimError::new(node, error))?;
        let device = Device::new(config, index, &mut objects)?;
        let mut cn = controlled_node(node, device.device_type(), objects)?;
        if let Device::Drive(_) = device {
            cn.set_write_check(drive::check_write);
        }
        Ok(Place {
            cn: Box::new(cn),
            device,
            plugged: true,
            pres_to_drop: 0,
            period_ns: 1000 * u64::from(config.cycle_us),
            period_start_ns: 0,
            due: false,
            free_running: true,
            rest: Cell::new(None),
        })
    }

    fn rest(&self) -> Rest {
        let rest = self.rest.get().unwrap_or_else(|| {
            let of_node_ns = self.device.is_powered().then(|| self.cn.next_deadline_ns()).flatten();
            let own_ns = matches!(self.device, Device::Drive(_)).then(|| self.own_period_ns());
            Rest {
                until_ns: self.cn.rests_until_ns(),
                next_poll_ns: of_node_ns.into_iter().chain(own_ns).min(),
            }
        });
        self.rest.set(Some(rest));
        rest
    }

    /// The octets of `response` that are to be sent at once.
    fn receive(&mut self, now_ns: u64, frame: &Heard<'_>, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        if !self.plugged || !self.device.is_powered() {
            return None;
        }
        if let Some((header, Frame::Preq(_))) = frame
            && header.destination_node != self.cn.node_id()
            && now_ns < self.rest().until_ns
        {
            return None;
        }
        self.rest.set(None);
        let reaction = self.cn.receive_read(now_ns, *frame, response);
        self.apply_events(now_ns, &reaction.events);
        self.on_the_wire(reaction.transmit?, response)
    }

    /// What another node has sent.
    fn hear(&mut self, now_ns: u64, frame: &Heard<'_>, response: &mut [u8; FRAME_LEN_MAX]) {
        match frame {
            Some((header, Frame::Pres(pres))) if now_ns < self.rest().until_ns => {
                if self.plugged && self.device.is_powered() {
                    self.cn.overhear(header.source_node, pres);
                }
            }
            // Nodes answer the managing node only; what they hear of each other is for cross traffic.
            _ => _ = self.receive(now_ns, frame, response),
        }
    }

    /// What is due by the clock; the octets of `response` that are to be sent: the PRes of a chained node.
    fn poll(&mut self, now_ns: u64, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        if self.rest().lasts(now_ns) {
            return None;
        }
        self.rest.set(None);
        if self.device.is_powered() {
            let events = self.cn.poll(now_ns);
            self.apply_events(now_ns, &events);
            if let (Device::Io(io), Some(_)) = (&self.device, events.nmt_state) {
                let operational = self.cn.nmt_state() == NmtState::Operational;
                io.switch(self.cn.dictionary_mut(), operational);
            }
        }
        if let Device::Drive(_) = self.device {
            self.run_free(now_ns);
        }
        if !self.device.is_powered() {
            return None;
        }
        let length = self.cn.poll_transmit(now_ns, response)?;
        self.on_the_wire(length, response)
    }

    /// What of an answer really leaves the node.
    fn on_the_wire(&mut self, length: usize, response: &[u8; FRAME_LEN_MAX]) -> Option<usize> {
        if self.pres_to_drop > 0 && message_type(&response[..length]) == Some(message::PRES) {
            self.pres_to_drop -= 1;
            return None;
        }
        self.plugged.then_some(length)
    }

    fn apply_events(&mut self, now_ns: u64, events: &Events) {
        let Device::Drive(drive) = &mut self.device else { return };
        if let Some(Reset::Software | Reset::Node) = events.reset {
            drive.reset();
        }
        if events.sync.is_some() {
            // The SoA of the period before was lost.
            self.work();
            self.due = true;
            self.free_running = false;
            self.period_start_ns = now_ns;
        }
    }

    /// Does the work of a drive's period, if its SoC has come.
    fn work(&mut self) {
        if self.due {
            self.due = false;
            self.rest.set(None);
            self.step();
        }
    }

    fn step(&mut self) {
        let Device::Drive(drive) = &mut self.device else { return };
        let operational = self.cn.nmt_state() == NmtState::Operational;
        let reports = drive.step(self.cn.dictionary_mut(), operational);
        for code in reports.into_iter().filter(|code| *code != 0) {
            self.cn.report_error(PROFILE, code, [0; 8]);
        }
    }

    /// Periods of a drive by its own clock.
    fn run_free(&mut self, now_ns: u64) {
        if now_ns < self.own_period_ns() {
            return;
        }
        self.free_running = true;
        self.due = false;
        for _ in 0..CATCH_UP_PERIODS {
            if now_ns < self.period_start_ns + self.period_ns {
                return;
            }
            self.period_start_ns += self.period_ns;
            self.step();
        }
        self.period_start_ns = now_ns;
    }

    /// When the drive's own clock ends a period.
    fn own_period_ns(&self) -> u64 {
        let periods = if self.free_running { 1 } else { FREE_RUN_PERIODS };
        self.period_start_ns + periods * self.period_ns
    }

    /// In place: see [`Cn::power_on`].
    fn power_on(&mut self, now_ns: u64) -> bool {
        self.rest.set(None);
        self.cn.power_on(now_ns);
        (self.due, self.free_running, self.period_start_ns) = (false, true, now_ns);
        // What was built once from the same dictionary can be built again.
        self.device.power_on(self.cn.dictionary()).is_ok()
    }
}

/// The controlled node of a node of the machine file: it shows the identity that the file expects.
fn controlled_node(
    node: &Node,
    device_type: u32,
    mut objects: Dictionary<ENTRIES, OCTETS>,
) -> Result<Cn<ENTRIES, OCTETS>, SimError> {
    // Lost SoAs are counted only (1C0Ch/3 = 0): how long a node goes on alone is configured by its SoC and its polls.
    objects
        .find(0x1C0C, 3)
        .and_then(|threshold| objects.set_default(threshold, &[0; 4]))
        .map_err(|error| SimError::new(node, error))?;
    let identity = &node.identity;
    // Names beyond the length of the objects are cut; they are for people.
    let name = node
        .name
        .char_indices()
        .take_while(|(at, char)| at + char.len_utf8() <= 32)
        .last();
    let name = &node.name[..name.map_or(0, |(at, char)| at + char.len_utf8())];
    let config = CnConfig {
        node_id: node.id,
        mac: node_mac(node.id),
        device_type: identity.device_type.unwrap_or(device_type),
        vendor_id: identity.vendor_id.unwrap_or(0),
        product_code: identity.product_code.unwrap_or(0),
        revision: identity.revision.unwrap_or(0),
        serial: identity.serial.unwrap_or(u32::from(node.id)),
        device_name: name,
        host_name: name,
        pres_max_latency_ns: PRES_MAX_LATENCY_NS,
    };
    Cn::new(&config, objects, 0).map_err(|error| SimError::new(node, error))
}

/// All nodes of a machine file.
#[derive(Debug)]
pub(super) struct Powerlink {
    places: Vec<Place>,
    response: Box<[u8; FRAME_LEN_MAX]>,
    /// What a node has sent, while the others hear it.
    answer: Box<[u8; FRAME_LEN_MAX]>,
}

impl Powerlink {
    /// All nodes switched on at time 0 of their clock.
    pub(super) fn new(config: &Config) -> Result<Powerlink, SimError> {
        let places = (0..config.bus.nodes.len()).map(|index| Place::new(config, index));
        Ok(Powerlink {
            places: places.collect::<Result<_, _>>()?,
            response: Box::new([0; FRAME_LEN_MAX]),
            answer: Box::new([0; FRAME_LEN_MAX]),
        })
    }

    /// What a node has sent, in `answer`, comes to the others.
    fn hear(&mut self, now_ns: u64, from: usize, length: usize) {
        let heard = wire::accept(&self.answer[..length]).ok();
        for (index, other) in self.places.iter_mut().enumerate() {
            if index != from {
                other.hear(now_ns, &heard, &mut self.response);
            }
        }
    }
}

impl Carrier for Powerlink {
    fn receive(&mut self, now_ns: u64, frame: &[u8], send: &mut dyn FnMut(&[u8])) -> bool {
        // No frame is answered by more than one node. The others hear its answer behind the frame, as on any wire.
        let mut answer = None;
        let heard = wire::accept(frame).ok();
        for index in 0..self.places.len() {
            if let Some(length) = self.places[index].receive(now_ns, &heard, &mut self.response) {
                send(&self.response[..length]);
                std::mem::swap(&mut self.response, &mut self.answer);
                answer = Some((index, length));
            }
        }
        if let Some((from, length)) = answer {
            self.hear(now_ns, from, length);
        }
        let is_end = message_type(frame) == Some(message::SOA);
        if is_end {
            self.places.iter_mut().for_each(Place::work);
        }
        is_end
    }

    fn poll(&mut self, now_ns: u64, send: &mut dyn FnMut(&[u8])) -> bool {
        for index in 0..self.places.len() {
            if let Some(length) = self.places[index].poll(now_ns, &mut self.answer) {
                send(&self.answer[..length]);
                self.hear(now_ns, index, length);
            }
        }
        false
    }

    fn work_io(&mut self) {
        for place in &mut self.places {
            let operational = place.cn.nmt_state() == NmtState::Operational;
            if let Device::Io(io) = &mut place.device {
                io.work(place.cn.dictionary_mut(), operational);
            }
        }
    }

    fn next_poll_ns(&self) -> Option<u64> {
        self.places.iter().filter_map(|place| place.rest().next_poll_ns).min()
    }

    fn device(&self, place: usize) -> &Device {
        &self.places[place].device
    }

    fn device_mut(&mut self, place: usize) -> &mut Device {
        self.places[place].rest.set(None);
        &mut self.places[place].device
    }

    fn is_operational(&self, place: usize) -> bool {
        self.nmt_state(place) == Some(NmtState::Operational)
    }

    fn outputs(&self, place: usize) -> Option<[u8; 2]> {
        match &self.places[place].device {
            Device::Io(io) if self.is_operational(place) => Some(io.outputs(self.places[place].cn.dictionary())),
            Device::Io(_) => Some([0; 2]),
            Device::Drive(_) => None,
        }
    }

    fn plug(&mut self, place: usize, plugged: bool) {
        self.places[place].plugged = plugged;
    }

    fn drop_answers(&mut self, place: usize, count: u32) {
        self.places[place].pres_to_drop = count;
    }

    fn power_off(&mut self, place: usize) {
        self.device_mut(place).power_off();
    }

    fn power_on(&mut self, place: usize, now_ns: u64) -> bool {
        self.places[place].power_on(now_ns)
    }

    fn send_ethernet(&mut self, place: usize, frame: &[u8]) {
        self.places[place].rest.set(None);
        // A network that is too slow for its traffic loses it.
        let _ = self.places[place].cn.send_ethernet(frame);
    }

    fn nmt_state(&self, place: usize) -> Option<NmtState> {
        let place = &self.places[place];
        Some(match place.device.is_powered() {
            true => place.cn.nmt_state(),
            false => NmtState::Off,
        })
    }
}

/// Message type of a POWERLINK frame.
fn message_type(frame: &[u8]) -> Option<u8> {
    let ether_type = frame.get(12..14)?;
    (ether_type == ETHER_TYPE.to_be_bytes())
        .then(|| frame.get(MESSAGE_TYPE).map(|octet| octet & 0x7F))
        .flatten()
}
