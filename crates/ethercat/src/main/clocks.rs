//! Clocks of all devices get the time of the first one: how far each is away, and what its counter differs by.
//!
//! In:  receive times of a frame that all have latched. Out: offset and delay of each clock that is to be set.
//!
//! Setting one clock anew does not touch those that run: latching changes receive times only.

use super::delay::{DcDevice, delays};
use super::device::{Device, Step};
use crate::wire::register;
use crate::wire::{Command, Datagram, FrameWriter, array};

/// Octets of 0900h to 091Fh: receive times of ports and of the processing unit.
const TIMES_LEN: usize = 0x20;
/// 0930h to 0935h: the loop begins anew, with filters as other main devices set them.
const LOOP: [u8; 6] = [0x00, 0x10, 0, 0, 0x00, 0x0C];

/// What is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Work {
    None,
    /// All latch.
    Latch,
    /// Each is read.
    Read,
    /// Those that wait for it are written.
    Write,
}

/// Where the work is with a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Todo,
    /// Its datagrams are under way; so many.
    Asked,
    Done,
}

/// The clocks of up to `N` devices.
#[derive(Clone, Debug)]
pub(super) struct Clocks<const N: usize> {
    work: Work,
    parts: [Part; N],
    times: [DcDevice; N],
    unit_ns: [u64; N],
    offset_ns: [u64; N],
    /// Datagrams that are under way, in their order: device, second one of it.
    queue: [(u16, bool); 2 * 64],
    queued: usize,
    answered: usize,
    /// The device that leads.
    pub(super) reference: Option<usize>,
    pub(super) delays_known: bool,
    /// The time of the bus begins anew.
    pub(super) restarted: bool,
}

impl<const N: usize> Clocks<N> {
    pub(super) fn new() -> Clocks<N> {
        Clocks {
            work: Work::None,
            parts: [Part::Done; N],
            times: [DcDevice::default(); N],
            unit_ns: [0; N],
            offset_ns: [0; N],
            queue: [(0, false); 2 * 64],
            queued: 0,
            answered: 0,
            reference: None,
            delays_known: false,
            restarted: false,
        }
    }

    /// A device does not answer any more.
    pub(super) fn gone(&mut self, at: usize) {
        self.parts[at] = Part::Done;
    }

