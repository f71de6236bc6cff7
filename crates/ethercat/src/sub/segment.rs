//! Devices and the cables between them: what a frame passes, in which order and when.
//!
//! A device passes a frame from port 0 through its processing unit to ports 3, 1 and 2, as far as something answers there, and
//! back to port 0. All of a frame is processed as it enters; its answer leaves when its last octet has come back.

use super::device::SubDevice;
use crate::wire::register;
use crate::wire::{Frame, HEADER_LEN, MAC_PASSED};
use std::vec::Vec;

/// The order in which a frame leaves by the ports.
const PORT_ORDER: [usize; 3] = [3, 1, 2];
/// An octet on the wire at 100 Mbit/s, ns.
const OCTET_NS: u64 = 80;
/// Preamble, check sequence and gap of a frame, octets.
const FRAME_EXTRA: u64 = 24;

/// A device and the cable to what lies before it.
#[derive(Debug)]
struct Station {
    device: SubDevice,
    /// What lies before it: a device and its port; `None`: the main device.
    parent: Option<(usize, usize)>,
    delay_ns: u64,
    cut: bool,
    /// The next frame is spoilt on this cable.
    spoil: bool,
    /// What hangs on each port.
    children: [Option<usize>; 4],
}

/// A frame that comes back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Its length.
    pub length: usize,
    /// When its last octet has come, ns.
    pub at_ns: u64,
}

/// A step on the way of a frame.
#[derive(Clone, Copy, Debug)]
struct Visit {
    device: usize,
    entry_ns: u64,
    times: [Option<u64>; 4],
}

/// Devices in the order in which they were added; the first one is next to the main device.
#[derive(Debug, Default)]
pub struct Segment {
    stations: Vec<Station>,
    /// Way and datagrams of the frame that passes, kept for the next one: no memory is asked for then.
    visits: Vec<Visit>,
    places: Vec<(usize, usize)>,
}

impl Segment {
    /// No device.
    pub fn new() -> Segment {
        Segment::default()
    }

    /// Adds a device behind the last one, at its port 1; its number.
    pub fn push(&mut self, device: SubDevice, delay_ns: u64) -> usize {
        let parent = self.stations.len().checked_sub(1).map(|last| (last, 1));
        self.push_at(device, parent, delay_ns)
    }

    /// Adds a device at a port of another one.
    pub fn push_at(&mut self, device: SubDevice, parent: Option<(usize, usize)>, delay_ns: u64) -> usize {
        self.stations.push(Station {
            device,
            parent,
            delay_ns,
            cut: false,
            spoil: false,
            children: [None; 4],
        });
        let number = self.stations.len() - 1;
        if let Some((parent, port)) = parent {
            self.stations[parent].children[port] = Some(number);
        }
        self.update_links(false);
        self.stations.len() - 1
    }

    /// How many devices there are.
    pub fn len(&self) -> usize {
        self.stations.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.stations.is_empty()
    }

    /// A device.
    pub fn device(&self, number: usize) -> &SubDevice {
        &self.stations[number].device
    }

    /// A device, to be changed.
    pub fn device_mut(&mut self, number: usize) -> &mut SubDevice {
        &mut self.stations[number].device
    }

    /// Cuts the cable in front of a device.
    pub fn cut(&mut self, number: usize) {
        self.stations[number].cut = true;
        self.update_links(true);
    }

    /// Mends it.
    pub fn heal(&mut self, number: usize) {
        self.stations[number].cut = false;
        self.update_links(true);
    }

    /// The next frame is spoilt on the cable in front of a device.
    pub fn spoil_next(&mut self, number: usize) {
        self.stations[number].spoil = true;
    }

    /// Switches a device off; what lies behind it is cut off, too.
    pub fn power_off(&mut self, number: usize) {
        self.stations[number].device.power_off();
        self.update_links(true);
    }

    /// Switches it on again.
    pub fn power_on(&mut self, number: usize, now_ns: u64) {
        self.stations[number].device.power_on(now_ns);
        self.update_links(true);
    }

    /// Swaps two devices; cables stay where they are.
    pub fn swap(&mut self, one: usize, other: usize) {
        let (low, high) = (one.min(other), one.max(other));
        if low != high {
            let (left, right) = self.stations.split_at_mut(high);
            core::mem::swap(&mut left[low].device, &mut right[0].device);
            self.update_links(true);
        }
    }

    /// Whether something answers at the other end of the cable to a device.
    fn has_link(&self, number: usize) -> bool {
        let station = &self.stations[number];
        let before = station
            .parent
            .is_none_or(|(parent, _)| self.stations[parent].device.is_powered());
        !station.cut && station.device.is_powered() && before
    }

    fn child(&self, parent: usize, port: usize) -> Option<usize> {
        self.stations[parent].children[port]
    }

