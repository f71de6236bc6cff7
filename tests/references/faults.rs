//! `docs/faults.md`: every fault, from `crates/machine/src/faults.rs`.

use super::source::{covers, variants};
use super::{check, code, head, row};
use cia402::axis::{AxisFault, HomingFault, Step};
use cia402::profile::State;
use isocnc::machine::faults::{
    EstopCause, Fault, ForeignMaster, LinkFailure, LogicError, OrientFailure, Reaction, SpeedNotReached,
};
use motion::rt::homing::HomingFailure;
use motion::rt::{Order, SyncFault};

pub(crate) const FAULTS: &str = "crates/machine/src/faults.rs";
/// Where the enums are declared that clients are shown.
const CODES: &str = "crates/protocol/src/codes.rs";

/// What drive supervisors see.
pub(crate) const OF_DRIVES: [AxisFault; 11] = [
    AxisFault::Drive { error_code: 0x8611 },
    AxisFault::StepTimeout {
        step: Step::EnableOperation,
    },
    AxisFault::LocalControl { step: Step::SwitchOn },
    AxisFault::Lost,
    AxisFault::UnexpectedDisable {
        state: State::SwitchOnDisabled,
    },
    AxisFault::Interlock,
    AxisFault::UnknownState { statusword: 0x0042 },
    AxisFault::CommandIgnored { mode_display: 8 },
    AxisFault::Homing(HomingFault::Drive),
    AxisFault::Homing(HomingFault::Stopped),
    AxisFault::Homing(HomingFault::Timeout),
];

pub(crate) const OF_HOMING: [HomingFailure; 7] = [
    HomingFailure::NoSwitch,
    HomingFailure::StaysClosed,
    HomingFailure::Lost,
    HomingFailure::Unsteady,
    HomingFailure::NoIndex,
    HomingFailure::Skewed,
    HomingFailure::Aborted,
];

pub(crate) const OF_SPINDLES: [SyncFault; 6] = [
    SyncFault::NoIndex,
    SyncFault::SpindleStands,
    SyncFault::TooFast,
    SyncFault::NotReversed,
    SyncFault::NoNumber,
    SyncFault::Aborted,
];

pub(crate) const OF_LINKS: [LinkFailure; 4] = [
    LinkFailure::Down,
    LinkFailure::QueueFull,
    LinkFailure::FrameLength {
        octets: 1600,
        max: 1514,
    },
    LinkFailure::Os { errno: 100 },
];

