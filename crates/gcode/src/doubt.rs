//! What a program may do, but is seldom meant to do.
//!
//! In:  the lines of a program as they are run.
//! Out: [`Doubt`]s, for whoever is about to start it. None of them keeps a program from running.

use crate::Settings;
use crate::interpreter::{Interpreter, ReadSeek};
use crate::limits::CheckLimits;
use crate::machine::Machine;
use motion::canon::Source;
use std::fmt;

/// Waits of more than this are told, s.
const DWELL_S_MAX: f64 = 60.0;

/// So many cuts behind another speed of the spindle are told: as few cost no time that anybody notices.
const SPEEDS_MAX: u64 = 50;

/// Doubts that are told: behind so many, the program is not what it is taken for.
const DOUBTS_MAX: usize = 20;

/// Something to be looked at before a program is started.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubt {
    /// File of the subroutine in which it is; empty: the program itself.
    pub file: String,
    /// Line, counted from 1.
    pub line: u32,
    /// What it is.
    pub kind: DoubtKind,
}

/// What is doubtful.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DoubtKind {
    /// G4 or a cycle waits for long.
    LongDwell {
        /// How long.
        seconds: f64,
    },
    /// R of a cycle is its depth.
    DrillsNothing,
    /// The tool cuts with a speed that nothing turns.
    SpindleStands {
        /// Line of the first cut.
        cut: u32,
    },
    /// The speed of the spindle changes over and over between cuts.
    ManySpeeds {
        /// Cuts behind another speed.
        cuts: u64,
    },
}

impl fmt::Display for DoubtKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DoubtKind::LongDwell { seconds } => write!(
                f,
                "waits for {seconds} s ({:.0} min): P is seconds here, and milliseconds on some other controls",
                seconds / 60.0
            ),
            DoubtKind::DrillsNothing => {
                f.write_str("R is the depth, so that this cycle drills nothing: is one of them missing its sign?")
            }
            DoubtKind::SpindleStands { cut } => {
                write!(
                    f,
                    "S without M3 or M4: the spindle stands while the tool cuts in line {cut}"
                )
            }
            DoubtKind::ManySpeeds { cuts } => write!(
                f,
                "{cuts} cuts come behind another speed of the spindle, and the machine rests before each until it is reached: for a laser or a \
                 fast spindle, wait_for_speed = false in [spindle]"
            ),
        }
    }
}

/// Doubts so far, and what they are found by.
#[derive(Clone, Debug, Default)]
pub(crate) struct Doubts {
    found: Vec<(Source, DoubtKind)>,
    /// Where the speed of the spindle was set that does not turn.
    speed_without_turning: Option<Source>,
    /// It turns at another speed than at the last cut, since here.
    other_speed: Option<Source>,
    /// Cuts behind another speed, and where the first such speed was set.
    cuts: u64,
    first_speed: Option<Source>,
}

impl Doubts {
    fn add(&mut self, source: Source, kind: DoubtKind) {
        let is_same = |(known, _): &(Source, DoubtKind)| (known.file, known.line) == (source.file, source.line);
        if self.found.len() < DOUBTS_MAX && !self.found.iter().any(is_same) {
            self.found.push((source, kind));
        }
    }

    pub(crate) fn dwell(&mut self, source: Source, seconds: f64) {
        if seconds > DWELL_S_MAX {
            self.add(source, DoubtKind::LongDwell { seconds });
        }
    }

    pub(crate) fn drills_nothing(&mut self, source: Source) {
        self.add(source, DoubtKind::DrillsNothing);
    }

    /// The spindle is told a speed.
    pub(crate) fn speed(&mut self, source: Source, turns: bool, differs: bool) {
        match (turns, differs) {
            (false, _) => self.speed_without_turning = Some(source),
            (true, true) => self.other_speed = Some(source),
            (true, false) => {}
        }
    }

    /// The spindle is told to turn.
    pub(crate) fn turn(&mut self) {
        self.speed_without_turning = None;
    }

