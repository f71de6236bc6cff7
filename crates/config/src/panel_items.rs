//! `[[panel.button]]` and `[[panel.value]]`: what the user adds to the panel.
//!
//! In:  the tables of the machine file. Out: buttons with lines or a program, and questions; pins to show.

use super::net::{PIN_RULE, is_pin};
use super::question::Bound;
use super::section::{Section, keys};

/// Buttons at the most: each has a bit in a word of the cycle.
pub const BUTTONS_MAX: usize = 64;
/// Questions of a button at the most.
const QUESTIONS_MAX: usize = 16;
/// Values at the most: as many as a panel asks for at once.
const VALUES_MAX: usize = 32;
/// Lines of a button at the most.
const LINES_MAX: usize = 50;
/// Longest line and longest label, bytes.
const LINE_MAX: usize = 256;
const LABEL_MAX: usize = 60;
/// Greatest size of an answer.
const ANSWER_MAX: f64 = 1e9;

/// What a button does.
#[derive(Clone, Debug, PartialEq)]
pub enum Does {
    /// It runs these lines of MDI.
    Mdi(Vec<String>),
    /// It loads this program of the folder of programs.
    Program(String),
}

keys! {
    /// `[[panel.button]]`; `above`: those before it.
    #[derive(Clone, Debug, PartialEq)]
    pub struct PanelButton(section, above: &[PanelButton]) {
        /// By which clients and its pin name it.
        pub name: String = name(section, |name| above.iter().any(|button| button.name == name)),
        /// What stands on it.
        pub label: String = label(section),
        /// A question that the panel asks before it is pressed.
        pub ask: Option<String> = section.optional_text("ask").map(|text| text.map(str::to_owned)),
        /// Only the role set-up may press it.
        pub set_up: bool = section.word("role", &[("operate", false), ("set-up", true)], false),
        /// It looks lit while this pin is true, or not 0.
        pub lamp: Option<String> = section.maybe("lamp", |item, path| {
            let pin = item.text(path)?;
            if is_pin(pin) { Some(pin.to_owned()) } else { item.refused(path, PIN_RULE) }
        }),
        /// Numbers that its lines need.
        pub questions: Vec<PanelQuestion> = {
            let read = section.tables("question", PanelQuestion::read);
            match read {
                Some(read) if read.len() > QUESTIONS_MAX => {
                    section.refused("question", format!("must not be more than {QUESTIONS_MAX}"))
                }
                read => read,
            }
        },
        pub does: Does = does(section),
    }
    rules {
        if let (Some(Does::Mdi(lines)), Some(questions)) = (&does, &questions) {
            let is_asked = |name: &str| questions.iter().any(|question| question.name == name);
            if let Some(other) = lines.iter().flat_map(|line| places(line)).find(|name| !is_asked(name)) {
                section.wrong("mdi", format!("has {{{other}}}, and no question has this name"));
            }
            let is_used = |name: &str| lines.iter().flat_map(|line| places(line)).any(|place| place == name);
            if let Some(idle) = questions.iter().find(|question| !is_used(&question.name)) {
                section.wrong("mdi", format!("has no {{{}}}, which a question asks for", idle.name));
            }
        }
    }
}

keys! {
    /// `[[panel.button.question]]`: a number that takes the place of `{name}`.
    #[derive(Clone, Debug, PartialEq)]
    pub struct PanelQuestion(section, above: &[PanelQuestion]) {
        pub name: String = name(section, |name| above.iter().any(|question| question.name == name)),
        /// What stands before its field.
        pub label: String = label(section),
        pub default: f64 = section.number("default", Bound::Size(ANSWER_MAX), None),
        pub min: Option<f64> = section.optional_number("min", Bound::Size(ANSWER_MAX)),
        pub max: Option<f64> = section.optional_number("max", Bound::Size(ANSWER_MAX)),
    }
    rules {
        if let (Some(default), Some(min), Some(max)) = (default, min, max) {
            let [least, most] = [min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY)];
            if least > most {
                section.wrong("min", "must not be above max");
            } else if !(least..=most).contains(&default) {
                section.wrong("default", "must lie between min and max");
            }
        }
    }
}

