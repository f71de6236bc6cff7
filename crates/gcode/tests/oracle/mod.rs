//! LinuxCNC's stand-alone interpreter `rs274`, to compare with.
//!
//! In:  a folder with a program, its tables and settings ([`case::Case`]).
//! Out: the calls it printed, in the form of the newest LinuxCNC ([`newest_form`]), what it refused, and the parameters
//!      it left.
//!
//! It is `$ISOCNC_RS274` or `rs274` on the PATH; `scripts/rs274-oracle.sh` makes one, of the version that the distribution
//! has. `$ISOCNC_RS274_NEWEST` names one that was built from the newest source. Tests that need one say so and end well
//! where there is none.

#![allow(dead_code, reason = "each test crate uses its own part of this")]
#![allow(unreachable_pub, reason = "a module of test crates, nothing is exported")]

pub mod case;
pub mod grammar;
pub mod ours;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use case::Case;

/// How long a program may take: all of ours end in milliseconds.
const TIME_LIMIT: Duration = Duration::from_secs(20);

/// What an interpreter made of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The printed calls in the newest form.
    pub canon: String,
    /// Texts of PRINT, one a line.
    pub printed: String,
    /// What was refused, in order.
    pub refusals: Vec<Refusal>,
    /// The parameter file afterwards.
    pub parameters: String,
}

/// A line that was refused.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// Why, in the interpreter's words.
    pub message: String,
    /// The line itself, without blanks around it.
    pub line: String,
}

/// Which LinuxCNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// 2.9, as Debian 12 has it.
    Packaged,
    /// Built from the newest source.
    Newest,
}

/// LinuxCNC's interpreter.
#[derive(Clone, Debug)]
pub struct Oracle {
    pub program: PathBuf,
    pub version: Version,
}

/// The interpreter to compare with, or why there is none.
pub fn find(version: Version) -> Result<Oracle, String> {
    let program = match version {
        Version::Packaged => packaged()?,
        Version::Newest => named("ISOCNC_RS274_NEWEST")
            .unwrap_or_else(|| Err("no rs274 of the newest source: ISOCNC_RS274_NEWEST names none".into()))?,
    };
    Ok(Oracle { program, version })
}

/// The file that a variable of the environment names.
fn named(variable: &str) -> Option<Result<PathBuf, String>> {
    let path = PathBuf::from(env::var_os(variable)?);
    Some(match path.is_file() {
        true => Ok(path),
        false => Err(format!("{variable} names {}, which is no file", path.display())),
    })
}

fn packaged() -> Result<PathBuf, String> {
    if let Some(named) = named("ISOCNC_RS274") {
        return named;
    }
    let path = env::var_os("PATH").unwrap_or_default();
    env::split_paths(&path)
        .map(|folder| folder.join("rs274"))
        .find(|program| program.is_file())
        .ok_or_else(|| {
            "no rs274: neither ISOCNC_RS274 nor the PATH names one (scripts/rs274-oracle.sh makes one)".into()
        })
}

/// Runs a case in a folder of its own.
pub fn run(rs274: &Oracle, case: &Case) -> Outcome {
    let rs274 = &rs274.program;
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder for the oracle");
    case.write_to(folder.path());
    let output = folder.path().join("output.canon");
    let errors = folder.path().join("errors.txt");
    let mut command = Command::new(rs274);
    command
        .current_dir(folder.path())
        .env("HOME", folder.path()) // it keeps the tools in a file there, which all that run at a time would share
        .args(["-t", "tool.tbl", "-v", "parameters.var"]);
    if case.options.block_delete {
        command.arg("-b");
    }
    if case.options.continue_after_error {
        command.args(["-n", "0"]);
    }
    if !case.options.ini.is_empty() {
        fs::write(folder.path().join("case.ini"), case.ini_file()).expect("the oracle's INI file");
        command.args(["-i", "case.ini"]);
    }
    // Its output file is left empty on some errors: stdout is not.
    command
        .args(["-g", "program.ngc"])
        .stdin(Stdio::null())
        .stdout(fs::File::create(&output).expect("the oracle's output"))
        .stderr(fs::File::create(&errors).expect("the oracle's errors"));
    let mut child = command
        .spawn()
        .unwrap_or_else(|error| panic!("{}: {error}", rs274.display()));
    wait(&mut child, &case.name);
    let read = |path: &Path| String::from_utf8_lossy(&fs::read(path).expect("the oracle wrote it")).into_owned();
    let (mut calls, printed) = read(&output)
        .lines()
        .map(|line| format!("{line}\n"))
        .partition::<Vec<_>, _>(|line| is_call(line));
    if !case.options.ini.is_empty() {
        // With an INI file it does not close the program at its end: a line less.
        calls.push("      N..... ON_RESET()\n".to_owned());
    }
    Outcome {
        canon: newest_form(&calls.concat()),
        printed: printed.concat(),
        refusals: refusals(&read(&errors), case),
        parameters: read(&folder.path().join("parameters.var")),
    }
}

