//! Looks at the ports of all devices when something is wrong with the wire: where it is broken, where frames are spoilt.
//!
//! In:  links, loops, counters of errors and of lost links of each device. Out: an event that names two devices, or one and its port.

use super::delay::{DcDevice, parents};
use super::device::{Device, Step};
use super::event::{Break, Event};
use crate::wire::register::{self, DlStatus};
use crate::wire::{Command, Datagram, FrameWriter, u16_at};

/// Between two surveys, ns.
const APART_NS: u64 = 100_000_000;
/// After wrong working counters, so that errors come together.
const LATER_NS: u64 = 500_000_000;
/// Octets of 0300h to 0313h.
const COUNTERS_LEN: usize = 20;
/// So many frames in a row without an answer: nobody is there any more.
const SILENT: u8 = 10;
/// Counters of lost links among them.
const LOST_LINKS_AT: usize = 16;

/// What was seen of a device.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    answers: bool,
    ports: DlStatus,
    counters: [u8; COUNTERS_LEN],
}

/// Ports of up to `N` devices.
#[derive(Clone, Debug)]
pub(super) struct Survey<const N: usize> {
    /// The device and its port before each.
    parents: [Option<(usize, usize)>; N],
    seen: [Seen; N],
    /// Invalid frames at each port, as they were before.
    errors: [[u8; 4]; N],
    due_ns: Option<u64>,
    last_ns: u64,
    /// Datagrams that were asked and answered, two for each device; `None`: no survey is under way.
    asked: Option<(usize, usize)>,
    broken: Option<Break>,
    lost_in_row: u8,
    /// When the last one was whole.
    pub(super) done_ns: u64,
}

impl<const N: usize> Survey<N> {
    pub(super) fn new() -> Survey<N> {
        Survey {
            parents: [None; N],
            seen: [Seen::default(); N],
            errors: [[0; 4]; N],
            due_ns: None,
            last_ns: 0,
            asked: None,
            broken: None,
            lost_in_row: 0,
            done_ns: 0,
        }
    }

    /// All devices are there: which lies behind which.
    pub(super) fn learn(&mut self, devices: &[Device<'_>]) {
        let mut ports = [DcDevice::default(); N];
        for (known, device) in ports.iter_mut().zip(devices) {
            known.open = [0, 1, 2, 3].map(|port| device.ports.is_open(port));
        }
        self.parents = parents::<N>(&ports[..devices.len()]);
    }

    /// Devices are missing.
    pub(super) fn want(&mut self, now_ns: u64) {
        let earliest = now_ns.max(self.last_ns + APART_NS);
        self.due_ns = Some(self.due_ns.map_or(earliest, |due_ns| due_ns.min(earliest)));
    }

    /// Frames were lost, or working counters wrong.
    pub(super) fn want_later(&mut self, now_ns: u64) {
        self.due_ns.get_or_insert(now_ns + LATER_NS);
    }

    /// Adds a datagram, if there is one to be sent and room for it.
    pub(super) fn ask(&mut self, now_ns: u64, devices: &[Device<'_>], writer: &mut FrameWriter<'_>, index: u8) -> bool {
        if self.asked.is_none() && self.due_ns.is_some_and(|due_ns| due_ns <= now_ns) {
            self.due_ns = None;
            self.last_ns = now_ns;
            self.asked = Some((0, 0));
        }
        let Some((asked, _)) = &mut self.asked else {
            return false;
        };
        let Some(device) = devices.get(*asked / 2) else {
            return false;
        };
        let (register, octets) = if asked.is_multiple_of(2) {
            (register::DL_STATUS, 2)
        } else {
            (register::RX_ERRORS, COUNTERS_LEN)
        };
        let address = register::station(device.station(), register);
        let written = writer.push(Command::Fprd, index, address, octets).is_ok();
        *asked += usize::from(written);
        written
    }

    /// The frame was lost.
    pub(super) fn lost(&mut self) {
        let Some((asked, done)) = &mut self.asked else { return };
        *asked = *done;
        self.lost_in_row = self.lost_in_row.saturating_add(1);
        if self.lost_in_row >= SILENT {
            for seen in &mut self.seen {
                seen.answers = false;
            }
            self.asked = Some((usize::MAX, usize::MAX));
        }
    }

    pub(super) fn answer(&mut self, datagram: &Datagram<'_>) {
        let Some((_, done)) = &mut self.asked else { return };
        let Some(seen) = self.seen.get_mut(*done / 2) else {
            return;
        };
        if done.is_multiple_of(2) {
            seen.answers = datagram.working_counter > 0;
            seen.ports = DlStatus(u16_at(datagram.data, 0).unwrap_or(0));
        } else {
            seen.answers &= datagram.working_counter > 0;
            for (counter, octet) in seen.counters.iter_mut().zip(datagram.data) {
                *counter = *octet;
            }
        }
        *done += 1;
        self.lost_in_row = 0;
    }

    /// What a survey that is whole says.
    pub(super) fn run(&mut self, now_ns: u64, devices: &mut [Device<'_>]) -> Option<Event> {
        let (_, done) = self.asked?;
        if done < 2 * devices.len() {
            return None;
        }
        self.asked = None;
        self.lost_in_row = 0;
        self.done_ns = now_ns;
        let known = |at: usize| devices[at].step != Step::Stranger || self.seen[at].answers;
        let silent = (0..devices.len()).find(|at| !self.seen[*at].answers && known(*at));
        if silent.is_none() {
            // All are there: what lies behind which may have changed.
            for (device, seen) in devices.iter_mut().zip(&self.seen) {
                device.ports = seen.ports;
            }
            self.learn(devices);
        }
        let broken = silent.map(|at| self.place(at));
        let news = broken.filter(|broken| self.broken != Some(*broken));
        self.broken = broken;
        let spoilt = self.spoilt(devices.len());
        news.map(Event::Broken).or(spoilt.filter(|_| broken.is_none()))
    }

    /// Where it is broken, when this device is the first one that is silent.
    fn place(&self, at: usize) -> Break {
        let before = self.parents[at];
        let seen = before.map(|(parent, port)| (self.seen[parent], port));
        Break {
            before: before.map(|(parent, port)| (parent as u16, port as u8)),
            behind: at as u16,
            link_lost: seen.is_some_and(|(seen, port)| !seen.ports.link(port)),
            lost_links: seen.map_or(0, |(seen, port)| seen.counters[LOST_LINKS_AT + port]),
        }
    }

    /// The first port at which frames arrived spoilt since the last survey.
    fn spoilt(&mut self, count: usize) -> Option<Event> {
        let mut first = None;
        for at in 0..count {
            let seen = self.seen[at];
            if !seen.answers {
                continue;
            }
            for port in 0..4 {
                let errors = seen.counters[2 * port];
                let more = errors.saturating_sub(self.errors[at][port]);
                self.errors[at][port] = errors;
                if more > 0 && first.is_none() {
                    first = Some(Event::Spoilt {
                        position: at as u16,
                        port: port as u8,
                        frames: more,
                    });
                }
            }
        }
        first
    }
}
