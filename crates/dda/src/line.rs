//! Straight lines, exact.
//!
//! In:  the way of each axis in steps.
//! Out: one pulse pattern for each step of the axis with the longest way.
//!
//! Bresenham's accumulator for any number of axes: after k of n patterns an axis whose way is d stands at k·d/n, rounded.
//! So no axis is ever more than half a step beside the line, and all of them end at the end point.

/// A straight line under way. RT.
#[derive(Clone, Debug)]
pub struct LineDda<const AXES: usize> {
    /// Steps of each axis.
    ways: [u32; AXES],
    directions: [i8; AXES],
    /// Half full at the beginning: that is what rounds.
    accumulators: [u64; AXES],
    /// Steps of the axis that goes furthest.
    longest: u32,
    left: u32,
}

impl<const AXES: usize> LineDda<AXES> {
    /// A line over `ways` steps of each axis.
    pub fn new(ways: [i32; AXES]) -> LineDda<AXES> {
        let directions = ways.map(|way| way.signum() as i8);
        let ways = ways.map(i32::unsigned_abs);
        let longest = ways.into_iter().max().unwrap_or(0);
        LineDda {
            ways,
            directions,
            // In half steps, so that the half of an odd number is exact.
            accumulators: [u64::from(longest); AXES],
            longest,
            left: longest,
        }
    }

    /// Patterns still to come.
    pub fn left(&self) -> u32 {
        self.left
    }
}

impl<const AXES: usize> Iterator for LineDda<AXES> {
    type Item = [i8; AXES];

    /// -1, 0 or 1 for each axis; the longest axis steps in every pattern. RT.
    fn next(&mut self) -> Option<[i8; AXES]> {
        self.left = self.left.checked_sub(1)?;
        let full = 2 * u64::from(self.longest);
        let mut pulses = [0; AXES];
        for (axis, pulse) in pulses.iter_mut().enumerate() {
            self.accumulators[axis] += 2 * u64::from(self.ways[axis]);
            if self.accumulators[axis] >= full {
                self.accumulators[axis] -= full;
                *pulse = self.directions[axis];
            }
        }
        Some(pulses)
    }
}
