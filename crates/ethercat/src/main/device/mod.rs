//! One device on the wire, from its station address to OP, and back to OP where it has left it.
//!
//! In:  its part of the configuration, what its datagrams bring back. Out: its next datagram; what has become of it.
//!
//! One datagram of a device is under way at a time. Devices know nothing of each other, so that all come up at once.

mod sdos;

use super::config::{Config, DeviceConfig, Times};
use super::eeprom::{self, Found, Next, Progress, REPLY_LEN, Reader};
use super::event::{NoRoom, SetUp, SetupError};
use super::mail::Mailbox;
use super::mapping::Mapping;
use super::orders::Orders;
use crate::wire::coe::{Emergency, Object};
use crate::wire::register::{
    self, AlControl, AlState, AlStatus, AlStatusCode, DlStatus, Fmmu, SyncManager, feature, sync,
};
use crate::wire::sii::{Area, Mailboxes, Usage};
use crate::wire::{Command, DATA_MAX, FrameWriter, WireError, u16_at, u32_at};

/// Station addresses begin here.
pub(super) const STATION_FIRST: u16 = 0x1000;
/// Cycles with process data before OP is asked for, so that outputs are what the application wants.
const SETTLE_CYCLES: u32 = 5;
/// A device is tried again after twice the time each time, so often.
const BACKOFF_MAX: u32 = 5;
/// Its shortest cycle, ns, as it says itself.
const QUICKEST: Object = Object {
    index: 0x1C32,
    sub: 5,
    complete: false,
};
/// Addresses of a device end here.
const MEMORY_END_MAX: u32 = 0x1_0000;
/// Ticks of the watchdog in a millisecond, as 0400h comes out of the box.
const WATCHDOG_TICKS: u16 = 10;

/// Where a device is on its way; those from [`Step::Clock`] on are in the order in which they are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Step {
    /// Gets its station address by its position.
    Address,
    Features,
    Ports,
    /// Whether it has firmware.
    Pdi,
    EepromForce,
    EepromOwner,
    Eeprom,
    /// What it is is known; the network goes on with it.
    Identified,
    /// Nobody asks for it.
    Stranger,
    /// The network measures its clock.
    Clock,
    ToInit,
    ClearFmmus,
    ClearManagers,
    SyncOff,
    MailOut,
    MailIn,
    EepromLend,
    ToPreOp,
    /// Its shortest cycle is read; one that does not tell it is taken as quick.
    Quickest,
    StartValues,
    MapOutputs,
    MapInputs,
    /// What it says of itself is compared.
    Checks,
    Watchdog,
    ManagerOut,
    ManagerIn,
    FmmuOut,
    FmmuIn,
    Near,
    SyncCycle,
    SyncStart,
    SyncOn,
    ToSafeOp,
    Settle,
    ToOp,
    /// It is in OP.
    Run,
    /// It was in OP; where is it now?
    Look,
    /// It is left alone until the network tries it again.
    Away,
    /// Does it answer at its station address?
    Find,
    /// What is at its position?
    FindPosition,
    /// It shows an error, which is acknowledged before it is asked for anything.
    Acknowledge,
}

impl Step {
    /// The steps that follow each other.
    const ORDER: [Step; 26] = [
        Step::Clock,
        Step::ToInit,
        Step::ClearFmmus,
        Step::ClearManagers,
        Step::SyncOff,
        Step::MailOut,
        Step::MailIn,
        Step::EepromLend,
        Step::ToPreOp,
        Step::Quickest,
        Step::StartValues,
        Step::MapOutputs,
        Step::MapInputs,
        Step::Checks,
        Step::Watchdog,
        Step::ManagerOut,
        Step::ManagerIn,
        Step::FmmuOut,
        Step::FmmuIn,
        Step::Near,
        Step::SyncCycle,
        Step::SyncStart,
        Step::SyncOn,
        Step::ToSafeOp,
        Step::Settle,
        Step::ToOp,
    ];

    /// Its datagrams are mails.
    fn has_mails(self) -> bool {
        matches!(
            self,
            Step::Quickest | Step::StartValues | Step::MapOutputs | Step::MapInputs | Step::Checks | Step::Run
        )
    }
}

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

