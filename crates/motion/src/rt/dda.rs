//! Step and direction levels for one stepper output.
//!
//! In:  a position at the end of each cycle, in steps and parts of steps.
//! Out: two levels at each tick of a base rate that is a multiple of the cycle's.
//!
//! The position goes evenly from the set-point of one cycle to that of the next, by a DDA in parts of 2⁻³² steps; a pulse is
//! due when it passes the middle between two steps. So at an even speed the pulses come evenly, across cycles too. What
//! the times of the drive (width of a pulse, set-up and hold of the direction) do not permit at once is made up for as soon
//! as they do: no step is ever lost, and at rest their sum is the rounded position. RT.

/// Times that a stepper drive asks for, in ticks of the base rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseTiming {
    /// Ticks in a cycle of set-points.
    pub ticks_per_cycle: u32,
    /// A pulse is at least, and here exactly, this long; 0: the output ends it within the tick in which it begins.
    pub high_ticks: u32,
    /// At least this long between two pulses.
    pub low_ticks: u32,
    /// The direction stands this long before a pulse begins.
    pub setup_ticks: u32,
    /// The direction stands this long after a pulse has ended.
    pub hold_ticks: u32,
}

/// Times that no output can keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name} is {got}: must be {least} to {TICKS_MAX}")]
pub struct TimingError {
    /// The field of the times that is out of range.
    pub name: &'static str,
    /// Its value, ticks.
    pub got: u32,
    /// The least value possible.
    pub least: u32,
}

const TICKS_MAX: u32 = 1_000_000;

/// Levels of the two lines of an output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Levels {
    /// High during a pulse; its beginning is the step. Of a pulse that ends within its tick: a step is due now.
    pub step: bool,
    /// High: the position grows.
    pub direction: bool,
}

/// Positions are kept in parts of 2⁻³² steps.
const FRACTION_BITS: u32 = 32;
const STEP: f64 = (1_u64 << FRACTION_BITS) as f64;
/// Keeps positions, and the way from any one to any other, within 64 bits.
const STEPS_MAX: f64 = (1_u32 << 30) as f64;

/// Follows set-points with pulses.
#[derive(Clone, Debug)]
pub struct StepGenerator {
    timing: PulseTiming,
    /// Where the position is and where it is going to, in parts of steps.
    at: i64,
    target: i64,
    /// Way of one tick, its remainder, and the accumulator of the remainders.
    per_tick: i64,
    remainder: i64,
    accumulator: i64,
    /// Pulses begun, those back subtracted.
    made: i64,
    levels: Levels,
    /// Ticks for which the pulse is still high, the line must stay low, and the direction must stand.
    high_left: u32,
    low_left: u32,
    setup_left: u32,
    hold_left: u32,
}

impl StepGenerator {
    /// An output that stands at step 0.
    ///
    /// # Errors
    ///
    /// A time is too short or too long.
    pub fn new(timing: PulseTiming) -> Result<StepGenerator, TimingError> {
        for (name, got, least) in [
            ("ticks_per_cycle", timing.ticks_per_cycle, 1),
            ("high_ticks", timing.high_ticks, 0),
            ("low_ticks", timing.low_ticks, 1),
            ("setup_ticks", timing.setup_ticks, 0),
            ("hold_ticks", timing.hold_ticks, 0),
        ] {
            if !(least..=TICKS_MAX).contains(&got) {
                return Err(TimingError { name, got, least });
            }
        }
        Ok(StepGenerator {
            timing,
            at: 0,
            target: 0,
            per_tick: 0,
            remainder: 0,
            accumulator: 0,
            made: 0,
            levels: Levels::default(),
            high_left: 0,
            low_left: 0,
            setup_left: 0,
            hold_left: 0,
        })
    }

    /// Where to be after the ticks of one cycle, in steps. `false`, and the old target stays, if that is NaN or more
    /// than 2³⁰ steps away from 0. RT.
    pub fn command(&mut self, steps: f64) -> bool {
        let possible = steps.abs() <= STEPS_MAX;
        if possible {
            self.target = (steps * STEP).round() as i64;
        }
        let (way, ticks) = (self.target - self.at, i64::from(self.timing.ticks_per_cycle));
        self.per_tick = way.div_euclid(ticks);
        self.remainder = way.rem_euclid(ticks);
        self.accumulator = ticks / 2;
        possible
    }

