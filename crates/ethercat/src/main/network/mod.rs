//! The main device: all devices on the wire, from the count of them to OP, and what becomes of them there.
//!
//! In:  the configuration, outputs, frames that come, the time. Out: frames of each cycle and frames of services, inputs, events.
//! RT: no allocation, no locks, bounded.
//!
//! A caller sends the frames of a cycle at its date, hands over all that comes, and ends the cycle. Between, it sends the frames of
//! services, one at a time.

mod diagnosis;
mod events;

pub use diagnosis::Diagnosis;

use super::budget::Budget;
use super::clocks::Clocks;
use super::config::{Config, Place};
use super::cycle::{Answered, Came, CyclicFrames, INDEX_END, Member};
use super::device::{Device, Notice, Now, Step};
use super::event::{Event, SetupError};
use super::orders::Orders;
use super::phase::phase_ns;
use super::punctuality::{Punctuality, Window};
use super::survey::Survey;
use crate::wire::coe::Object;
use crate::wire::register::{self, AlControl, AlState, AlStatusCode, Fmmu, SyncManager};
use crate::wire::{
    Addressing, BROADCAST, Command, Datagram, FRAME_LEN_MAX, Frame, FrameWriter, Mac, WireError, answers,
};
use events::Events;

/// Datagrams in a frame of services.
const DATAGRAMS_MAX: usize = 128;
/// The number of devices has to stay the same for so long before it counts.
const COUNT_NS: u64 = 20_000_000;
/// Devices that the configuration has are waited for so long.
const MISSING_NS: u64 = 3_000_000_000;
/// Between two events of main devices with different addresses.
const OTHERS_APART_NS: u64 = 1_000_000_000;
/// Frames without an answer between two events that say so.
const SILENT: u32 = 200;
/// All FMMUs and SyncManagers that a chip can have.
const FMMUS: usize = 16;
const MANAGERS: usize = 16;

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

/// Where the network is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Devices are counted: how many, since when; frames that were not answered.
    Count {
        seen: u16,
        since_ns: u64,
        begun_ns: u64,
        unanswered: u32,
    },
    /// All that may be left of a start before is cleared.
    Reset,
    /// Each device says what it is.
    Identify,
    /// Each is brought to OP and kept there.
    Run,
}

impl Stage {
    /// Nobody was counted yet.
    const COUNT: Stage = Stage::Count {
        seen: 0,
        since_ns: 0,
        begun_ns: 0,
        unanswered: 0,
    };
}

/// Who has asked a datagram of the frame that is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owner {
    Network,
    Device(usize),
    Clocks,
    Survey,
}

/// The frame of services.
#[derive(Clone, Debug)]
struct Service {
    octets: [u8; FRAME_LEN_MAX],
    length: usize,
    owners: [Owner; DATAGRAMS_MAX],
    used: usize,
    index: u8,
    /// When it has left; `None`: none is under way.
    sent_ns: Option<u64>,
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
            service: Service {
                octets: [0; FRAME_LEN_MAX],
                length: 0,
                owners: [Owner::Network; DATAGRAMS_MAX],
                used: 0,
                index: INDEX_END,
                sent_ns: None,
            },
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

    // --- Services ---

    /// The next frame of a service, to be sent now; `None`: one is under way, or there is nothing to ask.
    pub fn service_frame(&mut self, now_ns: u64) -> Option<&[u8]> {
        self.poll(now_ns);
        if self.service.sent_ns.is_some() {
            return None;
        }
        self.build(now_ns);
        if self.service.used == 0 {
            return None;
        }
        self.service.sent_ns = Some(now_ns);
        Some(&self.service.octets[..self.service.length])
    }

    /// Time passes.
    pub fn poll(&mut self, now_ns: u64) {
        let is_lost = |sent_ns: u64| now_ns.saturating_sub(sent_ns) >= self.config.times.frame_ns;
        if self.service.sent_ns.is_some_and(is_lost) {
            self.service.sent_ns = None;
            self.counters.services_lost = self.counters.services_lost.saturating_add(1);
            self.survey.want_later(now_ns);
            for owner in 0..self.service.used {
                match self.service.owners[owner] {
                    Owner::Device(at) => self.devices[at].lost(),
                    Owner::Network => self.network_lost(),
                    Owner::Clocks => self.clocks.lost(),
                    Owner::Survey => self.survey.lost(),
                }
            }
        }
        let now = self.now(now_ns);
        for at in 0..self.count {
            if let Some(notice) = self.devices[at].poll(&now, &mut self.orders) {
                self.notice(now_ns, at, notice);
            }
        }
        match self.stage {
            Stage::Identify => self.identify(now_ns),
            Stage::Run => self.run(now_ns),
            Stage::Count { .. } | Stage::Reset => {}
        }
    }