/// Who has asked for the SDO that is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    /// Nobody.
    None,
    /// A value of the start.
    Start,
    /// Its shortest cycle.
    Quickest,
    /// Process data.
    Mapping,
    /// A value that it must have.
    Check,
    /// An order of the application, by its number.
    Order(usize),
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
    pub(super) features: u16,
    /// Where its memory ends.
    memory_end: u32,
    pub(super) ports: DlStatus,
    pub(super) delay_ns: u32,
    pub(super) step: Step,
    /// Why it is not up, as it was told last.
    pub(super) told: Option<SetupError>,
    /// Station address of another one at its position, as it was told last.
    pub(super) told_other: Option<u16>,
    /// The step has to be done by then.
    until_ns: u64,
    not_before_ns: u64,
    /// Its state machine is emulated by its chip: AL status mirrors AL control, the acknowledgement with it.
    emulated: bool,
    /// It shows an error, or what would be one in a device with firmware.
    error: bool,
    /// Whether it shows one was looked at before it is asked for INIT.
    looked: bool,
    /// The state was asked for; its answer is awaited.
    asked: bool,
    /// The step whose datagram is under way, or was last.
    asked_in: Step,
    counts: (u8, u8),
    reader: Reader,
    mailbox: Mailbox,
    purpose: Purpose,
    /// Number of the start value, of the cycle in which it began to settle.
    item: u32,
    mapping: Mapping,
    small: [u8; 4],
    tries: u32,
    /// All that it was told since it was identified is in force.
    was_up: bool,
    /// Its clock shows the time of the bus.
    pub(super) clock_is_right: bool,
    /// When its mailbox is looked at next.
    mail_ns: u64,
}

