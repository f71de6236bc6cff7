//! What a machine remembers from program to program: its tools, and the parameters that outlive a program.
//!
//! In:  the files that the machine file names, in LinuxCNC's formats; what a program left behind.
//! Out: tools and parameters for the next program; the files, replaced as a whole (see [`super::safe_file`]).
//!
//! A file that somebody edits while the control runs counts from the next program on. Where nothing can be written, or no
//! file is named, the machine remembers until the process ends.

mod life;

pub use life::LifeChange;

use super::safe_file::{self, Files};
use config::Config;
use gcode::parameter::file as parameter_file;
use gcode::{Located, Tool, ToolChanger, ToolTable};
use life::Lives;
use motion::canon::{Axis, LengthUnit, Position};
use protocol::ToolLife;
use std::collections::BTreeMap;
use std::fmt;
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Longest file that is read, octets; a full tool table with long remarks has a tenth of it.
const FILE_MAX: u64 = 4 << 20;

/// Tools of a machine that names no tool table.
const BARE_TOOLS: std::ops::RangeInclusive<u32> = 1..=99;

/// The offset of G92 and G52, and whether it is in effect.
const G92: std::ops::RangeInclusive<u16> = 5210..=5219;

/// First parameter of the origin of G54; those of the other systems follow, 20 apart.
const ORIGINS: u16 = 5221;
/// The one in force.
const WORK_SYSTEM: u16 = ORIGINS - 1;

/// The rotation of a system, behind its origin.
const ROTATION: u16 = 9;

/// Tools and parameters, and the files that keep them.
#[derive(Clone, Debug, PartialEq)]
pub struct Tables {
    parameters: Vec<(u16, f64)>,
    tools: ToolTable,
    lives: Lives,
    /// 0: none.
    tool_in_spindle: u32,
    parameter_file: Option<Kept>,
    tool_file: Option<Kept>,
    life_file: Option<Kept>,
    /// The operator's switch: lines that begin with / are left out.
    pub block_delete: bool,
}

/// A file, and what it held when it was read or written last; `None`: it was not there.
#[derive(Clone, Debug, PartialEq)]
struct Kept {
    path: PathBuf,
    content: Option<Vec<u8>>,
}

/// Why the tables cannot be used: every mistake in a file, or that it cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TablesError {
    /// The file.
    pub file: String,
    /// Each with line and column, where it has a place.
    pub errors: Vec<(Option<[u32; 2]>, String)>,
    /// One or more messages, each with its place and the line of the file.
    shown: String,
}

impl fmt::Display for TablesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown)
    }
}

impl std::error::Error for TablesError {}

impl TablesError {
    fn unreadable(path: &Path, cause: &dyn fmt::Display) -> TablesError {
        TablesError {
            file: path.display().to_string(),
            errors: vec![(None, cause.to_string())],
            shown: format!("error: {}: {cause}", path.display()),
        }
    }

    fn mistakes<Kind: fmt::Display>(path: &Path, content: &[u8], errors: &[Located<Kind>]) -> TablesError {
        let mut shown = String::new();
        let path = path.display().to_string();
        for error in errors {
            let _ = writeln!(shown, "{}", error.render(&path, content)); // a String takes everything
        }
        let _ = write!(shown, "{path}: {} in this file", count(errors.len()));
        let errors = errors
            .iter()
            .map(|error| (Some([error.line, error.column]), error.kind.to_string()));
        TablesError {
            file: path,
            errors: errors.collect(),
            shown,
        }
    }
}

fn count(errors: usize) -> String {
    match errors {
        1 => "1 error".to_owned(),
        errors => format!("{errors} errors"),
    }
}

/// Takes the offset of G92 and G52 out of parameters.
pub fn forget_g92(parameters: &mut [(u16, f64)]) {
    for (_, value) in parameters.iter_mut().filter(|(number, _)| G92.contains(number)) {
        *value = 0.0;
    }
}

impl Tables {
    /// Reads the files of a machine. A parameter file that is missing is made later; until then, and without one, the work
    /// offsets are those of the machine file.
    ///
    /// # Errors
    /// Every mistake in one of the files.
    pub fn read(config: &Config) -> Result<Tables, TablesError> {
        // What the machine file does not name lies in its state folder.
        let kept = |named: &Option<PathBuf>, name: &str| {
            let state = config.state_directory.as_ref().map(|folder| folder.join(name));
            let path = named.clone().or(state)?;
            Some(Kept { path, content: None })
        };
        let mut tables = Tables {
            parameters: default_parameters(&config.work_offsets, config.unit),
            tools: without_file(config),
            lives: Lives::default(),
            tool_in_spindle: 0,
            parameter_file: kept(&config.program.parameter_file, "parameters.var"),
            tool_file: kept(&config.tools.table, "tools.tbl"),
            life_file: kept(&None, "tool-life.json"),
            block_delete: config.program.block_delete,
        };
        tables.refresh(config)?;
        if !config.program.dialect.keep_g92 {
            forget_g92(&mut tables.parameters);
        }
        Ok(tables)
    }

