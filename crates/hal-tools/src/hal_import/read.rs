//! HAL files to commands: comments, continued lines, quotes, values of an INI file and of the environment, files that are included.
//!
//! In:  text of HAL files, an INI file.
//! Out: commands as words, each with its place; what cannot be read, with its place.

use super::{Place, Refused};
use anyhow::Context as _;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Files that may include each other before it is a circle.
const DEPTH_MAX: usize = 16;

/// A command: its words, and where it begins.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Command {
    pub(super) place: Place,
    /// As it stands in the file, on one line.
    pub(super) text: String,
    pub(super) words: Vec<String>,
}

/// Values of `[SECTION]KEY`; the first of several counts.
#[derive(Debug, Default)]
pub(super) struct Ini(BTreeMap<(String, String), String>);

impl Ini {
    /// Of a file, with what its lines `#INCLUDE FILE` name in their places.
    ///
    /// # Errors
    /// Files that cannot be read, are too long, or include each other in a circle.
    pub(super) fn read(path: &Path) -> anyhow::Result<Ini> {
        let mut text = String::new();
        expand(path, 0, &mut text)?;
        Ok(Ini::parse(&text))
    }

    pub(super) fn parse(text: &str) -> Ini {
        let mut values = BTreeMap::new();
        let mut section = String::new();
        for line in text.lines().map(str::trim) {
            if line.starts_with(['#', ';']) {
                continue;
            }
            if let Some(name) = line.strip_prefix('[').and_then(|line| line.split(']').next()) {
                section = name.trim().to_owned();
            } else if let Some((key, value)) = line.split_once('=') {
                let key = (section.clone(), key.trim().to_owned());
                values.entry(key).or_insert_with(|| value.trim().to_owned());
            }
        }
        Ini(values)
    }

    /// Period of the servo thread.
    pub(super) fn servo_period_ns(&self) -> Option<u64> {
        self.0
            .get(&("EMCMOT".to_owned(), "SERVO_PERIOD".to_owned()))?
            .parse()
            .ok()
    }

    /// What of joints is no HAL, but keys of a machine file: their backlash and pitch errors.
    pub(super) fn compensation(&self) -> Vec<String> {
        let value = |section: &str, key: &str| self.0.get(&(section.to_owned(), key.to_owned())).map(String::as_str);
        let mut sections: Vec<&str> = self.0.keys().map(|(section, _)| section.as_str()).collect();
        sections.dedup();
        sections.retain(|section| section.starts_with("JOINT_") || section.starts_with("AXIS_"));
        let mut notes = Vec::new();
        for section in sections {
            let backlash = value(section, "BACKLASH").filter(|text| text.parse().ok() != Some(0.0));
            match (value(section, "COMP_FILE"), backlash) {
                (None, None) => {}
                (None, Some(backlash)) => notes.push(format!(
                    "[{section}]BACKLASH: write backlash_mm = {backlash} in its [[joint]]"
                )),
                (Some(file), backlash) => {
                    let kind = match value(section, "COMP_FILE_TYPE").and_then(|text| text.parse::<i64>().ok()) {
                        None | Some(0) => "positions",
                        Some(_) => "corrections",
                    };
                    notes.push(format!(
                        "[{section}]COMP_FILE: write compensation_file = {file:?} and compensation_type = {kind:?} in its [[joint]]"
                    ));
                    if backlash.is_some() {
                        notes.push(format!(
                            "[{section}]BACKLASH: LinuxCNC takes no account of it beside a COMP_FILE, and backlash_mm is refused there: \
                             leave it out"
                        ));
                    }
                }
            }
        }
        let is_inch = value("TRAJ", "LINEAR_UNITS").is_some_and(|units| units.starts_with(['i', 'I']));
        if is_inch && !notes.is_empty() {
            notes.push(
                "[TRAJ]LINEAR_UNITS: values and compensation files are in inches; here they are in mm".to_owned(),
            );
        }
        notes
    }
}

fn expand(path: &Path, depth: usize, whole: &mut String) -> anyhow::Result<()> {
    anyhow::ensure!(
        depth < DEPTH_MAX,
        "{}: files include each other in a circle",
        path.display()
    );
    let text = files::read_text(path, files::read::TEXT_MAX).with_context(|| path.display().to_string())?;
    let len = whole.len() + text.len();
    anyhow::ensure!(
        len as u64 <= files::read::TEXT_MAX,
        "{}: too long with what includes it",
        path.display()
    );
    for line in text.lines() {
        match line.trim().strip_prefix("#INCLUDE").map(str::trim) {
            Some(name) => {
                let folder = path.parent().unwrap_or(Path::new(""));
                expand(&folder.join(name), depth + 1, whole)?;
            }
            None => {
                whole.push_str(line);
                whole.push('\n');
            }
        }
    }
    Ok(())
}

/// All commands of a file and of those that it includes.
pub(super) fn read(
    path: &Path,
    ini: &Ini,
    environment: &dyn Fn(&str) -> Option<String>,
    refused: &mut Vec<Refused>,
) -> anyhow::Result<Vec<Command>> {
    let text = files::read_text(path, files::read::TEXT_MAX)?;
    let mut commands = Vec::new();
    Reader {
        ini,
        environment,
        refused,
    }
    .file(path, &text, 0, &mut commands);
    Ok(commands)
}