    /// The next tick. RT.
    pub fn tick(&mut self) -> Levels {
        self.advance();
        if self.high_left > 0 {
            self.high_left -= 1;
            return self.levels;
        }
        if self.levels.step {
            self.levels.step = false;
            // The tick of a pulse that ended within it was a low one already.
            let passed = u32::from(self.timing.high_ticks == 0);
            self.low_left = self.timing.low_ticks - passed;
            self.hold_left = self.timing.hold_ticks.saturating_sub(passed);
        }
        let behind = self.behind();
        // Without a step due the direction turns ahead, so that its set-up is over when one is.
        let ahead = if behind != 0 { behind } else { self.target - self.at };
        if ahead != 0 && (ahead > 0) != self.levels.direction && self.hold_left == 0 {
            self.levels.direction = ahead > 0;
            self.setup_left = self.timing.setup_ticks;
        }
        let right_way = (behind > 0) == self.levels.direction;
        if behind != 0 && right_way && self.setup_left == 0 && self.low_left == 0 {
            self.levels.step = true;
            self.high_left = self.timing.high_ticks.saturating_sub(1);
            self.made += behind.signum();
        }
        self.low_left = self.low_left.saturating_sub(1);
        self.hold_left = self.hold_left.saturating_sub(1);
        self.setup_left = self.setup_left.saturating_sub(1);
        self.levels
    }

    /// One tick nearer to the target, which it never passes: without a new command it stays there.
    fn advance(&mut self) {
        if self.at == self.target {
            return;
        }
        let ticks = i64::from(self.timing.ticks_per_cycle);
        self.accumulator += self.remainder;
        let carry = i64::from(self.accumulator >= ticks);
        self.accumulator -= carry * ticks;
        self.at += self.per_tick + carry;
    }

    /// Whether the target is reached, every step made and the last pulse over: until a new command nothing changes. RT.
    pub fn is_at_rest(&self) -> bool {
        self.at == self.target && self.behind() == 0 && !self.levels.step
    }

    /// Pulses begun so far, those back subtracted.
    pub fn made(&self) -> i64 {
        self.made
    }

    /// Steps that are due and not made: more than one or two for long means that the speed is above
    /// [`StepGenerator::steps_per_cycle_max`].
    pub fn behind(&self) -> i64 {
        ((self.at + (1 << (FRACTION_BITS - 1))) >> FRACTION_BITS) - self.made
    }

