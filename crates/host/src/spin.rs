//! How long the cycle thread spins before a cycle: chosen at the start, watched while it runs, and made longer where wake-ups
//! come later than it covers.
//!
//! In:  how late each wake-up was. Out: the spin from now on.
//!
//! Half a second of measuring at the start does not know what the PC will be busy with later. A spin that is too short makes
//! every SoC as uneven as the wake-ups are; one that is too long costs nothing but idle time of the core. So it is never made
//! shorter. Wake-ups that are later than any spin may be (the PC stood still) change nothing.
//!
//! RT: constant memory and time.

/// Spins are whole multiples of this, ns.
const STEP_NS: u64 = 5_000;
/// Wake-ups that are judged together.
const WINDOW: u32 = 1000;
/// So many of them are later than the spin covers before it is made longer: fewer are chance.
const LATE: u32 = 3;

/// The spin of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spin {
    spin_ns: u64,
    most_ns: u64,
    raised: bool,
    wake_ups: u32,
    late: u32,
    latest_ns: u64,
}

impl Spin {
    /// Begins with `spin_us` and never exceeds `most_us`; the same for both: it stays as it is.
    pub fn new(spin_us: u32, most_us: u32) -> Spin {
        Spin {
            spin_ns: u64::from(spin_us) * 1000,
            most_ns: u64::from(most_us) * 1000,
            raised: false,
            wake_ups: 0,
            late: 0,
            latest_ns: 0,
        }
    }

    /// RT: the spin now, ns.
    pub fn ns(&self) -> u64 {
        self.spin_ns
    }

    /// The spin to which it was raised while running, µs.
    pub fn raised_us(&self) -> Option<u32> {
        self.raised.then_some((self.spin_ns / 1000) as u32)
    }

    /// RT: a wake-up came so much later than it was asked for.
    pub fn add_wakeup(&mut self, late_ns: u64) {
        self.wake_ups += 1;
        let wanted_ns = covering_ns(late_ns);
        if late_ns > self.spin_ns && wanted_ns <= self.most_ns {
            self.late += 1;
            self.latest_ns = self.latest_ns.max(wanted_ns);
            if self.late == LATE {
                self.spin_ns = self.latest_ns;
                self.raised = true;
                self.wake_ups = WINDOW;
            }
        }
        if self.wake_ups >= WINDOW {
            (self.wake_ups, self.late, self.latest_ns) = (0, 0, 0);
        }
    }
}

/// The shortest spin with which a wake-up that is so late is in time, ns.
pub fn covering_ns(late_ns: u64) -> u64 {
    late_ns.div_ceil(STEP_NS).saturating_mul(STEP_NS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(spin: Spin, late_us: impl IntoIterator<Item = u64>) -> Spin {
        late_us.into_iter().fold(spin, |mut spin, late_us| {
            spin.add_wakeup(late_us * 1000);
            spin
        })
    }

    #[test]
    fn three_late_wake_ups_of_a_thousand_make_it_as_long_as_the_latest_of_them_wants() {
        let spin = Spin::new(50, 200);
        let two = after(spin, [3, 70, 50, 161]);
        assert_eq!((two.ns(), two.raised_us()), (50_000, None));
        assert_eq!(after(two, [10, 51]).raised_us(), Some(165));
        // What a window has seen is nothing to the next one.
        let quiet = after(two, std::iter::repeat_n(4, 996));
        assert_eq!(after(quiet, [90, 90]).raised_us(), None);
        assert_eq!(after(quiet, [90, 90, 60]).raised_us(), Some(90));
    }

    #[test]
    fn it_goes_on_as_long_as_wake_ups_are_later_and_never_back() {
        // Latenesses under load: most of them beyond the spin of the start.
        let spin = after(Spin::new(50, 200), (0..30).map(|k| 60 + (5 * k) % 120));
        assert_eq!(spin.raised_us(), Some(175));
        assert_eq!(after(spin, std::iter::repeat_n(3, 5000)).ns(), 175_000);
    }

    #[test]
    fn a_pc_that_stood_still_and_a_spin_that_was_given_change_nothing() {
        let stalls = std::iter::repeat_n(3_000, 5000).chain(std::iter::repeat_n(201, 5000));
        assert_eq!(after(Spin::new(50, 200), stalls).raised_us(), None);
        assert_eq!(
            after(Spin::new(50, 50), std::iter::repeat_n(60, 5000)).raised_us(),
            None
        );
        let mut spin = Spin::new(0, 0);
        spin.add_wakeup(u64::MAX);
        assert_eq!(spin.ns(), 0);
    }
}
