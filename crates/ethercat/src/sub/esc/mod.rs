//! The bus chip of a simulated device: its memory, as its firmware and its ports see it. What datagrams do there is in `access`.

mod access;

use super::clock::{Clock, ClockConfig};
use super::eeprom::Eeprom;
use crate::wire::register::{self, DlStatus, Fmmu, SyncManager, feature};
use std::boxed::Box;
use std::ops::Range;
use std::vec::Vec;

/// Octets of the memory: registers, and 8 KiB behind them.
pub(super) const MEMORY_LEN: usize = 0x3000;
/// FMMUs and SyncManagers that every simulated chip has.
pub(super) const FMMUS: u8 = 8;
pub(super) const SYNC_MANAGERS: u8 = 8;
/// Reset value of the watchdogs: 100 ms.
const WATCHDOG_TICKS: u16 = 1000;

/// What the firmware has to look at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Events {
    /// 0120h was written.
    pub(super) al_control: bool,
    /// An output SyncManager was written, one bit each.
    pub(super) written: u8,
    /// The registers of SyncManagers were changed, one bit each.
    pub(super) changed: u8,
    /// A mailbox was emptied.
    pub(super) emptied: bool,
    /// The main device asks for a mail once more.
    pub(super) repeat: bool,
}

/// What a chip has and how it comes up.
#[derive(Clone, Debug)]
pub(super) struct Parts {
    pub(super) eeprom: Eeprom,
    pub(super) clock: Option<ClockConfig>,
    /// Further bits of 0008h.
    pub(super) features: u16,
    /// Kinds of the ports, two bits each.
    pub(super) ports: u8,
}

/// The chip.
#[derive(Clone, Debug)]
pub(super) struct Esc {
    memory: Box<[u8; MEMORY_LEN]>,
    pub(super) clock: Option<Clock>,
    pub(super) eeprom: Eeprom,
    pub(super) events: Events,
    /// A mailbox access has begun and not come to its last octet, one bit for each SyncManager.
    open: u8,
    /// The part of the logical image that its FMMUs map, from the first octet to the one behind the last.
    mapped: Range<u64>,
    /// Last write to outputs that the watchdog watches.
    fed_ns: Option<u64>,
    /// What the closed ports show in place of a receive time.
    pub(super) garbage: u32,
    /// See [`Esc::keep`].
    before: Vec<u8>,
}

impl Esc {
    pub(super) fn new(parts: Parts, now_ns: u64) -> Esc {
        let mut esc = Esc {
            memory: Box::new([0; MEMORY_LEN]),
            clock: parts.clock.map(|config| Clock::new(config, now_ns)),
            eeprom: parts.eeprom,
            events: Events::default(),
            open: 0,
            mapped: 0..0,
            fed_ns: None,
            garbage: 0,
            before: Vec::new(),
        };
        let wide = if esc.clock.as_ref().is_some_and(Clock::is_wide) {
            feature::DC_64
        } else {
            0
        };
        let dc = if esc.clock.is_some() { feature::DC | 1 << 7 } else { 0 };
        esc.set_u16(0x0000, 0x0011);
        esc.memory[4..8].copy_from_slice(&[FMMUS, SYNC_MANAGERS, 8, parts.ports]);
        esc.set_u16(register::FEATURES, parts.features | dc | wide | 0x0070);
        esc.set_u16(register::AL_CONTROL, 1);
        esc.set_u16(register::AL_STATUS, 1);
        esc.set_u16(register::WATCHDOG_DIVIDER, 0x09C2);
        esc.set_u16(register::WATCHDOG_PDI, WATCHDOG_TICKS);
        esc.set_u16(register::WATCHDOG_DATA, WATCHDOG_TICKS);
        esc.set_u16(register::WATCHDOG_STATUS, 1);
        esc.set_u16(register::DC_SPEED_START, 0x1000);
        esc.memory[usize::from(register::DC_FILTER)..][..2].copy_from_slice(&[4, 12]);
        esc.load_eeprom();
        esc
    }

