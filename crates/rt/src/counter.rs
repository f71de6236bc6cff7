//! A counter that wraps, followed beyond its length: place, speed, index.
//!
//! In:  the counter, and the count at its last index if it latches that, whenever a value comes.
//! Out: counts from its zero, counts a cycle.
//!
//! RT: nothing here allocates.

/// Values over which the speed is measured.
const SPEED_VALUES: usize = 16;

/// See the module.
#[derive(Clone, Copy, Debug)]
pub struct Counter {
    bits: u32,
    /// As it was read last.
    raw: Option<u64>,
    /// It counts anew: the next value says nothing of how far it has come.
    anew: bool,
    /// Counts since its own zero, not wrapped.
    counts: i64,
    /// Counts at which [`Counter::counts`] is 0.
    zero: i64,
    /// As the latch was read last.
    latch: Option<u64>,
    /// Counts at the last index that was seen.
    latched: Option<i64>,
    /// The next index is the new zero.
    armed: bool,
    /// Counts, and the cycles in which they came.
    last: [(i64, u64); SPEED_VALUES],
    next: usize,
    seen: usize,
}

impl Counter {
    /// Nothing seen yet; `bits`: its length, up to 64.
    pub const fn new(bits: u8) -> Counter {
        Counter {
            bits: bits as u32,
            raw: None,
            anew: false,
            counts: 0,
            zero: 0,
            latch: None,
            latched: None,
            armed: false,
            last: [(0, 0); SPEED_VALUES],
            next: 0,
            seen: 0,
        }
    }

    /// Takes the value of a cycle: the first one is taken with its sign, the others by the shorter way from the one before.
    pub fn update(&mut self, cycle: u64, raw: u64, latch: Option<u64>) {
        let before = match self.raw {
            _ if std::mem::take(&mut self.anew) => raw,
            Some(before) => before,
            None => 0,
        };
        self.counts = self.counts.wrapping_add(self.difference(raw, before));
        self.raw = Some(raw);
        if let (Some(now), Some(before)) = (latch, self.latch)
            && now != before
        {
            let at = self.counts.wrapping_sub(self.difference(raw, now));
            self.latched = Some(at);
            if std::mem::take(&mut self.armed) {
                self.zero = at;
            }
        }
        self.latch = latch;
        self.last[self.next] = (self.counts, cycle);
        self.next = (self.next + 1) % SPEED_VALUES;
        self.seen = (self.seen + 1).min(SPEED_VALUES);
    }

    /// Counts from its zero.
    pub const fn counts(&self) -> i64 {
        self.counts.wrapping_sub(self.zero)
    }

    /// The same at the last index; `None`: none has been passed.
    pub fn latched(&self) -> Option<i64> {
        self.latched.map(|latched| latched.wrapping_sub(self.zero))
    }

    /// Counts a cycle over the last values; 0 until there are two.
    pub fn counts_per_cycle(&self) -> f64 {
        let (newest, now) = self.last[(self.next + SPEED_VALUES - 1) % SPEED_VALUES];
        let (oldest, then) = self.last[if self.seen < SPEED_VALUES { 0 } else { self.next }];
        match now.wrapping_sub(then) {
            0 => 0.0,
            cycles => newest.wrapping_sub(oldest) as f64 / cycles as f64,
        }
    }

    /// It was out of sight and may have begun to count anew: the next value is where it was, and no index.
    pub fn lose_sight(&mut self) {
        // One that has never been read has nothing to lose.
        self.anew = self.raw.is_some();
        (self.latch, self.next, self.seen) = (None, 0, 0);
    }

    /// Counts from here on.
    pub fn reset(&mut self) {
        self.zero = self.counts;
    }

    /// Counts from the next index on.
    pub fn arm(&mut self) {
        self.armed = true;
    }

    /// Whether that index has not come yet.
    pub const fn is_armed(&self) -> bool {
        self.armed
    }

    /// No longer so.
    pub fn disarm(&mut self) {
        self.armed = false;
    }

    /// From `before` to `now` the shorter way round.
    const fn difference(&self, now: u64, before: u64) -> i64 {
        let unused = 64 - self.bits;
        ((now.wrapping_sub(before) << unused) as i64) >> unused
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_counter_that_begins_anew_neither_jumps_nor_shows_an_index() {
        let mut counter = Counter::new(16);
        counter.lose_sight();
        counter.update(0, 500, Some(400));
        counter.arm();
        assert_eq!((counter.counts(), counter.latched()), (500, None));
        counter.lose_sight();
        counter.update(900, 0, Some(0));
        assert_eq!(
            (counter.counts(), counter.latched(), counter.is_armed()),
            (500, None, true)
        );
        assert_eq!(counter.counts_per_cycle(), 0.0);
        counter.update(901, 20, Some(0));
        assert_eq!((counter.counts(), counter.counts_per_cycle()), (520, 20.0));
        counter.update(902, 40, Some(30));
        assert_eq!((counter.counts(), counter.latched()), (10, Some(0)));
    }

    #[test]
    fn an_index_is_the_new_zero_only_where_it_is_asked_for() {
        let mut counter = Counter::new(16);
        let run = |counter: &mut Counter, from: u64, to: u64| {
            for (cycle, raw) in (from..=to).step_by(100).enumerate() {
                // An index every 1000 counts, at 30, latched and seen 70 counts later.
                counter.update(cycle as u64, raw, Some((raw - 30) / 1000 * 1000 + 30));
            }
        };
        run(&mut counter, 100, 2500);
        assert_eq!((counter.counts(), counter.latched()), (2500, Some(2030)));
        counter.arm();
        run(&mut counter, 2600, 4400);
        assert_eq!((counter.counts(), counter.latched()), (1370, Some(1000)));
        counter.arm();
        counter.disarm();
        run(&mut counter, 4500, 5300);
        assert_eq!((counter.counts(), counter.latched()), (2270, Some(2000)));
        counter.reset();
        assert_eq!((counter.counts(), counter.latched()), (0, Some(-270)));
    }

    #[test]
    fn the_speed_is_that_of_the_cycles_that_really_passed() {
        let mut counter = Counter::new(32);
        assert_eq!(counter.counts_per_cycle(), 0.0);
        counter.update(7, 0, None);
        assert_eq!(counter.counts_per_cycle(), 0.0);
        // Every third answer is lost.
        for cycle in (8..200_u64).filter(|cycle| cycle % 3 != 0) {
            counter.update(cycle, 40 * (cycle - 7), None);
            assert_eq!(counter.counts_per_cycle(), 40.0, "{cycle}");
        }
        // It stops: seen once the window has passed.
        for cycle in 200..216 {
            counter.update(cycle, 40 * 192, None);
        }
        assert_eq!(counter.counts_per_cycle(), 0.0);
    }

    proptest! {
        #[test]
        fn a_counter_is_followed_over_its_ends(
            bits in prop::sample::select(vec![8u8, 16, 32, 64]),
            start in any::<i8>(),
            steps in prop::collection::vec(-127i64..=127, 1..200),
        ) {
            let mask = u64::MAX >> (64 - u32::from(bits));
            let mut counter = Counter::new(bits);
            let mut counts = i64::from(start);
            counter.update(0, counts as u64 & mask, None);
            for (cycle, step) in (1..).zip(steps) {
                counts += step;
                counter.update(cycle, counts as u64 & mask, None);
                prop_assert_eq!(counter.counts(), counts);
            }
        }
    }
}
