//! A simulated device: the chip, and the firmware behind it.

mod mailbox;
mod process;
mod state;

use super::application::Application;
use super::clock::ClockConfig;
use super::coe::{Abilities, Server};
use super::eeprom::Eeprom;
use super::esc::{Esc, Events, Parts};
use super::objects::{ObjectStore, ProcessData};
use crate::wire::coe::Emergency;
use crate::wire::register::{self, AlControl, AlState, AlStatus, AlStatusCode};
use crate::wire::sii::{Sii, SyncManagerEntry};
use crate::wire::{Addressing, Command};
use mailbox::{MAILBOX_OUT, Mailbox};
use state::ToOp;
use std::boxed::Box;
use std::vec::Vec;

/// SYNC0 pulses that are made up for at once after a pause.
const CATCH_UP: u32 = 20;
/// Period of a device that is told none, ns.
const PERIOD_NS: u32 = 1_000_000;
/// What a device is made of.
#[derive(Debug)]
pub struct SubDeviceConfig {
    /// Its EEPROM, see [`Image`](crate::wire::sii::Image).
    pub eeprom: Vec<u8>,
    /// The EEPROM is read by eight octets, else by four.
    pub eight_octets: bool,
    /// What a command of the EEPROM takes, ns.
    pub eeprom_ns: u64,
    /// Its clock; `None`: it has no distributed clocks.
    pub clock: Option<ClockConfig>,
    /// Further bits of [`register::FEATURES`].
    pub features: u16,
    /// What it knows of CoE.
    pub abilities: Abilities,
    /// Its objects as they come out of the box; none without a CoE mailbox.
    pub objects: ObjectStore,
    /// What it does with process data.
    pub application: Box<dyn Application>,
    /// What a step of the state machine takes, ns.
    pub step_ns: u64,
    /// What the answer to a mail takes, ns.
    pub mail_ns: u64,
    /// SYNC0 pulses that it wants to see before OP, where SYNC0 is on.
    pub pulses_before_op: u32,
    /// Period of its application where it has no SYNC0, ns.
    pub period_ns: u32,
}

impl SubDeviceConfig {
    /// A device that answers soon and has a clock without a drift.
    pub fn new(eeprom: Vec<u8>, objects: ObjectStore, application: Box<dyn Application>) -> SubDeviceConfig {
        SubDeviceConfig {
            eeprom,
            eight_octets: true,
            eeprom_ns: 50_000,
            clock: Some(ClockConfig::default()),
            features: 0,
            abilities: Abilities::default(),
            objects,
            application,
            step_ns: 200_000,
            mail_ns: 200_000,
            pulses_before_op: 20,
            period_ns: PERIOD_NS,
        }
    }
}

/// What goes wrong in a device.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// It refuses this state.
    pub refused: Option<(AlState, AlStatusCode)>,
    /// It sees no SYNC0.
    pub no_sync0: bool,
    /// It reports this before its next answer.
    pub emergency: Option<Emergency>,
    /// It takes mails and answers none.
    pub mute: bool,
    /// It takes mails and keeps its answers to itself for now.
    pub withholds: bool,
    /// Its firmware does nothing any more.
    pub hung: bool,
    /// What its closed ports show in place of a receive time.
    pub garbage: u32,
}

/// A device.
#[derive(Debug)]
pub struct SubDevice {
    config: SubDeviceConfig,
    esc: Esc,
    objects: ObjectStore,
    mailbox: Mailbox,
    state: AlState,
    error: bool,
    request: Option<(u64, u16)>,
    to_op: Option<ToOp>,
    powered: bool,
    managers: Vec<SyncManagerEntry>,
    /// Process data of SAFE-OP and OP; those of devices without CoE lie as the EEPROM says.
    outputs: ProcessData,
    inputs: ProcessData,
    /// Those of the last cycle: memory that is kept for the next one.
    process_data: [Vec<u8>; 2],
    pulses: u32,
    period_ns: u32,
    /// When the application had its last cycle.
    cycle_ns: u64,
    /// Outputs came since the last cycle.
    fresh_outputs: bool,
    /// What goes wrong.
    pub faults: Faults,
}

impl SubDevice {
    /// A device that is switched on.
    pub fn new(config: SubDeviceConfig, now_ns: u64) -> SubDevice {
        let sii = Sii::parse(&config.eeprom);
        let managers = sii.iter().flat_map(Sii::sync_managers).collect();
        let mailboxes = sii.map(|sii| sii.mailboxes()).unwrap_or_default();
        SubDevice {
            esc: Esc::new(parts(&config), now_ns),
            objects: config.objects.clone(),
            mailbox: Mailbox::new(mailboxes, config.abilities),
            state: AlState::Init,
            error: false,
            request: None,
            to_op: None,
            powered: true,
            managers,
            outputs: ProcessData::default(),
            inputs: ProcessData::default(),
            process_data: [Vec::new(), Vec::new()],
            pulses: 0,
            period_ns: config.period_ns,
            cycle_ns: now_ns,
            fresh_outputs: false,
            faults: Faults::default(),
            config,
        }
    }

