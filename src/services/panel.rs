//! The operator panel in the browser: the crate `panel` as part of a session.
//!
//! In:  where it is to listen, who may come; a way into the service as one of its clients.
//! Out: a thread that serves it until the session ends.
//!
//! It is bound before anything else of a control, as a demo moves to a network namespace of its own. An address in use is told with
//! who has it. Asked for on the command line, the panel is what somebody waits for: there is no control then. In a machine file it is
//! one of several ways to the machine: the control goes on without, and tries again until the address is free.

use super::Asked;
use ::panel::{Backup, Counts, Guest, Listener, Settings, Tls, TlsError, TokenFile, Tokens};
use anyhow::Context;
use api::server::door::Door;
use config::{Config, Encryption, Panel as Wanted};
use host::capabilities;
use host::capabilities::Work;
use host::terminal::say;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use operator::measurements;
use operator::service::{Service, Until};
use protocol::Role;
use std::io::{self, Write};
use std::net::SocketAddr;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Between two tries for an address in use, ms.
const RETRY_MS: u16 = 5000;

/// What a session serves.
pub(crate) struct Panel {
    wanted: Wanted,
    listener: Mutex<Option<Listener>>,
    settings: Mutex<Option<Settings>>,
    counts: Arc<Counts>,
    /// What the journal says of it.
    note: String,
}

impl Panel {
    /// The panel of a machine, if there is to be one, listening; `quiet`: standard output is for a program.
    ///
    /// # Errors
    /// It was asked for, and its address cannot be had.
    pub(super) fn of(config: &Config, asked: Asked, quiet: bool) -> anyhow::Result<Option<Panel>> {
        let Some(wanted) = wanted(config, asked) else {
            return Ok(None);
        };
        let tls = encryption(&wanted).context("the panel cannot encrypt what it sends")?;
        let (listener, mut note) = match Listener::bind(wanted.address) {
            Ok(listener) => {
                let note = format!("panel: {}", address(&listener, tls.is_some()));
                (Some(listener), note)
            }
            Err(error) if asked.is_some() || !error.is_in_use() => {
                let help = "--panel ADDRESS:PORT takes another one";
                return Err(error).context(format!("the panel cannot listen: {help}"));
            }
            Err(error) => {
                let note = format!("warning: panel: {error}; tried again every {} s", RETRY_MS / 1000);
                let _ = writeln!(files::printed::stderr(), "{note}");
                (None, note)
            }
        };
        let mut tokens = match &wanted.tokens {
            Some(file) => Tokens::of_file(TokenFile::new(file)),
            None => Tokens::default(),
        };
        if let Some(listener) = &listener {
            let place = address(listener, tls.is_some());
            let mut told = match (&wanted.tokens, listener.is_loopback()) {
                (_, true) => format!("panel: {place}/ for you; other users of this PC need a token\n"),
                (Some(file), false) => format!(
                    "panel: {place}/ with a token: 'isocnc panel token {}' makes one ({})\n",
                    config.path.display(),
                    file.display()
                ),
                (None, false) => {
                    let secret = tokens.add_passing("this run", Role::SetUp).context("a token")?;
                    format!("panel: {place}/#token={secret}\n")
                }
            };
            if let Some(tls) = &tls {
                told += &format!(
                    "panel: its certificate has the SHA-256 fingerprint {}\n",
                    tls.fingerprint()
                );
                note = format!("{note}, certificate {}", tls.fingerprint());
            }
            match quiet {
                false => say(&told),
                true => _ = files::printed::stderr().write_all(told.as_bytes()),
            }
            if !listener.is_loopback() && tls.is_none() {
                let what = "whoever can listen on this network can read what goes to the panel, tokens too, as it is not encrypted: tls of [panel] does that";
                let _ = writeln!(files::printed::stderr(), "warning: panel: {what}");
                note = format!("{note} (not encrypted)");
            }
        }
        let settings = Settings {
            setup: None,
            hosts: wanted.hosts.clone(),
            tokens,
            programs: wanted.programs.clone(),
            pages: wanted.pages.clone(),
            measurements: config.state_directory.as_deref().map(measurements::folder),
            tls,
            backup: Backup {
                folder: config.state_directory.clone(),
                files: [
                    Some(config.path.clone()),
                    config.tools.table.clone(),
                    config.program.parameter_file.clone(),
                ]
                .into_iter()
                .flatten()
                .collect(),
                secret: wanted.tokens.iter().cloned().collect(),
            },
            grbl: port("[panel.grbl] listen", "grbl", wanted.grbl, quiet)?,
            shdr: port("[panel.mtconnect] shdr", "shdr", wanted.mtconnect.shdr, quiet)?,
            mtconnect_old_errors: wanted.mtconnect.old_errors,
            mtconnect_at_root: wanted.mtconnect.at_root,
        };
        Ok(Some(Panel {
            wanted,
            listener: Mutex::new(listener),
            settings: Mutex::new(Some(settings)),
            counts: Arc::default(),
            note,
        }))
    }

