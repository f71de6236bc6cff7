//! `docs/machine-file.md` and `configs/machine.schema.json`: the keys of the machine file, from what its readers ask.
//!
//! The readers read the files that ship, and then changes of them: each key with a value of no type that any key has, each word
//! and each end of a range. So every reader that any file can reach asks for all that it knows.

use super::{ByHand, check, code, compare, head, root, row};
use isocnc::config::{self, Bound, Question};
use serde_json::{Value as Json, json};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use toml::{Table, Value};

const SCHEMA: &str = "configs/machine.schema.json";

/// The machine files that ship.
pub(crate) fn shipped() -> Vec<PathBuf> {
    let folder = std::fs::read_dir(root("configs")).expect("configs");
    let mut files: Vec<PathBuf> = folder.map(|entry| entry.expect("an entry").path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    // It is of no machine: isocnc-cell plan reads it.
    files.retain(|path| !path.ends_with("cell-cost.toml"));
    files.sort();
    assert!(files.len() > 5, "{files:?}");
    files
}

/// What is in no file that ships and is only read where all of it is there.
const MORE: &str = r#"
[program.values.limits]
reach = 1.0
[program.pins]
ready = 1.0
[[bus.node.sdo]]
object = "0x2010:3"
value = 5
bits = 64
[[bus.node.cross]]
from = "y-drive"
read = "0x6064/32"
into = "0x2010:1/32"
"#;

pub(super) fn parse(text: &str) -> Table {
    text.parse().unwrap_or_else(|error| panic!("{error}"))
}

/// Keys that the reader knows only to say why they cannot be.
const REFUSED: [&str; 0] = [];

/// A value of a type that no key has.
fn date() -> Value {
    Value::Datetime("1979-05-27".parse().expect("a date"))
}

/// One step of a path such as `bus.node[0].id`.
enum Step<'p> {
    Key(&'p str),
    At(usize),
}

fn steps(path: &str) -> Vec<Step<'_>> {
    let mut steps = Vec::new();
    for part in path.split('.') {
        let mut words = part.split(['[', ']']).filter(|word| !word.is_empty());
        steps.extend(words.next().map(Step::Key));
        steps.extend(words.map(|number| Step::At(number.parse().expect("a number"))));
    }
    steps
}

fn get<'v>(mut value: &'v Value, path: &str) -> Option<&'v Value> {
    for step in steps(path) {
        value = match step {
            Step::Key(key) => value.get(key)?,
            Step::At(index) => value.get(index)?,
        };
    }
    Some(value)
}

/// The file with another value at a path; tables on the way are made.
fn with(file: &Table, path: &str, new: &Value) -> Option<Table> {
    let mut whole = Value::Table(file.clone());
    let mut value = &mut whole;
    for step in steps(path) {
        value = match step {
            Step::Key(key) => value.as_table_mut()?.entry(key).or_insert(Value::Table(Table::new())),
            Step::At(index) => value.as_array_mut()?.get_mut(index)?,
        };
    }
    *value = new.clone();
    match whole {
        Value::Table(file) => Some(file),
        _ => None,
    }
}

/// The path of a key; its name, its kind and what holds where it is left out, in words.
type Row = (String, [String; 3]);

/// What is known of a key.
#[derive(Default)]
struct Key {
    /// What is asked of it, but for whether it is there.
    asked: Vec<Question>,
    defaults: Vec<Json>,
    /// Of all places where it could stand: how many there are, and in how many it must.
    places: usize,
    required: usize,
    /// A table whose keys the user chooses.
    free: bool,
}

/// A change of a file, and the path that was changed.
struct Change {
    file: Table,
    beside: PathBuf,
    path: String,
}

#[derive(Default)]
pub(super) struct Keys {
    order: Vec<String>,
    keys: BTreeMap<String, Key>,
    /// Each key once with a value of a wrong type.
    wrong: Vec<Change>,
    /// Each whole number just outside of its range.
    outside: Vec<Change>,
    /// Each table with a key that there is not.
    unknown: Vec<Change>,
}

/// The path without the number of an item: `bus.node[].id`.
fn general(path: &str, free: &BTreeSet<String>) -> String {
    let mut found = String::new();
    for part in path.split('.') {
        let name = part.split('[').next().unwrap_or_default();
        let items = "[]".repeat(part.matches('[').count());
        let name = if free.contains(&found) { "*" } else { name };
        let dot = if found.is_empty() { "" } else { "." };
        found += &format!("{dot}{name}{items}");
    }
    found
}