    /// Steps that fit into a cycle in one direction.
    pub fn steps_per_cycle_max(&self) -> u32 {
        self.timing.ticks_per_cycle / (self.timing.high_ticks + self.timing.low_ticks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TIMING: PulseTiming = PulseTiming {
        ticks_per_cycle: 100,
        high_ticks: 2,
        low_ticks: 3,
        setup_ticks: 4,
        hold_ticks: 5,
    };

    fn rounded(steps: f64) -> i64 {
        (((steps * STEP).round() as i64) + (1 << 31)) >> 32
    }

    fn cycle(generator: &mut StepGenerator, steps: f64, levels: &mut Vec<Levels>) {
        assert!(generator.command(steps));
        levels.extend((0..TIMING.ticks_per_cycle).map(|_| generator.tick()));
    }

    /// Looks at the two lines alone, as a drive does: counts the steps and checks every time.
    fn count(levels: &[Levels], timing: &PulseTiming) -> Result<i64, String> {
        let (mut sum, mut before) = (0, Levels::default());
        // As if everything had stood for ever.
        let (mut high, mut low, mut direction_for) = (0, u32::MAX / 2, u32::MAX / 2);
        for (tick, now) in levels.iter().enumerate() {
            let turned = now.direction != before.direction;
            if turned && before.step && (now.step || timing.hold_ticks > 0) || turned && low < timing.hold_ticks {
                return Err(format!("tick {tick}: direction turned {low} ticks after a pulse"));
            }
            direction_for = if turned { 0 } else { direction_for + 1 };
            match (before.step, now.step) {
                (false, true) if low < timing.low_ticks => return Err(format!("tick {tick}: {low} ticks low")),
                (false, true) if direction_for < timing.setup_ticks => {
                    return Err(format!("tick {tick}: direction stood {direction_for} ticks"));
                }
                (false, true) => {
                    sum += if now.direction { 1 } else { -1 };
                    high = 1;
                }
                (true, true) => high += 1,
                (true, false) if high < timing.high_ticks => return Err(format!("tick {tick}: {high} ticks high")),
                (true, false) => low = 1,
                (false, false) => low += 1,
            }
            before = *now;
        }
        Ok(sum)
    }

    #[test]
    fn pulses_come_evenly_across_cycles() {
        // 1.5 steps a cycle: a pulse every 66.7 ticks.
        let mut generator = StepGenerator::new(TIMING).unwrap();
        let mut levels = Vec::new();
        for k in 1..=20 {
            cycle(&mut generator, 1.5 * f64::from(k), &mut levels);
            assert_eq!(generator.made(), rounded(1.5 * f64::from(k)), "cycle {k}");
        }
        let edges: Vec<usize> = (1..levels.len())
            .filter(|&t| levels[t].step && !levels[t - 1].step)
            .collect();
        assert_eq!(edges.len(), 30);
        for (pair, edge) in edges.windows(2).zip(1..) {
            assert!((66..=67).contains(&(pair[1] - pair[0])), "pulse {edge}: {pair:?}");
        }
    }

    #[test]
    fn the_fastest_train_keeps_up() {
        let mut generator = StepGenerator::new(TIMING).unwrap();
        assert_eq!(generator.steps_per_cycle_max(), 20);
        let mut levels = Vec::new();
        for k in 1..=10 {
            cycle(&mut generator, 20.0 * f64::from(k), &mut levels);
            assert!(generator.behind() <= 1, "cycle {k}: {}", generator.behind());
        }
        assert_eq!(count(&levels, &TIMING), Ok(generator.made()));
    }

    #[test]
    fn a_target_that_is_none_is_refused_and_the_old_one_kept() {
        let mut generator = StepGenerator::new(TIMING).unwrap();
        cycle(&mut generator, 3.0, &mut Vec::new());
        for steps in [f64::NAN, f64::INFINITY, -2e9] {
            assert!(!generator.command(steps));
            (0..1000).for_each(|_| _ = generator.tick());
            assert_eq!((generator.made(), generator.behind()), (3, 0));
        }
    }

    #[test]
    fn times_that_cannot_be_are_refused_by_name() {
        let timing = PulseTiming { low_ticks: 0, ..TIMING };
        let error = StepGenerator::new(timing).unwrap_err();
        assert_eq!(error.to_string(), "low_ticks is 0: must be 1 to 1000000");
    }

    #[test]
    fn a_pulse_that_ends_within_its_tick_may_come_at_every_tick() {
        let timing = PulseTiming {
            high_ticks: 0,
            low_ticks: 1,
            setup_ticks: 1,
            hold_ticks: 1,
            ..TIMING
        };
        let mut generator = StepGenerator::new(timing).unwrap();
        assert_eq!(generator.steps_per_cycle_max(), 100);
        let mut pulses = 0;
        for k in 1..=10 {
            assert!(generator.command(100.0 * f64::from(k)));
            pulses += (0..100).filter(|_| generator.tick().step).count();
        }
        // One tick is the set-up of the direction.
        assert_eq!((pulses, generator.behind()), (999, 1));
        assert!(generator.command(0.0));
        // The last one up is not due any more; the direction stands for a tick before the first one down.
        let back = [generator.tick(), generator.tick()];
        assert_eq!(
            back.map(|levels| (levels.step, levels.direction)),
            [(false, false), (true, false)]
        );
    }

    proptest! {
        /// Any commands, also faster than the output: the lines keep every time, and the steps add up in the end.
        #[test]
        fn no_step_is_lost(
            ways in prop::collection::vec(-30.0..30.0_f64, 1..30),
            [high_ticks, low_ticks] in prop::array::uniform2(1..5_u32),
            [setup_ticks, hold_ticks] in prop::array::uniform2(0..9_u32),
        ) {
            let timing = PulseTiming { high_ticks, low_ticks, setup_ticks, hold_ticks, ..TIMING };
            let mut generator = StepGenerator::new(timing).unwrap();
            let (mut levels, mut steps) = (Vec::new(), 0.0);
            for way in ways {
                steps += way;
                cycle(&mut generator, steps, &mut levels);
            }
            // A target is reached and stays reached without a further command.
            levels.extend((0..20_000).map(|_| generator.tick()));
            prop_assert_eq!(generator.made(), rounded(steps));
            prop_assert_eq!(count(&levels, &timing), Ok(rounded(steps)));
        }
    }
}