    /// Whether the files that the machine file names for it are there.
    ///
    /// # Errors
    /// What is wrong with them.
    pub(super) fn check(config: &Config) -> anyhow::Result<()> {
        match config.panel.as_ref().map(|panel| &panel.encryption) {
            Some(Encryption::Files { certificate, key }) => Tls::of_files(certificate, key)
                .map(drop)
                .context("the panel cannot encrypt what it sends"),
            // Its own certificate is made where there is none.
            Some(Encryption::None | Encryption::Own(_)) | None => Ok(()),
        }
    }

    /// Waits for its address; `None`: the session ends before that.
    fn listener(&self, until: &UnixStream) -> Option<Listener> {
        if let Some(listener) = take(&self.listener) {
            return Some(listener);
        }
        loop {
            let mut end = [PollFd::new(until.as_fd(), PollFlags::POLLIN)];
            // An interrupted wait is a short one.
            let _ = poll(&mut end, PollTimeout::from(RETRY_MS));
            if end[0].any().unwrap_or(false) {
                return None;
            }
            if let Ok(listener) = Listener::bind(self.wanted.address) {
                let _ = writeln!(
                    files::printed::stderr(),
                    "panel: {}/",
                    address(&listener, self.wanted.encryption != Encryption::None)
                );
                return Some(listener);
            }
        }
    }
}

impl Service for Panel {
    fn name(&self) -> &'static str {
        "panel"
    }

    fn note(&self) -> Option<&str> {
        Some(&self.note)
    }

    fn programs(&self) -> Option<&Path> {
        self.wanted.programs.as_deref()
    }

    fn serve(&self, door: Door, until: Until<'_>) {
        capabilities::give_up_or_warn(Work::Ordinary);
        let Some(listener) = self.listener(&until.closed) else {
            return;
        };
        let settings = take(&self.settings).unwrap_or_default();
        let control = Arc::new(Way(door));
        if let Err(cause) = ::panel::serve(listener, settings, control, Arc::clone(&self.counts), until.closed) {
            let _ = writeln!(files::printed::stderr(), "warning: the panel has ended: {cause}");
        }
    }
}

fn take<T>(of: &Mutex<Option<T>>) -> Option<T> {
    of.lock().unwrap_or_else(PoisonError::into_inner).take()
}

fn wanted(config: &Config, asked: Asked) -> Option<Wanted> {
    let of_file = config.panel.clone();
    match (asked, of_file) {
        (None, of_file) => of_file,
        (Some(None), Some(of_file)) => Some(of_file),
        (Some(Some(address)), Some(of_file)) => Some(Wanted { address, ..of_file }),
        (Some(address), None) => Some(Wanted::at(
            address.unwrap_or(Wanted::loopback()),
            config.state_directory.as_deref(),
        )),
    }
}

fn address(listener: &Listener, is_encrypted: bool) -> String {
    format!("{}://{}", scheme(is_encrypted), listener.address())
}

/// How an address of the panel begins.
pub(crate) fn scheme(is_encrypted: bool) -> &'static str {
    if is_encrypted { "https" } else { "http" }
}

fn encryption(wanted: &Wanted) -> Result<Option<Tls>, TlsError> {
    match &wanted.encryption {
        Encryption::None => Ok(None),
        Encryption::Files { certificate, key } => Tls::of_files(certificate, key).map(Some),
        Encryption::Own(folder) => {
            let address = wanted.address.ip();
            let names = (wanted.hosts.iter().cloned())
                .chain(["localhost".into(), "127.0.0.1".into(), "::1".into()])
                .chain((!address.is_unspecified() && !address.is_loopback()).then(|| address.to_string()));
            let names: Vec<String> = names.collect();
            Tls::own(folder.as_deref(), &names).map(Some)
        }
    }
}

/// A port beside the panel: senders of Grbl or agents of MTConnect connect there.
fn port(key: &'static str, name: &str, address: Option<SocketAddr>, quiet: bool) -> anyhow::Result<Option<Listener>> {
    let Some(address) = address else { return Ok(None) };
    let listener = Listener::bind(address).context(key)?;
    let told = format!("{name}: {}\n", listener.address());
    match quiet {
        false => say(&told),
        true => _ = files::printed::stderr().write_all(told.as_bytes()),
    }
    Ok(Some(listener))
}

/// The way into the service.
struct Way(Door);

impl ::panel::Control for Way {
    fn connect(&self, guest: &Guest) -> io::Result<UnixStream> {
        self.0.enter(guest.role, &guest.name)
    }
}
