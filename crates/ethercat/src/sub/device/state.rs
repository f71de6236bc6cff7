//! The state machine of a simulated device: what it checks on each step, and the way to OP.
//!
//! In:  AL control, what the SyncManagers and clocks are set to. Out: AL status and its code.

use super::SubDevice;
use super::mailbox::{MAILBOX_IN, MAILBOX_OUT};
use crate::sub::esc::{MEMORY_LEN, SYNC_MANAGERS};
use crate::sub::objects::ProcessData;
use crate::wire::register::{self, AlControl, AlState, AlStatus, AlStatusCode, SyncManager, sync};
use crate::wire::sii::{Area, Usage};

/// How long a device waits for outputs and pulses on the way to OP where its watchdog says nothing.
const OP_WAIT_NS: u64 = 1_000_000_000;
/// Clocks that are farther apart than this are not together, ns.
const LOCKED_NS: i32 = 10_000;

/// A way to OP that is not at its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct ToOp {
    pub(super) until_ns: u64,
}

impl SubDevice {
    fn show(&mut self, code: AlStatusCode) {
        let status = AlStatus {
            state: self.state,
            error: self.error,
            id_loaded: false,
        };
        self.esc.set_al_status(status.into(), code.0);
    }

    /// Leaves a state by itself.
    pub(super) fn fall(&mut self, state: AlState, code: AlStatusCode) {
        self.enter(state);
        self.error = true;
        self.show(code);
    }

    pub(super) fn step(&mut self, now_ns: u64, control: AlControl) {
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
        if !self.mailbox.exists {
            return Ok(());
        }
        let is_right = |number: u8, area: Area, write: bool| {
            let manager = self.esc.sync_manager(number);
            manager.is_active()
                && manager.is_mailbox()
                && manager.is_written() == write
                && (manager.start, manager.length) == (area.start, area.length)
        };
        if is_right(MAILBOX_OUT, self.mailbox.receive, true) && is_right(MAILBOX_IN, self.mailbox.send, false) {
            Ok(())
        } else {
            Err(AlStatusCode::MAILBOX)
        }
    }

    /// The SyncManager of the outputs or of the inputs, by the EEPROM.
    pub(super) fn process_manager(&self, usage: Usage) -> Option<u8> {
        let at = self.managers.iter().position(|manager| manager.usage == usage)?;
        Some(at as u8)
    }

    fn check_process_data(&mut self) -> Result<(), AlStatusCode> {
        if self.mailbox.exists {
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
            let expected = match (self.mailbox.exists, usage) {
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
        (0..SYNC_MANAGERS)
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
            self.mailbox.server.reset();
            self.mailbox.clear();
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
    pub(super) fn come_to_op(&mut self, now_ns: u64) {
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
}