/// An example of every fault, and of each reason where it has several.
pub(crate) fn examples() -> Vec<Fault> {
    let wanted_rpm = 3000.0;
    let late = |measured_rpm| Fault::SpindleLate {
        late: SpeedNotReached {
            spindle: 0,
            wanted_rpm,
            measured_rpm,
        },
    };
    let following = |led| Fault::FollowingError {
        joint: 0,
        error_mm: 2.104,
        limit_mm: 2.0,
        led,
    };
    let logic_error = |goes_on| Fault::LogicError {
        task: 0,
        error: LogicError {
            wrong: logic::Wrong::DivisionByZero,
            line: 12,
            column: 7,
            goes_on,
        },
    };
    let mac = [0x02, 0, 0, 0, 0, 0xF0];
    let mut examples = vec![Fault::NodeLost { node: 0 }];
    examples.extend(OF_DRIVES.map(|fault| Fault::Drive { joint: 0, fault }));
    examples.extend([Fault::DriveWarning { joint: 0 }, following(false), following(true)]);
    examples.extend(OF_HOMING.map(|failure| Fault::Homing { joint: 0, failure }));
    examples.extend([
        Fault::SoftLimit {
            joint: 0,
            position_mm: 305.2,
            line: 12,
        },
        Fault::IllegalCommand { joint: 0, line: 12 },
        Fault::LimitExceeded {
            joint: 0,
            order: Order::Velocity,
            value: 160.0,
            limit: 150.0,
            line: 12,
        },
    ]);
    examples.extend(OF_SPINDLES.map(|fault| Fault::OutOfStep { fault }));
    examples.extend([
        Fault::SpindleDrive { fault: OF_DRIVES[0] },
        late(Some(2100.0)),
        late(None),
        Fault::SpindleOrient {
            failure: OrientFailure::Late {
                degrees: 90.0,
                timeout_s: 10.0,
            },
        },
        Fault::SpindleOrient {
            failure: OrientFailure::Fault { code: 7 },
        },
        Fault::CountsLost {
            counts: -12,
            in_step: true,
        },
        Fault::CountsLost {
            counts: -12,
            in_step: false,
        },
        Fault::InputRange {
            node: 0,
            object: (0x6401, 1),
            raw: 12,
            limit: 5900,
        },
        Fault::CyclesSkipped { cycles: 3 },
        Fault::ManyOverruns { cycles: 6 },
        Fault::TooManyOverruns { cycles: 201 },
        Fault::CycleHung,
        Fault::PinsLost,
        Fault::ExternalLost {
            component: 0,
            cut_short: false,
            stops: false,
        },
        Fault::ExternalLost {
            component: 0,
            cut_short: true,
            stops: true,
        },
        Fault::ForeignMaster {
            sign: ForeignMaster {
                node: Some(240),
                mac,
                is_itself: true,
            },
        },
        Fault::ForeignMaster {
            sign: ForeignMaster {
                node: Some(3),
                mac,
                is_itself: false,
            },
        },
        Fault::EmergencyStop {
            cause: EstopCause::Chain,
        },
        Fault::EmergencyStop {
            cause: EstopCause::Unwired,
        },
        Fault::EmergencyStop {
            cause: EstopCause::Order,
        },
        Fault::EmergencyStop {
            cause: EstopCause::Sto { joint: 0 },
        },
        Fault::LimitSwitch { joint: 0, above: true },
        Fault::MainsLost,
        logic_error(false),
        logic_error(true),
        Fault::LogicLate { task: 0, scans: 3 },
        Fault::LogicAlarm { task: 0, text: 1 },
    ]);
    examples.extend(OF_LINKS.map(|error| Fault::LinkFailed { error }));
    covers(FAULTS, "Fault", &examples);
    examples
}

/// A reaction in words.
pub(crate) fn words(reaction: Reaction) -> &'static str {
    match reaction {
        Reaction::Count => "counted",
        Reaction::Warn => "warning, goes on",
        Reaction::ControlledStop => "controlled stop",
        Reaction::QuickStop => "quick stop",
        Reaction::EmergencyStop => "emergency stop",
        Reaction::Silence => "silenced",
    }
}

#[test]
fn the_faults() {
    check("docs/faults.md", |by_hand| {
        let mut text = "## Reactions\n\n".to_owned();
        text += &head(&["reaction", "the machine"]);
        for (reaction, variant) in Reaction::ALL.into_iter().zip(variants(CODES, "Reaction")) {
            assert_eq!(format!("{reaction:?}"), variant.name);
            text += &row(&[words(reaction), &variant.doc]);
        }
        text += "\n## Faults\n\n";
        text += &head(&["fault", "what it is", "reaction", "what to do"]);
        let examples = examples();
        for variant in variants(FAULTS, "Fault") {
            let is_it = |fault: &&Fault| format!("{fault:?}").split(' ').next() == Some(&*variant.name);
            let mut reactions: Vec<_> = examples.iter().filter(is_it).map(Fault::reaction).collect();
            reactions.sort_unstable();
            reactions.dedup();
            let reactions: Vec<_> = reactions.into_iter().map(words).collect();
            let name = code(&variant.name);
            text += &row(&[
                &name,
                &variant.doc,
                &reactions.join(", or "),
                by_hand.cell("## Faults", &name),
            ]);
        }
        text
    });
}
