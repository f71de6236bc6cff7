//! What is in force at a block, and what one text leaves in force for the next one: lines of MDI follow each other as those of a
//! program do.
//!
//! In:  a run, under way or at its end. Out: the words in force and the offsets, for the operator; the same modes at the start of another
//! run.
//!
//! Cutter compensation and tool-centre-point control end with a text: the moves that they change belong together.

use crate::ToolTable;
use crate::code::{Distance, FeedUnit, Retract, plane_name};
use crate::interpreter::Run;
use crate::parameter::Parameters;
use crate::state::{Modal, Offsets, Saved, State};
use motion::canon::{LengthUnit, PathMode, Position, Side, SpindleDirection, SpindleMode};
use std::sync::mpsc;

/// What blocks run in: modes, selected tool, and where work coordinates lie in the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct InForce {
    modal: Modal,
    selected: Option<u32>,
    spindles: u8,
    offsets: Offsets,
    offset_on: bool,
    /// As [`Tools::offset_of`](crate::state::Tools::offset_of).
    offset_of: Option<u32>,
    tool_centre_point: bool,
    /// Side of the cutter compensation; `None`: G40.
    side: Option<Side>,
}

impl InForce {
    fn of(state: &State) -> InForce {
        InForce {
            modal: state.modal,
            selected: state.tools.selected,
            spindles: state.settings.spindles,
            offsets: state.offsets,
            offset_on: state.tools.offset_on,
            offset_of: state.tools.offset_of,
            tool_centre_point: state.tool_centre_point,
            side: state.compensation.cutter.map(|cutter| cutter.side),
        }
    }

    /// The machine has switched spindles and coolant off, or does not switch them on.
    pub fn switch_off(&mut self) {
        self.modal.switch_off();
    }

    /// Work system in force, 1 for G54 to 9 for G59.3.
    pub fn work_system(&self) -> u8 {
        self.offsets.system
    }

    /// Machine coordinates of the work coordinates' zero with the length of the tool in force, mm and degrees.
    pub fn work_zero(&self) -> Position {
        self.offsets.machine(Position::ZERO)
    }

    /// Rotation of the work coordinates about Z, degrees.
    pub fn work_rotation_degrees(&self) -> f64 {
        self.offsets.rotation_degrees
    }

    /// The words in force, as in LinuxCNC's list of active codes: one of each modal group, F, S, and T where a tool is selected.
    pub fn words(&self) -> Vec<String> {
        let modal = &self.modal;
        let mut words = vec![modal.motion.map_or("G80".into(), |motion| motion.name())];
        let mut push = |word: &str| words.push(word.to_owned());
        push(plane_name(modal.plane));
        push(match modal.unit {
            LengthUnit::Millimetre => "G21",
            LengthUnit::Inch => "G20",
        });
        push(match modal.distance {
            Distance::Absolute => "G90",
            Distance::Incremental => "G91",
        });
        push(match modal.arc_distance {
            Distance::Absolute => "G90.1",
            Distance::Incremental => "G91.1",
        });
        push(match modal.feed_unit {
            FeedUnit::InverseTime => "G93",
            FeedUnit::UnitsPerMinute => "G94",
            FeedUnit::UnitsPerTurn => "G95",
        });
        push(match self.side {
            None => "G40",
            Some(Side::Left) => "G41",
            Some(Side::Right) => "G42",
        });
        push(match (self.offset_on, self.tool_centre_point) {
            (false, _) => "G49",
            (true, false) => "G43",
            (true, true) => "G43.4",
        });
        push(&system_word(self.offsets.system));
        push(&match modal.path_mode {
            PathMode::ExactPath => "G61".to_owned(),
            PathMode::ExactStop => "G61.1".to_owned(),
            PathMode::Continuous { tolerance_mm: None, .. } => "G64".to_owned(),
            PathMode::Continuous {
                tolerance_mm: Some(tolerance_mm),
                ..
            } => format!("G64 P{}", tolerance_mm / modal.unit.mm()),
        });
        push(if modal.diameter { "G7" } else { "G8" });
        push(match modal.retract {
            Retract::OldZ => "G98",
            Retract::R => "G99",
        });
        for (number, spindle) in modal.spindles.iter().take(usize::from(self.spindles)).enumerate() {
            let of = if number == 0 {
                String::new()
            } else {
                format!(" ${number}")
            };
            let mode = match spindle.mode {
                SpindleMode::Rpm => "G97",
                SpindleMode::ConstantSurfaceSpeed { .. } => "G96",
            };
            let turning = match spindle.turning {
                None => "M5",
                Some(SpindleDirection::Clockwise) => "M3",
                Some(SpindleDirection::Counterclockwise) => "M4",
            };
            push(&format!("{mode}{of}"));
            push(&format!("{turning}{of}"));
            push(&format!("S{}{of}", spindle.speed));
        }
        match (modal.mist, modal.flood) {
            (false, false) => push("M9"),
            (true, false) => push("M7"),
            (false, true) => push("M8"),
            (true, true) => {
                push("M7");
                push("M8");
            }
        }
        let all_on = modal.overrides.feed && modal.overrides.speed[0];
        push(if all_on { "M48" } else { "M49" });
        push(&format!("F{}", modal.feed));
        if let Some(tool) = self.selected {
            push(&format!("T{tool}"));
        }
        words
    }
}

