//! `[[axis]]` and `[offsets]`: the axes of the program, which joints they move, and where their zeros are.

use super::question::Bound;
use super::section::Section;
use super::values::LENGTH_MAX;
use motion::canon::{Axis, Position};

/// What `travel_mm` is.
pub(super) const SOFT_LIMITS: &str = "soft limits, like [-5.0, 305.0]";

/// `[[axis]]`
#[derive(Clone, Debug, PartialEq)]
pub struct AxisMap {
    pub axis: Axis,
    /// Joints that it moves (more than one: gantry).
    pub joints: Vec<usize>,
    /// A rotary axis without ends: programs name angles of one turn; default false.
    pub wrapped: bool,
    /// Soft limits of the axis itself where its joints are not the axis; `None`: only those of the joints.
    pub travel_mm: Option<[f64; 2]>,
}

/// Reads all `[[axis]]`; every one of `joints` joints must belong to one axis. `follows`: each joint follows its axis.
pub(super) fn axes(root: &mut Section<'_, '_>, joints: usize, follows: bool) -> Option<Vec<AxisMap>> {
    let mut axes: Vec<AxisMap> = Vec::new();
    let mut taken = vec![false; joints];
    let mut complete = true;
    let tables = root.some_sections("axis");
    if tables.is_empty() {
        return None;
    }
    for mut section in tables {
        let axis = section.axis("letter");
        if let Some(axis) = axis
            && axes.iter().any(|other| other.axis == axis)
        {
            section.wrong("letter", "is taken by an axis above");
            complete = false;
        }
        let joints = joints_of_axis(&mut section, &mut taken);
        let wrapped = section.flag("wrapped", false);
        if wrapped == Some(true) && axis.is_some_and(|axis| !axis.is_rotary()) {
            section.wrong("wrapped", "only A, B and C turn without end");
            complete = false;
        }
        let travel_mm = section
            .has("travel_mm")
            .then(|| section.range("travel_mm", SOFT_LIMITS));
        if travel_mm.is_some() && follows {
            section.wrong("travel_mm", "the joints' own travel_mm is that of the axis");
            complete = false;
        }
        section.done();
        match (axis, joints, wrapped, travel_mm) {
            (Some(axis), Some(joints), Some(wrapped), None | Some(Some(_))) => axes.push(AxisMap {
                axis,
                joints,
                wrapped,
                travel_mm: travel_mm.flatten(),
            }),
            _ => complete = false,
        }
    }
    if complete && let Some(left_out) = taken.iter().position(|taken| !taken) {
        return root.refused("axis", format!("joint {left_out} belongs to no axis"));
    }
    complete.then_some(axes)
}

fn joints_of_axis(section: &mut Section<'_, '_>, taken: &mut [bool]) -> Option<Vec<usize>> {
    let path = section.key("joints");
    let item = section.required("joints", "the joints that the axis moves, counted from 0")?;
    if item.items(&path)?.is_empty() {
        return section.refused("joints", "must name at least one joint");
    }
    item.list(&path, |item, path| {
        let joint = item.integer(path, 0..=usize::from(u16::MAX))?;
        let rule = match taken.get(joint) {
            None => format!("there is no such joint; joints: {}, counted from 0", taken.len()),
            Some(true) => "belongs to an axis already".to_owned(),
            Some(false) => {
                taken[joint] = true;
                return Some(joint);
            }
        };
        item.refused(path, rule)
    })
}

/// Work offset systems in the order of G54 to G59.3.
const SYSTEMS: [&str; 9] = ["g54", "g55", "g56", "g57", "g58", "g59", "g59_1", "g59_2", "g59_3"];

/// Reads `[offsets]`; only axes of the machine may be shifted.
pub(super) fn offsets(root: &mut Section<'_, '_>, axes: Option<&[AxisMap]>) -> Option<[Position; 9]> {
    const LETTERS: [&str; 9] = ["x", "y", "z", "a", "b", "c", "u", "v", "w"];
    let mut offsets = [Position::ZERO; 9];
    let mut complete = true;
    let mut section = root.section("offsets")?;
    for (name, origin) in SYSTEMS.into_iter().zip(&mut offsets) {
        let Some(mut system) = section.optional_section(name) else {
            continue;
        };
        for (letter, axis) in LETTERS.into_iter().zip(Axis::ALL) {
            let Some(item) = system.optional(letter) else { continue };
            match item.number(&system.key(letter), Bound::Size(LENGTH_MAX)) {
                Some(value) => origin[axis] = value,
                None => complete = false,
            }
            if axes.is_some_and(|axes| axes.iter().all(|map| map.axis != axis)) {
                system.wrong(letter, "the machine has no such axis");
                complete = false;
            }
        }
        system.done();
    }
    section.done();
    complete.then_some(offsets)
}
