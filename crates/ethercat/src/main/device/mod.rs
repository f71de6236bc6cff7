//! One device on the wire, from its station address to OP, and back to OP where it has left it.
//!
//! In:  its part of the configuration, what its datagrams bring back. Out: its next datagram; what has become of it.
//!
//! One datagram of a device is under way at a time. Devices know nothing of each other, so that all come up at once.

mod answers;
mod check;
mod chip;
mod registers;
mod sdos;
mod step;

use super::config::{Config, DeviceConfig};
use super::eeprom::{Found, Next, REPLY_LEN, Reader};
use super::event::SetupError;
use super::mail::Mailbox;
use super::mapping::Mapping;
use super::orders::Orders;
use crate::wire::coe::{Emergency, Object};
use crate::wire::register::{self, AlControl, AlState, AlStatusCode, DlStatus, Fmmu, SyncManager};
use crate::wire::sii::Usage;
use crate::wire::{Command, FrameWriter, WireError};
use chip::Chip;
use sdos::{Purpose, Sdos};
pub(super) use step::Step;

/// Station addresses begin here.
pub(super) const STATION_FIRST: u16 = 0x1000;
/// Cycles with process data before OP is asked for, so that outputs are what the application wants.
const SETTLE_CYCLES: u32 = 5;
/// A device is tried again after twice the time each time, so often.
const BACKOFF_MAX: u32 = 5;
/// What a device has become, for the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Notice {
    /// It is in OP.
    Up,
    /// It has left OP by itself.
    Left(AlState, AlStatusCode),
    /// It does not come up.
    Failed(SetupError),
    /// It reports an error.
    Emergency(Emergency),
    /// Another one is at its position.
    Other(u16),
    /// It says that it is slower than the cycle: so many ns.
    Slow(u32),
    /// It does not have an object that it should be told, and can do without.
    Lacks(Object),
}

/// What all devices have in common at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Now<'a> {
    pub(super) config: &'a Config<'a>,
    pub(super) ns: u64,
    /// Time of the bus, where it is known.
    pub(super) bus_ns: Option<u64>,
    /// Where the dates of cycles lie in it: so much behind whole cycles.
    pub(super) grid_ns: u64,
    /// Cycles so far.
    pub(super) cycle: u32,
    /// Devices that are known; their station addresses are taken.
    pub(super) count: usize,
}

/// A device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Device<'a> {
    pub(super) position: u16,
    /// Its number in the configuration, and its part of it.
    pub(super) config: Option<(usize, &'a DeviceConfig<'a>)>,
    /// Where its process data lie in the logical image.
    pub(super) logical: u32,
    pub(super) found: Found,
    pub(super) chip: Chip,
    pub(super) ports: DlStatus,
    pub(super) clock: DeviceClock,
    pub(super) step: Step,
    /// Why it is not up, as it was told last.
    pub(super) told: Option<SetupError>,
    /// Station address of another one at its position, as it was told last.
    pub(super) told_other: Option<u16>,
    /// The step has to be done by then.
    until_ns: u64,
    not_before_ns: u64,
    /// It shows an error, or what would be one in a device with firmware.
    error: bool,
    /// Whether it shows one was looked at before it is asked for INIT.
    looked: bool,
    /// The state was asked for; its answer is awaited.
    asked: bool,
    /// The step whose datagram is under way, or was last.
    asked_in: Step,
    reader: Reader,
    sdos: Sdos,
    /// The state that it was seen in last.
    seen: AlState,
    /// The cycle in which it began to settle.
    settles_since: u32,
    tries: u32,
    /// All that it was told since it was identified is in force.
    was_up: bool,
}

/// The clock of a device, as far as it has one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DeviceClock {
    /// From the reference clock to it.
    pub(super) delay_ns: u32,
    /// It shows the time of the bus.
    pub(super) is_right: bool,
    /// [`register::DC_DIFFERENCE`] as it was read last.
    difference: u32,
}