fn wait(child: &mut Child, name: &str) {
    let start = Instant::now();
    while child.try_wait().expect("the oracle's state").is_none() {
        if start.elapsed() > TIME_LIMIT {
            let _ = child.kill();
            let _ = child.wait();
            panic!("{name}: the oracle did not end within {TIME_LIMIT:?}");
        }
        thread::sleep(Duration::from_micros(500));
    }
}

/// The messages and lines of the oracle's stderr. It prints a message, of one line or more, and the refused line after it.
fn refusals(errors: &str, case: &Case) -> Vec<Refusal> {
    let lines: Vec<String> = case.all_lines();
    let mut found = Vec::new();
    let mut message: Vec<&str> = Vec::new();
    for line in errors.lines().filter(|line| *line != "executing") {
        // Of a line that is too long it prints the beginning.
        let is_refused =
            |program: &String| program == line.trim() || (line.len() > 200 && program.starts_with(line.trim()));
        if !message.is_empty() && lines.iter().any(is_refused) {
            found.push(Refusal {
                message: message.join(" ").trim().to_owned(),
                line: line.trim().to_owned(),
            });
            message.clear();
        } else {
            message.push(line);
        }
    }
    // A line that is not the program's: the call that a configured code stands for.
    if let Some(line) = message.pop()
        && !message.is_empty()
    {
        found.push(Refusal {
            message: message.join(" ").trim().to_owned(),
            line: line.trim().to_owned(),
        });
    }
    found
}

/// Whether a line of stdout is a call: a count in five places or more, and the line number. That of G6.2 has no count.
fn is_call(line: &str) -> bool {
    if line.contains(WITHOUT_COUNT) {
        return true;
    }
    let counted = line
        .trim_start_matches(' ')
        .trim_start_matches(|character: char| character.is_ascii_digit());
    counted.len() + 5 <= line.len() && counted.starts_with(" N")
}

/// How the newest LinuxCNC prints a NURBS with knots, behind the line number.
const WITHOUT_COUNT: &str = "saicanon NURBS_G6_FEED_";

/// The printed calls of the packaged LinuxCNC 2.9 in the form of the newest one: the tool change has one line less and
/// no number, splines have another name. And as everywhere in our files, a zero has no sign.
pub fn newest_form(printed: &str) -> String {
    let mut count = 0;
    let mut newest = String::with_capacity(printed.len());
    for line in printed.lines() {
        let restored = line.contains(WITHOUT_COUNT).then(|| {
            let line = line.replace(WITHOUT_COUNT, "NURBS_G6_FEED");
            format!("    0 {}", line.trim_start())
        });
        let line = restored.as_deref().unwrap_or(line);
        // The count has five places or more, the column of line numbers seven or more.
        let Some((_, rest)) = line.split_at_checked(6) else {
            continue;
        };
        let (number, call) = rest.split_at_checked(7).unwrap_or((rest, ""));
        if call == "START_CHANGE()" {
            continue;
        }
        count += 1;
        let call = if call.starts_with("CHANGE_TOOL(") {
            "CHANGE_TOOL()".to_owned()
        } else if let Some(points) = call.strip_prefix("NURBS_FEED(") {
            format!("NURBS_G5_FEED({points}")
        } else if call.starts_with("COMMENT(") || call.starts_with("MESSAGE(") {
            call.to_owned()
        } else {
            call.replace("-0.0000", "0.0000")
        };
        newest.push_str(&format!("{count:5} {number}{call}\n"));
    }
    newest
}
