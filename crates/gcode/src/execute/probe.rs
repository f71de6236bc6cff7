//! Probing: G38.2 to G38.5, and what parameters tell of it.
//!
//! In:  the words of the line; behind the move, how it ended ([`Machine::probed`](crate::Machine::probed)).
//! Out: the move between [`Call::Probe`]s; then the point in #5061 to #5069, #5070, and the current point.

use super::feed::PathLength;
use crate::block::Block;
use crate::code::FeedUnit;
use crate::error::{ErrorKind, ProbeError};
use crate::machine::Probed;
use crate::parameter::{PROBED, PROBED_POINT};
use crate::scan::Fault;
use crate::state::{Calls, Question, State};
use motion::canon::{Axis, Call, Position, ProbeEnd, ProbeMode};

impl State {
    pub(super) fn probe(&mut self, mode: ProbeMode, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let span = block.motion_span();
        let refuse = |error| Err((span, ErrorKind::Probe(error)));
        if self.compensation.cutter.is_some() {
            return refuse(ProbeError::Compensated);
        }
        if block.first_axis().is_none() {
            let code = self.motion_name(block);
            return Err((span, ErrorKind::AxisMissing { code }));
        }
        match self.modal.feed_unit {
            FeedUnit::InverseTime => return refuse(ProbeError::InverseTime),
            FeedUnit::UnitsPerTurn => return refuse(ProbeError::PerTurn),
            FeedUnit::UnitsPerMinute => {}
        }
        let (from, to) = (self.at, self.end(block)?);
        self.need_feed(block, || PathLength::straight(from, to), calls)?;
        if from == to {
            return refuse(ProbeError::Nowhere);
        }
        calls.extend([Call::Probe(true), Call::StraightProbe { to, mode }, Call::Probe(false)]);
        self.questions.push(Question::Probe { from, to, mode });
        self.at = to;
        Ok(())
    }

    /// Takes over how a probing move ended; `None`: there is no machine, the move is taken as run without contact.
    pub(super) fn probed(
        &mut self,
        from: Position,
        to: Position,
        mode: ProbeMode,
        probed: Option<Probed>,
    ) -> Result<(), ErrorKind> {
        // Without a machine nothing is wrong.
        let error = probed.and_then(|probed| fault(probed.end, mode));
        let probed = probed.unwrap_or_else(|| Probed {
            end: ProbeEnd::Missed,
            at: to,
            rest: backed_off(from, to),
        });
        let tripped = probed.end == ProbeEnd::Tripped;
        self.at = probed.rest;
        self.parameters.set_position(PROBED_POINT, probed.at, self.modal.unit);
        self.parameters.set(PROBED, f64::from(u8::from(tripped)));
        error.map_or(Ok(()), |error| Err(ErrorKind::Probe(error)))
    }
}

/// What is wrong with a move that ended so.
fn fault(end: ProbeEnd, mode: ProbeMode) -> Option<ProbeError> {
    if end.is_fine(mode) {
        return None;
    }
    Some(match (end, mode.towards) {
        (ProbeEnd::Aborted, _) => ProbeError::Aborted,
        (ProbeEnd::Already, true) => ProbeError::InContact,
        (ProbeEnd::Already, false) => ProbeError::OffContact,
        (ProbeEnd::Tripped | ProbeEnd::Missed, true) => ProbeError::NoContact,
        (ProbeEnd::Tripped | ProbeEnd::Missed, false) => ProbeError::ContactStays,
    })
}

/// How far the stand-alone interpreter of LinuxCNC backs off from the end of a probing move, mm.
const BACK_OFF_MM: f64 = 0.254;

