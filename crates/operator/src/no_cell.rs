//! In the place of `cell.rs` in a program that was built without the link to a supervisor.

use anyhow::ensure;
use api::server::door::Door;
use config::Config;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// There is none.
pub(super) struct Cell;

impl Cell {
    /// None.
    ///
    /// # Errors
    /// The machine file asks for it.
    pub(super) fn of(config: &Config) -> anyhow::Result<Option<Cell>> {
        ensure!(
            config.cell.is_none(),
            "[cell]: this isocnc was built without the link to a supervisor: cargo build --features cell"
        );
        Ok(None)
    }

    /// None.
    pub(super) fn programs(&self) -> &Path {
        Path::new("")
    }

    pub(super) fn serve(&self, _door: &Door, _stop: &AtomicBool) {}
}
