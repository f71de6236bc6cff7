//! The machine file: TOML to a checked [`Config`], or located errors.
//!
//! In:  a TOML file (`configs/mill3-demo.toml` names every key but those of other machines: `configs/*-demo.toml`).
//! Out: a [`Config`], which is always a machine that may run, or [`ConfigErrors`] with *every* error of the file, each
//! with line, column, key path, value and the rule that it breaks. Where the text is no TOML at all, only the errors
//! of its syntax are told.
//!
//! To add a key: its field in the `keys!` of its table, which declares struct and reader at once, or a field and a line in the reader of
//! a table that is not so regular; a row in `tests.rs`.
//!
//! | to learn | file |
//! |---|---|
//! | the checked description of a whole machine, and the order in which it is read; nothing after it checks again | `machine.rs` |
//! | how a table is declared, and how its keys are read | `section.rs`; values of several tables `values.rs`, files and folders `paths.rs` |
//! | what a reader asks, of which schema and references are made | `question.rs` |
//! | how each error is noted with its place | `document.rs`, `error.rs`; what shows only later `late.rs` |
//! | the bus and its nodes | `bus_types.rs`, `bus.rs`, `node.rs`; what each protocol has of its own `protocol.rs`, `powerlink.rs`, `cross.rs`, `ethercat.rs`, `esi.rs` |
//! | what is known of a kind of drive (`drives/`): defaults and limits of nodes and joints, what is read back while the node boots, how its simulated one is built | `drive_profile.rs` |
//! | in which units a drive counts: written and compared by `bus`, computed with by the simulated drive alone | `factor_group.rs` |
//! | channels of I/O nodes by type, name and unit | `channels.rs` |
//! | joints, how they home, and what that needs of the rest of the machine | `joints.rs`, `homing.rs`, `homing_fit.rs` |
//! | programs in Structured Text | `logics.rs` |
//! | kinematics | `kinematics.rs`, their meaning in `motion::kinematics` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod analog;
mod axes;
mod bus;
mod bus_types;
mod cell;
mod channels;
mod compensation;
mod components;
mod cross;
mod device;
mod document;
mod drive;
mod drive_profile;
mod error;
mod esi;
mod ethercat;
mod external;
mod factor_group;
mod homing;
mod homing_fit;
mod input_device;
mod joints;
mod kinematics;
mod late;
mod limits;
mod logics;
mod machine;
mod mapping;
mod modes;
mod net;
mod node;
mod node_keys;
mod objects;
mod panel;
mod panel_items;
mod paths;
mod period;
mod position_loop;
mod powerlink;
mod program;
mod protocol;
mod question;
mod remap;
mod rt;
mod scale;
mod section;
mod sim;
mod spindle;
mod steps;
mod sto;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_analog;
#[cfg(test)]
mod tests_channels;
#[cfg(test)]
mod tests_components;
#[cfg(test)]
mod tests_devices;
#[cfg(test)]
mod tests_ethercat;
#[cfg(test)]
mod tests_homing;
#[cfg(test)]
mod tests_kinematics;
#[cfg(test)]
mod tests_logics;
#[cfg(test)]
mod tests_program;
#[cfg(test)]
mod tests_spindle;
#[cfg(test)]
mod tests_steps;
#[cfg(feature = "testing")]
mod toy;
mod values;

pub use analog::AnalogOutput;
pub use axes::AxisMap;
pub use bus_types::*;
pub use cell::{Cell, Remote};
pub use channels::{Channel, ChannelKind, Follow, ObjectKind, Typed};
pub use compensation::Compensation;
pub use components::{Component, Place};
#[cfg(feature = "testing")]
pub use drive_profile::questions as drive_profile_questions;
pub use drive_profile::{
    BUILT_IN as DRIVE_PROFILES, DriveProfile, InputBits, MappingLimits, parse as parse_drive_profile,
};
pub use error::{ConfigError, ConfigErrors};
pub use esi::assigned as esi_assigned;
pub use external::{External, OnLoss};
pub use factor_group::FactorGroup;
pub use homing::{HomeSwitch, Homing, HomingBy, HomingByControl, HomingIndex};
pub use input_device::InputDevice;
pub use joints::{JOINTS_MAX, Joint, Switches};
pub use late::{bus_error, component_error, logic_error, net_errors};
pub use limits::{JointLimits, StopLimits};
pub use logics::{End, Interface, LogicPin, LogicTask, pin_type};
pub use machine::{Config, Mains, StopCategory, Stops, check_planner};
pub use modes::{DriveMode, Reactions, targets, touch_probe_objects};
pub use net::Net;
pub use obd::device::{ConfigurationWrite, DeviceDescription};
pub use panel::{Encryption, MtConnect, OnLostControl, PANEL_PORT, Panel};
pub use panel_items::{BUTTONS_MAX, Does, PanelButton, PanelQuestion, PanelValue};
pub use position_loop::GAIN_MAX;
pub use program::{ArcTolerance, Cutter, Dialect, Pecks, Program, ToolChanger, Tools, UserCodes};
pub use question::{Bound, Question};
pub use remap::Remap;
pub use rt::{KeepAwake, Require, Rt};
pub use sim::{Sim, SimBody, SimFault, SimFaultKind, SimJoint, SimOutline, SimProbe, SimSignal, SimSurface};
pub use spindle::{Spindle, SpindleAxis, SpindleCounter, SpindleDrive, SpindleEncoder};
pub use steps::{PARALLEL_PINS, SUBSTEPS, SimStepper, StepKind, StepOutput, StepPortKind, Steps, rate_max_hz};
pub use sto::Sto;
pub use values::is_name;

