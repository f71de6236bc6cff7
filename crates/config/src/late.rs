//! Mistakes that show only where the machine is there, at their places in the machine file.

use super::document::Log;
use super::error::{ConfigError, ConfigErrors};
use super::machine::Config;
use files::read::TEXT_MAX;
use hal_pins::HalError;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What stands at a path like `hal.net[3].name`.
fn find<'t, 'd>(table: &'t DeTable<'d>, path: &str) -> Option<&'t Spanned<DeValue<'d>>> {
    let (first, rest) = path
        .split_once('.')
        .map_or((path, None), |(first, rest)| (first, Some(rest)));
    let (name, at) = first.trim_end_matches(']').split_once('[').unwrap_or((first, ""));
    let mut value = table.get(name)?;
    if let Ok(at) = at.parse::<usize>() {
        value = value.get_ref().as_array()?.get(at)?;
    }
    match rest {
        None => Some(value),
        Some(rest) => find(value.get_ref().as_table()?, rest),
    }
}

/// Paths of keys, and which rule what stands there breaks; `shows_value`: whether to say what that is.
fn errors(config: &Config, wrong: &[(String, String)], shows_value: bool) -> ConfigErrors {
    let file = config.path.display().to_string();
    let text = files::read_text(&config.path, TEXT_MAX).unwrap_or_default();
    let (document, _) = DeTable::parse_recoverable(&text);
    let log = Log::new(&file, &text);
    let mut elsewhere = Vec::new();
    for (path, rule) in wrong {
        match find(document.get_ref(), path) {
            Some(value) if shows_value => log.wrong(value.span(), path, rule, None),
            Some(value) => log.misplaced(value.span(), path, rule, None),
            // The file is not the one any more that was read.
            None => elsewhere.push(ConfigError::whole(&file, format!("{path}: {rule}"))),
        }
    }
    let (mut errors, more) = log.into_errors();
    errors.append(&mut elsewhere);
    ConfigErrors::new(errors, more)
}

/// A mistake in `[bus]` that only the bus itself can see, at the place of `key`.
pub fn bus_error(config: &Config, key: &str, rule: String) -> ConfigErrors {
    errors(config, &[(format!("bus.{key}"), rule)], false)
}

/// Mistakes in nets: number of the net, and why.
pub fn net_errors(config: &Config, refused: &[(usize, HalError)]) -> ConfigErrors {
    let wrong = refused.iter().map(|(number, error)| {
        let net = &config.nets[*number];
        let mut targets = net.targets.iter();
        let key = match targets.position(|target| Some(target.as_str()) == error.pin()) {
            Some(target) => format!("targets[{target}]"),
            None if Some(net.source.as_str()) == error.pin() => "source".to_owned(),
            None => "name".to_owned(),
        };
        (format!("hal.net[{number}].{key}"), error.to_string())
    });
    errors(config, &wrong.collect::<Vec<_>>(), true)
}

/// A component whose pins cannot be made, at the place of its name; `kind`: `component` or `external`.
pub fn component_error(config: &Config, kind: &str, number: usize, error: &HalError) -> ConfigErrors {
    // The last of the external ones are input devices.
    let (kind, number) = match number.checked_sub(config.external.len() - config.inputs.len()) {
        Some(device) if kind == "external" => ("input", device),
        _ => (kind, number),
    };
    errors(
        config,
        &[(format!("hal.{kind}[{number}].name"), error.to_string())],
        true,
    )
}

/// A program whose pins cannot be had, at the place of its file.
pub fn logic_error(config: &Config, number: usize, rule: &str) -> ConfigErrors {
    errors(config, &[(format!("logic[{number}].file"), rule.to_owned())], true)
}
