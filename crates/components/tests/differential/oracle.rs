//! LinuxCNC's own functions, as `scripts/halrun-oracle.sh` makes them callable: rows in, rows out.

use super::subjects::Subject;
use hal_pins::{AnyValue, Type};
use std::fs::{self, File};
use std::process::{Command, Stdio};

/// A pin or parameter of LinuxCNC's.
#[derive(Debug)]
pub(crate) struct Theirs {
    /// As it is called here.
    pub(crate) name: String,
    pub(crate) is_input: bool,
    pub(crate) is_output: bool,
    pub(crate) default: AnyValue,
}

impl Theirs {
    /// From a line `NAME DIRECTION TYPE VALUE`.
    fn read(kind: &str, line: &str) -> Theirs {
        let words: Vec<&str> = line.split(' ').collect();
        let value_type = match words[2] {
            "bit" => Type::Bit,
            "s32" => Type::S32,
            "u32" => Type::U32,
            _ => Type::Float,
        };
        let default = match value_type {
            Type::Bit => AnyValue::Bit(words[3] != "0"),
            other => AnyValue::parse(other, words[3]).unwrap(),
        };
        let own = kind.replace('_', "-");
        let instances = [
            format!("{own}.0."),
            format!("{own}."),
            "wsum.0.".into(),
            "mux-gen.00.".into(),
        ];
        let rest = instances
            .iter()
            .find_map(|instance| words[0].strip_prefix(instance.as_str()));
        Theirs {
            name: rest.unwrap_or(words[0]).to_lowercase(),
            is_input: words[1] != "out",
            is_output: words[1] != "in",
            default,
        }
    }

    /// The value in the octets of the oracle.
    pub(crate) fn value(&self, octets: &[u8]) -> AnyValue {
        let octets = octets.try_into().unwrap();
        let integer = i64::from_ne_bytes(octets);
        match self.default.kind() {
            Type::Bit => AnyValue::Bit(integer != 0),
            Type::S32 => AnyValue::S32(integer as i32),
            Type::U32 => AnyValue::U32(integer as u32),
            _ => AnyValue::Float(f64::from_ne_bytes(octets)),
        }
    }
}

/// A value in octets of the oracle.
pub(crate) fn octets(value: AnyValue) -> [u8; 8] {
    match value {
        AnyValue::Bit(value) => i64::from(value).to_ne_bytes(),
        AnyValue::S32(value) => i64::from(value).to_ne_bytes(),
        AnyValue::U32(value) => i64::from(value).to_ne_bytes(),
        AnyValue::Float(value) => value.to_ne_bytes(),
        other => panic!("{other:?}"),
    }
}

/// Calls LinuxCNC's function with these rows: its pins, and the octets of its outputs, fewer where it has crashed.
pub(crate) fn run(oracle: &str, subject: &Subject, rows: &[u8]) -> (Vec<Theirs>, Vec<u8>) {
    let name = format!("differential-{}-{:?}", std::process::id(), std::thread::current().id());
    let path = std::env::temp_dir().join(name);
    fs::write(&path, rows).unwrap();
    let output = Command::new(oracle)
        .arg(subject.kind)
        .args(subject.words)
        .stdin(File::open(&path).unwrap())
        .stderr(Stdio::inherit())
        .output()
        .unwrap_or_else(|error| panic!("{oracle}: {error}"));
    fs::remove_file(&path).unwrap();
    let has_crashed = output.status.code().is_none();
    assert!(
        output.status.success() || has_crashed,
        "{}: {}",
        subject.kind,
        output.status
    );
    let end = output.stdout.windows(2).position(|two| two == b"\n\n");
    let Some(end) = end.filter(|_| !has_crashed) else {
        return (Vec::new(), Vec::new());
    };
    let text = std::str::from_utf8(&output.stdout[..end]).unwrap();
    let pins = text.lines().map(|line| Theirs::read(subject.kind, line)).collect();
    (pins, output.stdout[end + 2..].to_vec())
}
