//! `isocnc panel`: tokens of the operator panel in the browser.

use crate::services::panel::scheme;
use ::panel::{Role, TokenFile};
use anyhow::{Context, ensure};
use clap::{Args, Subcommand};
use config::{Encryption, Panel};
use host::terminal::say;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// Arguments of `panel`.
#[derive(Debug, Args)]
pub struct PanelArgs {
    #[command(subcommand)]
    command: PanelCommand,
}

#[derive(Debug, Subcommand)]
enum PanelCommand {
    /// Make a token for a device elsewhere, and show it once.
    #[command(after_help = "Example: isocnc panel token machine.toml --name tablet --role watch")]
    Token {
        /// Machine file.
        machine: PathBuf,
        /// Whose it is; one of the same name goes.
        #[arg(long, default_value = "panel")]
        name: String,
        /// What whoever has it may do: watch, operate, set-up.
        #[arg(long, default_value = "operate")]
        role: Role,
    },
    /// List tokens: whose they are and what they are good for.
    #[command(after_help = "Example: isocnc panel list machine.toml")]
    List {
        /// Machine file.
        machine: PathBuf,
    },
    /// Take a token away; whoever has come in with it goes.
    #[command(after_help = "Example: isocnc panel revoke machine.toml tablet")]
    Revoke {
        /// Machine file.
        machine: PathBuf,
        /// Whose it is.
        name: String,
    },
}

/// Makes, lists and revokes tokens.
pub fn panel(args: &PanelArgs) -> anyhow::Result<ExitCode> {
    match &args.command {
        PanelCommand::Token { machine, name, role } => {
            let (file, address) = token_file(machine)?;
            if let Some(folder) = file.path().parent().filter(|folder| !folder.as_os_str().is_empty()) {
                files::make_folder(folder).with_context(|| folder.display().to_string())?;
            }
            let secret = file.add(name, *role)?;
            say(&format!("{secret}\n"));
            files::errln!("it is shown once; the address with it: {address}/#token={secret}");
        }
        PanelCommand::List { machine } => {
            for token in token_file(machine)?.0.read()? {
                say(&format!("{:<24} {}\n", token.name, token.role.name()));
            }
        }
        PanelCommand::Revoke { machine, name } => {
            let (file, _) = token_file(machine)?;
            let path = file.path().display().to_string();
            ensure!(file.revoke(name)?, "{path}: there is no token of the name \"{name}\"");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The file of tokens of a machine, and where its panel listens.
fn token_file(machine: &Path) -> anyhow::Result<(TokenFile, String)> {
    let config = bus::read(machine).map_err(Refusal::from)?;
    let folder = config.state_directory.as_deref();
    let panel = config.panel.unwrap_or_else(|| Panel::at(Panel::loopback(), folder));
    let file = panel.tokens.with_context(|| {
        let machine = machine.display();
        format!("{machine}: names no file for tokens: [panel] tokens = \"FILE\", or machine.state_directory")
    })?;
    let scheme = scheme(panel.encryption != Encryption::None);
    Ok((TokenFile::new(&file), format!("{scheme}://{}", panel.address)))
}
