//! `docs/alarms.md`: every alarm and warning as the operator reads it, with the values of an example.

use super::faults::{FAULTS, OF_DRIVES, OF_HOMING, OF_LINKS, OF_SPINDLES, examples, words};
use super::source::{Variant, covers, variants};
use super::{check, code, head, row};
use isocnc::machine::faults::{Fault, Reaction, UNWATCHED_CODE, silenced};
use isocnc::operator::console::unwatched;

/// What the comment of the variant says that a value has.
fn cause(known: &[Variant], value: &impl std::fmt::Debug) -> String {
    let value = format!("{value:?}");
    let name = value.split(|letter: char| !letter.is_alphanumeric()).next();
    let variant = known.iter().find(|variant| Some(&*variant.name) == name);
    variant
        .unwrap_or_else(|| panic!("{value}: no such variant"))
        .doc
        .clone()
}

#[test]
fn the_alarms() {
    let (drive, homing) = ("cia402/src/axis/fault.rs", "crates/motion/src/rt/homing/mod.rs");
    let (spindle, link) = (
        "crates/motion/src/rt/synced/mod.rs",
        "crates/machine/src/fault_causes.rs",
    );
    covers(drive, "AxisFault", &OF_DRIVES);
    covers(homing, "HomingFailure", &OF_HOMING);
    covers(spindle, "SyncFault", &OF_SPINDLES);
    covers(link, "LinkFailure", &OF_LINKS);
    let [drives, homings] = [(drive, "AxisFault"), (homing, "HomingFailure")].map(|(path, name)| variants(path, name));
    let [spindles, links] = [(spindle, "SyncFault"), (link, "LinkFailure")].map(|(path, name)| variants(path, name));
    let faults = variants(FAULTS, "Fault");
    check("docs/alarms.md", |_| {
        let mut text = head(&["code", "text", "cause", "fault", "the machine"]);
        for fault in examples().iter().filter(|fault| fault.reaction() != Reaction::Count) {
            let cause = match fault {
                Fault::Drive { fault, .. } => cause(&drives, fault),
                Fault::Homing { failure, .. } => cause(&homings, failure),
                Fault::OutOfStep { fault } => cause(&spindles, fault),
                Fault::LinkFailed { error } => cause(&links, error),
                other => cause(&faults, other),
            };
            let said = fault.message(
                |_| "x-drive".into(),
                |_| "x-drive".into(),
                |_, text| text.map_or("cell.st", |_| "lubrication: no pressure").into(),
                |_| "vfd".into(),
            );
            let name = format!("{fault:?}");
            let name = code(name.split(' ').next().unwrap_or_default());
            // By what the machine has.
            let said = match fault {
                Fault::CycleHung => [(true, false), (false, true), (true, true)]
                    .map(|(network, steps)| silenced(network, steps).text)
                    .to_vec(),
                _ => vec![said.text],
            };
            for said in said {
                text += &row(&[fault.code(), &said, &cause, &name, words(fault.reaction())]);
            }
        }
        let hung = "The time-out thread does not look any more.";
        text + &row(&[
            UNWATCHED_CODE,
            &unwatched().text,
            hung,
            "",
            "stop on the path, drives off, network down, exit code 3",
        ])
    });
}
