//! What datagrams do to the memory of a chip: which octets can be read and written, SyncManagers, FMMUs, side effects.
//!
//! In:  the data of a datagram. Out: the same with what was read, what the working counter gains, [`Events`](super::Events) for the
//! firmware.

use super::{Esc, FMMUS, MEMORY_LEN, SYNC_MANAGERS};
use crate::sub::objects::copy_bits;
use crate::wire::Command;
use crate::wire::register::{self, Fmmu, SyncManager, sync};
use std::ops::Range;
use std::vec::Vec;

const ERROR_GROUPS: [Range<usize>; 4] = [0x300..0x308, 0x308..0x30C, 0x30C..0x30E, 0x310..0x314];

fn ranges_overlap(a: &Range<usize>, b: &Range<usize>) -> bool {
    a.start < b.end && b.start < a.end
}

impl Esc {
    /// Whether some octet of the range is there.
    fn exists(&self, range: &Range<usize>) -> bool {
        let fmmus = usize::from(register::FMMU);
        let managers = usize::from(register::SYNC_MANAGER);
        let missing = [
            fmmus + 16 * usize::from(FMMUS)..0x0700,
            managers + 8 * usize::from(SYNC_MANAGERS)..0x0900,
            MEMORY_LEN..usize::MAX,
        ];
        let no_clock = self.clock.is_none().then_some(0x0900..0x0A00);
        let is_missing = |missing: &Range<usize>| missing.start <= range.start && range.end <= missing.end;
        !missing.iter().chain(no_clock.iter()).any(is_missing)
    }

    /// Whether the bits of an octet of the registers can be written.
    fn is_writable(&self, at: usize) -> bool {
        match at {
            0x0010..0x0012 | 0x0100..0x0104 | 0x0120..0x0122 | 0x0200..0x0202 | 0x0204..0x0208 => true,
            0x0400..0x0402 | 0x0410..0x0412 | 0x0420..0x0422 => true,
            0x0500 | 0x0504..0x0510 => true,
            0x0600..0x0680 => true,
            0x0800..0x0840 => !matches!(at & 7, 5 | 7),
            0x0920..0x092C | 0x0930..0x0932 | 0x0934..0x0936 => self.clock.is_some(),
            0x0980..0x0982 | 0x0990..0x0998 | 0x09A0..0x09A8 => self.clock.is_some(),
            0x0F00.. => true,
            _ => false,
        }
    }

    /// SyncManagers that are on and whose memory the range touches.
    fn touched(&self, range: &Range<usize>) -> impl Iterator<Item = (u8, SyncManager, Range<usize>)> {
        let range = range.clone();
        (0..SYNC_MANAGERS).filter_map(move |number| {
            let manager = self.sync_manager(number);
            let start = usize::from(manager.start);
            let area = start..start + usize::from(manager.length);
            (manager.is_active() && ranges_overlap(&area, &range)).then_some((number, manager, area))
        })
    }

    /// Whether the SyncManagers let an access pass.
    fn is_allowed(&self, range: &Range<usize>, write: bool) -> bool {
        if range.end <= usize::from(register::MEMORY) && range.start < usize::from(register::SYNC_MANAGER) {
            return true;
        }
        self.touched(range).all(|(number, manager, area)| {
            if manager.pdi & 1 != 0 || manager.is_written() != write {
                return false;
            }
            if !manager.is_mailbox() {
                return true;
            }
            let begun = range.start <= area.start || self.open >> number & 1 != 0;
            let full = manager.status & SyncManager::FULL != 0;
            begun && full != write
        })
    }

    /// What the access does to the SyncManagers that it touches.
    fn finish_access(&mut self, now_ns: u64, range: &Range<usize>, write: bool) {
        for number in 0..SYNC_MANAGERS {
            let manager = self.sync_manager(number);
            let start = usize::from(manager.start);
            let area = start..start + usize::from(manager.length);
            if !manager.is_active() || !ranges_overlap(&area, range) {
                continue;
            }
            let bit = 1 << number;
            if manager.is_mailbox() {
                self.open |= bit;
                if range.end >= area.end {
                    self.open &= !bit;
                    self.set_full(number, write);
                    self.events.written |= if write { bit } else { 0 };
                    self.events.emptied |= !write;
                }
            } else if write {
                self.events.written |= bit;
                if manager.control & SyncManager::TRIGGER != 0 {
                    self.fed_ns = Some(now_ns);
                    self.set_u16(register::WATCHDOG_STATUS, 1);
                }
            }
        }
    }