impl<'a> Device<'a> {
    pub(super) fn new(position: u16) -> Device<'a> {
        Device {
            position,
            config: None,
            logical: 0,
            found: Found::default(),
            features: 0,
            memory_end: MEMORY_END_MAX,
            ports: DlStatus::default(),
            delay_ns: 0,
            step: Step::Address,
            told: None,
            told_other: None,
            until_ns: u64::MAX,
            not_before_ns: 0,
            emulated: false,
            error: false,
            looked: false,
            asked: false,
            asked_in: Step::Address,
            counts: (0, 0),
            reader: Reader::new(false),
            mailbox: Mailbox::new(Mailboxes::default(), 0),
            purpose: Purpose::None,
            item: 0,
            mapping: Mapping::new(Usage::Outputs),
            small: [0; 4],
            tries: 0,
            was_up: false,
            clock_is_right: false,
            mail_ns: 0,
        }
    }

    pub(super) fn station(&self) -> u16 {
        STATION_FIRST.wrapping_add(self.position)
    }

    pub(super) fn has_clock(&self) -> bool {
        self.features & feature::DC != 0
    }

    pub(super) fn has_wide_clock(&self) -> bool {
        self.features & feature::DC_64 != 0
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
            Step::Features => (self.was_up, self.clock_is_right) = (false, false),
            Step::Eeprom => self.reader = Reader::new(now.config.only_asks()),
            Step::StartValues | Step::Checks => self.item = 0,
            Step::MapOutputs => self.mapping = Mapping::new(Usage::Outputs),
            Step::MapInputs => self.mapping = Mapping::new(Usage::Inputs),
            Step::Settle => self.item = now.cycle,
            Step::MailOut => self.mailbox = Mailbox::new(self.found.mailboxes, times.pause_ns),
            Step::ToInit => (self.purpose, self.looked) = (Purpose::None, false),
            Step::Run => {
                self.tries = 0;
                self.told = None;
                self.was_up = true;
                self.mail_ns = now.ns;
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
            Step::Clock | Step::SyncOff => self.has_clock(),
            Step::ClearFmmus => self.counts.0 > 0,
            Step::ClearManagers => self.counts.1 > 0,
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
        if self.has_clock() && self.step != Step::Clock {
            (self.was_up, self.clock_is_right) = (false, false);
        }
    }

    /// Its clock was measured.
    pub(super) fn clock_is_set(&mut self, now: &Now<'_>) {
        self.clock_is_right = true;
        if self.step == Step::Clock {
            self.advance(now);
        }
    }

    /// What can be known of the configuration before anything is written.
    fn check(&self) -> Result<(), SetupError> {
        let Some((_, config)) = self.config else { return Ok(()) };
        let found = &self.found;
        if !config.expected.matches(&found.identity) {
            return Err(SetupError::WrongIdentity {
                expected: config.expected,
                found: found.identity,
            });
        }
        if found.refuses_lrw() || self.features & feature::NO_LRW != 0 {
            return Err(SetupError::NoLrw);
        }
        let octets = found.mailboxes.receive.length.max(found.mailboxes.send.length);
        if usize::from(octets) > DATA_MAX {
            return Err(SetupError::MailboxTooLong { octets });
        }
        if found.says_coe() && !found.has_coe() {
            let octets = found.shorter_mailbox();
            return Err(SetupError::MailboxTooShort { octets });
        }
        let has_values = !(config.start.is_empty() && config.checks.is_empty());
        if has_values && !found.has_coe() {
            return Err(SetupError::NoMailbox);
        }
        if config.clock.is_some() && !self.has_clock() {
            return Err(SetupError::NoClock);
        }
        for (usage, data) in [(Usage::Outputs, &config.outputs), (Usage::Inputs, &config.inputs)] {
            let octets = data.octets;
            if octets == 0 {
                continue;
            }
            let (_, manager) = found.manager(usage).ok_or(SetupError::NoSyncManager(usage))?;
            if !found.has_coe() && manager.length != octets {
                return Err(SetupError::Length {
                    usage,
                    expected: manager.length,
                    octets,
                });
            }
        }
        self.check_memory(config).map_err(SetupError::NoRoom)
    }

    /// Whether mails, and process data that are kept three times, end before what lies behind them.
    fn check_memory(&self, config: &DeviceConfig<'_>) -> Result<(), NoRoom> {
        let Mailboxes { receive, send, .. } = self.found.mailboxes;
        for (usage, usual, octets) in [
            (Usage::MailboxOut, 0, receive.length),
            (Usage::MailboxIn, 1, send.length),
            (Usage::Outputs, 2, config.outputs.octets),
            (Usage::Inputs, 3, config.inputs.octets),
        ] {
            let manager = self.found.manager(usage);
            let start = match (usage, manager) {
                (Usage::MailboxOut, _) => receive.start,
                (Usage::MailboxIn, _) => send.start,
                (_, Some((_, manager))) => manager.start,
                (_, None) => continue,
            };
            // Outputs of chips without firmware are registers.
            if octets == 0 || start < register::MEMORY {
                continue;
            }
            let is_process_data = matches!(usage, Usage::Outputs | Usage::Inputs);
            let has_buffers = is_process_data && manager.is_some_and(|(_, manager)| manager.control & 3 == 0);
            let times = if has_buffers { 3 } else { 1 };
            let own_end = u32::from(start) + u32::from(times) * u32::from(octets);
            let (behind, end) = match self.found.next_behind(start) {
                Some((number, usage, next)) if u32::from(next) < self.memory_end => {
                    (Some((number, usage)), next.into())
                }
                _ => (None, self.memory_end),
            };
            if own_end > end {
                return Err(NoRoom {
                    manager: (manager.map_or(usual, |(number, _)| number), usage),
                    start,
                    octets,
                    times,
                    behind,
                    end,
                });
            }
        }
        Ok(())
    }

    fn times(now: &Now<'_>) -> Times {
        now.config.times
    }

    /// Time passes: what has not come by now does not come.
    pub(super) fn poll(&mut self, now: &Now<'_>, orders: &mut Orders) -> Option<Notice> {
        if self.step == Step::Settle && now.cycle.wrapping_sub(self.item) >= SETTLE_CYCLES {
            self.advance(now);
        }
        if let Some(error) = self.mailbox.expired(now.ns) {
            return self.sdo_ended(now, Err(error), orders);
        }
        if now.ns < self.until_ns || self.step == Step::Away {
            return None;
        }
        let late = |state| SetupError::Late {
            state,
            at: AlState::from(self.small[0]),
        };
        let error = match self.step {
            Step::Eeprom => SetupError::Eeprom(None),
            Step::Near => {
                let ns = register::difference_ns(u32::from_le_bytes(self.small));
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
        self.mailbox.give_up();
        self.purpose = Purpose::None;
        if error != SetupError::Gone {
            // All of it once more.
            (self.was_up, self.clock_is_right) = (false, false);
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
            Step::Acknowledge => Some(AlState::from(self.small[0])),
            _ => None,
        }
    }

    /// The register that a step writes, and what.
    fn write(&self, now: &Now<'_>) -> Option<(u16, [u8; 16], usize)> {
        let config = self.config.map(|(_, config)| config);
        let mut octets = [0; 16];
        let clock = config.and_then(|config| config.clock);
        let manager = |usage: Usage, length: u16| {
            let (number, manager) = self.found.manager(usage)?;
            Some((number, manager.start, length, manager.control))
        };
        let mailbox = |usage: Usage, number: u8, area: Area, control: u8| {
            let known = self.found.manager(usage);
            let control = known.map_or(control, |(_, manager)| manager.control);
            Some((
                known.map_or(number, |(number, _)| number),
                area.start,
                area.length,
                control,
            ))
        };
        let boxes = &self.found.mailboxes;
        let managed = match self.step {
            Step::MailOut => mailbox(Usage::MailboxOut, 0, boxes.receive, SyncManager::MAILBOX_OUT),
            Step::MailIn => mailbox(Usage::MailboxIn, 1, boxes.send, SyncManager::MAILBOX_IN),
            Step::ManagerOut => manager(Usage::Outputs, config?.outputs.octets),
            Step::ManagerIn => manager(Usage::Inputs, config?.inputs.octets),
            _ => None,
        };
        if let Some((number, start, length, control)) = managed {
            let manager = SyncManager {
                start,
                length,
                control,
                activate: 1,
                ..SyncManager::default()
            };
            manager.emit(&mut octets).ok()?;
            // Status and PDI control are not written with it.
            return Some((register::sync_manager(number), octets, SyncManager::LEN - 1));
        }
        let fmmu = |usage: Usage, length: u16, kind: u8, octets: &mut [u8]| {
            let (_, manager) = self.found.manager(usage)?;
            Fmmu::octets(self.logical, length, manager.start, kind)
                .emit(octets)
                .ok()?;
            Some((register::fmmu(self.found.fmmu(usage)), Fmmu::LEN))
        };
        let (register, length) = match self.step {
            Step::EepromForce => {
                octets[0] = 2;
                (register::EEPROM_OWNER, 1)
            }
            Step::EepromOwner => (register::EEPROM_OWNER, 1),
            Step::EepromLend => {
                octets[0] = 1;
                (register::EEPROM_OWNER, 1)
            }
            Step::SyncOff => (register::DC_SYNC_OWNER, 2),
            Step::Watchdog => {
                let ticks = config?.watchdog_ms?.saturating_mul(WATCHDOG_TICKS);
                octets[..2].copy_from_slice(&ticks.to_le_bytes());
                (register::WATCHDOG_DATA, 2)
            }
            Step::FmmuOut => fmmu(Usage::Outputs, config?.outputs.octets, Fmmu::WRITE, &mut octets)?,
            Step::FmmuIn => fmmu(Usage::Inputs, config?.inputs.octets, Fmmu::READ, &mut octets)?,
            Step::SyncCycle => {
                octets[..4].copy_from_slice(&now.config.cycle_ns.to_le_bytes());
                octets[4..8].copy_from_slice(&clock?.sync1_ns.to_le_bytes());
                (register::DC_SYNC0_CYCLE, 8)
            }
            Step::SyncStart => {
                octets[..8].copy_from_slice(&self.sync_start(now)?.to_le_bytes());
                (register::DC_SYNC0_START, 8)
            }
            Step::SyncOn => {
                // Some drives bear no write to 0980h where its octet is 0 anyway.
                let [owner, activation] = clock?.activate.to_le_bytes();
                let activation = activation | sync::CYCLIC;
                if owner == 0 {
                    octets[0] = activation;
                    (register::DC_SYNC_ACTIVATION, 1)
                } else {
                    octets[..2].copy_from_slice(&[owner, activation]);
                    (register::DC_SYNC_OWNER, 2)
                }
            }
            _ => return None,
        };
        Some((register, octets, length))
    }

    /// The first SYNC0: a date of the cycle, and the shift.
    fn sync_start(&self, now: &Now<'_>) -> Option<u64> {
        let shift_ns = i64::from(self.config?.1.clock?.shift_ns);
        let cycle_ns = u64::from(now.config.cycle_ns);
        let earliest = now.bus_ns?.wrapping_add(Device::times(now).sync_start_ns);
        let date = (earliest / cycle_ns * cycle_ns).wrapping_add(now.grid_ns);
        Some(date.wrapping_add_signed(shift_ns))
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
                    Fmmu::LEN * usize::from(self.counts.0),
                )?;
            }
            Step::ClearManagers => {
                let octets = SyncManager::LEN * usize::from(self.counts.1);
                writer.push(Command::Fpwr, index, at(register::SYNC_MANAGER), octets)?;
            }
            step if step.has_mails() => return self.ask_mailbox(now, orders, writer, index),
            _ => {
                if let Some(state) = self.target() {
                    let control = AlControl {
                        state,
                        acknowledge: self.error && !self.emulated,
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
            self.mailbox.lost();
        }
    }

    /// Its datagram came back.
    pub(super) fn answer(
        &mut self,
        now: &Now<'_>,
        working_counter: u16,
        data: &[u8],
        orders: &mut Orders,
    ) -> Option<Notice> {
        if self.asked_in != self.step {
            // It answers what is not asked any more.
            self.lost();
            return None;
        }
        let acted = working_counter > 0;
        match self.step {
            step if step.has_mails() => return self.mailed(now, working_counter, data, orders),
            Step::Find => return self.was_found(now, acted, data),
            Step::FindPosition => return self.was_at_position(now, acted, data),
            _ if !acted => {
                // Once more, until the step is over.
                self.pause(now);
                return None;
            }
            Step::Features => {
                self.features = u16_at(data, 8).unwrap_or(0);
                // One that tells none has all that there can be.
                self.memory_end = match data.get(6) {
                    None | Some(0) => MEMORY_END_MAX,
                    Some(kib) => MEMORY_END_MAX.min(u32::from(register::MEMORY) + 1024 * u32::from(*kib)),
                };
                self.counts = (
                    data.get(4).map_or(0, |count| (*count).min(16)),
                    data.get(5).map_or(0, |count| (*count).min(16)),
                );
                self.enter(Step::Ports, now);
            }
            Step::Ports => {
                self.ports = DlStatus(u16_at(data, 0).unwrap_or(0));
                self.enter(Step::Pdi, now);
            }
            Step::Pdi => {
                self.emulated = u16_at(data, 0).is_ok_and(|pdi| pdi & register::PDI_EMULATED != 0);
                self.enter(Step::EepromForce, now);
            }
            Step::Address => self.enter(Step::Features, now),
            Step::EepromForce => self.enter(Step::EepromOwner, now),
            Step::EepromOwner => self.enter(Step::Eeprom, now),
            Step::Eeprom => return self.read_eeprom(now, data),
            Step::Near => {
                let register = u32_at(data, 0).unwrap_or(u32::MAX);
                self.small = register.to_le_bytes();
                if register & 0x7FFF_FFFF <= now.config.times.clock_limit_ns {
                    self.advance(now);
                } else {
                    self.pause(now);
                }
            }
            Step::Look => return self.looked(now, data),
            Step::ToInit | Step::ToPreOp | Step::ToSafeOp | Step::ToOp | Step::Acknowledge => {
                return self.stepped(now, data);
            }
            Step::Identified | Step::Stranger | Step::Clock | Step::Settle | Step::Away => {}
            _ => self.advance(now),
        }
        None
    }

    fn pause(&mut self, now: &Now<'_>) {
        self.not_before_ns = now.ns + now.config.times.pause_ns;
    }

    fn read_eeprom(&mut self, now: &Now<'_>, data: &[u8]) -> Option<Notice> {
        let Next::Look = self.reader.next() else {
            self.reader.commanded();
            return None;
        };
        let octets = data.first_chunk::<{ eeprom::REPLY_LEN }>()?;
        match self.reader.look(octets) {
            Ok(Progress::Busy) => {}
            Ok(Progress::More) => self.until_ns = now.ns + now.config.times.eeprom_ns,
            Ok(Progress::Done(found)) => {
                self.found = found;
                self.enter(Step::Identified, now);
            }
            Err(error) => return Some(self.fail(now, error)),
        }
        None
    }

    /// The answer to a request of a state, or to a look at it.
    fn stepped(&mut self, now: &Now<'_>, data: &[u8]) -> Option<Notice> {
        let to_look = self.step == Step::ToInit && !self.looked;
        if !self.asked && !to_look {
            self.asked = true;
            return None;
        }
        let target = self.target()?;
        let (status, error) = self.status(data)?;
        if self.step == Step::Acknowledge {
            if error.is_some() {
                self.pause(now);
            } else {
                self.resume(now);
            }
            return None;
        }
        self.small[0] = status.state.into();
        if to_look {
            self.looked = true;
            if error.is_some() {
                self.enter(Step::Acknowledge, now);
            }
            return None;
        }
        if let Some(code) = error {
            let error = SetupError::Refused {
                state: target,
                at: status.state,
                code,
                set_up: self.was_set_up(),
            };
            return Some(self.fail(now, error));
        }
        if status.state != target {
            self.pause(now);
            return None;
        }
        self.advance(now);
        (self.step == Step::Run).then_some(Notice::Up)
    }

    /// AL status, and why it refused a step or left a state. Its bit alone says neither: a chip that emulates the state machine mirrors
    /// there what it was asked, and without a code there was no error.
    fn status(&mut self, data: &[u8]) -> Option<(AlStatus, Option<AlStatusCode>)> {
        let status = AlStatus::from(u16_at(data, 0).ok()?);
        let code = AlStatusCode(u16_at(data, 4).unwrap_or(0));
        self.error = status.error;
        Some((status, (status.error && code != AlStatusCode::NONE).then_some(code)))
    }

    fn was_set_up(&self) -> SetUp {
        let config = self.config.map(|(_, config)| config);
        SetUp {
            octets: config.map_or((0, 0), |config| (config.outputs.octets, config.inputs.octets)),
            receive: self.found.mailboxes.receive,
            send: self.found.mailboxes.send,
            values: config.map_or(0, |config| config.start.len() as u16),
        }
    }

    /// Something is wrong with its process data: where is it?
    pub(super) fn look(&mut self, now: &Now<'_>) {
        if self.step == Step::Run {
            self.enter(Step::Look, now);
        }
    }

    fn looked(&mut self, now: &Now<'_>, data: &[u8]) -> Option<Notice> {
        let (status, error) = self.status(data)?;
        let goal = self.config.map_or(AlState::Op, |(_, config)| config.goal);
        if status.state == goal && error.is_none() {
            self.enter(Step::Run, now);
            return None;
        }
        self.enter(Step::Away, now);
        // Of a step that nobody refused there may be a code all the same.
        let code = AlStatusCode(u16_at(data, 4).unwrap_or(0));
        Some(Notice::Left(status.state, code))
    }

    /// Away: is it still there, and where?
    fn was_found(&mut self, now: &Now<'_>, acted: bool, data: &[u8]) -> Option<Notice> {
        if !acted {
            self.enter(Step::FindPosition, now);
            return None;
        }
        let (status, error) = self.status(data)?;
        // One that was only without outputs needs no set-up.
        let only_starved = status.state == AlState::SafeOp && error.is_none_or(|code| code == AlStatusCode::WATCHDOG);
        self.was_up &= only_starved;
        self.small[0] = status.state.into();
        if error.is_some() {
            self.enter(Step::Acknowledge, now);
        } else {
            self.resume(now);
        }
        None
    }

    /// It is there and shows no error: what it still knows is not told again.
    fn resume(&mut self, now: &Now<'_>) {
        let step = match (self.was_up, self.applies(Step::Near)) {
            (false, _) => Step::Features,
            (true, true) => Step::Near,
            (true, false) => Step::ToSafeOp,
        };
        self.enter(step, now);
    }

    fn was_at_position(&mut self, now: &Now<'_>, acted: bool, data: &[u8]) -> Option<Notice> {
        if !acted {
            return Some(self.fail(now, SetupError::Gone));
        }
        let station = u16_at(data, 0).unwrap_or(0);
        let known = STATION_FIRST..STATION_FIRST + now.count as u16;
        if station == self.station() {
            self.enter(Step::Features, now);
        } else if known.contains(&station) {
            self.enter(Step::Away, now);
            self.tries += 1;
            return Some(Notice::Other(station));
        } else {
            // Out of the box, without power for a while, or told so by another main device before.
            self.enter(Step::Address, now);
        }
        None
    }
}