keys! {
    /// `[[panel.value]]`: a pin that the panel shows.
    #[derive(Clone, Debug, PartialEq)]
    pub struct PanelValue(section) {
        /// What stands before it.
        pub label: String = label(section),
        pub pin: String = {
            let pin = section.text("pin", "the name of a pin");
            match pin {
                Some(pin) if !is_pin(pin) => section.refused("pin", PIN_RULE),
                pin => pin.map(str::to_owned),
            }
        },
        /// What stands behind it.
        pub unit: Option<String> = section.optional_text("unit").map(|text| text.map(str::to_owned)),
        pub decimals: u32 = section.integer("decimals", 0..=6, 2),
    }
}

impl PanelButton {
    /// Its pin, if it asks nothing.
    pub fn pin(&self) -> Option<String> {
        self.questions.is_empty().then(|| format!("halui.button.{}", self.name))
    }
}

/// All buttons.
pub(super) fn buttons(section: &mut Section<'_, '_>) -> Option<Vec<PanelButton>> {
    few(section, "button", BUTTONS_MAX, PanelButton::read)
}

/// All values.
pub(super) fn values(section: &mut Section<'_, '_>) -> Option<Vec<PanelValue>> {
    few(section, "value", VALUES_MAX, |table, _| PanelValue::read(table))
}

/// Tables of a key, not more than `most`.
fn few<'d, 'l, T>(
    section: &mut Section<'d, 'l>,
    key: &'static str,
    most: usize,
    read: impl FnMut(&mut Section<'d, 'l>, &[T]) -> Option<T>,
) -> Option<Vec<T>> {
    let all = section.tables(key, read)?;
    if all.len() > most {
        return section.refused(key, format!("must not be more than {most}"));
    }
    Some(all)
}

/// A name that none above has: of a pin, too.
fn name(section: &mut Section<'_, '_>, is_taken: impl Fn(&str) -> bool) -> Option<String> {
    let name = section.text("name", "a short name of lower-case letters, digits and dashes")?;
    let is_one = name.len() <= 32 && is_pin(name) && !name.contains('.');
    if !is_one {
        return section.refused("name", "must be 1 to 32 lower-case letters, digits and dashes");
    }
    if is_taken(name) {
        return section.refused("name", "is the name of one above");
    }
    Some(name.to_owned())
}

fn label(section: &mut Section<'_, '_>) -> Option<String> {
    let label = section.text("label", "a short text")?;
    let is_one = !label.trim().is_empty() && label.len() <= LABEL_MAX && !label.contains(char::is_control);
    if !is_one {
        return section.refused("label", format!("must be a text of one line, up to {LABEL_MAX} bytes"));
    }
    Some(label.to_owned())
}

fn does(section: &mut Section<'_, '_>) -> Option<Does> {
    let program = section.optional_text("program")?;
    let lines = section.list("mdi", |item, path| {
        let line = item.text(path)?;
        let is_one = !line.trim().is_empty() && line.len() <= LINE_MAX && !line.contains(char::is_control);
        if !is_one {
            return item.refused(path, format!("must be a line of G-code, up to {LINE_MAX} bytes"));
        }
        Some(line.to_owned())
    })?;
    match program {
        Some(_) if !lines.is_empty() => {
            section.refused("program", "must be left out with mdi: a button does one thing")
        }
        Some(program) if section.has("question") => section.refused(
            "program",
            format!("takes no answers; mdi can: mdi = [\"o<{program}> call [{{name}}]\"]"),
        ),
        // As the folder of programs names its files.
        Some(program) if program.is_empty() || program.starts_with('.') || program.contains(['/', '\0']) => section
            .refused(
                "program",
                "must be the name of a file in the folder of programs, without a folder",
            ),
        Some(program) => Some(Does::Program(program.to_owned())),
        None if lines.is_empty() => section.refused("mdi", "is missing: lines of G-code, or a program"),
        None if lines.len() > LINES_MAX => section.refused("mdi", format!("must not be more than {LINES_MAX} lines")),
        None => Some(Does::Mdi(lines)),
    }
}

