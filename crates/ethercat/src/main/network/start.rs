//! From the count of the devices to the one that each part of the configuration means.
//!
//! In:  how many devices answer, what each says it is. Out: devices with their part of the configuration, which come up from there.

use super::MainDevice;
use super::service::{Owner, Owners};
use crate::main::clocks::Clocks;
use crate::main::config::Place;
use crate::main::cycle::Member;
use crate::main::device::{Device, Step};
use crate::main::event::{Event, SetupError};
use crate::main::survey::Survey;
use crate::wire::register::{self, AlControl, AlState, Fmmu, SyncManager};
use crate::wire::{Command, FrameWriter, WireError};

/// The number of devices has to stay the same for so long before it counts.
const COUNT_NS: u64 = 20_000_000;
/// Devices that the configuration has are waited for so long.
const MISSING_NS: u64 = 3_000_000_000;
/// Frames without an answer between two events that say so.
const SILENT: u32 = 200;
/// All FMMUs and SyncManagers that a chip can have.
const FMMUS: usize = 16;
const MANAGERS: usize = 16;

/// Where the network is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
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
    pub(super) const COUNT: Stage = Stage::Count {
        seen: 0,
        since_ns: 0,
        begun_ns: 0,
        unanswered: 0,
    };
}

impl<'a, const N: usize, const F: usize> MainDevice<'a, N, F> {
    pub(super) fn network_lost(&mut self) {
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

    pub(super) fn counted(&mut self, now_ns: u64, devices: u16) {
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
    pub(super) fn identify(&mut self, now_ns: u64) {
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
    pub(super) fn extend(&mut self, now_ns: u64) {
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
    pub(super) fn identified(&mut self, now_ns: u64, at: usize) {
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
}

/// All devices go to INIT and forget what they were told.
pub(super) fn reset(writer: &mut FrameWriter<'_>, index: u8, owners: &mut Owners) -> Result<(), WireError> {
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