/// Modes, length offset, selected tool, parameters that no file keeps.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    in_force: InForce,
    saved: Vec<Saved>,
    spindle: u8,
    parameters: Parameters,
}

impl Modes {
    fn of(state: &State) -> Modes {
        Modes {
            in_force: InForce {
                side: None,
                tool_centre_point: false,
                ..InForce::of(state)
            },
            saved: state.saved.iter().filter(|saved| saved.level == 0).copied().collect(),
            spindle: state.spindle,
            parameters: state.parameters.clone(),
        }
    }

    /// The machine has switched spindles and coolant off: the next text switches nothing on that it does not name.
    pub fn switch_off(&mut self) {
        self.in_force.switch_off();
        for saved in &mut self.saved {
            saved.modal.switch_off();
        }
    }

    /// The table has another offset for a tool: where that of this tool is in force (G43), the new one is from now on, also in the state
    /// that M70 has saved. Nothing moves: the axes read otherwise.
    pub fn use_offset_of(&mut self, number: u32, tools: &ToolTable) {
        let Some(offset) = tools.with_wear(number).map(|tool| tool.offset) else {
            return;
        };
        if self.in_force.offset_of == Some(number) {
            self.in_force.offsets.tool = offset;
        }
        for saved in self.saved.iter_mut().filter(|saved| saved.offset_of == Some(number)) {
            saved.tool_offset = Some(offset);
        }
    }

    /// Length offset of the tool in force (G43), mm and degrees; `None`: G49.
    pub fn tool_offset(&self) -> Option<Position> {
        let InForce { offsets, offset_on, .. } = &self.in_force;
        offset_on.then_some(offsets.tool)
    }

    /// Work system in force, 1 for G54 to 9 for G59.3.
    pub fn work_system(&self) -> u8 {
        self.in_force.work_system()
    }

    /// As [`InForce::words`].
    pub fn words(&self) -> Vec<String> {
        self.in_force.words()
    }
}

/// Who is told of the modes of blocks, and what he was told last.
pub(crate) struct Told {
    to: mpsc::Sender<(u32, InForce)>,
    last: InForce,
    number: u32,
}

/// G54 to G59.3.
fn system_word(system: u8) -> String {
    match system {
        7..=9 => format!("G59.{}", system - 6),
        _ => format!("G{}", 53 + system),
    }
}

