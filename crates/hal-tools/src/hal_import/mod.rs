//! `isocnc hal import`: HAL files of LinuxCNC to `[[hal.component]]` and `[[hal.net]]` of a machine file.
//!
//! In:  HAL files, an INI file for their values, a machine file for the pins that there are.
//! Out: TOML on standard output; on standard error what could not be translated, each with its place and why, and which keys of
//! joints stand for what the INI file says of backlash and pitch errors.

mod read;
#[cfg(test)]
mod tests;

mod translate;
mod write;

use anyhow::Context;
use config::{self, Config};
use hal_pins::{Hal, Kind, Type};
use motion::kinematics::Transform;
use read::Ini;
use rt::pins::{Pins, capacity};
use rt::steps::StepDrives;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::fmt;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use terminal::print;
use terminal::refusal::Refusal;

/// The pins of this machine are known where no other is named.
const EXAMPLE: &str = include_str!("../../../../configs/mill3-demo.toml");

/// Arguments of `isocnc hal import`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Example: isocnc hal import mill.hal custom.hal --ini mill.ini > hal.toml")]
pub struct ImportArgs {
    /// HAL files, in the order in which LinuxCNC reads them
    #[arg(required = true, value_name = "FILE.hal")]
    pub files: Vec<PathBuf>,
    /// INI file with the values of `[SECTION]KEY`
    #[arg(long, value_name = "FILE.ini")]
    pub ini: Option<PathBuf>,
    /// Machine file whose pins nets may name; left out: those of an example
    #[arg(long, value_name = "MACHINE.toml")]
    pub pins: Option<PathBuf>,
}

/// Where a command stands.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    file: Rc<str>,
    line: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// A command, or a part of one, that was not translated.
#[derive(Clone, Debug, PartialEq)]
struct Refused {
    place: Place,
    text: String,
    why: String,
}

/// What came of HAL files.
struct Translation {
    toml: String,
    /// Commands that are in it.
    translated: usize,
    /// Commands that nothing is lost by, such as `start`.
    needless: usize,
    /// In the order of the files.
    refused: Vec<Refused>,
    /// Pins that mean something else here; what of the INI file is no HAL and has keys of its own.
    notes: Vec<String>,
}

impl Translation {
    fn to_json(&self) -> Json {
        let refused = self.refused.iter().map(|refused| {
            let Refused { place, text, why } = refused;
            json!({ "file": &*place.file, "line": place.line, "command": text, "why": why })
        });
        json!({
            "toml": self.toml,
            "translated": self.translated,
            "needless": self.needless,
            "refused": refused.collect::<Vec<_>>(),
            "notes": self.notes,
        })
    }

    /// What was not translated, for people.
    fn report(&self) -> String {
        let mut text = String::new();
        for Refused {
            place,
            text: command,
            why,
        } in &self.refused
        {
            text += &format!("{place}: {command}: {why}\n");
        }
        for note in &self.notes {
            text += &format!("{note}\n");
        }
        let (translated, needless) = (self.translated, self.needless);
        // Commands, not the parts of them that are told one by one.
        let mut places: Vec<&Place> = self.refused.iter().map(|refused| &refused.place).collect();
        places.dedup();
        let refused = places.len();
        text + &format!(
            "{translated} commands translated, {needless} not needed here, {refused} not or not wholly translated\n"
        )
    }
}

/// A pin as far as nets must know it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct KnownPin {
    is_output: bool,
    value_type: Type,
}

/// The control's own pins. Numbers and letters of joints and axes may be others than in the machine that they were taken from.
struct OwnPins {
    exact: BTreeMap<String, KnownPin>,
    general: BTreeMap<String, KnownPin>,
    /// Period of the cycle.
    cycle_ns: u64,
    /// The word of `machine.kinematics`.
    kinematics: &'static str,
}

