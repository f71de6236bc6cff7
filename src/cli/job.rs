//! `isocnc job`: programs of simple jobs, without a control.
//!
//! In:  a kind and its numbers, as options. Out: the program, on the terminal or in a file; with `list` the kinds and their numbers.

use ::jobs::{Field, KINDS, Kind, Values, What, Wrong, value};
use anyhow::Context;
use clap::builder::PossibleValuesParser;
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, Subcommand, value_parser};
use host::terminal::say;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// Arguments of `job`.
#[derive(Clone, Debug, Args)]
pub struct JobArgs {
    #[command(subcommand)]
    job: Job,
}

/// Below `job`: a command for each kind, made of its fields, and `list`.
#[derive(Clone, Debug)]
enum Job {
    List {
        json: bool,
    },
    Make {
        kind: &'static Kind,
        /// As they were typed.
        typed: Vec<(Field, String)>,
        out: Option<PathBuf>,
    },
}

/// Of each kind: an example.
const EXAMPLES: [(&str, &str); KINDS.len()] = [
    ("facing", "Example: isocnc job facing --length 80 --width 50"),
    (
        "rectangular_pocket",
        "Example: isocnc job rectangular-pocket --length 40 --width 30",
    ),
    (
        "circular_pocket",
        "Example: isocnc job circular-pocket --diameter 24 --out pocket.ngc",
    ),
    ("bolt_circle", "Example: isocnc job bolt-circle --count 8 --cycle peck"),
    ("hole_rows", "Example: isocnc job hole-rows --columns 5 --rows 2"),
    (
        "thread_milling",
        "Example: isocnc job thread-milling --diameter 12 --pitch 1.75",
    ),
    ("engraving", "Example: isocnc job engraving --text 'No.7' --height 5"),
];

/// A name as a word of a command line. Few are made in a process.
fn word(name: &'static str) -> &'static str {
    match name.contains('_') {
        true => name.replace('_', "-").leak(),
        false => name,
    }
}

fn is_called(kind: &Kind, name: &str) -> bool {
    kind.name.replace('_', "-") == name
}

/// A value as it stands in a help.
fn default(field: &Field) -> String {
    match field.what {
        What::Number { default, .. } => default.to_string(),
        What::Whole { default, .. } => default.to_string(),
        What::Choice { of } => of.first().copied().unwrap_or_default().to_owned(),
        What::Text { default, .. } => default.to_owned(),
    }
}

fn option(field: &Field) -> Arg {
    let value_name = match field.unit {
        "mm" => "MM",
        "degrees" => "DEGREES",
        "mm/min" => "MM/MIN",
        "1/min" => "1/MIN",
        "s" => "S",
        "%" => "PERCENT",
        _ if matches!(field.what, What::Whole { .. }) => "NUMBER",
        _ if matches!(field.what, What::Choice { .. }) => "WORD",
        _ => "TEXT",
    };
    let option = Arg::new(field.name)
        .long(word(field.name))
        .help(field.doc.trim().trim_end_matches('.').to_owned())
        .value_name(value_name)
        .allow_hyphen_values(true)
        .default_value(&*default(field).leak());
    match field.what {
        What::Choice { of } => option.value_parser(PossibleValuesParser::new(of)),
        _ => option,
    }
}

impl Subcommand for Job {
    fn augment_subcommands(command: Command) -> Command {
        let list = Command::new("list")
            .about("List the kinds of jobs and their numbers")
            .after_help("Example: isocnc job list")
            .arg(
                Arg::new("json")
                    .long("json")
                    .action(ArgAction::SetTrue)
                    .help("Print JSON"),
            );
        let kinds = KINDS.iter().map(|kind| {
            let example = EXAMPLES.iter().find(|(name, _)| *name == kind.name);
            let out = Arg::new("out")
                .long("out")
                .value_name("FILE")
                .value_parser(value_parser!(PathBuf))
                .help("Write the program to this file instead of the terminal");
            Command::new(word(kind.name))
                .about(kind.about)
                .after_help(example.map_or("", |(_, example)| *example))
                .args((kind.fields)().iter().map(option))
                .arg(out)
        });
        command.subcommand(list).subcommands(kinds)
    }

    fn augment_subcommands_for_update(command: Command) -> Command {
        Job::augment_subcommands(command)
    }

    fn has_subcommand(name: &str) -> bool {
        name == "list" || KINDS.iter().any(|kind| is_called(kind, name))
    }
}

impl FromArgMatches for Job {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Job, clap::Error> {
        let Some((name, matches)) = matches.subcommand() else {
            return Err(clap::Error::new(ErrorKind::MissingSubcommand));
        };
        let Some(kind) = KINDS.iter().find(|kind| is_called(kind, name)) else {
            return Ok(Job::List {
                json: matches.get_flag("json"),
            });
        };
        let typed = |field: &Field| Some((*field, matches.get_one::<String>(field.name)?.clone()));
        Ok(Job::Make {
            kind,
            typed: (kind.fields)().iter().filter_map(typed).collect(),
            out: matches.get_one::<PathBuf>("out").cloned(),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Job::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The command `job`.
///
/// # Errors
/// A number is wrong, or the file cannot be written.
pub fn job(args: &JobArgs) -> anyhow::Result<ExitCode> {
    match &args.job {
        Job::List { json: true } => {
            let kinds: Vec<_> = KINDS.iter().map(Kind::told).collect();
            say(&format!("{}\n", serde_json::to_string_pretty(&kinds)?));
        }
        Job::List { json: false } => say(&list()),
        Job::Make { kind, typed, out } => {
            let text = make(kind, typed).map_err(refusal)?;
            match out {
                None => say(&text),
                Some(file) => files::write::write(file, &text).with_context(|| file.display().to_string())?,
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn make(kind: &Kind, typed: &[(Field, String)]) -> Result<String, Wrong> {
    let mut values = Values::new();
    for (field, text) in typed {
        values.insert(field.name.to_owned(), value(field, text)?);
    }
    kind.make(&values)
}

fn refusal(wrong: Wrong) -> Refusal {
    match wrong.field {
        Some(field) => Refusal::usage(format!("--{}: {}", word(field), wrong.message)),
        None => Refusal::usage(wrong.message),
    }
}

fn list() -> String {
    let mut text = String::new();
    for kind in KINDS {
        let _ = writeln!(text, "{}: {}", word(kind.name), kind.about);
        for field in (kind.fields)() {
            let bounds = match field.what {
                What::Number { min, max, .. } => format!("{min} to {max} {}", field.unit),
                What::Whole { min, max, .. } => format!("{min} to {max}"),
                What::Choice { of } => of.join(", "),
                What::Text { length_max, .. } => format!("at most {length_max} characters"),
            };
            let _ = writeln!(
                text,
                "  --{:<16} {} ({}) [{}]",
                word(field.name),
                field.doc.trim().trim_end_matches('.'),
                bounds.trim_end(),
                default(&field)
            );
        }
    }
    text
}