    fn build(&mut self, now_ns: u64) {
        let service = &mut self.service;
        service.used = 0;
        // Frames of services have the upper half of the indices.
        service.index = service.index.wrapping_add(1) | INDEX_END;
        let index = service.index;
        let Ok(mut writer) = FrameWriter::new(&mut service.octets, BROADCAST, self.mac) else {
            return;
        };
        let mut owners = Owners {
            owners: &mut service.owners,
            used: 0,
        };
        match self.stage {
            Stage::Count { .. } => {
                if writer.push(Command::Brd, index, 0, 1).is_ok() {
                    owners.push(Owner::Network);
                }
            }
            Stage::Reset => {
                if reset(&mut writer, index, &mut owners).is_err() {
                    return;
                }
            }
            Stage::Identify | Stage::Run => {
                let now = Now {
                    config: self.config,
                    ns: now_ns,
                    bus_ns: self
                        .bus_ns
                        .filter(|_| self.clocks.reference.is_some() && self.grid_ns.is_some()),
                    grid_ns: self.grid_ns.unwrap_or(0),
                    cycle: self.counters.cycles,
                    count: self.count,
                };
                let devices = &mut self.devices[..self.count];
                // What is measured has to be read before it is measured again: nobody else is asked then.
                while owners.has_room() && self.clocks.ask(devices, &mut writer, index) {
                    owners.push(Owner::Clocks);
                }
                while owners.has_room() && self.survey.ask(now_ns, devices, &mut writer, index) {
                    owners.push(Owner::Survey);
                }
                let turn = self.turn;
                for step in 0..devices.len() {
                    let at = (turn + step) % devices.len();
                    if !owners.has_room() {
                        break;
                    }
                    match devices[at].ask(&now, &mut self.orders, &mut writer, index) {
                        Ok(true) => owners.push(Owner::Device(at)),
                        Ok(false) => {}
                        // Who found no room is the first one in the next frame.
                        Err(_) => {
                            self.turn = at;
                            break;
                        }
                    }
                }
            }
        }
        service.used = owners.used;
        service.length = writer.finish();
    }

    /// A frame came.
    pub fn receive(&mut self, now_ns: u64, octets: &[u8]) -> Received {
        match self.cyclic.receive(octets) {
            Came::Answer => return Received::Cyclic,
            Came::Late => {
                self.counters.late = self.counters.late.saturating_add(1);
                return Received::Late;
            }
            Came::Other => {}
        }
        let Ok(frame) = Frame::parse(octets) else {
            return Received::Other;
        };
        if !answers(frame.source, self.mac) {
            if frame.source == self.mac {
                self.counters.echoes = self.counters.echoes.saturating_add(1);
                return Received::Echo;
            }
            self.counters.foreign = self.counters.foreign.saturating_add(1);
            let is_news = |(told, told_ns): (Mac, u64)| told != frame.source && now_ns - told_ns >= OTHERS_APART_NS;
            if self.other_main.is_none_or(is_news) {
                self.other_main = Some((frame.source, now_ns));
                self.events.push_unasked(Event::OtherMain { source: frame.source });
            }
            return Received::Foreign;
        }
        if !self.is_service(&frame) {
            self.counters.late = self.counters.late.saturating_add(1);
            return Received::Late;
        }
        self.service.sent_ns = None;
        for (number, datagram) in frame.datagrams().enumerate() {
            self.answer(now_ns, self.service.owners[number], &datagram);
        }
        self.answered_all(now_ns);
        Received::Service
    }

    /// Whether this is the answer to the frame that is under way.
    fn is_service(&self, frame: &Frame<'_>) -> bool {
        if self.service.sent_ns.is_none() || frame.datagrams().count() != self.service.used {
            return false;
        }
        let Ok(sent) = Frame::parse(&self.service.octets[..self.service.length]) else {
            return false;
        };
        frame.datagrams().zip(sent.datagrams()).all(|(came, sent)| {
            // Devices count the others by it.
            let is_same_device = came.adp() == sent.adp() || came.command.addressing() != Addressing::Station;
            is_same_device
                && (came.command, came.index, came.ado(), came.data.len())
                    == (sent.command, sent.index, sent.ado(), sent.data.len())
        })
    }