    /// Tells every device which of its ports have a link.
    fn update_links(&mut self, count: bool) {
        for number in 0..self.stations.len() {
            if !self.stations[number].device.is_powered() {
                continue;
            }
            let mut links = [false; 4];
            links[0] = self.has_link(number);
            for (port, link) in links.iter_mut().enumerate().skip(1) {
                *link = self.child(number, port).is_some_and(|child| self.has_link(child));
            }
            let device = &mut self.stations[number].device;
            let runs = device.firmware_runs();
            let before = register::DlStatus(device.esc().u16(register::DL_STATUS));
            for (port, link) in links.into_iter().enumerate() {
                if count && before.link(port) && !link {
                    device.esc_mut().count(register::LOST_LINKS + port as u16);
                }
            }
            device.esc_mut().set_dl_status(links, runs);
        }
    }

    /// The way of a frame that comes to a device; when it has come back to the port that it came from.
    fn route(&self, device: usize, entry_ns: u64, visits: &mut Vec<Visit>) -> u64 {
        let at = visits.len();
        visits.push(Visit {
            device,
            entry_ns,
            times: [Some(entry_ns), None, None, None],
        });
        let mut now_ns = entry_ns;
        for port in PORT_ORDER {
            let Some(child) = self.child(device, port).filter(|child| self.has_link(*child)) else {
                continue;
            };
            let station = &self.stations[device].device;
            let far = &self.stations[child].device;
            if station.esc().is_port_closed(port) || far.esc().is_port_closed(0) {
                continue;
            }
            let delay_ns = self.stations[child].delay_ns;
            now_ns = self.route(child, now_ns + delay_ns, visits) + delay_ns;
            visits[at].times[port] = Some(now_ns);
        }
        now_ns
    }

    /// A frame comes from the main device; it is changed in `frame` and comes back, or is lost. What is not EtherCAT is passed on.
    pub fn receive(&mut self, now_ns: u64, frame: &mut [u8]) -> Option<Answer> {
        self.poll(now_ns);
        if !self
            .stations
            .first()
            .is_some_and(|first| !first.cut && first.device.is_powered())
        {
            return None;
        }
        self.update_links(false);
        let mut visits = core::mem::take(&mut self.visits);
        visits.clear();
        let back_ns = self.route(0, now_ns + self.stations[0].delay_ns, &mut visits) + self.stations[0].delay_ns;
        let comes_back = self.pass(&visits, frame);
        self.visits = visits;
        let wire_ns = (frame.len() as u64 + FRAME_EXTRA) * OCTET_NS;
        comes_back.then_some(Answer {
            length: frame.len(),
            at_ns: back_ns + wire_ns,
        })
    }

    /// A frame goes this way; whether it comes back.
    fn pass(&mut self, visits: &[Visit], frame: &mut [u8]) -> bool {
        if let Some(broken) = visits.iter().position(|visit| self.stations[visit.device].spoil) {
            self.spoil(visits, broken);
            return false;
        }
        let Ok(parsed) = Frame::parse(frame) else {
            let destroys = |visit: &Visit| self.stations[visit.device].device.esc().u32(register::DL_CONTROL) & 1 != 0;
            return !visits.iter().any(destroys);
        };
        self.places.clear();
        let places = parsed.datagrams().map(|datagram| (datagram.at, datagram.data.len()));
        self.places.extend(places);
        debug_assert!(self.places.first().is_some_and(|(at, _)| *at == HEADER_LEN));
        frame[6] |= MAC_PASSED;
        for visit in visits {
            let station = &mut self.stations[visit.device];
            if station.device.esc().is_port_closed(0) && !pass_closed_port(frame, &self.places) {
                return false;
            }
            station.device.poll(visit.entry_ns);
            for &(at, length) in &self.places {
                let datagram = &mut frame[at..at + length + crate::wire::DATAGRAM_OVERHEAD];
                station.device.datagram(visit.entry_ns, datagram, length, &visit.times);
            }
            station.device.after_frame(visit.entry_ns);
        }
        true
    }

    /// A frame arrives spoilt: the first device behind the cable counts it as such, those behind as one that was spoilt before.
    fn spoil(&mut self, visits: &[Visit], broken: usize) {
        for (at, visit) in visits.iter().enumerate().skip(broken) {
            let station = &mut self.stations[visit.device];
            let esc = station.device.esc_mut();
            if at == broken {
                station.spoil = false;
                esc.count(register::RX_ERRORS);
            } else {
                esc.count(register::FORWARDED_ERRORS);
            }
        }
    }

    /// Time passes without a frame.
    pub fn poll(&mut self, now_ns: u64) {
        for station in &mut self.stations {
            // Each at its own times, not at those of the caller.
            for _ in 0..1000 {
                let due_ns = station.device.next_ns(now_ns);
                if due_ns > now_ns {
                    break;
                }
                station.device.poll(now_ns);
            }
        }
    }

    /// When a device does something by itself.
    pub fn next_ns(&self, now_ns: u64) -> u64 {
        let all = self.stations.iter().map(|station| station.device.next_ns(now_ns));
        all.min().unwrap_or(u64::MAX)
    }
}

/// A frame passes a device whose port 0 is closed: it is marked, and destroyed where it was marked before.
fn pass_closed_port(frame: &mut [u8], places: &[(usize, usize)]) -> bool {
    const CIRCULATING: u8 = 0x40;
    if places.iter().any(|(at, _)| frame[at + 7] & CIRCULATING != 0) {
        return false;
    }
    for (at, _) in places {
        frame[at + 7] |= CIRCULATING;
    }
    true
}
