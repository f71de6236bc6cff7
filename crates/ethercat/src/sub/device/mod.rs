//! A simulated device: the chip, and the firmware behind it.

use super::application::{Application, Cycle};
use super::clock::ClockConfig;
use super::coe::{Abilities, Mails, Server};
use super::eeprom::Eeprom;
use super::esc::{Esc, Events, MEMORY_LEN, Parts};
use super::objects::{ObjectStore, ProcessData};
use crate::wire::coe::{Emergency, Message};
use crate::wire::mailbox::{self, Mail, MailError, Protocol};
use crate::wire::register::{self, AlControl, AlState, AlStatus, AlStatusCode, SyncManager, sync};
use crate::wire::sii::{Area, Sii, SyncManagerEntry, Usage};
use crate::wire::{Addressing, Command};
use std::boxed::Box;
use std::collections::VecDeque;
use std::vec;
use std::vec::Vec;

/// SyncManagers of the mailboxes.
const MAILBOX_OUT: u8 = 0;
const MAILBOX_IN: u8 = 1;
/// How long a device waits for outputs and pulses on the way to OP where its watchdog says nothing.
const OP_WAIT_NS: u64 = 1_000_000_000;
/// Clocks that are farther apart than this are not together, ns.
const LOCKED_NS: i32 = 10_000;
/// SYNC0 pulses that are made up for at once after a pause.
const CATCH_UP: u32 = 20;
/// Period of a device that is told none, ns.
const PERIOD_NS: u32 = 1_000_000;
/// Answers that wait at most.
const MAILS_MAX: usize = 64;

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

/// A way to OP that is not at its end.
#[derive(Clone, Copy, Debug)]
struct ToOp {
    until_ns: u64,
}

