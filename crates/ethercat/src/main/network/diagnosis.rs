//! What is known of a device and of the network, for people.

use super::{DeviceState, MainDevice, Stage, Step};
use crate::main::cycle::Answered;
use crate::main::event::SetupError;
use crate::wire::register::AlState;
use crate::wire::sii::Identity;

/// The object that has the type of a device.
const DEVICE_TYPE: u16 = 0x1000;

/// What is known of a device of the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// What it is like.
    pub state: DeviceState,
    /// The state that it was seen in last, or is led to.
    pub al_state: AlState,
    /// What is being done with it.
    pub stage: &'static str,
    /// Why it is not up.
    pub why: Option<SetupError>,
    /// Its position on the wire, 0 first; `None`: not found.
    pub position: Option<u16>,
    /// What its EEPROM says it is.
    pub identity: Option<Identity>,
    /// Its type (1000h): as it has told it, else as it has to be; `None`: nobody asks for it.
    pub device_type: Option<u32>,
    /// How it has answered in the last cycle.
    pub answered: Answered,
}

impl<const N: usize, const F: usize> MainDevice<'_, N, F> {
    /// What is known of a device, by its number in the configuration; `None`: there is no such number.
    pub fn diagnosis(&self, device: usize) -> Option<Diagnosis> {
        let mut checks = self.config.devices.get(device)?.checks.iter();
        let device_type = checks.find(|check| check.index == DEVICE_TYPE).map(|check| check.value);
        let answered = self.cyclic.answered(device);
        let state = self.device_state(device);
        let Some(at) = self.places[device] else {
            return Some(Diagnosis {
                state,
                al_state: AlState::Init,
                stage: self.stage_text(),
                why: None,
                position: None,
                identity: None,
                device_type,
                answered,
            });
        };
        let device = &self.devices[at];
        let device_type = match device.told {
            Some(SetupError::Differs { object, found, .. }) if object.index == DEVICE_TYPE => Some(found),
            _ => device_type,
        };
        let al_state = match (device.step, device.told) {
            (Step::Away, Some(SetupError::Refused { at, .. } | SetupError::Late { at, .. })) => at,
            (step, _) => led_to(step),
        };
        Some(Diagnosis {
            state,
            al_state,
            stage: text(device.step),
            why: device.told,
            position: Some(device.position),
            identity: (device.step >= Step::Identified).then_some(device.found.identity),
            device_type,
            answered,
        })
    }

    /// The frame of a service is under way: its answer is awaited.
    pub const fn awaits_service(&self) -> bool {
        self.service.sent_ns.is_some()
    }

    /// What the network is about.
    pub const fn stage_text(&self) -> &'static str {
        match self.stage {
            Stage::Count { .. } => "devices are counted",
            Stage::Reset | Stage::Identify => "devices are identified",
            Stage::Run => "devices are brought up and run",
        }
    }

    /// Devices that were counted on the wire.
    pub const fn count(&self) -> usize {
        self.count
    }

    /// What the device at a position is, by its EEPROM, and its alias; `None`: not known yet.
    pub fn at_position(&self, position: usize) -> Option<(Identity, u16)> {
        let device = self.devices[..self.count].get(position)?;
        (device.step >= Step::Identified).then_some((device.found.identity, device.found.alias))
    }
}

/// The state that a device has in a step.
fn led_to(step: Step) -> AlState {
    match step {
        Step::Quickest
        | Step::StartValues
        | Step::MapOutputs
        | Step::MapInputs
        | Step::Checks
        | Step::Watchdog
        | Step::ManagerOut
        | Step::ManagerIn
        | Step::FmmuOut
        | Step::FmmuIn
        | Step::Near
        | Step::SyncCycle
        | Step::SyncStart
        | Step::SyncOn
        | Step::ToSafeOp => AlState::PreOp,
        Step::Settle | Step::ToOp => AlState::SafeOp,
        Step::Run | Step::Look => AlState::Op,
        _ => AlState::Init,
    }
}

fn text(step: Step) -> &'static str {
    match step {
        Step::Address | Step::Features | Step::Ports | Step::Pdi => "gets its address",
        Step::EepromForce | Step::EepromOwner | Step::Eeprom => "its EEPROM is read",
        Step::Identified | Step::Stranger => "is identified",
        Step::Clock => "waits until clocks are measured",
        Step::ToInit | Step::ClearFmmus | Step::ClearManagers | Step::SyncOff => "is reset",
        Step::MailOut | Step::MailIn | Step::EepromLend => "gets its mailboxes",
        Step::ToPreOp => "goes to PRE-OP",
        Step::Quickest | Step::StartValues => "is configured by SDO",
        Step::MapOutputs | Step::MapInputs => "its process data are mapped",
        Step::Checks => "its values are compared",
        Step::Watchdog | Step::ManagerOut | Step::ManagerIn | Step::FmmuOut | Step::FmmuIn => {
            "its process data are set up"
        }
        Step::Near | Step::SyncCycle | Step::SyncStart | Step::SyncOn => "its clock is set",
        Step::ToSafeOp => "goes to SAFE-OP",
        Step::Settle | Step::ToOp => "goes to OP",
        Step::Run | Step::Look => "runs",
        Step::Away => "is tried again in a while",
        Step::Find | Step::FindPosition | Step::Acknowledge => "is looked for",
    }
}
