//! Where each axis is, in the work and in the machine: for `status` and `top`.

use protocol::Status;
use protocol::limits::LETTERS;

/// Where an axis is.
pub(super) struct Place<'a> {
    pub(super) letter: &'a str,
    /// In the work system in force, mm or degrees.
    pub(super) work: f64,
    /// In machine coordinates, mm or degrees.
    pub(super) machine: f64,
    /// From here to where the program is held, if a hand has moved the machine away, mm or degrees.
    pub(super) to_go: Option<f64>,
    /// All its joints know where they are.
    pub(super) is_homed: bool,
    /// Which of its limit switches are closed: the lower, the upper.
    pub(super) limits: (bool, bool),
}

/// Where all axes are, in the order of the machine.
pub(super) fn places(status: &Status) -> impl Iterator<Item = Place<'_>> {
    status.axes.iter().map(|axis| {
        let number = LETTERS.iter().position(|known| known == &axis.axis).unwrap_or(0);
        let machine = at(&status.position_mm, number);
        let is_one_of = |joints: &[usize]| axis.joints.iter().any(|joint| joints.contains(joint));
        let switches = &status.limit_switches;
        Place {
            letter: &axis.axis,
            work: work(status, number),
            machine,
            to_go: (status.held_at_mm.as_deref())
                .and_then(|held| held.get(number))
                .map(|held| held - machine),
            is_homed: !axis.joints.is_empty() && axis.joints.iter().all(|joint| status.homed.contains(joint)),
            limits: (is_one_of(&switches.lower), is_one_of(&switches.upper)),
        }
    })
}

fn at(list: &[f64], axis: usize) -> f64 {
    list.get(axis).copied().unwrap_or(0.0)
}

fn work(status: &Status, axis: usize) -> f64 {
    let shifted = |axis: usize| at(&status.position_mm, axis) - at(&status.work_offset_mm, axis);
    let (sin, cos) = status.work_rotation_degrees.to_radians().sin_cos();
    match axis {
        0 => shifted(0) * cos + shifted(1) * sin,
        1 => shifted(1) * cos - shifted(0) * sin,
        _ => shifted(axis),
    }
}
