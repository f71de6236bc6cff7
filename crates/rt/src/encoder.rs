//! Where the spindle is, from a counter that wraps.
//!
//! In:  the counter and the count at which the index was passed last, once a cycle; whether they are of this cycle.
//! Out: turns and whether they count from an index ([`SpindleFeedback`]); speed.
//!
//! RT: nothing here allocates.

use bus::layout::Field;
use bus::plan::NodePlan;
use bus::{InputImage, NodeIndex};
use config::{Mapped, SpindleCounter};
use motion::rt::SpindleFeedback;

/// Cycles over which the speed is measured: of an encoder with 1000 counts it is then known to 2 turns a minute at 1 ms.
const SPEED_CYCLES: usize = 32;
/// Counts by which two indexes may be apart from whole turns: an index is a count wide, and seen from both sides.
const SLIP_COUNTS: i64 = 2;
/// Cycles without a value that are bridged at the last speed.
const BRIDGED_CYCLES: u32 = 5;

/// Follows a counter beyond its length.
#[derive(Clone, Copy, Debug)]
pub struct Turns {
    counter_bits: u32,
    counts_per_turn: f64,
    /// The last count, as it was read.
    last: Option<u64>,
    /// Counts since the beginning, not wrapped.
    counts: i64,
    /// The last latched count: another one is an index.
    latched: Option<u64>,
    /// Counts at the index from which turns count.
    zero: Option<i64>,
    /// Distance of the last index from a whole number of turns, counts.
    off: i64,
    /// Whether that is more than an index is wide, until it is told.
    slipped: bool,
}

impl Turns {
    /// Nothing seen yet; `counts_per_turn` below 0: the counter counts down where turns count up.
    pub fn new(counter_bits: u8, counts_per_turn: i32) -> Turns {
        Turns {
            counter_bits: u32::from(counter_bits),
            counts_per_turn: f64::from(counts_per_turn),
            last: None,
            counts: 0,
            latched: None,
            zero: None,
            off: 0,
            slipped: false,
        }
    }

    /// Takes this cycle's counter; `latched`: its value at the last index, `None` where its multiples are at the index. Between
    /// two calls it may change by less than half of its length. RT.
    pub fn update(&mut self, counter: u64, latched: Option<u64>) -> SpindleFeedback {
        match self.last {
            Some(last) => self.counts += self.difference(counter, last),
            // Turns of a counter without a latch count from its zero.
            None => self.counts = self.difference(counter, 0),
        }
        self.last = Some(counter);
        match (latched, self.latched) {
            (None, _) => self.zero = Some(0),
            (Some(_), None) => {}
            (Some(latched), Some(before)) if latched != before => self.pass_index(self.difference(counter, latched)),
            (Some(_), Some(_)) => {}
        }
        self.latched = latched;
        SpindleFeedback {
            turns: (self.counts - self.zero.unwrap_or(0)) as f64 / self.counts_per_turn,
            indexed: self.zero.is_some(),
        }
    }

    /// An index was passed, so many counts ago. The first one is where turns count from; all others are whole turns away from it,
    /// or counts were lost, or some that are none were counted.
    fn pass_index(&mut self, ago: i64) {
        let index = self.counts - ago;
        let zero = *self.zero.get_or_insert(index);
        // A whole number: it comes from an i32.
        let a_turn = (self.counts_per_turn.abs() as i64).max(1);
        let off = (index - zero).rem_euclid(a_turn);
        self.off = if 2 * off > a_turn { off - a_turn } else { off };
        self.slipped = self.off.abs() > SLIP_COUNTS;
    }

    /// Counts by which the last index was not where whole turns are; told once for each index. `None`: it was. RT.
    pub fn take_slip(&mut self) -> Option<i64> {
        std::mem::take(&mut self.slipped).then_some(self.off)
    }

    /// Turns are whole at the last index from now on, and as many as before. RT.
    pub fn adopt_index(&mut self) {
        let off = std::mem::take(&mut self.off);
        self.zero = self.zero.map(|zero| zero + off);
    }

    /// From `before` to `now` the shorter way round.
    fn difference(&self, now: u64, before: u64) -> i64 {
        let unused = 64 - self.counter_bits;
        ((now.wrapping_sub(before) << unused) as i64) >> unused
    }
}