/// A point at that distance before `to` on the way from `from`: a program that computes with where it rests must not
/// rely on resting where it touched.
fn backed_off(from: Position, to: Position) -> Position {
    let main = [Axis::X, Axis::Y, Axis::Z];
    let distance_mm = main
        .iter()
        .fold(0.0, |sum, axis| libm::hypot(sum, from[*axis] - to[*axis]));
    let mut rest = to;
    if distance_mm > 0.0 {
        for axis in main {
            rest[axis] += BACK_OFF_MM * (from[axis] - to[axis]) / distance_mm;
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::printed::{printed, printed_with};
    use crate::{Machine, Settings};

    /// Touches something at this X.
    struct WallAt(f64);

    impl Machine for WallAt {
        fn probed(&mut self, from: Position, to: Position, _: ProbeMode) -> Option<Probed> {
            let WallAt(x_mm) = *self;
            let tripped = (from[Axis::X]..=to[Axis::X]).contains(&x_mm);
            let mut at = to;
            if tripped {
                at[Axis::X] = x_mm;
            }
            let mut rest = at;
            rest[Axis::X] += 0.5;
            let end = if tripped { ProbeEnd::Tripped } else { ProbeEnd::Missed };
            Some(Probed { end, at, rest })
        }
    }

    #[test]
    fn without_a_machine_the_move_ends_before_its_end() {
        // As LinuxCNC's interpreter prints it.
        let program = "F10 G0 X0 Z5\nG38.2 Z-5\n(debug,#5061 #5063 #5070 #5422)\nG38.3 X1\nM2\n";
        assert_eq!(
            printed(program),
            "SET_FEED_RATE(10.0000)\n\
             STRAIGHT_TRAVERSE(0.0000, 0.0000, 5.0000, 0.0000, 0.0000, 0.0000)\n\
             TURN_PROBE_ON()\n\
             STRAIGHT_PROBE(0.0000, 0.0000, -5.0000, 0.0000, 0.0000, 0.0000)\n\
             TURN_PROBE_OFF()\n\
             MESSAGE(\"0.000000 -5.000000 0.000000 -4.746000\")\n\
             TURN_PROBE_ON()\n\
             STRAIGHT_PROBE(1.0000, 0.0000, -4.7460, 0.0000, 0.0000, 0.0000)\n\
             TURN_PROBE_OFF()\n"
        );
    }

    #[test]
    fn the_program_knows_where_it_touched_in_its_units_at_that_time() {
        let program = "G20 F1\nG38.2 X2\n(debug,#5061 #5070 #5420)\nG21 (debug,#5061 #5420)\nM2\n";
        let shown = printed_with(program, Settings::default(), WallAt(25.4));
        assert!(shown.contains("MESSAGE(\"1.000000 1.000000 1.019685\")\n"), "{shown}");
        assert!(shown.contains("MESSAGE(\"1.000000 1.019685\")\n"), "{shown}");
    }

    #[test]
    fn a_missing_contact_stops_where_the_code_demands_one() {
        let run = |code: &str| {
            let program = format!("F10\n{code} X10\n(debug,#5070)\nM2\n");
            printed_with(&program, Settings::default(), WallAt(99.0))
        };
        for (code, error) in [
            ("G38.2", "G38.2 came to its end without contact"),
            ("G38.4", "G38.4 came to its end still in contact"),
        ] {
            let shown = run(code);
            assert!(shown.contains(error) && !shown.contains("MESSAGE"), "{shown}");
        }
        for code in ["G38.3", "G38.5"] {
            assert!(run(code).ends_with("MESSAGE(\"0.000000\")\n"), "{}", run(code));
        }
    }

    /// Its probe is bent.
    struct Ends(ProbeEnd);

    impl Machine for Ends {
        fn probed(&mut self, from: Position, _: Position, _: ProbeMode) -> Option<Probed> {
            let Ends(end) = *self;
            Some(Probed {
                end,
                at: from,
                rest: from,
            })
        }
    }

    #[test]
    fn a_contact_that_is_there_already_is_told_as_that() {
        let run = |code: &str| {
            let program = format!("F10\n{code} X10\n(debug,#5070)\nM2\n");
            printed_with(&program, Settings::default(), Ends(ProbeEnd::Already))
        };
        for (code, error) in [
            ("G38.2", "2:1: G38.2 began in contact"),
            ("G38.4", "2:1: G38.4 began without contact"),
        ] {
            let shown = run(code);
            assert!(shown.contains(error) && !shown.contains("MESSAGE"), "{shown}");
        }
        for code in ["G38.3", "G38.5"] {
            assert!(run(code).ends_with("MESSAGE(\"0.000000\")\n"), "{}", run(code));
        }
    }

    #[test]
    fn every_rule_has_its_error() {
        for (program, error) in [
            ("G38.2", "2:1: G38.2 needs at least one axis word"),
            ("G38.2 X0", "2:1: the probing move ends where it begins"),
            ("F0 G38.2 X1", "2:4: G38.2 needs a feed"),
            ("G93 G38.2 X1 F1", "2:5: a probing move may end anywhere"),
            ("G95 F1 G38.3 X1", "2:8: a probing move has a speed of its own"),
            (
                "G41.1 D2 G38.2 X1",
                "2:10: a probing move while cutter compensation is on",
            ),
        ] {
            let shown = printed(&format!("F10\n{program}\nM2\n"));
            assert!(shown.lines().any(|line| line.starts_with(error)), "{program}: {shown}");
        }
    }
}
