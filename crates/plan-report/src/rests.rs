//! Rests at which something is done or waited for: no stops of the path, and yet the machine stands.
//!
//! In:  a program that is run down, cycle by cycle.
//! Out: how many rests there are before a move, by what is done there. Each counts once.

use motion::element::Action;
use motion::rt::{Sample, SampleState};
use serde::Serialize;
use std::fmt;

/// What a rest is for; of several things the one that stands last here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum For {
    /// M7 to M9, M62 to M68, M100 to M199, T, a message.
    Action,
    /// M66.
    Input,
    /// G4.
    Dwell,
    /// Its speed or its angle.
    Spindle,
    /// M6.
    ToolChange,
    /// M0, M1, M60.
    Operator,
}

impl For {
    /// `None`: nothing follows that would rest for it.
    fn of(action: Action) -> Option<For> {
        match action {
            Action::SpindleOn { .. }
            | Action::SpindleOff
            | Action::OrientSpindle { .. }
            | Action::AwaitOriented { .. }
            | Action::TurnSpindle { .. }
            | Action::AwaitSpindle => Some(For::Spindle),
            Action::Mist(_)
            | Action::Flood(_)
            | Action::SelectTool { .. }
            | Action::SetTool { .. }
            | Action::Message { .. }
            | Action::SetDigital { .. }
            | Action::SetAnalog { .. }
            | Action::UserCode { .. } => Some(For::Action),
            Action::AwaitInput { .. } => Some(For::Input),
            Action::ChangeTool { .. } => Some(For::ToolChange),
            Action::ProgramStop | Action::OptionalStop => Some(For::Operator),
            Action::ProgramEnd | Action::TextEnd | Action::Modes { .. } => None,
        }
    }
}

impl fmt::Display for For {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            For::Action => "for outputs, coolant and codes",
            For::Input => "for an input",
            For::Dwell => "to dwell",
            For::Spindle => "for the spindle",
            For::ToolChange => "to change the tool",
            For::Operator => "for the operator",
        })
    }
}

/// Rests of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Rests {
    #[serde(rename = "for")]
    pub(super) what: For,
    pub(super) count: u64,
    /// Of the first.
    pub(super) line: u32,
}

impl fmt::Display for Rests {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rests { what, count, line } = self;
        match count {
            1 => write!(f, "1 {what} (line {line})"),
            _ => write!(f, "{count} {what} (the first in line {line})"),
        }
    }
}

/// Counts them while a program is run down.
#[derive(Debug, Default)]
pub(super) struct RestWatch {
    /// What the rest under way is for, and in which line.
    under_way: Option<(For, u32)>,
    rests: Vec<Rests>,
}

impl RestWatch {
    /// The next cycle.
    pub(super) fn push(&mut self, sample: &Sample) {
        if sample.velocity_mm_s > 0.0 {
            if let Some((what, line)) = self.under_way.take() {
                self.add(what, line);
            }
            return;
        }
        let what = match sample.state {
            SampleState::Dwelling => Some(For::Dwell),
            SampleState::Moving | SampleState::Acting | SampleState::Starved | SampleState::Finished => {
                sample.action.and_then(For::of)
            }
        };
        if let Some(what) = what
            && self.under_way.is_none_or(|(before, _)| before < what)
        {
            self.under_way = Some((what, sample.line));
        }
    }

    fn add(&mut self, what: For, line: u32) {
        match self.rests.iter_mut().find(|rests| rests.what == what) {
            Some(rests) => rests.count += 1,
            None => self.rests.push(Rests { what, count: 1, line }),
        }
    }

    /// The most frequent first.
    pub(super) fn finish(mut self) -> Vec<Rests> {
        self.rests.sort_by_key(|rests| std::cmp::Reverse(rests.count));
        self.rests
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::Report;
    use super::super::run_down::{Wanted, Work, run_down};
    use super::*;
    use machine::tables::Tables;
    use std::path::Path;

    fn planned(waits_for_speed: bool, text: &str) -> (Work, Report) {
        let machine = include_str!("../../../configs/mill3-demo.toml");
        let mut config = config::parse(machine, Path::new("demo.toml")).unwrap();
        config.spindle.wait_for_speed = waits_for_speed;
        let tables = Tables::read(&config).unwrap();
        let program = ("part.ngc", text.as_bytes().into());
        let work = run_down(&config, &tables, program, Some(1), Wanted::default()).unwrap();
        let report = Report::new(&config, &work);
        (work, report)
    }

    /// A laser raster: each pixel has its S. The path has no stop, and the machine rests before every pixel.
    #[test]
    fn rests_for_the_spindle_are_counted_and_told() {
        let raster = "G21 G90 F600 M3 S1\n#1 = 0\no1 repeat [60]\n#1 = [#1 + 1]\nG1 X#1 S[#1 + 1]\no1 endrepeat\nG4 P0.1\nM5\nM2\n";
        for (waits_for_speed, count) in [(true, 60), (false, 0)] {
            let (work, report) = planned(waits_for_speed, raster);
            assert_eq!(work.judged.feed.stops, 0, "{:?}", work.judged.feed.stop_places);
            // What comes behind the last move delays none.
            let wanted = [Rests {
                what: For::Spindle,
                count,
                line: 1,
            }];
            let wanted = wanted.iter().filter(|rests| rests.count > 0);
            assert_eq!(work.judged.rests.iter().collect::<Vec<_>>(), wanted.collect::<Vec<_>>());
            let text = report.to_string();
            let told = "\nrests           60 for the spindle (the first in line 1)\n";
            assert_eq!(text.contains(told), waits_for_speed, "{text}");
            assert_eq!(text.contains("\nrests "), waits_for_speed, "{text}");
            let json = serde_json::to_value(&report).unwrap();
            let rest = serde_json::json!({ "for": "spindle", "count": 60, "line": 1 });
            assert_eq!(
                json["rests"].as_array().unwrap().contains(&rest),
                waits_for_speed,
                "{json}"
            );
        }
    }

    #[test]
    fn each_rest_counts_once_by_what_takes_its_time() {
        let text = "G21 G90 F1000\nT1 M6\nG0 X1\nM64 P1\nG1 X2\nM65 P1\nM64 P2\nG1 X3\nM3 S100\nG4 P0.2\nG1 X4\nM66 P0 L3 Q1\nG1 X5\nM0\nG4 P0.1\nG1 X6\n\
                    G4 P0.1\nG1 X7\nG64\nM8\nG1 X8\nM2\n";
        let (work, _) = planned(true, text);
        let found: Vec<(For, u64, u32)> = work
            .judged
            .rests
            .iter()
            .map(|it| (it.what, it.count, it.line))
            .collect();
        // M8 is done on the way.
        assert_eq!(
            found,
            [
                (For::Action, 2, 4),
                (For::ToolChange, 1, 2),
                (For::Spindle, 1, 9),
                (For::Input, 1, 12),
                (For::Operator, 1, 14),
                (For::Dwell, 1, 17),
            ]
        );
    }
}
