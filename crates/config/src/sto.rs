//! `sto`: how a drive tells that its safety circuit is open.

use super::objects::{Mapped, parse_object};
use super::section::Section;
use cia402::profile::object_of;

/// The sign of a drive that its safety circuit is open (safe torque off): a bit of an object that it sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sto {
    /// The object, one of the inputs of its node.
    pub object: (u16, u8),
    /// Number of the bit, from 0.
    pub bit: u32,
    /// Value of the bit while the circuit is open; default true.
    pub active: bool,
}

impl Sto {
    /// The same of an axis of a node, where the object is one of the drive profile.
    pub(super) fn of_axis(self, axis: u8) -> Sto {
        let (index, sub) = self.object;
        Sto {
            object: (object_of(axis, index), sub),
            ..self
        }
    }
}

/// Reads it; `inputs`: what the drive sends, `None` where that is not known.
pub(super) fn sto(section: &mut Section<'_, '_>, inputs: Option<&[Mapped]>) -> Option<Sto> {
    let what = "an object that the drive sends, like \"0x60FD\" or \"0x2110:1\"";
    let object = section.required("object", what);
    let bit = section.integer("bit", 0..=63, None).map(|bit| bit as u32);
    let active = section.flag("active", true);
    let text = object?.text(&section.key("object"))?;
    let Some(object) = parse_object(text) else {
        return section.refused("object", format!("must be {what}"));
    };
    if let Some(inputs) = inputs {
        match inputs.iter().find(|mapped| (mapped.index, mapped.sub) == object) {
            None => section.wrong("object", "must be among the inputs of its node"),
            Some(mapped) if bit.is_some_and(|bit| bit >= u32::from(mapped.bits)) => {
                section.wrong("bit", format!("must be below {}, the bits of {text}", mapped.bits));
            }
            Some(_) => {}
        }
    }
    Some(Sto {
        object,
        bit: bit?,
        active: active?,
    })
}
