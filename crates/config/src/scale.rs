//! What a drive counts for a mm, or a degree.
//!
//! In:  `counts_per_unit`, `turns_per_unit` and `velocity_ratio` of a `[[joint]]`, what is known of its drive.
//! Out: ratios that do not contradict each other.

use super::factor_group::{self, FactorGroup};
use super::section::Section;

/// `velocity_ratio`; the factor group of the drive, where it has one of speeds, must say the same.
pub(super) fn velocity_ratio(section: &mut Section<'_, '_>, group: Option<FactorGroup>) -> Option<[u32; 2]> {
    let what = "what 60FFh counts, and the increments/s that it makes";
    let Some(ratio) = section.ratio("velocity_ratio", what)? else {
        return group.map(|group| group.velocity_ratio());
    };
    if let Some([above, below]) = group.and_then(|group| group.velocity)
        && !factor_group::same(ratio, [above, below])
    {
        let rule = format!("must be the velocity of factor_group, [{above}, {below}], or be left out");
        return section.refused("velocity_ratio", rule);
    }
    Some(ratio)
}

/// `counts_per_unit`, or `turns_per_unit` of a motor of which it is known what its drive counts in a turn, `known_turn`; with both
/// they must be the same. `drive_is_known`: what is said of the drive has no errors of its own.
pub(super) fn counts_per_unit(
    section: &mut Section<'_, '_>,
    known_turn: Option<[u64; 2]>,
    drive_is_known: bool,
) -> Option<[u32; 2]> {
    let in_turns = section.optional("turns_per_unit").is_some();
    let counts = section.ratio("counts_per_unit", "increments and the mm (degrees) that they make")?;
    if !in_turns && counts.is_none() {
        section.required(
            "counts_per_unit",
            "increments of the drive, or steps, per mm (degree), like [10000, 1]",
        )?;
    }
    let what = "turns of the motor and the mm (degrees) that they make";
    let Some([turns, units]) = section.ratio("turns_per_unit", what)? else {
        return counts;
    };
    let Some([per_turn, of_turns]) = known_turn else {
        if drive_is_known {
            let rule = "needs a drive profile that has increments_per_turn, or a factor_group that has feed and gear; without one \
                        counts_per_unit is the scale";
            section.wrong("turns_per_unit", rule);
        }
        return None;
    };
    let products = per_turn
        .checked_mul(turns.into())
        .zip(of_turns.checked_mul(units.into()));
    let both = products.map(|(above, below)| factor_group::lowest([above, below]));
    let fits = both.and_then(|both| Some([u32::try_from(both[0]).ok()?, u32::try_from(both[1]).ok()?]));
    let Some(scale) = fits else {
        let turn = match of_turns {
            1 => format!("{per_turn} a turn"),
            _ => format!("{per_turn} in {of_turns} turns"),
        };
        let rule = format!("makes more increments than there are numbers, {turn}");
        return section.refused("turns_per_unit", rule);
    };
    if let Some(counts) = counts.filter(|counts| !factor_group::same(*counts, scale)) {
        let [[counted, of], [made, makes]] = [counts, scale];
        let rule = format!(
            "contradicts turns_per_unit, which makes [{made}, {makes}]: one of them is wrong, and one is enough; it is [{counted}, {of}]"
        );
        return section.refused("counts_per_unit", rule);
    }
    Some(scale)
}
