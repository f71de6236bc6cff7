//! The link to the supervisor of a cell: the crate `cell-link` as part of a session.
//!
//! In:  what the machine file says of the cell; a way into the service as some of its clients.
//! Out: a thread that keeps the link until the session ends.
//!
//! The supervisor is a client as others are: it takes control for the start of a program only, and is refused where somebody has it.

use anyhow::Context;
use api::server::door::Door;
use cell_link::carrier::{Identity, common_name, machine_of};
use cell_link::{Client, Refused, Settings};
use config::{Cell as Wanted, Config, Panel};
use host::capabilities;
use host::capabilities::Work;
use operator::service::{Service, Until};
use protocol::{Remote, Role};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What a session keeps up.
pub(super) struct Cell {
    settings: Settings,
}

impl Cell {
    /// The link of a machine, if there is to be one.
    ///
    /// # Errors
    /// Its certificate cannot be read, or is none of a machine.
    pub(super) fn of(config: &Config) -> anyhow::Result<Option<Cell>> {
        let (Some(wanted), Some(state)) = (&config.cell, &config.state_directory) else {
            return Ok(None);
        };
        let name = common_name(&wanted.certificate).context("the certificate of [cell]")?;
        let place = wanted.certificate.display();
        machine_of(&name).with_context(|| format!("{place}: is of {name:?}, which is no machine of a cell"))?;
        let settings = settings(wanted, state, config.panel.as_ref());
        Ok(Some(Cell { settings }))
    }
}

impl Service for Cell {
    fn name(&self) -> &'static str {
        "cell"
    }

    fn programs(&self) -> Option<&Path> {
        Some(&self.settings.programs)
    }

    fn serve(&self, door: Door, until: Until<'_>) {
        capabilities::give_up_or_warn(Work::Ordinary);
        let role = match self.settings.remote {
            Remote::Off => Role::Watch,
            Remote::Upload | Remote::Run => Role::Operate,
        };
        let connect = |hears_changes| -> Result<Box<dyn cell_link::Control>, Refused> {
            let stream = door
                .enter(role, "supervisor")
                .map_err(|cause| Refused::Gone(cause.to_string()))?;
            Ok(Box::new(Client::new(stream, hears_changes)?))
        };
        match cell_link::run(&self.settings, &connect, until.stop) {
            // The control has ended, and with it its clients.
            Ok(()) | Err(cell_link::LinkError::Control(Refused::Gone(_))) => {}
            Err(cause) => {
                _ = writeln!(
                    files::printed::stderr(),
                    "warning: the link to the supervisor has ended: {cause}"
                )
            }
        }
    }
}

fn settings(wanted: &Wanted, state: &Path, panel: Option<&Panel>) -> Settings {
    let programs: Option<PathBuf> = panel.and_then(|panel| panel.programs.clone());
    Settings {
        supervisor: wanted.supervisor.clone(),
        identity: Identity {
            certificate: wanted.certificate.clone(),
            key: wanted.key.clone(),
            ca: wanted.ca.clone(),
        },
        remote: wanted.remote,
        programs: programs.unwrap_or_else(|| state.join("programs")),
        state: state.to_owned(),
        // An address of any interface is none that a browser elsewhere could open.
        panel: panel
            .filter(|panel| !panel.address.ip().is_unspecified())
            .map(|panel| format!("http://{}/", panel.address)),
    }
}
