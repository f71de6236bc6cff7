//! `docs/messages.md`: what the control says to people, by code, from the sources and from those who make a message of what others say.

use super::faults::{OF_DRIVES, OF_HOMING, OF_SPINDLES};
use super::source::covers;
use super::{check, code, head, root, row};
use cia402::axis::{AxisFault, Step};
use cia402::profile::State as DriveState;
use isocnc::machine::fault_causes;
use isocnc::machine::permission::{Activity, Condition, Next, Power, Wish, permit};
use isocnc::operator::console::actions;
use motion::canon::{Input, OrientDirection, SpindleDirection, WaitMode};
use motion::element::{Action, Surface};
use protocol::{Message, Outcome, Param, State};
use std::collections::BTreeMap;
use std::path::Path;

/// Sentences by code, with the names of values in the places of these.
type Sentences = BTreeMap<String, String>;

/// A string literal at the beginning of a text, and what follows it.
fn literal(text: &str) -> Option<(String, &str)> {
    let text = text.trim_start().strip_prefix('"')?;
    let mut said = String::new();
    let mut letters = text.char_indices();
    while let Some((at, letter)) = letters.next() {
        match letter {
            '"' => return Some((said, &text[at + 1..])),
            '\\' => match letters.next()?.1 {
                'n' => said.push('\n'),
                // A line that goes on.
                '\n' => {
                    let rest = text[at + 2..].trim_start();
                    let (more, rest) = literal(&format!("\"{rest}")).map(|(more, rest)| (more, rest.len()))?;
                    return Some((said + &more, &text[text.len() - rest..]));
                }
                other => said.push(other),
            },
            other => said.push(other),
        }
    }
    None
}

/// What stands in `message!` in the sources below a folder.
fn in_sources(folder: &Path, sentences: &mut Sentences) {
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            in_sources(&path, sentences);
        }
        if path.extension().is_none_or(|extension| extension != "rs") || path.ends_with("protocol/src/message.rs") {
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("a source");
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        for (at, _) in text.match_indices("message!(") {
            let found = literal(&text[at + "message!(".len()..]);
            let found = found.and_then(|(code, rest)| Some((code, literal(rest.trim_start().strip_prefix(',')?)?.0)));
            let (code, sentence) = found.unwrap_or_else(|| panic!("{}: no code and sentence", path.display()));
            let sentence = sentence.replace("{{", "{").replace("}}", "}");
            let before = sentences.insert(code.clone(), sentence.clone());
            assert!(
                before.is_none_or(|before| before == sentence),
                "{code} has two sentences"
            );
        }
    }
}

/// A message of an example, and those that it contains.
fn example(message: &Message, sentences: &mut Sentences) {
    message.each(&mut |message| {
        let mut sentence = message.text.clone();
        for (name, value) in &message.params {
            let value = match value {
                Param::Number(number) => number.as_f64().unwrap_or_default().to_string(),
                Param::Text(text) => text.clone(),
                Param::Message(message) => message.text.clone(),
            };
            assert!(sentence.contains(&value), "{}: no {name} in {sentence}", message.code);
            sentence = sentence.replacen(&value, &format!("{{{name}}}"), 1);
        }
        sentences.entry(message.code.clone()).or_insert(sentence);
    });
}

fn steps() -> Vec<AxisFault> {
    let steps = [
        Step::SelfTest,
        Step::Shutdown,
        Step::SwitchOn,
        Step::Mode,
        Step::EnableOperation,
        Step::DisableOperation,
        Step::DisableVoltage,
        Step::QuickStop,
        Step::LeaveQuickStop,
        Step::FaultReset,
        Step::HomingMode,
    ];
    covers("cia402/src/axis/fault.rs", "Step", &steps);
    steps.map(|step| AxisFault::StepTimeout { step }).to_vec()
}

