//! Distributed clock of a simulated device: a counter that drifts, the offset to the time of the bus, the loop that follows the
//! reference, and the pulses that it makes.

/// A clock as it was built, and as it came up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockConfig {
    /// It gains so many parts in 10⁹.
    pub gain_ppb: i64,
    /// What it shows at power-on, ns.
    pub start_ns: u64,
    /// Its registers have 64 bits, else 32.
    pub wide: bool,
}

impl Default for ClockConfig {
    fn default() -> ClockConfig {
        ClockConfig {
            gain_ppb: 0,
            start_ns: 0,
            wide: true,
        }
    }
}

/// Share of the difference that is taken back at once, and share that is remembered.
const PROPORTIONAL: i64 = 4;
const INTEGRAL: i64 = 64;

/// From here a clock is as far off as it can be, ns (2 years): the filtered sum of 16 such differences stays within 64 bits.
const FAR_NS: i64 = i64::MAX / 128;

/// The clock.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    config: ClockConfig,
    powered_ns: u64,
    /// What the loop has added so far, ns.
    trim_ns: i64,
    /// What it adds at every write of the reference time, beside the share of the difference; in 1/[`INTEGRAL`] ns.
    rate: i64,
    /// Filtered difference, in 1/16 ns.
    filtered: i64,
    /// 0920h.
    offset_ns: u64,
    /// 0928h.
    pub(super) delay_ns: u32,
    /// Time of the next SYNC0.
    next_sync_ns: Option<u64>,
    sync_cycle_ns: u32,
}

impl Clock {
    pub(super) fn new(config: ClockConfig, now_ns: u64) -> Clock {
        Clock {
            config,
            powered_ns: now_ns,
            trim_ns: 0,
            rate: 0,
            filtered: 0,
            offset_ns: 0,
            delay_ns: 0,
            next_sync_ns: None,
            sync_cycle_ns: 0,
        }
    }

    pub(super) fn is_wide(&self) -> bool {
        self.config.wide
    }

    /// What the counter shows.
    pub(super) fn local_ns(&self, now_ns: u64) -> u64 {
        let elapsed = now_ns.saturating_sub(self.powered_ns);
        let gained = (i128::from(elapsed) * i128::from(self.config.gain_ppb) / 1_000_000_000) as i64;
        let local = self.config.start_ns.wrapping_add(elapsed);
        local.wrapping_add_signed(gained).wrapping_add_signed(self.trim_ns)
    }

    /// 0910h.
    pub(super) fn system_ns(&self, now_ns: u64) -> u64 {
        self.local_ns(now_ns).wrapping_add(self.offset_ns)
    }

    /// 092Ch as a number: above 0 the clock is ahead.
    pub(super) fn difference_ns(&self) -> i32 {
        (self.filtered / 16).clamp(-i64::from(i32::MAX), i64::from(i32::MAX)) as i32
    }

    /// The reference time came by; `octets`: how many of it.
    pub(super) fn follow(&mut self, now_ns: u64, reference: &[u8], limit_ns: u16) {
        let mut wide = [0; 8];
        let octets = reference.len().min(8);
        wide[..octets].copy_from_slice(&reference[..octets]);
        let expected = u64::from_le_bytes(wide).wrapping_add(self.delay_ns.into());
        let difference = self.system_ns(now_ns).wrapping_sub(expected);
        let difference = if octets < 8 || !self.config.wide {
            i64::from((difference as u32).cast_signed())
        } else {
            difference.cast_signed()
        };
        let difference = difference.clamp(-FAR_NS, FAR_NS);
        self.filtered += difference - self.filtered / 16;
        let limit = i64::from(limit_ns);
        self.rate = (self.rate - difference).clamp(-limit * INTEGRAL, limit * INTEGRAL);
        let step = self.rate / INTEGRAL - difference / PROPORTIONAL;
        self.trim_ns += step.clamp(-limit, limit);
        if difference.abs() > 16 * limit {
            // Far off: only the way there counts.
            self.rate = 0;
        }
    }

    /// 0930h was written.
    pub(super) fn reset_loop(&mut self) {
        self.rate = 0;
        self.filtered = 0;
    }

    /// SYNC0 is switched on; a start that is over gives no pulse.
    pub(super) fn start_sync(&mut self, now_ns: u64, start_ns: u64, cycle_ns: u32) {
        self.sync_cycle_ns = cycle_ns;
        let ahead = start_ns.wrapping_sub(self.system_ns(now_ns)).cast_signed();
        let ahead = if self.config.wide {
            ahead
        } else {
            i64::from((ahead as u32).cast_signed())
        };
        self.next_sync_ns = (ahead > 0).then(|| self.system_ns(now_ns).wrapping_add_signed(ahead));
    }

    pub(super) fn stop_sync(&mut self) {
        self.next_sync_ns = None;
    }

    /// The next SYNC0 in system time.
    pub(super) fn next_sync_ns(&self) -> Option<u64> {
        self.next_sync_ns
    }

    /// Ahead of the next pulse, ns of the simulation; 0: it is due.
    pub(super) fn until_sync_ns(&self, now_ns: u64) -> Option<u64> {
        let ahead = self.next_sync_ns?.wrapping_sub(self.system_ns(now_ns)).cast_signed();
        Some(ahead.max(0) as u64)
    }

    /// Takes a pulse that is due.
    pub(super) fn take_sync(&mut self, now_ns: u64) -> bool {
        let Some(next) = self.next_sync_ns else { return false };
        if next.wrapping_sub(self.system_ns(now_ns)).cast_signed() > 0 {
            return false;
        }
        // Cycle 0: one pulse.
        self.next_sync_ns = (self.sync_cycle_ns > 0).then(|| next.wrapping_add(self.sync_cycle_ns.into()));
        true
    }

    /// Pulses that are over for more than so many cycles are left out; the phase stays.
    pub(super) fn skip_sync(&mut self, now_ns: u64, cycles: u32) {
        let Some(next) = self.next_sync_ns else { return };
        let behind_ns = self.system_ns(now_ns).wrapping_sub(next).cast_signed();
        let cycle_ns = i64::from(self.sync_cycle_ns);
        if cycle_ns > 0 && behind_ns > i64::from(cycles) * cycle_ns {
            self.next_sync_ns = Some(next.wrapping_add_signed(behind_ns / cycle_ns * cycle_ns));
        }
    }

    /// 0920h is written: where the time of the next pulse is over then, none comes any more, as the chip compares for equality.
    pub(super) fn set_offset(&mut self, now_ns: u64, offset_ns: u64) {
        if offset_ns == self.offset_ns {
            return;
        }
        self.offset_ns = offset_ns;
        let is_over = |next: u64| next.wrapping_sub(self.system_ns(now_ns)).cast_signed() <= 0;
        if self.next_sync_ns.is_some_and(is_over) {
            self.next_sync_ns = None;
        }
    }
}
