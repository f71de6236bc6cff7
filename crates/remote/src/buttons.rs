//! `isocnc button`: buttons of the user, listed and pressed.
//!
//! In:  the control socket. Out: a table or one line, or one JSON value.

use super::control::{ControlArgs, ask, print, warn};
use clap::Args;
use host::terminal::table;
use protocol::{DescribedButton, Pressed, method, params};
use std::collections::BTreeMap;
use std::process::ExitCode;

/// Arguments of `button`.
#[derive(Clone, Debug, Args)]
pub struct ButtonArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Its name; without it all are listed
    name: Option<String>,
    /// What it asks for, as NAME=NUMBER; without one its default
    #[arg(value_parser = answer)]
    answers: Vec<(String, f64)>,
}

fn answer(text: &str) -> Result<(String, f64), String> {
    let (name, number) = text.split_once('=').ok_or("expected NAME=NUMBER")?;
    let number = number.parse().map_err(|_| format!("{number:?} is no number"))?;
    Ok((name.to_owned(), number))
}

/// Lists the buttons of a machine, or presses one.
///
/// # Errors
/// No control answers, or it refuses.
pub fn button(args: &ButtonArgs) -> anyhow::Result<ExitCode> {
    let Some(name) = &args.name else {
        let buttons = ask::<method::Describe>(&args.control, &params::NoParams {})?.buttons;
        print(&args.control, &buttons, listed(&buttons).trim_end());
        return Ok(ExitCode::SUCCESS);
    };
    let wanted = params::ButtonPress {
        name: name.clone(),
        answers: Some(args.answers.iter().cloned().collect::<BTreeMap<_, _>>()),
    };
    let pressed = ask::<method::ButtonPress>(&args.control, &wanted)?;
    print(&args.control, &pressed, &told(name, &pressed));
    warn(&args.control, pressed.warning.as_deref());
    Ok(ExitCode::SUCCESS)
}

fn listed(buttons: &[DescribedButton]) -> String {
    if buttons.is_empty() {
        return "this machine has no buttons of its own: [[panel.button]] in its file makes them".to_owned();
    }
    let rows = buttons.iter().map(|button| {
        let asks = button
            .questions
            .iter()
            .map(|question| format!("{}={}", question.name, question.default));
        let does = button
            .program
            .as_ref()
            .map_or_else(|| button.mdi.join("; "), |program| format!("loads {program}"));
        let asks: Vec<String> = asks.collect();
        vec![button.name.clone(), button.label.clone(), asks.join(" "), does]
    });
    table(&["button", "label", "answers", "does"], rows)
}

fn told(name: &str, pressed: &Pressed) -> String {
    match &pressed.program {
        Some(program) => format!("{program} is loaded: isocnc program start runs it"),
        None => format!("button {name}: its lines run"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::{DescribedQuestion, Role};

    #[test]
    fn buttons_are_listed_with_what_they_do() {
        let button = |name: &str, mdi: &[&str], program: Option<&str>| DescribedButton {
            name: name.into(),
            label: "Label".into(),
            ask: None,
            mdi: mdi.iter().map(|&line| line.into()).collect(),
            program: program.map(str::to_owned),
            role: Role::Operate,
            lamp: None,
            questions: Vec::new(),
        };
        let mut step = button("step", &["G91 G0 X{way}", "G90"], None);
        step.questions.push(DescribedQuestion {
            name: "way".into(),
            default: 1.5,
            ..DescribedQuestion::default()
        });
        let listed = listed(&[step, button("warm", &[], Some("warm.ngc"))]);
        assert!(
            listed.contains("way=1.5") && listed.contains("G91 G0 X{way}; G90"),
            "{listed}"
        );
        assert!(listed.contains("loads warm.ngc"), "{listed}");
        assert_eq!(answer("way=2"), Ok(("way".to_owned(), 2.0)));
        assert!(answer("way").is_err() && answer("way=x").is_err());
    }
}
