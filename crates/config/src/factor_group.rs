//! `factor_group`: in which units a drive counts (608F, 6090, 6091, 6092, 6096).
//!
//! In:  the table of a joint, of the drive of the spindle, or of a drive profile; the node with its device file and its `sdo`.
//! Out: values that are written while the drive boots, or only compared, and the scale that they make.
//!
//! The scale of the control is `counts_per_unit`, whatever the drive makes of increments: units of 6064 per mm. What the group says
//! of it, and of the speeds, must be the same.

use super::document::Section;
use super::joints::ratio_of_integers;
use super::types::{DriveProfile, Node};
use cia402::profile::object_of;

/// Keys and objects, the increments first.
const OBJECTS: [(&str, u16); 5] = [
    ("encoder", 0x608F),
    ("velocity_encoder", 0x6090),
    ("gear", 0x6091),
    ("feed", 0x6092),
    ("velocity", 0x6096),
];

/// What is known of the factor group of a drive; what is `None` stays as the drive has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FactorGroup {
    /// 608F: increments of the position encoder, and turns of the motor.
    pub encoder: Option<[u32; 2]>,
    /// 6090: increments/s of the velocity encoder, and turns/s of the motor.
    pub velocity_encoder: Option<[u32; 2]>,
    /// 6091: turns of the motor, and of the shaft behind its gear.
    pub gear: Option<[u32; 2]>,
    /// 6092: position units, and turns of the shaft.
    pub feed: Option<[u32; 2]>,
    /// 6096: velocity units (606C, 60FF, 6099), and the position units/s that they are.
    pub velocity: Option<[u32; 2]>,
    /// The drive keeps it by itself: it is compared, and not written.
    pub compare_only: bool,
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

    /// The values of this one, and of `usual` what it leaves open.
    fn over(self, usual: &FactorGroup) -> FactorGroup {
        FactorGroup {
            encoder: self.encoder.or(usual.encoder),
            velocity_encoder: self.velocity_encoder.or(usual.velocity_encoder),
            gear: self.gear.or(usual.gear),
            feed: self.feed.or(usual.feed),
            velocity: self.velocity.or(usual.velocity),
            compare_only: self.compare_only,
        }
    }
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

/// Position units of a turn of the motor: of the group, else of the profile.
pub(super) fn units_per_turn(group: &FactorGroup, known: Option<&DriveProfile>) -> Option<[u64; 2]> {
    let of_profile = || known?.increments_per_turn.map(|increments| [increments.into(), 1]);
    group.units_per_turn().or_else(of_profile)
}

/// `factor_group` of a joint or of the drive of the spindle; what is left out is as the profile of the drive has it.
pub(super) fn factor_group(section: &mut Section<'_, '_>, axis: u8, node: Option<&Node>) -> Option<FactorGroup> {
    let usual = node.and_then(|node| node.drive.as_ref());
    let usual = usual.map_or(FactorGroup::default(), |known| known.factor_group);
    let group = match section.optional_section("factor_group") {
        None if section.has("factor_group") => return None,
        None => usual,
        Some(mut table) => {
            let group = values(&mut table, &usual)?.over(&usual);
            if let Some(node) = node {
                judge(&mut table, &group, axis, node);
            }
            table.done();
            group
        }
    };
    Some(group)
}

/// The table as it stands there; without `write` it is written or not as `usual`.
pub(super) fn values(table: &mut Section<'_, '_>, usual: &FactorGroup) -> Option<FactorGroup> {
    let rules = [
        "must be two integers: increments of the position encoder, and turns of the motor",
        "must be two integers: increments/s of the velocity encoder, and turns/s of the motor",
        "must be two integers: turns of the motor, and of the shaft behind its gear",
        "must be two integers: position units of the drive, and turns of the shaft",
        "must be two integers: velocity units of the drive, and the position units/s that they are",
    ];
    let read = OBJECTS
        .iter()
        .zip(rules)
        .map(|((key, _), rule)| match table.optional(key) {
            None => Some(None),
            Some(item) => ratio_of_integers(table, key, item, rule).map(Some),
        });
    let read: Vec<_> = read.collect();
    let written = table.flag("write", !usual.compare_only);
    Some(FactorGroup {
        encoder: read[0]?,
        velocity_encoder: read[1]?,
        gear: read[2]?,
        feed: read[3]?,
        velocity: read[4]?,
        compare_only: !written?,
    })
}

/// Whether the drive has the objects, and whether its `sdo` says the same of them.
fn judge(table: &mut Section<'_, '_>, group: &FactorGroup, axis: u8, node: &Node) {
    for (of_first, sub, value) in group.objects() {
        let index = object_of(axis, of_first);
        let key = OBJECTS
            .iter()
            .find(|(_, object)| *object == of_first)
            .map(|(key, _)| *key);
        let Some(key) = key.filter(|key| table.has(key)) else {
            continue;
        };
        let without = node
            .drive
            .as_ref()
            .filter(|drive| drive.without.contains(&(of_first, sub)));
        let file = node
            .device
            .as_ref()
            .filter(|device| device.object(index, sub).is_none());
        let lacks = without.map(|drive| &drive.name).or(file.map(|device| &device.file));
        if let Some(name) = lacks {
            table.wrong(key, format!("the drive has no 0x{index:04X}:{sub}, as {name} says"));
            continue;
        }
        let other = node
            .writes
            .iter()
            .find(|write| (write.index, write.sub) == (index, sub));
        if other.is_some_and(|write| write.value != value.to_le_bytes()) {
            table.wrong(
                key,
                format!("must be what `sdo` of the node writes into 0x{index:04X}:{sub}, or stand there no more"),
            );
        }
    }
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