    /// The tool cuts.
    #[inline]
    pub(crate) fn cut(&mut self, source: Source) {
        if self.speed_without_turning.is_some() || self.other_speed.is_some() {
            self.first_cut(source);
        }
    }

    #[cold]
    fn first_cut(&mut self, source: Source) {
        if let Some(speed) = self.speed_without_turning.take() {
            self.add(speed, DoubtKind::SpindleStands { cut: source.line });
        }
        if let Some(speed) = self.other_speed.take() {
            self.cuts += 1;
            self.first_speed.get_or_insert(speed);
        }
    }

    /// All of them, in the order in which they were found.
    fn all(&self) -> impl Iterator<Item = (Source, DoubtKind)> {
        let cuts = self.cuts;
        let many = self.first_speed.filter(|_| cuts > SPEEDS_MAX);
        let many = many.map(|speed| (speed, DoubtKind::ManySpeeds { cuts }));
        self.found.iter().copied().chain(many)
    }
}

/// What is doubtful in a program; it is run to its end, or to its first mistake.
pub fn doubts<R: ReadSeek>(
    text: R,
    settings: Settings,
    machine: impl Machine + Send + 'static,
    limits: CheckLimits,
) -> Vec<Doubt> {
    let interpreter = Interpreter::new(settings).with_machine(machine);
    let mut run = interpreter.run_reader(text).within(limits);
    // What is wrong, a check tells.
    run.by_ref().find(Result::is_err);
    let doubts: Vec<(Source, DoubtKind)> = run.state.doubts.all().collect();
    let told = doubts.into_iter().map(|(source, kind)| Doubt {
        file: run.file_name(source.file).to_owned(),
        line: source.line,
        kind,
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoMachine;

    fn told(program: &str) -> Vec<String> {
        let text = std::io::Cursor::new(program.as_bytes());
        let found = doubts(text, Settings::default(), NoMachine, CheckLimits::default());
        found
            .iter()
            .map(|doubt| format!("{}: {}", doubt.line, doubt.kind))
            .collect()
    }

    #[test]
    fn what_is_seldom_meant_is_told_once_with_its_line() {
        assert_eq!(
            told("M3 S1000\no1 repeat [3]\nG4 P5000\no1 endrepeat\nG4 P60\nG0 X1\nM2\n"),
            ["3: waits for 5000 s (83 min): P is seconds here, and milliseconds on some other controls"]
        );
        assert_eq!(
            told("G98 F10 M3 S1\nG81 X1 Z1 R1\nG82 X1 Z-1 R1 P500\nM2\n"),
            [
                "2: R is the depth, so that this cycle drills nothing: is one of them missing its sign?",
                "3: waits for 500 s (8 min): P is seconds here, and milliseconds on some other controls",
            ]
        );
        assert_eq!(
            told("G0 X1\nS1000\nG0 X5\nG1 X1 F10\nX2\nM2\n"),
            ["2: S without M3 or M4: the spindle stands while the tool cuts in line 4"]
        );
    }

    #[test]
    fn speeds_that_change_over_and_over_are_counted() {
        let raster = |cuts: u32| {
            format!("F10 M3 S1\n#1 = 0\no1 repeat [{cuts}]\n#1 = [#1 + 1]\nG1 X#1 S[#1 + 1]\no1 endrepeat\nM2\n")
        };
        assert_eq!(told(&raster(50)), [""; 0]);
        let many = told(&raster(51));
        assert!(
            many.len() == 1 && many[0].starts_with("5: 51 cuts come behind another speed"),
            "{many:?}"
        );
    }

    #[test]
    fn what_is_usual_is_no_doubt() {
        for program in [
            "S1000 M3\nG1 X1 F10\nM5\nM2\n",
            "S1000\nM3\nG1 X1 F10\nM2\n",
            "G38.3 Z-1 F10\nM2\n",
            "S500\nG0 X1\nM2\n",
            "M3 S1 F1\nG81 X1 Z-1 R1\nG4 P0.5\nM2\n",
            "F1 G1 X1\nM2\n",
        ] {
            assert_eq!(told(program), [""; 0], "{program}");
        }
    }
}