/// The table that a key stands in.
fn parent(path: &str) -> &str {
    path.rsplit_once('.').map_or("", |(parent, _)| parent)
}

/// The values that are tried for a key, and whether a file with one is still as good as it was.
fn trials(question: &Question, is_there: bool) -> Vec<(Value, bool)> {
    match question {
        Question::IsThere => vec![(date(), false)],
        // Some keys are asked for by what kind of thing stands there.
        Question::Optional | Question::Required => vec![(date(), false), (Value::from(0.5), false)],
        Question::Table if !is_there => vec![(Value::Table(Table::new()), true)],
        Question::Tables if !is_there => vec![(Value::Array(vec![Value::Table(Table::new())]), true)],
        Question::Array => (1..=3)
            .map(|count| (Value::Array(vec![date(); count]), false))
            .collect(),
        Question::Word(words) => words.iter().map(|word| (Value::from(*word), true)).collect(),
        Question::Integer(range) => vec![(Value::from(*range.start()), false), (Value::from(*range.end()), false)],
        Question::Flag => vec![(Value::from(true), false), (Value::from(false), false)],
        _ => Vec::new(),
    }
}

impl Keys {
    /// Reads the files and all changes of them that may show more. `read`: what a reader asks while it reads a text, as if it stood
    /// in this file.
    pub(super) fn explore(files: Vec<(Table, PathBuf)>, read: fn(&str, &Path) -> Vec<(String, Question)>) -> Keys {
        let mut found = Keys::default();
        let mut free = BTreeSet::new();
        let mut tried = BTreeSet::new();
        let mut files: VecDeque<(Table, PathBuf, bool)> =
            files.into_iter().map(|(file, beside)| (file, beside, true)).collect();
        while let Some((file, beside, is_good)) = files.pop_front() {
            let asked = read(&file.to_string(), &beside);
            found.take(&asked, is_good, &mut free);
            let value = Value::Table(file.clone());
            for (path, question) in &asked {
                let key = general(path, &free);
                let mut change = |what: String, new: &Value| {
                    let file = tried
                        .insert((key.clone(), what))
                        .then(|| with(&file, path, new))
                        .flatten();
                    file.map(|file| Change {
                        file,
                        beside: beside.clone(),
                        path: path.clone(),
                    })
                };
                for (new, stays_good) in trials(question, get(&value, path).is_some()) {
                    let what = format!("{} {new}", matches!(question, Question::IsThere));
                    let Some(change) = change(what, &new) else {
                        continue;
                    };
                    files.push_back((change.file.clone(), beside.clone(), is_good && stays_good));
                    if matches!(
                        (question, new),
                        (Question::Optional | Question::Required, Value::Datetime(_))
                    ) {
                        found.wrong.push(change);
                    }
                }
                if let Question::Integer(range) = question {
                    let ends = [range.start().checked_sub(1), range.end().checked_add(1)];
                    for (end, name) in ends.into_iter().zip(["below", "above"]) {
                        // A range may be wider in another machine; then only that one's ends count.
                        found
                            .outside
                            .extend(end.and_then(|end| change(format!("{name} {end}"), &Value::from(end))));
                    }
                }
                if let (Question::Table, Some(Value::Table(_)), false) =
                    (question, get(&value, path), free.contains(&key))
                {
                    let path = format!("{path}.no_such_key");
                    let once = tried.insert((key, "no_such_key".into()));
                    let file = once.then(|| with(&file, &path, &Value::from(1))).flatten();
                    found.unknown.extend(file.map(|file| Change {
                        file,
                        beside: beside.clone(),
                        path,
                    }));
                }
            }
        }
        found
    }

    fn take(&mut self, asked: &[(String, Question)], is_good: bool, free: &mut BTreeSet<String>) {
        let mut places: BTreeSet<(String, String)> = BTreeSet::new();
        let mut required = BTreeSet::new();
        for (path, question) in asked {
            if *question == Question::Names {
                free.insert(general(path, free));
            }
            let name = general(path, free);
            if !self.keys.contains_key(&name) {
                self.order.push(name.clone());
            }
            let key = self.keys.entry(name.clone()).or_default();
            match question {
                Question::Optional | Question::IsThere => {}
                Question::Required => drop(required.insert((name.clone(), path.clone()))),
                Question::Default(value) if !key.defaults.contains(value) => key.defaults.push(value.clone()),
                Question::Default(_) => {}
                Question::Names => key.free = true,
                other if !key.asked.contains(other) => key.asked.push(other.clone()),
                _ => {}
            }
            // A table that is only looked into from elsewhere is no place where something must be.
            if matches!(question, Question::Required | Question::Default(_)) {
                places.insert((parent(&name).to_owned(), parent(path).to_owned()));
            }
        }
        if is_good {
            for (name, key) in &mut self.keys {
                key.places += places.iter().filter(|(table, _)| table == parent(name)).count();
                key.required += required.iter().filter(|(required, _)| required == name).count();
            }
        }
    }