/// A counter among the inputs of a node.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    node: NodeIndex,
    counter: Field,
    latch: Option<Field>,
    from: SpindleCounter,
    turns: Turns,
    /// The last that was known, and cycles since then.
    seen: SpindleFeedback,
    missing: u32,
}

impl Encoder {
    /// The encoder of the machine file; the machine file knows that the objects are there.
    pub fn new(from: SpindleCounter, plans: &[NodePlan]) -> Option<Encoder> {
        let inputs = &plans.get(from.node)?.inputs;
        let field = |object: Mapped| inputs.find(object.index, object.sub);
        Some(Encoder {
            node: from.node,
            counter: field(from.counter)?,
            latch: from.index.and_then(field),
            from,
            turns: Turns::new(from.counter.bits, from.counts_per_turn),
            seen: SpindleFeedback::NONE,
            missing: BRIDGED_CYCLES,
        })
    }

    /// See [`Turns::take_slip`]. RT.
    pub fn take_slip(&mut self) -> Option<i64> {
        self.turns.take_slip()
    }

    /// See [`Turns::adopt_index`]. RT.
    pub fn adopt_index(&mut self) {
        self.turns.adopt_index();
    }

    /// This cycle's place. Where the answer of the node got lost, the spindle is taken to go on as it did (`turns_per_cycle`)
    /// for a few cycles; then its place is NaN. Once it has been gone for so long, its index is looked for again. RT.
    pub fn read(&mut self, inputs: &InputImage, turns_per_cycle: f64) -> SpindleFeedback {
        if inputs.fresh[self.node] {
            let payload = inputs.payload.node(self.node);
            let latched = self.latch.map(|latch| latch.read(payload));
            self.seen = self.turns.update(self.counter.read(payload), latched);
            self.missing = 0;
            return self.seen;
        }
        self.missing = (self.missing + 1).min(BRIDGED_CYCLES + 1);
        if self.missing <= BRIDGED_CYCLES {
            return SpindleFeedback {
                turns: self.seen.turns + f64::from(self.missing) * turns_per_cycle,
                ..self.seen
            };
        }
        self.turns = Turns::new(self.from.counter.bits, self.from.counts_per_turn);
        SpindleFeedback {
            turns: f64::NAN,
            indexed: false,
        }
    }
}

/// Speed from the places of the last cycles.
#[derive(Clone, Copy, Debug)]
pub struct Speed {
    turns: [f64; SPEED_CYCLES],
    next: usize,
    seen: usize,
    last: SpindleFeedback,
    per_cycle: f64,
}

impl Speed {
    /// Nothing seen yet.
    pub const fn new() -> Speed {
        Speed {
            turns: [0.0; SPEED_CYCLES],
            next: 0,
            seen: 0,
            last: SpindleFeedback::NONE,
            per_cycle: 0.0,
        }
    }

    /// Takes this cycle's place; gives the turns of a cycle, 0 until enough are known. RT.
    pub fn update(&mut self, place: &SpindleFeedback) -> f64 {
        if !place.turns.is_finite() {
            *self = Speed::new();
            return 0.0;
        }
        if place.indexed != self.last.indexed {
            // The count begins again, the spindle goes on.
            let shift = place.turns - (self.last.turns + self.per_cycle);
            for turns in &mut self.turns {
                *turns += shift;
            }
        }
        self.last = *place;
        let oldest = std::mem::replace(&mut self.turns[self.next], place.turns);
        self.next = (self.next + 1) % SPEED_CYCLES;
        if self.seen < SPEED_CYCLES {
            self.seen += 1;
        } else {
            self.per_cycle = (place.turns - oldest) / SPEED_CYCLES as f64;
        }
        self.per_cycle
    }
}