    /// Takes what the chip itself takes from the EEPROM.
    fn load_eeprom(&mut self) {
        self.set_u16(register::PDI_CONTROL, self.eeprom.word(0));
        self.set_u16(register::ALIAS, self.eeprom.word(4));
        self.set_u16(register::DC_PULSE_LENGTH, self.eeprom.word(2));
    }

    pub(super) fn u16(&self, at: u16) -> u16 {
        let at = usize::from(at);
        u16::from_le_bytes([self.memory[at], self.memory[at + 1]])
    }

    pub(super) fn u32(&self, at: u16) -> u32 {
        u32::from(self.u16(at)) | u32::from(self.u16(at + 2)) << 16
    }

    fn u64(&self, at: u16) -> u64 {
        u64::from(self.u32(at)) | u64::from(self.u32(at + 4)) << 32
    }

    pub(super) fn octet(&self, at: u16) -> u8 {
        self.memory[usize::from(at)]
    }

    pub(super) fn set_octet(&mut self, at: u16, value: u8) {
        self.memory[usize::from(at)] = value;
    }

    pub(super) fn set_u16(&mut self, at: u16, value: u16) {
        self.memory[usize::from(at)..][..2].copy_from_slice(&value.to_le_bytes());
    }

    fn set_u32(&mut self, at: u16, value: u32) {
        self.memory[usize::from(at)..][..4].copy_from_slice(&value.to_le_bytes());
    }

    fn set_u64(&mut self, at: u16, value: u64) {
        self.memory[usize::from(at)..][..8].copy_from_slice(&value.to_le_bytes());
    }

    /// Memory as the firmware sees it; what lies beyond the memory is cut off.
    pub(super) fn area(&self, start: u16, length: u16) -> &[u8] {
        let start = usize::from(start).min(MEMORY_LEN);
        &self.memory[start..(start + usize::from(length)).min(MEMORY_LEN)]
    }

    pub(super) fn area_mut(&mut self, start: u16, length: u16) -> &mut [u8] {
        let start = usize::from(start).min(MEMORY_LEN);
        &mut self.memory[start..(start + usize::from(length)).min(MEMORY_LEN)]
    }

    pub(super) fn sync_manager(&self, number: u8) -> SyncManager {
        let at = usize::from(register::sync_manager(number));
        SyncManager::parse(&self.memory[at..at + SyncManager::LEN]).unwrap_or_default()
    }

    fn fmmu(&self, number: u8) -> Fmmu {
        let at = usize::from(register::fmmu(number));
        Fmmu::parse(&self.memory[at..at + Fmmu::LEN]).unwrap_or_default()
    }

    /// Switches a SyncManager off, or on again, from the side of the firmware.
    pub(super) fn disable(&mut self, number: u8, off: bool) {
        let at = register::sync_manager(number) + 7;
        let octet = self.octet(at) & !1 | u8::from(off);
        self.set_octet(at, octet);
    }

    pub(super) fn set_full(&mut self, number: u8, full: bool) {
        let at = register::sync_manager(number) + 5;
        let octet = self.octet(at) & !SyncManager::FULL | if full { SyncManager::FULL } else { 0 };
        self.set_octet(at, octet);
        let bit = 1 << (8 + number);
        let requests = self.u16(register::EVENT_REQUEST) & !bit | if full { bit } else { 0 };
        self.set_u16(register::EVENT_REQUEST, requests);
    }

    pub(super) fn is_full(&self, number: u8) -> bool {
        self.sync_manager(number).status & SyncManager::FULL != 0
    }

    /// The firmware answers that it has sent the mail once more.
    pub(super) fn acknowledge_repeat(&mut self, number: u8) {
        let start = register::sync_manager(number);
        let octet = self.octet(start + 7) & !2 | self.octet(start + 6) & 2;
        self.set_octet(start + 7, octet);
    }