    /// Keys that stand in a table, in the order in which they are read.
    fn inside<'k>(&'k self, table: &'k str) -> impl Iterator<Item = (&'k str, &'k Key)> {
        let is_key = |path: &str| !path.is_empty() && !path.ends_with("[]") && !REFUSED.contains(&path);
        let inside = move |path: &&String| parent(path) == table && is_key(path);
        let inside = self.order.iter().filter(inside);
        inside.map(|path| (path.as_str(), &self.keys[path]))
    }

    /// The table that a key is, or whose items are such tables.
    fn table_of(&self, path: &str) -> Option<String> {
        self.keys[path].asked.iter().find_map(|question| match question {
            Question::Table => Some(path.to_owned()),
            Question::Tables => Some(format!("{path}[]")),
            _ => None,
        })
    }

    pub(super) fn schema(&self, title: &str, meanings: &BTreeMap<String, String>) -> Json {
        let mut schema = self.table_schema("", meanings);
        schema["$schema"] = json!("http://json-schema.org/draft-07/schema#");
        schema["title"] = json!(title);
        schema
    }

    /// Compares the tables of a document, and the schema.
    pub(super) fn check(&self, document: &str, schema: &str, title: &str) {
        let mut meanings = BTreeMap::new();
        check(document, |by_hand: &ByHand| {
            let mut text = String::new();
            for (heading, rows) in self.tables() {
                text += &format!("{heading}\n\n{}", head(&["key", "value", "default", "meaning"]));
                for (path, [name, kind, left_out]) in rows {
                    let meaning = by_hand.cell(&heading, &name);
                    text += &row(&[&name, &kind, &left_out, meaning]);
                    meanings.insert(path, meaning.to_owned());
                }
                text.push('\n');
            }
            text
        });
        compare(schema, &format!("{:#}\n", self.schema(title, &meanings)));
    }

    fn table_schema(&self, table: &str, meanings: &BTreeMap<String, String>) -> Json {
        let (mut properties, mut required, mut rest) = (serde_json::Map::new(), Vec::new(), json!(false));
        for (path, key) in self.inside(table) {
            let name = path.rsplit('.').next().unwrap_or_default();
            let mut schema = self.key_schema(path, meanings);
            if let Some(meaning) = meanings.get(path) {
                schema["description"] = json!(meaning);
            }
            if let [default] = &key.defaults[..] {
                schema["default"] = default.clone();
            }
            if name == "*" {
                rest = schema;
                continue;
            }
            if key.required > 0 && key.required == key.places {
                required.push(name);
            }
            properties.insert(name.to_owned(), schema);
        }
        let mut schema =
            json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": rest });
        // A date is a table to a validator, with one text in it: no other name begins like its key.
        if schema["additionalProperties"]["type"].is_array() {
            schema["propertyNames"] = json!({ "pattern": "^[^$]" });
        }
        schema
    }

    fn key_schema(&self, path: &str, meanings: &BTreeMap<String, String>) -> Json {
        let key = self
            .keys
            .get(path)
            .unwrap_or_else(|| panic!("{path} is never asked for"));
        match key.first(path) {
            Question::Table => self.table_schema(path, meanings),
            Question::Tables => json!({ "type": "array", "items": self.table_schema(&format!("{path}[]"), meanings) }),
            Question::Array => json!({ "type": "array", "items": self.key_schema(&format!("{path}[]"), meanings) }),
            Question::Text => json!({ "type": "string" }),
            Question::Flag => json!({ "type": "boolean" }),
            Question::Scalar => json!({ "type": ["boolean", "number", "string"] }),
            Question::Word(_) => json!({ "enum": key.words() }),
            Question::Integer(_) | Question::Number(_) => key.range_schema(),
            other => panic!("{path}: {other:?}"),
        }
    }

    /// Type and range in words.
    fn kind(&self, path: &str) -> String {
        let key = &self.keys[path];
        match key.first(path) {
            Question::Array => format!("array of {}", self.kind(&format!("{path}[]"))),
            Question::Text => "text".to_owned(),
            Question::Flag => "`true`, `false`".to_owned(),
            Question::Scalar => "`true`, `false`, number or text".to_owned(),
            Question::Word(_) => key
                .words()
                .iter()
                .map(|word| code(&format!("{word:?}")))
                .collect::<Vec<_>>()
                .join(", "),
            _ => {
                let schema = key.range_schema();
                let end = |name: &str| schema.get(name).map(Json::to_string);
                let kind = schema["type"].as_str().unwrap_or_default();
                match (end("minimum"), end("exclusiveMinimum"), end("maximum")) {
                    (Some(least), _, Some(most)) => format!("{kind}, {least} to {most}"),
                    (None, Some(least), Some(most)) => format!("{kind}, above {least}, up to {most}"),
                    _ => kind.to_owned(),
                }
            }
        }
    }

    /// Headings and rows of all tables: key, its path, what is said of it.
    fn tables(&self) -> Vec<(String, Vec<Row>)> {
        let mut tables = vec![(String::new(), "## Top level".to_owned())];
        let mut found: Vec<(String, Vec<Row>)> = Vec::new();
        let mut before = String::new();
        while !tables.is_empty() {
            let (table, heading) = tables.remove(0);
            let mut rows = Vec::new();
            let mut below = Vec::new();
            for (path, key) in self.inside(&table) {
                if let Some(inner) = self.table_of(path) {
                    let name = inner.replace("[]", "").replace('*', "NAME");
                    let heading = match inner.ends_with("[]") {
                        true => format!("## [[{name}]]"),
                        false => format!("## [{name}]"),
                    };
                    below.push((inner, heading));
                    continue;
                }
                let left_out = match &key.defaults[..] {
                    _ if key.required > 0 && key.required == key.places => "required".to_owned(),
                    [Json::Null] | [] => "optional".to_owned(),
                    [default] => code(&default.to_string()),
                    _ => "depends".to_owned(),
                };
                let name = path.rsplit('.').next().unwrap_or_default();
                let name = if name == "*" { "NAME" } else { name };
                rows.push((path.to_owned(), [code(name), self.kind(path), left_out]));
            }
            tables.splice(0..0, below);
            let alike = |(_, last): &(String, Vec<Row>)| {
                let cells = |rows: &[Row]| rows.iter().map(|(_, cells)| cells.clone()).collect::<Vec<_>>();
                parent(&before) == parent(&table) && !rows.is_empty() && cells(last) == cells(&rows)
            };
            if found.last().is_some_and(alike) {
                // Tables that are the same are told once: work offsets.
                if let Some((first, _)) = found.last_mut() {
                    *first = format!(
                        "{} to {}",
                        first.split(" to ").next().unwrap_or_default(),
                        &heading[3..]
                    );
                }
            } else if !rows.is_empty() {
                found.push((heading, rows));
            }
            before = table;
        }
        found
    }
}

