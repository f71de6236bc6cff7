//! `isocnc input`: input devices of this PC, and what one says.
//!
//! In:  `/dev/input`. Out: a list, or a line for each change.

use ::input::{Found, list, watch};
use clap::Args;
use host::terminal::{say, table};
use std::process::ExitCode;

/// Arguments of `input`.
#[derive(Clone, Debug, Args)]
pub struct InputArgs {
    /// A part of its name, or its path: show what it says
    device: Option<String>,
}

/// Lists devices, or shows what one says until Ctrl-C.
///
/// # Errors
/// There is no such device, or it goes.
pub(super) fn input(args: &InputArgs) -> anyhow::Result<ExitCode> {
    match &args.device {
        Some(device) => watch(device, &mut files::printed::stdout()).map_err(anyhow::Error::msg)?,
        None => say(&listed(&list())),
    }
    Ok(ExitCode::SUCCESS)
}

fn listed(found: &[Found]) -> String {
    if found.is_empty() {
        return "no input device is plugged in\n".to_owned();
    }
    let rows = found.iter().map(|found| {
        let name = found.name.clone().unwrap_or_else(|why| format!("({why})"));
        // A keyboard has hundreds.
        let mut codes = found.codes.iter().take(12).cloned().collect::<Vec<_>>().join(" ");
        if found.codes.len() > 12 {
            codes += &format!(" .. {} in all", found.codes.len());
        }
        vec![found.path.display().to_string(), name, codes]
    });
    table(&["device", "name", "codes"], rows)
}
