//! Two or more settings side by side.
//!
//! In:  what is to be another one in the machine file, or another machine file; reports of a program planned with each.
//! Out: machines; a table for people, or JSON.

use super::report::Report;
use config::{self, Config};
use serde::Serialize;
use std::fmt;
use std::path::Path;
use terminal::refusal::Refusal;
use toml::{Table, Value};

/// Longest machine file, octets.
const TEXT_MAX: u64 = 16 << 20;

/// The machine with other settings: `KEY=VALUE[,KEY=VALUE...]`, keys as in the machine file with dots between them and numbers for
/// the tables of a list (`joint.0.limits...`); or all of another machine file.
///
/// # Errors
/// A file that cannot be read, a key that does not exist, a value that cannot be.
pub(super) fn machine(file: &Path, setting: &str) -> Result<Config, Refusal> {
    if !setting.contains('=') {
        return Ok(bus::read(Path::new(setting))?);
    }
    let refused =
        |what: &dyn fmt::Display| Refusal::of_file(&file.display().to_string(), format!("--compare {setting}: {what}"));
    let text = files::read_text(file, TEXT_MAX).map_err(|error| refused(&error))?;
    let mut table: Table = text
        .parse()
        .map_err(|error: toml::de::Error| refused(&error.message()))?;
    for (key, value) in settings(setting) {
        set(&mut table, key, value).map_err(|what| refused(&what))?;
    }
    let text = toml::to_string(&table).map_err(|error| refused(&error))?;
    let config = config::parse(&text, file).map_err(|errors| refused(&errors))?;
    bus::check(&config).map_err(|errors| refused(&errors))?;
    Ok(config)
}

/// Keys and values; a comma in a value (a list) is one that no key follows.
fn settings(text: &str) -> Vec<(&str, &str)> {
    let mut all = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let (key, value) = rest.split_once('=').unwrap_or((rest, ""));
        let comma = value.match_indices(',').map(|(at, _)| at).find(|&at| {
            let next = &value[at + 1..];
            let name = next.split('=').next().unwrap_or_default();
            next.contains('=') && !name.contains([',', '[', ']', '"'])
        });
        let end = comma.unwrap_or(value.len());
        all.push((key.trim(), value[..end].trim()));
        rest = value.get(end + 1..).unwrap_or_default();
    }
    all
}

fn set(table: &mut Table, key: &str, text: &str) -> Result<(), String> {
    // What is no value of TOML is a word.
    let value = format!("value = {text}").parse::<Table>().ok();
    let value = value
        .filter(|own| own.len() == 1)
        .and_then(|mut own| own.remove("value"))
        .unwrap_or_else(|| Value::String(text.to_owned()));
    let (path, last) = match key.rsplit_once('.') {
        Some((path, last)) => (path.split('.').collect(), last),
        None => (Vec::new(), key),
    };
    let (first, path) = match path.split_first() {
        Some((first, rest)) => (*first, rest),
        None => return Err(format!("{key}: expected SECTION.KEY=VALUE, or another machine file")),
    };
    let mut at = (table.entry(first.to_owned())).or_insert_with(|| Value::Table(Table::new()));
    for name in path {
        at = match at {
            Value::Table(table) => (table.entry((*name).to_owned())).or_insert_with(|| Value::Table(Table::new())),
            Value::Array(list) => {
                let count = list.len();
                let place = name.parse::<usize>().ok();
                (place.and_then(|place| list.get_mut(place)))
                    .ok_or_else(|| format!("{key}: expected a number below {count} in place of \"{name}\""))?
            }
            _ => return Err(format!("{key}: there is nothing below \"{name}\"")),
        };
    }
    match at {
        Value::Table(table) => {
            table.insert(last.to_owned(), value);
            Ok(())
        }
        Value::Array(list) => Err(format!(
            "{key}: expected the number of one of {}, from 0 on",
            list.len()
        )),
        _ => Err(format!("{key}: there is no such table")),
    }
}

/// A setting, and what comes of it.
#[derive(Debug, Serialize)]
pub(super) struct Compared {
    /// `as given` or what differs.
    pub(super) setting: String,
    #[serde(flatten)]
    pub(super) report: Report,
}

/// All of them, the one as given first.
#[derive(Debug, Serialize)]
pub(super) struct Comparison {
    pub(super) compare: Vec<Compared>,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, Compared { setting, .. }) in (1..).zip(&self.compare) {
            writeln!(f, "{number}: {setting}")?;
        }
        let names = ["", "planner"].into_iter().chain(Report::COMPARED);
        let columns: Vec<Vec<String>> = (1..)
            .zip(&self.compare)
            .map(|(number, own): (u32, &Compared)| {
                let cells = own.report.compared();
                std::iter::once(number.to_string()).chain(cells).collect()
            })
            .collect();
        for (row, name) in names.enumerate() {
            write!(f, "{name:20}")?;
            for column in &columns {
                write!(f, "  {:>10}", column[row])?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::plan::PlannerKind;

    fn demo() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/mill3-demo.toml")
    }

    #[test]
    fn keys_of_the_machine_file_are_set_and_the_rest_stays() {
        let plain = bus::read(&demo()).unwrap();
        let other = machine(
            &demo(),
            "program.planner=classic, program.tolerance_mm=0.05,joint.1.travel_mm=[-1, 100.5]",
        )
        .unwrap();
        assert_eq!(other.program.planner, PlannerKind::Classic);
        assert_eq!(other.program.tolerance_mm, 0.05);
        assert_eq!(other.joints[1].travel_mm, [-1.0, 100.5]);
        assert_eq!(other.joints[0].travel_mm, plain.joints[0].travel_mm);
        assert_eq!(other.joints[2].limits, plain.joints[2].limits);
        let same = machine(&demo(), demo().to_str().unwrap()).unwrap();
        assert_eq!(same.program.planner, plain.program.planner);
    }

    #[test]
    fn what_cannot_be_set_is_refused_by_its_name() {
        for (setting, words) in [
            ("program.planer=classic", "program.planer=classic"),
            ("program.planner=clasic", "classic"),
            ("planner=classic", "expected SECTION.KEY=VALUE"),
            ("joint.7.travel_mm=[0, 1]", "expected a number below 3"),
            ("joint.travel_mm=[0, 1]", "expected the number of one of 3"),
            ("machine.name.x=1", "no such table"),
            ("=", "expected SECTION.KEY=VALUE"),
            ("/nowhere.toml", "/nowhere.toml"),
        ] {
            let refusal = machine(&demo(), setting).map(|_| ()).expect_err(setting);
            assert!(refusal.text.contains(words), "{setting}: {}", refusal.text);
        }
    }

    #[test]
    fn settings_are_split_at_keys_only() {
        assert_eq!(
            settings("a.b=[1,2],c.d=x,y,e.f=\"u\""),
            [("a.b", "[1,2]"), ("c.d", "x,y"), ("e.f", "\"u\"")]
        );
    }
}
