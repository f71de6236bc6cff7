//! The main device: all devices on the wire, from the count of them to OP, and what becomes of them there.
//!
//! In:  the configuration, outputs, frames that come, the time. Out: frames of each cycle and frames of services, inputs, events.
//! RT: no allocation, no locks, bounded.
//!
//! A caller sends the frames of a cycle at its date, hands over all that comes, and ends the cycle. Between, it sends the frames of
//! services, one at a time.

mod diagnosis;
mod events;
mod service;
mod start;

pub use diagnosis::Diagnosis;

use super::budget::Budget;
use super::clocks::Clocks;
use super::config::Config;
use super::cycle::{Answered, CyclicFrames, Member};
use super::device::{Device, Notice, Now, Step};
use super::event::{Event, SetupError};
use super::orders::Orders;
use super::phase::phase_ns;
use super::punctuality::{Punctuality, Window};
use super::survey::Survey;
use crate::wire::coe::Object;
use crate::wire::register::{AlState, AlStatusCode};
use crate::wire::{Mac, WireError};
use events::Events;
use service::Service;
use start::Stage;

/// What a frame that came was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// The answer to a frame of this cycle.
    Cyclic,
    /// The answer to the frame of a service.
    Service,
    /// The answer to a frame that was given up, or a second one.
    Late,
    /// Our own frame, which has been through no device.
    Echo,
    /// A frame of another main device.
    Foreign,
    /// No EtherCAT.
    Other,
}

/// What a device is like, for the application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceState {
    /// Not found yet.
    Absent,
    /// On its way to OP.
    Coming,
    /// In OP.
    Operational,
    /// It was in OP, or refuses to come there.
    Faulted,
}

/// Frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Cycles.
    pub cycles: u32,
    /// Frames of services that were lost.
    pub services_lost: u32,
    /// Answers that came too late, or twice.
    pub late: u32,
    /// Own frames that came back as they were.
    pub echoes: u32,
    /// Frames of other main devices.
    pub foreign: u32,
    /// Events that found no room.
    pub events_dropped: u32,
}

/// The main device of up to `N` devices on the wire, with up to `F` frames a cycle.
#[derive(Clone, Debug)]
pub struct MainDevice<'a, const N: usize, const F: usize> {
    config: &'a Config<'a>,
    mac: Mac,
    cyclic: CyclicFrames<N, F>,
    devices: [Device<'a>; N],
    count: usize,
    /// The device of each part of the configuration.
    places: [Option<usize>; N],
    stage: Stage,
    service: Service,
    clocks: Clocks<N>,
    survey: Survey<N>,
    orders: Orders,
    events: Events,
    counters: Counters,
    /// The device that is set up anew, one at a time.
    returning: Option<usize>,
    /// Who is asked first in the next frame.
    turn: usize,
    /// Time of the bus in the last cycle, and where dates lie in it.
    bus_ns: Option<u64>,
    grid_ns: Option<u64>,
    window: Window,
    /// The other main device that was told last, and when.
    other_main: Option<(Mac, u64)>,
    /// Since when more devices answer than were counted.
    more_since_ns: Option<u64>,
    shutting_down: bool,
}

