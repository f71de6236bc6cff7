//! Input devices of the kernel, `[[hal.input]]`: the crate `input` as part of a session.
//!
//! In:  a table of the machine file. Out: a thread that writes the pins of its component.

use api::server::door::Door;
use config::InputDevice;
use host::capabilities;
use host::capabilities::Work;
use input::{Told, Wanted};
use operator::service::{Service, Until};
use std::io::Write;
use std::path::Path;

/// One device.
pub(super) struct Input {
    machine: String,
    wanted: Wanted,
}

impl Input {
    /// The device of a table.
    pub(super) fn of(machine: &str, device: &InputDevice) -> Input {
        Input {
            machine: machine.to_owned(),
            wanted: Wanted {
                name: device.name.clone(),
                device: device.device.clone(),
                codes: device.codes.clone(),
                exclusive: device.exclusive,
            },
        }
    }
}

impl Service for Input {
    fn name(&self) -> &'static str {
        "input"
    }

    fn programs(&self) -> Option<&Path> {
        None
    }

    fn serve(&self, _door: Door, until: Until<'_>) {
        capabilities::give_up_or_warn(Work::Ordinary);
        let name = &self.wanted.name;
        input::run(&self.machine, &self.wanted, until.stop, |told| {
            let line = match told {
                Told::Heard(device) => format!("input device {name}: {device}"),
                Told::Missing(why) => format!("warning: input device {name}: {why}"),
                Told::Lacks(codes) => format!(
                    "warning: input device {name} has no {}: these pins stay at rest",
                    codes.join(", ")
                ),
                Told::Gone(why) => format!("warning: input device {name} has gone: {why}"),
            };
            _ = writeln!(files::printed::stderr(), "{line}");
        });
    }
}