/// A device.
#[derive(Debug)]
pub struct SubDevice {
    config: SubDeviceConfig,
    esc: Esc,
    objects: ObjectStore,
    server: Server,
    state: AlState,
    error: bool,
    request: Option<(u64, u16)>,
    to_op: Option<ToOp>,
    powered: bool,
    managers: Vec<SyncManagerEntry>,
    receive: Area,
    send: Area,
    has_mailbox: bool,
    /// Process data of SAFE-OP and OP; those of devices without CoE lie as the EEPROM says.
    outputs: ProcessData,
    inputs: ProcessData,
    /// Those of the last cycle: memory that is kept for the next one.
    process_data: [Vec<u8>; 2],
    mail_due_ns: Option<u64>,
    queue: VecDeque<Vec<u8>>,
    /// Counter of the last mail that came, and of the last that left.
    counters: (u8, u8),
    /// What is in the mailbox, and what was fetched from it last.
    posted: Vec<u8>,
    last_mail: Vec<u8>,
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
            server: Server::new(config.abilities),
            state: AlState::Init,
            error: false,
            request: None,
            to_op: None,
            powered: true,
            managers,
            receive: mailboxes.receive,
            send: mailboxes.send,
            has_mailbox: mailboxes.protocols != 0 && mailboxes.receive.length > 0,
            outputs: ProcessData::default(),
            inputs: ProcessData::default(),
            process_data: [Vec::new(), Vec::new()],
            mail_due_ns: None,
            queue: VecDeque::new(),
            counters: (0, 0),
            posted: Vec::new(),
            last_mail: Vec::new(),
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
        self.server = Server::new(self.config.abilities);
        (self.state, self.error, self.powered) = (AlState::Init, false, true);
        (self.request, self.to_op) = (None, None);
        self.clear_mails();
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
        if events.emptied && !self.esc.is_full(MAILBOX_IN) && !self.posted.is_empty() {
            self.last_mail = core::mem::take(&mut self.posted);
        }
        if events.repeat && self.state != AlState::Init {
            self.repeat_mail();
        }
        if events.written & 1 << MAILBOX_OUT != 0 && self.has_mailbox && self.state != AlState::Init {
            self.mail_due_ns = Some(now_ns + self.config.mail_ns);
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
        let mail = self.mail_due_ns.filter(|_| self.queue.is_empty());
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

    // --- State machine ---

    fn show(&mut self, code: AlStatusCode) {
        let status = AlStatus {
            state: self.state,
            error: self.error,
            id_loaded: false,
        };
        self.esc.set_al_status(status.into(), code.0);
    }

    /// Leaves a state by itself.
    fn fall(&mut self, state: AlState, code: AlStatusCode) {
        self.enter(state);
        self.error = true;
        self.show(code);
    }

    fn step(&mut self, now_ns: u64, control: AlControl) {
        if self.error && !control.acknowledge && control.state != AlState::Init {
            return;
        }
        self.error = false;
        if control.ask_id {
            let status = AlStatus {
                state: self.state,
                error: false,
                id_loaded: true,
            };
            self.esc.set_al_status(status.into(), self.esc.u16(register::ALIAS));
            if control.state == self.state {
                return;
            }
        }
        match self.check_step(control.state) {
            Ok(()) if control.state == AlState::Op && self.state != AlState::Op => {
                // Outputs have to come first, and pulses where they are asked for.
                self.esc.starve();
                self.disable_outputs(false);
                self.pulses = 0;
                let wait_ns = if self.waits_for_pulses() {
                    None
                } else {
                    self.esc.watchdog_ns()
                };
                self.to_op = Some(ToOp {
                    until_ns: now_ns + wait_ns.unwrap_or(OP_WAIT_NS),
                });
            }
            Ok(()) => {
                self.enter(control.state);
                self.show(AlStatusCode::NONE);
            }
            Err(code) => {
                self.error = true;
                self.show(code);
            }
        }
    }

    fn check_step(&mut self, target: AlState) -> Result<(), AlStatusCode> {
        if let Some((state, code)) = self.faults.refused
            && state == target
        {
            return Err(code);
        }
        match (self.state, target) {
            (_, AlState::Unknown(_)) => Err(AlStatusCode::UNKNOWN_STATE),
            (_, AlState::Init) => Ok(()),
            (AlState::Init, AlState::Boot) => Err(AlStatusCode::NO_BOOT),
            (_, AlState::Boot) => Err(AlStatusCode::STEP),
            (AlState::Init, AlState::PreOp) => self.check_mailboxes(),
            (AlState::PreOp, AlState::SafeOp) => self.check_process_data(),
            (AlState::PreOp | AlState::SafeOp | AlState::Op, AlState::PreOp) => Ok(()),
            (AlState::SafeOp | AlState::Op, AlState::SafeOp) => Ok(()),
            (AlState::SafeOp | AlState::Op, AlState::Op) => Ok(()),
            _ => Err(AlStatusCode::STEP),
        }
    }

    fn check_mailboxes(&self) -> Result<(), AlStatusCode> {
        if !self.has_mailbox {
            return Ok(());
        }
        let is_right = |number: u8, area: Area, write: bool| {
            let manager = self.esc.sync_manager(number);
            manager.is_active()
                && manager.is_mailbox()
                && manager.is_written() == write
                && (manager.start, manager.length) == (area.start, area.length)
        };
        if is_right(MAILBOX_OUT, self.receive, true) && is_right(MAILBOX_IN, self.send, false) {
            Ok(())
        } else {
            Err(AlStatusCode::MAILBOX)
        }
    }

    /// The SyncManager of the outputs or of the inputs, by the EEPROM.
    fn process_manager(&self, usage: Usage) -> Option<u8> {
        let at = self.managers.iter().position(|manager| manager.usage == usage)?;
        Some(at as u8)
    }

    fn check_process_data(&mut self) -> Result<(), AlStatusCode> {
        if self.has_mailbox {
            self.outputs = self
                .objects
                .process_data(true)
                .map_err(|_| AlStatusCode::OUTPUT_MAPPING)?;
            self.inputs = self
                .objects
                .process_data(false)
                .map_err(|_| AlStatusCode::INPUT_MAPPING)?;
        }
        for (usage, wrong) in [
            (Usage::Outputs, AlStatusCode::OUTPUT_SM),
            (Usage::Inputs, AlStatusCode::INPUT_SM),
        ] {
            let Some(number) = self.process_manager(usage) else {
                continue;
            };
            let expected = match (self.has_mailbox, usage) {
                (false, _) => usize::from(self.managers[usize::from(number)].length),
                (true, Usage::Outputs) => self.outputs.octets(),
                (true, _) => self.inputs.octets(),
            };
            let manager = self.esc.sync_manager(number);
            let is_off = expected == 0 && !manager.is_active();
            let fits = expected > 0
                && manager.is_active()
                && usize::from(manager.length) == expected
                && manager.is_written() == (usage == Usage::Outputs)
                && self.has_room(number, &manager);
            if !is_off && !fits {
                return Err(wrong);
            }
        }
        let activation = self.esc.octet(register::DC_SYNC_ACTIVATION);
        let cycle_ns = self.esc.u32(register::DC_SYNC0_CYCLE);
        if activation & sync::SYNC0 != 0 && cycle_ns == 0 {
            return Err(AlStatusCode::DC_SETUP);
        }
        self.period_ns = if activation & sync::SYNC0 != 0 {
            cycle_ns
        } else {
            self.config.period_ns
        };
        self.config.application.start(&mut self.objects, self.period_ns)
    }

    /// Three buffers lie behind each other, in front of the next SyncManager and of the end of the memory.
    fn has_room(&self, number: u8, manager: &SyncManager) -> bool {
        if manager.is_mailbox() || manager.start < register::MEMORY {
            return true;
        }
        let end = u32::from(manager.start) + 3 * u32::from(manager.length);
        (0..super::esc::SYNC_MANAGERS)
            .filter(|other| *other != number)
            .map(|other| self.esc.sync_manager(other))
            .filter(|other| other.is_active() && other.start >= manager.start)
            .map(|other| u32::from(other.start))
            .chain([MEMORY_LEN as u32])
            .all(|behind| end <= behind)
    }

    fn disable_outputs(&mut self, off: bool) {
        if let Some(number) = self.process_manager(Usage::Outputs) {
            self.esc.disable(number, off);
        }
    }

    fn enter(&mut self, state: AlState) {
        self.to_op = None;
        if state != AlState::Op {
            self.disable_outputs(true);
            self.esc.starve();
        }
        if state == AlState::Init {
            self.server.reset();
            self.clear_mails();
        }
        if matches!(state, AlState::Init | AlState::PreOp) {
            self.outputs = ProcessData::default();
            self.inputs = ProcessData::default();
        }
        self.state = state;
    }

    fn waits_for_pulses(&self) -> bool {
        self.esc.octet(register::DC_SYNC_ACTIVATION) & sync::SYNC0 != 0
    }

    /// On the way from SAFE-OP to OP.
    fn come_to_op(&mut self, now_ns: u64) {
        let Some(to_op) = self.to_op else { return };
        let has_outputs = self.process_manager(Usage::Outputs).is_some_and(|number| {
            let manager = self.esc.sync_manager(number);
            manager.is_active()
        });
        let fed = !has_outputs || self.esc.is_fed();
        let pulsed = !self.waits_for_pulses() || self.pulses >= self.config.pulses_before_op;
        let difference = self.esc.clock.as_ref().map_or(0, |clock| clock.difference_ns());
        let locked = !self.waits_for_pulses() || difference.abs() <= LOCKED_NS;
        if fed && pulsed && locked {
            self.enter(AlState::Op);
            self.show(AlStatusCode::NONE);
        } else if now_ns >= to_op.until_ns {
            let code = match (fed, pulsed) {
                (false, _) => AlStatusCode::WATCHDOG,
                (true, false) => AlStatusCode::NO_SYNC0,
                (true, true) => AlStatusCode::PLL,
            };
            self.fall(AlState::SafeOp, code);
        }
    }

    // --- Process data ---

    /// A cycle of its application beside those of its own, for whatever has changed around it.
    pub fn run_application(&mut self) {
        self.application_cycle(self.powered && self.state == AlState::Op);
    }

    fn cycle(&mut self, now_ns: u64) {
        self.cycle_ns = now_ns;
        self.application_cycle(self.state == AlState::Op);
    }

    fn area_of(&self, usage: Usage) -> (u16, u16) {
        let number = self.process_manager(usage);
        number.map_or((0, 0), |number| {
            let manager = self.esc.sync_manager(number);
            if manager.is_active() {
                (manager.start, manager.length)
            } else {
                (0, 0)
            }
        })
    }

    /// Outputs to the application, inputs from it.
    fn application_cycle(&mut self, led: bool) {
        let [mut outputs, mut inputs] = core::mem::take(&mut self.process_data);
        let (start, length) = self.area_of(Usage::Outputs);
        outputs.clear();
        outputs.extend_from_slice(self.esc.area(start, length));
        if led && self.has_mailbox {
            self.objects.scatter(&self.outputs, &outputs);
        }
        let (start, length) = self.area_of(Usage::Inputs);
        inputs.clear();
        inputs.resize(usize::from(length), 0);
        let emergency = self.config.application.cycle(Cycle {
            objects: &mut self.objects,
            outputs: &outputs,
            inputs: &mut inputs,
            led,
            powered: self.powered,
        });
        if self.has_mailbox {
            self.objects.gather(&self.inputs, &mut inputs);
        }
        if self.state != AlState::Init && !(self.has_mailbox && self.state == AlState::PreOp) {
            let area = self.esc.area_mut(start, length);
            let octets = area.len().min(inputs.len());
            area[..octets].copy_from_slice(&inputs[..octets]);
        }
        self.process_data = [outputs, inputs];
        if let Some(emergency) = emergency {
            self.report(emergency);
        }
    }

    fn clear_outputs(&mut self) {
        let (start, length) = self.area_of(Usage::Outputs);
        self.esc.area_mut(start, length).fill(0);
        self.application_cycle(false);
    }

    // --- Mailbox ---

    /// Sends an emergency, unasked.
    pub fn report(&mut self, emergency: Emergency) {
        if self.has_mailbox && self.state != AlState::Init && self.queue.len() < MAILS_MAX {
            let mut mail = vec![0; usize::from(self.send.length)];
            if Message::Emergency(emergency).emit(0, &mut mail).is_ok() {
                self.queue.push_back(mail);
            }
        }
    }

    fn mails(&mut self, now_ns: u64) {
        if self.mail_due_ns.is_some_and(|due_ns| due_ns <= now_ns) && self.queue.is_empty() {
            self.mail_due_ns = None;
            self.take_mail();
        }
        if !self.faults.withholds
            && !self.esc.is_full(MAILBOX_IN)
            && self.esc.sync_manager(MAILBOX_IN).is_active()
            && let Some(mut mail) = self.queue.pop_front()
        {
            // One that has made room for a repetition has its number.
            if let Some(octet) = mail.get_mut(5).filter(|octet| **octet & 0x70 == 0) {
                self.counters.1 = mailbox::next_counter(self.counters.1);
                *octet |= self.counters.1 << 4;
            }
            self.put_mail(mail);
        }
    }

    fn put_mail(&mut self, mail: Vec<u8>) {
        let area = self.esc.area_mut(self.send.start, self.send.length);
        let octets = area.len().min(mail.len());
        area[..octets].copy_from_slice(&mail[..octets]);
        self.esc.set_full(MAILBOX_IN, true);
        self.posted = mail;
    }

    /// The mail that was fetched last comes once more, and behind it what is in the mailbox.
    fn repeat_mail(&mut self) {
        if !self.last_mail.is_empty() {
            let waiting = core::mem::take(&mut self.posted);
            if !waiting.is_empty() && waiting != self.last_mail {
                self.queue.push_front(waiting);
            }
            self.put_mail(self.last_mail.clone());
        }
        self.esc.acknowledge_repeat(MAILBOX_IN);
    }

    fn clear_mails(&mut self) {
        self.queue.clear();
        self.mail_due_ns = None;
        self.counters = (0, 0);
        self.posted.clear();
        self.last_mail.clear();
    }

    fn take_mail(&mut self) {
        let octets = self.esc.area(self.receive.start, self.receive.length).to_vec();
        self.esc.set_full(MAILBOX_OUT, false);
        let answers = match Mail::parse(&octets) {
            Ok(mail) => {
                if mail.counter != 0 && mail.counter == self.counters.0 {
                    return; // It was here before.
                }
                self.counters.0 = mail.counter;
                self.answer(&mail)
            }
            Err(_) => self.complain(MailError::SIZE),
        };
        if self.faults.mute {
            return;
        }
        if let Some(emergency) = self.faults.emergency.take() {
            self.report(emergency);
        }
        self.queue.extend(answers);
    }

    fn complain(&self, error: MailError) -> Mails {
        let mut mail = vec![0; usize::from(self.send.length)];
        match error.emit(0, &mut mail) {
            Ok(()) => vec![mail],
            Err(_) => Vec::new(),
        }
    }

    fn answer(&mut self, mail: &Mail<'_>) -> Mails {
        if mail.protocol != Protocol::CoE {
            return self.complain(MailError::PROTOCOL);
        }
        match Message::parse(mail.data) {
            Ok(message) => {
                let in_pre_op = self.state == AlState::PreOp;
                let room = usize::from(self.send.length);
                self.server.receive(message, &mut self.objects, in_pre_op, room)
            }
            Err(_) => self.complain(MailError::SERVICE),
        }
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
