//! `[kinematics]`: the parameters of a machine whose joints are not its axes. What they mean stands in `motion::kinematics`.
//!
//! | `machine.kinematics` | keys |
//! |---|---|
//! | `"trivial"`, `"corexy"` | none |
//! | `"none"`: a machine of inputs and outputs, without joints and axes | none |
//! | `"table-table"` | `primary`, `primary_centre_mm`, `primary_turns`; `secondary`, `secondary_centre_mm`, `secondary_turns` |
//! | `"head-table"` | `head`, `head_turns`, `pivot_length_mm`, `pivot_offset_mm`; `table`, `table_centre_mm`, `table_turns` |
//! | `"scara"` | `inner_arm_mm`, `outer_arm_mm`, `tool_offset_mm` |
//! | `"linear-delta"` | `rod_mm`, `radius_mm`, `tower_angles_degrees` |

use super::axes::AxisMap;
use super::joints::Joint;
use super::question::Bound;
use super::section::Section;
use super::values::LENGTH_MAX;
use motion::canon::Axis;
use motion::kinematics::{Elbow, Hand, HeadTable, LinearDelta, Rotary, RotaryAxis, Scara, TableTable, Transform};

/// The words of `machine.kinematics`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    Trivial,
    CoreXy,
    TableTable,
    HeadTable,
    Scara,
    LinearDelta,
    /// Nothing moves.
    None,
}

