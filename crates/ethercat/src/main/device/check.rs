//! What can be known to be wrong with the configuration of a device before anything is written to it.
//!
//! In:  its part of the configuration, what its EEPROM says. Out: the first thing that is wrong.

use super::Device;
use crate::main::config::DeviceConfig;
use crate::main::event::{NoRoom, SetupError};
use crate::wire::DATA_MAX;
use crate::wire::register;
use crate::wire::sii::{Mailboxes, Usage};

impl Device<'_> {
    /// What can be known of the configuration before anything is written.
    pub(super) fn check(&self) -> Result<(), SetupError> {
        let Some((_, config)) = self.config else { return Ok(()) };
        let found = &self.found;
        if !config.expected.matches(&found.identity) {
            return Err(SetupError::WrongIdentity {
                expected: config.expected,
                found: found.identity,
            });
        }
        if found.refuses_lrw() || !self.chip.has_lrw() {
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
        if config.clock.is_some() && !self.chip.has_clock() {
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
                Some((number, usage, next)) if u32::from(next) < self.chip.memory_end => {
                    (Some((number, usage)), next.into())
                }
                _ => (None, self.chip.memory_end),
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
}
