//! Wear and life of tools: what LinuxCNC's table has no place for.
//!
//! In:  what somebody sets, and what programs use. Out: the tool that is called in the place of one whose life is over; the file
//! `tool-life.json` of the state folder, one tool a line.

use gcode::{ToolTable, Wear};
use protocol::ToolLife;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What of a tool's life is to be otherwise; what is `None` stays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LifeChange {
    /// Minutes that it may be used; 0: as long as one likes.
    pub minutes: Option<f64>,
    /// Parts that it may be used for; 0: as many as one likes.
    pub parts: Option<u32>,
    /// Minutes that it has been used.
    pub used_minutes: Option<f64>,
    /// Parts that it has been used for.
    pub used_parts: Option<u32>,
    /// The tool that is called in its place when its life is over; 0: none.
    pub sister: Option<u32>,
}

/// A line of the file. Lengths are in the unit of the machine.
#[derive(Serialize, Deserialize)]
struct Line {
    tool: u32,
    #[serde(default)]
    length_wear: f64,
    #[serde(default)]
    diameter_wear: f64,
    #[serde(flatten)]
    life: ToolLife,
}

/// The life of each tool of which something is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Lives(BTreeMap<u32, ToolLife>);

impl Lives {
    /// Reads the file: its lives, and the wear that it puts into a table.
    ///
    /// # Errors
    /// What is wrong, with the line.
    pub(super) fn parse(text: &[u8], tools: &mut ToolTable) -> Result<Lives, String> {
        let mut lives = Lives::default();
        for (number, line) in (1..).zip(text.split(|octet| *octet == b'\n')) {
            if line.trim_ascii().is_empty() {
                continue;
            }
            let told = |what: &dyn std::fmt::Display| format!("line {number}: {what}");
            let line: Line = serde_json::from_slice(line).map_err(|error| told(&error))?;
            let life = &line.life;
            if [life.minutes.unwrap_or(0.0), life.used_minutes]
                .into_iter()
                .any(|minutes| minutes < 0.0)
            {
                return Err(told(&"minutes are not negative"));
            }
            let scale = tools.unit().mm();
            let wear = Wear {
                length_mm: line.length_wear * scale,
                diameter_mm: line.diameter_wear * scale,
            };
            tools.set_wear(line.tool, wear).map_err(|error| told(&error))?;
            if lives.0.insert(line.tool, line.life).is_some() {
                return Err(told(&format_args!("T{} is already in a line above", line.tool)));
            }
        }
        Ok(lives)
    }

    /// The text of the file.
    pub(super) fn write(&self, tools: &ToolTable) -> String {
        let scale = tools.unit().mm();
        let mut text = String::new();
        for tool in tools.tools() {
            let (wear, life) = (tools.wear(tool.number), self.of(tool.number));
            if wear == Wear::default() && life == ToolLife::default() {
                continue;
            }
            let line = Line {
                tool: tool.number,
                length_wear: wear.length_mm / scale,
                diameter_wear: wear.diameter_mm / scale,
                life,
            };
            // Numbers and names: nothing in it that cannot be written.
            text.push_str(&serde_json::to_string(&line).unwrap_or_default());
            text.push('\n');
        }
        text
    }

    pub(super) fn of(&self, tool: u32) -> ToolLife {
        self.0.get(&tool).copied().unwrap_or_default()
    }

    pub(super) fn change(&mut self, tool: u32, change: &LifeChange) {
        let mut life = self.of(tool);
        if let Some(minutes) = change.minutes {
            life.minutes = Some(minutes).filter(|minutes| *minutes > 0.0);
        }
        if let Some(parts) = change.parts {
            life.parts = Some(parts).filter(|parts| *parts > 0);
        }
        life.used_minutes = change.used_minutes.unwrap_or(life.used_minutes);
        life.used_parts = change.used_parts.unwrap_or(life.used_parts);
        if let Some(sister) = change.sister {
            life.sister = Some(sister).filter(|sister| *sister != 0);
        }
        self.put(tool, life);
    }

    /// A tool was used. Whether its life is over by that.
    pub(super) fn use_up(&mut self, tool: u32, minutes: f64, parts: u32) -> bool {
        let before = self.of(tool);
        let life = ToolLife {
            used_minutes: before.used_minutes + minutes,
            used_parts: before.used_parts.saturating_add(parts),
            ..before
        };
        self.put(tool, life);
        life.is_over() && !before.is_over()
    }