    /// Reads those files again that somebody else has changed.
    ///
    /// # Errors
    /// As [`Tables::read`]; then nothing has changed.
    pub fn refresh(&mut self, config: &Config) -> Result<(), TablesError> {
        let mut fresh = self.clone();
        if let Some(kept) = &mut fresh.parameter_file
            && let Some(content) = kept.changed()?
        {
            let parsed = parameter_file::parse(&content);
            fresh.parameters = parsed.map_err(|errors| TablesError::mistakes(&kept.path, &content, &errors))?;
            kept.content = Some(content);
        }
        if let Some(kept) = &mut fresh.tool_file
            && let Some(content) = kept.changed()?
        {
            let parsed = ToolTable::parse(&content, config.unit, config.tools.changer);
            fresh.tools = parsed.map_err(|errors| TablesError::mistakes(&kept.path, &content, &errors))?;
            fresh.tools.take_wear_of(&self.tools);
            kept.content = Some(content);
        }
        if let Some(kept) = &mut fresh.life_file
            && let Some(content) = kept.changed()?
        {
            let parsed = Lives::parse(&content, &mut fresh.tools);
            fresh.lives = parsed.map_err(|error| TablesError::unreadable(&kept.path, &error))?;
            kept.content = Some(content);
        }
        *self = fresh;
        Ok(())
    }

    /// What of the files counts for nothing, each with its place.
    pub fn warnings(&self) -> Vec<String> {
        let Some(kept) = &self.tool_file else { return Vec::new() };
        let (path, passed_over) = (kept.path.display(), self.tools.passed_over());
        passed_over.iter().map(|what| format!("{path}:{what}")).collect()
    }

    /// Numbers and values of the parameters that are kept, ascending; lengths in the unit of the machine.
    pub fn parameters(&self) -> &[(u16, f64)] {
        &self.parameters
    }

    /// Rotation of the work system in force about Z.
    pub fn work_rotation_degrees(&self) -> f64 {
        self.parameter(ORIGINS + 20 * (u16::from(self.work_system()) - 1) + ROTATION)
    }

    /// The work system in force, 1 for G54 to 9 for G59.3.
    pub fn work_system(&self) -> u8 {
        self.parameter(WORK_SYSTEM).clamp(1.0, 9.0) as u8
    }

    /// Has another work system in force, 1 for G54 to 9 for G59.3.
    pub fn set_work_system(&mut self, system: u8) {
        let value = f64::from(system);
        match self.parameters.binary_search_by_key(&WORK_SYSTEM, |entry| entry.0) {
            Ok(at) => self.parameters[at].1 = value,
            Err(at) => self.parameters.insert(at, (WORK_SYSTEM, value)),
        }
    }

    /// The value of a parameter that is kept; 0 for others.
    fn parameter(&self, number: u16) -> f64 {
        let found = self.parameters.binary_search_by_key(&number, |entry| entry.0);
        found.map_or(0.0, |at| self.parameters[at].1)
    }

    /// Origin of the work system in force, and the offset of G92 as far as it is; mm and degrees.
    pub fn work_offset(&self, unit: LengthUnit) -> [Position; 2] {
        let value = |number: u16| self.parameter(number);
        let position = |first: u16| {
            Position(Axis::ALL.map(|axis| {
                let scale = if axis.is_rotary() { 1.0 } else { unit.mm() };
                value(first + axis as u16) * scale
            }))
        };
        let system = u16::from(self.work_system());
        let is_suspended = value(*G92.start()) == 0.0;
        let g92 = if is_suspended {
            Position::ZERO
        } else {
            position(G92.start() + 1)
        };
        [position(ORIGINS + 20 * (system - 1)), g92]
    }

    /// Whether a file keeps any of it.
    pub fn has_files(&self) -> bool {
        self.parameter_file.is_some() || self.tool_file.is_some()
    }

    pub fn tools(&self) -> &ToolTable {
        &self.tools
    }

    /// The same for a program that begins now: tools whose life is over give way to their sisters.
    pub fn tools_to_call(&self) -> ToolTable {
        let mut tools = self.tools.clone();
        tools.set_sisters(self.sisters());
        tools
    }

    /// The tools that are called in the place of those whose life is over.
    pub fn sisters(&self) -> BTreeMap<u32, u32> {
        self.lives.sisters(&self.tools)
    }

    /// How long a tool may be used, and has been.
    pub fn life(&self, tool: u32) -> ToolLife {
        self.lives.of(tool)
    }

    /// Sets it.
    pub fn set_life(&mut self, tool: u32, change: &LifeChange) {
        self.lives.change(tool, change);
    }

    /// A tool was used. Whether its life is over by that.
    pub fn use_up(&mut self, tool: u32, minutes: f64, parts: u32) -> bool {
        self.lives.use_up(tool, minutes, parts)
    }

    /// Number of the tool in the spindle, 0: none. Of a random changer that of pocket 0.
    pub fn tool_in_spindle(&self) -> u32 {
        match self.tools.changer() {
            ToolChanger::Fixed => self.tool_in_spindle,
            ToolChanger::Random => self.tools.in_pocket(0).map_or(0, |tool| tool.number),
        }
    }