    /// The state of the device changes, as the main device sees it.
    pub(super) fn set_al_status(&mut self, status: u16, code: u16) {
        self.set_u16(register::AL_STATUS_CODE, code);
        self.set_u16(register::AL_STATUS, status);
        let requests = self.u16(register::EVENT_REQUEST) | 1 << 3;
        self.set_u16(register::EVENT_REQUEST, requests);
    }

    pub(super) fn set_dl_status(&mut self, links: [bool; 4], firmware_runs: bool) {
        let mut status = DlStatus::of_links(links).0;
        let control = self.u32(register::DL_CONTROL);
        for port in 0..4 {
            if control >> (8 + 2 * port) & 3 == 3 {
                status = status & !(2 << (8 + 2 * port)) | 1 << (8 + 2 * port);
            }
        }
        if !firmware_runs {
            status &= !(DlStatus::RUNS | DlStatus::WATCHDOG);
        }
        if self.u16(register::DL_STATUS) != status {
            let requests = self.u16(register::EVENT_REQUEST) | 1 << 2;
            self.set_u16(register::EVENT_REQUEST, requests);
        }
        self.set_u16(register::DL_STATUS, status);
    }

    /// Ports whose loop the main device has closed.
    pub(super) fn is_port_closed(&self, port: usize) -> bool {
        self.u32(register::DL_CONTROL) >> (8 + 2 * port) & 3 == 3
    }

    pub(super) fn count(&mut self, at: u16) {
        let counter = self.octet(at).saturating_add(1);
        self.set_octet(at, counter);
    }

    /// Event requests that are put into the frame.
    pub(super) fn irq(&self) -> u16 {
        self.u16(register::EVENT_REQUEST) & self.u16(register::EVENT_MASK)
    }

    /// The station address or the alias of the device.
    pub(super) fn is_addressed(&self, station: u16) -> bool {
        let uses_alias = self.u32(register::DL_CONTROL) >> 24 & 1 != 0;
        self.u16(register::STATION) == station || uses_alias && self.u16(register::ALIAS) == station
    }

    /// Time after which outputs are missing, ns; `None`: nobody watches.
    pub(super) fn watchdog_ns(&self) -> Option<u64> {
        let tick_ns = (u64::from(self.u16(register::WATCHDOG_DIVIDER)) + 2) * 40;
        let ticks = u64::from(self.u16(register::WATCHDOG_DATA));
        (ticks > 0).then_some(ticks * tick_ns)
    }

    /// When the watchdog of the process data expires.
    pub(super) fn watchdog_due_ns(&self) -> Option<u64> {
        Some(self.fed_ns? + self.watchdog_ns()?)
    }

    /// Whether outputs have come within the time of the watchdog; always so where nobody watches.
    pub(super) fn is_fed(&self) -> bool {
        self.fed_ns.is_some() || self.watchdog_ns().is_none()
    }

    pub(super) fn starve(&mut self) {
        self.fed_ns = None;
    }

    /// Time passes: the EEPROM, the watchdog. Whether the watchdog of the process data has expired.
    pub(super) fn poll(&mut self, now_ns: u64) -> bool {
        let at = usize::from(register::EEPROM_DATA);
        if self.eeprom.poll(now_ns, &mut self.memory[at..at + 8]) {
            self.load_eeprom();
        }
        let expired = self.watchdog_due_ns().is_some_and(|due_ns| due_ns <= now_ns);
        if expired {
            self.fed_ns = None;
            self.set_u16(register::WATCHDOG_STATUS, 0);
            self.count(register::WATCHDOG_COUNTER);
        }
        expired
    }

    /// When something happens by itself.
    pub(super) fn next_ns(&self) -> Option<u64> {
        [self.eeprom.next_ns(), self.watchdog_due_ns()]
            .into_iter()
            .flatten()
            .min()
    }
}
