//! What the datagrams of a device bring back, and what it does next.
//!
//! In:  working counter and data of its last datagram. Out: its next step; what has become of it.

use super::{Chip, Device, Notice, Now, STATION_FIRST, Step};
use crate::main::eeprom::{self, Next, Progress};
use crate::main::event::{SetUp, SetupError};
use crate::main::orders::Orders;
use crate::wire::register::{self, AlState, AlStatus, AlStatusCode, DlStatus};
use crate::wire::{u16_at, u32_at};

impl Device<'_> {
    /// Its datagram came back.
    pub(in crate::main) fn answer(
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
                self.chip = Chip::parse(data);
                self.enter(Step::Ports, now);
            }
            Step::Ports => {
                self.ports = DlStatus(u16_at(data, 0).unwrap_or(0));
                self.enter(Step::Pdi, now);
            }
            Step::Pdi => {
                self.chip.emulated = u16_at(data, 0).is_ok_and(|pdi| pdi & register::PDI_EMULATED != 0);
                self.enter(Step::EepromForce, now);
            }
            Step::Address => self.enter(Step::Features, now),
            Step::EepromForce => self.enter(Step::EepromOwner, now),
            Step::EepromOwner => self.enter(Step::Eeprom, now),
            Step::Eeprom => return self.read_eeprom(now, data),
            Step::Near => {
                let register = u32_at(data, 0).unwrap_or(u32::MAX);
                self.clock.difference = register;
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
        self.seen = status.state;
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
    pub(in crate::main) fn look(&mut self, now: &Now<'_>) {
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
        self.seen = status.state;
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