    /// Takes what a program left behind, but for the tool in the spindle: only the machine knows how far a program came.
    pub fn adopt(&mut self, left: gcode::Settings) {
        self.parameters = left.parameters.into_iter().collect();
        // What lines said that were read, and no more than that, is no change of a tool.
        let before = std::mem::replace(&mut self.tools, left.tools);
        if self.tools.changer() == ToolChanger::Random {
            self.tools.take_pockets_of(&before);
        }
    }

    /// The machine has put a tool into its spindle.
    pub fn tool_changed(&mut self, tool: u32) {
        self.tool_in_spindle = tool;
        if self.tools.changer() == ToolChanger::Random
            && let Some(pocket) = self.tools.by_number(tool).map(|tool| tool.pocket)
        {
            self.tools.swap_pockets(0, pocket);
        }
    }

    /// The machine changed its tool.
    pub fn set_tool_in_spindle(&mut self, tool: u32) {
        self.tool_in_spindle = tool;
    }

    /// What the files must hold.
    fn contents(&self) -> [Option<(&Kept, String)>; 3] {
        let parameters = self.parameter_file.as_ref();
        let tools = self.tool_file.as_ref();
        [
            parameters.map(|kept| (kept, parameter_file::write(&self.parameters))),
            tools.map(|kept| (kept, self.tools.write())),
            self.life_file
                .as_ref()
                .map(|kept| (kept, self.lives.write(&self.tools)))
                .filter(|(kept, text)| kept.content.is_some() || !text.is_empty()),
        ]
    }

    /// Notes what a file holds now.
    fn saved(&mut self, path: &Path, content: Vec<u8>) {
        let files = [&mut self.parameter_file, &mut self.tool_file, &mut self.life_file];
        if let Some(kept) = files.into_iter().flatten().find(|kept| kept.path == path) {
            kept.content = Some(content);
        }
    }
}

impl Kept {
    /// The content of the file if it is not the one that is known.
    fn changed(&self) -> Result<Option<Vec<u8>>, TablesError> {
        let content = match files::read(&self.path, FILE_MAX) {
            Ok(content) => content,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(TablesError::unreadable(&self.path, &error)),
        };
        Ok(Some(content).filter(|content| self.content.as_ref() != Some(content)))
    }
}

/// The parameters of a machine without a file: all 0, but G54 is active and its like have the origins of the machine file.
fn default_parameters(origins: &[Position; 9], unit: LengthUnit) -> Vec<(u16, f64)> {
    let mut parameters: Vec<(u16, f64)> = parameter_file::required().map(|number| (number, 0.0)).collect();
    let mut set = |number: u16, value: f64| {
        if let Ok(at) = parameters.binary_search_by_key(&number, |entry| entry.0) {
            parameters[at].1 = value;
        }
    };
    set(WORK_SYSTEM, 1.0);
    for (first, origin) in (ORIGINS..).step_by(20).zip(origins) {
        for (number, axis) in (first..).zip(Axis::ALL) {
            let scale = if axis.is_rotary() { 1.0 } else { unit.mm() };
            set(number, origin[axis] / scale);
        }
    }
    parameters
}

/// The tools before a table is read: none where the machine file names one; else some that can be called and changed, and
/// have neither length nor diameter.
pub fn without_file(config: &Config) -> ToolTable {
    if config.tools.table.is_some() {
        return ToolTable::new(config.unit, config.tools.changer);
    }
    bare_tools(config.unit, config.tools.changer)
}

/// Tools without measures, so that programs without a table can call them.
pub fn bare_tools(unit: LengthUnit, changer: ToolChanger) -> ToolTable {
    let mut tools = ToolTable::new(unit, changer);
    for number in BARE_TOOLS {
        let tool = Tool {
            number,
            pocket: number,
            ..Tool::default()
        };
        let set = tools.set(tool);
        debug_assert_eq!(set, Ok(()), "each number once, far fewer than a table holds");
    }
    tools
}

/// The tables for more than one thread; one that panicked leaves them whole.
pub fn lock(tables: &Mutex<Tables>) -> MutexGuard<'_, Tables> {
    tables.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes the files whose content has changed. The tables are not locked while the disk works.
///
/// # Errors
/// What cannot be written, by file; the other file is written all the same.
pub fn save(disk: &mut impl Files, tables: &Mutex<Tables>) -> Result<(), String> {
    let contents = lock(tables).contents().map(|content| {
        let (kept, text) = content?;
        let text = text.into_bytes();
        (kept.content.as_ref() != Some(&text)).then(|| (kept.path.clone(), text))
    });
    let mut errors = Vec::new();
    for (path, content) in contents.into_iter().flatten() {
        // A link of one's own stays a link: the file behind it is replaced.
        let replaced = files::hold(&path).and_then(|held| safe_file::replace(disk, held.path(), &content));
        match replaced {
            Ok(_) => lock(tables).saved(&path, content),
            Err(error) => errors.push(format!("{}: {error}", path.display())),
        }
    }
    if errors.is_empty() {
        return Ok(());
    }
    Err(format!(
        "{}; the machine remembers until this process ends",
        errors.join("; ")
    ))
}

#[cfg(test)]
mod tests;
