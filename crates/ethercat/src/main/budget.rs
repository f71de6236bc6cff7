//! What a cycle costs before the first one runs: frames on the wire, the way through the devices, the PC.
//!
//! In:  lengths of the frames, how many devices. Out: the sum, or that it does not fit, with the sum that shows why.

/// An octet at 100 Mbit/s.
const OCTET_NS: u64 = 80;
/// Preamble and check sequence of a frame.
const FRAME_EXTRA: u64 = 12;
/// Gap between two frames.
const GAP_NS: u64 = 960;
/// A device passes a frame on and back.
const DEVICE_NS: u64 = 1_500;
/// What the PC adds to the way there and back, at its best.
const PC_NS: u64 = 20_000;

/// What a cycle costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Frames of a cycle.
    pub frames: u32,
    /// Their octets.
    pub octets: u32,
    /// On the wire.
    pub wire_ns: u64,
    /// Through the devices, there and back.
    pub devices_ns: u64,
    /// The PC.
    pub pc_ns: u64,
    /// Length of the cycle.
    pub cycle_ns: u32,
}

impl Budget {
    /// Of frames of these lengths, without FCS, through so many devices.
    pub fn of(lengths: impl IntoIterator<Item = usize>, devices: usize, cycle_ns: u32) -> Budget {
        let mut budget = Budget {
            frames: 0,
            octets: 0,
            wire_ns: 0,
            devices_ns: devices as u64 * DEVICE_NS,
            pc_ns: PC_NS,
            cycle_ns,
        };
        for length in lengths {
            budget.wire_ns += (length as u64 + FRAME_EXTRA) * OCTET_NS + if budget.frames > 0 { GAP_NS } else { 0 };
            budget.frames += 1;
            budget.octets += length as u32;
        }
        budget
    }

    /// Until the last frame is back.
    pub const fn total_ns(&self) -> u64 {
        self.wire_ns + self.devices_ns + self.pc_ns
    }

    /// Half of the cycle is left for what does not come by the cycle, and for the jitter of the PC.
    pub const fn fits(&self) -> bool {
        self.total_ns() <= self.cycle_ns as u64 / 2
    }
}

impl core::fmt::Display for Budget {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let us = |ns: u64| ns.div_ceil(1000);
        write!(
            f,
            "{} frames of {} octets: {} us on the wire + {} us through the devices + {} us in the PC = {} us",
            self.frames,
            self.octets,
            us(self.wire_ns),
            us(self.devices_ns),
            us(self.pc_ns),
            us(self.total_ns())
        )?;
        if self.fits() {
            return Ok(());
        }
        let half_ns = u64::from(self.cycle_ns) / 2;
        let least_us = us(2 * self.total_ns());
        write!(
            f,
            ", half of the cycle is {} us: a cycle of {least_us} us at least, or fewer octets",
            us(half_ns)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::main::{CyclicFrames, Member};
    use std::string::ToString;

    fn budget(axes: u32, cycle_us: u32) -> Budget {
        let members = (0..axes).map(|axis| Member::one(28 * axis, 28, 28));
        let frames = CyclicFrames::<100, 4>::new([0x10; 6], members).expect("it fits");
        let lengths = (0..frames.len()).map(|number| frames.frame(number).len());
        Budget::of(lengths, axes as usize, cycle_us * 1000)
    }

    /// By the table of the fact sheet, line by line: axes, us, frames.
    #[test]
    fn the_sum_is_that_of_the_table() {
        for (axes, us, frames) in [(2, 14, 1), (8, 43, 1), (32, 155, 1), (100, 481, 3)] {
            let budget = budget(axes, 1000);
            let sum_ns = budget.wire_ns + budget.devices_ns;
            assert_eq!((sum_ns + 500) / 1000, us, "{axes} axes: {budget}");
            assert_eq!(budget.frames, frames, "{axes} axes");
        }
    }

    #[test]
    fn what_does_not_fit_shows_its_sum() {
        assert!(budget(8, 250).fits() && budget(32, 500).fits() && budget(100, 2000).fits());
        let refused = budget(100, 500);
        assert!(!refused.fits());
        assert_eq!(
            refused.to_string(),
            "3 frames of 4082 octets: 332 us on the wire + 150 us through the devices + 20 us in the PC = 502 us, half of the \
             cycle is 250 us: a cycle of 1003 us at least, or fewer octets"
        );
    }
}