use document::Log;
use files::read::TEXT_MAX;
use machine::machine_file;
use std::path::Path;
use toml::de::DeTable;

/// Reads and checks a machine file.
///
/// # Errors
/// The file cannot be read, or every error in it.
pub fn read(path: &Path) -> Result<Config, ConfigErrors> {
    match files::read(path, TEXT_MAX) {
        Ok(bytes) => parse(&bytes, path),
        Err(error) => {
            let rule = format!("cannot be read: {error}");
            let error = ConfigError::whole(&path.display().to_string(), rule);
            Err(ConfigErrors::new(vec![error], 0))
        }
    }
}

/// As [`read`], as if the file said `cycle_us` for the cycle of its machine.
///
/// # Errors
/// As [`read`].
pub fn read_with_cycle(path: &Path, cycle_us: Option<u32>) -> Result<Config, ConfigErrors> {
    match (files::read_text(path, TEXT_MAX), cycle_us) {
        (Ok(text), Some(cycle_us)) => parse(&period::with_cycle_us(&text, cycle_us), path),
        // What cannot be read, or is no text, says so there.
        (Ok(_) | Err(_), _) => read(path),
    }
}

/// Checks the text of a machine file; `path` is for messages, and device files are looked for beside it.
///
/// # Errors
/// Every error in the text.
pub fn parse(text: &(impl AsRef<[u8]> + ?Sized), path: &Path) -> Result<Config, ConfigErrors> {
    let file = path.display().to_string();
    let text = files::without_mark(text.as_ref());
    let text = match std::str::from_utf8(text) {
        Ok(text) => text,
        Err(error) => {
            // A place can only be told in the part that is text.
            let valid = &text[..error.valid_up_to()];
            let valid = std::str::from_utf8(valid).unwrap_or_default();
            let rule = "must be UTF-8 text".to_owned();
            let lines = error::lines(valid);
            let error = ConfigError::at(&file, (valid, &lines), valid.len()..valid.len(), String::new(), rule);
            return Err(ConfigErrors::new(vec![error], 0));
        }
    };
    let log = Log::new(&file, text);
    let (document, syntax) = DeTable::parse_recoverable(text);
    for error in &syntax {
        let span = error.span().unwrap_or(text.len()..text.len());
        log.misplaced(span, "", error.message(), None);
    }
    let config = match syntax.is_empty() {
        true => machine_file(&log, document.get_ref(), path),
        false => None,
    };
    let (errors, more) = log.into_errors();
    match config {
        Some(config) if errors.is_empty() => Ok(config),
        // A value is only ever left out with an error; should that fail, the machine must still be refused.
        _ if errors.is_empty() => {
            let rule = "is refused for a reason that was lost".to_owned();
            Err(ConfigErrors::new(vec![ConfigError::whole(&file, rule)], 0))
        }
        _ => Err(ConfigErrors::new(errors, more)),
    }
}

/// What the readers ask of each key while they read this text, which may be wrong; `path` as in [`parse`]. Keys that come twice
/// are asked twice.
#[cfg(feature = "testing")]
pub fn questions(text: &str, path: &Path) -> Vec<(String, Question)> {
    let log = Log::new("", text);
    let (document, _) = DeTable::parse_recoverable(text);
    machine_file(&log, document.get_ref(), path);
    log.into_questions()
}
