//! The way to a running control, for another process: finds its socket.
//!
//! In:  the name of a machine, or none where only one control runs. Out: a [`Client`] of it, or why there is none.

use super::socket;
use super::socket::find_in;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

pub use protocol::client::{Client, ClientError, Followed, Sender};

/// Names the machine for commands that are not given one.
pub const MACHINE_VARIABLE: &str = "ISOCNC_MACHINE";

/// The machine that a command is for: the one it is given, else that of [`MACHINE_VARIABLE`]; none: the only one that runs.
pub fn chosen(machine: Option<&str>) -> Option<String> {
    let named = || std::env::var(MACHINE_VARIABLE).ok().filter(|name| !name.is_empty());
    machine.map(str::to_owned).or_else(named)
}

/// Connects to the control of a machine, of the one that [`chosen`] names, or to the only one.
///
/// # Errors
/// None or several run.
pub fn connect(machine: Option<&str>) -> Result<Client, ClientError> {
    connect_in(&hal_pins::directories(), chosen(machine).as_deref())
}

/// The controls that can be reached, by machine.
pub fn all() -> Vec<(String, Client)> {
    // Those of dead processes, and of other users, do not answer.
    let opened = try_all(&hal_pins::directories(), None).into_iter();
    opened.filter_map(|(name, opened)| Some((name, opened.ok()?))).collect()
}

/// As [`connect`], for sockets in these folders.
///
/// # Errors
/// None or several run.
pub fn connect_in(directories: &[PathBuf], machine: Option<&str>) -> Result<Client, ClientError> {
    let (mut found, mut mute) = (Vec::new(), None);
    for (name, opened) in try_all(directories, machine) {
        match opened {
            Ok(client) => found.push((name, client)),
            // Somebody is there.
            Err(error) if is_mute(&error) => mute = Some(error),
            Err(_) => {}
        }
    }
    match (found.len(), mute) {
        (0, Some(mute)) => Err(mute),
        (0, None) => Err(ClientError::NotRunning {
            machine: machine.map(str::to_owned),
        }),
        (1, _) => Ok(found.remove(0).1),
        (_, _) => Err(ClientError::Several {
            machines: found.into_iter().map(|(name, _)| name).collect(),
        }),
    }
}

fn try_all(directories: &[PathBuf], machine: Option<&str>) -> Vec<(String, Result<Client, ClientError>)> {
    let mut sockets = find_in(directories);
    sockets.retain(|(name, _)| machine.is_none_or(|machine| machine == name));
    let opened = sockets.into_iter().map(|(name, path)| {
        let opened = open(&path);
        (name, opened.map_err(|cause| ClientError::Io { path, cause }))
    });
    opened.collect()
}

fn open(path: &Path) -> io::Result<Client> {
    Client::new(socket::connect(path)?, path)
}

/// Whether there is a control that takes no connection, or is not who it should be.
fn is_mute(error: &ClientError) -> bool {
    let ClientError::Io { cause, .. } = error else {
        return false;
    };
    matches!(cause.kind(), ErrorKind::TimedOut | ErrorKind::PermissionDenied)
}
