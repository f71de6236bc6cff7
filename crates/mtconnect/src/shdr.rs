//! SHDR: lines of text for an agent of somebody else, which connects and reads them.
//!
//! In:  an agent's observations; what the other end says. Out: lines, and answers to its pings.

use crate::agent::Agent;
use crate::model::Item;
use crate::ring::{Condition, Observation, Value};
use crate::time::stamp;

/// The other end is told to look for us after this, ms.
const HEARTBEAT_MS: u32 = 10_000;

/// A connection of an agent.
#[derive(Debug, Default)]
pub struct Adapter {
    next: Option<u64>,
}

impl Adapter {
    /// All that is new; at first, who speaks and how everything is.
    pub fn lines(&mut self, agent: &Agent) -> String {
        let (first, next) = agent.range();
        let mut text = String::new();
        match self.next.replace(next).filter(|told| *told >= first) {
            Some(told) => agent.shown(told).for_each(|(item, seen)| line(&mut text, item, seen)),
            None => {
                text.push_str("* shdrversion: 2\n");
                text.push_str(&format!(
                    "* uuid: {}\n* device: {}\n",
                    agent.device_uuid(),
                    agent.device_name()
                ));
                agent.latest().for_each(|(item, seen)| line(&mut text, item, seen));
            }
        }
        text
    }

    /// The answer to a line of the other end.
    pub fn heard(line: &str) -> Option<String> {
        (line.trim_end() == "* PING").then(|| format!("* PONG {HEARTBEAT_MS}\n"))
    }
}

fn line(text: &mut String, item: &Item, seen: &Observation) {
    // The other end counts its own assets.
    if item.kind.starts_with("ASSET_") {
        return;
    }
    let value = match &seen.value {
        Value::Unavailable if item.category == crate::model::Category::Condition => "UNAVAILABLE||||".to_owned(),
        Value::Unavailable if item.kind == "MESSAGE" => "|UNAVAILABLE".into(),
        Value::Unavailable => "UNAVAILABLE".into(),
        // A message has a code of its own before it, which may be empty.
        Value::Text(value) if item.kind == "MESSAGE" => format!("|{}", field(value)),
        Value::Text(value) => field(value),
        Value::Set(entries) => {
            let pairs: Vec<String> = entries.iter().map(|(key, value)| format!("{key}={value}")).collect();
            field(&pairs.join(" "))
        }
        Value::Condition(Condition::Normal(code)) => {
            format!("NORMAL|{}|||", field(code.as_deref().unwrap_or_default()))
        }
        Value::Condition(Condition::Warning { code, text }) => format!("WARNING|{}|||{}", field(code), field(text)),
        Value::Condition(Condition::Fault { code, text }) => format!("FAULT|{}|||{}", field(code), field(text)),
    };
    text.push_str(&format!("{}|{}|{value}\n", stamp(seen.time), item.id));
}

/// A field: one with a bar in it stands in marks, and is one line.
fn field(text: &str) -> String {
    let plain: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    match plain.contains('|') {
        true => format!("\"{}\"", plain.replace('|', "\\|")),
        false => plain,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Alarm, Facts, Machine, Settings, Subject};
    use std::time::Duration;

    #[test]
    fn lines_tell_everything_first_and_then_what_is_new() {
        let machine = Machine {
            name: "mill".into(),
            uuid: "u-1".into(),
            ..Machine::default()
        };
        let settings = Settings {
            sender: "pc".into(),
            instance: 1,
            buffer: 64,
            errors: crate::Errors::Typed,
        };
        let now = Duration::from_secs(5);
        let mut agent = Agent::new(&machine, settings, now);
        let mut adapter = Adapter::default();
        let first = adapter.lines(&agent);
        assert!(first.starts_with(
            "* shdrversion: 2\n* uuid: u-1\n* device: mill\n1970-01-01T00:00:05.000000Z|avail|UNAVAILABLE\n"
        ));
        assert!(
            first.contains("|system|UNAVAILABLE||||\n") && !first.contains("asset_"),
            "{first}"
        );
        assert_eq!(adapter.lines(&agent), "");
        let mut facts = Facts {
            message: Some("a|b\nc".into()),
            alarms: vec![Alarm {
                subject: Subject::System,
                code: "X-1".into(),
                text: "off".into(),
                is_warning: false,
            }],
            ..Facts::default()
        };
        agent.observe(&facts, now);
        let told = adapter.lines(&agent);
        assert!(told.contains("|message||\"a\\|b c\"\n"), "{told}");
        assert!(told.contains("|system|FAULT|X-1|||off\n"), "{told}");
        facts.alarms.clear();
        agent.observe(&facts, now);
        assert_eq!(adapter.lines(&agent), "1970-01-01T00:00:05.000000Z|system|NORMAL||||\n");
        // Who was too slow is told everything again.
        for line in 0..200 {
            facts.line = Some(line);
            agent.observe(&facts, now);
        }
        assert!(adapter.lines(&agent).starts_with("* shdrversion"));
        assert_eq!(Adapter::heard("* PING\r\n").as_deref(), Some("* PONG 10000\n"));
        assert_eq!(Adapter::heard("x"), None);
    }
}