impl<'a> Device<'a> {
    pub(super) fn new(position: u16) -> Device<'a> {
        Device {
            position,
            config: None,
            logical: 0,
            found: Found::default(),
            chip: Chip::UNKNOWN,
            ports: DlStatus::default(),
            clock: DeviceClock::default(),
            step: Step::Address,
            told: None,
            told_other: None,
            until_ns: u64::MAX,
            not_before_ns: 0,
            error: false,
            looked: false,
            asked: false,
            asked_in: Step::Address,
            reader: Reader::new(false),
            sdos: Sdos::new(),
            seen: AlState::Unknown(0),
            settles_since: 0,
            tries: 0,
            was_up: false,
        }
    }

    pub(super) fn station(&self) -> u16 {
        STATION_FIRST.wrapping_add(self.position)
    }

    /// It is on its way to OP, or there, and answers.
    pub(super) fn is_coming(&self) -> bool {
        (Step::Clock..=Step::Look).contains(&self.step)
    }

    /// It takes SDOs of the application.
    pub(super) fn takes_orders(&self) -> bool {
        self.found.has_coe() && self.step == Step::Run
    }

    /// Begins a step.
    pub(super) fn enter(&mut self, step: Step, now: &Now<'_>) {
        let times = &now.config.times;
        self.step = step;
        self.asked = false;
        self.not_before_ns = 0;
        let limit_ns = match step {
            Step::Identified | Step::Stranger | Step::Run => u64::MAX,
            // Where it does not answer, its data do not come either.
            Step::Look => u64::MAX,
            // These have limits of their own.
            Step::Quickest | Step::StartValues | Step::MapOutputs | Step::MapInputs | Step::Checks | Step::Settle => {
                u64::MAX
            }
            Step::Eeprom => times.eeprom_ns,
            Step::Near => times.clock_ns,
            Step::ToOp => times.op_ns,
            Step::Away => times.retry_ns << self.tries.min(BACKOFF_MAX),
            _ => times.step_ns,
        };
        self.until_ns = now.ns.saturating_add(limit_ns);
        match step {
            Step::Features => (self.was_up, self.clock.is_right) = (false, false),
            Step::Eeprom => self.reader = Reader::new(now.config.only_asks()),
            Step::StartValues | Step::Checks => self.sdos.item = 0,
            Step::MapOutputs => self.sdos.mapping = Mapping::new(Usage::Outputs),
            Step::MapInputs => self.sdos.mapping = Mapping::new(Usage::Inputs),
            Step::Settle => self.settles_since = now.cycle,
            Step::MailOut => self.sdos.mailbox = Mailbox::new(self.found.mailboxes, times.pause_ns),
            Step::ToInit => (self.sdos.purpose, self.looked) = (Purpose::None, false),
            Step::Run => {
                self.tries = 0;
                self.told = None;
                self.was_up = true;
                self.sdos.mail_ns = now.ns;
            }
            _ => {}
        }
    }

    /// Whether a step is one for this device.
    fn applies(&self, step: Step) -> bool {
        let Some((_, config)) = self.config else { return false };
        if config.goal == AlState::PreOp && step > Step::ToPreOp {
            return false;
        }
        let clock = config.clock;
        match step {
            Step::Clock | Step::SyncOff => self.chip.has_clock(),
            Step::ClearFmmus => self.chip.fmmus > 0,
            Step::ClearManagers => self.chip.sync_managers > 0,
            Step::MailOut | Step::MailIn => self.found.mailboxes.receive.length > 0,
            Step::Quickest => self.found.has_coe() && clock.is_some(),
            Step::StartValues => !config.start.is_empty(),
            Step::MapOutputs => self.found.has_coe() && !config.outputs.pdos.is_empty(),
            Step::MapInputs => self.found.has_coe() && !config.inputs.pdos.is_empty(),
            Step::Checks => !config.checks.is_empty(),
            Step::Watchdog => config.watchdog_ms.is_some(),
            Step::ManagerOut | Step::FmmuOut => config.outputs.octets > 0,
            Step::ManagerIn | Step::FmmuIn => config.inputs.octets > 0,
            Step::Near => clock.is_some_and(|clock| clock.activate >> 8 != 0),
            // SYNC0 of one that was up runs on.
            Step::SyncCycle | Step::SyncStart | Step::SyncOn => self.applies(Step::Near) && !self.was_up,
            _ => true,
        }
    }

    /// Goes on with the step behind this one.
    fn advance(&mut self, now: &Now<'_>) {
        let at = Step::ORDER.iter().position(|step| *step == self.step);
        let from = at.map_or(0, |at| at + 1);
        let mut rest = Step::ORDER[from..].iter().copied();
        let next = rest.find(|step| self.applies(*step)).unwrap_or(Step::Run);
        self.enter(next, now);
    }

    /// It was identified: it is set up, unless it cannot be as the configuration has it.
    pub(super) fn set_up(&mut self, now: &Now<'_>) -> Result<(), SetupError> {
        self.check()?;
        let first = Step::ORDER.iter().copied().find(|step| self.applies(*step));
        self.enter(first.unwrap_or(Step::ToInit), now);
        Ok(())
    }

    /// The time of the bus has begun anew without it: its clock does not drift there, it is set.
    pub(super) fn time_has_restarted(&mut self) {
        if self.chip.has_clock() && self.step != Step::Clock {
            (self.was_up, self.clock.is_right) = (false, false);
        }
    }

    /// Its clock was measured.
    pub(super) fn clock_is_set(&mut self, now: &Now<'_>) {
        self.clock.is_right = true;
        if self.step == Step::Clock {
            self.advance(now);
        }
    }

    /// Time passes: what has not come by now does not come.
    pub(super) fn poll(&mut self, now: &Now<'_>, orders: &mut Orders) -> Option<Notice> {
        if self.step == Step::Settle && now.cycle.wrapping_sub(self.settles_since) >= SETTLE_CYCLES {
            self.advance(now);
        }
        if let Some(error) = self.sdos.mailbox.expired(now.ns) {
            return self.sdo_ended(now, Err(error), orders);
        }
        if now.ns < self.until_ns || self.step == Step::Away {
            return None;
        }
        let late = |state| SetupError::Late { state, at: self.seen };
        let error = match self.step {
            Step::Eeprom => SetupError::Eeprom(None),
            Step::Near => {
                let ns = register::difference_ns(self.clock.difference);
                SetupError::ClockApart { ns }
            }
            _ => match self.target() {
                Some(state) if self.asked => late(state),
                _ => SetupError::Gone,
            },
        };
        Some(self.fail(now, error))
    }

    /// The network may try a device again that was away.
    pub(super) fn is_due(&self, now_ns: u64) -> bool {
        self.step == Step::Away && now_ns >= self.until_ns
    }

    /// It does not come up: left alone for a while.
    pub(super) fn fail(&mut self, now: &Now<'_>, error: SetupError) -> Notice {
        self.enter(Step::Away, now);
        self.tries += 1;
        self.sdos.mailbox.give_up();
        self.sdos.purpose = Purpose::None;
        if error != SetupError::Gone {
            // All of it once more.
            (self.was_up, self.clock.is_right) = (false, false);
        }
        Notice::Failed(error)
    }

    /// The state that a step goes to.
    fn target(&self) -> Option<AlState> {
        match self.step {
            Step::ToInit => Some(AlState::Init),
            Step::ToPreOp => Some(AlState::PreOp),
            Step::ToSafeOp => Some(AlState::SafeOp),
            Step::ToOp => Some(AlState::Op),
            Step::Acknowledge => Some(self.seen),
            _ => None,
        }
    }

    /// Adds its datagram, where it has one to send.
    ///
    /// # Errors
    /// [`WireError::NoRoom`]: it has to wait for another frame.
    pub(super) fn ask(
        &mut self,
        now: &Now<'_>,
        orders: &mut Orders,
        writer: &mut FrameWriter<'_>,
        index: u8,
    ) -> Result<bool, WireError> {
        if now.ns < self.not_before_ns {
            return Ok(false);
        }
        self.asked_in = self.step;
        let at = |register: u16| register::station(self.station(), register);
        let mut read =
            |register: u16, octets: usize| writer.push(Command::Fprd, index, at(register), octets).map(|_| true);
        match self.step {
            Step::Identified | Step::Stranger | Step::Clock | Step::Settle | Step::Away => return Ok(false),
            Step::Features => return read(register::TYPE, 10),
            Step::Ports => return read(register::DL_STATUS, 2),
            Step::Pdi => return read(register::PDI_CONTROL, 2),
            Step::Near => return read(register::DC_DIFFERENCE, 4),
            Step::Look | Step::Find => return read(register::AL_STATUS, 6),
            Step::ToInit if !self.looked => return read(register::AL_STATUS, 6),
            Step::ToInit | Step::ToPreOp | Step::ToSafeOp | Step::ToOp | Step::Acknowledge if self.asked => {
                return read(register::AL_STATUS, 6);
            }
            Step::Address => {
                let address = register::position(self.position, register::STATION);
                writer.push_data(Command::Apwr, index, address, &self.station().to_le_bytes())?;
            }
            Step::FindPosition => {
                writer.push(
                    Command::Aprd,
                    index,
                    register::position(self.position, register::STATION),
                    2,
                )?;
            }
            Step::Eeprom => match self.reader.next() {
                Next::Look => return read(register::EEPROM_CONTROL, REPLY_LEN),
                Next::Command(octets) => {
                    writer.push_data(Command::Fpwr, index, at(register::EEPROM_CONTROL), &octets)?;
                }
            },
            Step::ClearFmmus => {
                writer.push(
                    Command::Fpwr,
                    index,
                    at(register::FMMU),
                    Fmmu::LEN * usize::from(self.chip.fmmus),
                )?;
            }
            Step::ClearManagers => {
                let octets = SyncManager::LEN * usize::from(self.chip.sync_managers);
                writer.push(Command::Fpwr, index, at(register::SYNC_MANAGER), octets)?;
            }
            step if step.has_mails() => return self.ask_mailbox(now, orders, writer, index),
            _ => {
                if let Some(state) = self.target() {
                    let control = AlControl {
                        state,
                        acknowledge: self.error && !self.chip.emulated,
                        ask_id: false,
                    };
                    writer.push_data(
                        Command::Fpwr,
                        index,
                        at(register::AL_CONTROL),
                        &u16::from(control).to_le_bytes(),
                    )?;
                } else {
                    let Some((register, octets, length)) = self.write(now) else {
                        return Ok(false); // The time of the bus is not known yet.
                    };
                    writer.push_data(Command::Fpwr, index, at(register), &octets[..length])?;
                }
            }
        }
        Ok(true)
    }

    /// The frame with its datagram was lost, or is not looked at.
    pub(super) fn lost(&mut self) {
        if self.asked_in.has_mails() {
            self.sdos.mailbox.lost();
        }
    }
}
