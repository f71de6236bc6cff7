//! A program with all that belongs to it.
//!
//! In:  a folder of `tests/corpus`: `program.ngc`; where the case needs them `tool.tbl`, `parameters.var`, `case.toml`
//!      ([`Options`]) and subroutine files. Or a generated text.
//! Out: [`Case`], for the oracle and for our interpreter.

use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

const TOOL_TABLE: &str = include_str!("tool.tbl");
const PARAMETERS: &str = include_str!("parameters.var");

/// Files of a case that tell what is expected or how it is run, and are no part of what the program sees.
const EXPECTATIONS: [&str; 5] = [
    "case.toml",
    "expected.canon",
    "expected.err",
    "expected.var",
    "expected.print",
];

/// What `case.toml` says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Lines that begin with a stroke are left out.
    pub block_delete: bool,
    /// Lines with errors are left out instead of ending the program.
    pub continue_after_error: bool,
    /// The parameter file afterwards is part of what is expected.
    pub parameters_after: bool,
    /// Settings by the section and the key that LinuxCNC's INI file has for them.
    pub ini: BTreeMap<String, BTreeMap<String, String>>,
}

/// A program, its tables and its settings.
#[derive(Clone, Debug)]
pub struct Case {
    pub name: String,
    pub program: Vec<u8>,
    pub tool_table: String,
    pub parameters: String,
    pub options: Options,
    /// Subroutine files: path relative to the program, text.
    pub files: Vec<(PathBuf, Vec<u8>)>,
}

impl Case {
    /// A text with the usual tables.
    pub fn of_text(name: &str, program: &str) -> Case {
        Case {
            name: name.to_owned(),
            program: program.as_bytes().to_vec(),
            tool_table: TOOL_TABLE.to_owned(),
            parameters: PARAMETERS.to_owned(),
            options: Options::default(),
            files: Vec::new(),
        }
    }

    /// The case in a folder of the corpus.
    pub fn load(folder: &Path) -> Case {
        let name = folder
            .file_name()
            .expect("a case's name")
            .to_string_lossy()
            .into_owned();
        let read = |file: &str| match fs::read_to_string(folder.join(file)) {
            Ok(text) => Some(text),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => panic!("{name}/{file}: {error}"),
        };
        let mut files = Vec::new();
        collect(folder, Path::new(""), &mut files);
        Case {
            program: fs::read(folder.join("program.ngc")).unwrap_or_else(|error| panic!("{name}/program.ngc: {error}")),
            tool_table: read("tool.tbl").unwrap_or_else(|| TOOL_TABLE.to_owned()),
            parameters: read("parameters.var").unwrap_or_else(|| PARAMETERS.to_owned()),
            options: read("case.toml").map_or_else(Options::default, |text| options(&name, &text)),
            files,
            name,
        }
    }

    /// Writes what the program sees into a folder.
    pub fn write_to(&self, folder: &Path) {
        let write = |file: &Path, text: &[u8]| {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder of the case");
            fs::write(path, text).expect("a file of the case");
        };
        write(Path::new("program.ngc"), &self.program);
        write(Path::new("tool.tbl"), self.tool_table.as_bytes());
        write(Path::new("parameters.var"), self.parameters.as_bytes());
        for (file, text) in &self.files {
            write(file, text);
        }
    }

    /// The settings as LinuxCNC reads them.
    pub fn ini_file(&self) -> String {
        let mut text = String::new();
        for (section, keys) in &self.options.ini {
            text.push_str(&format!("[{section}]\n"));
            for (key, value) in keys {
                text.push_str(&format!("{key} = {value}\n"));
            }
        }
        text
    }

    /// Every line of the program and its files, without blanks around it.
    pub fn all_lines(&self) -> Vec<String> {
        let texts = [&self.program]
            .into_iter()
            .chain(self.files.iter().map(|(_, text)| text));
        texts
            .flat_map(|text| {
                let text = String::from_utf8_lossy(text).into_owned();
                text.lines().map(|line| line.trim().to_owned()).collect::<Vec<_>>()
            })
            .collect()
    }
}

/// All cases of the corpus, by name.
pub fn corpus() -> Vec<(PathBuf, Case)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    let mut folders: Vec<PathBuf> = fs::read_dir(&root)
        .expect("tests/corpus")
        .map(|entry| entry.expect("tests/corpus").path())
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    folders
        .into_iter()
        .map(|folder| {
            let case = Case::load(&folder);
            (folder, case)
        })
        .collect()
}

fn collect(root: &Path, inside: &Path, files: &mut Vec<(PathBuf, Vec<u8>)>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(root.join(inside))
        .expect("a case's folder")
        .map(|entry| inside.join(entry.expect("a case's file").file_name()))
        .collect();
    entries.sort();
    for path in entries {
        let name = path.to_string_lossy();
        if root.join(&path).is_dir() {
            collect(root, &path, files);
        } else if !EXPECTATIONS.contains(&&*name) && !["program.ngc", "tool.tbl", "parameters.var"].contains(&&*name) {
            let text = fs::read(root.join(&path)).expect("a case's file");
            files.push((path, text));
        }
    }
}

fn options(name: &str, text: &str) -> Options {
    let table: toml::Table = text.parse().unwrap_or_else(|error| panic!("{name}/case.toml: {error}"));
    let mut options = Options::default();
    for (key, value) in &table {
        let flag = || {
            value
                .as_bool()
                .unwrap_or_else(|| panic!("{name}/case.toml: {key} is true or false"))
        };
        match key.as_str() {
            "block_delete" => options.block_delete = flag(),
            "continue_after_error" => options.continue_after_error = flag(),
            "parameters_after" => options.parameters_after = flag(),
            "ini" => {
                for (section, keys) in value
                    .as_table()
                    .unwrap_or_else(|| panic!("{name}/case.toml: ini is a table"))
                {
                    let keys = keys
                        .as_table()
                        .unwrap_or_else(|| panic!("{name}/case.toml: ini.{section} is a table"));
                    let text = |key: &str, value: &toml::Value| {
                        let value = value
                            .as_str()
                            .unwrap_or_else(|| panic!("{name}/case.toml: {key} is a text"));
                        (key.to_owned(), value.to_owned())
                    };
                    let keys = keys.iter().map(|(key, value)| text(key, value)).collect();
                    options.ini.insert(section.clone(), keys);
                }
            }
            other => panic!("{name}/case.toml: unknown key {other}"),
        }
    }
    options
}