    fn answer(&mut self, now_ns: u64, owner: Owner, datagram: &Datagram<'_>) {
        let now = self.now(now_ns);
        match owner {
            Owner::Device(at) => {
                let device = &mut self.devices[at];
                let notice = device.answer(&now, datagram.working_counter, datagram.data, &mut self.orders);
                if let Some(notice) = notice {
                    self.notice(now_ns, at, notice);
                }
            }
            Owner::Clocks => self.clocks.answer(&mut self.devices[..self.count], datagram),
            Owner::Survey => self.survey.answer(datagram),
            Owner::Network => {
                if let Stage::Count { .. } = self.stage {
                    self.counted(now_ns, datagram.working_counter);
                }
            }
        }
    }

    /// All datagrams of the frame were looked at.
    fn answered_all(&mut self, now_ns: u64) {
        if self.stage == Stage::Reset {
            let now = self.now(now_ns);
            for device in &mut self.devices[..self.count] {
                device.enter(Step::Address, &now);
            }
            self.stage = Stage::Identify;
        }
    }

    // --- From the count to OP ---

    fn network_lost(&mut self) {
        match &mut self.stage {
            Stage::Count { unanswered, .. } => {
                *unanswered += 1;
                if unanswered.is_multiple_of(SILENT) {
                    let sent = *unanswered;
                    self.events.push(Event::Silent { sent });
                }
            }
            // Whoever was counted may be gone.
            Stage::Reset => self.stage = Stage::COUNT,
            Stage::Identify | Stage::Run => {}
        }
    }

    fn counted(&mut self, now_ns: u64, devices: u16) {
        let Stage::Count {
            seen,
            since_ns,
            begun_ns,
            ..
        } = self.stage
        else {
            return;
        };
        if devices != seen || devices == 0 {
            let mut begun_ns = if begun_ns == 0 { now_ns } else { begun_ns };
            if now_ns - begun_ns >= MISSING_NS {
                self.events.push(Event::Unsteady { devices, before: seen });
                begun_ns = now_ns;
            }
            self.stage = Stage::Count {
                seen: devices,
                since_ns: now_ns,
                begun_ns,
                unanswered: 0,
            };
            return;
        }
        let expected = self.config.devices.iter().map(|device| match device.place {
            Place::Position(position) => usize::from(position) + 1,
            Place::Alias(_) => 0,
        });
        let expected = expected.max().unwrap_or(0).max(self.config.devices.len());
        let wait_ns = if usize::from(devices) < expected {
            MISSING_NS
        } else {
            COUNT_NS
        };
        if now_ns - since_ns < COUNT_NS || now_ns - begun_ns < wait_ns {
            return;
        }
        self.events.push(Event::Found { devices });
        if usize::from(devices) > N {
            self.events.push(Event::TooMany { devices });
        }
        self.count = usize::from(devices).min(N);
        for (position, device) in self.devices.iter_mut().enumerate() {
            *device = Device::new(position as u16);
        }
        self.places = [None; N];
        self.clocks = Clocks::new();
        self.survey = Survey::new();
        self.stage = Stage::Reset;
    }

    /// All devices say what they are; then each gets its part of the configuration.
    fn identify(&mut self, now_ns: u64) {
        let devices = &self.devices[..self.count];
        if devices.iter().any(|device| device.step < Step::Identified) {
            return;
        }
        self.stage = Stage::Run;
        self.survey.learn(&self.devices[..self.count]);
        for (number, config) in self.config.devices.iter().enumerate() {
            if let Some(at) = self.find(config.place) {
                self.take_place(number, at);
            } else {
                let error = SetupError::Missing(config.place);
                self.events.push(Event::Failed {
                    device: number as u16,
                    error,
                });
            }
        }
        for at in 0..self.count {
            if self.devices[at].step == Step::Identified {
                self.identified(now_ns, at);
            }
        }
    }

    fn take_place(&mut self, number: usize, at: usize) {
        self.places[number] = Some(at);
        self.devices[at].config = Some((number, &self.config.devices[number]));
        let before = self.config.devices[..number].iter();
        let octets = before.map(|device| Member::one(0, device.outputs.octets, device.inputs.octets).octets() as u32);
        self.devices[at].logical = octets.sum();
    }

    fn find(&self, place: Place) -> Option<usize> {
        let devices = &self.devices[..self.count];
        match place {
            Place::Position(position) => (usize::from(position) < self.count).then_some(position.into()),
            Place::Alias(alias) => devices
                .iter()
                .position(|device| device.step == Step::Identified && device.found.alias == alias),
        }
    }