impl Family {
    pub(super) const WORDS: [(&'static str, Family); 7] = [
        ("trivial", Family::Trivial),
        ("corexy", Family::CoreXy),
        ("table-table", Family::TableTable),
        ("head-table", Family::HeadTable),
        ("scara", Family::Scara),
        ("linear-delta", Family::LinearDelta),
        ("none", Family::None),
    ];

    /// Whether each joint follows its axis, but for tool-centre-point control.
    pub(super) fn follows(self) -> bool {
        match self {
            Family::Trivial | Family::TableTable | Family::HeadTable | Family::None => true,
            Family::CoreXy | Family::Scara | Family::LinearDelta => false,
        }
    }

    /// Whether joints are always a linear function of the axes.
    pub(super) fn is_linear(self) -> bool {
        match self {
            Family::Trivial | Family::CoreXy | Family::None => true,
            Family::TableTable | Family::HeadTable | Family::Scara | Family::LinearDelta => false,
        }
    }
}

const ROTARY: [(&str, RotaryAxis); 3] = [("A", RotaryAxis::A), ("B", RotaryAxis::B), ("C", RotaryAxis::C)];
const HANDS: [(&str, Hand); 2] = [("right-handed", Hand::Right), ("left-handed", Hand::Left)];

/// Reads `[kinematics]`.
pub(super) fn transform(section: &mut Section<'_, '_>, family: Family) -> Option<Transform> {
    match family {
        Family::Trivial | Family::None => Some(Transform::Trivial),
        Family::CoreXy => Some(Transform::CoreXy),
        Family::TableTable => table_table(section).map(Transform::TableTable),
        Family::HeadTable => head_table(section).map(Transform::HeadTable),
        Family::Scara => scara(section).map(Transform::Scara),
        Family::LinearDelta => linear_delta(section).map(Transform::LinearDelta),
    }
}

fn table_table(section: &mut Section<'_, '_>) -> Option<TableTable> {
    let primary = section.word("primary", &ROTARY, None);
    let primary_hand = section.word("primary_turns", &HANDS, Hand::Left);
    let primary_centre_mm = numbers(section, "primary_centre_mm", Bound::Size(LENGTH_MAX), None);
    let secondary = section.word("secondary", &ROTARY, None);
    let secondary_hand = section.word("secondary_turns", &HANDS, Hand::Left);
    let secondary_centre_mm = numbers(section, "secondary_centre_mm", Bound::Size(LENGTH_MAX), None);
    if primary.is_some() && primary == secondary {
        return section.refused("secondary", "must be another axis than primary");
    }
    Some(TableTable {
        primary: Rotary {
            axis: primary?,
            hand: primary_hand?,
            centre_mm: primary_centre_mm?,
        },
        secondary: Rotary {
            axis: secondary?,
            hand: secondary_hand?,
            centre_mm: secondary_centre_mm?,
        },
    })
}

fn head_table(section: &mut Section<'_, '_>) -> Option<HeadTable> {
    let head = section.word("head", &ROTARY, None);
    let head_hand = section.word("head_turns", &HANDS, Hand::Right);
    let pivot_length_mm = section.number("pivot_length_mm", Bound::Size(LENGTH_MAX), None);
    let pivot_offset_mm = numbers(section, "pivot_offset_mm", Bound::Size(LENGTH_MAX), Some([0.0; 2]));
    let table = section.word("table", &ROTARY, None);
    let table_hand = section.word("table_turns", &HANDS, Hand::Left);
    let table_centre_mm = numbers(section, "table_centre_mm", Bound::Size(LENGTH_MAX), None);
    if head.is_some() && head == table {
        return section.refused("table", "must be another axis than head");
    }
    let [x, y] = pivot_offset_mm?;
    Some(HeadTable {
        head: Rotary {
            axis: head?,
            hand: head_hand?,
            centre_mm: [0.0; 3],
        },
        pivot_mm: [x, y, pivot_length_mm?],
        table: Rotary {
            axis: table?,
            hand: table_hand?,
            centre_mm: table_centre_mm?,
        },
    })
}

fn scara(section: &mut Section<'_, '_>) -> Option<Scara> {
    let inner_arm_mm = section.number("inner_arm_mm", Bound::Positive(LENGTH_MAX), None);
    let outer_arm_mm = section.number("outer_arm_mm", Bound::Positive(LENGTH_MAX), None);
    let tool_offset_mm = section.number("tool_offset_mm", Bound::Size(LENGTH_MAX), 0.0);
    Some(Scara {
        inner_arm_mm: inner_arm_mm?,
        outer_arm_mm: outer_arm_mm?,
        tool_offset_mm: tool_offset_mm?,
        // The joints say both: see `fit`.
        elbow: Elbow::Positive,
        shoulder_middle_degrees: 0.0,
    })
}

fn linear_delta(section: &mut Section<'_, '_>) -> Option<LinearDelta> {
    let rod_mm = section.number("rod_mm", Bound::Positive(LENGTH_MAX), None);
    let radius_mm = section.number("radius_mm", Bound::Positive(LENGTH_MAX), None);
    let angles = numbers(
        section,
        "tower_angles_degrees",
        Bound::Size(360.0),
        Some([90.0, -30.0, -150.0]),
    );
    if let (Some(rod), Some(radius)) = (rod_mm, radius_mm)
        && radius >= rod
    {
        return section.refused("radius_mm", format!("must be below rod_mm, {rod}"));
    }
    let towers = angles?.map(LinearDelta::tower);
    let apart = |a: [f64; 2], b: [f64; 2]| (a[0] * b[1] - a[1] * b[0]).abs() > 0.1 || a[0] * b[0] + a[1] * b[1] < 0.0;
    if !(apart(towers[0], towers[1]) && apart(towers[1], towers[2]) && apart(towers[2], towers[0])) {
        return section.refused("tower_angles_degrees", "must lie apart, like [90.0, -30.0, -150.0]");
    }
    Some(LinearDelta {
        rod_mm: rod_mm?,
        radius_mm: radius_mm?,
        towers,
    })
}

/// An array of `N` numbers; left out: `default`.
fn numbers<const N: usize>(
    section: &mut Section<'_, '_>,
    key: &'static str,
    bound: Bound,
    default: Option<[f64; N]>,
) -> Option<[f64; N]> {
    let path = section.key(key);
    let item = match default {
        None => section.required(key, &format!("an array of {N} numbers"))?,
        Some(default) => match section.or(key, || default.as_slice().into()) {
            None => return Some(default),
            Some(item) => item,
        },
    };
    let count = item.items(&path)?.len();
    if count != N {
        return section.refused(key, format!("must be {N} numbers, are {count}"));
    }
    item.list(&path, |item, path| item.number(path, bound))?.try_into().ok()
}

/// Whether the machine has the axes and joints of its kinematics; takes from the joints what they say of a SCARA.
pub(super) fn fit(root: &Section<'_, '_>, transform: &mut Transform, axes: &[AxisMap], joints: &[Joint]) -> bool {
    let needed: Vec<Axis> = match transform {
        Transform::Trivial => Vec::new(),
        Transform::CoreXy => vec![Axis::X, Axis::Y],
        Transform::TableTable(table) => {
            let rotary = [table.primary.axis.axis(), table.secondary.axis.axis()];
            [Axis::X, Axis::Y, Axis::Z].into_iter().chain(rotary).collect()
        }
        Transform::HeadTable(head) => {
            let rotary = [head.head.axis.axis(), head.table.axis.axis()];
            [Axis::X, Axis::Y, Axis::Z].into_iter().chain(rotary).collect()
        }
        Transform::Scara(scara) if scara.tool_offset_mm != 0.0 => vec![Axis::X, Axis::Y, Axis::C],
        Transform::Scara(_) => vec![Axis::X, Axis::Y],
        Transform::LinearDelta(_) => vec![Axis::X, Axis::Y, Axis::Z],
    };
    let map = |axis: Axis| axes.iter().find(|map| map.axis == axis);
    let mut fits = true;
    for axis in needed {
        if map(axis).is_none() {
            root.wrong("axis", format!("is missing for these kinematics: {}", axis.letter()));
            fits = false;
        }
    }
    if let (Transform::Scara(scara), Some(x), Some(y)) = (transform, map(Axis::X), map(Axis::Y)) {
        let (shoulder, elbow) = (&joints[x.joints[0]], &joints[y.joints[0]]);
        let [low, high] = shoulder.travel_mm;
        if high - low >= 360.0 {
            let rule = "the shoulder of a SCARA (the joint of X) must turn less than 360 degrees";
            root.wrong("joint", rule);
            fits = false;
        }
        let [least, most] = elbow.travel_mm;
        if least < -180.0 || most > 180.0 {
            let rule = "the elbow of a SCARA (the joint of Y) must stay within -180 and 180 degrees";
            root.wrong("joint", rule);
            fits = false;
        }
        scara.shoulder_middle_degrees = 0.5 * (low + high);
        scara.elbow = if elbow.homing.position_mm < 0.0 {
            Elbow::Negative
        } else {
            Elbow::Positive
        };
    }
    fits
}