impl OwnPins {
    fn new(config: &Config) -> anyhow::Result<OwnPins> {
        static IMPORTS: AtomicU64 = AtomicU64::new(0);
        let name = format!("import-{}-{}", std::process::id(), IMPORTS.fetch_add(1, Relaxed));
        let mut hal = Hal::create_in(&[std::env::temp_dir()], &name, capacity(config))?;
        Pins::new(&mut hal, config, &bus::plan(config), &StepDrives::new(config))?;
        let mut exact = BTreeMap::new();
        for pin in hal.list() {
            if pin.kind != Kind::Net {
                let (is_output, value_type) = (pin.kind == Kind::Output, pin.value_type());
                exact.insert(pin.name, KnownPin { is_output, value_type });
            }
        }
        let general = exact.iter().map(|(name, pin)| (general(name), *pin)).collect();
        Ok(OwnPins {
            exact,
            general,
            cycle_ns: u64::from(config.cycle_us) * 1000,
            kinematics: match config.transform {
                Transform::Trivial => "trivial",
                Transform::CoreXy => "corexy",
                Transform::TableTable(_) => "table-table",
                Transform::HeadTable(_) => "head-table",
                Transform::Scara(_) => "scara",
                Transform::LinearDelta(_) => "linear-delta",
            },
        })
    }

    fn get(&self, name: &str, exactly: bool) -> Option<KnownPin> {
        let general = || self.general.get(&general(name)).filter(|_| !exactly);
        self.exact.get(name).or_else(general).copied()
    }

    fn nearest(&self, name: &str) -> Option<&str> {
        hal_pins::nearest(name, self.exact.keys().map(String::as_str))
    }
}

/// The name with `N` for numbers and `L` for the letter of an axis.
fn general(name: &str) -> String {
    let mut levels: Vec<String> = name.split('.').map(str::to_owned).collect();
    if let [first, letter, ..] = &mut levels[..]
        && first == "axis"
    {
        *letter = "L".to_owned();
    }
    let digits = |c: char| if c.is_ascii_digit() { 'N' } else { c };
    levels.join(".").chars().map(digits).collect()
}

/// Runs the command.
///
/// # Errors
/// Files that cannot be read; a machine file with errors.
pub fn import(args: &ImportArgs, as_json: bool) -> anyhow::Result<ExitCode> {
    let config = match &args.pins {
        Some(path) => bus::read(path).map_err(Refusal::from)?,
        None => config::parse(EXAMPLE, Path::new("example.toml")).map_err(Refusal::from)?,
    };
    let ini = match &args.ini {
        Some(path) => Ini::read(path).context("INI file")?,
        None => Ini::default(),
    };
    let translation = translated(&args.files, &ini, &OwnPins::new(&config)?, args.pins.is_some())?;
    if as_json {
        print(&format!("{:#}\n", translation.to_json()))?;
    } else {
        print(&translation.toml)?;
        let _ = write!(files::printed::stderr(), "{}", translation.report());
    }
    Ok(ExitCode::SUCCESS)
}

fn translated(paths: &[PathBuf], ini: &Ini, own: &OwnPins, exactly: bool) -> anyhow::Result<Translation> {
    let mut refused = Vec::new();
    let mut commands = Vec::new();
    for path in paths {
        if path.extension().is_some_and(|extension| extension == "tcl") {
            anyhow::bail!(
                "{}: is a program; run `halcmd save` under LinuxCNC and import what it writes",
                path.display()
            );
        }
        commands.extend(read::read(path, ini, &|name| std::env::var(name).ok(), &mut refused)?);
    }
    let mut translation = translate::translate(&commands, own, exactly, refused);
    translation.notes.extend(ini.compensation());
    let is_told = |refused: &Refused| refused.text.contains("SERVO_PERIOD");
    if let Some(period_ns) = ini.servo_period_ns().filter(|period_ns| *period_ns != own.cycle_ns)
        && !translation.refused.iter().any(is_told)
    {
        let note = translate::other_period(period_ns, own.cycle_ns);
        translation.notes.push(format!("[EMCMOT]SERVO_PERIOD: {note}"));
    }
    Ok(translation)
}