    /// Its power goes.
    pub fn power_off(&mut self) {
        self.powered = false;
        self.application_cycle(false);
    }

    /// Its power comes back; all that it was told is gone.
    pub fn power_on(&mut self, now_ns: u64) {
        let image = core::mem::take(&mut self.esc.eeprom.image);
        self.config.eeprom = image;
        self.esc = Esc::new(parts(&self.config), now_ns);
        self.objects = self.config.objects.clone();
        self.mailbox.server = Server::new(self.config.abilities);
        (self.state, self.error, self.powered) = (AlState::Init, false, true);
        (self.request, self.to_op) = (None, None);
        self.mailbox.clear();
        self.pulses = 0;
        self.cycle_ns = now_ns;
        self.fresh_outputs = false;
        self.config.application.power_on(&mut self.objects);
    }

    /// It has power.
    pub fn is_powered(&self) -> bool {
        self.powered
    }

    /// Its state.
    pub fn state(&self) -> AlState {
        self.state
    }

    /// It shows an error.
    pub fn has_error(&self) -> bool {
        self.error
    }

    /// Its objects.
    pub fn objects(&self) -> &ObjectStore {
        &self.objects
    }

    /// Its objects, to be changed behind its back.
    pub fn objects_mut(&mut self) -> &mut ObjectStore {
        &mut self.objects
    }

    /// Its application.
    pub fn application(&self) -> &dyn Application {
        &*self.config.application
    }

    /// Its application.
    pub fn application_mut(&mut self) -> &mut dyn Application {
        &mut *self.config.application
    }

    /// Time of the bus as it has it, ns; without a clock none.
    pub fn system_ns(&self, now_ns: u64) -> Option<u64> {
        self.esc.clock.as_ref().map(|clock| clock.system_ns(now_ns))
    }

    /// SYNC0 pulses since they were switched on.
    pub fn pulses(&self) -> u32 {
        self.pulses
    }

    /// Period of its application, ns.
    pub fn period_ns(&self) -> u32 {
        self.period_ns
    }

    pub(super) fn esc(&self) -> &Esc {
        &self.esc
    }

    pub(super) fn esc_mut(&mut self) -> &mut Esc {
        &mut self.esc
    }

    pub(super) fn firmware_runs(&self) -> bool {
        !self.faults.hung
    }

    fn is_emulated(&self) -> bool {
        self.esc.u16(register::PDI_CONTROL) & register::PDI_EMULATED != 0
    }

    /// A datagram passes; `frame` from its first octet on. `now_ns`: when it passes the processing unit; `times`: when the frame
    /// passes the ports.
    pub(super) fn datagram(&mut self, now_ns: u64, frame: &mut [u8], length: usize, times: &[Option<u64>; 4]) {
        self.esc.garbage = self.faults.garbage;
        let command = Command::from(frame[0]);
        let adp = u16::from_le_bytes([frame[2], frame[3]]);
        let ado = u16::from_le_bytes([frame[4], frame[5]]);
        let irq = u16::from_le_bytes([frame[8], frame[9]]) | self.esc.irq();
        frame[8..10].copy_from_slice(&irq.to_le_bytes());
        let (data, counter) = frame[crate::wire::DATAGRAM_HEADER_LEN..].split_at_mut(length);
        let gained = match command.addressing() {
            Addressing::None => 0,
            Addressing::Logical => {
                let logical = u32::from(adp) | u32::from(ado) << 16;
                self.esc.logical(now_ns, command, logical, data)
            }
            Addressing::Broadcast => self.esc.access(now_ns, command, ado, data, times),
            Addressing::Position | Addressing::Station => {
                let is_meant = match command.addressing() {
                    Addressing::Position => adp == 0,
                    _ => self.esc.is_addressed(adp),
                };
                let is_multiple = matches!(command, Command::Armw | Command::Frmw);
                match (is_meant, is_multiple) {
                    (true, _) => self.esc.access(now_ns, command, ado, data, times),
                    (false, true) => self.esc.multiple_write(now_ns, ado, data, times),
                    (false, false) => 0,
                }
            }
        };
        let sum = u16::from_le_bytes([counter[0], counter[1]]).wrapping_add(gained);
        counter[..2].copy_from_slice(&sum.to_le_bytes());
        if matches!(command.addressing(), Addressing::Position | Addressing::Broadcast) {
            frame[2..4].copy_from_slice(&adp.wrapping_add(1).to_le_bytes());
        }
    }

    /// The frame has passed: what it has touched off.
    pub(super) fn after_frame(&mut self, now_ns: u64) {
        let events = core::mem::take(&mut self.esc.events);
        if self.is_emulated() {
            self.emulate(events);
        } else {
            self.notice(now_ns, events);
        }
        self.poll(now_ns);
    }