impl Run<'_> {
    /// What is in force behind the last event.
    pub fn modes(&self) -> Modes {
        Modes::of(&self.state)
    }

    /// The same that tells the modes of its blocks as they are read: at once those in force, and from there on each time they have
    /// changed, with the number by which [`Source::modes`](motion::canon::Source::modes) of the events names them. The numbers count up
    /// from 1, and at 1 again behind the greatest. To be called last.
    pub fn telling_modes(mut self, to: mpsc::Sender<(u32, InForce)>) -> Self {
        let (last, number) = (InForce::of(&self.state), 1);
        // Nobody may listen any more.
        let _ = to.send((number, last.clone()));
        self.told = Some(Told { to, last, number });
        self
    }

    /// Number of the modes in force; 0: nobody is told of them.
    #[inline]
    pub(crate) fn modes_number(&self) -> u32 {
        self.told.as_ref().map_or(0, |told| told.number)
    }

    /// A line was run: tells its modes if they are others than those of the line before.
    #[inline]
    pub(crate) fn tell_modes(&mut self) {
        let Some(told) = &mut self.told else { return };
        let now = InForce::of(&self.state);
        if now != told.last {
            // 0 is the number of none.
            told.number = told.number.wrapping_add(1).max(1);
            told.last.clone_from(&now);
            let _ = told.to.send((told.number, now));
        }
    }

    /// The same of a text that need not end with M2, M30 or `%`: lines of MDI.
    pub fn as_mdi(mut self) -> Self {
        self.is_mdi = true;
        self
    }

    /// The same, begun in the modes that another text has left. The first events tell all of them; their source has line 0. Offsets,
    /// parameters and tools are those of the [`Settings`](crate::Settings), as ever.
    pub fn continuing(mut self, modes: &Modes) -> Self {
        let state = &mut self.state;
        state.modal = modes.in_force.modal;
        state.tools.selected = modes.in_force.selected;
        state.saved.clone_from(&modes.saved);
        state.spindle = modes.spindle;
        state.parameters.take_over(&modes.parameters);
        if let Some(offset) = modes.tool_offset() {
            state.tools.offset_on = true;
            state.tools.offset_of = modes.in_force.offset_of;
            let mut offsets = state.offsets;
            offsets.tool = offset;
            state.set_offsets(offsets);
        }
        self.calls.clear();
        self.calls.extend(state.modes_told());
        self
    }
}

#[cfg(test)]
mod tests {
    use super::InForce;
    use crate::{Interpreter, Settings, Tool};
    use motion::canon::{Call, Event, Position, SpindleDirection};
    use std::sync::mpsc;

    /// Runs one text after the other, each from the modes and at the place of the one before.
    fn in_turn(texts: &[&str]) -> (Vec<Call>, Vec<String>) {
        let (mut settings, mut modes) = (Settings::default(), None);
        let mut calls = Vec::new();
        for text in texts {
            let mut run = Interpreter::new(settings).run(text.as_bytes()).as_mdi();
            if let Some(modes) = &modes {
                run = run.continuing(modes);
            }
            calls = run.by_ref().map(|event| event.unwrap().call).collect();
            (settings, modes) = (run.snapshot(), Some(run.modes()));
        }
        (calls, modes.map(|modes| modes.words()).unwrap_or_default())
    }

    #[test]
    fn a_line_goes_on_in_the_modes_of_the_one_before() {
        let (calls, words) = in_turn(&["G20 G91 F10\n", "G1 X1 M3 S500\n", "X1 S600\n"]);
        let feeds: Vec<_> = calls
            .iter()
            .filter_map(|call| match call {
                Call::StraightFeed { to } => Some(*to),
                _ => None,
            })
            .collect();
        assert_eq!(feeds, [Position::xyz(50.8, 0.0, 0.0)], "{calls:?}");
        // What is not told again would be off for whoever moves the machine.
        assert!(
            calls.iter().any(|call| matches!(
                call,
                Call::StartSpindle {
                    direction: SpindleDirection::Clockwise,
                    ..
                }
            )),
            "{calls:?}"
        );
        assert!(!calls.iter().any(|call| matches!(call, Call::StraightTraverse { .. })));
        for word in ["G1", "G20", "G91", "M3", "S600", "F10", "G54", "G49", "M9"] {
            assert!(words.iter().any(|found| found == word), "{word}: {words:?}");
        }
    }

    /// Neither at once nor by a state that was saved before (M70, M72).
    #[test]
    fn what_the_machine_has_switched_off_stays_off() {
        let mut run = Interpreter::new(Settings::default())
            .run(b"G91 M3 S500 M8\nM70\n")
            .as_mdi();
        assert!(run.by_ref().all(|event| event.is_ok()));
        let mut modes = run.modes();
        modes.switch_off();
        let mut run = Interpreter::new(run.snapshot())
            .run(b"M72\nG0 X1\n")
            .as_mdi()
            .continuing(&modes);
        let on = run.by_ref().find(|event| {
            matches!(
                event.as_ref().unwrap().call,
                Call::StartSpindle { .. } | Call::Mist(true) | Call::Flood(true)
            )
        });
        assert_eq!(on, None);
        let words = run.modes().words();
        assert!(words.contains(&"G91".to_owned()), "the other modes stay: {words:?}");
    }

