//! How frames lie to SYNC0: one that comes too near to it gives a drive two targets in one period and none in the next.
//!
//! In:  by how much each cycle came behind its date by the clock of the bus. Out: how far before SYNC0, how much it varies, and what
//! shift would do.

/// Cycles that are looked at together.
const CYCLES: u32 = 1000;
/// What a drive needs between a frame and SYNC0, beside the jitter, as a share of the cycle.
const MARGIN: u32 = 10;

/// The cycles that are looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    cycles: u32,
    lost: u32,
    earliest_ns: i64,
    latest_ns: i64,
    /// The last one that was whole: earliest, latest, lost.
    last: Option<(i64, i64, u32)>,
}

impl Window {
    pub(super) const fn new() -> Window {
        Window {
            cycles: 0,
            lost: 0,
            earliest_ns: i64::MAX,
            latest_ns: i64::MIN,
            last: None,
        }
    }

    /// A cycle; `None`: its frame was lost, or nobody leads.
    pub(super) fn add(&mut self, late_ns: Option<i64>) {
        self.cycles += 1;
        match late_ns {
            Some(late_ns) => {
                self.earliest_ns = self.earliest_ns.min(late_ns);
                self.latest_ns = self.latest_ns.max(late_ns);
            }
            None => self.lost += 1,
        }
        if self.cycles >= CYCLES {
            let last = (self.lost < CYCLES).then_some((self.earliest_ns, self.latest_ns, self.lost));
            *self = Window { last, ..Window::new() };
        }
    }

    pub(super) fn punctuality(&self, shift_ns: i32, cycle_ns: u32) -> Option<Punctuality> {
        let (earliest_ns, latest_ns, lost) = self.last?;
        Some(Punctuality {
            before_ns: i64::from(shift_ns) - latest_ns,
            spread_ns: latest_ns - earliest_ns,
            lost,
            shift_ns,
            cycle_ns,
        })
    }
}

/// How the frames of a window lie to SYNC0 of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Punctuality {
    /// The latest frame came so long before SYNC0.
    pub before_ns: i64,
    /// From the earliest to the latest.
    pub spread_ns: i64,
    /// Cycles without a time.
    pub lost: u32,
    shift_ns: i32,
    cycle_ns: u32,
}

impl Punctuality {
    /// Every frame came well before its own SYNC0, and well behind the one before.
    pub fn is_good(&self) -> bool {
        let margin_ns = i64::from(self.cycle_ns / MARGIN);
        let behind_ns = i64::from(self.cycle_ns) - self.before_ns - self.spread_ns;
        self.before_ns >= margin_ns && behind_ns >= margin_ns
    }

    /// The shift that has the frames in the middle between two pulses.
    pub fn better_shift_ns(&self) -> i64 {
        let middle_ns = i64::from(self.cycle_ns) / 2;
        // The middle of the frames lies at before + spread / 2.
        i64::from(self.shift_ns) + middle_ns - (self.before_ns + self.spread_ns / 2)
    }
}

impl core::fmt::Display for Punctuality {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let us = |ns: i64| ns / 1000;
        write!(
            f,
            "frames arrive {} us before SYNC0, spread {} us",
            us(self.before_ns),
            us(self.spread_ns)
        )?;
        if !self.is_good() {
            write!(f, ": set the shift to {} us", us(self.better_shift_ns()))?;
        }
        match self.lost {
            0 => Ok(()),
            lost => write!(f, "; {lost} of {CYCLES} were lost"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    fn window(late_ns: [i64; 2], lost: u32) -> Window {
        let mut window = Window::new();
        for cycle in 0..CYCLES {
            window.add((cycle >= lost).then_some(late_ns[(cycle % 2) as usize]));
        }
        window
    }

    #[test]
    fn frames_near_a_pulse_are_told_with_a_shift_that_helps() {
        let words = |late_ns, lost, shift_ns| {
            let punctuality = window(late_ns, lost)
                .punctuality(shift_ns, 1_000_000)
                .expect("a window");
            (punctuality.is_good(), punctuality.to_string())
        };
        assert_eq!(
            words([-2_000, 3_000], 0, 500_000),
            (true, "frames arrive 497 us before SYNC0, spread 5 us".to_string())
        );
        assert_eq!(
            words([-2_000, 3_000], 4, 20_000),
            (
                false,
                "frames arrive 17 us before SYNC0, spread 5 us: set the shift to 500 us; 4 of 1000 were lost"
                    .to_string()
            )
        );
        // Behind the pulse before.
        assert!(!words([0, 1_000], 0, 950_000).0);
        // Nobody could set this right by the shift: frames vary by more than the cycle bears.
        assert!(!words([-450_000, 450_000], 0, 500_000).0);
        assert_eq!(Window::new().punctuality(0, 1_000_000), None);
        assert_eq!(window([0, 0], CYCLES).punctuality(0, 1_000_000), None);
    }
}
