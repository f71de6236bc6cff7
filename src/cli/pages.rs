//! What a shell, `man` and an editor know of isocnc.
//!
//! In:  the command line's description; the schemas of machine file and drive profile, which `tests/references` makes of their
//! readers; the methods of the control socket.
//! Out: a completion script or the schema on standard output; a page of the manual for each command.

use anyhow::Context;
use api::openrpc;
use clap::{Args, Command};
use clap_complete::Shell;
use host::terminal::say;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell that reads the script
    #[arg(value_enum)]
    shell: Shell,
}

/// Arguments of `schema`.
#[derive(Debug, Args)]
pub struct SchemaArgs {
    /// The methods of the control socket, as an OpenRPC document
    #[arg(long)]
    rpc: bool,
    /// The schema of a drive profile
    #[arg(long, conflicts_with = "rpc")]
    drive: bool,
}

/// Arguments of `man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Folder for the pages, such as ~/.local/share/man/man1; made if it is missing
    folder: PathBuf,
}

/// Prints the completion script of a shell.
///
/// # Errors
/// None.
pub fn completions(args: &CompletionsArgs, mut all: Command) -> anyhow::Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut all, "isocnc", &mut script);
    say(&with_pins(args.shell, &String::from_utf8_lossy(&script)));
    Ok(ExitCode::SUCCESS)
}

/// The script with the names of pins behind `hal get` and the like, as a running control has them.
fn with_pins(shell: Shell, script: &str) -> String {
    const BASH: &str = r#"
_isocnc_pins() {
    local cur=${COMP_WORDS[COMP_CWORD]}
    case "${COMP_WORDS[1]} ${COMP_WORDS[2]}" in
        "hal get"|"hal set"|"hal watch"|"hal scope"|"hal show"|"hal list")
            if (( COMP_CWORD > 2 )) && [[ $cur != -* ]]; then
                COMPREPLY=( $(compgen -W "$(isocnc hal list --names 2>/dev/null)" -- "$cur") )
                return 0
            fi
            ;;
    esac
    _isocnc "$@"
}
complete -F _isocnc_pins -o bashdefault -o default isocnc
"#;
    const ZSH: &str = r#"
_isocnc_pins() {
    if (( CURRENT > 3 )) && [[ ${words[2]} == hal && ${words[3]} == (get|set|watch|scope|show|list) && ${words[CURRENT]} != -* ]]; then
        local -a pins
        pins=(${(f)"$(isocnc hal list --names 2>/dev/null)"})
        compadd -a pins
    else
        _isocnc "$@"
    fi
}
compdef _isocnc_pins isocnc
"#;
    const FISH: &str = r#"
complete -c isocnc -n "__fish_seen_subcommand_from hal; and __fish_seen_subcommand_from get set watch scope show list" -f -a "(isocnc hal list --names 2>/dev/null)"
"#;
    match shell {
        Shell::Bash => format!("{script}{BASH}"),
        // The first time, the script is the body of the function that is called.
        Shell::Zsh => script.replacen(
            "if [ \"$funcstack[1]\" = \"_isocnc\" ]; then\n    _isocnc \"$@\"\nelse\n    compdef _isocnc isocnc\nfi",
            &format!("{ZSH}if [ \"$funcstack[1]\" = \"_isocnc\" ]; then\n    _isocnc_pins \"$@\"\nfi"),
            1,
        ),
        Shell::Fish => format!("{script}{FISH}"),
        // Elvish and PowerShell have the names of commands and options.
        _ => script.to_owned(),
    }
}

/// Prints the schema of the machine file or of a drive profile, or the methods of the control socket.
///
/// # Errors
/// None.
pub fn schema(args: &SchemaArgs) -> anyhow::Result<ExitCode> {
    match (args.rpc, args.drive) {
        (true, _) => say(&format!("{:#}\n", openrpc::document())),
        (false, true) => say(include_str!("../../drives/profile.schema.json")),
        (false, false) => say(include_str!("../../configs/machine.schema.json")),
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes a page for each command.
///
/// # Errors
/// Of the file system.
pub fn man(args: &ManArgs, mut all: Command) -> anyhow::Result<ExitCode> {
    files::make_folder(&args.folder).with_context(|| args.folder.display().to_string())?;
    all.build();
    let count = page(&all, "isocnc", &args.folder)?;
    say(&format!("{count} pages in {}\n", args.folder.display()));
    Ok(ExitCode::SUCCESS)
}

/// The page of a command and those of the commands below it; how many these are.
fn page(command: &Command, name: &str, folder: &Path) -> anyhow::Result<usize> {
    let mut text = Vec::new();
    let named = command.clone().display_name(name.to_owned());
    clap_mangen::Man::new(named).render(&mut text)?;
    let path = folder.join(format!("{name}.1"));
    files::write(&path, text).with_context(|| path.display().to_string())?;
    let below = command.get_subcommands().filter(|below| below.get_name() != "help");
    below
        .map(|below| page(below, &format!("{name}-{}", below.get_name()), folder))
        .sum::<anyhow::Result<usize>>()
        .map(|below| 1 + below)
}