    /// Puts what is computed into the registers before they are read.
    fn refresh(&mut self, now_ns: u64, range: &Range<usize>) {
        let touches = |at: u16, length: usize| ranges_overlap(&(usize::from(at)..usize::from(at) + length), range);
        if touches(register::EEPROM_CONTROL, 2) {
            let status = self.eeprom.status();
            self.set_u16(register::EEPROM_CONTROL, status);
        }
        let Some(clock) = &self.clock else { return };
        let (system, difference, next) = (clock.system_ns(now_ns), clock.difference_ns(), clock.next_sync_ns());
        let cut = |time: u64| if clock.is_wide() { time } else { time & 0xFFFF_FFFF };
        let (system, next) = (cut(system), next.map(cut));
        if touches(register::DC_SYSTEM_TIME, 8) {
            self.set_u64(register::DC_SYSTEM_TIME, system);
        }
        if touches(register::DC_DIFFERENCE, 4) {
            self.set_u32(register::DC_DIFFERENCE, register::difference_register(difference));
        }
        if touches(register::DC_SYNC0_START, 8)
            && let Some(next) = next
        {
            self.set_u64(register::DC_SYNC0_START, next);
        }
    }

    /// Reads for the main device; whether the device acts.
    fn read(&mut self, now_ns: u64, start: usize, out: &mut [u8], or: bool) -> bool {
        let range = start..start + out.len();
        if out.is_empty() || !self.exists(&range) || !self.is_allowed(&range, false) {
            return false;
        }
        self.refresh(now_ns, &range);
        for (at, octet) in range.clone().zip(out) {
            let value = self.memory.get(at).copied().unwrap_or(0);
            *octet = if or { *octet | value } else { value };
        }
        self.finish_access(now_ns, &range, false);
        let mut seen = 0;
        for (at, bit) in [(register::DL_STATUS, 1 << 2), (register::AL_STATUS, 1 << 3)] {
            if range.contains(&usize::from(at)) {
                seen |= bit;
            }
        }
        let requests = self.u16(register::EVENT_REQUEST) & !seen;
        self.set_u16(register::EVENT_REQUEST, requests);
        true
    }

    /// Writes for the main device; whether the device acts.
    fn write(&mut self, now_ns: u64, start: usize, data: &[u8], times: &[Option<u64>; 4]) -> bool {
        let range = start..start + data.len();
        if data.is_empty() || !self.exists(&range) || !self.is_allowed(&range, true) {
            return false;
        }
        let managers = usize::from(register::SYNC_MANAGER);
        for (at, octet) in range.clone().zip(data) {
            if at < MEMORY_LEN && self.is_writable(at) {
                if (managers..managers + 8 * usize::from(SYNC_MANAGERS)).contains(&at) && self.memory[at] != *octet {
                    self.manager_changes(at - managers, *octet);
                }
                self.memory[at] = *octet;
            }
        }
        self.finish_access(now_ns, &range, true);
        self.side_effects(now_ns, &range, data, times);
        true
    }

    /// An octet of a SyncManager's registers gets another value.
    fn manager_changes(&mut self, at: usize, value: u8) {
        let number = (at / 8) as u8;
        let bit = 1 << number;
        if at % 8 == 6 {
            let old = self.octet(register::sync_manager(number) + 6);
            self.events.repeat |= (old ^ value) & 2 != 0;
            if (old ^ value) & 1 == 0 {
                return;
            }
            // Switched on or off: an empty mailbox.
            self.open &= !bit;
            self.set_full(number, false);
        }
        self.events.changed |= bit;
    }

