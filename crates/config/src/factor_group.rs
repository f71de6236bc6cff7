//! `factor_group`: in which units a drive counts (608F, 6090, 6091, 6092, 6096).
//!
//! In:  the table of a joint, of the drive of the spindle, or of a drive profile; the node with its device file and its `sdo`.
//! Out: values that are written while the drive boots, or only compared, and the scale that they make.
//!
//! The scale of the control is `counts_per_unit`, whatever the drive makes of increments: units of 6064 per mm. What the group says
//! of it, and of the speeds, must be the same.

use super::section::{Section, keys};

/// Keys and objects, the increments first.
pub(super) const OBJECTS: [(&str, u16); 5] = [
    ("encoder", 0x608F),
    ("velocity_encoder", 0x6090),
    ("gear", 0x6091),
    ("feed", 0x6092),
    ("velocity", 0x6096),
];

keys! {
    /// What is known of the factor group of a drive; what is `None` stays as the drive has it. What is left out is as `usual`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct FactorGroup(table, usual: &FactorGroup) {
        /// 608F: increments of the position encoder, and turns of the motor.
        pub encoder: Option<[u32; 2]> =
            ratio(table, "encoder", "increments of the position encoder, and turns of the motor", usual.encoder),
        /// 6090: increments/s of the velocity encoder, and turns/s of the motor.
        pub velocity_encoder: Option<[u32; 2]> =
            ratio(table, "velocity_encoder", "increments/s of the velocity encoder, and turns/s of the motor", usual.velocity_encoder),
        /// 6091: turns of the motor, and of the shaft behind its gear.
        pub gear: Option<[u32; 2]> =
            ratio(table, "gear", "turns of the motor, and of the shaft behind its gear", usual.gear),
        /// 6092: position units, and turns of the shaft.
        pub feed: Option<[u32; 2]> =
            ratio(table, "feed", "position units of the drive, and turns of the shaft", usual.feed),
        /// 6096: velocity units (606C, 60FF, 6099), and the position units/s that they are.
        pub velocity: Option<[u32; 2]> =
            ratio(table, "velocity", "velocity units of the drive, and the position units/s that they are", usual.velocity),
        /// The drive keeps it by itself: it is compared, and not written.
        pub compare_only: bool = table.flag("write", !usual.compare_only).map(|written| !written),
    }
}

impl FactorGroup {
    fn values(&self) -> [Option<[u32; 2]>; 5] {
        [self.encoder, self.velocity_encoder, self.gear, self.feed, self.velocity]
    }

    /// Objects of the first axis with the values that they must have.
    pub fn objects(&self) -> impl Iterator<Item = (u16, u8, u32)> {
        let pairs = OBJECTS.into_iter().zip(self.values());
        let halves = pairs.filter_map(|((_, index), value)| Some((index, value?)));
        halves.flat_map(|(index, [above, below])| [(index, 1, above), (index, 2, below)])
    }

    /// Position units of a turn of the motor in the lowest terms: 6092 by 6091; `None`: not known.
    pub fn units_per_turn(&self) -> Option<[u64; 2]> {
        let ([units, shaft], [motor, of_shaft]) = (self.feed?, self.gear?);
        let product = |a: u32, b: u32| u64::from(a) * u64::from(b);
        Some(lowest([product(units, of_shaft), product(shaft, motor)]))
    }

    /// Velocity units, and the position units/s that they are.
    pub fn velocity_ratio(&self) -> [u32; 2] {
        self.velocity.unwrap_or([1, 1])
    }
}

/// One of its ratios, of which `what` says what it is of.
fn ratio(
    table: &mut Section<'_, '_>,
    key: &'static str,
    what: &str,
    usual: Option<[u32; 2]>,
) -> Option<Option<[u32; 2]>> {
    Some(table.ratio(key, what)?.or(usual))
}

/// A ratio in its lowest terms.
pub(super) fn lowest([above, below]: [u64; 2]) -> [u64; 2] {
    let (mut divisor, mut rest) = (above, below);
    while rest != 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    [above / divisor.max(1), below / divisor.max(1)]
}

/// Whether two ratios are the same.
pub(super) fn same(one: [u32; 2], other: [u32; 2]) -> bool {
    u64::from(one[0]) * u64::from(other[1]) == u64::from(other[0]) * u64::from(one[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_of_the_motor_is_the_feed_behind_the_gear() {
        let group = FactorGroup {
            feed: Some([10_000, 1]),
            gear: Some([5, 2]),
            ..FactorGroup::default()
        };
        assert_eq!(group.units_per_turn(), Some([4000, 1]));
        let without = FactorGroup { gear: None, ..group };
        assert_eq!(without.units_per_turn(), None, "a gear that nobody knows");
        let most = [u32::MAX, 1];
        let large = FactorGroup {
            feed: Some(most),
            gear: Some([1, u32::MAX]),
            ..group
        };
        assert_eq!(large.units_per_turn(), Some([u64::from(u32::MAX).pow(2), 1]));
        assert!(same([2, 6], [1, 3]) && !same([2, 6], [1, 4]) && same(most, most));
    }
}