fn actions_done() -> Vec<Action> {
    let spindle = |direction, surface| Action::SpindleOn {
        rpm: 1200.0,
        direction,
        surface,
    };
    let surface = Some(Surface {
        m_per_minute: 80.0,
        centre_mm: 0.0,
    });
    let input = Input::Digital(3);
    let wait = |mode| Action::AwaitInput {
        input,
        mode,
        timeout_s: 2.5,
    };
    let all = vec![
        spindle(SpindleDirection::Clockwise, None),
        spindle(SpindleDirection::Counterclockwise, None),
        spindle(SpindleDirection::Clockwise, surface),
        spindle(SpindleDirection::Counterclockwise, surface),
        Action::SpindleOff,
        Action::OrientSpindle {
            degrees: 90.0,
            direction: OrientDirection::Shortest,
        },
        Action::AwaitOriented { timeout_s: None },
        Action::UserCode {
            number: 107,
            p: 1.5,
            q: 2.5,
        },
        Action::TurnSpindle {
            spindle: 2,
            rpm: Some(900.0),
        },
        Action::TurnSpindle { spindle: 2, rpm: None },
        Action::AwaitSpindle,
        Action::Mist(true),
        Action::Mist(false),
        Action::Flood(true),
        Action::Flood(false),
        Action::SelectTool { tool: 7 },
        Action::ChangeTool { tool: 7 },
        Action::SetTool { tool: 7 },
        Action::Message { number: 4 },
        Action::SetDigital { index: 3, on: true },
        Action::SetDigital { index: 3, on: false },
        Action::SetAnalog { index: 3, value: 4.5 },
        wait(WaitMode::Immediate),
        wait(WaitMode::Rise),
        wait(WaitMode::Fall),
        wait(WaitMode::High),
        wait(WaitMode::Low),
        Action::ProgramStop,
        Action::OptionalStop,
        Action::ProgramEnd,
        Action::TextEnd,
        Action::Modes { number: 4 },
    ];
    covers("crates/motion/src/element/auxiliary.rs", "Action", &all);
    all
}

/// Every order in every condition.
fn refusals() -> impl Iterator<Item = Message> {
    let bits = (0..32_u8).map(|bits| [0, 1, 2, 3, 4].map(|bit| bits >> bit & 1 == 1));
    let conditions = bits.flat_map(|[stands_by, network, homed, on_limit, loaded]| {
        Power::ALL.into_iter().flat_map(move |power| {
            Activity::ALL.into_iter().map(move |activity| Condition {
                stands_by,
                power,
                network,
                homed,
                on_limit,
                activity,
                loaded,
            })
        })
    });
    conditions.flat_map(|condition| {
        let refused = Wish::ALL
            .into_iter()
            .filter_map(move |wish| permit(wish, &condition).err());
        refused.map(|refusal| refusal.message())
    })
}

#[test]
fn the_messages() {
    let mut sentences = Sentences::new();
    for folder in std::fs::read_dir(root("crates")).expect("the crates") {
        let folder = folder.expect("an entry").path().join("src");
        if folder.is_dir() {
            in_sources(&folder, &mut sentences);
        }
    }
    let states = [DriveState::SwitchOnDisabled, DriveState::ReadyToSwitchOn];
    let left = states.map(|state| AxisFault::UnexpectedDisable { state });
    let no_code = AxisFault::Drive { error_code: 0 };
    let mut examples: Vec<Message> = OF_DRIVES
        .into_iter()
        .chain(steps())
        .chain(left)
        .chain([no_code])
        .map(fault_causes::drive)
        .collect();
    let error = |error_code| fault_causes::drive(AxisFault::Drive { error_code });
    examples.extend((1..=u16::MAX).map(error));
    examples.extend(OF_HOMING.map(fault_causes::homing));
    examples.extend(OF_SPINDLES.map(fault_causes::in_step));
    examples.extend(logic::Wrong::ALL.map(fault_causes::wrong));
    examples.extend(actions_done().into_iter().map(actions::done));
    examples.extend(Wish::ALL.map(Wish::message));
    examples.extend(Next::ALL.map(Next::message));
    examples.extend(State::ALL.map(State::message));
    examples.extend(protocol::Step::ALL.map(protocol::Step::message));
    examples.extend(Outcome::ALL.map(Outcome::message));
    examples.extend(refusals());
    for message in &examples {
        example(message, &mut sentences);
    }
    assert!(sentences.len() > 380, "{} messages", sentences.len());
    check("docs/messages.md", |_| {
        let rows = sentences
            .iter()
            .map(|(of, sentence)| row(&[&code(of), &sentence.replace('\n', "<br>")]));
        head(&["code", "sentence"]) + &rows.collect::<String>()
    });
}
