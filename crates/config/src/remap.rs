//! `[[program.remap]]`: a code that calls a subroutine, as LinuxCNC's REMAP does without Python.
//!
//! In:  code, modal group, words that the subroutine takes, its name.
//! Out: a [`Remap`] that LinuxCNC's rules allow, whose subroutine is there.

use super::section::{Section, keys};
use std::path::PathBuf;

/// G codes of the language, times ten, that keep their meaning. G28 and G30 with their .1 may be given another one.
const G_TAKEN: &[u16] = &[
    0, 10, 20, 30, 40, 50, 51, 52, 53, 62, 63, 70, 80, 100, 170, 171, 180, 181, 190, 191, 200, 210, 330, 331, 382, 383,
    384, 385, 400, 410, 411, 420, 421, 430, 431, 432, 490, 520, 530, 540, 550, 560, 570, 580, 590, 591, 592, 593, 610,
    611, 640, 700, 710, 711, 712, 720, 721, 722, 730, 740, 760, 800, 810, 820, 830, 840, 850, 860, 870, 880, 890, 900,
    901, 910, 911, 920, 921, 922, 923, 930, 940, 950, 960, 970, 980, 990,
];
/// M codes of the language that keep their meaning; M0, M1, M6, M60 and M61 may be given another one.
const M_TAKEN: &[u16] = &[
    2, 3, 4, 5, 7, 8, 9, 19, 30, 48, 49, 50, 51, 52, 53, 62, 63, 64, 65, 66, 67, 68, 70, 71, 72, 73, 98, 99,
];
const M_MAX: u16 = 999;
const M_GROUP_DEFAULT: u8 = 10;

keys! {
    /// `[[program.remap]]`; `before`: those above it, `folders`: where subroutines are looked for.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct Remap(section, before: &[Remap], folders: &[PathBuf]) {
        /// `G88.1`, `M400`, or `T`, `S`, `F`.
        pub code: String = {
            let text = section.text("code", "the code, such as \"M400\", \"G88.1\", \"M6\" or \"T\"");
            text.and_then(|text| match code(text) {
                Ok(name) if before.iter().any(|remap| remap.code == name) => {
                    section.refused("code", "is remapped above already")
                }
                Ok(name) => Some(name),
                Err(rule) => section.refused("code", rule),
            })
        },
        /// 1 of G codes, 4 to 10 of M codes; 0: `T`, `S` and `F` have a place of their own.
        pub modal_group: u8 = modal_group(section, code.as_deref()),
        /// Words that the subroutine takes, as in LinuxCNC's argspec.
        pub arguments: String = arguments(section),
        /// Name of the subroutine, in lower case.
        pub subroutine: String = subroutine(section, folders),
    }
}

/// The code in its usual form.
fn code(text: &str) -> Result<String, String> {
    let upper = text.to_ascii_uppercase();
    let number = upper.get(1..).unwrap_or_default();
    let is_number = |number: &str| !number.is_empty() && number.bytes().all(|octet| octet.is_ascii_digit());
    match upper.chars().next() {
        Some('T' | 'S' | 'F') if number.is_empty() => Ok(upper),
        Some('M') if is_number(number) => match number.parse::<u16>() {
            Ok(number) if M_TAKEN.contains(&number) => Err(format!(
                "M{number} keeps its meaning; M0, M1, M6, M60, M61 and unused codes up to M{M_MAX} may be remapped"
            )),
            Ok(number) if number <= M_MAX => Ok(format!("M{number}")),
            Ok(_) | Err(_) => Err(format!("must not be above M{M_MAX}")),
        },
        Some('G') => {
            let (whole, tenth) = number.split_once('.').unwrap_or((number, "0"));
            if !is_number(whole) || !is_number(tenth) || whole.len() > 2 || tenth.len() > 1 {
                return Err("must be a G code from G0.1 to G99.9 with one decimal at most, such as \"G88.1\"".into());
            }
            let number = 10 * whole.parse::<u16>().unwrap_or(0) + tenth.parse::<u16>().unwrap_or(0);
            let name = match number % 10 {
                0 => format!("G{}", number / 10),
                tenth => format!("G{}.{tenth}", number / 10),
            };
            if G_TAKEN.contains(&number) {
                return Err(format!(
                    "{name} keeps its meaning; G28, G28.1, G30, G30.1 and unused codes may be remapped"
                ));
            }
            Ok(name)
        }
        Some(_) | None => Err("must be a G code, an M code, \"T\", \"S\" or \"F\"".into()),
    }
}

/// The modal group of a code, which is `None` where it is wrong; 0 for T, S and F.
fn modal_group(section: &mut Section<'_, '_>, code: Option<&str>) -> Option<u8> {
    match code.map(|code| code.as_bytes()[0]) {
        None => section.integer("modal_group", 1..=10, M_GROUP_DEFAULT),
        Some(b'G') => section.integer("modal_group", 1..=1, 1),
        Some(b'M') => section.integer("modal_group", 4..=10, M_GROUP_DEFAULT),
        Some(_) if section.optional("modal_group").is_some() => {
            let rule = "must be left out: T, S and F have their own place in a block";
            section.refused("modal_group", rule)
        }
        Some(_) => Some(0),
    }
}

fn arguments(section: &mut Section<'_, '_>) -> Option<String> {
    let text = section.optional_text("args")?.unwrap_or_default();
    let is_word = |character: char| "ABCDEFHIJKLNPQRSTUVWXYZ".contains(character.to_ascii_uppercase());
    let mut seen = Vec::new();
    for character in text.chars() {
        let letter = character.to_ascii_uppercase();
        let rule = if !is_word(character) && !matches!(character, '@' | '>' | '^') {
            format!(
                "{character:?} is no word that can be handed on: capital letters for words that must be there, small \
                 ones for others, @ to hand them on as #1, #2, ..., > for a feed and ^ for a speed above 0, n for the \
                 line number"
            )
        } else if seen.contains(&letter) {
            format!("{character:?} stands here twice")
        } else {
            seen.push(letter);
            continue;
        };
        return section.refused("args", rule);
    }
    Some(text.to_owned())
}

fn subroutine(section: &mut Section<'_, '_>, folders: &[PathBuf]) -> Option<String> {
    let what = "the name of the subroutine and of its file, without .ngc";
    let name = section.text("subroutine", what)?;
    let is_name = |name: &str| {
        !name.is_empty()
            && name
                .bytes()
                .all(|octet| octet.is_ascii_alphanumeric() || matches!(octet, b'_' | b'-'))
    };
    if !is_name(name) {
        return section.refused("subroutine", "must be a name of letters, digits, _ and -, without .ngc");
    }
    let file = format!("{}.ngc", name.to_ascii_lowercase());
    if folders.iter().any(|folder| folder.join(&file).is_file()) {
        return Some(name.to_ascii_lowercase());
    }
    let folders: Vec<String> = folders.iter().map(|folder| folder.display().to_string()).collect();
    let rule = if folders.is_empty() {
        format!("there is no file {file}: neither program.directory nor program.subroutine_directories is given")
    } else {
        format!("there is no file {file} in {}", folders.join(", "))
    };
    section.refused("subroutine", rule)
}