struct Reader<'a> {
    ini: &'a Ini,
    environment: &'a dyn Fn(&str) -> Option<String>,
    refused: &'a mut Vec<Refused>,
}

impl Reader<'_> {
    fn file(&mut self, path: &Path, text: &str, depth: usize, commands: &mut Vec<Command>) {
        let file: Rc<str> = path.display().to_string().into();
        let mut lines = text.lines().zip(1..);
        while let Some((line, number)) = lines.next() {
            let mut whole = line.trim_end().to_owned();
            while let Some(start) = whole.strip_suffix('\\') {
                whole = start.trim_end().to_owned() + " ";
                whole += lines.next().map_or("", |(line, _)| line.trim());
            }
            let place = Place {
                file: file.clone(),
                line: number,
            };
            let text = whole.trim().to_owned();
            let words = match words(&text).and_then(|words| self.substituted(words)) {
                Ok(words) if words.is_empty() => continue,
                Ok(words) => words,
                Err(why) => {
                    self.refused.push(Refused { place, text, why });
                    continue;
                }
            };
            match words[0].as_str() {
                "source" => self.include(path, Command { place, text, words }, depth, commands),
                _ => commands.push(Command { place, text, words }),
            }
        }
    }

    fn include(&mut self, from: &Path, command: Command, depth: usize, commands: &mut Vec<Command>) {
        let name = command.words.get(1).map_or("", String::as_str);
        let path: PathBuf = from.parent().unwrap_or(Path::new("")).join(name);
        let read = match depth < DEPTH_MAX {
            true => files::read_text(&path, files::read::TEXT_MAX).map_err(|error| error.to_string()),
            false => Err("files include each other".to_owned()),
        };
        match read {
            Ok(text) => self.file(&path, &text, depth + 1, commands),
            Err(why) => self.refused.push(Refused {
                place: command.place,
                text: command.text,
                why,
            }),
        }
    }

    /// Puts in the values of the INI file and of the environment.
    fn substituted(&self, words: Vec<String>) -> Result<Vec<String>, String> {
        let mut done = Vec::new();
        for word in words {
            match word.contains(['[', '$']) {
                // A value may be several words: `KINEMATICS = trivkins coordinates=xz`.
                true => done.extend(self.substitute(&word)?.split_whitespace().map(str::to_owned)),
                false => done.push(word),
            }
        }
        Ok(done)
    }

    fn substitute(&self, word: &str) -> Result<String, String> {
        let mut done = String::new();
        let mut rest = word;
        while let Some(at) = rest.find(['[', '$']) {
            done += &rest[..at];
            let found = &rest[at..];
            let (value, length) = match found.strip_prefix('[') {
                Some(inner) => self.ini_value(inner)?,
                None => self.variable(&found[1..])?,
            };
            done += &value;
            rest = &found[1 + length..];
        }
        Ok(done + rest)
    }

    /// Value of `SECTION]KEY` or `SECTION](KEY)`, and how long that is.
    fn ini_value(&self, text: &str) -> Result<(String, usize), String> {
        let (section, behind) = text.split_once(']').ok_or("`[` without `]`")?;
        let (key, length) = name(behind);
        let found = self.ini.0.get(&(section.to_owned(), key.clone())).cloned();
        let missing = || format!("[{section}]{key} is not known: name the INI file with --ini");
        Ok((found.ok_or_else(missing)?, section.len() + 1 + length))
    }

    fn variable(&self, text: &str) -> Result<(String, usize), String> {
        let (name, length) = name(text);
        let value = (self.environment)(&name);
        Ok((
            value.ok_or_else(|| format!("${name} is not in the environment"))?,
            length,
        ))
    }
}

/// A name, in brackets or as long as it is one; and how long it is with them.
fn name(text: &str) -> (String, usize) {
    if let Some((name, _)) = text.strip_prefix('(').and_then(|text| text.split_once(')')) {
        return (name.to_owned(), name.len() + 2);
    }
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let length = text.find(|c| !is_name(c)).unwrap_or(text.len());
    (text[..length].to_owned(), length)
}

/// The words of a line: quotes group, `#` begins a comment, arrows say nothing.
fn words(text: &str) -> Result<Vec<String>, String> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut quote = None;
    for c in text.chars() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (Some(_), c) => word.get_or_insert_default().push(c),
            (None, '"' | '\'') => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (None, '#') => break,
            (None, c) if c.is_whitespace() => words.extend(word.take()),
            (None, c) => word.get_or_insert_default().push(c),
        }
    }
    if quote.is_some() {
        return Err("a quotation mark without its end".to_owned());
    }
    words.extend(word);
    words.retain(|word| !matches!(word.as_str(), "=>" | "<=" | "<=>"));
    // `NAME = VALUE` is `setp NAME VALUE`.
    if let [name, equals, value] = &words[..]
        && equals == "="
    {
        words = vec!["setp".to_owned(), name.clone(), value.clone()];
    }
    Ok(words)
}