impl Key {
    /// What kind of thing it is.
    fn first(&self, path: &str) -> &Question {
        let first = self.asked.first();
        first.unwrap_or_else(|| panic!("{path}: no file that was read shows what kind of thing it is"))
    }

    fn words(&self) -> Vec<&'static str> {
        let mut words = Vec::new();
        for question in &self.asked {
            if let Question::Word(more) = question {
                words.extend(
                    more.iter()
                        .filter(|word| !words.contains(*word))
                        .copied()
                        .collect::<Vec<_>>(),
                );
            }
        }
        words
    }

    /// The widest of all ranges.
    fn range_schema(&self) -> Json {
        let (mut whole, mut least, mut most, mut above) = (true, f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY);
        for question in &self.asked {
            let (from, to) = match question {
                Question::Integer(range) => (*range.start() as f64, *range.end() as f64),
                Question::Number(bound) => {
                    whole = false;
                    match *bound {
                        Bound::Size(size) => (-size, size),
                        Bound::Within(least, most) => (least, most),
                        Bound::Positive(most) => {
                            above = 0.0;
                            (f64::INFINITY, most)
                        }
                    }
                }
                _ => continue,
            };
            (least, most) = (least.min(from), most.max(to));
        }
        // A bound that no number passes is none, and whole numbers are written as such.
        let number = |value: f64| match value {
            value if value.abs() >= 9e18 => None,
            value if value.fract() == 0.0 => Some(json!(value as i64)),
            value => Some(json!(value)),
        };
        let mut schema = json!({ "type": if whole { "integer" } else { "number" } });
        let lowest = if least <= above {
            ("minimum", least)
        } else {
            ("exclusiveMinimum", above)
        };
        for (name, end) in [lowest, ("maximum", most)] {
            if let Some(end) = number(end) {
                schema[name] = end;
            }
        }
        schema
    }
}