/// Names in braces of a line, in their order.
fn places(line: &str) -> impl Iterator<Item = &str> {
    line.split('{')
        .skip(1)
        .filter_map(|rest| rest.split_once('}').map(|(name, _)| name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse;
    use std::path::Path;

    const DEMO: &str = include_str!("../../../configs/mill3-demo.toml");

    fn read(tables: &str) -> Result<crate::Panel, String> {
        let text = format!("{DEMO}\n[panel]\n{tables}");
        match parse(&text, Path::new("m.toml")) {
            Ok(config) => Ok(config.panel.unwrap()),
            Err(errors) => Err(errors.to_string()),
        }
    }

    #[test]
    fn a_button_has_lines_or_a_program_and_a_pin_if_it_asks_nothing() {
        let panel = read(
            r#"
            [[panel.button]]
            name = "park"
            label = "Park"
            mdi = ["G53 G0 Z0", "G53 G0 X0 Y0"]
            ask = "Park the machine?"
            lamp = "motion.in-position"
            [[panel.button]]
            name = "dip"
            label = "Dip"
            role = "set-up"
            mdi = ["G91 G1 Z-{depth} F{feed}", "G0 Z{depth}", "G90"]
            question = [
                { name = "depth", label = "Depth, mm", default = 1.0, min = 0.1, max = 5 },
                { name = "feed", label = "Feed", default = 100 },
            ]
            [[panel.button]]
            name = "warm-up"
            label = "Warm up"
            program = "warm-up.ngc"
            [[panel.value]]
            label = "Load"
            pin = "spindle.0.load"
            unit = "%"
            decimals = 0
            "#,
        )
        .unwrap();
        let [park, dip, warm] = &panel.buttons[..] else {
            panic!("{:?}", panel.buttons)
        };
        assert_eq!(park.pin().as_deref(), Some("halui.button.park"));
        assert_eq!((dip.pin(), dip.set_up, dip.questions[0].max), (None, true, Some(5.0)));
        assert_eq!(warm.does, Does::Program("warm-up.ngc".into()));
        assert_eq!(
            (panel.values[0].decimals, panel.values[0].unit.as_deref()),
            (0, Some("%"))
        );
    }

    #[test]
    fn what_no_button_can_be_is_told_at_its_key() {
        let button = |keys: &str| format!("[[panel.button]]\nname = \"a\"\nlabel = \"A\"\n{keys}");
        let question = "[[panel.button.question]]\nname = \"d\"\nlabel = \"D\"\n";
        for (tables, told) in [
            (button(""), "panel.button[0].mdi: is missing"),
            (button("mdi = [\"\"]"), "must be a line of G-code"),
            (button("mdi = [\"G0\\nX1\"]"), "must be a line of G-code"),
            (button("mdi = [\"X{d}\"]"), "has {d}, and no question has this name"),
            (button(&format!("mdi = [\"X1\"]\n{question}default = 1")), "has no {d}"),
            (button("program = \"../a\""), "must be the name of a file"),
            (button("program = \"a\"\nmdi = [\"X1\"]"), "a button does one thing"),
            (
                button(&format!("program = \"a\"\n{question}default = 1")),
                "takes no answers",
            ),
            (
                button(&format!("mdi = [\"X{{d}}\"]\n{question}default = 1\nmin = 2")),
                "must lie between min and max",
            ),
            (
                button(&format!("mdi = [\"X{{d}}\"]\n{question}default = 1\nmin = 2\nmax = 1")),
                "must not be above max",
            ),
            (
                button(&format!("mdi = [\"X{{d}}\"]\n{question}default = nan")),
                "must be a finite number",
            ),
            (
                button("mdi = [\"X1\"]\nlamp = \"X\""),
                "must be a name of lower-case letters",
            ),
            (button("mdi = [\"X1\"]\nrole = \"boss\""), "panel.button[0].role"),
            (
                format!("{}\n{}", button("mdi = [\"X1\"]"), button("mdi = [\"X1\"]")),
                "is the name of one above",
            ),
            ("[[panel.value]]\nlabel = \"L\"".to_owned(), "panel.value[0].pin"),
            (
                (0..65)
                    .map(|n| format!("[[panel.button]]\nname = \"b{n}\"\nlabel = \"B\"\nmdi = [\"X1\"]\n"))
                    .collect(),
                "more than 64",
            ),
        ] {
            let errors = read(&tables).unwrap_err();
            assert!(errors.contains(told), "{told}: {errors}");
        }
    }
}
