//! Cycles that had to be left out: how many are too many.
//!
//! In:  after each cycle that ran, how many were left out before it.
//! Out: a [`Verdict`] over the last thousand cycles.
//!
//! One overrun costs the machine a cycle of standing set-points and nothing else: the trajectory goes on where it was, the
//! network goes on as it is. Many of them spoil the surface of the part, and say that the PC does not keep its cycle. A gap so
//! long that the nodes give up waiting is theirs to see: they stop by themselves and are reported lost.
//!
//! RT: constant memory, constant time.

/// The last cycles are counted in so many parts, of which the oldest is forgotten as a whole.
const PARTS: usize = 8;
/// Cycles that ran or were left out, in one part.
const PART: u64 = 125;
/// What the limits are given for.
pub const CYCLES: u64 = PARTS as u64 * PART;

/// What the overruns of the last thousand cycles come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// None, or few.
    Fine,
    /// More than one should have. Said once in a thousand cycles.
    Many {
        /// Cycles left out.
        skipped: u64,
    },
    /// More than is borne.
    TooMany {
        /// Cycles left out.
        skipped: u64,
    },
}

#[derive(Clone, Debug)]
pub struct Overruns {
    many: u64,
    too_many: u64,
    parts: [u64; PARTS],
    part: usize,
    cycles_in_part: u64,
    quiet: u64,
}

impl Overruns {
    /// More than `many` in a thousand are told of, more than `too_many` are not borne; 0: never.
    pub fn new(many: u32, too_many: u32) -> Overruns {
        let limit = |limit: u32| if limit == 0 { u64::MAX } else { u64::from(limit) };
        Overruns {
            many: limit(many),
            too_many: limit(too_many),
            parts: [0; PARTS],
            part: 0,
            cycles_in_part: 0,
            quiet: 0,
        }
    }

    /// RT: a cycle runs, and so many before it were left out. `at_ease`: nothing moves and nothing can, so that any number is
    /// borne.
    pub fn count(&mut self, skipped: u64, at_ease: bool) -> Verdict {
        self.quiet = self.quiet.saturating_sub(1 + skipped);
        // A longer gap fills all that is remembered.
        let mut left_out = skipped.min(CYCLES);
        while left_out > 0 {
            let here = left_out.min(self.room());
            self.parts[self.part] += here;
            self.cycles_in_part += here;
            left_out -= here;
        }
        let remembered = self.parts.iter().sum();
        self.room();
        self.cycles_in_part += 1;
        if skipped == 0 {
            return Verdict::Fine;
        }
        let skipped = remembered;
        if skipped > self.too_many && !at_ease {
            Verdict::TooMany { skipped }
        } else if skipped > self.many.min(self.too_many) && self.quiet == 0 {
            self.quiet = CYCLES;
            Verdict::Many { skipped }
        } else {
            Verdict::Fine
        }
    }

    /// RT: cycles for which there is room in the part under way, above 0: behind a full one, the oldest is begun again.
    fn room(&mut self) -> u64 {
        if self.cycles_in_part == PART {
            self.part = (self.part + 1) % PARTS;
            self.parts[self.part] = 0;
            self.cycles_in_part = 0;
        }
        PART - self.cycles_in_part
    }

    /// RT: whether any of the last thousand cycles was left out.
    pub fn are_some(&self) -> bool {
        self.parts.iter().any(|skipped| *skipped > 0)
    }

    /// RT: the operator has acknowledged; what was before does not count any more.
    pub fn clear(&mut self) {
        self.parts = [0; PARTS];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Verdicts that are not [`Verdict::Fine`], with the number of the cycle, where every so many cycles one is left out.
    fn verdicts(overruns: &mut Overruns, cycles: u64, every: u64) -> Vec<(u64, Verdict)> {
        let verdict = |cycle: u64| (cycle, overruns.count(u64::from(cycle.is_multiple_of(every)), false));
        (1..=cycles)
            .map(verdict)
            .filter(|(_, verdict)| *verdict != Verdict::Fine)
            .collect()
    }

    #[test]
    fn few_are_fine_for_ever() {
        // 4 or 5 in any thousand dates.
        assert_eq!(verdicts(&mut Overruns::new(5, 50), 100_000, 250), []);
    }

    #[test]
    fn many_are_told_of_once_in_a_thousand_cycles() {
        let told = verdicts(&mut Overruns::new(5, 50), 5_000, 100);
        assert_eq!(told[0], (600, Verdict::Many { skipped: 6 }));
        assert!((5..=6).contains(&told.len()), "{told:?}");
        assert!(told.windows(2).all(|pair| pair[1].0 - pair[0].0 >= 900), "{told:?}");
        assert!(
            told.iter()
                .all(|(_, verdict)| matches!(verdict, Verdict::Many { skipped: 6..=11 })),
            "{told:?}"
        );
    }

    #[test]
    fn too_many_are_not_borne_until_they_are_acknowledged() {
        let mut overruns = Overruns::new(0, 50);
        assert_eq!(overruns.count(50, false), Verdict::Fine);
        assert_eq!(overruns.count(1, false), Verdict::TooMany { skipped: 51 });
        assert_eq!(overruns.count(0, false), Verdict::Fine, "only a new one says so again");
        assert_eq!(overruns.count(1, false), Verdict::TooMany { skipped: 52 });
        overruns.clear();
        assert_eq!(overruns.count(50, false), Verdict::Fine);
        // A thousand good cycles later all is forgotten.
        assert_eq!(verdicts(&mut overruns, 1_100, u64::MAX), []);
        assert_eq!(overruns.count(50, false), Verdict::Fine);
    }

    #[test]
    fn no_more_are_told_of_than_are_looked_at() {
        for gap in [126, 999, 1_000, 1_021, 1_000_000] {
            let mut overruns = Overruns::new(5, 50);
            assert_eq!(verdicts(&mut overruns, 500, 100), []);
            let Verdict::TooMany { skipped } = overruns.count(gap, false) else {
                panic!("{gap} are too many");
            };
            assert!(
                (gap.min(CYCLES - PART)..=CYCLES).contains(&skipped),
                "{skipped} of {gap}"
            );
        }
    }

    #[test]
    fn at_ease_any_number_is_borne_and_told_of_once_in_a_thousand_cycles() {
        let mut overruns = Overruns::new(0, 50);
        assert_eq!(overruns.count(600, true), Verdict::Many { skipped: 600 });
        for _ in 0..10 {
            assert_eq!(overruns.count(9, true), Verdict::Fine);
        }
        assert_eq!(overruns.count(1, false), Verdict::TooMany { skipped: 691 });
    }

    #[test]
    fn limits_of_nought_never_speak() {
        assert_eq!(Overruns::new(0, 0).count(1_000_000, false), Verdict::Fine);
    }
}
