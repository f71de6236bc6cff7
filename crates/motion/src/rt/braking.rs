//! Braking to rest at a given place of the plan.
//!
//! In:  the share r of the planned speed and its rate r., the plan time that may still pass, a bound of |r..|.
//! Out: r as a chain of phases of constant r.., cycle by cycle, until r = r. = 0.
//!
//! All of it is the motion of a mass along a line, with plan time as place, r as speed and r. as acceleration: with phases of
//! constant r.., plan time is a cubic of real time in each of them, so that every length here is a closed form. RT.

/// Two lengths of plan time that differ by less are one, s: sums of the same durations in another order.
pub(super) const SAME_S: f64 = 1e-10;

/// The share and its rate, 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pace {
    pub(super) share: f64,
    pub(super) rate: f64,
}

impl Pace {
    /// Plan time that passes while r.. is `curvature` for `time_s`, s.
    fn run(&mut self, curvature: f64, time_s: f64) -> f64 {
        let passed = time_s * (self.share + time_s * (self.rate / 2.0 + time_s * curvature / 6.0));
        self.share += time_s * (self.rate + time_s * curvature / 2.0);
        self.rate += time_s * curvature;
        passed
    }
}

/// r.. for a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Phase {
    time_s: f64,
    curvature: f64,
}

/// A way to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Braking {
    phases: [Phase; 4],
    /// Plan time until rest, s.
    left_s: f64,
    /// Plan time that could still pass behind it, s.
    beyond_s: f64,
}

impl Braking {
    fn new(pace: Pace, phases: [Phase; 4], way_s: f64) -> Braking {
        let mut pace = pace;
        let left_s: f64 = phases.iter().map(|phase| pace.run(phase.curvature, phase.time_s)).sum();
        Braking {
            phases,
            left_s,
            beyond_s: way_s - left_s,
        }
    }

    /// The shortest way: as quickly down as r.. allows.
    pub(super) fn shortest(pace: Pace, bound: f64, way_s: f64) -> Braking {
        let Pace { share, rate } = pace;
        // Down with -bound until +bound brings share and rate to 0 together. What rounding makes negative is none.
        let speeding = (((rate * rate / 2.0 + bound * share).max(0.0)).sqrt() + rate).max(0.0) / bound;
        let slowing = (speeding - rate / bound).max(0.0);
        Braking::new(
            pace,
            [phase(speeding, -bound), phase(slowing, bound), NONE, NONE],
            way_s,
        )
    }

    /// A way over just `way_s`: no |r..| on it is above `bound`, and the share never above what it would come to anyway.
    /// `None`: that is less than [`Braking::needed_s`], or the share is so low that it would take for ever.
    pub(super) fn over(pace: Pace, bound: f64, cycle_s: f64, way_s: f64) -> Option<Braking> {
        let (level, first_s, top) = levelled(pace, bound);
        if top < bound * cycle_s * cycle_s / 2.0 || way_s < Braking::needed_s(pace, bound) {
            return None;
        }
        // From a steady share down over the rest, half of the time each with -k and +k: at half the share on average.
        let half_s = (way_s - first_s) / top;
        let k = top / (half_s * half_s);
        let mut braking = Braking::new(pace, [level, phase(half_s, -k), phase(half_s, k), NONE], way_s);
        // It is just this long, whatever rounding says.
        (braking.left_s, braking.beyond_s) = (way_s, 0.0);
        Some(braking)
    }

    /// From rest to rest over a length so short that no more than a cycle each is there to speed up and slow down.
    pub(super) fn little(cycle_s: f64, way_s: f64) -> Braking {
        let k = way_s / (2.0 * cycle_s.powi(3));
        let phases = [k, -k, -k, k].map(|curvature| phase(cycle_s, curvature));
        Braking {
            phases,
            left_s: way_s,
            beyond_s: 0.0,
        }
    }

    /// Plan time that [`Braking::over`] takes at the least, s.
    pub(super) fn needed_s(pace: Pace, bound: f64) -> f64 {
        let (_, first_s, top) = levelled(pace, bound);
        first_s + top * (top / bound).sqrt()
    }

    /// Plan time until rest, s.
    pub(super) fn left_s(&self) -> f64 {
        self.left_s
    }

    /// Whether it still is the way for somebody who may go this far.
    pub(super) fn fits(&self, way_s: f64) -> bool {
        (self.left_s + self.beyond_s - way_s).abs() <= SAME_S
    }

    /// One cycle further; plan time that passes in it, s. `None` for the pace: rest is reached.
    pub(super) fn step(&mut self, pace: Pace, cycle_s: f64) -> (Option<Pace>, f64) {
        let (mut pace, mut time_s, mut passed_s) = (pace, cycle_s, 0.0);
        for phase in &mut self.phases {
            let part_s = time_s.min(phase.time_s);
            passed_s += pace.run(phase.curvature, part_s);
            phase.time_s -= part_s;
            time_s -= part_s;
        }
        // Less than rounding of a cycle left is nothing.
        let over = self.phases.iter().all(|phase| phase.time_s <= cycle_s * 1e-9);
        if over {
            passed_s = self.left_s;
        }
        let passed_s = passed_s.clamp(0.0, self.left_s.max(0.0));
        self.left_s -= passed_s;
        pace.share = pace.share.clamp(0.0, 1.0);
        ((!over).then_some(pace), passed_s)
    }
}

const NONE: Phase = phase(0.0, 0.0);

const fn phase(time_s: f64, curvature: f64) -> Phase {
    Phase { time_s, curvature }
}

/// The phase that brings the rate to 0, the plan time that passes in it, and the share behind it.
fn levelled(pace: Pace, bound: f64) -> (Phase, f64, f64) {
    let level = phase(pace.rate.abs() / bound, -bound * pace.rate.signum());
    let mut end = pace;
    let passed_s = end.run(level.curvature, level.time_s);
    (level, passed_s, end.share.max(0.0))
}
