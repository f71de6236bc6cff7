//! What an interpreter is told before the first line: from the machine file, tool table and parameter file.
//!
//! In:  the arguments of the command.
//! Out: [`gcode::Settings`], or every mistake of the files on standard error.

use super::InterpretArgs;
use machine::tables::{bare_tools, forget_g92};

use anyhow::Context;
use gcode::{Located, Settings, Splines, ToolChanger, ToolTable, parameter};
use motion::canon::LengthUnit;
use std::fmt::Display;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// What the command makes of its arguments.
pub(super) struct Tables {
    pub settings: Settings,
    /// Where parameters are written behind the program, if they are.
    pub write_parameters: Option<PathBuf>,
}

/// Reads all files. `None`: their mistakes were printed.
///
/// # Errors
/// A file that cannot be read.
pub(super) fn read(args: &InterpretArgs) -> anyhow::Result<Option<Tables>> {
    let mut keeps_g92 = true;
    let (mut settings, changer, tool_file, parameter_file) = match &args.machine {
        Some(path) => match bus::read(path) {
            Ok(config) => {
                let settings = program::interpreter_settings(&config, program::home(&config));
                keeps_g92 = config.program.dialect.keep_g92;
                (
                    settings,
                    config.tools.changer,
                    config.tools.table,
                    config.program.parameter_file.filter(|path| path.exists()),
                )
            }
            Err(errors) => {
                let _ = write!(files::printed::stderr(), "{errors}");
                return Ok(None);
            }
        },
        None => (stand_alone(), ToolChanger::default(), None, None),
    };
    if let Some(unit) = args.unit {
        settings.machine_unit = unit.into();
    }
    settings.splines = Splines::Nurbs;
    settings.block_delete |= args.block_delete;
    settings
        .subroutine_folders
        .splice(0..0, args.subroutines.iter().cloned());
    if args.program != Path::new("-") {
        // Beside the program first.
        let beside = args.program.parent().unwrap_or(Path::new("")).to_owned();
        settings.subroutine_folders.insert(0, beside);
    }
    if let Some(path) = args.tools.as_ref().or(tool_file.as_ref()) {
        let content = read_file(path)?;
        match ToolTable::parse(&content, settings.machine_unit, changer) {
            Ok(tools) => {
                let name = path.display().to_string();
                for passed_over in tools.passed_over() {
                    files::errln!("{}", passed_over.render_warning(&name, &content));
                }
                settings.tools = tools;
            }
            Err(errors) => return Ok(mistakes(path, &content, &errors)),
        }
    }
    if let Some(path) = args.var.as_ref().or(parameter_file.as_ref()) {
        let content = read_file(path)?;
        match parameter::file::parse(&content) {
            Ok(mut parameters) => {
                if !keeps_g92 {
                    forget_g92(&mut parameters);
                }
                settings.set_parameters(&parameters);
            }
            Err(errors) => return Ok(mistakes(path, &content, &errors)),
        }
    }
    Ok(Some(Tables {
        settings,
        write_parameters: args.write_var.clone(),
    }))
}

/// The settings of LinuxCNC's interpreter without a machine, but for tools: there are some without a table, too.
fn stand_alone() -> Settings {
    Settings {
        machine_unit: LengthUnit::Inch,
        tools: bare_tools(LengthUnit::Inch, ToolChanger::default()),
        spindles: 1,
        user_codes: Some(Vec::new()),
        ..Settings::default()
    }
}

fn read_file(path: &Path) -> anyhow::Result<Vec<u8>> {
    files::read(path, files::read::TEXT_MAX).with_context(|| path.display().to_string())
}

fn mistakes<Kind: Display, T>(path: &Path, content: &[u8], errors: &[Located<Kind>]) -> Option<T> {
    let path = path.display().to_string();
    for error in errors {
        files::errln!("{}", error.render(&path, content));
    }
    None
}
