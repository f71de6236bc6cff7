//! In the place of `panel.rs` in a program that was built without the panel.

use anyhow::ensure;
use api::server::door::Door;
use config::Config;
use std::net::SocketAddr;
use std::os::unix::net::UnixStream;
use std::path::Path;

/// There is none.
pub struct Panel {
    /// What the journal is to be told.
    pub note: String,
}

/// What the command line says of the panel: nothing, that there is to be one, or where.
pub type Asked = Option<Option<SocketAddr>>;

impl Panel {
    /// None.
    ///
    /// # Errors
    /// The machine file or the command line asks for it.
    pub fn of(config: &Config, asked: Asked, _quiet: bool) -> anyhow::Result<Option<Panel>> {
        let is_wanted = asked.is_some() || config.panel.is_some();
        ensure!(
            !is_wanted,
            "this isocnc was built without the panel: cargo build --features panel"
        );
        Ok(None)
    }

    /// None.
    ///
    /// # Errors
    /// The machine file asks for it.
    pub fn check(config: &Config) -> anyhow::Result<()> {
        Panel::of(config, None, true).map(drop)
    }

    /// None.
    pub fn programs(&self) -> Option<&Path> {
        None
    }

    pub(super) fn serve(&self, _door: Door, _until: UnixStream) {}
}
