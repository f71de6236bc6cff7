//! What a device is told through its registers, step by step: SyncManagers, FMMUs, the watchdog, SYNC0.
//!
//! In:  the configuration, what the EEPROM says, the time of the bus. Out: a register and its octets.

use super::{Device, Now, Step};
use crate::wire::register::{self, Fmmu, SyncManager, sync};
use crate::wire::sii::{Area, Usage};

/// Ticks of the watchdog in a millisecond, as 0400h comes out of the box.
const WATCHDOG_TICKS: u16 = 10;

impl Device<'_> {
    /// The register that a step writes, and what.
    pub(super) fn write(&self, now: &Now<'_>) -> Option<(u16, [u8; 16], usize)> {
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
        let earliest = now.bus_ns?.wrapping_add(now.config.times.sync_start_ns);
        let date = (earliest / cycle_ns * cycle_ns).wrapping_add(now.grid_ns);
        Some(date.wrapping_add_signed(shift_ns))
    }
}