    #[test]
    fn parameters_outlast_the_line() {
        let text = [
            "#100 = 5\n#<_global> = 7\n#<local> = 8\n",
            "G1 F10 X[#100 + #<_global> + EXISTS[#<local>]]\n",
        ];
        let (calls, _) = in_turn(&text);
        let to = Position::xyz(12.0, 0.0, 0.0);
        assert!(calls.contains(&Call::StraightFeed { to }), "{calls:?}");
        // Where a probe has touched, too.
        let touched = "G21 G38.3 X3 F10\n";
        let (calls, _) = in_turn(&[touched, "G1 F10 X[#5061 + 1]\n"]);
        let to = Position::xyz(4.0, 0.0, 0.0);
        assert!(calls.contains(&Call::StraightFeed { to }), "{calls:?}");
    }

    fn long_tool() -> Tool {
        Tool {
            number: 3,
            pocket: 3,
            offset: Position::xyz(0.0, 0.0, 40.0),
            ..Tool::default()
        }
    }

    #[test]
    fn the_length_of_the_tool_stays_in_force() {
        let mut settings = Settings::default();
        settings.tools.set(long_tool()).unwrap();
        settings.tool_in_spindle = 3;
        settings.start = Position::xyz(0.0, 0.0, 100.0);
        let mut run = Interpreter::new(settings).run(b"G43\n").as_mdi();
        assert!(run.by_ref().all(|event| event.is_ok()));
        let (settings, modes) = (run.snapshot(), run.modes());
        assert!(modes.words().contains(&"G43".to_owned()));
        // Where it stands has not changed: Z reads 60, and a move to 60 goes nowhere.
        let mut run = Interpreter::new(settings)
            .run(b"G10 L20 P1 Z0\nM2\n")
            .continuing(&modes);
        assert!(run.by_ref().all(|event| event.is_ok()));
        assert_eq!(run.snapshot().work_offsets[0], Position::xyz(0.0, 0.0, 60.0));
    }

    /// G43 with H or without; not where another tool's, a given one (G43.1), a sum (G43.2) or none is in force.
    #[test]
    fn a_length_that_was_measured_anew_counts_at_once_where_it_is_in_force() {
        for (text, length) in [
            ("G43\n", 55.0),
            ("G43 H3\n", 55.0),
            ("G43 H3\nM70\nG49\nM72\n", 55.0),
            ("G43 H4\n", 7.0),
            ("G43.1 Z40\n", 40.0),
            ("G43 H3\nG43.2 H4\n", 47.0),
            ("G49\n", 0.0),
        ] {
            let mut settings = Settings::default();
            let other = Tool {
                number: 4,
                pocket: 4,
                offset: Position::xyz(0.0, 0.0, 7.0),
                ..Tool::default()
            };
            settings.tools.set(long_tool()).unwrap();
            settings.tools.set(other).unwrap();
            settings.tool_in_spindle = 3;
            let mut run = Interpreter::new(settings).run(text.as_bytes()).as_mdi();
            assert!(run.by_ref().all(|event| event.is_ok()), "{text}");
            let (mut settings, mut modes) = (run.snapshot(), run.modes());
            let mut measured = long_tool();
            measured.offset = Position::xyz(0.0, 0.0, 55.0);
            settings.tools.set(measured).unwrap();
            modes.use_offset_of(3, &settings.tools);
            let run = Interpreter::new(settings)
                .run(b"G90 G21 G0 Z0\n")
                .as_mdi()
                .continuing(&modes);
            let offset = run.filter_map(|event| match event.unwrap().call {
                Call::SetToolLengthOffset { offset } => Some(offset),
                _ => None,
            });
            assert_eq!(offset.last(), Some(Position::xyz(0.0, 0.0, length)), "{text}");
        }
    }

    #[test]
    fn an_end_of_program_leaves_what_it_resets_to() {
        for end in ["M2", "M30"] {
            let text = format!("G20 G91 G91.1 G18 G55 G95 F10 M3 S500 M8 M49\n{end}\n");
            let (_, words) = in_turn(&[&text]);
            for word in [
                "G1", "G17", "G20", "G90", "G91.1", "G94", "G54", "M5", "M9", "M48", "F0",
            ] {
                assert!(words.iter().any(|found| found == word), "{word}: {words:?}");
            }
        }
    }

    type Numbered = Vec<(u32, InForce)>;