impl<'a, const N: usize, const F: usize> MainDevice<'a, N, F> {
    /// Nothing is sent yet.
    ///
    /// # Errors
    /// [`WireError::NoRoom`] where process data do not fit into `F` frames, or devices are more than `N`.
    pub fn new(mac: Mac, config: &'a Config<'a>) -> Result<MainDevice<'a, N, F>, WireError> {
        let mut logical = 0;
        let members = config.devices.iter().map(|device| {
            let member = Member::one(logical, device.outputs.octets, device.inputs.octets);
            logical += member.octets() as u32;
            member
        });
        let cyclic = CyclicFrames::new(mac, members)?;
        Ok(MainDevice {
            config,
            mac,
            cyclic,
            devices: core::array::from_fn(|position| Device::new(position as u16)),
            count: 0,
            places: [None; N],
            stage: Stage::COUNT,
            service: Service::NONE,
            clocks: Clocks::new(),
            survey: Survey::new(),
            orders: Orders::NONE,
            events: Events::NONE,
            counters: Counters::default(),
            returning: None,
            turn: 0,
            bus_ns: None,
            grid_ns: None,
            window: Window::new(),
            other_main: None,
            more_since_ns: None,
            shutting_down: false,
        })
    }

    fn now(&self, ns: u64) -> Now<'a> {
        Now {
            config: self.config,
            ns,
            bus_ns: self.bus_ns,
            grid_ns: self.grid_ns.unwrap_or(0),
            cycle: self.counters.cycles,
            count: self.count,
        }
    }

    // --- The cycle ---

    /// Outputs of a device, by its number in the configuration.
    pub fn outputs_mut(&mut self, device: usize) -> &mut [u8] {
        self.cyclic.outputs_mut(device)
    }

    /// Its inputs: the last that came.
    pub fn inputs(&self, device: usize) -> &[u8] {
        self.cyclic.inputs(device)
    }

    /// How it has answered in the last cycle.
    pub fn answered(&self, device: usize) -> Answered {
        self.cyclic.answered(device)
    }

    /// Makes the next cycle ready; how many frames it has, 0 before all devices are known.
    pub fn prepare(&mut self) -> usize {
        if !matches!(self.stage, Stage::Run) {
            return 0;
        }
        let cycle_ns = u64::from(self.config.cycle_ns);
        self.cyclic
            .make_ready(self.bus_ns.map_or(0, |bus_ns| bus_ns.wrapping_add(cycle_ns)));
        self.cyclic.len()
    }

    /// What a cycle costs.
    pub fn budget(&self) -> Budget {
        let lengths = (0..self.cyclic.len()).map(|number| self.cyclic.frame(number).len());
        Budget::of(lengths, self.config.devices.len(), self.config.cycle_ns)
    }

    /// How cycles lie to SYNC0 of a device, in the last window of cycles; `None`: it has none, or there was no window yet.
    pub fn punctuality(&self, device: usize) -> Option<Punctuality> {
        let shift_ns = self.config.devices.get(device)?.clock?.shift_ns;
        self.window.punctuality(shift_ns, self.config.cycle_ns)
    }

    /// A frame of the cycle that is ready, to be sent once.
    pub fn frame(&self, number: usize) -> &[u8] {
        self.cyclic.frame(number)
    }

    /// All frames of the cycle have come back.
    pub fn cycle_is_whole(&self) -> bool {
        self.cyclic.is_whole()
    }

    /// By how much the last cycle came behind its date by the clock of the bus, ns; `None`: nobody leads, or its frame was lost.
    pub fn late_ns(&self) -> Option<i64> {
        let bus_ns = self.cyclic.bus_ns()?;
        let grid_ns = self.grid_ns?;
        Some(phase_ns(bus_ns.wrapping_sub(grid_ns), self.config.cycle_ns, 0))
    }

    /// The time of the cycle is over; answers that did not come in it.
    pub fn finish_cycle(&mut self, now_ns: u64) -> u32 {
        if !matches!(self.stage, Stage::Run) {
            return 0;
        }
        let is_whole = self.cyclic.is_whole();
        let lost = self.cyclic.finish();
        self.counters.cycles = self.counters.cycles.wrapping_add(1);
        self.follow_bus();
        self.window.add(self.late_ns());
        let now = self.now(now_ns);
        let present = usize::from(self.cyclic.present());
        let (state, error) = self.cyclic.states();
        let all_op = state == AlState::Op && !error && present >= self.count;
        for number in 0..self.config.devices.len() {
            let Some(at) = self.places[number] else { continue };
            let answered = self.cyclic.answered(number);
            let device = &mut self.devices[at];
            if !matches!(device.step, Step::Run | Step::Look) {
                continue;
            }
            let config = &self.config.devices[number];
            let expected = Member::one(0, config.outputs.octets, config.inputs.octets).expected;
            if answered.lost_in_row > self.config.lost_max {
                let working_counter = answered.working_counter;
                self.events.push(Event::Lost {
                    device: number as u16,
                    working_counter,
                    expected,
                });
                // That it is gone is told by this.
                let _ = device.fail(&now, SetupError::Gone);
                device.told = Some(SetupError::Gone);
                self.clocks.gone(at);
                self.orders.drop_device(number, SetupError::Gone);
                self.survey.want(now_ns);
            } else if is_whole && (!answered.fresh || expected == 0 && config.goal == AlState::Op && !all_op) {
                device.look(&now);
                self.survey.want_later(now_ns);
            }
        }
        if is_whole && present < self.count {
            self.survey.want(now_ns);
        } else if !is_whole {
            self.survey.want_later(now_ns);
        }
        if is_whole {
            self.extend(now_ns);
        }
        self.choose_reference();
        lost
    }

    /// What the last cycle says of the time.
    fn follow_bus(&mut self) {
        match self.cyclic.bus_ns() {
            Some(bus_ns) => {
                self.bus_ns = Some(bus_ns);
                // Dates are where they are; the first SYNC0 goes by them.
                self.grid_ns
                    .get_or_insert(bus_ns % u64::from(self.config.cycle_ns.max(1)));
            }
            None => {
                let cycle_ns = u64::from(self.config.cycle_ns);
                self.bus_ns = self.bus_ns.map(|bus_ns| bus_ns.wrapping_add(cycle_ns));
            }
        }
    }

    /// The first device whose clock is right leads.
    fn choose_reference(&mut self) {
        let first = self.clocks.choose(&self.devices[..self.count]);
        if first != self.clocks.reference {
            self.clocks.reference = first;
            self.cyclic.set_reference(first.map(|at| self.devices[at].station()));
        }
    }

    /// What goes on while devices come up and run.
    fn run(&mut self, now_ns: u64) {
        for at in 0..self.count {
            if self.devices[at].step == Step::Identified {
                self.identified(now_ns, at);
            }
        }
        let now = self.now(now_ns);
        let set = self.clocks.run(&mut self.devices[..self.count]);
        if set {
            if core::mem::take(&mut self.clocks.restarted) {
                (self.bus_ns, self.grid_ns) = (None, None);
                // Who still has the time before is told this one, and when SYNC0 comes by it.
                for device in &mut self.devices[..self.count] {
                    device.time_has_restarted();
                }
            }
            for device in &mut self.devices[..self.count] {
                if device.step == Step::Clock {
                    device.clock_is_set(&now);
                }
            }
            self.choose_reference();
        }
        if let Some(event) = self.survey.run(now_ns, &mut self.devices[..self.count]) {
            self.events.push(event);
        }
        if self
            .returning
            .is_some_and(|at| matches!(self.devices[at].step, Step::Away | Step::Run | Step::Stranger))
        {
            self.returning = None;
        }
        if self.returning.is_none() && !self.shutting_down {
            let turns = (0..self.count).map(|step| (self.turn + step) % self.count);
            let mut due = turns.filter(|at| self.devices[*at].is_due(now_ns));
            if let Some(at) = due.next() {
                self.returning = Some(at);
                self.turn = (at + 1) % self.count;
                self.devices[at].enter(Step::Find, &now);
            }
        }
    }

    /// What has become of a device.
    fn notice(&mut self, now_ns: u64, at: usize, notice: Notice) {
        let Some((number, _)) = self.devices[at].config else {
            return;
        };
        let device = number as u16;
        match notice {
            Notice::Up => self.events.push(Event::Up { device }),
            Notice::Emergency(emergency) => self.events.push_unasked(Event::Emergency { device, emergency }),
            Notice::Left(state, code) => {
                self.events.push(Event::Left {
                    device,
                    at: state,
                    code,
                });
                self.orders.drop_device(number, left(state, code));
            }
            Notice::Failed(error) => {
                if self.devices[at].told != Some(error) {
                    self.devices[at].told = Some(error);
                    self.events.push(Event::Failed { device, error });
                }
                if error == SetupError::Gone {
                    self.clocks.gone(at);
                    self.survey.want(now_ns);
                }
                self.orders.drop_device(number, error);
            }
            Notice::Lacks(object) => self.events.push(Event::Lacks { device, object }),
            Notice::Slow(least_ns) => self.events.push(Event::Slow { device, least_ns }),
            Notice::Other(station) => {
                let position = self.devices[at].position;
                let event = Event::OrderChanged {
                    device,
                    position,
                    station,
                };
                if self.devices[at].told_other != Some(station) {
                    self.devices[at].told_other = Some(station);
                    self.events.push(event);
                }
            }
        }
    }

    // --- For the application ---

    /// Next thing that happened.
    pub fn pop_event(&mut self) -> Option<Event> {
        self.events.pop()
    }

    /// Frames so far.
    pub fn counters(&self) -> Counters {
        Counters {
            events_dropped: self.events.dropped,
            ..self.counters
        }
    }

    /// What a device is like, by its number in the configuration.
    pub fn device_state(&self, device: usize) -> DeviceState {
        let Some(at) = self.places.get(device).copied().flatten() else {
            return DeviceState::Absent;
        };
        let device = &self.devices[at];
        match device.step {
            Step::Run | Step::Look => DeviceState::Operational,
            Step::Away => DeviceState::Faulted,
            _ if device.told.is_some() => DeviceState::Faulted,
            _ => DeviceState::Coming,
        }
    }

    /// All devices of the configuration are in OP.
    pub fn is_operational(&self) -> bool {
        (0..self.config.devices.len()).all(|device| self.device_state(device) == DeviceState::Operational)
    }

    /// What the EEPROM of a device says, and its position.
    pub fn found(&self, device: usize) -> Option<(u16, &super::eeprom::Found)> {
        let at = self.places.get(device).copied().flatten()?;
        Some((self.devices[at].position, &self.devices[at].found))
    }

    /// Orders the value of an object to be read; a number for [`MainDevice::sdo_result`], or `None` while too many are under way.
    pub fn sdo_read(&mut self, device: usize, object: Object) -> Option<usize> {
        self.sdo(device, object, None)
    }

    /// Orders a value to be written.
    pub fn sdo_write(&mut self, device: usize, object: Object, value: &[u8]) -> Option<usize> {
        self.sdo(device, object, Some(value))
    }

    fn sdo(&mut self, device: usize, object: Object, write: Option<&[u8]>) -> Option<usize> {
        let order = self.orders.put(device, object, write)?;
        let at = self.places.get(device).copied().flatten();
        if !at.is_some_and(|at| self.devices[at].takes_orders()) {
            self.orders.drop_device(device, SetupError::Gone);
        }
        Some(order)
    }

    /// Result of an order that is done, once: the value that was read, or nothing.
    pub fn sdo_result(&mut self, order: usize) -> Option<Result<&[u8], SetupError>> {
        self.orders.result(order)
    }
}

/// Why a device that has left OP answers no order.
fn left(at: AlState, code: AlStatusCode) -> SetupError {
    SetupError::Refused {
        state: AlState::Op,
        at,
        code,
        set_up: super::event::SetUp::default(),
    }
}