impl Default for Speed {
    fn default() -> Speed {
        Speed::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spindle that turns by `step` counts a cycle, seen through a counter of 16 bits that is latched at each index.
    fn run(step: i64, cycles: i64, counts_per_turn: i32, phase: i64) -> Vec<SpindleFeedback> {
        let mut turns = Turns::new(16, counts_per_turn);
        let a_turn = i64::from(counts_per_turn.abs());
        let mut latched = 12_345;
        let (mut count, mut seen) = (1000_i64, Vec::new());
        for _ in 0..cycles {
            let (before, now) = (count, count + step);
            let passed = |at: i64| (at - phase).div_euclid(a_turn);
            if passed(before) != passed(now) {
                latched = (passed(before.max(now)) * a_turn + phase) as u64 & 0xFFFF;
            }
            count = now;
            seen.push(turns.update(now as u64 & 0xFFFF, Some(latched)));
        }
        seen
    }

    #[test]
    fn turns_count_from_the_index_on_beyond_the_length_of_the_counter() {
        for (step, counts_per_turn) in [(137, 3000), (-137, 3000), (137, -3000), (-137, -3000)] {
            let seen = run(step, 5000, counts_per_turn, 777);
            let first = seen.iter().position(|place| place.indexed).unwrap();
            assert!((1..=3000 / 137 + 1).contains(&first), "{first}");
            for (cycle, place) in seen.iter().enumerate().skip(first) {
                let count = 1000 + step * (cycle as i64 + 1);
                let from_index = (count - 777) as f64 / f64::from(counts_per_turn);
                // Whole turns at the index, whichever it was.
                let off = place.turns - from_index;
                assert!((off - off.round()).abs() < 1e-9, "{off}");
            }
            let last = seen[4999].turns - seen[first].turns;
            let counts = step as f64 * (4999 - first) as f64;
            assert!((last - counts / f64::from(counts_per_turn)).abs() < 1e-9);
        }
    }

    #[test]
    fn counts_that_are_lost_show_at_the_next_index() {
        for counts_per_turn in [3000, -3000] {
            let mut turns = Turns::new(16, counts_per_turn);
            let (mut slips, mut places) = (Vec::new(), Vec::new());
            // 150 counts a cycle, an index every 20 cycles; 7 counts are lost in the fifth turn, 2 in the ninth.
            for cycle in 0..300_i64 {
                let lost = if cycle >= 190 {
                    9
                } else if cycle >= 110 {
                    7
                } else {
                    0
                };
                let latched = cycle / 20 * 3000
                    - if cycle >= 200 {
                        9
                    } else if cycle >= 120 {
                        7
                    } else {
                        0
                    };
                let place = turns.update((cycle * 150 - lost) as u64 & 0xFFFF, Some(latched as u64 & 0xFFFF));
                if let Some(slip) = turns.take_slip() {
                    slips.push((cycle, slip));
                    turns.adopt_index();
                }
                places.push(place.turns.abs());
            }
            // What is adopted counts no more; two counts are within the width of an index.
            assert_eq!(slips, [(120, -7)]);
            for (cycle, lost) in [
                (119, -7.0),
                (120, -7.0),
                (121, 0.0),
                (189, 0.0),
                (200, -2.0),
                (299, -2.0),
            ] {
                let turns = (f64::from(cycle) * 150.0 - 3000.0 + lost) / 3000.0;
                let found = places[cycle as usize];
                assert!((found - turns).abs() < 1e-9, "{cycle}: {found}, not {turns}");
            }
        }
    }

    #[test]
    fn without_a_latch_the_zero_of_the_counter_is_the_index() {
        let mut turns = Turns::new(16, 4096);
        let first = turns.update(8192 + 1024, None);
        assert_eq!((first.turns, first.indexed), (2.25, true));
        // Over the end of the counter, and back.
        assert_eq!(Turns::new(16, 4096).update(0xFFFF, None).turns, -1.0 / 4096.0);
        let mut turns = Turns::new(16, 4096);
        turns.update(0x7FFF, None);
        assert_eq!(turns.update(0x8001, None).turns, f64::from(0x8001) / 4096.0);
        assert_eq!(turns.update(0x7FFE, None).turns, f64::from(0x7FFE) / 4096.0);
    }

    #[test]
    fn speed_is_that_of_the_last_cycles_also_over_the_index() {
        let mut speed = Speed::new();
        let place = |turns, indexed| SpindleFeedback { turns, indexed };
        for cycle in 0..100 {
            let found = speed.update(&place(f64::from(cycle) * 0.02, false));
            let known = cycle >= SPEED_CYCLES as i32;
            assert!((found - if known { 0.02 } else { 0.0 }).abs() < 1e-12, "{cycle}");
        }
        for cycle in 0..100 {
            let found = speed.update(&place(0.3 + f64::from(cycle) * 0.02, true));
            assert!((found - 0.02).abs() < 1e-12, "{cycle}");
        }
        assert_eq!(speed.update(&place(f64::NAN, true)), 0.0);
    }
}
