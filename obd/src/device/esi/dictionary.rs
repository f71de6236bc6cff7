//! The object dictionary in an ESI file: which objects a device has, and which of them can be written.
//!
//! In:  `Profile Dictionary` of a device. Out: [`EsiDictionary`]. It says what there is to know before the device is asked: what cannot be
//! read in it is left out, and is no mistake.

use super::read::{child, esi_number, named, words};
use crate::Access;
use roxmltree::Node;
use std::collections::BTreeMap;
use std::vec::Vec;

/// First object of the device profiles, CiA 402 among them.
const PROFILES: u16 = 0x6000;

/// The objects of a device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EsiDictionary(BTreeMap<u16, EsiObject>);

/// An object.
#[derive(Clone, Debug, PartialEq, Eq)]
struct EsiObject {
    access: Option<Access>,
    /// Those of its type; `None`: the file does not tell them.
    subs: Option<Vec<(u8, Option<Access>)>>,
}

impl EsiDictionary {
    /// Whether the device has an object. Of the objects of device profiles the file says nothing where it has none of them at all.
    pub fn has(&self, index: u16, sub: u8) -> bool {
        self.find(index, sub).is_none_or(|found| found.is_some())
    }

    /// Whether the device has an object that can be written; one whose access the file does not tell is believed to be.
    pub fn can_write(&self, index: u16, sub: u8) -> bool {
        self.find(index, sub)
            .is_none_or(|found| found.is_some_and(|access| access.is_none_or(Access::writable)))
    }

    /// `None`: the file does not say. `Some(None)`: the device has no such object. Else its access, as far as it is told.
    fn find(&self, index: u16, sub: u8) -> Option<Option<Option<Access>>> {
        if index >= PROFILES && self.0.range(PROFILES..).next().is_none() {
            return None;
        }
        let Some(object) = self.0.get(&index) else {
            return Some(None);
        };
        let Some(subs) = &object.subs else {
            return Some(Some(object.access));
        };
        let found = subs.iter().find(|(number, _)| *number == sub);
        Some(match found {
            Some((_, access)) => Some(access.or(object.access)),
            // The number of entries is there, whether it is listed or not.
            None if sub == 0 => Some(None),
            None => None,
        })
    }
}

/// The dictionary of a device; `None`: its file has none.
pub(super) fn dictionary(device: Node<'_, '_>) -> Option<EsiDictionary> {
    let mut objects = BTreeMap::new();
    for dictionary in named(device, "Profile").filter_map(|profile| child(profile, "Dictionary")) {
        let types = child(dictionary, "DataTypes");
        let types = types.into_iter().flat_map(|types| named(types, "DataType"));
        let types: BTreeMap<&str, Node<'_, '_>> = types
            .filter_map(|kind| Some((words(child(kind, "Name")?), kind)))
            .collect();
        let listed = child(dictionary, "Objects");
        for object in listed.into_iter().flat_map(|listed| named(listed, "Object")) {
            let Some(index) = child(object, "Index").and_then(|index| number::<u16>(words(index))) else {
                continue;
            };
            let kind = child(object, "Type").and_then(|kind| types.get(words(kind)));
            let found = EsiObject {
                access: access(object),
                subs: kind.map(|kind| subs(*kind, &types)),
            };
            objects.insert(index, found);
        }
    }
    (!objects.is_empty()).then_some(EsiDictionary(objects))
}

/// The sub-indices of a type: 0 alone where it is no array and no record.
fn subs(kind: Node<'_, '_>, types: &BTreeMap<&str, Node<'_, '_>>) -> Vec<(u8, Option<Access>)> {
    let mut all = Vec::new();
    for item in named(kind, "SubItem") {
        let own = access(item);
        if let Some(sub) = child(item, "SubIdx").and_then(|sub| number::<u8>(words(sub))) {
            all.push((sub, own));
            continue;
        }
        // The elements of an array, which have a type of their own.
        let array = child(item, "Type").and_then(|kind| types.get(words(kind)));
        let array = array.and_then(|array| child(*array, "ArrayInfo"));
        let of = |name| {
            array
                .and_then(|array| child(array, name))
                .and_then(|text| number::<u8>(words(text)))
        };
        if let Some(count) = of("Elements") {
            let first = of("LBound").unwrap_or(1);
            all.extend((first..=u8::MAX).take(count.into()).map(|sub| (sub, own)));
        }
    }
    if all.is_empty() {
        all.push((0, None));
    }
    all
}

fn number<N: TryFrom<i128>>(text: &str) -> Option<N> {
    esi_number(text).and_then(|number| N::try_from(number).ok())
}

fn access(node: Node<'_, '_>) -> Option<Access> {
    let access = child(node, "Flags").and_then(|flags| child(flags, "Access"))?;
    match words(access) {
        "ro" | "RO" => Some(Access::ReadOnly),
        "wo" | "WO" => Some(Access::WriteOnly),
        "rw" | "RW" => Some(Access::ReadWrite),
        _ => None,
    }
}
