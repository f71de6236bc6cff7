//! `docs/commands.md`: all commands with their arguments and options, from the command line's own declarations.

use super::{code, compare, head, row};
use clap::{Arg, Command, CommandFactory};
use isocnc::cli::Cli;

const BEFORE: &str = "# Commands

Made from the command line itself: `isocnc help` and `isocnc COMMAND --help` print the same. `--help` is an option of every command.
";

/// Help in one line.
fn in_one_line(help: Option<&clap::builder::StyledStr>) -> String {
    let text = help.map(ToString::to_string).unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// An argument as it is typed.
fn typed(argument: &Arg) -> String {
    let names = argument.get_value_names().unwrap_or_default();
    let values: Vec<String> = names.iter().map(ToString::to_string).collect();
    let value = match argument.get_action().takes_values() {
        true => values.join(" "),
        false => String::new(),
    };
    match (argument.get_long(), argument.get_short()) {
        (Some(long), Some(short)) => format!("-{short}, --{long} {value}"),
        (Some(long), None) => format!("--{long} {value}"),
        (None, Some(short)) => format!("-{short} {value}"),
        (None, None) => value,
    }
    .trim_end()
    .to_owned()
}

/// What an argument means, its words and its value where it is not given.
fn meaning(argument: &Arg) -> String {
    let mut text = in_one_line(argument.get_long_help().or(argument.get_help()));
    let takes_values = argument.get_action().takes_values();
    let words = argument.get_possible_values();
    if takes_values && !words.is_empty() && !argument.is_hide_possible_values_set() {
        let words: Vec<String> = words.iter().map(|word| code(word.get_name())).collect();
        text += &format!(" ({})", words.join(", "));
    }
    let defaults = argument.get_default_values();
    if takes_values && !defaults.is_empty() && !argument.is_hide_default_value_set() {
        let defaults: Vec<String> = defaults.iter().map(|value| code(&value.to_string_lossy())).collect();
        text += &format!(" [{}]", defaults.join(", "));
    }
    text
}

/// The sections of a command and of those below it.
fn sections(command: &Command, words: &str, text: &mut String) {
    let mut below = command
        .get_subcommands()
        .filter(|command| command.get_name() != "help")
        .peekable();
    if below.peek().is_none() {
        let mut command = command.clone().bin_name(words);
        let usage = command.render_usage().to_string();
        let usage = usage
            .trim_start_matches("Usage: ")
            .split_whitespace()
            .collect::<Vec<_>>();
        let about = in_one_line(command.get_long_about().or(command.get_about()));
        *text += &format!("\n## {words}\n\n{about}\n\n```text\n{}\n```\n", usage.join(" "));
        let shown =
            |argument: &&Arg| !argument.is_hide_set() && argument.get_id() != "help" && argument.get_id() != "version";
        let arguments: Vec<&Arg> = command.get_arguments().filter(shown).collect();
        if !arguments.is_empty() {
            *text += "\n";
            *text += &head(&["argument", "meaning"]);
            for argument in arguments {
                *text += &row(&[&code(&typed(argument)), &meaning(argument)]);
            }
        }
        if let Some(after) = command.get_after_long_help().or(command.get_after_help()) {
            *text += &format!("\n```text\n{}\n```\n", after.to_string().trim_end());
        }
    }
    for command in below {
        sections(command, &format!("{words} {}", command.get_name()), text);
    }
}

/// A program that is built without its panel has one command less.
#[cfg(feature = "panel")]
#[test]
fn commands_are_those_of_the_command_line() {
    let mut all = Cli::command();
    all.build();
    let mut text = String::new();
    sections(&all, "isocnc", &mut text);
    assert!(text.matches("\n## isocnc ").count() > 40, "{text}");
    compare("docs/commands.md", &format!("{BEFORE}{text}"));
}