    /// The first device that answers and whose clock is right leads; while none does, it stays as it was.
    pub(super) fn choose(&self, devices: &[Device<'_>]) -> Option<usize> {
        let leads = |device: &Device<'_>| device.clock.is_right && device.is_coming();
        devices.iter().position(leads).or(self.reference)
    }

    fn is_asked(device: &Device<'_>) -> bool {
        device.chip.has_clock() && device.is_coming()
    }

    /// Goes on with the work; whether the clocks that waited are set.
    pub(super) fn run(&mut self, devices: &mut [Device<'_>]) -> bool {
        let waits = devices.iter().any(|device| device.step == Step::Clock);
        match self.work {
            Work::None if waits => {
                self.begin(Work::Latch);
                self.parts[0] = Part::Todo;
            }
            Work::Latch if self.parts[0] == Part::Done => {
                self.begin(Work::Read);
                for (part, device) in self.parts.iter_mut().zip(devices.iter()) {
                    *part = if Self::is_asked(device) { Part::Todo } else { Part::Done };
                }
            }
            Work::Read if self.is_done(devices.len()) => {
                self.compute(devices);
                self.begin(Work::Write);
                for (part, device) in self.parts.iter_mut().zip(devices.iter()) {
                    *part = if device.step == Step::Clock {
                        Part::Todo
                    } else {
                        Part::Done
                    };
                }
            }
            Work::Write if self.is_done(devices.len()) => {
                self.begin(Work::None);
                return true;
            }
            _ => {}
        }
        false
    }

    fn begin(&mut self, work: Work) {
        self.work = work;
        (self.queued, self.answered) = (0, 0);
    }

    fn is_done(&self, count: usize) -> bool {
        self.parts[..count].iter().all(|part| *part == Part::Done)
    }

    /// Offsets of all that were read, delays where all were.
    fn compute(&mut self, devices: &mut [Device<'_>]) {
        let count = devices.len();
        for (times, device) in self.times.iter_mut().zip(devices.iter()) {
            times.has_clock = Self::is_asked(device);
            times.open = [0, 1, 2, 3].map(|port| device.ports.is_open(port));
        }
        let is_left_alone = |device: &Device<'_>| !device.chip.has_clock() || device.config.is_none();
        let all = devices
            .iter()
            .all(|device| is_left_alone(device) || Self::is_asked(device));
        if all && !self.delays_known {
            let delays = delays::<N>(&self.times[..count]);
            for (device, delay_ns) in devices.iter_mut().zip(delays) {
                device.clock.delay_ns = delay_ns;
            }
            self.delays_known = true;
        }
        let leads = |device: &Device<'_>| device.clock.is_right && Self::is_asked(device);
        let leading = devices.iter().position(leads);
        let first = leading.or_else(|| devices.iter().position(Self::is_asked));
        let Some(first) = first else { return };
        if leading.is_none() {
            // Nobody knows a time: it begins anew.
            self.offset_ns[first] = 0;
            self.restarted = true;
        }
        let led_ns = self.unit_ns[first].wrapping_add(self.offset_ns[first]);
        for (at, device) in devices.iter().enumerate() {
            if device.step == Step::Clock && at != first {
                let way_ns = i64::from(device.clock.delay_ns) - i64::from(devices[first].clock.delay_ns);
                let own_ns = led_ns.wrapping_add_signed(way_ns);
                self.offset_ns[at] = own_ns.wrapping_sub(self.unit_ns[at]);
            }
        }
    }

    /// Adds a datagram, if there is one to be sent and room for it.
    pub(super) fn ask(&mut self, devices: &[Device<'_>], writer: &mut FrameWriter<'_>, index: u8) -> bool {
        let Some(at) = self.next(devices.len()) else {
            return false;
        };
        if self.queued + 2 > self.queue.len() {
            return false;
        }
        let device = &devices[at];
        let address = |register: u16| register::station(device.station(), register);
        let written = match self.work {
            Work::None => return false,
            Work::Latch => writer.push(Command::Bwr, index, register::station(0, register::DC_RECEIVE_TIMES), 4),
            Work::Read => writer.push(Command::Fprd, index, address(register::DC_RECEIVE_TIMES), TIMES_LEN),
            Work::Write if self.is_second(at) => {
                writer.push_data(Command::Fpwr, index, address(register::DC_SPEED_START), &LOOP)
            }
            Work::Write => {
                let mut octets = [0; 12];
                let offset_ns = self.offset_ns[at];
                // Clocks of 32 bits have no upper half.
                let offset_ns = if device.chip.has_wide_clock() {
                    offset_ns
                } else {
                    offset_ns & 0xFFFF_FFFF
                };
                octets[..8].copy_from_slice(&offset_ns.to_le_bytes());
                octets[8..].copy_from_slice(&device.clock.delay_ns.to_le_bytes());
                writer.push_data(Command::Fpwr, index, address(register::DC_OFFSET), &octets)
            }
        };
        if written.is_err() {
            return false;
        }
        let is_second = self.is_second(at);
        self.queue[self.queued] = (at as u16, is_second);
        self.queued += 1;
        if self.work != Work::Write || is_second {
            self.parts[at] = Part::Asked;
        }
        true
    }

    /// The device that is asked next.
    fn next(&self, count: usize) -> Option<usize> {
        if self.work == Work::None {
            return None;
        }
        let count = if self.work == Work::Latch { 1 } else { count };
        self.parts[..count].iter().position(|part| *part == Part::Todo)
    }

    /// The offset of a device is in this frame already: the loop comes next.
    fn is_second(&self, at: usize) -> bool {
        self.work == Work::Write && self.queue[..self.queued].contains(&(at as u16, false))
    }

    /// The frame was lost: all of it is asked once more, and measured anew.
    pub(super) fn lost(&mut self) {
        if self.work != Work::None {
            self.begin(Work::None);
        }
    }

    pub(super) fn answer(&mut self, devices: &mut [Device<'_>], datagram: &Datagram<'_>) {
        let (at, is_second) = self.queue[self.answered.min(self.queue.len() - 1)];
        self.answered += 1;
        let at = usize::from(at);
        if datagram.working_counter == 0 && self.work != Work::Latch {
            // It has gone meanwhile; the others are measured without it.
            if at < devices.len() && devices[at].step == Step::Clock {
                self.begin(Work::None);
            }
            self.parts[at] = Part::Done;
            return;
        }
        match self.work {
            Work::Read => {
                if let Ok(times) = register::receive_times(datagram.data) {
                    self.times[at].times = times;
                }
                self.unit_ns[at] = array(datagram.data, 0x18).map_or(0, u64::from_le_bytes);
                self.parts[at] = Part::Done;
            }
            Work::Write if is_second => self.parts[at] = Part::Done,
            Work::Latch => self.parts[0] = Part::Done,
            Work::Write | Work::None => {}
        }
        if self.answered == self.queued {
            (self.queued, self.answered) = (0, 0);
        }
    }
}
