//! What a control of this program serves beside its socket: the panel, the link to a supervisor, input devices.

#[cfg(feature = "cell")]
mod cell;
mod input;
#[cfg(feature = "panel")]
pub(crate) mod panel;

use config::Config;
use operator::service::Service;
use std::net::SocketAddr;

/// What the command line says of the panel: nothing, that there is to be one, or where.
pub(crate) type Asked = Option<Option<SocketAddr>>;

/// The services of a machine, those that listen already listening. `asked`: for a panel on the command line; `quiet`: standard output is
/// for a program; `stands_by`: a supervisor may come.
///
/// # Errors
/// One that is asked for cannot be had.
pub(crate) fn of(config: &Config, asked: Asked, quiet: bool, stands_by: bool) -> anyhow::Result<Vec<Box<dyn Service>>> {
    let mut services = panel_of(config, asked, quiet)?;
    let inputs = config
        .inputs
        .iter()
        .map(|device| input::Input::of(&config.name, device));
    services.extend(inputs.map(|input| Box::new(input) as Box<dyn Service>));
    if stands_by {
        services.extend(cell_of(config)?);
    }
    Ok(services)
}

/// What the machine file says of them, judged without opening anything.
///
/// # Errors
/// A file that it names is missing or wrong, or this program was built without the service.
pub(crate) fn check(config: &Config) -> anyhow::Result<()> {
    check_panel(config)?;
    cell_of(config).map(drop)
}

#[cfg(feature = "panel")]
fn panel_of(config: &Config, asked: Asked, quiet: bool) -> anyhow::Result<Vec<Box<dyn Service>>> {
    let panel = panel::Panel::of(config, asked, quiet)?;
    Ok(panel
        .into_iter()
        .map(|panel| Box::new(panel) as Box<dyn Service>)
        .collect())
}

#[cfg(feature = "panel")]
fn check_panel(config: &Config) -> anyhow::Result<()> {
    panel::Panel::check(config)
}

#[cfg(not(feature = "panel"))]
fn panel_of(config: &Config, asked: Asked, _quiet: bool) -> anyhow::Result<Vec<Box<dyn Service>>> {
    anyhow::ensure!(
        asked.is_none() && config.panel.is_none(),
        "this isocnc was built without the panel: cargo build --features panel"
    );
    Ok(Vec::new())
}

#[cfg(not(feature = "panel"))]
fn check_panel(config: &Config) -> anyhow::Result<()> {
    panel_of(config, None, true).map(drop)
}

#[cfg(feature = "cell")]
fn cell_of(config: &Config) -> anyhow::Result<Option<Box<dyn Service>>> {
    Ok(cell::Cell::of(config)?.map(|cell| Box::new(cell) as Box<dyn Service>))
}

#[cfg(not(feature = "cell"))]
fn cell_of(config: &Config) -> anyhow::Result<Option<Box<dyn Service>>> {
    anyhow::ensure!(
        config.cell.is_none(),
        "[cell]: this isocnc was built without the link to a supervisor: cargo build --features cell"
    );
    Ok(None)
}