    /// What was told of a text, and the number and line of each move.
    fn told(text: &str, settings: Settings) -> (Numbered, Vec<(u32, u32)>) {
        let (to, told) = mpsc::channel();
        let run = Interpreter::new(settings).run(text.as_bytes()).telling_modes(to);
        let moves = run.filter_map(|event| {
            let Event { source, call } = event.unwrap();
            let is_move = matches!(call, Call::StraightTraverse { .. } | Call::StraightFeed { .. });
            is_move.then_some((source.modes, source.line))
        });
        let moves = moves.collect();
        (told.try_iter().collect(), moves)
    }

    #[test]
    fn each_move_names_the_modes_of_its_block_which_are_told_once() {
        let mut settings = Settings::default();
        settings.tools.set(long_tool()).unwrap();
        settings.tool_in_spindle = 3;
        settings.work_offsets[1] = Position::xyz(10.0, 0.0, 0.0);
        settings.work_rotations_degrees[1] = 30.0;
        let text = "G21 G0 X1\nX2\nX3\nG55 G43 G1 X1 F100 M3 S1500 M8\nX5\nG92 X0\nM70\nG91 X1\nM72\nG90 X1\nM2\n";
        let (told, moves) = told(text, settings);
        let numbers: Vec<u32> = told.iter().map(|(number, _)| *number).collect();
        assert_eq!(numbers, (1..=7).collect::<Vec<u32>>(), "{told:?}");
        // G92 is the fourth, what M72 restores the sixth, what M2 leaves the last one.
        assert_eq!(moves, [(2, 1), (2, 2), (2, 3), (3, 4), (3, 5), (5, 8), (6, 10)]);
        let words = told[2].1.words();
        for word in ["G1", "G43", "G55", "S1500", "M3", "M8", "F100"] {
            assert!(words.iter().any(|found| found == word), "{word}: {words:?}");
        }
        assert_eq!(told[2].1.work_zero(), Position::xyz(10.0, 0.0, 40.0));
        assert_eq!(told[2].1.work_rotation_degrees(), 30.0);
        let [before, after] = [&told[1].1, &told[6].1].map(InForce::words);
        assert!(before.contains(&"G49".to_owned()) && before.contains(&"M5".to_owned()));
        assert!(after.contains(&"M9".to_owned()) && after.contains(&"G54".to_owned()));
    }

    /// They are let go by a later line.
    #[test]
    fn moves_that_cutter_compensation_keeps_back_name_the_modes_of_their_own_block() {
        let text = "G21 G1 X0 Y0 F100\nG41.1 D2 X10\nX20\nF50 Y20\nF60 X40\nG40 X60\nM2\n";
        let (told, moves) = told(text, Settings::default());
        for (number, line) in moves {
            let words = &told[number as usize - 1].1.words();
            let feed = match line {
                ..=3 => "F100",
                4 => "F50",
                _ => "F60",
            };
            let side = if (2..=5).contains(&line) { "G41" } else { "G40" };
            for word in [feed, side] {
                assert!(
                    words.iter().any(|found| found == word),
                    "line {line}, {word}: {words:?}"
                );
            }
        }
    }

    /// The parameter that is kept, what a new program begins with, and the words.
    #[test]
    fn a_text_leaves_one_work_system_in_force() {
        for (text, system, x) in [
            ("G21 G55 G0 X10\nM2\n", 1, 30.0),
            ("G21 G55 G0 X10\nM30\n", 1, 30.0),
            ("G21 G59.3\n", 9, 0.0),
            ("G21 M70\nG55\nM72\n", 1, -20.0),
        ] {
            let mut settings = Settings::default();
            settings.work_offsets[0] = Position::xyz(20.0, 0.0, 0.0);
            settings.work_offsets[1] = Position::xyz(40.0, 0.0, 0.0);
            settings.parameters = [(5220, 1.0)].into();
            let mut run = Interpreter::new(settings).run(text.as_bytes()).as_mdi();
            assert!(run.by_ref().all(|event| event.is_ok()), "{text}");
            let (left, modes) = (run.snapshot(), run.modes());
            assert_eq!(
                (left.work_system, left.parameters[&5220], modes.work_system()),
                (system, f64::from(system), system),
                "{text}"
            );
            let at = Interpreter::new(left).run(b"").state.at;
            assert_eq!(at, Position::xyz(x, 0.0, 0.0), "{text}");
        }
    }
}