    /// A device without firmware: the status mirrors the control, its acknowledgement as the error bit, and has no code.
    fn emulate(&mut self, events: Events) {
        if events.al_control {
            let word = self.esc.u16(register::AL_CONTROL);
            self.state = AlControl::from(word).state;
            self.error = AlStatus::from(word).error;
            self.esc.set_al_status(word, 0);
        }
        self.fresh_outputs |= events.written != 0;
        if self.fresh_outputs {
            self.fresh_outputs = false;
            self.application_cycle(self.state == AlState::Op);
        }
    }

    fn notice(&mut self, now_ns: u64, events: Events) {
        if self.faults.hung {
            return;
        }
        if events.al_control {
            let word = self.esc.u16(register::AL_CONTROL);
            self.request = Some((now_ns + self.config.step_ns, word));
        }
        let process = events.changed & !0x03;
        if process != 0 && matches!(self.state, AlState::SafeOp | AlState::Op) {
            self.fall(AlState::PreOp, AlStatusCode::SYNC_MANAGER);
        }
        if events.emptied {
            self.mailbox.emptied(&self.esc);
        }
        if events.repeat && self.state != AlState::Init {
            self.mailbox.repeat(&mut self.esc);
        }
        if events.written & 1 << MAILBOX_OUT != 0 && self.mailbox.exists && self.state != AlState::Init {
            self.mailbox.due_ns = Some(now_ns + self.config.mail_ns);
        }
        if events.written & !0x03 != 0 {
            self.fresh_outputs = true;
            if self
                .esc
                .clock
                .as_ref()
                .is_none_or(|clock| clock.next_sync_ns().is_none())
                && self.state == AlState::Op
            {
                self.cycle(now_ns);
            }
        }
    }

    /// Time has come.
    pub fn poll(&mut self, now_ns: u64) {
        if !self.powered {
            return;
        }
        let starved = self.esc.poll(now_ns);
        if starved {
            if self.is_emulated() {
                self.clear_outputs();
            } else if self.state == AlState::Op && !self.faults.hung {
                self.fall(AlState::SafeOp, AlStatusCode::WATCHDOG);
            }
        }
        if let Some(clock) = &mut self.esc.clock {
            clock.skip_sync(now_ns, CATCH_UP);
        }
        for _ in 0..CATCH_UP {
            if !self.esc.clock.as_mut().is_some_and(|clock| clock.take_sync(now_ns)) {
                break;
            }
            if !self.faults.no_sync0 {
                self.pulses += 1;
                self.cycle(now_ns);
            }
        }
        if self.faults.hung {
            return;
        }
        if let Some((due_ns, word)) = self.request
            && due_ns <= now_ns
        {
            self.request = None;
            self.step(now_ns, AlControl::from(word));
        }
        self.come_to_op(now_ns);
        self.mails(now_ns);
        if !self.is_emulated() && now_ns >= self.free_run_ns() {
            self.cycle(now_ns);
        }
    }

    /// When it does something by itself.
    pub fn next_ns(&self, now_ns: u64) -> u64 {
        if !self.powered {
            return u64::MAX;
        }
        let sync = self.esc.clock.as_ref().and_then(|clock| clock.until_sync_ns(now_ns));
        // A clock that runs slow is looked at once more then.
        let sync = sync.map(|ahead_ns| now_ns + ahead_ns);
        let request = self.request.map(|(due_ns, _)| due_ns);
        let to_op = self.to_op.map(|to_op| to_op.until_ns);
        let free = (!self.is_emulated()).then(|| self.free_run_ns());
        // A mail is not taken while the answer to the one before waits to be fetched.
        let mail = self.mailbox.due_ns.filter(|_| self.mailbox.queue.is_empty());
        let all = if self.faults.hung {
            [sync, None, None, None, None, self.esc.next_ns()]
        } else {
            [sync, request, to_op, mail, free, self.esc.next_ns()]
        };
        all.into_iter().flatten().min().unwrap_or(u64::MAX)
    }

    /// When the application goes on without pulse or frame.
    fn free_run_ns(&self) -> u64 {
        let led = self.state == AlState::Op
            || self
                .esc
                .clock
                .as_ref()
                .is_some_and(|clock| clock.next_sync_ns().is_some());
        self.cycle_ns + u64::from(self.period_ns) * if led { 2 } else { 1 }
    }
}

fn parts(config: &SubDeviceConfig) -> Parts {
    let ports = Sii::parse(&config.eeprom)
        .ok()
        .and_then(|sii| sii.general())
        .map_or(0x0011, |general| general.ports);
    // The register has two bits a port: 3 MII, 2 E-bus, 0 none; the EEPROM four: 1 MII, 3 E-bus.
    let kind = |port: u16| match ports >> (4 * port) & 0xF {
        1 => 3,
        3 => 2,
        _ => 0,
    };
    Parts {
        eeprom: Eeprom::new(config.eeprom.clone(), config.eight_octets, config.eeprom_ns),
        clock: config.clock,
        features: config.features,
        ports: (0..4).fold(0, |ports, port| ports | kind(port) << (2 * port)),
    }
}