static KEYS: LazyLock<Keys> = LazyLock::new(|| {
    let mut files: Vec<(Table, PathBuf)> = Vec::new();
    for path in shipped() {
        files.push((parse(&std::fs::read_to_string(&path).expect("a file that ships")), path));
    }
    let path = root("configs/mill3-demo.toml");
    let mut text = std::fs::read_to_string(&path).expect("the demo");
    let (values, cross) = MORE.split_once("[[").expect("two parts");
    let node = text.find("[[bus.node]]\nid = 2").expect("the second node");
    text.insert_str(node, &format!("[[{cross}\n"));
    files.push((parse(&format!("{text}\n{values}")), path));
    Keys::explore(files, config::questions)
});

const TITLE: &str = "isocnc machine file";

#[test]
fn the_keys_of_the_machine_file() {
    KEYS.check("docs/machine-file.md", SCHEMA, TITLE);
}

fn validator() -> jsonschema::Validator {
    jsonschema::validator_for(&KEYS.schema(TITLE, &BTreeMap::new())).expect("a schema")
}

pub(super) fn as_json(file: &Table) -> Json {
    serde_json::to_value(file).expect("JSON")
}

#[test]
fn every_machine_file_that_ships_fits_the_schema_that_it_names() {
    let validator = validator();
    for path in shipped() {
        let text = std::fs::read_to_string(&path).expect("a file that ships");
        let first = text.lines().next().unwrap_or_default();
        assert_eq!(first, "#:schema ./machine.schema.json", "{}", path.display());
        let errors: Vec<String> = validator
            .iter_errors(&as_json(&parse(&text)))
            .map(|error| error.to_string())
            .collect();
        assert!(errors.is_empty(), "{}: {errors:?}", path.display());
    }
}

/// Fails unless reader and schema both refuse all of these.
fn refused_by_both(changes: &[Change]) {
    let validator = validator();
    let mut wrong = Vec::new();
    for Change { file, beside, path } in changes {
        let errors = config::parse(&file.to_string(), beside).err();
        if !errors.is_some_and(|errors| errors.errors().iter().any(|error| error.key.starts_with(path))) {
            wrong.push(format!("the reader does not name {path} in {}", beside.display()));
        }
        if validator.is_valid(&as_json(file)) {
            wrong.push(format!("the schema takes {path} in {}", beside.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn reader_and_schema_refuse_each_key_of_a_wrong_type() {
    assert!(KEYS.wrong.len() > 150, "{} keys", KEYS.wrong.len());
    refused_by_both(&KEYS.wrong);
}

#[test]
fn reader_and_schema_refuse_what_is_no_key() {
    assert!(KEYS.unknown.len() > 10, "{} tables", KEYS.unknown.len());
    refused_by_both(&KEYS.unknown);
}

#[test]
fn the_reader_refuses_what_is_outside_of_a_range_and_the_schema_takes_its_ends() {
    let validator = validator();
    assert!(KEYS.outside.len() > 50, "{} ends", KEYS.outside.len());
    for Change { file, beside, path } in &KEYS.outside {
        let errors = config::parse(&file.to_string(), beside).expect_err(path);
        assert!(
            errors.errors().iter().any(|error| error.key.starts_with(path)),
            "{path}: {errors}"
        );
        let number = get(&Value::Table(file.clone()), path)
            .and_then(Value::as_integer)
            .expect("a number");
        let pointer = format!("/{}", path.replace(['.', '['], "/").replace(']', ""));
        let fits = |number: i64| {
            let json = as_json(&with(file, path, &Value::from(number)).expect("the same place"));
            let mut errors = validator.iter_errors(&json);
            errors.all(|error| error.instance_path().as_str() != pointer)
        };
        assert!(fits(number - 1) || fits(number + 1), "{path}: {number}");
    }
}

#[test]
fn isocnc_schema_prints_the_schema() {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("schema")
        .output()
        .expect("isocnc");
    let text = std::fs::read_to_string(root(SCHEMA)).expect("the schema");
    assert!(output.status.success() && String::from_utf8_lossy(&output.stdout) == text);
}

#[test]
fn paths_are_found() {
    assert_eq!(
        general("bus.node[12].sdo[0].value", &BTreeSet::new()),
        "bus.node[].sdo[].value"
    );
    assert_eq!(general("a.b.c", &["a".to_owned()].into()), "a.*.c");
    assert_eq!(parent("bus.node[].id"), "bus.node[]");
    assert_eq!(parent("id"), "");
}
