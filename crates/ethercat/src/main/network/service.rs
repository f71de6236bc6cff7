//! Frames of services, one at a time: counting and resetting, clocks, the survey, the next datagram of every device.
//!
//! In:  the time, frames that come. Out: the next frame; what came of each of its datagrams, to who has asked for it.

use super::start::{Stage, reset};
use super::{MainDevice, Received};
use crate::main::cycle::{Came, INDEX_END};
use crate::main::device::{Now, Step};
use crate::main::event::Event;
use crate::wire::register::{self, AlControl, AlState};
use crate::wire::{Addressing, BROADCAST, Command, Datagram, FRAME_LEN_MAX, Frame, FrameWriter, Mac, answers};

/// Datagrams in a frame of services.
const DATAGRAMS_MAX: usize = 128;
/// Between two events of main devices with different addresses.
const OTHERS_APART_NS: u64 = 1_000_000_000;

/// Who has asked a datagram of the frame that is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    Network,
    Device(usize),
    Clocks,
    Survey,
}

/// Owners of the datagrams of a frame, in their order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Owners {
    list: [Owner; DATAGRAMS_MAX],
    used: usize,
}

impl Owners {
    fn has_room(&self) -> bool {
        self.used < DATAGRAMS_MAX
    }

    pub(super) fn push(&mut self, owner: Owner) {
        self.list[self.used] = owner;
        self.used += 1;
    }
}

/// The frame of services.
#[derive(Clone, Debug)]
pub(super) struct Service {
    octets: [u8; FRAME_LEN_MAX],
    length: usize,
    owners: Owners,
    index: u8,
    /// When it has left; `None`: none is under way.
    pub(super) sent_ns: Option<u64>,
}

impl Service {
    /// Nothing was sent yet.
    pub(super) const NONE: Service = Service {
        octets: [0; FRAME_LEN_MAX],
        length: 0,
        owners: Owners {
            list: [Owner::Network; DATAGRAMS_MAX],
            used: 0,
        },
        index: INDEX_END,
        sent_ns: None,
    };

    /// Begins another frame. Those of services have the upper half of the indices.
    fn begin(&mut self) -> u8 {
        self.owners.used = 0;
        self.index = self.index.wrapping_add(1) | INDEX_END;
        self.index
    }

    fn octets(&self) -> &[u8] {
        &self.octets[..self.length]
    }

    /// Whether this is the answer to the frame that is under way.
    fn is_answered_by(&self, frame: &Frame<'_>) -> bool {
        if self.sent_ns.is_none() || frame.datagrams().count() != self.owners.used {
            return false;
        }
        let Ok(sent) = Frame::parse(self.octets()) else {
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
}

impl<const N: usize, const F: usize> MainDevice<'_, N, F> {
    /// The next frame of a service, to be sent now; `None`: one is under way, or there is nothing to ask.
    pub fn service_frame(&mut self, now_ns: u64) -> Option<&[u8]> {
        self.poll(now_ns);
        if self.service.sent_ns.is_some() {
            return None;
        }
        self.build(now_ns);
        if self.service.owners.used == 0 {
            return None;
        }
        self.service.sent_ns = Some(now_ns);
        Some(self.service.octets())
    }

    /// Time passes.
    pub fn poll(&mut self, now_ns: u64) {
        let is_lost = |sent_ns: u64| now_ns.saturating_sub(sent_ns) >= self.config.times.frame_ns;
        if self.service.sent_ns.is_some_and(is_lost) {
            self.service.sent_ns = None;
            self.counters.services_lost = self.counters.services_lost.saturating_add(1);
            self.survey.want_later(now_ns);
            for owner in 0..self.service.owners.used {
                match self.service.owners.list[owner] {
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
        let leads = self.clocks.reference.is_some() && self.grid_ns.is_some();
        let now = Now {
            bus_ns: self.bus_ns.filter(|_| leads),
            ..self.now(now_ns)
        };
        let service = &mut self.service;
        let index = service.begin();
        let Ok(mut writer) = FrameWriter::new(&mut service.octets, BROADCAST, self.mac) else {
            return;
        };
        let owners = &mut service.owners;
        match self.stage {
            Stage::Count { .. } => {
                if writer.push(Command::Brd, index, 0, 1).is_ok() {
                    owners.push(Owner::Network);
                }
            }
            Stage::Reset => {
                if reset(&mut writer, index, owners).is_err() {
                    return;
                }
            }
            Stage::Identify | Stage::Run => {
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
        if !self.service.is_answered_by(&frame) {
            self.counters.late = self.counters.late.saturating_add(1);
            return Received::Late;
        }
        self.service.sent_ns = None;
        for (number, datagram) in frame.datagrams().enumerate() {
            self.answer(now_ns, self.service.owners.list[number], &datagram);
        }
        self.answered_all(now_ns);
        Received::Service
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

    /// Asks all devices to go to INIT; they are not brought up again.
    pub fn shut_down_frame(&mut self) -> &[u8] {
        self.shutting_down = true;
        let index = self.service.begin();
        self.service.sent_ns = None;
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
        self.service.octets()
    }
}