    /// The part of the configuration that a device without one is meant by.
    fn place_of(&self, at: usize) -> Option<usize> {
        let device = &self.devices[at];
        let is_meant = |place: Place| match place {
            Place::Position(position) => position == device.position,
            Place::Alias(alias) => alias == device.found.alias,
        };
        let mut parts = self.config.devices.iter().zip(&self.places);
        parts.position(|(config, taken)| taken.is_none() && is_meant(config.place))
    }

    /// More devices answer than were counted: those behind the last one are looked at.
    fn extend(&mut self, now_ns: u64) {
        let present = usize::from(self.cyclic.present());
        if present <= self.count || present > N {
            self.more_since_ns = None;
            return;
        }
        let since_ns = *self.more_since_ns.get_or_insert(now_ns);
        if now_ns - since_ns < COUNT_NS {
            return;
        }
        // The ports of those that are known have changed.
        if self.survey.done_ns < since_ns {
            self.survey.want(now_ns);
            return;
        }
        self.more_since_ns = None;
        self.clocks.delays_known = false;
        self.events.push(Event::More {
            devices: present as u16,
        });
        let now = self.now(now_ns);
        for device in &mut self.devices[self.count..present] {
            device.enter(Step::FindPosition, &now);
        }
        self.count = present;
        self.survey.want_later(now_ns);
    }

    /// A device is known: is it the right one?
    fn identified(&mut self, now_ns: u64, at: usize) {
        let now = self.now(now_ns);
        let device = &self.devices[at];
        if device.config.is_none()
            && let Some(number) = self.place_of(at)
        {
            self.take_place(number, at);
        }
        let device = &mut self.devices[at];
        let Some((number, _)) = device.config else {
            let (position, identity) = (device.position, device.found.identity);
            device.enter(Step::Stranger, &now);
            self.events.push(Event::Stranger { position, identity });
            return;
        };
        match device.set_up(&now) {
            Ok(()) => {
                let position = device.position;
                self.events.push(Event::Identified {
                    device: number as u16,
                    position,
                });
            }
            Err(error) => {
                let notice = device.fail(&now, error);
                self.notice(now_ns, at, notice);
            }
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

    /// Asks all devices to go to INIT; they are not brought up again.
    pub fn shut_down_frame(&mut self) -> &[u8] {
        self.shutting_down = true;
        self.service.used = 0;
        self.service.sent_ns = None;
        self.service.index = self.service.index.wrapping_add(1) | INDEX_END;
        let index = self.service.index;
        let control = AlControl {
            state: AlState::Init,
            acknowledge: true,
            ask_id: false,
        };
        let octets = u16::from(control).to_le_bytes();
        if let Ok(mut writer) = FrameWriter::new(&mut self.service.octets, BROADCAST, self.mac) {
            let address = register::station(0, register::AL_CONTROL);
            let _ = writer.push_data(Command::Bwr, index, address, &octets);
            self.service.length = writer.finish();
        }
        &self.service.octets[..self.service.length]
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

/// Owners of the datagrams of a frame that is written.
struct Owners<'a> {
    owners: &'a mut [Owner; DATAGRAMS_MAX],
    used: usize,
}

impl Owners<'_> {
    fn has_room(&self) -> bool {
        self.used < DATAGRAMS_MAX
    }

    fn push(&mut self, owner: Owner) {
        self.owners[self.used] = owner;
        self.used += 1;
    }
}

/// All devices go to INIT and forget what they were told.
fn reset(writer: &mut FrameWriter<'_>, index: u8, owners: &mut Owners<'_>) -> Result<(), WireError> {
    let control = AlControl {
        state: AlState::Init,
        acknowledge: true,
        ask_id: false,
    };
    let all = |register: u16| register::station(0, register);
    writer.push_data(
        Command::Bwr,
        index,
        all(register::AL_CONTROL),
        &u16::from(control).to_le_bytes(),
    )?;
    writer.push(Command::Bwr, index, all(register::FMMU), Fmmu::LEN * FMMUS)?;
    writer.push(
        Command::Bwr,
        index,
        all(register::SYNC_MANAGER),
        SyncManager::LEN * MANAGERS,
    )?;
    writer.push(Command::Bwr, index, all(register::DC_SYNC_OWNER), 2)?;
    // Counters of errors and of lost links.
    writer.push(Command::Bwr, index, all(register::RX_ERRORS), 20)?;
    // Station addresses of a start before.
    writer.push(Command::Bwr, index, all(register::STATION), 2)?;
    for _ in 0..6 {
        owners.push(Owner::Network);
    }
    Ok(())
}
