//! The modes in force where the machine is: those of the block that it executes, not of the one that is read.
//!
//! In:  modes of the blocks of a program as they are read ahead of the machine, each with its number; the number that the cycle thread
//! shows. Out: those of the block under way, on the way back as well.

use gcode::InForce;
use std::collections::VecDeque;
use std::sync::mpsc;

/// Numbers that are kept behind the machine: as many elements of the plan as there is a way back over.
const KEPT: u32 = 4096;

/// The modes of one program.
pub(super) struct Executed {
    heard: mpsc::Receiver<(u32, InForce)>,
    /// From those of the block under way on; before them, those that it may come back to.
    known: VecDeque<(u32, InForce)>,
    /// Number of those of the block under way; `None`: none has been reached.
    at: Option<u32>,
    /// Spindle and coolant are not switched on, whatever the program says.
    is_dry: bool,
}

/// Whether `number` comes before `other` or is the same; they count on from the greatest at 1.
fn comes_before(number: u32, other: u32) -> bool {
    other.wrapping_sub(number) < 1 << 31
}

impl Executed {
    pub(super) fn new(heard: mpsc::Receiver<(u32, InForce)>, is_dry: bool) -> Executed {
        Executed {
            heard,
            known: VecDeque::new(),
            at: None,
            is_dry,
        }
    }

    /// The machine is in the modes of this number; 0: the cycle thread shows none.
    pub(super) fn follow(&mut self, number: u32) {
        self.known.extend(self.heard.try_iter());
        let Some(at) = Some(number).filter(|number| *number > 0) else {
            return;
        };
        self.at = Some(at);
        let oldest = at.wrapping_sub(KEPT);
        while self.known.get(1).is_some_and(|(next, _)| comes_before(*next, oldest)) {
            self.known.pop_front();
        }
    }

    /// Those in force; `None`: nothing has been heard yet.
    pub(super) fn now(&self) -> Option<InForce> {
        let reached = self.at.map_or(0, |at| {
            self.known.partition_point(|(number, _)| comes_before(*number, at))
        });
        let (_, in_force) = self.known.get(reached.saturating_sub(1))?;
        let mut in_force = in_force.clone();
        if self.is_dry {
            in_force.switch_off();
        }
        Some(in_force)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gcode::{Interpreter, Settings};

    /// Modes that differ in F, from F1 on.
    fn modes(count: u32) -> Vec<InForce> {
        let text: String = (1..=count).map(|feed| format!("F{feed}\n")).collect();
        let (to, heard) = mpsc::channel();
        let run = Interpreter::new(Settings::default())
            .run(text.as_bytes())
            .as_mdi()
            .telling_modes(to);
        assert!(run.into_iter().all(|event| event.is_ok()));
        heard.iter().skip(1).map(|(_, modes)| modes).collect()
    }

    fn feed(executed: &Executed) -> Option<String> {
        executed.now()?.words().into_iter().find(|word| word.starts_with('F'))
    }

    #[test]
    fn the_modes_shown_are_those_of_the_number_that_the_cycle_shows_to_and_fro() {
        let (to, heard) = mpsc::channel();
        let mut executed = Executed::new(heard, false);
        executed.follow(0);
        assert_eq!(feed(&executed), None);
        for (number, modes) in [1, 2, 3, 7].into_iter().zip(modes(4)) {
            to.send((number, modes)).unwrap();
        }
        for (shown, expected) in [
            (0, "F1"),
            (1, "F1"),
            (3, "F3"),
            (2, "F2"),
            (0, "F2"),
            (6, "F3"),
            (7, "F4"),
        ] {
            executed.follow(shown);
            assert_eq!(feed(&executed).as_deref(), Some(expected), "{shown}");
        }
    }

    #[test]
    fn what_lies_far_behind_is_forgotten_and_numbers_begin_anew_behind_the_greatest() {
        let (to, heard) = mpsc::channel();
        let mut executed = Executed::new(heard, false);
        let all = modes(10_000);
        let number_of = |place: usize| match (u32::MAX - 4999).checked_add(place as u32) {
            Some(number) => number,
            None => (place - 4999) as u32,
        };
        for (place, modes) in all.iter().enumerate() {
            to.send((number_of(place), modes.clone())).unwrap();
            executed.follow(number_of(place));
            assert_eq!(executed.now().as_ref(), Some(modes), "{place}");
        }
        assert!(executed.known.len() <= KEPT as usize + 2, "{}", executed.known.len());
        executed.follow(number_of(6000));
        assert_eq!(feed(&executed).as_deref(), Some("F6001"));
    }

    #[test]
    fn what_runs_dry_shows_spindle_and_coolant_off() {
        for (is_dry, words) in [(false, ["M3", "M8"]), (true, ["M5", "M9"])] {
            let (to, heard) = mpsc::channel();
            let run = Interpreter::new(Settings::default())
                .run(b"M3 S100 M8\n")
                .as_mdi()
                .telling_modes(to);
            assert!(run.into_iter().all(|event| event.is_ok()));
            let mut executed = Executed::new(heard, is_dry);
            executed.follow(2);
            let found = executed.now().unwrap().words();
            assert!(
                words.iter().all(|word| found.iter().any(|found| found == word)),
                "{found:?}"
            );
        }
    }
}