    fn side_effects(&mut self, now_ns: u64, range: &Range<usize>, data: &[u8], times: &[Option<u64>; 4]) {
        let touches = |at: u16, length: usize| ranges_overlap(&(usize::from(at)..usize::from(at) + length), range);
        if touches(register::FMMU, Fmmu::LEN * usize::from(FMMUS)) {
            let active = (0..FMMUS).map(|number| self.fmmu(number)).filter(|fmmu| fmmu.active);
            let ends = active.map(|fmmu| {
                (
                    u64::from(fmmu.logical),
                    u64::from(fmmu.logical) + u64::from(fmmu.length),
                )
            });
            let all = ends.reduce(|all, next| (all.0.min(next.0), all.1.max(next.1)));
            self.mapped = all.map_or(0..0, |(start, end)| start..end);
        }
        self.events.al_control |= touches(register::AL_CONTROL, 1);
        for group in ERROR_GROUPS {
            if ranges_overlap(&group, range) {
                self.memory[group].fill(0);
            }
        }
        if touches(register::WATCHDOG_COUNTER, 2) {
            self.set_u16(register::WATCHDOG_COUNTER, 0);
        }
        if touches(register::EEPROM_OWNER, 1) {
            let owner = self.octet(register::EEPROM_OWNER) & 1;
            self.set_octet(register::EEPROM_TAKEN, owner);
        }
        let is_ours = self.octet(register::EEPROM_OWNER) & 1 == 0;
        let at = usize::from(register::EEPROM_CONTROL);
        if is_ours && range.start <= at && at + 2 <= range.end {
            let from = at - range.start;
            let control = u16::from_le_bytes([data[from], data[from + 1]]);
            let address = self.u32(register::EEPROM_ADDRESS);
            self.eeprom.command(now_ns, control, address);
        }
        self.clock_effects(now_ns, range, data, times);
    }

    fn clock_effects(&mut self, now_ns: u64, range: &Range<usize>, data: &[u8], times: &[Option<u64>; 4]) {
        let touches = |at: u16, length: usize| ranges_overlap(&(usize::from(at)..usize::from(at) + length), range);
        let limit = self.u16(register::DC_SPEED_START);
        let (offset, delay) = (self.u64(register::DC_OFFSET), self.u32(register::DC_DELAY));
        let activation = self.octet(register::DC_SYNC_ACTIVATION);
        let (start, cycle) = (self.u64(register::DC_SYNC0_START), self.u32(register::DC_SYNC0_CYCLE));
        let garbage = self.garbage;
        let Some(clock) = &mut self.clock else { return };
        clock.delay_ns = delay;
        clock.set_offset(now_ns, offset);
        let at = usize::from(register::DC_SYSTEM_TIME);
        if range.start <= at && at + 4 <= range.end {
            let from = at - range.start;
            let octets = (data.len() - from).min(8);
            // A drift of at most 0930h ns for each write, by the fact sheet.
            clock.follow(now_ns, &data[from..from + octets], limit);
        }
        if touches(register::DC_SPEED_START, 2) {
            clock.reset_loop();
        }
        let pulses = sync::CYCLIC | sync::SYNC0;
        let on = activation & pulses == pulses;
        if touches(register::DC_SYNC_ACTIVATION, 1)
            || on && activation & sync::AUTO_START != 0 && touches(register::DC_SYNC0_START, 8)
        {
            if on {
                clock.start_sync(now_ns, start, cycle);
            } else {
                clock.stop_sync();
            }
        }
        if touches(register::DC_RECEIVE_TIMES, 1) {
            let local: Vec<u32> = times
                .iter()
                .map(|time| time.map_or(garbage, |at_ns| clock.local_ns(at_ns) as u32))
                .collect();
            let unit = clock.local_ns(now_ns);
            let unit = if clock.is_wide() { unit } else { unit & 0xFFFF_FFFF };
            for (port, time) in local.into_iter().enumerate() {
                self.set_u32(register::DC_RECEIVE_TIMES + 4 * port as u16, time);
            }
            self.set_u64(register::DC_UNIT_TIME, unit);
        }
    }

    /// The data as they are now, in memory that is given back for the next datagram.
    fn keep(&mut self, data: &[u8]) -> Vec<u8> {
        let mut before = std::mem::take(&mut self.before);
        before.clear();
        before.extend_from_slice(data);
        before
    }

