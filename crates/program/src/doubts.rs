//! What is doubtful in a program, before it is started.
//!
//! In:  its text; the machine.
//! Out: each with its place, for whoever plans, loads or runs it. None keeps it from running.

use super::text::Reader;
use super::waits::Waits;
use super::{folder, planned_settings};
use config::{Config, UserCodes};
use gcode::{CheckLimits, DoubtKind};
use machine::tables::Tables;
use motion::cancel::Cancel;
use motion::canon::Position;
use serde::Serialize;
use std::fmt;

/// Something to be looked at before a program is started; shown with its place.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Doubt {
    /// The program, or the file of a subroutine.
    pub file: String,
    /// Line, counted from 1.
    pub line: u32,
    /// What is doubtful, in words.
    pub doubt: String,
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.doubt)
    }
}

/// Doubts about a program that begins at a machine position, in order of their lines. `path`: of the program.
pub fn doubts(
    config: &Config,
    tables: &Tables,
    (path, text): (&str, Reader<'_>),
    at: Position,
    cancel: &Cancel,
) -> Vec<Doubt> {
    let mut settings = planned_settings(config, tables, at);
    if let Some(folder) = folder(path) {
        settings.subroutine_folders.insert(0, folder.to_owned());
    }
    let limits = CheckLimits {
        cancel: cancel.clone(),
        ..CheckLimits::default()
    };
    let mut found = gcode::doubts(text, settings, Waits::new(UserCodes::default()).1, limits);
    found.retain(|doubt| match doubt.kind {
        DoubtKind::ManySpeeds { .. } => config.spindle.wait_for_speed,
        DoubtKind::LongDwell { .. } | DoubtKind::DrillsNothing | DoubtKind::SpindleStands { .. } => true,
    });
    found.sort_by_key(|doubt| doubt.line);
    let file = |name: &str| if name.is_empty() { path } else { name }.to_owned();
    let told = found.iter().map(|doubt| Doubt {
        file: file(&doubt.file),
        line: doubt.line,
        doubt: doubt.kind.to_string(),
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn what_a_machine_does_not_wait_for_is_no_doubt_on_it() {
        let text = include_str!("../../../configs/mill3-demo.toml");
        let mut config = config::parse(text, Path::new("demo.toml")).unwrap();
        let tables = Tables::read(&config).unwrap();
        let raster =
            "G21 F600 M3 S1\n#1 = 0\no1 repeat [60]\n#1 = [#1 + 1]\nG1 X[#1] S[#1 + 1]\no1 endrepeat\nG4 P61\nM2\n";
        let mut told = |waits: bool| {
            config.spindle.wait_for_speed = waits;
            let found = doubts(
                &config,
                &tables,
                ("p.ngc", raster.into()),
                Position::ZERO,
                &Cancel::default(),
            );
            found.iter().map(|doubt| doubt.line).collect::<Vec<_>>()
        };
        assert_eq!(told(true), [5, 7]);
        assert_eq!(told(false), [7]);
    }
}
