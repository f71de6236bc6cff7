//! The factor group of the drive: what its increments are in the units of the network.
//!
//! In:  608F (increments of the position encoder and turns of the motor), 6090 (the same of the velocity encoder), 6091 (turns of
//!      the motor and of the shaft), 6092 (position units and turns of the shaft), 6096 (velocity units, and position units/s).
//! Out: positions and speeds in either unit.
//!
//! Position units of an increment: 6092:1 / 6092:2 · 6091:2 / 6091:1 · 608F:2 / 608F:1. Speeds by their own encoder, times
//! 6096:1 / 6096:2; ramps are velocity units a second. As the drive comes out of the box, both units are increments.

use super::objects::Keys;
use obd::Dictionary;

/// Values of the objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Group {
    encoder: [u32; 2],
    velocity_encoder: [u32; 2],
    gear: [u32; 2],
    feed: [u32; 2],
    velocity: [u32; 2],
}

/// How increments and units become each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factors {
    group: Option<Group>,
    /// Position units, and the increments that they are; without a common factor, below 2^62.
    position: [i64; 2],
    /// increments/s of a velocity unit.
    velocity: f64,
    /// The group makes a ratio that can be computed with.
    pub(super) are_good: bool,
}

impl Default for Factors {
    fn default() -> Factors {
        Factors {
            group: None,
            position: [1, 1],
            velocity: 1.0,
            are_good: true,
        }
    }
}

impl Factors {
    /// Looks at the objects; `encoders`: velocity and position encoder as they were built.
    ///
    /// RT: bounded, some microseconds when a value has changed.
    pub(super) fn update<const E: usize, const B: usize>(
        &mut self,
        objects: &Dictionary<E, B>,
        keys: &Keys,
        encoders: [[u32; 2]; 2],
    ) {
        let group = Group {
            encoder: [keys.encoder_increments, keys.encoder_revolutions].map(|key| objects.get(key)),
            velocity_encoder: [keys.velocity_encoder_increments, keys.velocity_encoder_revolutions]
                .map(|key| objects.get(key)),
            gear: [keys.gear_motor, keys.gear_shaft].map(|key| objects.get(key)),
            feed: [keys.feed_units, keys.feed_shaft].map(|key| objects.get(key)),
            velocity: [keys.velocity_numerator, keys.velocity_divisor].map(|key| objects.get(key)),
        };
        if self.group == Some(group) {
            return;
        }
        let position = ratio(
            [group.feed[0], group.gear[1], group.encoder[1]],
            [group.feed[1], group.gear[0], group.encoder[0]],
        );
        *self = Factors {
            group: Some(group),
            position: position.unwrap_or([1, 1]),
            velocity: group.velocity_unit(encoders),
            are_good: position.is_some(),
        };
    }

    /// Position units of an amount of increments.
    pub(super) fn units(&self, increments: i64) -> i64 {
        let [units, per] = self.position;
        if units == per {
            return increments;
        }
        let product = i128::from(increments) * i128::from(units);
        let half = i128::from(per / 2) * product.signum();
        ((product + half) / i128::from(per)) as i64
    }

    /// Increments of an amount of position units.
    pub(super) fn increments(&self, units: i64) -> f64 {
        let [per, increments] = self.position;
        if per == increments {
            return units as f64;
        }
        // Whole turns first: a double has no digits for the product.
        let (whole, rest) = (units / per, units % per);
        whole as f64 * increments as f64 + rest as f64 * increments as f64 / per as f64
    }

    /// increments/s of velocity units, and increments/s² of ramps.
    pub(super) fn speed(&self, units: f64) -> f64 {
        units * self.velocity
    }

    /// Velocity units of increments/s.
    pub(super) fn velocity_units(&self, increments_s: f64) -> f64 {
        increments_s / self.velocity
    }
}

impl Group {
    /// increments/s of the position encoder for one velocity unit.
    fn velocity_unit(&self, encoders: [[u32; 2]; 2]) -> f64 {
        let quotient = |[above, below]: [u32; 2]| f64::from(above) / f64::from(below.max(1));
        // Without one of its own the speed comes from the position encoder.
        let turn = match self.velocity_encoder[0] {
            0 => quotient(self.encoder),
            _ => {
                let [velocity, position] = encoders.map(quotient);
                quotient(self.velocity_encoder) * position / velocity
            }
        };
        turn * quotient(self.gear) / quotient(self.feed) / quotient(self.velocity)
    }
}

/// A quotient of products in its lowest terms; `None`: 0, or not below 2^62.
fn ratio(above: [u32; 3], below: [u32; 3]) -> Option<[i64; 2]> {
    let [above, below] = [above, below].map(|factors| factors.into_iter().map(u128::from).product::<u128>());
    let (mut divisor, mut rest) = (above, below);
    while rest != 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    if above == 0 || below == 0 {
        return None;
    }
    let part = |product: u128| i64::try_from(product / divisor).ok().filter(|part| *part < 1 << 62);
    Some([part(above)?, part(below)?])
}

#[cfg(test)]
mod tests {
    use super::super::motion::round;
    use super::*;
    use proptest::prelude::*;

    fn factors(position: [i64; 2]) -> Factors {
        Factors {
            position,
            ..Factors::default()
        }
    }

    #[test]
    fn units_are_rounded_to_the_nearest_one_on_both_sides_of_0() {
        // 3 units are 2^20 increments.
        let factors = factors([3, 1 << 20]);
        assert_eq!(
            [0, 174_762, 174_763, -174_762, -174_763].map(|at| factors.units(at)),
            [0, 0, 1, 0, -1]
        );
        assert_eq!(factors.units(1 << 50), 3 << 30);
        assert_eq!(factors.increments(-6), -2_097_152.0);
    }

    #[test]
    fn a_ratio_is_in_its_lowest_terms_or_there_is_none() {
        assert_eq!(ratio([10_000, 1, 1], [1, 4, 131_072]), Some([625, 32_768]));
        let most = u32::MAX;
        assert_eq!(ratio([most, most, 1], [most, most, 1]), Some([1, 1]));
        assert_eq!(ratio([most, most, 1], [1, 1, 2]), None);
        assert_eq!(ratio([1, 1, 1], [0, 1, 1]), None);
    }

    proptest! {
        /// There and back is the same unit wherever an increment is no more than a unit, however far away.
        #[test]
        fn units_come_back(units in -(1_i64 << 40)..1 << 40, above in 1_i64..100_000, more in 0_i64..1_000_000) {
            let factors = factors([above, above + more]);
            prop_assert_eq!(factors.units(round(factors.increments(units))), units);
        }
    }
}