    /// One datagram with an offset in the memory; what the working counter gains. `now_ns`: when it passes the processing unit;
    /// `times`: when it passes the ports.
    pub(in crate::sub) fn access(
        &mut self,
        now_ns: u64,
        command: Command,
        start: u16,
        data: &mut [u8],
        times: &[Option<u64>; 4],
    ) -> u16 {
        let start = usize::from(start);
        let broadcast = matches!(command, Command::Brd | Command::Brw);
        if !(command.reads() && command.writes()) {
            let acts = if command.reads() {
                self.read(now_ns, start, data, broadcast)
            } else {
                self.write(now_ns, start, data, times)
            };
            return u16::from(acts);
        }
        let before = self.keep(data);
        let read = self.read(now_ns, start, data, broadcast);
        let written = self.write(now_ns, start, &before, times);
        self.before = before;
        u16::from(read) + 2 * u16::from(written)
    }

    /// A datagram of the reference time that others than the addressed device write.
    pub(in crate::sub) fn multiple_write(
        &mut self,
        now_ns: u64,
        start: u16,
        data: &[u8],
        times: &[Option<u64>; 4],
    ) -> u16 {
        u16::from(self.write(now_ns, usize::from(start), data, times))
    }

    /// One logical datagram; what the working counter gains.
    pub(in crate::sub) fn logical(&mut self, now_ns: u64, command: Command, logical: u32, data: &mut [u8]) -> u16 {
        let frame = u64::from(logical)..u64::from(logical) + data.len() as u64;
        // Most datagrams of a frame are those of others.
        if frame.end <= self.mapped.start || frame.start >= self.mapped.end {
            return 0;
        }
        let mapped: [Option<(Fmmu, Part)>; FMMUS as usize] = std::array::from_fn(|number| {
            let active = self.memory[usize::from(register::fmmu(number as u8)) + 12] & 1 != 0;
            let fmmu = active.then(|| self.fmmu(number as u8))?;
            Part::of(&fmmu, &frame).map(|part| (fmmu, part))
        });
        if mapped.iter().all(Option::is_none) {
            return 0;
        }
        let before = self.keep(data);
        let (mut read, mut written) = (false, false);
        // What is read is what was there before anything was written.
        for write in [false, true] {
            if if write { !command.writes() } else { !command.reads() } {
                continue;
            }
            for (fmmu, part) in mapped.iter().flatten() {
                let kind = if write { Fmmu::WRITE } else { Fmmu::READ };
                if fmmu.kind & kind == 0 {
                    continue;
                }
                let range = part.octets();
                if !self.exists(&range) || range.end > MEMORY_LEN || !self.is_allowed(&range, write) {
                    continue;
                }
                if write {
                    copy_bits(&before, part.frame, &mut self.memory[..], part.memory, part.bits);
                    written = true;
                } else {
                    self.refresh(now_ns, &range);
                    copy_bits(&self.memory[..], part.memory, data, part.frame, part.bits);
                    read = true;
                }
                self.finish_access(now_ns, &range, write);
            }
        }
        self.before = before;
        let write_counts = if command.reads() { 2 } else { 1 };
        u16::from(read) + write_counts * u16::from(written)
    }
}

/// The bits of an FMMU that lie in a frame.
struct Part {
    /// First bit in the data of the datagram.
    frame: usize,
    /// First bit in the memory.
    memory: usize,
    bits: usize,
}

impl Part {
    fn of(fmmu: &Fmmu, frame: &Range<u64>) -> Option<Part> {
        let first = 8 * u64::from(fmmu.logical) + u64::from(fmmu.first_bit);
        let last_octet = u64::from(fmmu.logical) + u64::from(fmmu.length.checked_sub(1)?);
        let end = 8 * last_octet + u64::from(fmmu.last_bit) + 1;
        let (start, stop) = (first.max(8 * frame.start), end.min(8 * frame.end));
        if start >= stop {
            return None;
        }
        Some(Part {
            frame: (start - 8 * frame.start) as usize,
            memory: 8 * usize::from(fmmu.physical) + usize::from(fmmu.physical_bit) + (start - first) as usize,
            bits: (stop - start) as usize,
        })
    }

    /// The octets of the memory that it touches.
    fn octets(&self) -> Range<usize> {
        self.memory / 8..(self.memory + self.bits).div_ceil(8)
    }
}