    fn put(&mut self, tool: u32, life: ToolLife) {
        match life == ToolLife::default() {
            true => self.0.remove(&tool),
            false => self.0.insert(tool, life),
        };
    }

    /// The tools that are called in the place of those whose life is over, each the first of its row that can still be used.
    pub(super) fn sisters(&self, tools: &ToolTable) -> BTreeMap<u32, u32> {
        let over = self.0.iter().filter(|(_, life)| life.is_over());
        over.filter_map(|(tool, _)| Some((*tool, self.sister(*tool, tools)?)))
            .collect()
    }

    fn sister(&self, tool: u32, tools: &ToolTable) -> Option<u32> {
        let mut at = tool;
        // A row that leads back to its beginning has no end.
        for _ in 0..self.0.len() {
            at = self.of(at).sister?;
            if at == tool || tools.by_number(at).is_none() {
                return None;
            }
            if !self.of(at).is_over() {
                return Some(at);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gcode::ToolChanger;
    use motion::canon::LengthUnit;

    fn table() -> ToolTable {
        ToolTable::parse(
            b"T1 P1 Z10 D6\nT2 P2 Z20 D6\nT3 P3 Z30 D6\n",
            LengthUnit::Inch,
            ToolChanger::Fixed,
        )
        .unwrap()
    }

    #[test]
    fn what_is_written_is_read_again() {
        let mut tools = table();
        let wear = Wear {
            length_mm: -0.0254,
            diameter_mm: 0.01 * 25.4,
        };
        tools.set_wear(2, wear).unwrap();
        let mut lives = Lives::default();
        let change = LifeChange {
            minutes: Some(30.0),
            parts: Some(0),
            sister: Some(3),
            ..LifeChange::default()
        };
        lives.change(2, &change);
        assert!(!lives.use_up(2, 29.5, 4));
        let text = lives.write(&tools);
        assert_eq!(text.lines().count(), 1, "{text}");
        let mut again = table();
        assert_eq!(Lives::parse(text.as_bytes(), &mut again).unwrap(), lives);
        assert_eq!(again.wear(2), wear);
        assert!(lives.use_up(2, 0.5, 0) && !lives.use_up(2, 0.5, 0), "over once");
        assert_eq!(lives.sisters(&tools), BTreeMap::from([(2, 3)]));
    }

    #[test]
    fn a_row_of_sisters_is_gone_along_and_has_an_end() {
        let tools = table();
        let mut lives = Lives::default();
        let mut life = |tool, sister, used| {
            let change = LifeChange {
                parts: Some(10),
                used_parts: Some(used),
                sister: Some(sister),
                ..LifeChange::default()
            };
            lives.change(tool, &change);
            lives.sisters(&tools)
        };
        assert_eq!(life(1, 2, 10), BTreeMap::from([(1, 2)]));
        assert_eq!(life(2, 3, 12), BTreeMap::from([(1, 3), (2, 3)]));
        assert_eq!(life(3, 1, 9), BTreeMap::from([(1, 3), (2, 3)]));
        assert_eq!(life(3, 1, 10), BTreeMap::new());
        assert_eq!(life(1, 77, 10), BTreeMap::new(), "there is no such tool");
        assert_eq!(life(1, 1, 10), BTreeMap::new(), "nor is it its own");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (text, expected) in [
            ("{\"tool\":1}\n\nnonsense\n", "line 3: "),
            ("{\"tool\":1}\n{\"tool\":1}\n", "line 2: T1 is already in a line above"),
            ("{\"tool\":1,\"used_minutes\":-1}", "line 1: minutes are not negative"),
            (
                "{\"tool\":1,\"length_wear\":1e300}",
                "line 1: Z of the tool is out of range",
            ),
            ("{\"length_wear\":1}", "line 1: missing field `tool`"),
        ] {
            let error = Lives::parse(text.as_bytes(), &mut table()).unwrap_err();
            assert!(error.starts_with(expected), "{text}: {error}");
        }
        assert!(Lives::parse(b"", &mut table()).is_ok());
    }

    proptest::proptest! {
        #[test]
        fn any_octets_are_read_or_refused(text in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..300)) {
            let _ = Lives::parse(&text, &mut table());
        }
    }
}
